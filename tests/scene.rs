//! Scenes: what is accepted, what is refused and with which words.

use std::path::PathBuf;

use urlsph::scene::{Neighbours, Scalar, ScalarFunction, Scene, Spacing, Vector, VectorFunction};
use urlsph::{Code, Error};

const EXAMPLES: [&str; 5] = [
    "column_tension",
    "column_bending",
    "column_twisting",
    "l_block",
    "elastic_cube",
];

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
    for name in EXAMPLES {
        let scene = example(name, &[]).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert!(!scene.title.is_empty(), "{name} has no title");
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
