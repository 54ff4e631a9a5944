//! Where the method breaks: sweeps from the ordinary to the absurd, `cargo xtask extremes`. What is looked for is
//! described in `README.md` beside this file.

#[path = "../../tests/cases/mod.rs"]
mod cases;
#[path = "../../tests/common/mod.rs"]
mod common;
mod monitor;
mod sweeps;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::{Duration, Instant};

use clap::Parser;
use rayon::prelude::*;
use serde::Serialize;
use urlsph::scene::Precision;
use urlsph::{Code, Control, Error, Field, Result, Scene, Simulation};

use common::field;
use monitor::{Findings, Monitor, beyond};
use sweeps::{Aim, SWEEPS, Series, Sweep};

/// Sweeps from the ordinary to the absurd: what runs, what stops with an error, and what is wrong in silence.
#[derive(Parser)]
#[command(
    name = "cargo xtask extremes",
    bin_name = "cargo xtask extremes",
    max_term_width = 100
)]
struct Cli {
    /// Only this sweep; may be given several times.
    #[arg(long = "sweep", value_name = "NAME", value_parser = names())]
    sweeps: Vec<String>,
    /// Runs side by side; as many as the machine has cores unless given.
    #[arg(long, value_name = "N", default_value_t = 0)]
    jobs: usize,
    /// Seconds after which a run is given up.
    #[arg(long, value_name = "S", default_value_t = 300)]
    limit: u64,
    /// Folder of the results, made if missing; given by `cargo xtask extremes`.
    #[arg(
        long,
        value_name = "DIR",
        default_value = "target/extremes",
        hide = true
    )]
    out: PathBuf,
    /// Given by `cargo bench`.
    #[arg(long, hide = true)]
    bench: bool,
}

fn names() -> clap::builder::PossibleValuesParser {
    SWEEPS
        .iter()
        .map(|sweep| sweep.name)
        .collect::<Vec<_>>()
        .into()
}

/// What became of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
enum Outcome {
    /// To its end, and nothing was found to be wrong.
    Runs,
    /// With an error of the library that names place and remedy.
    Stops,
    /// Before it began.
    Refused,
    /// It took too long.
    Slow,
    /// To its end, or to an error, with something wrong or an error that does not help.
    Wrong,
}

#[derive(Serialize)]
struct Row {
    sweep: &'static str,
    title: &'static str,
    axis: &'static str,
    series: &'static str,
    value: f64,
    outcome: Outcome,
    /// Time that was reached over the end; the largest CFL number, or the difference from the body in other units.
    figure: f64,
    /// The default CFL number, where the largest is looked for.
    default_cfl: Option<f64>,
    particles: usize,
    steps: u64,
    least_j: Option<f64>,
    most_j: Option<f64>,
    energy_growth: Option<f64>,
    ledger_error: Option<f64>,
    dissipation_gain: Option<f64>,
    entropy_loss: Option<f64>,
    asymmetry: Option<f64>,
    checkerboard: Option<f64>,
    message: String,
}

impl Row {
    fn new(sweep: &'static Sweep, series: &Series, value: f64) -> Self {
        Self {
            sweep: sweep.name,
            title: sweep.title,
            axis: sweep.axis,
            series: series.0,
            value,
            outcome: Outcome::Runs,
            figure: 0.0,
            default_cfl: None,
            particles: 0,
            steps: 0,
            least_j: None,
            most_j: None,
            energy_growth: None,
            ledger_error: None,
            dissipation_gain: None,
            entropy_loss: None,
            asymmetry: None,
            checkerboard: None,
            message: String::new(),
        }
    }

    fn take(&mut self, found: Findings) {
        self.least_j = Some(found.least_j);
        self.most_j = Some(found.most_j);
        self.energy_growth = Some(found.growth);
        self.ledger_error = Some(found.ledger);
        self.dissipation_gain = Some(found.gain);
        self.entropy_loss = Some(found.loss);
        self.asymmetry = Some(found.asymmetry);
        self.checkerboard = Some(found.checkerboard);
    }

