//! The quantities that a simulation reports, by name: the columns of a history and the outputs of an
//! FMU are the same list.
//!
//! Names follow FMI's structured convention: `probe.tip.displacement[1]`, `energy.kinetic`,
//! `boundary.top.force[2]`; elements count from 1.

use std::borrow::Cow;

use crate::boundary::{Input, Patch, Quantity};
use crate::error::{Error, Result};
use crate::fields::{Field, FieldInfo};
use crate::ledger::{Energies, HeatResultant, Momenta, Resultant};
use crate::simulation::{ProbeMotion, Simulation};

/// Fields that are written when the scene names none, with those of [`OPTIONAL_FIELDS`] that it has.
pub const DEFAULT_FIELDS: [Field; 5] = [
    Field::Displacement,
    Field::Velocity,
    Field::CauchyStress,
    Field::Pressure,
    Field::Jacobian,
];

/// Fields that are written as well, where the scene has them.
pub const OPTIONAL_FIELDS: [Field; 2] = [Field::Temperature, Field::EquivalentPlasticStrain];

/// One reported quantity: a number, a vector, or an array with one row per particle.
#[derive(Debug, Clone, PartialEq)]
pub struct OutputVariable {
    /// Structured name without index, such as `boundary.top.force`.
    pub name: String,
    /// SI unit, such as `N.m`; `1` if dimensionless.
    pub unit: &'static str,
    /// Number of components: 1, 3 or 9.
    pub components: usize,
    /// Number of rows of an array; `None` for a quantity of the whole patch, probe or body.
    pub particles: Option<usize>,
    /// One line for people.
    pub description: String,
    source: Source,
}

/// Where the numbers come from; indices are those of [`Simulation`].
#[derive(Debug, Clone, Copy, PartialEq)]
enum Source {
    ProbeDisplacement(usize),
    ProbeVelocity(usize),
    ProbeTemperature(usize),
    /// Index into [`ENERGIES`].
    Energy(usize),
    LinearMomentum,
    AngularMomentum,
    PatchForce(usize),
    PatchMoment(usize),
    PatchDisplacement(usize),
    PatchVelocity(usize),
    PatchHeatFlow(usize),
    PatchMeanTemperature(usize),
    PatchMaximumTemperature(usize),
    /// Whether it changes with an input at once.
    StableStep(bool),
    ContactForce(usize),
    ContactImpulse(usize),
    ContactParticles(usize),
    Steps,
    PatchInitialPositions(usize),
    PatchAreas(usize),
    PatchNormals(usize),
    PatchField(usize, Field),
    Field(Field),
}

impl OutputVariable {
    /// Number of values: rows times components.
    pub fn len(&self) -> usize {
        self.particles.unwrap_or(1) * self.components
    }
    /// Whether there are no values.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
    /// Whether the values count something.
    pub fn is_integer(&self) -> bool {
        matches!(self.source, Source::Steps | Source::ContactParticles(_))
    }
    /// Whether the values are settled by the geometry and never change.
    pub fn is_fixed(&self) -> bool {
        matches!(
            self.source,
            Source::PatchInitialPositions(_)
                | Source::PatchAreas(_)
                | Source::PatchNormals(_)
                | Source::Field(Field::InitialPosition | Field::InitialVolume)
        )
    }
    /// Whether the values change with an external input at once, without a step.
    pub fn depends_on_inputs(&self) -> bool {
        matches!(
            self.source,
            Source::PatchForce(_)
                | Source::PatchMoment(_)
                | Source::PatchHeatFlow(_)
                | Source::StableStep(true)
                | Source::ContactForce(_)
                | Source::Field(Field::NodalForce)
        )
    }
    /// Index of the patch that the quantity belongs to.
    pub fn patch(&self) -> Option<usize> {
        match self.source {
            Source::PatchForce(p)
            | Source::PatchMoment(p)
            | Source::PatchDisplacement(p)
            | Source::PatchVelocity(p)
            | Source::PatchHeatFlow(p)
            | Source::PatchMeanTemperature(p)
            | Source::PatchMaximumTemperature(p)
            | Source::PatchInitialPositions(p)
            | Source::PatchAreas(p)
            | Source::PatchNormals(p)
            | Source::PatchField(p, _) => Some(p),
            _ => None,
        }
    }
    /// Names of all values in order: `name`, `name[k]`, or `name[row,k]`.
    pub fn element_names(&self) -> impl Iterator<Item = String> + '_ {
        (0..self.len()).map(|i| element_name(&self.name, self.particles, self.components, i))
    }
}

