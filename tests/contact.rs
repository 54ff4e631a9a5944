//! Rigid frictionless planes: particles touch them, slide along them and leave.
#![allow(missing_docs)]

use urlsph::{Field, Scene, Simulation};

fn simulation(json: &str, overrides: &[String]) -> Simulation {
    let scene = Scene::from_json(json, overrides).expect("a good scene");
    Simulation::with_threads(scene, 1).expect("it can be set up")
}

fn field(simulation: &Simulation, field: Field) -> Vec<f64> {
    let mut values = vec![0.0; field.info().components * simulation.particle_count()];
    simulation
        .read_field(field, &mut values)
        .expect("the right length");
    values
}

/// A bar of length 1 in uniaxial strain that flies at a plane: c = 31.6 m/s, v = 0.3 m/s.
fn bar(cells: u32, more: &[&str]) -> Simulation {
    let h = 1.0 / f64::from(cells);
    let w = 2.0 * h;
    let json = format!(
        r#"{{
        "geometry": {{"box": {{"min": [0, 0, 0], "max": [{w}, {w}, 1], "spacing": {h}}}}},
        "material": {{"neo_hookean": {{"density": 1000, "youngs_modulus": 1e6, "poisson_ratio": 0.0}}}},
        "boundary": {{"x_min": {{"support": "roller"}}, "x_max": {{"support": "roller"}},
                      "y_min": {{"support": "roller"}}, "y_max": {{"support": "roller"}}}},
        "initial": {{"velocity": [0, 0, -0.3]}},
        "contact": {{"wall": {{"point": [0, 0, 0], "normal": [0, 0, 1]}}}},
        "time": {{"end": 1}}
    }}"#
    );
    let list: Vec<String> = more.iter().map(|o| (*o).to_string()).collect();
    simulation(&json, &list)
}

#[test]
fn explore() {
    for cells in [10, 20, 40, 80] {
        let mut s = bar(cells, &[]);
        let (e0, p0) = (s.energies(), s.momenta().linear[2]);
        let area = (2.0 / f64::from(cells)).powi(2);
        let c = 1000f64.sqrt();
        let mut least = f64::INFINITY;
        let mut last = e0;
        let (mut lowest, mut released, mut most): (f64, f64, f64) = (f64::INFINITY, 0.0, 0.0);
        let mut mean = 0.0;
        let mut changes = 0;
        let mut touching = s.contact(0).particles;
        while s.time() < 0.12 {
            let t = s.time() + s.stable_step();
            s.advance(t).unwrap();
            let e = s.energies();
            least = least.min(e.contact_dissipation - last.contact_dissipation);
            last = e;
            let x = field(&s, Field::Position);
            lowest = x.chunks(3).fold(lowest, |l, x| l.min(x[2]));
            let r = s.contact(0);
            if r.particles > 0 {
                released = s.time();
            }
            if r.particles != touching {
                changes += 1;
                touching = r.particles;
            }
            most = most.max(r.force[2]);
            if s.time() < 1.0 / c {
                mean = r.impulse[2] / s.time();
            }
        }
        let e = s.energies();
        let total = 0.5 * 1000.0 * area * 0.09;
        println!(
            "{cells}: steps {} released {released:.5} (2L/c {:.5}) changes {changes} COR {:.5} peak {:.4} mean {:.4} of rho c v, lowest {lowest:e}, contact diss {:.3e} numerical {:.3e} of E0, least {:e} closure {:e} impulse err {:e} initial kinetic {:.4} {:.4}",
            s.steps(),
            2.0 / c,
            -s.momenta().linear[2] / (1000.0 * area * 0.3),
            most / (area * 1000.0 * c * 0.3),
            mean / (area * 1000.0 * c * 0.3),
            e.contact_dissipation / total,
            e.numerical_dissipation / total,
            least / total,
            e.closure_error / total,
            (s.contact(0).impulse[2] - (s.momenta().linear[2] + 1000.0 * area * 0.3))
                / (1000.0 * area * 0.3),
            e0.kinetic / total,
            p0
        );
    }
}
