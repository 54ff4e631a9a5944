//! The closure repair: the smallest change of the pseudo-areas that makes a uniform stress
//! force-free inside a body of irregular particles and balances its traction on the surface.
//!
//! A gradient is linearly complete and the forces of a uniform stress are closed if ([URL22] 42, 58)
//!
//! - sum_b C_ab (x) r_ab = 2 V_a I, r_ab = x_b - x_a,
//! - 1/2 sum_b (C_ab - C_ba) = -(A N)_a, zero inside and the tributary vector area on the surface.
//!
//! The smallest change dC of the kernel's own C_ab = w_ab B_a r_ab, w_ab = w_ba > 0, in the norm
//! sum_ab |dC_ab|^2 / w_ab, has multipliers Lambda_a and mu_a with
//!
//! - C_ab + dC_ab = w_ab [Lambda_a r_ab + (mu_a - mu_b)/2],
//! - Lambda_a = B_a + grad mu_a / 2, B_a = 2 V_a M_a^-1, M_a = sum_b w_ab r_ab (x) r_ab,
//!   grad mu_a = sum_b w_ab (mu_b - mu_a) (x) r_ab M_a^-1,
//! - 1/2 sum_b w_ab [mu_a - mu_b + (grad mu_a + grad mu_b) r_ab / 2]
//!   = -(A N)_a - 1/2 sum_b w_ab (B_a + B_b) r_ab.
//!
//! The last is one symmetric positive semi-definite system for each component of mu, with the affine
//! fields as its kernel; it has a solution iff sum A N = 0 and sum A N (x) x = (sum V) I, which
//! [`close_surface`] sees to. Linear completeness holds to round-off whatever mu is, and 12 numbers a
//! particle hold all of the repair.

use std::time::{Duration, Instant};

use super::coarse::Levels;
use super::slices::Slices;
use super::{inverse, is_regular, load3, load9, store3, store9};
use crate::lane::{Lane, PerSlot, SLICE, Work, vectorised};
use crate::layout::{Array, Layout};
use crate::math::*;
use crate::parallel;

/// What is repaired.
#[derive(Clone, Copy)]
pub struct Problem<'a> {
    /// Shape of all arrays.
    pub layout: Layout,
    /// Neighbours.
    pub slices: &'a Slices,
    /// w_ab by pair; 0 where a lane has no neighbour.
    pub weights: &'a [f64],
    /// x [m], in the configuration of the operators.
    pub x: [&'a [f64]; 3],
    /// V [m^3], there.
    pub volume: &'a [f64],
    /// A N [m^2], there.
    pub area: &'a Array<3>,
}

/// When to stop.
#[derive(Debug, Clone, Copy)]
pub struct Goal {
    /// Root mean square of the closure's defect, over that of the particles' areas.
    pub tolerance: f64,
    /// Root of the sum of the squares of those areas, V^(2/3) [m^2].
    pub scale: f64,
    /// Most iterations.
    pub iterations: usize,
    /// Whether coarse levels precondition: worth their set-up where the guess is far off.
    pub coarse: bool,
}

/// mu and Lambda.
#[derive(Debug, Clone, PartialEq)]
pub struct Multipliers {
    /// mu / 2 [the unit of C over that of w].
    pub half_mu: Array<3>,
    /// Lambda [the unit of C over that of w r].
    pub lambda: Array<9>,
}

/// What a repair took and what it left.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Repair {
    /// Iterations of the conjugate gradients.
    pub iterations: usize,
    /// Root mean square of the closure's defect over that of the particles' areas V^(2/3), before.
    pub before: f64,
    /// The same, after.
    pub after: f64,
    /// Slot of the particle with the largest defect, after, and the defect over its V^(2/3).
    pub(crate) worst: (usize, f64),
    /// Root mean square of the changes of the pseudo-areas over that of the pseudo-areas.
    pub size: f64,
    /// Time.
    pub time: Duration,
}

/// There is no repair: the neighbours of the particle in this slot lie in a plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Flat(pub usize);

