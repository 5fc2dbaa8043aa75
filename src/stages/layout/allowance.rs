//! Material outside the seams of a piece, to be sewn along them, clipped where two stretches of it would meet.
//!
//! In a bay of the outline the allowances of both shores overlap, and one sheet would fill the bay: neither shore could be laid
//! against the piece that belongs there. So every place outside goes to the stretch of the outline that is nearest to it, as in
//! a Voronoi diagram: from each point of a seam the allowance reaches as far as its width, but not up to the centre of the
//! largest empty ball that touches the outline there (found by shrinking; Ma, Bae and Choi, "3D medial axis point
//! approximation using nearest neighbors and the normal field", The Visual Computer 28, 2012, section 3). What is left free
//! along the middle of the bay is a clip that ends shortly before the seam, as one cuts it with scissors. Darts stay filled:
//! their shores are sewn to each other.
use std::collections::BTreeMap;

use super::{
    join::{Body, trimmed},
    seams::Measured,
    tabs::flat,
};
use crate::{
    geom::{
        Box2, Vec2, boolean, cross2,
        polygon::{edges, nearest_on_segment, segments_meet, turned},
        polyline::simplify,
        segment_tree::{Segment, SegmentTree},
        signed_area,
    },
    mesh::VertexId,
    model::{Joints, Mark, Operation, PieceId},
};

/// Shares of the width of an allowance to try.
const NARROWER: [f64; 4] = [1.0, 0.97, 0.93, 0.87];
/// Width of a clip, mm.
const CLIP: f64 = 0.6;
/// Clips end where the outline around the end of the bay is shorter than this, mm.
const STOP: f64 = 3.0;
/// Shores face each other when the way around is this many times as long as the way across: in corners below 130°.
const DEEP: f64 = 1.1;
/// Steps along the outline, mm.
const STEP: f64 = 0.5;
/// Step around corners, radians: the same as of rounded offsets.
const TURN: f64 = std::f64::consts::PI / 36.0;
/// How far the allowance reaches under its own piece, mm: the outline was cleaned and may lie a little inside the seam.
const ROOT: f64 = 0.1;
/// How near to a seam the outline is the seam, mm.
const CLOSE: f64 = 0.1;
/// Steps of the walls of clips that are smoothed, mm.
const SMOOTH: f64 = 0.03;
/// Holes between allowances below this area are filled, mm².
const ISLAND: f64 = 6.0;
/// Allowances hang together where nothing parts them farther from the end of a bay than this, mm of outline around it.
const TOGETHER: f64 = 12.0;

/// A side of a seam that a piece has.
struct Own {
    /// First and last vertex, as one travels around the piece on the left.
    ends: [VertexId; 2],
    line: Vec<Vec2>,
    /// Number of the seam.
    label: u32,
    /// Whether it is a shore of a dart.
    dart: bool,
}

/// Adds material outside all seams of a piece, and the lines to sew along.
pub(super) fn add(body: &mut Body, piece: PieceId, seams: &[Measured], width: f64, merge: f64, joints: &mut Joints) {
    let mut own: Vec<Own> = seams
        .iter()
        .flat_map(|it| [(it, 0), (it, 1)])
        .filter(|(it, side)| it.sides[*side].piece == piece)
        .map(|(it, side)| {
            let (ends, line) = it.travelled(side);
            Own { ends, line, label: it.label, dart: false }
        })
        .collect();
    find_darts(&mut own);
    sewn(body, own, width, merge, joints);
}

/// Adds the material outside the given sides of seams.
fn sewn(body: &mut Body, own: Vec<Own>, width: f64, merge: f64, joints: &mut Joints) {
    let shores = Shores::new(&body.contours, &own);
    // Where the allowance would leave a slit too narrow to be cut, a little less of it leaves a wider one.
    let tried = NARROWER.iter().find_map(|share| {
        let (strips, narrow) = shores.strips(share * width);
        // A crack narrower than half a clip is none.
        let closed = [CLIP / 4.0, -CLIP / 4.0].iter().fold(strips.clone(), |it, &by| flat(boolean::offset(&it, by)));
        let more = flat(boolean::union(&strips, &closed));
        let mut contours = trimmed(boolean::union(&body.contours, &more), merge)?;
        contours.retain(|it| signed_area(it) > 0.0 || -signed_area(it) >= ISLAND);
        Some((contours, narrow))
    });
    match tried {
        Some((contours, narrow)) => {
            let together = shores.together(width, &contours);
            if together > 0.0 {
                joints.bridged.push(format!("{together:.0} mm of seam on part {}", body.name));
            }
            joints.narrow += narrow;
            body.contours = contours;
        }
        None => joints.missing.push(format!("part {}, which has no allowance", body.name)),
    }
    let sew = |it: Own| Mark { operation: Operation::Sew, points: it.line, closed: false };
    body.marks.extend(own.into_iter().map(sew));
}

