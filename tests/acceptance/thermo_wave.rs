//! The uniaxial thermo-elastic standing wave: frequency and logarithmic decrement against the roots of
//! (rho s^2 + M k^2)(c_v s + h k^2) + theta_R (c_v Gamma_0)^2 k^2 s = 0.

use std::f64::consts::PI;

use urlsph::Simulation;

use crate::support::*;

/// A slab: thickness [m], density, Young's modulus [Pa], Poisson's ratio, C_v [J/(kg K)], theta_R [K],
/// Gamma_0, conductivity [W/(m K)].
#[derive(Clone, Copy)]
struct Set {
    name: &'static str,
    length: f64,
    density: f64,
    youngs_modulus: f64,
    poisson_ratio: f64,
    specific_heat: f64,
    theta_r: f64,
    gamma: f64,
    conductivity: f64,
}

const RUBBER: Set = Set {
    name: "A",
    length: 1.0,
    density: 1000.0,
    youngs_modulus: 17_000_091.999_975_53,
    poisson_ratio: 0.299_999_388_237_021_44,
    specific_heat: 1.0,
    theta_r: 293.15,
    gamma: 8.5889,
    conductivity: 10.0,
};
const SET_B: Set = Set {
    name: "B",
    conductivity: 2e4,
    ..RUBBER
};
const SET_C: Set = Set {
    name: "C",
    conductivity: 6e4,
    ..RUBBER
};
const SET_D: Set = Set {
    name: "D",
    conductivity: 1e6,
    ..RUBBER
};
/// Copper of 1 mm: wave modulus 190.859 GPa.
const SET_E: Set = Set {
    name: "E",
    length: 1e-3,
    density: 8960.0,
    youngs_modulus: 1.24e11,
    poisson_ratio: 0.34,
    specific_heat: 383.0,
    theta_r: 298.15,
    gamma: 5.6459,
    conductivity: 386.0,
};

/// A mode that decays and oscillates, exp(-decay t) cos(omega t), and one that only decays.
#[derive(Clone, Copy)]
struct Roots {
    decay: f64,
    omega: f64,
    relaxation: f64,
}

impl Roots {
    /// 2 pi decay/omega.
    fn decrement(&self) -> f64 {
        2.0 * PI * self.decay / self.omega
    }
}

impl Set {
    fn roots(&self) -> Roots {
        let nu = self.poisson_ratio;
        let modulus = self.youngs_modulus * (1.0 - nu) / ((1.0 + nu) * (1.0 - 2.0 * nu));
        let (k2, c_v) = (
            (PI / self.length).powi(2),
            self.density * self.specific_heat,
        );
        let coupling = self.theta_r * (c_v * self.gamma).powi(2) * k2;
        let conduction = self.conductivity * k2;
        let cubic =
            |s: f64| (self.density * s * s + modulus * k2) * (c_v * s + conduction) + coupling * s;
        // Its real root, at 0 without conduction.
        let (mut low, mut high) = (-conduction / c_v, 0.0);
        for _ in 0..100 {
            let middle = 0.5 * (low + high);
            *(if cubic(middle) < 0.0 {
                &mut low
            } else {
                &mut high
            }) = middle;
        }
        let s = 0.5 * (low + high);
        // What remains is s^2 + b s + c.
        let b = conduction / c_v + s;
        let adiabatic = (modulus * k2 + coupling / c_v) / self.density;
        let c = adiabatic + s * b;
        Roots {
            decay: 0.5 * b,
            omega: (c - 0.25 * b * b).sqrt(),
            relaxation: -s,
        }
    }

