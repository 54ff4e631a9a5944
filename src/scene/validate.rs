//! What a well-formed scene must satisfy beyond its shape.

use super::value::below;
use super::{
    BoxGeometry, Condition, Geometry, Initial, Limiter, Material, Neighbours, Numerics, Output,
    PatchSelection, Reconstruction, ReferenceUpdate, Scalar, Scene, Spacing, StateMeasures, Vector,
    VectorFunction,
};
use crate::error::{Code, Error, Result};
use crate::fields::{FIELDS, FieldInfo};

/// Memory of a simulation per particle [bytes], with 18 neighbours.
const BYTES_PER_PARTICLE: f64 = 1300.0;
/// What a pair beyond the usual ones takes while the lists are built [bytes].
const BYTES_PER_PAIR: f64 = 24.0;
/// Particles are numbered in 32 bits, with room for flags.
const MAX_PARTICLES: f64 = (1u64 << 31) as f64;
/// Relative tolerance of comparisons between lengths that decimal input only meets up to round-off.
const ROUND_OFF: f64 = 1e-9;

impl Scene {
    /// Checks all values; [`from_json`](Self::from_json) does so, a scene made in code may call it.
    ///
    /// # Errors
    /// [`Code::InvalidScene`] with the JSON path, [`Code::OutOfMemory`] for more particles than this
    /// machine can hold.
    pub fn validate(&self) -> Result<()> {
        geometry(&self.geometry)?;
        material(&self.material)?;
        self.patches_and_conditions()?;
        if let Some(force) = &self.body_force {
            let function = load("body_force", force)?;
            require(
                !matches!(function, VectorFunction::External { .. }),
                "body_force",
                "a body force cannot be external; use an expression or a table in time, or make the traction of a patch external",
            )?;
        }
        initial(&self.initial)?;
        numerics(&self.numerics)?;
        self.probes_inside()?;
        positive("time.end", self.time.end)?;
        output(&self.output)?;
        capacity(&self.geometry, self.numerics.neighbours, available_memory())
    }

    fn patches_and_conditions(&self) -> Result<()> {
        let faces = self.geometry.faces();
        for (name, patch) in &self.patches {
            let path = key("patches", name);
            valid_name(&path, name)?;
            require(
                !faces.contains(name),
                &path,
                &format!("`{name}` is the name of a face already; choose another"),
            )?;
            selection(&path, patch, &faces)?;
        }
        for (name, condition) in &self.boundary {
            let path = key("boundary", name);
            if !faces.contains(name) && !self.patches.contains_key(name) {
                let known = self.patches.keys().chain(&faces);
                return Err(Error::scene(
                    path,
                    format!("there is no patch `{name}`; there are {}", listed(known)),
                ));
            }
            conditions(&path, condition).map_err(|e| e.at_boundary(name))?;
        }
        Ok(())
    }

    fn probes_inside(&self) -> Result<()> {
        for (name, point) in &self.probes {
            let path = key("probes", name);
            valid_name(&path, name)?;
            finite(&path, point)?;
            let inside = self.geometry.boxes().iter().any(|(_, b)| {
                (0..3).all(|a| {
                    let slack = ROUND_OFF * (b.max[a] - b.min[a]);
                    (b.min[a] - slack..=b.max[a] + slack).contains(&point[a])
                })
            });
            require(inside, &path, "the probe lies outside the body")?;
        }
        Ok(())
    }
}

fn require(holds: bool, path: &str, message: &str) -> Result<()> {
    if holds {
        Ok(())
    } else {
        Err(Error::scene(path, message))
    }
}

fn positive(path: &str, value: f64) -> Result<()> {
    require(
        value.is_finite() && value > 0.0,
        path,
        &format!("expected a finite number above 0 instead of {value}"),
    )
}

fn finite(path: &str, values: &[f64]) -> Result<()> {
    match values.iter().position(|v| !v.is_finite()) {
        None => Ok(()),
        Some(i) => Err(Error::scene(
            format!("{path}[{i}]"),
            format!("expected a finite number instead of {}", values[i]),
        )),
    }
}

/// Names become names of FMU variables, such as `probe.top_centre.displacement[1]`.
fn valid_name(path: &str, name: &str) -> Result<()> {
    let mut characters = name.chars();
    require(
        characters.next().is_some_and(|c| c.is_ascii_alphabetic())
            && characters.all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-'),
        path,
        &format!(
            "`{name}` is not a name: a name starts with a letter (a-z, A-Z) and goes on with letters, digits, `_` and `-`"
        ),
    )
}

