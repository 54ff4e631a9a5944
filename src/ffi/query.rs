//! What there is, and what it is like now.

use std::ffi::c_char;

use super::args::{buffer, put, put_struct, text};
use super::handle::with;
use super::types::{
    urlsph_configuration, urlsph_contact_info, urlsph_contact_resultant, urlsph_counts,
    urlsph_energies, urlsph_field_info, urlsph_heat_resultant, urlsph_input_info, urlsph_momenta,
    urlsph_patch_info, urlsph_probe_info, urlsph_probe_motion, urlsph_quantity, urlsph_resultant,
    urlsph_simulation, urlsph_status, urlsph_view,
};
use crate::boundary::{Patch, Quantity};
use crate::error::{Error, Result};
use crate::fields::{Configuration, FIELDS, FieldInfo};
use crate::simulation::Simulation;

// Indices and names.

fn at<'a, T>(items: &'a [T], index: usize, what: &str) -> Result<&'a T> {
    items.get(index).ok_or_else(|| {
        Error::argument(format!(
            "there is no {what} {index}: there are {}, counted from 0",
            items.len()
        ))
    })
}

fn find<'a>(
    mut names: impl Iterator<Item = &'a str> + Clone,
    name: &str,
    what: &str,
) -> Result<usize> {
    let all = names.clone();
    names.position(|n| n == name).ok_or_else(|| {
        let all: Vec<&str> = all.collect();
        Error::argument(format!(
            "there is no {what} `{name}`; there are: {}",
            if all.is_empty() {
                "none".to_owned()
            } else {
                all.join(", ")
            }
        ))
    })
}

pub(super) fn patch_at(simulation: &Simulation, patch: usize) -> Result<&Patch> {
    at(simulation.patches(), patch, "patch")
}

fn field_at(field: usize) -> Result<&'static FieldInfo> {
    at(FIELDS, field, "field")
}

pub(super) fn quantity_at(quantity: i32) -> Result<Quantity> {
    Quantity::ALL
        .into_iter()
        .find(|&q| urlsph_quantity::from(q) as i32 == quantity)
        .ok_or_else(|| {
            Error::argument(format!(
                "{quantity} is not a quantity: give one of urlsph_quantity, such as URLSPH_TRACTION"
            ))
        })
}

impl From<Quantity> for urlsph_quantity {
    fn from(quantity: Quantity) -> Self {
        match quantity {
            Quantity::Traction => Self::URLSPH_TRACTION,
            Quantity::Pressure => Self::URLSPH_PRESSURE,
            Quantity::Velocity => Self::URLSPH_VELOCITY,
            Quantity::HeatFlux => Self::URLSPH_HEAT_FLUX,
            Quantity::Temperature => Self::URLSPH_TEMPERATURE,
            Quantity::ConvectionCoefficient => Self::URLSPH_CONVECTION_COEFFICIENT,
            Quantity::AmbientTemperature => Self::URLSPH_AMBIENT_TEMPERATURE,
        }
    }
}

impl From<Configuration> for urlsph_configuration {
    fn from(configuration: Configuration) -> Self {
        match configuration {
            Configuration::Initial => Self::URLSPH_CONFIGURATION_INITIAL,
            Configuration::Current => Self::URLSPH_CONFIGURATION_CURRENT,
            Configuration::TwoPoint => Self::URLSPH_CONFIGURATION_TWO_POINT,
        }
    }
}

// The simulation as a whole.

/// Title of the scene; may be empty.
///
/// - `title`: receives the text, valid until the simulation is destroyed.
///
/// Errors: `URLSPH_INVALID_ARGUMENT`, `URLSPH_BUSY`, `URLSPH_INTERNAL`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn urlsph_get_title(
    simulation: *const urlsph_simulation,
    title: *mut *const c_char,
) -> urlsph_status {
    with(simulation, |session| {
        // SAFETY: the caller's pointer, as the header's preamble demands.
        unsafe { put(title, session.names.title.as_ptr(), "title") }
    })
}

