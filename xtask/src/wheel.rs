//! `cargo xtask wheel`: the Python package with the shared library inside, in target/wheel/.

use std::path::PathBuf;

use anyhow::{Context, Result, bail};
use xshell::{Shell, cmd};

use crate::{project, venv};

/// What the package consists of, beside the library.
const SOURCES: &str = "include/python";

/// Builds the wheel; its path.
pub fn wheel(sh: &Shell) -> Result<PathBuf> {
    let python = venv::python(sh)?;
    let built = project::build(sh)?;
    let folder = project::target().join("wheel");
    // A copy, so that neither the library nor what setuptools leaves behind gets into the sources.
    let stage = folder.join("stage");
    sh.remove_path(&folder)?;
    let package = stage.join("urlsph");
    sh.create_dir(&package)?;
    for file in ["pyproject.toml", "setup.py", "README.md"] {
        sh.copy_file(format!("{SOURCES}/{file}"), &stage)?;
    }
    for licence in ["LICENSE-APACHE", "LICENSE-MIT"] {
        sh.copy_file(licence, &stage)?;
    }
    for file in sh.read_dir(format!("{SOURCES}/urlsph"))? {
        if file.is_file() {
            sh.copy_file(file, &package)?;
        }
    }
    sh.copy_file(built.join(library()), &package)?;
    cmd!(
        sh,
        "{python} -m pip wheel --quiet --disable-pip-version-check --no-deps --wheel-dir {folder} {stage}"
    )
    .run()
    .context("the wheel could not be built")?;
    let wheels: Vec<PathBuf> = sh
        .read_dir(&folder)?
        .into_iter()
        .filter(|p| p.extension().is_some_and(|e| e == "whl"))
        .collect();
    let [wheel] = wheels.as_slice() else {
        bail!(
            "one wheel expected in {}, found {wheels:?}",
            folder.display()
        );
    };
    println!("{}", wheel.display());
    Ok(wheel.clone())
}

/// Name of the shared library, as Cargo builds it and as the package looks for it.
fn library() -> &'static str {
    if cfg!(target_os = "macos") {
        "liburlsph.dylib"
    } else if cfg!(windows) {
        "urlsph.dll"
    } else {
        "liburlsph.so"
    }
}
