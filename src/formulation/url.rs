//! Updated Reference Lagrangian SPH, isothermal ([URL22] section 4.3).
//!
//! One evaluation has three passes over the body, each in slabs:
//! 1. gradient: grad_chi v from the neighbours' velocities (54);
//! 2. point: stress and everything else that belongs to one particle;
//! 3. force: T_a (57) from the neighbours' stresses and the Riemann dissipation (59).
//!
//! With g_ab, L_a as in [`crate::reference`] the force of a pair is Q_a g_ab - Q_b g_ba + D_ab,
//! Q = V_chi sigma_chi L = V_R P F_chi^T L, and its spatial area c_ab = S_a g_ab - S_b g_ba,
//! S = V_chi h L.

use super::limiter;
use super::riemann::{self, Pair, WaveSpeeds};
use crate::lane::{F64x8, Lane, WIDTH, vectorised};
use crate::layout::{Array, Layout};
use crate::material::{Deformation, Law, Material, with_law};
use crate::math::*;
use crate::parallel;
use crate::reference::{PairVectors, Pairs, Reference, load3, load9, store3, store9};
use crate::scene::{Limiter, Numerics, Reconstruction, StateMeasures};

/// The evolving fields: with the time, what the integrator advances and a snapshot copies.
#[derive(Debug, Clone, PartialEq)]
pub struct State {
    /// x [m], current.
    pub x: Array<3>,
    /// v [m/s], current.
    pub v: Array<3>,
    /// f, reference to current.
    pub f: Array<9>,
    /// h, reference to current; only where independent of f.
    pub h: Option<Array<9>>,
    /// j, reference to current; only where independent of f.
    pub j: Option<Array<1>>,
}

/// Rates of the state, before loads and supports.
#[derive(Debug)]
pub struct Rates {
    /// T_a [N]: internal force; loads are added in place when a stage is assembled.
    pub force: Array<3>,
    /// grad_chi v [1/s], reference.
    pub grad_v: Array<9>,
    /// dj/dt by the dissipation D^j alone [1/s]; only where D^j is on.
    pub j_dissipation: Option<Array<1>>,
}

/// Per-particle quantities that neighbours read in the force pass; recomputed in every evaluation.
#[derive(Debug)]
struct Scratch {
    /// Q_a.
    q: Array<9>,
    /// S_a.
    s: Array<9>,
    /// Half the spatial velocity gradient, 1/2 grad_chi v f^-1, limited if a limiter is on [1/s].
    half_grad: Array<9>,
    /// (smallest stretch, spatial density).
    wave: Array<2>,
    /// Sigma_J [Pa] and half its spatial gradient [Pa/m]; only where D^j is on.
    sigma_j: Option<(Array<1>, Array<3>)>,
}

/// Sums over the body and what an evaluation found, in a fixed order.
#[derive(Debug, Clone, Copy, Default)]
pub struct Evaluation {
    /// Kinetic energy [J].
    pub kinetic: f64,
    /// Strain energy [J].
    pub strain: f64,
    /// Power of the dissipation terms [W], positive where they take energy out.
    pub dissipation: f64,
    /// Smallest |x_ab| lambda_ab over all pairs [m]: the stable step times the linear wave speed.
    pub length: f64,
}

/// A particle at which the solution broke down.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Breakdown {
    /// Its slot.
    pub slot: usize,
    /// J there.
    pub jacobian: f64,
}

/// What the scene asks of the formulation, resolved to what the loops branch on.
#[derive(Debug, Clone, Copy)]
struct Options {
    state: StateMeasures,
    mode: u8,
    venkatakrishnan: bool,
    volume_dissipation: f64,
    linear: bool,
}

/// The formulation of one body.
#[derive(Debug)]
pub struct Url {
    law: Law,
    options: Options,
    scratch: Scratch,
    /// Rates of the last evaluation.
    pub rates: Rates,
}

const IDENTITY: [f64; 9] = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];

impl State {
    /// A body at rest in its initial configuration.
    pub fn at_rest(reference: &Reference, measures: StateMeasures) -> Self {
        let layout = reference.layout;
        Self {
            x: reference.x_initial.clone(),
            v: Array::new(layout, [0.0; 3]),
            f: Array::new(layout, IDENTITY),
            h: (measures == StateMeasures::Fhj).then(|| Array::new(layout, IDENTITY)),
            j: (measures != StateMeasures::F).then(|| Array::new(layout, [1.0])),
        }
    }
    /// Copies another state of the same body.
    pub fn copy_from(&mut self, other: &Self) {
        self.x.copy_from(&other.x);
        self.v.copy_from(&other.v);
        self.f.copy_from(&other.f);
        if let (Some(a), Some(b)) = (&mut self.h, &other.h) {
            a.copy_from(b);
        }
        if let (Some(a), Some(b)) = (&mut self.j, &other.j) {
            a.copy_from(b);
        }
    }
    /// Bytes held.
    pub fn bytes(&self) -> usize {
        self.x.bytes()
            + self.v.bytes()
            + self.f.bytes()
            + self.h.as_ref().map_or(0, Array::bytes)
            + self.j.as_ref().map_or(0, Array::bytes)
    }
}

