//! Momenta, dissipation and the ledger.

use urlsph::{Energies, Simulation};

use crate::support::*;

/// What the L-block conserves.
struct Drift {
    /// Largest linear momentum over the sum of |m v|.
    linear: f64,
    /// Largest change of the angular momentum after loading, relative.
    angular: f64,
    particles: usize,
}

/// Runs the L-block; after 5 s nothing acts on it.
fn l_block(overrides: &[&str]) -> Drift {
    let mut simulation = simulation("l_block", overrides);
    let mut drift = Drift {
        linear: 0.0,
        angular: 0.0,
        particles: simulation.particle_count(),
    };
    let end = simulation.scene().time.end;
    run(&mut simulation, 5.0, |s| {
        drift.linear = drift.linear.max(linear(s))
    });
    let start = simulation.momenta().angular;
    run(&mut simulation, end, |s| {
        drift.linear = drift.linear.max(linear(s));
        let now = s.momenta().angular;
        let change = norm(&[now[0] - start[0], now[1] - start[1], now[2] - start[2]]);
        drift.angular = drift.angular.max(change / norm(&start));
    });
    drift
}

/// Linear momentum relative to the momentum of a rigid body of this kinetic energy.
fn linear(simulation: &Simulation) -> f64 {
    let mass = 1100.0 * 153.0;
    let scale = (2.0 * mass * simulation.energies().kinetic).sqrt();
    norm(&simulation.momenta().linear) / scale
}

#[test]
fn l_block_conserves_momenta() {
    let on = l_block(&[]);
    assert_eq!(on.particles, 828);
    check("l_block linear momentum, projection on", on.linear, 1e-12);
    check(
        "l_block drift of angular momentum, projection on",
        on.angular,
        1e-12,
    );
    let off = l_block(&["numerics.angular_momentum_projection=false"]);
    check("l_block linear momentum, projection off", off.linear, 1e-12);
    println!(
        "l_block drift of angular momentum, projection off: {:.3e}",
        off.angular
    );
    assert!(
        off.angular > 1e-9,
        "without the projection it is not conserved"
    );
}

/// Energies at the end, the smallest dissipation of a step and the largest closure error, relative to E0.
struct Ledger {
    end: Energies,
    initial: f64,
    least: f64,
    closure: f64,
}

fn ledger(mut simulation: Simulation, end: f64) -> Ledger {
    let start = simulation.energies();
    let initial = start.kinetic + start.strain;
    let mut before = start.numerical_dissipation;
    let mut ledger = Ledger {
        end: start,
        initial,
        least: f64::INFINITY,
        closure: 0.0,
    };
    run(&mut simulation, end, |s| {
        let now = s.energies();
        ledger.least = ledger
            .least
            .min((now.numerical_dissipation - before) / initial);
        ledger.closure = ledger.closure.max(now.closure_error.abs() / initial);
        before = now.numerical_dissipation;
        ledger.end = now;
    });
    ledger
}

#[test]
fn dissipation_is_positive_and_falls_with_refinement() {
    for (case, end) in [
        ("column_bending", 0.6),
        ("column_twisting", 0.1),
        ("column_tension", 0.12),
    ] {
        let losses = [M1, M2, M3].map(|model| {
            let found = ledger(column(case, model, &[]), end);
            let loss = found.end.numerical_dissipation / found.initial;
            println!(
                "{case} {}: dissipated {loss:.4e} E0, least in a step {:.2e}, closure {:.2e}",
                model.0, found.least, found.closure
            );
            check(
                &format!("{case} {} negative dissipation of a step", model.0),
                -found.least,
                0.0,
            );
            loss
        });
        println!(
            "{case}: dissipation falls at order {:.2} from M1 to M3",
            order((M1.1, losses[0]), (M3.1, losses[2]))
        );
        assert!(
            losses[0] > losses[1] && losses[1] > losses[2],
            "{case}: {losses:?}"
        );
    }
}

/// The ledger's error is what the time integrator dissipates, of third order in the step: a mode of
/// frequency w loses (w dt)^4 / 12 of its energy in a step.
fn closure(case: &str, end: f64, model: Model, tolerance: f64, tolerance_half: f64) {
    let [whole, half] = ["0.3", "0.15"].map(|cfl| {
        let cfl = format!("numerics.cfl={cfl}");
        ledger(column(case, model, &[&cfl]), end).closure
    });
    check(
        &format!("{case} {} closure at CFL 0.3", model.0),
        whole,
        tolerance,
    );
    check(
        &format!("{case} {} closure at CFL 0.15", model.0),
        half,
        tolerance_half,
    );
    let what = format!("{case} {} order of the closure in the step", model.0);
    check_at_least(&what, order((2.0, whole), (1.0, half)), 2.8);
}

/// An error of 1e-6 at CFL 0.3 is not reached by these models: the initial velocities excite the
/// shortest waves at the clamped end, and the integrator shares in their dissipation. It is reached
/// at CFL 0.15, or by the finest model (`ledger_of_the_finest_model`).
#[test]
fn ledger_closes_at_third_order() {
    closure("column_bending", 0.6, M1, 1e-5, 2e-6);
    closure("column_bending", 0.6, M2, 1e-5, 1e-6);
    closure("column_bending", 0.6, M3, 1e-5, 1e-6);
    closure("column_tension", 0.12, M1, 2e-5, 2e-6);
    closure("column_tension", 0.12, M2, 1e-5, 1e-6);
    closure("column_tension", 0.12, M3, 5e-6, 1e-6);
    // Degrees of turn in every step.
    closure("column_twisting", 0.1, M1, 2e-3, 3e-4);
    closure("column_twisting", 0.1, M2, 1e-3, 1e-4);
    closure("column_twisting", 0.1, M3, 5e-4, 5e-5);
}

#[test]
#[ignore = "28,000 particles: cargo xtask validate"]
fn ledger_of_the_finest_model() {
    let mut rows = Vec::new();
    for (case, end, tolerance) in [
        ("column_tension", 0.12, 1e-6),
        ("column_bending", 0.6, 1.2e-6),
    ] {
        let found = ledger(column(case, M4, &["numerics.cfl=0.3"]), end);
        check(
            &format!("{case} M4 closure at CFL 0.3"),
            found.closure,
            tolerance,
        );
        rows.push(format!(
            "| {case} | {:.2e} | {tolerance:.1e} |",
            found.closure
        ));
    }
    println!("\n### Largest error of the ledger, M4 at CFL 0.3, over the initial energy\n");
    println!(
        "| case | error | tolerance |\n|---|---|---|\n{}\n",
        rows.join("\n")
    );
}
