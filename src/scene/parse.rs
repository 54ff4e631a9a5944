//! JSON text and overrides to a typed scene; every error names the place.

use std::fmt;

use serde::de::{self, Deserialize, Deserializer};
use serde_json::{Map, Number, Value};
use serde_path_to_error::Segment;

use super::Scene;
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
    let near = line.map_or("", |l| {
        let start = error.column().saturating_sub(2).min(l.len());
        l.get(start..).unwrap_or("")
    });
    let hint = if ["NaN", "Inf", "aN", "nf"]
        .iter()
        .any(|n| near.starts_with(n))
    {
        ": numbers are finite, JSON has no NaN and no Infinity"
    } else {
        ""
    };
    Error::new(
        Code::Parse,
        format!("the scene is not valid JSON: {error}{hint}"),
    )
}

/// A JSON tree without duplicate keys, which `serde_json::Value` would drop silently.
struct Strict(Value);

impl<'de> Deserialize<'de> for Strict {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> std::result::Result<Self, D::Error> {
        struct Visitor;
        impl<'de> de::Visitor<'de> for Visitor {
            type Value = Strict;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a JSON value")
            }
            fn visit_bool<E>(self, v: bool) -> std::result::Result<Strict, E> {
                Ok(Strict(Value::Bool(v)))
            }
            fn visit_i64<E>(self, v: i64) -> std::result::Result<Strict, E> {
                Ok(Strict(v.into()))
            }
            fn visit_u64<E>(self, v: u64) -> std::result::Result<Strict, E> {
                Ok(Strict(v.into()))
            }
            fn visit_f64<E: de::Error>(self, v: f64) -> std::result::Result<Strict, E> {
                match Number::from_f64(v) {
                    Some(number) => Ok(Strict(Value::Number(number))),
                    None => Err(E::custom("a number is not finite")),
                }
            }
            fn visit_str<E>(self, v: &str) -> std::result::Result<Strict, E> {
                Ok(Strict(v.into()))
            }
            fn visit_unit<E>(self) -> std::result::Result<Strict, E> {
                Ok(Strict(Value::Null))
            }
            fn visit_seq<A: de::SeqAccess<'de>>(
                self,
                mut seq: A,
            ) -> std::result::Result<Strict, A::Error> {
                let mut items = Vec::new();
                while let Some(Strict(item)) = seq.next_element()? {
                    items.push(item);
                }
                Ok(Strict(Value::Array(items)))
            }
            fn visit_map<A: de::MapAccess<'de>>(
                self,
                mut map: A,
            ) -> std::result::Result<Strict, A::Error> {
                let mut object = Map::new();
                while let Some(key) = map.next_key::<String>()? {
                    if object.contains_key(&key) {
                        return Err(de::Error::custom(format!("duplicate key `{key}`")));
                    }
                    let Strict(value) = map.next_value()?;
                    object.insert(key, value);
                }
                Ok(Strict(Value::Object(object)))
            }
        }
        deserializer.deserialize_any(Visitor)
    }
}

/// Tree to types. The messages of serde are for programmers; the ones that leave here are not.
fn typed(tree: &Value) -> Result<Scene> {
    serde_path_to_error::deserialize(tree).map_err(|error| {
        let mut message = error.inner().to_string();
        for jargon in ["string or map", "map with a single key"] {
            if let (true, Some(words)) = (message.contains(jargon), words(tree, error.path())) {
                message = message.replace(jargon, &words);
            }
        }
        for (jargon, plain) in [
            ("expected f64", "expected a number"),
            ("expected u8", "expected a whole number from 0 to 255"),
            ("expected u32", "expected a whole number, 0 or more"),
            ("expected a boolean", "expected true or false"),
            ("expected a sequence", "expected a list"),
            ("expected an array of length", "expected a list of length"),
        ] {
            message = message.replace(jargon, plain);
        }
        let error_of_shape = Error::new(Code::Parse, message);
        match error.path().to_string() {
            root if root == "." => error_of_shape,
            path => error_of_shape.at_path(path),
        }
    })
}

/// The words or keys that are allowed at a place: what the parser expects instead of a wrong word.
fn words(tree: &Value, path: &serde_path_to_error::Path) -> Option<String> {
    let mut probe = tree.clone();
    let place = path
        .iter()
        .try_fold(&mut probe, |node, segment| match segment {
            Segment::Seq { index } => node.get_mut(index),
            Segment::Map { key } => node.get_mut(key),
            Segment::Enum { variant } => node.get_mut(variant),
            Segment::Unknown => None,
        })?;
    *place = Value::String(String::new());
    let error = Scene::deserialize(&probe).err()?.to_string();
    let (_, expected) = error.split_once("unknown variant ``, expected ")?;
    Some(
        if expected.contains("one of ") || expected.contains(" or ") {
            expected.to_owned()
        } else {
            format!("one of {expected}")
        },
    )
}

/// Applies `path=value` to the tree.
fn apply(tree: &mut Value, text: &str) -> Result<()> {
    let wrong = |message: String| Error::argument(format!("override `{text}`: {message}"));
    let Some((path, value)) = text.split_once('=') else {
        return Err(wrong(
            "expected `path=value`, such as `geometry.box.spacing=0.125`".into(),
        ));
    };
    let path = path.trim();
    // A text that is not JSON stands for itself, so that a title or an expression needs no quotes.
    let value = match serde_json::from_str(value) {
        Ok(Strict(value)) => value,
        Err(_) => Value::String(value.to_owned()),
    };
    let mut node = tree;
    let mut rest = path;
    while !rest.is_empty() {
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

/// Names the override that an error may come from: one that set the place of the error, or
/// something below it that the message names.
pub(super) fn with_override(error: Error, overrides: &[String]) -> Error {
    let place = error.place().path.clone().unwrap_or_default();
    let below = |long: &str, short: &str| {
        long.strip_prefix(short)
            .is_some_and(|after| after.is_empty() || after.starts_with(['.', '[']))
    };
    let culprit = overrides.iter().rev().find(|text| {
        let path = text.split('=').next().unwrap_or_default().trim();
        below(&place, path)
            || (place.is_empty() || below(path, &place))
                && path[place.len()..]
                    .split(['.', '[', ']', '"'])
                    .any(|name| !name.is_empty() && error.message().contains(&format!("`{name}`")))
    });
    match culprit {
        Some(text) => error.with_note(&format!("see the override `{text}`")),
        None => error,
    }
}
