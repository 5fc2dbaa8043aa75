//! Seams measured on both sides, and the ticks that match across them.
use std::collections::BTreeSet;

use crate::{
    geom::{
        Box2, Vec2, angle_between, cross2,
        polygon::{contains, segment_distance, turned},
        segment_tree::{Segment, SegmentTree},
    },
    mesh::{Field, HalfedgeId, VertexId},
    model::{CutMesh, Flattening, Mark, Operation, PieceId},
};

/// Ticks begin this far inside the outline, mm, so that they stay in the part where a slit was opened.
const INSET: f64 = 0.2;
/// Share of the room in front of a tick that it may take, so that ticks from opposite sides never meet.
const ROOM: f64 = 0.4;
/// Shorter ticks cannot be seen and are left out, mm.
const SHORTEST: f64 = 0.5;
/// Kept free between a tick and any other mark, mm.
const APART: f64 = 0.3;

/// One side of a seam in the plane, in the order of travel of side 0.
#[derive(Debug, Clone)]
pub(super) struct Side {
    pub(super) piece: PieceId,
    points: Vec<Vec2>,
    /// First and last vertex.
    ends: [VertexId; 2],
    /// +1 when the piece lies on the left of the points, −1 on the right.
    pub(super) left: f64,
}

/// A seam with the length of the developed mesh along it: the same parameter is the same point of the surface on both
/// sides.
#[derive(Debug, Clone)]
pub(super) struct Measured {
    pub(super) label: u32,
    pub(super) sides: [Side; 2],
    along: Vec<f64>,
    /// Angle between the faces on both sides of each edge, radians.
    turns: Vec<f64>,
}

impl Measured {
    /// Length on the developed mesh, mm.
    pub(super) fn length(&self) -> f64 {
        self.along[self.along.len() - 1]
    }

    /// Whether the two sides meet in a point of one piece: a slit, which shows by itself what belongs together.
    pub(super) fn is_slit(&self) -> bool {
        let [a, b] = &self.sides;
        a.ends[0] == b.ends[0] || a.ends[1] == b.ends[1]
    }

    /// Index of the point after the edge at `s`.
    fn after(&self, s: f64) -> usize {
        self.along.partition_point(|&it| it < s).clamp(1, self.along.len() - 1)
    }

    /// By what angle the surface turns across the seam there, radians.
    pub(super) fn turn(&self, s: f64) -> f64 {
        self.turns[self.after(s) - 1]
    }

    fn point(&self, side: usize, s: f64) -> Vec2 {
        let k = self.after(s);
        let t = ((s - self.along[k - 1]) / (self.along[k] - self.along[k - 1])).clamp(0.0, 1.0);
        let points = &self.sides[side].points;
        points[k - 1] + (points[k] - points[k - 1]) * t
    }

    /// Points of a side from one parameter to another.
    pub(super) fn stretch(&self, side: usize, [from, to]: [f64; 2]) -> Vec<Vec2> {
        let inner = self.along.iter().zip(&self.sides[side].points).filter(|(s, _)| from < **s && **s < to);
        let ends = [from, to].map(|s| self.point(side, s));
        std::iter::once(ends[0]).chain(inner.map(|it| *it.1)).chain([ends[1]]).collect()
    }

    /// End vertices and points of a side as one travels around its piece, which lies on the left.
    pub(super) fn travelled(&self, side: usize) -> ([VertexId; 2], Vec<Vec2>) {
        let Side { points, ends, left, .. } = &self.sides[side];
        match *left > 0.0 {
            true => (*ends, points.clone()),
            false => ([ends[1], ends[0]], points.iter().rev().copied().collect()),
        }
    }

    /// Point at `s` on a side and the unit normal into the piece there, taken over ±`reach` along the seam.
    pub(super) fn at(&self, side: usize, s: f64, reach: f64) -> Option<(Vec2, Vec2)> {
        let chord = self.point(side, s + reach) - self.point(side, s - reach);
        let direction = chord.try_normalize(1e-9)?;
        Some((self.point(side, s), Vec2::new(-direction.y, direction.x) * self.sides[side].left))
    }
}

/// All seams, measured.
pub(super) fn measure(cut: &CutMesh, flat: &Flattening) -> Vec<Measured> {
    let mesh = &cut.mesh;
    let seams = cut.seams.iter().filter(|it| !it.sides[0].is_empty());
    seams
        .map(|seam| {
            let [first, second] = &seam.sides;
            let mut along = vec![0.0];
            for &h in first {
                along.push(along[along.len() - 1] + mesh.vector(h).norm());
            }
            let forward = first.iter().map(|&h| mesh.tail(h)).chain(first.last().map(|&h| mesh.head(h)));
            let backward = second.iter().map(|&h| mesh.head(h)).chain(second.last().map(|&h| mesh.tail(h)));
            let side = |h, vertices: Vec<VertexId>, left| Side {
                piece: cut.piece_of[mesh.face(h)],
                points: vertices.iter().map(|&v| flat.uv[v]).collect(),
                ends: [vertices[0], vertices[vertices.len() - 1]],
                left,
            };
            let sides = [side(first[0], forward.collect(), 1.0), side(second[0], backward.collect(), -1.0)];
            let normal = |h: HalfedgeId| mesh.normal(mesh.face(h));
            let turns = first.iter().zip(second).map(|(&h, &g)| angle_between(normal(h), normal(g))).collect();
            Measured { label: seam.label, sides, along, turns }
        })
        .collect()
}

