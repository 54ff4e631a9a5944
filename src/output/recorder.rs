//! A run's folder: which file is due when, and where it goes.

use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use super::variables::{self, OutputVariable, Reader, selected_fields};
use super::{Collection, History, io_error, replace_file, write_vtu};
use crate::error::{Code, Error, Result};
use crate::fields::Field;
use crate::scene::Scene;
use crate::simulation::Simulation;

/// Rows of the history unless the scene says how many.
const DEFAULT_ROWS: f64 = 200.0;

/// Interval of the history's rows [s].
pub(crate) fn history_interval(scene: &Scene) -> f64 {
    let own = scene.output.history_interval;
    own.unwrap_or(scene.time.end / DEFAULT_ROWS)
}

/// Writes `history.csv`, `fields.pvd`, `fields/*.vtu`, `restart.snapshot` and `scene.json` into a folder.
///
/// ```no_run
/// # fn main() -> urlsph::Result<()> {
/// # let scene = urlsph::Scene::from_json("{}", &[])?;
/// let mut simulation = urlsph::Simulation::new(scene)?;
/// let mut recorder = urlsph::output::Recorder::create("out", &simulation)?;
/// recorder.record(&simulation)?;
/// while let Some(time) = recorder.next_time() {
///     simulation.advance(time)?;
///     recorder.record(&simulation)?;
/// }
/// # Ok(())
/// # }
/// ```
#[derive(Debug)]
pub struct Recorder {
    folder: PathBuf,
    end: f64,
    time: f64,
    variables: Vec<OutputVariable>,
    history: History,
    history_schedule: Schedule,
    fields: Vec<Field>,
    field_files: Option<FieldFiles>,
    restarts: Option<Schedule>,
    /// Whether the scene's end has been written.
    finished: bool,
}

/// What is in the folder already.
#[derive(Clone, Copy, PartialEq)]
enum Before {
    /// Another run, which is replaced.
    Another,
    /// The beginning of this one.
    Beginning,
}

#[derive(Debug)]
struct FieldFiles {
    schedule: Schedule,
    collection: Collection,
    written: usize,
}

impl Recorder {
    /// Sets up the folder with the scene as it is run. An earlier run in the same folder is replaced.
    ///
    /// # Errors
    /// [`Code::Io`](crate::Code::Io) naming the file or folder,
    /// [`Code::InvalidScene`](crate::Code::InvalidScene) for a field that there is not.
    pub fn create(folder: impl Into<PathBuf>, simulation: &Simulation) -> Result<Self> {
        Self::open(folder.into(), simulation, Before::Another)
    }

    /// Goes on in the folder of a run that ended early, from the state of its [`RESTART`] file, which `simulation` has
    /// been restored to: what the folder has of later times is removed, and the files become those of a
    /// run that was never interrupted.
    ///
    /// ```no_run
    /// # fn main() -> urlsph::Result<()> {
    /// # let scene = urlsph::Scene::from_json("{}", &[])?;
    /// use urlsph::{Simulation, Snapshot, output::{RESTART, Recorder}};
    /// let mut simulation = Simulation::new(scene)?;
    /// simulation.restore(&Snapshot::read(std::path::Path::new("out").join(RESTART))?)?;
    /// let mut recorder = Recorder::resume("out", &simulation)?;
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// As [`create`](Self::create); [`Code::Io`](crate::Code::Io) if a file of the run is missing,
    /// [`Code::InvalidArgument`](crate::Code::InvalidArgument) if its history has other columns.
    pub fn resume(folder: impl Into<PathBuf>, simulation: &Simulation) -> Result<Self> {
        Self::open(folder.into(), simulation, Before::Beginning)
    }

