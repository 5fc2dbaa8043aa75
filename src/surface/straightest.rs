//! Straightest geodesics of a mesh (Polthier, Schmies 1998): straight on in the unfolding of the faces that they cross.
use crate::{
    geom::Vec3,
    mesh::{FaceId, TriMesh},
};

/// A point on the way, with the direction of travel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Traveller {
    /// Where it is, mm.
    pub point: Vec3,
    /// The face it is in.
    pub face: FaceId,
    /// Unit direction in the plane of the face.
    pub direction: Vec3,
}

/// Share of a face's size by which a traveller that meets a vertex is moved into the face.
const NUDGE: f64 = 1e-9;

impl Traveller {
    /// A traveller in `face`, with the part of `direction` that lies in it; `None` where that is nothing.
    pub fn new(mesh: &TriMesh, face: FaceId, point: Vec3, direction: Vec3) -> Option<Self> {
        let normal = mesh.normal(face);
        let direction = (direction - normal * normal.dot(&direction)).try_normalize(1e-12)?;
        Some(Self { point, face, direction })
    }

    /// Who sets out from the same point to the left.
    pub fn left(&self, mesh: &TriMesh) -> Self {
        Self { direction: mesh.normal(self.face).cross(&self.direction), ..*self }
    }

    /// Who sets out from the same point backwards.
    pub fn reversed(&self) -> Self {
        Self { direction: -self.direction, ..*self }
    }

    /// Where this one is after a way of the length `distance`. `Err` holds the way that was left when the boundary was reached.
    pub fn walk(mut self, mesh: &TriMesh, mut distance: f64) -> Result<Self, f64> {
        // A face is crossed at most once per visit; a straight line that crosses so many never gets anywhere.
        for _ in 0..4 * mesh.face_count() + 16 {
            let normal = mesh.normal(self.face);
            let inwards = |h| normal.cross(&mesh.vector(h));
            let exit = mesh
                .face_halfedges(self.face)
                .into_iter()
                .filter(|&h| inwards(h).dot(&self.direction) < 0.0)
                .map(|h| {
                    let height = inwards(h).dot(&(self.point - mesh.position(mesh.tail(h)))).max(0.0);
                    (height / -inwards(h).dot(&self.direction), h)
                })
                .min_by(|a, b| a.0.total_cmp(&b.0));
            let Some((way, h)) = exit else { return Err(distance) };
            if way >= distance {
                self.point += self.direction * distance;
                return Ok(self);
            }
            let Some(twin) = mesh.twin(h) else { return Err(distance - way) };
            distance -= way;
            let edge = mesh.vector(h).normalize();
            let along = edge.dot(&self.direction);
            let across = (1.0 - along * along).max(0.0).sqrt();
            self.face = mesh.face(twin);
            self.direction = edge * along + mesh.normal(self.face).cross(&-edge) * across;
            // Stay off the corners, where the next edge would be a matter of rounding.
            let tail = mesh.position(mesh.tail(h));
            let length = mesh.vector(h).norm();
            let at = (self.point - tail).dot(&edge) + way * along;
            self.point = tail + edge * at.clamp(NUDGE * length, (1.0 - NUDGE) * length);
        }
        Err(distance)
    }

    /// The points at the multiples 1, 2, … of `step`, `most` of them or up to the boundary.
    pub fn points(self, mesh: &TriMesh, step: f64, most: usize) -> Vec<Self> {
        let mut at = self;
        let next = || {
            at = at.walk(mesh, step).ok()?;
            Some(at)
        };
        std::iter::from_fn(next).take(most).collect()
    }

    /// How far it is to the boundary, at most `limit`.
    pub fn reach(self, mesh: &TriMesh, limit: f64) -> f64 {
        self.walk(mesh, limit).map_or_else(|left| limit - left, |_| limit)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;

    #[test]
    fn a_geodesic_of_a_cylinder_is_a_helix() {
        let (radius, height) = (10.0, 60.0);
        let mesh = shapes::cylinder(radius, height, 96, 8);
        let bvh = crate::mesh::Bvh::new(&mesh);
        let start = bvh.closest(Vec3::new(radius, 0.3, 20.0));
        let slope = 0.5_f64;
        let from = Traveller::new(&mesh, start.face, start.point, Vec3::new(0.0, slope.cos(), slope.sin())).unwrap();
        let points = from.points(&mesh, 1.0, 70);
        assert_eq!(points.len(), 70);
        for (k, it) in points.iter().enumerate() {
            let height = start.point.z + (k + 1) as f64 * from.direction.z;
            assert!((it.point.z - height).abs() < 1e-9, "{k}: {} against {height}", it.point.z);
        }
    }

    #[test]
    fn on_a_plane_it_ends_at_the_boundary() {
        let mesh = shapes::grid(6, 6, 1.0);
        let start = crate::mesh::Bvh::new(&mesh).closest(Vec3::new(2.2, 3.1, 0.0));
        let way = Vec3::new(0.6, 0.8, 0.0);
        let from = Traveller::new(&mesh, start.face, start.point, way).unwrap();
        let bounds = mesh.bounds();
        let expected = ((bounds.max.x - start.point.x) / way.x).min((bounds.max.y - start.point.y) / way.y);
        assert!((from.reach(&mesh, 100.0) - expected).abs() < 1e-9);
        assert!(from.walk(&mesh, expected + 0.1).is_err());
    }
}
