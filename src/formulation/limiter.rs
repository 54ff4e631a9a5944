//! Limiters of the linear reconstruction.

use crate::lane::Lane;
use crate::math::*;

/// Venkatakrishnan's limiter of one component: `rise` and `fall` are the largest and smallest
/// difference to a neighbour (rise >= 0 >= fall), `step` the reconstructed difference.
///
/// phi(y) = (y^2 + 2 y)/(y^2 + y + 2) with y the admissible over the reconstructed difference.
#[inline(always)]
pub fn venkatakrishnan<T: Lane>(rise: T, fall: T, step: T) -> T {
    let admissible = step.if_positive(rise, -fall);
    let magnitude = step.max(-step);
    let (a2, ab, b2) = (
        admissible * admissible,
        admissible * magnitude,
        magnitude * magnitude,
    );
    let (two, tiny) = (step.of(2.0), step.of(1e-300));
    (a2 + two * ab + tiny) / (a2 + ab + two * b2 + tiny)
}

/// v_R - v_L with the change of each side limited by half the jump: the normal part by minmod, the
/// tangential part by its share along the tangential jump. In the frame of the pair, so that it is
/// objective, and with a factor in [0, 1] on each part of the jump, so that D . dv >= 0.
#[inline(always)]
pub fn minmod_jump<T: Lane>(
    dv: Vec3<T>,
    dx: Vec3<T>,
    dx2: T,
    half_a: Vec3<T>,
    half_b: Vec3<T>,
) -> Vec3<T> {
    let (one, tiny) = (dx2.of(1.0), dx2.of(1e-300));
    let inverse = one / (dx2 + tiny);
    // Components along dx, as multiples of dx.
    let jump_n = dot(dv, dx) * inverse;
    let (na, nb) = (dot(half_a, dx) * inverse, dot(half_b, dx) * inverse);
    let n2 = jump_n * jump_n;
    let keep_n = one - share(na * jump_n, n2) - share(nb * jump_n, n2);
    let dv_t = axpy3(dv, -jump_n, dx);
    let t2 = dot(dv_t, dv_t);
    let keep_t = one - share(dot(half_a, dv_t), t2) - share(dot(half_b, dv_t), t2);
    axpy3(scale3(keep_t, dv_t), keep_n * jump_n, dx)
}

/// part / whole in [0, 1/2]; 0 where the whole vanishes.
#[inline(always)]
fn share<T: Lane>(part: T, whole: T) -> T {
    (part / (whole + part.of(1e-300)))
        .max(part.of(0.0))
        .min(part.of(0.5))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn minmod_never_feeds_energy_and_is_exact_for_linear_flow() {
        for i in 0..1000 {
            let f = |k: usize| ((i * 31 + k * 77) as f64 * 0.618_033_988_75).fract() * 2.0 - 1.0;
            let (dv, dx) = ([f(0), f(1), f(2)], [f(3), f(4), f(5)]);
            let dx2 = dot(dx, dx);
            let j = minmod_jump(dv, dx, dx2, [f(6), f(7), f(8)], [f(9), f(10), f(11)]);
            let normal = dot(j, dx) * dot(dv, dx);
            assert!(normal >= -1e-15 && dot(j, dv) - normal / dx2 >= -1e-15);
            let half = scale3(0.5, dv);
            let linear = minmod_jump(dv, dx, dx2, half, half);
            assert!(dot(linear, linear).sqrt() < 1e-14);
        }
    }

    #[test]
    fn venkatakrishnan_is_one_where_the_step_is_small_and_limits_extrema() {
        assert!((venkatakrishnan(1.0, -1.0, 1e-9) - 1.0).abs() < 1e-8);
        assert!(venkatakrishnan(0.0, -1.0, 0.5) < 1e-299);
        assert!(venkatakrishnan(0.5, -1.0, 0.5) < 1.0);
        assert_eq!(venkatakrishnan(0.0, 0.0, 0.0), 1.0);
    }
}