/// A path as overrides understand it.
fn key(parent: &str, name: &str) -> String {
    if name.is_empty() {
        format!("{parent}[\"\"]")
    } else {
        format!("{parent}.{name}")
    }
}

fn listed<T: AsRef<str>>(names: impl IntoIterator<Item = T>) -> String {
    let names: Vec<_> = names
        .into_iter()
        .map(|n| format!("`{}`", n.as_ref()))
        .collect();
    names.join(", ")
}

fn geometry(geometry: &Geometry) -> Result<()> {
    if let Geometry::Boxes(boxes) = geometry {
        require(
            !boxes.is_empty(),
            "geometry.boxes",
            "a body needs at least one box",
        )?;
    }
    for (name, b) in geometry.boxes() {
        let path = box_path(name);
        if let Some(name) = name {
            valid_name(&path, name)?;
        }
        lattice_box(&path, b)?;
    }
    Ok(())
}

fn box_path(name: Option<&str>) -> String {
    name.map_or("geometry.box".to_owned(), |name| {
        key("geometry.boxes", name)
    })
}

fn lattice_box(path: &str, b: &BoxGeometry) -> Result<()> {
    finite(&format!("{path}.min"), &b.min)?;
    finite(&format!("{path}.max"), &b.max)?;
    for axis in 0..3 {
        let edge = b.max[axis] - b.min[axis];
        require(
            edge.is_finite() && edge > 0.0,
            &format!("{path}.max[{axis}]"),
            &format!(
                "expected more than min[{axis}] = {} instead of {}",
                b.min[axis], b.max[axis]
            ),
        )?;
        let (place, h) = match b.spacing {
            Spacing::Uniform(h) => (format!("{path}.spacing"), h),
            Spacing::PerAxis(h) => (format!("{path}.spacing[{axis}]"), h[axis]),
        };
        positive(&place, h)?;
        require(
            h <= edge * (1.0 + ROUND_OFF),
            &place,
            &format!(
                "the spacing {h} is larger than the edge {edge} along {}; each edge needs at least one cell",
                ["x", "y", "z"][axis]
            ),
        )?;
    }
    Ok(())
}

fn material(material: &Material) -> Result<()> {
    let (path, density, youngs_modulus, poisson_ratio) = match material {
        Material::NeoHookean(m) => (
            "material.neo_hookean",
            m.density,
            m.youngs_modulus,
            m.poisson_ratio,
        ),
        Material::MooneyRivlin(m) => (
            "material.mooney_rivlin",
            m.density,
            m.youngs_modulus,
            m.poisson_ratio,
        ),
    };
    positive(&format!("{path}.density"), density)?;
    positive(&format!("{path}.youngs_modulus"), youngs_modulus)?;
    require(
        -1.0 < poisson_ratio && poisson_ratio < 0.5,
        &format!("{path}.poisson_ratio"),
        &format!("expected more than -1 and less than 0.5 instead of {poisson_ratio}"),
    )?;
    if let Material::MooneyRivlin(m) = material {
        require(
            (0.0..=1.0).contains(&m.area_share),
            &format!("{path}.area_share"),
            &format!("expected a share from 0 to 1 instead of {}", m.area_share),
        )?;
    }
    Ok(())
}

fn selection(path: &str, patch: &PatchSelection, faces: &[String]) -> Result<()> {
    require(
        !patch.faces.is_empty(),
        &format!("{path}.faces"),
        "a patch needs at least one face",
    )?;
    for (i, face) in patch.faces.iter().enumerate() {
        let place = format!("{path}.faces[{i}]");
        require(
            faces.contains(face),
            &place,
            &format!(
                "there is no face `{face}`; there are {}",
                listed(faces.iter())
            ),
        )?;
        require(
            !patch.faces[..i].contains(face),
            &place,
            &format!("the face `{face}` is listed twice"),
        )?;
    }
    finite(&format!("{path}.min"), &patch.min.unwrap_or_default())?;
    finite(&format!("{path}.max"), &patch.max.unwrap_or_default())?;
    if let (Some(min), Some(max)) = (patch.min, patch.max) {
        for axis in 0..3 {
            require(
                min[axis] <= max[axis],
                &format!("{path}.max[{axis}]"),
                &format!(
                    "expected at least min[{axis}] = {} instead of {}",
                    min[axis], max[axis]
                ),
            )?;
        }
    }
    Ok(())
}

