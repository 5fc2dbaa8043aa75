//! Tests of the repair.
use super::*;
use crate::mesh::shapes;

const STRICT: RepairOptions = RepairOptions { fill_holes: 0, components: Components::One };
const ALL: RepairOptions = RepairOptions { fill_holes: 0, components: Components::All };

fn soup(mesh: &TriMesh) -> Soup {
    Soup { positions: mesh.positions().as_slice().to_vec(), faces: mesh.face_indices() }
}

/// Every face with vertices of its own.
fn unwelded(mesh: &TriMesh) -> Soup {
    Soup {
        positions: mesh.faces().flat_map(|f| mesh.face_positions(f)).collect(),
        faces: (0..mesh.face_count() as u32).map(|f| [3 * f, 3 * f + 1, 3 * f + 2]).collect(),
    }
}

fn join(a: &Soup, b: &Soup) -> Soup {
    let offset = a.positions.len() as u32;
    let faces = b.faces.iter().map(|t| t.map(|v| v + offset));
    Soup {
        positions: a.positions.iter().chain(&b.positions).copied().collect(),
        faces: a.faces.iter().copied().chain(faces).collect(),
    }
}

fn shapes() -> Vec<TriMesh> {
    vec![
        shapes::grid(4, 3, 1.0),
        shapes::icosphere(10.0, 2),
        shapes::cylinder(5.0, 20.0, 12, 3),
        shapes::torus(10.0, 4.0, 16, 8),
        shapes::perforated_plate(2, 5.0, 1),
        shapes::tangent_developable(20.0, 40.0, 1.0, [8.0, 60.0], 30, 4),
    ]
}

fn actions(repairs: &[Repair]) -> Vec<(Action, usize)> {
    repairs.iter().map(|it| (it.action, it.count)).collect()
}

fn volume(mesh: &TriMesh) -> f64 {
    mesh.faces().map(|f| mesh.face_positions(f)).map(|[a, b, c]| a.dot(&b.cross(&c)) / 6.0).sum()
}

#[test]
fn a_good_mesh_is_left_alone() {
    for mesh in shapes() {
        assert_eq!(repair(&soup(&mesh), &STRICT), Ok((mesh, vec![])));
    }
}

#[test]
fn unwelded_triangles_become_the_mesh_they_were() {
    for mesh in shapes() {
        let (mended, repairs) = repair(&unwelded(&mesh), &STRICT).unwrap();
        assert_eq!(actions(&repairs), [(Action::Weld, 3 * mesh.face_count() - mesh.vertex_count())]);
        let facts = MeshFacts::of(&mended);
        assert_eq!(facts, MeshFacts::of(&mesh));
        assert_eq!(mended.total_area(), mesh.total_area());
    }
}

#[test]
fn coinciding_vertices_of_a_closed_surface_stay_apart() {
    // Welding cubes that touch along two edges would make two edges of four faces.
    let cube = soup(&shapes::cuboid(Vec3::repeat(1.0), 2));
    let mut moved = cube.clone();
    moved.positions.iter_mut().for_each(|p| *p += Vec3::new(1.0, 1.0, 0.0));
    let both = join(&cube, &moved);
    let (mesh, repairs) = repair(&both, &ALL).unwrap();
    assert_eq!((mesh.vertex_count(), repairs.len()), (52, 0));
    // The same as single triangles, and as a file that has welded them: the ends of the common line tell what belongs
    // together.
    let (mesh, _) = repair(&unwelded(&mesh), &ALL).unwrap();
    assert_eq!((mesh.vertex_count(), mesh.components().1, mesh.boundary_loops().len()), (52, 2, 0));
    let place = glue::position_ids(&both.positions);
    let welded = Soup { faces: both.faces.iter().map(|t| t.map(|v| place[v as usize])).collect(), ..both };
    let (mesh, repairs) = repair(&welded, &ALL).unwrap();
    assert_eq!((mesh.vertex_count(), mesh.components().1, mesh.boundary_loops().len()), (52, 2, 0));
    assert_eq!(actions(&repairs), [(Action::DropUnreferenced, 3), (Action::SplitEdge, 2), (Action::Split, 3)]);
}

