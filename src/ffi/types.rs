//! What crosses the boundary: status, handle, structs.

use std::ffi::{c_char, c_void};
use std::mem::offset_of;

use super::args::Versioned;
use crate::error::Code;

/// Version of the binary interface. It changes only when programs have to be compiled again; it is
/// the number in the library's soname. Additions do not change it.
pub const URLSPH_ABI_VERSION: u32 = 0;

/// Bytes of `urlsph_error.text`, with the terminating NUL.
pub const URLSPH_ERROR_TEXT_SIZE: usize = 2048;
/// Bytes of `urlsph_error.path`, with the terminating NUL.
pub const URLSPH_ERROR_PATH_SIZE: usize = 512;
/// Bytes of `urlsph_error.boundary`, with the terminating NUL.
pub const URLSPH_ERROR_BOUNDARY_SIZE: usize = 256;
/// Bytes of `urlsph_error.field`, with the terminating NUL.
pub const URLSPH_ERROR_FIELD_SIZE: usize = 64;

/// Outcome of a call. Numbers are never reused; later versions may add some, so treat an unknown
/// number as a failure.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(i32)]
pub enum urlsph_status {
    /// Done.
    URLSPH_OK = 0,
    /// An argument is wrong: NULL, NaN, a wrong length, an unknown name, a stale handle.
    URLSPH_INVALID_ARGUMENT = 1,
    /// The scene is not valid JSON or does not have the shape of a scene.
    URLSPH_PARSE = 2,
    /// The scene is well formed, but a value in it is not admissible.
    URLSPH_INVALID_SCENE = 3,
    /// A file could not be read or written.
    URLSPH_IO = 4,
    /// More memory is needed than there is.
    URLSPH_OUT_OF_MEMORY = 5,
    /// The solution diverged: an inverted particle, or a value that is not finite.
    URLSPH_DIVERGED = 6,
    /// A callback cancelled the call.
    URLSPH_CANCELLED = 7,
    /// A snapshot is truncated, damaged, or of another scene or version.
    URLSPH_SNAPSHOT = 8,
    /// The handle is used by another thread, or by the call whose callback this is.
    URLSPH_BUSY = 9,
    /// A bug in the library: the handle is poisoned and can only be destroyed.
    URLSPH_INTERNAL = 10,
}

impl From<Code> for urlsph_status {
    fn from(code: Code) -> Self {
        match code {
            Code::InvalidArgument => Self::URLSPH_INVALID_ARGUMENT,
            Code::Parse => Self::URLSPH_PARSE,
            Code::InvalidScene => Self::URLSPH_INVALID_SCENE,
            Code::Io => Self::URLSPH_IO,
            Code::OutOfMemory => Self::URLSPH_OUT_OF_MEMORY,
            Code::Diverged => Self::URLSPH_DIVERGED,
            Code::Cancelled => Self::URLSPH_CANCELLED,
            Code::Snapshot => Self::URLSPH_SNAPSHOT,
            Code::Busy => Self::URLSPH_BUSY,
            Code::Internal => Self::URLSPH_INTERNAL,
        }
    }
}

/// How much a log message matters. Later versions may add levels between these.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(i32)]
pub enum urlsph_log_level {
    /// A call failed.
    URLSPH_LOG_ERROR = 1,
    /// What was done.
    URLSPH_LOG_INFO = 3,
}

/// What a log message is about. Later versions may add events.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(i32)]
pub enum urlsph_log_event {
    /// A call failed: `error` says why.
    URLSPH_EVENT_FAILED = 1,
    /// `urlsph_step` or `urlsph_advance_to` has reached its end.
    URLSPH_EVENT_ADVANCED = 2,
    /// A saved state has become the present one.
    URLSPH_EVENT_RESTORED = 3,
}

/// What can be set from outside on a patch.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(i32)]
pub enum urlsph_quantity {
    /// Dead traction per unit initial area [Pa], 3 components.
    URLSPH_TRACTION = 1,
    /// Follower pressure per unit current area, positive in compression [Pa], 1 component.
    URLSPH_PRESSURE = 2,
    /// Prescribed velocity [m/s], 3 components.
    URLSPH_VELOCITY = 3,
    /// Heat flux into the body per unit initial area [W/m^2], 1 component.
    URLSPH_HEAT_FLUX = 4,
    /// Prescribed absolute temperature [K], 1 component.
    URLSPH_TEMPERATURE = 5,
    /// Heat transfer coefficient of the convection per unit initial area [W/(m^2 K)], 1 component.
    URLSPH_CONVECTION_COEFFICIENT = 6,
    /// Absolute temperature of the surroundings that the convection leads to [K], 1 component.
    URLSPH_AMBIENT_TEMPERATURE = 7,
}

