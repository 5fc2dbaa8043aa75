//! Properties of coarse meshes on shapes made by formula.
use super::*;
use crate::mesh::{distance::SurfaceDistance, shapes};

const FEATURE: f64 = 0.8;

fn isotropic(source: &TriMesh, edge_length: f64) -> TriMesh {
    let options = IsotropicOptions { edge_length, feature_angle: FEATURE };
    remesh(source, source, &options, &Monitor::silent()).unwrap()
}

fn quadric(source: &TriMesh, faces: Option<usize>, max_error: Option<f64>) -> TriMesh {
    let options = QuadricOptions { faces, max_error, feature_angle: FEATURE };
    simplify(source, &options, &Monitor::silent()).unwrap()
}

fn topology(mesh: &TriMesh) -> (usize, usize, usize) {
    (mesh.components().1, mesh.boundary_loops().len(), mesh.genus())
}

/// Whether every face looks the same way as the surface of `source` nearest to it.
fn nothing_is_inverted(source: &TriMesh, mesh: &TriMesh) -> bool {
    let tree = Bvh::new(source);
    mesh.faces().all(|f| {
        let [a, b, c] = mesh.face_positions(f);
        mesh.normal(f).dot(&source.normal(tree.closest((a + b + c) / 3.0).face)) > 0.0
    })
}

#[test]
fn remeshing_keeps_topology_and_makes_edges_of_one_length() {
    for source in [shapes::torus(10.0, 4.0, 80, 40), shapes::icosphere(5.0, 4), shapes::cylinder(5.0, 12.0, 60, 24)] {
        let length = 2.5 * source.mean_edge_length();
        let mesh = isotropic(&source, length);
        assert_eq!(topology(&mesh), topology(&source));
        assert!(mesh.face_count() < source.face_count() / 3);
        assert!(nothing_is_inverted(&source, &mesh));
        for e in mesh.edges() {
            let ratio = mesh.edge_length(e) / length;
            assert!((0.3..2.0).contains(&ratio), "edge of {ratio} L");
        }
        let smallest = mesh.halfedges().map(|h| mesh.corner_angle(h)).fold(f64::INFINITY, f64::min);
        assert!(smallest.to_degrees() > 15.0, "{}", smallest.to_degrees());
        // A chord of length L on a circle of radius r lies L²/8r inside; projected vertices leave no more than about that.
        let distance = SurfaceDistance::between(&source, &mesh);
        assert!(distance.hausdorff < 0.5 * length, "{} of {length}", distance.hausdorff);
    }
}

#[test]
fn collapse_reaches_its_face_count_and_keeps_topology() {
    for source in [shapes::torus(10.0, 4.0, 80, 40), shapes::cylinder(5.0, 12.0, 60, 24)] {
        let mesh = quadric(&source, Some(500), None);
        assert!(mesh.face_count() <= 500);
        assert_eq!(topology(&mesh), topology(&source));
        assert!(nothing_is_inverted(&source, &mesh));
    }
}

#[test]
fn the_error_of_a_collapse_is_bounded_with_proof() {
    let source = shapes::torus(10.0, 4.0, 60, 30);
    let mesh = quadric(&source, None, Some(0.2));
    assert!(mesh.face_count() < source.face_count() / 2);
    let bounds = distance::two_sided_bounds(&source, &mesh, 0.01, &Monitor::silent()).unwrap();
    assert!(bounds.upper <= 0.2, "{bounds:?}");
}

#[test]
fn fewer_faces_than_the_topology_allows_are_refused_with_the_number_reached() {
    let source = shapes::torus(10.0, 4.0, 20, 10);
    let options = QuadricOptions { faces: Some(4), max_error: None, feature_angle: FEATURE };
    match simplify(&source, &options, &Monitor::silent()) {
        Err(CoarsenError::TooFew { target: 4, reached }) => assert!(reached > 4),
        other => panic!("{other:?}"),
    }
}
