//! Laws of the sphere map.
use super::*;
use crate::{
    mesh::{
        MeshError,
        distance::{SurfaceDistance, SurfacePoint},
        shapes,
    },
    numeric::random::Random,
    surface::{collapse::quality, edit::EditMesh, subdivide},
};

fn with(mesh: &TriMesh, change: impl FnMut(Vec3) -> Vec3) -> Result<TriMesh, MeshError> {
    TriMesh::new(mesh.positions().iter().copied().map(change).collect(), &mesh.face_indices())
}

/// A shape of genus 0 that is hard to map: spikes, noise, limbs, slivers, or positions drawn by chance.
fn adversary(kind: usize, seed: u64) -> TriMesh {
    let mut random = Random::new(seed);
    let mut signed = move || 2.0 * random.unit() - 1.0;
    let ball = shapes::icosphere(1.0, if seed.is_multiple_of(8) { 2 } else { 1 });
    let made = match kind {
        0 => with(&ball, |p| if signed() > 0.9 { p * (10.0 + 40.0 * signed().abs()) } else { p }),
        1 => with(&ball, |p| p * (1.0 + 0.95 * signed())),
        2 => {
            // A ball with a limb of 3 to 20 times its width.
            let length = 3.0 + 17.0 * signed().abs();
            with(&ball, |p| if p.z > 0.3 { Vec3::new(0.2 * p.x, 0.2 * p.y, length * (p.z - 0.3) + 0.3) } else { p })
        }
        3 => {
            let flat = 1e-3 + 1e-2 * signed().abs();
            with(&ball, |p| {
                Vec3::new(p.x, flat * p.y, 20.0 * p.z) + 1e-3 * flat * Vec3::new(signed(), signed(), signed())
            })
        }
        _ => with(&ball, |_| Vec3::new(signed(), signed(), signed())),
    };
    made.expect("chance does not put three corners on a line")
}

#[test]
fn two_hundred_adversaries_are_mapped_without_a_flip() {
    let mut routes = [0; 2];
    for kind in 0..5 {
        for seed in 0..41 {
            let mesh = adversary(kind, 1000 * kind as u64 + seed);
            let map = sphere_map(&mesh, Method::Auto, &Monitor::silent()).unwrap();
            routes[usize::from(map.route == Route::Hierarchical)] += 1;
            // The proof, made again from the numbers as they are written, with 17 digits.
            let read: Vec<Vec3> = map.points.iter().map(|p| p.map(|x| format!("{x:.16e}").parse().unwrap())).collect();
            let again = certify(&mesh.face_indices(), &read);
            assert!(again.holds() && again == map.certificate, "kind {kind}, seed {seed}: {again:?}");
            assert!(map.points.iter().all(|p| (p.norm() - 1.0).abs() < 1e-12));
        }
    }
    assert!(routes.iter().all(|&it| it > 0), "both ways are tried: {routes:?}");
}

#[test]
fn an_undone_collapse_leaves_no_trace() {
    let mesh = shapes::icosphere(3.0, 2);
    let mut edit = EditMesh::new(&mesh);
    let mut done = Vec::new();
    let mut random = Random::new(5);
    for _ in 0..2000 {
        let h = crate::mesh::HalfedgeId(random.below(edit.halfedge_capacity()) as u32);
        if edit.is_alive(h) && edit.can_collapse(h) {
            done.push((h, edit.tail(h)));
            edit.collapse(h, edit.position(edit.head(h)));
        }
    }
    assert!(edit.vertex_count() < 20 && done.len() > 100);
    for (h, u) in done.into_iter().rev() {
        edit.undo_collapse(h, u, mesh.position(u));
        if edit.vertex_count().is_multiple_of(16) {
            edit.validate();
        }
    }
    edit.validate();
    assert_eq!(edit.finish().unwrap(), mesh);
}

