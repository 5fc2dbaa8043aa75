//! Laws of cutting and flattening, over shapes by property: developable or not, closed or not, with handles or without.
#[path = "../../benches/cutting/mod.rs"]
mod cutting;

use cutting::{developable, options};
use fabricate::{
    geom::{Vec2, Vec3, outline::check_outline, polygon::least_excess, signed_area},
    mesh::{Bvh, EdgeId, FaceId, Field, HalfedgeId, TriMesh, VertexId, shapes},
    model::{CutMesh, DevelopableMesh, Flattening},
    numeric::Monitor,
    stages::{
        cut::{self, Region, cut, left_uncut, painted, trace},
        flatten::{self, Outline, flatten, quality, seam_lengths},
        unfold::hulls,
    },
};

/// A mesh as it is, cut for a stretch, and laid flat.
pub(crate) fn run(mesh: TriMesh, stretch: f64) -> (DevelopableMesh, CutMesh, Flattening) {
    let input = developable(mesh);
    let cut = cut(&input, &options(stretch), &Monitor::silent()).unwrap();
    let flat = flatten(&cut, &cutting::flat(), &Monitor::silent()).unwrap();
    (input, cut, flat)
}

/// A closed genus-0 body with bumps and dents.
fn potato(level: usize) -> TriMesh {
    let ball = shapes::icosphere(60.0, level);
    let bumpy = |p: &Vec3| {
        let d = p / 60.0;
        p * (1.0 + 0.25 * (3.0 * d.x + 1.0).sin() * (2.5 * d.y).cos() + 0.15 * (4.0 * d.z).sin())
    };
    ball.with_positions(Field::from_vec(ball.positions().iter().map(bumpy).collect()))
}

/// A closed cylinder with flat lids.
fn capped_cylinder() -> TriMesh {
    let profile = [[0., 0.], [15., 0.], [30., 0.], [30., 40.], [30., 80.], [15., 80.], [0., 80.]];
    shapes::revolve(&profile.map(|[r, z]| Vec2::new(r, z)), 24)
}

/// What two cylinders of equal radius share whose axes cross at right angles: four lenses, each of a cylinder ruled by
/// horizontal lines, between two poles; `rows` strips with `columns` quads in every lens. A horizontal section is a square.
fn bicylinder(radius: f64, rows: usize, columns: usize) -> TriMesh {
    let around = 4 * columns;
    let mut points = vec![Vec3::new(0.0, 0.0, -radius)];
    for row in 1..rows {
        let (sin, cos) = (std::f64::consts::PI * (row as f64 / rows as f64 - 0.5)).sin_cos();
        for k in 0..around {
            let t = 2.0 * (k % columns) as f64 / columns as f64 - 1.0;
            let [x, y] = [[1.0, t], [-t, 1.0], [-1.0, -t], [t, -1.0]][k / columns];
            points.push(radius * Vec3::new(cos * x, cos * y, sin));
        }
    }
    points.push(Vec3::new(0.0, 0.0, radius));
    let top = points.len() as u32 - 1;
    let at = |row: usize, k: usize| match row {
        0 => 0,
        row if row == rows => top,
        row => (1 + (row - 1) * around + k % around) as u32,
    };
    let mut faces = Vec::new();
    for row in 0..rows {
        for k in 0..around {
            let [a, b, c, d] = [at(row, k), at(row, k + 1), at(row + 1, k + 1), at(row + 1, k)];
            faces.extend([[a, b, c], [a, c, d]].into_iter().filter(|it| it[0] != it[1] && it[1] != it[2]));
        }
    }
    TriMesh::new(points, &faces).unwrap()
}

fn exactly_developable() -> Vec<(&'static str, TriMesh)> {
    vec![
        ("rectangle", shapes::grid(9, 7, 10.0)),
        ("open cylinder", shapes::cylinder(30.0, 180.0, 24, 12)),
        ("frustum", shapes::cone_frustum(60.0, 20.0, 90.0, 30, 8)),
        ("capped cylinder", capped_cylinder()),
        ("bicylinder", bicylinder(30.0, 12, 4)),
        ("annulus", shapes::annulus(20.0, 70.0, 32, 6)),
        ("tangent developable", shapes::tangent_developable(30.0, 40.0, 0.8, [10.0, 60.0], 40, 5)),
        ("cube", shapes::cuboid(Vec3::new(60.0, 60.0, 60.0), 4)),
        ("box", shapes::cuboid(Vec3::new(90.0, 60.0, 30.0), 3)),
    ]
}

