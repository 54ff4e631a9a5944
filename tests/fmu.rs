//! FMUs of both versions through `fmi-rs`, an importer that is not ours: load, validate, step, roll
//! back; and the packager.
#![cfg(feature = "fmi")]

use std::path::{Path, PathBuf};
use std::ptr::null_mut;

use fmi_rs::fmi2::builder::FMU2Builder;
use fmi_rs::fmi2::types::fmi2Status;
use fmi_rs::fmi2::{CS, FMU2};
use fmi_rs::fmi3::FMU3;
use fmi_rs::fmi3::builder::FMU3Builder;
use fmi_rs::fmi3::types::fmi3Status;
use fmi_rs::model_description::{fmi2, fmi3};
use tempfile::TempDir;
use urlsph::fmu::{self, FmiVersion};
use urlsph::{Code, Scene, Simulation};

const SCENE: &str = r#"{
    "title": "Column",
    "geometry": {"box": {"min": [0, 0, 0], "max": [1, 3, 1], "spacing": 0.5}},
    "material": {"neo_hookean": {"density": 1100, "youngs_modulus": 1.7e7, "poisson_ratio": 0.3}},
    "boundary": {
        "y_min": {"support": "clamped"},
        "y_max": {"traction": {"external": [1000, 0, 0], "per_particle": true}}
    },
    "probes": {"tip": [0.5, 3, 0.5]},
    "time": {"end": 0.05}
}"#;
/// Particles of the top face.
const TOP: usize = 9;

fn scene() -> Scene {
    Scene::from_json(SCENE, &[]).unwrap()
}

fn export(folder: &TempDir, version: FmiVersion) -> PathBuf {
    let path = folder.path().join(format!("{version:?}.fmu"));
    fmu::package(&scene(), version, &fmu::find_library().unwrap(), &path).unwrap();
    path
}

/// An instance in FMI 3.0, after initialisation, with values by name.
struct Three {
    description: fmi3::ModelDescription,
    fmu: std::sync::Arc<FMU3>,
}

impl Three {
    fn new(path: &Path) -> Self {
        let mut builder = FMU3Builder::new(&path).unwrap();
        builder.eventModeUsed = false;
        let fmu = builder.instantiate_cs("column").unwrap();
        assert_eq!(
            fmu.enterInitializationMode(None, 0.0, Some(0.05)),
            fmi3Status::Ok
        );
        assert_eq!(fmu.exitInitializationMode(), fmi3Status::Ok);
        let description = fmi3::ModelDescription::from_path(
            &builder.unzipdir.path().join("modelDescription.xml"),
        )
        .unwrap();
        Self { description, fmu }
    }
    fn reference(&self, name: &str) -> u32 {
        self.description
            .variable_by_name(name)
            .unwrap()
            .valueReference
    }
    fn get<const N: usize>(&self, name: &str) -> [f64; N] {
        let mut values = [0.0; N];
        let status = self.fmu.getFloat64(&[self.reference(name)], &mut values);
        assert_eq!(status, fmi3Status::Ok, "{name}");
        values
    }
    fn step(&self, point: f64, size: f64) -> fmi3Status {
        let (mut event, mut terminate, mut early, mut last) = (true, true, true, f64::NAN);
        let status = self.fmu.doStep(
            point,
            size,
            false,
            &mut event,
            &mut terminate,
            &mut early,
            &mut last,
        );
        if status == fmi3Status::Ok {
            assert!(!event && !terminate && !early);
            assert_eq!(last, point + size);
        }
        status
    }
}

/// An instance in FMI 2.0, after initialisation.
struct Two {
    description: fmi2::ModelDescription,
    fmu: std::sync::Arc<FMU2<CS>>,
}

