//! Scenes: what is accepted, what is refused and with which words.

use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use urlsph::scene::{
    Geometry, Interpolation, Neighbours, Scalar, ScalarFunction, Scene, Spacing, Table, Vector,
    VectorFunction, json_schema,
};
use urlsph::{Code, Error};

/// All scenes among the examples.
fn examples() -> Vec<PathBuf> {
    let entries = |folder: &Path| -> Vec<PathBuf> {
        let entries = std::fs::read_dir(folder).unwrap();
        entries.map(|entry| entry.unwrap().path()).collect()
    };
    let cases = entries(&Path::new(env!("CARGO_MANIFEST_DIR")).join("examples"));
    let files = cases.iter().filter(|p| p.is_dir()).flat_map(|p| entries(p));
    files
        .filter(|p| p.extension().is_some_and(|e| e == "json"))
        .collect()
}

fn example_path(name: &str) -> PathBuf {
    [env!("CARGO_MANIFEST_DIR"), "examples", name, "scene.json"]
        .iter()
        .collect()
}

fn example(name: &str, overrides: &[&str]) -> Result<Scene, Error> {
    let overrides: Vec<_> = overrides.iter().map(|s| (*s).to_owned()).collect();
    Scene::from_file(example_path(name), &overrides)
}

#[test]
fn the_examples_are_scenes() {
    let examples = examples();
    assert!(examples.contains(&example_path("column_bending")));
    for path in examples {
        let scene = Scene::from_file(&path, &[]).unwrap_or_else(|e| panic!("{path:?}: {e}"));
        assert!(!scene.title.is_empty(), "{path:?} has no title");
    }
}

fn value(text: &str) -> ScalarFunction {
    Scalar::Expression(text.to_owned())
        .compile()
        .unwrap_or_else(|e| panic!("{e}"))
}

const X: [f64; 3] = [1.25, -0.75, 2.5];
const T: f64 = 0.3;

#[test]
fn expressions_read_as_mathematics_does() {
    let [x, y, z] = X;
    let (t, pi, e) = (T, std::f64::consts::PI, std::f64::consts::E);
    for (text, expected) in [
        ("-X^2", -(x * x)),
        ("(-X)^2", x * x),
        ("2^3^2", 512.0),
        ("2^-X", 2f64.powf(-x)),
        ("2^-X^2", 2f64.powf(-(x * x))),
        ("-X^-2", -x.powf(-2.0)),
        ("--X", x),
        ("+X - -Y", x + y),
        ("X - Y - Z", x - y - z),
        ("X - 1 + 2", x - 1.0 + 2.0),
        ("X / Y / Z", x / y / z),
        ("X / Y * Z", x / y * z),
        ("X * Y / Z", x * y / z),
        ("1 + 2 * X ^ 2 / 4 - t", 1.0 + 2.0 * (x * x) / 4.0 - t),
        ("X - 2*Y + Z*t - 1", x - 2.0 * y + z * t - 1.0),
        ("-2*X", -2.0 * x),
        ("2*-X", 2.0 * -x),
        ("-sin(X)^2", -(x.sin() * x.sin())),
        ("10*Y/6", 10.0 * y / 6.0),
        ("105*sin(pi*Y/12)*Z", 105.0 * (pi * y / 12.0).sin() * z),
        (
            "5e-7 + 1E3 + 2.5e+1 + .5 + 3.",
            5e-7 + 1e3 + 25.0 + 0.5 + 3.0,
        ),
        ("5e-300*X", 5e-300 * x),
        ("e + E - 2*PI + pi", e + e - 2.0 * pi + pi),
        ("cos(X)", x.cos()),
        ("tan(X)", x.tan()),
        ("asin(t)", t.asin()),
        ("acos(t)", t.acos()),
        ("atan(X)", x.atan()),
        (
            "sinh(X) + cosh(Y) * tanh(Z)",
            x.sinh() + y.cosh() * z.tanh(),
        ),
        ("exp(-X)", (-x).exp()),
        ("ln(X) + log10(Z)", x.ln() + z.log10()),
        ("sqrt(X)", x.sqrt()),
        ("abs(Y)", y.abs()),
        ("floor(Z)", 2.0),
        ("min(X, Y)", y),
        ("max(X, max(Y, Z)) * 2", z * 2.0),
        ("max(min(X, Z), min(Y, t)) - 1", x - 1.0),
        ("2*max(X + 1, 2*Y) ^ 2", 2.0 * ((x + 1.0) * (x + 1.0))),
        ("atan2(Y, X)", y.atan2(x)),
        ("pow(X, 3)", x.powf(3.0)),
        ("heaviside(t - 0.3)", 1.0),
        ("heaviside(t - 0.31) * 5", 0.0),
        ("heaviside(2 - Z) * -3", 0.0 * -3.0),
        ("((((X))))", x),
        (" X\t+\n1 ", x + 1.0),
    ] {
        let got = value(text).eval(X, T);
        let residual = (got - expected).abs() / expected.abs().max(1.0);
        println!("{text:?}: {got} (relative residual {residual:e}, tolerance 1e-15)");
        assert!(residual <= 1e-15, "{text}: {got} instead of {expected}");
        let again = value(text).eval(X, T);
        assert_eq!(got.to_bits(), again.to_bits(), "{text}: other bits");
    }
}

#[test]
fn the_first_column_bends() {
    let scene = example("column_bending", &["geometry.box.spacing=0.125"]).unwrap();
    let velocity = scene.initial.velocity.unwrap().compile().unwrap();
    assert_eq!(velocity.eval([0.5, 6.0, 0.5], 0.0), [10.0, 0.0, 0.0]);
    assert!(velocity.depends_on_space() && !velocity.depends_on_time());
    assert!(matches!(velocity, VectorFunction::Components(_)));
    assert_eq!(scene.numerics.neighbours, Neighbours::Lattice(18));
    let urlsph::scene::Geometry::Box(b) = scene.geometry else {
        panic!("not a box");
    };
    assert_eq!(b.spacing, Spacing::Uniform(0.125));
    let twisting = example("column_twisting", &[]).unwrap();
    assert_eq!(
        twisting.boundary["top"].traction,
        Some(Vector::External {
            external: [0.0; 3],
            per_particle: false
        })
    );
    assert_eq!(
        example("nowhere", &[]).unwrap_err().code(),
        Code::Io,
        "a missing file is an I/O error"
    );
}

