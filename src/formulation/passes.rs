//! The passes of [`super::url`] over a run of slots, written once over lanes.

use std::ops::Range;

use super::limiter;
use super::riemann::{self, Pair, WaveSpeeds};
use super::sweep::{Block, BlockPart};
use super::url::{Breakdown, State, Trouble};
use crate::lane::{Lane, PairWork, PerSlot, Real, Work};
use crate::layout::{Array, Layout, level};
use crate::material::Deformation;
use crate::math::*;
use crate::parallel;
use crate::reference::{PairVectors, Reference, Slices, load3, load9, store3, store9};

/// Read access to a state and its reference, by components.
#[derive(Clone, Copy)]
pub(super) struct Kinematics<'a> {
    pub(super) f: [&'a [f64]; 9],
    h: Option<[&'a [f64]; 9]>,
    pub(super) j: Option<&'a [f64]>,
    f_chi: Option<[&'a [f64]; 9]>,
    h_chi: Option<[&'a [f64]; 9]>,
    pub(super) j_chi: Option<&'a [f64]>,
}

impl<'a> Kinematics<'a> {
    pub(super) fn new(state: &'a State, reference: &'a Reference) -> Self {
        let updated = reference.updated.as_ref();
        Self {
            f: state.f.components(),
            h: state.h.as_ref().map(Array::components),
            j: state.j.as_ref().map(|j| j.components()[0]),
            f_chi: updated.map(|u| u.f_chi.components()),
            h_chi: updated
                .and_then(|u| u.h_chi.as_ref())
                .map(Array::components),
            j_chi: updated.map(|u| u.j_chi.components()[0]),
        }
    }
    /// Total deformation of the particles in the slots from `at`.
    #[inline(always)]
    pub(super) fn total<T: Lane>(&self, token: T::Token, at: usize) -> Deformation<T> {
        let mut f = load9::<T>(token, &self.f, at);
        if let Some(f_chi) = &self.f_chi {
            f = mat_mul(&f, &load9(token, f_chi, at));
        }
        let mut h = cofactor(&f);
        let mut j = dot(f[0], h[0]);
        if let Some(own) = self.j {
            j = T::load(token, own, at);
            if let Some(j_chi) = self.j_chi {
                j = j * T::load(token, j_chi, at);
            }
        }
        if let Some(own) = &self.h {
            h = load9(token, own, at);
            if let Some(h_chi) = &self.h_chi {
                h = mat_mul(&h, &load9(token, h_chi, at));
            }
        }
        Deformation { f, h, j }
    }
}

#[inline(always)]
pub(super) fn load_slab3<T: Lane>(
    token: T::Token,
    from: &[&mut [impl Real]; 3],
    at: usize,
) -> Vec3<T> {
    let [a, b, c] = from;
    load3(token, &[a, b, c], at)
}

#[inline(always)]
pub(super) fn load_slab9<T: Lane>(
    token: T::Token,
    from: &[&mut [impl Real]; 9],
    at: usize,
) -> Mat3<T> {
    let [a, b, c, d, e, f, g, h, i] = from;
    load9(token, &[a, b, c, d, e, f, g, h, i], at)
}

/// Slots of a slab as (offset in the slab, slot), by lanes.
#[inline(always)]
pub(super) fn lanes_of<T: Lane>(
    reference: &Reference,
    slab: usize,
) -> impl Iterator<Item = (usize, usize)> {
    lanes_from::<T>(reference.layout.slab_range(slab))
}

/// The same of a run of slots: the first one, and how many they are.
#[inline(always)]
pub(super) fn lanes_from<T: Lane>(
    (first, slots): (usize, usize),
) -> impl Iterator<Item = (usize, usize)> {
    std::iter::zip((0..slots).step_by(T::WIDTH), (first..).step_by(T::WIDTH))
}

/// Gradient of a vector field with respect to the reference (54).
pub(super) struct Gradient<'a, 'o, 'p, P, E: Real, F: Real> {
    pub slices: &'a Slices<E>,
    pub pairs: P,
    pub l: [&'a [E]; 9],
    pub field: [&'a [E]; 3],
    pub run: (usize, usize),
    pub out: &'o mut [&'p mut [F]; 9],
}

impl<P: PairVectors, E: Real, F: Real> PairWork for Gradient<'_, '_, '_, P, E, F> {
    type Output = ();
    #[inline(always)]
    fn run<T: Lane>(self, token: T::Token) {
        let slots = self.l[0].len();
        let (pairs, field) = (self.pairs.level(slots), level(self.field, slots));
        for (at, a) in lanes_from::<T>(self.run) {
            let centre = pairs.centre::<T>(token, a);
            let own = load3::<T>(token, &field, a);
            let mut sum = [zero3(token); 3];
            for (b, pair) in self.slices.of(a) {
                let (g, _) = pairs.pair(token, &centre, b, pair);
                sum = add_outer(&sum, sub3(load3(token, &field, b), own), g);
            }
            store9(&mat_mul_t(&sum, &load9(token, &self.l, a)), self.out, at);
        }
    }
}

/// What the gradient, law and point passes leave for later, of a run of slots.
pub(super) struct Kept<'a, E> {
    pub grad_v: [&'a mut [E]; 9],
    pub sigma_j: Option<&'a mut [f64]>,
    /// Temperature and the variable whose gradient drives conduction.
    pub theta: Option<[&'a mut [f64]; 2]>,
}

impl<E> Kept<'_, E> {
    /// Some of the slots.
    pub fn part(&mut self, range: Range<usize>) -> Kept<'_, E> {
        Kept {
            grad_v: self.grad_v.each_mut().map(|c| &mut c[range.clone()]),
            sigma_j: self.sigma_j.as_mut().map(|s| &mut s[range.clone()]),
            theta: self
                .theta
                .as_mut()
                .map(|t| t.each_mut().map(|c| &mut c[range.clone()])),
        }
    }
}

/// Output of the gradient, law and point passes for a run of slots.
pub(super) struct PointOutput<'a, E: Real> {
    pub kept: Kept<'a, E>,
    /// As Q, P from the law pass, where formulation and material meet; Q from the point pass.
    pub block: BlockPart<'a, E>,
}

