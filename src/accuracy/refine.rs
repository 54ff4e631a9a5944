//! A scene with finer or coarser cells.

use crate::error::{Error, Result};
use crate::particles::lattice_divisions;
use crate::scene::{BoxGeometry, Geometry, Grading, Scene, Spacing, Support};

/// A scene of another resolution.
#[derive(Debug, Clone, PartialEq)]
pub struct Level {
    /// Size of the cells relative to the scene's own, from the numbers of cells that there really are:
    /// the geometric mean over the directions that the scene divides.
    pub size: f64,
    /// The cells in words, such as `6 x 36 x 6 cells`.
    pub cells: String,
    /// The scene with these cells.
    pub scene: Scene,
}

/// The resolutions of a scene. Directions keep their proportions, gradings their shape.
#[derive(Debug, Clone)]
pub struct Ladder {
    scene: Scene,
    divisions: Vec<Division>,
}

/// A direction that a geometry divides into cells.
#[derive(Debug, Clone, Copy)]
struct Division {
    cells: f64,
    /// One cell between rollers: nothing varies in this direction, and one cell it remains.
    uniform: bool,
}

/// A geometry of another resolution: its numbers of cells in the order of the divisions.
struct Scaled {
    geometry: Geometry,
    counts: Vec<f64>,
    cells: String,
}

/// The coarsest level has cells of this size, if the scene is fine enough for it.
const COARSEST: f64 = 4.0;
/// Cells across a direction at least, unless the scene has fewer itself.
const FEWEST: f64 = 2.0;
/// Largest difference between the logarithms of two directions' refinements, where there is a choice.
const OUT_OF_PROPORTION: f64 = 0.1;
/// Smaller differences than this count as none: 49 cells beside 8 where there were 24 beside 4.
const ALIKE: f64 = 0.025;
/// Levels are sought so far around the one that is asked for (difference of logarithms), in such steps.
const REACH: f64 = 0.45;
const STEP: f64 = 0.005;

impl Division {
    fn scaled(self, factor: f64) -> f64 {
        match self {
            Self { uniform: true, .. } => 1.0,
            // One cell says nothing about the direction, so that it is at least as fine as the others.
            Self { cells, .. } if cells <= 1.0 => factor.ceil().max(1.0),
            Self { cells, .. } => (factor * cells).round().max(1.0),
        }
    }
    fn fewest(self) -> f64 {
        self.cells.min(FEWEST)
    }
}

impl Ladder {
    /// The resolutions of a scene.
    ///
    /// # Errors
    /// [`Code::InvalidScene`](crate::Code::InvalidScene) for a mesh from a file and for a fixed time
    /// step, with the path: neither can be refined.
    pub fn new(scene: &Scene) -> Result<Self> {
        if scene.numerics.time_step.is_some() {
            return Err(Error::scene(
                "numerics.time_step",
                "with a fixed time step the error of time integration stays when the cells are refined, and \
                 cannot be estimated: leave it out, so that steps follow the CFL condition",
            ));
        }
        let even = |cells: &[f64]| -> Vec<Division> {
            let division = |&cells: &f64| Division {
                cells,
                uniform: false,
            };
            cells.iter().map(division).collect()
        };
        let divisions = match &scene.geometry {
            Geometry::Box(b) => (0..3)
                .map(|axis| Division {
                    cells: b.cells(axis),
                    uniform: b.cells(axis) <= 1.0 && between_rollers(scene, axis),
                })
                .collect(),
            boxes @ Geometry::Boxes(_) => {
                let counts: Vec<f64> = lattice_pieces(boxes)
                    .iter()
                    .map(|(_, cells)| *cells)
                    .collect();
                even(&counts)
            }
            Geometry::Cylinder(c) => even(&[f64::from(c.divisions), f64::from(c.layers)]),
            Geometry::PerforatedBox(b) => even(&[b.divisions, b.rings, b.layers].map(f64::from)),
            Geometry::Mesh(_) => {
                return Err(Error::scene(
                    "geometry.mesh",
                    "a mesh from a file cannot be refined, which presets and estimates of the error need: use a \
                     box, boxes, a cylinder or a perforated_box, or run meshes of several sizes and compare them",
                ));
            }
        };
        Ok(Self {
            scene: scene.clone(),
            divisions,
        })
    }

