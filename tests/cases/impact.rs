//! Copper bars on a rigid wall: radius, length and temperature after the impact.

use urlsph::{Result, Simulation};

use super::{Case, Meter, Quantity, Size, Table, displacement, size};

/// Cells of a quarter cylinder.
#[derive(Debug, Clone, Copy)]
pub struct Bar {
    divisions: u32,
    layers: u32,
}

impl Bar {
    pub const fn new(divisions: u32, layers: u32) -> Self {
        Self { divisions, layers }
    }

    /// The bars of the paper have 41, 60 and 79 layers for 3, 4 and 5 divisions.
    pub const fn of_the_paper(divisions: u32) -> Self {
        Self::new(divisions, 19 * divisions - 16)
    }

    pub fn particles(self) -> usize {
        let section = 3 * self.divisions * (self.divisions + 1) + 1;
        (section * (self.layers + 1)) as usize
    }

    pub fn overrides(self) -> Vec<String> {
        vec![
            format!("geometry.cylinder.divisions={}", self.divisions),
            format!("geometry.cylinder.layers={}", self.layers),
        ]
    }
}

/// What is read off a bar that hits a plane.
#[derive(Debug, Clone, Copy)]
pub struct Impact {
    /// Time [s].
    pub time: f64,
    /// Radius of the foot at the probe `rim` [m].
    pub radius: f64,
    /// Height of the top of the axis above the plane [m].
    pub height: f64,
    /// Height of the top of the axis above its foot [m].
    pub length: f64,
    /// Height of the rim above the plane [m].
    pub lift: f64,
    /// Temperature of the probe `inside` [K], where there is one.
    pub inside: Option<f64>,
}

impl Impact {
    pub fn of(s: &Simulation) -> Self {
        let probes = &s.scene().probes;
        let (rim, top) = (displacement(s, "rim"), displacement(s, "top"));
        let height = probes["top"][2] + top[2];
        Self {
            time: s.time(),
            radius: probes["rim"][0] + rim[0],
            height,
            length: height - displacement(s, "foot")[2],
            lift: rim[2],
            inside: (s.probe_names().iter().position(|n| n == "inside"))
                .and_then(|probe| s.probe(probe).temperature),
        }
    }

    /// Signed relative errors of radius and height against columns of the reference.
    pub fn errors(&self, reference: &Table, columns: [&str; 2]) -> [f64; 2] {
        let [radius, height] = columns.map(|name| reference.at(reference.column(name), self.time));
        [self.radius / radius - 1.0, self.height / height - 1.0]
    }
}

/// Columns of the reference for a wall that lets go.
pub const FREE: [&str; 2] = ["radius", "length"];

/// End of the scenes [s].
const END: f64 = 8e-5;

fn at_the_end(simulation: &mut Simulation, meter: &mut Meter) -> Result<Impact> {
    meter.run(simulation, END, |_| ())?;
    Ok(Impact::of(simulation))
}

/// 437, 1,554, 3,721 and 7,280 particles, the last three the sizes of the paper.
const SIZES: &[Size] = &[
    size("437", 2),
    size("1554", 3),
    size("3721", 4),
    size("7280", 5),
];

fn overrides(size: &Size) -> Vec<String> {
    Bar::of_the_paper(size.cells).overrides()
}

pub const COPPER: Case = Case {
    name: "copper-bar",
    title: "Copper bar on a rigid wall",
    example: "copper_impact",
    sizes: SIZES,
    swept: 2,
    leave_out: &[],
    reference: "axisymmetric finite elements with the same law",
    quantities: &[
        Quantity {
            name: "radius of the foot",
            over: "at 80 µs, relative",
            unstable_above: 0.5,
        },
        Quantity {
            name: "length",
            over: "at 80 µs, relative",
            unstable_above: 0.5,
        },
    ],
    overrides,
    measure: |simulation, meter| {
        let found = at_the_end(simulation, meter)?;
        let errors = found.errors(&Table::expected("copper_impact"), FREE);
        Ok(errors.map(|e| Some(e.abs())).to_vec())
    },
    uncertainties: || {
        let reference = Table::expected("copper_impact");
        let at = |name| reference.at(reference.column(name), END);
        vec![0.02e-3 / at(FREE[0]), 0.01e-3 / at(FREE[1])]
    },
};

/// A value that is known within an uncertainty.
pub struct Known {
    pub value: f64,
    pub within: f64,
}

// The Johnson-Cook bar of 298.15 K has no reference but its own refinement: what is added to 7,280 particles
// is in proportion what the copper bar still lacks there, and a bar of 12,192 particles settles how much is
// uncertain (examples/taylor_johnson_cook/README.md).
const RADIUS: Known = Known {
    value: 7.46e-3,
    within: 0.06e-3,
};
pub const LENGTH: Known = Known {
    value: 19.14e-3,
    within: 0.04e-3,
};
/// Warming of the probe `inside` [K].
const WARMING: Known = Known {
    value: 226.0,
    within: 7.0,
};

pub const JOHNSON_COOK: Case = Case {
    name: "johnson-cook-bar",
    title: "Johnson–Cook bar with heat on a rigid wall",
    example: "taylor_johnson_cook",
    leave_out: &["heat"],
    reference: "extrapolated from its own refinement",
    quantities: &[
        Quantity {
            name: "radius of the foot",
            over: "at 80 µs, relative",
            unstable_above: 0.5,
        },
        Quantity {
            name: "length",
            over: "at 80 µs, relative",
            unstable_above: 0.5,
        },
        Quantity {
            name: "warming inside",
            over: "at 80 µs, relative",
            unstable_above: 1.0,
        },
    ],
    measure: |simulation, meter| {
        let start = Impact::of(simulation).inside;
        let found = at_the_end(simulation, meter)?;
        let warming = found.inside.zip(start).map(|(end, start)| end - start);
        let error = |found: f64, known: Known| (found / known.value - 1.0).abs();
        Ok(vec![
            Some(error(found.radius, RADIUS)),
            Some(error(found.length, LENGTH)),
            warming.map(|found| error(found, WARMING)),
        ])
    },
    uncertainties: || {
        [RADIUS, LENGTH, WARMING]
            .map(|known| known.within / known.value)
            .to_vec()
    },
    ..COPPER
};
