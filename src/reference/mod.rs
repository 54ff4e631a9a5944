//! The reference configuration: graph in slices, pair vectors, corrected gradients; build and rebuild.
//!
//! All operators of [URL22] sections 4.1 and 4.2 take one form. With a pair vector g_ab and
//! L_a = (sum_b g_ab (x) (chi_b - chi_a))^-1 the corrected gradient is L_a g_ab and the pseudo-area
//! (58) is C_ab = 2 V_chi L_a g_ab; a factor common to all pairs of a particle cancels. The kernel
//! options differ in g_ab alone:
//!
//! | option | g_ab | L_a |
//! |---|---|---|
//! | #1 (49) | k r_ab | F_chi^-T (sum g (x) r)^-1 |
//! | #2 (50) | k r_ab | (sum F_chi^-T g (x) r_chi)^-1 F_chi^-T |
//! | #3 (51) | k^ r^_ab | (sum F_chi^-T g (x) r_chi)^-1 F_chi^-T |
//! | #4 (52) | k^ F_ave^-T r^_ab | (sum g (x) r_chi)^-1 |
//!
//! with r_ab = X_b - X_a, r^_ab = F_ave^-1 (chi_b - chi_a) (46), k = -W'(|r|)/|r|. Unit weights leave
//! the tributary volume out of k, which makes a uniform stress force-free inside the body; then the
//! kernel of a pair is the mean of both particles', so that k_ab = k_ba.

mod coarse;
mod pairs;
mod repair;
mod single;
mod slices;
mod updated;

use crate::error::{Error, Result};
use crate::kernel;
use crate::lane::{Lane, Real, SLICE, Slots, Work, vectorised};
use crate::layout::{Array, Layout};
use crate::math::*;
use crate::neighbours::Graph;
use crate::parallel;
use crate::particles::{Mesh, Particles, Shape};
use crate::scene::{Numerics, Operators, Precision, ReferenceUpdate, Weights};

use pairs::{Closed, Lean, StoredVectors};
pub(crate) use pairs::{PairVectors, Pairs, with_pairs};
pub use repair::Repair;
use repair::{Flat, Goal, Multipliers, Problem};
use single::Single;
pub(crate) use slices::Slices;
use updated::{Kernels, PulledBackVectors, PulledBackWeights, SmoothingLength};

/// Tolerance of the closure and most iterations of a repair at the start: round-off, in 20 to 80
/// iterations for bodies of 100 to 800 000 particles. Only operators without a repair take them all.
const AT_START: (f64, usize) = (1e-12, 250);
/// The same at updates of the reference, from the multipliers before.
const AT_UPDATES: (f64, usize) = (1e-6, 8);
/// Root mean square of the closure's defect, over the areas, that cannot be left to stand.
const TOO_OPEN: f64 = 1e-2;

/// Fields of an updated reference; a simulation that never updates has none of them.
#[derive(Debug, Clone, PartialEq)]
pub struct Updated {
    /// chi [m], reference; set when the reference is updated.
    pub chi: Array<3>,
    /// F_chi, initial to reference.
    pub f_chi: Array<9>,
    /// J_chi, initial to reference.
    pub j_chi: Array<1>,
    /// H_chi, only where h is an independent unknown.
    pub h_chi: Option<Array<9>>,
    /// mu / 2 of the closure repair, only where it is redone for every reference.
    pub half_mu: Option<Array<3>>,
}

/// Reference configuration of a body.
#[derive(Debug)]
pub struct Reference {
    /// Storage layout of the body.
    pub layout: Layout,
    /// Neighbours.
    pub slices: Slices,
    /// X [m], initial.
    pub x_initial: Array<3>,
    /// V_R [m^3], initial; 0 in dummy slots, which keeps them out of every sum.
    pub volume: Array<1>,
    /// L_a [m^-2 over the unit of g], reference; row-major.
    pub l: Array<9>,
    /// Fields of the update, if the scene asks for updates.
    pub updated: Option<Updated>,
    /// Directed pairs.
    pub pairs: usize,
    /// Smallest and largest number of neighbours.
    pub neighbour_range: (usize, usize),
    /// What closes the operators, if they are repaired.
    closed: Option<ClosedOperators>,
    stored: Option<StoredVectors>,
    /// What sums over pairs in single precision read.
    single: Option<Single>,
    /// What gradients and forces are made of.
    pub operators: Operators,
    option: u8,
    weights: Weights,
    smoothing_factor: f64,
}

