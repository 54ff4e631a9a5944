//! Sequences of calls of FMI 3.0, in an order or out of it.

use std::ffi::{CString, c_char, c_void};
use std::ptr::null_mut;
use std::sync::LazyLock;

use arbitrary::{Arbitrary, Unstructured};
use urlsph::fmu::{FmiVersion, model_description};
use urlsph::{Scene, Simulation};

use crate::number::Number;

const SCENE: &str = r#"{
    "geometry": {"box": {"min": [0, 0, 0], "max": [1, 1, 1], "spacing": 0.5}},
    "material": {"neo_hookean": {"density": 1000, "youngs_modulus": 1e7, "poisson_ratio": 0.3}},
    "boundary": {"y_min": {"support": "clamped"}, "y_max": {"traction": {"external": [0, 0, 0]}}},
    "probes": {"tip": [0.5, 1, 0.5]},
    "output": {"fields": ["velocity"]},
    "time": {"end": 1}
}"#;

type Pointer = *mut c_void;
type Status = i32;

// `Fatal`: the instance is lost, which a bug alone brings about.
const FATAL: Status = 4;

unsafe extern "C" {
    fn fmi3InstantiateCoSimulation(
        name: *const c_char,
        token: *const c_char,
        resources: *const c_char,
        visible: bool,
        logging: bool,
        event_mode: bool,
        early_return: bool,
        intermediate: *const u32,
        intermediate_count: usize,
        environment: Pointer,
        log: Option<unsafe extern "C" fn(Pointer, i32, *const c_char, *const c_char)>,
        update: Pointer,
    ) -> Pointer;
    fn fmi3FreeInstance(instance: Pointer);
    fn fmi3EnterInitializationMode(
        instance: Pointer,
        tolerance_defined: bool,
        tolerance: f64,
        start: f64,
        stop_defined: bool,
        stop: f64,
    ) -> Status;
    fn fmi3ExitInitializationMode(instance: Pointer) -> Status;
    fn fmi3Terminate(instance: Pointer) -> Status;
    fn fmi3Reset(instance: Pointer) -> Status;
    fn fmi3EnterStepMode(instance: Pointer) -> Status;
    fn fmi3DoStep(
        instance: Pointer,
        point: f64,
        step: f64,
        no_set_state: bool,
        event_needed: *mut bool,
        terminate: *mut bool,
        early_return: *mut bool,
        last_time: *mut f64,
    ) -> Status;
    fn fmi3GetFloat64(
        instance: Pointer,
        references: *const u32,
        count: usize,
        values: *mut f64,
        room: usize,
    ) -> Status;
    fn fmi3SetFloat64(
        instance: Pointer,
        references: *const u32,
        count: usize,
        values: *const f64,
        room: usize,
    ) -> Status;
    fn fmi3GetUInt64(
        instance: Pointer,
        references: *const u32,
        count: usize,
        values: *mut u64,
        room: usize,
    ) -> Status;
    fn fmi3GetFMUState(instance: Pointer, state: *mut Pointer) -> Status;
    fn fmi3SetFMUState(instance: Pointer, state: Pointer) -> Status;
    fn fmi3FreeFMUState(instance: Pointer, state: *mut Pointer) -> Status;
    fn fmi3SerializedFMUStateSize(instance: Pointer, state: Pointer, size: *mut usize) -> Status;
    fn fmi3SerializeFMUState(
        instance: Pointer,
        state: Pointer,
        bytes: *mut u8,
        size: usize,
    ) -> Status;
    fn fmi3DeserializeFMUState(
        instance: Pointer,
        bytes: *const u8,
        size: usize,
        state: *mut Pointer,
    ) -> Status;
}

unsafe extern "C" fn log(_: Pointer, _: i32, category: *const c_char, message: *const c_char) {
    assert!(!category.is_null() && !message.is_null());
}

/// The folder of the scene, and the token of its description.
static MODEL: LazyLock<(tempfile::TempDir, CString, CString)> = LazyLock::new(|| {
    let folder = tempfile::tempdir().expect("a folder for the scene");
    std::fs::write(folder.path().join("scene.json"), SCENE).expect("the folder is writable");
    let scene = Scene::from_json(SCENE, &[]).unwrap_or_else(|e| panic!("{e}"));
    let simulation = Simulation::with_threads(scene, 1).unwrap_or_else(|e| panic!("{e}"));
    let text = model_description(&simulation, FmiVersion::V3).unwrap_or_else(|e| panic!("{e}"));
    let (_, rest) = text
        .split_once("instantiationToken=\"")
        .expect("it has a token");
    let (token, _) = rest.split_once('"').expect("it ends");
    let path = folder.path().to_str().expect("UTF-8").to_owned();
    (
        folder,
        CString::new(token).expect("no NUL"),
        CString::new(path).expect("no NUL"),
    )
});

