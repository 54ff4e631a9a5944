//! Inputs and time.

use super::args::{array, buffer, check, put};
use super::handle::{Session, with};
use super::query::{patch_at, quantity_at};
use super::types::{urlsph_log_level, urlsph_simulation, urlsph_status};
use crate::boundary::Quantity;
use crate::error::{Error, Result};
use crate::simulation::Control;

/// Sets the traction on a patch, per unit initial area, whose condition the scene declares as
/// `external`. It holds from now on, until it is set again.
///
/// - `values`: [Pa], 3 numbers for the whole patch, or `3 x particles` in the order of
///   `urlsph_read_patch_particles`, row-major.
/// - `count`: number of `values`.
///
/// Errors: `URLSPH_INVALID_ARGUMENT` if the patch has no such input, for another count, and for a
/// value that is not finite; nothing is changed then. `URLSPH_BUSY`, `URLSPH_INTERNAL`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn urlsph_set_traction(
    simulation: *mut urlsph_simulation,
    patch: usize,
    values: *const f64,
    count: usize,
) -> urlsph_status {
    // SAFETY: the caller's pointer, as the header's preamble demands.
    unsafe { set(simulation, patch, Quantity::Traction, values, count) }
}

/// Sets the follower pressure on a patch, per unit current area and positive in compression, whose
/// condition the scene declares as `external`. It holds from now on, until it is set again.
///
/// - `values`: [Pa], 1 number for the whole patch, or one per particle in the order of
///   `urlsph_read_patch_particles`.
/// - `count`: number of `values`.
///
/// Errors: as for `urlsph_set_traction`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn urlsph_set_pressure(
    simulation: *mut urlsph_simulation,
    patch: usize,
    values: *const f64,
    count: usize,
) -> urlsph_status {
    // SAFETY: the caller's pointer, as the header's preamble demands.
    unsafe { set(simulation, patch, Quantity::Pressure, values, count) }
}

/// Sets the velocity of a patch, whose condition the scene declares as `external`. It holds from
/// now on, until it is set again.
///
/// - `values`: [m/s], 3 numbers for the whole patch, or `3 x particles` in the order of
///   `urlsph_read_patch_particles`, row-major.
/// - `count`: number of `values`.
///
/// Errors: as for `urlsph_set_traction`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn urlsph_set_velocity(
    simulation: *mut urlsph_simulation,
    patch: usize,
    values: *const f64,
    count: usize,
) -> urlsph_status {
    // SAFETY: the caller's pointer, as the header's preamble demands.
    unsafe { set(simulation, patch, Quantity::Velocity, values, count) }
}

unsafe fn set(
    simulation: *mut urlsph_simulation,
    patch: usize,
    quantity: Quantity,
    values: *const f64,
    count: usize,
) -> urlsph_status {
    with(simulation, |session| {
        // SAFETY: the caller's pointer, as the header's preamble demands.
        let values = unsafe { array(values, count, "values")? };
        patch_at(session.simulation()?, patch)?;
        session.simulation_mut()?.set_input(patch, quantity, values)
    })
}

/// Copies the present values of an input, as last set or as the scene starts them.
///
/// - `patch`: index of the patch.
/// - `quantity`: a `urlsph_quantity`.
/// - `values`: receives them, in one of the two shapes in which they can be set.
/// - `capacity`: room in `values`, in numbers; `components x particles` always suffices.
/// - `count`: receives how many there are.
///
/// Errors: `URLSPH_INVALID_ARGUMENT` if the patch has no such input or the room does not suffice;
/// `URLSPH_BUSY`, `URLSPH_INTERNAL`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn urlsph_read_input(
    simulation: *const urlsph_simulation,
    patch: usize,
    quantity: i32,
    values: *mut f64,
    capacity: usize,
    count: *mut usize,
) -> urlsph_status {
    with(simulation, |session| {
        let simulation = session.simulation()?;
        patch_at(simulation, patch)?;
        let present = simulation.input(patch, quantity_at(quantity)?)?;
        // Both outputs or none.
        check(count, "count")?;
        // SAFETY: the caller's pointers, as the header's preamble demands.
        unsafe {
            buffer(values, capacity, present.len(), "values")?.copy_from_slice(present);
            put(count, present.len(), "count")
        }
    })
}

/// Advances by `dt` [s], in as many stable steps as needed, and ends exactly at time + dt.
///
/// Errors: `URLSPH_INVALID_ARGUMENT` unless `dt` is finite, positive, and large enough to change the
/// time. `URLSPH_DIVERGED` with particle, position, field and time, and `URLSPH_CANCELLED`: the
/// state is that of the last good step and can be read, and it can be continued after a
/// cancellation. `URLSPH_BUSY`, `URLSPH_INTERNAL`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn urlsph_step(simulation: *mut urlsph_simulation, dt: f64) -> urlsph_status {
    with(simulation, |session| {
        let time = session.simulation()?.time();
        if !(dt.is_finite() && dt > 0.0) {
            return Err(
                Error::argument(format!("dt is {dt} s; it must be finite and positive"))
                    .at_time(time),
            );
        }
        let end = time + dt;
        if end <= time {
            return Err(Error::argument(format!(
                "dt is {dt:e} s, too small to change the time in double precision"
            ))
            .at_time(time));
        }
        advance(session, end)
    })
}

/// Advances to the time `time` [s], in as many stable steps as needed, and ends exactly there.
///
/// Errors: as for `urlsph_step`; `time` must be finite and later than now.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn urlsph_advance_to(
    simulation: *mut urlsph_simulation,
    time: f64,
) -> urlsph_status {
    with(simulation, |session| advance(session, time))
}

fn advance(session: &mut Session, end: f64) -> Result<()> {
    let callbacks = session.callbacks;
    let simulation = session.simulation_mut()?;
    let before = simulation.steps();
    if callbacks.observes() {
        simulation.advance_with(end, &mut |p| callbacks.observe(p))?;
    } else {
        simulation.advance_with(end, &mut |_| Control::Continue)?;
    }
    let made = simulation.steps() - before;
    callbacks.log(urlsph_log_level::URLSPH_LOG_INFO, || {
        format!("advanced to {end:.6e} s in {made} steps")
    });
    Ok(())
}
