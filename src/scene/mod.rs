//! A scene: JSON text in, a validated immutable [`Scene`] in SI units out.
//!
//! [`Scene::from_json`] parses, applies overrides and validates; every error names the JSON path.
//! The types here are the schema: `urlsph schema` prints them as a JSON Schema.

mod expression;
mod parse;
mod schema;
mod tree;
mod validate;
mod value;

use std::collections::BTreeMap;
use std::fmt;
use std::io::Read;
use std::path::Path;

use schemars::JsonSchema;
use serde::de::value::{MapAccessDeserializer, SeqAccessDeserializer};
use serde::{Deserialize, Deserializer, Serialize, de};

pub use expression::Expression;
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
    /// The body.
    pub geometry: Geometry,
    /// The constitutive law of the body.
    pub material: Material,
    /// Additional named patches; every named face of the geometry is a patch already.
    #[serde(default)]
    pub patches: BTreeMap<String, PatchSelection>,
    /// Conditions by patch name. A patch without an entry is free of traction.
    #[serde(default)]
    pub boundary: BTreeMap<String, Condition>,
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

/// The body: one box, or a union of boxes on one rectilinear lattice.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub enum Geometry {
    /// One box; its faces are the patches `x_min`, `x_max`, `y_min`, `y_max`, `z_min`, `z_max`.
    Box(BoxGeometry),
    /// Named boxes that share faces; the exposed part of a face is the patch `<box>.x_min` and so on.
    Boxes(BTreeMap<String, BoxGeometry>),
}

/// An axis-parallel box with particles on a lattice that includes its boundary.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BoxGeometry {
    /// Lower corner [m].
    pub min: [f64; 3],
    /// Upper corner [m].
    pub max: [f64; 3],
    /// Particle spacing [m], one number or one per axis; it is adjusted to divide each edge evenly.
    pub spacing: Spacing,
}

/// One spacing for all axes, or one per axis [m].
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum Spacing {
    /// The same for all axes.
    Uniform(f64),
    /// One per axis.
    PerAxis([f64; 3]),
}

/// A named set of boundary particles: (part of) faces of the geometry.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PatchSelection {
    /// Names of the faces, such as `y_max` or `leg.y_max`.
    pub faces: Vec<String>,
    /// Keep only lattice cell faces whose centre lies in this region (lower corner [m]).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub min: Option<[f64; 3]>,
    /// Upper corner of that region [m].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max: Option<[f64; 3]>,
}

/// Conditions on one patch: at most one support, and any loads.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Condition {
    /// Homogeneous support.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub support: Option<Support>,
    /// Prescribed velocity [m/s]; a component that is `null` stays free.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub velocity: Option<Vector>,
    /// Dead traction per unit initial area [Pa].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub traction: Option<Vector>,
    /// Follower pressure per unit current area, positive in compression [Pa].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pressure: Option<Scalar>,
}

/// Homogeneous supports, by the normal of the patch in the initial configuration.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Support {
    /// No motion.
    Clamped,
    /// Tangential motion only (symmetry).
    Roller,
    /// Normal motion only.
    Antisymmetry,
}

/// The constitutive law.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub enum Material {
    /// W = mu/2 (J^(-2/3) F:F - 3) + kappa/2 (J - 1)^2.
    NeoHookean(NeoHookean),
    /// [URL22] eq. 5 with 2 zeta + 3 sqrt(3) xi = mu.
    MooneyRivlin(MooneyRivlin),
}

/// Parameters of the neo-Hookean law.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NeoHookean {
    /// Density in the initial configuration [kg/m^3].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub density: f64,
    /// Young's modulus of the linearised law [Pa].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub youngs_modulus: f64,
    /// Poisson's ratio of the linearised law, in (-1, 0.5).
    #[schemars(extend("exclusiveMinimum" = -1, "exclusiveMaximum" = 0.5))]
    pub poisson_ratio: f64,
}

