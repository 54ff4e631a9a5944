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
    let mut builder = cbindgen::Builder::new().with_config(config()?);
    for source in SOURCES {
        builder = builder.with_src(project::root().join(format!("src/ffi/{source}.rs")));
    }
    let mut bytes = Vec::new();
    builder.generate()?.write(&mut bytes);
    Ok(String::from_utf8(bytes)?)
}

fn config() -> Result<cbindgen::Config> {
    let mut config = cbindgen::Config::from_file(project::root().join("cbindgen.toml"))
        .map_err(anyhow::Error::msg)
        .context("cbindgen.toml")?;
    config.after_includes = Some(macros());
    Ok(config)
}

fn macros() -> String {
    // The workspace has one version: this package's is the library's.
    format!(
        "\n// Version of this header; `urlsph_version` tells the library's.\n\
         #define URLSPH_VERSION \"{}\"\n\
         #define URLSPH_VERSION_MAJOR {}\n\
         #define URLSPH_VERSION_MINOR {}\n\
         #define URLSPH_VERSION_PATCH {}\n\
         \n\
         // Stands before a function that a later version of the binary interface will not have; the note says\n\
         // what to use instead. Define it as nothing to be spared the compiler's warning.\n\
         #ifndef URLSPH_DEPRECATED\n\
         #if defined(__cplusplus) || __STDC_VERSION__ >= 202311L\n\
         #define URLSPH_DEPRECATED(note) [[deprecated(note)]]\n\
         #elif defined(__GNUC__)\n\
         #define URLSPH_DEPRECATED(note) __attribute__((deprecated(note)))\n\
         #else\n\
         #define URLSPH_DEPRECATED(note)\n\
         #endif\n\
         #endif\n",
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

#[cfg(test)]
mod tests {
    use xshell::cmd;

    use super::*;
    use crate::ffi_tests::compiler;

    #[test]
    fn a_compiler_warns_of_what_is_deprecated() {
        let sh = project::shell().unwrap();
        let folder = sh.create_temp_dir().unwrap();
        let folder = folder.path();
        let source = folder.join("old.rs");
        let old = "#[deprecated(note = \"use urlsph_new\")]\n#[unsafe(no_mangle)]\npub extern \"C\" fn urlsph_old() {}\n";
        sh.write_file(&source, old).unwrap();
        cbindgen::Builder::new()
            .with_config(config().unwrap())
            .with_src(&source)
            .generate()
            .unwrap()
            .write_to_file(folder.join("old.h"));
        let program = folder.join("program.c");
        sh.write_file(
            &program,
            "#include \"old.h\"\nint main(void) { urlsph_old(); }\n",
        )
        .unwrap();
        let cc = compiler();
        let said = |options: &[&str]| {
            let command = cmd!(
                sh,
                "{cc} -std=c11 -Werror -fsyntax-only {options...} {program}"
            );
            String::from_utf8(command.quiet().ignore_status().output().unwrap().stderr).unwrap()
        };
        assert!(said(&[]).contains("use urlsph_new"), "{}", said(&[]));
        assert_eq!(said(&["-DURLSPH_DEPRECATED(note)="]), "");
    }
}
