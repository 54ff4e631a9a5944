//! Neo-Hookean law: [URL22] eq. 5 with zeta = mu/2, xi = 0.

use super::{Deformation, History, Material, Moduli, Stress, smallest_stretch};
use crate::lane::Precise;
use crate::math::*;

/// W = mu/2 (J^(-2/3) F:F - 3) + kappa/2 (J - 1)^2.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NeoHookean(pub Moduli);

impl Material for NeoHookean {
    fn density(&self) -> f64 {
        self.0.rho
    }
    fn pressure_wave_speed(&self) -> f64 {
        self.0.pressure_wave_speed()
    }
    fn shear_wave_speed(&self) -> f64 {
        self.0.shear_wave_speed()
    }
    /// [URL22] eqs. 5 to 8.
    #[inline(always)]
    fn stress<T: Precise, const FLOW: bool>(
        &self,
        d: &Deformation<T>,
        _: T,
        _: &mut History<T>,
        _: T,
    ) -> Stress<T> {
        let Deformation { f, h, j } = d;
        let j = *j;
        let token = j.token();
        let (mu, kappa) = (T::splat(token, self.0.mu), T::splat(token, self.0.kappa));
        let j_third = j.inverse_cbrt();
        let j_two_thirds = j_third * j_third; // J^(-2/3)
        let ff = double_dot(f, f);
        let volumetric = j - T::splat(token, 1.0);
        let mu_j = mu * j_two_thirds;
        let sigma_j = kappa * volumetric - mu_j * ff / (T::splat(token, 3.0) * j);
        Stress {
            dissipation: T::splat(token, 0.0),
            stretch: smallest_stretch(f),
            p: axpy9(&scale9(mu_j, f), sigma_j, h),
            sigma_j,
            energy: T::splat(token, 0.5)
                * (mu * (j_two_thirds * ff - T::splat(token, 3.0))
                    + kappa * volumetric * volumetric),
        }
    }
}
