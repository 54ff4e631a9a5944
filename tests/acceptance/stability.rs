//! The default CFL number over a full period, from no lateral contraction to nearly incompressible.

use urlsph::{Scene, Simulation};

use crate::support::*;

const E: f64 = 1.7e7;
const DENSITY: f64 = 1100.0;
const LENGTH: f64 = 6.0;

/// A period of the column: bending follows Young's modulus, twisting the shear modulus, uniaxial
/// strain the modulus of pressure waves. Bending and twisting are scaled from the references at 0.3.
fn period(case: &str, nu: f64) -> f64 {
    match case {
        "column_bending" => 1.85,
        "column_twisting" => 0.34 * ((1.0 + nu) / 1.3).sqrt(),
        _ => {
            let modulus = E * (1.0 - nu) / ((1.0 + nu) * (1.0 - 2.0 * nu));
            // Large amplitude: the reference's period at 0.3 is 1.03 of the linear one.
            1.05 * 4.0 * LENGTH / (modulus / DENSITY).sqrt()
        }
    }
}

fn stable(case: &str, model: Model) {
    for nu in [0.0, 0.3, 0.45, 0.495] {
        let ratio = format!("material.neo_hookean.poisson_ratio={nu}");
        let mut simulation = column(case, model, &[&ratio]);
        let energy = simulation.energies();
        let initial = energy.kinetic + energy.strain;
        let end = period(case, nu);
        let (mut most, mut rise, mut before) = (0.0_f64, f64::NEG_INFINITY, 0.0);
        run(&mut simulation, end, |s| {
            let e = s.energies();
            assert!(e.closure_error.is_finite());
            most = most.max((e.kinetic + e.strain) / initial);
            rise = rise.max(e.closure_error / initial - before);
            before = e.closure_error / initial;
        });
        let e = simulation.energies();
        println!(
            "{case} {} nu = {nu}, {} steps to {end:.3} s: E {:.4} E0, dissipated {:.4}, closure {:+.1e}",
            model.0,
            simulation.steps(),
            (e.kinetic + e.strain) / initial,
            e.numerical_dissipation / initial,
            e.closure_error / initial,
        );
        let what = format!("{case} {} nu = {nu}", model.0);
        check(
            &format!("{what}: largest energy over E0 less 1"),
            most - 1.0,
            1e-9,
        );
        check(
            &format!("{what}: energy out of nothing in one step"),
            rise,
            1e-9,
        );
    }
}

#[test]
fn bending_is_stable() {
    stable("column_bending", M1);
    stable("column_bending", M2);
}

#[test]
fn twisting_is_stable() {
    stable("column_twisting", M1);
    stable("column_twisting", M2);
}

#[test]
fn tension_is_stable() {
    stable("column_tension", M1);
    stable("column_tension", M2);
}

/// A free block with velocities that differ from particle to particle: every wave that the particles
/// can carry, the shortest above all.
fn shaken(neighbours: u8, nu: f64, cfl: Option<f64>) -> Simulation {
    let cfl = cfl.map_or(String::new(), |cfl| format!(r#", "cfl": {cfl}"#));
    let text = format!(
        r#"{{"geometry": {{"box": {{"min": [0, 0, 0], "max": [1, 1, 1], "spacing": 0.125}}}},
        "material": {{"neo_hookean": {{"density": 1000, "youngs_modulus": 1e9, "poisson_ratio": {nu}}}}},
        "initial": {{"velocity": [
            "1e-3*sin(7919*X + 104729*Y*Y + 1299709*Z*Z*Z + 31*X*Z)",
            "1e-3*sin(6151*X*X + 7877*Y + 224737*Z*Z + 17*Y*X)",
            "1e-3*sin(3571*X*X*X + 49999*Y*Y + 611953*Z + 13*Z*Y)"]}},
        "numerics": {{"neighbours": {neighbours}{cfl}}},
        "time": {{"end": 1}}}}"#
    );
    let scene = Scene::from_json(&text, &[]).unwrap_or_else(|e| panic!("{e}"));
    Simulation::with_threads(scene, 1).unwrap_or_else(|e| panic!("{e}"))
}

/// The default bears a step that is a little larger.
#[test]
fn random_velocities_die_down_at_more_than_the_default_step() {
    const MARGIN: f64 = 1.05;
    println!("| neighbours | Poisson ratio | CFL | kinetic energy left |\n|---|---|---|---|");
    for neighbours in [6, 18, 26] {
        for nu in [-0.5, 0.0, 0.3, 0.495] {
            let cfl = MARGIN * shaken(neighbours, nu, None).cfl_number();
            let mut simulation = shaken(neighbours, nu, Some(cfl));
            let start = simulation.energies().kinetic;
            let end = 600.0 * simulation.stable_step();
            simulation
                .advance(end)
                .unwrap_or_else(|e| panic!("{neighbours} neighbours, nu = {nu}: {e}"));
            let left = simulation.energies().kinetic / start;
            println!("| {neighbours} | {nu} | {cfl:.3} | {left:.1e} |");
            check(
                &format!("{neighbours} neighbours, nu = {nu}: energy left"),
                left,
                0.1,
            );
        }
    }
}
