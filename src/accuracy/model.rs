//! The error model: order of convergence and errors from runs on several resolutions.
//!
//! With u_i - u = c(t) h_i^p the distance of two runs is C (h_i^p - h_j^p), and what is fitted to all
//! pairs is C and p, by least squares of the logarithms over p. The order comes from distances in the
//! root mean square over time, which single instants and the parity of the numbers of cells trouble
//! less than the largest distance; the error comes from the largest distance to the finest run, over the
//! longest base, so that it depends on the order as little as possible:
//!
//! ```text
//! E_n = d_mn / ((h_m/h_n)^p - 1)        E_k = d_kn / (1 - (h_n/h_k)^p)
//! ```
//!
//! How far the order is uncertain is seen from fits that leave one run out (a jackknife), and a margin is
//! added on both sides. The scheme is of second order where the solution is smooth: an order observed
//! above it is a sign of coarse runs, so that it lowers the lower end of the order as well, and counts as 2
//! for the best estimate. That, and the factor of safety on what remains, follow L. Eca, M. Hoekstra: A
//! procedure for the estimation of the numerical uncertainty of CFD calculations based on grid
//! refinement studies, J. Comput. Phys. 262 (2014) 104-130, and P. J. Roache: Verification and
//! Validation in Computational Science and Engineering (1998), whose factor for three grids it is.
//!
//! The margins and bounds below were settled on 21 histories of the examples with reference solutions,
//! each with 4 to 9 resolutions: of 354 bands that no bound rejects, 346 hold the true error, and half of
//! them are narrower than a factor of 1.8.

use serde::Serialize;

use super::quantity::Series;

/// A value with the band that it lies in.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Band {
    /// Lower end.
    pub low: f64,
    /// Best estimate.
    pub best: f64,
    /// Upper end.
    pub high: f64,
}

/// Whether the errors can be told.
#[derive(Debug, Clone, PartialEq)]
pub enum Verdict {
    /// In the asymptotic range: the differences follow one order.
    Asymptotic,
    /// The runs differ by much less than the tolerance, whatever their order is: the errors are bounds.
    Close,
    /// Not told, and why.
    Unsettled(String),
}

/// What runs on several resolutions tell about their errors.
#[derive(Debug, Clone, PartialEq)]
pub struct Fit {
    /// Whether the errors can be told.
    pub verdict: Verdict,
    /// Observed order of convergence.
    pub order: Band,
    /// Scatter of the differences about that order: root mean square of their relative deviations.
    pub scatter: f64,
    /// Relative errors of the runs, in their order.
    pub errors: Vec<Band>,
    sizes: Vec<f64>,
}

impl Band {
    /// Upper end over lower end.
    pub fn ratio(&self) -> f64 {
        self.high / self.low
    }
    fn scaled(self, factors: [f64; 3]) -> Self {
        let [low, best, high] = factors;
        Self {
            low: self.low * low,
            best: self.best * best,
            high: self.high * high,
        }
    }
}

/// Order of the scheme for smooth solutions.
const FORMAL_ORDER: f64 = 2.0;
/// Orders among which the best is sought.
const ORDERS: (f64, f64) = (0.3, 4.0);
const ORDER_STEP: f64 = 0.02;
/// Runs that are fitted: the finest ones.
const FITTED: usize = 4;
/// A base shorter than this ratio of sizes makes more of the order's uncertainty than it need.
const BASE: f64 = 1.6;
/// Added to the uncertainty of the order.
const ORDER_MARGIN: f64 = 0.25;
/// Roache's factor of safety for three grids and more.
const SAFETY: f64 = 1.25;
/// Orders observed below the first are those of a solution that does not converge, above the second of
/// one that does not yet.
const PLAUSIBLE: (f64, f64) = (0.6, 2.6);
/// A band wider than this ratio tells too little.
const WIDEST: f64 = 4.0;
/// With an order of 0.5 and sizes that differ by a factor of 2, the error is below 3.5 times the
/// difference of the runs.
const CLOSE: f64 = 5.0;
/// Relative differences below it are round-off.
const ROUND_OFF: f64 = 1e-12;

