//! A run for an accuracy: pilot runs, a model of their error, the resolution that a tolerance takes.
//!
//! ```text
//! Search::next_task  ->  Pilot | Final  ->  run it  ->  Search::succeeded | failed  ->  next_task ...
//! ```
//!
//! | what | where |
//! |---|---|
//! | the scene with finer or coarser cells | [`Ladder`] |
//! | what is asked for, at the instants of the history | [`Quantity`], [`Sampler`], [`Series`] |
//! | order of convergence, errors and their bands | [`Fit`] |
//! | which run comes next, and when to give up | [`Search`] |
//! | what came of it, as JSON | [`Report`] |
//!
//! The error of a run u_h is max |u_h - u| over max |u|, both over the instants of the scene's history
//! and, for a vector, in the Euclidean norm. Temperatures count from their value at the start, because
//! the zero of the Kelvin scale is of no account for what a load does to a body.
//!
//! The time step is a fixed share of the cells' size (CFL), so that refining a scene refines its steps
//! as well and the error of both is one. A scene with a fixed `numerics.time_step` keeps that step: its
//! error of time integration, which does not fall, is not estimated, and such a scene is refused.

mod model;
mod quantity;
mod refine;
mod report;
mod search;

pub use model::{Band, Fit, Verdict};
pub use quantity::{Quantity, Sampler, Series};
pub use refine::{Ladder, Level};
pub use report::{Attempt, Cost, Prediction, Report};
pub use search::{Ask, Run, Search, Task};
