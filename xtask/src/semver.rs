//! `cargo xtask semver [REVISION]`: the Rust interface against that of the last release, or of a revision.

use anyhow::{Context, Result};
use xshell::{Shell, cmd};

use crate::tools::tool;

const VERSION: &str = "0.51.0";

pub fn semver(sh: &Shell, revision: Option<&str>) -> Result<()> {
    let revision = match revision {
        Some(revision) => revision.to_owned(),
        None => cmd!(sh, "git describe --tags --abbrev=0 --match v[0-9]*")
            .quiet()
            .ignore_stderr()
            .read()
            .context("no release has a tag `v...`: give the revision to compare with")?,
    };
    let program = tool(sh, "cargo-semver-checks", VERSION)?;
    cmd!(
        sh,
        "{program} semver-checks --package urlsph --baseline-rev {revision}"
    )
    .run()
    .context("the version must say what programs in Rust are in for: add instead of changing, or raise it")
}
