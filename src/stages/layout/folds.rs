//! Edges bent so sharply that they must be folded, joined into lines.
use std::collections::BTreeMap;

use crate::{
    geom::{
        Vec2, angle_between,
        polyline::{ArcLength, simplify},
    },
    mesh::{EdgeId, TriMesh, VertexId},
    model::{CutMesh, Flattening, Mark, Operation, PieceId},
};

/// Fold lines end this far from the outline, mm, so that a score does not tear the edge.
const SETBACK: f64 = 0.3;
/// Shorter fold lines are left out, mm: no tool scores them and they crowd out the lettering.
const SHORTEST: f64 = 3.0;
/// Bends of a fold line smaller than this are straightened, mm.
const STRAIGHT: f64 = 0.01;

/// Fold marks of every piece: interior edges bent by more than `fold_angle` (radians), mountain where the printed outer
/// side is convex, chained through vertices where exactly two folds of a kind meet.
pub(super) fn folds(cut: &CutMesh, flat: &Flattening, fold_angle: f64) -> BTreeMap<PieceId, Vec<Mark>> {
    let mut edges: BTreeMap<(PieceId, Operation), Vec<EdgeId>> = BTreeMap::new();
    for edge in cut.mesh.edges() {
        if let Some(operation) = fold(&cut.mesh, edge, fold_angle) {
            let piece = cut.piece_of[cut.mesh.face(cut.mesh.halfedge(edge))];
            edges.entry((piece, operation)).or_default().push(edge);
        }
    }
    let mut marks: BTreeMap<PieceId, Vec<Mark>> = BTreeMap::new();
    for ((piece, operation), edges) in edges {
        let lines = chains(&cut.mesh, &edges).into_iter().filter_map(|chain| line(cut, flat, &chain));
        marks.entry(piece).or_default().extend(lines.map(|(points, closed)| Mark { operation, points, closed }));
    }
    marks
}

/// What kind of fold an edge is, if it is one.
fn fold(mesh: &TriMesh, edge: EdgeId, fold_angle: f64) -> Option<Operation> {
    let h = mesh.halfedge(edge);
    let twin = mesh.twin(h)?;
    let (left, right) = (mesh.normal(mesh.face(h)), mesh.normal(mesh.face(twin)));
    if angle_between(left, right) < fold_angle {
        return None;
    }
    // On a ridge the normal turns about the edge, in its own direction, on the way from its left face to its right one.
    let convex = left.cross(&right).dot(&mesh.vector(h)) > 0.0;
    Some(if convex { Operation::ScoreMountain } else { Operation::ScoreValley })
}

/// Maximal chains of edges through vertices that exactly two of them share; a closed chain repeats its first vertex.
fn chains(mesh: &TriMesh, edges: &[EdgeId]) -> Vec<Vec<VertexId>> {
    let mut around: BTreeMap<VertexId, Vec<usize>> = BTreeMap::new();
    for (i, &edge) in edges.iter().enumerate() {
        for v in mesh.edge_vertices(edge) {
            around.entry(v).or_default().push(i);
        }
    }
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
            next = match around[&at][..] {
                [i, j] => [i, j].into_iter().find(|&k| !used[k]),
                _ => None,
            };
        }
        chain
    };
    let mut chains = Vec::new();
    for ends_only in [true, false] {
        for (&v, list) in &around {
            if ends_only && list.len() == 2 {
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
    let between = line.along().iter().zip(points).filter(|(s, _)| (from..to).contains(*s) && **s > from);
    let mut kept = vec![line.at(from).0];
    kept.extend(between.map(|it| *it.1));
    kept.push(line.at(to).0);
    Some(kept)
}
