//! Which run comes next, from the pilots to the final one.

use super::model::{Band, Fit, Verdict, percent};
use super::quantity::{Quantity, Sampler, Series};
use super::refine::{Ladder, Level};
use super::report::{Attempt, Cost, Prediction, Report};
use crate::error::{Code, Error, Result};
use crate::scene::Scene;
use crate::simulation::{Control, Progress, Simulation};

/// What is asked for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ask {
    /// Largest relative error: the upper end of the estimate is to be below it.
    pub tolerance: f64,
    /// Limit on the CPU time of all runs together [s].
    pub budget: f64,
}

/// What a run leaves for the search.
#[derive(Debug, Clone, PartialEq)]
pub struct Run {
    /// Particles.
    pub particles: usize,
    /// Time steps.
    pub steps: u64,
    /// CPU time of all threads, set-up and steps [s]; 0 until the caller fills it in, as the library
    /// reads no clock. Without it the budget is no limit.
    pub cpu_seconds: f64,
    /// Memory of the simulation [bytes].
    pub memory: usize,
    /// The quantity, by its name in the history.
    pub of: String,
    /// Its SI unit.
    pub unit: &'static str,
    /// The quantity at the instants of the history.
    pub series: Series,
}

/// A run to make.
#[derive(Debug, Clone, PartialEq)]
pub enum Task {
    /// One that only the quantity is wanted of.
    Pilot(Level),
    /// One that is expected to meet the tolerance: with its results.
    Final(Level, Prediction),
}

/// The way from a scene and a tolerance to a run that meets it.
///
/// ```no_run
/// # fn main() -> urlsph::Result<()> {
/// use urlsph::accuracy::{Ask, Run, Search, Task};
/// # let scene = urlsph::Scene::from_json("{}", &[])?;
/// let ask = Ask { tolerance: 0.02, budget: 600.0 };
/// let mut search = Search::new(&scene, ask)?;
/// while let Some(task) = search.next_task()? {
///     let run = urlsph::Simulation::new(task.level().scene.clone()).and_then(|mut simulation| {
///         Run::make(&mut simulation, "probe.tip.displacement", &mut |_| urlsph::Control::Continue)
///     });
///     match run {
///         Ok(run) => search.succeeded(&task, run),
///         Err(error) => search.failed(&task, error)?,
///     }
/// }
/// # Ok(())
/// # }
/// ```
#[derive(Debug)]
pub struct Search {
    ladder: Ladder,
    ask: Ask,
    tries: Vec<Try>,
    prediction: Option<Prediction>,
}

#[derive(Debug)]
struct Try {
    is_final: bool,
    level: Level,
    outcome: std::result::Result<Run, Error>,
}

/// Ratio of the sizes of two pilots that follow each other.
const STEP: f64 = std::f64::consts::SQRT_2;
/// A pilot is refined at least by this factor.
const LEAST_STEP: f64 = 1.12;
/// The final run is finer than the finest pilot by this factor at most; else another pilot comes before.
const LEAP: f64 = 2.2;
/// The upper end of the prediction is to be this share of the tolerance: predictions miss, too.
const AIM: f64 = 0.85;
/// Final runs, if the first misses the tolerance.
const FINALS: usize = 3;
/// Runs that fail, and runs in all, before the search gives up.
const FAILURES: usize = 3;
const RUNS: usize = 16;
/// Particles and steps grow with these powers of 1/size: at least, until two runs tell, and at most. The
/// steps of coarse runs are as many as the history has rows, which says nothing about finer ones.
const GROWTH: [[f64; 3]; 2] = [[0.0, 3.0, 3.3], [1.0, 1.0, 2.3]];

impl Task {
    /// What is run.
    pub fn level(&self) -> &Level {
        let (Self::Pilot(level) | Self::Final(level, _)) = self;
        level
    }
}

