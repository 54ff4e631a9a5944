//! An instance of the FMU: the state machine around a simulation, the same for both standards.

use std::path::Path;

use super::FmiVersion;
use super::state::State;
use super::table::{Kind, Slot, Table};
use crate::error::{Code, Error, Result};
use crate::output::variables::Reader;
use crate::scene::Scene;
use crate::simulation::Simulation;

/// Where an instance stands in its life.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub(super) enum Phase {
    /// Created or reset: parameters and inputs may be set.
    Instantiated = 0,
    /// Between entering and leaving initialisation.
    Initialization = 1,
    /// Steps may be made.
    Stepping = 2,
    /// Terminated: values may be read.
    Terminated = 3,
}

impl Phase {
    const ALL: [Self; 4] = [
        Self::Instantiated,
        Self::Initialization,
        Self::Stepping,
        Self::Terminated,
    ];
    pub fn from_number(number: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|&p| p as u8 == number)
    }
    fn name(self) -> &'static str {
        match self {
            Self::Instantiated => "before initialisation",
            Self::Initialization => "in initialisation",
            Self::Stepping => "after initialisation",
            Self::Terminated => "after termination",
        }
    }
}

/// A simulation as an importer sees it.
#[derive(Debug)]
pub(super) struct Instance {
    table: Table,
    /// The scene as JSON; parameters are overrides of it.
    scene: String,
    simulation: Simulation,
    phase: Phase,
    /// Importer's time at the simulation's time 0 [s].
    start: f64,
    /// Importer's time beyond which no step may go [s].
    stop: Option<f64>,
    /// By parameter.
    parameters: Vec<f64>,
    /// The parameters that `simulation` was built with.
    built: Vec<f64>,
    /// By input, as long as the variable.
    inputs: Vec<Vec<f64>>,
    /// Whether the simulation has yet to learn of an input.
    changed: Vec<bool>,
    /// What was computed of the present state.
    reader: Reader,
}

impl Instance {
    /// A new instance of a scene; `token` must be that of the description. Files that the scene names
    /// are read here, from `folder`, and never again.
    ///
    /// # Errors
    /// Those of the scene and of setting it up, and a token of another scene or version.
    pub fn new(version: FmiVersion, scene: String, folder: &Path, token: &str) -> Result<Self> {
        let simulation = Simulation::new(Scene::from_json_in(&scene, &[], folder)?)?;
        let table = Table::new(&simulation, version)?;
        if table.token != token {
            return Err(Error::argument(format!(
                "the token is {token:?}, but this scene with urlsph {} has {}: \
                 the description, the scene and the library are not of one FMU; export it again",
                crate::VERSION,
                table.token
            )));
        }
        let parameters: Vec<f64> = table.parameters.iter().map(|p| p.start).collect();
        let inputs = start_inputs(&table);
        Ok(Self {
            scene,
            simulation,
            phase: Phase::Instantiated,
            start: 0.0,
            stop: None,
            built: parameters.clone(),
            parameters,
            changed: vec![true; inputs.len()],
            inputs,
            reader: Reader::new(),
            table,
        })
    }

    /// Importer's time [s].
    pub fn time(&self) -> f64 {
        self.start + self.simulation.time()
    }

    /// Sets the interval of the experiment [s].
    ///
    /// # Errors
    /// Wrong phase; times that are not finite or not in order.
    pub fn setup(&mut self, start: f64, stop: Option<f64>) -> Result<()> {
        self.require(&[Phase::Instantiated], "the experiment is set up")?;
        if !start.is_finite() {
            return Err(Error::argument(format!(
                "the start time is {start}: it must be finite"
            )));
        }
        // Some importers pass infinity for "no end".
        let stop = stop.filter(|s| *s != f64::INFINITY);
        if let Some(stop) = stop
            && !(stop.is_finite() && stop >= start)
        {
            return Err(Error::argument(format!(
                "the stop time is {stop}: it must be finite and not before the start time {start}"
            )));
        }
        self.start = start;
        self.stop = stop;
        Ok(())
    }

