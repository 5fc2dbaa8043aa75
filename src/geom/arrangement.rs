//! The arrangement of plane curves: curves divided where they meet, and the faces between them. Which curves cross is
//! decided by exact predicates; ends that miss another curve by less than a tolerance are moved onto it, and that is told.
use std::collections::BTreeMap;

use super::{
    Box2, Vec2, cross2,
    polygon::{contour_contains, nearest_on_segment, orientation},
    segment_tree::{Segment, SegmentTree},
    signed_area,
};

/// A polyline to be arranged.
#[derive(Debug, Clone, PartialEq)]
pub struct Curve {
    /// Its points; the first is not repeated at the end of a closed one.
    pub points: Vec<Vec2>,
    /// Whether the last point joins the first.
    pub closed: bool,
    /// Curves of one kind that run on smoothly into each other become one arc.
    pub kind: u32,
}

/// A piece of a curve between two nodes, or a whole closed curve that meets nothing.
#[derive(Debug, Clone, PartialEq)]
pub struct Arc {
    /// Kind of its curve.
    pub kind: u32,
    /// The curve that it is a piece of; of several joined ones the first.
    pub curve: usize,
    /// Nodes at its ends; `None` for a closed curve without nodes.
    pub ends: Option<[usize; 2]>,
    /// Its points with both ends; the first is not repeated where there are no nodes.
    pub points: Vec<Vec2>,
    /// Face on its left.
    pub left: usize,
    /// Face on its right.
    pub right: usize,
}

/// What was not as drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Note {
    /// An end was moved onto another curve or end.
    Snapped {
        /// Where it was drawn.
        from: Vec2,
        /// How far it was moved.
        distance: f64,
    },
    /// A stretch of a curve lies on another one and was left out.
    Overlap {
        /// Middle of the stretch.
        place: Vec2,
        /// Its length.
        length: f64,
    },
}

/// Why curves have no arrangement.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum ArrangementError {
    /// A coordinate is NaN or infinite.
    #[error("point {point} of curve {curve} has a coordinate that is not a finite number: ({x}, {y})")]
    NotFinite {
        /// Index of the curve.
        curve: usize,
        /// Index of the point.
        point: usize,
        /// As given.
        x: f64,
        /// As given.
        y: f64,
    },
}

/// Curves divided where they meet.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Arrangement {
    /// Where curves end or meet.
    pub nodes: Vec<Vec2>,
    /// The pieces of the curves.
    pub arcs: Vec<Arc>,
    /// Closed boundaries of every face, with the face on their left; face 0 is the unbounded one.
    pub faces: Vec<Vec<Vec<Vec2>>>,
    /// What was moved or left out.
    pub notes: Vec<Note>,
}

/// Turn at a point of a polyline from which it is a corner and not a sample of a smooth curve, radians.
const CORNER: f64 = 0.45;

impl Arrangement {
    /// Divides `curves`. Ends within `tolerance` of each other or of a curve are joined; a curve is also divided at its corners
    /// where `corners` says so for its kind.
    pub fn new(curves: &[Curve], tolerance: f64, corners: &dyn Fn(u32) -> bool) -> Result<Self, ArrangementError> {
        let mut builder = Builder::new(curves, tolerance)?;
        builder.ends();
        builder.corners(corners);
        builder.crossings();
        let mut arcs = builder.divide();
        let mut notes = builder.notes;
        drop_overlaps(&mut arcs, tolerance, &mut notes);
        let mut out = Self { nodes: builder.nodes, arcs, faces: Vec::new(), notes };
        out.join_smooth();
        out.trace_faces();
        Ok(out)
    }

    /// Number of arc ends at every node.
    pub fn degrees(&self) -> Vec<usize> {
        let mut degree = vec![0; self.nodes.len()];
        self.arcs.iter().filter_map(|it| it.ends).flatten().for_each(|node| degree[node] += 1);
        degree
    }

    /// Which faces lie inside of the curves of a kind: an odd number of them away from the unbounded face.
    pub fn inside(&self, kind: u32) -> Vec<bool> {
        let mut inside = vec![None; self.faces.len()];
        inside[0] = Some(false);
        let mut reached = vec![0];
        while let Some(face) = reached.pop() {
            for arc in self.arcs.iter().filter(|it| it.left == face || it.right == face) {
                let other = arc.left + arc.right - face;
                if inside[other].is_none() {
                    inside[other] = inside[face].map(|it: bool| it ^ (arc.kind == kind));
                    reached.push(other);
                }
            }
        }
        inside.into_iter().map(|it| it == Some(true)).collect()
    }

