//! The fixtures: the good ones are what they claim to be, the broken ones are repaired or refused, each as it should.
use std::path::{Path, PathBuf};

use fabricate::{
    import::mesh::read,
    mesh::{
        TriMesh,
        repair::{Components, MeshFacts, Repair, RepairOptions, repair},
    },
};

fn path(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures").join(name)
}

fn load(name: &str, fill_holes: usize, components: Components) -> Result<(TriMesh, Vec<Repair>), String> {
    let soup = read(&path(name)).map_err(|it| it.to_string())?;
    repair(&soup, &RepairOptions { fill_holes, components }).map_err(|it| it.to_string())
}

/// A fixture that needs no repair.
pub(crate) fn good(name: &str) -> TriMesh {
    load(name, 0, Components::One).unwrap().0
}

#[test]
fn good_fixtures_need_no_repair_and_have_their_topology() {
    // Boundary loops, genus, height in mm.
    let expected = [
        ("figure.obj", 0, 0, 150.0),
        ("vase.obj", 1, 0, 180.0),
        ("torus.obj", 0, 1, 36.0),
        ("double-torus.obj", 0, 2, 44.0),
        ("bumpy.obj", 0, 0, 100.0),
        ("rounded-cube.obj", 0, 0, 80.0),
        ("cylinder.obj", 2, 0, 100.0),
        ("cone.obj", 2, 0, 90.0),
        ("tangent-developable.obj", 1, 0, 110.0),
        ("cone-patch.obj", 1, 0, 47.0),
        ("twisted-patch.obj", 1, 0, 28.0),
        ("ball.stl", 0, 0, 60.0),
        ("ball.ply", 0, 0, 60.0),
        ("ball.off", 0, 0, 60.0),
    ];
    for (name, loops, genus, height) in expected {
        let (mesh, repairs) = load(name, 0, Components::One).unwrap();
        let facts = MeshFacts::of(&mesh);
        assert_eq!((facts.boundary_loops, facts.genus, repairs.len()), (loops, genus, 0), "{name}");
        let size = mesh.bounds().size();
        assert!((size.y - height).abs() < 0.15 * height, "{name} is {} mm high", size.y);
        let smallest = mesh.halfedges().map(|h| mesh.corner_angle(h)).fold(f64::INFINITY, f64::min).to_degrees();
        assert!(smallest > 5.0, "{name}: smallest angle {smallest}°");
    }
}

#[test]
fn developable_fixtures_are_developable() {
    for name in ["cylinder.obj", "cone.obj", "tangent-developable.obj", "cone-patch.obj", "twisted-patch.obj"] {
        let (mesh, _) = load(name, 0, Components::One).unwrap();
        let inner = mesh.vertices().filter(|&v| !mesh.is_boundary_vertex(v));
        let worst = inner.map(|v| mesh.angle_defect(v).abs()).fold(0.0, f64::max);
        assert!(worst < 1e-9, "{name}: {worst}");
    }
}

#[test]
fn broken_fixtures_are_refused_with_place_and_remedy() {
    let cases = [
        ("nonmanifold-edge.obj", "1 edge has more than two faces"),
        ("moebius.obj", "only one side"),
        ("two-components.obj", "2 separate components"),
        ("nan.obj", "1 vertex has a coordinate that is not a finite number: first vertex 0"),
        ("out-of-range.obj", "a face names vertex 999, but the file holds 162"),
        ("points-only.obj", "no faces, only 162 vertices"),
        ("empty.obj", "the file is empty"),
        ("truncated.stl", "announces 320 triangles, but the file ends after"),
    ];
    for (name, expected) in cases {
        let refused = load(&format!("broken-{name}"), 0, Components::One).unwrap_err();
        assert!(refused.contains(expected), "{name}: {refused}");
    }
}

#[test]
fn what_is_safe_is_repaired_and_said() {
    let (mesh, repairs) = load("broken-flipped-faces.obj", 0, Components::One).unwrap();
    assert_eq!((mesh.face_count(), repairs.len()), (320, 1));
    assert!(repairs[0].to_string().starts_with("turned 107 faces to face like their neighbours"), "{}", repairs[0]);
    let (open, _) = load("broken-holes.obj", 0, Components::One).unwrap();
    let holes = open.boundary_loops().len();
    let (closed, repairs) = load("broken-holes.obj", 20, Components::One).unwrap();
    assert_eq!((closed.boundary_loops().len(), closed.euler_characteristic()), (0, 2));
    assert!(repairs.iter().any(|it| it.to_string().starts_with(&format!("filled {holes} holes"))));
    let (largest, _) = load("broken-two-components.obj", 0, Components::Largest).unwrap();
    assert_eq!(largest.face_count(), 320);
    assert_eq!(load("broken-two-components.obj", 0, Components::All).unwrap().0.components().1, 2);
}
