//! The descriptions that importers read: `modelDescription.xml` of both standards, and the terminals
//! and icon of FMI 3.0.

use std::fmt::Write as _;
use std::io;

use quick_xml::Writer;
use quick_xml::events::{BytesDecl, Event};

use super::handle::LOG_CATEGORIES;
use super::table::{Kind, Slot, Table, Variable};
use super::{FmiVersion, MODEL_IDENTIFIER};
use crate::error::{Code, Error, Result};
use crate::simulation::Simulation;

pub(super) type Xml = Writer<Vec<u8>>;

/// A unit and the type of the variables that have it: name, exponents of kg, m, s and K, type.
type UnitRow = (&'static str, [i32; 4], &'static str);

const UNITS: &[UnitRow] = &[
    ("1", [0, 0, 0, 0], "Dimensionless"),
    ("s", [0, 0, 1, 0], "Time"),
    ("1/s", [0, 0, -1, 0], "Rate"),
    ("m", [0, 1, 0, 0], "Length"),
    ("m^2", [0, 2, 0, 0], "Area"),
    ("m^3", [0, 3, 0, 0], "Volume"),
    ("m/s", [0, 1, -1, 0], "Velocity"),
    ("kg/m^3", [1, -3, 0, 0], "Density"),
    ("Pa", [1, -1, -2, 0], "Stress"),
    ("N", [1, 1, -2, 0], "Force"),
    ("N.s", [1, 1, -1, 0], "Impulse"),
    ("N.m", [1, 2, -2, 0], "Moment"),
    ("J", [1, 2, -2, 0], "Energy"),
    ("J/m^3", [1, -1, -2, 0], "EnergyDensity"),
    ("kg.m/s", [1, 1, -1, 0], "LinearMomentum"),
    ("kg.m^2/s", [1, 2, -1, 0], "AngularMomentum"),
    ("K", [0, 0, 0, 1], "Temperature"),
    ("W", [1, 2, -3, 0], "HeatFlow"),
    ("W/m^2", [1, 0, -3, 0], "HeatFlux"),
    ("W/(m^2.K)", [1, 0, -3, -1], "HeatTransferCoefficient"),
    ("W/(m.K)", [1, 1, -3, -1], "ThermalConductivity"),
    ("J/K", [1, 2, -2, -1], "Entropy"),
    ("J/(m^3.K)", [1, -1, -2, -1], "EntropyDensity"),
    ("J/(kg.K)", [0, 2, -2, -1], "SpecificHeat"),
];

fn unit(variable: &Variable) -> Result<&'static UnitRow> {
    UNITS
        .iter()
        .find(|(name, ..)| *name == variable.unit)
        .ok_or_else(|| {
            Error::new(
                Code::Internal,
                format!(
                    "{} has the unit {}, which has no definition; please report this bug",
                    variable.name, variable.unit
                ),
            )
        })
}

/// The `modelDescription.xml` of a simulation's FMU.
///
/// # Errors
/// An unknown output field in the scene.
pub fn model_description(simulation: &Simulation, version: FmiVersion) -> Result<String> {
    describe(simulation, &Table::new(simulation, version)?)
}

pub(super) fn describe(simulation: &Simulation, table: &Table) -> Result<String> {
    for variable in &table.variables {
        unit(variable)?;
    }
    document(|xml| match table.version {
        FmiVersion::V2 => description2(xml, simulation, table),
        FmiVersion::V3 => description3(xml, simulation, table),
    })
}

/// A whole document, indented.
pub(super) fn document(body: impl FnOnce(&mut Xml) -> io::Result<()>) -> Result<String> {
    let mut xml = Writer::new_with_indent(Vec::new(), b' ', 2);
    let declaration = Event::Decl(BytesDecl::new("1.0", Some("UTF-8"), None));
    xml.write_event(declaration)
        .and_then(|()| body(&mut xml))
        .and_then(|()| String::from_utf8(xml.into_inner()).map_err(io::Error::other))
        .map(|text| text + "\n")
        .map_err(|e| {
            Error::new(
                Code::Internal,
                format!("writing XML failed: {e}; please report this bug"),
            )
        })
}

/// An element without content.
fn empty(xml: &mut Xml, name: &str, attributes: &[(&str, &str)]) -> io::Result<()> {
    xml.create_element(name)
        .with_attributes(attributes.iter().copied())
        .write_empty()?;
    Ok(())
}

