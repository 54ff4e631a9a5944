//! Sequences of calls of the C ABI, with whatever arguments, from two threads.

use std::ffi::{CStr, CString, c_char, c_void};
use std::ptr::{null, null_mut};
use std::sync::Mutex;
use std::sync::atomic::{AtomicI32, Ordering};

use arbitrary::{Arbitrary, Unstructured};
use urlsph::ffi::*;

use super::number::Number;

const SCENES: [&str; 4] = [
    r#"{"geometry": {"box": {"min": [0, 0, 0], "max": [1, 1, 1], "spacing": 1}},
        "material": {"neo_hookean": {"density": 1000, "youngs_modulus": 1e7, "poisson_ratio": 0.3}},
        "boundary": {"y_min": {"support": "clamped"}, "y_max": {"traction": {"external": [0, 0, 0]}}},
        "probes": {"tip": [0, 1, 0]}, "time": {"end": 1}}"#,
    r#"{"geometry": {"box": {"min": [0, 0, 0], "max": [0.5, 0.5, 1], "spacing": 0.5}},
        "material": {"von_mises": {"density": 1000, "youngs_modulus": 1e7, "poisson_ratio": 0.3, "yield_stress": 1e5}},
        "heat": {"specific_heat": 100, "reference_temperature": 300, "conductivity": 10},
        "boundary": {"y_min": {"velocity": {"external": [0, 0, 0]}}, "x_min": {"temperature": {"external": 300}},
            "x_max": {"heat_flux": {"external": 0}}, "y_max": {"pressure": {"external": 0}},
            "z_max": {"convection": {"coefficient": {"external": 1}, "ambient_temperature": {"external": 300}}}},
        "contact": {"floor": {"point": [0, -0.1, 0], "normal": [0, 1, 0]}},
        "numerics": {"reference_update": "every_step", "precision": "single"}, "time": {"end": 1}}"#,
    r#"{"geometry": {"box": {"min": [0, 0, 0], "max": [1, 1, 1], "spacing": -0.5}}}"#,
    "{",
];

/// An index, a count or a size.
#[derive(Debug, Clone, Copy, Arbitrary)]
enum Size {
    Small(u8),
    Any(usize),
    Largest,
}

impl Size {
    fn value(self) -> usize {
        match self {
            Self::Small(n) => usize::from(n) % 40,
            Self::Any(n) => n,
            Self::Largest => usize::MAX,
        }
    }
    /// What a host that keeps the contract passes with a buffer of so many.
    fn at_most(self, room: usize) -> usize {
        self.value().min(room)
    }
}

#[derive(Debug, Clone, Arbitrary)]
enum Call {
    Create {
        scene: u8,
        threads: Size,
        overrides: Vec<Vec<u8>>,
        options_size: Option<Size>,
        error_size: Option<Size>,
    },
    CreateFromFile(Vec<u8>),
    Destroy,
    Set {
        which: u8,
        patch: Size,
        values: [Number; 4],
        count: Size,
        missing: bool,
    },
    ReadInput {
        patch: Size,
        quantity: i32,
        room: Size,
    },
    Step(Number),
    AdvanceTo(Number),
    Callbacks {
        observing: bool,
        size: Option<Size>,
    },
    Save {
        room: Option<Size>,
    },
    Restore {
        damage: Option<(u16, u8)>,
        size: Option<Size>,
    },
    Find {
        what: u8,
        name: Vec<u8>,
    },
    ReadField {
        field: Size,
        room: Size,
    },
    ReadPatch {
        what: u8,
        patch: Size,
        room: Size,
    },
    Ask {
        what: u8,
        index: Size,
        size: Size,
        /// Bytes by which the output is not aligned.
        shift: u8,
    },
    LastError(Option<Size>),
    View(Size),
}

/// Handles that live, or lived, and a snapshot; shared by the threads of a sequence.
struct Host {
    handles: Mutex<Vec<usize>>,
    snapshot: Mutex<Vec<u8>>,
    /// Steps that a call may still make.
    patience: AtomicI32,
    /// Whether there is no other thread.
    alone: bool,
}

unsafe extern "C" fn cancel(host: *mut c_void) -> i32 {
    // SAFETY: the host outlives its handles.
    let host = unsafe { &*host.cast::<Host>() };
    for number in 0..3 {
        let mut time = 0.0;
        // SAFETY: any handle will do; the one whose callback this is answers that it is busy.
        unsafe { urlsph_get_time(host.handle(number), &mut time) };
    }
    i32::from(host.patience.fetch_sub(1, Ordering::Relaxed) <= 0)
}

