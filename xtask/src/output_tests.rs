//! The files of `urlsph run`, read by a program that is not ours.

use anyhow::Result;
use xshell::{Shell, cmd};

use crate::tally::Tally;
use crate::{project, venv};

pub fn output_tests(sh: &Shell) -> Result<Tally> {
    let python = venv::python(sh)?;
    let urlsph = project::build(sh)?.join("urlsph");
    let folder = sh.create_temp_dir()?;
    let out = folder.path();
    cmd!(
        sh,
        "{urlsph} run examples/column_bending/scene.json --out {out} --quiet --until 0.02 --set output.history_interval=0.002 --set output.field_interval=0.004"
    )
    .run()?;
    Tally::run(cmd!(sh, "{python} ffi-tests/output/check_run.py {out}"))
}
