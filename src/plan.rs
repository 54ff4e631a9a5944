//! What a scene will cost and which physics it switches on, for `urlsph check`.

use crate::particles::MeshSummary;
use crate::reference::Repair;
use crate::scene::{
    Geometry, Limiter, Material, Neighbours, Operators, Precision, Reconstruction, ReferenceUpdate,
    Scene, StateMeasures, Weights,
};

/// What a scene will cost.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// Particles.
    pub particles: usize,
    /// Directed neighbour pairs.
    pub pairs: usize,
    /// Smallest, mean and largest number of neighbours.
    pub neighbours: (usize, f64, usize),
    /// The cells, where the particles are the nodes of a mesh.
    pub mesh: Option<MeshSummary>,
    /// Stable time step at the start [s].
    pub stable_step: f64,
    /// Estimated number of steps to the scene's end.
    pub steps: u64,
    /// Memory of the simulation [bytes].
    pub memory: usize,
    /// What the repair of the operators took and left, where they are repaired.
    pub repair: Option<Repair>,
    /// Physics and options that are on, one line each.
    pub on: Vec<String>,
    /// Physics and options that are off, one line each.
    pub off: Vec<String>,
}

/// Memory that a body holds per particle [bytes], before there is one: what [`Simulation::memory`]
/// says afterwards. `neighbours` is the length of a particle's list inside the body.
///
/// [`Simulation::memory`]: crate::Simulation::memory
pub(crate) fn bytes_per_particle(scene: &Scene, neighbours: f64) -> f64 {
    let n = &scene.numerics;
    let when = |is_on: bool, numbers: f64| if is_on { numbers } else { 0.0 };
    let updated = n.reference_update != ReferenceUpdate::Never;
    let lattice = scene.geometry.is_lattice();
    let operators = n.operators_on(lattice);
    let plastic = scene.material.is_plastic();
    // x, v, f, and what the scene adds to them; they are kept twice, for the start of a step too.
    let state = 15.0
        + when(n.state != StateMeasures::F, 1.0)
        + when(n.state == StateMeasures::Fhj, 9.0)
        + when(scene.heat.is_some(), 1.0)
        + when(plastic, 7.0);
    let single = n.precision == Precision::Single;
    let conducts = scene.heat.as_ref().is_some_and(|h| h.conductivity > 0.0);
    // Vectors of pairs whose weights are not symmetric, or are an updated reference's; with the repair these are
    // weights alone.
    let stored = match operators {
        Operators::Kernel => n.redoes_the_repair() || (n.weights == Weights::Tributary && !lattice),
        Operators::Repaired => false,
        Operators::Mesh => true,
    };
    let weights = n.redoes_the_repair() && operators == Operators::Repaired;
    // Whether nothing but sums over pairs in single precision reads L and the weights.
    let forgotten = single
        && !(updated || stored || conducts)
        && operators == Operators::Kernel
        && n.volume_dissipation == 0.0
        && n.limiter != Limiter::Venkatakrishnan;
    // The initial positions, volumes, L, and the order; multipliers and areas of the repair; the spacings; copies in
    // single precision of positions, L and multipliers.
    let reference = 14.0 - when(forgotten, 9.0)
        + when(single, 6.0)
        + when(single && operators == Operators::Repaired, 6.0)
        + when(updated, 13.0)
        + when(updated && n.state == StateMeasures::Fhj, 9.0)
        + when(operators == Operators::Repaired, 15.0)
        + when(plastic && operators == Operators::Kernel, 6.0)
        + when(updated && operators == Operators::Repaired, 3.0);
    // Q, the wave speed's, forces across the ends of pieces, grad v; S and the half gradient; copies of x, v and forces.
    let swept = 23.0
        + when(n.dissipation, 9.0)
        + when(
            n.dissipation && n.reconstruction != Reconstruction::None,
            9.0,
        )
        + when(single, 9.0);
    let swept = if single { 0.5 * swept } else { swept };
    let rates = 3.0
        + swept
        + when(n.volume_dissipation > 0.0, 5.0)
        + when(n.angular_momentum_projection, 3.0)
        + when(scene.heat.is_some(), 3.0)
        + when(conducts, 6.0);
    // Weights and a part of an index. Slices of single precision are longer, so that they are filled less where the
    // number of neighbours varies.
    let filled = match &scene.geometry {
        Geometry::Mesh(mesh) if mesh.content().is_ok_and(|mesh| !mesh.all_hexahedra()) => 1.0 / 1.7,
        _ => 1.0,
    };
    let pair = when(!forgotten, 1.125 + when(stored, 6.0) + when(weights, 1.0))
        + when(single, (0.53 + when(stored, 3.0)) / filled);
    8.0 * (2.0 * state + reference + rates + neighbours * pair)
}

