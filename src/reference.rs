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
use crate::lane::{F64x8, Lane, WIDTH, vectorised};
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
    start: Vec<u32>,
    /// Slot of the neighbour of the slice's first lane.
    base: Vec<u32>,
    /// k of the initial configuration per lane; 0 where a lane has no neighbour in this entry.
    weight: Vec<F64x8>,
}

impl Slices {
    /// The neighbour loop: calls `body(neighbour's slot, index of the pair)` for the particles in
    /// the slots from `a`. Lanes without a neighbour come with weight 0.
    #[inline(always)]
    pub fn for_each<T: Lane>(&self, a: usize, mut body: impl FnMut(usize, usize)) {
        let (slice, lane) = ((a - Layout::FIRST) / WIDTH, (a - Layout::FIRST) % WIDTH);
        for entry in self.start[slice] as usize..self.start[slice + 1] as usize {
            body(self.base[entry] as usize + lane, entry * WIDTH + lane);
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
            let first = slice * WIDTH;
            let members = first..(first + WIDTH).min(graph.count());
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
            this.weight.resize(this.base.len(), F64x8([0.0; WIDTH]));
            this.start.push(this.base.len() as u32);
        }
        this
    }

    /// Pair index of an existing pair.
    fn entry(&self, a: usize, b: usize) -> usize {
        let (slice, lane) = (a / WIDTH, a % WIDTH);
        let range = self.start[slice] as usize..self.start[slice + 1] as usize;
        let base = (Layout::slot(b) - lane) as u32;
        let at = self.base[range.clone()]
            .binary_search(&base)
            .expect("pair in its slice");
        (range.start + at) * WIDTH + lane
    }
}

