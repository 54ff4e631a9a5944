//! What an entry of the catalogue holds: the text of an error, its cause, its remedy, and how it is brought about.

use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};

use urlsph::{Code, Error, Result, Scene, Simulation};

use crate::common::{BLOCK, try_simulation};

/// An error of the library, or a note that is added to errors.
pub struct Entry {
    /// `None` for a note.
    pub code: Option<Code>,
    /// What the error's place names, in words; a `?` marks what it names only where that is known.
    pub place: &'static str,
    /// The message; what stands in `<>` differs from case to case.
    pub text: String,
    /// What a placeholder of the message stands for, where that is one of few texts.
    pub variants: &'static [&'static str],
    pub cause: &'static str,
    pub remedy: &'static str,
    pub cases: Vec<Case>,
    /// Unit tests that bring it about with what is not public: file and name.
    pub units: Vec<(&'static str, &'static str)>,
    /// Why nothing brings it about.
    pub untested: Option<&'static str>,
}

/// A way to bring an error about.
pub struct Case {
    pub what: String,
    pub run: Box<dyn Fn() -> Outcome>,
    /// The path that the error must have.
    pub path: Option<&'static str>,
}

pub enum Outcome {
    Error(Error),
    /// What a person reads where the error itself does not get out: standard error, a log.
    Text(String),
}

/// An entry; `place` in words, such as `path particle position`.
pub fn entry(
    code: impl Into<Option<Code>>,
    place: &'static str,
    text: impl Into<String>,
    cause: &'static str,
    remedy: &'static str,
) -> Entry {
    Entry {
        code: code.into(),
        place,
        text: text.into(),
        variants: &[],
        cause,
        remedy,
        cases: Vec::new(),
        units: Vec::new(),
        untested: None,
    }
}

impl Entry {
    pub fn variants(mut self, variants: &'static [&'static str]) -> Self {
        self.variants = variants;
        self
    }

    fn case(
        mut self,
        what: String,
        path: Option<&'static str>,
        run: impl Fn() -> Outcome + 'static,
    ) -> Self {
        self.cases.push(Case {
            what,
            // What goes wrong on the way is a fault of this case alone.
            run: Box::new(move || {
                catch_unwind(AssertUnwindSafe(&run))
                    .unwrap_or_else(|_| Outcome::Text("the case itself fails".to_owned()))
            }),
            path,
        });
        self
    }

    /// The block of the tests with overrides, refused at a path.
    pub fn scene(self, overrides: &'static [&'static str], path: &'static str) -> Self {
        let path = Some(path).filter(|p| !p.is_empty());
        self.case(format!("{overrides:?}"), path, move || {
            failed(try_simulation(BLOCK, overrides))
        })
    }

    /// The text of a scene, refused at a path.
    pub fn json(self, text: &'static str, path: &'static str) -> Self {
        let path = Some(path).filter(|p| !p.is_empty());
        self.case(text.to_owned(), path, move || {
            failed(Scene::from_json(text, &[]))
        })
    }

    /// A body whose mesh file has this content.
    pub fn mesh(self, what: &str, content: impl AsRef<[u8]>) -> Self {
        let content = content.as_ref().to_vec();
        self.case(what.to_owned(), None, move || {
            let folder = tempfile::tempdir().unwrap();
            fs::write(folder.path().join("body.msh"), &content).unwrap();
            let text = r#"{"geometry": {"mesh": {"file": "body.msh"}},
                "material": {"neo_hookean": {"density": 1000, "youngs_modulus": 1e7, "poisson_ratio": 0.3}},
                "time": {"end": 1e-3}}"#;
            let scene = Scene::from_json_in(text, &[], folder.path());
            failed(scene.and_then(|scene| Simulation::with_threads(scene, 1)))
        })
    }

    /// Any call that fails.
    pub fn call<T: 'static>(self, what: &str, call: fn() -> Result<T>) -> Self {
        self.case(what.to_owned(), None, move || failed(call()))
    }

    /// A program that fails; what it says.
    pub fn says(self, what: &str, run: fn() -> String) -> Self {
        self.case(what.to_owned(), None, move || Outcome::Text(run()))
    }

    pub fn unit(mut self, file: &'static str, name: &'static str) -> Self {
        self.units.push((file, name));
        self
    }

    pub fn untested(mut self, why: &'static str) -> Self {
        self.untested = Some(why);
        self
    }
}

fn failed<T>(outcome: Result<T>) -> Outcome {
    match outcome {
        Ok(_) => Outcome::Text("no error at all".to_owned()),
        Err(error) => Outcome::Error(error),
    }
}

/// The fixed parts of a text with placeholders `<such as this>`.
pub fn parts(text: &str) -> Vec<&str> {
    let is_name = |name: &str| {
        !name.is_empty()
            && name.len() < 30
            && name.starts_with(|c: char| c.is_ascii_lowercase())
            && name.chars().all(|c| c.is_ascii_lowercase() || c == ' ')
    };
    let (mut parts, mut from, mut search) = (Vec::new(), 0, 0);
    while let Some(open) = text[search..].find('<').map(|i| search + i) {
        match text[open..].find('>').map(|i| open + i) {
            Some(close) if is_name(&text[open + 1..close]) => {
                parts.push(&text[from..open]);
                (from, search) = (close + 1, close + 1);
            }
            _ => search = open + 1,
        }
    }
    parts.push(&text[from..]);
    parts
}

/// Whether a message is one of a text with placeholders, perhaps with notes behind it.
pub fn is_of(text: &str, message: &str) -> bool {
    let parts = parts(text);
    let Some(mut rest) = message.strip_prefix(parts[0]) else {
        return false;
    };
    let Some((last, middle)) = parts[1..].split_last() else {
        return rest.is_empty() || rest.starts_with(" (");
    };
    for part in middle {
        let Some(at) = rest.find(part) else {
            return false;
        };
        rest = &rest[at + part.len()..];
    }
    let ends = |at: usize| {
        let behind = &rest[at + last.len()..];
        behind.is_empty() || behind.starts_with(" (")
    };
    rest.ends_with(last) || rest.match_indices(last).any(|(at, _)| ends(at))
}

/// Whether all fixed parts stand in a text in their order.
pub fn mentions(text: &str, message: &str) -> bool {
    let mut rest = message;
    parts(text).into_iter().all(|part| {
        let found = rest.find(part);
        rest = found.map_or("", |at| &rest[at + part.len()..]);
        found.is_some()
    })
}
