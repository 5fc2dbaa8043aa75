//! Necks: where a flat region is too narrow for a disc to pass between two places that are wide enough for it.
//!
//! Let d be the distance to the contours, inside the region. Its saddles are the middles of chords whose ends are
//! the nearest points of the contours to the middle, on opposite sides: nothing lies in the disc that has such a chord
//! as its diameter, so chords do not cross. The places where a disc of diameter w fits, {d ≥ w / 2}, are joined in {d > 0}
//! only through saddles, so the chords shorter than w divide the region into faces that hold one such place each, or none.
//! The narrowest chord between two faces that do is a neck; chords inside a thin tip are none. Exact up to rounding but
//! for whether a disc fits ([`RESOLUTION`]).
use std::{cmp::Ordering, collections::BinaryHeap};

use super::{
    Box2, Vec2,
    polygon::{contains, contour_contains, orientation, point_segment_distance},
    segment_tree::{Segment, SegmentTree},
};

/// A disc that lacks this share of its radius counts as one that fits.
const RESOLUTION: f64 = 1e-3;
/// Relative slack of angles and distances that decide what a chord is: outlines come from a solver.
const SLACK: f64 = 1e-9;

/// A chord across a region that parts two places where a disc as wide as was asked for fits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Neck {
    /// The contour on which both ends lie.
    pub contour: usize,
    /// The edges of the contour on which the ends lie, the smaller first; edge i starts at point i.
    pub edges: [usize; 2],
    /// The ends.
    pub ends: [Vec2; 2],
    /// Its length, mm.
    pub width: f64,
    /// Area on the smaller side of it, holes counted in, mm².
    pub hanging: f64,
}

