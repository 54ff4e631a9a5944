//! Cells between particles: tributary volumes and areas, the mesh's own operators, point location.
//!
//! With the shape functions N_a of the cells (linear in tetrahedra, trilinear in hexahedra, their
//! product in prisms) V_a = int N_a dV and A_a N_a = oint N_a n dA. The integrands are polynomials and
//! the quadrature is exact for them, so that up to round-off sum V_a is the volume between the
//! (bilinear) faces, sum A_a N_a = 0 and sum A_a N_a (x) X_a = (sum V_a) I: what makes the closure
//! repair solvable.

use std::collections::BTreeMap;

use super::{Face, MeshFile, NONE, Particles, Shape, Share, patches, surface};
use crate::error::{Code, Error, Result};
use crate::math::*;
use crate::parallel;
use crate::scene::PatchSelection;

/// Cells between particles.
#[derive(Debug, Clone)]
pub struct Mesh {
    /// The cells.
    pub cells: Vec<Cell>,
    /// First entry of each particle in `of_particle`.
    start: Vec<u32>,
    /// Cells of each particle, ascending.
    of_particle: Vec<u32>,
}

/// A cell: its kind and its corners.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Cell {
    /// Kind.
    pub kind: CellKind,
    /// Corners; see [`Cell::nodes`].
    nodes: [u32; 8],
}

/// Kind of a cell; corners are numbered as in Gmsh and VTK.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CellKind {
    /// Four corners, linear.
    Tetrahedron,
    /// Six corners: a triangle and the one above it.
    Prism,
    /// Eight corners, trilinear: a quadrilateral and the one above it.
    Hexahedron,
}

/// Shape functions of the corners at a point of a cell, and their gradients in natural coordinates.
type ShapeFunctions = ([f64; 8], [[f64; 3]; 8]);

/// Corners of the reference cells: bits of a unit cube, or of a unit simplex times a unit interval.
const CUBE: [[f64; 3]; 8] = [
    [0.0, 0.0, 0.0],
    [1.0, 0.0, 0.0],
    [1.0, 1.0, 0.0],
    [0.0, 1.0, 0.0],
    [0.0, 0.0, 1.0],
    [1.0, 0.0, 1.0],
    [1.0, 1.0, 1.0],
    [0.0, 1.0, 1.0],
];
/// Points of the two-point Gauss rule on [0, 1]; exact for cubics.
const GAUSS: [f64; 2] = [0.211_324_865_405_187_13, 0.788_675_134_594_812_9];

