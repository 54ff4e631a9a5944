//! Bodies that are no lattice, from the outside: scenes, mesh files, patches, probes, errors.

mod common;

use std::path::{Path, PathBuf};

use urlsph::{Code, Error, Field, MeshSummary, Scene, Simulation};

use common::{close, field};

fn example(file: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("examples/meshes")
        .join(file)
}

fn text(geometry: &str) -> String {
    format!(
        r#"{{"geometry": {geometry},
            "material": {{"neo_hookean": {{"density": 1000, "youngs_modulus": 1e7, "poisson_ratio": 0.3}}}},
            "initial": {{"velocity": [1, 0, 0]}},
            "time": {{"end": 1e-3}}}}"#
    )
}

fn simulation(geometry: &str, overrides: &[&str]) -> Result<Simulation, Error> {
    let overrides: Vec<String> = overrides.iter().map(|o| (*o).to_owned()).collect();
    Simulation::with_threads(Scene::from_json(&text(geometry), &overrides)?, 2)
}

fn mesh(file: &str, scale: f64) -> String {
    format!(
        r#"{{"mesh": {{"file": {:?}, "scale": {scale}}}}}"#,
        example(file)
    )
}

fn area(simulation: &Simulation, patch: &str) -> f64 {
    let patches = simulation.patches();
    let patch = patches
        .iter()
        .find(|p| p.name == patch)
        .unwrap_or_else(|| panic!("{patch}"));
    patch.areas.iter().sum()
}

/// From the momentum at 1 m/s and 1000 kg/m^3.
fn volume(simulation: &Simulation) -> f64 {
    simulation.momenta().linear[0] / 1000.0
}

#[test]
fn mesh_files_become_bodies() {
    let cells = |s: &Simulation| -> MeshSummary { s.plan().mesh.expect("a mesh") };
    for (file, kind, count) in [
        ("cube_tetrahedra.msh", "tetrahedra", 1453),
        ("cube_hexahedra.msh", "hexahedra", 216),
    ] {
        let s = simulation(&mesh(file, 2.0), &[]).unwrap_or_else(|e| panic!("{file}: {e}"));
        assert_eq!(cells(&s).cells, [(kind, count)]);
        assert!(cells(&s).shortest_edge > 0.1);
        close(file, volume(&s), 8.0, 1e-13);
        for (axis, name) in ["x", "y", "z"].iter().enumerate() {
            for (sign, side) in [(-1.0, "min"), (1.0, "max")] {
                let name = format!("{name}_{side}");
                close(&name, area(&s, &name), 4.0, 1e-13);
                let patch = s.patches().iter().find(|p| p.name == name).unwrap();
                for n in &patch.normals {
                    assert!((n[axis] - sign).abs() < 1e-13, "{file}: {name}: {n:?}");
                }
            }
        }
    }
    // The copper bar approaches the quarter of a cylinder from inside.
    let exact = std::f64::consts::FRAC_PI_4 * 3.2e-3f64.powi(2) * 32.4e-3;
    let mut last = f64::INFINITY;
    for (file, nodes, tolerance) in [
        ("bar_1.msh", 388, 0.03),
        ("bar_2.msh", 730, 0.016),
        ("bar_3.msh", 1238, 0.009),
    ] {
        let s = simulation(&mesh(file, 1e-3), &[]).unwrap_or_else(|e| panic!("{file}: {e}"));
        assert_eq!(s.particle_count(), nodes);
        close(file, volume(&s), exact, tolerance);
        let gap = exact - volume(&s);
        assert!(gap > 0.0 && gap < last);
        last = gap;
        let section = volume(&s) / 32.4e-3;
        close("start", area(&s, "start"), 3.2e-3 * 32.4e-3, 1e-12);
        close("top", area(&s, "top"), section, tolerance);
    }
}

