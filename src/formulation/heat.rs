//! Temperature, heat and plastic flow of a body: what surrounds the passes.

use super::advance::Heating;
use super::laws::{Flow, Plastic, flow};
use super::passes::Kinematics;
use super::url::{State, Url};
use crate::layout::Layout;
use crate::material::{Thermal, with_law};
use crate::math::*;
use crate::parallel;
use crate::reference::Reference;

impl Url {
    /// Thermal constants and the entropy of the particle in a slot.
    pub(super) fn thermal_at(&self, state: &State, slot: usize) -> Option<(Thermal, f64)> {
        let eta = state.eta.as_ref()?.get(slot)[0];
        Some((self.options.thermal?, eta))
    }

    /// Temperature of the particle in a slot [K]; NaN of a body without heat.
    pub fn temperature(&self, state: &State, reference: &Reference, slot: usize) -> f64 {
        let d = self.deformation(state, reference, slot);
        self.thermal_at(state, slot)
            .map_or(f64::NAN, |(thermal, eta)| thermal.warmth(&d, eta).theta)
    }

    /// Temperature that the last evaluation found in a slot [K].
    pub fn evaluated_temperature(&self, slot: usize) -> f64 {
        let theta = self.scratch.theta.as_ref();
        theta.map_or(f64::NAN, |theta| theta.get(slot)[0])
    }

    /// Heat that the particle in a slot takes up [W] at the evaluated rates while its temperature
    /// changes at a rate [K/s]: theta d eta/dt.
    pub fn heat_uptake(&self, state: &State, reference: &Reference, slot: usize, rate: f64) -> f64 {
        let Some(thermal) = self.options.thermal else {
            return 0.0;
        };
        let d = self.deformation(state, reference, slot);
        let f = matrix(&state.f.get(slot));
        let cof = cofactor(&f);
        // Rate of ln J.
        let dilation = double_dot(&self.grad_v(slot), &cof) / dot(f[0], cof[0]);
        let theta = self.evaluated_temperature(slot);
        reference.volume.get(slot)[0] * thermal.uptake(&d, theta, rate, dilation)
    }

    /// Heat rate that a ledger counts [W]: what comes from outside. The linear law's entropy takes
    /// heat up at the reference temperature, so that its energy changes by theta/theta_R of the heat
    /// everywhere, conduction included.
    pub fn heat_power(&self, external: f64) -> f64 {
        match (&self.rates.heat, self.options.thermal) {
            (Some(heat), Some(thermal)) if thermal.linear => {
                let slots = (0..heat.particles()).map(Layout::slot);
                slots
                    .map(|s| heat.get(s)[0] * self.evaluated_temperature(s) / thermal.theta_r)
                    .sum()
            }
            _ => external,
        }
    }

    /// Sets the temperature [K] of the particle in a slot at its present deformation; the entropy
    /// [J/K] and the heat [J] that this takes.
    pub fn set_temperature(
        &self,
        state: &mut State,
        reference: &Reference,
        slot: usize,
        theta: f64,
    ) -> (f64, f64) {
        let d = self.deformation(state, reference, slot);
        let (Some(eta), Some(thermal)) = (&mut state.eta, self.options.thermal) else {
            return (0.0, 0.0);
        };
        let before = eta.get(slot)[0];
        let after = thermal.entropy(&d, theta);
        eta.set(slot, [after]);
        let energy = |eta| thermal.warmth(&d, eta).energy;
        let volume = reference.volume.get(slot)[0];
        (
            volume * (after - before),
            volume * (energy(after) - energy(before)),
        )
    }

    /// Constants of a body with heat.
    pub fn thermal(&self) -> Option<Thermal> {
        self.options.thermal
    }

    /// Plastic flow from the step's start over `elapsed` [s] at the present state: the history is
    /// mapped, and the part of the plastic work that becomes heat raises the entropy.
    pub fn commit(&self, state: &mut State, reference: &Reference, elapsed: f64) -> Plastic {
        let Some(mut history) = state.history.take() else {
            return Plastic::default();
        };
        let mut eta = state.eta.take();
        let kinematics = Kinematics::new(state, reference);
        let mut etas = eta.as_mut().map(|e| e.slabs_mut().into_iter());
        let (law, thermal) = (self.law(), self.options.thermal);
        let slabs: Vec<_> = history
            .slabs_mut()
            .into_iter()
            .map(|history| {
                let eta = etas.as_mut().and_then(Iterator::next).map(|[e]| e);
                (history, eta.zip(thermal))
            })
            .collect();
        let flows = parallel::map_slabs(slabs, |slab, (history, heat)| {
            with_law!(law, law => flow(Flow {
                law, kinematics, reference, elapsed, slab, history, heat,
            }))
        });
        state.history = Some(history);
        state.eta = eta;
        let mut total = Plastic::default();
        flows.into_iter().for_each(|f| total += f);
        total
    }

    /// What turns heat rates into rates of entropy.
    pub(super) fn heating(&self) -> Option<Heating<'_>> {
        Some(Heating {
            thermal: self.options.thermal?,
            heat: self.rates.heat.as_ref()?.components()[0],
            theta: self.scratch.theta.as_ref()?.components()[0],
        })
    }
}
