//! Solids: a polygon of the half plane (radius, height) swept through an angle around z, with holes for dowels in its flat faces.
use crate::{
    geom::{Vec2, Vec3, ears::ears, polygon::segments_meet},
    mesh::{MeshError, TriMesh},
};

/// A blind hole at a right angle to a flat face.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Hole {
    /// Its centre: radius and height in an end face, radius and longitude in a level one.
    pub(super) at: Vec2,
    /// Depth, mm.
    pub(super) depth: f64,
}

/// What is swept.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Sector {
    /// Simple polygon of (radius, height), counter-clockwise, off the axis.
    pub(super) section: Vec<Vec2>,
    /// First and last longitude, rad.
    pub(super) angles: [f64; 2],
    /// Facets across.
    pub(super) steps: usize,
    /// Radius of all holes, mm.
    pub(super) radius: f64,
    /// Holes in the end faces at the first and at the last longitude.
    pub(super) ends: [Vec<Hole>; 2],
    /// Holes in level faces: the side of the section that is drilled, and its holes.
    pub(super) level: Vec<(usize, Vec<Hole>)>,
}

/// Corners of a hole.
const ROUND: usize = 24;

/// A plane with the outer normal x × y.
struct Frame {
    x: Vec3,
    y: Vec3,
    /// A point of the plane.
    origin: Vec3,
}

impl Frame {
    fn place(&self, p: Vec2) -> Vec3 {
        self.origin + self.x * p.x + self.y * p.y
    }

    fn flat(&self, p: Vec3) -> Vec2 {
        let arm = p - self.origin;
        Vec2::new(arm.dot(&self.x), arm.dot(&self.y))
    }
}

/// Points and faces so far.
struct Body {
    points: Vec<Vec3>,
    faces: Vec<[u32; 3]>,
}

impl Sector {
    /// The closed surface, facing outwards.
    pub(super) fn mesh(&self) -> Result<TriMesh, MeshError> {
        let n = self.section.len();
        let id = |k: usize, s: usize| s * n + k % n;
        let angle = |s: usize| self.angles[0] + (self.angles[1] - self.angles[0]) * s as f64 / self.steps as f64;
        let around = |p: Vec2, angle: f64| Vec3::new(p.x * angle.cos(), p.x * angle.sin(), p.y);
        let points = (0..=self.steps).flat_map(|s| self.section.iter().map(move |p| around(*p, angle(s)))).collect();
        let mut body = Body { points, faces: vec![] };
        for k in 0..n {
            if let Some((_, holes)) = self.level.iter().find(|it| it.0 == k) {
                let ring = (0..=self.steps).map(|s| id(k, s)).chain((0..=self.steps).rev().map(|s| id(k + 1, s)));
                let z = self.section[k].y;
                // A side that runs inwards faces up.
                let up = if self.section[(k + 1) % n].x < self.section[k].x { 1.0 } else { -1.0 };
                let frame = Frame { x: Vec3::x(), y: Vec3::y() * up, origin: Vec3::z() * z };
                let centers = holes.iter().map(|it| (frame.flat(around(Vec2::new(it.at.x, z), it.at.y)), it.depth));
                body.drill(ring.collect(), &frame, &centers.collect::<Vec<_>>(), self.radius);
                continue;
            }
            for s in 0..self.steps {
                let [a, b, c, d] = [id(k + 1, s), id(k, s), id(k, s + 1), id(k + 1, s + 1)].map(|it| it as u32);
                body.faces.extend([[a, b, c], [a, c, d]]);
            }
        }
        for (end, holes) in self.ends.iter().enumerate() {
            let s = end * self.steps;
            let up = if end == 0 { 1.0 } else { -1.0 };
            let frame = Frame { x: around(Vec2::x(), angle(s)), y: Vec3::z() * up, origin: Vec3::zeros() };
            let ring: Vec<usize> = (0..n).map(|k| id(if end == 0 { k } else { n - 1 - k }, s)).collect();
            let centers: Vec<_> = holes.iter().map(|it| (Vec2::new(it.at.x, it.at.y * up), it.depth)).collect();
            body.drill(ring, &frame, &centers, self.radius);
        }
        TriMesh::new(body.points, &body.faces)
    }
}