/// Physics and options that a scene has on and off.
pub(crate) fn features(scene: &Scene, operators: Operators) -> (Vec<String>, Vec<String>) {
    let n = &scene.numerics;
    let lattice = scene.geometry.is_lattice();
    let mut on = vec![match &scene.material {
        Material::NeoHookean(_) => "neo-Hookean elasticity".to_string(),
        Material::MooneyRivlin(_) => "Mooney-Rivlin elasticity".to_string(),
        Material::LinearElastic(_) => "linear elasticity".to_string(),
        Material::VonMises(_) => "Hencky elasticity, von Mises plasticity".to_string(),
        Material::JohnsonCook(_) => "Hencky elasticity, Johnson-Cook plasticity".to_string(),
    }];
    on.push(match n.neighbours {
        Neighbours::Lattice(count) if lattice => format!("{count} lattice neighbours"),
        Neighbours::Lattice(count) => format!(
            "neighbours that share {} of the mesh",
            match count {
                6 => "an edge",
                18 => "a face",
                _ => "a cell",
            }
        ),
        Neighbours::Radius { radius } if lattice => format!("neighbours within {radius} spacings"),
        Neighbours::Radius { radius } => {
            format!("neighbours within {radius} mean lengths of the edges")
        }
    });
    on.push(match (operators, n.weights) {
        (Operators::Kernel, Weights::Unit) => "operators of the kernel, unit weights".to_string(),
        (Operators::Kernel, Weights::Tributary) => {
            "operators of the kernel, tributary weights".to_string()
        }
        (Operators::Repaired, _) if n.redoes_the_repair() => {
            "operators of the kernel, repaired at every update".to_string()
        }
        (Operators::Repaired, _) => "operators of the kernel, repaired".to_string(),
        (Operators::Mesh, _) => "operators of the mesh".to_string(),
    });
    let mut off = Vec::new();
    let mut feature = |is_on: bool, name: String| {
        if is_on { on.push(name) } else { off.push(name) }
    };
    let dissipation = match (n.reconstruction, n.limiter) {
        (Reconstruction::None, _) => "Riemann dissipation D^p, first order",
        (_, Limiter::None) => "Riemann dissipation D^p, linear reconstruction",
        (_, Limiter::Shock) => "Riemann dissipation D^p, linear reconstruction, shock limiter",
        (_, Limiter::Minmod) => "Riemann dissipation D^p, linear reconstruction, minmod limiter",
        (_, Limiter::Venkatakrishnan) => {
            "Riemann dissipation D^p, linear reconstruction, Venkatakrishnan limiter"
        }
    };
    let dissipation = match n.dissipation_coefficient {
        1.0 => dissipation.to_string(),
        coefficient => format!("{dissipation} (coefficient {coefficient})"),
    };
    feature(n.dissipation, dissipation);
    feature(
        n.state != StateMeasures::F,
        match n.state {
            StateMeasures::Fhj => "independent h and j".to_string(),
            _ => "independent j".to_string(),
        },
    );
    let volume_dissipation = match n.volume_dissipation {
        0.0 => "volume dissipation D^j".to_string(),
        coefficient => format!("volume dissipation D^j (coefficient {coefficient})"),
    };
    feature(n.volume_dissipation > 0.0, volume_dissipation);
    let option = n.kernel_option;
    let update = match n.reference_update {
        ReferenceUpdate::Never => "reference update".to_string(),
        ReferenceUpdate::EveryStep => {
            format!("reference update every step, kernel option {option}")
        }
        ReferenceUpdate::Every(steps) => {
            format!("reference update every {steps} steps, kernel option {option}")
        }
        ReferenceUpdate::When { strain } => {
            format!("reference update at a strain of {strain}, kernel option {option}")
        }
    };
    feature(n.reference_update != ReferenceUpdate::Never, update);
    feature(
        n.angular_momentum_projection,
        "angular-momentum projection".to_string(),
    );
    feature(
        n.precision == Precision::Single,
        "sums over pairs in single precision".to_string(),
    );
    feature(
        !scene.contact.is_empty(),
        "contact with rigid planes".to_string(),
    );
    feature(scene.body_force.is_some(), "body force".to_string());
    let plastic = scene.material.is_plastic();
    if !plastic {
        feature(false, "plasticity".to_string());
    }
    let Some(heat) = &scene.heat else {
        feature(false, "heat".to_string());
        return (on, off);
    };
    feature(
        true,
        format!(
            "heat (specific heat {} J/(kg K), reference temperature {} K)",
            heat.specific_heat, heat.reference_temperature
        ),
    );
    feature(
        heat.conductivity > 0.0,
        match heat.conductivity {
            0.0 => "conduction".to_string(),
            conductivity => format!("conduction ({conductivity} W/(m K))"),
        },
    );
    feature(
        heat.gruneisen_coefficient > 0.0,
        match heat.gruneisen_coefficient {
            0.0 => "thermal expansion".to_string(),
            gamma => format!("thermal expansion (Mie-Grueneisen coefficient {gamma})"),
        },
    );
    if plastic {
        feature(
            heat.plastic_heat_fraction > 0.0,
            format!(
                "plastic heating ({} of the work)",
                heat.plastic_heat_fraction
            ),
        );
    }
    feature(heat.source.is_some(), "heat source".to_string());
    (on, off)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Simulation;

    /// What a scene is refused for is what it would have taken.
    #[test]
    fn memory_is_foreseen() {
        const LATTICE: &str = r#"{"box": {"min": [0, 0, 0], "max": [1, 2, 1], "spacing": 0.0625}}"#;
        const CYLINDER: &str = r#"{"cylinder": {"radius": 1, "length": 3, "axis": "z", "divisions": 5, "layers": 30}}"#;
        const RUBBER: &str =
            r#"{"neo_hookean": {"density": 1e3, "youngs_modulus": 1e7, "poisson_ratio": 0.3}}"#;
        const STEEL: &str = r#"{"von_mises": {"density": 8e3, "youngs_modulus": 2e11, "poisson_ratio": 0.3, "yield_stress": 4e8}}"#;
        const HEAT: &str =
            r#", "heat": {"specific_heat": 500, "reference_temperature": 300, "conductivity": 40}"#;
        let mesh = |name: &str| {
            let root = env!("CARGO_MANIFEST_DIR");
            format!(r#"{{"mesh": {{"file": "{root}/examples/meshes/{name}.msh"}}}}"#)
        };
        let (tetrahedra, hexahedra) = (mesh("cylinder_3"), mesh("cube_hexahedra"));
        let all =
            r#""state": "fhj", "volume_dissipation": 0.1, "angular_momentum_projection": true"#;
        for (geometry, material, more, numerics) in [
            (LATTICE, RUBBER, "", ""),
            (LATTICE, RUBBER, "", r#""neighbours": 6"#),
            (LATTICE, RUBBER, "", r#""neighbours": 26"#),
            (LATTICE, RUBBER, "", r#""neighbours": {"radius": 1.5}"#),
            (LATTICE, RUBBER, "", r#""neighbours": {"radius": 2.5}"#),
            (LATTICE, RUBBER, "", r#""dissipation": false"#),
            (LATTICE, RUBBER, "", all),
            (LATTICE, RUBBER, HEAT, ""),
            (LATTICE, STEEL, "", ""),
            (LATTICE, STEEL, HEAT, all),
            (LATTICE, RUBBER, "", r#""reference_update": "every_step""#),
            (
                LATTICE,
                RUBBER,
                "",
                r#""reference_update": "every_step", "kernel_option": 4"#,
            ),
            (CYLINDER, STEEL, "", ""),
            (
                CYLINDER,
                STEEL,
                HEAT,
                r#""reference_update": {"every": 5}, "kernel_option": 3"#,
            ),
            (
                CYLINDER,
                RUBBER,
                "",
                r#""operators": "kernel", "weights": "tributary""#,
            ),
            (LATTICE, RUBBER, "", r#""precision": "single""#),
            (
                LATTICE,
                RUBBER,
                "",
                r#""precision": "single", "reference_update": "every_step", "kernel_option": 4"#,
            ),
            (LATTICE, STEEL, HEAT, r#""precision": "single""#),
            (CYLINDER, RUBBER, "", r#""precision": "single""#),
            (&tetrahedra, RUBBER, "", r#""precision": "single""#),
            (
                &tetrahedra,
                RUBBER,
                "",
                r#""precision": "single", "operators": "mesh""#,
            ),
            (&tetrahedra, RUBBER, "", ""),
            (&tetrahedra, RUBBER, "", r#""operators": "mesh""#),
            (&hexahedra, STEEL, HEAT, ""),
            (&hexahedra, STEEL, "", r#""neighbours": 6"#),
        ] {
            let text = format!(
                r#"{{"geometry": {geometry}, "material": {material}{more}, "boundary": {{}},
                    "numerics": {{{numerics}}}, "time": {{"end": 1}}}}"#
            );
            let scene = Scene::from_json(&text, &[]).expect("a good scene");
            let bytes = scene.memory().expect("it has a size");
            let simulation = Simulation::with_threads(scene, 1).expect("it can be set up");
            let ratio = bytes / simulation.memory() as f64;
            println!(
                "{:>6} particles, {:>4.0} bytes per particle, foreseen {ratio:.3} of that (tolerance \
                 0.9 to 1.3): {}{more} {numerics}",
                simulation.particle_count(),
                simulation.memory() as f64 / simulation.particle_count() as f64,
                &geometry[..12]
            );
            assert!((0.9..1.3).contains(&ratio), "{text}");
        }
    }
}
