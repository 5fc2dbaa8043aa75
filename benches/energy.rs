//! Cost of every developability energy with its gradient, beside a calibration kernel.
//!
//! `cargo bench --bench energy`. Items are vertices, so the reciprocal of the throughput is the cost per vertex; the
//! calibration does one square root, one division and one multiplication per item and tells how fast the machine is now.
use divan::{Bencher, black_box, counter::ItemsCount};
use fabricate::{
    mesh::{TriMesh, shapes},
    numeric::Monitor,
    stages::develop::{Evaluator, Optimizer, Options, Weights, develop, energy::ENERGIES},
};

fn main() {
    // The cost is that of one core.
    rayon::ThreadPoolBuilder::new().num_threads(1).build_global().expect("nothing has used the pool before");
    divan::main();
}

/// A torus of 3 300 vertices, bumpy enough that no star is degenerate.
fn bumpy() -> TriMesh {
    let mut mesh = shapes::torus(10.0, 4.0, 66, 50);
    for (i, p) in mesh.positions_mut().as_mut_slice().iter_mut().enumerate() {
        *p *= 1.0 + 0.01 * (12.9898 * i as f64).sin();
    }
    mesh
}

fn coordinates(mesh: &TriMesh) -> Vec<f64> {
    mesh.positions().iter().flat_map(|p| [p.x, p.y, p.z]).collect()
}

#[divan::bench]
fn calibration(bencher: Bencher) {
    let x: Vec<f64> = (1..=3300).map(f64::from).collect();
    bencher
        .counter(ItemsCount::new(x.len()))
        .bench_local(|| black_box(&x).iter().map(|x| 1.0 / x.sqrt() * x).fold(0.0, |a, b| a + b));
}

#[divan::bench(args = ENERGIES.iter().map(|it| it.name))]
fn energy_and_gradient(bencher: Bencher, name: &str) {
    evaluate(bencher, name, Weights::default());
}

#[divan::bench]
fn covariance_with_barriers(bencher: Bencher) {
    evaluate(bencher, "covariance", Weights { angle: 3e-4, fold: 0.01, defect: 0.1, area: 1e-4 });
}

fn evaluate(bencher: Bencher, name: &str, weights: Weights) {
    let mesh = bumpy();
    let energy = ENERGIES.iter().find(|it| it.name == name).expect("an energy of the list");
    let (mut evaluator, x) = (Evaluator::new(&mesh, energy, weights), coordinates(&mesh));
    let mut gradient = vec![0.0; x.len()];
    bencher
        .counter(ItemsCount::new(mesh.vertex_count()))
        .bench_local(|| evaluator.evaluate(black_box(&x), &mut gradient));
}

#[divan::bench(args = ["lbfgs", "levenberg"], sample_count = 3)]
fn twenty_steps(bencher: Bencher, optimizer: &str) {
    let mesh = bumpy();
    let options = Options {
        energy: &ENERGIES[0],
        optimizer: if optimizer == "lbfgs" { Optimizer::Lbfgs } else { Optimizer::Levenberg },
        max_deviation: 0.3,
        fidelity: false,
        levels: Some(0),
        rounds: 1,
        iterations: Some(20),
    };
    bencher.bench_local(|| develop(&mesh, &mesh, &options, &Monitor::silent()));
}
