//! Contact with rigid frictionless planes that particles touch, slide along and leave.
//!
//! The condition is one of velocities: a particle may come as close as the plane in a step, not
//! further. With the gap g to where the plane will be at the step's end, the positions of the
//! three-stage integrator ([URL22] 61) end on the free side if
//!
//! ```text
//! g + dt sum_i w_i v_i . n >= 0,
//! ```
//!
//! so each stage gets the lowest normal velocity with which the stages to come still satisfy this,
//! and an impulse where it falls below. F is advanced with the same velocities: F = grad_0 x holds
//! on the plane as everywhere, nothing is moved by hand, and no position is ever behind the plane. A
//! particle leaves as soon as its forces let it: impulses only push. What a particle loses when it
//! is stopped is dissipated; it is the impact energy of a layer half a spacing thick and vanishes
//! with the spacing.
//!
//! Tried instead on a bar of 20 cells that bounces (restitution .933 with the above, in one
//! dimension), at the default CFL number: stopping particles after the step only takes nearly all of
//! the energy (.014; and moving them back onto the plane breaks F = grad_0 x by .2); an acoustic
//! traction max(0, -sigma - rho c v) is as good (.929) but sinks in by .005 spacings, for good; a
//! penalty of stiffness rho c^2/h sinks in by .010 spacings, and of four times that gains 8 % energy.

use super::Boundary;
use crate::error::{Error, Result};
use crate::formulation::url::State;
use crate::integrator::SSP_RK3;
use crate::layout::{Array, Layout};
use crate::ledger::ContactResultant;
use crate::math::*;
use crate::parallel;
use crate::particles::Particles;
use crate::reference::Reference;
use crate::scene::{ScalarFunction, Scene};

/// A rigid frictionless plane.
#[derive(Debug)]
pub struct Wall {
    pub name: String,
    /// A point of it at time 0 [m].
    point: [f64; 3],
    /// Unit normal, towards the body.
    normal: [f64; 3],
    /// Along the normal [m/s].
    velocity: ScalarFunction,
    /// Whether what touches it may leave it.
    separation: bool,
    /// Whether it acts on the particle in a slot; `None`: on all.
    members: Option<Vec<bool>>,
}

/// What a plane has done: part of the state.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct WallState {
    /// Along the normal since time 0 [m].
    pub displacement: f64,
    /// On the body, along the normal, since time 0 [N s].
    pub impulse: f64,
}

/// Energies that contact exchanges in one step [J].
#[derive(Debug, Clone, Copy, Default)]
pub struct Exchange {
    /// Work of the moving planes on the body.
    pub work: f64,
    /// Kinetic energy lost when particles are stopped.
    pub dissipation: f64,
}

/// The particles that may touch a plane in one step, and what the planes do to them. Scratch.
#[derive(Debug, Default)]
pub struct Approach {
    near: Vec<Near>,
    sides: Vec<Side>,
    /// How far each plane moves [m].
    displacements: Vec<f64>,
}

/// A particle near one plane or more.
#[derive(Debug, Clone, Copy)]
struct Near {
    slot: usize,
    mass: f64,
    /// Its sides in [`Approach::sides`].
    sides: (usize, usize),
    /// Projector onto the directions in which the planes can push it.
    span: Mat3<f64>,
    /// Kinetic energy along these directions at the step's start [J].
    kinetic: f64,
    /// Work of all other forces along these directions in this step [J].
    work: f64,
    /// Whether a plane pushed it in this step, and the work of the moving planes on it [J].
    pushed: Option<f64>,
}

/// A particle and a plane.
#[derive(Debug, Clone, Copy)]
struct Side {
    wall: usize,
    /// The plane's normal without what the particle's supports hold.
    direction: [f64; 3],
    /// Distance to where the plane is at the step's end, over the step [m/s].
    closing: f64,
    /// sum w_i v_i . n of the stages so far [m/s].
    travelled: f64,
    /// Whether the particle has to stay on the plane.
    held: bool,
    /// Velocity that the plane gives, in this stage [m/s].
    push: f64,
    /// Lowest velocity along the normal, in this stage [m/s].
    floor: f64,
}