    /// The coarsest level to begin with: cells up to four times the size of the scene's own, and at least
    /// two in every direction that has as many.
    pub fn coarsest(&self) -> Level {
        let good = |factor: &f64| {
            let counts = self.divisions.iter().map(|d| (d, d.scaled(*factor)));
            let enough = counts
                .clone()
                .all(|(d, count)| d.uniform || count >= d.fewest());
            enough && self.measure(&self.scaled(*factor)).1 <= OUT_OF_PROPORTION
        };
        let steps = (COARSEST.ln() / STEP).ceil() as u32;
        let factor = |k: u32| (f64::from(k) * STEP).exp() / COARSEST;
        // Of those about as coarse as the first, the one in proportion.
        let Some(first) = (0..steps).find(|k| good(&factor(*k))) else {
            return self.exactly(1.0);
        };
        let spread = |k: &u32| self.measure(&self.scaled(factor(*k))).1;
        let around = (first..=first + (0.2 / STEP) as u32).filter(|k| good(&factor(*k)));
        let best = around.min_by(|p, q| spread(p).total_cmp(&spread(q)));
        self.exactly(factor(best.unwrap_or(first)))
    }

    /// The level whose cells are about as large as `size`, relative to the scene's own, and smaller than
    /// `below`. What the whole numbers of cells leave as a choice goes to the level whose directions are
    /// refined alike.
    pub fn level(&self, size: f64, below: f64) -> Level {
        /// So much nearer to `size` a level must be to make up for directions that differ.
        const WEIGHT: f64 = 4.0;
        let steps = (REACH / STEP) as i32;
        let mut best: Option<(f64, f64)> = None;
        for k in (-steps..=steps).chain(steps + 1..4 * steps) {
            if k > steps && best.is_some() {
                break;
            }
            let factor = (f64::from(k) * STEP).exp() / size;
            let (found, spread) = self.measure(&self.scaled(factor));
            if found >= below * (1.0 - 1e-9) {
                continue;
            }
            let score = WEIGHT * (spread - ALIKE).max(0.0) + (found / size).ln().abs();
            if best.is_none_or(|(least, _)| score < least) {
                best = Some((score, factor));
            }
        }
        self.exactly(best.map_or(1.0 / size, |(_, factor)| factor))
    }

    fn exactly(&self, factor: f64) -> Level {
        let scaled = self.scaled(factor);
        let (size, _) = self.measure(&scaled);
        let mut scene = self.scene.clone();
        scene.geometry = scaled.geometry;
        Level {
            size,
            cells: scaled.cells,
            scene,
        }
    }

    /// Relative size of the cells, and how far the directions are out of proportion: the largest
    /// difference between the logarithms of their refinements.
    fn measure(&self, scaled: &Scaled) -> (f64, f64) {
        let divided = self.divisions.iter().any(|d| d.cells > 1.0);
        let ratios: Vec<f64> = std::iter::zip(&self.divisions, &scaled.counts)
            .filter(|(d, _)| d.cells > 1.0 || !divided)
            .map(|(d, count)| (d.cells / count).ln())
            .collect();
        let mean = ratios.iter().sum::<f64>() / ratios.len() as f64;
        let most = ratios.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let least = ratios.iter().copied().fold(f64::INFINITY, f64::min);
        (mean.exp(), most - least)
    }

    fn scaled(&self, factor: f64) -> Scaled {
        let mut geometry = self.scene.geometry.clone();
        let mut counts: Vec<f64> = self.divisions.iter().map(|d| d.scaled(factor)).collect();
        let whole = |count: f64| count as u32;
        let cells = match &mut geometry {
            Geometry::Box(b) => {
                divide(b, [counts[0], counts[1], counts[2]]);
                format!("{} x {} x {} cells", counts[0], counts[1], counts[2])
            }
            boxes @ Geometry::Boxes(_) => {
                if let Geometry::Boxes(all) = boxes {
                    for b in all.values_mut() {
                        b.spacing = Spacing::PerAxis(b.spacing.per_axis().map(|h| h / factor));
                    }
                }
                let pieces = lattice_pieces(boxes);
                counts = pieces.iter().map(|(_, cells)| *cells).collect();
                let spacings = pieces.iter().map(|(length, cells)| length / cells);
                let least = spacings.fold(f64::INFINITY, f64::min);
                format!("spacing from {least:.4} m")
            }
            Geometry::Cylinder(c) => {
                (c.divisions, c.layers) = (whole(counts[0]), whole(counts[1]));
                resample(&mut c.radial_grading, c.divisions as usize);
                resample(&mut c.grading, c.layers as usize);
                format!("{} divisions, {} layers", c.divisions, c.layers)
            }
            Geometry::PerforatedBox(b) => {
                [b.divisions, b.rings, b.layers] = [0, 1, 2].map(|k| whole(counts[k]));
                resample(&mut b.grading, b.layers as usize);
                format!(
                    "{} divisions, {} rings, {} layers",
                    b.divisions, b.rings, b.layers
                )
            }
            Geometry::Mesh(_) => unreachable!("a ladder is not made of a mesh"),
        };
        Scaled {
            geometry,
            counts,
            cells,
        }
    }
}