/// Configuration to which the components of a field belong.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(i32)]
pub enum urlsph_configuration {
    /// Initial (material).
    URLSPH_CONFIGURATION_INITIAL = 1,
    /// Current (spatial).
    URLSPH_CONFIGURATION_CURRENT = 2,
    /// Two-point tensor: row current, column initial.
    URLSPH_CONFIGURATION_TWO_POINT = 3,
}

/// A simulation: a body in motion, with threads of its own. Opaque.
pub struct urlsph_simulation(());

/// An error: what is wrong, where, and what to do about it. Filled by the library, owned by the
/// caller, nothing to free. Texts are NUL-terminated UTF-8; one that is too long ends in "...".
#[derive(Clone, Copy)]
#[repr(C)]
pub struct urlsph_error {
    /// `URLSPH_OK` if there was no error.
    pub code: urlsph_status,
    /// 1 if `particle` is known, otherwise 0.
    pub has_particle: i32,
    /// 1 if `position` is known, otherwise 0.
    pub has_position: i32,
    /// 1 if `time` is known, otherwise 0.
    pub has_time: i32,
    /// Particle, 0-based in the caller's order.
    pub particle: u64,
    /// Current position of that particle [m].
    pub position: [f64; 3],
    /// Simulated time [s].
    pub time: f64,
    /// The whole message with the place, for people; empty if there was no error.
    pub text: [c_char; URLSPH_ERROR_TEXT_SIZE],
    /// JSON path in the scene, such as `boundary.top.traction[1]`; empty if unknown.
    pub path: [c_char; URLSPH_ERROR_PATH_SIZE],
    /// Name of the boundary (patch); empty if unknown.
    pub boundary: [c_char; URLSPH_ERROR_BOUNDARY_SIZE],
    /// Name of the field; empty if unknown.
    pub field: [c_char; URLSPH_ERROR_FIELD_SIZE],
}

/// How to create a simulation. Set the whole struct to zero first: zero means the default.
#[derive(Debug, Clone, Copy)]
#[repr(C)]
pub struct urlsph_options {
    /// `override_count` texts `path=value`, applied to the scene before it is validated, such as
    /// `geometry.box.spacing=0.125`; NULL if there are none.
    pub overrides: *const *const c_char,
    /// Number of overrides.
    pub override_count: usize,
    /// Threads of the simulation; 0 for one per core. Results do not depend on it, to the bit.
    pub threads: usize,
}

/// Where a running `urlsph_step` or `urlsph_advance_to` is.
#[derive(Debug, Clone, Copy)]
#[repr(C)]
pub struct urlsph_progress {
    /// Simulated time [s].
    pub time: f64,
    /// Where this call ends [s].
    pub end: f64,
    /// Time step just made [s].
    pub dt: f64,
    /// Time steps since time 0.
    pub steps: u64,
    /// Where this call began [s].
    pub start: f64,
    /// Updates of the reference configuration until now.
    pub reference_updates: u64,
}

/// A log message, as text and as data.
#[derive(Debug, Clone, Copy)]
#[repr(C)]
pub struct urlsph_log_record {
    /// How much it matters.
    pub level: urlsph_log_level,
    /// What it is about.
    pub event: urlsph_log_event,
    /// The message for people, NUL-terminated UTF-8.
    pub message: *const c_char,
    /// The error of a call that failed, otherwise NULL.
    pub error: *const urlsph_error,
    /// Simulated time now [s].
    pub time: f64,
    /// Time steps since time 0.
    pub steps: u64,
}

/// Receives log messages; `record` and what it points to are valid for the time of the call.
pub type urlsph_log_callback =
    Option<unsafe extern "C" fn(record: *const urlsph_log_record, user_data: *mut c_void)>;

/// Is called after each time step; `progress` is valid for the time of the call.
pub type urlsph_progress_callback =
    Option<unsafe extern "C" fn(progress: *const urlsph_progress, user_data: *mut c_void)>;

/// Is asked after each time step; any answer but 0 ends the call with `URLSPH_CANCELLED`.
pub type urlsph_cancel_callback = Option<unsafe extern "C" fn(user_data: *mut c_void) -> i32>;

/// Callbacks; NULL for those that are not wanted. Set the whole struct to zero first.
#[derive(Debug, Clone, Copy)]
#[repr(C)]
pub struct urlsph_callbacks {
    /// Given to each callback as it is.
    pub user_data: *mut c_void,
    /// Log messages.
    pub log: urlsph_log_callback,
    /// Progress.
    pub progress: urlsph_progress_callback,
    /// Cancellation.
    pub cancel: urlsph_cancel_callback,
}