    /// Enters initialisation.
    ///
    /// # Errors
    /// Wrong phase.
    pub fn enter_initialization(&mut self) -> Result<()> {
        self.require(&[Phase::Instantiated], "initialisation is entered")?;
        self.phase = Phase::Initialization;
        Ok(())
    }

    /// Leaves initialisation; the parameters are settled.
    ///
    /// # Errors
    /// Wrong phase; those of setting up the scene with the parameters.
    pub fn exit_initialization(&mut self) -> Result<()> {
        self.require(&[Phase::Initialization], "initialisation is left")?;
        self.update()?;
        self.phase = Phase::Stepping;
        Ok(())
    }

    /// Ends the simulation; values stay readable.
    ///
    /// # Errors
    /// Wrong phase.
    pub fn terminate(&mut self) -> Result<()> {
        self.require(&[Phase::Stepping], "the simulation is terminated")?;
        self.phase = Phase::Terminated;
        Ok(())
    }

    /// Back to the state after instantiation.
    ///
    /// # Errors
    /// Those of setting up the scene; the instance is unchanged then.
    pub fn reset(&mut self) -> Result<()> {
        let parameters: Vec<f64> = self.table.parameters.iter().map(|p| p.start).collect();
        self.simulation = self.build(&parameters)?;
        self.built = parameters.clone();
        self.parameters = parameters;
        self.inputs = start_inputs(&self.table);
        self.changed.fill(true);
        self.phase = Phase::Instantiated;
        self.start = 0.0;
        self.stop = None;
        self.reader = Reader::new();
        Ok(())
    }

    /// Advances from the present communication point by one step, exactly to its end.
    ///
    /// # Errors
    /// Wrong phase, point or step: nothing is changed. Divergence: the state is the last good one.
    pub fn step(&mut self, point: f64, step: f64) -> Result<()> {
        self.require(&[Phase::Stepping], "a step is made")?;
        if !(step.is_finite() && step > 0.0) {
            return Err(Error::argument(format!(
                "the communication step is {step}: it must be finite and more than 0"
            )));
        }
        // Importers compute the point by sums or products: it may differ by round-off.
        let now = self.time();
        let slack = 1e-9 * step + 8.0 * f64::EPSILON * now.abs().max(point.abs());
        if !point.is_finite() || (point - now).abs() > slack {
            return Err(Error::argument(format!(
                "the communication point is {point} s, but the last step ended at {now} s: \
                 continue there, or set an earlier FMU state first"
            )));
        }
        let end = point + step;
        if let Some(stop) = self.stop
            && end > stop + slack
        {
            return Err(Error::argument(format!(
                "the step ends at {end} s, beyond the stop time {stop} s of the experiment: make it \
                 shorter, or set a later stop time"
            )));
        }
        self.update()?;
        self.reader = Reader::new();
        self.simulation.advance(end - self.start)
    }

    /// Number of values that the variables of these references have.
    ///
    /// # Errors
    /// An unknown reference.
    pub fn value_count(&self, kind: Kind, references: &[u32]) -> Result<usize> {
        references
            .iter()
            .map(|&r| self.resolve(kind, r).map(|(v, _)| self.width(v)))
            .sum()
    }

