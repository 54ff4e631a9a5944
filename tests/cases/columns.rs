//! Columns in bending, tension and twisting: histories of probes against `examples/*/expected.csv`.

use urlsph::{Result, Simulation};

use super::{Case, Meter, Quantity, Size, Table, displacement, largest, norm, size};

/// A scalar measured over time, with the column of the reference that it is compared with.
pub struct Signal {
    pub name: &'static str,
    measure: fn(&Simulation) -> f64,
}

/// What is compared of a column.
pub struct Column {
    /// Folder of the example.
    pub name: &'static str,
    /// One residual per group: the largest norm of the differences of its signals.
    pub groups: &'static [&'static [Signal]],
    /// End of the comparison [s].
    pub end: f64,
    /// Largest error of the reference, in the unit of the signals.
    uncertainty: f64,
}

pub const BENDING: Column = Column {
    name: "column_bending",
    groups: &[
        &[
            Signal {
                name: "probe.top_corner.displacement[1]",
                measure: |s| displacement(s, "top_corner")[0],
            },
            Signal {
                name: "probe.top_corner.displacement[2]",
                measure: |s| displacement(s, "top_corner")[1],
            },
            Signal {
                name: "probe.top_corner.displacement[3]",
                measure: |s| displacement(s, "top_corner")[2],
            },
        ],
        &[
            Signal {
                name: "probe.top_centre.displacement[1]",
                measure: |s| displacement(s, "top_centre")[0],
            },
            Signal {
                name: "probe.top_centre.displacement[2]",
                measure: |s| displacement(s, "top_centre")[1],
            },
            Signal {
                name: "probe.top_centre.displacement[3]",
                measure: |s| displacement(s, "top_centre")[2],
            },
        ],
    ],
    end: 0.6,
    uncertainty: 0.25e-3,
};

pub const TENSION: Column = Column {
    name: "column_tension",
    groups: &[&[Signal {
        name: "probe.top_centre.displacement[2]",
        measure: |s| displacement(s, "top_centre")[1],
    }]],
    end: 0.12,
    uncertainty: 0.5e-3,
};

pub const TWISTING: Column = Column {
    name: "column_twisting",
    groups: &[&[Signal {
        name: "angle_deg",
        measure: top_corner_angle,
    }]],
    end: 0.1,
    uncertainty: 0.14,
};

/// Angle of the top corner about Y [degrees] in (-180, 180], 0 at the start.
fn top_corner_angle(simulation: &Simulation) -> f64 {
    let u = displacement(simulation, "top_corner");
    let angle = (0.5 + u[0]).atan2(0.5 + u[2]).to_degrees() - 45.0;
    if angle > -180.0 { angle } else { angle + 360.0 }
}

/// Signals of one model over time: rows of time and values.
pub struct History(pub Vec<Vec<f64>>);

