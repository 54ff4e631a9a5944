//! The body and its patches: the schema, and what it must satisfy.

use std::collections::BTreeMap;
use std::fmt;
use std::io::Read;
use std::path::Path;
use std::sync::Arc;

use schemars::JsonSchema;
use serde::de::value::SeqAccessDeserializer;
use serde::{Deserialize, Deserializer, Serialize, de};
use xxhash_rust::xxh3::xxh3_64;

use super::Scene;
use super::numerics::Neighbours;
use super::validate::{ROUND_OFF, finite, key, listed, positive, require, valid_name};
use super::value;
use crate::error::{Code, Error, Result};
use crate::particles::MeshFile;
use crate::plan::bytes_per_particle;

/// What a particle takes beside [`bytes_per_particle`] while a body is set up [bytes], on a lattice and
/// elsewhere; measured.
const SETUP_BYTES_PER_PARTICLE: (f64, f64) = (100.0, 420.0);
/// What a pair takes while the lists are built [bytes].
const SETUP_BYTES_PER_PAIR: f64 = 4.0;
/// Particles are numbered in 32 bits, with room for flags.
const MAX_PARTICLES: f64 = (1u64 << 31) as f64;

/// The body: boxes on a lattice, a structured body of hexahedra, or a mesh from a file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub enum Geometry {
    /// One box; its faces are the patches `x_min`, `x_max`, `y_min`, `y_max`, `z_min`, `z_max`.
    Box(BoxGeometry),
    /// Named boxes that share faces; the exposed part of a face is the patch `<box>.x_min` and so on.
    Boxes(BTreeMap<String, BoxGeometry>),
    /// A cylinder or a sector of one; its faces are the patches `bottom`, `top`, `side` and, of a
    /// sector, `start` (the plane of angle 0) and `end`.
    Cylinder(CylinderGeometry),
    /// A box with round through-holes; its faces are the patches `x_min` ... `z_max` and `holes`.
    PerforatedBox(PerforatedBox),
    /// A mesh of tetrahedra, hexahedra and prisms from a file; its named surfaces are the patches.
    Mesh(MeshGeometry),
}

/// A cylinder of hexahedra: in the section a square core inside rings.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CylinderGeometry {
    /// Centre of the bottom [m].
    #[serde(default)]
    pub base: [f64; 3],
    /// Direction from the bottom to the top.
    #[serde(default)]
    pub axis: Axis,
    /// Radius [m].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub radius: f64,
    /// Length along the axis [m].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub length: f64,
    /// The whole cylinder or a part of it. Angles count from the axis after `axis` (X for Z) to the
    /// one after that.
    #[serde(default)]
    pub sector: Sector,
    /// Cells across the core and across the rings, n: a quarter has 3 n^2 + 3 n + 1 particles in each
    /// section. In a wedge, cells along the radius.
    #[schemars(range(min = 1))]
    pub divisions: u32,
    /// Cells along the axis.
    #[schemars(range(min = 1))]
    pub layers: u32,
    /// Graded spacing along the axis, from the bottom to the top.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub grading: Option<Grading>,
    /// Graded width of the rings, outwards; in a wedge from the axis. Wide cells at the axis of a thin
    /// wedge allow longer time steps.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub radial_grading: Option<Grading>,
    /// Radius along the axis: [fraction of the length, factor on the radius], linear between; begins
    /// at 0 and ends at 1.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub taper: Vec<[f64; 2]>,
}

/// A mesh from a file of Gmsh (`.msh`, version 2.2 or 4.1, text or binary): the nodes are the
/// particles, and physical surfaces the patches; without any the whole surface is the patch `surface`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MeshGeometry {
    /// Path of the file, relative to the scene's file, or to the working directory for a scene without
    /// a file.
    pub file: String,
    /// Metres per unit of the file, such as 1e-3 for millimetres.
    #[serde(default = "one")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub scale: f64,
    #[serde(skip)]
    content: Option<Content>,
}

/// What was read from a mesh file. Equal content has equal hashes.
#[derive(Clone)]
struct Content {
    hash: u64,
    mesh: Arc<MeshFile>,
}

impl PartialEq for Content {
    fn eq(&self, other: &Self) -> bool {
        self.hash == other.hash
    }
}

