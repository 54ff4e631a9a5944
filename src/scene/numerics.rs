//! Discretisation and time integration: the schema, and what it must satisfy.

use std::fmt;

use schemars::JsonSchema;
use serde::de::value::MapAccessDeserializer;
use serde::{Deserialize, Deserializer, Serialize, de};

use super::validate::{positive, require};
use crate::error::Result;

/// Discretisation and time integration.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Numerics {
    /// Neighbours of a particle.
    pub neighbours: Neighbours,
    /// What gradients and forces are made of; default `kernel` where the particles form a lattice,
    /// or where `weights` are `tributary`, and `repaired` elsewhere.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub operators: Option<Operators>,
    /// Weights inside the kernel gradient.
    pub weights: Weights,
    /// Smoothing factor f_h: h_b = f_h x largest distance to a neighbour ([URL22] 37).
    pub smoothing_factor: f64,
    /// How kernels follow an updated reference ([URL22] 49-52), 1 to 4.
    #[schemars(range(min = 1, max = 4))]
    pub kernel_option: u8,
    /// When the reference configuration is updated.
    pub reference_update: ReferenceUpdate,
    /// Precision of the sums over pairs.
    pub precision: Precision,
    /// Which incremental deformation measures are independent unknowns.
    pub state: StateMeasures,
    /// Reconstruction of the velocity at the middle of a pair.
    pub reconstruction: Reconstruction,
    /// Limiter of the linear reconstruction.
    pub limiter: Limiter,
    /// Riemann dissipation of the momentum equation, D^p; `false` leaves it out.
    pub dissipation: bool,
    /// Share of D^p in flow that the reconstruction resolves, above 0 and at most 1. Less of it is more
    /// accurate where the dissipation is the largest error, as in metal impact, and damps
    /// the shortest waves less. What the `shock` limiter adds is not reduced.
    #[schemars(range(max = 1.0), extend("exclusiveMinimum" = 0))]
    pub dissipation_coefficient: f64,
    /// Coefficient of the dissipation D^j of the volume equation; needs `j` among the unknowns. 0 leaves it out.
    pub volume_dissipation: f64,
    /// Projection of the internal forces that conserves angular momentum ([URL22] section 6).
    pub angular_momentum_projection: bool,
    /// CFL number; default 0.45 with 6 neighbours, otherwise 0.9, and 0.8 where the Poisson ratio is
    /// negative.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cfl: Option<f64>,
    /// Fixed time step [s] instead of the CFL condition.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time_step: Option<f64>,
    /// Most that a step may strain or turn a particle: the step times the norm of the spatial velocity
    /// gradient, |grad_x v|; default 0.25, and 0 sets no limit. Only in violent motion, such as impacts at
    /// the speed of sound or a turn in 36 steps, it is less than the CFL condition allows.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0))]
    pub strain_increment: Option<f64>,
    /// Share of the first stable step at which the run stops because the body is deformed beyond what
    /// its particles resolve; default 0.001, and 0 sets no limit.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0), extend("exclusiveMaximum" = 1))]
    pub smallest_step: Option<f64>,
}

impl Default for Numerics {
    fn default() -> Self {
        Self {
            neighbours: Neighbours::Lattice(18),
            operators: None,
            weights: Weights::Unit,
            smoothing_factor: 0.6,
            kernel_option: 1,
            reference_update: ReferenceUpdate::Never,
            precision: Precision::Double,
            state: StateMeasures::F,
            reconstruction: Reconstruction::Linear,
            limiter: Limiter::None,
            dissipation: true,
            dissipation_coefficient: 1.0,
            volume_dissipation: 0.0,
            angular_momentum_projection: false,
            cfl: None,
            time_step: None,
            strain_increment: None,
            smallest_step: None,
        }
    }
}

impl Numerics {
    /// Whether an update recomputes the kernels, and with them the repair of the operators.
    pub(crate) fn redoes_the_repair(&self) -> bool {
        self.kernel_option >= 3 && self.reference_update != ReferenceUpdate::Never
    }

    /// The operators: the scene's choice, or the kernel's where particles form a lattice, on which they
    /// close, and where weights are as printed; repaired ones elsewhere.
    pub(crate) fn operators_on(&self, lattice: bool) -> Operators {
        self.operators.unwrap_or(match self.weights {
            Weights::Unit if !lattice => Operators::Repaired,
            _ => Operators::Kernel,
        })
    }

    /// The CFL number: the scene's, or the one that is proven stable for the largest number of
    /// neighbours of a particle and the Poisson ratio.
    ///
    /// With 6 neighbours every pair of a checkerboard jumps, and D^p damps it at the rate
    /// (2 c_p + 4 c_s)/dx, which three stages bear up to 2.51/dt: alpha < 0.52 for a Poisson ratio of 0,
    /// and 0.46 down to -1. More neighbours leave that wave to fewer of their pairs: with 18 random
    /// velocities die down up to 0.95 for a ratio of 0, and to 0.84 for -0.9.
    pub fn cfl_number(&self, neighbours: usize, poisson_ratio: f64) -> f64 {
        self.cfl.unwrap_or(match (neighbours, poisson_ratio < 0.0) {
            (..=6, _) => 0.45,
            (_, true) => 0.8,
            (_, false) => 0.9,
        })
    }

