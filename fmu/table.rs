//! The variables of a scene: one table from which the description is written and by which an
//! instance is read and set.

use serde_json::Value;
use xxhash_rust::xxh3::xxh3_128;

use super::FmiVersion;
use crate::boundary::Quantity;
use crate::error::{Code, Error, Result};
use crate::output::variables::{self, OutputVariable, element_name, name_part};
use crate::scene::{Scene, StateMeasures};
use crate::simulation::Simulation;

/// Most scalars into which arrays are taken apart for FMI 2.0: importers parse scalars slowly.
pub(super) const MAX_SCALARS: usize = 1000;

/// Type of a variable.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    /// 64-bit floating point.
    Real,
    /// 32-bit integer.
    Integer,
    /// A count: 64-bit unsigned in FMI 3.0, 32-bit in FMI 2.0.
    Count,
}

/// Where the value of a variable lives; it settles causality and variability as well.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Slot {
    /// The independent variable.
    Time,
    /// Index into [`Table::parameters`].
    Parameter(usize),
    /// Index into [`Simulation::inputs`].
    Input(usize),
    /// Index into [`Table::outputs`].
    Output(usize),
}

/// One variable; its elements have the value references `reference .. reference + len`, of which
/// FMI 3.0 uses the first for the whole array and FMI 2.0 one per scalar.
#[derive(Debug, Clone)]
pub(super) struct Variable {
    /// Structured name without index.
    pub name: String,
    pub unit: &'static str,
    pub description: String,
    pub kind: Kind,
    pub slot: Slot,
    /// Rows, for a value per particle.
    pub particles: Option<usize>,
    pub components: usize,
    /// Value reference of the first element.
    pub reference: u32,
    /// Start values of inputs and parameters, row-major.
    pub start: Option<Vec<f64>>,
    /// Settled by the geometry: a calculated parameter.
    pub fixed: bool,
    /// Changes with the inputs at once.
    pub feedthrough: bool,
    /// Patch that the variable belongs to, as an index into [`Simulation::patches`].
    pub patch: Option<usize>,
}

impl Variable {
    pub fn len(&self) -> usize {
        self.particles.unwrap_or(1) * self.components
    }
    /// Dimensions of the array; none for a scalar. Tensors are 3 x 3.
    pub fn dimensions(&self) -> Vec<usize> {
        let components: &[usize] = match self.components {
            1 => &[],
            9 => &[3, 3],
            n => &[n],
        };
        self.particles.iter().chain(components).copied().collect()
    }
    /// Name of one element.
    pub fn element_name(&self, element: usize) -> String {
        element_name(&self.name, self.particles, self.components, element)
    }
}

/// A number that can be set before the simulation starts.
#[derive(Debug, Clone)]
pub(super) struct Parameter {
    /// Path in the scene; `None` for the number of threads, which is not part of the scene.
    pub path: Option<String>,
    pub name: String,
    pub unit: &'static str,
    pub description: &'static str,
    pub start: f64,
}

impl Parameter {
    /// The override of the scene that gives this parameter a value.
    pub fn scene_override(&self, value: f64) -> Option<String> {
        // `{:?}` writes the shortest decimal that reads back as the same number.
        self.path.as_ref().map(|path| format!("{path}={value:?}"))
    }
}

/// All variables of a scene.
#[derive(Debug)]
pub(super) struct Table {
    pub version: FmiVersion,
    /// By ascending value reference.
    pub variables: Vec<Variable>,
    pub parameters: Vec<Parameter>,
    pub outputs: Vec<OutputVariable>,
    /// Identifies scene, library version and table: what the importer reads in the description and
    /// hands back at instantiation.
    pub token: String,
}

