//! Fourier conduction in the form of [URL23] (67) whose entropy production is a sum of squares.
//!
//! With the conduction variable beta = 1/theta the flux q = k theta^2 grad beta, and the heat
//! Q_a = -sum_b (w_a . g_ab - w_b . g_ba), w = S^T q, produces the entropy
//! sum_a beta_a Q_a = sum_a v k theta^2 |grad beta|^2 >= 0 exactly ([URL23] 74, whose last equality
//! holds for this q and not for q = -k grad theta).
//!
//! A gradient of a gradient does not see a temperature that alternates from particle to particle.
//! So the pairs exchange heat by what the gradients of both sides leave of their jump,
//!
//! s_ab = K_ab [beta_b - beta_a - 1/2 (grad beta_a + grad beta_b) . x_ab],
//! K_ab = e k theta_a theta_b |c_ab|/|x_ab|,
//!
//! and its transpose goes into the fluxes, q_a <- q_a - sum_b s_ab x_ab/(2 v_a), so that the whole
//! produces sum_a v k theta^2 |grad beta|^2 + sum_ab s_ab^2/(2 K_ab). It vanishes for a linear beta.

use super::passes::{ForceInput, HalfSlope, Kinematics, lanes_of};
use super::riemann;
use super::url::Runner;
use crate::lane::{Lane, PerSlot, Real, Work};
use crate::layout::{Array, Layout};
use crate::material::Thermal;
use crate::math::*;
use crate::parallel;
use crate::reference::{PairVectors, Reference, load3, load9, store3, with_pairs};

/// e above: an alternating temperature then decays as fast as the gradients' highest mode, so that
/// the term costs nothing of the stable step.
const JUMP_SHARE: f64 = 0.25;

/// Stable step over l^2 c_v/k, l the shortest edge or 5/kappa_a, kappa_a = sum |c_ab|/v_a, whatever is
/// less. A free block of 9^3 particles with random temperatures decays up to 0.38, 0.75 and 0.95 times
/// |x|^2 c_v/k with 6, 18 and 26 neighbours, where kappa |x| is 6, 4.8 and 4.6. A body that bears less
/// has a share of its own ([`Conduction::calibrate`]).
const STABLE_SHARE: f64 = 0.5;
/// Where the integrator's stable interval ends on the negative real axis.
const REAL_AXIS: f64 = 2.512_745_326_618_33;
/// What is taken of it, because the power iteration finds the fastest decay from below.
const SAFETY: f64 = 0.92;
/// Steps of the power iteration: they found 0.973 of the fastest decay at least, of what 1000 find, in
/// bars, plates and blocks with 6 and 18 neighbours and with 20 % jitter.
const POWER_STEPS: usize = 40;

/// Conduction of one body.
#[derive(Debug)]
pub(super) struct Conduction {
    thermal: Thermal,
    /// Stable step over l^2 c_v/k: see [`STABLE_SHARE`].
    share: f64,
    /// Half the spatial gradient of beta [1/(K m)].
    half_slope: Array<3>,
    /// w_a.
    flux: Array<3>,
}

impl Conduction {
    pub fn new(layout: Layout, thermal: Thermal) -> Self {
        Self {
            thermal,
            share: STABLE_SHARE,
            half_slope: Array::new(layout, [0.0; 3]),
            flux: Array::new(layout, [0.0; 3]),
        }
    }

