//! What an importer holds: a pointer to an instance, and the guard around every call through it.

use std::ffi::{CStr, CString, c_char, c_void};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

use super::FmiVersion;
use super::instance::Instance;
use super::state::State;
use crate::error::{Code, Error, Result};
use crate::ffi::panic::catch;

/// Status of a call; the same numbers in both standards.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(i32)]
pub(super) enum Status {
    /// Done.
    Ok = 0,
    /// Not done; the instance goes on unless its state is said to be lost.
    Error = 3,
    /// The instance is lost.
    Fatal = 4,
}

/// Categories of messages, as in the description.
pub(super) const LOG_CATEGORIES: [(&CStr, &str); 3] = [
    (c"logStatusError", "Calls that failed, and why"),
    (
        c"logStatusFatal",
        "Failures after which the instance is lost",
    ),
    (
        c"logEvents",
        "Instantiation, initialisation and termination",
    ),
];

/// The FMI 2.0 logger; variadic, so messages go through `%s`.
pub(super) type Logger2 =
    unsafe extern "C" fn(*mut c_void, *const c_char, i32, *const c_char, *const c_char, ...);

/// The FMI 3.0 logger.
pub(super) type Logger3 = unsafe extern "C" fn(*mut c_void, i32, *const c_char, *const c_char);

/// The importer's logger with its environment pointer, which is handed back unchanged.
#[derive(Clone, Copy)]
pub(super) enum Logger {
    None,
    V2(Logger2, *mut c_void),
    V3(Logger3, *mut c_void),
}

impl Logger {
    fn send(self, name: &CStr, status: Status, category: &CStr, message: &str) {
        let message = text(message);
        match self {
            Self::None => {}
            // SAFETY: the importer gave this function for this purpose and keeps it valid while the
            // instance lives; all strings end with NUL and outlive the call.
            Self::V2(log, environment) => unsafe {
                log(
                    environment,
                    name.as_ptr(),
                    status as i32,
                    category.as_ptr(),
                    c"%s".as_ptr(),
                    message.as_ptr(),
                );
            },
            // SAFETY: as above.
            Self::V3(log, environment) => unsafe {
                log(
                    environment,
                    status as i32,
                    category.as_ptr(),
                    message.as_ptr(),
                );
            },
        }
    }
}

/// A text for C: whatever follows a NUL is cut off.
pub(super) fn text(text: &str) -> CString {
    CString::new(text.split('\0').next().unwrap_or_default()).unwrap_or_default()
}

/// An instance behind a C pointer.
pub(super) struct Handle {
    version: FmiVersion,
    name: CString,
    logger: Logger,
    /// Whether events are logged; errors always are.
    events: AtomicBool,
    /// `None` after a panic: only destruction is left.
    instance: Mutex<Option<Instance>>,
}

/// What an importer passes at instantiation.
pub(super) struct Arguments {
    pub version: FmiVersion,
    pub name: *const c_char,
    pub token: *const c_char,
    pub resources: *const c_char,
    pub logging: bool,
    pub logger: Logger,
}

/// Creates an instance; NULL, after a message, if that fails.
///
/// # Safety
/// The texts are NULL or end with NUL; the logger is as the standard says.
pub(super) unsafe fn instantiate(arguments: Arguments, refusal: Option<&str>) -> *mut c_void {
    // SAFETY: by the caller's promise.
    let name = unsafe { optional_text(arguments.name) };
    let name = text(name.as_deref().unwrap_or("urlsph"));
    // SAFETY: by the caller's promise.
    let token = unsafe { optional_text(arguments.token) };
    // SAFETY: by the caller's promise.
    let resources = unsafe { optional_text(arguments.resources) };
    let logger = arguments.logger;
    let made = catch(|| {
        if let Some(refusal) = refusal {
            return Err(Error::argument(refusal));
        }
        let token = token.ok_or_else(|| {
            Error::argument("the token is NULL: pass the one of modelDescription.xml")
        })?;
        let (scene, folder) = read_scene(resources.as_deref())?;
        Instance::new(arguments.version, scene, &folder, &token)
    });
    let made = made.unwrap_or_else(|panic| Err(internal(&panic)));
    match made {
        Ok(instance) => {
            let handle = Handle {
                version: arguments.version,
                name,
                logger,
                events: AtomicBool::new(arguments.logging),
                instance: Mutex::new(Some(instance)),
            };
            handle.event("instantiated");
            Box::into_raw(Box::new(handle)).cast()
        }
        Err(error) => {
            let message = format!("instantiation failed: {error}");
            logger.send(&name, Status::Error, LOG_CATEGORIES[0].0, &message);
            std::ptr::null_mut()
        }
    }
}