    /// Reads variables, one after the other.
    ///
    /// # Errors
    /// An unknown reference, a variable of another type, a wrong number of values; for an output those
    /// of setting up the scene with parameters that were just set.
    pub fn get(&mut self, kind: Kind, references: &[u32], out: &mut [f64]) -> Result<()> {
        self.check_length(kind, references, out.len())?;
        let mut rest = out;
        // An array of which FMI 2.0 asks the elements one by one.
        let mut array: (usize, Vec<f64>) = (usize::MAX, Vec::new());
        for &reference in references {
            let (index, element) = self.resolve(kind, reference)?;
            let values;
            (values, rest) = rest.split_at_mut(self.width(index));
            let whole = values.len() == self.table.variables[index].len();
            match self.table.variables[index].slot {
                Slot::Time => values[0] = self.time(),
                Slot::Parameter(p) => values[0] = self.parameters[p],
                Slot::Input(i) => {
                    values.copy_from_slice(&self.inputs[i][element..][..values.len()]);
                }
                Slot::Output(o) if whole => self.read(o, values)?,
                Slot::Output(o) => {
                    if array.0 != o {
                        let mut all = vec![0.0; self.table.outputs[o].len()];
                        self.read(o, &mut all)?;
                        array = (o, all);
                    }
                    values.copy_from_slice(&array.1[element..][..values.len()]);
                }
            }
        }
        Ok(())
    }

    /// Sets inputs and, before the end of initialisation, parameters.
    ///
    /// # Errors
    /// An unknown reference, a variable of another type or one that cannot be set now, a wrong
    /// number of values, a value that is not finite or not admissible. Nothing is changed then.
    pub fn set(&mut self, kind: Kind, references: &[u32], values: &[f64]) -> Result<()> {
        self.check_length(kind, references, values.len())?;
        let mut parameters = self.parameters.clone();
        let mut rest = values;
        for &reference in references {
            let (index, element) = self.resolve(kind, reference)?;
            let given;
            (given, rest) = rest.split_at(self.width(index));
            let variable = &self.table.variables[index];
            if let Some(k) = given.iter().position(|v| !v.is_finite()) {
                return Err(Error::argument(format!(
                    "{} is set to {}: values must be finite",
                    variable.element_name(element + k),
                    given[k]
                )));
            }
            match variable.slot {
                Slot::Parameter(p) => {
                    self.require(
                        &[Phase::Instantiated, Phase::Initialization],
                        &format!("the parameter {} is set", variable.name),
                    )?;
                    if variable.kind == Kind::Integer && given[0] < 0.0 {
                        return Err(Error::argument(format!(
                            "{} is set to {}: it must be 0 or more",
                            variable.name, given[0]
                        )));
                    }
                    parameters[p] = given[0];
                }
                Slot::Input(i) => {
                    self.require(
                        &[Phase::Instantiated, Phase::Initialization, Phase::Stepping],
                        &format!("the input {} is set", variable.name),
                    )?;
                    let quantity = self.simulation.inputs()[i].quantity;
                    for (k, value) in given.iter().enumerate() {
                        quantity.check(*value).map_err(|why| {
                            let name = variable.element_name(element + k);
                            Error::argument(format!("{name} is set to {value}: {why}"))
                        })?;
                    }
                }
                Slot::Time | Slot::Output(_) => {
                    return Err(Error::argument(format!(
                        "{} is computed and cannot be set: set parameters and inputs only",
                        variable.name
                    )));
                }
            }
        }
        if parameters != self.parameters {
            // Importers set one after the other: what they must be together counts at the end.
            Scene::admits(&self.scene, &self.overrides(&parameters))?;
            self.parameters = parameters;
        }
        let mut rest = values;
        for &reference in references {
            let (index, element) = self.resolve(kind, reference)?;
            let given;
            (given, rest) = rest.split_at(self.width(index));
            if let Slot::Input(i) = self.table.variables[index].slot {
                self.inputs[i][element..][..given.len()].copy_from_slice(given);
                self.changed[i] = true;
            }
        }
        Ok(())
    }

    /// A copy of everything that a later [`restore`](Self::restore) needs.
    ///
    /// # Errors
    /// Those of setting up the scene with parameters that were just set.
    pub fn state(&mut self) -> Result<State> {
        self.update()?;
        Ok(State {
            token: self.table.token.clone(),
            phase: self.phase,
            start: self.start,
            stop: self.stop,
            parameters: self.parameters.clone(),
            inputs: self.inputs.clone(),
            snapshot: self.simulation.snapshot(),
        })
    }

