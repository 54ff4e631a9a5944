//! JSON text and overrides to a typed scene; every error names the place.

use serde_json::{Map, Value};

use super::Scene;
use super::tree::{Node, Strict};
use crate::error::{Code, Error, Result};

/// Parses without checking the values.
pub(super) fn parse(text: &str, overrides: &[String]) -> Result<Scene> {
    let Strict(mut tree) = serde_json::from_str(text).map_err(|e| syntax_error(text, &e))?;
    for text in overrides {
        apply(&mut tree, text)?;
    }
    typed(&tree).map_err(|e| with_override(e, overrides))
}

fn syntax_error(text: &str, error: &serde_json::Error) -> Error {
    let line = text.lines().nth(error.line().saturating_sub(1));
    let near = line.and_then(|l| l.get(error.column().saturating_sub(1)..));
    let hint = if near.is_some_and(|n| n.starts_with("NaN") || n.starts_with("Inf")) {
        ": JSON has no NaN and no Infinity, numbers are finite"
    } else {
        ""
    };
    Error::new(
        Code::Parse,
        format!("the scene is not valid JSON: {error}{hint}"),
    )
}

/// Tree to types. The messages of serde are for programmers; the ones that leave here are not.
fn typed(tree: &Value) -> Result<Scene> {
    serde_path_to_error::deserialize(Node(tree)).map_err(|error| {
        let shape = Error::new(Code::Parse, plain(&error.inner().to_string()));
        match error.path().to_string() {
            root if root == "." => shape,
            path => shape.at_path(path),
        }
    })
}

/// A message of serde in words of JSON. The replaced words stand at the beginning and behind
/// "expected", so that nothing of the user's text is touched.
fn plain(message: &str) -> String {
    let (found, expected) = message.rsplit_once(", expected ").unwrap_or((message, ""));
    let mut text = found.to_owned();
    for (jargon, word) in [
        ("unknown field", "unknown key"),
        ("missing field", "missing key"),
        ("unknown variant", "unknown word"),
        ("invalid type: sequence", "invalid type: a list"),
        ("invalid type: map", "invalid type: an object"),
        ("invalid type: unit value", "invalid type: null"),
        ("invalid type: unit variant", "this word needs a value"),
    ] {
        if let Some(rest) = found.strip_prefix(jargon) {
            text = format!("{word}{rest}");
        }
    }
    if expected.is_empty() {
        return text;
    }
    let expected = match expected {
        "f64" => "a number",
        "u8" => "a whole number from 0 to 255",
        "u32" => "a whole number, 0 or more",
        "a boolean" => "true or false",
        "a string" => "a text",
        "a sequence" => "a list",
        "a map" => "an object",
        "unit" => "the word alone",
        "newtype variant" => "an object with the word as its key",
        "an array of length 3" | "3 elements in sequence" => "a list of 3",
        other => other,
    };
    format!("{text}, expected {expected}")
}

/// Steps of an override's path; no scene is nearly as deep.
const DEEPEST: usize = 32;

/// Applies `path=value` to the tree.
fn apply(tree: &mut Value, text: &str) -> Result<()> {
    let shown: String = text.chars().take(200).collect();
    let wrong = |message: String| Error::argument(format!("override `{shown}`: {message}"));
    let Some((path, value)) = text.split_once('=') else {
        return Err(wrong(
            "expected `path=value`, such as `geometry.box.spacing=0.125`".into(),
        ));
    };
    let path = path.trim();
    // A text that is not JSON stands for itself, so that a title or an expression needs no quotes.
    let value = match serde_json::from_str(value) {
        Ok(Strict(value)) => value,
        Err(_) => Value::String(value.trim().to_owned()),
    };
    let mut node = tree;
    let mut rest = path;
    let mut depth = 0;
    while !rest.is_empty() {
        // What a path creates is also taken apart step by step, on the stack.
        depth += 1;
        if depth > DEEPEST {
            return Err(wrong(format!("the path has more than {DEEPEST} steps")));
        }
        let done = &path[..path.len() - rest.len()];
        let (step, after) = step(node, done, rest).map_err(wrong)?;
        let place = if done.is_empty() { "the scene" } else { done };
        let kind = kind(node);
        node = match step {
            Step::Key(key) => {
                // What is not there yet is created; the types then know whether it may be there.
                if node.is_null() {
                    *node = Value::Object(Map::new());
                }
                match node {
                    Value::Object(object) => object.entry(key).or_insert(Value::Null),
                    _ => return Err(wrong(format!("{place} is {kind}, it has no key `{key}`"))),
                }
            }
            Step::Index(index) => match node {
                Value::Array(items) => {
                    let count = items.len();
                    items.get_mut(index).ok_or_else(|| {
                        wrong(format!(
                            "{place} has {count} elements, counted from 0: there is no [{index}]"
                        ))
                    })?
                }
                _ => {
                    return Err(wrong(format!(
                        "{place} is {kind}, it has no element [{index}]; set it as a whole: `{place}=[...]`"
                    )));
                }
            },
        };
        rest = after;
    }
    if path.is_empty() {
        return Err(wrong("the path is empty".into()));
    }
    *node = value;
    Ok(())
}

