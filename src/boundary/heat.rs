//! Heat through patches: flux, convection, and prescribed temperatures; a patch without any of them
//! is adiabatic.

use super::{Boundary, InputValues, Quantity, Source};
use crate::error::{Error, Result};
use crate::layout::Array;
use crate::ledger::HeatResultant;
use crate::parallel;
use crate::reference::Reference;
use crate::scene::{Condition, Scalar, ScalarFunction, Scene};

/// Heat conditions of a body.
#[derive(Debug, Default)]
pub(super) struct Heat {
    flows: Vec<Flow>,
    held: Vec<Held>,
    /// r_R [W/m^3], per unit initial volume.
    source: Option<ScalarFunction>,
}

/// Heat that flows in through a patch.
#[derive(Debug)]
struct Flow {
    patch: usize,
    kind: Kind,
}

#[derive(Debug)]
enum Kind {
    /// q, per unit initial area.
    Flux(Source),
    /// q = h (theta_ambient - theta), per unit initial area.
    Convection {
        coefficient: Source,
        ambient: Source,
    },
}

/// A particle with a prescribed temperature.
#[derive(Debug)]
struct Held {
    slot: usize,
    source: Source,
    /// The patches that prescribe it, with the particle's place in each: the first has the source.
    patches: Vec<(usize, usize)>,
}

impl Heat {
    /// The heat source of a scene; the patches' conditions follow one by one.
    pub fn new(scene: &Scene) -> Result<Self> {
        let source = scene.heat.as_ref().and_then(|heat| heat.source.as_ref());
        Ok(Self {
            source: source.map(Scalar::compile).transpose()?,
            ..Self::default()
        })
    }
}

impl Boundary {
    /// Takes over the heat conditions of one patch.
    pub(super) fn heat_on(
        &mut self,
        patch: usize,
        condition: &Condition,
        scene: &Scene,
    ) -> Result<()> {
        if let Some(flux) = &condition.heat_flux {
            let source = self.scalar_source(patch, Quantity::HeatFlux, flux.compile()?);
            let kind = Kind::Flux(source);
            self.heat.flows.push(Flow { patch, kind });
        }
        if let Some(convection) = &condition.convection {
            let coefficient = convection.coefficient.compile()?;
            let ambient = convection.ambient_temperature.compile()?;
            let kind = Kind::Convection {
                coefficient: self.scalar_source(
                    patch,
                    Quantity::ConvectionCoefficient,
                    coefficient,
                ),
                ambient: self.scalar_source(patch, Quantity::AmbientTemperature, ambient),
            };
            self.heat.flows.push(Flow { patch, kind });
        }
        if let Some(temperature) = &condition.temperature {
            self.hold(patch, temperature, scene)?;
        }
        Ok(())
    }

    /// Prescribes the temperature of a patch's particles, unless another patch prescribes the same.
    fn hold(&mut self, patch: usize, temperature: &Scalar, scene: &Scene) -> Result<()> {
        let source = self.scalar_source(patch, Quantity::Temperature, temperature.compile()?);
        for (index, member) in self.members[patch].iter().enumerate() {
            let at = match self
                .heat
                .held
                .binary_search_by_key(&member.slot, |h| h.slot)
            {
                Ok(at) => at,
                Err(at) => {
                    let held = Held {
                        slot: member.slot,
                        source: source.clone(),
                        patches: Vec::new(),
                    };
                    self.heat.held.insert(at, held);
                    at
                }
            };
            let held = &mut self.heat.held[at];
            if let Some((other, _)) = held.patches.first() {
                let (p, q) = (&self.patches[*other].name, &self.patches[patch].name);
                let same_text =
                    scene.boundary.get(p).and_then(|c| c.temperature.as_ref()) == Some(temperature);
                let same = match (&held.source, &source) {
                    (Source::Scalar(a), Source::Scalar(b)) => {
                        let x = member.position;
                        let always = !a.depends_on_time() && !b.depends_on_time();
                        same_text || always && a.eval(x, 0.0) == b.eval(x, 0.0)
                    }
                    _ => false,
                };
                if !same {
                    return Err(Error::scene(
                        format!("boundary.{q}.temperature"),
                        format!(
                            "a particle lies on the patches `{p}` and `{q}`, and both prescribe its \
                             temperature: select patches that do not overlap, or give both the same \
                             temperature"
                        ),
                    )
                    .at_boundary(q)
                    .at_particle(self.patches[patch].particles[index], Some(member.position)));
                }
            }
            held.patches.push((patch, index));
        }
        Ok(())
    }

    /// Heat per unit initial area that flows in at one particle of a patch [W/m^2].
    fn flux(
        &self,
        flow: &Flow,
        index: usize,
        temperature: f64,
        t: f64,
        inputs: &InputValues,
    ) -> Result<f64> {
        let value = |source, quantity| -> Result<f64> {
            let [value] = self.checked(source, (flow.patch, quantity), index, t, inputs)?;
            Ok(value)
        };
        match &flow.kind {
            Kind::Flux(source) => value(source, Quantity::HeatFlux),
            Kind::Convection {
                coefficient,
                ambient,
            } => Ok(value(coefficient, Quantity::ConvectionCoefficient)?
                * (value(ambient, Quantity::AmbientTemperature)? - temperature)),
        }
    }