/// Distance at which a particle touches, in units of its size.
const TOUCHING: f64 = 1e-9;
/// Round-off of a gap, in units of a particle's size.
const ROUND_OFF: f64 = 1e-12;

impl Wall {
    /// Distance from the plane, displaced by `displacement`, to a point [m].
    fn gap(&self, x: [f64; 3], displacement: f64) -> f64 {
        dot(sub3(x, self.point), self.normal) - displacement
    }

    fn acts_on(&self, slot: usize) -> bool {
        self.members.as_ref().is_none_or(|members| members[slot])
    }

    /// Along the normal at time `t` [m/s].
    fn velocity(&self, t: f64) -> Result<f64> {
        let v = self.velocity.eval([0.0; 3], t);
        if v.is_finite() {
            Ok(v)
        } else {
            Err(Error::scene(
                format!("contact.{}.velocity", self.name),
                "the value is not finite at this time: check the expression",
            )
            .at_time(t))
        }
    }

    /// Rate of the velocity at time `t` by a difference over `span` [m/s^2].
    fn acceleration(&self, (t, span): (f64, f64)) -> Result<f64> {
        let value = |t| self.velocity(t).map(|v| [v]);
        Ok(super::rate(value(t)?, (t, span), value)[0])
    }
}

/// Impulses that push a velocity over the floors of its sides, as little as possible: Hildreth's
/// method for the least-squares problem; exact at once for one plane, or planes at right angles.
fn push(v: [f64; 3], sides: &mut [Side]) -> [f64; 3] {
    const SWEEPS: usize = 64;
    let mut new = v;
    for side in &mut *sides {
        side.push = 0.0;
    }
    for _ in 0..SWEEPS {
        let mut change: f64 = 0.0;
        for side in &mut *sides {
            let n = side.direction;
            let missing = (side.floor - dot(new, n)) / dot(n, n);
            let total = side.push + missing;
            let total = if side.held { total } else { total.max(0.0) };
            let step = total - side.push;
            side.push = total;
            new = axpy3(new, step, n);
            change = change.max(step.abs() / (1e-14 + total.abs()));
        }
        if sides.len() == 1 || change < 1e-12 {
            break;
        }
    }
    new
}

/// The planes of a scene.
pub(super) fn walls(scene: &Scene, particles: &Particles) -> Result<Vec<Wall>> {
    let mut walls = Vec::with_capacity(scene.contact.len());
    for (name, wall) in &scene.contact {
        let members = match &wall.patch {
            None => None,
            Some(patch) => {
                let facets = particles.patches.iter().find(|p| p.name == *patch);
                let facets = facets.ok_or_else(|| {
                    Error::scene(
                        format!("contact.{name}.patch"),
                        format!("the patch `{patch}` selects no particle"),
                    )
                })?;
                let mut members = vec![false; Layout::slot(particles.positions.len())];
                for facet in &facets.facets {
                    members[Layout::slot(facet.particle as usize)] = true;
                }
                Some(members)
            }
        };
        let length = dot(wall.normal, wall.normal).sqrt();
        walls.push(Wall {
            name: name.clone(),
            point: wall.point,
            normal: scale3(1.0 / length, wall.normal),
            velocity: match &wall.velocity {
                Some(velocity) => velocity.compile()?,
                None => ScalarFunction::Constant(0.0),
            },
            separation: wall.separation,
            members,
        });
    }
    Ok(walls)
}

impl Boundary {
    /// No plane has moved or pushed yet.
    pub fn walls_at_rest(&self) -> Vec<WallState> {
        vec![WallState::default(); self.walls.len()]
    }

    /// Names of the planes.
    pub fn wall_names(&self) -> impl Iterator<Item = &str> {
        self.walls.iter().map(|wall| wall.name.as_str())
    }

