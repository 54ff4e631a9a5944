//! The order in which an evaluation goes through the body, in either [precision](super::precision).
//!
//! The force on a particle needs what the point pass finds of all its neighbours: stress, area,
//! gradient, wave, 29 numbers. Where nothing else reads them they are found just ahead of the
//! forces and kept, while they are needed, in a window of each thread, which stays in a near cache. That saves a twelfth
//! of an evaluation of 28,000 particles, a third of one of a million, and a fifth to a quarter of the memory.
//!
//! The body is cut into chunks no shorter than the reach, the distance in slices to the farthest neighbour.
//! The pairs of a chunk reach the head of the next one, as many slices as the reach; so the heads come first,
//! and then all chunks, in any order and on any number of threads. What the pairs of a chunk do behind
//! its end is added afterwards. Chunks depend on the body alone, and so do all sums.

use std::ops::Range;

use super::laws::{LawInputs, stresses};
use super::passes::{
    Bound, Dissipated, ForceInput, Forces, Gradient, Kept, Limit, Motion, PointOutput, Points, Sums,
};
use super::precision::PairReal;
use super::riemann::{self, WaveSpeeds};
use super::url::{Breakdown, Evaluation, Runner, State};
use crate::lane::Real;
use crate::layout::{Array, Layout};
use crate::material::{Law, with_law};
use crate::parallel::{self, PerThread};
use crate::reference::{PairData, PairVectors, Pairs, Reference, Slices, with_pairs};

/// Slots that a pass does at a time: few enough that what the next pass reads is still in a near cache, enough to
/// make the bookkeeping negligible.
const TILE: usize = 256;

/// Chunks that a body has, to feed many threads, where they can be several times as long as the reach then. Copying heads takes
/// a quarter of an evaluation where chunks are just as long, a tenth where they are twice as long, and nothing
/// that could be measured from eight times on.
const CHUNKS: usize = 24;
const REACHES: (usize, usize) = (3, 16);

/// What the pairs of the force pass read of the particles in some slots.
#[derive(Debug)]
pub(super) struct Block<E: Real> {
    /// Q_a.
    pub q: Array<9, E>,
    /// S_a; only where a dissipation is on.
    pub s: Option<Array<9, E>>,
    /// Half the spatial velocity gradient, 1/2 grad_chi v f^-1, limited if a limiter is on [1/s].
    pub half_grad: Option<Array<9, E>>,
    /// (smallest stretch, spatial density).
    pub wave: Array<2, E>,
}

