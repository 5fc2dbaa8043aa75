//! The developability energies on the fixtures: exact gradients, none on developable meshes, no dependence on place and size.
use fabricate::{
    geom::Vec3,
    mesh::{Field, Id, TriMesh, VertexId},
    numeric::random::Random,
    stages::develop::{
        Evaluator, Weights,
        energy::{ENERGIES, Energy},
    },
};
use rayon::prelude::*;
use std::collections::BTreeMap;

use crate::fixtures::good;

/// Fixtures with curvature, and those that are developable and meshed along their rulings.
const CURVED: [&str; 8] = [
    "figure.obj",
    "vase.obj",
    "torus.obj",
    "double-torus.obj",
    "bumpy.obj",
    "rounded-cube.obj",
    "ball.stl",
    "ball.ply",
];
const DEVELOPABLE: [&str; 3] = ["cylinder.obj", "cone.obj", "tangent-developable.obj"];

fn coordinates(mesh: &TriMesh) -> Vec<f64> {
    mesh.positions().iter().flat_map(|p| [p.x, p.y, p.z]).collect()
}

fn moved(mesh: &TriMesh, map: impl FnMut(&Vec3) -> Vec3) -> TriMesh {
    mesh.with_positions(Field::from_vec(mesh.positions().iter().map(map).collect()))
}

/// Energy and gradient.
fn evaluate(mesh: &TriMesh, energy: &'static Energy) -> (f64, Vec<f64>) {
    let x = coordinates(mesh);
    let mut gradient = vec![0.0; x.len()];
    (Evaluator::new(mesh, energy, Weights::default()).evaluate(&x, &mut gradient).energy, gradient)
}

fn norm(v: &[f64]) -> f64 {
    v.iter().map(|c| c * c).sum::<f64>().sqrt()
}

/// The faces around a vertex and its neighbours, in a unit of their mean edge, and the vertex in that mesh: whatever of the
/// energy depends on the vertex is there.
fn neighborhood(mesh: &TriMesh, v: VertexId) -> Option<(TriMesh, VertexId)> {
    let mut faces: Vec<_> = std::iter::once(v)
        .chain(mesh.neighbors(v))
        .flat_map(|w| mesh.outgoing(w).map(|h| mesh.face(h)).collect::<Vec<_>>())
        .collect();
    faces.sort_unstable();
    faces.dedup();
    let (mut ids, mut points) = (BTreeMap::new(), Vec::new());
    let mut corner = |w: VertexId| {
        *ids.entry(w).or_insert_with(|| {
            points.push(mesh.position(w) - mesh.position(v));
            points.len() as u32 - 1
        })
    };
    let center = VertexId(corner(v));
    let faces: Vec<_> = faces.into_iter().map(|f| mesh.face_vertices(f).map(&mut corner)).collect();
    // Where the faces around the neighbours touch elsewhere, they are no manifold by themselves.
    let patch = TriMesh::new(points, &faces).ok()?;
    let unit = 1.0 / patch.mean_edge_length();
    Some((moved(&patch, |p| p * unit), center))
}

/// Derivatives of the energy by the position of a vertex.
struct Slopes {
    /// As given.
    exact: [f64; 3],
    /// Central differences of fourth order, summed star by star so that stars that do not move cancel exactly.
    differences: [f64; 3],
    /// Whether the energy has a kink within the steps.
    kink: bool,
}

fn slopes(patch: &TriMesh, v: VertexId, energy: &'static Energy) -> Slopes {
    const STEP: f64 = 5e-5;
    let mut evaluator = Evaluator::new(patch, energy, Weights::default());
    let mut x = coordinates(patch);
    let mut gradient = vec![0.0; x.len()];
    evaluator.evaluate(&x, &mut gradient);
    let (first, here) = (3 * v.index(), evaluator.energies());
    let exact = std::array::from_fn(|c| gradient[first + c]);
    let scale = norm(&exact) + 1e-3;
    let (mut differences, mut kink) = ([0.0; 3], false);
    for c in 0..3 {
        let at = x[first + c];
        // Forward and backward.
        let [wide, middle, narrow] = [STEP, 0.5 * STEP, 0.25 * STEP].map(|step| {
            [step, -step].map(|t| {
                x[first + c] = at + t;
                evaluator.evaluate(&x, &mut gradient);
                evaluator.energies().iter().zip(&here).map(|(a, b)| a - b).sum::<f64>() / t
            })
        });
        x[first + c] = at;
        let slope = |[a, b]: [f64; 2]| 0.5 * (a + b);
        let rough = (4.0 * slope(middle) - slope(wide)) / 3.0;
        differences[c] = (4.0 * slope(narrow) - slope(middle)) / 3.0;
        // The two sides differ in proportion to the step where the energy is smooth, by a constant at a kink.
        let jump = |[a, b]: [f64; 2]| (a - b).abs();
        kink |= jump(narrow) > 0.5 * jump(wide) + 1e-6 * scale || (rough - differences[c]).abs() > 1e-6 * scale;
    }
    Slopes { exact, differences, kink }
}

/// What [`compare`] found.
struct Found {
    /// Norm of the errors over that of the gradients.
    error: f64,
    vertices: usize,
    /// Vertices on a kink of the energy, measured after a perturbation.
    perturbed: usize,
}

