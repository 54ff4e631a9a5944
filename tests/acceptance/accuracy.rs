//! Asked for an accuracy: whether the error that is announced holds the true one, from the reference
//! solutions of the cases.

use cpu_time::ProcessTime;
use urlsph::accuracy::{Ask, Band, Report, Run, Search, Series, Task};
use urlsph::{Control, Scene, Simulation};

use crate::cases::{impact, slab};
use crate::support::*;

/// The reference solution at a time.
enum Truth {
    /// Columns of the example's table; the scene's history is at its rows. An offset is added.
    Table(&'static [&'static str], f64),
    Exact(fn(f64) -> f64),
}

use Truth::{Exact, Table as Columns};

/// A scene, what is asked for, and the reference.
struct Question {
    case: &'static str,
    overrides: &'static [&'static str],
    of: &'static str,
    tolerance: f64,
    truth: Truth,
    /// [CPU s].
    budget: f64,
}

const TENSION: Question = Question {
    case: "column_tension",
    overrides: &["output.history_interval=0.001"],
    of: "probe.top_centre.displacement[2]",
    tolerance: 0.02,
    truth: Columns(&["probe.top_centre.displacement[2]"], 0.0),
    budget: 100.0,
};
const TENSION_ENERGY: Question = Question {
    of: "energy.kinetic",
    tolerance: 0.005,
    truth: Columns(&["energy.kinetic"], 0.0),
    ..TENSION
};
const TENSION_STRAIN: Question = Question {
    of: "energy.strain",
    tolerance: 0.01,
    truth: Columns(&["energy.strain"], 0.0),
    ..TENSION
};
const BENDING: Question = Question {
    case: "column_bending",
    overrides: &["output.history_interval=0.004"],
    of: "probe.top_corner.displacement",
    tolerance: 0.02,
    truth: Columns(
        &[
            "probe.top_corner.displacement[1]",
            "probe.top_corner.displacement[2]",
            "probe.top_corner.displacement[3]",
        ],
        0.0,
    ),
    ..TENSION
};
const BENDING_CENTRE: Question = Question {
    of: "probe.top_centre.displacement",
    tolerance: 0.005,
    truth: Columns(
        &[
            "probe.top_centre.displacement[1]",
            "probe.top_centre.displacement[2]",
            "probe.top_centre.displacement[3]",
        ],
        0.0,
    ),
    ..BENDING
};
const BENDING_ENERGY: Question = Question {
    of: "energy.kinetic",
    tolerance: 0.03,
    truth: Columns(&["energy.kinetic"], 0.0),
    ..BENDING
};
const TWISTING: Question = Question {
    case: "column_twisting",
    of: "energy.kinetic",
    tolerance: 0.05,
    truth: Columns(&["energy.kinetic"], 0.0),
    ..TENSION
};
const TWISTING_STRAIN: Question = Question {
    of: "energy.strain",
    truth: Columns(&["energy.strain"], 0.0),
    ..TWISTING
};
const TWISTING_CENTRE: Question = Question {
    of: "probe.top_centre.displacement[2]",
    tolerance: 0.1,
    truth: Columns(&["probe.top_centre.displacement[2]"], 0.0),
    ..TWISTING
};
const ELASTIC_CUBE: Question = Question {
    case: "elastic_cube",
    overrides: &["output.history_interval=0.0002"],
    of: "probe.x_face_centre.displacement[1]",
    tolerance: 0.03,
    truth: Columns(&["probe.x_face_centre.displacement[1]"], 0.0),
    ..TENSION
};
const ELASTIC_CUBE_VELOCITY: Question = Question {
    of: "probe.x_face_centre.velocity[1]",
    tolerance: 0.1,
    truth: Columns(&["probe.x_face_centre.velocity[1]"], 0.0),
    ..ELASTIC_CUBE
};
const HOT_CUBE: Question = Question {
    case: "swinging_cube",
    tolerance: 0.01,
    ..ELASTIC_CUBE
};
const HOT_CUBE_VELOCITY: Question = Question {
    of: "probe.x_face_centre.velocity[1]",
    tolerance: 0.03,
    truth: Columns(&["probe.x_face_centre.velocity[1]"], 0.0),
    ..HOT_CUBE
};
const HOT_CUBE_TEMPERATURE: Question = Question {
    of: "probe.origin.temperature",
    truth: Columns(&["probe.origin.temperature"], 0.0),
    ..HOT_CUBE
};
const WAVE: Question = Question {
    case: "thermo_wave",
    overrides: &[
        "output.history_interval=4.7399145292e-04",
        "time.end=0.0497691",
    ],
    of: "probe.antinode.displacement[1]",
    tolerance: 0.01,
    truth: Columns(&["probe.antinode.displacement[1]"], 0.0),
    ..TENSION
};
const WAVE_TEMPERATURE: Question = Question {
    of: "probe.end.temperature",
    truth: Columns(&["probe.end.temperature"], 0.0),
    ..WAVE
};
/// Diffusivity of the slab over the square of its thickness [1/s].
const RATE: f64 = 20.0;
const SLAB: Question = Question {
    case: "slab_heating",
    overrides: &[],
    of: "probe.back.temperature",
    tolerance: 0.001,
    truth: Exact(|t| slab_at(1.0, t)),
    ..TENSION
};
const SLAB_SURFACE: Question = Question {
    of: "probe.surface.temperature",
    truth: Exact(|t| slab_at(0.0, t)),
    ..SLAB
};
const CABLE: Question = Question {
    case: "cable",
    overrides: &[],
    of: "probe.end.displacement[1]",
    tolerance: 0.02,
    // The end goes out and back with the velocity of the load over the impedance, 1e-3 m/s.
    truth: Exact(|t| 1e-3 * if t < 20.0 { t } else { 40.0 - t }),
    ..TENSION
};
const CABLE_MIDDLE: Question = Question {
    of: "probe.middle.displacement[1]",
    tolerance: 0.01,
    truth: Columns(&["probe.middle.displacement[1]"], 0.0),
    ..CABLE
};
/// A quarter of the impact, which costs a quarter.
const COPPER: Question = Question {
    case: "copper_impact",
    overrides: &["time.end=2e-5", "output.history_interval=2e-6"],
    of: "probe.rim.displacement[1]",
    tolerance: 0.06,
    truth: Columns(&["radius"], -3.2e-3),
    budget: 150.0,
};
const COPPER_LENGTH: Question = Question {
    of: "probe.top.displacement[3]",
    tolerance: 0.01,
    truth: Columns(&["length"], -3.24e-2),
    ..COPPER
};

