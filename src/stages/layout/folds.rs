//! Edges bent so sharply that they must be folded, joined into lines.
use std::collections::BTreeMap;

use crate::{
    geom::{
        Vec2, angle_between,
        polygon::{edges, point_segment_distance},
        polyline::{ArcLength, simplify},
    },
    mesh::{EdgeId, HalfedgeId, Id, TriMesh, VertexId},
    model::{self, CutMesh, Flattening, Folded, FoldedCrease, Mark, Operation, PieceId, Run},
};

/// Fold lines end this far from the outline, mm, so that a score does not tear the edge.
const SETBACK: f64 = 0.3;
/// Shorter fold lines are left out, mm: no tool scores them and they crowd out the lettering.
const SHORTEST: f64 = 3.0;
/// Bends of a fold line smaller than this are straightened, mm.
const STRAIGHT: f64 = 0.01;

/// A line along which a piece is folded.
pub(super) struct Fold {
    pub(super) piece: PieceId,
    /// Mountain or valley.
    pub(super) operation: Operation,
    /// Vertices along it; a closed one repeats its first.
    pub(super) chain: Vec<VertexId>,
    /// Mean angle by which the faces on both sides are turned, radians.
    pub(super) angle: f64,
}

impl Fold {
    /// A halfedge of each of its edges, in order.
    pub(super) fn halfedges<'a>(&'a self, mesh: &'a TriMesh) -> impl Iterator<Item = HalfedgeId> + 'a {
        let between = |w: &[VertexId]| mesh.find_halfedge(w[0], w[1]).or_else(|| mesh.find_halfedge(w[1], w[0]));
        self.chain.windows(2).filter_map(between)
    }
}

/// Folds of every piece: interior edges bent by more than `fold_angle` (radians), mountain where the printed outer side is
/// convex, chained through vertices where exactly two folds of a kind meet.
pub(super) fn folds(cut: &CutMesh, fold_angle: f64) -> Vec<Fold> {
    let mut edges: BTreeMap<(PieceId, Operation), Vec<EdgeId>> = BTreeMap::new();
    for edge in cut.mesh.edges() {
        if let Some(operation) = fold(&cut.mesh, edge, fold_angle) {
            let piece = cut.piece_of[cut.mesh.face(cut.mesh.halfedge(edge))];
            edges.entry((piece, operation)).or_default().push(edge);
        }
    }
    let mut folds = Vec::new();
    for ((piece, operation), edges) in edges {
        for chain in chains(&cut.mesh, &edges) {
            let mut fold = Fold { piece, operation, chain, angle: 0.0 };
            let (mut sum, mut length) = (0.0, 0.0);
            for h in fold.halfedges(&cut.mesh) {
                let weight = cut.mesh.vector(h).norm();
                sum += weight * bend(&cut.mesh, h).unwrap_or(0.0);
                length += weight;
            }
            fold.angle = sum / length;
            folds.push(fold);
        }
    }
    folds
}

/// Angle between the normals on both sides of an edge.
fn bend(mesh: &TriMesh, h: HalfedgeId) -> Option<f64> {
    let twin = mesh.twin(h)?;
    Some(angle_between(mesh.normal(mesh.face(h)), mesh.normal(mesh.face(twin))))
}

/// The line as it is drawn, if it is long enough.
pub(super) fn mark(cut: &CutMesh, flat: &Flattening, fold: &Fold) -> Option<Mark> {
    let (points, closed) = line(cut, flat, &fold.chain)?;
    Some(Mark { operation: fold.operation, points, closed })
}

/// The creases that a piece was folded along as they are drawn: scores where it is known which way they fold, engraved lines
/// where it is not.
pub(super) fn creases(folded: Option<&Folded>, piece: PieceId, contours: &[Vec<Vec2>]) -> Vec<Mark> {
    let on_edge =
        |p: Vec2| contours.iter().flat_map(|it| edges(it)).any(|(a, b)| point_segment_distance(p, a, b) < SETBACK);
    let mark = |run: Run| {
        let operation = match run.fold {
            model::Fold::Mountain => Operation::ScoreMountain,
            model::Fold::Valley => Operation::ScoreValley,
            model::Fold::Unknown => Operation::Engrave,
        };
        let [start, end] = [run.points[0], run.points[run.points.len() - 1]].map(|p| !run.closed && on_edge(p));
        let points = if run.closed { run.points } else { trimmed(&run.points, start, end)? };
        let kept = simplify(&points, run.closed, STRAIGHT, &|_| false);
        Some(Mark { operation, points: kept.into_iter().map(|i| points[i]).collect(), closed: run.closed })
    };
    let own = folded.into_iter().flat_map(|it| &it.creases).filter(|it| it.piece == piece.index());
    own.flat_map(FoldedCrease::runs).filter_map(mark).collect()
}

