//! Semi-regular tessellations of the sphere, pulled back to a surface.
use std::collections::BTreeMap;

use super::{SphereError, locate::Locator, net::Net};
use crate::{geom::Vec3, mesh::MeshError, numeric::Monitor};

/// A pattern of triangles on the sphere.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Pattern {
    /// Eight triangles, each divided into n² along its sides.
    Octahedron(usize),
    /// Twenty triangles, each divided into n².
    Icosahedron(usize),
    /// Six squares, each divided into n² with a diagonal that changes its direction.
    Cube(usize),
    /// Rings between two poles, each of as many points as there are meridians.
    LatitudeLongitude {
        /// At least 3.
        meridians: usize,
        /// At least 1.
        rings: usize,
    },
}

impl Pattern {
    /// Number of faces.
    pub fn faces(self) -> usize {
        match self {
            Self::Octahedron(n) => 8 * n * n,
            Self::Icosahedron(n) => 20 * n * n,
            Self::Cube(n) => 12 * n * n,
            Self::LatitudeLongitude { meridians, rings } => 2 * meridians * rings,
        }
    }

    /// The points on the sphere and the faces, counter-clockwise seen from outside. Panics on counts below the least.
    pub fn mesh(self) -> (Vec<Vec3>, Vec<[u32; 3]>) {
        match self {
            Self::Octahedron(n) => {
                let corners = [Vec3::x(), Vec3::y(), -Vec3::x(), -Vec3::y(), Vec3::z(), -Vec3::z()];
                let faces: Vec<[usize; 3]> = (0..4).flat_map(|k| [[k, (k + 1) % 4, 4], [(k + 1) % 4, k, 5]]).collect();
                divided(&corners, &faces, n)
            }
            Self::Icosahedron(n) => {
                let (corners, faces) = icosahedron();
                divided(&corners, &faces, n)
            }
            Self::Cube(n) => cube(n),
            Self::LatitudeLongitude { meridians, rings } => rings_between_poles(meridians, rings),
        }
    }
}

/// Poles at ±z and two rings of five.
fn icosahedron() -> (Vec<Vec3>, Vec<[usize; 3]>) {
    let (height, radius) = (1.0 / 5.0_f64.sqrt(), 2.0 / 5.0_f64.sqrt());
    let ring = |k: usize, up: bool| {
        let angle = std::f64::consts::TAU * (k as f64 + if up { 0.0 } else { 0.5 }) / 5.0;
        Vec3::new(radius * angle.cos(), radius * angle.sin(), if up { height } else { -height })
    };
    let mut corners: Vec<Vec3> = (0..5).map(|k| ring(k, true)).chain((0..5).map(|k| ring(k, false))).collect();
    corners.extend([Vec3::z(), -Vec3::z()]);
    let faces = (0..5).flat_map(|k| {
        let next = (k + 1) % 5;
        [[k, next, 10], [k, 5 + k, next], [next, 5 + k, 5 + next], [5 + next, 5 + k, 11]]
    });
    (corners, faces.collect())
}

/// Every triangle as n² along its sides, on the sphere. Points are known by their weights at the corners, so shared sides agree.
fn divided(corners: &[Vec3], faces: &[[usize; 3]], n: usize) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    assert!(n > 0, "a side has at least one part");
    let mut ids: BTreeMap<Vec<(usize, usize)>, u32> = BTreeMap::new();
    let mut points = Vec::new();
    let mut out = Vec::with_capacity(faces.len() * n * n);
    for face in faces {
        let mut at = |i: usize, j: usize| {
            let weights = [n - i - j, i, j];
            let mut key: Vec<(usize, usize)> = face.iter().copied().zip(weights).filter(|it| it.1 > 0).collect();
            key.sort_unstable();
            *ids.entry(key).or_insert_with_key(|key| {
                let sum: Vec3 = key.iter().map(|&(corner, weight)| weight as f64 * corners[corner]).sum();
                points.push(sum.normalize());
                points.len() as u32 - 1
            })
        };
        for i in 0..n {
            for j in 0..n - i {
                out.push([at(i, j), at(i + 1, j), at(i, j + 1)]);
                if i + j + 2 <= n {
                    out.push([at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]);
                }
            }
        }
    }
    (points, out)
}