/// Destroys an instance; NULL is allowed.
///
/// # Safety
/// `pointer` is NULL or comes from [`instantiate`] and is not used any more.
pub(super) unsafe fn free(pointer: *mut c_void, version: FmiVersion) {
    // SAFETY: by the caller's promise.
    let Some(handle) = (unsafe { get(pointer, version) }) else {
        return;
    };
    handle.event("freed");
    // Joins the threads of the simulation. A panic must not reach the importer.
    let _ = catch(|| {
        // SAFETY: made by `Box::into_raw` in `instantiate`, and freed once.
        drop(unsafe { Box::from_raw(pointer.cast::<Handle>()) });
    });
}

/// Calls through a handle: one at a time, no panic gets out, failures are logged.
///
/// # Safety
/// `pointer` is NULL or comes from [`instantiate`].
pub(super) unsafe fn call(
    pointer: *mut c_void,
    version: FmiVersion,
    function: &str,
    body: impl FnOnce(&mut Instance) -> Result<()>,
) -> Status {
    // SAFETY: by the caller's promise.
    let Some(handle) = (unsafe { get(pointer, version) }) else {
        return Status::Error;
    };
    let outcome = match handle.instance.try_lock() {
        Err(_) => Err((
            Status::Error,
            "another thread uses this instance: calls on one instance must follow one another"
                .to_owned(),
        )),
        Ok(mut slot) => match slot.as_mut() {
            None => Err((
                Status::Fatal,
                "the instance is lost after an internal error: free it".to_owned(),
            )),
            Some(instance) => match catch(|| body(instance)) {
                Ok(Ok(())) => Ok(()),
                Ok(Err(error)) if error.code() != Code::Internal => {
                    Err((Status::Error, error.to_string()))
                }
                Ok(Err(error)) => {
                    *slot = None;
                    Err((Status::Fatal, error.to_string()))
                }
                Err(panic) => {
                    *slot = None;
                    Err((Status::Fatal, internal(&panic).to_string()))
                }
            },
        },
    };
    // The lock is released: the logger may call back.
    match outcome {
        Ok(()) => Status::Ok,
        Err((status, message)) => {
            let category = LOG_CATEGORIES[usize::from(status == Status::Fatal)].0;
            handle.logger.send(
                &handle.name,
                status,
                category,
                &format!("{function}: {message}"),
            );
            status
        }
    }
}

/// Like [`call`], with an event in the log when it is done.
///
/// # Safety
/// As [`call`].
pub(super) unsafe fn call_event(
    pointer: *mut c_void,
    version: FmiVersion,
    function: &str,
    body: impl FnOnce(&mut Instance) -> Result<()>,
) -> Status {
    // SAFETY: by the caller's promise.
    let status = unsafe { call(pointer, version, function, body) };
    // SAFETY: by the caller's promise.
    if let (Status::Ok, Some(handle)) = (status, unsafe { get(pointer, version) }) {
        handle.event(function);
    }
    status
}

/// Switches the log of events.
///
/// # Safety
/// `pointer` is NULL or comes from [`instantiate`]; `categories` has `count` texts or is NULL.
pub(super) unsafe fn set_logging(
    pointer: *mut c_void,
    version: FmiVersion,
    function: &str,
    on: bool,
    count: usize,
    categories: *const *const c_char,
) -> Status {
    let known = |name: &CStr| LOG_CATEGORIES.iter().any(|(c, _)| *c == name) || name == c"logAll";
    // SAFETY: by the caller's promise.
    let names = unsafe { slice(categories, count) };
    let check = |_: &mut Instance| {
        for &name in names.ok_or_else(null_array)? {
            // SAFETY: by the caller's promise, a text or NULL.
            let name = unsafe { optional_text(name) };
            let name = text(name.as_deref().unwrap_or_default());
            if !known(&name) {
                return Err(Error::argument(format!(
                    "there is no log category {name:?}: modelDescription.xml lists them"
                )));
            }
        }
        Ok(())
    };
    // SAFETY: by the caller's promise.
    let status = unsafe { call(pointer, version, function, check) };
    // SAFETY: by the caller's promise.
    if let (Status::Ok, Some(handle), Some(names)) =
        (status, unsafe { get(pointer, version) }, names)
    {
        // SAFETY: by the caller's promise, texts or NULL.
        let listed = |name: &CStr| {
            names
                .iter()
                .any(|&n| unsafe { optional_text(n) }.is_some_and(|n| text(&n).as_c_str() == name))
        };
        // No categories means all of them.
        if names.is_empty() || listed(c"logEvents") || listed(c"logAll") {
            handle.events.store(on, Ordering::Relaxed);
        }
    }
    status
}