#[test]
fn faces_that_touch_in_a_point_come_apart() {
    let cube = soup(&shapes::cuboid(Vec3::repeat(1.0), 1));
    let mut both = join(&cube, &cube);
    both.positions.iter_mut().skip(8).for_each(|p| *p += Vec3::repeat(1.0));
    let far = both.positions[..8].iter().position(|p| *p == Vec3::repeat(1.0)).unwrap() as u32;
    let near = both.positions.iter().rposition(|p| *p == Vec3::repeat(1.0)).unwrap() as u32;
    both.faces.iter_mut().flatten().filter(|v| **v == near).for_each(|v| *v = far);
    let (mesh, repairs) = repair(&both, &ALL).unwrap();
    assert_eq!(actions(&repairs), [(Action::DropUnreferenced, 1), (Action::Split, 1)]);
    assert_eq!((mesh.vertex_count(), mesh.components().1), (16, 2));
    let refused = repair(&both, &STRICT).unwrap_err();
    assert!(matches!(refused, MeshRefusal::SeveralComponents { count: 2, .. }), "{refused}");
}

#[test]
fn orientation_is_propagated_and_closed_surfaces_face_outwards() {
    let sphere = shapes::icosphere(10.0, 1);
    let mut some = soup(&sphere);
    some.faces.iter_mut().step_by(3).for_each(|t| t.swap(0, 1));
    let (mesh, repairs) = repair(&some, &STRICT).unwrap();
    assert_eq!(actions(&repairs), [(Action::Orient, 27)]);
    assert_eq!(volume(&mesh), volume(&sphere));
    let mut most = soup(&sphere);
    most.faces.iter_mut().skip(10).for_each(|t| t.swap(0, 1));
    let (mesh, repairs) = repair(&most, &STRICT).unwrap();
    assert_eq!(actions(&repairs), [(Action::Orient, 10), (Action::TurnOutwards, 1)]);
    assert!((volume(&mesh) - volume(&sphere)).abs() < 1e-9);
    // An open surface keeps the side of most of its faces.
    let mut sheet = soup(&shapes::grid(3, 3, 1.0));
    sheet.faces[4].swap(0, 1);
    let (mesh, repairs) = repair(&sheet, &STRICT).unwrap();
    assert_eq!(actions(&repairs), [(Action::Orient, 1)]);
    assert!(mesh.faces().all(|f| mesh.normal(f).z > 0.0));
}

/// A strip with a half twist; closed by ids, or by position alone.
fn moebius(closed: bool) -> Soup {
    let n = 24_u32;
    let point = |k: u32, side: f64| {
        let angle = f64::from(k) * std::f64::consts::TAU / f64::from(n);
        let r = 20.0 + side * 5.0 * (angle / 2.0).cos();
        Vec3::new(r * angle.cos(), r * angle.sin(), side * 5.0 * (angle / 2.0).sin())
    };
    let mut positions: Vec<Vec3> = (0..n).flat_map(|k| [point(k, -1.0), point(k, 1.0)]).collect();
    let last = if closed { [1, 0] } else { [2 * n, 2 * n + 1] };
    if !closed {
        positions.extend([positions[1], positions[0]]);
    }
    let pair = |k: u32| if k == n { last } else { [2 * k, 2 * k + 1] };
    let faces = (0..n).flat_map(|k| {
        let ([a, b], [c, d]) = (pair(k), pair(k + 1));
        [[a, c, b], [b, c, d]]
    });
    Soup { positions, faces: faces.collect() }
}

#[test]
fn one_sided_surfaces_are_refused_and_never_made() {
    let refused = repair(&moebius(true), &STRICT).unwrap_err();
    assert!(matches!(refused, MeshRefusal::NonOrientable { .. }), "{refused}");
    let (mesh, repairs) = repair(&moebius(false), &STRICT).unwrap();
    assert_eq!((repairs.len(), mesh.boundary_loops().len()), (0, 1));
}

#[test]
fn what_no_surface_can_have_is_refused_with_its_place() {
    let sheet = soup(&shapes::grid(2, 2, 1.0));
    let mut fin = sheet.clone();
    fin.positions.push(Vec3::new(0.5, 0.5, 1.0));
    fin.faces.push([0, 4, 9]);
    let MeshRefusal::NonManifold { count, edges } = repair(&fin, &STRICT).unwrap_err() else { panic!() };
    assert_eq!((count, edges[0].vertices, edges[0].at), (1, [0, 4], Vec3::new(0.5, 0.5, 0.0)));
    assert_eq!(edges[0].faces, [0, 1, 8]);

    let mut nan = sheet.clone();
    nan.positions[4].y = f64::NAN;
    nan.positions[7].x = f64::INFINITY;
    let refused = repair(&nan, &STRICT).unwrap_err();
    assert!(matches!(refused, MeshRefusal::NotFinite { count: 2, vertex: 4, .. }), "{refused}");

    let mut index = sheet.clone();
    index.faces[3][1] = 99;
    let refused = repair(&index, &STRICT).unwrap_err();
    assert_eq!(refused, MeshRefusal::IndexOutOfRange { face: 3, index: 99, vertices: 9 });

    let empty = Soup { positions: sheet.positions.clone(), faces: vec![] };
    assert_eq!(repair(&empty, &STRICT), Err(MeshRefusal::Empty { vertices: 9 }));
    let mut line = sheet.clone();
    line.positions.iter_mut().for_each(|p| p.y = 0.0);
    let refused = repair(&line, &STRICT).unwrap_err();
    assert!(matches!(refused, MeshRefusal::NothingLeft | MeshRefusal::Degenerate { .. }), "{refused}");
    let mut huge = sheet;
    huge.positions.iter_mut().for_each(|p| *p *= 1e200);
    assert!(matches!(repair(&huge, &STRICT), Err(MeshRefusal::Extent { .. })));
}

