//! Simulations: advancing, inputs, fields, snapshots, files, accuracy.

use std::fs;
use std::path::Path;

use urlsph::Code::{
    Cancelled, Diverged, Internal, InvalidArgument as A, InvalidScene as S, Io as I,
    OutOfMemory as M, Snapshot as N,
};
use urlsph::accuracy::{self, Ask, Ladder, Search, Series};
use urlsph::output::{Collection, History, Recorder, variables};
use urlsph::{Control, Field, Quantity, Scene, Simulation, Snapshot};

use crate::catalogue::{Entry, entry};
use crate::common::{BLOCK, block};

const PRESSED: &str = r#"boundary.y_max.pressure={"external": 0}"#;

pub fn entries() -> Vec<Entry> {
    [
        steps(),
        inputs(),
        fields(),
        snapshots(),
        files(),
        accuracies(),
    ]
    .into_iter()
    .flatten()
    .collect()
}

fn steps() -> Vec<Entry> {
    vec![
        entry(
            A,
            "time",
            "cannot advance to <time> s: give a finite time later than now, <time> s",
            "The time to advance to is not after the present one.",
            "Give a later time; to go back, restore a snapshot.",
        )
        .call("into the past", || block(&[]).advance(-1.0)),
        entry(
            Cancelled,
            "time",
            "cancelled by the caller: the last whole step is kept, and the run can go on from it",
            "The observer or the cancel callback asked for the end.",
            "Nothing is lost: advance again, or stop.",
        )
        .call("an observer that says so", || {
            block(&[]).advance_with(0.1, &mut |_| Control::Cancel)
        }),
        entry(
            Diverged,
            "field particle position time",
            "the solution broke down: <what>. The state before this step is kept. Try a smaller time step \
             (numerics.cfl), a finer spacing, more neighbours, or a smaller load",
            "At the particle, the place and the time that are named the body is inverted, or its motion or its \
             temperature is no number any more: the step is too large, or the load is more than these particles resolve.",
            "In this order: leave `time_step` out or lower `cfl`; refine the spacing; take more neighbours; ramp the load \
             up or reduce it. The last good state can be read and, on the command line, lies in last_good_state.vtu.",
        )
        .variants(&[
            "a velocity is not finite",
            "the temperature of a particle is <temperature> K",
            "the volume ratio of a particle is <ratio>",
        ])
        .call("steps that are far too large", || {
            block(&["numerics.time_step=0.02", r#"initial.velocity=["50*(X-0.5)", "40*Y", 0]"#]).advance(1.0)
        })
        .call("a force beyond all numbers", || {
            block(&[r#"body_force=["1e308*heaviside(t-1e-9)", 0, 0]"#, "numerics.time_step=1"]).advance(10.0)
        })
        .call("heat drawn until nothing is left", || {
            block(&[
                r#"heat={"specific_heat": 1, "reference_temperature": 300}"#,
                "boundary.y_max.heat_flux=-1e9",
            ])
            .advance(1.0)
        }),
        entry(
            Diverged,
            "particle position time",
            "the stable step fell to <step> s, <share> of the first one, and numerics.smallest_step is <share>: <reason>",
            "At the particle, the place and the time that are named the body is pressed together so far, or flows so \
             fast, that no step of reasonable size is stable.",
            "Refine the spacing or reduce the load; the message names more. `numerics.smallest_step` set to 0 lifts the limit.",
        )
        .variants(&[
            "the body is compressed beyond what its particles resolve, here to <stretch> of its first thickness: refine \
             the spacing or reduce the load",
            "particles <particle> and <particle> have come together to <share> of their first distance while the \
             deformation around them gives <share>, so that they are on the way past each other: raise \
             numerics.dissipation_coefficient if it is below 1, refine the spacing, leave out numerics.volume_dissipation, \
             try numerics.operators \"repaired\" or 6 neighbours under high pressure, or reduce the load",
            "the velocity gradient has grown to <rate> 1/s, and a step strains no particle by more than \
             numerics.strain_increment, <share>: refine the spacing or reduce the load",
        ])
        .call("an explosion", || {
            block(&["numerics.smallest_step=0.5", r#"body_force=["1e7*X", 0, 0]"#]).advance(1.0)
        })
        .call("a piston", || {
            block(&[
                "numerics.smallest_step=0.5",
                "boundary.x_min.support=roller",
                "boundary.x_max.support=roller",
                "boundary.z_min.support=roller",
                "boundary.z_max.support=roller",
                "boundary.y_min.support=roller",
                "boundary.y_max.velocity=[null, -1, null]",
            ])
            .advance(1.9)
        })
        .unit("tests/acceptance/metals.rs", "extremes_run_or_say_why_not"),
        entry(
            A,
            "",
            "<count> threads asked for, at most <count> are possible: give 0 for one per core",
            "The number of threads is absurd.",
            "Give 0, or at most as many as there are cores.",
        )
        .call("a million threads", || {
            Simulation::with_threads(Scene::from_json(BLOCK, &[])?, 1_000_000)
        }),
        entry(
            M,
            "",
            "the thread pool did not start: <reason>; ask for fewer threads",
            "The system grants no more threads or no memory for their stacks.",
            "Ask for fewer threads, or raise the limits (`ulimit -u`, `ulimit -v`).",
        )
        .says("more stacks than the address space has room for", || {
            let folder = tempfile::tempdir().unwrap();
            fs::write(folder.path().join("scene.json"), BLOCK).unwrap();
            let command = format!(
                "ulimit -v 500000; exec {} check scene.json --threads 1000",
                env!("CARGO_BIN_EXE_urlsph")
            );
            let mut shell = std::process::Command::new("sh");
            let output = shell.args(["-c", &command]).current_dir(folder.path()).output();
            String::from_utf8_lossy(&output.unwrap().stderr).into_owned()
        }),
    ]
}

fn inputs() -> Vec<Entry> {
    vec![
        entry(
            A,
            "boundary",
            "there is no patch `<name>`; there are <names>",
            "The body has no patch of this name.",
            "Use a name of the list.",
        )
        .call("patch_index", || block(&[]).patch_index("lid")),
        entry(
            A,
            "",
            "there is no patch <index>: the body has <count> patches",
            "The index of a patch is too large; indices count from 0.",
            "Ask for the index by the patch's name.",
        )
        .call("set_input", || block(&[]).set_input(99, Quantity::Pressure, &[1.0])),
        entry(
            A,
            "boundary field",
            "the scene does not drive this <quantity> from outside: declare \"boundary\": {\"<name>\": {<declaration>}}",
            "Only what the scene declares as `external` can be set.",
            "Put the declaration into the scene.",
        )
        .call("set_input", || block(&[]).set_input(0, Quantity::Pressure, &[1.0])),
        entry(
            A,
            "boundary field",
            "<count> values given: give <count> for the whole patch or <count> x <count> = <count> for its particles",
            "The number of values is neither that of the patch nor that of its particles.",
            "Give one of the two numbers.",
        )
        .call("set_input", || {
            let mut s = block(&[PRESSED]);
            s.set_input(s.patch_index("y_max")?, Quantity::Pressure, &[1.0; 2])
        }),
        entry(
            A,
            "boundary field",
            "value <index> is <value>: <rule>",
            "A value is no number, or not one that such a quantity can have.",
            "Give finite numbers, temperatures in kelvin, coefficients from 0.",
        )
        .variants(&[
            "value <index> is <value>: only finite values can be applied",
            "an absolute temperature is above 0 K",
            "a heat transfer coefficient is not negative",
        ])
        .call("not a number", || {
            let mut s = block(&[PRESSED]);
            s.set_input(s.patch_index("y_max")?, Quantity::Pressure, &[f64::NAN])
        })
        .call("degrees Celsius", || {
            let mut s = block(&[
                r#"heat={"specific_heat": 1, "reference_temperature": 300}"#,
                r#"boundary.y_max.temperature={"external": 300}"#,
            ]);
            s.set_input(s.patch_index("y_max")?, Quantity::Temperature, &[-10.0])
        })
        .call("a negative coefficient", || {
            let mut s = block(&[
                r#"heat={"specific_heat": 1, "reference_temperature": 300}"#,
                r#"boundary.y_max.convection={"coefficient": {"external": 1}, "ambient_temperature": 300}"#,
            ]);
            s.set_input(s.patch_index("y_max")?, Quantity::ConvectionCoefficient, &[-1.0])
        }),
    ]
}

fn fields() -> Vec<Entry> {
    vec![
        entry(
            A,
            "field",
            "the buffer holds <count> numbers, the field has <count> particles x <count> = <count>",
            "The buffer is not of the field's size.",
            "Give a buffer of that size.",
        )
        .call("read_field", || {
            block(&[]).read_field(Field::Velocity, &mut [0.0])
        }),
        entry(
            A,
            "field",
            "the body has no temperature: add a section `heat` to the scene",
            "The scene has no heat.",
            "Add the section `heat`.",
        )
        .call("has_field", || block(&[]).has_field(Field::Temperature)),
        entry(
            A,
            "field",
            "the material has no plastic strain: choose a material with plasticity",
            "The material does not yield.",
            "Choose `von_mises` or `johnson_cook`.",
        )
        .call("has_field", || {
            block(&[]).has_field(Field::EquivalentPlasticStrain)
        }),
        entry(
            A,
            "",
            "<name> has <count> values, the buffer <count>: give a buffer of that length",
            "The buffer is not of the variable's size.",
            "Give a buffer of that size.",
        )
        .call("read", || {
            let s = block(&[]);
            let variable = &variables::outputs(&s)[0];
            variables::Reader::new().read(&s, variable, &mut [0.0; 99])
        }),
        entry(
            A,
            "",
            "<name> is of another simulation: this body has no temperature",
            "A variable of a simulation with heat is read from one without.",
            "Ask each simulation for its own variables.",
        )
        .call("read", || {
            let warm = block(&[
                r#"heat={"specific_heat": 1, "reference_temperature": 300}"#,
                "probes.p=[0, 0, 0]",
            ]);
            let cold = block(&["probes.p=[0, 0, 0]"]);
            let all = variables::outputs(&warm);
            let variable = all
                .iter()
                .find(|v| v.name == "probe.p.temperature")
                .unwrap();
            variables::Reader::new().read(&cold, variable, &mut [0.0])
        }),
        entry(
            S,
            "path",
            "there is no field <name>; there are <names>",
            "No field has this name; a scene that was read is refused for it before.",
            "Use a name of the list.",
        )
        .call("a scene changed in code", || {
            let mut scene = Scene::from_json(BLOCK, &[])?;
            scene.output.fields = Some(vec!["colour".into()]);
            scene.validate()
        }),
    ]
}

/// The bytes of a snapshot, changed; the checksum is made good if `sealed`.
fn changed(change: fn(&mut Vec<u8>), sealed: bool) -> urlsph::Result<Snapshot> {
    let mut bytes = block(&[]).snapshot().to_bytes();
    bytes.truncate(bytes.len() - 8);
    change(&mut bytes);
    let sum = xxhash_rust::xxh3::xxh3_64(&bytes);
    bytes.extend_from_slice(&if sealed { sum } else { !sum }.to_le_bytes());
    Snapshot::from_bytes(&bytes)
}

fn snapshots() -> Vec<Entry> {
    vec![
        entry(
            N,
            "",
            "the snapshot belongs to another scene: restore it into a simulation of its own scene",
            "Scene and snapshot do not fit: a value of the scene is another one.",
            "Take the scene that the snapshot was made with; only `time` and `output` may differ.",
        )
        .call("restore", || {
            let other = block(&["material.neo_hookean.density=1"]).snapshot();
            block(&[]).restore(&other)
        }),
        entry(
            N,
            "",
            "the snapshot does not have the fields of its scene, it is damaged: take it again from a running simulation",
            "Its parts contradict each other.",
            "Take another snapshot.",
        )
        .unit("src/snapshot.rs", "parts_that_do_not_fit_are_told_with_the_remedy"),
        entry(
            N,
            "particle",
            "the reference configuration of the snapshot is damaged: take it again from a running simulation",
            "Its reference configuration has no gradients at the particle that is named.",
            "Take another snapshot.",
        )
        .unit("src/snapshot.rs", "parts_that_do_not_fit_are_told_with_the_remedy"),
        entry(
            N,
            "",
            "not a usable snapshot, <reason>: take it again from a running simulation",
            "The bytes are cut off, changed, or those of something else.",
            "Take another snapshot; store and copy it as bytes, not as text.",
        )
        .variants(&[
            "it does not start like one",
            "its checksum does not match",
            "it is too short for its particles",
            "it is too long",
            "it ends too early",
            "a length in it is absurd",
            "it has an unknown flag",
        ])
        .call("something else", || Snapshot::from_bytes(b"something else that is long enough"))
        .call("a changed byte", || changed(|_| {}, false))
        .call("a million particles", || {
            changed(|b| b[12..16].copy_from_slice(&1_000_000u32.to_le_bytes()), true)
        })
        .call("more at the end", || changed(|b| b.extend_from_slice(&[0; 8]), true))
        .call("less at the end", || changed(|b| b.truncate(b.len() - 8), true))
        .unit("src/snapshot.rs", "parts_that_do_not_fit_are_told_with_the_remedy"),
        entry(
            N,
            "",
            "the snapshot has format <format>, this library reads format <format>: use the version of the library \
             that wrote it",
            "The format has changed between the two versions.",
            "Use the version that wrote it, or run again.",
        )
        .call("another format", || changed(|b| b[8] = 99, true)),
        entry(
            I,
            "",
            "cannot read `<file>`: it is no file; name the file of a snapshot",
            "The path is that of a folder or a device.",
            "Correct the path.",
        )
        .call("a folder", || Snapshot::read("src")),
        entry(
            M,
            "",
            "the snapshot `<file>` has <count> bytes, more than there is memory for: is it the file that was meant?",
            "The file is larger than what the system can give.",
            "Check the path, or use a machine with more memory.",
        )
        .untested("A test would have to fill a disk with a file that is larger than the memory."),
    ]
}

fn files() -> Vec<Entry> {
    vec![
        entry(
            I,
            "",
            "the scene <file> cannot be read: <reason>",
            "The file is not there, not to be read, or no text.",
            "Correct the path or the permissions; save the text as UTF-8.",
        )
        .variants(&["it is larger than <size> MiB"])
        .call("none", || Scene::from_file("nowhere.json", &[]))
        .call("an endless file", || {
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("long.json");
            fs::File::create(&path).unwrap().set_len((64 << 20) + 1).unwrap();
            Scene::from_file(&path, &[])
        }),
        entry(
            I,
            "",
            "cannot <action> `<file>`: <reason><hint>",
            "The system refuses; the reason is its own.",
            "Make the folder, free space or get the permission, as the message says.",
        )
        .variants(&[
            "; does the folder exist?",
            "; is the folder writable?",
            "; free some space or write fewer fields less often",
        ])
        .call("a folder that is not there", || {
            History::create("no/such/folder/history.csv", ["a"])
        })
        .unit("src/output/mod.rs", "the_hint_follows_the_reason"),
        entry(
            A,
            "",
            "a row of the history `<file>` has <count> values; pass one per column, <count>",
            "A row is not as wide as the header.",
            "Pass one value per column.",
        )
        .call("append", || {
            let folder = tempfile::tempdir().unwrap();
            History::create(folder.path().join("history.csv"), ["a"])?.append(0.0, &[1.0, 2.0])
        }),
        entry(
            A,
            "",
            "the history `<file>` has other columns than this run: its probes or patches were others; start the run afresh",
            "The run to be gone on with had other probes, patches or conditions.",
            "Restore the scene of that run, or start afresh.",
        )
        .call("resume", || {
            let folder = tempfile::tempdir().unwrap();
            let s = block(&[]);
            Recorder::create(folder.path(), &s)?;
            Recorder::resume(folder.path(), &block(&["probes.p=[0, 0, 0]"]))
        }),
        entry(
            A,
            "",
            "the field file `<file>` has <, >, & or \" in its name; choose another",
            "The list of field files is XML, in which these characters have a meaning.",
            "Choose another name.",
        )
        .call("add", || {
            let folder = tempfile::tempdir().unwrap();
            Collection::create(folder.path().join("fields.pvd"))?.add(0.0, "a&b.vtu")
        }),
        entry(
            Internal,
            "",
            "the <what> cannot be written as JSON: <reason>; please report this bug",
            "A value of the library has no form in JSON.",
            "Report it with the scene.",
        )
        .variants(&[
            "the scene cannot be written as JSON: <reason>; please report this bug",
            "the report cannot be written as JSON: <reason>; please report this bug",
        ])
        .untested("Every value that a scene or a report can hold has a form in JSON: nothing is known to cause it."),
    ]
}

fn search(tolerance: f64, budget: f64) -> urlsph::Result<Search> {
    Search::new(&Scene::from_json(BLOCK, &[])?, Ask { tolerance, budget })
}

fn accuracies() -> Vec<Entry> {
    const SEARCH: &str = "src/accuracy/search.rs";
    vec![
        entry(
            A,
            "",
            "the tolerance is a relative error between 0 and 1 (100 %), not <value>",
            "The tolerance is none.",
            "Give a number such as 0.02 (2 %).",
        )
        .call("Search::new", || search(2.0, 1.0)),
        entry(
            A,
            "",
            "the budget is a positive number of CPU seconds, not <value>",
            "The budget is none.",
            "Give seconds of CPU time, of all threads together.",
        )
        .call("Search::new", || search(0.1, 0.0)),
        entry(
            A,
            "",
            "after <count> runs <reason>; choose a quantity that varies more smoothly, such as a displacement instead \
             of a velocity, or a vector instead of one component",
            "The runs do not show how the error falls with the size of the cells.",
            "Choose a smoother quantity, or a looser tolerance.",
        )
        .variants(&["<count> pilots are needed", "the pilots do not converge yet: <reason>"])
        .unit(SEARCH, "pilots_that_do_not_converge_are_refused"),
        entry(
            A,
            "",
            "<reason>; the next pilot, <cells> with about <count> particles, would take about <time> CPU seconds, and as \
             much again if it is good enough and run for its results; <time> of the budget of <time> are left: raise \
             the budget (--budget), or choose a quantity that varies more smoothly, such as a displacement instead \
             of a velocity",
            "The budget ends before the error is known.",
            "Raise the budget, or choose a smoother quantity.",
        )
        .variants(&["the error of the finest pilot is only known to be between <error> and <error>"])
        .unit(SEARCH, "pilots_that_do_not_converge_are_refused"),
        entry(
            A,
            "",
            "<count> runs for a tolerance of <error> have missed it: the error of the last one is between <error> and \
             <error>; ask for <error>",
            "The order of convergence was taken for higher than it is.",
            "Ask for the tolerance that is named.",
        )
        .untested("No quantity is known whose final runs miss again and again; the pilots show it before."),
        entry(
            A,
            "",
            "a tolerance of <error> takes about <count> particles, <count> steps, <time> CPU seconds and <size> GB, and \
             <time> CPU seconds of the budget of <time> are left: ask for <error>, which they reach, or raise the budget \
             (--budget)",
            "The final run would take more than the budget.",
            "Ask for less accuracy, or raise the budget.",
        )
        .unit(SEARCH, "what_is_beyond_the_budget_is_refused_with_what_is_within"),
        entry(
            S,
            "path",
            "with a fixed time step the error of time integration stays when the cells are refined, and cannot be \
             estimated: leave it out, so that steps follow the CFL condition",
            "The scene fixes the step.",
            "Leave `time_step` out.",
        )
        .call("Ladder::new", || {
            Ladder::new(&Scene::from_json(BLOCK, &["numerics.time_step=1e-5".to_owned()])?)
        }),
        entry(
            S,
            "path",
            "a mesh from a file cannot be refined, which presets and estimates of the error need: use a box, boxes, a \
             cylinder or a perforated_box, or run meshes of several sizes and compare them",
            "Only geometries that the library makes itself have other cells.",
            "Use one of those, or compare several meshes.",
        )
        .call("Ladder::new", || {
            let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/meshes/bar_1.msh");
            let mut scene = crate::scene();
            let mut mesh = urlsph::scene::MeshGeometry::new(file.to_string_lossy(), 1.0);
            mesh.load("".as_ref())?;
            scene.geometry = urlsph::scene::Geometry::Mesh(mesh);
            Ladder::new(&scene)
        }),
        entry(
            A,
            "",
            "the accuracy of `<name>` means nothing: it belongs to the resolution and not to the body; choose a motion, a \
             force, a temperature or an energy",
            "A number of steps, say, has no limit when cells are refined.",
            "Choose another quantity.",
        )
        .call("Quantity::find", || accuracy::Quantity::find(&block(&[]), "steps")),
        entry(
            A,
            "",
            "the scene has no variable `<name>`; <remedy> (a point of the body becomes a variable as an entry of `probes`)",
            "No column of the history has this name.",
            "Use a name of the list; a point of the body needs a probe.",
        )
        .variants(&[
            "`<name>` is one number and has no components",
            "the components of `<name>` count from 1 to <count>",
            "there are <names>",
        ])
        .call("energy.kinetic[1]", || accuracy::Quantity::find(&block(&[]), "energy.kinetic[1]"))
        .call("momentum.linear[4]", || accuracy::Quantity::find(&block(&[]), "momentum.linear[4]"))
        .call("colour", || accuracy::Quantity::find(&block(&[]), "colour")),
        entry(
            A,
            "",
            "a series of <count> numbers does not have rows of <count>",
            "The values are not a whole number of rows.",
            "Give whole rows.",
        )
        .call("Series::new", || Series::new(3, vec![1.0; 4], false)),
    ]
}
