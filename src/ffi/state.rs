//! The complete state: snapshot, restore, hash.

use std::ffi::c_char;

use super::args::{array, buffer, check, put, text};
use super::handle::{Session, with};
use super::types::{urlsph_log_event, urlsph_simulation, urlsph_status};
use crate::error::Result;
use crate::snapshot::Snapshot;

/// Bytes that a snapshot of the present state takes.
///
/// Errors: `URLSPH_INVALID_ARGUMENT`, `URLSPH_OUT_OF_MEMORY`, `URLSPH_BUSY`, `URLSPH_INTERNAL`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn urlsph_get_snapshot_size(
    simulation: *const urlsph_simulation,
    size: *mut usize,
) -> urlsph_status {
    with(simulation, |session| {
        let needed = session.snapshot()?.len();
        // SAFETY: the caller's pointer, as the header's preamble demands.
        unsafe { put(size, needed, "size") }
    })
}

/// Copies the complete state: returning to it and stepping gives the same bits as never having left.
///
/// The bytes hold no pointers: they can be stored, and restored into another simulation of the same
/// scene, in another process too.
///
/// - `buffer`: receives the snapshot.
/// - `capacity`: bytes in `buffer`, at least what `urlsph_get_snapshot_size` gives.
/// - `size`: receives the size of the snapshot.
///
/// Errors: `URLSPH_INVALID_ARGUMENT`, `URLSPH_OUT_OF_MEMORY`, `URLSPH_BUSY`, `URLSPH_INTERNAL`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn urlsph_save_snapshot(
    simulation: *const urlsph_simulation,
    buffer: *mut u8,
    capacity: usize,
    size: *mut usize,
) -> urlsph_status {
    with(simulation, |session| {
        let bytes = session.snapshot()?;
        // Both outputs or none.
        check(size, "size")?;
        // SAFETY: the caller's pointers, as the header's preamble demands.
        unsafe {
            self::buffer(buffer, capacity, bytes.len(), "buffer")?.copy_from_slice(bytes);
            put(size, bytes.len(), "size")?;
        }
        session.forget_snapshot();
        Ok(())
    })
}

/// Returns to the state of a snapshot.
///
/// - `buffer`, `size`: what `urlsph_save_snapshot` wrote, of a simulation of the same scene.
///
/// Errors: `URLSPH_SNAPSHOT` if it is truncated, damaged, or of another scene or version;
/// `URLSPH_INVALID_ARGUMENT`; nothing is changed then. `URLSPH_BUSY`, `URLSPH_INTERNAL`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn urlsph_restore_snapshot(
    simulation: *mut urlsph_simulation,
    buffer: *const u8,
    size: usize,
) -> urlsph_status {
    with(simulation, |session| {
        // SAFETY: the caller's pointer, as the header's preamble demands.
        let bytes = unsafe { array(buffer, size, "buffer")? };
        restore(session, &Snapshot::from_bytes(bytes)?)
    })
}

fn restore(session: &mut Session, snapshot: &Snapshot) -> Result<()> {
    let callbacks = session.callbacks;
    let simulation = session.simulation_mut()?;
    simulation.restore(snapshot)?;
    let time = simulation.time();
    callbacks.inform(urlsph_log_event::URLSPH_EVENT_RESTORED, simulation, || {
        format!("returned to {time:.6e} s")
    });
    Ok(())
}

/// Writes the complete state to a file: what `urlsph_save_snapshot` copies, byte by byte.
///
/// The file gets its name only when all of it is on the disk: neither a full disk nor a killed
/// process leaves half a snapshot there, or takes away the one before.
///
/// - `path`: NUL-terminated UTF-8. Beside it a file of this name with `.part` at its end comes and
///   goes.
///
/// Errors: `URLSPH_IO` naming the file; the simulation is as it was, and can go on.
/// `URLSPH_INVALID_ARGUMENT`, `URLSPH_OUT_OF_MEMORY`, `URLSPH_BUSY`, `URLSPH_INTERNAL`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn urlsph_save_snapshot_to_file(
    simulation: *const urlsph_simulation,
    path: *const c_char,
) -> urlsph_status {
    with(simulation, |session| {
        // SAFETY: the caller's pointer, as the header's preamble demands.
        let path = unsafe { text(path, "path")? };
        session.simulation()?.snapshot().write(path)
    })
}

/// Returns to the state of a snapshot in a file.
///
/// - `path`: NUL-terminated UTF-8; what `urlsph_save_snapshot_to_file` wrote, or the bytes of
///   `urlsph_save_snapshot`, of a simulation of the same scene.
///
/// Errors: those of `urlsph_restore_snapshot`, and `URLSPH_IO` naming the file; nothing is changed
/// then.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn urlsph_restore_snapshot_from_file(
    simulation: *mut urlsph_simulation,
    path: *const c_char,
) -> urlsph_status {
    with(simulation, |session| {
        // SAFETY: the caller's pointer, as the header's preamble demands.
        let path = unsafe { text(path, "path")? };
        restore(session, &Snapshot::read(path)?)
    })
}

/// Hash of the complete state: equal states have equal hashes, whatever the number of threads.
///
/// Errors: `URLSPH_INVALID_ARGUMENT`, `URLSPH_BUSY`, `URLSPH_INTERNAL`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn urlsph_get_state_hash(
    simulation: *const urlsph_simulation,
    hash: *mut u64,
) -> urlsph_status {
    with(simulation, |session| {
        // SAFETY: the caller's pointer, as the header's preamble demands.
        unsafe { put(hash, session.simulation()?.state_hash(), "hash") }
    })
}
