//! Values of a scene: a number, an expression in X, Y, Z, t, a table in time, or driven from outside.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A scalar in space and time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Scalar {
    /// Constant.
    Constant(f64),
    /// Expression in `X`, `Y`, `Z` (initial position [m]) and `t` (time [s]).
    Expression(String),
    /// Piecewise linear in time.
    Table {
        /// The table.
        table: Table<f64>,
    },
    /// Set from outside; the number is the start value, one for the patch.
    External {
        /// Start value.
        external: f64,
        /// One value per particle of the patch instead of one for the patch (FMI 3.0 input array).
        #[serde(default)]
        per_particle: bool,
    },
}

/// A vector in space and time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Vector {
    /// By components; `null` only where a component may stay free.
    Components([Option<Scalar>; 3]),
    /// Piecewise linear in time.
    Table {
        /// The table.
        table: Table<[f64; 3]>,
    },
    /// Set from outside.
    External {
        /// Start value.
        external: [f64; 3],
        /// One value per particle of the patch instead of one for the patch (FMI 3.0 input array).
        #[serde(default)]
        per_particle: bool,
    },
}

/// Piecewise linear in time, constant before the first and after the last entry.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Table<V> {
    /// Strictly increasing times [s].
    pub time: Vec<f64>,
    /// One value per time.
    pub value: Vec<V>,
}