impl fmt::Debug for Content {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Content({:016x})", self.hash)
    }
}

fn one() -> f64 {
    1.0
}

/// A coordinate axis.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Axis {
    /// X.
    X,
    /// Y.
    Y,
    /// Z.
    #[default]
    Z,
}

/// A part of a cylinder.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Sector {
    /// All of it.
    #[default]
    Full,
    /// 0 to 180 degrees.
    Half,
    /// 0 to 90 degrees.
    Quarter,
    /// 0 to an angle below 180 degrees, of prisms around the axis.
    Wedge(#[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 180))] f64),
}

/// A box with a grid of round through-holes, each in the middle of its tile.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PerforatedBox {
    /// Lower corner [m].
    pub min: [f64; 3],
    /// Upper corner [m].
    pub max: [f64; 3],
    /// Direction of the holes.
    #[serde(default)]
    pub along: Axis,
    /// Tiles along the two axes after `along` (X and Y for Z).
    pub tiles: [u32; 2],
    /// Diameter of the holes [m].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub diameter: f64,
    /// Tiles without a hole, counted from 0.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub solid: Vec<[u32; 2]>,
    /// Cells along each edge of a tile, and around a quarter of a hole.
    #[schemars(range(min = 1))]
    pub divisions: u32,
    /// Cells from a hole to the edge of its tile.
    #[schemars(range(min = 1))]
    pub rings: u32,
    /// Cells along the holes.
    #[schemars(range(min = 1))]
    pub layers: u32,
    /// Graded spacing along the holes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub grading: Option<Grading>,
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

impl Axis {
    /// The two axes across, and the axis: a right-handed triple.
    pub fn directions(self) -> [usize; 3] {
        match self {
            Axis::X => [1, 2, 0],
            Axis::Y => [2, 0, 1],
            Axis::Z => [0, 1, 2],
        }
    }
}

impl MeshGeometry {
    /// A mesh file that is yet to be [loaded](Self::load).
    pub fn new(file: impl Into<String>, scale: f64) -> Self {
        Self {
            file: file.into(),
            scale,
            content: None,
        }
    }

    /// Reads the file, relative to a folder; afterwards `file` is the whole path.
    ///
    /// # Errors
    /// [`Code::Io`] if it cannot be read, [`Code::Parse`] with the line and the element if it is not a
    /// mesh that a body can be made of, [`Code::InvalidScene`] for a bad scale.
    pub fn load(&mut self, folder: &Path) -> Result<()> {
        const PATH: &str = "geometry.mesh.file";
        positive("geometry.mesh.scale", self.scale)?;
        let path = folder.join(&self.file);
        // The whole path, so that the scene means the same file wherever it is written to.
        let path = std::path::absolute(&path).unwrap_or(path);
        let bytes = read_file(&path).map_err(|e| e.at_path(PATH))?;
        let mesh = MeshFile::read(&bytes, self.scale)
            .map_err(|e| e.with_note(&format!("in {}", path.display())).at_path(PATH))?;
        self.file = path.to_string_lossy().into_owned();
        self.content = Some(Content {
            hash: xxh3_64(&bytes),
            mesh: Arc::new(mesh),
        });
        Ok(())
    }

    fn pack(&mut self) -> Result<(String, Vec<u8>)> {
        const NAME: &str = "mesh.msh";
        let bytes =
            read_file(Path::new(&self.file)).map_err(|e| e.at_path("geometry.mesh.file"))?;
        if xxh3_64(&bytes) != self.content_hash() {
            return Err(Error::new(
                Code::Io,
                format!(
                    "the mesh {} has changed since it was read: read the scene again",
                    self.file
                ),
            )
            .at_path("geometry.mesh.file"));
        }
        self.file = NAME.to_owned();
        Ok((NAME.to_owned(), bytes))
    }

    /// What the file holds.
    ///
    /// # Errors
    /// [`Code::InvalidScene`] if it was not loaded.
    pub fn content(&self) -> Result<&MeshFile> {
        match &self.content {
            Some(content) => Ok(&content.mesh),
            None => Err(Error::scene(
                "geometry.mesh",
                "the file is not loaded: a mesh that is put into a scene in code needs `load` first",
            )),
        }
    }

