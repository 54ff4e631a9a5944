//! The long comparisons with reference solutions: the tests that `cargo test` leaves out.

use anyhow::{Result, bail};
use xshell::{Shell, cmd};

use crate::extremes;
use crate::fmu_tests::soak;
use crate::tally::Tally;

/// Where the tables of the last validation are kept.
const RESULTS: &str = "examples/validation.md";

const PREAMBLE: &str = "\
# Validation

Written by `cargo xtask validate`; the quick comparisons are in `cargo test --release --test acceptance`.

The period and the amplitude of a history are fitted to all of the reference; what remains is its rest.
The extrema are also listed one by one; where a history is flat (bending), short waves of small amplitude
move the time of its extremum, and the fit tells the error of the phase better.

Asked for an accuracy (`urlsph run --tolerance`), a run announces its error with a band, here beside the true
one. The margins of the model were settled on runs of the same cases, but not on the strain energy in tension,
the top centre of the twisted column and the velocity of the cube with heat. Bars on a wall and that top centre
do not converge regularly enough within the budget of the test, and are refused.

";

pub fn validate(sh: &Shell) -> Result<()> {
    let mut results = PREAMBLE.to_owned();
    // One at a time: each of them uses all cores, and their tables should not interleave.
    let tally = Tally::run_and_read(
        cmd!(
            sh,
            "cargo test --release --all-features --tests --no-fail-fast -- --ignored --nocapture --test-threads 1"
        ),
        |line| {
            if line.starts_with("### ") {
                results += &format!("{line}\n\n");
            } else if line.starts_with('|') {
                results += &format!("{line}\n");
            } else if line.is_empty() && results.ends_with("|\n") {
                results += "\n";
            }
        },
    )?;
    println!("{} passed, {} failed", tally.passed, tally.failed);
    if tally.failed > 0 {
        bail!("the validation failed");
    }
    sh.write_file(RESULTS, results)?;
    println!("Tables: {RESULTS}");
    extremes::update(sh)?;
    soak(sh)?;
    Ok(())
}
