//! Polylines by arc length, and removal of points that carry no shape.
use std::cmp::Ordering;

use nalgebra::SVector;

use super::{Vec2, polygon::point_segment_distance};

/// A polyline measured along itself.
#[derive(Debug, Clone)]
pub struct ArcLength {
    points: Vec<Vec2>,
    along: Vec<f64>,
}

impl ArcLength {
    /// Measures an open polyline; `None` when it has fewer than two points or no length.
    pub fn new(points: Vec<Vec2>) -> Option<Self> {
        let mut along = vec![0.0];
        for w in points.windows(2) {
            along.push(along[along.len() - 1] + (w[1] - w[0]).norm());
        }
        (along[along.len() - 1] > 0.0).then_some(Self { points, along })
    }

    /// Length, mm.
    pub fn length(&self) -> f64 {
        self.along[self.along.len() - 1]
    }

    /// Distance of every point from the start, mm.
    pub fn along(&self) -> &[f64] {
        &self.along
    }

    /// Point at distance `s` from the start (clamped to the line) and the unit direction of travel there.
    pub fn at(&self, s: f64) -> (Vec2, Vec2) {
        let last = self.points.len() - 1;
        // The first segment that ends at or after `s`; segments without length are stepped over.
        let mut k = self.along.partition_point(|&it| it < s).clamp(1, last);
        while k < last && self.along[k] == self.along[k - 1] {
            k += 1;
        }
        while k > 1 && self.along[k] == self.along[k - 1] {
            k -= 1;
        }
        let (a, b) = (self.points[k - 1], self.points[k]);
        let length = self.along[k] - self.along[k - 1];
        let t = ((s - self.along[k - 1]) / length).clamp(0.0, 1.0);
        (a + (b - a) * t, (b - a) / length)
    }

    /// The part from one distance to another: the two places and the points between them.
    pub fn stretch(&self, from: f64, to: f64) -> Vec<Vec2> {
        let between = self.along.iter().zip(&self.points).filter(|(s, _)| from < **s && **s < to).map(|it| *it.1);
        std::iter::once(self.at(from).0).chain(between).chain([self.at(to).0]).collect()
    }
}

/// A line with a point between every two neighbours, on the cubic through four points (on the parabola through three at its ends):
/// the four-point scheme of Dyn, Levin and Gregory (1987). Point k becomes point 2 k.
pub fn subdivided<const D: usize>(line: &[SVector<f64, D>]) -> Vec<SVector<f64, D>> {
    let n = line.len();
    let middle = |k: usize| match (k.checked_sub(1), k + 2 < n) {
        (Some(before), true) => ((line[k] + line[k + 1]) * 9.0 - line[before] - line[k + 2]) / 16.0,
        (None, true) => (line[0] * 3.0 + line[1] * 6.0 - line[2]) / 8.0,
        (Some(before), false) => (line[n - 1] * 3.0 + line[n - 2] * 6.0 - line[before]) / 8.0,
        (None, false) => (line[k] + line[k + 1]) / 2.0,
    };
    (0..2 * n - 1).map(|k| if k % 2 == 0 { line[k / 2] } else { middle(k / 2) }).collect()
}

/// Indices that remain when neighbours are at least `distance` apart: of two that are nearer, the one goes that lies nearer
/// to the line between its own neighbours, but never one that `keep` marks before one that it does not, and never an end
/// of an open line.
pub fn merge_near(points: &[Vec2], closed: bool, distance: f64, keep: &dyn Fn(usize) -> bool) -> Vec<usize> {
    let mut kept: Vec<usize> = (0..points.len()).collect();
    let mut k = 0;
    while k < kept.len() && kept.len() > 2 {
        let n = kept.len();
        let next = (k + 1) % n;
        let apart = (points[kept[k]] - points[kept[next]]).norm() >= distance;
        if apart || (!closed && next == 0) {
            k += 1;
            continue;
        }
        let end = |at: usize| !closed && (at == 0 || at == n - 1);
        let shape = |at: usize| {
            let [a, p, b] = [(at + n - 1) % n, at, (at + 1) % n].map(|i| points[kept[i]]);
            point_segment_distance(p, a, b)
        };
        let rank = |at: usize| (end(at), keep(kept[at]));
        let first_goes = match rank(k).cmp(&rank(next)) {
            Ordering::Less => true,
            Ordering::Greater => false,
            Ordering::Equal => shape(k) < shape(next),
        };
        let loser = if first_goes { k } else { next };
        kept.remove(loser);
        // The neighbour before may be too near now.
        k = k.saturating_sub(1);
    }
    kept
}

