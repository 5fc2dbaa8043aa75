//! A picture of a sheet: the stock with its margin, the parts in their colours, every line in the colour of its operation.
use resvg::tiny_skia::{
    Color, FillRule, LineCap, LineJoin, Paint, Path, PathBuilder, Pixmap, Rect, Stroke, StrokeDash, Transform,
};

use super::{LARGEST, RenderError, Rgb, encode};
use crate::{
    geom::{Box2, Vec2},
    model::{Operation, Part, Sheet},
};

/// How to draw a sheet.
#[derive(Clone, Copy)]
pub struct SheetStyle<'a> {
    /// Longer side of the stock, pixels.
    pub pixels: u32,
    /// Line colour of an operation.
    pub line: &'a dyn Fn(Operation) -> Rgb,
    /// Colour of a part, by its index on the sheet.
    pub fill: &'a dyn Fn(usize) -> Rgb,
    /// Kept free along the edges, mm; drawn as a faint dashed line.
    pub margin: f64,
}

/// White space around the stock, as a share of its longer side.
const BORDER: f64 = 0.02;
/// How far the colour of a part is moved towards white.
const PALER: f64 = 0.55;
const DESK: Rgb = [0xe9, 0xec, 0xf0];
const EDGE: Rgb = [0x8a, 0x93, 0x9e];

/// A PNG of a sheet.
pub fn sheet(sheet: &Sheet, style: &SheetStyle<'_>) -> Result<Vec<u8>, RenderError> {
    let (pixmap, place) = desk(&Box2 { min: Vec2::zeros(), max: sheet.size }, style.pixels)?;
    let mut canvas = Canvas { pixmap, place: &place };

    canvas.page(Vec2::zeros(), sheet.size, Some([0xff; 3]), EDGE, false);
    if style.margin > 0.0 {
        let margin = Vec2::repeat(style.margin);
        canvas.page(margin, sheet.size - margin, None, [0xd0, 0xd5, 0xdb], true);
    }
    for (i, part) in sheet.parts.iter().enumerate() {
        canvas.fill(part, (style.fill)(i));
    }
    // Cuts last, so that they lie over marks that touch them; all in order of work.
    let mut lines: Vec<_> = sheet.parts.iter().flat_map(Part::lines).collect();
    lines.sort_by_key(|it| it.operation.is_cut());
    for line in lines {
        let width = if line.operation.is_cut() { 1.8 } else { 1.2 };
        canvas.stroke(&outline([(line.points, line.closed)], &place), (style.line)(line.operation), width, None);
    }
    encode(&canvas.pixmap)
}

/// A PNG of lines, in the order in which they are to lie over each other, `pixels` along the longer side.
pub fn lines(lines: &[(Vec<Vec2>, Rgb)], pixels: u32) -> Result<Vec<u8>, RenderError> {
    let bounds = Box2::of(lines.iter().flat_map(|it| &it.0));
    let (pixmap, place) = desk(&bounds, pixels)?;
    let mut canvas = Canvas { pixmap, place: &place };
    canvas.page(bounds.min, bounds.max, Some([0xff; 3]), EDGE, false);
    for (points, rgb) in lines {
        canvas.stroke(&outline([(points.as_slice(), false)], &place), *rgb, 1.2, None);
    }
    encode(&canvas.pixmap)
}

/// An empty picture of a box with a border, and where a point of the plane lies in it.
fn desk(bounds: &Box2, pixels: u32) -> Result<(Pixmap, impl Fn(Vec2) -> Vec2 + use<>), RenderError> {
    let longer = bounds.size().amax();
    let scale = f64::from(pixels) / longer;
    let border = BORDER * longer;
    let size = (bounds.size() + Vec2::repeat(2.0 * border)) * scale;
    let (width, height) = (size.x.ceil() as u32, size.y.ceil() as u32);
    let refused = || RenderError::Size { width, height };
    if width > LARGEST || height > LARGEST {
        return Err(refused());
    }
    let mut pixmap = Pixmap::new(width, height).ok_or_else(refused)?;
    pixmap.fill(color(DESK));
    // The plane has y up, pictures down.
    let (left, top) = (bounds.min.x - border, bounds.max.y + border);
    Ok((pixmap, move |point: Vec2| Vec2::new(point.x - left, top - point.y) * scale))
}

fn color([r, g, b]: Rgb) -> Color {
    Color::from_rgba8(r, g, b, u8::MAX)
}

