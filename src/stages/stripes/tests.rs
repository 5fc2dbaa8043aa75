//! Laws of isolines and of the mesh that is cut along them.
use super::*;
use crate::{mesh::shapes, model::StripeLine};

fn options(along: Along, spacing: f64) -> Options {
    Options {
        symmetry: 1,
        delaunay: false,
        along,
        turn: 0.0,
        guides: Vec::new(),
        field_singularities: Vec::new(),
        spacing,
        singularities: Vec::new(),
        generators: Vec::new(),
        budget: 0,
        least_gain: 0.005,
        join: false,
        even: 0,
        starts: Vec::new(),
    }
}

fn run(mesh: &TriMesh, options: &Options) -> (Stripes, Crossings) {
    let laid = stripes(mesh, options, &Monitor::silent()).unwrap();
    (laid.stripes, laid.crossings)
}

const Z: Along = Along::Axis(Vec3::new(0.0, 0.0, 1.0));

fn surfaces() -> Vec<(&'static str, TriMesh)> {
    let bumpy = shapes::icosphere(10.0, 3);
    let place = |p: &Vec3| p * (1.0 + 0.2 * (0.4 * p.x).sin() * (0.5 * p.y + 1.0).cos());
    let bumpy = bumpy.with_positions(Field::from_vec(bumpy.positions().iter().map(place).collect()));
    vec![
        ("bumpy", bumpy),
        ("torus", shapes::torus(20.0, 8.0, 24, 16)),
        ("plate", shapes::perforated_plate(4, 5.0, 2)),
        ("grid", shapes::grid(9, 7, 2.0)),
        ("annulus", shapes::annulus(4.0, 12.0, 24, 8)),
        ("cylinder", shapes::cylinder(6.0, 20.0, 18, 12)),
    ]
}

/// Singular faces with indices up to 3, and spacings from wide to far below an edge, so that |dα| > π on many.
fn cases(mesh: &TriMesh) -> Vec<Options> {
    let n = mesh.face_count();
    let edge = mesh.mean_edge_length();
    let ends = |index: i32| vec![(Spot::Face(5), index), (Spot::Face(n / 2), -index - 1), (Spot::Face(2 * n / 3), 1)];
    [0.3, 0.9, 4.0]
        .into_iter()
        .flat_map(|share| [0, 1, 3].map(|index| (share * edge, index)))
        .map(|(spacing, index)| Options { singularities: ends(index), ..options(Along::Smoothest, spacing) })
        .collect()
}

#[test]
fn signed_crossings_around_a_face_are_its_index_and_lines_end_nowhere_else() {
    for (name, mesh) in surfaces() {
        for it in cases(&mesh) {
            let (stripes, crossings) = run(&mesh, &it);
            let mut index = vec![0; mesh.face_count()];
            for &(spot, k) in &it.singularities {
                let Spot::Face(f) = spot else { unreachable!() };
                index[f] += k;
            }
            let mut steep = 0;
            for f in mesh.faces() {
                let signed = |h| {
                    let e = mesh.edge(h);
                    if mesh.halfedge(e) == h { crossings.count[e] } else { -crossings.count[e] }
                };
                assert_eq!(mesh.face_halfedges(f).map(signed).iter().sum::<i32>(), index[f.index()], "{name} {f}");
                steep += mesh.face_halfedges(f).iter().filter(|&&h| signed(h).abs() > 1).count();
            }
            assert!(steep > 0 || it.spacing > 0.5 * mesh.mean_edge_length(), "{name}");
            for end in &crossings.ends {
                assert_eq!(end.crossings.len() as i32, index[end.face.index()].abs(), "{name}");
            }
            let open: i32 = index.iter().map(|k| k.abs()).sum();
            let inner: usize = stripes.lines.iter().map(|it| it.inner_ends).sum();
            assert_eq!(inner as i32, open, "{name}");
            assert_eq!(stripes.found, stripes.prescribed, "{name}");
            assert!(stripes.lines.iter().all(|it| !it.closed || it.inner_ends == 0), "{name}");
            // Every crossing lies on exactly one line.
            let points: usize = stripes.lines.iter().map(|it| it.points.len()).sum();
            assert_eq!(points, crossings.len() + inner, "{name}");
        }
    }
}