    /// A point of a plane at time 0 [m], and its unit normal.
    pub fn wall_plane(&self, wall: usize) -> ([f64; 3], [f64; 3]) {
        let wall = &self.walls[wall];
        (wall.point, wall.normal)
    }

    /// What the planes have done, without what touches them now.
    pub(super) fn resting_contacts(&self, walls: &[WallState]) -> Vec<ContactResultant> {
        let resultant = |(wall, state): (&Wall, &WallState)| ContactResultant {
            impulse: scale3(state.impulse, wall.normal),
            displacement: state.displacement,
            ..ContactResultant::default()
        };
        self.walls.iter().zip(walls).map(resultant).collect()
    }

    /// Every particle within `reach(v . n)` of a plane, in order, with the plane and the gap.
    fn within(
        &self,
        (x, v): (&Array<3>, &Array<3>),
        walls: &[WallState],
        reach: impl Fn(usize, f64, usize) -> f64 + Sync,
    ) -> Vec<(usize, usize, f64)> {
        let layout = x.layout();
        let (x, v) = (x.components(), v.components());
        let found = parallel::map_slabs((0..layout.slabs()).collect(), |_, slab| {
            let (first, slots) = layout.slab_range(slab);
            let end = (first + slots).min(Layout::slot(layout.particles));
            let mut found = Vec::new();
            for slot in first..end {
                for (index, (wall, state)) in self.walls.iter().zip(walls).enumerate() {
                    let gap = wall.gap(x.map(|x| x[slot]), state.displacement);
                    let speed = dot(v.map(|v| v[slot]), wall.normal);
                    if gap <= reach(index, speed, slot) && wall.acts_on(slot) {
                        found.push((slot, index, gap));
                    }
                }
            }
            found
        });
        found.into_iter().flatten().collect()
    }

    /// Projector onto the directions in which the supports leave a particle free.
    fn free_directions(&self, slot: usize) -> Mat3<f64> {
        match self.supports.binary_search_by_key(&slot, |s| s.slot) {
            Ok(at) => axpy9(&IDENTITY, -1.0, &self.supports[at].projector),
            Err(_) => IDENTITY,
        }
    }

    /// Sides of one particle, without the planes that its supports keep it from following.
    fn sides(
        &self,
        found: &[(usize, usize, f64)],
        sides: &mut Vec<Side>,
        size: f64,
    ) -> ((usize, usize), Mat3<f64>) {
        let (first, free) = (sides.len(), self.free_directions(found[0].0));
        let mut span = [[0.0; 3]; 3];
        for &(_, wall, gap) in found {
            let direction = mat_vec(&free, self.walls[wall].normal);
            if dot(direction, direction) < 1e-12 {
                continue;
            }
            let rest = sub3(direction, mat_vec(&span, direction));
            let norm = dot(rest, rest).sqrt();
            if norm > 1e-6 {
                let e = scale3(1.0 / norm, rest);
                span = add_outer(&span, e, e);
            }
            let touches = gap.abs() <= TOUCHING * size;
            sides.push(Side {
                wall,
                direction,
                closing: if gap.abs() <= ROUND_OFF * size {
                    0.0
                } else {
                    gap
                },
                travelled: 0.0,
                held: touches && !self.walls[wall].separation,
                push: 0.0,
                floor: 0.0,
            });
        }
        ((first, sides.len()), span)
    }

