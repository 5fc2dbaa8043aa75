//! Laws of gores.
use super::*;
use crate::mesh::{HalfedgeId, shapes};

fn options() -> Options {
    Options {
        method: Method::Auto,
        slices: Slices::Meridians,
        count: 12,
        most: 12,
        pole: Vec3::z(),
        path: Vec::new(),
        front: Vec3::x(),
        start: 0.0,
        caps: [0.0; 2],
        share: true,
        stretch: 0.02,
        graticule: 0.0,
        texture: Vec::new(),
    }
}

/// The pieces that the seams leave: faces, boundary loops, Euler characteristic.
fn pieces(gores: &Gores) -> Vec<(usize, usize, i64)> {
    let cut = |e: EdgeId| gores.seams.binary_search(&e).is_ok();
    let mut builder = ChartBuilder::new(&gores.mesh);
    let parts = builder.components(&gores.mesh.faces().collect::<Vec<_>>(), &cut);
    parts
        .into_iter()
        .map(|faces| {
            let chart = builder.chart(faces, &cut);
            (chart.faces.len(), chart.loops.len(), chart.euler_characteristic())
        })
        .collect()
}

#[test]
fn a_globe_has_equal_gores_with_seams_along_its_meridians() {
    let globe = shapes::icosphere(100.0, 4);
    let made = gores(&globe, &options(), &Monitor::silent()).unwrap();
    let found = pieces(&made);
    assert_eq!(found.len(), 12);
    assert!(found.iter().all(|it| it.1 == 1 && it.2 == 1), "disks: {found:?}");
    assert_eq!((made.mesh.genus(), made.lines.len(), made.stretch.len()), (0, 12, 14));
    // Half a great circle each.
    let length = seam_length(&made) / 12.0;
    assert!((length / (100.0 * std::f64::consts::PI) - 1.0).abs() < 5e-3, "{length}");
    // Beside a meridian at an angle φ lines along it are cos φ as long, and 1 − cos 15° = 3.4 %. Where the seams keep their
    // length the middle has to shrink by that; otherwise they share it.
    let unshared = Options { share: false, ..options() };
    let apart = gores(&globe, &unshared, &Monitor::silent()).unwrap();
    assert!(apart.scales.iter().all(|it| *it == 1.0));
    assert!(apart.stretch[..12].iter().all(|it| (0.025..0.036).contains(it)), "{:?}", apart.stretch);
    assert!(made.stretch[..12].iter().all(|it| (0.01..0.02).contains(it)), "{:?}", made.stretch);
    assert!(made.scales.iter().all(|it| (0.99..1.03).contains(it)));
    assert!(made.scales.iter().any(|it| *it > 1.01));
    let halved = gores(&globe, &Options { stretch: 0.01, most: 48, ..options() }, &Monitor::silent()).unwrap();
    assert_eq!(halved.lines.len(), 24, "{:?}", halved.stretch);
    assert!(halved.stretch.iter().all(|it| *it <= 0.01));
}

#[test]
fn caps_are_disks_and_meridians_end_at_them() {
    let globe = shapes::icosphere(100.0, 4);
    let capped = Options { caps: [0.2, 0.3], ..options() };
    let made = gores(&globe, &capped, &Monitor::silent()).unwrap();
    let mut found = pieces(&made);
    found.sort_unstable();
    assert_eq!(found.len(), 14);
    assert!(found.iter().all(|it| it.1 == 1 && it.2 == 1), "{found:?}");
    let rim = TAU * 100.0 * (0.2_f64.sin() + 0.3_f64.sin());
    let arcs = 12.0 * 100.0 * (std::f64::consts::PI - 0.5);
    assert!((seam_length(&made) / (rim + arcs) - 1.0).abs() < 0.02, "{} {}", seam_length(&made), rim + arcs);
}

