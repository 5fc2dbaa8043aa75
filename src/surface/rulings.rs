//! Directions of rulings at the vertices of flattened pieces, each with a confidence.
//!
//! Around a vertex of a discrete developable surface the normals N of the faces lie on a great circle, so the smallest
//! eigenvalue λ0 of Σ θ N Nᵀ (θ: angle of the face at the vertex) vanishes and its eigenvector is the ruling (Stein,
//! Grinspun, Crane 2018, section 4.1.3). Where the surface is flat, λ1 vanishes too and any direction will do.
use nalgebra::Matrix3x2;

use crate::{
    geom::{Vec2, Vec3},
    mesh::{Field, TriMesh, VertexId},
    numeric::{
        sparse::{Cholesky, SymmetricMatrix},
        symmetric3::jacobi,
    },
};

/// λ1 below this share of 2π is noise: normals then turn by less than about two degrees.
const FLAT: f64 = 1e-3;
/// A fan that is not closed says less.
const BOUNDARY: f64 = 0.3;
/// Directions are smoothed over this share of the root of a piece's area.
const REACH: f64 = 0.05;

/// Plane directions with angles doubled, because a line has no sense: (cos 2φ, sin 2φ) times a confidence in [0, 1].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Direction {
    /// The doubled direction.
    pub doubled: Vec2,
}

impl Direction {
    /// Confidence in [0, 1]; 0 where any direction will do.
    pub fn confidence(self) -> f64 {
        self.doubled.norm()
    }

    /// Unit vector along the ruling.
    pub fn vector(self) -> Vec2 {
        let angle = 0.5 * self.doubled.y.atan2(self.doubled.x);
        Vec2::new(angle.cos(), angle.sin())
    }
}

/// The direction at every vertex by its own faces. `mesh` is opened to pieces, `uv` are the places of its vertices in the
/// plane.
pub fn directions(mesh: &TriMesh, uv: &Field<VertexId, Vec2>) -> Field<VertexId, Direction> {
    Field::from_fn(mesh.vertex_count(), |v| {
        let mut tensor = [[0.0; 3]; 3];
        let mut total = 0.0;
        for h in mesh.outgoing(v) {
            let normal = mesh.normal(mesh.face(h));
            let angle = crate::geom::angle_between(mesh.vector(h), -mesh.vector(mesh.previous(h)));
            total += angle;
            for i in 0..3 {
                for j in 0..3 {
                    tensor[i][j] += angle * normal[i] * normal[j];
                }
            }
        }
        let (values, vectors) = jacobi(tensor);
        let mut order = [0, 1, 2];
        order.sort_by(|&a, &b| values[a].total_cmp(&values[b]));
        let [low, middle] = [values[order[0]].max(0.0) / total, values[order[1]].max(0.0) / total];
        let clear = (middle - low) / (middle + low).max(f64::MIN_POSITIVE) * (middle / FLAT).min(1.0);
        let confidence = clear * if mesh.is_boundary_vertex(v) { BOUNDARY } else { 1.0 };
        let ruling = Vec3::from(vectors[order[0]]);
        let mut sum = Vec2::zeros();
        for h in mesh.outgoing(v) {
            if let Some(d) = in_plane(mesh, uv, h, ruling) {
                sum += Vec2::new(d.x * d.x - d.y * d.y, 2.0 * d.x * d.y);
            }
        }
        Direction { doubled: sum.try_normalize(0.0).unwrap_or_else(Vec2::zeros) * confidence }
    })
}

/// The plane image of a direction in space, by the face of a halfedge.
fn in_plane(mesh: &TriMesh, uv: &Field<VertexId, Vec2>, h: crate::mesh::HalfedgeId, direction: Vec3) -> Option<Vec2> {
    let [a, b, c] = [h, mesh.next(h), mesh.previous(h)].map(|it| mesh.tail(it));
    let sides = Matrix3x2::from_columns(&[mesh.position(b) - mesh.position(a), mesh.position(c) - mesh.position(a)]);
    let weights = (sides.transpose() * sides).try_inverse()? * (sides.transpose() * direction);
    ((uv[b] - uv[a]) * weights.x + (uv[c] - uv[a]) * weights.y).try_normalize(0.0)
}

