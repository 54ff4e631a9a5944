//! Values of a scene: a number, an expression in X, Y, Z, t, a table in time, or driven from outside;
//! and the functions that they compile to.

use std::fmt;

use schemars::JsonSchema;
use serde::de::value::{MapAccessDeserializer, SeqAccessDeserializer};
use serde::de::{self, Deserialize, Deserializer};
use serde::{Deserialize as DeriveDeserialize, Serialize};

use super::expression::Expression;
use crate::error::{Code, Error, Result};

/// A scalar in space and time.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
#[serde(untagged, deny_unknown_fields)]
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
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
#[serde(untagged, deny_unknown_fields)]
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
#[derive(Debug, Clone, PartialEq, Serialize, DeriveDeserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Table<V> {
    /// Strictly increasing times [s].
    pub time: Vec<f64>,
    /// One value per time.
    pub value: Vec<V>,
}

/// The object form of a value: `{"table": ...}` or `{"external": ..., "per_particle": ...}`.
#[derive(DeriveDeserialize)]
#[serde(deny_unknown_fields)]
struct Object<V> {
    table: Option<Table<V>>,
    external: Option<V>,
    per_particle: Option<bool>,
}

/// An object form that is one of the two.
enum Driven<V> {
    Table(Table<V>),
    External(V, bool),
}

impl<V> Driven<V> {
    fn from_map<'de, A>(map: A) -> std::result::Result<Self, A::Error>
    where
        A: de::MapAccess<'de>,
        V: Deserialize<'de>,
    {
        let object = Object::<V>::deserialize(MapAccessDeserializer::new(map))?;
        match (object.table, object.external, object.per_particle) {
            (Some(table), None, None) => Ok(Self::Table(table)),
            (None, Some(start), per_particle) => {
                Ok(Self::External(start, per_particle.unwrap_or(false)))
            }
            (Some(_), None, Some(_)) => Err(de::Error::custom(
                "`per_particle` belongs to `external`, not to `table`",
            )),
            _ => Err(de::Error::custom(
                "expected exactly one of the keys `table` and `external`",
            )),
        }
    }
}

/// Answers all numbers of JSON with one function of an `f64`.
macro_rules! visit_numbers {
    ($make:expr) => {
        fn visit_f64<E: de::Error>(self, v: f64) -> std::result::Result<Self::Value, E> {
            Ok($make(v))
        }
        fn visit_i64<E: de::Error>(self, v: i64) -> std::result::Result<Self::Value, E> {
            Ok($make(v as f64))
        }
        fn visit_u64<E: de::Error>(self, v: u64) -> std::result::Result<Self::Value, E> {
            Ok($make(v as f64))
        }
    };
}
pub(super) use visit_numbers;

impl<'de> Deserialize<'de> for Scalar {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> std::result::Result<Self, D::Error> {
        struct Visitor;
        impl<'de> de::Visitor<'de> for Visitor {
            type Value = Scalar;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(r#"a number, an expression in X, Y, Z and t, {"table": ...} or {"external": ...}"#)
            }
            visit_numbers!(Scalar::Constant);
            fn visit_str<E: de::Error>(self, v: &str) -> std::result::Result<Scalar, E> {
                Ok(Scalar::Expression(v.to_owned()))
            }
            fn visit_map<A: de::MapAccess<'de>>(
                self,
                map: A,
            ) -> std::result::Result<Scalar, A::Error> {
                Ok(match Driven::from_map(map)? {
                    Driven::Table(table) => Scalar::Table { table },
                    Driven::External(external, per_particle) => Scalar::External {
                        external,
                        per_particle,
                    },
                })
            }
        }
        deserializer.deserialize_any(Visitor)
    }
}

impl<'de> Deserialize<'de> for Vector {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> std::result::Result<Self, D::Error> {
        struct Visitor;
        impl<'de> de::Visitor<'de> for Visitor {
            type Value = Vector;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(r#"a list of three components, each a number or an expression in X, Y, Z and t, or {"table": ...} or {"external": [x, y, z]}"#)
            }
            fn visit_seq<A: de::SeqAccess<'de>>(
                self,
                seq: A,
            ) -> std::result::Result<Vector, A::Error> {
                <[Option<Scalar>; 3]>::deserialize(SeqAccessDeserializer::new(seq))
                    .map(Vector::Components)
            }
            fn visit_map<A: de::MapAccess<'de>>(
                self,
                map: A,
            ) -> std::result::Result<Vector, A::Error> {
                Ok(match Driven::from_map(map)? {
                    Driven::Table(table) => Vector::Table { table },
                    Driven::External(external, per_particle) => Vector::External {
                        external,
                        per_particle,
                    },
                })
            }
        }
        deserializer.deserialize_any(Visitor)
    }
}