    fn simulation(&self, cells: u32) -> Simulation {
        let (length, spacing) = (self.length, self.length / f64::from(cells));
        let own = [
            format!(
                "geometry.box={{\"min\": [0, 0, 0], \"max\": [{length}, {spacing}, {spacing}], \"spacing\": {spacing}}}"
            ),
            format!(
                "material={{\"neo_hookean\": {{\"density\": {}, \"youngs_modulus\": {}, \"poisson_ratio\": {}}}}}",
                self.density, self.youngs_modulus, self.poisson_ratio
            ),
            format!(
                "heat={{\"specific_heat\": {}, \"reference_temperature\": {}, \"conductivity\": {}, \"gruneisen_coefficient\": {}}}",
                self.specific_heat, self.theta_r, self.conductivity, self.gamma
            ),
            format!(
                "initial.displacement=[\"{:e}*sin(pi*X/{length})\", 0, 0]",
                self.amplitude()
            ),
            format!("probes={{\"antinode\": [{}, 0, 0]}}", 0.5 * length),
        ];
        let all: Vec<&str> = own.iter().map(String::as_str).collect();
        simulation("thermo_wave", &all)
    }

    /// U_0 with k U_0 = 1e-4.
    fn amplitude(&self) -> f64 {
        1e-4 * self.length / PI
    }

    /// Frequency and decay of the antinode, sampled `samples` times a period. The relaxing mode leaves
    /// w_n = u_{n+1} - exp(-relaxation d) u_n, and w_{n+2} = 2 exp(-decay d) cos(omega d) w_{n+1} -
    /// exp(-2 decay d) w_n: two unknowns by least squares.
    fn measure(&self, cells: u32, periods: f64) -> Roots {
        const SAMPLES: f64 = 8.0;
        let exact = self.roots();
        let mut simulation = self.simulation(cells);
        let d = 2.0 * PI / exact.omega / SAMPLES;
        let mut u = vec![displacement(&simulation, "antinode")[0]];
        for n in 1..=(periods * SAMPLES) as u32 {
            simulation.advance(f64::from(n) * d).expect("stable");
            u.push(displacement(&simulation, "antinode")[0]);
        }
        let relaxed = (-exact.relaxation * d).exp();
        let w: Vec<f64> = u
            .windows(2)
            .map(|u| (u[1] - relaxed * u[0]) / self.amplitude())
            .collect();
        let mut normal = [[0.0; 2]; 2];
        let mut right = [0.0; 2];
        for w in w.windows(3) {
            for i in 0..2 {
                for j in 0..2 {
                    normal[i][j] += w[1 - i] * w[1 - j];
                }
                right[i] += w[1 - i] * w[2];
            }
        }
        let determinant = normal[0][0] * normal[1][1] - normal[0][1] * normal[1][0];
        let first = (right[0] * normal[1][1] - right[1] * normal[0][1]) / determinant;
        let second = (normal[0][0] * right[1] - normal[1][0] * right[0]) / determinant;
        let shrink = (-second).sqrt();
        Roots {
            decay: -shrink.ln() / d,
            omega: (0.5 * first / shrink).acos() / d,
            relaxation: exact.relaxation,
        }
    }

    fn compare(&self, cells: u32, periods: f64) -> String {
        let exact = self.roots();
        let found = self.measure(cells, periods);
        let adiabatic = Set {
            conductivity: 0.0,
            ..*self
        }
        .measure(cells, 3.0);
        let what = format!("thermo_wave {} with {} particles,", self.name, cells + 1);
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
            self.name,
            100.0 * frequency,
            found.decrement()
        )
    }
}

#[test]
fn frequency_and_decrement() {
    for set in [RUBBER, SET_B, SET_C, SET_E] {
        set.compare(40, 2.0);
    }
}

/// Conduction settles the step, 1/100 of the linear one: a coarser slab and less than a period.
#[test]
fn frequency_and_decrement_of_the_nearly_isothermal_wave() {
    SET_D.compare(32, 0.75);
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
    let rows = [RUBBER, SET_B, SET_C, SET_D, SET_E].map(|set| set.compare(40, 3.0));
    println!("\n### thermo_wave: frequency and logarithmic decrement, 41 particles, 3 periods\n");
    println!(
        "| set | cells | frequency too high by | decrement | exact | of the scheme alone (h = 0) |"
    );
    println!("|---|---|---|---|---|---|\n{}\n", rows.join("\n"));
}