impl CellKind {
    /// Number of corners.
    pub fn corners(self) -> usize {
        match self {
            CellKind::Tetrahedron => 4,
            CellKind::Prism => 6,
            CellKind::Hexahedron => 8,
        }
    }
    /// Faces, corners in turn with the normal outward.
    pub fn faces(self) -> &'static [&'static [usize]] {
        match self {
            CellKind::Tetrahedron => &[&[0, 2, 1], &[0, 1, 3], &[1, 2, 3], &[0, 3, 2]],
            CellKind::Prism => &[
                &[0, 2, 1],
                &[3, 4, 5],
                &[0, 1, 4, 3],
                &[1, 2, 5, 4],
                &[2, 0, 3, 5],
            ],
            CellKind::Hexahedron => &[
                &[0, 3, 2, 1],
                &[4, 5, 6, 7],
                &[0, 1, 5, 4],
                &[1, 2, 6, 5],
                &[2, 3, 7, 6],
                &[3, 0, 4, 7],
            ],
        }
    }
    /// Corners at the other ends of the three edges of a corner.
    fn edges_at(self, corner: usize) -> [usize; 3] {
        let mut ends = [usize::MAX; 3];
        for face in self.faces() {
            if let Some(i) = face.iter().position(|c| *c == corner) {
                // Each edge is in two faces: it comes after the corner in one of them.
                let end = face[(i + 1) % face.len()];
                let free = ends.iter().position(|e| *e == usize::MAX);
                ends[free.expect("three faces meet in a corner")] = end;
            }
        }
        ends
    }
    /// Name, in the plural.
    pub fn plural(self) -> &'static str {
        match self {
            CellKind::Tetrahedron => "tetrahedra",
            CellKind::Prism => "prisms",
            CellKind::Hexahedron => "hexahedra",
        }
    }
    /// Centre in natural coordinates.
    fn centre(self) -> [f64; 3] {
        match self {
            CellKind::Tetrahedron => [0.25; 3],
            CellKind::Prism => [1.0 / 3.0, 1.0 / 3.0, 0.5],
            CellKind::Hexahedron => [0.5; 3],
        }
    }
    /// Points and weights, exact for N_a grad N_b det J.
    fn quadrature(self) -> Vec<([f64; 3], f64)> {
        match self {
            CellKind::Tetrahedron => vec![([0.25; 3], 1.0 / 6.0)],
            CellKind::Prism => [[0.5, 0.0], [0.5, 0.5], [0.0, 0.5]]
                .into_iter()
                .flat_map(|[r, s]| GAUSS.map(|t| ([r, s, t], 1.0 / 12.0)))
                .collect(),
            CellKind::Hexahedron => GAUSS
                .into_iter()
                .flat_map(|r| GAUSS.map(|s| GAUSS.map(|t| ([r, s, t], 0.125))))
                .flatten()
                .collect(),
        }
    }
    fn shape_functions(self, [r, s, t]: [f64; 3]) -> ShapeFunctions {
        let (mut n, mut d) = ([0.0; 8], [[0.0; 3]; 8]);
        match self {
            CellKind::Tetrahedron => {
                n[..4].copy_from_slice(&[1.0 - r - s - t, r, s, t]);
                d[..4].copy_from_slice(&[
                    [-1.0, -1.0, -1.0],
                    [1.0, 0.0, 0.0],
                    [0.0, 1.0, 0.0],
                    [0.0, 0.0, 1.0],
                ]);
            }
            CellKind::Prism => {
                let triangle = [
                    (1.0 - r - s, [-1.0, -1.0]),
                    (r, [1.0, 0.0]),
                    (s, [0.0, 1.0]),
                ];
                for (layer, (along, slope)) in [(1.0 - t, -1.0), (t, 1.0)].into_iter().enumerate() {
                    for (corner, (across, [dr, ds])) in triangle.into_iter().enumerate() {
                        n[3 * layer + corner] = across * along;
                        d[3 * layer + corner] = [dr * along, ds * along, across * slope];
                    }
                }
            }
            CellKind::Hexahedron => {
                for (corner, at) in CUBE.iter().enumerate() {
                    let value = |a: usize, x: f64| if at[a] == 1.0 { x } else { 1.0 - x };
                    let slope = |a: usize| 2.0 * at[a] - 1.0;
                    let (u, v, w) = (value(0, r), value(1, s), value(2, t));
                    n[corner] = u * v * w;
                    d[corner] = [slope(0) * v * w, u * slope(1) * w, u * v * slope(2)];
                }
            }
        }
        (n, d)
    }
    /// How far natural coordinates lie outside the cell; 0 or less inside.
    fn excess(self, [r, s, t]: [f64; 3]) -> f64 {
        match self {
            CellKind::Tetrahedron => (-r).max(-s).max(-t).max(r + s + t - 1.0),
            CellKind::Prism => (-r).max(-s).max(r + s - 1.0).max(-t).max(t - 1.0),
            CellKind::Hexahedron => [r, s, t]
                .into_iter()
                .map(|x| (-x).max(x - 1.0))
                .fold(f64::NEG_INFINITY, f64::max),
        }
    }
}