impl Run {
    /// Advances a simulation from time 0 to its scene's end, and reads the quantity of a name at the
    /// instants of the history.
    ///
    /// # Errors
    /// Those of [`Quantity::find`] and [`Simulation::advance_with`].
    pub fn make(
        simulation: &mut Simulation,
        of: &str,
        observer: &mut dyn FnMut(&Progress) -> Control,
    ) -> Result<Self> {
        let quantity = Quantity::find(simulation, of)?;
        let mut sampler = Sampler::new(simulation.scene(), quantity);
        sampler.sample(simulation)?;
        while let Some(time) = sampler.next_time() {
            simulation.advance_with(time, observer)?;
            sampler.sample(simulation)?;
        }
        Self::of(simulation, sampler)
    }

    /// What a finished simulation leaves.
    ///
    /// # Errors
    /// As [`Sampler::series`].
    pub fn of(simulation: &Simulation, sampler: Sampler) -> Result<Self> {
        Ok(Self {
            particles: simulation.particle_count(),
            steps: simulation.steps(),
            cpu_seconds: 0.0,
            memory: simulation.memory(),
            of: sampler.quantity().name(),
            unit: sampler.quantity().unit(),
            series: sampler.series()?,
        })
    }

    fn cost(&self) -> Cost {
        Cost {
            particles: self.particles as f64,
            steps: self.steps as f64,
            cpu_seconds: self.cpu_seconds,
            memory: self.memory as f64,
        }
    }
}

impl Search {
    /// A search that begins with the coarsest resolution of a scene.
    ///
    /// # Errors
    /// As [`Ladder::new`]; [`Code::InvalidArgument`] for a tolerance that is not between 0 and 1, or a
    /// budget that is not positive.
    pub fn new(scene: &Scene, ask: Ask) -> Result<Self> {
        if !(ask.tolerance > 0.0 && ask.tolerance < 1.0) {
            return Err(Error::argument(format!(
                "the tolerance is a relative error between 0 and 1 (100 %), not {}",
                ask.tolerance
            )));
        }
        if ask.budget.is_nan() || ask.budget <= 0.0 {
            return Err(Error::argument(format!(
                "the budget is a positive number of CPU seconds, not {}",
                ask.budget
            )));
        }
        Ok(Self {
            ladder: Ladder::new(scene)?,
            ask,
            tries: Vec::new(),
            prediction: None,
        })
    }

    /// The run to make next; `None` when the last one meets the tolerance.
    ///
    /// # Errors
    /// [`Code::InvalidArgument`] with the reason and the remedy if the tolerance is out of reach: the
    /// pilots do not converge, or what it takes is beyond the budget. [`Code::OutOfMemory`] if it is
    /// beyond the memory.
    pub fn next_task(&mut self) -> Result<Option<Task>> {
        let Some((finest, _)) = self.runs().last() else {
            return Ok(Some(Task::Pilot(match self.tries.last() {
                None => self.ladder.coarsest(),
                Some(failed) => self.finer(failed.level.size),
            })));
        };
        let Some(fit) = self.fit() else {
            let why = format!("{} pilots are needed", Fit::FEWEST);
            return self
                .pilot(self.finer(self.finest_tried(finest)), &why)
                .map(Some);
        };
        if let Verdict::Unsettled(why) = &fit.verdict {
            let why = format!("the pilots do not converge yet: {why}");
            return self
                .pilot(self.finer(self.finest_tried(finest)), &why)
                .map(Some);
        }
        if let Some((at, error)) = self.last_final(&fit) {
            if fit.knows(at) && error.high <= self.ask.tolerance {
                return Ok(None);
            }
            let finals = self.tries.iter().filter(|t| t.is_final).count();
            if finals >= FINALS && fit.knows(at) {
                return Err(Error::argument(format!(
                    "{FINALS} runs for a tolerance of {} have missed it: the error of the last one is between \
                     {} and {}; ask for {}",
                    percent(self.ask.tolerance),
                    percent(error.low),
                    percent(error.high),
                    percent(1.1 * error.high)
                )));
            }
        }
        self.towards(&fit, finest).map(Some)
    }

