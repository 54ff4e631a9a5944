//! A guard against losing speed or accuracy that times nothing, `cargo xtask counts`: instructions per
//! particle and step, memory per particle, and the pair-updates and errors of small cases, compared with
//! those in `expected.json`. `README.md` beside this file tells what is counted and by what margins.

#[path = "../../tests/cases/mod.rs"]
mod cases;
#[path = "../column/mod.rs"]
mod column;
#[path = "../../tests/common/mod.rs"]
mod common;
mod expected;
mod scenes;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

use urlsph::{Code, Control, Scene, Simulation};

use cases::{CASES, Meter, example};
use expected::{CaseCount, Counts, Expected, SceneCount};
use scenes::{CASE_SIZES, SCENES};

type Result<T> = std::result::Result<T, Box<dyn std::error::Error>>;

const USAGE: &str = "\
Usage: cargo xtask counts [--update]

Compares instructions, memory, pair-updates and errors with benches/counts/expected.json.
  --update    write the counts there and into the table of the README instead";

fn main() -> ExitCode {
    // `cargo bench` adds an argument of its own.
    let arguments: Vec<String> = std::env::args()
        .skip(1)
        .filter(|a| a != "--bench")
        .collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let result = match arguments.as_slice() {
        [] => guard(false),
        ["--update"] => guard(true),
        ["--one", scene, steps] => one(scene, steps),
        ["-h" | "--help"] => {
            println!("{USAGE}");
            Ok(true)
        }
        other => Err(format!("unknown arguments {other:?}\n\n{USAGE}").into()),
    };
    match result {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn in_repository(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

/// Counts, and compares or writes; whether all is as expected.
fn guard(update: bool) -> Result<bool> {
    let file = in_repository("benches/counts/expected.json");
    let readme = in_repository("README.md");
    let counts = Counts {
        compiler: compiler()?,
        scenes: count_scenes()?,
        cases: count_cases()?,
    };
    if update {
        let expected = Expected::of(counts)?;
        fs::write(&file, serde_json::to_string_pretty(&expected)? + "\n")?;
        let text = fs::read_to_string(&readme)?;
        fs::write(&readme, expected.in_readme(&text)?)?;
        println!("{}", expected.table());
        return Ok(true);
    }
    let expected: Expected = serde_json::from_str(&fs::read_to_string(&file)?)?;
    let text = fs::read_to_string(&readme)?;
    let mut verdicts = expected.compare(&counts);
    let table = (text == expected.in_readme(&text)?)
        .then_some(())
        .ok_or("it is not that of expected.json: run `cargo xtask counts --update`".into());
    verdicts.check("the table of README.md", table);
    Ok(verdicts.summary())
}

/// The compiler, which the instructions depend on.
fn compiler() -> Result<String> {
    let rustc = std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
    let output = Command::new(rustc).arg("--version").output()?;
    Ok(String::from_utf8(output.stdout)?.trim().to_owned())
}

/// Why instructions cannot be counted here.
fn no_counter() -> Option<String> {
    #[cfg(not(target_arch = "x86_64"))]
    return Some("the counts are those of x86-64".into());
    #[cfg(target_arch = "x86_64")]
    {
        if !(is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma")) {
            return Some("the counts are those of a processor with AVX2 and FMA".into());
        }
        match Command::new("valgrind").arg("--version").output() {
            Ok(_) => None,
            Err(error) => Some(format!("valgrind cannot be run: {error}")),
        }
    }
}

/// Every scene twice, with a few steps more the second time: the difference is the steps alone.
fn count_scenes() -> Result<std::result::Result<Vec<SceneCount>, String>> {
    if let Some(reason) = no_counter() {
        return Ok(Err(reason));
    }
    let next = AtomicUsize::new(0);
    let done = Mutex::new(Vec::new());
    let jobs = thread::available_parallelism().map_or(1, usize::from);
    thread::scope(|scope| {
        for _ in 0..jobs {
            scope.spawn(|| {
                while let Some((i, scene)) = {
                    let i = next.fetch_add(1, Ordering::Relaxed);
                    SCENES.get(i).map(|scene| (i, scene))
                } {
                    let counted = count_scene(scene.name).map_err(|e| e.to_string());
                    done.lock().expect("no panic").push((i, counted));
                }
            });
        }
    });
    let mut done = done.into_inner().expect("no panic");
    done.sort_by_key(|(i, _)| *i);
    let all: std::result::Result<Vec<_>, String> = done.into_iter().map(|(_, c)| c).collect();
    Ok(Ok(all?))
}

/// Steps before those that are counted: the first iterations of plasticity and of a redone repair are
/// not like the others.
const BEFORE: u64 = 2;
const COUNTED: u64 = 2;

fn count_scene(name: &str) -> Result<SceneCount> {
    let (before, _) = under_valgrind(name, BEFORE)?;
    let (after, body) = under_valgrind(name, BEFORE + COUNTED)?;
    let instructions = (after - before) as f64 / COUNTED as f64;
    Ok(SceneCount {
        scene: name.to_owned(),
        particles: body.particles,
        per_particle_step: (instructions / body.particles as f64).round(),
        per_pair_update: tenths(instructions / (Meter::STAGES * body.pairs) as f64),
        bytes_per_particle: tenths(body.bytes as f64 / body.particles as f64),
    })
}

/// To the digits that mean something: the file changes with the code, not with every count.
fn tenths(value: f64) -> f64 {
    (10.0 * value).round() / 10.0
}

/// Size of a scene's body.
struct Body {
    particles: u64,
    pairs: u64,
    bytes: u64,
}

/// Instructions of a process that sets a scene up and makes so many steps.
fn under_valgrind(name: &str, steps: u64) -> Result<(u64, Body)> {
    let output = Command::new("valgrind")
        .args([
            "--tool=cachegrind",
            "--cache-sim=no",
            "--cachegrind-out-file=/dev/null",
        ])
        .arg(std::env::current_exe()?)
        .args(["--one", name, &steps.to_string()])
        .output()?;
    let (shown, log) = (
        String::from_utf8(output.stdout)?,
        String::from_utf8_lossy(&output.stderr),
    );
    if !output.status.success() {
        return Err(format!("{name}: {}: {log}", output.status).into());
    }
    let count = log
        .lines()
        .find_map(|line| {
            line.split_once("I   refs:")
                .or_else(|| line.split_once("I refs:"))
        })
        .and_then(|(_, count)| count.trim().replace(',', "").parse().ok())
        .ok_or_else(|| format!("{name}: no count of instructions in {log}"))?;
    let numbers: std::result::Result<Vec<u64>, _> =
        shown.split_whitespace().map(str::parse).collect();
    let [particles, pairs, bytes] = numbers?[..] else {
        return Err(format!("{name}: unexpected output {shown}").into());
    };
    Ok((
        count,
        Body {
            particles,
            pairs,
            bytes,
        },
    ))
}

/// What runs under valgrind: one scene on one thread, so many steps.
fn one(name: &str, steps: &str) -> Result<bool> {
    let scene = SCENES
        .iter()
        .find(|s| s.name == name)
        .ok_or("there is no such scene")?;
    let steps: u64 = steps.parse()?;
    // Valgrind has no AVX-512: the code for AVX2 is counted on every processor.
    #[cfg(target_arch = "x86_64")]
    if is_x86_feature_detected!("avx512f") {
        return Err("this valgrind has AVX-512, and the counts are those of AVX2".into());
    }
    let mut simulation = Simulation::with_threads(scene.read()?, 1)?;
    let end = simulation.scene().time.end;
    let stopped = simulation.advance_with(end, &mut |progress| {
        if progress.steps < steps {
            Control::Continue
        } else {
            Control::Cancel
        }
    });
    match stopped {
        Err(error) if error.code() == Code::Cancelled => {}
        other => return Err(format!("it did not make {steps} steps: {other:?}").into()),
    }
    println!(
        "{} {} {}",
        simulation.particle_count(),
        simulation.pair_count(),
        simulation.memory()
    );
    Ok(true)
}

fn count_cases() -> Result<Vec<CaseCount>> {
    let mut counts = Vec::new();
    for (name, size) in CASE_SIZES {
        let case = CASES
            .iter()
            .find(|c| c.name == *name)
            .ok_or("there is no such case")?;
        let size = case
            .sizes
            .iter()
            .find(|s| s.name == *size)
            .ok_or("there is no such size")?;
        let scene = Scene::from_file(example(case.example, "scene.json"), &(case.overrides)(size))?;
        let mut simulation = Simulation::with_threads(scene, 1)?;
        let mut meter = Meter::default();
        let errors = (case.measure)(&mut simulation, &mut meter)?;
        let quantities = case.quantities.iter().zip(errors);
        counts.push(CaseCount {
            case: format!("{name} {}", size.name),
            pair_updates: meter.pair_updates,
            errors: quantities
                .filter_map(|(q, error)| Some((q.name.to_owned(), error?)))
                .collect(),
        });
    }
    Ok(counts)
}

/// What was compared, and how it came out.
#[derive(Default)]
struct Verdicts {
    passed: usize,
    failed: usize,
    told: Vec<String>,
}

impl Verdicts {
    fn check(&mut self, what: &str, outcome: std::result::Result<(), String>) {
        match outcome {
            Ok(()) => self.passed += 1,
            Err(complaint) => {
                self.failed += 1;
                self.tell(format!("FAILED: {what}: {complaint}"));
            }
        }
    }

    fn tell(&mut self, line: String) {
        self.told.push(line);
    }

    /// The line that `cargo xtask test` reads.
    fn summary(&self) -> bool {
        for line in &self.told {
            println!("{line}");
        }
        let verdict = if self.failed == 0 { "ok" } else { "FAILED" };
        println!(
            "test result: {verdict}. {} passed; {} failed",
            self.passed, self.failed
        );
        self.failed == 0
    }
}