impl Two {
    fn new(path: &Path) -> Self {
        let builder = FMU2Builder::new(&path).unwrap();
        let fmu = builder.instantiate_cs("column").unwrap();
        assert_eq!(fmu.setupExperiment(None, 0.0, Some(0.05)), fmi2Status::Ok);
        assert_eq!(fmu.enterInitializationMode(), fmi2Status::Ok);
        assert_eq!(fmu.exitInitializationMode(), fmi2Status::Ok);
        let description = fmi2::ModelDescription::from_path(
            &builder.unzipdir.path().join("modelDescription.xml"),
        )
        .unwrap();
        Self { description, fmu }
    }
    fn reference(&self, name: &str) -> u32 {
        let found = self
            .description
            .modelVariables
            .iter()
            .find(|v| v.name == name);
        found.unwrap_or_else(|| panic!("no {name}")).valueReference
    }
    fn get<const N: usize>(&self, name: &str) -> [f64; N] {
        let references: [u32; N] = std::array::from_fn(|k| match N {
            1 => self.reference(name),
            _ => self.reference(&format!("{name}[{}]", k + 1)),
        });
        let mut values = [0.0; N];
        assert_eq!(
            self.fmu.getReal(&references, &mut values),
            fmi2Status::Ok,
            "{name}"
        );
        values
    }
    fn step(&self, point: f64, size: f64) -> fmi2Status {
        self.fmu.doStep(point, size, 0)
    }
}

/// The body in the library itself, stepped like the FMUs.
fn directly(steps: &[f64]) -> Simulation {
    let mut simulation = Simulation::new(scene()).unwrap();
    for &end in steps {
        simulation.advance(end).unwrap();
    }
    simulation
}

#[test]
fn fmi3_agrees_with_the_library() {
    let folder = TempDir::new().unwrap();
    let fmu = Three::new(&export(&folder, FmiVersion::V3));
    let problems = fmu.description.validate();
    assert!(problems.is_empty(), "{problems:?}");
    assert_eq!(fmu.fmu.getVersion(), "3.0");
    assert_eq!(fmu.step(0.0, 0.004), fmi3Status::Ok);
    assert_eq!(fmu.step(0.004, 0.003), fmi3Status::Ok);
    let simulation = directly(&[0.004, 0.004 + 0.003]);
    assert_eq!(
        fmu.get("probe.tip.displacement"),
        simulation.probe(0).displacement
    );
    assert_eq!(fmu.get("energy.kinetic"), [simulation.energies().kinetic]);
    let top = simulation.patch_index("y_max").unwrap();
    assert_eq!(
        fmu.get("boundary.y_max.force"),
        simulation.resultant(top).force
    );
    let positions: [f64; 3 * TOP] = fmu.get("boundary.y_max.initial_position");
    assert!(positions.chunks(3).all(|x| x[1] == 3.0));
    let mut steps = [0];
    assert_eq!(
        fmu.fmu.getUInt64(&[fmu.reference("steps")], &mut steps),
        fmi3Status::Ok
    );
    assert_eq!(steps, [simulation.steps()]);
    assert_eq!(fmu.fmu.terminate(), fmi3Status::Ok);
}

#[test]
fn fmi2_agrees_with_the_library() {
    let folder = TempDir::new().unwrap();
    let fmu = Two::new(&export(&folder, FmiVersion::V2));
    let problems = fmu.description.validate();
    assert!(problems.is_empty(), "{problems:?}");
    assert_eq!(fmu.fmu.getVersion(), "2.0");
    assert_eq!(fmu.step(0.0, 0.004), fmi2Status::Ok);
    assert_eq!(fmu.step(0.004, 0.003), fmi2Status::Ok);
    let simulation = directly(&[0.004, 0.004 + 0.003]);
    assert_eq!(
        fmu.get("probe.tip.displacement"),
        simulation.probe(0).displacement
    );
    assert_eq!(fmu.get("momentum.linear"), simulation.momenta().linear);
    let mut steps = [0];
    assert_eq!(
        fmu.fmu.getInteger(&[fmu.reference("steps")], &mut steps),
        fmi2Status::Ok
    );
    assert_eq!(u64::try_from(steps[0]).unwrap(), simulation.steps());
    assert_eq!(fmu.fmu.terminate(), fmi2Status::Ok);
}