fn curved() -> Vec<(&'static str, TriMesh)> {
    vec![
        ("sphere", shapes::icosphere(50.0, 2)),
        ("potato", potato(2)),
        ("torus", shapes::torus(50.0, 20.0, 20, 10)),
        ("plate with three holes", shapes::perforated_plate(3, 20.0, 3)),
        ("rounded box", shapes::rounded_cuboid(Vec3::new(90.0, 60.0, 40.0), 12.0, 2, 2)),
    ]
}

/// What every cut mesh and flattening must keep, whatever the input.
fn check_laws(name: &str, input: &DevelopableMesh, cut: &CutMesh, flat: &Flattening) {
    let mesh = &cut.mesh;
    assert_eq!(mesh.face_count(), input.mesh.face_count(), "{name}");
    for h in mesh.halfedges() {
        assert_eq!(cut.origin[mesh.tail(h)], input.mesh.tail(h), "{name}: faces keep their ids");
        assert_eq!(mesh.position(mesh.tail(h)), input.mesh.position(input.mesh.tail(h)), "{name}");
    }
    // Pieces are the components, largest first, each a planar domain.
    let (component, count) = mesh.components();
    assert_eq!(count, cut.pieces.len(), "{name}");
    assert_eq!(mesh.genus(), 0, "{name}");
    assert!(mesh.boundary_loops().len() >= count, "{name}: every piece has a boundary");
    let mut areas = vec![0.0; count];
    let mut component_of = vec![u32::MAX; count];
    for f in mesh.faces() {
        let piece = cut.piece_of[f].0 as usize;
        areas[piece] += mesh.area(f);
        assert!([u32::MAX, component[f]].contains(&component_of[piece]), "{name}");
        component_of[piece] = component[f];
    }
    assert!(areas.windows(2).all(|w| w[0] >= w[1]), "{name}: largest first");
    check_seams(name, input, cut);

    let quality = quality(cut, flat);
    assert!(quality.flipped.is_empty(), "{name}: {:?}", quality.flipped);
    assert!(flat.overlaps.is_empty(), "{name}: {:?}", flat.overlaps);
    assert!(quality.share_over_limit <= 0.001, "{name}: {}", quality.share_over_limit);
    let mut contours = vec![Vec::new(); count];
    for boundary in mesh.boundary_loops() {
        let contour: Vec<Vec2> = boundary.iter().map(|&h| flat.uv[mesh.tail(h)]).collect();
        contours[cut.piece_of[mesh.face(boundary[0])].0 as usize].push(contour);
    }
    for mut contours in contours {
        contours.sort_by(|a, b| signed_area(b).total_cmp(&signed_area(a)));
        assert_eq!(check_outline(&contours), Ok(()), "{name}");
    }
    for seam in seam_lengths(cut, flat) {
        assert!(seam.mismatch() <= 0.05_f64.max(0.002 * seam.sides[0]), "{name}: {seam:?}");
    }
}

/// Every inner edge that was opened is in exactly one seam, its two halves k-th beside k-th, the first side in the order
/// of travel and the second against it.
fn check_seams(name: &str, input: &DevelopableMesh, cut: &CutMesh) {
    let mesh = &cut.mesh;
    let mut seen = Field::<HalfedgeId, bool>::filled(mesh.halfedge_count(), false);
    for (k, seam) in cut.seams.iter().enumerate() {
        assert_eq!(seam.label as usize, k + 1, "{name}");
        let [left, right] = &seam.sides;
        assert_eq!(left.len(), right.len(), "{name}");
        for (&a, &b) in left.iter().zip(right) {
            assert_eq!(input.mesh.twin(a), Some(b), "{name}");
            for h in [a, b] {
                assert!(mesh.twin(h).is_none() && !std::mem::replace(&mut seen[h], true), "{name}");
            }
        }
        let pieces = |side: &[HalfedgeId]| {
            side.iter().map(|&h| cut.piece_of[mesh.face(h)]).collect::<std::collections::BTreeSet<_>>()
        };
        assert!(pieces(left).len() == 1 && pieces(right).len() == 1, "{name}");
        assert!(left.windows(2).all(|w| mesh.head(w[0]) == mesh.tail(w[1])), "{name}: along the left side");
        assert!(right.windows(2).all(|w| mesh.tail(w[0]) == mesh.head(w[1])), "{name}: against the right side");
    }
    for h in mesh.halfedges() {
        let opened = mesh.twin(h).is_none() && input.mesh.twin(h).is_some();
        assert_eq!(seen[h], opened, "{name}");
    }
}

