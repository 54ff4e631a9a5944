//! Errors: a stable code, a message that a person can act on, and the place. `ERRORS.md` lists all of them
//! with cause and remedy.

use std::fmt;

/// Result of every fallible call of this crate.
pub type Result<T> = std::result::Result<T, Error>;

/// Stable error codes: the same numbers in the C ABI (`urlsph_status`).
///
/// A code is never renumbered; new codes are added at the end.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[repr(i32)]
#[non_exhaustive]
pub enum Code {
    /// A caller's argument is wrong: NULL, NaN, a wrong length, an unknown name.
    InvalidArgument = 1,
    /// The scene is not valid JSON or does not have the shape of a scene.
    Parse = 2,
    /// The scene is well formed, but a value in it is not admissible.
    InvalidScene = 3,
    /// A file could not be read or written.
    Io = 4,
    /// The scene asks for more memory than there is.
    OutOfMemory = 5,
    /// The solution diverged: an inverted particle, or a value that is not finite.
    Diverged = 6,
    /// The caller cancelled the run.
    Cancelled = 7,
    /// A snapshot is truncated, damaged, or of another scene or version.
    Snapshot = 8,
    /// The object is used by another thread at this moment.
    Busy = 9,
    /// A bug of ours: the object is poisoned and can only be destroyed.
    Internal = 10,
}

/// Where an error arose. What is unknown is `None`.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Place {
    /// JSON path in the scene, such as `boundary.top.traction[1]`.
    pub path: Option<String>,
    /// Name of the boundary (patch).
    pub boundary: Option<String>,
    /// Name of the field.
    pub field: Option<String>,
    /// Particle, 0-based in the caller's order.
    pub particle: Option<usize>,
    /// Current position of that particle [m].
    pub position: Option<[f64; 3]>,
    /// Simulated time [s].
    pub time: Option<f64>,
}

/// An error: what is wrong, where, and what to do about it.
#[derive(Debug, Clone, PartialEq)]
pub struct Error {
    code: Code,
    message: String,
    place: Box<Place>,
}

impl Error {
    /// A new error; `message` says what is wrong and what the remedy is.
    pub fn new(code: Code, message: impl Into<String>) -> Self {
        Self {
            code,
            message: message.into(),
            place: Box::default(),
        }
    }
    /// [`Code::InvalidScene`] at a JSON path.
    pub fn scene(path: impl Into<String>, message: impl Into<String>) -> Self {
        Self::new(Code::InvalidScene, message).at_path(path)
    }
    /// [`Code::InvalidArgument`].
    pub fn argument(message: impl Into<String>) -> Self {
        Self::new(Code::InvalidArgument, message)
    }
    /// The stable code.
    pub fn code(&self) -> Code {
        self.code
    }
    /// The message without the place.
    pub fn message(&self) -> &str {
        &self.message
    }
    /// Where it arose.
    pub fn place(&self) -> &Place {
        &self.place
    }
    /// Adds a note in parentheses to the message.
    pub fn with_note(mut self, note: &str) -> Self {
        self.message = format!("{} ({note})", self.message);
        self
    }
    /// Adds the JSON path.
    pub fn at_path(mut self, path: impl Into<String>) -> Self {
        self.place.path = Some(path.into());
        self
    }
    /// Adds the boundary.
    pub fn at_boundary(mut self, name: impl Into<String>) -> Self {
        self.place.boundary = Some(name.into());
        self
    }
    /// Adds the field.
    pub fn at_field(mut self, name: impl Into<String>) -> Self {
        self.place.field = Some(name.into());
        self
    }
    /// Adds the particle and, if known, where it is now.
    pub fn at_particle(mut self, particle: usize, position: Option<[f64; 3]>) -> Self {
        self.place.particle = Some(particle);
        self.place.position = position;
        self
    }
    /// Adds the simulated time.
    pub fn at_time(mut self, time: f64) -> Self {
        self.place.time = Some(time);
        self
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let p = &self.place;
        if let Some(path) = &p.path {
            write!(f, "{path}: ")?;
        }
        f.write_str(&self.message)?;
        let mut separator = " [";
        let mut item = |f: &mut fmt::Formatter<'_>, text: String| {
            let r = write!(f, "{separator}{text}");
            separator = ", ";
            r
        };
        if let Some(name) = &p.boundary {
            item(f, format!("boundary {name}"))?;
        }
        if let Some(name) = &p.field {
            item(f, format!("field {name}"))?;
        }
        if let Some(i) = p.particle {
            item(f, format!("particle {i}"))?;
        }
        if let Some([x, y, z]) = p.position {
            item(f, format!("at ({x:.6}, {y:.6}, {z:.6}) m"))?;
        }
        if let Some(t) = p.time {
            item(f, format!("time {t:.6e} s"))?;
        }
        if separator == ", " {
            f.write_str("]")
        } else {
            Ok(())
        }
    }
}

impl std::error::Error for Error {}
