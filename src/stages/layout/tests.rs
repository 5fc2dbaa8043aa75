//! Laws of the layout on sheets that are bent, cut and flattened by formula.
use std::collections::BTreeMap;

use super::{seams::tick_places, *};
use crate::{
    geom::{
        Box2, Vec3,
        outline::check_outline,
        polygon::{bounds_turned, contains, least_box_angle, point_segment_distance, segments_meet, turned},
        polyline_length, signed_area,
        stroke_font::letter,
    },
    mesh::{EdgeId, FaceId, Field, Id, TriMesh, VertexId},
    model::{Joints, Operation, Part, Piece, Seam},
};

const OPTIONS: Options = Options {
    label_from: 0.0,
    merge: 0.02,
    slit: 0.1,
    tool: 0.0,
    fold_angle: 0.3,
    label_height: 3.5,
    name_height: 7.0,
    least_height: 1.4,
    tick: 2.5,
    tick_spacing: 25.0,
    join: Join::Butt,
    bending: None,
    perforation: None,
};

/// A rectangle of `columns` × `rows` squares, bent by `bends` (column, radians) about lines of constant x, with its
/// isometric plane coordinates.
fn bent_sheet(columns: usize, rows: usize, spacing: f64, bends: &[(usize, f64)]) -> (TriMesh, Vec<Vec2>) {
    let mut profile = vec![Vec2::zeros()];
    let mut heading = 0.0;
    for i in 0..columns {
        heading += bends.iter().filter(|it| it.0 == i).map(|it| it.1).sum::<f64>();
        profile.push(profile[i] + turned(Vec2::new(spacing, 0.0), heading));
    }
    let (mut points, mut plane, mut faces) = (Vec::new(), Vec::new(), Vec::new());
    let id = |i: usize, j: usize| (j * (columns + 1) + i) as u32;
    for j in 0..=rows {
        for (i, p) in profile.iter().enumerate() {
            points.push(Vec3::new(p.x, j as f64 * spacing, p.y));
            plane.push(Vec2::new(i as f64, j as f64) * spacing);
            if i < columns && j < rows {
                faces.push([id(i, j), id(i + 1, j), id(i + 1, j + 1)]);
                faces.push([id(i, j), id(i + 1, j + 1), id(i, j + 1)]);
            }
        }
    }
    (TriMesh::new(points, &faces).unwrap(), plane)
}

/// Cuts a mesh between faces of different labels and along `slit` edges, and lays every piece out turned and moved.
fn cut_apart(
    mesh: &TriMesh,
    plane: &[Vec2],
    label: impl Fn(FaceId) -> u32,
    slit: impl Fn(EdgeId) -> bool,
) -> (CutMesh, Flattening) {
    let is_cut = |e: EdgeId| {
        let h = mesh.halfedge(e);
        mesh.twin(h).is_some_and(|twin| slit(e) || label(mesh.face(h)) != label(mesh.face(twin)))
    };
    // Corners that are not parted by a cut share a vertex.
    let mut corner: Vec<usize> = (0..mesh.halfedge_count()).collect();
    fn root(corner: &mut [usize], mut i: usize) -> usize {
        while corner[i] != i {
            i = corner[i];
        }
        i
    }
    for h in mesh.halfedges() {
        if let Some(twin) = mesh.twin(h).filter(|_| !is_cut(mesh.edge(h))) {
            let (a, b) = (root(&mut corner, h.index()), root(&mut corner, mesh.next(twin).index()));
            corner[a.max(b)] = a.min(b);
        }
    }
    let mut vertex: BTreeMap<usize, u32> = BTreeMap::new();
    let (mut positions, mut origin, mut uv, mut faces) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for f in mesh.faces() {
        faces.push(mesh.face_halfedges(f).map(|h| {
            let v = mesh.tail(h);
            *vertex.entry(root(&mut corner, h.index())).or_insert_with(|| {
                positions.push(mesh.position(v));
                origin.push(v);
                uv.push(
                    turned(plane[v.index()], 0.4 + f64::from(label(f))) + Vec2::new(300.0 * f64::from(label(f)), 7.0),
                );
                (positions.len() - 1) as u32
            })
        }));
    }
    let count = mesh.faces().map(&label).max().unwrap() + 1;
    let names = (0..count).map(|i| Piece { name: char::from(b'A' + i as u8).to_string() }).collect();
    let cut = CutMesh {
        mesh: TriMesh::new(positions, &faces).unwrap(),
        origin: Field::from_vec(origin),
        piece_of: Field::from_fn(mesh.face_count(), |f| PieceId(label(f))),
        pieces: Field::from_vec(names),
        seams: seams_of(mesh, &is_cut),
        tolerance: 0.0,
        seam_vertices: 0,
        stretch: 0.0,
        rim: vec![],
        undeveloped: false,
    };
    let n = cut.mesh.vertex_count();
    let flat =
        Flattening { uv: Field::from_vec(uv), log_factor: Field::filled(n, 0.0), overlaps: vec![], stretch_limit: 0.0 };
    (cut, flat)
}

