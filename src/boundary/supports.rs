//! Supports: constrained directions of particles, what they prescribe and what they carry.

use super::{Boundary, InputValues, Quantity, Source};
use crate::error::{Error, Result};
use crate::layout::{Array, Layout};
use crate::math::*;
use crate::particles::{Particles, PatchFacets};
use crate::scene::{Condition, Support};

/// A particle with at least one constrained direction.
#[derive(Debug)]
pub(super) struct Supported {
    pub slot: usize,
    pub mass: f64,
    /// Projector onto the constrained directions.
    pub projector: Mat3<f64>,
    /// Share of a patch in the reaction; the shares add up to the projector.
    pub shares: Vec<(usize, Mat3<f64>)>,
    /// Prescribed velocities: the patch's source, the particle's place in it, the components set.
    prescribed: Vec<Prescribed>,
}

#[derive(Debug)]
struct Prescribed {
    patch: usize,
    member: usize,
    source: Source,
    set: [bool; 3],
}

/// Directions that one patch constrains at one particle.
pub(super) struct Constraint {
    particle: u32,
    patch: usize,
    directions: Vec<[f64; 3]>,
    prescribed: Option<(usize, Source, [bool; 3])>,
}

impl Boundary {
    /// Takes over the support or the prescribed velocity of one patch.
    pub(super) fn supports_on(
        &mut self,
        patch: usize,
        condition: &Condition,
        particles: &Particles,
        constraints: &mut Vec<Constraint>,
    ) -> Result<()> {
        if let Some(support) = condition.support {
            constraints.extend(homogeneous(patch, support, &particles.patches[patch]));
        }
        if let Some(velocity) = &condition.velocity {
            let function = velocity.compile()?;
            let set = function.free().map(|free| !free);
            let source = self.vector_source(patch, Quantity::Velocity, function);
            for (member, m) in self.members[patch].iter().enumerate() {
                constraints.push(Constraint {
                    particle: (m.slot - Layout::FIRST) as u32,
                    patch,
                    directions: axes(set),
                    prescribed: Some((member, source.clone(), set)),
                });
            }
        }
        Ok(())
    }

    /// The supports of all patches by particle, ascending.
    pub(super) fn combine_supports(
        &mut self,
        mut constraints: Vec<Constraint>,
        particles: &Particles,
    ) -> Result<()> {
        constraints.sort_by_key(|c| c.particle);
        for group in constraints.chunk_by(|a, b| a.particle == b.particle) {
            self.supports.push(self.combine(group, particles)?);
        }
        Ok(())
    }

    /// All constraints of one particle in one projector.
    fn combine(&self, group: &[Constraint], particles: &Particles) -> Result<Supported> {
        let body = group[0].particle as usize;
        for (i, a) in group.iter().enumerate() {
            for b in &group[i + 1..] {
                let prescribed = a.prescribed.is_some() || b.prescribed.is_some();
                let overlap = a
                    .directions
                    .iter()
                    .any(|u| b.directions.iter().any(|v| dot(*u, *v).abs() > 1e-9));
                if prescribed && overlap && a.patch != b.patch {
                    let (p, q) = (&self.patches[a.patch].name, &self.patches[b.patch].name);
                    return Err(Error::scene(
                        format!("boundary.{q}"),
                        format!(
                            "a particle lies on the patches `{p}` and `{q}`, and both set the same \
                             component of its velocity: leave that component free in one of them \
                             (null in `velocity`), or select patches that do not overlap"
                        ),
                    )
                    .at_boundary(q)
                    .at_particle(particles.caller(body), Some(particles.positions[body])));
                }
            }
        }
        let mut basis: Vec<[f64; 3]> = Vec::new();
        for direction in group.iter().flat_map(|c| &c.directions) {
            let rest = basis
                .iter()
                .fold(*direction, |r, e| axpy3(r, -dot(*direction, *e), *e));
            let norm = dot(rest, rest).sqrt();
            if norm > 1e-6 {
                basis.push(scale3(1.0 / norm, rest));
            }
        }
        let zero = [[0.0; 3]; 3];
        let projector = basis.iter().fold(zero, |p, e| add_outer(&p, *e, *e));
        // A direction that several patches constrain is shared by them in equal parts.
        let hold = |c: &Constraint, e: [f64; 3]| {
            c.directions.iter().map(|d| dot(*d, e).powi(2)).sum::<f64>()
        };
        let mut shares: Vec<(usize, Mat3<f64>)> = Vec::new();
        for e in &basis {
            let whole: f64 = group.iter().map(|c| hold(c, *e)).sum();
            for c in group {
                let part = add_outer(&zero, scale3(hold(c, *e) / whole, *e), *e);
                match shares.iter_mut().find(|(p, _)| *p == c.patch) {
                    Some((_, share)) => *share = add9(share, &part),
                    None => shares.push((c.patch, part)),
                }
            }
        }
        let prescribed = group
            .iter()
            .filter_map(|c| {
                let (member, source, set) = c.prescribed.clone()?;
                Some(Prescribed {
                    patch: c.patch,
                    member,
                    source,
                    set,
                })
            })
            .collect();
        Ok(Supported {
            slot: Layout::slot(body),
            mass: self.density * particles.volumes[body],
            projector,
            shares,
            prescribed,
        })
    }