/// Name of one value of a quantity; indices count from 1.
pub fn element_name(
    name: &str,
    particles: Option<usize>,
    components: usize,
    element: usize,
) -> String {
    match (particles, components) {
        (None, 1) => name.to_owned(),
        (None, _) | (Some(_), 1) => format!("{name}[{}]", element + 1),
        (Some(_), n) => format!("{name}[{},{}]", element / n + 1, element % n + 1),
    }
}

/// A name from the scene as a part of a structured name: quoted unless it consists of identifiers.
pub fn name_part(name: &str) -> Cow<'_, str> {
    let identifier = |s: &str| {
        s.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_')
            && s.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
    };
    if name.split('.').all(identifier) {
        Cow::Borrowed(name)
    } else {
        Cow::Owned(format!(
            "'{}'",
            name.replace('\\', "\\\\").replace('\'', "\\'")
        ))
    }
}

/// Fields that the scene's `output.fields` names, or [`DEFAULT_FIELDS`] and those of
/// [`OPTIONAL_FIELDS`] that it has.
///
/// # Errors
/// [`Code::InvalidScene`](crate::Code::InvalidScene) with the path of a name that is unknown, or of a
/// field that the scene lacks.
pub fn selected_fields(simulation: &Simulation) -> Result<Vec<Field>> {
    let present = |field: &Field| simulation.has_field(*field).is_ok();
    let Some(names) = &simulation.scene().output.fields else {
        let optional = OPTIONAL_FIELDS.into_iter().filter(present);
        return Ok(DEFAULT_FIELDS.into_iter().chain(optional).collect());
    };
    let mut fields = Vec::with_capacity(names.len());
    for (i, name) in names.iter().enumerate() {
        let path = || format!("output.fields[{i}]");
        let info = FieldInfo::by_name(name).ok_or_else(|| {
            let known: Vec<_> = (crate::FIELDS.iter())
                .filter(|f| present(&f.field))
                .map(|f| f.name)
                .collect();
            Error::scene(
                path(),
                format!("there is no field {name:?}; there are {}", known.join(", ")),
            )
        })?;
        simulation
            .has_field(info.field)
            .map_err(|e| Error::scene(path(), e.message()).at_field(info.name))?;
        if !fields.contains(&info.field) {
            fields.push(info.field);
        }
    }
    Ok(fields)
}

/// Indices of the patches that the scene's `boundary` and `patches` name, in the simulation's order.
pub fn reported_patches(simulation: &Simulation) -> Vec<usize> {
    let scene = simulation.scene();
    let named =
        |p: &Patch| scene.boundary.contains_key(&p.name) || scene.patches.contains_key(&p.name);
    (0..simulation.patches().len())
        .filter(|&p| named(&simulation.patches()[p]))
        .collect()
}

/// What a scene needs to have a quantity.
#[derive(Debug, Clone, Copy)]
enum Needs {
    Nothing,
    Heat,
    Plasticity,
    Contact,
}

/// A number of the ledger: what it needs, name, unit, description, value.
type LedgerRow = (
    Needs,
    &'static str,
    &'static str,
    &'static str,
    fn(&Energies) -> f64,
);

