//! A Python of our own under the target folder, with the pinned packages of the tests and the demo.

use std::path::PathBuf;

use anyhow::{Context, Result};
use xshell::{Shell, cmd};

use crate::project;

/// The pinned packages.
const REQUIREMENTS: &str = "ffi-tests/requirements.txt";

/// The interpreter of the environment, which is made at the first use and whenever the
/// requirements have changed.
pub fn python(sh: &Shell) -> Result<PathBuf> {
    let venv = folder();
    let python = venv.join("bin").join("python");
    if python.exists() && is_installed(sh, REQUIREMENTS)? {
        return Ok(python);
    }
    let system = std::env::var("PYTHON").unwrap_or_else(|_| "python3".to_owned());
    eprintln!("Making a Python environment in {}", venv.display());
    sh.remove_path(&venv)?;
    cmd!(sh, "{system} -m venv {venv}")
        .run()
        .context("no virtual environment: is Python 3 there, with its venv module (Debian: apt install python3-venv)?")?;
    add(sh, REQUIREMENTS)?;
    Ok(python)
}

/// Adds the packages of a file to the environment, unless they are there: for what only some tasks need.
pub fn add(sh: &Shell, requirements: &str) -> Result<()> {
    if is_installed(sh, requirements)? {
        return Ok(());
    }
    let python = folder().join("bin").join("python");
    cmd!(
        sh,
        "{python} -m pip install --quiet --disable-pip-version-check -r {requirements}"
    )
    .run()
    .with_context(|| format!("the Python packages of {requirements} could not be installed"))?;
    // Written last: an interrupted installation leaves no stamp and is done again.
    sh.write_file(stamp(requirements), sh.read_file(requirements)?)?;
    Ok(())
}

fn folder() -> PathBuf {
    project::target().join("venv")
}

/// What has been installed from a file; it goes with the environment.
fn stamp(requirements: &str) -> PathBuf {
    folder().join(format!("installed-{}", requirements.replace('/', "-")))
}

fn is_installed(sh: &Shell, requirements: &str) -> Result<bool> {
    let wanted = sh.read_file(requirements)?;
    Ok(sh
        .read_file(stamp(requirements))
        .is_ok_and(|text| text == wanted))
}
