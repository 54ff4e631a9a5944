//! Supports, loads and what the ledger and the resultants say of them.
#![allow(missing_docs)]

mod common;

use urlsph::{Code, Field, Quantity, Simulation};

use common::{BLOCK, block, close, field, refuses};

/// |a - b| over a scale, printed beside its tolerance.
fn near(what: &str, a: [f64; 3], b: [f64; 3], scale: f64, tolerance: f64) {
    let d = (0..3).map(|c| (a[c] - b[c]).powi(2)).sum::<f64>().sqrt() / scale;
    println!("{what}: {d:e} (tolerance {tolerance:e})");
    assert!(d < tolerance, "{what}: {a:?} instead of {b:?}");
}

#[test]
fn a_free_body_falls_exactly() {
    let mut s = block(&[r#"body_force=[0, "-9810", 0]"#]);
    s.advance(0.1).expect("it runs");
    let u = field(&s, Field::Displacement);
    let v = field(&s, Field::Velocity);
    for i in 0..s.particle_count() {
        assert!((u[3 * i + 1] + 0.5 * 9.81 * 0.01).abs() < 1e-12);
        assert!((v[3 * i + 1] + 0.981).abs() < 1e-12);
    }
    let e = s.energies();
    let work = 9810.0 * 2.0 * 0.5 * 9.81 * 0.01;
    println!(
        "work {} of {work}, closure {:e}",
        e.external_work, e.closure_error
    );
    assert!((e.external_work / work - 1.0).abs() < 1e-12);
    assert!(e.closure_error.abs() < 1e-9 * work);
}

/// Rate of momentum = forces through all patches + body force; and the ledger closes.
#[test]
fn resultants_balance_the_momentum_and_the_ledger_closes() {
    let cases: &[&[&str]] = &[
        &[
            "boundary.y_min.support=clamped",
            r#"boundary.y_max.traction=["2e4*t", 3e4, "1e4*sin(20*t)"]"#,
            r#"boundary.x_max.pressure="5e4*(1+Y)""#,
            r#"body_force=["1e3*X", -9810, 0]"#,
        ],
        &[
            "boundary.x_min.support=roller",
            "boundary.y_min.support=roller",
            "boundary.z_max.support=roller",
            r#"boundary.y_max.velocity=[null, "-2*sin(8*t)", null]"#,
        ],
        &[
            "boundary.y_min.support=clamped",
            "boundary.y_max.velocity={\"table\": {\"time\": [0, 0.05, 1], \"value\": [[0,0,0],[2,1,0],[2,1,0]]}}",
            "boundary.x_min.pressure={\"table\": {\"time\": [0, 0.1], \"value\": [0, 2e4]}}",
            "numerics.cfl=0.3",
        ],
    ];
    for overrides in cases {
        let mut s = block(overrides);
        let mut scale: f64 = 0.0;
        for i in 1..=40 {
            let dt = 1e-5;
            s.advance(0.005 * f64::from(i) - dt).expect("it runs");
            let before = s.momenta().linear;
            s.advance(0.005 * f64::from(i)).expect("it runs");
            let middle: [f64; 3] = {
                let total = (0..s.patches().len()).fold([0.0; 3], |sum, p| {
                    let f = s.resultant(p).force;
                    [sum[0] + f[0], sum[1] + f[1], sum[2] + f[2]]
                });
                let volume = field(&s, Field::InitialVolume);
                let x = field(&s, Field::InitialPosition);
                let body = |c: usize| -> f64 {
                    if !overrides.iter().any(|o| o.starts_with("body_force")) {
                        return 0.0;
                    }
                    let f = |i: usize| [1e3 * x[3 * i], -9810.0, 0.0][c];
                    (0..volume.len()).map(|i| volume[i] * f(i)).sum()
                };
                [total[0] + body(0), total[1] + body(1), total[2] + body(2)]
            };
            let nodal = field(&s, Field::NodalForce);
            let sum: [f64; 3] =
                std::array::from_fn(|c| nodal.iter().skip(c).step_by(3).sum::<f64>());
            let after = s.momenta().linear;
            let rate: [f64; 3] = std::array::from_fn(|c| (after[c] - before[c]) / dt);
            scale = scale.max(middle.iter().map(|f| f * f).sum::<f64>().sqrt());
            near("nodal forces", sum, middle, scale, 1e-9);
            if i == 40 {
                // The difference quotient lags by half its span.
                near("rate of momentum", rate, middle, scale, 2e-2);
            }
        }
        let e = s.energies();
        let size = e.kinetic + e.strain + e.numerical_dissipation;
        println!(
            "{e:?}: closure {:e} (tolerance 1e-3)",
            e.closure_error / size
        );
        assert!(e.closure_error.abs() < 1e-3 * size);
    }
}

/// A pressure all around has no resultant, also when the body has turned, and turns with it.
#[test]
fn pressure_follows_the_surface() {
    let pressures = ["x_min", "x_max", "y_min", "y_max", "z_min", "z_max"]
        .map(|f| format!("boundary.{f}.pressure=1e4"));
    let mut all: Vec<&str> = pressures.iter().map(String::as_str).collect();
    all.push(r#"initial.velocity=["-20*(Y-1)", "20*(X-0.5)", 0]"#);
    let mut s = block(&all);
    s.advance(0.08).expect("it runs");
    let p = s.momenta().linear;
    near("momentum", p, [0.0; 3], 1e4 * 0.08, 1e-10);
    let top = s.resultant(s.patch_index("y_max").expect("there"));
    let mean = top.mean_displacement;
    println!("the top face moved by {mean:?}, force {:?}", top.force);
    // After 1.6 rad the top face looks along -x: the pressure pushes it along +x.
    assert!(top.force[0] > 0.8e4 && top.force[1].abs() < 0.3e4);
}

#[test]
fn supports_leave_the_motion_that_they_should() {
    let mut s = block(&[
        "boundary.x_min.support=roller",
        "boundary.y_max.support=antisymmetry",
        r#"initial.velocity=["sin(3*Y)+Z", "X*Z", "1-X*Y"]"#,
    ]);
    s.advance(0.05).expect("it runs");
    let v = field(&s, Field::Velocity);
    let patch = |name: &str| {
        s.patches()[s.patch_index(name).expect("there")]
            .particles
            .clone()
    };
    for i in patch("x_min") {
        assert!(v[3 * i] == 0.0, "a roller keeps the normal component");
    }
    for i in patch("y_max") {
        assert!(
            v[3 * i] == 0.0 && v[3 * i + 2] == 0.0,
            "antisymmetry keeps the tangential ones"
        );
    }
    let moves = |list: &[usize], c: usize| list.iter().any(|i| v[3 * i + c].abs() > 1e-3);
    assert!(moves(&patch("x_min"), 1) && moves(&patch("x_min"), 2) && moves(&patch("y_max"), 1));
}

#[test]
fn traction_has_the_area_of_its_patch() {
    let s = block(&["boundary.y_max.traction=[1, 2, 3]"]);
    let top = s.patch_index("y_max").expect("there");
    let area: f64 = s.patches()[top].areas.iter().sum();
    assert!((area - 1.0).abs() < 1e-14);
    near("force", s.resultant(top).force, [1.0, 2.0, 3.0], 1.0, 1e-14);
    // About the origin, at the centre of the face.
    near(
        "moment",
        s.resultant(top).moment,
        [5.0, -1.0, -1.0],
        1.0,
        1e-13,
    );
}

#[test]
fn outside_values_per_patch_and_per_particle() {
    let external = r#"boundary.y_max.traction={"external": [0, 0, 0]}"#;
    let mut one = block(&["boundary.y_min.support=clamped", external]);
    let mut many = block(&["boundary.y_min.support=clamped", external]);
    let top = one.patch_index("y_max").expect("there");
    let count = one.patches()[top].particles.len();
    let value = [1e3, 2e4, -3e3];
    one.set_input(top, Quantity::Traction, &value)
        .expect("one value");
    many.set_input(top, Quantity::Traction, &value.repeat(count))
        .expect("one per particle");
    assert_eq!(one.input(top, Quantity::Traction).expect("there"), value);
    for s in [&mut one, &mut many] {
        s.advance(0.02).expect("it runs");
    }
    assert_eq!(field(&one, Field::Position), field(&many, Field::Position));
    near("force", one.resultant(top).force, value, 2e4, 1e-14);

    let hash = one.state_hash();
    for (values, text) in [
        (vec![1.0; 4], "give 3 for the whole patch"),
        (vec![f64::NAN, 0.0, 0.0], "only finite values"),
    ] {
        let e = one
            .set_input(top, Quantity::Traction, &values)
            .expect_err("refused");
        assert!(
            e.code() == Code::InvalidArgument && e.to_string().contains(text),
            "{e}"
        );
        assert_eq!(e.place().boundary.as_deref(), Some("y_max"));
    }
    let e = one
        .set_input(top, Quantity::Pressure, &[0.0])
        .expect_err("not declared");
    assert!(e.to_string().contains(r#""external": 0"#), "{e}");
    assert_eq!(one.state_hash(), hash);
}

/// An external velocity acts at once, and its work is in the ledger.
#[test]
fn outside_velocity_pushes_the_body() {
    let mut s = block(&[
        r#"boundary.y_min.velocity={"external": [0, 0, 0]}"#,
        "numerics.cfl=0.3",
    ]);
    let bottom = s.patch_index("y_min").expect("there");
    s.advance(0.01).expect("it runs");
    s.set_input(bottom, Quantity::Velocity, &[0.0, 1.0, 0.0])
        .expect("declared");
    for i in 2..=60 {
        s.advance(0.01 * f64::from(i)).expect("it runs");
    }
    let (r, e) = (s.resultant(bottom), s.energies());
    near("velocity", r.mean_velocity, [0.0, 1.0, 0.0], 1.0, 1e-12);
    near(
        "displacement",
        r.mean_displacement,
        [0.0, 0.59, 0.0],
        1.0,
        1e-12,
    );
    println!("{e:?}");
    assert!(e.external_work > 0.5 * 2000.0);
    assert!(e.closure_error.abs() < 1e-3 * e.external_work);
}

#[test]
fn contradictions_and_bad_places_are_refused() {
    let cases: &[(&[&str], &str, &str)] = &[
        (
            &[
                "boundary.y_min.support=clamped",
                "boundary.x_min.velocity=[0, 1, 0]",
            ],
            "boundary.",
            "both set the same component of its velocity",
        ),
        (
            &[
                "boundary.y_min.velocity=[null, 1, 0]",
                "boundary.z_min.velocity=[0, 1, null]",
            ],
            "boundary.",
            "both set the same component",
        ),
        (
            &[r#"patches.spot={"faces": ["y_max"], "min": [5, 0, 0]}"#],
            "patches.spot",
            "selects no particle",
        ),
        (
            &[r#"numerics.neighbours={"radius": 0.9}"#],
            "numerics.neighbours",
            "",
        ),
        (
            &[
                r#"geometry={"boxes": {"a": {"min": [0,0,0], "max": [1,1,1], "spacing": 0.5}, "b": {"min": [3,0,0], "max": [4,1,1], "spacing": 0.5}}}"#,
            ],
            "geometry",
            "parts that are not connected",
        ),
        (
            &[r#"body_force=["1/(X-0.25)", 0, 0]"#],
            "body_force",
            "not finite",
        ),
        (
            &[r#"initial.velocity=["ln(X-0.5)", 0, 0]"#],
            "initial.velocity",
            "not finite",
        ),
        (
            &[r#"boundary.y_max.pressure="1/(X-0.25)""#],
            "boundary.y_max.pressure",
            "not finite",
        ),
        (&["probes.far=[9, 9, 9]"], "probes.far", ""),
    ];
    for (overrides, path, text) in cases {
        refuses(BLOCK, overrides, path, text);
    }
}

/// A velocity that leaves a component free goes with a roller that holds that component.
#[test]
fn compatible_conditions_share_a_particle() {
    block(&[
        "boundary.x_min.support=roller",
        "boundary.y_max.velocity=[null, 1, 0]",
    ]);
}

#[test]
fn divergence_names_the_place_and_keeps_the_last_good_state() {
    let mut s = block(&[
        "numerics.time_step=0.02",
        r#"initial.velocity=["50*(X-0.5)", "40*Y", 0]"#,
    ]);
    let error = s.advance(1.0).expect_err("far beyond the stable step");
    println!("{error}");
    assert_eq!(error.code(), Code::Diverged);
    let place = error.place();
    assert!(place.particle.is_some() && place.position.is_some() && place.time.is_some());
    assert_eq!(place.field.as_deref(), Some("jacobian"));
    assert!(
        field(&s, Field::Jacobian)
            .iter()
            .all(|j| *j > 0.0 && j.is_finite())
    );
    assert!(field(&s, Field::CauchyStress).iter().all(|v| v.is_finite()));
    let time = s.time();
    for bad in [f64::NAN, f64::INFINITY, time, time - 1.0] {
        let e = s.advance(bad).expect_err("not later than now");
        assert_eq!(e.code(), Code::InvalidArgument);
    }
    assert_eq!(s.time(), time);
}

/// A block in which heat spreads within a second.
fn warm(overrides: &[&str]) -> Simulation {
    let heat = r#"heat={"specific_heat": 0.1, "reference_temperature": 300, "conductivity": 200}"#;
    block(&[&[heat], overrides].concat())
}

fn heat_flow(s: &Simulation, patch: &str) -> urlsph::HeatResultant {
    s.heat_resultant(s.patch_index(patch).expect("there"))
        .expect("a body with heat")
}

#[test]
fn a_heat_flux_is_heat_per_initial_area() {
    let mut s = warm(&[r#"boundary.y_max.heat_flux="1e4*(1+X)""#]);
    close("flow", heat_flow(&s, "y_max").heat_flow, 1.5e4, 1e-12);
    s.advance(0.5).expect("it runs");
    let e = s.energies();
    close("heat", e.heat_in, 0.5 * 1.5e4, 1e-10);
    // Without a coupling to the motion all of it is thermal energy, in a volume of 2 m^3.
    // The steps integrate entropy, so that the energy follows to their accuracy.
    close("thermal energy", e.thermal, e.heat_in, 1e-4);
    let (hot, cold) = (heat_flow(&s, "y_max"), heat_flow(&s, "y_min"));
    assert!(hot.maximum_temperature > hot.mean_temperature);
    assert!(hot.mean_temperature > cold.mean_temperature && cold.heat_flow == 0.0);
}

/// Between two temperatures the steady flow is k A (theta_1 - theta_0) / L; what one side supplies
/// the other takes.
#[test]
fn prescribed_temperatures_draw_their_heat() {
    let mut s = warm(&[
        "boundary.y_min.temperature=300",
        r#"boundary.y_max.temperature={"table": {"time": [0, 0.2], "value": [300, 400]}}"#,
    ]);
    s.advance(0.1).expect("it runs");
    let hot = heat_flow(&s, "y_max");
    close("while it rises", hot.mean_temperature, 350.0, 1e-12);
    s.advance(4.0).expect("it runs");
    let (hot, cold) = (heat_flow(&s, "y_max"), heat_flow(&s, "y_min"));
    close("flow in", hot.heat_flow, 1e4, 1e-3);
    close("flow out", cold.heat_flow, -1e4, 1e-3);
    let e = s.energies();
    // The conduction is linear in 1/theta: its profile bends a little between nine nodes.
    close("thermal energy", e.thermal, 1e4, 6e-3);
    // 1e4 W pass through for 4 s.
    let error = e.closure_error / 4e4;
    println!("closure {error:e} (tolerance 1e-5)");
    assert!(error.abs() < 1e-5);
}

/// With convection on one side and a flux on the other the wall settles where they balance.
#[test]
fn convection_balances_a_flux() {
    let mut s = warm(&[
        r#"boundary.y_min.convection={"coefficient": 250, "ambient_temperature": {"external": 300}}"#,
        "boundary.y_max.heat_flux=1e4",
    ]);
    let ambient = s.patch_index("y_min").expect("there");
    s.set_input(ambient, Quantity::AmbientTemperature, &[310.0])
        .expect("declared");
    close(
        "at once",
        heat_flow(&s, "y_min").heat_flow,
        250.0 * 10.0,
        1e-12,
    );
    s.advance(20.0).expect("it runs");
    let (hot, cold) = (heat_flow(&s, "y_max"), heat_flow(&s, "y_min"));
    close("flow out", cold.heat_flow, -1e4, 1e-3);
    close("wall", cold.mean_temperature, 310.0 + 1e4 / 250.0, 1e-4);
    close("far side", hot.mean_temperature, 450.0, 2e-3);

    let hash = s.state_hash();
    for (quantity, value, text) in [
        (Quantity::AmbientTemperature, 0.0, "above 0 K"),
        (Quantity::AmbientTemperature, f64::NAN, "only finite values"),
        (
            Quantity::ConvectionCoefficient,
            1.0,
            r#""convection": {"coefficient": {"external": 0}, ...}"#,
        ),
        (
            Quantity::Temperature,
            300.0,
            r#""temperature": {"external": 293.15}"#,
        ),
        (Quantity::HeatFlux, 1.0, r#""heat_flux": {"external": 0}"#),
    ] {
        let e = s
            .set_input(ambient, quantity, &[value])
            .expect_err("refused");
        println!("{e}");
        assert!(e.to_string().contains(text), "{e}");
        assert_eq!(e.place().field.as_deref(), Some(quantity.name()));
        assert_eq!(e.place().boundary.as_deref(), Some("y_min"));
    }
    assert_eq!(s.state_hash(), hash);
}

/// Values from outside, for the patch and for each of its particles.
#[test]
fn outside_heat_per_particle() {
    let external = r#"boundary.y_max.heat_flux={"external": 0, "per_particle": true}"#;
    let held = r#"boundary.y_min.temperature={"external": 300}"#;
    let (mut one, mut many) = (warm(&[external, held]), warm(&[external, held]));
    let patch = |s: &Simulation, name| s.patch_index(name).expect("there");
    let (top, bottom) = (patch(&one, "y_max"), patch(&one, "y_min"));
    let count = |i: usize| one.patches()[i].particles.len();
    let (all, base) = (vec![2e4; count(top)], vec![320.0; count(bottom)]);
    one.set_input(top, Quantity::HeatFlux, &[2e4]).expect("one");
    many.set_input(top, Quantity::HeatFlux, &all).expect("many");
    one.set_input(bottom, Quantity::Temperature, &[320.0])
        .expect("one");
    many.set_input(bottom, Quantity::Temperature, &base)
        .expect("many");
    for s in [&mut one, &mut many] {
        s.advance(0.05).expect("it runs");
    }
    assert_ne!(one.state_hash(), many.state_hash(), "inputs of two lengths");
    assert_eq!(one.energies(), many.energies());
    close(
        "base",
        heat_flow(&one, "y_min").mean_temperature,
        320.0,
        1e-12,
    );
}

#[test]
fn heat_conditions_that_make_no_sense_are_refused() {
    let cases: &[(&[&str], &str, &str)] = &[
        (
            &[
                "boundary.y_max.temperature=300",
                "boundary.y_max.heat_flux=1",
            ],
            "boundary.y_max.heat_flux",
            "either a prescribed `temperature` or a `heat_flux`",
        ),
        (
            &["boundary.y_max.temperature=0"],
            "boundary.y_max.temperature",
            "above 0 K",
        ),
        (
            &[r#"boundary.y_max.temperature={"table": {"time": [0, 1], "value": [300, -1]}}"#],
            "boundary.y_max.temperature.table.value[1]",
            "above 0 K",
        ),
        (
            &[r#"boundary.y_max.convection={"coefficient": -1, "ambient_temperature": 300}"#],
            "boundary.y_max.convection.coefficient",
            "not negative",
        ),
        (
            &[
                r#"boundary.y_max.convection={"coefficient": 1, "ambient_temperature": "300-400*X"}"#,
            ],
            "boundary.y_max.convection.ambient_temperature",
            "above 0 K",
        ),
        (
            &[
                "boundary.y_max.temperature=300",
                "boundary.x_max.temperature=301",
            ],
            "boundary.y_max.temperature",
            "lies on the patches `x_max` and `y_max`",
        ),
        (
            &["heat=null", "boundary.y_max.heat_flux=1"],
            "boundary.y_max.heat_flux",
            "needs the section `heat`",
        ),
    ];
    let heat = r#"heat={"specific_heat": 0.1, "reference_temperature": 300}"#;
    for (overrides, path, text) in cases {
        refuses(BLOCK, &[&[heat], *overrides].concat(), path, text);
    }
    // The same temperature on both sides of an edge is no contradiction.
    warm(&[
        "boundary.y_max.temperature=310",
        "boundary.x_max.temperature=310",
    ]);
    // An expression may fail later: the error names boundary, quantity, particle and time.
    let mut s = warm(&[r#"boundary.y_max.temperature="300-4000*t""#]);
    let e = s.advance(0.2).expect_err("it gets too cold");
    println!("{e}");
    let p = e.place();
    assert!(e.to_string().contains("above 0 K") && p.particle.is_some() && p.time.is_some());
    assert_eq!(p.boundary.as_deref(), Some("y_max"));
    assert_eq!(p.field.as_deref(), Some("temperature"));
}
