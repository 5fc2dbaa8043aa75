//! Predicates and measures of polygons. Signs are exact (adaptive arithmetic), lengths are plain f64.
use robust::{Coord, orient2d};

use super::{Box2, Vec2};

fn coord(p: Vec2) -> Coord<f64> {
    Coord { x: p.x, y: p.y }
}

/// Twice the signed area of the triangle `a b c`, with an exact sign: positive when counter-clockwise, zero when
/// collinear (Shewchuk 1997).
pub fn orientation(a: Vec2, b: Vec2, c: Vec2) -> f64 {
    orient2d(coord(a), coord(b), coord(c))
}

/// Whether `p`, known to be collinear with `a b`, lies on that closed segment.
fn within(a: Vec2, b: Vec2, p: Vec2) -> bool {
    (a.x.min(b.x)..=a.x.max(b.x)).contains(&p.x) && (a.y.min(b.y)..=a.y.max(b.y)).contains(&p.y)
}

/// Whether two closed segments share a point; exact.
pub fn segments_meet(a: Vec2, b: Vec2, c: Vec2, d: Vec2) -> bool {
    let (ca, cb) = (orientation(c, d, a), orientation(c, d, b));
    let (ac, ad) = (orientation(a, b, c), orientation(a, b, d));
    let straddles = |x: f64, y: f64| (x > 0.0 && y < 0.0) || (x < 0.0 && y > 0.0);
    (straddles(ca, cb) && straddles(ac, ad))
        || (ac == 0.0 && within(a, b, c))
        || (ad == 0.0 && within(a, b, d))
        || (ca == 0.0 && within(c, d, a))
        || (cb == 0.0 && within(c, d, b))
}

/// The point of segment `a b` nearest to `p`.
pub fn nearest_on_segment(p: Vec2, a: Vec2, b: Vec2) -> Vec2 {
    let along = b - a;
    let length = along.norm_squared();
    if length == 0.0 {
        return a;
    }
    a + along * ((p - a).dot(&along) / length).clamp(0.0, 1.0)
}

/// Distance from `p` to segment `a b`, mm.
pub fn point_segment_distance(p: Vec2, a: Vec2, b: Vec2) -> f64 {
    (p - nearest_on_segment(p, a, b)).norm()
}

/// Distance of two closed segments, mm; 0 when they meet.
pub fn segment_distance(a: Vec2, b: Vec2, c: Vec2, d: Vec2) -> f64 {
    if segments_meet(a, b, c, d) {
        return 0.0;
    }
    point_segment_distance(a, c, d)
        .min(point_segment_distance(b, c, d))
        .min(point_segment_distance(c, a, b))
        .min(point_segment_distance(d, a, b))
}

/// The edges of a closed contour, the last one back to its first point.
pub fn edges(contour: &[Vec2]) -> impl ExactSizeIterator<Item = (Vec2, Vec2)> + Clone + '_ {
    (0..contour.len()).map(|i| (contour[i], contour[(i + 1) % contour.len()]))
}

/// Whether `p` lies inside the region that `contours` bound by the even-odd rule (an outline and its holes). Points on
/// an edge may come out either way. Crossings are counted exactly, so no vertex is hit twice.
pub fn contains(contours: &[Vec<Vec2>], p: Vec2) -> bool {
    contours.iter().filter(|it| contour_contains(it, p)).count() % 2 == 1
}

/// Whether `p` lies inside one closed contour, by the even-odd rule.
pub fn contour_contains(contour: &[Vec2], p: Vec2) -> bool {
    let mut inside = false;
    for (a, b) in edges(contour) {
        if (a.y > p.y) != (b.y > p.y) {
            // The ray to +x crosses the edge when `p` lies to the left of the edge taken upwards.
            let (low, high) = if a.y < b.y { (a, b) } else { (b, a) };
            inside ^= orientation(low, high, p) > 0.0;
        }
    }
    inside
}

/// Signed area of an outline and its holes when holes are clockwise, mm².
pub fn area(contours: &[Vec<Vec2>]) -> f64 {
    contours.iter().map(|it| super::signed_area(it)).sum()
}

/// Short side of the rectangle with this area and perimeter, mm: how wide a strip is, however it winds. Where there is no
/// such rectangle, because the shape is rounder than a square, the side of the square with this area.
pub fn strip_width(area: f64, perimeter: f64) -> f64 {
    let half = 0.5 * perimeter;
    let square = half * half - 4.0 * area;
    // 2 area / (half + √…) is the smaller root without cancellation.
    if square > 0.0 { 2.0 * area / (half + square.sqrt()) } else { area.sqrt() }
}

/// Convex hull, counter-clockwise, without collinear points (Andrew's monotone chain).
pub fn convex_hull(points: &[Vec2]) -> Vec<Vec2> {
    let mut sorted = points.to_vec();
    sorted.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    sorted.dedup();
    if sorted.len() < 3 {
        return sorted;
    }
    let chain = |points: &mut dyn Iterator<Item = Vec2>| {
        let mut chain: Vec<Vec2> = Vec::new();
        for p in points {
            while let [.., a, b] = chain[..] {
                if orientation(a, b, p) > 0.0 {
                    break;
                }
                chain.pop();
            }
            chain.push(p);
        }
        chain.pop();
        chain
    };
    let mut hull = chain(&mut sorted.iter().copied());
    hull.extend(chain(&mut sorted.iter().rev().copied()));
    hull
}

