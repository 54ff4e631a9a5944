//! The cable under a step load ([URL23] 7.2): shocks, and what each limiter costs where there are none.

use urlsph::{Field, Scene, Simulation};

use crate::cases::cable::{LENGTH, LOAD, Shock, lattice};
use crate::support::*;

/// Names in the tables and what they set.
const LIMITERS: [(&str, &[&str]); 5] = [
    (
        "first order",
        &["numerics.limiter=none", "numerics.reconstruction=none"],
    ),
    ("none", &["numerics.limiter=none"]),
    ("venkatakrishnan", &["numerics.limiter=venkatakrishnan"]),
    ("minmod", &["numerics.limiter=minmod"]),
    ("shock", &["numerics.limiter=shock"]),
];

/// A cable of `cells` cells along its length and 1 x 2 or, on a cubic lattice, 2 x 2 across.
fn cable(file: &str, cells: u32, cubic: bool, overrides: &[&str]) -> Simulation {
    let mut all = vec![lattice(cells)];
    if cubic {
        let spacing = LENGTH / f64::from(cells);
        let side = 2.0 * spacing;
        all[0] = format!("geometry.box.spacing={spacing}");
        all.push(format!("geometry.box.max=[{LENGTH}, {side}, {side}]"));
    }
    all.extend(overrides.iter().map(|o| (*o).to_owned()));
    let scene = Scene::from_file(example("cable", file), &all).unwrap_or_else(|e| panic!("{e}"));
    Simulation::with_threads(scene, 1).unwrap_or_else(|e| panic!("{file} {all:?}: {e}"))
}

fn shock(simulation: &mut Simulation, exact: &Table) -> Shock {
    Shock::measure(simulation, &mut Meter::default(), exact).expect("stable")
}

fn print(what: &str, s: &Shock) {
    println!(
        "| {what} | {:.1} % | {:.1} % | {:.1} % | {:.4} / {:.4} | {:.4} |",
        100.0 * s.overshoot,
        100.0 * s.stress_overshoot,
        100.0 * s.anywhere,
        s.l1[0],
        s.l1[1],
        s.stress_l1,
    );
}

const HEADER: &str = "| | overshoot of v | of the stress | of v anywhere | L1 of v to 20 s / 40 s | L1 of the stress |\n\
                      |---|---|---|---|---|---|";

/// The square wave of `expected.csv` is the sum of [URL23] (85): both give the displacement.
#[test]
fn the_exact_solutions_agree() {
    let exact = Table::expected("cable");
    let column = exact.column("probe.middle.displacement[1]");
    let series = |time: f64| -> f64 {
        let term = |n: u32| {
            let k = f64::from(2 * n - 1) * std::f64::consts::PI / (2.0 * LENGTH);
            let sign = if n % 2 == 1 { 1.0 } else { -1.0 };
            sign * (1.0 - (k * time).cos()) / (k * k) * (k * 0.5 * LENGTH).sin()
        };
        2.0 * LOAD / LENGTH * (1..20_000).map(term).sum::<f64>()
    };
    let distance = (0..=80)
        .map(|i| 0.5 * f64::from(i))
        .map(|time| (series(time) - exact.at(column, time)).abs())
        .fold(0.0, f64::max);
    check(
        "cable, series against square wave: displacement over the largest",
        distance / (LENGTH * LOAD),
        1e-4,
    );
}

/// The shock limiter keeps the overshoot of the cable well below minmod's at every size, on the cells
/// of the example and on cubic ones, without a larger error than none or, on cubic cells, minmod. A
/// front that has crossed hundreds of particles is wide enough to pass for resolved: the overshoot
/// grows with their number.
#[test]
fn shocks_are_captured() {
    let exact = Table::expected("cable");
    for (cubic, most, share) in [(false, 0.05, 0.35), (true, 0.10, 0.6)] {
        let lattice = if cubic { "cubic" } else { "1 x 0.5 m across" };
        println!("{HEADER}");
        let found = [100, 200, 400].map(|cells| {
            LIMITERS.map(|(name, overrides)| {
                let mut simulation = cable("scene.json", cells, cubic, overrides);
                let s = shock(&mut simulation, &exact);
                let particles = simulation.particle_count();
                print(&format!("{lattice}, {particles} particles, {name}"), &s);
                s
            })
        });
        for (cells, [first, none, _, minmod, shock]) in [100, 200, 400].iter().zip(&found) {
            let what = format!("cable {lattice}, {cells} cells, shock limiter:");
            check(&format!("{what} overshoot of v"), shock.overshoot, most);
            let ratio = shock.overshoot / minmod.overshoot;
            check(&format!("{what} overshoot over minmod's"), ratio, share);
            check(
                &format!("{what} overshoot of the stress"),
                shock.stress_overshoot,
                0.07,
            );
            let limit = if cubic { minmod } else { none };
            let errors = shock.l1[1] / limit.l1[1];
            check(&format!("{what} L1 of v over the others'"), errors, 1.02);
            assert!(shock.l1[1] < first.l1[1]);
        }
        let rate = order((4.0, found[0][4].l1[1]), (1.0, found[2][4].l1[1]));
        check_at_least(
            &format!("cable {lattice}, order of the L1 error"),
            rate,
            0.6,
        );
    }
}

