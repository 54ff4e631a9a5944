//! Rate-independent von Mises plasticity with linear and saturation hardening ([URL22] tables 3, 4).

use super::hencky::{Flow, Trial, Yield};
use crate::lane::Precise;

/// tau_y = tau_0 + H e + (tau_inf - tau_0) (1 - exp(-delta e)) of the equivalent plastic strain e.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VonMises {
    /// tau_0 [Pa].
    pub yield_stress: f64,
    /// H [Pa]; 0 with no saturation is perfect plasticity.
    pub hardening_modulus: f64,
    /// tau_inf - tau_0 [Pa], not negative.
    pub saturation: f64,
    /// delta.
    pub saturation_exponent: f64,
}

impl VonMises {
    /// The yield surface of a scene.
    pub fn new(m: &crate::scene::VonMises) -> Self {
        Self {
            yield_stress: m.yield_stress,
            hardening_modulus: m.hardening_modulus,
            saturation: m.saturation_stress.map_or(0.0, |s| s - m.yield_stress),
            saturation_exponent: m.saturation_exponent.unwrap_or(0.0),
        }
    }

    /// Yield stress and its slope.
    #[inline(always)]
    fn at<T: Precise>(&self, strain: T) -> (T, T) {
        let (mut stress, mut slope) = (
            strain.mul_add(
                strain.of(self.hardening_modulus),
                strain.of(self.yield_stress),
            ),
            strain.of(self.hardening_modulus),
        );
        if self.saturation > 0.0 {
            let left = (strain * strain.of(-self.saturation_exponent)).exp();
            stress = stress + (strain.of(1.0) - left) * strain.of(self.saturation);
            slope = left.mul_add(strain.of(self.saturation * self.saturation_exponent), slope);
        }
        (stress, slope)
    }
}

impl Yield for VonMises {
    /// Newton's iteration for R(x) = q - 3 mu x - tau_y(e + x). R falls and is convex, so from R(0) > 0
    /// the iterates rise to the root without passing it; for linear hardening the first is the root.
    #[inline(always)]
    fn flow<T: Precise>(&self, trial: &Trial<T>) -> Flow<T> {
        // Round-off of R is a few units of q's; a step below it would not end.
        const TOLERANCE: f64 = 1e-14;
        let Trial {
            von_mises,
            three_mu,
            strain,
            ..
        } = *trial;
        let (start, slope) = self.at(strain);
        let over = von_mises - start;
        if !over.any_positive() {
            return Flow::none(von_mises.token());
        }
        let zero = von_mises.of(0.0);
        let mut increment = over.if_positive(over / (three_mu + slope), zero);
        let (mut end, mut slope) = self.at(strain + increment);
        if self.saturation > 0.0 {
            for _ in 0..100 {
                let residual = (-three_mu).mul_add(increment, von_mises) - end;
                let open = residual - von_mises.of(TOLERANCE) * von_mises;
                if !open.any_positive() {
                    break;
                }
                let next = increment + residual / (three_mu + slope);
                increment = open.if_positive(next, increment);
                (end, slope) = self.at(strain + increment);
            }
        }
        Flow {
            increment,
            work: over.if_positive(von_mises.of(0.5) * (start + end) * increment, zero),
        }
    }
}
