//! Speed against accuracy: the cases with reference solutions over settings and resolutions,
//! `cargo xtask bench`. Every run is a process of its own with one thread; what it writes is described
//! in `README.md` beside this file.

#[path = "../../tests/cases/mod.rs"]
mod cases;
#[path = "../../tests/common/mod.rs"]
mod common;
mod results;
mod settings;

use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode, Stdio};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};
use std::{fs, io, thread};

use clap::Parser;
use cpu_time::ProcessTime;
use urlsph::{Scene, Simulation};

use cases::{CASES, Case, Meter, Size, example};
use results::{Outcome, Results, Status};
use settings::{AXES, OWN, Setting};

/// Speed against accuracy: cases with reference solutions over resolution and numerics.
///
/// Writes results.json, results.csv and report.html. Times are CPU seconds of single-threaded runs;
/// other load on the machine lengthens them, and leaves the pair-updates as they are.
#[derive(Parser)]
#[command(
    name = "cargo xtask bench",
    bin_name = "cargo xtask bench",
    max_term_width = 100
)]
struct Cli {
    /// A few cases at their two coarsest resolutions.
    #[arg(long)]
    quick: bool,
    /// Only this case; may be given several times.
    #[arg(long = "case", value_name = "NAME", value_parser = names())]
    cases: Vec<String>,
    /// Runs side by side; as many as the machine has cores unless given.
    #[arg(long, value_name = "N")]
    jobs: Option<usize>,
    /// Folder of the results, made if missing.
    #[arg(long, value_name = "DIR", default_value = "target/bench")]
    out: PathBuf,
    /// Seconds after which a run is given up as failed.
    #[arg(long, value_name = "S", default_value_t = 900)]
    limit: u64,
    /// The Python that draws the report; only the JSON without it.
    #[arg(long, hide = true)]
    python: Option<PathBuf>,
    /// One run, as a process of its own: case, axis, setting, size.
    #[arg(long, hide = true, num_args = 4)]
    one: Option<Vec<String>>,
    /// Given by `cargo bench`.
    #[arg(long, hide = true)]
    bench: bool,
}

fn names() -> clap::builder::PossibleValuesParser {
    CASES
        .iter()
        .map(|case| case.name)
        .collect::<Vec<_>>()
        .into()
}

/// CPU time of all threads of this process [s].
fn cpu_seconds() -> f64 {
    ProcessTime::now().as_duration().as_secs_f64()
}

/// The cases of `--quick`.
const QUICK: [&str; 5] = ["bending", "elastic-cube", "slab", "thermo-wave", "cable"];
/// Resolutions of `--quick`.
const QUICK_SIZES: usize = 2;

/// CPU seconds of the steps after which a run is not repeated.
const ENOUGH: f64 = 0.1;
const MOST_REPEATS: usize = 5;

/// One run.
#[derive(Clone, Copy)]
struct Run {
    case: &'static Case,
    axis: &'static str,
    setting: Setting,
    size: &'static Size,
}

impl Run {
    fn overrides(&self) -> Vec<String> {
        let mut all = (self.case.overrides)(self.size);
        all.extend(self.setting.1.iter().map(|o| (*o).to_owned()));
        all
    }

    fn scene(&self) -> urlsph::Result<Scene> {
        Scene::from_file(example(self.case.example, "scene.json"), &self.overrides())
    }

    /// The run of these names.
    fn find(names: &[String]) -> Option<Self> {
        let [case, axis, setting, size] = names else {
            return None;
        };
        let case = CASES.iter().find(|c| c.name == case)?;
        let (axis, settings) = AXES.iter().find(|a| a.0 == axis)?;
        Some(Self {
            case,
            axis,
            setting: *settings.iter().find(|s| s.0 == setting)?,
            size: case.sizes.iter().find(|s| s.name == size)?,
        })
    }

    /// Runs in this process. A short run is repeated, and the least time counts: single
    /// interruptions by the system are as long.
    fn here(&self) -> Outcome {
        let mut outcome = self.once();
        let mut spent = outcome.seconds;
        for _ in 1..MOST_REPEATS {
            if spent > ENOUGH || outcome.status == Status::Failed {
                break;
            }
            let again = self.once();
            spent += again.seconds;
            outcome.seconds = outcome.seconds.min(again.seconds);
            outcome.setup_seconds = outcome.setup_seconds.min(again.setup_seconds);
        }
        outcome
    }