#[test]
fn rings_are_equally_wide_along_the_meridian() {
    let globe = shapes::icosphere(100.0, 4);
    let ringed = Options { slices: Slices::Rings, count: 6, stretch: 1.0, ..options() };
    let made = gores(&globe, &ringed, &Monitor::silent()).unwrap();
    let latitudes: Vec<f64> = made.lines.iter().map(|z| z.asin().to_degrees()).collect();
    for (found, wanted) in latitudes.iter().zip([-60.0, -30.0, 0.0, 30.0, 60.0]) {
        assert!((found - wanted).abs() < 1.5, "{latitudes:?}");
    }
    let found = pieces(&made);
    assert_eq!(found.len(), 6);
    assert!(found.iter().all(|it| it.1 == 1 && it.2 == 1), "the rings are open along a meridian: {found:?}");
    assert!(made.stretch.iter().all(|it| it.is_finite()));
    let halved = gores(&globe, &Options { stretch: 0.02, most: 40, ..ringed }, &Monitor::silent()).unwrap();
    assert!(halved.lines.len() > 5 && halved.stretch.iter().all(|it| *it <= 0.02), "{:?}", halved.stretch);
}

#[test]
fn rings_are_equally_wide_along_a_path() {
    // An egg that lies along x, and a path along its back from tip to tip.
    let egg = shapes::icosphere(50.0, 4);
    let long = |p: &Vec3| Vec3::new(p.x * if p.x > 0.0 { 2.0 } else { 1.2 }, p.y, p.z);
    let mesh = TriMesh::new(egg.positions().iter().map(long).collect(), &egg.face_indices()).unwrap();
    let path = vec![Vec3::new(100.0, 0.0, 0.0), Vec3::new(0.0, 0.0, 60.0), Vec3::new(-60.0, 0.0, 0.0)];
    // The rings are opened along y.
    let ringed = Options { slices: Slices::Rings, count: 8, stretch: 1.0, front: Vec3::y(), path, ..options() };
    let made = gores(&mesh, &ringed, &Monitor::silent()).unwrap();
    assert_eq!((made.lines.len(), pieces(&made).len()), (7, 8));
    assert!(pieces(&made).iter().all(|it| it.1 == 1 && it.2 == 1));
    // Where the seams meet the back.
    let mut back: Vec<Vec3> = made
        .seams
        .iter()
        .filter_map(|&e| {
            let [a, b] = made.mesh.edge_vertices(e).map(|v| made.mesh.position(v));
            let share = a.y / (a.y - b.y);
            ((0.0..1.0).contains(&share) && a.z.min(b.z) > 0.0).then(|| a + share * (b - a))
        })
        .collect();
    back.sort_by(|a, b| a.x.total_cmp(&b.x));
    back.dedup_by(|a, b| (*a - *b).norm() < 1.0);
    assert_eq!(back.len(), 7, "{back:?}");
    let steps: Vec<f64> = back.windows(2).map(|it| (it[1] - it[0]).norm()).collect();
    let (least, most) = steps.iter().fold((f64::INFINITY, 0.0_f64), |(a, b), &it| (a.min(it), b.max(it)));
    assert!(most < 1.12 * least, "chords of equal arcs: {steps:?}");
    // Gores between the same two poles.
    let ends = Options { path: vec![Vec3::new(100.0, 0.0, 0.0), Vec3::new(-60.0, 0.0, 0.0)], ..options() };
    let made = gores(&mesh, &ends, &Monitor::silent()).unwrap();
    let top = made.points.iter().position(|p| p.z == 1.0).unwrap();
    assert!((made.mesh.positions().as_slice()[top].x - 100.0).abs() < 1e-9);
}

#[test]
fn a_path_that_turns_back_is_refused_with_where() {
    let globe = shapes::icosphere(50.0, 3);
    let place = |latitude: f64| Vec3::new(50.0 * latitude.cos(), 0.0, 50.0 * latitude.sin());
    let path = vec![place(1.57), place(-1.2), place(1.2), place(-1.57)];
    let back = Options { slices: Slices::Rings, count: 9, path, ..options() };
    let said = gores(&globe, &back, &Monitor::silent()).unwrap_err().to_string();
    assert!(said.contains("turns back") && said.contains("leave out"), "{said}");
    let one = Options { path: vec![place(0.0), place(0.001)], ..back };
    let said = gores(&globe, &one, &Monitor::silent()).unwrap_err().to_string();
    assert!(said.contains("nearest to one vertex"), "{said}");
}

