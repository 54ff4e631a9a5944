//! Coarse levels that precondition the conjugate gradients of the closure repair.
//!
//! The operator of the repair has the energy
//! v A v = 1/2 sum_a min_g sum_b w_ab (v_b - v_a - g r_ab)^2: that of a plate. Affine fields cost
//! nothing and waves of length l as l^-4, so that its diagonal alone leaves (L/h)^2 iterations to a
//! body of length L. Here each of some levels adds its share, as in the preconditioner of Bramble,
//! Pasciak and Xu (Math. Comp. 55, 1990):
//!
//! M^-1 = diag(A)^-1 + sum_l P_l diag(A_l)^-1 P_l^T + P_c A_c^-1 P_c^T
//!
//! with P_l from tensor-product quadratic B-splines, smooth enough for their curvatures to have an
//! energy, on nested grids of 2, 4, 8, .. spacings of the particles. The iterations then hardly grow
//! with the body. Only splines that see a particle exist: a bent or a hollow body costs no more than a
//! full one. A_l is the energy of the splines' curvatures, K_a (grad grad v)^2 with K_a from the second
//! moments of the distances of the neighbours, lumped in the cells of the next finer grid: near enough
//! to precondition, and cheaper than one product with A.

use nalgebra::{Cholesky, DMatrix};

use super::repair::Problem;
use crate::lane::{Lane, Work, vectorised};
use crate::layout::{Array, Layout};
use crate::parallel;

/// Edge of the finest cells over the particles' spacing.
const CELL: f64 = 2.0;
/// Most splines of the coarsest grid: its matrix is dense.
const MOST: usize = 600;
/// Bodies of fewer particles need no coarse levels: some 60 iterations without.
const FEWEST: usize = 100;
/// Energy of a curvature over that of the neighbours' second moments: 1/8 of the fourth moment, over
/// its ratio to the square of the second, less the affine share; measured on jittered lattices.
const STIFFNESS: f64 = 1.0 / 6.0;
/// Share of the levels with a diagonal: neighbouring splines overlap. Least iterations of 0.3 to 1.
const SHARE: f64 = 0.6;
/// Keeps the coarsest matrix regular, over its diagonal: its kernel has the affine fields and splines
/// that few particles tell apart.
const SHIFT: f64 = 1e-8;

/// Place in a grid, the longest axis of the body first. Cell c has the splines c, c + 1 and c + 2.
type Place = [u32; 3];
/// A coefficient of each component, and one number to fill a vector.
type Value = [f64; 4];

/// Box and cells of the finest grid, axes in the order of [`Place`].
#[derive(Clone, Copy)]
struct Frame {
    axes: [usize; 3],
    low: [f64; 3],
    edge: [f64; 3],
    per_edge: [f64; 3],
}

/// A cell that has particles.
#[derive(Clone, Copy)]
struct Cell {
    place: Place,
    /// First of three splines in a row, for each of the 9 rows that the cell sees.
    rows: [u32; 9],
}

/// Cells in a plane across the longest axis, and the splines that they see.
struct Plane {
    colour: u32,
    cells: std::ops::Range<usize>,
    splines: std::ops::Range<usize>,
}

/// Transfer between the particles and the finest grid.
struct Finest<'a> {
    x: [&'a [f64]; 3],
    frame: Frame,
    cells: Vec<Cell>,
    planes: Vec<Plane>,
    /// Slots of the particles of all cells, and where those of each cell begin.
    slots: Vec<u32>,
    start: Vec<u32>,
    /// Cell of each particle.
    cell_of: Vec<u32>,
}

/// Splines of a grid that are a sum of those of the next finer one.
struct Level {
    /// Share of the inverse of the diagonal; empty on the coarsest grid.
    inverse: Vec<f64>,
    /// Where each spline appears in the next coarser grid; empty on the coarsest grid.
    parents: Vec<Parents>,
    /// Coefficients.
    values: Vec<Value>,
}