/// A part of a block, to be written.
pub(super) struct BlockPart<'a, E> {
    pub q: [&'a mut [E]; 9],
    pub s: Option<[&'a mut [E]; 9]>,
    pub half_grad: Option<[&'a mut [E]; 9]>,
    pub wave: [&'a mut [E]; 2],
}

impl<E: Real> Block<E> {
    fn new(layout: Layout, areas: bool, gradients: bool) -> Self {
        Self {
            q: Array::new(layout, [0.0; 9]),
            s: areas.then(|| Array::new(layout, [0.0; 9])),
            half_grad: gradients.then(|| Array::new(layout, [0.0; 9])),
            wave: Array::new(layout, [1.0; 2]),
        }
    }

    fn part_mut(&mut self, slots: Range<usize>) -> BlockPart<'_, E> {
        BlockPart {
            q: self.q.part_mut(slots.clone()),
            s: self.s.as_mut().map(|a| a.part_mut(slots.clone())),
            half_grad: self.half_grad.as_mut().map(|a| a.part_mut(slots.clone())),
            wave: self.wave.part_mut(slots.clone()),
        }
    }

    /// All of it in slabs.
    fn slabs_mut(&mut self) -> Vec<BlockPart<'_, E>> {
        let mut s = self.s.as_mut().map(|s| s.slabs_mut().into_iter());
        let mut half_grad = self.half_grad.as_mut().map(|h| h.slabs_mut().into_iter());
        std::iter::zip(self.q.slabs_mut(), self.wave.slabs_mut())
            .map(|(q, wave)| BlockPart {
                q,
                s: s.as_mut().and_then(Iterator::next),
                half_grad: half_grad.as_mut().and_then(Iterator::next),
                wave,
            })
            .collect()
    }

    /// Takes over slots of another block, to stand from `at` on.
    fn copy_from(&mut self, other: &Self, slots: Range<usize>, at: usize) {
        fn copy<const N: usize, E: Real>(
            to: &mut Array<N, E>,
            from: &Array<N, E>,
            slots: Range<usize>,
            at: usize,
        ) {
            let to = to.part_mut(at..at + slots.len());
            for (to, from) in std::iter::zip(to, from.part(slots)) {
                to.copy_from_slice(from);
            }
        }
        copy(&mut self.q, &other.q, slots.clone(), at);
        copy(&mut self.wave, &other.wave, slots.clone(), at);
        for (to, from) in [
            (&mut self.s, &other.s),
            (&mut self.half_grad, &other.half_grad),
        ] {
            if let (Some(to), Some(from)) = (to, from) {
                copy(to, from, slots.clone(), at);
            }
        }
    }

    /// Repeats the first slice at another place.
    fn repeat_first(&mut self, at: usize) {
        self.q.repeat_first(at);
        self.wave.repeat_first(at);
        let optional = [&mut self.s, &mut self.half_grad];
        optional
            .into_iter()
            .flatten()
            .for_each(|a| a.repeat_first(at));
    }

    /// Makes a slice what lies behind the body: numbers that a weight of 0 makes harmless.
    fn clear(&mut self, slice: usize) {
        let part = self.part_mut(slice..slice + E::SLICE);
        let tensors = [Some(part.q), part.s, part.half_grad];
        tensors
            .into_iter()
            .flatten()
            .flatten()
            .for_each(|c| c.fill(E::nearest(0.0)));
        let one = E::nearest(1.0);
        part.wave.into_iter().for_each(|c| c.fill(one));
    }

    fn bytes(&self) -> usize {
        let tensors = [Some(&self.q), self.s.as_ref(), self.half_grad.as_ref()];
        self.wave.bytes()
            + tensors
                .into_iter()
                .flatten()
                .map(Array::bytes)
                .sum::<usize>()
    }
}

/// A block of the slots that a chunk's forces are about to need, as a ring: slot i stands at i modulo the capacity.
#[derive(Debug)]
struct Window<E: Real> {
    block: Block<E>,
    /// Slots, a power of two; behind them the first slice stands once more, for reads across the end.
    capacity: usize,
}

impl<E: Real> Window<E> {
    /// Writes slots, in tiles that the ring does not break: `write(block, slots, at)`.
    fn write<F>(
        &mut self,
        slots: Range<usize>,
        mut write: impl FnMut(&mut Block<E>, Range<usize>, usize) -> Result<(), F>,
    ) -> Result<(), F> {
        let mut start = slots.start;
        while start < slots.end {
            let at = start % self.capacity;
            let end = slots.end.min(start + TILE.min(self.capacity - at));
            write(&mut self.block, start..end, at)?;
            if at == 0 {
                self.block.repeat_first(self.capacity);
            }
            start = end;
        }
        Ok(())
    }
}

/// Where blocks are kept.
#[derive(Debug)]
enum Store<E: Real> {
    /// Of the whole body at once, for passes over all neighbours that need them.
    Whole(Block<E>),
    /// Of the head of each chunk; and of what is needed next, for each thread.
    Chunks {
        heads: Vec<Block<E>>,
        windows: PerThread<Window<E>>,
    },
}

/// What a body needs of its blocks.
#[derive(Debug, Clone, Copy)]
pub(super) struct Needs {
    pub areas: bool,
    pub gradients: bool,
    /// Passes over all neighbours read them, too.
    pub whole: bool,
}

/// See the module's text.
#[derive(Debug)]
pub(super) struct Sweep<E: PairReal> {
    layout: Layout,
    store: Store<E>,
    ends: Ends<E>,
    copies: E::Copies,
    /// grad_chi v [1/s], reference.
    pub grad_v: Array<9, E>,
}

/// Sums over pairs, each computed once for both of its particles, in chunks: what a chunk's pairs do behind its end
/// is kept apart and added afterwards.
#[derive(Debug)]
struct Ends<E: Real> {
    layout: Layout,
    /// Slots of a chunk.
    each: usize,
    /// Slots behind a chunk that its pairs reach, at most.
    reach: usize,
    /// What is behind each chunk: components, one after the other.
    behind: Vec<E::Slots>,
}

impl<E: Real> Ends<E> {
    /// The sums in chunks, with those behind them.
    fn chunks<'a>(&'a mut self, sums: &'a mut Array<3, E>) -> Vec<Sums<'a, E>> {
        let behind: &mut [E] = bytemuck::cast_slice_mut(&mut self.behind);
        let behind = behind.chunks_mut(3 * self.reach).map(|all| {
            let (x, rest) = all.split_at_mut(self.reach);
            let (y, z) = rest.split_at_mut(self.reach);
            [x, y, z]
        });
        std::iter::zip(sums.pieces_mut(self.each), behind)
            .map(|(out, behind)| Sums { out, behind })
            .collect()
    }

    /// Calls `work(run, sums)` for all chunks.
    fn pairs<R: Send>(
        &mut self,
        sums: &mut Array<3, E>,
        work: impl Fn((usize, usize), &mut Sums<E>) -> R + Sync + Send,
    ) -> Vec<R> {
        let (layout, each) = (self.layout, self.each);
        parallel::map_slabs(self.chunks(sums), |chunk, mut sums| {
            sums.clear();
            work(layout.piece_range(chunk, each), &mut sums)
        })
    }

    /// Adds what lies behind a chunk to the next one.
    fn add(&mut self, sums: &mut Array<3, E>) {
        let mut chunks = self.chunks(sums);
        let behind: Vec<_> = chunks
            .iter_mut()
            .map(|c| std::mem::take(&mut c.behind))
            .collect();
        let chunks = chunks.into_iter().skip(1).zip(behind).collect();
        parallel::map_slabs(chunks, |_, (sums, before): (Sums<E>, [&mut [E]; 3])| {
            for (sum, before) in sums.out.into_iter().zip(before) {
                sum.iter_mut()
                    .zip(before)
                    .for_each(|(s, b)| *s = E::nearest(s.value() + b.value()));
            }
        });
    }
}

/// A chunk, and what was found of heads before.
struct Chunk<'a, E: Real> {
    /// First slot, and how many they are.
    range: (usize, usize),
    /// Slots that pairs reach, at most.
    reach: usize,
    /// Block and slots of its head and of the next one's, if it is not the last.
    head: (&'a Block<E>, usize),
    next: Option<(&'a Block<E>, usize)>,
}

impl<E: Real> Chunk<'_, E> {
    /// Slots behind it that its pairs may reach.
    fn behind(&self) -> usize {
        self.next.map_or(0, |(_, slots)| slots)
    }
}

/// What the point pass fills, by particle.
pub(super) struct Outputs<'a> {
    pub sigma_j: Option<&'a mut Array<1>>,
    pub theta: Option<&'a mut Array<2>>,
}

