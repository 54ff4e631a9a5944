//! Panics: caught at the boundary, silent, and with a message that finds its way into the error.
//!
//! `catch_unwind` alone is not enough: the default hook has printed to the host's stderr before the
//! unwinding starts, and a hook is the only stable way to keep it quiet. The shared and the static
//! library carry a standard library of their own, so this hook is theirs alone and a C, C++ or
//! Python host cannot notice it. Where the crate is linked into a Rust program that shares its
//! standard library with us, the hook is installed by the first call of the C ABI only, and it hands
//! every panic that does not arise inside such a call on to the hook that was there before.

use std::any::Any;
use std::cell::{Cell, RefCell};
use std::panic::{AssertUnwindSafe, PanicHookInfo, catch_unwind, set_hook, take_hook};
use std::sync::Once;

use crate::parallel::THREAD_NAME_PREFIX;

thread_local! {
    /// How many guarded calls this thread is in; a callback may call into another handle.
    static DEPTH: Cell<u32> = const { Cell::new(0) };
    /// What the hook saw on this thread.
    static REPORT: RefCell<Option<String>> = const { RefCell::new(None) };
}

static HOOK: Once = Once::new();

/// Runs `f`; a panic in it comes back as a text with the place in our source.
pub(crate) fn catch<T>(f: impl FnOnce() -> T) -> Result<T, String> {
    HOOK.call_once(|| {
        let previous = take_hook();
        set_hook(Box::new(move |info| {
            if is_ours() {
                let text = describe(info);
                REPORT.with(|r| r.replace(Some(text)));
            } else {
                previous(info);
            }
        }));
    });
    DEPTH.set(DEPTH.get() + 1);
    // What `f` may leave half-changed is behind the handle's lock, which the unwinding poisons.
    let outcome = catch_unwind(AssertUnwindSafe(f));
    DEPTH.set(DEPTH.get() - 1);
    outcome.map_err(|payload| {
        // A panic on a thread of the pool is rethrown here without a second visit to the hook:
        // then the payload is all that there is.
        let report = REPORT.take();
        report.unwrap_or_else(|| message(payload.as_ref()).to_owned())
    })
}

/// A guarded call, or a worker of one: those have no depth of their own, but a name.
fn is_ours() -> bool {
    DEPTH.get() > 0
        || std::thread::current()
            .name()
            .is_some_and(|name| name.starts_with(THREAD_NAME_PREFIX))
}

fn describe(info: &PanicHookInfo<'_>) -> String {
    let text = message(info.payload());
    match info.location() {
        Some(place) => format!("{text} ({}:{})", place.file(), place.line()),
        None => text.to_owned(),
    }
}

fn message(payload: &(dyn Any + Send)) -> &str {
    payload
        .downcast_ref::<&str>()
        .copied()
        .or_else(|| payload.downcast_ref::<String>().map(String::as_str))
        .unwrap_or("panic without a message")
}
