//! `urlsph run`: from a scene to a folder of results, with a progress bar.

use std::fmt::Write as _;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use clap::Args;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use urlsph::output::{RESTART, Recorder};
use urlsph::{Code, Control, Energies, Error, Progress, Result, Simulation, Snapshot};

use crate::SceneArguments;
use crate::accuracy::{self, Accuracy};
use crate::check::grouped;

/// Share of the largest energy from which a closure error asks for a look.
const LARGE_CLOSURE_ERROR: f64 = 0.01;

#[derive(Args)]
pub struct Run {
    #[command(flatten)]
    pub scene: SceneArguments,
    /// Folder of the results, made if missing; an earlier run in it is replaced.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Threads; as many as the machine has cores unless given.
    #[arg(long, value_name = "N", default_value_t = 0, hide_default_value = true)]
    pub threads: usize,
    /// End of the run [s]: the same as `--set time.end=T`.
    #[arg(long, value_name = "T")]
    until: Option<String>,
    /// Goes on with the run in the folder from its last snapshot (see `output.restart_interval`), up to the end that the
    /// scene has now
    #[arg(long, conflicts_with = "tolerance")]
    restart: bool,
    /// Prints errors only.
    #[arg(long)]
    pub quiet: bool,
    #[command(flatten)]
    pub accuracy: Accuracy,
}

impl Run {
    pub fn execute(mut self) -> Result<()> {
        if let Some(end) = self.until.take() {
            self.scene.overrides.push(format!("time.end={end}"));
        }
        if self.accuracy.tolerance.is_some() {
            return accuracy::execute(&self);
        }
        let mut simulation = Simulation::with_threads(self.scene.load()?, self.threads)?;
        let mut recorder = if self.restart {
            let snapshot = Snapshot::read(self.out.join(RESTART))?;
            simulation.restore(&snapshot)?;
            Recorder::resume(&self.out, &simulation)?
        } else {
            Recorder::create(&self.out, &simulation)?
        };
        let interrupted = watch_interrupts()?;
        let start = Instant::now();
        let initial = simulation.energies();
        let bar = Bar::new(&simulation, "", self.quiet);
        march(
            &mut simulation,
            &mut recorder,
            &bar,
            &interrupted,
            &mut |_| Ok(()),
        )?;
        if !self.quiet {
            crate::print(&summary(&simulation, &recorder, initial, start.elapsed()))?;
        }
        Ok(())
    }
}

/// Advances from one instant of output to the next, up to the scene's end. `also` sees the simulation
/// at each of them.
pub fn march(
    simulation: &mut Simulation,
    recorder: &mut Recorder,
    bar: &Bar,
    interrupted: &AtomicBool,
    also: &mut dyn FnMut(&Simulation) -> Result<()>,
) -> Result<()> {
    let mut outcome = recorder.record(simulation).and_then(|()| also(simulation));
    while let (Ok(()), Some(time)) = (&outcome, recorder.next_time()) {
        outcome = simulation
            .advance_with(time, &mut |progress| bar.watch(progress, interrupted))
            .and_then(|()| recorder.record(simulation))
            .and_then(|()| also(simulation));
    }
    bar.finish();
    outcome.map_err(|error| explain(error, simulation, recorder))
}

/// What became of a run that ended early: its last state is written, and the message says where.
fn explain(error: Error, simulation: &Simulation, recorder: &mut Recorder) -> Error {
    if !matches!(error.code(), Code::Diverged | Code::Cancelled) {
        return error;
    }
    match recorder.record_last_state(simulation) {
        Ok(path) => error.with_note(&format!(
            "the last good state, time {:.6e} s, is in {}",
            simulation.time(),
            path.display()
        )),
        Err(output) => error.with_note(&format!("its last good state is lost, too: {output}")),
    }
}

/// A flag that Ctrl-C raises; the run then ends after its present step. A second Ctrl-C kills.
pub fn watch_interrupts() -> Result<Arc<AtomicBool>> {
    let flag = Arc::new(AtomicBool::new(false));
    let raised = Arc::clone(&flag);
    ctrlc::set_handler(move || {
        if raised.swap(true, Ordering::Relaxed) {
            std::process::exit(130);
        }
    })
    .map_err(|cause| Error::new(Code::Io, format!("cannot watch for Ctrl-C: {cause}")))?;
    Ok(flag)
}

/// The progress bar on standard error; where that is no terminal, nothing is drawn.
pub struct Bar {
    bar: ProgressBar,
    particles: f64,
    end: f64,
    start: Instant,
}

/// Parts of the whole time that the bar counts.
const PARTS: f64 = 10_000.0;