/// An element with content.
fn element(
    xml: &mut Xml,
    name: &str,
    attributes: &[(&str, &str)],
    body: impl FnOnce(&mut Xml) -> io::Result<()>,
) -> io::Result<()> {
    xml.create_element(name)
        .with_attributes(attributes.iter().copied())
        .write_inner_content(body)?;
    Ok(())
}

/// A scene's title for people, without what XML does not allow.
pub(super) fn title(simulation: &Simulation) -> String {
    let title: String = simulation
        .scene()
        .title
        .chars()
        .filter(|c| !c.is_control())
        .collect();
    if title.trim().is_empty() {
        "urlsph scene".to_owned()
    } else {
        title
    }
}

/// Shortest decimal that reads back as the same number.
fn number(value: f64) -> String {
    format!("{value:?}")
}

fn start_text(kind: Kind, values: &[f64]) -> String {
    let mut text = String::new();
    for (i, value) in values.iter().enumerate() {
        let gap = if i == 0 { "" } else { " " };
        // Writing to a String cannot fail.
        let _ = match kind {
            Kind::Real => write!(text, "{gap}{value:?}"),
            Kind::Integer | Kind::Count => write!(text, "{gap}{value:.0}"),
        };
    }
    text
}

struct Attributes {
    causality: &'static str,
    variability: &'static str,
    /// `None` where the standard forbids it.
    initial: Option<&'static str>,
}

fn attributes(variable: &Variable) -> Attributes {
    let (causality, variability, initial) = match variable.slot {
        Slot::Time => ("independent", "continuous", None),
        Slot::Parameter(_) => ("parameter", "fixed", Some("exact")),
        Slot::Input(_) => ("input", "continuous", None),
        Slot::Output(_) if variable.fixed => ("calculatedParameter", "fixed", Some("calculated")),
        Slot::Output(_) if variable.kind == Kind::Real => {
            ("output", "continuous", Some("calculated"))
        }
        Slot::Output(_) => ("output", "discrete", Some("calculated")),
    };
    Attributes {
        causality,
        variability,
        initial,
    }
}

fn is_output(variable: &Variable) -> bool {
    matches!(variable.slot, Slot::Output(_)) && !variable.fixed
}

fn is_computed(variable: &Variable) -> bool {
    matches!(variable.slot, Slot::Output(_))
}

fn root_attributes<'a>(
    version: &'static str,
    title: &'a str,
    token: (&'static str, &'a str),
) -> [(&'a str, &'a str); 9] {
    [
        ("fmiVersion", version),
        ("modelName", title),
        token,
        (
            "description",
            "Large-strain solid dynamics by Updated Reference Lagrangian SPH",
        ),
        ("author", "The urlsph authors"),
        ("version", crate::VERSION),
        ("license", "MIT OR Apache-2.0"),
        (
            "generationTool",
            concat!("urlsph ", env!("CARGO_PKG_VERSION")),
        ),
        ("variableNamingConvention", "structured"),
    ]
}

fn units(xml: &mut Xml, table: &Table, type_element: &str) -> io::Result<()> {
    let used: Vec<&UnitRow> = UNITS
        .iter()
        .filter(|(name, ..)| table.variables.iter().any(|v| v.unit == *name))
        .collect();
    element(xml, "UnitDefinitions", &[], |xml| {
        for (name, exponents, _) in &used {
            element(xml, "Unit", &[("name", name)], |xml| {
                let texts = exponents.map(|e| e.to_string());
                let base: Vec<(&str, &str)> = ["kg", "m", "s", "K"]
                    .into_iter()
                    .zip(texts.iter().map(String::as_str))
                    .filter(|(_, e)| *e != "0")
                    .collect();
                empty(xml, "BaseUnit", &base)
            })?;
        }
        Ok(())
    })?;
    element(xml, "TypeDefinitions", &[], |xml| {
        for (name, _, kind) in &used {
            let quantity = [("quantity", *kind), ("unit", *name)];
            if type_element == "SimpleType" {
                element(xml, type_element, &[("name", kind)], |xml| {
                    empty(xml, "Real", &quantity)
                })?;
            } else {
                empty(
                    xml,
                    type_element,
                    &[("name", kind), quantity[0], quantity[1]],
                )?;
            }
        }
        Ok(())
    })
}

