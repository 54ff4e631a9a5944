//! What the counts are compared with: `expected.json`, the margins, and the table of the README.

use std::fmt::Write as _;

use serde::{Deserialize, Serialize};

use crate::scenes::{ELASTIC, SCENES};
use crate::{Result, Verdicts};

/// Instructions more or fewer than expected, with the same compiler. Counting again differs by at most
/// 0.1 %; the rest is for code that the compiler arranges anew when something else changes.
const SAME_COMPILER: f64 = 0.03;
/// The same with another compiler.
const OTHER_COMPILER: f64 = 0.15;
/// Pair-updates more or fewer than expected: the rounding of another processor or of sums in another
/// order moves the number of steps by less.
const PAIR_UPDATES: f64 = 0.005;
/// Share by which an error may differ, for the same reason.
const ERRORS: f64 = 0.01;

/// Counts of a scene's steps.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct SceneCount {
    pub scene: String,
    pub particles: u64,
    /// Instructions per particle and step.
    pub per_particle_step: f64,
    /// Instructions per directed pair and right-hand side.
    pub per_pair_update: f64,
    pub bytes_per_particle: f64,
}

/// Work and errors of a case.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct CaseCount {
    /// Name and size.
    pub case: String,
    /// Directed pairs times right-hand sides.
    pub pair_updates: u64,
    /// Names of the quantities and their relative errors.
    pub errors: Vec<(String, f64)>,
}

/// What was counted here.
pub struct Counts {
    pub compiler: String,
    /// Or why instructions were not counted.
    pub scenes: std::result::Result<Vec<SceneCount>, String>,
    pub cases: Vec<CaseCount>,
}

/// What is committed.
#[derive(Serialize, Deserialize)]
pub struct Expected {
    compiler: String,
    scenes: Vec<SceneCount>,
    cases: Vec<CaseCount>,
}

impl Expected {
    /// The counts as those to be expected from now on.
    ///
    /// # Errors
    /// Where instructions could not be counted.
    pub fn of(counts: Counts) -> Result<Self> {
        let scenes = counts
            .scenes
            .map_err(|reason| format!("instructions are not counted: {reason}"))?;
        Ok(Self {
            compiler: counts.compiler,
            scenes,
            cases: counts.cases,
        })
    }

    pub fn compare(&self, counts: &Counts) -> Verdicts {
        let mut verdicts = Verdicts::default();
        match &counts.scenes {
            Ok(scenes) => self.compare_scenes(scenes, &counts.compiler, &mut verdicts),
            Err(reason) => verdicts.tell(format!(
                "Instructions and memory are not compared: {reason}"
            )),
        }
        for case in &counts.cases {
            let name = &case.case;
            let Some(expected) = self.cases.iter().find(|c| c.case == *name) else {
                verdicts.check(name, Err(UNKNOWN.into()));
                continue;
            };
            let [now, then] = [case, expected].map(|c| c.pair_updates as f64);
            verdicts.check(
                &format!("{name}, pair-updates"),
                within(now, then, PAIR_UPDATES),
            );
            for (i, (quantity, error)) in case.errors.iter().enumerate() {
                let then = expected.errors.get(i).map_or(f64::NAN, |(_, error)| *error);
                verdicts.check(
                    &format!("{name}, error of {quantity}"),
                    within(*error, then, ERRORS),
                );
            }
        }
        verdicts
    }

    fn compare_scenes(&self, scenes: &[SceneCount], compiler: &str, verdicts: &mut Verdicts) {
        let margin = if compiler == self.compiler {
            SAME_COMPILER
        } else {
            verdicts.tell(format!(
                "The margin of the instructions is {} %: they were counted for {} and now for {compiler}",
                100.0 * OTHER_COMPILER,
                self.compiler
            ));
            OTHER_COMPILER
        };
        for now in scenes {
            let name = &now.scene;
            let Some(then) = self.scenes.iter().find(|s| s.scene == *name) else {
                verdicts.check(name, Err(UNKNOWN.into()));
                continue;
            };
            let ratio = now.per_particle_step / then.per_particle_step;
            verdicts.tell(format!(
                "{:<62} {:>8.0} instructions per particle-step, {:>6.1} per pair and right-hand side \
                 ({:+.2} %), {:>5.0} bytes per particle",
                name,
                now.per_particle_step,
                now.per_pair_update,
                100.0 * (ratio - 1.0),
                now.bytes_per_particle
            ));
            verdicts.check(
                &format!("{name}, instructions per particle-step"),
                no_more(now.per_particle_step, then.per_particle_step, margin),
            );
            if ratio < 1.0 - margin {
                verdicts.tell(format!(
                    "{name} takes fewer instructions than expected: {UPDATE}"
                ));
            }
            verdicts.check(
                &format!("{name}, bytes per particle"),
                no_more(now.bytes_per_particle, then.bytes_per_particle, 0.0),
            );
        }
    }

    /// The table of the README.
    pub fn table(&self) -> String {
        let count = |name: &str| self.scenes.iter().find(|s| s.scene == name);
        let elastic = count(ELASTIC).map_or(f64::NAN, |s| s.per_particle_step);
        let mut table = String::from(
            "| option | instructions per particle-step | relative | bytes per particle |\n\
             | --- | --- | --- | --- |\n",
        );
        for scene in SCENES
            .iter()
            .filter(|s| s.shown)
            .filter_map(|s| count(s.name))
        {
            writeln!(
                table,
                "| {} | {} | {:.2} | {:.0} |",
                scene.scene,
                in_thousands(scene.per_particle_step),
                scene.per_particle_step / elastic,
                scene.bytes_per_particle
            )
            .expect("a string takes all");
        }
        table
    }

    /// The README with its table replaced by this one.
    ///
    /// # Errors
    /// Where the README has no such table.
    pub fn in_readme(&self, readme: &str) -> Result<String> {
        const START: &str = "<!-- cargo xtask counts --update -->\n";
        const END: &str = "<!-- end -->\n";
        let (before, rest) = readme
            .split_once(START)
            .ok_or("README.md lacks the start of the table")?;
        let (_, after) = rest
            .split_once(END)
            .ok_or("README.md lacks the end of the table")?;
        Ok(format!("{before}{START}{}{END}{after}", self.table()))
    }
}

const UPDATE: &str = "`cargo xtask counts --update` makes the present counts the expected ones";
const UNKNOWN: &str = "nothing is expected of it: run `cargo xtask counts --update`";

/// Within a share of the expected value on either side.
fn within(now: f64, then: f64, share: f64) -> std::result::Result<(), String> {
    if (now - then).abs() <= share * then.abs() {
        return Ok(());
    }
    Err(format!(
        "{now} instead of {then}, more than {} % away. If that is meant, {UPDATE}",
        100.0 * share
    ))
}

/// At most a share above the expected value.
fn no_more(now: f64, then: f64, share: f64) -> std::result::Result<(), String> {
    if now <= then * (1.0 + share) {
        return Ok(());
    }
    Err(format!(
        "{now:.1} instead of {then:.1}, which is {:.2} % more and the margin is {} %. If that is meant, {UPDATE}",
        100.0 * (now / then - 1.0),
        100.0 * share
    ))
}

/// To three digits, with a comma.
fn in_thousands(count: f64) -> String {
    let unit = 10f64.powf(count.log10().floor() - 2.0).max(1.0);
    let count = ((count / unit).round() * unit) as u64;
    match count / 1000 {
        0 => count.to_string(),
        thousands => format!("{thousands},{:03}", count % 1000),
    }
}
