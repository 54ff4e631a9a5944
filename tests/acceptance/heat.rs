//! Heat and everything around it: entropy never falls, the ledger closes, momenta stay, and a scene
//! without heat has nothing of it.

use urlsph::{Code, Energies, Field, Scene, Simulation};

use crate::support::*;

/// What a run with heat showed, step by step.
pub struct Observed {
    start: Energies,
    end: Energies,
    /// Least entropy that conduction and plastic flow produced in a step [J/K].
    physical: f64,
    /// Least energy that the scheme dissipated in a step [J].
    numerical: f64,
    /// Largest |entropy - initial entropy - production| [J/K].
    unaccounted: f64,
    /// Largest error of the energy balance [J].
    closure: f64,
    /// Largest rise of the ballistic energy in a step [J].
    ballistic: f64,
}

/// Runs to `end` and looks after every step.
pub fn observe(simulation: &mut Simulation, end: f64) -> Observed {
    let start = simulation.energies();
    let mut before = start;
    let mut found = Observed {
        start,
        end: start,
        physical: f64::INFINITY,
        numerical: f64::INFINITY,
        unaccounted: 0.0,
        closure: 0.0,
        ballistic: f64::NEG_INFINITY,
    };
    run(simulation, end, |s| {
        let now = s.energies();
        let produced = now.entropy_production - before.entropy_production;
        let dissipated = now.numerical_dissipation - before.numerical_dissipation;
        let unaccounted = now.entropy - start.entropy - now.entropy_production;
        found.physical = found.physical.min(produced);
        found.numerical = found.numerical.min(dissipated);
        found.unaccounted = found.unaccounted.max(unaccounted.abs());
        found.closure = found.closure.max(now.closure_error.abs());
        found.ballistic = found.ballistic.max(now.ballistic - before.ballistic);
        (before, found.end) = (now, now);
    });
    found
}

impl Observed {
    /// Neither the body nor the scheme ever takes entropy back, and entropy comes from nowhere else.
    pub fn check_entropy(&self, what: &str) {
        check(
            &format!("{what}: entropy that a step destroys [J/K]"),
            -self.physical,
            0.0,
        );
        check(
            &format!("{what}: dissipation that a step takes back [J]"),
            -self.numerical,
            0.0,
        );
    }
}

/// Momenta, entropy and ballistic energy as in [URL23] figure 6.
fn l_block(overrides: &[&str]) {
    let mut simulation = simulation("l_block_thermal", overrides);
    let what = format!("l_block_thermal, {} particles", simulation.particle_count());
    let linear = |s: &Simulation| {
        let mass = 1100.0 * 153.0;
        norm(&s.momenta().linear) / (2.0 * mass * s.energies().kinetic).sqrt()
    };
    let loaded = observe(&mut simulation, 5.0);
    loaded.check_entropy(&format!("{what}, loaded"));
    let turning = simulation.momenta().angular;
    let mut drift: f64 = 0.0;
    let mut least_linear = linear(&simulation);
    let end = 20.0;
    let free = observe(&mut simulation, end);
    free.check_entropy(&format!("{what}, free"));
    least_linear = least_linear.max(linear(&simulation));
    let now = simulation.momenta().angular;
    for c in 0..3 {
        drift = drift.max((now[c] - turning[c]).abs() / norm(&turning));
    }
    check(&format!("{what}: linear momentum"), least_linear, 1e-12);
    check(
        &format!("{what}: drift of the angular momentum"),
        drift,
        1e-12,
    );
    // Nothing comes in after 5 s: the entropy rises by what conduction produces, and the ballistic
    // energy falls by that and by what the scheme dissipates.
    let risen = free.end.entropy - free.start.entropy;
    println!(
        "{what}: entropy {:.4} J/K at 0 s, +{:.4e} by 5 s, +{:.4e} by {end} s; ballistic energy {:.3} J at 5 s, {:+.3} J by {end} s",
        loaded.start.entropy,
        loaded.end.entropy - loaded.start.entropy,
        risen,
        free.start.ballistic,
        free.end.ballistic - free.start.ballistic
    );
    let production = free.end.entropy_production;
    let unaccounted = loaded
        .unaccounted
        .max(free.unaccounted - loaded.end.entropy_production);
    check(
        &format!("{what}: entropy that nothing accounts for, over the production"),
        unaccounted / production,
        1e-6,
    );
    check(
        &format!("{what}: rise of the ballistic energy in a step [J]"),
        free.ballistic,
        0.0,
    );
    // What the integrator dissipates at the default step; `the_ledger_closes_with_heat` has its order.
    check(
        &format!("{what}: error of the ledger over the kinetic energy"),
        free.closure / free.end.kinetic,
        5e-3,
    );
}

