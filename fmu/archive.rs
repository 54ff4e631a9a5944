//! The archive: description, shared library, scene, documentation, licences, icon.

use std::io::Write;
use std::path::{Path, PathBuf};

use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipWriter};

use super::table::Table;
use super::{FmiVersion, MODEL_IDENTIFIER, description, documentation};
use crate::error::{Code, Error, Result};
use crate::output::{io_error, replace_file};
use crate::scene::Scene;
use crate::simulation::Simulation;

/// Where the shared library may be given.
const LIBRARY_VARIABLE: &str = "URLSPH_LIBRARY";

/// Stands in the shared library, so that the packager recognises one of its own version.
#[used]
static MARK: &str = concat!("urlsph-fmu-library ", env!("CARGO_PKG_VERSION"), ";");

const LICENCES: [(&str, &str); 3] = [
    (
        "license.txt",
        "urlsph is licensed under the MIT licence or the Apache licence, version 2.0, as you choose:\n\
         see LICENSE-MIT and LICENSE-APACHE in this folder.\n",
    ),
    ("LICENSE-MIT", include_str!("../LICENSE-MIT")),
    ("LICENSE-APACHE", include_str!("../LICENSE-APACHE")),
];

const ICON: &[u8] = include_bytes!("icon.png");

/// NumPy access to arrays, for users of FMPy.
const FMPY_ARRAYS: &str = include_str!("fmpy_arrays.py");

/// Writes a scene as an FMU. `library` is the shared library of this version, such as
/// [`find_library`] finds; `out` appears only when it is complete.
///
/// The same scene, library and version of urlsph give the same bytes.
///
/// # Errors
/// Those of setting up the scene; [`Code::Io`] with the file;
/// [`Code::InvalidArgument`] for a library that is not the one of this version.
pub fn package(scene: &Scene, version: FmiVersion, library: &Path, out: &Path) -> Result<()> {
    let binary = read_library(library)?;
    let simulation = Simulation::new(scene.clone())?;
    let table = Table::new(&simulation, version)?;
    let (packed, resources) = scene.packed()?;
    let scene_text = serde_json::to_string_pretty(&packed).map_err(|e| {
        Error::new(
            Code::Internal,
            format!("the scene cannot be written as JSON: {e}; please report this bug"),
        )
    })?;
    let mut files: Vec<(String, Vec<u8>)> = vec![
        (
            "modelDescription.xml".to_owned(),
            description::describe(&simulation, &table)?.into_bytes(),
        ),
        (binary_path(version), binary),
        (
            "resources/scene.json".to_owned(),
            (scene_text + "\n").into_bytes(),
        ),
        (
            "documentation/index.html".to_owned(),
            documentation::page(&simulation, &table)?.into_bytes(),
        ),
    ];
    for (name, content) in resources {
        files.push((format!("resources/{name}"), content));
    }
    for (name, text) in LICENCES {
        files.push((
            format!("documentation/licenses/{name}"),
            text.as_bytes().to_vec(),
        ));
    }
    match version {
        FmiVersion::V2 => files.push(("model.png".to_owned(), ICON.to_vec())),
        FmiVersion::V3 => {
            files.push((
                "terminalsAndIcons/terminalsAndIcons.xml".to_owned(),
                description::terminals(&simulation, &table)?.into_bytes(),
            ));
            files.push(("terminalsAndIcons/icon.png".to_owned(), ICON.to_vec()));
            files.push((
                "documentation/fmpy_arrays.py".to_owned(),
                FMPY_ARRAYS.as_bytes().to_vec(),
            ));
        }
    }
    replace_file(out, |file| {
        let mut archive = ZipWriter::new(file);
        for (name, content) in &files {
            let executable = name.starts_with("binaries/");
            let options = SimpleFileOptions::default()
                .compression_method(CompressionMethod::Deflated)
                .last_modified_time(DateTime::default())
                .unix_permissions(if executable { 0o755 } else { 0o644 });
            archive
                .start_file(name.as_str(), options)
                .map_err(std::io::Error::from)?;
            archive.write_all(content)?;
        }
        archive.finish().map_err(std::io::Error::from)?;
        Ok(())
    })
}

/// Path of the library in the archive: the platform names differ between the standards.
fn binary_path(version: FmiVersion) -> String {
    use std::env::consts::{ARCH, DLL_SUFFIX, OS};
    let system = if OS == "macos" { "darwin" } else { OS };
    let platform = match (version, ARCH, system) {
        (FmiVersion::V2, "x86_64", "linux") => "linux64".to_owned(),
        (FmiVersion::V2, "x86_64", "darwin") => "darwin64".to_owned(),
        (FmiVersion::V2, "x86_64", "windows") => "win64".to_owned(),
        // FMI 2.0 has no names for other machines; tools use those of FMI 3.0.
        _ => format!("{ARCH}-{system}"),
    };
    format!("binaries/{platform}/{MODEL_IDENTIFIER}{DLL_SUFFIX}")
}

fn library_name() -> String {
    use std::env::consts::{DLL_PREFIX, DLL_SUFFIX};
    format!("{DLL_PREFIX}urlsph{DLL_SUFFIX}")
}

/// Finds the shared library of urlsph: where the environment variable `URLSPH_LIBRARY` says, or
/// near the running program as Cargo and installers put it.
///
/// # Errors
/// [`Code::Io`] with the places that were tried.
pub fn find_library() -> Result<PathBuf> {
    if let Some(given) = std::env::var_os(LIBRARY_VARIABLE) {
        let given = PathBuf::from(given);
        return if given.is_file() {
            Ok(given)
        } else {
            Err(Error::new(
                Code::Io,
                format!(
                    "{LIBRARY_VARIABLE} is {}, which is not a file: set it to the shared library",
                    given.display()
                ),
            ))
        };
    }
    let program = std::env::current_exe().map_err(|e| {
        Error::new(
            Code::Io,
            format!(
                "the place of the program is unknown: {e}; name the library in the environment variable \
                 {LIBRARY_VARIABLE}"
            ),
        )
    })?;
    let folder = program.parent().unwrap_or(Path::new(""));
    let name = library_name();
    // Beside the program, in its prefix, or in Cargo's `deps`, where tests find the library of their
    // build; where there are several, the newest goes with the program.
    let places = [
        folder.join(&name),
        folder.join("../lib").join(&name),
        folder.join("deps").join(&name),
    ];
    let modified = |place: &PathBuf| place.metadata().and_then(|m| m.modified()).ok();
    let found = places.iter().filter(|place| place.is_file());
    found.max_by_key(|place| modified(place)).cloned().ok_or_else(|| {
        let tried: Vec<_> = places.iter().map(|p| p.display().to_string()).collect();
        Error::new(
            Code::Io,
            format!(
                "the shared library {name} was not found; tried {}: build it with `cargo build --release` \
                 or name it in the environment variable {LIBRARY_VARIABLE}",
                tried.join(", ")
            ),
        )
    })
}

/// Reads the library and checks that it is one of ours, of this version.
fn read_library(path: &Path) -> Result<Vec<u8>> {
    let bytes = std::fs::read(path).map_err(|e| io_error("read", path, &e))?;
    let found = bytes
        .windows(MARK.len())
        .any(|window| window == MARK.as_bytes());
    if found {
        Ok(bytes)
    } else {
        Err(Error::argument(format!(
            "{} is not the shared library of urlsph {} with FMI: build it with `cargo build --release`",
            path.display(),
            crate::VERSION
        )))
    }
}
