//! Acceptance: the example scenes against reference solutions, exact solutions and conservation
//! laws. Every check prints its residual and tolerance (`cargo test --release --test acceptance --
//! --nocapture`); `cargo xtask validate` runs the long ones, which are ignored here.

mod accuracy;
mod cable;
#[path = "../cases/mod.rs"]
mod cases;
mod columns;
#[path = "../common/mod.rs"]
mod common;
mod conservation;
mod elastic_cube;
mod heat;
mod homogeneous;
mod irregular;
mod metals;
mod numerics;
mod precision;
mod punch;
mod reproducibility;
mod slab_heating;
mod stability;
mod support;
mod swinging_cube;
mod thermo_wave;
mod updates;
