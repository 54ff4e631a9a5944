//! What programs meet: the C ABI, FMUs, the packager, the command line, and the notes that errors carry.

use std::fs;
use std::process::Command;

use urlsph::Code::{Internal, InvalidArgument as A, Io as I, OutOfMemory as M, Snapshot as N};
use urlsph::Scene;
use urlsph::fmu::{self, FmiVersion};

use crate::catalogue::{Entry, entry};
use crate::common::BLOCK;

const CALLS: &str = "what_is_wrong_with_a_call_is_told_with_the_remedy";

/// An error of the C ABI that its unit test brings about.
fn c(place: &'static str, text: &str, cause: &'static str, remedy: &'static str) -> Entry {
    entry(A, place, text, cause, remedy).unit("src/ffi/tests.rs", CALLS)
}

/// An error of an FMU that its unit test brings about.
fn f(text: &str, cause: &'static str, remedy: &'static str) -> Entry {
    entry(A, "", text, cause, remedy).unit("fmu/tests.rs", CALLS)
}

pub fn entries() -> Vec<Entry> {
    [binary(), instances(), packages(), commands(), notes()]
        .into_iter()
        .flatten()
        .collect()
}

fn binary() -> Vec<Entry> {
    vec![
        c(
            "",
            "`<argument>` is NULL: pass a valid pointer",
            "An argument that must lead to memory is NULL.",
            "Pass the address of a variable of its type.",
        ),
        c(
            "",
            "`<argument>` is not aligned to <count> bytes: pass a pointer to a variable of its type",
            "The pointer was cast from one of another type.",
            "Pass the address of a variable of its type.",
        ),
        c(
            "",
            "`<argument>` is not UTF-8: byte <index> does not fit; convert the text",
            "The text is in another encoding, such as Latin-1.",
            "Convert it to UTF-8.",
        ),
        c(
            "",
            "`<argument>`: <count> elements exceed the address space; check the count",
            "The count is not that of the array.",
            "Pass the number of elements.",
        ),
        c(
            "",
            "`<argument>` has room for <count> elements, but <count> are needed: pass a larger buffer",
            "The buffer is too small.",
            "Ask for the number first, and pass a buffer of that size.",
        ),
        c(
            "",
            "`<argument>_size` is <size>; pass the size of the struct, <size> bytes in this version",
            "The size of a struct is not passed, or is that of something else.",
            "Pass `sizeof` of the struct.",
        ),
        c(
            "",
            "`<argument>` asks for something that library version <version> does not know; update the library",
            "The program was built for a later version and uses what this one does not have.",
            "Update the library, or set what is new to 0.",
        ),
        c(
            "",
            "there is no <thing> <index>: there are <count>, counted from 0",
            "An index of a patch, a field, a probe or a plane is too large.",
            "Ask for the index by name.",
        )
        .variants(&["patch", "field"]),
        c(
            "",
            "there is no <thing> `<name>`; there are: <names>",
            "Nothing has this name.",
            "Use a name of the list.",
        ),
        c(
            "",
            "<number> is not a quantity: give one of urlsph_quantity, such as URLSPH_TRACTION",
            "The number is none of the enumeration.",
            "Use the constants of the header.",
        ),
        c(
            "boundary",
            "no heat flows here: the body has no temperature; add a section `heat` to the scene",
            "The scene has no heat.",
            "Add the section `heat`.",
        ),
        c(
            "field",
            "it is computed on demand and has no memory to look at: copy it with urlsph_read_field",
            "Only positions and velocities lie in memory as such.",
            "Copy the field.",
        ),
        c(
            "",
            "there is nothing to set: give `coefficients`, `ambient_temperatures`, or both",
            "Both arrays of a convection are left out.",
            "Give one of them.",
        ),
        c(
            "time",
            "dt is <time> s; it must be finite and positive",
            "The step is 0, negative, or no number.",
            "Give a positive number of seconds.",
        ),
        c(
            "time",
            "dt is <time> s, too small to change the time in double precision",
            "The step is below the round-off of the time.",
            "Give a larger step.",
        ),
        entry(
            A,
            "",
            "the simulation was destroyed during the call: let its users end first",
            "Another thread destroyed the simulation between the beginning of the call and its turn.",
            "Destroy a simulation when nobody uses it any more.",
        )
        .unit("src/ffi/handle.rs", "a_call_that_comes_too_late_is_told"),
        entry(
            M,
            "",
            "no handle is left; restart the process",
            "As many simulations were created as there are numbers for them, 2^60 on 64 bits.",
            "Restart the process.",
        )
        .untested("So many simulations cannot be created in the lifetime of a machine."),
        entry(
            Internal,
            "",
            "internal error: <report>; the simulation can only be destroyed now; please report this bug",
            "A bug of the library; the report names the place in its source.",
            "Destroy the simulation and report the bug with the scene; other simulations go on.",
        )
        .unit("src/ffi/tests.rs", "a_panic_poisons_its_handle_and_no_other"),
    ]
}