    /// The next run when the errors are told.
    fn towards(&mut self, fit: &Fit, finest: f64) -> Result<Task> {
        let tolerance = self.ask.tolerance;
        let sizes: Vec<f64> = self.runs().map(|(size, _)| size).collect();
        // The coarsest run that is good enough.
        let enough = (0..sizes.len()).find(|&k| fit.knows(k) && fit.errors[k].high <= tolerance);
        if let Some(at) = enough {
            let level = self.tries.iter().find(|t| t.level.size == sizes[at]);
            let level = level.expect("a run was made with it").level.clone();
            return Ok(self.task(level, fit.errors[at]));
        }
        if !fit.knows(sizes.len() - 1) {
            let error = fit.errors[sizes.len() - 1];
            let why = format!(
                "the error of the finest pilot is only known to be between {} and {}",
                percent(error.low),
                percent(error.high)
            );
            return self.pilot(self.finer(self.finest_tried(finest)), &why);
        }
        let size = fit.size_for(AIM * tolerance);
        let level = self.ladder.level(size, finest / LEAST_STEP);
        let cost = self.cost(level.size);
        if cost.cpu_seconds > self.left() {
            return Err(self.beyond_budget(fit, &cost));
        }
        level.scene.validate().map_err(|error| {
            error.with_note(&format!(
                "that is what a tolerance of {} takes: ask for less accuracy",
                percent(tolerance)
            ))
        })?;
        if level.size < finest / LEAP {
            // It costs a small part of the final run, and tells far better what that will be. Steps of 2,
            // because an order is the less certain the further it is carried.
            let size = (2.0 * level.size).max(0.5 * finest);
            let between = self.ladder.level(size, finest / LEAST_STEP);
            if between.size > level.size * LEAST_STEP {
                return Ok(Task::Pilot(between));
            }
        }
        let error = fit.predict(level.size);
        Ok(self.task(level, error))
    }

    fn task(&mut self, level: Level, error: Band) -> Task {
        let prediction = Prediction {
            size: level.size,
            cells: level.cells.clone(),
            error,
            cost: self.cost(level.size),
        };
        self.prediction = Some(prediction.clone());
        Task::Final(level, prediction)
    }

    /// A run has come to its end.
    pub fn succeeded(&mut self, task: &Task, run: Run) {
        self.add(task, Ok(run));
    }

    /// A run has failed. One that diverged may have been too coarse, so that the search goes on.
    ///
    /// # Errors
    /// The error itself if another run cannot help, or too many have failed.
    pub fn failed(&mut self, task: &Task, error: Error) -> Result<()> {
        let coarse = matches!(error.code(), Code::Diverged | Code::InvalidScene);
        let failures = self.tries.iter().filter(|t| t.outcome.is_err()).count();
        if !coarse || failures + 1 >= FAILURES || matches!(task, Task::Final(..)) {
            return Err(error.with_note(&format!("in the run with {}", task.level().cells)));
        }
        self.add(task, Err(error));
        Ok(())
    }

    fn add(&mut self, task: &Task, outcome: std::result::Result<Run, Error>) {
        self.tries.push(Try {
            is_final: matches!(task, Task::Final(..)),
            level: task.level().clone(),
            outcome,
        });
    }

    /// What has come of it so far, if a final run was made. Pilots that follow it sharpen its estimate.
    pub fn report(&self) -> Option<Report> {
        let fit = self.fit()?;
        let (at, estimate) = self.last_final(&fit)?;
        let (_, run) = self.runs().last()?;
        let sizes: Vec<f64> = self.runs().map(|(size, _)| size).collect();
        let error = |size: f64| {
            let at = sizes.iter().position(|s| *s == size);
            at.map(|at| fit.errors[at])
        };
        let runs = self.tries.iter().map(|t| Attempt {
            role: if t.is_final { "final" } else { "pilot" },
            size: t.level.size,
            cells: t.level.cells.clone(),
            cost: t.outcome.as_ref().ok().map(Run::cost),
            error: error(t.level.size),
            failure: t.outcome.as_ref().err().map(Error::to_string),
        });
        Some(Report {
            format: 1,
            urlsph: crate::VERSION,
            of: run.of.clone(),
            unit: run.unit,
            measure: MEASURE,
            tolerance: self.ask.tolerance,
            budget_cpu_seconds: self.ask.budget,
            prediction: self.prediction.clone(),
            estimate,
            met: fit.knows(at) && estimate.high <= self.ask.tolerance,
            order: (fit.verdict == Verdict::Asymptotic).then_some(fit.order),
            scatter: (fit.verdict == Verdict::Asymptotic).then_some(fit.scatter),
            runs: runs.collect(),
        })
    }

