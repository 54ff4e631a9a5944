//! `cargo xtask abi`: programs built against an earlier release run with the present library.
//!
//! `ffi-tests/abi/README.md` says what is there for each release, and what to do about a difference.

use std::collections::BTreeSet;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, anyhow, bail, ensure};
use xshell::{Shell, cmd};

use crate::ffi_tests::compiler;
use crate::install::{self, SharedLibrary};
use crate::project;
use crate::tally::Tally;

/// What is frozen of each release, in a folder by its version.
const RELEASES: &str = "ffi-tests/abi";
const INCLUDE: &str = "include";
const HEADER: &str = "include/urlsph.h";
/// Beginnings of the names that the shared library may export.
const PREFIXES: [&str; 3] = ["urlsph_", "fmi2", "fmi3"];

/// `cargo xtask abi`: these tests alone.
pub fn abi(sh: &Shell) -> Result<()> {
    let tally = abi_tests(sh)?;
    println!("{} passed, {} failed", tally.passed, tally.failed);
    ensure!(
        tally.failed == 0,
        "programs built against an earlier release do not run with this library: {RELEASES}/README.md says what to do"
    );
    Ok(())
}

pub fn abi_tests(sh: &Shell) -> Result<Tally> {
    let build = project::target().join("abi");
    let destdir = build.join("destdir");
    sh.remove_path(&destdir)?;
    let root = destdir.to_str().context("the path is not UTF-8")?;
    install::install(sh, &["--prefix", "/", "--destdir", root])?;
    let lib = destdir.join("lib");
    let mut tally = Tally::default();
    for folder in sh.read_dir(RELEASES)?.into_iter().filter(|p| p.is_dir()) {
        let release = Release::read(sh, folder)?;
        println!("-- {}", release.version);
        tally += Tally::of(release.check_declarations(sh, &build));
        tally += Tally::of(release.check_symbols(sh, &lib));
        tally += release
            .run_program(sh, &build, &lib)
            .unwrap_or_else(|error| Tally::of(Err::<(), _>(error)));
    }
    ensure!(tally != Tally::default(), "{RELEASES} has no release");
    Ok(tally)
}

/// `cargo xtask abi --freeze`: keeps header, symbols, variables of FMUs and keys of scenes of the present version.
pub fn freeze(sh: &Shell) -> Result<()> {
    abi(sh)?;
    let folder = Path::new(RELEASES).join(env!("CARGO_PKG_VERSION"));
    let lib = project::target().join("abi").join("destdir").join("lib");
    let plain = lib.join(SharedLibrary::of_this_platform()?.plain);
    let mut symbols = String::new();
    for symbol in exported(sh, &plain)? {
        writeln!(symbols, "{symbol}")?;
    }
    sh.create_dir(&folder)?;
    sh.copy_file(HEADER, folder.join("urlsph.h"))?;
    sh.write_file(folder.join("symbols.txt"), symbols)?;
    if !folder.join("scene.json").exists() {
        bail!(
            "write program.c and scene.json of {} and freeze again",
            folder.display()
        );
    }
    cmd!(sh, "cargo test --quiet --all-features --test frozen")
        .env("URLSPH_FREEZE", "1")
        .run()?;
    println!("{} is frozen", folder.display());
    Ok(())
}

/// A release as it was.
struct Release {
    folder: PathBuf,
    version: String,
    header: Header,
}

impl Release {
    fn read(sh: &Shell, folder: PathBuf) -> Result<Self> {
        let name = folder.file_name().and_then(|n| n.to_str());
        Ok(Self {
            version: name.context("the path is not UTF-8")?.to_owned(),
            header: Header::read(&sh.read_file(folder.join("urlsph.h"))?)?,
            folder,
        })
    }

    /// Everything that the header of the release declares is declared alike today.
    fn check_declarations(&self, sh: &Shell, build: &Path) -> Result<()> {
        let source = build.join(format!("declarations-{}.c", self.version));
        sh.write_file(&source, self.header.as_checks()?)?;
        let (cc, include) = (compiler(), INCLUDE);
        cmd!(sh, "{cc} -std=c11 -fsyntax-only -I {include} {source}")
            .quiet()
            .run()
            .with_context(|| {
                format!(
                    "{HEADER} does not declare what it declared in {}: undo what the compiler names; functions, \
                     values of enums and fields at the end of structs may be added",
                    self.version
                )
            })
    }