/// Divides the edges of a box into numbers of cells.
fn divide(b: &mut BoxGeometry, counts: [f64; 3]) {
    b.spacing = Spacing::PerAxis([0, 1, 2].map(|a| (b.max[a] - b.min[a]) / counts[a]));
    if let Some(grading) = &mut b.grading {
        for (grading, count) in [&mut grading.x, &mut grading.y, &mut grading.z]
            .into_iter()
            .zip(counts)
        {
            resample(grading, count as usize);
        }
    }
}

/// A list of fractions for another number of cells: linear between those that there are. A ratio holds
/// for any number.
fn resample(grading: &mut Option<Grading>, cells: usize) {
    if let Some(Grading::Fractions(fractions)) = grading {
        let last = fractions.len() - 1;
        let at = |k: usize| {
            let place = k as f64 / cells as f64 * last as f64;
            let below = (place as usize).min(last - 1);
            let share = place - below as f64;
            (1.0 - share) * fractions[below] + share * fractions[below + 1]
        };
        let mut finer: Vec<f64> = (0..=cells).map(at).collect();
        finer[cells] = 1.0;
        *fractions = finer;
    }
}

/// Lengths [m] and numbers of cells of all pieces of a lattice's axes.
fn lattice_pieces(geometry: &Geometry) -> Vec<(f64, f64)> {
    let boxes: Vec<&BoxGeometry> = geometry.boxes().into_iter().map(|(_, b)| b).collect();
    (0..3)
        .flat_map(|axis| lattice_divisions(&boxes, axis))
        .map(|(from, to, cells)| (to - from, cells as f64))
        .collect()
}

