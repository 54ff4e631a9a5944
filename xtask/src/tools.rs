//! Cargo's own tools, at pinned versions under the target folder.

use std::path::PathBuf;

use anyhow::{Context, Result};
use xshell::{Shell, cmd};

use crate::project;

/// The program of a crate, which is built at the first use, without those of its features that are on by default:
/// they are about how it talks to the network. Not optimised: it has seconds of work, and would take minutes to build.
pub fn tool(sh: &Shell, name: &str, version: &str) -> Result<PathBuf> {
    let root = project::target().join("tools");
    cmd!(
        sh,
        "cargo install --quiet {name} --version ={version} --locked --no-default-features --debug --root {root}"
    )
    .quiet()
    .env("CARGO_PROFILE_DEV_DEBUG", "0")
    .run()
    .with_context(|| format!("{name} cannot be installed"))?;
    Ok(root.join("bin").join(name))
}