impl Fit {
    /// Runs that a fit needs.
    pub const FEWEST: usize = FITTED;

    /// The fit of runs from coarse to fine, by size of the cells and series; `tolerance` decides what is
    /// [close](Verdict::Close). At least [`FEWEST`](Self::FEWEST) of them; their rows are at the same
    /// instants.
    pub fn new(runs: &[(f64, &Series)], tolerance: f64) -> Self {
        let finest = runs.len() - 1;
        let scale = runs[finest].1.size();
        let sizes: Vec<f64> = runs.iter().map(|(size, _)| *size).collect();
        let to_finest = |k: usize| runs[k].1.distance(runs[finest].1).0 / scale;
        let distances: Vec<f64> = (0..finest).map(to_finest).collect();
        let window: Vec<usize> = (runs.len().saturating_sub(FITTED)..runs.len()).collect();

        let widest = window[..window.len() - 1]
            .iter()
            .fold(0.0, |m: f64, &k| m.max(distances[k]));
        if scale > 0.0 && widest <= ROUND_OFF {
            return Self::close(sizes, &distances, widest);
        }
        let mut unsettled = None;
        if !(scale > 0.0 && scale.is_finite()) {
            unsettled = Some("it is zero all the time".to_owned());
        }
        let pairs: Vec<Pair> = pairs(&window)
            .map(|(i, j)| Pair {
                runs: (i, j),
                distance: runs[i].1.distance(runs[j].1).1,
            })
            .collect();
        if unsettled.is_none()
            && pairs
                .iter()
                .any(|p| !(p.distance > 0.0 && p.distance.is_finite()))
        {
            unsettled = Some("two of the runs do not differ, and others do".to_owned());
        }
        if let Some(why) = unsettled {
            let none = Band {
                low: 0.0,
                best: 0.0,
                high: f64::INFINITY,
            };
            return Self {
                verdict: Verdict::Unsettled(why),
                order: none,
                scatter: f64::INFINITY,
                errors: vec![none; runs.len()],
                sizes,
            };
        }

        let (observed, scatter) = least_squares(&pairs, &sizes);
        let without = window[..window.len() - 1].iter().map(|left_out| {
            let rest: Vec<Pair> = pairs
                .iter()
                .filter(|p| p.runs.0 != *left_out && p.runs.1 != *left_out)
                .cloned()
                .collect();
            least_squares(&rest, &sizes).0
        });
        let (lowest, highest) = without.fold((observed, observed), |(low, high), order| {
            (low.min(order), high.max(order))
        });
        let order = order_band(observed, lowest, highest);
        let errors = errors(&sizes, &distances, order);
        let mut fit = Self {
            verdict: Verdict::Asymptotic,
            order,
            scatter,
            errors,
            sizes,
        };
        if let Some(why) = doubt(observed, &distances[window[0]..]) {
            if CLOSE * widest <= tolerance {
                return Self::close(fit.sizes, &distances, widest);
            }
            fit.verdict = Verdict::Unsettled(why);
        }
        fit
    }

    /// Whether the error of a run is known well enough: its band is no wider than a factor of 4, or it is
    /// a bound far below the tolerance.
    pub fn knows(&self, run: usize) -> bool {
        match self.verdict {
            Verdict::Asymptotic => self.errors[run].ratio() <= WIDEST,
            Verdict::Close => true,
            Verdict::Unsettled(_) => false,
        }
    }

    /// Runs that hardly differ: bounds of their errors without an order.
    fn close(sizes: Vec<f64>, distances: &[f64], widest: f64) -> Self {
        let bound = |distance: f64| Band {
            low: 0.0,
            best: distance.max(widest),
            high: distance + (CLOSE - 1.0) * widest,
        };
        let errors = distances.iter().map(|d| bound(*d)).chain([bound(widest)]);
        Self {
            verdict: Verdict::Close,
            order: Band {
                low: 0.5,
                best: FORMAL_ORDER,
                high: FORMAL_ORDER,
            },
            scatter: 0.0,
            errors: errors.collect(),
            sizes,
        }
    }