/// The eight splines of the coarser grid that have a share of a spline, by four rows of two.
#[derive(Clone, Copy)]
struct Parents {
    rows: [u32; 4],
    odd: [bool; 3],
}

/// The coarsest grid, solved but for affine fields.
struct Coarsest {
    /// Lower triangle of Cholesky's factor.
    factor: DMatrix<f64>,
    /// The affine fields, orthogonal by D, and D times them.
    affine: [Vec<f64>; 4],
    dual: [Vec<f64>; 4],
}

/// All levels.
pub struct Levels<'a> {
    finest: Finest<'a>,
    levels: Vec<Level>,
    coarsest: Coarsest,
}

/// Where the energy of the particles of a cell is lumped.
struct Point {
    cell: Place,
    x: [f64; 3],
    /// K: xx, yy, zz, xy, xz, yz.
    stiffness: [f64; 6],
}

impl<'a> Levels<'a> {
    /// Levels for a system; `None` for a body too small to need them.
    pub fn new(problem: &Problem<'a>) -> Option<Self> {
        if problem.layout.particles < FEWEST {
            return None;
        }
        let moments = moments(problem);
        let frame = Frame::new(problem, &moments);
        let (finest, mut splines) = Finest::new(problem, frame);
        let mut points = finest.points(problem, &moments);
        drop(moments);
        let mut levels = Vec::new();
        let mut edge = frame.edge;
        loop {
            let count = splines.len();
            let values = vec![[0.0; 4]; count];
            if !levels.is_empty() && count <= MOST {
                let coarsest = Coarsest::new(frame.low, edge, &points, &splines)?;
                let (inverse, parents) = (Vec::new(), Vec::new());
                levels.push(Level {
                    inverse,
                    parents,
                    values,
                });
                return Some(Self {
                    finest,
                    levels,
                    coarsest,
                });
            }
            let inverse = inverse_diagonal(frame.low, edge, &points, &splines);
            points = lumped(points);
            for point in &mut points {
                point.cell = point.cell.map(|c| c / 2);
            }
            edge = edge.map(|h| 2.0 * h);
            let coarser = widened(splines.iter().map(|s| s.map(|i| i / 2)).collect(), 2);
            let parents = parallel::fill(count, |s| Parents::new(splines[s], &coarser));
            levels.push(Level {
                inverse,
                parents,
                values,
            });
            splines = coarser;
        }
    }

    /// What the levels make of a residual: all of M^-1 but the particles' diagonal; the products of
    /// both by component.
    pub fn correct(&mut self, residual: &Array<3>, correction: &mut Array<3>) -> [f64; 3] {
        self.finest.restrict(residual, &mut self.levels[0].values);
        let last = self.levels.len() - 1;
        for l in 0..last {
            let (fine, coarse) = self.levels.split_at_mut(l + 1);
            fine[l].restrict(&mut coarse[0].values);
        }
        self.coarsest.solve(&mut self.levels[last].values);
        for l in (0..last).rev() {
            let (fine, coarse) = self.levels.split_at_mut(l + 1);
            fine[l].correct(&coarse[0].values);
        }
        self.finest
            .prolong(&self.levels[0].values, residual, correction)
    }
}

/// Square roots of the neighbours' weights times the second moments of their distances, by axis:
/// sum_b w r_i^2 / sqrt(sum_b w).
fn moments(problem: &Problem) -> Vec<[f64; 3]> {
    parallel::fill(problem.layout.particles, |i| {
        let a = Layout::slot(i);
        let (mut degree, mut squares) = (0.0, [0.0; 3]);
        for (b, pair) in problem.slices.of(a) {
            let w = problem.weights[pair];
            if w != 0.0 {
                degree += w;
                for (s, x) in squares.iter_mut().zip(problem.x) {
                    *s += w * (x[b] - x[a]).powi(2);
                }
            }
        }
        squares.map(|s| s / degree.sqrt())
    })
}

