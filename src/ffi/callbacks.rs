//! The host's callbacks.

use std::ffi::{CString, c_void};
use std::ptr;

use super::types::{
    urlsph_callbacks, urlsph_cancel_callback, urlsph_log_callback, urlsph_log_level,
    urlsph_progress, urlsph_progress_callback,
};
use crate::simulation::{Control, Progress};

/// Callbacks of one handle.
#[derive(Clone, Copy)]
pub(super) struct Callbacks {
    user_data: *mut c_void,
    log: urlsph_log_callback,
    progress: urlsph_progress_callback,
    cancel: urlsph_cancel_callback,
}

// SAFETY: `user_data` is never dereferenced here, only handed to callbacks on the thread that makes
// the call; the header obliges the host to give callbacks that work on every thread it calls from.
unsafe impl Send for Callbacks {}

impl Default for Callbacks {
    fn default() -> Self {
        Self {
            user_data: ptr::null_mut(),
            log: None,
            progress: None,
            cancel: None,
        }
    }
}

impl From<urlsph_callbacks> for Callbacks {
    fn from(c: urlsph_callbacks) -> Self {
        Self {
            user_data: c.user_data,
            log: c.log,
            progress: c.progress,
            cancel: c.cancel,
        }
    }
}

impl Callbacks {
    /// Sends a message, which is only made if someone listens.
    pub(super) fn log(&self, level: urlsph_log_level, message: impl FnOnce() -> String) {
        let Some(log) = self.log else { return };
        let message = c_text(&message());
        // SAFETY: the host's function with the host's data, as the header describes; `message` is
        // a C string that outlives the call.
        unsafe { log(level, message.as_ptr(), self.user_data) }
    }

    /// Whether someone wants to hear of each time step.
    pub(super) fn observes(&self) -> bool {
        self.progress.is_some() || self.cancel.is_some()
    }

    /// Reports a time step and asks whether to go on.
    pub(super) fn observe(&self, p: &Progress) -> Control {
        if let Some(progress) = self.progress {
            let p = urlsph_progress {
                time: p.time,
                end: p.end,
                dt: p.dt,
                steps: p.steps,
            };
            // SAFETY: the host's function with the host's data, as the header describes; `p`
            // outlives the call.
            unsafe { progress(&p, self.user_data) }
        }
        match self.cancel {
            // SAFETY: as above.
            Some(cancel) if unsafe { cancel(self.user_data) } != 0 => Control::Cancel,
            _ => Control::Continue,
        }
    }
}

/// A text as a C string; a NUL inside, which only a hostile scene can bring, is left out.
fn c_text(text: &str) -> CString {
    let bytes: Vec<u8> = text.bytes().filter(|&b| b != 0).collect();
    CString::new(bytes).unwrap_or_default()
}
