//! Laws that hold for every energy, every barrier and the whole flow.
use super::{curvature::Curvature, energy::ENERGIES, *};
use crate::{
    mesh::{FaceId, Id, VertexId, shapes},
    numeric::{optim::Objective, sparse::SymmetricMatrix},
};

/// Displaces every vertex by up to `noise` in a way that only looks random.
fn shaken(mesh: &TriMesh, noise: f64) -> TriMesh {
    let mut mesh = mesh.clone();
    for (i, p) in mesh.positions_mut().as_mut_slice().iter_mut().enumerate() {
        let wave = |k: f64| (k * (i as f64 + 1.0)).sin();
        *p += noise * Vec3::new(wave(12.9898), wave(78.233), wave(37.719));
    }
    mesh
}

/// Closed, valence 5 and 6.
fn ball() -> TriMesh {
    shapes::icosphere(1.0, 2)
}

/// With corners of valence 3 and a boundary: a tetrahedron without one of its sixteen faces.
fn open_tetrahedron() -> TriMesh {
    let p = [[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]].map(Vec3::from).to_vec();
    let fine = subdivide(&TriMesh::new(p, &[[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]]).unwrap()).unwrap();
    TriMesh::new(fine.positions().as_slice().to_vec(), &fine.face_indices()[1..]).unwrap()
}

/// Exact developables, meshed along their rulings.
fn ruled() -> [TriMesh; 3] {
    [
        shapes::cylinder(1.0, 2.0, 14, 4),
        shapes::cone_frustum(1.0, 0.4, 1.5, 11, 3),
        shapes::tangent_developable(1.0, 0.8, 0.6, [0.3, 1.2], 15, 4),
    ]
}

/// Largest error of the gradient against central differences over the largest component.
fn gradient_error(mesh: &TriMesh, energy: &'static Energy, weights: Weights) -> f64 {
    let mut evaluator = Evaluator::new(mesh, energy, weights);
    let mut x = flatten(mesh);
    let mut gradient = vec![0.0; x.len()];
    assert!(evaluator.evaluate(&x, &mut gradient).total() > 0.0);
    let largest = gradient.iter().fold(0.0_f64, |m, g| m.max(g.abs()));
    let (mut error, mut unused) = (0.0_f64, vec![0.0; x.len()]);
    let h = 2e-6;
    for i in 0..x.len() {
        let here = x[i];
        let mut at = |x_i: f64| {
            x[i] = x_i;
            evaluator.evaluate(&x, &mut unused).total()
        };
        // Fourth order, so that the truncation error stays below the bar even beside steep barriers.
        let near = (at(here + h) - at(here - h)) / (2.0 * h);
        let far = (at(here + 2.0 * h) - at(here - 2.0 * h)) / (4.0 * h);
        x[i] = here;
        error = error.max(((4.0 * near - far) / 3.0 - gradient[i]).abs());
    }
    error / largest
}

#[test]
fn barriers_have_the_gradient_of_central_differences() {
    let off = Weights::default();
    let single = [
        Weights { angle: 1.0, ..off },
        Weights { fold: 1.0, ..off },
        Weights { defect: 1.0, ..off },
        Weights { area: 1.0, ..off },
    ];
    let mesh = shaken(&ball(), 0.17);
    for weights in single {
        let mut evaluator = Evaluator::new(&mesh, &ENERGIES[0], weights);
        let parts = evaluator.evaluate(&flatten(&mesh), &mut vec![0.0; 3 * mesh.vertex_count()]);
        assert!(parts.total() > parts.energy, "{weights:?} must act here");
        let error = gradient_error(&mesh, &ENERGIES[0], weights);
        assert!(error < 1e-7, "{weights:?}: {error:e}");
    }
}

