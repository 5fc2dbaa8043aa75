//! How long each optimiser of the develop stage takes to bring the energy of a mesh below given values, without fidelity:
//! `cargo bench --bench descent -- MESH [ENERGY…]`, energies in falling order. Without a mesh, a bumpy sphere.
//!
//! On one core. A first run of each optimiser finds the step at which each value is reached; the clock runs in others (of
//! the same steps, as they are deterministic), where nothing else is done. Seconds are those that the thread was running
//! (Linux; elsewhere, those that passed), counted from the call of `develop`, its preparations included; median of some runs.
#![allow(clippy::print_stdout)]
mod meshes;

use fabricate::{
    mesh::{Field, TriMesh, shapes},
    numeric::Monitor,
    stages::develop::{
        Boundary, Defects, Evaluator, Features, Optimizer, Options, Weights, develop, energy::COVARIANCE, folded_edges,
        smallest_angle,
    },
};
use std::{
    fs,
    sync::{
        Mutex,
        atomic::{AtomicUsize, Ordering},
    },
    time::Instant,
};

/// Timed runs of each optimiser.
const RUNS: usize = 5;
/// Most steps of an optimiser.
const STEPS: usize = 5000;
/// Energies to reach if none are given, those of the design's comparison.
const TARGETS: [f64; 6] = [20.0, 10.0, 6.67, 4.0, 2.0, 1.0];
const OPTIMIZERS: [(&str, Optimizer); 4] = [
    ("lbfgs-h2", Optimizer::LbfgsH2),
    ("levenberg", Optimizer::Levenberg),
    ("lbfgs", Optimizer::Lbfgs),
    ("subgradient", Optimizer::Subgradient),
];

/// When and how an energy was reached.
struct Reached {
    step: usize,
    energy: f64,
    mesh: TriMesh,
}

fn main() {
    let mut args = meshes::words();
    let mesh = args.next().map_or_else(bumpy, |path| meshes::load(&path).1);
    let mut targets: Vec<f64> = args.map(|it| it.parse().unwrap_or_else(|error| panic!("{it}: {error}"))).collect();
    if targets.is_empty() {
        targets.extend(TARGETS);
    }
    let energy = Evaluator::new(&mesh, &COVARIANCE, Weights::default())
        .evaluate(&coordinates(&mesh), &mut vec![0.0; 3 * mesh.vertex_count()])
        .energy;
    println!("{} vertices, energy {energy:.3}; seconds are the median of {RUNS} runs on one core", mesh.vertex_count());
    println!(
        "{:12}{:>8}{:>10}{:>8}{:>10}{:>8}{:>12}{:>10}",
        "optimizer", "below", "seconds", "steps", "energy", "folds", "angle, deg", "|defect|"
    );
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread can be started");
    for (name, optimizer) in OPTIMIZERS {
        let reached = pool.install(|| follow(&mesh, optimizer, &targets));
        let steps: Vec<usize> = reached.iter().map(|it| it.step).collect();
        let mut runs: Vec<Vec<f64>> = (0..RUNS).map(|_| pool.install(|| time(&mesh, optimizer, &steps))).collect();
        for (k, &target) in targets.iter().enumerate() {
            let Some(it) = reached.get(k) else {
                println!("{name:12}{target:>8}{:>10}", "never");
                continue;
            };
            runs.sort_by(|a, b| a[k].total_cmp(&b[k]));
            println!(
                "{name:12}{target:>8}{:>10.3}{:>8}{:>10.3}{:>8}{:>12.2}{:>10.2}",
                runs[RUNS / 2][k],
                it.step,
                it.energy,
                folded_edges(&it.mesh).len(),
                smallest_angle(&it.mesh).to_degrees(),
                Defects::of(&it.mesh).max,
            );
        }
    }
}

