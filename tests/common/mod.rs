//! What the tests of simulations share: a block, its fields, residuals beside their tolerances.

// Every test program is built with this file, and uses a part of it.
#![allow(dead_code)]

pub mod roughness;

use urlsph::{Field, Result, Scene, Simulation};

/// A free block of 5 x 9 x 5 particles.
pub const BLOCK: &str = r#"{
    "geometry": {"box": {"min": [0, 0, 0], "max": [1, 2, 1], "spacing": 0.25}},
    "material": {"neo_hookean": {"density": 1000, "youngs_modulus": 1e6, "poisson_ratio": 0.3}},
    "time": {"end": 1}
}"#;

/// A scene with overrides, on one thread: the tests themselves run in parallel.
pub fn try_simulation(json: &str, overrides: &[&str]) -> Result<Simulation> {
    let overrides: Vec<String> = overrides.iter().map(|o| (*o).to_string()).collect();
    Simulation::with_threads(Scene::from_json(json, &overrides)?, 1)
}

/// The same of a scene that is good.
pub fn simulation(json: &str, overrides: &[&str]) -> Simulation {
    try_simulation(json, overrides).unwrap_or_else(|e| panic!("{overrides:?}: {e}"))
}

/// The block with overrides.
pub fn block(overrides: &[&str]) -> Simulation {
    simulation(BLOCK, overrides)
}

/// Asserts that a scene is refused at a path, with a text in the message.
#[track_caller]
pub fn refuses(json: &str, overrides: &[&str], path: &str, text: &str) {
    let error = try_simulation(json, overrides)
        .err()
        .unwrap_or_else(|| panic!("{overrides:?} was taken"));
    println!("{error}");
    assert!(error.to_string().contains(text), "{error}");
    let place = error.place().path.as_deref().unwrap_or("");
    assert!(place.starts_with(path), "{place} instead of {path}");
}

/// A field of all particles.
pub fn field(simulation: &Simulation, field: Field) -> Vec<f64> {
    let mut values = vec![0.0; field.info().components * simulation.particle_count()];
    simulation
        .read_field(field, &mut values)
        .expect("the buffer fits");
    values
}

/// |value / exact - 1|, printed beside its tolerance.
#[track_caller]
pub fn close(what: &str, value: f64, exact: f64, tolerance: f64) {
    let residual = (value / exact - 1.0).abs();
    println!("{what}: {value:e} for {exact:e}: {residual:e} (tolerance {tolerance:e})");
    assert!(residual <= tolerance, "{what}: {value} for {exact}");
}
