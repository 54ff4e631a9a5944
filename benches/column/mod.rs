//! The column at the start of a twist, with one thing or another on top: what the benches measure.

// Each bench uses a part.
#![allow(dead_code)]

use urlsph::{Result, Scene};

/// As soft as the column is: the metals flow from the first steps on.
pub const VON_MISES: &str = r#"material={"von_mises": {
    "density": 1100, "youngs_modulus": 1.7e7, "poisson_ratio": 0.3,
    "yield_stress": 1e4, "hardening_modulus": 1e5
}}"#;
pub const JOHNSON_COOK: &str = r#"material={"johnson_cook": {
    "density": 1100, "youngs_modulus": 1.7e7, "poisson_ratio": 0.3,
    "yield_stress": 1e4, "hardening_modulus": 1e5, "hardening_exponent": 0.31,
    "rate_coefficient": 0.025, "reference_strain_rate": 1,
    "softening_exponent": 1.09, "melting_temperature": 1356, "transition_temperature": 290
}}"#;
pub const HEAT: &str = r#"heat={
    "specific_heat": 383, "reference_temperature": 293, "conductivity": 10, "gruneisen_coefficient": 0.1
}"#;
pub const JITTER: &str = r#"geometry.box.jitter={"fraction": 0.2}"#;

const TWISTING: &str = include_str!("../../examples/column_twisting/scene.json");

/// The column with a spacing [m].
pub fn scene(spacing: f64, overrides: &[&str]) -> Result<Scene> {
    let mut all = vec![format!("geometry.box.spacing={spacing}")];
    all.extend(overrides.iter().map(|o| (*o).to_owned()));
    Scene::from_json(TWISTING, &all)
}