#[test]
fn exact_developables_lie_flat_without_stretch() {
    for (name, mesh) in exactly_developable() {
        let (input, cut, flat) = run(mesh, 0.002);
        check_laws(name, &input, &cut, &flat);
        let quality = quality(&cut, &flat);
        assert!(quality.max_log_scale.0 <= 1e-6, "{name}: {:?}", quality.max_log_scale);
        assert!(quality.max_principal_stretch.0 <= 1e-6, "{name}: {:?}", quality.max_principal_stretch);
        assert_eq!(cut.pieces.len(), 1, "{name} lies flat in one piece");
        if name == "annulus" {
            assert!(cut.seams.is_empty(), "a flat ring is not cut");
        }
    }
}

#[test]
fn curved_surfaces_keep_the_limit() {
    for (name, mesh) in curved() {
        for stretch in [0.005, 0.05] {
            let (input, cut, flat) = run(mesh.clone(), stretch);
            check_laws(&format!("{name} at {stretch}"), &input, &cut, &flat);
        }
    }
}

#[test]
fn more_stretch_needs_no_longer_seams() {
    let length = |cut: &CutMesh| -> f64 {
        cut.seams.iter().flat_map(|it| &it.sides[0]).map(|&h| cut.mesh.vector(h).norm()).sum()
    };
    let [tight, loose] = [0.002, 0.05].map(|stretch| length(&run(potato(2), stretch).1));
    assert!(loose < 0.8 * tight, "{loose} against {tight}");
}

#[test]
fn a_rectangle_is_not_cut_and_a_cylinder_once() {
    assert!(run(shapes::grid(9, 7, 10.0), 0.005).1.seams.is_empty());
    let (_, cut, _) = run(shapes::cylinder(30.0, 180.0, 24, 12), 0.005);
    let length: f64 = cut.seams.iter().flat_map(|it| &it.sides[0]).map(|&h| cut.mesh.vector(h).norm()).sum();
    assert_eq!(cut.seams.len(), 1);
    assert!((length - 180.0).abs() < 1e-9, "{length}");
}

#[test]
fn terminals_by_energy_lie_on_seams() {
    let mut input = developable(shapes::grid(20, 20, 5.0));
    let chosen: Vec<VertexId> = [150, 230, 310].map(VertexId).to_vec();
    for &v in &chosen {
        input.energy[v] = 0.1;
    }
    let asked = cut::Options { tolerance: Some(0.01), ..options(0.005) };
    let cut = cut(&input, &asked, &Monitor::silent()).unwrap();
    assert_eq!(cut.seam_vertices, 3);
    assert_eq!(cut.tolerance, 0.01);
}

#[test]
fn several_components_and_tiny_ones() {
    // A sphere, a tetrahedron and a single triangle.
    let ball = shapes::icosphere(20.0, 2);
    let mut points = ball.positions().as_slice().to_vec();
    let mut faces = ball.face_indices();
    let mut add = |more: &[[f64; 3]], triangles: &[[u32; 3]]| {
        let base = points.len() as u32;
        points.extend(more.iter().map(|&[x, y, z]| Vec3::new(x, y, z)));
        faces.extend(triangles.iter().map(|it| it.map(|i| base + i)));
    };
    let tetrahedron = [[90., 0., 0.], [100., 0., 0.], [95., 9., 0.], [95., 3., 8.]];
    add(&tetrahedron, &[[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]);
    add(&[[60., 0., 0.], [70., 0., 0.], [60., 10., 0.]], &[[0, 1, 2]]);
    let (input, cut, flat) = run(TriMesh::new(points, &faces).unwrap(), 0.01);
    check_laws("components", &input, &cut, &flat);
    assert!(cut.pieces.len() >= 3);
}

#[test]
fn the_same_on_any_number_of_threads() {
    let result = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| run(potato(2), 0.01))
    };
    let (one, four) = (result(1), result(4));
    assert!(one.1 == four.1 && one.2 == four.2);
}

