//! The uniaxial thermo-elastic standing wave: frequency and logarithmic decrement against the roots of
//! (rho s^2 + M k^2)(c_v s + h k^2) + theta_R (c_v Gamma_0)^2 k^2 s = 0.

use std::f64::consts::PI;

use urlsph::{Result, Simulation};

use super::{Case, Meter, Quantity, displacement, size};

/// A slab: thickness [m], density, Young's modulus [Pa], Poisson's ratio, C_v [J/(kg K)], theta_R [K],
/// Gamma_0, conductivity [W/(m K)].
#[derive(Clone, Copy)]
pub struct Set {
    pub name: &'static str,
    length: f64,
    density: f64,
    youngs_modulus: f64,
    poisson_ratio: f64,
    specific_heat: f64,
    theta_r: f64,
    gamma: f64,
    conductivity: f64,
}

pub const RUBBER: Set = Set {
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
pub const SET_B: Set = Set {
    name: "B",
    conductivity: 2e4,
    ..RUBBER
};
pub const SET_C: Set = Set {
    name: "C",
    conductivity: 6e4,
    ..RUBBER
};
pub const SET_D: Set = Set {
    name: "D",
    conductivity: 1e6,
    ..RUBBER
};
/// Copper of 1 mm: wave modulus 190.859 GPa.
pub const SET_E: Set = Set {
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
pub struct Roots {
    pub decay: f64,
    pub omega: f64,
    relaxation: f64,
}

impl Roots {
    /// 2 pi decay/omega.
    pub fn decrement(&self) -> f64 {
        2.0 * PI * self.decay / self.omega
    }
}

impl Set {
    /// The same slab without conduction: what decays there, the scheme takes.
    pub fn insulating(self) -> Self {
        Self {
            conductivity: 0.0,
            ..self
        }
    }

    pub fn roots(&self) -> Roots {
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

    /// Overrides of the scene that make it this slab.
    pub fn overrides(&self, cells: u32) -> Vec<String> {
        let (length, spacing) = (self.length, self.length / f64::from(cells));
        vec![
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
        ]
    }

    /// U_0 with k U_0 = 1e-4.
    pub fn amplitude(&self) -> f64 {
        1e-4 * self.length / PI
    }

    /// Frequency and decay of the antinode, sampled `samples` times a period. The relaxing mode leaves
    /// w_n = u_{n+1} - exp(-relaxation d) u_n, and w_{n+2} = 2 exp(-decay d) cos(omega d) w_{n+1} -
    /// exp(-2 decay d) w_n: two unknowns by least squares.
    pub fn measure(
        &self,
        simulation: &mut Simulation,
        meter: &mut Meter,
        periods: f64,
    ) -> Result<Roots> {
        const SAMPLES: f64 = 8.0;
        let exact = self.roots();
        let d = 2.0 * PI / exact.omega / SAMPLES;
        let mut u = vec![displacement(simulation, "antinode")[0]];
        for n in 1..=(periods * SAMPLES) as u32 {
            meter.advance(simulation, f64::from(n) * d)?;
            u.push(displacement(simulation, "antinode")[0]);
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
        Ok(Roots {
            decay: -shrink.ln() / d,
            omega: (0.5 * first / shrink).acos() / d,
            relaxation: exact.relaxation,
        })
    }
}

pub const CASE: Case = Case {
    name: "thermo-wave",
    title: "Thermo-elastic standing wave (set B)",
    example: "thermo_wave",
    sizes: &[
        size("11", 10),
        size("21", 20),
        size("41", 40),
        size("81", 80),
    ],
    swept: 4,
    leave_out: &["heat", "no heat"],
    reference: "exact roots of the linear problem",
    quantities: &[
        Quantity {
            name: "frequency",
            over: "fitted to the antinode over two periods, relative",
            unstable_above: 0.5,
        },
        Quantity {
            name: "logarithmic decrement",
            over: "fitted to the antinode over two periods, relative",
            unstable_above: 1.0,
        },
    ],
    overrides: |size| SET_B.overrides(size.cells),
    measure: |simulation, meter| {
        let (found, exact) = (SET_B.measure(simulation, meter, 2.0)?, SET_B.roots());
        let errors = [
            found.omega / exact.omega,
            found.decrement() / exact.decrement(),
        ];
        Ok(errors.map(|ratio| Some((ratio - 1.0).abs())).to_vec())
    },
    uncertainties: || vec![0.0; 2],
};