/// Answers a function that this FMU does not have; a call for nothing is allowed.
///
/// # Safety
/// As [`call`].
pub(super) unsafe fn unsupported(
    pointer: *mut c_void,
    version: FmiVersion,
    function: &str,
    count: usize,
    why: &str,
) -> Status {
    let refuse = |_: &mut Instance| match count {
        0 => Ok(()),
        _ => Err(Error::argument(format!("not supported: {why}"))),
    };
    // SAFETY: by the caller's promise.
    unsafe { call(pointer, version, function, refuse) }
}

/// Stores a copy of the state behind `*place`, in the object there if there is one.
///
/// # Safety
/// As [`call`]; `place` is NULL or points to NULL or to a state from here.
pub(super) unsafe fn get_state(
    pointer: *mut c_void,
    version: FmiVersion,
    function: &str,
    place: *mut *mut c_void,
) -> Status {
    let body = |instance: &mut Instance| {
        // SAFETY: by the caller's promise.
        let place = unsafe { place.as_mut() }.ok_or_else(null_state)?;
        // SAFETY: by the caller's promise.
        unsafe { store(place, instance.state()?) };
        Ok(())
    };
    // SAFETY: by the caller's promise.
    unsafe { call(pointer, version, function, body) }
}

/// Returns to a state.
///
/// # Safety
/// As [`call`]; `state` is NULL or a state from here.
pub(super) unsafe fn set_state(
    pointer: *mut c_void,
    version: FmiVersion,
    function: &str,
    state: *mut c_void,
) -> Status {
    // SAFETY: by the caller's promise.
    let state = unsafe { state.cast::<State>().as_ref() };
    let body = |instance: &mut Instance| instance.restore(state.ok_or_else(null_state)?);
    // SAFETY: by the caller's promise.
    unsafe { call(pointer, version, function, body) }
}

/// Destroys a state and sets `*place` to NULL; also for an instance that is lost.
///
/// # Safety
/// As [`call`]; `place` is NULL or points to NULL or to a state from here.
pub(super) unsafe fn free_state(
    pointer: *mut c_void,
    version: FmiVersion,
    place: *mut *mut c_void,
) -> Status {
    // SAFETY: by the caller's promise.
    if unsafe { get(pointer, version) }.is_none() {
        return Status::Error;
    }
    // SAFETY: by the caller's promise.
    if let Some(place) = unsafe { place.as_mut() }
        && !place.is_null()
    {
        // SAFETY: made by `Box::into_raw` in `store`, and freed once: the importer's pointer is
        // replaced.
        drop(unsafe { Box::from_raw(place.cast::<State>()) });
        *place = std::ptr::null_mut();
    }
    Status::Ok
}

/// Says how many bytes a state has.
///
/// # Safety
/// As [`set_state`]; `size` is NULL or may be written.
pub(super) unsafe fn state_size(
    pointer: *mut c_void,
    version: FmiVersion,
    function: &str,
    state: *mut c_void,
    size: *mut usize,
) -> Status {
    // SAFETY: by the caller's promise.
    let state = unsafe { state.cast::<State>().as_ref() };
    let body = |_: &mut Instance| {
        let bytes = state.ok_or_else(null_state)?.to_bytes().len();
        // SAFETY: by the caller's promise.
        unsafe { put(size, bytes) };
        Ok(())
    };
    // SAFETY: by the caller's promise.
    unsafe { call(pointer, version, function, body) }
}

/// Writes a state as bytes.
///
/// # Safety
/// As [`set_state`]; `bytes` is NULL or has room for `size` bytes.
pub(super) unsafe fn write_state(
    pointer: *mut c_void,
    version: FmiVersion,
    function: &str,
    state: *mut c_void,
    bytes: *mut u8,
    size: usize,
) -> Status {
    // SAFETY: by the caller's promise.
    let (state, out) = unsafe { (state.cast::<State>().as_ref(), slice_mut(bytes, size)) };
    let body = |_: &mut Instance| {
        let bytes = state.ok_or_else(null_state)?.to_bytes();
        let out = out.ok_or_else(null_array)?;
        if out.len() != bytes.len() {
            return Err(Error::argument(format!(
                "the buffer has {} bytes, the state {}: ask for its size first",
                out.len(),
                bytes.len()
            )));
        }
        out.copy_from_slice(&bytes);
        Ok(())
    };
    // SAFETY: by the caller's promise.
    unsafe { call(pointer, version, function, body) }
}