    /// What all runs together have taken [CPU s].
    pub fn spent(&self) -> f64 {
        let runs = self.tries.iter().filter_map(|t| t.outcome.as_ref().ok());
        runs.map(|run| run.cpu_seconds).sum()
    }

    /// Runs that have come to their end, one of each size, from coarse to fine.
    fn runs(&self) -> impl Iterator<Item = (f64, &Run)> {
        let mut all: Vec<(f64, &Run)> = self
            .tries
            .iter()
            .filter_map(|t| Some((t.level.size, t.outcome.as_ref().ok()?)))
            .collect();
        all.sort_by(|a, b| b.0.total_cmp(&a.0));
        all.dedup_by_key(|(size, _)| *size);
        all.into_iter()
    }

    fn fit(&self) -> Option<Fit> {
        let runs: Vec<(f64, &Series)> =
            self.runs().map(|(size, run)| (size, &run.series)).collect();
        (runs.len() >= Fit::FEWEST).then(|| Fit::new(&runs, self.ask.tolerance))
    }

    /// Place among the [`runs`](Self::runs) and error of the last final run.
    fn last_final(&self, fit: &Fit) -> Option<(usize, Band)> {
        let last = self.tries.iter().rev().find(|t| t.is_final)?;
        let at = self.runs().position(|(size, _)| size == last.level.size)?;
        Some((at, fit.errors[at]))
    }

    /// The finest size that was tried, also in vain.
    fn finest_tried(&self, finest: f64) -> f64 {
        self.tries
            .iter()
            .fold(finest, |least, t| least.min(t.level.size))
    }

    fn finer(&self, size: f64) -> Level {
        self.ladder.level(size / STEP, size / LEAST_STEP)
    }

    /// A pilot, if the budget allows it; `why` tells what for.
    fn pilot(&self, level: Level, why: &str) -> Result<Task> {
        let cost = self.cost(level.size);
        if self.tries.len() >= RUNS {
            return Err(Error::argument(format!(
                "after {RUNS} runs {why}; choose a quantity that varies more smoothly, such as a displacement \
                 instead of a velocity, or a vector instead of one component"
            )));
        }
        // If it is good enough it is run again, for its results.
        if self.runs().count() >= 2 && 2.0 * cost.cpu_seconds > self.left() {
            return Err(Error::argument(format!(
                "{why}; the next pilot, {} with about {:.0} particles, would take about {:.1} CPU seconds, and \
                 as much again if it is good enough and run for its results; {:.1} of the budget of {:.1} are \
                 left: raise the budget (--budget), or choose a quantity that varies more smoothly, such as a \
                 displacement instead of a velocity",
                level.cells,
                cost.particles,
                cost.cpu_seconds,
                self.left(),
                self.ask.budget
            )));
        }
        Ok(Task::Pilot(level))
    }

    fn beyond_budget(&self, fit: &Fit, cost: &Cost) -> Error {
        /// Share of what is left that the final run may take by this prediction: pilots lead to it, and
        /// they may show that it takes more.
        const SHARE: f64 = 0.25;
        // The error that this pays for, along the powers that the cost follows.
        let (mut low, mut high) = (self.ask.tolerance, 1.0_f64);
        for _ in 0..60 {
            let middle = (low * high).sqrt();
            let seconds = self.cost(fit.size_for(AIM * middle)).cpu_seconds;
            *(if seconds > SHARE * self.left() {
                &mut low
            } else {
                &mut high
            }) = middle;
        }
        Error::argument(format!(
            "a tolerance of {} takes about {:.1e} particles, {:.1e} steps, {:.1e} CPU seconds and {:.1e} GB, and \
             {:.0} CPU seconds of the budget of {:.0} are left: ask for {}, which they reach, or raise the \
             budget (--budget)",
            percent(self.ask.tolerance),
            cost.particles,
            cost.steps,
            cost.cpu_seconds,
            1e-9 * cost.memory,
            self.left(),
            self.ask.budget,
            percent(1.05 * high)
        ))
    }

