//! The reference configuration: graph in slices, pair vectors, corrected gradients; build and rebuild.
//!
//! All operators of [URL22] sections 4.1 and 4.2 take one form. With a pair vector g_ab and
//! L_a = (sum_b g_ab (x) (chi_b - chi_a))^-1 the corrected gradient is L_a g_ab and the pseudo-area
//! (58) is C_ab = 2 V_chi L_a g_ab; a factor common to all pairs of a particle cancels. The kernel
//! options differ in g_ab alone:
//!
//! | option | g_ab | L_a |
//! |---|---|---|
//! | #1 (49) | k r_ab | F_chi^-T (sum g (x) r)^-1 |
//! | #2 (50) | k r_ab | (sum F_chi^-T g (x) r_chi)^-1 F_chi^-T |
//! | #3 (51) | k^ r^_ab | (sum F_chi^-T g (x) r_chi)^-1 F_chi^-T |
//! | #4 (52) | k^ F_ave^-T r^_ab | (sum g (x) r_chi)^-1 |
//!
//! with r_ab = X_b - X_a, r^_ab = F_ave^-1 (chi_b - chi_a) (46), k = -W'(|r|)/|r|. Unit weights leave
//! the tributary volume out of k, which makes a uniform stress force-free inside the body; then the
//! kernel of a pair is the mean of both particles', so that k_ab = k_ba.

use crate::error::{Error, Result};
use crate::kernel;
use crate::lane::{Lane, SLICE, Slots, Work, vectorised};
use crate::layout::{Array, Layout};
use crate::math::*;
use crate::neighbours::Graph;
use crate::parallel;
use crate::particles::Particles;
use crate::scene::{Numerics, ReferenceUpdate, Weights};

/// Neighbour lists in slices: the particles of a slice share an entry for each distinct distance
/// in slots to a neighbour. On a lattice nearly every lane of an entry is used.
#[derive(Debug)]
pub struct Slices {
    /// First entry of each slice.
    start: Vec<usize>,
    /// Slot of the neighbour of the slice's first lane.
    base: Vec<u32>,
    /// k of the initial configuration per lane; 0 where a lane has no neighbour in this entry.
    weight: Vec<Slots>,
}

impl Slices {
    /// The neighbour loop: (neighbour's slot, index of the pair) for the particles in the slots
    /// from `a`, as many as the lanes are wide. Lanes without a neighbour come with weight 0.
    #[inline(always)]
    pub fn of(&self, a: usize) -> NeighboursOf<'_> {
        let (slice, lane) = ((a - Layout::FIRST) / SLICE, (a - Layout::FIRST) % SLICE);
        let entries = self.start[slice]..self.start[slice + 1];
        NeighboursOf {
            base: self.base[entries.clone()].iter(),
            pair: entries.start * SLICE + lane,
            lane,
        }
    }
    /// Weights by pair index.
    #[inline(always)]
    pub fn weights(&self) -> &[f64] {
        bytemuck::must_cast_slice(&self.weight)
    }

    fn new(graph: &Graph, layout: Layout) -> Self {
        let mut this = Self {
            start: vec![0],
            base: Vec::new(),
            weight: Vec::new(),
        };
        let mut offsets = Vec::new();
        for slice in 0..layout.slices {
            let first = slice * SLICE;
            let members = first..(first + SLICE).min(graph.count());
            offsets.clear();
            for a in members {
                offsets.extend(graph.of(a).iter().map(|&b| i64::from(b) - a as i64));
            }
            offsets.sort_unstable();
            offsets.dedup();
            // A lane of the slice has a neighbour at each offset, so the base is at most 7 slots
            // before the first particle: inside the guard.
            this.base.extend(
                offsets
                    .iter()
                    .map(|o| (Layout::slot(first) as i64 + o) as u32),
            );
            this.weight.resize(this.base.len(), Slots([0.0; SLICE]));
            this.start.push(this.base.len());
        }
        this
    }

    /// Pair index of an existing pair.
    fn entry(&self, a: usize, b: usize) -> usize {
        let (slice, lane) = (a / SLICE, a % SLICE);
        let range = self.start[slice]..self.start[slice + 1];
        let base = (Layout::slot(b) - lane) as u32;
        let at = self.base[range.clone()]
            .binary_search(&base)
            .expect("pair in its slice");
        (range.start + at) * SLICE + lane
    }
}

/// See [`Slices::of`].
pub struct NeighboursOf<'a> {
    base: std::slice::Iter<'a, u32>,
    pair: usize,
    lane: usize,
}

