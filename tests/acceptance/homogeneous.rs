//! Homogeneous finite states of the Mie-Grueneisen solid: isentropic, restrained and free heating.

use urlsph::{Field, Simulation};

use crate::support::*;

const KAPPA: f64 = 9_807_700.0 + 2.0 / 3.0 * 6_538_500.0;
const C_V: f64 = 1000.0;
const GAMMA: f64 = 8.5889;
const THETA_R: f64 = 293.15;
const FACES: [&str; 6] = ["x_min", "x_max", "y_min", "y_max", "z_min", "z_max"];

/// Largest deviations over all particles: temperature and J over their values, pressure over a scale.
fn compare(what: &str, simulation: &Simulation, theta: f64, j: f64, (pressure, scale): (f64, f64)) {
    for (name, of, value, scale) in [
        ("temperature", Field::Temperature, theta, theta),
        ("J", Field::Jacobian, j, j),
        ("pressure", Field::Pressure, pressure, scale),
    ] {
        let worst = field(simulation, of)
            .into_iter()
            .fold(0.0, |worst: f64, v| worst.max((v - value).abs() / scale));
        check(&format!("homogeneous {what}: {name}"), worst, 1e-6);
    }
}

/// A heat per volume [J/m^3] within 1 s that starts and ends smoothly.
fn source(heat: f64) -> String {
    format!("heat.source=\"{heat:e}*heaviside(1 - t)*8/3*sin(pi*t)^4\"")
}

/// Faces that move apart at constant speeds: theta = theta_R exp(-Gamma_0 (J - 1)),
/// p = -kappa (J - 1) + c_v Gamma_0 (theta - theta_R), q = 1.
#[test]
fn isentropic_states() {
    for j in [0.9, 0.95, 0.98, 0.99, 1.01, 1.02, 1.05, 1.1_f64] {
        let end = 0.02;
        let rate = (j.cbrt() - 1.0) / end;
        let velocity = ["X", "Y", "Z"].map(|x| format!("\"{rate:e}*{x}\""));
        let mut overrides: Vec<String> = FACES
            .iter()
            .enumerate()
            .map(|(face, name)| {
                let mut free = ["null"; 3];
                free[face / 2] = &velocity[face / 2];
                format!("boundary.{name}={{\"velocity\": [{}]}}", free.join(", "))
            })
            .collect();
        overrides.push(format!("initial.velocity=[{}]", velocity.join(", ")));
        overrides.push("heat.source=0".into());
        let overrides: Vec<&str> = overrides.iter().map(String::as_str).collect();
        let mut simulation = simulation("homogeneous", &overrides);
        simulation.advance(end).expect("stable");
        let theta = THETA_R * (-GAMMA * (j - 1.0)).exp();
        let pressure = C_V * GAMMA * (theta - THETA_R) - KAPPA * (j - 1.0);
        let pressure = (pressure, pressure.abs());
        compare(
            &format!("isentropic J = {j}"),
            &simulation,
            theta,
            j,
            pressure,
        );
    }
}

/// All faces on rollers: p = c_v Gamma_0 times the rise of temperature.
#[test]
fn restrained_heating() {
    for rise in [10.0, 50.0, 100.0] {
        let mut overrides = FACES
            .map(|name| format!("boundary.{name}.support=roller"))
            .to_vec();
        overrides.push(source(C_V * rise));
        let overrides: Vec<&str> = overrides.iter().map(String::as_str).collect();
        let mut simulation = simulation("homogeneous", &overrides);
        simulation.advance(1.0).expect("stable");
        let pressure = C_V * GAMMA * rise;
        let what = format!("restrained, {rise} K");
        compare(
            &what,
            &simulation,
            THETA_R + rise,
            1.0,
            (pressure, pressure),
        );
    }
}

/// Heated slowly against nothing: J = 1 + c_v Gamma_0/kappa times the rise of temperature, and no
/// pressure. The heat is the rise of the internal energy, c_v (theta - theta_R) + kappa/2 (J - 1)^2 +
/// c_v theta_R Gamma_0 (J - 1).
#[test]
fn free_heating() {
    for rise in [10.0, 50.0, 100.0] {
        let strain = C_V * GAMMA * rise / KAPPA;
        let heat = C_V * rise + KAPPA / 2.0 * strain * strain + C_V * THETA_R * GAMMA * strain;
        let mut simulation = simulation("homogeneous", &[&source(heat)]);
        simulation.advance(1.2).expect("stable");
        let what = format!("free, {rise} K");
        let scale = C_V * GAMMA * rise;
        compare(
            &what,
            &simulation,
            THETA_R + rise,
            1.0 + strain,
            (0.0, scale),
        );
        let volume: f64 = 1.0;
        let supplied = simulation.energies().heat_in / volume;
        check(
            &format!("homogeneous {what}: heat"),
            (supplied / heat - 1.0).abs(),
            1e-6,
        );
    }
}
