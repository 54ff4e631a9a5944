//! The demonstration: an elastic column as an FMU, coupled two-way with a structural model in Python.

use std::time::Instant;

use anyhow::Result;
use xshell::{Shell, cmd};

use crate::{project, venv};

/// The scene of the column; the Python driver reads it too.
const SCENE: &str = "examples/demo/scene.json";

pub fn demo(sh: &Shell) -> Result<()> {
    let python = venv::python(sh)?;
    let urlsph = project::build(sh)?.join("urlsph");
    let out = project::target().join("demo");
    let start = Instant::now();
    sh.remove_path(&out)?;
    sh.create_dir(&out)?;
    let fmu = out.join("column.fmu");
    cmd!(sh, "{urlsph} fmu {SCENE} --output {fmu} --fmi 3").run()?;
    let alone = out.join("alone");
    cmd!(sh, "{urlsph} run {SCENE} --out {alone}").run()?;
    cmd!(
        sh,
        "{python} examples/demo/cosimulate.py --fmu {fmu} --alone {alone} --out {out}"
    )
    .run()?;
    println!(
        "The demo took {:.0} s after the build; see {}",
        start.elapsed().as_secs_f64(),
        out.display()
    );
    Ok(())
}