impl Iterator for NeighboursOf<'_> {
    type Item = (usize, usize);
    #[inline(always)]
    fn next(&mut self) -> Option<(usize, usize)> {
        let base = *self.base.next()? as usize;
        let pair = self.pair;
        self.pair += SLICE;
        Some((base + self.lane, pair))
    }
}

/// Pair vectors g_ab and g_ba of a pair.
pub trait PairVectors: Copy + Sync {
    /// What is read once per particle.
    fn centre<T: Lane>(&self, token: T::Token, a: usize) -> Vec3<T>;
    /// (g_ab, g_ba).
    fn pair<T: Lane>(&self, centre: Vec3<T>, b: usize, pair: usize) -> (Vec3<T>, Vec3<T>);
}

/// g_ab = k_ab (X_b - X_a) with k_ab = k_ba: 8 bytes a pair.
#[derive(Clone, Copy)]
pub struct Lean<'a> {
    k: &'a [f64],
    x: [&'a [f64]; 3],
}

impl PairVectors for Lean<'_> {
    #[inline(always)]
    fn centre<T: Lane>(&self, token: T::Token, a: usize) -> Vec3<T> {
        load3(token, &self.x, a)
    }
    #[inline(always)]
    fn pair<T: Lane>(&self, centre: Vec3<T>, b: usize, pair: usize) -> (Vec3<T>, Vec3<T>) {
        let token = centre[0].token();
        let g = scale3(
            T::load(token, self.k, pair),
            sub3(load3(token, &self.x, b), centre),
        );
        (g, [-g[0], -g[1], -g[2]])
    }
}

/// Both vectors stored: 48 bytes a pair.
#[derive(Clone, Copy)]
pub struct Stored<'a> {
    ab: [&'a [f64]; 3],
    ba: [&'a [f64]; 3],
}

impl PairVectors for Stored<'_> {
    #[inline(always)]
    fn centre<T: Lane>(&self, token: T::Token, _: usize) -> Vec3<T> {
        zero3(token)
    }
    #[inline(always)]
    fn pair<T: Lane>(&self, centre: Vec3<T>, _: usize, pair: usize) -> (Vec3<T>, Vec3<T>) {
        let token = centre[0].token();
        (load3(token, &self.ab, pair), load3(token, &self.ba, pair))
    }
}

/// Runs an expression with the reference's pair vectors bound to a name.
macro_rules! with_pairs {
    ($reference:expr, $name:ident => $body:expr) => {
        match $reference.pair_vectors() {
            $crate::reference::Pairs::Lean($name) => $body,
            $crate::reference::Pairs::Stored($name) => $body,
        }
    };
}
pub(crate) use with_pairs;

#[derive(Debug)]
struct StoredVectors {
    ab: [Vec<Slots>; 3],
    ba: [Vec<Slots>; 3],
}

