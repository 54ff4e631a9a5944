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
    let venv = project::target().join("venv");
    let python = venv.join("bin").join("python");
    let requirements = sh.read_file(REQUIREMENTS)?;
    // Written last: an interrupted installation leaves no stamp and is done again.
    let stamp = venv.join("installed-requirements.txt");
    if python.exists() && sh.read_file(&stamp).is_ok_and(|text| text == requirements) {
        return Ok(python);
    }
    let system = std::env::var("PYTHON").unwrap_or_else(|_| "python3".to_owned());
    eprintln!("Making a Python environment in {}", venv.display());
    sh.remove_path(&venv)?;
    cmd!(sh, "{system} -m venv {venv}")
        .run()
        .context("no virtual environment: is Python 3 there, with its venv module (Debian: apt install python3-venv)?")?;
    cmd!(
        sh,
        "{python} -m pip install --quiet --disable-pip-version-check -r {REQUIREMENTS}"
    )
    .run()
    .context("the Python packages of the tests could not be installed")?;
    sh.write_file(&stamp, requirements)?;
    Ok(python)
}
