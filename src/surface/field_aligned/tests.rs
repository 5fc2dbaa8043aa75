//! The invariants of the parameterisation on closed and bounded surfaces of genus 0 to 10.
use super::*;
use crate::{
    geom::{Complex, Vec3},
    mesh::{FaceId, shapes},
    surface::{
        direction_field::smoothest,
        tangent::{TangentSpaces, one_form},
    },
};

/// Closed and bounded surfaces with their genus, one with slivers and negative cotangents, one with two components.
fn surfaces() -> Vec<(&'static str, TriMesh, usize)> {
    let bent = |mesh: TriMesh| {
        let place = |p: &Vec3| p + Vec3::new(0.1 * p.y, 0.0, 2.0 * (0.13 * p.x).sin() * (0.11 * p.y).cos());
        let positions = Field::from_vec(mesh.positions().iter().map(place).collect());
        mesh.with_positions(positions)
    };
    let squashed = shapes::icosphere(10.0, 3);
    let flat = squashed.positions().iter().map(|p| Vec3::new(p.x, 8.0 * p.y, 0.2 * p.z)).collect();
    let squashed = squashed.with_positions(Field::from_vec(flat));
    let ball = shapes::icosphere(10.0, 2);
    let plate = shapes::perforated_plate(2, 5.0, 2);
    let mut positions = ball.positions().as_slice().to_vec();
    positions.extend(plate.positions().iter().map(|p| p + Vec3::repeat(50.0)));
    let shift = ball.vertex_count() as u32;
    let mut faces = ball.face_indices();
    faces.extend(plate.face_indices().into_iter().map(|f| f.map(|v| v + shift)));
    let two = TriMesh::new(positions, &faces).unwrap();
    vec![
        ("ball", ball, 0),
        ("squashed", squashed, 0),
        ("torus", shapes::torus(20.0, 8.0, 24, 16), 1),
        ("plate 2", plate, 2),
        ("plate 4", shapes::perforated_plate(4, 5.0, 2), 4),
        ("plate 10", shapes::perforated_plate(10, 5.0, 1), 10),
        ("grid", bent(shapes::grid(14, 9, 1.5)), 0),
        ("cylinder", shapes::cylinder(6.0, 20.0, 18, 12), 0),
        ("annulus", bent(shapes::annulus(4.0, 12.0, 24, 8)), 0),
        ("two", two, 2),
    ]
}

/// The one-form of the smoothest field at a spacing of 3 mm.
fn omega(mesh: &TriMesh) -> Field<EdgeId, f64> {
    let tangent = TangentSpaces::new(mesh);
    let field = smoothest(mesh, &tangent, 1).unwrap().vectors();
    one_form(mesh, &tangent, &Field::from_vec(field.iter().map(|z| z * (TAU / 3.0)).collect::<Vec<Complex>>()))
}

fn pair(mesh: &TriMesh, index: i32) -> Indices {
    // Both on component 0, which holds the first faces.
    let nodes = vec![(Node::Face(FaceId(3)), index), (Node::Face(FaceId::new(mesh.face_count() / 3)), -index)];
    Indices { nodes, generators: Vec::new() }
}

/// Largest distance of D1 u / 2π from the indices, and of the periods from 2π h, in radians.
fn constraint_error(mesh: &TriMesh, it: &Parameterization) -> f64 {
    let u = it.differences(mesh);
    let sums = it.solver().tree.sums(&u);
    let faces = sums.iter().zip(it.nodes()).map(|(sum, &k)| (sum - TAU * f64::from(k)).abs());
    let loops = it.generators().iter().enumerate().map(|(g, &h)| {
        let around = it.solver().tree.generator_loop(mesh, g);
        (around.iter().map(|&(e, sign)| sign * u[e]).sum::<f64>() - TAU * f64::from(h)).abs()
    });
    faces.chain(loops).fold(0.0, f64::max)
}

