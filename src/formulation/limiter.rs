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
    let (two, tiny) = (step.of(2.0), step.of(T::TINY));
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
    let (one, tiny) = (dx2.of(1.0), dx2.of(T::TINY));
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

/// tan^2(pi/9): on a line of particles this is what a sine wave of nine particles per length has as
/// the ratio of the reconstructed jump to the reconstructed change.
const UNRESOLVED: f64 = 0.132_474_331_431_794_2;

/// v_R - v_L that is first order in pressure waves which the particles do not resolve, and the
/// unlimited w = dv - G dx everywhere else; `gradient` is G, the mean of both sides.
///
/// With n along dx, m = n . G dx, w_n = n . w and D = sym G
///
/// > v_R - v_L = w + factor theta m n, theta = phi^2 w_n^6 / (w_n^6 + r^6 m^6), phi = min(1, (tr D)^2 / D:D),
///
/// and theta = 0 where m (m + w_n) <= 0.
///
/// Two sensors of known kinds are multiplied. w_n / m compares a third with a first difference, as
/// Jameson's switch compares differences of the pressure: it is tan^2(pi/N) in a wave of N particles,
/// so that the sixth power spares resolved flow (N = 24: theta = 5e-6) and takes jumps (a step
/// between two particles: 1 - 5e-6). Minmod, which compares each side's slope with the jump,
/// meets a second difference wherever flow is curved. phi is 1 in a plane pressure wave, D = d e (x) e,
/// and 0 in shear, and plays the part of Ducros' ratio of dilatation to vorticity without the
/// vorticity, which is not objective: bending and twisting are shear, and so are the waves that an
/// incompatible start sends through them.
///
/// `factor` makes up for a dissipation coefficient below 1, which is not meant for shocks.
///
/// D_ab gains a force along n alone, with a power proportional to theta m (m + w_n) >= 0: the pair never
/// dissipates less than without a limiter, its moment is unchanged, and a spin superposed on
/// both particles has no effect.
#[inline(always)]
pub fn shock_jump<T: Lane>(
    dv: Vec3<T>,
    dx: Vec3<T>,
    dx2: T,
    gradient: &Mat3<T>,
    factor: T,
) -> Vec3<T> {
    let g = gradient;
    let change = mat_vec(g, dx);
    let w = sub3(dv, change);
    // |dx| times w_n and m.
    let (w_n, m) = (dot(w, dx), dot(change, dx));
    let (w2, m2) = (w_n * w_n, m * m);
    let trace = g[0][0] + g[1][1] + g[2][2];
    let (xy, xz, yz) = (g[0][1] + g[1][0], g[0][2] + g[2][0], g[1][2] + g[2][1]);
    let shear = xy * xy + xz * xz + yz * yz;
    let axial = g[0][0] * g[0][0] + g[1][1] * g[1][1] + g[2][2] * g[2][2];
    let rate2 = dx2.of(0.5).mul_add(shear, axial);
    let dilatation2 = (trace * trace).min(rate2);
    let smooth = dx2.of(UNRESOLVED * UNRESOLVED) * m2;
    // Of shares of one no power leaves the range of single precision.
    let (one, tiny) = (dx2.of(1.0), dx2.of(T::TINY));
    let unit = one / (w2 + smooth + tiny);
    let (p, s) = (w2 * unit, smooth * unit);
    let p3 = p * p * p;
    let phi = dilatation2 / (rate2 + tiny);
    let all = (s * s).mul_add(s, p3);
    let along = factor * m * (phi * phi * p3) / all.mul_add(dx2, tiny);
    let none = dx2.of(0.0);
    axpy3(w, (m * (m + w_n)).if_positive(along, none), dx)
}

