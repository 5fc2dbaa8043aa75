//! Tests of the mesh: invariants and identities on every kind of surface, refusals of everything else.
use std::f64::consts::{PI, TAU};

use super::*;
use crate::mesh::shapes;

/// Closed and open surfaces of several genera, one with two components.
fn meshes() -> Vec<TriMesh> {
    let (a, b) = (shapes::torus(10.0, 4.0, 16, 8), shapes::annulus(1.0, 2.0, 9, 2));
    let offset = a.vertex_count() as u32;
    let both = TriMesh::new(
        a.positions().iter().chain(b.positions().iter()).copied().collect(),
        &[a.face_indices(), b.face_indices().iter().map(|t| t.map(|v| v + offset)).collect()].concat(),
    );
    vec![
        shapes::grid(1, 1, 1.0),
        shapes::grid(4, 3, 1.0),
        shapes::icosphere(10.0, 2),
        shapes::cylinder(5.0, 20.0, 12, 3),
        shapes::perforated_plate(3, 5.0, 1),
        both.unwrap(),
        TriMesh::new(vec![Vec3::zeros(), Vec3::x(), Vec3::y()], &[[0, 1, 2]]).unwrap(),
    ]
}

#[test]
fn connectivity_is_consistent() {
    for mesh in meshes() {
        assert_eq!(mesh.validate(), Ok(()));
        for h in mesh.halfedges() {
            assert_eq!(mesh.previous(mesh.next(h)), h);
            assert_eq!(mesh.next(mesh.next(mesh.next(h))), h);
            assert_eq!(mesh.face(mesh.next(h)), mesh.face(h));
            assert_eq!(mesh.tail(mesh.next(h)), mesh.head(h));
            assert_eq!(mesh.find_halfedge(mesh.tail(h), mesh.head(h)), Some(h));
            assert!(mesh.twin(h).is_none_or(|t| mesh.twin(t) == Some(h) && mesh.edge(t) == mesh.edge(h)));
        }
        let boundary = mesh.edges().filter(|&e| mesh.is_boundary_edge(e)).count();
        assert_eq!(3 * mesh.face_count(), 2 * mesh.edge_count() - boundary);
        for e in mesh.edges() {
            let [a, b] = mesh.edge_vertices(e);
            assert_eq!(mesh.edge(mesh.halfedge(e)), e);
            assert!((mesh.edge_length(e) - (mesh.position(a) - mesh.position(b)).norm()).abs() < 1e-15);
        }
    }
}

#[test]
fn stars_are_complete_and_counter_clockwise() {
    for mesh in meshes() {
        let mut faces = Field::<VertexId, Vec<FaceId>>::filled(mesh.vertex_count(), vec![]);
        for f in mesh.faces() {
            mesh.face_vertices(f).into_iter().for_each(|v| faces[v].push(f));
        }
        for v in mesh.vertices() {
            let star: Vec<HalfedgeId> = mesh.outgoing(v).collect();
            let mut found: Vec<FaceId> = star.iter().map(|&h| mesh.face(h)).collect();
            found.sort_unstable();
            assert_eq!(found, faces[v]);
            assert_eq!(mesh.face_degree(v), star.len());
            for pair in star.windows(2) {
                assert_eq!(mesh.twin(mesh.previous(pair[0])), Some(pair[1]));
            }
            let mut around: Vec<VertexId> = mesh.neighbors(v).collect();
            assert_eq!(around.len(), star.len() + usize::from(mesh.is_boundary_vertex(v)));
            assert!(around.iter().all(|&w| mesh.neighbors(w).any(|it| it == v)));
            around.sort_unstable();
            around.dedup();
            assert_eq!(around.len(), mesh.neighbors(v).count());
        }
    }
}

#[test]
fn boundary_loops_travel_with_the_surface_on_the_left() {
    for mesh in meshes() {
        let loops = mesh.boundary_loops();
        for path in &loops {
            for k in 0..path.len() {
                assert_eq!(mesh.head(path[k]), mesh.tail(path[(k + 1) % path.len()]));
            }
            assert_eq!(path.iter().min(), path.first());
        }
        let mut all: Vec<HalfedgeId> = loops.into_iter().flatten().collect();
        all.sort_unstable();
        assert!(all.into_iter().eq(mesh.halfedges().filter(|&h| mesh.twin(h).is_none())));
    }
}

#[test]
fn topology_and_components_are_counted() {
    let counts: Vec<_> = meshes()
        .iter()
        .map(|m| (m.euler_characteristic(), m.boundary_loops().len(), m.genus(), m.components().1))
        .collect();
    assert_eq!(
        counts,
        [(1, 1, 0, 1), (1, 1, 0, 1), (2, 0, 0, 1), (0, 2, 0, 1), (-4, 0, 3, 1), (0, 2, 1, 2), (1, 1, 0, 1)]
    );
    let both = &meshes()[5];
    let (component, _) = both.components();
    assert!(component.enumerate().all(|(f, &c)| c == u32::from(f.index() >= 2 * 16 * 8)));
}