/// Runs the stage on a mesh until `done` says so; `step` hears of the coordinates after every step.
fn run(mesh: &TriMesh, optimizer: Optimizer, done: &(dyn Fn() -> bool + Sync), step: &(dyn Fn(&[f64]) + Sync)) {
    let options = Options {
        energy: &COVARIANCE,
        optimizer,
        max_deviation: f64::INFINITY,
        fidelity: false,
        boundary: Boundary::Free,
        features: Features::Free,
        facet: None,
        remesh: false,
        levels: Some(0),
        rounds: 1,
        iterations: Some(STEPS),
        overrides: Vec::new(),
    };
    let monitor = Monitor::new(done, &|_, _| (), &|| 0.0).watching(step);
    // Cancelled by `done`, or out of steps.
    let _ = develop(mesh, mesh, &options, &monitor);
}

/// The steps at which the energy first lies below each target, as far as it gets.
fn follow(mesh: &TriMesh, optimizer: Optimizer, targets: &[f64]) -> Vec<Reached> {
    struct State {
        evaluator: Evaluator,
        gradient: Vec<f64>,
        step: usize,
        reached: Vec<Reached>,
    }
    let state = Mutex::new(State {
        evaluator: Evaluator::new(mesh, &COVARIANCE, Weights::default()),
        gradient: vec![0.0; 3 * mesh.vertex_count()],
        step: 0,
        reached: Vec::new(),
    });
    let lock = || state.lock().expect("no holder of the lock panics");
    run(mesh, optimizer, &|| lock().reached.len() == targets.len(), &|x| {
        let State { evaluator, gradient, step, reached } = &mut *lock();
        *step += 1;
        let energy = evaluator.evaluate(x, gradient).energy;
        while targets.get(reached.len()).is_some_and(|&target| energy < target) {
            let positions = x.as_chunks::<3>().0.iter().map(|&p| p.into()).collect();
            reached.push(Reached { step: *step, energy, mesh: mesh.with_positions(Field::from_vec(positions)) });
        }
    });
    state.into_inner().expect("no holder of the lock panics").reached
}

/// Seconds until each of `steps` is done.
fn time(mesh: &TriMesh, optimizer: Optimizer, steps: &[usize]) -> Vec<f64> {
    let (step, times) = (AtomicUsize::new(0), Mutex::new(Vec::new()));
    let start = Clock::now();
    let last = steps.last().copied().unwrap_or(0);
    run(mesh, optimizer, &|| step.load(Ordering::Relaxed) >= last, &|_| {
        let now = 1 + step.fetch_add(1, Ordering::Relaxed);
        for _ in steps.iter().filter(|&&it| it == now) {
            times.lock().expect("no holder of the lock panics").push(start.seconds());
        }
    });
    times.into_inner().expect("no holder of the lock panics")
}

/// Counts the seconds in which this thread runs, if the system says.
struct Clock {
    passed: Instant,
    running: Option<f64>,
}

impl Clock {
    fn now() -> Self {
        Self { passed: Instant::now(), running: running() }
    }

    fn seconds(&self) -> f64 {
        let of_thread = self.running.and_then(|before| Some(running()? - before));
        of_thread.unwrap_or_else(|| self.passed.elapsed().as_secs_f64())
    }
}

/// Seconds that this thread has been running, known to a tick of the scheduler.
fn running() -> Option<f64> {
    let text = fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    text.split_whitespace().next()?.parse::<f64>().ok().map(|nanoseconds| nanoseconds * 1e-9)
}

fn coordinates(mesh: &TriMesh) -> Vec<f64> {
    mesh.positions().iter().flat_map(|p| [p.x, p.y, p.z]).collect()
}

fn bumpy() -> TriMesh {
    let mut mesh = shapes::icosphere(1.0, 4);
    for p in mesh.positions_mut().as_mut_slice() {
        *p *= 1.0 + 0.2 * (4.0 * p.x).sin() * (3.0 * p.y + 1.0).cos() + 0.1 * (5.0 * p.z).sin();
    }
    mesh
}