/// Places and those up to `width - 1` further along each axis, ascending.
fn widened(mut places: Vec<Place>, width: u32) -> Vec<Place> {
    places.sort_unstable();
    places.dedup();
    for axis in (0..3).rev() {
        let one = std::mem::take(&mut places);
        for place in one {
            for step in 0..width {
                let mut next = place;
                next[axis] += step;
                places.push(next);
            }
        }
        places.sort_unstable();
        places.dedup();
    }
    places
}

/// Index of a spline, there by construction.
fn find(splines: &[Place], place: Place) -> u32 {
    splines.binary_search(&place).expect("made for its cell") as u32
}

/// First splines of the rows of a cell.
fn rows_of(splines: &[Place], cell: Place) -> [u32; 9] {
    let [i, j, k] = cell;
    std::array::from_fn(|row| find(splines, [i + row as u32 / 3, j + row as u32 % 3, k]))
}

/// The quadratic B-splines of a cell.
#[inline(always)]
fn spline(t: f64) -> [f64; 3] {
    let s = 1.0 - t;
    [0.5 * s * s, 0.5 + t * s, 0.5 * t * t]
}

/// Points of equal cells as one.
fn lumped(mut points: Vec<Point>) -> Vec<Point> {
    points.sort_by_key(|p| p.cell);
    let mut all: Vec<Point> = Vec::new();
    for next in points {
        match all.last_mut() {
            Some(point) if point.cell == next.cell => {
                let (own, other) = (point.weight(), next.weight());
                for (x, y) in point.x.iter_mut().zip(next.x) {
                    *x = (own * *x + other * y) / (own + other);
                }
                for (k, l) in point.stiffness.iter_mut().zip(next.stiffness) {
                    *k += l;
                }
            }
            _ => all.push(next),
        }
    }
    all
}

impl Point {
    fn weight(&self) -> f64 {
        self.stiffness[..3].iter().sum()
    }

    /// Second derivatives of the 27 splines of the point's cell: xx, yy, zz, xy, xz, yz.
    fn curvatures(&self, low: [f64; 3], edge: [f64; 3]) -> [[f64; 6]; 27] {
        let of: [[[f64; 3]; 3]; 3] = std::array::from_fn(|d| {
            let h = edge[d];
            // Round-off may place it a hair outside.
            let t = ((self.x[d] - low[d]) / h - f64::from(self.cell[d])).clamp(0.0, 1.0);
            [
                spline(t),
                [t - 1.0, 1.0 - 2.0 * t, t].map(|v| v / h),
                [1.0, -2.0, 1.0].map(|v| v / (h * h)),
            ]
        });
        std::array::from_fn(|s| {
            let at = [s / 9, s / 3 % 3, s % 3];
            let product =
                |orders: [usize; 3]| -> f64 { (0..3).map(|d| of[d][orders[d]][at[d]]).product() };
            [
                product([2, 0, 0]),
                product([0, 2, 0]),
                product([0, 0, 2]),
                product([1, 1, 0]),
                product([1, 0, 1]),
                product([0, 1, 1]),
            ]
        })
    }

    fn splines(&self, splines: &[Place]) -> [usize; 27] {
        let rows = rows_of(splines, self.cell);
        std::array::from_fn(|s| rows[s / 3] as usize + s % 3)
    }

    fn energy(&self, one: &[f64; 6], other: &[f64; 6]) -> f64 {
        (0..6).map(|q| self.stiffness[q] * one[q] * other[q]).sum()
    }
}

/// Share of the inverse of the diagonal; 0 for splines that no point sees.
fn inverse_diagonal(
    low: [f64; 3],
    edge: [f64; 3],
    points: &[Point],
    splines: &[Place],
) -> Vec<f64> {
    let mut diagonal = vec![0.0; splines.len()];
    for point in points {
        let curvatures = point.curvatures(low, edge);
        for (s, c) in point.splines(splines).into_iter().zip(&curvatures) {
            diagonal[s] += point.energy(c, c);
        }
    }
    let inverse = |d: f64| if d > 0.0 { SHARE / d } else { 0.0 };
    diagonal.into_iter().map(inverse).collect()
}

