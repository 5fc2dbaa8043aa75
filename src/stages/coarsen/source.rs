//! The surface that remeshing follows: closest points on it, on its boundary and on its creases, and how long edges should
//! be where.
use std::{cmp::Reverse, collections::BinaryHeap};

use crate::{
    geom::{Vec3, angle_between},
    mesh::{Bvh, EdgeId, FaceId, Field, TriMesh, VertexId},
};

/// The target length of edges changes by at most this much per length along the surface.
const GRADATION: f64 = 0.5;
/// Turn of a curve, seen at the scale of the target length, from which it has a corner.
const CORNER: f64 = std::f64::consts::FRAC_PI_4;
/// Connected creases whose total length is less than this many edges are taken for noise.
const SHORTEST_CREASE: f64 = 4.0;

/// Where a vertex may move.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Kind {
    /// Anywhere on the surface.
    Free,
    /// Along a crease or the boundary.
    Curve,
    /// Nowhere: curves meet, end or turn here.
    Corner,
}

/// A place on the source.
#[derive(Debug, Clone, Copy)]
pub(super) struct Spot {
    pub(super) point: Vec3,
    /// A face there.
    pub(super) face: FaceId,
    /// Target length of edges there.
    pub(super) size: f64,
}

/// The source with its search structures and its sizing field.
pub(super) struct Source<'a> {
    pub(super) mesh: &'a TriMesh,
    pub(super) bvh: &'a Bvh,
    pub(super) creases: Field<EdgeId, bool>,
    boundary_curve: Option<Curve>,
    crease_curve: Option<Curve>,
    /// Target length of edges per vertex, mm.
    sizes: Field<VertexId, f64>,
}

/// Edges of the source that can be searched for the closest point.
struct Curve {
    bvh: Bvh,
    edges: Vec<EdgeId>,
}

impl Curve {
    fn new(mesh: &TriMesh, edges: Vec<EdgeId>) -> Option<Self> {
        // A segment is a degenerate triangle.
        let corners: Vec<_> =
            edges.iter().map(|&e| mesh.edge_vertices(e).map(|v| mesh.position(v))).map(|[a, b]| [a, b, b]).collect();
        (!edges.is_empty()).then(|| Self { bvh: Bvh::of_triangles(corners), edges })
    }
}

impl<'a> Source<'a> {
    pub(super) fn new(mesh: &'a TriMesh, bvh: &'a Bvh, size: f64, feature_angle: f64) -> Self {
        let creases = creases(mesh, feature_angle.cos(), SHORTEST_CREASE * size);
        let select = |keep: &dyn Fn(EdgeId) -> bool| mesh.edges().filter(|&e| keep(e)).collect::<Vec<_>>();
        Self {
            mesh,
            bvh,
            boundary_curve: Curve::new(mesh, select(&|e| mesh.is_boundary_edge(e))),
            crease_curve: Curve::new(mesh, select(&|e| creases[e])),
            creases,
            sizes: Field::filled(mesh.vertex_count(), size),
        }
    }

    /// The closest place on the surface, searched from a face nearby.
    pub(super) fn closest(&self, p: Vec3, hint: FaceId) -> Spot {
        let found = self.bvh.closest_from(p, hint);
        let corners = self.mesh.face_vertices(found.face);
        let size = corners.iter().zip(found.barycentric).map(|(&v, b)| self.sizes[v] * b).sum();
        Spot { point: found.point, face: found.face, size }
    }

    /// Whether a triangle looks the other way than the surface closest to its centroid, searched from a face nearby. Only
    /// searched for if it does not look about the same way as that face.
    pub(super) fn looks_away(&self, [a, b, c]: [Vec3; 3], hint: FaceId) -> bool {
        let normal = (b - a).cross(&(c - a));
        let dot = |face| normal.dot(&self.mesh.area_vector(face));
        let agrees = dot(hint) > 0.5 * normal.norm() * self.mesh.area_vector(hint).norm();
        !agrees && dot(self.bvh.closest_from((a + b + c) / 3.0, hint).face) < 0.0
    }

    /// The closest place on the boundary or on the creases; `None` if there are none.
    pub(super) fn closest_on_curve(&self, p: Vec3, boundary: bool) -> Option<Spot> {
        let curve = if boundary { &self.boundary_curve } else { &self.crease_curve }.as_ref()?;
        let found = curve.bvh.closest(p);
        let edge = curve.edges[found.face.0 as usize];
        let [a, b] = self.mesh.edge_vertices(edge).map(|v| self.sizes[v]);
        let size = a * found.barycentric[0] + b * (1.0 - found.barycentric[0]);
        Some(Spot { point: found.point, face: self.mesh.face(self.mesh.halfedge(edge)), size })
    }

    /// The segments of the boundary or of the creases, each with a face there.
    pub(super) fn curve(&self, boundary: bool) -> impl Iterator<Item = (FaceId, [Vec3; 2])> {
        let curve = if boundary { &self.boundary_curve } else { &self.crease_curve };
        curve.iter().flat_map(|it| &it.edges).map(|&e| {
            (self.mesh.face(self.mesh.halfedge(e)), self.mesh.edge_vertices(e).map(|v| self.mesh.position(v)))
        })
    }