#[test]
fn energies_are_sums_over_the_vertices_that_count() {
    let mesh = shaken(&open_tetrahedron(), 0.05);
    for energy in ENERGIES {
        let mut evaluator = Evaluator::new(&mesh, energy, Weights::default());
        let parts = evaluator.evaluate(&flatten(&mesh), &mut vec![0.0; 3 * mesh.vertex_count()]);
        let own = evaluator.energies();
        assert!((own.iter().sum::<f64>() - parts.energy).abs() < 1e-14);
        for v in mesh.vertices() {
            let counts = !mesh.is_boundary_vertex(v) && mesh.face_degree(v) > 3;
            assert_eq!(own[v.index()] > 0.0, counts, "{energy:?} {v}");
        }
    }
}

#[test]
fn results_do_not_depend_on_the_number_of_threads() {
    let mesh = shaken(&subdivide(&subdivide(&ball()).unwrap()).unwrap(), 0.01);
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let weights = Weights { angle: 1.0, fold: 1.0, defect: 1.0, area: 1.0 };
            let mut gradient = vec![0.0; 3 * mesh.vertex_count()];
            let parts = Evaluator::new(&mesh, &ENERGIES[0], weights).evaluate(&flatten(&mesh), &mut gradient);
            (parts, gradient)
        })
    };
    assert_eq!(run(1), run(2));
}

/// A direction that only looks random.
fn direction(n: usize) -> Vec<f64> {
    (0..n).map(|i| (1.7 * i as f64 + 0.3).sin()).collect()
}

