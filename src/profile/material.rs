//! What is cut.
use serde::{Deserialize, Serialize};

use super::Length;

/// A material profile (`profiles/materials/NAME.toml`). Every figure in the built-in ones names its source.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Material {
    /// For people: "Paper, 200 g/m²".
    pub title: String,
    /// Thickness of the sheet.
    pub thickness: Length,
    /// Width and height of the stock.
    pub sheet: [Length; 2],
    /// Kept free along the edges of the stock.
    pub margin: Length,
    /// Kept free between parts.
    pub gap: Length,
    /// How far it may be stretched or squeezed, as |log scale| (0.005 = half a percent).
    pub stretch: f64,
}
