//! What two pieces would be like along a run of edges, foreseen from how each of them lies: most runs that cannot be glued
//! show it without anything being laid flat.
use super::piece::Piece;
use crate::{
    geom::{
        Box2, Vec2, cross2,
        polygon::{contains, edges, point_segment_distance},
    },
    mesh::{EdgeId, TriMesh},
};

/// A corner deeper inside the other piece than this share of its distance from the hinge will not come out of it: laid
/// flat together, pieces turn about the hinge by less.
const DEPTH: f64 = 0.08;

/// The second piece moved so that its side of `run` lies on the first one's. Both lie flat; their only common edges need
/// not be those of the run.
pub(super) struct Hinge {
    /// Contours of the second piece in the frame of the first.
    moved: Vec<Vec<Vec2>>,
    /// Middle of the hinge.
    middle: Vec2,
    /// Distance between the ends of the run, mm.
    pub(super) span: f64,
}

impl Hinge {
    /// `None` where one of the pieces does not lie flat.
    pub(super) fn new(mesh: &TriMesh, first: &Piece, second: &Piece, run: &[EdgeId]) -> Option<Self> {
        let mut sides: Vec<[Vec2; 4]> = Vec::with_capacity(run.len());
        for &e in run {
            let h = mesh.halfedge(e);
            let twin = mesh.twin(h)?;
            let (own, other) = first.flat_edge(h).map_or((twin, h), |_| (h, twin));
            let ([a, b], [c, d]) = (first.flat_edge(own)?, second.flat_edge(other)?);
            sides.push([a, b, d, c]);
        }
        // The rigid motion that brings the points of the second onto those of the first, best in the mean.
        let count = 2.0 * sides.len() as f64;
        let middle = |k: usize| sides.iter().map(|it| it[k] + it[k + 1]).sum::<Vec2>() / count;
        let (here, there) = (middle(0), middle(2));
        let (mut cos, mut sin) = (0.0, 0.0);
        for [a, b, c, d] in &sides {
            for (p, q) in [(a, c), (b, d)] {
                cos += (q - there).dot(&(p - here));
                sin += cross2(q - there, p - here);
            }
        }
        let turn = Vec2::new(cos, sin).normalize();
        let moved = |q: &Vec2| {
            let q = q - there;
            here + Vec2::new(turn.x * q.x - turn.y * q.y, turn.y * q.x + turn.x * q.y)
        };
        let ends = sides.iter().flat_map(|it| [it[0], it[1]]);
        let far = |p: Vec2| ends.clone().map(|q| (p - q).norm()).fold(0.0, f64::max);
        Some(Self {
            moved: second.contours.iter().map(|it| it.iter().map(moved).collect()).collect(),
            middle: here,
            span: ends.clone().map(far).fold(0.0, f64::max),
        })
    }

    /// Whether one piece comes to lie deep on the other.
    pub(super) fn overlaps(&self, first: &Piece) -> bool {
        let deep = |of: &[Vec<Vec2>], within: &[Vec<Vec2>]| {
            let bounds = Box2::of(within.iter().flatten());
            of.iter().flatten().any(|&p| {
                let depth = DEPTH * (p - self.middle).norm();
                let inside = bounds.touches(&Box2 { min: p, max: p }) && contains(within, p);
                inside && within.iter().flat_map(|it| edges(it)).all(|(a, b)| point_segment_distance(p, a, b) > depth)
            })
        };
        deep(&self.moved, &first.contours) || deep(&first.contours, &self.moved)
    }
}
