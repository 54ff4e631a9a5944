//! `urlsph check`: what a scene is and what running it would take.

use std::fmt::Write as _;

use urlsph::Simulation;

/// The plan in words.
pub fn report(simulation: &Simulation) -> String {
    let scene = simulation.scene();
    let plan = simulation.plan();
    let mut text = String::new();
    let mut line = |name: &str, value: String| {
        writeln!(text, "{name:<14} {value}").expect("a String takes any text");
    };
    if !scene.title.is_empty() {
        line("scene", scene.title.clone());
    }
    line("particles", grouped(plan.particles as u64));
    if let Some(mesh) = &plan.mesh {
        let cells: Vec<String> = mesh
            .cells
            .iter()
            .map(|(kind, count)| format!("{} {kind}", grouped(*count as u64)))
            .collect();
        let (smallest, largest) = mesh.cell_volume;
        line(
            "cells",
            format!(
                "{}; volume {smallest:.3e} to {largest:.3e} m^3, shortest edge {:.3e} m",
                cells.join(", "),
                mesh.shortest_edge
            ),
        );
        for note in &mesh.notes {
            line("mesh", note.clone());
        }
    }
    let (least, mean, most) = plan.neighbours;
    line(
        "neighbours",
        format!(
            "{least} to {most}, {mean:.1} on average ({} directed pairs)",
            grouped(plan.pairs as u64)
        ),
    );
    if let Some(repair) = &plan.repair {
        line(
            "repair",
            format!(
                "pseudo-areas changed by {:.1} %, open by {:.1e} of an area before and {:.1e} after, \
                 {} iterations in {:.2} s",
                100.0 * repair.size,
                repair.before,
                repair.after,
                repair.iterations,
                repair.time.as_secs_f64()
            ),
        );
    }
    line("memory", memory(plan.memory, plan.particles));
    line(
        "stable step",
        format!("{:.3e} s at the start", plan.stable_step),
    );
    line(
        "steps",
        format!(
            "about {} to the end at {} s",
            grouped(plan.steps),
            scene.time.end
        ),
    );
    for patch in simulation.patches() {
        if scene.boundary.contains_key(&patch.name) || scene.patches.contains_key(&patch.name) {
            line(
                "patch",
                format!(
                    "{}: {} particles, {:.6} m^2",
                    patch.name,
                    grouped(patch.particles.len() as u64),
                    patch.areas.iter().sum::<f64>()
                ),
            );
        }
    }
    for input in simulation.inputs() {
        line(
            "input",
            format!(
                "{} on {} [{}], {}",
                input.quantity.name(),
                simulation.patches()[input.patch].name,
                input.quantity.unit(),
                if input.per_particle {
                    "one value per particle"
                } else {
                    "one value for the patch"
                }
            ),
        );
    }
    for text in &plan.on {
        line("on", text.clone());
    }
    for text in &plan.off {
        line("off", text.clone());
    }
    text
}

fn memory(bytes: usize, particles: usize) -> String {
    let total = bytes as f64;
    let (value, unit) = if total >= 1e9 {
        (total / 1e9, "GB")
    } else {
        (total / 1e6, "MB")
    };
    format!(
        "{value:.1} {unit} ({:.2} kB per particle)",
        total / 1e3 / particles as f64
    )
}

/// A number with its thousands apart: 1 234 567.
pub fn grouped(number: u64) -> String {
    let digits = number.to_string();
    let mut text = String::with_capacity(digits.len() * 4 / 3);
    for (k, digit) in digits.chars().enumerate() {
        if k > 0 && (digits.len() - k).is_multiple_of(3) {
            text.push(' ');
        }
        text.push(digit);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thousands_stand_apart() {
        assert_eq!(grouped(0), "0");
        assert_eq!(grouped(999), "999");
        assert_eq!(grouped(1_000), "1 000");
        assert_eq!(grouped(1_234_567), "1 234 567");
    }
}