    /// Most that a step may strain or turn a particle, infinite without a limit, and where the step is fixed.
    ///
    /// Three stages take 8e-5 of its energy from a rotation of which a step makes as much as the default. The CFL
    /// condition knows waves but no flow: behind an impact it allows a step that turns a particle inside out.
    pub fn strain_increment(&self) -> f64 {
        match self.strain_increment {
            _ if self.time_step.is_some() => f64::INFINITY,
            None => 0.25,
            Some(0.0) => f64::INFINITY,
            Some(increment) => increment,
        }
    }

    /// Share of the first stable step at which a run stops.
    pub fn smallest_step(&self) -> f64 {
        self.smallest_step.unwrap_or(1e-3)
    }
}

/// 6, 18 or 26 neighbours of a lattice or a mesh, or `{"radius": r}`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
#[serde(untagged, deny_unknown_fields)]
pub enum Neighbours {
    /// Neighbours on a lattice: 6 that share an edge of a cell, 18 that share a face, or 26 that share
    /// a cell. On a mesh the same as far as the cells go: in tetrahedra all three are the edges.
    Lattice(#[schemars(extend("enum" = [6, 18, 26]))] u8),
    /// All particles within a radius, in multiples of the largest lattice spacing; on a mesh, of the
    /// mean length of the edges at either particle, and only what hangs together within the radius.
    Radius {
        /// Radius over spacing.
        radius: f64,
    },
}

/// What gradients and forces are made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Operators {
    /// Corrected kernel gradients ([URL22] 42, 58): closed on a lattice.
    Kernel,
    /// Corrected kernel gradients with the smallest change that makes a uniform stress force-free on
    /// any particles.
    Repaired,
    /// Gradients of the shape functions of the mesh: exact too, without a kernel.
    Mesh,
}

/// Weights inside the kernel gradient.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Weights {
    /// Every neighbour weighs the same: uniform stress gives no force inside the body.
    Unit,
    /// Tributary volumes, as printed in [URL22] 42.
    Tributary,
}

/// When the reference configuration is updated.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum ReferenceUpdate {
    /// Never: total Lagrangian.
    Never,
    /// After every step: updated Lagrangian.
    EveryStep,
    /// After every n steps.
    Every(#[schemars(range(min = 1))] u32),
    /// After a step that takes a particle beyond a strain since the last update.
    When {
        /// Norm of the Green-Lagrange strain 1/2 (f^T f - I) since the last update, in which rotations do
        /// not count: above 0 and below 0.5, which is all that compression along one axis reaches.
        #[serde(default = "default_strain")]
        #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 0.5))]
        strain: f64,
    },
}

/// From `examples/updates.md`: kernels that are recomputed on the default operators of a lattice dissipate
/// the more the more often that is done, and from 0.2 on about as little as those of the initial configuration.
fn default_strain() -> f64 {
    0.2
}

/// Precision of the sums over pairs: velocity gradients, internal forces and dissipation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Precision {
    /// 64 bits everywhere.
    Double,
    /// 32 bits for what pairs read and for the sums over them; 64 bits for the state, the law, loads and
    /// energies. Forces and gradients are then good to about 1e-7 of what is summed.
    Single,
}

/// Which incremental deformation measures are independent unknowns.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum StateMeasures {
    /// f; h = cof f and j = det f.
    F,
    /// f and j; h = cof f.
    Fj,
    /// f, h and j.
    Fhj,
}

/// Reconstruction of the velocity at the middle of a pair.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Reconstruction {
    /// Piecewise constant: first order.
    None,
    /// Linear, with the corrected gradient: second order.
    Linear,
}

/// Limiter of the linear reconstruction.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Limiter {
    /// No limiter.
    None,
    /// Venkatakrishnan.
    Venkatakrishnan,
    /// Edge-wise minmod.
    Minmod,
    /// First order in pressure waves that the particles do not resolve; smooth flow and shear are
    /// left alone.
    Shock,
}

impl<'de> Deserialize<'de> for Neighbours {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> std::result::Result<Self, D::Error> {
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct Radius {
            radius: f64,
        }
        struct Visitor;
        impl<'de> de::Visitor<'de> for Visitor {
            type Value = Neighbours;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(r#"6, 18, 26 or {"radius": r}"#)
            }
            fn visit_u64<E: de::Error>(self, v: u64) -> std::result::Result<Neighbours, E> {
                u8::try_from(v)
                    .map(Neighbours::Lattice)
                    .map_err(|_| E::invalid_value(de::Unexpected::Unsigned(v), &self))
            }
            fn visit_map<A: de::MapAccess<'de>>(
                self,
                map: A,
            ) -> std::result::Result<Neighbours, A::Error> {
                let Radius { radius } = Radius::deserialize(MapAccessDeserializer::new(map))?;
                Ok(Neighbours::Radius { radius })
            }
        }
        deserializer.deserialize_any(Visitor)
    }
}