fn assembled(mesh: &TriMesh, weights: Weights) -> SymmetricMatrix {
    let evaluator = Evaluator::new(mesh, &ENERGIES[0], weights);
    let curvature = Curvature::new(mesh, &[]).unwrap();
    let mut hessian = curvature.matrix();
    curvature.assemble(mesh, &evaluator, None, &mut hessian);
    hessian
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

#[test]
fn the_curvature_is_the_exact_hessian_where_the_energy_vanishes() {
    for mesh in ruled() {
        let mut evaluator = Evaluator::new(&mesh, &ENERGIES[0], Weights::default());
        let (x, v) = (flatten(&mesh), direction(3 * mesh.vertex_count()));
        let model = assembled(&mesh, Weights::default()).multiply(&v);
        let mut gradient = |t: f64| {
            let moved: Vec<f64> = x.iter().zip(&v).map(|(x, v)| x + t * v).collect();
            let mut gradient = vec![0.0; x.len()];
            evaluator.evaluate(&moved, &mut gradient);
            gradient
        };
        let h = 1e-6;
        let (ahead, behind) = (gradient(h), gradient(-h));
        let largest = model.iter().fold(0.0_f64, |m, a| m.max(a.abs()));
        assert!(largest > 0.1);
        for (i, m) in model.iter().enumerate() {
            let difference = (ahead[i] - behind[i]) / (2.0 * h);
            assert!((m - difference).abs() < 1e-5 * largest, "{i}: {m} {difference}");
        }
    }
}

#[test]
fn the_curvature_of_barriers_is_that_of_gauss_and_newton() {
    let mesh = shaken(&ball(), 0.17);
    let v = direction(3 * mesh.vertex_count());
    let h = 1e-6;
    let moved = |t: f64| {
        let mut mesh = mesh.clone();
        let x: Vec<f64> = flatten(&mesh).iter().zip(&v).map(|(x, v)| x + t * v).collect();
        set_positions(&mut mesh, &x);
        mesh
    };
    let (ahead, behind) = (moved(h), moved(-h));
    let rate = |f: &dyn Fn(&TriMesh) -> f64| (f(&ahead) - f(&behind)) / (2.0 * h);
    let off = Weights::default();
    let plain = assembled(&mesh, off).multiply(&v);
    let model = |weights: Weights| dot(&v, &assembled(&mesh, weights).multiply(&v)) - dot(&v, &plain);
    let angle: f64 = mesh
        .halfedges()
        .map(|c| 2.0 * (barrier::ANGLE.root(mesh.corner_angle(c)).1 * rate(&|m| m.corner_angle(c))).powi(2))
        .sum();
    let cosine = |m: &TriMesh, e| m.dihedral_cosine(e).unwrap();
    let fold: f64 =
        mesh.edges().map(|e| 2.0 * (barrier::FOLD.root(cosine(&mesh, e)).1 * rate(&|m| cosine(m, e))).powi(2)).sum();
    let defect: f64 = mesh
        .vertices()
        .filter(|&v| mesh.angle_defect(v).abs() > barrier::DEFECT)
        .map(|v| 2.0 * rate(&|m| m.angle_defect(v)).powi(2))
        .sum();
    let mean = mesh.total_area() / mesh.face_count() as f64;
    let area: f64 = mesh
        .faces()
        .map(|f| {
            let ratio = mesh.area(f) / (mesh.area(f) * mean).sqrt();
            (ratio + 1.0 / ratio) * rate(&|m| m.area(f).ln()).powi(2)
        })
        .sum();
    for (name, weights, expected) in [
        ("angle", Weights { angle: 1.0, ..off }, angle),
        ("fold", Weights { fold: 1.0, ..off }, fold),
        ("defect", Weights { defect: 1.0, ..off }, defect),
        ("area", Weights { area: 1.0, ..off }, area),
    ] {
        let found = model(weights);
        assert!(expected > 0.0 && (found - expected).abs() < 1e-6 * expected, "{name}: {found} {expected}");
    }
}

fn options(max_deviation: f64) -> Options {
    Options {
        energy: &ENERGIES[0],
        optimizer: Optimizer::Levenberg,
        max_deviation,
        fidelity: true,
        boundary: Boundary::Fair,
        features: Features::Free,
        facet: None,
        remesh: false,
        levels: Some(0),
        rounds: 2,
        iterations: None,
        overrides: Vec::new(),
    }
}

#[test]
fn the_promise_is_kept_and_nothing_folds() {
    let source = shapes::torus(1.0, 0.4, 24, 12);
    let start = shaken(&source, 0.01);
    for optimizer in [Optimizer::Lbfgs, Optimizer::Levenberg] {
        let options = Options { optimizer, levels: Some(1), ..options(0.05) };
        let out = develop(&source, &start, &options, &Monitor::silent()).unwrap();
        assert_eq!(out.mesh.face_count(), 4 * start.face_count());
        let deviation = Deviation::between(&source, &out.mesh, 0.05);
        assert!(deviation.worst.is_none() && deviation.bound <= 0.05, "{optimizer:?}: {deviation:?}");
        assert!(folded_edges(&out.mesh).is_empty());
        assert!(smallest_angle(&out.mesh).to_degrees() > 7.0);
        let (first, end) = (out.rounds[0].energy_start, out.energy.iter().sum::<f64>());
        assert!(end < 0.2 * first, "{optimizer:?}: {first} {end}");
    }
}

#[test]
fn an_interrupted_flow_goes_on_to_the_same_bytes() {
    let source = shapes::torus(1.0, 0.4, 12, 8);
    let start = shaken(&source, 0.01);
    // So tight that corrections are needed as well.
    let options = Options { levels: Some(1), iterations: Some(3), ..options(0.03) };
    let (kept, silent) = (std::cell::RefCell::new(Vec::new()), Monitor::silent());
    let whole =
        resume(&source, &start, &options, &[], &|rounds| *kept.borrow_mut() = rounds.to_vec(), &silent).unwrap();
    let kept = kept.into_inner();
    assert!(kept.len() == whole.rounds.len() && kept.len() > 4 && kept[4].correction, "{}", kept.len());
    for done in [0, 1, 3, 5, kept.len()] {
        let computed = std::cell::Cell::new(0);
        let count = |rounds: &[Round]| {
            computed.set(computed.get() + 1);
            assert_eq!(rounds.len(), done + computed.get(), "rounds that were done are not computed again");
        };
        assert_eq!(resume(&source, &start, &options, &kept[..done], &count, &silent).unwrap(), whole, "{done}");
        assert_eq!(computed.get(), kept.len() - done);
    }
}

#[test]
fn single_rounds_can_be_told_otherwise() {
    let source = ball();
    let energy = Energy::named("combinatorial");
    let overrides = vec![
        Override { iterations: Some(3), ..Override::default() },
        Override { level: Some(1), iterations: Some(2), ..Override::default() },
        Override { level: Some(1), round: Some(1), energy, ..Override::default() },
    ];
    let all = Options { levels: Some(1), optimizer: Optimizer::Auto, overrides, ..options(0.1) };
    let out = develop(&source, &source, &all, &Monitor::silent()).unwrap();
    let rounds: Vec<_> = out.rounds.iter().filter(|it| !it.correction).collect();
    let found: Vec<_> = rounds.iter().map(|it| (it.level, it.energy.as_str(), it.iterations)).collect();
    let covariance = "covariance";
    assert_eq!(found, [(0, covariance, 3), (1, covariance, 2), (1, "combinatorial", 2)]);
    let error = develop(&source, &source, &Options { optimizer: Optimizer::Levenberg, ..all }, &Monitor::silent());
    assert!(matches!(error, Err(DevelopError::NoCurvature { level: 1, round: 2, .. })), "{error:?}");
}

#[test]
fn folds_of_the_start_are_undone() {
    let source = shapes::torus(1.0, 0.4, 24, 12);
    let mut start = source.clone();
    // Pushes a vertex across its neighbour.
    let (v, w) = (VertexId(30), start.neighbors(VertexId(30)).next().unwrap());
    let target = start.position(v) + 1.4 * (start.position(w) - start.position(v));
    start.positions_mut()[v] = target;
    assert!(!folded_edges(&start).is_empty());
    let out = develop(&source, &start, &options(0.08), &Monitor::silent()).unwrap();
    assert!(folded_edges(&out.mesh).is_empty());
}

#[test]
fn the_flow_does_not_depend_on_the_number_of_threads() {
    let source = shapes::icosphere(1.0, 3);
    for optimizer in [Optimizer::Lbfgs, Optimizer::Levenberg] {
        let run = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let options = Options { optimizer, rounds: 1, ..options(0.03) };
            pool.install(|| develop(&source, &source, &options, &Monitor::silent()).unwrap())
        };
        assert_eq!(run(1), run(2), "{optimizer:?}");
    }
}