fn distance(mesh: &TriMesh, a: &Parameterization, b: &Parameterization) -> f64 {
    let (a, b) = (a.differences(mesh), b.differences(mesh));
    a.iter().zip(b.iter()).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max)
}

#[test]
fn constraints_hold_and_the_gradient_is_zero_everywhere() {
    for (name, mesh, genus) in surfaces() {
        for solver in [Parameterizer::new(&mesh).unwrap(), Parameterizer::with_intrinsic_delaunay(&mesh).unwrap()] {
            assert_eq!(solver.tree.generators.len(), 2 * genus, "{name}");
            let omega = omega(&mesh);
            let mut it = solver.solve(&mesh, omega, &pair(&mesh, 1)).unwrap();
            let scale = it.alpha.iter().map(|a| a.abs()).fold(1.0, f64::max);
            assert!(constraint_error(&mesh, &it) < 1e-12 * scale, "{name}: {:e}", constraint_error(&mesh, &it));
            assert!(it.residual() < 1e-9 * scale, "{name}: {:e}", it.residual());
            let sums = solver.tree.sums(&it.differences(&mesh));
            let singular: Vec<usize> = (0..mesh.face_count()).filter(|&f| (sums[f] / TAU).round() != 0.0).collect();
            assert_eq!(singular, [3, mesh.face_count() / 3], "{name}");
            for g in 0..2 * genus {
                it.set_generator(g, it.generators()[g] + 2 - g as i32 % 3).unwrap();
            }
            assert!(constraint_error(&mesh, &it) < 1e-11 * scale, "{name}: {:e}", constraint_error(&mesh, &it));
            let mut edited = it.clone();
            edited.add_pair(Node::Face(FaceId(1)), Node::Face(FaceId(2))).unwrap();
            assert!(edited.residual() < 1e-9 * scale, "{name}: {:e}", edited.residual());
        }
    }
}

#[test]
fn the_gauge_does_not_matter_and_edits_equal_new_solutions() {
    for (name, mesh, genus) in surfaces() {
        let solver = Parameterizer::new(&mesh).unwrap();
        let omega = omega(&mesh);
        let zero = solver.solve(&mesh, omega.clone(), &Indices::default()).unwrap();
        let target = solver.solve(&mesh, omega.clone(), &pair(&mesh, 2)).unwrap();
        let [a, b] = [Node::Face(FaceId(3)), Node::Face(FaceId::new(mesh.face_count() / 3))];
        let mut edited = zero.clone();
        let c = Node::Face(FaceId(7));
        edited.add_pair(c, b).unwrap();
        edited.add_pair(a, b).unwrap();
        edited.move_singularity(c, a).unwrap();
        // The periods of loops that run between the old and the new place differ; make them the same.
        for g in 0..2 * genus {
            edited.set_generator(g, target.generators()[g]).unwrap();
        }
        assert_eq!(edited.nodes(), target.nodes(), "{name}");
        assert!(distance(&mesh, &edited, &target) < 1e-9, "{name}: {:e}", distance(&mesh, &edited, &target));
        edited.annihilate(a, b).unwrap();
        for g in 0..2 * genus {
            edited.set_generator(g, zero.generators()[g]).unwrap();
        }
        assert!(distance(&mesh, &edited, &zero) < 1e-9, "{name}: {:e}", distance(&mesh, &edited, &zero));
        // n + d0 m with any integers m per vertex gives the same u.
        let mut gauged = zero.clone();
        for e in mesh.edges() {
            let [i, j] = mesh.edge_vertices(e).map(|v| (7 * v.0 % 5) as i32);
            gauged.n[e] += j - i;
        }
        gauged.gather();
        gauged.back_substitute();
        assert!(distance(&mesh, &gauged, &zero) < 1e-9, "{name}: {:e}", distance(&mesh, &gauged, &zero));
    }
}

