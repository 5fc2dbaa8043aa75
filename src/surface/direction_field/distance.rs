//! Fields that point away from a set of vertices: the gradient of the geodesic distance by the heat method (Crane, Weischedel,
//! Wardetzky 2013, Algorithm 1, steps I and II). Its isolines are rings at a constant distance around every limb.
use std::{cmp::Reverse, collections::BinaryHeap};

use super::{DirectionField, FieldError, LEAST_WEIGHT};
use crate::{
    geom::{Complex, Vec3},
    mesh::{Field, Id, TriMesh, VertexId, operators::lumped_mass},
    numeric::{
        dissection::nested_dissection,
        sparse::{Analysis, SymmetricMatrix},
    },
    surface::tangent::{TangentSpaces, cotangent_weights},
};

/// The field away from `sources`; `reach`, mm, is how far its creases, where fronts meet, are rounded (the heat flows for a time of
/// reach²). Where no heat arrives (another component) the field is 0.
pub fn away_from(
    mesh: &TriMesh,
    tangent: &TangentSpaces,
    sources: &[VertexId],
    reach: f64,
) -> Result<DirectionField, FieldError> {
    // Heat that flows along edges of positive weight only is positive everywhere.
    let time = reach * reach;
    let pairs: Vec<(u32, u32)> = mesh.edges().map(|e| mesh.edge_vertices(e)).map(|[a, b]| (a.0, b.0)).collect();
    let (mut matrix, slots) = SymmetricMatrix::with_pattern(mesh.vertex_count(), &pairs);
    for ((weight, slot), &(a, b)) in cotangent_weights(mesh).iter().zip(slots).zip(&pairs) {
        let flow = time * weight.max(LEAST_WEIGHT);
        matrix.values_mut()[slot as usize] -= flow;
        [a, b].into_iter().for_each(|v| matrix.add_to_diagonal(v as usize, flow));
    }
    for (v, mass) in lumped_mass(mesh).enumerate() {
        matrix.add_to_diagonal(v.index(), *mass);
    }
    let mut heat = vec![0.0; mesh.vertex_count()];
    sources.iter().for_each(|v| heat[v.index()] = 1.0);
    let order = nested_dissection(&matrix, 1, &mesh.positions().iter().map(|p| [p.x, p.y, p.z]).collect::<Vec<_>>());
    Analysis::with_ordering(&matrix, &order)?.factor(&matrix)?.solve_in_place(&mut heat);
    let mut sum = Field::<VertexId, Vec3>::filled(mesh.vertex_count(), Vec3::zeros());
    for f in mesh.faces() {
        let corners = mesh.face_vertices(f);
        let [a, b, c] = corners.map(|v| mesh.position(v));
        // Twice the area times ∇u is the sum of the opposite sides, turned by a quarter, times u.
        let [x, y, z] = corners.map(|v| heat[v.index()]);
        let fall = -mesh.normal(f).cross(&((c - b) * x + (a - c) * y + (b - a) * z));
        let size = fall.amax();
        if size > 0.0 {
            let unit = (fall / size).normalize() * mesh.area(f);
            corners.iter().for_each(|&v| sum[v] += unit);
        }
    }
    let here = |v| tangent.from_space(mesh, v, sum[v]).unwrap_or(Complex::new(0.0, 0.0));
    Ok(DirectionField::from_vectors(1, &Field::from_fn(mesh.vertex_count(), here)))
}

/// A vertex of every component that lies farthest from some other along the edges: the tip of a limb.
pub fn tips(mesh: &TriMesh) -> Vec<VertexId> {
    let mut distance = Field::<VertexId, f64>::filled(mesh.vertex_count(), f64::INFINITY);
    let mut out = Vec::new();
    for seed in mesh.faces().map(|f| mesh.face_vertices(f)[0]) {
        if distance[seed].is_infinite() {
            out.push(farthest(mesh, seed, &mut distance));
        }
    }
    out
}

/// The vertex farthest from a seed along the edges; `distance` becomes that from the seed on its component.
fn farthest(mesh: &TriMesh, seed: VertexId, distance: &mut Field<VertexId, f64>) -> VertexId {
    // Lengths are not negative, so that their bits are in their order.
    let mut queue = BinaryHeap::from([Reverse((0_u64, seed))]);
    distance[seed] = 0.0;
    let mut last = seed;
    while let Some(Reverse((bits, v))) = queue.pop() {
        if f64::from_bits(bits) > distance[v] {
            continue;
        }
        last = v;
        for w in mesh.neighbors(v) {
            let reached = distance[v] + (mesh.position(w) - mesh.position(v)).norm();
            if reached < distance[w] {
                distance[w] = reached;
                queue.push(Reverse((reached.to_bits(), w)));
            }
        }
    }
    last
}