#[test]
fn what_needs_no_flow_is_returned_as_it_is() {
    let triangle =
        TriMesh::new([[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]].map(Vec3::from).to_vec(), &[[0, 1, 2]]).unwrap();
    // Bent, but with all vertices on the boundary.
    let zigzag = (0..10_u8).map(|i| Vec3::new(f64::from(i), f64::from(i % 2), f64::from(i % 3))).collect();
    let strip = TriMesh::new(
        zigzag,
        &std::array::from_fn::<_, 8, _>(|i| {
            let i = i as u32;
            if i.is_multiple_of(2) { [i, i + 1, i + 2] } else { [i + 1, i, i + 2] }
        }),
    )
    .unwrap();
    for mesh in ruled().into_iter().chain([triangle, strip]) {
        let out = develop(&mesh, &mesh, &options(0.01), &Monitor::silent()).unwrap();
        assert_eq!(out.mesh, mesh);
        assert_eq!(out.rounds[0].stopped, "developable already");
    }
}

#[test]
fn bad_starts_and_interruptions_are_told() {
    let source = ball();
    let mut start = source.clone();
    let [a, b, _] = start.face_vertices(FaceId::new(7));
    let target = start.position(a);
    start.positions_mut()[b] = target;
    let error = develop(&source, &start, &options(0.1), &Monitor::silent()).unwrap_err();
    assert!(matches!(error, DevelopError::Degenerate { .. }), "{error}");
    let stop = Monitor::new(&|| true, &|_, _| (), &|| 0.0);
    let error = develop(&source, &source, &options(0.1), &stop).unwrap_err();
    assert_eq!(error, DevelopError::Cancelled(Cancelled));
}