    /// Stops what moves into a plane that it touches, at time 0; the energy lost.
    ///
    /// # Errors
    /// A particle that starts behind a plane.
    pub fn first_contact(
        &self,
        state: &mut State,
        walls: &mut [WallState],
        reference: &Reference,
    ) -> Result<Exchange> {
        let State { x, v, .. } = state;
        let mut exchange = Exchange::default();
        let volume = reference.volume.components()[0];
        let size = |slot: usize| volume[slot].cbrt();
        let found = self.within((x, v), walls, |_, _, slot| TOUCHING * size(slot));
        let mut sides = Vec::new();
        for group in found.chunk_by(|a, b| a.0 == b.0) {
            let slot = group[0].0;
            if let Some((_, wall, gap)) = group.iter().find(|g| g.2 < -TOUCHING * size(slot)) {
                let name = &self.walls[*wall].name;
                return Err(Error::scene(
                    format!("contact.{name}"),
                    format!(
                        "a particle starts {:e} m behind the plane: move its `point`, turn its \
                         `normal` towards the body, or give the `patch` that it acts on",
                        -gap
                    ),
                )
                .at_particle(self.order[slot - Layout::FIRST] as usize, Some(x.get(slot))));
            }
            sides.clear();
            self.sides(group, &mut sides, size(slot));
            for side in &mut sides {
                let wall = &self.walls[side.wall];
                side.floor =
                    wall.velocity(0.0)? - dot(v.get(slot), sub3(wall.normal, side.direction));
            }
            let (old, mass) = (v.get(slot), self.density * volume[slot]);
            let new = push(old, &mut sides);
            for side in &sides {
                let impulse = mass * side.push;
                walls[side.wall].impulse += impulse;
                exchange.work += impulse * self.walls[side.wall].velocity(0.0)?;
            }
            exchange.dissipation -= 0.5 * mass * (dot(new, new) - dot(old, old));
            v.set(slot, new);
        }
        exchange.dissipation += exchange.work;
        Ok(exchange)
    }

    /// Finds the particles that may touch a plane in a step: those that are no further than they
    /// move and a wave runs in the step.
    pub fn approach(
        &self,
        approach: &mut Approach,
        state: &State,
        walls: &[WallState],
        reference: &Reference,
        wave_speed: f64,
        (t, dt): (f64, f64),
    ) -> Result<()> {
        approach.near.clear();
        approach.sides.clear();
        if self.walls.is_empty() {
            return Ok(());
        }
        approach.displacements = self.wall_displacements(t, dt)?;
        let displacements = &approach.displacements;
        let reach = |wall: usize, speed: f64, _| {
            dt * (speed.abs() + wave_speed) + displacements[wall].abs()
        };
        let volume = reference.volume.components()[0];
        let State { x, v, .. } = state;
        let found = self.within((x, v), walls, reach);
        for group in found.chunk_by(|a, b| a.0 == b.0) {
            let slot = group[0].0;
            let (sides, span) = self.sides(group, &mut approach.sides, volume[slot].cbrt());
            for side in &mut approach.sides[sides.0..sides.1] {
                side.closing = (side.closing - displacements[side.wall]) / dt;
            }
            let mass = self.density * volume[slot];
            let along = mat_vec(&span, v.get(slot));
            approach.near.push(Near {
                slot,
                mass,
                sides,
                span,
                kinetic: 0.5 * mass * dot(along, along),
                work: 0.0,
                pushed: None,
            });
        }
        Ok(())
    }

    /// How far the planes move in a step [m], by the integrator's own weights.
    fn wall_displacements(&self, t: f64, dt: f64) -> Result<Vec<f64>> {
        let displacement = |wall: &Wall| {
            SSP_RK3.iter().try_fold(0.0, |sum, s| {
                Ok(sum + dt * s.weight * wall.velocity(t + s.time * dt)?)
            })
        };
        self.walls.iter().map(displacement).collect()
    }

    /// Before stage `i`: what the other forces do, and how far the particles travel.
    pub fn follow(
        &self,
        approach: &mut Approach,
        i: usize,
        force: &Array<3>,
        v: &Array<3>,
        dt: f64,
    ) {
        let weight = SSP_RK3[i].weight;
        for near in &mut approach.near {
            let v = v.get(near.slot);
            near.work += weight * dt * dot(mat_vec(&near.span, force.get(near.slot)), v);
            for side in &mut approach.sides[near.sides.0..near.sides.1] {
                side.travelled += weight * dot(v, self.walls[side.wall].normal);
            }
        }
    }

