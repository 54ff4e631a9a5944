//! Structure-of-arrays storage of per-particle fields.
//!
//! A component is contiguous; particles sit in slots, and slots in slices: 8 numbers in double precision or 16 in
//! single precision. Guard slots before and after the particles, and the unused lanes of the last slice, hold
//! finite dummies, so that a slice can be read at any offset and a pair weight of 0 makes the dummies harmless.

use std::ops::Range;

use crate::lane::{LONG_SLICE, Real, SLICE};

/// Shape shared by all arrays of a body.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Layout {
    /// Particles.
    pub particles: usize,
    /// Slots that hold them: whole slices of any precision.
    pub slots: usize,
    /// Slots per slab, the unit of parallel work and of partial sums: whole slices, too.
    pub slab: usize,
    /// Slots before the first one that holds a particle.
    guard: usize,
}

impl Layout {
    /// Layout for a number of particles. The slab is a function of that number alone: small enough
    /// to feed many threads, large enough to make its bookkeeping negligible.
    pub fn new(particles: usize) -> Self {
        let slices = particles.div_ceil(SLICE);
        Self {
            particles,
            slots: particles.max(1).next_multiple_of(LONG_SLICE),
            slab: ((slices / 256).clamp(8, 256) * SLICE).next_multiple_of(LONG_SLICE),
            guard: Self::FIRST,
        }
    }
    /// The same for so many slots of which none is read outside, without guards.
    pub fn unguarded(slots: usize) -> Self {
        Self {
            guard: 0,
            ..Self::new(slots)
        }
    }
    /// First slot: guard slots come before, a slice of any precision.
    pub const FIRST: usize = LONG_SLICE;
    /// Slot of a particle in the body's order.
    pub fn slot(particle: usize) -> usize {
        particle + Self::FIRST
    }
    /// Number of slabs.
    pub fn slabs(&self) -> usize {
        self.slots.div_ceil(self.slab)
    }
    /// First slot and number of slots of a slab.
    pub fn slab_range(&self, index: usize) -> (usize, usize) {
        self.piece_range(index, self.slab)
    }
    /// The same of a piece of another number of slots.
    pub fn piece_range(&self, index: usize, each: usize) -> (usize, usize) {
        let first = index * each;
        (Self::FIRST + first, each.min(self.slots - first))
    }
    /// Slots with the guards before and after them.
    fn guarded<E: Real>(&self) -> usize {
        self.guard + self.slots + self.guard.min(E::SLICE)
    }
    /// Slices from one component to the next. A distance that is a multiple of 4 kB would map all
    /// components of a particle to the same cache set.
    fn stride<E: Real>(&self) -> usize {
        let stride = self.guarded::<E>() / E::SLICE;
        if stride.is_multiple_of(64) {
            stride + 1
        } else {
            stride
        }
    }
}

/// `N` components per particle.
#[derive(Debug, Clone, PartialEq)]
pub struct Array<const N: usize, E: Real = f64> {
    data: Vec<E::Slots>,
    layout: Layout,
}