    fn prescribed_velocity(&self, s: &Supported, t: f64, inputs: &InputValues) -> Result<[f64; 3]> {
        let mut velocity = [0.0; 3];
        for p in &s.prescribed {
            let place = (p.patch, Quantity::Velocity);
            let value: [f64; 3] = self.checked(&p.source, place, p.member, t, inputs)?;
            for c in 0..3 {
                if p.set[c] {
                    velocity[c] += value[c];
                }
            }
        }
        Ok(velocity)
    }

    /// Gives the constrained components of the velocity their values at time `t`; whether any changed.
    pub fn constrain(&self, v: &mut Array<3>, t: f64, inputs: &InputValues) -> Result<bool> {
        let mut changed = false;
        for s in &self.supports {
            let old = v.get(s.slot);
            let target = self.prescribed_velocity(s, t, inputs)?;
            let new = add3(sub3(old, mat_vec(&s.projector, old)), target);
            changed |= new != old;
            v.set(s.slot, new);
        }
        Ok(changed)
    }

    /// Kinetic energy of the constrained components [J].
    pub fn constrained_kinetic(&self, v: &Array<3>) -> f64 {
        let energy = |s: &Supported| {
            let own = mat_vec(&s.projector, v.get(s.slot));
            0.5 * s.mass * dot(own, own)
        };
        self.supports.iter().map(energy).sum()
    }

    /// Power of the forces on the constrained components [W]: what the supports have to balance.
    pub fn constrained_power(&self, force: &Array<3>, v: &Array<3>) -> f64 {
        self.supports
            .iter()
            .map(|s| dot(mat_vec(&s.projector, force.get(s.slot)), v.get(s.slot)))
            .sum()
    }

    /// Adds the reactions of the supports to all other forces: the constrained part becomes inertia.
    pub(super) fn support(
        &self,
        force: &mut Array<3>,
        (t, span): (f64, f64),
        inputs: &InputValues,
    ) -> Result<()> {
        for s in &self.supports {
            let own = force.get(s.slot);
            let inertia = scale3(s.mass, self.prescribed_acceleration(s, t, span, inputs)?);
            force.set(s.slot, add3(sub3(own, mat_vec(&s.projector, own)), inertia));
        }
        Ok(())
    }

    /// Rate of change of the prescribed velocity at time `t`, by a difference over `span` [m/s^2].
    pub(super) fn prescribed_acceleration(
        &self,
        s: &Supported,
        t: f64,
        span: f64,
        inputs: &InputValues,
    ) -> Result<[f64; 3]> {
        if s.prescribed.is_empty() {
            return Ok([0.0; 3]);
        }
        let now = self.prescribed_velocity(s, t, inputs)?;
        Ok(super::rate(now, (t, span), |time| {
            self.prescribed_velocity(s, time, inputs)
        }))
    }
}

fn axes(set: [bool; 3]) -> Vec<[f64; 3]> {
    let unit = IDENTITY;
    (0..3).filter(|c| set[*c]).map(|c| unit[c]).collect()
}

fn homogeneous(patch: usize, support: Support, facets: &PatchFacets) -> Vec<Constraint> {
    facets
        .facets
        .iter()
        .map(|facet| {
            let n = facet.normal;
            let directions = match support {
                Support::Clamped => axes([true; 3]),
                Support::Roller => vec![n],
                Support::Antisymmetry => {
                    let helper = axes([true; 3])
                        .into_iter()
                        .min_by(|a, b| dot(*a, n).abs().total_cmp(&dot(*b, n).abs()))
                        .expect("three axes");
                    let u = cross(n, helper);
                    let u = scale3(1.0 / dot(u, u).sqrt(), u);
                    vec![u, cross(n, u)]
                }
            };
            Constraint {
                particle: facet.particle,
                patch,
                directions,
                prescribed: None,
            }
        })
        .collect()
}
