//! Mooney-Rivlin law of [URL22] eqs. 5 to 8.

use super::{Deformation, History, Material, Moduli, Stress, smallest_stretch};
use crate::lane::Precise;
use crate::math::*;

/// W = zeta J^(-2/3) F:F + xi J^-2 (H:H)^(3/2) - 3 (zeta + sqrt(3) xi) + kappa/2 (J - 1)^2,
/// 2 zeta + 3 sqrt(3) xi = mu.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MooneyRivlin {
    moduli: Moduli,
    zeta: f64,
    xi: f64,
}

impl MooneyRivlin {
    /// `area_share` of the shear modulus is carried by the H term: 3 sqrt(3) xi = share mu.
    pub fn new(moduli: Moduli, area_share: f64) -> Self {
        Self {
            moduli,
            zeta: 0.5 * (1.0 - area_share) * moduli.mu,
            xi: area_share * moduli.mu / (3.0 * 3f64.sqrt()),
        }
    }
}

impl Material for MooneyRivlin {
    fn density(&self) -> f64 {
        self.moduli.rho
    }
    fn pressure_wave_speed(&self) -> f64 {
        self.moduli.pressure_wave_speed()
    }
    fn shear_wave_speed(&self) -> f64 {
        self.moduli.shear_wave_speed()
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
        let (zeta, xi, kappa) = (
            T::splat(token, self.zeta),
            T::splat(token, self.xi),
            T::splat(token, self.moduli.kappa),
        );
        let j_third = j.inverse_cbrt();
        let j_two_thirds = j_third * j_third; // J^(-2/3)
        let inverse_j = T::splat(token, 1.0) / j;
        let (ff, hh) = (double_dot(f, f), double_dot(h, h));
        let root_hh = hh.sqrt();
        let xi_j2 = xi * inverse_j * inverse_j;
        let volumetric = j - T::splat(token, 1.0);
        let sigma_f = scale9(T::splat(token, 2.0) * zeta * j_two_thirds, f);
        let sigma_h = scale9(T::splat(token, 3.0) * xi_j2 * root_hh, h);
        let distortion = T::splat(token, -2.0 / 3.0) * zeta * j_two_thirds * ff
            - T::splat(token, 2.0) * xi_j2 * hh * root_hh;
        let sigma_j = distortion.mul_add(inverse_j, kappa * volumetric);
        let rest = T::splat(token, 3.0 * (self.zeta + 3f64.sqrt() * self.xi));
        Stress {
            dissipation: T::splat(token, 0.0),
            stretch: smallest_stretch(f),
            p: axpy9(&add9(&sigma_f, &tensor_cross(&sigma_h, f)), sigma_j, h),
            sigma_j,
            energy: zeta * j_two_thirds * ff + xi_j2 * hh * root_hh - rest
                + T::splat(token, 0.5) * kappa * volumetric * volumetric,
        }
    }
}
