//! What is written: `results.json`, of which `README.md` beside this file documents every key.

use serde::{Deserialize, Serialize};

/// Grows when a key changes its meaning; new keys leave it as it is.
pub const FORMAT: u32 = 1;

#[derive(Serialize)]
pub struct Results {
    pub format: u32,
    pub urlsph: &'static str,
    pub quick: bool,
    pub machine: Machine,
    pub axes: Vec<Axis>,
    pub cases: Vec<Case>,
    pub runs: Vec<Run>,
}

#[derive(Serialize)]
pub struct Machine {
    pub cpu: Option<String>,
    pub cores: usize,
    pub side_by_side: usize,
}

#[derive(Serialize)]
pub struct Axis {
    pub name: &'static str,
    pub settings: Vec<&'static str>,
}

#[derive(Serialize)]
pub struct Case {
    pub name: &'static str,
    pub title: &'static str,
    pub scene: String,
    pub reference: &'static str,
    pub sizes: Vec<Size>,
    pub quantities: Vec<Quantity>,
    /// Per axis the setting that the scene has itself.
    pub own: Vec<(&'static str, &'static str)>,
}

#[derive(Serialize)]
pub struct Size {
    pub name: &'static str,
    pub cells: u32,
}

#[derive(Serialize)]
pub struct Quantity {
    pub name: &'static str,
    pub over: &'static str,
    pub uncertainty: f64,
    pub unstable_above: f64,
}

#[derive(Serialize)]
pub struct Run {
    pub case: &'static str,
    pub axis: &'static str,
    pub setting: &'static str,
    pub size: &'static str,
    pub overrides: Vec<String>,
    #[serde(flatten)]
    pub outcome: Outcome,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Status {
    Ok,
    /// It ended, with an error that is no solution.
    Unstable,
    /// It did not end.
    Failed,
}

/// How a run went; a worker prints it as one line.
#[derive(Debug, Serialize, Deserialize)]
pub struct Outcome {
    pub status: Status,
    pub reason: Option<String>,
    /// In the order of the case's quantities; empty if the run failed.
    pub errors: Vec<Option<f64>>,
    pub particles: usize,
    pub pairs: usize,
    pub cfl: f64,
    pub steps: u64,
    pub reference_updates: u64,
    pub pair_updates: u64,
    pub setup_seconds: f64,
    pub seconds: f64,
    pub time: f64,
}

impl Outcome {
    pub fn failed(reason: String) -> Self {
        Self {
            status: Status::Failed,
            reason: Some(reason),
            errors: Vec::new(),
            particles: 0,
            pairs: 0,
            cfl: 0.0,
            steps: 0,
            reference_updates: 0,
            pair_updates: 0,
            setup_seconds: 0.0,
            seconds: 0.0,
            time: 0.0,
        }
    }
}