    /// The error of a run with cells of another size.
    pub fn predict(&self, size: f64) -> Band {
        let last = self.errors.len() - 1;
        let ratio = size / self.sizes[last];
        let Band { low, best, high } = self.order;
        // A higher order gives less error of finer cells, and more of coarser ones.
        let (low, high) = if ratio < 1.0 {
            (high, low)
        } else {
            (low, high)
        };
        self.errors[last].scaled([low, best, high].map(|p| ratio.powf(p)))
    }

    /// The size of the cells at which the upper end of the error is `error`.
    pub fn size_for(&self, error: f64) -> f64 {
        let last = self.errors.len() - 1;
        let factor = (error / self.errors[last].high).powf(1.0 / self.order.best);
        self.sizes[last] * factor
    }
}

/// Why runs with these distances to the finest, from coarse to fine, are not in the asymptotic range.
fn doubt(observed: f64, distances: &[f64]) -> Option<String> {
    let [.., before, last] = distances else {
        return Some("there are too few runs".to_owned());
    };
    if last > before {
        Some(format!(
            "the differences of the runs do not fall, from {} to {}",
            percent(*before),
            percent(*last)
        ))
    } else if observed < PLAUSIBLE.0 {
        Some(format!(
            "the differences of the runs fall too slowly, with order {observed:.1}"
        ))
    } else if observed > PLAUSIBLE.1 {
        Some(format!(
            "the differences of the runs fall with order {observed:.1}, faster than the scheme's \
             {FORMAL_ORDER}, so that they are still too coarse"
        ))
    } else {
        None
    }
}

/// Two runs and their distance.
#[derive(Debug, Clone)]
struct Pair {
    runs: (usize, usize),
    distance: f64,
}

fn pairs(window: &[usize]) -> impl Iterator<Item = (usize, usize)> + '_ {
    let later = |at: usize| window[at + 1..].iter().copied();
    (0..window.len()).flat_map(move |at| later(at).map(move |j| (window[at], j)))
}

/// The order that fits the distances best, and their scatter about it.
fn least_squares(pairs: &[Pair], sizes: &[f64]) -> (f64, f64) {
    let finest = sizes[sizes.len() - 1];
    let scatter = |order: f64| {
        let power = |run: usize| (sizes[run] / finest).powf(order);
        let deviations = pairs
            .iter()
            .map(|p| (p.distance / (power(p.runs.0) - power(p.runs.1))).ln());
        let count = pairs.len() as f64;
        let mean = deviations.clone().sum::<f64>() / count;
        (deviations.map(|d| (d - mean).powi(2)).sum::<f64>() / count).sqrt()
    };
    let steps = ((ORDERS.1 - ORDERS.0) / ORDER_STEP).round() as u32;
    (0..=steps)
        .map(|k| ORDERS.0 + f64::from(k) * ORDER_STEP)
        .map(|order| (order, scatter(order)))
        .min_by(|a, b| a.1.total_cmp(&b.1))
        .expect("there are orders to choose from")
}

/// The order for the errors, from the observed one and the range that the jackknife gives it.
fn order_band(observed: f64, lowest: f64, highest: f64) -> Band {
    /// Above it an order counts as higher than the scheme's and not as that with scatter.
    const HIGHER: f64 = FORMAL_ORDER + 0.15;
    /// As far as an order is above the scheme's, half of that it may be below.
    const MIRRORED: f64 = 0.5;
    let mirrored = FORMAL_ORDER - MIRRORED * (highest - FORMAL_ORDER);
    let low = (lowest.min(mirrored) - ORDER_MARGIN).max(0.4);
    let high = if highest > HIGHER {
        highest.min(3.0)
    } else {
        (highest + ORDER_MARGIN).min(FORMAL_ORDER)
    };
    Band {
        low,
        best: observed.min(FORMAL_ORDER).max(low),
        high,
    }
}

