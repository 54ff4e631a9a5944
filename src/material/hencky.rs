//! Hencky's elasticity with von Mises flow: [URL23] 31 to 39 and Algorithm 1, [URL22] remark 3.

use super::{Deformation, History, Material, Moduli, Stress};
use crate::lane::Precise;
use crate::math::*;

/// W = mu dev(e):dev(e) + kappa/2 (ln J)^2 with e = 1/2 ln b_e, b_e = F C_p^-1 F^T, and a yield
/// surface Y for the von Mises stress sqrt(3/2 dev(tau):dev(tau)) of the Kirchhoff stress tau.
///
/// The radial return ([URL23] Algorithm 1) scales dev(e) by s = 1 - 3 mu Delta gamma/q, which keeps
/// its directions. So no eigenvectors are needed: dev(tau) = 2 mu s dev(e), and
/// C_p^-1 <- F^-1 exp(2 s dev(e)) F^-T det(F)^(2/3). The last factor makes det(C_p) = 1 anew with every
/// flow, so round-off does not accumulate in the plastic volume.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hencky<Y> {
    /// Elastic constants.
    pub moduli: Moduli,
    /// When and how much the material flows.
    pub surface: Y,
}

/// State of a point before it flows.
#[derive(Clone, Copy)]
pub struct Trial<T> {
    /// Von Mises stress q of the elastic response [Pa].
    pub von_mises: T,
    /// 3 mu [Pa]: what q loses per equivalent plastic strain.
    pub three_mu: T,
    /// Equivalent plastic strain.
    pub strain: T,
    /// Temperature [K].
    pub theta: T,
    /// Time in which the point flows [s].
    pub elapsed: T,
}

/// Plastic flow of a point.
#[derive(Clone, Copy)]
pub struct Flow<T> {
    /// Delta gamma, the equivalent plastic strain it adds; 0 where the point stays elastic.
    pub increment: T,
    /// Plastic work per unit initial volume [J/m^3].
    pub work: T,
}

impl<T: Precise> Flow<T> {
    /// No flow.
    #[inline(always)]
    pub fn none(token: T::Token) -> Self {
        let zero = T::splat(token, 0.0);
        Self {
            increment: zero,
            work: zero,
        }
    }
}

/// A von Mises yield surface with isotropic hardening.
pub trait Yield: Copy + Send + Sync {
    /// Delta gamma in [0, q/(3 mu)] with q - 3 mu Delta gamma = tau_y at its end, and 0 where q is
    /// below tau_y already.
    ///
    /// The plastic work is that of the mean of the hardening at start and end: along a path on the
    /// surface the work done is the integral of tau_y, for which this is the trapezoidal rule; it is
    /// exact for linear hardening, and for an increment that begins below the surface too.
    fn flow<T: Precise>(&self, trial: &Trial<T>) -> Flow<T>;
}