const ENERGIES: &[LedgerRow] = &[
    (
        Needs::Nothing,
        "energy.kinetic",
        "J",
        "Kinetic energy",
        |e| e.kinetic,
    ),
    (
        Needs::Nothing,
        "energy.strain",
        "J",
        "Strain energy; with heat the mechanical part of the internal energy",
        |e| e.strain,
    ),
    (
        Needs::Heat,
        "energy.thermal",
        "J",
        "Thermal part of the internal energy, from the reference temperature on",
        |e| e.thermal,
    ),
    (
        Needs::Nothing,
        "energy.external_work",
        "J",
        "Work of loads, body force and moving supports since time 0",
        |e| e.external_work,
    ),
    (
        Needs::Heat,
        "energy.heat_in",
        "J",
        "Heat from sources and through the boundary since time 0",
        |e| e.heat_in,
    ),
    (
        Needs::Plasticity,
        "energy.plastic_work",
        "J",
        "Plastic work since time 0",
        |e| e.plastic_work,
    ),
    (
        Needs::Nothing,
        "energy.numerical_dissipation",
        "J",
        "Energy dissipated by the scheme since time 0",
        |e| e.numerical_dissipation,
    ),
    (
        Needs::Contact,
        "energy.contact_dissipation",
        "J",
        "Kinetic energy lost in inelastic contact since time 0",
        |e| e.contact_dissipation,
    ),
    (
        Needs::Nothing,
        "energy.projection",
        "J",
        "Energy taken out by the angular-momentum projection since time 0",
        |e| e.projection,
    ),
    (
        Needs::Heat,
        "energy.ballistic",
        "J",
        "Ballistic energy: stored energy less reference temperature times entropy",
        |e| e.ballistic,
    ),
    (
        Needs::Nothing,
        "energy.closure_error",
        "J",
        "Error of the energy balance: stored and dissipated less supplied and initial energy",
        |e| e.closure_error,
    ),
    (
        Needs::Heat,
        "entropy.total",
        "J/K",
        "Entropy of the body",
        |e| e.entropy,
    ),
    (
        Needs::Heat,
        "entropy.production",
        "J/K",
        "Entropy produced by conduction and plastic flow since time 0",
        |e| e.entropy_production,
    ),
];

