//! A union of boxes becomes one rectilinear lattice: the bounds of all boxes cut each axis into
//! segments, each divided evenly by the finest spacing that a box asks for there. Nodes of filled
//! cells are particles; a particle's tributary volume and areas are an eighth of its cells and a
//! quarter of its boundary faces.

use std::collections::BTreeMap;

use super::{Face, NONE, Particles, Shape, Share, patches, surface};
use crate::error::{Code, Error, Result};
use crate::scene::{BoxGeometry, PatchSelection};

/// A rectilinear lattice with filled cells.
#[derive(Debug, Clone)]
pub struct Lattice {
    /// Node coordinates per axis [m].
    lines: [Vec<f64>; 3],
    /// Whether a cell is filled, X first.
    filled: Vec<bool>,
    /// Body's particle of a node (X first), `NONE` where there is none.
    node: Vec<u32>,
    /// Node of a body's particle.
    sites: Vec<[u32; 3]>,
}

const AXES: [char; 3] = ['x', 'y', 'z'];

impl Lattice {
    fn cells(&self, axis: usize) -> usize {
        self.lines[axis].len() - 1
    }
    fn cell_index(&self, c: [usize; 3]) -> usize {
        (c[2] * self.cells(1) + c[1]) * self.cells(0) + c[0]
    }
    fn node_index(&self, n: [usize; 3]) -> usize {
        (n[2] * self.lines[1].len() + n[1]) * self.lines[0].len() + n[0]
    }
    /// Whether a cell exists and is filled.
    fn is_filled(&self, c: [isize; 3]) -> bool {
        (0..3).all(|a| c[a] >= 0 && (c[a] as usize) < self.cells(a))
            && self.filled[self.cell_index(c.map(|v| v as usize))]
    }
    /// Whether all cells of the bounding box are filled.
    pub fn is_box(&self) -> bool {
        self.filled.iter().all(|f| *f)
    }
    /// Whether a point lies in a filled cell or on its surface.
    pub fn contains(&self, point: [f64; 3]) -> bool {
        // A point on a lattice line belongs to the cells on both sides.
        let candidates = |a: usize| {
            let lines = &self.lines[a];
            let slack = 1e-9 * (lines[lines.len() - 1] - lines[0]);
            let below = lines.partition_point(|l| *l < point[a] - slack);
            let above = lines.partition_point(|l| *l <= point[a] + slack);
            below as isize - 1..above as isize
        };
        candidates(2)
            .any(|k| candidates(1).any(|j| candidates(0).any(|i| self.is_filled([i, j, k]))))
    }
    /// Largest lattice spacing [m].
    pub fn largest_spacing(&self) -> f64 {
        self.spacings().fold(0.0, f64::max)
    }
    /// Smallest lattice spacing [m].
    pub fn smallest_spacing(&self) -> f64 {
        self.spacings().fold(f64::INFINITY, f64::min)
    }
    fn spacings(&self) -> impl Iterator<Item = f64> {
        let widths = |l: &'_ Vec<f64>| l.windows(2).map(|w| w[1] - w[0]).collect::<Vec<_>>();
        self.lines.iter().flat_map(widths)
    }
    /// The particle at an offset of -1, 0, 1 per axis, if both share a filled cell.
    pub fn neighbour(&self, particle: usize, offset: [i32; 3]) -> Option<u32> {
        let site = self.sites[particle].map(|s| s as isize);
        let shared = |corner: usize| {
            // The cells that hold both nodes: fixed along axes with an offset, two choices along others.
            let cell = std::array::from_fn(|a| match offset[a] {
                1 => site[a],
                -1 => site[a] - 1,
                _ => site[a] - (corner >> a & 1) as isize,
            });
            self.is_filled(cell)
        };
        if !(0..8).any(shared) {
            return None;
        }
        let n = std::array::from_fn(|a| (site[a] + offset[a] as isize) as usize);
        Some(self.node[self.node_index(n)])
    }
    /// Trilinear interpolation at a point: up to eight (particle, weight). `None` outside the body.
    pub fn interpolation(&self, point: [f64; 3]) -> Option<Vec<(u32, f64)>> {
        let mut choices: [Vec<(usize, f64)>; 3] = Default::default();
        for a in 0..3 {
            let lines = &self.lines[a];
            let extent = lines[lines.len() - 1] - lines[0];
            for c in 0..self.cells(a) {
                let width = lines[c + 1] - lines[c];
                let s = (point[a] - lines[c]) / width;
                let slack = 1e-9 * extent / width;
                if s >= -slack && s <= 1.0 + slack {
                    // Snapped: a probe on a node reads that node and nothing else.
                    let s = if s.abs() <= slack { 0.0 } else { s };
                    let s = if (s - 1.0).abs() <= slack { 1.0 } else { s };
                    choices[a].push((c, s));
                }
            }
        }
        for &(k, sz) in &choices[2] {
            for &(j, sy) in &choices[1] {
                for &(i, sx) in &choices[0] {
                    if !self.filled[self.cell_index([i, j, k])] {
                        continue;
                    }
                    let mut weights = Vec::new();
                    for corner in 0..8 {
                        let bit = [corner & 1, corner >> 1 & 1, corner >> 2 & 1];
                        let weight: f64 = [sx, sy, sz]
                            .iter()
                            .zip(bit)
                            .map(|(s, b)| if b == 1 { *s } else { 1.0 - s })
                            .product();
                        if weight != 0.0 {
                            let n = self.node_index([i + bit[0], j + bit[1], k + bit[2]]);
                            weights.push((self.node[n], weight));
                        }
                    }
                    return Some(weights);
                }
            }
        }
        None
    }
}