pub(super) fn validate(n: &Numerics) -> Result<()> {
    match n.neighbours {
        Neighbours::Lattice(count) => require(
            [6, 18, 26].contains(&count),
            "numerics.neighbours",
            &format!("expected 6, 18, 26 or {{\"radius\": r}} instead of {count}"),
        )?,
        Neighbours::Radius { radius } => require(
            radius.is_finite() && radius > 1.0,
            "numerics.neighbours.radius",
            &format!(
                "expected a finite radius above 1 (in multiples of the spacing) instead of {radius}"
            ),
        )?,
    }
    require(
        n.weights == Weights::Unit || matches!(n.operators, None | Some(Operators::Kernel)),
        "numerics.weights",
        "tributary weights belong to the operators `kernel`",
    )?;
    require(
        n.operators != Some(Operators::Mesh) || !n.redoes_the_repair(),
        "numerics.kernel_option",
        "options 3 and 4 recompute kernels, and the operators `mesh` have none: set 1 or 2, or the \
         operators `repaired`",
    )?;
    require(
        n.smoothing_factor > 0.5 && n.smoothing_factor <= 2.0,
        "numerics.smoothing_factor",
        &format!(
            "expected more than 0.5 (or the kernel does not reach its neighbours) and at most 2 instead of {}",
            n.smoothing_factor
        ),
    )?;
    require(
        (1..=4).contains(&n.kernel_option),
        "numerics.kernel_option",
        &format!("expected 1, 2, 3 or 4 instead of {}", n.kernel_option),
    )?;
    require(
        n.reference_update != ReferenceUpdate::Every(0),
        "numerics.reference_update.every",
        "expected at least 1 step between updates instead of 0; `never` is total Lagrangian",
    )?;
    if let ReferenceUpdate::When { strain } = n.reference_update {
        require(
            strain > 0.0 && strain < 0.5,
            "numerics.reference_update.when.strain",
            &format!("expected more than 0 and less than 0.5 instead of {strain}"),
        )?;
    }
    require(
        n.volume_dissipation.is_finite() && n.volume_dissipation >= 0.0,
        "numerics.volume_dissipation",
        &format!(
            "expected a finite number, 0 or more, instead of {}",
            n.volume_dissipation
        ),
    )?;
    require(
        n.volume_dissipation == 0.0 || n.state != StateMeasures::F,
        "numerics.volume_dissipation",
        "it acts on the volume equation, which needs `state` to be `fj` or `fhj`",
    )?;
    let coefficient = n.dissipation_coefficient;
    require(
        coefficient > 0.0 && coefficient <= 1.0,
        "numerics.dissipation_coefficient",
        &format!(
            "expected more than 0 and at most 1 instead of {coefficient}; `dissipation` set to false \
             leaves D^p out"
        ),
    )?;
    require(
        n.dissipation || coefficient == 1.0,
        "numerics.dissipation_coefficient",
        "the dissipation is switched off; set `dissipation` to true or leave the coefficient out",
    )?;
    let smallest = n.smallest_step();
    require(
        (0.0..1.0).contains(&smallest),
        "numerics.smallest_step",
        &format!("expected 0 or more and less than 1 instead of {smallest}"),
    )?;
    if n.limiter != Limiter::None {
        require(
            n.reconstruction == Reconstruction::Linear,
            "numerics.limiter",
            "a limiter needs `reconstruction` to be `linear`",
        )?;
        require(
            n.dissipation,
            "numerics.limiter",
            "a limiter acts on the dissipation, which is switched off; set `limiter` to `none` or `dissipation` to true",
        )?;
    }
    if let Some(cfl) = n.cfl {
        require(
            cfl > 0.0 && cfl <= 2.0,
            "numerics.cfl",
            &format!("expected more than 0 and at most 2 instead of {cfl}"),
        )?;
    }
    if let Some(increment) = n.strain_increment {
        require(
            increment >= 0.0 && increment.is_finite(),
            "numerics.strain_increment",
            &format!("expected 0 or more instead of {increment}; 0 sets no limit"),
        )?;
    }
    if let Some(step) = n.time_step {
        positive("numerics.time_step", step)?;
        require(
            n.strain_increment.is_none(),
            "numerics.time_step",
            "a fixed step knows no limits; give `time_step` or `strain_increment`, not both",
        )?;
        require(
            n.cfl.is_none(),
            "numerics.time_step",
            "a fixed step replaces the CFL condition; give `time_step` or `cfl`, not both",
        )?;
    }
    Ok(())
}