    /// Joins two arcs of one kind that meet alone and without a corner.
    fn join_smooth(&mut self) {
        for node in 0..self.nodes.len() {
            let here: Vec<usize> =
                (0..self.arcs.len()).filter(|&a| self.arcs[a].ends.is_some_and(|it| it.contains(&node))).collect();
            let (a, b) = match here[..] {
                [a] if self.arcs[a].ends == Some([node, node]) => (a, a),
                [a, b] if self.arcs[a].kind == self.arcs[b].kind && self.degree_of(node) == 2 => (a, b),
                _ => continue,
            };
            let mut first = self.arcs[a].points.clone();
            let mut second = self.arcs[b].points.clone();
            if a == b {
                let turn = turn(first[first.len() - 2], first[0], first[1]);
                if turn < CORNER {
                    first.pop();
                    (self.arcs[a].points, self.arcs[a].ends) = (first, None);
                }
                continue;
            }
            let [a_ends, b_ends] = [a, b].map(|it| self.arcs[it].ends.unwrap_or([0, 0]));
            if a_ends[1] != node {
                first.reverse();
            }
            if b_ends[0] != node {
                second.reverse();
            }
            if turn(first[first.len() - 2], second[0], second[1]) >= CORNER {
                continue;
            }
            let far = |ends: [usize; 2]| if ends[0] == node { ends[1] } else { ends[0] };
            first.extend_from_slice(&second[1..]);
            // The direction of the earlier curve is kept.
            let mut ends = [far(a_ends), far(b_ends)];
            if a_ends[1] != node {
                first.reverse();
                ends.reverse();
            }
            self.arcs[a].points = first;
            self.arcs[a].ends = Some(ends);
            self.arcs.remove(b);
        }
        self.drop_lone_nodes();
    }

    fn degree_of(&self, node: usize) -> usize {
        self.arcs.iter().filter_map(|it| it.ends).flatten().filter(|&it| it == node).count()
    }

    fn drop_lone_nodes(&mut self) {
        let degree = self.degrees();
        let mut place = vec![0; self.nodes.len()];
        let mut kept = Vec::new();
        for (node, point) in self.nodes.iter().enumerate().filter(|it| degree[it.0] > 0) {
            place[node] = kept.len();
            kept.push(*point);
        }
        self.nodes = kept;
        for ends in self.arcs.iter_mut().filter_map(|it| it.ends.as_mut()) {
            *ends = ends.map(|node| place[node]);
        }
    }

    /// Walks around every face with it on the left; half-edge 2 a runs along arc a, 2 a + 1 against it.
    fn trace_faces(&mut self) {
        let count = 2 * self.arcs.len();
        let next = self.next_halfedges();
        let mut loop_of = vec![usize::MAX; count];
        let mut contours: Vec<Vec<Vec2>> = Vec::new();
        for start in 0..count {
            if loop_of[start] != usize::MAX {
                continue;
            }
            let (mut at, mut contour) = (start, Vec::new());
            while loop_of[at] == usize::MAX {
                loop_of[at] = contours.len();
                let arc = &self.arcs[at / 2];
                let points = arc.points.len() - usize::from(arc.ends.is_some());
                match at % 2 {
                    0 => contour.extend_from_slice(&arc.points[..points]),
                    _ => contour.extend(arc.points.iter().rev().take(points)),
                }
                at = next[at];
            }
            contours.push(contour);
        }
        let areas: Vec<f64> = contours.iter().map(|it| signed_area(it)).collect();
        let outer: Vec<usize> = (0..contours.len()).filter(|&it| areas[it] > 0.0).collect();
        let mut face_of = vec![0; contours.len()];
        self.faces = vec![Vec::new()];
        for &it in &outer {
            face_of[it] = self.faces.len();
            self.faces.push(vec![contours[it].clone()]);
        }
        for hole in (0..contours.len()).filter(|&it| areas[it] <= 0.0) {
            let place = contours[hole][0];
            let around = outer
                .iter()
                .filter(|&&it| !shares_point(&contours[it], &contours[hole]) && contour_contains(&contours[it], place))
                .min_by(|&&a, &&b| areas[a].total_cmp(&areas[b]));
            face_of[hole] = around.map_or(0, |&it| face_of[it]);
            self.faces[face_of[hole]].push(contours[hole].clone());
        }
        for (a, arc) in self.arcs.iter_mut().enumerate() {
            (arc.left, arc.right) = (face_of[loop_of[2 * a]], face_of[loop_of[2 * a + 1]]);
        }
    }

