//! How much a pressure changes from particle to particle.

use nalgebra::{Matrix4, Vector4};
use urlsph::{Field, Simulation};

use super::field;

/// What a linear field does not explain: the residual of a particle's pressure against the linear fit to
/// its nearest neighbours, over the deviation of the pressure from its mean, both in L2. A pressure that
/// alternates from particle to particle gives 1 and more, a smooth one the square of the spacing over its
/// wavelength.
pub struct Roughness {
    volumes: Vec<f64>,
    /// Neighbours and their weights in the fit's value at the particle.
    fits: Vec<Vec<(usize, f64)>>,
}

impl Roughness {
    const NEIGHBOURS: usize = 14;

    /// For the particles as they lie at the start.
    pub fn new(simulation: &Simulation) -> Self {
        let positions = field(simulation, Field::InitialPosition);
        let points: Vec<&[f64]> = positions.chunks_exact(3).collect();
        let fits = points.iter().map(|at| {
            let distance2 = |b: usize| (0..3).map(|c| (points[b][c] - at[c]).powi(2)).sum::<f64>();
            let mut near: Vec<(f64, usize)> =
                (0..points.len()).map(|b| (distance2(b), b)).collect();
            let most = Self::NEIGHBOURS.min(points.len() - 1);
            near.select_nth_unstable_by(most, |a, b| a.0.total_cmp(&b.0));
            near.truncate(most + 1);
            let scale = near.iter().fold(0.0, |s: f64, n| s.max(n.0)).sqrt();
            let rows: Vec<(usize, Vector4<f64>)> = near
                .into_iter()
                .filter(|n| n.0 > 0.0)
                .map(|(_, b)| {
                    let d = |c: usize| (points[b][c] - at[c]) / scale;
                    (b, Vector4::new(1.0, d(0), d(1), d(2)))
                })
                .collect();
            let normal: Matrix4<f64> = rows.iter().map(|(_, r)| r * r.transpose()).sum();
            // The nearest may lie in one plane, where layers are thick: then the fit is one in that plane.
            let inverse = normal.pseudo_inverse(1e-9).expect("a tolerance");
            let value = inverse.column(0).into_owned();
            rows.iter().map(|(b, r)| (*b, r.dot(&value))).collect()
        });
        Self {
            fits: fits.collect(),
            volumes: field(simulation, Field::InitialVolume),
        }
    }

    /// Of the pressure now.
    pub fn of(&self, simulation: &Simulation) -> f64 {
        let (rough, deviation) = self.parts(simulation);
        rough / deviation
    }

    /// The residual and the deviation of the pressure now, both in L2 [Pa].
    pub fn parts(&self, simulation: &Simulation) -> (f64, f64) {
        let pressure = field(simulation, Field::Pressure);
        let mean = self.mean(|a| pressure[a]);
        let residual = |a: usize| {
            let fit: f64 = self.fits[a].iter().map(|(b, w)| w * pressure[*b]).sum();
            pressure[a] - fit
        };
        let rough = self.mean(|a| residual(a).powi(2));
        (
            rough.sqrt(),
            self.mean(|a| (pressure[a] - mean).powi(2)).sqrt(),
        )
    }

    /// Mean over the body.
    pub fn mean(&self, value: impl Fn(usize) -> f64) -> f64 {
        let sum = |f: &dyn Fn(usize) -> f64| -> f64 {
            let all = self.volumes.iter().enumerate();
            all.map(|(a, volume)| volume * f(a)).sum()
        };
        sum(&value) / sum(&|_| 1.0)
    }
}
