//! Formulations: state fields, kinematics and rates. They never name a law.

pub mod angular_momentum;
mod conduction;
pub mod limiter;
mod passes;
pub mod riemann;
pub mod url;