/// Parameters of the Mooney-Rivlin law.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MooneyRivlin {
    /// Density in the initial configuration [kg/m^3].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub density: f64,
    /// Young's modulus of the linearised law [Pa].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub youngs_modulus: f64,
    /// Poisson's ratio of the linearised law, in (-1, 0.5).
    #[schemars(extend("exclusiveMinimum" = -1, "exclusiveMaximum" = 0.5))]
    pub poisson_ratio: f64,
    /// Share of the shear modulus carried by the H term: 3 sqrt(3) xi / mu, in [0, 1]. Default 0.5.
    #[serde(default = "half")]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub area_share: f64,
}

fn half() -> f64 {
    0.5
}

/// Initial state, by components in X, Y, Z [m] of the initial configuration.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Initial {
    /// Velocity [m/s].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub velocity: Option<Vector>,
    /// Displacement [m]; the deformation gradient follows from it by the discrete gradient.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub displacement: Option<Vector>,
}

/// Discretisation and time integration.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Numerics {
    /// Neighbours of a particle.
    pub neighbours: Neighbours,
    /// Weights inside the kernel gradient.
    pub weights: Weights,
    /// Smoothing factor f_h: h_b = f_h x largest distance to a neighbour ([URL22] 37).
    pub smoothing_factor: f64,
    /// How kernels follow an updated reference ([URL22] 49-52), 1 to 4.
    #[schemars(range(min = 1, max = 4))]
    pub kernel_option: u8,
    /// When the reference configuration is updated.
    pub reference_update: ReferenceUpdate,
    /// Which incremental deformation measures are independent unknowns.
    pub state: StateMeasures,
    /// Reconstruction of the velocity at the middle of a pair.
    pub reconstruction: Reconstruction,
    /// Limiter of the linear reconstruction.
    pub limiter: Limiter,
    /// Riemann dissipation of the momentum equation, D^p; `false` leaves it out.
    pub dissipation: bool,
    /// Coefficient of the dissipation D^j of the volume equation; needs `j` among the unknowns. 0 leaves it out.
    pub volume_dissipation: f64,
    /// Projection of the internal forces that conserves angular momentum ([URL22] section 6).
    pub angular_momentum_projection: bool,
    /// CFL number; default 0.6 with 6 neighbours, otherwise 0.9.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cfl: Option<f64>,
    /// Fixed time step [s] instead of the CFL condition.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time_step: Option<f64>,
}

impl Default for Numerics {
    fn default() -> Self {
        Self {
            neighbours: Neighbours::Lattice(18),
            weights: Weights::Unit,
            smoothing_factor: 0.6,
            kernel_option: 1,
            reference_update: ReferenceUpdate::Never,
            state: StateMeasures::F,
            reconstruction: Reconstruction::Linear,
            limiter: Limiter::None,
            dissipation: true,
            volume_dissipation: 0.0,
            angular_momentum_projection: false,
            cfl: None,
            time_step: None,
        }
    }
}

impl Numerics {
    /// The CFL number: the scene's, or the one that is proven stable for the largest number of
    /// neighbours of a particle.
    pub fn cfl_number(&self, neighbours: usize) -> f64 {
        self.cfl.unwrap_or(if neighbours <= 6 { 0.6 } else { 0.9 })
    }
}

/// 6, 18 or 26 lattice neighbours, or `{"radius": r}`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
#[serde(untagged, deny_unknown_fields)]
pub enum Neighbours {
    /// 6, 18 or 26 neighbours that share a lattice cell.
    Lattice(#[schemars(extend("enum" = [6, 18, 26]))] u8),
    /// All particles within a radius, in multiples of the largest lattice spacing.
    Radius {
        /// Radius over spacing.
        radius: f64,
    },
}

/// Weights inside the kernel gradient.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Weights {
    /// Every neighbour weighs the same: uniform stress gives no force inside the body.
    Unit,
    /// Tributary volumes, as printed in [URL22] 42.
    Tributary,
}

/// When the reference configuration is updated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum ReferenceUpdate {
    /// Never: total Lagrangian.
    Never,
    /// After every step: updated Lagrangian.
    EveryStep,
    /// After every n steps.
    Every(#[schemars(range(min = 1))] u32),
}

/// Which incremental deformation measures are independent unknowns.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum StateMeasures {
    /// f; h = cof f and j = det f.
    F,
    /// f and j; h = cof f.
    Fj,
    /// f, h and j.
    Fhj,
}