/// Indices that remain when points within `tolerance` of the chord of their neighbours are dropped (Douglas and Peucker
/// 1973); points marked by `keep` and the ends of an open line always remain. A closed line without marks starts from
/// its two points farthest apart along the scan, so that the result does not depend on where it begins.
pub fn simplify(points: &[Vec2], closed: bool, tolerance: f64, keep: &dyn Fn(usize) -> bool) -> Vec<usize> {
    let n = points.len();
    if n < 3 {
        return (0..n).collect();
    }
    let mut fixed: Vec<usize> = (0..n).filter(|&i| keep(i) || (!closed && (i == 0 || i == n - 1))).collect();
    if closed && fixed.len() < 2 {
        let farthest = |from: usize| {
            let distance = |&i: &usize| (points[i] - points[from]).norm();
            (0..n).max_by(|i, j| distance(i).total_cmp(&distance(j)).then(j.cmp(i))).expect("there are points")
        };
        let first = fixed.first().copied().unwrap_or_else(|| farthest(farthest(0)));
        fixed = vec![first, farthest(first)];
        fixed.sort_unstable();
    }
    let mut used = vec![false; n];
    for &i in &fixed {
        used[i] = true;
    }
    let mut spans: Vec<(usize, usize)> = fixed.windows(2).map(|w| (w[0], w[1])).collect();
    if closed {
        spans.push((fixed[fixed.len() - 1], fixed[0] + n));
    }
    while let Some((from, to)) = spans.pop() {
        let (a, b) = (points[from % n], points[to % n]);
        let farthest = (from + 1..to)
            .map(|i| (point_segment_distance(points[i % n], a, b), i))
            .fold((tolerance, usize::MAX), |best, it| if it.0 > best.0 { it } else { best });
        if farthest.1 != usize::MAX {
            used[farthest.1 % n] = true;
            spans.extend([(from, farthest.1), (farthest.1, to)]);
        }
    }
    (0..n).filter(|&i| used[i]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn v(x: f64, y: f64) -> Vec2 {
        Vec2::new(x, y)
    }

    #[test]
    fn walks_by_arc_length_over_repeated_points() {
        let line = ArcLength::new(vec![v(0., 0.), v(0., 0.), v(3., 0.), v(3., 0.), v(3., 4.), v(3., 4.)]).unwrap();
        assert_eq!(line.length(), 7.0);
        for (s, p, d) in [
            (-1.0, v(0., 0.), v(1., 0.)),
            (0.0, v(0., 0.), v(1., 0.)),
            (3.0, v(3., 0.), v(1., 0.)),
            (5.0, v(3., 2.), v(0., 1.)),
            (9.0, v(3., 4.), v(0., 1.)),
        ] {
            assert_eq!(line.at(s), (p, d), "at {s}");
        }
        assert!(ArcLength::new(vec![v(1., 1.), v(1., 1.)]).is_none());
    }

    #[test]
    fn merging_prefers_marked_points() {
        let points = [v(0., 0.), v(1., 0.), v(1.01, 0.), v(1., 1.), v(0., 1.), v(0., 0.01)];
        assert_eq!(merge_near(&points, true, 0.02, &|_| false), [0, 2, 3, 4]);
        assert_eq!(merge_near(&points, true, 0.02, &|i| i == 1 || i == 5), [1, 3, 4, 5]);
        assert_eq!(merge_near(&points, true, 0.02, &|i| i == 1 || i == 2), [0, 2, 3, 4]);
        assert_eq!(merge_near(&points, false, 0.02, &|_| false), [0, 2, 3, 4, 5]);
        assert_eq!(merge_near(&[v(0., 0.), v(0., 0.001)], true, 0.02, &|_| false).len(), 2);
    }

    #[test]
    fn simplified_lines_stay_within_the_tolerance() {
        let circle: Vec<Vec2> =
            (0..720).map(|i| (i as f64).to_radians() / 2.0).map(|t| v(t.cos(), t.sin()) * 50.0).collect();
        let kept = simplify(&circle, true, 0.05, &|i| i == 17);
        assert!(kept.contains(&17) && (70..140).contains(&kept.len()), "{}", kept.len());
        for (k, &from) in kept.iter().enumerate() {
            let to = kept[(k + 1) % kept.len()];
            let span = (to + 720 - from) % 720;
            for i in 0..span {
                let p = circle[(from + i) % 720];
                assert!(point_segment_distance(p, circle[from], circle[to]) <= 0.05);
            }
        }
        let square = [v(0., 0.), v(1., 0.), v(2., 0.), v(2., 2.), v(1., 2.), v(0., 2.), v(0., 1.)];
        assert_eq!(simplify(&square, true, 1e-9, &|_| false), [0, 2, 3, 5]);
        assert_eq!(simplify(&square, true, 1e-9, &|i| i == 1), [0, 1, 2, 3, 5]);
    }
}
