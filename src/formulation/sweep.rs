//! The order in which an evaluation goes through the body.
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
use super::riemann::{self, WaveSpeeds};
use super::url::{Breakdown, Evaluation, Runner, State};
use crate::lane::{SLICE, Slots};
use crate::layout::{Array, Layout};
use crate::material::{Law, with_law};
use crate::parallel::{self, PerThread};
use crate::reference::{PairVectors, Pairs, Reference, with_pairs};

/// Slices that a pass does at a time: few enough that what the next pass reads is still in a near cache, enough to
/// make the bookkeeping negligible.
const TILE: usize = 32;

/// Chunks that a body has, to feed many threads, where they can be several times as long as the reach then. Copying heads takes
/// a quarter of an evaluation where chunks are just as long, a tenth where they are twice as long, and nothing
/// that could be measured from eight times on.
const CHUNKS: usize = 24;
const REACHES: (usize, usize) = (3, 16);

/// What the pairs of the force pass read of the particles of some slices.
#[derive(Debug)]
pub(super) struct Block {
    /// Q_a.
    pub q: Array<9>,
    /// S_a; only where a dissipation is on.
    pub s: Option<Array<9>>,
    /// Half the spatial velocity gradient, 1/2 grad_chi v f^-1, limited if a limiter is on [1/s].
    pub half_grad: Option<Array<9>>,
    /// (smallest stretch, spatial density).
    pub wave: Array<2>,
}

