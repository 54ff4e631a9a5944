//! The C functions of FMI 2.0, all of them; names, types and meaning are those of the standard.
//!
//! # Safety
//! Every function relies on the standard: an instance is NULL or comes from an instantiation here and
//! is not freed, texts end with NUL, arrays are as long as is said.
#![allow(non_snake_case)]

use std::ffi::{c_char, c_int, c_uint, c_void};

use super::FmiVersion::V2;
use super::handle::{
    self, Arguments, Logger, Logger2, Status, null_array, put, set_logging, slice, slice_mut,
};
use super::instance::Instance;
use super::table::Kind;
use crate::error::{Error, Result};

type Pointer = *mut c_void;
type Text = *const c_char;
type Reference = c_uint;
type Boolean = c_int;

/// `fmi2CoSimulation`.
const CO_SIMULATION: c_int = 1;
pub(super) const NOT_CO_SIMULATION: &str =
    "this FMU is for co-simulation: instantiate it with fmi2CoSimulation";
/// `fmi2LastSuccessfulTime`.
const LAST_SUCCESSFUL_TIME: c_int = 2;
/// `fmi2Terminated`.
const TERMINATED: c_int = 3;

/// `fmi2CallbackFunctions`.
#[repr(C)]
struct Callbacks {
    logger: Option<Logger2>,
    allocate: Pointer,
    free: Pointer,
    step_finished: Pointer,
    environment: Pointer,
}

#[unsafe(no_mangle)]
extern "C" fn fmi2GetTypesPlatform() -> Text {
    c"default".as_ptr()
}

