//! Patches of exactly developable surfaces whose unrolling and rulings are known.
use std::f64::consts::TAU;

use super::TriMesh;
use crate::{
    geom::{Vec2, Vec3},
    numeric::random::Random,
};

/// A developable surface by formula. The map from the plane to space is an isometry.
#[derive(Clone, Copy)]
pub struct Developable {
    /// What it is.
    pub name: &'static str,
    /// From the plane to space, mm.
    pub space: fn(Vec2) -> Vec3,
    /// Direction of the ruling through a point of the plane; not normalised.
    pub ruling: fn(Vec2) -> Vec2,
    /// Radius of curvature across the ruling at a point of the plane, mm.
    pub radius: fn(Vec2) -> f64,
}

/// Radius of the cylinder, mm.
const RADIUS: f64 = 40.0;
/// Rulings of the cylinder are turned out of the axes of the mesh, radians.
const TURN: f64 = 0.3;
/// Apex of the cone in the plane, mm, and half its opening angle, radians.
const APEX: Vec2 = Vec2::new(-95.0, -40.0);
const HALF_ANGLE: f64 = 0.6;
/// Radius and centre of the curve of regression once it is laid flat, mm.
const REGRESSION: f64 = 50.0;
const CENTRE: Vec2 = Vec2::new(-120.0, 10.0);

fn cylinder(p: Vec2) -> Vec3 {
    let (sin, cos) = TURN.sin_cos();
    let (u, v) = (p.x * cos + p.y * sin, p.y * cos - p.x * sin);
    Vec3::new(RADIUS * (u / RADIUS).sin(), v, RADIUS * (u / RADIUS).cos())
}

fn cone(p: Vec2) -> Vec3 {
    let (r, angle) = ((p - APEX).norm(), (p - APEX).y.atan2((p - APEX).x));
    let (sin, cos) = HALF_ANGLE.sin_cos();
    Vec3::new(r * sin * (angle / sin).cos(), r * sin * (angle / sin).sin(), -r * cos)
}

/// Angle on the flat circle of regression of the tangent through `p`, and the distance along it.
fn tangent(p: Vec2) -> (f64, f64) {
    let p = p - CENTRE;
    let along = (p.norm_squared() - REGRESSION * REGRESSION).sqrt();
    (p.y.atan2(p.x) - along.atan2(REGRESSION), along)
}

/// Direction cosines of the helix of regression: along its axis and around it.
const RISE: f64 = 0.447_213_595_499_957_9;
const RUN: f64 = 0.894_427_190_999_915_9;

/// Tangents of a helix of curvature 1 / REGRESSION, so its radius is REGRESSION · RUN².
fn tangents(p: Vec2) -> Vec3 {
    let (angle, along) = tangent(p);
    let (s, radius) = (REGRESSION * angle, REGRESSION * RUN * RUN);
    let (sin, cos) = (s * RUN / radius).sin_cos();
    Vec3::new(radius * cos, radius * sin, s * RISE) + Vec3::new(-sin * RUN, cos * RUN, RISE) * along
}

/// A cylinder, a cone and the tangents of a helix.
///
/// Radius of curvature: that of the cylinder; r tan α at the distance r from the apex of a cone of half angle α; v κ / τ =
/// 2 v at the distance v along the tangents of a helix that rises by half its run (κ / τ = run / rise).
pub const DEVELOPABLE: [Developable; 3] = [
    Developable {
        name: "cylinder",
        space: cylinder,
        ruling: |_| Vec2::new(-TURN.sin(), TURN.cos()),
        radius: |_| RADIUS,
    },
    Developable { name: "cone", space: cone, ruling: |p| p - APEX, radius: |p| (p - APEX).norm() * HALF_ANGLE.tan() },
    Developable {
        name: "tangents",
        space: tangents,
        ruling: |p| {
            let (sin, cos) = tangent(p).0.sin_cos();
            Vec2::new(-sin, cos)
        },
        radius: |p| tangent(p).1 * RUN / RISE,
    },
];

/// A disk of `rings` rings of triangles with about equal sides in a blob about 50 mm in radius: points and faces.
pub fn blob(rings: usize) -> (Vec<Vec2>, Vec<[u32; 3]>) {
    let mut points = vec![Vec2::zeros()];
    let mut faces = Vec::new();
    let id = |ring: usize, k: usize| if ring == 0 { 0 } else { (1 + 3 * ring * (ring - 1) + k % (6 * ring)) as u32 };
    for ring in 1..=rings {
        for k in 0..6 * ring {
            let angle = TAU * k as f64 / (6 * ring) as f64;
            let radius = 50.0 * (1.0 + 0.15 * (2.0 * angle + 0.4).cos() + 0.08 * (3.0 * angle).cos());
            points.push(Vec2::new(angle.cos(), angle.sin()) * (radius * ring as f64 / rings as f64));
            let (side, step) = (k / ring, k % ring);
            let inner = |step: usize| id(ring - 1, side * (ring - 1) + step);
            faces.push([id(ring, k), id(ring, k + 1), inner(step)]);
            if step > 0 {
                faces.push([id(ring, k), inner(step), inner(step - 1)]);
            }
        }
    }
    (points, faces)
}

/// The surface over a blob, and the places of its vertices in the plane. `noise` moves the vertices in space in all
/// directions; it is the standard deviation in shares of an edge.
pub fn patch(surface: &Developable, rings: usize, noise: f64) -> (TriMesh, Vec<Vec2>) {
    let (plane, faces) = blob(rings);
    let mut random = Random::new(7);
    let mut normal = || (0..12).map(|_| random.unit()).sum::<f64>() - 6.0;
    let edge = 50.0 / rings as f64;
    let places = plane.iter().map(|&p| (surface.space)(p) + Vec3::from_fn(|_, _| normal()) * (noise * edge)).collect();
    (super::finish(places, &faces), plane)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unrolling_keeps_lengths_and_rulings_are_straight() {
        for it in &DEVELOPABLE {
            for p in blob(3).0 {
                let step = 1e-5;
                let along = |d: Vec2| ((it.space)(p + d * step) - (it.space)(p - d * step)) / (2.0 * step);
                let [x, y] = [along(Vec2::x()), along(Vec2::y())];
                for (value, expected) in [(x.norm(), 1.0), (y.norm(), 1.0), (x.dot(&y), 0.0)] {
                    assert!((value - expected).abs() < 1e-7, "{}: {value} for {expected} at {p}", it.name);
                }
                let ruling = (it.ruling)(p).normalize();
                let [a, b, c] = [-3.0, 0.0, 3.0].map(|t| (it.space)(p + ruling * t));
                assert!((a + c - b * 2.0).norm() < 1e-9, "{}", it.name);
                // Curvature across the ruling by a second difference.
                let across = Vec2::new(-ruling.y, ruling.x) * 1e-3;
                let [a, b, c] = [-1.0, 0.0, 1.0].map(|t| (it.space)(p + across * t));
                let radius = 1e-6 / (a + c - b * 2.0).norm();
                assert!((radius / (it.radius)(p) - 1.0).abs() < 1e-4, "{}: {radius} for {}", it.name, (it.radius)(p));
            }
        }
    }
}