/// Reconstruction of the velocity at the middle of a pair.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Reconstruction {
    /// Piecewise constant: first order.
    None,
    /// Linear, with the corrected gradient: second order.
    Linear,
}

/// Limiter of the linear reconstruction.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Limiter {
    /// No limiter.
    None,
    /// Venkatakrishnan.
    Venkatakrishnan,
    /// Edge-wise minmod.
    Minmod,
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
    /// Names of the fields; default: displacement, velocity, cauchy_stress, pressure, jacobian.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fields: Option<Vec<String>>,
}

impl<'de> Deserialize<'de> for Spacing {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> std::result::Result<Self, D::Error> {
        struct Visitor;
        impl<'de> de::Visitor<'de> for Visitor {
            type Value = Spacing;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a number, or a list of three numbers, one per axis")
            }
            value::visit_numbers!(Spacing::Uniform);
            fn visit_seq<A: de::SeqAccess<'de>>(
                self,
                seq: A,
            ) -> std::result::Result<Spacing, A::Error> {
                Deserialize::deserialize(SeqAccessDeserializer::new(seq)).map(Spacing::PerAxis)
            }
        }
        deserializer.deserialize_any(Visitor)
    }
}

impl<'de> Deserialize<'de> for Neighbours {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> std::result::Result<Self, D::Error> {
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct Radius {
            radius: f64,
        }
        struct Visitor;
        impl<'de> de::Visitor<'de> for Visitor {
            type Value = Neighbours;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(r#"6, 18, 26 or {"radius": r}"#)
            }
            fn visit_u64<E: de::Error>(self, v: u64) -> std::result::Result<Neighbours, E> {
                u8::try_from(v)
                    .map(Neighbours::Lattice)
                    .map_err(|_| E::invalid_value(de::Unexpected::Unsigned(v), &self))
            }
            fn visit_map<A: de::MapAccess<'de>>(
                self,
                map: A,
            ) -> std::result::Result<Neighbours, A::Error> {
                let Radius { radius } = Radius::deserialize(MapAccessDeserializer::new(map))?;
                Ok(Neighbours::Radius { radius })
            }
        }
        deserializer.deserialize_any(Visitor)
    }
}

impl Spacing {
    /// One spacing per axis [m].
    pub fn per_axis(self) -> [f64; 3] {
        match self {
            Spacing::Uniform(h) => [h; 3],
            Spacing::PerAxis(h) => h,
        }
    }
}

impl Geometry {
    /// The boxes, by name; a single box has none.
    pub fn boxes(&self) -> Vec<(Option<&str>, &BoxGeometry)> {
        match self {
            Geometry::Box(only) => vec![(None, only)],
            Geometry::Boxes(boxes) => boxes.iter().map(|(n, b)| (Some(n.as_str()), b)).collect(),
        }
    }

    /// Names of the faces, box by box: each is a patch.
    pub fn faces(&self) -> Vec<String> {
        self.boxes()
            .into_iter()
            .flat_map(|(name, _)| {
                ["x_min", "x_max", "y_min", "y_max", "z_min", "z_max"].map(|face| match name {
                    Some(name) => format!("{name}.{face}"),
                    None => face.to_owned(),
                })
            })
            .collect()
    }
}

impl Scene {
    /// Parses and validates a scene; `overrides` are `path=value` texts applied to the JSON first,
    /// such as `geometry.box.spacing=0.125` or `boundary.top.traction[1]=5e3`. A value is JSON, or a
    /// text that stands for itself. A key that contains dots is written `boundary["leg.y_max"]` if it
    /// is not in the JSON yet.
    ///
    /// # Errors
    /// [`Code::Parse`] or [`Code::InvalidScene`], with the JSON path;
    /// [`Code::InvalidArgument`] for an override that has no place in the JSON;
    /// [`Code::OutOfMemory`] for more particles than this machine can hold.
    pub fn from_json(text: &str, overrides: &[String]) -> Result<Self> {
        let scene = parse::parse(text, overrides)?;
        scene
            .validate()
            .map_err(|e| parse::with_override(e, overrides))?;
        Ok(scene)
    }

    /// Reads, parses and validates a scene file; see [`from_json`](Self::from_json).
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
        Self::from_json(&text, overrides)
            .map_err(|e| e.with_note(&format!("in {}", path.display())))
    }
}