    /// An error of a run that has begun.
    fn stopped(&mut self, error: &Error) {
        let place = error.place();
        let helps = error.code() == Code::Diverged
            && place.particle.is_some()
            && place.time.is_some()
            && ["numerics.", "load"]
                .iter()
                .any(|remedy| error.message().contains(remedy));
        self.outcome = match error.code() {
            Code::Cancelled => Outcome::Slow,
            _ if helps => Outcome::Stops,
            _ => Outcome::Wrong,
        };
        self.message = error.to_string();
    }
}

fn main() -> ExitCode {
    let cli = Cli::parse();
    match run(&cli) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run(cli: &Cli) -> std::result::Result<(), Box<dyn std::error::Error>> {
    let chosen =
        |sweep: &&Sweep| cli.sweeps.is_empty() || cli.sweeps.iter().any(|n| n == sweep.name);
    let runs: Vec<(&'static Sweep, &'static Series, &'static [f64])> = SWEEPS
        .iter()
        .filter(chosen)
        .flat_map(|sweep| sweep.series.iter().map(move |series| (sweep, series)))
        .flat_map(|(sweep, series)| {
            let together = match sweep.aim {
                Aim::Along => sweep.values.len(),
                _ => 1,
            };
            let parts = sweep.values.chunks(together);
            parts.map(move |values| (sweep, series, values))
        })
        .collect();
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(cli.jobs)
        .build()?;
    let limit = Duration::from_secs(cli.limit);
    let rows: Vec<Vec<Row>> = pool.install(|| {
        let all = runs.par_iter().with_max_len(1);
        all.map(|(sweep, series, values)| measure(sweep, series, values, limit))
            .collect()
    });
    let rows: Vec<Row> = rows.into_iter().flatten().collect();
    write(&cli.out, &rows)?;
    Ok(())
}

fn write(folder: &Path, rows: &[Row]) -> std::io::Result<()> {
    fs::create_dir_all(folder)?;
    let text = serde_json::to_string_pretty(rows)?;
    fs::write(folder.join("results.json"), text + "\n")
}

/// One run, or the runs of one series in one.
fn measure(sweep: &'static Sweep, series: &Series, values: &[f64], limit: Duration) -> Vec<Row> {
    let mut rows: Vec<Row> = values
        .iter()
        .map(|value| Row::new(sweep, series, *value))
        .collect();
    let start = Instant::now();
    let outcome = match sweep.aim {
        Aim::Run | Aim::Noise | Aim::Along => follow(sweep, series, &mut rows, limit).map(drop),
        Aim::LargestCfl => largest_cfl(sweep, series, &mut rows[0]),
        Aim::Scaled(factor) => scaled(sweep, series, &mut rows, factor(values[0]), limit),
    };
    if let Err(error) = outcome {
        for row in &mut rows {
            row.outcome = Outcome::Refused;
            row.message = error.to_string();
        }
    }
    for row in &rows {
        println!(
            "{:>14} {:32} {:10} {:?} {:.3e} {} steps, {:.1} s{}{}",
            row.sweep,
            row.series,
            row.value,
            row.outcome,
            row.figure,
            row.steps,
            start.elapsed().as_secs_f64(),
            if row.message.is_empty() { "" } else { ": " },
            row.message,
        );
    }
    rows
}

/// Runs the scene of the last row, and fills each row at the end of its own or at an error before it. An error is
/// returned where a scene is refused.
fn follow(sweep: &Sweep, series: &Series, rows: &mut [Row], limit: Duration) -> Result<Simulation> {
    let mut scenes = rows
        .iter()
        .map(|row| sweep.scene(series, row.value, &[]))
        .collect::<Result<Vec<Scene>>>()?;
    let ends: Vec<f64> = scenes.iter().map(|scene| scene.time.end).collect();
    let scene = scenes.pop().expect("a row");
    let single = is_single(&scene);
    let mut simulation = Simulation::with_threads(scene, 1)?;
    let noise = matches!(sweep.aim, Aim::Noise);
    let mut monitor = Monitor::new(&simulation, sweep.symmetry, !noise);
    let start = Instant::now();
    let mut result = Ok(());
    for (row, end) in std::iter::zip(rows, ends) {
        while result.is_ok() && simulation.time() < end {
            // A hair less than the stable step, so that rounding does not make two of it.
            let next = simulation.time() + simulation.stable_step() * (1.0 - 1e-9);
            result = simulation.advance_with(next.min(end), &mut |_| {
                if start.elapsed() < limit {
                    Control::Continue
                } else {
                    Control::Cancel
                }
            });
            monitor.look(&simulation);
        }
        row.particles = simulation.particle_count();
        row.figure = simulation.time() / end;
        row.steps = simulation.steps();
        let found = monitor.findings(&simulation);
        row.take(found);
        if let Err(error) = &result {
            row.stopped(error);
        }
        let wrong = found.wrong(noise, single);
        // What stops has told that it is no solution.
        if !wrong.is_empty() && row.outcome == Outcome::Runs {
            row.outcome = Outcome::Wrong;
            row.message = wrong.join(", ");
        }
    }
    Ok(simulation)
}

fn is_single(scene: &Scene) -> bool {
    scene.numerics.precision == Precision::Single
}

/// Steps of noise, and what it may leave of the kinetic energy, where it dies down.
const STEPS: f64 = 600.0;
const LEFT: f64 = 1.0;
/// What a scene may ask for.
const LARGEST_CFL: f64 = 2.0;

/// Doubles the CFL number until noise grows, and halves the bracket.
fn largest_cfl(sweep: &Sweep, series: &Series, row: &mut Row) -> Result<()> {
    let dies_down = |cfl: f64, row: &mut Row| -> Result<bool> {
        let more = [format!("numerics.cfl={cfl:e}")];
        let mut simulation = Simulation::with_threads(sweep.scene(series, row.value, &more)?, 1)?;
        row.particles = simulation.particle_count();
        let stored = |s: &Simulation| s.energies().kinetic + s.energies().strain;
        let start = stored(&simulation);
        let end = STEPS * simulation.stable_step();
        let result = simulation.advance(end);
        row.steps += simulation.steps();
        Ok(result.is_ok() && stored(&simulation) < LEFT * start)
    };
    let simulation = Simulation::with_threads(sweep.scene(series, row.value, &[])?, 1)?;
    let default = simulation.cfl_number();
    row.default_cfl = Some(default);
    let (mut good, mut bad) = (0.0, default);
    while good < LARGEST_CFL && dies_down(bad, row)? {
        (good, bad) = (bad, LARGEST_CFL.min(2.0 * bad));
    }
    while bad - good > 0.02 * default {
        let middle = 0.5 * (good + bad);
        if dies_down(middle, row)? {
            good = middle;
        } else {
            bad = middle;
        }
    }
    row.figure = good;
    if good < default {
        row.outcome = Outcome::Wrong;
        row.message = format!("noise grows at the default CFL number, {default}");
    }
    Ok(())
}

/// Difference between bodies in other units that is still round-off: that of the sums in the two precisions.
const ROUND_OFF: [f64; 2] = [1e-11, 1e-5];

/// Compares a body in other units with the one at the value 1.
fn scaled(
    sweep: &Sweep,
    series: &Series,
    rows: &mut [Row],
    factor: f64,
    limit: Duration,
) -> Result<()> {
    let own = follow(sweep, series, rows, limit)?;
    let row = &mut rows[0];
    let scene = sweep.scene(series, 1.0, &[])?;
    let end = scene.time.end;
    let single = is_single(&scene);
    let mut base = Simulation::with_threads(scene, 1)?;
    base.advance(end)?;
    let [own, base] = [&own, &base].map(|s| field(s, Field::Displacement));
    let largest = base.iter().fold(0.0_f64, |m, u| m.max(u.abs()));
    let difference = std::iter::zip(&own, &base).map(|(o, b)| (o / factor - b).abs() / largest);
    row.figure = cases::largest(difference);
    if row.outcome == Outcome::Runs && beyond(row.figure, ROUND_OFF[usize::from(single)]) {
        row.outcome = Outcome::Wrong;
        row.message = "differs from the same body in other units".to_owned();
    }
    Ok(())
}