impl Cell {
    /// A cell with as many corners as its kind has.
    pub(super) fn new(kind: CellKind, corners: &[u32]) -> Self {
        let mut nodes = [NONE; 8];
        nodes[..kind.corners()].copy_from_slice(corners);
        Self { kind, nodes }
    }
    /// The corners.
    pub fn nodes(&self) -> &[u32] {
        &self.nodes[..self.kind.corners()]
    }
    /// The same cell with other numbers for its corners.
    pub(super) fn renumber(&mut self, number: impl Fn(u32) -> u32) {
        for node in &mut self.nodes[..self.kind.corners()] {
            *node = number(*node);
        }
    }
    /// The same cell from the other hand.
    pub(super) fn reversed(&self) -> Self {
        let n = self.nodes;
        let nodes = match self.kind {
            CellKind::Tetrahedron => [n[0], n[2], n[1], n[3], NONE, NONE, NONE, NONE],
            CellKind::Prism => [n[3], n[4], n[5], n[0], n[1], n[2], NONE, NONE],
            CellKind::Hexahedron => [n[4], n[5], n[6], n[7], n[0], n[1], n[2], n[3]],
        };
        Self { nodes, ..*self }
    }
    /// Corners of its faces, outward; the fourth is `NONE` in a triangle.
    pub(super) fn faces(&self) -> impl Iterator<Item = [u32; 4]> {
        self.kind.faces().iter().map(|face| {
            let mut corners = [NONE; 4];
            for (to, from) in corners.iter_mut().zip(*face) {
                *to = self.nodes[*from];
            }
            corners
        })
    }
    /// Jacobian matrix dX/d(r, s, t), a row per component of X.
    fn jacobian(&self, at: &ShapeFunctions, positions: &[[f64; 3]]) -> Mat3<f64> {
        let mut j = [[0.0; 3]; 3];
        for (corner, node) in self.nodes().iter().enumerate() {
            j = add_outer(&j, positions[*node as usize], at.1[corner]);
        }
        j
    }
    /// Smallest determinant of the Jacobian matrix at the points of quadrature, over the cube of the
    /// longest edge from the first corner: positive if the cell is not inverted.
    pub(super) fn shape_measure(&self, positions: &[[f64; 3]]) -> f64 {
        let x = |node: u32| positions[node as usize];
        let longest = self.nodes()[1..]
            .iter()
            .map(|n| sub3(x(*n), x(self.nodes[0])))
            .map(|r| dot(r, r).sqrt())
            .fold(0.0, f64::max);
        let least = self
            .kind
            .quadrature()
            .iter()
            .map(|(at, _)| {
                let j = self.jacobian(&self.kind.shape_functions(*at), positions);
                dot(j[0], cofactor(&j)[0])
            })
            .fold(f64::INFINITY, f64::min);
        least / longest.powi(3)
    }
    /// int N_a dV by corner; the others are 0.
    fn volumes(&self, positions: &[[f64; 3]]) -> [f64; 8] {
        let mut volumes = [0.0; 8];
        for (at, weight) in self.kind.quadrature() {
            let at = self.kind.shape_functions(at);
            let j = self.jacobian(&at, positions);
            let volume = weight * dot(j[0], cofactor(&j)[0]);
            for (v, n) in volumes.iter_mut().zip(at.0) {
                *v += n * volume;
            }
        }
        volumes
    }
    /// Natural coordinates of a point, by Newton's method; `None` where it does not converge, which
    /// for a cell of good shape means that the point is far outside.
    fn locate(&self, positions: &[[f64; 3]], point: [f64; 3]) -> Option<[f64; 3]> {
        const MOST: usize = 40;
        let mut natural = self.kind.centre();
        for _ in 0..MOST {
            let at = self.kind.shape_functions(natural);
            let j = self.jacobian(&at, positions);
            let cof = cofactor(&j);
            let rest = self.nodes().iter().zip(at.0).fold(point, |r, (node, n)| {
                axpy3(r, -n, positions[*node as usize])
            });
            // J^-1 = cof^T / det.
            let step = scale3(1.0 / dot(j[0], cof[0]), vec_mat(rest, &cof));
            natural = add3(natural, step);
            if natural.iter().any(|x| !x.is_finite() || x.abs() > 1e3) {
                return None;
            }
            if step.iter().all(|x| x.abs() < 1e-13) {
                return Some(natural);
            }
        }
        // Round-off keeps the step above the bound where coordinates are far from the origin.
        (self.kind.excess(natural) < 1.0).then_some(natural)
    }
}