/// A path through points in picture coordinates; `None` where nothing is left to draw.
fn outline<'p>(lines: impl IntoIterator<Item = (&'p [Vec2], bool)>, place: &dyn Fn(Vec2) -> Vec2) -> Option<Path> {
    let mut builder = PathBuilder::new();
    for (points, closed) in lines {
        for (i, point) in points.iter().enumerate() {
            let point = place(*point);
            let (x, y) = (point.x as f32, point.y as f32);
            if i == 0 { builder.move_to(x, y) } else { builder.line_to(x, y) }
        }
        if closed {
            builder.close();
        }
    }
    builder.finish()
}

struct Canvas<'a> {
    pixmap: Pixmap,
    place: &'a dyn Fn(Vec2) -> Vec2,
}

impl Canvas<'_> {
    fn paint(rgb: Rgb) -> Paint<'static> {
        let mut paint = Paint::default();
        paint.set_color(color(rgb));
        paint.anti_alias = true;
        paint
    }

    fn stroke(&mut self, path: &Option<Path>, rgb: Rgb, width: f32, dash: Option<StrokeDash>) {
        let Some(path) = path else { return };
        let stroke = Stroke { width, dash, line_cap: LineCap::Round, line_join: LineJoin::Round, ..Stroke::default() };
        self.pixmap.stroke_path(path, &Self::paint(rgb), &stroke, Transform::identity(), None);
    }

    /// Fills a part, lightly, so that every line shows on it.
    fn fill(&mut self, part: &Part, rgb: Rgb) {
        let rgb = rgb.map(|it| it + (f64::from(255 - it) * PALER).round() as u8);
        if let Some(path) = outline(part.contours.iter().map(|it| (it.as_slice(), true)), self.place) {
            self.pixmap.fill_path(&path, &Self::paint(rgb), FillRule::EvenOdd, Transform::identity(), None);
        }
    }

    /// A rectangle between two corners in sheet coordinates.
    fn page(&mut self, low: Vec2, high: Vec2, fill: Option<Rgb>, edge: Rgb, dashed: bool) {
        let (a, b) = ((self.place)(low), (self.place)(high));
        let Some(rect) = Rect::from_ltrb(a.x as f32, b.y as f32, b.x as f32, a.y as f32) else { return };
        if let Some(fill) = fill {
            self.pixmap.fill_rect(rect, &Self::paint(fill), Transform::identity(), None);
        }
        let dash = if dashed { StrokeDash::new(vec![6.0, 5.0], 0.0) } else { None };
        self.stroke(&Some(PathBuilder::from_rect(rect)), edge, 1.0, dash);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Mark, Placement};

    #[test]
    fn a_sheet_shows_parts_holes_and_lines_in_their_colours() {
        let square = |low: f64, high: f64| vec![(low, low), (high, low), (high, high), (low, high)];
        let points = |list: Vec<(f64, f64)>| list.into_iter().map(|(x, y)| Vec2::new(x, y)).collect::<Vec<_>>();
        let mut hole = points(square(40.0, 60.0));
        hole.reverse();
        let part = Part {
            name: "A".into(),
            contours: vec![points(square(20.0, 80.0)), hole],
            marks: vec![Mark {
                operation: Operation::ScoreValley,
                points: points(vec![(20.0, 30.1), (80.0, 30.1)]),
                closed: false,
            }],
        };
        let placements = vec![Placement { part: 0, angle: 0.0, offset: Vec2::zeros() }];
        let page = Sheet { size: Vec2::new(200.0, 100.0), parts: vec![part], placements };
        let line = |operation: Operation| if operation.is_cut() { [255, 0, 0] } else { [0, 0, 255] };
        let style = SheetStyle { pixels: 1000, line: &line, fill: &|_| [0, 200, 0], margin: 5.0 };
        let picture = Pixmap::decode_png(&sheet(&page, &style).unwrap()).unwrap();
        assert_eq!((picture.width(), picture.height()), (1040, 540));
        let at = |x: f64, y: f64| {
            let pixel = picture.pixel((20.0 + 5.0 * x) as u32, (20.0 + 5.0 * (100.0 - y)) as u32).unwrap();
            [pixel.red(), pixel.green(), pixel.blue()]
        };
        assert_eq!(at(25.0, 25.0), [140, 230, 140], "inside the part");
        assert_eq!(at(50.0, 50.0), [255, 255, 255], "in its hole");
        assert_eq!(at(150.0, 50.0), [255, 255, 255], "beside it");
        assert_eq!(at(-2.0, 50.0), DESK, "off the sheet");
        assert_eq!(at(50.0, 20.0), [255, 0, 0], "on its outline, in the lower half: y is up");
        assert_eq!(at(50.0, 30.1), [0, 0, 255], "on the fold");
        assert!(matches!(sheet(&page, &SheetStyle { pixels: 100_000, ..style }), Err(RenderError::Size { .. })));
    }
}