impl Body {
    /// Fills a ring that runs counter-clockwise in its plane, but for blind holes.
    fn drill(&mut self, ring: Vec<usize>, frame: &Frame, holes: &[(Vec2, f64)], radius: f64) {
        let normal = frame.x.cross(&frame.y);
        let mut rims = Vec::new();
        for &(center, depth) in holes {
            let first = self.points.len();
            for down in [0.0, depth] {
                for k in 0..ROUND {
                    let (sin, cos) = (std::f64::consts::TAU * k as f64 / ROUND as f64).sin_cos();
                    let rim = center + Vec2::new(cos, sin) * radius;
                    self.points.push(frame.place(rim) - normal * down);
                }
            }
            let id = |k: usize, low: usize| (first + low * ROUND + k % ROUND) as u32;
            for k in 0..ROUND {
                let [a, b, c, d] = [id(k, 0), id(k + 1, 0), id(k + 1, 1), id(k, 1)];
                self.faces.extend([[a, b, c], [a, c, d]]);
            }
            self.faces.extend((1..ROUND - 1).map(|k| [id(0, 1), id(k, 1), id(k + 1, 1)]));
            // Clockwise, as the rim of a hole.
            rims.push((first..first + ROUND).rev().collect::<Vec<usize>>());
        }
        let flat = |i: usize| frame.flat(self.points[i]);
        let ring = bridged(ring, rims, &flat);
        let places: Vec<Vec2> = ring.iter().map(|&i| flat(i)).collect();
        self.faces.extend(ears(&places).into_iter().map(|t| t.map(|i| ring[i] as u32)));
    }
}

/// One ring out of a ring and the holes in it, each joined by a slit to the nearest corner that it sees.
fn bridged(mut ring: Vec<usize>, mut holes: Vec<Vec<usize>>, at: &dyn Fn(usize) -> Vec2) -> Vec<usize> {
    while let Some(hole) = holes.pop() {
        let meets = |loops: &[usize], a: usize, b: usize| {
            (0..loops.len()).any(|k| {
                let (c, d) = (loops[k], loops[(k + 1) % loops.len()]);
                let apart = [c, d].iter().all(|&it| at(it) != at(a) && at(it) != at(b));
                apart && segments_meet(at(a), at(b), at(c), at(d))
            })
        };
        let sees =
            |a: usize, b: usize| !meets(&ring, a, b) && !meets(&hole, a, b) && holes.iter().all(|it| !meets(it, a, b));
        let pairs = (0..ring.len()).flat_map(|k| (0..hole.len()).map(move |h| (k, h)));
        let best = pairs
            .map(|(k, h)| ((at(ring[k]) - at(hole[h])).norm(), k, h))
            .filter(|&(_, k, h)| sees(ring[k], hole[h]))
            .min_by(|a, b| a.0.total_cmp(&b.0));
        let Some((_, k, h)) = best else { continue };
        let slit = (0..=hole.len()).map(|i| hole[(h + i) % hole.len()]).chain([ring[k]]);
        ring.splice(k + 1..k + 1, slit.collect::<Vec<_>>());
    }
    ring
}

#[cfg(test)]
mod tests {
    use super::*;

    fn volume(mesh: &TriMesh) -> f64 {
        mesh.faces().map(|f| mesh.face_positions(f)).map(|[a, b, c]| a.dot(&b.cross(&c)) / 6.0).sum()
    }

    #[test]
    fn a_ring_sector_with_holes_is_closed_and_has_its_volume() {
        let section = [[40.0, 0.0], [60.0, 0.0], [60.0, 30.0], [40.0, 30.0]].map(Vec2::from).to_vec();
        let plain =
            Sector { section, angles: [0.2, 1.4], steps: 200, radius: 3.0, ends: [vec![], vec![]], level: vec![] };
        let exact = 1.2 / 2.0 * (60.0_f64.powi(2) - 40.0_f64.powi(2)) * 30.0;
        let mesh = plain.mesh().unwrap();
        assert!(mesh.boundary_loops().is_empty() && mesh.components().1 == 1);
        assert!((volume(&mesh) / exact - 1.0).abs() < 1e-4);
        let hole = |x: f64, y: f64| Hole { at: Vec2::new(x, y), depth: 8.0 };
        let ends = [vec![hole(50.0, 8.0), hole(50.0, 22.0)], vec![hole(50.0, 8.0)]];
        let level = vec![(0, vec![hole(50.0, 0.5), hole(50.0, 1.1)]), (2, vec![hole(50.0, 0.8)])];
        let drilled = Sector { ends, level, ..plain }.mesh().unwrap();
        assert!(drilled.boundary_loops().is_empty() && drilled.components().1 == 1);
        let polygon = ROUND as f64 / 2.0 * 9.0 * (std::f64::consts::TAU / ROUND as f64).sin();
        let taken = volume(&mesh) - volume(&drilled);
        assert!((taken - 6.0 * 8.0 * polygon).abs() < 1e-6, "{taken}");
    }
}
