//! One stage of the integrator over the fields of a slab.

use super::passes::{lanes_of, load_slab3, load_slab9};
use super::url::State;
use crate::lane::{Lane, Work};
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

/// One stage of the integrator for one slab: y = keep y0 + take (y + dt dy/dt).
pub(super) struct Advance<'a> {
    pub reference: &'a Reference,
    pub start: &'a State,
    pub force: [&'a [f64]; 3],
    pub grad_v: [&'a [f64]; 9],
    pub j_rate: Option<&'a [f64]>,
    pub heating: Option<Heating<'a>>,
    pub density: f64,
    pub keep: f64,
    pub take: f64,
    pub dt: f64,
    pub slab: usize,
    pub out: StateSlab<'a>,
}

impl Work for Advance<'_> {
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
            let x = load_slab3::<T>(token, &out.x, at);
            let v = load_slab3::<T>(token, &out.v, at);
            let f = load_slab9::<T>(token, &out.f, at);
            let grad = load9::<T>(token, &self.grad_v, a);
            // Dummies have no volume and no force.
            let v_r = T::load(token, volume, a);
            let mass = density.mul_add(v_r, T::splat(token, f64::MIN_POSITIVE));
            let acceleration = scale3(T::splat(token, 1.0) / mass, load3(token, &self.force, a));
            store3(&blend.vector(load3(token, &x0, a), x, v), &mut out.x, at);
            store3(
                &blend.vector(load3(token, &v0, a), v, acceleration),
                &mut out.v,
                at,
            );
            store9(
                &blend.tensor(&load9(token, &f0, a), &f, &grad),
                &mut out.f,
                at,
            );
            if let (Some(eta), Some(eta0), Some(heating)) = (&mut out.eta, eta0, self.heating) {
                // V_R d eta/dt = Q/theta ([URL23] 67).
                let theta = heating.thermal.divisor(T::load(token, heating.theta, a));
                let capacity = v_r.mul_add(theta, T::splat(token, f64::MIN_POSITIVE));
                let rate = T::load(token, heating.heat, a) / capacity;
                let now = T::load(token, eta, at);
                blend
                    .scalar(T::load(token, eta0, a), now, rate)
                    .store(eta, at);
            }
            if let (Some(j), Some(j0)) = (&mut out.j, j0) {
                // dj/dt = h : grad v (56), with h = cof f where it is not independent.
                let h = match &out.h {
                    Some(h) => load_slab9::<T>(token, h, at),
                    None => cofactor(&f),
                };
                let mut rate = double_dot(&h, &grad);
                if let Some(extra) = self.j_rate {
                    rate = rate + T::load(token, extra, a);
                }
                let now = T::load(token, j, at);
                blend.scalar(T::load(token, j0, a), now, rate).store(j, at);
            }
            if let (Some(h), Some(h0)) = (&mut out.h, &h0) {
                // dh/dt = f x grad v (55).
                let now = load_slab9::<T>(token, h, at);
                store9(
                    &blend.tensor(&load9(token, h0, a), &now, &tensor_cross(&f, &grad)),
                    h,
                    at,
                );
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
