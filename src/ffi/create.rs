//! Version; creation, errors, callbacks, destruction.

use std::ffi::{CStr, c_char};
use std::ptr;

use super::args::{array, get_struct, put, put_struct, text};
use super::callbacks::Callbacks;
use super::handle::{self, with};
use super::types::{
    URLSPH_ABI_VERSION, urlsph_callbacks, urlsph_error, urlsph_options, urlsph_simulation,
    urlsph_status,
};
use crate::error::{Error, Result};
use crate::scene::Scene;
use crate::simulation::Simulation;

/// Version of the library, such as "0.1.0"; the header's is `URLSPH_VERSION`.
///
/// The text is valid as long as the library is loaded. Any thread, at any time.
#[unsafe(no_mangle)]
pub extern "C" fn urlsph_version() -> *const c_char {
    const VERSION: &CStr =
        match CStr::from_bytes_with_nul(concat!(env!("CARGO_PKG_VERSION"), "\0").as_bytes()) {
            Ok(version) => version,
            Err(_) => panic!("the package version has no NUL inside"),
        };
    VERSION.as_ptr()
}

/// Version of the binary interface of the library; the header's is `URLSPH_ABI_VERSION`. A program
/// can use the library if the two are equal. Any thread, at any time.
#[unsafe(no_mangle)]
pub extern "C" fn urlsph_abi_version() -> u32 {
    URLSPH_ABI_VERSION
}

/// What a status means, in a few words of English; never NULL.
///
/// The text is valid as long as the library is loaded. Any thread, at any time.
#[unsafe(no_mangle)]
pub extern "C" fn urlsph_status_text(status: i32) -> *const c_char {
    let text = match status {
        0 => c"ok",
        1 => c"invalid argument",
        2 => c"the scene is not well formed",
        3 => c"a value of the scene is not admissible",
        4 => c"a file could not be read or written",
        5 => c"out of memory",
        6 => c"the solution diverged",
        7 => c"cancelled",
        8 => c"the snapshot does not fit",
        9 => c"the simulation is in use",
        10 => c"internal error, the simulation can only be destroyed",
        _ => c"unknown status",
    };
    text.as_ptr()
}

/// Creates a simulation from the JSON text of a scene.
///
/// - `json`: NUL-terminated UTF-8. Files that the scene names, such as a mesh, are relative to the
///   working directory.
/// - `options`, `options_size`: NULL and 0 for the defaults, or the options and their size.
/// - `simulation`: receives the handle; NULL on failure. Release it with `urlsph_destroy`.
/// - `error`, `error_size`: NULL and 0, or receives what went wrong: there is no handle to ask.
///
/// Errors: `URLSPH_INVALID_ARGUMENT`, `URLSPH_PARSE`, `URLSPH_INVALID_SCENE` with the JSON path or
/// the particle, `URLSPH_IO` for a mesh file, `URLSPH_OUT_OF_MEMORY`. Any thread, at any time.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn urlsph_create_from_json(
    json: *const c_char,
    options: *const urlsph_options,
    options_size: usize,
    simulation: *mut *mut urlsph_simulation,
    error: *mut urlsph_error,
    error_size: usize,
) -> urlsph_status {
    // SAFETY: the caller's pointers, as the header's preamble demands.
    unsafe {
        create(simulation, error, error_size, || {
            let options = Options::read(options, options_size)?;
            let scene = Scene::from_json(text(json, "json")?, &options.overrides)?;
            Simulation::with_threads(scene, options.threads)
        })
    }
}

/// Creates a simulation from the file of a scene.
///
/// - `path`: NUL-terminated UTF-8. Files that the scene names are relative to its folder.
/// - The others: as for `urlsph_create_from_json`.
///
/// Errors: those of `urlsph_create_from_json`, and `URLSPH_IO`. Any thread, at any time.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn urlsph_create_from_file(
    path: *const c_char,
    options: *const urlsph_options,
    options_size: usize,
    simulation: *mut *mut urlsph_simulation,
    error: *mut urlsph_error,
    error_size: usize,
) -> urlsph_status {
    // SAFETY: the caller's pointers, as the header's preamble demands.
    unsafe {
        create(simulation, error, error_size, || {
            let options = Options::read(options, options_size)?;
            let scene = Scene::from_file(text(path, "path")?, &options.overrides)?;
            Simulation::with_threads(scene, options.threads)
        })
    }
}

