//! A running simulation: the time step is written here, once.

use crate::boundary::{Approach, Boundary, Input, InputValues, Patch, Quantity, WallState};
use crate::error::{Code, Error, Result};
use crate::fields::Field;
use crate::formulation::angular_momentum;
use crate::formulation::staleness::is_strained;
use crate::formulation::url::{Breakdown, Evaluation, State, Trouble, Url};
use crate::integrator::{ANGULAR_ARMS, SSP_RK3};
use crate::layout::{Array, Layout};
use crate::ledger::{
    Accounts, ContactResultant, Energies, HeatResultant, Momenta, Resultant, Resultants,
};
use crate::material::Law;
use crate::math::*;
use crate::neighbours::Graph;
use crate::parallel::{self, Pool};
use crate::particles::{MeshSummary, Particles};
use crate::plan::Plan;
use crate::reference::{Reference, Updated};
use crate::scene::{
    InitialGradient, Numerics, ReferenceUpdate, ScalarFunction, Scene, VectorFunction,
};
use crate::snapshot::Snapshot;

/// A body in motion. Created from a [`Scene`], advanced in time, read by fields and resultants.
///
/// A failed call leaves the simulation as it was, except that [`advance`](Self::advance) keeps the
/// steps that it completed: the last good state stays readable.
#[derive(Debug)]
pub struct Simulation {
    // The scene and what follows from it.
    scene: Scene,
    scene_hash: u64,
    pool: Pool,
    boundary: Boundary,
    probes: Probes,
    mesh: Option<MeshSummary>,
    /// Body's particle to caller's, and back.
    order: Vec<u32>,
    rank: Vec<u32>,
    // The state: what a snapshot copies, with the fields of the updated reference.
    time: f64,
    steps: u64,
    state: State,
    reference: Reference,
    inputs: InputValues,
    accounts: Accounts,
    walls: Vec<WallState>,
    // Scratch: recomputed from the state.
    url: Url,
    start: State,
    velocity_before: Option<Array<3>>,
    approach: Approach,
    evaluation: Evaluation,
    resultants: Resultants,
    generation: u64,
    updates: u64,
    /// Step that waves and strains allow at time 0 [s].
    first_step: f64,
}

/// Largest decay rate times step of convection; the three stages are stable up to 2.51.
const CONVECTION_STEPS: f64 = 2.0;

/// Named points and the particles that they are interpolated from.
#[derive(Debug)]
struct Probes {
    names: Vec<String>,
    weights: Vec<Vec<(u32, f64)>>,
}

/// What an observer of [`Simulation::advance_with`] answers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Control {
    /// Go on.
    Continue,
    /// Stop after this step with [`Code::Cancelled`](crate::Code::Cancelled).
    Cancel,
}

/// What an observer sees after each time step.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Progress {
    /// Simulated time [s].
    pub time: f64,
    /// Where this call ends [s].
    pub end: f64,
    /// Step just made [s].
    pub dt: f64,
    /// Time steps since time 0.
    pub steps: u64,
    /// Where this call began [s].
    pub start: f64,
    /// Updates of the reference configuration until now.
    pub reference_updates: u64,
}

/// Motion of a probe, and its temperature.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct ProbeMotion {
    /// Displacement [m].
    pub displacement: [f64; 3],
    /// Velocity [m/s].
    pub velocity: [f64; 3],
    /// Absolute temperature [K]; `None` of a body without heat.
    pub temperature: Option<f64>,
}

/// A read-only look at a state array without a copy.
///
/// Component `c` of the particle stored in slot `s` is `data[c * component_stride + s]`; slot `s`
/// holds the caller's particle `order[s]`.
#[derive(Debug, Clone, Copy)]
pub struct View<'a> {
    /// The values.
    pub data: &'a [f64],
    /// Distance between components.
    pub component_stride: usize,
    /// Number of components.
    pub components: usize,
    /// Number of particles (slots).
    pub particles: usize,
    /// Slot to caller's particle.
    pub order: &'a [u32],
}

impl Simulation {
    /// Sets up a simulation on a pool of its own with as many threads as the machine has cores.
    ///
    /// # Errors
    /// [`Code::InvalidScene`] with the JSON path or particle, [`Code::OutOfMemory`].
    pub fn new(scene: Scene) -> Result<Self> {
        Self::with_threads(scene, 0)
    }