    fn left(&self) -> f64 {
        (self.ask.budget - self.spent()).max(0.0)
    }

    /// What a run with cells of a size costs: that of the finest run, with the powers of the size that
    /// the last two runs show.
    fn cost(&self, size: f64) -> Cost {
        let runs: Vec<(f64, &Run)> = self.runs().collect();
        let Some((last_size, last)) = runs.last() else {
            return Cost::default();
        };
        let last_cost = last.cost();
        let power =
            |of: fn(&Cost) -> f64, [least, assumed, most]: [f64; 3]| match runs.iter().rev().nth(1)
            {
                Some((size, run)) => {
                    let ratio = of(&last_cost) / of(&run.cost()).max(1.0);
                    (ratio.ln() / (size / last_size).ln()).clamp(least, most)
                }
                None => assumed,
            };
        let finer = last_size / size;
        let particles = finer.powf(power(|c| c.particles, GROWTH[0]));
        let steps = finer.powf(power(|c| c.steps, GROWTH[1]));
        Cost {
            particles: last_cost.particles * particles,
            steps: last_cost.steps * steps,
            cpu_seconds: last_cost.cpu_seconds * particles * steps,
            memory: last_cost.memory * particles,
        }
    }
}

/// What the relative error of a series is.
const MEASURE: &str = "max over time of |u_h - u| over max over time of |u|, at the instants of the history; \
                       temperatures from their value at the start";

#[cfg(test)]
mod tests {
    use super::*;