#[test]
fn lines_run_through_faces_without_crossing_and_each_piece_lies_in_its_face() {
    for (name, mesh) in surfaces() {
        for it in cases(&mesh) {
            let (stripes, _) = run(&mesh, &it);
            let mut of_face: Vec<Vec<[[f64; 3]; 2]>> = vec![Vec::new(); mesh.face_count()];
            for (f, ends) in stripes.lines.iter().flat_map(|it| &it.pieces) {
                assert!(ends.iter().flatten().all(|&x| x > -1e-9), "{name} {f}: {ends:?}");
                of_face[f.index()].push(*ends);
            }
            for pieces in of_face {
                let flat = |p: [f64; 3]| crate::geom::Vec2::new(p[0], p[1]);
                for (i, a) in pieces.iter().enumerate() {
                    for b in &pieces[..i] {
                        let [p, q, r, s] = [a[0], a[1], b[0], b[1]].map(flat);
                        let side = |o: crate::geom::Vec2, x, y| crate::geom::cross2(x - o, y - o);
                        let apart = side(p, q, r) * side(p, q, s) > -1e-12 || side(r, s, p) * side(r, s, q) > -1e-12;
                        assert!(apart, "{name}: {a:?} {b:?}");
                    }
                }
            }
        }
    }
}

#[test]
fn doubling_the_levels_halves_the_distance() {
    for (name, mesh) in surfaces() {
        let it = &cases(&mesh)[5];
        let solver = Parameterizer::new(&mesh).unwrap();
        let tangent = TangentSpaces::new(&mesh);
        let field = smoothest(&mesh, &tangent, 1).unwrap().vectors();
        let gradient = Field::from_vec(field.iter().map(|z| z * (TAU / it.spacing)).collect::<Vec<Complex>>());
        let solved = solver.solve(&mesh, one_form(&mesh, &tangent, &gradient), &Indices::default()).unwrap();
        let at = |per_turn, offset| Crossings::new(&mesh, &solved.alpha, &solved.n, Levels { per_turn, offset });
        let (whole, half, both) = (at(1, 0.0), at(1, 0.5), at(2, 0.0));
        assert_eq!(both.len(), whole.len() + half.len(), "{name}");
        assert!((at(1, 0.25).len() as f64 / whole.len() as f64 - 1.0).abs() < 0.2, "{name}");
    }
}

#[test]
fn the_mesh_is_cut_along_its_lines() {
    for (name, mesh) in surfaces() {
        for it in cases(&mesh) {
            let (_, crossings) = run(&mesh, &it);
            let split = split::split(&mesh, &crossings, 0.03).unwrap();
            assert_eq!(split.mesh.euler_characteristic(), mesh.euler_characteristic(), "{name}");
            assert!((split.mesh.total_area() / mesh.total_area() - 1.0).abs() < 1e-12, "{name}");
            let mut area = vec![0.0; mesh.face_count()];
            for (f, origin) in split.origin.enumerate() {
                assert!(split.mesh.normal(f).dot(&mesh.normal(*origin)) > 0.999, "{name}");
                area[origin.index()] += split.mesh.area(f);
            }
            assert!(mesh.faces().all(|f| (area[f.index()] / mesh.area(f) - 1.0).abs() < 1e-9), "{name}");
            // Every piece of a line is an edge, and every end and crossing a vertex of as many as it should be.
            let ends: usize = crossings.ends.iter().map(|it| it.crossings.len()).sum();
            let rims = crossings.edge.iter().filter(|&&e| mesh.is_boundary_edge(e)).count();
            assert_eq!(2 * split.lines.len(), 2 * crossings.len() - rims + ends, "{name}");
            for &[a, b] in &split.lines {
                let [a, b] = [VertexId(a), VertexId(b)];
                assert!(split.mesh.neighbors(a).any(|it| it == b), "{name}");
            }
        }
    }
}