/// Quantities of probes, patches and the whole body, in the order of the columns of a history.
pub fn outputs(simulation: &Simulation) -> Vec<OutputVariable> {
    let has = |field| simulation.has_field(field).is_ok();
    let (heat, plasticity) = (has(Field::Temperature), has(Field::EquivalentPlasticStrain));
    let mut list = Vec::new();
    let mut add = |name: String, unit, components, description: String, source| {
        list.push(OutputVariable {
            name,
            unit,
            components,
            particles: None,
            description,
            source,
        });
    };
    for (i, name) in simulation.probe_names().iter().enumerate() {
        let part = name_part(name);
        add(
            format!("probe.{part}.displacement"),
            "m",
            3,
            format!("Displacement of probe {name}"),
            Source::ProbeDisplacement(i),
        );
        add(
            format!("probe.{part}.velocity"),
            "m/s",
            3,
            format!("Velocity of probe {name}"),
            Source::ProbeVelocity(i),
        );
        if heat {
            add(
                format!("probe.{part}.temperature"),
                "K",
                1,
                format!("Absolute temperature of probe {name}"),
                Source::ProbeTemperature(i),
            );
        }
    }
    for (row, &(needs, name, unit, text, _)) in ENERGIES.iter().enumerate() {
        let has = match needs {
            Needs::Nothing => true,
            Needs::Heat => heat,
            Needs::Plasticity => plasticity,
            Needs::Contact => simulation.contact_names().next().is_some(),
        };
        if has {
            add(
                name.to_owned(),
                unit,
                1,
                text.to_owned(),
                Source::Energy(row),
            );
        }
    }
    add(
        "momentum.linear".to_owned(),
        "kg.m/s",
        3,
        "Linear momentum".to_owned(),
        Source::LinearMomentum,
    );
    add(
        "momentum.angular".to_owned(),
        "kg.m^2/s",
        3,
        "Angular momentum about the origin".to_owned(),
        Source::AngularMomentum,
    );
    for p in reported_patches(simulation) {
        let name = &simulation.patches()[p].name;
        let part = name_part(name);
        let quantities = [
            (
                "force",
                "N",
                "Force of the surroundings on",
                Source::PatchForce(p),
            ),
            (
                "moment",
                "N.m",
                "Moment about the origin of that force on",
                Source::PatchMoment(p),
            ),
            (
                "displacement",
                "m",
                "Area-weighted mean displacement of",
                Source::PatchDisplacement(p),
            ),
            (
                "velocity",
                "m/s",
                "Area-weighted mean velocity of",
                Source::PatchVelocity(p),
            ),
        ];
        for (quantity, unit, text, source) in quantities {
            add(
                format!("boundary.{part}.{quantity}"),
                unit,
                3,
                format!("{text} patch {name}"),
                source,
            );
        }
        if !heat {
            continue;
        }
        let quantities = [
            (
                "heat_flow",
                "W",
                "Heat that flows into the body through",
                Source::PatchHeatFlow(p),
            ),
            (
                "mean_temperature",
                "K",
                "Area-weighted mean temperature of",
                Source::PatchMeanTemperature(p),
            ),
            (
                "maximum_temperature",
                "K",
                "Highest temperature of",
                Source::PatchMaximumTemperature(p),
            ),
        ];
        for (quantity, unit, text, source) in quantities {
            add(
                format!("boundary.{part}.{quantity}"),
                unit,
                1,
                format!("{text} patch {name}"),
                source,
            );
        }
    }
    for (wall, name) in simulation.contact_names().enumerate() {
        let part = name_part(name);
        let quantities = [
            (
                "force",
                "N",
                3,
                "Force on the body of",
                Source::ContactForce(wall),
            ),
            (
                "impulse",
                "N.s",
                3,
                "Impulse on the body since time 0 of",
                Source::ContactImpulse(wall),
            ),
            (
                "particles",
                "1",
                1,
                "Number of particles that touch",
                Source::ContactParticles(wall),
            ),
        ];
        for (quantity, unit, components, text, source) in quantities {
            add(
                format!("contact.{part}.{quantity}"),
                unit,
                components,
                format!("{text} plane {name}"),
                source,
            );
        }
    }
    let limits = |i: &Input| i.quantity == Quantity::ConvectionCoefficient;
    let answers = simulation.inputs().iter().any(limits);
    add(
        "stable_step".to_owned(),
        "s",
        1,
        "Largest stable time step from the present state".to_owned(),
        Source::StableStep(answers),
    );
    add(
        "steps".to_owned(),
        "1",
        1,
        "Time steps since time 0".to_owned(),
        Source::Steps,
    );
    list
}

/// Arrays with one row per particle: of the patches that the scene names (rows in the order of
/// [`Patch::particles`]), and the scene's output fields of all particles.
///
/// # Errors
/// As [`selected_fields`].
pub fn arrays(simulation: &Simulation) -> Result<Vec<OutputVariable>> {
    let mut list = Vec::new();
    for p in reported_patches(simulation) {
        let patch = &simulation.patches()[p];
        let part = name_part(&patch.name);
        let quantities = [
            (
                "initial_position",
                "m",
                3,
                "Initial positions",
                Source::PatchInitialPositions(p),
            ),
            (
                "area",
                "m^2",
                1,
                "Tributary areas in the initial configuration",
                Source::PatchAreas(p),
            ),
            (
                "normal",
                "1",
                3,
                "Unit outward normals in the initial configuration",
                Source::PatchNormals(p),
            ),
            (
                "particle_displacement",
                "m",
                3,
                "Displacements",
                Source::PatchField(p, Field::Displacement),
            ),
            (
                "particle_velocity",
                "m/s",
                3,
                "Velocities",
                Source::PatchField(p, Field::Velocity),
            ),
        ];
        let temperature = (simulation.has_field(Field::Temperature).is_ok()).then_some((
            "particle_temperature",
            "K",
            1,
            "Absolute temperatures",
            Source::PatchField(p, Field::Temperature),
        ));
        for (quantity, unit, components, text, source) in quantities.into_iter().chain(temperature)
        {
            list.push(OutputVariable {
                name: format!("boundary.{part}.{quantity}"),
                unit,
                components,
                particles: Some(patch.particles.len()),
                description: format!("{text} of the particles of patch {}", patch.name),
                source,
            });
        }
    }
    for field in selected_fields(simulation)? {
        let info = field.info();
        list.push(OutputVariable {
            name: format!("field.{}", info.name),
            unit: info.unit,
            components: info.components,
            particles: Some(simulation.particle_count()),
            description: format!("{}, of every particle", info.description),
            source: Source::Field(field),
        });
    }
    Ok(list)
}

