//! Tangent planes at the vertices of a mesh: directions as angles, and how they turn along edges.
//!
//! At an inner vertex the corner angles are scaled by s = 2π / Σθ, so that they make a full turn; on the boundary s = 1
//! (seed 001, eq. 8; Knöppel, Crane, Pinkall, Schröder 2013, section 5.2). Angles count from the first outgoing halfedge
//! of [`TriMesh::outgoing`], counter-clockwise.
use std::f64::consts::PI;

use super::chart::Metric;
use crate::{
    geom::{Complex, Vec3},
    mesh::{FaceId, Field, HalfedgeId, TriMesh, VertexId},
};

/// Directions of the halfedges at their ends.
#[derive(Debug, Clone)]
pub struct TangentSpaces {
    /// Direction of each halfedge at its tail, radians.
    pub angle: Field<HalfedgeId, f64>,
    /// The same as a complex number of modulus 1.
    pub direction: Field<HalfedgeId, Complex>,
    /// Direction in which each halfedge arrives at its head, as a complex number of modulus 1.
    pub arrival: Field<HalfedgeId, Complex>,
    /// s per vertex.
    pub scale: Field<VertexId, f64>,
    /// Angles, cotangents, lengths and areas of the mesh.
    pub metric: Metric,
}

impl TangentSpaces {
    /// Measures a mesh.
    pub fn new(mesh: &TriMesh) -> Self {
        let metric = Metric::new(mesh);
        let mut angle = Field::filled(mesh.halfedge_count(), 0.0);
        let mut direction = Field::filled(mesh.halfedge_count(), Complex::new(1.0, 0.0));
        let mut arrival = direction.clone();
        let scale = Field::from_fn(mesh.vertex_count(), |v| {
            let total: f64 = mesh.outgoing(v).map(|h| metric.angle[h]).sum();
            let scale = if mesh.is_boundary_vertex(v) { 1.0 } else { 2.0 * PI / total };
            let mut sum = 0.0;
            for h in mesh.outgoing(v) {
                angle[h] = scale * sum;
                direction[h] = Complex::from_polar(1.0, angle[h]);
                sum += metric.angle[h];
                // The halfedge that comes in on the far side of this face.
                let incoming = mesh.previous(h);
                arrival[incoming] = -Complex::from_polar(1.0, scale * sum);
            }
            scale
        });
        Self { angle, direction, arrival, scale, metric }
    }

    /// What turns a tangent vector at the tail of `h` into the parallel one at its head.
    pub fn transport(&self, h: HalfedgeId) -> Complex {
        self.arrival[h] * self.direction[h].conj()
    }

    /// Curvature of a face, radians: Σ s θ − π. These sum to 2π χ on a closed surface; a boundary adds its turning
    /// Σ (π − Σθ).
    pub fn curvature(&self, mesh: &TriMesh, f: FaceId) -> f64 {
        let angles = mesh.face_halfedges(f).map(|h| self.scale[mesh.tail(h)] * self.metric.angle[h]);
        angles.iter().sum::<f64>() - PI
    }

    /// How far a boundary loop turns to the left, radians: Σ (π − Σθ) over its vertices, 2π for a convex disk.
    pub fn turning(&self, mesh: &TriMesh, path: &[HalfedgeId]) -> f64 {
        let angle = |&h: &HalfedgeId| mesh.outgoing(mesh.tail(h)).map(|it| self.metric.angle[it]).sum::<f64>();
        path.iter().map(|h| PI - angle(h)).sum()
    }

    /// The unit vector in space of a direction at `v`, in the plane of the face that it points into; at a boundary, where it
    /// points out of the surface, the opposite of its opposite.
    pub fn to_space(&self, mesh: &TriMesh, v: VertexId, direction: Complex) -> Vec3 {
        let angle = direction.arg().rem_euclid(2.0 * PI);
        let total: f64 = mesh.outgoing(v).map(|h| self.metric.angle[h]).sum::<f64>() * self.scale[v];
        let (angle, sign) =
            if angle > total && angle >= PI && angle - PI <= total { (angle - PI, -1.0) } else { (angle, 1.0) };
        let before = mesh.outgoing(v).filter(|&h| self.angle[h] <= angle);
        let Some(h) = before.last() else { return Vec3::zeros() };
        let turn = (angle - self.angle[h]) / self.scale[v];
        let (along, normal) = (mesh.vector(h).normalize(), mesh.normal(mesh.face(h)));
        (along * turn.cos() + normal.cross(&along) * turn.sin()) * sign
    }

