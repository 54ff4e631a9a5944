//! What a run reports and writes.

pub mod variables;
