//! The command line: `urlsph run | check | schema | fmu`.

mod accuracy;
mod check;
mod run;

use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Args, Parser, Subcommand, ValueEnum};
use urlsph::fmu::{self, FmiVersion};
use urlsph::{Code, Error, Result, Scene, Simulation};

/// Large-strain solid dynamics by Updated Reference Lagrangian SPH.
///
/// Exit status: 0 success, 1 error, 2 wrong usage, 130 interrupted.
#[derive(Parser)]
#[command(version, max_term_width = 100)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Runs a scene and writes its history, fields and resolved scene into a folder.
    Run(run::Run),
    /// Validates a scene and prints what running it would take.
    Check {
        #[command(flatten)]
        scene: SceneArguments,
        /// Threads of the set-up; as many as the machine has cores unless given.
        #[arg(long, value_name = "N", default_value_t = 0, hide_default_value = true)]
        threads: usize,
    },
    /// Prints the JSON Schema of a scene.
    Schema,
    /// Packages a scene with the library as a co-simulation FMU.
    Fmu {
        #[command(flatten)]
        scene: SceneArguments,
        /// The FMU to write; an older one is replaced.
        #[arg(short, long, value_name = "FILE.fmu")]
        output: PathBuf,
        /// Version of FMI.
        #[arg(long, value_enum, default_value = "3")]
        fmi: Fmi,
        /// The shared library that goes into the FMU; searched for beside this program unless given.
        #[arg(long, value_name = "PATH")]
        library: Option<PathBuf>,
    },
}

/// The scene that a command works on.
#[derive(Args)]
struct SceneArguments {
    /// The scene, a JSON file (see `urlsph schema`).
    #[arg(value_name = "SCENE.json")]
    file: PathBuf,
    /// Replaces a value of the scene, such as `geometry.box.spacing=0.125`; may be given several times.
    #[arg(long = "set", value_name = "PATH=VALUE")]
    overrides: Vec<String>,
    /// Cells beside the scene's: fast, balanced or accurate. The same as `--set preset=NAME`.
    #[arg(long, value_name = "NAME")]
    preset: Option<String>,
}

impl SceneArguments {
    fn load(&self) -> Result<Scene> {
        Scene::from_file(&self.file, &self.overrides())
    }

    /// All that the command line sets.
    fn overrides(&self) -> Vec<String> {
        let preset = self.preset.iter().map(|name| format!("preset={name}"));
        self.overrides.iter().cloned().chain(preset).collect()
    }
}

#[derive(Clone, Copy, ValueEnum)]
enum Fmi {
    #[value(name = "2")]
    Two,
    #[value(name = "3")]
    Three,
}

fn main() -> ExitCode {
    // Wrong usage ends here, with exit status 2.
    let cli = Cli::parse();
    let outcome = match cli.command {
        Command::Run(run) => run.execute(),
        Command::Check { scene, threads } => scene
            .load()
            .and_then(|scene| Simulation::with_threads(scene, threads))
            .and_then(|simulation| print(&check::report(&simulation))),
        Command::Schema => print(&format!("{:#}\n", urlsph::scene::json_schema())),
        Command::Fmu {
            scene,
            output,
            fmi,
            library,
        } => package(&scene, &output, fmi, library),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(if error.code() == Code::Cancelled {
                130
            } else {
                1
            })
        }
    }
}

/// Prints a result. A reader that has seen enough (`urlsph schema | head`) is no error.
fn print(text: &str) -> Result<()> {
    let mut out = io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(cause) if cause.kind() != io::ErrorKind::BrokenPipe => Err(Error::new(
            Code::Io,
            format!("cannot write to standard output: {cause}"),
        )),
        _ => Ok(()),
    }
}

/// `urlsph fmu`.
fn package(
    scene: &SceneArguments,
    output: &Path,
    version: Fmi,
    library: Option<PathBuf>,
) -> Result<()> {
    let scene = scene.load()?;
    let library = match library {
        Some(path) => path,
        None => fmu::find_library()?,
    };
    let version = match version {
        Fmi::Two => FmiVersion::V2,
        Fmi::Three => FmiVersion::V3,
    };
    fmu::package(&scene, version, &library, output)
}