#[test]
fn fmi3_rolls_back_through_memory_and_bytes() {
    let folder = TempDir::new().unwrap();
    let path = export(&folder, FmiVersion::V3);
    let fmu = Three::new(&path);
    let load = [2e4; 3 * TOP];
    assert_eq!(
        fmu.fmu
            .setFloat64(&[fmu.reference("boundary.y_max.traction")], &load),
        fmi3Status::Ok
    );
    assert_eq!(fmu.step(0.0, 0.002), fmi3Status::Ok);
    let mut state = null_mut();
    assert_eq!(fmu.fmu.getFMUState(&mut state), fmi3Status::Ok);
    let mut size = 0;
    assert_eq!(
        fmu.fmu.serializedFMUStateSize(state, &mut size),
        fmi3Status::Ok
    );
    let mut bytes = vec![0; size];
    assert_eq!(fmu.fmu.serializeFMUState(state, &mut bytes), fmi3Status::Ok);

    assert_eq!(fmu.step(0.002, 0.003), fmi3Status::Ok);
    let first: [f64; 3] = fmu.get("probe.tip.velocity");
    assert_eq!(fmu.fmu.setFMUState(state), fmi3Status::Ok);
    assert_eq!(fmu.step(0.002, 0.003), fmi3Status::Ok);
    assert_eq!(fmu.get("probe.tip.velocity"), first);
    assert_eq!(fmu.fmu.freeFMUState(&mut state), fmi3Status::Ok);
    assert!(state.is_null());

    let other = Three::new(&path);
    assert_eq!(
        other.fmu.deserializeFMUState(&bytes, &mut state),
        fmi3Status::Ok
    );
    assert_eq!(other.fmu.setFMUState(state), fmi3Status::Ok);
    assert_eq!(other.get("boundary.y_max.traction"), load);
    assert_eq!(other.step(0.002, 0.003), fmi3Status::Ok);
    assert_eq!(other.get("probe.tip.velocity"), first);
    assert_eq!(other.fmu.freeFMUState(&mut state), fmi3Status::Ok);
}

#[test]
fn fmi2_rolls_back_through_memory_and_bytes() {
    let folder = TempDir::new().unwrap();
    let path = export(&folder, FmiVersion::V2);
    let fmu = Two::new(&path);
    let load = fmu.reference("boundary.y_max.traction[1,3]");
    assert_eq!(fmu.fmu.setReal(&[load], &[5e4]), fmi2Status::Ok);
    assert_eq!(fmu.step(0.0, 0.002), fmi2Status::Ok);
    let mut state = null_mut();
    assert_eq!(fmu.fmu.getFMUstate(&mut state), fmi2Status::Ok);
    let mut size = 0;
    assert_eq!(
        fmu.fmu.serializedFMUstateSize(state, &mut size),
        fmi2Status::Ok
    );
    let mut bytes = vec![0; size];
    assert_eq!(fmu.fmu.serializeFMUstate(state, &mut bytes), fmi2Status::Ok);

    assert_eq!(fmu.step(0.002, 0.003), fmi2Status::Ok);
    let first: [f64; 3] = fmu.get("probe.tip.velocity");
    assert_eq!(fmu.fmu.setFMUstate(state), fmi2Status::Ok);
    assert_eq!(fmu.step(0.002, 0.003), fmi2Status::Ok);
    assert_eq!(fmu.get("probe.tip.velocity"), first);
    assert_eq!(fmu.fmu.freeFMUstate(&mut state), fmi2Status::Ok);

    let other = Two::new(&path);
    assert_eq!(
        other.fmu.deSerializeFMUstate(&bytes, &mut state),
        fmi2Status::Ok
    );
    assert_eq!(other.fmu.setFMUstate(state), fmi2Status::Ok);
    assert_eq!(other.step(0.002, 0.003), fmi2Status::Ok);
    assert_eq!(other.get("probe.tip.velocity"), first);
    assert_eq!(other.fmu.freeFMUstate(&mut state), fmi2Status::Ok);
}