/// Reads outputs from one state. What several of them share is computed once, when first needed.
#[derive(Debug, Default)]
pub struct Reader {
    energies: Option<Energies>,
    momenta: Option<Momenta>,
    /// By patch.
    resultants: Vec<Option<Resultant>>,
    /// By patch.
    heat: Vec<Option<HeatResultant>>,
    /// By probe.
    probes: Vec<Option<ProbeMotion>>,
    /// By field: all values, kept for the patches and elements that share them.
    fields: Vec<Option<Vec<f64>>>,
}

impl Reader {
    /// A reader of the present state. Make a new one when the state or an input has changed.
    pub fn new() -> Self {
        Self::default()
    }

    /// Writes the values of a variable, row-major.
    ///
    /// # Errors
    /// [`Code::InvalidArgument`](crate::Code::InvalidArgument) unless `out` has
    /// [`len`](OutputVariable::len) elements.
    pub fn read(
        &mut self,
        simulation: &Simulation,
        variable: &OutputVariable,
        out: &mut [f64],
    ) -> Result<()> {
        if out.len() != variable.len() {
            return Err(Error::argument(format!(
                "{} has {} values, the buffer {}: give a buffer of that length",
                variable.name,
                variable.len(),
                out.len()
            )));
        }
        match variable.source {
            Source::ProbeDisplacement(i) => {
                out.copy_from_slice(&self.probe(simulation, i).displacement);
            }
            Source::ProbeVelocity(i) => out.copy_from_slice(&self.probe(simulation, i).velocity),
            Source::ProbeTemperature(i) => {
                let temperature = self.probe(simulation, i).temperature;
                out[0] = temperature.ok_or_else(|| no_heat(variable))?;
            }
            Source::Energy(row) => {
                let (.., value) = ENERGIES[row];
                out[0] = value(&self.energies(simulation));
            }
            Source::LinearMomentum => out.copy_from_slice(&self.momenta(simulation).linear),
            Source::AngularMomentum => out.copy_from_slice(&self.momenta(simulation).angular),
            Source::PatchForce(p) => out.copy_from_slice(&self.resultant(simulation, p).force),
            Source::PatchMoment(p) => out.copy_from_slice(&self.resultant(simulation, p).moment),
            Source::PatchDisplacement(p) => {
                out.copy_from_slice(&self.resultant(simulation, p).mean_displacement);
            }
            Source::PatchVelocity(p) => {
                out.copy_from_slice(&self.resultant(simulation, p).mean_velocity);
            }
            Source::PatchHeatFlow(p) => out[0] = self.heat(simulation, p, variable)?.heat_flow,
            Source::PatchMeanTemperature(p) => {
                out[0] = self.heat(simulation, p, variable)?.mean_temperature;
            }
            Source::PatchMaximumTemperature(p) => {
                out[0] = self.heat(simulation, p, variable)?.maximum_temperature;
            }
            Source::StableStep(_) => out[0] = simulation.stable_step(),
            Source::ContactForce(w) => out.copy_from_slice(&simulation.contact(w).force),
            Source::ContactImpulse(w) => out.copy_from_slice(&simulation.contact(w).impulse),
            Source::ContactParticles(w) => out[0] = simulation.contact(w).particles as f64,
            // Exact up to 2^53 steps.
            Source::Steps => out[0] = simulation.steps() as f64,
            Source::PatchAreas(p) => out.copy_from_slice(&simulation.patches()[p].areas),
            Source::PatchNormals(p) => {
                out.copy_from_slice(simulation.patches()[p].normals.as_flattened());
            }
            Source::PatchInitialPositions(p) => {
                self.gather(simulation, p, Field::InitialPosition, out)?;
            }
            Source::PatchField(p, field) => self.gather(simulation, p, field, out)?,
            Source::Field(field) => out.copy_from_slice(self.field(simulation, field)?),
        }
        Ok(())
    }