    fn open(folder: PathBuf, simulation: &Simulation, before: Before) -> Result<Self> {
        let scene = simulation.scene();
        let fields = selected_fields(simulation)?;
        let field_folder = folder.join("fields");
        fs::create_dir_all(&folder).map_err(|cause| io_error("create", &folder, &cause))?;

        let time = simulation.time();
        let variables = variables::outputs(simulation);
        let columns = variables.iter().flat_map(OutputVariable::element_names);
        let path = folder.join("history.csv");
        // The snapshot is the last file of its instant: the others have been written.
        let schedule = |interval: f64| {
            let mut schedule = Schedule::new(interval, time);
            if before == Before::Beginning {
                schedule.take(time);
            }
            schedule
        };
        let history = match before {
            Before::Another => {
                // Before anything is written: no snapshot may stand beside the files of another run.
                remove_earlier(&folder)?;
                History::create(path, columns)?
            }
            // Refuses the files of another run before anything is changed.
            Before::Beginning => History::resume(path, columns, time)?,
        };
        let resolved = serde_json::to_string_pretty(scene).map_err(|cause| {
            Error::new(
                Code::Internal,
                format!("the scene cannot be written as JSON: {cause}; please report this bug"),
            )
        })?;
        replace_file(&folder.join("scene.json"), |out| {
            writeln!(out, "{resolved}")
        })?;
        let field_files = match scene.output.field_interval {
            Some(interval) => {
                fs::create_dir_all(&field_folder)
                    .map_err(|cause| io_error("create", &field_folder, &cause))?;
                let pvd = folder.join("fields.pvd");
                let collection = match before {
                    Before::Another => Collection::create(pvd)?,
                    Before::Beginning => Collection::resume(pvd, time)?,
                };
                let written = collection.len();
                remove_states(&field_folder, written)?;
                Some(FieldFiles {
                    schedule: schedule(interval),
                    collection,
                    written,
                })
            }
            None => None,
        };
        Ok(Self {
            end: scene.time.end,
            time,
            history,
            history_schedule: schedule(history_interval(scene)),
            restarts: scene.output.restart_interval.map(schedule),
            finished: before == Before::Beginning && time >= scene.time.end,
            variables,
            fields,
            field_files,
            folder,
        })
    }

    /// The instant to advance to before the next [`record`](Self::record); `None` at the scene's end.
    pub fn next_time(&self) -> Option<f64> {
        if self.time >= self.end {
            return None;
        }
        let fields = self
            .field_files
            .as_ref()
            .map_or(f64::INFINITY, |files| files.schedule.next());
        let restarts = self.restarts.as_ref().map_or(f64::INFINITY, Schedule::next);
        let due = self.history_schedule.next().min(fields).min(restarts);
        // An instant that misses the end by rounding would cost a vanishing last step.
        Some(if due > self.end - ROUNDING * self.end {
            self.end
        } else {
            due
        })
    }

    /// Writes what is due now; everything at the scene's end.
    ///
    /// # Errors
    /// [`Code::Io`](crate::Code::Io) naming the file. The simulation is only read.
    pub fn record(&mut self, simulation: &Simulation) -> Result<()> {
        self.time = simulation.time();
        let end = self.time >= self.end && !self.finished;
        self.finished |= end;
        if self.history_schedule.take(self.time) || end {
            self.write_row(simulation)?;
        }
        if let Some(files) = &mut self.field_files
            && (files.schedule.take(self.time) || end)
        {
            let name = format!("fields/{STATE_FILE}{:06}.vtu", files.written);
            write_vtu(&self.folder.join(&name), simulation, &self.fields)?;
            files.collection.add(self.time, &name)?;
            files.written += 1;
        }
        // Last, because a run that goes on from it expects the other files of its time.
        if let Some(restarts) = &mut self.restarts
            && (restarts.take(self.time) || end)
        {
            simulation.snapshot().write(self.folder.join(RESTART))?;
        }
        Ok(())
    }

    /// Writes a row of the history and a field file `last_good_state.vtu`, for a run that ended before its time.
    ///
    /// # Errors
    /// [`Code::Io`](crate::Code::Io) naming the file.
    pub fn record_last_state(&mut self, simulation: &Simulation) -> Result<PathBuf> {
        // The state may be one that the history has already.
        if simulation.time() > self.time {
            self.time = simulation.time();
            self.write_row(simulation)?;
        }
        let path = self.folder.join(LAST_STATE);
        write_vtu(&path, simulation, &self.fields)?;
        Ok(path)
    }

    fn write_row(&mut self, simulation: &Simulation) -> Result<()> {
        let mut reader = Reader::new();
        let mut values = Vec::new();
        for variable in &self.variables {
            let start = values.len();
            values.resize(start + variable.len(), 0.0);
            reader.read(simulation, variable, &mut values[start..])?;
        }
        self.history.append(simulation.time(), &values)
    }

    /// The folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }
}

