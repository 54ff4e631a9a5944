//! Tests of the FMUs through FMPy, from Python.

use anyhow::Result;
use xshell::{Shell, cmd};

use crate::tally::Tally;
use crate::{project, venv};

pub fn fmu_tests(sh: &Shell) -> Result<Tally> {
    let python = venv::python(sh)?;
    // What the Rust tests have built already.
    cmd!(sh, "cargo build --release --workspace --all-features").run()?;
    let urlsph = project::target().join("release").join("urlsph");
    Tally::run(
        cmd!(
            sh,
            "{python} -m pytest -q -p no:cacheprovider ffi-tests/python_fmi"
        )
        .env("URLSPH", urlsph),
    )
}
