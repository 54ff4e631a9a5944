//! Linear elasticity, for comparison with the exact solutions of small strains ([URL23] 7.1, 7.2).

use super::{Deformation, History, Material, Moduli, Stress};
use crate::lane::Precise;
use crate::math::*;

/// W = mu e:e + lambda/2 tr(e)^2 with e = sym(F - I); it knows no rotation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinearElastic(pub Moduli);

impl Material for LinearElastic {
    const LINEAR: bool = true;
    fn density(&self) -> f64 {
        self.0.rho
    }
    fn pressure_wave_speed(&self) -> f64 {
        self.0.pressure_wave_speed()
    }
    fn shear_wave_speed(&self) -> f64 {
        self.0.shear_wave_speed()
    }
    /// P = 2 mu e + lambda tr(e) I.
    #[inline(always)]
    fn stress<T: Precise, const FLOW: bool>(
        &self,
        d: &Deformation<T>,
        _: T,
        _: &mut History<T>,
        _: T,
    ) -> Stress<T> {
        let (f, one, half) = (&d.f, d.j.of(1.0), d.j.of(0.5));
        let e = [
            f[0][0] - one,
            f[1][1] - one,
            f[2][2] - one,
            half * (f[0][1] + f[1][0]),
            half * (f[0][2] + f[2][0]),
            half * (f[1][2] + f[2][1]),
        ];
        let volume = e[0] + e[1] + e[2];
        let pressure = one.of(self.0.kappa) * volume;
        let deviator = deviator(&e);
        let two_mu = one.of(2.0 * self.0.mu);
        let mut p = full(&scale_all(two_mu, &deviator));
        for k in 0..3 {
            p[k][k] = p[k][k] + pressure;
        }
        Stress {
            p,
            sigma_j: pressure,
            energy: half * (two_mu * square(&deviator) + pressure * volume),
            dissipation: one.of(0.0),
            stretch: one,
        }
    }
}