/// The pieces between the bounds of all boxes along an axis: from, to [m], and the cells of each.
pub fn divisions(boxes: &[&BoxGeometry], axis: usize) -> Vec<(f64, f64, usize)> {
    let mut bounds: Vec<f64> = boxes
        .iter()
        .flat_map(|b| [b.min[axis], b.max[axis]])
        .collect();
    bounds.sort_by(f64::total_cmp);
    let slack = 1e-9 * (bounds[bounds.len() - 1] - bounds[0]);
    bounds.dedup_by(|a, b| *a - *b <= slack);
    let piece = |pair: &[f64]| {
        let (from, to) = (pair[0], pair[1]);
        let middle = 0.5 * (from + to);
        let cells = boxes
            .iter()
            .filter(|b| b.min[axis] < middle && middle < b.max[axis])
            .map(|b| ((to - from) / b.spacing.per_axis()[axis]).round().max(1.0) as usize)
            .max()
            .unwrap_or(1);
        (from, to, cells)
    };
    bounds.windows(2).map(piece).collect()
}

/// Divides the axis between the bounds of all boxes.
fn lattice_lines(boxes: &[(String, &BoxGeometry)], axis: usize) -> Vec<f64> {
    let boxes: Vec<&BoxGeometry> = boxes.iter().map(|(_, b)| *b).collect();
    let pieces = divisions(&boxes, axis);
    let mut lines = vec![pieces[0].0];
    for (from, to, cells) in pieces {
        for i in 1..=cells {
            let s = i as f64 / cells as f64;
            lines.push(if i == cells {
                to
            } else {
                from + s * (to - from)
            });
        }
    }
    lines
}