enum Step {
    Key(String),
    Index(usize),
}

/// The first step of `rest` and what follows it. A key that contains dots (`leg.y_max`) is found if
/// it is in the object already; otherwise it is written `["leg.y_max"]`.
fn step<'a>(
    node: &Value,
    done: &str,
    rest: &'a str,
) -> std::result::Result<(Step, &'a str), String> {
    if let Some(inner) = rest.strip_prefix("[\"") {
        let (key, after) = inner
            .split_once("\"]")
            .ok_or_else(|| format!("`{rest}` has no closing `\"]`"))?;
        return Ok((Step::Key(key.to_owned()), after));
    }
    if let Some(inner) = rest.strip_prefix('[') {
        let (index, after) = inner
            .split_once(']')
            .ok_or_else(|| format!("`{rest}` has no closing `]`"))?;
        let index = index
            .trim()
            .parse()
            .map_err(|_| format!("`[{index}]` is not an index such as `[0]`"))?;
        return Ok((Step::Index(index), after));
    }
    let rest = if done.is_empty() {
        rest
    } else {
        rest.strip_prefix('.')
            .ok_or_else(|| format!("expected `.` or `[` instead of `{rest}`"))?
    };
    let known = node.as_object().and_then(|object| {
        object
            .keys()
            .filter(|key| {
                rest.strip_prefix(key.as_str())
                    .is_some_and(|after| after.is_empty() || after.starts_with(['.', '[']))
            })
            .max_by_key(|key| key.len())
    });
    let length = known.map_or_else(
        || rest.find(['.', '[']).unwrap_or(rest.len()),
        |key| key.len(),
    );
    if length == 0 {
        return Err(format!("a name is missing after `{done}`"));
    }
    Ok((Step::Key(rest[..length].to_owned()), &rest[length..]))
}

fn kind(value: &Value) -> &'static str {
    match value {
        Value::Null => "not set",
        Value::Bool(_) => "true or false",
        Value::Number(_) => "a number",
        Value::String(_) => "a text",
        Value::Array(_) => "a list",
        Value::Object(_) => "an object",
    }
}

/// Names the override that an error comes from: one that set the place of the error or what
/// contains it, or one that set something below it and is named in the message.
pub(super) fn with_override(error: Error, overrides: &[String]) -> Error {
    let place = error.place().path.clone().unwrap_or_default();
    let at_or_below = |long: &str, short: &str| {
        long.strip_prefix(short)
            .is_some_and(|after| after.is_empty() || after.starts_with(['.', '[']))
    };
    let mentioned = |name: &str| error.message().contains(&format!("`{name}`"));
    let culprit = overrides.iter().rev().find(|text| {
        let path = text.split('=').next().unwrap_or_default().trim();
        let path = path.replace("[\"", ".").replace("\"]", "");
        let from_the_places_name = place.rfind('.').map_or(0, |dot| dot + 1);
        at_or_below(&place, &path)
            || (place.is_empty() || at_or_below(&path, &place))
                && path[from_the_places_name..]
                    .split(['.', '[', ']'])
                    .any(|name| !name.is_empty() && mentioned(name))
    });
    match culprit {
        Some(text) => error.with_note(&format!("see the override `{text}`")),
        None => error,
    }
}