    /// Heat into each particle [W]; the entropy produced [W/K] and the stable step [s].
    pub fn rates<R: Runner>(
        &mut self,
        input: &ForceInput<impl Real, f64>,
        kinematics: &Kinematics,
        theta: &Array<2>,
        heat: &mut Array<1>,
    ) -> (f64, f64) {
        let (reference, kinematics, thermal) = (input.reference, *kinematics, self.thermal);
        let [theta, beta] = theta.components();
        parallel::map_slabs(self.half_slope.slabs_mut(), |slab, out| {
            with_pairs!(reference.pair_vectors(), pairs => R::run(HalfSlope {
                pairs, reference, kinematics, field: beta, slab, out,
            }));
        });
        let half_slope = self.half_slope.components();
        let slabs: Vec<_> = std::iter::zip(self.flux.slabs_mut(), heat.slabs_mut()).collect();
        let found = parallel::map_slabs(slabs, |slab, (flux, [heat])| {
            with_pairs!(reference.pair_vectors(), pairs => R::run(Jumps {
                pairs, input: *input, kinematics, thermal, theta, beta, half_slope, slab, flux, heat,
            }))
        });
        let flux = self.flux.components();
        parallel::map_slabs(heat.slabs_mut(), |slab, [heat]| {
            with_pairs!(reference.pair_vectors(), pairs => R::run(Divergence {
                pairs, reference, flux, slab, heat,
            }));
        });
        let (entropy, length2) = found
            .into_iter()
            .fold((0.0, f64::INFINITY), |(s, l), (production, length2)| {
                (s + production, l.min(length2))
            });
        let step = self.share * length2 * thermal.c_v / thermal.conductivity;
        (entropy, step)
    }

    /// Lowers the stable step, if it is beyond what the body bears as it is now; `heat` is lost.
    ///
    /// What a particle knows of itself does not tell how fast its temperature may decay: with one cell from
    /// side to side the gradients of both ends follow the same difference, and a bar of 2 x 2 rows
    /// bears 0.65 times, a cube of 2^3 particles 0.55 times the step of a block.
    pub fn calibrate<R: Runner>(
        &mut self,
        input: &ForceInput<impl Real, f64>,
        kinematics: &Kinematics,
        heat: &mut Array<1>,
    ) {
        let layout = input.reference.layout;
        let volume = input.reference.volume.components()[0];
        let theta_r = self.thermal.theta_r;
        let slots = || (0..layout.particles).map(Layout::slot);
        let mut theta = Array::new(layout, [theta_r, 0.0]);
        // Any start that has something of every mode, the same every time.
        for slot in slots() {
            let noise = (slot as f64 * 0.618_033_988_749_894_9).fract() - 0.5;
            theta.set(slot, [theta_r, noise]);
        }
        let (mut decay, mut step) = (0.0, 0.0);
        for _ in 0..POWER_STEPS {
            (_, step) = self.rates::<R>(input, kinematics, &theta, heat);
            let (mut before, mut after) = (0.0, 0.0);
            for slot in slots() {
                let rate =
                    heat.get(slot)[0] / (volume[slot] * self.thermal.c_v * theta_r * theta_r);
                before += volume[slot] * theta.get(slot)[1].powi(2);
                after += volume[slot] * rate * rate;
                theta.set(slot, [theta_r, rate]);
            }
            decay = (after / before).sqrt();
            let unit = after.sqrt().recip();
            for slot in slots() {
                let rate = theta.get(slot)[1];
                theta.set(slot, [theta_r, unit * rate]);
            }
        }
        let bearable = SAFETY * REAL_AXIS / decay;
        if bearable < step {
            self.share *= bearable / step;
        }
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        self.half_slope.bytes() + self.flux.bytes()
    }
}

