//! When the reference is updated: never, at every step, and when the body has strained since the last
//! update. `examples/updates.md` has the tables.

use urlsph::{Scene, Simulation};

use crate::cases::columns::{BENDING_CASE, TENSION_CASE, TWISTING_CASE};
use crate::cases::{Case, impact};
use crate::support::*;

const NEVER: &str = "never";
const EVERY_STEP: &str = "every_step";
const BY_DEFAULT: &str = "{\"when\": {}}";

fn when(strain: f64) -> String {
    format!("{{\"when\": {{\"strain\": {strain}}}}}")
}

/// What a run took and gave.
struct Outcome {
    /// Of the quantities of the case.
    errors: Vec<f64>,
    /// Energy that the scheme dissipated over the initial one.
    dissipated: f64,
    updates: u64,
    steps: u64,
    pair_updates: u64,
}

fn outcome(case: &Case, size: usize, numerics: &[&str]) -> Outcome {
    let size = &case.sizes[size];
    let mut overrides = (case.overrides)(size);
    overrides.extend(numerics.iter().map(|n| format!("numerics.{n}")));
    let overrides: Vec<&str> = overrides.iter().map(String::as_str).collect();
    let mut simulation = simulation(case.example, &overrides);
    let mut meter = Meter::default();
    let start = simulation.energies();
    let errors = (case.measure)(&mut simulation, &mut meter)
        .unwrap_or_else(|e| panic!("{} {numerics:?}: {e}", case.name));
    Outcome {
        errors: errors.into_iter().flatten().collect(),
        dissipated: simulation.energies().numerical_dissipation / (start.kinetic + start.strain),
        updates: simulation.reference_updates(),
        steps: meter.steps,
        pair_updates: meter.pair_updates,
    }
}

/// One row per schedule, for a case with operators and a kernel option.
fn table(case: &Case, size: usize, operators: &str, option: u8, schedules: &[String]) {
    println!(
        "\n### {}, {}, operators {operators}, kernel option {option}\n",
        case.title, case.sizes[size].name
    );
    let quantities: Vec<&str> = case.quantities.iter().map(|q| q.name).collect();
    println!(
        "| update | {} | D/E0 | updates | steps | pair-updates |\n|{}",
        quantities.join(" | "),
        "---|".repeat(quantities.len() + 5)
    );
    for schedule in schedules {
        let found = outcome(
            case,
            size,
            &[
                &format!("operators={operators}"),
                &format!("kernel_option={option}"),
                &format!("reference_update={schedule}"),
            ],
        );
        let errors: Vec<String> =
            (found.errors.iter().map(|e| format!("{:.2} %", 100.0 * e))).collect();
        println!(
            "| {} | {} | {:.4} | {} | {} | {:.3e} |",
            schedule.replace(['"', '{', '}'], ""),
            errors.join(" | "),
            found.dissipated,
            found.updates,
            found.steps,
            found.pair_updates as f64
        );
    }
}

/// With options 3 and 4 few updates, or none where the strain stays small, and hardly
/// more error or dissipation by them than by one per step, or much less.
#[test]
fn updates_by_strain_are_few_and_no_worse() {
    for (case, fewest) in [(BENDING_CASE, 0), (TENSION_CASE, 1), (TWISTING_CASE, 1)] {
        for operators in ["operators=kernel", "operators=repaired"] {
            for option in ["kernel_option=3", "kernel_option=4"] {
                let [every, strained] = [EVERY_STEP, BY_DEFAULT].map(|schedule| {
                    let update = format!("reference_update={schedule}");
                    outcome(&case, 0, &[operators, option, &update])
                });
                let what = format!("{} {operators} {option}", case.name);
                assert_eq!(every.updates, every.steps);
                assert!(strained.updates >= fewest, "{what}");
                for (name, ratio, tolerance) in [
                    (
                        "updates",
                        strained.updates as f64 / every.updates as f64,
                        0.05,
                    ),
                    ("error", strained.errors[0] / every.errors[0], 1.06),
                    ("dissipation", strained.dissipated / every.dissipated, 1.02),
                ] {
                    check(
                        &format!("{what}: {name} over that with updates at every step"),
                        ratio,
                        tolerance,
                    );
                }
            }
        }
    }
}

