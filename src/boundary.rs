//! Supports and loads on named patches, body force, and the resultants of a patch.
//!
//! Only the particles of patches are visited: the loops over the body know nothing of boundaries.

use crate::error::{Error, Result};
use crate::formulation::url::{State, Url};
use crate::layout::{Array, Layout};
use crate::ledger::Resultant;
use crate::math::*;
use crate::parallel;
use crate::particles::{Particles, PatchFacets};
use crate::reference::Reference;
use crate::scene::{ScalarFunction, Scene, Support, VectorFunction};

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
}

impl Quantity {
    /// Name: `traction`, `pressure`, `velocity`.
    pub fn name(self) -> &'static str {
        match self {
            Quantity::Traction => "traction",
            Quantity::Pressure => "pressure",
            Quantity::Velocity => "velocity",
        }
    }
    /// Components per value.
    pub fn components(self) -> usize {
        if self == Quantity::Pressure { 1 } else { 3 }
    }
    /// SI unit.
    pub fn unit(self) -> &'static str {
        if self == Quantity::Velocity {
            "m/s"
        } else {
            "Pa"
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

/// A load on a patch.
#[derive(Debug)]
struct Load {
    patch: usize,
    quantity: Quantity,
    source: Source,
}

/// A particle with at least one constrained direction.
#[derive(Debug)]
struct Supported {
    slot: usize,
    mass: f64,
    /// Projector onto the constrained directions.
    projector: Mat3<f64>,
    /// Share of a patch in the reaction; the shares add up to the projector.
    shares: Vec<(usize, Mat3<f64>)>,
    /// Prescribed velocities: the patch's source, the particle's place in it, the components set.
    prescribed: Vec<Prescribed>,
}

#[derive(Debug)]
struct Prescribed {
    patch: usize,
    member: usize,
    source: Source,
    set: [bool; 3],
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
            body_force: scene.body_force.as_ref().map(|f| f.compile()).transpose()?,
            order: particles.order.clone(),
        };
        for facets in &particles.patches {
            let (patch, members) = describe(facets, particles);
            this.patches.push(patch);
            this.members.push(members);
        }
        let mut constraints: Vec<Constraint> = Vec::new();
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
            if let Some(traction) = &condition.traction {
                let source = this.vector_source(patch, Quantity::Traction, traction.compile()?);
                this.loads.push(Load {
                    patch,
                    quantity: Quantity::Traction,
                    source,
                });
            }
            if let Some(pressure) = &condition.pressure {
                let function = pressure.compile()?;
                let source = match function {
                    ScalarFunction::External {
                        start,
                        per_particle,
                    } => this.input(patch, Quantity::Pressure, vec![start], per_particle),
                    function => Source::Scalar(function),
                };
                this.loads.push(Load {
                    patch,
                    quantity: Quantity::Pressure,
                    source,
                });
            }
            if let Some(support) = condition.support {
                constraints.extend(homogeneous(patch, support, &particles.patches[patch]));
            }
            if let Some(velocity) = &condition.velocity {
                let function = velocity.compile()?;
                let set = function.free().map(|free| !free);
                let source = this.vector_source(patch, Quantity::Velocity, function);
                for (member, m) in this.members[patch].iter().enumerate() {
                    constraints.push(Constraint {
                        particle: (m.slot - Layout::FIRST) as u32,
                        patch,
                        directions: axes(set),
                        prescribed: Some((member, source.clone(), set)),
                    });
                }
            }
        }
        constraints.sort_by_key(|c| c.particle);
        let density = crate::material::Law::new(&scene.material).density();
        for group in constraints.chunk_by(|a, b| a.particle == b.particle) {
            this.supports.push(this.combine(group, particles, density)?);
        }
        Ok(this)
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

    /// All constraints of one particle in one projector.
    fn combine(
        &self,
        group: &[Constraint],
        particles: &Particles,
        density: f64,
    ) -> Result<Supported> {
        let body = group[0].particle as usize;
        for (i, a) in group.iter().enumerate() {
            for b in &group[i + 1..] {
                let prescribed = a.prescribed.is_some() || b.prescribed.is_some();
                let overlap = a
                    .directions
                    .iter()
                    .any(|u| b.directions.iter().any(|v| dot(*u, *v).abs() > 1e-9));
                if prescribed && overlap && a.patch != b.patch {
                    let (p, q) = (&self.patches[a.patch].name, &self.patches[b.patch].name);
                    return Err(Error::scene(
                        format!("boundary.{q}"),
                        format!(
                            "a particle lies on the patches `{p}` and `{q}`, and both set the same \
                             component of its velocity: leave that component free in one of them \
                             (null in `velocity`), or select patches that do not overlap"
                        ),
                    )
                    .at_boundary(q)
                    .at_particle(particles.caller(body), Some(particles.positions[body])));
                }
            }
        }
        let mut basis: Vec<[f64; 3]> = Vec::new();
        for direction in group.iter().flat_map(|c| &c.directions) {
            let rest = basis
                .iter()
                .fold(*direction, |r, e| axpy3(r, -dot(*direction, *e), *e));
            let norm = dot(rest, rest).sqrt();
            if norm > 1e-6 {
                basis.push(scale3(1.0 / norm, rest));
            }
        }
        let zero = [[0.0; 3]; 3];
        let projector = basis.iter().fold(zero, |p, e| add_outer(&p, *e, *e));
        // A direction that several patches constrain is shared by them in equal parts.
        let hold = |c: &Constraint, e: [f64; 3]| {
            c.directions.iter().map(|d| dot(*d, e).powi(2)).sum::<f64>()
        };
        let mut shares: Vec<(usize, Mat3<f64>)> = Vec::new();
        for e in &basis {
            let whole: f64 = group.iter().map(|c| hold(c, *e)).sum();
            for c in group {
                let part = add_outer(&zero, scale3(hold(c, *e) / whole, *e), *e);
                match shares.iter_mut().find(|(p, _)| *p == c.patch) {
                    Some((_, share)) => *share = add9(share, &part),
                    None => shares.push((c.patch, part)),
                }
            }
        }
        let prescribed = group
            .iter()
            .filter_map(|c| {
                let (member, source, set) = c.prescribed.clone()?;
                Some(Prescribed {
                    patch: c.patch,
                    member,
                    source,
                    set,
                })
            })
            .collect();
        Ok(Supported {
            slot: Layout::slot(body),
            mass: density * particles.volumes[body],
            projector,
            shares,
            prescribed,
        })
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

    /// A value must be finite; expressions may fail in places and at times not seen before.
    fn finite<const N: usize>(
        &self,
        value: [f64; N],
        patch: usize,
        quantity: Quantity,
        member: usize,
        t: f64,
    ) -> Result<[f64; N]> {
        if value.iter().all(|v| v.is_finite()) {
            return Ok(value);
        }
        let (name, quantity) = (&self.patches[patch].name, quantity.name());
        let m = &self.members[patch][member];
        Err(Error::scene(
            format!("boundary.{name}.{quantity}"),
            "the value is not finite here: check the expression for this place and time",
        )
        .at_boundary(name)
        .at_field(quantity)
        .at_particle(self.patches[patch].particles[member], Some(m.position))
        .at_time(t))
    }

    fn prescribed_velocity(&self, s: &Supported, t: f64, inputs: &InputValues) -> Result<[f64; 3]> {
        let mut velocity = [0.0; 3];
        for p in &s.prescribed {
            let member = &self.members[p.patch][p.member];
            let value = self.member_value::<3>(&p.source, member, p.member, t, inputs);
            let value = self.finite(value, p.patch, Quantity::Velocity, p.member, t)?;
            for c in 0..3 {
                if p.set[c] {
                    velocity[c] += value[c];
                }
            }
        }
        Ok(velocity)
    }

    /// Gives the constrained components of the velocity their values at time `t`; whether any changed.
    pub fn constrain(&self, v: &mut Array<3>, t: f64, inputs: &InputValues) -> Result<bool> {
        let mut changed = false;
        for s in &self.supports {
            let old = v.get(s.slot);
            let target = self.prescribed_velocity(s, t, inputs)?;
            let new = add3(sub3(old, mat_vec(&s.projector, old)), target);
            changed |= new != old;
            v.set(s.slot, new);
        }
        Ok(changed)
    }

    /// Kinetic energy of the constrained components [J].
    pub fn constrained_kinetic(&self, v: &Array<3>) -> f64 {
        let energy = |s: &Supported| {
            let own = mat_vec(&s.projector, v.get(s.slot));
            0.5 * s.mass * dot(own, own)
        };
        self.supports.iter().map(energy).sum()
    }

    /// Power of the forces on the constrained components [W]: what the supports have to balance.
    pub fn constrained_power(&self, force: &Array<3>, v: &Array<3>) -> f64 {
        self.supports
            .iter()
            .map(|s| dot(mat_vec(&s.projector, force.get(s.slot)), v.get(s.slot)))
            .sum()
    }

    /// Force of a load on one particle of its patch [N].
    fn load_force(
        &self,
        load: &Load,
        index: usize,
        kinematics: (&Url, &State, &Reference),
        t: f64,
        inputs: &InputValues,
    ) -> Result<[f64; 3]> {
        let member = &self.members[load.patch][index];
        if load.quantity == Quantity::Pressure {
            let value = self.member_value::<1>(&load.source, member, index, t, inputs);
            let [p] = self.finite(value, load.patch, load.quantity, index, t)?;
            // a n = H A N: the follower pressure acts on the current area.
            let (url, state, reference) = kinematics;
            let deformation = url.deformation(state, reference, member.slot);
            Ok(scale3(-p, mat_vec(&deformation.h, member.area_vector)))
        } else {
            let value = self.member_value::<3>(&load.source, member, index, t, inputs);
            let t_r = self.finite(value, load.patch, load.quantity, index, t)?;
            Ok(scale3(member.area, t_r))
        }
    }

    /// Adds tractions, pressures and body force at time `t` to `force`; returns their power [W].
    pub fn add_loads(
        &self,
        force: &mut Array<3>,
        url: &Url,
        state: &State,
        reference: &Reference,
        t: f64,
        inputs: &InputValues,
    ) -> Result<f64> {
        let mut power = 0.0;
        for load in &self.loads {
            for (index, member) in self.members[load.patch].iter().enumerate() {
                let own = self.load_force(load, index, (url, state, reference), t, inputs)?;
                power += dot(own, state.v.get(member.slot));
                force.set(member.slot, add3(force.get(member.slot), own));
            }
        }
        if let Some(body_force) = &self.body_force {
            power += self.add_body_force(body_force, force, state, reference, t)?;
        }
        Ok(power)
    }

    /// Adds V_R f_R at time `t`; returns its power.
    fn add_body_force(
        &self,
        body_force: &VectorFunction,
        force: &mut Array<3>,
        state: &State,
        reference: &Reference,
        t: f64,
    ) -> Result<f64> {
        let layout = reference.layout;
        let (x, v) = (reference.x_initial.components(), state.v.components());
        let volume = reference.volume.components()[0];
        let everywhere = !body_force.depends_on_space();
        let constant = everywhere.then(|| body_force.eval([0.0; 3], t));
        let powers = parallel::map_slabs(force.slabs_mut(), |slab, out| {
            let (first, _) = layout.slab_range(slab);
            let mut power = 0.0;
            for i in 0..out[0].len() {
                let a = first + i;
                if volume[a] == 0.0 {
                    continue;
                }
                let f = constant.unwrap_or_else(|| body_force.eval([x[0][a], x[1][a], x[2][a]], t));
                if !f.iter().all(|f| f.is_finite()) {
                    return Err(a);
                }
                for c in 0..3 {
                    out[c][i] += volume[a] * f[c];
                    power += volume[a] * f[c] * v[c][a];
                }
            }
            Ok(power)
        });
        powers
            .into_iter()
            .try_fold(0.0, |total, power| match power {
                Ok(power) => Ok(total + power),
                Err(a) => Err(Error::scene(
                    "body_force",
                    "the value is not finite here: check the expression for this place and time",
                )
                .at_particle(
                    self.order[a - Layout::FIRST] as usize,
                    Some(reference.x_initial.get(a)),
                )
                .at_time(t)),
            })
    }

    /// Rate of change of the prescribed velocity at time `t`, by a difference over `span` [m/s^2].
    fn prescribed_acceleration(
        &self,
        s: &Supported,
        t: f64,
        span: f64,
        inputs: &InputValues,
    ) -> Result<[f64; 3]> {
        if s.prescribed.is_empty() {
            return Ok([0.0; 3]);
        }
        // One-sided where a side is before the start or has no value, as sqrt(t) has none before 0.
        let now = self.prescribed_velocity(s, t, inputs)?;
        let at = |time: f64| self.prescribed_velocity(s, time, inputs).map(|v| (time, v));
        let (from, before) = at((t - span).max(0.0)).unwrap_or((t, now));
        let (to, after) = at(t + span).unwrap_or((t, now));
        if to > from {
            Ok(scale3(1.0 / (to - from), sub3(after, before)))
        } else {
            Ok([0.0; 3])
        }
    }

    /// Internal forces (in `url.rates.force`), loads and body force, without support reactions [N].
    fn applied_forces(
        &self,
        url: &Url,
        state: &State,
        reference: &Reference,
        t: f64,
        inputs: &InputValues,
    ) -> Result<Array<3>> {
        let mut force = url.rates.force.clone();
        self.add_loads(&mut force, url, state, reference, t, inputs)?;
        Ok(force)
    }

    /// Forces on all particles with loads and support reactions: mass times acceleration [N].
    /// `span` is a time step, for the acceleration of moving supports.
    pub fn nodal_forces(
        &self,
        url: &Url,
        state: &State,
        reference: &Reference,
        (t, span): (f64, f64),
        inputs: &InputValues,
    ) -> Result<Array<3>> {
        let mut force = self.applied_forces(url, state, reference, t, inputs)?;
        for s in &self.supports {
            let own = force.get(s.slot);
            let inertia = scale3(s.mass, self.prescribed_acceleration(s, t, span, inputs)?);
            force.set(s.slot, add3(sub3(own, mat_vec(&s.projector, own)), inertia));
        }
        Ok(force)
    }

    /// Resultants of all patches.
    pub fn resultants(
        &self,
        url: &Url,
        state: &State,
        reference: &Reference,
        (t, span): (f64, f64),
        inputs: &InputValues,
    ) -> Result<Vec<Resultant>> {
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
        if !self.supports.is_empty() {
            // Reaction = inertia - all other forces, along the constrained directions.
            let applied = self.applied_forces(url, state, reference, t, inputs)?;
            for s in &self.supports {
                let inertia = scale3(s.mass, self.prescribed_acceleration(s, t, span, inputs)?);
                let reaction = sub3(inertia, applied.get(s.slot));
                for (patch, share) in &s.shares {
                    act(*patch, s.slot, mat_vec(share, reaction));
                }
            }
        }
        Ok(resultants)
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
                let zero = if quantity == Quantity::Pressure {
                    "0"
                } else {
                    "[0, 0, 0]"
                };
                Error::argument(format!(
                    "the scene does not drive this {q} from outside: declare \
                     \"boundary\": {{\"{n}\": {{\"{q}\": {{\"external\": {zero}}}}}}}",
                    q = quantity.name(),
                    n = p.name,
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
        match values.iter().position(|v| !v.is_finite()) {
            Some(i) => Err(place(Error::argument(format!(
                "value {i} is {}: only finite values can be applied",
                values[i]
            )))),
            None => Ok(()),
        }
    }
}

/// Directions that one patch constrains at one particle.
struct Constraint {
    particle: u32,
    patch: usize,
    directions: Vec<[f64; 3]>,
    prescribed: Option<(usize, Source, [bool; 3])>,
}

fn axes(set: [bool; 3]) -> Vec<[f64; 3]> {
    let unit = IDENTITY;
    (0..3).filter(|c| set[*c]).map(|c| unit[c]).collect()
}

fn homogeneous(patch: usize, support: Support, facets: &PatchFacets) -> Vec<Constraint> {
    facets
        .facets
        .iter()
        .map(|facet| {
            let n = facet.normal;
            let directions = match support {
                Support::Clamped => axes([true; 3]),
                Support::Roller => vec![n],
                Support::Antisymmetry => {
                    let helper = axes([true; 3])
                        .into_iter()
                        .min_by(|a, b| dot(*a, n).abs().total_cmp(&dot(*b, n).abs()))
                        .expect("three axes");
                    let u = cross(n, helper);
                    let u = scale3(1.0 / dot(u, u).sqrt(), u);
                    vec![u, cross(n, u)]
                }
            };
            Constraint {
                particle: facet.particle,
                patch,
                directions,
                prescribed: None,
            }
        })
        .collect()
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