/// The rest of one particle that its neighbours need, from the incremental deformation; kinetic
/// energy of the run.
pub(super) struct Points<'a, 'o, 'p, E: Real> {
    pub density: f64,
    pub kinematics: Kinematics<'a>,
    pub reference: &'a Reference,
    pub l: [&'a [E]; 9],
    pub v: [&'a [f64]; 3],
    /// Spacing tensors ([`spacings`]), where they bound the step.
    pub spacing: Option<[&'a [f64]; 6]>,
    /// Whether the norm of the velocity gradient is asked for.
    pub rate: bool,
    pub run: (usize, usize),
    pub out: &'o mut PointOutput<'p, E>,
}

/// What the point pass sums over a run.
#[derive(Clone, Copy, Debug)]
pub(super) struct Motion {
    /// Kinetic energy [J].
    pub kinetic: f64,
    /// Smallest square of a length that bounds the step [m^2].
    pub length2: f64,
    /// Largest square of a norm of the spatial velocity gradient [1/s^2].
    pub rate2: f64,
}

/// A factor times grad_x v = grad_chi v f^-1, with f^-1 from f itself.
#[inline(always)]
pub(super) fn spatial_gradient<T: Lane>(
    factor: T,
    grad_v: &Mat3<T>,
    f: &Mat3<T>,
    cof_f: &Mat3<T>,
) -> Mat3<T> {
    scale9(factor / dot(f[0], cof_f[0]), &mat_mul_t(grad_v, cof_f))
}

impl<E: Real> Work for Points<'_, '_, '_, E> {
    type Output = std::result::Result<Motion, Breakdown>;
    #[inline(always)]
    fn run<T: Lane>(self, token: T::Token) -> Self::Output {
        let Self {
            kinematics,
            reference,
            l,
            v,
            spacing,
            rate,
            run,
            out,
            ..
        } = self;
        let PointOutput { kept, block } = out;
        let volume = reference.volume.components()[0];
        let density = T::splat(token, self.density);
        let half = T::splat(token, 0.5);
        let mut kinetic = PerSlot::new(0.0);
        let mut shortest = PerSlot::new(f64::INFINITY);
        let mut fastest = PerSlot::new(0.0);
        let mut admissible = PerSlot::new(1.0);
        let (one, zero) = (T::splat(token, 1.0), T::splat(token, 0.0));
        let infinity = T::splat(token, f64::INFINITY);
        for (at, a) in lanes_from::<T>(run) {
            let (l, v_r) = (load9::<T>(token, &l, a), T::load(token, volume, a));

            let f = load9::<T>(token, &kinematics.f, a);
            let cof_f = cofactor(&f);
            if rate || block.half_grad.is_some() {
                let grad = load_slab9::<T>(token, &kept.grad_v, at);
                let half_grad = spatial_gradient(half, &grad, &f, &cof_f);
                if rate {
                    fastest.max(at, double_dot(&half_grad, &half_grad));
                }
                if let Some(out) = &mut block.half_grad {
                    store9(&half_grad, out, at);
                }
            }

            // Q = V_R P F_chi^T L and S = V_chi h L.
            let mut k = scale9(v_r, &l);
            let mut v_chi = v_r;
            if let (Some(f_chi), Some(j_chi)) = (&kinematics.f_chi, kinematics.j_chi) {
                k = mat_mul(&transpose(&load9(token, f_chi, a)), &k);
                v_chi = v_r * T::load(token, j_chi, a);
            }
            let p = load_slab9::<T>(token, &block.q, at);
            store9(&mat_mul(&p, &k), &mut block.q, at);
            if let Some(out) = &mut block.s {
                let h = match &kinematics.h {
                    Some(h) => load9(token, h, a),
                    None => cof_f,
                };
                store9(&scale9(v_chi, &mat_mul(&h, &l)), out, at);
            }

            let velocity = load3::<T>(token, &v, a);
            let motion = half * density * v_r * dot(velocity, velocity);
            kinetic.add(at, motion);
            // Infinity - infinity is NaN.
            admissible.min(at, (infinity - motion).if_positive(one, zero));

            if let Some(spacing) = &spacing {
                let n = load_all(token, spacing, a);
                let stretch = T::load(token, block.wave[0], at);
                let length2 = bounded_length2(&kinematics.total(token, a).f, &n, stretch);
                shortest.min(at, v_r.if_positive(length2, infinity));
            }
        }
        if admissible.least() < 1.0 {
            return Err(first_breakdown(run, |slot| {
                immovable(load3((), &v, slot), self.density * volume[slot])
            }));
        }
        Ok(Motion {
            kinetic: kinetic.sum(),
            length2: shortest.least(),
            rate2: 4.0 * fastest.most(),
        })
    }
}

/// Margin of the length that follows from a particle's own deformation over the shortest distance to
/// its neighbours, at rest: bars that are stable by their distances alone do not meet it, and one that
/// is not has become unstable at about 2.3.
const SPACING_MARGIN: f64 = 1.6;

/// Square of the length over which the gradient of a particle varies, as deformed by F, times the
/// stretch that divides the wave speed [m^2]: 1/n is the largest eigenvalue of F^-T N F^-1.
///
/// A gradient, and the force that belongs to it, know F and no distances. Where the two part, as in a
/// layer that a plane flattens, the shortest distance says nothing of how stiff the gradient is.
#[inline(always)]
fn bounded_length2<T: Lane>(f: &Mat3<T>, n: &Sym3<T>, stretch: T) -> T {
    let cof = cofactor(f);
    let j = dot(f[0], cof[0]);
    let margin = T::splat(j.token(), SPACING_MARGIN) * stretch * j;
    margin * margin / largest_eigenvalue(&full(&congruence(&cof, n)))
}

/// Spacing tensors N [m^-2] of the initial configuration: the sum of G (x) G over the corrected kernel
/// gradients of a particle, scaled so that its largest eigenvalue is that of the shortest distance
/// to a neighbour.
pub(super) fn spacings(reference: &Reference) -> Array<6> {
    let mut spacings = Array::new(reference.layout, [0.0; 6]);
    let (x, l) = (&reference.x_initial, &reference.l);
    let weights = reference.slices.weights();
    let tensors = parallel::fill(reference.layout.particles, |i| {
        let a = Layout::slot(i);
        let correction = matrix(&l.get(a));
        let mut sum = [[0.0; 3]; 3];
        let mut shortest = f64::INFINITY;
        for (b, pair) in reference.slices.of(a) {
            if weights[pair] > 0.0 {
                let r = sub3(x.get(b), x.get(a));
                let g = mat_vec(&correction, scale3(weights[pair], r));
                sum = add_outer(&sum, g, g);
                shortest = shortest.min(dot(r, r));
            }
        }
        let scale = 1.0 / (largest_eigenvalue(&sum) * shortest);
        let n = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)];
        n.map(|(r, c)| scale * sum[r][c])
    });
    for (i, tensor) in tensors.into_iter().enumerate() {
        spacings.set(Layout::slot(i), tensor);
    }
    spacings
}

