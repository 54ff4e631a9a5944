//! Tests of the FMUs through FMPy, from Python, and the example that couples one with another FMU.

use std::path::Path;

use anyhow::{Result, ensure};
use xshell::{Shell, cmd};

use crate::tally::Tally;
use crate::{project, venv};

/// `cargo xtask fmu-tests`: these alone.
pub fn run(sh: &Shell) -> Result<()> {
    let tally = fmu_tests(sh)?;
    println!("{} passed, {} failed", tally.passed, tally.failed);
    ensure!(tally.failed == 0, "the tests of the FMUs failed");
    Ok(())
}

/// Runs all of them.
pub fn fmu_tests(sh: &Shell) -> Result<Tally> {
    let python = venv::python(sh)?;
    let urlsph = project::build(sh)?.join("urlsph");
    let mut tally = Tally::run(
        cmd!(
            sh,
            "{python} -B -m pytest -q -p no:cacheprovider ffi-tests/python_fmi"
        )
        .env("URLSPH", &urlsph),
    )?;
    tally += Tally::of(thermal_coupling(sh, &python, &urlsph));
    Ok(tally)
}

/// The library loaded 2,000 times, and a million calls of each kind on one instance.
pub fn soak(sh: &Shell) -> Result<()> {
    let python = venv::python(sh)?;
    let urlsph = project::build(sh)?.join("urlsph");
    cmd!(
        sh,
        "{python} -B -m pytest -q -s -p no:cacheprovider ffi-tests/python_fmi/test_soak.py"
    )
    .env("URLSPH", &urlsph)
    .env("URLSPH_SOAK", "100")
    .run()?;
    Ok(())
}

/// examples/coupling_thermal: a film of ours and a substrate of somebody else, both FMUs. The script
/// checks what must hold.
fn thermal_coupling(sh: &Shell, python: &Path, urlsph: &Path) -> Result<()> {
    const EXAMPLE: &str = "examples/coupling_thermal";
    let out = project::target().join("coupling_thermal");
    sh.remove_path(&out)?;
    sh.create_dir(&out)?;
    cmd!(
        sh,
        "{python} -B -m pythonfmu3 build --file {EXAMPLE}/substrate.py --dest {out}"
    )
    .quiet()
    .run()?;
    let films = ["3", "2"].map(|version| (version, out.join(format!("film{version}.fmu"))));
    for (version, film) in &films {
        cmd!(
            sh,
            "{urlsph} fmu {EXAMPLE}/scene.json --output {film} --fmi {version}"
        )
        .quiet()
        .run()?;
    }
    let films = films.map(|(_, film)| film);
    let said = cmd!(
        sh,
        "{python} -B {EXAMPLE}/cosimulate.py --film {films...} --substrate {out}/Substrate.fmu --out {out}"
    )
    .quiet()
    .read()?;
    println!("{said}");
    ensure!(
        said.contains("the thermal coupling holds"),
        "{EXAMPLE} does not say that the coupling holds"
    );
    Ok(())
}