/// Cut edges as chains between vertices where not exactly two of them meet, or where the boundary is.
fn seams_of(mesh: &TriMesh, is_cut: &dyn Fn(EdgeId) -> bool) -> Vec<Seam> {
    let halfedge_from = |v: VertexId| mesh.outgoing(v).filter(|&h| is_cut(mesh.edge(h))).collect::<Vec<_>>();
    let junction = |v: VertexId| {
        let n = mesh.neighbors(v).filter(|&w| {
            let h = mesh.find_halfedge(v, w).or_else(|| mesh.find_halfedge(w, v)).unwrap();
            is_cut(mesh.edge(h))
        });
        n.count() != 2 || mesh.is_boundary_vertex(v)
    };
    let mut used = vec![false; mesh.edge_count()];
    let mut seams = Vec::new();
    for start in mesh.vertices().filter(|&v| junction(v)) {
        for first in halfedge_from(start) {
            let mut side = Vec::new();
            let mut next = Some(first);
            while let Some(h) = next.filter(|&h| !used[mesh.edge(h).index()]) {
                used[mesh.edge(h).index()] = true;
                side.push(h);
                let v = mesh.head(h);
                next = if junction(v) {
                    None
                } else {
                    halfedge_from(v).into_iter().find(|&g| !used[mesh.edge(g).index()])
                };
            }
            if !side.is_empty() {
                let other = side.iter().map(|&h| mesh.twin(h).unwrap()).collect();
                seams.push(Seam { label: seams.len() as u32 + 1, sides: [side, other] });
            }
        }
    }
    seams
}

/// Three pieces with wavy seams that meet in one point, bent sharply along two lines.
fn three_pieces() -> (CutMesh, Flattening) {
    let (mesh, plane) = bent_sheet(50, 30, 4.0, &[(12, 1.0), (30, -0.8), (31, 0.1)]);
    let middle = |f: FaceId| mesh.face_vertices(f).map(|v| plane[v.index()]).iter().sum::<Vec2>() / 3.0;
    let label = |f: FaceId| {
        let c = middle(f);
        let wave = 10.0 * (c.y / 15.0).sin();
        match () {
            () if c.x < 80.0 + wave => 0,
            () if c.y < 60.0 + 0.1 * c.x => 1,
            () => 2,
        }
    };
    cut_apart(&mesh, &plane, label, |_| false)
}

/// One piece with a closed slit and a loose seam that ends inside it.
fn slit_piece() -> (CutMesh, Flattening) {
    let (mesh, plane) = bent_sheet(30, 20, 4.0, &[]);
    let on = |e: EdgeId| mesh.edge_vertices(e).map(|v| plane[v.index()]).iter().all(|p| p.x == 60.0 && p.y >= 40.0);
    cut_apart(&mesh, &plane, |_| 0, on)
}