/// Numbers of particles, pairs, patches, fields, probes, inputs, threads, steps and planes of contact.
///
/// - `counts`, `counts_size`: receives them; the size of the struct.
///
/// Errors: `URLSPH_INVALID_ARGUMENT`, `URLSPH_BUSY`, `URLSPH_INTERNAL`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn urlsph_get_counts(
    simulation: *const urlsph_simulation,
    counts: *mut urlsph_counts,
    counts_size: usize,
) -> urlsph_status {
    with(simulation, |session| {
        let simulation = session.simulation()?;
        let value = urlsph_counts {
            particles: simulation.particle_count(),
            pairs: simulation.pair_count(),
            patches: simulation.patches().len(),
            fields: FIELDS.len(),
            probes: simulation.probe_names().len(),
            inputs: simulation.inputs().len(),
            threads: simulation.threads(),
            steps: simulation.steps(),
            contacts: session.names.contacts.len(),
        };
        // SAFETY: the caller's pointer, as the header's preamble demands.
        unsafe { put_struct(counts, counts_size, &value, "counts") }
    })
}

/// Simulated time [s].
///
/// Errors: `URLSPH_INVALID_ARGUMENT`, `URLSPH_BUSY`, `URLSPH_INTERNAL`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn urlsph_get_time(
    simulation: *const urlsph_simulation,
    time: *mut f64,
) -> urlsph_status {
    with(simulation, |session| {
        // SAFETY: the caller's pointer, as the header's preamble demands.
        unsafe { put(time, session.simulation()?.time(), "time") }
    })
}

/// End of the run that the scene describes, `time.end` [s]. Nothing forbids going further.
///
/// Errors: `URLSPH_INVALID_ARGUMENT`, `URLSPH_BUSY`, `URLSPH_INTERNAL`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn urlsph_get_end_time(
    simulation: *const urlsph_simulation,
    time: *mut f64,
) -> urlsph_status {
    with(simulation, |session| {
        // SAFETY: the caller's pointer, as the header's preamble demands.
        unsafe { put(time, session.simulation()?.scene().time.end, "time") }
    })
}

/// Largest stable time step from the present state [s], by the CFL condition or as the scene fixes
/// it. `urlsph_step` and `urlsph_advance_to` keep it by themselves.
///
/// Errors: `URLSPH_INVALID_ARGUMENT`, `URLSPH_BUSY`, `URLSPH_INTERNAL`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn urlsph_get_stable_step(
    simulation: *const urlsph_simulation,
    dt: *mut f64,
) -> urlsph_status {
    with(simulation, |session| {
        // SAFETY: the caller's pointer, as the header's preamble demands.
        unsafe { put(dt, session.simulation()?.stable_step(), "dt") }
    })
}

/// Energies now.
///
/// - `energies`, `energies_size`: receives them; the size of the struct.
///
/// Errors: `URLSPH_INVALID_ARGUMENT`, `URLSPH_BUSY`, `URLSPH_INTERNAL`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn urlsph_get_energies(
    simulation: *const urlsph_simulation,
    energies: *mut urlsph_energies,
    energies_size: usize,
) -> urlsph_status {
    with(simulation, |session| {
        let e = session.simulation()?.energies();
        let value = urlsph_energies {
            kinetic: e.kinetic,
            strain: e.strain,
            external_work: e.external_work,
            numerical_dissipation: e.numerical_dissipation,
            projection: e.projection,
            closure_error: e.closure_error,
            thermal: e.thermal,
            heat_in: e.heat_in,
            plastic_work: e.plastic_work,
            ballistic: e.ballistic,
            entropy: e.entropy,
            entropy_production: e.entropy_production,
            contact_dissipation: e.contact_dissipation,
        };
        // SAFETY: the caller's pointer, as the header's preamble demands.
        unsafe { put_struct(energies, energies_size, &value, "energies") }
    })
}

/// Linear and angular momentum now.
///
/// - `momenta`, `momenta_size`: receives them; the size of the struct.
///
/// Errors: `URLSPH_INVALID_ARGUMENT`, `URLSPH_BUSY`, `URLSPH_INTERNAL`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn urlsph_get_momenta(
    simulation: *const urlsph_simulation,
    momenta: *mut urlsph_momenta,
    momenta_size: usize,
) -> urlsph_status {
    with(simulation, |session| {
        let m = session.simulation()?.momenta();
        let value = urlsph_momenta {
            linear: m.linear,
            angular: m.angular,
        };
        // SAFETY: the caller's pointer, as the header's preamble demands.
        unsafe { put_struct(momenta, momenta_size, &value, "momenta") }
    })
}

// Patches.

