//! The body and its patches: the schema, and what it must satisfy.

use std::collections::BTreeMap;
use std::fmt;

use schemars::JsonSchema;
use serde::de::value::SeqAccessDeserializer;
use serde::{Deserialize, Deserializer, Serialize, de};

use super::numerics::Neighbours;
use super::validate::{ROUND_OFF, finite, key, listed, positive, require, valid_name};
use super::value;
use crate::error::{Code, Error, Result};

/// Memory of a simulation per particle [bytes], with 18 neighbours.
const BYTES_PER_PARTICLE: f64 = 1300.0;
/// What a pair beyond the usual ones takes while the lists are built [bytes].
const BYTES_PER_PAIR: f64 = 24.0;
/// Particles are numbered in 32 bits, with room for flags.
const MAX_PARTICLES: f64 = (1u64 << 31) as f64;

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
    /// Graded instead of even spacing, by axis; for a single box.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub grading: Option<AxisGrading>,
    /// Moves the particles inside the box off the lattice; for a single box.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub jitter: Option<Jitter>,
}

/// Graded spacing by axis; an axis without an entry is divided evenly.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct AxisGrading {
    /// Along X.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub x: Option<Grading>,
    /// Along Y.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub y: Option<Grading>,
    /// Along Z.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub z: Option<Grading>,
}

/// Graded spacing along an axis: a ratio, or the places of all particles.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum Grading {
    /// The last spacing over the first; between them the spacing grows geometrically.
    Ratio(#[schemars(extend("exclusiveMinimum" = 0))] f64),
    /// Where the particles are, as fractions of the length: increasing from 0 to 1. They replace the
    /// number that a spacing or a number of divisions asks for.
    Fractions(Vec<f64>),
}

/// Particles moved off their lattice, the same on every machine.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Jitter {
    /// Largest displacement along each axis, as a fraction of the spacing; below 0.5. Particles on the
    /// surface stay.
    #[schemars(extend("minimum" = 0, "exclusiveMaximum" = 0.5))]
    pub fraction: f64,
    /// Another seed, other displacements.
    #[serde(default)]
    pub seed: u32,
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

impl<'de> Deserialize<'de> for Grading {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> std::result::Result<Self, D::Error> {
        struct Visitor;
        impl<'de> de::Visitor<'de> for Visitor {
            type Value = Grading;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("the ratio of the last spacing to the first, or a list of fractions from 0 to 1")
            }
            value::visit_numbers!(Grading::Ratio);
            fn visit_seq<A: de::SeqAccess<'de>>(
                self,
                seq: A,
            ) -> std::result::Result<Grading, A::Error> {
                Deserialize::deserialize(SeqAccessDeserializer::new(seq)).map(Grading::Fractions)
            }
        }
        deserializer.deserialize_any(Visitor)
    }
}

impl Grading {
    /// Where the particles of `cells` divisions are, from 0 to 1; even without a grading.
    pub(crate) fn fractions(grading: Option<&Self>, cells: usize) -> Vec<f64> {
        let even = || (0..=cells).map(|i| i as f64 / cells as f64).collect();
        match grading {
            Some(Self::Fractions(fractions)) => fractions.clone(),
            Some(Self::Ratio(ratio)) if cells > 1 && *ratio != 1.0 => {
                // Spacings q^i with q^(cells - 1) = ratio, over their sum.
                let q = ratio.powf(1.0 / (cells - 1) as f64);
                let mut fractions: Vec<f64> = (0..=cells)
                    .map(|i| (q.powi(i as i32) - 1.0) / (q.powi(cells as i32) - 1.0))
                    .collect();
                fractions[cells] = 1.0;
                fractions
            }
            _ => even(),
        }
    }
    /// Number of divisions, given how many there are without a grading.
    pub(crate) fn cells(grading: Option<&Self>, cells: f64) -> f64 {
        match grading {
            Some(Self::Fractions(fractions)) => fractions.len() as f64 - 1.0,
            _ => cells,
        }
    }
}

impl AxisGrading {
    /// By axis.
    pub fn per_axis(&self) -> [Option<&Grading>; 3] {
        [self.x.as_ref(), self.y.as_ref(), self.z.as_ref()]
    }
}

