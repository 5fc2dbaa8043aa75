//! Laws of rulings on surfaces whose rulings are known, and on pieces that have none.
use super::{
    measure::{Quality, quality},
    *,
};
use crate::{
    geom::cross2,
    mesh::{
        TriMesh,
        shapes::{
            self,
            ruled::{self, DEVELOPABLE, Developable},
        },
    },
    model::Piece,
};

/// One piece of a mesh and the places of its vertices in the plane.
pub(super) fn one_piece((mesh, uv): (TriMesh, Vec<Vec2>)) -> (CutMesh, Flattening) {
    let n = mesh.vertex_count();
    let cut = CutMesh {
        origin: Field::from_fn(n, |v: VertexId| v),
        piece_of: Field::filled(mesh.face_count(), PieceId(0)),
        pieces: Field::from_vec(vec![Piece { name: "A".into() }]),
        seams: vec![],
        tolerance: 0.0,
        seam_vertices: 0,
        stretch: 0.005,
        rim: vec![],
        undeveloped: false,
        mesh,
    };
    let log_factor = Field::filled(n, 0.0);
    (cut, Flattening { uv: Field::from_vec(uv), log_factor, overlaps: vec![], stretch_limit: 0.005 })
}

fn options(tolerance: f64) -> Options {
    Options { spacing: Spacing::Tolerance(tolerance), planarity: 0.003, fold_angle: 0.5 }
}

pub(super) fn solved(piece: (TriMesh, Vec<Vec2>), tolerance: f64) -> (Strips, Quality) {
    let (cut, flat) = one_piece(piece);
    let out = strips(&cut, &flat, &options(tolerance), &Monitor::silent()).unwrap();
    let quality = quality(&cut, &flat, &out);
    (out, quality)
}

/// Mean angle between the rulings found and the true ones at their middles, weighted by length, degrees.
fn ruling_error(surface: &Developable, strips: &Strips) -> f64 {
    let (mut sum, mut total) = (0.0, 0.0);
    for it in &strips.rulings {
        let [a, b] = it.ends.map(|c| strips.flat(c));
        let (found, truth) = (b - a, (surface.ruling)((a + b) / 2.0));
        let angle = (cross2(found, truth).abs() / (found.norm() * truth.norm())).min(1.0).asin();
        sum += angle * found.norm();
        total += found.norm();
    }
    (sum / total).to_degrees()
}

#[test]
fn rulings_of_exact_surfaces_are_found() {
    for surface in &DEVELOPABLE {
        let name = surface.name;
        // The tolerance goes with the mesh: facets themselves leave the surface by a quarter of it at each level.
        let errors = [(7, 0.3), (14, 0.08), (28, 0.02)].map(|(rings, tolerance)| {
            let (out, it) = solved(ruled::patch(surface, rings, 0.0), tolerance);
            assert!(it.planarity_max <= 0.003, "{name}: planarity {}", it.planarity_max);
            assert!((it.covered_share - 1.0).abs() < 1e-9, "{name}: {} covered", it.covered_share);
            assert_eq!((it.interleaved, it.crossings), (0, 0), "{name}");
            (ruling_error(surface, &out), it.area_shares[0])
        });
        let [coarse, medium, fine] = errors.map(|it| it.0);
        assert!(fine <= 0.5 && fine < medium && medium < coarse, "{name}: {errors:?}");
        assert!(errors[2].1 >= 0.95, "{name}: quads {errors:?}");
    }
}

#[test]
fn noise_of_a_twentieth_of_an_edge_turns_rulings_little() {
    for surface in &DEVELOPABLE {
        let (out, it) = solved(ruled::patch(surface, 28, 0.05), 0.25);
        let error = ruling_error(surface, &out);
        assert!(error <= 2.0, "{}: {error}°", surface.name);
        assert!(it.planarity_p99 <= 0.003 && it.covered_share > 0.999, "{}: {it:?}", surface.name);
    }
}