/// What makes the pair vectors of repaired operators.
#[derive(Debug)]
struct ClosedOperators {
    multipliers: Multipliers,
    /// k^ of the updated reference; without it, k of the initial one.
    weights: Option<Vec<Slots>>,
    /// A_R N [m^2], initial.
    surface: Array<3>,
    /// Root of the sum of the squares of V^(2/3) [m^2].
    scale: f64,
    /// The first repair.
    report: Repair,
}

#[inline(always)]
pub(crate) fn load3<T: Lane>(token: T::Token, from: &[&[impl Real]; 3], at: usize) -> Vec3<T> {
    [
        T::load(token, from[0], at),
        T::load(token, from[1], at),
        T::load(token, from[2], at),
    ]
}

#[inline(always)]
pub(crate) fn load9<T: Lane>(token: T::Token, from: &[&[impl Real]; 9], at: usize) -> Mat3<T> {
    let [a, b, c, d, e, f, g, h, i] = from;
    [
        load3(token, &[a, b, c], at),
        load3(token, &[d, e, f], at),
        load3(token, &[g, h, i], at),
    ]
}

#[inline(always)]
pub(crate) fn store3<T: Lane>(value: &Vec3<T>, to: &mut [&mut [impl Real]; 3], at: usize) {
    for (c, v) in value.iter().enumerate() {
        v.store(to[c], at);
    }
}

#[inline(always)]
pub(crate) fn store9<T: Lane>(value: &Mat3<T>, to: &mut [&mut [impl Real]; 9], at: usize) {
    for (r, row) in value.iter().enumerate() {
        for (c, v) in row.iter().enumerate() {
            v.store(to[3 * r + c], at);
        }
    }
}

/// A^-1 by the cofactor.
#[inline(always)]
pub(crate) fn inverse<T: Lane>(m: &Mat3<T>) -> Mat3<T> {
    let cof = cofactor(m);
    scale9(m[0][0].of(1.0) / dot(m[0], cof[0]), &transpose(&cof))
}

impl Reference {
    /// The reference of a body at rest: the initial configuration.
    ///
    /// # Errors
    /// [`Code::InvalidScene`](crate::Code::InvalidScene) naming a particle whose neighbours lie in a
    /// plane, or where the operators cannot be repaired.
    pub fn new(particles: &Particles, graph: &Graph, numerics: &Numerics) -> Result<Self> {
        let layout = Layout::new(particles.count());
        let operators = numerics.operators_on(matches!(particles.shape, Shape::Lattice(_)));
        let volumes = match operators {
            Operators::Repaired => evened_out(particles, graph),
            _ => particles.volumes.clone(),
        };
        let mut x_initial = Array::new(layout, [0.0; 3]);
        let mut volume = Array::new(layout, [0.0]);
        for i in 0..particles.count() {
            x_initial.set(Layout::slot(i), particles.positions[i]);
            volume.set(Layout::slot(i), [volumes[i]]);
        }
        let updated = (numerics.reference_update != ReferenceUpdate::Never).then(|| Updated {
            chi: x_initial.clone(),
            f_chi: Array::new(layout, flat(&IDENTITY)),
            j_chi: Array::new(layout, [1.0]),
            h_chi: (numerics.state == crate::scene::StateMeasures::Fhj)
                .then(|| Array::new(layout, flat(&IDENTITY))),
            half_mu: None,
        });
        let counts = (0..graph.count()).map(|i| graph.of(i).len());
        let mut this = Self {
            layout,
            slices: Slices::new(graph, layout),
            x_initial,
            volume,
            l: Array::new(layout, [0.0; 9]),
            updated,
            pairs: graph.pairs(),
            neighbour_range: (counts.clone().min().unwrap_or(0), counts.max().unwrap_or(0)),
            closed: None,
            stored: None,
            single: (numerics.precision == Precision::Single).then(|| Single::new(graph, layout)),
            operators,
            option: numerics.kernel_option,
            weights: numerics.weights,
            smoothing_factor: numerics.smoothing_factor,
        };
        this.initial_weights(particles, graph, &volumes);
        if operators == Operators::Mesh {
            this.stored = Some(this.of_mesh(particles)?);
        }
        let place = |slot: usize| {
            let i = slot - Layout::FIRST;
            (particles.caller(i), Some(particles.positions[i]))
        };
        if operators == Operators::Repaired {
            this.close(&particles.surface).map_err(|(message, slot)| {
                let error = Error::scene("geometry", message);
                match slot.map(place) {
                    Some((particle, position)) => error.at_particle(particle, position),
                    None => error,
                }
            })?;
        }
        if let Err(slot) = this.update() {
            let (particle, position) = place(slot);
            return Err(Error::scene(
                "numerics.neighbours",
                "the neighbours of a particle lie in a plane or on a line, so no gradient can be \
                 formed: widen the radius",
            )
            .at_particle(particle, position));
        }
        Ok(this)
    }

