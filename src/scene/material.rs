//! The constitutive law: the schema, and what it must satisfy.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::validate::{positive, require};
use crate::error::{Error, Result};

/// The constitutive law.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub enum Material {
    /// W = mu/2 (J^(-2/3) F:F - 3) + kappa/2 (J - 1)^2.
    NeoHookean(Elastic),
    /// [URL22] eq. 5 with 2 zeta + 3 sqrt(3) xi = mu.
    MooneyRivlin(MooneyRivlin),
    /// Small strains only: W = mu e:e + lambda/2 tr(e)^2, e = sym(F - I); it knows no rotation.
    LinearElastic(Elastic),
    /// Hencky's elasticity ([URL23] eqs. 34 to 39) with rate-independent von Mises plasticity.
    VonMises(VonMises),
    /// Hencky's elasticity with plasticity that depends on rate and temperature ([URL23] eqs. 40 to 42).
    JohnsonCook(JohnsonCook),
}

/// Density and elastic constants.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Elastic {
    /// Density in the initial configuration [kg/m^3].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub density: f64,
    /// Young's modulus of the linearised law [Pa].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub youngs_modulus: f64,
    /// Poisson's ratio of the linearised law, in (-1, 0.5).
    #[schemars(extend("exclusiveMinimum" = -1, "exclusiveMaximum" = 0.5))]
    pub poisson_ratio: f64,
}

/// Parameters of the Mooney-Rivlin law.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MooneyRivlin {
    /// Density in the initial configuration [kg/m^3].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub density: f64,
    /// Young's modulus of the linearised law [Pa].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub youngs_modulus: f64,
    /// Poisson's ratio of the linearised law, in (-1, 0.5).
    #[schemars(extend("exclusiveMinimum" = -1, "exclusiveMaximum" = 0.5))]
    pub poisson_ratio: f64,
    /// Share of the shear modulus carried by the H term: 3 sqrt(3) xi / mu, in [0, 1]. Default 0.5.
    #[serde(default = "half")]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub area_share: f64,
}

/// Parameters of von Mises plasticity. The yield stress is that of the Kirchhoff stress, tau_0 + H e +
/// (tau_inf - tau_0) (1 - exp(-delta e)) at the equivalent plastic strain e; with H = 0 and no
/// saturation the plasticity is perfect.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct VonMises {
    /// Density in the initial configuration [kg/m^3].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub density: f64,
    /// Young's modulus [Pa].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub youngs_modulus: f64,
    /// Poisson's ratio, in (-1, 0.5).
    #[schemars(extend("exclusiveMinimum" = -1, "exclusiveMaximum" = 0.5))]
    pub poisson_ratio: f64,
    /// Initial yield stress tau_0 [Pa].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub yield_stress: f64,
    /// Linear hardening modulus H [Pa]. Default 0.
    #[serde(default)]
    #[schemars(range(min = 0.0))]
    pub hardening_modulus: f64,
    /// Saturation stress tau_inf [Pa], not below the initial yield stress; with `saturation_exponent`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub saturation_stress: Option<f64>,
    /// Saturation exponent delta; with `saturation_stress`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub saturation_exponent: Option<f64>,
}

/// Parameters of Johnson and Cook's plasticity: a yield stress (tau_0 + H e^N) [1 + C ln(r/r_0)]
/// (1 - g^M) at the equivalent plastic strain e and its rate r, where g rises from 0 at the transition
/// temperature to 1 at the melting temperature. Rates below r_0 count as r_0; from the melting temperature on the
/// body resists no shear. Without `heat` g is 0.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct JohnsonCook {
    /// Density in the initial configuration [kg/m^3].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub density: f64,
    /// Young's modulus [Pa].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub youngs_modulus: f64,
    /// Poisson's ratio, in (-1, 0.5).
    #[schemars(extend("exclusiveMinimum" = -1, "exclusiveMaximum" = 0.5))]
    pub poisson_ratio: f64,
    /// Initial yield stress tau_0 [Pa].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub yield_stress: f64,
    /// Hardening parameter H [Pa].
    #[schemars(range(min = 0.0))]
    pub hardening_modulus: f64,
    /// Hardening exponent N.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub hardening_exponent: f64,
    /// Strain-rate coefficient C; 0 for a yield stress that does not depend on the rate.
    #[schemars(range(min = 0.0))]
    pub rate_coefficient: f64,
    /// Reference strain rate r_0 [1/s].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub reference_strain_rate: f64,
    /// Temperature exponent M.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub softening_exponent: f64,
    /// Melting temperature [K].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub melting_temperature: f64,
    /// Temperature [K] up to which the yield stress does not depend on it; below the melting temperature.
    #[schemars(range(min = 0.0))]
    pub transition_temperature: f64,
}

