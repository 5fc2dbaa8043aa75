//! How a strip bends across its rulings: angle and radius.
use super::{
    border::Border,
    decompose::{Decomposition, Link},
    merge::{area, normal},
};
use crate::geom::{Vec2, angle_between, cross2};

/// Bend and radii of a chord.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Bend {
    /// Radians, positive where convex.
    pub(super) angle: f64,
    /// mm, at the start, the middle and the end.
    pub(super) radius: [f64; 3],
}

/// Bends of all chords.
///
/// A panel of a smooth surface stands for the arc above it, so the normal turns by the bend over half the width of the
/// panels on both sides. Between the next rulings of a strip it turns by the bend and half of each of theirs, over the
/// whole width of both panels: radius = (width left + width right) / (bend left / 2 + bend + bend right / 2) at any point
/// of the ruling, across it. At the ends of a strip it is (width left + width right) / (2 bend), with the width of the
/// other side, or less, for a panel that is not between two chords.
pub(super) fn bends(border: &Border, it: &Decomposition) -> Vec<Bend> {
    let normals: Vec<_> = it.panels.iter().map(|p| normal(border, p)).collect();
    let angle = |link: &Link| {
        let [n, m] = link.panels.map(|p| normals[p]);
        let direction = border.xyz[link.ends[1]] - border.xyz[link.ends[0]];
        angle_between(n, m).copysign(n.cross(&m).dot(&direction))
    };
    let mut sides: Vec<Vec<usize>> = vec![Vec::new(); it.panels.len()];
    for (c, link) in it.chords.iter().enumerate() {
        for p in link.panels {
            sides[p].push(c);
        }
    }
    let bend = |(c, link): (usize, &Link)| {
        let [a, b] = link.ends.map(|i| border.uv[i]);
        let own = angle(link);
        let next: [Option<&Link>; 2] = link.panels.map(|p| match sides[p][..] {
            [x, y] => Some(&it.chords[if x == c { y } else { x }]),
            _ => None,
        });
        let mean = link.panels.map(|p| area(border, &it.panels[p]) / (b - a).norm());
        let radius = [0.0, 0.5, 1.0].map(|t| {
            let p = a + (b - a) * t;
            match next.map(|it| Some((it?, across(p, b - a, it?.ends.map(|i| border.uv[i]))?))) {
                [Some((l, x)), Some((r, y))] => (x + y) / (own + 0.5 * (angle(l) + angle(r))).abs(),
                [Some((_, x)), None] => (x + x.min(mean[1])) / (2.0 * own.abs()),
                [None, Some((_, y))] => (y + y.min(mean[0])) / (2.0 * own.abs()),
                [None, None] => (mean[0] + mean[1]) / (2.0 * own.abs()),
            }
        });
        Bend { angle: own, radius }
    };
    it.chords.iter().enumerate().map(bend).collect()
}

/// Distance from `p` across `line` to another line; `None` where they are parallel to that direction.
fn across(p: Vec2, line: Vec2, [a, b]: [Vec2; 2]) -> Option<f64> {
    let normal = Vec2::new(-line.y, line.x).normalize();
    let along = b - a;
    let denominator = cross2(normal, along);
    if denominator.abs() <= 1e-9 * along.norm() {
        return None;
    }
    Some((cross2(a - p, along) / denominator).abs())
}