/// The end of the impact, which the reference is known of.
const JOHNSON_COOK: Question = Question {
    case: "taylor_johnson_cook",
    overrides: &["output.history_interval=8e-5"],
    of: "probe.top.displacement[3]",
    tolerance: 0.02,
    truth: Exact(|t| t / 8e-5 * (impact::LENGTH.value - 0.0324)),
    budget: 150.0,
};

fn slab_at(xi: f64, time: f64) -> f64 {
    // The series converges slowly at the start.
    if time == 0.0 {
        slab::COLD
    } else {
        slab::heated(xi, RATE * time)
    }
}

/// CPU time of this process [s].
fn cpu_seconds() -> f64 {
    ProcessTime::now().as_duration().as_secs_f64()
}

/// What came of a question: the report and the true error of its final run, or why it was refused.
fn ask(question: &Question) -> urlsph::Result<(Report, f64)> {
    let scene: Scene = scene(question.case, question.overrides);
    let mut search = Search::new(
        &scene,
        Ask {
            tolerance: question.tolerance,
            budget: question.budget,
        },
    )?;
    let mut last = None;
    while let Some(task) = search.next_task()? {
        let start = cpu_seconds();
        let made = Simulation::with_threads(task.level().scene.clone(), 1)
            .and_then(|mut s| Run::make(&mut s, question.of, &mut |_| Control::Continue));
        match made {
            Ok(mut run) => {
                run.cpu_seconds = cpu_seconds() - start;
                if matches!(task, Task::Final(..)) {
                    last = Some(run.series.clone());
                }
                search.succeeded(&task, run);
            }
            Err(error) => search.failed(&task, error)?,
        }
    }
    let report = search.report().expect("a final run was made");
    let truth = truth(question, &scene);
    let error = last.expect("a final run was made").distance(&truth).0 / truth.size();
    Ok((report, error))
}