#[test]
fn superposition_reversal_and_doubling() {
    for (name, mesh, _) in surfaces() {
        let solver = Parameterizer::new(&mesh).unwrap();
        let omega = omega(&mesh);
        let windings: Vec<(usize, i32)> = (0..solver.tree.generators.len()).map(|g| (g, 1)).collect();
        let caps =
            solver.solve(&mesh, omega.clone(), &Indices::default()).unwrap().nodes()[mesh.face_count()..].to_vec();
        let with = |sign: i32, index: i32| {
            let mut out = pair(&mesh, index);
            out.nodes.extend(caps.iter().enumerate().map(|(k, &it)| (Node::Loop(k), sign * it)));
            out.generators = windings.iter().map(|it| (it.0, sign * it.1)).collect();
            out
        };
        let scaled = |factor: f64| Field::from_vec(omega.iter().map(|it| factor * it).collect::<Vec<f64>>());
        let solve = |factor: f64, indices: &Indices| solver.solve(&mesh, scaled(factor), indices).unwrap();
        let [zero, one, three, four] = [0, 1, 3, 4].map(|k| solve(1.0, &with(1, k)).differences(&mesh));
        let (back, double) =
            (solve(-1.0, &with(-1, -3)).differences(&mesh), solve(2.0, &with(2, 6)).differences(&mesh));
        for e in mesh.edges() {
            assert!((four[e] - (one[e] + three[e] - zero[e])).abs() < 1e-9, "{name}");
            assert!((back[e] + three[e]).abs() < 1e-9 && (double[e] - 2.0 * three[e]).abs() < 1e-9, "{name}");
        }
    }
}

#[test]
fn refused_edits_say_what_is_missing() {
    let mesh = shapes::icosphere(10.0, 2);
    let solver = Parameterizer::new(&mesh).unwrap();
    let face = |f| Node::Face(FaceId(f));
    let solve = |nodes: Vec<(Node, i32)>| solver.solve(&mesh, omega(&mesh), &Indices { nodes, generators: Vec::new() });
    let message = |error: AlignError| error.to_string();
    let error = message(solve(vec![(face(1), 2), (face(5), -1)]).unwrap_err());
    assert!(error.contains("sum to 1") && error.contains("-1 is missing"), "{error}");
    assert!(message(solve(vec![(face(9999), 1)]).unwrap_err()).contains("face 9999"));
    assert!(message(solve(vec![(Node::Loop(0), 1)]).unwrap_err()).contains("boundary loop 0"));
    let mut it = solve(vec![(face(1), 2), (face(5), -2)]).unwrap();
    let error = message(it.set_index(face(1), 3).unwrap_err());
    assert!(error.contains("sum to 1") && error.contains("-1 is missing"), "{error}");
    let error = message(it.annihilate(face(1), face(6)).unwrap_err());
    assert!(error.contains("-2 is missing"), "{error}");
    assert!(matches!(it.set_generator(0, 1), Err(AlignError::Index(IndexError::NoSuchGenerator { count: 0, .. }))));
    let (_, two, _) = surfaces().remove(9);
    let solver = Parameterizer::new(&two).unwrap();
    let mut it = solver.solve(&two, omega(&two), &Indices::default()).unwrap();
    let last = face(two.face_count() as u32 - 1);
    assert!(matches!(it.add_pair(face(0), last), Err(AlignError::Apart { .. })));
    let apart = Indices { nodes: vec![(face(0), 1), (last, -1)], generators: Vec::new() };
    let error = message(solver.solve(&two, omega(&two), &apart).unwrap_err());
    assert!(error.contains("component 0") && error.contains("-1 is missing"), "{error}");
}

/// The unit field around the axis z, times `frequency`, as an exact 1-form: the change of the angle times the radius.
fn around_axis(mesh: &TriMesh, frequency: impl Fn(f64) -> f64) -> Field<EdgeId, f64> {
    Field::from_fn(mesh.edge_count(), |e| {
        let [a, b] = mesh.edge_vertices(e).map(|v| mesh.position(v));
        let turn = f64::atan2(a.x * b.y - a.y * b.x, a.x * b.x + a.y * b.y);
        turn * frequency(0.5 * (a.xy().norm() + b.xy().norm()))
    })
}