#[test]
fn a_sphere_stays_itself_and_refinement_comes_closer_to_conformal() {
    let quality = |mesh: &TriMesh, method| sphere_map(mesh, method, &Monitor::silent()).unwrap().quality;
    for method in [Method::Auto, Method::Hierarchical] {
        let coarse = quality(&shapes::icosphere(7.0, 2), method);
        // 25.1327 less what the polyhedron lacks.
        assert!(coarse.energy < 25.13274 && coarse.energy > 24.5 && coarse.dilatation_mean < 1.01, "{coarse:?}");
        assert!(coarse.centroid < 1e-6, "{coarse:?}");
    }
    let block = shapes::cuboid(Vec3::new(1.0, 2.0, 3.0), 4);
    let [coarse, fine] = [block.clone(), subdivide(&block).unwrap()].map(|it| quality(&it, Method::Auto));
    assert!(fine.dilatation_mean - 1.0 < 0.6 * (coarse.dilatation_mean - 1.0), "{coarse:?} {fine:?}");
}

#[test]
fn the_certificate_sees_one_flipped_face_and_a_second_cover() {
    let mesh = shapes::icosphere(1.0, 1);
    let mut points = mesh.positions().as_slice().to_vec();
    let faces = mesh.face_indices();
    assert_eq!(certify(&faces, &points), Certificate { flips: 0, degree: 1 });
    points[20] = -points[20];
    let bad = certify(&faces, &points);
    assert!(bad.flips > 0 && !bad.holds());
    // z ↦ z² on a sphere of longitudes covers the sphere twice and flips nothing but at the poles.
    let around = 24;
    let ring = |k: usize, z: f64| {
        let angle = 2.0 * std::f64::consts::TAU * k as f64 / around as f64;
        Vec3::new(angle.cos(), angle.sin(), z)
    };
    let mut points: Vec<Vec3> =
        (0..2 * around).map(|k| ring(k % around, if k < around { -0.5 } else { 0.5 })).collect();
    points.extend([-Vec3::z(), Vec3::z()]);
    let mut faces = Vec::new();
    for k in 0..around as u32 {
        let (n, next) = (around as u32, (k + 1) % around as u32);
        faces.extend([[k, next, n + next], [k, n + next, n + k], [2 * n, next, k], [2 * n + 1, n + k, n + next]]);
    }
    assert_eq!(certify(&faces, &points), Certificate { flips: 0, degree: 2 });
    // A reflected sphere is all flips and covers once, the other way.
    let mirrored: Vec<Vec3> = mesh.positions().iter().map(|p| Vec3::new(p.x, p.y, -p.z)).collect();
    assert_eq!(certify(&mesh.face_indices(), &mirrored), Certificate { flips: mesh.face_count(), degree: -1 });
}

#[test]
fn what_is_not_a_sphere_is_refused_with_what_to_do() {
    let refuse = |mesh: &TriMesh| sphere_map(mesh, Method::Auto, &Monitor::silent()).unwrap_err();
    assert_eq!(refuse(&shapes::torus(10.0, 4.0, 16, 8)), SphereError::Genus { genus: 1 });
    let open = refuse(&shapes::cylinder(5.0, 20.0, 12, 6));
    assert!(
        matches!(open, SphereError::Boundary { loops: 2, edges: 12, .. })
            && open.to_string().contains("close the holes")
    );
    let ball = shapes::icosphere(1.0, 1);
    let mut positions = ball.positions().as_slice().to_vec();
    positions.extend(ball.positions().iter().map(|p| p + Vec3::new(5.0, 0.0, 0.0)));
    let mut faces = ball.face_indices();
    faces.extend(ball.face_indices().iter().map(|f| f.map(|v| v + ball.vertex_count() as u32)));
    let two = refuse(&TriMesh::new(positions, &faces).unwrap());
    assert!(two == SphereError::Components { count: 2 } && two.to_string().contains("largest"));
}

#[test]
fn a_map_can_be_interrupted() {
    let monitor = Monitor::new(&|| true, &|_, _| (), &|| 0.0);
    for method in [Method::Auto, Method::Hierarchical] {
        let found = sphere_map(&shapes::icosphere(1.0, 3), method, &monitor);
        assert_eq!(found.unwrap_err(), SphereError::Cancelled(Cancelled));
    }
}

