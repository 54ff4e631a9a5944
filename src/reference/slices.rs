//! Neighbour lists in slices of particles that run in the lanes of a vector.

use std::marker::PhantomData;
use std::ops::Range;

use crate::lane::Real;
use crate::layout::Layout;
use crate::neighbours::Graph;
use crate::parallel;

/// Neighbour lists in slices: the particles of a slice share an entry for each distinct distance
/// in slots to a neighbour. On a lattice nearly every lane of an entry is used.
#[derive(Debug)]
pub struct Slices<E: Real = f64> {
    /// First entry of each slice.
    start: Vec<usize>,
    /// First entry of each slice whose neighbours come after the particles.
    after: Vec<usize>,
    /// Slot of the neighbour of the slice's first lane.
    base: Vec<u32>,
    /// k of the initial configuration per lane; 0 where a lane has no neighbour in this entry.
    weight: Vec<E::Slots>,
}

impl<E: Real> Slices<E> {
    /// The neighbour loop: (neighbour's slot, index of the pair) for the particles in the slots
    /// from `a`, as many as the lanes are wide. Lanes without a neighbour come with weight 0.
    #[inline(always)]
    pub fn of(&self, a: usize) -> NeighboursOf<'_, E> {
        let (slice, lane) = Self::place(a - Layout::FIRST);
        let entries = self.start[slice]..self.start[slice + 1];
        NeighboursOf {
            base: self.base[entries.clone()].iter(),
            pair: entries.start * E::SLICE + lane,
            lane,
            real: PhantomData,
        }
    }
    /// The same for neighbours that come after the particles, the most distant first: each pair
    /// of the body once.
    ///
    /// In this order what the pairs do to a particle comes from the others in their order, however
    /// many lanes run side by side.
    #[inline(always)]
    pub fn after(&self, a: usize) -> impl Iterator<Item = (usize, usize)> {
        let (slice, lane) = Self::place(a - Layout::FIRST);
        let entries = self.after[slice]..self.start[slice + 1];
        let bases = self.base[entries.clone()].iter();
        std::iter::zip(bases, entries)
            .rev()
            .map(move |(base, entry)| (*base as usize + lane, entry * E::SLICE + lane))
    }
    /// Slice and lane of a particle.
    #[inline(always)]
    fn place(particle: usize) -> (usize, usize) {
        (particle / E::SLICE, particle % E::SLICE)
    }
    /// Slots behind a slice that its neighbours lie in, at most: whole slices.
    pub fn reach(&self) -> usize {
        let farthest = |slice: usize| match self.start[slice + 1] {
            end if end > self.after[slice] => {
                self.base[end - 1] as usize - (Layout::FIRST + slice * E::SLICE)
            }
            _ => 0,
        };
        let farthest = (0..self.after.len()).map(farthest).max().unwrap_or(0);
        farthest.next_multiple_of(E::SLICE)
    }
    /// Weights by pair index.
    #[inline(always)]
    pub fn weights(&self) -> &[E] {
        bytemuck::cast_slice(&self.weight)
    }

    /// Slots of the neighbours of the particle in a slot.
    pub fn neighbours(&self, a: usize) -> impl Iterator<Item = usize> {
        let weights = self.weights();
        self.of(a)
            .filter_map(|(b, pair)| (weights[pair].value() > 0.0).then_some(b))
    }

    /// Of no particles.
    pub(super) fn empty() -> Self {
        Self {
            start: vec![0],
            after: Vec::new(),
            base: Vec::new(),
            weight: Vec::new(),
        }
    }
    /// The lists of a graph; all weights 0.
    pub(super) fn new(graph: &Graph, layout: Layout) -> Self {
        let mut this = Self::empty();
        let mut offsets = Vec::new();
        for first in (0..layout.slots).step_by(E::SLICE) {
            let members = first.min(graph.count())..(first + E::SLICE).min(graph.count());
            offsets.clear();
            for a in members {
                offsets.extend(graph.of(a).iter().map(|&b| i64::from(b) - a as i64));
            }
            offsets.sort_unstable();
            offsets.dedup();
            let before = offsets.partition_point(|o| *o < 0);
            this.after.push(this.base.len() + before);
            // A lane of the slice has a neighbour at each offset, so the base is less than a slice before the
            // first particle: inside the guard.
            this.base.extend(
                offsets
                    .iter()
                    .map(|o| (Layout::slot(first) as i64 + o) as u32),
            );
            this.weight.resize(this.base.len(), E::slots(0.0));
            this.start.push(this.base.len());
        }
        this
    }

    /// Entries of all slices: each has a pair for every lane.
    pub(super) fn entries(&self) -> usize {
        self.base.len()
    }

    /// Entries of the slices of a slab.
    pub(super) fn of_slab(&self, layout: Layout, slab: usize) -> Range<usize> {
        let (first, slots) = layout.slab_range(slab);
        let first = (first - Layout::FIRST) / E::SLICE;
        self.start[first]..self.start[first + slots / E::SLICE]
    }

    /// Values by pair, in pieces by slab.
    pub(super) fn split<'a>(
        &self,
        layout: Layout,
        mut rest: Vec<&'a mut [E::Slots]>,
    ) -> Vec<Vec<&'a mut [E]>> {
        let pieces = |slab: usize| {
            let length = self.of_slab(layout, slab).len();
            let split = |r: &mut &'a mut [E::Slots]| {
                let (piece, remaining) = std::mem::take(r).split_at_mut(length);
                *r = remaining;
                bytemuck::cast_slice_mut(piece)
            };
            rest.iter_mut().map(split).collect()
        };
        (0..layout.slabs()).map(pieces).collect()
    }

    /// Takes the numbers of all pairs of a slab from those of slices of another length, `to` from the slab's
    /// first pair on.
    pub(super) fn take<F: Real>(
        &self,
        layout: Layout,
        slab: usize,
        other: &Slices<F>,
        from: &[F],
        to: &mut [E],
    ) {
        let offset = self.of_slab(layout, slab).start;
        let (first, slots) = layout.slab_range(slab);
        for a in (first..first + slots).step_by(F::SLICE) {
            let ((own, lane), (slice, _)) = (
                Self::place(a - Layout::FIRST),
                Slices::<F>::place(a - Layout::FIRST),
            );
            // Both are sorted, and the longer slice has all distances of the shorter one.
            let mut entries = self.start[own]..self.start[own + 1];
            for entry in other.start[slice]..other.start[slice + 1] {
                let base = other.base[entry] - lane as u32;
                let found = entries.find(|e| self.base[*e] == base);
                let at = (found.expect("the same neighbours") - offset) * E::SLICE + lane;
                let values = &from[entry * F::SLICE..(entry + 1) * F::SLICE];
                for (to, value) in to[at..at + F::SLICE].iter_mut().zip(values) {
                    *to = E::nearest(value.value());
                }
            }
        }
    }

    /// The same of the weights.
    pub(super) fn take_weights<F: Real>(&mut self, layout: Layout, other: &Slices<F>, from: &[F]) {
        let mut weight = std::mem::take(&mut self.weight);
        let pieces = self.split(layout, vec![&mut weight]);
        parallel::map_slabs(pieces, |slab, mut to| {
            let to = to.pop().expect("one piece a slab");
            self.take(layout, slab, other, from, to);
        });
        self.weight = weight;
    }

    /// Weights, to be set.
    pub(super) fn weights_mut(&mut self) -> &mut [E] {
        bytemuck::cast_slice_mut(&mut self.weight)
    }

    /// Bytes held.
    pub(super) fn bytes(&self) -> usize {
        std::mem::size_of_val(&self.weight[..])
            + std::mem::size_of_val(&self.base[..])
            + std::mem::size_of_val(&self.start[..])
            + std::mem::size_of_val(&self.after[..])
    }

    /// Pair index of two neighbours.
    pub(super) fn pair(&self, a: usize, b: usize) -> Option<usize> {
        let (slice, lane) = Self::place(a);
        let range = self.start[slice]..self.start[slice + 1];
        let base = (Layout::slot(b) - lane) as u32;
        let at = self.base[range.clone()].binary_search(&base).ok()?;
        let pair = (range.start + at) * E::SLICE + lane;
        Some(pair)
    }
}

/// See [`Slices::of`].
pub struct NeighboursOf<'a, E> {
    base: std::slice::Iter<'a, u32>,
    pair: usize,
    lane: usize,
    real: PhantomData<E>,
}

impl<E: Real> Iterator for NeighboursOf<'_, E> {
    type Item = (usize, usize);
    #[inline(always)]
    fn next(&mut self) -> Option<(usize, usize)> {
        let base = *self.base.next()? as usize;
        let pair = self.pair;
        self.pair += E::SLICE;
        Some((base + self.lane, pair))
    }
}