/// Index of the patch of this name.
///
/// - `name`: NUL-terminated UTF-8.
/// - `patch`: receives the index, 0-based.
///
/// Errors: `URLSPH_INVALID_ARGUMENT` with the names that there are; `URLSPH_BUSY`, `URLSPH_INTERNAL`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn urlsph_find_patch(
    simulation: *const urlsph_simulation,
    name: *const c_char,
    patch: *mut usize,
) -> urlsph_status {
    with(simulation, |session| {
        // SAFETY: the caller's pointers, as the header's preamble demands.
        unsafe {
            let index = session.simulation()?.patch_index(text(name, "name")?)?;
            put(patch, index, "patch")
        }
    })
}

/// Name, number of particles and area of a patch.
///
/// - `patch`: index, less than `urlsph_counts.patches`.
/// - `info`, `info_size`: receives them; the size of the struct.
///
/// Errors: `URLSPH_INVALID_ARGUMENT`, `URLSPH_BUSY`, `URLSPH_INTERNAL`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn urlsph_get_patch_info(
    simulation: *const urlsph_simulation,
    patch: usize,
    info: *mut urlsph_patch_info,
    info_size: usize,
) -> urlsph_status {
    with(simulation, |session| {
        let p = patch_at(session.simulation()?, patch)?;
        let value = urlsph_patch_info {
            name: session.names.patches[patch].as_ptr(),
            particles: p.particles.len(),
            area: p.areas.iter().sum(),
        };
        // SAFETY: the caller's pointer, as the header's preamble demands.
        unsafe { put_struct(info, info_size, &value, "info") }
    })
}

/// Copies the particles of a patch, ascending.
///
/// - `patch`: index of the patch.
/// - `particles`: receives their numbers, 0-based in the caller's order.
/// - `capacity`: room in `particles`, at least `urlsph_patch_info.particles`.
///
/// Errors: `URLSPH_INVALID_ARGUMENT`, `URLSPH_BUSY`, `URLSPH_INTERNAL`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn urlsph_read_patch_particles(
    simulation: *const urlsph_simulation,
    patch: usize,
    particles: *mut usize,
    capacity: usize,
) -> urlsph_status {
    with(simulation, |session| {
        let from = &patch_at(session.simulation()?, patch)?.particles;
        // SAFETY: the caller's pointer, as the header's preamble demands.
        unsafe { buffer(particles, capacity, from.len(), "particles")? }.copy_from_slice(from);
        Ok(())
    })
}

/// Copies the tributary areas of the particles of a patch, in the initial configuration [m^2].
///
/// - `patch`: index of the patch.
/// - `areas`: receives one number per particle of the patch.
/// - `capacity`: room in `areas`, at least `urlsph_patch_info.particles`.
///
/// Errors: `URLSPH_INVALID_ARGUMENT`, `URLSPH_BUSY`, `URLSPH_INTERNAL`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn urlsph_read_patch_areas(
    simulation: *const urlsph_simulation,
    patch: usize,
    areas: *mut f64,
    capacity: usize,
) -> urlsph_status {
    with(simulation, |session| {
        let from = &patch_at(session.simulation()?, patch)?.areas;
        // SAFETY: the caller's pointer, as the header's preamble demands.
        unsafe { buffer(areas, capacity, from.len(), "areas")? }.copy_from_slice(from);
        Ok(())
    })
}

/// Copies the unit outward normals at the particles of a patch, in the initial configuration.
///
/// - `patch`: index of the patch.
/// - `normals`: receives `particles x 3` numbers, row-major.
/// - `capacity`: room in `normals`, at least 3 times `urlsph_patch_info.particles`.
///
/// Errors: `URLSPH_INVALID_ARGUMENT`, `URLSPH_BUSY`, `URLSPH_INTERNAL`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn urlsph_read_patch_normals(
    simulation: *const urlsph_simulation,
    patch: usize,
    normals: *mut f64,
    capacity: usize,
) -> urlsph_status {
    with(simulation, |session| {
        let from = patch_at(session.simulation()?, patch)?
            .normals
            .as_flattened();
        // SAFETY: the caller's pointer, as the header's preamble demands.
        unsafe { buffer(normals, capacity, from.len(), "normals")? }.copy_from_slice(from);
        Ok(())
    })
}

