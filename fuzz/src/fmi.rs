//! Sequences of calls of FMI 2.0 and 3.0, in an order or out of it, some from a second thread.

use std::ffi::{CString, c_char, c_void};
use std::ptr::{null, null_mut};
use std::sync::LazyLock;

use arbitrary::{Arbitrary, Unstructured};
use urlsph::fmu::{FmiVersion, model_description};
use urlsph::{Scene, Simulation};
use xxhash_rust::xxh3::xxh3_64;

use super::number::Number;

const SCENE: &str = r#"{
    "geometry": {"box": {"min": [0, 0, 0], "max": [1, 1, 1], "spacing": 1}},
    "material": {"neo_hookean": {"density": 1000, "youngs_modulus": 1e7, "poisson_ratio": 0.3}},
    "heat": {"specific_heat": 100, "reference_temperature": 300, "conductivity": 10},
    "boundary": {
        "y_min": {"support": "clamped", "temperature": {"external": 300}},
        "y_max": {"traction": {"external": [0, 0, 0], "per_particle": true}}
    },
    "probes": {"tip": [0, 1, 0]},
    "output": {"fields": ["velocity"]},
    "time": {"end": 1}
}"#;

type Pointer = *mut c_void;
type Text = *const c_char;
type Status = i32;

// `Fatal`: the instance is lost, which a bug alone brings about.
const FATAL: Status = 4;

type Log = unsafe extern "C" fn(Pointer, i32, Text, Text);

#[repr(C)]
struct Callbacks2([Pointer; 5]);

#[rustfmt::skip]
unsafe extern "C" {
    fn fmi2Instantiate(name: Text, kind: i32, token: Text, resources: Text, callbacks: *const Callbacks2,
        visible: i32, logging: i32) -> Pointer;
    fn fmi2FreeInstance(instance: Pointer);
    fn fmi2SetupExperiment(instance: Pointer, tolerance_defined: i32, tolerance: f64, start: f64,
        stop_defined: i32, stop: f64) -> Status;
    fn fmi2EnterInitializationMode(instance: Pointer) -> Status;
    fn fmi2ExitInitializationMode(instance: Pointer) -> Status;
    fn fmi2Terminate(instance: Pointer) -> Status;
    fn fmi2Reset(instance: Pointer) -> Status;
    fn fmi2DoStep(instance: Pointer, point: f64, step: f64, no_set_state: i32) -> Status;
    fn fmi2GetReal(instance: Pointer, references: *const u32, count: usize, values: *mut f64) -> Status;
    fn fmi2SetReal(instance: Pointer, references: *const u32, count: usize, values: *const f64) -> Status;
    fn fmi2GetInteger(instance: Pointer, references: *const u32, count: usize, values: *mut i32) -> Status;
    fn fmi2SetInteger(instance: Pointer, references: *const u32, count: usize, values: *const i32) -> Status;
    fn fmi2GetString(instance: Pointer, references: *const u32, count: usize, values: *mut Text) -> Status;
    fn fmi2CancelStep(instance: Pointer) -> Status;
    fn fmi2GetRealStatus(instance: Pointer, kind: i32, value: *mut f64) -> Status;
    fn fmi2GetBooleanStatus(instance: Pointer, kind: i32, value: *mut i32) -> Status;
    fn fmi2SetDebugLogging(instance: Pointer, on: i32, count: usize, categories: *const Text) -> Status;
    fn fmi2GetFMUstate(instance: Pointer, state: *mut Pointer) -> Status;
    fn fmi2SetFMUstate(instance: Pointer, state: Pointer) -> Status;
    fn fmi2FreeFMUstate(instance: Pointer, state: *mut Pointer) -> Status;
    fn fmi2SerializedFMUstateSize(instance: Pointer, state: Pointer, size: *mut usize) -> Status;
    fn fmi2SerializeFMUstate(instance: Pointer, state: Pointer, bytes: *mut u8, size: usize) -> Status;
    fn fmi2DeSerializeFMUstate(instance: Pointer, bytes: *const u8, size: usize, state: *mut Pointer) -> Status;

    fn fmi3InstantiateCoSimulation(name: Text, token: Text, resources: Text, visible: bool, logging: bool,
        event_mode: bool, early_return: bool, intermediate: *const u32, intermediate_count: usize,
        environment: Pointer, log: Option<Log>, update: Pointer) -> Pointer;
    fn fmi3InstantiateModelExchange(name: Text, token: Text, resources: Text, visible: bool, logging: bool,
        environment: Pointer, log: Option<Log>) -> Pointer;
    fn fmi3FreeInstance(instance: Pointer);
    fn fmi3EnterInitializationMode(instance: Pointer, tolerance_defined: bool, tolerance: f64, start: f64,
        stop_defined: bool, stop: f64) -> Status;
    fn fmi3ExitInitializationMode(instance: Pointer) -> Status;
    fn fmi3Terminate(instance: Pointer) -> Status;
    fn fmi3Reset(instance: Pointer) -> Status;
    fn fmi3EnterStepMode(instance: Pointer) -> Status;
    fn fmi3DoStep(instance: Pointer, point: f64, step: f64, no_set_state: bool, event_needed: *mut bool,
        terminate: *mut bool, early_return: *mut bool, last_time: *mut f64) -> Status;
    fn fmi3GetFloat64(instance: Pointer, references: *const u32, count: usize, values: *mut f64, room: usize)
        -> Status;
    fn fmi3SetFloat64(instance: Pointer, references: *const u32, count: usize, values: *const f64, room: usize)
        -> Status;
    fn fmi3GetInt32(instance: Pointer, references: *const u32, count: usize, values: *mut i32, room: usize)
        -> Status;
    fn fmi3SetInt32(instance: Pointer, references: *const u32, count: usize, values: *const i32, room: usize)
        -> Status;
    fn fmi3GetUInt64(instance: Pointer, references: *const u32, count: usize, values: *mut u64, room: usize)
        -> Status;
    fn fmi3GetString(instance: Pointer, references: *const u32, count: usize, values: *mut Text, room: usize)
        -> Status;
    fn fmi3SetDebugLogging(instance: Pointer, on: bool, count: usize, categories: *const Text) -> Status;
    fn fmi3GetFMUState(instance: Pointer, state: *mut Pointer) -> Status;
    fn fmi3SetFMUState(instance: Pointer, state: Pointer) -> Status;
    fn fmi3FreeFMUState(instance: Pointer, state: *mut Pointer) -> Status;
    fn fmi3SerializedFMUStateSize(instance: Pointer, state: Pointer, size: *mut usize) -> Status;
    fn fmi3SerializeFMUState(instance: Pointer, state: Pointer, bytes: *mut u8, size: usize) -> Status;
    fn fmi3DeserializeFMUState(instance: Pointer, bytes: *const u8, size: usize, state: *mut Pointer) -> Status;
}

