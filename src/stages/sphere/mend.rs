//! Mends the slivers that slicing leaves: vertices close beside a line are collapsed onto it, and edges are turned where that
//! opens narrow corners. Neither moves a line by more than the length of a short edge, nor changes the slices.
use crate::{
    geom::Vec3,
    mesh::{HalfedgeId, Id, VertexId},
    surface::{
        collapse::{Guard, quality},
        edit::EditMesh,
    },
};

/// An edge is short when it is under this share of the mean length of the edges that were there before the slices.
const SHORT: f64 = 0.25;
/// Faces of a lower quality are slivers, whose edges may be turned.
const SLIVER: f64 = 0.35;
/// Rounds at most; each works on what the one before left.
const ROUNDS: usize = 8;
/// Faces turn by at most 20°, which is what a slice through a facetted model may smooth away.
const GUARD: Guard = Guard { min_cosine: 0.94, min_quality: 0.02, min_fold: -0.5 };

/// Mends the faces around the marked edges; `points` is the image on the sphere of every vertex, dead ones too, `sizes` the mean
/// length of the edges around it before the slices.
pub(super) fn mend(edit: &mut EditMesh, points: &[Vec3], sizes: &[f64]) {
    for _ in 0..ROUNDS {
        if collapse(edit, points, sizes) + turn(edit, points) == 0 {
            break;
        }
    }
}

fn is_open(points: &[Vec3], corners: [VertexId; 3]) -> bool {
    let [a, b, c] = corners.map(|v| points[v.index()]);
    a.dot(&b.cross(&c)) > 0.0
}

/// Collapses short edges that end on a line; how many.
fn collapse(edit: &mut EditMesh, points: &[Vec3], sizes: &[f64]) -> usize {
    let mut short: Vec<(f64, HalfedgeId)> =
        edit.edges().filter(|&h| is_short(edit, sizes, h)).map(|h| (edit.vector(h).norm(), h)).collect();
    short.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let mut done = 0;
    for (_, edge) in short {
        if !edit.is_alive(edge) || !is_short(edit, sizes, edge) {
            continue;
        }
        let both = [Some(edge), edit.twin(edge)];
        if let Some(h) = both.into_iter().flatten().find(|&h| may_collapse(edit, points, h)) {
            edit.collapse(h, edit.position(edit.head(h)));
            done += 1;
        }
    }
    done
}

fn is_short(edit: &EditMesh, sizes: &[f64], h: HalfedgeId) -> bool {
    let [a, b] = [edit.tail(h), edit.head(h)].map(|v| sizes[v.index()]);
    edit.vector(h).norm() < SHORT * a.min(b)
}

/// Whether the tail of `h` may go: it lies beside a line and the head on it, or both on the same line and nowhere else.
fn may_collapse(edit: &mut EditMesh, points: &[Vec3], h: HalfedgeId) -> bool {
    let (u, v) = (edit.tail(h), edit.head(h));
    let lines = |v: VertexId| edit.spokes(v).filter(|&it| edit.is_marked(it)).count();
    let onto_line = lines(u) == 0 && lines(v) > 0;
    let along_line = lines(u) == 2 && edit.is_marked(h);
    if !(onto_line || along_line) {
        return false;
    }
    let opens = |out: HalfedgeId| {
        let (b, c) = (edit.head(out), edit.apex(out));
        b == v || c == v || is_open(points, [v, b, c])
    };
    edit.outgoing(u).all(opens) && GUARD.allows(edit, h, edit.position(v)) && edit.can_collapse(h)
}

/// Turns edges beside slivers; how many.
fn turn(edit: &mut EditMesh, points: &[Vec3]) -> usize {
    let mut done = 0;
    for h in edit.edges().collect::<Vec<_>>() {
        if may_turn(edit, points, h) {
            edit.flip(h);
            done += 1;
        }
    }
    done
}

fn may_turn(edit: &EditMesh, points: &[Vec3], h: HalfedgeId) -> bool {
    let Some(t) = edit.twin(h) else { return false };
    let [a, b, c, d] = [edit.tail(h), edit.head(h), edit.apex(h), edit.apex(t)];
    let place = |corners: [VertexId; 3]| corners.map(|v| edit.position(v));
    let (before, after) = ([[a, b, c], [b, a, d]], [[d, c, a], [c, d, b]]);
    let worst = |pair: [[VertexId; 3]; 2]| quality(place(pair[0])).min(quality(place(pair[1])));
    if worst(before) >= SLIVER || worst(after) <= 1.2 * worst(before) || !edit.can_flip(h) {
        return false;
    }
    let normal = |corners: [VertexId; 3]| {
        let [p, q, r] = place(corners);
        (q - p).cross(&(r - p))
    };
    // The mean of both normals: a sliver has none of its own.
    let old = (normal(before[0]) + normal(before[1])).normalize();
    let level = |corners: [VertexId; 3]| {
        let n = normal(corners);
        n.dot(&old) >= GUARD.min_cosine * n.norm()
    };
    let flat = before.into_iter().filter(|&it| quality(place(it)) > 0.01).all(level);
    flat && after.into_iter().all(|it| level(it) && is_open(points, it))
}
