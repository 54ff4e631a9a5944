//! A running simulation: the time step is written here, once.

use crate::error::Result;
use crate::fields::Field;
use crate::ledger::{Energies, Momenta, Resultant};
use crate::scene::Scene;

/// A body in motion. Created from a [`Scene`], advanced in time, read by fields and resultants.
///
/// A failed call leaves the simulation as it was, except that [`advance`](Self::advance) keeps the
/// steps that it completed: the last good state stays readable.
#[derive(Debug)]
pub struct Simulation {
    scene: Scene,
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
pub struct Progress {
    /// Simulated time [s].
    pub time: f64,
    /// Where this call ends [s].
    pub end: f64,
    /// Step just made [s].
    pub dt: f64,
    /// Time steps since time 0.
    pub steps: u64,
}

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
    /// Index of the patch in [`Simulation::patches`].
    pub patch: usize,
    /// What is set.
    pub quantity: Quantity,
    /// Whether the scene declares one value per particle (`per_particle`).
    pub per_particle: bool,
    /// Start value from the scene, `quantity.components()` long.
    pub start: Vec<f64>,
}

/// Motion of a probe.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ProbeMotion {
    /// Displacement [m].
    pub displacement: [f64; 3],
    /// Velocity [m/s].
    pub velocity: [f64; 3],
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

/// A complete state: restoring it and stepping gives the same bits as never having left.
#[derive(Debug, Clone, PartialEq)]
pub struct Snapshot {}

impl Snapshot {
    /// Bytes, versioned and checksummed, little-endian.
    pub fn to_bytes(&self) -> Vec<u8> {
        todo!()
    }
    /// Reads what [`to_bytes`](Self::to_bytes) wrote.
    ///
    /// # Errors
    /// [`Code::Snapshot`](crate::Code::Snapshot) if truncated, damaged or of another version.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self> {
        let _ = bytes;
        todo!()
    }
}

/// What a scene will cost, for `urlsph check`.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// Particles.
    pub particles: usize,
    /// Directed neighbour pairs.
    pub pairs: usize,
    /// Smallest, mean and largest number of neighbours.
    pub neighbours: (usize, f64, usize),
    /// Stable time step at the start [s].
    pub stable_step: f64,
    /// Estimated number of steps to the scene's end.
    pub steps: u64,
    /// Memory of the simulation [bytes].
    pub memory: usize,
    /// Physics and options that are on, one line each.
    pub on: Vec<String>,
    /// Physics and options that are off, one line each.
    pub off: Vec<String>,
}

