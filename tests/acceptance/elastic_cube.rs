//! The swinging cube: small amplitude, exact solution of the linearised problem.

use std::f64::consts::PI;

use crate::cases::elastic_cube::{AMPLITUDE, Errors, omega};
use crate::support::*;

/// L2 errors at a time.
pub fn errors(nodes: usize, time: f64, amplitude: f64, overrides: &[&str]) -> Errors {
    let spacing = format!("geometry.box.spacing={}", 1.0 / (nodes - 1) as f64);
    let mut all = vec![spacing.as_str()];
    all.extend_from_slice(overrides);
    let mut simulation = simulation("elastic_cube", &all);
    simulation.advance(time).expect("stable");
    Errors::of(&simulation, amplitude)
}

/// Errors of four sizes; observed orders from n = 9 to 33 of velocity and stress.
fn orders(what: &str, time: f64, overrides: &[&str]) -> [f64; 2] {
    let found = [5, 9, 17, 33].map(|n| {
        let e = errors(n, time, AMPLITUDE, overrides);
        println!(
            "cube {what} t = {time} s, n = {n}: velocity {:.3e}, stress {:.3e}",
            e.velocity, e.stress
        );
        (1.0 / (n - 1) as f64, e)
    });
    let (coarse, fine) = (&found[1], &found[3]);
    [
        order((coarse.0, coarse.1.velocity), (fine.0, fine.1.velocity)),
        order((coarse.0, coarse.1.stress), (fine.0, fine.1.stress)),
    ]
}

fn second_order(what: &str, time: f64, overrides: &[&str]) {
    let [velocity, stress] = orders(what, time, overrides);
    check_at_least(
        &format!("cube {what} t = {time} s, order of velocity"),
        velocity,
        1.8,
    );
    check_at_least(
        &format!("cube {what} t = {time} s, order of stress"),
        stress,
        1.8,
    );
}

/// Half a period: the velocity error is the error of the phase.
#[test]
fn half_a_period_is_second_order() {
    second_order("18 neighbours", 8e-3, &[]);
}

/// Three eighths of a period: velocity and stress are both at 0.7 of their peaks.
#[test]
fn three_eighths_of_a_period_are_second_order() {
    second_order("18 neighbours", 0.75 * PI / omega(), &[]);
}

#[test]
fn six_neighbours_are_second_order() {
    second_order("6 neighbours", 8e-3, &["numerics.neighbours=6"]);
}

/// Neither nonlinearity nor round-off shows: the errors are those of the discretisation.
#[test]
fn errors_do_not_depend_on_the_amplitude() {
    let base = errors(17, 8e-3, AMPLITUDE, &[]);
    for factor in [0.1, 10.0] {
        let amplitude = factor * AMPLITUDE;
        let mode = |a, b, c| format!("\"{amplitude:e}*sin(pi*{a}/2)*cos(pi*{b}/2)*cos(pi*{c}/2)\"");
        let [x, y, z] = [
            mode("X", "Y", "Z"),
            mode("Y", "Z", "X"),
            mode("Z", "X", "Y"),
        ];
        let scaled = format!("initial.displacement=[{x}, {y}, {z}]");
        let found = errors(17, 8e-3, amplitude, &[&scaled]);
        let what = format!("cube, amplitude times {factor}: change of the error of");
        check(
            &format!("{what} velocity"),
            (found.velocity / base.velocity - 1.0).abs(),
            1e-3,
        );
        check(
            &format!("{what} stress"),
            (found.stress / base.stress - 1.0).abs(),
            1e-3,
        );
    }
}

/// Other phases and neighbour sets, for the record.
#[test]
#[ignore = "a table without tolerances: cargo xtask validate"]
fn orders_at_other_phases() {
    let mut rows = Vec::new();
    for neighbours in ["6", "18", "26"] {
        for time in [2e-3, 4e-3, 6e-3, 8e-3, 1e-2, 1.2e-2, 1.6e-2] {
            let set = format!("numerics.neighbours={neighbours}");
            let [velocity, stress] = orders(&format!("{neighbours} neighbours"), time, &[&set]);
            rows.push(format!(
                "| {neighbours} | {time} | {velocity:.2} | {stress:.2} |"
            ));
        }
    }
    println!("\n### elastic_cube: observed orders from n = 9 to 33\n");
    println!("| neighbours | time [s] | velocity | stress |\n|---|---|---|---|");
    println!("{}\n", rows.join("\n"));
}
