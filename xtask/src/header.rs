//! `cargo xtask header [--check]`: include/urlsph.h from src/ffi, and the version of the Python
//! package from the workspace.

use anyhow::{Context, Result, bail};
use xshell::Shell;

use crate::project;

/// Sources of the header, in the order in which their items appear in it.
const SOURCES: [&str; 5] = ["types", "create", "query", "drive", "state"];

const HEADER: &str = "include/urlsph.h";
const PYPROJECT: &str = "include/python/pyproject.toml";

/// Writes the generated files, or with `check` fails if one is not what would be written.
pub fn header(sh: &Shell, check: bool) -> Result<()> {
    let files = [
        (HEADER, generate()?),
        (PYPROJECT, pyproject(&sh.read_file(PYPROJECT)?)?),
    ];
    for (path, wanted) in files {
        if sh.read_file(path).is_ok_and(|present| present == wanted) {
            println!("{path} is up to date");
        } else if check {
            bail!("{path} is out of date: run `cargo xtask header`");
        } else {
            sh.write_file(path, wanted)?;
            println!("{path} written");
        }
    }
    Ok(())
}

fn generate() -> Result<String> {
    let root = project::root();
    let mut config = cbindgen::Config::from_file(root.join("cbindgen.toml"))
        .map_err(anyhow::Error::msg)
        .context("cbindgen.toml")?;
    config.after_includes = Some(version_macros());
    let mut builder = cbindgen::Builder::new().with_config(config);
    for source in SOURCES {
        builder = builder.with_src(root.join(format!("src/ffi/{source}.rs")));
    }
    let mut bytes = Vec::new();
    builder.generate()?.write(&mut bytes);
    Ok(String::from_utf8(bytes)?)
}

fn version_macros() -> String {
    // The workspace has one version: this package's is the library's.
    format!(
        "\n// Version of this header; `urlsph_version` tells the library's.\n\
         #define URLSPH_VERSION \"{}\"\n\
         #define URLSPH_VERSION_MAJOR {}\n\
         #define URLSPH_VERSION_MINOR {}\n\
         #define URLSPH_VERSION_PATCH {}\n",
        env!("CARGO_PKG_VERSION"),
        env!("CARGO_PKG_VERSION_MAJOR"),
        env!("CARGO_PKG_VERSION_MINOR"),
        env!("CARGO_PKG_VERSION_PATCH"),
    )
}

/// The same text with the workspace's version in its `version = "..."` line.
fn pyproject(text: &str) -> Result<String> {
    let line = text
        .lines()
        .find(|l| l.starts_with("version = "))
        .with_context(|| format!("{PYPROJECT} has no line `version = ...`"))?;
    Ok(text.replacen(
        line,
        &format!("version = \"{}\"", env!("CARGO_PKG_VERSION")),
        1,
    ))
}