/// The decision is written nowhere: a restored run takes it from the state again.
#[test]
fn a_restored_run_updates_at_the_same_steps() {
    let overrides = [
        "numerics.kernel_option=3",
        "numerics.operators=repaired",
        "numerics.reference_update={\"when\": {\"strain\": 0.05}}",
    ];
    let mut straight = column("column_tension", M1, &overrides);
    straight.advance(0.01).unwrap_or_else(|e| panic!("{e}"));
    let (snapshot, before) = (straight.snapshot(), straight.reference_updates());
    straight.advance(0.03).unwrap_or_else(|e| panic!("{e}"));
    let made = straight.reference_updates() - before;
    assert!(before > 0 && made > 0, "{before} updates, then {made}");
    for threads in [1, 2] {
        let mut all = vec!["geometry.box.spacing=0.25"];
        all.extend(overrides);
        let mut restored = with_threads("column_tension", &all, threads);
        restored
            .restore(&snapshot)
            .unwrap_or_else(|e| panic!("{e}"));
        restored.advance(0.03).unwrap_or_else(|e| panic!("{e}"));
        println!(
            "{made} updates after {before}, {threads} threads: {:016x}",
            restored.state_hash()
        );
        assert_eq!(restored.state_hash(), straight.state_hash());
        assert_eq!(restored.reference_updates(), made);
    }
}

/// A free block with an initial velocity.
fn block(velocity: &str) -> Simulation {
    let text = format!(
        r#"{{"geometry": {{"box": {{"min": [0, 0, 0], "max": [2, 1, 1], "spacing": 0.25}}}},
        "material": {{"neo_hookean": {{"density": 1100, "youngs_modulus": 1.7e7, "poisson_ratio": 0.3}}}},
        "initial": {{"velocity": {velocity}}},
        "numerics": {{"kernel_option": 3, "reference_update": {{"when": {{}}}}}},
        "time": {{"end": 1}}}}"#
    );
    let scene = Scene::from_json(&text, &[]).unwrap_or_else(|e| panic!("{e}"));
    Simulation::with_threads(scene, 1).unwrap_or_else(|e| panic!("{e}"))
}

/// A flight, and a turn by more than half a revolution, are no reason for an update.
#[test]
fn rigid_motion_needs_no_update() {
    for velocity in ["[30, -20, 10]", r#"["-5*(Y - 0.5)", "5*(X - 1)", 0]"#] {
        let mut block = block(velocity);
        run(&mut block, 0.7, |_| ());
        println!(
            "{velocity}: {} updates in {} steps",
            block.reference_updates(),
            block.steps()
        );
        assert!(block.steps() > 100 && block.reference_updates() == 0);
    }
}

fn schedules(strains: &[f64]) -> Vec<String> {
    [NEVER, EVERY_STEP]
        .into_iter()
        .map(str::to_owned)
        .chain(strains.iter().map(|s| when(*s)))
        .collect()
}

#[test]
#[ignore = "tables of examples/updates.md: cargo xtask validate"]
fn thresholds() {
    let all = schedules(&[0.02, 0.05, 0.1, 0.2, 0.4]);
    for case in [BENDING_CASE, TENSION_CASE, TWISTING_CASE] {
        for operators in ["kernel", "repaired"] {
            for option in [3, 4] {
                table(&case, 0, operators, option, &all);
            }
        }
        table(&case, 0, "kernel", 1, &schedules(&[0.1]));
        table(&case, 0, "kernel", 2, &schedules(&[0.1]));
    }
}

#[test]
#[ignore = "tables of examples/updates.md: cargo xtask validate"]
fn thresholds_on_finer_columns_and_a_bar() {
    let some = schedules(&[0.05, 0.1, 0.2]);
    for case in [BENDING_CASE, TWISTING_CASE] {
        for operators in ["kernel", "repaired"] {
            table(&case, 1, operators, 3, &some);
        }
    }
    table(&impact::COPPER, 0, "repaired", 3, &some);
    table(&impact::COPPER, 0, "kernel", 3, &some);
}