/// Shares of the corners of a face, oint N_a n dA and oint N_a dA: thirds of a triangle; the exact
/// integral over a bilinear quadrilateral.
fn shares(corners: [u32; 4], positions: &[[f64; 3]]) -> [Share; 4] {
    let x = corners.map(|n| match n {
        NONE => [0.0; 3],
        n => positions[n as usize],
    });
    let mut shares = corners.map(|particle| Share {
        particle,
        vector: [0.0; 3],
        area: 0.0,
    });
    let length = |v: [f64; 3]| dot(v, v).sqrt();
    if corners[3] == NONE {
        let vector = scale3(1.0 / 6.0, cross(sub3(x[1], x[0]), sub3(x[2], x[0])));
        for share in &mut shares[..3] {
            share.vector = vector;
            share.area = length(vector);
        }
        return shares;
    }
    for u in GAUSS {
        for v in GAUSS {
            let along = |p: usize, q: usize, r: usize, s: usize, w: f64| {
                let lower = scale3(1.0 - w, sub3(x[q], x[p]));
                axpy3(lower, w, sub3(x[s], x[r]))
            };
            let vector = scale3(0.25, cross(along(0, 1, 3, 2, v), along(0, 3, 1, 2, u)));
            let n = [(1.0 - u) * (1.0 - v), u * (1.0 - v), u * v, (1.0 - u) * v];
            for (share, n) in shares.iter_mut().zip(n) {
                share.vector = axpy3(share.vector, n, vector);
                share.area += n * length(vector);
            }
        }
    }
    shares
}

/// Nodes, cells and named faces, before they become particles.
pub(super) struct Grid {
    /// X [m], in the caller's order.
    pub nodes: Vec<[f64; 3]>,
    /// Cells between the nodes.
    pub cells: Vec<Cell>,
    /// Names of parts of the surface.
    pub names: Vec<String>,
    /// Faces of those parts with the index of the name; the fourth corner is `NONE` in a triangle.
    pub named: Vec<([u32; 4], u32)>,
    /// The body's order: the nodes as they follow each other in memory; by default one that keeps
    /// the nodes of a cell close.
    pub numbering: Option<Vec<u32>>,
}

impl From<&MeshFile> for Grid {
    fn from(file: &MeshFile) -> Self {
        Self {
            nodes: file.nodes.clone(),
            cells: file.cells.clone(),
            names: file.names.clone(),
            named: file.named.clone(),
            numbering: None,
        }
    }
}

impl Particles {
    /// The nodes of a grid as particles.
    ///
    /// # Errors
    /// [`Code::InvalidScene`] for a cell that is inverted or flat, a face of more than two cells, or
    /// a patch that selects no particle; [`Code::OutOfMemory`].
    pub(super) fn of_grid(
        grid: Grid,
        selections: &BTreeMap<String, PatchSelection>,
    ) -> Result<Self> {
        if grid.nodes.len() >= i32::MAX as usize || grid.cells.len() >= i32::MAX as usize {
            return Err(Error::new(
                Code::OutOfMemory,
                format!(
                    "the mesh has {} nodes and {} cells, at most 2.1e9 are possible: coarsen it",
                    grid.nodes.len(),
                    grid.cells.len()
                ),
            )
            .at_path("geometry"));
        }
        let order = grid
            .numbering
            .unwrap_or_else(|| reverse_cuthill_mckee(grid.nodes.len(), &grid.cells));
        let mut rank = vec![NONE; order.len()];
        for (body, &caller) in order.iter().enumerate() {
            rank[caller as usize] = body as u32;
        }
        let renumber = |node: u32| match node {
            NONE => NONE,
            node => rank[node as usize],
        };
        let positions: Vec<[f64; 3]> = order.iter().map(|&c| grid.nodes[c as usize]).collect();
        let mut cells = grid.cells;
        for cell in &mut cells {
            cell.renumber(|n| rank[n as usize]);
        }
        check_shapes(&cells, &positions)?;
        let mut volumes = vec![0.0; positions.len()];
        let shares = parallel::fill(cells.len(), |c| cells[c].volumes(&positions));
        for (cell, shares) in cells.iter().zip(shares) {
            for (node, v) in cell.nodes().iter().zip(shares) {
                volumes[*node as usize] += v;
            }
        }
        let named = grid
            .named
            .into_iter()
            .map(|(corners, name)| (corners.map(renumber), name));
        let faces = boundary_faces(&cells, &positions, named.collect())?;
        let mesh = Mesh::new(cells, positions.len());
        Ok(Self {
            surface: surface(&faces, positions.len()),
            patches: patches(&faces, &grid.names, selections)?,
            positions,
            volumes,
            order,
            rank,
            shape: Shape::Mesh(mesh),
        })
    }
}

/// Below this a cell has no volume but for round-off.
pub(super) const FLAT: f64 = 1e-12;