/// Errors of all runs; `distances` are those to the finest.
fn errors(sizes: &[f64], distances: &[f64], order: Band) -> Vec<Band> {
    let finest = sizes.len() - 1;
    let ratio = |k: usize| sizes[k] / sizes[finest];
    let fitted = sizes.len().saturating_sub(FITTED)..finest;
    let mut bases: Vec<usize> = fitted.clone().filter(|&k| ratio(k) > BASE).collect();
    if bases.is_empty() {
        bases.push(fitted.start);
    }
    let from = |k: usize, p: f64| distances[k] / (ratio(k).powf(p) - 1.0);
    let most = |p: f64| bases.iter().fold(0.0, |m: f64, &k| m.max(from(k, p)));
    let least = |p: f64| {
        let errors = bases.iter().map(|&k| from(k, p));
        errors.fold(f64::INFINITY, f64::min)
    };
    // The longest base for the best estimate.
    let last = Band {
        low: least(order.high) / SAFETY,
        best: from(bases[0], order.best),
        high: most(order.low) * SAFETY,
    };
    let of = |k: usize| {
        let share = |p: f64| 1.0 / (1.0 - ratio(k).powf(-p));
        Band {
            low: distances[k] * share(order.high) / SAFETY,
            best: distances[k] * share(order.best),
            high: distances[k] * share(order.low) * SAFETY,
        }
    };
    (0..finest).map(of).chain([last]).collect()
}