    /// What convection adds to the fastest decay of a temperature [W/(m^3 K)]: the largest h A/V_R of a
    /// particle. Patches that meet count as if their worst particles were the same.
    pub fn convection_rate(&self, reference: &Reference, t: f64, inputs: &InputValues) -> f64 {
        let mut total = 0.0;
        for flow in &self.heat.flows {
            let Kind::Convection { coefficient, .. } = &flow.kind else {
                continue;
            };
            let place = (flow.patch, Quantity::ConvectionCoefficient);
            let members = self.members[flow.patch].iter().enumerate();
            total += members.fold(0.0, |most: f64, (index, member)| {
                // A value that is not admissible stops the step that uses it.
                let h = self.checked(coefficient, place, index, t, inputs);
                let [h] = h.unwrap_or([0.0]);
                most.max(h * member.area / reference.volume.get(member.slot)[0])
            });
        }
        total
    }

    /// Adds V_R r_R at time `t`; returns its sum.
    fn add_source(&self, heat: &mut Array<1>, reference: &Reference, t: f64) -> Result<f64> {
        let Some(source) = &self.heat.source else {
            return Ok(0.0);
        };
        let layout = reference.layout;
        let x = reference.x_initial.components();
        let volume = reference.volume.components()[0];
        let constant = (!source.depends_on_space()).then(|| source.eval([0.0; 3], t));
        let powers = parallel::map_slabs(heat.slabs_mut(), |slab, [out]| {
            let (first, _) = layout.slab_range(slab);
            let mut power = 0.0;
            for (i, heat) in out.iter_mut().enumerate() {
                let a = first + i;
                if volume[a] == 0.0 {
                    continue;
                }
                let r = constant.unwrap_or_else(|| source.eval([x[0][a], x[1][a], x[2][a]], t));
                if !r.is_finite() {
                    return Err(a);
                }
                *heat += volume[a] * r;
                power += volume[a] * r;
            }
            Ok(power)
        });
        powers
            .into_iter()
            .try_fold(0.0, |total, power| match power {
                Ok(power) => Ok(total + power),
                Err(a) => Err(self.not_finite("heat.source", a, reference, t)),
            })
    }

    /// Adds the heat of the source and that flows in through all patches at time `t` to `heat` [W per particle];
    /// returns its sum [W]. `temperature` gives the present temperature of a slot [K].
    pub fn add_heat(
        &self,
        heat: &mut Array<1>,
        temperature: impl Fn(usize) -> f64,
        reference: &Reference,
        t: f64,
        inputs: &InputValues,
    ) -> Result<f64> {
        let mut power = self.add_source(heat, reference, t)?;
        for flow in &self.heat.flows {
            for (index, member) in self.members[flow.patch].iter().enumerate() {
                let theta = temperature(member.slot);
                let q = member.area * self.flux(flow, index, theta, t, inputs)?;
                let [old] = heat.get(member.slot);
                heat.set(member.slot, [old + q]);
                power += q;
            }
        }
        Ok(power)
    }

    /// Calls `hold(slot, temperature)` for every particle whose temperature is prescribed at time `t`.
    pub fn hold_temperatures(
        &self,
        t: f64,
        inputs: &InputValues,
        mut hold: impl FnMut(usize, f64),
    ) -> Result<()> {
        for held in &self.heat.held {
            hold(held.slot, self.held_temperature(held, t, inputs)?);
        }
        Ok(())
    }

    fn held_temperature(&self, held: &Held, t: f64, inputs: &InputValues) -> Result<f64> {
        let (patch, index) = held.patches[0];
        let place = (patch, Quantity::Temperature);
        let [theta] = self.checked(&held.source, place, index, t, inputs)?;
        Ok(theta)
    }

    /// Rate of change of a prescribed temperature at time `t`, by a difference over `span` [K/s].
    fn held_rate(&self, held: &Held, (t, span): (f64, f64), inputs: &InputValues) -> Result<f64> {
        let now = self.held_temperature(held, t, inputs)?;
        let value = |time| self.held_temperature(held, time, inputs);
        Ok(super::rate([now], (t, span), |time| value(time).map(|v| [v]))[0])
    }

    /// Heat resultants of all patches. `heat` is the heat by conduction [W per particle];
    /// `stored(slot, rate)` is the
    /// heat that a particle takes up while its temperature changes at that rate [W].
    pub fn heat_resultants(
        &self,
        heat: &Array<1>,
        reference: &Reference,
        temperature: impl Fn(usize) -> f64,
        stored: impl Fn(usize, f64) -> f64,
        (t, span): (f64, f64),
        inputs: &InputValues,
    ) -> Result<Vec<HeatResultant>> {
        let mut resultants: Vec<HeatResultant> = self
            .members
            .iter()
            .map(|members| {
                let area: f64 = members.iter().map(|m| m.area).sum();
                let mut r = HeatResultant::default();
                for m in members {
                    let theta = temperature(m.slot);
                    r.mean_temperature += m.area / area * theta;
                    r.maximum_temperature = r.maximum_temperature.max(theta);
                }
                r
            })
            .collect();
        for flow in &self.heat.flows {
            for (index, member) in self.members[flow.patch].iter().enumerate() {
                let theta = temperature(member.slot);
                resultants[flow.patch].heat_flow +=
                    member.area * self.flux(flow, index, theta, t, inputs)?;
            }
        }
        if self.heat.held.is_empty() {
            return Ok(resultants);
        }
        let mut heat = heat.clone();
        self.add_heat(&mut heat, &temperature, reference, t, inputs)?;
        for held in &self.heat.held {
            // What the surroundings supply = what is stored - all other heat.
            let rate = self.held_rate(held, (t, span), inputs)?;
            let supplied = stored(held.slot, rate) - heat.get(held.slot)[0];
            for (patch, _) in &held.patches {
                resultants[*patch].heat_flow += supplied / held.patches.len() as f64;
            }
        }
        Ok(resultants)
    }
}
