//! All checks and tests, one summary line per part at the end.

use std::time::{Duration, Instant};

use anyhow::{Result, bail};
use xshell::{Shell, cmd};

use crate::abi::abi_tests;
use crate::bench::bench_tests;
use crate::counts::counts_tests;
use crate::deny::deny_tests;
use crate::extremes::extremes_tests;
use crate::ffi_tests::ffi_tests;
use crate::fmu_tests::fmu_tests;
use crate::fuzz::fuzz_tests;
use crate::output_tests::output_tests;
use crate::peer::peer_tests;
use crate::tally::Tally;

/// A part of the tests: what it is called and how it is run.
type Part = (&'static str, fn(&Shell) -> Result<Tally>);

/// Cheap checks first; everything in the release profile, so that nothing is built twice.
const PARTS: &[Part] = &[
    ("format", format),
    ("lints", lints),
    ("no features", no_features),
    ("documentation", documentation),
    ("dependencies", deny_tests),
    ("rust", rust),
    ("output files", output_tests),
    ("bench", bench_tests),
    ("extremes", extremes_tests),
    ("counts", counts_tests),
    ("abi", abi_tests),
    ("C, C++, Python", ffi_tests),
    ("fmu", fmu_tests),
    ("peer", peer_tests),
    ("fuzz", fuzz_tests),
];

pub fn test(sh: &Shell) -> Result<()> {
    let mut results: Vec<(&str, Tally, Duration)> = Vec::new();
    for (name, run) in PARTS {
        println!("\n== {name}");
        let start = Instant::now();
        // A part that cannot be run has failed; the others still tell what they know.
        let tally = run(sh).unwrap_or_else(|error| Tally::of(Err::<(), _>(error)));
        results.push((name, tally, start.elapsed()));
    }
    println!("\n== summary");
    let mut total = Tally::default();
    for (name, tally, duration) in &results {
        let verdict = if tally.failed == 0 { "ok" } else { "FAILED" };
        println!(
            "{name:<16} {verdict:<6} {:>5} passed {:>5} failed {:>7.1} s",
            tally.passed,
            tally.failed,
            duration.as_secs_f64()
        );
        total += *tally;
    }
    println!("{} passed, {} failed", total.passed, total.failed);
    if total.failed > 0 {
        bail!("the tests failed");
    }
    Ok(())
}

fn format(sh: &Shell) -> Result<Tally> {
    Ok(Tally::of(cmd!(sh, "cargo fmt --all --check").run()))
}

fn lints(sh: &Shell) -> Result<Tally> {
    let strict = "-Dwarnings";
    Ok(Tally::of(
        cmd!(
            sh,
            "cargo clippy --release --workspace --all-features --all-targets -- {strict}"
        )
        .run(),
    ))
}

/// The library that an embedding program pays for compiles without the FMU and the command line.
fn no_features(sh: &Shell) -> Result<Tally> {
    let strict = "-Dwarnings";
    Ok(Tally::of(
        cmd!(
            sh,
            "cargo clippy --release --package urlsph --lib --tests --no-default-features -- {strict}"
        )
        .run(),
    ))
}

fn documentation(sh: &Shell) -> Result<Tally> {
    Ok(Tally::of(
        cmd!(
            sh,
            "cargo doc --release --package urlsph --lib --all-features --no-deps"
        )
        .env("RUSTDOCFLAGS", "-Dwarnings")
        .run(),
    ))
}

fn rust(sh: &Shell) -> Result<Tally> {
    Tally::run(cmd!(
        sh,
        "cargo test --release --workspace --all-features --no-fail-fast"
    ))
}