#[test]
fn every_body_runs() {
    for geometry in [
        r#"{"cylinder": {"radius": 1, "length": 2, "divisions": 2, "layers": 4}}"#.to_owned(),
        r#"{"cylinder": {"radius": 1, "length": 2, "divisions": 3, "layers": 4, "sector": {"wedge": 40}}}"#
            .to_owned(),
        r#"{"perforated_box": {"min": [0, 0, 0], "max": [2, 1, 1], "tiles": [2, 1], "diameter": 0.4,
            "divisions": 3, "rings": 2, "layers": 3}}"#
            .to_owned(),
        r#"{"box": {"min": [0, 0, 0], "max": [1, 1, 1], "spacing": 0.25, "grading": {"x": 3},
            "jitter": {"fraction": 0.2}}}"#
            .to_owned(),
        mesh("cube_tetrahedra.msh", 1.0),
    ] {
        for neighbours in ["6", "18", "26", r#"{"radius": 1.6}"#] {
            let set = format!("numerics.neighbours={neighbours}");
            let mut overrides = vec![set.as_str(), r#"initial={"velocity": ["Y", 0, 0]}"#];
            if geometry.contains("wedge") && neighbours == "6" {
                // The edges of the prisms around the axis leave the repair too little to choose from.
                let error = simulation(&geometry, &overrides).unwrap_err().to_string();
                assert!(error.contains("numerics.neighbours"), "{error}");
                overrides.push("numerics.operators=kernel");
            }
            let mut s = simulation(&geometry, &overrides)
                .unwrap_or_else(|e| panic!("{geometry}, {neighbours}: {e}"));
            let before = s.momenta().linear;
            s.advance(3.0 * s.stable_step())
                .unwrap_or_else(|e| panic!("{geometry}, {neighbours}: {e}"));
            let after = s.momenta().linear;
            for c in 0..3 {
                assert!((after[c] - before[c]).abs() < 1e-9 * before[0].abs().max(1.0));
            }
        }
    }
}

