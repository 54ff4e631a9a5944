//! The command line as a user meets it: files, messages, exit statuses.
#![cfg(feature = "cli")]

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use tempfile::TempDir;
use urlsph::Scene;

/// A small column that swings; coarse, so that a run takes a fraction of a second.
const SCENE: &str = r#"{
  "title": "Small column",
  "geometry": { "box": { "min": [0, 0, 0], "max": [1, 3, 1], "spacing": 0.5 } },
  "material": { "neo_hookean": { "density": 1100, "youngs_modulus": 1.7e7, "poisson_ratio": 0.3 } },
  "patches": { "top": { "faces": ["y_max"] } },
  "boundary": { "y_min": { "support": "clamped" } },
  "initial": { "velocity": ["Y", 0, 0] },
  "probes": { "tip": [0.5, 3, 0.5] },
  "time": { "end": 0.01 },
  "output": { "history_interval": 0.001, "field_interval": 0.003 }
}"#;

struct Bench {
    folder: TempDir,
}

impl Bench {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("scene.json"), SCENE).unwrap();
        Self { folder }
    }
    fn path(&self, name: &str) -> std::path::PathBuf {
        self.folder.path().join(name)
    }
    fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_urlsph"));
        command.args(arguments).current_dir(self.folder.path());
        command
    }
    fn urlsph(&self, arguments: &[&str]) -> Output {
        self.command(arguments).output().unwrap()
    }
    /// Runs a command that must succeed; what it printed.
    fn succeeds(&self, arguments: &[&str]) -> String {
        let output = self.urlsph(arguments);
        assert!(output.status.success(), "{}", stderr(&output));
        String::from_utf8(output.stdout).unwrap()
    }
    /// Runs a command that must fail with a status; the message.
    fn fails(&self, status: i32, arguments: &[&str]) -> String {
        let output = self.urlsph(arguments);
        assert_eq!(output.status.code(), Some(status), "{}", stderr(&output));
        stderr(&output)
    }
}

fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// A history: its header and its rows.
fn history(path: &Path) -> (Vec<String>, Vec<Vec<f64>>) {
    let text = fs::read_to_string(path).unwrap();
    let mut lines = text.lines();
    let header = lines
        .next()
        .unwrap()
        .split(',')
        .map(str::to_owned)
        .collect();
    let rows = lines
        .map(|line| line.split(',').map(|x| x.parse().unwrap()).collect())
        .collect();
    (header, rows)
}

#[test]
fn a_run_writes_its_history_fields_and_scene() {
    let bench = Bench::new();
    let printed = bench.succeeds(&["run", "scene.json", "--out", "results", "--threads", "2"]);
    for word in [
        "simulated",
        "on 2 threads",
        "kinetic energy",
        "closure error",
    ] {
        assert!(printed.contains(word), "{word} in:\n{printed}");
    }

    let (header, rows) = history(&bench.path("results/history.csv"));
    assert_eq!(header[0], "time");
    for name in [
        "probe.tip.displacement[1]",
        "probe.tip.velocity[3]",
        "energy.kinetic",
        "energy.strain",
        "energy.external_work",
        "energy.numerical_dissipation",
        "boundary.y_min.force[1]",
        "boundary.top.force[2]",
    ] {
        assert!(header.iter().any(|column| column == name), "{name}");
    }
    let times: Vec<f64> = rows.iter().map(|row| row[0]).collect();
    let expected: Vec<f64> = (0..=10).map(|k| f64::from(k) * 0.001).collect();
    assert_eq!(times, expected, "rows land exactly on their times");
    assert!(rows.iter().all(|row| row.len() == header.len()));
    assert!(rows.iter().flatten().all(|value| value.is_finite()));

    let collection = fs::read_to_string(bench.path("results/fields.pvd")).unwrap();
    for (k, time) in [0.0, 0.003, 0.006, 3.0 * 0.003, 0.01].iter().enumerate() {
        let entry = format!("timestep=\"{time:?}\" file=\"fields/state_{k:06}.vtu\"");
        assert!(collection.contains(&entry), "{entry} in:\n{collection}");
        let file = fs::read(bench.path(&format!("results/fields/state_{k:06}.vtu"))).unwrap();
        assert!(file.ends_with(b"</VTKFile>\n"));
    }
    assert_eq!(collection.matches("<DataSet ").count(), 5);

    let resolved = fs::read_to_string(bench.path("results/scene.json")).unwrap();
    assert_eq!(
        Scene::from_json(&resolved, &[]).unwrap(),
        Scene::from_json(SCENE, &[]).unwrap()
    );
}