    /// k_ab of the initial configuration.
    fn initial_weights(&mut self, particles: &Particles, graph: &Graph, volumes: &[f64]) {
        let distance = |a: usize, b: u32| {
            let (x, y) = (particles.positions[a], particles.positions[b as usize]);
            (0..3).map(|i| (x[i] - y[i]).powi(2)).sum::<f64>().sqrt()
        };
        let h: Vec<f64> = parallel::fill(graph.count(), |a| {
            self.smoothing_factor
                * graph
                    .of(a)
                    .iter()
                    .map(|&b| distance(a, b))
                    .fold(0.0, f64::max)
        });
        // Lengths and volumes over their means: weights of order one in any unit system.
        let unit = h.iter().sum::<f64>() / h.len() as f64;
        let mean_volume = volumes.iter().sum::<f64>() / h.len() as f64;
        let weight = |a: usize, b: u32| {
            let r = distance(a, b) / unit;
            let (ha, hb) = (h[a] / unit, h[b as usize] / unit);
            match self.weights {
                Weights::Unit => 0.5 * (kernel::slope(r, ha) + kernel::slope(r, hb)),
                // V_b as printed; V_a, common to all pairs of a, makes the weight symmetric.
                Weights::Tributary => {
                    volumes[a] * volumes[b as usize] / (mean_volume * mean_volume)
                        * kernel::slope(r, hb)
                }
            }
        };
        let mut symmetric = true;
        for a in 0..graph.count() {
            for &b in graph.of(a) {
                let (k, back) = (weight(a, b), weight(b as usize, a as u32));
                symmetric &= k == back;
                if let Some(pair) = self.slices.pair(a, b as usize) {
                    self.slices.weights_mut()[pair] = k;
                }
            }
        }
        if !symmetric {
            let mut stored = StoredVectors::new(&self.slices);
            for a in 0..graph.count() {
                for &b in graph.of(a) {
                    let (k, back) = (weight(a, b), weight(b as usize, a as u32));
                    let r = sub3(particles.positions[b as usize], particles.positions[a]);
                    if let Some(pair) = self.slices.pair(a, b as usize) {
                        stored.add(pair, scale3(k, r), scale3(-back, r));
                    }
                }
            }
            self.stored = Some(stored);
        }
    }

    /// g_ab = C_ab = 2 int N_a grad N_b dV of the mesh.
    fn of_mesh(&self, particles: &Particles) -> Result<StoredVectors> {
        let Shape::Mesh(mesh) = &particles.shape else {
            return Err(Error::scene(
                "numerics.operators",
                "the particles form a lattice, not a mesh: leave this out, or give the box a jitter \
                 of 0",
            ));
        };
        let mut stored = StoredVectors::new(&self.slices);
        for cell in &mesh.cells {
            let c = Mesh::cell_operators(cell, &particles.positions);
            for (i, &a) in cell.nodes().iter().enumerate() {
                for (j, &b) in cell.nodes().iter().enumerate() {
                    if i == j {
                        continue;
                    }
                    let pair = self.slices.pair(a as usize, b as usize).ok_or_else(|| {
                        Error::scene(
                            "numerics.neighbours",
                            "the operators of the mesh need all particles that share a cell as \
                             neighbours: set 26",
                        )
                        .at_particle(
                            particles.caller(a as usize),
                            Some(particles.positions[a as usize]),
                        )
                    })?;
                    stored.add(pair, c[i][j], c[j][i]);
                }
            }
        }
        Ok(stored)
    }

