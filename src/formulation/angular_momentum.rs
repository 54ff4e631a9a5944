//! Least-squares projection of the internal forces that conserves linear and angular momentum
//! ([URL22] section 6).

use super::passes::{lanes_from, load_slab3};
use crate::formulation::url::State;
use crate::lane::{Lane, PerSlot, Work, vectorised};
use crate::layout::Array;
use crate::math::*;
use crate::parallel;
use crate::reference::{Reference, load3, store3};

/// Replaces T_a by T_a + m_a (lambda_ang x X_a + lambda_lin) so that the forces and their moments
/// about the arms X_a add up to zero; returns the power of the change [W].
///
/// The arms are x^n + dt (c_0 v^n + c_1 v_before + c_2 v): see
/// [`ANGULAR_ARMS`](crate::integrator::ANGULAR_ARMS). [URL22] (64) to (67) weigh an integrated nodal
/// force by the volume once more; the conditions here are those of the force itself.
pub fn project(
    force: &mut Array<3>,
    state: &State,
    start: &State,
    before: &Array<3>,
    factors: [f64; 3],
    density: f64,
    reference: &Reference,
) -> f64 {
    let layout = reference.layout;
    let body = Body {
        x0: start.x.components(),
        v0: start.v.components(),
        before: before.components(),
        v: state.v.components(),
        factors,
        volume: reference.volume.components()[0],
        density,
    };
    let slabs = || vec![(); layout.slabs()];

    let all = force.components();
    let sums = parallel::map_slabs(slabs(), |slab, ()| {
        let run = layout.slab_range(slab);
        vectorised(Moments {
            body,
            force: all,
            run,
        })
    });
    let [mass, x, y, z, tx, ty, tz] = total(&sums);
    // About the centre of the arms the two conditions decouple.
    let centre = scale3(1.0 / mass, [x, y, z]);
    let linear = scale3(-1.0 / mass, [tx, ty, tz]);

    let sums = parallel::map_slabs(slabs(), |slab, ()| {
        let run = layout.slab_range(slab);
        vectorised(Spins {
            body,
            force: all,
            centre,
            run,
        })
    });
    let [xx, yy, zz, xy, xz, yz, torque @ ..] = total::<9>(&sums);
    let inertia = nalgebra::Matrix3::from([
        [yy + zz, -xy, -xz],
        [-xy, xx + zz, -yz],
        [-xz, -yz, xx + yy],
    ]);
    let torque = nalgebra::Vector3::from(torque);
    // A body of three dimensions has a regular inertia.
    let angular: [f64; 3] = inertia.lu().solve(&-torque).map_or([0.0; 3], Into::into);

    let powers = parallel::map_slabs(force.slabs_mut(), |slab, out| {
        let run = layout.slab_range(slab);
        vectorised(Changes {
            body,
            centre,
            angular,
            linear,
            run,
            out,
        })
    });
    powers.iter().sum()
}

/// Sum of the slabs.
fn total<const N: usize>(slabs: &[[f64; N]]) -> [f64; N] {
    let mut total = [0.0; N];
    for slab in slabs {
        total.iter_mut().zip(slab).for_each(|(t, s)| *t += s);
    }
    total
}