    fn once(&self) -> Outcome {
        let start = cpu_seconds();
        let made = self.scene().and_then(|s| Simulation::with_threads(s, 1));
        let mut simulation = match made {
            Ok(simulation) => simulation,
            Err(error) => return Outcome::failed(format!("set-up: {error}")),
        };
        let setup_seconds = cpu_seconds() - start;
        let mut meter = Meter::new(cpu_seconds);
        let measured = (self.case.measure)(&mut simulation, &mut meter);
        let (status, reason, errors) = match measured {
            Err(error) => (Status::Failed, Some(error.to_string()), Vec::new()),
            Ok(errors) => match self.unstable(&errors) {
                Some(reason) => (Status::Unstable, Some(reason), errors),
                None => (Status::Ok, None, errors),
            },
        };
        Outcome {
            status,
            reason,
            errors,
            particles: simulation.particle_count(),
            pairs: simulation.pair_count(),
            cfl: simulation.cfl_number(),
            steps: meter.steps,
            reference_updates: simulation.reference_updates(),
            pair_updates: meter.pair_updates,
            setup_seconds,
            seconds: meter.seconds,
            time: simulation.time(),
        }
    }

    /// Which error is beyond its bound, or not a number.
    fn unstable(&self, errors: &[Option<f64>]) -> Option<String> {
        let quantities = self.case.quantities.iter().zip(errors);
        let (quantity, error) = quantities
            .filter_map(|(quantity, error)| Some((quantity, (*error)?)))
            .find(|(quantity, error)| error.is_nan() || *error > quantity.unstable_above)?;
        let bound = quantity.unstable_above;
        Some(format!(
            "error of {}: {error:.2}, above {bound}",
            quantity.name
        ))
    }

    /// Runs in a process of its own, so that whatever happens to it happens to it alone.
    fn apart(&self, limit: Duration) -> io::Result<Outcome> {
        let mut child = Command::new(std::env::current_exe()?)
            .arg("--one")
            .args([self.case.name, self.axis, self.setting.0, self.size.name])
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()?;
        let start = Instant::now();
        let status = loop {
            if let Some(status) = child.try_wait()? {
                break status;
            }
            if start.elapsed() > limit {
                child.kill()?;
                child.wait()?;
                let seconds = limit.as_secs();
                return Ok(Outcome::failed(format!("given up after {seconds} s")));
            }
            thread::sleep(Duration::from_millis(5));
        };
        // Little was written: the pipes hold it until now.
        let [mut line, mut complaint] = [String::new(), String::new()];
        child
            .stdout
            .take()
            .expect("piped")
            .read_to_string(&mut line)?;
        child
            .stderr
            .take()
            .expect("piped")
            .read_to_string(&mut complaint)?;
        Ok(serde_json::from_str(&line)
            .unwrap_or_else(|_| Outcome::failed(format!("ended with {status}: {complaint}"))))
    }

    fn record(&self, outcome: Outcome) -> results::Run {
        results::Run {
            case: self.case.name,
            axis: self.axis,
            setting: self.setting.0,
            size: self.size.name,
            overrides: self.overrides(),
            outcome,
        }
    }
}

/// The runs of a case, and per axis the setting that the scene has itself: its runs are those of the
/// scene as it is.
fn plan(case: &'static Case, quick: bool) -> (Vec<Run>, Vec<(&'static str, &'static str)>) {
    let sizes = |most: usize| {
        let most = if quick { most.min(QUICK_SIZES) } else { most };
        &case.sizes[..most]
    };
    let own = Run {
        case,
        axis: AXES[0].0,
        setting: OWN,
        size: &case.sizes[0],
    };
    let mut runs: Vec<Run> = sizes(case.sizes.len())
        .iter()
        .map(|size| Run { size, ..own })
        .collect();
    let mut same = Vec::new();
    let scene = own.scene().ok();
    for &(axis, settings) in &AXES[1..] {
        for &setting in settings {
            let run = Run {
                axis,
                setting,
                ..own
            };
            if case.leave_out.contains(&setting.0) {
                continue;
            }
            if run.scene().ok() == scene {
                same.push((axis, setting.0));
            } else {
                runs.extend(sizes(case.swept).iter().map(|size| Run { size, ..run }));
            }
        }
    }
    (runs, same)
}