#[test]
fn interruption_is_passed_on() {
    let stop = Monitor::new(&|| true, &|_, _| (), &|| 0.0);
    let input = developable(potato(2));
    assert!(matches!(cut(&input, &options(0.01), &stop), Err(cut::CutError::Cancelled(_))));
}

#[test]
fn flips_are_found() {
    // A strip of squares laid back over itself, and one face turned over.
    let mesh = shapes::grid(4, 1, 10.0);
    let (input, cut, mut flat) = run(mesh, 0.01);
    assert!(flat.overlaps.is_empty());
    let fold = |p: Vec2| if p.x > 20.0 { Vec2::new(40.0 - p.x, p.y) } else { p };
    let folded = |v: VertexId| fold(input.mesh.position(cut.origin[v]).xy());
    flat.uv = Field::from_fn(cut.mesh.vertex_count(), folded);
    let quality = quality(&cut, &flat);
    assert_eq!(quality.flipped, [4, 5, 6, 7].map(FaceId));
    assert!(quality.max_log_scale.0 < 1e-15);
}

#[test]
fn pieces_under_the_useful_size_grow() {
    let input = developable(potato(2));
    let small = |min_area: f64| {
        let asked = cut::Options { min_area, ..options(0.008) };
        let cut = cut(&input, &asked, &Monitor::silent()).unwrap();
        let flat = flatten(&cut, &cutting::flat(), &Monitor::silent()).unwrap();
        check_laws(&format!("{min_area} mm²"), &input, &cut, &flat);
        cut.small_pieces(900.0).len()
    };
    let [without, with] = [0.0, 900.0].map(small);
    assert!(with < without, "{with} of {without} are left");
}

/// Squares of 2 mm: two plates of 20 by 20 mm and between them a bridge of 10 by 2 mm.
fn dumbbell() -> TriMesh {
    let square = |x: u32, y: u32| !(10..15).contains(&x) || y == 4;
    let at = |x: u32, y: u32| x * 11 + y;
    let squares = (0..25).flat_map(|x| (0..10).map(move |y| (x, y))).filter(|&(x, y)| square(x, y));
    let corners = squares.flat_map(|(x, y)| {
        let [a, b, c, d] = [at(x, y), at(x + 1, y), at(x + 1, y + 1), at(x, y + 1)];
        [[a, b, c], [a, c, d]]
    });
    let corners: Vec<[u32; 3]> = corners.collect();
    let mut used: Vec<u32> = corners.iter().flatten().copied().collect();
    used.sort_unstable();
    used.dedup();
    let place = |v: &u32| Vec3::new(f64::from(v / 11), f64::from(v % 11), 0.0) * 2.0;
    let faces: Vec<[u32; 3]> = corners.iter().map(|it| it.map(|v| used.binary_search(&v).unwrap() as u32)).collect();
    TriMesh::new(used.iter().map(place).collect(), &faces).unwrap()
}

#[test]
fn pieces_are_divided_at_necks() {
    let input = developable(dumbbell());
    for (min_neck, pieces) in [(0.0, 1), (1.9, 1), (4.0, 2)] {
        let asked = cut::Options { min_neck, ..options(0.005) };
        let cut = cut(&input, &asked, &Monitor::silent()).unwrap();
        let flat = flatten(&cut, &cutting::flat(), &Monitor::silent()).unwrap();
        check_laws(&format!("{min_neck} mm"), &input, &cut, &flat);
        assert_eq!(cut.pieces.len(), pieces, "{min_neck} mm");
        let (necks, strips) = cut::narrow(&cut, 4.0, 0.002);
        assert!(strips.is_empty());
        if pieces == 2 {
            assert!(necks.is_empty(), "{necks:?}");
            let seam = &cut.seams[0].sides[0];
            assert!(seam.iter().map(|&h| cut.mesh.vector(h).norm()).sum::<f64>() < 3.0);
        } else {
            let [neck] = necks[..] else { panic!("{necks:?}") };
            assert!((neck.width - 2.0).abs() < 1e-9 && (20.0..=30.0).contains(&neck.place.x), "{neck:?}");
            assert!((400.0..=420.0).contains(&neck.hanging), "{neck:?}");
        }
    }
}

