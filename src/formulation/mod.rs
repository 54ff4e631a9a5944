//! Formulations: state fields, kinematics and rates. They never name a law.

pub mod angular_momentum;
pub mod limiter;
pub mod riemann;
pub mod url;
