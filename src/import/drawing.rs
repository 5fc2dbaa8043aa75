//! What a drawing file holds, whatever its format: lines on named layers, in millimetres.
use crate::geom::{Box2, Vec2, polyline_length};

/// Largest distance between a curve in a file and the segments that it becomes, mm.
pub(super) const TOLERANCE: f64 = 0.005;

/// The lines of a drawing; y up.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Drawing {
    /// Size of the page where the format has one; the origin is then its lower left corner.
    pub size: Option<Vec2>,
    /// Whether the file says how long its unit is; where it does not, the usual one of the format was taken.
    pub measured: bool,
    /// The lines in the order of the file.
    pub lines: Vec<DrawnLine>,
    /// What the file holds besides lines, one phrase each: "3 TEXT".
    pub ignored: Vec<String>,
}

/// One line of a drawing.
#[derive(Debug, Clone, PartialEq)]
pub struct DrawnLine {
    /// Name (DXF) or id (SVG) of its layer, or the assignment of the crease (FOLD); empty where there is none.
    pub layer: String,
    /// Its colour as red, green and blue, where the file gives one to the line.
    pub color: Option<[u8; 3]>,
    /// Its points, mm; the first is not repeated at the end of a closed one.
    pub points: Vec<Vec2>,
    /// Whether the last point joins the first.
    pub closed: bool,
}

impl DrawnLine {
    /// Its length, mm.
    pub fn length(&self) -> f64 {
        polyline_length(&self.points, self.closed)
    }
}

impl Drawing {
    /// Box around all lines.
    pub fn bounds(&self) -> Box2 {
        Box2::of(self.lines.iter().flat_map(|it| &it.points))
    }
}

/// Why a drawing could not be read.
#[derive(Debug, thiserror::Error)]
pub enum DrawingError {
    /// Not an SVG that usvg understands.
    #[error("not a readable SVG: {0}")]
    Svg(String),
    /// Not a DXF that the reader understands.
    #[error("not a readable DXF: {0}")]
    Dxf(String),
    /// Not a FOLD file that the reader understands.
    #[error("not a readable FOLD file: {0}")]
    Fold(String),
    /// Not a PDF that the reader understands.
    #[error("not a readable PDF: {0}")]
    Pdf(String),
    /// Units that are not lengths of this world.
    #[error("the DXF is drawn in {0}; expected millimetres, centimetres, metres, inches or feet")]
    Units(String),
    /// A word or command that the reader does not know.
    #[error("line {line}: {message}: `{text}`")]
    Program {
        /// From 1.
        line: usize,
        /// What is wrong.
        message: String,
        /// The line.
        text: String,
    },
}

/// Number of equal steps of the parameter t in [0, 1] after which chords are closer than [`TOLERANCE`] to a curve whose
/// second derivative is at most `bend`: the error of linear interpolation is h²/8 · max |f″|.
pub(super) fn steps(bend: f64) -> usize {
    ((bend / (8.0 * TOLERANCE)).sqrt().ceil() as usize).clamp(1, 10_000)
}

/// Points of an arc about `center` from angle `start` through `sweep` radians, without its first point.
pub(super) fn arc(center: Vec2, radius: f64, start: f64, sweep: f64) -> impl Iterator<Item = Vec2> {
    let count = steps(radius.abs() * sweep * sweep);
    (1..=count).map(move |i| {
        let angle = start + sweep * i as f64 / count as f64;
        center + radius * Vec2::new(angle.cos(), angle.sin())
    })
}