#[test]
fn values_know_what_they_depend_on() {
    for (text, space, time) in [
        ("1 + pi", false, false),
        ("X", true, false),
        ("sin(Z)", true, false),
        ("t^2", false, true),
        ("Y*t", true, true),
    ] {
        let f = value(text);
        assert_eq!(f.depends_on_space(), space, "{text}");
        assert_eq!(f.depends_on_time(), time, "{text}");
        assert_eq!(f.is_constant(), !space && !time, "{text}");
    }
    assert!(matches!(value("1/8"), ScalarFunction::Constant(v) if v == 0.125));
    let external = Scalar::External {
        external: 3.0,
        per_particle: true,
    };
    let f = external.compile().unwrap();
    assert_eq!(f.eval(X, T), 3.0);
    assert!(f.depends_on_space() && f.depends_on_time() && !f.is_constant());
    let free = Vector::Components([None, Some(Scalar::Expression("Y".into())), None]);
    let f = free.compile().unwrap();
    assert_eq!(f.free(), [true, false, true]);
    assert_eq!(f.eval(X, T), [0.0, X[1], 0.0]);
    // Not finite somewhere is for the caller to notice.
    assert!(value("1/X").eval([0.0; 3], 0.0).is_infinite());
    assert!(value("max(0, ln(X))").eval([-1.0, 0.0, 0.0], 0.0).is_nan());
}

#[test]
fn tables_are_linear_between_and_constant_outside() {
    let table = Vector::Table {
        table: Table {
            time: vec![1.0, 2.0, 4.0],
            value: vec![[0.0, 1.0, 2.0], [10.0, 1.0, 4.0], [0.0, 1.0, -4.0]],
        },
    };
    let f = table.compile().unwrap();
    for (t, expected) in [
        (-1.0, [0.0, 1.0, 2.0]),
        (1.0, [0.0, 1.0, 2.0]),
        (1.25, [2.5, 1.0, 2.5]),
        (2.0, [10.0, 1.0, 4.0]),
        (3.0, [5.0, 1.0, 0.0]),
        (4.0, [0.0, 1.0, -4.0]),
        (9.0, [0.0, 1.0, -4.0]),
    ] {
        assert_eq!(f.eval(X, t), expected, "t = {t}");
    }
    assert!(f.depends_on_time() && !f.depends_on_space());
    let single = Scalar::Table {
        table: Table {
            time: vec![0.0],
            value: vec![7.0],
        },
    };
    let f = single.compile().unwrap();
    assert!(f.is_constant());
    assert_eq!(f.eval(X, T), 7.0);
    fn shared<T: Send + Sync>() {}
    shared::<ScalarFunction>();
    shared::<VectorFunction>();
    shared::<Interpolation<3>>();
}

/// A small generator of random numbers; the same numbers in every run.
struct Random(u64);

impl Random {
    fn below(&mut self, n: usize) -> usize {
        self.0 = self
            .0
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        (self.0 >> 33) as usize % n
    }

    /// A random expression, its value at (X, T) and its precedence: 0 sum, 1 product, 2 sign, 3 power, 4 primary.
    fn expression(&mut self, depth: usize) -> (String, f64, u8) {
        let wrap = |(text, value, level): (String, f64, u8), least: u8| {
            let text = if level < least {
                format!("({text})")
            } else {
                text
            };
            (text, value)
        };
        match if depth == 0 { 0 } else { self.below(9) } {
            0 => match self.below(5) {
                0 => ("X".into(), X[0], 4),
                1 => ("Y".into(), X[1], 4),
                2 => ("Z".into(), X[2], 4),
                3 => ("t".into(), T, 4),
                _ => {
                    let v = (self.below(90) + 1) as f64 * 0.125;
                    (format!("{v:e}"), v, 4)
                }
            },
            kind @ 1..=4 => {
                let level = u8::from(kind > 2);
                let (a, va) = wrap(self.expression(depth - 1), level);
                let (b, vb) = wrap(self.expression(depth - 1), level + 1);
                let (sign, value) = match kind {
                    1 => ('+', va + vb),
                    2 => ('-', va - vb),
                    3 => ('*', va * vb),
                    _ => ('/', va / vb),
                };
                (format!("{a} {sign} {b}"), value, level)
            }
            5 => {
                let (a, va) = wrap(self.expression(depth - 1), 2);
                (format!("-{a}"), -va, 2)
            }
            6 => {
                let (a, va) = wrap(self.expression(depth - 1), 4);
                let (b, vb) = wrap(self.expression(depth - 1), 2);
                (format!("{a}^{b}"), va.powf(vb), 3)
            }
            7 => {
                let (a, va, _) = self.expression(depth - 1);
                (format!("atan({a})"), va.atan(), 4)
            }
            _ => {
                let (a, va, _) = self.expression(depth - 1);
                let (b, vb, _) = self.expression(depth - 1);
                (format!("atan2({a}, {b})"), va.atan2(vb), 4)
            }
        }
    }
}

#[test]
fn random_expressions_have_the_bits_of_their_tree() {
    let mut random = Random(2);
    let mut finite = 0;
    for _ in 0..5000 {
        let (text, expected, _) = random.expression(6);
        match Scalar::Expression(text.clone()).compile() {
            Ok(f) => {
                let got = f.eval(X, T);
                assert!(
                    got.to_bits() == expected.to_bits() || got.is_nan() && expected.is_nan(),
                    "{text}: {got} instead of {expected}"
                );
                finite += usize::from(expected.is_finite());
            }
            // Constants that are not finite, and texts beyond the limits.
            Err(e) => assert!(
                e.message().contains("not a finite number") || text.len() > 4000,
                "{text}: {e}"
            ),
        }
    }
    println!("{finite} finite values of 5000");
    assert!(finite > 2500);
}

#[test]
fn no_text_breaks_the_parsers() {
    let mut random = Random(3);
    let alphabet = [
        "X", "t", "(", ")", "+", "-", "*", "^", "/", ",", "max", "sin", "1", "e5", ".", " ", "é",
        "{", "=",
    ];
    for _ in 0..20000 {
        let length = random.below(12);
        let text: String = (0..length)
            .map(|_| alphabet[random.below(alphabet.len())])
            .collect();
        if let Ok(f) = Scalar::Expression(text).compile() {
            f.eval(X, T);
        }
    }
    for text in [
        "(".repeat(3000),
        "-".repeat(3000),
        "2^".repeat(1500),
        "sin(".repeat(900),
    ] {
        let error = Scalar::Expression(text).compile().unwrap_err();
        assert!(error.message().contains("nested more than"), "{error}");
    }
    let long = "X+".repeat(1999) + "X";
    assert_eq!(
        Scalar::Expression(long).compile().unwrap().eval(X, T),
        2000.0 * X[0]
    );
    let error = Scalar::Expression("X+".repeat(2001)).compile().unwrap_err();
    assert!(
        error.message().contains("at most 4000 characters"),
        "{error}"
    );

    let scene = std::fs::read_to_string(example_path("l_block")).unwrap();
    for _ in 0..2000 {
        let mut bytes = scene.clone().into_bytes();
        for _ in 0..=random.below(3) {
            let at = random.below(bytes.len().max(1));
            match random.below(3) {
                0 if at < bytes.len() => drop(bytes.remove(at)),
                1 if at < bytes.len() => bytes[at] = b"\"{}[],:019-e.x "[random.below(15)],
                _ => bytes.truncate(at),
            }
        }
        let _ = Scene::from_json(&String::from_utf8_lossy(&bytes), &[]);
    }
}