#[test]
fn wrong_calls_are_errors_and_change_nothing() {
    let folder = TempDir::new().unwrap();
    let fmu = Three::new(&export(&folder, FmiVersion::V3));
    assert_eq!(fmu.step(0.0, 0.002), fmi3Status::Ok);
    let before: [f64; 1] = fmu.get("energy.kinetic");
    assert_eq!(fmu.step(0.001, 0.002), fmi3Status::Error);
    assert_eq!(fmu.step(0.002, 0.0), fmi3Status::Error);
    assert_eq!(
        fmu.step(0.002, 0.1),
        fmi3Status::Error,
        "beyond the stop time"
    );
    let traction = fmu.reference("boundary.y_max.traction");
    assert_eq!(
        fmu.fmu.setFloat64(&[traction], &[1.0; 3]),
        fmi3Status::Error
    );
    assert_eq!(
        fmu.fmu.setFloat64(&[traction], &[f64::NAN; 3 * TOP]),
        fmi3Status::Error
    );
    assert_eq!(
        fmu.fmu.setFloat64(&[0], &[1.0]),
        fmi3Status::Error,
        "time is computed"
    );
    assert_eq!(fmu.fmu.getInt8(&[traction], &mut [0]), fmi3Status::Error);
    assert_eq!(fmu.fmu.enterEventMode(), fmi3Status::Error);
    assert_eq!(fmu.get("energy.kinetic"), before);
    let traction: [f64; 3 * TOP] = fmu.get("boundary.y_max.traction");
    assert_eq!(traction[..], [1000.0, 0.0, 0.0].repeat(TOP));
    assert_eq!(fmu.step(0.002, 0.002), fmi3Status::Ok);
}

#[test]
fn the_description_is_that_of_the_library() {
    let simulation = Simulation::new(scene()).unwrap();
    for version in [FmiVersion::V2, FmiVersion::V3] {
        let folder = TempDir::new().unwrap();
        let path = export(&folder, version);
        fmi_rs::zip::extract_zip_archive(&path, folder.path().join("files")).unwrap();
        let written = std::fs::read_to_string(folder.path().join("files/modelDescription.xml"));
        assert_eq!(
            written.unwrap(),
            fmu::model_description(&simulation, version).unwrap()
        );
    }
}

#[test]
fn the_packager_names_what_is_wrong() {
    let folder = TempDir::new().unwrap();
    let out = folder.path().join("column.fmu");
    let no_library = folder.path().join("none.so");
    let error = fmu::package(&scene(), FmiVersion::V3, &no_library, &out).unwrap_err();
    assert_eq!(error.code(), Code::Io);
    assert!(error.to_string().contains("none.so"), "{error}");

    let wrong_library = folder.path().join("wrong.so");
    std::fs::write(&wrong_library, "not a library").unwrap();
    let error = fmu::package(&scene(), FmiVersion::V3, &wrong_library, &out).unwrap_err();
    assert_eq!(error.code(), Code::InvalidArgument);
    assert!(error.to_string().contains("wrong.so"), "{error}");

    let library = fmu::find_library().unwrap();
    let nowhere = folder.path().join("nowhere/column.fmu");
    let error = fmu::package(&scene(), FmiVersion::V3, &library, &nowhere).unwrap_err();
    assert_eq!(error.code(), Code::Io);
    assert!(error.to_string().contains("nowhere"), "{error}");

    // Nothing half-written is left.
    assert!(!out.exists());
    let left: Vec<_> = folder
        .path()
        .read_dir()
        .unwrap()
        .map(|e| e.unwrap().file_name())
        .collect();
    assert_eq!(left, ["wrong.so"]);
}

