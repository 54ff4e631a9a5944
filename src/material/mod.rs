//! Constitutive laws at one point, as small `Copy` values written once over a lane.

mod hencky;
mod johnson_cook;
mod linear_elastic;
mod mooney_rivlin;
mod neo_hookean;
mod thermal;
mod von_mises;

pub use hencky::Hencky;
pub use johnson_cook::JohnsonCook;
pub use linear_elastic::LinearElastic;
pub use mooney_rivlin::MooneyRivlin;
pub use neo_hookean::NeoHookean;
pub use thermal::Thermal;
pub use von_mises::VonMises;

use crate::lane::Precise;
use crate::math::{Mat3, cofactor, dot, largest_eigenvalue, mat_mul_t, scale9};

/// History of one particle: the inverse plastic right Cauchy-Green tensor C_p^-1 (initial
/// configuration; xx, yy, zz, xy, xz, yz) and the equivalent plastic strain.
pub type History<T> = [T; 7];

/// History of a virgin particle.
pub const VIRGIN: History<f64> = [1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0];

/// A law at one point: energy W(F, H, J), and plastic flow where it has a history.
pub trait Material: Copy + Send + Sync {
    /// Whether particles carry a [`History`]; without it none is stored.
    const HISTORY: bool = false;
    /// Whether the law is the linearised one, which knows no rotation: its temperature is linear in
    /// the entropy ([URL23] 7.1).
    const LINEAR: bool = false;
    /// Density rho_R [kg/m^3], initial.
    fn density(&self) -> f64;
    /// Speed of pressure waves of the linearised law [m/s], sqrt((lambda + 2 mu)/rho_R).
    fn pressure_wave_speed(&self) -> f64;
    /// Speed of shear waves of the linearised law [m/s], sqrt(mu/rho_R).
    fn shear_wave_speed(&self) -> f64;
    /// Stress and energy at one point.
    ///
    /// With `FLOW` the history, which holds that of the step's start, is mapped to the end of
    /// `elapsed` [s] at the temperature `theta` [K]; without it the history is frozen and the
    /// response elastic.
    fn stress<T: Precise, const FLOW: bool>(
        &self,
        d: &Deformation<T>,
        theta: T,
        history: &mut History<T>,
        elapsed: T,
    ) -> Stress<T>;
}

/// Smallest stretch of F: 1/lambda^2 is the largest eigenvalue of F^-T F^-1. A hyperelastic body's
/// fastest wave crosses a pair as if the pair were shorter by this factor ([URL22] 63).
#[inline(always)]
fn smallest_stretch<T: Precise>(f: &Mat3<T>) -> T {
    let cof = cofactor(f);
    dot(f[0], cof[0]) / largest_eigenvalue(&mat_mul_t(&cof, &cof)).sqrt()
}

/// Total deformation of one point: initial to current.
#[derive(Clone, Copy, Debug)]
pub struct Deformation<T> {
    /// F = f F_chi.
    pub f: Mat3<T>,
    /// H = h H_chi.
    pub h: Mat3<T>,
    /// J = j J_chi.
    pub j: T,
}

/// What a law gives at one point.
#[derive(Clone, Copy)]
pub struct Stress<T> {
    /// P = Sigma_F + Sigma_H x F + Sigma_J H [Pa] ([URL22] 6).
    pub p: Mat3<T>,
    /// Sigma_J = dW/dJ [Pa].
    pub sigma_j: T,
    /// W [J/m^3], per unit initial volume.
    pub energy: T,
    /// Plastic work of this flow [J/m^3], per unit initial volume.
    pub dissipation: T,
    /// What divides the linear wave speed: the smallest stretch of a hyperelastic law.
    pub stretch: T,
}

/// Elastic constants of the linearised law.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moduli {
    /// Shear modulus mu [Pa].
    pub mu: f64,
    /// Bulk modulus kappa [Pa].
    pub kappa: f64,
    /// Density rho_R [kg/m^3].
    pub rho: f64,
}