/// Pair vectors g_ab and g_ba of a pair.
pub trait PairVectors: Copy + Sync {
    /// What is read once per particle.
    fn centre<T: Lane>(&self, a: usize) -> Vec3<T>;
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
    fn centre<T: Lane>(&self, a: usize) -> Vec3<T> {
        load3(&self.x, a)
    }
    #[inline(always)]
    fn pair<T: Lane>(&self, centre: Vec3<T>, b: usize, pair: usize) -> (Vec3<T>, Vec3<T>) {
        let g = scale3(T::load(self.k, pair), sub3(load3(&self.x, b), centre));
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
    fn centre<T: Lane>(&self, _: usize) -> Vec3<T> {
        zero3()
    }
    #[inline(always)]
    fn pair<T: Lane>(&self, _: Vec3<T>, _: usize, pair: usize) -> (Vec3<T>, Vec3<T>) {
        (load3(&self.ab, pair), load3(&self.ba, pair))
    }
}

#[derive(Debug)]
struct StoredVectors {
    ab: [Vec<F64x8>; 3],
    ba: [Vec<F64x8>; 3],
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
pub(crate) fn load3<T: Lane>(from: &[&[f64]; 3], at: usize) -> Vec3<T> {
    [
        T::load(from[0], at),
        T::load(from[1], at),
        T::load(from[2], at),
    ]
}

#[inline(always)]
pub(crate) fn load9<T: Lane>(from: &[&[f64]; 9], at: usize) -> Mat3<T> {
    let row = |r: usize| {
        [
            T::load(from[r], at),
            T::load(from[r + 1], at),
            T::load(from[r + 2], at),
        ]
    };
    [row(0), row(3), row(6)]
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
    scale9(T::splat(1.0) / dot(m[0], cof[0]), &transpose(&cof))
}

/// r^_ab and F_ave^-1 of a pair (46).
#[inline(always)]
fn pull_back(
    f_chi: &[&[f64]; 9],
    chi: &[&[f64]; 3],
    a: usize,
    b: usize,
) -> (Vec3<F64x8>, Mat3<F64x8>) {
    let sum = add9(&load9::<F64x8>(f_chi, a), &load9(f_chi, b));
    let inverse = inverse(&scale9(F64x8::splat(0.5), &sum));
    (
        mat_vec(&inverse, sub3(load3(chi, b), load3(chi, a))),
        inverse,
    )
}

const IDENTITY: [f64; 9] = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];

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
            f_chi: Array::new(layout, IDENTITY),
            j_chi: Array::new(layout, [1.0]),
            h_chi: (numerics.state == crate::scene::StateMeasures::Fhj)
                .then(|| Array::new(layout, IDENTITY)),
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
                self.slices.weight[pair / WIDTH].0[pair % WIDTH] = k;
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
                        stored.ab[c][pair / WIDTH].0[pair % WIDTH] = k * r;
                        stored.ba[c][pair / WIDTH].0[pair % WIDTH] = -back * r;
                    }
                }
            }
            self.stored = Some(stored);
        }
    }

    fn new_stored(&self) -> StoredVectors {
        let zeros = || std::array::from_fn(|_| vec![F64x8([0.0; WIDTH]); self.slices.base.len()]);
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
        let mut l = std::mem::replace(&mut self.l, Array::new(self.layout, [0.0; 9]));
        let this = &*self;
        let bad = parallel::map_slabs(l.slabs_mut(), |slab, mut out| match this.pair_vectors() {
            Pairs::Lean(pairs) => this.correct_slab(pairs, slab, &mut out),
            Pairs::Stored(pairs) => this.correct_slab(pairs, slab, &mut out),
        });
        self.l = l;
        bad.into_iter().flatten().next()
    }

    fn correct_slab<P: PairVectors>(
        &self,
        pairs: P,
        slab: usize,
        out: &mut [&mut [f64]; 9],
    ) -> Option<usize> {
        let (first, slices) = self.layout.slab_range(slab);
        let (option, updated) = (self.option, self.updated.as_ref());
        let points = match updated {
            Some(u) if option > 1 => u.chi.components(),
            _ => self.x_initial.components(),
        };
        let f_chi = updated.filter(|_| option < 4).map(|u| u.f_chi.components());
        let mut bad = None;
        vectorised(
            #[inline(always)]
            || {
                for i in 0..slices {
                    let a = first + i * WIDTH;
                    let f = f_chi.map_or(identity::<F64x8>(), |f| load9(&f, a));
                    let cof = cofactor(&f);
                    let f_inverse_t = scale9(F64x8::splat(1.0) / dot(f[0], cof[0]), &cof);
                    let (xa, centre) = (load3(&points, a), pairs.centre::<F64x8>(a));
                    let mut moment = [zero3(); 3];
                    self.slices.for_each::<F64x8>(a, |b, pair| {
                        let (g, _) = pairs.pair(centre, b, pair);
                        moment = add_outer(&moment, g, sub3(load3(&points, b), xa));
                    });
                    let l = if option == 1 {
                        mat_mul(&f_inverse_t, &inverse(&moment))
                    } else {
                        mat_mul(&inverse(&mat_mul(&f_inverse_t, &moment)), &f_inverse_t)
                    };
                    for lane in 0..WIDTH {
                        let particle = a + lane - Layout::FIRST;
                        if particle >= self.layout.particles {
                            // A dummy has no pairs: any finite L serves.
                            for row in out.iter_mut() {
                                row[i * WIDTH + lane] = 0.0;
                            }
                            continue;
                        }
                        if !is_regular(&moment, lane) {
                            bad = bad.or(Some(a + lane));
                        }
                        for (c, row) in out.iter_mut().enumerate() {
                            row[i * WIDTH + lane] = l[c / 3][c % 3].0[lane];
                        }
                    }
                }
            },
        );
        bad
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
        let weights = self.slices.weights();
        let mut h = Array::<1>::new(self.layout, [1.0]);
        parallel::map_slabs(h.slabs_mut(), |slab, [out]| {
            let (first, slices) = self.layout.slab_range(slab);
            vectorised(
                #[inline(always)]
                || {
                    for i in 0..slices {
                        let a = first + i * WIDTH;
                        let mut longest = F64x8::splat(0.0);
                        self.slices.for_each::<F64x8>(a, |b, pair| {
                            let (r, _) = pull_back(&f_chi, &chi, a, b);
                            let mask = F64x8::load(weights, pair);
                            longest = mask.if_positive(longest.max(dot(r, r)), longest);
                        });
                        (longest.sqrt() * F64x8::splat(self.smoothing_factor))
                            .store(out, i * WIDTH);
                    }
                },
            );
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
            self.slices.start[first] as usize..self.slices.start[last] as usize
        };
        let mut outputs = Vec::new();
        {
            let mut rest: Vec<&mut [F64x8]> = stored
                .ab
                .iter_mut()
                .chain(stored.ba.iter_mut())
                .map(|v| &mut v[..])
                .collect();
            for slab in 0..self.layout.slabs() {
                let length = entries(slab).len();
                let mut pieces = Vec::with_capacity(6);
                for r in &mut rest {
                    let (piece, remaining) = std::mem::take(r).split_at_mut(length);
                    pieces.push(piece);
                    *r = remaining;
                }
                outputs.push(pieces);
            }
        }
        let (option, tributary) = (self.option, self.weights == Weights::Tributary);
        parallel::map_slabs(outputs, |slab, mut out| {
            let (first, slices) = self.layout.slab_range(slab);
            let offset = entries(slab).start;
            let s = F64x8::splat;
            vectorised(
                #[inline(always)]
                || {
                    for i in 0..slices {
                        let a = first + i * WIDTH;
                        let ha = F64x8::load(h, a) / s(unit);
                        let va = F64x8::load(volume, a) / s(mean_volume);
                        let ja = F64x8::load(j_chi, a);
                        self.slices.for_each::<F64x8>(a, |b, pair| {
                            let (r, f_inverse) = pull_back(&f_chi, &chi, a, b);
                            let hb = F64x8::load(h, b) / s(unit);
                            let length = dot(r, r).sqrt() / s(unit);
                            let (with_b, with_a) =
                                (kernel::slope(length, hb), kernel::slope(length, ha));
                            let (k, back) = if tributary {
                                let v = va * (F64x8::load(volume, b) / s(mean_volume));
                                if option == 4 {
                                    // V_chi,b / J_ave instead of V_b (52d); a's own factor cancels.
                                    let jb = F64x8::load(j_chi, b);
                                    let mean = s(0.5) * (ja + jb);
                                    (v * with_b * jb / mean, v * with_a * ja / mean)
                                } else {
                                    (v * with_b, v * with_a)
                                }
                            } else {
                                let mean = s(0.5) * (with_a + with_b);
                                (mean, mean)
                            };
                            let direction = if option == 4 {
                                mat_vec(&transpose(&f_inverse), r)
                            } else {
                                r
                            };
                            let mask = F64x8::load(weights, pair);
                            let entry = pair / WIDTH - offset;
                            for c in 0..3 {
                                out[c][entry] = mask.if_positive(k * direction[c], s(0.0));
                                out[3 + c][entry] = mask.if_positive(-back * direction[c], s(0.0));
                            }
                        });
                    }
                },
            );
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
            entries * 6 * size_of::<F64x8>()
        } else {
            0
        };
        entries * (size_of::<F64x8>() + size_of::<u32>())
            + self.slices.start.len() * size_of::<u32>()
            + self.x_initial.bytes()
            + self.volume.bytes()
            + self.l.bytes()
            + updated
            + stored
    }

    /// Share of lanes that hold a pair.
    pub fn fill(&self) -> f64 {
        self.pairs as f64 / (self.slices.base.len() * WIDTH) as f64
    }
}

/// Whether the moment matrix of a lane can be inverted: its determinant over that of a ball.
fn is_regular(moment: &Mat3<F64x8>, lane: usize) -> bool {
    let m = nalgebra::Matrix3::from_fn(|r, c| moment[r][c].0[lane]);
    let scale = m.norm();
    scale.is_finite() && (m.determinant() / scale.powi(3)).abs() > 1e-9
}
