//! The tests of the C ABI: C11, C++17 and Python programs against an installed library, shared and
//! static, with sanitizers and under valgrind; the examples in C and C++.

use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Error, Result, anyhow, ensure};
use xshell::{Shell, cmd};

use crate::tally::Tally;
use crate::{header, install, project, venv, wheel};

/// A column, a metal with heat, and a block between planes of contact.
const SCENES: [&str; 3] = [
    "ffi-tests/scene.json",
    "ffi-tests/metal.json",
    "ffi-tests/contact.json",
];

/// Whatever valgrind reports fails the program.
const MEMCHECK: [&str; 7] = [
    "--quiet",
    "--suppressions=ffi-tests/valgrind.supp",
    "--fair-sched=yes",
    "--leak-check=full",
    "--errors-for-leak-kinds=definite,indirect,possible",
    "--error-exitcode=9",
    "--num-callers=30",
];

/// `cargo xtask ffi-tests`: these alone.
pub fn run(sh: &Shell) -> Result<()> {
    let tally = ffi_tests(sh)?;
    println!("{} passed, {} failed", tally.passed, tally.failed);
    ensure!(tally.failed == 0, "the tests of the C ABI failed");
    Ok(())
}

/// Runs all of them, each as far as it gets.
pub fn ffi_tests(sh: &Shell) -> Result<Tally> {
    let setup = Setup::new(sh)?;
    let mut tally = Tally::default();
    for (name, outcome) in [
        ("header", Ok(Tally::of(header::header(sh, true)))),
        ("installation", Ok(Tally::of(setup.check_installation(sh)))),
        ("programs", setup.programs(sh)),
        ("example in C", setup.c_example(sh)),
        ("example in C++", setup.cpp_example(sh)),
        ("structural coupling", setup.structural_coupling(sh)),
        ("python", setup.python(sh)),
    ] {
        let part = outcome.unwrap_or_else(|error| Tally::of(Err::<(), _>(error)));
        println!("-- {name}: {} passed, {} failed", part.passed, part.failed);
        tally += part;
    }
    Ok(tally)
}

/// Tools, and where the library is installed.
struct Setup {
    prefix: PathBuf,
    build: PathBuf,
    python: PathBuf,
    /// Folder of the tools that come with the Python environment: cmake, ninja, pkgconf.
    tools: PathBuf,
}

impl Setup {
    fn new(sh: &Shell) -> Result<Self> {
        let python = venv::python(sh)?;
        let tools = python.parent().context("an interpreter lies in a folder")?;
        let build = project::target().join("ffi-tests");
        let destdir = build.join("destdir");
        let setup = Self {
            prefix: destdir.join("opt").join("urlsph"),
            build,
            tools: tools.to_owned(),
            python,
        };
        // What an older version has left there must not help.
        sh.remove_path(&destdir)?;
        // As packagers do it; that the programs find the library here and not under /opt shows that
        // the installation can be moved.
        let destdir = destdir.to_str().context("the path is not UTF-8")?;
        install::install(sh, &["--prefix", "/opt/urlsph", "--destdir", destdir])?;
        Ok(setup)
    }

    fn tool(&self, name: &str) -> PathBuf {
        self.tools.join(name)
    }

    /// Runs a program against the installed shared library.
    fn run(&self, program: &Path, arguments: &[&str]) -> Result<Tally> {
        let mut command = Command::new(program);
        command
            .current_dir(project::root())
            .args(arguments)
            .env("LD_LIBRARY_PATH", self.prefix.join("lib"))
            .env("DYLD_LIBRARY_PATH", self.prefix.join("lib"))
            .env(
                "TSAN_OPTIONS",
                "suppressions=ffi-tests/thread-sanitizer.supp",
            );
        Tally::run(command)
    }

    /// What is installed, and what pkg-config says about it.
    fn check_installation(&self, sh: &Shell) -> Result<()> {
        for file in [
            "bin/urlsph",
            "include/urlsph.h",
            "include/urlsph.hpp",
            "lib/liburlsph.a",
            "lib/pkgconfig/urlsph.pc",
            "lib/cmake/urlsph/urlsphConfig.cmake",
            "lib/cmake/urlsph/urlsphConfigVersion.cmake",
            "share/licenses/urlsph/LICENSE-MIT",
            "share/licenses/urlsph/LICENSE-APACHE",
        ] {
            ensure!(self.prefix.join(file).is_file(), "{file} is not installed");
        }
        let version = self.pkg_config(sh, &["--modversion"])?;
        ensure!(
            version == [env!("CARGO_PKG_VERSION")],
            "pkg-config gives {version:?}"
        );
        Ok(())
    }

    /// What pkg-config says about the installed library.
    fn pkg_config(&self, sh: &Shell, arguments: &[&str]) -> Result<Vec<String>> {
        let pkgconf = self.tool("pkgconf");
        let said = cmd!(sh, "{pkgconf} {arguments...} urlsph")
            .quiet()
            .env("PKG_CONFIG_PATH", self.prefix.join("lib").join("pkgconfig"))
            .read()?;
        Ok(said.split_whitespace().map(str::to_owned).collect())
    }

