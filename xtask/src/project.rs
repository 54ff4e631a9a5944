//! Where things are.

use std::path::{Path, PathBuf};

use anyhow::Result;
use xshell::{Shell, cmd};

/// The repository's root.
pub fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .parent()
        .expect("xtask lies in the repository's root")
}

/// Cargo's target folder.
pub fn target() -> PathBuf {
    std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| root().join("target"), PathBuf::from)
}

/// A shell in the repository's root.
pub fn shell() -> Result<Shell> {
    let sh = Shell::new()?;
    sh.change_dir(root());
    Ok(sh)
}

/// Builds the library and the command line in release; the folder where they are.
///
/// Installation, demo and tests share this one build: the feature `cli` adds a program and leaves
/// the library as it is, but to Cargo every set of features is a library of its own.
pub fn build(sh: &Shell) -> Result<PathBuf> {
    cmd!(sh, "cargo build --release --package urlsph --features cli").run()?;
    Ok(target().join("release"))
}