/// One end of a chord on its contour.
#[derive(Debug, Clone, Copy, PartialEq)]
struct End {
    edge: usize,
    /// Where on the edge, 0 to 1.
    at: f64,
    point: Vec2,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Chord {
    contour: usize,
    ends: [End; 2],
    width: f64,
}

/// The necks narrower than `width` of a region, mm: an outline and its holes, with the region on the left of all of them,
/// simple and apart. Ordered by width, the widest first.
pub fn necks(contours: &[Vec<Vec2>], width: f64) -> Vec<Neck> {
    let chords = chords(contours, width);
    if chords.is_empty() {
        return Vec::new();
    }
    let faces = Faces::new(contours, &chords);
    let mut wide: Vec<bool> = (0..faces.loops.len()).map(|k| faces.holds_disc(k, 0.5 * width)).collect();
    // The faces grow together over the widest chords first: where two that hold a disc each meet, a disc cannot pass.
    let mut root: Vec<usize> = (0..faces.loops.len()).collect();
    let find = |root: &[usize], mut k: usize| {
        while root[k] != k {
            k = root[k];
        }
        k
    };
    let mut order: Vec<usize> = (0..chords.len()).collect();
    order.sort_by(|&i, &j| chords[j].width.total_cmp(&chords[i].width).then(i.cmp(&j)));
    let mut out = Vec::new();
    for k in order {
        let [a, b] = faces.beside[k].map(|it| find(&root, it));
        if a == b {
            continue;
        }
        root[b] = a;
        if wide[a] && wide[b] {
            out.push(chords[k].neck(&contours[chords[k].contour]));
        }
        wide[a] |= wide[b];
    }
    out
}

impl Chord {
    fn neck(&self, contour: &[Vec2]) -> Neck {
        let [a, b] = self.ends;
        let mut side = vec![a.point];
        side.extend(&contour[a.edge + 1..=b.edge]);
        side.push(b.point);
        let (side, all) = (super::signed_area(&side), super::signed_area(contour));
        let hanging = if all > 0.0 { side.abs().min((all - side).abs()) } else { side.abs() };
        let ends = [a.point, b.point];
        Neck { contour: self.contour, edges: [a.edge, b.edge], ends, width: self.width, hanging }
    }
}

/// Chords shorter than `width` whose disc is empty, both ends on one contour, none crossing another.
fn chords(contours: &[Vec<Vec2>], width: f64) -> Vec<Chord> {
    let tree = SegmentTree::of_contours(contours);
    // The nearest point of a straight boundary is never where it turns towards the region, so one end is a corner that
    // turns away from it.
    let turns_away = |line: usize, i: usize, towards: Vec2| {
        let contour = &contours[line];
        let n = contour.len();
        let sides = [contour[(i + 1) % n] - contour[i], contour[(i + n - 1) % n] - contour[i]];
        sides.iter().all(|side| side.dot(&towards) <= SLACK * side.norm())
    };
    let mut out: Vec<Chord> = Vec::new();
    for (line, contour) in contours.iter().enumerate() {
        let n = contour.len();
        for i in 0..n {
            let p = contour[i];
            if orientation(contour[(i + n - 1) % n], p, contour[(i + 1) % n]) > 0.0 {
                continue;
            }
            let from = End { edge: i, at: 0.0, point: p };
            tree.visit(&Box2 { min: p, max: p }.grown(width), &mut |s| {
                if s.line != line || s.index == i || (s.index + 1) % n == i {
                    return true;
                }
                let along = s.b - s.a;
                let at = (p - s.a).dot(&along) / along.norm_squared();
                // Rounding must not make two ends of one corner.
                let corner = if at < SLACK { Some(s.index) } else { (at > 1.0 - SLACK).then_some((s.index + 1) % n) };
                let q = corner.map_or_else(|| s.a + along * at, |j| contour[j]);
                let length = (q - p).norm();
                if !(length > 0.0 && length < width && turns_away(line, i, (q - p) / length)) {
                    return true;
                }
                let (faces, to) = match corner {
                    Some(j) => (i < j && turns_away(line, j, (p - q) / length), End { edge: j, at: 0.0, point: q }),
                    None => (orientation(s.a, s.b, p) > 0.0, End { edge: s.index, at, point: q }),
                };
                if faces && disc_is_empty(&tree, p, q) {
                    let ends = if from.before(&to) { [from, to] } else { [to, from] };
                    out.push(Chord { contour: line, ends, width: length });
                }
                true
            });
        }
    }
    let key = |it: &Chord| (it.contour, it.ends[0].edge, it.ends[1].edge);
    out.sort_by(|a, b| a.width.total_cmp(&b.width).then_with(|| key(a).cmp(&key(b))));
    out.dedup_by(|a, b| a.contour == b.contour && a.ends == b.ends);
    // Equal corners of a cross see each other past one another; the first comes to stand for both.
    let mut kept: Vec<Chord> = Vec::with_capacity(out.len());
    for chord in out {
        if kept.iter().all(|it| !it.crosses(&chord)) {
            kept.push(chord);
        }
    }
    kept
}

impl End {
    fn before(&self, other: &Self) -> bool {
        (self.edge, self.at) < (other.edge, other.at)
    }
}

impl Chord {
    /// Whether one end of the other lies strictly between its own along the contour, and one strictly outside.
    fn crosses(&self, other: &Self) -> bool {
        let [a, b] = self.ends;
        let within = |it: &End| a.before(it) && it.before(&b);
        let outside = |it: &End| it.before(&a) || b.before(it);
        let [c, d] = &other.ends;
        self.contour == other.contour && ((within(c) && outside(d)) || (outside(c) && within(d)))
    }
}

/// Whether no contour comes into the disc with the diameter `p q`.
fn disc_is_empty(tree: &SegmentTree, p: Vec2, q: Vec2) -> bool {
    let (middle, radius) = (0.5 * (p + q), 0.5 * (p - q).norm());
    let least = radius * (1.0 - SLACK);
    tree.visit(&Box2 { min: middle, max: middle }.grown(radius), &mut |s| {
        point_segment_distance(middle, s.a, s.b) >= least
    })
}

/// A closed walk around a face: its points, and its edges that lie on a contour; where two chords meet, one without length.
#[derive(Debug, Default)]
struct Walk {
    points: Vec<Vec2>,
    edges: Vec<(Vec2, Vec2)>,
}

/// What chords divide a region into.
struct Faces {
    /// The walks around each face, its outline first.
    loops: Vec<Vec<Walk>>,
    /// The faces on both sides of each chord.
    beside: Vec<[usize; 2]>,
}

impl Faces {
    fn new(contours: &[Vec<Vec2>], chords: &[Chord]) -> Self {
        let mut walks: Vec<Walk> = Vec::new();
        let mut walk_beside = vec![[0; 2]; chords.len()];
        for (line, contour) in contours.iter().enumerate() {
            let ends = ends_along(contour.len(), line, chords);
            if ends.is_empty() {
                let edges = super::polygon::edges(contour).collect();
                walks.push(Walk { points: contour.clone(), edges });
                continue;
            }
            let mut place = vec![[0; 2]; chords.len()];
            ends.iter().enumerate().for_each(|(k, &(chord, end))| place[chord][end] = k);
            let mut seen = vec![false; ends.len()];
            for start in 0..ends.len() {
                let mut walk = Walk::default();
                let mut at = start;
                while !std::mem::replace(&mut seen[at], true) {
                    let next = (at + 1) % ends.len();
                    let [from, to] = [at, next].map(|k| chords[ends[k].0].ends[ends[k].1]);
                    walk.follow(contour, from, to, ends.len() == 1 || next <= at);
                    // Over the chord, along which the face lies on the left as well.
                    let (chord, end) = ends[next];
                    walk_beside[chord][end] = walks.len();
                    at = place[chord][1 - end];
                }
                if !walk.points.is_empty() {
                    walks.push(walk);
                }
            }
        }
        Self::gathered(walks, walk_beside)
    }