    /// Repairs the operators of the initial configuration; a message, and the slot that it is about,
    /// where that fails.
    fn close(&mut self, surface: &[[f64; 3]]) -> std::result::Result<(), (String, Option<usize>)> {
        /// Share of the areas that a surface may be open by: round-off of coordinates in a file.
        const GAP: f64 = 1e-6;
        let mut area = Array::new(self.layout, [0.0; 3]);
        for (i, a) in surface.iter().enumerate() {
            area.set(Layout::slot(i), *a);
        }
        let (x, volume) = (self.x_initial.components(), self.volume.components()[0]);
        let gap = repair::close_surface(&mut area, x, volume);
        if gap.is_nan() || gap > GAP {
            return Err((
                format!(
                    "the surface of the body does not close: its areas and its volumes disagree by \
                     {gap:.2e} of an area, at most {GAP:.0e} is round-off; mesh the body again"
                ),
                None,
            ));
        }
        let squares = (0..self.layout.particles).map(|i| volume[Layout::slot(i)].powf(4.0 / 3.0));
        let scale = squares.sum::<f64>().sqrt();
        let goal = Goal {
            tolerance: AT_START.0,
            scale,
            iterations: AT_START.1,
            coarse: true,
        };
        let problem = Problem {
            layout: self.layout,
            slices: &self.slices,
            weights: self.slices.weights(),
            x,
            volume,
            area: &area,
        };
        let (multipliers, report) = repair::solve(problem, None, goal).map_err(|Flat(slot)| {
            let message = "the neighbours of a particle lie in a plane or on a line, so no gradient \
                           can be formed: widen numerics.neighbours";
            (message.to_string(), Some(slot))
        })?;
        if report.after.is_nan() || report.after > TOO_OPEN {
            let (slot, defect) = report.worst;
            return Err((
                format!(
                    "the operators cannot be repaired: after {} iterations a uniform stress still \
                     pushes this particle with {defect:.1e} of its area. Give it more neighbours \
                     (numerics.neighbours), or use numerics.operators \"mesh\"",
                    report.iterations
                ),
                Some(slot),
            ));
        }
        self.closed = Some(ClosedOperators {
            multipliers,
            weights: None,
            surface: area,
            scale,
            report,
        });
        Ok(())
    }

    /// What the repair of the operators took at the start, if they are repaired.
    pub fn repair(&self) -> Option<&Repair> {
        self.closed.as_ref().map(|c| &c.report)
    }

    /// Whether the stable step follows from the areas of the pairs too: all but kernels on a lattice.
    pub fn is_bound_by_areas(&self) -> bool {
        !matches!(self.pair_vectors(), Pairs::Lean(_))
    }

