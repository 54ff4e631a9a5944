//! Rate- and temperature-dependent plasticity of Johnson and Cook: [URL23] 41 and 42.

use super::hencky::{Flow, Trial, Yield};
use crate::lane::Precise;

/// tau_y = (tau_0 + H e^N) [1 + C ln(rate/rate_0)] (1 - g^M), g = (theta - theta_transition)/(theta_melt -
/// theta_transition) in [0, 1], of the equivalent plastic strain e.
///
/// The logarithm counts from the reference rate on ([URL23] 41 gives a negative yield stress at
/// rest): below it the yield stress does not depend on the rate. From the melting temperature on it is 0: the point
/// has no resistance to shear and flows fully.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JohnsonCook {
    /// tau_0 [Pa].
    pub yield_stress: f64,
    /// H [Pa].
    pub hardening_modulus: f64,
    /// N, above 0.
    pub hardening_exponent: f64,
    /// C.
    pub rate_coefficient: f64,
    /// rate_0 [1/s].
    pub reference_strain_rate: f64,
    /// M, above 0.
    pub softening_exponent: f64,
    /// theta_melt [K].
    pub melting_temperature: f64,
    /// theta_transition [K], below the melting temperature.
    pub transition_temperature: f64,
}

impl JohnsonCook {
    /// The yield surface of a scene.
    pub fn new(m: &crate::scene::JohnsonCook) -> Self {
        Self {
            yield_stress: m.yield_stress,
            hardening_modulus: m.hardening_modulus,
            hardening_exponent: m.hardening_exponent,
            rate_coefficient: m.rate_coefficient,
            reference_strain_rate: m.reference_strain_rate,
            softening_exponent: m.softening_exponent,
            melting_temperature: m.melting_temperature,
            transition_temperature: m.transition_temperature,
        }
    }

    /// 1 - g^M ([URL23] 42).
    #[inline(always)]
    fn softening<T: Precise>(&self, theta: T) -> T {
        let one = theta.of(1.0);
        let above = theta - theta.of(self.transition_temperature);
        if !above.any_positive() {
            return one;
        }
        let range = self.melting_temperature - self.transition_temperature;
        let g = (above / above.of(range)).min(one).max(above.of(0.0));
        one - g.powf(self.softening_exponent)
    }

    /// tau_0 + H e^N, and H e^N by itself.
    #[inline(always)]
    fn hardening<T: Precise>(&self, strain: T) -> (T, T) {
        let hardening = if self.hardening_modulus > 0.0 {
            strain.powf(self.hardening_exponent) * strain.of(self.hardening_modulus)
        } else {
            strain.of(0.0)
        };
        (strain.of(self.yield_stress) + hardening, hardening)
    }
}

