//! A scene: JSON text in, a validated immutable [`Scene`] in SI units out.
//!
//! [`Scene::from_json`] parses, applies overrides and validates; every error names the JSON path.
//! The types here are the schema: `urlsph schema` prints them as a JSON Schema.

mod condition;
mod expression;
mod geometry;
mod heat;
mod material;
mod numerics;
mod parse;
mod preset;
mod schema;
mod tree;
mod validate;
mod value;

use std::collections::BTreeMap;
use std::io::Read;
use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use crate::particles::MeshFile;
pub use condition::{Condition, Convection, Initial, InitialGradient, Support, Wall};
pub use expression::Expression;
pub use geometry::{
    Axis, AxisGrading, BoxGeometry, CylinderGeometry, Geometry, Grading, Jitter, MeshGeometry,
    PatchSelection, PerforatedBox, Sector, Spacing,
};
pub use heat::Heat;
pub use material::{Elastic, JohnsonCook, Material, MooneyRivlin, VonMises};
pub use numerics::{
    Limiter, Neighbours, Numerics, Operators, Precision, Reconstruction, ReferenceUpdate,
    StateMeasures, Weights,
};
pub use preset::Preset;
pub use schema::json_schema;
pub use value::{Interpolation, Scalar, ScalarFunction, Table, Vector, VectorFunction};

use crate::error::{Code, Error, Result};

/// A whole scene. All values in SI units; positions in the initial configuration.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Scene {
    /// Name shown in pictures, summaries and the FMU.
    #[serde(default)]
    pub title: String,
    /// Cells larger or smaller than the geometry's: `fast`, `balanced` (the default), `accurate`. It is applied when the
    /// scene is read, which then has other cells and no preset.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub preset: Option<Preset>,
    /// The body.
    pub geometry: Geometry,
    /// The constitutive law of the body.
    pub material: Material,
    /// Heat; without it the body is isothermal.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub heat: Option<Heat>,
    /// Additional named patches; every named face of the geometry is a patch already.
    #[serde(default)]
    pub patches: BTreeMap<String, PatchSelection>,
    /// Conditions by patch name. A patch without an entry is free of traction.
    #[serde(default)]
    pub boundary: BTreeMap<String, Condition>,
    /// Rigid frictionless planes by name, which particles touch, slide along and leave.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub contact: BTreeMap<String, Wall>,
    /// Body force per unit initial volume f_R [N/m^3].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub body_force: Option<Vector>,
    /// Initial state.
    #[serde(default)]
    pub initial: Initial,
    /// Discretisation and time integration.
    #[serde(default)]
    pub numerics: Numerics,
    /// Named points whose motion is recorded (positions in the initial configuration [m]).
    #[serde(default)]
    pub probes: BTreeMap<String, [f64; 3]>,
    /// Duration of a run.
    pub time: Time,
    /// What a run writes.
    #[serde(default)]
    pub output: Output,
}

/// Duration of a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Time {
    /// End [s]; a run starts at 0.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub end: f64,
}

/// What a run writes.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Output {
    /// Interval of the history [s]; default: end / 200.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub history_interval: Option<f64>,
    /// Interval of the field files [s]; without it no fields are written.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub field_interval: Option<f64>,
    /// Interval of the snapshots from which a run can be continued [s], the last one in `restart.snapshot`;
    /// without it none are written.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub restart_interval: Option<f64>,
    /// Names of the fields; default: displacement, velocity, cauchy_stress, pressure, jacobian, and
    /// temperature and equivalent_plastic_strain where the scene has them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fields: Option<Vec<String>>,
}

/// Files by name, with their content.
pub type Files = Vec<(String, Vec<u8>)>;