    /// The same with a given number of threads; 0 means as many as the machine has cores.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn with_threads(scene: Scene, threads: usize) -> Result<Self> {
        scene.validate()?;
        let scene = scene.with_preset()?;
        let pool = Pool::new(threads)?;
        let particles = pool.install(|| Particles::new(&scene))?;
        let boundary = Boundary::new(&scene, &particles)?;
        let probes = Probes::new(&scene, &particles)?;
        let (law, thermal) = Law::of(&scene);
        let numerics = &scene.numerics;
        let (reference, state, url) = pool.install(|| -> Result<_> {
            let graph = Graph::new(&particles, numerics.neighbours)?;
            let reference = Reference::new(&particles, &graph, numerics)?;
            let url = Url::new(&reference, law, thermal, numerics);
            let state = initial_state(&scene, &url, &reference, &particles)?;
            Ok((reference, state, url))
        })?;
        url.check_range(&reference).map_err(|(what, size)| {
            let message = format!(
                "single precision does not hold the numbers that this body makes: {what} is {size:.1e}; \
                 leave this out, or set \"double\""
            );
            Error::scene("numerics.precision", message)
        })?;
        let mut this = Self {
            scene_hash: crate::snapshot::scene_hash(&scene),
            mesh: particles.mesh_summary(&scene),
            pool,
            probes,
            order: particles.order,
            rank: particles.rank,
            time: 0.0,
            steps: 0,
            inputs: boundary.start_values(),
            walls: boundary.walls_at_rest(),
            approach: Approach::default(),
            boundary,
            accounts: Accounts::default(),
            start: state.clone(),
            velocity_before: numerics
                .angular_momentum_projection
                .then(|| state.v.clone()),
            state,
            reference,
            url,
            evaluation: Evaluation::default(),
            resultants: Resultants::default(),
            generation: 0,
            updates: 0,
            first_step: 0.0,
            scene,
        };
        let supplied = this.first_impulse()?;
        hold_temperatures(
            &this.boundary,
            &this.url,
            &mut this.state,
            &this.reference,
            (0.0, |_, (_, heat)| heat),
            &this.inputs,
        )?;
        this.evaluate().map_err(|e| {
            let place = e.place().clone();
            let error = Error::scene(
                "initial",
                "a particle is inverted or moves at a speed that is not finite from the start: \
                 check the displacement and the velocity",
            );
            error.at_particle(place.particle.unwrap_or(0), place.position)
        })?;
        if this.url.conducts() {
            let (url, state, reference) = (&mut this.url, &this.state, &this.reference);
            this.pool
                .install(|| url.calibrate_conduction(state, reference));
            this.evaluate()?;
        }
        if this.url.is_single_throughout()
            && this.scene.numerics.reference_update == ReferenceUpdate::Never
        {
            this.reference.forget_double();
        }
        this.first_step = this.wave_step().min(this.strain_step());
        let e = &this.evaluation;
        this.accounts.initial = e.kinetic + e.strain + e.thermal - supplied;
        this.resultants = this.compute_resultants()?;
        // A load that has no finite value at the start is an error of the scene, not of its first step.
        this.nodal_forces()?;
        Ok(this)
    }

    /// Supports and planes take hold of the initial velocity; the energy that they supply.
    fn first_impulse(&mut self) -> Result<f64> {
        let Self {
            pool,
            boundary,
            state,
            reference,
            inputs,
            walls,
            accounts,
            ..
        } = self;
        let held = boundary.constrained_kinetic(&state.v);
        boundary.constrain(&mut state.v, 0.0, inputs)?;
        let supports = boundary.constrained_kinetic(&state.v) - held;
        let contact = pool.install(|| boundary.first_contact(state, walls, reference))?;
        accounts.external_work += supports;
        accounts.exchange(contact);
        Ok(supports + contact.work - contact.dissipation)
    }

    fn nodal_forces(&self) -> Result<Array<3>> {
        let now = (self.time, self.stable_step());
        let (url, state) = (&self.url, &self.state);
        self.pool.install(|| {
            self.boundary
                .nodal_forces(url, state, &self.reference, now, &self.inputs, &self.walls)
        })
    }

    /// The scene.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Number of threads of this simulation's pool.
    pub fn threads(&self) -> usize {
        self.pool.threads()
    }

    /// What the scene costs.
    pub fn plan(&self) -> Plan {
        let (fewest, most) = self.reference.neighbour_range;
        let dt = self.stable_step();
        let (on, off) = crate::plan::features(&self.scene, self.reference.operators);
        Plan {
            particles: self.particle_count(),
            pairs: self.pair_count(),
            neighbours: (
                fewest,
                self.pair_count() as f64 / self.particle_count() as f64,
                most,
            ),
            mesh: self.mesh.clone(),
            stable_step: dt,
            steps: (self.scene.time.end / dt).ceil() as u64,
            memory: self.memory(),
            repair: self.reference.repair().copied(),
            on,
            off,
        }
    }

    /// Memory held by the simulation [bytes].
    pub fn memory(&self) -> usize {
        self.reference.bytes()
            + self.state.bytes()
            + self.start.bytes()
            + self.velocity_before.as_ref().map_or(0, Array::bytes)
            + self.url.bytes()
            + std::mem::size_of_val(&self.order[..])
            + std::mem::size_of_val(&self.rank[..])
    }

    /// Simulated time [s].
    pub fn time(&self) -> f64 {
        self.time
    }

    /// Time steps since time 0.
    pub fn steps(&self) -> u64 {
        self.steps
    }

    /// Updates of the reference configuration that were made; a return to a saved state takes none away.
    pub fn reference_updates(&self) -> u64 {
        self.updates
    }

    /// Number of particles.
    pub fn particle_count(&self) -> usize {
        self.reference.layout.particles
    }

    /// Number of directed neighbour pairs.
    pub fn pair_count(&self) -> usize {
        self.reference.pairs
    }

    /// Largest stable step from the present state [s]: the scene's fixed step, or
    /// alpha min |x_ab| lambda_ab / c_p ([URL22] 62, 63), and no more than `numerics.strain_increment` and
    /// explicit conduction and convection bear.
    pub fn stable_step(&self) -> f64 {
        if let Some(step) = self.scene.numerics.time_step {
            return step;
        }
        let linear = self.wave_step().min(self.strain_step());
        let Some(thermal) = self.url.thermal() else {
            return linear;
        };
        let (boundary, reference) = (&self.boundary, &self.reference);
        let convection = boundary.convection_rate(reference, self.time, &self.inputs);
        let decay =
            1.0 / self.evaluation.conduction_step + convection / (CONVECTION_STEPS * thermal.c_v);
        linear.min(1.0 / decay)
    }

    /// Step that waves allow [s].
    fn wave_step(&self) -> f64 {
        self.cfl_number() * self.evaluation.length / self.url.wave_speeds().pressure
    }

    /// Step that strains and turns no particle by more than the scene allows [s].
    fn strain_step(&self) -> f64 {
        self.scene.numerics.strain_increment() / self.evaluation.rate
    }

    /// The CFL number alpha of the scene, or the default for its neighbours and its Poisson ratio.
    pub fn cfl_number(&self) -> f64 {
        let (_, most) = self.reference.neighbour_range;
        let (_, [_, _, poisson_ratio]) = self.scene.material.elastic();
        self.scene.numerics.cfl_number(most, poisson_ratio)
    }

    /// Advances to exactly `t_next`, in as many stable steps as needed.
    ///
    /// # Errors
    /// [`Code::InvalidArgument`] unless `t_next` is finite and later than now;
    /// [`Code::Diverged`] with particle, position, field and time: the state is the last good one.
    pub fn advance(&mut self, t_next: f64) -> Result<()> {
        self.advance_with(t_next, &mut |_| Control::Continue)
    }

    /// The same, with an observer that is called after every step and may cancel.
    ///
    /// # Errors
    /// As [`advance`](Self::advance), and [`Code::Cancelled`].
    pub fn advance_with(
        &mut self,
        t_next: f64,
        observer: &mut dyn FnMut(&Progress) -> Control,
    ) -> Result<()> {
        if !(t_next.is_finite() && t_next > self.time) {
            return Err(Error::argument(format!(
                "cannot advance to {t_next} s: give a finite time later than now, {} s",
                self.time
            ))
            .at_time(self.time));
        }
        let (steps, accounts) = (self.steps, self.accounts);
        let before = self.take_over_inputs()?;
        let outcome = self.steps_until(t_next, observer);
        if let (Err(_), Some((velocity, entropy))) = (&outcome, before)
            && self.steps == steps
        {
            // Not one step was made: the impulse of the inputs is taken back with it.
            (self.state.v, self.state.eta) = (velocity, entropy);
            self.accounts = accounts;
            self.evaluate()?;
        }
        let resultants = self.compute_resultants();
        outcome?;
        self.resultants = resultants?;
        Ok(())
    }

    fn steps_until(
        &mut self,
        t_next: f64,
        observer: &mut dyn FnMut(&Progress) -> Control,
    ) -> Result<()> {
        let start = self.time;
        while self.time < t_next {
            let (stable, remaining) = (self.stable_step(), t_next - self.time);
            // Round-off in t_next - t must not split a step of exactly this size.
            let last = remaining <= stable * (1.0 + 1e-9);
            // Two equal steps instead of a full one and a splinter.
            let dt = if last {
                remaining
            } else {
                stable.min(0.5 * remaining)
            };
            let time = if last { t_next } else { self.time + dt };
            let share = self.wave_step().min(self.strain_step()) / self.first_step;
            let fixed = self.scene.numerics.time_step.is_some();
            if time <= self.time || (!fixed && share < self.scene.numerics.smallest_step()) {
                return Err(self.collapsed(stable, share));
            }
            self.step(dt, time)?;
            let progress = Progress {
                time: self.time,
                end: t_next,
                dt,
                steps: self.steps,
                start,
                reference_updates: self.updates,
            };
            if observer(&progress) == Control::Cancel {
                return Err(
                    Error::new(
                        Code::Cancelled,
                        "cancelled by the caller: the last whole step is kept, and the run can go on from it",
                    )
                    .at_time(self.time)
                );
            }
        }
        Ok(())
    }

    /// Why the stable step is too small to go on.
    #[cold]
    fn collapsed(&self, stable: f64, share: f64) -> Error {
        let (state, reference) = (&self.state, &self.reference);
        let caller = |slot: usize| self.order[slot - Layout::FIRST];
        let narrow = self.pool.install(|| self.url.narrowest(state, reference));
        let flow = self.strain_step() < self.wave_step();
        let slot = if flow {
            self.url.fastest(state, reference)
        } else {
            narrow.slot
        };
        let what = match narrow.pair {
            _ if flow => format!(
                "the velocity gradient has grown to {:.1e} 1/s, and a step strains no particle by more than \
                 numerics.strain_increment, {}: refine the spacing or reduce the load",
                self.evaluation.rate,
                self.scene.numerics.strain_increment(),
            ),
            Some((other, closer, deformed)) if closer < 0.5 * deformed => format!(
                "particles {} and {} have come together to {closer:.1e} of their first distance \
                 while the deformation around them gives {deformed:.1e}, so that they are on the way \
                 past each other: raise numerics.dissipation_coefficient if it is below 1, refine the \
                 spacing, leave out numerics.volume_dissipation, try numerics.operators \"repaired\" or \
                 6 neighbours under high pressure, or reduce the load",
                caller(slot),
                caller(other),
            ),
            _ => format!(
                "the body is compressed beyond what its particles resolve, here to {:.1e} of its \
                 first thickness: refine the spacing or reduce the load",
                narrow.stretch
            ),
        };
        Error::new(
            Code::Diverged,
            format!(
                "the stable step fell to {stable:.2e} s, {share:.1e} of the first one, and \
                 numerics.smallest_step is {:.1e}: {what}",
                self.scene.numerics.smallest_step()
            ),
        )
        .at_particle(caller(slot) as usize, Some(state.x.get(slot)))
        .at_time(self.time)
    }

    /// THE time step: three stages of rates, loads, blend, supports.
    fn step(&mut self, dt: f64, end: f64) -> Result<()> {
        // The first stage reads the start and writes the state, but not its history.
        std::mem::swap(&mut self.start, &mut self.state);
        if let (Some(history), Some(start)) = (&mut self.state.history, &self.start.history) {
            history.copy_from(start);
        }
        let (accounts, walls) = (self.accounts, self.walls.clone());
        match self.stages(dt, end) {
            Ok(()) => {
                self.time = end;
                self.steps += 1;
                self.generation += 1;
                Ok(())
            }
            Err(error) => {
                std::mem::swap(&mut self.start, &mut self.state);
                self.accounts = accounts;
                self.walls = walls;
                self.evaluate()?;
                Err(error)
            }
        }
    }

    fn stages(&mut self, dt: f64, end: f64) -> Result<()> {
        let Self {
            pool,
            boundary,
            state,
            reference,
            inputs,
            accounts,
            walls,
            approach,
            url,
            start,
            updates,
            ..
        } = self;
        let before = self.velocity_before.as_mut();
        let evaluation = &mut self.evaluation;
        let (time, steps, numerics) = (self.time, self.steps + 1, &self.scene.numerics);
        let order = &self.order;
        pool.install(|| {
            let diverged = |b: Breakdown, state: &State| diverged(b, state, order, end);
            let mut before = before;
            let held = boundary.constrained_kinetic(&start.v);
            let wave_speed = url.wave_speeds().pressure;
            boundary.approach(approach, start, walls, reference, wave_speed, (time, dt))?;
            for (i, stage) in SSP_RK3.into_iter().enumerate() {
                let stage_time = time + stage.time * dt;
                let share = stage.weight * dt;
                let now = if i == 0 { &*start } else { &*state };
                if let Some(before) = &mut before {
                    if i == 0 {
                        // What an abandoned step left here must not matter, not even as 0 x NaN.
                        before.copy_from(&start.v);
                    }
                    let factors = ANGULAR_ARMS[i].map(|c| c * dt);
                    let density = url.law().density();
                    let power = angular_momentum::project(
                        &mut url.rates.force,
                        now,
                        start,
                        before,
                        factors,
                        density,
                        reference,
                    );
                    accounts.projection -= share * power;
                    before.copy_from(&now.v);
                }
                let mut force = std::mem::replace(&mut url.rates.force, Array::empty());
                let power = boundary.add_loads(&mut force, url, now, reference, stage_time, inputs);
                url.rates.force = force;
                accounts.external_work +=
                    share * (power? - boundary.constrained_power(&url.rates.force, &now.v));
                accounts.dissipation += share * evaluation.dissipation;
                accounts.conduction += share * evaluation.conduction;
                if let Some(mut heat) = url.rates.heat.take() {
                    let temperature = |slot| url.evaluated_temperature(slot);
                    let power =
                        boundary.add_heat(&mut heat, temperature, reference, stage_time, inputs);
                    url.rates.heat = Some(heat);
                    accounts.heat_in += share * url.heat_power(power?);
                }
                boundary.follow(approach, i, &url.rates.force, &now.v, dt);
                url.advance_stage(state, start, reference, (stage.keep, stage.take), dt);
                let next = SSP_RK3.get(i + 1).map_or(end, |next| time + next.time * dt);
                boundary.constrain(&mut state.v, next, inputs)?;
                boundary.keep_out(approach, i, &mut state.v, walls, next)?;
                let last = i + 1 == SSP_RK3.len();
                if last {
                    accounts.plastic += url.commit(state, reference, dt);
                }
                // The entropy that a support adds makes up for that of the stage's rates: its heat is
                // that at their temperature, so that the ledger is of the integrator's order.
                let supplied = |slot, (entropy, _)| url.evaluated_temperature(slot) * entropy;
                let now = (next, supplied);
                accounts.heat_in +=
                    stage.carry * hold_temperatures(boundary, url, state, reference, now, inputs)?;
                if last && is_stale(numerics, steps, state) {
                    url.update_reference(state, reference)
                        .map_err(|b| diverged(b, state))?;
                    *updates += 1;
                }
                let elapsed = (!last).then_some(next - time);
                *evaluation = url
                    .evaluate(state, reference, elapsed)
                    .map_err(|b| diverged(b, state))?;
            }
            // What the supports did: they held the constrained components against all forces.
            accounts.external_work += boundary.constrained_kinetic(&state.v) - held;
            accounts.exchange(boundary.settle(approach, &state.v, walls));
            Ok(())
        })
    }

    /// Evaluates the right-hand side at the present state once more. It changes nothing: this is
    /// what the benches time.
    ///
    /// # Errors
    /// None for a state that a step has left.
    #[doc(hidden)]
    pub fn evaluate(&mut self) -> Result<()> {
        let Self {
            pool,
            url,
            state,
            reference,
            ..
        } = self;
        self.evaluation = pool
            .install(|| url.evaluate(state, reference, None))
            .map_err(|b| diverged(b, &self.state, &self.order, self.time))?;
        Ok(())
    }

    /// An external velocity or temperature that was set since the last step acts at once, as an
    /// impulse; the velocities and entropies before it.
    fn take_over_inputs(&mut self) -> Result<Option<(Array<3>, Option<Array<1>>)>> {
        let driven = |i: &Input| matches!(i.quantity, Quantity::Velocity | Quantity::Temperature);
        if !self.boundary.inputs.iter().any(driven) {
            return Ok(None);
        }
        let held = self.boundary.constrained_kinetic(&self.state.v);
        let old = (self.state.v.clone(), self.state.eta.clone());
        let (boundary, inputs, state) = (&self.boundary, &self.inputs, &mut self.state);
        let changed = boundary
            .constrain(&mut state.v, self.time, inputs)
            .and_then(|_| {
                hold_temperatures(
                    boundary,
                    &self.url,
                    state,
                    &self.reference,
                    (self.time, |_, (_, heat)| heat),
                    inputs,
                )
            });
        let evaluated = changed.and_then(|heat| self.evaluate().map(|()| heat));
        let heat = match evaluated {
            Ok(heat) => heat,
            Err(error) => {
                (self.state.v, self.state.eta) = old;
                self.evaluate()?;
                return Err(error);
            }
        };
        self.accounts.external_work += self.boundary.constrained_kinetic(&self.state.v) - held;
        self.accounts.heat_in += heat;
        self.generation += 1;
        Ok(Some(old))
    }

    fn compute_resultants(&self) -> Result<Resultants> {
        let now = (self.time, self.stable_step());
        let (url, state, reference) = (&self.url, &self.state, &self.reference);
        self.pool.install(|| {
            let (boundary, inputs) = (&self.boundary, &self.inputs);
            let (patches, contacts) =
                boundary.resultants(url, state, reference, now, inputs, &self.walls)?;
            let heat = match &url.rates.heat {
                None => Vec::new(),
                Some(heat) => boundary.heat_resultants(
                    heat,
                    reference,
                    |slot| url.evaluated_temperature(slot),
                    |slot, rate| url.heat_uptake(state, reference, slot, rate),
                    now,
                    inputs,
                )?,
            };
            Ok(Resultants {
                patches,
                heat,
                contacts,
            })
        })
    }

    /// Heat resultants of a patch now; `None` of a body without heat.
    ///
    /// # Panics
    /// If `patch` is not an index into [`patches`](Self::patches) of a body with heat.
    pub fn heat_resultant(&self, patch: usize) -> Option<HeatResultant> {
        (!self.resultants.heat.is_empty()).then(|| self.resultants.heat[patch])
    }

    /// Energies now.
    pub fn energies(&self) -> Energies {
        let thermal = self.url.thermal();
        self.accounts
            .energies(&self.evaluation, thermal.map_or(0.0, |t| t.theta_r))
    }

    /// Momenta now.
    pub fn momenta(&self) -> Momenta {
        let density = self.url.law().density();
        let (x, v) = (self.state.x.components(), self.state.v.components());
        let volume = self.reference.volume.components()[0];
        let mut momenta = Momenta::default();
        for a in (0..self.particle_count()).map(Layout::slot) {
            let p = [0, 1, 2].map(|c| density * volume[a] * v[c][a]);
            momenta.linear = add3(momenta.linear, p);
            momenta.angular = add3(momenta.angular, cross([x[0][a], x[1][a], x[2][a]], p));
        }
        momenta
    }

    /// The patches: every face of the geometry and every patch of the scene.
    pub fn patches(&self) -> &[Patch] {
        &self.boundary.patches
    }

    /// Index of a patch.
    ///
    /// # Errors
    /// [`Code::InvalidArgument`] naming the patches that there are.
    pub fn patch_index(&self, name: &str) -> Result<usize> {
        self.patches()
            .iter()
            .position(|p| p.name == name)
            .ok_or_else(|| {
                let names: Vec<&str> = self.patches().iter().map(|p| p.name.as_str()).collect();
                Error::argument(format!(
                    "there is no patch `{name}`; there are {}",
                    names.join(", ")
                ))
                .at_boundary(name)
            })
    }

    /// Resultants of a patch now: what its own conditions exert, and its mean motion.
    ///
    /// # Panics
    /// If `patch` is not an index into [`patches`](Self::patches).
    pub fn resultant(&self, patch: usize) -> Resultant {
        self.resultants.patches[patch]
    }

    /// Names of the scene's planes of contact, in the order of [`contact`](Self::contact).
    pub fn contact_names(&self) -> impl Iterator<Item = &str> {
        self.boundary.wall_names()
    }

    /// A point of a plane of contact at time 0 [m], and its unit normal.
    ///
    /// # Panics
    /// If `wall` is not an index into [`contact_names`](Self::contact_names).
    pub fn contact_plane(&self, wall: usize) -> ([f64; 3], [f64; 3]) {
        self.boundary.wall_plane(wall)
    }

    /// What a plane of contact does now, and has done since time 0.
    ///
    /// # Panics
    /// If `wall` is not an index into [`contact_names`](Self::contact_names).
    pub fn contact(&self, wall: usize) -> ContactResultant {
        self.resultants.contacts[wall]
    }

    /// Names of the scene's probes, in the order of [`probe`](Self::probe).
    pub fn probe_names(&self) -> &[String] {
        &self.probes.names
    }

    /// Motion and temperature of a probe, interpolated between the particles around its initial position.
    ///
    /// # Panics
    /// If `probe` is not an index into [`probe_names`](Self::probe_names).
    pub fn probe(&self, probe: usize) -> ProbeMotion {
        let mut motion = ProbeMotion {
            displacement: [0.0; 3],
            velocity: [0.0; 3],
            temperature: self.url.thermal().map(|_| 0.0),
        };
        for &(particle, weight) in &self.probes.weights[probe] {
            let slot = Layout::slot(particle as usize);
            let u = sub3(self.state.x.get(slot), self.reference.x_initial.get(slot));
            motion.displacement = axpy3(motion.displacement, weight, u);
            motion.velocity = axpy3(motion.velocity, weight, self.state.v.get(slot));
            if let Some(temperature) = &mut motion.temperature {
                *temperature += weight * self.url.temperature(&self.state, &self.reference, slot);
            }
        }
        motion
    }

    /// What the scene lets the outside set.
    pub fn inputs(&self) -> &[Input] {
        &self.boundary.inputs
    }

    /// Sets an external input: one value for the patch (`components` numbers) or one per particle
    /// of the patch (`particles x components`, row-major, in the order of [`Patch::particles`]).
    /// It holds from now on until it is set again.
    ///
    /// # Errors
    /// [`Code::InvalidArgument`] if the scene does not declare this input as `external`,
    /// if the length is neither, or if a value is not finite. Nothing is changed then.
    pub fn set_input(&mut self, patch: usize, quantity: Quantity, values: &[f64]) -> Result<()> {
        self.set_inputs(patch, &[(quantity, values)])
    }

    /// Sets several inputs of a patch, all of them or, on failure, none.
    ///
    /// # Errors
    /// As [`set_input`](Self::set_input).
    pub fn set_inputs(&mut self, patch: usize, values: &[(Quantity, &[f64])]) -> Result<()> {
        let mut given = Vec::with_capacity(values.len());
        for &(quantity, values) in values {
            let index = self.boundary.input_index(patch, quantity)?;
            self.boundary.check_input(index, values)?;
            given.push((index, values.to_vec()));
        }
        let old = self.inputs.clone();
        for (index, values) in given {
            self.inputs[index] = values;
        }
        match self.compute_resultants() {
            Ok(resultants) => self.resultants = resultants,
            Err(error) => {
                self.inputs = old;
                return Err(error);
            }
        }
        self.generation += 1;
        Ok(())
    }

    /// The present values of an external input, as last set.
    ///
    /// # Errors
    /// [`Code::InvalidArgument`] if the scene does not declare it.
    pub fn input(&self, patch: usize, quantity: Quantity) -> Result<&[f64]> {
        Ok(&self.inputs[self.boundary.input_index(patch, quantity)?])
    }

    /// Copies a field, row-major, in the caller's particle order.
    ///
    /// # Errors
    /// [`Code::InvalidArgument`] unless `out` has `particles x components` numbers.
    pub fn read_field(&self, field: Field, out: &mut [f64]) -> Result<()> {
        let n = field.info().components;
        let expected = n * self.particle_count();
        if out.len() != expected {
            return Err(Error::argument(format!(
                "the buffer holds {} numbers, the field has {} particles x {n} = {expected}",
                out.len(),
                self.particle_count()
            ))
            .at_field(field.info().name));
        }
        self.has_field(field)?;
        let force = match field {
            Field::NodalForce => Some(self.nodal_forces()?),
            _ => None,
        };
        self.pool.install(|| {
            parallel::for_each_row(out, n, |caller, row| {
                let slot = Layout::slot(self.rank[caller] as usize);
                row.copy_from_slice(&self.field_at(field, slot, force.as_ref())[..n]);
            });
        });
        Ok(())
    }

    /// Whether this scene has the field.
    ///
    /// # Errors
    /// [`Code::InvalidArgument`] with what the scene would need.
    pub fn has_field(&self, field: Field) -> Result<()> {
        let remedy = match field {
            Field::Temperature | Field::Entropy if self.state.eta.is_none() => {
                "the body has no temperature: add a section `heat` to the scene"
            }
            Field::EquivalentPlasticStrain if self.state.history.is_none() => {
                "the material has no plastic strain: choose a material with plasticity"
            }
            _ => return Ok(()),
        };
        Err(Error::argument(remedy).at_field(field.info().name))
    }

    /// Value of a field at a slot; unused components are 0.
    fn field_at(&self, field: Field, slot: usize, force: Option<&Array<3>>) -> [f64; 9] {
        let vector = |v: [f64; 3]| [v[0], v[1], v[2], 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        let scalar = |s: f64| vector([s, 0.0, 0.0]);
        let tensor = flat;
        let (x, x_initial) = (self.state.x.get(slot), self.reference.x_initial.get(slot));
        match field {
            Field::InitialPosition => return vector(x_initial),
            Field::Position => return vector(x),
            Field::Displacement => return vector(sub3(x, x_initial)),
            Field::Velocity => return vector(self.state.v.get(slot)),
            Field::InitialVolume => return scalar(self.reference.volume.get(slot)[0]),
            Field::NodalForce => return vector(force.expect("computed for this field").get(slot)),
            Field::Temperature => {
                return scalar(self.url.temperature(&self.state, &self.reference, slot));
            }
            Field::Entropy => {
                let eta = self.state.eta.as_ref();
                return scalar(eta.expect("checked by the caller").get(slot)[0]);
            }
            Field::EquivalentPlasticStrain => {
                let [.., strain] = self.state.history_at(slot);
                return scalar(strain);
            }
            _ => {}
        }
        let deformation = self.url.deformation(&self.state, &self.reference, slot);
        let point = self.url.point(&self.state, &self.reference, slot);
        let trace = point.cauchy[0][0] + point.cauchy[1][1] + point.cauchy[2][2];
        match field {
            Field::DeformationGradient => tensor(&deformation.f),
            Field::Jacobian => scalar(deformation.j),
            Field::FirstPiolaStress => tensor(&point.first_piola),
            Field::CauchyStress => tensor(&point.cauchy),
            Field::Pressure => scalar(-trace / 3.0),
            Field::VonMisesStress => {
                let deviator = axpy9(&point.cauchy, -trace / 3.0, &IDENTITY);
                scalar((1.5 * double_dot(&deviator, &deviator)).sqrt())
            }
            Field::StrainEnergyDensity => scalar(point.energy),
            Field::Density => scalar(self.url.law().density() / deformation.j),
            _ => unreachable!("answered above"),
        }
    }

    /// A view of a state array; `None` for fields that are computed on demand.
    /// Position, velocity and initial position have one.
    pub fn view(&self, field: Field) -> Option<View<'_>> {
        let array = match field {
            Field::Position => &self.state.x,
            Field::Velocity => &self.state.v,
            Field::InitialPosition => &self.reference.x_initial,
            _ => return None,
        };
        Some(View {
            data: &array.flat()[Layout::FIRST..],
            component_stride: array.component_stride(),
            components: 3,
            particles: self.particle_count(),
            order: &self.order,
        })
    }

    /// Changes whenever the state does: a view taken at another generation is stale.
    pub fn generation(&self) -> u64 {
        self.generation
    }

    /// A copy of the complete state.
    pub fn snapshot(&self) -> Snapshot {
        Snapshot {
            scene_hash: self.scene_hash,
            time: self.time,
            steps: self.steps,
            accounts: self.accounts,
            inputs: self.inputs.clone(),
            walls: self.walls.clone(),
            state: self.state.clone(),
            updated: self.reference.updated.clone(),
        }
    }

    /// Returns to a snapshot of the same scene; bit for bit.
    ///
    /// # Errors
    /// [`Code::Snapshot`] if it belongs to another scene; nothing is changed then.
    pub fn restore(&mut self, snapshot: &Snapshot) -> Result<()> {
        if snapshot.scene_hash != self.scene_hash {
            return Err(Error::new(
                Code::Snapshot,
                "the snapshot belongs to another scene: restore it into a simulation of its own scene",
            ));
        }
        let shape = |u: &Option<Updated>| u.as_ref().map(|u| u.h_chi.is_some());
        let same_shape = snapshot.state.x.layout() == self.state.x.layout()
            && snapshot.state.h.is_some() == self.state.h.is_some()
            && snapshot.state.j.is_some() == self.state.j.is_some()
            && snapshot.state.eta.is_some() == self.state.eta.is_some()
            && snapshot.state.history.is_some() == self.state.history.is_some()
            && shape(&snapshot.updated) == shape(&self.reference.updated)
            && snapshot.inputs.len() == self.inputs.len()
            && snapshot.walls.len() == self.walls.len()
            && snapshot.time.is_finite();
        if !same_shape {
            return Err(Error::new(
                Code::Snapshot,
                "the snapshot does not have the fields of its scene, it is damaged: take it again from a \
                 running simulation",
            ));
        }
        for (index, values) in snapshot.inputs.iter().enumerate() {
            self.boundary.check_input(index, values)?;
        }
        let now = self.snapshot();
        let restored = self.put(snapshot).and_then(|()| self.compute_resultants());
        match restored {
            Ok(resultants) => {
                self.resultants = resultants;
                Ok(())
            }
            Err(error) => {
                self.put(&now)?;
                Err(error)
            }
        }
    }

    fn put(&mut self, snapshot: &Snapshot) -> Result<()> {
        self.time = snapshot.time;
        self.steps = snapshot.steps;
        self.accounts = snapshot.accounts;
        self.inputs.clone_from(&snapshot.inputs);
        self.walls.clone_from(&snapshot.walls);
        self.state.copy_from(&snapshot.state);
        if snapshot.updated.is_some() && snapshot.updated != self.reference.updated {
            self.reference.updated.clone_from(&snapshot.updated);
            let Self {
                pool, reference, ..
            } = self;
            pool.install(|| reference.rebuild()).map_err(|slot| {
                Error::new(
                    Code::Snapshot,
                    "the reference configuration of the snapshot is damaged: take it again from a \
                     running simulation",
                )
                .at_particle(self.order[slot - Layout::FIRST] as usize, None)
            })?;
        }
        self.generation += 1;
        self.evaluate()
    }

    /// Hash of the complete state: equal states have equal hashes, whatever the number of threads.
    pub fn state_hash(&self) -> u64 {
        self.snapshot().hash()
    }
}