/// A [`Scalar`] compiled for evaluation by any number of threads: no look-up by name, and no
/// allocation for an expression of up to 32 operands.
#[derive(Debug, Clone)]
pub enum ScalarFunction {
    /// Constant.
    Constant(f64),
    /// Expression in X, Y, Z and t.
    Expression(Expression),
    /// Piecewise linear in time.
    Table(Interpolation<1>),
    /// Set from outside: who owns the inputs replaces the start value.
    External {
        /// Start value.
        start: f64,
        /// One value per particle of the patch.
        per_particle: bool,
    },
}

/// A [`Vector`] compiled for evaluation.
#[derive(Debug, Clone)]
pub enum VectorFunction {
    /// By components; `None` is free.
    Components([Option<ScalarFunction>; 3]),
    /// Piecewise linear in time.
    Table(Interpolation<3>),
    /// Set from outside: who owns the inputs replaces the start value.
    External {
        /// Start value.
        start: [f64; 3],
        /// One value per particle of the patch.
        per_particle: bool,
    },
}

/// Piecewise linear interpolation of N numbers in time.
#[derive(Debug, Clone, PartialEq)]
pub struct Interpolation<const N: usize> {
    time: Vec<f64>,
    value: Vec<[f64; N]>,
}

impl<const N: usize> Interpolation<N> {
    /// The errors carry the path below the table's owner: `table.time[2]`.
    fn new(time: &[f64], value: Vec<[f64; N]>) -> Result<Self> {
        let error = |path: &str, message: &str| Err(Error::scene(path, message));
        if time.is_empty() {
            return error("table.time", "a table needs at least one time");
        }
        if time.len() != value.len() {
            return error(
                "table.value",
                &format!(
                    "a table has one value per time: here are {} times and {} values",
                    time.len(),
                    value.len()
                ),
            );
        }
        for (i, t) in time.iter().enumerate() {
            if !t.is_finite() {
                return error(
                    &format!("table.time[{i}]"),
                    &format!("expected a finite time instead of {t}"),
                );
            }
            if i > 0 && *t <= time[i - 1] {
                return error(
                    &format!("table.time[{i}]"),
                    &format!(
                        "the times of a table increase strictly, but {t} follows {}",
                        time[i - 1]
                    ),
                );
            }
        }
        for (i, v) in value.iter().enumerate() {
            if !v.iter().all(|v| v.is_finite()) {
                return error(
                    &format!("table.value[{i}]"),
                    &format!("expected finite numbers instead of {v:?}"),
                );
            }
        }
        Ok(Self {
            time: time.to_vec(),
            value,
        })
    }

    /// The value at time `t`.
    pub fn eval(&self, t: f64) -> [f64; N] {
        let after = self.time.partition_point(|time| *time <= t);
        if after == 0 {
            return self.value[0];
        }
        if after == self.time.len() {
            return self.value[after - 1];
        }
        let (t0, t1) = (self.time[after - 1], self.time[after]);
        let (v0, v1) = (self.value[after - 1], self.value[after]);
        let s = (t - t0) / (t1 - t0);
        std::array::from_fn(|c| v0[c] + s * (v1[c] - v0[c]))
    }

    fn is_constant(&self) -> bool {
        self.value.iter().all(|v| *v == self.value[0])
    }
}

impl Scalar {
    /// Compiles and checks the value.
    ///
    /// # Errors
    /// [`Code::InvalidScene`] for a bad expression, table or number; a path in it is relative to the value.
    pub fn compile(&self) -> Result<ScalarFunction> {
        let finite = |v: f64| {
            if v.is_finite() {
                Ok(v)
            } else {
                Err(Error::new(
                    Code::InvalidScene,
                    format!("expected a finite number instead of {v}"),
                ))
            }
        };
        Ok(match self {
            Scalar::Constant(v) => ScalarFunction::Constant(finite(*v)?),
            Scalar::Expression(text) => {
                let expression =
                    Expression::parse(text).map_err(|m| Error::new(Code::InvalidScene, m))?;
                if expression.depends_on_space() || expression.depends_on_time() {
                    ScalarFunction::Expression(expression)
                } else {
                    let value = expression.eval([0.0; 3], 0.0);
                    ScalarFunction::Constant(finite(value).map_err(|_| {
                        Error::new(
                            Code::InvalidScene,
                            format!("the expression `{text}` is {value}, not a finite number"),
                        )
                    })?)
                }
            }
            Scalar::Table { table } => ScalarFunction::Table(Interpolation::new(
                &table.time,
                table.value.iter().map(|v| [*v]).collect(),
            )?),
            Scalar::External {
                external,
                per_particle,
            } => ScalarFunction::External {
                start: finite(*external).map_err(|e| e.at_path("external"))?,
                per_particle: *per_particle,
            },
        })
    }
}

