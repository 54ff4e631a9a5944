//! One stage of the integrator over the fields of a slab.

use super::passes::{lanes_of, load_slab3, load_slab9};
use super::url::State;
use crate::lane::{Lane, Real, Work};
use crate::layout::Array;
use crate::material::Thermal;
use crate::math::*;
use crate::reference::{Reference, load3, load9, store3, store9};

/// Fields of a state in one slab.
pub(super) struct StateSlab<'a> {
    pub x: [&'a mut [f64]; 3],
    pub v: [&'a mut [f64]; 3],
    pub f: [&'a mut [f64]; 9],
    pub h: Option<[&'a mut [f64]; 9]>,
    pub j: Option<&'a mut [f64]>,
    pub eta: Option<&'a mut [f64]>,
}

/// What turns heat rates into rates of entropy.
#[derive(Clone, Copy)]
pub(super) struct Heating<'a> {
    pub thermal: Thermal,
    /// Heat into each particle [W].
    pub heat: &'a [f64],
    /// Temperature [K].
    pub theta: &'a [f64],
}

/// One stage of the integrator for one slab: y = keep y0 + take (y + dt dy/dt); of the first stage y is y0, and what
/// stands in `out` does not matter.
pub(super) struct Advance<'a, E, const FIRST: bool> {
    pub reference: &'a Reference,
    pub start: &'a State,
    pub force: [&'a [f64]; 3],
    pub grad_v: [&'a [E]; 9],
    pub j_rate: Option<&'a [f64]>,
    pub heating: Option<Heating<'a>>,
    pub density: f64,
    pub keep: f64,
    pub take: f64,
    pub dt: f64,
    pub slab: usize,
    pub out: StateSlab<'a>,
}

impl<E: Real, const FIRST: bool> Work for Advance<'_, E, FIRST> {
    type Output = ();
    #[inline(always)]
    fn run<T: Lane>(mut self, token: T::Token) {
        let blend = Blend {
            keep: T::splat(token, self.keep),
            take: T::splat(token, self.take),
            dt: T::splat(token, self.dt),
        };
        let volume = self.reference.volume.components()[0];
        let start = self.start;
        let (x0, v0, f0) = (
            start.x.components(),
            start.v.components(),
            start.f.components(),
        );
        let h0 = start.h.as_ref().map(Array::components);
        let j0 = start.j.as_ref().map(|j| j.components()[0]);
        let eta0 = start.eta.as_ref().map(|e| e.components()[0]);
        let density = T::splat(token, self.density);
        for (at, a) in lanes_of::<T>(self.reference, self.slab) {
            let out = &mut self.out;
            let (start_x, start_v) = (load3::<T>(token, &x0, a), load3::<T>(token, &v0, a));
            let start_f = load9::<T>(token, &f0, a);
            let (mut x, mut v, mut f) = (start_x, start_v, start_f);
            if !FIRST {
                x = load_slab3(token, &out.x, at);
                v = load_slab3(token, &out.v, at);
                f = load_slab9(token, &out.f, at);
            }
            let grad = load9::<T>(token, &self.grad_v, a);
            // Dummies have no volume and no force.
            let v_r = T::load(token, volume, a);
            let mass = density.mul_add(v_r, T::splat(token, f64::MIN_POSITIVE));
            let acceleration = scale3(T::splat(token, 1.0) / mass, load3(token, &self.force, a));
            store3(&blend.vector(start_x, x, v), &mut out.x, at);
            store3(&blend.vector(start_v, v, acceleration), &mut out.v, at);
            store9(&blend.tensor(&start_f, &f, &grad), &mut out.f, at);
            if let (Some(eta), Some(eta0), Some(heating)) = (&mut out.eta, eta0, self.heating) {
                // V_R d eta/dt = Q/theta ([URL23] 67).
                let theta = heating.thermal.divisor(T::load(token, heating.theta, a));
                let capacity = v_r.mul_add(theta, T::splat(token, f64::MIN_POSITIVE));
                let rate = T::load(token, heating.heat, a) / capacity;
                let start = T::load(token, eta0, a);
                let now = if FIRST {
                    start
                } else {
                    T::load(token, eta, at)
                };
                blend.scalar(start, now, rate).store(eta, at);
            }
            let start_h = h0.as_ref().map(|h0| load9::<T>(token, h0, a));
            let h = match (&out.h, FIRST) {
                (Some(h), false) => Some(load_slab9::<T>(token, h, at)),
                _ => start_h,
            };
            if let (Some(j), Some(j0)) = (&mut out.j, j0) {
                // dj/dt = h : grad v (56), with h = cof f where it is not independent.
                let mut rate = double_dot(&h.unwrap_or_else(|| cofactor(&f)), &grad);
                if let Some(extra) = self.j_rate {
                    rate = rate + T::load(token, extra, a);
                }
                let start = T::load(token, j0, a);
                let now = if FIRST { start } else { T::load(token, j, at) };
                blend.scalar(start, now, rate).store(j, at);
            }
            if let (Some(out), Some(start), Some(h)) = (&mut out.h, start_h, h) {
                // dh/dt = f x grad v (55).
                store9(&blend.tensor(&start, &h, &tensor_cross(&f, &grad)), out, at);
            }
        }
    }
}

/// keep y0 + take (y + dt k) on lanes.
#[derive(Clone, Copy)]
struct Blend<T> {
    keep: T,
    take: T,
    dt: T,
}

impl<T: Lane> Blend<T> {
    #[inline(always)]
    fn scalar(&self, y0: T, y: T, k: T) -> T {
        self.take.mul_add(self.dt.mul_add(k, y), self.keep * y0)
    }
    #[inline(always)]
    fn vector(&self, y0: Vec3<T>, y: Vec3<T>, k: Vec3<T>) -> Vec3<T> {
        [
            self.scalar(y0[0], y[0], k[0]),
            self.scalar(y0[1], y[1], k[1]),
            self.scalar(y0[2], y[2], k[2]),
        ]
    }
    #[inline(always)]
    fn tensor(&self, y0: &Mat3<T>, y: &Mat3<T>, k: &Mat3<T>) -> Mat3<T> {
        [
            self.vector(y0[0], y[0], k[0]),
            self.vector(y0[1], y[1], k[1]),
            self.vector(y0[2], y[2], k[2]),
        ]
    }
}