/// Holds the gradients of up to `COUNT` vertices against differences. A vertex with ties, recognised by the values of the
/// energy alone, is perturbed with its neighbours first.
fn compare(mesh: &TriMesh, energy: &'static Energy) -> Found {
    const COUNT: usize = 300;
    const PERTURBATION: f64 = 0.02;
    const TRIES: usize = 5;
    let mut random = Random::new(3);
    let (mut wrong, mut right, mut perturbed, mut vertices) = (0.0, 0.0, 0, 0);
    for v in mesh.vertices().step_by(mesh.vertex_count().div_ceil(COUNT)) {
        let Some((mut patch, center)) = neighborhood(mesh, v) else { continue };
        vertices += 1;
        for attempt in 0..=TRIES {
            assert!(attempt < TRIES, "{energy:?}: vertex {v} stays on a kink");
            let Slopes { exact, differences, kink } = slopes(&patch, center, energy);
            if !kink {
                wrong += (0..3).map(|c| (differences[c] - exact[c]).powi(2)).sum::<f64>();
                right += exact.iter().map(|it| it * it).sum::<f64>();
                break;
            }
            perturbed += usize::from(attempt == 0);
            let mut shift = || PERTURBATION * (2.0 * random.unit() - 1.0);
            patch = moved(&patch, |p| p + Vec3::new(shift(), shift(), shift()));
        }
    }
    Found { error: (wrong / right).sqrt(), vertices, perturbed }
}

/// Every energy with every mesh.
fn pairs<'a>(meshes: &'a [(&'static str, TriMesh)]) -> Vec<(&'static Energy, &'static str, &'a TriMesh)> {
    ENERGIES.iter().flat_map(|energy| meshes.iter().map(move |(name, mesh)| (energy, *name, mesh))).collect()
}

#[test]
fn gradients_on_the_fixtures_are_those_of_central_differences() {
    let noise = |mesh: TriMesh| {
        let (mut random, size) = (Random::new(5), 0.02 * mesh.mean_edge_length());
        let mut shift = || size * (2.0 * random.unit() - 1.0);
        moved(&mesh, |p| p + Vec3::new(shift(), shift(), shift()))
    };
    // A developable mesh has no gradient to compare: it is shaken as a whole.
    let meshes: Vec<_> = CURVED
        .into_iter()
        .map(|name| (name, good(name)))
        .chain(DEVELOPABLE.into_iter().map(|name| (name, noise(good(name)))))
        .collect();
    let wrong: Vec<String> = pairs(&meshes)
        .into_par_iter()
        .filter_map(|(energy, name, mesh)| {
            let Found { error, vertices, perturbed } = compare(mesh, energy);
            let line = format!("{energy:?}, {name}: {error:.1e}, {perturbed} of {vertices} vertices perturbed");
            // Shown by `cargo test -- --nocapture`.
            println!("{line}");
            (!(error <= 1e-7) || vertices < 100).then_some(line)
        })
        .collect();
    assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
}

#[test]
fn developable_fixtures_have_no_energy_and_no_gradient() {
    for name in DEVELOPABLE {
        let mesh = good(name);
        let unit = 1.0 / mesh.mean_edge_length();
        let mesh = moved(&mesh, |p| p * unit);
        for energy in ENERGIES {
            let (value, gradient) = evaluate(&mesh, energy);
            // The files keep twelve digits, of which the narrow triangles at the tip of the cone leave ten to the normals.
            assert!(value <= 1e-17, "{energy:?}, {name}: {value:e}");
            assert!(norm(&gradient) <= 1e-7, "{energy:?}, {name}: {:e}", norm(&gradient));
        }
    }
}

#[test]
fn energies_of_the_fixtures_do_not_depend_on_place_and_size() {
    const SCALE: f64 = 7.5;
    let turn = nalgebra::Rotation3::from_euler_angles(0.3, -1.1, 2.0);
    let meshes: Vec<_> = CURVED.into_iter().map(|name| (name, good(name))).collect();
    pairs(&meshes).into_par_iter().for_each(|(energy, name, mesh)| {
        let unit = 1.0 / mesh.mean_edge_length();
        // Away from ties, where rounding picks one of several subgradients.
        let mut random = Random::new(9);
        let mut shift = || 0.05 * (2.0 * random.unit() - 1.0);
        let mesh = moved(mesh, |p| p * unit + Vec3::new(shift(), shift(), shift()));
        let (value, gradient) = evaluate(&mesh, energy);
        let image = moved(&mesh, |p| turn * p * SCALE + Vec3::new(3.0, -20.0, 11.0));
        let (moved_value, moved_gradient) = evaluate(&image, energy);
        assert!((moved_value - value).abs() <= 1e-12 * value, "{energy:?}, {name}: {value} {moved_value}");
        let pairs = gradient.as_chunks::<3>().0.iter().zip(moved_gradient.as_chunks::<3>().0);
        let errors: Vec<f64> =
            pairs.flat_map(|(g, k)| (turn * Vec3::from(*g) / SCALE - Vec3::from(*k)).data.0[0]).collect();
        assert!(norm(&errors) <= 1e-10 * norm(&moved_gradient), "{energy:?}, {name}: {:e}", norm(&errors));
    });
}
