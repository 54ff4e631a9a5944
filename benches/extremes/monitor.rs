//! What tells a wrong run: energy or entropy out of nothing, a lost symmetry, a checkerboard.

use std::collections::HashMap;

use urlsph::{Energies, Field, Simulation};

use crate::common::field;
use crate::common::roughness::Roughness;
use crate::sweeps::Symmetry;

/// Energy stored that was neither there nor supplied, over what there was and was supplied.
const GROWTH: f64 = 1e-3;
/// Error of the ledger of all energies, over the same: what the integrator does to the shortest waves.
const LEDGER: f64 = 0.05;
/// Energy that a dissipation gave in one step, over the same: round-off of double and of single precision.
const GAIN: [f64; 2] = [1e-9, 1e-6];
/// Entropy that conduction or plastic flow took in one step, over all entropy produced.
const LOSS: f64 = 1e-9;
/// Difference of the images of particles over the largest displacement.
const ASYMMETRY: f64 = 1e-3;
/// Pressure that changes from particle to particle over all stress but the mean pressure.
const CHECKERBOARD: f64 = 0.5;

/// Follows a run.
pub struct Monitor {
    start: Energies,
    before: Energies,
    growth: f64,
    ledger: f64,
    gain: f64,
    loss: f64,
    images: Vec<(Symmetry, Vec<u32>)>,
    roughness: Option<Roughness>,
}

/// Findings at the end of a run.
#[derive(Debug, Clone, Copy)]
pub struct Findings {
    pub growth: f64,
    pub ledger: f64,
    pub gain: f64,
    pub loss: f64,
    pub asymmetry: f64,
    pub checkerboard: f64,
    pub least_j: f64,
    pub most_j: f64,
}

impl Monitor {
    pub fn new(simulation: &Simulation, symmetry: &[Symmetry], smooth: bool) -> Self {
        let start = simulation.energies();
        // Fits to the nearest of all particles: too many pairs in a large body.
        let few = smooth && simulation.particle_count() < 20_000;
        Self {
            start,
            before: start,
            growth: 0.0,
            ledger: 0.0,
            gain: 0.0,
            loss: 0.0,
            images: symmetry
                .iter()
                .map(|s| (*s, images(simulation, *s)))
                .collect(),
            roughness: few.then(|| Roughness::new(simulation)),
        }
    }

    /// After a step.
    pub fn look(&mut self, simulation: &Simulation) {
        let (now, before) = (simulation.energies(), self.before);
        let stored = |e: &Energies| e.kinetic + e.strain + e.thermal;
        let turned = |e: &Energies| e.kinetic + e.strain.abs();
        let start = &self.start;
        let supplied = turned(start) + now.external_work.abs() + now.heat_in.abs();
        let supplied = supplied.max(turned(&now));
        if supplied > 0.0 {
            // A support has worked at the start already, where it stops what moves.
            let own = |e: &Energies| stored(e) - e.external_work - e.heat_in;
            let grown = own(&now) - own(start);
            self.growth = larger(self.growth, grown / supplied);
            self.ledger = larger(self.ledger, now.closure_error.abs() / supplied);
            let given = before.numerical_dissipation - now.numerical_dissipation;
            self.gain = larger(self.gain, given / supplied);
        }
        let lost = before.entropy_production - now.entropy_production;
        if now.entropy_production != 0.0 {
            self.loss = larger(self.loss, lost / now.entropy_production.abs());
        }
        self.before = now;
    }