    /// The pair vectors now.
    pub fn pair_vectors(&self) -> Pairs<'_, f64> {
        if let Some(closed) = &self.closed {
            let (k, x) = match (&closed.weights, &self.updated) {
                (Some(k), Some(u)) => (bytemuck::must_cast_slice(k), u.chi.components()),
                _ => (self.slices.weights(), self.x_initial.components()),
            };
            return Pairs::Closed(Closed {
                k,
                x,
                half_mu: closed.multipliers.half_mu.components(),
                lambda: closed.multipliers.lambda.components(),
            });
        }
        match &self.stored {
            None => Pairs::Lean(Lean {
                k: self.slices.weights(),
                x: self.x_initial.components(),
            }),
            Some(s) => Pairs::Stored(s.get()),
        }
    }

    /// Slots of the neighbours of the particle in a slot.
    pub fn neighbours(&self, slot: usize) -> Box<dyn Iterator<Item = usize> + '_> {
        match &self.single {
            Some(single) => Box::new(single.slices.neighbours(slot)),
            None => Box::new(self.slices.neighbours(slot)),
        }
    }

    /// Gives up what sums over pairs in double precision read, once nothing will read it any more.
    pub fn forget_double(&mut self) {
        self.slices = Slices::empty();
        self.l = Array::empty();
    }

    /// Computes everything that follows from new fields of [`Updated`], for the scene's kernel option.
    ///
    /// # Errors
    /// The slot of a particle whose gradient cannot be corrected any more.
    pub fn update(&mut self) -> std::result::Result<(), usize> {
        self.follow(true)
    }

    /// The same for fields that [`update`](Self::update) has seen before: the repair's multipliers
    /// are among them.
    ///
    /// # Errors
    /// As [`update`](Self::update).
    pub fn rebuild(&mut self) -> std::result::Result<(), usize> {
        self.follow(false)
    }

    fn follow(&mut self, solve: bool) -> std::result::Result<(), usize> {
        if self.option >= 3 && self.updated.is_some() {
            if self.closed.is_some() {
                self.close_again(solve)?;
            } else {
                self.updated_vectors();
            }
        }
        let bad = self.correct();
        if let Some(mut single) = self.single.take() {
            single.round(f64::pairs(self), self.layout);
            self.single = Some(single);
        }
        bad.map_or(Ok(()), Err)
    }

    /// Repairs the operators of an updated reference, from the multipliers of the one before, with
    /// k^, H A_R N_R and J V_R.
    fn close_again(&mut self, solve: bool) -> std::result::Result<(), usize> {
        let (Some(updated), Some(closed)) = (&self.updated, &self.closed) else {
            return Ok(());
        };
        let layout = self.layout;
        let mut weights = vec![Slots([0.0; SLICE]); self.slices.entries()];
        let (h, unit) = self.smoothing_lengths();
        let kernels = self.kernels(h.components()[0], unit);
        let pieces = self.slices.split(layout, vec![&mut weights]);
        parallel::map_slabs(pieces, |slab, mut out| {
            vectorised(PulledBackWeights {
                kernels,
                slab,
                out: out.pop().expect("one piece a slab"),
            });
        });
        let mut volume = self.volume.clone();
        for (v, j) in volume.flat_mut().iter_mut().zip(updated.j_chi.flat()) {
            *v *= j;
        }
        let mut area = closed.surface.clone();
        for slot in (0..layout.particles).map(Layout::slot) {
            let initial = area.get(slot);
            if initial != [0.0; 3] {
                let h = match &updated.h_chi {
                    Some(h) => rows(h.get(slot)),
                    None => cofactor(&rows(updated.f_chi.get(slot))),
                };
                area.set(slot, mat_vec(&h, initial));
            }
        }
        let (x, volume) = (updated.chi.components(), volume.components()[0]);
        repair::close_surface(&mut area, x, volume);
        let problem = Problem {
            layout,
            slices: &self.slices,
            weights: bytemuck::must_cast_slice(&weights),
            x,
            volume,
            area: &area,
        };
        let guess = updated.half_mu.clone();
        let multipliers = if solve {
            let goal = Goal {
                tolerance: AT_UPDATES.0,
                scale: closed.scale,
                iterations: AT_UPDATES.1,
                coarse: false,
            };
            repair::solve(problem, guess, goal).map(|s| s.0)
        } else {
            repair::multipliers(problem, guess.expect("solved for by an update"))
        };
        let multipliers = multipliers.map_err(|Flat(slot)| slot)?;
        if let (Some(updated), Some(closed)) = (&mut self.updated, &mut self.closed) {
            updated.half_mu = Some(multipliers.half_mu.clone());
            closed.multipliers = multipliers;
            closed.weights = Some(weights);
        }
        Ok(())
    }

    /// L_a for the present pair vectors; the slot of the first particle where it does not exist.
    fn correct(&mut self) -> Option<usize> {
        let mut l = std::mem::replace(&mut self.l, Array::empty());
        let this = &*self;
        let updated = this.updated.as_ref();
        let points = match updated {
            Some(u) if this.option > 1 => u.chi.components(),
            _ => this.x_initial.components(),
        };
        // Repaired options #3 and #4 are complete in the reference as they are.
        let with_f_chi = this.option < 3 || (this.option == 3 && this.closed.is_none());
        let f_chi = updated.filter(|_| with_f_chi).map(|u| u.f_chi.components());
        let bad = parallel::map_slabs(
            l.slabs_mut(),
            |slab, out| with_pairs!(this.pair_vectors(), pairs => vectorised(Correct { pairs, this, points, f_chi, slab, out })),
        );
        self.l = l;
        bad.into_iter().flatten().next()
    }

    /// h^ of an updated reference (47) and its mean.
    fn smoothing_lengths(&self) -> (Array<1>, f64) {
        let updated = self.updated.as_ref().expect("an updated reference");
        let (chi, f_chi) = (updated.chi.components(), updated.f_chi.components());
        let mut h = Array::<1>::new(self.layout, [1.0]);
        parallel::map_slabs(h.slabs_mut(), |slab, [out]| {
            vectorised(SmoothingLength {
                this: self,
                chi,
                f_chi,
                slab,
                out,
            });
        });
        let mean = self.mean(h.components()[0]);
        (h, mean)
    }

    fn kernels<'a>(&'a self, h: &'a [f64], unit: f64) -> Kernels<'a> {
        let updated = self.updated.as_ref().expect("an updated reference");
        Kernels {
            this: self,
            chi: updated.chi.components(),
            f_chi: updated.f_chi.components(),
            h,
            unit,
        }
    }

    fn mean(&self, values: &[f64]) -> f64 {
        let values = &values[Layout::FIRST..Layout::FIRST + self.layout.particles];
        values.iter().sum::<f64>() / self.layout.particles as f64
    }

    /// g_ab of options #3 and #4 from chi and F_chi.
    fn updated_vectors(&mut self) {
        let updated = self.updated.as_ref().expect("an updated reference");
        let j_chi = updated.j_chi.components()[0];
        let (h, unit) = self.smoothing_lengths();
        let kernels = self.kernels(h.components()[0], unit);
        let mean_volume = self.mean(self.volume.components()[0]);
        let mut stored = StoredVectors::new(&self.slices);
        let pieces = stored.slabs_mut(&self.slices, self.layout);
        parallel::map_slabs(pieces, |slab, out| {
            vectorised(PulledBackVectors {
                kernels,
                j_chi,
                mean_volume,
                slab,
                out,
            });
        });
        self.stored = Some(stored);
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        let updated = self.updated.as_ref().map_or(0, |u| {
            u.chi.bytes()
                + u.f_chi.bytes()
                + u.j_chi.bytes()
                + u.h_chi.as_ref().map_or(0, Array::bytes)
                + u.half_mu.as_ref().map_or(0, Array::bytes)
        });
        let closed = self.closed.as_ref().map_or(0, |c| {
            c.multipliers.half_mu.bytes()
                + c.multipliers.lambda.bytes()
                + c.surface.bytes()
                + c.weights
                    .as_ref()
                    .map_or(0, |w| std::mem::size_of_val(&w[..]))
        });
        self.slices.bytes()
            + self.x_initial.bytes()
            + self.volume.bytes()
            + self.l.bytes()
            + updated
            + closed
            + self.single.as_ref().map_or(0, Single::bytes)
            + self.stored.as_ref().map_or(0, StoredVectors::bytes)
    }
}

