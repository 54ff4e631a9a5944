//! The sweeps: a scene, what is varied, up to where it goes, and what it is symmetric in.

use urlsph::{Result, Scene};

use crate::cases::example;

/// What a series varies besides: its name and overrides of the scene.
pub type Series = (&'static str, &'static [&'static str]);

/// Signs of coordinates that map the body and its motion onto themselves, about the middle of the body's box.
pub type Symmetry = [f64; 3];

/// What is looked for.
pub enum Aim {
    /// A run to the end of the scene.
    Run,
    /// Runs that differ in their end alone: one of them all.
    Along,
    /// A run of noise, in which the pressure may change from particle to particle.
    Noise,
    /// The largest CFL number that noise dies down at.
    LargestCfl,
    /// A run whose displacements are those of the run at the value 1 times the power of the value that is given.
    Scaled(fn(f64) -> f64),
}

pub struct Sweep {
    /// On the command line and in the results.
    pub name: &'static str,
    pub title: &'static str,
    /// What the values are, with their unit.
    pub axis: &'static str,
    pub values: &'static [f64],
    pub series: &'static [Series],
    pub scene: fn(f64) -> Text,
    pub symmetry: &'static [Symmetry],
    pub aim: Aim,
}

/// A scene as text.
pub enum Text {
    Example(&'static str, Vec<String>),
    Json(String),
}

impl Sweep {
    /// The scene of a series at a value.
    pub fn scene(&self, series: &Series, value: f64, more: &[String]) -> Result<Scene> {
        let own = series.1.iter().map(|o| (*o).to_owned());
        match (self.scene)(value) {
            Text::Example(name, overrides) => {
                let all: Vec<String> = overrides
                    .into_iter()
                    .chain(own)
                    .chain(more.iter().cloned())
                    .collect();
                Scene::from_file(example(name, "scene.json"), &all)
            }
            Text::Json(text) => {
                let all: Vec<String> = own.chain(more.iter().cloned()).collect();
                Scene::from_json(&text, &all)
            }
        }
    }
}

const DEFAULT: Series = ("default", &[]);
const REPAIRED: Series = ("repaired operators", &["numerics.operators=repaired"]);
/// As stiff and heavy as the rubber of the cubes, with a yield stress of 0.006 of its modulus.
const METAL: &str = r#"material={"von_mises": {"density": 1100, "youngs_modulus": 1.7e7, "poisson_ratio": 0.3,
    "yield_stress": 1e5, "hardening_modulus": 1e4}}"#;
const VOLUME: Series = (
    "D^j 0.1",
    &["numerics.state=fj", "numerics.volume_dissipation=0.1"],
);
const STIFF: &str = "material.neo_hookean.poisson_ratio=0.495";
const NEIGHBOURS_6: Series = ("6 neighbours", &["numerics.neighbours=6"]);
const NEIGHBOURS_18: Series = ("18 neighbours", &["numerics.neighbours=18"]);
const NEIGHBOURS_26: Series = ("26 neighbours", &["numerics.neighbours=26"]);
const RADIUS: Series = (
    "radius 2.2 (56 neighbours)",
    &["numerics.neighbours={\"radius\": 2.2}"],
);
const POISSON: &[f64] = &[0.0, 0.3, 0.45, 0.49, 0.499, 0.4999];

const HALF_TURN_Y: Symmetry = [-1.0, 1.0, -1.0];
const HALF_TURN_Z: Symmetry = [-1.0, -1.0, 1.0];
const MIRROR_X: Symmetry = [-1.0, 1.0, 1.0];
const MIRROR_Z: Symmetry = [1.0, 1.0, -1.0];

/// A box of E = 1e9 Pa and 1000 kg/m^3 with velocities that differ from particle to particle: every wave that
/// the particles can carry, the shortest above all.
fn shaken(spacing: [f64; 3], size: [f64; 3], nu: f64, more: &str) -> Text {
    let frequency = |c: usize, n: f64| n / size[c];
    let (x, y, z) = (
        |n| format!("{:e}*X", frequency(0, n)),
        |n| format!("{:e}*Y", frequency(1, n)),
        |n| format!("{:e}*Z", frequency(2, n)),
    );
    let velocity = [
        format!(
            "1e-3*sin({} + {} + {})",
            x(7919.0),
            y(104_729.0),
            z(1_299_709.0)
        ),
        format!("1e-3*sin({} + {} + {})", x(6151.0), y(7877.0), z(224_737.0)),
        format!(
            "1e-3*sin({} + {} + {})",
            x(3571.0),
            y(49_999.0),
            z(611_953.0)
        ),
    ];
    Text::Json(format!(
        r#"{{"geometry": {{"box": {{"min": [0, 0, 0], "max": {size:?}, "spacing": {spacing:?}{more}}}}},
        "material": {{"neo_hookean": {{"density": 1000, "youngs_modulus": 1e9, "poisson_ratio": {nu}}}}},
        "initial": {{"velocity": {velocity:?}}},
        "time": {{"end": 1}}}}"#
    ))
}

