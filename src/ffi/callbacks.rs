//! The host's callbacks.

use std::ffi::{CStr, CString, c_void};
use std::ptr;

use super::types::{
    urlsph_callbacks, urlsph_cancel_callback, urlsph_error, urlsph_log_callback, urlsph_log_event,
    urlsph_log_level, urlsph_log_record, urlsph_progress, urlsph_progress_callback,
};
use crate::error::Error;
use crate::simulation::{Control, Progress, Simulation};

type LogFunction = unsafe extern "C" fn(*const urlsph_log_record, *mut c_void);

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
    /// Tells what was done, in a text that is only made if someone listens.
    pub(super) fn inform(
        &self,
        event: urlsph_log_event,
        simulation: &Simulation,
        message: impl FnOnce() -> String,
    ) {
        if let Some(log) = self.log {
            let level = urlsph_log_level::URLSPH_LOG_INFO;
            let message = c_text(&message());
            self.send(log, simulation, (level, event), &message, ptr::null());
        }
    }

    /// Tells of a call that failed.
    pub(super) fn complain(&self, error: &Error, simulation: &Simulation) {
        if let Some(log) = self.log {
            let level = urlsph_log_level::URLSPH_LOG_ERROR;
            let event = urlsph_log_event::URLSPH_EVENT_FAILED;
            let message = c_text(&error.to_string());
            let error = urlsph_error::from(error);
            self.send(log, simulation, (level, event), &message, &error);
        }
    }

    fn send(
        &self,
        log: LogFunction,
        simulation: &Simulation,
        (level, event): (urlsph_log_level, urlsph_log_event),
        message: &CStr,
        error: *const urlsph_error,
    ) {
        let record = urlsph_log_record {
            level,
            event,
            message: message.as_ptr(),
            error,
            time: simulation.time(),
            steps: simulation.steps(),
        };
        // SAFETY: the host's function with the host's data, as the header describes; the record and
        // what it points to outlive the call.
        unsafe { log(&record, self.user_data) }
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
                start: p.start,
                reference_updates: p.reference_updates,
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
