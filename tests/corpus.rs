//! The inputs that fuzzing found, among them those that once failed: `fuzz/README.md`.
#![cfg(feature = "fmi")]
#![allow(unsafe_code, missing_docs)] // The C functions.

#[path = "../fuzz/src/lib.rs"]
mod fuzzed;

use std::fs;
use std::path::Path;

/// Runs a target on every committed input.
fn all(target: &str, run: fn(&[u8])) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/corpus").join(target);
    let mut count = 0;
    for entry in fs::read_dir(&folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display())) {
        let path = entry.expect("an entry").path();
        println!("{}", path.display());
        run(&fs::read(&path).expect("a file"));
        count += 1;
    }
    println!("{target}: {count} inputs");
    assert!(count > 0);
}

#[test]
fn scenes() {
    all("scene", fuzzed::scene);
}

#[test]
fn meshes() {
    all("mesh", fuzzed::mesh);
}

#[test]
fn snapshots() {
    all("snapshot", fuzzed::snapshot);
}

#[test]
fn calls() {
    all("calls", fuzzed::calls);
}

#[test]
fn fmi() {
    all("fmi", fuzzed::fmi);
}