#[test]
fn spinning_l_block() {
    l_block(&[]);
}

/// 5,445 and 13,950 particles.
#[test]
#[ignore = "fine models: cargo xtask validate"]
fn spinning_l_block_refined() {
    for (spacing, along) in [
        ("0.3", "0.2916666666666667"),
        ("0.21428571428571427", "0.21212121212121213"),
    ] {
        l_block(&[
            &format!("geometry.boxes.base.spacing={spacing}"),
            &format!("geometry.boxes.leg.spacing=[{spacing}, {along}, {spacing}]"),
        ]);
    }
}

/// A hot copper bar that hits a wall: conduction, plastic heat and dissipation at once.
#[test]
fn a_metal_never_takes_entropy_back() {
    let text = r#"{
        "title": "Johnson-Cook bar",
        "geometry": {"box": {"min": [0, 0, 0], "max": [0.0032, 0.0032, 0.0128], "spacing": 8e-4}},
        "material": {"johnson_cook": {
            "density": 8960, "youngs_modulus": 1.24e11, "poisson_ratio": 0.34, "yield_stress": 9e7,
            "hardening_modulus": 2.92e8, "hardening_exponent": 0.31, "rate_coefficient": 0.025,
            "reference_strain_rate": 1, "softening_exponent": 1.09, "melting_temperature": 1356.2,
            "transition_temperature": 298.15
        }},
        "heat": {
            "specific_heat": 383, "reference_temperature": 298.15, "conductivity": 386,
            "gruneisen_coefficient": 2, "plastic_heat_fraction": 0.9
        },
        "boundary": {
            "x_min": {"support": "roller"}, "y_min": {"support": "roller"}, "z_min": {"support": "roller"}
        },
        "initial": {"velocity": [0, 0, -227], "temperature": "298.15 + 1e4*Z"},
        "time": {"end": 2e-5}
    }"#;
    let scene = Scene::from_json(text, &[]).unwrap_or_else(|e| panic!("{e}"));
    let mut simulation = Simulation::with_threads(scene, 1).unwrap_or_else(|e| panic!("{e}"));
    let found = observe(&mut simulation, 2e-5);
    found.check_entropy("metal bar");
    let initial = found.start.kinetic;
    println!(
        "metal bar: plastic work {:.3} E0, entropy +{:.3e} J/K, produced {:.3e} J/K, closure {:.1e} E0",
        found.end.plastic_work / initial,
        found.end.entropy - found.start.entropy,
        found.end.entropy_production,
        found.closure / initial
    );
    assert!(found.end.plastic_work > 0.3 * initial);
    let share = found.unaccounted / found.end.entropy_production;
    check(
        "metal bar: entropy that nothing accounts for, over the production",
        share,
        1e-4,
    );
}

