//! The C functions of FMI 3.0, all of them; names, types and meaning are those of the standard.
//!
//! # Safety
//! Every function relies on the standard: an instance is NULL or comes from an instantiation here and
//! is not freed, texts end with NUL, arrays are as long as is said.
#![allow(non_snake_case)]

use std::ffi::{c_char, c_void};

use super::FmiVersion::V3;
use super::handle::{
    self, Arguments, Logger, Logger3, Status, null_array, put, set_logging, slice, slice_mut,
};
use super::instance::Instance;
use super::table::Kind;
use crate::error::Result;

type Pointer = *mut c_void;
type Text = *const c_char;
/// C's `bool`, without Rust's promise that it is 0 or 1.
type Boolean = u8;
type Reference = u32;

#[unsafe(no_mangle)]
extern "C" fn fmi3GetVersion() -> Text {
    c"3.0".as_ptr()
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3SetDebugLogging(
    instance: Pointer,
    on: Boolean,
    count: usize,
    categories: *const Text,
) -> Status {
    // SAFETY: by the standard.
    unsafe {
        set_logging(
            instance,
            V3,
            "fmi3SetDebugLogging",
            on != 0,
            count,
            categories,
        )
    }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3InstantiateCoSimulation(
    name: Text,
    token: Text,
    resources: Text,
    _visible: Boolean,
    logging: Boolean,
    _event_mode: Boolean,
    _early_return: Boolean,
    _intermediate: *const Reference,
    intermediate_count: usize,
    environment: Pointer,
    log: Option<Logger3>,
    _update: Pointer,
) -> Pointer {
    // Some importers allow event mode and early return to every FMU; there is no harm in that.
    let refusal = (intermediate_count != 0)
        .then_some("this FMU has no intermediate update: require no intermediate variables");
    let logger = log.map_or(Logger::None, |f| Logger::V3(f, environment));
    // SAFETY: by the standard.
    unsafe {
        handle::instantiate(
            Arguments {
                version: V3,
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

/// Answers an instantiation for a kind of use that this FMU does not have.
unsafe fn refuse(name: Text, environment: Pointer, log: Option<Logger3>) -> Pointer {
    let logger = log.map_or(Logger::None, |f| Logger::V3(f, environment));
    let nothing = std::ptr::null();
    // SAFETY: by the standard.
    unsafe {
        handle::instantiate(
            Arguments {
                version: V3,
                name,
                token: nothing,
                resources: nothing,
                logging: false,
                logger,
            },
            Some("this FMU is for co-simulation: use fmi3InstantiateCoSimulation"),
        )
    }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3InstantiateModelExchange(
    name: Text,
    _token: Text,
    _resources: Text,
    _visible: Boolean,
    _logging: Boolean,
    environment: Pointer,
    log: Option<Logger3>,
) -> Pointer {
    // SAFETY: by the standard.
    unsafe { refuse(name, environment, log) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3InstantiateScheduledExecution(
    name: Text,
    _token: Text,
    _resources: Text,
    _visible: Boolean,
    _logging: Boolean,
    environment: Pointer,
    log: Option<Logger3>,
    _clock_update: Pointer,
    _lock: Pointer,
    _unlock: Pointer,
) -> Pointer {
    // SAFETY: by the standard.
    unsafe { refuse(name, environment, log) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3FreeInstance(instance: Pointer) {
    // SAFETY: by the standard.
    unsafe { handle::free(instance, V3) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3EnterInitializationMode(
    instance: Pointer,
    _tolerance_defined: Boolean,
    _tolerance: f64,
    start: f64,
    stop_defined: Boolean,
    stop: f64,
) -> Status {
    let body = |i: &mut Instance| {
        i.setup(start, (stop_defined != 0).then_some(stop))?;
        i.enter_initialization()
    };
    // SAFETY: by the standard.
    unsafe { handle::call_event(instance, V3, "fmi3EnterInitializationMode", body) }
}

/// Functions that only lead from one phase to another.
macro_rules! phases {
    ($($function:ident => $method:ident;)*) => {$(
        #[unsafe(no_mangle)]
        unsafe extern "C" fn $function(instance: Pointer) -> Status {
            // SAFETY: by the standard.
            unsafe { handle::call_event(instance, V3, stringify!($function), Instance::$method) }
        }
    )*};
}

phases! {
    fmi3ExitInitializationMode => exit_initialization;
    fmi3Terminate => terminate;
    fmi3Reset => reset;
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3DoStep(
    instance: Pointer,
    point: f64,
    step: f64,
    _no_set_state: Boolean,
    event_needed: *mut Boolean,
    terminate: *mut Boolean,
    early_return: *mut Boolean,
    last_time: *mut f64,
) -> Status {
    let body = |i: &mut Instance| {
        let outcome = i.step(point, step);
        // SAFETY: by the standard.
        unsafe {
            put(event_needed, 0);
            put(terminate, 0);
            put(early_return, 0);
            put(last_time, i.time());
        }
        outcome
    };
    // SAFETY: by the standard.
    unsafe { handle::call(instance, V3, "fmi3DoStep", body) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3GetFloat64(
    instance: Pointer,
    references: *const Reference,
    count: usize,
    values: *mut f64,
    value_count: usize,
) -> Status {
    // SAFETY: by the standard.
    let arrays = unsafe { (slice(references, count), slice_mut(values, value_count)) };
    let body = |i: &mut Instance| match arrays {
        (Some(references), Some(values)) => i.get(Kind::Real, references, values),
        _ => Err(null_array()),
    };
    // SAFETY: by the standard.
    unsafe { handle::call(instance, V3, "fmi3GetFloat64", body) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3SetFloat64(
    instance: Pointer,
    references: *const Reference,
    count: usize,
    values: *const f64,
    value_count: usize,
) -> Status {
    // SAFETY: by the standard.
    let arrays = unsafe { (slice(references, count), slice(values, value_count)) };
    let body = |i: &mut Instance| match arrays {
        (Some(references), Some(values)) => i.set(Kind::Real, references, values),
        _ => Err(null_array()),
    };
    // SAFETY: by the standard.
    unsafe { handle::call(instance, V3, "fmi3SetFloat64", body) }
}

/// Types of integers that this FMU has. Counts are exact up to 2^53.
macro_rules! integers {
    ($($get:ident $set:ident $type:ty, $kind:ident;)*) => {$(
        #[unsafe(no_mangle)]
        unsafe extern "C" fn $get(
            instance: Pointer,
            references: *const Reference,
            count: usize,
            values: *mut $type,
            value_count: usize,
        ) -> Status {
            // SAFETY: by the standard.
            let arrays = unsafe { (slice(references, count), slice_mut(values, value_count)) };
            let body = |i: &mut Instance| -> Result<()> {
                let (Some(references), Some(values)) = arrays else {
                    return Err(null_array());
                };
                let mut numbers = vec![0.0; values.len()];
                i.get(Kind::$kind, references, &mut numbers)?;
                for (value, number) in values.iter_mut().zip(numbers) {
                    *value = number as $type;
                }
                Ok(())
            };
            // SAFETY: by the standard.
            unsafe { handle::call(instance, V3, stringify!($get), body) }
        }

        #[unsafe(no_mangle)]
        unsafe extern "C" fn $set(
            instance: Pointer,
            references: *const Reference,
            count: usize,
            values: *const $type,
            value_count: usize,
        ) -> Status {
            // SAFETY: by the standard.
            let arrays = unsafe { (slice(references, count), slice(values, value_count)) };
            let body = |i: &mut Instance| -> Result<()> {
                let (Some(references), Some(values)) = arrays else {
                    return Err(null_array());
                };
                let numbers: Vec<f64> = values.iter().map(|&v| v as f64).collect();
                i.set(Kind::$kind, references, &numbers)
            };
            // SAFETY: by the standard.
            unsafe { handle::call(instance, V3, stringify!($set), body) }
        }
    )*};
}

integers! {
    fmi3GetInt32 fmi3SetInt32 i32, Integer;
    fmi3GetUInt64 fmi3SetUInt64 u64, Count;
}

/// Types that no variable has: asking for none of them is allowed.
macro_rules! absent_types {
    ($($function:ident($($argument:ty),*);)*) => {$(
        #[unsafe(no_mangle)]
        unsafe extern "C" fn $function(
            instance: Pointer,
            _: *const Reference,
            count: usize,
            $(_: $argument),*
        ) -> Status {
            let why = "this FMU has no variables of this type";
            // SAFETY: by the standard.
            unsafe { handle::unsupported(instance, V3, stringify!($function), count, why) }
        }
    )*};
}

absent_types! {
    fmi3GetFloat32(*mut f32, usize);
    fmi3SetFloat32(*const f32, usize);
    fmi3GetInt8(*mut i8, usize);
    fmi3SetInt8(*const i8, usize);
    fmi3GetUInt8(*mut u8, usize);
    fmi3SetUInt8(*const u8, usize);
    fmi3GetInt16(*mut i16, usize);
    fmi3SetInt16(*const i16, usize);
    fmi3GetUInt16(*mut u16, usize);
    fmi3SetUInt16(*const u16, usize);
    fmi3GetUInt32(*mut u32, usize);
    fmi3SetUInt32(*const u32, usize);
    fmi3GetInt64(*mut i64, usize);
    fmi3SetInt64(*const i64, usize);
    fmi3GetBoolean(*mut Boolean, usize);
    fmi3SetBoolean(*const Boolean, usize);
    fmi3GetString(*mut Text, usize);
    fmi3SetString(*const Text, usize);
    fmi3GetBinary(*mut usize, *mut *const u8, usize);
    fmi3SetBinary(*const usize, *const *const u8, usize);
    fmi3GetClock(*mut Boolean);
    fmi3SetClock(*const Boolean);
    fmi3GetIntervalDecimal(*mut f64, *mut i32);
    fmi3GetIntervalFraction(*mut u64, *mut u64, *mut i32);
    fmi3GetShiftDecimal(*mut f64);
    fmi3GetShiftFraction(*mut u64, *mut u64);
    fmi3SetIntervalDecimal(*const f64);
    fmi3SetIntervalFraction(*const u64, *const u64);
    fmi3SetShiftDecimal(*const f64);
    fmi3SetShiftFraction(*const u64, *const u64);
}

/// Functions of capabilities that this FMU does not have.
macro_rules! absent_functions {
    ($($why:literal: $($function:ident($($argument:ty),*)),*;)*) => {$($(
        #[unsafe(no_mangle)]
        unsafe extern "C" fn $function(instance: Pointer, $(_: $argument),*) -> Status {
            // SAFETY: by the standard.
            unsafe { handle::unsupported(instance, V3, stringify!($function), 1, $why) }
        }
    )*)*};
}

absent_functions! {
    "this FMU has no event mode":
        fmi3EnterEventMode(),
        fmi3EnterStepMode(),
        fmi3EvaluateDiscreteStates(),
        fmi3UpdateDiscreteStates(
            *mut Boolean, *mut Boolean, *mut Boolean, *mut Boolean, *mut Boolean, *mut f64
        );
    "this FMU has no structural parameters":
        fmi3EnterConfigurationMode(),
        fmi3ExitConfigurationMode();
    "this FMU does not tell dependencies per element":
        fmi3GetNumberOfVariableDependencies(Reference, *mut usize),
        fmi3GetVariableDependencies(
            Reference, *mut usize, *mut Reference, *mut usize, *mut i32, usize
        );
    "this FMU provides no derivatives":
        fmi3GetDirectionalDerivative(
            *const Reference, usize, *const Reference, usize, *const f64, usize, *mut f64, usize
        ),
        fmi3GetAdjointDerivative(
            *const Reference, usize, *const Reference, usize, *const f64, usize, *mut f64, usize
        ),
        fmi3GetOutputDerivatives(*const Reference, usize, *const i32, *mut f64, usize);
    "this FMU is for co-simulation, not for model exchange":
        fmi3EnterContinuousTimeMode(),
        fmi3CompletedIntegratorStep(Boolean, *mut Boolean, *mut Boolean),
        fmi3SetTime(f64),
        fmi3SetContinuousStates(*const f64, usize),
        fmi3GetContinuousStateDerivatives(*mut f64, usize),
        fmi3GetEventIndicators(*mut f64, usize),
        fmi3GetContinuousStates(*mut f64, usize),
        fmi3GetNominalsOfContinuousStates(*mut f64, usize),
        fmi3GetNumberOfEventIndicators(*mut usize),
        fmi3GetNumberOfContinuousStates(*mut usize);
    "this FMU is for co-simulation, not for scheduled execution":
        fmi3ActivateModelPartition(Reference, f64);
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3GetFMUState(instance: Pointer, state: *mut Pointer) -> Status {
    // SAFETY: by the standard.
    unsafe { handle::get_state(instance, V3, "fmi3GetFMUState", state) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3SetFMUState(instance: Pointer, state: Pointer) -> Status {
    // SAFETY: by the standard.
    unsafe { handle::set_state(instance, V3, "fmi3SetFMUState", state) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3FreeFMUState(instance: Pointer, state: *mut Pointer) -> Status {
    // SAFETY: by the standard.
    unsafe { handle::free_state(instance, V3, state) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3SerializedFMUStateSize(
    instance: Pointer,
    state: Pointer,
    size: *mut usize,
) -> Status {
    // SAFETY: by the standard.
    unsafe { handle::state_size(instance, V3, "fmi3SerializedFMUStateSize", state, size) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3SerializeFMUState(
    instance: Pointer,
    state: Pointer,
    bytes: *mut u8,
    size: usize,
) -> Status {
    // SAFETY: by the standard.
    unsafe { handle::write_state(instance, V3, "fmi3SerializeFMUState", state, bytes, size) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3DeserializeFMUState(
    instance: Pointer,
    bytes: *const u8,
    size: usize,
    state: *mut Pointer,
) -> Status {
    // SAFETY: by the standard.
    unsafe { handle::read_state(instance, V3, "fmi3DeserializeFMUState", bytes, size, state) }
}