    fn energies(&mut self, simulation: &Simulation) -> Energies {
        *self.energies.get_or_insert_with(|| simulation.energies())
    }

    fn momenta(&mut self, simulation: &Simulation) -> Momenta {
        *self.momenta.get_or_insert_with(|| simulation.momenta())
    }

    fn resultant(&mut self, simulation: &Simulation, patch: usize) -> Resultant {
        *entry(&mut self.resultants, patch).get_or_insert_with(|| simulation.resultant(patch))
    }

    fn heat(
        &mut self,
        simulation: &Simulation,
        patch: usize,
        variable: &OutputVariable,
    ) -> Result<HeatResultant> {
        let entry = entry(&mut self.heat, patch);
        if entry.is_none() {
            *entry = simulation.heat_resultant(patch);
        }
        entry.ok_or_else(|| no_heat(variable))
    }

    fn probe(&mut self, simulation: &Simulation, probe: usize) -> ProbeMotion {
        *entry(&mut self.probes, probe).get_or_insert_with(|| simulation.probe(probe))
    }

    fn field(&mut self, simulation: &Simulation, field: Field) -> Result<&[f64]> {
        let slot = entry(&mut self.fields, field as usize);
        if slot.is_none() {
            let n = simulation.particle_count() * field.info().components;
            let mut values = vec![0.0; n];
            simulation.read_field(field, &mut values)?;
            *slot = Some(values);
        }
        Ok(slot.as_deref().unwrap_or_default())
    }

    fn gather(
        &mut self,
        simulation: &Simulation,
        patch: usize,
        field: Field,
        out: &mut [f64],
    ) -> Result<()> {
        let n = field.info().components;
        let values = self.field(simulation, field)?;
        let particles = &simulation.patches()[patch].particles;
        for (row, &particle) in out.chunks_exact_mut(n).zip(particles) {
            row.copy_from_slice(&values[particle * n..][..n]);
        }
        Ok(())
    }
}

/// The variable comes from a simulation with heat, the one that is read has none.
fn no_heat(variable: &OutputVariable) -> Error {
    Error::argument(format!(
        "{} is of another simulation: this body has no temperature",
        variable.name
    ))
}

fn entry<T>(list: &mut Vec<Option<T>>, index: usize) -> &mut Option<T> {
    if list.len() <= index {
        list.resize_with(index + 1, || None);
    }
    &mut list[index]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn elements_count_from_one() {
        assert_eq!(element_name("a", None, 1, 0), "a");
        assert_eq!(element_name("a", None, 3, 2), "a[3]");
        assert_eq!(element_name("a", Some(4), 1, 3), "a[4]");
        assert_eq!(element_name("a", Some(4), 3, 5), "a[2,3]");
    }

    #[test]
    fn names_that_are_no_identifiers_are_quoted() {
        assert_eq!(name_part("top"), "top");
        assert_eq!(name_part("leg.y_max"), "leg.y_max");
        assert_eq!(name_part("top side"), "'top side'");
        assert_eq!(name_part("2nd"), "'2nd'");
        assert_eq!(name_part("it's"), "'it\\'s'");
        assert_eq!(name_part(""), "''");
    }
}