/// Rotation that lays the box of least area around `points` parallel to the axes with its longer side along x, radians
/// in (−π, π]. One side of that box lies on an edge of the hull (Freeman and Shapira 1975).
pub fn least_box_angle(points: &[Vec2]) -> f64 {
    let hull = convex_hull(points);
    let mut best = (f64::INFINITY, 0.0);
    for (a, b) in edges(&hull) {
        let angle = -(b - a).y.atan2((b - a).x);
        let size = bounds_turned(&hull, angle).size();
        if size.x * size.y < best.0 {
            let upright = size.y > size.x;
            best = (size.x * size.y, if upright { angle - std::f64::consts::FRAC_PI_2 } else { angle });
        }
    }
    let turn = std::f64::consts::TAU;
    if best.1 <= -std::f64::consts::PI { best.1 + turn } else { best.1 }
}

/// How far points exceed a rectangle of `size` in the rotation in which they exceed it least: the larger of width over
/// `size[0]` and height over `size[1]`, and that rotation, radians in [0, π). Rotations are tried in steps of 2°; the first
/// one that fits ends the search, so a ratio up to 1 is not the least.
pub fn least_excess(points: &[Vec2], size: [f64; 2]) -> (f64, f64) {
    const ROTATIONS: usize = 90;
    let mut best = (f64::INFINITY, 0.0);
    for k in 0..ROTATIONS {
        let angle = std::f64::consts::PI * k as f64 / ROTATIONS as f64;
        let extent = bounds_turned(points, angle).size();
        let excess = (extent.x / size[0]).max(extent.y / size[1]);
        if excess < best.0 {
            best = (excess, angle);
        }
        if excess <= 1.0 {
            break;
        }
    }
    best
}

/// Box around `points` turned by `angle` about the origin.
pub fn bounds_turned(points: &[Vec2], angle: f64) -> Box2 {
    let mut bounds = Box2::empty();
    for &p in points {
        bounds.grow(&turned(p, angle));
    }
    bounds
}

/// `p` turned by `angle` about the origin, counter-clockwise; whole quarter turns are exact.
pub fn turned(p: Vec2, angle: f64) -> Vec2 {
    let (sin, cos) = sin_cos(angle);
    Vec2::new(cos * p.x - sin * p.y, sin * p.x + cos * p.y)
}

/// Sine and cosine, exact for multiples of a quarter turn as far as `angle` itself is one in f64.
fn sin_cos(angle: f64) -> (f64, f64) {
    let quarters = angle / std::f64::consts::FRAC_PI_2;
    if quarters != quarters.round() {
        return angle.sin_cos();
    }
    match quarters.rem_euclid(4.0) as u8 {
        0 => (0.0, 1.0),
        1 => (1.0, 0.0),
        2 => (0.0, -1.0),
        _ => (-1.0, 0.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{FRAC_PI_2, PI};

    fn v(x: f64, y: f64) -> Vec2 {
        Vec2::new(x, y)
    }

    #[test]
    fn segments_that_touch_meet() {
        let cases = [
            (v(0., 0.), v(2., 2.), v(0., 2.), v(2., 0.), true),
            (v(0., 0.), v(1., 0.), v(1., 0.), v(2., 5.), true),
            (v(0., 0.), v(4., 0.), v(2., 0.), v(2., 5.), true),
            (v(0., 0.), v(4., 0.), v(3., 0.), v(9., 0.), true),
            (v(0., 0.), v(4., 0.), v(5., 0.), v(9., 0.), false),
            (v(0., 0.), v(4., 0.), v(2., 1e-150), v(2., 5.), false),
            (v(0., 0.), v(1., 1.), v(0., 1e-16), v(1., 1. + 1e-15), false),
        ];
        for (a, b, c, d, meet) in cases {
            assert_eq!(segments_meet(a, b, c, d), meet, "{a} {b} {c} {d}");
            assert_eq!(segments_meet(d, c, b, a), meet, "{a} {b} {c} {d} turned round");
            assert_eq!(segment_distance(a, b, c, d) == 0.0, meet);
        }
        assert_eq!(segment_distance(v(0., 0.), v(4., 0.), v(7., 4.), v(9., 9.)), 5.0);
    }

    #[test]
    fn contains_counts_vertices_once() {
        let diamond = vec![v(0., -2.), v(2., 0.), v(0., 2.), v(-2., 0.)];
        let hole = vec![v(-0.5, 0.), v(0., 0.5), v(0.5, 0.), v(0., -0.5)];
        let region = [diamond, hole];
        for (p, inside) in [(v(-3., 0.), false), (v(-1., 0.), true), (v(0., 0.), false), (v(1., 0.), true)] {
            assert_eq!(contains(&region, p), inside, "{p}");
        }
        assert!((area(&region) - 7.5).abs() < 1e-12);
    }

    #[test]
    fn least_box_of_a_turned_rectangle() {
        for k in 0..24 {
            let angle = k as f64 * 0.3;
            let points: Vec<Vec2> =
                [v(0., 0.), v(7., 0.), v(7., 2.), v(3., 1.), v(0., 2.)].map(|p| turned(p, angle)).to_vec();
            let size = bounds_turned(&points, least_box_angle(&points)).size();
            assert!((size - v(7., 2.)).norm() < 1e-9, "{size}");
        }
        assert_eq!(turned(v(3., 1.), FRAC_PI_2), v(-1., 3.));
        assert_eq!(turned(v(3., 1.), PI), v(-3., -1.));
        assert_eq!(turned(v(3., 1.), -FRAC_PI_2), v(1., -3.));
    }
}
