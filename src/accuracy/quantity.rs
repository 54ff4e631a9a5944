//! What is to be accurate: a variable of the history, or one of its components, over time.

use crate::error::{Error, Result};
use crate::output::variables::{OutputVariable, Reader, outputs};
use crate::output::{ROUNDING, history_interval};
use crate::scene::Scene;
use crate::simulation::Simulation;

/// A variable of the history, whole or one of its components.
#[derive(Debug, Clone, PartialEq)]
pub struct Quantity {
    variable: OutputVariable,
    /// From 0; all of them without.
    component: Option<usize>,
}

/// What vanishes as a scene is refined, or counts steps and particles: the error relative to it says
/// nothing.
const WITHOUT_LIMIT: [&str; 5] = [
    "energy.numerical_dissipation",
    "energy.projection",
    "energy.closure_error",
    "stable_step",
    "steps",
];

impl Quantity {
    /// The quantity of a name: that of a variable, such as `probe.tip.displacement`, or of a column of
    /// the history, such as `probe.tip.displacement[2]`; components count from 1.
    ///
    /// # Errors
    /// [`Code::InvalidArgument`](crate::Code::InvalidArgument) for a name that there is not, and for a
    /// quantity that depends on the resolution by itself.
    pub fn find(simulation: &Simulation, name: &str) -> Result<Self> {
        let all = outputs(simulation);
        let component = |v: &OutputVariable| v.element_names().position(|element| element == name);
        let found = all
            .iter()
            .find(|v| v.name == name)
            .map(|v| (v, None))
            .or_else(|| all.iter().find_map(|v| Some((v, Some(component(v)?)))));
        let Some((variable, component)) = found else {
            return Err(unknown(name, &all));
        };
        if variable.is_integer() || WITHOUT_LIMIT.contains(&variable.name.as_str()) {
            return Err(Error::argument(format!(
                "the accuracy of `{name}` means nothing: it belongs to the resolution and not to the body; \
                 choose a motion, a force, a temperature or an energy"
            )));
        }
        Ok(Self {
            variable: variable.clone(),
            component,
        })
    }

    /// As in the history: `probe.tip.displacement` or `probe.tip.displacement[2]`.
    pub fn name(&self) -> String {
        match self.component {
            None => self.variable.name.clone(),
            Some(k) => self.variable.element_names().nth(k).unwrap_or_default(),
        }
    }

    /// Its SI unit.
    pub fn unit(&self) -> &'static str {
        self.variable.unit
    }

    fn read(&self, simulation: &Simulation) -> Result<Vec<f64>> {
        let mut values = vec![0.0; self.variable.len()];
        Reader::new().read(simulation, &self.variable, &mut values)?;
        Ok(match self.component {
            None => values,
            Some(k) => vec![values[k]],
        })
    }
}

fn unknown(name: &str, all: &[OutputVariable]) -> Error {
    let base = name.split('[').next().unwrap_or(name);
    let remedy = match all.iter().find(|v| v.name == base) {
        Some(v) if v.components == 1 => format!("`{base}` is one number and has no components"),
        Some(v) => format!(
            "the components of `{base}` count from 1 to {}",
            v.components
        ),
        None => {
            let names: Vec<&str> = all.iter().map(|v| v.name.as_str()).collect();
            format!("there are {}", names.join(", "))
        }
    };
    Error::argument(format!(
        "the scene has no variable `{name}`; {remedy} (a point of the body becomes a variable as an entry of \
         `probes`)"
    ))
}

/// A quantity over time: a row at each instant of the scene's history.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    components: usize,
    values: Vec<f64>,
    from_start: bool,
}

impl Series {
    /// A series of rows of `components` numbers. `from_start`: its size is measured from its first row
    /// and not from 0, as that of a temperature.
    ///
    /// # Errors
    /// [`Code::InvalidArgument`](crate::Code::InvalidArgument) unless the rows are whole.
    pub fn new(components: usize, values: Vec<f64>, from_start: bool) -> Result<Self> {
        if components == 0 || values.is_empty() || !values.len().is_multiple_of(components) {
            return Err(Error::argument(format!(
                "a series of {} numbers does not have rows of {components}",
                values.len()
            )));
        }
        Ok(Self {
            components,
            values,
            from_start,
        })
    }

    /// Number of instants.
    pub fn rows(&self) -> usize {
        self.values.len() / self.components
    }

    /// The largest norm of a row; of a temperature, of its change since the start.
    pub fn size(&self) -> f64 {
        let first = &self.values[..self.components];
        let norms = self.values.chunks_exact(self.components).map(|row| {
            let from = |(value, first): (&f64, &f64)| match self.from_start {
                true => value - first,
                false => *value,
            };
            norm(row.iter().zip(first).map(from))
        });
        largest(norms)
    }

    /// Largest and root mean square norm of the differences between the rows of two series.
    pub fn distance(&self, other: &Self) -> (f64, f64) {
        let rows = self.values.chunks_exact(self.components);
        let norms: Vec<f64> = rows
            .zip(other.values.chunks_exact(other.components))
            .map(|(a, b)| norm(a.iter().zip(b).map(|(a, b)| a - b)))
            .collect();
        let square = norms.iter().map(|n| n * n).sum::<f64>() / norms.len() as f64;
        (largest(norms.into_iter()), square.sqrt())
    }
}