/// Resultant force and moment, mean displacement and mean velocity of a patch now.
///
/// - `patch`: index of the patch.
/// - `resultant`, `resultant_size`: receives them; the size of the struct.
///
/// Errors: `URLSPH_INVALID_ARGUMENT`, `URLSPH_BUSY`, `URLSPH_INTERNAL`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn urlsph_get_resultant(
    simulation: *const urlsph_simulation,
    patch: usize,
    resultant: *mut urlsph_resultant,
    resultant_size: usize,
) -> urlsph_status {
    with(simulation, |session| {
        let simulation = session.simulation()?;
        patch_at(simulation, patch)?;
        let r = simulation.resultant(patch);
        let value = urlsph_resultant {
            force: r.force,
            moment: r.moment,
            mean_displacement: r.mean_displacement,
            mean_velocity: r.mean_velocity,
        };
        // SAFETY: the caller's pointer, as the header's preamble demands.
        unsafe { put_struct(resultant, resultant_size, &value, "resultant") }
    })
}

/// Heat flow through a patch, its mean and its maximum temperature now.
///
/// - `patch`: index of the patch.
/// - `resultant`, `resultant_size`: receives them; the size of the struct.
///
/// Errors: `URLSPH_INVALID_ARGUMENT`, also for a body without temperature, whose scene has no section
/// `heat`; `URLSPH_BUSY`, `URLSPH_INTERNAL`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn urlsph_get_heat_resultant(
    simulation: *const urlsph_simulation,
    patch: usize,
    resultant: *mut urlsph_heat_resultant,
    resultant_size: usize,
) -> urlsph_status {
    with(simulation, |session| {
        let simulation = session.simulation()?;
        let name = &patch_at(simulation, patch)?.name;
        let r = simulation.heat_resultant(patch).ok_or_else(|| {
            Error::argument(
                "no heat flows here: the body has no temperature; add a section `heat` to the scene",
            )
            .at_boundary(name)
        })?;
        let value = urlsph_heat_resultant {
            heat_flow: r.heat_flow,
            mean_temperature: r.mean_temperature,
            maximum_temperature: r.maximum_temperature,
        };
        // SAFETY: the caller's pointer, as the header's preamble demands.
        unsafe { put_struct(resultant, resultant_size, &value, "resultant") }
    })
}

// Planes of contact.

/// Index of the plane of contact of this name.
///
/// - `name`: NUL-terminated UTF-8, the key of the plane in the scene's section `contact`.
/// - `contact`: receives the index, 0-based.
///
/// Errors: `URLSPH_INVALID_ARGUMENT` with the names that there are; `URLSPH_BUSY`, `URLSPH_INTERNAL`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn urlsph_find_contact(
    simulation: *const urlsph_simulation,
    name: *const c_char,
    contact: *mut usize,
) -> urlsph_status {
    with(simulation, |session| {
        let names: Vec<&str> = session.simulation()?.contact_names().collect();
        // SAFETY: the caller's pointers, as the header's preamble demands.
        unsafe {
            let index = find(names.into_iter(), text(name, "name")?, "plane of contact")?;
            put(contact, index, "contact")
        }
    })
}

/// Name, point and normal of a plane of contact.
///
/// - `contact`: index, less than `urlsph_counts.contacts`.
/// - `info`, `info_size`: receives them; the size of the struct.
///
/// Errors: `URLSPH_INVALID_ARGUMENT`, `URLSPH_BUSY`, `URLSPH_INTERNAL`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn urlsph_get_contact_info(
    simulation: *const urlsph_simulation,
    contact: usize,
    info: *mut urlsph_contact_info,
    info_size: usize,
) -> urlsph_status {
    with(simulation, |session| {
        let name = at(&session.names.contacts, contact, "plane of contact")?;
        let (point, normal) = session.simulation()?.contact_plane(contact);
        let value = urlsph_contact_info {
            name: name.as_ptr(),
            point,
            normal,
        };
        // SAFETY: the caller's pointer, as the header's preamble demands.
        unsafe { put_struct(info, info_size, &value, "info") }
    })
}

/// Force, impulse, displacement and touching particles of a plane of contact now.
///
/// - `contact`: index of the plane of contact.
/// - `resultant`, `resultant_size`: receives them; the size of the struct.
///
/// Errors: `URLSPH_INVALID_ARGUMENT`, `URLSPH_BUSY`, `URLSPH_INTERNAL`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn urlsph_get_contact_resultant(
    simulation: *const urlsph_simulation,
    contact: usize,
    resultant: *mut urlsph_contact_resultant,
    resultant_size: usize,
) -> urlsph_status {
    with(simulation, |session| {
        at(&session.names.contacts, contact, "plane of contact")?;
        let r = session.simulation()?.contact(contact);
        let value = urlsph_contact_resultant {
            force: r.force,
            impulse: r.impulse,
            displacement: r.displacement,
            particles: r.particles,
        };
        // SAFETY: the caller's pointer, as the header's preamble demands.
        unsafe { put_struct(resultant, resultant_size, &value, "resultant") }
    })
}

