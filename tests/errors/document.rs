//! The catalogue as Markdown.

use std::fmt::Write as _;

use urlsph::Code;

use crate::catalogue::Entry;

const HEAD: &str = "# Errors

What goes wrong, why, and what to do: every error of the library, its FMUs and the command line. This file is written
by the tests from the catalogue in `tests/errors`, which bring each error about and read its text, but for the few that say so.

Every error has a code (`urlsph_status` in C, `urlsph.Error` and its kinds in Python, `urlsph::Code` in Rust), a text,
and, as far as they are known, the place: the JSON path in the scene, the boundary, the field, the particle, its
position and the time (`urlsph_error` in C). In the texts below, what stands in `<>` differs from case to case.
";

/// Number, name in C, and what it means.
const CODES: [(Code, &str, &str); 10] = [
    (
        Code::InvalidArgument,
        "URLSPH_INVALID_ARGUMENT",
        "A caller's argument is wrong.",
    ),
    (
        Code::Parse,
        "URLSPH_PARSE",
        "The scene or its mesh is not well formed.",
    ),
    (
        Code::InvalidScene,
        "URLSPH_INVALID_SCENE",
        "A value of the scene is not admissible.",
    ),
    (
        Code::Io,
        "URLSPH_IO",
        "A file could not be read or written.",
    ),
    (
        Code::OutOfMemory,
        "URLSPH_OUT_OF_MEMORY",
        "There is more asked for than the machine has.",
    ),
    (
        Code::Diverged,
        "URLSPH_DIVERGED",
        "The solution broke down; the state is that of the last good step.",
    ),
    (
        Code::Cancelled,
        "URLSPH_CANCELLED",
        "The caller ended the run; it can go on.",
    ),
    (
        Code::Snapshot,
        "URLSPH_SNAPSHOT",
        "A snapshot is damaged, or does not fit.",
    ),
    (
        Code::Busy,
        "URLSPH_BUSY",
        "The simulation is in use: another thread, or a callback, is in a call with the same handle. \
        The status is all there is; wait for that call to return and try again.",
    ),
    (Code::Internal, "URLSPH_INTERNAL", "A bug of the library."),
];

pub fn markdown(entries: &[Entry]) -> String {
    let mut text = HEAD.to_owned();
    for (code, name, meaning) in CODES {
        writeln!(text, "\n## {} {name}\n\n{meaning}", code as i32).unwrap();
        for entry in entries.iter().filter(|e| e.code == Some(code)) {
            write(&mut text, entry);
        }
    }
    text += "\n## Notes\n\nThey stand in parentheses behind the text of an error.\n";
    for entry in entries.iter().filter(|e| e.code.is_none()) {
        write(&mut text, entry);
    }
    text
}

fn write(text: &mut String, entry: &Entry) {
    writeln!(text, "\n{}\n", code(&entry.text)).unwrap();
    if !entry.variants.is_empty() {
        let all: Vec<String> = entry.variants.iter().map(|v| code(v)).collect();
        writeln!(text, "- Such as: {}", all.join(", ")).unwrap();
    }
    writeln!(text, "- Cause: {}", entry.cause).unwrap();
    writeln!(text, "- Remedy: {}", entry.remedy).unwrap();
    if !entry.place.is_empty() {
        let words: Vec<String> = entry
            .place
            .split_whitespace()
            .map(|word| match word.strip_suffix('?') {
                Some(word) => format!("{word} (where known)"),
                None => word.to_owned(),
            })
            .collect();
        writeln!(text, "- Names: {}", words.join(", ")).unwrap();
    }
    if let Some(why) = entry.untested {
        writeln!(text, "- No test brings it about: {why}").unwrap();
    }
}

/// A text as code, with backticks in it.
fn code(text: &str) -> String {
    if text.contains('`') {
        format!("`` {text} ``")
    } else {
        format!("`{text}`")
    }
}