#[test]
fn output_does_not_depend_on_threads_and_an_earlier_run_is_replaced() {
    let bench = Bench::new();
    bench.succeeds(&["run", "scene.json", "--out", "a", "--threads", "1"]);
    bench.succeeds(&[
        "run",
        "scene.json",
        "--out",
        "b",
        "--threads",
        "3",
        "--set",
        "output.field_interval=0.001",
    ]);
    assert!(bench.path("b/fields/state_000010.vtu").exists());
    bench.succeeds(&["run", "scene.json", "--out", "b", "--threads", "3"]);
    assert!(!bench.path("b/fields/state_000010.vtu").exists());
    for file in [
        "history.csv",
        "fields.pvd",
        "fields/state_000004.vtu",
        "scene.json",
    ] {
        assert_eq!(
            fs::read(bench.path("a").join(file)).unwrap(),
            fs::read(bench.path("b").join(file)).unwrap(),
            "{file}"
        );
    }
}

#[test]
fn overrides_and_until_reach_the_scene() {
    let bench = Bench::new();
    let printed = bench.succeeds(&[
        "run",
        "scene.json",
        "--out",
        "r",
        "--until",
        "0.002",
        "--set",
        "geometry.box.spacing=0.25",
    ]);
    assert!(
        printed.contains("simulated              0.002 s"),
        "{printed}"
    );
    assert!(printed.contains("325 particles"), "{printed}");
    let (_, rows) = history(&bench.path("r/history.csv"));
    assert_eq!(rows.last().unwrap()[0], 0.002);
    let resolved = fs::read_to_string(bench.path("r/scene.json")).unwrap();
    assert_eq!(Scene::from_json(&resolved, &[]).unwrap().time.end, 0.002);
}

#[test]
fn quiet_says_nothing() {
    let bench = Bench::new();
    let output = bench.urlsph(&["run", "scene.json", "--out", "r", "--quiet"]);
    assert!(output.status.success());
    assert!(output.stdout.is_empty() && output.stderr.is_empty());
}

#[test]
fn check_prints_the_plan_and_writes_nothing() {
    let bench = Bench::new();
    let printed = bench.succeeds(&["check", "scene.json"]);
    let only = |name: &str| match lines(&printed, name)[..] {
        [text] => text,
        ref found => panic!("{name}: {found:?} in:\n{printed}"),
    };
    assert_eq!(only("scene"), "Small column");
    assert_eq!(only("particles"), "63");
    assert_eq!(
        only("neighbours"),
        "6 to 18, 10.7 on average (676 directed pairs)"
    );
    for (name, start, end) in [
        ("memory", "0.", " kB per particle)"),
        ("stable", "step ", " s at the start"),
        ("steps", "about ", " to the end at 0.01 s"),
    ] {
        let text = only(name);
        let fits = text.starts_with(start) && text.ends_with(end);
        assert!(fits, "{name}: {text}");
    }
    assert_eq!(lines(&printed, "patch").len(), 2, "{printed}");
    assert!(lines(&printed, "on").contains(&"neo-Hookean elasticity"));
    assert!(lines(&printed, "off").contains(&"heat"));
    assert_eq!(fs::read_dir(bench.folder.path()).unwrap().count(), 1);
}