fn made(input: &(CutMesh, Flattening)) -> Parts {
    layout(&input.0, &input.1, None, &OPTIONS, &Monitor::silent()).unwrap()
}

/// Point and normal-free place of every tick, as distance from its base on the outline to the start of a seam side.
fn tick_bases(part: &Part, side: &[Vec2]) -> Vec<f64> {
    let mut bases = Vec::new();
    for mark in part.marks.iter().filter(|it| it.operation == Operation::Registration) {
        let base = mark.points[0] - (mark.points[1] - mark.points[0]).normalize() * 0.2;
        let mut along = 0.0;
        for w in side.windows(2) {
            if point_segment_distance(base, w[0], w[1]) < 1e-6 {
                bases.push(along + (base - w[0]).norm());
                break;
            }
            along += (w[1] - w[0]).norm();
        }
    }
    bases.sort_by(f64::total_cmp);
    bases
}

fn side_points(input: &(CutMesh, Flattening), seam: &Seam, side: usize) -> Vec<Vec2> {
    let (mesh, uv) = (&input.0.mesh, &input.1.uv);
    let ends = |h: HalfedgeId| if side == 0 { [mesh.tail(h), mesh.head(h)] } else { [mesh.head(h), mesh.tail(h)] };
    let path = &seam.sides[side];
    path.iter().map(|&h| ends(h)[0]).chain(path.last().map(|&h| ends(h)[1])).map(|v| uv[v]).collect()
}

#[test]
fn outlines_are_simple_and_keep_the_flat_area() {
    for input in [three_pieces(), slit_piece()] {
        let parts = made(&input);
        assert_eq!(parts.parts.len(), input.0.pieces.len(), "{:?}", parts.refused);
        for (piece, part) in input.0.pieces.enumerate().zip(&parts.parts) {
            assert_eq!(check_outline(&part.contours), Ok(()));
            let faces = input.0.mesh.faces().filter(|&f| input.0.piece_of[f] == piece.0);
            let flat: f64 = faces.map(|f| signed_area(&input.0.mesh.face_vertices(f).map(|v| input.1.uv[v]))).sum();
            let opened: f64 = parts.openings.iter().filter(|it| it.part == part.name).map(|it| it.area).sum();
            let found = area(&part.contours);
            assert!((found + opened - flat).abs() < 1e-3 * polyline_length(&part.contours[0], true), "{found} {flat}");
        }
    }
}

#[test]
fn a_closed_slit_is_opened_and_said() {
    let parts = made(&slit_piece());
    assert_eq!(parts.openings.len(), 1);
    assert_eq!(parts.openings[0].width, 0.1);
    // 40 mm of slit, 0.1 mm wide.
    assert!((parts.openings[0].area - 4.0).abs() < 0.2, "{}", parts.openings[0].area);
}

#[test]
fn both_sides_of_a_seam_are_equal_and_their_ticks_match() {
    let input = three_pieces();
    let parts = made(&input);
    assert!(input.0.seams.len() >= 3);
    for seam in &input.0.seams {
        let sides = [0, 1].map(|side| side_points(&input, seam, side));
        let lengths = sides.each_ref().map(|it| polyline_length(it, false));
        assert!((lengths[0] - lengths[1]).abs() < 1e-9);
        let ticks = [0, 1].map(|side| {
            let piece = input.0.piece_of[input.0.mesh.face(seam.sides[side][0])];
            tick_bases(&parts.parts[piece.index()], &sides[side])
        });
        for (k, place) in tick_places(lengths[0], OPTIONS.tick_spacing).into_iter().enumerate() {
            for found in &ticks {
                assert!(found.iter().any(|it| (it - place).abs() < 1e-6), "seam {} tick {k}: {found:?}", seam.label);
            }
        }
        for found in &ticks {
            assert!(found.first().is_some_and(|it| *it < 1e-6), "no tick at the start of seam {}", seam.label);
        }
    }
}