/// Reads a state from bytes.
///
/// # Safety
/// As [`get_state`]; `bytes` is NULL or has `size` bytes.
pub(super) unsafe fn read_state(
    pointer: *mut c_void,
    version: FmiVersion,
    function: &str,
    bytes: *const u8,
    size: usize,
    place: *mut *mut c_void,
) -> Status {
    // SAFETY: by the caller's promise.
    let bytes = unsafe { slice(bytes, size) };
    let body = |instance: &mut Instance| {
        // SAFETY: by the caller's promise.
        let place = unsafe { place.as_mut() }.ok_or_else(null_state)?;
        let state = State::from_bytes(bytes.ok_or_else(null_array)?)?;
        instance.check_state(&state)?;
        // SAFETY: by the caller's promise.
        unsafe { store(place, state) };
        Ok(())
    };
    // SAFETY: by the caller's promise.
    unsafe { call(pointer, version, function, body) }
}

/// # Safety
/// `place` holds NULL or a state from here.
unsafe fn store(place: &mut *mut c_void, state: State) {
    // SAFETY: by the caller's promise.
    match unsafe { place.cast::<State>().as_mut() } {
        Some(old) => *old = state,
        None => *place = Box::into_raw(Box::new(state)).cast(),
    }
}

fn null_state() -> Error {
    Error::argument("the FMU state is NULL: get one first")
}

impl Handle {
    fn event(&self, message: &str) {
        if self.events.load(Ordering::Relaxed) {
            self.logger
                .send(&self.name, Status::Ok, LOG_CATEGORIES[2].0, message);
        }
    }
}

/// The handle behind a pointer; `None` for NULL and for an instance of the other standard.
///
/// # Safety
/// `pointer` is NULL or comes from [`instantiate`] and was not freed.
unsafe fn get<'a>(pointer: *mut c_void, version: FmiVersion) -> Option<&'a Handle> {
    // SAFETY: by the caller's promise.
    let handle = unsafe { pointer.cast::<Handle>().as_ref() }?;
    (handle.version == version).then_some(handle)
}

fn internal(panic: &str) -> Error {
    Error::new(
        Code::Internal,
        format!("internal error, please report it with the scene: {panic}"),
    )
}

/// What is said about a NULL array.
pub(super) fn null_array() -> Error {
    Error::argument(
        "an array is NULL, not aligned, or longer than memory can be: pass one of the given length",
    )
}

/// Whether an array can be where and as long as the importer says.
fn is_possible<T>(data: *const T, length: usize) -> bool {
    !data.is_null() && data.is_aligned() && length <= isize::MAX as usize / size_of::<T>()
}

/// An array of the importer; NULL only if it is empty. `None` if it cannot be one.
///
/// # Safety
/// `data` is NULL or has `length` elements that nobody writes meanwhile.
pub(super) unsafe fn slice<'a, T>(data: *const T, length: usize) -> Option<&'a [T]> {
    if length == 0 {
        Some(&[])
    } else if !is_possible(data, length) {
        None
    } else {
        // SAFETY: not NULL, aligned, of a possible size, and long enough by the caller's promise.
        Some(unsafe { std::slice::from_raw_parts(data, length) })
    }
}

/// The same for an array that is written.
///
/// # Safety
/// `data` is NULL or has `length` elements that nobody else uses meanwhile.
pub(super) unsafe fn slice_mut<'a, T>(data: *mut T, length: usize) -> Option<&'a mut [T]> {
    if length == 0 {
        Some(&mut [])
    } else if !is_possible(data, length) {
        None
    } else {
        // SAFETY: not NULL, aligned, of a possible size, and long enough by the caller's promise.
        Some(unsafe { std::slice::from_raw_parts_mut(data, length) })
    }
}

/// Writes a result if the importer wants it.
///
/// # Safety
/// `place` is NULL or may be written.
pub(super) unsafe fn put<T>(place: *mut T, value: T) {
    if !place.is_null() {
        // SAFETY: by the caller's promise.
        unsafe { place.write(value) };
    }
}

/// A text of the importer.
///
/// # Safety
/// `pointer` is NULL or a text that ends with NUL.
pub(super) unsafe fn optional_text(pointer: *const c_char) -> Option<String> {
    if pointer.is_null() {
        return None;
    }
    // SAFETY: by the caller's promise.
    Some(
        unsafe { CStr::from_ptr(pointer) }
            .to_string_lossy()
            .into_owned(),
    )
}