/// One of the two standards, where they differ by more than the names.
#[derive(Debug, Clone, Copy, PartialEq, Arbitrary)]
enum Standard {
    Two,
    Three,
}
use Standard::{Three, Two};

/// The function of a standard, of two that take the same.
macro_rules! of {
    ($standard:expr, $two:ident, $three:ident($($argument:expr),*)) => {
        match $standard {
            Two => $two($($argument),*),
            Three => $three($($argument),*),
        }
    };
}

unsafe extern "C" fn log(_: Pointer, _: i32, category: Text, message: Text) {
    assert!(!category.is_null() && !message.is_null());
}

/// What an importer knows of the FMU.
struct Model {
    _folder: tempfile::TempDir,
    resources: CString,
    /// Token of each standard's description.
    tokens: [CString; 2],
    /// Reference of the stable step in each.
    stable_step: [u32; 2],
    /// Number of values by reference, of FMI 3.0.
    widths: Vec<usize>,
}

static MODEL: LazyLock<Model> = LazyLock::new(|| {
    let folder = tempfile::tempdir().expect("a folder for the scene");
    std::fs::write(folder.path().join("scene.json"), SCENE).expect("the folder is writable");
    let scene = Scene::from_json(SCENE, &[]).unwrap_or_else(|e| panic!("{e}"));
    let simulation = Simulation::with_threads(scene, 1).unwrap_or_else(|e| panic!("{e}"));
    let texts = [FmiVersion::V2, FmiVersion::V3]
        .map(|version| model_description(&simulation, version).unwrap_or_else(|e| panic!("{e}")));
    let between = |text: &str, before: &str| {
        let (_, rest) = text.split_once(before).expect("it is there");
        rest.split_once('"').expect("it ends").0.to_owned()
    };
    let c = |text: String| CString::new(text).expect("no NUL");
    let mut model = Model {
        resources: c(folder.path().to_str().expect("UTF-8").to_owned()),
        _folder: folder,
        tokens: [
            c(between(&texts[0], "guid=\"")),
            c(between(&texts[1], "instantiationToken=\"")),
        ],
        stable_step: texts.each_ref().map(|text| {
            let reference = between(text, "name=\"stable_step\" valueReference=\"");
            reference.parse().expect("a number")
        }),
        widths: Vec::new(),
    };
    let mut values = [0.0; 24];
    // SAFETY: as an importer does it.
    unsafe {
        let instance = instantiate(&model, Three, true);
        let mut widths = |reference: u32| {
            [1, 3, 4, 8, 9, 12, 24].into_iter().find(|width| {
                fmi3GetFloat64(instance, &reference, 1, values.as_mut_ptr(), *width) == 0
            })
        };
        model.widths = (0..1000).map(|r| widths(r).unwrap_or(1)).collect();
        fmi3FreeInstance(instance);
    }
    model
});