fn instances() -> Vec<Entry> {
    vec![
        f(
            "the token is NULL: pass the one of modelDescription.xml",
            "The importer passes no token at instantiation.",
            "Pass the `guid` (FMI 2.0) or the `instantiationToken` (FMI 3.0).",
        ),
        f(
            "the token is <token>, but this scene with urlsph <version> has <token>: the description, the scene and the \
             library are not of one FMU; export it again",
            "Files of two FMUs were mixed, or a file of the FMU was changed by hand.",
            "Export the FMU again.",
        ),
        f(
            "the start time is <time>: it must be finite",
            "The experiment begins at no time.",
            "Give a finite time.",
        ),
        f(
            "the stop time is <time>: it must be finite and not before the start time <time>",
            "The experiment ends before it begins.",
            "Give a later time, or none.",
        ),
        f(
            "the communication step is <time>: it must be finite and more than 0",
            "The step is 0, negative, or no number.",
            "Give a positive number of seconds.",
        ),
        f(
            "the communication point is <time> s, but the last step ended at <time> s: continue there, or set an earlier \
             FMU state first",
            "The importer goes back, or leaves a gap.",
            "Continue where the last step ended; for a roll-back set the state first.",
        ),
        f(
            "the step ends at <time> s, beyond the stop time <time> s of the experiment: make it shorter, or set a later \
             stop time",
            "The last step is longer than what is left.",
            "Shorten it, or give no stop time.",
        ),
        f(
            "<variable> is set to <value>: <rule>",
            "A value is no number, or not one that such a variable can have.",
            "Give finite numbers, temperatures in kelvin, counts and coefficients from 0.",
        )
        .variants(&[
            "<variable> is set to <value>: values must be finite",
            "<variable> is set to <value>: it must be 0 or more",
        ]),
        f(
            "<variable> is computed and cannot be set: set parameters and inputs only",
            "The variable is an output, or the time.",
            "Set parameters and inputs only.",
        ),
        f(
            "<action> <phase>, which is allowed only <phases>",
            "The call does not belong into this phase of the FMU, such as a parameter that is set while steps are made.",
            "Make the calls in the order of the standard.",
        ),
        f(
            "there is no variable with the value reference <reference>: modelDescription.xml lists them",
            "The reference is of another FMU.",
            "Take references from the description of this FMU.",
        ),
        f(
            "<variable> (value reference <reference>) is of another type: modelDescription.xml tells which",
            "The variable is read or set by the function of another type.",
            "Use the function of its type.",
        ),
        f(
            "<variable> has <count> values, but <count> are given: pass all of them",
            "The array is not of the variable's size.",
            "Pass as many as the variable has.",
        ),
        f(
            "the <count> variables have <count> values together, but <count> are given: pass all of them",
            "The array is not as long as all variables together.",
            "Pass as many as they have together.",
        ),
        f(
            "the FMU state is NULL: get one first",
            "A state is used that was never got, or was freed.",
            "Get a state first.",
        ),
        f(
            "an array is NULL, not aligned, or longer than memory can be: pass one of the given length",
            "A list of references or values is missing, or its length is not that of any array.",
            "Pass arrays of the given length.",
        ),
        f(
            "the buffer has <count> bytes, the state <count>: ask for its size first",
            "The buffer for a serialised state is not of its size.",
            "Ask for the size first.",
        ),
        f(
            "there is no log category <name>: modelDescription.xml lists them",
            "The category is of another FMU.",
            "Use one of the description, or none for all.",
        ),
        f(
            "not supported: <reason>",
            "The FMU does not have this capability, as its description says.",
            "Look at the capabilities in modelDescription.xml.",
        ),
        f(
            "there is no such real status: ask for fmi2LastSuccessfulTime",
            "FMI 2.0 knows this status only.",
            "Ask for that.",
        ),
        f(
            "there is no such boolean status: ask for fmi2Terminated",
            "FMI 2.0 knows this status only.",
            "Ask for that.",
        ),
        f(
            "this FMU is for co-simulation: instantiate it with fmi2CoSimulation",
            "The importer wants model exchange.",
            "Choose co-simulation.",
        ),
        f(
            "this FMU has no intermediate update: require no intermediate variables",
            "The importer wants variables within steps.",
            "Require none.",
        ),
        f(
            "another thread uses this instance: calls on one instance must follow one another",
            "Two threads call one instance at a time, or the logger calls it from within a call.",
            "Let the calls follow one another.",
        ),
        entry(
            Internal,
            "",
            "internal error, please report it with the scene: <report>",
            "A bug of the library; the report names the place in its source.",
            "Free the instance and report the bug with the scene.",
        )
        .unit("fmu/tests.rs", "a_panic_loses_its_instance"),
        entry(
            Internal,
            "",
            "the instance is lost after an internal error: free it",
            "An earlier call met a bug of the library.",
            "Free the instance.",
        )
        .unit("fmu/tests.rs", "a_panic_loses_its_instance"),
        entry(
            N,
            "",
            "the FMU state belongs to another FMU: use one that this FMU has made",
            "The state was got from an FMU of another scene or version.",
            "Use states of this FMU.",
        )
        .unit("fmu/tests.rs", CALLS),
        entry(
            N,
            "",
            "the FMU state has a number that is not finite: use one that this FMU has made",
            "The bytes of the state were made or changed by others.",
            "Use states of this FMU.",
        )
        .unit("fmu/instance.rs", "a_state_with_a_number_that_is_not_finite_is_refused"),
        entry(
            N,
            "",
            "the serialised FMU state is truncated, damaged or of another version of urlsph: serialise it again",
            "The bytes are not whole, or not of this version.",
            "Serialise the state again with this FMU.",
        )
        .unit("fmu/tests.rs", CALLS),
        entry(
            I,
            "",
            "scene.json is not in the FMU's resources; tried <places>: pass the path of the resources folder",
            "The importer passes a wrong path, or has not unpacked the resources.",
            "Unpack the whole FMU and pass the path of its `resources`.",
        )
        .unit("fmu/handle.rs", "a_missing_scene_is_named"),
        f(
            "instantiation failed: <error>",
            "The scene of the FMU could not be set up; the error says why.",
            "Follow the error; its entry is in this catalogue.",
        ),
        entry(
            A,
            "",
            "<variable> would be beyond the <count> values that an FMU can have: name fewer fields in output.fields",
            "An FMU numbers its values with 32 bits.",
            "Name fewer fields, or coarsen the body.",
        )
        .untested("A body with so many values takes more memory than machines have."),
    ]
}