/// A scene that uses every key but `numerics.time_step`, which excludes `cfl`.
fn everything() -> Value {
    json!({
        "title": "everything",
        "geometry": {"boxes": {
            "base": {"min": [0, 0, 0], "max": [2, 1, 1], "spacing": 0.25},
            "leg": {"min": [0, 1, 0], "max": [1, 3, 1], "spacing": [0.25, 0.5, 0.25]}
        }},
        "material": {"mooney_rivlin": {
            "density": 1100, "youngs_modulus": 1.7e7, "poisson_ratio": 0.45, "area_share": 0.25
        }},
        "patches": {"tip": {"faces": ["leg.y_max", "base.x_max"], "min": [0, 0, 0], "max": [0.5, 3, 1]}},
        "boundary": {
            "tip": {"velocity": [null, "sin(t)", 0]},
            "base.y_min": {"support": "roller", "pressure": {"external": 1e5, "per_particle": true}},
            "leg.x_min": {"traction": [1, {"table": {"time": [0, 1], "value": [0, 5]}}, "X*t"], "pressure": "10*Y"},
            "leg.z_min": {"traction": {"table": {"time": [0, 1], "value": [[0, 0, 0], [1, 2, 3]]}}},
            "leg.z_max": {"traction": {"external": [1, 2, 3], "per_particle": true}, "support": "antisymmetry"},
            "base.z_min": {"velocity": {"external": [0, 0, 0]}},
            "base.z_max": {"support": "clamped", "pressure": {"table": {"time": [0], "value": [1]}}},
            "base.x_min": {"heat_flux": {"external": 10, "per_particle": true}},
            "leg.x_max": {"heat_flux": "X*t", "convection": {
                "coefficient": {"external": 25}, "ambient_temperature": {"table": {"time": [0, 1], "value": [293, 300]}}
            }},
            "leg.y_max": {"temperature": "293 + 5*t"}
        },
        "heat": {
            "specific_heat": 400, "reference_temperature": 293, "conductivity": 50, "gruneisen_coefficient": 2,
            "gruneisen_exponent": 0.5, "plastic_heat_fraction": 0.9, "source": "1e3*sin(t)"
        },
        "contact": {"floor": {
            "point": [0, -0.1, 0], "normal": [0, 1, 0], "patch": "base.y_min", "separation": false, "velocity": "0.1*t"
        }},
        "body_force": [0, "-9.81*1100", 0],
        "initial": {"velocity": ["X", 0, 0], "displacement": [0, "1e-3*Y", 0], "gradient": "exact", "temperature": "300 - X"},
        "numerics": {
            "neighbours": {"radius": 1.8}, "operators": "kernel", "weights": "tributary", "smoothing_factor": 0.7, "kernel_option": 2,
            "reference_update": {"every": 10}, "state": "fhj", "reconstruction": "linear", "limiter": "minmod",
            "dissipation": true, "dissipation_coefficient": 0.5, "volume_dissipation": 0.1, "angular_momentum_projection": true, "cfl": 0.3,
            "strain_increment": 0.2, "smallest_step": 0.01, "precision": "single"
        },
        "probes": {"corner": [0, 3, 0], "inner-1": [0.3, 0.4, 0.5]},
        "time": {"end": 0.5},
        "output": {"history_interval": 0.01, "field_interval": 0.1, "restart_interval": 0.05, "fields": ["velocity", "cauchy_stress"]}
    })
}

/// A geometry of every kind with every key.
fn geometries() -> Vec<Value> {
    let mesh = example_path("meshes").with_file_name("cube_tetrahedra.msh");
    vec![
        json!({"box": {
            "min": [0, 0, 0], "max": [1, 1, 1], "spacing": [0.5, 0.5, 0.25],
            "grading": {"x": 2, "y": [0, 0.25, 1]}, "jitter": {"fraction": 0.1, "seed": 3}
        }}),
        json!({"cylinder": {
            "base": [0, 1, 2], "axis": "y", "radius": 1, "length": 2, "sector": {"wedge": 30},
            "divisions": 3, "layers": 2, "grading": [0, 0.25, 1], "radial_grading": 0.5,
            "taper": [[0, 1], [0.5, 0.9], [1, 1]]
        }}),
        json!({"cylinder": {"radius": 1, "length": 2, "sector": "quarter", "divisions": 1, "layers": 1}}),
        json!({"perforated_box": {
            "min": [0, 0, 0], "max": [2, 1, 1], "along": "z", "tiles": [2, 1], "diameter": 0.5,
            "solid": [[1, 0]], "divisions": 2, "rings": 1, "layers": 2, "grading": 2
        }}),
        json!({"mesh": {"file": mesh, "scale": 2}}),
    ]
}

/// The smallest scene with a geometry.
fn around(geometry: &Value) -> Value {
    json!({
        "geometry": geometry,
        "material": {"neo_hookean": {"density": 1, "youngs_modulus": 1, "poisson_ratio": 0.3}},
        "time": {"end": 1}
    })
}

/// A material of a kind with every key.
fn metal(kind: &str) -> Value {
    let mut parameters = json!({"density": 8960, "youngs_modulus": 1.24e11, "poisson_ratio": 0.34});
    let more = match kind {
        "von_mises" => json!({
            "yield_stress": 10, "hardening_modulus": 5, "saturation_stress": 20, "saturation_exponent": 3
        }),
        "johnson_cook" => json!({
            "yield_stress": 9e7, "hardening_modulus": 2.92e8, "hardening_exponent": 0.31,
            "rate_coefficient": 0.025, "reference_strain_rate": 1, "softening_exponent": 1.09,
            "melting_temperature": 1356.2, "transition_temperature": 298.15
        }),
        _ => json!({}),
    };
    let all = parameters.as_object_mut().unwrap();
    all.extend(more.as_object().unwrap().clone());
    json!({ kind: parameters })
}