/// Options as Rust values.
struct Options {
    overrides: Vec<String>,
    threads: usize,
}

impl Options {
    unsafe fn read(options: *const urlsph_options, size: usize) -> Result<Self> {
        if options.is_null() {
            return Ok(Self {
                overrides: Vec::new(),
                threads: 0,
            });
        }
        // SAFETY: the caller's pointers, as the header's preamble demands.
        let (overrides, threads) = unsafe {
            let options = get_struct(options, size, "options")?;
            let overrides = array(
                options.overrides,
                options.override_count,
                "options.overrides",
            )?
            .iter()
            .enumerate()
            .map(|(i, &item)| text(item, &format!("options.overrides[{i}]")).map(str::to_owned))
            .collect::<Result<_>>()?;
            (overrides, options.threads)
        };
        Ok(Self { overrides, threads })
    }
}

unsafe fn create(
    simulation: *mut *mut urlsph_simulation,
    error: *mut urlsph_error,
    error_size: usize,
    build: impl FnOnce() -> Result<Simulation>,
) -> urlsph_status {
    let outcome = handle::without(|| {
        // Both outputs are checked before the work is done.
        // SAFETY: the caller's pointers, as the header's preamble demands.
        unsafe {
            put(simulation, ptr::null_mut(), "simulation")?;
            if !error.is_null() {
                put_struct(error, error_size, &urlsph_error::none(), "error")?;
            }
        }
        handle::register(build()?)
    });
    let report = match outcome {
        // SAFETY: written to before.
        Ok(handle) => match unsafe { put(simulation, handle, "simulation") } {
            Ok(()) => return urlsph_status::URLSPH_OK,
            Err(e) => e,
        },
        Err(e) => e,
    };
    if !error.is_null() {
        // A wrong `error` cannot be told in `error`; the status says it.
        // SAFETY: the caller's pointer, as the header's preamble demands.
        let _ = unsafe { put_struct(error, error_size, &urlsph_error::from(&report), "error") };
    }
    report.code().into()
}

/// Destroys a simulation and ends its threads. Names and views borrowed from it become invalid.
///
/// - `simulation`: NULL does nothing, as with `free`.
///
/// Errors: `URLSPH_INVALID_ARGUMENT` for a handle that is not (or no longer) one; `URLSPH_BUSY` if
/// it is in use: nothing happened then. Any thread.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn urlsph_destroy(simulation: *mut urlsph_simulation) -> urlsph_status {
    handle::destroy(simulation)
}

/// The error of the last call with this handle that failed; its code is `URLSPH_OK` if none has.
///
/// Calls that were refused with `URLSPH_BUSY`, and calls with a wrong handle, leave no error behind:
/// for them the status is all there is. This works on a poisoned handle too.
///
/// - `error`, `error_size`: receives the error; the size of the struct.
///
/// Errors: `URLSPH_INVALID_ARGUMENT`, `URLSPH_BUSY`. Any thread.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn urlsph_get_last_error(
    simulation: *const urlsph_simulation,
    error: *mut urlsph_error,
    error_size: usize,
) -> urlsph_status {
    handle::last_error(simulation, |last| {
        let last = last.map_or_else(urlsph_error::none, urlsph_error::from);
        // SAFETY: the caller's pointer, as the header's preamble demands.
        unsafe { put_struct(error, error_size, &last, "error") }
    })
}