#[unsafe(no_mangle)]
extern "C" fn fmi2GetVersion() -> Text {
    c"2.0".as_ptr()
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2SetDebugLogging(
    instance: Pointer,
    on: Boolean,
    count: usize,
    categories: *const Text,
) -> Status {
    // SAFETY: by the standard.
    unsafe {
        set_logging(
            instance,
            V2,
            "fmi2SetDebugLogging",
            on != 0,
            count,
            categories,
        )
    }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2Instantiate(
    name: Text,
    kind: c_int,
    token: Text,
    resources: Text,
    functions: *const Callbacks,
    _visible: Boolean,
    logging: Boolean,
) -> Pointer {
    // SAFETY: by the standard.
    let callbacks = unsafe { functions.as_ref() };
    let logger = callbacks
        .and_then(|c| c.logger.map(|f| Logger::V2(f, c.environment)))
        .unwrap_or(Logger::None);
    let refusal = (kind != CO_SIMULATION).then_some(NOT_CO_SIMULATION);
    // SAFETY: by the standard.
    unsafe {
        handle::instantiate(
            Arguments {
                version: V2,
                name,
                token,
                resources,
                logging: logging != 0,
                logger,
            },
            refusal,
        )
    }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2FreeInstance(instance: Pointer) {
    // SAFETY: by the standard.
    unsafe { handle::free(instance, V2) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2SetupExperiment(
    instance: Pointer,
    _tolerance_defined: Boolean,
    _tolerance: f64,
    start: f64,
    stop_defined: Boolean,
    stop: f64,
) -> Status {
    let body = |i: &mut Instance| i.setup(start, (stop_defined != 0).then_some(stop));
    // SAFETY: by the standard.
    unsafe { handle::call(instance, V2, "fmi2SetupExperiment", body) }
}

/// Functions that only lead from one phase to another.
macro_rules! phases {
    ($($function:ident => $method:ident;)*) => {$(
        #[unsafe(no_mangle)]
        unsafe extern "C" fn $function(instance: Pointer) -> Status {
            // SAFETY: by the standard.
            unsafe { handle::call_event(instance, V2, stringify!($function), Instance::$method) }
        }
    )*};
}

phases! {
    fmi2EnterInitializationMode => enter_initialization;
    fmi2ExitInitializationMode => exit_initialization;
    fmi2Terminate => terminate;
    fmi2Reset => reset;
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2DoStep(
    instance: Pointer,
    point: f64,
    step: f64,
    _no_set_state: Boolean,
) -> Status {
    // SAFETY: by the standard.
    unsafe { handle::call(instance, V2, "fmi2DoStep", |i| i.step(point, step)) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2GetReal(
    instance: Pointer,
    references: *const Reference,
    count: usize,
    values: *mut f64,
) -> Status {
    // SAFETY: by the standard.
    let arrays = unsafe { (slice(references, count), slice_mut(values, count)) };
    let body = |i: &mut Instance| match arrays {
        (Some(references), Some(values)) => i.get(Kind::Real, references, values),
        _ => Err(null_array()),
    };
    // SAFETY: by the standard.
    unsafe { handle::call(instance, V2, "fmi2GetReal", body) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2SetReal(
    instance: Pointer,
    references: *const Reference,
    count: usize,
    values: *const f64,
) -> Status {
    // SAFETY: by the standard.
    let arrays = unsafe { (slice(references, count), slice(values, count)) };
    let body = |i: &mut Instance| match arrays {
        (Some(references), Some(values)) => i.set(Kind::Real, references, values),
        _ => Err(null_array()),
    };
    // SAFETY: by the standard.
    unsafe { handle::call(instance, V2, "fmi2SetReal", body) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2GetInteger(
    instance: Pointer,
    references: *const Reference,
    count: usize,
    values: *mut c_int,
) -> Status {
    // SAFETY: by the standard.
    let arrays = unsafe { (slice(references, count), slice_mut(values, count)) };
    let body = |i: &mut Instance| -> Result<()> {
        let (Some(references), Some(values)) = arrays else {
            return Err(null_array());
        };
        let mut numbers = vec![0.0; values.len()];
        i.get(Kind::Integer, references, &mut numbers)?;
        for (value, number) in values.iter_mut().zip(numbers) {
            // Counts beyond 32 bits stay at the largest number.
            *value = number as c_int;
        }
        Ok(())
    };
    // SAFETY: by the standard.
    unsafe { handle::call(instance, V2, "fmi2GetInteger", body) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2SetInteger(
    instance: Pointer,
    references: *const Reference,
    count: usize,
    values: *const c_int,
) -> Status {
    // SAFETY: by the standard.
    let arrays = unsafe { (slice(references, count), slice(values, count)) };
    let body = |i: &mut Instance| -> Result<()> {
        let (Some(references), Some(values)) = arrays else {
            return Err(null_array());
        };
        let numbers: Vec<f64> = values.iter().map(|&v| f64::from(v)).collect();
        i.set(Kind::Integer, references, &numbers)
    };
    // SAFETY: by the standard.
    unsafe { handle::call(instance, V2, "fmi2SetInteger", body) }
}

/// Functions for lists of variables that this FMU does not have: an empty list is allowed.
macro_rules! absent_lists {
    ($($why:literal: $($function:ident($($argument:ty),*)),*;)*) => {$($(
        #[unsafe(no_mangle)]
        unsafe extern "C" fn $function(
            instance: Pointer,
            _: *const Reference,
            count: usize,
            $(_: $argument),*
        ) -> Status {
            // SAFETY: by the standard.
            unsafe { handle::unsupported(instance, V2, stringify!($function), count, $why) }
        }
    )*)*};
}

absent_lists! {
    "this FMU has no variables of this type":
        fmi2GetBoolean(*mut Boolean),
        fmi2SetBoolean(*const Boolean),
        fmi2GetString(*mut Text),
        fmi2SetString(*const Text);
    "this FMU does not interpolate inputs":
        fmi2SetRealInputDerivatives(*const c_int, *const f64);
    "this FMU provides no derivatives":
        fmi2GetRealOutputDerivatives(*const c_int, *mut f64),
        fmi2GetDirectionalDerivative(*const Reference, usize, *const f64, *mut f64);
}

/// Functions of capabilities that this FMU does not have.
macro_rules! absent_functions {
    ($($why:literal: $($function:ident($($argument:ty),*)),*;)*) => {$($(
        #[unsafe(no_mangle)]
        unsafe extern "C" fn $function(instance: Pointer, $(_: $argument),*) -> Status {
            // SAFETY: by the standard.
            unsafe { handle::unsupported(instance, V2, stringify!($function), 1, $why) }
        }
    )*)*};
}

absent_functions! {
    "this FMU is for co-simulation, not for model exchange":
        fmi2EnterEventMode(),
        fmi2NewDiscreteStates(Pointer),
        fmi2EnterContinuousTimeMode(),
        fmi2CompletedIntegratorStep(Boolean, *mut Boolean, *mut Boolean),
        fmi2SetTime(f64),
        fmi2SetContinuousStates(*const f64, usize),
        fmi2GetDerivatives(*mut f64, usize),
        fmi2GetEventIndicators(*mut f64, usize),
        fmi2GetContinuousStates(*mut f64, usize),
        fmi2GetNominalsOfContinuousStates(*mut f64, usize);
    "steps are made before fmi2DoStep returns":
        fmi2CancelStep(),
        fmi2GetStatus(c_int, *mut c_int),
        fmi2GetIntegerStatus(c_int, *mut c_int),
        fmi2GetStringStatus(c_int, *mut Text);
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2GetRealStatus(instance: Pointer, kind: c_int, value: *mut f64) -> Status {
    let body = |i: &mut Instance| {
        if kind != LAST_SUCCESSFUL_TIME {
            return Err(Error::argument(
                "there is no such real status: ask for fmi2LastSuccessfulTime",
            ));
        }
        // SAFETY: by the standard.
        unsafe { put(value, i.time()) };
        Ok(())
    };
    // SAFETY: by the standard.
    unsafe { handle::call(instance, V2, "fmi2GetRealStatus", body) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2GetBooleanStatus(
    instance: Pointer,
    kind: c_int,
    value: *mut Boolean,
) -> Status {
    let body = |_: &mut Instance| {
        if kind != TERMINATED {
            return Err(Error::argument(
                "there is no such boolean status: ask for fmi2Terminated",
            ));
        }
        // The FMU never ends a simulation by itself.
        // SAFETY: by the standard.
        unsafe { put(value, 0) };
        Ok(())
    };
    // SAFETY: by the standard.
    unsafe { handle::call(instance, V2, "fmi2GetBooleanStatus", body) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2GetFMUstate(instance: Pointer, state: *mut Pointer) -> Status {
    // SAFETY: by the standard.
    unsafe { handle::get_state(instance, V2, "fmi2GetFMUstate", state) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2SetFMUstate(instance: Pointer, state: Pointer) -> Status {
    // SAFETY: by the standard.
    unsafe { handle::set_state(instance, V2, "fmi2SetFMUstate", state) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2FreeFMUstate(instance: Pointer, state: *mut Pointer) -> Status {
    // SAFETY: by the standard.
    unsafe { handle::free_state(instance, V2, state) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2SerializedFMUstateSize(
    instance: Pointer,
    state: Pointer,
    size: *mut usize,
) -> Status {
    // SAFETY: by the standard.
    unsafe { handle::state_size(instance, V2, "fmi2SerializedFMUstateSize", state, size) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2SerializeFMUstate(
    instance: Pointer,
    state: Pointer,
    bytes: *mut u8,
    size: usize,
) -> Status {
    // SAFETY: by the standard.
    unsafe { handle::write_state(instance, V2, "fmi2SerializeFMUstate", state, bytes, size) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2DeSerializeFMUstate(
    instance: Pointer,
    bytes: *const u8,
    size: usize,
    state: *mut Pointer,
) -> Status {
    // SAFETY: by the standard.
    unsafe { handle::read_state(instance, V2, "fmi2DeSerializeFMUstate", bytes, size, state) }
}
