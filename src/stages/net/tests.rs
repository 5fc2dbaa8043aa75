//! Nets on whole shapes: a bottle that is bent, handles that fight, twisted geodesics on a bowling pin.
use std::f64::consts::PI;

use super::{start::of_revolution, verify::*, *};
use crate::{
    geom::{Vec2, Vec3},
    mesh::{Bvh, shapes},
    model::{GeodesicNet, NetFit},
    numeric::Monitor,
};

fn weights(list: &[(Family, f64)]) -> Weights {
    let mut out = [0.0; Family::ALL.len()];
    list.iter().for_each(|it| out[it.0 as usize] = it.1);
    out
}

/// A bottle with a waist, 20 high, a sector of 4 rad.
fn bottle(rows: usize, columns: usize) -> GeodesicNet {
    let profile: Vec<Vec2> = (0..200)
        .map(|k| f64::from(k) / 199.0)
        .map(|t| Vec2::new(4.0 + 1.2 * (6.0 * t).sin() - 1.5 * t * t, 20.0 * t))
        .collect();
    of_revolution(&profile, rows, columns, 4.0).unwrap()
}

fn bent(net: &GeodesicNet, handles: &[Handle]) -> NetFit {
    bend(net, handles, 20, 0.03, 200, &Monitor::silent()).unwrap()
}

fn largest(values: &[f64]) -> f64 {
    values.iter().copied().fold(0.0, f64::max)
}

#[test]
fn a_bottle_is_bent_without_strain() {
    let net = bottle(21, 21);
    let hold = |i: usize, j: usize| Handle::to([i, j], net.at(i, j));
    let top = Handle::to([20, 10], net.at(20, 10) + Vec3::new(-7.0, 0.0, -2.5));
    let made = bent(&net, &[hold(0, 10), hold(0, 11), hold(1, 10), top]);
    assert!(made.residual <= FEASIBLE && made.missed.is_empty(), "R {:e}, missed {:?}", made.residual, made.missed);
    assert!(largest(&made.strain) < 1e-8, "strain {:e}", largest(&made.strain));
    let turned = turned(&net, &made.net).to_degrees();
    assert!(turned > 20.0, "bent by {turned}°");
    // Quads fold along their diagonals by the square of the mesh width: it is not crumpled.
    let mut triangles = triangle_strains(&net, &made.net);
    triangles.sort_by(f64::total_cmp);
    assert!(triangles[triangles.len() / 2] < 1e-3 && largest(&triangles) < 0.02, "{:?}", largest(&triangles));
}

#[test]
fn a_path_in_places_leads_to_the_same_target() {
    let net = bottle(13, 11);
    let hold = |i: usize, j: usize| Handle::to([i, j], net.at(i, j));
    let from = net.at(12, 5);
    let handle =
        Handle { at: [12, 5], path: vec![from + Vec3::new(-2.0, 0.0, -0.5), from + Vec3::new(-4.0, 1.0, -1.5)] };
    let made = bent(&net, &[hold(0, 5), hold(0, 6), hold(1, 5), handle.clone()]);
    assert!(made.residual <= FEASIBLE && made.missed.is_empty(), "R {:e}, missed {:?}", made.residual, made.missed);
    assert!((made.net.at(12, 5) - handle.path[1]).norm() < 1e-5);
}

#[test]
fn handles_that_fight_are_named() {
    let net = bottle(13, 11);
    // The net is 20 high: nothing brings its ends 40 apart.
    let handles = [Handle::to([0, 5], net.at(0, 5)), Handle::to([12, 5], net.at(0, 5) + Vec3::new(0.0, 0.0, 40.0))];
    let made = bent(&net, &handles);
    assert!(made.missed.len() == 2, "{:?}", made.missed);
    assert!(made.missed.iter().map(|it| it.1).sum::<f64>() > 15.0, "{:?}", made.missed);
    // All the rest is met.
    assert!(made.residual <= FEASIBLE, "{:e}", made.residual);
}

#[test]
fn a_handle_outside_the_net_is_an_error() {
    let net = bottle(5, 5);
    let goals = Goals { start: weights(&[]), end: weights(&[]), travel: 1, fade: 1, most: 1 };
    let handle = Handle::to([5, 0], Vec3::zeros());
    let error = Projection::new(&net, &goals, None, None).unwrap().run(&goals, &[handle], &Monitor::silent());
    assert!(matches!(error, Err(NetError::NoSuchPoint { handle: 0, row: 5, .. })));
}

/// The profile of a bowling pin, height t in [0, 1].
fn pin(t: f64) -> Vec2 {
    Vec2::new(6.0 + 1.6 * (PI * (1.9 * t + 0.1)).sin() - 1.5 * t, 22.0 * t)
}

/// Makes geodesic parallel coordinates on a surface.
fn on_surface(net: &GeodesicNet, surface: &Bvh) -> GeodesicNet {
    let hard = [(Family::Geodesic, 1.0), (Family::Proximity, 1.0)];
    let mut start = weights(&hard);
    start[Family::Fairness as usize] = 0.03;
    let goals = Goals { start, end: weights(&hard), travel: 0, fade: 10, most: 60 };
    Projection::new(net, &goals, None, Some(surface)).unwrap().run(&goals, &[], &Monitor::silent()).unwrap().net
}

#[test]
fn twisted_geodesics_on_a_pin_obey_clairaut() {
    let profile: Vec<Vec2> = (0..=300).map(|k| pin(-0.15 + 1.3 * f64::from(k) / 300.0)).collect();
    let surface = Bvh::new(&shapes::revolve(&profile, 600));
    let first = GeodesicNet::from_fn(25, 11, |i, j| {
        let (s, w) = (i as f64 / 24.0, j as f64 / 10.0 - 0.5);
        // Up and around along a line that is no geodesic, and across at a right angle to it, roughly.
        let p = pin(0.1 + 0.8 * s - 0.2 * w);
        let turn = 2.6 * s + 1.0 * w;
        Vec3::new(p.x * turn.cos(), p.x * turn.sin(), p.y)
    });
    let coarse = on_surface(&first, &surface);
    let fine = on_surface(&coarse.subdivided(), &surface);
    let worst = |it: &GeodesicNet| {
        let lines = clairaut(it, Vec3::zeros(), Vec3::z());
        let mean = lines.iter().map(|it| it.mean).sum::<f64>() / lines.len() as f64;
        (lines.iter().map(|it| it.deviation).fold(0.0, f64::max), mean)
    };
    let [begin, before, after] = [&first, &coarse, &fine].map(worst);
    assert!(after.1 > 2.0, "the geodesics are meridians: r cos α = {}", after.1);
    assert!(begin.0 > 0.1, "it began with geodesics: {begin:?}");
    assert!(after.0 < 0.01, "{begin:?} at first, {before:?} before and {after:?} after one refinement");
}