/// A relative number in per cent with two digits.
pub(super) fn percent(value: f64) -> String {
    let value = 100.0 * value;
    if value == 0.0 || !value.is_finite() {
        return format!("{value} %");
    }
    let digits = (1 - value.abs().log10().floor() as i32).clamp(0, 9) as usize;
    format!("{value:.digits$} %")
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZES: [f64; 4] = [1.0, 0.7, 0.5, 0.35];
    const ROWS: usize = 200;

    fn exact(row: usize) -> f64 {
        (0.07 * row as f64).sin()
    }

    /// Series with an error that depends on the size of the cells and the row.
    fn series(error: impl Fn(f64, usize) -> f64, size: f64) -> Series {
        let values = (0..ROWS).map(|row| exact(row) + error(size, row));
        Series::new(1, values.collect(), false).unwrap()
    }

    /// The fit of sizes, and the true errors of the runs.
    fn fitted(sizes: &[f64], tolerance: f64, error: impl Fn(f64, usize) -> f64) -> (Fit, Vec<f64>) {
        let truth = series(|_, _| 0.0, 1.0);
        let all: Vec<Series> = sizes.iter().map(|&size| series(&error, size)).collect();
        let runs: Vec<(f64, &Series)> = sizes.iter().copied().zip(&all).collect();
        let errors = all.iter().map(|s| s.distance(&truth).0 / truth.size());
        (Fit::new(&runs, tolerance), errors.collect())
    }

    fn assert_inside(fit: &Fit, errors: &[f64]) {
        for (run, error) in errors.iter().enumerate() {
            let band = fit.errors[run];
            println!("{band:?} for {error:.3e}");
            assert!(band.low <= *error && *error <= band.high, "run {run}");
        }
    }

    /// The shape of an error over time.
    fn shape(row: usize) -> f64 {
        (0.11 * row as f64).cos() * row as f64 / ROWS as f64
    }

    #[test]
    fn clean_orders_are_found_and_errors_are_inside_narrow_bands() {
        for order in [1.0, 1.5, 2.0] {
            let (fit, errors) = fitted(&SIZES, 1e-9, |h, row| 0.1 * h.powf(order) * shape(row));
            assert_eq!(fit.verdict, Verdict::Asymptotic);
            assert!((fit.order.best - order).abs() < 0.03, "{:?}", fit.order);
            assert!(fit.scatter < 1e-2);
            assert_inside(&fit, &errors);
            let last = errors.len() - 1;
            assert!(fit.knows(last), "{:?}", fit.errors[last]);
            // The best estimate is the error itself, up to the scale that is taken from the finest run.
            let ratio = fit.errors[last].best / errors[last];
            assert!((0.9..1.1).contains(&ratio), "{ratio}");
            // What is predicted of finer cells holds.
            let finer = 0.1 * 0.2_f64.powf(order) * largest_shape();
            let band = fit.predict(0.2);
            assert!(band.low <= finer && finer <= band.high, "{band:?} {finer}");
            let size = fit.size_for(fit.errors[last].high / 2.0);
            assert!((fit.predict(size).best / (0.5 * fit.errors[last].best) - 1.0).abs() < 1e-9);
        }
    }

    fn largest_shape() -> f64 {
        (0..ROWS).map(|row| shape(row).abs()).fold(0.0, f64::max)
    }

    #[test]
    fn noise_and_parity_widen_the_bands_and_stay_inside() {
        // An error that is 15 % larger for every other run.
        let (fit, errors) = fitted(&SIZES, 1e-9, |h, row| {
            let odd = SIZES.iter().position(|s| *s == h).unwrap() % 2;
            0.1 * h * h * shape(row) * (1.0 + 0.15 * odd as f64)
        });
        assert_eq!(fit.verdict, Verdict::Asymptotic);
        assert_inside(&fit, &errors);
        // Short waves of a phase of their own in each run.
        let (fit, errors) = fitted(&SIZES, 1e-9, |h, row| {
            0.1 * h * h * (shape(row) + 0.05 * (row as f64 + 40.0 * h).sin())
        });
        assert_eq!(fit.verdict, Verdict::Asymptotic);
        assert_inside(&fit, &errors);
    }

    #[test]
    fn what_does_not_converge_is_not_settled() {
        let unsettled = |error: &dyn Fn(f64, usize) -> f64| {
            let (fit, _) = fitted(&SIZES, 1e-9, error);
            match fit.verdict {
                Verdict::Unsettled(why) => why,
                verdict => panic!("{verdict:?}"),
            }
        };
        // Differences that grow, that do what they like, and that fall faster than they can.
        let grows = |h: f64, row| 0.1 * shape(row) / h;
        assert!(unsettled(&grows).contains("too slowly"));
        let jumps = |h: f64, row| 0.1 * shape(row) * if h == 0.5 { 3.0 } else { h };
        assert!(unsettled(&jumps).contains("do not fall"));
        let coarse = |h: f64, row| 0.1 * h.powi(5) * shape(row);
        assert!(unsettled(&coarse).contains("too coarse"));
        // Logarithmic convergence.
        let slow = |h: f64, row| 0.1 * shape(row) / (4.0 - h.ln());
        assert!(unsettled(&slow).contains("too slowly"));
    }

    #[test]
    fn runs_that_agree_are_bounded_by_their_differences() {
        let (fit, errors) = fitted(&SIZES, 1e-9, |_, _| 0.0);
        assert_eq!(fit.verdict, Verdict::Close);
        assert_inside(&fit, &errors);
        // Round-off that no order describes, far below the tolerance.
        let (fit, errors) = fitted(&SIZES, 1e-3, |h, row| 1e-6 * (row as f64 / h).sin());
        assert_eq!(fit.verdict, Verdict::Close);
        assert!(fit.knows(0) && fit.errors[0].high < 1e-4);
        assert_inside(&fit, &errors[..3]);
    }

    #[test]
    fn nothing_to_compare_with_is_not_settled() {
        let zero = Series::new(1, vec![0.0; 5], false).unwrap();
        let nan = Series::new(1, vec![f64::NAN; 5], false).unwrap();
        for series in [zero, nan] {
            let fit = Fit::new(&SIZES.map(|size| (size, &series)), 0.5);
            assert!(matches!(fit.verdict, Verdict::Unsettled(_)), "{fit:?}");
        }
    }

    #[test]
    fn errors_read_as_per_cent_with_two_digits() {
        for (value, text) in [
            (0.02, "2.0 %"),
            (0.1234, "12 %"),
            (0.000123, "0.012 %"),
            (0.0, "0 %"),
        ] {
            assert_eq!(percent(value), text);
        }
    }
}