#[test]
fn a_scene_survives_a_round_trip() {
    let full = Scene::from_json(&everything().to_string(), &[]).unwrap_or_else(|e| panic!("{e}"));
    let examples = examples();
    let scenes = examples
        .iter()
        .map(|path| Scene::from_file(path, &[]).unwrap());
    for scene in scenes.chain([full]) {
        let text = serde_json::to_string(&scene).unwrap();
        let again = Scene::from_json(&text, &[]).unwrap_or_else(|e| panic!("{}: {e}", scene.title));
        assert_eq!(scene, again);
    }
    for kind in ["linear_elastic", "von_mises", "johnson_cook"] {
        let mut scene = everything();
        scene["material"] = metal(kind);
        let scene = Scene::from_json(&scene.to_string(), &[]).unwrap_or_else(|e| panic!("{e}"));
        let text = serde_json::to_string(&scene).unwrap();
        assert_eq!(scene, Scene::from_json(&text, &[]).unwrap());
    }
    let defaults = Scene::from_json(
        r#"{"geometry": {"box": {"min": [0,0,0], "max": [1,1,1], "spacing": 0.5}},
            "material": {"neo_hookean": {"density": 1, "youngs_modulus": 1, "poisson_ratio": 0}},
            "time": {"end": 1}}"#,
        &[],
    )
    .unwrap();
    assert_eq!(defaults.numerics, urlsph::scene::Numerics::default());
}

#[test]
fn overrides_reach_any_value() {
    let set = |text: &str| example("column_twisting", &[text]).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(
        set("numerics.neighbours=26").numerics.neighbours,
        Neighbours::Lattice(26)
    );
    assert_eq!(
        set("numerics.neighbours={\"radius\": 2}")
            .numerics
            .neighbours,
        Neighbours::Radius { radius: 2.0 }
    );
    assert_eq!(set("numerics.cfl=0.3").numerics.cfl, Some(0.3));
    assert_eq!(set("title=\"x\"").title, "x");
    assert_eq!(set("title=A = B").title, "A = B");
    assert_eq!(set(" time.end = 3").time.end, 3.0);
    assert_eq!(set("title = one two ").title, "one two");
    assert_eq!(set("probes.new=[0, 1, 0]").probes["new"], [0.0, 1.0, 0.0]);
    assert_eq!(set("probes.top_corner[1]=5e0").probes["top_corner"][1], 5.0);
    assert_eq!(
        set("boundary.top.traction.external[1]=5e3").boundary["top"].traction,
        Some(Vector::External {
            external: [0.0, 5e3, 0.0],
            per_particle: false
        })
    );
    assert_eq!(
        set("boundary.x_min.pressure=10*t").boundary["x_min"].pressure,
        Some(Scalar::Expression("10*t".into()))
    );
    // The last one counts.
    let twice = example("column_twisting", &["time.end=1", "time.end=2"]).unwrap();
    assert_eq!(twice.time.end, 2.0);
    // Keys with dots: found if they exist, quoted if they do not.
    let text = everything().to_string();
    let overrides = [
        "boundary.leg.x_min.traction[0]=7".to_owned(),
        "boundary[\"leg.x_max\"].support=clamped".to_owned(),
    ];
    let scene = Scene::from_json(&text, &overrides).unwrap_or_else(|e| panic!("{e}"));
    let Some(Vector::Components([Some(first), ..])) = &scene.boundary["leg.x_min"].traction else {
        panic!("no components");
    };
    assert_eq!(*first, Scalar::Constant(7.0));
    assert!(scene.boundary["leg.x_max"].support.is_some());
}