/// Which pair vectors there are now; the caller matches once, outside the particle loop.
pub enum Pairs<'a> {
    /// Symmetric weights times initial distances.
    Lean(Lean<'a>),
    /// Stored vectors.
    Stored(Stored<'a>),
}

/// Fields of an updated reference; a simulation that never updates has none of them.
#[derive(Debug, Clone, PartialEq)]
pub struct Updated {
    /// chi [m], reference; set when the reference is updated.
    pub chi: Array<3>,
    /// F_chi, initial to reference.
    pub f_chi: Array<9>,
    /// J_chi, initial to reference.
    pub j_chi: Array<1>,
    /// H_chi, only where h is an independent unknown.
    pub h_chi: Option<Array<9>>,
}

/// Reference configuration of a body.
#[derive(Debug)]
pub struct Reference {
    /// Storage layout of the body.
    pub layout: Layout,
    /// Neighbours.
    pub slices: Slices,
    /// X [m], initial.
    pub x_initial: Array<3>,
    /// V_R [m^3], initial; 0 in dummy slots, which keeps them out of every sum.
    pub volume: Array<1>,
    /// L_a [m^-2 over the unit of g], reference; row-major.
    pub l: Array<9>,
    /// Fields of the update, if the scene asks for updates.
    pub updated: Option<Updated>,
    /// Directed pairs.
    pub pairs: usize,
    /// Smallest and largest number of neighbours.
    pub neighbour_range: (usize, usize),
    stored: Option<StoredVectors>,
    option: u8,
    weights: Weights,
    smoothing_factor: f64,
}

#[inline(always)]
pub(crate) fn load3<T: Lane>(token: T::Token, from: &[&[f64]; 3], at: usize) -> Vec3<T> {
    [
        T::load(token, from[0], at),
        T::load(token, from[1], at),
        T::load(token, from[2], at),
    ]
}

#[inline(always)]
pub(crate) fn load9<T: Lane>(token: T::Token, from: &[&[f64]; 9], at: usize) -> Mat3<T> {
    let [a, b, c, d, e, f, g, h, i] = from;
    [
        load3(token, &[a, b, c], at),
        load3(token, &[d, e, f], at),
        load3(token, &[g, h, i], at),
    ]
}

#[inline(always)]
pub(crate) fn store3<T: Lane>(value: &Vec3<T>, to: &mut [&mut [f64]; 3], at: usize) {
    for (c, v) in value.iter().enumerate() {
        v.store(to[c], at);
    }
}

#[inline(always)]
pub(crate) fn store9<T: Lane>(value: &Mat3<T>, to: &mut [&mut [f64]; 9], at: usize) {
    for (r, row) in value.iter().enumerate() {
        for (c, v) in row.iter().enumerate() {
            v.store(to[3 * r + c], at);
        }
    }
}

/// A^-1 by the cofactor.
#[inline(always)]
fn inverse<T: Lane>(m: &Mat3<T>) -> Mat3<T> {
    let cof = cofactor(m);
    scale9(m[0][0].of(1.0) / dot(m[0], cof[0]), &transpose(&cof))
}

/// r^_ab and F_ave^-1 of a pair (46).
#[inline(always)]
fn pull_back<T: Lane>(
    token: T::Token,
    f_chi: &[&[f64]; 9],
    chi: &[&[f64]; 3],
    a: usize,
    b: usize,
) -> (Vec3<T>, Mat3<T>) {
    let sum = add9(&load9::<T>(token, f_chi, a), &load9(token, f_chi, b));
    let inverse = inverse(&scale9(T::splat(token, 0.5), &sum));
    (
        mat_vec(&inverse, sub3(load3(token, chi, b), load3(token, chi, a))),
        inverse,
    )
}

impl Reference {
    /// The reference of a body at rest: the initial configuration.
    ///
    /// # Errors
    /// [`Code::InvalidScene`] naming a particle whose neighbours lie in a plane.
    pub fn new(particles: &Particles, graph: &Graph, numerics: &Numerics) -> Result<Self> {
        let layout = Layout::new(particles.count());
        let mut x_initial = Array::new(layout, [0.0; 3]);
        let mut volume = Array::new(layout, [0.0]);
        for i in 0..particles.count() {
            x_initial.set(Layout::slot(i), particles.positions[i]);
            volume.set(Layout::slot(i), [particles.volumes[i]]);
        }
        let updated = (numerics.reference_update != ReferenceUpdate::Never).then(|| Updated {
            chi: x_initial.clone(),
            f_chi: Array::new(layout, flat(&IDENTITY)),
            j_chi: Array::new(layout, [1.0]),
            h_chi: (numerics.state == crate::scene::StateMeasures::Fhj)
                .then(|| Array::new(layout, flat(&IDENTITY))),
        });
        let counts = (0..graph.count()).map(|i| graph.of(i).len());
        let mut this = Self {
            layout,
            slices: Slices::new(graph, layout),
            x_initial,
            volume,
            l: Array::new(layout, [0.0; 9]),
            updated,
            pairs: graph.pairs(),
            neighbour_range: (counts.clone().min().unwrap_or(0), counts.max().unwrap_or(0)),
            stored: None,
            option: numerics.kernel_option,
            weights: numerics.weights,
            smoothing_factor: numerics.smoothing_factor,
        };
        this.initial_weights(particles, graph);
        if let Err(slot) = this.rebuild() {
            let i = slot - Layout::FIRST;
            return Err(Error::scene(
                "numerics.neighbours",
                "the neighbours of a particle lie in a plane or on a line, so no gradient can be \
                 formed: widen the radius",
            )
            .at_particle(particles.caller(i), Some(particles.positions[i])));
        }
        Ok(this)
    }

    /// k_ab of the initial configuration.
    fn initial_weights(&mut self, particles: &Particles, graph: &Graph) {
        let distance = |a: usize, b: u32| {
            let (x, y) = (particles.positions[a], particles.positions[b as usize]);
            (0..3).map(|i| (x[i] - y[i]).powi(2)).sum::<f64>().sqrt()
        };
        let h: Vec<f64> = parallel::fill(graph.count(), |a| {
            self.smoothing_factor
                * graph
                    .of(a)
                    .iter()
                    .map(|&b| distance(a, b))
                    .fold(0.0, f64::max)
        });
        // Lengths and volumes over their means: weights of order one in any unit system.
        let unit = h.iter().sum::<f64>() / h.len() as f64;
        let mean_volume = particles.volumes.iter().sum::<f64>() / h.len() as f64;
        let weight = |a: usize, b: u32| {
            let r = distance(a, b) / unit;
            let (ha, hb) = (h[a] / unit, h[b as usize] / unit);
            match self.weights {
                Weights::Unit => 0.5 * (kernel::slope(r, ha) + kernel::slope(r, hb)),
                // V_b as printed; V_a, common to all pairs of a, makes the weight symmetric.
                Weights::Tributary => {
                    particles.volumes[a] * particles.volumes[b as usize]
                        / (mean_volume * mean_volume)
                        * kernel::slope(r, hb)
                }
            }
        };
        let mut symmetric = true;
        for a in 0..graph.count() {
            for &b in graph.of(a) {
                let (k, back) = (weight(a, b), weight(b as usize, a as u32));
                symmetric &= k == back;
                let pair = self.slices.entry(a, b as usize);
                self.slices.weight[pair / SLICE].0[pair % SLICE] = k;
            }
        }
        if !symmetric {
            let mut stored = self.new_stored();
            for a in 0..graph.count() {
                for &b in graph.of(a) {
                    let pair = self.slices.entry(a, b as usize);
                    let (k, back) = (weight(a, b), weight(b as usize, a as u32));
                    for c in 0..3 {
                        let r = particles.positions[b as usize][c] - particles.positions[a][c];
                        stored.ab[c][pair / SLICE].0[pair % SLICE] = k * r;
                        stored.ba[c][pair / SLICE].0[pair % SLICE] = -back * r;
                    }
                }
            }
            self.stored = Some(stored);
        }
    }

    fn new_stored(&self) -> StoredVectors {
        let zeros = || std::array::from_fn(|_| vec![Slots([0.0; SLICE]); self.slices.base.len()]);
        StoredVectors {
            ab: zeros(),
            ba: zeros(),
        }
    }

    /// The pair vectors now.
    pub fn pair_vectors(&self) -> Pairs<'_> {
        match &self.stored {
            None => Pairs::Lean(Lean {
                k: self.slices.weights(),
                x: self.x_initial.components(),
            }),
            Some(s) => Pairs::Stored(Stored {
                ab: std::array::from_fn(|c| bytemuck::must_cast_slice(&s.ab[c][..])),
                ba: std::array::from_fn(|c| bytemuck::must_cast_slice(&s.ba[c][..])),
            }),
        }
    }

    /// Recomputes everything that follows from the fields of [`Updated`], for the scene's kernel
    /// option: after an update and after a restore.
    ///
    /// # Errors
    /// The slot of a particle whose gradient cannot be corrected any more.
    pub fn rebuild(&mut self) -> std::result::Result<(), usize> {
        if self.option >= 3 && self.updated.is_some() {
            self.updated_vectors();
        }
        self.correct().map_or(Ok(()), Err)
    }

    /// L_a for the present pair vectors; the slot of the first particle where it does not exist.
    fn correct(&mut self) -> Option<usize> {
        let mut l = std::mem::replace(&mut self.l, Array::empty());
        let this = &*self;
        let updated = this.updated.as_ref();
        let points = match updated {
            Some(u) if this.option > 1 => u.chi.components(),
            _ => this.x_initial.components(),
        };
        let f_chi = updated
            .filter(|_| this.option < 4)
            .map(|u| u.f_chi.components());
        let bad = parallel::map_slabs(
            l.slabs_mut(),
            |slab, out| with_pairs!(this, pairs => vectorised(Correct { pairs, this, points, f_chi, slab, out })),
        );
        self.l = l;
        bad.into_iter().flatten().next()
    }

    /// g_ab of options #3 and #4 from chi and F_chi.
    fn updated_vectors(&mut self) {
        let u = self
            .updated
            .as_ref()
            .expect("called for an updated reference");
        let (chi, f_chi, j_chi) = (
            u.chi.components(),
            u.f_chi.components(),
            u.j_chi.components()[0],
        );
        let volume = self.volume.components()[0];
        let mut h = Array::<1>::new(self.layout, [1.0]);
        parallel::map_slabs(h.slabs_mut(), |slab, [out]| {
            vectorised(SmoothingLength {
                this: self,
                chi,
                f_chi,
                slab,
                out,
            });
        });
        let particles = self.layout.particles as f64;
        let mean = |values: &[f64]| {
            values[Layout::FIRST..Layout::FIRST + self.layout.particles]
                .iter()
                .sum::<f64>()
                / particles
        };
        let h = h.components()[0];
        let (unit, mean_volume) = (mean(h), mean(volume));
        let mut stored = self.new_stored();
        let entries = |slab: usize| {
            let first = slab * self.layout.slab;
            let last = (first + self.layout.slab).min(self.layout.slices);
            self.slices.start[first]..self.slices.start[last]
        };
        let mut outputs = Vec::new();
        {
            let vectors = stored.ab.iter_mut().chain(stored.ba.iter_mut());
            let mut rest: Vec<&mut [f64]> = vectors
                .map(|v| bytemuck::must_cast_slice_mut(&mut v[..]))
                .collect();
            for slab in 0..self.layout.slabs() {
                let length = entries(slab).len() * SLICE;
                let mut pieces = Vec::with_capacity(6);
                for r in &mut rest {
                    let (piece, remaining) = std::mem::take(r).split_at_mut(length);
                    pieces.push(piece);
                    *r = remaining;
                }
                outputs.push(pieces);
            }
        }
        parallel::map_slabs(outputs, |slab, out| {
            vectorised(PulledBackVectors {
                this: self,
                chi,
                f_chi,
                j_chi,
                h,
                unit,
                mean_volume,
                slab,
                out,
            });
        });
        self.stored = Some(stored);
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        let updated = self.updated.as_ref().map_or(0, |u| {
            u.chi.bytes()
                + u.f_chi.bytes()
                + u.j_chi.bytes()
                + u.h_chi.as_ref().map_or(0, Array::bytes)
        });
        let entries = self.slices.base.len();
        let stored = if self.stored.is_some() {
            entries * 6 * size_of::<Slots>()
        } else {
            0
        };
        entries * (size_of::<Slots>() + size_of::<u32>())
            + self.slices.start.len() * size_of::<usize>()
            + self.x_initial.bytes()
            + self.volume.bytes()
            + self.l.bytes()
            + updated
            + stored
    }
}