/// part / whole in [0, 1/2]; 0 where the whole vanishes.
#[inline(always)]
fn share<T: Lane>(part: T, whole: T) -> T {
    (part / (whole + part.of(T::TINY)))
        .max(part.of(0.0))
        .min(part.of(0.5))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A number in [-1, 1], the same every time.
    fn number(i: usize, k: usize) -> f64 {
        ((i * 31 + k * 77) as f64 * 0.618_033_988_75).fract() * 2.0 - 1.0
    }

    fn vector(i: usize, k: usize) -> Vec3<f64> {
        [number(i, k), number(i, k + 1), number(i, k + 2)]
    }

    fn matrix(i: usize, k: usize) -> Mat3<f64> {
        [vector(i, k), vector(i, k + 3), vector(i, k + 6)]
    }

    #[test]
    fn minmod_never_feeds_energy_and_is_exact_for_linear_flow() {
        for i in 0..1000 {
            let (dv, dx) = (vector(i, 0), vector(i, 3));
            let dx2 = dot(dx, dx);
            let j = minmod_jump(dv, dx, dx2, vector(i, 6), vector(i, 9));
            let normal = dot(j, dx) * dot(dv, dx);
            assert!(normal >= -1e-15 && dot(j, dv) - normal / dx2 >= -1e-15);
            let half = scale3(0.5, dv);
            let linear = minmod_jump(dv, dx, dx2, half, half);
            assert!(dot(linear, linear).sqrt() < 1e-14);
        }
    }

    #[test]
    fn shock_adds_a_central_force_that_only_dissipates() {
        let mut largest = 0.0_f64;
        for i in 0..1000 {
            let (dv, dx, e) = (vector(i, 0), vector(i, 3), vector(i, 15));
            // Any flow, and nearly plane waves.
            let mut g = matrix(i, 6);
            if i % 2 == 0 {
                let plane: Mat3<f64> = std::array::from_fn(|r| scale3(e[r], e));
                g = add9(&plane, &scale9(0.1, &g));
            }
            let added = sub3(
                shock_jump(dv, dx, dot(dx, dx), &g, 1.0),
                sub3(dv, mat_vec(&g, dx)),
            );
            let m = dot(dx, mat_vec(&g, dx)) / dot(dx, dx).sqrt();
            let (along, length) = (dot(added, dx), dot(added, added).sqrt());
            assert!((along.abs() - length * dot(dx, dx).sqrt()).abs() < 1e-14);
            assert!(along * dot(dv, dx) >= 0.0);
            assert!(length <= m.abs() * (1.0 + 1e-14));
            largest = largest.max(length / m.abs());
        }
        println!("largest theta {largest} (at least 0.9)");
        assert!(largest > 0.9);
    }

    #[test]
    fn shock_is_exact_for_linear_flow_and_leaves_shear_alone() {
        for i in 0..100 {
            let (dx, g) = (vector(i, 0), matrix(i, 3));
            let linear = shock_jump(mat_vec(&g, dx), dx, dot(dx, dx), &g, 1.0);
            assert_eq!(linear, [0.0; 3]);
            // Isochoric, along any axes.
            let (a, b) = (vector(i, 12), vector(i, 15));
            let b = axpy3(b, -dot(a, b) / dot(a, a), a);
            let slide: Mat3<f64> = std::array::from_fn(|r| scale3(a[r], b));
            let dv = vector(i, 18);
            let without = sub3(dv, mat_vec(&slide, dx));
            let jump = sub3(shock_jump(dv, dx, dot(dx, dx), &slide, 1.0), without);
            assert!(dot(jump, jump).sqrt() < 1e-14, "{jump:?}");
        }
    }

    #[test]
    fn shock_does_not_depend_on_spin_scale_or_side() {
        for i in 0..100 {
            let (dv, dx, g) = (vector(i, 0), vector(i, 3), matrix(i, 6));
            let jump = shock_jump(dv, dx, dot(dx, dx), &g, 1.0);
            let near = |found: Vec3<f64>, factor: f64| {
                let difference = sub3(scale3(1.0 / factor, found), jump);
                assert!(dot(difference, difference).sqrt() < 1e-12, "{found:?}");
            };
            let s = scale3(10.0, vector(i, 15));
            let spin = [[0.0, -s[2], s[1]], [s[2], 0.0, -s[0]], [-s[1], s[0], 0.0]];
            let spun = add3(dv, mat_vec(&spin, dx));
            near(
                shock_jump(spun, dx, dot(dx, dx), &add9(&g, &spin), 1.0),
                1.0,
            );
            // Micrometres and kilometres a second.
            let (l, v) = (1e-6, 1e3);
            let small = scale3(l, dx);
            let fast = scale9(v / l, &g);
            near(
                shock_jump(scale3(v, dv), small, dot(small, small), &fast, 1.0),
                v,
            );
            let back = shock_jump(scale3(-1.0, dv), scale3(-1.0, dx), dot(dx, dx), &g, 1.0);
            assert_eq!(back, scale3(-1.0, jump));
        }
    }

    /// Its powers stay in the range of single precision.
    #[test]
    fn shock_is_the_same_in_single_precision() {
        let mut worst = 0.0_f64;
        for (length, speed) in [
            (1e-7, 1e-5),
            (1e-6, 1e3),
            (1e-3, 1e-6),
            (1.0, 1e-8),
            (1e3, 1e-9),
            (1e7, 1e4),
        ] {
            let mut own = 0.0_f64;
            for i in 0..300 {
                let (dv, dx, e) = (
                    scale3(speed, vector(i, 0)),
                    scale3(length, vector(i, 3)),
                    vector(i, 15),
                );
                let plane: Mat3<f64> = std::array::from_fn(|r| scale3(e[r], e));
                let g = scale9(speed / length, &add9(&plane, &scale9(0.1, &matrix(i, 6))));
                let single3 = |v: Vec3<f64>| [v[0] as f32, v[1] as f32, v[2] as f32];
                let (dv, dx) = (single3(dv), single3(dx));
                let g: Mat3<f32> = std::array::from_fn(|r| single3(g[r]));
                let double3 = |v: Vec3<f32>| v.map(f64::from);
                let (dvd, dxd) = (double3(dv), double3(dx));
                let exact = shock_jump(
                    dvd,
                    dxd,
                    dot(dxd, dxd),
                    &std::array::from_fn(|r| double3(g[r])),
                    1.0,
                );
                let jump = double3(shock_jump(dv, dx, dot(dx, dx), &g, 1.0));
                let error = sub3(jump, exact);
                own = own.max(dot(error, error).sqrt() / speed);
            }
            println!("{length:e} m, {speed:e} m/s: difference over the speed {own:.1e} (1e-5)");
            worst = worst.max(own);
        }
        assert!(worst < 1e-5);
    }

    #[test]
    fn shock_is_first_order_at_a_step_and_unlimited_in_resolved_waves() {
        // Normal velocity along a line of particles; theta of the pair from 0 to 1.
        let theta = |v: &dyn Fn(f64) -> f64| {
            let slope = |x: f64| 0.5 * (v(x + 1.0) - v(x - 1.0));
            let (dv, mean) = (v(1.0) - v(0.0), 0.5 * (slope(0.0) + slope(1.0)));
            let mut g = [[0.0; 3]; 3];
            g[0][0] = mean;
            let jump = shock_jump([dv, 0.0, 0.0], [1.0, 0.0, 0.0], 1.0, &g, 1.0);
            (jump[0] - (dv - mean)) / mean
        };
        assert!(theta(&|x| if x > 0.5 { 1.0 } else { 0.0 }) > 0.9999);
        for (per_wave, expected) in [(9.0, 0.5), (24.0, 5.0e-6), (48.0, 1.16e-9)] {
            let found = theta(&|x| (std::f64::consts::TAU * (x + 0.3) / per_wave).sin());
            println!("{per_wave} particles per wave: theta {found:.3e}, expected {expected:.1e}");
            assert!((found / expected - 1.0).abs() < 0.05);
        }
    }

    #[test]
    fn venkatakrishnan_is_one_where_the_step_is_small_and_limits_extrema() {
        assert!((venkatakrishnan(1.0_f64, -1.0, 1e-9) - 1.0).abs() < 1e-8);
        assert!(venkatakrishnan(0.0, -1.0, 0.5) < 1e-299);
        assert!(venkatakrishnan(0.5, -1.0, 0.5) < 1.0);
        assert_eq!(venkatakrishnan(0.0, 0.0, 0.0), 1.0);
    }
}