impl Outputs<'_> {
    /// In pieces of so many slots.
    fn pieces<'b, E: Real>(
        &'b mut self,
        grad_v: &'b mut Array<9, E>,
        each: usize,
    ) -> Vec<Kept<'b, E>> {
        let mut sigma_j = self
            .sigma_j
            .as_mut()
            .map(|s| s.pieces_mut(each).into_iter());
        let mut theta = self.theta.as_mut().map(|t| t.pieces_mut(each).into_iter());
        let grad_v = grad_v.pieces_mut(each).into_iter();
        grad_v
            .map(|grad_v| Kept {
                grad_v,
                sigma_j: sigma_j.as_mut().and_then(Iterator::next).map(|[s]| s),
                theta: theta.as_mut().and_then(Iterator::next),
            })
            .collect()
    }
}

/// What is to be evaluated, and how.
#[derive(Clone, Copy)]
pub(super) struct Task<'a> {
    pub law: Law,
    pub inputs: LawInputs<'a>,
    /// Whether the law maps its history.
    pub flow: bool,
    pub state: &'a State,
    pub reference: &'a Reference,
    pub spacing: Option<[&'a [f64]; 6]>,
    /// Whether the largest velocity gradient is asked for.
    pub rate: bool,
    /// Whether Venkatakrishnan's limiter is on.
    pub limited: bool,
    pub mode: u8,
    pub speeds: WaveSpeeds<f64>,
    pub coefficient: f64,
    pub shock: f64,
}