/// A cube of hexahedra, 2 m wide, on the mesh that `cube.msh` in a folder is.
fn meshed(folder: &Path) -> Scene {
    let text = SCENE
        .replace(
            r#"{"box": {"min": [0, 0, 0], "max": [1, 3, 1], "spacing": 0.5}}"#,
            r#"{"mesh": {"file": "cube.msh", "scale": 2}}"#,
        )
        .replace(r#""per_particle": true"#, r#""per_particle": false"#)
        .replace("[0.5, 3, 0.5]", "[0.5, 2, 0.5]");
    Scene::from_json_in(&text, &[], folder).unwrap()
}

/// The mesh file in a folder of its own.
fn folder_with_mesh() -> TempDir {
    let folder = TempDir::new().unwrap();
    let mesh = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/meshes/cube_hexahedra.msh");
    std::fs::copy(mesh, folder.path().join("cube.msh")).unwrap();
    folder
}

/// An FMU of a mesh, moved away from where it was made, with nothing left there; and the body in the
/// library itself.
fn moved_away(version: FmiVersion) -> (TempDir, PathBuf, Simulation) {
    let folder = folder_with_mesh();
    let scene = meshed(folder.path());
    let path = folder.path().join("cube.fmu");
    fmu::package(&scene, version, &fmu::find_library().unwrap(), &path).unwrap();
    let away = TempDir::new().unwrap();
    let moved = away.path().join("elsewhere.fmu");
    std::fs::copy(&path, &moved).unwrap();
    folder.close().unwrap();
    (away, moved, Simulation::new(scene).unwrap())
}

#[test]
fn fmi3_carries_its_mesh() {
    let (_away, path, mut simulation) = moved_away(FmiVersion::V3);
    let fmu = Three::new(&path);
    assert_eq!(fmu.step(0.0, 1e-3), fmi3Status::Ok);
    // Another material; the importer has removed the files that it unpacked.
    assert_eq!(fmu.fmu.reset(), fmi3Status::Ok);
    let density = fmu.reference("material.density");
    assert_eq!(fmu.fmu.setFloat64(&[density], &[2200.0]), fmi3Status::Ok);
    let initialized = fmu.fmu.enterInitializationMode(None, 0.0, Some(0.05));
    assert_eq!(initialized, fmi3Status::Ok);
    assert_eq!(fmu.fmu.exitInitializationMode(), fmi3Status::Ok);
    let total: f64 = fmu.get::<49>("boundary.y_max.area").iter().sum();
    assert!((total - 4.0).abs() < 1e-12, "{total}");
    assert_eq!(fmu.step(0.0, 1e-3), fmi3Status::Ok);
    let heavy: [f64; 3] = fmu.get("probe.tip.displacement");

    let fmu = Three::new(&path);
    assert_eq!(fmu.step(0.0, 1e-3), fmi3Status::Ok);
    simulation.advance(1e-3).unwrap();
    let light = simulation.probe(0).displacement;
    assert_eq!(fmu.get("probe.tip.displacement"), light);
    assert!(light[0] > heavy[0] && heavy[0] > 0.0, "{light:?} {heavy:?}");
}

#[test]
fn fmi2_carries_its_mesh() {
    let (_away, path, mut simulation) = moved_away(FmiVersion::V2);
    let fmu = Two::new(&path);
    assert_eq!(fmu.step(0.0, 1e-3), fmi2Status::Ok);
    simulation.advance(1e-3).unwrap();
    assert_eq!(
        fmu.get("probe.tip.displacement"),
        simulation.probe(0).displacement
    );
}

#[test]
fn an_fmu_does_not_tell_where_its_mesh_was() {
    let (first, second) = (folder_with_mesh(), folder_with_mesh());
    for version in [FmiVersion::V2, FmiVersion::V3] {
        let bytes = [&first, &second].map(|folder| {
            let path = folder.path().join("cube.fmu");
            let library = fmu::find_library().unwrap();
            fmu::package(&meshed(folder.path()), version, &library, &path).unwrap();
            std::fs::read(path).unwrap()
        });
        assert!(bytes[0] == bytes[1], "{version:?}: the bytes differ");
    }
}

#[test]
fn a_mesh_that_has_changed_or_gone_is_an_error_of_the_packager() {
    let folder = folder_with_mesh();
    let scene = meshed(folder.path());
    let out = folder.path().join("cube.fmu");
    let library = fmu::find_library().unwrap();
    let mesh = folder.path().join("cube.msh");
    for said in ["has changed", "cannot be read"] {
        if said == "has changed" {
            std::fs::write(&mesh, "another one").unwrap();
        } else {
            std::fs::remove_file(&mesh).unwrap();
        }
        let error = fmu::package(&scene, FmiVersion::V3, &library, &out).unwrap_err();
        assert_eq!(error.code(), Code::Io);
        let text = error.to_string();
        assert!(text.contains("cube.msh") && text.contains(said), "{text}");
        assert!(!out.exists());
    }
}