/// A scene on a mesh of `examples/meshes`, beside a copy of the mesh.
fn meshed(mesh: &str, more: &str) -> Bench {
    let bench = Bench::new();
    let meshes = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/meshes");
    fs::create_dir(bench.path("meshes")).unwrap();
    fs::copy(meshes.join(mesh), bench.path("meshes").join(mesh)).unwrap();
    let mut scene: serde_json::Value = serde_json::from_str(SCENE).unwrap();
    scene["geometry"] = serde_json::json!({ "mesh": { "file": format!("meshes/{mesh}") } });
    for part in ["patches", "boundary", "probes"] {
        scene.as_object_mut().unwrap().remove(part);
    }
    let more: serde_json::Value = serde_json::from_str(more).unwrap();
    for (key, value) in more.as_object().unwrap() {
        scene[key] = value.clone();
    }
    fs::write(bench.path("scene.json"), scene.to_string()).unwrap();
    bench
}

/// The lines of a plan that have a name.
fn lines<'a>(plan: &'a str, name: &str) -> Vec<&'a str> {
    let named = plan.lines().filter_map(|l| l.split_once(' '));
    named
        .filter(|(n, _)| *n == name)
        .map(|(_, text)| text.trim())
        .collect()
}

#[test]
fn check_tells_what_is_in_a_mesh() {
    let bar = meshed(
        "bar_2.msh",
        r#"{"geometry": {"mesh": {"file": "meshes/bar_2.msh", "scale": 1e-3}},
            "boundary": {"start": {"support": "roller"}, "end": {"support": "roller"}},
            "contact": {"wall": {"point": [0, 0, 0], "normal": [0, 0, 1]}}}"#,
    );
    let plan = bar.succeeds(&["check", "scene.json"]);
    assert_eq!(lines(&plan, "particles"), ["730"]);
    let cells = lines(&plan, "cells")[0];
    assert!(
        cells.contains(" tetrahedra; volume ") && cells.contains("shortest edge"),
        "{cells}"
    );
    let repair = lines(&plan, "repair")[0];
    assert!(
        repair.contains("pseudo-areas changed by") && repair.contains("iterations"),
        "{repair}"
    );
    let on = lines(&plan, "on");
    assert!(
        on.contains(&"neighbours that share a face of the mesh"),
        "{on:?}"
    );
    assert!(on.contains(&"operators of the kernel, repaired"), "{on:?}");
    assert!(on.contains(&"contact with rigid planes"), "{on:?}");
    assert!(!plan.contains("lattice"), "{plan}");
    let patches = lines(&plan, "patch");
    assert!(
        patches.iter().any(|p| p.starts_with("start: ")),
        "{patches:?}"
    );

    let set = |value: &str| bar.succeeds(&["check", "scene.json", "--set", value]);
    for (value, said) in [
        (
            "numerics.neighbours=6",
            "neighbours that share an edge of the mesh",
        ),
        (
            "numerics.neighbours=26",
            "neighbours that share a cell of the mesh",
        ),
        (
            "numerics.neighbours.radius=1.4",
            "neighbours within 1.4 mean lengths of the edges",
        ),
        ("numerics.operators=mesh", "operators of the mesh"),
    ] {
        let plan = set(value);
        assert!(lines(&plan, "on").contains(&said), "{value}: {plan}");
    }
    let plan = set("numerics.operators=mesh");
    assert!(lines(&plan, "repair").is_empty(), "{plan}");

    let box_ = Bench::new().succeeds(&["check", "scene.json"]);
    assert!(
        lines(&box_, "on").contains(&"18 lattice neighbours"),
        "{box_}"
    );
    assert!(lines(&box_, "cells").is_empty() && lines(&box_, "mesh").is_empty());
}

