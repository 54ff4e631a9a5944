//! When the reference configuration no longer serves: the strain since its last update.

use super::passes::lanes_from;
use crate::formulation::url::State;
use crate::lane::{Lane, Work, vectorised};
use crate::math::*;
use crate::parallel;
use crate::reference::load9;

/// Whether the Green-Lagrange strain since the last update, E = 1/2 (f^T f - I), has a norm above
/// `bound` at any particle. A rotation alone has none.
///
/// An answer for the whole body, and one that no order of the particles changes: any number of threads
/// updates at the same steps.
pub fn is_strained(state: &State, bound: f64) -> bool {
    let layout = state.f.layout();
    let f = state.f.components();
    let slabs = (0..layout.slabs()).collect();
    let strained = parallel::map_slabs(slabs, |_, slab| {
        let run = layout.slab_range(slab);
        vectorised(Strained { f, bound, run })
    });
    strained.contains(&true)
}

/// The same of a slab.
struct Strained<'a> {
    f: [&'a [f64]; 9],
    bound: f64,
    run: (usize, usize),
}

impl Work for Strained<'_> {
    type Output = bool;
    #[inline(always)]
    fn run<T: Lane>(self, token: T::Token) -> bool {
        // |f^T f - I|^2 = 4 |E|^2.
        let bound = T::splat(token, 4.0 * self.bound * self.bound);
        let minus = T::splat(token, -1.0);
        lanes_from::<T>(self.run).any(|(_, a)| {
            let f = load9::<T>(token, &self.f, a);
            let change = axpy9(&mat_mul(&transpose(&f), &f), minus, &identity(token));
            (double_dot(&change, &change) - bound).any_positive()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::{Array, Layout};
    use crate::parallel::Pool;

    /// One particle among many is deformed by `f`.
    fn state(f: &Mat3<f64>) -> State {
        let layout = Layout::new(5000);
        let mut all = Array::new(layout, flat(&IDENTITY));
        all.set(Layout::slot(3217), flat(f));
        State {
            x: Array::new(layout, [0.0; 3]),
            v: Array::new(layout, [0.0; 3]),
            f: all,
            h: None,
            j: None,
            eta: None,
            history: None,
        }
    }

    fn rotation(angle: f64) -> Mat3<f64> {
        // About (1, 2, 2)/3, by Rodrigues' formula.
        let n = [1.0 / 3.0, 2.0 / 3.0, 2.0 / 3.0];
        let (s, c) = angle.sin_cos();
        std::array::from_fn(|i| {
            let e = IDENTITY[i];
            let turned = cross(n, e);
            // Rows of the transpose are the turned axes.
            axpy3(add3(scale3(c, e), scale3(-s, turned)), (1.0 - c) * n[i], n)
        })
    }

    #[test]
    fn a_rotation_is_no_strain_and_changes_none() {
        let pool = Pool::new(2).expect("two threads");
        let stretch = [[1.08, 0.02, 0.0], [0.02, 0.95, -0.01], [0.0, -0.01, 1.01]];
        let c = mat_mul(&stretch, &stretch);
        let e = axpy9(&c, -1.0, &IDENTITY);
        let norm = 0.5 * double_dot(&e, &e).sqrt();
        for angle in [0.0, 0.3, 1.7, 3.1] {
            let r = rotation(angle);
            let rigid = state(&r);
            let both = state(&mat_mul(&r, &stretch));
            pool.install(|| {
                assert!(!is_strained(&rigid, 1e-14), "turned by {angle}");
                assert!(
                    is_strained(&both, norm * (1.0 - 1e-12)),
                    "turned by {angle}"
                );
                assert!(
                    !is_strained(&both, norm * (1.0 + 1e-12)),
                    "turned by {angle}"
                );
            });
        }
    }

    /// Compression along one axis reaches every bound that a scene may give.
    #[test]
    fn compression_counts_as_extension_does() {
        let pool = Pool::new(1).expect("one thread");
        for (stretch, strain) in [(1.2, 0.22), (0.8, 0.18), (0.1, 0.495)] {
            let mut f = IDENTITY;
            f[1][1] = stretch;
            let state = state(&f);
            pool.install(|| {
                assert!(
                    is_strained(&state, strain - 1e-12) && !is_strained(&state, strain + 1e-12)
                );
            });
        }
    }
}