    /// Walks that run clockwise are holes of the least face around them.
    fn gathered(walks: Vec<Walk>, walk_beside: Vec<[usize; 2]>) -> Self {
        let areas: Vec<f64> = walks.iter().map(|it| super::signed_area(&it.points)).collect();
        let face: Vec<usize> = (0..walks.len())
            .map(|k| {
                let Some(&(a, b)) = walks[k].edges.first().filter(|_| areas[k] <= 0.0) else { return k };
                let p = 0.5 * (a + b);
                let around = (0..walks.len()).filter(|&j| areas[j] > 0.0 && contour_contains(&walks[j].points, p));
                around.min_by(|&i, &j| areas[i].total_cmp(&areas[j])).unwrap_or(k)
            })
            .collect();
        let mut loops: Vec<Vec<Walk>> = walks.iter().map(|_| Vec::new()).collect();
        let mut holes = Vec::new();
        for (k, walk) in walks.into_iter().enumerate() {
            if face[k] == k { loops[k].push(walk) } else { holes.push((face[k], walk)) }
        }
        holes.into_iter().for_each(|(k, walk)| loops[k].push(walk));
        Self { loops, beside: walk_beside.into_iter().map(|it| it.map(|k| face[k])).collect() }
    }

    /// Whether a disc of this radius fits with its middle in a face (it may look out over a chord), by subdivision of squares: the distance to the contours changes by
    /// no more than the way gone. What lies behind a chord is never nearer than an end of it.
    fn holds_disc(&self, face: usize, radius: f64) -> bool {
        let loops = &self.loops[face];
        let edges = loops.iter().flat_map(|it| &it.edges);
        let tree = SegmentTree::of_segments(edges.map(|&(a, b)| Segment { a, b, line: 0, index: 0 }).collect());
        let outline: Vec<Vec<Vec2>> = loops.iter().map(|it| it.points.clone()).collect();
        let enough = radius * (1.0 - RESOLUTION);
        if tree.segments().is_empty() {
            return false;
        }
        let bounds = Box2::of(outline.iter().flatten());
        let cell = |middle: Vec2, half: f64| {
            let foot = tree.nearest(middle).map_or(middle, |it| it.1);
            let clearance = (foot - middle).norm();
            let inside = contains(&outline, middle);
            Cell { middle, half, clearance: if inside { clearance } else { -clearance } }
        };
        let mut heap = BinaryHeap::from([cell(0.5 * (bounds.min + bounds.max), 0.5 * bounds.size().max())]);
        while let Some(it) = heap.pop() {
            if it.clearance >= enough {
                return true;
            }
            let quarter = 0.5 * it.half;
            if it.half < RESOLUTION * radius {
                continue;
            }
            for (x, y) in [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)] {
                let part = cell(it.middle + Vec2::new(x, y) * quarter, quarter);
                // A square outside may reach in over a chord, so the distance to the contours bounds it all the same.
                if part.clearance.abs() + quarter * std::f64::consts::SQRT_2 >= enough && part.meets(&outline) {
                    heap.push(part);
                }
            }
        }
        false
    }
}