// Fields.

/// Index of the field of this name.
///
/// - `name`: NUL-terminated UTF-8, such as `cauchy_stress`.
/// - `field`: receives the index, 0-based.
///
/// Errors: `URLSPH_INVALID_ARGUMENT` with the names that there are; `URLSPH_BUSY`, `URLSPH_INTERNAL`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn urlsph_find_field(
    simulation: *const urlsph_simulation,
    name: *const c_char,
    field: *mut usize,
) -> urlsph_status {
    with(simulation, |_| {
        // SAFETY: the caller's pointers, as the header's preamble demands.
        unsafe {
            let index = find(FIELDS.iter().map(|f| f.name), text(name, "name")?, "field")?;
            put(field, index, "field")
        }
    })
}

/// Name, unit, shape and configuration of a field.
///
/// - `field`: index, less than `urlsph_counts.fields`.
/// - `info`, `info_size`: receives them; the size of the struct.
///
/// Errors: `URLSPH_INVALID_ARGUMENT`, `URLSPH_BUSY`, `URLSPH_INTERNAL`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn urlsph_get_field_info(
    simulation: *const urlsph_simulation,
    field: usize,
    info: *mut urlsph_field_info,
    info_size: usize,
) -> urlsph_status {
    with(simulation, |session| {
        let simulation = session.simulation()?;
        let f = field_at(field)?;
        let names = &session.names.fields[field];
        let value = urlsph_field_info {
            name: names.name.as_ptr(),
            unit: names.unit.as_ptr(),
            description: names.description.as_ptr(),
            components: f.components,
            configuration: f.configuration.into(),
            has_view: simulation.view(f.field).is_some().into(),
            is_present: simulation.has_field(f.field).is_ok().into(),
            reserved: 0,
        };
        // SAFETY: the caller's pointer, as the header's preamble demands.
        unsafe { put_struct(info, info_size, &value, "info") }
    })
}

/// Copies a field.
///
/// - `field`: index of the field.
/// - `values`: receives `particles x components` numbers, row-major, in the unit and configuration
///   of the field, particles in the caller's order.
/// - `capacity`: room in `values`, in numbers; it may be larger than needed.
///
/// Errors: `URLSPH_INVALID_ARGUMENT`, also for a field that this simulation does not have (see
/// `urlsph_field_info.is_present`), with what the scene would need; `URLSPH_BUSY`, `URLSPH_INTERNAL`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn urlsph_read_field(
    simulation: *const urlsph_simulation,
    field: usize,
    values: *mut f64,
    capacity: usize,
) -> urlsph_status {
    with(simulation, |session| {
        let simulation = session.simulation()?;
        let f = field_at(field)?;
        simulation.has_field(f.field)?;
        let needed = simulation.particle_count() * f.components;
        // SAFETY: the caller's pointer, as the header's preamble demands.
        let out = unsafe { buffer(values, capacity, needed, "values")? };
        simulation.read_field(f.field, out)
    })
}

/// Looks at the memory of a field without a copy.
///
/// Every call that changes the state (`urlsph_step`, `urlsph_advance_to`, `urlsph_set_*` of an
/// input, `urlsph_restore_snapshot`) makes the view stale, also while it runs on another thread;
/// `urlsph_destroy` frees the memory.
///
/// - `field`: index of a field with `urlsph_field_info.has_view`.
/// - `view`, `view_size`: receives pointers, strides and generation; the size of the struct.
///
/// Errors: `URLSPH_INVALID_ARGUMENT`, also for a field that is computed on demand: read it with
/// `urlsph_read_field`. `URLSPH_BUSY`, `URLSPH_INTERNAL`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn urlsph_get_view(
    simulation: *const urlsph_simulation,
    field: usize,
    view: *mut urlsph_view,
    view_size: usize,
) -> urlsph_status {
    with(simulation, |session| {
        let simulation = session.simulation()?;
        let f = field_at(field)?;
        let v = simulation.view(f.field).ok_or_else(|| {
            Error::argument("it is computed on demand and has no memory to look at: copy it with urlsph_read_field")
                .at_field(f.name)
        })?;
        let value = urlsph_view {
            data: v.data.as_ptr(),
            order: v.order.as_ptr(),
            component_stride: v.component_stride,
            components: v.components,
            particles: v.particles,
            generation: simulation.generation(),
        };
        // SAFETY: the caller's pointer, as the header's preamble demands.
        unsafe { put_struct(view, view_size, &value, "view") }
    })
}