    /// Hash of the file's content; 0 before it is loaded.
    pub fn content_hash(&self) -> u64 {
        self.content.as_ref().map_or(0, |c| c.hash)
    }
}

/// Reads a file that is not too large to be a mesh.
fn read_file(path: &Path) -> Result<Vec<u8>> {
    /// About 2e7 nodes as text; a device or a wrong file stops here.
    const MOST: u64 = 4 << 30;
    let failed = |why: &dyn fmt::Display| {
        let text = format!("the mesh {} cannot be read: {why}", path.display());
        Error::new(Code::Io, text)
    };
    let mut bytes = Vec::new();
    let about = std::fs::metadata(path).map_err(|e| failed(&e))?;
    // Others have no end, or wait for somebody to write.
    if !about.is_file() {
        let what = if about.is_dir() {
            "a folder"
        } else {
            "a device or a pipe"
        };
        return Err(failed(&format_args!("it is {what}")));
    }
    let too_large = || failed(&"it is larger than 4 GiB");
    if about.len() > MOST {
        return Err(too_large());
    }
    let file = std::fs::File::open(path).map_err(|e| failed(&e))?;
    // It may grow meanwhile.
    file.take(MOST + 1)
        .read_to_end(&mut bytes)
        .map_err(|e| failed(&e))?;
    if bytes.len() as u64 > MOST {
        return Err(too_large());
    }
    Ok(bytes)
}

impl CylinderGeometry {
    /// Names of the faces that it has.
    pub fn faces(&self) -> Vec<String> {
        let all: &[&str] = match self.sector {
            Sector::Full => &["bottom", "top", "side"],
            _ => &["bottom", "top", "side", "start", "end"],
        };
        all.iter().map(|f| (*f).to_owned()).collect()
    }
    /// The taper at a fraction of the length.
    pub(crate) fn radius_factor(&self, s: f64) -> f64 {
        let after = self.taper.partition_point(|[at, _]| *at < s);
        match (self.taper.get(after.wrapping_sub(1)), self.taper.get(after)) {
            (Some([p, f]), Some([q, g])) => f + (s - p) / (q - p) * (g - f),
            (None, Some([_, f])) | (Some([_, f]), None) => *f,
            (None, None) => 1.0,
        }
    }
    /// About how many particles it has; exact but for a wedge.
    fn particles(&self) -> f64 {
        let n = f64::from(self.divisions);
        let section = match self.sector {
            Sector::Full => 12.0 * n * n + 4.0 * n + 1.0,
            Sector::Half => 6.0 * n * n + 4.0 * n + 1.0,
            Sector::Quarter => 3.0 * n * n + 3.0 * n + 1.0,
            Sector::Wedge(angle) => 1.0 + 2.0 * n + 0.5 * n * n * angle.to_radians(),
        };
        section * (Grading::cells(self.grading.as_ref(), f64::from(self.layers)) + 1.0)
    }
}

impl PerforatedBox {
    /// Names of the faces across the holes and of the holes.
    pub(crate) fn side_names(&self) -> Vec<String> {
        let [u, v, _] = self.along.directions();
        let mut names = Vec::new();
        for axis in [u, v] {
            names.extend(axis_faces(axis));
        }
        names.push("holes".to_owned());
        names
    }
    /// Names of the faces that the holes go through.
    pub(crate) fn end_names(&self) -> [String; 2] {
        axis_faces(self.along.directions()[2])
    }
    /// Names of the faces that it has.
    pub fn faces(&self) -> Vec<String> {
        let mut faces: Vec<String> = (0..3).flat_map(axis_faces).collect();
        if self.holes() > 0.0 {
            faces.push("holes".to_owned());
        }
        faces
    }
    fn holes(&self) -> f64 {
        f64::from(self.tiles[0]) * f64::from(self.tiles[1]) - self.solid.len() as f64
    }
    fn particles(&self) -> f64 {
        let (k, rings) = (f64::from(self.divisions), f64::from(self.rings));
        let [p, q] = self.tiles.map(f64::from);
        let lines = (p + 1.0) * (q * k + 1.0) + (q + 1.0) * (p * k + 1.0) - (p + 1.0) * (q + 1.0);
        let solid = self.solid.len() as f64 * (k - 1.0) * (k - 1.0);
        let section = lines + self.holes() * 4.0 * k * rings + solid;
        section * (Grading::cells(self.grading.as_ref(), f64::from(self.layers)) + 1.0)
    }
}

