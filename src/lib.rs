//! Large-strain solid dynamics by Updated Reference Lagrangian SPH.

pub mod error;
pub mod ffi;
pub mod fields;
pub mod ledger;
pub mod output;
pub mod scene;
mod simulation;

pub use error::{Code, Error, Result};
pub use fields::{Configuration, FIELDS, Field, FieldInfo};
pub use ledger::{Energies, Momenta, Resultant};
pub use scene::Scene;
pub use simulation::{
    Control, Input, Patch, Plan, ProbeMotion, Progress, Quantity, Simulation, Snapshot, View,
};

/// Version of the library, the header and the FMU.
pub const VERSION: &str = env!("CARGO_PKG_VERSION");