#[test]
fn where_pieces_are_dear_they_hang_together_by_hinges() {
    let input = developable(potato(2));
    let pieces = |asked: cut::Options| {
        let cut = cut(&input, &asked, &Monitor::silent()).unwrap();
        let flat = flatten(&cut, &cutting::flat(), &Monitor::silent()).unwrap();
        check_laws(&format!("{} for a piece", asked.new_piece), &input, &cut, &flat);
        cut.pieces.len()
    };
    let few = pieces(options(0.008));
    let hinged = pieces(cut::Options { new_piece: 0.5, neck: 0.02, halvings: 6, ..options(0.008) });
    assert!(hinged < few, "{hinged} and {few} pieces");
}

#[test]
fn every_vertex_a_terminal_or_none() {
    for energy in [1.0, 0.0] {
        let mut input = developable(shapes::icosphere(50.0, 2));
        input.energy = Field::filled(input.mesh.vertex_count(), energy);
        let asked = cut::Options { tolerance: Some(0.5), ..options(0.02) };
        let cut = cut(&input, &asked, &Monitor::silent()).unwrap();
        let flat = flatten(&cut, &cutting::flat(), &Monitor::silent()).unwrap();
        check_laws(&format!("energy {energy}"), &input, &cut, &flat);
        assert_eq!(cut.seam_vertices == input.mesh.vertex_count(), energy > 0.5);
    }
}

#[test]
fn a_sliver_is_cut_or_refused_with_the_reason() {
    // The corner of one triangle of a grid drawn onto its opposite edge: an angle of 1e-6 degrees.
    let mut mesh = shapes::grid(8, 8, 10.0);
    let [a, b, c] = mesh.face_vertices(FaceId(40));
    let [p, q] = [b, c].map(|v| mesh.position(v));
    let normal = Vec3::new(0.0, 0.0, 1.0).cross(&(q - p)).normalize();
    let height = 0.5 * (q - p).norm() * 1e-6_f64.to_radians();
    mesh.positions_mut()[a] = 0.5 * (p + q) + normal * height;
    let input = developable(mesh);
    match cut(&input, &options(0.005), &Monitor::silent()) {
        Ok(cut) => {
            let flat = flatten(&cut, &cutting::flat(), &Monitor::silent()).unwrap();
            assert!(flat.uv.as_slice().iter().all(|p| p.x.is_finite() && p.y.is_finite()));
            assert!(quality(&cut, &flat).share_over_limit <= 0.001);
        }
        Err(error) => assert!(error.to_string().contains("face"), "{error}"),
    }
}

#[test]
fn a_hundred_thousand_components() {
    let triangle = |k: u32| {
        let at = Vec3::new(f64::from(k % 400), f64::from(k / 400), 0.0);
        [at, at + Vec3::new(0.5, 0.0, 0.1), at + Vec3::new(0.0, 0.5, 0.2)]
    };
    let points = (0..100_000).flat_map(triangle).collect();
    let faces: Vec<[u32; 3]> = (0..100_000).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
    let (_, cut, flat) = run(TriMesh::new(points, &faces).unwrap(), 0.005);
    assert_eq!(cut.pieces.len(), 100_000);
    assert!(cut.seams.is_empty());
    assert!(quality(&cut, &flat).max_principal_stretch.0 < 1e-9);
}

#[test]
fn seams_keep_to_a_preferred_side_and_off_an_avoided_one() {
    // A cylinder may be cut along any ruling.
    let input = developable(shapes::cylinder(30.0, 180.0, 24, 12));
    let side = |x: f64, share: f64| vec![Region::Side(cut::Side { towards: Vec3::new(x, 0.0, 0.0), share })];
    let seam = |asked: cut::Options| -> [f64; 2] {
        let cut = cut(&input, &asked, &Monitor::silent()).unwrap();
        let along = cut.seams.iter().flat_map(|it| &it.sides[0]).map(|&h| cut.mesh.position(cut.mesh.tail(h)).x);
        along.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)])
    };
    for x in [-2.0, 2.0] {
        let preferred = seam(cut::Options { prefer: side(x, 0.1), ..options(0.005) });
        assert!(preferred.iter().all(|it| it * x.signum() >= 24.0), "{x}: {preferred:?}");
        let avoided = seam(cut::Options { avoid: side(x, 0.9), ..options(0.005) });
        assert!(avoided.iter().all(|it| it * x.signum() <= -24.0), "{x}: {avoided:?}");
    }
}