impl Frame {
    fn new(problem: &Problem, moments: &[[f64; 3]]) -> Self {
        let inside = Layout::FIRST..Layout::FIRST + problem.layout.particles;
        let bounds = problem.x.map(|x| {
            x[inside.clone()]
                .iter()
                .fold((f64::MAX, f64::MIN), |(l, h), v| (l.min(*v), h.max(*v)))
        });
        let volume: f64 = problem.volume[inside.clone()].iter().sum();
        let spacing = (volume / problem.layout.particles as f64).cbrt();
        // Cells as slender as the particles' distances.
        let mut distance = [0.0; 3];
        for moment in moments {
            for (d, m) in distance.iter_mut().zip(moment) {
                *d += m;
            }
        }
        let distance = distance.map(f64::sqrt);
        let mean = distance.iter().product::<f64>().cbrt();
        let edge = distance.map(|d| CELL * spacing * d / mean);
        let mut axes = [0, 1, 2];
        let cells = |d: usize| (bounds[d].1 - bounds[d].0) / edge[d];
        axes.sort_by(|&c, &d| cells(d).total_cmp(&cells(c)));
        Self {
            axes,
            low: axes.map(|d| bounds[d].0),
            edge: axes.map(|d| edge[d]),
            per_edge: axes.map(|d| 1.0 / edge[d]),
        }
    }

    /// Position of a slot in the grid [edges].
    #[inline(always)]
    fn place(&self, x: &[&[f64]; 3], slot: usize) -> [f64; 3] {
        std::array::from_fn(|d| (x[self.axes[d]][slot] - self.low[d]) * self.per_edge[d])
    }
}

impl<'a> Finest<'a> {
    /// The transfer and the splines.
    fn new(problem: &Problem<'a>, frame: Frame) -> (Self, Vec<Place>) {
        let particles = problem.layout.particles;
        /// Far beyond any body of particles that are neighbours, and no overflow.
        const FARTHEST: f64 = 1e9;
        let place = |i| {
            let place = frame.place(&problem.x, Layout::slot(i));
            place.map(|u| u.min(FARTHEST) as u32)
        };
        let places: Vec<Place> = parallel::fill(particles, place);
        let mut order: Vec<u32> = (0..particles as u32).collect();
        order.sort_unstable_by_key(|&i| (places[i as usize], i));
        let (mut occupied, mut start) = (Vec::new(), Vec::new());
        let mut cell_of = vec![0; particles];
        for (at, &i) in order.iter().enumerate() {
            let place = places[i as usize];
            if occupied.last() != Some(&place) {
                occupied.push(place);
                start.push(at as u32);
            }
            cell_of[i as usize] = occupied.len() as u32 - 1;
        }
        start.push(particles as u32);
        drop(places);
        let splines = widened(occupied.clone(), 3);
        let cells: Vec<Cell> = parallel::fill(occupied.len(), |c| Cell {
            place: occupied[c],
            rows: rows_of(&splines, occupied[c]),
        });
        let mut planes = Vec::new();
        let mut first = 0;
        for plane in occupied.chunk_by(|p, q| p[0] == q[0]) {
            let at = plane[0][0];
            let from = |i: u32| splines.partition_point(|s| s[0] < i);
            planes.push(Plane {
                colour: at % 3,
                cells: first..first + plane.len(),
                splines: from(at)..from(at + 3),
            });
            first += plane.len();
        }
        for i in &mut order {
            *i = Layout::slot(*i as usize) as u32;
        }
        let this = Self {
            x: problem.x,
            frame,
            cells,
            planes,
            slots: order,
            start,
            cell_of,
        };
        (this, splines)
    }

