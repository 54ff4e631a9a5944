//! What the acceptance tests share: scenes of the examples, runs step by step.

use urlsph::{Scene, Simulation};

pub use crate::cases::{Meter, Table, displacement, example, norm};
pub use crate::common::field;
pub use crate::common::roughness::Roughness;

/// A model of the columns: name and lattice spacing [m].
#[derive(Debug, Clone, Copy)]
pub struct Model(pub &'static str, pub f64);

/// 5 x 25 x 5 particles.
pub const M1: Model = Model("M1", 1.0 / 4.0);
/// 7 x 37 x 7 particles.
pub const M2: Model = Model("M2", 1.0 / 6.0);
/// 9 x 49 x 9 particles.
pub const M3: Model = Model("M3", 1.0 / 8.0);
/// 17 x 97 x 17 particles.
pub const M4: Model = Model("M4", 1.0 / 16.0);

/// The scene of an example with overrides.
pub fn scene(case: &str, overrides: &[&str]) -> Scene {
    let overrides: Vec<String> = overrides.iter().map(|s| (*s).to_owned()).collect();
    Scene::from_file(example(case, "scene.json"), &overrides).unwrap_or_else(|e| panic!("{e}"))
}

/// A simulation of an example on one thread: the tests themselves run in parallel.
pub fn simulation(case: &str, overrides: &[&str]) -> Simulation {
    with_threads(case, overrides, 1)
}

/// The same with a number of threads.
pub fn with_threads(case: &str, overrides: &[&str], threads: usize) -> Simulation {
    Simulation::with_threads(scene(case, overrides), threads)
        .unwrap_or_else(|e| panic!("{case} {overrides:?}: {e}"))
}

/// A simulation of a column.
pub fn column(case: &str, model: Model, overrides: &[&str]) -> Simulation {
    let spacing = format!("geometry.box.spacing={}", model.1);
    let mut all = vec![spacing.as_str()];
    all.extend_from_slice(overrides);
    let threads = if model.1 < M3.1 { 2 } else { 1 };
    with_threads(case, &all, threads)
}

/// Runs to `end` in stable steps and shows the simulation after every one.
pub fn run(simulation: &mut Simulation, end: f64, after: impl FnMut(&Simulation)) {
    let title = simulation.scene().title.clone();
    Meter::default()
        .run(simulation, end, after)
        .unwrap_or_else(|e| panic!("{title}: {e}"));
}

/// Prints a residual with its tolerance and fails if it is larger, or not a number.
#[track_caller]
pub fn check(what: &str, residual: f64, tolerance: f64) {
    println!("{what}: residual {residual:.3e}, tolerance {tolerance:.3e}");
    assert!(
        residual <= tolerance,
        "{what}: {residual:e} > {tolerance:e}"
    );
}

/// Prints a value that has a lower bound and fails if it is smaller, or not a number.
#[track_caller]
pub fn check_at_least(what: &str, value: f64, bound: f64) {
    println!("{what}: {value:.3}, at least {bound:.3}");
    assert!(value >= bound, "{what}: {value} < {bound}");
}

/// Energy at time 0, from the ledger.
pub fn initial_energy(simulation: &Simulation) -> f64 {
    let e = simulation.energies();
    let total = e.kinetic + e.strain + e.numerical_dissipation + e.projection;
    total - e.external_work - e.closure_error
}

/// Kinetic and strain energy over the initial energy.
pub fn energy_ratio(simulation: &Simulation) -> f64 {
    let e = simulation.energies();
    (e.kinetic + e.strain) / initial_energy(simulation)
}

/// Energy dissipated by the scheme over the initial energy.
pub fn dissipation_ratio(simulation: &Simulation) -> f64 {
    simulation.energies().numerical_dissipation / initial_energy(simulation)
}

/// Observed order between two resolutions.
pub fn order(coarse: (f64, f64), fine: (f64, f64)) -> f64 {
    (coarse.1 / fine.1).ln() / (coarse.0 / fine.0).ln()
}