#[test]
fn check_tells_what_of_a_mesh_is_left_out() {
    let bench = meshed("cube_hexahedra.msh", "{}");
    let path = bench.path("meshes/cube_hexahedra.msh");
    // A node that no cell uses.
    let text = fs::read_to_string(&path).unwrap();
    let text = text
        .replace("$Nodes\n343\n", "$Nodes\n344\n")
        .replace("$EndNodes", "1000 9 9 9\n$EndNodes");
    fs::write(&path, text).unwrap();
    let plan = bench.succeeds(&["check", "scene.json"]);
    assert_eq!(lines(&plan, "particles"), ["343"]);
    assert!(
        lines(&plan, "cells")[0].starts_with("216 hexahedra; "),
        "{plan}"
    );
    let notes = lines(&plan, "mesh");
    assert!(notes.len() == 1 && notes[0].contains("1 node"), "{plan}");

    fs::write(&path, "no mesh").unwrap();
    let message = bench.fails(1, &["check", "scene.json"]);
    for word in ["geometry.mesh.file", "cube_hexahedra.msh", "line 1"] {
        assert!(message.contains(word), "{word} in: {message}");
    }
    fs::remove_file(&path).unwrap();
    let message = bench.fails(1, &["check", "scene.json"]);
    assert!(message.contains("cube_hexahedra.msh"), "{message}");
}

#[test]
fn meshes_run() {
    for mesh in [
        "bar_1.msh",
        "cylinder_1.msh",
        "cube_tetrahedra.msh",
        "cube_hexahedra.msh",
    ] {
        let bench = meshed(
            mesh,
            r#"{"initial": {"velocity": ["Y", 0, 0]}, "time": {"end": 1e-3},
                "output": {"history_interval": 5e-4, "field_interval": 1e-3}}"#,
        );
        bench.succeeds(&["run", "scene.json", "--out", "r", "--threads", "1"]);
        let (header, rows) = history(&bench.path("r/history.csv"));
        let of = |name: &str| header.iter().position(|h| h == name).unwrap();
        let momentum = of("momentum.linear[1]");
        assert_eq!(rows.len(), 3);
        // Nothing pushes the body.
        let (first, last) = (rows[0][momentum], rows[2][momentum]);
        println!(
            "{mesh}: momentum {first:e}, then {:e} of it (tolerance 1e-12)",
            last / first - 1.0
        );
        assert!(
            (last / first - 1.0).abs() < 1e-12,
            "{mesh}: {first} and {last}"
        );
        let bytes = fs::read(bench.path("r/fields/state_000001.vtu")).unwrap();
        assert!(bytes.ends_with(b"</VTKFile>\n"));
        // What was run can be run again from where its scene lies.
        bench.succeeds(&["run", "r/scene.json", "--out", "again", "--threads", "2"]);
        for file in ["history.csv", "fields/state_000001.vtu"] {
            let [first, again] =
                ["r", "again"].map(|r| fs::read(bench.path(r).join(file)).unwrap());
            assert!(first == again, "{mesh}: {file} differs");
        }
    }
}

#[test]
fn schema_is_json_that_names_the_parts_of_a_scene() {
    let schema: serde_json::Value =
        serde_json::from_str(&Bench::new().succeeds(&["schema"])).unwrap();
    for key in [
        "geometry", "material", "boundary", "numerics", "time", "output",
    ] {
        assert!(schema["properties"][key].is_object(), "{key}");
    }
}

#[test]
fn wrong_usage_has_status_2_and_says_how() {
    let bench = Bench::new();
    assert!(
        bench
            .fails(2, &["run", "scene.json"])
            .contains("--out <DIR>")
    );
    assert!(bench.fails(2, &["walk"]).contains("walk"));
    assert!(
        bench
            .fails(2, &["run", "scene.json", "--out", "r", "--threads", "many"])
            .contains("many")
    );
}

#[test]
fn errors_have_status_1_and_name_the_place() {
    let bench = Bench::new();
    let message = bench.fails(1, &["check", "nowhere.json"]);
    assert!(message.contains("nowhere.json"), "{message}");

    let message = bench.fails(
        1,
        &[
            "check",
            "scene.json",
            "--set",
            "material.neo_hookean.density=-1",
        ],
    );
    assert!(
        message.contains("material.neo_hookean.density"),
        "{message}"
    );

    let message = bench.fails(1, &["run", "scene.json", "--out", "r", "--until", "soon"]);
    assert!(
        message.contains("time.end") && message.contains("soon"),
        "{message}"
    );

    let message = bench.fails(1, &["run", "scene.json", "--out", "scene.json/results"]);
    assert!(message.contains("scene.json/results"), "{message}");
}