unsafe extern "C" fn log(record: *const urlsph_log_record, _: *mut c_void) {
    // SAFETY: a record with a NUL-terminated text, and perhaps an error, for the time of the call.
    let (text, error) = unsafe { (CStr::from_ptr((*record).message), (*record).error.as_ref()) };
    assert!(!text.is_empty());
    assert!(error.is_none_or(|error| error.code != urlsph_status::URLSPH_OK));
}

/// A text without the NUL that ends it elsewhere.
fn c_text(bytes: &[u8]) -> CString {
    let bytes: Vec<u8> = bytes.iter().filter(|b| **b != 0).copied().collect();
    CString::new(bytes).expect("no NUL")
}

/// A buffer with a mark behind its end, which no call may pass.
fn within<T: Copy + PartialEq + std::fmt::Debug>(
    room: usize,
    mark: T,
    call: impl FnOnce(*mut T) -> urlsph_status,
) -> urlsph_status {
    let mut buffer = vec![mark; room + 8];
    let status = call(buffer.as_mut_ptr());
    assert!(
        buffer[room..].iter().all(|v| *v == mark),
        "written past the end"
    );
    status
}

/// Most numbers that a buffer has here.
const ROOM: usize = 600;

impl Host {
    /// A handle by its number: live, destroyed, or none at all.
    fn handle(&self, number: u8) -> *mut urlsph_simulation {
        let handles = self.handles.lock().expect("no panic while it is held");
        match handles.get(usize::from(number) % (handles.len() + 1)) {
            Some(handle) => *handle as *mut urlsph_simulation,
            None if number.is_multiple_of(2) => null_mut(),
            None => (usize::from(number) << 4) as *mut urlsph_simulation,
        }
    }

    fn make(&self, number: u8, call: &Call) {
        let s = self.handle(number);
        let hash = || {
            let mut hash = 0;
            // SAFETY: any handle will do.
            unsafe { urlsph_get_state_hash(s, &mut hash) };
            hash
        };
        let before = self.alone.then(hash);
        // SAFETY: every pointer is NULL or valid for the length that goes with it.
        let status = unsafe { self.call(s, call) };
        assert_ne!(status, urlsph_status::URLSPH_INTERNAL, "{call:?}");
        let may_change = match call {
            Call::Step(_) | Call::AdvanceTo(_) | Call::Destroy => true,
            Call::Set { .. } | Call::Restore { .. } => status == urlsph_status::URLSPH_OK,
            _ => false,
        };
        if let (Some(before), false) = (before, may_change) {
            assert_eq!(before, hash(), "{call:?} changed the state");
        }
    }

