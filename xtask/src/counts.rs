//! Instructions, memory, pair-updates and errors against those expected: `benches/counts`.

use anyhow::Result;
use xshell::{Cmd, Shell, cmd};

use crate::tally::Tally;

/// The program, in the profile and with the features that the tests are built with.
fn program<'a>(sh: &'a Shell, arguments: &[&str]) -> Cmd<'a> {
    cmd!(
        sh,
        "cargo bench --quiet --profile release --all-features --bench counts -- {arguments...}"
    )
}

pub fn counts(sh: &Shell, arguments: &[&str]) -> Result<()> {
    program(sh, arguments).quiet().run()?;
    Ok(())
}

pub fn counts_tests(sh: &Shell) -> Result<Tally> {
    Tally::run(program(sh, &[]))
}