/// s_ab and the fluxes; (entropy produced, smallest |x_ab|^2 V_R/v) of the slab.
struct Jumps<'a, P, E: Real> {
    pairs: P,
    input: ForceInput<'a, E, f64>,
    kinematics: Kinematics<'a>,
    thermal: Thermal,
    theta: &'a [f64],
    beta: &'a [f64],
    half_slope: [&'a [f64]; 3],
    slab: usize,
    flux: [&'a mut [f64]; 3],
    heat: &'a mut [f64],
}

impl<P: PairVectors, E: Real> Work for Jumps<'_, P, E> {
    type Output = (f64, f64);
    #[inline(always)]
    fn run<T: Lane>(mut self, token: T::Token) -> (f64, f64) {
        let (input, pairs) = self.input.level::<P, { riemann::CONSTANT }>(self.pairs);
        let thermal = self.thermal;
        let slices = &input.reference.slices;
        let weights = slices.weights();
        let volume = input.reference.volume.components()[0];
        let far = T::splat(token, f64::INFINITY);
        let tiny = T::splat(token, f64::MIN_POSITIVE);
        let half = T::splat(token, 0.5);
        let conductivity = T::splat(token, thermal.conductivity);
        let share = T::splat(token, JUMP_SHARE * thermal.conductivity);
        let (mut produced, mut shortest) = (PerSlot::new(0.0), PerSlot::new(f64::INFINITY));
        for (at, a) in lanes_of::<T>(input.reference, self.slab) {
            let centre = pairs.centre::<T>(token, a);
            let sa = input.area::<T>(token, a);
            let (xa, beta_a) = (input.position::<T>(token, a), T::load(token, self.beta, a));
            let theta_a = thermal.divisor(T::load(token, self.theta, a));
            let slope_a = load3::<T>(token, &self.half_slope, a);
            let (mut sum, mut moment) = (T::splat(token, 0.0), zero3(token));
            let mut entropy = T::splat(token, 0.0);
            let (mut length2, mut areas) = (far, tiny);
            for (b, pair) in slices.of(a) {
                let (g, back) = pairs.pair(token, &centre, b, pair);
                let dx = sub3(input.position(token, b), xa);
                let dx2 = dot(dx, dx);
                let mask = T::load(token, weights, pair);
                length2 = length2.min(mask.if_positive(dx2, far));
                let c = input.pair_area(&sa, b, (g, back));
                let theta_b = thermal.divisor(T::load(token, self.theta, b));
                let norm = dot(c, c).sqrt();
                areas = areas + norm;
                let k = share * theta_a * theta_b * norm / (dx2 + tiny).sqrt();
                let slopes = add3(slope_a, load3(token, &self.half_slope, b));
                let jump = T::load(token, self.beta, b) - beta_a - dot(slopes, dx);
                let s = k * jump;
                sum = sum + s;
                moment = axpy3(moment, s, dx);
                entropy = s.mul_add(jump, entropy);
            }
            (-sum).store(self.heat, at);
            // v = V_chi det f.
            let f = load9::<T>(token, &self.kinematics.f, a);
            let v_r = T::load(token, volume, a);
            let mut v = v_r * dot(f[0], cofactor(&f)[0]);
            if let Some(j_chi) = self.kinematics.j_chi {
                v = v * T::load(token, j_chi, a);
            }
            let slope = add3(slope_a, slope_a);
            let conductance = conductivity * theta_a * theta_a;
            let q = axpy3(scale3(conductance, slope), -half / (v + tiny), moment);
            store3(&vec_mat(q, &sa), &mut self.flux, at);
            produced.add(
                at,
                (v * conductance).mul_add(dot(slope, slope), half * entropy),
            );
            let reach = T::splat(token, 5.0) * v / areas;
            let limit = length2.min(reach * reach) * v_r / v;
            shortest.min(at, v.if_positive(limit, far));
        }
        (produced.sum(), shortest.least())
    }
}

/// Heat by the divergence of the fluxes.
struct Divergence<'a, P> {
    pairs: P,
    reference: &'a Reference,
    flux: [&'a [f64]; 3],
    slab: usize,
    heat: &'a mut [f64],
}

impl<P: PairVectors> Work for Divergence<'_, P> {
    type Output = ();
    #[inline(always)]
    fn run<T: Lane>(self, token: T::Token) {
        for (at, a) in lanes_of::<T>(self.reference, self.slab) {
            let centre = self.pairs.centre::<T>(token, a);
            let flux_a = load3::<T>(token, &self.flux, a);
            let mut heat = T::load(token, self.heat, at);
            for (b, pair) in self.reference.slices.of(a) {
                let (g, back) = self.pairs.pair(token, &centre, b, pair);
                heat = heat - (dot(flux_a, g) - dot(load3(token, &self.flux, b), back));
            }
            heat.store(self.heat, at);
        }
    }
}