/// A cube of 9 x 9 x 9 particles between faces that move at speeds: `boundary` and the end of time.
fn cube(boundary: &str, end: f64) -> Text {
    Text::Json(format!(
        r#"{{"geometry": {{"box": {{"min": [0, 0, 0], "max": [1, 1, 1], "spacing": 0.125}}}},
        "material": {{"neo_hookean": {{"density": 1100, "youngs_modulus": 1.7e7, "poisson_ratio": 0.3}}}},
        "boundary": {{{boundary}}},
        "time": {{"end": {end:e}}}}}"#
    ))
}

const ROLLERS: &str = r#""x_min": {"support": "roller"}, "x_max": {"support": "roller"},
    "y_min": {"support": "roller"}, "y_max": {"support": "roller"}, "z_min": {"support": "roller"}"#;
/// Speed of the faces of a cube [m/s]: a twelfth of its shear waves'.
const SPEED: f64 = 8.0;

/// A column along Y, 6 m long, twisted (`rate` in rad/s at its top), with its lattice's spacing.
fn twisted(rate: f64, overrides: &[String]) -> Text {
    let mut all = vec![
        format!("initial.velocity=[\"{rate}*sin(pi*Y/12)*Z\",0,\"-{rate}*sin(pi*Y/12)*X\"]"),
        "time.end=0.1".to_owned(),
    ];
    all.extend_from_slice(overrides);
    Text::Example("column_twisting", all)
}

/// A metre of rubber in all units: lengths, times and masses in others than m, s, kg by these factors. It is bent
/// and twisted by its start.
fn in_units([length, time, mass]: [f64; 3], end: f64) -> Text {
    let density = 1100.0 * mass / length.powi(3);
    let modulus = 1.7e7 * mass / (length * time * time);
    let speed = length / time;
    Text::Json(format!(
        r#"{{"geometry": {{"box": {{"min": [0, 0, 0], "max": [{length:e}, {:e}, {length:e}], "spacing": {:e}}}}},
        "material": {{"neo_hookean": {{"density": {density:e}, "youngs_modulus": {modulus:e}, "poisson_ratio": 0.45}}}},
        "boundary": {{"y_min": {{"support": "clamped"}}}},
        "initial": {{"velocity": ["{:e}*(Y/{length:e}) + {:e}*(Z/{length:e} - 0.5)", 0, "{:e}*(0.5 - X/{length:e})"]}},
        "numerics": {{"time_step": {:e}}},
        "time": {{"end": {:e}}}}}"#,
        3.0 * length,
        0.25 * length,
        5.0 * speed,
        60.0 * speed,
        60.0 * speed,
        2e-4 * time,
        end * time,
    ))
}