impl Moduli {
    /// From Young's modulus [Pa] and Poisson's ratio.
    pub fn new(youngs_modulus: f64, poisson_ratio: f64, rho: f64) -> Self {
        Self {
            mu: youngs_modulus / (2.0 * (1.0 + poisson_ratio)),
            kappa: youngs_modulus / (3.0 * (1.0 - 2.0 * poisson_ratio)),
            rho,
        }
    }
    /// The same with a smaller bulk modulus.
    fn softened(self, by: f64) -> Self {
        Self {
            kappa: self.kappa - by,
            ..self
        }
    }
    fn pressure_wave_speed(&self) -> f64 {
        ((self.kappa + 4.0 / 3.0 * self.mu) / self.rho).sqrt()
    }
    fn shear_wave_speed(&self) -> f64 {
        (self.mu / self.rho).sqrt()
    }
}

/// The laws that a scene can name. Matched once per body and stage, outside the particle loop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Law {
    /// Neo-Hookean.
    NeoHookean(NeoHookean),
    /// Mooney-Rivlin.
    MooneyRivlin(MooneyRivlin),
    /// Linear elasticity.
    LinearElastic(LinearElastic),
    /// Hencky's elasticity with von Mises plasticity.
    VonMises(Hencky<VonMises>),
    /// Hencky's elasticity with Johnson and Cook's plasticity.
    JohnsonCook(Hencky<JohnsonCook>),
}

/// Runs an expression with the scene's law bound to a name.
macro_rules! with_law {
    ($law:expr, $name:ident => $body:expr) => {
        match $law {
            $crate::material::Law::NeoHookean($name) => $body,
            $crate::material::Law::MooneyRivlin($name) => $body,
            $crate::material::Law::LinearElastic($name) => $body,
            $crate::material::Law::VonMises($name) => $body,
            $crate::material::Law::JohnsonCook($name) => $body,
        }
    };
}
pub(crate) use with_law;

impl Law {
    /// The law of a scene's body, and its thermodynamics if it has heat. The moduli of the scene are
    /// the isothermal ones at rest, so a law leaves out what the thermal pressure adds to them.
    pub fn of(scene: &crate::scene::Scene) -> (Self, Option<Thermal>) {
        let law = Self::new(&scene.material, 0.0);
        match &scene.heat {
            None => (law, None),
            Some(heat) => {
                let softening = Thermal::new(heat, &law).softening();
                let law = Self::new(&scene.material, softening);
                (law, Some(Thermal::new(heat, &law)))
            }
        }
    }
    fn new(material: &crate::scene::Material, softening: f64) -> Self {
        use crate::scene::Material as M;
        let (_, [density, youngs_modulus, poisson_ratio]) = material.elastic();
        let moduli = Moduli::new(youngs_modulus, poisson_ratio, density).softened(softening);
        match material {
            M::NeoHookean(_) => Law::NeoHookean(NeoHookean(moduli)),
            M::MooneyRivlin(m) => Law::MooneyRivlin(MooneyRivlin::new(moduli, m.area_share)),
            M::LinearElastic(_) => Law::LinearElastic(LinearElastic(moduli)),
            M::VonMises(m) => Law::VonMises(Hencky {
                moduli,
                surface: VonMises::new(m),
            }),
            M::JohnsonCook(m) => Law::JohnsonCook(Hencky {
                moduli,
                surface: JohnsonCook::new(m),
            }),
        }
    }
    /// Density rho_R [kg/m^3].
    pub fn density(&self) -> f64 {
        with_law!(*self, law => law.density())
    }
    /// Modulus of pressure waves at rest [Pa].
    pub fn wave_modulus(&self) -> f64 {
        with_law!(*self, law => law.density() * law.pressure_wave_speed().powi(2))
    }
    /// See [`Material::LINEAR`].
    pub fn is_linear(&self) -> bool {
        fn of<M: Material>(_: M) -> bool {
            M::LINEAR
        }
        with_law!(*self, law => of(law))
    }
    /// Whether particles carry a history.
    pub fn has_history(&self) -> bool {
        fn of<M: Material>(_: M) -> bool {
            M::HISTORY
        }
        with_law!(*self, law => of(law))
    }
    /// Stresses and energy at one point of a committed history; with heat at an entropy.
    pub fn at(
        &self,
        d: &Deformation<f64>,
        history: &History<f64>,
        heat: Option<(Thermal, f64)>,
    ) -> Point {
        let warmth = heat.map(|(thermal, eta)| (thermal, thermal.warmth(d, eta)));
        let theta = warmth.map_or(0.0, |(_, w)| w.theta);
        let mut history = *history;
        let mut stress =
            with_law!(*self, law => law.stress::<f64, false>(d, theta, &mut history, 0.0));
        if let Some((thermal, w)) = warmth {
            thermal.couple(d, &w, &mut stress);
        }
        Point {
            first_piola: stress.p,
            cauchy: scale9(1.0 / d.j, &mat_mul_t(&stress.p, &d.f)),
            energy: stress.energy,
        }
    }
}