/// Refuses a lattice whose spacing jumps along an axis: there the pseudo-areas of a particle do not
/// add up to zero, and a uniform stress would push it (7 % of its face's force at a ratio of 1.1,
/// 70 % at 2). A ratio of 1.25 leaves room for lengths that one spacing does not divide.
fn check_spacings(lattice: &Lattice) -> Result<()> {
    let count = [0, 1, 2].map(|a| lattice.cells(a) as isize);
    for axis in 0..3 {
        for (at, w) in lattice.lines[axis].windows(3).enumerate() {
            let (p, q) = (w[1] - w[0], w[2] - w[1]);
            // Across a gap a jump does no harm.
            let joined = || {
                let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
                (0..count[u]).any(|i| {
                    (0..count[v]).any(|j| {
                        let mut cell = [0; 3];
                        (cell[axis], cell[u], cell[v]) = (at as isize, i, j);
                        let before = lattice.is_filled(cell);
                        cell[axis] += 1;
                        before && lattice.is_filled(cell)
                    })
                })
            };
            if p.max(q) > 1.25 * p.min(q) && joined() {
                return Err(Error::scene(
                    "geometry.boxes",
                    format!(
                        "along {} the spacing jumps from {p:.6} m to {q:.6} m at {:.6} m: give the \
                         boxes bounds and spacings that fit one lattice",
                        AXES[axis], w[1]
                    ),
                ));
            }
        }
    }
    Ok(())
}

impl Particles {
    /// The points of a union of boxes, each with the prefix of its faces' names; in lexicographic
    /// order, shortest axis first.
    pub(super) fn of_lattice(
        boxes: &[(String, &BoxGeometry)],
        selections: &BTreeMap<String, PatchSelection>,
    ) -> Result<Self> {
        let lines: [Vec<f64>; 3] = std::array::from_fn(|a| lattice_lines(boxes, a));
        let nodes = lines.iter().map(|l| l.len() as f64).product::<f64>();
        if nodes >= f64::from(i32::MAX) {
            return Err(Error::new(
                Code::OutOfMemory,
                format!("the lattice has {nodes:.3e} nodes, at most 2.1e9 are possible: choose a larger spacing"),
            )
            .at_path("geometry"));
        }
        let mut lattice = Lattice {
            lines,
            filled: Vec::new(),
            node: Vec::new(),
            sites: Vec::new(),
        };
        let cells = [0, 1, 2].map(|a| lattice.cells(a));
        lattice.filled = vec![false; cells.iter().product()];
        for (_, b) in boxes {
            let range = |a: usize| {
                let l = &lattice.lines[a];
                let inside = |c: &usize| {
                    let middle = 0.5 * (l[*c] + l[c + 1]);
                    b.min[a] < middle && middle < b.max[a]
                };
                (0..cells[a]).filter(inside).collect::<Vec<_>>()
            };
            let (xs, ys, zs) = (range(0), range(1), range(2));
            for &k in &zs {
                for &j in &ys {
                    for &i in &xs {
                        let cell = lattice.cell_index([i, j, k]);
                        lattice.filled[cell] = true;
                    }
                }
            }
        }

        check_spacings(&lattice)?;
        let volumes_by_node = tributary_volumes(&lattice);
        // Caller's order: node order, X first. Body's order: the axis with the fewest nodes first.
        let sizes = [0, 1, 2].map(|a| lattice.lines[a].len());
        let mut axes = [0, 1, 2];
        axes.sort_by_key(|&a| sizes[a]);
        lattice.node = vec![NONE; volumes_by_node.len()];
        let mut callers = 0u32;
        let mut caller_of_node = vec![NONE; volumes_by_node.len()];
        for (n, v) in volumes_by_node.iter().enumerate() {
            if *v > 0.0 {
                caller_of_node[n] = callers;
                callers += 1;
            }
        }
        let count = callers as usize;
        let mut positions = Vec::with_capacity(count);
        let mut volumes = Vec::with_capacity(count);
        let mut order = Vec::with_capacity(count);
        let mut rank = vec![0; count];
        for k in 0..sizes[axes[2]] {
            for j in 0..sizes[axes[1]] {
                for i in 0..sizes[axes[0]] {
                    let mut site = [0; 3];
                    site[axes[0]] = i;
                    site[axes[1]] = j;
                    site[axes[2]] = k;
                    let n = lattice.node_index(site);
                    if caller_of_node[n] == NONE {
                        continue;
                    }
                    let body = positions.len() as u32;
                    lattice.node[n] = body;
                    lattice.sites.push(site.map(|s| s as u32));
                    positions.push(std::array::from_fn(|a| lattice.lines[a][site[a]]));
                    volumes.push(volumes_by_node[n]);
                    order.push(caller_of_node[n]);
                    rank[caller_of_node[n] as usize] = body;
                }
            }
        }
        let names = face_names(boxes);
        let faces = boundary_faces(&lattice, boxes);
        Ok(Self {
            positions,
            volumes,
            surface: surface(&faces, count),
            order,
            rank,
            shape: Shape::Lattice(lattice),
            patches: patches(&faces, &names, selections)?,
        })
    }
}