    /// Scales all target lengths.
    pub(super) fn scale_sizes(&mut self, factor: f64) {
        self.sizes.as_mut_slice().iter_mut().for_each(|it| *it *= factor);
    }

    /// Lowers target lengths at the corners of faces to `lower(target length, wish)`, and around them as far as the gradation
    /// asks.
    pub(super) fn lower_sizes(&mut self, wishes: &[(FaceId, f64)], lower: impl Fn(f64, f64) -> f64) {
        let before = self.sizes.clone();
        // Dijkstra: sizes are positive, so their bits are ordered like they are.
        let entry = |v: VertexId, size: f64| Reverse((size.to_bits(), v));
        let mut open = BinaryHeap::new();
        for &(face, wish) in wishes {
            for v in self.mesh.face_vertices(face) {
                let size = lower(before[v], wish);
                if size < self.sizes[v] {
                    self.sizes[v] = size;
                    open.push(entry(v, size));
                }
            }
        }
        while let Some(Reverse((bits, v))) = open.pop() {
            if bits != self.sizes[v].to_bits() {
                continue;
            }
            for w in self.mesh.neighbors(v) {
                let reach = (self.mesh.position(w) - self.mesh.position(v)).norm();
                let size = f64::from_bits(bits) + GRADATION * reach;
                if size < self.sizes[w] {
                    self.sizes[w] = size;
                    open.push(entry(w, size));
                }
            }
        }
    }

    /// What every vertex of the source may do: [`Kind::Corner`] where not exactly two curve edges meet, or where they turn.
    pub(super) fn kinds(&self, scale: f64) -> Field<VertexId, Kind> {
        let mesh = self.mesh;
        let is_curve = |e: EdgeId| mesh.is_boundary_edge(e) || self.creases[e];
        let mut along = Field::filled(mesh.vertex_count(), Vec::new());
        for e in mesh.edges().filter(|&e| is_curve(e)) {
            let [a, b] = mesh.edge_vertices(e);
            along[a].push(b);
            along[b].push(a);
        }
        // Largest turns first, so that each suppresses the smaller ones next to it.
        let mut turns: Vec<(f64, VertexId)> = Vec::new();
        let mut kinds = Field::from_fn(mesh.vertex_count(), |v: VertexId| match along[v].as_slice() {
            [] => Kind::Free,
            &[a, b] => {
                let [p, q] = [a, b].map(|next| walk(mesh, &along, v, next, scale, |_| ()));
                let at = mesh.position(v);
                let turn = angle_between(at - p, q - at);
                if turn > CORNER {
                    turns.push((turn, v));
                }
                Kind::Curve
            }
            _ => Kind::Corner,
        });
        turns.sort_by(|x, y| y.0.total_cmp(&x.0).then(x.1.cmp(&y.1)));
        for (_, v) in turns {
            let mut taken = false;
            for &next in &along[v] {
                walk(mesh, &along, v, next, scale, |w| taken |= kinds[w] == Kind::Corner);
            }
            if !taken {
                kinds[v] = Kind::Corner;
            }
        }
        kinds
    }
}

/// The point at arc length `length` from `v` along a curve that starts towards `next`, or where it ends or branches;
/// `visit` sees the vertices passed.
fn walk(
    mesh: &TriMesh,
    along: &Field<VertexId, Vec<VertexId>>,
    v: VertexId,
    next: VertexId,
    length: f64,
    mut visit: impl FnMut(VertexId),
) -> Vec3 {
    let (mut from, mut to, mut left) = (v, next, length);
    loop {
        let (p, q) = (mesh.position(from), mesh.position(to));
        let step = (q - p).norm();
        if step >= left {
            return p + (q - p) * (left / step);
        }
        left -= step;
        visit(to);
        match along[to].as_slice() {
            &[a, b] if to != v => (from, to) = (to, if a == from { b } else { a }),
            _ => return q,
        }
    }
}

/// Edges with a dihedral angle beyond the given cosine, less the groups shorter than `shortest`.
fn creases(mesh: &TriMesh, cosine: f64, shortest: f64) -> Field<EdgeId, bool> {
    let mut creases: Field<EdgeId, bool> =
        Field::from_fn(mesh.edge_count(), |e| mesh.dihedral_cosine(e).is_some_and(|it| it < cosine));
    let mut seen: Field<EdgeId, bool> = Field::filled(mesh.edge_count(), false);
    for seed in mesh.edges() {
        if !creases[seed] || seen[seed] {
            continue;
        }
        seen[seed] = true;
        let mut group = vec![seed];
        let mut at = 0;
        while at < group.len() {
            for v in mesh.edge_vertices(group[at]) {
                for h in mesh.outgoing(v) {
                    let e = mesh.edge(h);
                    if creases[e] && !seen[e] {
                        seen[e] = true;
                        group.push(e);
                    }
                }
            }
            at += 1;
        }
        if group.iter().map(|&e| mesh.edge_length(e)).sum::<f64>() < shortest {
            group.iter().for_each(|&e| creases[e] = false);
        }
    }
    creases
}