#[test]
fn lines_are_drawn_on_the_surface() {
    let globe = shapes::icosphere(100.0, 3);
    let texture = vec![vec![Vec2::new(-0.5, 0.2), Vec2::new(0.5, 0.2), Vec2::new(0.5, -0.2)]];
    let drawn = Options { count: 4, most: 4, graticule: 30.0_f64.to_radians(), texture, ..options() };
    let made = gores(&globe, &drawn, &Monitor::silent()).unwrap();
    // Parallels at 0, ±30, ±60, of twelve meridians those that are no seams, one line of the texture.
    assert_eq!(made.drawn.lines.len(), 5 + 8 + 1);
    for line in &made.drawn.lines {
        for pair in line.pieces.windows(2) {
            let place = |(face, ends): (FaceId, [[f64; 3]; 2]), end: usize| {
                SurfacePoint { face, barycentric: ends[end] }.position(&made.mesh)
            };
            assert!((place(pair[0], 1) - place(pair[1], 0)).norm() < 1e-6, "lines do not break");
        }
        assert!(line.points.iter().all(|p| (97.0..100.1).contains(&p.norm())));
    }
    let equator: f64 = made.drawn.lines[2].length();
    assert!((equator / (200.0 * std::f64::consts::PI) - 1.0).abs() < 0.02, "{equator}");
    let texture = made.drawn.lines[13].length();
    assert!((texture / (100.0 * (0.2_f64.cos() + 0.4)) - 1.0).abs() < 0.03, "{texture}");
}

#[test]
fn seams_are_whole_paths_on_a_shape_with_limbs() {
    let ball = shapes::icosphere(50.0, 4);
    let stretch = |p: &Vec3| if p.x > 20.0 { Vec3::new(20.0 + 3.0 * (p.x - 20.0), p.y, p.z) } else { *p };
    let positions = ball.positions().iter().map(stretch).collect();
    let mesh = TriMesh::new(positions, &ball.face_indices()).unwrap();
    let made = gores(&mesh, &Options { count: 7, caps: [0.0, 0.25], ..options() }, &Monitor::silent()).unwrap();
    let found = pieces(&made);
    assert_eq!(found.len(), 8);
    assert!(found.iter().all(|it| it.1 == 1 && it.2 == 1), "{found:?}");
    let inner = |h: HalfedgeId| made.mesh.twin(h).is_some();
    assert!(made.mesh.halfedges().all(inner));
}

#[test]
fn seams_beside_slivers_keep_their_length() {
    let made = gores(&shapes::icosphere(100.0, 4), &options(), &Monitor::silent()).unwrap();
    let (mesh, seams) = (&made.mesh, &made.seams);
    let on_seam = |v| seams.iter().any(|&e| mesh.edge_vertices(e).contains(&v));
    let apex = |e: EdgeId| {
        let ends = mesh.edge_vertices(e);
        mesh.face_vertices(mesh.face(mesh.halfedge(e))).into_iter().find(|v| !ends.contains(v)).unwrap()
    };
    let k = (0..seams.len()).find(|&k| made.scales[k] > 1.01 && !on_seam(apex(seams[k]))).unwrap();
    // The face beside it becomes flat: its apex comes down to a tenth of its height.
    let ends = mesh.edge_vertices(seams[k]).map(|v| mesh.position(v));
    let foot = (ends[0] + ends[1]) / 2.0;
    let mut positions = mesh.positions().clone();
    positions[apex(seams[k])] = foot + 0.1 * (mesh.position(apex(seams[k])) - foot);
    let dented = mesh.with_positions(positions);
    let scales = share(&dented, seams, options().stretch).unwrap();
    assert_eq!(scales[k], 1.0);
    // It alone: the piece as a whole still shares.
    assert!(scales.iter().filter(|it| **it > 1.01).count() * 2 > made.scales.iter().filter(|it| **it > 1.01).count());
}