impl Simulation {
    /// Sets up a simulation on a pool of its own with as many threads as the machine has cores.
    ///
    /// # Errors
    /// [`Code::InvalidScene`](crate::Code::InvalidScene) with the JSON path or particle,
    /// [`Code::OutOfMemory`](crate::Code::OutOfMemory).
    pub fn new(scene: Scene) -> Result<Self> {
        Self::with_threads(scene, 0)
    }
    /// The same with a given number of threads; 0 means as many as the machine has cores.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn with_threads(scene: Scene, threads: usize) -> Result<Self> {
        let _ = threads;
        Ok(Self { scene })
    }
    /// The scene.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }
    /// Number of threads of this simulation's pool.
    pub fn threads(&self) -> usize {
        todo!()
    }
    /// What the scene costs.
    pub fn plan(&self) -> Plan {
        todo!()
    }
    /// Simulated time [s].
    pub fn time(&self) -> f64 {
        todo!()
    }
    /// Time steps since time 0.
    pub fn steps(&self) -> u64 {
        todo!()
    }
    /// Number of particles.
    pub fn particle_count(&self) -> usize {
        todo!()
    }
    /// Number of directed neighbour pairs.
    pub fn pair_count(&self) -> usize {
        todo!()
    }
    /// Largest stable step from the present state [s] (the CFL condition, or the scene's fixed step).
    pub fn stable_step(&self) -> f64 {
        todo!()
    }
    /// Advances to exactly `t_next`, in as many stable steps as needed.
    ///
    /// # Errors
    /// [`Code::InvalidArgument`](crate::Code::InvalidArgument) unless `t_next` is finite and later than now;
    /// [`Code::Diverged`](crate::Code::Diverged) with particle, position, field and time: the state is the last good one.
    pub fn advance(&mut self, t_next: f64) -> Result<()> {
        self.advance_with(t_next, &mut |_| Control::Continue)
    }
    /// The same, with an observer that is called after every step and may cancel.
    ///
    /// # Errors
    /// As [`advance`](Self::advance), and [`Code::Cancelled`](crate::Code::Cancelled).
    pub fn advance_with(
        &mut self,
        t_next: f64,
        observer: &mut dyn FnMut(&Progress) -> Control,
    ) -> Result<()> {
        let _ = (t_next, observer);
        todo!()
    }
    /// Energies now.
    pub fn energies(&self) -> Energies {
        todo!()
    }
    /// Momenta now.
    pub fn momenta(&self) -> Momenta {
        todo!()
    }
    /// The patches: every face of the geometry and every patch of the scene.
    pub fn patches(&self) -> &[Patch] {
        todo!()
    }
    /// Index of a patch.
    ///
    /// # Errors
    /// [`Code::InvalidArgument`](crate::Code::InvalidArgument) naming the patches that there are.
    pub fn patch_index(&self, name: &str) -> Result<usize> {
        let _ = name;
        todo!()
    }
    /// Resultants of a patch now.
    ///
    /// # Panics
    /// If `patch` is not an index into [`patches`](Self::patches).
    pub fn resultant(&self, patch: usize) -> Resultant {
        let _ = patch;
        todo!()
    }
    /// Names of the scene's probes, in the order of [`probe`](Self::probe).
    pub fn probe_names(&self) -> &[String] {
        todo!()
    }
    /// Motion of a probe, interpolated between the particles around its initial position.
    ///
    /// # Panics
    /// If `probe` is not an index into [`probe_names`](Self::probe_names).
    pub fn probe(&self, probe: usize) -> ProbeMotion {
        let _ = probe;
        todo!()
    }
    /// What the scene lets the outside set.
    pub fn inputs(&self) -> &[Input] {
        todo!()
    }
    /// Sets an external input: one value for the patch (`components` numbers) or one per particle
    /// of the patch (`particles x components`, row-major, in the order of [`Patch::particles`]).
    ///
    /// # Errors
    /// [`Code::InvalidArgument`](crate::Code::InvalidArgument) if the scene does not declare this input as `external`,
    /// if the length is neither, or if a value is not finite. Nothing is changed then.
    pub fn set_input(&mut self, patch: usize, quantity: Quantity, values: &[f64]) -> Result<()> {
        let _ = (patch, quantity, values);
        todo!()
    }
    /// The present values of an external input, as last set.
    ///
    /// # Errors
    /// [`Code::InvalidArgument`](crate::Code::InvalidArgument) if the scene does not declare it.
    pub fn input(&self, patch: usize, quantity: Quantity) -> Result<&[f64]> {
        let _ = (patch, quantity);
        todo!()
    }
    /// Copies a field, row-major, in the caller's particle order.
    ///
    /// # Errors
    /// [`Code::InvalidArgument`](crate::Code::InvalidArgument) unless `out` has `particles x components` numbers.
    pub fn read_field(&self, field: Field, out: &mut [f64]) -> Result<()> {
        let _ = (field, out);
        todo!()
    }
    /// A view of a state array; `None` for fields that are computed on demand.
    /// Position, velocity and initial position have one.
    pub fn view(&self, field: Field) -> Option<View<'_>> {
        let _ = field;
        todo!()
    }
    /// Changes whenever the state does: a view taken at another generation is stale.
    pub fn generation(&self) -> u64 {
        todo!()
    }
    /// A copy of the complete state.
    pub fn snapshot(&self) -> Snapshot {
        todo!()
    }
    /// Returns to a snapshot of the same scene; bit for bit.
    ///
    /// # Errors
    /// [`Code::Snapshot`](crate::Code::Snapshot) if it belongs to another scene; nothing is changed then.
    pub fn restore(&mut self, snapshot: &Snapshot) -> Result<()> {
        let _ = snapshot;
        todo!()
    }
    /// Hash of the complete state: equal states have equal hashes, whatever the number of threads.
    pub fn state_hash(&self) -> u64 {
        todo!()
    }
}