    const CUBE: &str = r#"{
        "geometry": {"box": {"min": [0, 0, 0], "max": [1, 1, 1], "spacing": 0.125}},
        "material": {"neo_hookean": {"density": 1, "youngs_modulus": 1, "poisson_ratio": 0}},
        "time": {"end": 1}
    }"#;

    fn search(tolerance: f64, budget: f64) -> Result<Search> {
        Search::new(
            &Scene::from_json(CUBE, &[]).unwrap(),
            Ask { tolerance, budget },
        )
    }

    /// A run whose relative error is of its size, with a cost of an explicit method in three dimensions.
    fn run(size: f64, error: f64) -> Run {
        let cells = 8.0 / size;
        let row = |k: usize| {
            let t = 0.05 * k as f64;
            t.sin() + error * t.sin() * (0.3 * t).cos()
        };
        Run {
            particles: (cells + 1.0).powi(3) as usize,
            steps: (100.0 * cells) as u64,
            cpu_seconds: 1e-5 * cells.powi(4),
            memory: 1000,
            of: "probe.tip.displacement".to_owned(),
            unit: "m",
            series: Series::new(1, (0..100).map(row).collect(), false).unwrap(),
        }
    }

    /// Runs with an error, until the search ends.
    fn drive(search: &mut Search, error: impl Fn(f64) -> f64) -> Result<Report> {
        while let Some(task) = search.next_task()? {
            let size = task.level().size;
            search.succeeded(&task, run(size, error(size)));
        }
        Ok(search.report().expect("a final run was made"))
    }

    #[test]
    fn a_tolerance_is_met_with_the_error_inside_its_band() {
        for (tolerance, order) in [(0.05, 2.0), (0.005, 2.0), (5e-4, 2.0), (0.01, 1.0)] {
            let error = |size: f64| 0.02 * size.powf(order);
            let mut search = search(tolerance, 1e4).unwrap();
            let report = drive(&mut search, error).unwrap();
            let last = report.runs.last().unwrap();
            // The measure is relative to the largest value, here a little above 1.
            let truth = error(last.size);
            println!("{tolerance}: {truth:.2e} in {:?}", report.estimate);
            assert!(report.met && last.role == "final");
            assert!(report.estimate.low <= truth && truth <= report.estimate.high);
            // No finer than it takes: a good part of the tolerance is used.
            assert!(report.estimate.high > 0.2 * tolerance || last.size > 3.0);
            let foreseen = report.prediction.unwrap();
            assert!(foreseen.error.low <= truth && truth <= foreseen.error.high);
            let cost = last.cost.unwrap();
            let ratio = foreseen.cost.cpu_seconds / cost.cpu_seconds;
            assert!((0.5..2.0).contains(&ratio), "cost {ratio}");
        }
    }

    #[test]
    fn what_is_beyond_the_budget_is_refused_with_what_is_within() {
        let refused = drive(&mut search(1e-5, 60.0).unwrap(), |size| 0.02 * size * size);
        let message = refused.unwrap_err().to_string();
        println!("{message}");
        assert!(message.contains(", which they reach, or raise the budget"));
        let reachable = message.split("ask for ").nth(1).unwrap();
        let share: f64 = reachable.split(" %").next().unwrap().parse().unwrap();
        drive(&mut search(share / 100.0, 60.0).unwrap(), |size| {
            0.02 * size * size
        })
        .unwrap();
    }

    #[test]
    fn pilots_that_do_not_converge_are_refused() {
        let refused = drive(&mut search(0.01, 20.0).unwrap(), |size| {
            0.1 * (5.0 / size).sin()
        });
        let message = refused.unwrap_err().to_string();
        println!("{message}");
        assert!(message.contains("; the next pilot, "), "{message}");
        assert!(message.contains("raise the budget"), "{message}");
        // Without a budget in the way the number of runs ends it.
        let refused = drive(&mut search(0.01, 1e300).unwrap(), |size| 0.1 / size);
        let message = refused.unwrap_err().to_string();
        assert!(message.contains("after 16 runs"), "{message}");
        assert!(
            message.contains("; choose a quantity that varies more smoothly"),
            "{message}"
        );
        assert!(message.contains("too slowly"), "{message}");
    }

    #[test]
    fn a_pilot_that_diverges_makes_way_for_a_finer_one() {
        let mut search = search(0.05, 1e4).unwrap();
        let coarse = search.next_task().unwrap().unwrap();
        search
            .failed(&coarse, Error::new(Code::Diverged, "an inverted particle"))
            .unwrap();
        let next = search.next_task().unwrap().unwrap();
        assert!(next.level().size < coarse.level().size);
        search.succeeded(&next, run(next.level().size, 0.1));
        let report = drive(&mut search, |size| 0.02 * size * size).unwrap();
        assert_eq!(
            report.runs[0].failure.as_deref(),
            Some("an inverted particle")
        );
        assert!(report.runs[0].error.is_none() && report.met);
    }

    #[test]
    fn what_no_other_run_can_help_ends_the_search() {
        let mut search = search(0.05, 1e4).unwrap();
        let task = search.next_task().unwrap().unwrap();
        let error = search
            .failed(&task, Error::new(Code::Cancelled, "cancelled"))
            .unwrap_err();
        assert_eq!(error.code(), Code::Cancelled);
        assert!(error.message().contains("(in the run with "), "{error}");
    }

    #[test]
    fn what_is_beyond_the_memory_says_what_asks_for_it() {
        let refused = drive(&mut search(1e-7, 1e300).unwrap(), |size| 0.02 * size * size);
        let error = refused.unwrap_err();
        println!("{error}");
        assert_eq!(error.code(), Code::OutOfMemory);
        let note = " takes: ask for less accuracy";
        assert!(error.message().contains(note), "{error}");
    }

    #[test]
    fn a_bad_demand_is_refused() {
        for (tolerance, budget) in [
            (0.0, 1.0),
            (-1.0, 1.0),
            (1.0, 1.0),
            (f64::NAN, 1.0),
            (0.1, 0.0),
            (0.1, f64::NAN),
        ] {
            assert!(search(tolerance, budget).is_err(), "{tolerance} {budget}");
        }
    }
}