    /// Configures and builds a CMake project against the installed library.
    fn cmake(&self, sh: &Shell, source: &str, name: &str, options: &[&str]) -> Result<PathBuf> {
        let build = self.build.join(name);
        let (cmake, ninja, prefix) = (self.tool("cmake"), self.tool("ninja"), &self.prefix);
        // The compilers and the prefix may have changed.
        sh.remove_path(&build)?;
        cmd!(
            sh,
            "{cmake} -S {source} -B {build} -G Ninja -DCMAKE_MAKE_PROGRAM={ninja} -DCMAKE_PREFIX_PATH={prefix} {options...}"
        )
        .quiet()
        .ignore_stdout()
        .run()?;
        cmd!(sh, "{cmake} --build {build}")
            .quiet()
            .ignore_stdout()
            .run()?;
        Ok(build)
    }

    /// The test programs, in every way of linking and checking.
    ///
    /// The library is the released one: of it the sanitizers see what goes through the C library, as memory
    /// that is not freed, and valgrind sees everything.
    fn programs(&self, sh: &Shell) -> Result<Tally> {
        // Of threads that a library without instruments synchronises itself, the sanitizer of threads knows
        // nothing; it can leave a shared library alone, but not a static one.
        const WAYS: [(&str, &str); 5] = [
            ("shared", ""),
            ("static", ""),
            ("shared", "address,undefined"),
            ("static", "address,undefined"),
            ("shared", "thread"),
        ];
        let mut tally = Tally::default();
        for (link, sanitizers) in WAYS {
            if !sanitizers.is_empty() && !self.sanitizers(sh, sanitizers)? {
                println!("the C compiler has no sanitizers {sanitizers}: tests without them");
                continue;
            }
            let name = match sanitizers {
                "" => link.to_owned(),
                _ => format!("{link}-{}", sanitizers.replace(',', "-")),
            };
            println!("-- {name}");
            let options = [
                format!("-DURLSPH_LINK={link}"),
                format!("-DURLSPH_SANITIZE={sanitizers}"),
            ];
            let options = options.each_ref().map(String::as_str);
            let build = self.cmake(sh, "ffi-tests", &name, &options)?;
            for program in ["api", "wrapper"] {
                tally += self.run(&build.join(program), &SCENES)?;
                if (link, sanitizers) == ("shared", "") {
                    tally += self.valgrind(sh, &build.join(program))?;
                }
            }
        }
        Ok(tally)
    }

    /// Runs a program under valgrind: no wrong use of memory in program or library, and none lost.
    fn valgrind(&self, sh: &Shell, program: &Path) -> Result<Tally> {
        if cmd!(sh, "valgrind --version").quiet().read().is_err() {
            println!("valgrind is not installed: tests without it");
            return Ok(Tally::default());
        }
        let mut arguments: Vec<&str> = MEMCHECK.to_vec();
        arguments.push(program.to_str().context("the path is not UTF-8")?);
        arguments.extend(SCENES);
        self.run(Path::new("valgrind"), &arguments)
    }

    /// Whether programs with these sanitizers can be linked and run here.
    fn sanitizers(&self, sh: &Shell, sanitizers: &str) -> Result<bool> {
        let (source, program) = (self.build.join("probe.c"), self.build.join("probe"));
        sh.write_file(&source, "int main(void) { return 0; }\n")?;
        let cc = compiler();
        let built = cmd!(sh, "{cc} -fsanitize={sanitizers} {source} -o {program}")
            .quiet()
            .ignore_stderr()
            .run();
        Ok(built.is_ok() && cmd!(sh, "{program}").quiet().ignore_stderr().run().is_ok())
    }

    /// examples/c by the lines that its head gives: pkg-config, shared and static.
    fn c_example(&self, sh: &Shell) -> Result<Tally> {
        let mut tally = Tally::default();
        let warnings = ["-std=c11", "-Wall", "-Wextra", "-Wpedantic", "-Werror"];
        let cc = compiler();
        let shared = self.build.join("column-shared");
        let flags = self.pkg_config(sh, &["--cflags", "--libs"])?;
        cmd!(
            sh,
            "{cc} {warnings...} examples/c/column.c -o {shared} {flags...}"
        )
        .quiet()
        .run()?;

        let fixed = self.build.join("column-static");
        let include = self.pkg_config(sh, &["--cflags"])?;
        let folder = self.pkg_config(sh, &["--variable=libdir"])?;
        let archive = Path::new(&folder[0]).join("liburlsph.a");
        let system = self.pkg_config(sh, &["--static", "--libs-only-l"])?;
        let system = system.iter().filter(|l| *l != "-lurlsph");
        cmd!(
            sh,
            "{cc} {warnings...} examples/c/column.c -o {fixed} {include...} {archive} {system...}"
        )
        .quiet()
        .run()?;

        for program in [&shared, &fixed] {
            tally += self.example(sh, program, &["examples/c/column.json"], "the same bits");
        }
        // The exit code is the status: this file is no scene, and that one is not there.
        for (scene, status) in [("Cargo.toml", 2), ("examples/c/nowhere.json", 4)] {
            let code = Command::new(&fixed)
                .current_dir(project::root())
                .arg(scene)
                .stderr(std::process::Stdio::null())
                .status()?
                .code();
            tally += Tally::of(if code == Some(status) {
                Ok(())
            } else {
                Err(anyhow!(
                    "column {scene} exits with {code:?} instead of {status}"
                ))
            });
        }
        Ok(tally)
    }