impl Scene {
    /// Parses and validates a scene; `overrides` are `path=value` texts applied to the JSON first,
    /// such as `geometry.box.spacing=0.125` or `boundary.top.traction[1]=5e3`. A value is JSON, or a
    /// text that stands for itself. A key that contains dots is written `boundary["leg.y_max"]` if it
    /// is not in the JSON yet. Files that the scene names, such as a mesh, are read here, relative to the
    /// working directory.
    ///
    /// # Errors
    /// [`Code::Parse`] or [`Code::InvalidScene`], with the JSON path;
    /// [`Code::InvalidArgument`] for an override that has no place in the JSON;
    /// [`Code::Io`] for a mesh file that cannot be read;
    /// [`Code::OutOfMemory`] for more particles than this machine can hold.
    pub fn from_json(text: &str, overrides: &[String]) -> Result<Self> {
        Self::from_json_in(text, overrides, Path::new(""))
    }

    /// The same with files relative to a folder.
    ///
    /// # Errors
    /// As [`from_json`](Self::from_json).
    pub fn from_json_in(text: &str, overrides: &[String], folder: &Path) -> Result<Self> {
        let mut scene = parse::parse(text, overrides)?;
        scene
            .geometry
            .load(folder)
            .and_then(|()| scene.validate())
            .and_then(|()| scene.with_preset())
            .map_err(|e| parse::with_override(e, overrides))
    }

    /// The same scene with other overrides, and the files that this one has read: they may be gone.
    #[cfg(feature = "fmi")]
    pub(crate) fn again(&self, text: &str, overrides: &[String]) -> Result<Self> {
        let mut scene = parse::parse(text, overrides)?;
        scene.geometry.adopt(&self.geometry);
        scene
            .validate()
            .and_then(|()| scene.with_preset())
            .map_err(|e| parse::with_override(e, overrides))
    }

    /// Whether overrides of material, heat and numerics are admissible, each by itself: what they have
    /// to be together shows when the scene is read [`again`](Self::again).
    #[cfg(feature = "fmi")]
    pub(crate) fn admits(text: &str, overrides: &[String]) -> Result<()> {
        parse::parse(text, overrides)?
            .parameters()
            .map_err(|e| parse::with_override(e, overrides))
    }

    /// Reads, parses and validates a scene file; see [`from_json`](Self::from_json). Files that the
    /// scene names are relative to its folder.
    ///
    /// # Errors
    /// [`Code::Io`] if the file cannot be read, otherwise as [`from_json`](Self::from_json);
    /// the message names the file.
    pub fn from_file(path: impl AsRef<Path>, overrides: &[String]) -> Result<Self> {
        /// Far more than the parameters of any body; a device or a wrong file stops here.
        const MOST: u64 = 64 << 20;
        let path = path.as_ref();
        let failed = |why: &dyn std::fmt::Display| {
            let text = format!("the scene {} cannot be read: {why}", path.display());
            Error::new(Code::Io, text)
        };
        let mut text = String::new();
        let read = std::fs::File::open(path)
            .and_then(|file| file.take(MOST + 1).read_to_string(&mut text))
            .map_err(|e| failed(&e))?;
        if read as u64 > MOST {
            return Err(failed(&format_args!(
                "it is larger than {} MiB",
                MOST >> 20
            )));
        }
        let folder = path.parent().unwrap_or(Path::new(""));
        Self::from_json_in(&text, overrides, folder)
            .map_err(|e| e.with_note(&format!("in {}", path.display())))
    }

    /// The scene with the files that it names beside it, and those files by name with their content:
    /// what a folder needs to run it elsewhere.
    ///
    /// # Errors
    /// [`Code::Io`] for a file that cannot be read, or that has changed since the scene was made.
    pub fn packed(&self) -> Result<(Self, Files)> {
        let mut scene = self.clone();
        let files = scene.geometry.pack()?;
        Ok((scene, files))
    }

    /// The scene with the hash of each file's content in place of its path: equal for equal bodies,
    /// wherever their files are.
    pub(crate) fn of_content(&self) -> Self {
        let mut scene = self.clone();
        if let Geometry::Mesh(mesh) = &mut scene.geometry {
            mesh.file = format!("{:016x}", mesh.content_hash());
        }
        scene
    }
}