unsafe fn instantiate(model: &Model, standard: Standard, right: bool) -> Pointer {
    let (two, three) = (model.tokens[0].as_ptr(), model.tokens[1].as_ptr());
    let resources = model.resources.as_ptr();
    let callbacks = Callbacks2([null_mut(); 5]);
    unsafe {
        match standard {
            Two => {
                let token = if right { two } else { three };
                fmi2Instantiate(c"fuzzed".as_ptr(), 1, token, resources, &callbacks, 0, 1)
            }
            Three => {
                let token = if right { three } else { two };
                fmi3InstantiateCoSimulation(
                    c"fuzzed".as_ptr(),
                    token,
                    resources,
                    false,
                    true,
                    false,
                    false,
                    null(),
                    0,
                    null_mut(),
                    Some(log),
                    null_mut(),
                )
            }
        }
    }
}

#[derive(Debug, Clone, Arbitrary)]
enum Call {
    Instantiate {
        token: u8,
        resources: Option<Vec<u8>>,
        what: u8,
    },
    Setup {
        start: Number,
        stop: Option<Number>,
    },
    Enter,
    Exit,
    Terminate,
    Reset,
    Unsupported(u8),
    DoStep {
        point: Number,
        step: Number,
    },
    Get {
        references: Vec<u16>,
        room: Option<u8>,
    },
    Set {
        references: Vec<u16>,
        values: [Number; 4],
        room: Option<u8>,
    },
    Integers {
        references: Vec<u16>,
        values: [i32; 2],
        set: bool,
        room: Option<u8>,
    },
    Count(u32),
    Missing {
        count: usize,
        what: u8,
    },
    Logging {
        on: bool,
        categories: Vec<u8>,
    },
    Ask(i32),
    GetState,
    SetState,
    FreeState,
    Through {
        changes: Vec<(u16, u8)>,
        cut: u8,
        seal: bool,
        keep: bool,
    },
}

#[derive(Debug, Arbitrary)]
struct Sequence {
    standard: Standard,
    begun: bool,
    /// Whether there is a second instance, of the other standard.
    second: bool,
    calls: Vec<(u8, Call)>,
    beside: Vec<(u8, Call)>,
}

/// An importer's thread: the states that it has stored are its own.
struct Importer {
    instances: [(Standard, Pointer); 2],
    state: Pointer,
    now: f64,
}

// SAFETY: instances may be called from any thread; the states are not shared.
unsafe impl Send for Importer {}

/// Sequences of calls: none loses the instance.
pub fn fmi(data: &[u8]) {
    let Ok(Sequence {
        standard,
        begun,
        second,
        mut calls,
        mut beside,
    }) = Sequence::arbitrary_take_rest(Unstructured::new(data))
    else {
        return;
    };
    calls.truncate(40);
    beside.truncate(10);
    let model = &*MODEL;
    let other = if standard == Two { Three } else { Two };
    // SAFETY: the arguments of the standard; every pointer is valid for what goes with it.
    unsafe {
        let first = instantiate(model, standard, true);
        assert!(!first.is_null());
        let second = match second {
            true => instantiate(model, other, true),
            false => null_mut(),
        };
        if begun {
            if standard == Three {
                assert_eq!(
                    fmi3EnterInitializationMode(first, false, 0.0, 0.0, false, 0.0),
                    0
                );
            } else {
                assert_eq!(fmi2EnterInitializationMode(first), 0);
            }
            assert_eq!(
                of!(
                    standard,
                    fmi2ExitInitializationMode,
                    fmi3ExitInitializationMode(first)
                ),
                0
            );
        }
        let importer = || Importer {
            instances: [(standard, first), (other, second)],
            state: null_mut(),
            now: 0.0,
        };
        std::thread::scope(|scope| {
            if !beside.is_empty() {
                let importer = importer();
                scope.spawn(move || importer.run(&beside));
            }
            importer().run(&calls);
        });
        for (standard, instance) in [(standard, first), (other, second)] {
            of!(standard, fmi2FreeInstance, fmi3FreeInstance(instance));
        }
    }
}