    /// The half-edge that follows each one around the face on its left.
    fn next_halfedges(&self) -> Vec<usize> {
        let mut leaving: Vec<Vec<(usize, Vec2)>> = vec![Vec::new(); self.nodes.len()];
        for (a, arc) in self.arcs.iter().enumerate() {
            if let Some([from, to]) = arc.ends {
                leaving[from].push((2 * a, arc.points[1]));
                leaving[to].push((2 * a + 1, arc.points[arc.points.len() - 2]));
            }
        }
        let mut next: Vec<usize> = (0..2 * self.arcs.len()).collect();
        for (node, leaving) in leaving.iter_mut().enumerate() {
            let centre = self.nodes[node];
            let upper = |p: Vec2| (p.y, p.x) >= (centre.y, centre.x);
            leaving.sort_by(|a, b| {
                upper(b.1).cmp(&upper(a.1)).then_with(|| 0.0_f64.total_cmp(&orientation(centre, a.1, b.1)))
            });
            for (k, &(h, _)) in leaving.iter().enumerate() {
                // Having come in along the twin of `h`, the face on the left continues with the half-edge before `h`.
                next[h ^ 1] = leaving[(k + leaving.len() - 1) % leaving.len()].0;
            }
        }
        next
    }
}

fn shares_point(a: &[Vec2], b: &[Vec2]) -> bool {
    b.iter().any(|p| a.contains(p))
}

/// Angle by which a line turns at `b`, radians in [0, π].
fn turn(a: Vec2, b: Vec2, c: Vec2) -> f64 {
    let (before, after) = (b - a, c - b);
    cross2(before, after).atan2(before.dot(&after)).abs()
}

struct Builder {
    lines: Vec<Vec<Vec2>>,
    curves: Vec<(u32, bool)>,
    tolerance: f64,
    tree: SegmentTree,
    nodes: Vec<Vec2>,
    /// Per curve: segment, parameter on it, node.
    cuts: Vec<Vec<(usize, f64, usize)>>,
    notes: Vec<Note>,
}

impl Builder {
    fn new(curves: &[Curve], tolerance: f64) -> Result<Self, ArrangementError> {
        let mut lines = Vec::new();
        for (curve, it) in curves.iter().enumerate() {
            if let Some((point, p)) = it.points.iter().enumerate().find(|it| !it.1.iter().all(|it| it.is_finite())) {
                return Err(ArrangementError::NotFinite { curve, point, x: p.x, y: p.y });
            }
            let mut points = it.points.clone();
            points.dedup();
            if it.closed && points.len() > 1 {
                if points[0] == points[points.len() - 1] {
                    points.pop();
                }
                points.push(points[0]);
            }
            lines.push(points);
        }
        Ok(Self {
            tree: SegmentTree::of_polylines(&lines),
            curves: curves.iter().map(|it| (it.kind, it.closed)).collect(),
            cuts: vec![Vec::new(); lines.len()],
            lines,
            tolerance,
            nodes: Vec::new(),
            notes: Vec::new(),
        })
    }

    /// The node at `place`, or a new one there.
    fn node(&mut self, place: Vec2) -> usize {
        let near = self.nodes.iter().position(|it| (it - place).norm() <= self.tolerance);
        near.unwrap_or_else(|| {
            self.nodes.push(place);
            self.nodes.len() - 1
        })
    }

    fn cut(&mut self, line: usize, segment: usize, node: usize) {
        let (a, b) = (self.lines[line][segment], self.lines[line][segment + 1]);
        let t = ((self.nodes[node] - a).dot(&(b - a)) / (b - a).norm_squared()).clamp(0.0, 1.0);
        self.cuts[line].push((segment, t, node));
    }