#[test]
fn tessellations_are_spheres_and_come_back_to_the_surface() {
    let patterns = [
        Pattern::Octahedron(4),
        Pattern::Icosahedron(3),
        Pattern::Cube(4),
        Pattern::LatitudeLongitude { meridians: 12, rings: 7 },
    ];
    let mesh = with(&shapes::icosphere(10.0, 3), |p| Vec3::new(p.x, p.y, 3.0 * p.z) * (1.0 + 0.03 * p.x)).unwrap();
    let map = sphere_map(&mesh, Method::Auto, &Monitor::silent()).unwrap();
    let locator = Locator::new(&mesh, map.points.as_slice());
    for pattern in patterns {
        let (points, faces) = pattern.mesh();
        assert_eq!(faces.len(), pattern.faces());
        assert!(certify(&faces, &points).holds(), "{pattern:?}");
        let spread = |compensate: bool| {
            let pulled = pull_back(&locator, pattern, compensate, &Monitor::silent()).unwrap().mesh().unwrap();
            assert_eq!((pulled.genus(), pulled.face_count(), pulled.boundary_loops().len()), (0, faces.len(), 0));
            let bvh = crate::mesh::Bvh::new(&mesh);
            assert!(pulled.positions().iter().all(|&p| bvh.closest(p).distance < 1e-9));
            let lengths: Vec<f64> = pulled.edges().map(|e| pulled.edge_length(e)).collect();
            let mean = lengths.iter().sum::<f64>() / lengths.len() as f64;
            (lengths.iter().map(|it| (it - mean).powi(2)).sum::<f64>() / lengths.len() as f64).sqrt() / mean
        };
        assert!(spread(true) < spread(false), "{pattern:?}: edges become more even");
    }
}

#[test]
fn poles_go_where_they_are_chosen_and_lines_come_back_whole() {
    let mesh = with(&shapes::icosphere(10.0, 3), |p| Vec3::new(1.5 * p.x, p.y, p.z + 0.02 * p.x * p.x)).unwrap();
    let map = sphere_map(&mesh, Method::Auto, &Monitor::silent()).unwrap();
    let poles = extremes(&mesh, Vec3::x());
    let points = with_poles(&mesh, &map.points, poles, Vec3::z());
    assert!((points[poles[0].0 as usize] - Vec3::z()).norm() < 1e-12);
    assert!((points[poles[1].0 as usize] + Vec3::z()).norm() < 1e-12);
    assert!(certify(&mesh.face_indices(), &points).holds());
    let locator = Locator::new(&mesh, &points);
    let equator: Vec<Vec3> = (0..=90)
        .map(|k| {
            let (sin, cos) = (std::f64::consts::TAU * k as f64 / 90.0).sin_cos();
            Vec3::new(cos, sin, 0.0)
        })
        .collect();
    let found = locator.trace(&equator);
    let place = |it: &Stretch, end: usize| SurfacePoint { face: it.face, barycentric: it.ends[end] }.position(&mesh);
    for pair in found.windows(2) {
        assert!((place(&pair[0], 1) - place(&pair[1], 0)).norm() < 1e-9, "the line does not break");
    }
    let length: f64 = found.iter().map(|it| (place(it, 1) - place(it, 0)).norm()).sum();
    assert!((62.0..75.0).contains(&length), "about 2 π 10: {length}");
}

#[test]
fn refined_tessellations_come_close_to_limbs() {
    // A limb that the coarse pattern passes over.
    let limb = |p: Vec3| p * (1.0 + 4.0 * (-60.0 * (p / 10.0 - Vec3::new(0.6, 0.0, 0.8)).norm_squared()).exp());
    let mesh = with(&shapes::icosphere(10.0, 5), limb).unwrap();
    let map = sphere_map(&mesh, Method::Auto, &Monitor::silent()).unwrap();
    let locator = Locator::new(&mesh, map.points.as_slice());
    let mut net = pull_back(&locator, Pattern::Icosahedron(4), false, &Monitor::silent()).unwrap();
    let far = |net: &Net| SurfaceDistance::between(&mesh, &net.mesh().unwrap()).hausdorff;
    let before = (far(&net), net.mesh().unwrap().face_count());
    assert!(before.0 > 3.0, "{before:?}");
    net.refine(0.6, &Monitor::silent()).unwrap();
    let (after, made) = (far(&net), net.mesh().unwrap());
    assert!(after < 1.2, "{before:?} {after}");
    assert_eq!((made.genus(), made.components().1), (0, 1));
    let worst = made.faces().map(|f| quality(made.face_positions(f))).fold(1.0, f64::min);
    assert!(worst > 0.35, "the worst face has the quality {worst}");
    assert!((before.1 + 1..6 * before.1).contains(&made.face_count()), "{}", made.face_count());
}
