//! The law pass: where formulation and material meet in one array, the stress.

use super::passes::{Kinematics, PointOutput, first_breakdown, lanes_from, lanes_of};
use super::url::{Breakdown, Runner, Trouble};
use crate::lane::{PerSlot, Precise, Real, Work, vectorised};
use crate::material::{Deformation, Material, Thermal};
use crate::math::*;
use crate::reference::{Reference, store9};

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

/// The law pass: stress, temperature and energy of a run of slots from the total deformation.
///
/// `FLOW` tells when the loop is compiled whether the history is mapped.
pub(super) struct Laws<'a, 'o, 'p, M, E: Real, const FLOW: bool> {
    pub law: M,
    pub inputs: LawInputs<'a>,
    pub run: (usize, usize),
    pub out: &'o mut PointOutput<'p, E>,
}

impl<M: Material, E: Real, const FLOW: bool> Work for Laws<'_, '_, '_, M, E, FLOW> {
    type Output = std::result::Result<Stored, Breakdown>;
    #[inline(always)]
    fn run<T: Precise>(self, token: T::Token) -> Self::Output {
        let Self { law, run, .. } = self;
        let PointOutput { kept, block } = self.out;
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
        for (at, a) in lanes_from::<T>(run) {
            let total = kinematics.total::<T>(token, a);
            let v_r = T::load(token, volume, a);
            let mut history = match &self.inputs.history {
                Some(history) if M::HISTORY => load_all(token, history, a),
                _ => [zero; 7],
            };
            let mut theta = zero;
            let mut warmth = None;
            if let Some((eta, thermal)) = self.inputs.heat {
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
            if let (Some((thermal, w, eta)), Some([out_theta, beta])) = (warmth, &mut kept.theta) {
                thermal.couple(&total, &w, &mut stress);
                theta.store(out_theta, at);
                w.beta.store(beta, at);
                heat.add(at, v_r * w.energy);
                entropy.add(at, v_r * eta);
                good = (infinity - theta).if_positive(theta.if_positive(good, zero), zero);
            }
            admissible.min(at, good);
            strain.add(at, v_r * stress.energy);
            store9(&stress.p, &mut block.q, at);
            stress.stretch.store(block.wave[0], at);
            (density / total.j).store(block.wave[1], at);
            if let Some(sigma_j) = &mut kept.sigma_j {
                stress.sigma_j.store(sigma_j, at);
            }
        }
        if admissible.least() < 1.0 {
            let theta = kept.theta.as_ref().map(|[theta, _]| &**theta);
            return Err(first_breakdown(run, |slot| {
                let total = kinematics.total::<f64>((), slot);
                let theta = theta.map_or(1.0, |theta| theta[slot - run.0]);
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
    fn run<T: Precise>(mut self, token: T::Token) -> Plastic {
        let volume = self.reference.volume.components()[0];
        let elapsed = T::splat(token, self.elapsed);
        let [mut work, mut heat, mut entropy] = [PerSlot::new(0.0); 3];
        for (at, a) in lanes_of::<T>(self.reference, self.slab) {
            let total = self.kinematics.total::<T>(token, a);
            let v_r = T::load(token, volume, a);
            let mut history: [T; 7] = load_all(token, &self.history, at);
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

/// Plastic flow in one slab; compiled only for the laws that have a history.
pub(super) fn flow<M: Material>(work: Flow<M>) -> Plastic {
    if M::HISTORY {
        vectorised(work)
    } else {
        Plastic::default()
    }
}

/// The law pass of a run of slots, compiled for what the body has; with `flow` a history is mapped.
pub(super) fn stresses<R: Runner, M: Material, E: Real>(
    law: M,
    inputs: LawInputs,
    flow: bool,
    run: (usize, usize),
    out: &mut PointOutput<E>,
) -> std::result::Result<Stored, Breakdown> {
    if M::HISTORY && flow {
        R::run(Laws::<M, E, true> {
            law,
            inputs,
            run,
            out,
        })
    } else {
        R::run(Laws::<M, E, false> {
            law,
            inputs,
            run,
            out,
        })
    }
}