#[test]
fn marks_stay_inside_and_lettering_crosses_nothing() {
    for input in [three_pieces(), slit_piece()] {
        for part in made(&input).parts {
            let (text, lines): (Vec<&Mark>, Vec<&Mark>) =
                part.marks.iter().partition(|it| it.operation == Operation::Text);
            for mark in &part.marks {
                assert!(mark.points.iter().all(|&p| contains(&part.contours, p)), "{mark:?}");
            }
            let segments = |points: &[Vec2], closed: bool| {
                let n = if closed { points.len() } else { points.len() - 1 };
                (0..n).map(|i| (points[i], points[(i + 1) % points.len()])).collect::<Vec<_>>()
            };
            let fixed: Vec<(Vec2, Vec2)> = part
                .contours
                .iter()
                .flat_map(|it| segments(it, true))
                .chain(lines.iter().flat_map(|it| segments(&it.points, it.closed)))
                .collect();
            for (a, b) in text.iter().flat_map(|it| segments(&it.points, it.closed)) {
                assert!(!fixed.iter().any(|&(c, d)| segments_meet(a, b, c, d)));
            }
        }
    }
}

#[test]
fn every_seam_is_numbered_on_both_sides_and_every_part_named() {
    let input = three_pieces();
    let parts = made(&input);
    assert_eq!(parts.unlabelled, Vec::<String>::new());
    for part in &parts.parts {
        let height = |mark: &Mark| mark.points.len();
        assert!(part.marks.iter().any(|it| it.operation == Operation::Text && height(it) > 1));
    }
}

#[test]
fn lettering_without_room_is_left_to_the_partner_and_said() {
    // A strip 0.8 mm wide beside a sheet: the least letters with their clearance need more, however they are turned.
    let (mesh, plane) = bent_sheet(56, 40, 0.4, &[]);
    let middle = |f: FaceId| mesh.face_vertices(f).map(|v| plane[v.index()].y).iter().sum::<f64>() / 3.0;
    let input = cut_apart(&mesh, &plane, |f| u32::from(middle(f) > 0.8), |_| false);
    let parts = made(&input);
    assert_eq!(parts.unlabelled, Vec::<String>::new());
    let said = ["seam 1 (22.4 mm) of part A: on part B", "name of part A: along seam 1 on part B"];
    assert_eq!(parts.on_partner, said);
    let letters = |part: &Part| part.marks.iter().filter(|it| it.operation == Operation::Text).count();
    assert_eq!(letters(&parts.parts[0]), 0);
    let alone = letter("B", 7.0).strokes.len() + letter("1 A", 3.5).strokes.len();
    assert_eq!(letters(&parts.parts[1]), alone, "the sheet says `1 A` along the seam, and its own name");
    // Where neither side has room there is nothing to print on.
    let (mesh, plane) = bent_sheet(140, 2, 0.4, &[]);
    let middle = |f: FaceId| mesh.face_vertices(f).map(|v| plane[v.index()].x).iter().sum::<f64>() / 3.0;
    let narrow = made(&cut_apart(&mesh, &plane, |f| u32::from(middle(f) > 25.0), |_| false));
    let said = ["seam 1 (1.5 mm) of part A", "name of part A", "seam 1 (1.5 mm) of part B", "name of part B"];
    assert_eq!((narrow.unlabelled.as_slice(), narrow.on_partner.len()), (said.map(String::from).as_slice(), 0));
}