/// The passes, with all that they have in common.
#[derive(Clone, Copy)]
struct Passes<'a, E: PairReal> {
    task: Task<'a>,
    slices: &'a Slices<E>,
    l: [&'a [E]; 9],
    /// x and v as pairs read them.
    motion: [[&'a [E]; 3]; 2],
}

impl<E: PairReal> Passes<'_, E> {
    /// What the force pass reads of a block.
    fn input<'a>(&'a self, block: &'a Block<E>) -> ForceInput<'a, E> {
        ForceInput::new(self.motion, self.task.reference, self.slices, block)
    }

    /// Gradient, law and point passes of a run of slots.
    fn points<R: Runner>(
        &self,
        run: (usize, usize),
        mut out: PointOutput<E>,
    ) -> Result<Evaluation, Breakdown> {
        let Self {
            task, slices, l, ..
        } = *self;
        let (reference, v) = (task.reference, task.state.v.components());
        with_pairs!(E::pairs(reference).vectors, pairs => R::run_pairs::<E, _>(Gradient {
            slices, pairs, l, field: self.motion[1], run, out: &mut out.kept.grad_v,
        }));
        let stored = with_law!(task.law, law => {
            stresses::<R, _, E>(law, task.inputs, task.flow, run, &mut out)
        })?;
        let Motion {
            kinetic,
            length2,
            rate2,
        } = R::run(Points {
            density: task.law.density(),
            kinematics: task.inputs.kinematics,
            reference,
            l,
            v,
            spacing: task.spacing,
            rate: task.rate,
            run,
            out: &mut out,
        })?;
        if let (true, Some(half_grad)) = (task.limited, &mut out.block.half_grad) {
            let x = task.state.x.components();
            R::run(Limit {
                reference,
                x,
                v,
                run,
                half_grad,
            });
        }
        Ok(Evaluation {
            strain: stored.strain,
            thermal: stored.thermal,
            entropy: stored.entropy,
            kinetic,
            length: length2,
            rate: rate2,
            ..Evaluation::NONE
        })
    }

    /// The same of some slots of a chunk that begins in the slot `first`; in the block they stand from `at` on.
    fn points_of_chunk<R: Runner>(
        &self,
        first: usize,
        slots: Range<usize>,
        kept: &mut Kept<E>,
        (block, at): (&mut Block<E>, usize),
    ) -> Result<Evaluation, Breakdown> {
        let run = (first + slots.start, slots.len());
        let out = PointOutput {
            block: block.part_mut(at..at + slots.len()),
            kept: kept.part(slots),
        };
        self.points::<R>(run, out)
    }

    /// Force pass of a run of slots that begins in a chunk at the place `from`.
    fn forces<R: Runner>(
        &self,
        input: ForceInput<E>,
        run: (usize, usize),
        from: usize,
        sums: &mut Sums<E>,
    ) -> Evaluation {
        let Task {
            speeds,
            coefficient,
            shock,
            mode,
            ..
        } = self.task;
        macro_rules! forces {
            ($pairs:expr, $($mode:ident),*) => {
                match mode {
                    $(riemann::$mode => R::run_pairs::<E, _>(Forces::<_, E, { riemann::$mode }> {
                        pairs: $pairs, input, speeds, coefficient, shock, run, from, sums,
                    }),)*
                    _ => unreachable!("six modes"),
                }
            };
        }
        let PairData { vectors, .. } = E::pairs(self.task.reference);
        let (dissipation, length) = with_pairs!(vectors, pairs => forces!(
            pairs, CONSTANT, LINEAR, MINMOD, SHOCK, OFF, GUARDED
        ));
        Evaluation {
            dissipation,
            length,
            ..Evaluation::NONE
        }
    }

    /// All passes of a chunk but the point pass of its head, which was made before, as that of the next one's was.
    fn chunk<R: Runner>(
        &self,
        chunk: &Chunk<E>,
        window: &mut Window<E>,
        (mut kept, mut sums): (Kept<E>, Sums<E>),
    ) -> Result<Evaluation, Breakdown> {
        sums.clear();
        let (first, slots) = chunk.range;
        let mut total = Evaluation::NONE;
        let mut ready = 0;
        for start in (0..slots).step_by(TILE) {
            let end = slots.min(start + TILE);
            let needed = (end + chunk.reach).min(slots + chunk.behind());
            total.add(&self.fill::<R>(chunk, ready..needed, window, &mut kept)?);
            ready = needed;
            let input = self.input(&window.block).in_ring(first, window.capacity);
            let run = (first + start, end - start);
            total.add(&self.forces::<R>(input, run, start, &mut sums));
        }
        Ok(total)
    }

    /// Brings slots of a chunk, and behind it, into the window.
    fn fill<R: Runner>(
        &self,
        chunk: &Chunk<E>,
        slots: Range<usize>,
        window: &mut Window<E>,
        kept: &mut Kept<E>,
    ) -> Result<Evaluation, Breakdown> {
        let (first, count) = chunk.range;
        let within =
            |from: usize, to: usize| slots.start.clamp(from, to)..slots.end.clamp(from, to);
        let mut total = Evaluation::NONE;
        let head = within(0, chunk.head.1);
        window.write(head, |block, slots, at| {
            block.copy_from(chunk.head.0, slots, at);
            Ok(())
        })?;
        window.write(within(chunk.head.1, count), |block, slots, at| {
            total.add(&self.points_of_chunk::<R>(first, slots, kept, (block, at))?);
            Ok(())
        })?;
        let last = count + chunk.behind();
        if let Some((next, _)) = chunk.next {
            window.write(within(count, last), |block, slots, at| {
                let slots = slots.start - count..slots.end - count;
                block.copy_from(next, slots, at);
                Ok(())
            })?;
        }
        if slots.end == last && !slots.is_empty() {
            window.write(last..last + E::SLICE, |block, _, at| {
                block.clear(at);
                Ok(())
            })?;
        }
        Ok(total)
    }

    /// Scales the gradients of a whole body so that operators which are no least-squares fit dissipate; the sums
    /// are lost.
    fn bound<R: Runner, P: PairVectors>(
        &self,
        pairs: P,
        block: &mut Block<E>,
        ends: &mut Ends<E>,
        sums: &mut Array<3, E>,
    ) {
        let (input, speeds) = (self.input(block), self.task.speeds);
        ends.pairs(sums, |run, sums| {
            R::run_pairs::<E, _>(Dissipated {
                pairs,
                input,
                speeds,
                run,
                sums,
            });
        });
        ends.add(sums);
        let (sums, layout) = (sums.components(), self.task.reference.layout);
        if let Some(half_grad) = &mut block.half_grad {
            parallel::map_slabs(half_grad.slabs_mut(), |slab, half_grad| {
                let run = layout.slab_range(slab);
                R::run_pairs::<E, _>(Bound {
                    sums,
                    run,
                    half_grad,
                });
            });
        }
    }
}

impl<E: PairReal> Sweep<E> {
    /// Of a body.
    pub fn new(reference: &Reference, needs: Needs) -> Self {
        let layout = reference.layout;
        let reach = E::pairs(reference).slices.reach().max(E::SLICE);
        let reaches = (layout.slots / (CHUNKS * reach)).clamp(REACHES.0, REACHES.1);
        let each = (reaches * reach).max(layout.slab);
        let block =
            |slots: usize| Block::new(Layout::unguarded(slots), needs.areas, needs.gradients);
        let chunks = layout.slots.div_ceil(each);
        let store = if needs.whole {
            Store::Whole(Block::new(layout, needs.areas, needs.gradients))
        } else {
            Store::Chunks {
                heads: (0..chunks).map(|_| block(reach)).collect(),
                windows: PerThread::new(|| {
                    // One more for what lies behind the body.
                    let capacity = (TILE + reach + E::SLICE).next_power_of_two();
                    Window {
                        block: block(capacity + E::SLICE),
                        capacity,
                    }
                }),
            }
        };
        Self {
            layout,
            store,
            ends: Ends {
                layout,
                each,
                reach,
                behind: vec![E::slots(0.0); chunks * 3 * reach / E::SLICE],
            },
            copies: E::copies(layout),
            grad_v: Array::new(layout, [0.0; 9]),
        }
    }

    /// What passes over all neighbours read of the last evaluation, whose state is given.
    ///
    /// # Panics
    /// Where such passes were not asked for.
    pub fn input<'a>(
        &'a self,
        state: &'a State,
        reference: &'a Reference,
    ) -> ForceInput<'a, E, f64> {
        let Store::Whole(block) = &self.store else {
            unreachable!("the block of the whole body is kept for them");
        };
        let motion = [state.x.components(), state.v.components()];
        ForceInput::new(motion, reference, E::pairs(reference).slices, block)
    }

    /// Whether passes over all neighbours may follow, which read pairs in double precision.
    pub fn is_whole(&self) -> bool {
        matches!(self.store, Store::Whole(_))
    }

    /// Number of chunks.
    #[cfg(test)]
    pub fn chunks(&self) -> usize {
        self.layout.slots.div_ceil(self.ends.each)
    }

    /// All passes over the body; length and rate are still squared.
    pub fn run<R: Runner>(
        &mut self,
        task: Task,
        mut out: Outputs,
        force: &mut Array<3>,
    ) -> Result<Evaluation, Breakdown> {
        let Self {
            layout,
            ends,
            copies,
            grad_v,
            ..
        } = self;
        let (layout, each, reach) = (*layout, ends.each, ends.reach);
        E::take(copies, task.state);
        let (sums, motion) = E::sums(copies, task.state, force);
        let PairData { slices, vectors, l } = E::pairs(task.reference);
        let passes = Passes {
            task,
            slices,
            l,
            motion,
        };
        let total = match &mut self.store {
            Store::Whole(block) => {
                let slabs = std::iter::zip(out.pieces(grad_v, layout.slab), block.slabs_mut());
                let points = parallel::map_slabs(slabs.collect(), |slab, (kept, block)| {
                    let run = layout.slab_range(slab);
                    passes.points::<R>(run, PointOutput { kept, block })
                });
                let points = Evaluation::sum(points)?;
                if let (Pairs::Closed(pairs), Some(_)) = (vectors, &block.half_grad) {
                    passes.bound::<R, _>(pairs, block, ends, sums);
                }
                let input = passes.input(block);
                let forces = ends.pairs(sums, |run, sums| passes.forces::<R>(input, run, 0, sums));
                Evaluation::sum([points].into_iter().chain(forces).map(Ok))?
            }
            Store::Chunks { heads, windows } => {
                let chunks = std::iter::zip(out.pieces(grad_v, each), &mut *heads).collect();
                let points = parallel::map_slabs(chunks, |chunk, (mut kept, head)| {
                    let (first, slots) = layout.piece_range(chunk, each);
                    let starts = (0..slots.min(reach)).step_by(TILE);
                    Evaluation::sum(starts.map(|start| {
                        let tile = start..slots.min(reach).min(start + TILE);
                        passes.points_of_chunk::<R>(first, tile, &mut kept, (&mut *head, start))
                    }))
                });
                let points = Evaluation::sum(points)?;
                let chunks = std::iter::zip(out.pieces(grad_v, each), ends.chunks(sums));
                let heads = &*heads;
                let head = |chunk: usize| {
                    let (_, slots) = layout.piece_range(chunk, each);
                    (&heads[chunk], slots.min(reach))
                };
                let chunks = windows.map(chunks.collect(), |window, index, outputs| {
                    let chunk = Chunk {
                        range: layout.piece_range(index, each),
                        reach,
                        head: head(index),
                        next: (index + 1 < heads.len()).then(|| head(index + 1)),
                    };
                    passes.chunk::<R>(&chunk, window, outputs)
                });
                Evaluation::sum([Ok(points)].into_iter().chain(chunks))?
            }
        };
        ends.add(sums);
        E::hand_over(copies, force);
        Ok(total)
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        let blocks = match &self.store {
            Store::Whole(block) => block.bytes(),
            Store::Chunks { heads, windows } => {
                heads.iter().map(Block::bytes).sum::<usize>()
                    + windows.sum(|window| window.block.bytes())
            }
        };
        blocks
            + std::mem::size_of_val(&self.ends.behind[..])
            + E::bytes(&self.copies)
            + self.grad_v.bytes()
    }
}