impl Importer {
    fn run(mut self, calls: &[(u8, Call)]) {
        for (who, call) in calls {
            let (mut standard, mut instance) = self.instances[usize::from(who % 8 == 7)];
            match who % 32 {
                // Of the other standard, or none at all.
                30 => standard = self.instances[1].0,
                22 => instance = null_mut(),
                _ => {}
            }
            // SAFETY: as in `fmi`.
            let status = unsafe { self.make(standard, instance, call) };
            assert_ne!(status, FATAL, "{call:?}");
        }
        let (standard, instance) = self.instances[0];
        if !self.state.is_null() {
            // SAFETY: a state from here.
            unsafe {
                of!(
                    standard,
                    fmi2FreeFMUstate,
                    fmi3FreeFMUState(instance, &mut self.state)
                )
            };
        }
    }

    unsafe fn make(&mut self, standard: Standard, i: Pointer, call: &Call) -> Status {
        let model = &*MODEL;
        let now = self.now;
        unsafe {
            match call {
                Call::Instantiate {
                    token,
                    resources,
                    what,
                } => make_another(standard, *token, resources.as_deref(), *what),
                Call::Setup { start, stop } => {
                    let (start, end) = (start.value(now), stop.map_or(0.0, |s| s.value(now)));
                    let ends = stop.is_some();
                    match standard {
                        Two => fmi2SetupExperiment(i, 0, 0.0, start, ends.into(), end),
                        Three => fmi3EnterInitializationMode(i, false, 0.0, start, ends, end),
                    }
                }
                Call::Enter => match standard {
                    Two => fmi2EnterInitializationMode(i),
                    Three => fmi3EnterInitializationMode(i, false, 0.0, 0.0, false, 0.0),
                },
                Call::Exit => of!(
                    standard,
                    fmi2ExitInitializationMode,
                    fmi3ExitInitializationMode(i)
                ),
                Call::Terminate => of!(standard, fmi2Terminate, fmi3Terminate(i)),
                Call::Reset => of!(standard, fmi2Reset, fmi3Reset(i)),
                Call::Unsupported(count) => {
                    let count = usize::from(*count % 3);
                    match standard {
                        Two if count == 2 => fmi2CancelStep(i),
                        Two => fmi2GetString(i, null(), count, null_mut()),
                        Three if count == 2 => fmi3EnterStepMode(i),
                        Three => fmi3GetString(i, null(), count, null_mut(), count),
                    }
                }
                Call::DoStep { point, step } => {
                    let reference = model.stable_step[usize::from(standard == Three)];
                    let mut stable = 0.0;
                    match standard {
                        Two => fmi2GetReal(i, &reference, 1, &mut stable),
                        Three => fmi3GetFloat64(i, &reference, 1, &mut stable, 1),
                    };
                    let step = match step.value(now) {
                        // A step that is possible, but takes for ever, is the importer's wish.
                        long if long.is_finite() && long > 5.0 * stable => 2.0 * stable,
                        other => other,
                    };
                    let point = point.value(now);
                    match standard {
                        Two => {
                            let status = fmi2DoStep(i, point, step, 0);
                            fmi2GetRealStatus(i, 2, &mut self.now);
                            status
                        }
                        Three => {
                            let mut flags = [false; 3];
                            let [event, end, early] = &mut flags;
                            fmi3DoStep(i, point, step, false, event, end, early, &mut self.now)
                        }
                    }
                }
                Call::Get { references, room } => {
                    let references = known(references);
                    let room = room_of(standard, &references, *room);
                    let mut values = vec![f64::INFINITY; room + 4];
                    let (from, count, to) =
                        (references.as_ptr(), references.len(), values.as_mut_ptr());
                    let status = match standard {
                        Two => fmi2GetReal(i, from, count.min(room), to),
                        Three => fmi3GetFloat64(i, from, count, to, room),
                    };
                    assert!(values[room..].iter().all(|v| *v == f64::INFINITY));
                    status
                }
                Call::Set {
                    references,
                    values,
                    room,
                } => {
                    let references = known(references);
                    let room = room_of(standard, &references, *room);
                    let values: Vec<f64> = (0..room).map(|k| values[k % 4].value(now)).collect();
                    let (to, count, from) =
                        (references.as_ptr(), references.len(), values.as_ptr());
                    match standard {
                        Two => fmi2SetReal(i, to, count.min(room), from),
                        Three => fmi3SetFloat64(i, to, count, from, room),
                    }
                }
                Call::Integers {
                    references,
                    values,
                    set,
                    room,
                } => {
                    let references = known(references);
                    let room = room_of(standard, &references, *room);
                    // Of threads, which take long to start.
                    let few = |n: i32| if (3..=1024).contains(&n) { 2 } else { n };
                    let mut values: Vec<i32> = (0..room).map(|k| few(values[k % 2])).collect();
                    let (at, count, values) =
                        (references.as_ptr(), references.len(), values.as_mut_ptr());
                    match (standard, set) {
                        (Two, true) => fmi2SetInteger(i, at, count.min(room), values),
                        (Two, false) => fmi2GetInteger(i, at, count.min(room), values),
                        (Three, true) => fmi3SetInt32(i, at, count, values, room),
                        (Three, false) => fmi3GetInt32(i, at, count, values, room),
                    }
                }
                Call::Count(reference) => {
                    let (mut value, mut small) = (0, 0);
                    match standard {
                        Two => fmi2GetInteger(i, reference, 1, &mut small),
                        Three => fmi3GetUInt64(i, reference, 1, &mut value, 1),
                    }
                }
                Call::Missing { count, what } => {
                    let n = (*count).max(1);
                    let no = null_mut();
                    // Where there is an array, but none can be as long.
                    let (mut value, long) = (0.0, n | 1 << 61);
                    match (standard, what % 9) {
                        (Two, 0) => fmi2GetReal(i, null(), n, null_mut()),
                        (Two, 1) => fmi2SetReal(i, null(), n, null()),
                        (Two, 2) => fmi2GetRealStatus(i, 2, null_mut()),
                        (Three, 0) => fmi3GetFloat64(i, null(), n, null_mut(), n),
                        (Three, 1) => fmi3SetFloat64(i, null(), n, null(), n),
                        (Three, 2) => fmi3GetUInt64(i, &0, 1, null_mut(), n),
                        (_, 3) => of!(standard, fmi2GetFMUstate, fmi3GetFMUState(i, null_mut())),
                        (_, 4) => of!(standard, fmi2SetFMUstate, fmi3SetFMUState(i, no)),
                        (_, 5) => {
                            of!(standard, fmi2FreeFMUstate, fmi3FreeFMUState(i, null_mut()))
                        }
                        (_, 6) => of!(
                            standard,
                            fmi2DeSerializeFMUstate,
                            fmi3DeserializeFMUState(i, null(), n, &mut self.state)
                        ),
                        (Two, 7) => fmi2SetReal(i, &0, long, &value),
                        (Three, 7) => fmi3GetFloat64(i, &0, 1, &mut value, long),
                        _ => of!(
                            standard,
                            fmi2SerializeFMUstate,
                            fmi3SerializeFMUState(i, self.state, null_mut(), n)
                        ),
                    }
                }
                Call::Logging { on, categories } => {
                    let names: Vec<Text> = categories
                        .iter()
                        .map(|c| match c % 5 {
                            0 => null(),
                            1 => c"logEvents".as_ptr(),
                            2 => c"logAll".as_ptr(),
                            3 => c"logStatusError".as_ptr(),
                            _ => c"\xff".as_ptr(),
                        })
                        .collect();
                    let (count, names) = (names.len(), names.as_ptr());
                    match standard {
                        Two => fmi2SetDebugLogging(i, (*on).into(), count, names),
                        Three => fmi3SetDebugLogging(i, *on, count, names),
                    }
                }
                Call::Ask(kind) => {
                    let mut answer = 0;
                    match standard {
                        Two => fmi2GetBooleanStatus(i, *kind, &mut answer),
                        Three => fmi3GetInt32(i, &kind.unsigned_abs(), 1, &mut answer, 1),
                    }
                }
                Call::GetState => of!(
                    standard,
                    fmi2GetFMUstate,
                    fmi3GetFMUState(i, &mut self.state)
                ),
                Call::SetState => of!(standard, fmi2SetFMUstate, fmi3SetFMUState(i, self.state)),
                Call::FreeState => of!(
                    standard,
                    fmi2FreeFMUstate,
                    fmi3FreeFMUState(i, &mut self.state)
                ),
                Call::Through {
                    changes,
                    cut,
                    seal,
                    keep,
                } => {
                    let mut size = 0;
                    let status = of!(
                        standard,
                        fmi2SerializedFMUstateSize,
                        fmi3SerializedFMUStateSize(i, self.state, &mut size)
                    );
                    if status != 0 {
                        return status;
                    }
                    let mut bytes = vec![0_u8; size];
                    let written = of!(
                        standard,
                        fmi2SerializeFMUstate,
                        fmi3SerializeFMUState(i, self.state, bytes.as_mut_ptr(), size)
                    );
                    if written != 0 {
                        // The other thread was there in between.
                        return written;
                    }
                    // The state, the snapshot at its end, and a checksum of each.
                    let snapshot = bytes.windows(8).position(|w| w == b"URLSPHSN");
                    for (at, bits) in changes {
                        bytes[usize::from(*at) % size] ^= bits;
                    }
                    bytes.truncate(size - usize::from(*cut).min(size));
                    if let (true, Some(snapshot)) = (*seal, snapshot) {
                        let end = bytes.len().saturating_sub(8);
                        for from in [snapshot, 0] {
                            let to = if from == 0 {
                                end
                            } else {
                                end.saturating_sub(8)
                            };
                            if to > from {
                                let sum = xxh3_64(&bytes[from..to]);
                                bytes[to..to + 8].copy_from_slice(&sum.to_le_bytes());
                            }
                        }
                    }
                    let mut again = null_mut();
                    let place = if *keep { &mut self.state } else { &mut again };
                    let status = of!(
                        standard,
                        fmi2DeSerializeFMUstate,
                        fmi3DeserializeFMUState(i, bytes.as_ptr(), bytes.len(), place)
                    );
                    if !again.is_null() {
                        of!(standard, fmi2FreeFMUstate, fmi3FreeFMUState(i, &mut again));
                    }
                    status
                }
            }
        }
    }
}

