//! Lines of a DXF, in millimetres, through the `dxf` crate.
use std::collections::BTreeMap;

use dxf::{
    Color, Point,
    entities::EntityType,
    enums::{DrawingUnits, Units},
};

use super::drawing::{Drawing, DrawingError, DrawnLine, arc};
use crate::geom::Vec2;

/// Reads LINE, LWPOLYLINE, POLYLINE, CIRCLE and ARC of model space; other entities are counted in
/// [`Drawing::ignored`].
pub fn read_dxf(mut bytes: &[u8]) -> Result<Drawing, DrawingError> {
    let file = dxf::Drawing::load(&mut bytes).map_err(|error| DrawingError::Dxf(error.to_string()))?;
    let scale = match (file.header.default_drawing_units, file.header.drawing_units) {
        (Units::Millimeters, _) | (Units::Unitless, DrawingUnits::Metric) => 1.0,
        (Units::Centimeters, _) => 10.0,
        (Units::Meters, _) => 1000.0,
        (Units::Inches, _) | (Units::Unitless, DrawingUnits::English) => 25.4,
        (Units::Feet, _) => 304.8,
        (other, _) => return Err(DrawingError::Units(format!("{other:?}"))),
    };
    let at = |point: &Point| Vec2::new(point.x, point.y) * scale;
    let mut lines = Vec::new();
    let mut ignored: BTreeMap<String, usize> = BTreeMap::new();
    for entity in file.entities() {
        let (points, closed) = match &entity.specific {
            EntityType::Line(line) => (vec![at(&line.p1), at(&line.p2)], false),
            EntityType::LwPolyline(line) => {
                let corners = line.vertices.iter().map(|v| (Vec2::new(v.x, v.y) * scale, v.bulge));
                (bulged(corners, line.is_closed()), line.is_closed())
            }
            EntityType::Polyline(line) => {
                let corners = line.vertices().map(|v| (at(&v.location), v.bulge));
                (bulged(corners, line.is_closed()), line.is_closed())
            }
            EntityType::Circle(circle) => {
                (arc(at(&circle.center), circle.radius * scale, 0.0, std::f64::consts::TAU).collect(), true)
            }
            EntityType::Arc(it) => {
                let (center, radius) = (at(&it.center), it.radius * scale);
                let start = it.start_angle.to_radians();
                // A full turn is written as 0 to 360.
                let sweep = (it.end_angle - it.start_angle).rem_euclid(360.0).to_radians();
                let sweep = if sweep == 0.0 { std::f64::consts::TAU } else { sweep };
                let first = center + radius * Vec2::new(start.cos(), start.sin());
                (std::iter::once(first).chain(arc(center, radius, start, sweep)).collect(), false)
            }
            other => {
                let name = format!("{other:?}");
                let name = name.split('(').next().unwrap_or_default().to_uppercase();
                *ignored.entry(name).or_default() += 1;
                continue;
            }
        };
        lines.push(DrawnLine {
            layer: entity.common.layer.clone(),
            color: color(&entity.common.color),
            points,
            closed,
        });
    }
    let ignored = ignored.into_iter().map(|(name, count)| format!("{count} {name}")).collect();
    let measured = file.header.default_drawing_units != Units::Unitless;
    Ok(Drawing { size: None, measured, lines, ignored })
}

/// The first colours of the AutoCAD index; the others, and those of layer or block, are `None`.
fn color(color: &Color) -> Option<[u8; 3]> {
    const FIRST: [[u8; 3]; 7] =
        [[255, 0, 0], [255, 255, 0], [0, 255, 0], [0, 255, 255], [0, 0, 255], [255, 0, 255], [0, 0, 0]];
    FIRST.get(usize::from(color.index()?).checked_sub(1)?).copied()
}

/// Points of a polyline whose segments may be arcs: the bulge is the tangent of a quarter of the arc's angle, positive
/// counter-clockwise.
fn bulged(corners: impl Iterator<Item = (Vec2, f64)>, closed: bool) -> Vec<Vec2> {
    let corners: Vec<(Vec2, f64)> = corners.collect();
    let mut points = Vec::with_capacity(corners.len());
    for (i, &(from, bulge)) in corners.iter().enumerate() {
        points.push(from);
        let last = i + 1 == corners.len();
        if bulge == 0.0 || (last && !closed) {
            continue;
        }
        let to = corners[(i + 1) % corners.len()].0;
        let chord = to - from;
        let sweep = 4.0 * bulge.atan();
        let center = (from + to) / 2.0 + Vec2::new(-chord.y, chord.x) * ((1.0 - bulge * bulge) / (4.0 * bulge));
        let start = from - center;
        points.extend(arc(center, start.norm(), start.y.atan2(start.x), sweep));
        // The last point of the arc is the next corner.
        points.pop();
    }
    points
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bulges_are_arcs() {
        // Two half circles make a circle of radius 2.
        let corners = [(Vec2::new(-2.0, 0.0), 1.0), (Vec2::new(2.0, 0.0), 1.0)];
        let points = bulged(corners.into_iter(), true);
        assert!(points.len() > 20);
        for point in &points {
            assert!((point.norm() - 2.0).abs() < 1e-12);
        }
        // Counter-clockwise from the left: the lower half comes first.
        assert!(points[1].y < 0.0);
        let area = crate::geom::signed_area(&points);
        assert!((area / (std::f64::consts::PI * 4.0) - 1.0).abs() < 0.01, "{area}");
    }
}