/// Squares of equal angles on the six sides.
fn cube(n: usize) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    assert!(n > 0, "a side has at least one part");
    let mut ids: BTreeMap<[i64; 3], u32> = BTreeMap::new();
    let mut points = Vec::new();
    let mut out = Vec::with_capacity(12 * n * n);
    let n = n as i64;
    for (axis, side) in [0, 1, 2].into_iter().flat_map(|axis| [(axis, 1), (axis, -1)]) {
        let mut at = |i: i64, j: i64| {
            // Counted in half steps from the middle; the other two axes swap on the far side, which keeps the turn.
            let mut key = [0; 3];
            key[axis] = side * n;
            let (u, v) = if side > 0 { (1, 2) } else { (2, 1) };
            key[(axis + u) % 3] = 2 * i - n;
            key[(axis + v) % 3] = 2 * j - n;
            *ids.entry(key).or_insert_with(|| {
                let tan = |it: i64| (std::f64::consts::FRAC_PI_4 * it as f64 / n as f64).tan();
                points.push(Vec3::new(tan(key[0]), tan(key[1]), tan(key[2])).normalize());
                points.len() as u32 - 1
            })
        };
        for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            out.extend(if (i + j) % 2 == 0 { [[a, b, c], [a, c, d]] } else { [[a, b, d], [b, c, d]] });
        }
    }
    (points, out)
}

fn rings_between_poles(meridians: usize, rings: usize) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    assert!(meridians >= 3 && rings >= 1, "a sphere needs 3 meridians and a ring");
    let mut points = Vec::with_capacity(meridians * rings + 2);
    for ring in 1..=rings {
        let (height, radius) =
            (std::f64::consts::PI * ring as f64 / (rings + 1) as f64 - std::f64::consts::FRAC_PI_2).sin_cos();
        points.extend((0..meridians).map(|k| {
            let (sin, cos) = (std::f64::consts::TAU * k as f64 / meridians as f64).sin_cos();
            Vec3::new(radius * cos, radius * sin, height)
        }));
    }
    points.extend([-Vec3::z(), Vec3::z()]);
    let at = |ring: usize, k: usize| (ring * meridians + k % meridians) as u32;
    let [bottom, top] = [meridians * rings, meridians * rings + 1].map(|it| it as u32);
    let mut out = Vec::with_capacity(2 * meridians * rings);
    for k in 0..meridians {
        out.push([bottom, at(0, k + 1), at(0, k)]);
        out.push([top, at(rings - 1, k), at(rings - 1, k + 1)]);
        for ring in 1..rings {
            let [a, b, c, d] = [at(ring - 1, k), at(ring - 1, k + 1), at(ring, k + 1), at(ring, k)];
            out.extend(if (ring + k) % 2 == 0 { [[a, b, c], [a, c, d]] } else { [[a, b, d], [b, c, d]] });
        }
    }
    (points, out)
}

/// Why a tessellation cannot be pulled back.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum TessellateError {
    /// Interrupted, or there is no map.
    #[error(transparent)]
    Sphere(#[from] SphereError),
    /// A face has no area on the surface.
    #[error("the tessellation is too fine for the surface somewhere: {0}; take fewer faces")]
    Mesh(#[from] MeshError),
}

/// Sweeps of the compensation, and how much they weigh even areas against even angles.
const SWEEPS: usize = 400;
const EVEN: f64 = 0.5;

/// The pattern on the surface behind `locator`. With `compensate` its points first move along the surface to where its faces are
/// closer to equilateral triangles of one area, as far as no face turns over on the sphere. Without, limbs get few faces,
/// because a conformal map makes them small.
pub fn pull_back<'a>(
    locator: &'a Locator<'a>,
    pattern: Pattern,
    compensate: bool,
    monitor: &Monitor,
) -> Result<Net<'a>, TessellateError> {
    let (points, faces) = pattern.mesh();
    let area = locator.mesh().total_area() / faces.len() as f64;
    let mut net = Net::new(locator, &faces, points)?;
    if compensate {
        for sweep in 0..SWEEPS {
            monitor.check().map_err(SphereError::from)?;
            monitor.progress(sweep as f64 / SWEEPS as f64, "evening out the tessellation");
            net.smooth(area, EVEN);
        }
        net.untangle();
    }
    Ok(net)
}
