//! Triangle meshes on halfedges: storage, typed ids, per-element fields, operators, queries, repair.
//!
//! The three halfedges of face `f` are `3f`, `3f+1`, `3f+2`; halfedge `3f+k` runs from corner `k` to corner `k+1`.
//! So `next`, `previous` and `face` are arithmetic, and only `twin` is stored. Boundary halfedges have no twin.

mod bvh;
pub mod distance;
mod ids;
pub mod intersections;
pub mod operators;
mod paper;
pub mod repair;
pub mod shapes;
pub mod sweep;
mod symmetry;
mod trimesh;

pub use bvh::{Bvh, Closest};
pub use ids::{EdgeId, FaceId, Field, HalfedgeId, Id, VertexId};
pub use paper::{PaperError, paper};
pub use symmetry::{Isometry, Symmetries};
pub use trimesh::{MeshError, TriMesh};

/// What a file holds before anyone has checked it: positions and triangles that may be anything.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Soup {
    /// Vertex positions in file units.
    pub positions: Vec<crate::geom::Vec3>,
    /// Triangles as vertex indices, not yet known to be in range.
    pub faces: Vec<[u32; 3]>,
}