const STATE_FILE: &str = "state_";
const LAST_STATE: &str = "last_good_state.vtu";
/// Snapshot in a run's folder that the run can be continued from.
pub const RESTART: &str = "restart.snapshot";
/// What a run for an accuracy adds to the folder.
pub(crate) const ACCURACY: &str = "accuracy.json";

fn remove(path: &Path) -> Result<()> {
    match fs::remove_file(path) {
        Err(cause) if cause.kind() != std::io::ErrorKind::NotFound => {
            Err(io_error("remove", path, &cause))
        }
        _ => Ok(()),
    }
}

/// Removes the files of another run that the new run would not overwrite: it may write fewer.
fn remove_earlier(folder: &Path) -> Result<()> {
    for name in ["fields.pvd", RESTART, LAST_STATE, ACCURACY] {
        remove(&folder.join(name))?;
    }
    remove_states(&folder.join("fields"), 0)
}

/// Removes all field files but the first so many.
fn remove_states(folder: &Path, first: usize) -> Result<()> {
    let Ok(entries) = fs::read_dir(folder) else {
        return Ok(());
    };
    for entry in entries.flatten() {
        let name = entry.file_name();
        let number = name
            .to_str()
            .and_then(|name| name.strip_prefix(STATE_FILE)?.strip_suffix(".vtu"));
        // Only what this writer names so is its own to remove.
        let is_own = |n: &&str| n.len() >= 6 && n.bytes().all(|b| b.is_ascii_digit());
        if let Some(number) = number.filter(is_own)
            && number.parse().is_ok_and(|n: usize| n >= first)
        {
            remove(&entry.path())?;
        }
    }
    Ok(())
}

/// Share of an interval within which two instants are the same one: rounding, not physics.
pub(crate) const ROUNDING: f64 = 1e-9;

/// The multiples of an interval: `k * interval`, never a running sum, so that rounding does not add up.
#[derive(Debug)]
struct Schedule {
    interval: f64,
    index: f64,
}

impl Schedule {
    /// The first multiple that is not before `time`.
    fn new(interval: f64, time: f64) -> Self {
        Self {
            interval,
            index: (time / interval - ROUNDING).ceil().max(0.0),
        }
    }
    fn next(&self) -> f64 {
        self.index * self.interval
    }
    /// Whether an instant of the schedule has come; the schedule moves on behind it.
    fn take(&mut self, time: f64) -> bool {
        let passed = (time / self.interval + ROUNDING).floor();
        if passed < self.index {
            return false;
        }
        self.index = passed + 1.0;
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_schedule_meets_every_multiple_once() {
        let mut schedule = Schedule::new(0.1, 0.0);
        assert!(schedule.take(0.0));
        assert!(!schedule.take(0.0));
        assert_eq!(schedule.next(), 0.1);
        assert!(!schedule.take(0.05));
        for k in 1..1000 {
            let time = schedule.next();
            assert_eq!(time, k as f64 * 0.1);
            assert!(schedule.take(time));
        }
    }

    #[test]
    fn schedules_that_meet_up_to_rounding_take_the_same_instant() {
        // 3 * 0.1 and 0.3 differ in the last bit.
        let mut fine = Schedule::new(0.1, 0.25);
        let mut coarse = Schedule::new(0.3, 0.25);
        assert_ne!(fine.next(), coarse.next());
        let time = fine.next().min(coarse.next());
        assert!(fine.take(time) && coarse.take(time));
        assert_eq!(fine.next(), 0.4);
        assert_eq!(coarse.next(), 0.6);
    }

    #[test]
    fn only_own_files_of_an_earlier_run_are_removed() {
        let folder = tempfile::tempdir().unwrap();
        let fields = folder.path().join("fields");
        fs::create_dir(&fields).unwrap();
        for name in [
            "state_000001.vtu",
            "state_000007.vtu",
            "state_mine.vtu",
            "other.vtu",
        ] {
            fs::write(fields.join(name), "").unwrap();
        }
        fs::write(folder.path().join("notes.txt"), "").unwrap();
        remove_states(&fields, 2).unwrap();
        assert!(fields.join("state_000001.vtu").exists());
        assert!(!fields.join("state_000007.vtu").exists());
        remove_earlier(folder.path()).unwrap();
        assert!(!fields.join("state_000001.vtu").exists());
        assert!(fields.join("state_mine.vtu").exists());
        assert!(fields.join("other.vtu").exists());
        assert!(folder.path().join("notes.txt").exists());
    }
}
