//! What the drawing formats write: the lines of a sheet or of one part, in the order of work.
use crate::{
    geom::{Box2, Vec2, stroke_font::letter},
    model::{Line, Part, Sheet},
    profile::{Color, Layer, Machine, Order},
};

/// Decimals of a millimetre in drawings: a tenth of a micrometre, far below any machine and far above the noise of f64.
const DECIMALS: usize = 4;

/// A page of lines; the origin is its lower left corner, y up.
#[derive(Debug)]
pub struct Drawing<'a> {
    /// Width and height, mm.
    pub size: Vec2,
    /// The lines in the order of work, to be moved by `offset`.
    pub lines: Vec<Line<'a>>,
    /// From the coordinates of the lines to those of the page.
    pub offset: Vec2,
    /// Strokes that show a length of 100 mm, in coordinates of the page; on a layer of their own that is not cut.
    pub check: Vec<Vec<Vec2>>,
}

/// Name of the layer of the check line.
pub const CHECK_LAYER: &str = "CHECK";
/// Its colour: T1, one of the two tool layers of LightBurn, which are never cut.
pub(super) const CHECK_COLOR: Color = Color([0xf3, 0x69, 0x26]);

/// A line of 100 mm with its length beside it, from a corner of a page; nothing where the page is too small for it.
pub(super) fn check_line(page: Vec2, corner: Vec2) -> Vec<Vec<Vec2>> {
    const LENGTH: f64 = 100.0;
    const HEIGHT: f64 = 2.0;
    let text = letter("100 mm", HEIGHT);
    if page.x < LENGTH + 4.0 + text.size.x || page.y < HEIGHT + 1.0 {
        return Vec::new();
    }
    let at = |x: f64, y: f64| corner + Vec2::new(1.0 + x, 1.0 + y);
    let mut strokes = vec![vec![at(0.0, 0.0), at(LENGTH, 0.0)]];
    strokes.extend([0.0, LENGTH].map(|x| vec![at(x, 0.2), at(x, HEIGHT)]));
    strokes.extend(text.strokes.iter().map(|it| it.iter().map(|p| at(LENGTH + 2.0 + p.x, p.y)).collect()));
    strokes
}

impl<'a> Drawing<'a> {
    /// A nested sheet; the page is the stock.
    pub fn of_sheet(sheet: &'a Sheet, order: &Order) -> Self {
        let lines = sheet.parts.iter().flat_map(Part::lines).collect();
        let check = check_line(sheet.size, Vec2::zeros());
        Self { size: sheet.size, lines, offset: Vec2::zeros(), check }.sorted(order)
    }

    /// One part; the page is its bounding box.
    pub fn of_part(part: &'a Part, order: &Order) -> Self {
        let lines: Vec<Line<'_>> = part.lines().collect();
        let bounds = Box2::of(lines.iter().flat_map(|it| it.points));
        // A shop wants a part alone: nothing that is not the part goes into its file.
        Self { size: bounds.size(), lines, offset: -bounds.min, check: Vec::new() }.sorted(order)
    }

    fn sorted(mut self, order: &Order) -> Self {
        self.lines.sort_by_key(|it| order.rank(it.operation));
        self
    }

    /// The points of a line on the page, rounded to what is written; repeated ones are left out, so that no written
    /// segment has length zero.
    pub fn points(&self, line: &Line<'_>) -> Vec<Vec2> {
        self.rounded(line.points, self.offset, line.closed)
    }

    /// The strokes of the check line, rounded likewise.
    pub fn check(&self) -> impl Iterator<Item = Vec<Vec2>> {
        self.check.iter().map(|it| self.rounded(it, Vec2::zeros(), false))
    }

    fn rounded(&self, points: &[Vec2], offset: Vec2, closed: bool) -> Vec<Vec2> {
        let scale = 10_f64.powi(DECIMALS as i32);
        // Rounding here and not only in the text makes "equal in the file" and "equal here" the same thing.
        let mut points: Vec<Vec2> = points.iter().map(|p| (p + offset).map(|c| (c * scale).round() / scale)).collect();
        points.dedup();
        while closed && points.len() > 1 && points.first() == points.last() {
            points.pop();
        }
        points
    }

    /// The layers that have any lines, in the order of work. Operations that share a layer stand together.
    pub fn layers<'m>(&self, machine: &'m Machine) -> Vec<(&'m Layer, Vec<&Line<'a>>)> {
        let mut layers: Vec<(&Layer, Vec<&Line<'a>>)> = Vec::new();
        for line in &self.lines {
            let layer = &machine.layers[line.operation];
            match layers.iter_mut().find(|it| it.0 == layer) {
                Some(known) => known.1.push(line),
                None => layers.push((layer, vec![line])),
            }
        }
        layers
    }
}

/// A coordinate with the decimals of drawings.
pub(super) fn coordinate(value: f64) -> String {
    decimal(value, DECIMALS)
}

/// A number with a fixed number of decimals and no negative zero.
pub(super) fn decimal(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    match text.strip_prefix('-') {
        Some(digits) if digits.bytes().all(|b| b == b'0' || b == b'.') => digits.into(),
        _ => text,
    }
}

/// A number as short as it can be with at most the decimals of drawings: sizes of pages, widths of lines.
pub(super) fn short(value: f64) -> String {
    let text = coordinate(value);
    text.trim_end_matches('0').trim_end_matches('.').into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_fixed_decimals_and_no_negative_zero() {
        assert_eq!(decimal(-0.00001, 3), "0.000");
        assert_eq!(decimal(-0.0006, 3), "-0.001");
        assert_eq!(decimal(12.3456, 3), "12.346");
        assert_eq!(short(420.0), "420");
        assert_eq!(short(0.25), "0.25");
        assert_eq!(short(1000.0), "1000");
    }
}
