//! The swinging cube: small amplitude, exact solution of the linearised problem.

use std::f64::consts::PI;

use urlsph::{Field, Simulation};

use super::{Case, Quantity, size};
use crate::common::field;

const DENSITY: f64 = 1100.0;
const MU: f64 = 6_538_500.0;
const LAMBDA: f64 = 9_807_700.0;
pub const AMPLITUDE: f64 = 5e-7;

/// Angular frequency: each component solves the wave equation with the pressure wave speed.
pub fn omega() -> f64 {
    0.75_f64.sqrt() * PI * ((LAMBDA + 2.0 * MU) / DENSITY).sqrt()
}

/// Mode shape u = (s c c, c s c, c c s), s and c of pi X_i / 2.
pub fn shape(x: &[f64]) -> [f64; 3] {
    let [s, c] = [f64::sin, f64::cos].map(|f| [0, 1, 2].map(|i| f(0.5 * PI * x[i])));
    [s[0] * c[1] * c[2], c[0] * s[1] * c[2], c[0] * c[1] * s[2]]
}

/// Its gradient.
pub fn gradient(x: &[f64]) -> [[f64; 3]; 3] {
    let k = 0.5 * PI;
    let s: Vec<f64> = x.iter().map(|x| (k * x).sin()).collect();
    let c: Vec<f64> = x.iter().map(|x| (k * x).cos()).collect();
    std::array::from_fn(|i| {
        std::array::from_fn(|j| {
            let others =
                |a: usize, b: usize| (0..3).filter(move |&m| m != a && m != b).map(|m| c[m]);
            if i == j {
                k * c.iter().product::<f64>()
            } else {
                -k * s[i] * s[j] * others(i, j).product::<f64>()
            }
        })
    })
}

/// Errors of velocity and Cauchy stress.
pub struct Errors {
    pub velocity: f64,
    pub stress: f64,
}

impl Errors {
    /// L2 errors now. They are relative to the largest norm over a period, not to the present
    /// one: at t = 8e-3 s, half a period, the exact velocity is nearly zero.
    pub fn of(simulation: &Simulation, amplitude: f64) -> Self {
        let volume = field(simulation, Field::InitialVolume);
        let positions = field(simulation, Field::InitialPosition);
        let velocity = field(simulation, Field::Velocity);
        let stress = field(simulation, Field::CauchyStress);
        let phase = omega() * simulation.time();
        let mut sums = [[0.0; 2]; 2];
        for (a, x) in positions.chunks_exact(3).enumerate() {
            let (shape, g) = (shape(x), gradient(x));
            let trace = g[0][0] + g[1][1] + g[2][2];
            for i in 0..3 {
                let peak = amplitude * omega() * shape[i];
                sums[0][0] += volume[a] * (velocity[3 * a + i] + phase.sin() * peak).powi(2);
                sums[0][1] += volume[a] * peak.powi(2);
                for j in 0..3 {
                    let dilation = if i == j { LAMBDA * trace } else { 0.0 };
                    let peak = amplitude * (MU * (g[i][j] + g[j][i]) + dilation);
                    let value = stress[9 * a + 3 * i + j];
                    sums[1][0] += volume[a] * (value - phase.cos() * peak).powi(2);
                    sums[1][1] += volume[a] * peak.powi(2);
                }
            }
        }
        let [velocity, stress] = sums.map(|[error, scale]| (error / scale).sqrt());
        Self { velocity, stress }
    }
}

pub const CASE: Case = Case {
    name: "elastic-cube",
    title: "Swinging elastic cube",
    example: "elastic_cube",
    sizes: &[size("5", 4), size("9", 8), size("17", 16), size("33", 32)],
    swept: 4,
    leave_out: &[],
    reference: "exact solution of the linearised problem",
    quantities: &[
        Quantity {
            name: "velocity",
            over: "L2 error after half a period, over the largest norm of a period",
            unstable_above: 1.0,
        },
        Quantity {
            name: "stress",
            over: "L2 error after half a period, over the largest norm of a period",
            unstable_above: 1.0,
        },
    ],
    overrides: |size| {
        let spacing = 1.0 / f64::from(size.cells);
        vec![format!("geometry.box.spacing={spacing}")]
    },
    measure: |simulation, meter| {
        meter.advance(simulation, 8e-3)?;
        let Errors { velocity, stress } = Errors::of(simulation, AMPLITUDE);
        Ok(vec![Some(velocity), Some(stress)])
    },
    uncertainties: || vec![0.0; 2],
};