    /// The splines of a cell at a particle, by axis.
    #[inline(always)]
    fn splines_at(&self, cell: &Cell, slot: usize) -> [[f64; 3]; 3] {
        let place = self.frame.place(&self.x, slot);
        std::array::from_fn(|d| spline(place[d] - f64::from(cell.place[d])))
    }

    fn slots(&self, cell: usize) -> &[u32] {
        &self.slots[self.start[cell] as usize..self.start[cell + 1] as usize]
    }

    /// The energy of the particles of each cell.
    fn points(&self, problem: &Problem, moments: &[[f64; 3]]) -> Vec<Point> {
        parallel::fill(self.cells.len(), |c| {
            let (mut x, mut stiffness, mut total) = ([0.0; 3], [0.0; 6], 0.0);
            for &slot in self.slots(c) {
                let slot = slot as usize;
                let moment = moments[slot - Layout::FIRST];
                let m: [f64; 3] = self.frame.axes.map(|d| moment[d]);
                let weight = m[0] * m[0] + m[1] * m[1] + m[2] * m[2];
                total += weight;
                for d in 0..3 {
                    x[d] += weight * problem.x[self.frame.axes[d]][slot];
                    stiffness[d] += STIFFNESS * m[d] * m[d];
                }
                for (k, (d, e)) in stiffness[3..].iter_mut().zip([(0, 1), (0, 2), (1, 2)]) {
                    *k += STIFFNESS * 2.0 * m[d] * m[e];
                }
            }
            Point {
                cell: self.cells[c].place,
                x: x.map(|x| x / total),
                stiffness,
            }
        })
    }

    /// P^T r. Planes of one colour share no spline.
    fn restrict(&self, residual: &Array<3>, values: &mut [Value]) {
        values.fill([0.0; 4]);
        for colour in 0..3 {
            let (mut rest, mut done) = (&mut *values, 0);
            let mut pieces = Vec::new();
            for plane in self.planes.iter().filter(|p| p.colour == colour) {
                let (_, after) = rest.split_at_mut(plane.splines.start - done);
                let (piece, after) = after.split_at_mut(plane.splines.len());
                (rest, done) = (after, plane.splines.end);
                pieces.push((plane, piece));
            }
            parallel::map_slabs(pieces, |_, (plane, values)| {
                vectorised(Restrict {
                    finest: self,
                    residual,
                    plane,
                    values,
                });
            });
        }
    }

    /// P v, and its products with the residual.
    fn prolong(
        &self,
        values: &[Value],
        residual: &Array<3>,
        correction: &mut Array<3>,
    ) -> [f64; 3] {
        let parts = parallel::map_slabs(correction.slabs_mut(), |slab, out| {
            vectorised(Prolong {
                finest: self,
                values,
                residual,
                slab,
                out,
            })
        });
        let mut sum = [0.0; 3];
        for part in parts {
            for (s, p) in sum.iter_mut().zip(part) {
                *s += p;
            }
        }
        sum
    }
}

/// P^T r of the cells of a plane.
struct Restrict<'a, 'o> {
    finest: &'a Finest<'a>,
    residual: &'a Array<3>,
    plane: &'a Plane,
    values: &'o mut [Value],
}

impl Work for Restrict<'_, '_> {
    type Output = ();
    /// The lanes are the splines of a row and the components.
    #[inline(always)]
    fn run<T: Lane>(self, _: T::Token) {
        let residual = self.residual.components();
        for c in self.plane.cells.clone() {
            let cell = &self.finest.cells[c];
            let mut sums = [[0.0; 12]; 9];
            for &slot in self.finest.slots(c) {
                let slot = slot as usize;
                let [first, second, third] = self.finest.splines_at(cell, slot);
                let mut row = [0.0; 12];
                for k in 0..3 {
                    for c in 0..3 {
                        row[4 * k + c] = third[k] * residual[c][slot];
                    }
                }
                for i in 0..3 {
                    for j in 0..3 {
                        let w = first[i] * second[j];
                        for (s, r) in sums[3 * i + j].iter_mut().zip(&row) {
                            *s += w * r;
                        }
                    }
                }
            }
            for (row, sums) in cell.rows.iter().zip(&sums) {
                let at = *row as usize - self.plane.splines.start;
                let values = self.values[at..at + 3].as_flattened_mut();
                for (v, s) in values.iter_mut().zip(sums) {
                    *v += s;
                }
            }
        }
    }
}