fn norm(values: impl Iterator<Item = f64>) -> f64 {
    values.map(|v| v * v).sum::<f64>().sqrt()
}

/// The largest value, or not a number if one of them is not.
fn largest(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(0.0, |m, v| if v > m || v.is_nan() { v } else { m })
}

/// Reads a quantity at the instants of the history while a simulation advances.
#[derive(Debug)]
pub struct Sampler {
    quantity: Quantity,
    interval: f64,
    end: f64,
    rows: usize,
    values: Vec<f64>,
}

impl Sampler {
    /// A sampler of a scene from time 0 on.
    pub fn new(scene: &Scene, quantity: Quantity) -> Self {
        Self {
            quantity,
            interval: history_interval(scene),
            end: scene.time.end,
            rows: 0,
            values: Vec::new(),
        }
    }

    /// What is read.
    pub fn quantity(&self) -> &Quantity {
        &self.quantity
    }

    /// The instant of the next row [s]; `None` after the last one, at the scene's end.
    pub fn next_time(&self) -> Option<f64> {
        let slack = ROUNDING * self.end;
        let before = self.rows as f64 * self.interval;
        // The row before this one was the last if it was at the end.
        if self.rows > 0 && before - self.interval > self.end - slack {
            return None;
        }
        Some(if before > self.end - slack {
            self.end
        } else {
            before
        })
    }

    /// Reads a row if its instant has come.
    ///
    /// # Errors
    /// As [`Reader::read`].
    pub fn sample(&mut self, simulation: &Simulation) -> Result<()> {
        let due = self.next_time();
        if due.is_some_and(|due| simulation.time() >= due - ROUNDING * self.interval) {
            self.values.extend(self.quantity.read(simulation)?);
            self.rows += 1;
        }
        Ok(())
    }

    /// The rows that were read.
    ///
    /// # Errors
    /// As [`Series::new`], if there are none.
    pub fn series(self) -> Result<Series> {
        let components = match self.quantity.component {
            None => self.quantity.variable.components,
            Some(_) => 1,
        };
        Series::new(components, self.values, self.quantity.unit() == "K")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn simulation(output: &str) -> Simulation {
        let text = format!(
            r#"{{
                "geometry": {{"box": {{"min": [0, 0, 0], "max": [1, 1, 1], "spacing": 0.5}}}},
                "material": {{"neo_hookean": {{"density": 1, "youngs_modulus": 1, "poisson_ratio": 0}}}},
                "initial": {{"velocity": ["X", 0, 0]}},
                "probes": {{"tip": [1, 1, 1]}},
                "time": {{"end": 1}}, "output": {{{output}}}
            }}"#
        );
        Simulation::with_threads(Scene::from_json(&text, &[]).unwrap(), 1).unwrap()
    }

    #[test]
    fn names_are_those_of_the_history() {
        let simulation = simulation("");
        for (name, components) in [
            ("probe.tip.displacement", 3),
            ("probe.tip.displacement[2]", 1),
            ("energy.kinetic", 1),
        ] {
            let quantity = Quantity::find(&simulation, name).unwrap();
            assert_eq!(quantity.name(), name);
            assert_eq!(quantity.read(&simulation).unwrap().len(), components);
        }
        for (name, said) in [
            ("probe.tip.displacement[0]", "count from 1 to 3"),
            ("energy.kinetic[1]", "is one number"),
            ("probe.top.displacement", "probe.tip.displacement"),
            ("steps", "belongs to the resolution"),
            ("energy.closure_error", "belongs to the resolution"),
        ] {
            let message = Quantity::find(&simulation, name).unwrap_err().to_string();
            assert!(message.contains(said), "{message}");
        }
    }

    #[test]
    fn rows_are_those_of_the_history() {
        for (output, rows) in [
            ("", 201),
            (r#""history_interval": 0.3"#, 5),
            (r#""history_interval": 0.25"#, 5),
            (r#""history_interval": 7"#, 2),
        ] {
            let mut simulation = simulation(output);
            let quantity = Quantity::find(&simulation, "probe.tip.velocity").unwrap();
            let mut sampler = Sampler::new(simulation.scene(), quantity);
            sampler.sample(&simulation).unwrap();
            while let Some(time) = sampler.next_time() {
                simulation.advance(time).unwrap();
                sampler.sample(&simulation).unwrap();
            }
            assert_eq!(simulation.time(), 1.0);
            assert_eq!(sampler.series().unwrap().rows(), rows, "{output}");
        }
    }

    #[test]
    fn distances_and_sizes_are_norms_over_time() {
        let series = |values: &[f64], start| Series::new(2, values.to_vec(), start).unwrap();
        let a = series(&[0.0, 1.0, 3.0, 5.0], false);
        let b = series(&[0.0, 1.0, 0.0, 1.0], false);
        assert_eq!(a.distance(&b), (5.0, 12.5_f64.sqrt()));
        assert_eq!(b.size(), 1.0);
        assert_eq!(series(&[300.0, 300.0, 303.0, 304.0], true).size(), 5.0);
        assert!(Series::new(2, vec![1.0; 3], false).is_err());
        assert!(Series::new(1, Vec::new(), false).is_err());
    }
}