#[test]
fn crossings_of_the_result_are_told_from_those_of_the_source() {
    // Two tubes in one mesh, `gap` apart along x.
    let pair = |gap: f64| {
        let tube = shapes::cylinder(1.0, 2.0, 16, 3);
        let far = tube.positions().iter().map(|p| p + Vec3::new(gap, 0.01, 0.0));
        let positions = tube.positions().iter().copied().chain(far).collect();
        let mut faces = tube.face_indices();
        faces.extend(tube.face_indices().iter().map(|f| f.map(|v| v + tube.vertex_count() as u32)));
        TriMesh::new(positions, &faces).unwrap()
    };
    let inherited = Crossings::between(&pair(1.9), &pair(1.89), 0.05);
    assert!(inherited.of_source > 0 && inherited.of_result > 0 && inherited.made.is_empty(), "{inherited:?}");
    let made = Crossings::between(&pair(2.03), &pair(1.97), 0.05);
    assert!(made.of_source == 0 && made.of_result > 0 && made.made.len() == made.of_result, "{made:?}");
    let moved = Crossings::between(&pair(1.9), &pair(1.3), 0.05);
    assert!(!moved.made.is_empty() && moved.of_source > 0, "crossings elsewhere are not inherited");
}

#[test]
fn a_step_that_folds_an_edge_is_never_taken() {
    // Without the fold barrier, so that only the filter stands in the way: the objective falls, its value is infinite.
    let mesh = ball();
    let mut evaluator = Evaluator::new(&mesh, &ENERGIES[0], Weights::default());
    let (mut x, mut gradient) = (flatten(&mesh), vec![0.0; 3 * mesh.vertex_count()]);
    let symmetries = Default::default();
    let mut flow = flow::Flow::new(&mut evaluator, None, None, &mesh, &symmetries);
    assert!(flow.evaluate(&x, &mut gradient).is_finite());
    let (v, w) = (VertexId(50), mesh.neighbors(VertexId(50)).next().unwrap());
    let (from, along) = (mesh.position(v), mesh.position(w) - mesh.position(v));
    let mut at = |share: f64, flow: &mut flow::Flow| {
        x[3 * v.index()..][..3].copy_from_slice((from + along * share).as_slice());
        (flow.evaluate(&x, &mut gradient), x.clone())
    };
    assert!(at(0.5, &mut flow).0.is_finite());
    assert_eq!(at(1.5, &mut flow).0, f64::INFINITY, "the vertex went through its neighbour");
    // A start that is folded already may stay so, unfold, but not fold anew.
    let folded = at(1.5, &mut flow).1;
    let mut evaluator = Evaluator::new(&mesh, &ENERGIES[0], Weights::default());
    let symmetries = Default::default();
    let mut flow = flow::Flow::new(&mut evaluator, None, None, &mesh, &symmetries);
    let mut gradient = vec![0.0; folded.len()];
    assert!(flow.evaluate(&folded, &mut gradient).is_finite());
    assert!(flow.evaluate(&flatten(&mesh), &mut gradient).is_finite());
    flow.accepted(&flatten(&mesh));
    assert_eq!(flow.evaluate(&folded, &mut gradient), f64::INFINITY);
}

