//! Speed against accuracy: `benches/trade` over its settings, and its report.

use anyhow::Result;
use xshell::{Cmd, Shell, cmd};

use crate::tally::Tally;
use crate::venv;

/// The bench with its arguments, in the profile and with the features that the tests are built with.
fn program<'a>(sh: &'a Shell, arguments: &[&str]) -> Cmd<'a> {
    cmd!(
        sh,
        "cargo bench --quiet --profile release --all-features --bench trade -- {arguments...}"
    )
}

pub fn bench(sh: &Shell, arguments: &[&str]) -> Result<()> {
    if arguments.iter().any(|a| ["-h", "--help"].contains(a)) {
        program(sh, arguments).quiet().run()?;
        return Ok(());
    }
    let python = venv::python(sh)?;
    program(sh, arguments)
        .arg("--python")
        .arg(python)
        .quiet()
        .run()?;
    Ok(())
}

/// One small case from the runs to the report, and runs that are given up.
pub fn bench_tests(sh: &Shell) -> Result<Tally> {
    let python = venv::python(sh)?;
    let folder = sh.create_temp_dir()?;
    let [done, lost] = ["done", "lost"].map(|name| folder.path().join(name));
    let case = ["--quick", "--case", "thermo-wave"];
    for (out, more) in [(&done, [].as_slice()), (&lost, ["--limit", "0"].as_slice())] {
        program(sh, &case)
            .args(more)
            .arg("--out")
            .arg(out)
            .arg("--python")
            .arg(&python)
            .quiet()
            .run()?;
    }
    Tally::run(cmd!(
        sh,
        "{python} benches/trade/check_report.py {done} {lost}"
    ))
}