/// Sets the callbacks of a simulation.
///
/// Callbacks run on the thread that makes the call which they report on, and before it returns. A
/// callback must not throw or `longjmp`. In a callback every call with the same handle gets
/// `URLSPH_BUSY`; other handles can be used.
///
/// - `callbacks`, `callbacks_size`: NULL and 0 to have none, or the callbacks, which are copied, and
///   the size of the struct.
///
/// Errors: `URLSPH_INVALID_ARGUMENT`, `URLSPH_BUSY`, `URLSPH_INTERNAL`. Any thread.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn urlsph_set_callbacks(
    simulation: *mut urlsph_simulation,
    callbacks: *const urlsph_callbacks,
    callbacks_size: usize,
) -> urlsph_status {
    with(simulation, |session| {
        session.callbacks = if callbacks.is_null() {
            Callbacks::default()
        } else {
            // SAFETY: the caller's pointer, as the header's preamble demands.
            unsafe { get_struct(callbacks, callbacks_size, "callbacks")? }.into()
        };
        Ok(())
    })
}

impl urlsph_error {
    fn none() -> Self {
        Self {
            code: urlsph_status::URLSPH_OK,
            has_particle: 0,
            has_position: 0,
            has_time: 0,
            particle: 0,
            position: [0.0; 3],
            time: 0.0,
            text: fixed(""),
            path: fixed(""),
            boundary: fixed(""),
            field: fixed(""),
        }
    }
}

impl From<&Error> for urlsph_error {
    fn from(error: &Error) -> Self {
        let place = error.place();
        Self {
            code: error.code().into(),
            has_particle: place.particle.is_some().into(),
            has_position: place.position.is_some().into(),
            has_time: place.time.is_some().into(),
            particle: place.particle.unwrap_or_default() as u64,
            position: place.position.unwrap_or_default(),
            time: place.time.unwrap_or_default(),
            text: fixed(&error.to_string()),
            path: fixed(place.path.as_deref().unwrap_or_default()),
            boundary: fixed(place.boundary.as_deref().unwrap_or_default()),
            field: fixed(place.field.as_deref().unwrap_or_default()),
        }
    }
}

/// A text in an array of fixed size: whole, or cut between two characters and ended by "...".
fn fixed<const N: usize>(text: &str) -> [c_char; N] {
    const MARK: &str = "...";
    let (kept, mark) = if text.len() < N {
        (text, "")
    } else {
        let room = N - 1 - MARK.len();
        let end = (0..=room).rev().find(|&i| text.is_char_boundary(i));
        (&text[..end.unwrap_or(0)], MARK)
    };
    let mut out = [0; N];
    for (slot, byte) in out.iter_mut().zip(kept.bytes().chain(mark.bytes())) {
        *slot = byte as c_char;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Code;

    fn read<const N: usize>(array: [c_char; N]) -> String {
        let bytes: Vec<u8> = array
            .iter()
            .map(|&c| c as u8)
            .take_while(|&b| b != 0)
            .collect();
        String::from_utf8(bytes).expect("cut between characters")
    }

    #[test]
    fn long_texts_are_cut_between_characters() {
        assert_eq!(read(fixed::<8>("abcdefg")), "abcdefg");
        assert_eq!(read(fixed::<8>("abcdefgh")), "abcd...");
        assert_eq!(read(fixed::<8>("abc\u{fc}\u{fc}\u{fc}")), "abc...");
        assert_eq!(read(fixed::<8>("")), "");
    }

    #[test]
    fn the_soname_is_the_version_of_the_binary_interface() {
        assert_eq!(
            URLSPH_ABI_VERSION.to_string(),
            env!("CARGO_PKG_VERSION_MAJOR")
        );
    }

    #[test]
    fn status_and_code_are_the_same_number() {
        for code in [
            Code::InvalidArgument,
            Code::Parse,
            Code::InvalidScene,
            Code::Io,
            Code::OutOfMemory,
            Code::Diverged,
            Code::Cancelled,
            Code::Snapshot,
            Code::Busy,
            Code::Internal,
        ] {
            assert_eq!(urlsph_status::from(code) as i32, code as i32);
        }
    }
}
