//! Scene to points: positions, tributary volumes, and boundary patches with areas and normals.
//!
//! Boxes become a rectilinear [`lattice`]; everything else is a [`mesh`] of cells whose nodes are the
//! particles, read from a file or made by [`structured`].

mod gmsh;
mod lattice;
mod mesh;
mod structured;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;

use crate::error::{Error, Result};
use crate::math::*;
use crate::scene::{Geometry, PatchSelection, Scene};

pub use gmsh::MeshFile;
pub use lattice::{Lattice, divisions as lattice_divisions};
pub use mesh::{Mesh, MeshSummary, Sharing};

/// The points of a body, in the body's order, which keeps neighbours close in memory.
#[derive(Debug, Clone)]
pub struct Particles {
    /// X [m], initial.
    pub positions: Vec<[f64; 3]>,
    /// V_R [m^3], initial.
    pub volumes: Vec<f64>,
    /// Sum of A_R N over all boundary faces of a particle [m^2], initial; zero inside the body.
    pub surface: Vec<[f64; 3]>,
    /// Body's particle to caller's particle. The caller's order is lexicographic on a lattice (X
    /// first, then Y, then Z), and that of the nodes on a mesh.
    pub order: Vec<u32>,
    /// Caller's particle to body's particle.
    pub rank: Vec<u32>,
    /// What lies between the points.
    pub shape: Shape,
    /// Named patches: all faces of the geometry, then the scene's own.
    pub patches: Vec<PatchFacets>,
}

/// What lies between the points of a body.
#[derive(Debug, Clone)]
pub enum Shape {
    /// A rectilinear lattice.
    Lattice(Lattice),
    /// Cells between the particles.
    Mesh(Mesh),
}

/// A named part of the surface.
#[derive(Debug, Clone)]
pub struct PatchFacets {
    /// Name.
    pub name: String,
    /// Shares of the particles, ascending by particle; several where the surface has an edge.
    pub facets: Vec<Facet>,
}

/// Share of one particle in a smooth piece of the surface.
#[derive(Debug, Clone, Copy)]
pub struct Facet {
    /// Body's particle.
    pub particle: u32,
    /// Unit outward normal N, initial.
    pub normal: [f64; 3],
    /// A_R [m^2], initial.
    pub area: f64,
    /// A_R N [m^2], initial; on a curved piece shorter than the area, and exact for a pressure.
    pub area_vector: [f64; 3],
}

/// No particle, no node.
const NONE: u32 = u32::MAX;

/// A piece of the surface: a boundary face of a cell.
struct Face {
    /// Indices of the names that it has.
    names: Vec<u32>,
    centre: [f64; 3],
    /// Share of each corner; the fourth is `NONE` in a triangle.
    shares: [Share; 4],
}

/// Share of a particle in a face.
#[derive(Clone, Copy)]
struct Share {
    /// Body's particle.
    particle: u32,
    /// A N [m^2].
    vector: [f64; 3],
    /// A [m^2].
    area: f64,
}

impl Particles {
    /// The points of a scene.
    ///
    /// # Errors
    /// [`Code::InvalidScene`](crate::Code::InvalidScene) naming the patch that selects no particle,
    /// [`Code::OutOfMemory`](crate::Code::OutOfMemory).
    pub fn new(scene: &Scene) -> Result<Self> {
        match &scene.geometry {
            Geometry::Box(b) if !b.is_lattice() => {
                Self::of_grid(structured::block(b), &scene.patches)
            }
            Geometry::Box(b) => Self::of_lattice(&[(String::new(), b)], &scene.patches),
            Geometry::Boxes(boxes) => {
                let named: Vec<_> = boxes.iter().map(|(n, b)| (format!("{n}."), b)).collect();
                Self::of_lattice(&named, &scene.patches)
            }
            Geometry::Cylinder(c) => Self::of_grid(structured::cylinder(c), &scene.patches),
            Geometry::PerforatedBox(b) => Self::of_grid(structured::perforated(b), &scene.patches),
            Geometry::Mesh(m) => Self::of_grid(mesh::Grid::from(m.content()?), &scene.patches),
        }
    }

    /// Number of particles.
    pub fn count(&self) -> usize {
        self.positions.len()
    }

    /// Caller's number of a body's particle.
    pub fn caller(&self, body: usize) -> usize {
        self.order[body] as usize
    }

    /// Numbers and sizes of the cells, where there is a mesh.
    pub fn mesh_summary(&self, scene: &Scene) -> Option<MeshSummary> {
        let Shape::Mesh(mesh) = &self.shape else {
            return None;
        };
        let mut summary = mesh.summary(&self.positions);
        if let Geometry::Mesh(file) = &scene.geometry {
            summary.notes = file.content().map_or(Vec::new(), |m| m.notes().to_vec());
        }
        Some(summary)
    }