#[test]
fn the_robust_loss_has_the_gradient_of_differences_and_its_slope_in_the_curvature() {
    let mesh = shaken(&ball(), 0.1);
    let sigma = 0.02;
    for energy in ENERGIES.iter().filter(|it| !it.name.contains("max")) {
        let mut evaluator = Evaluator::new(&mesh, energy, Weights::default());
        evaluator.set_robust(Some(sigma));
        let (mut x, mut gradient) = (flatten(&mesh), vec![0.0; 3 * mesh.vertex_count()]);
        let parts = evaluator.evaluate(&x, &mut gradient);
        let expected: f64 = evaluator.energies().iter().map(|it| sigma * (1.0 + it / sigma).ln()).sum();
        assert!((parts.total() - expected).abs() < 1e-12 * expected && parts.total() < 0.9 * parts.energy);
        let largest = gradient.iter().fold(0.0_f64, |m, g| m.max(g.abs()));
        let mut unused = vec![0.0; x.len()];
        for i in 0..x.len() {
            let (here, h) = (x[i], 2e-6);
            let mut at = |x_i: f64| {
                x[i] = x_i;
                evaluator.evaluate(&x, &mut unused).total()
            };
            let difference = (at(here + h) - at(here - h)) / (2.0 * h);
            x[i] = here;
            assert!((difference - gradient[i]).abs() < 1e-6 * largest, "{energy:?} {i}: {difference} {}", gradient[i]);
        }
    }
    // With σ far above every λ the loss is the energy, and with one star, scaling by ρ′ is all there is to the model.
    let assembled = |sigma: Option<f64>| {
        let mut evaluator = Evaluator::new(&mesh, &ENERGIES[0], Weights::default());
        evaluator.set_robust(sigma);
        let curvature = Curvature::new(&mesh, &[]).unwrap();
        let mut hessian = curvature.matrix();
        curvature.assemble(&mesh, &evaluator, None, &mut hessian);
        let v = direction(3 * mesh.vertex_count());
        dot(&v, &hessian.multiply(&v))
    };
    let (plain, weak, strong) = (assembled(None), assembled(Some(1e9)), assembled(Some(sigma)));
    assert!((plain - weak).abs() < 1e-6 * plain && strong < 0.9 * plain && strong > 0.0, "{plain} {weak} {strong}");
}

#[test]
fn boundaries_become_fair_and_held_ones_stay() {
    let mut source = shaken(&shapes::annulus(0.5, 1.0, 48, 6), 0.003);
    // A dome, so that there is something to develop.
    source.positions_mut().as_mut_slice().iter_mut().for_each(|p| p.z += 0.5 * (1.0 - p.x * p.x - p.y * p.y));
    let jags = |mesh: &TriMesh| Network::boundary(mesh).jaggedness(mesh).unwrap();
    let run = |boundary: Boundary| {
        let options = Options { boundary, ..options(0.04) };
        develop(&source, &source, &options, &Monitor::silent()).unwrap().mesh
    };
    let (free, fair, hold) = (run(Boundary::Free), run(Boundary::Fair), run(Boundary::Hold));
    assert!(jags(&fair) < 0.5 * jags(&free), "{} {}", jags(&fair), jags(&free));
    let networks = [&source, &hold].map(Network::boundary);
    let bounds = networks[0].distance(&source, (&networks[1], &hold), 0.01, &Monitor::silent()).unwrap().unwrap();
    assert!(bounds.upper <= 0.04, "{bounds:?}");
    assert!(jags(&hold) < jags(&source), "{} {}", jags(&hold), jags(&source));
}

/// Between the images of the vertices in the plane x = 0 and the nearest vertex, at most.
fn asymmetry(mesh: &TriMesh) -> f64 {
    let positions = mesh.positions().as_slice();
    let mirrored = |p: &Vec3| Vec3::new(-p.x, p.y, p.z);
    let nearest = |p: Vec3| positions.iter().map(|q| (p - q).norm()).fold(f64::INFINITY, f64::min);
    positions.iter().map(|p| nearest(mirrored(p))).fold(0.0, f64::max)
}

#[test]
fn a_mirror_plane_of_the_input_is_one_of_the_result() {
    let mesh = shapes::icosphere(50.0, 2);
    assert!(asymmetry(&mesh) < 1e-12);
    let result = develop(&mesh, &mesh, &options(1.0), &Monitor::silent()).unwrap();
    assert!(result.energy.iter().sum::<f64>() < 0.5 * energies(&mesh, &energy::COVARIANCE).iter().sum::<f64>());
    assert!(asymmetry(&result.mesh) < 1e-9, "{:e} mm", asymmetry(&result.mesh));
}