fn known(references: &[u16]) -> Vec<u32> {
    let few = references.iter().take(8);
    few.map(|r| u32::from(*r) % (MODEL.widths.len() as u32 + 1))
        .collect()
}

/// Room for as many values as the variables have, or for another number.
fn room_of(standard: Standard, references: &[u32], other: Option<u8>) -> usize {
    let width = |r: &u32| match standard {
        Two => 1,
        Three => MODEL.widths.get(*r as usize).copied().unwrap_or(1),
    };
    other.map_or_else(|| references.iter().map(width).sum(), usize::from)
}

/// An instantiation that something may be wrong with.
unsafe fn make_another(
    standard: Standard,
    token: u8,
    resources: Option<&[u8]>,
    what: u8,
) -> Status {
    let model = &*MODEL;
    let place = resources.map(|bytes| {
        let bytes: Vec<u8> = bytes.iter().filter(|b| **b != 0).copied().collect();
        CString::new(bytes).expect("no NUL")
    });
    let place = place.as_ref().map_or(null(), |p| p.as_ptr());
    let token = match token % 4 {
        0 => null(),
        1 => c"".as_ptr(),
        n => model.tokens[usize::from(n) - 2].as_ptr(),
    };
    let name = if what.is_multiple_of(2) {
        null()
    } else {
        c"n\xffme".as_ptr()
    };
    unsafe {
        let made = match (standard, what % 4) {
            (_, 0) => instantiate(model, standard, false),
            (_, 1) => instantiate(model, standard, true),
            (Two, kind) => fmi2Instantiate(name, kind.into(), token, place, null(), 0, 1),
            (Three, 2) => {
                fmi3InstantiateModelExchange(name, token, place, false, true, null_mut(), Some(log))
            }
            (Three, _) => fmi3InstantiateCoSimulation(
                name,
                token,
                place,
                false,
                true,
                true,
                true,
                null(),
                0,
                null_mut(),
                None,
                null_mut(),
            ),
        };
        of!(standard, fmi2FreeInstance, fmi3FreeInstance(made));
    }
    0
}