/// Stresses and energy of one point, for output.
#[derive(Clone, Copy, Debug)]
pub struct Point {
    /// P [Pa].
    pub first_piola: Mat3<f64>,
    /// sigma = P F^T / J [Pa].
    pub cauchy: Mat3<f64>,
    /// W [J/m^3].
    pub energy: f64,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::*;

    /// P = dW/dF, zero stress and the linear moduli at rest, objectivity.
    fn check(law: impl Material, moduli: Moduli) {
        let all = |f: &Mat3<f64>| {
            let h = cofactor(f);
            let d = Deformation {
                f: *f,
                h,
                j: dot(f[0], h[0]),
            };
            law.stress::<f64, false>(&d, 0.0, &mut VIRGIN.clone(), 0.0)
        };
        let rest = all(&IDENTITY);
        assert!(double_dot(&rest.p, &rest.p).sqrt() < 1e-9 * moduli.mu);
        assert!(rest.energy.abs() < 1e-9 * moduli.mu);
        let f = [[1.2, 0.3, -0.1], [0.05, 0.8, 0.2], [-0.2, 0.1, 1.1]];
        let stress = all(&f);
        let mut worst: f64 = 0.0;
        for r in 0..3 {
            for c in 0..3 {
                let energy = |e: f64| {
                    let mut g = f;
                    g[r][c] += e;
                    all(&g).energy
                };
                let slope = (energy(1e-6) - energy(-1e-6)) / 2e-6;
                worst = worst.max((slope - stress.p[r][c]).abs() / moduli.mu);
            }
        }
        println!("P - dW/dF over mu: {worst:e} (tolerance 1e-7)");
        assert!(worst < 1e-7);
        let e = 1e-6;
        let shear = all(&[[1.0, e, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]).p[0][1] / e;
        assert!((shear / moduli.mu - 1.0).abs() < 1e-5);
        let volume = all(&[
            [1.0 + e, 0.0, 0.0],
            [0.0, 1.0 + e, 0.0],
            [0.0, 0.0, 1.0 + e],
        ]);
        let pressure = (volume.p[0][0] + volume.p[1][1] + volume.p[2][2]) / 3.0;
        assert!((pressure / (3.0 * e) / moduli.kappa - 1.0).abs() < 1e-4);
        let turn = [[0.6, -0.8, 0.0], [0.8, 0.6, 0.0], [0.0, 0.0, 1.0]];
        let turned = all(&mat_mul(&turn, &f));
        let expected = mat_mul(&turn, &stress.p);
        for r in 0..3 {
            for c in 0..3 {
                assert!((turned.p[r][c] - expected[r][c]).abs() < 1e-12 * moduli.kappa);
            }
        }
    }

    #[test]
    fn laws_are_consistent() {
        let moduli = Moduli::new(1.7e7, 0.3, 1100.0);
        check(NeoHookean(moduli), moduli);
        for share in [0.0, 0.5, 1.0] {
            check(MooneyRivlin::new(moduli, share), moduli);
        }
        let surface = VonMises {
            yield_stress: 1e9,
            hardening_modulus: 0.0,
            saturation: 0.0,
            saturation_exponent: 0.0,
        };
        check(Hencky { moduli, surface }, moduli);
    }
}