#[test]
fn angle_defects_sum_to_the_euler_characteristic() {
    // Gauss–Bonnet.
    for mesh in meshes() {
        let total: f64 = mesh.vertices().map(|v| mesh.angle_defect(v)).sum();
        assert!((total - TAU * mesh.euler_characteristic() as f64).abs() < 1e-10, "{total}");
    }
}

#[test]
fn measures_agree_with_each_other() {
    let close = |a: f64, b: f64| assert!((a - b).abs() <= 1e-12 * a.abs().max(b.abs()).max(1.0), "{a} {b}");
    for mesh in meshes() {
        for f in mesh.faces() {
            let angles: f64 = mesh.face_halfedges(f).map(|h| mesh.corner_angle(h)).iter().sum();
            close(angles, PI);
            let [a, b, c] = mesh.face_positions(f);
            close(
                mesh.area(f),
                0.5 * (b - a).norm() * (c - a).norm() * mesh.corner_angle(mesh.face_halfedges(f)[0]).sin(),
            );
            close(mesh.normal(f).dot(&(b - a)), 0.0);
            close(mesh.normal(f).norm(), 1.0);
        }
        for h in mesh.halfedges() {
            close(mesh.cotangent(h), 1.0 / mesh.corner_angle(mesh.previous(h)).tan());
        }
        let area: f64 = mesh.faces().map(|f| mesh.area(f)).sum();
        close(mesh.total_area(), area);
    }
    let cube = shapes::cuboid(Vec3::new(1.0, 2.0, 2.0), 1);
    assert_eq!(cube.bounds().diagonal(), 3.0);
    let mut cosines: Vec<f64> = cube.edges().filter_map(|e| cube.dihedral_cosine(e)).collect();
    cosines.sort_by(f64::total_cmp);
    assert_eq!((cosines.len(), cosines[11], cosines[12]), (18, 0.0, 1.0));
}

#[test]
fn what_is_no_mesh_is_refused_with_its_ids() {
    let square = || vec![Vec3::zeros(), Vec3::x(), Vec3::new(1.0, 1.0, 0.0), Vec3::y(), Vec3::z()];
    let new = |faces: &[[u32; 3]]| TriMesh::new(square(), faces).unwrap_err();
    assert_eq!(new(&[]), MeshError::Empty);
    assert_eq!(new(&[[0, 1, 9]]), MeshError::IndexOutOfRange { face: 0, index: 9, vertices: 5 });
    assert_eq!(new(&[[0, 1, 2]]), MeshError::Unreferenced { vertex: 3 });
    assert!(matches!(new(&[[0, 1, 2], [2, 3, 3], [0, 4, 1]]), MeshError::DegenerateFace { face: 1, .. }));
    let fin = new(&[[0, 1, 2], [0, 2, 3], [0, 2, 4]]);
    assert!(matches!(&fin, MeshError::NonManifoldEdge { edge: [0, 2], faces, .. } if faces == &[0, 1, 2]), "{fin}");
    let turned = new(&[[0, 1, 2], [2, 0, 3], [0, 1, 4]]);
    assert!(matches!(&turned, MeshError::NonManifoldEdge { edge: [0, 1], faces, .. } if faces == &[0, 2]), "{turned}");
    let bow = TriMesh::new(vec![Vec3::zeros(), Vec3::x(), Vec3::y(), -Vec3::x(), -Vec3::y()], &[[0, 1, 2], [0, 3, 4]]);
    assert_eq!(bow.unwrap_err(), MeshError::NonManifoldVertex { vertex: 0, place: Vec3::zeros() });
    // Three fans at a vertex, the first of them closed.
    let mut closed = shapes::icosphere(1.0, 0);
    closed.positions_mut()[VertexId(0)] = Vec3::zeros();
    let positions: Vec<Vec3> = closed.positions().iter().copied().chain([Vec3::x() * 9.0, Vec3::y() * 9.0]).collect();
    let faces = [closed.face_indices(), vec![[0, 12, 13]]].concat();
    assert!(matches!(TriMesh::new(positions, &faces), Err(MeshError::NonManifoldVertex { vertex: 0, .. })));
    let mut nan = square();
    nan[2].y = f64::NAN;
    assert!(matches!(TriMesh::new(nan, &[[0, 1, 2]]), Err(MeshError::NotFinite { vertex: 2, .. })));
    let line: Vec<Vec3> = (0..3).map(|k| Vec3::repeat(0.1) * f64::from(k)).collect();
    assert!(matches!(TriMesh::new(line, &[[0, 1, 2]]), Err(MeshError::DegenerateFace { face: 0, .. })));
}

#[test]
fn validate_finds_what_is_broken() {
    let good = shapes::icosphere(1.0, 1);
    let broken = |change: &dyn Fn(&mut TriMesh)| {
        let mut mesh = good.clone();
        change(&mut mesh);
        mesh.validate().is_err()
    };
    assert!(broken(&|it| it.twins[5] = 0));
    assert!(broken(&|it| it.twins[5] = NONE));
    assert!(broken(&|it| it.tails.swap(4, 7)));
    assert!(broken(&|it| it.outgoing[VertexId(3)] = it.outgoing[VertexId(4)]));
    assert!(broken(&|it| it.edge_of[8] = EdgeId(0)));
    assert!(broken(&|it| it.positions[VertexId(2)].z = f64::NAN));
}