fn check_shapes(cells: &[Cell], positions: &[[f64; 3]]) -> Result<()> {
    let good = parallel::fill(cells.len(), |c| cells[c].shape_measure(positions) > FLAT);
    match good.iter().position(|good| !good) {
        None => Ok(()),
        Some(i) => {
            let [x, y, z] = positions[cells[i].nodes[0] as usize];
            Err(Error::scene(
                "geometry",
                format!(
                    "cell {i} at ({x:.6}, {y:.6}, {z:.6}) m is inverted or flat: use less jitter, \
                     or more even divisions"
                ),
            ))
        }
    }
}

/// A face's corners in ascending order: the same from both sides.
pub(super) fn face_key(mut corners: [u32; 4]) -> [u32; 4] {
    corners.sort_unstable();
    corners
}

/// The faces of one cell only, in the order of the cells.
fn boundary_faces(
    cells: &[Cell],
    positions: &[[f64; 3]],
    named: Vec<([u32; 4], u32)>,
) -> Result<Vec<Face>> {
    let mut named: Vec<_> = named.into_iter().map(|(f, n)| (face_key(f), n)).collect();
    named.sort_unstable();
    named.dedup();
    let mut all: Vec<([u32; 4], u32, u8)> = cells
        .iter()
        .enumerate()
        .flat_map(|(c, cell)| {
            let keys = cell.faces().enumerate();
            keys.map(move |(f, corners)| (face_key(corners), c as u32, f as u8))
        })
        .collect();
    all.sort_unstable();
    let mut exposed = Vec::new();
    for group in all.chunk_by(|a, b| a.0 == b.0) {
        match group {
            [(_, cell, face)] => exposed.push((*cell, *face)),
            [] | [_, _] => {}
            [(key, ..), ..] => {
                let [x, y, z] = positions[key[0] as usize];
                return Err(Error::scene(
                    "geometry",
                    format!(
                        "{} cells share the face at ({x:.6}, {y:.6}, {z:.6}) m: cells overlap; \
                         mesh the body again without duplicates",
                        group.len()
                    ),
                ));
            }
        }
    }
    exposed.sort_unstable();
    Ok(exposed
        .into_iter()
        .map(|(cell, face)| {
            let corners = cells[cell as usize]
                .faces()
                .nth(usize::from(face))
                .expect("a face of this cell");
            let key = face_key(corners);
            let first = named.partition_point(|(k, _)| *k < key);
            let names = named[first..].iter().take_while(|(k, _)| *k == key);
            let real = corners.iter().filter(|n| **n != NONE);
            let count = real.clone().count() as f64;
            let sum = real.fold([0.0; 3], |s, n| add3(s, positions[*n as usize]));
            Face {
                names: names.map(|(_, n)| *n).collect(),
                centre: scale3(1.0 / count, sum),
                shares: shares(corners, positions),
            }
        })
        .collect())
}

impl Mesh {
    fn new(cells: Vec<Cell>, particles: usize) -> Self {
        let (start, of_particle) = cells_of_nodes(particles, &cells);
        Self {
            cells,
            start,
            of_particle,
        }
    }

    /// Cells of a particle, ascending.
    pub fn cells_of(&self, particle: usize) -> impl Iterator<Item = &Cell> {
        let range = self.start[particle] as usize..self.start[particle + 1] as usize;
        self.of_particle[range]
            .iter()
            .map(|c| &self.cells[*c as usize])
    }

    /// The mesh's own operators: what a cell adds to the pseudo-areas C_ab = 2 int N_a grad N_b dV
    /// [m^2] of its corners, by the places of a and b in [`Cell::nodes`]. The sums satisfy closure,
    /// sum_b (C_ab - C_ba)/2 = -A_a N_a, and completeness, sum_b C_ab (x) (X_b - X_a) = 2 V_a I, up
    /// to round-off; on tetrahedra they are the dual areas sum V_T/2 grad N_b.
    pub fn cell_operators(cell: &Cell, positions: &[[f64; 3]]) -> [[[f64; 3]; 8]; 8] {
        let mut c = [[[0.0; 3]; 8]; 8];
        let corners = cell.kind.corners();
        for (at, weight) in cell.kind.quadrature() {
            let at = cell.kind.shape_functions(at);
            // det J grad N_b = cof J grad_r N_b.
            let cof = cofactor(&cell.jacobian(&at, positions));
            for b in 0..corners {
                let gradient = scale3(2.0 * weight, mat_vec(&cof, at.1[b]));
                for a in 0..corners {
                    c[a][b] = axpy3(c[a][b], at.0[a], gradient);
                }
            }
        }
        c
    }