    unsafe fn call(&self, s: *mut urlsph_simulation, call: &Call) -> urlsph_status {
        let mut index = 0_usize;
        match call {
            Call::Create {
                scene,
                threads,
                overrides,
                options_size,
                error_size,
            } => {
                let json =
                    CString::new(SCENES[usize::from(*scene) % SCENES.len()]).expect("no NUL");
                let overrides: Vec<CString> =
                    overrides.iter().take(4).map(|text| c_text(text)).collect();
                let overrides: Vec<*const c_char> = overrides.iter().map(|o| o.as_ptr()).collect();
                let mut options: [urlsph_options; 2] = unsafe { std::mem::zeroed() };
                options[0] = urlsph_options {
                    overrides: overrides.as_ptr(),
                    override_count: overrides.len(),
                    // Cores are few, and threads take long to start.
                    threads: match threads.value() {
                        n @ 0..40 => 1 + n % 2,
                        n => n.max(1025),
                    },
                };
                let options_size = options_size.map_or(size_of::<urlsph_options>(), |size| {
                    size.at_most(size_of_val(&options))
                });
                let mut handle = null_mut();
                let mut error: urlsph_error = unsafe { std::mem::zeroed() };
                let most = size_of::<urlsph_error>();
                let (error, error_size) = match error_size {
                    Some(size) => (&raw mut error, size.at_most(most)),
                    None => (null_mut(), 0),
                };
                let status = unsafe {
                    urlsph_create_from_json(
                        json.as_ptr(),
                        options.as_ptr(),
                        options_size,
                        &mut handle,
                        error,
                        error_size,
                    )
                };
                assert_eq!(status == urlsph_status::URLSPH_OK, !handle.is_null());
                if !handle.is_null() {
                    let callbacks = self.callbacks(false);
                    let size = size_of::<urlsph_callbacks>();
                    unsafe { urlsph_set_callbacks(handle, &callbacks, size) };
                    let mut handles = self.handles.lock().expect("no panic while it is held");
                    if handles.len() < 6 {
                        handles.push(handle as usize);
                    } else {
                        unsafe { urlsph_destroy(handle) };
                    }
                }
                status
            }
            Call::CreateFromFile(path) => {
                let path = c_text(path);
                // A file that there is would be read: of these, none is a scene.
                if std::path::Path::new(&*path.to_string_lossy()).exists() {
                    return urlsph_status::URLSPH_OK;
                }
                let mut handle = null_mut();
                let status = unsafe {
                    urlsph_create_from_file(path.as_ptr(), null(), 0, &mut handle, null_mut(), 0)
                };
                assert!(handle.is_null());
                status
            }
            Call::Destroy => {
                unsafe { urlsph_destroy(s) };
                urlsph_status::URLSPH_OK
            }
            Call::Set {
                which,
                patch,
                values,
                count,
                missing,
            } => {
                let few: Vec<f64> = (0..ROOM).map(|i| values[i % 4].value(0.0)).collect();
                let (data, count) = match missing {
                    true => (null(), count.value()),
                    false => (few.as_ptr(), count.at_most(ROOM)),
                };
                let patch = patch.value();
                match which % 6 {
                    0 => unsafe { urlsph_set_traction(s, patch, data, count) },
                    1 => unsafe { urlsph_set_pressure(s, patch, data, count) },
                    2 => unsafe { urlsph_set_velocity(s, patch, data, count) },
                    3 => unsafe { urlsph_set_heat_flux(s, patch, data, count) },
                    4 => unsafe { urlsph_set_temperature(s, patch, data, count) },
                    _ => unsafe { urlsph_set_convection(s, patch, data, count, data, count) },
                }
            }
            Call::ReadInput {
                patch,
                quantity,
                room,
            } => {
                let room = room.at_most(ROOM);
                within(room, f64::INFINITY, |values| unsafe {
                    urlsph_read_input(s, patch.value(), *quantity, values, room, &mut index)
                })
            }
            Call::Step(dt) => {
                self.patience.store(5, Ordering::Relaxed);
                unsafe { urlsph_step(s, dt.value(0.0)) }
            }
            Call::AdvanceTo(time) => {
                self.patience.store(5, Ordering::Relaxed);
                unsafe { urlsph_advance_to(s, time.value(0.0)) }
            }
            Call::Callbacks { observing, size } => {
                let callbacks = self.callbacks(*observing);
                let whole = size_of::<urlsph_callbacks>();
                // A smaller struct is refused: none is without the cancellation that ends a call.
                let size = size.map_or(whole, |size| size.at_most(whole));
                unsafe { urlsph_set_callbacks(s, &callbacks, size) }
            }
            Call::Save { room } => {
                let status = unsafe { urlsph_get_snapshot_size(s, &mut index) };
                if status != urlsph_status::URLSPH_OK {
                    return status;
                }
                let room = room.map_or(index, |room| room.at_most(index));
                let mut bytes = vec![0_u8; room];
                let status =
                    unsafe { urlsph_save_snapshot(s, bytes.as_mut_ptr().cast(), room, &mut index) };
                if status == urlsph_status::URLSPH_OK {
                    bytes.truncate(index);
                    *self.snapshot.lock().expect("no panic while it is held") = bytes;
                }
                status
            }
            Call::Restore { damage, size } => {
                let mut bytes = self
                    .snapshot
                    .lock()
                    .expect("no panic while it is held")
                    .clone();
                if let (Some((at, bits)), false) = (damage, bytes.is_empty()) {
                    let at = usize::from(*at) % bytes.len();
                    bytes[at] ^= bits;
                }
                let size = size.map_or(bytes.len(), |size| size.at_most(bytes.len()));
                unsafe { urlsph_restore_snapshot(s, bytes.as_ptr().cast(), size) }
            }
            Call::Find { what, name } => {
                let name = c_text(name);
                let name = name.as_ptr();
                match what % 4 {
                    0 => unsafe { urlsph_find_patch(s, name, &mut index) },
                    1 => unsafe { urlsph_find_probe(s, name, &mut index) },
                    2 => unsafe { urlsph_find_contact(s, name, &mut index) },
                    _ => unsafe { urlsph_find_field(s, name, &mut index) },
                }
            }
            Call::ReadField { field, room } => {
                let room = room.at_most(ROOM);
                within(room, f64::INFINITY, |values| unsafe {
                    urlsph_read_field(s, field.value(), values, room)
                })
            }
            Call::ReadPatch { what, patch, room } => {
                let (room, patch) = (room.at_most(ROOM), patch.value());
                match what % 3 {
                    0 => within(room, usize::MAX, |v| unsafe {
                        urlsph_read_patch_particles(s, patch, v, room)
                    }),
                    1 => within(room, f64::INFINITY, |v| unsafe {
                        urlsph_read_patch_areas(s, patch, v, room)
                    }),
                    _ => within(room, f64::INFINITY, |v| unsafe {
                        urlsph_read_patch_normals(s, patch, v, room)
                    }),
                }
            }
            Call::Ask {
                what,
                index,
                size,
                shift,
            } => {
                // Structs of any size that fits, as from a program of another version.
                let (index, size) = (index.value(), size.at_most(ROOM));
                within(ROOM, 0_u64, |room| unsafe {
                    let room = room.cast::<u8>().add(usize::from(shift % 8));
                    match what % 19 {
                        0 => urlsph_get_counts(s, room.cast(), size),
                        1 => urlsph_get_time(s, room.cast()),
                        2 => urlsph_get_end_time(s, room.cast()),
                        3 => urlsph_get_stable_step(s, room.cast()),
                        4 => urlsph_get_energies(s, room.cast(), size),
                        5 => urlsph_get_momenta(s, room.cast(), size),
                        6 => urlsph_get_patch_info(s, index, room.cast(), size),
                        7 => urlsph_get_resultant(s, index, room.cast(), size),
                        8 => urlsph_get_heat_resultant(s, index, room.cast(), size),
                        9 => urlsph_get_contact_info(s, index, room.cast(), size),
                        10 => urlsph_get_contact_resultant(s, index, room.cast(), size),
                        11 => urlsph_get_field_info(s, index, room.cast(), size),
                        12 => urlsph_get_probe_info(s, index, room.cast(), size),
                        13 => urlsph_get_probe_motion(s, index, room.cast(), size),
                        14 => urlsph_get_input_info(s, index, room.cast(), size),
                        15 => urlsph_get_state_hash(s, room.cast()),
                        16 => urlsph_get_snapshot_size(s, room.cast()),
                        17 => urlsph_get_generation(s, room.cast()),
                        _ => urlsph_get_title(s, room.cast()),
                    }
                })
            }
            Call::LastError(size) => {
                let mut error: urlsph_error = unsafe { std::mem::zeroed() };
                let whole = size_of::<urlsph_error>();
                let size = size.map_or(whole, |size| size.at_most(whole));
                let status = unsafe { urlsph_get_last_error(s, &mut error, size) };
                if status == urlsph_status::URLSPH_OK {
                    let text = unsafe { CStr::from_ptr(error.text.as_ptr()) };
                    text.to_str().expect("UTF-8");
                }
                status
            }
            Call::View(field) => {
                let mut view: urlsph_view = unsafe { std::mem::zeroed() };
                let size = size_of::<urlsph_view>();
                let status = unsafe { urlsph_get_view(s, field.value(), &mut view, size) };
                // A call of another thread ends the loan.
                if status == urlsph_status::URLSPH_OK && self.alone {
                    let (order, stride) = (view.order, view.component_stride);
                    for slot in 0..view.particles {
                        let particle = unsafe { *order.add(slot) };
                        assert!((particle as usize) < view.particles);
                        for component in 0..view.components {
                            let value = unsafe { *view.data.add(component * stride + slot) };
                            assert!(!value.is_nan(), "a state is made of numbers");
                        }
                    }
                }
                status
            }
        }
    }