/// The reference at the instants of the scene's history.
fn truth(question: &Question, scene: &Scene) -> Series {
    let end = scene.time.end;
    let interval = scene.output.history_interval.unwrap_or(end / 200.0);
    let rows = (end / interval - 1e-6).ceil() as u32;
    let times = (0..=rows).map(|k| (f64::from(k) * interval).min(end));
    let thermal = question.of.ends_with("temperature");
    let (components, values): (usize, Vec<f64>) = match &question.truth {
        Columns(names, offset) => {
            let table = Table::expected(question.case);
            let columns: Vec<usize> = names.iter().map(|name| table.column(name)).collect();
            let row = |t: f64| columns.iter().map(move |&c| (c, t)).collect::<Vec<_>>();
            let values = times.flat_map(row).map(|(c, t)| table.at(c, t) + offset);
            (names.len(), values.collect())
        }
        Exact(exact) => (1, times.map(exact).collect()),
    };
    Series::new(components, values, thermal).expect("whole rows")
}

fn inside(band: Band, error: f64) -> bool {
    band.low <= error && error <= band.high
}

#[track_caller]
fn holds(question: &Question) {
    let (report, error) = ask(question).unwrap_or_else(|e| panic!("{e}"));
    let band = report.estimate;
    println!(
        "{} {}: true error {:.3} %, announced {:.3} to {:.3} % (tolerance {} %)",
        question.case,
        question.of,
        100.0 * error,
        100.0 * band.low,
        100.0 * band.high,
        100.0 * question.tolerance
    );
    assert!(report.met && error <= question.tolerance);
    assert!(inside(band, error));
}

#[test]
fn the_error_of_the_bending_column_is_inside_the_announced_band() {
    holds(&BENDING);
}

#[test]
fn the_error_of_the_heated_slab_is_inside_the_announced_band() {
    holds(&SLAB);
}

/// Nine of ten announced bands hold the true error; what is refused announces nothing. The margins of the
/// model were settled on runs of these cases, but not on the energy of the column in tension, the top
/// centre of the twisted one and the velocity of the cube with heat.
#[test]
#[ignore = "minutes: cargo xtask validate"]
fn announced_bands_hold_the_true_errors() {
    let questions = [
        TENSION,
        TENSION_ENERGY,
        TENSION_STRAIN,
        BENDING,
        BENDING_CENTRE,
        BENDING_ENERGY,
        TWISTING,
        TWISTING_STRAIN,
        TWISTING_CENTRE,
        ELASTIC_CUBE,
        ELASTIC_CUBE_VELOCITY,
        HOT_CUBE,
        HOT_CUBE_VELOCITY,
        HOT_CUBE_TEMPERATURE,
        WAVE,
        WAVE_TEMPERATURE,
        SLAB,
        SLAB_SURFACE,
        CABLE,
        CABLE_MIDDLE,
        COPPER,
        COPPER_LENGTH,
        JOHNSON_COOK,
    ];
    println!("\n### Asked for an accuracy: announced and true errors\n");
    println!(
        "| scene | quantity | tolerance | announced | best | high/low | true | inside | pilots | CPU s of pilots, foreseen and taken by the final run |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|");
    let (mut announced, mut held) = (0, 0);
    for question in &questions {
        let start = format!(
            "| {} | `{}` | {} % |",
            question.case,
            question.of,
            100.0 * question.tolerance
        );
        match ask(question) {
            Err(error) => {
                // The reason; what helps comes after it.
                let reason = error.message().split(';').next().unwrap_or_default();
                println!("{start} refused: {reason} | | | | | | |");
            }
            Ok((report, error)) => {
                let (band, inside) = (report.estimate, inside(report.estimate, error));
                announced += 1;
                held += u32::from(inside);
                let cpu = |role: &str| {
                    let of = report.runs.iter().filter(|r| r.role == role);
                    of.filter_map(|r| Some(r.cost?.cpu_seconds)).sum::<f64>()
                };
                println!(
                    "{start} {:.3} to {:.3} % | {:.3} % | {:.1} | {:.3} % | {} | {} | {:.2}, {:.2}, {:.2} |",
                    100.0 * band.low,
                    100.0 * band.high,
                    100.0 * band.best,
                    band.ratio(),
                    100.0 * error,
                    if inside { "yes" } else { "**no**" },
                    report.runs.iter().filter(|r| r.role == "pilot").count(),
                    cpu("pilot"),
                    report.prediction.map_or(0.0, |p| p.cost.cpu_seconds),
                    cpu("final"),
                );
            }
        }
    }
    println!("\n{held} of {announced} announced bands hold the true error");
    assert!(announced >= 10 && 10 * held >= 9 * announced);
}
