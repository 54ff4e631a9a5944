//! The inputs that fuzzing has collected, through their targets: `fuzz/README.md`.

#![cfg(feature = "fmi")]
#![allow(unsafe_code)] // The targets call the C ABI and the functions of FMI.

use std::path::{Path, PathBuf};

#[path = "../fuzz/src/lib.rs"]
mod fuzz;

fn replay(target: &str, run: fn(&[u8])) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("fuzz/corpus")
        .join(target);
    let entries = std::fs::read_dir(&folder).expect("the corpus is committed");
    let mut inputs: Vec<PathBuf> = entries.map(|e| e.expect("readable").path()).collect();
    inputs.sort();
    assert!(!inputs.is_empty(), "{} is empty", folder.display());
    for input in inputs {
        // The last line of a test that fails names the input.
        println!("{}", input.display());
        run(&std::fs::read(&input).expect("readable"));
    }
}

#[test]
fn scenes() {
    replay("scene", fuzz::scene);
}

#[test]
fn meshes() {
    replay("mesh", fuzz::mesh);
}

#[test]
fn snapshots() {
    replay("snapshot", fuzz::snapshot);
}

#[test]
fn calls_of_the_c_abi() {
    replay("calls", fuzz::calls);
}

#[test]
fn calls_of_fmi() {
    replay("fmi", fuzz::fmi);
}
