//! `cargo xtask deny`: what the project is built from. Licences, duplicates and sources by cargo-deny, whose rules are
//! in `deny.toml`; and whether README.md names every dependency.

use std::collections::BTreeSet;

use anyhow::{Context, Result, ensure};
use serde_json::Value;
use xshell::{Shell, cmd};

use crate::tally::Tally;
use crate::tools::tool;

const VERSION: &str = "0.20.2";
const README: &str = "README.md";
const WORKSPACES: [&str; 2] = ["Cargo.toml", FUZZ];
const FUZZ: &str = "fuzz/Cargo.toml";
const REQUIREMENTS: [&str; 2] = [
    "ffi-tests/requirements.txt",
    "benches/peer/requirements.txt",
];

/// `cargo xtask deny`: with known vulnerabilities, which takes the database of RustSec from GitHub.
pub fn deny(sh: &Shell) -> Result<()> {
    let tally = deny_tests(sh)?;
    ensure!(
        tally.failed == 0,
        "deny.toml and README.md do not allow these dependencies"
    );
    for manifest in WORKSPACES {
        check(sh, manifest, &["advisories"])
            .context("a dependency has a known fault, or GitHub, which has the list of them, cannot be reached")?;
    }
    Ok(())
}

/// What can be checked without GitHub.
pub fn deny_tests(sh: &Shell) -> Result<Tally> {
    let mut tally = Tally::of(check(sh, "Cargo.toml", &["licenses", "bans", "sources"]));
    // Nobody embeds the fuzz targets: duplicates do no harm there.
    tally += Tally::of(check(sh, FUZZ, &["licenses", "sources"]));
    tally += Tally::of(documented(sh));
    Ok(tally)
}

fn check(sh: &Shell, manifest: &str, what: &[&str]) -> Result<()> {
    let program = tool(sh, "cargo-deny", VERSION)?;
    cmd!(
        sh,
        "{program} --locked --manifest-path {manifest} check --hide-inclusion-graph {what...}"
    )
    .run()
    .with_context(|| {
        format!("{manifest}: update or replace the dependency, or give deny.toml a reason")
    })
}

/// README.md names every crate and every Python package that is asked for, and no other.
fn documented(sh: &Shell) -> Result<()> {
    let mut wanted = BTreeSet::new();
    for manifest in WORKSPACES {
        let metadata = cmd!(
            sh,
            "cargo metadata --locked --no-deps --format-version 1 --manifest-path {manifest}"
        );
        wanted.extend(crates(&serde_json::from_str(&metadata.quiet().read()?)?)?);
    }
    for requirements in REQUIREMENTS {
        wanted.extend(packages(&sh.read_file(requirements)?)?);
    }
    let named = named(&sh.read_file(README)?)?;
    let list = |names: Vec<&String>| {
        names
            .iter()
            .map(|n| n.as_str())
            .collect::<Vec<_>>()
            .join(", ")
    };
    let missing: Vec<&String> = wanted.difference(&named).collect();
    ensure!(
        missing.is_empty(),
        "{README}, \"Dependencies\", does not say what these are for: {}",
        list(missing)
    );
    let gone: Vec<&String> = named.difference(&wanted).collect();
    ensure!(
        gone.is_empty(),
        "{README}, \"Dependencies\", names what is not needed any more: {}",
        list(gone)
    );
    Ok(())
}

/// What the packages of a workspace ask for, but for each other.
fn crates(metadata: &Value) -> Result<BTreeSet<String>> {
    let packages = metadata["packages"]
        .as_array()
        .context("metadata without packages")?;
    Ok(packages
        .iter()
        .filter_map(|package| package["dependencies"].as_array())
        .flatten()
        .filter(|dependency| dependency["path"].is_null())
        .filter_map(|dependency| dependency["name"].as_str())
        .map(str::to_owned)
        .collect())
}

/// The packages of a requirements file; each has one version.
fn packages(requirements: &str) -> Result<BTreeSet<String>> {
    requirements
        .lines()
        .map(str::trim)
        .filter(|line| !line.is_empty() && !line.starts_with('#'))
        .map(|line| {
            let (name, _) = line
                .split_once("==")
                .with_context(|| format!("`{line}` has no version: pin it"))?;
            Ok(name.to_owned())
        })
        .collect()
}

/// The names in the first cells of the tables of the section "Dependencies".
fn named(readme: &str) -> Result<BTreeSet<String>> {
    let (_, rest) = readme
        .split_once("\n## Dependencies\n")
        .context("no section \"Dependencies\"")?;
    let section = rest.split("\n## ").next().unwrap_or_default();
    Ok(section
        .lines()
        .filter_map(|line| line.strip_prefix("| `")?.split_once('|'))
        .flat_map(|(cell, _)| cell.split('`').step_by(2))
        .map(str::to_owned)
        .collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_read() {
        let set = |names: &[&str]| names.iter().map(|n| n.to_string()).collect::<BTreeSet<_>>();
        let readme = "# a\n\n## Dependencies\n\n| crate | for |\n| --- | --- |\n| `one`, `two` | `three` |\n\n\
                      `four`\n\n| package | for |\n| `five` | it |\n\n## b\n| `six` | it |\n";
        assert_eq!(named(readme).unwrap(), set(&["one", "two", "five"]));
        assert_eq!(
            packages("# why\nNumPy==2.4.6\n\n").unwrap(),
            set(&["NumPy"])
        );
        assert!(packages("numpy>=2").is_err());
        let metadata = serde_json::json!({"packages": [
            {"dependencies": [{"name": "one"}, {"name": "ours", "path": "/here"}]},
            {"dependencies": [{"name": "two"}, {"name": "one"}]},
        ]});
        assert_eq!(crates(&metadata).unwrap(), set(&["one", "two"]));
    }
}
