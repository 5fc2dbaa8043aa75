//! How benchmarks and tests cut and flatten.
use fabricate::{
    mesh::{Field, TriMesh},
    model::DevelopableMesh,
    stages::{
        cut::Options,
        flatten::{self, Outline},
    },
};

/// A mesh taken as it is.
pub(crate) fn developable(mesh: TriMesh) -> DevelopableMesh {
    let energy = Field::filled(mesh.vertex_count(), 0.0);
    DevelopableMesh { mesh, energy, max_deviation: 0.0, rounds: vec![], tradeoffs: vec![] }
}

/// What the stage asks for by default, for a stretch, on sheets without end.
pub(crate) fn options(stretch: f64) -> Options {
    Options {
        stretch,
        tolerance: None,
        clearance: 0.002,
        least_opening: 1e-3,
        new_piece: 0.03,
        halvings: 1,
        min_area: 36.0,
        min_neck: 4.0,
        neck: 0.12,
        prefer: vec![],
        avoid: vec![],
        seams: vec![],
        scales: vec![],
        sheet: None,
    }
}

/// What the stage asks for by default.
pub(crate) fn flat() -> flatten::Options {
    flatten::Options { outline: Outline::Isometric, corner: 30_f64.to_radians(), hem: 1.0, equal_seams: true }
}