#[test]
fn unused_vertices_may_hold_anything() {
    let mut sheet = soup(&shapes::grid(2, 2, 1.0));
    sheet.positions.insert(3, Vec3::repeat(f64::NAN));
    sheet.faces.iter_mut().flatten().filter(|v| **v >= 3).for_each(|v| *v += 1);
    let (mesh, repairs) = repair(&sheet, &STRICT).unwrap();
    assert_eq!(mesh, shapes::grid(2, 2, 1.0));
    assert_eq!(actions(&repairs), [(Action::DropUnreferenced, 1)]);
}

#[test]
fn doubled_faces_and_sheets_are_dropped() {
    let sheet = soup(&shapes::grid(3, 2, 1.0));
    let mut doubled = sheet.clone();
    doubled.faces.push([sheet.faces[5][1], sheet.faces[5][0], sheet.faces[5][2]]);
    doubled.faces.push([2, 2, 3]);
    let (mesh, repairs) = repair(&doubled, &STRICT).unwrap();
    assert_eq!(mesh.face_indices(), sheet.faces);
    assert_eq!(actions(&repairs), [(Action::DropRepeatedCorner, 1), (Action::DropDuplicate, 1)]);
    let mut back = sheet.clone();
    back.faces.iter_mut().for_each(|t| t.swap(0, 1));
    let (mesh, repairs) = repair(&join(&sheet, &back), &STRICT).unwrap();
    assert_eq!(mesh.face_indices(), sheet.faces);
    assert_eq!(repairs[0].action, Action::DropDuplicate);
}

#[test]
fn faces_without_area_are_mended_without_opening_the_surface() {
    let cube = shapes::cuboid(Vec3::repeat(2.0), 2);
    // Each edge of one face gets a vertex in its middle that only this side uses: three flat faces fill the slits.
    let mut flat = soup(&cube);
    let [a, b, c] = flat.faces[0];
    let n = flat.positions.len() as u32;
    for (p, q) in [(a, b), (b, c), (c, a)] {
        flat.positions.push((flat.positions[p as usize] + flat.positions[q as usize]) / 2.0);
    }
    flat.faces[0] = [n, n + 1, n + 2];
    flat.faces.extend([[a, n, n + 2], [b, n + 1, n], [c, n + 2, n + 1], [a, b, n], [b, c, n + 1], [c, a, n + 2]]);
    let (mesh, repairs) = repair(&flat, &STRICT).unwrap();
    assert_eq!(actions(&repairs), [(Action::MendFlat, 3)]);
    assert_eq!((mesh.euler_characteristic(), mesh.boundary_loops().len()), (2, 0));
    assert!((mesh.total_area() - 24.0).abs() < 1e-12 && (volume(&mesh) - 8.0).abs() < 1e-12);
    // A vertex split in two, with two flat faces between.
    let mut slit = soup(&shapes::grid(2, 2, 1.0));
    slit.positions.push(slit.positions[4]);
    for face in [4, 6, 7] {
        slit.faces[face].iter_mut().filter(|v| **v == 4).for_each(|v| *v = 9);
    }
    let open = repair(&slit, &STRICT).unwrap();
    assert_eq!(actions(&open.1), [(Action::Weld, 1)]);
    // A flat face beyond the boundary brings a vertex into the face that it touches; one along it is dropped.
    let mut edge = soup(&shapes::grid(1, 1, 1.0));
    edge.positions.push(Vec3::new(0.25, 0.0, 0.0));
    edge.faces.push([1, 0, 4]);
    let (mesh, repairs) = repair(&edge, &STRICT).unwrap();
    assert_eq!(actions(&repairs), [(Action::MendFlat, 1)]);
    assert_eq!((mesh.face_count(), mesh.total_area(), mesh.boundary_loops().len()), (3, 1.0, 1));
    let mut along = soup(&shapes::grid(2, 1, 1.0));
    along.faces.push([0, 2, 1]);
    let (mesh, repairs) = repair(&along, &STRICT).unwrap();
    assert_eq!(actions(&repairs), [(Action::MendFlat, 1)]);
    assert_eq!(mesh, shapes::grid(2, 1, 1.0));
}

