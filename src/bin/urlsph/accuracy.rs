//! `urlsph run --tolerance`: pilot runs, the run that meets the tolerance, and its estimated error.

use std::fmt::Write as _;
use std::fs;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use clap::Args;
use cpu_time::ProcessTime;
use urlsph::accuracy::{Ask, Band, Cost, Quantity, Report, Sampler, Search, Task};
use urlsph::output::Recorder;
use urlsph::{Code, Error, Result, Simulation, accuracy};

use crate::check::grouped;
use crate::run::{self, Bar, Run};

#[derive(Args)]
#[command(next_help_heading = "Accuracy")]
pub struct Accuracy {
    /// Relative error to keep below, such as `2%` or `0.02`, of what `--of` names: max |u_h - u| over
    /// max |u|, both over the rows of the history (temperatures from their value at the start). Pilot
    /// runs settle the resolution, whatever the scene's own is; the estimate is in accuracy.json.
    #[arg(long, value_name = "ERROR", value_parser = share, requires = "of")]
    pub tolerance: Option<f64>,
    /// What is to be accurate, by its name in the history: a variable such as `probe.tip.displacement`, or
    /// one component of it, `probe.tip.displacement[2]`, counted from 1.
    #[arg(long, value_name = "VARIABLE", requires = "tolerance")]
    of: Option<String>,
    /// Limit on the CPU time of all runs together, all threads [s]. What would take more is refused
    /// with what it would take.
    #[arg(
        long,
        value_name = "CPU_SECONDS",
        requires = "tolerance",
        default_value_t = 3600.0
    )]
    budget: f64,
}

/// `2%` or `0.02`.
fn share(text: &str) -> std::result::Result<f64, String> {
    let number = |text: &str| text.trim().parse::<f64>().ok();
    let value = match text.trim().strip_suffix('%') {
        Some(percent) => number(percent).map(|value| value / 100.0),
        None => number(text),
    };
    value
        .filter(|value| *value > 0.0 && *value < 1.0)
        .ok_or_else(|| "expected an error between 0 and 100 %, such as 2% or 0.02".to_owned())
}

/// CPU time of all threads of this process [s].
fn cpu_seconds() -> f64 {
    ProcessTime::now().as_duration().as_secs_f64()
}

/// Runs a scene for the accuracy that was asked for.
pub fn execute(run: &Run) -> Result<()> {
    let Accuracy {
        tolerance: Some(tolerance),
        of: Some(of),
        budget,
    } = &run.accuracy
    else {
        return Ok(());
    };
    let ask = Ask {
        tolerance: *tolerance,
        budget: *budget,
    };
    let mut search = Search::new(&run.scene.load()?, ask)?;
    let interrupted = run::watch_interrupts()?;
    // Pilots take their time: whether the results have a place shows before.
    fs::create_dir_all(&run.out).map_err(|cause| {
        let out = run.out.display();
        Error::new(Code::Io, format!("cannot create `{out}`: {cause}"))
    })?;
    let tell = |text: &str| match run.quiet {
        true => Ok(()),
        false => crate::print(text),
    };
    let mut pilots = 0;
    while let Some(task) = search.next_task()? {
        let start = cpu_seconds();
        let outcome = match &task {
            Task::Pilot(_) => {
                pilots += 1;
                pilot(run, of, &task, pilots, &interrupted)
            }
            Task::Final(_, prediction) => {
                tell(&foreseen(prediction))?;
                results(run, of, &task, &interrupted)
            }
        };
        match outcome {
            Ok(mut done) => {
                done.cpu_seconds = cpu_seconds() - start;
                let kind = match task {
                    Task::Pilot(_) => format!("pilot {pilots}"),
                    Task::Final(..) => "final run".to_owned(),
                };
                tell(&line(&kind, &made(&task, &done)))?;
                search.succeeded(&task, done);
            }
            Err(error) => {
                let text = error.to_string();
                search.failed(&task, error)?;
                tell(&line(
                    &format!("pilot {pilots}"),
                    &format!("failed: {text}"),
                ))?;
            }
        }
        // A final run that misses the tolerance has results all the same, and says so; a pilot after it
        // sharpens what is known of it.
        if let Some(report) = search.report() {
            report.write(&run.out)?;
            tell(&achieved(&report))?;
        }
    }
    Ok(())
}

