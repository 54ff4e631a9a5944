//! The settings that are compared, axis by axis.

/// A name and the overrides of the scene.
pub type Setting = (&'static str, &'static [&'static str]);

/// Settings of one kind, each run by itself on top of the scene's own.
pub type Axis = (&'static str, &'static [Setting]);

/// The scene as it is.
pub const OWN: Setting = ("as the scene", &[]);

/// At the strain that the schema proposes.
const STRAINED: &str = "numerics.reference_update={\"when\": {}}";
const EVERY_STEP: &str = "numerics.reference_update=every_step";

/// A new setting, or a new axis, is one entry here.
pub const AXES: &[Axis] = &[
    ("scene", &[OWN]),
    (
        "preset",
        &[
            ("fast", &["preset=fast"]),
            ("accurate", &["preset=accurate"]),
        ],
    ),
    (
        "neighbours",
        &[
            ("6 neighbours", &["numerics.neighbours=6"]),
            ("18 neighbours", &["numerics.neighbours=18"]),
            ("26 neighbours", &["numerics.neighbours=26"]),
        ],
    ),
    (
        "CFL",
        &[
            ("CFL 0.3", &["numerics.cfl=0.3"]),
            ("CFL 0.6", &["numerics.cfl=0.6"]),
            ("CFL 1.2", &["numerics.cfl=1.2"]),
            ("CFL 1.6", &["numerics.cfl=1.6"]),
            ("CFL 2", &["numerics.cfl=2"]),
        ],
    ),
    (
        "reconstruction",
        &[
            (
                "first order",
                &["numerics.limiter=none", "numerics.reconstruction=none"],
            ),
            ("no limiter", &["numerics.limiter=none"]),
            ("venkatakrishnan", &["numerics.limiter=venkatakrishnan"]),
            ("minmod", &["numerics.limiter=minmod"]),
            ("shock", &["numerics.limiter=shock"]),
        ],
    ),
    (
        "update of the reference",
        &[
            ("never updated", &["numerics.reference_update=never"]),
            (
                "updated every 10 steps",
                &["numerics.reference_update={\"every\": 10}"],
            ),
            ("updated every step", &[EVERY_STEP]),
            ("updated when strained", &[STRAINED]),
            (
                "every step, kernel option 2",
                &[EVERY_STEP, "numerics.kernel_option=2"],
            ),
            (
                "every step, kernel option 3",
                &[EVERY_STEP, "numerics.kernel_option=3"],
            ),
            (
                "every step, kernel option 4",
                &[EVERY_STEP, "numerics.kernel_option=4"],
            ),
            (
                "when strained, kernel option 3",
                &[STRAINED, "numerics.kernel_option=3"],
            ),
            (
                "when strained, kernel option 4",
                &[STRAINED, "numerics.kernel_option=4"],
            ),
            (
                "when strained, option 3, repaired",
                &[
                    STRAINED,
                    "numerics.kernel_option=3",
                    "numerics.operators=repaired",
                ],
            ),
            (
                "every step, option 3, repaired",
                &[
                    EVERY_STEP,
                    "numerics.kernel_option=3",
                    "numerics.operators=repaired",
                ],
            ),
        ],
    ),
    (
        "precision",
        &[("single precision", &["numerics.precision=single"])],
    ),
    (
        "dissipation",
        &[
            (
                "no dissipation",
                &[
                    "numerics.dissipation=false",
                    "numerics.dissipation_coefficient=1",
                    "numerics.limiter=none",
                ],
            ),
            ("dissipation 0.1", &["numerics.dissipation_coefficient=0.1"]),
            ("dissipation 0.3", &["numerics.dissipation_coefficient=0.3"]),
            ("dissipation 1", &["numerics.dissipation_coefficient=1"]),
        ],
    ),
    (
        "volume dissipation",
        &[
            (
                "no D^j",
                &["numerics.volume_dissipation=0", "numerics.state=f"],
            ),
            (
                "D^j 0.1",
                &["numerics.state=fj", "numerics.volume_dissipation=0.1"],
            ),
        ],
    ),
    (
        "physics",
        &[
            (
                "angular-momentum projection",
                &["numerics.angular_momentum_projection=true"],
            ),
            (
                "heat",
                &[
                    r#"heat={"specific_heat": 1900, "reference_temperature": 293.15, "conductivity": 0.2, "gruneisen_coefficient": 0}"#,
                ],
            ),
            ("no heat", &["heat=null"]),
        ],
    ),
];