/// Reads the scene from the resources, wherever the importer says that they are, or beside the
/// library if it says nothing useful; and the folder that it is in, for the files that it names.
fn read_scene(resources: Option<&str>) -> Result<(String, PathBuf)> {
    let given = resources.filter(|r| !r.is_empty()).map(resource_path);
    let places: Vec<PathBuf> = given.into_iter().chain(own_resources()).collect();
    for folder in &places {
        if let Ok(text) = std::fs::read_to_string(folder.join("scene.json")) {
            return Ok((text, folder.clone()));
        }
    }
    let tried: Vec<_> = places
        .iter()
        .map(|p| p.join("scene.json").display().to_string())
        .collect();
    Err(Error::new(
        Code::Io,
        format!(
            "scene.json is not in the FMU's resources; tried {}: pass the path of the resources folder",
            tried.join(", ")
        ),
    ))
}

/// A native path (FMI 3.0) or a `file:` URI (FMI 2.0); either is understood in both.
fn resource_path(text: &str) -> PathBuf {
    let Some(rest) = text.strip_prefix("file:") else {
        return PathBuf::from(text);
    };
    // file:///path, file://localhost/path and file:/path.
    let path = match rest.strip_prefix("//") {
        Some(rest) => rest.find('/').map_or(rest, |slash| &rest[slash..]),
        None => rest,
    };
    let path = percent_decoded(path);
    // file:///C:/path
    let drive = path
        .strip_prefix('/')
        .filter(|p| p.as_bytes().get(1) == Some(&b':'));
    PathBuf::from(drive.unwrap_or(&path))
}

fn percent_decoded(text: &str) -> String {
    let mut out = Vec::with_capacity(text.len());
    let mut rest = text.as_bytes();
    while let Some((&byte, tail)) = rest.split_first() {
        rest = tail;
        let digits = tail.get(..2).and_then(|d| std::str::from_utf8(d).ok());
        let decoded = digits
            .filter(|d| byte == b'%' && d.bytes().all(|b| b.is_ascii_hexdigit()))
            .and_then(|d| u8::from_str_radix(d, 16).ok());
        match decoded {
            Some(value) => {
                out.push(value);
                rest = &tail[2..];
            }
            None => out.push(byte),
        }
    }
    String::from_utf8_lossy(&out).into_owned()
}

/// The resources of the FMU whose `binaries/<platform>` holds this library.
#[cfg(unix)]
fn own_resources() -> Option<PathBuf> {
    let mut info = std::mem::MaybeUninit::<libc::Dl_info>::zeroed();
    // SAFETY: `info` may be written; any address in this library will do, and its name is a text
    // that lives as long as the library.
    let file = unsafe {
        if libc::dladdr(own_resources as *const c_void, info.as_mut_ptr()) == 0 {
            return None;
        }
        optional_text(info.assume_init().dli_fname)?
    };
    Some(
        Path::new(&file)
            .parent()?
            .parent()?
            .parent()?
            .join("resources"),
    )
}

#[cfg(not(unix))]
fn own_resources() -> Option<PathBuf> {
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn resources_come_as_path_or_uri() {
        for (text, path) in [
            ("/tmp/my fmu/resources", "/tmp/my fmu/resources"),
            ("/tmp/100%25/resources/", "/tmp/100%25/resources/"),
            ("file:///tmp/my%20fmu/resources", "/tmp/my fmu/resources"),
            ("file://localhost/tmp/r", "/tmp/r"),
            ("file:/tmp/r", "/tmp/r"),
            ("file:///tmp/%C3%BC/100%/r", "/tmp/\u{fc}/100%/r"),
            ("file:///C:/fmu/resources", "C:/fmu/resources"),
        ] {
            assert_eq!(resource_path(text), PathBuf::from(path), "{text}");
        }
    }

    #[test]
    fn a_missing_scene_is_named() {
        let error = read_scene(Some("/no/such/place")).unwrap_err();
        assert_eq!(error.code(), Code::Io);
        let remedy = ": pass the path of the resources folder";
        assert!(error.message().ends_with(remedy), "{error}");
        assert!(
            error.to_string().contains("/no/such/place/scene.json"),
            "{error}"
        );
    }

    #[test]
    fn impossible_arrays_are_refused() {
        let one = 1.0_f64;
        // SAFETY: none of these leads to a slice.
        unsafe {
            assert!(slice::<f64>(std::ptr::null(), 1).is_none());
            assert!(slice(&one, usize::MAX).is_none());
            assert!(slice_mut(std::ptr::without_provenance_mut::<f64>(1), 1).is_none());
        }
    }

    #[test]
    fn nul_in_a_text_is_cut() {
        assert_eq!(text("a\0b").as_c_str(), c"a");
    }
}