/// Every row: override of column_twisting, code, path, words of the message.
#[test]
fn bad_values_are_refused_with_their_place() {
    use Code::{InvalidArgument as A, InvalidScene as S, OutOfMemory as M, Parse as P};
    const TRACTION: &str = "boundary.top.traction";
    let table = |time: &str, value: &str| {
        format!(r#"{TRACTION}={{"table": {{"time": {time}, "value": {value}}}}}"#)
    };
    let changed = |kind: &str, key: &str, value: f64| {
        let mut material = metal(kind);
        material[kind][key] = json!(value);
        format!("material={material}")
    };
    let linear = |key, value| changed("linear_elastic", key, value);
    let steel = |key, value| changed("von_mises", key, value);
    let copper = |key, value| changed("johnson_cook", key, value);
    let without = |key| {
        let mut material = metal("von_mises");
        material["von_mises"].as_object_mut().unwrap().remove(key);
        format!("material={material}")
    };
    #[rustfmt::skip]
    let rows: &[(&str, Code, &str, &[&str])] = &[
        // Unknown and missing keys.
        ("colour=1", P, "colour", &["unknown key `colour`", "`geometry`", "`output`"]),
        ("geometry.box.spacin=1", P, "geometry.box.spacin", &["`min`, `max`, `spacing`", "see the override"]),
        ("material.neo_hookean={}", P, "material.neo_hookean", &["missing key `density`"]),
        ("time={}", P, "time", &["missing key `end`"]),
        ("geometry={}", P, "geometry", &["`box`, `boxes`"]),
        ("geometry.sphere={}", P, "geometry", &["only one of `box`, `boxes`", "`sphere`", "see the override"]),
        ("material=steel", P, "material", &["unknown word `steel`", "`neo_hookean`", "`johnson_cook`"]),
        ("boundary.top.suport=clamped", P, "boundary.top.suport", &["`support`, `velocity`, `traction`, `pressure`"]),
        ("boundary.leg.x_min.support=roller", P, "boundary.leg.x_min", &["unknown key `x_min`", "see the override"]),
        ("numerics.reference_update=always", P, "numerics.reference_update", &["`never`, `every_step`, `every`, `when`"]),
        ("numerics.reference_update=every", P, "numerics.reference_update.every", &["needs a value"]),
        ("numerics.precision=half", P, "numerics.precision", &["`double` or `single`"]),
        ("numerics.reference_update=3", P, "numerics.reference_update", &["one of `never`"]),
        ("initial.gradient=exact", S, "initial.gradient", &["no initial displacement"]),
        ("initial.gradient=analytic", P, "initial.gradient", &["`discrete` or `exact`"]),
        // Wrong shapes.
        ("time=[3]", P, "time", &["a list, expected an object", "`end`"]),
        ("time.end=soon", P, "time.end", &["expected a number"]),
        ("numerics.dissipation=1", P, "numerics.dissipation", &["true or false"]),
        ("numerics.kernel_option=1.5", P, "numerics.kernel_option", &["whole number"]),
        ("geometry.box.min=[0, 0]", P, "geometry.box.min", &["a list of 3"]),
        ("geometry.box.min=[0, 0, 0, 0]", P, "geometry.box.min", &["a list of 3"]),
        ("geometry.box.min[1]=x", P, "geometry.box.min[1]", &["expected a number"]),
        ("geometry.box.spacing=[1, 2]", P, "geometry.box.spacing", &["a list of 3"]),
        ("geometry.box.spacing=fine", P, "geometry.box.spacing", &["a number, or a list of three numbers"]),
        ("numerics.neighbours=many", P, "numerics.neighbours", &["6, 18, 26 or {\"radius\": r}"]),
        ("numerics.neighbours=-6", P, "numerics.neighbours", &["6, 18, 26 or {\"radius\": r}"]),
        ("numerics.neighbours={\"r\": 2}", P, "numerics.neighbours.r", &["expected `radius`"]),
        ("boundary.top.traction=5", P, TRACTION, &["a list of three components"]),
        ("boundary.top.traction=[1, 2]", P, TRACTION, &["a list of 3"]),
        ("boundary.top.traction=[1, [2], 3]", P, "boundary.top.traction[1]", &["a number, an expression in X, Y, Z and t, {\"table\": ...} or {\"external\": ...}"]),
        ("boundary.top.traction={\"tabel\": 1}", P, "boundary.top.traction.tabel", &["`table`, `external`"]),
        ("boundary.top.traction={\"per_particle\": true}", P, TRACTION, &["exactly one of the keys"]),
        ("boundary.top.pressure=true", P, "boundary.top.pressure", &["expected a number, an expression"]),
        ("output.fields=velocity", P, "output.fields", &["expected a list"]),
        // Not finite.
        ("time.end=NaN", P, "time.end", &["expected a number"]),
        ("time.end=1e999", P, "time.end", &["expected a number"]),
        ("boundary.top.pressure=NaN", S, "boundary.top.pressure", &["unknown name `NaN`"]),
        ("boundary.top.pressure=1e999", S, "boundary.top.pressure", &["not a finite number"]),
        ("boundary.top.pressure=1/0", S, "boundary.top.pressure", &["is inf, not a finite number"]),
        ("body_force=[0, \"0/0\", 0]", S, "body_force[1]", &["not a finite number"]),
        // Material.
        ("material.neo_hookean.density=-1", S, "material.neo_hookean.density", &["above 0 instead of -1"]),
        ("material.neo_hookean.youngs_modulus=0", S, "material.neo_hookean.youngs_modulus", &["above 0"]),
        ("material.neo_hookean.poisson_ratio=0.5", S, "material.neo_hookean.poisson_ratio", &["less than 0.5"]),
        ("material.neo_hookean.poisson_ratio=-1", S, "material.neo_hookean.poisson_ratio", &["more than -1"]),
        ("material={\"mooney_rivlin\": {\"density\": 1, \"youngs_modulus\": 1, \"poisson_ratio\": 0, \"area_share\": 1.5}}", S, "material.mooney_rivlin.area_share", &["from 0 to 1"]),
        (&linear("poisson_ratio", 0.5), S, "material.linear_elastic.poisson_ratio", &["less than 0.5"]),
        (&steel("yield_stress", 0.0), S, "material.von_mises.yield_stress", &["above 0 instead of 0"]),
        (&steel("hardening_modulus", -1.0), S, "material.von_mises.hardening_modulus", &["0 or more, instead of -1"]),
        (&steel("saturation_stress", 9.0), S, "material.von_mises.saturation_stress", &["not below `yield_stress`, 10, instead of 9"]),
        (&steel("saturation_stress", -1.0), S, "material.von_mises.saturation_stress", &["above 0 instead of -1"]),
        (&steel("saturation_exponent", 0.0), S, "material.von_mises.saturation_exponent", &["above 0 instead of 0"]),
        (&steel("hardness", 1.0), P, "material.von_mises.hardness", &["unknown key `hardness`", "`saturation_stress`"]),
        (&without("saturation_stress"), S, "material.von_mises.saturation_exponent", &["needs `saturation_stress` too"]),
        (&without("saturation_exponent"), S, "material.von_mises.saturation_stress", &["needs `saturation_exponent` too"]),
        (&without("yield_stress"), P, "material.von_mises", &["missing key `yield_stress`"]),
        (&copper("yield_stress", 0.0), S, "material.johnson_cook.yield_stress", &["above 0"]),
        (&copper("hardening_exponent", 0.0), S, "material.johnson_cook.hardening_exponent", &["above 0"]),
        (&copper("hardening_modulus", -1.0), S, "material.johnson_cook.hardening_modulus", &["0 or more"]),
        (&copper("rate_coefficient", -0.1), S, "material.johnson_cook.rate_coefficient", &["0 or more"]),
        (&copper("reference_strain_rate", 0.0), S, "material.johnson_cook.reference_strain_rate", &["above 0"]),
        (&copper("softening_exponent", -1.0), S, "material.johnson_cook.softening_exponent", &["above 0"]),
        (&copper("transition_temperature", 1356.2), S, "material.johnson_cook.transition_temperature", &["less than `melting_temperature`, 1356.2, instead of 1356.2"]),
        (&copper("melting_temperature", 0.0), S, "material.johnson_cook.melting_temperature", &["above 0"]),
        // Geometry.
        ("geometry.box.spacing=0", S, "geometry.box.spacing", &["above 0"]),
        ("geometry.box.spacing=[0.5, -1, 0.5]", S, "geometry.box.spacing[1]", &["above 0"]),
        ("geometry.box.spacing=2", S, "geometry.box.spacing", &["larger than the edge 1"]),
        ("geometry.box.max[1]=0", S, "geometry.box.max[1]", &["more than min[1]"]),
        ("geometry={\"boxes\": {}}", S, "geometry.boxes", &["at least one box"]),
        ("geometry={\"boxes\": {\"a.b\": {\"min\": [0,0,0], \"max\": [1,1,1], \"spacing\": 1}}}", S, "geometry.boxes.a.b", &["is not a name"]),
        ("geometry.box.spacing=1e-3", M, "geometry.box.spacing", &["6013008001 particles"]),
        ("geometry.box.spacing=1e-300", M, "geometry.box.spacing", &["particles", "GB"]),
        // Patches and conditions.
        ("boundary.tip.support=clamped", S, "boundary.tip", &["no patch `tip`", "`top`", "`x_min`", "see the override"]),
        ("patches.side.faces=[\"left\"]", S, "patches.side.faces[0]", &["no face `left`", "`z_max`"]),
        ("patches.side.faces=[]", S, "patches.side.faces", &["at least one face"]),
        ("patches.side.faces=[\"x_min\", \"x_min\"]", S, "patches.side.faces[1]", &["twice"]),
        ("patches.side={\"faces\": [\"x_min\"], \"min\": [0, 1, 0], \"max\": [0, 0, 0]}", S, "patches.side.max[1]", &["at least min[1]"]),
        ("patches.x_min.faces=[\"x_min\"]", S, "patches.x_min", &["name of a face already"]),
        ("patches.1st.faces=[\"x_min\"]", S, "patches.1st", &["starts with a letter"]),
        ("boundary.bottom.velocity=[0, 0, 0]", S, "boundary.bottom", &["not both"]),
        ("boundary.bottom.support=glued", P, "boundary.bottom.support", &["`clamped`, `roller`, `antisymmetry`"]),
        ("boundary.top.traction=[0, null, 0]", S, "boundary.top.traction[1]", &["`null`", "write 0"]),
        ("boundary.top.traction=[0, {\"external\": 1}, 0]", S, "boundary.top.traction[1]", &["whole vector external"]),
        // Expressions and tables.
        ("boundary.top.pressure=x", S, "boundary.top.pressure", &["unknown name `x`", "X, Y, Z", "sqrt"]),
        ("boundary.top.pressure=2X", S, "boundary.top.pressure", &["an operator instead of `X` at character 2"]),
        ("boundary.top.pressure=X +", S, "boundary.top.pressure", &["it ends where"]),
        ("boundary.top.pressure=X**2", S, "boundary.top.pressure", &["written with `^`"]),
        ("boundary.top.pressure=max(X)", S, "boundary.top.pressure", &["takes 2 arguments, not 1"]),
        ("boundary.top.pressure=sin X", S, "boundary.top.pressure", &["`(` after the function sin"]),
        ("boundary.top.pressure=\"\"", S, "boundary.top.pressure", &["it ends where"]),
        (&table("[0, 1]", "[[0,0,0]]"), S, "boundary.top.traction.table.value", &["2 times and 1 values"]),
        (&table("[]", "[]"), S, "boundary.top.traction.table.time", &["at least one time"]),
        (&table("[0, 0]", "[[0,0,0],[1,1,1]]"), S, "boundary.top.traction.table.time[1]", &["increase strictly"]),
        (&table("[0]", "[[0,0]]"), P, "boundary.top.traction.table.value[0]", &["a list of 3"]),
        // Body force and initial values.
        ("body_force={\"external\": [0, 0, 0]}", S, "body_force", &["cannot be external", "a table"]),
        ("body_force=[null, 0, 0]", S, "body_force[0]", &["`null`"]),
        ("initial.velocity[1]=t", S, "initial.velocity[1]", &["cannot depend on t"]),
        ("initial.velocity[1]=null", S, "initial.velocity[1]", &["`null`"]),
        ("initial.displacement={\"external\": [0, 0, 0]}", S, "initial.displacement", &["an initial value"]),
        ("initial.displacement=[0, 0, {\"table\": {\"time\": [0], \"value\": [1]}}]", S, "initial.displacement[2]", &["an initial value"]),
        // Numerics.
        ("numerics.neighbours=7", S, "numerics.neighbours", &["6, 18, 26", "instead of 7"]),
        ("numerics.neighbours={\"radius\": 1}", S, "numerics.neighbours.radius", &["above 1"]),
        ("numerics.smoothing_factor=0.5", S, "numerics.smoothing_factor", &["more than 0.5"]),
        ("numerics.smoothing_factor=2.1", S, "numerics.smoothing_factor", &["at most 2"]),
        ("numerics={\"operators\": \"mesh\", \"kernel_option\": 3, \"reference_update\": \"every_step\"}", S, "numerics.kernel_option", &["set 1 or 2"]),
        ("numerics={\"operators\": \"repaired\", \"weights\": \"tributary\"}", S, "numerics.weights", &["`kernel`"]),
        ("numerics.operators=printed", P, "numerics.operators", &["`kernel`, `repaired`, `mesh`"]),
        ("numerics.kernel_option=0", S, "numerics.kernel_option", &["1, 2, 3 or 4"]),
        ("numerics.reference_update={\"when\": {\"strain\": 0}}", S, "numerics.reference_update.when.strain", &["more than 0", "less than 0.5"]),
        ("numerics.reference_update={\"when\": {\"strain\": 0.5}}", S, "numerics.reference_update.when.strain", &["instead of 0.5"]),
        ("numerics.reference_update={\"when\": {\"stretch\": 2}}", P, "numerics.reference_update.when.stretch", &["unknown key `stretch`"]),
        ("numerics.reference_update={\"every\": 0}", S, "numerics.reference_update.every", &["at least 1"]),
        ("numerics.dissipation_coefficient=0", S, "numerics.dissipation_coefficient", &["more than 0"]),
        ("numerics={\"dissipation\": false, \"dissipation_coefficient\": 0.5}", S, "numerics.dissipation_coefficient", &["switched off"]),
        ("numerics.volume_dissipation=0.1", S, "numerics.volume_dissipation", &["`fj` or `fhj`"]),
        ("numerics.volume_dissipation=-0.1", S, "numerics.volume_dissipation", &["0 or more"]),
        ("numerics={\"limiter\": \"minmod\", \"reconstruction\": \"none\"}", S, "numerics.limiter", &["to be `linear`"]),
        ("numerics={\"limiter\": \"shock\", \"dissipation\": false}", S, "numerics.limiter", &["switched off"]),
        ("numerics.cfl=0", S, "numerics.cfl", &["more than 0"]),
        ("numerics.cfl=2.5", S, "numerics.cfl", &["at most 2"]),
        ("numerics.time_step=0", S, "numerics.time_step", &["above 0"]),
        ("numerics.smallest_step=-0.1", S, "numerics.smallest_step", &["0 or more"]),
        ("numerics.smallest_step=1", S, "numerics.smallest_step", &["less than 1"]),
        ("numerics.strain_increment=-0.1", S, "numerics.strain_increment", &["0 or more"]),
        ("numerics={\"time_step\": 1e-5, \"cfl\": 0.5}", S, "numerics.time_step", &["not both"]),
        ("numerics={\"time_step\": 1e-5, \"strain_increment\": 0.5}", S, "numerics.time_step", &["not both"]),
        // Time, probes, output.
        ("time.end=0", S, "time.end", &["above 0"]),
        ("probes.p=[0, 6.01, 0]", S, "probes.p", &["outside the body"]),
        ("probes.top centre=[0, 6, 0]", S, "probes.top centre", &["is not a name"]),
        ("output.history_interval=0", S, "output.history_interval", &["above 0"]),
        ("output.field_interval=-1", S, "output.field_interval", &["above 0"]),
        ("output.fields=[\"velocity\", \"colour\"]", S, "output.fields[1]", &["no field `colour`", "`cauchy_stress`"]),
        ("output.fields=[\"velocity\", \"velocity\"]", S, "output.fields[1]", &["twice"]),
        // Overrides that have no place.
        ("time.end", A, "", &["`time.end`", "expected `path=value`"]),
        ("=1", A, "", &["the path is empty"]),
        ("time..end=1", A, "", &["a name is missing after `time`"]),
        ("time.end.seconds=1", A, "", &["time.end is a number, it has no key `seconds`"]),
        ("probes.top_corner[3]=1", A, "", &["3 elements", "no [3]"]),
        ("probes.top_corner[x]=1", A, "", &["not an index"]),
        ("probes.top_corner[0=1", A, "", &["no closing"]),
        ("probes.top_corner[0]1=1", A, "", &["expected `.` or `[`"]),
        ("boundary.top.velocity[1]=5", A, "", &["is not set", "as a whole"]),
    ];
    for (text, code, path, words) in rows {
        let Err(error) = example("column_twisting", &[text]) else {
            panic!("{text} is accepted");
        };
        println!("{text}\n    {error}");
        assert_eq!(error.code(), *code, "{text}: {error}");
        assert_eq!(
            error.place().path.as_deref().unwrap_or(""),
            *path,
            "{text}: {error}"
        );
        for word in *words {
            assert!(
                error.message().contains(word),
                "{text}: no {word:?} in: {error}"
            );
        }
        if *code != A {
            assert!(
                error
                    .message()
                    .contains(&format!("see the override `{text}`")),
                "{error}"
            );
        }
    }
}

#[test]
fn conditions_for_heat_need_heat() {
    let heat = r#"heat={"specific_heat": 1, "reference_temperature": 293}"#;
    for (key, value) in [
        ("heat_flux", "1"),
        ("temperature", "300"),
        (
            "convection",
            r#"{"coefficient": 1, "ambient_temperature": 300}"#,
        ),
    ] {
        let condition = format!("boundary.x_max.{key}={value}");
        example("elastic_cube", &[heat, &condition]).unwrap_or_else(|e| panic!("{e}"));
        let error = example("elastic_cube", &[&condition]).unwrap_err();
        assert!(
            error.to_string().contains("needs the section `heat`"),
            "{error}"
        );
        let path = format!("boundary.x_max.{key}");
        assert_eq!(error.place().path.as_deref(), Some(path.as_str()));
    }
    let error = example("elastic_cube", &["initial.temperature=300"]).unwrap_err();
    assert!(
        error.to_string().contains("add a section `heat`"),
        "{error}"
    );
}

#[test]
fn text_that_is_not_json_is_refused_with_line_and_column() {
    for (text, words) in [
        ("", "line 1 column 0"),
        (
            "{\n  \"title\": \"x\",\n  \"time\": {,}\n}",
            "line 3 column 12",
        ),
        ("{\"time\": {\"end\": NaN}}", "JSON has no NaN"),
        (
            "{\"time\": {\"end\": -Infinity}}",
            "JSON has no NaN and no Infinity",
        ),
        ("{\"time\": {\"end\": 1e999}}", "number out of range"),
        (
            "{\"time\": {\"end\": 1}, \"time\": {\"end\": 2}}",
            "duplicate key `time`",
        ),
        ("{} {}", "trailing characters"),
        ("[]", "a list, expected an object"),
        ("3", "expected an object"),
        ("{}", "missing key `geometry`"),
        (&"[".repeat(100_000), "recursion limit"),
    ] {
        let error = Scene::from_json(text, &[]).unwrap_err();
        assert_eq!(error.code(), Code::Parse, "{error}");
        assert!(error.message().contains(words), "no {words:?} in: {error}");
    }
}

#[test]
fn a_scene_made_in_code_is_checked_too() {
    let good = example("elastic_cube", &[]).unwrap();
    good.validate().unwrap();
    let mut scene = good.clone();
    scene.time.end = f64::NAN;
    assert_eq!(
        scene.validate().unwrap_err().place().path.as_deref(),
        Some("time.end")
    );
    let mut scene = good.clone();
    scene.numerics.smoothing_factor = f64::NAN;
    scene.validate().unwrap_err();
    let mut scene = good.clone();
    scene.body_force = Some(Vector::External {
        external: [0.0, f64::INFINITY, 0.0],
        per_particle: false,
    });
    let error = scene.validate().unwrap_err();
    assert_eq!(
        error.place().path.as_deref(),
        Some("body_force.external[1]")
    );
    let mut scene = good;
    scene.initial.velocity = Some(Vector::Components([
        Some(Scalar::Constant(f64::NAN)),
        None,
        None,
    ]));
    let error = scene.validate().unwrap_err();
    assert_eq!(error.place().path.as_deref(), Some("initial.velocity[0]"));
}

/// Whether a value satisfies a schema: the part of JSON Schema that the scene's schema uses.
fn accepts(root: &Value, schema: &Value, value: &Value) -> bool {
    let keywords = schema.as_object().unwrap();
    keywords.iter().all(|(keyword, rule)| {
        let number = value.as_f64();
        match keyword.as_str() {
            "$schema" | "$defs" | "title" | "description" | "default" | "format" => true,
            "$ref" => {
                let pointer = rule.as_str().unwrap().strip_prefix('#').unwrap();
                accepts(root, root.pointer(pointer).unwrap(), value)
            }
            "type" => match rule {
                Value::Array(types) => types.iter().any(|t| is_type(t, value)),
                one => is_type(one, value),
            },
            "properties" => value.as_object().is_none_or(|object| {
                let known = |key: &String| Some((rule.get(key)?, object.get(key)?));
                let mut members = object.keys().filter_map(known);
                members.all(|(property, member)| accepts(root, property, member))
            }),
            "additionalProperties" => value.as_object().is_none_or(|object| {
                let mut others = object
                    .iter()
                    .filter(|(key, _)| schema["properties"].get(key).is_none());
                others.all(|(_, member)| *rule != json!(false) && accepts(root, rule, member))
            }),
            "required" => value.as_object().is_none_or(|object| {
                let mut keys = rule.as_array().unwrap().iter();
                keys.all(|key| object.contains_key(key.as_str().unwrap()))
            }),
            "items" => value
                .as_array()
                .is_none_or(|items| items.iter().all(|item| accepts(root, rule, item))),
            "minItems" => value
                .as_array()
                .is_none_or(|i| i.len() as u64 >= rule.as_u64().unwrap()),
            "maxItems" => value
                .as_array()
                .is_none_or(|i| i.len() as u64 <= rule.as_u64().unwrap()),
            "anyOf" => rule
                .as_array()
                .unwrap()
                .iter()
                .any(|s| accepts(root, s, value)),
            "oneOf" => {
                let options = rule.as_array().unwrap().iter();
                options.filter(|s| accepts(root, s, value)).count() == 1
            }
            "const" => rule == value,
            "enum" => rule.as_array().unwrap().contains(value),
            "minimum" => number.is_none_or(|v| v >= rule.as_f64().unwrap()),
            "maximum" => number.is_none_or(|v| v <= rule.as_f64().unwrap()),
            "exclusiveMinimum" => number.is_none_or(|v| v > rule.as_f64().unwrap()),
            "exclusiveMaximum" => number.is_none_or(|v| v < rule.as_f64().unwrap()),
            other => panic!("the schema uses the keyword {other}, which this test does not know"),
        }
    })
}

fn is_type(name: &Value, value: &Value) -> bool {
    match name.as_str().unwrap() {
        "object" => value.is_object(),
        "array" => value.is_array(),
        "string" => value.is_string(),
        "number" => value.is_number(),
        "integer" => value.is_u64() || value.is_i64(),
        "boolean" => value.is_boolean(),
        "null" => value.is_null(),
        other => panic!("unknown type {other}"),
    }
}

#[test]
fn the_schema_accepts_what_the_parser_accepts() {
    let schema = json_schema();
    assert_eq!(
        schema["$schema"],
        "https://json-schema.org/draft/2020-12/schema"
    );
    assert_eq!(schema["title"], "urlsph scene");
    let numerics = &schema["$defs"]["Numerics"]["properties"];
    assert_eq!(numerics["neighbours"]["default"], 18);
    assert_eq!(numerics["smoothing_factor"]["default"], 0.6);
    for (name, definition) in schema["$defs"].as_object().unwrap() {
        assert!(
            definition.get("description").is_some(),
            "{name} has no description"
        );
        for (key, property) in definition["properties"].as_object().into_iter().flatten() {
            assert!(
                property.get("description").is_some(),
                "{name}.{key} has no description"
            );
        }
    }
    let ok = |value: &Value| accepts(&schema, &schema, value);
    for path in examples() {
        let text = std::fs::read_to_string(&path).unwrap();
        assert!(ok(&serde_json::from_str(&text).unwrap()), "{path:?}");
    }
    let all = everything();
    assert!(ok(&all));
    let missing = |scene: &Value, properties: &Value| -> Vec<String> {
        let keys = properties.as_object().unwrap().keys();
        keys.filter(|key| scene.get(key).is_none())
            .cloned()
            .collect()
    };
    // A preset leaves the scene when it is read.
    assert_eq!(missing(&all, &schema["properties"]), ["preset"]);
    assert_eq!(missing(&all["numerics"], numerics), ["time_step"]);
    for geometry in geometries() {
        let scene = around(&geometry);
        assert!(ok(&scene), "{geometry}");
        let read = Scene::from_json(&scene.to_string(), &[]).unwrap_or_else(|e| panic!("{e}"));
        let text = serde_json::to_string(&read).unwrap();
        assert!(ok(&serde_json::from_str(&text).unwrap()), "{text}");
        assert_eq!(Scene::from_json(&text, &[]).unwrap(), read);
    }
    for (pointer, bad) in [
        ("/material/mooney_rivlin/density", json!(-1)),
        ("/material/mooney_rivlin/poisson_ratio", json!(0.5)),
        ("/numerics/neighbours", json!(7)),
        ("/numerics/neighbours", json!({"radius": 2, "x": 1})),
        ("/numerics/kernel_option", json!(5)),
        ("/numerics/reference_update/every", json!(0)),
        (
            "/numerics/reference_update",
            json!({"when": {"strain": 0.5}}),
        ),
        ("/boundary/tip/velocity", json!([1, 2])),
        (
            "/boundary/tip/velocity",
            json!({"external": [1, 2, 3], "colour": 1}),
        ),
        ("/geometry", json!({"sphere": {}})),
        ("/geometry/boxes/base/spacing", json!("fine")),
        ("/time", json!({})),
        ("/title", json!(3)),
    ] {
        let mut scene = everything();
        *scene.pointer_mut(pointer).unwrap() = bad.clone();
        assert!(!ok(&scene), "{pointer} = {bad} is accepted by the schema");
        assert!(Scene::from_json(&scene.to_string(), &[]).is_err());
    }
}

/// What the README shows is valid: its scene, its geometries, and its conditions on that scene.
#[test]
fn the_scenes_of_the_readme_are_valid() {
    let root = env!("CARGO_MANIFEST_DIR");
    let readme = std::fs::read_to_string(format!("{root}/README.md")).unwrap();
    // As the text says: comments are not part of JSON.
    let blocks: Vec<String> = readme
        .split("```jsonc\n")
        .skip(1)
        .map(|rest| {
            let block = rest.split("```").next().unwrap();
            let lines = block.lines().map(|l| l.split("//").next().unwrap());
            lines.collect::<Vec<_>>().join("\n")
        })
        .collect();
    let [scene, geometries, conditions] = &blocks[..] else {
        panic!("{} blocks", blocks.len());
    };
    let scene: Value = serde_json::from_str(scene).unwrap();
    let valid = |scene: &Value| {
        Scene::from_json(&scene.to_string(), &[]).unwrap_or_else(|e| panic!("{e}: {scene}"))
    };
    valid(&scene);

    let mut with = scene.clone();
    let conditions: Value = serde_json::from_str(&format!("{{{conditions}}}")).unwrap();
    for (key, value) in conditions.as_object().unwrap() {
        with[key] = value.clone();
    }
    valid(&with);

    let place = |min: i32| {
        format!(
            r#"{{"min": [{min}, 0, 0], "max": [{}, 1, 1], "spacing": 0.5}}"#,
            min + 1
        )
    };
    let geometries = geometries
        .replacen("{...}", &place(0), 1)
        .replacen("{...}", &place(1), 1)
        .replace("bar.msh", &format!("{root}/examples/meshes/bar_1.msh"));
    let mut bare = json!({ "boundary": {}, "time": { "end": 1 } });
    bare["material"] = scene["material"].clone();
    let mut kinds = Vec::new();
    for geometry in serde_json::Deserializer::from_str(&geometries).into_iter::<Value>() {
        bare["geometry"] = geometry.unwrap();
        valid(&bare);
        kinds.extend(bare["geometry"].as_object().unwrap().keys().cloned());
    }
    assert_eq!(
        kinds,
        ["box", "boxes", "cylinder", "perforated_box", "mesh"]
    );
}

/// A preset makes the cells larger or smaller once, and leaves a scene that has them itself.
#[test]
fn presets_change_the_cells() {
    let spacing = |preset: &str| {
        let scene = example("column_bending", &[&format!("preset={preset}")]).unwrap();
        assert_eq!(scene.preset, None);
        let text = serde_json::to_string(&scene).unwrap();
        assert_eq!(Scene::from_json(&text, &[]).unwrap(), scene);
        match scene.geometry {
            Geometry::Box(b) => b.spacing,
            _ => unreachable!("the column is a box"),
        }
    };
    // 4 x 24 x 4 cells.
    assert_eq!(spacing("balanced"), Spacing::Uniform(0.25));
    let divided = |[x, y, z]: [f64; 3]| Spacing::PerAxis([1.0 / x, 6.0 / y, 1.0 / z]);
    assert_eq!(spacing("fast"), divided([3.0, 18.0, 3.0]));
    assert_eq!(spacing("accurate"), divided([6.0, 36.0, 6.0]));
    let refused: [(&[&str], &str); 2] = [
        (&["preset=best"], "preset"),
        (
            &["preset=fast", "numerics.time_step=1e-5"],
            "numerics.time_step",
        ),
    ];
    for (overrides, path) in refused {
        let error = example("column_bending", overrides).unwrap_err();
        println!("{error}");
        assert!(error.to_string().contains(path));
    }
}
