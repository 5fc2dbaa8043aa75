//! Time of each developability energy with its gradient, per vertex: `cargo bench --bench energy [-- mesh files]`.
//!
//! Every sample of an energy is taken between two samples of a calibration kernel (dependent multiplications and
//! additions, bound by the clock alone), so that a machine that is busy or slow at the moment shows. Medians of all samples.
#![allow(clippy::print_stdout)]
mod meshes;

use fabricate::{
    mesh::{TriMesh, shapes},
    stages::develop::{
        Evaluator, Weights,
        energy::{COMPARISONS, ENERGIES, Energy},
    },
};
use std::{hint::black_box, time::Instant};

const SAMPLES: usize = 400;
/// Shortest sample, seconds.
const SAMPLE: f64 = 2e-4;
const CHAIN: usize = 20_000;

fn main() {
    let mut meshes: Vec<(String, TriMesh)> = meshes::words().map(|path| meshes::load(&path)).collect();
    if meshes.is_empty() {
        meshes.push(("torus".into(), shaken(shapes::torus(3.0, 1.0, 96, 48))));
        meshes.push(("sphere".into(), shaken(shapes::icosphere(1.0, 4))));
    }
    println!("energy + gradient, µs per vertex, median of {SAMPLES} (least); clock: ns per dependent multiply and add");
    println!("{:20}{:20}{:>18}{:>18}{:>10}{:>8}", "mesh", "energy", "one core", "two cores", "speed-up", "clock");
    for (name, mesh) in &meshes {
        for energy in ENERGIES.iter().chain(COMPARISONS) {
            let [one, two] = [1, 2].map(|threads| measure(mesh, energy, threads));
            let show = |it: &Figures| format!("{:.3} ({:.3})", it.median, it.least);
            let ratio = one.median / two.median;
            println!("{name:20}{:20}{:>18}{:>18}{ratio:>10.2}{:>8.2}", energy.name, show(&one), show(&two), one.clock);
        }
    }
}

struct Figures {
    median: f64,
    least: f64,
    clock: f64,
}

fn measure(mesh: &TriMesh, energy: &'static Energy, threads: usize) -> Figures {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads can be started");
    pool.install(|| {
        let mut evaluator = Evaluator::new(mesh, energy, Weights::default());
        let x: Vec<f64> = mesh.positions().iter().flat_map(|p| [p.x, p.y, p.z]).collect();
        let mut gradient = vec![0.0; x.len()];
        let once = Instant::now();
        evaluator.evaluate(&x, &mut gradient);
        let repeat = (SAMPLE / once.elapsed().as_secs_f64()).ceil().max(1.0) as usize;
        let (mut times, mut clocks) = (Vec::new(), Vec::new());
        for _ in 0..SAMPLES {
            clocks.push(chain());
            let start = Instant::now();
            for _ in 0..repeat {
                black_box(evaluator.evaluate(black_box(&x), &mut gradient));
            }
            times.push(start.elapsed().as_secs_f64() / (repeat * mesh.vertex_count()) as f64 * 1e6);
        }
        times.sort_by(f64::total_cmp);
        clocks.sort_by(f64::total_cmp);
        Figures { median: times[SAMPLES / 2], least: times[0], clock: clocks[SAMPLES / 2] }
    })
}

/// Nanoseconds per link of a chain of dependent multiplications and additions.
fn chain() -> f64 {
    let start = Instant::now();
    let mut x = black_box(0.5);
    for _ in 0..CHAIN {
        x = x * 0.999 + 0.001;
    }
    black_box(x);
    start.elapsed().as_secs_f64() / CHAIN as f64 * 1e9
}

/// Without the symmetry that would make every star a tie.
fn shaken(mut mesh: TriMesh) -> TriMesh {
    let size = 0.05 * mesh.mean_edge_length();
    for (i, p) in mesh.positions_mut().as_mut_slice().iter_mut().enumerate() {
        for (k, c) in p.iter_mut().enumerate() {
            *c += size * (((3 * i + k) as f64) * 12.9898).sin();
        }
    }
    mesh
}
