//! What is fuzzed. The tests of the library run the same functions on the corpus.

mod calls;
mod fmi;
mod inputs;

pub use calls::calls;
pub use fmi::fmi;
pub use inputs::{mesh, scene, snapshot};
