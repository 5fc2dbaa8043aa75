//! Laws of unfolding, over shapes by property: convex or not, closed or not, with handles or without, flat or not.
use std::f64::consts::TAU;

use super::*;
use crate::{
    geom::{Vec3, polygon::least_excess, signed_area, triangle::triangles_overlap},
    mesh::shapes,
};

fn options() -> Options {
    Options {
        max_faces: 5000,
        clearance: 0.2,
        least_opening: 1e-3,
        moves: 500,
        sheet: None,
        split: true,
        separate: false,
        seed: 0,
    }
}

fn run(mesh: &TriMesh, options: &Options) -> (CutMesh, Flattening) {
    unfold(mesh, options, &Monitor::silent()).unwrap()
}

/// A ball with bumps and dents.
fn potato() -> TriMesh {
    let ball = shapes::icosphere(60.0, 2);
    let bumpy = |p: &Vec3| {
        let d = p / 60.0;
        p * (1.0 + 0.3 * (3.0 * d.x + 1.0).sin() * (2.5 * d.y).cos() + 0.2 * (4.0 * d.z).sin())
    };
    ball.with_positions(Field::from_vec(ball.positions().iter().map(bumpy).collect()))
}

fn all() -> Vec<(&'static str, TriMesh)> {
    let triangle = [Vec3::zeros(), Vec3::new(30.0, 0.0, 5.0), Vec3::new(4.0, 20.0, 0.0)];
    vec![
        ("one face", TriMesh::new(triangle.to_vec(), &[[0, 1, 2]]).unwrap()),
        ("flat", shapes::grid(4, 3, 10.0)),
        ("handles", shapes::perforated_plate(2, 20.0, 2)),
        ("cube", shapes::cuboid(Vec3::new(30.0, 40.0, 50.0), 2)),
        ("convex", shapes::icosphere(50.0, 2)),
        ("open prism", shapes::cylinder(20.0, 60.0, 12, 3)),
        ("saddles", shapes::torus(40.0, 15.0, 12, 8)),
        ("dents", potato()),
        ("flat around a bent vertex", crumpled()),
    ]
}

#[test]
fn pieces_are_exact_trees_without_overlap() {
    for (name, mesh) in all() {
        let (cut, flat) = run(&mesh, &options());
        assert_eq!(flat.fits(&cut), Ok(()), "{name}");
        assert!(isometry(&cut, &flat) <= ISOMETRY * mesh.bounds().diagonal(), "{name}");
        let corners = |f: FaceId| cut.mesh.face_vertices(f).map(|v| flat.uv[v]);
        for f in cut.mesh.faces() {
            let (plane, space) = (signed_area(&corners(f)), mesh.area(f));
            assert!((plane - space).abs() < 1e-9 * space, "{name}: face {f} has {plane} mm² of {space}");
        }
        // Neighbours that share vertices of the cut mesh touch by construction.
        let shares =
            |f: FaceId, g: FaceId| cut.mesh.face_vertices(f).iter().any(|v| cut.mesh.face_vertices(g).contains(v));
        for f in cut.mesh.faces() {
            for g in cut.mesh.faces().filter(|&g| g > f && cut.piece_of[f] == cut.piece_of[g] && !shares(f, g)) {
                assert!(!triangles_overlap(corners(f), corners(g)), "{name}: {f} and {g}");
            }
        }
        assert!(flat.overlaps.is_empty(), "{name}");
        // A tree of flat tiles has no vertex inside but flat ones.
        for v in cut.mesh.vertices().filter(|&v| !cut.mesh.is_boundary_vertex(v)) {
            let total: f64 = cut.mesh.outgoing(v).map(|h| cut.mesh.corner_angle(h)).sum();
            assert!((total - TAU).abs() < 1e-6, "{name}: vertex {v} has {total} rad around it");
        }
        assert_eq!(cut.mesh.genus(), 0, "{name}");
    }
}

#[test]
fn every_edge_is_fold_or_seam_or_boundary() {
    for (name, mesh) in all() {
        let (cut, flat) = run(&mesh, &options());
        let mut in_seams = vec![0; mesh.halfedge_count()];
        for seam in &cut.seams {
            assert_eq!(seam.sides[0].len(), seam.sides[1].len());
            for (&g, &h) in seam.sides[0].iter().zip(&seam.sides[1]) {
                assert_eq!(mesh.twin(g), Some(h), "{name}: seam {}", seam.label);
                in_seams[g.index()] += 1;
                in_seams[h.index()] += 1;
            }
            let [a, b] = flat.seam_sides(&cut, seam);
            assert!((a - b).abs() < 1e-9 * (a + b), "{name}");
        }
        for h in mesh.halfedges() {
            let seam = mesh.twin(h).is_some() && cut.mesh.twin(h).is_none();
            assert_eq!(in_seams[h.index()], usize::from(seam), "{name}: halfedge {h}");
        }
    }
}

#[test]
fn convex_and_flat_shapes_are_one_piece() {
    for (name, mesh) in all() {
        let (cut, _) = run(&mesh, &options());
        let most = if ["handles", "saddles", "dents"].contains(&name) { 3 } else { 1 };
        assert!(cut.pieces.len() <= most, "{name}: {}", cut.pieces.len());
    }
    // What is developable needs no cut at all.
    let developable = shapes::tangent_developable(40.0, 30.0, 0.25, [15.0, 60.0], 8, 2);
    assert_eq!(run(&developable, &options()).0.pieces.len(), 1);
}

