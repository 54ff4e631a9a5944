//! Thermodynamics at one point ([URL23] 3.2, 3.3), the same for every law: temperature from entropy
//! and volume, thermal pressure, thermal energy.

use super::{Deformation, Law, Stress};
use crate::lane::{Lane, Precise};
use crate::math::*;
use crate::scene::Heat;

/// Constants of a body that has a temperature.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Thermal {
    /// Specific heat c_v = rho_R C_v per unit initial volume [J/(m^3 K)].
    pub c_v: f64,
    /// Mie-Grueneisen coefficient Gamma_0.
    pub gamma: f64,
    /// Mie-Grueneisen exponent q, 0 (perfect gas) to 1 (solid).
    pub q: f64,
    /// Reference temperature theta_R [K].
    pub theta_r: f64,
    /// Conductivity h of the current configuration [W/(m K)].
    pub conductivity: f64,
    /// Share of the plastic work that becomes heat.
    pub plastic_share: f64,
    /// Linear thermo-elasticity: the temperature is linear in the entropy, and heat becomes entropy
    /// at the reference temperature.
    pub linear: bool,
    /// theta_R Gamma_0^2 c_v over the adiabatic wave modulus kappa + 4/3 mu + theta_R Gamma_0^2 c_v.
    pub adiabatic_share: f64,
}

/// Thermal state of one point.
#[derive(Clone, Copy)]
pub struct Warmth<T> {
    /// Temperature [K].
    pub theta: T,
    /// Its conduction variable [1/K]: heat flows as q = k theta^2 grad beta.
    pub beta: T,
    /// Thermal energy [J/m^3], per unit initial volume.
    pub energy: T,
    /// J^(q - 1).
    slope: T,
}

impl Thermal {
    /// The thermodynamics of a scene's body.
    pub fn new(heat: &Heat, law: &Law) -> Self {
        let mut this = Self {
            c_v: law.density() * heat.specific_heat,
            gamma: heat.gruneisen_coefficient,
            q: heat.gruneisen_exponent,
            theta_r: heat.reference_temperature,
            conductivity: heat.conductivity,
            plastic_share: heat.plastic_heat_fraction,
            linear: law.is_linear(),
            adiabatic_share: 0.0,
        };
        let adiabatic = this.adiabatic_stiffness();
        this.adiabatic_share = adiabatic / (adiabatic + law.wave_modulus() + this.softening());
        this
    }

    /// What adiabatic waves add to the isothermal wave modulus at rest [Pa].
    pub fn adiabatic_stiffness(&self) -> f64 {
        self.theta_r * self.gamma * self.gamma * self.c_v
    }

    /// What the thermal pressure adds to the isothermal bulk modulus at rest [Pa], so that the law
    /// itself has so much less ([URL23] 28): c_v theta_R Gamma_0 (1 - q).
    pub fn softening(&self) -> f64 {
        if self.linear {
            0.0
        } else {
            self.c_v * self.theta_r * self.gamma * (1.0 - self.q)
        }
    }

    /// J^q and J^(q-1).
    #[inline(always)]
    fn powers<T: Precise>(&self, j: T) -> (T, T) {
        let one = j.of(1.0);
        if self.q == 1.0 {
            (j, one)
        } else if self.q == 0.0 {
            (one, one / j)
        } else {
            let power = (j.ln() * j.of(self.q)).exp();
            (power, power / j)
        }
    }

    /// Entropy at the reference temperature over c_v, and J^(q-1): Gamma_0 (J^q - 1)/q ([URL23] 21),
    /// Gamma_0 tr(F - I) of the linear law.
    #[inline(always)]
    fn strain_entropy<T: Precise>(&self, d: &Deformation<T>) -> (T, T) {
        let gamma = d.j.of(self.gamma);
        if self.linear {
            let trace = d.f[0][0] + d.f[1][1] + d.f[2][2] - d.j.of(3.0);
            return (gamma * trace, d.j.of(1.0));
        }
        let (power, slope) = self.powers(d.j);
        let strain = if self.q == 0.0 {
            d.j.ln()
        } else {
            (power - d.j.of(1.0)) * d.j.of(1.0 / self.q)
        };
        (gamma * strain, slope)
    }

