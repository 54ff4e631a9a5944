//! Tests of the FMUs through FMPy, from Python.

use anyhow::Result;
use xshell::{Shell, cmd};

use crate::tally::Tally;
use crate::{project, venv};

pub fn fmu_tests(sh: &Shell) -> Result<Tally> {
    let python = venv::python(sh)?;
    let urlsph = project::build(sh)?.join("urlsph");
    Tally::run(
        cmd!(
            sh,
            "{python} -B -m pytest -q -p no:cacheprovider ffi-tests/python_fmi"
        )
        .env("URLSPH", urlsph),
    )
}