    /// Every call that advances is cancelled after a few steps.
    fn callbacks(&self, observing: bool) -> urlsph_callbacks {
        urlsph_callbacks {
            user_data: std::ptr::from_ref(self).cast_mut().cast(),
            log: observing.then_some(log as _),
            progress: None,
            cancel: Some(cancel),
        }
    }
}

/// Calls on handles by number; a few at the end run beside the others on a thread of their own.
#[derive(Debug, Arbitrary)]
struct Sequence {
    scene: u8,
    calls: Vec<(u8, Call)>,
    beside: Vec<(u8, Call)>,
}

/// Sequences of calls: any status but an internal error, no write out of bounds, no race.
pub fn calls(data: &[u8]) {
    let Ok(Sequence {
        scene,
        mut calls,
        mut beside,
    }) = Sequence::arbitrary_take_rest(Unstructured::new(data))
    else {
        return;
    };
    calls.truncate(40);
    beside.truncate(10);
    let host = Host {
        alone: beside.is_empty(),
        handles: Mutex::new(Vec::new()),
        snapshot: Mutex::new(Vec::new()),
        patience: AtomicI32::new(0),
    };
    let first = Call::Create {
        scene: scene % 2,
        threads: Size::Small(0),
        overrides: Vec::new(),
        options_size: None,
        error_size: None,
    };
    host.make(0, &first);
    assert_ne!(host.handle(0), null_mut());
    std::thread::scope(|scope| {
        if !beside.is_empty() {
            scope.spawn(|| {
                beside
                    .iter()
                    .for_each(|(number, call)| host.make(*number, call))
            });
        }
        calls
            .iter()
            .for_each(|(number, call)| host.make(*number, call));
    });
    let handles = host
        .handles
        .into_inner()
        .expect("no panic while it was held");
    for handle in handles {
        // SAFETY: destroyed ones are no harm.
        unsafe { urlsph_destroy(handle as *mut urlsph_simulation) };
    }
}