impl<const N: usize, E: Real> Array<N, E> {
    /// All slots, guards included, hold `value`.
    pub fn new(layout: Layout, value: [f64; N]) -> Self {
        let stride = layout.stride::<E>();
        let mut data = Vec::with_capacity(N * stride);
        for v in value {
            data.resize(data.len() + stride, E::slots(v));
        }
        Self { data, layout }
    }
    /// An array without particles, to stand in for one that is taken out for a while.
    pub fn empty() -> Self {
        Self {
            data: Vec::new(),
            layout: Layout {
                particles: 0,
                slots: 0,
                slab: LONG_SLICE,
                guard: 0,
            },
        }
    }
    /// The components, each with its guards: index them with a slot.
    #[inline(always)]
    pub fn components(&self) -> [&[E]; N] {
        let (stride, length) = (self.component_stride(), self.layout.guarded::<E>());
        let all = self.flat();
        std::array::from_fn(|c| &all[c * stride..c * stride + length])
    }
    /// All numbers; component `c` of slot `s` is `flat()[c * component_stride() + s]`.
    pub fn flat(&self) -> &[E] {
        bytemuck::cast_slice(&self.data)
    }
    /// See [`flat`](Self::flat).
    pub fn flat_mut(&mut self) -> &mut [E] {
        bytemuck::cast_slice_mut(&mut self.data)
    }
    /// Shape.
    pub fn layout(&self) -> Layout {
        self.layout
    }
    /// Number of particles.
    pub fn particles(&self) -> usize {
        self.layout.particles
    }
    /// Distance between components, in numbers.
    pub fn component_stride(&self) -> usize {
        self.layout.stride::<E>() * E::SLICE
    }
    /// Value of a slot.
    #[inline]
    pub fn get(&self, slot: usize) -> [f64; N] {
        let (all, stride) = (self.flat(), self.component_stride());
        std::array::from_fn(|c| all[c * stride + slot].value())
    }
    /// Sets a slot.
    #[inline]
    pub fn set(&mut self, slot: usize, value: [f64; N]) {
        let stride = self.component_stride();
        let all = self.flat_mut();
        for (c, v) in value.into_iter().enumerate() {
            all[c * stride + slot] = E::nearest(v);
        }
    }
    /// One piece per slab, by components, without the guards: slot `FIRST + i` of slab 0 is index `i`.
    pub fn slabs_mut(&mut self) -> Vec<[&mut [E]; N]> {
        self.pieces_mut(self.layout.slab)
    }
    /// The same in pieces of another number of slots.
    pub fn pieces_mut(&mut self, each: usize) -> Vec<[&mut [E]; N]> {
        let Layout { slots, guard, .. } = self.layout;
        let stride = self.component_stride();
        let mut pieces: [_; N] = {
            let mut components = self.flat_mut().chunks_exact_mut(stride);
            std::array::from_fn(|_| {
                let component = components.next().expect("N components");
                component[guard..guard + slots].chunks_mut(each)
            })
        };
        (0..slots.div_ceil(each))
            .map(|_| std::array::from_fn(|c| pieces[c].next().expect("as many pieces as slabs")))
            .collect()
    }
    /// Some slots, counted from the first one that holds a particle.
    pub fn part(&self, slots: Range<usize>) -> [&[E]; N] {
        let (all, stride) = (self.flat(), self.component_stride());
        let guard = self.layout.guard;
        std::array::from_fn(|c| {
            let first = c * stride + guard;
            &all[first + slots.start..first + slots.end]
        })
    }
    /// The same to write.
    pub fn part_mut(&mut self, slots: Range<usize>) -> [&mut [E]; N] {
        let (guard, stride) = (self.layout.guard, self.component_stride());
        let mut components = self.flat_mut().chunks_exact_mut(stride);
        std::array::from_fn(|_| {
            let component = components.next().expect("N components");
            &mut component[guard + slots.start..guard + slots.end]
        })
    }
    /// Repeats the first slice that holds particles in the slots from `at` on.
    pub fn repeat_first(&mut self, at: usize) {
        let (guard, stride) = (self.layout.guard, self.component_stride());
        for component in self.flat_mut().chunks_exact_mut(stride) {
            component.copy_within(guard..guard + E::SLICE, guard + at);
        }
    }
    /// Sets every slot, guards included.
    pub fn fill(&mut self, value: f64) {
        self.data.fill(E::slots(value));
    }
    /// Copies an array of the same layout.
    pub fn copy_from(&mut self, other: &Self) {
        self.data.copy_from_slice(&other.data);
    }
    /// Bytes held.
    pub fn bytes(&self) -> usize {
        std::mem::size_of_val(&self.data[..])
    }
}

/// Components cut to a length that they have: in a loop that begins with it, one check of an index
/// serves them all.
#[inline(always)]
pub fn level<const N: usize, E>(mut components: [&[E]; N], length: usize) -> [&[E]; N] {
    // Not by `map`, which the compiler does not see through.
    let mut c = 0;
    while c < N {
        components[c] = &components[c][..length];
        c += 1;
    }
    components
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slabs_cover_every_particle_once_and_leave_the_guards() {
        for particles in [1, 7, 8, 9, 64, 1000, 20_000] {
            let layout = Layout::new(particles);
            let mut array = Array::<3>::new(layout, [-1.0; 3]);
            for (s, piece) in array.slabs_mut().into_iter().enumerate() {
                let (first, slots) = layout.slab_range(s);
                for (c, values) in piece.into_iter().enumerate() {
                    assert_eq!(values.len(), slots);
                    for (i, v) in values.iter_mut().enumerate() {
                        assert_eq!(*v, -1.0);
                        *v = (1000 * (first + i) + c) as f64;
                    }
                }
            }
            for i in 0..particles {
                let slot = Layout::slot(i);
                assert_eq!(array.get(slot), [0, 1, 2].map(|c| (1000 * slot + c) as f64));
            }
            for c in array.components() {
                assert!(c[..Layout::FIRST].iter().all(|v| *v == -1.0));
                let end = Layout::FIRST + layout.slots;
                assert!(c[end..].iter().all(|v| *v == -1.0));
            }
        }
    }
}
