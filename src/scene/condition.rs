//! Initial and boundary conditions: the schema, and what they must satisfy.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::validate::{finite, require};
use super::value::{Scalar, ScalarFunction, Vector, VectorFunction, below};
use crate::error::{Error, Result};

/// Conditions on one patch: at most one support, and any loads.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Condition {
    /// Homogeneous support.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub support: Option<Support>,
    /// Prescribed velocity [m/s]; a component that is `null` stays free.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub velocity: Option<Vector>,
    /// Dead traction per unit initial area [Pa].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub traction: Option<Vector>,
    /// Follower pressure per unit current area, positive in compression [Pa].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pressure: Option<Scalar>,
    /// Heat flux into the body per unit initial area [W/m^2].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub heat_flux: Option<Scalar>,
    /// Convection; it adds to the heat flux.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub convection: Option<Convection>,
    /// Prescribed absolute temperature [K]. A patch without a condition for heat is adiabatic.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub temperature: Option<Scalar>,
}

/// Convection: heat flows in at coefficient (ambient temperature - temperature) per unit initial area.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Convection {
    /// Heat transfer coefficient [W/(m^2 K)].
    pub coefficient: Scalar,
    /// Absolute temperature of the surroundings [K].
    pub ambient_temperature: Scalar,
}

impl Condition {
    /// The first condition for heat, by its key.
    pub(super) fn heat(&self) -> Option<&'static str> {
        (self.heat_flux.as_ref().map(|_| "heat_flux"))
            .or(self.convection.as_ref().map(|_| "convection"))
            .or(self.temperature.as_ref().map(|_| "temperature"))
    }
}

/// Homogeneous supports, by the normal of the patch in the initial configuration.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Support {
    /// No motion.
    Clamped,
    /// Tangential motion only (symmetry).
    Roller,
    /// Normal motion only.
    Antisymmetry,
}

/// How the initial deformation gradient follows from the displacement.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum InitialGradient {
    /// By the operators from the displaced particles: the two never part. On a surface it is of first order.
    #[default]
    Discrete,
    /// That of the expressions, so that a solution which starts deformed starts from its exact strain.
    Exact,
}

fn is_default(gradient: &InitialGradient) -> bool {
    *gradient == InitialGradient::default()
}

/// A rigid frictionless plane that particles touch, slide along and leave.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Wall {
    /// A point of the plane at time 0 [m].
    pub point: [f64; 3],
    /// Normal of the plane, towards the body; of any length.
    pub normal: [f64; 3],
    /// The patch whose particles it stops; without it all particles.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub patch: Option<String>,
    /// Whether a particle that touches the plane may leave it; `false`: it slides along the plane from
    /// then on, as on rollers.
    #[serde(default = "separation")]
    pub separation: bool,
    /// Velocity of the plane along its normal [m/s]: a number, an expression in `t` or a table.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub velocity: Option<Scalar>,
}

fn separation() -> bool {
    true
}

/// Initial state, by components in X, Y, Z [m] of the initial configuration.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Initial {
    /// Velocity [m/s].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub velocity: Option<Vector>,
    /// Displacement [m].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub displacement: Option<Vector>,
    /// How the deformation gradient follows from the displacement.
    #[serde(default, skip_serializing_if = "is_default")]
    pub gradient: InitialGradient,
    /// Temperature [K]; needs the section `heat`, whose reference temperature is the default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub temperature: Option<Scalar>,
}

pub(super) fn validate(path: &str, condition: &Condition) -> Result<()> {
    require(
        condition.support.is_none() || condition.velocity.is_none(),
        path,
        "a patch has either a `support` or a prescribed `velocity`, not both",
    )?;
    if let Some(velocity) = &condition.velocity {
        compiled(&format!("{path}.velocity"), velocity)?;
    }
    if let Some(traction) = &condition.traction {
        load(&format!("{path}.traction"), traction)?;
    }
    for (name, value) in [
        ("pressure", &condition.pressure),
        ("heat_flux", &condition.heat_flux),
    ] {
        if let Some(value) = value {
            scalar(&format!("{path}.{name}"), value, |_| true, "")?;
        }
    }
    if let Some(convection) = &condition.convection {
        let path = format!("{path}.convection");
        scalar(
            &format!("{path}.coefficient"),
            &convection.coefficient,
            |h| h >= 0.0,
            "a heat transfer coefficient is not negative",
        )?;
        absolute(
            &format!("{path}.ambient_temperature"),
            &convection.ambient_temperature,
        )?;
    }
    if let Some(temperature) = &condition.temperature {
        absolute(&format!("{path}.temperature"), temperature)?;
    }
    if condition.temperature.is_some() {
        let flow = Condition {
            temperature: None,
            ..condition.clone()
        };
        if let Some(name) = flow.heat() {
            return Err(Error::scene(
                format!("{path}.{name}"),
                format!(
                    "a patch has either a prescribed `temperature` or a `{name}`, not both: \
                     the temperature settles how much heat flows"
                ),
            ));
        }
    }
    Ok(())
}

