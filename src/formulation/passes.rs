//! The passes of [`super::url`] over one slab, written once over lanes.

use super::limiter;
use super::riemann::{self, Pair, WaveSpeeds};
use super::url::{Breakdown, Scratch, State, Trouble};
use crate::lane::{Lane, PerSlot, SLICE, Work};
use crate::layout::Array;
use crate::material::{Deformation, Material, Thermal};
use crate::math::*;
use crate::reference::{PairVectors, Reference, load3, load9, store3, store9};

/// Read access to a state and its reference, by components.
#[derive(Clone, Copy)]
pub(super) struct Kinematics<'a> {
    pub(super) f: [&'a [f64]; 9],
    h: Option<[&'a [f64]; 9]>,
    j: Option<&'a [f64]>,
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
fn load_slab3<T: Lane>(token: T::Token, from: &[&mut [f64]; 3], at: usize) -> Vec3<T> {
    let [a, b, c] = from;
    load3(token, &[a, b, c], at)
}

#[inline(always)]
fn load7<T: Lane>(token: T::Token, from: &[&[f64]; 7], at: usize) -> [T; 7] {
    std::array::from_fn(|c| T::load(token, from[c], at))
}

#[inline(always)]
fn load_slab9<T: Lane>(token: T::Token, from: &[&mut [f64]; 9], at: usize) -> Mat3<T> {
    let [a, b, c, d, e, f, g, h, i] = from;
    load9(token, &[a, b, c, d, e, f, g, h, i], at)
}

/// Slots of a slab as (offset in the slab, slot), by lanes.
#[inline(always)]
pub(super) fn lanes_of<T: Lane>(
    reference: &Reference,
    slab: usize,
) -> impl Iterator<Item = (usize, usize)> {
    let (first, slices) = reference.layout.slab_range(slab);
    std::iter::zip(
        (0..slices * SLICE).step_by(T::WIDTH),
        (first..).step_by(T::WIDTH),
    )
}

/// Gradient of a vector field with respect to the reference (54).
pub(super) struct Gradient<'a, 'o, P> {
    pub pairs: P,
    pub reference: &'a Reference,
    pub field: [&'a [f64]; 3],
    pub slab: usize,
    pub out: &'o mut [&'a mut [f64]; 9],
}

impl<P: PairVectors> Work for Gradient<'_, '_, P> {
    type Output = ();
    #[inline(always)]
    fn run<T: Lane>(self, token: T::Token) {
        let l = self.reference.l.components();
        for (at, a) in lanes_of::<T>(self.reference, self.slab) {
            let centre = self.pairs.centre::<T>(token, a);
            let own = load3::<T>(token, &self.field, a);
            let mut sum = [zero3(token); 3];
            for (b, pair) in self.reference.slices.of(a) {
                let (g, _) = self.pairs.pair(token, &centre, b, pair);
                sum = add_outer(&sum, sub3(load3(token, &self.field, b), own), g);
            }
            store9(&mat_mul_t(&sum, &load9(token, &l, a)), self.out, at);
        }
    }
}

/// Output of the gradient, law and point passes for one slab.
pub(super) struct PointOutput<'a> {
    pub grad_v: [&'a mut [f64]; 9],
    /// P from the law pass, where formulation and material meet; Q from the point pass.
    pub q: [&'a mut [f64]; 9],
    pub s: Option<[&'a mut [f64]; 9]>,
    pub half_grad: Option<[&'a mut [f64]; 9]>,
    pub wave: [&'a mut [f64]; 2],
    pub sigma_j: Option<&'a mut [f64]>,
    /// Temperature and the variable whose gradient drives conduction.
    pub theta: Option<[&'a mut [f64]; 2]>,
}

/// What particles store, summed over a slab.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Stored {
    /// Strain energy [J].
    pub strain: f64,
    /// Thermal energy [J].
    pub thermal: f64,
    /// Entropy [J/K].
    pub entropy: f64,
}

/// What the law pass reads.
#[derive(Clone, Copy)]
pub(super) struct LawInputs<'a> {
    pub kinematics: Kinematics<'a>,
    pub reference: &'a Reference,
    /// Entropy per unit initial volume, of a body with heat.
    pub heat: Option<(&'a [f64], Thermal)>,
    pub history: Option<[&'a [f64]; 7]>,
    /// Time since the step's start [s].
    pub elapsed: f64,
}

/// The law pass: stress, temperature and energy of one slab from the total deformation.
///
/// `HEAT` and `FLOW` tell when the loop is compiled whether the body has a temperature and whether
/// the history is mapped.
pub(super) struct Laws<'a, 'o, M, const HEAT: bool, const FLOW: bool> {
    pub law: M,
    pub inputs: LawInputs<'a>,
    pub slab: usize,
    pub out: &'o mut PointOutput<'a>,
}

impl<M: Material, const HEAT: bool, const FLOW: bool> Work for Laws<'_, '_, M, HEAT, FLOW> {
    type Output = std::result::Result<Stored, Breakdown>;
    #[inline(always)]
    fn run<T: Lane>(self, token: T::Token) -> Self::Output {
        let Self { law, out, .. } = self;
        let LawInputs {
            kinematics,
            reference,
            ..
        } = self.inputs;
        let volume = reference.volume.components()[0];
        let density = T::splat(token, law.density());
        let elapsed = T::splat(token, self.inputs.elapsed);
        let [mut strain, mut heat, mut entropy] = [PerSlot::new(0.0); 3];
        let mut admissible = PerSlot::new(1.0);
        let (one, zero) = (T::splat(token, 1.0), T::splat(token, 0.0));
        let infinity = T::splat(token, f64::INFINITY);
        for (at, a) in lanes_of::<T>(reference, self.slab) {
            let total = kinematics.total::<T>(token, a);
            let v_r = T::load(token, volume, a);
            let mut history = match &self.inputs.history {
                Some(history) if M::HISTORY => load7(token, history, a),
                _ => [zero; 7],
            };
            let mut theta = zero;
            let mut warmth = None;
            if HEAT && let Some((eta, thermal)) = self.inputs.heat {
                let eta = T::load(token, eta, a);
                let w = thermal.warmth(&total, eta);
                theta = w.theta;
                warmth = Some((thermal, w, eta));
            }
            let mut stress = law.stress::<T, FLOW>(&total, theta, &mut history, elapsed);
            // 1 where J, det F and the temperature are positive and finite, else 0. A comparison
            // with NaN is false.
            let det = dot(total.f[0], cofactor(&total.f)[0]);
            let mut good = (infinity - det).if_positive(det.if_positive(one, zero), zero);
            if kinematics.j.is_some() {
                let j = total.j;
                good = (infinity - j).if_positive(j.if_positive(good, zero), zero);
            }
            if let (Some((thermal, w, eta)), Some([out_theta, beta])) = (warmth, &mut out.theta) {
                thermal.couple(&total, &w, &mut stress);
                theta.store(out_theta, at);
                w.beta.store(beta, at);
                heat.add(at, v_r * w.energy);
                entropy.add(at, v_r * eta);
                good = (infinity - theta).if_positive(theta.if_positive(good, zero), zero);
            }
            admissible.min(at, good);
            strain.add(at, v_r * stress.energy);
            store9(&stress.p, &mut out.q, at);
            stress.stretch.store(out.wave[0], at);
            (density / total.j).store(out.wave[1], at);
            if let Some(sigma_j) = &mut out.sigma_j {
                stress.sigma_j.store(sigma_j, at);
            }
        }
        if admissible.least() < 1.0 {
            let (first, _) = reference.layout.slab_range(self.slab);
            let theta = out.theta.as_ref().map(|[theta, _]| &**theta);
            return Err(first_breakdown(reference, self.slab, |slot| {
                let total = kinematics.total::<f64>((), slot);
                let theta = theta.map_or(1.0, |theta| theta[slot - first]);
                inadmissible(&total, theta)
            }));
        }
        Ok(Stored {
            strain: strain.sum(),
            thermal: heat.sum(),
            entropy: entropy.sum(),
        })
    }
}

/// Plastic flow over a step, and its heat, for one slab; plastic work and the part of it that
/// becomes heat [J], and the entropy that it produces [J/K].
pub(super) struct Flow<'a, M> {
    pub law: M,
    pub kinematics: Kinematics<'a>,
    pub reference: &'a Reference,
    pub elapsed: f64,
    pub slab: usize,
    pub history: [&'a mut [f64]; 7],
    pub heat: Option<(&'a mut [f64], Thermal)>,
}

impl<M: Material> Work for Flow<'_, M> {
    type Output = Plastic;
    #[inline(always)]
    fn run<T: Lane>(mut self, token: T::Token) -> Plastic {
        let volume = self.reference.volume.components()[0];
        let elapsed = T::splat(token, self.elapsed);
        let [mut work, mut heat, mut entropy] = [PerSlot::new(0.0); 3];
        for (at, a) in lanes_of::<T>(self.reference, self.slab) {
            let total = self.kinematics.total::<T>(token, a);
            let v_r = T::load(token, volume, a);
            let mut history: [T; 7] = std::array::from_fn(|c| T::load(token, self.history[c], at));
            let mut theta = T::splat(token, 0.0);
            if let Some((eta, thermal)) = &self.heat {
                let now = T::load(token, eta, at);
                theta = thermal.warmth(&total, now).theta;
            }
            let stress = self
                .law
                .stress::<T, true>(&total, theta, &mut history, elapsed);
            for (c, value) in history.into_iter().enumerate() {
                value.store(self.history[c], at);
            }
            work.add(at, v_r * stress.dissipation);
            if let Some((eta, thermal)) = &mut self.heat {
                let gain = thermal.plastic_heat(stress.dissipation);
                let produced = thermal.entropy_of_heat(theta, gain);
                let now = T::load(token, eta, at);
                (now + produced).store(eta, at);
                heat.add(at, v_r * gain);
                entropy.add(at, v_r * produced);
            }
        }
        Plastic {
            work: work.sum(),
            heat: heat.sum(),
            entropy: entropy.sum(),
        }
    }
}

/// What plastic flow did in a step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Plastic {
    /// Plastic work [J].
    pub work: f64,
    /// The part of it that became heat [J].
    pub heat: f64,
    /// Entropy that it produced [J/K].
    pub entropy: f64,
}

impl std::ops::AddAssign for Plastic {
    fn add_assign(&mut self, other: Self) {
        self.work += other.work;
        self.heat += other.heat;
        self.entropy += other.entropy;
    }
}

/// The rest of one particle that its neighbours need, from the incremental deformation; kinetic
/// energy of the slab.
pub(super) struct Points<'a, 'o> {
    pub density: f64,
    pub kinematics: Kinematics<'a>,
    pub reference: &'a Reference,
    pub v: [&'a [f64]; 3],
    pub slab: usize,
    pub out: &'o mut PointOutput<'a>,
}

impl Work for Points<'_, '_> {
    type Output = std::result::Result<f64, Breakdown>;
    #[inline(always)]
    fn run<T: Lane>(self, token: T::Token) -> Self::Output {
        let Self {
            kinematics,
            reference,
            v,
            slab,
            out,
            ..
        } = self;
        let (l, volume) = (reference.l.components(), reference.volume.components()[0]);
        let density = T::splat(token, self.density);
        let half = T::splat(token, 0.5);
        let mut kinetic = PerSlot::new(0.0);
        let mut admissible = PerSlot::new(1.0);
        let (one, zero) = (T::splat(token, 1.0), T::splat(token, 0.0));
        let infinity = T::splat(token, f64::INFINITY);
        for (at, a) in lanes_of::<T>(reference, slab) {
            let (l, v_r) = (load9::<T>(token, &l, a), T::load(token, volume, a));

            // 1/2 grad_chi v f^-1, f^-1 from f itself.
            let f = load9::<T>(token, &kinematics.f, a);
            let cof_f = cofactor(&f);
            if let Some(half_grad) = &mut out.half_grad {
                let factor = half / dot(f[0], cof_f[0]);
                let grad = load_slab9::<T>(token, &out.grad_v, at);
                store9(&scale9(factor, &mat_mul_t(&grad, &cof_f)), half_grad, at);
            }

            // Q = V_R P F_chi^T L and S = V_chi h L.
            let mut k = scale9(v_r, &l);
            let mut v_chi = v_r;
            if let (Some(f_chi), Some(j_chi)) = (&kinematics.f_chi, kinematics.j_chi) {
                k = mat_mul(&transpose(&load9(token, f_chi, a)), &k);
                v_chi = v_r * T::load(token, j_chi, a);
            }
            let p = load_slab9::<T>(token, &out.q, at);
            store9(&mat_mul(&p, &k), &mut out.q, at);
            if let Some(out) = &mut out.s {
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
        }
        if admissible.least() < 1.0 {
            return Err(first_breakdown(reference, slab, |slot| {
                immovable(load3((), &v, slot), self.density * volume[slot])
            }));
        }
        Ok(kinetic.sum())
    }
}

/// The first particle of a slab that is in trouble.
#[cold]
fn first_breakdown(
    reference: &Reference,
    slab: usize,
    trouble: impl Fn(usize) -> Option<Trouble>,
) -> Breakdown {
    let (first, _) = reference.layout.slab_range(slab);
    lanes_of::<f64>(reference, slab)
        .find_map(|(_, slot)| {
            let trouble = trouble(slot)?;
            Some(Breakdown { slot, trouble })
        })
        .unwrap_or(Breakdown {
            slot: first,
            trouble: Trouble::VolumeRatio(f64::NAN),
        })
}

/// What breaks a particle down at rest: a volume ratio, j's or that of F, or a temperature that is
/// not positive and finite.
pub(super) fn inadmissible(total: &Deformation<f64>, theta: f64) -> Option<Trouble> {
    let det = dot(total.f[0], cofactor(&total.f)[0]);
    let bad = |value: &f64| !(*value > 0.0 && *value < f64::INFINITY);
    let ratio = [total.j, det].into_iter().find(bad);
    ratio
        .map(Trouble::VolumeRatio)
        .or_else(|| bad(&theta).then_some(Trouble::Temperature(theta)))
}

/// Whether a velocity, or its energy, is not finite.
pub(super) fn immovable(v: Vec3<f64>, mass: f64) -> Option<Trouble> {
    (!(0.5 * mass * dot(v, v)).is_finite()).then_some(Trouble::Velocity)
}

/// Scales the gradients for the reconstruction by Venkatakrishnan's limiter.
pub(super) struct Limit<'a> {
    pub reference: &'a Reference,
    pub x: [&'a [f64]; 3],
    pub v: [&'a [f64]; 3],
    pub slab: usize,
    pub half_grad: [&'a mut [f64]; 9],
}

impl Work for Limit<'_> {
    type Output = ();
    #[inline(always)]
    fn run<T: Lane>(mut self, token: T::Token) {
        let weights = self.reference.slices.weights();
        for (at, a) in lanes_of::<T>(self.reference, self.slab) {
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
            let mut grad = load_slab9::<T>(token, &self.half_grad, at);
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
            store9(&grad, &mut self.half_grad, at);
        }
    }
}

/// What the force pass reads of the neighbours.
#[derive(Clone, Copy)]
pub(super) struct ForceInput<'a> {
    pub reference: &'a Reference,
    x: [&'a [f64]; 3],
    v: [&'a [f64]; 3],
    q: [&'a [f64]; 9],
    s: [&'a [f64]; 9],
    half_grad: [&'a [f64]; 9],
    wave: [&'a [f64]; 2],
}

impl<'a> ForceInput<'a> {
    pub(super) fn new(state: &'a State, reference: &'a Reference, scratch: &'a Scratch) -> Self {
        Self {
            reference,
            x: state.x.components(),
            v: state.v.components(),
            q: scratch.q.components(),
            s: scratch.s.as_ref().map_or([&[]; 9], Array::components),
            half_grad: scratch
                .half_grad
                .as_ref()
                .map_or([&[]; 9], Array::components),
            wave: scratch.wave.components(),
        }
    }

    /// x_a.
    #[inline(always)]
    pub(super) fn position<T: Lane>(&self, token: T::Token, a: usize) -> Vec3<T> {
        load3(token, &self.x, a)
    }

    /// S_a.
    #[inline(always)]
    pub(super) fn area<T: Lane>(&self, token: T::Token, a: usize) -> Mat3<T> {
        load9(token, &self.s, a)
    }

    #[inline(always)]
    fn here<T: Lane>(&self, token: T::Token, a: usize) -> Here<T> {
        Here {
            x: load3(token, &self.x, a),
            v: load3(token, &self.v, a),
            stretch: T::load(token, self.wave[0], a),
            density: T::load(token, self.wave[1], a),
        }
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
            stretch: half * (here.stretch + T::load(token, self.wave[0], b)),
            density: half * (here.density + T::load(token, self.wave[1], b)),
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

/// T_a (57); (power of the dissipation, smallest squared |x_ab| lambda_ab) of the slab.
pub(super) struct Forces<'a, P, const MODE: u8> {
    pub pairs: P,
    pub input: ForceInput<'a>,
    pub speeds: WaveSpeeds<f64>,
    /// Share of the dissipation in resolved flow.
    pub coefficient: f64,
    /// rho_R [kg/m^3].
    pub density: f64,
    pub slab: usize,
    pub out: [&'a mut [f64]; 3],
}

impl<P: PairVectors, const MODE: u8> Work for Forces<'_, P, MODE> {
    type Output = (f64, f64);
    #[inline(always)]
    fn run<T: Lane>(self, token: T::Token) -> (f64, f64) {
        let Self {
            pairs,
            input,
            speeds,
            coefficient,
            density,
            slab,
            mut out,
        } = self;
        let slices = &input.reference.slices;
        let (weights, volume) = (slices.weights(), input.reference.volume.components()[0]);
        let speeds = WaveSpeeds {
            pressure: T::splat(token, coefficient * speeds.pressure),
            shear: T::splat(token, coefficient * speeds.shear),
        };
        let full = T::splat(token, 1.0 / coefficient);
        let far = T::splat(token, f64::INFINITY);
        let (mut power, mut shortest) = (PerSlot::new(0.0), PerSlot::new(f64::INFINITY));
        for (at, a) in lanes_of::<T>(input.reference, slab) {
            let here = input.here::<T>(token, a);
            let centre = pairs.centre::<T>(token, a);
            let qa = load9::<T>(token, &input.q, a);
            let (mut sa, mut grad_a) = ([zero3(token); 3], [zero3(token); 3]);
            if MODE != riemann::OFF || P::BOUND_BY_AREAS {
                sa = load9::<T>(token, &input.s, a);
            }
            if riemann::reconstructs(MODE) {
                grad_a = load9::<T>(token, &input.half_grad, a);
            }
            let mut force = zero3::<T>(token);
            let (mut work, mut areas) = (T::splat(token, 0.0), T::splat(token, 0.0));
            let mut length2 = far;
            for (b, pair) in slices.of(a) {
                let (g, back) = pairs.pair(token, &centre, b, pair);
                let mut p = input.pair(&here, b);
                let mask = T::load(token, weights, pair);
                length2 = length2.min(mask.if_positive(p.dx2 * (p.stretch * p.stretch), far));
                let mut f = sub3(mat_vec(&qa, g), mat_vec(&load9(token, &input.q, b), back));
                if MODE != riemann::OFF || P::BOUND_BY_AREAS {
                    p.area = sub3(mat_vec(&sa, g), mat_vec(&load9(token, &input.s, b), back));
                }
                if P::BOUND_BY_AREAS {
                    areas = areas + dot(p.area, p.area).sqrt();
                }
                if MODE != riemann::OFF {
                    let grad_b = if riemann::reconstructs(MODE) {
                        load9(token, &input.half_grad, b)
                    } else {
                        [zero3(token); 3]
                    };
                    let jump = riemann::jump::<T, MODE>(&p, &grad_a, &grad_b, full);
                    let d = riemann::dissipation(&p, jump, speeds);
                    work = work + dot(d, p.dv);
                    f = add3(f, d);
                }
                force = add3(force, f);
            }
            store3(&force, &mut out, at);
            power.add(at, work);
            if P::BOUND_BY_AREAS {
                // 5 lambda / kappa, kappa = sum |c_ab| / (J V_R): a particle with little volume and
                // large areas, which irregular ones have, binds the step by more than its distances.
                let mass = T::splat(token, density) * T::load(token, volume, a);
                let bound = T::splat(token, 5.0) * here.stretch * mass / (here.density * areas);
                length2 = areas.if_positive(length2.min(bound * bound), length2);
            }
            shortest.min(at, length2);
        }
        // Each pair is seen from both sides.
        (0.5 * power.sum(), shortest.least())
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
        for (at, a) in lanes_of::<T>(self.reference, self.slab) {
            let centre = self.pairs.centre::<T>(token, a);
            let own = T::load(token, self.field, a);
            let mut sum = zero3(token);
            for (b, pair) in self.reference.slices.of(a) {
                let (g, _) = self.pairs.pair(token, &centre, b, pair);
                sum = axpy3(sum, T::load(token, self.field, b) - own, g);
            }
            let f = load9::<T>(token, &self.kinematics.f, a);
            let cof = cofactor(&f);
            let half = T::splat(token, 0.5) / dot(f[0], cof[0]);
            let slope = mat_vec(&cof, mat_vec(&load9(token, &l, a), sum));
            store3(&scale3(half, slope), &mut self.out, at);
        }
    }
}

/// dj/dt by D^j (56, 59); power that it dissipates in the slab.
pub(super) struct VolumeRates<'a, P> {
    pub pairs: P,
    pub input: ForceInput<'a>,
    pub sigma: &'a [f64],
    pub slope: [&'a [f64]; 3],
    pub j_chi: Option<&'a [f64]>,
    pub pressure_speed: f64,
    pub coefficient: f64,
    pub slab: usize,
    pub out: &'a mut [f64],
}

impl<P: PairVectors> Work for VolumeRates<'_, P> {
    type Output = f64;
    #[inline(always)]
    fn run<T: Lane>(self, token: T::Token) -> f64 {
        let Self { pairs, input, .. } = self;
        let volume = input.reference.volume.components()[0];
        let (speed, coefficient) = (
            T::splat(token, self.pressure_speed),
            T::splat(token, self.coefficient),
        );
        let mut power = PerSlot::new(0.0);
        for (at, a) in lanes_of::<T>(input.reference, self.slab) {
            let here = input.here::<T>(token, a);
            let centre = pairs.centre::<T>(token, a);
            let sa = load9::<T>(token, &input.s, a);
            let (sigma_a, slope_a) = (
                T::load(token, self.sigma, a),
                load3::<T>(token, &self.slope, a),
            );
            let (mut rate, mut work) = (T::splat(token, 0.0), T::splat(token, 0.0));
            for (b, pair) in input.reference.slices.of(a) {
                let (g, back) = pairs.pair(token, &centre, b, pair);
                let mut p = input.pair(&here, b);
                p.area = sub3(mat_vec(&sa, g), mat_vec(&load9(token, &input.s, b), back));
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