impl Yield for JohnsonCook {
    /// Newton's iteration for R = q - 3 mu x - tau_y(e + x, x/elapsed, theta) in ln x instead of the
    /// (e + x)^N of [URL23] Algorithm 2.
    ///
    /// As functions of ln x, x and (e + x)^N are convex, and so is 1 + C max(ln(x/(rate_0 elapsed)),
    /// 0), kink included. All are positive and rise, so their product is convex, and R falls and is
    /// concave. The start x = (q - tau_y(e, 0))/(3 mu) is not below the root: from there the iterates
    /// fall to it without passing it. Where the rate prevails R is a line, and one step does.
    #[inline(always)]
    fn flow<T: Precise>(&self, trial: &Trial<T>) -> Flow<T> {
        // Round-off of R is a few units of q's; a step below it would not end.
        const TOLERANCE: f64 = 1e-14;
        let Trial {
            von_mises,
            three_mu,
            strain,
            theta,
            elapsed,
        } = *trial;
        let (zero, one) = (von_mises.of(0.0), von_mises.of(1.0));
        let softening = self.softening(theta);
        let (start, _) = self.hardening(strain);
        let over = von_mises - start * softening;
        if !over.any_positive() {
            return Flow::none(von_mises.token());
        }

        let most = over / three_mu;
        // The increment at the reference rate; no time at all is taken as a very short one.
        let slow = (elapsed * one.of(self.reference_strain_rate)).max(one.of(1e-300));
        let rate_at_most = (most / slow).ln();
        let (c, n) = (
            one.of(self.rate_coefficient),
            one.of(self.hardening_exponent),
        );
        // x = most exp(u)
        let (mut u, mut increment) = (zero, most);
        let (mut end, mut rate);
        let mut steps = 0;
        loop {
            let total = strain + increment;
            let power;
            (end, power) = self.hardening(total);
            let fast = rate_at_most + u;
            rate = c.mul_add(fast.max(zero), one);
            let elastic = three_mu * increment;
            let excess = (end * softening).mul_add(rate, elastic) - von_mises; // -R
            // Where 3 mu x is lost beside q, the stress has converged however R may vary.
            let open = (excess - one.of(TOLERANCE) * von_mises)
                .if_positive(elastic - one.of(1e-17) * von_mises, zero);
            if steps == 100 || !open.any_positive() {
                break;
            }
            let hardening_slope = n * power * rate * (increment / total);
            let rate_slope = fast.if_positive(c * end, zero);
            let slope = (hardening_slope + rate_slope).mul_add(softening, elastic);
            u = open.if_positive(u - excess / slope, u);
            increment = most * u.exp();
            steps += 1;
        }
        Flow {
            increment: over.if_positive(increment, zero),
            work: over.if_positive(
                one.of(0.5) * (start + end) * rate * softening * increment,
                zero,
            ),
        }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// [URL23] table 4.
    pub const COPPER: JohnsonCook = JohnsonCook {
        yield_stress: 90e6,
        hardening_modulus: 292e6,
        hardening_exponent: 0.31,
        rate_coefficient: 0.025,
        reference_strain_rate: 1.0,
        softening_exponent: 1.09,
        melting_temperature: 1356.2,
        transition_temperature: 298.15,
    };
    const THREE_MU: f64 = 138.8e9;

    /// Bisection on the definition: 200 halvings of ln x.
    fn bisected(law: &JohnsonCook, t: &Trial<f64>) -> f64 {
        let g = ((t.theta - law.transition_temperature)
            / (law.melting_temperature - law.transition_temperature))
            .clamp(0.0, 1.0);
        let yield_stress = |x: f64| {
            let rate = x / (t.elapsed * law.reference_strain_rate).max(1e-300);
            let rate = if rate > 1.0 { rate.ln() } else { 0.0 };
            (law.yield_stress + law.hardening_modulus * (t.strain + x).powf(law.hardening_exponent))
                * (1.0 + law.rate_coefficient * rate)
                * (1.0 - g.powf(law.softening_exponent))
        };
        if t.von_mises <= yield_stress(0.0) {
            return 0.0;
        }
        let (mut low, mut high) = (-800.0, (t.von_mises / t.three_mu).ln());
        for _ in 0..200 {
            let middle = 0.5 * (low + high);
            let x = f64::exp(middle);
            if t.von_mises - t.three_mu * x > yield_stress(x) {
                low = middle;
            } else {
                high = middle;
            }
        }
        low.exp()
    }

    #[test]
    fn increments_match_a_bisection_over_rates_and_temperatures() {
        let soft = |change: &dyn Fn(&mut JohnsonCook)| {
            let mut law = COPPER;
            change(&mut law);
            law
        };
        let melt = COPPER.melting_temperature;
        let mut worst: f64 = 0.0;
        let mut flows = 0;
        for law in [
            COPPER,
            soft(&|l| l.hardening_modulus = 0.0),
            soft(&|l| l.rate_coefficient = 0.0),
            soft(&|l| l.hardening_exponent = 1.0),
            soft(&|l| l.hardening_exponent = 0.02),
            soft(&|l| l.hardening_exponent = 2.0),
            soft(&|l| l.rate_coefficient = 1.0),
            soft(&|l| l.reference_strain_rate = 1e6),
            soft(&|l| l.yield_stress = 0.0),
            soft(&|l| (l.hardening_modulus, l.rate_coefficient) = (0.0, 0.0)),
        ] {
            for theta in [0.0, 298.15, 300.0, 800.0, 0.999 * melt, melt, 1.5 * melt] {
                for strain in [0.0, 1e-12, 1e-4, 0.3, 4.0] {
                    for elapsed in [0.0, 1e-15, 1e-9, 1e-4, 1e3] {
                        for von_mises in [0.0, 1e3, 8.99e7, 9.001e7, 1.5e8, 4e8, 3e9, 1e12] {
                            let trial = Trial {
                                von_mises,
                                three_mu: THREE_MU,
                                strain,
                                theta,
                                elapsed,
                            };
                            let Flow { increment, work } = law.flow(&trial);
                            let exact = bisected(&law, &trial);
                            let scale = von_mises / THREE_MU + f64::MIN_POSITIVE;
                            let error = (increment - exact).abs() / scale;
                            assert!(
                                error < 1e-11,
                                "{law:?} at {von_mises}, {strain}, {theta}, {elapsed}: {increment} for {exact}"
                            );
                            worst = worst.max(error);
                            assert!(work >= 0.0 && work.is_finite());
                            flows += usize::from(increment > 0.0);
                        }
                    }
                }
            }
        }
        println!("largest error of 3 mu x over q {worst:e} (tolerance 1e-11) in {flows} flows");
        assert!(flows > 5000);
    }

    #[test]
    fn the_limits_of_temperature_time_and_rate() {
        let flow = |von_mises, theta, elapsed| {
            COPPER.flow(&Trial {
                von_mises,
                three_mu: THREE_MU,
                strain: 0.1,
                theta,
                elapsed,
            })
        };
        let melt = COPPER.melting_temperature;
        for theta in [melt, 2.0 * melt] {
            let molten = flow(1e8, theta, 1e-8);
            assert!((molten.increment * THREE_MU / 1e8 - 1.0).abs() < 1e-15);
            assert_eq!(molten.work, 0.0);
        }
        // From below, the flow at melt is approached without a jump.
        let next = flow(1e8, melt * (1.0 - 1e-9), 1e-8).increment * THREE_MU / 1e8;
        println!("flow 1e-9 below melt: {next} of q (limit 1)");
        assert!((next - 1.0).abs() < 1e-7);
        // The shorter the time the less flows; at the reference rate and below time does not matter.
        let times = (0..40).map(|k| 10f64.powi(3 - k)).chain([1e-308, 0.0]);
        let increments: Vec<f64> = times.map(|t| flow(3e8, 300.0, t).increment).collect();
        println!(
            "flow in 1000 s {:e}, in no time {:e}",
            increments[0], increments[41]
        );
        assert!((increments[1] / increments[0] - 1.0).abs() < 1e-12);
        assert!(
            increments
                .windows(2)
                .all(|w| w[1] <= w[0] * (1.0 + 1e-11) + 1e-17)
        );
        assert!(increments[41] < 1e-15);
        // A temperature that is not set (0 K) does not soften.
        assert_eq!(
            flow(3e8, 0.0, 1e-8).increment,
            flow(3e8, 298.15, 1e-8).increment
        );
    }
}