/// Cuts of length `cut` through a fold instead of a line, at least `gap` apart, as real segments: a dash pattern would be
/// cut solid. The ends are left whole, so that the edge does not tear.
pub(super) fn perforated(mark: &Mark, cut: f64, gap: f64) -> Vec<Mark> {
    let ring = mark.points.iter().chain(mark.points.first().filter(|_| mark.closed));
    let Some(line) = ArcLength::new(ring.copied().collect()) else { return Vec::new() };
    let pitch = cut + gap;
    let step = line.length() / (line.length() / pitch).floor().max(1.0);
    let cut = cut.min(cut / pitch * step);
    let count = (line.length() / step).round() as usize;
    let piece = |k: usize| {
        let from = (k as f64 + 0.5) * step - cut / 2.0;
        Mark { operation: mark.operation, points: line.stretch(from, from + cut), closed: false }
    };
    (0..count).map(piece).collect()
}

/// What kind of fold an edge is, if it is one.
fn fold(mesh: &TriMesh, edge: EdgeId, fold_angle: f64) -> Option<Operation> {
    let h = mesh.halfedge(edge);
    if bend(mesh, h)? < fold_angle {
        return None;
    }
    let (left, right) = (mesh.normal(mesh.face(h)), mesh.normal(mesh.face(mesh.twin(h)?)));
    // On a ridge the normal turns about the edge, in its own direction, on the way from its left face to its right one.
    let convex = left.cross(&right).dot(&mesh.vector(h)) > 0.0;
    Some(if convex { Operation::ScoreMountain } else { Operation::ScoreValley })
}

/// Maximal chains of edges through inner vertices that exactly two of them share; a closed chain repeats its first vertex.
fn chains(mesh: &TriMesh, edges: &[EdgeId]) -> Vec<Vec<VertexId>> {
    let mut around: BTreeMap<VertexId, Vec<usize>> = BTreeMap::new();
    for (i, &edge) in edges.iter().enumerate() {
        for v in mesh.edge_vertices(edge) {
            around.entry(v).or_default().push(i);
        }
    }
    let joins = |v: VertexId| around[&v].len() == 2 && !mesh.is_boundary_vertex(v);
    let mut used = vec![false; edges.len()];
    let mut walk = |start: VertexId, first: usize| {
        let mut chain = vec![start];
        let mut at = start;
        let mut next = Some(first).filter(|&i| !used[i]);
        while let Some(i) = next {
            used[i] = true;
            let [a, b] = mesh.edge_vertices(edges[i]);
            at = if at == a { b } else { a };
            chain.push(at);
            next = around[&at].iter().copied().find(|&k| joins(at) && !used[k]);
        }
        chain
    };
    let mut chains = Vec::new();
    for ends_only in [true, false] {
        for (&v, list) in &around {
            if ends_only && joins(v) {
                continue;
            }
            chains.extend(list.iter().map(|&i| walk(v, i)).filter(|it| it.len() > 1));
        }
    }
    chains
}

/// The chain in the plane, shortened where it ends on the outline; its points and whether it is closed.
fn line(cut: &CutMesh, flat: &Flattening, chain: &[VertexId]) -> Option<(Vec<Vec2>, bool)> {
    let (first, last) = (chain[0], chain[chain.len() - 1]);
    let mut points: Vec<Vec2> = chain.iter().map(|&v| flat.uv[v]).collect();
    let closed = first == last && chain.len() > 3;
    if closed {
        points.pop();
    } else {
        points = trimmed(&points, cut.mesh.is_boundary_vertex(first), cut.mesh.is_boundary_vertex(last))?;
    }
    let kept = simplify(&points, closed, STRAIGHT, &|_| false);
    Some((kept.into_iter().map(|i| points[i]).collect(), closed))
}

/// Takes [`SETBACK`] off the ends asked for; `None` when too little is left.
fn trimmed(points: &[Vec2], start: bool, end: bool) -> Option<Vec<Vec2>> {
    let line = ArcLength::new(points.to_vec())?;
    let from = if start { SETBACK } else { 0.0 };
    let to = line.length() - if end { SETBACK } else { 0.0 };
    if to - from < SHORTEST {
        return None;
    }
    Some(line.stretch(from, to))
}