/// Whether both faces of a box across an axis are on rollers.
fn between_rollers(scene: &Scene, axis: usize) -> bool {
    let name = ["x", "y", "z"][axis];
    ["min", "max"].iter().all(|side| {
        let face = format!("{name}_{side}");
        scene.boundary.iter().any(|(patch, condition)| {
            let whole = *patch == face
                || scene
                    .patches
                    .get(patch)
                    .is_some_and(|p| p.min.is_none() && p.max.is_none() && p.faces.contains(&face));
            whole && condition.support == Some(Support::Roller)
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Simulation;

    fn ladder(geometry: &str, more: &str) -> Result<Ladder> {
        let text = format!(
            r#"{{"geometry": {geometry},
                "material": {{"neo_hookean": {{"density": 1, "youngs_modulus": 1, "poisson_ratio": 0}}}},
                "time": {{"end": 1}}{more}}}"#
        );
        Ladder::new(&Scene::from_json(&text, &[])?)
    }

    /// Levels from the coarsest on, each about half as large as the one before.
    fn levels(geometry: &str, more: &str) -> Vec<Level> {
        let ladder = ladder(geometry, more).unwrap();
        let mut all = vec![ladder.coarsest()];
        for _ in 0..3 {
            let last = all[all.len() - 1].size;
            all.push(ladder.level(last / 2.0, last / 1.12));
        }
        for pair in all.windows(2) {
            assert!(pair[1].size < pair[0].size / 1.12);
            pair[1].scene.validate().unwrap();
        }
        all
    }

    fn cells(levels: &[Level]) -> Vec<&str> {
        levels.iter().map(|l| l.cells.as_str()).collect()
    }

    #[test]
    fn a_box_keeps_its_proportions() {
        let all = levels(
            r#"{"box": {"min": [-0.5, 0, -0.5], "max": [0.5, 6, 0.5], "spacing": 0.25}}"#,
            "",
        );
        assert_eq!(
            cells(&all),
            [
                "2 x 12 x 2 cells",
                "4 x 24 x 4 cells",
                "8 x 48 x 8 cells",
                "16 x 96 x 16 cells"
            ]
        );
        let sizes: Vec<f64> = all.iter().map(|l| l.size).collect();
        for (size, expected) in sizes.iter().zip([2.0, 1.0, 0.5, 0.25]) {
            assert!((size / expected - 1.0).abs() < 1e-12, "{size}");
        }
        let particles = [1, 3].map(|k| {
            let scene = all[k].scene.clone();
            Simulation::with_threads(scene, 1).unwrap().particle_count()
        });
        assert_eq!(particles, [5 * 25 * 5, 17 * 97 * 17]);
    }

    #[test]
    fn sizes_are_those_of_the_cells_that_there_are() {
        // 3 cells and 10: what is asked for hits neither, and no size is said that is not there.
        let ladder = ladder(
            r#"{"box": {"min": [0, 0, 0], "max": [3, 10, 3], "spacing": 1}}"#,
            "",
        )
        .unwrap();
        let level = ladder.level(0.73, f64::INFINITY);
        let Geometry::Box(b) = &level.scene.geometry else {
            panic!("a box");
        };
        let counts = [0, 1, 2].map(|a| b.cells(a));
        let size = (3.0 * 10.0 * 3.0 / counts.iter().product::<f64>()).cbrt();
        assert!((level.size / size - 1.0).abs() < 1e-12, "{level:?}");
        assert_eq!(counts, [4.0, 13.0, 4.0]);
    }

    #[test]
    fn one_cell_stays_one_between_rollers_and_is_refined_elsewhere() {
        let rod = r#"{"box": {"min": [0, 0, 0], "max": [8, 1, 1], "spacing": 1}}"#;
        let rollers = r#", "patches": {"sides": {"faces": ["y_min", "y_max"]}},
            "boundary": {"sides": {"support": "roller"}}"#;
        assert_eq!(
            cells(&levels(rod, rollers)),
            [
                "2 x 1 x 1 cells",
                "4 x 1 x 1 cells",
                "8 x 1 x 1 cells",
                "16 x 1 x 2 cells"
            ]
        );
    }

    #[test]
    fn gradings_keep_their_shape() {
        let all = levels(
            r#"{"box": {"min": [0, 0, 0], "max": [1, 1, 1], "spacing": 0.25,
                "grading": {"x": 4, "z": [0, 0.1, 0.3, 0.6, 1]}}}"#,
            "",
        );
        let grading = |level: &Level| match &level.scene.geometry {
            Geometry::Box(b) => b.grading.clone().unwrap(),
            _ => panic!("a box"),
        };
        let finer = grading(&all[2]);
        assert_eq!(finer.x, Some(Grading::Ratio(4.0)));
        let Some(Grading::Fractions(z)) = finer.z else {
            panic!("fractions");
        };
        let expected = [0.0, 0.05, 0.1, 0.2, 0.3, 0.45, 0.6, 0.8, 1.0];
        assert_eq!(z.len(), expected.len(), "{z:?}");
        assert!(z.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12));
    }

    #[test]
    fn boxes_refine_together() {
        let all = levels(
            r#"{"boxes": {
                "foot": {"min": [0, 0, 0], "max": [2, 1, 1], "spacing": 0.25},
                "leg": {"min": [0, 1, 0], "max": [1, 3, 1], "spacing": 0.25}}}"#,
            "",
        );
        let sizes: Vec<f64> = all.iter().map(|l| l.size).collect();
        for (size, expected) in sizes.iter().zip([2.0, 1.0, 0.5, 0.25]) {
            assert!((size / expected - 1.0).abs() < 1e-9, "{sizes:?}");
        }
        assert_eq!(all[2].cells, "spacing from 0.1250 m");
    }

    #[test]
    fn cylinders_and_perforated_boxes_refine_by_their_counts() {
        let bar = levels(
            r#"{"cylinder": {"radius": 1, "length": 4, "sector": "quarter", "divisions": 4, "layers": 20,
                "radial_grading": [0, 0.4, 0.7, 0.9, 1]}}"#,
            "",
        );
        assert_eq!(bar[0].cells, "2 divisions, 10 layers");
        assert_eq!(bar[2].cells, "8 divisions, 40 layers");
        let plate = levels(
            r#"{"perforated_box": {"min": [0, 0, 0], "max": [2, 2, 1], "tiles": [1, 1], "diameter": 0.5,
                "divisions": 4, "rings": 4, "layers": 2}}"#,
            "",
        );
        assert_eq!(plate[0].cells, "4 divisions, 4 rings, 2 layers");
        assert_eq!(plate[1].cells, "8 divisions, 8 rings, 4 layers");
    }

    #[test]
    fn meshes_and_fixed_steps_are_refused() {
        let mesh = format!(
            r#"{{"mesh": {{"file": "{}/examples/meshes/bar_1.msh"}}}}"#,
            env!("CARGO_MANIFEST_DIR")
        );
        let error = ladder(&mesh, "").unwrap_err();
        assert!(error.to_string().contains("cannot be refined"), "{error}");
        let cube = r#"{"box": {"min": [0, 0, 0], "max": [1, 1, 1], "spacing": 0.5}}"#;
        let error = ladder(cube, r#", "numerics": {"time_step": 1e-3}"#).unwrap_err();
        assert_eq!(error.place().path.as_deref(), Some("numerics.time_step"));
    }
}