    /// Whatever the library of the release exported is exported today, and nothing foreign.
    fn check_symbols(&self, sh: &Shell, lib: &Path) -> Result<()> {
        let frozen = sh.read_file(self.folder.join("symbols.txt"))?;
        let present = exported(sh, &lib.join(SharedLibrary::of_this_platform()?.plain))?;
        let gone: Vec<&str> = frozen.lines().filter(|s| !present.contains(*s)).collect();
        ensure!(
            gone.is_empty(),
            "the library no longer exports {}, as {} did: put them back, deprecated functions too",
            gone.join(", "),
            self.version
        );
        let mine = |symbol: &str| PREFIXES.iter().any(|p| symbol.starts_with(p));
        let foreign: Vec<&str> = present
            .iter()
            .map(String::as_str)
            .filter(|s| !mine(s))
            .collect();
        ensure!(
            foreign.is_empty(),
            "the library exports {}, which may clash with a program's own: names start with {}",
            foreign.join(", "),
            PREFIXES.join(", ")
        );
        Ok(())
    }

    /// Runs the program of the release with the present library, under the name that the release gave it.
    fn run_program(&self, sh: &Shell, build: &Path, lib: &Path) -> Result<Tally> {
        let object = build.join(format!("program-{}.o", self.version));
        let program = object.with_extension("");
        let (cc, folder) = (compiler(), &self.folder);
        let soname = SharedLibrary::soname(&self.header.abi_version()?.to_string());
        let library = lib.join(&soname);
        ensure!(
            library.exists(),
            "programs of {} look for {soname}, which is not installed",
            self.version
        );
        cmd!(
            sh,
            "{cc} -std=c11 -Wall -Wextra -Wpedantic -Werror -I {folder} -c {folder}/program.c -o {object}"
        )
        .quiet()
        .run()?;
        cmd!(sh, "{cc} {object} {library} -lm -o {program}")
            .quiet()
            .run()?;
        let used = cmd!(sh, "nm -u {object}").quiet().read()?;
        let used: BTreeSet<&str> = used.lines().filter_map(symbol_of).collect();
        let functions = self.header.functions.iter().map(|f| f.name.as_str());
        let unused: Vec<&str> = functions.filter(|f| !used.contains(f)).collect();
        let complete = if unused.is_empty() {
            Ok(())
        } else {
            Err(anyhow!(
                "{} does not call {}",
                folder.join("program.c").display(),
                unused.join(", ")
            ))
        };
        let mut command = Command::new(&program);
        command
            .current_dir(project::root())
            .arg(folder.join("scene.json"))
            .arg(build.join("snapshot"))
            .env("LD_LIBRARY_PATH", lib)
            .env("DYLD_LIBRARY_PATH", lib);
        let mut tally = Tally::run(command)?;
        tally += Tally::of(complete);
        Ok(tally)
    }
}

/// The symbols that a shared library exports.
fn exported(sh: &Shell, library: &Path) -> Result<BTreeSet<String>> {
    let options: &[&str] = if cfg!(target_os = "macos") {
        &["-g", "-U"]
    } else {
        &["-D", "--defined-only"]
    };
    let said = cmd!(sh, "nm {options...} {library}").quiet().read()?;
    Ok(said
        .lines()
        .filter_map(symbol_of)
        .map(str::to_owned)
        .collect())
}

/// The name at the end of a line of nm, as C spells it.
fn symbol_of(line: &str) -> Option<&str> {
    let name = line.split_whitespace().last()?;
    Some(if cfg!(target_os = "macos") {
        name.strip_prefix('_').unwrap_or(name)
    } else {
        name
    })
}

/// What a header that cbindgen wrote declares, each declaration without its semicolon.
#[derive(Debug, Default, PartialEq)]
struct Header {
    /// Macros and enumerators with their numbers.
    constants: Vec<(String, u64)>,
    /// Integers that stand for enums, and types of callbacks.
    typedefs: Vec<String>,
    structs: Vec<Struct>,
    functions: Vec<Function>,
}

