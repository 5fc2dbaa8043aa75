//! The exact proof that a triangulation on the sphere covers it once.
use robust::{Coord3D, orient3d};

use crate::geom::Vec3;

/// What was proven of a map. All signs are exact, whatever the rounding of the points.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Certificate {
    /// Faces whose corners a, b, c do not have det(a, b, c) > 0.
    pub flips: usize,
    /// How often the faces cover a generic direction, each counted with its orientation.
    pub degree: i64,
}

impl Certificate {
    /// No face flipped and the sphere covered once: then the map is one to one. (All faces keep their orientation, so the
    /// map is a branched cover of the sphere, and one of degree 1 has no branch points.)
    pub fn holds(&self) -> bool {
        self.flips == 0 && self.degree == 1
    }
}

/// Counts flipped faces and the degree. The points need not have length 1: they stand for their directions.
pub fn certify(faces: &[[u32; 3]], points: &[Vec3]) -> Certificate {
    let corners = |f: &[u32; 3]| f.map(|v| points[v as usize]);
    let flips = faces.iter().filter(|f| !is_positive(corners(f))).count();
    Certificate { flips, degree: degree(faces, points) }
}

/// Whether det(a, b, c) > 0, exactly.
pub(super) fn is_positive([a, b, c]: [Vec3; 3]) -> bool {
    sign(a, b, c) > 0.0
}

/// A number with the sign of det(a, b, c). The fourth point of the predicate is the origin, so its differences are exact.
pub(super) fn sign(a: Vec3, b: Vec3, c: Vec3) -> f64 {
    let coord = |p: Vec3| Coord3D { x: p.x, y: p.y, z: p.z };
    orient3d(coord(a), coord(b), coord(c), Coord3D { x: 0.0, y: 0.0, z: 0.0 })
}

/// The degree of the map at a direction that lies on no plane through an edge and the origin.
fn degree(faces: &[[u32; 3]], points: &[Vec3]) -> i64 {
    // Irrational-looking directions; a map on whose edges all of them lie is made on purpose.
    let directions = [[0.613, 0.357, 0.705], [-0.271, 0.828, -0.491], [0.137, -0.944, 0.301], [-0.733, -0.219, 0.644]];
    directions.into_iter().find_map(|it| degree_at(faces, points, Vec3::from(it))).unwrap_or(0)
}

fn degree_at(faces: &[[u32; 3]], points: &[Vec3], p: Vec3) -> Option<i64> {
    let mut degree = 0;
    for f in faces {
        let [a, b, c] = f.map(|v| points[v as usize]);
        // Most faces are far away: all corners on the other side.
        if a.dot(&p) < 0.0 && b.dot(&p) < 0.0 && c.dot(&p) < 0.0 {
            continue;
        }
        let signs = [sign(p, b, c), sign(a, p, c), sign(a, b, p)];
        if signs.contains(&0.0) {
            return None;
        }
        // With det(a, b, c) of the other sign it is −p that lies inside.
        let whole = sign(a, b, c);
        if signs.iter().all(|&it| it > 0.0) && whole > 0.0 {
            degree += 1;
        } else if signs.iter().all(|&it| it < 0.0) && whole < 0.0 {
            degree -= 1;
        }
    }
    Some(degree)
}
