//! Where the method breaks: `benches/extremes`, its tables and pictures.

use std::path::Path;

use anyhow::Result;
use xshell::{Shell, cmd};

use crate::tally::Tally;
use crate::{project, venv};

/// What is committed of the results, beside the program.
const RESULTS: [&str; 4] = ["results.csv", "results.md", "map.png", "cfl.png"];

/// Runs sweeps, and draws them.
pub fn extremes(sh: &Shell, arguments: &[&str]) -> Result<()> {
    if arguments.iter().any(|a| ["-h", "--help"].contains(a)) {
        return program(sh, arguments);
    }
    let out = project::target().join("extremes");
    run(sh, arguments, &out)?;
    println!("Map: {}", out.join("map.png").display());
    Ok(())
}

/// Runs all of them, and keeps the results in the repository.
pub fn update(sh: &Shell) -> Result<()> {
    extremes(sh, &[])?;
    for file in RESULTS {
        let from = project::target().join("extremes").join(file);
        sh.copy_file(from, format!("benches/extremes/{file}"))?;
    }
    Ok(())
}

/// Some sweeps of a second each, from the runs to the report: what became of them is what is committed.
pub fn extremes_tests(sh: &Shell) -> Result<Tally> {
    let python = venv::python(sh)?;
    let folder = sh.create_temp_dir()?;
    let out = folder.path();
    let quick = ["length", "weight", "cooling", "jitter", "impact-rubber"];
    let arguments: Vec<&str> = quick.iter().flat_map(|name| ["--sweep", name]).collect();
    run(sh, &arguments, out)?;
    Ok(Tally::of(
        cmd!(
            sh,
            "{python} -B benches/extremes/report.py {out} benches/extremes/results.csv"
        )
        .run(),
    ))
}

fn run(sh: &Shell, arguments: &[&str], out: &Path) -> Result<()> {
    let python = venv::python(sh)?;
    let folder = out.display().to_string();
    program(sh, &[arguments, &["--out", &folder]].concat())?;
    cmd!(sh, "{python} -B benches/extremes/report.py {out}").run()?;
    Ok(())
}

fn program(sh: &Shell, arguments: &[&str]) -> Result<()> {
    cmd!(
        sh,
        "cargo bench --quiet --profile release --all-features --bench extremes -- {arguments...}"
    )
    .quiet()
    .run()?;
    Ok(())
}
