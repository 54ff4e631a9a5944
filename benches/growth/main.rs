//! What a step costs from a thousand to a million particles: `README.md` beside this file.

#[path = "../column/mod.rs"]
mod column;

use std::fmt::Write as _;

use cpu_time::ProcessTime;
use urlsph::Simulation;

use column::JITTER;

/// Cells across the column.
const SIZES: [u32; 7] = [5, 8, 11, 16, 25, 36, 55];

/// Name, overrides, whether steps are measured: pair vectors are stored from an update of the reference on, which
/// belongs to its own steps.
const BODIES: [(&str, &[&str], bool); 5] = [
    ("lattice", &[], true),
    ("single precision", &["numerics.precision=single"], true),
    (
        "stored vectors",
        &[
            "numerics.kernel_option=4",
            "numerics.reference_update={\"every\": 2}",
        ],
        false,
    ),
    ("jitter", &[JITTER, "numerics.operators=kernel"], true),
    (
        "repaired jitter",
        &[JITTER, "numerics.operators=repaired"],
        true,
    ),
];

/// Pairs that a measurement computes at least, and how often it is repeated.
const PAIRS: usize = 20_000_000;
const REPEATS: usize = 5;

fn cpu_seconds() -> f64 {
    ProcessTime::now().as_duration().as_secs_f64()
}

/// Least seconds of a piece of work.
fn least(mut work: impl FnMut()) -> f64 {
    let mut least = f64::INFINITY;
    for _ in 0..REPEATS {
        let start = cpu_seconds();
        work();
        least = least.min(cpu_seconds() - start);
    }
    least
}

fn main() {
    let filter = std::env::args().skip(1).find(|a| !a.starts_with('-'));
    let mut csv = String::from(
        "body,particles,pairs,setup_s,bytes,rhs_ns_per_pair,step_ns_per_pair,step_us_per_particle\n",
    );
    println!(
        "| body | particles | set-up [s] | bytes/particle | right-hand side [ns/pair] | step [ns/pair/rhs] | step [us/particle] |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- |");
    for (body, overrides, stepped) in BODIES {
        for cells in SIZES {
            let name = format!("{body}/{cells}");
            if filter.as_ref().is_some_and(|f| !name.contains(f.as_str())) {
                continue;
            }
            let scene = column::scene(1.0 / f64::from(cells), overrides);
            let scene = scene.expect("the example is a scene");
            let start = cpu_seconds();
            let mut simulation = Simulation::with_threads(scene, 1).expect("it can be set up");
            let setup = cpu_seconds() - start;
            let few = 2.0 * simulation.stable_step();
            simulation.advance(few).expect("it runs");
            let (particles, pairs) = (simulation.particle_count(), simulation.pair_count());
            let bytes = simulation.memory() / particles;
            let times = PAIRS.div_ceil(3 * pairs).max(2);
            let rhs = least(|| {
                for _ in 0..times {
                    simulation.evaluate().expect("a good state");
                }
            }) / (times * pairs) as f64;
            let mut step = f64::NAN;
            if stepped {
                let mut steps = 0;
                let seconds = least(|| {
                    let before = simulation.steps();
                    // A hair less than full steps.
                    let end = simulation.time() + 0.999 * times as f64 * simulation.stable_step();
                    simulation.advance(end).expect("it runs");
                    steps = simulation.steps() - before;
                });
                step = seconds / steps as f64;
            }
            let cell = |value: f64, digits: usize| match value.is_nan() {
                true => String::new(),
                false => format!("{value:.digits$}"),
            };
            let rhs = 1e9 * rhs;
            let pair = cell(1e9 * step / (3 * pairs) as f64, 2);
            let particle = cell(1e6 * step / particles as f64, 3);
            println!(
                "| {body} | {particles} | {setup:.2} | {bytes} | {rhs:.2} | {pair} | {particle} |"
            );
            let _ = writeln!(
                csv,
                "{body},{particles},{pairs},{setup},{bytes},{rhs:.2},{pair},{particle}"
            );
        }
    }
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/target/growth.csv");
    std::fs::write(file, csv).expect("target/ can be written");
}
