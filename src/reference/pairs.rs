//! Pair vectors g_ab, from which gradients and pseudo-areas are made: C_ab = 2 V_chi L_a g_ab.

use super::slices::Slices;
use super::{load3, load9};
use crate::lane::{Lane, Real};
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
pub struct Lean<'a, E> {
    pub k: &'a [E],
    pub x: [&'a [E]; 3],
}

impl<E: Real> PairVectors for Lean<'_, E> {
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
pub struct Closed<'a, E> {
    pub k: &'a [E],
    pub x: [&'a [E]; 3],
    /// mu / 2 [m^2].
    pub half_mu: [&'a [E]; 3],
    /// Lambda [m].
    pub lambda: [&'a [E]; 9],
}

impl<E: Real> PairVectors for Closed<'_, E> {
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
pub struct Stored<'a, E> {
    pub(super) ab: [&'a [E]; 3],
    pub(super) ba: [&'a [E]; 3],
}

impl<E: Real> PairVectors for Stored<'_, E> {
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
pub struct StoredVectors<E: Real = f64> {
    ab: [Vec<E::Slots>; 3],
    ba: [Vec<E::Slots>; 3],
}

impl<E: Real> StoredVectors<E> {
    /// All zero.
    pub fn new(slices: &Slices<E>) -> Self {
        let zeros = || std::array::from_fn(|_| vec![E::slots(0.0); slices.entries()]);
        Self {
            ab: zeros(),
            ba: zeros(),
        }
    }
    /// Read access.
    pub fn get(&self) -> Stored<'_, E> {
        Stored {
            ab: std::array::from_fn(|c| bytemuck::cast_slice(&self.ab[c][..])),
            ba: std::array::from_fn(|c| bytemuck::cast_slice(&self.ba[c][..])),
        }
    }
    /// Adds to g_ab and g_ba of a pair.
    pub fn add(&mut self, pair: usize, ab: [f64; 3], ba: [f64; 3]) {
        let all = self.ab.iter_mut().chain(&mut self.ba);
        for (vector, more) in all.zip(ab.into_iter().chain(ba)) {
            let value: &mut E = &mut bytemuck::cast_slice_mut(vector)[pair];
            *value = E::nearest(value.value() + more);
        }
    }
    /// Components of g_ab, then of g_ba, for each slab.
    pub fn slabs_mut(&mut self, slices: &Slices<E>, layout: Layout) -> Vec<Vec<&mut [E]>> {
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
pub enum Pairs<'a, E> {
    /// Symmetric weights times initial distances.
    Lean(Lean<'a, E>),
    /// The same with the multipliers that close them.
    Closed(Closed<'a, E>),
    /// Stored vectors.
    Stored(Stored<'a, E>),
}

/// Runs an expression with pair vectors bound to a name.
macro_rules! with_pairs {
    ($pairs:expr, $name:ident => $body:expr) => {
        match $pairs {
            $crate::reference::Pairs::Lean($name) => $body,
            $crate::reference::Pairs::Closed($name) => $body,
            $crate::reference::Pairs::Stored($name) => $body,
        }
    };
}
pub(crate) use with_pairs;