#[test]
fn folds_run_as_long_lines_where_the_sheet_is_bent() {
    let parts = made(&three_pieces());
    let folds = |operation: Operation| -> Vec<f64> {
        let marks = parts.parts.iter().flat_map(|it| &it.marks).filter(|it| it.operation == operation);
        marks.map(|it| polyline_length(&it.points, it.closed)).collect()
    };
    // The sheet is 120 mm high; the first bend goes through piece A only, upwards, so it is a valley from above; the
    // second one goes down and is shared by B and C; the third is under the limit.
    let (valleys, mountains) = (folds(Operation::ScoreValley), folds(Operation::ScoreMountain));
    assert_eq!((valleys.len(), mountains.len()), (1, 2));
    assert!((valleys[0] - (120.0 - 0.6)).abs() < 1e-9, "{valleys:?}");
    assert!((mountains.iter().sum::<f64>() - (120.0 - 1.2)).abs() < 1e-9, "{mountains:?}");
}

/// Two pieces 100 × 120 mm with a straight seam between them.
fn halves() -> (CutMesh, Flattening) {
    let (mesh, plane) = bent_sheet(50, 30, 4.0, &[]);
    let middle = |f: FaceId| mesh.face_vertices(f).map(|v| plane[v.index()].x).iter().sum::<f64>() / 3.0;
    cut_apart(&mesh, &plane, |f| u32::from(middle(f) > 100.0), |_| false)
}

fn joined(input: &(CutMesh, Flattening), join: Join) -> Parts {
    let parts = layout(&input.0, &input.1, None, &Options { join, ..OPTIONS }, &Monitor::silent()).unwrap();
    for part in &parts.parts {
        assert_eq!(check_outline(&part.contours), Ok(()), "part {}", part.name);
    }
    parts
}

fn tabs(sides: Sides) -> Tabs {
    Tabs { width: 6.0, angle: 1.0, length: 15.0, sides, hold: Hold::Glue }
}

fn holes(parts: &Parts) -> usize {
    parts.parts.iter().map(|it| it.contours.len() - 1).sum()
}

#[test]
fn tabs_become_part_of_the_outline() {
    let input = halves();
    for (sides, count) in [(Sides::One, 8), (Sides::Alternating, 8), (Sides::Both, 16)] {
        let parts = joined(&input, Join::Tabs(tabs(sides)));
        let found = Joints { tabs: count, ..Joints::default() };
        assert_eq!(parts.joints, found, "{sides:?}");
        let gained: Vec<f64> = parts.parts.iter().map(|it| area(&it.contours) - 12_000.0).collect();
        let tab = 6.0 * (15.0 - 6.0 / 1.0_f64.tan());
        let total: f64 = gained.iter().sum();
        assert!((total / (count as f64 * tab) - 1.0).abs() < 0.04, "{sides:?}: {gained:?}");
        assert_eq!(
            gained.iter().filter(|it| **it > tab).count(),
            if sides == Sides::One { 1 } else { 2 },
            "{gained:?}"
        );
        let folds = parts.parts.iter().flat_map(|it| &it.marks).filter(|it| it.operation == Operation::ScoreMountain);
        assert_eq!(folds.count(), count, "{sides:?}");
    }
}

#[test]
fn tabs_of_crooked_seams_cross_nothing() {
    for input in [three_pieces(), slit_piece()] {
        for sides in [Sides::One, Sides::Alternating, Sides::Both] {
            let parts = joined(&input, Join::Tabs(tabs(sides)));
            assert_eq!(parts.joints.collisions, Vec::<String>::new(), "{sides:?}");
            assert_eq!(holes(&parts), 0, "{sides:?}");
        }
        let sewn = joined(&input, Join::Allowance(5.0));
        assert!(sewn.joints.missing.is_empty(), "{:?}", sewn.joints);
    }
}

#[test]
fn tabs_wider_than_their_edge_are_made_lower_and_counted() {
    let wide = Tabs { width: 30.0, length: 12.0, hold: Hold::Rivet(1.5), ..tabs(Sides::One) };
    let parts = joined(&halves(), Join::Tabs(wide));
    assert_eq!((parts.joints.tabs, parts.joints.narrowed, parts.joints.holes), (10, 10, 20));
    assert_eq!(parts.parts.iter().map(|it| it.contours.len() - 1).collect::<Vec<_>>(), [10, 10]);
}

