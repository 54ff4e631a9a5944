//! Large-strain solid dynamics by Updated Reference Lagrangian SPH.
//!
//! A [`Scene`] (JSON) describes a body; a [`Simulation`] advances it. The path of the data, and
//! where the equations of [URL22] (de Campos, Gil, Lee, Giacomini, Bonet: A new Updated Reference
//! Lagrangian Smooth Particle Hydrodynamics algorithm, CMAME 392, 2022, 114680) are:
//!
//! | what | equations | where |
//! |---|---|---|
//! | JSON to a validated scene | | [`scene`] |
//! | particles, tributary volumes, patches | | `particles` |
//! | neighbours | | `neighbours` |
//! | kernel, corrected gradients, pseudo-areas, the four options | 37-52, 58 | `kernel`, `reference` |
//! | closure of the pseudo-areas on irregular particles | | `reference::repair` |
//! | neo-Hookean and Mooney-Rivlin laws | 5-8 | `material` |
//! | Hencky's elasticity and the radial return of plastic flow | remark 3; [URL23] 31-40 | `material::hencky` |
//! | von Mises and Johnson-Cook yield stresses | tables 3, 4; [URL23] 41, 42 | `material::von_mises`, `material::johnson_cook` |
//! | rates of v, f, h, j | 53-57 | `formulation::url` |
//! | Riemann dissipation and reconstruction | 59, 60 | `formulation::riemann`, `formulation::limiter` |
//! | precision of sums over pairs | | `formulation::precision`, `reference::single` |
//! | Runge-Kutta, time step | 61-63 | `integrator`, `simulation` |
//! | angular-momentum projection | 64-67 | `formulation::angular_momentum` |
//! | supports, loads, heat, contact, resultants | | `boundary` |
//! | pilot runs for a tolerance, observed order, error and its band | | [`accuracy`] |
//!
//! ```
//! use urlsph::{Scene, Simulation};
//! let scene = Scene::from_json(r#"{
//!     "geometry": {"box": {"min": [0, 0, 0], "max": [1, 1, 1], "spacing": 0.25}},
//!     "material": {"neo_hookean": {"density": 1100, "youngs_modulus": 1.7e7, "poisson_ratio": 0.3}},
//!     "boundary": {"y_min": {"support": "clamped"}, "y_max": {"traction": [0, 1e4, 0]}},
//!     "time": {"end": 0.01}
//! }"#, &[])?;
//! let mut simulation = Simulation::new(scene)?;
//! simulation.advance(0.01)?;
//! let top = simulation.patch_index("y_max")?;
//! assert!(simulation.resultant(top).mean_displacement[1] > 0.0);
//! # Ok::<(), urlsph::Error>(())
//! ```

pub mod accuracy;
mod aside;
mod boundary;
pub mod error;
pub mod ffi;
pub mod fields;
#[cfg(feature = "fmi")]
#[allow(unsafe_code)] // The C functions of FMI.
#[path = "../fmu/mod.rs"]
pub mod fmu;
mod formulation;
mod integrator;
mod kernel;
#[cfg(keys)]
#[allow(unsafe_code)] // Functions of the C library.
mod keys;
mod lane;
mod layout;
pub mod ledger;
mod material;
mod math;
mod neighbours;
pub mod output;
mod parallel;
mod particles;
mod plan;
mod reference;
pub mod scene;
mod simulation;
mod snapshot;

pub use boundary::{Input, Patch, Quantity};
pub use error::{Code, Error, Result};
pub use fields::{Configuration, FIELDS, Field, FieldInfo};
pub use ledger::{ContactResultant, Energies, HeatResultant, Momenta, Resultant};
pub use particles::MeshSummary;
pub use plan::Plan;
pub use reference::Repair;
pub use scene::Scene;
pub use simulation::{Control, ProbeMotion, Progress, Simulation, View};
pub use snapshot::Snapshot;

/// Version of the library, the header and the FMU.
pub const VERSION: &str = env!("CARGO_PKG_VERSION");