/// A block with everything that brings heat: a source, a flux, convection, a prescribed temperature that
/// changes, and conduction between hot and cold parts; it moves, so that heat and motion feed each other.
fn furnace(cfl: f64) -> Simulation {
    let text = r#"{
        "title": "furnace",
        "geometry": {"box": {"min": [0, 0, 0], "max": [1, 0.5, 0.5], "spacing": 0.125}},
        "material": {"neo_hookean": {"density": 1000, "youngs_modulus": 1.7e7, "poisson_ratio": 0.3}},
        "heat": {
            "specific_heat": 1, "reference_temperature": 293.15, "conductivity": 2000,
            "gruneisen_coefficient": 2, "gruneisen_exponent": 0.5, "source": "1e6*X*(1 + sin(100*t))"
        },
        "boundary": {
            "x_min": {"support": "clamped", "temperature": "293.15 + 20*sin(200*t)"},
            "x_max": {"heat_flux": "1e6*cos(50*t)"},
            "y_max": {"convection": {"coefficient": 2e4, "ambient_temperature": "280 + 100*t"}},
            "z_max": {"traction": [0, "1e4*sin(100*t)", 0]}
        },
        "initial": {
            "velocity": ["0.5*sin(pi*X/2)", 0, "0.2*X"],
            "temperature": "293.15 + 5*sin(pi*X)*cos(2*pi*Y)"
        },
        "time": {"end": 0.05}
    }"#;
    let cfl = format!("numerics.cfl={cfl}");
    let scene = Scene::from_json(text, &[cfl]).unwrap_or_else(|e| panic!("{e}"));
    Simulation::with_threads(scene, 1).unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn the_ledger_closes_with_heat() {
    let closure = [0.4, 0.2].map(|cfl| {
        let found = observe(&mut furnace(cfl), 0.05);
        let scale = found.end.heat_in.abs() + found.end.external_work.abs() + found.start.kinetic;
        println!(
            "furnace at CFL {cfl}: heat in {:.4e} J, thermal {:+.4e} J, work {:.3e} J, closure {:.2e} J",
            found.end.heat_in, found.end.thermal - found.start.thermal, found.end.external_work, found.closure
        );
        found.check_entropy(&format!("furnace at CFL {cfl}"));
        found.closure / scale
    });
    check("furnace: closure at CFL 0.4", closure[0], 1e-4);
    check("furnace: closure at CFL 0.2", closure[1], 1e-5);
    let order = order((2.0, closure[0]), (1.0, closure[1]));
    check_at_least("furnace: order of the closure in the step", order, 2.0);
}

/// Heat through two prescribed temperatures, at rest: what flows in is what is stored, and in the end as
/// much flows out as in, conductivity times area times the gradient.
#[test]
fn prescribed_temperatures_balance() {
    let mut simulation = simulation(
        "slab_heating",
        &[
            r#"boundary={"x_min": {"temperature": 393.15}, "x_max": {"temperature": 293.15}}"#,
            "geometry.box.spacing=0.05",
            "geometry.box.max=[1, 0.05, 0.05]",
        ],
    );
    let initial = simulation.energies();
    let patches = ["x_min", "x_max"].map(|name| simulation.patch_index(name).expect("a face"));
    let flows = |s: &Simulation| patches.map(|p| s.heat_resultant(p).expect("heat").heat_flow);
    // The patches' flows, integrated by the trapezoidal rule, against the ledger; not from the start,
    // where they are singular.
    simulation.advance(1e-3).expect("stable");
    let start = simulation.energies();
    let (mut supplied, mut before, mut last) = (0.0, simulation.time(), flows(&simulation));
    run(&mut simulation, 0.1, |s| {
        let now = flows(s);
        supplied += 0.5 * (s.time() - before) * (now[0] + now[1] + last[0] + last[1]);
        (before, last) = (s.time(), now);
    });
    let end = simulation.energies();
    // At the start the temperature jumps from particle to particle, which is the worst for a step.
    for (what, from, tolerance) in [("from the start", &initial, 2e-4), ("later", &start, 1e-6)] {
        let stored = end.thermal - from.thermal;
        let error = ((end.heat_in - from.heat_in) / stored - 1.0).abs();
        check(
            &format!("slab, two temperatures: heat in less heat stored, {what}"),
            error,
            tolerance,
        );
    }
    let taken = end.heat_in - start.heat_in;
    check(
        "slab, two temperatures: flows of the patches less heat in",
        (supplied / taken - 1.0).abs(),
        1e-3,
    );
    // q = k theta^2 grad(1/theta) is linear in the temperature only to second order in the spacing:
    // (100 K/(340 K 20 cells))^2/2 = 1.1e-4.
    let exact = 20_000.0 * 100.0 * 0.05 * 0.05;
    let [hot, cold] = flows(&simulation);
    let error = (hot / exact - 1.0).abs();
    check("slab, two temperatures: heat flow in", error, 2e-4);
    let error = (cold / hot + 1.0).abs();
    check("slab, two temperatures: heat flow in less out", error, 1e-6);
}

