//! Columns against the references of `examples/*/expected.csv`: probe histories, twist angles,
//! phase and amplitude.

use urlsph::Simulation;

use crate::cases::columns::{BENDING, Column, History, TENSION, TWISTING};
use crate::support::*;

/// The signals of one model to `end`.
fn record(
    case: &Column,
    model: Model,
    end: f64,
    overrides: &[&str],
    after: impl FnMut(&Simulation),
) -> History {
    let mut simulation = column(case.name, model, overrides);
    case.history(&mut simulation, &mut Meter::default(), end, after)
        .unwrap_or_else(|e| panic!("{} {}: {e}", case.name, model.0))
}

/// The extremum of every stretch between sign changes, refined by a parabola; a last stretch counts
/// only if its extremum lies inside.
fn extrema(samples: impl Iterator<Item = (f64, f64)>) -> Vec<(f64, f64)> {
    let samples: Vec<_> = samples.filter(|s| s.0 > 0.0).collect();
    let mut found = Vec::new();
    for stretch in samples.chunk_by(|a, b| (a.1 > 0.0) == (b.1 > 0.0)) {
        let sizes = stretch.iter().enumerate();
        let Some((i, _)) = sizes.max_by(|a, b| a.1.1.abs().total_cmp(&b.1.1.abs())) else {
            continue;
        };
        if i == 0 || i + 1 == stretch.len() {
            continue;
        }
        found.push(parabola(stretch[i - 1], stretch[i], stretch[i + 1]));
    }
    found
}

/// Extremum of the parabola through three points.
fn parabola(a: (f64, f64), b: (f64, f64), c: (f64, f64)) -> (f64, f64) {
    let left = (b.1 - a.1) / (b.0 - a.0);
    let right = (c.1 - b.1) / (c.0 - b.0);
    let curvature = (right - left) / (c.0 - a.0);
    let time = 0.5 * (a.0 + b.0) - 0.5 * left / curvature;
    (
        time,
        a.1 + left * (time - a.0) + curvature * (time - a.0) * (time - b.0),
    )
}

/// Per group, the error of a model over the largest value of the reference, and the energy that the
/// scheme dissipated over the initial one.
pub fn errors(case: &Column, model: Model, overrides: &[&str]) -> (Vec<f64>, f64) {
    let mut dissipated = 0.0;
    let history = record(case, model, case.end, overrides, |s| {
        dissipated = dissipation_ratio(s);
    });
    let residuals = case.residuals(&history, &Table::expected(case.name));
    (residuals, dissipated)
}

/// M1 to M4 approach the reference; M3 and M4 within their tolerances, relative to its largest value.
fn converges(case: &Column, tolerances: [f64; 2]) {
    let reference = Table::expected(case.name);
    let models = [M1, M2, M3, M4];
    let residuals = models.map(|model| {
        let history = record(case, model, case.end, &[], |_| ());
        case.residuals(&history, &reference)
    });
    for (g, group) in case.groups.iter().enumerate() {
        let what = format!("{} {}", case.name, group[0].name);
        let found = [0, 1, 2, 3].map(|m| (models[m].1, residuals[m][g]));
        for (model, (_, residual)) in models.iter().zip(found) {
            println!("{what} {}: {residual:.3e} of the largest value", model.0);
        }
        println!(
            "{what}: observed order {:.2} (M1 to M2), {:.2} (M2 to M3), {:.2} (M3 to M4)",
            order(found[0], found[1]),
            order(found[1], found[2]),
            order(found[2], found[3]),
        );
        check(&format!("{what} M3"), found[2].1, tolerances[0]);
        check(&format!("{what} M4"), found[3].1, tolerances[1]);
        assert!(
            found.is_sorted_by(|a, b| a.1 > b.1),
            "{what}: errors fall with refinement: {found:?}"
        );
    }
}

/// How a history follows a reference r(t): value = amplitude r(t / (1 + lag)), fitted over all of it.
struct Fit {
    lag: f64,
    amplitude: f64,
    /// Root mean square of what remains, relative to that of the reference.
    rest: f64,
}

impl Fit {
    fn of(samples: &[(f64, f64)], reference: impl Fn(f64) -> f64, end: f64) -> Self {
        // The reference must reach as far as the stretched time does.
        let samples: Vec<_> = samples.iter().filter(|s| s.0 <= 0.9 * end).collect();
        let fit = |lag: f64| {
            let (mut rr, mut ur, mut uu) = (0.0, 0.0, 0.0);
            for (time, u) in &samples {
                let r = reference(time / (1.0 + lag));
                rr += r * r;
                ur += u * r;
                uu += u * u;
            }
            Self {
                lag,
                amplitude: ur / rr,
                rest: ((uu - ur * ur / rr).max(0.0) / rr).sqrt(),
            }
        };
        (-800..=800)
            .map(|i| fit(f64::from(i) * 1e-4))
            .min_by(|a, b| a.rest.total_cmp(&b.rest))
            .expect("some lag")
    }
}

/// Errors of phase and amplitude over the whole reference: fitted to all of it, and extremum by
/// extremum.
fn phase_and_amplitude(case: &Column, models: &[Model]) {
    let reference = Table::expected(case.name);
    let (signal, end) = (&case.groups[0][0], reference.end());
    let column = reference.column(signal.name);
    let expected = extrema(reference.samples(column));
    let (mut fits, mut rows) = (Vec::new(), Vec::new());
    for model in models {
        let history = record(case, *model, end, &[], |_| ());
        let samples: Vec<_> = history.0.iter().map(|row| (row[0], row[1])).collect();
        let fit = Fit::of(&samples, |time| reference.at(column, time), end);
        fits.push(format!(
            "| {} | {:+.2} % | {:+.2} % | {:.2} % |",
            model.0,
            100.0 * fit.lag,
            100.0 * (fit.amplitude - 1.0),
            100.0 * fit.rest,
        ));
        let found = extrema(samples.iter().copied());
        assert_eq!(
            found.len(),
            expected.len(),
            "extrema of {} {}",
            case.name,
            model.0
        );
        for (i, (found, expected)) in found.iter().zip(&expected).enumerate() {
            rows.push(format!(
                "| {} | {} | {:.4} | {:.4} | {:+.2} % | {:.4} | {:.4} | {:+.2} % |",
                model.0,
                i + 1,
                found.0,
                expected.0,
                100.0 * (found.0 / expected.0 - 1.0),
                found.1,
                expected.1,
                100.0 * (found.1 / expected.1 - 1.0),
            ));
        }
    }
    println!("\n### {}: `{}` over {end} s\n", case.name, signal.name);
    println!("| model | period too long by | amplitude too large by | rest (rms) |");
    println!("|---|---|---|---|\n{}\n", fits.join("\n"));
    println!("| model | extremum | time [s] | reference | error | value | reference | error |");
    println!("|---|---|---|---|---|---|---|---|\n{}\n", rows.join("\n"));
}

#[test]
fn bending_converges_to_the_reference() {
    converges(&BENDING, [0.02, 0.007]);
}

#[test]
fn tension_converges_to_the_reference() {
    converges(&TENSION, [0.02, 0.007]);
}

#[test]
fn twist_angle_converges_to_the_reference() {
    converges(&TWISTING, [0.03, 0.01]);
}

#[test]
#[ignore = "full histories: cargo xtask validate"]
fn phase_and_amplitude_over_the_full_histories() {
    for case in [&BENDING, &TENSION, &TWISTING] {
        phase_and_amplitude(case, &[M1, M2, M3, M4]);
    }
}