/// Arrays of the linear system.
struct System<'a> {
    problem: Problem<'a>,
    /// M^-1.
    inverse: Array<9>,
    /// B.
    base: Array<9>,
    /// Right-hand side [m^2].
    rhs: Array<3>,
    /// Inverse of the diagonal; 0 in dummies.
    jacobi: Array<1>,
    /// Gradient of the vector that the operator was last applied to.
    gradient: Array<9>,
    /// Coarse levels, and what they make of the residual.
    coarse: Option<(Levels<'a>, Array<3>)>,
}

/// Solves for the multipliers, from a guess of mu / 2 if there is one.
///
/// # Errors
/// [`Flat`]. That the goal was not reached is no error: the report tells.
pub fn solve(
    problem: Problem,
    guess: Option<Array<3>>,
    goal: Goal,
) -> Result<(Multipliers, Repair), Flat> {
    let began = Instant::now();
    let layout = problem.layout;
    let mut system = System::new(problem)?;
    if goal.coarse {
        let levels = Levels::new(&problem);
        system.coarse = levels.map(|levels| (levels, Array::new(layout, [0.0; 3])));
    }
    let guessed = guess.is_some();
    let mut mu = guess.unwrap_or_else(|| Array::new(layout, [0.0; 3]));
    let mut residual = system.residual(&mu);
    let mut direction = Array::new(layout, [0.0; 3]);
    let mut product = Array::new(layout, [0.0; 3]);
    let mut report = Repair {
        before: norm(system.dots(&system.rhs)) / goal.scale,
        ..Repair::default()
    };
    // One system per component: each has its own step and stops on its own.
    let mut weighted = system.update(&mut mu, &mut residual, &direction, &product, [0.0; 3]);
    let mut beta = [0.0; 3];
    let limit2 = goal.tolerance * goal.tolerance * goal.scale * goal.scale;
    loop {
        let left = weighted.1;
        report.after = norm(left) / goal.scale;
        // A NaN ends it too.
        let open = left.iter().sum::<f64>() > limit2;
        if !open || report.iterations == goal.iterations {
            break;
        }
        system.direct(&mut direction, &residual, beta);
        let curvature = system.apply(&direction, &mut product);
        let alpha = std::array::from_fn(|c| {
            if curvature[c] > 0.0 {
                weighted.0[c] / curvature[c]
            } else {
                0.0
            }
        });
        let before = weighted.0;
        weighted = system.update(&mut mu, &mut residual, &direction, &product, alpha);
        beta = std::array::from_fn(|c| {
            if before[c] > 0.0 {
                weighted.0[c] / before[c]
            } else {
                0.0
            }
        });
        report.iterations += 1;
    }
    if report.after > report.before && !guessed {
        // Without a repair, where more than affine fields cost nothing, the iterations run away.
        mu.fill(0.0);
        residual.copy_from(&system.rhs);
        report.after = report.before;
    }
    report.worst = system.worst(&residual);
    let multipliers = system.multipliers(mu);
    report.size = system.size(&multipliers);
    report.time = began.elapsed();
    Ok((multipliers, report))
}

/// The multipliers for a mu / 2 that was solved for before.
///
/// # Errors
/// [`Flat`].
pub fn multipliers(problem: Problem, half_mu: Array<3>) -> Result<Multipliers, Flat> {
    Ok(System::new(problem)?.multipliers(half_mu))
}

