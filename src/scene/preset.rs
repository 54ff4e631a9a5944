//! Speed for accuracy in one word.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Scene;
use crate::accuracy::Ladder;
use crate::error::Result;

/// Speed for accuracy in one word: how large the cells are beside those that the scene gives.
///
/// Resolution is what accuracy costs: of all settings it alone lowers the error in every case of the bench. The others are
/// chosen by what a scene holds (shocks, metals, irregular particles).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Preset {
    /// Cells 1.5 times as large: about a fifth of the CPU time, and twice the error.
    Fast,
    /// The cells of the scene.
    Balanced,
    /// Cells 1.5 times smaller: about five times the CPU time, and half of the error.
    Accurate,
}

impl Preset {
    /// Size of the cells over that of the scene's.
    pub fn cell_size(self) -> f64 {
        match self {
            Self::Fast => 1.5,
            Self::Balanced => 1.0,
            Self::Accurate => 1.0 / 1.5,
        }
    }
}

impl Scene {
    /// The scene with the cells that its preset asks for, and no preset any more.
    pub(crate) fn with_preset(mut self) -> Result<Self> {
        match self.preset.take() {
            None | Some(Preset::Balanced) => Ok(self),
            Some(preset) => {
                let ladder = Ladder::new(&self)?;
                let scene = ladder.level(preset.cell_size(), f64::INFINITY).scene;
                scene.validate()?;
                Ok(scene)
            }
        }
    }
}