/// A part of a block, to be written.
pub(super) struct BlockPart<'a> {
    pub q: [&'a mut [f64]; 9],
    pub s: Option<[&'a mut [f64]; 9]>,
    pub half_grad: Option<[&'a mut [f64]; 9]>,
    pub wave: [&'a mut [f64]; 2],
}

impl Block {
    fn new(layout: Layout, areas: bool, gradients: bool) -> Self {
        Self {
            q: Array::new(layout, [0.0; 9]),
            s: areas.then(|| Array::new(layout, [0.0; 9])),
            half_grad: gradients.then(|| Array::new(layout, [0.0; 9])),
            wave: Array::new(layout, [1.0; 2]),
        }
    }

    fn part_mut(&mut self, slices: Range<usize>) -> BlockPart<'_> {
        BlockPart {
            q: self.q.part_mut(slices.clone()),
            s: self.s.as_mut().map(|a| a.part_mut(slices.clone())),
            half_grad: self.half_grad.as_mut().map(|a| a.part_mut(slices.clone())),
            wave: self.wave.part_mut(slices.clone()),
        }
    }

    /// All of it in slabs.
    fn slabs_mut(&mut self) -> Vec<BlockPart<'_>> {
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

    /// Takes over slices of another block, to stand from `at` on.
    fn copy_from(&mut self, other: &Self, slices: Range<usize>, at: usize) {
        fn copy<const N: usize>(
            to: &mut Array<N>,
            from: &Array<N>,
            slices: Range<usize>,
            at: usize,
        ) {
            let to = to.part_mut(at..at + slices.len());
            for (to, from) in std::iter::zip(to, from.part(slices)) {
                to.copy_from_slice(from);
            }
        }
        copy(&mut self.q, &other.q, slices.clone(), at);
        copy(&mut self.wave, &other.wave, slices.clone(), at);
        for (to, from) in [
            (&mut self.s, &other.s),
            (&mut self.half_grad, &other.half_grad),
        ] {
            if let (Some(to), Some(from)) = (to, from) {
                copy(to, from, slices.clone(), at);
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
        let part = self.part_mut(slice..slice + 1);
        let tensors = [Some(part.q), part.s, part.half_grad];
        tensors
            .into_iter()
            .flatten()
            .flatten()
            .for_each(|c| c.fill(0.0));
        part.wave.into_iter().for_each(|c| c.fill(1.0));
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

/// A block of the slices that a chunk's forces are about to need, as a ring: slice i stands at i modulo the capacity.
#[derive(Debug)]
struct Window {
    block: Block,
    /// Slices, a power of two; behind them the first one stands once more, for reads across the end.
    capacity: usize,
}

impl Window {
    /// Writes slices, in tiles that the ring does not break: `write(block, slices, at)`.
    fn write<E>(
        &mut self,
        slices: Range<usize>,
        mut write: impl FnMut(&mut Block, Range<usize>, usize) -> Result<(), E>,
    ) -> Result<(), E> {
        let mut start = slices.start;
        while start < slices.end {
            let at = start % self.capacity;
            let end = slices.end.min(start + TILE.min(self.capacity - at));
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
enum Store {
    /// Of the whole body at once, for passes over all neighbours that need them.
    Whole(Block),
    /// Of the head of each chunk; and of what is needed next, for each thread.
    Chunks {
        heads: Vec<Block>,
        windows: PerThread<Window>,
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
pub(super) struct Sweep {
    layout: Layout,
    store: Store,
    ends: Ends,
}

/// Sums over pairs, each computed once for both of its particles, in chunks: what a chunk's pairs do behind its end
/// is kept apart and added afterwards.
#[derive(Debug)]
struct Ends {
    layout: Layout,
    /// Slices of a chunk.
    each: usize,
    /// Slices behind a chunk that its pairs reach, at most.
    reach: usize,
    /// What is behind each chunk: components, one after the other.
    behind: Vec<Slots>,
}

impl Ends {
    /// The sums in chunks, with those behind them.
    fn chunks<'a>(&'a mut self, sums: &'a mut Array<3>) -> Vec<Sums<'a>> {
        let behind = self.behind.chunks_mut(3 * self.reach).map(|all| {
            let (x, rest) = all.split_at_mut(self.reach);
            let (y, z) = rest.split_at_mut(self.reach);
            [x, y, z].map(bytemuck::must_cast_slice_mut)
        });
        std::iter::zip(sums.pieces_mut(self.each), behind)
            .map(|(out, behind)| Sums { out, behind })
            .collect()
    }

    /// Calls `work(run, sums)` for all chunks.
    fn pairs<R: Send>(
        &mut self,
        sums: &mut Array<3>,
        work: impl Fn((usize, usize), &mut Sums) -> R + Sync + Send,
    ) -> Vec<R> {
        let (layout, each) = (self.layout, self.each);
        parallel::map_slabs(self.chunks(sums), |chunk, mut sums| {
            sums.clear();
            work(layout.piece_range(chunk, each), &mut sums)
        })
    }

    /// Adds what lies behind a chunk to the next one.
    fn add(&mut self, sums: &mut Array<3>) {
        let mut chunks = self.chunks(sums);
        let behind: Vec<_> = chunks
            .iter_mut()
            .map(|c| std::mem::take(&mut c.behind))
            .collect();
        let chunks = chunks.into_iter().skip(1).zip(behind).collect();
        parallel::map_slabs(chunks, |_, (sums, before): (Sums, [&mut [f64]; 3])| {
            for (sum, before) in sums.out.into_iter().zip(before) {
                sum.iter_mut().zip(before).for_each(|(s, b)| *s += *b);
            }
        });
    }
}

/// A chunk, and what was found of heads before.
struct Chunk<'a> {
    /// First slot, and slices.
    range: (usize, usize),
    /// Slices that pairs reach, at most.
    reach: usize,
    /// Block and slices of its head and of the next one's, if it is not the last.
    head: (&'a Block, usize),
    next: Option<(&'a Block, usize)>,
}

impl Chunk<'_> {
    /// Slices behind it that its pairs may reach.
    fn behind(&self) -> usize {
        self.next.map_or(0, |(_, slices)| slices)
    }
}

/// What the point pass fills, by particle.
pub(super) struct Outputs<'a> {
    pub grad_v: &'a mut Array<9>,
    pub sigma_j: Option<&'a mut Array<1>>,
    pub theta: Option<&'a mut Array<2>>,
}

impl Outputs<'_> {
    /// In pieces of so many slices.
    fn pieces(&mut self, each: usize) -> Vec<Kept<'_>> {
        let mut sigma_j = self
            .sigma_j
            .as_mut()
            .map(|s| s.pieces_mut(each).into_iter());
        let mut theta = self.theta.as_mut().map(|t| t.pieces_mut(each).into_iter());
        let grad_v = self.grad_v.pieces_mut(each).into_iter();
        grad_v
            .map(|grad_v| Kept {
                grad_v,
                sigma_j: sigma_j.as_mut().and_then(Iterator::next).map(|[s]| s),
                theta: theta.as_mut().and_then(Iterator::next),
            })
            .collect()
    }
}

/// The passes, with all that they have in common.
#[derive(Clone, Copy)]
pub(super) struct Passes<'a> {
    pub law: Law,
    pub inputs: LawInputs<'a>,
    /// Whether the law maps its history.
    pub flow: bool,
    pub state: &'a State,
    pub reference: &'a Reference,
    pub spacing: Option<[&'a [f64]; 6]>,
    /// Whether Venkatakrishnan's limiter is on.
    pub limited: bool,
    pub mode: u8,
    pub speeds: WaveSpeeds<f64>,
    pub coefficient: f64,
    pub shock: f64,
}

impl Passes<'_> {
    /// Gradient, law and point passes of a run of slices.
    fn points<R: Runner>(
        &self,
        run: (usize, usize),
        mut out: PointOutput,
    ) -> Result<Evaluation, Breakdown> {
        let Self { reference, .. } = *self;
        let v = self.state.v.components();
        with_pairs!(reference, pairs => R::run(Gradient {
            pairs, reference, field: v, run, out: &mut out.kept.grad_v,
        }));
        let stored = with_law!(self.law, law => {
            stresses::<R, _>(law, self.inputs, self.flow, run, &mut out)
        })?;
        let Motion { kinetic, length2 } = R::run(Points {
            density: self.law.density(),
            kinematics: self.inputs.kinematics,
            reference,
            v,
            spacing: self.spacing,
            run,
            out: &mut out,
        })?;
        if let (true, Some(half_grad)) = (self.limited, &mut out.block.half_grad) {
            let x = self.state.x.components();
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
            ..Evaluation::NONE
        })
    }

    /// The same of some slices of a chunk that begins in the slot `first`; in the block they stand from `at` on.
    fn points_of_chunk<R: Runner>(
        &self,
        first: usize,
        slices: Range<usize>,
        kept: &mut Kept,
        (block, at): (&mut Block, usize),
    ) -> Result<Evaluation, Breakdown> {
        let run = (first + slices.start * SLICE, slices.len());
        let out = PointOutput {
            block: block.part_mut(at..at + slices.len()),
            kept: kept.part(slices),
        };
        self.points::<R>(run, out)
    }

    /// Force pass of a run of slices that begins in a chunk at the place `from`.
    fn forces<R: Runner>(
        &self,
        input: ForceInput,
        run: (usize, usize),
        from: usize,
        sums: &mut Sums,
    ) -> Evaluation {
        let Self {
            speeds,
            coefficient,
            shock,
            mode,
            ..
        } = *self;
        macro_rules! forces {
            ($pairs:expr, $($mode:ident),*) => {
                match mode {
                    $(riemann::$mode => R::run(Forces::<_, { riemann::$mode }> {
                        pairs: $pairs, input, speeds, coefficient, shock, run, from, sums,
                    }),)*
                    _ => unreachable!("six modes"),
                }
            };
        }
        let (dissipation, length) = with_pairs!(self.reference, pairs => forces!(
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
        chunk: &Chunk,
        window: &mut Window,
        (mut kept, mut sums): (Kept, Sums),
    ) -> Result<Evaluation, Breakdown> {
        sums.clear();
        let (first, slices) = chunk.range;
        let mut total = Evaluation::NONE;
        let mut ready = 0;
        for start in (0..slices).step_by(TILE) {
            let end = slices.min(start + TILE);
            let needed = (end + chunk.reach).min(slices + chunk.behind());
            total.add(&self.fill::<R>(chunk, ready..needed, window, &mut kept)?);
            ready = needed;
            let input = ForceInput::new(self.state, self.reference, &window.block)
                .in_ring(first, window.capacity);
            let (from, run) = (start * SLICE, (first + start * SLICE, end - start));
            total.add(&self.forces::<R>(input, run, from, &mut sums));
        }
        Ok(total)
    }

    /// Brings slices of a chunk, and behind it, into the window.
    fn fill<R: Runner>(
        &self,
        chunk: &Chunk,
        slices: Range<usize>,
        window: &mut Window,
        kept: &mut Kept,
    ) -> Result<Evaluation, Breakdown> {
        let (first, count) = chunk.range;
        let within =
            |from: usize, to: usize| slices.start.clamp(from, to)..slices.end.clamp(from, to);
        let mut total = Evaluation::NONE;
        let head = within(0, chunk.head.1);
        window.write(head, |block, slices, at| {
            block.copy_from(chunk.head.0, slices, at);
            Ok(())
        })?;
        window.write(within(chunk.head.1, count), |block, slices, at| {
            total.add(&self.points_of_chunk::<R>(first, slices, kept, (block, at))?);
            Ok(())
        })?;
        let last = count + chunk.behind();
        if let Some((next, _)) = chunk.next {
            window.write(within(count, last), |block, slices, at| {
                let slices = slices.start - count..slices.end - count;
                block.copy_from(next, slices, at);
                Ok(())
            })?;
        }
        if slices.end == last && !slices.is_empty() {
            window.write(last..last + 1, |block, _, at| {
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
        block: &mut Block,
        ends: &mut Ends,
        sums: &mut Array<3>,
    ) {
        let (input, speeds) = (
            ForceInput::new(self.state, self.reference, block),
            self.speeds,
        );
        ends.pairs(sums, |run, sums| {
            R::run(Dissipated {
                pairs,
                input,
                speeds,
                run,
                sums,
            });
        });
        ends.add(sums);
        let (sums, layout) = (sums.components(), self.reference.layout);
        if let Some(half_grad) = &mut block.half_grad {
            parallel::map_slabs(half_grad.slabs_mut(), |slab, half_grad| {
                let run = layout.slab_range(slab);
                R::run(Bound {
                    sums,
                    run,
                    half_grad,
                });
            });
        }
    }
}

impl Sweep {
    /// Of a body.
    pub fn new(reference: &Reference, needs: Needs) -> Self {
        let layout = reference.layout;
        let reach = reference.slices.reach().max(1);
        let reaches = (layout.slices / (CHUNKS * reach)).clamp(REACHES.0, REACHES.1);
        let each = (reaches * reach).max(layout.slab);
        let block = |slices: usize| {
            let layout = Layout {
                particles: slices * SLICE,
                slices,
                slab: layout.slab,
            };
            Block::new(layout, needs.areas, needs.gradients)
        };
        let chunks = layout.slices.div_ceil(each);
        let store = if needs.whole {
            Store::Whole(Block::new(layout, needs.areas, needs.gradients))
        } else {
            Store::Chunks {
                heads: (0..chunks).map(|_| block(reach)).collect(),
                windows: PerThread::new(|| {
                    // One more for what lies behind the body.
                    let capacity = (TILE + reach + 1).next_power_of_two();
                    Window {
                        block: block(capacity + 1),
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
                behind: vec![Slots([0.0; SLICE]); chunks * 3 * reach],
            },
        }
    }

    /// The block of the whole body, where it is kept.
    pub fn whole(&self) -> Option<&Block> {
        match &self.store {
            Store::Whole(block) => Some(block),
            Store::Chunks { .. } => None,
        }
    }

    /// Number of chunks.
    #[cfg(test)]
    pub fn chunks(&self) -> usize {
        self.layout.slices.div_ceil(self.ends.each)
    }

    /// All passes over the body; the length is still squared.
    pub fn run<R: Runner>(
        &mut self,
        passes: Passes,
        mut out: Outputs,
        force: &mut Array<3>,
    ) -> Result<Evaluation, Breakdown> {
        let Self { layout, ends, .. } = self;
        let (layout, each, reach) = (*layout, ends.each, ends.reach);
        let total = match &mut self.store {
            Store::Whole(block) => {
                let slabs = std::iter::zip(out.pieces(layout.slab), block.slabs_mut());
                let points = parallel::map_slabs(slabs.collect(), |slab, (kept, block)| {
                    let run = layout.slab_range(slab);
                    passes.points::<R>(run, PointOutput { kept, block })
                });
                let points = Evaluation::sum(points)?;
                if let (Pairs::Closed(pairs), Some(_)) =
                    (passes.reference.pair_vectors(), &block.half_grad)
                {
                    passes.bound::<R, _>(pairs, block, ends, force);
                }
                let input = ForceInput::new(passes.state, passes.reference, block);
                let forces = ends.pairs(force, |run, sums| passes.forces::<R>(input, run, 0, sums));
                Evaluation::sum([points].into_iter().chain(forces).map(Ok))?
            }
            Store::Chunks { heads, windows } => {
                let chunks = std::iter::zip(out.pieces(each), &mut *heads).collect();
                let points = parallel::map_slabs(chunks, |chunk, (mut kept, head)| {
                    let (first, slices) = layout.piece_range(chunk, each);
                    let starts = (0..slices.min(reach)).step_by(TILE);
                    Evaluation::sum(starts.map(|start| {
                        let tile = start..slices.min(reach).min(start + TILE);
                        passes.points_of_chunk::<R>(first, tile, &mut kept, (&mut *head, start))
                    }))
                });
                let points = Evaluation::sum(points)?;
                let chunks = std::iter::zip(out.pieces(each), ends.chunks(force));
                let heads = &*heads;
                let head = |chunk: usize| {
                    let (_, slices) = layout.piece_range(chunk, each);
                    (&heads[chunk], slices.min(reach))
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
        ends.add(force);
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
        blocks + std::mem::size_of_val(&self.ends.behind[..])
    }
}
