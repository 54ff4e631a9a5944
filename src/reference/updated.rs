//! Kernels of an updated reference, evaluated at distances pulled back to the initial configuration
//! ([URL22] 45 to 48): smoothing lengths, weights, and the pair vectors of options #3 and #4.

use super::Reference;
use super::{inverse, load3, load9};
use crate::kernel;
use crate::lane::{Lane, SLICE, Work};
use crate::math::*;
use crate::scene::Weights;

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

/// h^_b of a slab (47).
pub(super) struct SmoothingLength<'a> {
    pub this: &'a Reference,
    pub chi: [&'a [f64]; 3],
    pub f_chi: [&'a [f64]; 9],
    pub slab: usize,
    pub out: &'a mut [f64],
}

impl Work for SmoothingLength<'_> {
    type Output = ();
    #[inline(always)]
    fn run<T: Lane>(self, token: T::Token) {
        let (first, slots) = self.this.layout.slab_range(self.slab);
        let weights = self.this.slices.weights();
        for at in (0..slots).step_by(T::WIDTH) {
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

/// What the kernels of an updated reference are made of.
#[derive(Clone, Copy)]
pub(super) struct Kernels<'a> {
    pub this: &'a Reference,
    pub chi: [&'a [f64]; 3],
    pub f_chi: [&'a [f64]; 9],
    /// h^ and its mean, over which lengths are taken so that the weights are of order one.
    pub h: &'a [f64],
    pub unit: f64,
}

impl Kernels<'_> {
    /// r^ of a pair, F_ave^-1, and the kernels' slopes with h^_b and with h^_a.
    #[inline(always)]
    fn pair<T: Lane>(&self, token: T::Token, a: usize, b: usize) -> (Vec3<T>, Mat3<T>, T, T) {
        let per_length = T::splat(token, 1.0 / self.unit);
        let (r, f_inverse) = pull_back::<T>(token, &self.f_chi, &self.chi, a, b);
        let length = dot(r, r).sqrt() * per_length;
        // One by one: the compiler may leave the closure of a `map` over both a call, without vectors.
        let ha = T::load(token, self.h, a) * per_length;
        let hb = T::load(token, self.h, b) * per_length;
        (
            r,
            f_inverse,
            kernel::slope(length, hb),
            kernel::slope(length, ha),
        )
    }
}

/// k^_ab of a slab, the mean of both particles' kernels.
pub(super) struct PulledBackWeights<'a> {
    pub kernels: Kernels<'a>,
    pub slab: usize,
    pub out: &'a mut [f64],
}

impl Work for PulledBackWeights<'_> {
    type Output = ();
    #[inline(always)]
    fn run<T: Lane>(self, token: T::Token) {
        let this = self.kernels.this;
        let (first, slots) = this.layout.slab_range(self.slab);
        let offset = this.slices.of_slab(this.layout, self.slab).start * SLICE;
        let weights = this.slices.weights();
        let (zero, half) = (T::splat(token, 0.0), T::splat(token, 0.5));
        for a in (first..first + slots).step_by(T::WIDTH) {
            for (b, pair) in this.slices.of(a) {
                let (_, _, with_b, with_a) = self.kernels.pair::<T>(token, a, b);
                T::load(token, weights, pair)
                    .if_positive(half * (with_a + with_b), zero)
                    .store(self.out, pair - offset);
            }
        }
    }
}

/// g_ab and g_ba of options #3 and #4 of a slab.
pub(super) struct PulledBackVectors<'a> {
    pub kernels: Kernels<'a>,
    pub j_chi: &'a [f64],
    /// Over which volumes are taken so that the weights are of order one.
    pub mean_volume: f64,
    pub slab: usize,
    /// Components of g_ab, then of g_ba.
    pub out: Vec<&'a mut [f64]>,
}

impl Work for PulledBackVectors<'_> {
    type Output = ();
    #[inline(always)]
    fn run<T: Lane>(mut self, token: T::Token) {
        let this = self.kernels.this;
        let (first, slots) = this.layout.slab_range(self.slab);
        let offset = this.slices.of_slab(this.layout, self.slab).start * SLICE;
        let (weights, volume) = (this.slices.weights(), this.volume.components()[0]);
        let per_volume = T::splat(token, 1.0 / (self.mean_volume * self.mean_volume));
        let (zero, half) = (T::splat(token, 0.0), T::splat(token, 0.5));
        for at in (0..slots).step_by(T::WIDTH) {
            let a = first + at;
            let (va, ja) = (T::load(token, volume, a), T::load(token, self.j_chi, a));
            for (b, pair) in this.slices.of(a) {
                let (r, f_inverse, with_b, with_a) = self.kernels.pair::<T>(token, a, b);
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
