//! Coverage-guided fuzzing: `fuzz/README.md`.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use xshell::{Shell, cmd};

use crate::project;

const TARGETS: [&str; 5] = ["scene", "mesh", "snapshot", "calls", "fmi"];

/// What cargo-fuzz sets, too, without a sanitizer; these options are stable.
const INSTRUMENTS: &str = "-Cpasses=sancov-module \
    -Cllvm-args=-sanitizer-coverage-level=4 \
    -Cllvm-args=-sanitizer-coverage-inline-8bit-counters \
    -Cllvm-args=-sanitizer-coverage-pc-table \
    -Cllvm-args=-sanitizer-coverage-trace-compares \
    --cfg fuzzing";

struct Options {
    targets: Vec<&'static str>,
    seconds: u32,
    minimise: bool,
}

impl Options {
    fn read(arguments: &[&str]) -> Result<Self> {
        let mut this = Self {
            targets: Vec::new(),
            seconds: 60,
            minimise: false,
        };
        let mut rest = arguments.iter();
        while let Some(argument) = rest.next() {
            match (*argument, TARGETS.iter().find(|t| *t == argument)) {
                (_, Some(target)) => this.targets.push(target),
                ("--seconds", _) => {
                    let seconds = rest.next().context("--seconds needs a number")?;
                    this.seconds = seconds.parse().context("--seconds needs a number")?;
                }
                ("--minimise", _) => this.minimise = true,
                (other, _) => bail!("there is no target {other}: give {}", TARGETS.join(", ")),
            }
        }
        if this.targets.is_empty() {
            this.targets = TARGETS.to_vec();
        }
        Ok(this)
    }
}

pub fn fuzz(sh: &Shell, arguments: &[&str]) -> Result<()> {
    let options = Options::read(arguments)?;
    let programs = build(sh)?;
    for target in &options.targets {
        run(sh, &programs, target, options.seconds)?;
        if options.minimise {
            minimise(sh, &programs, target)?;
        }
    }
    Ok(())
}

/// Where everything of fuzzing is built and found.
fn folder() -> PathBuf {
    project::target().join("fuzz")
}

/// Builds the targets with instruments, beside everything else; the folder of the programs.
fn build(sh: &Shell) -> Result<PathBuf> {
    let verbose = cmd!(sh, "rustc -vV").quiet().read()?;
    let host = verbose.lines().find_map(|line| line.strip_prefix("host: "));
    let host = host.context("rustc does not tell its host")?;
    // With a target of its own the instruments stay out of build scripts and macros.
    let target = folder();
    cmd!(
        sh,
        "cargo build --manifest-path fuzz/Cargo.toml --release --locked --target {host} --target-dir {target}"
    )
    .env("RUSTFLAGS", INSTRUMENTS)
    .run()?;
    Ok(target.join(host).join("release"))
}

/// Runs a target from the committed inputs and those found before; an input that fails is kept and named.
fn run(sh: &Shell, programs: &Path, target: &str, seconds: u32) -> Result<()> {
    println!("\n-- fuzz {target}, {seconds} s");
    let found = folder().join("found").join(target);
    let failures = folder().join("failed");
    let failed = failures.join(format!("{target}-"));
    let committed = format!("fuzz/corpus/{target}");
    sh.create_dir(&found)?;
    sh.create_dir(&failures)?;
    sh.create_dir(&committed)?;
    let seeds = seeds(sh, target)?;
    let program = programs.join(target);
    let seconds = seconds.to_string();
    cmd!(
        sh,
        "{program} -max_total_time={seconds} -timeout=60 -rss_limit_mb=4096 -max_len=16384 -print_final_stats=1
            -verbosity=0 -artifact_prefix={failed} {found} {committed} {seeds}"
    )
    .run()
    .with_context(|| {
        format!("fuzzing {target} found an input that fails: it is in {}; put it into {committed} \
                 once it is mended", failures.display())
    })
}

/// Inputs that the repository has anyway.
fn seeds(sh: &Shell, target: &str) -> Result<PathBuf> {
    let folder = folder().join("seeds").join(target);
    sh.remove_path(&folder)?;
    sh.create_dir(&folder)?;
    match target {
        "scene" => {
            for example in sh.read_dir("examples")? {
                let scene = example.join("scene.json");
                if let (true, Some(name)) = (scene.exists(), example.file_name()) {
                    sh.copy_file(&scene, folder.join(name))?;
                }
            }
        }
        "mesh" => {
            for mesh in sh.read_dir("examples/meshes")? {
                if mesh.extension().is_some_and(|e| e == "msh") {
                    sh.copy_file(&mesh, &folder)?;
                }
            }
        }
        _ => {}
    }
    Ok(folder)
}

/// Adds to the committed inputs what was found and reaches more.
fn minimise(sh: &Shell, programs: &Path, target: &str) -> Result<()> {
    let (program, found) = (programs.join(target), folder().join("found").join(target));
    cmd!(
        sh,
        "{program} -merge=1 -max_len=2048 -timeout=10 fuzz/corpus/{target} {found}"
    )
    .run()?;
    Ok(())
}