impl Probes {
    fn new(scene: &Scene, particles: &Particles) -> Result<Self> {
        let mut this = Self {
            names: Vec::new(),
            weights: Vec::new(),
        };
        for (name, point) in &scene.probes {
            let weights = particles.interpolation(*point).ok_or_else(|| {
                let distance = |x: &[f64; 3]| {
                    let r = sub3(*x, *point);
                    dot(r, r)
                };
                let nearest = particles
                    .positions
                    .iter()
                    .enumerate()
                    .min_by(|(_, x), (_, y)| distance(x).total_cmp(&distance(y)));
                let error = Error::scene(
                    format!("probes.{name}"),
                    "the probe lies outside the body: give a point inside it, in the initial \
                     configuration; the nearest particle is named here",
                );
                match nearest {
                    Some((i, x)) => error.at_particle(particles.caller(i), Some(*x)),
                    None => error,
                }
            })?;
            this.names.push(name.clone());
            this.weights.push(weights);
        }
        Ok(this)
    }
}

/// Over the body's size, the half-width of the central differences of expressions: their error is
/// near its square, round-off near 1e-16 over it.
const DIFFERENCE: f64 = 1e-5;

/// Gradient of a field of the scene at time 0.
fn gradient(field: &VectorFunction, x: [f64; 3], half: f64) -> Mat3<f64> {
    let mut gradient = [[0.0; 3]; 3];
    for c in 0..3 {
        let at = |offset: f64| {
            let mut y = x;
            y[c] += offset;
            field.eval(y, 0.0)
        };
        let jump = sub3(at(half), at(-half));
        for r in 0..3 {
            gradient[r][c] = jump[r] / (2.0 * half);
        }
    }
    gradient
}