/// The first particle of a run that is in trouble.
#[cold]
pub(super) fn first_breakdown(
    run: (usize, usize),
    trouble: impl Fn(usize) -> Option<Trouble>,
) -> Breakdown {
    lanes_from::<f64>(run)
        .find_map(|(_, slot)| {
            let trouble = trouble(slot)?;
            Some(Breakdown { slot, trouble })
        })
        .unwrap_or(Breakdown {
            slot: run.0,
            trouble: Trouble::VolumeRatio(f64::NAN),
        })
}

/// Whether a velocity, or its energy, is not finite.
pub(super) fn immovable(v: Vec3<f64>, mass: f64) -> Option<Trouble> {
    (!(0.5 * mass * dot(v, v)).is_finite()).then_some(Trouble::Velocity)
}

/// Scales the gradients for the reconstruction by Venkatakrishnan's limiter.
pub(super) struct Limit<'a, 'o, 'p, E: Real> {
    pub reference: &'a Reference,
    pub x: [&'a [f64]; 3],
    pub v: [&'a [f64]; 3],
    pub run: (usize, usize),
    pub half_grad: &'o mut [&'p mut [E]; 9],
}

impl<E: Real> Work for Limit<'_, '_, '_, E> {
    type Output = ();
    #[inline(always)]
    fn run<T: Lane>(self, token: T::Token) {
        let weights = self.reference.slices.weights();
        for (at, a) in lanes_from::<T>(self.run) {
            let (xa, va) = (load3::<T>(token, &self.x, a), load3::<T>(token, &self.v, a));
            let (mut rise, mut fall) = (zero3::<T>(token), zero3::<T>(token));
            for (b, pair) in self.reference.slices.of(a) {
                let mask = T::load(token, weights, pair);
                let dv = sub3(load3(token, &self.v, b), va);
                for c in 0..3 {
                    rise[c] = mask.if_positive(rise[c].max(dv[c]), rise[c]);
                    fall[c] = mask.if_positive(fall[c].min(dv[c]), fall[c]);
                }
            }
            let mut grad = load_slab9::<T>(token, self.half_grad, at);
            let mut phi = [T::splat(token, 1.0); 3];
            for (b, pair) in self.reference.slices.of(a) {
                let mask = T::load(token, weights, pair);
                let step = mat_vec(&grad, sub3(load3(token, &self.x, b), xa));
                for c in 0..3 {
                    let limited = limiter::venkatakrishnan(rise[c], fall[c], step[c]);
                    phi[c] = mask.if_positive(phi[c].min(limited), phi[c]);
                }
            }
            for c in 0..3 {
                grad[c] = scale3(phi[c], grad[c]);
            }
            store9(&grad, self.half_grad, at);
        }
    }
}