impl<Y: Yield> Material for Hencky<Y> {
    const HISTORY: bool = true;
    fn density(&self) -> f64 {
        self.moduli.rho
    }
    fn pressure_wave_speed(&self) -> f64 {
        self.moduli.pressure_wave_speed()
    }
    fn shear_wave_speed(&self) -> f64 {
        self.moduli.shear_wave_speed()
    }
    /// [URL23] Algorithm 1 without its spectral decomposition.
    #[inline(always)]
    fn stress<T: Precise, const FLOW: bool>(
        &self,
        d: &Deformation<T>,
        theta: T,
        history: &mut History<T>,
        elapsed: T,
    ) -> Stress<T> {
        let Deformation { f, h, j } = d;
        let Moduli { mu, kappa, .. } = self.moduli;
        let one = j.of(1.0);
        let cof = cofactor(f);
        let scale = dot(f[0], cof[0]).inverse_cbrt(); // det(F)^(-1/3)
        let scale2 = scale * scale;

        // Elastic trial. The logarithm gets an isochoric b_e, next to the identity for a metal at any
        // J; its deviator does not depend on that.
        let [xx, yy, zz, xy, xz, yz, strain] = *history;
        let b = scale_all(scale2, &congruence(f, &[xx, yy, zz, xy, xz, yz]));
        let mut e = scale_all(j.of(0.5), &deviator(&ln_symmetric(&b)));
        let mut von_mises = (j.of(6.0) * square(&e)).sqrt() * j.of(mu);

        let mut dissipation = j.of(0.0);
        if FLOW {
            let three_mu = j.of(3.0 * mu);
            let Flow { increment, work } = self.surface.flow(&Trial {
                von_mises,
                three_mu,
                strain,
                theta,
                elapsed,
            });
            if increment.any_positive() {
                let s = increment.if_positive(one - three_mu * increment / von_mises, one);
                e = scale_all(s, &e);
                von_mises = s * von_mises;
                let b = exp_symmetric(&scale_all(j.of(2.0), &e));
                let inverse = scale_all(scale2 * scale2, &congruence(&transpose(&cof), &b));
                let [xx, yy, zz, xy, xz, yz] = inverse;
                let flown = [xx, yy, zz, xy, xz, yz, strain + increment];
                *history = select(increment, &flown, history);
                dissipation = work;
            }
        }

        let ln_j = j.ln();
        let sigma_j = j.of(kappa) * ln_j / *j;
        let tau = full(&scale_all(j.of(2.0 * mu), &e));
        // A wave along n in a body with stress tau travels at c^2 rho_R = kappa (1 - ln J) + 4/3 mu -
        // dev(tau)_nn where n is a principal direction; the strain's own contribution to the shear
        // terms, and dev(tau)_nn, are below 4/3 q.
        let stiffness =
            (one - ln_j).max(j.of(0.0)) * j.of(kappa) + (j.of(mu) + von_mises) * j.of(4.0 / 3.0);
        Stress {
            // dev(tau) F^-T + Sigma_J H
            p: axpy9(&scale9(scale2 * scale, &mat_mul(&tau, &cof)), sigma_j, h),
            sigma_j,
            energy: square(&e).mul_add(j.of(mu), j.of(0.5 * kappa) * ln_j * ln_j),
            dissipation,
            stretch: (j.of(kappa + 4.0 / 3.0 * mu) / stiffness).sqrt(),
        }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::lane::{SLICE, Work, vectorised};
    use crate::material::{JohnsonCook, VIRGIN, VonMises};
    use nalgebra::{Matrix3, Rotation3, Vector3};

    fn copper(surface: VonMises) -> Hencky<VonMises> {
        Hencky {
            moduli: Moduli::new(117e9, 0.35, 8930.0),
            surface,
        }
    }
    fn linear(yield_stress: f64, hardening_modulus: f64) -> VonMises {
        VonMises {
            yield_stress,
            hardening_modulus,
            saturation: 0.0,
            saturation_exponent: 0.0,
        }
    }
    const SATURATING: VonMises = VonMises {
        yield_stress: 0.45e9,
        hardening_modulus: 129e6,
        saturation: 0.265e9,
        saturation_exponent: 16.93,
    };

    fn of(f: Mat3<f64>) -> Deformation<f64> {
        let h = cofactor(&f);
        let j = dot(f[0], h[0]);
        Deformation { f, h, j }
    }
    fn respond<const FLOW: bool>(
        law: impl Material,
        f: Mat3<f64>,
        history: &mut History<f64>,
    ) -> Stress<f64> {
        law.stress::<f64, FLOW>(&of(f), 300.0, history, 1e-6)
    }
    fn von_mises(stress: &Stress<f64>, f: &Mat3<f64>) -> f64 {
        let tau = mat_mul_t(&stress.p, f);
        let mean = (tau[0][0] + tau[1][1] + tau[2][2]) / 3.0;
        let dev = axpy9(&tau, -mean, &IDENTITY);
        (1.5 * double_dot(&dev, &dev)).sqrt()
    }
    fn det_cp(h: &History<f64>) -> f64 {
        let c = full(&[h[0], h[1], h[2], h[3], h[4], h[5]]);
        dot(c[0], cofactor(&c)[0])
    }
    fn shear(gamma: f64) -> Mat3<f64> {
        [[1.0, gamma, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    }
    /// A history that has flown in shear and tension.
    fn worked(law: impl Material) -> History<f64> {
        let mut history = VIRGIN;
        for k in 1..=20 {
            let t = 0.02 * f64::from(k);
            let f = [
                [1.0 + t, 0.5 * t, 0.0],
                [0.1 * t, 1.0 - 0.3 * t, 0.0],
                [0.0, t, 1.0 - 0.4 * t],
            ];
            respond::<true>(law, f, &mut history);
        }
        history
    }

    /// Uniaxial tension has a closed form: the logarithmic strains are elastic and plastic ones added,
    /// tau/E + e along the bar and -nu tau/E - e/2 across, and tau = tau_y(e).
    #[test]
    fn uniaxial_tension_follows_its_closed_form_whatever_the_steps() {
        let (youngs_modulus, poisson_ratio) = (117e9, 0.35);
        let mut worst: f64 = 0.0;
        for surface in [linear(4e8, 1e8), linear(4e8, 0.0), SATURATING] {
            let yield_at = |e: f64| {
                let VonMises {
                    yield_stress,
                    hardening_modulus,
                    saturation,
                    saturation_exponent,
                } = surface;
                yield_stress
                    + hardening_modulus * e
                    + saturation * (1.0 - (-saturation_exponent * e).exp())
            };
            for steps in [1, 7, 1000] {
                let mut history = VIRGIN;
                for k in 1..=steps {
                    let e = 0.8 * f64::from(k) / f64::from(steps);
                    let tau = yield_at(e);
                    let along = (tau / youngs_modulus + e).exp();
                    let across = (-poisson_ratio * tau / youngs_modulus - 0.5 * e).exp();
                    let f = [[across, 0.0, 0.0], [0.0, along, 0.0], [0.0, 0.0, across]];
                    let stress = respond::<true>(copper(surface), f, &mut history);
                    worst = worst.max((stress.p[1][1] * along / tau - 1.0).abs());
                    worst = worst.max((stress.p[0][0] * across / tau).abs());
                    worst = worst.max((history[6] - e).abs());
                }
            }
        }
        println!("relative error {worst:e} (tolerance 2e-12)");
        assert!(worst < 2e-12);
    }

    #[test]
    fn unloading_is_elastic_and_reloading_yields_where_it_left_off() {
        let law = copper(linear(4e8, 1e8));
        let mut history = worked(law);
        let surface = 4e8 + 1e8 * history[6];
        // The stress-free configuration of the worked point: F with b_e = I, F = C_p^(1/2).
        let [xx, yy, zz, xy, xz, yz, _] = history;
        let root = full(&exp_symmetric(
            &ln_symmetric(&[xx, yy, zz, xy, xz, yz]).map(|l| -0.5 * l),
        ));
        let free = respond::<true>(law, root, &mut history);
        println!(
            "stress left over {:e} (tolerance 1e-12 mu)",
            von_mises(&free, &root)
        );
        assert!(von_mises(&free, &root) < 1e-12 * law.moduli.mu);
        let before = history;
        let load = |part: f64| {
            let gamma = part * surface / (3f64.sqrt() * law.moduli.mu);
            mat_mul(&shear(gamma), &root)
        };
        let below = respond::<true>(law, load(0.999), &mut history);
        assert_eq!(history, before);
        assert!((von_mises(&below, &load(0.999)) / surface - 0.999).abs() < 1e-4);
        respond::<true>(law, load(1.001), &mut history);
        println!("flow 0.1 % past the surface: {:e}", history[6] - before[6]);
        assert!(history[6] > before[6]);
    }

    #[test]
    fn a_committed_state_answers_with_the_stress_it_was_committed_with() {
        let mut worst: f64 = 0.0;
        for surface in [linear(4e8, 0.0), linear(4e8, 1e8), SATURATING] {
            let law = copper(surface);
            let mut history = worked(law);
            let f = mat_mul(
                &shear(0.3),
                &[[1.1, 0.0, 0.2], [0.1, 0.7, 0.0], [0.0, 0.3, 0.9]],
            );
            let committed = respond::<true>(law, f, &mut history);
            let kept = history;
            for again in [
                respond::<false>(law, f, &mut history),
                respond::<true>(law, f, &mut history),
            ] {
                let change = axpy9(&again.p, -1.0, &committed.p);
                worst = worst.max(double_dot(&change, &change).sqrt() / 4e8);
                worst = worst.max((again.energy / committed.energy - 1.0).abs());
            }
            worst = worst.max((history[6] - kept[6]) * law.moduli.mu / 4e8);
        }
        println!("change over the yield stress {worst:e} (tolerance 1e-12)");
        assert!(worst < 1e-12);
    }

    #[test]
    fn flow_is_objective_and_leaves_the_volume_alone() {
        let law = copper(linear(4e8, 1e8));
        let (mut still, mut turned) = (VIRGIN, VIRGIN);
        let mut worst: [f64; 3] = [0.0; 3];
        for k in 1..=100 {
            let t = 0.01 * f64::from(k);
            let f = [
                [1.0 + t, t, 0.0],
                [0.0, 1.0 - 0.4 * t, 0.3 * t],
                [0.1 * t, 0.0, 1.0 - 0.2 * t],
            ];
            let q = Rotation3::from_axis_angle(&Vector3::y_axis(), 7.0 * t)
                * Rotation3::from_axis_angle(&Vector3::x_axis(), -3.0 * t);
            let q = [0, 1, 2].map(|r| [0, 1, 2].map(|c| q[(r, c)]));
            let a = respond::<true>(law, f, &mut still);
            let b = respond::<true>(law, mat_mul(&q, &f), &mut turned);
            let change = axpy9(&b.p, -1.0, &mat_mul(&q, &a.p));
            worst[0] = worst[0].max(double_dot(&change, &change).sqrt() / 4e8);
            for k in 0..7 {
                worst[1] = worst[1].max((still[k] - turned[k]).abs());
            }
            let tau = mat_mul_t(&a.p, &f);
            let j = of(f).j;
            let pressure = (tau[0][0] + tau[1][1] + tau[2][2]) / 3.0 - law.moduli.kappa * j.ln();
            worst[2] = worst[2].max(pressure.abs() / 4e8);
        }
        println!(
            "P {:e}, history {:e}, pressure {:e} (tolerance 2e-11)",
            worst[0], worst[1], worst[2]
        );
        assert!(worst.iter().all(|w| *w < 2e-11));
    }

    /// With J = 1 the rate equations of simple shear reduce, for perfect plasticity, to a stress on the
    /// surface whose direction turns with the plastic strain: steps of different sizes agree, and the
    /// von Mises stress stays at the yield stress.
    #[test]
    fn large_simple_shear_stays_on_the_surface_and_converges() {
        let law = copper(linear(4e8, 0.0));
        let end = |steps: u32| {
            let mut history = VIRGIN;
            let mut off: f64 = 0.0;
            let mut p = IDENTITY;
            for k in 1..=steps {
                let f = shear(10.0 * f64::from(k) / f64::from(steps));
                let stress = respond::<true>(law, f, &mut history);
                if history[6] > 0.0 {
                    off = off.max((von_mises(&stress, &f) / 4e8 - 1.0).abs());
                }
                p = mat_mul_t(&stress.p, &f);
            }
            (p, history, off)
        };
        let (fine, history, off) = end(16_000);
        let error = |steps| {
            let tau = axpy9(&end(steps).0, -1.0, &fine);
            double_dot(&tau, &tau).sqrt() / 4e8
        };
        let (coarse, medium) = (error(1000), error(2000));
        println!(
            "off the surface {off:e} (tolerance 1e-10); errors {coarse:e}, {medium:e} (first order)"
        );
        println!("plastic strain {} of {}", history[6], 10.0 / 3f64.sqrt());
        assert!(off < 1e-10 && medium < 0.6 * coarse && coarse < 1e-2);
        assert!((history[6] / (10.0 / 3f64.sqrt()) - 1.0).abs() < 2e-3);
    }

    /// The stored energy and the plastic work together are the work of the stresses, integrated by the
    /// trapezoidal rule; the residual falls with the square of the step.
    #[test]
    fn the_energy_balance_closes_to_second_order() {
        let cooks = Hencky {
            moduli: copper(SATURATING).moduli,
            surface: crate::material::johnson_cook::tests::COPPER,
        };
        fn residual(law: impl Material, steps: u32) -> f64 {
            let path = |k: u32| {
                let t = f64::from(k) / f64::from(steps);
                let (s, c) = (3.0 * t).sin_cos();
                let f = [
                    [1.0 + 0.2 * s, 0.4 * t, 0.1 * c - 0.1],
                    [0.0, 1.0 - 0.1 * s, 0.2 * s],
                    [0.1 * s, 0.0, 1.0 - 0.1 * t],
                ];
                mat_mul(&shear(0.3 * s * c), &f)
            };
            let mut history = VIRGIN;
            let (mut work, mut plastic) = (0.0, 0.0);
            let at = |k, history: &mut _| {
                law.stress::<f64, true>(&of(path(k)), 300.0, history, 1e-3 / f64::from(steps))
            };
            let mut last = at(0, &mut history);
            for k in 1..=steps {
                let next = at(k, &mut history);
                let change = axpy9(&path(k), -1.0, &path(k - 1));
                work += 0.5 * (double_dot(&last.p, &change) + double_dot(&next.p, &change));
                assert!(next.dissipation >= 0.0);
                plastic += next.dissipation;
                last = next;
            }
            (last.energy + plastic - work) / work
        }
        let show = |name: &str, f: &dyn Fn(u32) -> f64| {
            let (coarse, fine) = (f(500), f(4000));
            println!(
                "{name}: residual {coarse:e} with 500 steps, {fine:e} with 4000 (tolerance 2e-6)"
            );
            assert!(fine.abs() < 2e-6 && fine.abs() < coarse.abs() / 16.0);
        };
        show("linear", &|n| residual(copper(linear(4e8, 1e8)), n));
        show("perfect", &|n| residual(copper(linear(4e8, 0.0)), n));
        show("saturating", &|n| residual(copper(SATURATING), n));
        show("Johnson-Cook", &|n| residual(cooks, n));
    }

    #[test]
    fn plastic_volume_stays_over_many_increments() {
        let law = copper(SATURATING);
        let mut history = VIRGIN;
        let mut worst: f64 = 0.0;
        for k in 0..100_000 {
            let (s, c) = (0.01 * f64::from(k)).sin_cos();
            let f = mat_mul(
                &shear(0.5 * s),
                &[
                    [1.0 + 0.3 * c, 0.0, 0.1 * s],
                    [0.0, 0.8, 0.0],
                    [0.2 * c, 0.0, 1.1],
                ],
            );
            respond::<true>(law, f, &mut history);
            worst = worst.max((det_cp(&history) - 1.0).abs());
        }
        println!(
            "|det C_p^-1 - 1| {worst:e} (tolerance 2e-13) at plastic strain {}",
            history[6]
        );
        assert!(worst < 2e-13 && history[6] > 100.0);
    }

    /// P is the derivative of W at a frozen history, in and out of the series of the logarithm.
    #[test]
    fn stress_is_the_derivative_of_the_energy() {
        let law = copper(linear(4e8, 1e8));
        let mut history = worked(law);
        let mut worst: f64 = 0.0;
        for f in [
            [[1.4, 0.22, 0.01], [0.04, 0.88, 0.0], [0.0, 0.4, 0.84]],
            [[2.4, 0.2, 0.0], [-0.3, 0.5, 0.1], [0.0, 0.4, 0.3]],
        ] {
            let p = respond::<false>(law, f, &mut history).p;
            for r in 0..3 {
                for c in 0..3 {
                    let mut energy = |e: f64| {
                        let mut g = f;
                        g[r][c] += e;
                        respond::<false>(law, g, &mut history).energy
                    };
                    let slope = (energy(1e-5) - energy(-1e-5)) / 2e-5;
                    worst = worst.max((slope - p[r][c]).abs() / law.moduli.mu);
                }
            }
        }
        println!("P - dW/dF over mu: {worst:e} (tolerance 1e-7)");
        assert!(worst < 1e-7);
    }

    /// The fastest plane wave from the acoustic tensor, by differences of P, against the bound.
    #[test]
    fn no_wave_is_faster_than_the_bound_and_the_bound_is_close() {
        let elastic = copper(linear(1e30, 0.0));
        let flowing = copper(linear(4e8, 1e8));
        let squeeze = |s: f64| scale9(s, &IDENTITY);
        let mut worst: [f64; 2] = [0.0, f64::INFINITY];
        for (law, f) in [
            (flowing, squeeze(1.0)),
            (flowing, squeeze(0.2f64.cbrt())),
            (flowing, squeeze(0.8)),
            (flowing, squeeze(1.2)),
            (flowing, shear(5.0)),
            (flowing, mat_mul(&shear(1.0), &squeeze(0.7))),
            (elastic, shear(0.5)),
            (elastic, shear(3.0)),
            (elastic, [[0.3, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]),
            (elastic, [[3.0, 0.0, 0.0], [0.0, 0.6, 0.0], [0.0, 0.0, 0.6]]),
        ] {
            let mut history = VIRGIN;
            let bound = law.pressure_wave_speed() / respond::<true>(law, f, &mut history).stretch;
            let mut tangent = [[[[0.0; 3]; 3]; 3]; 3]; // dP_iK/dF_jL at [j][L][i][K]
            for j in 0..3 {
                for l in 0..3 {
                    let mut p = |e: f64| {
                        let mut g = f;
                        g[j][l] += e;
                        respond::<false>(law, g, &mut history).p
                    };
                    tangent[j][l] = scale9(0.5e6, &axpy9(&p(1e-6), -1.0, &p(-1e-6)));
                }
            }
            let inverse = scale9(1.0 / of(f).j, &cofactor(&f)); // F^-T
            let mut fastest: f64 = 0.0;
            for k in 0..2000 {
                let z = 1.0 - 2.0 * (f64::from(k) + 0.5) / 2000.0;
                let (s, c) = (f64::from(k) * 2.399_963_23).sin_cos();
                let r = (1.0 - z * z).sqrt();
                let n = [r * c, r * s, z];
                let acoustic: Matrix3<f64> = Matrix3::from_fn(|i, j| {
                    (0..9)
                        .map(|m| tangent[j][m % 3][i][m / 3] * n[m / 3] * n[m % 3])
                        .sum()
                });
                let spatial = mat_vec(&inverse, n);
                let c2: f64 =
                    acoustic.symmetric_eigenvalues().max() / law.moduli.rho / dot(spatial, spatial);
                fastest = fastest.max(c2.sqrt());
            }
            println!("bound over fastest wave {}", bound / fastest);
            worst = [worst[0].max(bound / fastest), worst[1].min(bound / fastest)];
        }
        println!(
            "from {} (tolerance 0.99999) to {} (tolerance 1.5)",
            worst[1], worst[0]
        );
        assert!(worst[1] > 0.99999 && worst[0] < 1.5);
    }

    struct Points<'a, M>(M, &'a [[f64; 17]], &'a mut [[f64; 19]]);
    impl<M: Material> Work for Points<'_, M> {
        type Output = ();
        #[inline(always)]
        fn run<T: Precise>(self, token: T::Token) {
            for at in (0..self.1.len()).step_by(T::WIDTH) {
                let mut column = [0.0; SLICE];
                let x: [T; 17] = std::array::from_fn(|k| {
                    for lane in 0..T::WIDTH {
                        column[lane] = self.1[at + lane][k];
                    }
                    T::load(token, &column, 0)
                });
                let f = [[x[0], x[1], x[2]], [x[3], x[4], x[5]], [x[6], x[7], x[8]]];
                let h = cofactor(&f);
                let j = dot(f[0], h[0]);
                let mut history = [T::splat(token, 1.0); 7];
                for k in 3..7 {
                    history[k] = T::splat(token, 0.0);
                }
                history[6] = x[9];
                let deformation = Deformation { f, h, j };
                let s = self
                    .0
                    .stress::<T, true>(&deformation, x[10], &mut history, x[11]);
                let p = s.p;
                let rest = [s.energy, s.dissipation, s.stretch];
                let all = p[0]
                    .into_iter()
                    .chain(p[1])
                    .chain(p[2])
                    .chain(history)
                    .chain(rest);
                for (k, value) in all.enumerate() {
                    value.for_lanes(|lane, value| self.2[at + lane][k] = value);
                }
            }
        }
    }

    /// Lanes in all kinds of company: elastic beside flowing, near the identity beside far from it, cold
    /// beside molten.
    #[test]
    fn every_width_gives_the_same_bits() {
        fn check(law: impl Material) {
            let points: Vec<[f64; 17]> = (0..4096)
                .map(|i| {
                    let g = |k: usize| ((i * 17 + k) as f64 * 0.618_033_988_75).fract();
                    let amplitude = [1e-4, 3e-3, 0.05, 0.4][(g(12) * 4.0) as usize];
                    std::array::from_fn(|k| match k {
                        0..9 => f64::from(u8::from(k % 4 == 0)) + amplitude * (g(k) - 0.5),
                        9 => {
                            if g(13) < 0.3 {
                                0.0
                            } else {
                                g(14)
                            }
                        }
                        10 => 200.0 + 1300.0 * g(15),
                        _ => 10f64.powf(-12.0 + 8.0 * g(16)),
                    })
                })
                .collect();
            let [mut single, mut wide, mut avx2] = [(); 3].map(|()| vec![[0.0; 19]; points.len()]);
            Points(law, &points, &mut single).run::<f64>(());
            vectorised(Points(law, &points, &mut wide));
            assert!(single.iter().flatten().all(|x| x.is_finite()));
            let flown = single.iter().filter(|s| s[17] > 0.0).count();
            println!("{flown} of {} points flow", points.len());
            assert!(500 < flown && flown < 3900);
            let bits = |all: &[[f64; 19]]| -> Vec<u64> {
                all.iter().flatten().map(|x| x.to_bits()).collect()
            };
            assert!(bits(&single) == bits(&wide));
            #[cfg(target_arch = "x86_64")]
            if crate::lane::on_avx2(Points(law, &points, &mut avx2)).is_some() {
                assert!(bits(&single) == bits(&avx2));
            }
        }
        check(copper(linear(4e8, 1e8)));
        check(copper(SATURATING));
        check(Hencky::<JohnsonCook> {
            moduli: copper(SATURATING).moduli,
            surface: crate::material::johnson_cook::tests::COPPER,
        });
    }
}