    /// Share of the full solid angle that the cells of each particle fill: 1 inside, 1/2 on a flat
    /// part of the surface.
    pub fn solid_angles(&self, positions: &[[f64; 3]]) -> Vec<f64> {
        let shares = parallel::fill(self.cells.len(), |cell| {
            let cell = &self.cells[cell];
            let mut shares = [0.0; 8];
            for (corner, &node) in cell.nodes().iter().enumerate() {
                let x = positions[node as usize];
                let [a, b, c] = cell.kind.edges_at(corner).map(|other| {
                    let r = sub3(positions[cell.nodes[other] as usize], x);
                    scale3(1.0 / dot(r, r).sqrt(), r)
                });
                // Van Oosterom and Strackee (1983).
                let volume = dot(a, cross(b, c)).abs();
                let angle = volume.atan2(1.0 + dot(a, b) + dot(b, c) + dot(c, a));
                shares[corner] = angle / (2.0 * std::f64::consts::PI);
            }
            shares
        });
        let mut angles = vec![0.0; positions.len()];
        for (cell, shares) in self.cells.iter().zip(shares) {
            for (node, share) in cell.nodes().iter().zip(shares) {
                angles[*node as usize] += share;
            }
        }
        angles
    }

    /// Particles that share an edge, a face or a cell with a particle, ascending.
    pub fn neighbours(&self, particle: u32, sharing: Sharing) -> Vec<u32> {
        let mut list = Vec::new();
        for cell in self.cells_of(particle as usize) {
            match sharing {
                Sharing::Cell => list.extend(cell.nodes()),
                Sharing::Face => {
                    for face in cell.faces().filter(|f| f.contains(&particle)) {
                        list.extend(face.into_iter().filter(|n| *n != NONE));
                    }
                }
                Sharing::Edge => {
                    for face in cell.kind.faces() {
                        let corners = face.len();
                        for i in 0..corners {
                            if cell.nodes[face[i]] == particle {
                                list.push(cell.nodes[face[(i + 1) % corners]]);
                                list.push(cell.nodes[face[(i + corners - 1) % corners]]);
                            }
                        }
                    }
                }
            }
        }
        list.sort_unstable();
        list.dedup();
        list.retain(|n| *n != particle);
        list
    }

    /// Numbers and sizes of the cells.
    pub fn summary(&self, positions: &[[f64; 3]]) -> MeshSummary {
        let mut summary = MeshSummary {
            cells: Vec::new(),
            cell_volume: (f64::INFINITY, 0.0),
            shortest_edge: f64::INFINITY,
            notes: Vec::new(),
        };
        for kind in [CellKind::Tetrahedron, CellKind::Prism, CellKind::Hexahedron] {
            let count = self.cells.iter().filter(|c| c.kind == kind).count();
            if count > 0 {
                summary.cells.push((kind.plural(), count));
            }
        }
        for cell in &self.cells {
            let volume: f64 = cell.volumes(positions).iter().sum();
            let (least, most) = &mut summary.cell_volume;
            (*least, *most) = (least.min(volume), most.max(volume));
            for face in cell.kind.faces() {
                for (i, a) in face.iter().enumerate() {
                    let b = face[(i + 1) % face.len()];
                    let [x, y] = [*a, b].map(|n| positions[cell.nodes[n] as usize]);
                    let edge = dot(sub3(x, y), sub3(x, y)).sqrt();
                    summary.shortest_edge = summary.shortest_edge.min(edge);
                }
            }
        }
        summary
    }