/// What the force pass reads of the neighbours: blocks, and x and v, which passes in double precision read
/// of the state itself.
#[derive(Clone, Copy)]
pub(super) struct ForceInput<'a, E: Real, X = E> {
    pub reference: &'a Reference,
    /// Each pair's neighbours, for the passes in this precision.
    slices: &'a Slices<E>,
    x: [&'a [X]; 3],
    v: [&'a [X]; 3],
    q: [&'a [E]; 9],
    s: [&'a [E]; 9],
    half_grad: [&'a [E]; 9],
    wave: [&'a [E]; 2],
    /// Slot that stands first in q, s, half_grad and wave, and what the distance to it is cut to in a ring.
    first: usize,
    mask: usize,
}

impl<'a, E: Real, X: Real> ForceInput<'a, E, X> {
    /// With the block of the whole body.
    pub(super) fn new(
        [x, v]: [[&'a [X]; 3]; 2],
        reference: &'a Reference,
        slices: &'a Slices<E>,
        block: &'a Block<E>,
    ) -> Self {
        let tensors =
            |array: &'a Option<Array<9, E>>| array.as_ref().map_or([&[][..]; 9], Array::components);
        Self {
            reference,
            slices,
            x,
            v,
            q: block.q.components(),
            s: tensors(&block.s),
            half_grad: tensors(&block.half_grad),
            wave: block.wave.components(),
            first: 0,
            mask: usize::MAX,
        }
    }

    /// The same where the block is a ring of so many slots, a power of two, which begins with the slot `first`.
    pub(super) fn in_ring(self, first: usize, capacity: usize) -> Self {
        Self {
            first,
            mask: capacity - 1,
            ..self
        }
    }

    /// Place of a slot in q, s, half_grad and wave.
    #[inline(always)]
    fn place(&self, slot: usize) -> usize {
        slot.wrapping_sub(self.first) & self.mask
    }

    /// The same, and pair vectors, made to show that what a mode reads holds as many slots: one check of
    /// an index serves them all.
    #[inline(always)]
    pub(super) fn level<P: PairVectors, const MODE: u8>(self, pairs: P) -> (Self, P) {
        let (slots, places) = (self.x[0].len(), self.q[0].len());
        let mut this = Self {
            x: level(self.x, slots),
            v: level(self.v, slots),
            q: level(self.q, places),
            wave: level(self.wave, places),
            ..self
        };
        if MODE != riemann::OFF {
            this.s = level(self.s, places);
        }
        if riemann::reconstructs(MODE) {
            this.half_grad = level(self.half_grad, places);
        }
        (this, pairs.level(slots))
    }

    /// x_a.
    #[inline(always)]
    pub(super) fn position<T: Lane>(&self, token: T::Token, a: usize) -> Vec3<T> {
        load3(token, &self.x, a)
    }

    /// Q_a.
    #[inline(always)]
    fn stress<T: Lane>(&self, token: T::Token, a: usize) -> Mat3<T> {
        load9(token, &self.q, self.place(a))
    }

    /// Half the velocity gradient.
    #[inline(always)]
    fn half_grad<T: Lane>(&self, token: T::Token, a: usize) -> Mat3<T> {
        load9(token, &self.half_grad, self.place(a))
    }

    /// S_a.
    #[inline(always)]
    pub(super) fn area<T: Lane>(&self, token: T::Token, a: usize) -> Mat3<T> {
        load9(token, &self.s, self.place(a))
    }

    /// c_ab [m^2], from S_a and the pair vectors.
    #[inline(always)]
    pub(super) fn pair_area<T: Lane>(
        &self,
        sa: &Mat3<T>,
        b: usize,
        (g, back): (Vec3<T>, Vec3<T>),
    ) -> Vec3<T> {
        let sb = self.area::<T>(g[0].token(), b);
        sub3(mat_vec(sa, g), mat_vec(&sb, back))
    }

    #[inline(always)]
    fn here<T: Lane>(&self, token: T::Token, a: usize) -> Here<T> {
        Here {
            x: load3(token, &self.x, a),
            v: load3(token, &self.v, a),
            stretch: T::load(token, self.wave[0], self.place(a)),
            density: T::load(token, self.wave[1], self.place(a)),
        }
    }

    /// T_a (57) of one particle from all of its neighbours: what the force pass gives, without its order.
    #[cfg(test)]
    pub(super) fn force_on<P: PairVectors>(
        &self,
        pairs: P,
        speeds: WaveSpeeds<f64>,
        a: usize,
    ) -> Vec3<f64> {
        let (here, centre) = (self.here((), a), pairs.centre::<f64>((), a));
        let (qa, sa) = (self.stress((), a), self.area((), a));
        let grad_a = self.half_grad((), a);
        let mut force = [0.0; 3];
        for (b, pair) in self.reference.slices.of(a) {
            let (g, back) = pairs.pair((), &centre, b, pair);
            let mut p = self.pair(&here, b);
            p.area = self.pair_area(&sa, b, (g, back));
            let grad_b = self.half_grad((), b);
            let jump = riemann::jump::<f64, { riemann::LINEAR }>(&p, &grad_a, &grad_b, 0.0);
            let stress = sub3(mat_vec(&qa, g), mat_vec(&self.stress((), b), back));
            force = add3(force, add3(stress, riemann::dissipation(&p, jump, speeds)));
        }
        force
    }

    /// The pair a, b as the Riemann solver sees it, but for its area.
    #[inline(always)]
    fn pair<T: Lane>(&self, here: &Here<T>, b: usize) -> Pair<T> {
        let token = here.stretch.token();
        let half = T::splat(token, 0.5);
        let dx = sub3(load3(token, &self.x, b), here.x);
        Pair {
            dx,
            dv: sub3(load3(token, &self.v, b), here.v),
            dx2: dot(dx, dx),
            stretch: half * (here.stretch + T::load(token, self.wave[0], self.place(b))),
            density: half * (here.density + T::load(token, self.wave[1], self.place(b))),
            area: zero3(token),
        }
    }
}

/// The particle's own values.
struct Here<T> {
    x: Vec3<T>,
    v: Vec3<T>,
    stretch: T,
    density: T,
}

/// Sums over the areas c_ab of a particle for the length that binds its step.
struct Areas<T> {
    /// sum |c_ab|.
    total: T,
    /// S = sum c_ab (x) c_ab: xx, yy, zz, yz, zx, xy.
    second: [T; 6],
}

impl<T: Lane> Areas<T> {
    #[inline(always)]
    fn new(token: T::Token) -> Self {
        let zero = T::splat(token, 0.0);
        Self {
            total: zero,
            second: [zero; 6],
        }
    }

    #[inline(always)]
    fn add(&mut self, area: Vec3<T>) {
        let [x, y, z] = area;
        self.total = self.total + dot(area, area).sqrt();
        let products = [(x, x), (y, y), (z, z), (y, z), (z, x), (x, y)];
        for (s, (p, q)) in self.second.iter_mut().zip(products) {
            *s = p.mul_add(q, *s);
        }
    }

    /// Length whose ratio to the wave speed bounds the step, for a volume.
    ///
    /// The rows of the stiffness G^T G add up to (kappa / 2)^2, kappa = sum |c_ab| / V, which bounds a
    /// frequency over the wave speed; areas in all directions cannot act together, which takes
    /// sqrt(largest eigenvalue of S / tr S) off. The root of |S^2| stands for that eigenvalue. The
    /// factor is measured, at alpha = 0.9: noise on a tetrahedral cylinder (areas in all directions) dies
    /// out up to 2.5, a copper bar of tetrahedra (flat on impact) keeps its energy up to 2.6.
    #[inline(always)]
    fn length(&self, volume: T) -> T {
        let [xx, yy, zz, yz, zx, xy] = self.second;
        let s = [[xx, xy, zx], [xy, yy, yz], [zx, yz, zz]];
        let squared = mat_mul(&s, &s);
        let eigenvalue = double_dot(&squared, &squared).sqrt().sqrt();
        let trace = xx + yy + zz;
        let factor = xx.of(2.3);
        factor * volume / self.total * (trace / eigenvalue).sqrt()
    }
}

/// Adds to T_a (57) what the pairs whose first particle lies in a run of slices give; (power of the
/// dissipation, smallest squared |x_ab| lambda_ab) of these pairs.
///
/// Each pair is computed once, for both of its particles: what it does to the second is taken off there.
pub(super) struct Forces<'a, 'o, 'p, P, E: Real, const MODE: u8> {
    pub pairs: P,
    pub input: ForceInput<'a, E>,
    pub speeds: WaveSpeeds<f64>,
    /// Share of the dissipation in resolved flow.
    pub coefficient: f64,
    /// What makes up for that share in a shock, 0 without a limiter of shocks.
    pub shock: f64,
    pub run: (usize, usize),
    /// Where the run begins in its chunk, and the forces there.
    pub from: usize,
    pub sums: &'o mut Sums<'p, E>,
}

impl<P: PairVectors, E: Real, const MODE: u8> PairWork for Forces<'_, '_, '_, P, E, MODE> {
    type Output = (f64, f64);
    #[inline(always)]
    fn run<T: Lane>(self, token: T::Token) -> (f64, f64) {
        let Self {
            pairs,
            input,
            speeds,
            coefficient,
            shock,
            run,
            from,
            sums,
        } = self;
        let (input, pairs) = input.level::<P, MODE>(pairs);
        let slices = input.slices;
        let weights = slices.weights();
        let speeds = WaveSpeeds {
            pressure: T::splat(token, coefficient * speeds.pressure),
            shear: T::splat(token, coefficient * speeds.shear),
        };
        let full = T::splat(token, shock);
        let far = T::splat(token, f64::INFINITY);
        let (mut power, mut shortest) = (PerSlot::new(0.0), PerSlot::new(f64::INFINITY));
        for (place, a) in lanes_from::<T>(run) {
            let at = from + place;
            let here = input.here::<T>(token, a);
            let centre = pairs.centre::<T>(token, a);
            let qa = input.stress::<T>(token, a);
            let (mut sa, mut grad_a) = ([zero3(token); 3], [zero3(token); 3]);
            if MODE != riemann::OFF {
                sa = input.area::<T>(token, a);
            }
            if riemann::reconstructs(MODE) {
                grad_a = input.half_grad::<T>(token, a);
            }
            let mut force = zero3::<T>(token);
            let mut work = T::splat(token, 0.0);
            let mut length2 = far;
            for (b, pair) in slices.after(a) {
                let (g, back) = pairs.pair(token, &centre, b, pair);
                let mut p = input.pair(&here, b);
                let mask = T::load(token, weights, pair);
                length2 = length2.min(mask.if_positive(p.dx2 * (p.stretch * p.stretch), far));
                let mut f = sub3(mat_vec(&qa, g), mat_vec(&input.stress(token, b), back));
                if MODE != riemann::OFF {
                    p.area = input.pair_area(&sa, b, (g, back));
                    let grad_b = if riemann::reconstructs(MODE) {
                        input.half_grad(token, b)
                    } else {
                        [zero3(token); 3]
                    };
                    let jump = riemann::jump::<T, MODE>(&p, &grad_a, &grad_b, full);
                    let mut d = riemann::dissipation(&p, jump, speeds);
                    if MODE == riemann::GUARDED {
                        d = riemann::guarded(d, p.dv);
                    }
                    work = work + dot(d, p.dv);
                    f = add3(f, d);
                }
                force = add3(force, f);
                take_off(f, sums, at + (b - a));
            }
            // Only now: a pair within the lanes has changed what stands here.
            sums.add(force, at);
            power.add(at, work);
            shortest.min(at, length2);
        }
        (power.sum(), shortest.least())
    }
}

/// Sums over pairs of a chunk, and of as many slots behind it as its pairs reach.
pub(super) struct Sums<'a, E: Real> {
    pub out: [&'a mut [E]; 3],
    pub behind: [&'a mut [E]; 3],
}

impl<E: Real> Sums<'_, E> {
    /// Begins with nothing.
    pub fn clear(&mut self) {
        let all = self.out.iter_mut().chain(&mut self.behind);
        all.for_each(|c| c.fill(E::nearest(0.0)));
    }
    /// Adds at a place of the chunk.
    #[inline(always)]
    fn add<T: Lane>(&mut self, value: Vec3<T>, at: usize) {
        let sum = add3(load_slab3(value[0].token(), &self.out, at), value);
        store3(&sum, &mut self.out, at);
    }
}

/// Takes a vector off what stands at a place of a chunk, or behind its end.
#[inline(always)]
fn take_off<T: Lane, E: Real>(value: Vec3<T>, sums: &mut Sums<E>, at: usize) {
    let Sums { out: chunk, behind } = sums;
    let end = chunk[0].len();
    let token = value[0].token();
    let within = |to: &mut [&mut [E]; 3], at: usize| {
        store3(&sub3(load_slab3(token, to, at), value), to, at);
    };
    if at + T::WIDTH <= end {
        within(chunk, at);
    } else if at >= end {
        within(behind, at - end);
    } else {
        for c in 0..3 {
            value[c].for_lanes(|lane, v| {
                let sum = match (at + lane).checked_sub(end) {
                    None => &mut chunk[c][at + lane],
                    Some(at) => &mut behind[c][at],
                };
                *sum = E::nearest(sum.value() - v);
            });
        }
    }
}

/// Smallest squared length that the areas of the pairs allow the particles of one slab.
pub(super) struct AreaLengths<'a, P, E: Real> {
    pub pairs: P,
    pub input: ForceInput<'a, E, f64>,
    /// rho_R [kg/m^3].
    pub density: f64,
    pub slab: usize,
}

impl<P: PairVectors, E: Real> Work for AreaLengths<'_, P, E> {
    type Output = f64;
    #[inline(always)]
    fn run<T: Lane>(self, token: T::Token) -> f64 {
        let (input, pairs) = self.input.level::<P, { riemann::CONSTANT }>(self.pairs);
        let volume = input.reference.volume.components()[0];
        let density = T::splat(token, self.density);
        let far = T::splat(token, f64::INFINITY);
        let mut shortest = PerSlot::new(f64::INFINITY);
        for (at, a) in lanes_of::<T>(input.reference, self.slab) {
            let here = input.here::<T>(token, a);
            let centre = pairs.centre::<T>(token, a);
            let sa = input.area::<T>(token, a);
            let mut areas = Areas::new(token);
            for (b, pair) in input.reference.slices.of(a) {
                areas.add(input.pair_area(&sa, b, pairs.pair(token, &centre, b, pair)));
            }
            let mass = density * T::load(token, volume, a);
            let bound = areas.length(here.stretch * mass / here.density);
            shortest.min(at, bound.if_positive(bound * bound, far));
        }
        shortest.least()
    }
}

/// Most that a reconstructed step may take of what the jumps of a particle dissipate. In smooth flow both
/// are alike and the differences cancel among neighbours: 1 makes a tetrahedral cylinder in torsion lose
/// a third more, 1.1 nothing. Noise still dies out with 1.5.
const RECONSTRUCTED_SHARE: f64 = 1.2;

/// What is left of a particle's reconstruction, given what its jumps dissipate and what half of the
/// reconstructed steps take of it.
#[inline(always)]
fn bounded_share<T: Lane>(jumps: T, half_steps: T) -> T {
    let (steps, limit) = (
        half_steps + half_steps,
        jumps.of(RECONSTRUCTED_SHARE) * jumps,
    );
    (steps - limit).if_positive(limit / steps, jumps.of(1.0))
}

/// What scales the gradients for the reconstruction so that they do not make energy.
///
/// Half of what a pair dissipates belongs to each of its particles: sum_b dv . K (dv - g_a dx) / 2, K being
/// D_ab per jump. Were g_a the least-squares fit with the weights K, that would be sum_b |dv - g_a dx|_K^2 / 2.
/// A repaired gradient, which may owe all of itself to one neighbour, or more, can make it negative, and
/// modes have grown by it (tetrahedra, nu = 0.495). g_a is scaled where the second term is more than
/// [`RECONSTRUCTED_SHARE`] times the first.
///
/// This sums what the jumps dissipate (first component) and what half of the reconstructed steps take of it (second)
/// over the pairs whose first particle lies in a chunk, for both particles as [`Forces`] does.
pub(super) struct Dissipated<'a, 'o, 'p, P, E: Real> {
    pub pairs: P,
    pub input: ForceInput<'a, E>,
    pub speeds: WaveSpeeds<f64>,
    /// All of a chunk.
    pub run: (usize, usize),
    pub sums: &'o mut Sums<'p, E>,
}

impl<P: PairVectors, E: Real> PairWork for Dissipated<'_, '_, '_, P, E> {
    type Output = ();
    #[inline(always)]
    fn run<T: Lane>(self, token: T::Token) {
        let sums = self.sums;
        let speeds = WaveSpeeds {
            pressure: T::splat(token, self.speeds.pressure),
            shear: T::splat(token, self.speeds.shear),
        };
        let zero = T::splat(token, 0.0);
        let (input, pairs) = self.input.level::<P, { riemann::LINEAR }>(self.pairs);
        for (at, a) in lanes_from::<T>(self.run) {
            let here = input.here::<T>(token, a);
            let centre = pairs.centre::<T>(token, a);
            let (sa, half_a) = (input.area::<T>(token, a), input.half_grad::<T>(token, a));
            let (mut jumps, mut half_steps) = (zero, zero);
            for (b, pair) in input.slices.after(a) {
                let vectors = pairs.pair(token, &centre, b, pair);
                let mut p = input.pair(&here, b);
                p.area = input.pair_area(&sa, b, vectors);
                let d = riemann::dissipation(&p, p.dv, speeds);
                let jump = dot(d, p.dv);
                let step = dot(d, mat_vec(&input.half_grad(token, b), p.dx));
                take_off([-jump, -step, zero], sums, at + (b - a));
                jumps = jumps + jump;
                half_steps = half_steps + dot(d, mat_vec(&half_a, p.dx));
            }
            sums.add([jumps, half_steps, zero], at);
        }
    }
}

/// Scales the gradients of a slab by what [`Dissipated`] found.
pub(super) struct Bound<'a, E: Real> {
    pub sums: [&'a [E]; 3],
    pub run: (usize, usize),
    pub half_grad: [&'a mut [E]; 9],
}

impl<E: Real> PairWork for Bound<'_, E> {
    type Output = ();
    #[inline(always)]
    fn run<T: Lane>(mut self, token: T::Token) {
        for (at, a) in lanes_from::<T>(self.run) {
            let [jumps, half_steps, _] = load3::<T>(token, &self.sums, a);
            let half = load_slab9::<T>(token, &self.half_grad, at);
            let share = bounded_share(jumps, half_steps);
            store9(&scale9(share, &half), &mut self.half_grad, at);
        }
    }
}

/// Half the spatial gradient of a scalar field.
pub(super) struct HalfSlope<'a, P> {
    pub pairs: P,
    pub reference: &'a Reference,
    pub kinematics: Kinematics<'a>,
    pub field: &'a [f64],
    pub slab: usize,
    pub out: [&'a mut [f64]; 3],
}

impl<P: PairVectors> Work for HalfSlope<'_, P> {
    type Output = ();
    #[inline(always)]
    fn run<T: Lane>(mut self, token: T::Token) {
        let l = self.reference.l.components();
        let slots = l[0].len();
        let (pairs, field) = (self.pairs.level(slots), &self.field[..slots]);
        for (at, a) in lanes_of::<T>(self.reference, self.slab) {
            let centre = pairs.centre::<T>(token, a);
            let own = T::load(token, field, a);
            let mut sum = zero3(token);
            for (b, pair) in self.reference.slices.of(a) {
                let (g, _) = pairs.pair(token, &centre, b, pair);
                sum = axpy3(sum, T::load(token, field, b) - own, g);
            }
            let f = load9::<T>(token, &self.kinematics.f, a);
            let cof = cofactor(&f);
            let half = T::splat(token, 0.5) / dot(f[0], cof[0]);
            let slope = mat_vec(&cof, mat_vec(&load9(token, &l, a), sum));
            store3(&scale3(half, slope), &mut self.out, at);
        }
    }
}