/// P v of a slab, and its products with the residual by component.
struct Prolong<'a, 'o> {
    finest: &'a Finest<'a>,
    values: &'a [Value],
    residual: &'a Array<3>,
    slab: usize,
    out: [&'o mut [f64]; 3],
}

impl Work for Prolong<'_, '_> {
    type Output = [f64; 3];
    #[inline(always)]
    fn run<T: Lane>(self, _: T::Token) -> [f64; 3] {
        let residual = self.residual.components();
        let layout = self.residual.layout();
        let (from, slots) = layout.slab_range(self.slab);
        let to = (from + slots).min(Layout::slot(layout.particles));
        let mut products = [0.0; 3];
        for slot in from..to {
            let cell = &self.finest.cells[self.finest.cell_of[slot - Layout::FIRST] as usize];
            let [first, second, third] = self.finest.splines_at(cell, slot);
            let mut row = [0.0; 12];
            for i in 0..3 {
                for j in 0..3 {
                    let w = first[i] * second[j];
                    let at = cell.rows[3 * i + j] as usize;
                    let values = self.values[at..at + 3].as_flattened();
                    for (r, v) in row.iter_mut().zip(values) {
                        *r += w * v;
                    }
                }
            }
            for c in 0..3 {
                let value = third[0] * row[c] + third[1] * row[4 + c] + third[2] * row[8 + c];
                self.out[c][slot - from] = value;
                products[c] += value * residual[c][slot];
            }
        }
        products
    }
}

impl Parents {
    fn new(place: Place, coarser: &[Place]) -> Self {
        let [i, j, k] = place.map(|p| p / 2);
        Self {
            rows: std::array::from_fn(|row| {
                find(coarser, [i + row as u32 / 2, j + row as u32 % 2, k])
            }),
            odd: place.map(|p| p % 2 == 1),
        }
    }

    /// The coarser splines and their shares: a spline is 1/4, 3/4, 3/4, 1/4 of four finer ones along
    /// each axis.
    #[inline(always)]
    fn shares(&self) -> [(usize, f64); 8] {
        let share = |axis: usize, further: usize| {
            if self.odd[axis] == (further == 1) {
                0.75
            } else {
                0.25
            }
        };
        std::array::from_fn(|s| {
            let (i, j, k) = (s / 4, s / 2 % 2, s % 2);
            let at = self.rows[s / 2] as usize + k;
            (at, share(0, i) * share(1, j) * share(2, k))
        })
    }
}

impl Level {
    /// To the coarser grid.
    fn restrict(&self, coarser: &mut [Value]) {
        coarser.fill([0.0; 4]);
        for (parents, value) in self.parents.iter().zip(&self.values) {
            for (at, share) in parents.shares() {
                for (c, v) in coarser[at].iter_mut().zip(value) {
                    *c += share * v;
                }
            }
        }
    }

