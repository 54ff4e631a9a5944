//! Conditions on named patches: supports, loads, heat; the body force; the resultants of a patch.
//!
//! Only the particles of patches are visited: the loops over the body know nothing of boundaries.

mod contact;
mod heat;
mod loads;
mod supports;

use crate::error::{Error, Result};
use crate::formulation::url::{State, Url};
use crate::layout::{Array, Layout};
use crate::ledger::{ContactResultant, Resultant};
use crate::math::*;
use crate::particles::{Particles, PatchFacets};
use crate::reference::Reference;
use crate::scene::{ScalarFunction, Scene, VectorFunction};
use contact::Wall;
pub use contact::{Approach, Exchange, WallState};
use heat::Heat;
use loads::Load;
use supports::Supported;

/// A named patch of boundary particles.
#[derive(Debug, Clone, PartialEq)]
pub struct Patch {
    /// Name, as in the scene's `boundary` and `patches`.
    pub name: String,
    /// Particles, 0-based in the caller's order, ascending.
    pub particles: Vec<usize>,
    /// Tributary areas in the initial configuration [m^2], one per particle.
    pub areas: Vec<f64>,
    /// Unit outward normals in the initial configuration, one per particle.
    pub normals: Vec<[f64; 3]>,
}

/// What can be set from outside on a patch.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Quantity {
    /// Dead traction [Pa], 3 components.
    Traction,
    /// Follower pressure [Pa], 1 component.
    Pressure,
    /// Prescribed velocity [m/s], 3 components.
    Velocity,
    /// Heat flux into the body per unit initial area [W/m^2], 1 component.
    HeatFlux,
    /// Prescribed absolute temperature [K], 1 component.
    Temperature,
    /// Heat transfer coefficient of the convection [W/(m^2 K)], 1 component.
    ConvectionCoefficient,
    /// Absolute temperature of the surroundings that the convection leads to [K], 1 component.
    AmbientTemperature,
}