#[test]
fn an_allowance_surrounds_the_seams_and_holes_match_across_them() {
    let input = halves();
    let sewn = joined(&input, Join::Allowance(5.0));
    for part in &sewn.parts {
        assert!((area(&part.contours) - 12_600.0).abs() < 0.01, "5 mm along 120 mm: {}", area(&part.contours));
        let sew: Vec<&Mark> = part.marks.iter().filter(|it| it.operation == Operation::Sew).collect();
        assert!(sew.len() == 1 && (polyline_length(&sew[0].points, false) - 120.0).abs() < 1e-9);
        let notches = part.marks.iter().filter(|it| it.operation == Operation::Registration);
        assert_eq!(notches.count(), tick_places(120.0, OPTIONS.tick_spacing).len());
    }
    let laced = joined(&input, Join::Holes(Holes { diameter: 1.2, inset: 4.0, pitch: 6.0 }));
    assert_eq!((laced.joints.holes, holes(&laced)), (40, 40));
}

#[test]
fn fingers_interlock() {
    let fingers = Tabs { hold: Hold::Finger(3.0), angle: std::f64::consts::FRAC_PI_2, ..tabs(Sides::One) };
    let parts = joined(&halves(), Join::Tabs(fingers));
    assert_eq!((parts.joints.tabs, parts.joints.collisions.len()), (8, 0));
    // Half of them stand out of either side, and each takes as much from the other side as it adds to its own.
    for part in &parts.parts {
        let outline = &part.contours[0];
        let size = bounds_turned(outline, least_box_angle(outline)).size();
        assert!((size.max() - 120.0).abs() < 0.2 && (size.min() - 103.0).abs() < 0.1, "{size}");
        assert!((area(&part.contours) - 12_000.0).abs() < 40.0, "{}", area(&part.contours));
        assert!(part.marks.iter().all(|it| !it.operation.is_score()));
    }
    // At a right angle they reach through half of the thickness.
    let (mesh, plane) = bent_sheet(50, 30, 4.0, &[(25, std::f64::consts::FRAC_PI_2)]);
    let middle = |f: FaceId| mesh.face_vertices(f).map(|v| plane[v.index()].x).iter().sum::<f64>() / 3.0;
    let fingers = Tabs { hold: Hold::Finger(4.0), angle: std::f64::consts::FRAC_PI_2, ..tabs(Sides::One) };
    let corner = joined(&cut_apart(&mesh, &plane, |f| u32::from(middle(f) > 100.0), |_| false), Join::Tabs(fingers));
    for part in &corner.parts {
        let size = bounds_turned(&part.contours[0], least_box_angle(&part.contours[0])).size();
        assert!((size.min() - 102.0).abs() < 0.1, "{size}");
    }
}

#[test]
fn a_number_goes_where_there_is_room_and_a_line_leads_to_its_seam() {
    // A strip 0.8 mm wide with a block at its end; the seam along its lower half has no room beside it.
    let (mesh, plane) = bent_sheet(60, 80, 0.4, &[]);
    let middle = |f: FaceId| mesh.face_vertices(f).map(|v| plane[v.index()]).iter().sum::<Vec2>() / 3.0;
    let label = |f: FaceId| match middle(f) {
        p if p.x < 0.8 || p.y > 20.0 => 0,
        p => 1 + u32::from(p.y > 10.0),
    };
    let parts = made(&cut_apart(&mesh, &plane, label, |_| false));
    assert_eq!((parts.unlabelled.len(), parts.on_partner.len()), (0, 0), "{:?}", parts.on_partner);
    let lines = parts.parts[0].marks.iter().filter(|it| it.operation == Operation::Registration);
    let longest = lines.map(|it| polyline_length(&it.points, false)).fold(0.0, f64::max);
    assert!(longest > 10.0, "{longest}");
    assert!(parts.parts.iter().all(|it| inspect::astray(it).is_empty() && inspect::doubled(it).is_empty()));
}

