//! The cases with reference solutions: scene, resolutions, measure of the error, reference and its
//! uncertainty. The acceptance tests hold them to tolerances, `benches/trade` runs them over settings.

// The acceptance tests and the bench are built with these files, and each uses a part of them.
#![allow(dead_code)]

pub mod cable;
pub mod columns;
pub mod elastic_cube;
pub mod impact;
pub mod slab;
pub mod thermo_wave;

use std::path::{Path, PathBuf};

use urlsph::{Result, Simulation};

/// A case as the bench runs it.
pub struct Case {
    /// On the command line and in the results.
    pub name: &'static str,
    pub title: &'static str,
    /// Folder under `examples/`, with `scene.json`.
    pub example: &'static str,
    /// From coarse to fine.
    pub sizes: &'static [Size],
    /// How many of the sizes every setting is run with; the scene's own settings are run with all.
    pub swept: usize,
    /// Settings that would make it another problem.
    pub leave_out: &'static [&'static str],
    /// Where the reference comes from.
    pub reference: &'static str,
    /// What is compared; the first is the one that a user asks for most.
    pub quantities: &'static [Quantity],
    /// Overrides of the scene that make it a size.
    pub overrides: fn(&Size) -> Vec<String>,
    /// Runs it and measures the error of every quantity, `None` where the scene does not compute it.
    pub measure: fn(&mut Simulation, &mut Meter) -> Result<Vec<Option<f64>>>,
    /// Uncertainties of the reference in the measures of `quantities`; 0 where it is exact.
    pub uncertainties: fn() -> Vec<f64>,
}

/// A resolution.
pub struct Size {
    pub name: &'static str,
    /// Cells along a length that belongs to the case; orders are observed over its inverse.
    pub cells: u32,
}

pub(crate) const fn size(name: &'static str, cells: u32) -> Size {
    Size { name, cells }
}

/// An error that is compared over settings.
pub struct Quantity {
    pub name: &'static str,
    /// What the error is divided by.
    pub over: &'static str,
    /// An error above it is no solution any more: the run counts as unstable.
    pub unstable_above: f64,
}

/// What stepping cost, without the set-up and without what is read off between the steps.
#[derive(Debug, Clone, Copy)]
pub struct Meter {
    /// Tells the time that is counted [s].
    clock: fn() -> f64,
    /// Of the steps, by the clock [s].
    pub seconds: f64,
    pub steps: u64,
    /// Directed pairs times right-hand sides.
    pub pair_updates: u64,
}

impl Default for Meter {
    /// Without a clock, where time does not matter.
    fn default() -> Self {
        Self::new(|| 0.0)
    }
}

impl Meter {
    /// Right-hand sides of a step.
    pub const STAGES: u64 = 3;

    pub fn new(clock: fn() -> f64) -> Self {
        Self {
            clock,
            seconds: 0.0,
            steps: 0,
            pair_updates: 0,
        }
    }

    /// Advances a simulation, and counts.
    pub fn advance(&mut self, simulation: &mut Simulation, to: f64) -> Result<()> {
        let (steps, start) = (simulation.steps(), (self.clock)());
        let result = simulation.advance(to);
        self.seconds += (self.clock)() - start;
        let steps = simulation.steps() - steps;
        self.steps += steps;
        self.pair_updates += Self::STAGES * steps * simulation.pair_count() as u64;
        result
    }

    /// Runs to `end` in stable steps and shows the simulation after every one.
    pub fn run(
        &mut self,
        simulation: &mut Simulation,
        end: f64,
        mut after: impl FnMut(&Simulation),
    ) -> Result<()> {
        while simulation.time() < end {
            // A hair less than the stable step, so that rounding does not make two of it.
            let next = simulation.time() + simulation.stable_step() * (1.0 - 1e-9);
            self.advance(simulation, next.min(end))?;
            after(simulation);
        }
        Ok(())
    }
}

/// A file of an example.
pub fn example(case: &str, file: &str) -> PathBuf {
    [env!("CARGO_MANIFEST_DIR"), "examples", case, file]
        .iter()
        .collect()
}

/// Displacement of a probe by name.
pub fn displacement(simulation: &Simulation, probe: &str) -> [f64; 3] {
    let index = simulation.probe_names().iter().position(|n| n == probe);
    simulation
        .probe(index.expect("a probe of the scene"))
        .displacement
}

/// Euclidean norm.
pub fn norm(values: &[f64]) -> f64 {
    values.iter().map(|v| v * v).sum::<f64>().sqrt()
}

/// The largest value, or not a number if one of them is not.
pub fn largest(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(0.0, |m, v| if v > m || v.is_nan() { v } else { m })
}

/// Columns of numbers over time.
pub struct Table {
    names: Vec<String>,
    rows: Vec<Vec<f64>>,
}

impl Table {
    /// The reference solution of an example.
    pub fn expected(case: &str) -> Self {
        Self::read(&example(case, "expected.csv"))
    }

    /// The table in a file.
    pub fn read(path: &Path) -> Self {
        let text = std::fs::read_to_string(path).unwrap_or_else(|e| panic!("{path:?}: {e}"));
        let mut lines = text.lines();
        let names = lines
            .next()
            .expect("a header")
            .split(',')
            .map(str::to_owned)
            .collect();
        let number = |s: &str| s.parse().unwrap_or_else(|e| panic!("{path:?}: `{s}`: {e}"));
        let rows = lines
            .map(|line| line.split(',').map(number).collect())
            .collect();
        Self { names, rows }
    }

    /// Index of a column.
    pub fn column(&self, name: &str) -> usize {
        self.names
            .iter()
            .position(|n| n == name)
            .unwrap_or_else(|| panic!("no column {name}"))
    }

    /// Last time.
    pub fn end(&self) -> f64 {
        self.rows.last().expect("rows")[0]
    }

    /// Value of a column at a time, linear between the rows.
    pub fn at(&self, column: usize, time: f64) -> f64 {
        let next = self
            .rows
            .partition_point(|row| row[0] < time)
            .clamp(1, self.rows.len() - 1);
        let (a, b) = (&self.rows[next - 1], &self.rows[next]);
        a[column] + (time - a[0]) / (b[0] - a[0]) * (b[column] - a[column])
    }

    /// Times and values of a column.
    pub fn samples(&self, column: usize) -> impl Iterator<Item = (f64, f64)> {
        self.rows.iter().map(move |row| (row[0], row[column]))
    }
}

/// All of them.
pub const CASES: &[Case] = &[
    columns::BENDING_CASE,
    columns::TWISTING_CASE,
    columns::TENSION_CASE,
    elastic_cube::CASE,
    slab::CASE,
    thermo_wave::CASE,
    cable::CASE,
    impact::COPPER,
    impact::JOHNSON_COOK,
];