/// Read access to a state and its reference, by components.
#[derive(Clone, Copy)]
struct Kinematics<'a> {
    f: [&'a [f64]; 9],
    h: Option<[&'a [f64]; 9]>,
    j: Option<&'a [f64]>,
    f_chi: Option<[&'a [f64]; 9]>,
    h_chi: Option<[&'a [f64]; 9]>,
    j_chi: Option<&'a [f64]>,
}

impl<'a> Kinematics<'a> {
    fn new(state: &'a State, reference: &'a Reference) -> Self {
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
    /// `STATE` counts the independent measures beside f, `UPDATED` tells whether there is a
    /// reference beside the initial configuration: both known when the loop is compiled.
    #[inline(always)]
    fn total<T: Lane, const STATE: u8, const UPDATED: bool>(&self, at: usize) -> Deformation<T> {
        let mut f = load9::<T>(&self.f, at);
        if UPDATED && let Some(f_chi) = &self.f_chi {
            f = mat_mul(&f, &load9(f_chi, at));
        }
        let mut h = cofactor(&f);
        let mut j = dot(f[0], h[0]);
        if STATE >= 1
            && let Some(own) = self.j
        {
            j = T::load(own, at);
            if UPDATED && let Some(j_chi) = self.j_chi {
                j = j * T::load(j_chi, at);
            }
        }
        if STATE >= 2
            && let Some(own) = &self.h
        {
            h = load9(own, at);
            if UPDATED && let Some(h_chi) = &self.h_chi {
                h = mat_mul(&h, &load9(h_chi, at));
            }
        }
        Deformation { f, h, j }
    }
}

impl Url {
    /// The formulation for a body.
    pub fn new(reference: &Reference, law: Law, numerics: &Numerics) -> Self {
        let layout = reference.layout;
        let linear = numerics.reconstruction == Reconstruction::Linear;
        let mode = match (numerics.dissipation, linear, numerics.limiter) {
            (false, ..) => riemann::OFF,
            (true, false, _) => riemann::CONSTANT,
            (true, true, Limiter::Minmod) => riemann::MINMOD,
            (true, true, _) => riemann::LINEAR,
        };
        let volume = numerics.volume_dissipation > 0.0;
        Self {
            law,
            options: Options {
                state: numerics.state,
                mode,
                venkatakrishnan: numerics.limiter == Limiter::Venkatakrishnan,
                volume_dissipation: numerics.volume_dissipation,
                linear,
            },
            scratch: Scratch {
                q: Array::new(layout, [0.0; 9]),
                s: Array::new(layout, [0.0; 9]),
                half_grad: Array::new(layout, [0.0; 9]),
                wave: Array::new(layout, [1.0; 2]),
                sigma_j: volume.then(|| (Array::new(layout, [0.0]), Array::new(layout, [0.0; 3]))),
            },
            rates: Rates {
                force: Array::new(layout, [0.0; 3]),
                grad_v: Array::new(layout, [0.0; 9]),
                j_dissipation: volume.then(|| Array::new(layout, [0.0])),
            },
        }
    }

    /// Wave speeds of the linearised law [m/s].
    pub fn wave_speeds(&self) -> WaveSpeeds<f64> {
        with_law!(self.law, law => WaveSpeeds {
            pressure: law.pressure_wave_speed(),
            shear: law.shear_wave_speed(),
        })
    }

    /// The law.
    pub fn law(&self) -> Law {
        self.law
    }

    /// Total deformation of the particle in a slot.
    pub fn deformation(
        &self,
        state: &State,
        reference: &Reference,
        slot: usize,
    ) -> Deformation<f64> {
        self.total_of(&Kinematics::new(state, reference), slot)
    }

    #[inline(always)]
    fn total_of<T: Lane>(&self, kinematics: &Kinematics, at: usize) -> Deformation<T> {
        match self.options.state {
            StateMeasures::F => kinematics.total::<T, 0, true>(at),
            StateMeasures::Fj => kinematics.total::<T, 1, true>(at),
            StateMeasures::Fhj => kinematics.total::<T, 2, true>(at),
        }
    }

    /// Rates of a state.
    ///
    /// # Errors
    /// The first particle whose J is not positive and finite.
    pub fn evaluate(
        &mut self,
        state: &State,
        reference: &Reference,
    ) -> std::result::Result<Evaluation, Breakdown> {
        self.evaluate_with::<F64x8>(state, reference)
    }

    /// The same on lanes of a given width: one particle at a time is the readable form against
    /// which the wide form is tested.
    pub(crate) fn evaluate_with<T: Lane>(
        &mut self,
        state: &State,
        reference: &Reference,
    ) -> std::result::Result<Evaluation, Breakdown> {
        let mut total = Evaluation {
            length: f64::INFINITY,
            ..Evaluation::default()
        };
        for point in self.points::<T>(state, reference) {
            let (strain, kinetic) = point?;
            total.strain += strain;
            total.kinetic += kinetic;
        }
        if self.options.venkatakrishnan {
            self.limit::<T>(state, reference);
        }
        for (dissipation, length2) in self.forces::<T>(state, reference) {
            total.dissipation += dissipation;
            total.length = total.length.min(length2);
        }
        total.length = total.length.sqrt();
        if self.scratch.sigma_j.is_some() {
            total.dissipation += self.volume_rates::<T>(state, reference);
        }
        Ok(total)
    }

    /// Gradient and point passes; strain and kinetic energy by slab.
    fn points<T: Lane>(
        &mut self,
        state: &State,
        reference: &Reference,
    ) -> Vec<std::result::Result<(f64, f64), Breakdown>> {
        let Self {
            law,
            options,
            scratch,
            rates,
        } = self;
        let layout = reference.layout;
        let velocity = state.v.components();
        let kinematics = Kinematics::new(state, reference);
        let updated = reference.updated.is_some();
        let sigma_j = scratch.sigma_j.as_mut().map(|(s, _)| s.slabs_mut());
        let mut sigma_j = sigma_j.map(Vec::into_iter);
        let slabs: Vec<_> = rates
            .grad_v
            .slabs_mut()
            .into_iter()
            .zip(scratch.q.slabs_mut())
            .zip(scratch.s.slabs_mut())
            .zip(scratch.half_grad.slabs_mut())
            .zip(scratch.wave.slabs_mut())
            .map(|((((grad_v, q), s), half_grad), wave)| {
                let sigma_j = sigma_j.as_mut().and_then(Iterator::next).map(|[s]| s);
                PointOutput {
                    grad_v,
                    q,
                    s,
                    half_grad,
                    wave,
                    sigma_j,
                }
            })
            .collect();
        parallel::map_slabs(slabs, |slab, mut out| {
            let (first, slices) = layout.slab_range(slab);
            match reference.pair_vectors() {
                Pairs::Lean(p) => {
                    gradient_slab::<T, _>(p, reference, &velocity, first, slices, &mut out.grad_v)
                }
                Pairs::Stored(p) => {
                    gradient_slab::<T, _>(p, reference, &velocity, first, slices, &mut out.grad_v)
                }
            }
            macro_rules! point {
                ($law:expr, $($state:pat => $n:literal),*) => {
                    match (options.state, updated) {
                        $(($state, false) => point_slab::<T, _, $n, false>(
                            $law, &kinematics, reference, &velocity, first, slices, &mut out),
                        ($state, true) => point_slab::<T, _, $n, true>(
                            $law, &kinematics, reference, &velocity, first, slices, &mut out),)*
                    }
                };
            }
            with_law!(*law, law => point!(
                law, StateMeasures::F => 0, StateMeasures::Fj => 1, StateMeasures::Fhj => 2
            ))
        })
    }

    /// Scales the gradients for the reconstruction by Venkatakrishnan's limiter.
    fn limit<T: Lane>(&mut self, state: &State, reference: &Reference) {
        let layout = reference.layout;
        let (x, v) = (state.x.components(), state.v.components());
        let weights = reference.slices.weights();
        parallel::map_slabs(self.scratch.half_grad.slabs_mut(), |slab, mut half_grad| {
            let (first, slices) = layout.slab_range(slab);
            vectorised(
                #[inline(always)]
                || {
                    for at in (0..slices * WIDTH).step_by(T::WIDTH) {
                        let a = first + at;
                        let (xa, va) = (load3::<T>(&x, a), load3::<T>(&v, a));
                        let zero = T::splat(0.0);
                        let (mut rise, mut fall) = ([zero; 3], [zero; 3]);
                        reference.slices.for_each::<T>(a, |b, pair| {
                            let mask = T::load(weights, pair);
                            let dv = sub3(load3(&v, b), va);
                            for c in 0..3 {
                                rise[c] = mask.if_positive(rise[c].max(dv[c]), rise[c]);
                                fall[c] = mask.if_positive(fall[c].min(dv[c]), fall[c]);
                            }
                        });
                        let mut grad = load_slab9::<T>(&half_grad, at);
                        let mut phi = [T::splat(1.0); 3];
                        reference.slices.for_each::<T>(a, |b, pair| {
                            let mask = T::load(weights, pair);
                            let step = mat_vec(&grad, sub3(load3(&x, b), xa));
                            for c in 0..3 {
                                let limited = limiter::venkatakrishnan(rise[c], fall[c], step[c]);
                                phi[c] = mask.if_positive(phi[c].min(limited), phi[c]);
                            }
                        });
                        for c in 0..3 {
                            grad[c] = scale3(phi[c], grad[c]);
                        }
                        store9(&grad, &mut half_grad, at);
                    }
                },
            );
        });
    }

    /// Force pass; power of the dissipation and squared length by slab.
    fn forces<T: Lane>(&mut self, state: &State, reference: &Reference) -> Vec<(f64, f64)> {
        let speeds = self.wave_speeds();
        let Self {
            options,
            scratch,
            rates,
            ..
        } = self;
        let input = ForceInput::new(state, reference, scratch);
        parallel::map_slabs(rates.force.slabs_mut(), |slab, mut out| {
            let (first, slices) = reference.layout.slab_range(slab);
            macro_rules! force {
                ($pairs:expr, $($mode:ident),*) => {
                    match options.mode {
                        $(riemann::$mode => force_slab::<T, _, { riemann::$mode }>(
                            $pairs, reference, &input, speeds, first, slices, &mut out),)*
                        _ => unreachable!("four modes"),
                    }
                };
            }
            match reference.pair_vectors() {
                Pairs::Lean(p) => force!(p, CONSTANT, LINEAR, MINMOD, OFF),
                Pairs::Stored(p) => force!(p, CONSTANT, LINEAR, MINMOD, OFF),
            }
        })
    }

    /// dj/dt by D^j; returns the power that it dissipates.
    fn volume_rates<T: Lane>(&mut self, state: &State, reference: &Reference) -> f64 {
        let speed = self.wave_speeds().pressure;
        let Self {
            options,
            scratch,
            rates,
            ..
        } = self;
        let (Some((sigma_j, slope)), Some(out)) =
            (scratch.sigma_j.take(), rates.j_dissipation.as_mut())
        else {
            return 0.0;
        };
        let (sigma, mut slope) = (sigma_j.components()[0], slope);
        let kinematics = Kinematics::new(state, reference);
        if options.linear {
            parallel::map_slabs(slope.slabs_mut(), |slab, mut out| {
                let (first, slices) = reference.layout.slab_range(slab);
                match reference.pair_vectors() {
                    Pairs::Lean(p) => {
                        half_slope_slab::<T, _>(
                            p,
                            reference,
                            &kinematics,
                            sigma,
                            first,
                            slices,
                            &mut out,
                        );
                    }
                    Pairs::Stored(p) => {
                        half_slope_slab::<T, _>(
                            p,
                            reference,
                            &kinematics,
                            sigma,
                            first,
                            slices,
                            &mut out,
                        );
                    }
                }
            });
        }
        let input = ForceInput::new(state, reference, scratch);
        let volume = VolumeInput {
            sigma,
            slope: slope.components(),
            j_chi: kinematics.j_chi,
            speed,
            coefficient: options.volume_dissipation,
        };
        let powers = parallel::map_slabs(out.slabs_mut(), |slab, [out]| {
            let (first, slices) = reference.layout.slab_range(slab);
            match reference.pair_vectors() {
                Pairs::Lean(p) => {
                    volume_slab::<T, _>(p, reference, &input, &volume, first, slices, out)
                }
                Pairs::Stored(p) => {
                    volume_slab::<T, _>(p, reference, &input, &volume, first, slices, out)
                }
            }
        });
        scratch.sigma_j = Some((sigma_j, slope));
        powers.iter().sum()
    }

    /// One stage of the integrator: y = keep y0 + take (y + dt dy/dt) for all fields, from the
    /// rates with loads in place.
    pub fn advance_stage(
        &self,
        state: &mut State,
        start: &State,
        reference: &Reference,
        (keep, take): (f64, f64),
        dt: f64,
    ) {
        let layout = reference.layout;
        let density = self.law.density();
        let volume = reference.volume.components()[0];
        let (force, grad_v) = (
            self.rates.force.components(),
            self.rates.grad_v.components(),
        );
        let j_rate = self.rates.j_dissipation.as_ref().map(|r| r.components()[0]);
        let (x0, v0, f0) = (
            start.x.components(),
            start.v.components(),
            start.f.components(),
        );
        let h0 = start.h.as_ref().map(Array::components);
        let j0 = start.j.as_ref().map(|j| j.components()[0]);
        let mut h = state.h.as_mut().map(|h| h.slabs_mut().into_iter());
        let mut j = state.j.as_mut().map(|j| j.slabs_mut().into_iter());
        let slabs: Vec<_> = state
            .x
            .slabs_mut()
            .into_iter()
            .zip(state.v.slabs_mut())
            .zip(state.f.slabs_mut())
            .map(|((x, v), f)| {
                let h = h.as_mut().and_then(Iterator::next);
                let j = j.as_mut().and_then(Iterator::next).map(|[j]| j);
                (x, v, f, h, j)
            })
            .collect();
        parallel::map_slabs(slabs, |slab, (mut x, mut v, mut f, mut h, mut j)| {
            let (first, slices) = layout.slab_range(slab);
            vectorised(
                #[inline(always)]
                || {
                    let s = F64x8::splat;
                    let blend = Blend {
                        keep: s(keep),
                        take: s(take),
                        dt: s(dt),
                    };
                    for i in 0..slices {
                        let (at, a) = (i * WIDTH, first + i * WIDTH);
                        let v_now = load_slab3::<F64x8>(&v, at);
                        let f_now = load_slab9::<F64x8>(&f, at);
                        let grad = load9::<F64x8>(&grad_v, a);
                        // Dummies have no volume and no force.
                        let mass = s(density) * F64x8::load(volume, a) + s(f64::MIN_POSITIVE);
                        let acceleration = scale3(s(1.0) / mass, load3(&force, a));
                        let x_now = load_slab3::<F64x8>(&x, at);
                        store3(&blend.vector(&load3(&x0, a), &x_now, &v_now), &mut x, at);
                        store3(
                            &blend.vector(&load3(&v0, a), &v_now, &acceleration),
                            &mut v,
                            at,
                        );
                        store9(&blend.tensor(&load9(&f0, a), &f_now, &grad), &mut f, at);
                        if let (Some(j), Some(j0)) = (&mut j, j0) {
                            // dj/dt = h : grad v (56), with h = cof f where it is not independent.
                            let h_now = h
                                .as_ref()
                                .map_or_else(|| cofactor(&f_now), |h| load_slab9::<F64x8>(h, at));
                            let mut rate = double_dot(&h_now, &grad);
                            if let Some(extra) = j_rate {
                                rate = rate + F64x8::load(extra, a);
                            }
                            blend
                                .scalar(F64x8::load(j0, a), F64x8::load(j, at), rate)
                                .store(j, at);
                        }
                        if let (Some(h), Some(h0)) = (&mut h, &h0) {
                            // dh/dt = f x grad v (55).
                            let rate = tensor_cross(&f_now, &grad);
                            let h_now = load_slab9::<F64x8>(h, at);
                            store9(&blend.tensor(&load9(h0, a), &h_now, &rate), h, at);
                        }
                    }
                },
            );
        });
    }

    /// Makes the current configuration the reference ([URL22] algorithm 1, steps 5 to 8): F_chi <-
    /// f F_chi, H_chi <- h H_chi, J_chi <- j J_chi, chi <- x, f = h = I, j = 1.
    ///
    /// # Errors
    /// The first particle that is inverted or whose gradient cannot be corrected any more; the
    /// reference is then as it was.
    pub fn update_reference(
        &self,
        state: &mut State,
        reference: &mut Reference,
    ) -> std::result::Result<(), Breakdown> {
        let Some(old) = reference.updated.clone() else {
            return Ok(());
        };
        let layout = reference.layout;
        let mut new = old.clone();
        let kinematics = Kinematics::new(state, reference);
        let mut h_chi = new.h_chi.as_mut().map(|h| h.slabs_mut().into_iter());
        let slabs: Vec<_> = new
            .f_chi
            .slabs_mut()
            .into_iter()
            .zip(new.j_chi.slabs_mut())
            .map(|(f_chi, [j_chi])| (f_chi, j_chi, h_chi.as_mut().and_then(Iterator::next)))
            .collect();
        let found = parallel::map_slabs(slabs, |slab, (mut f_chi, j_chi, mut h_chi)| {
            let (first, slices) = layout.slab_range(slab);
            let mut breakdown = None;
            vectorised(
                #[inline(always)]
                || {
                    for at in (0..slices * WIDTH).step_by(WIDTH) {
                        let total = self.total_of::<F64x8>(&kinematics, first + at);
                        store9(&total.f, &mut f_chi, at);
                        total.j.store(j_chi, at);
                        if let Some(h_chi) = &mut h_chi {
                            store9(&total.h, h_chi, at);
                        }
                        for (lane, jacobian) in total.j.0.into_iter().enumerate() {
                            if !(jacobian > 0.0 && jacobian < f64::INFINITY) {
                                let slot = first + at + lane;
                                breakdown = breakdown.or(Some(Breakdown { slot, jacobian }));
                            }
                        }
                    }
                },
            );
            breakdown
        });
        if let Some(breakdown) = found.into_iter().flatten().next() {
            return Err(breakdown);
        }
        new.chi.copy_from(&state.x);
        reference.updated = Some(new);
        if let Err(slot) = reference.rebuild() {
            let jacobian = self.deformation(state, reference, slot).j;
            reference.updated = Some(old);
            reference.rebuild().expect("it could be built before");
            return Err(Breakdown { slot, jacobian });
        }
        state.f = Array::new(layout, IDENTITY);
        if let Some(h) = &mut state.h {
            *h = Array::new(layout, IDENTITY);
        }
        if let Some(j) = &mut state.j {
            *j = Array::new(layout, [1.0]);
        }
        Ok(())
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        let s = &self.scratch;
        s.q.bytes()
            + s.s.bytes()
            + s.half_grad.bytes()
            + s.wave.bytes()
            + s.sigma_j.as_ref().map_or(0, |(a, b)| a.bytes() + b.bytes())
            + self.rates.force.bytes()
            + self.rates.grad_v.bytes()
            + self.rates.j_dissipation.as_ref().map_or(0, Array::bytes)
    }
}

/// keep y0 + take (y + dt k) on lanes.
#[derive(Clone, Copy)]
struct Blend {
    keep: F64x8,
    take: F64x8,
    dt: F64x8,
}

impl Blend {
    #[inline(always)]
    fn scalar(&self, y0: F64x8, y: F64x8, k: F64x8) -> F64x8 {
        self.take.mul_add(self.dt.mul_add(k, y), self.keep * y0)
    }
    #[inline(always)]
    fn vector(&self, y0: &Vec3<F64x8>, y: &Vec3<F64x8>, k: &Vec3<F64x8>) -> Vec3<F64x8> {
        let c = |i: usize| self.scalar(y0[i], y[i], k[i]);
        [c(0), c(1), c(2)]
    }
    #[inline(always)]
    fn tensor(&self, y0: &Mat3<F64x8>, y: &Mat3<F64x8>, k: &Mat3<F64x8>) -> Mat3<F64x8> {
        let row = |i: usize| self.vector(&y0[i], &y[i], &k[i]);
        [row(0), row(1), row(2)]
    }
}

/// Output of the gradient and point passes for one slab.
struct PointOutput<'a> {
    grad_v: [&'a mut [f64]; 9],
    q: [&'a mut [f64]; 9],
    s: [&'a mut [f64]; 9],
    half_grad: [&'a mut [f64]; 9],
    wave: [&'a mut [f64]; 2],
    sigma_j: Option<&'a mut [f64]>,
}

#[inline(always)]
fn load_slab3<T: Lane>(from: &[&mut [f64]; 3], at: usize) -> Vec3<T> {
    [
        T::load(from[0], at),
        T::load(from[1], at),
        T::load(from[2], at),
    ]
}

#[inline(always)]
fn load_slab9<T: Lane>(from: &[&mut [f64]; 9], at: usize) -> Mat3<T> {
    let row = |r: usize| {
        [
            T::load(from[r], at),
            T::load(from[r + 1], at),
            T::load(from[r + 2], at),
        ]
    };
    [row(0), row(3), row(6)]
}

/// Gradient of a vector field with respect to the reference (54).
fn gradient_slab<T: Lane, P: PairVectors>(
    pairs: P,
    reference: &Reference,
    v: &[&[f64]; 3],
    first: usize,
    slices: usize,
    out: &mut [&mut [f64]; 9],
) {
    let l = reference.l.components();
    vectorised(
        #[inline(always)]
        || {
            for at in (0..slices * WIDTH).step_by(T::WIDTH) {
                let a = first + at;
                let (centre, va) = (pairs.centre::<T>(a), load3::<T>(v, a));
                let mut sum = [zero3(); 3];
                reference.slices.for_each::<T>(a, |b, pair| {
                    let (g, _) = pairs.pair(centre, b, pair);
                    sum = add_outer(&sum, sub3(load3(v, b), va), g);
                });
                store9(&mat_mul_t(&sum, &load9(&l, a)), out, at);
            }
        },
    );
}

/// Everything of one particle that its neighbours need; (strain, kinetic) energy of the slab.
fn point_slab<T: Lane, M: Material, const STATE: u8, const UPDATED: bool>(
    law: M,
    kinematics: &Kinematics,
    reference: &Reference,
    v: &[&[f64]; 3],
    first: usize,
    slices: usize,
    out: &mut PointOutput,
) -> std::result::Result<(f64, f64), Breakdown> {
    let (l, volume) = (reference.l.components(), reference.volume.components()[0]);
    let mut breakdown = None;
    let mut strain = 0.0;
    let mut kinetic = 0.0;
    vectorised(
        #[inline(always)]
        || {
            let s = T::splat;
            for at in (0..slices * WIDTH).step_by(T::WIDTH) {
                let a = first + at;
                let total = kinematics.total::<T, STATE, UPDATED>(a);
                let stress = law.stress(&total.f, &total.h, total.j);
                let (l, v_r) = (load9::<T>(&l, a), T::load(volume, a));

                // Smallest stretch of F: 1/lambda^2 is the largest eigenvalue of F^-T F^-1.
                let cof = if STATE >= 2 {
                    cofactor(&total.f)
                } else {
                    total.h
                };
                let det = dot(total.f[0], cof[0]);
                let largest = largest_eigenvalue(&mat_mul_t(&cof, &cof));
                let stretch = det / largest.sqrt();
                stretch.store(out.wave[0], at);
                (s(law.density()) / total.j).store(out.wave[1], at);

                // 1/2 grad_chi v f^-1, f^-1 from f itself.
                let f = load9::<T>(&kinematics.f, a);
                let cof_f = cofactor(&f);
                let half = s(0.5) / dot(f[0], cof_f[0]);
                let grad = load_slab9::<T>(&out.grad_v, at);
                let half_grad = scale9(half, &mat_mul_t(&grad, &cof_f));
                store9(&half_grad, &mut out.half_grad, at);

                // Q = V_R P F_chi^T L and S = V_chi h L.
                let mut k = scale9(v_r, &l);
                let mut v_chi = v_r;
                if UPDATED && let (Some(f_chi), Some(j_chi)) = (&kinematics.f_chi, kinematics.j_chi)
                {
                    k = mat_mul(&transpose(&load9(f_chi, a)), &k);
                    v_chi = v_r * T::load(j_chi, a);
                }
                store9(&mat_mul(&stress.p, &k), &mut out.q, at);
                let h = match (STATE, &kinematics.h) {
                    (2.., Some(h)) => load9(h, a),
                    _ => cof_f,
                };
                store9(&scale9(v_chi, &mat_mul(&h, &l)), &mut out.s, at);
                if let Some(sigma_j) = &mut out.sigma_j {
                    stress.sigma_j.store(sigma_j, at);
                }

                let velocity = load3::<T>(v, a);
                let energy = (v_r * stress.energy).lanes();
                let motion = (s(0.5 * law.density()) * v_r * dot(velocity, velocity)).lanes();
                let jacobian = total.j.min(det).lanes();
                for lane in 0..T::WIDTH {
                    strain += energy[lane];
                    kinetic += motion[lane];
                    if !(jacobian[lane] > 0.0 && jacobian[lane] < f64::INFINITY) {
                        breakdown = breakdown.or(Some(Breakdown {
                            slot: a + lane,
                            jacobian: jacobian[lane],
                        }));
                    }
                }
            }
        },
    );
    breakdown.map_or(Ok((strain, kinetic)), Err)
}

/// What the force pass reads of the neighbours.
struct ForceInput<'a> {
    x: [&'a [f64]; 3],
    v: [&'a [f64]; 3],
    q: [&'a [f64]; 9],
    s: [&'a [f64]; 9],
    half_grad: [&'a [f64]; 9],
    wave: [&'a [f64]; 2],
}

impl<'a> ForceInput<'a> {
    fn new(state: &'a State, _: &'a Reference, scratch: &'a Scratch) -> Self {
        Self {
            x: state.x.components(),
            v: state.v.components(),
            q: scratch.q.components(),
            s: scratch.s.components(),
            half_grad: scratch.half_grad.components(),
            wave: scratch.wave.components(),
        }
    }

    /// The pair a, b as the Riemann solver sees it, but for its area.
    #[inline(always)]
    fn pair<T: Lane>(&self, here: &Here<T>, b: usize) -> Pair<T> {
        let half = T::splat(0.5);
        let dx = sub3(load3(&self.x, b), here.x);
        Pair {
            dx,
            dv: sub3(load3(&self.v, b), here.v),
            dx2: dot(dx, dx),
            stretch: half * (here.stretch + T::load(self.wave[0], b)),
            density: half * (here.density + T::load(self.wave[1], b)),
            area: zero3(),
        }
    }

    #[inline(always)]
    fn here<T: Lane>(&self, a: usize) -> Here<T> {
        Here {
            x: load3(&self.x, a),
            v: load3(&self.v, a),
            stretch: T::load(self.wave[0], a),
            density: T::load(self.wave[1], a),
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

/// T_a (57); (power of the dissipation, smallest squared |x_ab| lambda_ab) of the slab.
fn force_slab<T: Lane, P: PairVectors, const MODE: u8>(
    pairs: P,
    reference: &Reference,
    input: &ForceInput,
    speeds: WaveSpeeds<f64>,
    first: usize,
    slices: usize,
    out: &mut [&mut [f64]; 3],
) -> (f64, f64) {
    let weights = reference.slices.weights();
    let mut power = 0.0;
    let mut shortest = f64::INFINITY;
    vectorised(
        #[inline(always)]
        || {
            let speeds = WaveSpeeds {
                pressure: T::splat(speeds.pressure),
                shear: T::splat(speeds.shear),
            };
            let far = T::splat(f64::INFINITY);
            for at in (0..slices * WIDTH).step_by(T::WIDTH) {
                let a = first + at;
                let here = input.here::<T>(a);
                let centre = pairs.centre::<T>(a);
                let (qa, sa) = (load9::<T>(&input.q, a), load9::<T>(&input.s, a));
                let grad_a = load9::<T>(&input.half_grad, a);
                let mut force = zero3();
                let mut work = T::splat(0.0);
                let mut length2 = far;
                reference.slices.for_each::<T>(a, |b, pair| {
                    let (g, back) = pairs.pair(centre, b, pair);
                    let mut p = input.pair(&here, b);
                    let mask = T::load(weights, pair);
                    length2 = length2.min(mask.if_positive(p.dx2 * (p.stretch * p.stretch), far));
                    let mut f = sub3(mat_vec(&qa, g), mat_vec(&load9(&input.q, b), back));
                    if MODE != riemann::OFF {
                        p.area = sub3(mat_vec(&sa, g), mat_vec(&load9(&input.s, b), back));
                        let (half_a, half_b) = if MODE == riemann::CONSTANT {
                            (zero3(), zero3())
                        } else {
                            (
                                mat_vec(&grad_a, p.dx),
                                mat_vec(&load9(&input.half_grad, b), p.dx),
                            )
                        };
                        let jump = riemann::jump::<T, MODE>(&p, half_a, half_b);
                        let d = riemann::dissipation(&p, jump, speeds);
                        work = work + dot(d, p.dv);
                        f = add3(f, d);
                    }
                    force = add3(force, f);
                });
                store3(&force, out, at);
                let (work, length2) = (work.lanes(), length2.lanes());
                for lane in 0..T::WIDTH {
                    // Each pair is seen from both sides.
                    power += 0.5 * work[lane];
                    shortest = shortest.min(length2[lane]);
                }
            }
        },
    );
    (power, shortest)
}

/// What the pass for D^j reads beside [`ForceInput`].
struct VolumeInput<'a> {
    sigma: &'a [f64],
    slope: [&'a [f64]; 3],
    j_chi: Option<&'a [f64]>,
    speed: f64,
    coefficient: f64,
}

/// Half the spatial gradient of Sigma_J.
fn half_slope_slab<T: Lane, P: PairVectors>(
    pairs: P,
    reference: &Reference,
    kinematics: &Kinematics,
    sigma: &[f64],
    first: usize,
    slices: usize,
    out: &mut [&mut [f64]; 3],
) {
    let l = reference.l.components();
    vectorised(
        #[inline(always)]
        || {
            for at in (0..slices * WIDTH).step_by(T::WIDTH) {
                let a = first + at;
                let (centre, own) = (pairs.centre::<T>(a), T::load(sigma, a));
                let mut sum = zero3();
                reference.slices.for_each::<T>(a, |b, pair| {
                    let (g, _) = pairs.pair(centre, b, pair);
                    sum = axpy3(sum, T::load(sigma, b) - own, g);
                });
                let f = load9::<T>(&kinematics.f, a);
                let cof = cofactor(&f);
                let half = T::splat(0.5) / dot(f[0], cof[0]);
                let slope = mat_vec(&cof, mat_vec(&load9(&l, a), sum));
                store3(&scale3(half, slope), out, at);
            }
        },
    );
}

/// dj/dt by D^j (56, 59); power that it dissipates in the slab.
fn volume_slab<T: Lane, P: PairVectors>(
    pairs: P,
    reference: &Reference,
    input: &ForceInput,
    volume: &VolumeInput,
    first: usize,
    slices: usize,
    out: &mut [f64],
) -> f64 {
    let initial_volume = reference.volume.components()[0];
    let mut power = 0.0;
    vectorised(
        #[inline(always)]
        || {
            let s = T::splat;
            for at in (0..slices * WIDTH).step_by(T::WIDTH) {
                let a = first + at;
                let here = input.here::<T>(a);
                let centre = pairs.centre::<T>(a);
                let sa = load9::<T>(&input.s, a);
                let (sigma_a, slope_a) = (T::load(volume.sigma, a), load3::<T>(&volume.slope, a));
                let mut rate = s(0.0);
                let mut work = s(0.0);
                reference.slices.for_each::<T>(a, |b, pair| {
                    let (g, back) = pairs.pair(centre, b, pair);
                    let mut p = input.pair(&here, b);
                    p.area = sub3(mat_vec(&sa, g), mat_vec(&load9(&input.s, b), back));
                    let difference = T::load(volume.sigma, b) - sigma_a;
                    let slopes = add3(slope_a, load3(&volume.slope, b));
                    let jump = difference - dot(slopes, p.dx);
                    let d = riemann::volume_dissipation(
                        &p,
                        jump,
                        s(volume.speed),
                        s(volume.coefficient),
                    );
                    rate = rate + d;
                    work = work + d * difference;
                });
                let mut v_chi = T::load(initial_volume, a);
                if let Some(j_chi) = volume.j_chi {
                    v_chi = v_chi * T::load(j_chi, a);
                }
                (rate / (v_chi + s(f64::MIN_POSITIVE))).store(out, at);
                for w in &work.lanes()[..T::WIDTH] {
                    power += 0.5 * w;
                }
            }
        },
    );
    power
}

/// Sets f, and h and j where they are independent, from the positions of a body whose reference is
/// its initial configuration: f = sum (x_b - x_a) (x) L g.
pub fn deform(state: &mut State, reference: &Reference) {
    let layout = reference.layout;
    let x = state.x.components();
    let mut f = Array::new(layout, IDENTITY);
    parallel::map_slabs(f.slabs_mut(), |slab, mut out| {
        let (first, slices) = layout.slab_range(slab);
        match reference.pair_vectors() {
            Pairs::Lean(p) => gradient_slab::<F64x8, _>(p, reference, &x, first, slices, &mut out),
            Pairs::Stored(p) => {
                gradient_slab::<F64x8, _>(p, reference, &x, first, slices, &mut out)
            }
        }
    });
    for slot in (0..layout.particles).map(Layout::slot) {
        let own = f.get(slot);
        let m = [
            [own[0], own[1], own[2]],
            [own[3], own[4], own[5]],
            [own[6], own[7], own[8]],
        ];
        let cof = cofactor(&m);
        state.f.set(slot, own);
        if let Some(h) = &mut state.h {
            h.set(
                slot,
                *cof.as_flattened().first_chunk().expect("nine components"),
            );
        }
        if let Some(j) = &mut state.j {
            j.set(slot, [dot(m[0], cof[0])]);
        }
    }
}