impl Column {
    fn signals(&self) -> impl Iterator<Item = &'static Signal> {
        self.groups.iter().copied().flatten()
    }

    /// The signals after every step to `end`.
    pub fn history(
        &self,
        simulation: &mut Simulation,
        meter: &mut Meter,
        end: f64,
        mut after: impl FnMut(&Simulation),
    ) -> Result<History> {
        let mut rows: Vec<Vec<f64>> = Vec::new();
        meter.run(simulation, end, |s| {
            let mut row = vec![s.time()];
            for (i, signal) in self.signals().enumerate() {
                let mut value = (signal.measure)(s);
                if signal.name.starts_with("angle") {
                    // A step turns the corner by degrees: the nearest branch continues the angle.
                    let before = rows.last().map_or(0.0, |r| r[i + 1]);
                    value += 360.0 * ((before - value) / 360.0).round();
                }
                row.push(value);
            }
            rows.push(row);
            after(s);
        })?;
        Ok(History(rows))
    }

    /// Per group, the largest value of the reference in the time of the comparison.
    fn scales(&self, reference: &Table) -> Vec<f64> {
        let scale = |group: &&'static [Signal]| {
            let columns: Vec<usize> = group.iter().map(|s| reference.column(s.name)).collect();
            let rows = reference.rows.iter().filter(|row| row[0] <= self.end);
            let size = |row: &Vec<f64>| norm(&columns.iter().map(|&c| row[c]).collect::<Vec<_>>());
            rows.map(size).fold(0.0, f64::max)
        };
        self.groups.iter().map(scale).collect()
    }

    /// Per group, the largest distance from the reference over the largest value of the reference.
    pub fn residuals(&self, history: &History, reference: &Table) -> Vec<f64> {
        let mut first = 1;
        let distance = |group: &&'static [Signal]| {
            let columns: Vec<usize> = group.iter().map(|s| reference.column(s.name)).collect();
            let values = first..first + columns.len();
            first = values.end;
            let distance = |row: &Vec<f64>| {
                let pairs = row[values.clone()].iter().zip(&columns);
                let difference = pairs.map(|(value, &c)| value - reference.at(c, row[0]));
                norm(&difference.collect::<Vec<_>>())
            };
            largest(history.0.iter().map(distance))
        };
        let distances = self.groups.iter().map(distance);
        distances
            .zip(self.scales(reference))
            .map(|(distance, scale)| distance / scale)
            .collect()
    }

    fn measure(&self, simulation: &mut Simulation, meter: &mut Meter) -> Result<Vec<Option<f64>>> {
        let history = self.history(simulation, meter, self.end, |_| ())?;
        let residuals = self.residuals(&history, &Table::expected(self.name));
        Ok(residuals.into_iter().map(Some).collect())
    }

    /// Of the reference, in the measure of the residuals.
    fn uncertainties(&self) -> Vec<f64> {
        let scales = self.scales(&Table::expected(self.name));
        scales.iter().map(|s| self.uncertainty / s).collect()
    }
}

/// M1 to M4.
const SIZES: &[Size] = &[size("M1", 4), size("M2", 6), size("M3", 8), size("M4", 16)];

fn spacing(size: &Size) -> Vec<String> {
    vec![format!(
        "geometry.box.spacing={}",
        1.0 / f64::from(size.cells)
    )]
}

const SPECTRAL: &str = "spectral elements of order 4 (4 x 24 x 4), without damping";

pub const BENDING_CASE: Case = Case {
    name: "bending",
    title: "Bending column",
    example: BENDING.name,
    sizes: SIZES,
    swept: 3,
    leave_out: &[],
    reference: SPECTRAL,
    quantities: &[
        Quantity {
            name: "displacement of the top corner",
            over: "largest distance to the reference up to 0.6 s, over the largest displacement",
            unstable_above: 1.0,
        },
        Quantity {
            name: "displacement of the top centre",
            over: "largest distance to the reference up to 0.6 s, over the largest displacement",
            unstable_above: 1.0,
        },
    ],
    overrides: spacing,
    measure: |simulation, meter| BENDING.measure(simulation, meter),
    uncertainties: || BENDING.uncertainties(),
};

pub const TENSION_CASE: Case = Case {
    name: "tension",
    title: "Column in tension",
    example: TENSION.name,
    swept: 4,
    reference: "one-dimensional finite volumes, 2,000 cells",
    quantities: &[Quantity {
        name: "displacement of the top",
        over: "largest distance to the reference up to 0.12 s, over the largest displacement",
        unstable_above: 1.0,
    }],
    measure: |simulation, meter| TENSION.measure(simulation, meter),
    uncertainties: || TENSION.uncertainties(),
    ..BENDING_CASE
};

pub const TWISTING_CASE: Case = Case {
    name: "twisting",
    title: "Twisting column",
    example: TWISTING.name,
    swept: 4,
    quantities: &[Quantity {
        name: "angle of the top corner",
        over: "largest distance to the reference up to 0.1 s, over the largest angle",
        unstable_above: 1.0,
    }],
    measure: |simulation, meter| TWISTING.measure(simulation, meter),
    uncertainties: || TWISTING.uncertainties(),
    ..BENDING_CASE
};