/// Generation of the state: it changes whenever the state does. A view is stale once its generation
/// is not this one.
///
/// Errors: `URLSPH_INVALID_ARGUMENT`, `URLSPH_BUSY`, `URLSPH_INTERNAL`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn urlsph_get_generation(
    simulation: *const urlsph_simulation,
    generation: *mut u64,
) -> urlsph_status {
    with(simulation, |session| {
        // SAFETY: the caller's pointer, as the header's preamble demands.
        unsafe { put(generation, session.simulation()?.generation(), "generation") }
    })
}

// Probes.

/// Index of the probe of this name.
///
/// - `name`: NUL-terminated UTF-8.
/// - `probe`: receives the index, 0-based.
///
/// Errors: `URLSPH_INVALID_ARGUMENT` with the names that there are; `URLSPH_BUSY`, `URLSPH_INTERNAL`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn urlsph_find_probe(
    simulation: *const urlsph_simulation,
    name: *const c_char,
    probe: *mut usize,
) -> urlsph_status {
    with(simulation, |session| {
        let names = session.simulation()?.probe_names();
        // SAFETY: the caller's pointers, as the header's preamble demands.
        unsafe {
            let index = find(
                names.iter().map(String::as_str),
                text(name, "name")?,
                "probe",
            )?;
            put(probe, index, "probe")
        }
    })
}

/// Name and initial position of a probe.
///
/// - `probe`: index, less than `urlsph_counts.probes`.
/// - `info`, `info_size`: receives them; the size of the struct.
///
/// Errors: `URLSPH_INVALID_ARGUMENT`, `URLSPH_BUSY`, `URLSPH_INTERNAL`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn urlsph_get_probe_info(
    simulation: *const urlsph_simulation,
    probe: usize,
    info: *mut urlsph_probe_info,
    info_size: usize,
) -> urlsph_status {
    with(simulation, |session| {
        let simulation = session.simulation()?;
        let name = at(simulation.probe_names(), probe, "probe")?;
        let value = urlsph_probe_info {
            name: session.names.probes[probe].as_ptr(),
            position: simulation.scene().probes[name],
        };
        // SAFETY: the caller's pointer, as the header's preamble demands.
        unsafe { put_struct(info, info_size, &value, "info") }
    })
}

/// Displacement, velocity and temperature of a probe now.
///
/// - `probe`: index of the probe.
/// - `motion`, `motion_size`: receives them; the size of the struct.
///
/// Errors: `URLSPH_INVALID_ARGUMENT`, `URLSPH_BUSY`, `URLSPH_INTERNAL`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn urlsph_get_probe_motion(
    simulation: *const urlsph_simulation,
    probe: usize,
    motion: *mut urlsph_probe_motion,
    motion_size: usize,
) -> urlsph_status {
    with(simulation, |session| {
        let simulation = session.simulation()?;
        at(simulation.probe_names(), probe, "probe")?;
        let m = simulation.probe(probe);
        let value = urlsph_probe_motion {
            displacement: m.displacement,
            velocity: m.velocity,
            temperature: m.temperature.unwrap_or(0.0),
        };
        // SAFETY: the caller's pointer, as the header's preamble demands.
        unsafe { put_struct(motion, motion_size, &value, "motion") }
    })
}

// Inputs.

/// Patch, quantity and shape of an input.
///
/// - `input`: index, less than `urlsph_counts.inputs`.
/// - `info`, `info_size`: receives them; the size of the struct.
///
/// Errors: `URLSPH_INVALID_ARGUMENT`, `URLSPH_BUSY`, `URLSPH_INTERNAL`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn urlsph_get_input_info(
    simulation: *const urlsph_simulation,
    input: usize,
    info: *mut urlsph_input_info,
    info_size: usize,
) -> urlsph_status {
    with(simulation, |session| {
        let simulation = session.simulation()?;
        let i = at(simulation.inputs(), input, "input")?;
        let value = urlsph_input_info {
            patch: i.patch,
            particles: patch_at(simulation, i.patch)?.particles.len(),
            components: i.quantity.components(),
            quantity: i.quantity.into(),
            per_particle: i.per_particle.into(),
        };
        // SAFETY: the caller's pointer, as the header's preamble demands.
        unsafe { put_struct(info, info_size, &value, "info") }
    })
}