/// Memory per particle [numbers] of the cube with overrides.
fn numbers(overrides: &[&str]) -> f64 {
    let simulation = simulation("elastic_cube", overrides);
    simulation.memory() as f64 / simulation.particle_count() as f64 / 8.0
}

/// Heat adds entropy (present and at the step's start), temperature, conduction variable and heat, and
/// conduction a gradient and a flux, and what forces read of their neighbours is kept of the whole body for it; a metal
/// adds its history twice and the spacings that bound its step. Without them there is nothing of it.
#[test]
fn what_is_off_costs_nothing() {
    let fine = "geometry.box.spacing=0.05";
    let adiabatic = r#"heat={"specific_heat": 1, "reference_temperature": 293.15}"#;
    let conducting =
        r#"heat={"specific_heat": 1, "reference_temperature": 293.15, "conductivity": 10}"#;
    let metal = r#"material={"von_mises": {"density": 1100, "youngs_modulus": 1.7e7, "poisson_ratio": 0.3, "yield_stress": 1e5}}"#;
    let plain = numbers(&[fine]);
    // Position, velocity and F now and at the step's start, rates, volumes, X, L, 18 weights: what is beyond them is windows.
    let windows = plain - 75.0;
    for (what, overrides, added) in [
        ("adiabatic heat", adiabatic, 5.0),
        ("heat with conduction", conducting, 11.0 + 29.0 - windows),
        ("plasticity", metal, 20.0),
    ] {
        let found = numbers(&[fine, overrides]) - plain;
        println!(
            "{what}: {found:.2} numbers per particle more than {plain:.2}, {windows:.2} of them windows"
        );
        // Padding of the arrays.
        check(
            &format!("{what}: numbers per particle"),
            (found / added - 1.0).abs(),
            0.1,
        );
    }
    let simulation = simulation("elastic_cube", &[]);
    let mut values = vec![0.0; simulation.particle_count()];
    for of in [
        Field::Temperature,
        Field::Entropy,
        Field::EquivalentPlasticStrain,
    ] {
        let error = simulation.read_field(of, &mut values).unwrap_err();
        assert_eq!(error.code(), Code::InvalidArgument, "{of:?}: {error}");
    }
    assert_eq!(simulation.heat_resultant(0), None);
    let energies = simulation.energies();
    let none = [
        energies.thermal,
        energies.heat_in,
        energies.entropy,
        energies.entropy_production,
    ];
    assert_eq!(none, [0.0; 4]);
}

/// Heat that does not act on the stress leaves the motion alone.
#[test]
fn uncoupled_heat_leaves_the_motion_alone() {
    let heat = r#"heat={"specific_heat": 1e6, "reference_temperature": 293.15, "conductivity": 10, "source": 1e3}"#;
    let velocities = [&[][..], &[heat][..]].map(|overrides| {
        let mut simulation = simulation("elastic_cube", overrides);
        simulation.advance(2e-3).expect("stable");
        field(&simulation, Field::Velocity)
    });
    let [cold, hot] = velocities;
    let difference: Vec<f64> = std::iter::zip(&cold, &hot).map(|(a, b)| a - b).collect();
    check(
        "uncoupled heat: change of the velocity",
        norm(&difference) / norm(&cold),
        1e-12,
    );
}