fn half() -> f64 {
    0.5
}

impl Material {
    /// Key, density, Young's modulus and Poisson's ratio.
    pub(crate) fn elastic(&self) -> (&'static str, [f64; 3]) {
        match self {
            Self::NeoHookean(m) => (
                "neo_hookean",
                [m.density, m.youngs_modulus, m.poisson_ratio],
            ),
            Self::MooneyRivlin(m) => (
                "mooney_rivlin",
                [m.density, m.youngs_modulus, m.poisson_ratio],
            ),
            Self::LinearElastic(m) => (
                "linear_elastic",
                [m.density, m.youngs_modulus, m.poisson_ratio],
            ),
            Self::VonMises(m) => ("von_mises", [m.density, m.youngs_modulus, m.poisson_ratio]),
            Self::JohnsonCook(m) => (
                "johnson_cook",
                [m.density, m.youngs_modulus, m.poisson_ratio],
            ),
        }
    }

    /// Whether the law yields.
    pub(crate) fn is_plastic(&self) -> bool {
        matches!(self, Self::VonMises(_) | Self::JohnsonCook(_))
    }
}

/// Checks every value by itself.
pub(super) fn validate(material: &Material) -> Result<()> {
    let (kind, [density, youngs_modulus, poisson_ratio]) = material.elastic();
    let path = |name: &str| format!("material.{kind}.{name}");
    let positive = |name: &str, value: f64| positive(&path(name), value);
    let not_negative = |name: &str, value: f64| {
        require(
            value.is_finite() && value >= 0.0,
            &path(name),
            &format!("expected a finite number, 0 or more, instead of {value}"),
        )
    };
    positive("density", density)?;
    positive("youngs_modulus", youngs_modulus)?;
    require(
        -1.0 < poisson_ratio && poisson_ratio < 0.5,
        &path("poisson_ratio"),
        &format!("expected more than -1 and less than 0.5 instead of {poisson_ratio}"),
    )?;
    match material {
        Material::NeoHookean(_) | Material::LinearElastic(_) => {}
        Material::MooneyRivlin(m) => require(
            (0.0..=1.0).contains(&m.area_share),
            &path("area_share"),
            &format!("expected a share from 0 to 1 instead of {}", m.area_share),
        )?,
        Material::VonMises(m) => {
            positive("yield_stress", m.yield_stress)?;
            not_negative("hardening_modulus", m.hardening_modulus)?;
            match (m.saturation_stress, m.saturation_exponent) {
                (None, None) => {}
                (Some(stress), Some(exponent)) => {
                    positive("saturation_stress", stress)?;
                    positive("saturation_exponent", exponent)?;
                }
                (stress, _) => {
                    let [given, missing] = match stress {
                        Some(_) => ["saturation_stress", "saturation_exponent"],
                        None => ["saturation_exponent", "saturation_stress"],
                    };
                    return Err(Error::scene(
                        path(given),
                        format!("saturation hardening needs `{missing}` too"),
                    ));
                }
            }
        }
        Material::JohnsonCook(m) => {
            for (name, value) in [
                ("yield_stress", m.yield_stress),
                ("hardening_exponent", m.hardening_exponent),
                ("reference_strain_rate", m.reference_strain_rate),
                ("softening_exponent", m.softening_exponent),
                ("melting_temperature", m.melting_temperature),
            ] {
                positive(name, value)?;
            }
            for (name, value) in [
                ("hardening_modulus", m.hardening_modulus),
                ("rate_coefficient", m.rate_coefficient),
                ("transition_temperature", m.transition_temperature),
            ] {
                not_negative(name, value)?;
            }
        }
    }
    Ok(())
}

/// Checks the values against each other.
pub(super) fn validate_together(material: &Material) -> Result<()> {
    match material {
        Material::VonMises(m) => match m.saturation_stress {
            Some(stress) if stress < m.yield_stress => Err(Error::scene(
                "material.von_mises.saturation_stress",
                format!(
                    "expected a number not below `yield_stress`, {}, instead of {stress}",
                    m.yield_stress
                ),
            )),
            _ => Ok(()),
        },
        Material::JohnsonCook(m) => require(
            m.transition_temperature < m.melting_temperature,
            "material.johnson_cook.transition_temperature",
            &format!(
                "expected less than `melting_temperature`, {}, instead of {}",
                m.melting_temperature, m.transition_temperature
            ),
        ),
        Material::NeoHookean(_) | Material::MooneyRivlin(_) | Material::LinearElastic(_) => Ok(()),
    }
}