/// Adds an affine field, weighted by the areas, to the vector areas of the surface so that they close
/// and agree with the volume: sum A N = 0, sum A N (x) x = (sum V) I. Returns the root mean square of
/// what it added over that of the areas: round-off for a surface that closes.
pub fn close_surface(area: &mut Array<3>, x: [&[f64]; 3], volume: &[f64]) -> f64 {
    let layout = area.layout();
    let slots = || (0..layout.particles).map(Layout::slot);
    let place = |a: usize| [x[0][a], x[1][a], x[2][a]];
    let size = |n: [f64; 3]| dot(n, n).sqrt();
    let (mut total, mut centre, mut squares) = (0.0, [0.0; 3], 0.0);
    for a in slots() {
        let n = area.get(a);
        total += size(n);
        squares += dot(n, n);
        centre = axpy3(centre, size(n), place(a));
    }
    let centre = scale3(1.0 / total, centre);
    let (mut gap, mut second, mut moment) = ([0.0; 3], [[0.0; 3]; 3], [[0.0; 3]; 3]);
    for a in slots() {
        let (n, r) = (area.get(a), sub3(place(a), centre));
        gap = sub3(gap, n);
        second = add_outer(&second, scale3(size(n), r), r);
        moment = add_outer(&moment, scale3(-1.0, n), r);
        for c in 0..3 {
            moment[c][c] += volume[a];
        }
    }
    let shift = scale3(1.0 / total, gap);
    let slope = mat_mul(&moment, &inverse(&second));
    let mut added = 0.0;
    for a in slots() {
        let (n, r) = (area.get(a), sub3(place(a), centre));
        if n == [0.0; 3] {
            continue;
        }
        let extra = scale3(size(n), add3(shift, mat_vec(&slope, r)));
        added += dot(extra, extra);
        area.set(a, add3(n, extra));
    }
    (added / squares).sqrt()
}

fn norm(squares: [f64; 3]) -> f64 {
    squares.iter().sum::<f64>().sqrt()
}

/// Adds up triples of partial sums in the order of the slabs.
fn total<const N: usize>(parts: Vec<[f64; N]>) -> [f64; N] {
    let mut sum = [0.0; N];
    for part in parts {
        for (s, p) in sum.iter_mut().zip(part) {
            *s += p;
        }
    }
    sum
}

impl<'a> System<'a> {
    fn new(problem: Problem<'a>) -> Result<Self, Flat> {
        let layout = problem.layout;
        let mut this = Self {
            problem,
            inverse: Array::new(layout, [0.0; 9]),
            base: Array::new(layout, [0.0; 9]),
            rhs: Array::new(layout, [0.0; 3]),
            jacobi: Array::new(layout, [0.0]),
            gradient: Array::new(layout, [0.0; 9]),
            coarse: None,
        };
        let slabs = this.inverse.slabs_mut().into_iter();
        let slabs = slabs.zip(this.base.slabs_mut()).collect();
        let flat = parallel::map_slabs(slabs, |slab, (inverse, base)| {
            vectorised(Moments {
                problem,
                slab,
                inverse,
                base,
            })
        });
        if let Some(slot) = flat.into_iter().flatten().next() {
            return Err(Flat(slot));
        }
        let (inverse, base) = (this.inverse.components(), this.base.components());
        let slabs = this.rhs.slabs_mut().into_iter();
        let slabs = slabs.zip(this.jacobi.slabs_mut()).collect();
        parallel::map_slabs(slabs, |slab, (rhs, [jacobi])| {
            vectorised(RightHandSide {
                problem,
                inverse,
                base,
                slab,
                rhs,
                jacobi,
            });
        });
        Ok(this)
    }

    /// Gradient of a vector, then the operator on it; the products of both by component.
    fn apply(&mut self, vector: &Array<3>, product: &mut Array<3>) -> [f64; 3] {
        let problem = self.problem;
        let (inverse, vector) = (self.inverse.components(), vector.components());
        parallel::map_slabs(self.gradient.slabs_mut(), |slab, out| {
            vectorised(Gradient {
                problem,
                inverse,
                vector,
                slab,
                out,
            });
        });
        let gradient = self.gradient.components();
        total(parallel::map_slabs(product.slabs_mut(), |slab, out| {
            vectorised(Apply {
                problem,
                gradient,
                vector,
                slab,
                out,
            })
        }))
    }

    /// b - A (2 mu / 2).
    fn residual(&mut self, half_mu: &Array<3>) -> Array<3> {
        let mut product = Array::new(self.problem.layout, [0.0; 3]);
        self.apply(half_mu, &mut product);
        for (p, b) in product.flat_mut().iter_mut().zip(self.rhs.flat()) {
            *p = b - *p;
        }
        product
    }