#[test]
fn radii_are_those_of_the_formula() {
    for surface in &DEVELOPABLE {
        let (out, _) = solved(ruled::patch(surface, 28, 0.0), 0.1);
        let between_quads = |it: &&Ruling| it.panels.map(|p| out.panels[p as usize].kind) == [PanelKind::Quad; 2];
        let quads: Vec<_> = out.rulings.iter().filter(between_quads).collect();
        assert!(quads.len() > 4, "{}", surface.name);
        // At the start, the middle and the end of a ruling: on the cone and the tangents the radius grows along it.
        for (k, t) in [0.0, 0.5, 1.0].into_iter().enumerate() {
            let error = |it: &&Ruling| {
                let [a, b] = it.ends.map(|c| out.flat(c));
                (it.radius[k] / (surface.radius)(a + (b - a) * t) - 1.0).abs()
            };
            let mean = quads.iter().map(error).sum::<f64>() / quads.len() as f64;
            let limit = if k == 1 { 0.05 } else { 0.1 };
            assert!(mean < limit, "{}: {mean} at {t}", surface.name);
        }
    }
}

#[test]
fn bends_are_positive_where_the_surface_is_convex() {
    for (sign, turned) in [(1.0, false), (-1.0, true)] {
        let (mesh, uv) = ruled::patch(&DEVELOPABLE[0], 10, 0.0);
        // Seen from its axis, the same cylinder is concave: mirror it, and orient it by the mirrored plane.
        let flip = |f: [u32; 3]| if turned { [f[0], f[2], f[1]] } else { f };
        let faces: Vec<[u32; 3]> = mesh.face_indices().into_iter().map(flip).collect();
        let mesh = TriMesh::new(mesh.positions().as_slice().to_vec(), &faces).unwrap();
        let uv = uv.into_iter().map(|p| if turned { Vec2::new(-p.x, p.y) } else { p }).collect();
        let (out, _) = solved((mesh, uv), 0.1);
        assert!(out.rulings.iter().all(|it| it.bend * sign > 0.0), "{turned}");
        // All in all it turns by its width over its radius, less what lies beyond the last rulings.
        let total: f64 = out.rulings.iter().map(|it| it.bend.abs()).sum();
        assert!((1.5..3.0).contains(&total), "{total}");
    }
}

#[test]
fn a_flat_piece_is_one_panel_and_a_flat_ring_has_a_bridge() {
    let grid = shapes::grid(9, 7, 10.0);
    let uv = grid.positions().iter().map(|p| p.xy()).collect();
    let (out, it) = solved((grid, uv), 0.1);
    assert_eq!((out.panels.len(), out.rulings.len(), it.flat.len()), (1, 0, 1));
    let ring = shapes::annulus(20.0, 70.0, 32, 6);
    let uv = ring.positions().iter().map(|p| p.xy()).collect();
    let (_, it) = solved((ring, uv), 0.1);
    assert!((it.covered_share - 1.0).abs() < 1e-9 && it.unsolved.is_empty(), "{it:?}");
}

#[test]
fn a_sphere_has_no_reliable_rulings() {
    let (uv, faces) = ruled::blob(14);
    let dome = uv.iter().map(|p| p.push((70.0_f64.powi(2) - p.norm_squared()).sqrt())).collect();
    let (out, it) = solved((TriMesh::new(dome, &faces).unwrap(), uv), 0.1);
    assert_eq!(it.unreliable.len(), 1, "{:?}", out.residual);
    assert!(out.panels.iter().all(|it| it.kind != PanelKind::Quad));
    assert!((it.covered_share - 1.0).abs() < 1e-9);
}

#[test]
fn a_crumpled_layout_is_refused_or_left_out_but_never_panics() {
    let (mesh, mut uv) = ruled::patch(&DEVELOPABLE[0], 6, 0.0);
    for k in 0..uv.len() {
        if k % 5 == 0 {
            uv[k] = -uv[k];
        }
    }
    let (out, it) = solved((mesh.clone(), uv.clone()), 0.1);
    assert!(it.unsolved.len() + it.unreliable.len() <= 1 && out.ruled.len() == 1);
    uv[3].x = f64::NAN;
    let (cut, flat) = one_piece((mesh.clone(), uv.clone()));
    let refused = strips(&cut, &flat, &options(0.1), &Monitor::silent());
    assert!(matches!(refused, Err(StripsError::Misfit(Misfit::NotFinite { vertex: 3, .. }))), "{refused:?}");
    uv.pop();
    let refused = strips(&cut, &one_piece((mesh, uv)).1, &options(0.1), &Monitor::silent());
    assert!(matches!(refused, Err(StripsError::Misfit(Misfit::Count { .. }))));
}

