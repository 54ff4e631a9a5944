//! What sums over pairs read of a reference, in single precision.
//!
//! Pair vectors are made in double precision and rounded once. Points are taken from one in the middle of the
//! body: a difference of two of them is then good to the round-off of the body's size, wherever it stands.

use super::PairData;
use super::pairs::{Closed, Lean, Pairs, Stored, StoredVectors};
use super::slices::Slices;
use crate::layout::{Array, Layout};
use crate::math::*;
use crate::neighbours::Graph;
use crate::parallel;

/// See the module's text.
#[derive(Debug)]
pub struct Single {
    /// Neighbours and k.
    pub slices: Slices<f32>,
    /// The points that k belongs to [m].
    x: Array<3, f32>,
    /// mu / 2 and Lambda of repaired operators.
    multipliers: Option<(Array<3, f32>, Array<9, f32>)>,
    stored: Option<StoredVectors<f32>>,
    l: Array<9, f32>,
}

impl Single {
    /// Of a body; pair vectors come with [`round`](Self::round).
    pub fn new(graph: &Graph, layout: Layout) -> Self {
        Self {
            slices: Slices::new(graph, layout),
            x: Array::new(layout, [0.0; 3]),
            multipliers: None,
            stored: None,
            l: Array::new(layout, [0.0; 9]),
        }
    }

    /// Takes over new pair vectors.
    pub fn round(&mut self, pairs: PairData<f64>, layout: Layout) {
        let PairData { slices, vectors, l } = pairs;
        let slots = || (0..layout.particles).map(Layout::slot);
        let points = |to: &mut Array<3, f32>, x: &[&[f64]; 3]| {
            let middle = x.map(|x| x[Layout::slot(layout.particles / 2)]);
            for slot in slots() {
                to.set(slot, sub3(x.map(|x| x[slot]), middle));
            }
        };
        self.slices.take_weights(
            layout,
            slices,
            match &vectors {
                Pairs::Lean(Lean { k, .. }) | Pairs::Closed(Closed { k, .. }) => k,
                Pairs::Stored(_) => slices.weights(),
            },
        );
        match &vectors {
            Pairs::Lean(lean) => points(&mut self.x, &lean.x),
            Pairs::Closed(closed) => {
                points(&mut self.x, &closed.x);
                let (half_mu, lambda) = self.multipliers.get_or_insert_with(|| {
                    let half_mu = Array::new(layout, [0.0; 3]);
                    (half_mu, Array::new(layout, [0.0; 9]))
                });
                for slot in slots() {
                    half_mu.set(slot, closed.half_mu.map(|c| c[slot]));
                    lambda.set(slot, closed.lambda.map(|c| c[slot]));
                }
            }
            Pairs::Stored(stored) => {
                let to = &mut self.slices;
                let vectors = self.stored.get_or_insert_with(|| StoredVectors::new(to));
                let pieces = vectors.slabs_mut(to, layout);
                parallel::map_slabs(pieces, |slab, pieces| {
                    for (piece, from) in std::iter::zip(pieces, stored.all()) {
                        to.take(layout, slab, slices, from, piece);
                    }
                });
            }
        }
        for slot in slots() {
            self.l.set(slot, l.map(|c| c[slot]));
        }
    }

    /// What sums over pairs read.
    pub fn pairs(&self) -> PairData<'_, f32> {
        PairData {
            slices: &self.slices,
            vectors: self.vectors(),
            l: self.l.components(),
        }
    }

    fn vectors(&self) -> Pairs<'_, f32> {
        if let Some(stored) = &self.stored {
            return Pairs::Stored(stored.get());
        }
        let (k, x) = (self.slices.weights(), self.x.components());
        match &self.multipliers {
            None => Pairs::Lean(Lean { k, x }),
            Some((half_mu, lambda)) => Pairs::Closed(Closed {
                k,
                x,
                half_mu: half_mu.components(),
                lambda: lambda.components(),
            }),
        }
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        let multipliers = self.multipliers.as_ref();
        self.slices.bytes()
            + self.x.bytes()
            + self.l.bytes()
            + multipliers.map_or(0, |(mu, lambda)| mu.bytes() + lambda.bytes())
            + self.stored.as_ref().map_or(0, StoredVectors::bytes)
    }
}

impl<'a> Stored<'a, f64> {
    /// Components of g_ab, then of g_ba.
    fn all(&self) -> impl Iterator<Item = &'a [f64]> {
        self.ab.into_iter().chain(self.ba)
    }
}
