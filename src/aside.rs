//! A thread to wait on in the caller's place.

use std::panic::resume_unwind;

/// Runs `work` on a thread of its own and waits for it; where no thread can be had, on the caller's.
///
/// The thread is made by the C library. The standard library's threads leave a value with a destructor on the thread
/// that starts them, which keeps a shared library in memory when its host unloads it, until that thread ends: for
/// good, where it is the host's main thread.
pub fn aside<W: FnOnce() -> R + Send, R: Send>(work: W) -> R {
    let mut task = Task {
        work: Some(work),
        result: None,
    };
    run(&mut task);
    match (task.result, task.work) {
        (Some(Ok(result)), _) => result,
        (Some(Err(panic)), _) => resume_unwind(panic),
        (None, Some(work)) => work(),
        (None, None) => unreachable!("work that was begun has a result"),
    }
}

struct Task<W, R> {
    work: Option<W>,
    result: Option<std::thread::Result<R>>,
}

impl<W: FnOnce() -> R, R> Task<W, R> {
    fn run(&mut self) {
        let work = self.work.take();
        self.result = work.map(|work| std::panic::catch_unwind(std::panic::AssertUnwindSafe(work)));
    }
}

/// Runs a task, or leaves it as it is.
#[cfg(unix)]
#[allow(unsafe_code)]
fn run<W: FnOnce() -> R + Send, R: Send>(task: &mut Task<W, R>) {
    use std::ffi::c_void;
    use std::mem::MaybeUninit;
    use std::ptr::{null, null_mut};

    extern "C" fn begin<W: FnOnce() -> R, R>(task: *mut c_void) -> *mut c_void {
        // SAFETY: `run` lends its task until this thread has ended.
        let task = unsafe { &mut *task.cast::<Task<W, R>>() };
        task.run();
        null_mut()
    }

    let mut thread = MaybeUninit::uninit();
    let task: *mut Task<W, R> = task;
    // SAFETY: the thread is joined before the task is used again; what it holds may go to another thread.
    unsafe {
        if libc::pthread_create(thread.as_mut_ptr(), null(), begin::<W, R>, task.cast()) == 0 {
            libc::pthread_join(thread.assume_init(), null_mut());
        }
    }
}

#[cfg(not(unix))]
fn run<W: FnOnce() -> R + Send, R: Send>(task: &mut Task<W, R>) {
    std::thread::scope(|scope| {
        // Where it does not start, the task stays as it is.
        let _ = std::thread::Builder::new().spawn_scoped(scope, || task.run());
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_and_panics_come_back() {
        let mut seen = 0;
        let here = std::thread::current().id();
        assert!(aside(|| std::thread::current().id()) != here);
        aside(|| seen = 3);
        assert_eq!(seen, 3);
        let caught = std::panic::catch_unwind(|| aside(|| panic!("aside")));
        let text = *caught
            .expect_err("a panic")
            .downcast::<&str>()
            .expect("its text");
        assert_eq!(text, "aside");
    }
}