/// The ends on a contour in the order of travel, as (chord, end). At one point the end comes first whose chord leads back
/// the least: it bounds the face behind.
fn ends_along(n: usize, line: usize, chords: &[Chord]) -> Vec<(usize, usize)> {
    let mut ends: Vec<(End, f64, usize, usize)> = Vec::new();
    for (k, chord) in chords.iter().enumerate().filter(|it| it.1.contour == line) {
        let [a, b] = chord.ends;
        let forward = (b.edge - a.edge) as f64 + (b.at - a.at);
        ends.push((a, n as f64 - forward, k, 0));
        ends.push((b, forward, k, 1));
    }
    ends.sort_by(|s, t| {
        let place = s.0.edge.cmp(&t.0.edge).then(s.0.at.total_cmp(&t.0.at));
        place.then(s.1.total_cmp(&t.1)).then((s.2, s.3).cmp(&(t.2, t.3)))
    });
    ends.into_iter().map(|it| (it.2, it.3)).collect()
}

impl Walk {
    /// Goes on along a contour, once past its first point where `wraps`.
    fn follow(&mut self, contour: &[Vec2], from: End, to: End, wraps: bool) {
        let n = contour.len();
        let steps = to.edge + if wraps { n } else { 0 } - from.edge;
        let inner = (1..=steps).map(|k| contour[(from.edge + k) % n]);
        let points: Vec<Vec2> = [from.point].into_iter().chain(inner).chain([to.point]).collect();
        self.edges.extend(points.windows(2).map(|it| (it[0], it[1])));
        self.points.extend(points);
    }
}

/// A square, the most promising first.
struct Cell {
    middle: Vec2,
    half: f64,
    /// Distance from the middle to the contours, negative outside.
    clearance: f64,
}

impl Cell {
    /// Whether a part of it may lie inside `outline`.
    fn meets(&self, outline: &[Vec<Vec2>]) -> bool {
        let reach = self.half * std::f64::consts::SQRT_2;
        let mut edges = outline.iter().flat_map(|it| super::polygon::edges(it));
        self.clearance > -reach || edges.any(|(a, b)| point_segment_distance(self.middle, a, b) <= reach)
    }
}