    /// At the end.
    pub fn findings(&self, simulation: &Simulation) -> Findings {
        let displacement = field(simulation, Field::Displacement);
        let largest = displacement.iter().fold(0.0_f64, |m, u| m.max(u.abs()));
        // A body that has not moved is symmetric.
        let scale = if largest == 0.0 { 1.0 } else { largest };
        let mut asymmetry = 0.0;
        for (signs, images) in &self.images {
            for (a, image) in images.iter().enumerate() {
                for c in 0..3 {
                    let (u, v) = (
                        displacement[3 * a + c],
                        displacement[3 * *image as usize + c],
                    );
                    asymmetry = larger(asymmetry, (signs[c] * u - v).abs() / scale);
                }
            }
        }
        let j = field(simulation, Field::Jacobian);
        let (least_j, most_j) = range(&j);
        Findings {
            growth: self.growth,
            ledger: self.ledger,
            gain: self.gain,
            loss: self.loss,
            asymmetry,
            checkerboard: self
                .roughness
                .as_ref()
                .map_or(0.0, |r| checkerboard(r, simulation)),
            least_j,
            most_j,
        }
    }
}

/// The larger value, or not a number if one of them is not.
fn larger(a: f64, b: f64) -> f64 {
    if b > a || b.is_nan() { b } else { a }
}

/// Whether a value is larger than its limit, or no number at all.
pub fn beyond(value: f64, limit: f64) -> bool {
    value.is_nan() || value > limit
}

impl Findings {
    /// Names of what was found to be wrong, in a run that is about noise or not, in single precision or not.
    pub fn wrong(&self, noise: bool, single: bool) -> Vec<&'static str> {
        let found = [
            ("energy growth", beyond(self.growth, GROWTH)),
            ("error of the ledger", !noise && beyond(self.ledger, LEDGER)),
            (
                "dissipation gives energy",
                beyond(self.gain, GAIN[usize::from(single)]),
            ),
            ("entropy falls", beyond(self.loss, LOSS)),
            ("symmetry lost", beyond(self.asymmetry, ASYMMETRY)),
            (
                "checkerboard",
                !noise && beyond(self.checkerboard, CHECKERBOARD),
            ),
            (
                "volume ratio",
                self.least_j.is_nan() || self.least_j <= 0.0 || !self.most_j.is_finite(),
            ),
        ];
        found
            .into_iter()
            .filter_map(|(name, is)| is.then_some(name))
            .collect()
    }
}

/// A pressure that changes from particle to particle, over all stress but the mean pressure.
fn checkerboard(roughness: &Roughness, simulation: &Simulation) -> f64 {
    let (rough, deviation) = roughness.parts(simulation);
    let mises = field(simulation, Field::VonMisesStress);
    let shear = roughness.mean(|a| mises[a] * mises[a]).sqrt();
    let pressure = field(simulation, Field::Pressure);
    let (low, high) = range(&pressure);
    // What is the same everywhere has no pattern but that of its round-off.
    let whole = deviation.hypot(shear).max(1e-6 * high.abs().max(low.abs()));
    if whole > 0.0 { rough / whole } else { 0.0 }
}

fn range(values: &[f64]) -> (f64, f64) {
    let start = (f64::INFINITY, f64::NEG_INFINITY);
    values.iter().fold(start, |(low, high), v| {
        (-larger(-low, -v), larger(high, *v))
    })
}

/// The particle that each is mapped to.
fn images(simulation: &Simulation, signs: Symmetry) -> Vec<u32> {
    let positions = field(simulation, Field::InitialPosition);
    let bounds: [(f64, f64); 3] = std::array::from_fn(|c| {
        let all: Vec<f64> = positions.iter().skip(c).step_by(3).copied().collect();
        range(&all)
    });
    let length = bounds
        .iter()
        .fold(0.0_f64, |m, (low, high)| m.max(high - low));
    let key = |point: [f64; 3]| point.map(|x| (x / length * 1e6).round() as i64);
    let mut index = HashMap::new();
    for (a, point) in positions.chunks_exact(3).enumerate() {
        index.insert(
            key(std::array::from_fn(|c| point[c] - bounds[c].0)),
            a as u32,
        );
    }
    let image = |point: &[f64]| {
        let point = std::array::from_fn(|c| {
            let (low, high) = bounds[c];
            if signs[c] < 0.0 {
                high - point[c]
            } else {
                point[c] - low
            }
        });
        *index.get(&key(point)).expect("the lattice is symmetric")
    };
    positions.chunks_exact(3).map(image).collect()
}
