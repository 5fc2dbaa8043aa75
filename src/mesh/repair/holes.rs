//! Fills small holes with the triangulation of least area.
use std::collections::BTreeSet;

use super::{Action, MeshRefusal, NAMED, Place, Repair};
use crate::{
    geom::Vec3,
    mesh::{HalfedgeId, TriMesh, trimesh::is_degenerate},
};

/// Fills the boundary loops of at most `limit` edges. A hole that has no triangulation without flat faces or doubled edges
/// stays open.
pub(super) fn fill(mesh: TriMesh, limit: usize, repairs: &mut Vec<Repair>) -> Result<TriMesh, MeshRefusal> {
    let small: Vec<_> = mesh.boundary_loops().into_iter().filter(|it| it.len() <= limit).collect();
    if small.is_empty() {
        return Ok(mesh);
    }
    let mut faces = mesh.face_indices();
    let mut edges: BTreeSet<[u32; 2]> = mesh.edges().map(|e| key(mesh.edge_vertices(e).map(|v| v.0))).collect();
    let mut places = Vec::new();
    for boundary in &small {
        // Against the direction of travel, so that the new faces continue the old ones.
        let ring: Vec<u32> = boundary.iter().rev().map(|&h| mesh.tail(h).0).collect();
        let points: Vec<Vec3> = boundary.iter().rev().map(|&h| mesh.position(mesh.tail(h))).collect();
        if is_lone_triangle(&mesh, boundary) {
            continue;
        }
        let taken = |i: usize, j: usize| edges.contains(&key([ring[i], ring[j]]));
        if let Some(triangles) = least_area(&points, &taken) {
            let new = triangles.into_iter().map(|t| t.map(|k| ring[k]));
            for [a, b, c] in new.clone() {
                edges.extend([key([a, b]), key([b, c]), key([c, a])]);
            }
            faces.extend(new);
            let at = points.iter().sum::<Vec3>() / points.len() as f64;
            places.push(Place { what: "hole", id: None, at });
        }
    }
    if places.is_empty() {
        return Ok(mesh);
    }
    let count = places.len();
    places.truncate(NAMED);
    repairs.push(Repair { action: Action::FillHole, count, places });
    Ok(TriMesh::new(mesh.positions().as_slice().to_vec(), &faces)?)
}

fn key([a, b]: [u32; 2]) -> [u32; 2] {
    [a.min(b), a.max(b)]
}

/// Filling the outside of a single triangle would double it.
fn is_lone_triangle(mesh: &TriMesh, boundary: &[HalfedgeId]) -> bool {
    boundary.len() == 3 && boundary.iter().all(|&h| mesh.face(h) == mesh.face(boundary[0]))
}

/// The triangulation of a closed polygon in space with the least area, as index triples in its direction of travel, by
/// dynamic programming over its chains (Barequet and Sharir 1995). `taken(i, j)` forbids a diagonal. O(n³).
fn least_area(points: &[Vec3], taken: &dyn Fn(usize, usize) -> bool) -> Option<Vec<[usize; 3]>> {
    let n = points.len();
    // Least area and best apex of the chain from i to j.
    let mut best = vec![(0.0, 0); n * n];
    for length in 2..n {
        for i in 0..n - length {
            let j = i + length;
            best[i * n + j] = (f64::INFINITY, i);
            if length < n - 1 && taken(i, j) {
                continue;
            }
            for k in i + 1..j {
                let corners = [points[i], points[k], points[j]];
                let area = (corners[1] - corners[0]).cross(&(corners[2] - corners[0])).norm();
                let total = best[i * n + k].0 + best[k * n + j].0 + area;
                if total < best[i * n + j].0 && !is_degenerate(corners) {
                    best[i * n + j] = (total, k);
                }
            }
        }
    }
    if n < 3 || !best[n - 1].0.is_finite() {
        return None;
    }
    let mut triangles = Vec::with_capacity(n - 2);
    let mut chains = vec![(0, n - 1)];
    while let Some((i, j)) = chains.pop() {
        if j - i >= 2 {
            let k = best[i * n + j].1;
            triangles.push([i, k, j]);
            chains.extend([(i, k), (k, j)]);
        }
    }
    Some(triangles)
}