fn tributary_volumes(lattice: &Lattice) -> Vec<f64> {
    let mut volumes = vec![0.0; lattice.lines.iter().map(Vec::len).product()];
    for k in 0..lattice.cells(2) {
        for j in 0..lattice.cells(1) {
            for i in 0..lattice.cells(0) {
                let cell = [i, j, k];
                if !lattice.filled[lattice.cell_index(cell)] {
                    continue;
                }
                let eighth: f64 = (0..3)
                    .map(|a| 0.5 * (lattice.lines[a][cell[a] + 1] - lattice.lines[a][cell[a]]))
                    .product();
                for corner in 0..8 {
                    let n = std::array::from_fn(|a| cell[a] + (corner >> a & 1));
                    volumes[lattice.node_index(n)] += eighth;
                }
            }
        }
    }
    volumes
}

/// Names of the faces, six a box: lower and upper along each axis.
fn face_names(boxes: &[(String, &BoxGeometry)]) -> Vec<String> {
    boxes
        .iter()
        .flat_map(|(prefix, _)| {
            AXES.into_iter()
                .flat_map(move |axis| ["min", "max"].map(|side| format!("{prefix}{axis}_{side}")))
        })
        .collect()
}

/// Faces of filled cells that no other filled cell shares, named as in [`face_names`].
fn boundary_faces(lattice: &Lattice, boxes: &[(String, &BoxGeometry)]) -> Vec<Face> {
    let mut faces = Vec::new();
    for k in 0..lattice.cells(2) {
        for j in 0..lattice.cells(1) {
            for i in 0..lattice.cells(0) {
                let cell = [i, j, k];
                if !lattice.filled[lattice.cell_index(cell)] {
                    continue;
                }
                let middle: [f64; 3] = std::array::from_fn(|a| {
                    0.5 * (lattice.lines[a][cell[a] + 1] + lattice.lines[a][cell[a]])
                });
                let inside =
                    |b: &BoxGeometry| (0..3).all(|a| b.min[a] < middle[a] && middle[a] < b.max[a]);
                let owners = || (0..boxes.len()).filter(|b| inside(boxes[*b].1));
                for axis in 0..3 {
                    for side in 0..2 {
                        let mut beyond = cell.map(|c| c as isize);
                        beyond[axis] += 2 * side as isize - 1;
                        if lattice.is_filled(beyond) {
                            continue;
                        }
                        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
                        let width =
                            |a: usize| lattice.lines[a][cell[a] + 1] - lattice.lines[a][cell[a]];
                        let mut centre = middle;
                        centre[axis] = lattice.lines[axis][cell[axis] + side];
                        let area = 0.25 * (width(u) * width(v));
                        let mut vector = [0.0; 3];
                        vector[axis] = if side == 0 { -area } else { area };
                        let shares = [[0, 0], [1, 0], [0, 1], [1, 1]].map(|[du, dv]| {
                            let mut n = cell;
                            n[axis] += side;
                            n[u] += du;
                            n[v] += dv;
                            Share {
                                particle: lattice.node[lattice.node_index(n)],
                                vector,
                                area,
                            }
                        });
                        faces.push(Face {
                            // An exposed face of a filled cell is a bound of every box around it.
                            names: owners().map(|b| (6 * b + 2 * axis + side) as u32).collect(),
                            centre,
                            shares,
                        });
                    }
                }
            }
        }
    }
    faces
}