/// Scales the slopes for the reconstruction of D^j, as [`Bound`] the gradients for that of D^p.
pub(super) struct BoundSlope<'a, P, E: Real> {
    pub pairs: P,
    pub input: ForceInput<'a, E, f64>,
    pub sigma: &'a [f64],
    pub pressure_speed: f64,
    pub slab: usize,
    pub half_slope: [&'a mut [f64]; 3],
}

impl<P: PairVectors, E: Real> Work for BoundSlope<'_, P, E> {
    type Output = ();
    #[inline(always)]
    fn run<T: Lane>(mut self, token: T::Token) {
        let [zero, one] = [0.0, 1.0].map(|v| T::splat(token, v));
        let speed = T::splat(token, self.pressure_speed);
        let (input, pairs) = self.input.level::<P, { riemann::CONSTANT }>(self.pairs);
        for (at, a) in lanes_of::<T>(input.reference, self.slab) {
            let here = input.here::<T>(token, a);
            let centre = pairs.centre::<T>(token, a);
            let sa = input.area::<T>(token, a);
            let sigma_a = T::load(token, self.sigma, a);
            let half: Vec3<T> = load_all(token, &self.half_slope, at);
            let (mut jumps, mut half_steps) = (zero, zero);
            for (b, pair) in input.reference.slices.of(a) {
                let vectors = pairs.pair(token, &centre, b, pair);
                let mut p = input.pair(&here, b);
                p.area = input.pair_area(&sa, b, vectors);
                let difference = T::load(token, self.sigma, b) - sigma_a;
                let d = riemann::volume_dissipation(&p, difference, speed, one);
                jumps = d.mul_add(difference, jumps);
                half_steps = d.mul_add(dot(half, p.dx), half_steps);
            }
            let share = bounded_share(jumps, half_steps);
            store3(&scale3(share, half), &mut self.half_slope, at);
        }
    }
}