#[test]
fn rings_of_a_sphere_become_one_spiral_with_two_ends() {
    let mesh = shapes::icosphere(20.0, 4);
    let rings = run(&mesh, &options(Z, 5.0)).0;
    // From pole to pole it is 20 π mm.
    assert!((12..=13).contains(&rings.lines.len()) && rings.lines.iter().all(|it| it.closed));
    assert!((rings.spacing[2] / 5.0 - 1.0).abs() < 0.03, "{:?}", rings.spacing);
    let spiral = run(&mesh, &Options { join: true, ..options(Z, 5.0) }).0;
    assert_eq!((spiral.lines.len(), spiral.lines[0].inner_ends, spiral.found.len()), (1, 2, 2));
    assert!(spiral.found.iter().all(|it| it.place.z.abs() > 18.0), "{:?}", spiral.found);
    let length: f64 = rings.lines.iter().map(StripeLine::length).sum();
    assert!((spiral.lines[0].length() / length - 1.0).abs() < 0.1);
}

/// A ball with horns along some directions.
fn horned(horns: &[Vec3], length: f64) -> TriMesh {
    let ball = shapes::icosphere(20.0, 4);
    let place = |p: &Vec3| {
        let n = p.normalize();
        let horn = |axis: &Vec3| length * (-(n - axis.normalize()).norm_squared() / 0.05).exp();
        p + n * horns.iter().map(horn).sum::<f64>()
    };
    ball.with_positions(Field::from_vec(ball.positions().iter().map(place).collect()))
}

#[test]
fn a_body_with_limbs_becomes_one_strip_with_one_zipper() {
    let upwards = [Vec3::new(0.6, 0.0, 0.8), Vec3::new(-0.6, 0.0, 0.8)];
    let downwards = [Vec3::new(0.7, 0.5, -0.6), Vec3::new(-0.7, 0.5, -0.6), Vec3::new(0.0, -0.8, -0.6)];
    let all = [&upwards[..], &downwards].concat();
    for (horns, length, spacing) in [(&upwards[..], 30.0, 6.0), (&downwards[..], 20.0, 5.0), (&all, 25.0, 5.0)] {
        let mesh = horned(horns, length);
        for (along, even) in [(Z, 0), (Along::Distance(Vec::new()), 0), (Along::Distance(Vec::new()), 8)] {
            let about = format!("{} horns, {along:?}, {even}", horns.len());
            let rings = Options { even, ..options(along, spacing) };
            let before = run(&mesh, &rings).0;
            assert!(before.web.cycles > 10 && before.lines.iter().all(|it| it.closed), "{about}");
            let (found, crossings) = run(&mesh, &Options { join: true, ..rings });
            assert!(found.web.is_path(), "{about}: {:?} {:?}", found.web, found.found);
            assert_eq!(cut_along(&mesh, &crossings).unwrap().2, 1, "{about}");
            // Two ends of the zipper; at every other tip two lines meet.
            let mut indices: Vec<u32> = found.found.iter().map(|it| it.index.unsigned_abs()).collect();
            indices.sort_unstable();
            assert_eq!(
                (&indices[..2], indices[2..].iter().all(|&k| k == 2)),
                (&[1, 1][..], true),
                "{about}: {indices:?}"
            );
            assert!(indices.len() >= horns.len(), "{about}");
            assert_eq!(found.lines.len(), indices.len() - 1, "{about}");
            // Rings became spirals: as long, and as far from each other.
            let length = |it: &Stripes| it.lines.iter().map(StripeLine::length).sum::<f64>();
            assert!((length(&found) / length(&before) - 1.0).abs() < 0.1, "{about}");
            assert!((found.spacing[2] / spacing - 1.0).abs() < 0.15, "{about}: {:?}", found.spacing);
        }
    }
}

#[test]
fn on_a_surface_without_handles_every_closed_way_of_lines_parts_it() {
    for (name, mesh) in surfaces().into_iter().filter(|it| it.1.genus() == 0) {
        for it in cases(&mesh) {
            let (stripes, crossings) = run(&mesh, &it);
            let (_, _, parts) = cut_along(&mesh, &crossings).unwrap();
            assert_eq!(parts, stripes.web.cycles + 1, "{name}: {:?}", stripes.web);
            let (open, closed) = crossings.arcs();
            let lines = &stripes.lines;
            assert_eq!(
                (open.len() + closed, closed),
                (lines.len(), lines.iter().filter(|it| it.closed).count()),
                "{name}"
            );
        }
    }
}

