//! Figures and time of the strips of whole models, on one thread: `cargo bench --bench strips -- mesh.obj …`.
//!
//! Meshes are taken as they are (give developed ones), cut for a stretch of 0.5 %, and flattened. `cut.obj` of a job
//! gives nothing else than its `developed.obj`. The chord tolerance is 0.1 % of the diagonal. The last column is the time
//! of the strips in shares of that of cutting.
#![allow(clippy::print_stdout)]
mod cutting;
mod meshes;

use fabricate::{
    numeric::Monitor,
    stages::{
        cut::cut,
        flatten::flatten,
        strips::{Options, Spacing, measure::quality, strips},
    },
};
use std::time::Instant;

fn main() {
    println!(
        "{:16}{:>7}{:>7}{:>8}{:>8}{:>8}{:>7}{:>8}{:>9}{:>9}{:>9}{:>8}{:>8}{:>7}{:>9}{:>9}{:>9}{:>8}",
        "mesh",
        "pieces",
        "failed",
        "rulings",
        "quads",
        "panels",
        "cross",
        "covered",
        "plan 99",
        "plan max",
        "mean %",
        "max %",
        "normal",
        "V",
        "chord",
        "stretch",
        "ms",
        "of cut"
    );
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread can be started");
    for path in meshes::words() {
        pool.install(|| row(&path));
    }
}

fn row(path: &str) {
    let fail = |error: &dyn std::fmt::Display| -> ! { panic!("{path}: {error}") };
    let (name, mesh) = meshes::load(path);
    let diagonal = mesh.bounds().diagonal();
    let input = cutting::developable(mesh);
    let options = cutting::options(0.005);
    let start = Instant::now();
    let cut = cut(&input, &options, &Monitor::silent()).unwrap_or_else(|error| fail(&error));
    let cutting = start.elapsed().as_secs_f64();
    let flat = flatten(&cut, &cutting::flat(), &Monitor::silent()).unwrap_or_else(|error| fail(&error));
    let options = Options { spacing: Spacing::Tolerance(1e-3 * diagonal), planarity: 0.003, fold_angle: 0.5 };
    let start = Instant::now();
    let out = strips(&cut, &flat, &options, &Monitor::silent()).unwrap_or_else(|error| fail(&error));
    let seconds = start.elapsed().as_secs_f64();
    let it = quality(&cut, &flat, &out);
    print!("{name:16}{:>7}{:>7}", cut.pieces.len(), it.unsolved.len() + it.unreliable.len());
    print!("{:>8}{:>8.3}{:>8.3}", out.rulings.len(), it.area_shares[0], it.panel_share);
    print!("{:>4}{:>3}{:>8.4}{:>9.4}", it.interleaved, it.crossings, it.covered_share, it.planarity_p99);
    let percent = 100.0 / diagonal;
    print!("{:>9.4}{:>9.3}{:>8.3}", it.planarity_max, it.distance.mean * percent, it.distance.hausdorff * percent);
    print!(
        "{:>8.2}{:>7}{:>9.5}{:>9.5}",
        it.normal_error.to_degrees(),
        it.shared_ends,
        it.chord_error,
        it.stretch_error
    );
    println!("{:>9.0}{:>8.2}", 1e3 * seconds, seconds / cutting);
}