    /// Nodes at the ends of open curves, moved onto other curves where these are near.
    fn ends(&mut self) {
        let mut ends = Vec::new();
        for line in 0..self.lines.len() {
            let last = self.lines[line].len().saturating_sub(1);
            if !self.curves[line].1 && last > 0 {
                ends.extend([(line, 0, self.lines[line][0]), (line, last - 1, self.lines[line][last])]);
            }
        }
        for (line, segment, drawn) in ends {
            let touched = self.nearest_other(line, segment, drawn);
            let near_node = self.nodes.iter().any(|it| (it - drawn).norm() <= self.tolerance);
            let place = match touched {
                Some((_, place)) if !near_node => place,
                _ => drawn,
            };
            let node = self.node(place);
            let distance = (self.nodes[node] - drawn).norm();
            if distance > 0.0 {
                self.notes.push(Note::Snapped { from: drawn, distance });
            }
            let t = if segment == 0 && self.lines[line][0] == drawn { 0.0 } else { 1.0 };
            self.cuts[line].push((segment, t, node));
            if let Some((other, _)) = touched {
                self.cut(other.line, other.index, node);
            }
        }
    }

    /// The nearest segment within the tolerance that does not belong to the stretch of curve at this end.
    fn nearest_other(&self, line: usize, segment: usize, p: Vec2) -> Option<(Segment, Vec2)> {
        let reach = Box2 { min: p, max: p }.grown(self.tolerance);
        let mut best: Option<(f64, Segment, Vec2)> = None;
        self.tree.visit(&reach, &mut |it| {
            let place = nearest_on_segment(p, it.a, it.b);
            let distance = (place - p).norm();
            let own = it.line == line && self.run_between(line, it.index, segment) <= 4.0 * self.tolerance;
            let nearer = best.is_none_or(|b| (distance, it.line, it.index) < (b.0, b.1.line, b.1.index));
            if !own && distance <= self.tolerance && nearer {
                best = Some((distance, *it, place));
            }
            true
        });
        best.map(|it| (it.1, it.2))
    }

    /// Length of curve strictly between two of its segments.
    fn run_between(&self, line: usize, i: usize, j: usize) -> f64 {
        let (low, high) = (i.min(j), i.max(j));
        (low + 1..high).map(|k| (self.lines[line][k + 1] - self.lines[line][k]).norm()).sum()
    }

    fn corners(&mut self, wanted: &dyn Fn(u32) -> bool) {
        for line in 0..self.lines.len() {
            let points = self.lines[line].clone();
            if !wanted(self.curves[line].0) || points.len() < 3 {
                continue;
            }
            for k in 1..points.len() - 1 {
                if turn(points[k - 1], points[k], points[k + 1]) >= CORNER {
                    let node = self.node(points[k]);
                    self.cut(line, k, node);
                }
            }
            let last = points.len() - 1;
            if self.curves[line].1 && turn(points[last - 1], points[0], points[1]) >= CORNER {
                let node = self.node(points[0]);
                self.cut(line, 0, node);
            }
        }
    }

    /// Nodes where two segments that are not neighbours meet.
    fn crossings(&mut self) {
        let mut pairs = Vec::new();
        for s in self.tree.segments() {
            self.tree.visit(&Box2::of([&s.a, &s.b]), &mut |o| {
                let neighbours = s.line == o.line && self.neighbours(s.line, s.index, o.index);
                if (s.line, s.index) < (o.line, o.index) && !neighbours {
                    pairs.extend(meeting(s, o).into_iter().map(|place| (*s, *o, place)));
                }
                true
            });
        }
        pairs.sort_by_key(|it| (it.0.line, it.0.index, it.1.line, it.1.index));
        for (s, o, place) in pairs {
            let node = self.node(place);
            self.cut(s.line, s.index, node);
            self.cut(o.line, o.index, node);
        }
    }

    fn neighbours(&self, line: usize, i: usize, j: usize) -> bool {
        let last = self.lines[line].len() - 2;
        i.abs_diff(j) <= 1 || (self.curves[line].1 && i.min(j) == 0 && i.max(j) == last)
    }

