//! Text and bytes from outside: scenes, meshes, snapshots.

use std::cell::RefCell;

use urlsph::scene::MeshFile;
use urlsph::{Code, Error, Field, Scene, Simulation, Snapshot};
use xxhash_rust::xxh3::xxh3_64;

/// Bodies that are set up and stepped: larger ones take too long to learn anything from.
const MOST_BYTES: f64 = 1e6;

/// An error has to be one that a person can act on.
fn told(error: &Error) {
    assert_ne!(error.code(), Code::Internal, "{error}");
    assert!(!error.message().trim().is_empty());
    let text = error.to_string();
    assert!(text.len() < 20_000, "{} bytes of an error", text.len());
}

/// Sets a scene up, and makes two steps, if it is small.
fn run(scene: Scene) {
    if !scene.memory().is_ok_and(|bytes| bytes < MOST_BYTES) {
        return;
    }
    let mut simulation = match Simulation::with_threads(scene, 1) {
        Ok(simulation) => simulation,
        Err(error) => return told(&error),
    };
    for _ in 0..2 {
        let before = (simulation.time(), simulation.state_hash());
        let step = simulation.stable_step();
        assert!(step > 0.0, "a stable step of {step} s");
        match simulation.advance(before.0 + step) {
            Ok(()) => assert!(simulation.time() > before.0),
            Err(error) => {
                told(&error);
                assert_eq!((simulation.time(), simulation.state_hash()), before);
                return;
            }
        }
        // Whatever is accepted as a state is made of numbers.
        for field in [Field::Position, Field::Velocity, Field::DeformationGradient] {
            let mut values = vec![0.0; simulation.particle_count() * field.info().components];
            simulation
                .read_field(field, &mut values)
                .expect("a field of every body");
            assert!(values.iter().all(|v| v.is_finite()), "{field:?}");
        }
    }
}

/// The JSON of a scene; behind it, each after a NUL, overrides.
pub fn scene(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else {
        return;
    };
    let mut parts = text.split('\0');
    let json = parts.next().unwrap_or_default();
    let overrides: Vec<String> = parts.map(str::to_owned).collect();
    match Scene::from_json(json, &overrides) {
        Ok(scene) => run(scene),
        Err(error) => told(&error),
    }
}

/// A Gmsh file.
pub fn mesh(data: &[u8]) {
    const SCENE: &str = r#"{
        "geometry": {"mesh": {"file": "fuzzed.msh"}},
        "material": {"neo_hookean": {"density": 1000, "youngs_modulus": 1e7, "poisson_ratio": 0.3}},
        "time": {"end": 1}
    }"#;
    // Most are refused here, without a file.
    if let Err(error) = MeshFile::read(data, 1.0) {
        return told(&error);
    }
    thread_local! {
        static FOLDER: tempfile::TempDir = tempfile::tempdir().expect("a folder for the mesh");
    }
    FOLDER.with(|folder| {
        std::fs::write(folder.path().join("fuzzed.msh"), data).expect("the folder is writable");
        match Scene::from_json_in(SCENE, &[], folder.path()) {
            Ok(scene) => run(scene),
            Err(error) => told(&error),
        }
    });
}

/// A body with everything that a snapshot can hold, and its snapshot.
struct Body {
    simulation: Simulation,
    good: Snapshot,
    bytes: Vec<u8>,
    hash: u64,
}

impl Body {
    fn new() -> Self {
        const SCENE: &str = r#"{
            "geometry": {"box": {"min": [0, 0, 0], "max": [1, 1, 1], "spacing": 0.5}},
            "material": {"von_mises": {"density": 1000, "youngs_modulus": 1e7, "poisson_ratio": 0.3, "yield_stress": 1e4}},
            "heat": {"specific_heat": 100, "reference_temperature": 300, "conductivity": 10},
            "boundary": {"y_max": {"traction": {"external": [0, 0, 0]}}},
            "contact": {"floor": {"point": [0, -0.1, 0], "normal": [0, 1, 0]}},
            "initial": {"velocity": ["Y", 0, 0]},
            "numerics": {
                "state": "fhj", "volume_dissipation": 0.1, "operators": "repaired",
                "kernel_option": 3, "reference_update": "every_step"
            },
            "time": {"end": 1}
        }"#;
        let scene = Scene::from_json(SCENE, &[]).unwrap_or_else(|e| panic!("{e}"));
        let mut simulation = Simulation::with_threads(scene, 1).unwrap_or_else(|e| panic!("{e}"));
        let step = simulation.stable_step();
        simulation.advance(step).unwrap_or_else(|e| panic!("{e}"));
        let good = simulation.snapshot();
        Self {
            bytes: good.to_bytes(),
            hash: simulation.state_hash(),
            good,
            simulation,
        }
    }
}

/// The bytes of a snapshot; or, after a first byte that is odd, changes of a good one (place, bits) under a good
/// checksum, of which the second byte says how many bytes are cut off at the end.
pub fn snapshot(data: &[u8]) {
    thread_local! {
        static BODY: RefCell<Body> = RefCell::new(Body::new());
    }
    BODY.with_borrow_mut(|body| {
        let bytes = match data {
            [first, cut, changes @ ..] if first % 2 == 1 => {
                let length = body.bytes.len() - 8 - usize::from(*cut);
                let mut bytes = body.bytes[..length].to_vec();
                for change in changes.chunks_exact(4) {
                    let [a, b, c, bits] = [change[0], change[1], change[2], change[3]];
                    let at = u32::from_le_bytes([a, b, c, 0]) as usize % bytes.len();
                    bytes[at] ^= bits;
                }
                let sum = xxh3_64(&bytes);
                bytes.extend_from_slice(&sum.to_le_bytes());
                bytes
            }
            _ => data.to_vec(),
        };
        let simulation = &mut body.simulation;
        let restored = Snapshot::from_bytes(&bytes).and_then(|s| simulation.restore(&s));
        if let Err(error) = restored {
            told(&error);
            let hash = simulation.state_hash();
            assert_eq!(hash, body.hash, "a refused snapshot changes nothing");
            return;
        }
        let step = simulation.stable_step();
        if let Err(error) = simulation.advance(simulation.time() + step) {
            told(&error);
        }
        simulation.restore(&body.good).expect("of this scene");
        assert_eq!(simulation.snapshot(), body.good);
    });
}