    /// Interpolation at a point: (particle, weight), the weights add up to 1; a point on a particle
    /// reads that particle alone. `None` outside the body.
    pub fn interpolation(&self, point: [f64; 3]) -> Option<Vec<(u32, f64)>> {
        match &self.shape {
            Shape::Lattice(lattice) => lattice.interpolation(point),
            Shape::Mesh(mesh) => mesh.interpolation(&self.positions, point),
        }
    }
}

/// Sum of A_R N per particle over the whole surface.
fn surface(faces: &[Face], count: usize) -> Vec<[f64; 3]> {
    let mut surface = vec![[0.0; 3]; count];
    for share in faces.iter().flat_map(Face::shares) {
        let sum = &mut surface[share.particle as usize];
        *sum = add3(*sum, share.vector);
    }
    surface
}

impl Face {
    fn shares(&self) -> impl Iterator<Item = &Share> {
        self.shares.iter().filter(|s| s.particle != NONE)
    }
}

/// Facets of a set of faces: per particle, one for each smooth piece of the surface.
fn facets<'a>(faces: impl Iterator<Item = &'a Face>) -> Vec<Facet> {
    /// Cosine of the angle at which a surface has an edge, 50 degrees: between the 45 degrees of an
    /// octagon that stands for a circle and the 60 degrees of a bar that is a hexagon.
    const EDGE: f64 = 0.642_787_609_686_539_3;
    let unit = |v: [f64; 3]| {
        let length = dot(v, v).sqrt();
        // An exact division keeps the normals of a lattice exact.
        if length > 0.0 {
            v.map(|c| c / length)
        } else {
            v
        }
    };
    let mut shares: Vec<&Share> = faces.flat_map(Face::shares).collect();
    shares.sort_by_key(|s| s.particle);
    let mut facets: Vec<Facet> = Vec::new();
    for group in shares.chunk_by(|a, b| a.particle == b.particle) {
        let first = facets.len();
        for share in group {
            let normal = unit(share.vector);
            let smooth = facets[first..]
                .iter_mut()
                .find(|f| dot(f.normal, normal) > EDGE);
            match smooth {
                Some(facet) => {
                    facet.area += share.area;
                    facet.area_vector = add3(facet.area_vector, share.vector);
                    facet.normal = unit(facet.area_vector);
                }
                None => facets.push(Facet {
                    particle: share.particle,
                    normal,
                    area: share.area,
                    area_vector: share.vector,
                }),
            }
        }
        // Axis by axis and the negative side first, whatever the order of the faces.
        facets[first..].sort_by(|a, b| {
            (0..3)
                .map(|c| {
                    let (p, q) = (a.normal[c], b.normal[c]);
                    q.abs().total_cmp(&p.abs()).then(p.total_cmp(&q))
                })
                .fold(std::cmp::Ordering::Equal, std::cmp::Ordering::then)
        });
    }
    facets
}

/// The patches: every name of the faces, then the scene's selections.
fn patches(
    faces: &[Face],
    names: &[String],
    selections: &BTreeMap<String, PatchSelection>,
) -> Result<Vec<PatchFacets>> {
    let mut by_name: Vec<Vec<&Face>> = vec![Vec::new(); names.len()];
    for face in faces {
        for &name in &face.names {
            by_name[name as usize].push(face);
        }
    }
    let mut exposed: Vec<usize> = (0..names.len())
        .filter(|n| !by_name[*n].is_empty())
        .collect();
    exposed.sort_unstable_by_key(|n| &names[*n]);
    let mut patches: Vec<PatchFacets> = exposed
        .iter()
        .map(|&n| PatchFacets {
            name: names[n].clone(),
            facets: facets(by_name[n].iter().copied()),
        })
        .collect();
    for (name, selection) in selections {
        let mut selected = Vec::with_capacity(selection.faces.len());
        for face in &selection.faces {
            match exposed.iter().find(|n| names[**n] == *face) {
                Some(&n) => selected.push(n as u32),
                None => {
                    let all: Vec<&str> = exposed.iter().map(|n| names[*n].as_str()).collect();
                    return Err(Error::scene(
                        format!("patches.{name}.faces"),
                        format!(
                            "the body has no exposed face `{face}`; it has {}",
                            all.join(", ")
                        ),
                    ));
                }
            }
        }
        let inside = |c: &[f64; 3]| {
            (0..3).all(|a| {
                selection.min.is_none_or(|min| c[a] >= min[a])
                    && selection.max.is_none_or(|max| c[a] <= max[a])
            })
        };
        let facets = facets(
            faces
                .iter()
                .filter(|f| f.names.iter().any(|n| selected.contains(n)) && inside(&f.centre)),
        );
        if facets.is_empty() {
            return Err(Error::scene(
                format!("patches.{name}"),
                "selects no particle: the centres of the cell faces must lie in [min, max]",
            )
            .at_boundary(name));
        }
        patches.push(PatchFacets {
            name: name.clone(),
            facets,
        });
    }
    Ok(patches)
}