/// Sizes of a simulation.
#[derive(Debug, Clone, Copy)]
#[repr(C)]
pub struct urlsph_counts {
    /// Particles.
    pub particles: usize,
    /// Directed pairs of neighbours.
    pub pairs: usize,
    /// Patches.
    pub patches: usize,
    /// Fields.
    pub fields: usize,
    /// Probes.
    pub probes: usize,
    /// Inputs: what the scene declares as `external`.
    pub inputs: usize,
    /// Threads of the simulation.
    pub threads: usize,
    /// Time steps since time 0.
    pub steps: u64,
    /// Planes of contact.
    pub contacts: usize,
}

/// A patch: a named set of boundary particles.
#[derive(Debug, Clone, Copy)]
#[repr(C)]
pub struct urlsph_patch_info {
    /// Name; valid until the simulation is destroyed.
    pub name: *const c_char,
    /// Number of its particles.
    pub particles: usize,
    /// Area in the initial configuration, the sum of the tributary areas [m^2].
    pub area: f64,
}

/// A field: one value per particle.
#[derive(Debug, Clone, Copy)]
#[repr(C)]
pub struct urlsph_field_info {
    /// Stable name, such as `velocity`; valid until the simulation is destroyed.
    pub name: *const c_char,
    /// SI unit, such as `m/s`, or `1`; valid until the simulation is destroyed.
    pub unit: *const c_char,
    /// One line for people; valid until the simulation is destroyed.
    pub description: *const c_char,
    /// Components: 1, 3, or 9 for a tensor (full 3 x 3, row-major).
    pub components: usize,
    /// Configuration of the components.
    pub configuration: urlsph_configuration,
    /// 1 if `urlsph_get_view` gives it without a copy, otherwise 0.
    pub has_view: i32,
    /// 1 if this simulation has it; 0 if the scene lacks what it takes, such as heat or plasticity.
    pub is_present: i32,
    /// Always 0.
    pub reserved: i32,
}

/// A probe: a named point of the body.
#[derive(Debug, Clone, Copy)]
#[repr(C)]
pub struct urlsph_probe_info {
    /// Name; valid until the simulation is destroyed.
    pub name: *const c_char,
    /// Position in the initial configuration [m].
    pub position: [f64; 3],
}

/// An input: a condition that the scene declares as `external`.
#[derive(Debug, Clone, Copy)]
#[repr(C)]
pub struct urlsph_input_info {
    /// Index of the patch.
    pub patch: usize,
    /// Number of the patch's particles.
    pub particles: usize,
    /// Components of one value: 3 of a traction or a velocity, otherwise 1.
    pub components: usize,
    /// What is set.
    pub quantity: urlsph_quantity,
    /// 1 if the scene declares it `per_particle`, otherwise 0. Either way both forms can be set.
    pub per_particle: i32,
}

/// A read-only look at the memory of a field, without a copy.
///
/// Component `c` of the particle in slot `s` is `data[c * component_stride + s]`; slot `s` holds the
/// caller's particle `order[s]`. Valid while the simulation is not destroyed and its generation
/// (`urlsph_get_generation`) is the one given here.
#[derive(Debug, Clone, Copy)]
#[repr(C)]
pub struct urlsph_view {
    /// The values, in the unit of the field.
    pub data: *const f64,
    /// Caller's particle of each slot, `particles` numbers.
    pub order: *const u32,
    /// Distance between components in `data`, at least `particles`.
    pub component_stride: usize,
    /// Number of components.
    pub components: usize,
    /// Number of particles, that is of slots.
    pub particles: usize,
    /// Generation of the state that is looked at.
    pub generation: u64,
}

/// Energies [J] and entropies [J/K]. What the scene does not have is 0.
#[derive(Debug, Clone, Copy)]
#[repr(C)]
pub struct urlsph_energies {
    /// Kinetic energy.
    pub kinetic: f64,
    /// Strain energy; with heat the mechanical part of the internal energy.
    pub strain: f64,
    /// Work of tractions, pressures, body force and moving supports since time 0.
    pub external_work: f64,
    /// Energy dissipated by the scheme since time 0, from the dissipation terms themselves.
    pub numerical_dissipation: f64,
    /// Energy taken out by the angular-momentum projection since time 0, of either sign.
    pub projection: f64,
    /// What is stored and dissipated less what was supplied and the initial energy: kinetic + strain +
    /// thermal + plastic work that did not become heat + numerical_dissipation +
    /// contact_dissipation + projection - external_work - heat_in - initial energy.
    pub closure_error: f64,
    /// Thermal part of the internal energy, from the reference temperature on.
    pub thermal: f64,
    /// Heat from sources, heat fluxes, convection and prescribed temperatures since time 0.
    pub heat_in: f64,
    /// Plastic work since time 0. With heat its part that became heat is in `thermal` as well.
    pub plastic_work: f64,
    /// Ballistic energy, kinetic + strain + thermal - reference temperature x entropy: without
    /// supply from outside it never rises.
    pub ballistic: f64,
    /// Entropy [J/K].
    pub entropy: f64,
    /// Entropy produced by conduction and plastic flow since time 0 [J/K]: never falls.
    pub entropy_production: f64,
    /// Kinetic energy lost in inelastic contact since time 0: never falls.
    pub contact_dissipation: f64,
}