/// What sums over pairs read of a reference.
pub(crate) struct PairData<'a, E: Real> {
    /// Neighbours.
    pub slices: &'a Slices<E>,
    /// The pair vectors now.
    pub vectors: Pairs<'a, E>,
    /// L_a.
    pub l: [&'a [E]; 9],
}

/// A precision in which sums over pairs run.
pub(crate) trait ReferenceReal: Real {
    /// What they read.
    fn pairs(reference: &Reference) -> PairData<'_, Self>;
}

impl ReferenceReal for f64 {
    fn pairs(reference: &Reference) -> PairData<'_, f64> {
        PairData {
            slices: &reference.slices,
            vectors: reference.pair_vectors(),
            l: reference.l.components(),
        }
    }
}

impl ReferenceReal for f32 {
    fn pairs(reference: &Reference) -> PairData<'_, f32> {
        let single = reference.single.as_ref();
        single.expect("made for single precision").pairs()
    }
}

/// Evens out the volumes over the solid angles that they fill, by exchange between neighbours: small
/// volumes next to large pseudo-areas make the dissipation unstable. Equal cells keep their volumes,
/// on the surface too, where shares of the volumes themselves would move mass outwards.
fn evened_out(particles: &Particles, graph: &Graph) -> Vec<f64> {
    let Shape::Mesh(mesh) = &particles.shape else {
        return particles.volumes.clone();
    };
    let angles = mesh.solid_angles(&particles.positions);
    let share = |a: usize| 0.5 * angles[a] / graph.of(a).len() as f64;
    parallel::fill(particles.count(), |a| {
        let density = |a: usize| particles.volumes[a] / angles[a];
        let from = |&b: &u32| {
            let b = b as usize;
            share(a).min(share(b)) * (density(b) - density(a))
        };
        particles.volumes[a] + graph.of(a).iter().map(from).sum::<f64>()
    })
}