pub(super) fn wall(path: &str, wall: &Wall) -> Result<()> {
    finite(&format!("{path}.point"), &wall.point)?;
    let place = format!("{path}.normal");
    finite(&place, &wall.normal)?;
    let length = wall.normal.iter().map(|n| n * n).sum::<f64>();
    require(
        length.is_normal(),
        &place,
        "a normal has a direction: give three numbers that are not all 0",
    )?;
    if let Some(velocity) = &wall.velocity {
        let place = format!("{path}.velocity");
        let function = scalar(&place, velocity, |_| true, "")?;
        require(
            !matches!(function, ScalarFunction::External { .. }),
            &place,
            "a plane cannot be driven from outside: give a number, an expression in t or a table",
        )?;
        require(
            !function.depends_on_space(),
            &place,
            "a rigid plane has one velocity: the expression may depend on t only",
        )?;
    }
    Ok(())
}

pub(super) fn initial(initial: &Initial) -> Result<()> {
    require(
        initial.displacement.is_some() || is_default(&initial.gradient),
        "initial.gradient",
        "there is no initial displacement that has a gradient: add `initial.displacement`",
    )?;
    if let Some(temperature) = &initial.temperature {
        let path = "initial.temperature";
        require(
            matches!(temperature, Scalar::Constant(_) | Scalar::Expression(_)),
            path,
            "an initial temperature is a number or an expression in X, Y and Z",
        )?;
        let function = temperature.compile().map_err(|e| below(path, e))?;
        require(
            !function.depends_on_time(),
            path,
            "an initial value cannot depend on t: use X, Y and Z only",
        )?;
    }
    for (name, field) in [
        ("velocity", &initial.velocity),
        ("displacement", &initial.displacement),
    ] {
        let Some(vector) = field else { continue };
        let path = format!("initial.{name}");
        let in_space =
            "an initial value has three components, each a number or an expression in X, Y and Z";
        let Vector::Components(components) = vector else {
            return Err(Error::scene(path, in_space));
        };
        let function = load(&path, vector)?;
        for (c, component) in components.iter().enumerate() {
            require(
                matches!(component, Some(Scalar::Constant(_) | Scalar::Expression(_))),
                &format!("{path}[{c}]"),
                in_space,
            )?;
        }
        if let VectorFunction::Components(functions) = &function {
            for (c, component) in functions.iter().flatten().enumerate() {
                require(
                    !component.depends_on_time(),
                    &format!("{path}[{c}]"),
                    "an initial value cannot depend on t: use X, Y and Z only",
                )?;
            }
        }
    }
    Ok(())
}

/// An absolute temperature [K].
pub(super) fn absolute(path: &str, value: &Scalar) -> Result<ScalarFunction> {
    scalar(
        path,
        value,
        |theta| theta > 0.0,
        "an absolute temperature is above 0 K",
    )
}

/// Compiles a scalar; what is known of its values before a run must be admissible.
fn scalar(
    path: &str,
    value: &Scalar,
    admissible: impl Fn(f64) -> bool,
    why: &str,
) -> Result<ScalarFunction> {
    let function = value.compile().map_err(|e| below(path, e))?;
    let known: Vec<(String, f64)> = match (value, &function) {
        (Scalar::External { external, .. }, _) => vec![(format!("{path}.external"), *external)],
        (Scalar::Table { table }, _) => {
            let place = |(i, v): (usize, &f64)| (format!("{path}.table.value[{i}]"), *v);
            table.value.iter().enumerate().map(place).collect()
        }
        (_, ScalarFunction::Constant(v)) => vec![(path.to_owned(), *v)],
        _ => Vec::new(),
    };
    for (place, v) in known {
        require(admissible(v), &place, &format!("{why}, but this is {v}"))?;
    }
    Ok(function)
}

fn compiled(path: &str, vector: &Vector) -> Result<VectorFunction> {
    vector.compile().map_err(|e| below(path, e))
}

/// A vector without free components.
pub(super) fn load(path: &str, vector: &Vector) -> Result<VectorFunction> {
    let function = compiled(path, vector)?;
    match function.free().iter().position(|free| *free) {
        None => Ok(function),
        Some(c) => Err(Error::scene(
            format!("{path}[{c}]"),
            "`null` (a free component) is only for the prescribed velocity of a boundary; write 0",
        )),
    }
}
