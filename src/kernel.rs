//! The quadratic kernel that [URL22] section 4.1 takes from Johnson, Stryk and Beissel (1996), and
//! its gradient.

use std::f64::consts::PI;

use crate::lane::Lane;

/// -(dW/dr)/r for W = a_d (3/16 q^2 - 3/4 q + 3/4), q = r/h in [0, 2], a_d = 5/(4 pi h^3).
///
/// The weight of a pair vector: grad W_b(X_a) = slope (X_b - X_a). Only the ratio between the
/// neighbours of a particle matters once the gradient is corrected ([URL22] 42).
///
/// Lanes with r = 0 give a value that is not finite: the caller masks them.
#[inline(always)]
pub fn slope<T: Lane>(r: T, h: T) -> T {
    let a = h.of(5.0 / (4.0 * PI)) / (h * h * h);
    let shape = (h.of(0.75) - h.of(0.375) * r / h) / (h * r);
    (a * shape).max(h.of(0.0))
}

#[cfg(test)]
mod tests {
    use super::slope;

    #[test]
    fn slope_is_the_derivative_of_the_normalised_kernel() {
        let h = 0.7_f64;
        let w = |r: f64| {
            let q: f64 = r / h;
            5.0 / (4.0 * std::f64::consts::PI * h * h * h) * (0.1875 * q * q - 0.75 * q + 0.75)
        };
        let n = 20_000;
        let dr = 2.0 * h / n as f64;
        let volume: f64 = (0..n)
            .map(|i| (i as f64 + 0.5) * dr)
            .map(|r| 4.0 * std::f64::consts::PI * r * r * w(r) * dr)
            .sum();
        println!("integral - 1 = {:e} (tolerance 1e-8)", volume - 1.0);
        assert!((volume - 1.0).abs() < 1e-8);
        for r in [0.1, 0.5, 0.9, 1.3] {
            let difference = -(w(r + 1e-6) - w(r - 1e-6)) / 2e-6 / r;
            assert!((difference / slope(r, h) - 1.0).abs() < 1e-6);
        }
        assert_eq!(slope(1.5, h), 0.0);
    }
}