    /// After stage `i`, at time `t`: no particle moves so that the step would end behind a plane.
    pub fn keep_out(
        &self,
        approach: &mut Approach,
        i: usize,
        v: &mut Array<3>,
        walls: &mut [WallState],
        t: f64,
    ) -> Result<()> {
        let to_come: f64 = SSP_RK3[i + 1..].iter().map(|s| s.weight).sum();
        for near in &mut approach.near {
            let sides = &mut approach.sides[near.sides.0..near.sides.1];
            let old = v.get(near.slot);
            for side in &mut *sides {
                let wall = &self.walls[side.wall];
                let gap = side.closing + side.travelled;
                let floor = if to_come > 0.0 {
                    -gap / to_come
                } else {
                    // The next step starts from here: it must not arrive before its end.
                    wall.velocity(t)? - gap.max(0.0)
                };
                // The part of the normal velocity that the supports hold is settled.
                side.floor = floor - dot(old, sub3(wall.normal, side.direction));
            }
            let new = push(old, sides);
            for side in &*sides {
                if side.push != 0.0 {
                    let impulse = SSP_RK3[i].carry * near.mass * side.push;
                    let work = impulse * self.walls[side.wall].velocity(t)?;
                    walls[side.wall].impulse += impulse;
                    near.pushed = Some(near.pushed.unwrap_or(0.0) + work);
                }
            }
            v.set(near.slot, new);
        }
        Ok(())
    }

    /// At the step's end: the planes have moved; what they did to the energy.
    ///
    /// What a particle lost is what it has less than the work of all other forces and of moving
    /// planes gave it. The quadrature of that work sees a release as a gain of higher order in the
    /// step: contact cannot give energy, so that stays an error of integration.
    pub fn settle(&self, approach: &Approach, v: &Array<3>, walls: &mut [WallState]) -> Exchange {
        let mut exchange = Exchange::default();
        for near in &approach.near {
            let Some(work) = near.pushed else { continue };
            let along = mat_vec(&near.span, v.get(near.slot));
            let gain = 0.5 * near.mass * dot(along, along) - near.kinetic;
            exchange.work += work;
            exchange.dissipation += (work + near.work - gain).max(0.0);
        }
        for (wall, displacement) in walls.iter_mut().zip(&approach.displacements) {
            wall.displacement += displacement;
        }
        exchange
    }

    /// Forces of the planes on the particles that touch them and do not leave, from all other
    /// forces with the supports' in place: (slot, plane, force [N]).
    pub(super) fn contact_forces(
        &self,
        force: &Array<3>,
        (x, v): (&Array<3>, &Array<3>),
        walls: &[WallState],
        reference: &Reference,
        now: (f64, f64),
    ) -> Result<Vec<(usize, usize, [f64; 3])>> {
        let volume = reference.volume.components()[0];
        let touching = |slot: usize| TOUCHING * volume[slot].cbrt();
        let found = self.within((x, v), walls, |_, _, slot| touching(slot));
        let (mut sides, mut forces) = (Vec::new(), Vec::new());
        for group in found.chunk_by(|a, b| a.0 == b.0) {
            let slot = group[0].0;
            sides.clear();
            self.sides(group, &mut sides, volume[slot].cbrt());
            let mass = self.density * volume[slot];
            let acceleration = scale3(1.0 / mass, force.get(slot));
            for side in &mut sides {
                let wall = &self.walls[side.wall];
                let leaving = dot(v.get(slot), wall.normal) - wall.velocity(now.0)?;
                side.floor = if side.held || leaving * now.1 <= touching(slot) {
                    let settled = dot(acceleration, sub3(wall.normal, side.direction));
                    wall.acceleration(now)? - settled
                } else {
                    f64::NEG_INFINITY
                };
            }
            push(acceleration, &mut sides);
            for side in &sides {
                forces.push((slot, side.wall, scale3(mass * side.push, side.direction)));
            }
        }
        Ok(forces)
    }
}
