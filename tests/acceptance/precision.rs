//! Sums over pairs in single precision: how far they are from double precision, what they conserve, what they hold.

use urlsph::{Code, Field, Scene, Simulation};

use crate::support::*;

const SINGLE: &str = "numerics.precision=single";

/// Largest differences of position and velocity over the largest displacement and velocity, at `end`.
fn difference(case: &str, overrides: &[&str], end: f64) -> [f64; 2] {
    let fields = [&[][..], &[SINGLE][..]].map(|precision| {
        let mut simulation = simulation(case, &[overrides, precision].concat());
        run(&mut simulation, end, |_| ());
        [Field::Displacement, Field::Velocity].map(|f| field(&simulation, f))
    });
    let [double, single] = fields;
    [0, 1].map(|k| {
        let rest: Vec<f64> = std::iter::zip(&double[k], &single[k])
            .map(|(a, b)| a - b)
            .collect();
        let largest = |values: &[f64]| {
            let vectors = values.chunks_exact(3);
            vectors.map(norm).fold(0.0, f64::max)
        };
        largest(&rest) / largest(&double[k])
    })
}

#[test]
fn single_precision_follows_double_precision() {
    let cases: &[(&str, &[&str], f64)] = &[
        ("column_twisting", &[], 0.1),
        ("column_twisting", &["geometry.box.spacing=0.125"], 0.1),
        ("column_twisting", &["numerics.limiter=minmod"], 0.1),
        (
            "column_twisting",
            &["numerics.angular_momentum_projection=true"],
            0.1,
        ),
        (
            "column_twisting",
            &[
                "numerics.operators=repaired",
                "numerics.kernel_option=3",
                "numerics.reference_update={\"when\": {}}",
            ],
            0.1,
        ),
        (
            "column_bending",
            &["geometry.box.jitter={\"fraction\": 0.2}"],
            0.3,
        ),
        (
            "column_bending",
            &["numerics.state=fj", "numerics.volume_dissipation=0.1"],
            0.3,
        ),
        ("l_block_thermal", &[], 1.0),
        (
            "copper_impact",
            &[
                "geometry.cylinder.divisions=2",
                "geometry.cylinder.layers=20",
            ],
            2e-5,
        ),
    ];
    for (case, overrides, end) in cases {
        let [position, velocity] = difference(case, overrides, *end);
        check(&format!("{case} {overrides:?}: position"), position, 1e-5);
        check(&format!("{case} {overrides:?}: velocity"), velocity, 3e-5);
    }
}

/// Each pair gives both of its particles the same force, which is then rounded in their sums; the projection
/// works on these in double precision.
#[test]
fn momenta_of_a_free_body_drift_by_round_off() {
    for (projection, tolerance) in [(false, 1e-6), (true, 1e-12)] {
        let projection = format!("numerics.angular_momentum_projection={projection}");
        let mut simulation = cube(1.0, &[SINGLE, &projection]).unwrap_or_else(|e| panic!("{e}"));
        let start = simulation.momenta();
        let [mut linear, mut angular] = [0.0_f64; 2];
        run(&mut simulation, 0.1, |s| {
            let now = s.momenta();
            let change = |a: [f64; 3], b: [f64; 3]| norm(&[a[0] - b[0], a[1] - b[1], a[2] - b[2]]);
            linear = linear.max(change(now.linear, start.linear) / norm(&start.linear));
            angular = angular.max(change(now.angular, start.angular) / norm(&start.angular));
        });
        check(&format!("{projection}: linear momentum"), linear, tolerance);
        println!("{projection}: angular momentum {angular:.1e}");
        if projection.ends_with("true") {
            check("angular momentum", angular, tolerance);
        }
    }
}

/// A cube with sides of `size` [m] in a wave.
fn cube(size: f64, overrides: &[&str]) -> urlsph::Result<Simulation> {
    let text = format!(
        r#"{{
            "geometry": {{"box": {{"min": [0, 0, 0], "max": [{size}, {size}, {size}], "spacing": {}}}}},
            "material": {{"neo_hookean": {{"density": 1100, "youngs_modulus": 1.7e7, "poisson_ratio": 0.3}}}},
            "initial": {{"velocity": ["5*sin(3*Y/{size})", "2*X/{size}", "cos(2*X/{size})*Y/{size}"]}},
            "numerics": {{"limiter": "shock"}},
            "time": {{"end": 1}}
        }}"#,
        size / 8.0
    );
    let overrides: Vec<String> = overrides.iter().map(|o| (*o).to_owned()).collect();
    Simulation::with_threads(Scene::from_json(&text, &overrides)?, 1)
}

#[test]
fn bodies_of_any_size_that_single_precision_holds() {
    for size in [1e-6, 1e-3, 1.0, 1e3, 1e6] {
        let positions = [&[][..], &[SINGLE][..]].map(|precision| {
            let mut simulation = cube(size, precision).unwrap_or_else(|e| panic!("{e}"));
            run(&mut simulation, 0.01 * size, |_| ());
            field(&simulation, Field::Displacement)
        });
        let [double, single] = &positions;
        let largest = double.iter().copied().fold(0.0, f64::max);
        let error = std::iter::zip(double, single)
            .map(|(a, b)| (a - b).abs() / largest)
            .fold(0.0, f64::max);
        check(&format!("sides of {size:e} m: position"), error, 1e-5);
    }
    for size in [1e-8, 1e10] {
        cube(size, &[]).unwrap_or_else(|e| panic!("{e}"));
        let error = cube(size, &[SINGLE]).expect_err("beyond the range of single precision");
        println!("{error}");
        assert_eq!(error.code(), Code::InvalidScene);
        assert!(error.to_string().contains("numerics.precision"), "{error}");
        assert!(error.to_string().contains("double"), "{error}");
    }
}

#[test]
fn single_precision_takes_less_memory() {
    let bytes = [&[][..], &[SINGLE][..]].map(|precision| {
        let spacing = ["geometry.box.spacing=0.0625"];
        let simulation = simulation("column_twisting", &[&spacing, precision].concat());
        simulation.memory() as f64
    });
    check(
        "memory over that of double precision",
        bytes[1] / bytes[0],
        0.85,
    );
}