#[test]
fn as_many_rulings_as_asked_for() {
    let (cut, flat) = one_piece(ruled::patch(&DEVELOPABLE[1], 12, 0.0));
    for most in [10, 20] {
        let options = Options { spacing: Spacing::Count(most), ..options(0.0) };
        let out = strips(&cut, &flat, &options, &Monitor::silent()).unwrap();
        assert!((most / 2..=most).contains(&out.rulings.len()), "{} for {most}", out.rulings.len());
    }
}

#[test]
fn panels_are_a_disk_and_their_mesh_is_the_surface() {
    let (out, it) = solved(ruled::patch(&DEVELOPABLE[2], 10, 0.0), 0.1);
    assert_eq!(out.panels.len(), out.rulings.len() + 1);
    let (mesh, panels) = out.mesh().unwrap();
    assert_eq!(panels.len(), mesh.face_count());
    let area: f64 = mesh.faces().map(|f| mesh.area(f)).sum();
    let flat: f64 = out.panels.iter().map(|it| crate::geom::signed_area(&out.flat_outline(it))).sum();
    assert!((area / flat - 1.0).abs() < 2e-3, "{area} {flat}");
    assert!(it.distance.hausdorff < 0.5, "{:?}", it.distance);
    let strips: Vec<u32> = out.panels.iter().map(|it| it.strip).collect();
    assert!(strips.windows(2).all(|w| w[1] == w[0] || w[1] == w[0] + 1), "{strips:?}");
}

/// A cylinder reflected beyond a slanted plane: a curved crease from side to side, with rulings that end at it. The crease
/// is v = crease(u) in the plane.
fn creased(columns: usize, rows: usize) -> (TriMesh, Vec<Vec2>, impl Fn(f64) -> f64) {
    const RADIUS: f64 = 40.0;
    let normal = nalgebra::Vector3::new(0.0, 60.0_f64.to_radians().sin(), 60.0_f64.to_radians().cos());
    let crease = move |u: f64| normal.z * RADIUS * (1.0 - (u / RADIUS).cos()) / normal.y;
    let grid = shapes::grid(columns, rows, 1.0);
    let (mut uv, mut places) = (Vec::new(), Vec::new());
    for p in grid.positions().iter() {
        let (u, t) = (60.0 * (p.x / columns as f64 - 0.5), 60.0 * (p.y / rows as f64 - 0.5));
        let v = crease(u) + t;
        let place = nalgebra::Vector3::new(RADIUS * (u / RADIUS).sin(), v, RADIUS * ((u / RADIUS).cos() - 1.0));
        let beyond = normal.dot(&place).max(0.0);
        uv.push(Vec2::new(u, v));
        places.push(place - normal * (2.0 * beyond));
    }
    (TriMesh::new(places, &grid.face_indices()).unwrap(), uv, crease)
}

#[test]
fn strips_end_at_a_curved_crease() {
    let (mesh, uv, crease) = creased(24, 24);
    let (out, it) = solved((mesh, uv), 0.2);
    assert!((it.covered_share - 1.0).abs() < 1e-9 && it.planarity_max <= 0.003, "{it:?}");
    assert!(it.distance.hausdorff < 1.0, "{:?}", it.distance);
    let sides = |panel: &Panel| {
        let from = |p: &Vec2| p.y - crease(p.x);
        let outline = out.flat_outline(panel);
        let (low, high) = (outline.iter().map(from).fold(0.0, f64::min), outline.iter().map(from).fold(0.0, f64::max));
        (low.abs().min(high), crate::geom::signed_area(&outline))
    };
    // The mesh follows the crease by straight edges, which leave it by 0.02 mm.
    let across: f64 = out.panels.iter().map(sides).filter(|it| it.0 > 0.1).map(|it| it.1).sum();
    assert!(across < 0.02 * 3600.0, "{across} mm² of panels across the crease");
    assert!(it.area_shares[0] > 0.8, "{:?}", it.area_shares);
}