impl Vector {
    /// Compiles and checks the value.
    ///
    /// # Errors
    /// [`Code::InvalidScene`] for a bad expression, table or number; a path in it is relative to the value.
    pub fn compile(&self) -> Result<VectorFunction> {
        Ok(match self {
            Vector::Components(components) => {
                let mut functions = [None, None, None];
                for (c, component) in components.iter().enumerate() {
                    let Some(scalar) = component else { continue };
                    let function = scalar.compile().map_err(|e| below(&format!("[{c}]"), e))?;
                    if matches!(function, ScalarFunction::External { .. }) {
                        return Err(Error::scene(
                            format!("[{c}]"),
                            r#"a component cannot be external by itself; make the whole vector external: {"external": [x, y, z]}"#,
                        ));
                    }
                    functions[c] = Some(function);
                }
                VectorFunction::Components(functions)
            }
            Vector::Table { table } => {
                VectorFunction::Table(Interpolation::new(&table.time, table.value.clone())?)
            }
            Vector::External {
                external,
                per_particle,
            } => {
                if let Some(c) = external.iter().position(|v| !v.is_finite()) {
                    return Err(Error::scene(
                        format!("external[{c}]"),
                        format!("expected a finite number instead of {}", external[c]),
                    ));
                }
                VectorFunction::External {
                    start: *external,
                    per_particle: *per_particle,
                }
            }
        })
    }
}

/// Puts `base` before the path of an error that is relative to it.
pub(super) fn below(base: &str, error: Error) -> Error {
    let path = match error.place().path.as_deref() {
        None | Some("") => base.to_owned(),
        Some(rest) if rest.starts_with('[') => format!("{base}{rest}"),
        Some(rest) => format!("{base}.{rest}"),
    };
    error.at_path(path)
}

impl ScalarFunction {
    /// The value at initial position `x` [m] and time `t` [s]; the start value if driven from outside.
    /// The caller checks that it is finite.
    pub fn eval(&self, x: [f64; 3], t: f64) -> f64 {
        match self {
            Self::Constant(v) => *v,
            Self::Expression(expression) => expression.eval(x, t),
            Self::Table(table) => table.eval(t)[0],
            Self::External { start, .. } => *start,
        }
    }
    /// Whether it has the same value always and everywhere; what is driven from outside is not constant.
    pub fn is_constant(&self) -> bool {
        !self.depends_on_space() && !self.depends_on_time()
    }
    /// Whether it may differ from particle to particle.
    pub fn depends_on_space(&self) -> bool {
        match self {
            Self::Constant(_) | Self::Table(_) => false,
            Self::Expression(expression) => expression.depends_on_space(),
            Self::External { per_particle, .. } => *per_particle,
        }
    }
    /// Whether it may change in time.
    pub fn depends_on_time(&self) -> bool {
        match self {
            Self::Constant(_) => false,
            Self::Expression(expression) => expression.depends_on_time(),
            Self::Table(table) => !table.is_constant(),
            Self::External { .. } => true,
        }
    }
}

impl VectorFunction {
    /// The value at initial position `x` [m] and time `t` [s]; a free component is 0, and what is
    /// driven from outside has its start value. The caller checks that it is finite.
    pub fn eval(&self, x: [f64; 3], t: f64) -> [f64; 3] {
        match self {
            Self::Components(components) => std::array::from_fn(|c| {
                components[c]
                    .as_ref()
                    .map_or(0.0, |component| component.eval(x, t))
            }),
            Self::Table(table) => table.eval(t),
            Self::External { start, .. } => *start,
        }
    }
    /// Which components are free (`null` in the scene).
    pub fn free(&self) -> [bool; 3] {
        match self {
            Self::Components(components) => std::array::from_fn(|c| components[c].is_none()),
            _ => [false; 3],
        }
    }
    /// Whether it has the same value always and everywhere; what is driven from outside is not constant.
    pub fn is_constant(&self) -> bool {
        !self.depends_on_space() && !self.depends_on_time()
    }
    /// Whether it may differ from particle to particle.
    pub fn depends_on_space(&self) -> bool {
        match self {
            Self::Components(components) => components
                .iter()
                .flatten()
                .any(ScalarFunction::depends_on_space),
            Self::Table(_) => false,
            Self::External { per_particle, .. } => *per_particle,
        }
    }
    /// Whether it may change in time.
    pub fn depends_on_time(&self) -> bool {
        match self {
            Self::Components(components) => components
                .iter()
                .flatten()
                .any(ScalarFunction::depends_on_time),
            Self::Table(table) => !table.is_constant(),
            Self::External { .. } => true,
        }
    }
}
