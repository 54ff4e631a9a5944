//! The catalogue of errors: every entry is brought about and read, every place in the source that makes an error
//! has an entry, and `ERRORS.md` is what the catalogue says. Some cases need the devices and limits of Linux.
#![cfg(all(feature = "cli", target_os = "linux"))]

mod catalogue;
#[path = "../common/mod.rs"]
mod common;
mod document;
mod geometry;
mod interface;
mod mesh;
mod run;
mod scene;
mod shape;
mod sites;

use std::collections::BTreeMap;
use std::path::Path;

use catalogue::{Case, Entry, Outcome, is_of, mentions, parts};
use urlsph::{Error, Scene};

/// Two boxes that share a face.
const TWO_BOXES: &str = r#"geometry={"boxes": {
    "a": {"min": [0, 0, 0], "max": [1, 1, 1], "spacing": 0.5},
    "b": {"min": [1, 0, 0], "max": [2, 1, 1], "spacing": 0.5}}}"#;

fn scene() -> Scene {
    Scene::from_json(common::BLOCK, &[]).unwrap()
}

/// The block with a pressure that is a table, which may hold what JSON cannot.
fn with_table(time: f64, value: f64) -> urlsph::Result<()> {
    let mut scene = scene();
    let condition = serde_json::from_str("{}").unwrap();
    let condition = scene.boundary.entry("y_max".into()).or_insert(condition);
    condition.pressure = Some(shape::table(time, value));
    scene.validate()
}

fn entries() -> Vec<Entry> {
    [
        shape::entries(),
        scene::entries(),
        geometry::entries(),
        mesh::entries(),
        run::entries(),
        interface::entries(),
    ]
    .into_iter()
    .flatten()
    .collect()
}

/// What an error's place names, in the words of the catalogue.
fn named(error: &Error) -> Vec<&'static str> {
    let p = error.place();
    [
        ("path", p.path.is_some()),
        ("boundary", p.boundary.is_some()),
        ("field", p.field.is_some()),
        ("particle", p.particle.is_some()),
        ("position", p.position.is_some()),
        ("time", p.time.is_some()),
    ]
    .into_iter()
    .filter_map(|(name, is)| is.then_some(name))
    .collect()
}

/// What is wrong with an error that a case has brought about.
fn verdict(entry: &Entry, case: &Case, error: &Error) -> Option<String> {
    if Some(error.code()) != entry.code {
        return Some(format!("code {:?}", error.code()));
    }
    if !is_of(&entry.text, error.message()) {
        return Some("another text".to_owned());
    }
    let path = error.place().path.as_deref();
    if case.path.is_some() && path != case.path {
        return Some(format!("the path {path:?} instead of {:?}", case.path));
    }
    let named = named(error);
    let mut words = entry.place.split_whitespace();
    let known = |name: &&str| {
        entry
            .place
            .split_whitespace()
            .any(|w| w.trim_end_matches('?') == *name)
    };
    let missing = words.find(|w| !w.ends_with('?') && !named.contains(w));
    let unknown = named.iter().find(|name| !known(name));
    match (missing, unknown) {
        (None, None) => None,
        _ => Some(format!("the place {named:?} instead of {:?}", entry.place)),
    }
}

#[test]
fn every_error_is_brought_about_and_reads_as_the_catalogue_says() {
    let (mut count, mut faults) = (0, Vec::new());
    for entry in entries() {
        let mut texts = Vec::new();
        for case in &entry.cases {
            count += 1;
            let (text, fault) = match (case.run)() {
                Outcome::Error(error) => (error.to_string(), verdict(&entry, case, &error)),
                Outcome::Text(text) => {
                    let fault = (!mentions(&entry.text, &text)).then(|| "another text".to_owned());
                    (text, fault)
                }
            };
            println!("{text}");
            if let Some(fault) = fault {
                let what = &case.what;
                faults.push(format!("{}\n    {what}: {fault}: {text}", entry.text));
            }
            texts.push(text);
        }
        for variant in entry.variants {
            let seen = texts.iter().any(|text| mentions(variant, text));
            if !seen && entry.units.is_empty() && entry.untested.is_none() {
                faults.push(format!("{}\n    no case gives: {variant}", entry.text));
            }
        }
        let tested = !entry.cases.is_empty() || !entry.units.is_empty();
        if tested == entry.untested.is_some() {
            faults.push(format!("{}\n    tested or not?", entry.text));
        }
    }
    println!("{count} cases");
    assert!(
        faults.is_empty(),
        "{} faults:\n{}",
        faults.len(),
        faults.join("\n")
    );
}

/// The unit tests that entries name are there, and speak of the entry's text.
#[test]
fn unit_tests_read_the_texts_of_their_entries() {
    let mut tests = BTreeMap::new();
    let mut faults = Vec::new();
    for entry in entries() {
        for &(file, name) in &entry.units {
            let literals = tests
                .entry((file, name))
                .or_insert_with(|| sites::literals_of_test(file, name));
            let texts = std::iter::once(entry.text.as_str()).chain(entry.variants.iter().copied());
            let fixed: Vec<&str> = texts
                .flat_map(parts)
                .map(str::trim)
                .filter(|part| part.len() >= 8)
                .collect();
            let reads = |literal: &String| {
                let literal = literal.trim();
                let is_of = |part: &&str| literal.contains(*part) || part.contains(literal);
                literal.len() >= 8 && fixed.iter().any(is_of)
            };
            if !literals.iter().any(reads) {
                faults.push(format!("{file}: {name} does not read: {}", entry.text));
            }
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn every_place_that_makes_an_error_has_an_entry() {
    let entries = entries();
    let texts = |entry: &Entry| -> Vec<String> {
        let all = std::iter::once(entry.text.as_str()).chain(entry.variants.iter().copied());
        all.map(|text| parts(text).join("\0")).collect()
    };
    let is_at = |text: &String, site: &sites::Site| text.contains(site.text.trim_matches('\0'));
    let known: Vec<String> = entries.iter().flat_map(texts).collect();
    let found = sites::all();
    let without: Vec<String> = found
        .messages
        .iter()
        .filter(|site| !known.iter().any(|text| is_at(text, site)))
        .map(|site| {
            format!(
                "{}:{}: {}",
                site.file,
                site.line,
                site.text.replace('\0', "<>")
            )
        })
        .collect();
    println!(
        "{} texts in the source, {} entries",
        found.messages.len(),
        entries.len()
    );
    assert!(
        without.is_empty(),
        "texts without an entry:\n{}",
        without.join("\n")
    );
    let is_made = |entry: &&Entry| {
        let texts = texts(entry);
        found
            .messages
            .iter()
            .any(|site| texts.iter().any(|text| is_at(text, site)))
    };
    let otherwise: Vec<&str> = entries
        .iter()
        .filter(|entry| !is_made(entry))
        .map(|entry| entry.text.as_str())
        .collect();
    assert_eq!(
        otherwise,
        sites::MADE_OTHERWISE,
        "entries that no text of the source makes"
    );
    let silent: Vec<String> = found.silent.into_iter().collect();
    assert_eq!(
        silent,
        sites::HANDED_ON,
        "errors made without a text of their own"
    );
}

#[test]
fn the_document_is_the_catalogue() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("ERRORS.md");
    let text = document::markdown(&entries());
    if std::env::var_os("URLSPH_UPDATE_ERRORS").is_some() {
        std::fs::write(&path, &text).unwrap();
    }
    let written = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(
        written == text,
        "ERRORS.md is not what the catalogue says: run `URLSPH_UPDATE_ERRORS=1 cargo test --all-features --test errors`"
    );
}