impl Quantity {
    /// All quantities.
    pub const ALL: [Self; 7] = [
        Self::Traction,
        Self::Pressure,
        Self::Velocity,
        Self::HeatFlux,
        Self::Temperature,
        Self::ConvectionCoefficient,
        Self::AmbientTemperature,
    ];
    /// Name: `traction`, `pressure`, `velocity`, `heat_flux`, `temperature`,
    /// `convection_coefficient`, `ambient_temperature`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Traction => "traction",
            Self::Pressure => "pressure",
            Self::Velocity => "velocity",
            Self::HeatFlux => "heat_flux",
            Self::Temperature => "temperature",
            Self::ConvectionCoefficient => "convection_coefficient",
            Self::AmbientTemperature => "ambient_temperature",
        }
    }
    /// Components per value.
    pub fn components(self) -> usize {
        match self {
            Self::Traction | Self::Velocity => 3,
            _ => 1,
        }
    }
    /// SI unit.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Traction | Self::Pressure => "Pa",
            Self::Velocity => "m/s",
            Self::HeatFlux => "W/m^2",
            Self::Temperature | Self::AmbientTemperature => "K",
            Self::ConvectionCoefficient => "W/(m^2.K)",
        }
    }
    /// Where it stands in the condition of a patch.
    fn path(self) -> &'static str {
        match self {
            Self::ConvectionCoefficient => "convection.coefficient",
            Self::AmbientTemperature => "convection.ambient_temperature",
            _ => self.name(),
        }
    }
    /// How a scene declares it external.
    fn declaration(self) -> String {
        let start = match self {
            Self::Traction | Self::Velocity => "[0, 0, 0]",
            Self::Temperature | Self::AmbientTemperature => "293.15",
            _ => "0",
        };
        let external = format!(r#"{{"external": {start}}}"#);
        match self.path().split_once('.') {
            Some((outer, inner)) => format!(r#""{outer}": {{"{inner}": {external}, ...}}"#),
            None => format!(r#""{}": {external}"#, self.path()),
        }
    }
    /// Whether a value makes sense, beside being finite.
    pub(crate) fn check(self, value: f64) -> std::result::Result<(), &'static str> {
        match self {
            Self::Temperature | Self::AmbientTemperature if value <= 0.0 => {
                Err("an absolute temperature is above 0 K")
            }
            Self::ConvectionCoefficient if value < 0.0 => {
                Err("a heat transfer coefficient is not negative")
            }
            _ => Ok(()),
        }
    }
}

/// An input that the scene declares as `external`.
#[derive(Debug, Clone, PartialEq)]
pub struct Input {
    /// Index of the patch in [`Simulation::patches`](crate::Simulation::patches).
    pub patch: usize,
    /// What is set.
    pub quantity: Quantity,
    /// Whether the scene declares one value per particle (`per_particle`).
    pub per_particle: bool,
    /// Start value from the scene, `quantity.components()` long.
    pub start: Vec<f64>,
}

/// Boundary of a body.
#[derive(Debug)]
pub struct Boundary {
    /// The patches in the caller's terms.
    pub patches: Vec<Patch>,
    /// What the scene declares as external.
    pub inputs: Vec<Input>,
    members: Vec<Vec<Member>>,
    loads: Vec<Load>,
    supports: Vec<Supported>,
    heat: Heat,
    walls: Vec<Wall>,
    density: f64,
    body_force: Option<VectorFunction>,
    /// Body's particle to caller's.
    order: Vec<u32>,
}

/// One particle of a patch.
#[derive(Debug, Clone, Copy)]
struct Member {
    slot: usize,
    /// X [m].
    position: [f64; 3],
    /// Sum of its tributary areas in the patch [m^2], initial.
    area: f64,
    /// Sum of A_R N [m^2], initial.
    area_vector: [f64; 3],
}

/// Where a value comes from.
#[derive(Debug, Clone)]
enum Source {
    Scalar(ScalarFunction),
    Vector(VectorFunction),
    /// Index into the inputs.
    Input(usize),
}

/// Values of the external inputs, in the order of [`Boundary::inputs`]: one value for the patch or
/// one per particle. Part of the state.
pub type InputValues = Vec<Vec<f64>>;

impl Boundary {
    /// The boundary of a scene.
    ///
    /// # Errors
    /// [`Code::InvalidScene`](crate::Code::InvalidScene) naming the patch and the particle with contradictory conditions.
    pub fn new(scene: &Scene, particles: &Particles) -> Result<Self> {
        let mut this = Self {
            patches: Vec::new(),
            inputs: Vec::new(),
            members: Vec::new(),
            loads: Vec::new(),
            supports: Vec::new(),
            heat: Heat::new(scene)?,
            walls: contact::walls(scene, particles)?,
            density: crate::material::Law::of(scene).0.density(),
            body_force: scene.body_force.as_ref().map(|f| f.compile()).transpose()?,
            order: particles.order.clone(),
        };
        for facets in &particles.patches {
            let (patch, members) = describe(facets, particles);
            this.patches.push(patch);
            this.members.push(members);
        }
        let mut constraints = Vec::new();
        for (name, condition) in &scene.boundary {
            let Some(patch) = this.patches.iter().position(|p| p.name == *name) else {
                let known: Vec<&str> = this.patches.iter().map(|p| p.name.as_str()).collect();
                return Err(Error::scene(
                    format!("boundary.{name}"),
                    format!(
                        "selects no particle; the body's patches are {}",
                        known.join(", ")
                    ),
                )
                .at_boundary(name));
            };
            this.loads_on(patch, condition)?;
            this.supports_on(patch, condition, particles, &mut constraints)?;
            this.heat_on(patch, condition, scene)?;
        }
        this.combine_supports(constraints, particles)?;
        Ok(this)
    }

    fn scalar_source(&mut self, patch: usize, quantity: Quantity, f: ScalarFunction) -> Source {
        match f {
            ScalarFunction::External {
                start,
                per_particle,
            } => self.input(patch, quantity, vec![start], per_particle),
            function => Source::Scalar(function),
        }
    }

    fn vector_source(&mut self, patch: usize, quantity: Quantity, f: VectorFunction) -> Source {
        match f {
            VectorFunction::External {
                start,
                per_particle,
            } => self.input(patch, quantity, start.to_vec(), per_particle),
            function => Source::Vector(function),
        }
    }

    fn input(
        &mut self,
        patch: usize,
        quantity: Quantity,
        start: Vec<f64>,
        per_particle: bool,
    ) -> Source {
        self.inputs.push(Input {
            patch,
            quantity,
            per_particle,
            start,
        });
        Source::Input(self.inputs.len() - 1)
    }

    /// Start values of the inputs.
    pub fn start_values(&self) -> InputValues {
        self.inputs.iter().map(|i| i.start.clone()).collect()
    }

    fn member_value<const N: usize>(
        &self,
        source: &Source,
        member: &Member,
        index: usize,
        t: f64,
        inputs: &InputValues,
    ) -> [f64; N] {
        match source {
            Source::Scalar(f) => [f.eval(member.position, t); N],
            Source::Vector(f) => {
                let v = f.eval(member.position, t);
                std::array::from_fn(|c| v[c])
            }
            Source::Input(i) => {
                let values = &inputs[*i];
                let at = if values.len() == N { 0 } else { index * N };
                std::array::from_fn(|c| values[at + c])
            }
        }
    }

    /// A value must be finite, a temperature positive; expressions may fail in places and at times
    /// not seen before.
    fn checked<const N: usize>(
        &self,
        source: &Source,
        (patch, quantity): (usize, Quantity),
        member: usize,
        t: f64,
        inputs: &InputValues,
    ) -> Result<[f64; N]> {
        let m = &self.members[patch][member];
        let value = self.member_value::<N>(source, m, member, t, inputs);
        let why = if !value.iter().all(|v| v.is_finite()) {
            "the value is not finite here: check the expression for this place and time".to_string()
        } else if let Err(why) = quantity.check(value[0]) {
            format!(
                "the value is {} here, but {why}: check the expression for this place and time",
                value[0]
            )
        } else {
            return Ok(value);
        };
        let name = &self.patches[patch].name;
        Err(
            Error::scene(format!("boundary.{name}.{}", quantity.path()), why)
                .at_boundary(name)
                .at_field(quantity.name())
                .at_particle(self.patches[patch].particles[member], Some(m.position))
                .at_time(t),
        )
    }

    /// Forces on all particles with loads, support reactions and contact: mass times acceleration
    /// [N]. `span` is a time step, for the acceleration of moving supports.
    pub fn nodal_forces(
        &self,
        url: &Url,
        state: &State,
        reference: &Reference,
        now: (f64, f64),
        inputs: &InputValues,
        walls: &[WallState],
    ) -> Result<Array<3>> {
        let mut force = self.applied_forces(url, state, reference, now.0, inputs)?;
        self.support(&mut force, now, inputs)?;
        self.contacts(&mut force, state, walls, reference, now)?;
        Ok(force)
    }

    /// What the planes of contact do, and their forces on the particles in `force`, which holds all
    /// others.
    fn contacts(
        &self,
        force: &mut Array<3>,
        state: &State,
        walls: &[WallState],
        reference: &Reference,
        now: (f64, f64),
    ) -> Result<Vec<ContactResultant>> {
        let mut resultants = self.resting_contacts(walls);
        if resultants.is_empty() {
            return Ok(resultants);
        }
        let motion = (&state.x, &state.v);
        for (slot, wall, push) in self.contact_forces(force, motion, walls, reference, now)? {
            let r = &mut resultants[wall];
            r.force = add3(r.force, push);
            r.particles += 1;
            force.set(slot, add3(force.get(slot), push));
        }
        Ok(resultants)
    }

    /// Resultants of all patches and planes.
    pub fn resultants(
        &self,
        url: &Url,
        state: &State,
        reference: &Reference,
        now: (f64, f64),
        inputs: &InputValues,
        walls: &[WallState],
    ) -> Result<(Vec<Resultant>, Vec<ContactResultant>)> {
        let (t, span) = now;
        let mut resultants: Vec<Resultant> = self
            .members
            .iter()
            .map(|members| {
                let area: f64 = members.iter().map(|m| m.area).sum();
                let mut r = Resultant::default();
                for m in members {
                    let share = m.area / area;
                    let displacement = sub3(state.x.get(m.slot), m.position);
                    r.mean_displacement = axpy3(r.mean_displacement, share, displacement);
                    r.mean_velocity = axpy3(r.mean_velocity, share, state.v.get(m.slot));
                }
                r
            })
            .collect();
        let mut act = |patch: usize, slot: usize, force: [f64; 3]| {
            let r = &mut resultants[patch];
            r.force = add3(r.force, force);
            r.moment = add3(r.moment, cross(state.x.get(slot), force));
        };
        for load in &self.loads {
            for (index, member) in self.members[load.patch].iter().enumerate() {
                let force = self.load_force(load, index, (url, state, reference), t, inputs)?;
                act(load.patch, member.slot, force);
            }
        }
        if self.supports.is_empty() && self.walls.is_empty() {
            return Ok((resultants, Vec::new()));
        }
        let mut force = self.applied_forces(url, state, reference, t, inputs)?;
        // Reaction = inertia - all other forces, along the constrained directions.
        for s in &self.supports {
            let inertia = scale3(s.mass, self.prescribed_acceleration(s, t, span, inputs)?);
            let reaction = sub3(inertia, force.get(s.slot));
            for (patch, share) in &s.shares {
                act(*patch, s.slot, mat_vec(share, reaction));
            }
        }
        self.support(&mut force, now, inputs)?;
        let contacts = self.contacts(&mut force, state, walls, reference, now)?;
        Ok((resultants, contacts))
    }

    /// Index of an input.
    pub fn input_index(&self, patch: usize, quantity: Quantity) -> Result<usize> {
        let Some(p) = self.patches.get(patch) else {
            return Err(Error::argument(format!(
                "there is no patch {patch}: the body has {} patches",
                self.patches.len()
            )));
        };
        self.inputs
            .iter()
            .position(|i| i.patch == patch && i.quantity == quantity)
            .ok_or_else(|| {
                Error::argument(format!(
                    "the scene does not drive this {} from outside: declare \
                     \"boundary\": {{\"{}\": {{{}}}}}",
                    quantity.name(),
                    p.name,
                    quantity.declaration(),
                ))
                .at_boundary(&p.name)
                .at_field(quantity.name())
            })
    }

    /// Checks values for an input: one for the patch, or one per particle.
    pub fn check_input(&self, index: usize, values: &[f64]) -> Result<()> {
        let input = &self.inputs[index];
        let (n, particles) = (input.quantity.components(), self.members[input.patch].len());
        let place = |e: Error| {
            e.at_boundary(&self.patches[input.patch].name)
                .at_field(input.quantity.name())
        };
        if values.len() != n && values.len() != n * particles {
            return Err(place(Error::argument(format!(
                "{} values given: give {n} for the whole patch or {n} x {particles} = {} for its particles",
                values.len(),
                n * particles
            ))));
        }
        for (i, value) in values.iter().enumerate() {
            if !value.is_finite() {
                return Err(place(Error::argument(format!(
                    "value {i} is {value}: only finite values can be applied"
                ))));
            }
            input
                .quantity
                .check(*value)
                .map_err(|why| place(Error::argument(format!("value {i} is {value}: {why}"))))?;
        }
        Ok(())
    }
}

/// Rate of change of a prescribed value at time `t` by a difference over `span`: one-sided where a
/// side is before the start or has no value, as sqrt(t) has none before 0.
fn rate<const N: usize>(
    now: [f64; N],
    (t, span): (f64, f64),
    value: impl Fn(f64) -> Result<[f64; N]>,
) -> [f64; N] {
    let at = |time: f64| value(time).map(|v| (time, v));
    let (from, before) = at((t - span).max(0.0)).unwrap_or((t, now));
    let (to, after) = at(t + span).unwrap_or((t, now));
    if to > from {
        std::array::from_fn(|c| (after[c] - before[c]) / (to - from))
    } else {
        [0.0; N]
    }
}

/// A patch in the caller's terms, and its members in the same order.
fn describe(facets: &PatchFacets, particles: &Particles) -> (Patch, Vec<Member>) {
    let mut members: Vec<Member> = Vec::new();
    for group in facets.facets.chunk_by(|a, b| a.particle == b.particle) {
        let body = group[0].particle as usize;
        members.push(Member {
            slot: Layout::slot(body),
            position: particles.positions[body],
            area: group.iter().map(|f| f.area).sum(),
            area_vector: group.iter().fold([0.0; 3], |s, f| add3(s, f.area_vector)),
        });
    }
    let caller = |m: &Member| particles.caller(m.slot - Layout::FIRST);
    members.sort_by_key(caller);
    let patch = Patch {
        name: facets.name.clone(),
        particles: members.iter().map(caller).collect(),
        areas: members.iter().map(|m| m.area).collect(),
        normals: members
            .iter()
            .map(|m| {
                let length = dot(m.area_vector, m.area_vector).sqrt();
                // Opposite faces of a thin part cancel: such a particle has no one normal.
                if length > 0.0 {
                    scale3(1.0 / length, m.area_vector)
                } else {
                    [0.0; 3]
                }
            })
            .collect(),
    };
    (patch, members)
}
