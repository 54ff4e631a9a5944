//! Coverage-guided fuzzing: `fuzz/README.md`.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use xshell::{Shell, cmd};

use crate::project;
use crate::tally::Tally;

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
    dictionaries(sh)?;
    for target in &options.targets {
        run(sh, &programs, target, options.seconds)?;
        if options.minimise {
            minimise(sh, &programs, target)?;
        }
    }
    Ok(())
}

/// Every target for a few seconds, from the committed inputs: one test each.
pub fn fuzz_tests(sh: &Shell) -> Result<Tally> {
    const SECONDS: u32 = 10;
    let programs = build(sh)?;
    dictionaries(sh)?;
    let mut tally = Tally::default();
    for target in TARGETS {
        tally += Tally::of(run(sh, &programs, target, SECONDS));
    }
    Ok(tally)
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
    // The fuzzer ends without destructors: the folder of the run before is still there.
    let temporary = folder().join("temporary");
    sh.remove_path(&temporary)?;
    sh.create_dir(&temporary)?;
    let dictionary = dictionary(target);
    let words = dictionary
        .exists()
        .then(|| format!("-dict={}", dictionary.display()));
    let program = programs.join(target);
    let seconds = seconds.to_string();
    cmd!(
        sh,
        "{program} -max_total_time={seconds} -timeout=20 -rss_limit_mb=2048 -max_len=8192 -print_final_stats=1
            -verbosity=0 {words...} -artifact_prefix={failed} {found} {committed} {seeds}"
    )
    .env("TMPDIR", &temporary)
    .env("RAYON_NUM_THREADS", "1")
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

/// Where the words of a target are written down for libFuzzer.
fn dictionary(target: &str) -> PathBuf {
    folder().join(target).with_extension("dict")
}

/// Writes down words that mutations alone would hardly make.
fn dictionaries(sh: &Shell) -> Result<()> {
    const EXPRESSIONS: &[&str] = &[
        "X", "Y", "Z", "t", "sin", "cos", "exp", "sqrt", "min", "max", "PI", "1e300", "1e-300",
        "-0.0",
    ];
    const GMSH: &[&str] = &[
        "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n",
        "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n",
        "$MeshFormat\n4.1 1 8\n\u{1}\0\0\0\n$EndMeshFormat\n",
        "$MeshFormat\n2.2 1 8\n\u{1}\0\0\0\n$EndMeshFormat\n",
        "$PhysicalNames\n",
        "$EndPhysicalNames\n",
        "$Entities\n",
        "$EndEntities\n",
        "$PartitionedEntities\n",
        "$Nodes\n",
        "$EndNodes\n",
        "$Elements\n",
        "$EndElements\n",
        "$Periodic\n",
        "$EndPeriodic\n",
        "nan",
        "inf",
        "-1",
        "18446744073709551615",
        "4294967296",
    ];
    let urlsph = project::build(sh)?.join("urlsph");
    let schema = cmd!(sh, "{urlsph} schema").quiet().read()?;
    // Every word of the schema in quotes: keys, and words that stand for something.
    let words: BTreeSet<String> = schema
        .split('"')
        .filter(|word| !word.is_empty())
        .filter(|word| word.bytes().all(|b| b.is_ascii_lowercase() || b == b'_'))
        .map(|word| format!("\"{word}\""))
        .collect();
    let words = words.iter().map(String::as_str);
    let write = |target: &str, words: &mut dyn Iterator<Item = &str>| {
        let line = |word: &str| {
            let bytes = word.bytes().map(|b| format!("\\x{b:02x}"));
            format!("\"{}\"\n", bytes.collect::<String>())
        };
        sh.write_file(dictionary(target), words.map(line).collect::<String>())
    };
    write("scene", &mut words.chain(EXPRESSIONS.iter().copied()))?;
    write("mesh", &mut GMSH.iter().copied())?;
    Ok(())
}

/// Makes the committed inputs the fewest that reach every place that the present ones, and those found, reach.
fn minimise(sh: &Shell, programs: &Path, target: &str) -> Result<()> {
    let (program, found) = (programs.join(target), folder().join("found").join(target));
    let (fewest, seeds) = (folder().join("fewest").join(target), seeds(sh, target)?);
    let committed = Path::new("fuzz/corpus").join(target);
    sh.remove_path(&fewest)?;
    sh.create_dir(&fewest)?;
    // A place counts once, however often it is passed.
    cmd!(
        sh,
        "{program} -set_cover_merge=1 -use_counters=0 -max_len=2048 -timeout=10 {fewest} {committed} {found} {seeds}"
    )
    .env("RAYON_NUM_THREADS", "1")
    .quiet()
    .run()?;
    for input in sh.read_dir(&committed)? {
        sh.remove_path(&input)?;
    }
    for input in sh.read_dir(&fewest)? {
        sh.copy_file(&input, &committed)?;
    }
    Ok(())
}