#[test]
fn the_obstacle_to_fewer_pieces_is_named() {
    let (input, cut, _) = run(potato(2), 0.002);
    assert!(cut.pieces.len() > 1);
    let it = cut::obstacle(&input.mesh, &cut).unwrap().expect("the smallest piece has a neighbour");
    assert_eq!(it.piece.0 as usize, cut.pieces.len() - 1);
    let seam = &cut.seams[it.seam as usize - 1];
    let mut sides = seam.sides.each_ref().map(|side| cut.piece_of[cut.mesh.face(side[0])]);
    sides.sort_unstable();
    assert_eq!(sides, [it.neighbour, it.piece]);
    assert!(it.stretch.is_finite() && it.stretch > 0.0);
    // One piece in which nothing is to be glued has none.
    let (input, cut, _) = run(shapes::grid(3, 3, 10.0), 0.01);
    assert_eq!(cut::obstacle(&input.mesh, &cut), Ok(None));
}

#[test]
fn what_is_larger_than_the_sheet_is_cut_once_more_and_sewn() {
    // Unrolls to 377 by 200 mm.
    let input = developable(shapes::cylinder(60.0, 200.0, 48, 12));
    let room = [150.0, 210.0];
    let pieces = |sheet: Option<[f64; 2]>| {
        let cut = cut(&input, &cut::Options { sheet, ..options(1e-3) }, &Monitor::silent()).unwrap();
        let flat = flatten(&cut, &cutting::flat(), &Monitor::silent()).unwrap();
        (cut, flat)
    };
    assert_eq!(pieces(None).0.pieces.len(), 1);
    let (cut, flat) = pieces(Some(room));
    assert!((3..=5).contains(&cut.pieces.len()), "{}", cut.pieces.len());
    assert!(hulls(&cut, &flat).iter().all(|it| least_excess(it, room).0 <= 1.0));
    // A seam between each piece and the next around the cylinder, straight and as long as it is high.
    assert_eq!(cut.seams.len(), cut.pieces.len());
    for it in seam_lengths(&cut, &flat) {
        assert!(it.sides.iter().all(|side| (side - 200.0).abs() < 0.5), "{it:?}");
    }
}

/// Edges of a cut mesh that lie on seams, as edges of the mesh that was cut.
fn seam_edges(input: &DevelopableMesh, cut: &CutMesh) -> Vec<EdgeId> {
    let mut out: Vec<EdgeId> = cut.seams.iter().flat_map(|it| &it.sides[0]).map(|&h| input.mesh.edge(h)).collect();
    out.sort_unstable();
    out
}

#[test]
fn drawn_seams_are_followed_and_completed() {
    // A ring once around the tube of a torus leaves its handle closed.
    let input = developable(shapes::torus(50.0, 20.0, 20, 10));
    let tube = |k: i32| {
        let t = std::f64::consts::TAU * f64::from(k) / 40.0;
        Vec3::new(50.0 + 20.4 * t.cos(), 0.0, 20.4 * t.sin())
    };
    let ring: Vec<Vec3> = (0..=40).map(tube).collect();
    let traced = trace(&input.mesh, &[ring]);
    assert!(traced.farthest.1 > 0.3 && traced.farthest.1 < 2.0 && traced.broken == 0, "{traced:?}");
    assert!(traced.offset < 5.0, "{}", traced.offset);
    assert_eq!(traced.edges.len(), 10, "the tube has ten sides");
    assert_eq!(left_uncut(&input.mesh, &traced.edges), (0, 0), "a tube is no closed surface, and no handle");
    assert_eq!(left_uncut(&input.mesh, &[]), (1, 1));
    assert_eq!(left_uncut(&input.mesh, &traced.edges[..4]), (1, 0), "a slit leaves the handle");
    // All of the ring, or a part of it, which leaves the handle uncut: the seam is there, and the rest is completed.
    for edges in [traced.edges.clone(), traced.edges[..4].to_vec()] {
        let asked = cut::Options { seams: edges.clone(), ..options(0.02) };
        let cut = cut(&input, &asked, &Monitor::silent()).unwrap();
        let flat = flatten(&cut, &cutting::flat(), &Monitor::silent()).unwrap();
        check_laws("torus with a drawn ring", &input, &cut, &flat);
        let seams = seam_edges(&input, &cut);
        assert!(edges.iter().all(|e| seams.binary_search(e).is_ok()), "{edges:?} in {seams:?}");
    }
}