impl PartialEq for Cell {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}
impl Eq for Cell {}
impl PartialOrd for Cell {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl Ord for Cell {
    fn cmp(&self, other: &Self) -> Ordering {
        self.clearance.total_cmp(&other.clearance)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::boolean;

    fn polygon(points: &[[f64; 2]]) -> Vec<Vec2> {
        points.iter().map(|&[x, y]| Vec2::new(x, y)).collect()
    }

    /// Two squares of side 10, joined by a bridge from y to y + w.
    fn dumbbell(w: f64) -> Vec<Vec2> {
        let y = 4.0;
        polygon(&[
            [0., 0.],
            [10., 0.],
            [10., y],
            [15., y],
            [15., 0.],
            [25., 0.],
            [25., 10.],
            [15., 10.],
            [15., y + w],
            [10., y + w],
            [10., 10.],
            [0., 10.],
        ])
    }

    #[test]
    fn a_bridge_is_a_neck_where_it_is_narrower_than_asked() {
        let found = necks(&[dumbbell(3.0)], 4.0);
        assert_eq!(found.len(), 1);
        assert!((found[0].width - 3.0).abs() < 1e-12 && (found[0].hanging - 100.0).abs() < 16.0, "{found:?}");
        assert!(necks(&[dumbbell(3.0)], 3.0).is_empty());
        // Discs of 10.5 mm do not fit into either square: nothing hangs on the bridge.
        assert!(necks(&[dumbbell(3.0)], 10.5).is_empty());
    }

    #[test]
    fn a_tip_is_no_neck_and_neither_is_a_strip() {
        let tip = polygon(&[[0., 0.], [20., 0.], [20., 20.], [40., 21.], [20., 22.], [20., 40.], [0., 40.]]);
        assert!(necks(&[tip], 3.0).is_empty());
        let strip = (0..=50).map(|x| Vec2::new(f64::from(x), 0.1 * (1.3 * f64::from(x)).sin()));
        let back = (0..=50).rev().map(|x| Vec2::new(f64::from(x), 2.0 + 0.1 * (2.1 * f64::from(x)).cos()));
        assert!(necks(&[strip.chain(back).collect()], 3.0).is_empty());
    }

    #[test]
    fn of_several_chords_between_two_places_the_narrowest_counts() {
        let waist = |x: f64| 3.0 + 0.2 * (x - 30.0).abs() + 0.3 * (2.0 * x).cos();
        let low = (0..=60).map(|x| Vec2::new(f64::from(x), -0.5 * waist(f64::from(x))));
        let high = (0..=60).rev().map(|x| Vec2::new(f64::from(x), 0.5 * waist(f64::from(x))));
        let contour: Vec<Vec2> = low.chain(high).collect();
        let found = necks(std::slice::from_ref(&contour), 5.0);
        let least = (0..=60).map(|x| waist(f64::from(x))).fold(f64::INFINITY, f64::min);
        assert!(found.len() == 1 && (found[0].width - least).abs() < 0.05, "{found:?} {least}");
    }

    #[test]
    fn a_hole_leaves_two_bridges_that_are_no_necks_but_a_slot_into_it_makes_one() {
        let outline = polygon(&[[0., 0.], [30., 0.], [30., 10.], [0., 10.]]);
        let hole = polygon(&[[14., 2.], [14., 8.], [16., 8.], [16., 2.]]);
        assert!(necks(&[outline.clone(), hole], 3.0).is_empty());
        let slot = polygon(&[[0., 0.], [30., 0.], [30., 10.], [16., 10.], [16., 2.], [14., 2.], [14., 10.], [0., 10.]]);
        let found = necks(&[slot], 3.0);
        assert!(found.len() == 1 && (found[0].width - 2.0).abs() < 1e-12, "{found:?}");
    }

    /// The law: one more than the necks are the parts that are left when the region is made smaller by half the width.
    #[test]
    fn necks_part_what_erosion_parts() {
        let mut state = 11_u64;
        let mut draw = || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 40) as f64 / (1 << 24) as f64
        };
        let mut parted = 0;
        for _ in 0..60 {
            let radii: Vec<f64> = (0..40).map(|_| 4.0 + 30.0 * draw() * draw()).collect();
            let star: Vec<Vec2> = (0..40)
                .map(|k| {
                    let (sin, cos) = (f64::from(k) * std::f64::consts::TAU / 40.0).sin_cos();
                    Vec2::new(cos, sin) * radii[k as usize]
                })
                .collect();
            for width in [2.0, 4.0, 7.0] {
                // Between the two resolutions nothing may change.
                let [left, same] = [1.0, 1.0 - 2.0 * RESOLUTION]
                    .map(|share| boolean::offset(std::slice::from_ref(&star), -0.5 * width * share).len());
                if left != same || left == 0 {
                    continue;
                }
                let found = necks(std::slice::from_ref(&star), width);
                assert_eq!(found.len() + 1, left, "{star:?} {width}");
                parted += usize::from(left > 1);
            }
        }
        assert!(parted > 20, "{parted}");
    }
}
