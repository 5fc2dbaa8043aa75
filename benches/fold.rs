//! Time of the solver for curved folding on one thread: `cargo bench --bench fold` folds a square sheet with one circular crease
//! by its corners, with nets of about 500, 1 000, 2 000 and 4 000 vertices.
//!
//! `ms` is the time of an iteration (Jacobian, factor, solve with refinement, line search), the mean over all of a short run.
#![allow(clippy::print_stdout)]
use std::time::Instant;

use fabricate::{
    geom::{
        Vec2,
        arrangement::{Arrangement, Curve},
    },
    mesh::paper,
    model::{BORDER, CreasePattern, UNASSIGNED},
    numeric::Monitor,
    stages::fold::{Options, Resolution, fold, motion::Motion, solve},
};

fn main() {
    let corner = |x, y| Vec2::new(x, y);
    let border = vec![corner(0.0, 0.0), corner(200.0, 0.0), corner(200.0, 200.0), corner(0.0, 200.0)];
    let crease = (0..=400).map(|k| f64::from(k) * 0.5).map(|x| {
        let height = (150.0_f64.powi(2) - (x - 100.0).powi(2)).sqrt();
        Vec2::new(x, height - 32.0)
    });
    let curves = [
        Curve { points: border, closed: true, kind: BORDER },
        Curve { points: crease.collect(), closed: false, kind: UNASSIGNED },
    ];
    let divided = Arrangement::new(&curves, 1e-3, &|it| it != BORDER).expect("the curves are finite");
    let pattern = CreasePattern::new(&divided);
    let sheet = paper(&curves, BORDER, 10.0).expect("the sheet is a square");
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread can be started");
    println!("{:>9}{:>12}{:>9}", "vertices", "iterations", "ms");
    for count in [500, 1000, 2000, 4000] {
        let options = Options {
            resolution: Resolution::Vertices(count),
            pulls: Motion::LiftCorners.pulls(&pattern, 1.0),
            sides: Vec::new(),
            kept_frames: 1,
            solver: solve::Options { frames: 5, settle: 10, ..solve::Options::PAPER },
            handle_limit: 0.01,
        };
        let start = Instant::now();
        let (running, quiet, seconds) = (|| false, |_: f64, _: &str| {}, || start.elapsed().as_secs_f64());
        let monitor = Monitor::new(&running, &quiet, &seconds);
        let folded = pool.install(|| fold(&pattern, &sheet, &options, &monitor)).expect("the sheet folds");
        let ms = 1e3 * folded.seconds / folded.iterations as f64;
        println!("{:>9}{:>12}{ms:>9.2}", folded.vertices, folded.iterations);
    }
}