fn pilot(
    run: &Run,
    of: &str,
    task: &Task,
    number: usize,
    interrupted: &AtomicBool,
) -> Result<accuracy::Run> {
    let mut simulation = Simulation::with_threads(task.level().scene.clone(), run.threads)?;
    let what = format!("pilot {number} ");
    let bar = Bar::new(&simulation, &what, run.quiet);
    let made = accuracy::Run::make(&mut simulation, of, &mut |progress| {
        bar.watch(progress, interrupted)
    });
    bar.finish();
    made
}

/// The run whose results are kept.
fn results(run: &Run, of: &str, task: &Task, interrupted: &AtomicBool) -> Result<accuracy::Run> {
    let start = Instant::now();
    let mut simulation = Simulation::with_threads(task.level().scene.clone(), run.threads)?;
    let quantity = Quantity::find(&simulation, of)?;
    let mut recorder = Recorder::create(&run.out, &simulation)?;
    let mut sampler = Sampler::new(simulation.scene(), quantity);
    let initial = simulation.energies();
    let bar = Bar::new(&simulation, "final run ", run.quiet);
    run::march(
        &mut simulation,
        &mut recorder,
        &bar,
        interrupted,
        &mut |s| sampler.sample(s),
    )?;
    if !run.quiet {
        crate::print(&run::summary(
            &simulation,
            &recorder,
            initial,
            start.elapsed(),
        ))?;
    }
    accuracy::Run::of(&simulation, sampler)
}

fn line(name: &str, text: &str) -> String {
    format!("{name:<22} {text}\n")
}

fn made(task: &Task, run: &accuracy::Run) -> String {
    format!(
        "{}, {} particles, {} steps, {:.2} CPU s",
        task.level().cells,
        grouped(run.particles as u64),
        grouped(run.steps),
        run.cpu_seconds
    )
}

fn foreseen(prediction: &accuracy::Prediction) -> String {
    let Cost {
        particles,
        steps,
        cpu_seconds,
        memory,
    } = prediction.cost;
    line(
        "predicted",
        &format!(
            "{}, {} particles, {} steps, {cpu_seconds:.2} CPU s, {:.1} MB, error {}",
            prediction.cells,
            grouped(particles.round() as u64),
            grouped(steps.round() as u64),
            1e-6 * memory,
            percent(prediction.error)
        ),
    )
}

fn achieved(report: &Report) -> String {
    let mut text = line(
        "estimated error",
        &format!(
            "{} of {}, {} the tolerance of {} %",
            percent(report.estimate),
            report.of,
            if report.met { "within" } else { "not within" },
            100.0 * report.tolerance
        ),
    );
    if let Some(order) = report.order {
        let order = format!("{:.1} ({:.1} to {:.1})", order.best, order.low, order.high);
        write!(text, "{}", line("observed order", &order)).expect("a String takes any text");
    }
    text
}

/// An error with its band.
fn percent(error: Band) -> String {
    let [low, best, high] = [error.low, error.best, error.high].map(|e| 100.0 * e);
    format!("{best:.2} % ({low:.2} to {high:.2} %)")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tolerances_are_shares_or_per_cent() {
        assert_eq!(share("2%"), Ok(0.02));
        assert_eq!(share(" 2.5 % "), Ok(0.025));
        assert_eq!(share("0.02"), Ok(0.02));
        for wrong in [
            "", "%", "2", "0", "-1%", "100%", "nan", "inf%", "two", "1%%",
        ] {
            assert!(share(wrong).is_err(), "{wrong}");
        }
    }
}