/// Vertices of the cut mesh where a seam begins or ends, on either side.
pub(super) fn ends(cut: &CutMesh, seams: &[Measured]) -> Field<VertexId, bool> {
    let mut ends = Field::filled(cut.mesh.vertex_count(), false);
    for v in seams.iter().flat_map(|it| &it.sides).flat_map(|it| it.ends) {
        ends[v] = true;
    }
    ends
}

/// Where the ticks of a seam lie between its ends, mm along it: an odd number of equal steps, so that the middle stays
/// free for the number.
pub(super) fn tick_places(length: f64, spacing: f64) -> Vec<f64> {
    let steps = 2 * ((length / spacing - 1.0) / 2.0).round().max(0.0) as usize + 1;
    (1..steps).map(|k| length * k as f64 / steps as f64).collect()
}

/// How match marks are made.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ticks {
    /// Their length where there is room, mm.
    pub(super) longest: f64,
    /// Their distance along a seam, about, mm.
    pub(super) spacing: f64,
    /// Whether they are notches outside the seam, where they do not show on the finished thing.
    pub(super) outward: bool,
}

/// Match marks of a piece: one tick where a seam begins or ends, along the bisector of the corner, and ticks at equal
/// steps along every seam, straight into the piece. `marks` are the lines already there (folds): a tick at an end that
/// would run into one is left out, because the fold marks the place.
pub(super) fn ticks(
    cut: &CutMesh,
    flat: &Flattening,
    piece: PieceId,
    contours: &[Vec<Vec2>],
    marks: &[Mark],
    seams: &[Measured],
    style: Ticks,
) -> Vec<Mark> {
    let outline = SegmentTree::of_contours(contours);
    let folds = SegmentTree::of_polylines(&marks.iter().map(|it| it.points.clone()).collect::<Vec<_>>());
    let own = || seams.iter().flat_map(|it| [(it, 0), (it, 1)]).filter(|(it, side)| it.sides[*side].piece == piece);
    let corners: BTreeSet<VertexId> = own().flat_map(|(it, side)| it.sides[side].ends).collect();
    let Ticks { longest, spacing, outward } = style;
    let corners = corners.into_iter().filter(|_| !outward);
    let mut starts: Vec<(Vec2, Vec2, bool)> =
        corners.filter_map(|v| Some((flat.uv[v], bisector(cut, flat, v)?, true))).collect();
    for (seam, side) in own() {
        let places = tick_places(seam.length(), spacing);
        let reach = longest.min(seam.length() / 4.0);
        starts.extend(
            places
                .into_iter()
                .filter_map(|s| seam.at(side, s, reach))
                .map(|(p, n)| (p, if outward { -n } else { n }, false)),
        );
    }
    let mut ticks: Vec<[Vec2; 2]> = Vec::new();
    for (at, inward, corner) in starts {
        let from = at + inward * INSET;
        if !contains(contours, from) {
            continue;
        }
        let mut length = (longest - INSET).min(room(&outline, from, inward, longest / ROOM) * ROOM);
        // A tick that would touch another is halved; one that still does is left out.
        let clear = |to: Vec2| {
            let window = Box2::of([&from, &to]).grown(APART);
            let apart = |s: &Segment| segment_distance(s.a, s.b, from, to) >= APART;
            ticks.iter().all(|it| segment_distance(it[0], it[1], from, to) >= APART)
                && (!corner || folds.visit(&window, &mut |s| apart(s)))
        };
        if !clear(from + inward * length) {
            length /= 2.0;
        }
        if length >= SHORTEST && clear(from + inward * length) {
            ticks.push([from, from + inward * length]);
        }
    }
    let mark = |it: [Vec2; 2]| Mark { operation: Operation::Registration, points: it.to_vec(), closed: false };
    ticks.into_iter().map(mark).collect()
}

/// Direction that halves the corner of the piece at a boundary vertex. The angle is summed over the faces, so that the
/// two sides of a closed slit are told from the inside of a needle.
fn bisector(cut: &CutMesh, flat: &Flattening, v: VertexId) -> Option<Vec2> {
    let mesh = &cut.mesh;
    let ray = |w: VertexId| flat.uv[w] - flat.uv[v];
    let mut total = 0.0;
    let mut first = None;
    for h in mesh.outgoing(v) {
        let (a, b) = (ray(mesh.head(h)), ray(mesh.tail(mesh.previous(h))));
        first.get_or_insert(a);
        total += cross2(a, b).atan2(a.dot(&b));
    }
    turned(first?, total / 2.0).try_normalize(1e-9)
}

/// Free length in front of a point, mm, looked for up to `limit`.
fn room(outline: &SegmentTree, from: Vec2, direction: Vec2, limit: f64) -> f64 {
    let to = from + direction * limit;
    let mut free = limit;
    outline.visit(&Box2::of([&from, &to]), &mut |s| {
        let along = s.b - s.a;
        let denominator = cross2(direction, along);
        if denominator != 0.0 && segment_distance(s.a, s.b, from, to) == 0.0 {
            free = free.min((cross2(s.a - from, along) / denominator).max(0.0));
        }
        true
    });
    free
}