#[test]
fn winding_of_a_cylinder() {
    // Squares split by diagonals, which have weight 0. A whole winding costs nothing; half a winding too much or too
    // little is spread evenly: E = Σ w (π / around)² over the edges of the rings.
    let (around, along, radius, height) = (40, 12, 7.0, 20.0);
    let mesh = shapes::cylinder(radius, height, around, along);
    assert_eq!(cotangent_weights(&mesh).iter().filter(|w| w.abs() < 1e-12).count(), around * along);
    let solver = Parameterizer::new(&mesh).unwrap();
    let solve = |winding: f64| solver.solve(&mesh, around_axis(&mesh, |_| winding), &Indices::default()).unwrap();
    assert!(solve(3.0).energy() < 1e-20);
    let half = solve(3.5);
    // E = ½² · 2π · (height / circumference of the polygon) · 2π … in closed form from the side a of the polygon.
    let side = 2.0 * radius * (std::f64::consts::PI / around as f64).sin();
    let expected = (std::f64::consts::PI / around as f64).powi(2) * around as f64 * (height / side);
    assert!((half.energy() / expected - 1.0).abs() < 1e-10, "{} {expected}", half.energy());
}

#[test]
fn a_vortex_in_an_annulus_costs_its_logarithm() {
    // ω = 0 with a winding of 1 forced around the hole: the harmonic form dθ, E = 2π log(R / r).
    let (r, big) = (2.0, 10.0);
    let mesh = shapes::annulus(r, big, 160, 120);
    let solver = Parameterizer::new(&mesh).unwrap();
    let nodes = vec![(Node::Loop(0), 1), (Node::Loop(1), -1)];
    let zero = Field::filled(mesh.edge_count(), 0.0);
    let it = solver.solve(&mesh, zero, &Indices { nodes, generators: Vec::new() }).unwrap();
    let expected = TAU * (big / r).ln();
    assert!((it.energy() / expected - 1.0).abs() < 2e-3, "{} {expected}", it.energy());
}

#[test]
fn the_rounded_windings_are_close_to_the_field() {
    for (name, mesh, genus) in surfaces().into_iter().filter(|it| it.2 > 0) {
        let solver = Parameterizer::new(&mesh).unwrap();
        let omega = omega(&mesh);
        let rounded = solver.solve(&mesh, omega.clone(), &Indices::default()).unwrap();
        let none = Indices { nodes: Vec::new(), generators: (0..2 * genus).map(|g| (g, 0)).collect() };
        let zero = solver.solve(&mesh, omega.clone(), &none).unwrap();
        assert!(rounded.energy() <= zero.energy() * (1.0 + 1e-12), "{name}");
        let periods = solver.tree.periods(&mesh, &omega);
        for (g, period) in periods.iter().enumerate() {
            let around = solver.tree.generator_loop(&mesh, g);
            assert!((around.iter().map(|&(e, sign)| sign * omega[e]).sum::<f64>() - period).abs() < 1e-9, "{name}");
        }
    }
}

#[test]
fn the_potential_is_the_derivative_of_the_energy() {
    let mesh = shapes::torus(20.0, 8.0, 24, 16);
    for solver in [Parameterizer::new(&mesh).unwrap(), Parameterizer::with_intrinsic_delaunay(&mesh).unwrap()] {
        let it = solver.solve(&mesh, omega(&mesh), &Indices::default()).unwrap();
        let potential = it.potential();
        let (a, b) = (40, 411);
        // The energy is quadratic: its slope is half the difference to both sides.
        let energy = |amount| {
            let mut edited = it.clone();
            edited.transfer(Node::Face(FaceId(b)), Node::Face(FaceId(a)), amount).unwrap();
            edited.energy()
        };
        let slope = 0.5 * (energy(1) - energy(-1));
        let expected = 2.0 * TAU * (potential[a as usize] - potential[b as usize]);
        assert!((slope - expected).abs() < 1e-6 * slope.abs().max(1.0), "{slope} {expected}");
    }
}
