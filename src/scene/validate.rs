//! What a well-formed scene must satisfy beyond its shape.

use super::{Output, Scene, VectorFunction, condition, geometry, heat, material, numerics};
use crate::error::{Error, Result};
use crate::fields::{FIELDS, FieldInfo};

/// Relative tolerance of comparisons between lengths that decimal input only meets up to round-off.
pub(super) const ROUND_OFF: f64 = 1e-9;

impl Scene {
    /// Checks all values; [`from_json`](Self::from_json) does so, a scene made in code may call it.
    ///
    /// # Errors
    /// [`Code::InvalidScene`] with the JSON path, [`Code::OutOfMemory`] for more particles than this
    /// machine can hold.
    pub fn validate(&self) -> Result<()> {
        geometry::validate(&self.geometry)?;
        self.parameters()?;
        material::validate_together(&self.material)?;
        self.patches_and_conditions()?;
        if let Some(force) = &self.body_force {
            let function = condition::load("body_force", force)?;
            require(
                !matches!(function, VectorFunction::External { .. }),
                "body_force",
                "a body force cannot be external; use an expression or a table in time, or make the traction of a patch external",
            )?;
        }
        condition::initial(&self.initial)?;
        require(
            self.heat.is_some() || self.initial.temperature.is_none(),
            "initial.temperature",
            "the body has no temperature: add a section `heat`",
        )?;
        self.probes_inside()?;
        positive("time.end", self.time.end)?;
        output(&self.output)?;
        geometry::capacity(self, geometry::available_memory())
    }

    /// Checks the values of material, heat and numerics, without the rules between those of the material.
    pub(super) fn parameters(&self) -> Result<()> {
        material::validate(&self.material)?;
        if let Some(heat) = &self.heat {
            heat::validate(heat)?;
        }
        numerics::validate(&self.numerics)
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
            geometry::selection(&path, patch, &faces)?;
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
            condition::validate(&path, condition).map_err(|e| e.at_boundary(name))?;
            if self.heat.is_none()
                && let Some(key) = condition.heat()
            {
                return Err(Error::scene(
                    format!("{path}.{key}"),
                    "a condition for heat needs the section `heat`, which switches heat on",
                )
                .at_boundary(name));
            }
        }
        for (name, wall) in &self.contact {
            let path = key("contact", name);
            valid_name(&path, name)?;
            condition::wall(&path, wall)?;
            if let Some(patch) = &wall.patch
                && !faces.contains(patch)
                && !self.patches.contains_key(patch)
            {
                let known = self.patches.keys().chain(&faces);
                return Err(Error::scene(
                    format!("{path}.patch"),
                    format!("there is no patch `{patch}`; there are {}", listed(known)),
                ));
            }
        }
        Ok(())
    }

    fn probes_inside(&self) -> Result<()> {
        for (name, point) in &self.probes {
            let path = key("probes", name);
            valid_name(&path, name)?;
            finite(&path, point)?;
            let boxes = self.geometry.boxes();
            if boxes.is_empty() {
                // Whether it lies in a curved body is known when its cells are.
                continue;
            }
            let inside = boxes.iter().any(|(_, b)| {
                (0..3).all(|a| {
                    let slack = ROUND_OFF * (b.max[a] - b.min[a]);
                    (b.min[a] - slack..=b.max[a] + slack).contains(&point[a])
                })
            });
            require(
                inside,
                &path,
                "the probe lies outside the body: give a point inside it, in the initial configuration",
            )?;
        }
        Ok(())
    }
}

pub(super) fn require(holds: bool, path: &str, message: &str) -> Result<()> {
    if holds {
        Ok(())
    } else {
        Err(Error::scene(path, message))
    }
}

pub(super) fn positive(path: &str, value: f64) -> Result<()> {
    require(
        value.is_finite() && value > 0.0,
        path,
        &format!("expected a finite number above 0 instead of {value}"),
    )
}

pub(super) fn finite(path: &str, values: &[f64]) -> Result<()> {
    match values.iter().position(|v| !v.is_finite()) {
        None => Ok(()),
        Some(i) => Err(Error::scene(
            format!("{path}[{i}]"),
            format!("expected a finite number instead of {}", values[i]),
        )),
    }
}

/// Names become names of FMU variables, such as `probe.top_centre.displacement[1]`.
pub(super) fn valid_name(path: &str, name: &str) -> Result<()> {
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
pub(super) fn key(parent: &str, name: &str) -> String {
    if name.is_empty() {
        format!("{parent}[\"\"]")
    } else {
        format!("{parent}.{name}")
    }
}

pub(super) fn listed<T: AsRef<str>>(names: impl IntoIterator<Item = T>) -> String {
    let names: Vec<_> = names
        .into_iter()
        .map(|n| format!("`{}`", n.as_ref()))
        .collect();
    names.join(", ")
}

fn output(output: &Output) -> Result<()> {
    for (path, interval) in [
        ("output.history_interval", output.history_interval),
        ("output.field_interval", output.field_interval),
        ("output.restart_interval", output.restart_interval),
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
            &format!("the field `{name}` is listed twice: remove one"),
        )?;
    }
    Ok(())
}