impl Bar {
    /// A bar of a simulation; `what` stands before its numbers.
    pub fn new(simulation: &Simulation, what: &str, quiet: bool) -> Self {
        let target = if quiet {
            ProgressDrawTarget::hidden()
        } else {
            ProgressDrawTarget::stderr()
        };
        let style = ProgressStyle::with_template(
            "{prefix}{bar:30} {percent:>3} %  {msg}  elapsed {elapsed}, ETA {eta}",
        )
        .expect("the template is fixed and valid");
        let bar = ProgressBar::with_draw_target(Some(PARTS as u64), target).with_style(style);
        bar.set_prefix(what.to_owned());
        Self {
            bar,
            particles: simulation.particle_count() as f64,
            end: simulation.scene().time.end,
            start: Instant::now(),
        }
    }

    /// Shows where a run is; what it is to do next.
    pub fn watch(&self, progress: &Progress, interrupted: &AtomicBool) -> Control {
        self.update(progress);
        if interrupted.load(Ordering::Relaxed) {
            Control::Cancel
        } else {
            Control::Continue
        }
    }

    fn update(&self, progress: &Progress) {
        if self.bar.is_hidden() {
            return;
        }
        let speed = particle_steps_per_second(self.particles, progress.steps, self.start.elapsed());
        self.bar.set_message(format!(
            "t = {:.4e} s, {speed:.2e} particle-steps/s",
            progress.time
        ));
        self.bar
            .set_position((PARTS * progress.time / self.end) as u64);
    }

    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

fn particle_steps_per_second(particles: f64, steps: u64, elapsed: Duration) -> f64 {
    particles * steps as f64 / elapsed.as_secs_f64().max(f64::MIN_POSITIVE)
}

/// What a finished run comes to.
pub fn summary(
    simulation: &Simulation,
    recorder: &Recorder,
    initial: Energies,
    elapsed: Duration,
) -> String {
    let energies = simulation.energies();
    let particles = simulation.particle_count();
    let speed = particle_steps_per_second(particles as f64, simulation.steps(), elapsed);
    let mut text = String::new();
    let mut line = |name: &str, value: String| {
        writeln!(text, "{name:<22} {value}").expect("a String takes any text");
    };
    line(
        "simulated",
        format!(
            "{} s in {} steps, {} particles",
            simulation.time(),
            grouped(simulation.steps()),
            grouped(particles as u64)
        ),
    );
    line(
        "wall time",
        format!(
            "{:.2} s on {}, {speed:.2e} particle-steps/s",
            elapsed.as_secs_f64(),
            match simulation.threads() {
                1 => "1 thread".to_owned(),
                threads => format!("{threads} threads"),
            }
        ),
    );
    if simulation.reference_updates() > 0 {
        let updates = grouped(simulation.reference_updates());
        line("reference", format!("updated {updates} times"));
    }
    let stored = |e: &Energies| e.kinetic + e.strain + e.thermal;
    // What the scene does not have stays 0 and is left out.
    let optional = |value: f64| (value != 0.0).then_some(value);
    for (name, value) in [
        ("initial energy", Some(stored(&initial))),
        ("kinetic energy", Some(energies.kinetic)),
        ("strain energy", Some(energies.strain)),
        ("thermal energy", optional(energies.thermal)),
        ("external work", Some(energies.external_work)),
        ("heat supplied", optional(energies.heat_in)),
        ("plastic work", optional(energies.plastic_work)),
        (
            "numerical dissipation",
            Some(energies.numerical_dissipation),
        ),
        ("taken by projection", Some(energies.projection)),
    ] {
        if let Some(value) = value {
            line(name, format!("{value:>14.6e} J"));
        }
    }
    let scale = [
        stored(&initial),
        energies.external_work,
        energies.heat_in,
        energies.kinetic + energies.strain,
        energies.thermal,
    ]
    .map(f64::abs)
    .into_iter()
    .fold(0.0, f64::max);
    // A body at rest without loads has no energy to compare with.
    let share = (scale > 0.0).then(|| energies.closure_error.abs() / scale);
    let of = share.map_or_else(String::new, |s| format!(" ({s:.1e} of the largest energy)"));
    let error = format!("{:>14.6e} J{of}", energies.closure_error);
    line("closure error", error);
    if share.is_some_and(|share| share > LARGE_CLOSURE_ERROR) {
        let advice =
            "the closure error is large: compare with a smaller numerics.cfl and a finer spacing";
        line("warning", advice.to_owned());
    }
    line("results", recorder.folder().display().to_string());
    text
}
