//! `cargo xtask install --prefix DIR [--destdir DIR]`: the command line, and the library as C and C++
//! projects expect it, with pkg-config and CMake files that may be moved together with the prefix.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use xshell::{Shell, cmd};

use crate::project;

const VERSION: &str = env!("CARGO_PKG_VERSION");
const MAJOR: &str = env!("CARGO_PKG_VERSION_MAJOR");
const MINOR: &str = env!("CARGO_PKG_VERSION_MINOR");

const PKG_CONFIG: &str = include_str!("../templates/urlsph.pc.in");
const CMAKE: &str = include_str!("../templates/urlsphConfig.cmake.in");
const CMAKE_VERSION: &str = include_str!("../templates/urlsphConfigVersion.cmake.in");

/// Names of the shared library on this platform.
pub struct SharedLibrary {
    /// As Cargo builds it, and as the linker looks for it.
    pub plain: String,
    /// As programs look for it at run time.
    pub soname: String,
    /// As it is stored.
    full: String,
}

impl SharedLibrary {
    /// Their names here.
    pub fn of_this_platform() -> Result<Self> {
        Ok(if cfg!(target_os = "macos") {
            Self {
                plain: "liburlsph.dylib".into(),
                soname: Self::soname(MAJOR),
                full: format!("liburlsph.{VERSION}.dylib"),
            }
        } else if cfg!(unix) {
            Self {
                plain: "liburlsph.so".into(),
                soname: Self::soname(MAJOR),
                full: format!("liburlsph.so.{VERSION}"),
            }
        } else {
            bail!(
                "only Unix systems have a prefix to install to: link target/release/urlsph.dll.lib and include include/urlsph.h"
            )
        })
    }

    /// As programs built against this version of the binary interface look for it at run time.
    pub fn soname(abi_version: &str) -> String {
        if cfg!(target_os = "macos") {
            format!("liburlsph.{abi_version}.dylib")
        } else {
            format!("liburlsph.so.{abi_version}")
        }
    }
}

/// Reads the arguments, builds, and installs.
pub fn install(sh: &Shell, arguments: &[&str]) -> Result<()> {
    const USAGE: &str = "usage: cargo xtask install --prefix DIR [--destdir DIR]";
    let mut prefix = None;
    let mut destdir = None;
    let mut rest = arguments.iter();
    while let Some(&option) = rest.next() {
        let value = rest.next().context(USAGE)?;
        match option {
            "--prefix" => prefix = Some(PathBuf::from(value)),
            "--destdir" => destdir = Some(PathBuf::from(value)),
            _ => bail!("{USAGE}"),
        }
    }
    let prefix = std::path::absolute(prefix.context(USAGE)?)?;
    let target = match destdir {
        // Packagers install below a folder of theirs, as if it were the root.
        Some(d) => std::path::absolute(d)?.join(prefix.strip_prefix("/").unwrap_or(&prefix)),
        None => prefix,
    };
    install_to(sh, &target)?;
    println!("urlsph {VERSION} is installed under {}", target.display());
    Ok(())
}

/// Builds the library in release and installs it under `prefix`.
fn install_to(sh: &Shell, prefix: &Path) -> Result<()> {
    let shared = SharedLibrary::of_this_platform()?;
    let built = project::build(sh)?;

    let bin = prefix.join("bin");
    let include = prefix.join("include");
    let lib = prefix.join("lib");
    let pkgconfig = lib.join("pkgconfig");
    let cmake = lib.join("cmake").join("urlsph");
    let licences = prefix.join("share").join("licenses").join("urlsph");
    for folder in [&bin, &include, &lib, &pkgconfig, &cmake, &licences] {
        sh.create_dir(folder)?;
    }

    for header in ["urlsph.h", "urlsph.hpp"] {
        sh.copy_file(format!("include/{header}"), &include)?;
    }
    for licence in ["LICENSE-APACHE", "LICENSE-MIT"] {
        sh.copy_file(licence, &licences)?;
    }
    sh.copy_file(built.join("liburlsph.a"), &lib)?;
    // A running program may have the old file mapped: replace it instead of writing into it.
    sh.remove_path(bin.join("urlsph"))?;
    sh.copy_file(built.join("urlsph"), &bin)?;
    sh.remove_path(lib.join(&shared.full))?;
    sh.copy_file(built.join(&shared.plain), lib.join(&shared.full))?;
    link(sh, &shared.full, &lib.join(&shared.soname))?;
    link(sh, &shared.soname, &lib.join(&shared.plain))?;

    let native = native_libraries(sh)?;
    let fill = |template: &str| {
        template
            .replace("@VERSION@", VERSION)
            .replace("@OLDEST_COMPATIBLE@", &oldest_compatible())
            .replace("@POINTER_BYTES@", &size_of::<usize>().to_string())
            .replace("@SHARED@", &shared.full)
            .replace("@SONAME@", &soname_in_cmake(&shared.soname))
            .replace("@NATIVE_LIBS@", &native.join(" "))
            .replace("@NATIVE_LIBS_CMAKE@", &native.join(";"))
    };
    sh.write_file(pkgconfig.join("urlsph.pc"), fill(PKG_CONFIG))?;
    sh.write_file(cmake.join("urlsphConfig.cmake"), fill(CMAKE))?;
    sh.write_file(cmake.join("urlsphConfigVersion.cmake"), fill(CMAKE_VERSION))?;
    Ok(())
}

/// The oldest version whose programs compile against this one.
fn oldest_compatible() -> String {
    if MAJOR == "0" {
        format!("0.{MINOR}")
    } else {
        MAJOR.to_owned()
    }
}

/// The soname as CMake wants it: on macOS with the search path that the library carries.
fn soname_in_cmake(soname: &str) -> String {
    if cfg!(target_os = "macos") {
        format!("@rpath/{soname}")
    } else {
        soname.to_owned()
    }
}

#[cfg(unix)]
fn link(sh: &Shell, to: &str, at: &Path) -> Result<()> {
    sh.remove_path(at)?;
    std::os::unix::fs::symlink(to, at).with_context(|| at.display().to_string())
}

#[cfg(not(unix))]
fn link(_: &Shell, _: &str, _: &Path) -> Result<()> {
    bail!("no symbolic links on this platform")
}

/// The system libraries that a program needs beside the static library: those of Rust's standard
/// library, as the compiler names them. None of our dependencies links a further one.
fn native_libraries(sh: &Shell) -> Result<Vec<String>> {
    const MARK: &str = "native-static-libs:";
    let folder = sh.create_temp_dir()?;
    let source = folder.path().join("nothing.rs");
    sh.write_file(&source, "")?;
    let out = folder.path().join("libnothing.a");
    let said = cmd!(
        sh,
        "rustc --crate-type staticlib --print native-static-libs {source} -o {out}"
    )
    .quiet()
    .ignore_stdout()
    .output()?
    .stderr;
    let said = String::from_utf8_lossy(&said);
    let line = said
        .lines()
        .find_map(|l| l.split_once(MARK))
        .with_context(|| format!("rustc names no native libraries: {said}"))?
        .1;
    let mut libraries: Vec<String> = line.split_whitespace().map(str::to_owned).collect();
    libraries.dedup();
    Ok(libraries)
}
