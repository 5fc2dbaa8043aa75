//! Boolean operations and offsets of polygons, by i_overlay.
//!
//! Its engine works on integers: coordinates are scaled by the largest power of two that keeps everything of one call
//! within 61 bits, so the grid of a metre-sized job is finer than 1e-12 mm and results are exact to rounding in f64.
//! Outlines come out counter-clockwise, holes clockwise, each region with its outline first; points on straight runs of
//! the input may be dropped where lines meet.
use std::f64::consts::PI;

use i_overlay::{
    core::{fill_rule::FillRule, overlay_rule::OverlayRule},
    float::single::SingleFloatOverlay,
    mesh::{
        float::{
            outline::offset::OutlineOffset,
            stroke::offset::StrokeOffset,
            style::{LineCap, LineJoin, OutlineStyle, StrokeStyle},
        },
        math::MathMode,
    },
};

use super::Vec2;

/// A region: its outline counter-clockwise, then its holes clockwise.
pub type Region = Vec<Vec<Vec2>>;

type Raw = Vec<Vec<[f64; 2]>>;

/// Longest step along a rounded corner, radians: 5° keeps the chord error below 0.1 % of the radius.
const ROUND_STEP: f64 = PI / 36.0;

fn raw(contours: &[Vec<Vec2>]) -> Raw {
    contours.iter().map(|it| it.iter().map(|p| [p.x, p.y]).collect()).collect()
}

fn regions(shapes: Vec<Raw>) -> Vec<Region> {
    let point = |[x, y]: [f64; 2]| Vec2::new(x, y);
    shapes
        .into_iter()
        .map(|shape| shape.into_iter().map(|contour| contour.into_iter().map(point).collect()).collect())
        .collect()
}

fn overlay(subject: &[Vec<Vec2>], clip: &[Vec<Vec2>], rule: OverlayRule) -> Vec<Region> {
    regions(raw(subject).overlay_as::<i64>(&raw(clip), rule, FillRule::NonZero))
}

/// Points in `a` or `b` (non-zero winding). With an empty `b`, `a` made simple.
pub fn union(a: &[Vec<Vec2>], b: &[Vec<Vec2>]) -> Vec<Region> {
    overlay(a, b, OverlayRule::Union)
}

/// Points in `a` and `b` (non-zero winding).
pub fn intersection(a: &[Vec<Vec2>], b: &[Vec<Vec2>]) -> Vec<Region> {
    overlay(a, b, OverlayRule::Intersect)
}

/// Points in `a` but not in `b` (non-zero winding).
pub fn difference(a: &[Vec<Vec2>], b: &[Vec<Vec2>]) -> Vec<Region> {
    overlay(a, b, OverlayRule::Difference)
}

/// Points within `distance` of a region (negative: points farther than that from its complement), corners rounded.
pub fn offset(region: &[Vec<Vec2>], distance: f64) -> Vec<Region> {
    let style = OutlineStyle::new(distance).line_join(LineJoin::Round(ROUND_STEP)).math(MathMode::Float);
    regions(raw(region).outline_as::<i64>(&style))
}

/// Points within `radius` of open polylines.
pub fn thicken(lines: &[Vec<Vec2>], radius: f64) -> Vec<Region> {
    let cap = LineCap::Round(ROUND_STEP);
    let style = StrokeStyle::new(2.0 * radius)
        .line_join(LineJoin::Round(ROUND_STEP))
        .start_cap(cap.clone())
        .end_cap(cap)
        .math(MathMode::Float);
    regions(raw(lines).stroke_as::<i64>(style, false))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::{outline::check_outline, polygon::area};

    fn square(x: f64, y: f64, side: f64) -> Vec<Vec2> {
        [[0., 0.], [1., 0.], [1., 1.], [0., 1.]].map(|[u, v]| Vec2::new(x + u * side, y + v * side)).to_vec()
    }

    fn total(regions: &[Region]) -> f64 {
        for region in regions {
            assert_eq!(check_outline(region), Ok(()));
        }
        regions.iter().map(|it| area(it)).sum()
    }

    #[test]
    fn areas_add_up() {
        let (a, b) = ([square(0.1, 0.2, 10.0)], [square(5.1, 5.2, 10.0)]);
        let (both, common) = (total(&union(&a, &b)), total(&intersection(&a, &b)));
        assert!((both - 175.0).abs() < 1e-9 && (common - 25.0).abs() < 1e-9);
        assert!((total(&difference(&a, &b)) - 75.0).abs() < 1e-9);
        let ring = difference(&a, &[square(3.1, 3.2, 2.0)]);
        assert_eq!((ring.len(), ring[0].len()), (1, 2));
        assert!((total(&ring) - 96.0).abs() < 1e-9);
    }

    #[test]
    fn offsets_have_the_area_that_steiner_says() {
        let a = [square(0.0, 0.0, 10.0)];
        for d in [0.05, 1.0, 30.0] {
            let expected = 100.0 + 40.0 * d + PI * d * d;
            let grown = total(&offset(&a, d));
            assert!(grown <= expected && grown > expected - 2e-3 * PI * d * d, "{grown} for {expected}");
        }
        assert!((total(&offset(&a, -1.0)) - 64.0).abs() < 1e-9);
        assert!(offset(&a, -6.0).is_empty());
        let line = [vec![Vec2::new(0., 0.), Vec2::new(10., 0.)]];
        let stroke = total(&thicken(&line, 0.5));
        assert!((stroke - 10.0 - PI * 0.25).abs() < 2e-3, "{stroke}");
    }
}