    fn divide(&mut self) -> Vec<Arc> {
        let mut arcs = Vec::new();
        for line in 0..self.lines.len() {
            let mut cuts = std::mem::take(&mut self.cuts[line]);
            cuts.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)).then(a.2.cmp(&b.2)));
            let (kind, closed) = self.curves[line];
            let points = &self.lines[line];
            let arc = |ends: Option<[usize; 2]>, points| Arc { kind, curve: line, ends, points, left: 0, right: 0 };
            if cuts.is_empty() {
                if closed && points.len() > 3 {
                    arcs.push(arc(None, points[..points.len() - 1].to_vec()));
                }
                continue;
            }
            let segments = points.len() - 1;
            if closed {
                let (segment, t, node) = cuts[0];
                cuts.push((segment + segments, t, node));
            }
            for pair in cuts.windows(2) {
                let [from, to] = [pair[0].2, pair[1].2].map(|node| self.nodes[node]);
                let mut piece = vec![from];
                for k in pair[0].0 + 1..=pair[1].0 {
                    let p = points[k % segments.max(1)];
                    let p = if closed { p } else { points[k] };
                    // Samples next to a node that was moved would fold back on themselves.
                    if (p - from).norm() > self.tolerance && (p - to).norm() > self.tolerance {
                        piece.push(p);
                    }
                }
                piece.push(to);
                if pair[0].2 == pair[1].2 && piece.len() < 4 {
                    continue;
                }
                arcs.push(arc(Some([pair[0].2, pair[1].2]), piece));
            }
        }
        arcs
    }
}

/// The points in which two segments meet: one for a crossing or touch, the two ends of a shared stretch.
fn meeting(s: &Segment, o: &Segment) -> Vec<Vec2> {
    let (sa, sb) = (orientation(o.a, o.b, s.a), orientation(o.a, o.b, s.b));
    let (oa, ob) = (orientation(s.a, s.b, o.a), orientation(s.a, s.b, o.b));
    let opposite = |x: f64, y: f64| (x > 0.0 && y < 0.0) || (x < 0.0 && y > 0.0);
    if opposite(sa, sb) && opposite(oa, ob) {
        return vec![s.a + (s.b - s.a) * (sa / (sa - sb))];
    }
    let on =
        |zero: f64, p: Vec2, it: &Segment| zero == 0.0 && Box2::of([&it.a, &it.b]).touches(&Box2 { min: p, max: p });
    let mut out: Vec<Vec2> =
        [(on(sa, s.a, o), s.a), (on(sb, s.b, o), s.b), (on(oa, o.a, s), o.a), (on(ob, o.b, s), o.b)]
            .into_iter()
            .filter_map(|(touches, p)| touches.then_some(p))
            .collect();
    out.dedup();
    out
}

/// Of several arcs between the same nodes that run along each other one is kept, the first.
fn drop_overlaps(arcs: &mut Vec<Arc>, tolerance: f64, notes: &mut Vec<Note>) {
    let mut seen: BTreeMap<[usize; 2], Vec<usize>> = BTreeMap::new();
    let mut keep = vec![true; arcs.len()];
    for a in 0..arcs.len() {
        let key = match arcs[a].ends {
            Some(ends) => [ends[0].min(ends[1]), ends[0].max(ends[1])],
            None => [usize::MAX; 2],
        };
        let others = seen.entry(key).or_default();
        if others.iter().any(|&b| runs_along(&arcs[a], &arcs[b], tolerance)) {
            keep[a] = false;
            let points = &arcs[a].points;
            let length = super::polyline_length(points, arcs[a].ends.is_none());
            notes.push(Note::Overlap { place: points[points.len() / 2], length });
        } else {
            others.push(a);
        }
    }
    let mut keep = keep.into_iter();
    arcs.retain(|_| keep.next().unwrap_or(true));
}

fn runs_along(a: &Arc, b: &Arc, tolerance: f64) -> bool {
    let near = |p: Vec2, other: &Arc| {
        let n = other.points.len();
        let segments = if other.ends.is_some() { n - 1 } else { n };
        (0..segments)
            .any(|k| (nearest_on_segment(p, other.points[k], other.points[(k + 1) % n]) - p).norm() <= tolerance)
    };
    let middles = |it: &Arc| -> Vec<Vec2> { it.points.windows(2).map(|w| (w[0] + w[1]) / 2.0).collect() };
    middles(a).into_iter().all(|p| near(p, b)) && middles(b).into_iter().all(|p| near(p, a))
}

#[cfg(test)]
mod tests;