/// Names of the lower and the upper face across an axis.
fn axis_faces(axis: usize) -> [String; 2] {
    ["min", "max"].map(|side| format!("{}_{side}", ["x", "y", "z"][axis]))
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
    /// The boxes, by name; a single box has none, and what is no box has no boxes.
    pub fn boxes(&self) -> Vec<(Option<&str>, &BoxGeometry)> {
        match self {
            Geometry::Box(only) => vec![(None, only)],
            Geometry::Boxes(boxes) => boxes.iter().map(|(n, b)| (Some(n.as_str()), b)).collect(),
            _ => Vec::new(),
        }
    }

    /// Whether the particles form a lattice; otherwise they are the nodes of a mesh.
    pub(crate) fn is_lattice(&self) -> bool {
        match self {
            Geometry::Box(b) => b.is_lattice(),
            Geometry::Boxes(_) => true,
            _ => false,
        }
    }

    /// Names of the faces: each is a patch.
    pub fn faces(&self) -> Vec<String> {
        let all = || (0..3).flat_map(axis_faces);
        match self {
            Geometry::Box(_) => all().collect(),
            Geometry::Boxes(boxes) => boxes
                .keys()
                .flat_map(|name| all().map(move |face| format!("{name}.{face}")))
                .collect(),
            Geometry::Cylinder(cylinder) => cylinder.faces(),
            Geometry::PerforatedBox(perforated) => perforated.faces(),
            Geometry::Mesh(mesh) => mesh.content().map_or(Vec::new(), |m| m.names().to_vec()),
        }
    }

    /// Names the files that the geometry keeps without a folder, and returns them with their content.
    pub(super) fn pack(&mut self) -> Result<Vec<(String, Vec<u8>)>> {
        match self {
            Geometry::Mesh(mesh) => mesh.pack().map(|file| vec![file]),
            _ => Ok(Vec::new()),
        }
    }

    /// Takes over what the same geometry has read from its files.
    #[cfg(feature = "fmi")]
    pub(super) fn adopt(&mut self, read: &Self) {
        if let (Geometry::Mesh(_), Geometry::Mesh(_)) = (&*self, read) {
            self.clone_from(read);
        }
    }

    /// Reads what the geometry keeps in files, relative to a folder.
    pub(super) fn load(&mut self, folder: &Path) -> Result<()> {
        match self {
            Geometry::Mesh(mesh) => mesh.load(folder),
            _ => Ok(()),
        }
    }
}

