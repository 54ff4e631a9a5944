//! A slab heated by a flux, or cooled by convection, on one side: exact series.

use std::f64::consts::PI;

use urlsph::{Field, Simulation};

use crate::cases::largest;
use crate::cases::slab::{self, COLD, CONDUCTIVITY, TAUS, heated, lattice, rise};
use crate::support::*;

const HOT: f64 = 393.15;

/// (theta - theta_ambient)/(theta_0 - theta_ambient) of a slab that loses heat at xi = 0: separation of
/// variables leaves cos(zeta (1 - xi)) with zeta tan zeta = Bi, one root in each (n pi, n pi + pi/2), and
/// a uniform start has the coefficients 4 sin zeta/(2 zeta + sin 2 zeta).
fn cooled(zetas: &[f64], xi: f64, tau: f64) -> f64 {
    let term = |z: &f64| {
        let coefficient = 4.0 * z.sin() / (2.0 * z + (2.0 * z).sin());
        coefficient * (-z * z * tau).exp() * (z * (1.0 - xi)).cos()
    };
    zetas.iter().map(term).sum()
}

fn roots(biot: f64) -> Vec<f64> {
    let root = |n: i32| {
        let (mut low, mut high) = (f64::from(n) * PI, (f64::from(n) + 0.5) * PI);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            *(if middle * middle.tan() < biot {
                &mut low
            } else {
                &mut high
            }) = middle;
        }
        0.5 * (low + high)
    };
    (0..50).map(root).collect()
}

/// Largest errors over the slab at times tau.
fn errors(
    cells: u32,
    overrides: &[&str],
    taus: &[f64],
    exact: impl Fn(f64, f64) -> f64,
) -> Vec<f64> {
    let lattice = lattice(cells);
    let mut all = vec![lattice.as_str()];
    all.extend_from_slice(overrides);
    let mut simulation = simulation("slab_heating", &all);
    slab::errors(&mut simulation, &mut Meter::default(), taus, exact).expect("stable")
}

/// Errors with 41 particles over `scale(tau)` below a tolerance, and second order from 21.
fn second_order(
    what: &str,
    overrides: &[&str],
    exact: impl Fn(f64, f64) -> f64,
    scale: impl Fn(f64) -> f64,
    tolerance: f64,
) {
    let coarse = errors(20, overrides, &TAUS, &exact);
    let fine = errors(40, overrides, &TAUS, &exact);
    for (i, tau) in TAUS.into_iter().enumerate() {
        let what = format!("slab {what} tau = {tau}");
        check(&what, fine[i] / scale(tau), tolerance);
        let order = order((2.0, coarse[i]), (1.0, fine[i]));
        check_at_least(&format!("{what}, order"), order, 1.9);
    }
}

/// Within 1 % of the surface's rise of temperature, 63 K at tau = 0.05 and 208 K at 0.5.
#[test]
fn heat_flux() {
    for neighbours in ["6", "18"] {
        let set = format!("numerics.neighbours={neighbours}");
        let what = format!("heated, {neighbours} neighbours,");
        second_order(&what, &[&set], heated, rise, 0.01);
    }
}

#[test]
fn convection() {
    for biot in [0.5, 5.0, 50.0] {
        let condition = format!(
            "boundary.x_min={{\"convection\": {{\"coefficient\": {}, \"ambient_temperature\": {COLD}}}}}",
            biot * CONDUCTIVITY
        );
        let start = format!("initial.temperature={HOT}");
        let zetas = roots(biot);
        let exact = |xi, tau| COLD + (HOT - COLD) * cooled(&zetas, xi, tau);
        let what = format!("cooled, Bi = {biot},");
        second_order(&what, &[&condition, &start], exact, |_| HOT - COLD, 0.002);
    }
}

/// Convection that settles the step itself, with a coefficient a thousand times the conductance of a cell.
#[test]
fn convection_of_any_strength_is_stable() {
    let condition = format!(
        "boundary.x_min={{\"convection\": {{\"coefficient\": {}, \"ambient_temperature\": {COLD}}}}}",
        2e4 * CONDUCTIVITY
    );
    let mut simulation = simulation(
        "slab_heating",
        &[
            &condition,
            "initial.temperature=393.15",
            "geometry.box.spacing=0.05",
            "geometry.box.max=[1, 0.05, 0.05]",
        ],
    );
    simulation.advance(1e-4).expect("stable");
    let temperatures = field(&simulation, Field::Temperature);
    let [least, most] = [f64::min, f64::max].map(|f| temperatures.iter().copied().fold(350.0, f));
    check(
        "slab, strong convection: below the surroundings",
        COLD - least,
        1e-9,
    );
    check("slab, strong convection: above the start", most - HOT, 1e-9);
}

/// Temperatures that alternate from particle to particle die out with the step that is taken by itself, also in
/// bodies of one cell from side to side, whose ends' gradients follow one and the same difference.
#[test]
fn alternating_temperatures_die_out() {
    let bodies = [
        ("bar of 2 x 2 rows", "[1, 0.025, 0.025]", ""),
        ("cube of 2^3 particles", "[0.025, 0.025, 0.025]", ""),
        ("plate of two layers", "[0.2, 0.2, 0.025]", ""),
        ("block of 9^3 particles", "[0.2, 0.2, 0.2]", ""),
        (
            "block with 20 % jitter",
            "[0.2, 0.2, 0.2]",
            "{\"fraction\": 0.2}",
        ),
    ];
    let alternating = |axis: char| format!("cos(pi*{axis}/0.025)");
    let [x, y, z] = ['X', 'Y', 'Z'].map(alternating);
    let start = format!("initial.temperature=293.15 + 1e-3*({x}*{y}*{z} + {y}*{z} + {z})");
    for (name, max, jitter) in bodies {
        for neighbours in [6, 18, 26] {
            let mut overrides = vec![
                format!("geometry.box.max={max}"),
                format!("numerics.neighbours={neighbours}"),
                "boundary.x_min.heat_flux=0".to_string(),
                "probes={}".to_string(),
                start.clone(),
            ];
            if !jitter.is_empty() {
                overrides.push(format!("geometry.box.jitter={jitter}"));
            }
            let overrides: Vec<&str> = overrides.iter().map(String::as_str).collect();
            let mut simulation = simulation("slab_heating", &overrides);
            let spread = |simulation: &Simulation| {
                let theta = field(simulation, Field::Temperature);
                let mean = theta.iter().sum::<f64>() / theta.len() as f64;
                largest(theta.iter().map(|t| (t - mean).abs()))
            };
            let (first, mut last) = (spread(&simulation), f64::INFINITY);
            // Where most of the decay is over, and a mode that grows has had time to.
            run(&mut simulation, 5e-3, |s| last = spread(s));
            check(
                &format!("{name}, {neighbours} neighbours: temperatures over those at the start"),
                last / first,
                1e-3,
            );
        }
    }
}