#[test]
fn a_diverged_run_leaves_its_last_good_state_and_advice() {
    let bench = Bench::new();
    let message = bench.fails(
        1,
        &[
            "run",
            "scene.json",
            "--out",
            "r",
            "--set",
            "numerics.time_step=0.01",
            "--until",
            "1",
            "--set",
            "initial.velocity=[\"200*Y\", 0, 0]",
        ],
    );
    for word in ["particle", "time", "last_good_state.vtu", "numerics.cfl"] {
        assert!(message.contains(word), "{word} in: {message}");
    }
    assert!(bench.path("r/last_good_state.vtu").exists());
    let (header, rows) = history(&bench.path("r/history.csv"));
    assert!(rows.iter().all(|row| row.len() == header.len()));
    assert!(rows.iter().flatten().all(|value| value.is_finite()));
}

/// Ends a run as Ctrl-C does, once it has got going.
fn interrupt(mut child: std::process::Child, going: impl Fn() -> bool) {
    let patience = Instant::now() + Duration::from_secs(60);
    while !going() {
        assert!(Instant::now() < patience, "the run does not get going");
        std::thread::sleep(Duration::from_millis(10));
    }
    let killed = Command::new("kill")
        .args(["-INT", &child.id().to_string()])
        .status()
        .unwrap();
    assert!(killed.success());
    assert_eq!(child.wait().unwrap().code(), Some(130));
}

#[cfg(unix)]
#[test]
fn an_interrupted_run_has_status_130_and_whole_files() {
    let bench = Bench::new();
    let child = bench
        .command(&["run", "scene.json", "--out", "r", "--until", "1000"])
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // The handler is installed before the first row is written.
    let rows = || fs::read_to_string(bench.path("r/history.csv")).map_or(0, |t| t.lines().count());
    interrupt(child, || rows() >= 3);
    let (header, rows) = history(&bench.path("r/history.csv"));
    assert!(rows.iter().all(|row| row.len() == header.len()));
    assert!(bench.path("r/last_good_state.vtu").exists());
    let collection = fs::read_to_string(bench.path("r/fields.pvd")).unwrap();
    assert!(collection.ends_with("</VTKFile>\n"));
}

/// A run of the small column for an accuracy, in `r`.
const FOR_ACCURACY: [&str; 7] = [
    "run",
    "scene.json",
    "--out",
    "r",
    "--threads=1",
    "--of=probe.tip.displacement",
    "--tolerance",
];

/// Everything that a run left in its folder, by name.
fn content(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let files = |folder: &Path| -> Vec<PathBuf> {
        let entries = fs::read_dir(folder).unwrap();
        entries.map(|e| e.unwrap().path()).collect()
    };
    let all = files(folder)
        .into_iter()
        .chain(files(&folder.join("fields")));
    all.filter(|path| path.is_file())
        .map(|path| {
            let name = path.strip_prefix(folder).unwrap();
            (name.to_str().unwrap().to_owned(), fs::read(&path).unwrap())
        })
        .collect()
}

