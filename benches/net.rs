//! Time of one iteration of guided projection on one core: `cargo bench --bench net`. Sizes are those of the paper's table
//! (figures 1, 8, 14, 11-2): a bottle whose bottom is held is bent by its top, all lengths and angles kept.
//!
//! Columns: points, rows, columns, seconds per iteration, iterations, R, degrees by which the ends have turned against each other.
//!
//! Then a bottle of the largest size is opened until its sides have turned against each other by so many degrees: the middles and ends
//! of both go where another member of the Minding family has them. Strain is measured twice: by the lengths that the net keeps,
//! and by Green's tensor of the triangles of either diagonal of every quad.
#![allow(clippy::print_stdout)]
use std::time::Instant;

use fabricate::{
    geom::{Vec2, Vec3, angle_between},
    model::{GeodesicNet, NetFit},
    numeric::Monitor,
    stages::{
        mold::Intrinsic,
        net::{Handle, bend, start, verify},
    },
};

/// Angle around the axis that the bottles take, rad.
const SWEEP: f64 = 4.0;

fn bottle(rows: usize, columns: usize) -> GeodesicNet {
    let profile: Vec<Vec2> = (0..200)
        .map(|k| f64::from(k) / 199.0)
        .map(|t| Vec2::new(4.0 + 1.2 * (6.0 * t).sin() - 1.5 * t * t, 20.0 * t))
        .collect();
    start::of_revolution(&profile, rows, columns, SWEEP).unwrap_or_else(|error| panic!("{error}"))
}

fn bent(net: &GeodesicNet, handles: &[Handle], monitor: &Monitor) -> NetFit {
    let made = bend(net, handles, 20, 0.03, 200, monitor).unwrap_or_else(|error| panic!("{error}"));
    assert!(made.missed.is_empty(), "{:?}", made.missed);
    made
}

fn main() {
    println!(
        "{:>8}{:>6}{:>9}{:>13}{:>12}{:>11}{:>8}",
        "points", "rows", "columns", "s/iteration", "iterations", "R", "turned"
    );
    let clock = Instant::now();
    let seconds = || clock.elapsed().as_secs_f64();
    let monitor = Monitor::new(&|| false, &|_, _| (), &seconds);
    for (rows, columns) in [(21, 21), (37, 31), (54, 27), (117, 41)] {
        let net = bottle(rows, columns);
        let middle = columns / 2;
        let hold = |i: usize, j: usize| Handle::to([i, j], net.at(i, j));
        let top = Handle::to([rows - 1, middle], net.at(rows - 1, middle) + Vec3::new(-8.5, 0.0, -3.5));
        let made = bent(&net, &[hold(0, middle), hold(0, middle + 1), hold(1, middle), top], &monitor);
        println!(
            "{:>8}{rows:>6}{columns:>9}{:>13.4}{:>12}{:>11.1e}{:>8.1}",
            rows * columns,
            made.seconds / made.iterations as f64,
            made.iterations,
            made.residual,
            verify::turned(&net, &made.net).to_degrees()
        );
    }
    println!("\n{:>8}{:>11}{:>13}{:>13}{:>8}", "points", "R", "net strain", "triangles", "opened");
    let net = bottle(117, 41);
    for lambda in [1.4, 1.3] {
        let goal = Intrinsic::of(&net).revolution(lambda).unwrap_or_else(|error| panic!("{error}")).net(40, 41);
        let at = [0, 116].into_iter().flat_map(|i| [0, 20, 40].map(|j| [i, j]));
        let handles: Vec<Handle> = at.map(|it| Handle::to(it, goal.at(it[0], it[1]))).collect();
        let made = bent(&net, &handles, &monitor);
        let around = |net: &GeodesicNet| {
            let normal = |j: usize| net.frame(58, j).map(|it| it.normal).unwrap_or_default();
            (0..40).map(|j| angle_between(normal(j), normal(j + 1))).sum::<f64>()
        };
        let largest = |values: &[f64]| values.iter().copied().fold(0.0, f64::max);
        println!(
            "{:>8}{:>11.1e}{:>13.1e}{:>13.1e}{:>8.1}",
            net.points.len(),
            made.residual,
            largest(&made.strain),
            largest(&verify::triangle_strains(&net, &made.net)),
            (around(&made.net) - around(&net)).abs().to_degrees()
        );
    }
}