#[derive(Debug, Default, PartialEq)]
struct Struct {
    name: String,
    fields: Vec<String>,
}

#[derive(Debug, PartialEq)]
struct Function {
    name: String,
    declaration: String,
}

impl Header {
    fn read(text: &str) -> Result<Self> {
        let mut this = Self::default();
        // The preamble is the only comment that is not one of whole lines.
        let (_, text) = text
            .split_once("*/")
            .context("the header has no preamble")?;
        let mut code = String::new();
        for line in text.lines().map(str::trim) {
            if let Some(macro_) = line.strip_prefix("#define ") {
                this.constant(macro_.split_once(' '));
            } else if !line.starts_with("//") && !line.starts_with('#') {
                writeln!(code, "{line}")?;
            }
        }
        let (types, functions) = code
            .split_once("extern \"C\" {")
            .context("the header has no functions")?;
        for declaration in declarations(types) {
            this.type_(&declaration)?;
        }
        let functions = functions.split('}').next().unwrap_or_default();
        for declaration in declarations(functions) {
            // In front of the name there may be a note in brackets, too.
            let name = declaration
                .rsplit_once('(')
                .and_then(|(head, _)| last_name(head));
            let name = name.with_context(|| format!("`{declaration}` is no function"))?;
            this.functions.push(Function {
                name: name.to_owned(),
                declaration,
            });
        }
        Ok(this)
    }

    /// A name with a number; what else there is (texts, versions) is not part of the binary interface.
    fn constant(&mut self, definition: Option<(&str, &str)>) {
        if let Some((name, number)) = definition
            && let Ok(number) = number.trim().parse()
            && !name.starts_with("URLSPH_VERSION")
        {
            self.constants.push((name.trim().to_owned(), number));
        }
    }

    fn type_(&mut self, declaration: &str) -> Result<()> {
        let body = declaration
            .split_once('{')
            .and_then(|(_, rest)| rest.rsplit_once('}'));
        match (body, declaration.split(' ').next()) {
            (Some((values, "")), Some("enum")) => {
                for value in values.split(',') {
                    self.constant(value.split_once('='));
                }
            }
            (Some((fields, name)), Some("typedef")) => self.structs.push(Struct {
                name: name.trim().to_owned(),
                fields: declarations(fields),
            }),
            // Opaque structs, and enums as C23 and C++ see them.
            (None, Some("typedef"))
                if last_name(declaration).is_some_and(|name| {
                    declaration.starts_with(&format!("typedef struct {name}"))
                        || declaration.starts_with(&format!("typedef enum {name}"))
                }) => {}
            (None, Some("typedef")) => self.typedefs.push(declaration.to_owned()),
            _ => bail!("`{declaration}` is neither a struct, an enum nor another type"),
        }
        Ok(())
    }

    fn abi_version(&self) -> Result<u64> {
        self.constants
            .iter()
            .find_map(|(name, number)| (name == "URLSPH_ABI_VERSION").then_some(*number))
            .context("the header has no URLSPH_ABI_VERSION")
    }

    /// A file in C that compiles only if the present header declares all this, too.
    ///
    /// C allows a declaration again as long as it means the same: the compiler compares the types, and names
    /// what differs. Offsets are compared with those in a struct as it was.
    fn as_checks(&self) -> Result<String> {
        let mut c = String::from("#include <urlsph.h>\n");
        for (name, number) in &self.constants {
            writeln!(
                c,
                "_Static_assert({name} == {number}, \"{name} is no longer {number}\");"
            )?;
        }
        for typedef in &self.typedefs {
            writeln!(c, "{typedef};")?;
        }
        for Struct { name, fields } in &self.structs {
            writeln!(c, "struct frozen_{name} {{ {}; }};", fields.join("; "))?;
            writeln!(
                c,
                "_Static_assert(sizeof(struct {name}) >= sizeof(struct frozen_{name}), \"{name} has shrunk\");"
            )?;
            for field in fields {
                let field_name = last_name(field).with_context(|| format!("{name}: `{field}`"))?;
                let variable = format!("{name}_{field_name}");
                let at = field.rfind(field_name).unwrap_or_default();
                writeln!(
                    c,
                    "extern {}{variable}{};\n\
                     extern __typeof__(((struct {name} *)0)->{field_name}) {variable};\n\
                     _Static_assert(offsetof(struct {name}, {field_name}) == \
                     offsetof(struct frozen_{name}, {field_name}), \"{name}.{field_name} has moved\");",
                    &field[..at],
                    &field[at + field_name.len()..],
                )?;
            }
        }
        for Function { name, declaration } in &self.functions {
            // A declaration alone would do without one in the present header.
            writeln!(
                c,
                "_Static_assert(sizeof(&{name}) > 0, \"\");\n{declaration};"
            )?;
        }
        Ok(c)
    }
}