/// Masses and arms.
#[derive(Clone, Copy)]
struct Body<'a> {
    x0: [&'a [f64]; 3],
    v0: [&'a [f64]; 3],
    before: [&'a [f64]; 3],
    v: [&'a [f64]; 3],
    factors: [f64; 3],
    volume: &'a [f64],
    density: f64,
}

impl Body<'_> {
    #[inline(always)]
    fn arm<T: Lane>(&self, token: T::Token, a: usize) -> Vec3<T> {
        let mut arm = load3(token, &self.x0, a);
        for (factor, v) in std::iter::zip(self.factors, [&self.v0, &self.before, &self.v]) {
            arm = axpy3(arm, T::splat(token, factor), load3(token, v, a));
        }
        arm
    }
    /// 0 for dummies.
    #[inline(always)]
    fn mass<T: Lane>(&self, token: T::Token, a: usize) -> T {
        T::splat(token, self.density) * T::load(token, self.volume, a)
    }
}

/// Mass, first moment of the arms, and sum of the forces.
struct Moments<'a> {
    body: Body<'a>,
    force: [&'a [f64]; 3],
    run: (usize, usize),
}

impl Work for Moments<'_> {
    type Output = [f64; 7];
    #[inline(always)]
    fn run<T: Lane>(self, token: T::Token) -> [f64; 7] {
        let mut sums = [PerSlot::new(0.0); 7];
        for (at, a) in lanes_from::<T>(self.run) {
            let m = self.body.mass::<T>(token, a);
            let [x, y, z] = scale3(m, self.body.arm(token, a));
            let [tx, ty, tz] = load3::<T>(token, &self.force, a);
            add_all(&mut sums, at, [m, x, y, z, tx, ty, tz]);
        }
        sums_of(&sums)
    }
}

/// Second moments xx, yy, zz, xy, xz, yz of the arms about the centre, and the torque.
struct Spins<'a> {
    body: Body<'a>,
    force: [&'a [f64]; 3],
    centre: [f64; 3],
    run: (usize, usize),
}

impl Work for Spins<'_> {
    type Output = [f64; 9];
    #[inline(always)]
    fn run<T: Lane>(self, token: T::Token) -> [f64; 9] {
        let mut sums = [PerSlot::new(0.0); 9];
        let centre = splat3::<T>(token, self.centre);
        for (at, a) in lanes_from::<T>(self.run) {
            let y = sub3(self.body.arm(token, a), centre);
            let my = scale3(self.body.mass(token, a), y);
            let [tx, ty, tz] = cross(y, load3(token, &self.force, a));
            let [xx, yy, zz] = [my[0] * y[0], my[1] * y[1], my[2] * y[2]];
            let [xy, xz, yz] = [my[0] * y[1], my[0] * y[2], my[1] * y[2]];
            add_all(&mut sums, at, [xx, yy, zz, xy, xz, yz, tx, ty, tz]);
        }
        sums_of(&sums)
    }
}

/// Changes the forces; the power of it.
struct Changes<'a> {
    body: Body<'a>,
    centre: [f64; 3],
    angular: [f64; 3],
    linear: [f64; 3],
    run: (usize, usize),
    out: [&'a mut [f64]; 3],
}

impl Work for Changes<'_> {
    type Output = f64;
    #[inline(always)]
    fn run<T: Lane>(mut self, token: T::Token) -> f64 {
        let mut power = PerSlot::new(0.0);
        let centre = splat3::<T>(token, self.centre);
        let (angular, linear) = (splat3(token, self.angular), splat3(token, self.linear));
        for (at, a) in lanes_from::<T>(self.run) {
            let y = sub3(self.body.arm(token, a), centre);
            let change = scale3(self.body.mass(token, a), add3(cross(angular, y), linear));
            let force = add3(load_slab3(token, &self.out, at), change);
            store3(&force, &mut self.out, at);
            power.add(at, dot(change, load3(token, &self.body.v, a)));
        }
        power.sum()
    }
}

#[inline(always)]
fn splat3<T: Lane>(token: T::Token, v: [f64; 3]) -> Vec3<T> {
    [
        T::splat(token, v[0]),
        T::splat(token, v[1]),
        T::splat(token, v[2]),
    ]
}

#[inline(always)]
fn add_all<T: Lane, const N: usize>(sums: &mut [PerSlot; N], at: usize, values: [T; N]) {
    for k in 0..N {
        sums[k].add(at, values[k]);
    }
}

fn sums_of<const N: usize>(sums: &[PerSlot; N]) -> [f64; N] {
    sums.each_ref().map(PerSlot::sum)
}