    /// Temperature and what follows from it, of the entropy eta per unit initial volume ([URL23] 19, 20).
    #[inline(always)]
    pub fn warmth<T: Precise>(&self, d: &Deformation<T>, eta: T) -> Warmth<T> {
        let (strain_entropy, slope) = self.strain_entropy(d);
        let (c_v, theta_r) = (eta.of(self.c_v), eta.of(self.theta_r));
        let warming = eta * eta.of(1.0 / self.c_v) - strain_entropy;
        if self.linear {
            // e = W + theta_R eta + theta_R (eta - eta_R)^2/(2 c_v): its derivatives are the
            // linear temperature and stress.
            let theta = theta_r * (eta.of(1.0) + warming);
            let half = eta.of(0.5 * self.c_v * self.theta_r);
            Warmth {
                theta,
                beta: -theta / (theta_r * theta_r),
                energy: half.mul_add(warming * warming, theta_r * eta),
                slope,
            }
        } else {
            let theta = theta_r * warming.exp();
            Warmth {
                theta,
                beta: eta.of(1.0) / theta,
                energy: c_v * (theta - theta_r),
                slope,
            }
        }
    }

    /// Entropy per unit initial volume at a temperature: the inverse of [`warmth`](Self::warmth).
    #[inline(always)]
    pub fn entropy<T: Precise>(&self, d: &Deformation<T>, theta: T) -> T {
        let (strain_entropy, _) = self.strain_entropy(d);
        let ratio = theta * theta.of(1.0 / self.theta_r);
        let warming = if self.linear {
            ratio - theta.of(1.0)
        } else {
            ratio.ln()
        };
        theta.of(self.c_v) * (warming + strain_entropy)
    }

    /// Adds the thermal stress, energy and stiffness to a law's: the pressure
    /// -c_v Gamma_0 (J^(q-1) theta - theta_R) ([URL23] 30 with its misprint mended) and
    /// c_v theta_R Gamma_0 (J - 1) of (27).
    #[inline(always)]
    pub fn couple<T: Precise>(&self, d: &Deformation<T>, w: &Warmth<T>, stress: &mut Stress<T>) {
        let one = d.j.of(1.0);
        let (theta_r, coupling) = (d.j.of(self.theta_r), d.j.of(self.c_v * self.gamma));
        let tension = -(coupling * w.slope.mul_add(w.theta, -theta_r));
        stress.sigma_j = stress.sigma_j + tension;
        if self.linear {
            for c in 0..3 {
                stress.p[c][c] = stress.p[c][c] + tension;
            }
        } else {
            stress.p = axpy9(&stress.p, tension, &d.h);
            stress.energy = (coupling * theta_r).mul_add(d.j - one, stress.energy);
            // theta d(J^(q-1))/dJ stiffens as theta Gamma_0^2 c_v J^(2 (q-1)): faster than the speed
            // at rest where the body is hot or, for q < 1, compressed.
            let ratio = w.theta * w.slope * w.slope * d.j.of(1.0 / self.theta_r);
            let excess = (ratio - one).max(d.j.of(0.0));
            let faster = excess.mul_add(d.j.of(self.adiabatic_share), one);
            stress.stretch = stress.stretch / faster.sqrt();
        }
    }

    /// Heat per unit initial volume [W/m^3] of a point whose temperature changes at a rate [K/s] and
    /// ln J at another [1/s]: theta d eta/dt.
    pub fn uptake(&self, d: &Deformation<f64>, theta: f64, rate: f64, dilation: f64) -> f64 {
        let coupling = if self.linear {
            self.theta_r
        } else {
            theta * self.powers(d.j).0
        };
        self.c_v * (rate + self.gamma * coupling * dilation)
    }

    /// The part of a plastic work [J/m^3] that becomes heat.
    #[inline(always)]
    pub fn plastic_heat<T: Precise>(&self, work: T) -> T {
        work * work.of(self.plastic_share)
    }

    /// Entropy that a heat [J/m^3] makes of a point at constant deformation: exact, so that the
    /// thermal energy rises by just this heat.
    #[inline(always)]
    pub fn entropy_of_heat<T: Precise>(&self, theta: T, heat: T) -> T {
        if self.linear {
            heat * heat.of(1.0 / self.theta_r)
        } else {
            let c_v = heat.of(self.c_v);
            c_v * (heat.of(1.0) + heat / (c_v * theta)).ln()
        }
    }

    /// What divides a heat rate to give the rate of entropy: the temperature, or the reference
    /// temperature of the linear law.
    #[inline(always)]
    pub fn divisor<T: Lane>(&self, theta: T) -> T {
        if self.linear {
            theta.of(self.theta_r)
        } else {
            theta
        }
    }
}
