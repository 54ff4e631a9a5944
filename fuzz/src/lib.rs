//! What is fuzzed: `README.md`.

mod calls;
mod fmi;
mod inputs;
mod number;

pub use calls::calls;
pub use fmi::fmi;
pub use inputs::{mesh, scene, snapshot};