/// Marks the seams whose sides meet in a point, and those whose sides do once such darts are closed.
fn find_darts(own: &mut [Own]) {
    // Vertices that come together, by the first of them.
    let mut closed: BTreeMap<VertexId, VertexId> = BTreeMap::new();
    loop {
        let at = |v: VertexId| closed.get(&v).copied().unwrap_or(v);
        let meet = |i: usize, j: usize| own[i].label == own[j].label && at(own[i].ends[1]) == at(own[j].ends[0]);
        let pairs = (0..own.len()).flat_map(|i| (0..own.len()).map(move |j| (i, j)));
        let Some((i, j)) = pairs.filter(|&(i, j)| i != j && !own[i].dart).find(|&(i, j)| meet(i, j)) else { return };
        let (mouth, other) = (at(own[i].ends[0]), at(own[j].ends[1]));
        let joined: Vec<VertexId> = own.iter().flat_map(|it| it.ends).filter(|&v| at(v) == other).collect();
        closed.extend(joined.into_iter().map(|v| (v, mouth)));
        own[i].dart = true;
        own[j].dart = true;
    }
}

/// A place on the outline.
#[derive(Clone, Copy)]
struct Place {
    contour: usize,
    /// Way along the contour with its darts closed, mm.
    along: f64,
    /// Index of the side of a seam that it belongs to.
    side: Option<usize>,
}

/// The outline of a piece in short steps.
struct Shores<'a> {
    own: &'a [Own],
    tree: SegmentTree,
    /// Of each segment's start, by its index.
    places: Vec<Place>,
    /// Length of each contour with its darts closed, mm.
    around: Vec<f64>,
}

impl<'a> Shores<'a> {
    fn new(contours: &[Vec<Vec2>], own: &'a [Own]) -> Self {
        let lines: Vec<Vec<Vec2>> = own.iter().map(|it| it.line.clone()).collect();
        let sides = SegmentTree::of_polylines(&lines);
        let side_at = |p: Vec2| Some(sides.nearest(p).filter(|it| (it.1 - p).norm() < CLOSE)?.0.line);
        let (mut segments, mut places, mut around) = (Vec::new(), Vec::new(), Vec::new());
        for (contour, points) in contours.iter().enumerate() {
            let mut along = 0.0;
            for (a, b) in edges(points) {
                let count = steps(a, b);
                let at = |k: usize| a + (b - a) * (k as f64 / count as f64);
                for k in 0..count {
                    let (a, b) = (at(k), at(k + 1));
                    let side = side_at((a + b) / 2.0);
                    segments.push(Segment { a, b, line: contour, index: places.len() });
                    places.push(Place { contour, along, side });
                    // A dart will be closed: what lies on both sides of it are neighbours.
                    if !side.is_some_and(|it| own[it].dart) {
                        along += (b - a).norm();
                    }
                }
            }
            around.push(along);
        }
        Self { own, tree: SegmentTree::of_segments(segments), places, around }
    }

    /// Where on the outline a point of a seam lies.
    fn place(&self, p: Vec2, side: usize) -> Option<Place> {
        let (segment, foot) = self.tree.nearest(p)?;
        let from = self.places[segment.index];
        Some(Place { along: from.along + (foot - segment.a).norm(), side: Some(side), ..from })
    }

    /// Whether a place `across` mm away lies on another shore, no nearer around the end of the bay than `stop`.
    fn faces(&self, here: Place, segment: &Segment, foot: Vec2, across: f64, stop: f64) -> bool {
        let there = self.places[segment.index];
        let way = (there.along + (foot - segment.a).norm() - here.along).abs();
        here.contour != there.contour || way.min(self.around[here.contour] - way) > f64::max(DEEP * across, stop)
    }

    /// Whether a place belongs to the other shore of the dart on whose shore one is.
    fn closes(&self, side: usize, there: &Segment) -> bool {
        let other = self.places[there.index].side.filter(|&it| it != side && self.own[side].dart);
        other.is_some_and(|it| self.own[it].label == self.own[side].label)
    }

    /// How far an allowance of a width reaches from a point along the unit normal `out`: to its width, or nearly to the centre
    /// of the largest ball that touches the outline there and holds no other shore.
    fn reach(&self, p: Vec2, out: Vec2, side: usize, width: f64) -> f64 {
        let Some(here) = self.place(p, side) else { return width };
        let mut radius = width + CLIP / 2.0;
        let center = p + out * radius;
        let mut touched = None;
        self.tree.visit(&Box2 { min: center, max: center }.grown(radius), &mut |t| {
            loop {
                let center = p + out * radius;
                let foot = nearest_on_segment(center, t.a, t.b);
                let way = foot - p;
                // What lies in the ball lies outwards, and the ball through it is smaller.
                let inside = (foot - center).norm() < radius * (1.0 - 1e-6) && way.dot(&out) > 1e-9;
                if !inside || !(self.closes(side, t) || self.faces(here, t, foot, way.norm(), STOP)) {
                    return true;
                }
                (touched, radius) = (Some(t), way.norm_squared() / (2.0 * way.dot(&out)));
            }
        });
        if touched.is_some_and(|t| self.closes(side, t)) {
            return width;
        }
        (radius - CLIP / 2.0).max(radius / 4.0).min(width)
    }

