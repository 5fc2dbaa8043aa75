//! Time of coarsening per face of the input: `cargo bench --bench coarsen [-- mesh files]`.
//!
//! Every run is taken between two samples of a calibration kernel (closest points on the input, which is most of what
//! coarsening does), so that a machine that is busy or slow at the moment shows. Least of all runs.
#![allow(clippy::print_stdout)]
mod meshes;

use fabricate::{
    mesh::{Bvh, TriMesh, distance::sample, shapes},
    numeric::Monitor,
    stages::coarsen::{Density, IsotropicOptions, QuadricOptions, remesh, simplify},
};
use std::{f64::consts::PI, hint::black_box, time::Instant};

const RUNS: usize = 5;
/// Queries of the calibration kernel.
const QUERIES: usize = 20_000;
const FACES: usize = 6000;
const MAX_ERROR: f64 = 4e-3;
const FEATURE_ANGLE: f64 = 40.0 * PI / 180.0;

fn main() {
    let mut meshes: Vec<(String, TriMesh)> = meshes::words().map(|path| meshes::load(&path)).collect();
    if meshes.is_empty() {
        meshes.push(("torus".into(), shapes::torus(30.0, 10.0, 300, 150)));
        meshes.push(("sphere".into(), shapes::icosphere(10.0, 6)));
    }
    println!("one core, least of {RUNS} runs; one query = a closest point on the input");
    println!(
        "{:22}{:>9}{:>22}{:>9}{:>9}{:>14}{:>11}",
        "mesh", "faces", "method", "left", "s", "µs per face", "queries"
    );
    for (name, mesh) in &meshes {
        let error = Some(MAX_ERROR * mesh.bounds().diagonal());
        for (method, max_error) in [("quadric", None), ("isotropic", None), ("isotropic 0.4 %", error)] {
            let run = || coarsen(mesh, method == "quadric", max_error);
            let (least, query, left) = measure(mesh, run);
            let faces = mesh.face_count();
            let each = least / faces as f64;
            println!("{name:22}{faces:>9}{method:>22}{left:>9}{least:>9.3}{:>14.2}{:>11.1}", each * 1e6, each / query);
        }
    }
}

fn coarsen(mesh: &TriMesh, quadric: bool, max_error: Option<f64>) -> TriMesh {
    let (feature_angle, monitor) = (FEATURE_ANGLE, Monitor::silent());
    let result = if quadric {
        simplify(mesh, &QuadricOptions { faces: Some(FACES), max_error, feature_angle }, &monitor)
    } else {
        remesh(mesh, &IsotropicOptions { density: Density::Faces(FACES), max_error, feature_angle }, &monitor)
    };
    result.unwrap_or_else(|error| panic!("{error}"))
}

/// Seconds of a run, seconds of a query, faces left.
fn measure(mesh: &TriMesh, run: impl Fn() -> TriMesh + Send + Sync) -> (f64, f64, usize) {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread can be started");
    let bvh = Bvh::new(mesh);
    // A little above the surface, and in no order that helps.
    let lift = 1e-3 * mesh.bounds().diagonal();
    let mut points: Vec<_> =
        sample(mesh, QUERIES).iter().map(|it| it.position(mesh) + mesh.normal(it.face) * lift).collect();
    points.sort_by_key(|p| p.x.to_bits().wrapping_mul(0x9E37_79B9_7F4A_7C15));
    pool.install(|| {
        let (mut least, mut query, mut left) = (f64::INFINITY, f64::INFINITY, 0);
        for _ in 0..RUNS {
            let start = Instant::now();
            for &p in &points {
                black_box(bvh.closest(black_box(p)));
            }
            query = query.min(start.elapsed().as_secs_f64() / points.len() as f64);
            let start = Instant::now();
            left = black_box(run()).face_count();
            least = least.min(start.elapsed().as_secs_f64());
        }
        (least, query, left)
    })
}
