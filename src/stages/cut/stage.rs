//! The `[cut]` table and its section of the report.
use serde::{Deserialize, Serialize};
use serde_json::json;

use super::{CutError, Options, cut};
use crate::{
    model::{CutMesh, DevelopableMesh},
    profile::{Length, Profiles},
    stage::{Check, Cx, KeyError, Section, Stage},
};

/// Where the surface is cut.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CutStage {
    /// Stretch to keep to, as |log scale|; the material's when absent.
    pub stretch: Option<f64>,
    /// Vertices with a developability energy above this lie on a seam; when absent the seams follow from the stretch.
    pub tolerance: Option<f64>,
    /// Least distance between parts of one outline.
    pub clearance: Length,
    /// More pieces than this are a failed check.
    pub max_pieces: Option<usize>,
}

impl Default for CutStage {
    fn default() -> Self {
        Self { stretch: None, tolerance: None, clearance: Length::mm(0.002), max_pieces: None }
    }
}

/// The least angle by which a slit opens at its end, radians: less is closed by the width of any tool.
const LEAST_OPENING: f64 = 1e-3;

impl Stage for CutStage {
    const NAME: &'static str = "cut";
    const VERSION: u32 = 1;
    type Input = DevelopableMesh;
    type Output = CutMesh;
    /// The stretch that the material takes, as |log scale|.
    type Profile = f64;
    type Error = CutError;

    fn profile(profiles: &Profiles) -> f64 {
        profiles.material.stretch
    }

    fn check(&self) -> Result<(), KeyError> {
        if let Some(stretch) = self.stretch {
            KeyError::range("stretch", stretch, 1e-6, 1.0)?;
        }
        if let Some(tolerance) = self.tolerance {
            KeyError::range("tolerance", tolerance, 0.0, 1e6)?;
        }
        if let Some(pieces) = self.max_pieces {
            KeyError::range("max_pieces", pieces as f64, 1.0, 1e9)?;
        }
        KeyError::range("clearance", self.clearance.mm, 1e-6, 10.0)
    }

    fn run(&self, input: &DevelopableMesh, stretch: &f64, cx: &Cx) -> Result<CutMesh, CutError> {
        let options = Options {
            stretch: self.stretch.unwrap_or(*stretch),
            tolerance: self.tolerance,
            clearance: self.clearance.mm,
            least_opening: LEAST_OPENING,
        };
        cut(input, &options, &cx.monitor)
    }

    fn section(&self, input: &DevelopableMesh, _: &f64, cut: &CutMesh) -> Section {
        let length: f64 = cut.seams.iter().flat_map(|it| &it.sides[0]).map(|&h| cut.mesh.vector(h).norm()).sum();
        let mut table = json!({
            "seam_vertices": cut.seam_vertices,
            "seam_length_mm": length,
            "seam_length_rel": length / input.mesh.bounds().diagonal(),
            "pieces": cut.pieces.len(),
        });
        if let Some(tolerance) = self.tolerance {
            table["tolerance"] = json!(tolerance);
        }
        let section = Section::new("cut", table);
        match self.max_pieces {
            Some(limit) => section.check(Check::at_most(
                "cut.pieces",
                cut.pieces.len() as f64,
                limit as f64,
                "pieces",
                "fewer pieces need a material that stretches more, a smoother mesh or a larger deviation in [develop]",
            )),
            None => section,
        }
    }
}
