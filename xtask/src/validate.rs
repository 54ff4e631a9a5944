//! The long comparisons with reference solutions: the tests that `cargo test` leaves out.

use anyhow::{Result, bail};
use xshell::{Shell, cmd};

use crate::tally::Tally;

pub fn validate(sh: &Shell) -> Result<()> {
    // One at a time: each of them uses all cores, and their tables should not interleave.
    let tally = Tally::run(cmd!(
        sh,
        "cargo test --release --all-features --tests --no-fail-fast -- --ignored --nocapture --test-threads 1"
    ))?;
    println!("{} passed, {} failed", tally.passed, tally.failed);
    if tally.failed > 0 {
        bail!("the validation failed");
    }
    Ok(())
}
