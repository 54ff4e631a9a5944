//! Formulations: state fields, kinematics and rates. They never name a law.

mod advance;
pub mod angular_momentum;
mod conduction;
mod heat;
mod laws;
pub mod limiter;
mod passes;
mod precision;
pub mod riemann;
pub mod staleness;
mod sweep;
pub mod url;