    /// A vector in space as a tangent vector at `v`: its part in the plane across the mean normal there, with the angle that
    /// it has in the fan of faces. `None` where nothing of it is left.
    pub fn from_space(&self, mesh: &TriMesh, v: VertexId, vector: Vec3) -> Option<Complex> {
        let normal: Vec3 = mesh.outgoing(v).map(|h| mesh.normal(mesh.face(h)) * self.metric.angle[h]).sum();
        let normal = normal.try_normalize(1e-12)?;
        let flat = |x: Vec3| x - normal * normal.dot(&x);
        let vector = flat(vector);
        let length = vector.norm();
        if !(length > 1e-12) {
            return None;
        }
        let (inside, angle) = self.in_fan(mesh, v, vector, &flat, normal)?;
        if inside < -1e-9 && mesh.is_boundary_vertex(v) {
            // Out of the surface: opposite to where its opposite points.
            let (other, opposite) = self.in_fan(mesh, v, -vector, &flat, normal)?;
            if other > inside {
                return Some(Complex::from_polar(length, opposite + PI));
            }
        }
        Some(Complex::from_polar(length, angle))
    }

    /// The wedge of the projected fan that holds a vector: how far inside (negative: the nearest one) and the angle there.
    fn in_fan(
        &self,
        mesh: &TriMesh,
        v: VertexId,
        vector: Vec3,
        flat: &impl Fn(Vec3) -> Vec3,
        normal: Vec3,
    ) -> Option<(f64, f64)> {
        let mut best = None;
        for h in mesh.outgoing(v) {
            let (a, b) = (mesh.vector(h), -mesh.vector(mesh.previous(h)));
            let (p, q) = (flat(a), flat(b));
            let area = normal.dot(&p.cross(&q));
            // vector = x p + y q, scaled to the legs.
            let x = normal.dot(&vector.cross(&q)) / area;
            let y = normal.dot(&p.cross(&vector)) / area;
            let inside = (x * p.norm()).min(y * q.norm()) / vector.norm();
            if area > 0.0 && best.is_none_or(|(most, _)| inside > most) {
                let w = a * x.max(0.0) + b * y.max(0.0);
                let turn = f64::atan2(a.cross(&w).norm(), a.dot(&w)).clamp(0.0, self.metric.angle[h]);
                best = Some((inside, self.angle[h] + self.scale[v] * turn));
            }
        }
        best
    }
}

/// ½ Σ cot of the angles opposite each edge (eq. 12 of seed 001 names it w); of either sign.
pub fn cotangent_weights(mesh: &TriMesh) -> Field<crate::mesh::EdgeId, f64> {
    let mut weight = Field::filled(mesh.edge_count(), 0.0);
    for f in mesh.faces() {
        let points = mesh.face_positions(f);
        let sides = [0, 1, 2].map(|k| points[(k + 1) % 3] - points[k]);
        let half = -0.5 / sides[0].cross(&sides[1]).norm();
        for (k, h) in mesh.face_halfedges(f).into_iter().enumerate() {
            weight[mesh.edge(h)] += half * sides[(k + 1) % 3].dot(&sides[(k + 2) % 3]);
        }
    }
    weight
}

/// A tangent vector field as a 1-form, one value per edge along [`TriMesh::halfedge`]: the integral along the edge of
/// the field, which on either half is that of the nearer end (seed 001, eq. 12, with the direction at the head corrected).
pub fn one_form(
    mesh: &TriMesh,
    tangent: &TangentSpaces,
    field: &Field<VertexId, Complex>,
) -> Field<crate::mesh::EdgeId, f64> {
    Field::from_fn(mesh.edge_count(), |e| {
        let h = mesh.halfedge(e);
        let dot = |a: Complex, b: Complex| a.re * b.re + a.im * b.im;
        let ends = dot(field[mesh.tail(h)], tangent.direction[h]) + dot(field[mesh.head(h)], tangent.arrival[h]);
        0.5 * tangent.metric.length[h] * ends
    })
}
