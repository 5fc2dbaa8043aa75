//! Moves a surface along its normals so that the planes of its faces move by a given distance: the parallel surface, which
//! for a developable surface is developable again.
use crate::{
    geom::Vec3,
    mesh::{Field, TriMesh, VertexId},
    numeric::symmetric3::jacobi,
};

/// Directions in which the normals around a vertex differ by less than this share (of the sum of their squares) do not
/// tell where it goes; it stays there.
const FLAT: f64 = 1e-8;
/// A vertex never goes farther than so many times the distance: at needle points planes meet far away.
const FARTHEST: f64 = 4.0;
/// Share of the area whose error is the usual one: the rest are needle points and pits.
const USUAL: f64 = 0.99;
/// Halvings of the way of vertices whose faces would turn over; then they stay.
const HALVINGS: usize = 6;

/// A surface that was moved.
#[derive(Debug, Clone, PartialEq)]
pub struct Offset {
    /// The mesh.
    pub mesh: TriMesh,
    /// Largest difference between how far the plane of a face moved at a corner and how far it should, mm.
    pub error: f64,
    /// The same for all places of the surface, as kept on 99 % of its area, mm.
    pub usual: f64,
    /// Vertices that went less far, because a face would have turned over.
    pub shortened: Vec<VertexId>,
}

/// Moves every vertex to where, in the least-squares sense weighted by corner angles, all planes of its faces have moved by
/// `distance` along their outward normals (negative: inwards), by the shortest way. Faces never turn over: vertices of a
/// face that would go less far.
pub fn offset(mesh: &TriMesh, distance: f64) -> Offset {
    if distance == 0.0 {
        return Offset { mesh: mesh.clone(), error: 0.0, usual: 0.0, shortened: Vec::new() };
    }
    let way = Field::<VertexId, Vec3>::from_fn(mesh.vertex_count(), |v| shift(mesh, v) * distance);
    let mut share = Field::<VertexId, f64>::filled(mesh.vertex_count(), 1.0);
    let moved = |share: &Field<VertexId, f64>| {
        Field::from_fn(mesh.vertex_count(), |v: VertexId| mesh.position(v) + way[v] * share[v])
    };
    let mut out = mesh.with_positions(moved(&share));
    let mut round = 0;
    loop {
        let over = |f| out.area_vector(f).dot(&mesh.area_vector(f)) <= 0.0;
        let turned: Vec<_> = mesh.faces().filter(|&f| over(f)).collect();
        if turned.is_empty() {
            break;
        }
        // Every round after the halvings stops at least one more vertex, so this ends.
        let mut corners: Vec<VertexId> = turned.iter().flat_map(|&f| mesh.face_vertices(f)).collect();
        corners.sort();
        corners.dedup();
        for v in corners {
            share[v] = if round < HALVINGS { share[v] / 2.0 } else { 0.0 };
        }
        round += 1;
        out = mesh.with_positions(moved(&share));
    }
    let off = |f| {
        let normal = mesh.normal(f);
        mesh.face_vertices(f).map(|v| (out.position(v) - mesh.position(v)).dot(&normal) - distance)
    };
    let error = mesh.faces().flat_map(off).map(f64::abs).fold(0.0, f64::max);
    // The error is linear over a face; a third of its area goes with each of three places in it.
    let places = |f| {
        let corners: [f64; 3] = off(f);
        let mean = corners.iter().sum::<f64>() / 3.0;
        corners.map(|it| (((it + mean) / 2.0).abs(), mesh.area(f) / 3.0))
    };
    let mut errors: Vec<(f64, f64)> = mesh.faces().flat_map(places).collect();
    errors.sort_by(|a, b| b.0.total_cmp(&a.0));
    let (mut beyond, few) = (0.0, (1.0 - USUAL) * mesh.total_area());
    let usual = errors.iter().find(|it| {
        beyond += it.1;
        beyond > few
    });
    let usual = usual.map_or(0.0, |it| it.0);
    let shortened = share.enumerate().filter(|it| *it.1 < 1.0).map(|it| it.0).collect();
    Offset { mesh: out, error, usual, shortened }
}

/// The way of a vertex for a distance of 1: the shortest d with n · d = 1 for the normals n around it, as nearly as can be.
fn shift(mesh: &TriMesh, v: VertexId) -> Vec3 {
    let (mut sum, mut right) = ([[0.0; 3]; 3], Vec3::zeros());
    for h in mesh.outgoing(v) {
        let (normal, weight) = (mesh.normal(mesh.face(h)), mesh.corner_angle(h));
        for i in 0..3 {
            for j in 0..3 {
                sum[i][j] += weight * normal[i] * normal[j];
            }
        }
        right += weight * normal;
    }
    let (values, vectors) = jacobi(sum);
    let largest = values.into_iter().fold(f64::MIN_POSITIVE, f64::max);
    let mut out = Vec3::zeros();
    for (value, vector) in values.into_iter().zip(vectors) {
        if value > FLAT * largest {
            let vector = Vec3::from(vector);
            out += vector * (vector.dot(&right) / value);
        }
    }
    let length = out.norm();
    if length > FARTHEST { out * (FARTHEST / length) } else { out }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;

    #[test]
    fn a_cube_becomes_a_cube_of_known_edge() {
        for (distance, edge) in [(-1.5, 47.0), (2.0, 54.0)] {
            let moved = offset(&shapes::cuboid(Vec3::repeat(50.0), 3), distance);
            assert!(moved.error < 1e-9 && moved.usual <= moved.error && moved.shortened.is_empty());
            assert!((moved.mesh.bounds().size() - Vec3::repeat(edge)).norm() < 1e-9);
            assert!((moved.mesh.total_area() - 6.0 * edge * edge).abs() < 1e-6);
        }
    }

    #[test]
    fn a_cylinder_becomes_a_cylinder_of_known_girth() {
        let (radius, around) = (40.0, 24);
        let pipe = shapes::cylinder(radius, 60.0, around, 4);
        for distance in [-1.5, 1.0] {
            let moved = offset(&pipe, distance);
            assert!(moved.error < 1e-9, "{}", moved.error);
            let angle = std::f64::consts::PI / around as f64;
            let side = 2.0 * angle.tan() * (radius * angle.cos() + distance);
            let area = 60.0 * side * around as f64;
            assert!((moved.mesh.total_area() - area).abs() < 1e-8 * area);
        }
    }

    #[test]
    fn every_plane_of_a_round_shape_moves_almost_by_the_distance() {
        for (mesh, share) in [(shapes::icosphere(50.0, 3), 0.01), (shapes::torus(40.0, 15.0, 48, 24), 0.02)] {
            let moved = offset(&mesh, -1.5);
            assert!(moved.error < share * 1.5 && moved.shortened.is_empty(), "{}", moved.error);
        }
    }

    #[test]
    fn what_is_thinner_than_the_distance_does_not_turn_over() {
        let thin = shapes::torus(40.0, 3.0, 48, 12);
        let moved = offset(&thin, -4.0);
        assert!(!moved.shortened.is_empty() && moved.usual > 0.5, "{}", moved.usual);
        assert!(thin.faces().all(|f| moved.mesh.area_vector(f).dot(&thin.area_vector(f)) > 0.0));
        assert_eq!(offset(&thin, 0.0).mesh, thin);
    }
}