pub(super) fn validate(geometry: &Geometry) -> Result<()> {
    match geometry {
        Geometry::Box(_) => {}
        Geometry::Boxes(boxes) => require(
            !boxes.is_empty(),
            "geometry.boxes",
            "a body needs at least one box",
        )?,
        Geometry::Cylinder(c) => cylinder(c)?,
        Geometry::PerforatedBox(b) => perforated_box(b)?,
        Geometry::Mesh(mesh) => {
            mesh.content()?;
            positive("geometry.mesh.scale", mesh.scale)?;
        }
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

fn at_least_one(path: &str, count: u32) -> Result<()> {
    require(count > 0, path, "expected at least 1 instead of 0")
}

fn cylinder(c: &CylinderGeometry) -> Result<()> {
    const PATH: &str = "geometry.cylinder";
    let at = |key: &str| format!("{PATH}.{key}");
    finite(&at("base"), &c.base)?;
    positive(&at("radius"), c.radius)?;
    positive(&at("length"), c.length)?;
    at_least_one(&at("divisions"), c.divisions)?;
    at_least_one(&at("layers"), c.layers)?;
    if let Sector::Wedge(angle) = c.sector {
        require(
            (0.1..180.0).contains(&angle),
            &at("sector.wedge"),
            &format!(
                "expected an angle of 0.1 degrees or more and less than 180 instead of {angle}"
            ),
        )?;
    }
    for (key, divided, count) in [
        ("grading", &c.grading, c.layers),
        ("radial_grading", &c.radial_grading, c.divisions),
    ] {
        counted_grading(&at(key), divided.as_ref(), count)?;
    }
    for (i, [place, factor]) in c.taper.iter().enumerate() {
        let path = format!("{PATH}.taper[{i}]");
        finite(&path, &[*place, *factor])?;
        let (rule, holds) = match i {
            0 => ("0 for the bottom", *place == 0.0),
            _ if i + 1 == c.taper.len() => ("1 for the top", *place == 1.0),
            _ => ("more than the place before", true),
        };
        let increasing = i == 0 || *place > c.taper[i - 1][0];
        require(
            holds && increasing,
            &format!("{path}[0]"),
            &format!("expected {rule} instead of {place}"),
        )?;
        positive(&format!("{path}[1]"), *factor)?;
    }
    require(
        c.taper.len() != 1,
        &at("taper"),
        "expected at least two entries, at 0 and at 1",
    )
}

/// A grading of a given number of divisions; a list of fractions must have as many.
fn counted_grading(path: &str, divided: Option<&Grading>, count: u32) -> Result<()> {
    let Some(divided) = divided else {
        return Ok(());
    };
    grading(path, divided)?;
    let cells = Grading::cells(Some(divided), f64::from(count));
    require(
        cells == f64::from(count),
        path,
        &format!("the fractions make {cells} divisions, not {count}"),
    )
}

fn perforated_box(b: &PerforatedBox) -> Result<()> {
    const PATH: &str = "geometry.perforated_box";
    let at = |key: &str| format!("{PATH}.{key}");
    finite(&at("min"), &b.min)?;
    finite(&at("max"), &b.max)?;
    for axis in 0..3 {
        let edge = b.max[axis] - b.min[axis];
        require(
            edge.is_finite() && edge > 0.0,
            &at(&format!("max[{axis}]")),
            &format!(
                "expected more than min[{axis}] = {} instead of {}",
                b.min[axis], b.max[axis]
            ),
        )?;
    }
    for (i, tiles) in b.tiles.into_iter().enumerate() {
        at_least_one(&at(&format!("tiles[{i}]")), tiles)?;
    }
    for (key, count) in [
        ("divisions", b.divisions),
        ("rings", b.rings),
        ("layers", b.layers),
    ] {
        at_least_one(&at(key), count)?;
    }
    positive(&at("diameter"), b.diameter)?;
    let [u, v, _] = b.along.directions();
    for (axis, tiles) in [u, v].into_iter().zip(b.tiles) {
        let tile = (b.max[axis] - b.min[axis]) / f64::from(tiles);
        require(
            b.diameter < tile,
            &at("diameter"),
            &format!(
                "expected less than the tiles' width {tile} along {} instead of {}",
                ["x", "y", "z"][axis],
                b.diameter
            ),
        )?;
    }
    for (i, tile) in b.solid.iter().enumerate() {
        let path = at(&format!("solid[{i}]"));
        require(
            tile[0] < b.tiles[0] && tile[1] < b.tiles[1],
            &path,
            &format!(
                "there is no tile {tile:?}: there are {} by {}, counted from 0",
                b.tiles[0], b.tiles[1]
            ),
        )?;
        require(
            !b.solid[..i].contains(tile),
            &path,
            "this tile is listed twice: remove one",
        )?;
    }
    counted_grading(&at("grading"), b.grading.as_ref(), b.layers)
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
            &format!("the face `{face}` is listed twice: remove one"),
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

/// By part of the body: the number of particles, the length of the list of neighbours of one inside, and
/// the path in the scene that says so. In f64, as a tiny spacing overflows any integer.
fn sizes(geometry: &Geometry, neighbours: Neighbours) -> Result<Vec<(f64, f64, String)>> {
    let pairs = |count: f64, h: [f64; 3]| match neighbours {
        Neighbours::Lattice(number) => f64::from(number),
        Neighbours::Radius { radius } => {
            // Cells of a ball around a particle, as far as the body reaches.
            let reach = (radius + 0.2) * h.into_iter().fold(0.0, f64::max);
            let ball = 4.19 * reach.powi(3) / (h[0] * h[1] * h[2]);
            ball.min(count)
        }
    };
    let whole = |count: f64, place: &str| vec![(count, pairs(count, [1.0; 3]), place.to_owned())];
    Ok(match geometry {
        Geometry::Box(_) | Geometry::Boxes(_) => geometry
            .boxes()
            .into_iter()
            .map(|(name, b)| {
                let count: f64 = (0..3).map(|a| b.cells(a) + 1.0).product();
                let pairs = pairs(count, b.spacing.per_axis());
                (count, pairs, format!("{}.spacing", box_path(name)))
            })
            .collect(),
        Geometry::Cylinder(c) => whole(c.particles(), "geometry.cylinder"),
        Geometry::PerforatedBox(b) => whole(b.particles(), "geometry.perforated_box"),
        Geometry::Mesh(mesh) => {
            let content = mesh.content()?;
            let count = content.nodes() as f64;
            let own = match neighbours {
                // The edges of tetrahedra are as many whatever is asked for.
                Neighbours::Lattice(_) if !content.all_hexahedra() => 18.0,
                _ => pairs(count, [1.0; 3]),
            };
            // A list has a place for each lane of a vector, and the order of the nodes of a mesh leaves
            // up to two thirds of them empty; measured.
            let lanes = (3.0 * own).min(own.max(50.0));
            vec![(count, lanes, "geometry.mesh.file".to_owned())]
        }
    })
}

impl Scene {
    /// Memory that a simulation of this scene will hold [bytes], foreseen without setting it up: 0.9 to 1.3 times
    /// what it then is.
    ///
    /// # Errors
    /// [`Code::InvalidScene`] for a geometry without a size.
    pub fn memory(&self) -> Result<f64> {
        let sizes = sizes(&self.geometry, self.numerics.neighbours)?;
        let bytes = sizes
            .iter()
            .map(|(count, pairs, _)| count * bytes_per_particle(self, *pairs));
        Ok(bytes.sum())
    }
}

/// Whether the particles fit into their numbers and into the memory [bytes], if that is known.
pub(super) fn capacity(scene: &Scene, memory: Option<f64>) -> Result<()> {
    let setup = match scene.geometry.is_lattice() {
        true => SETUP_BYTES_PER_PARTICLE.0,
        false => SETUP_BYTES_PER_PARTICLE.1,
    };
    let (mut total, mut bytes, mut most) = (0.0, 0.0, (0.0, String::new()));
    for (count, pairs, place) in sizes(&scene.geometry, scene.numerics.neighbours)? {
        total += count;
        let held = bytes_per_particle(scene, pairs);
        bytes += count * (held + setup + pairs * SETUP_BYTES_PER_PAIR);
        if count > most.0 {
            most = (count, place);
        }
    }
    let amount = |x: f64, unit: f64, digits: usize| match x / unit {
        small if small < 1e12 => format!("{small:.digits$}"),
        large => format!("{large:.1e}"),
    };
    let error = |limit: String| {
        Err(Error::new(
            Code::OutOfMemory,
            format!(
                "this makes about {} particles, which with their neighbours need about {} GB; {limit}; \
                 choose a larger spacing or fewer neighbours",
                amount(total, 1.0, 0),
                amount(bytes, 1e9, 1)
            ),
        )
        .at_path(most.1.clone()))
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
        let text = r#"{
            "geometry": {"box": {"min": [0, 0, 0], "max": [1, 1, 1], "spacing": 0.1}},
            "material": {"neo_hookean": {"density": 1, "youngs_modulus": 1, "poisson_ratio": 0}},
            "boundary": {}, "time": {"end": 1}
        }"#;
        let mut scene = Scene::from_json(text, &[]).unwrap();
        let pairs = 1331.0 * 18.0 * SETUP_BYTES_PER_PAIR;
        let need = scene.memory().unwrap() + 1331.0 * SETUP_BYTES_PER_PARTICLE.0 + pairs;
        capacity(&scene, None).unwrap();
        capacity(&scene, Some(need + 1.0)).unwrap();
        let error = capacity(&scene, Some(need - 1.0)).unwrap_err();
        assert_eq!(error.code(), Code::OutOfMemory);
        assert_eq!(error.place().path.as_deref(), Some("geometry.box.spacing"));
        assert!(error.message().contains("1331 particles"), "{error}");
        scene.numerics.neighbours = Neighbours::Radius { radius: 1e9 };
        capacity(&scene, Some(need)).unwrap_err();
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn the_available_memory_is_known() {
        assert!(available_memory().unwrap() > 1e6);
    }
}
