//! Pair vectors g_ab, from which gradients and pseudo-areas are made: C_ab = 2 V_chi L_a g_ab.

use super::slices::Slices;
use super::{load3, load9};
use crate::lane::{Lane, SLICE, Slots};
use crate::layout::{Layout, level};
use crate::math::*;

/// Pair vectors g_ab and g_ba of a pair.
pub trait PairVectors: Copy + Sync {
    /// The same, made to show that all of its arrays hold as many slots: one check serves them all.
    fn level(self, slots: usize) -> Self;
    /// What is read once per particle.
    type Centre<T: Lane>: Copy;
    /// Reads it.
    fn centre<T: Lane>(&self, token: T::Token, a: usize) -> Self::Centre<T>;
    /// (g_ab, g_ba).
    fn pair<T: Lane>(
        &self,
        token: T::Token,
        centre: &Self::Centre<T>,
        b: usize,
        pair: usize,
    ) -> (Vec3<T>, Vec3<T>);
}

/// g_ab = k_ab (X_b - X_a) with k_ab = k_ba: 8 bytes a pair.
#[derive(Clone, Copy)]
pub struct Lean<'a> {
    pub k: &'a [f64],
    pub x: [&'a [f64]; 3],
}

impl PairVectors for Lean<'_> {
    #[inline(always)]
    fn level(self, slots: usize) -> Self {
        Self {
            x: level(self.x, slots),
            ..self
        }
    }
    type Centre<T: Lane> = Vec3<T>;
    #[inline(always)]
    fn centre<T: Lane>(&self, token: T::Token, a: usize) -> Vec3<T> {
        load3(token, &self.x, a)
    }
    #[inline(always)]
    fn pair<T: Lane>(
        &self,
        token: T::Token,
        centre: &Vec3<T>,
        b: usize,
        pair: usize,
    ) -> (Vec3<T>, Vec3<T>) {
        let g = scale3(
            T::load(token, self.k, pair),
            sub3(load3(token, &self.x, b), *centre),
        );
        (g, [-g[0], -g[1], -g[2]])
    }
}

/// g_ab = C_ab = k_ab [Lambda_a (X_b - X_a) + (mu_a - mu_b)/2] with k_ab = k_ba, by
/// [`super::repair`]: 8 bytes a pair, and 12 numbers a particle.
#[derive(Clone, Copy)]
pub struct Closed<'a> {
    pub k: &'a [f64],
    pub x: [&'a [f64]; 3],
    /// mu / 2 [m^2].
    pub half_mu: [&'a [f64]; 3],
    /// Lambda [m].
    pub lambda: [&'a [f64]; 9],
}

impl PairVectors for Closed<'_> {
    #[inline(always)]
    fn level(self, slots: usize) -> Self {
        Self {
            x: level(self.x, slots),
            half_mu: level(self.half_mu, slots),
            lambda: level(self.lambda, slots),
            ..self
        }
    }
    type Centre<T: Lane> = (Vec3<T>, Vec3<T>, Mat3<T>);
    #[inline(always)]
    fn centre<T: Lane>(&self, token: T::Token, a: usize) -> Self::Centre<T> {
        (
            load3(token, &self.x, a),
            load3(token, &self.half_mu, a),
            load9(token, &self.lambda, a),
        )
    }
    #[inline(always)]
    fn pair<T: Lane>(
        &self,
        token: T::Token,
        (x, half_mu, lambda): &Self::Centre<T>,
        b: usize,
        pair: usize,
    ) -> (Vec3<T>, Vec3<T>) {
        let k = T::load(token, self.k, pair);
        let r = scale3(k, sub3(load3(token, &self.x, b), *x));
        let difference = scale3(k, sub3(*half_mu, load3(token, &self.half_mu, b)));
        let ab = add3(mat_vec(lambda, r), difference);
        let ba = add3(mat_vec(&load9(token, &self.lambda, b), r), difference);
        (ab, [-ba[0], -ba[1], -ba[2]])
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
    fn level(self, _: usize) -> Self {
        let pairs = self.ab[0].len();
        Self {
            ab: level(self.ab, pairs),
            ba: level(self.ba, pairs),
        }
    }
    type Centre<T: Lane> = ();
    #[inline(always)]
    fn centre<T: Lane>(&self, _: T::Token, _: usize) {}
    #[inline(always)]
    fn pair<T: Lane>(&self, token: T::Token, (): &(), _: usize, pair: usize) -> (Vec3<T>, Vec3<T>) {
        (load3(token, &self.ab, pair), load3(token, &self.ba, pair))
    }
}

/// The vectors of [`Stored`], by pair.
#[derive(Debug)]
pub struct StoredVectors {
    ab: [Vec<Slots>; 3],
    ba: [Vec<Slots>; 3],
}

impl StoredVectors {
    /// All zero.
    pub fn new(slices: &Slices) -> Self {
        let zeros = || std::array::from_fn(|_| vec![Slots([0.0; SLICE]); slices.entries()]);
        Self {
            ab: zeros(),
            ba: zeros(),
        }
    }
    /// Read access.
    pub fn get(&self) -> Stored<'_> {
        Stored {
            ab: std::array::from_fn(|c| bytemuck::must_cast_slice(&self.ab[c][..])),
            ba: std::array::from_fn(|c| bytemuck::must_cast_slice(&self.ba[c][..])),
        }
    }
    /// Adds to g_ab and g_ba of a pair.
    pub fn add(&mut self, pair: usize, ab: [f64; 3], ba: [f64; 3]) {
        for c in 0..3 {
            self.ab[c][pair / SLICE].0[pair % SLICE] += ab[c];
            self.ba[c][pair / SLICE].0[pair % SLICE] += ba[c];
        }
    }
    /// Components of g_ab, then of g_ba, for each slab.
    pub fn slabs_mut(&mut self, slices: &Slices, layout: Layout) -> Vec<Vec<&mut [f64]>> {
        let vectors = self.ab.iter_mut().chain(self.ba.iter_mut());
        slices.split(layout, vectors.map(|v| &mut v[..]).collect())
    }
    /// Bytes held.
    pub fn bytes(&self) -> usize {
        let vectors = self.ab.iter().chain(&self.ba);
        vectors.map(|v| std::mem::size_of_val(&v[..])).sum()
    }
}

/// Which pair vectors there are now; the caller matches once, outside the particle loop.
pub enum Pairs<'a> {
    /// Symmetric weights times initial distances.
    Lean(Lean<'a>),
    /// The same with the multipliers that close them.
    Closed(Closed<'a>),
    /// Stored vectors.
    Stored(Stored<'a>),
}

/// Runs an expression with the reference's pair vectors bound to a name.
macro_rules! with_pairs {
    ($reference:expr, $name:ident => $body:expr) => {
        match $reference.pair_vectors() {
            $crate::reference::Pairs::Lean($name) => $body,
            $crate::reference::Pairs::Closed($name) => $body,
            $crate::reference::Pairs::Stored($name) => $body,
        }
    };
}
pub(crate) use with_pairs;
