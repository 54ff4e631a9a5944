//! Acceptance: the example scenes against reference solutions, exact solutions and conservation
//! laws. Every check prints its residual and tolerance (`cargo test --release --test acceptance --
//! --nocapture`); `cargo xtask validate` runs the long ones, which are ignored here.

mod cable;
mod columns;
mod conservation;
mod elastic_cube;
mod numerics;
mod reproducibility;
mod stability;
mod support;