    /// examples/cpp_cmake by find_package, shared and static.
    fn cpp_example(&self, sh: &Shell) -> Result<Tally> {
        let build = self.cmake(sh, "examples/cpp_cmake", "cpp_cmake", &[])?;
        let mut tally = Tally::default();
        for program in ["shaken_column", "shaken_column_static"] {
            tally += self.example(sh, &build.join(program), &[], "time steps");
        }
        Ok(tally)
    }

    /// examples/coupling_structure, shared and static: the program checks what must hold.
    fn structural_coupling(&self, sh: &Shell) -> Result<Tally> {
        let build = self.cmake(
            sh,
            "examples/coupling_structure",
            "coupling_structure",
            &["-DCMAKE_BUILD_TYPE=Release"],
        )?;
        let says = "the structural coupling holds";
        let residuals = build.join("residuals.csv");
        let residuals = residuals.to_str().context("the path is not UTF-8")?;
        let mut tally = self.example(sh, &build.join("coupling_structure"), &[residuals], says);
        let same = build.join("residuals_static.csv");
        let path = same.to_str().context("the path is not UTF-8")?;
        tally += self.example(sh, &build.join("coupling_structure_static"), &[path], says);
        tally += Tally::of(
            sh.read_file(residuals)
                .map_err(Error::from)
                .and_then(|first| {
                    ensure!(
                        first == sh.read_file(&same)?,
                        "the shared and the static library do not give the same iterations"
                    );
                    Ok(())
                }),
        );
        let (python, picture) = (&self.python, build.join("residuals.png"));
        let drawn = cmd!(
            sh,
            "{python} -B examples/coupling_structure/plot.py {residuals} {picture}"
        )
        .quiet()
        .run();
        tally += Tally::of(drawn);
        Ok(tally)
    }

    /// Runs an example, which is one test: it succeeds and says what it should.
    fn example(&self, sh: &Shell, program: &Path, arguments: &[&str], says: &str) -> Tally {
        let lib = self.prefix.join("lib");
        let outcome = cmd!(sh, "{program} {arguments...}")
            .quiet()
            .env("LD_LIBRARY_PATH", &lib)
            .env("DYLD_LIBRARY_PATH", &lib)
            .read()
            .map_err(Error::from)
            .and_then(|said| {
                println!("{said}");
                ensure!(
                    said.contains(says),
                    "{} does not say `{says}`",
                    program.display()
                );
                Ok(())
            });
        Tally::of(outcome)
    }

    /// The Python module: as a wheel in an environment of its own, and by the search for the library.
    fn python(&self, sh: &Shell) -> Result<Tally> {
        let wheel = wheel::wheel(sh)?;
        let site = self.build.join("site");
        let python = &self.python;
        sh.remove_path(&site)?;
        cmd!(
            sh,
            "{python} -m pip install --quiet --disable-pip-version-check --no-deps --target {site} {wheel}"
        )
        .run()?;
        let lib = self.prefix.join("lib");
        let names = install::SharedLibrary::of_this_platform()?;
        let installed = lib.join(&names.plain);
        // Each way must not find the library by another one.
        let tests = |path: &Path, expected: &Path, variables: &[(&str, &Path)]| {
            let mut command = Command::new(python);
            command
                .current_dir(project::root())
                .args(["-B", "-m", "pytest", "-q", "-p", "no:cacheprovider"])
                .arg("ffi-tests/python")
                .env("PYTHONPATH", path)
                .env("EXPECTED_LIBRARY", expected);
            for variable in ["URLSPH_LIBRARY", "LD_LIBRARY_PATH", "DYLD_LIBRARY_PATH"] {
                command.env_remove(variable);
            }
            command.envs(variables.iter().copied());
            Tally::run(command)
        };
        let sources = Path::new("include/python");
        let bundled = site.join("urlsph").join(&names.plain);
        let mut tally = tests(&site, &bundled, &[])?;
        tally += tests(sources, &installed, &[("URLSPH_LIBRARY", &installed)])?;
        tally += tests(
            sources,
            Path::new(&names.soname),
            &[("LD_LIBRARY_PATH", &lib), ("DYLD_LIBRARY_PATH", &lib)],
        )?;
        Ok(tally)
    }
}

/// The C compiler.
pub fn compiler() -> String {
    std::env::var("CC").unwrap_or_else(|_| "cc".to_owned())
}