/// A number of a section of the scene: key, unit, description.
type NumberRow = (&'static str, &'static str, &'static str);

/// Numbers of the material laws.
const MATERIAL: &[NumberRow] = &[
    ("density", "kg/m^3", "Density in the initial configuration"),
    (
        "youngs_modulus",
        "Pa",
        "Young's modulus of the linearised law",
    ),
    (
        "poisson_ratio",
        "1",
        "Poisson's ratio of the linearised law",
    ),
    (
        "area_share",
        "1",
        "Share of the shear modulus carried by the cofactor term",
    ),
    ("yield_stress", "Pa", "Initial yield stress"),
    ("hardening_modulus", "Pa", "Hardening modulus"),
    ("saturation_stress", "Pa", "Saturation stress"),
    ("saturation_exponent", "1", "Saturation exponent"),
    ("hardening_exponent", "1", "Hardening exponent"),
    ("rate_coefficient", "1", "Strain-rate coefficient"),
    ("reference_strain_rate", "1/s", "Reference strain rate"),
    ("softening_exponent", "1", "Temperature exponent"),
    ("melting_temperature", "K", "Melting temperature"),
    (
        "transition_temperature",
        "K",
        "Temperature up to which the yield stress does not depend on it",
    ),
];

/// Numbers of the section `heat`.
const HEAT: &[NumberRow] = &[
    (
        "specific_heat",
        "J/(kg.K)",
        "Specific heat at constant volume",
    ),
    ("reference_temperature", "K", "Reference temperature"),
    ("conductivity", "W/(m.K)", "Thermal conductivity"),
    ("gruneisen_coefficient", "1", "Mie-Grueneisen coefficient"),
    ("gruneisen_exponent", "1", "Mie-Grueneisen exponent"),
    (
        "plastic_heat_fraction",
        "1",
        "Share of the plastic work that becomes heat",
    ),
];

fn parameters(simulation: &Simulation) -> Result<Vec<Parameter>> {
    let scene = simulation.scene();
    let mut list = Vec::new();
    let tree = scene_tree(scene)?;
    let mut section = |place: &str, name: &str, rows: &[NumberRow], numbers: &Value| {
        for &(key, unit, description) in rows {
            if let Some(start) = numbers[key].as_f64() {
                list.push(Parameter {
                    path: Some(format!("{place}.{key}")),
                    name: format!("{name}.{key}"),
                    unit,
                    description,
                    start,
                });
            }
        }
    };
    // One law: `material` is an object with one key.
    for (law, numbers) in tree["material"].as_object().into_iter().flatten() {
        section(&format!("material.{law}"), "material", MATERIAL, numbers);
    }
    section("heat", "heat", HEAT, &tree["heat"]);
    let numerics = &scene.numerics;
    let mut number = |key: &str, unit, description, start| {
        list.push(Parameter {
            path: Some(format!("numerics.{key}")),
            name: format!("numerics.{key}"),
            unit,
            description,
            start,
        });
    };
    // The scene has either a fixed step or a CFL number.
    match numerics.time_step {
        Some(step) => number("time_step", "s", "Fixed time step", step),
        None => number("cfl", "1", "CFL number", simulation.cfl_number()),
    }
    number(
        "smoothing_factor",
        "1",
        "Smoothing length over the largest distance to a neighbour",
        numerics.smoothing_factor,
    );
    if numerics.state != StateMeasures::F {
        number(
            "volume_dissipation",
            "1",
            "Coefficient of the dissipation of the volume equation",
            numerics.volume_dissipation,
        );
    }
    list.push(Parameter {
        path: None,
        name: "threads".to_owned(),
        unit: "1",
        description: "Threads of this instance; 0 means as many as the machine has cores",
        start: 0.0,
    });
    Ok(list)
}

fn scene_tree(scene: &Scene) -> Result<Value> {
    serde_json::to_value(scene).map_err(|e| {
        Error::new(
            Code::Internal,
            format!("the scene cannot be written as JSON: {e}; please report this bug"),
        )
    })
}

impl Table {
    /// Lists the variables of a simulation.
    ///
    /// # Errors
    /// An unknown output field, or more values than value references.
    pub fn new(simulation: &Simulation, version: FmiVersion) -> Result<Self> {
        let mut table = Self {
            version,
            variables: Vec::new(),
            parameters: parameters(simulation)?,
            outputs: variables::outputs(simulation),
            token: String::new(),
        };
        let mut list = vec![Variable {
            name: "time".to_owned(),
            unit: "s",
            description: "Simulated time".to_owned(),
            kind: Kind::Real,
            slot: Slot::Time,
            particles: None,
            components: 1,
            reference: 0,
            start: None,
            fixed: false,
            feedthrough: false,
            patch: None,
        }];
        for (i, parameter) in table.parameters.iter().enumerate() {
            list.push(Variable {
                name: parameter.name.clone(),
                unit: parameter.unit,
                description: parameter.description.to_owned(),
                kind: if parameter.path.is_some() {
                    Kind::Real
                } else {
                    Kind::Integer
                },
                slot: Slot::Parameter(i),
                particles: None,
                components: 1,
                reference: 0,
                start: Some(vec![parameter.start]),
                fixed: true,
                feedthrough: false,
                patch: None,
            });
        }
        let arrays = variables::arrays(simulation)?;
        let detailed = detailed_patches(simulation, &arrays, version);
        for (i, input) in simulation.inputs().iter().enumerate() {
            let patch = &simulation.patches()[input.patch];
            let rows = (input.per_particle && detailed.contains(&input.patch))
                .then_some(patch.particles.len());
            // What is prescribed is not what the body does, even of the same kind.
            let (name, text) = match input.quantity {
                Quantity::Velocity => ("prescribed_velocity", "Prescribed velocity"),
                Quantity::Traction => ("traction", "Dead traction per unit initial area"),
                Quantity::Pressure => ("pressure", "Follower pressure per unit current area"),
                Quantity::HeatFlux => {
                    ("heat_flux", "Heat flux into the body per unit initial area")
                }
                Quantity::Temperature => ("prescribed_temperature", "Prescribed temperature"),
                Quantity::ConvectionCoefficient => (
                    "convection_coefficient",
                    "Heat transfer coefficient per unit initial area",
                ),
                Quantity::AmbientTemperature => (
                    "ambient_temperature",
                    "Temperature of the surroundings for the convection",
                ),
            };
            list.push(Variable {
                name: format!("boundary.{}.{name}", name_part(&patch.name)),
                unit: input.quantity.unit(),
                description: match rows {
                    Some(_) => format!("{text} at each particle of patch {}", patch.name),
                    None => format!("{text} on patch {}", patch.name),
                },
                kind: Kind::Real,
                slot: Slot::Input(i),
                particles: rows,
                components: input.quantity.components(),
                reference: 0,
                start: Some(input.start.repeat(rows.unwrap_or(1))),
                fixed: false,
                feedthrough: false,
                patch: Some(input.patch),
            });
        }
        table
            .outputs
            .extend(arrays.into_iter().filter(|array| match version {
                FmiVersion::V3 => true,
                FmiVersion::V2 => array.patch().is_some_and(|p| detailed.contains(&p)),
            }));
        for (i, output) in table.outputs.iter().enumerate() {
            list.push(Variable {
                name: output.name.clone(),
                unit: output.unit,
                description: output.description.clone(),
                kind: if output.is_integer() {
                    Kind::Count
                } else {
                    Kind::Real
                },
                slot: Slot::Output(i),
                particles: output.particles,
                components: output.components,
                reference: 0,
                start: None,
                fixed: output.is_fixed(),
                feedthrough: output.depends_on_inputs(),
                patch: output.patch(),
            });
        }
        let mut next = 0_usize;
        for variable in &mut list {
            let end = next + variable.len();
            if end > u32::MAX as usize {
                return Err(Error::argument(format!(
                    "{} would be beyond the {} values that an FMU can have: name fewer fields in output.fields",
                    variable.name,
                    u32::MAX
                )));
            }
            variable.reference = next as u32;
            next = end;
        }
        table.variables = list;
        table.token = token(simulation.scene(), &table)?;
        Ok(table)
    }

    /// The variable and element of a value reference.
    pub fn find(&self, reference: u32) -> Option<(usize, usize)> {
        let index = self
            .variables
            .partition_point(|v| v.reference <= reference)
            .checked_sub(1)?;
        let element = (reference - self.variables[index].reference) as usize;
        (element < self.variables[index].len()).then_some((index, element))
    }
}

/// Patches whose inputs and arrays are given per particle.
fn detailed_patches(
    simulation: &Simulation,
    arrays: &[OutputVariable],
    version: FmiVersion,
) -> Vec<usize> {
    if version == FmiVersion::V3 {
        return (0..simulation.patches().len()).collect();
    }
    let inputs = || simulation.inputs().iter().filter(|i| i.per_particle);
    let detailed: Vec<usize> = inputs().map(|i| i.patch).collect();
    let of_inputs =
        inputs().map(|i| simulation.patches()[i.patch].particles.len() * i.quantity.components());
    let of_arrays = arrays
        .iter()
        .filter(|a| a.patch().is_some_and(|p| detailed.contains(&p)))
        .map(OutputVariable::len);
    if of_inputs.chain(of_arrays).sum::<usize>() <= MAX_SCALARS {
        detailed
    } else {
        Vec::new()
    }
}

fn token(scene: &Scene, table: &Table) -> Result<String> {
    let mut text = format!(
        "{} {:?}\n{}\n",
        crate::VERSION,
        table.version,
        scene_tree(&scene.of_content())?
    );
    for v in &table.variables {
        text.push_str(&format!(
            "{} {} {} {:?}\n",
            v.reference,
            v.name,
            v.unit,
            v.dimensions()
        ));
    }
    let h = format!("{:032x}", xxh3_128(text.as_bytes()));
    Ok(format!(
        "{{{}-{}-{}-{}-{}}}",
        &h[..8],
        &h[8..12],
        &h[12..16],
        &h[16..20],
        &h[20..]
    ))
}