#[test]
fn small_holes_are_filled_when_asked() {
    let sphere = shapes::icosphere(10.0, 2);
    let mut holed = soup(&sphere);
    // All faces around vertex 0 (five of them), and one face elsewhere.
    let far = holed.faces.iter().rposition(|t| !t.contains(&0)).unwrap();
    holed.faces.remove(far);
    holed.faces.retain(|t| !t.contains(&0));
    let loops = |limit: usize| {
        let (mesh, repairs) = repair(&holed, &RepairOptions { fill_holes: limit, ..STRICT }).unwrap();
        let filled = repairs.iter().find(|it| it.action == Action::FillHole).map_or(0, |it| it.count);
        (mesh.boundary_loops().len(), filled)
    };
    assert_eq!([loops(0), loops(3), loops(4), loops(5)], [(2, 0), (1, 1), (1, 1), (0, 2)]);
    let (mesh, _) = repair(&holed, &RepairOptions { fill_holes: 5, ..STRICT }).unwrap();
    assert_eq!((mesh.euler_characteristic(), mesh.face_count()), (2, sphere.face_count() - 2));
    assert!(mesh.edges().all(|e| mesh.dihedral_cosine(e).unwrap() > 0.5));
    let lone = Soup { positions: holed.positions.clone(), faces: vec![holed.faces[0]] };
    let (mesh, _) = repair(&lone, &RepairOptions { fill_holes: 9, ..STRICT }).unwrap();
    assert_eq!(mesh.face_count(), 1);
}

#[test]
fn the_largest_component_is_kept_whole() {
    let (small, large) = (shapes::icosphere(1.0, 1), shapes::torus(10.0, 4.0, 16, 8));
    let both = join(&soup(&small), &soup(&large));
    let (mesh, repairs) = repair(&both, &RepairOptions { components: Components::Largest, ..STRICT }).unwrap();
    assert_eq!(mesh, large);
    assert_eq!(actions(&repairs), [(Action::KeepLargest, 1)]);
}

#[test]
fn messages_name_places_and_ways_out() {
    let both = join(&soup(&shapes::icosphere(1.0, 0)), &soup(&shapes::grid(1, 1, 2.0)));
    assert_eq!(
        repair(&both, &STRICT).unwrap_err().to_string(),
        "the mesh has 2 separate components (20 faces around (0, 0, 0), 2 faces around (1, 1, 0)); set input.component \
         to \"largest\" or \"all\", or join them"
    );
    let mut unused = soup(&shapes::grid(1, 1, 2.0));
    unused.positions.push(Vec3::new(1234.5678, -0.25, 1e-9));
    assert_eq!(
        repair(&unused, &STRICT).unwrap().1[0].to_string(),
        "removed 1 vertex that no face uses (vertex 4 at (1234.57, -0.25, 1e-9))"
    );
}

/// Senseless soups with many coincidences: whatever comes out is a mesh or a refusal, and the repair never fails on its
/// own work.
#[test]
fn senseless_soups_are_meshes_or_refused() {
    let mut state = 1_u64;
    let mut random = move |n: u64| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) % n
    };
    let mut meshes = 0;
    for round in 0..4000 {
        let vertices = 4 + random(12);
        let positions = (0..vertices).map(|_| Vec3::new(random(3) as f64, random(3) as f64, random(2) as f64));
        let positions = positions.collect();
        let faces = (0..1 + random(14)).map(|_| [(); 3].map(|()| random(vertices) as u32)).collect();
        let options = RepairOptions { fill_holes: round % 6, ..ALL };
        match repair(&Soup { positions, faces }, &options) {
            Ok((mesh, repairs)) => {
                meshes += 1;
                assert!(repairs.iter().all(|it| it.count > 0 && !it.places.is_empty()), "{repairs:?}");
                assert_eq!(mesh.find_halfedge(mesh.tail(HALF), mesh.head(HALF)), Some(HALF));
                assert!(mesh.boundary_loops().iter().flatten().all(|&h| mesh.twin(h).is_none()));
                assert!(mesh.genus() <= mesh.face_count() && mesh.components().1 <= mesh.face_count());
            }
            Err(refused) => assert!(!matches!(refused, MeshRefusal::Internal(_)), "round {round}: {refused}"),
        }
    }
    assert!(meshes > 1000, "only {meshes} of 4000 soups became meshes");
}

const HALF: crate::mesh::HalfedgeId = crate::mesh::HalfedgeId(0);
