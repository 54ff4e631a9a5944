//! The constitutive law: the schema, and what it must satisfy.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::validate::{positive, require};
use crate::error::Result;

/// The constitutive law.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub enum Material {
    /// W = mu/2 (J^(-2/3) F:F - 3) + kappa/2 (J - 1)^2.
    NeoHookean(NeoHookean),
    /// [URL22] eq. 5 with 2 zeta + 3 sqrt(3) xi = mu.
    MooneyRivlin(MooneyRivlin),
}

/// Parameters of the neo-Hookean law.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NeoHookean {
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

fn half() -> f64 {
    0.5
}

pub(super) fn validate(material: &Material) -> Result<()> {
    let (path, density, youngs_modulus, poisson_ratio) = match material {
        Material::NeoHookean(m) => (
            "material.neo_hookean",
            m.density,
            m.youngs_modulus,
            m.poisson_ratio,
        ),
        Material::MooneyRivlin(m) => (
            "material.mooney_rivlin",
            m.density,
            m.youngs_modulus,
            m.poisson_ratio,
        ),
    };
    positive(&format!("{path}.density"), density)?;
    positive(&format!("{path}.youngs_modulus"), youngs_modulus)?;
    require(
        -1.0 < poisson_ratio && poisson_ratio < 0.5,
        &format!("{path}.poisson_ratio"),
        &format!("expected more than -1 and less than 0.5 instead of {poisson_ratio}"),
    )?;
    if let Material::MooneyRivlin(m) = material {
        require(
            (0.0..=1.0).contains(&m.area_share),
            &format!("{path}.area_share"),
            &format!("expected a share from 0 to 1 instead of {}", m.area_share),
        )?;
    }
    Ok(())
}