/// At small steps the time integrator no longer helps to damp what a shock sheds: every overshoot
/// grows, the shock limiter's from 1 to 8 % and minmod's from 10 to 12 %.
#[test]
fn shocks_are_captured_at_small_steps() {
    let exact = Table::expected("cable");
    println!("{HEADER}");
    let [_, none, _, minmod, shock] = LIMITERS.map(|(name, overrides)| {
        let overrides = [overrides, &["numerics.cfl=0.3"]].concat();
        let s = shock(&mut cable("scene.json", 100, false, &overrides), &exact);
        print(&format!("CFL 0.3, {name}"), &s);
        s.overshoot
    });
    check("cable, CFL 0.3, overshoot of v: shock", shock, 0.1);
    check(
        "cable, CFL 0.3, overshoot of v: shock over minmod",
        shock / minmod,
        0.75,
    );
    check(
        "cable, CFL 0.3, overshoot of v: shock over none",
        shock / none,
        0.5,
    );
}

/// Where flow is smooth the shock limiter costs next to nothing; energies over the initial energy.
#[test]
fn smooth_flow_is_left_alone() {
    for (case, end, tolerance) in [
        ("column_bending", 0.6, 1.03),
        ("column_twisting", 0.1, 1.10),
    ] {
        for model in [M1, M2] {
            let [_, none, _, minmod, shock] = LIMITERS.map(|(name, overrides)| {
                let mut simulation = column(case, model, overrides);
                let e = simulation.energies();
                let initial = e.kinetic + e.strain;
                run(&mut simulation, end, |_| ());
                let dissipated = simulation.energies().numerical_dissipation / initial;
                println!("{case} {} {name}: dissipated {dissipated:.4} E0", model.0);
                dissipated
            });
            let what = format!(
                "{case} {}: dissipation over that without a limiter",
                model.0
            );
            println!("{what}: {:.2} with minmod", minmod / none);
            check(&format!("{what}, shock"), shock / none, tolerance);
        }
    }
}

/// The elastic wave of the load is doubled at the wall, which yields there: an elastic precursor at
/// the yield stress and a slower plastic wave, until the wave from the free end stops it.
#[test]
fn a_plastic_wave_follows_its_precursor() {
    let exact = Table::read(&example("cable", "expected_johnson_cook.csv"));
    let (yield_stress, hardening) = (1.5e-3, 0.05_f64);
    let plastic_speed = ((0.5 + hardening) / (1.5 + hardening)).sqrt();
    let at_the_wall = yield_stress + plastic_speed * (2.0 * LOAD - yield_stress);
    let plastic = (at_the_wall - yield_stress) / (0.5 + hardening);
    let stress = exact.column("stress");
    for (time, value) in [(12.0, LOAD), (17.0, yield_stress), (20.0, at_the_wall)] {
        let what = format!("elastic-plastic cable, expected.csv against the formula at {time} s");
        check(&what, (exact.at(stress, time) / value - 1.0).abs(), 1e-6);
    }
    println!("{HEADER}");
    let found = [100, 200, 400].map(|cells| {
        let [none, shock_limited] = [LIMITERS[1], LIMITERS[4]].map(|(name, overrides)| {
            let mut simulation = cable("johnson_cook.json", cells, false, overrides);
            let s = shock(&mut simulation, &exact);
            print(&format!("plastic, {cells} cells, {name}"), &s);
            (s, simulation)
        });
        let strain = field(&shock_limited.1, Field::EquivalentPlasticStrain);
        let places = field(&shock_limited.1, Field::InitialPosition);
        let (mut inside, mut beyond, mut count) = (0.0, 0.0_f64, 0.0);
        for (x, strain) in places.chunks_exact(3).zip(&strain) {
            if (1.0..6.5).contains(&x[0]) {
                inside += strain;
                count += 1.0;
            } else if x[0] > 8.5 {
                beyond = beyond.max(*strain);
            }
        }
        let what = format!("elastic-plastic cable, {cells} cells:");
        check(
            &format!("{what} mean plastic strain behind the plastic wave"),
            (inside / count / plastic - 1.0).abs(),
            0.03,
        );
        check(
            &format!("{what} plastic strain beyond it over that behind"),
            beyond / plastic,
            1e-2,
        );
        let ratio = shock_limited.0.l1[1] / none.0.l1[1];
        check(&format!("{what} L1 of v over that without"), ratio, 1.2);
        check(
            &format!("{what} overshoot of v"),
            shock_limited.0.overshoot,
            0.04,
        );
        shock_limited.0
    });
    for (what, error) in [
        ("v", [found[0].l1[1], found[2].l1[1]]),
        ("stress", [found[0].stress_l1, found[2].stress_l1]),
    ] {
        let rate = order((4.0, error[0]), (1.0, error[1]));
        check_at_least(
            &format!("elastic-plastic cable, order of the L1 error of {what}"),
            rate,
            0.6,
        );
    }
}
