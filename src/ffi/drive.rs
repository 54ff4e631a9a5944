//! Inputs and time.

use super::args::{array, buffer, check, put};
use super::handle::{Session, with};
use super::query::{patch_at, quantity_at};
use super::types::{urlsph_log_event, urlsph_simulation, urlsph_status};
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

/// Sets the heat flux into the body through a patch, per unit initial area, whose condition the
/// scene declares as `external`. It holds from now on, until it is set again.
///
/// - `values`: [W/m^2], 1 number for the whole patch, or one per particle in the order of
///   `urlsph_read_patch_particles`.
/// - `count`: number of `values`.
///
/// Errors: as for `urlsph_set_traction`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn urlsph_set_heat_flux(
    simulation: *mut urlsph_simulation,
    patch: usize,
    values: *const f64,
    count: usize,
) -> urlsph_status {
    // SAFETY: the caller's pointer, as the header's preamble demands.
    unsafe { set(simulation, patch, Quantity::HeatFlux, values, count) }
}

/// Sets the absolute temperature of a patch, whose condition the scene declares as `external`. The
/// particles take it at the start of the next step, and hold it until it is set again.
///
/// - `values`: [K], above 0; 1 number for the whole patch, or one per particle in the order of
///   `urlsph_read_patch_particles`.
/// - `count`: number of `values`.
///
/// Errors: as for `urlsph_set_traction`, and for a temperature that is not above 0.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn urlsph_set_temperature(
    simulation: *mut urlsph_simulation,
    patch: usize,
    values: *const f64,
    count: usize,
) -> urlsph_status {
    // SAFETY: the caller's pointer, as the header's preamble demands.
    unsafe { set(simulation, patch, Quantity::Temperature, values, count) }
}

/// Sets the convection on a patch: heat flows in at coefficient x (ambient temperature - temperature)
/// per unit initial area. Each of the two can be set if the scene declares it as `external`. They
/// hold from now on, until they are set again.
///
/// - `coefficients`, `coefficient_count`: [W/(m^2 K)], 0 or more; NULL and 0 to leave them as they are.
/// - `ambient_temperatures`, `ambient_count`: [K], above 0; NULL and 0 to leave them as they are.
/// - Counts: 1 number for the whole patch, or one per particle in the order of
///   `urlsph_read_patch_particles`; the two need not be alike.
///
/// Errors: as for `urlsph_set_traction`, for a value out of its range, and if there is nothing to set.
/// Nothing is changed then.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn urlsph_set_convection(
    simulation: *mut urlsph_simulation,
    patch: usize,
    coefficients: *const f64,
    coefficient_count: usize,
    ambient_temperatures: *const f64,
    ambient_count: usize,
) -> urlsph_status {
    with(simulation, |session| {
        patch_at(session.simulation()?, patch)?;
        // SAFETY: the caller's pointers, as the header's preamble demands.
        let given = unsafe {
            [
                (
                    Quantity::ConvectionCoefficient,
                    optional(coefficients, coefficient_count, "coefficients")?,
                ),
                (
                    Quantity::AmbientTemperature,
                    optional(ambient_temperatures, ambient_count, "ambient_temperatures")?,
                ),
            ]
        };
        let values: Vec<(Quantity, &[f64])> = given
            .into_iter()
            .filter_map(|(quantity, values)| Some((quantity, values?)))
            .collect();
        if values.is_empty() {
            return Err(Error::argument(
                "there is nothing to set: give `coefficients`, `ambient_temperatures`, or both",
            ));
        }
        session.simulation_mut()?.set_inputs(patch, &values)
    })
}

/// An array that may be left out, as NULL and 0.
unsafe fn optional<'a>(values: *const f64, count: usize, name: &str) -> Result<Option<&'a [f64]>> {
    if values.is_null() && count == 0 {
        return Ok(None);
    }
    // SAFETY: the caller's pointer, as the header's preamble demands.
    unsafe { array(values, count, name) }.map(Some)
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
    callbacks.inform(urlsph_log_event::URLSPH_EVENT_ADVANCED, simulation, || {
        format!("advanced to {end:.6e} s in {made} steps")
    });
    Ok(())
}
