//! The precision in which sums over pairs run.
//!
//! In single precision velocity gradients, internal forces and dissipation are sums of 32-bit numbers, on vectors
//! twice as long and from half the memory: the state, the law, loads, heat and energies stay in double precision. So
//! increments are not rounded off where the state takes them up, small strains keep their digits, and what
//! single precision changes is a relative error of about 1e-7 in a force or a gradient.

use super::passes::lanes_from;
use super::url::State;
use crate::lane::{Precise, Real, Work, vectorised};
use crate::layout::{Array, Layout};
use crate::math::*;
use crate::parallel;
use crate::reference::{ReferenceReal, load3, store3};

/// A precision in which the pair passes run.
pub trait PairReal: ReferenceReal {
    /// What is copied of the state, and what is summed, where that is not done in place.
    type Copies: std::fmt::Debug + Send + Sync;
    /// Of a body.
    fn copies(layout: Layout) -> Self::Copies;
    /// Copies a new state.
    fn take(copies: &mut Self::Copies, state: &State);
    /// Where forces are summed, given where they are wanted, and x and v.
    fn sums<'a>(
        copies: &'a mut Self::Copies,
        state: &'a State,
        force: &'a mut Array<3>,
    ) -> (&'a mut Array<3, Self>, [[&'a [Self]; 3]; 2]);
    /// Hands the sums over.
    fn hand_over(copies: &Self::Copies, force: &mut Array<3>);
    /// Bytes held.
    fn bytes(copies: &Self::Copies) -> usize;
}

/// The state itself.
impl PairReal for f64 {
    type Copies = ();
    fn copies(_: Layout) {}
    fn take((): &mut (), _: &State) {}
    fn sums<'a>(
        (): &'a mut (),
        state: &'a State,
        force: &'a mut Array<3>,
    ) -> (&'a mut Array<3>, [[&'a [f64]; 3]; 2]) {
        (force, [state.x.components(), state.v.components()])
    }
    fn hand_over((): &(), _: &mut Array<3>) {}
    fn bytes((): &()) -> usize {
        0
    }
}

/// Copies in single precision.
#[derive(Debug)]
pub struct Rounded {
    /// x and v less those of a particle in the middle: the differences of neighbours, which are all that pairs
    /// need, are then good to the round-off of the body's size and of the speeds within it.
    x: Array<3, f32>,
    v: Array<3, f32>,
    force: Array<3, f32>,
}

impl PairReal for f32 {
    type Copies = Rounded;
    fn copies(layout: Layout) -> Rounded {
        let zeros = || Array::new(layout, [0.0; 3]);
        Rounded {
            x: zeros(),
            v: zeros(),
            force: zeros(),
        }
    }
    fn take(copies: &mut Rounded, state: &State) {
        let layout = state.x.layout();
        let middle = Layout::slot(layout.particles / 2);
        let (x, v) = (state.x.components(), state.v.components());
        let origins = [state.x.get(middle), state.v.get(middle)];
        let slabs = std::iter::zip(copies.x.slabs_mut(), copies.v.slabs_mut()).collect();
        parallel::map_slabs(slabs, |slab, (to_x, to_v)| {
            let run = layout.slab_range(slab);
            for (from, origin, to) in [(x, origins[0], to_x), (v, origins[1], to_v)] {
                vectorised(Round {
                    from,
                    origin,
                    run,
                    to,
                });
            }
        });
    }
    fn sums<'a>(
        copies: &'a mut Rounded,
        _: &'a State,
        _: &'a mut Array<3>,
    ) -> (&'a mut Array<3, f32>, [[&'a [f32]; 3]; 2]) {
        (
            &mut copies.force,
            [copies.x.components(), copies.v.components()],
        )
    }
    fn hand_over(copies: &Rounded, force: &mut Array<3>) {
        let (layout, from) = (force.layout(), copies.force.components());
        parallel::map_slabs(force.slabs_mut(), |slab, to| {
            vectorised(Round {
                from,
                origin: [0.0; 3],
                run: layout.slab_range(slab),
                to,
            });
        });
    }
    fn bytes(copies: &Rounded) -> usize {
        copies.x.bytes() + copies.v.bytes() + copies.force.bytes()
    }
}

/// Copies vectors, less an origin, in another precision.
struct Round<'a, E, F> {
    from: [&'a [E]; 3],
    origin: [f64; 3],
    run: (usize, usize),
    to: [&'a mut [F]; 3],
}

impl<E: Real, F: Real> Work for Round<'_, E, F> {
    type Output = ();
    #[inline(always)]
    fn run<T: Precise>(mut self, token: T::Token) {
        let origin = self.origin.map(|o| T::splat(token, o));
        for (at, a) in lanes_from::<T>(self.run) {
            let v = load3::<T>(token, &self.from, a);
            store3(&sub3(v, origin), &mut self.to, at);
        }
    }
}