fn rows(m: [f64; 9]) -> Mat3<f64> {
    let [a, b, c, d, e, f, g, h, i] = m;
    [[a, b, c], [d, e, f], [g, h, i]]
}

/// L_a of a slab.
struct Correct<'a, P> {
    pairs: P,
    this: &'a Reference,
    points: [&'a [f64]; 3],
    f_chi: Option<[&'a [f64]; 9]>,
    slab: usize,
    out: [&'a mut [f64]; 9],
}

impl<P: PairVectors> Work for Correct<'_, P> {
    type Output = Option<usize>;
    #[inline(always)]
    fn run<T: Lane>(mut self, token: T::Token) -> Option<usize> {
        let (first, slots) = self.this.layout.slab_range(self.slab);
        let mut bad = None;
        for at in (0..slots).step_by(T::WIDTH) {
            let a = first + at;
            let f = match &self.f_chi {
                Some(f_chi) => load9(token, f_chi, a),
                None => identity::<T>(token),
            };
            let cof = cofactor(&f);
            let f_inverse_t = scale9(T::splat(token, 1.0) / dot(f[0], cof[0]), &cof);
            let (xa, centre) = (
                load3(token, &self.points, a),
                self.pairs.centre::<T>(token, a),
            );
            let mut moment = [zero3(token); 3];
            for (b, pair) in self.this.slices.of(a) {
                let (g, _) = self.pairs.pair(token, &centre, b, pair);
                moment = add_outer(&moment, g, sub3(load3(token, &self.points, b), xa));
            }
            let l = if self.this.option == 1 {
                mat_mul(&f_inverse_t, &inverse(&moment))
            } else {
                mat_mul(&inverse(&mat_mul(&f_inverse_t, &moment)), &f_inverse_t)
            };
            store9(&l, &mut self.out, at);
            // Row-major moments of the lanes, for the check and for dummies.
            let mut moments = [[0.0; 9]; SLICE];
            for (c, m) in moment.iter().flatten().enumerate() {
                m.for_lanes(|lane, value| moments[lane][c] = value);
            }
            for (lane, moment) in moments[..T::WIDTH].iter().enumerate() {
                if a + lane >= Layout::slot(self.this.layout.particles) {
                    // A dummy has no pairs: any finite L serves.
                    for row in &mut self.out {
                        row[at + lane] = 0.0;
                    }
                } else if bad.is_none() && !is_regular(moment) {
                    bad = Some(a + lane);
                }
            }
        }
        bad
    }
}

/// Whether a moment matrix can be inverted: its determinant over that of a ball.
fn is_regular(moment: &[f64; 9]) -> bool {
    let m = nalgebra::Matrix3::from_row_slice(moment);
    let scale = m.norm();
    scale.is_finite() && (m.determinant() / scale.powi(3)).abs() > 1e-9
}
