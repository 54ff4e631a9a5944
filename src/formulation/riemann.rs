//! Riemann dissipation of a pair, in a form that does not depend on the reference.
//!
//! [URL22] (59), (60) as printed use areas, densities and a reconstruction in the reference
//! configuration, so that results depend on when it was updated. Here all three are spatial:
//! D_ab = 1/2 rho |c_ab| [c_p n (x) n + c_s (I - n (x) n)] (v_R - v_L), c_ab = (h_a C_ab - h_b C_ba)/2.

use super::limiter;
use crate::lane::Lane;
use crate::math::*;

/// How the velocity is reconstructed at the middle of a pair.
pub const CONSTANT: u8 = 0;
/// Linear, with the spatial gradient.
pub const LINEAR: u8 = 1;
/// Linear with the edge-wise minmod limiter.
pub const MINMOD: u8 = 2;
/// Linear, but constant in pressure waves that the particles do not resolve.
pub const SHOCK: u8 = 3;
/// No dissipation at all.
pub const OFF: u8 = 4;
/// As linear or shock, without the pairs that would gain energy.
pub const GUARDED: u8 = 5;

/// Whether the reconstruction needs gradients.
pub const fn reconstructs(mode: u8) -> bool {
    matches!(mode, LINEAR | MINMOD | SHOCK | GUARDED)
}

/// Wave speeds of the linearised law [m/s].
#[derive(Clone, Copy, Debug)]
pub struct WaveSpeeds<T> {
    /// Pressure waves.
    pub pressure: T,
    /// Shear waves.
    pub shear: T,
}

/// One pair, seen from a.
#[derive(Clone, Copy)]
pub struct Pair<T> {
    /// x_b - x_a [m].
    pub dx: Vec3<T>,
    /// v_b - v_a [m/s].
    pub dv: Vec3<T>,
    /// |dx|^2.
    pub dx2: T,
    /// Mean of the smallest stretches, (63).
    pub stretch: T,
    /// Mean spatial density [kg/m^3].
    pub density: T,
    /// c_ab [m^2].
    pub area: Vec3<T>,
}

/// Jump v_R - v_L at the middle of the pair; `grad_a` and `grad_b` are half the spatial velocity
/// gradients of both sides. `full` is 1 over the dissipation coefficient, which a shock does without.
#[inline(always)]
pub fn jump<T: Lane, const MODE: u8>(
    pair: &Pair<T>,
    grad_a: &Mat3<T>,
    grad_b: &Mat3<T>,
    full: T,
) -> Vec3<T> {
    let Pair { dx, dv, dx2, .. } = *pair;
    match MODE {
        CONSTANT => dv,
        SHOCK | GUARDED => limiter::shock_jump(dv, dx, dx2, &add9(grad_a, grad_b), full),
        _ => {
            let (half_a, half_b) = (mat_vec(grad_a, dx), mat_vec(grad_b, dx));
            match MODE {
                MINMOD => limiter::minmod_jump(dv, dx, dx2, half_a, half_b),
                _ => sub3(dv, add3(half_a, half_b)),
            }
        }
    }
}

/// D_ab, the force on a.
#[inline(always)]
pub fn dissipation<T: Lane>(pair: &Pair<T>, jump: Vec3<T>, speeds: WaveSpeeds<T>) -> Vec3<T> {
    let norm = dot(pair.area, pair.area).sqrt();
    // One division for the mean wave speed and for n (x) n; dummies have dx = 0 and no area.
    let inverse =
        norm.of(0.5) * pair.density * norm / pair.stretch.mul_add(pair.dx2, norm.of(T::TINY));
    let along = (speeds.pressure - speeds.shear) * dot(pair.dx, jump);
    scale3(
        inverse,
        axpy3(scale3(speeds.shear * pair.dx2, jump), along, pair.dx),
    )
}

/// D_ab of a pair that loses energy by it, else nothing.
#[inline(always)]
pub fn guarded<T: Lane>(d: Vec3<T>, dv: Vec3<T>) -> Vec3<T> {
    let (work, none) = (dot(d, dv), d[0].of(0.0));
    select(work, &d, &[none; 3])
}

/// D^j_ab with a coefficient, for the rate of the volume V_chi dj/dt ([URL22] 59, 60): spatial like
/// the above, coefficient |c_ab| / (2 rho c_p) (Sigma_j,R - Sigma_j,L).
#[inline(always)]
pub fn volume_dissipation<T: Lane>(
    pair: &Pair<T>,
    jump: T,
    pressure_speed: T,
    coefficient: T,
) -> T {
    let norm = dot(pair.area, pair.area).sqrt();
    coefficient * norm.of(0.5) * norm * pair.stretch / (pair.density * pressure_speed) * jump
}