fn scene() -> Scene {
    Scene::from_json(BLOCK, &[]).unwrap()
}

fn packages() -> Vec<Entry> {
    vec![
        entry(
            A,
            "",
            "<file> is not the shared library of urlsph <version> with FMI: build it with `cargo build --release`",
            "The file is another library, or one of another version.",
            "Build the library of this version, or name it.",
        )
        .call("a text", || {
            let folder = tempfile::tempdir().unwrap();
            let library = folder.path().join("wrong.so");
            fs::write(&library, "not a library").unwrap();
            fmu::package(&scene(), FmiVersion::V3, &library, &folder.path().join("a.fmu"))
        }),
        entry(
            I,
            "",
            "URLSPH_LIBRARY is <file>, which is not a file: set it to the shared library",
            "The environment variable names nothing.",
            "Correct it, or unset it: the library is then looked for beside the program.",
        )
        .says("urlsph fmu", || {
            let bench = Bench::new();
            bench.fails(&["fmu", "scene.json", "--output", "a.fmu"], &[("URLSPH_LIBRARY", "nowhere")])
        }),
        entry(
            I,
            "",
            "the shared library <name> was not found; tried <places>: build it with `cargo build --release` or name it in \
             the environment variable URLSPH_LIBRARY",
            "The library does not lie beside the program or in its prefix.",
            "Build it, or name it.",
        )
        .says("a program without its library", || {
            let bench = Bench::new();
            let alone = bench.folder.path().join("urlsph");
            fs::copy(env!("CARGO_BIN_EXE_urlsph"), &alone).unwrap();
            let mut command = Command::new(&alone);
            bench.run(command.args(["fmu", "scene.json", "--output", "a.fmu"]))
        }),
        entry(
            I,
            "",
            "the place of the program is unknown: <reason>; name the library in the environment variable URLSPH_LIBRARY",
            "The system does not tell where the program lies.",
            "Name the library.",
        )
        .untested("Systems tell it; one without /proc would be needed."),
        entry(
            Internal,
            "",
            "<variable> has the unit <unit>, which has no definition; please report this bug",
            "A variable of the library has a unit that descriptions of FMUs do not define.",
            "Report it.",
        )
        .untested("Every FMU that the tests export would show it."),
        entry(
            Internal,
            "",
            "writing XML failed: <reason>; please report this bug",
            "The description could not be written into memory.",
            "Report it.",
        )
        .untested("Writing into memory does not fail."),
    ]
}

/// A folder with a scene, for the command line.
struct Bench {
    folder: tempfile::TempDir,
}