    /// Own share of the correction, and that of the coarser grids.
    fn correct(&mut self, coarser: &[Value]) {
        let own = self.inverse.iter().zip(&self.parents);
        for (value, (inverse, parents)) in self.values.iter_mut().zip(own) {
            let mut sum = value.map(|v| inverse * v);
            for (at, share) in parents.shares() {
                for (s, c) in sum.iter_mut().zip(&coarser[at]) {
                    *s += share * c;
                }
            }
            *value = sum;
        }
    }
}

impl Coarsest {
    /// `None` where numbers are not finite.
    fn new(low: [f64; 3], edge: [f64; 3], points: &[Point], splines: &[Place]) -> Option<Self> {
        let count = splines.len();
        let mut matrix = DMatrix::<f64>::zeros(count, count);
        for point in points {
            let curvatures = point.curvatures(low, edge);
            let at = point.splines(splines);
            for (s, one) in at.iter().zip(&curvatures) {
                for (t, other) in at.iter().zip(&curvatures) {
                    matrix[(*s, *t)] += point.energy(one, other);
                }
            }
        }
        let mean = matrix.trace() / count as f64;
        let mut diagonal = vec![0.0; count];
        for (s, d) in diagonal.iter_mut().enumerate() {
            // A spline that no point sees.
            if matrix[(s, s)] == 0.0 {
                matrix[(s, s)] = mean;
            }
            *d = matrix[(s, s)];
            matrix[(s, s)] *= 1.0 + SHIFT;
        }
        let mut this = Self {
            factor: Cholesky::new(matrix)?.unpack(),
            affine: std::array::from_fn(|_| Vec::new()),
            dual: std::array::from_fn(|_| Vec::new()),
        };
        for field in 0..4 {
            // The coefficients of a coordinate are those of the splines' centres.
            let mut affine: Vec<f64> = match field {
                0 => vec![1.0; count],
                _ => splines.iter().map(|s| f64::from(s[field - 1])).collect(),
            };
            for before in 0..field {
                let share = product(&this.dual[before], &affine);
                for (a, b) in affine.iter_mut().zip(&this.affine[before]) {
                    *a -= share * b;
                }
            }
            let mut dual: Vec<f64> = affine.iter().zip(&diagonal).map(|(a, d)| a * d).collect();
            let size = product(&dual, &affine).sqrt();
            for v in affine.iter_mut().chain(&mut dual) {
                *v /= size;
            }
            (this.affine[field], this.dual[field]) = (affine, dual);
        }
        Some(this)
    }

    fn solve(&self, values: &mut [Value]) {
        // The right-hand side has affine fields by round-off alone, which the shift would blow up.
        self.project(values, &self.affine, &self.dual);
        // By columns, all components at once.
        let count = values.len();
        let columns = self.factor.as_slice().chunks_exact(count).enumerate();
        for (j, column) in columns.clone() {
            let (solved, rest) = values.split_at_mut(j + 1);
            let value = &mut solved[j];
            *value = value.map(|v| v / column[j]);
            for (r, l) in rest.iter_mut().zip(&column[j + 1..]) {
                for (r, v) in r.iter_mut().zip(*value) {
                    *r -= l * v;
                }
            }
        }
        for (j, column) in columns.rev() {
            let (value, solved) = values[j..].split_first_mut().expect("a row per column");
            for (s, l) in solved.iter().zip(&column[j + 1..]) {
                for (v, s) in value.iter_mut().zip(s) {
                    *v -= l * s;
                }
            }
            *value = value.map(|v| v / column[j]);
        }
        self.project(values, &self.dual, &self.affine);
    }

    /// v -= sum (v . test) field.
    fn project(&self, values: &mut [Value], tests: &[Vec<f64>; 4], fields: &[Vec<f64>; 4]) {
        for (test, field) in tests.iter().zip(fields) {
            let mut share = [0.0; 4];
            for (value, t) in values.iter().zip(test) {
                for (s, v) in share.iter_mut().zip(value) {
                    *s += t * v;
                }
            }
            for (value, f) in values.iter_mut().zip(field) {
                for (v, s) in value.iter_mut().zip(share) {
                    *v -= s * f;
                }
            }
        }
    }
}

fn product(one: &[f64], other: &[f64]) -> f64 {
    one.iter().zip(other).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests {
    use super::super::Reference;
    use super::super::repair::tests::defects;
    use super::*;
    use crate::neighbours::Graph;
    use crate::parallel::Pool;
    use crate::particles::Particles;
    use crate::scene::Scene;

    /// A slender box of irregular particles.
    fn bar(cells: usize, length: usize) -> (Particles, Reference) {
        let text = format!(
            r#"{{
            "geometry": {{"box": {{"min": [0, 0, 0], "max": [{cells}, {length}, {cells}], "spacing": 1,
                "jitter": {{"fraction": 0.2}}}}}},
            "material": {{"neo_hookean": {{"density": 1100, "youngs_modulus": 1.7e7, "poisson_ratio": 0.3}}}},
            "time": {{"end": 1}}
        }}"#
        );
        let scene = Scene::from_json(&text, &[]).expect("a good scene");
        let particles = Particles::new(&scene).expect("particles");
        let graph = Graph::new(&particles, scene.numerics.neighbours).expect("graph");
        let reference = Reference::new(&particles, &graph, &scene.numerics).expect("operators");
        (particles, reference)
    }