    /// Returns to a state, bit for bit.
    ///
    /// # Errors
    /// A state of another FMU; the instance is unchanged then.
    pub fn restore(&mut self, state: &State) -> Result<()> {
        self.check_state(state)?;
        if state.parameters == self.built {
            self.simulation.restore(&state.snapshot)?;
        } else {
            let mut simulation = self.build(&state.parameters)?;
            simulation.restore(&state.snapshot)?;
            self.simulation = simulation;
            self.built.clone_from(&state.parameters);
        }
        self.phase = state.phase;
        self.start = state.start;
        self.stop = state.stop;
        self.parameters.clone_from(&state.parameters);
        // The snapshot has them too.
        self.inputs.clone_from(&state.inputs);
        self.changed.fill(false);
        self.reader = Reader::new();
        Ok(())
    }

    /// Whether a state is one of this FMU.
    ///
    /// # Errors
    /// [`Code::Snapshot`] if it is not, or has a number that is not finite.
    pub fn check_state(&self, state: &State) -> Result<()> {
        let fits = state.token == self.table.token
            && state.parameters.len() == self.parameters.len()
            && state.inputs.len() == self.inputs.len()
            && state
                .inputs
                .iter()
                .zip(&self.inputs)
                .all(|(a, b)| a.len() == b.len());
        if !fits {
            return Err(Error::new(
                Code::Snapshot,
                "the FMU state belongs to another FMU: use one that this FMU has made",
            ));
        }
        let times = state.stop.iter().chain([&state.start]);
        let values = state.parameters.iter().chain(state.inputs.iter().flatten());
        // Bytes from outside can have a good checksum and bad numbers.
        if times.chain(values).all(|number| number.is_finite()) {
            Ok(())
        } else {
            Err(Error::new(
                Code::Snapshot,
                "the FMU state has a number that is not finite: use one that this FMU has made",
            ))
        }
    }

    fn require(&self, phases: &[Phase], what: &str) -> Result<()> {
        if phases.contains(&self.phase) {
            return Ok(());
        }
        let allowed: Vec<_> = phases.iter().map(|p| p.name()).collect();
        Err(Error::argument(format!(
            "{what} {}, which is allowed only {}",
            self.phase.name(),
            allowed.join(" or ")
        )))
    }

    /// The variable of a reference and the element in it.
    fn resolve(&self, kind: Kind, reference: u32) -> Result<(usize, usize)> {
        let found = self.table.find(reference).filter(|&(_, element)| {
            // In FMI 3.0 a reference stands for the whole array.
            element == 0 || self.table.version == FmiVersion::V2
        });
        let Some((index, element)) = found else {
            return Err(Error::argument(format!(
                "there is no variable with the value reference {reference}: modelDescription.xml lists them"
            )));
        };
        let variable = &self.table.variables[index];
        // FMI 2.0 has one type of integers.
        let v2 = self.table.version == FmiVersion::V2;
        if variable.kind != kind && !(v2 && variable.kind != Kind::Real && kind != Kind::Real) {
            return Err(Error::argument(format!(
                "{} (value reference {reference}) is of another type: modelDescription.xml tells which",
                variable.name
            )));
        }
        Ok((index, element))
    }

    /// Number of values under one reference.
    fn width(&self, index: usize) -> usize {
        match self.table.version {
            FmiVersion::V2 => 1,
            FmiVersion::V3 => self.table.variables[index].len(),
        }
    }