#[test]
fn inputs_that_do_not_belong_together_are_refused() {
    let (cut, mut flat) = slit_piece();
    flat.uv[VertexId(3)].x = f64::NAN;
    let fault = layout(&cut, &flat, None, &OPTIONS, &Monitor::silent());
    assert!(matches!(fault, Err(LayoutError::Misfit(Misfit::NotFinite { vertex: 3, .. }))));
    flat.uv = Field::filled(2, Vec2::zeros());
    let fault = layout(&cut, &flat, None, &OPTIONS, &Monitor::silent());
    assert!(matches!(fault, Err(LayoutError::Misfit(Misfit::Count { found: 2, .. }))));
}

/// T 1, R 2, K 0.33: 90° have an allowance of 3.660 mm (CUTFILES.md), so legs of outside dimensions are 2.340 mm too long
/// together and legs of inside dimensions 0.340 mm.
const SHEET: Bending = Bending { thickness: 1.0, radius: 2.0, k_factor: 0.33 };

fn in_metal(input: &(CutMesh, Flattening)) -> Parts {
    let options = Options { bending: Some(SHEET), join: Join::Butt, ..OPTIONS };
    let parts = layout(&input.0, &input.1, None, &options, &Monitor::silent()).unwrap();
    for part in &parts.parts {
        assert_eq!(check_outline(&part.contours), Ok(()));
        assert!(part.marks.iter().flat_map(|it| &it.points).all(|&p| contains(&part.contours, p)));
    }
    assert_eq!(parts.unlabelled, Vec::<String>::new());
    parts
}

/// Extent of the first part, turned back to where the fixture had it.
fn extent(parts: &Parts) -> Vec2 {
    Box2::of(&parts.parts[0].contours[0].iter().map(|&p| turned(p, -0.4)).collect::<Vec<_>>()).size()
}

#[test]
fn a_channel_of_sheet_metal_is_as_long_as_the_formula_says() {
    use std::f64::consts::FRAC_PI_2;
    let (mesh, plane) = bent_sheet(50, 30, 4.0, &[(12, FRAC_PI_2), (30, -FRAC_PI_2)]);
    let parts = in_metal(&cut_apart(&mesh, &plane, |_| 0, |_| false));
    let expected = Vec2::new(200.0 - 0.340 - 2.340, 120.0);
    assert!((extent(&parts) - expected).amax() < 1e-3, "{:?}", extent(&parts));
    assert!((area(&parts.parts[0].contours) - expected.x * expected.y).abs() < 0.1);
    let bends: Vec<(bool, f64, f64, bool)> = parts
        .bends
        .iter()
        .map(|it| {
            (it.up, (it.angle.to_degrees() * 1e3).round() / 1e3, (it.deduction * 1e3).round() / 1e3, it.corrected)
        })
        .collect();
    assert_eq!(bends, [(false, 90.0, 2.34, true), (true, 90.0, 0.34, true)]);
    // The lines lie in the middle of the bent zones: the inner leg is 72 mm, half of each deduction shorter.
    let at = |up: bool| {
        let wanted = if up { Operation::ScoreValley } else { Operation::ScoreMountain };
        let line = parts.parts[0].marks.iter().find(|it| it.operation == wanted).unwrap();
        turned(line.points[0], -0.4).x
    };
    assert!((at(false) - at(true) - (72.0 - 1.340)).abs() < 1e-3, "{} {}", at(true), at(false));
    let letters = parts.parts[0].marks.iter().filter(|it| it.operation == Operation::Text).count();
    let texts = ["UP 90°", "DOWN 90°", "A"];
    assert_eq!(letters, texts.map(|it| letter(it, 3.5).strokes.len()).iter().sum::<usize>());
}