const UNITS: &[f64] = &[1e-6, 1e-3, 1.0, 1e3, 1e6];
const PRECISIONS: &[Series] = &[
    DEFAULT,
    ("single precision", &["numerics.precision=single"]),
    (
        "updates at every step",
        &[
            "numerics.reference_update=every_step",
            "numerics.kernel_option=3",
            "numerics.operators=repaired",
        ],
    ),
];

pub static SWEEPS: &[Sweep] = &[
    Sweep {
        name: "cfl-poisson",
        title: "Largest CFL number: noise on a lattice",
        axis: "Poisson ratio",
        values: POISSON,
        series: &[NEIGHBOURS_6, NEIGHBOURS_18, NEIGHBOURS_26, RADIUS],
        scene: |nu| shaken([0.125; 3], [1.0; 3], nu, ""),
        symmetry: &[],
        aim: Aim::LargestCfl,
    },
    Sweep {
        name: "cfl-aspect",
        title: "Largest CFL number: cells longer in one direction",
        axis: "aspect of the cells",
        values: &[1.0, 1.5, 2.0, 3.0, 5.0, 10.0],
        series: &[
            NEIGHBOURS_6,
            NEIGHBOURS_18,
            NEIGHBOURS_26,
            ("18 neighbours, repaired", &["numerics.operators=repaired"]),
        ],
        scene: |aspect| shaken([0.125, 0.125, 0.125 * aspect], [1.0, 1.0, aspect], 0.3, ""),
        symmetry: &[],
        aim: Aim::LargestCfl,
    },
    Sweep {
        name: "cfl-jitter",
        title: "Largest CFL number: particles moved by a share of the spacing",
        axis: "jitter",
        values: &[0.0, 0.1, 0.2, 0.3, 0.4, 0.49],
        series: &[
            ("kernel", &["numerics.operators=kernel"]),
            ("repaired", &["numerics.operators=repaired"]),
            (
                "mesh, 26 neighbours",
                &["numerics.operators=mesh", "numerics.neighbours=26"],
            ),
        ],
        scene: |jitter| {
            shaken(
                [0.125; 3],
                [1.0; 3],
                0.3,
                &format!(r#", "jitter": {{"fraction": {jitter}}}"#),
            )
        },
        symmetry: &[],
        aim: Aim::LargestCfl,
    },
    Sweep {
        name: "poisson",
        title: "Column twisted at 105 rad/s",
        axis: "Poisson ratio",
        values: POISSON,
        series: &[DEFAULT, NEIGHBOURS_6, NEIGHBOURS_26, REPAIRED, VOLUME],
        scene: |nu| twisted(105.0, &[format!("material.neo_hookean.poisson_ratio={nu}")]),
        symmetry: &[HALF_TURN_Y],
        aim: Aim::Run,
    },
    Sweep {
        name: "compression",
        title: "Cube pressed between rollers at 8 m/s",
        axis: "J",
        values: &[0.8, 0.5, 0.3, 0.2, 0.1, 0.05],
        series: &[
            DEFAULT,
            NEIGHBOURS_6,
            NEIGHBOURS_26,
            ("Poisson ratio 0.495", &[STIFF]),
            ("metal", &[METAL]),
            ("metal, D^j 0.1", &[METAL, VOLUME.1[0], VOLUME.1[1]]),
            (
                "Poisson ratio 0.495, 6 neighbours",
                &[STIFF, "numerics.neighbours=6"],
            ),
            (
                "Poisson ratio 0.495, D^j 0.1",
                &[STIFF, VOLUME.1[0], VOLUME.1[1]],
            ),
            ("metal, 6 neighbours", &[METAL, "numerics.neighbours=6"]),
            ("metal, repaired", &[METAL, "numerics.operators=repaired"]),
        ],
        scene: |j| {
            cube(
                &format!(r#"{ROLLERS}, "z_max": {{"velocity": [null, null, -{SPEED}]}}"#),
                (1.0 - j) / SPEED,
            )
        },
        symmetry: &[MIRROR_X],
        aim: Aim::Along,
    },
    Sweep {
        name: "upsetting",
        title: "Cube pressed between plates that hold it, free at its sides",
        axis: "height over the first",
        values: &[0.8, 0.5, 0.3, 0.2, 0.1, 0.05],
        series: &[
            DEFAULT,
            NEIGHBOURS_6,
            ("Poisson ratio 0.495", &[STIFF]),
            (
                "updates at every step, repaired",
                &[
                    "numerics.reference_update=every_step",
                    "numerics.kernel_option=3",
                    "numerics.operators=repaired",
                ],
            ),
            ("metal", &[METAL]),
            ("metal, D^j 0.1", &[METAL, VOLUME.1[0], VOLUME.1[1]]),
        ],
        scene: |height| {
            let plates = format!(
                r#""z_min": {{"support": "clamped"}}, "z_max": {{"velocity": [0, 0, -{SPEED}]}}"#
            );
            cube(&plates, (1.0 - height) / SPEED)
        },
        symmetry: &[MIRROR_X, HALF_TURN_Z],
        aim: Aim::Along,
    },
    Sweep {
        name: "tension",
        title: "Cube pulled apart at ends that are held",
        axis: "length over the first",
        values: &[1.2, 1.5, 2.0, 3.0, 4.0, 5.0],
        series: &[
            DEFAULT,
            NEIGHBOURS_6,
            NEIGHBOURS_26,
            ("Poisson ratio 0.495", &[STIFF]),
            (
                "updates at every step, repaired",
                &[
                    "numerics.reference_update=every_step",
                    "numerics.kernel_option=3",
                    "numerics.operators=repaired",
                ],
            ),
            ("metal", &[METAL]),
            ("metal, D^j 0.1", &[METAL, VOLUME.1[0], VOLUME.1[1]]),
        ],
        scene: |length| {
            let ends = format!(
                r#""z_min": {{"support": "clamped"}}, "z_max": {{"velocity": [0, 0, {SPEED}]}}"#
            );
            cube(&ends, (length - 1.0) / SPEED)
        },
        symmetry: &[MIRROR_X, HALF_TURN_Z],
        aim: Aim::Along,
    },
    Sweep {
        name: "shear",
        title: "Cube sheared between plates that hold it",
        axis: "shear",
        values: &[0.2, 0.5, 1.0, 2.0, 3.0, 5.0],
        series: &[
            DEFAULT,
            NEIGHBOURS_6,
            ("Poisson ratio 0.495", &[STIFF]),
            (
                "updates at every step, repaired",
                &[
                    "numerics.reference_update=every_step",
                    "numerics.kernel_option=3",
                    "numerics.operators=repaired",
                ],
            ),
            ("metal", &[METAL]),
            ("metal, D^j 0.1", &[METAL, VOLUME.1[0], VOLUME.1[1]]),
        ],
        scene: |shear| {
            let plates = format!(
                r#""z_min": {{"support": "clamped"}}, "z_max": {{"velocity": [{SPEED}, 0, 0]}}"#
            );
            cube(&plates, shear / SPEED)
        },
        symmetry: &[[1.0, -1.0, 1.0]],
        aim: Aim::Along,
    },
    Sweep {
        name: "spin",
        title: "Free cube that spins, two turns",
        axis: "speed at the edges over the shear waves'",
        values: &[0.01, 0.03, 0.1, 0.3, 1.0, 3.0],
        series: &[
            DEFAULT,
            ("projection", &["numerics.angular_momentum_projection=true"]),
            ("single precision", &["numerics.precision=single"]),
            ("metal", &[METAL]),
        ],
        scene: |share| {
            // By the half diagonal of a face.
            let shear_wave = (1.7e7 / 2.6 / 1100.0_f64).sqrt();
            let rate = share * shear_wave / 0.5_f64.sqrt();
            Text::Json(format!(
                r#"{{"geometry": {{"box": {{"min": [-0.5, -0.5, -0.5], "max": [0.5, 0.5, 0.5], "spacing": 0.125}}}},
                "material": {{"neo_hookean": {{"density": 1100, "youngs_modulus": 1.7e7, "poisson_ratio": 0.3}}}},
                "initial": {{"velocity": ["-{rate:e}*Y", "{rate:e}*X", 0]}},
                "time": {{"end": {:e}}}}}"#,
                4.0 * std::f64::consts::PI / rate
            ))
        },
        symmetry: &[MIRROR_Z, HALF_TURN_Z],
        aim: Aim::Run,
    },
    Sweep {
        name: "twisting",
        title: "Twisted column",
        axis: "rate at the top [rad/s]",
        values: &[105.0, 200.0, 300.0, 400.0, 480.0],
        series: &[
            DEFAULT,
            (
                "Poisson ratio 0.49",
                &["material.neo_hookean.poisson_ratio=0.49"],
            ),
            NEIGHBOURS_6,
            ("strain increment 0.1", &["numerics.strain_increment=0.1"]),
            ("limiter shock", &["numerics.limiter=shock"]),
            (
                "updates at every step, repaired",
                &[
                    "numerics.reference_update=every_step",
                    "numerics.kernel_option=3",
                    "numerics.operators=repaired",
                ],
            ),
        ],
        scene: |rate| twisted(rate, &[]),
        symmetry: &[HALF_TURN_Y],
        aim: Aim::Run,
    },
    Sweep {
        name: "impact",
        title: "Copper bar on a rigid wall, 80 µs",
        axis: "speed [m/s]",
        values: &[100.0, 227.0, 300.0, 400.0, 600.0, 1000.0],
        series: &[
            DEFAULT,
            ("dissipation 1", &["numerics.dissipation_coefficient=1"]),
            (
                "dissipation 1, without D^j",
                &[
                    "numerics.dissipation_coefficient=1",
                    "numerics.volume_dissipation=0",
                    "numerics.state=f",
                ],
            ),
        ],
        scene: |speed| {
            Text::Example(
                "copper_impact",
                vec![format!("initial.velocity=[0,0,-{speed}]")],
            )
        },
        symmetry: &[],
        aim: Aim::Run,
    },
    Sweep {
        name: "impact-rubber",
        title: "Rubber cube on a rigid wall",
        axis: "speed over the shear waves'",
        values: &[0.1, 0.3, 0.6, 1.0, 2.0],
        series: &[
            DEFAULT,
            ("Poisson ratio 0.495", &[STIFF]),
            ("limiter shock", &["numerics.limiter=shock"]),
        ],
        scene: |share| {
            let speed = share * (1.7e7 / 2.6 / 1100.0_f64).sqrt();
            Text::Json(format!(
                r#"{{"geometry": {{"box": {{"min": [0, 0, 0], "max": [1, 1, 1], "spacing": 0.125}}}},
                "material": {{"neo_hookean": {{"density": 1100, "youngs_modulus": 1.7e7, "poisson_ratio": 0.3}}}},
                "contact": {{"wall": {{"point": [0, 0, 0], "normal": [0, 0, 1]}}}},
                "initial": {{"velocity": [0, 0, -{speed:e}]}},
                "time": {{"end": 0.04}}}}"#
            ))
        },
        symmetry: &[MIRROR_X, HALF_TURN_Z],
        aim: Aim::Run,
    },
    Sweep {
        name: "temperature",
        title: "Johnson-Cook bar on a rigid wall (melts at 1356.2 K)",
        axis: "temperature at the start [K]",
        values: &[1.0, 100.0, 298.15, 800.0, 1200.0, 1340.0, 1356.2, 2000.0],
        series: &[
            DEFAULT,
            (
                "kernel, without D^j",
                &[
                    "numerics.operators=kernel",
                    "numerics.volume_dissipation=0",
                    "numerics.state=f",
                ],
            ),
        ],
        scene: |theta| {
            Text::Example(
                "taylor_johnson_cook",
                vec![format!("heat.reference_temperature={theta}")],
            )
        },
        symmetry: &[],
        aim: Aim::Run,
    },
    Sweep {
        name: "cooling",
        title: "Cube with heat pulled apart: cooled by its expansion",
        axis: "temperature at the start [K]",
        values: &[1.0, 10.0, 100.0, 300.0, 1e3, 1e4],
        series: &[DEFAULT, NEIGHBOURS_6, ("Poisson ratio 0.495", &[STIFF])],
        scene: |theta| {
            Text::Json(format!(
                r#"{{"geometry": {{"box": {{"min": [0, 0, 0], "max": [1, 1, 1], "spacing": 0.125}}}},
                "material": {{"neo_hookean": {{"density": 1000, "youngs_modulus": 1.7e7, "poisson_ratio": 0.3}}}},
                "heat": {{"specific_heat": 1, "reference_temperature": {theta}, "conductivity": 100,
                    "gruneisen_coefficient": 8.5889}},
                "boundary": {{"z_min": {{"support": "clamped"}}, "z_max": {{"velocity": [0, 0, 8]}}}},
                "time": {{"end": 0.05}}}}"#
            ))
        },
        symmetry: &[MIRROR_X, HALF_TURN_Z],
        aim: Aim::Run,
    },
    Sweep {
        name: "conduction",
        title: "Thermo-elastic wave, from adiabatic to ruled by conduction",
        axis: "conductivity over that of the example",
        values: &[0.0, 1e-3, 1.0, 10.0, 100.0, 1000.0],
        series: &[
            DEFAULT,
            NEIGHBOURS_18,
            ("without dissipation", &["numerics.dissipation=false"]),
        ],
        scene: |factor| {
            // As far as heat goes in the scene, or a wave.
            let end = 0.05 / f64::max(factor, 1.0);
            let overrides = [
                format!("heat.conductivity={}", 2e4 * factor),
                format!("time.end={end}"),
            ];
            Text::Example("thermo_wave", overrides.to_vec())
        },
        symmetry: &[[1.0, -1.0, 1.0]],
        aim: Aim::Run,
    },
    Sweep {
        name: "weight",
        title: "Soft cube on its own foot",
        axis: "weight over stiffness, rho g L / E",
        values: &[1e-3, 1e-2, 0.1, 0.5, 1.0, 5.0],
        series: &[DEFAULT, NEIGHBOURS_6, ("Poisson ratio 0.495", &[STIFF])],
        scene: |share| {
            Text::Json(format!(
                r#"{{"geometry": {{"box": {{"min": [0, 0, 0], "max": [1, 1, 1], "spacing": 0.125}}}},
                "material": {{"neo_hookean": {{"density": 1100, "youngs_modulus": 1.7e7, "poisson_ratio": 0.3}}}},
                "boundary": {{"z_min": {{"support": "clamped"}}}},
                "body_force": [0, 0, {:e}],
                "time": {{"end": 0.05}}}}"#,
                -share * 1.7e7
            ))
        },
        symmetry: &[MIRROR_X, HALF_TURN_Z],
        aim: Aim::Run,
    },
    Sweep {
        name: "aspect",
        title: "Twisted column of cells that are longer along it",
        axis: "aspect of the cells",
        values: &[1.0, 2.0, 3.0, 5.0, 7.5, 10.0],
        series: &[DEFAULT, NEIGHBOURS_6, REPAIRED],
        scene: |aspect| {
            let layers = (6.0 / (0.125 * aspect)).round();
            twisted(
                105.0,
                &[format!(
                    "geometry.box.spacing=[0.125, {}, 0.125]",
                    6.0 / layers
                )],
            )
        },
        symmetry: &[HALF_TURN_Y],
        aim: Aim::Run,
    },
    Sweep {
        name: "jitter",
        title: "Twisted column of particles moved by a share of the spacing",
        axis: "jitter",
        values: &[0.0, 0.1, 0.2, 0.3, 0.4, 0.49],
        series: &[
            ("kernel", &["numerics.operators=kernel"]),
            ("repaired", &["numerics.operators=repaired"]),
            (
                "mesh, 26 neighbours",
                &["numerics.operators=mesh", "numerics.neighbours=26"],
            ),
        ],
        scene: |jitter| {
            twisted(
                105.0,
                &[format!("geometry.box.jitter={{\"fraction\": {jitter}}}")],
            )
        },
        symmetry: &[],
        aim: Aim::Run,
    },
    Sweep {
        name: "mesh",
        title: "Clamped cylinder of tetrahedra in torsion",
        axis: "Poisson ratio",
        values: POISSON,
        series: &[
            ("repaired", &[]),
            ("kernel", &["numerics.operators=kernel"]),
            ("mesh", &["numerics.operators=mesh"]),
        ],
        scene: |nu| {
            let file = example("meshes", "cylinder_2.msh");
            Text::Json(format!(
                r#"{{"geometry": {{"mesh": {{"file": {file:?}}}}},
                "material": {{"neo_hookean": {{"density": 1100, "youngs_modulus": 1.7e7, "poisson_ratio": {nu}}}}},
                "boundary": {{"bottom": {{"support": "clamped"}}}},
                "initial": {{"velocity": ["-50*Y*Z", "50*X*Z", 0]}},
                "time": {{"end": 0.1}}}}"#
            ))
        },
        symmetry: &[],
        aim: Aim::Run,
    },
    Sweep {
        name: "size",
        title: "Noise in a cube of 8 to a million particles, 20 steps",
        axis: "particles along an edge",
        values: &[2.0, 3.0, 5.0, 10.0, 21.0, 47.0, 100.0],
        series: &[
            DEFAULT,
            NEIGHBOURS_6,
            REPAIRED,
            ("single precision", &["numerics.precision=single"]),
        ],
        scene: |edge| {
            let spacing = 1.0 / (edge - 1.0);
            let Text::Json(text) = shaken([spacing; 3], [1.0; 3], 0.3, "") else {
                unreachable!("made from text");
            };
            // Twenty steps of CFL number 1.
            let end = 20.0 * spacing / (1e6_f64 * 1.35).sqrt();
            Text::Json(text.replace(r#""end": 1"#, &format!(r#""end": {end:e}"#)))
        },
        symmetry: &[],
        aim: Aim::Noise,
    },
    Sweep {
        name: "length",
        title: "The same body in other units of length",
        axis: "factor",
        values: UNITS,
        series: PRECISIONS,
        scene: |factor| in_units([factor, 1.0, 1.0], 0.02),
        symmetry: &[],
        aim: Aim::Scaled(|factor| factor),
    },
    Sweep {
        name: "time",
        title: "The same body in other units of time",
        axis: "factor",
        values: UNITS,
        series: PRECISIONS,
        scene: |factor| in_units([1.0, factor, 1.0], 0.02),
        symmetry: &[],
        aim: Aim::Scaled(|_| 1.0),
    },
    Sweep {
        name: "mass",
        title: "The same body in other units of mass: stiffness and density",
        axis: "factor",
        values: &[1e-12, 1e-6, 1.0, 1e6, 1e12],
        series: PRECISIONS,
        scene: |factor| in_units([1.0, 1.0, factor], 0.02),
        symmetry: &[],
        aim: Aim::Scaled(|_| 1.0),
    },
    Sweep {
        name: "size-of-body",
        title: "The same shape and material at another size",
        axis: "factor",
        values: UNITS,
        series: PRECISIONS,
        // Waves take as much longer as the body is larger.
        scene: |factor| in_units([factor, factor, factor.powi(3)], 0.02),
        symmetry: &[],
        aim: Aim::Scaled(|factor| factor),
    },
];
