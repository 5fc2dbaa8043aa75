//! The poles, and the heights of rings that are equally far from each other along a path from pole to pole.
use std::f64::consts::{FRAC_PI_2, PI};

use super::{GoreError, Options};
use crate::{
    geom::Vec3,
    mesh::{Bvh, FaceId, Id, TriMesh, VertexId},
    surface::sphere_map::{Locator, extremes},
};

/// Points of a path along which the rings are spaced.
const SAMPLES: usize = 2_000;
/// Rings are farther apart than this on the sphere.
const APART: f64 = 1e-9;

/// Top and bottom.
pub(super) fn poles(mesh: &TriMesh, options: &Options) -> Result<[VertexId; 2], GoreError> {
    let [Some(&top), Some(&bottom)] = [options.path.first(), options.path.last()] else {
        return Ok(extremes(mesh, options.pole));
    };
    let nearest = |p: Vec3| {
        let far = |v: &VertexId| (mesh.position(*v) - p).norm_squared();
        mesh.vertices().min_by(|a, b| far(a).total_cmp(&far(b)).then(a.cmp(b))).unwrap_or(VertexId(0))
    };
    let poles = [top, bottom].map(nearest);
    if poles[0] == poles[1] {
        return Err(GoreError::Ends { place: mesh.position(poles[0]) });
    }
    Ok(poles)
}

/// Heights on the sphere of rings that are equally far from each other along the path, or along the first meridian of the
/// surface. `points` is the image of every vertex, the poles at ±z.
pub(super) fn ring_heights(mesh: &TriMesh, points: &[Vec3], options: &Options) -> Result<Vec<f64>, GoreError> {
    let locator = Locator::new(mesh, points);
    let rims = [options.caps[1] - FRAC_PI_2, FRAC_PI_2 - options.caps[0]].map(f64::sin);
    let mut hint = FaceId(0);
    let mut along: Vec<(f64, f64, Vec3)> = Vec::with_capacity(SAMPLES + 1);
    for p in way(mesh, points, options).into_iter().filter(|p| (rims[0]..=rims[1]).contains(&p.z)) {
        let spot = locator.locate(p, hint);
        hint = spot.face;
        let place = spot.position(mesh);
        let length = along.last().map_or(0.0, |it| it.0 + (place - it.2).norm());
        along.push((length, p.z, place));
    }
    let whole = along.last().map_or(0.0, |it| it.0);
    let mut heights = Vec::with_capacity(options.count);
    let mut below = rims[0];
    for k in 1..options.count {
        let reached = whole * k as f64 / options.count as f64;
        let Some(&(_, z, place)) = along.get(along.partition_point(|it| it.0 < reached)) else { break };
        if z <= below + APART || z >= rims[1] - APART {
            return Err(GoreError::Back { place });
        }
        heights.push(z);
        below = z;
    }
    Ok(heights)
}

/// Points on the sphere from the lower pole to the upper.
fn way(mesh: &TriMesh, points: &[Vec3], options: &Options) -> Vec<Vec3> {
    if options.path.is_empty() {
        let (sin, cos) = options.start.sin_cos();
        let at = |k: usize| {
            let (z, r) = (PI * k as f64 / SAMPLES as f64 - FRAC_PI_2).sin_cos();
            Vec3::new(r * cos, r * sin, z)
        };
        return (0..=SAMPLES).map(at).collect();
    }
    let bvh = Bvh::new(mesh);
    let between = options.path[1..options.path.len() - 1].iter().rev().map(|&p| {
        let found = bvh.closest(p);
        let corners = mesh.face_vertices(found.face).into_iter().zip(found.barycentric);
        corners.map(|(v, weight)| weight * points[v.index()]).sum::<Vec3>().normalize()
    });
    let stops: Vec<Vec3> = [-Vec3::z()].into_iter().chain(between).chain([Vec3::z()]).collect();
    let steps = SAMPLES.div_ceil(stops.len() - 1);
    let mut way = vec![stops[0]];
    for pair in stops.windows(2) {
        way.extend((1..=steps).map(|k| arc(pair[0], pair[1], k as f64 / steps as f64)));
    }
    way
}

/// The point at a share of the shorter great circle from `p` to `q`; over longitude 0 between opposite points.
fn arc(p: Vec3, q: Vec3, share: f64) -> Vec3 {
    let across = (q - q.dot(&p) * p).try_normalize(1e-12).unwrap_or_else(Vec3::x);
    let angle = p.cross(&q).norm().atan2(p.dot(&q));
    let (sin, cos) = (share * angle).sin_cos();
    cos * p + sin * across
}
