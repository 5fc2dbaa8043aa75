//! Fields with singularities exactly where they are asked for: trivial connections (Crane, Desbrun, Schröder 2010).
//!
//! The rotation of the field against the transport along an edge is δ = θ_j − θ_i − s ρ_ij + 2π m, so the field that
//! rotates least is a field-aligned parameterisation θ along ω = s ρ, of which the integers follow from the indices.
use std::f64::consts::TAU;

use super::{DirectionField, Turns, euler_characteristics};
use crate::{
    geom::Complex,
    mesh::{EdgeId, Field, TriMesh},
    surface::{
        field_aligned::{AlignError, Indices, Parameterizer},
        tangent::TangentSpaces,
        tree_cotree::{IndexError, Node},
    },
};

/// Why there is no such field.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum TrivialError {
    /// The indices do not sum to symmetry × χ, or name what does not exist.
    #[error("singularities of the field: {0}")]
    Index(#[from] IndexError),
    /// The solve failed.
    #[error(transparent)]
    Align(#[from] AlignError),
}

/// The field of `symmetry` with the singularities `turns` that rotates least, up to a rotation of the whole. All boundary loops
/// must be named in `turns`. With it comes by how much its power rotates along every edge, radians, against the transport:
/// where that is more than half a turn, the field alone would tell of another place of the singularity.
pub fn trivial(
    mesh: &TriMesh,
    tangent: &TangentSpaces,
    symmetry: i32,
    turns: &Turns,
    solver: &Parameterizer,
) -> Result<(DirectionField, Field<EdgeId, f64>), TrivialError> {
    let tree = &solver.tree;
    let s = f64::from(symmetry);
    let omega = Field::from_fn(mesh.edge_count(), |e| s * tangent.transport(mesh.halfedge(e)).arg());
    let sums = tree.sums(&omega);
    let mut wanted = vec![0; tree.node_count()];
    for &(f, index) in &turns.faces {
        wanted[tree.index(Node::Face(f))?] += index;
    }
    for (k, &index) in turns.loops.iter().enumerate() {
        wanted[tree.index(Node::Loop(k))?] += index;
    }
    let euler = euler_characteristics(mesh, tree);
    tree.check_sums(&wanted, |component| i64::from(symmetry) * euler[component])?;
    // Index = (Σδ + s Ω) / 2π around a face, and with Σ over a cap for Ω what its loop turns.
    let node = |at: usize| {
        let curvature = match tree.node(at) {
            Node::Face(f) => tangent.curvature(mesh, f),
            Node::Loop(k) => tangent.turning(mesh, &tree.loops[k]),
        };
        (tree.node(at), wanted[at] - ((s * curvature - sums[at]) / TAU).round() as i32)
    };
    let nodes = (0..tree.node_count()).map(node).filter(|it| it.1 != 0 || matches!(it.0, Node::Loop(_))).collect();
    let solved = solver.solve(mesh, omega, &Indices { nodes, generators: Vec::new() })?;
    let power = Field::from_vec(solved.alpha.iter().map(|&angle| Complex::from_polar(1.0, angle)).collect());
    let rotation = Field::from_fn(mesh.edge_count(), |e| solved.difference(mesh, e) - solved.omega()[e]);
    Ok((DirectionField { symmetry, power }, rotation))
}