#[test]
fn a_drawn_seam_where_nothing_needs_one_is_kept() {
    // Across a flat sheet, and ending inside it, where both sides would coincide.
    let input = developable(shapes::grid(12, 12, 5.0));
    for end in [60.0, 30.0] {
        let traced = trace(&input.mesh, &[vec![Vec3::new(0.0, 30.0, 0.0), Vec3::new(end, 30.0, 0.0)]]);
        assert!(traced.farthest.1 < 1e-9 && traced.offset < 1e-9);
        let asked = cut::Options { seams: traced.edges.clone(), ..options(0.005) };
        let cut = cut(&input, &asked, &Monitor::silent()).unwrap();
        let flat = flatten(&cut, &cutting::flat(), &Monitor::silent()).unwrap();
        check_laws(&format!("seam to {end}"), &input, &cut, &flat);
        let seams = seam_edges(&input, &cut);
        assert!(traced.edges.iter().all(|e| seams.binary_search(e).is_ok()));
        assert_eq!(cut.pieces.len(), 2);
    }
}

#[test]
fn painted_faces_lead_seams() {
    // The surface is coarser than the one that was painted; a cylinder may be cut along any ruling.
    let fine = shapes::cylinder(30.0, 180.0, 48, 30);
    let input = developable(shapes::cylinder(30.0, 180.0, 24, 12));
    let source = Bvh::new(&fine);
    for towards in [Vec3::new(1.0, 0.0, 0.0), Vec3::new(0.0, -1.0, 0.0)] {
        let at = |f: FaceId| fine.face_positions(f).iter().sum::<Vec3>().dot(&towards) / 3.0;
        let patch: Vec<[Vec3; 3]> = fine.faces().filter(|&f| at(f) > 25.0).map(|f| fine.face_positions(f)).collect();
        let faces = painted(&input.mesh, &source, &patch);
        assert!(!faces.is_empty() && faces.len() < input.mesh.face_count() / 3);
        let asked = cut::Options { prefer: vec![Region::Faces(faces)], ..options(0.005) };
        let cut = cut(&input, &asked, &Monitor::silent()).unwrap();
        let along = cut.seams.iter().flat_map(|it| &it.sides[0]).map(|&h| cut.mesh.position(cut.mesh.tail(h)));
        assert!(along.map(|p| p.dot(&towards)).all(|x| x > 20.0));
    }
    // About a middle plane.
    let middle = cut::Side { towards: Vec3::new(0.0, 1.0, 0.0), share: 0.1 };
    let asked = cut::Options { prefer: vec![Region::Middle(middle)], ..options(0.005) };
    let cut = cut(&input, &asked, &Monitor::silent()).unwrap();
    let along = cut.seams.iter().flat_map(|it| &it.sides[0]).map(|&h| cut.mesh.position(cut.mesh.tail(h)).y);
    assert!(along.into_iter().all(|y| y.abs() < 3.1));
}

#[test]
fn straight_outlines_are_straight_and_their_seams_are_made_to_fit() {
    // A bumpy sheet of two pieces with four corners each.
    let flat = shapes::grid(12, 12, 5.0);
    let lifted = |p: &Vec3| Vec3::new(p.x, p.y, 5.0 * (0.11 * p.x).sin() * (0.13 * p.y + 0.4).cos());
    let input = developable(flat.with_positions(Field::from_vec(flat.positions().iter().map(lifted).collect())));
    let across: Vec<Vec3> = (0..=12).map(|k| lifted(&Vec3::new(25.0, 5.0 * f64::from(k), 0.0))).collect();
    let asked = cut::Options { seams: trace(&input.mesh, &[across]).edges, ..options(0.2) };
    let cut = cut(&input, &asked, &Monitor::silent()).unwrap();
    assert_eq!(cut.pieces.len(), 2);
    let lay = |equal_seams: bool| {
        let asked = flatten::Options { outline: Outline::Straight, equal_seams, ..cutting::flat() };
        flatten(&cut, &asked, &Monitor::silent()).unwrap()
    };
    let [conformal, sewn] = [false, true].map(lay);
    let turn = |a: Vec2, b: Vec2| f64::atan2(fabricate::geom::cross2(a, b), a.dot(&b)).abs();
    for boundary in cut.mesh.boundary_loops() {
        let n = boundary.len();
        let side = |k: usize| {
            let h = boundary[k % n];
            conformal.uv[cut.mesh.head(h)] - conformal.uv[cut.mesh.tail(h)]
        };
        assert!((0..n).map(|k| turn(side(k), side(k + 1))).all(|it| !(1e-7..=0.5).contains(&it)));
    }
    // What a conformal map does to the two sides of a seam differs; then both are as long.
    let worst = |flat: &Flattening| {
        let seams = seam_lengths(&cut, flat);
        seams.iter().map(|it| it.mismatch() / it.allowance()).fold(0.0, f64::max)
    };
    assert!(worst(&conformal) > 5.0, "{}", worst(&conformal));
    assert!(worst(&sewn) < 1e-3, "{}", worst(&sewn));
    assert!(quality(&cut, &sewn).flipped.is_empty());
}

