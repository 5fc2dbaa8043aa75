//! From the sphere back to the surface: which face a direction lies in, and lines on the sphere as pieces of faces.
use super::certify::sign;
use crate::{
    geom::Vec3,
    mesh::{FaceId, Id, TriMesh, VertexId, distance::SurfacePoint},
};

/// Halvings of a stretch between faces that are not neighbours; a stretch that is shorter still is left out.
const HALVINGS: u32 = 40;
/// Edges that the plane of a stretch misses by less than this on the unit sphere lie in it.
const ALONG: f64 = 1e-9;

/// A stretch of a line within one face.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stretch {
    /// The face.
    pub face: FaceId,
    /// Barycentric coordinates of both ends.
    pub ends: [[f64; 3]; 2],
}

/// Finds places of a closed surface by their image on the sphere.
#[derive(Debug, Clone, Copy)]
pub struct Locator<'a> {
    mesh: &'a TriMesh,
    points: &'a [Vec3],
}

impl<'a> Locator<'a> {
    /// `points` is the image of every vertex.
    pub fn new(mesh: &'a TriMesh, points: &'a [Vec3]) -> Self {
        assert_eq!(points.len(), mesh.vertex_count(), "one point per vertex");
        Self { mesh, points }
    }

    /// The mesh.
    pub fn mesh(&self) -> &'a TriMesh {
        self.mesh
    }

    /// Image of a vertex.
    pub fn point(&self, v: VertexId) -> Vec3 {
        self.points[v.index()]
    }

    pub(super) fn corners(&self, f: FaceId) -> [Vec3; 3] {
        self.mesh.face_vertices(f).map(|v| self.points[v.0 as usize])
    }

    /// det(p, b, c), det(a, p, c), det(a, b, p) over their sum: all not negative inside.
    fn weights(&self, f: FaceId, p: Vec3) -> [f64; 3] {
        let [a, b, c] = self.corners(f);
        // From differences to the first corner, which keeps the digits of small faces.
        let (ab, ac, ap) = (b - a, c - a, p - a);
        let volumes = [p.dot(&(b - p).cross(&(c - p))), a.dot(&ap.cross(&ac)), a.dot(&ab.cross(&ap))];
        let sum: f64 = volumes.iter().sum();
        volumes.map(|it| it / sum)
    }

    /// The face that a direction lies in, searched by walking from `hint`, where it is quickest.
    pub fn locate(&self, p: Vec3, hint: FaceId) -> SurfacePoint {
        let corners = |f: FaceId| self.corners(f);
        let across = |f: FaceId, k: usize| self.mesh.twin(self.mesh.face_halfedges(f)[k]).map(|t| self.mesh.face(t));
        let face = walk(p, hint, self.mesh.face_count(), corners, across)
            .or_else(|| search(p, self.mesh.faces(), corners))
            .unwrap_or(FaceId(0));
        self.spot(face, p)
    }

    fn spot(&self, face: FaceId, p: Vec3) -> SurfacePoint {
        let weights = self.weights(face, p).map(|it| if it.is_finite() { it.max(0.0) } else { 1.0 });
        let sum: f64 = weights.iter().sum();
        SurfacePoint { face, barycentric: weights.map(|it| it / sum) }
    }

    /// A line on the sphere, given by points not farther apart than a right angle, as stretches within faces.
    pub fn trace(&self, line: &[Vec3]) -> Vec<Stretch> {
        let mut out = Vec::new();
        let mut hint = FaceId(0);
        for pair in line.windows(2) {
            let from = self.locate(pair[0], hint);
            let to = self.locate(pair[1], from.face);
            self.join([pair[0], pair[1]], [from, to], HALVINGS, &mut out);
            hint = to.face;
        }
        out
    }

    fn join(&self, [p, q]: [Vec3; 2], [from, to]: [SurfacePoint; 2], halvings: u32, out: &mut Vec<Stretch>) {
        if from.face == to.face {
            out.push(Stretch { face: from.face, ends: [from.barycentric, to.barycentric] });
            return;
        }
        let shared = self
            .mesh
            .face_halfedges(from.face)
            .into_iter()
            .position(|h| self.mesh.twin(h).is_some_and(|twin| self.mesh.face(twin) == to.face));
        if let Some(k) = shared {
            // Where the plane of p and q cuts the edge between the faces.
            let h = self.mesh.face_halfedges(from.face)[k];
            let normal = p.cross(&q);
            let [a, b] = [self.mesh.tail(h), self.mesh.head(h)];
            let [da, db] = [a, b].map(|v| normal.dot(&self.points[v.0 as usize]));
            let share = if da.abs().max(db.abs()) > ALONG * normal.norm() {
                da / (da - db)
            } else {
                // The line runs along the edge: as far as it goes.
                let weight =
                    |v| self.mesh.face_vertices(to.face).iter().position(|&w| w == v).map(|k| to.barycentric[k]);
                let [a, b] = [a, b].map(|v| weight(v).unwrap_or(0.0));
                b / (a + b)
            };
            if (0.0..=1.0).contains(&share) {
                let cross = |f: FaceId| {
                    self.mesh.face_vertices(f).map(|v| {
                        if v == a {
                            1.0 - share
                        } else if v == b {
                            share
                        } else {
                            0.0
                        }
                    })
                };
                out.push(Stretch { face: from.face, ends: [from.barycentric, cross(from.face)] });
                out.push(Stretch { face: to.face, ends: [cross(to.face), to.barycentric] });
                return;
            }
        }
        let middle = (p + q).normalize();
        if halvings > 0 && middle != p && middle != q {
            let spot = self.locate(middle, from.face);
            self.join([p, middle], [from, spot], halvings - 1, out);
            self.join([middle, q], [spot, to], halvings - 1, out);
        }
    }
}

/// Goes from face to face towards a direction, by exact predicates, as faces may be smaller than the rounding of a product;
/// `corners` of a face on the sphere, the face `across` its side from corner k to the
/// next. `None` where faces are turned over on the way.
pub(super) fn walk(
    p: Vec3,
    hint: FaceId,
    faces: usize,
    corners: impl Fn(FaceId) -> [Vec3; 3],
    across: impl Fn(FaceId, usize) -> Option<FaceId>,
) -> Option<FaceId> {
    let mut at = hint;
    let longest = 200 + 8 * (faces as f64).sqrt() as usize;
    for step in 0..longest {
        let [a, b, c] = corners(at);
        let ends = [[a, b], [b, c], [c, a]];
        // Another side first on every other step, so that a walk in a circle ends.
        let sides = if step % 2 == 0 { [0, 1, 2] } else { [2, 1, 0] };
        match sides.into_iter().find(|&k| sign(ends[k][0], ends[k][1], p) < 0.0) {
            Some(k) => at = across(at, k)?,
            None => return ((a + b + c).dot(&p) > 0.0).then_some(at),
        }
    }
    None
}

/// The same by looking at every face: the one that the direction lies deepest in.
pub(super) fn search(
    p: Vec3,
    faces: impl Iterator<Item = FaceId>,
    corners: impl Fn(FaceId) -> [Vec3; 3],
) -> Option<FaceId> {
    let depth = |f: FaceId| {
        let [a, b, c] = corners(f);
        let least =
            [a.cross(&b), b.cross(&c), c.cross(&a)].map(|it| it.dot(&p)).into_iter().fold(f64::INFINITY, f64::min);
        if (a + b + c).dot(&p) > 0.0 { least } else { f64::NEG_INFINITY }
    };
    faces.map(|f| (depth(f), f)).max_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1))).map(|it| it.1)
}