/// Momenta of the whole body.
#[derive(Debug, Clone, Copy)]
#[repr(C)]
pub struct urlsph_momenta {
    /// Linear momentum [kg m/s].
    pub linear: [f64; 3],
    /// Angular momentum about the origin [kg m^2/s].
    pub angular: [f64; 3],
}

/// What a patch feels and does.
#[derive(Debug, Clone, Copy)]
#[repr(C)]
pub struct urlsph_resultant {
    /// Force of the surroundings on the body through this patch, loads and support reactions [N].
    pub force: [f64; 3],
    /// Moment of that force about the origin, with current arms [N m].
    pub moment: [f64; 3],
    /// Mean displacement, weighted with the initial areas [m].
    pub mean_displacement: [f64; 3],
    /// Mean velocity, weighted with the initial areas [m/s].
    pub mean_velocity: [f64; 3],
}

/// Heat through a patch, and its temperature.
#[derive(Debug, Clone, Copy)]
#[repr(C)]
pub struct urlsph_heat_resultant {
    /// Heat that flows into the body through this patch [W]: flux, convection, and what a prescribed
    /// temperature draws.
    pub heat_flow: f64,
    /// Mean absolute temperature, weighted with the initial areas [K].
    pub mean_temperature: f64,
    /// Highest absolute temperature of its particles [K].
    pub maximum_temperature: f64,
}

/// A plane of contact: rigid and frictionless.
#[derive(Debug, Clone, Copy)]
#[repr(C)]
pub struct urlsph_contact_info {
    /// Name; valid until the simulation is destroyed.
    pub name: *const c_char,
    /// A point of the plane at time 0 [m].
    pub point: [f64; 3],
    /// Unit normal, towards the body.
    pub normal: [f64; 3],
}

/// What a plane of contact does to the body.
#[derive(Debug, Clone, Copy)]
#[repr(C)]
pub struct urlsph_contact_resultant {
    /// Force of the plane on the body [N], without the impulses of impacts.
    pub force: [f64; 3],
    /// Impulse of the plane on the body since time 0 [N s], with those of impacts.
    pub impulse: [f64; 3],
    /// How far the plane has moved along its normal since time 0 [m].
    pub displacement: f64,
    /// Number of particles that touch the plane.
    pub particles: usize,
}

/// Motion of a probe and its temperature, interpolated between the particles around it.
#[derive(Debug, Clone, Copy)]
#[repr(C)]
pub struct urlsph_probe_motion {
    /// Displacement [m].
    pub displacement: [f64; 3],
    /// Velocity [m/s].
    pub velocity: [f64; 3],
    /// Absolute temperature [K]; 0 of a body without heat.
    pub temperature: f64,
}

const fn size_of_field<S, F>(_: fn(&S) -> &F) -> usize {
    size_of::<F>()
}

/// The last field of each struct in the first version of the ABI: this list only grows.
macro_rules! versioned {
    ($($name:ident . $last:ident;)*) => {$(
        // SAFETY: numbers, arrays of numbers, raw pointers and optional function pointers take any
        // bytes. The structs with an enum are only written, never read from the caller.
        unsafe impl Versioned for $name {
            const FIRST_SIZE: usize =
                offset_of!($name, $last) + size_of_field(|s: &$name| &s.$last);
        }
    )*};
}

versioned! {
    urlsph_error.field;
    urlsph_options.threads;
    urlsph_callbacks.cancel;
    urlsph_counts.steps;
    urlsph_patch_info.area;
    urlsph_field_info.has_view;
    urlsph_probe_info.position;
    urlsph_input_info.per_particle;
    urlsph_view.generation;
    urlsph_energies.closure_error;
    urlsph_momenta.angular;
    urlsph_resultant.mean_velocity;
    urlsph_heat_resultant.maximum_temperature;
    urlsph_contact_info.normal;
    urlsph_contact_resultant.particles;
    urlsph_probe_motion.velocity;
}
