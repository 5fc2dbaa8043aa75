//! Keeps a surface that loses edges within a distance of the one it came from, both ways, collapse by collapse.
//!
//! Every vertex of the source belongs to a face of the current surface near it and moves on to a face around the new
//! vertex when an edge collapses there (Klein, Liebich, Straßer: Mesh reduction with error control, Visualization 1996);
//! the other way the distance of the new faces is bounded with proof. Between its vertices the source may still stick out,
//! so the caller bounds the distance of the result and tightens the limit if it must.
use crate::{
    geom::{Vec3, closest_on_triangle},
    mesh::{Bvh, HalfedgeId, Id, TriMesh, distance::is_within},
    surface::{
        collapse::{FanFace, fan_after},
        edit::EditMesh,
    },
};

/// Share of the limit given up so that the proof for a face ends.
const RESOLUTION: f64 = 0.05;

/// The limit, and what is needed to hold it.
pub(super) struct Tolerance<'a> {
    source: &'a TriMesh,
    bvh: &'a Bvh,
    limit: f64,
    /// Per face of the current surface, the vertices of the source that belong to it.
    points: Vec<Vec<u32>>,
    /// For the collapse that was allowed last: the face that each point goes to.
    moves: Vec<(u32, u32)>,
}

impl<'a> Tolerance<'a> {
    /// For a surface that still is the source. `bvh` is that of `source`.
    pub(super) fn new(source: &'a TriMesh, bvh: &'a Bvh, limit: f64) -> Self {
        let mut points = vec![Vec::new(); source.face_count()];
        for v in source.vertices() {
            if let Some(h) = source.outgoing(v).next() {
                points[source.face(h).index()].push(v.0);
            }
        }
        Self { source, bvh, limit, points, moves: Vec::new() }
    }

    /// Whether the collapse of `h` to `position` keeps the new faces, and the vertices of the source near them, within the
    /// limit. The cheap tests come first.
    pub(super) fn allows(&mut self, mesh: &EditMesh, h: HalfedgeId, position: Vec3) -> bool {
        let near = |p: Vec3| self.bvh.is_within(p, self.limit);
        if !near(position) {
            return false;
        }
        let fan = fan_after(mesh, h, position);
        fan.iter().all(|(_, [a, b, c])| near((a + b + c) / 3.0))
            && self.assign(mesh, h, &fan)
            && fan.iter().all(|(_, corners)| is_within(*corners, self.bvh, self.limit, RESOLUTION))
    }

    /// Finds a face of the fan within the limit for every point of the faces that it replaces.
    fn assign(&mut self, mesh: &EditMesh, h: HalfedgeId, fan: &[FanFace]) -> bool {
        self.moves.clear();
        let limit = self.limit * self.limit;
        let dying = [Some(h), mesh.twin(h)].into_iter().flatten().map(|h| (mesh.face(h).0, None));
        let staying = fan.iter().map(|(opposite, corners)| (mesh.face(*opposite).0, Some(corners)));
        for (face, corners) in dying.chain(staying) {
            for &point in &self.points[face as usize] {
                let p = self.source.positions().as_slice()[point as usize];
                let own = corners.map_or(f64::INFINITY, |corners| closest_on_triangle(&p, corners).1);
                let mut best = (own, face);
                // Well within the limit there is no need to look for a closer face.
                if own > limit / 4.0 {
                    for (opposite, corners) in fan {
                        let (_, squared) = closest_on_triangle(&p, corners);
                        if squared < best.0 {
                            best = (squared, mesh.face(*opposite).0);
                        }
                    }
                }
                if best.0 > limit {
                    return false;
                }
                self.moves.push((point, best.1));
            }
        }
        true
    }

    /// Takes note of a collapse that was just allowed; call it before the collapse.
    pub(super) fn collapse(&mut self, mesh: &EditMesh, h: HalfedgeId) {
        for v in [mesh.tail(h), mesh.head(h)] {
            for out in mesh.outgoing(v) {
                self.points[mesh.face(out).index()].clear();
            }
        }
        for (point, face) in self.moves.drain(..) {
            self.points[face as usize].push(point);
        }
    }
}