/// L_a of a slab.
struct Correct<'a, P> {
    pairs: P,
    this: &'a Reference,
    points: [&'a [f64]; 3],
    f_chi: Option<[&'a [f64]; 9]>,
    slab: usize,
    out: [&'a mut [f64]; 9],
}

impl<P: PairVectors> Work for Correct<'_, P> {
    type Output = Option<usize>;
    #[inline(always)]
    fn run<T: Lane>(mut self, token: T::Token) -> Option<usize> {
        let (first, slices) = self.this.layout.slab_range(self.slab);
        let mut bad = None;
        for at in (0..slices * SLICE).step_by(T::WIDTH) {
            let a = first + at;
            let f = match &self.f_chi {
                Some(f_chi) => load9(token, f_chi, a),
                None => identity::<T>(token),
            };
            let cof = cofactor(&f);
            let f_inverse_t = scale9(T::splat(token, 1.0) / dot(f[0], cof[0]), &cof);
            let (xa, centre) = (
                load3(token, &self.points, a),
                self.pairs.centre::<T>(token, a),
            );
            let mut moment = [zero3(token); 3];
            for (b, pair) in self.this.slices.of(a) {
                let (g, _) = self.pairs.pair(centre, b, pair);
                moment = add_outer(&moment, g, sub3(load3(token, &self.points, b), xa));
            }
            let l = if self.this.option == 1 {
                mat_mul(&f_inverse_t, &inverse(&moment))
            } else {
                mat_mul(&inverse(&mat_mul(&f_inverse_t, &moment)), &f_inverse_t)
            };
            store9(&l, &mut self.out, at);
            // Row-major moments of the lanes, for the check and for dummies.
            let mut moments = [[0.0; 9]; SLICE];
            for (c, m) in moment.iter().flatten().enumerate() {
                m.for_lanes(|lane, value| moments[lane][c] = value);
            }
            for (lane, moment) in moments[..T::WIDTH].iter().enumerate() {
                if a + lane >= Layout::slot(self.this.layout.particles) {
                    // A dummy has no pairs: any finite L serves.
                    for row in &mut self.out {
                        row[at + lane] = 0.0;
                    }
                } else if bad.is_none() && !is_regular(moment) {
                    bad = Some(a + lane);
                }
            }
        }
        bad
    }
}

/// h^_b of a slab (47).
struct SmoothingLength<'a> {
    this: &'a Reference,
    chi: [&'a [f64]; 3],
    f_chi: [&'a [f64]; 9],
    slab: usize,
    out: &'a mut [f64],
}

impl Work for SmoothingLength<'_> {
    type Output = ();
    #[inline(always)]
    fn run<T: Lane>(self, token: T::Token) {
        let (first, slices) = self.this.layout.slab_range(self.slab);
        let weights = self.this.slices.weights();
        for at in (0..slices * SLICE).step_by(T::WIDTH) {
            let a = first + at;
            let mut longest = T::splat(token, 0.0);
            for (b, pair) in self.this.slices.of(a) {
                let (r, _) = pull_back::<T>(token, &self.f_chi, &self.chi, a, b);
                let mask = T::load(token, weights, pair);
                longest = mask.if_positive(longest.max(dot(r, r)), longest);
            }
            (longest.sqrt() * T::splat(token, self.this.smoothing_factor)).store(self.out, at);
        }
    }
}

/// g_ab and g_ba of options #3 and #4 of a slab.
struct PulledBackVectors<'a> {
    this: &'a Reference,
    chi: [&'a [f64]; 3],
    f_chi: [&'a [f64]; 9],
    j_chi: &'a [f64],
    /// h^ and the mean values that make the weights of order one.
    h: &'a [f64],
    unit: f64,
    mean_volume: f64,
    slab: usize,
    /// Components of g_ab, then of g_ba.
    out: Vec<&'a mut [f64]>,
}

impl Work for PulledBackVectors<'_> {
    type Output = ();
    #[inline(always)]
    fn run<T: Lane>(mut self, token: T::Token) {
        let this = self.this;
        let (first, slices) = this.layout.slab_range(self.slab);
        let offset = this.slices.start[self.slab * this.layout.slab] * SLICE;
        let (weights, volume) = (this.slices.weights(), this.volume.components()[0]);
        let per_length = T::splat(token, 1.0 / self.unit);
        let per_volume = T::splat(token, 1.0 / (self.mean_volume * self.mean_volume));
        let (zero, half) = (T::splat(token, 0.0), T::splat(token, 0.5));
        for at in (0..slices * SLICE).step_by(T::WIDTH) {
            let a = first + at;
            let ha = T::load(token, self.h, a) * per_length;
            let (va, ja) = (T::load(token, volume, a), T::load(token, self.j_chi, a));
            for (b, pair) in this.slices.of(a) {
                let (r, f_inverse) = pull_back::<T>(token, &self.f_chi, &self.chi, a, b);
                let hb = T::load(token, self.h, b) * per_length;
                let length = dot(r, r).sqrt() * per_length;
                let (with_b, with_a) = (kernel::slope(length, hb), kernel::slope(length, ha));
                let (k, back) = match this.weights {
                    Weights::Unit => {
                        let mean = half * (with_a + with_b);
                        (mean, mean)
                    }
                    Weights::Tributary => {
                        let v = va * T::load(token, volume, b) * per_volume;
                        if this.option == 4 {
                            // V_chi,b / J_ave instead of V_b (52d); a's own factor cancels.
                            let jb = T::load(token, self.j_chi, b);
                            let mean = half * (ja + jb);
                            (v * with_b * jb / mean, v * with_a * ja / mean)
                        } else {
                            (v * with_b, v * with_a)
                        }
                    }
                };
                let direction = if this.option == 4 {
                    mat_vec(&transpose(&f_inverse), r)
                } else {
                    r
                };
                let mask = T::load(token, weights, pair);
                for (c, d) in direction.into_iter().enumerate() {
                    mask.if_positive(k * d, zero)
                        .store(self.out[c], pair - offset);
                    mask.if_positive(-(back * d), zero)
                        .store(self.out[3 + c], pair - offset);
                }
            }
        }
    }
}

/// Whether a moment matrix can be inverted: its determinant over that of a ball.
fn is_regular(moment: &[f64; 9]) -> bool {
    let m = nalgebra::Matrix3::from_row_slice(moment);
    let scale = m.norm();
    scale.is_finite() && (m.determinant() / scale.powi(3)).abs() > 1e-9
}