    /// The allowance of all seams as polygons that overlap, and for how many mm of seam it is less than half as wide as asked.
    fn strips(&self, width: f64) -> (Vec<Vec<Vec2>>, f64) {
        let (mut strips, mut narrow) = (Vec::new(), 0.0);
        for (i, side) in self.own.iter().enumerate() {
            let reach = |p: Vec2, out: Vec2| self.reach(p, out, i, width);
            for (a, b, out) in legs(&side.line) {
                let count = steps(a, b);
                let at = |k: usize| a + (b - a) * (k as f64 / count as f64);
                let reaches: Vec<f64> = (0..=count).map(|k| reach(at(k), out)).collect();
                let short = reaches[1..].iter().filter(|it| **it < width / 2.0).count();
                narrow += (b - a).norm() * short as f64 / count as f64;
                let mut strip = vec![b - out * ROOT, a - out * ROOT];
                let top: Vec<Vec2> = (0..=count).map(|k| at(k) + out * reaches[k]).collect();
                strip.extend(simplify(&top, false, SMOOTH, &|_| false).into_iter().map(|k| top[k]));
                strips.push(strip);
            }
            let next = self.own.iter().find(|it| it.ends[0] == side.ends[1]);
            let first = next.and_then(|it| legs(&it.line).next());
            let outs: Vec<(Vec2, Vec2)> = legs(&side.line).chain(first).map(|it| (it.0, it.2)).collect();
            for pair in outs.windows(2) {
                let (p, [before, after]) = (pair[1].0, [pair[0].1, pair[1].1]);
                let turn = cross2(before, after).atan2(before.dot(&after));
                let count = (turn / TURN).ceil() as usize;
                if turn > 0.0 {
                    let out = |k: usize| turned(before, turn * k as f64 / count as f64);
                    let mut fan = vec![p - turned(before, turn / 2.0) * ROOT];
                    fan.extend((0..=count).map(|k| p + out(k) * reach(p, out(k))));
                    strips.push(fan);
                }
            }
        }
        (flat(boolean::union(&strips, &[])), narrow)
    }

    /// For how many mm of seam the allowance goes without a break to that of another shore nearer than two widths: looked for
    /// in the finished outline, by lines straight across.
    fn together(&self, width: f64, finished: &[Vec<Vec2>]) -> f64 {
        let outline = SegmentTree::of_contours(finished);
        let mut found = 0.0;
        // What is between the shores of a dart may hang together.
        for (i, side) in self.own.iter().enumerate().filter(|it| !it.1.dart) {
            for (a, b, out) in legs(&side.line) {
                let count = steps(a, b);
                let middles = (0..count).map(|k| a + (b - a) * ((k as f64 + 0.5) / count as f64));
                let bridged = middles.filter(|&p| {
                    let across = self.across(p, out, i, 2.0 * width);
                    across.is_some_and(|q| outline.visit(&Box2::of([&p, &q]), &mut |s| !segments_meet(p, q, s.a, s.b)))
                });
                found += (b - a).norm() * bridged.count() as f64 / count as f64;
            }
        }
        found
    }

    /// The nearest place of another shore on the outer side of a point, nearer than `limit`.
    fn across(&self, p: Vec2, out: Vec2, side: usize, mut limit: f64) -> Option<Vec2> {
        let here = self.place(p, side)?;
        let mut nearest = None;
        self.tree.visit(&Box2 { min: p, max: p }.grown(limit), &mut |t| {
            let foot = nearest_on_segment(p, t.a, t.b);
            let across = (foot - p).norm();
            if across < limit && (foot - p).dot(&out) > 0.0 && self.faces(here, t, foot, across, TOGETHER) {
                (nearest, limit) = (Some(foot), across);
            }
            true
        });
        nearest
    }
}

/// Number of steps that a straight line is taken in.
fn steps(a: Vec2, b: Vec2) -> usize {
    ((b - a).norm() / STEP).ceil().max(1.0) as usize
}