/// Runs, so many side by side; results in the order of the runs.
fn execute(runs: &[Run], jobs: usize, limit: Duration) -> io::Result<Vec<results::Run>> {
    let next = AtomicUsize::new(0);
    let done: Mutex<Vec<(usize, io::Result<Outcome>)>> = Mutex::default();
    thread::scope(|scope| {
        for _ in 0..jobs {
            scope.spawn(|| {
                while let Some((i, run)) = {
                    let i = next.fetch_add(1, Ordering::Relaxed);
                    runs.get(i).map(|run| (i, run))
                } {
                    let outcome = run.apart(limit);
                    if let Ok(outcome) = &outcome {
                        show(run, outcome);
                    }
                    done.lock().expect("no panic").push((i, outcome));
                }
            });
        }
    });
    let mut done = done.into_inner().expect("no panic");
    done.sort_by_key(|(i, _)| *i);
    done.into_iter()
        .map(|(i, outcome)| Ok(runs[i].record(outcome?)))
        .collect()
}

fn show(run: &Run, outcome: &Outcome) {
    let result = match (&outcome.reason, outcome.errors.first()) {
        (Some(reason), _) => reason.clone(),
        (None, Some(Some(error))) => format!("error {:.3} %", 100.0 * error),
        _ => String::new(),
    };
    println!(
        "{:<17} {:<6} {:<30} {:>9.3} s  {result}",
        run.case.name, run.size.name, run.setting.0, outcome.seconds
    );
}

fn machine(side_by_side: usize) -> results::Machine {
    let info = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = info.lines().find(|line| line.starts_with("model name"));
    results::Machine {
        cpu: model
            .and_then(|line| line.split_once(": "))
            .map(|(_, name)| name.to_owned()),
        cores: thread::available_parallelism().map_or(1, usize::from),
        side_by_side,
    }
}

fn described(case: &'static Case, own: Vec<(&'static str, &'static str)>) -> results::Case {
    let uncertainties = (case.uncertainties)();
    results::Case {
        name: case.name,
        title: case.title,
        scene: format!("examples/{}/scene.json", case.example),
        reference: case.reference,
        sizes: (case.sizes.iter())
            .map(|s| results::Size {
                name: s.name,
                cells: s.cells,
            })
            .collect(),
        quantities: (case.quantities.iter().zip(uncertainties))
            .map(|(q, uncertainty)| results::Quantity {
                name: q.name,
                over: q.over,
                uncertainty,
                unstable_above: q.unstable_above,
            })
            .collect(),
        own,
    }
}

fn bench(cli: &Cli) -> Result<(), Box<dyn std::error::Error>> {
    let jobs = cli.jobs.unwrap_or_else(|| machine(1).cores).max(1);
    let chosen = |case: &&Case| match cli.cases.as_slice() {
        [] => !cli.quick || QUICK.contains(&case.name),
        names => names.iter().any(|name| name == case.name),
    };
    let mut results = Results {
        format: results::FORMAT,
        urlsph: urlsph::VERSION,
        quick: cli.quick,
        machine: machine(jobs),
        axes: (AXES.iter())
            .map(|(name, settings)| results::Axis {
                name,
                settings: settings.iter().map(|s| s.0).collect(),
            })
            .collect(),
        cases: Vec::new(),
        runs: Vec::new(),
    };
    fs::create_dir_all(&cli.out)?;
    let file = cli.out.join("results.json");
    let start = Instant::now();
    for case in CASES.iter().filter(chosen) {
        let (runs, own) = plan(case, cli.quick);
        results.cases.push(described(case, own));
        results
            .runs
            .extend(execute(&runs, jobs, Duration::from_secs(cli.limit))?);
        // After every case, so that an interrupted bench leaves the cases that it has done.
        fs::write(&file, serde_json::to_string_pretty(&results)?)?;
    }
    let count = |status| {
        let runs = results.runs.iter();
        runs.filter(|run| run.outcome.status == status).count()
    };
    println!(
        "{} runs in {:.0} s: {} ok, {} unstable, {} failed",
        results.runs.len(),
        start.elapsed().as_secs_f64(),
        count(Status::Ok),
        count(Status::Unstable),
        count(Status::Failed),
    );
    if let Some(python) = &cli.python {
        report(python, &file)?;
    }
    Ok(())
}

fn report(python: &Path, file: &Path) -> Result<(), Box<dyn std::error::Error>> {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/trade/report.py");
    let status = Command::new(python).arg(script).arg(file).status()?;
    if !status.success() {
        return Err(format!("the report of {} was not drawn: {status}", file.display()).into());
    }
    Ok(())
}

fn main() -> ExitCode {
    let cli = Cli::parse();
    let result = match &cli.one {
        Some(names) => match Run::find(names) {
            Some(run) => serde_json::to_string(&run.here())
                .map(|line| println!("{line}"))
                .map_err(Into::into),
            None => Err(format!("there is no run {names:?}").into()),
        },
        None => bench(&cli),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}