#[test]
fn a_box_of_sheet_metal_is_as_long_as_the_formula_says() {
    // Open below, the printed side outside: 60 × 40 mm, 25 mm high, its walls not joined to each other.
    let (w, d, h) = (60.0, 40.0, 25.0);
    let base = [[0.0, 0.0], [w, 0.0], [w, d], [0.0, d]].map(|[x, y]| Vec2::new(x, y));
    let mut points: Vec<Vec3> = base.iter().map(|p| Vec3::new(p.x, p.y, 0.0)).collect();
    let mut plane = base.to_vec();
    let mut faces = vec![[0, 1, 2], [0, 2, 3]];
    for k in 0..4 {
        let (a, b, n) = (base[k], base[(k + 1) % 4], plane.len() as u32);
        let out = Vec2::new((b - a).y, -(b - a).x).normalize() * h;
        for p in [a, b] {
            points.push(Vec3::new(p.x, p.y, -h));
            plane.push(p + out);
        }
        let (i, j) = (k as u32, (k as u32 + 1) % 4);
        faces.extend([[i, n, n + 1], [i, n + 1, j]]);
    }
    let mesh = TriMesh::new(points, &faces).unwrap();
    let parts = in_metal(&cut_apart(&mesh, &plane, |_| 0, |_| false));
    assert!(parts.bends.len() == 4 && parts.bends.iter().all(|it| it.corrected && !it.up), "{:?}", parts.bends);
    let deduction = 2.0 * 2.340;
    let expected = Vec2::new(w + 2.0 * h - deduction, d + 2.0 * h - deduction);
    assert!((extent(&parts) - expected).amax() < 1e-3, "{:?}", extent(&parts));
}

#[test]
fn bends_that_no_flat_pattern_can_take_in_print_their_deduction() {
    // The third bend is 4 mm from the second: their bent zones would overlap.
    let (mesh, plane) = bent_sheet(50, 30, 4.0, &[(12, 1.5), (30, -1.5), (31, -1.5)]);
    let parts = in_metal(&cut_apart(&mesh, &plane, |_| 0, |_| false));
    assert!(parts.bends.len() == 3 && parts.bends.iter().all(|it| !it.corrected));
    assert!((extent(&parts).x - 200.0).abs() < 1e-6);
    let letters = parts.parts[0].marks.iter().filter(|it| it.operation == Operation::Text).count();
    let [up, down] = [false, true].map(|down| SHEET.deduction(1.5, !down));
    let texts =
        [format!("UP 86° BD {up:.2}"), format!("DOWN 86° BD {down:.2}"), format!("DOWN 86° BD {down:.2}"), "A".into()];
    assert_eq!(letters, texts.iter().map(|it| letter(it, 3.5).strokes.len()).sum::<usize>());
}

#[test]
fn perforated_folds_are_real_segments() {
    let input = three_pieces();
    let options = Options { perforation: Some((2.0, 1.0)), ..OPTIONS };
    let (whole, cut) = (made(&input), layout(&input.0, &input.1, None, &options, &Monitor::silent()).unwrap());
    let folds = |parts: &Parts| -> Vec<Mark> {
        parts.parts.iter().flat_map(|it| it.marks.clone()).filter(|it| it.operation.is_score()).collect()
    };
    let (lines, cuts) = (folds(&whole), folds(&cut));
    let expected: usize = lines.iter().map(|it| (polyline_length(&it.points, false) / 3.0) as usize).sum();
    assert_eq!(cuts.len(), expected);
    for mark in &cuts {
        assert!((polyline_length(&mark.points, false) - 2.0).abs() < 1e-9);
        assert!(lines.iter().any(|line| {
            let on = |p: Vec2| line.points.windows(2).any(|w| point_segment_distance(p, w[0], w[1]) < 1e-9);
            line.operation == mark.operation && mark.points.iter().all(|&p| on(p))
        }));
    }
    for pair in cuts.windows(2) {
        let gap = (pair[1].points[0] - pair[0].points[pair[0].points.len() - 1]).norm();
        assert!(gap >= 1.0 - 1e-9, "{gap}");
    }
}
