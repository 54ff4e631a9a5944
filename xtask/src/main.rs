//! The project's tasks: `cargo xtask <task>`.

mod abi;
mod bench;
mod counts;
mod demo;
mod deny;
mod extremes;
mod ffi_tests;
mod fmu_tests;
mod fuzz;
mod header;
mod install;
mod output_tests;
mod peer;
mod project;
mod semver;
mod tally;
mod test;
mod tools;
mod validate;
mod venv;
mod wheel;

use std::process::ExitCode;

use anyhow::{Result, bail};

const HELP: &str = "\
Usage: cargo xtask <TASK>

Tasks:
  abi         Programs built against an earlier release run with this library; --freeze keeps what
              the present version promises (ffi-tests/abi/README.md)
  bench       Speed against accuracy: cases with reference solutions over resolution and numerics, as
              JSON, CSV and a report under target/bench/; --quick takes a minute (bench --help)
  counts      Instructions, memory, pair-updates and errors against those expected; --update makes the
              present ones the expected ones (benches/counts/README.md)
  demo        Build the library, package a column as an FMU, co-simulate it two-way from Python;
              fields, histories and pictures under target/demo/
  deny        Licences, duplicates, sources and known vulnerabilities of what this is built from, and whether
              README.md names it all; the vulnerabilities come from GitHub
  extremes    Where the method breaks: sweeps of loads, materials, particles and units, as tables and a map under
              target/extremes/ (benches/extremes/README.md)
  ffi-tests   The tests of the C ABI alone: C, C++ and Python programs, sanitizers, valgrind, examples
  fmu-tests   The tests of the FMUs from Python alone, and the thermal coupling of two FMUs
  fuzz        [TARGET...] [--seconds N] [--minimise]: coverage-guided fuzzing of scene, mesh, snapshot, calls
              and fmi (fuzz/README.md)
  header      Generate include/urlsph.h; with --check only see whether it is up to date
  install     --prefix DIR [--destdir DIR]: command line, library, headers, pkg-config and CMake
              files
  peer        Time and errors beside LAMMPS' Smooth Mach Dynamics, one core each; the report is
              target/peer/report.md. Options: benches/peer/README.md
  semver      [REVISION]: the Rust interface against that of the last release, or of a revision, by
              cargo-semver-checks
  test        All checks and tests: format, lints, docs, Rust, C, C++, Python, FMI, a short fuzzing
  validate    The long comparisons with reference solutions, with residuals and tolerances, the extremes, and an
              FMU loaded 2,000 times and called a million times
  wheel       The Python package with the library inside, in target/wheel/
";

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match run(&arguments) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn run(arguments: &[String]) -> Result<()> {
    let sh = project::shell()?;
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match arguments.as_slice() {
        ["abi"] => abi::abi(&sh),
        ["abi", "--freeze"] => abi::freeze(&sh),
        ["bench", arguments @ ..] => bench::bench(&sh, arguments),
        ["counts", arguments @ ..] => counts::counts(&sh, arguments),
        ["deny"] => deny::deny(&sh),
        ["demo"] => demo::demo(&sh),
        ["extremes", arguments @ ..] => extremes::extremes(&sh, arguments),
        ["ffi-tests"] => ffi_tests::run(&sh),
        ["fmu-tests"] => fmu_tests::run(&sh),
        ["fuzz", arguments @ ..] => fuzz::fuzz(&sh, arguments),
        ["header"] => header::header(&sh, false),
        ["header", "--check"] => header::header(&sh, true),
        ["install", arguments @ ..] => install::install(&sh, arguments),
        ["peer", arguments @ ..] => peer::peer(&sh, arguments),
        ["semver"] => semver::semver(&sh, None),
        ["semver", revision] => semver::semver(&sh, Some(revision)),
        ["test"] => test::test(&sh),
        ["wheel"] => wheel::wheel(&sh).map(drop),
        ["validate"] => validate::validate(&sh),
        [] | ["help" | "-h" | "--help"] => {
            print!("{HELP}");
            Ok(())
        }
        other => bail!("there is no task `{}`\n\n{HELP}", other.join(" ")),
    }
}
