//! Loads: tractions, pressures and the body force.

use super::{Boundary, InputValues, Quantity, Source};
use crate::error::{Error, Result};
use crate::formulation::url::{State, Url};
use crate::layout::{Array, Layout};
use crate::math::*;
use crate::parallel;
use crate::reference::Reference;
use crate::scene::{Condition, VectorFunction};

/// A load on a patch.
#[derive(Debug)]
pub(super) struct Load {
    pub patch: usize,
    quantity: Quantity,
    source: Source,
}

impl Boundary {
    /// Takes over the loads of one patch.
    pub(super) fn loads_on(&mut self, patch: usize, condition: &Condition) -> Result<()> {
        let add = |this: &mut Self, quantity, source| {
            this.loads.push(Load {
                patch,
                quantity,
                source,
            });
        };
        if let Some(traction) = &condition.traction {
            let source = self.vector_source(patch, Quantity::Traction, traction.compile()?);
            add(self, Quantity::Traction, source);
        }
        if let Some(pressure) = &condition.pressure {
            let source = self.scalar_source(patch, Quantity::Pressure, pressure.compile()?);
            add(self, Quantity::Pressure, source);
        }
        Ok(())
    }

    /// Force of a load on one particle of its patch [N].
    pub(super) fn load_force(
        &self,
        load: &Load,
        index: usize,
        kinematics: (&Url, &State, &Reference),
        t: f64,
        inputs: &InputValues,
    ) -> Result<[f64; 3]> {
        let member = &self.members[load.patch][index];
        let place = (load.patch, load.quantity);
        if load.quantity == Quantity::Pressure {
            let [p] = self.checked(&load.source, place, index, t, inputs)?;
            // a n = H A N: the follower pressure acts on the current area.
            let (url, state, reference) = kinematics;
            let deformation = url.deformation(state, reference, member.slot);
            Ok(scale3(-p, mat_vec(&deformation.h, member.area_vector)))
        } else {
            let t_r = self.checked(&load.source, place, index, t, inputs)?;
            Ok(scale3(member.area, t_r))
        }
    }

    /// Adds tractions, pressures and body force at time `t` to `force`; returns their power [W].
    pub fn add_loads(
        &self,
        force: &mut Array<3>,
        url: &Url,
        state: &State,
        reference: &Reference,
        t: f64,
        inputs: &InputValues,
    ) -> Result<f64> {
        let mut power = 0.0;
        for load in &self.loads {
            for (index, member) in self.members[load.patch].iter().enumerate() {
                let own = self.load_force(load, index, (url, state, reference), t, inputs)?;
                power += dot(own, state.v.get(member.slot));
                force.set(member.slot, add3(force.get(member.slot), own));
            }
        }
        if let Some(body_force) = &self.body_force {
            power += self.add_body_force(body_force, force, state, reference, t)?;
        }
        Ok(power)
    }

    /// Adds V_R f_R at time `t`; returns its power.
    fn add_body_force(
        &self,
        body_force: &VectorFunction,
        force: &mut Array<3>,
        state: &State,
        reference: &Reference,
        t: f64,
    ) -> Result<f64> {
        let layout = reference.layout;
        let (x, v) = (reference.x_initial.components(), state.v.components());
        let volume = reference.volume.components()[0];
        let everywhere = !body_force.depends_on_space();
        let constant = everywhere.then(|| body_force.eval([0.0; 3], t));
        let powers = parallel::map_slabs(force.slabs_mut(), |slab, out| {
            let (first, _) = layout.slab_range(slab);
            let mut power = 0.0;
            for i in 0..out[0].len() {
                let a = first + i;
                if volume[a] == 0.0 {
                    continue;
                }
                let f = constant.unwrap_or_else(|| body_force.eval([x[0][a], x[1][a], x[2][a]], t));
                if !f.iter().all(|f| f.is_finite()) {
                    return Err(a);
                }
                for c in 0..3 {
                    out[c][i] += volume[a] * f[c];
                    power += volume[a] * f[c] * v[c][a];
                }
            }
            Ok(power)
        });
        powers
            .into_iter()
            .try_fold(0.0, |total, power| match power {
                Ok(power) => Ok(total + power),
                Err(a) => Err(self.not_finite("body_force", a, reference, t)),
            })
    }

    /// The error of a volume load without a finite value in a slot.
    pub(super) fn not_finite(
        &self,
        path: &str,
        slot: usize,
        reference: &Reference,
        t: f64,
    ) -> Error {
        Error::scene(
            path,
            "the value is not finite here: check the expression for this place and time",
        )
        .at_particle(
            self.order[slot - Layout::FIRST] as usize,
            Some(reference.x_initial.get(slot)),
        )
        .at_time(t)
    }

    /// Internal forces (in `url.rates.force`), loads and body force, without support reactions [N].
    pub(super) fn applied_forces(
        &self,
        url: &Url,
        state: &State,
        reference: &Reference,
        t: f64,
        inputs: &InputValues,
    ) -> Result<Array<3>> {
        let mut force = url.rates.force.clone();
        self.add_loads(&mut force, url, state, reference, t, inputs)?;
        Ok(force)
    }
}