fn conditions(path: &str, condition: &Condition) -> Result<()> {
    require(
        condition.support.is_none() || condition.velocity.is_none(),
        path,
        "a patch has either a `support` or a prescribed `velocity`, not both",
    )?;
    if let Some(velocity) = &condition.velocity {
        compiled(&format!("{path}.velocity"), velocity)?;
    }
    if let Some(traction) = &condition.traction {
        load(&format!("{path}.traction"), traction)?;
    }
    if let Some(pressure) = &condition.pressure {
        let place = format!("{path}.pressure");
        pressure.compile().map_err(|e| below(&place, e))?;
    }
    Ok(())
}

fn compiled(path: &str, vector: &Vector) -> Result<VectorFunction> {
    vector.compile().map_err(|e| below(path, e))
}

/// A vector without free components.
fn load(path: &str, vector: &Vector) -> Result<VectorFunction> {
    let function = compiled(path, vector)?;
    match function.free().iter().position(|free| *free) {
        None => Ok(function),
        Some(c) => Err(Error::scene(
            format!("{path}[{c}]"),
            "`null` (a free component) is only for the prescribed velocity of a boundary; write 0",
        )),
    }
}

fn initial(initial: &Initial) -> Result<()> {
    for (name, field) in [
        ("velocity", &initial.velocity),
        ("displacement", &initial.displacement),
    ] {
        let Some(vector) = field else { continue };
        let path = format!("initial.{name}");
        let in_space =
            "an initial value has three components, each a number or an expression in X, Y and Z";
        let Vector::Components(components) = vector else {
            return Err(Error::scene(path, in_space));
        };
        let function = load(&path, vector)?;
        for (c, component) in components.iter().enumerate() {
            require(
                matches!(component, Some(Scalar::Constant(_) | Scalar::Expression(_))),
                &format!("{path}[{c}]"),
                in_space,
            )?;
        }
        if let VectorFunction::Components(functions) = &function {
            for (c, component) in functions.iter().flatten().enumerate() {
                require(
                    !component.depends_on_time(),
                    &format!("{path}[{c}]"),
                    "an initial value cannot depend on t",
                )?;
            }
        }
    }
    Ok(())
}

fn numerics(n: &Numerics) -> Result<()> {
    match n.neighbours {
        Neighbours::Lattice(count) => require(
            [6, 18, 26].contains(&count),
            "numerics.neighbours",
            &format!("expected 6, 18, 26 or {{\"radius\": r}} instead of {count}"),
        )?,
        Neighbours::Radius { radius } => require(
            radius.is_finite() && radius > 1.0,
            "numerics.neighbours.radius",
            &format!(
                "expected a finite radius above 1 (in multiples of the spacing) instead of {radius}"
            ),
        )?,
    }
    require(
        n.smoothing_factor > 0.5 && n.smoothing_factor <= 2.0,
        "numerics.smoothing_factor",
        &format!(
            "expected more than 0.5 (or the kernel does not reach its neighbours) and at most 2 instead of {}",
            n.smoothing_factor
        ),
    )?;
    require(
        (1..=4).contains(&n.kernel_option),
        "numerics.kernel_option",
        &format!("expected 1, 2, 3 or 4 instead of {}", n.kernel_option),
    )?;
    require(
        n.reference_update != ReferenceUpdate::Every(0),
        "numerics.reference_update.every",
        "expected at least 1 step between updates instead of 0; `never` is total Lagrangian",
    )?;
    require(
        n.volume_dissipation.is_finite() && n.volume_dissipation >= 0.0,
        "numerics.volume_dissipation",
        &format!(
            "expected a finite number, 0 or more, instead of {}",
            n.volume_dissipation
        ),
    )?;
    require(
        n.volume_dissipation == 0.0 || n.state != StateMeasures::F,
        "numerics.volume_dissipation",
        "it acts on the volume equation, which needs `state` to be `fj` or `fhj`",
    )?;
    if n.limiter != Limiter::None {
        require(
            n.reconstruction == Reconstruction::Linear,
            "numerics.limiter",
            "a limiter needs `reconstruction` to be `linear`",
        )?;
        require(
            n.dissipation,
            "numerics.limiter",
            "a limiter acts on the dissipation, which is switched off; set `limiter` to `none` or `dissipation` to true",
        )?;
    }
    if let Some(cfl) = n.cfl {
        require(
            cfl > 0.0 && cfl <= 2.0,
            "numerics.cfl",
            &format!("expected more than 0 and at most 2 instead of {cfl}"),
        )?;
    }
    if let Some(step) = n.time_step {
        positive("numerics.time_step", step)?;
        require(
            n.cfl.is_none(),
            "numerics.time_step",
            "a fixed step replaces the CFL condition; give `time_step` or `cfl`, not both",
        )?;
    }
    Ok(())
}