#[test]
fn even_steps_even_out_the_spacing_and_leave_the_singularities() {
    let mesh = horned(&[Vec3::new(0.6, 0.0, 0.8), Vec3::new(-0.6, 0.0, 0.8)], 30.0);
    let singularities = vec![(Spot::Face(7), 1), (Spot::Face(2000), -1)];
    let spread = |even| {
        let out = run(&mesh, &Options { even, singularities: singularities.clone(), ..options(Z, 3.0) }).0;
        assert_eq!(out.found, out.prescribed);
        assert!((out.spacing[2] / 3.0 - 1.0).abs() < 0.2, "{:?}", out.spacing);
        out.spacing[3]
    };
    let [none, some, many] = [0, 3, 20].map(spread);
    assert!(some < 0.6 * none && many < 0.8 * some, "{none} {some} {many}");
}

#[test]
fn away_from_a_point_lines_are_circles_about_it() {
    // On a ball the distance is the angle, on a flat sheet it is straight.
    let ball = shapes::icosphere(20.0, 4);
    let pole = Vec3::new(0.0, 0.0, 20.0);
    let sheet = shapes::grid(60, 60, 1.0);
    let place = Vec3::new(30.0, 30.0, 0.0);
    let angle = |p: Vec3| 20.0 * (p.dot(&pole) / 400.0).clamp(-1.0, 1.0).acos();
    let straight = |p: Vec3| (p - place).norm();
    type Case<'a> = (&'a TriMesh, Vec3, f64, &'a dyn Fn(Vec3) -> f64);
    let cases: [Case<'_>; 2] = [(&ball, pole, f64::INFINITY, &angle), (&sheet, place, 20.0, &straight)];
    for (mesh, from, clear, distance) in cases {
        let out = run(mesh, &options(Along::Distance(vec![from]), 4.0)).0;
        let mut radii = Vec::new();
        for line in &out.lines {
            let at: Vec<f64> = line.points.iter().map(|&p| distance(p)).collect();
            let (low, high) = at.iter().fold((f64::MAX, f64::MIN), |(a, b), &x| (a.min(x), b.max(x)));
            // Near a border they bend to meet it at a right angle.
            if high > clear {
                continue;
            }
            assert!(high - low < 0.8 || low < 6.0, "{low} {high}");
            radii.push(0.5 * (low + high));
        }
        radii.sort_by(f64::total_cmp);
        radii.dedup_by(|a, b| (*a - *b).abs() < 1.0);
        let inner = &radii[1..radii.len() - 1];
        assert!(inner.windows(2).all(|it| ((it[1] - it[0]) / 4.0 - 1.0).abs() < 0.15), "{radii:?}");
    }
}

#[test]
fn lines_start_where_they_are_told() {
    let mesh = shapes::icosphere(20.0, 4);
    let ends = vec![(Spot::Near(Vec3::new(0.0, 0.0, 20.0)), 1), (Spot::Near(Vec3::new(0.0, 0.0, -20.0)), -1)];
    let spiral = Options { singularities: ends, ..options(Z, 5.0) };
    let top = |it: &Stripes| it.lines[0].points[0].z > 0.0;
    // From where it begins (+1) to where it ends, unless it is to start there.
    let (plain, _) = run(&mesh, &spiral);
    let (turned, _) = run(&mesh, &Options { starts: vec![Vec3::new(0.0, 0.0, -30.0)], ..spiral });
    assert_eq!((plain.lines.len(), top(&plain), top(&turned)), (1, true, false));
    // Rings start at their points nearest to a meridian, and are what they were.
    let starts: Vec<Vec3> = (-20..=20).map(|z| Vec3::new(30.0, 1.0, f64::from(z))).collect();
    let (rings, _) = run(&mesh, &options(Z, 5.0));
    let (started, _) = run(&mesh, &Options { starts: starts.clone(), ..options(Z, 5.0) });
    assert_eq!(rings.lines.len(), started.lines.len());
    for (a, b) in rings.lines.iter().zip(&started.lines) {
        let miss = |p: Vec3| starts.iter().map(|s| (p - s).norm()).fold(f64::INFINITY, f64::min);
        let n = a.points.len();
        let points = (0..n).flat_map(|i| (0..20).map(move |k| (i, f64::from(k) / 20.0)));
        let nearest = points.map(|(i, t)| miss(a.points[i] + (a.points[(i + 1) % n] - a.points[i]) * t));
        let nearest = nearest.fold(f64::INFINITY, f64::min);
        assert!(b.closed && miss(b.points[0]) <= nearest + 1e-12 && miss(b.points[0]) > nearest - 0.1);
        assert!((a.length() / b.length() - 1.0).abs() < 1e-12 && b.points.len() == b.pieces.len());
        for (i, (f, ends)) in b.pieces.iter().enumerate() {
            for (p, weights) in [b.points[i], b.points[(i + 1) % b.points.len()]].iter().zip(ends) {
                let at: Vec3 = mesh.face_positions(*f).iter().zip(weights).map(|(q, w)| q * *w).sum();
                assert!((at - p).norm() < 1e-9);
            }
        }
    }
}

#[test]
fn the_budget_lowers_the_energy_and_is_kept() {
    let (_, mesh) = surfaces().swap_remove(0);
    let with = |budget| run(&mesh, &Options { budget, ..options(Along::Smoothest, 1.0) }).0;
    let (none, some, more) = (with(0), with(4), with(12));
    assert!(none.found.is_empty() && some.energy[0] == none.energy[1]);
    assert!(
        some.energy[1] < 0.9 * none.energy[1] && more.energy[1] < some.energy[1],
        "{:?} {:?}",
        some.energy,
        more.energy
    );
    let pairs = |it: &Stripes| it.found.iter().map(|it| it.index.unsigned_abs()).sum::<u32>() / 2;
    assert!(pairs(&some) <= 4 && pairs(&more) <= 12);
}

#[test]
fn a_listed_field_and_listed_lines() {
    let mesh = shapes::icosphere(10.0, 3);
    let poles = vec![(Spot::Near(Vec3::new(0.0, 0.0, 10.0)), 1), (Spot::Near(Vec3::new(0.0, 0.0, -10.0)), 1)];
    let guides = vec![(Vec3::new(10.0, 0.0, 0.0), Vec3::new(0.0, 0.0, 1.0))];
    let it = Options { field_singularities: poles, guides, ..options(Along::Smoothest, 3.0) };
    let out = run(&mesh, &it).0;
    assert_eq!(out.field_singularities, 2);
    // Meridians as the field: rings as lines.
    for line in &out.lines {
        let z: Vec<f64> = line.points.iter().map(|p| p.z).collect();
        let (low, high) = (z.iter().copied().fold(f64::MAX, f64::min), z.iter().copied().fold(f64::MIN, f64::max));
        assert!(line.closed && high - low < 1.0, "{low} {high}");
    }
}

#[test]
fn bad_input_is_told() {
    let mesh = shapes::icosphere(10.0, 2);
    let error = |options: &Options| stripes(&mesh, options, &Monitor::silent()).unwrap_err().to_string();
    let base = || options(Along::Smoothest, 3.0);
    let said = error(&Options { spacing: 0.01, ..base() });
    assert!(said.contains("finer mesh") && said.contains("good for lines"), "{said}");
    assert!(error(&Options { singularities: vec![(Spot::Face(999), 1)], ..base() }).contains("face 999"));
    let said = error(&Options { singularities: vec![(Spot::Face(9), 1), (Spot::Face(8), 2)], ..base() });
    assert!(said.contains("-3 is missing"), "{said}");
    for none in [0.0, -3.0, f64::INFINITY, f64::NAN] {
        assert!(error(&Options { spacing: none, ..base() }).contains("must be a positive number"), "{none}");
    }
    assert!(error(&options(Along::Guides, 3.0)).contains("zero everywhere"));
    assert!(error(&options(Along::Boundary, 3.0)).contains("no boundary"));
    let said = error(&Options { field_singularities: vec![(Spot::Face(9), 1)], ..base() });
    assert!(said.contains("1 is missing"), "{said}");
    let flat = shapes::grid(4, 4, 1.0);
    let said = stripes(&flat, &options(Z, 3.0), &Monitor::silent()).unwrap_err().to_string();
    assert!(said.contains("zero everywhere"), "{said}");
}

#[test]
fn lines_of_a_line_field_bend_around_its_half_turns_and_end_where_they_are_told() {
    for (name, mesh) in surfaces() {
        let edge = mesh.mean_edge_length();
        for share in [0.7, 2.5] {
            for ends in [vec![], vec![(Spot::Face(7), 2)], vec![(Spot::Face(7), 1), (Spot::Face(100), 3)]] {
                let inner: i32 = ends.iter().map(|it| it.1).sum();
                let plain = options(Along::Smoothest, share * edge);
                let it = Options { symmetry: 2, singularities: ends.clone(), ..plain };
                let laid = match stripes(&mesh, &it, &Monitor::silent()) {
                    Ok(it) => it,
                    // Where the two sheets are not joined each needs a sum of 0 of its own.
                    Err(StripesError::Align(AlignError::Index(_))) if inner != 0 => continue,
                    Err(error) => panic!("{name}: {error}"),
                };
                let stripes = &laid.stripes;
                assert!(stripes.period_error < 1e-9, "{name}");
                let open: usize = stripes.lines.iter().map(|it| it.inner_ends).sum();
                assert_eq!(open as i32, inner, "{name}");
                let found: Vec<_> = stripes.found.iter().map(|it| (it.face.index(), it.index.abs())).collect();
                let face = |spot: Spot| if let Spot::Face(f) = spot { f } else { 0 };
                let asked: Vec<_> = ends.iter().map(|&(spot, k)| (face(spot), k)).collect();
                assert_eq!(found, asked, "{name}");
                let points: usize = stripes.lines.iter().map(|it| it.points.len()).sum();
                assert_eq!(points, laid.crossings.len() + open, "{name}");
                let base = laid.mesh.as_ref().unwrap();
                let (split, lines, _) = cut_along(base, &laid.crossings).unwrap();
                assert_eq!(split.euler_characteristic(), mesh.euler_characteristic(), "{name}");
                assert!(!lines.is_empty() && (split.total_area() / mesh.total_area() - 1.0).abs() < 1e-12, "{name}");
            }
        }
    }
}

#[test]
fn a_line_field_that_has_a_sign_gives_the_spacing_of_a_vector_field() {
    let mesh = shapes::cylinder(6.0, 20.0, 36, 24);
    let vector = run(&mesh, &options(Z, 2.0)).0;
    let line = run(&mesh, &Options { symmetry: 2, ..options(Z, 2.0) }).0;
    assert!(vector.lines.len().abs_diff(line.lines.len()) <= 1, "{} {}", vector.lines.len(), line.lines.len());
    assert!((line.spacing[2] - 2.0).abs() < 1e-6 && line.spacing[3] < 1e-6, "{:?}", line.spacing);
    // A ball with a line field of four half turns, as a baseball has.
    let ball = shapes::icosphere(10.0, 3);
    let lines = run(&ball, &Options { symmetry: 2, ..options(Along::Smoothest, 2.0) }).0;
    assert_eq!(lines.field_singularities, 4);
    assert!(
        lines.lines.iter().all(|it| it.closed) && (lines.spacing[2] / 2.0 - 1.0).abs() < 0.2,
        "{:?}",
        lines.spacing
    );
    let one = Options { symmetry: 2, join: true, ..options(Along::Smoothest, 2.0) };
    let said = stripes(&ball, &one, &Monitor::silent()).unwrap_err().to_string();
    assert!(said.contains("one strip needs a vector field"), "{said}");
}

#[test]
fn obtuse_triangles_do_not_let_a_budget_run_away() {
    let sphere = shapes::icosphere(10.0, 3);
    let place = |p: &Vec3| Vec3::new(20.0 * p.x, p.y, p.z);
    let needle = sphere.with_positions(Field::from_vec(sphere.positions().iter().map(place).collect()));
    let spacing = 0.9 * needle.mean_edge_length();
    for join in [false, true] {
        let (_, crossings) = run(&needle, &Options { budget: 20, join, ..options(Along::Smoothest, spacing) });
        assert!(crossings.len() < 5 * needle.edge_count(), "{}", crossings.len());
    }
    // Ends at the tips of rings that are evened out: lines without number are said, not drawn.
    for even in [0, 10] {
        let from = Along::Distance(vec![needle.position(VertexId(0))]);
        match stripes(&needle, &Options { join: true, even, ..options(from, spacing) }, &Monitor::silent()) {
            Ok(laid) => assert!(laid.crossings.len() < 20 * needle.edge_count(), "{}", laid.crossings.len()),
            Err(error) => assert!(matches!(error, StripesError::Dense(_)), "{error}"),
        }
    }
}