impl BoxGeometry {
    /// Cells along an axis, as a number that may be too large for an integer.
    pub(crate) fn cells(&self, axis: usize) -> f64 {
        let even = ((self.max[axis] - self.min[axis]) / self.spacing.per_axis()[axis])
            .round()
            .max(1.0);
        Grading::cells(self.graded(axis), even)
    }
    /// Grading along an axis.
    pub(crate) fn graded(&self, axis: usize) -> Option<&Grading> {
        self.grading.as_ref().and_then(|g| g.per_axis()[axis])
    }
    /// Whether its particles form a lattice.
    pub(crate) fn is_lattice(&self) -> bool {
        self.grading.is_none() && self.jitter.is_none()
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

pub(super) fn validate(geometry: &Geometry) -> Result<()> {
    if let Geometry::Boxes(boxes) = geometry {
        require(
            !boxes.is_empty(),
            "geometry.boxes",
            "a body needs at least one box",
        )?;
    }
    for (name, b) in geometry.boxes() {
        let path = box_path(name);
        if let Some(name) = name {
            valid_name(&path, name)?;
        }
        box_shape(&path, b)?;
        for (set, what) in [
            (b.grading.is_some(), "grading"),
            (b.jitter.is_some(), "jitter"),
        ] {
            require(
                name.is_none() || !set,
                &format!("{path}.{what}"),
                "a union of boxes is one lattice: only a single box (geometry.box) takes this; \
                 for other shapes use a mesh",
            )?;
        }
    }
    Ok(())
}

fn grading(path: &str, grading: &Grading) -> Result<()> {
    match grading {
        Grading::Ratio(ratio) => {
            positive(path, *ratio)?;
            require(
                (1e-3..=1e3).contains(ratio),
                path,
                &format!("expected a ratio from 0.001 to 1000 instead of {ratio}"),
            )
        }
        Grading::Fractions(fractions) => {
            finite(path, fractions)?;
            require(
                fractions.len() >= 2
                    && fractions[0] == 0.0
                    && fractions[fractions.len() - 1] == 1.0,
                path,
                "expected fractions of the length that begin with 0 and end with 1",
            )?;
            match fractions.windows(2).position(|w| w[0] >= w[1]) {
                None => Ok(()),
                Some(i) => Err(Error::scene(
                    format!("{path}[{}]", i + 1),
                    format!(
                        "expected more than the fraction before, {}, instead of {}",
                        fractions[i],
                        fractions[i + 1]
                    ),
                )),
            }
        }
    }
}

fn box_path(name: Option<&str>) -> String {
    name.map_or("geometry.box".to_owned(), |name| {
        key("geometry.boxes", name)
    })
}

fn box_shape(path: &str, b: &BoxGeometry) -> Result<()> {
    if let Some(jitter) = &b.jitter {
        require(
            (0.0..0.5).contains(&jitter.fraction),
            &format!("{path}.jitter.fraction"),
            &format!(
                "expected 0 or more and less than 0.5 instead of {}: beyond it cells invert",
                jitter.fraction
            ),
        )?;
    }
    for axis in 0..3 {
        if let Some(g) = b.graded(axis) {
            grading(&format!("{path}.grading.{}", ["x", "y", "z"][axis]), g)?;
        }
    }
    lattice_box(path, b)
}

fn lattice_box(path: &str, b: &BoxGeometry) -> Result<()> {
    finite(&format!("{path}.min"), &b.min)?;
    finite(&format!("{path}.max"), &b.max)?;
    for axis in 0..3 {
        let edge = b.max[axis] - b.min[axis];
        require(
            edge.is_finite() && edge > 0.0,
            &format!("{path}.max[{axis}]"),
            &format!(
                "expected more than min[{axis}] = {} instead of {}",
                b.min[axis], b.max[axis]
            ),
        )?;
        let (place, h) = match b.spacing {
            Spacing::Uniform(h) => (format!("{path}.spacing"), h),
            Spacing::PerAxis(h) => (format!("{path}.spacing[{axis}]"), h[axis]),
        };
        positive(&place, h)?;
        require(
            h <= edge * (1.0 + ROUND_OFF),
            &place,
            &format!(
                "the spacing {h} is larger than the edge {edge} along {}; each edge needs at least one cell",
                ["x", "y", "z"][axis]
            ),
        )?;
    }
    Ok(())
}

pub(super) fn selection(path: &str, patch: &PatchSelection, faces: &[String]) -> Result<()> {
    require(
        !patch.faces.is_empty(),
        &format!("{path}.faces"),
        "a patch needs at least one face",
    )?;
    for (i, face) in patch.faces.iter().enumerate() {
        let place = format!("{path}.faces[{i}]");
        require(
            faces.contains(face),
            &place,
            &format!(
                "there is no face `{face}`; there are {}",
                listed(faces.iter())
            ),
        )?;
        require(
            !patch.faces[..i].contains(face),
            &place,
            &format!("the face `{face}` is listed twice"),
        )?;
    }
    finite(&format!("{path}.min"), &patch.min.unwrap_or_default())?;
    finite(&format!("{path}.max"), &patch.max.unwrap_or_default())?;
    if let (Some(min), Some(max)) = (patch.min, patch.max) {
        for axis in 0..3 {
            require(
                min[axis] <= max[axis],
                &format!("{path}.max[{axis}]"),
                &format!(
                    "expected at least min[{axis}] = {} instead of {}",
                    min[axis], max[axis]
                ),
            )?;
        }
    }
    Ok(())
}

/// Whether the particles fit into their numbers and into the memory [bytes], if that is known.
pub(super) fn capacity(
    geometry: &Geometry,
    neighbours: Neighbours,
    memory: Option<f64>,
) -> Result<()> {
    // In f64, as a tiny spacing overflows any integer.
    let counts = geometry.boxes().into_iter().map(|(name, b)| {
        let h = b.spacing.per_axis();
        let count: f64 = (0..3).map(|a| b.cells(a) + 1.0).product();
        let pairs = match neighbours {
            Neighbours::Lattice(_) => 0.0,
            Neighbours::Radius { radius } => {
                // Cells of a ball around a particle, as far as the box reaches.
                let reach = (radius + 1.0) * h.into_iter().fold(0.0, f64::max);
                let ball = 4.19 * reach.powi(3) / (h[0] * h[1] * h[2]);
                count * ball.min(count)
            }
        };
        (count, pairs, name)
    });
    let (mut total, mut bytes, mut most) = (0.0, 0.0, (0.0, None));
    for (count, pairs, name) in counts {
        total += count;
        bytes += count * BYTES_PER_PARTICLE + pairs * BYTES_PER_PAIR;
        if count > most.0 {
            most = (count, name);
        }
    }
    let amount = |x: f64, unit: f64, digits: usize| match x / unit {
        small if small < 1e12 => format!("{small:.digits$}"),
        large => format!("{large:.1e}"),
    };
    let error = |limit: String| {
        let place = box_path(most.1);
        Err(Error::new(
            Code::OutOfMemory,
            format!(
                "this spacing makes about {} particles, which with their neighbours need about {} GB; \
                 {limit}; choose a larger spacing or fewer neighbours",
                amount(total, 1.0, 0),
                amount(bytes, 1e9, 1)
            ),
        )
        .at_path(format!("{place}.spacing")))
    };
    if total > MAX_PARTICLES {
        return error(format!("at most {MAX_PARTICLES} particles are possible"));
    }
    match memory {
        Some(memory) if bytes > memory => {
            error(format!("{} GB are available", amount(memory, 1e9, 1)))
        }
        _ => Ok(()),
    }
}

/// Memory that a new allocation can count on [bytes], where the system tells.
pub(super) fn available_memory() -> Option<f64> {
    let text = std::fs::read_to_string("/proc/meminfo").ok()?;
    let line = text.lines().find_map(|l| l.strip_prefix("MemAvailable:"))?;
    let kib: f64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kib * 1024.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_particles_than_memory_are_refused() {
        let geometry = Geometry::Box(BoxGeometry {
            min: [0.0; 3],
            max: [1.0; 3],
            spacing: Spacing::Uniform(0.1),
            grading: None,
            jitter: None,
        });
        let need = 1331.0 * BYTES_PER_PARTICLE;
        capacity(&geometry, Neighbours::Lattice(18), None).unwrap();
        capacity(&geometry, Neighbours::Lattice(18), Some(need)).unwrap();
        let error = capacity(&geometry, Neighbours::Lattice(18), Some(need - 1.0)).unwrap_err();
        let wide = Neighbours::Radius { radius: 1e9 };
        capacity(&geometry, wide, Some(need)).unwrap_err();
        assert_eq!(error.code(), Code::OutOfMemory);
        assert_eq!(error.place().path.as_deref(), Some("geometry.box.spacing"));
        assert!(error.message().contains("1331 particles"), "{error}");
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn the_available_memory_is_known() {
        assert!(available_memory().unwrap() > 1e6);
    }
}