fn output(output: &Output) -> Result<()> {
    for (path, interval) in [
        ("output.history_interval", output.history_interval),
        ("output.field_interval", output.field_interval),
    ] {
        if let Some(interval) = interval {
            positive(path, interval)?;
        }
    }
    for (i, name) in output.fields.iter().flatten().enumerate() {
        let place = format!("output.fields[{i}]");
        require(
            FieldInfo::by_name(name).is_some(),
            &place,
            &format!(
                "there is no field `{name}`; there are {}",
                listed(FIELDS.iter().map(|f| f.name))
            ),
        )?;
        require(
            !output.fields.iter().flatten().take(i).any(|n| n == name),
            &place,
            &format!("the field `{name}` is listed twice"),
        )?;
    }
    Ok(())
}

/// Whether the particles fit into their numbers and into the memory [bytes], if that is known.
fn capacity(geometry: &Geometry, neighbours: Neighbours, memory: Option<f64>) -> Result<()> {
    // In f64, as a tiny spacing overflows any integer.
    let counts = geometry.boxes().into_iter().map(|(name, b)| {
        let h = b.spacing.per_axis();
        let count: f64 = (0..3)
            .map(|a| ((b.max[a] - b.min[a]) / h[a]).round().max(1.0) + 1.0)
            .product();
        let pairs = match neighbours {
            Neighbours::Lattice(_) => 0.0,
            Neighbours::Radius { radius } => {
                // Cells of a ball around a particle, as far as the box reaches.
                let reach = (radius + 1.0) * h.into_iter().fold(0.0, f64::max);
                let ball = 4.19 * reach.powi(3) / (h[0] * h[1] * h[2]);
                count * ball.min(count)
            }
        };
        (count, pairs, name)
    });
    let (mut total, mut bytes, mut most) = (0.0, 0.0, (0.0, None));
    for (count, pairs, name) in counts {
        total += count;
        bytes += count * BYTES_PER_PARTICLE + pairs * BYTES_PER_PAIR;
        if count > most.0 {
            most = (count, name);
        }
    }
    let amount = |x: f64, unit: f64, digits: usize| match x / unit {
        small if small < 1e12 => format!("{small:.digits$}"),
        large => format!("{large:.1e}"),
    };
    let error = |limit: String| {
        let place = box_path(most.1);
        Err(Error::new(
            Code::OutOfMemory,
            format!(
                "this spacing makes about {} particles, which with their neighbours need about {} GB; \
                 {limit}; choose a larger spacing or fewer neighbours",
                amount(total, 1.0, 0),
                amount(bytes, 1e9, 1)
            ),
        )
        .at_path(format!("{place}.spacing")))
    };
    if total > MAX_PARTICLES {
        return error(format!("at most {MAX_PARTICLES} particles are possible"));
    }
    match memory {
        Some(memory) if bytes > memory => {
            error(format!("{} GB are available", amount(memory, 1e9, 1)))
        }
        _ => Ok(()),
    }
}

/// Memory that a new allocation can count on [bytes], where the system tells.
fn available_memory() -> Option<f64> {
    let text = std::fs::read_to_string("/proc/meminfo").ok()?;
    let line = text.lines().find_map(|l| l.strip_prefix("MemAvailable:"))?;
    let kib: f64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kib * 1024.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_particles_than_memory_are_refused() {
        let geometry = Geometry::Box(BoxGeometry {
            min: [0.0; 3],
            max: [1.0; 3],
            spacing: Spacing::Uniform(0.1),
        });
        let need = 1331.0 * BYTES_PER_PARTICLE;
        capacity(&geometry, Neighbours::Lattice(18), None).unwrap();
        capacity(&geometry, Neighbours::Lattice(18), Some(need)).unwrap();
        let error = capacity(&geometry, Neighbours::Lattice(18), Some(need - 1.0)).unwrap_err();
        let wide = Neighbours::Radius { radius: 1e9 };
        capacity(&geometry, wide, Some(need)).unwrap_err();
        assert_eq!(error.code(), Code::OutOfMemory);
        assert_eq!(error.place().path.as_deref(), Some("geometry.box.spacing"));
        assert!(error.message().contains("1331 particles"), "{error}");
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn the_available_memory_is_known() {
        assert!(available_memory().unwrap() > 1e6);
    }
}
