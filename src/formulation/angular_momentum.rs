//! Least-squares projection of the internal forces that conserves linear and angular momentum
//! ([URL22] section 6).

use crate::formulation::url::State;
use crate::layout::{Array, Layout};
use crate::math::*;
use crate::parallel;
use crate::reference::Reference;

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
    let volume = reference.volume.components()[0];
    let (x0, v0) = (start.x.components(), start.v.components());
    let (vb, v) = (before.components(), state.v.components());
    let arm = |a: usize| -> [f64; 3] {
        std::array::from_fn(|c| {
            x0[c][a] + (factors[0] * v0[c][a] + factors[1] * vb[c][a] + factors[2] * v[c][a])
        })
    };
    let slots = |slab: usize| {
        let (first, slices) = layout.slab_range(slab);
        let end = (first + slices * crate::lane::SLICE).min(Layout::slot(layout.particles));
        first..end
    };
    let slabs = || (0..layout.slabs()).collect::<Vec<_>>();

    // Mass, first moment and sum of forces.
    let t = force.components();
    let sums = parallel::map_slabs(slabs(), |_, slab| {
        let (mut mass, mut moment, mut sum) = (0.0, [0.0; 3], [0.0; 3]);
        for a in slots(slab) {
            let m = density * volume[a];
            mass += m;
            moment = axpy3(moment, m, arm(a));
            sum = add3(sum, [t[0][a], t[1][a], t[2][a]]);
        }
        (mass, moment, sum)
    });
    let (mass, moment, sum) = sums.into_iter().fold((0.0, [0.0; 3], [0.0; 3]), |s, p| {
        (s.0 + p.0, add3(s.1, p.1), add3(s.2, p.2))
    });
    // About the centre of the arms the two conditions decouple.
    let centre = scale3(1.0 / mass, moment);
    let linear = scale3(-1.0 / mass, sum);

    let sums = parallel::map_slabs(slabs(), |_, slab| {
        let (mut inertia, mut torque) = ([[0.0; 3]; 3], [0.0; 3]);
        for a in slots(slab) {
            let m = density * volume[a];
            let y = sub3(arm(a), centre);
            let yy = dot(y, y);
            for r in 0..3 {
                inertia[r][r] += m * yy;
                inertia[r] = axpy3(inertia[r], -m * y[r], y);
            }
            torque = add3(torque, cross(y, [t[0][a], t[1][a], t[2][a]]));
        }
        (inertia, torque)
    });
    let (inertia, torque) = sums.into_iter().fold(([[0.0; 3]; 3], [0.0; 3]), |s, p| {
        (add9(&s.0, &p.0), add3(s.1, p.1))
    });
    let inertia = nalgebra::Matrix3::from_fn(|r, c| inertia[r][c]);
    let torque = nalgebra::Vector3::from(torque);
    // A body of three dimensions has a regular inertia.
    let angular: [f64; 3] = inertia.lu().solve(&-torque).map_or([0.0; 3], Into::into);

    let powers = parallel::map_slabs(force.slabs_mut(), |slab, out| {
        let (first, _) = layout.slab_range(slab);
        let mut power = 0.0;
        for a in slots(slab) {
            let y = sub3(arm(a), centre);
            let change = scale3(density * volume[a], add3(cross(angular, y), linear));
            for c in 0..3 {
                out[c][a - first] += change[c];
            }
            power += dot(change, [v[0][a], v[1][a], v[2][a]]);
        }
        power
    });
    powers.iter().sum()
}
