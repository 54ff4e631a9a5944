//! Heat: the schema, and what it must satisfy.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::validate::{positive, require};
use super::value::{Scalar, ScalarFunction, below};
use crate::error::Result;

/// Thermal properties of the body and what heats it ([URL23] 3). Without this section a body has no
/// temperature, and nothing of it is stored or computed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Heat {
    /// Specific heat at constant volume C_v [J/(kg K)].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub specific_heat: f64,
    /// Reference temperature theta_R [K]: the undeformed body has no stress at it.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub reference_temperature: f64,
    /// Thermal conductivity h [W/(m K)], in the current configuration; 0 is adiabatic inside.
    #[serde(default)]
    #[schemars(range(min = 0.0))]
    pub conductivity: f64,
    /// Mie-Grueneisen coefficient Gamma_0 ([URL23] 21): 3 kappa alpha/(rho_R C_v) for a coefficient alpha of
    /// linear thermal expansion; 0 leaves heat without effect on the stress.
    #[serde(default)]
    #[schemars(range(min = 0.0))]
    pub gruneisen_coefficient: f64,
    /// Mie-Grueneisen exponent q, from 0 (perfect gas) to 1 (solid).
    #[serde(default = "one")]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub gruneisen_exponent: f64,
    /// Share of the plastic work that becomes heat (Taylor-Quinney coefficient).
    #[serde(default = "one")]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub plastic_heat_fraction: f64,
    /// Heat source per unit initial volume r_R [W/m^3].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub source: Option<Scalar>,
}

fn one() -> f64 {
    1.0
}

pub(super) fn validate(heat: &Heat) -> Result<()> {
    positive("heat.specific_heat", heat.specific_heat)?;
    positive("heat.reference_temperature", heat.reference_temperature)?;
    for (name, value) in [
        ("conductivity", heat.conductivity),
        ("gruneisen_coefficient", heat.gruneisen_coefficient),
    ] {
        require(
            value.is_finite() && value >= 0.0,
            &format!("heat.{name}"),
            &format!("expected a finite number, 0 or more, instead of {value}"),
        )?;
    }
    for (name, value) in [
        ("gruneisen_exponent", heat.gruneisen_exponent),
        ("plastic_heat_fraction", heat.plastic_heat_fraction),
    ] {
        require(
            (0.0..=1.0).contains(&value),
            &format!("heat.{name}"),
            &format!("expected a number from 0 to 1 instead of {value}"),
        )?;
    }
    if let Some(source) = &heat.source {
        let function = source.compile().map_err(|e| below("heat.source", e))?;
        require(
            !matches!(function, ScalarFunction::External { .. }),
            "heat.source",
            "a heat source cannot be external; use an expression or a table in time, or make the \
             heat flux of a patch external",
        )?;
    }
    Ok(())
}