    /// Bodies that differ by 10 in length take about as many iterations, on any number of threads.
    #[test]
    fn iterations_do_not_grow_with_the_body() {
        for (cells, length) in [(4, 16), (4, 64), (4, 160), (10, 64)] {
            let on = |threads| {
                let pool = Pool::new(threads).expect("threads");
                pool.install(|| bar(cells, length))
            };
            let (particles, reference) = on(1);
            let (closure, complete) = defects(&particles, &reference);
            let one = reference.closed.expect("repaired");
            let report = one.report;
            println!(
                "{cells} x {length} x {cells}: {} iterations (60), {:.1e} open (1e-12), closure \
                 {closure:.1e} (1e-10), complete {complete:.1e} (1e-13)",
                report.iterations, report.after
            );
            assert!(report.iterations < 60 && report.after < 1e-12);
            assert!(closure < 1e-10 && complete < 1e-13);
            if length == 64 {
                for threads in [2, 3, 8] {
                    let other = on(threads).1.closed.expect("repaired");
                    assert_eq!(other.multipliers, one.multipliers);
                }
            }
        }
    }

    /// r M s = s M r and r M r > 0: restriction and prolongation are each other's transpose.
    #[test]
    fn the_preconditioner_is_symmetric_and_positive() {
        let pool = Pool::new(2).expect("threads");
        let (asymmetry, least) = pool.install(|| {
            let (_, bar) = bar(5, 40);
            let area = Array::new(bar.layout, [0.0; 3]);
            let problem = Problem {
                layout: bar.layout,
                slices: &bar.slices,
                weights: bar.slices.weights(),
                x: bar.x_initial.components(),
                volume: bar.volume.components()[0],
                area: &area,
            };
            let mut levels = Levels::new(&problem).expect("a body that is large enough");
            let vector = |frequency: f64| {
                let mut vector = Array::new(bar.layout, [0.0; 3]);
                for i in 0..bar.layout.particles {
                    let phase = frequency * i as f64;
                    vector.set(
                        Layout::slot(i),
                        [phase.sin(), phase.cos(), (3.0 * phase).sin()],
                    );
                }
                vector
            };
            let product = |one: &Array<3>, other: &Array<3>| -> f64 {
                one.flat()
                    .iter()
                    .zip(other.flat())
                    .map(|(a, b)| a * b)
                    .sum()
            };
            let (r, s) = (vector(0.37), vector(0.01));
            let mut made = [r.clone(), r.clone()];
            let [of_r, of_s] = &mut made;
            let own = levels.correct(&r, of_r).iter().sum::<f64>();
            let other = levels.correct(&s, of_s).iter().sum::<f64>();
            let scale = (own * other).sqrt();
            let asymmetry = (product(&r, of_s) - product(&s, of_r)).abs() / scale;
            let same = (product(&r, of_r) - own).abs() / own;
            println!("asymmetry {asymmetry:.1e} (1e-12), products {same:.1e} (1e-12)");
            (asymmetry.max(same), own.min(other))
        });
        assert!(asymmetry < 1e-12 && least > 0.0);
    }
}
