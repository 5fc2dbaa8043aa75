//! A Sobolev metric for gradient steps: the inverse of (σ I + L)² makes them smooth, so that a change travels over the
//! whole mesh in few steps instead of one edge per step.
use super::SMOOTHING;
use crate::{
    mesh::TriMesh,
    numeric::sparse::{Cholesky, SparseError, SymmetricMatrix},
};

/// (σ I + L)² on each coordinate, L the graph Laplacian of a mesh.
#[derive(Debug)]
pub(super) struct Metric(Cholesky);

impl Metric {
    /// Factors it for the connectivity of `mesh`.
    pub(super) fn new(mesh: &TriMesh) -> Result<Self, SparseError> {
        let mut triplets: Vec<(u32, u32, f64)> = mesh.vertices().map(|v| (v.0, v.0, SMOOTHING)).collect();
        for e in mesh.edges() {
            let [i, j] = mesh.edge_vertices(e).map(|v| v.0);
            triplets.extend([(i, i, 1.0), (j, j, 1.0), (i, j, -1.0)]);
        }
        Ok(Self(Cholesky::new(&SymmetricMatrix::from_triplets(mesh.vertex_count(), &triplets))?))
    }

    /// Applies the inverse to three coordinates per vertex, in place.
    pub(super) fn apply_inverse(&self, v: &mut [f64]) {
        let n = self.0.size();
        let mut columns = vec![0.0; v.len()];
        for (i, p) in v.as_chunks::<3>().0.iter().enumerate() {
            (0..3).for_each(|c| columns[c * n + i] = p[c]);
        }
        self.0.solve_in_place(&mut columns);
        self.0.solve_in_place(&mut columns);
        for (i, p) in v.as_chunks_mut::<3>().0.iter_mut().enumerate() {
            (0..3).for_each(|c| p[c] = columns[c * n + i]);
        }
    }
}