#[test]
fn more_is_shared_by_a_cell_than_by_a_face_and_an_edge() {
    let geometry = r#"{"cylinder": {"radius": 1, "length": 1.2, "divisions": 3, "layers": 6}}"#;
    let pairs = |neighbours: &str| {
        let set = format!("numerics.neighbours={neighbours}");
        simulation(geometry, &[&set]).unwrap().plan().neighbours
    };
    // Inside 6, 18 and 26; at the corners of the core there are three cells to a section, not four.
    let of_count = [pairs("6"), pairs("18"), pairs("26")];
    assert_eq!(of_count.map(|(least, ..)| least), [4, 9, 11]);
    assert_eq!(of_count.map(|(_, _, most)| most), [6, 18, 26]);
    let (_, few, _) = pairs(r#"{"radius": 1.5}"#);
    let (_, many, _) = pairs(r#"{"radius": 2.5}"#);
    assert!(few < many);
}

#[test]
fn the_caller_sees_the_nodes_of_the_file() {
    let s = simulation(&mesh("cube_hexahedra.msh", 1.0), &[]).unwrap();
    let text = std::fs::read_to_string(example("cube_hexahedra.msh")).unwrap();
    let nodes: Vec<[f64; 3]> = text
        .lines()
        .skip_while(|l| *l != "$Nodes")
        .skip(2)
        .take_while(|l| *l != "$EndNodes")
        .map(|l| {
            let mut numbers = l.split(' ').skip(1).map(|n| n.parse().unwrap());
            std::array::from_fn(|_| numbers.next().unwrap())
        })
        .collect();
    assert_eq!(field(&s, Field::InitialPosition), nodes.concat());
}

#[test]
fn patches_of_meshes_can_be_cut() {
    let region = |region: &str| {
        let patch = format!(r#"patches.cut={{"faces": ["z_max"], {region}}}"#);
        simulation(&mesh("cube_hexahedra.msh", 1.0), &[&patch])
    };
    let s = region(r#""max": [0.5, 9, 9]"#).unwrap();
    close("half the face", area(&s, "cut"), 0.5, 1e-13);
    let error = region(r#""min": [2, 0, 0]"#).unwrap_err();
    assert_eq!(error.place().path.as_deref(), Some("patches.cut"));
}

#[test]
fn probes_of_meshes_lie_inside() {
    let at = |point: &str| {
        simulation(
            &mesh("bar_2.msh", 1e-3),
            &[&format!("probes={{\"p\": {point}}}")],
        )
    };
    at("[0.001, 0.001, 0.02]").unwrap();
    at("[0, 0, 0.0324]").unwrap();
    let error = at("[0.003, 0.003, 0.02]").unwrap_err();
    assert_eq!(error.place().path.as_deref(), Some("probes.p"));
    assert!(error.message().contains("outside"), "{error}");
    assert!(error.place().position.is_some());
}

#[test]
fn a_mesh_stands_beside_its_scene() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("cube.msh");
    std::fs::copy(example("cube_hexahedra.msh"), &file).unwrap();
    let scene_file = folder.path().join("scene.json");
    std::fs::write(&scene_file, text(r#"{"mesh": {"file": "cube.msh"}}"#)).unwrap();
    let scene = Scene::from_file(&scene_file, &[]).unwrap();
    let first = Simulation::with_threads(scene.clone(), 1).unwrap();
    // Packed, it names the file without a folder and brings its content.
    let (packed, files) = scene.packed().unwrap();
    assert_eq!(files.len(), 1);
    let elsewhere = tempfile::tempdir().unwrap();
    for (name, content) in &files {
        std::fs::write(elsewhere.path().join(name), content).unwrap();
    }
    let packed_text = serde_json::to_string(&packed).unwrap();
    assert!(!packed_text.contains(&*folder.path().to_string_lossy()));
    let again = Scene::from_json_in(&packed_text, &[], elsewhere.path()).unwrap();
    let mut second = Simulation::with_threads(again, 1).unwrap();
    // The place of the file does not make another scene, its content does.
    second.restore(&first.snapshot()).unwrap();
    let other = std::fs::read_to_string(&file)
        .unwrap()
        .replace(" 0.5 ", " 0.51 ");
    std::fs::write(&file, other).unwrap();
    let changed = Simulation::with_threads(Scene::from_file(&scene_file, &[]).unwrap(), 1).unwrap();
    assert_eq!(
        second.restore(&changed.snapshot()).unwrap_err().code(),
        Code::Snapshot
    );
    assert!(scene.packed().unwrap_err().message().contains("changed"));
    std::fs::remove_file(&file).unwrap();
    let error = Scene::from_file(&scene_file, &[]).unwrap_err();
    assert_eq!(error.code(), Code::Io);
    assert_eq!(error.place().path.as_deref(), Some("geometry.mesh.file"));
    assert!(error.message().contains("cube.msh"), "{error}");
}

/// A tetrahedron and another one on top, as version 2.2.
const TWO: &str = "$MeshFormat
2.2 0 8
$EndMeshFormat
$PhysicalNames
1
2 7 \"the skin\"
$EndPhysicalNames
$Nodes
6
1 0 0 0
2 1 0 0
3 0 1 0
4 0 0 1
5 1 1 1
6 9 9 9
$EndNodes
$Elements
4
1 15 2 0 1 6
2 2 2 7 1 1 3 2
3 4 2 1 1 1 2 3 4
4 4 2 1 1 2 3 4 5
$EndElements
";

fn read(content: &str) -> Result<Simulation, Error> {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("body.msh");
    std::fs::write(&file, content).unwrap();
    let scene = Scene::from_json_in(
        &text(r#"{"mesh": {"file": "body.msh"}}"#),
        &[],
        folder.path(),
    )?;
    Simulation::with_threads(scene, 1)
}

fn notes(content: &str) -> String {
    let s = read(content).unwrap_or_else(|e| panic!("{e}"));
    s.plan().mesh.unwrap().notes.join("\n")
}

#[test]
fn what_users_have_is_read() {
    let s = read(TWO).unwrap_or_else(|e| panic!("{e}"));
    close("volume", volume(&s), 1.0 / 6.0 + 1.0 / 3.0, 1e-14);
    assert_eq!(s.particle_count(), 5);
    assert_eq!(s.patches().len(), 1);
    assert_eq!(s.patches()[0].name, "the_skin");
    assert!(notes(TWO).contains("1 nodes that no volume element uses"));
    // Without groups the whole surface is a patch.
    let bare = TWO.replace("2 2 2 7 1 1 3 2", "2 2 2 0 1 1 3 2");
    let s = read(&bare).unwrap();
    assert_eq!(s.patches()[0].name, "surface");
    assert_eq!(s.patches()[0].particles.len(), 5);
    assert!(notes(&bare).contains("no physical surfaces"));
    // A group without a name has a number.
    let unnamed = TWO.replace("2 7 \"the skin\"", "2 8 \"another\"");
    assert_eq!(read(&unnamed).unwrap().patches()[0].name, "surface_7");
    // All left-handed: turned.
    let turned = TWO
        .replace("3 4 2 1 1 1 2 3 4", "3 4 2 1 1 2 1 3 4")
        .replace("4 4 2 1 1 2 3 4 5", "4 4 2 1 1 3 2 4 5");
    assert!(notes(&turned).contains("left-handed"));
    close("turned", volume(&read(&turned).unwrap()), 0.5, 1e-14);
    // Twice in the file, for two physical groups.
    let twice = TWO.replace("$Elements\n4\n", "$Elements\n5\n3 4 2 2 1 1 2 3 4\n");
    assert!(notes(&twice).contains("twice"));
    // Windows' line ends, and other sections.
    assert!(read(&TWO.replace('\n', "\r\n")).is_ok());
    assert!(read(&TWO.replace("$Nodes\n", "$Comments\nany thing\n$EndComments\n$Nodes\n")).is_ok());
    // Second order: a tetrahedron of ten nodes.
    let curved = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n10\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n\
        5 .5 0 0\n6 .5 .5 0\n7 0 .5 0\n8 0 0 .5\n9 0 .5 .5\n10 .5 0 .5\n$EndNodes\n\
        $Elements\n1\n1 11 2 1 1 1 2 3 4 5 6 7 8 9 10\n$EndElements\n";
    let note = notes(curved);
    assert!(
        note.contains("1 second-order") && note.contains("6 nodes"),
        "{note}"
    );
}

#[test]
fn bad_mesh_files_are_refused_with_line_and_entity() {
    let rows: &[(&str, &str, &[&str])] = &[
        (
            "$MeshFormat\n2.2",
            "$MeshFormat\n4.0",
            &["line 2", "version 4.0", "4.1 or 2.2"],
        ),
        ("$MeshFormat\n", "hello\n", &["line 1", "no Gmsh mesh"]),
        ("2.2 0 8", "2.2 0 4", &["line 2", "4 bytes"]),
        ("2.2 0 8", "2.2 3 8", &["file type"]),
        (
            "4 0 0 1",
            "4 0 0 one",
            &["line 13", "expected a number instead of `one`"],
        ),
        ("4 0 0 1", "4 0 0 nan", &["line 13", "node 4", "not finite"]),
        ("4 0 0 1", "3 0 0 1", &["line 13", "node 3 is there twice"]),
        (
            "4 0 0 1",
            "4 0 1 0",
            &["line 13", "nodes 3 and 4", "same place"],
        ),
        ("$Nodes\n6", "$Nodes\n7", &["line 16", "fewer entries"]),
        ("$Nodes\n6", "$Nodes\n5", &["line 15", "more entries"]),
        ("$Nodes\n6", "$Nodes\n99999999999", &["99999999999 nodes"]),
        ("$Elements\n4", "$Elements\n4000000000", &["fewer entries"]),
        (
            "1 2 3 4\n",
            "1 2 3 44\n",
            &["line 21", "element 3", "node 44"],
        ),
        (
            "1 2 3 4\n",
            "1 2 3 3\n",
            &["line 21", "element 3", "node 3 twice"],
        ),
        (
            "1 2 3 4\n",
            "2 1 3 4\n",
            &["line 21", "element 3 is inverted", "and 0 more"],
        ),
        (
            "5 1 1 1",
            "5 0.2 0.4 0.4",
            &["line 22", "element 4 is flat"],
        ),
        (
            "7 1 1 3 2",
            "7 1 1 5 2",
            &["line 20", "surface element 2", "not a face"],
        ),
        (
            "3 4 2 1 1 1 2 3 4",
            "3 7 2 1 1 1 2 3 4 5",
            &["line 21", "element 3 is a pyramid"],
        ),
        (
            "3 4 2 1 1 1 2 3 4",
            "3 29 2 1 1 1 2 3 4 5",
            &["line 21", "type 29", "ElementOrder"],
        ),
        ("$EndElements\n", "", &["truncated"]),
        (
            "$EndElements\n",
            "$EndNodes\n",
            &["line 23", "expected $EndElements"],
        ),
        ("7 \"the skin\"", "7 the skin", &["line 6", "in quotes"]),
        ("$Nodes", "$Knots", &["line 8", "$Knots does not end"]),
        (
            "$EndElements\n",
            "$EndElements\nrest\n",
            &["line 24", "beginning of a section"],
        ),
    ];
    for (from, to, words) in rows {
        assert!(TWO.contains(from), "{from}");
        let error = read(&TWO.replacen(from, to, 1)).expect_err(to);
        assert_eq!(error.code(), Code::Parse, "{to}: {error}");
        assert_eq!(error.place().path.as_deref(), Some("geometry.mesh.file"));
        for word in *words {
            assert!(
                error.message().contains(word),
                "{to}: no `{word}` in: {error}"
            );
        }
        assert!(error.message().contains("body.msh"), "{error}");
    }
    let only_surface = TWO
        .replace("3 4 2 1 1 1 2 3 4\n4 4 2 1 1 2 3 4 5\n", "")
        .replace("ts\n4\n", "ts\n2\n");
    let error = read(&only_surface).unwrap_err();
    assert!(error.message().contains("no volume elements"), "{error}");
    // Two parts that share no node.
    let apart = TWO
        .replace("$Nodes\n6", "$Nodes\n9")
        .replace("6 9 9 9", "6 9 9 9\n7 10 9 9\n8 9 10 9\n9 9 9 10")
        .replace("4 4 2 1 1 2 3 4 5", "4 4 2 1 1 6 7 8 9");
    let error = read(&apart).unwrap_err();
    assert!(error.message().contains("not connected"), "{error}");
    // A face of three cells.
    let three = TWO
        .replace("$Nodes\n6", "$Nodes\n7")
        .replace("6 9 9 9", "6 9 9 9\n7 2 2 3")
        .replace("$Elements\n4", "$Elements\n5")
        .replace("$EndElements", "5 4 2 1 1 2 3 4 7\n$EndElements");
    let error = read(&three).unwrap_err();
    assert!(
        error.message().contains("3 cells share the face"),
        "{error}"
    );
}

#[test]
fn bad_geometries_are_refused_with_their_place() {
    let cylinder = r#"{"cylinder": {"radius": 1, "length": 2, "divisions": 2, "layers": 4, "sector": "full"}}"#;
    let perforated = r#"{"perforated_box": {"min": [0, 0, 0], "max": [2, 1, 1], "tiles": [2, 1],
        "diameter": 0.5, "divisions": 2, "rings": 1, "layers": 2, "solid": []}}"#;
    let one = r#"{"box": {"min": [0, 0, 0], "max": [1, 1, 1], "spacing": 0.5, "grading": {},
        "jitter": {"fraction": 0.1}}}"#;
    let rows: &[(&str, &str, &str, &str)] = &[
        (
            cylinder,
            "geometry.cylinder.radius=0",
            "geometry.cylinder.radius",
            "above 0",
        ),
        (
            cylinder,
            "geometry.cylinder.length=-1",
            "geometry.cylinder.length",
            "above 0",
        ),
        (
            cylinder,
            "geometry.cylinder.divisions=0",
            "geometry.cylinder.divisions",
            "at least 1",
        ),
        (
            cylinder,
            "geometry.cylinder.layers=0",
            "geometry.cylinder.layers",
            "at least 1",
        ),
        (
            cylinder,
            "geometry.cylinder.sector=third",
            "geometry.cylinder.sector",
            "`quarter`",
        ),
        (
            cylinder,
            r#"geometry.cylinder.sector={"wedge": 180}"#,
            "geometry.cylinder.sector.wedge",
            "180",
        ),
        (
            cylinder,
            "geometry.cylinder.grading=0",
            "geometry.cylinder.grading",
            "above 0",
        ),
        (
            cylinder,
            "geometry.cylinder.grading=[0, 1]",
            "geometry.cylinder.grading",
            "1 divisions, not 4",
        ),
        (
            cylinder,
            "geometry.cylinder.grading=fine",
            "geometry.cylinder.grading",
            "ratio",
        ),
        (
            cylinder,
            "geometry.cylinder.radial_grading=[0, 0.5, 0.9]",
            "geometry.cylinder.radial_grading",
            "end with 1",
        ),
        (
            cylinder,
            "geometry.cylinder.radial_grading=[0, 0, 1]",
            "geometry.cylinder.radial_grading[1]",
            "before",
        ),
        (
            cylinder,
            "geometry.cylinder.taper=[[0, 1]]",
            "geometry.cylinder.taper",
            "at least two",
        ),
        (
            cylinder,
            "geometry.cylinder.taper=[[0.5, 1], [1, 1]]",
            "geometry.cylinder.taper[0][0]",
            "bottom",
        ),
        (
            cylinder,
            "geometry.cylinder.taper=[[0, 1], [2, 1]]",
            "geometry.cylinder.taper[1][0]",
            "top",
        ),
        (
            cylinder,
            "geometry.cylinder.taper=[[0, 1], [1, 0]]",
            "geometry.cylinder.taper[1][1]",
            "above 0",
        ),
        (
            perforated,
            "geometry.perforated_box.diameter=1",
            "geometry.perforated_box.diameter",
            "tiles' width 1",
        ),
        (
            perforated,
            "geometry.perforated_box.max=[2, 0, 1]",
            "geometry.perforated_box.max[1]",
            "more than",
        ),
        (
            perforated,
            "geometry.perforated_box.tiles=[0, 1]",
            "geometry.perforated_box.tiles[0]",
            "at least 1",
        ),
        (
            perforated,
            "geometry.perforated_box.rings=0",
            "geometry.perforated_box.rings",
            "at least 1",
        ),
        (
            perforated,
            "geometry.perforated_box.solid=[[2, 0]]",
            "geometry.perforated_box.solid[0]",
            "2 by 1",
        ),
        (
            perforated,
            "geometry.perforated_box.solid=[[1, 0], [1, 0]]",
            "geometry.perforated_box.solid[1]",
            "twice",
        ),
        (
            one,
            "geometry.box.jitter.fraction=0.5",
            "geometry.box.jitter.fraction",
            "less than 0.5",
        ),
        (
            one,
            "geometry.box.grading.z=-2",
            "geometry.box.grading.z",
            "above 0",
        ),
        (
            one,
            "geometry.box.grading.y=[0, 0.7, 0.3, 1]",
            "geometry.box.grading.y[2]",
            "0.7",
        ),
        (
            r#"{"boxes": {"a": {"min": [0, 0, 0], "max": [1, 1, 1], "spacing": 0.5, "jitter": {"fraction": 0.1}}}}"#,
            "title=one lattice",
            "geometry.boxes.a.jitter",
            "single box",
        ),
        (
            r#"{"mesh": {"file": "none.msh"}}"#,
            "title=no file",
            "geometry.mesh.file",
            "none.msh",
        ),
        (
            r#"{"mesh": {"file": "."}}"#,
            "title=a folder",
            "geometry.mesh.file",
            "cannot be read",
        ),
        (
            r#"{"mesh": {"file": "x.msh"}}"#,
            "geometry.mesh.scale=0",
            "geometry.mesh.scale",
            "above 0",
        ),
        (
            cylinder,
            "boundary.start.support=roller",
            "boundary.start",
            "`bottom`, `top`, `side`",
        ),
        (
            cylinder,
            r#"probes={"p": [0, 0, 5]}"#,
            "probes.p",
            "outside",
        ),
    ];
    for (geometry, set, path, word) in rows {
        let error = simulation(geometry, &[set]).expect_err(set);
        assert_eq!(error.place().path.as_deref(), Some(*path), "{set}: {error}");
        assert!(
            error.message().contains(word),
            "{set}: no `{word}` in: {error}"
        );
    }
    for (geometry, path) in [
        (
            cylinder.replace(r#""layers": 4"#, r#""layers": 4000000000"#),
            "geometry.cylinder",
        ),
        (
            cylinder.replace(r#""divisions": 2"#, r#""divisions": 4000000000"#),
            "geometry.cylinder",
        ),
        (
            perforated.replace(r#""rings": 1"#, r#""rings": 4000000000"#),
            "geometry.perforated_box",
        ),
    ] {
        let error = simulation(&geometry, &[]).unwrap_err();
        assert_eq!(error.code(), Code::OutOfMemory, "{error}");
        assert_eq!(error.place().path.as_deref(), Some(path));
    }
}
