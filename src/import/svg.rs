//! Lines of an SVG, at the size that its page states, through usvg (which resolves styles, transforms, shapes and uses).
use resvg::{
    tiny_skia::{PathSegment, Point, Transform},
    usvg::{Group, Node, Options, Paint, Path, Tree, roxmltree::Document},
};

use super::drawing::{Drawing, DrawingError, DrawnLine, steps};
use crate::geom::Vec2;

/// CSS: 96 px are an inch.
const MM_PER_PX: f64 = 25.4 / 96.0;

/// Reads an SVG. Coordinates pass through usvg's f32 (0.1 µm at 1 m).
pub fn read_svg(bytes: &[u8]) -> Result<Drawing, DrawingError> {
    let tree = Tree::from_data(bytes, &Options::default()).map_err(|error| DrawingError::Svg(error.to_string()))?;
    let size = Vec2::new(tree.size().width().into(), tree.size().height().into()) * MM_PER_PX;
    let mut reader = Reader { height: size.y, lines: Vec::new(), others: 0 };
    reader.group(tree.root(), "");
    let ignored = if reader.others > 0 { vec![format!("{} images or texts", reader.others)] } else { Vec::new() };
    Ok(Drawing { size: Some(size), measured: measured(bytes), lines: reader.lines, ignored })
}

/// Whether the page says its width in a unit of length. A number alone and px are both: 1/96 inch in CSS, 1/72 inch in much
/// drawing software.
fn measured(bytes: &[u8]) -> bool {
    let document = std::str::from_utf8(bytes).ok().and_then(|it| Document::parse(it).ok());
    let width = document.as_ref().and_then(|it| it.root_element().attribute("width"));
    width.is_some_and(|it| ["mm", "cm", "in", "pt", "pc", "Q"].iter().any(|unit| it.trim_end().ends_with(unit)))
}

struct Reader {
    height: f64,
    lines: Vec<DrawnLine>,
    others: usize,
}

impl Reader {
    /// A group below the layer of that id; the outermost group with an id is the layer.
    fn group(&mut self, group: &Group, layer: &str) {
        let layer = if layer.is_empty() { group.id() } else { layer };
        for node in group.children() {
            match node {
                Node::Group(group) => self.group(group, layer),
                Node::Path(path) => self.path(path, layer),
                _ => self.others += 1,
            }
        }
    }

    fn path(&mut self, path: &Path, layer: &str) {
        let transform = path.abs_transform();
        let color = path.stroke().and_then(|it| match it.paint() {
            Paint::Color(it) => Some([it.red, it.green, it.blue]),
            _ => None,
        });
        let mut points: Vec<Vec2> = Vec::new();
        for segment in path.data().segments() {
            let at = |point: Point| self.place(transform, point);
            match segment {
                PathSegment::MoveTo(point) => {
                    let next = at(point);
                    self.finish(&mut points, (layer, color), false);
                    points.push(next);
                }
                PathSegment::LineTo(point) => points.push(at(point)),
                PathSegment::QuadTo(b, c) => {
                    let (Some(&a), b, c) = (points.last(), at(b), at(c)) else { continue };
                    let count = steps(2.0 * (a - 2.0 * b + c).norm());
                    points.extend(parameters(count).map(|t| a.lerp(&b, t).lerp(&b.lerp(&c, t), t)));
                }
                PathSegment::CubicTo(b, c, d) => {
                    let (Some(&a), b, c, d) = (points.last(), at(b), at(c), at(d)) else { continue };
                    let count = steps(6.0 * (a - 2.0 * b + c).norm().max((b - 2.0 * c + d).norm()));
                    points.extend(parameters(count).map(|t| {
                        let (ab, bc, cd) = (a.lerp(&b, t), b.lerp(&c, t), c.lerp(&d, t));
                        ab.lerp(&bc, t).lerp(&bc.lerp(&cd, t), t)
                    }));
                }
                PathSegment::Close => self.finish(&mut points, (layer, color), true),
            }
        }
        self.finish(&mut points, (layer, color), false);
    }

    fn place(&self, transform: Transform, point: Point) -> Vec2 {
        // In f64, because f32 would round once more.
        let (x, y) = (f64::from(point.x), f64::from(point.y));
        let row = |a: f32, b: f32, c: f32| (f64::from(a) * x + f64::from(b) * y + f64::from(c)) * MM_PER_PX;
        let x_mm = row(transform.sx, transform.kx, transform.tx);
        let y_mm = row(transform.ky, transform.sy, transform.ty);
        Vec2::new(x_mm, self.height - y_mm)
    }

    fn finish(&mut self, points: &mut Vec<Vec2>, (layer, color): (&str, Option<[u8; 3]>), closed: bool) {
        if points.len() > 1 {
            self.lines.push(DrawnLine { layer: layer.into(), color, points: std::mem::take(points), closed });
        }
        points.clear();
    }
}

fn parameters(count: usize) -> impl Iterator<Item = f64> {
    (1..=count).map(move |i| i as f64 / count as f64)
}
