//! What the releases promised by name: variables of an FMU, and keys of a scene. The folders of `ffi-tests/abi` have what
//! each release had; `URLSPH_FREEZE=1`, which `cargo xtask abi --freeze` sets, writes that of the present version.
#![cfg(feature = "fmi")]
#![allow(missing_docs)]

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};
use serde_json::Value;
use urlsph::fmu::{self, FmiVersion};
use urlsph::{Scene, Simulation};

const RELEASES: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/ffi-tests/abi");

/// Sections of a model description that importers, and what users have made of them, rely on.
const SECTIONS: [&str; 4] = [
    "ModelVariables",
    "UnitDefinitions",
    "LogCategories",
    "CoSimulation",
];
/// What a release may change: importers look values up by name, and texts are for people.
const FREE: [&str; 3] = ["valueReference", "description", "start"];

fn releases() -> impl Iterator<Item = PathBuf> {
    let folders = fs::read_dir(RELEASES).unwrap();
    folders
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.is_dir())
}

/// Writes the lines of the present version if that is asked for.
fn freeze(file: &str, lines: &BTreeSet<String>) {
    if std::env::var_os("URLSPH_FREEZE").is_some() {
        let path = Path::new(RELEASES)
            .join(env!("CARGO_PKG_VERSION"))
            .join(file);
        let text: String = lines.iter().flat_map(|line| [line, "\n"]).collect();
        fs::write(path, text).unwrap();
    }
}

fn frozen(folder: &Path, file: &str) -> BTreeSet<String> {
    let text = fs::read_to_string(folder.join(file)).unwrap();
    text.lines().map(str::to_owned).collect()
}

/// Elements of the sections, each a line: its path and its attributes.
fn elements(xml: &str) -> BTreeSet<String> {
    let mut reader = Reader::from_str(xml);
    let (mut path, mut lines) = (Vec::new(), BTreeSet::new());
    let line = |path: &[String], element: &BytesStart| {
        let name = element.name().as_ref().to_owned();
        let mut attributes = Vec::new();
        let mut label = String::new();
        for attribute in element.attributes() {
            let attribute = attribute.unwrap();
            let key = attribute.key.as_ref().to_owned();
            let value = attribute.value.into_owned();
            if key == "name" {
                label = format!("[{value}]");
            } else if !FREE.contains(&key.as_str()) {
                attributes.push(format!(" {key}={value}"));
            }
        }
        attributes.sort();
        let step = format!("{name}{label}");
        let line = format!("{}/{step}{}", path.join("/"), attributes.concat());
        (step, line)
    };
    loop {
        match reader.read_event().unwrap() {
            Event::Start(element) => {
                let (step, text) = line(&path, &element);
                path.push(step);
                lines.insert(text);
            }
            Event::Empty(element) => {
                lines.insert(line(&path, &element).1);
            }
            Event::End(_) => drop(path.pop()),
            Event::Eof => break,
            _ => {}
        }
    }
    let is_kept = |line: &String| {
        SECTIONS.iter().any(|section| {
            line.split('/')
                .nth(1)
                .is_some_and(|s| s.starts_with(section))
        })
    };
    lines.into_iter().filter(is_kept).collect()
}

#[test]
fn variables_of_earlier_releases_are_there() {
    for (version, file) in [(FmiVersion::V2, "fmi2.txt"), (FmiVersion::V3, "fmi3.txt")] {
        for folder in releases() {
            let scene = Scene::from_file(folder.join("scene.json"), &[]).unwrap();
            let simulation = Simulation::with_threads(scene, 1).unwrap();
            let now = elements(&fmu::model_description(&simulation, version).unwrap());
            if folder.ends_with(env!("CARGO_PKG_VERSION")) {
                freeze(file, &now);
            }
            let then = frozen(&folder, file);
            let gone: Vec<_> = then.difference(&now).collect();
            println!("{}: {} of {}", folder.display(), then.len(), now.len());
            assert!(!then.is_empty() && gone.is_empty(), "{file}: {gone:#?}");
        }
    }
}

/// Keys, and words that stand for something, in a schema: an optional one as `+`, one that must be there as `!`.
fn keys(value: &Value, path: &str, lines: &mut BTreeSet<String>) {
    match value {
        Value::Object(object) => {
            let required = object.get("required").and_then(Value::as_array);
            if let Some(Value::Object(properties)) = object.get("properties") {
                for key in properties.keys() {
                    let must = required.is_some_and(|r| r.iter().any(|name| name == key));
                    lines.insert(format!("{} {path}.{key}", if must { "!" } else { "+" }));
                }
            }
            for (key, value) in object {
                match key.as_str() {
                    "properties" | "$defs" => {
                        let Value::Object(named) = value else {
                            continue;
                        };
                        named.iter().for_each(|(name, value)| {
                            keys(value, &format!("{path}.{name}"), lines)
                        });
                    }
                    "const" => drop(lines.insert(format!("+ {path}={value}"))),
                    "enum" => {
                        let words = value.as_array().into_iter().flatten();
                        lines.extend(words.map(|word| format!("+ {path}={word}")));
                    }
                    "description" | "default" | "required" | "title" => {}
                    _ => keys(value, path, lines),
                }
            }
        }
        Value::Array(values) => values.iter().for_each(|value| keys(value, path, lines)),
        _ => {}
    }
}

#[test]
fn scenes_of_earlier_releases_are_valid() {
    let mut now = BTreeSet::new();
    keys(&urlsph::scene::json_schema(), "", &mut now);
    freeze("scene.txt", &now);
    for folder in releases() {
        let then = frozen(&folder, "scene.txt");
        // What had to be there may be left out now, and not the other way round.
        let gone: Vec<_> = then
            .iter()
            .filter(|line| !now.contains(*line) && !now.contains(&line.replacen('!', "+", 1)))
            .collect();
        let objects: BTreeSet<&str> = then
            .iter()
            .filter_map(|line| Some(line.split_once(' ')?.1.rsplit_once('.')?.0))
            .collect();
        let new: Vec<_> = now
            .iter()
            .filter(|line| line.starts_with('!') && !then.contains(*line))
            .filter(|line| objects.contains(&line[2..line.rfind('.').unwrap()]))
            .collect();
        println!("{}: {} of {}", folder.display(), then.len(), now.len());
        assert!(!then.is_empty() && gone.is_empty(), "gone: {gone:#?}");
        assert!(new.is_empty(), "must be there now: {new:#?}");
    }
}
