//! Regular 4–1 subdivision at edge midpoints.
use crate::mesh::{Id, MeshError, TriMesh};

/// Splits every face into four. The surface stays the same point set.
///
/// Vertex `v` stays vertex `v`; the midpoint of edge `e` becomes vertex `V + e`. Face `f` becomes faces `4 f + k`, the one
/// at its corner `k` with that corner first, and `4 f + 3`, the middle one, whose first corner is the midpoint of its
/// halfedge 0.
pub fn subdivide(mesh: &TriMesh) -> Result<TriMesh, MeshError> {
    let old = mesh.vertex_count();
    let mut positions = mesh.positions().as_slice().to_vec();
    positions.extend(mesh.edges().map(|e| {
        let [a, b] = mesh.edge_vertices(e);
        (mesh.position(a) + mesh.position(b)) / 2.0
    }));
    let mut faces = Vec::with_capacity(4 * mesh.face_count());
    for f in mesh.faces() {
        let [a, b, c] = mesh.face_vertices(f).map(|v| v.0);
        let [ab, bc, ca] = mesh.face_halfedges(f).map(|h| (old + mesh.edge(h).index()) as u32);
        faces.extend([[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]);
    }
    TriMesh::new(positions, &faces)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        geom::Vec3,
        mesh::{FaceId, VertexId},
    };

    fn tetrahedron() -> TriMesh {
        let p = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 3.0]].map(Vec3::from).to_vec();
        TriMesh::new(p, &[[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]).unwrap()
    }

    #[test]
    fn keeps_area_topology_and_the_documented_order() {
        let mesh = tetrahedron();
        let fine = subdivide(&mesh).unwrap();
        assert_eq!((fine.vertex_count(), fine.face_count()), (4 + 6, 16));
        assert_eq!(fine.euler_characteristic(), 2);
        assert!((fine.total_area() - mesh.total_area()).abs() < 1e-14);
        for v in mesh.vertices() {
            assert_eq!(fine.position(v), mesh.position(v));
            assert_eq!(fine.face_degree(v), mesh.face_degree(v));
        }
        for e in mesh.edges() {
            assert_eq!(fine.face_degree(VertexId::new(4 + e.index())), 6);
        }
        for f in mesh.faces() {
            for k in 0..4 {
                let child = FaceId::new(4 * f.index() + k);
                assert!((fine.normal(child) - mesh.normal(f)).norm() < 1e-15);
                assert!((fine.area(child) - mesh.area(f) / 4.0).abs() < 1e-15);
                assert!(k == 3 || fine.face_vertices(child)[0] == mesh.face_vertices(f)[k]);
            }
        }
    }
}