    /// mu += alpha p, r -= alpha q; (r M^-1 r, r r) by component.
    fn update(
        &mut self,
        mu: &mut Array<3>,
        residual: &mut Array<3>,
        direction: &Array<3>,
        product: &Array<3>,
        alpha: [f64; 3],
    ) -> ([f64; 3], [f64; 3]) {
        let (direction, product) = (direction.components(), product.components());
        let jacobi = self.jacobi.components()[0];
        let layout = self.problem.layout;
        let slabs = mu.slabs_mut().into_iter().zip(residual.slabs_mut());
        let sums = parallel::map_slabs(slabs.collect(), |slab, (mu, residual)| {
            let first = layout.slab_range(slab).0;
            vectorised(Update {
                first,
                alpha,
                direction,
                product,
                jacobi,
                mu,
                residual,
            })
        });
        let [a, b, c, d, e, f] = total(sums);
        let mut weighted = [a, b, c];
        if let Some((levels, correction)) = &mut self.coarse {
            weighted = add3(weighted, levels.correct(residual, correction));
        }
        (weighted, [d, e, f])
    }

    /// p = M^-1 r + beta p.
    fn direct(&self, direction: &mut Array<3>, residual: &Array<3>, beta: [f64; 3]) {
        let (residual, jacobi) = (residual.components(), self.jacobi.components()[0]);
        let correction = self.coarse.as_ref().map(|(_, c)| c.components());
        let layout = self.problem.layout;
        parallel::map_slabs(direction.slabs_mut(), |slab, direction| {
            let first = layout.slab_range(slab).0;
            vectorised(Direct {
                first,
                beta,
                residual,
                jacobi,
                correction,
                direction,
            });
        });
    }

    fn dots(&self, vector: &Array<3>) -> [f64; 3] {
        let layout = self.problem.layout;
        vector.components().map(|values| {
            let values = &values[Layout::FIRST..Layout::FIRST + layout.particles];
            values.iter().map(|v| v * v).sum()
        })
    }

    /// Slot and size of the largest defect.
    fn worst(&self, residual: &Array<3>) -> (usize, f64) {
        let slots = (0..self.problem.layout.particles).map(Layout::slot);
        let defect = |slot: usize| {
            let r = residual.get(slot);
            dot(r, r).sqrt() / self.problem.volume[slot].powf(2.0 / 3.0)
        };
        slots
            .map(|slot| (slot, defect(slot)))
            .max_by(|a, b| a.1.total_cmp(&b.1))
            .expect("a body has particles")
    }

    fn multipliers(&mut self, half_mu: Array<3>) -> Multipliers {
        let problem = self.problem;
        let mut lambda = Array::new(problem.layout, [0.0; 9]);
        let (inverse, base) = (self.inverse.components(), self.base.components());
        let vector = half_mu.components();
        parallel::map_slabs(lambda.slabs_mut(), |slab, mut out| {
            let (first, slots) = problem.layout.slab_range(slab);
            vectorised(Gradient {
                problem,
                inverse,
                vector,
                slab,
                out: out.each_mut().map(|o| &mut **o),
            });
            for (out, base) in out.iter_mut().zip(base) {
                for (o, b) in out.iter_mut().zip(&base[first..first + slots]) {
                    *o += b;
                }
            }
        });
        Multipliers { half_mu, lambda }
    }

    /// Root mean square of the changes over that of the pseudo-areas; from C = 0, of the changes to
    /// the kernel's.
    fn size(&self, multipliers: &Multipliers) -> f64 {
        let problem = self.problem;
        let base = self.base.components();
        let parts = parallel::map_slabs((0..problem.layout.slabs()).collect(), |slab, _: usize| {
            vectorised(Size {
                problem,
                base,
                half_mu: multipliers.half_mu.components(),
                lambda: multipliers.lambda.components(),
                slab,
            })
        });
        let [change, before] = total(parts);
        (change / before).sqrt()
    }
}