/// Killed at any moment, a run goes on from its last snapshot and leaves what it would have left.
#[cfg(unix)]
#[test]
fn a_killed_run_goes_on_from_its_last_snapshot_and_leaves_the_same_files() {
    let bench = Bench::new();
    let scene = [
        "scene.json",
        "--set=geometry.box.spacing=0.125",
        "--set=output.restart_interval=0.002",
        "--set=numerics.angular_momentum_projection=true",
        "--quiet",
    ];
    let until = |end: &str, folder: &str, more: &[&str]| {
        let (end, folder) = (format!("--until={end}"), format!("--out={folder}"));
        let own = [end.as_str(), folder.as_str()];
        bench.command(&[&["run"], &scene[..], &own, more].concat())
    };
    let run = |folder: &str, more: &[&str]| until("0.099", folder, more);
    assert!(run("whole", &[]).status().unwrap().success());
    let whole = content(&bench.path("whole"));
    let rows = |folder: &str| history(&bench.path(folder).join("history.csv")).1.len();

    let mut kills = 0;
    let mut more: &[&str] = &[];
    loop {
        let mut child = run("killed", more).spawn().unwrap();
        // A little further each time, wherever that is: in a step, or while a file is written.
        kills += 1;
        let patience = Duration::from_millis(40 + 13 * kills);
        let start = Instant::now();
        while start.elapsed() < patience && child.try_wait().unwrap().is_none() {
            std::thread::sleep(Duration::from_millis(1));
        }
        let done = child.try_wait().unwrap();
        child.kill().unwrap();
        child.wait().unwrap();
        if bench.path("killed").join("restart.snapshot").exists() {
            more = &["--restart"];
        }
        if let Some(status) = done {
            assert!(status.success());
            break;
        }
        assert!(kills < 200, "it does not get on: {} rows", rows("killed"));
    }
    println!("{kills} starts");
    let again = content(&bench.path("killed"));
    let names = |all: &BTreeMap<String, Vec<u8>>| all.keys().cloned().collect::<Vec<_>>();
    assert_eq!(names(&again), names(&whole));
    for (name, bytes) in &whole {
        assert!(again[name] == *bytes, "{name} differs");
    }

    // A run that was complete can be made longer, and is then the longer run.
    let longer = |folder: &str, more: &[&str]| {
        assert!(until("0.12", folder, more).status().unwrap().success());
        content(&bench.path(folder))
    };
    let (on, afresh) = (longer("killed", &["--restart"]), longer("longer", &[]));
    for (name, bytes) in &afresh {
        assert!(on[name] == *bytes, "{name} differs");
    }
}

#[test]
fn a_restart_needs_the_snapshot_of_its_own_run() {
    let bench = Bench::new();
    let message = bench.fails(1, &["run", "scene.json", "--out=none", "--restart"]);
    assert!(message.contains("restart.snapshot"), "{message}");
    let with = "--set=output.restart_interval=0.002";
    bench.succeeds(&["run", "scene.json", "--out=out", with, "--quiet"]);
    let before = content(&bench.path("out"));
    let refused = |more: &[&str], word: &str| {
        let restart = ["run", "scene.json", "--out=out", with, "--restart"];
        let message = bench.fails(1, &[&restart[..], more].concat());
        assert!(message.contains(word), "{message}");
    };
    refused(
        &["--set=material.neo_hookean.density=1000"],
        "another scene",
    );
    refused(&["--set=probes.other=[0, 0, 0]"], "other columns");
    assert!(
        content(&bench.path("out")) == before,
        "a refusal changes nothing"
    );
    // Damaged in one bit, cut off, of another format, empty, not a file.
    let path = bench.path("out").join("restart.snapshot");
    let good = fs::read(&path).unwrap();
    let mut damaged = vec![
        good[..good.len() / 2].to_vec(),
        Vec::new(),
        b"URLSPHSN".to_vec(),
    ];
    for bit in (0..8 * good.len()).step_by(8 * good.len() / 97) {
        let mut bytes = good.clone();
        bytes[bit / 8] ^= 1 << (bit % 8);
        damaged.push(bytes);
    }
    for bytes in damaged {
        fs::write(&path, bytes).unwrap();
        refused(&[], "restart.snapshot");
    }
    fs::remove_file(&path).unwrap();
    fs::create_dir(&path).unwrap();
    refused(&[], "restart.snapshot");
    fs::remove_dir(&path).unwrap();
    fs::write(&path, &good).unwrap();
    let after = content(&bench.path("out"));
    assert!(
        after["history.csv"] == before["history.csv"],
        "a refused restart changes nothing"
    );
    bench.succeeds(&[
        "run",
        "scene.json",
        "--out=out",
        with,
        "--restart",
        "--quiet",
    ]);
    assert!(
        content(&bench.path("out")) == before,
        "nothing is left to do"
    );
}

