//! Neighbour lists in slices of particles that run in the lanes of a vector.

use std::ops::Range;

use crate::lane::{SLICE, Slots};
use crate::layout::Layout;
use crate::neighbours::Graph;

/// Neighbour lists in slices: the particles of a slice share an entry for each distinct distance
/// in slots to a neighbour. On a lattice nearly every lane of an entry is used.
#[derive(Debug)]
pub struct Slices {
    /// First entry of each slice.
    start: Vec<usize>,
    /// First entry of each slice whose neighbours come after the particles.
    after: Vec<usize>,
    /// Slot of the neighbour of the slice's first lane.
    base: Vec<u32>,
    /// k of the initial configuration per lane; 0 where a lane has no neighbour in this entry.
    weight: Vec<Slots>,
}

impl Slices {
    /// The neighbour loop: (neighbour's slot, index of the pair) for the particles in the slots
    /// from `a`, as many as the lanes are wide. Lanes without a neighbour come with weight 0.
    #[inline(always)]
    pub fn of(&self, a: usize) -> NeighboursOf<'_> {
        let (slice, lane) = ((a - Layout::FIRST) / SLICE, (a - Layout::FIRST) % SLICE);
        let entries = self.start[slice]..self.start[slice + 1];
        NeighboursOf {
            base: self.base[entries.clone()].iter(),
            pair: entries.start * SLICE + lane,
            lane,
        }
    }
    /// The same for neighbours that come after the particles, the most distant first: each pair
    /// of the body once.
    ///
    /// In this order what the pairs do to a particle comes from the others in their order, however
    /// many lanes run side by side.
    #[inline(always)]
    pub fn after(&self, a: usize) -> impl Iterator<Item = (usize, usize)> {
        let (slice, lane) = ((a - Layout::FIRST) / SLICE, (a - Layout::FIRST) % SLICE);
        let entries = self.after[slice]..self.start[slice + 1];
        let bases = self.base[entries.clone()].iter();
        std::iter::zip(bases, entries)
            .rev()
            .map(move |(base, entry)| (*base as usize + lane, entry * SLICE + lane))
    }
    /// Slices behind a slice that its neighbours lie in, at most.
    pub fn reach(&self) -> usize {
        let farthest = |slice: usize| match self.start[slice + 1] {
            end if end > self.after[slice] => {
                self.base[end - 1] as usize - (Layout::FIRST + slice * SLICE)
            }
            _ => 0,
        };
        let farthest = (0..self.after.len()).map(farthest).max().unwrap_or(0);
        farthest.div_ceil(SLICE)
    }
    /// Weights by pair index.
    #[inline(always)]
    pub fn weights(&self) -> &[f64] {
        bytemuck::must_cast_slice(&self.weight)
    }

    /// The lists of a graph; all weights 0.
    pub(super) fn new(graph: &Graph, layout: Layout) -> Self {
        let mut this = Self {
            start: vec![0],
            after: Vec::new(),
            base: Vec::new(),
            weight: Vec::new(),
        };
        let mut offsets = Vec::new();
        for slice in 0..layout.slices {
            let first = slice * SLICE;
            let members = first..(first + SLICE).min(graph.count());
            offsets.clear();
            for a in members {
                offsets.extend(graph.of(a).iter().map(|&b| i64::from(b) - a as i64));
            }
            offsets.sort_unstable();
            offsets.dedup();
            let before = offsets.partition_point(|o| *o < 0);
            this.after.push(this.base.len() + before);
            // A lane of the slice has a neighbour at each offset, so the base is at most 7 slots
            // before the first particle: inside the guard.
            this.base.extend(
                offsets
                    .iter()
                    .map(|o| (Layout::slot(first) as i64 + o) as u32),
            );
            this.weight.resize(this.base.len(), Slots([0.0; SLICE]));
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
        let first = slab * layout.slab;
        let last = (first + layout.slab).min(layout.slices);
        self.start[first]..self.start[last]
    }

    /// Values by pair, in pieces by slab.
    pub(super) fn split<'a>(
        &self,
        layout: Layout,
        mut rest: Vec<&'a mut [Slots]>,
    ) -> Vec<Vec<&'a mut [f64]>> {
        let pieces = |slab: usize| {
            let length = self.of_slab(layout, slab).len();
            let split = |r: &mut &'a mut [Slots]| {
                let (piece, remaining) = std::mem::take(r).split_at_mut(length);
                *r = remaining;
                bytemuck::must_cast_slice_mut(piece)
            };
            rest.iter_mut().map(split).collect()
        };
        (0..layout.slabs()).map(pieces).collect()
    }

    /// Weights, to be set.
    pub(super) fn weights_mut(&mut self) -> &mut [f64] {
        bytemuck::must_cast_slice_mut(&mut self.weight)
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
        let (slice, lane) = (a / SLICE, a % SLICE);
        let range = self.start[slice]..self.start[slice + 1];
        let base = (Layout::slot(b) - lane) as u32;
        let at = self.base[range.clone()].binary_search(&base).ok()?;
        let pair = (range.start + at) * SLICE + lane;
        Some(pair)
    }
}

/// See [`Slices::of`].
pub struct NeighboursOf<'a> {
    base: std::slice::Iter<'a, u32>,
    pair: usize,
    lane: usize,
}

impl Iterator for NeighboursOf<'_> {
    type Item = (usize, usize);
    #[inline(always)]
    fn next(&mut self) -> Option<(usize, usize)> {
        let base = *self.base.next()? as usize;
        let pair = self.pair;
        self.pair += SLICE;
        Some((base + self.lane, pair))
    }
}