/// Straight stretches of a line with their normals to the right, away from the piece.
fn legs(line: &[Vec2]) -> impl Iterator<Item = (Vec2, Vec2, Vec2)> {
    line.windows(2).filter_map(|w| {
        let along = (w[1] - w[0]).try_normalize(1e-9)?;
        Some((w[0], w[1], Vec2::new(along.y, -along.x)))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        geom::{
            outline::check_outline,
            polygon::{area, contains},
        },
        mesh::Id,
    };

    fn line(points: &[[f64; 2]]) -> Vec<Vec2> {
        points.iter().map(|&it| it.into()).collect()
    }

    /// A block 60 mm wide with a bay that narrows from `mouth` to `end`, 30 mm deep, all of whose shore is one seam.
    fn bay(mouth: f64, end: f64) -> (Body, Own) {
        let (m, e) = (mouth / 2.0, end / 2.0);
        let shore = if end > 0.0 {
            line(&[[-m, 40.], [-e, 10.], [e, 10.], [m, 40.]])
        } else {
            line(&[[-m, 40.], [0., 10.], [m, 40.]])
        };
        let mut contour = line(&[[-30., 40.], [-30., 0.], [30., 0.], [30., 40.]]);
        contour.extend(shore.iter().rev());
        let body = Body { name: "A".into(), contours: vec![contour], marks: vec![] };
        let line = shore.into_iter().rev().collect();
        (body, Own { ends: [0, 1].map(VertexId::new), line, label: 1, dart: false })
    }

    #[test]
    fn allowances_on_both_shores_of_a_bay_are_clipped_apart() {
        for (mouth, end) in [(6.0, 6.0), (9.0, 3.0), (10.0, 0.0), (30.0, 4.0), (2.0, 2.0)] {
            let (mut body, own) = bay(mouth, end);
            let whole = area(&body.contours);
            let shores = Shores::new(&body.contours, std::slice::from_ref(&own));
            let filled: Vec<Vec<Vec2>> = vec![line(&[[-30., 40.], [-30., 0.], [30., 0.], [30., 40.]])];
            assert!(shores.together(5.0, &filled) > 5.0, "{mouth} {end}");
            let mut joints = Joints::default();
            sewn(&mut body, vec![own], 5.0, 0.02, &mut joints);
            assert_eq!((joints.bridged.len(), joints.missing.len()), (0, 0), "{mouth} {end}: {joints:?}");
            assert_eq!(check_outline(&body.contours), Ok(()));
            // Free in the middle, material on both sides of it, and nowhere wider than asked.
            for y in (18..40).map(f64::from) {
                let half = (end + (mouth - end) * (y - 10.0) / 30.0) / 2.0;
                let free = |x: f64| !contains(&body.contours, Vec2::new(x, y));
                assert!(free(0.01), "{mouth} {end} at {y}");
                let inner = (half - 5.0).max(0.0) + 0.45;
                assert!(inner > half || [-inner, inner].iter().all(|&x| !free(x)), "{mouth} {end} at {y}");
            }
            let gained = area(&body.contours) - whole;
            assert!(gained > 0.0 && gained < 5.0 * 75.0 + 20.0, "{gained}");
        }
    }

    #[test]
    fn a_dart_stays_filled_and_a_straight_seam_has_its_whole_width() {
        let (mut body, whole) = bay(6.0, 0.0);
        let before = area(&body.contours);
        let side = |points: &[Vec2], ends: [usize; 2], label| Own {
            ends: ends.map(VertexId::new),
            line: points.to_vec(),
            label,
            dart: false,
        };
        // Both shores are halved: the outer seam closes after the inner one.
        let [a, tip, b] = [0, 1, 2].map(|k| whole.line[k]);
        let (inner, outer) = ((a + tip) / 2.0, (b + tip) / 2.0);
        let mut own = vec![
            side(&[a, inner], [0, 1], 8),
            side(&[inner, tip], [1, 2], 7),
            side(&[tip, outer], [2, 3], 7),
            side(&[outer, b], [3, 4], 8),
        ];
        find_darts(&mut own);
        assert!(own.iter().all(|it| it.dart));
        let mut joints = Joints::default();
        sewn(&mut body, own, 5.0, 0.02, &mut joints);
        let gained = area(&body.contours) - before;
        // A little stands out beside the ends of the seam.
        assert!((90.0..92.0).contains(&gained), "{gained}");
        // Only where two seams of a shore meet, a step of the search counts as narrow.
        assert!(joints.narrow < 2.0 && Joints { narrow: 0.0, ..joints.clone() } == Joints::default(), "{joints:?}");
        let contours = vec![line(&[[0., 0.], [50., 0.], [50., 30.], [0., 30.]])];
        let mut body = Body { name: "B".into(), contours, marks: vec![] };
        sewn(&mut body, vec![side(&line(&[[0., 0.], [50., 0.], [50., 30.]]), [0, 1], 9)], 6.0, 0.02, &mut joints);
        let quarter = 9.0 * std::f64::consts::PI;
        assert!((area(&body.contours) - 1500.0 - 6.0 * 80.0 - quarter).abs() < 0.2, "{}", area(&body.contours));
    }
}
