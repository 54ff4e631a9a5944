//! The default CFL number over a full period, from no lateral contraction to nearly incompressible.

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