#[derive(Debug, Clone, Arbitrary)]
enum Call {
    Enter {
        start: Number,
        stop: Option<Number>,
    },
    Exit,
    Terminate,
    Reset,
    StepMode,
    DoStep {
        point: Number,
        step: Number,
    },
    Get {
        references: Vec<u8>,
        room: u8,
    },
    Set {
        references: Vec<u8>,
        values: Vec<Number>,
    },
    Count {
        reference: u32,
    },
    GetState,
    SetState,
    FreeState,
    Through {
        damage: Option<(u16, u8)>,
        cut: u8,
    },
}

#[derive(Debug, Arbitrary)]
struct Sequence {
    begun: bool,
    calls: Vec<Call>,
}

/// Sequences of calls: none loses the instance.
pub fn fmi(data: &[u8]) {
    let Ok(Sequence { begun, mut calls }) = Sequence::arbitrary_take_rest(Unstructured::new(data))
    else {
        return;
    };
    calls.truncate(40);
    let (_, token, folder) = &*MODEL;
    // SAFETY: the arguments of the standard; every pointer is valid for what goes with it.
    unsafe {
        let instance = fmi3InstantiateCoSimulation(
            c"fuzzed".as_ptr(),
            token.as_ptr(),
            folder.as_ptr(),
            false,
            true,
            false,
            false,
            std::ptr::null(),
            0,
            null_mut(),
            Some(log),
            null_mut(),
        );
        assert!(!instance.is_null());
        if begun {
            assert_eq!(
                fmi3EnterInitializationMode(instance, false, 0.0, 0.0, false, 0.0),
                0
            );
            assert_eq!(fmi3ExitInitializationMode(instance), 0);
        }
        let (mut state, mut now) = (null_mut(), 0.0);
        for call in &calls {
            let status = make(instance, call, &mut state, &mut now);
            assert_ne!(status, FATAL, "{call:?}");
        }
        if !state.is_null() {
            fmi3FreeFMUState(instance, &mut state);
        }
        fmi3FreeInstance(instance);
    }
}

unsafe fn make(instance: Pointer, call: &Call, state: &mut Pointer, now: &mut f64) -> Status {
    unsafe {
        match call {
            Call::Enter { start, stop } => {
                let (start, end) = (start.value(*now), stop.map_or(0.0, |s| s.value(*now)));
                fmi3EnterInitializationMode(instance, false, 0.0, start, stop.is_some(), end)
            }
            Call::Exit => fmi3ExitInitializationMode(instance),
            Call::Terminate => fmi3Terminate(instance),
            Call::Reset => fmi3Reset(instance),
            Call::StepMode => fmi3EnterStepMode(instance),
            Call::DoStep { point, step } => {
                let step = match step.value(*now) {
                    // A step that is possible, but takes for ever, is the importer's wish.
                    long if long.is_finite() && long > 5e-3 => 1e-4,
                    other => other,
                };
                let mut flags = [false; 3];
                let [event, terminate, early] = &mut flags;
                fmi3DoStep(
                    instance,
                    point.value(*now),
                    step,
                    false,
                    event,
                    terminate,
                    early,
                    now,
                )
            }
            Call::Get { references, room } => {
                let references: Vec<u32> = references.iter().map(|r| u32::from(*r)).collect();
                let mut values = vec![f64::INFINITY; usize::from(*room) + 4];
                let status = fmi3GetFloat64(
                    instance,
                    references.as_ptr(),
                    references.len(),
                    values.as_mut_ptr(),
                    usize::from(*room),
                );
                assert!(
                    values[usize::from(*room)..]
                        .iter()
                        .all(|v| *v == f64::INFINITY)
                );
                status
            }
            Call::Set { references, values } => {
                let references: Vec<u32> = references.iter().map(|r| u32::from(*r)).collect();
                let values: Vec<f64> = values.iter().map(|v| v.value(*now)).collect();
                fmi3SetFloat64(
                    instance,
                    references.as_ptr(),
                    references.len(),
                    values.as_ptr(),
                    values.len(),
                )
            }
            Call::Count { reference } => {
                let mut value = 0;
                fmi3GetUInt64(instance, reference, 1, &mut value, 1)
            }
            Call::GetState => fmi3GetFMUState(instance, state),
            Call::SetState => fmi3SetFMUState(instance, *state),
            Call::FreeState => fmi3FreeFMUState(instance, state),
            Call::Through { damage, cut } => {
                let mut size = 0;
                let status = fmi3SerializedFMUStateSize(instance, *state, &mut size);
                if status != 0 {
                    return status;
                }
                let mut bytes = vec![0_u8; size];
                assert_eq!(
                    fmi3SerializeFMUState(instance, *state, bytes.as_mut_ptr(), size),
                    0
                );
                if let (Some((at, bits)), false) = (damage, bytes.is_empty()) {
                    let at = usize::from(*at) % size;
                    bytes[at] ^= bits;
                }
                let size = size - usize::from(*cut).min(size);
                let mut again = null_mut();
                let status = fmi3DeserializeFMUState(instance, bytes.as_ptr(), size, &mut again);
                if status == 0 && !again.is_null() {
                    fmi3FreeFMUState(instance, &mut again);
                }
                status
            }
        }
    }
}
