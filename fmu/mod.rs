//! A scene as a co-simulation FMU, for FMI 2.0 and FMI 3.0.
//!
//! One core serves both standards: `table` lists the variables of a scene, `instance` is the
//! state machine around a [`Simulation`](crate::Simulation), and `fmi2` and `fmi3` are the C
//! functions of the standards, in the same shared library as the C ABI. [`package`] writes the
//! archive.
//!
//! # What differs between the standards
//!
//! FMI 3.0 has arrays: values per particle are one variable. FMI 2.0 has scalars only, so vectors
//! appear as `boundary.top.traction[1]`, and arrays only in small numbers: the inputs per particle,
//! and the arrays of the patches that have them, if they are at most
//! 1000 scalars in all; otherwise such an input is one value for the
//! patch. Fields of the whole body are in FMI 3.0 alone.
//!
//! # Time
//!
//! A simulation starts at 0. If the importer's start time is another, the scene's `t` counts from it.

mod archive;
mod description;
mod documentation;
mod fmi2;
mod fmi3;
mod handle;
mod instance;
mod state;
mod table;

#[cfg(test)]
mod tests;

pub use archive::{find_library, package};
pub use description::model_description;

/// The version of the standard.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum FmiVersion {
    /// FMI 2.0: scalars only; understood by every tool.
    V2,
    /// FMI 3.0: with arrays.
    V3,
}

/// Identifier of the model: the name of the shared library in the archive.
const MODEL_IDENTIFIER: &str = "urlsph";
