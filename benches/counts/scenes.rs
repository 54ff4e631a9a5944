//! What is counted: a column at the start of a twist with one thing after another on top, and small cases.

use urlsph::Scene;

use crate::column::{self, HEAT, JITTER, JOHNSON_COOK, VON_MISES};

/// The column as it is, elastic, and what the others are compared with.
pub const ELASTIC: &str = "elastic";

/// A scene whose instructions are counted.
pub struct Counted {
    pub name: &'static str,
    /// Whether it stands in the table of the README.
    pub shown: bool,
    overrides: &'static [&'static str],
}

impl Counted {
    pub fn read(&self) -> urlsph::Result<Scene> {
        // 7 x 37 x 7 particles: more would take longer under valgrind and count the same.
        column::scene(1.0 / 6.0, self.overrides)
    }
}

const fn shown(name: &'static str, overrides: &'static [&'static str]) -> Counted {
    Counted {
        name,
        shown: true,
        overrides,
    }
}

const fn guarded(name: &'static str, overrides: &'static [&'static str]) -> Counted {
    Counted {
        name,
        shown: false,
        overrides,
    }
}

/// More strain than the few steps that are counted reach.
const STRAINED: &str = r#"numerics.reference_update={"when": {"strain": 0.2}}"#;
const EVERY_STEP: &str = "numerics.reference_update=every_step";

pub const SCENES: &[Counted] = &[
    shown(ELASTIC, &[]),
    shown("heat with conduction", &[HEAT]),
    shown("von Mises plasticity", &[VON_MISES]),
    shown(
        "Johnson–Cook plasticity, heat with conduction",
        &[JOHNSON_COOK, HEAT],
    ),
    shown(
        "independent j, volume dissipation D^j",
        &["numerics.state=fj", "numerics.volume_dissipation=0.05"],
    ),
    shown(
        "angular-momentum projection",
        &["numerics.angular_momentum_projection=true"],
    ),
    shown("update at every step, kernel option 1", &[EVERY_STEP]),
    shown(
        "update at every step, kernel option 3",
        &[EVERY_STEP, "numerics.kernel_option=3"],
    ),
    shown(
        "sums over pairs in single precision",
        &["numerics.precision=single"],
    ),
    guarded(
        "single precision, 20 % jitter, repaired",
        &["numerics.precision=single", JITTER],
    ),
    guarded(
        "update at a strain, kernel option 1, no update",
        &[STRAINED],
    ),
    guarded(
        "update at a strain, kernel option 3, no update",
        &[STRAINED, "numerics.kernel_option=3"],
    ),
    guarded("without dissipation", &["numerics.dissipation=false"]),
    guarded("first order", &["numerics.reconstruction=none"]),
    guarded("minmod limiter", &["numerics.limiter=minmod"]),
    guarded("shock limiter", &["numerics.limiter=shock"]),
    guarded(
        "Venkatakrishnan limiter",
        &["numerics.limiter=venkatakrishnan"],
    ),
    guarded("independent h and j", &["numerics.state=fhj"]),
    guarded(
        "20 % jitter, operators of the kernel",
        &[JITTER, "numerics.operators=kernel"],
    ),
    guarded("20 % jitter, repaired", &[JITTER]),
    guarded(
        "20 % jitter, repaired, update at every step, kernel option 3",
        &[JITTER, EVERY_STEP, "numerics.kernel_option=3"],
    ),
    guarded(
        "20 % jitter, repaired, update at a strain, kernel option 3, no update",
        &[JITTER, STRAINED, "numerics.kernel_option=3"],
    ),
    guarded(
        "20 % jitter, operators of the mesh",
        &[JITTER, "numerics.operators=mesh", "numerics.neighbours=26"],
    ),
];

/// Cases of `tests/cases` and the sizes of which pair-updates and errors are compared: seconds in all.
pub const CASE_SIZES: &[(&str, &str)] = &[
    ("bending", "M1"),
    ("twisting", "M1"),
    ("tension", "M2"),
    ("elastic-cube", "9"),
    ("slab", "21"),
    ("thermo-wave", "21"),
    ("cable", "306"),
    ("copper-bar", "437"),
    ("johnson-cook-bar", "437"),
];
