//! What a scene will cost and which physics it switches on, for `urlsph check`.

use crate::particles::MeshSummary;
use crate::reference::Repair;
use crate::scene::{
    Limiter, Material, Neighbours, Operators, Reconstruction, ReferenceUpdate, Scene,
    StateMeasures, Weights,
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

/// Physics and options that a scene has on and off.
pub(crate) fn features(scene: &Scene, operators: Operators) -> (Vec<String>, Vec<String>) {
    let n = &scene.numerics;
    let mut on = vec![match &scene.material {
        Material::NeoHookean(_) => "neo-Hookean elasticity".to_string(),
        Material::MooneyRivlin(_) => "Mooney-Rivlin elasticity".to_string(),
        Material::LinearElastic(_) => "linear elasticity".to_string(),
        Material::VonMises(_) => "Hencky elasticity, von Mises plasticity".to_string(),
        Material::JohnsonCook(_) => "Hencky elasticity, Johnson-Cook plasticity".to_string(),
    }];
    on.push(match n.neighbours {
        Neighbours::Lattice(count) => format!("{count} lattice neighbours"),
        Neighbours::Radius { radius } => format!("neighbours within {radius} spacings"),
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
    };
    feature(n.reference_update != ReferenceUpdate::Never, update);
    feature(
        n.angular_momentum_projection,
        "angular-momentum projection".to_string(),
    );
    feature(
        !scene.contact.is_empty(),
        "contact with rigid planes".to_string(),
    );
    feature(scene.body_force.is_some(), "body force".to_string());
    let plastic = matches!(
        scene.material,
        Material::VonMises(_) | Material::JohnsonCook(_)
    );
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