    fn check_length(&self, kind: Kind, references: &[u32], length: usize) -> Result<()> {
        let expected = self.value_count(kind, references)?;
        if expected == length {
            return Ok(());
        }
        let what = match references {
            [one] => self
                .table
                .find(*one)
                .map(|(v, _)| &self.table.variables[v].name),
            _ => None,
        };
        Err(Error::argument(match what {
            Some(name) => {
                format!("{name} has {expected} values, but {length} are given: pass all of them")
            }
            None => format!(
                "the {} variables have {expected} values together, but {length} are given: pass all of \
                 them",
                references.len()
            ),
        }))
    }

    /// Brings the simulation up to date with parameters and inputs.
    fn update(&mut self) -> Result<()> {
        if self.built != self.parameters {
            self.simulation = self.build(&self.parameters)?;
            self.built.clone_from(&self.parameters);
            self.changed.fill(true);
            self.reader = Reader::new();
        }
        for (i, changed) in self.changed.iter_mut().enumerate() {
            if *changed {
                let input = &self.simulation.inputs()[i];
                let (patch, quantity) = (input.patch, input.quantity);
                self.simulation
                    .set_input(patch, quantity, &self.inputs[i])?;
                self.reader = Reader::new();
                *changed = false;
            }
        }
        Ok(())
    }

    fn overrides(&self, parameters: &[f64]) -> Vec<String> {
        self.table
            .parameters
            .iter()
            .zip(parameters)
            // A value that was not changed is left as the scene has it, given or by default.
            .filter(|(parameter, value)| **value != parameter.start)
            .filter_map(|(parameter, value)| parameter.scene_override(*value))
            .collect()
    }

    fn build(&self, parameters: &[f64]) -> Result<Simulation> {
        let threads = self
            .table
            .parameters
            .iter()
            .zip(parameters)
            .find(|(p, _)| p.path.is_none());
        let threads = threads.map_or(0, |(_, &n)| n as usize);
        let overrides = self.overrides(parameters);
        let scene = self.simulation.scene().again(&self.scene, &overrides)?;
        Simulation::with_threads(scene, threads)
    }

    fn read(&mut self, output: usize, values: &mut [f64]) -> Result<()> {
        self.update()?;
        self.reader
            .read(&self.simulation, &self.table.outputs[output], values)
    }
}

fn start_inputs(table: &Table) -> Vec<Vec<f64>> {
    let of_inputs = table
        .variables
        .iter()
        .filter(|v| matches!(v.slot, Slot::Input(_)));
    of_inputs.filter_map(|v| v.start.clone()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_state_with_a_number_that_is_not_finite_is_refused() {
        const SCENE: &str = r#"{
            "geometry": {"box": {"min": [0, 0, 0], "max": [1, 1, 1], "spacing": 1}},
            "material": {"neo_hookean": {"density": 1000, "youngs_modulus": 1e7, "poisson_ratio": 0.3}},
            "boundary": {"y_max": {"traction": {"external": [0, 0, 0]}}},
            "time": {"end": 1}
        }"#;
        let simulation = Simulation::new(Scene::from_json(SCENE, &[]).unwrap()).unwrap();
        let token = Table::new(&simulation, FmiVersion::V3).unwrap().token;
        let folder = Path::new("");
        let mut instance = Instance::new(FmiVersion::V3, SCENE.to_owned(), folder, &token).unwrap();
        let good = instance.state().unwrap();
        let spoil: [fn(&mut State); 4] = [
            |state| state.start = f64::NAN,
            |state| state.stop = Some(f64::INFINITY),
            |state| state.parameters[0] = f64::NAN,
            |state| state.inputs[0][0] = f64::NEG_INFINITY,
        ];
        for spoil in spoil {
            let mut bad = good.clone();
            spoil(&mut bad);
            // As from an importer that has stored it.
            let bad = State::from_bytes(&bad.to_bytes()).unwrap();
            let error = instance.restore(&bad).unwrap_err();
            assert_eq!(error.code(), Code::Snapshot);
            assert_eq!(
                error.message(),
                "the FMU state has a number that is not finite: use one that this FMU has made"
            );
        }
        instance.restore(&good).unwrap();
    }
}
