//! The cable under a step load ([URL23] 7.2): shocks against the square wave.

use urlsph::{Field, Result, Simulation};

use super::{Case, Meter, Quantity, Table, size};
use crate::common::field;

/// Step load [Pa]; also the velocity behind the first wave [m/s], with E = rho = 1.
pub const LOAD: f64 = 1e-3;
pub const LENGTH: f64 = 10.0;

/// The override of the scene that makes it a cable of so many cells along its length, 1 x 2 across.
pub fn lattice(cells: u32) -> String {
    let spacing = LENGTH / f64::from(cells);
    format!("geometry.box.spacing=[{spacing}, 1, 0.5]")
}

/// What a shock leaves behind, relative to the load: the velocity and the stress in the middle of the
/// cable over time.
pub struct Shock {
    /// Largest |v| in the middle, less the exact largest.
    pub overshoot: f64,
    /// Largest stress in the middle, less the exact largest.
    pub stress_overshoot: f64,
    /// Largest |v| of any particle at any time, less the exact largest.
    pub anywhere: f64,
    /// Mean of |v - exact| in the middle over the first half and over all of the history.
    pub l1: [f64; 2],
    /// The same of the stress over all of the history.
    pub stress_l1: f64,
}

/// The particle next to X on the edge Y = Z = 0.
fn on_the_edge(simulation: &Simulation, x: f64) -> usize {
    field(simulation, Field::InitialPosition)
        .chunks_exact(3)
        .position(|p| (p[0] - x).abs() < 1e-9 && p[1] == 0.0 && p[2] == 0.0)
        .expect("a particle")
}

impl Shock {
    pub fn measure(simulation: &mut Simulation, meter: &mut Meter, exact: &Table) -> Result<Self> {
        let middle = on_the_edge(simulation, 0.5 * LENGTH);
        let columns = ["probe.middle.velocity[1]", "stress"].map(|name| exact.column(name));
        let (v_exact, s_exact) = (columns[0], columns[1]);
        let most = |column: usize| {
            exact
                .samples(column)
                .fold(0.0_f64, |m, (_, value)| m.max(value.abs()))
        };
        let (mut v_most, mut s_most, mut anywhere) = (0.0_f64, 0.0_f64, 0.0_f64);
        let (mut half, mut whole, mut stress, mut before) = (0.0, 0.0, 0.0, 0.0);
        let end = exact.end();
        meter.run(simulation, end, |s| {
            let velocity = field(s, Field::Velocity);
            let (v, sigma) = (
                velocity[3 * middle],
                field(s, Field::CauchyStress)[9 * middle],
            );
            (v_most, s_most) = (v_most.max(v.abs()), s_most.max(sigma.abs()));
            anywhere = velocity.iter().fold(anywhere, |m, v| m.max(v.abs()));
            let (time, step) = (s.time(), s.time() - before);
            before = time;
            let error = step * (v - exact.at(v_exact, time)).abs();
            whole += error;
            if time <= 0.5 * end {
                half += error;
            }
            stress += step * (sigma - exact.at(s_exact, time)).abs();
        })?;
        Ok(Self {
            overshoot: (v_most - most(v_exact)) / LOAD,
            stress_overshoot: (s_most - most(s_exact)) / LOAD,
            anywhere: (anywhere - most(v_exact)) / LOAD,
            l1: [half / (0.5 * end * LOAD), whole / (end * LOAD)],
            stress_l1: stress / (end * LOAD),
        })
    }
}

pub const CASE: Case = Case {
    name: "cable",
    title: "Cable under a step load",
    example: "cable",
    sizes: &[
        size("306", 50),
        size("606", 100),
        size("1206", 200),
        size("2406", 400),
    ],
    swept: 4,
    leave_out: &["fast", "accurate"],
    reference: "exact square wave",
    quantities: &[
        Quantity {
            name: "velocity in the middle",
            over: "mean of |v - exact| over 40 s, over the velocity behind the wave",
            unstable_above: 1.0,
        },
        Quantity {
            name: "overshoot of the velocity",
            over: "largest |v| in the middle less the exact largest, over the velocity behind the wave",
            unstable_above: 1.0,
        },
    ],
    overrides: |size| vec![lattice(size.cells)],
    measure: |simulation, meter| {
        let shock = Shock::measure(simulation, meter, &Table::expected("cable"))?;
        Ok(vec![Some(shock.l1[1]), Some(shock.overshoot.abs())])
    },
    uncertainties: || vec![0.0; 2],
};
