//! Keys of thread-local storage, given back when the library is unloaded.
//!
//! The standard library makes a key in each copy of itself that starts a thread, and keeps it. A process has 1,024; one
//! that loads and unloads the library as often, as a co-simulation does with FMUs, would be aborted. So the shared
//! library's calls of `pthread_key_create` come through here (`--wrap`, see `build.rs`).

use std::ffi::{c_int, c_uint, c_void};
use std::sync::atomic::{AtomicU64, Ordering};

type Destructor = unsafe extern "C" fn(*mut c_void);
type Create = unsafe extern "C" fn(*mut c_uint, Option<Destructor>) -> c_int;

/// The keys of this copy of the library: bit k % 64 of word k / 64 is the key k.
static KEYS: [AtomicU64; MOST / 64] = [const { AtomicU64::new(0) }; MOST / 64];
/// Keys of a process in the GNU C library.
const MOST: usize = 1024;

#[cfg(target_arch = "x86_64")]
macro_rules! jump {
    () => {
        "jmp {create}"
    };
}
#[cfg(target_arch = "aarch64")]
macro_rules! jump {
    () => {
        "b {create}"
    };
}

// What the linker puts in place of `pthread_key_create`: hidden, which no symbol of Rust's is that a linker can find by
// its name.
std::arch::global_asm!(
    ".hidden __wrap_pthread_key_create",
    ".globl __wrap_pthread_key_create",
    "__wrap_pthread_key_create:",
    jump!(),
    create = sym create,
);

/// As `pthread_key_create`.
unsafe extern "C" fn create(key: *mut c_uint, destructor: Option<Destructor>) -> c_int {
    // SAFETY: a name that ends in NUL. By name, because a reference would come back here.
    let found = unsafe { libc::dlsym(libc::RTLD_DEFAULT, c"pthread_key_create".as_ptr()) };
    if found.is_null() {
        return libc::ENOSYS;
    }
    // SAFETY: the C library's function of that name, with the caller's arguments.
    let status = unsafe {
        let create = std::mem::transmute::<*mut c_void, Create>(found);
        create(key, destructor)
    };
    if status == 0 {
        // SAFETY: written by the call that has just gone well.
        let key = unsafe { *key } as usize;
        if let Some(word) = KEYS.get(key / 64) {
            word.fetch_or(1 << (key % 64), Ordering::Relaxed);
        }
    }
    status
}

/// Runs when the library is unloaded, or the process ends: all simulations are gone then, and with them all threads
/// that have values under the keys. What threads of the host may have left there is not destroyed with code that is
/// no longer there.
extern "C" fn delete_all() {
    for (w, word) in KEYS.iter().enumerate() {
        let keys = word.swap(0, Ordering::Relaxed);
        for bit in (0..64).filter(|bit| keys >> bit & 1 == 1) {
            // SAFETY: a key of this copy of the library.
            unsafe { libc::pthread_key_delete((64 * w + bit) as libc::pthread_key_t) };
        }
    }
}

#[used]
#[unsafe(link_section = ".fini_array")]
static AT_UNLOADING: extern "C" fn() = delete_all;