#[test]
fn accuracy_asked_for_is_predicted_run_and_reported() {
    let bench = Bench::new();
    let arguments = [&FOR_ACCURACY[..], &["4%"]].concat();
    let printed = bench.succeeds(&arguments);
    for word in [
        "pilot 1 ",
        "predicted ",
        "final run ",
        "estimated error ",
        "within the tolerance of 4 %",
        "closure error",
    ] {
        assert!(printed.contains(word), "{word} in:\n{printed}");
    }
    let text = fs::read_to_string(bench.path("r/accuracy.json")).unwrap();
    let report: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!(report["of"], "probe.tip.displacement");
    assert_eq!(report["unit"], "m");
    assert_eq!(report["met"], true);
    let number = |value: &serde_json::Value| value.as_f64().unwrap();
    let estimate = &report["estimate"];
    let band = ["low", "best", "high"].map(|end| number(&estimate[end]));
    assert!(0.0 <= band[0] && band[0] <= band[1] && band[1] <= band[2] && band[2] <= 0.04);
    let runs = report["runs"].as_array().unwrap();
    assert!(runs.len() >= 5);
    let last = runs.iter().rfind(|run| run["role"] == "final").unwrap();
    assert!(number(&last["cost"]["cpu_seconds"]) > 0.0);

    // The scene that lies beside it is the one that was run, and gives the same rows.
    let rows = fs::read(bench.path("r/history.csv")).unwrap();
    bench.succeeds(&["run", "r/scene.json", "--out", "again", "--quiet"]);
    assert_eq!(fs::read(bench.path("again/history.csv")).unwrap(), rows);
    // A plain run in the same folder leaves no estimate of another one behind.
    bench.succeeds(&["run", "scene.json", "--out", "r", "--quiet"]);
    assert!(!bench.path("r/accuracy.json").exists());

    let quiet = bench.urlsph(&[&arguments[..], &["--quiet"]].concat());
    assert!(quiet.status.success(), "{}", stderr(&quiet));
    assert!(quiet.stdout.is_empty() && quiet.stderr.is_empty());
}

#[test]
fn accuracy_that_cannot_be_had_is_refused_with_the_reason_and_the_remedy() {
    let bench = Bench::new();
    let with = |more: &[&'static str]| [&FOR_ACCURACY[..], more].concat();
    for (arguments, words) in [
        (
            with(&["0.00001%", "--budget=0.5"]),
            &["CPU seconds", "of the budget of 0.5", "--budget"][..],
        ),
        (
            with(&["4%", "--set=numerics.time_step=1e-5"]),
            &["numerics.time_step", "leave it out"],
        ),
        (
            with(&["4%", "--set=probes={}"]),
            &["probe.tip.displacement", "`probes`"],
        ),
    ] {
        let message = bench.fails(1, &arguments);
        for word in words {
            assert!(message.contains(word), "{word} in: {message}");
        }
        assert!(!bench.path("r/history.csv").exists());
    }
    let mesh = meshed("bar_1.msh", "{}");
    let message = mesh.fails(1, &with(&["4%"]));
    assert!(message.contains("cannot be refined"), "{message}");

    for (tolerance, word) in [
        ("much", "such as 2%"),
        ("0", "such as 2%"),
        ("150%", "such as 2%"),
    ] {
        assert!(bench.fails(2, &with(&[tolerance])).contains(word));
    }
    for missing in [
        &["--tolerance", "4%"][..],
        &["--of", "probe.tip.displacement"],
        &["--budget", "10"],
    ] {
        let arguments = [&["run", "scene.json", "--out", "r"], missing].concat();
        let message = bench.fails(2, &arguments);
        assert!(
            message.contains("--of") || message.contains("--tolerance"),
            "{message}"
        );
    }
}

#[cfg(unix)]
#[test]
fn an_interrupted_pilot_has_status_130_and_leaves_no_results() {
    let bench = Bench::new();
    let child = bench
        .command(&[&FOR_ACCURACY[..], &["4%", "--until=1000"]].concat())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // The handler is installed before the folder is made.
    interrupt(child, || bench.path("r").exists());
    assert_eq!(fs::read_dir(bench.path("r")).unwrap().count(), 0);
}