/// Faces around a point with 2π around it, none in the plane of another: rims up and down in turn.
fn crumpled() -> TriMesh {
    let rim = |lift: f64| -> Vec<Vec3> {
        let turn = |k: u32| TAU * f64::from(k) / 8.0;
        let up = |k: u32| lift + if k.is_multiple_of(2) { 0.3 } else { -0.3 };
        (0..8)
            .map(|k| 20.0 * Vec3::new(turn(k).cos() * up(k).cos(), turn(k).sin() * up(k).cos(), up(k).sin()))
            .collect()
    };
    let around = |rim: &[Vec3]| (0..8).map(|k| angle_between(rim[k], rim[(k + 1) % 8])).sum::<f64>();
    let (mut low, mut high) = (0.0, 1.2);
    for _ in 0..100 {
        let middle = (low + high) / 2.0;
        if around(&rim(middle)) > TAU { low = middle } else { high = middle }
    }
    let points = rim(low).into_iter().chain([Vec3::zeros()]).collect();
    let faces: Vec<[u32; 3]> = (0..8).map(|k| [k, (k + 1) % 8, 8]).collect();
    TriMesh::new(points, &faces).unwrap()
}

#[test]
fn slits_between_coinciding_sides_are_closed() {
    let mesh = crumpled();
    assert_eq!(Tiles::new(&mesh, &Field::filled(mesh.face_count(), 0)).tiles.len(), 8);
    let (cut, _) = run(&mesh, &options());
    assert_eq!((cut.pieces.len(), cut.seams.len()), (1, 0));
}

#[test]
fn pieces_fit_the_sheet_and_a_face_that_does_not_stands_alone() {
    let ball = shapes::icosphere(90.0, 2);
    let sheet = [267.0, 388.0];
    let (cut, flat) = run(&ball, &Options { sheet: Some(sheet), ..options() });
    assert!((2..=4).contains(&cut.pieces.len()), "{}", cut.pieces.len());
    for hull in hulls(&cut, &flat).iter() {
        assert!(least_excess(hull, sheet).0 <= 1.0);
    }
    let cube = shapes::cuboid(Vec3::new(100.0, 100.0, 100.0), 1);
    let (cut, _) = run(&cube, &Options { sheet: Some([90.0, 90.0]), split: false, ..options() });
    assert_eq!(cut.pieces.len(), 6);
    assert_eq!(cut.seams.len(), 12);
}

#[test]
fn a_face_larger_than_the_sheet_is_cut_once_more() {
    for (mesh, room) in [
        (shapes::cuboid(Vec3::new(100.0, 100.0, 100.0), 1), [90.0, 90.0]),
        (shapes::cuboid(Vec3::new(300.0, 40.0, 130.0), 2), [70.0, 110.0]),
        (shapes::icosphere(200.0, 0), [60.0, 80.0]),
    ] {
        let (cut, flat) = run(&mesh, &Options { sheet: Some(room), moves: 100, ..options() });
        for hull in hulls(&cut, &flat).iter() {
            assert!(least_excess(hull, room).0 <= 1.0);
        }
        assert!(isometry(&cut, &flat) <= ISOMETRY * mesh.bounds().diagonal());
        assert!((cut.mesh.total_area() - mesh.total_area()).abs() < 1e-9 * mesh.total_area());
        let least = mesh.total_area() / (room[0] * room[1]);
        assert!(cut.pieces.len() as f64 >= least && flat.overlaps.is_empty());
        // Both sides of every cut are seams of the same length.
        for seam in &cut.seams {
            let [a, b] = flat.seam_sides(&cut, seam);
            assert!((a - b).abs() < 1e-9 * (a + b));
        }
    }
}

#[test]
fn board_that_cannot_be_folded_is_cut_face_by_face() {
    let (cut, _) = run(&shapes::cuboid(Vec3::new(60.0, 50.0, 40.0), 3), &Options { separate: true, ..options() });
    assert_eq!((cut.pieces.len(), cut.seams.len()), (6, 12));
}

#[test]
fn the_result_does_not_depend_on_the_number_of_threads() {
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| run(&potato(), &options()))
    };
    let one = on(1);
    assert_eq!(one, on(3));
    assert_ne!(one, run(&potato(), &Options { seed: 1, ..options() }), "the seed counts");
}

#[test]
fn too_many_faces_are_refused_with_their_number() {
    let ball = shapes::icosphere(50.0, 2);
    let error = unfold(&ball, &Options { max_faces: 300, ..options() }, &Monitor::silent()).unwrap_err();
    assert_eq!(error, UnfoldError::TooMany { faces: 320, limit: 300 });
    assert!(error.to_string().contains("coarsen.faces"));
}

#[test]
fn more_moves_make_it_better() {
    let pieces = |moves: usize| {
        let mesh = shapes::torus(60.0, 25.0, 18, 10);
        let (cut, _) = run(&mesh, &Options { moves, sheet: Some([200.0, 280.0]), ..options() });
        let length: f64 = cut.seams.iter().flat_map(|it| &it.sides[0]).map(|&h| mesh.vector(h).norm()).sum();
        (cut.pieces.len(), length)
    };
    let (none, many) = (pieces(0), pieces(20_000));
    assert!(many.0 < none.0 || many.0 == none.0 && many.1 < none.1, "{none:?} {many:?}");
}
