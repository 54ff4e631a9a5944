//! A slab heated by a flux on one side: exact series.

use std::f64::consts::PI;

use urlsph::{Field, Result, Simulation};

use super::{Case, Meter, Quantity, largest, size};
use crate::common::field;

/// Diffusivity of the scene [m^2/s]; the slab is 1 m thick.
const DIFFUSIVITY: f64 = 20.0;
pub const CONDUCTIVITY: f64 = 20_000.0;
const FLUX: f64 = 2e6;
pub const COLD: f64 = 293.15;

/// Times h t/(c_v L^2) of the comparison.
pub const TAUS: [f64; 4] = [0.05, 0.1, 0.2, 0.5];

/// (theta - theta_0) h/(q_0 L) at xi = x/L, tau = h t/(c_v L^2) of a slab that is heated at xi = 0
/// and insulated at xi = 1.
fn series(xi: f64, tau: f64) -> f64 {
    let term = |n: f64| (-(n * PI).powi(2) * tau).exp() * (n * PI * xi).cos() / (n * n);
    let sum: f64 = (1..100).map(|n| term(f64::from(n))).sum();
    tau + (3.0 * (1.0 - xi).powi(2) - 1.0) / 6.0 - 2.0 / PI.powi(2) * sum
}

/// Temperature of the heated slab [K].
pub fn heated(xi: f64, tau: f64) -> f64 {
    COLD + rise_at(xi, tau)
}

/// Its surface's rise of temperature [K].
pub fn rise(tau: f64) -> f64 {
    rise_at(0.0, tau)
}

fn rise_at(xi: f64, tau: f64) -> f64 {
    FLUX / CONDUCTIVITY * series(xi, tau)
}

/// The override of the scene that makes it a slab of so many cells, and of one across.
pub fn lattice(cells: u32) -> String {
    let spacing = 1.0 / f64::from(cells);
    format!(
        "geometry.box={{\"min\": [0, 0, 0], \"max\": [1, {spacing}, {spacing}], \"spacing\": {spacing}}}"
    )
}

/// Largest errors over the slab at times tau [K].
pub fn errors(
    simulation: &mut Simulation,
    meter: &mut Meter,
    taus: &[f64],
    exact: impl Fn(f64, f64) -> f64,
) -> Result<Vec<f64>> {
    let positions = field(simulation, Field::InitialPosition);
    let mut errors = Vec::new();
    for tau in taus {
        meter.advance(simulation, tau / DIFFUSIVITY)?;
        let temperatures = field(simulation, Field::Temperature);
        let distances = std::iter::zip(positions.chunks_exact(3), temperatures)
            .map(|(x, theta)| (theta - exact(x[0], *tau)).abs());
        errors.push(largest(distances));
    }
    Ok(errors)
}

pub const CASE: Case = Case {
    name: "slab",
    title: "Heated slab",
    example: "slab_heating",
    sizes: &[
        size("11", 10),
        size("21", 20),
        size("41", 40),
        size("81", 80),
    ],
    swept: 4,
    leave_out: &["heat", "no heat"],
    reference: "exact series",
    quantities: &[Quantity {
        name: "temperature",
        over: "largest error over the slab and four times, over the rise at the surface then",
        unstable_above: 1.0,
    }],
    overrides: |size| vec![lattice(size.cells)],
    measure: |simulation, meter| {
        let errors = errors(simulation, meter, &TAUS, heated)?;
        let relative = errors
            .iter()
            .zip(TAUS)
            .map(|(error, tau)| error / rise(tau));
        Ok(vec![Some(largest(relative))])
    },
    uncertainties: || vec![0.0],
};