fn log_categories(xml: &mut Xml) -> io::Result<()> {
    element(xml, "LogCategories", &[], |xml| {
        for (name, description) in LOG_CATEGORIES {
            let name = name.to_string_lossy();
            empty(
                xml,
                "Category",
                &[("name", &name), ("description", description)],
            )?;
        }
        Ok(())
    })
}

fn default_experiment(xml: &mut Xml, simulation: &Simulation) -> io::Result<()> {
    let scene = simulation.scene();
    let end = scene.time.end;
    let step = scene.output.history_interval.unwrap_or(end / 200.0);
    empty(
        xml,
        "DefaultExperiment",
        &[
            ("startTime", "0.0"),
            ("stopTime", &number(end)),
            ("stepSize", &number(step)),
        ],
    )
}

/// Name of the type of a variable, as in the unit table; only of real ones.
fn declared_type(variable: &Variable) -> Option<&'static str> {
    (variable.kind == Kind::Real)
        .then(|| unit(variable).ok().map(|u| u.2))
        .flatten()
}

fn description3(xml: &mut Xml, simulation: &Simulation, table: &Table) -> io::Result<()> {
    let title = title(simulation);
    let root = root_attributes("3.0", &title, ("instantiationToken", &table.token));
    element(xml, "fmiModelDescription", &root, |xml| {
        empty(
            xml,
            "CoSimulation",
            &[
                ("modelIdentifier", MODEL_IDENTIFIER),
                ("canGetAndSetFMUState", "true"),
                ("canSerializeFMUState", "true"),
                ("canHandleVariableCommunicationStepSize", "true"),
            ],
        )?;
        units(xml, table, "Float64Type")?;
        log_categories(xml)?;
        default_experiment(xml, simulation)?;
        element(xml, "ModelVariables", &[], |xml| {
            table.variables.iter().try_for_each(|v| variable3(xml, v))
        })?;
        element(xml, "ModelStructure", &[], |xml| {
            for v in table.variables.iter().filter(|v| is_output(v)) {
                let reference = v.reference.to_string();
                let mut list = vec![("valueReference", reference.as_str())];
                list.extend((!v.feedthrough).then_some(("dependencies", "")));
                empty(xml, "Output", &list)?;
            }
            for v in table.variables.iter().filter(|v| is_computed(v)) {
                empty(
                    xml,
                    "InitialUnknown",
                    &[("valueReference", &v.reference.to_string())],
                )?;
            }
            Ok(())
        })
    })
}

fn variable3(xml: &mut Xml, v: &Variable) -> io::Result<()> {
    let kind = match v.kind {
        Kind::Real => "Float64",
        Kind::Integer => "Int32",
        Kind::Count => "UInt64",
    };
    let a = attributes(v);
    let reference = v.reference.to_string();
    let start = v.start.as_deref().map(|s| start_text(v.kind, s));
    let mut list = vec![
        ("name", v.name.as_str()),
        ("valueReference", &reference),
        ("description", &v.description),
        ("causality", a.causality),
        ("variability", a.variability),
    ];
    list.extend(a.initial.map(|initial| ("initial", initial)));
    list.extend(declared_type(v).map(|name| ("declaredType", name)));
    list.extend(start.as_deref().map(|start| ("start", start)));
    let dimensions = v.dimensions();
    if dimensions.is_empty() {
        return empty(xml, kind, &list);
    }
    element(xml, kind, &list, |xml| {
        dimensions
            .iter()
            .try_for_each(|n| empty(xml, "Dimension", &[("start", &n.to_string())]))
    })
}

fn description2(xml: &mut Xml, simulation: &Simulation, table: &Table) -> io::Result<()> {
    let title = title(simulation);
    let root = root_attributes("2.0", &title, ("guid", &table.token));
    element(xml, "fmiModelDescription", &root, |xml| {
        empty(
            xml,
            "CoSimulation",
            &[
                ("modelIdentifier", MODEL_IDENTIFIER),
                ("canHandleVariableCommunicationStepSize", "true"),
                ("canNotUseMemoryManagementFunctions", "true"),
                ("canGetAndSetFMUstate", "true"),
                ("canSerializeFMUstate", "true"),
            ],
        )?;
        units(xml, table, "SimpleType")?;
        log_categories(xml)?;
        default_experiment(xml, simulation)?;
        element(xml, "ModelVariables", &[], |xml| {
            table.variables.iter().try_for_each(|v| variable2(xml, v))
        })?;
        element(xml, "ModelStructure", &[], |xml| {
            unknowns2(xml, "Outputs", table, is_output, |v| !v.feedthrough)?;
            unknowns2(xml, "InitialUnknowns", table, is_computed, |_| false)
        })
    })
}