/// Displacement, deformation, velocity and entropy at time 0.
pub(crate) fn initial_state(
    scene: &Scene,
    url: &Url,
    reference: &Reference,
    particles: &Particles,
) -> Result<State> {
    let mut state = State::at_rest(
        reference,
        scene.numerics.state,
        &url.law(),
        url.thermal().is_some(),
    );
    let finite = |value: [f64; 3], path: &str, i: usize| {
        if value.iter().all(|v| v.is_finite()) {
            return Ok(value);
        }
        Err(
            Error::scene(path, "the value is not finite here: check the expression")
                .at_particle(particles.caller(i), Some(particles.positions[i])),
        )
    };
    if let Some(velocity) = &scene.initial.velocity {
        let velocity = velocity.compile()?;
        for (i, x) in particles.positions.iter().enumerate() {
            let v = finite(velocity.eval(*x, 0.0), "initial.velocity", i)?;
            state.v.set(Layout::slot(i), v);
        }
    }
    if let Some(displacement) = &scene.initial.displacement {
        let displacement = displacement.compile()?;
        for (i, x) in particles.positions.iter().enumerate() {
            let u = finite(displacement.eval(*x, 0.0), "initial.displacement", i)?;
            state.x.set(Layout::slot(i), add3(*x, u));
        }
        match scene.initial.gradient {
            InitialGradient::Discrete => crate::formulation::url::deform(&mut state, reference),
            InitialGradient::Exact => {
                let points = particles.positions.iter();
                let extent = points.flatten().fold(0.0, |l: f64, x| l.max(x.abs()));
                for (i, x) in particles.positions.iter().enumerate() {
                    let gradient = gradient(&displacement, *x, DIFFERENCE * extent);
                    for row in gradient {
                        finite(row, "initial.displacement", i)?;
                    }
                    state.deform(Layout::slot(i), add9(&IDENTITY, &gradient));
                }
            }
        }
    }
    if let Some(heat) = &scene.heat {
        let function = match &scene.initial.temperature {
            Some(temperature) => temperature.compile()?,
            None => ScalarFunction::Constant(heat.reference_temperature),
        };
        for (i, x) in particles.positions.iter().enumerate() {
            let theta = function.eval(*x, 0.0);
            if !(theta > 0.0 && theta.is_finite()) {
                let text = format!("the absolute temperature is {theta} K here, not above 0");
                return Err(Error::scene("initial.temperature", text)
                    .at_particle(particles.caller(i), Some(*x)));
            }
            url.set_temperature(&mut state, reference, Layout::slot(i), theta);
        }
    }
    Ok(state)
}