/// The declarations of a piece of C, on one line each.
fn declarations(code: &str) -> Vec<String> {
    let mut depth = 0;
    code.split(|c| {
        match c {
            '{' => depth += 1,
            '}' => depth -= 1,
            _ => {}
        }
        c == ';' && depth == 0
    })
    .map(|declaration| declaration.split_whitespace().collect::<Vec<_>>().join(" "))
    .filter(|declaration| declaration.contains(' '))
    .collect()
}

/// The last name in a declaration, which is what it declares: of `char text[SIZE]` that is `text`.
fn last_name(declaration: &str) -> Option<&str> {
    let declaration = declaration.split('[').next()?.trim_end();
    let start = declaration
        .rfind(|c: char| !c.is_ascii_alphanumeric() && c != '_')
        .map_or(0, |at| at + 1);
    Some(&declaration[start..]).filter(|name| !name.is_empty())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whether a header that was changed serves programs built with the one before.
    fn serves(from: &str, to: &str) -> bool {
        let sh = project::shell().unwrap();
        let header = sh.read_file(HEADER).unwrap();
        assert!(header.contains(from), "{from}");
        let folder = sh.create_temp_dir().unwrap();
        let folder = folder.path();
        sh.write_file(folder.join("urlsph.h"), header.replacen(from, to, 1))
            .unwrap();
        let source = folder.join("checks.c");
        sh.write_file(&source, Header::read(&header).unwrap().as_checks().unwrap())
            .unwrap();
        let cc = compiler();
        cmd!(sh, "{cc} -std=c11 -fsyntax-only -I {folder} {source}")
            .quiet()
            .ignore_stderr()
            .run()
            .is_ok()
    }

    #[test]
    fn additions_are_allowed() {
        assert!(serves("", ""));
        assert!(serves(
            "size_t contacts;\n}",
            "size_t contacts;\nsize_t more;\n}"
        ));
        assert!(serves("URLSPH_OK = 0,", "URLSPH_OK = 0, URLSPH_NEW = 99,"));
        assert!(serves(
            "uint32_t urlsph_abi_version(void);",
            "uint32_t urlsph_abi_version(void);\nvoid urlsph_new(void);"
        ));
        assert!(serves("// Done.", "// Well done."));
    }

    #[test]
    fn changes_are_found() {
        for (from, to) in [
            ("urlsph_status urlsph_step(", "urlsph_status urlsph_stride("),
            ("simulation, double dt);", "simulation, float dt);"),
            ("uint32_t urlsph_abi_version", "int32_t urlsph_abi_version"),
            ("double linear[3];", "double linear[2];"),
            ("double linear[3];", "double straight[3];"),
            ("double linear[3];", "double more; double linear[3];"),
            ("double linear[3];", "int64_t linear[3];"),
            (
                "double linear[3];",
                "double angular[3];\n#define angular linear",
            ),
            ("size_t contacts;\n}", "}"),
            ("URLSPH_BUSY = 9", "URLSPH_BUSY = 19"),
            ("URLSPH_BUSY = 9,", ""),
            (
                "typedef int32_t urlsph_quantity",
                "typedef int64_t urlsph_quantity",
            ),
            (
                "(const struct urlsph_log_record *record,",
                "(const struct urlsph_error *record,",
            ),
            ("URLSPH_ERROR_TEXT_SIZE 2048", "URLSPH_ERROR_TEXT_SIZE 4096"),
            ("URLSPH_ABI_VERSION 0", "URLSPH_ABI_VERSION 1"),
        ] {
            assert!(!serves(from, to), "`{to}` for `{from}` is not found");
        }
    }
}