fn variable2(xml: &mut Xml, v: &Variable) -> io::Result<()> {
    let a = attributes(v);
    for element_index in 0..v.len() {
        let name = v.element_name(element_index);
        let reference = (v.reference as usize + element_index).to_string();
        let mut list = vec![
            ("name", name.as_str()),
            ("valueReference", &reference),
            ("description", &v.description),
            ("causality", a.causality),
            ("variability", a.variability),
        ];
        list.extend(a.initial.map(|initial| ("initial", initial)));
        let start = v
            .start
            .as_deref()
            .map(|s| start_text(v.kind, &s[element_index..=element_index]));
        let mut inner: Vec<_> = declared_type(v)
            .map(|name| ("declaredType", name))
            .into_iter()
            .collect();
        inner.extend(start.as_deref().map(|start| ("start", start)));
        let kind = if v.kind == Kind::Real {
            "Real"
        } else {
            "Integer"
        };
        element(xml, "ScalarVariable", &list, |xml| empty(xml, kind, &inner))?;
    }
    Ok(())
}

/// Lists scalars by their position among all of them, counted from 1.
fn unknowns2(
    xml: &mut Xml,
    name: &str,
    table: &Table,
    wanted: impl Fn(&Variable) -> bool,
    independent: impl Fn(&Variable) -> bool,
) -> io::Result<()> {
    element(xml, name, &[], |xml| {
        for v in table.variables.iter().filter(|v| wanted(v)) {
            for e in 0..v.len() {
                // The references are given in the order of the scalars, from 0.
                let index = (v.reference as usize + e + 1).to_string();
                let mut list = vec![("index", index.as_str())];
                list.extend(independent(v).then_some(("dependencies", "")));
                empty(xml, "Unknown", &list)?;
            }
        }
        Ok(())
    })
}

/// `terminalsAndIcons.xml` of FMI 3.0: what belongs to a patch that is driven from outside is one
/// terminal.
pub(super) fn terminals(simulation: &Simulation, table: &Table) -> Result<String> {
    let mut driven: Vec<usize> = simulation
        .inputs()
        .iter()
        .map(|input| input.patch)
        .collect();
    driven.sort_unstable();
    driven.dedup();
    document(|xml| {
        element(
            xml,
            "fmiTerminalsAndIcons",
            &[("fmiVersion", "3.0")],
            |xml| {
                let area = [("x1", "-100"), ("y1", "-100"), ("x2", "100"), ("y2", "100")];
                element(xml, "GraphicalRepresentation", &[], |xml| {
                    let mut system = area.to_vec();
                    system.push(("suggestedScalingFactorTo_mm", "0.1"));
                    empty(xml, "CoordinateSystem", &system)?;
                    empty(xml, "Icon", &area)
                })?;
                if driven.is_empty() {
                    return Ok(());
                }
                element(xml, "Terminals", &[], |xml| {
                    for &p in &driven {
                        let patch = &simulation.patches()[p].name;
                        let description =
                            format!("Loads on, heat through and motion of patch {patch}");
                        let list = [
                            ("name", patch.as_str()),
                            ("matchingRule", "bus"),
                            ("description", &description),
                        ];
                        element(xml, "Terminal", &list, |xml| {
                            for v in table.variables.iter().filter(|v| v.patch == Some(p)) {
                                let member = v.name.rsplit('.').next().unwrap_or(&v.name);
                                empty(
                                    xml,
                                    "TerminalMemberVariable",
                                    &[
                                        ("variableName", v.name.as_str()),
                                        ("memberName", member),
                                        ("variableKind", "signal"),
                                    ],
                                )?;
                            }
                            Ok(())
                        })?;
                    }
                    Ok(())
                })
            },
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_field_has_a_unit_with_a_definition() {
        for field in crate::FIELDS {
            assert!(
                UNITS.iter().any(|(name, ..)| *name == field.unit),
                "{}",
                field.name
            );
        }
    }
}