/// Slots of a slab as (offset in the slab, slot), by lanes.
#[inline(always)]
fn lanes_of<T: Lane>(layout: Layout, slab: usize) -> impl Iterator<Item = (usize, usize)> {
    let (first, slots) = layout.slab_range(slab);
    std::iter::zip((0..slots).step_by(T::WIDTH), (first..).step_by(T::WIDTH))
}

/// M^-1 and B of a slab; the first slot whose M is singular.
struct Moments<'a> {
    problem: Problem<'a>,
    slab: usize,
    inverse: [&'a mut [f64]; 9],
    base: [&'a mut [f64]; 9],
}

impl Work for Moments<'_> {
    type Output = Option<usize>;
    #[inline(always)]
    fn run<T: Lane>(mut self, token: T::Token) -> Option<usize> {
        let Problem {
            layout,
            slices,
            weights,
            x,
            volume,
            ..
        } = self.problem;
        let mut bad = None;
        for (at, a) in lanes_of::<T>(layout, self.slab) {
            let xa = load3::<T>(token, &x, a);
            let twice = T::splat(token, 2.0) * T::load(token, volume, a);
            let mut moment = [zero3(token); 3];
            for (b, pair) in slices.of(a) {
                let r = sub3(load3(token, &x, b), xa);
                let w = T::load(token, weights, pair);
                moment = add_outer(&moment, scale3(w, r), r);
            }
            let inverse = inverse(&moment);
            store9(&inverse, &mut self.inverse, at);
            store9(&scale9(twice, &inverse), &mut self.base, at);
            let mut moments = [[0.0; 9]; SLICE];
            for (c, m) in moment.iter().flatten().enumerate() {
                m.for_lanes(|lane, value| moments[lane][c] = value);
            }
            for (lane, moment) in moments[..T::WIDTH].iter().enumerate() {
                if a + lane >= Layout::slot(layout.particles) {
                    // A dummy has no pairs.
                    for row in self.inverse.iter_mut().chain(&mut self.base) {
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

/// Right-hand side and inverse of the diagonal of a slab.
struct RightHandSide<'a> {
    problem: Problem<'a>,
    inverse: [&'a [f64]; 9],
    base: [&'a [f64]; 9],
    slab: usize,
    rhs: [&'a mut [f64]; 3],
    jacobi: &'a mut [f64],
}

impl Work for RightHandSide<'_> {
    type Output = ();
    #[inline(always)]
    fn run<T: Lane>(mut self, token: T::Token) {
        let Problem {
            layout,
            slices,
            weights,
            x,
            area,
            ..
        } = self.problem;
        let area = area.components();
        let (half, one, zero) = (
            T::splat(token, 0.5),
            T::splat(token, 1.0),
            T::splat(token, 0.0),
        );
        for (at, a) in lanes_of::<T>(layout, self.slab) {
            let xa = load3::<T>(token, &x, a);
            let base = load9::<T>(token, &self.base, a);
            let mut sum = zero3::<T>(token);
            let (mut degree, mut first, mut others) = (zero, zero3(token), zero);
            for (b, pair) in slices.of(a) {
                let r = sub3(load3(token, &x, b), xa);
                let w = T::load(token, weights, pair);
                let wr = scale3(w, r);
                sum = add3(sum, mat_vec(&add9(&base, &load9(token, &self.base, b)), wr));
                degree = degree + w;
                first = add3(first, wr);
                others = others + dot(wr, mat_vec(&load9(token, &self.inverse, b), wr));
            }
            let area = load3::<T>(token, &area, a);
            let rhs = axpy3([-area[0], -area[1], -area[2]], -half, sum);
            store3(&rhs, &mut self.rhs, at);
            let own = dot(first, mat_vec(&load9(token, &self.inverse, a), first));
            // The unknown is mu / 2: twice the coefficient of mu.
            let diagonal = degree - half * (own + others);
            diagonal
                .if_positive(one / diagonal, zero)
                .store(self.jacobi, at);
        }
    }
}

/// sum_b w (v_b - v_a) (x) r M^-1 of a slab.
struct Gradient<'a, 'o> {
    problem: Problem<'a>,
    inverse: [&'a [f64]; 9],
    vector: [&'a [f64]; 3],
    slab: usize,
    out: [&'o mut [f64]; 9],
}

impl Work for Gradient<'_, '_> {
    type Output = ();
    #[inline(always)]
    fn run<T: Lane>(mut self, token: T::Token) {
        let Problem {
            layout,
            slices,
            weights,
            x,
            ..
        } = self.problem;
        for (at, a) in lanes_of::<T>(layout, self.slab) {
            let (xa, own) = (load3::<T>(token, &x, a), load3::<T>(token, &self.vector, a));
            let mut sum = [zero3(token); 3];
            for (b, pair) in slices.of(a) {
                let r = sub3(load3(token, &x, b), xa);
                let w = T::load(token, weights, pair);
                let difference = sub3(load3(token, &self.vector, b), own);
                sum = add_outer(&sum, difference, scale3(w, r));
            }
            let gradient = mat_mul(&sum, &load9(token, &self.inverse, a));
            store9(&gradient, &mut self.out, at);
        }
    }
}

/// The operator on a vector, mu / 2, of a slab; the products of both by component.
struct Apply<'a> {
    problem: Problem<'a>,
    gradient: [&'a [f64]; 9],
    vector: [&'a [f64]; 3],
    slab: usize,
    out: [&'a mut [f64]; 3],
}

impl Work for Apply<'_> {
    type Output = [f64; 3];
    #[inline(always)]
    fn run<T: Lane>(mut self, token: T::Token) -> [f64; 3] {
        let Problem {
            layout,
            slices,
            weights,
            x,
            ..
        } = self.problem;
        let half = T::splat(token, 0.5);
        let mut products = [PerSlot::new(0.0); 3];
        for (at, a) in lanes_of::<T>(layout, self.slab) {
            let (xa, own) = (load3::<T>(token, &x, a), load3::<T>(token, &self.vector, a));
            let gradient = load9::<T>(token, &self.gradient, a);
            let mut sum = zero3(token);
            for (b, pair) in slices.of(a) {
                let r = sub3(load3(token, &x, b), xa);
                let w = T::load(token, weights, pair);
                let difference = sub3(own, load3(token, &self.vector, b));
                let slope = mat_vec(&add9(&gradient, &load9(token, &self.gradient, b)), r);
                sum = axpy3(sum, w, axpy3(difference, half, slope));
            }
            store3(&sum, &mut self.out, at);
            for c in 0..3 {
                products[c].add(at, sum[c] * own[c]);
            }
        }
        products.map(|p| p.sum())
    }
}

/// One step of the conjugate gradients in a slab.
struct Update<'a> {
    first: usize,
    alpha: [f64; 3],
    direction: [&'a [f64]; 3],
    product: [&'a [f64]; 3],
    jacobi: &'a [f64],
    mu: [&'a mut [f64]; 3],
    residual: [&'a mut [f64]; 3],
}

impl Work for Update<'_> {
    type Output = [f64; 6];
    #[inline(always)]
    fn run<T: Lane>(self, token: T::Token) -> [f64; 6] {
        let mut sums = [PerSlot::new(0.0); 6];
        for c in 0..3 {
            let alpha = T::splat(token, self.alpha[c]);
            for at in (0..self.mu[c].len()).step_by(T::WIDTH) {
                let a = self.first + at;
                let mu = T::load(token, self.mu[c], at);
                let residual = T::load(token, self.residual[c], at);
                let residual = (-alpha).mul_add(T::load(token, self.product[c], a), residual);
                alpha
                    .mul_add(T::load(token, self.direction[c], a), mu)
                    .store(self.mu[c], at);
                residual.store(self.residual[c], at);
                let square = residual * residual;
                sums[c].add(at, square * T::load(token, self.jacobi, a));
                sums[3 + c].add(at, square);
            }
        }
        sums.map(|s| s.sum())
    }
}

/// The next direction in a slab.
struct Direct<'a> {
    first: usize,
    beta: [f64; 3],
    residual: [&'a [f64]; 3],
    jacobi: &'a [f64],
    correction: Option<[&'a [f64]; 3]>,
    direction: [&'a mut [f64]; 3],
}

impl Work for Direct<'_> {
    type Output = ();
    #[inline(always)]
    fn run<T: Lane>(self, token: T::Token) {
        for c in 0..3 {
            let beta = T::splat(token, self.beta[c]);
            for at in (0..self.direction[c].len()).step_by(T::WIDTH) {
                let a = self.first + at;
                let mut preconditioned =
                    T::load(token, self.residual[c], a) * T::load(token, self.jacobi, a);
                if let Some(correction) = &self.correction {
                    preconditioned = preconditioned + T::load(token, correction[c], a);
                }
                beta.mul_add(T::load(token, self.direction[c], at), preconditioned)
                    .store(self.direction[c], at);
            }
        }
    }
}

/// Sums of the squares of the changes and of what was changed, in a slab.
struct Size<'a> {
    problem: Problem<'a>,
    base: [&'a [f64]; 9],
    half_mu: [&'a [f64]; 3],
    lambda: [&'a [f64]; 9],
    slab: usize,
}

impl Work for Size<'_> {
    type Output = [f64; 2];
    #[inline(always)]
    fn run<T: Lane>(self, token: T::Token) -> [f64; 2] {
        let Problem {
            layout,
            slices,
            weights,
            x,
            ..
        } = self.problem;
        let mut sums = [PerSlot::new(0.0); 2];
        for (at, a) in lanes_of::<T>(layout, self.slab) {
            let (xa, mu) = (
                load3::<T>(token, &x, a),
                load3::<T>(token, &self.half_mu, a),
            );
            let (lambda, base) = (
                load9::<T>(token, &self.lambda, a),
                load9::<T>(token, &self.base, a),
            );
            for (b, pair) in slices.of(a) {
                let r = sub3(load3(token, &x, b), xa);
                let w = T::load(token, weights, pair);
                let difference = sub3(mu, load3(token, &self.half_mu, b));
                let all = scale3(w, add3(mat_vec(&lambda, r), difference));
                let kernel = scale3(w, mat_vec(&base, r));
                let change = sub3(all, kernel);
                sums[0].add(at, dot(change, change));
                sums[1].add(at, dot(kernel, kernel));
            }
        }
        sums.map(|s| s.sum())
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::{PairVectors, Reference, with_pairs};
    use super::*;
    use crate::neighbours::Graph;
    use crate::parallel::Pool;
    use crate::particles::Particles;
    use crate::scene::Scene;

    /// Uniform numbers in [-1, 1).
    fn noise(i: u64) -> f64 {
        let mut z = i.wrapping_mul(0x9E37_79B9_7F4A_7C15);
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    fn scene(cells: usize, overrides: &[&str]) -> Scene {
        let spacing = 1.0 / cells as f64;
        let text = format!(
            r#"{{
            "geometry": {{"box": {{"min": [0, 0, 0], "max": [1, 1, 1], "spacing": {spacing}}}}},
            "material": {{"neo_hookean": {{"density": 1100, "youngs_modulus": 1.7e7, "poisson_ratio": 0.3}}}},
            "numerics": {{"operators": "repaired"}},
            "time": {{"end": 1}}
        }}"#
        );
        let overrides: Vec<String> = overrides.iter().map(|o| (*o).to_string()).collect();
        Scene::from_json(&text, &overrides).expect("a good scene")
    }

    /// A cube with the particles inside moved by up to a share of the spacing.
    fn jittered(cells: usize, share: f64, overrides: &[&str]) -> (Particles, Reference) {
        let scene = scene(cells, overrides);
        let mut particles = Particles::new(&scene).expect("particles");
        for i in 0..particles.count() {
            if particles.surface[i] == [0.0; 3] {
                for c in 0..3 {
                    particles.positions[i][c] += share / cells as f64 * noise((3 * i + c) as u64);
                }
            }
        }
        let graph = Graph::new(&particles, scene.numerics.neighbours).expect("graph");
        let reference = Reference::new(&particles, &graph, &scene.numerics).expect("operators");
        (particles, reference)
    }

    /// Largest defects of the closure over V^(2/3) and of the linear completeness over 2 V.
    #[allow(clippy::let_unit_value, reason = "stored vectors have no centre")]
    pub(in crate::reference) fn defects(
        particles: &Particles,
        reference: &Reference,
    ) -> (f64, f64) {
        let (mut closure, mut complete): (f64, f64) = (0.0, 0.0);
        for i in 0..particles.count() {
            let a = Layout::slot(i);
            let l = |slot: usize| super::super::rows(reference.l.get(slot));
            let v = |slot: usize| reference.volume.get(slot)[0];
            let (mut e, mut m) = (particles.surface[i], [[0.0; 3]; 3]);
            with_pairs!(reference.pair_vectors(), pairs => {
                let centre = pairs.centre::<f64>((), a);
                for (b, pair) in reference.slices.of(a) {
                    if reference.slices.weights()[pair] == 0.0 {
                        continue;
                    }
                    let (g, back) = pairs.pair::<f64>((), &centre, b, pair);
                    let ab = scale3(2.0 * v(a), mat_vec(&l(a), g));
                    let ba = scale3(2.0 * v(b), mat_vec(&l(b), back));
                    e = axpy3(e, 0.5, sub3(ab, ba));
                    m = add_outer(&m, ab, sub3(reference.x_initial.get(b), reference.x_initial.get(a)));
                }
            });
            for c in 0..3 {
                m[c][c] -= 2.0 * v(a);
            }
            closure = closure.max(dot(e, e).sqrt() / v(a).powf(2.0 / 3.0));
            complete = complete.max(double_dot(&m, &m).sqrt() / (2.0 * v(a)));
        }
        (closure, complete)
    }

    #[test]
    fn repaired_operators_close_and_are_complete() {
        let pool = Pool::new(2).expect("two threads");
        for (share, neighbours) in [
            (0.0, "18"),
            (0.1, "18"),
            (0.2, "18"),
            (0.2, "26"),
            (0.3, "18"),
        ] {
            let set = format!("numerics.neighbours={neighbours}");
            let (particles, reference) = pool.install(|| jittered(8, share, &[&set]));
            let (closure, complete) = defects(&particles, &reference);
            let report = reference.repair().expect("repaired");
            println!(
                "{neighbours} neighbours, jitter {share}: closure {closure:.1e} (1e-10), complete \
                 {complete:.1e} (1e-14), {report:?}"
            );
            assert!(closure < 1e-10 && complete < 1e-14);
            assert!(report.before > 5e-3 && report.after < 1e-11 && report.size < 0.2);
        }
    }

    /// The multipliers have the same bits on any number of threads.
    #[test]
    fn threads_do_not_change_the_repair() {
        let on = |threads| {
            let pool = Pool::new(threads).expect("threads");
            let (_, reference) = pool.install(|| jittered(12, 0.2, &[]));
            reference.closed.expect("repaired").multipliers
        };
        let one = on(1);
        assert!([2, 3, 8].iter().all(|n| on(*n) == one));
    }

    /// A surface with a hole is not repaired in silence.
    #[test]
    fn a_surface_that_does_not_close_is_an_error() {
        let scene = scene(4, &[]);
        let mut particles = Particles::new(&scene).expect("particles");
        let corner = particles.surface[0];
        particles.surface[0] = scale3(0.5, corner);
        let graph = Graph::new(&particles, scene.numerics.neighbours).expect("graph");
        let error = Reference::new(&particles, &graph, &scene.numerics).expect_err("open");
        println!("{error}");
        assert!(
            error
                .message()
                .contains("the surface of the body does not close")
        );
    }
}