    /// Interpolation with the shape functions of the cell that a point lies in.
    pub fn interpolation(
        &self,
        positions: &[[f64; 3]],
        point: [f64; 3],
    ) -> Option<Vec<(u32, f64)>> {
        /// Of a cell's size: coordinates that were rounded to decimal places still lie inside.
        const SLACK: f64 = 1e-6;
        let mut best: Option<(f64, &Cell, [f64; 3])> = None;
        for cell in &self.cells {
            let corners = || cell.nodes().iter().map(|n| positions[*n as usize]);
            let bound = |a: usize| {
                let least = corners().map(|x| x[a]).fold(f64::INFINITY, f64::min);
                let most = corners().map(|x| x[a]).fold(f64::NEG_INFINITY, f64::max);
                (least, most)
            };
            let bounds = [bound(0), bound(1), bound(2)];
            let size = bounds.iter().map(|(l, m)| m - l).fold(0.0, f64::max);
            let near = |a: usize| {
                let (least, most) = bounds[a];
                (least - SLACK * size..=most + SLACK * size).contains(&point[a])
            };
            if !(0..3).all(near) {
                continue;
            }
            if let Some(natural) = cell.locate(positions, point) {
                let excess = cell.kind.excess(natural);
                if excess <= SLACK && best.is_none_or(|(least, ..)| excess < least) {
                    best = Some((excess, cell, natural));
                }
            }
        }
        let (_, cell, natural) = best?;
        let (n, _) = cell.kind.shape_functions(natural);
        // What a point on a face, an edge or a corner would read beyond it is round-off.
        let weights = cell.nodes().iter().zip(n).filter(|(_, n)| *n > SLACK);
        let sum: f64 = weights.clone().map(|(_, n)| n).sum();
        Some(weights.map(|(node, n)| (*node, n / sum)).collect())
    }
}

/// Numbers and sizes of the cells of a mesh, and what its reader has to say.
#[derive(Debug, Clone, PartialEq)]
pub struct MeshSummary {
    /// Kinds of cells that there are, in the plural, and how many.
    pub cells: Vec<(&'static str, usize)>,
    /// Volume of the smallest and of the largest cell [m^3].
    pub cell_volume: (f64, f64),
    /// Length of the shortest edge [m].
    pub shortest_edge: f64,
    /// What of a mesh file was left out or changed, one line each.
    pub notes: Vec<String>,
}

/// What neighbours have in common.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sharing {
    /// An edge of a cell.
    Edge,
    /// A face of a cell.
    Face,
    /// A cell.
    Cell,
}

/// Cells by node: first entries, and the cells.
fn cells_of_nodes(nodes: usize, cells: &[Cell]) -> (Vec<u32>, Vec<u32>) {
    let mut start = vec![0u32; nodes + 1];
    for node in cells.iter().flat_map(Cell::nodes) {
        start[*node as usize + 1] += 1;
    }
    for i in 0..nodes {
        start[i + 1] += start[i];
    }
    let mut next = start.clone();
    let mut of_node = vec![0u32; start[nodes] as usize];
    for (c, cell) in cells.iter().enumerate() {
        for node in cell.nodes() {
            let at = &mut next[*node as usize];
            of_node[*at as usize] = c as u32;
            *at += 1;
        }
    }
    (start, of_node)
}

/// Nodes in an order that keeps those of a cell close: reverse Cuthill-McKee over the cells.
fn reverse_cuthill_mckee(nodes: usize, cells: &[Cell]) -> Vec<u32> {
    let (start, of_node) = cells_of_nodes(nodes, cells);
    let degree = |n: u32| start[n as usize + 1] - start[n as usize];
    // Breadth first from a node, fewer cells first.
    let spread = |from: u32, seen: &mut [bool], out: &mut Vec<u32>| {
        let first = out.len();
        out.push(from);
        seen[from as usize] = true;
        let mut at = first;
        let mut next = Vec::new();
        while at < out.len() {
            let n = out[at] as usize;
            for c in &of_node[start[n] as usize..start[n + 1] as usize] {
                for &m in cells[*c as usize].nodes() {
                    if !std::mem::replace(&mut seen[m as usize], true) {
                        next.push(m);
                    }
                }
            }
            next.sort_unstable_by_key(|m| (degree(*m), *m));
            out.append(&mut next);
            at += 1;
        }
    };
    let mut seen = vec![false; nodes];
    let mut order = Vec::with_capacity(nodes);
    for from in 0..nodes as u32 {
        if seen[from as usize] {
            continue;
        }
        // From an end of the part: the node that is reached last.
        let first = order.len();
        spread(from, &mut seen, &mut order);
        let end = order[order.len() - 1];
        for n in order.drain(first..) {
            seen[n as usize] = false;
        }
        spread(end, &mut seen, &mut order);
    }
    order.reverse();
    order
}