/// dj/dt by D^j (56, 59); power that it dissipates in the slab.
pub(super) struct VolumeRates<'a, P, E: Real> {
    pub pairs: P,
    pub input: ForceInput<'a, E, f64>,
    pub sigma: &'a [f64],
    pub slope: [&'a [f64]; 3],
    pub j_chi: Option<&'a [f64]>,
    pub pressure_speed: f64,
    pub coefficient: f64,
    pub slab: usize,
    pub out: &'a mut [f64],
}

impl<P: PairVectors, E: Real> Work for VolumeRates<'_, P, E> {
    type Output = f64;
    #[inline(always)]
    fn run<T: Lane>(self, token: T::Token) -> f64 {
        let (input, pairs) = self.input.level::<P, { riemann::CONSTANT }>(self.pairs);
        let volume = input.reference.volume.components()[0];
        let (speed, coefficient) = (
            T::splat(token, self.pressure_speed),
            T::splat(token, self.coefficient),
        );
        let mut power = PerSlot::new(0.0);
        for (at, a) in lanes_of::<T>(input.reference, self.slab) {
            let here = input.here::<T>(token, a);
            let centre = pairs.centre::<T>(token, a);
            let sa = input.area::<T>(token, a);
            let (sigma_a, slope_a) = (
                T::load(token, self.sigma, a),
                load3::<T>(token, &self.slope, a),
            );
            let (mut rate, mut work) = (T::splat(token, 0.0), T::splat(token, 0.0));
            for (b, pair) in input.reference.slices.of(a) {
                let vectors = pairs.pair(token, &centre, b, pair);
                let mut p = input.pair(&here, b);
                p.area = input.pair_area(&sa, b, vectors);
                let difference = T::load(token, self.sigma, b) - sigma_a;
                let slopes = add3(slope_a, load3(token, &self.slope, b));
                let jump = difference - dot(slopes, p.dx);
                let d = riemann::volume_dissipation(&p, jump, speed, coefficient);
                rate = rate + d;
                work = work + d * difference;
            }
            let mut v_chi = T::load(token, volume, a);
            if let Some(j_chi) = self.j_chi {
                v_chi = v_chi * T::load(token, j_chi, a);
            }
            (rate / (v_chi + T::splat(token, f64::MIN_POSITIVE))).store(self.out, at);
            power.add(at, work);
        }
        0.5 * power.sum()
    }
}
