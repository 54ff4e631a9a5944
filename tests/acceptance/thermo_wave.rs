//! The uniaxial thermo-elastic standing wave: frequency and logarithmic decrement against the roots of
//! (rho s^2 + M k^2)(c_v s + h k^2) + theta_R (c_v Gamma_0)^2 k^2 s = 0.

use crate::cases::thermo_wave::{RUBBER, Roots, SET_B, SET_C, SET_D, SET_E, Set};
use crate::support::*;

fn measure(set: &Set, cells: u32, periods: f64) -> Roots {
    let overrides = set.overrides(cells);
    let overrides: Vec<&str> = overrides.iter().map(String::as_str).collect();
    let mut simulation = simulation("thermo_wave", &overrides);
    set.measure(&mut simulation, &mut Meter::default(), periods)
        .expect("stable")
}

fn compare(set: &Set, cells: u32, periods: f64) -> String {
    let exact = set.roots();
    let found = measure(set, cells, periods);
    let adiabatic = measure(&set.insulating(), cells, 3.0);
    let what = format!("thermo_wave {} with {} particles,", set.name, cells + 1);
    let frequency = found.omega / exact.omega - 1.0;
    check(&format!("{what} frequency"), frequency.abs(), 2e-3);
    let (own, numerical) = (exact.decrement(), adiabatic.decrement());
    let error = found.decrement() / own - 1.0;
    println!(
        "{what} logarithmic decrement: {:.4e}, exact {own:.4e}; of the scheme alone (h = 0) {numerical:.2e}",
        found.decrement()
    );
    if own > 1e-2 {
        check(&format!("{what} logarithmic decrement"), error.abs(), 0.05);
    }
    check(&format!("{what} numerical decrement"), numerical, 5e-4);
    format!(
        "| {} | {cells} | {:+.3} % | {:.4e} | {own:.4e} | {numerical:.2e} |",
        set.name,
        100.0 * frequency,
        found.decrement()
    )
}

#[test]
fn frequency_and_decrement() {
    for set in [RUBBER, SET_B, SET_C, SET_E] {
        compare(&set, 40, 2.0);
    }
}

/// Conduction settles the step, 1/100 of the linear one: a coarser slab and less than a period.
#[test]
fn frequency_and_decrement_of_the_nearly_isothermal_wave() {
    compare(&SET_D, 32, 0.75);
}

/// Set B is the scene itself: displacement and temperature against the exact history.
#[test]
fn history_follows_the_exact_wave() {
    let expected = Table::expected("thermo_wave");
    let column = expected.column("probe.antinode.displacement[1]");
    let mut simulation = simulation("thermo_wave", &[]);
    let mut worst: f64 = 0.0;
    for (time, u) in expected.samples(column) {
        if time > 0.0 && time <= 0.02 {
            simulation.advance(time).expect("stable");
            worst = worst.max((displacement(&simulation, "antinode")[0] - u).abs());
        }
    }
    check(
        "thermo_wave B, history over U0",
        worst / SET_B.amplitude(),
        0.02,
    );
}

#[test]
#[ignore = "small steps: cargo xtask validate"]
fn frequency_and_decrement_in_full() {
    let rows = [RUBBER, SET_B, SET_C, SET_D, SET_E].map(|set| compare(&set, 40, 3.0));
    println!("\n### thermo_wave: frequency and logarithmic decrement, 41 particles, 3 periods\n");
    println!(
        "| set | cells | frequency too high by | decrement | exact | of the scheme alone (h = 0) |"
    );
    println!("|---|---|---|---|---|---|\n{}\n", rows.join("\n"));
}
