//! What came of a run for an accuracy: for the terminal and for `accuracy.json`.

use std::io::Write as _;
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::model::Band;
use crate::error::{Code, Error, Result};
use crate::output::{ACCURACY, replace_file};

/// What a run costs.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Cost {
    /// Particles.
    pub particles: f64,
    /// Time steps.
    pub steps: f64,
    /// CPU time of all threads [s].
    pub cpu_seconds: f64,
    /// Memory of the simulation [bytes].
    pub memory: f64,
}

/// What is foreseen for a run.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Prediction {
    /// Size of the cells relative to the scene's own.
    pub size: f64,
    /// The cells in words.
    pub cells: String,
    /// Relative error.
    pub error: Band,
    /// What it costs.
    pub cost: Cost,
}

/// A run that was made.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Attempt {
    /// `pilot` or `final`.
    pub role: &'static str,
    /// Size of the cells relative to the scene's own.
    pub size: f64,
    /// The cells in words.
    pub cells: String,
    /// What it cost; `null` if it failed.
    pub cost: Option<Cost>,
    /// Relative error, estimated from all runs; `null` if it failed.
    pub error: Option<Band>,
    /// Why it failed.
    pub failure: Option<String>,
}

/// What came of a run for an accuracy.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Report {
    /// Version of this layout: it grows when a key changes its meaning.
    pub format: u32,
    /// Version of the library.
    pub urlsph: &'static str,
    /// The quantity, by its name in the history.
    pub of: String,
    /// Its SI unit.
    pub unit: &'static str,
    /// What its relative error is.
    pub measure: &'static str,
    /// The error that was asked for.
    pub tolerance: f64,
    /// Limit on the CPU time of all runs together [s].
    pub budget_cpu_seconds: f64,
    /// What was foreseen of the final run.
    pub prediction: Option<Prediction>,
    /// Relative error of the final run, estimated from it and all others.
    pub estimate: Band,
    /// Whether the estimate is settled and its upper end within the tolerance.
    pub met: bool,
    /// Observed order of convergence; `null` where runs are so close that it does not show.
    pub order: Option<Band>,
    /// Scatter of the differences of the runs about that order (root mean square, relative).
    pub scatter: Option<f64>,
    /// All runs in the order in which they were made.
    pub runs: Vec<Attempt>,
}

impl Report {
    /// Writes it as `accuracy.json` into the folder of the final run.
    ///
    /// # Errors
    /// [`Code::Io`](crate::Code::Io) naming the file.
    pub fn write(&self, folder: &Path) -> Result<PathBuf> {
        let path = folder.join(ACCURACY);
        let text = serde_json::to_string_pretty(self).map_err(|cause| {
            Error::new(
                Code::Internal,
                format!("the report cannot be written as JSON: {cause}; please report this bug"),
            )
        })?;
        replace_file(&path, |out| writeln!(out, "{text}"))?;
        Ok(path)
    }
}