/// Whether the reference is updated after this step.
fn is_stale(numerics: &Numerics, steps: u64, state: &State) -> bool {
    match numerics.reference_update {
        ReferenceUpdate::Never => false,
        ReferenceUpdate::EveryStep => true,
        ReferenceUpdate::Every(n) => steps.is_multiple_of(u64::from(n)),
        ReferenceUpdate::When { strain } => is_strained(state, strain),
    }
}

/// Gives the particles with a prescribed temperature theirs at time `t`; the heat that this takes [J],
/// by `supplied(slot, (entropy, heat))` of a particle's entropy and heat.
fn hold_temperatures(
    boundary: &Boundary,
    url: &Url,
    state: &mut State,
    reference: &Reference,
    (t, supplied): (f64, impl Fn(usize, (f64, f64)) -> f64),
    inputs: &InputValues,
) -> Result<f64> {
    let mut total = 0.0;
    boundary.hold_temperatures(t, inputs, |slot, theta| {
        total += supplied(slot, url.set_temperature(state, reference, slot, theta));
    })?;
    Ok(total)
}

fn diverged(b: Breakdown, state: &State, order: &[u32], time: f64) -> Error {
    let (field, what) = match b.trouble {
        Trouble::Velocity => (Field::Velocity, "a velocity is not finite".to_string()),
        Trouble::Temperature(theta) => {
            let what = format!("the temperature of a particle is {theta:.3e} K");
            (Field::Temperature, what)
        }
        Trouble::VolumeRatio(ratio) => {
            let what = format!("the volume ratio of a particle is {ratio:.3e}");
            (Field::Jacobian, what)
        }
    };
    Error::new(
        Code::Diverged,
        format!(
            "the solution broke down: {what}. The state before this step is kept. Try a smaller \
             time step (numerics.cfl), a finer spacing, more neighbours, or a smaller load"
        ),
    )
    .at_field(field.info().name)
    .at_particle(
        order[b.slot - Layout::FIRST] as usize,
        Some(state.x.get(b.slot)),
    )
    .at_time(time)
}
