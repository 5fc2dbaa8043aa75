//! What cuts it.
use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::Length;

/// Kind of machine.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum MachineKind {
    /// CO₂ or diode laser.
    Laser,
    /// Cutting plotter with a trailing blade.
    DragKnife,
    /// Draws only.
    Pen,
}

/// An sRGB colour, written "#rrggbb".
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Color(pub [u8; 3]);

impl TryFrom<String> for Color {
    type Error = String;
    fn try_from(text: String) -> Result<Self, String> {
        let wrong = || format!("`{text}` is not a colour; write it as \"#rrggbb\"");
        let digits = text.strip_prefix('#').filter(|it| it.len() == 6 && it.is_ascii()).ok_or_else(wrong)?;
        let byte = |i: usize| u8::from_str_radix(&digits[2 * i..2 * i + 2], 16).map_err(|_| wrong());
        Ok(Self([byte(0)?, byte(1)?, byte(2)?]))
    }
}

impl From<Color> for String {
    fn from(Color([r, g, b]): Color) -> Self {
        format!("#{r:02x}{g:02x}{b:02x}")
    }
}

/// How an operation appears in drawings.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Layer {
    /// Layer name in SVG and DXF.
    pub name: String,
    /// Stroke colour.
    pub color: Color,
}

/// How a machine carries out an operation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tool {
    /// Feed rate, mm/min.
    pub feed: f64,
    /// Laser power or knife force, as a share of the machine's range.
    #[serde(default)]
    pub power: f64,
    /// How often the path is run.
    #[serde(default = "one")]
    pub passes: u32,
}

fn one() -> u32 {
    1
}

/// A machine profile (`profiles/machines/NAME.toml`). Layers and tools are keyed by operation in kebab case
/// ("cut-outside", "score-valley", …).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Machine {
    /// For people.
    pub title: String,
    /// Kind of machine.
    pub kind: MachineKind,
    /// Travel in x and y.
    pub bed: [Length; 2],
    /// Rapid traverse, mm/min.
    pub rapid: f64,
    /// Acceleration, mm/s².
    pub acceleration: f64,
    /// Range of the S word that full power maps to.
    pub spindle_max: f64,
    /// Formats written when the config names none.
    pub formats: Vec<String>,
    /// How drawings show each operation.
    pub layers: BTreeMap<String, Layer>,
    /// How the machine does each operation; one that is missing is not done by this machine.
    pub tools: BTreeMap<String, Tool>,
}
