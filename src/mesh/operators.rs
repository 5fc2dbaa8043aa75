//! Discrete operators: cotangent Laplacian, lumped mass, angle defects.
use super::{Field, TriMesh, VertexId};
use crate::numeric::sparse::SymmetricMatrix;

/// The cotangent Laplacian L (V × V), positive semidefinite: L_ij = −½ (cot α_ij + cot β_ij) with α, β the angles opposite
/// edge ij (one of them on the boundary), L_ii = −Σ_j L_ij. So L·1 = 0, xᵀ L x = ∫ |∇x|² of the piecewise linear x, and
/// L x sums the outward flux of x (mm² cancels: L has no unit). Pinkall, Polthier 1993.
pub fn cotangent_laplacian(mesh: &TriMesh) -> SymmetricMatrix {
    let mut triplets = Vec::with_capacity(3 * mesh.halfedge_count());
    for h in mesh.halfedges() {
        let (i, j) = (mesh.tail(h).0, mesh.head(h).0);
        let weight = 0.5 * mesh.cotangent(h);
        triplets.extend([(i, i, weight), (j, j, weight), (i, j, -weight)]);
    }
    SymmetricMatrix::from_triplets(mesh.vertex_count(), &triplets)
}

/// Barycentric lumped mass per vertex, mm²: a third of the area of its faces.
pub fn lumped_mass(mesh: &TriMesh) -> Field<VertexId, f64> {
    let mut mass = Field::filled(mesh.vertex_count(), 0.0);
    for f in mesh.faces() {
        let third = mesh.area(f) / 3.0;
        for v in mesh.face_vertices(f) {
            mass[v] += third;
        }
    }
    mass
}

/// Angle defect per vertex, radians: 2π (interior) or π (boundary) minus the sum of its corner angles, that is the
/// integrated Gaussian or geodesic curvature. They sum to 2π χ (Gauss–Bonnet).
pub fn angle_defects(mesh: &TriMesh) -> Field<VertexId, f64> {
    Field::from_fn(mesh.vertex_count(), |v| mesh.angle_defect(v))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::Vec3;

    /// A bumpy m × m grid with boundary, or (`closed`) a bumpy torus.
    fn surface(m: usize, closed: bool) -> TriMesh {
        let (rows, positions): (usize, Vec<Vec3>) = if closed {
            let tau = std::f64::consts::TAU;
            let at = |i: usize, j: usize| {
                let (u, v) = (i as f64 * tau / m as f64, j as f64 * tau / m as f64);
                let r = 5.0 + (2.0 + 0.3 * (3.0 * u).sin()) * v.cos();
                Vec3::new(r * u.cos(), r * u.sin(), 2.0 * v.sin())
            };
            (m, (0..m * m).map(|k| at(k / m, k % m)).collect())
        } else {
            let at = |i: f64, j: f64| Vec3::new(i, j, (0.4 * i).sin() * (0.3 * j).cos());
            (m - 1, (0..m * m).map(|k| at((k / m) as f64, (k % m) as f64)).collect())
        };
        let id = |i: usize, j: usize| ((i % m) * m + j % m) as u32;
        let quads = (0..rows * rows).map(|k| (k / rows, k % rows));
        let faces: Vec<[u32; 3]> = quads
            .flat_map(|(i, j)| {
                let (a, b, c, d) = (id(i, j), id(i + 1, j), id(i + 1, j + 1), id(i, j + 1));
                [[a, b, c], [a, c, d]]
            })
            .collect();
        TriMesh::new(positions, &faces).unwrap()
    }

    #[test]
    fn laplacian_kills_constants_and_is_positive() {
        for mesh in [surface(9, false), surface(12, true)] {
            let l = cotangent_laplacian(&mesh);
            let ones = vec![1.0; mesh.vertex_count()];
            assert!(l.multiply(&ones).iter().all(|it| it.abs() < 1e-12));
            let x: Vec<f64> = (0..mesh.vertex_count()).map(|i| (i as f64).sin()).collect();
            let y: Vec<f64> = (0..mesh.vertex_count()).map(|i| (1.7 * i as f64).cos()).collect();
            let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(p, q)| p * q).sum::<f64>();
            assert!((dot(&x, &l.multiply(&y)) - dot(&y, &l.multiply(&x))).abs() < 1e-10, "symmetric");
            assert!(dot(&x, &l.multiply(&x)) > 0.0);
        }
    }

    #[test]
    fn dirichlet_energy_of_a_coordinate_is_the_area_it_sweeps() {
        // On any surface Σ over the coordinates of xᵀ L x = ∫ |∇x|² + |∇y|² + |∇z|² = 2 × area.
        for mesh in [surface(9, false), surface(12, true)] {
            let l = cotangent_laplacian(&mesh);
            let sum: f64 = (0..3)
                .map(|k| {
                    let x: Vec<f64> = mesh.positions().iter().map(|p| p[k]).collect();
                    l.multiply(&x).iter().zip(&x).map(|(p, q)| p * q).sum::<f64>()
                })
                .sum();
            assert!((sum / (2.0 * mesh.total_area()) - 1.0).abs() < 1e-12);
            let mass: f64 = lumped_mass(&mesh).iter().sum();
            assert!((mass / mesh.total_area() - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn gauss_bonnet() {
        for mesh in [surface(9, false), surface(12, true)] {
            let total: f64 = angle_defects(&mesh).iter().sum();
            let expected = std::f64::consts::TAU * mesh.euler_characteristic() as f64;
            assert!((total - expected).abs() < 1e-10);
        }
    }
}
