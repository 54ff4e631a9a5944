//! The swinging cube with heat ([URL23] 7.1): linear thermo-elasticity, exact solution.

use std::f64::consts::PI;

use urlsph::Field;

use crate::cases::elastic_cube::{gradient, shape};
use crate::support::*;

const DENSITY: f64 = 1100.0;
const MU: f64 = 6_538_500.0;
const LAMBDA: f64 = 9_807_700.0;
const AMPLITUDE: f64 = 5e-4;
const THETA_R: f64 = 293.15;
const GAMMA: f64 = 8.5889;
/// rho_R C_v [J/(m^3 K)].
const C_V: f64 = 1100.0;

/// Angular frequency beta pi ([URL23] 82): the adiabatic wave modulus is lambda + 2 mu + theta_R Gamma_0^2 c_v.
fn omega() -> f64 {
    let modulus = LAMBDA + 2.0 * MU + THETA_R * GAMMA * GAMMA * C_V;
    0.75_f64.sqrt() * PI * (modulus / DENSITY).sqrt()
}

/// L2 errors of velocity, stress and temperature over their largest norms in a period. The stress of the
/// linear law is the first Piola-Kirchhoff stress; Cauchy's differs from it by the strain, 8e-4.
fn errors(nodes: usize, time: f64, overrides: &[&str]) -> [f64; 3] {
    let spacing = format!("geometry.box.spacing={}", 1.0 / (nodes - 1) as f64);
    let mut all = vec![spacing.as_str()];
    all.extend_from_slice(overrides);
    let mut simulation = simulation("swinging_cube", &all);
    simulation.advance(time).expect("stable");
    let volume = field(&simulation, Field::InitialVolume);
    let positions = field(&simulation, Field::InitialPosition);
    let velocity = field(&simulation, Field::Velocity);
    let stress = field(&simulation, Field::FirstPiolaStress);
    let temperature = field(&simulation, Field::Temperature);
    let (sin, cos) = (omega() * time).sin_cos();
    let mut sums = [[0.0; 2]; 3];
    let mut add = |quantity: usize, weight: f64, value: f64, peak: f64, phase: f64| {
        sums[quantity][0] += weight * (value - phase * peak).powi(2);
        sums[quantity][1] += weight * peak.powi(2);
    };
    for (a, x) in positions.chunks_exact(3).enumerate() {
        let (u, g) = (shape(x), gradient(x));
        let trace = g[0][0] + g[1][1] + g[2][2];
        // Isentropic: theta - theta_R = -theta_R Gamma_0 div u ([URL23] 81).
        let warming = -THETA_R * GAMMA * AMPLITUDE * trace;
        add(2, volume[a], temperature[a] - THETA_R, warming, cos);
        for i in 0..3 {
            add(
                0,
                volume[a],
                velocity[3 * a + i],
                AMPLITUDE * omega() * u[i],
                -sin,
            );
            for j in 0..3 {
                let mut peak = AMPLITUDE * MU * (g[i][j] + g[j][i]);
                if i == j {
                    peak += AMPLITUDE * LAMBDA * trace - C_V * GAMMA * warming;
                }
                add(1, volume[a], stress[9 * a + 3 * i + j], peak, cos);
            }
        }
    }
    sums.map(|[error, scale]| (error / scale).sqrt())
}

/// Observed orders from n = 9 to 33.
fn orders(what: &str, time: f64, overrides: &[&str]) -> [f64; 3] {
    let found = [5, 9, 17, 33].map(|n| {
        let [velocity, stress, temperature] = errors(n, time, overrides);
        println!(
            "swinging_cube {what} t = {time} s, n = {n}: velocity {velocity:.3e}, stress {stress:.3e}, \
             temperature {temperature:.3e}"
        );
        [velocity, stress, temperature]
    });
    std::array::from_fn(|q| order((1.0 / 8.0, found[1][q]), (1.0 / 32.0, found[3][q])))
}

fn second_order(time: f64) {
    let found = orders("6 neighbours", time, &[]);
    for (name, order) in std::iter::zip(["velocity", "stress", "temperature"], found) {
        check_at_least(
            &format!("swinging_cube t = {time} s, order of {name}"),
            order,
            1.8,
        );
    }
}

/// The time of [URL23] figure 1, three steps of 9 particles per edge.
#[test]
fn second_order_at_the_start() {
    second_order(8e-4);
}

/// Seven tenths of a period.
#[test]
fn second_order_later() {
    second_order(8e-3);
}

/// Other phases, neighbour sets and the discrete initial gradient, for the record.
#[test]
#[ignore = "a table without tolerances: cargo xtask validate"]
fn orders_at_other_phases() {
    println!("\n### swinging_cube: observed orders from n = 9 to 33\n");
    println!("| neighbours | initial gradient | time [s] | velocity | stress | temperature |");
    let mut rows = String::from("|---|---|---|---|---|---|\n");
    for neighbours in ["6", "18", "26"] {
        for gradient in ["exact", "discrete"] {
            for time in [8e-4, 4e-3, 8e-3, 1.2e-2] {
                let set = [
                    format!("numerics.neighbours={neighbours}"),
                    format!("initial.gradient={gradient}"),
                ];
                let what = format!("{neighbours} neighbours, {gradient}");
                let [v, s, t] = orders(&what, time, &[&set[0], &set[1]]);
                rows +=
                    &format!("| {neighbours} | {gradient} | {time} | {v:.2} | {s:.2} | {t:.2} |\n");
            }
        }
    }
    println!("{rows}");
}