impl Bench {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("scene.json"), BLOCK).unwrap();
        Self { folder }
    }
    /// What a command that fails says.
    fn run(&self, command: &mut Command) -> String {
        let output = command
            .current_dir(self.folder.path())
            .env_remove("URLSPH_LIBRARY")
            .output()
            .unwrap();
        assert_eq!(output.status.code(), Some(1));
        String::from_utf8_lossy(&output.stderr).into_owned()
    }
    fn fails(&self, arguments: &[&str], environment: &[(&str, &str)]) -> String {
        let mut command = Command::new(env!("CARGO_BIN_EXE_urlsph"));
        let output = command
            .args(arguments)
            .current_dir(self.folder.path())
            .envs(environment.iter().copied())
            .output()
            .unwrap();
        assert!(!output.status.success());
        String::from_utf8_lossy(&output.stderr).into_owned()
    }
}

fn commands() -> Vec<Entry> {
    vec![
        entry(
            I,
            "",
            "cannot create `<folder>`: <reason>",
            "The folder of the results cannot be made: a file has its name, or the permission is missing.",
            "Choose another folder.",
        )
        .says("a file in its place", || {
            let accuracy = ["--tolerance=4%", "--of=energy.kinetic", "--out=scene.json/r"];
            Bench::new().fails(&[&["run", "scene.json"], &accuracy[..]].concat(), &[])
        }),
        entry(
            A,
            "",
            "expected an error between 0 and 100 %, such as 2% or 0.02",
            "The tolerance of `urlsph run --tolerance` is none.",
            "Give per cent or a share.",
        )
        .says("--tolerance much", || {
            let accuracy = ["--tolerance=much", "--of=energy.kinetic", "--out=r"];
            Bench::new().fails(&[&["run", "scene.json"], &accuracy[..]].concat(), &[])
        }),
        entry(
            I,
            "",
            "cannot write to standard output: <reason>",
            "The disk behind a redirection is full, or the device is gone.",
            "Free some space, or redirect elsewhere.",
        )
        .says("a full device", || {
            let full = fs::File::options().write(true).open("/dev/full").unwrap();
            let mut command = Command::new(env!("CARGO_BIN_EXE_urlsph"));
            let output = command.arg("schema").stdout(full).output().unwrap();
            String::from_utf8_lossy(&output.stderr).into_owned()
        }),
        entry(
            I,
            "",
            "cannot watch for Ctrl-C: <reason>",
            "The system does not let the program handle the signal.",
            "Report it with the system.",
        )
        .untested("Systems let programs handle it."),
    ]
}

fn notes() -> Vec<Entry> {
    let note = |text: &str, cause, remedy| entry(None, "", text, cause, remedy);
    vec![
        note(
            "in <file>",
            "The error is in this file.",
            "Correct that file.",
        )
        .says("a scene file", || {
            let bench = Bench::new();
            fs::write(bench.folder.path().join("bad.json"), "{").unwrap();
            bench.fails(&["check", "bad.json"], &[])
        }),
        note(
            "see the override `<override>`",
            "The value comes from this override, not from the file.",
            "Correct the override.",
        )
        .says("--set", || {
            Bench::new().fails(&["check", "scene.json", "--set", "time.end=0"], &[])
        }),
        note(
            "the last good state, time <time> s, is in <file>",
            "The run has ended before its time.",
            "Look at the field file: it shows where the trouble began.",
        )
        .says("a run that breaks down", || {
            let broken = ["--set=numerics.time_step=0.02", "--set=initial.velocity=[\"50*(X-0.5)\", \"40*Y\", 0]"];
            Bench::new().fails(&[&["run", "scene.json", "--out=r"], &broken[..]].concat(), &[])
        }),
        note(
            "its last good state is lost, too: <error>",
            "The run has ended before its time, and its last state could not be written.",
            "Free space or get the permission, and run again.",
        )
        .says("a run whose folder is spoilt", || {
            let bench = Bench::new();
            // A folder cannot be replaced by a file.
            fs::create_dir_all(bench.folder.path().join("r/last_good_state.vtu.part")).unwrap();
            let broken = ["--set=numerics.time_step=0.02", "--set=initial.velocity=[\"50*(X-0.5)\", \"40*Y\", 0]"];
            bench.fails(&[&["run", "scene.json", "--out=r"], &broken[..]].concat(), &[])
        }),
        note(
            "that is what a tolerance of <error> takes: ask for less accuracy",
            "The error is about the finer scene that the tolerance needs, mostly its memory.",
            "Ask for less accuracy.",
        )
        .unit("src/accuracy/search.rs", "what_is_beyond_the_memory_says_what_asks_for_it"),
        note(
            "in the run with <cells>",
            "The error is about this run of a search for an accuracy, not about the scene's own cells.",
            "Follow the error; perhaps the scene needs finer cells to begin with.",
        )
        .unit("src/accuracy/search.rs", "what_no_other_run_can_help_ends_the_search"),
    ]
}