#[test]
fn a_hem_gets_the_length_asked_for() {
    // Half a sphere, whose open edge pulls in.
    let ball = shapes::icosphere(50.0, 3);
    let upper: Vec<[u32; 3]> = ball
        .faces()
        .filter(|&f| ball.face_positions(f).iter().map(|p| p.z).sum::<f64>() > 0.0)
        .map(|f| ball.face_vertices(f).map(|v| v.0))
        .collect();
    let mut used: Vec<u32> = upper.iter().flatten().copied().collect();
    used.sort_unstable();
    used.dedup();
    let points = used.iter().map(|&v| ball.position(VertexId(v))).collect();
    let faces: Vec<[u32; 3]> = upper.iter().map(|it| it.map(|v| used.binary_search(&v).unwrap() as u32)).collect();
    let (_, cut, plain) = run(TriMesh::new(points, &faces).unwrap(), 0.05);
    let asked = flatten::Options { hem: 0.97, ..cutting::flat() };
    let pulled = flatten(&cut, &asked, &Monitor::silent()).unwrap();
    let mut sewn: Vec<HalfedgeId> = cut.seams.iter().flat_map(|it| it.sides.concat()).collect();
    sewn.sort_unstable();
    let ratio = |flat: &Flattening, wanted: bool| {
        let rim = cut.mesh.halfedges().filter(|&h| cut.mesh.twin(h).is_none());
        let rim = rim.filter(|h| sewn.binary_search(h).is_ok() == wanted);
        let [flat, space] = rim.fold([0.0, 0.0], |[flat_sum, sum], h| {
            let side = flat.uv[cut.mesh.head(h)] - flat.uv[cut.mesh.tail(h)];
            [flat_sum + side.norm(), sum + cut.mesh.vector(h).norm()]
        });
        flat / space
    };
    assert!((ratio(&plain, false) - 1.0).abs() < 1e-3);
    assert!((ratio(&pulled, false) - 0.97).abs() < 2e-3, "{}", ratio(&pulled, false));
    assert!((ratio(&pulled, true) - 1.0).abs() < 2e-3, "{}", ratio(&pulled, true));
}

#[test]
fn seams_keep_their_length_where_pieces_cannot_follow_a_factor() {
    // A triangle between seams, whose apex stands 0.01 or 30 mm over the 50 mm long one below it: with two sides of hardly more
    // than 25 mm the flat one has no room for a seam of 51 mm.
    for (apex, factor) in [(0.01, None), (30.0, Some(1.02))] {
        let points = [[0., 0.], [50., 0.], [50., 40.], [0., 40.], [0., -40.], [50., -40.], [25., apex]];
        let points = points.map(|[x, y]| Vec3::new(x, y, 0.0)).to_vec();
        let faces = [[0, 1, 6], [1, 2, 6], [2, 3, 6], [3, 0, 6], [0, 4, 5], [0, 5, 1]];
        let input = developable(TriMesh::new(points, &faces).unwrap());
        let edge = |a, b| input.mesh.edge(input.mesh.find_halfedge(VertexId(a), VertexId(b)).unwrap());
        let mut seams = vec![edge(0, 1), edge(1, 6), edge(6, 0)];
        seams.sort_unstable();
        let asked = cut::Options { seams, scales: vec![(edge(0, 1), 1.02)], ..options(0.03) };
        let cut = cut(&input, &asked, &Monitor::silent()).unwrap();
        let kept: Vec<f64> = cut.rim.iter().map(|it| it.1).filter(|it| *it != 1.0).collect();
        assert_eq!(kept, factor.map_or(vec![], |it| vec![it; 2]), "apex at {apex} mm");
        let flat = flatten(&cut, &cutting::flat(), &Monitor::silent()).unwrap();
        assert!(quality(&cut, &flat).flipped.is_empty());
    }
}