/// The same smoothed over each piece: the minimum of ∫ c |z − z0|² + ℓ² |∇z|² over doubled directions z, with the
/// confidence c of z0 as its weight. So directions spread to where the surface is flat, and their length tells how well
/// what was found around a vertex agrees. `area` is the area of the piece of each vertex, mm².
pub fn smoothed(
    mesh: &TriMesh,
    raw: &Field<VertexId, Direction>,
    area: &Field<VertexId, f64>,
) -> Field<VertexId, Direction> {
    let n = mesh.vertex_count();
    let mass = crate::mesh::operators::lumped_mass(mesh);
    let mut triplets = Vec::with_capacity(3 * mesh.halfedge_count() + n);
    for h in mesh.halfedges() {
        let (i, j) = (mesh.tail(h), mesh.head(h));
        // Negative weights of obtuse corners would let directions grow beyond those around them.
        let weight = 0.5 * mesh.cotangent(h).max(0.0) * REACH * REACH * area[i];
        triplets.extend([(i.0, i.0, weight), (j.0, j.0, weight), (i.0, j.0, -weight)]);
    }
    let mut columns = vec![0.0; 2 * n];
    for v in mesh.vertices() {
        let confidence = raw[v].confidence();
        // A flat piece has no direction at all; the second term keeps its matrix regular.
        triplets.push((v.0, v.0, mass[v] * (confidence + 1e-6)));
        let unit = raw[v].doubled.try_normalize(0.0).unwrap_or_else(Vec2::zeros);
        columns[v.0 as usize] = mass[v] * confidence * unit.x;
        columns[n + v.0 as usize] = mass[v] * confidence * unit.y;
    }
    let matrix = SymmetricMatrix::from_triplets(n, &triplets);
    match Cholesky::new(&matrix) {
        Ok(factor) => factor.solve_in_place(&mut columns),
        Err(_) => return raw.clone(),
    }
    Field::from_fn(n, |v: VertexId| Direction { doubled: Vec2::new(columns[v.0 as usize], columns[n + v.0 as usize]) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{
        operators::lumped_mass,
        shapes::{self, ruled},
    };

    /// Mean angle to the true rulings, degrees, weighted by confidence and area.
    fn error(surface: &ruled::Developable, rings: usize, noise: f64, smooth: bool) -> f64 {
        let (mesh, uv) = ruled::patch(surface, rings, noise);
        let uv = Field::from_vec(uv);
        let mut found = directions(&mesh, &uv);
        if smooth {
            let total = mesh.faces().map(|f| mesh.area(f)).sum();
            found = smoothed(&mesh, &found, &Field::filled(mesh.vertex_count(), total));
        }
        let mass = lumped_mass(&mesh);
        let (mut sum, mut weights) = (0.0, 0.0);
        for v in mesh.vertices() {
            let weight = mass[v] * found[v].confidence();
            let (a, b) = (found[v].vector(), (surface.ruling)(uv[v]).normalize());
            sum += weight * crate::geom::cross2(a, b).abs().min(1.0).asin();
            weights += weight;
        }
        (sum / weights).to_degrees()
    }

    #[test]
    fn directions_follow_the_rulings_and_smoothing_helps_against_noise() {
        for surface in &ruled::DEVELOPABLE {
            let exact = error(surface, 14, 0.0, true);
            assert!(exact < 4.0, "{}: {exact}°", surface.name);
            let [raw, smooth] = [false, true].map(|it| error(surface, 14, 0.02, it));
            assert!(smooth < 0.7 * raw, "{}: {raw}° raw, {smooth}° smooth", surface.name);
        }
    }

    #[test]
    fn a_flat_piece_has_no_direction() {
        let mesh = shapes::grid(5, 5, 3.0);
        let uv = Field::from_vec(mesh.positions().iter().map(|p| p.xy()).collect());
        let raw = directions(&mesh, &uv);
        let smooth = smoothed(&mesh, &raw, &Field::filled(mesh.vertex_count(), 225.0));
        assert!(mesh.vertices().all(|v| raw[v].confidence() < 1e-9 && smooth[v].confidence() < 1e-9));
    }
}
