//! Divides the edges of a tessellation where the surface lies far from it: limbs that a pattern on the sphere passes over.
use super::{SphereError, locate::Locator};
use crate::{
    geom::{Vec3, closest_on_triangle},
    mesh::{FaceId, HalfedgeId, Id, MeshError, TriMesh, VertexId, distance::SurfacePoint},
    numeric::{Cancelled, Monitor},
    surface::{
        collapse::{EdgeQueue, quality},
        edit::EditMesh,
    },
};

/// At most so many times the vertices that there were.
const GROWTH: usize = 6;
/// No edge is divided where that makes a face of a lower quality.
const SLIVER: f64 = 0.05;
/// The monitor is asked after so many divided edges.
const ASK: usize = 256;

/// A tessellation on the surface that knows where its vertices are on the sphere.
#[derive(Debug)]
pub struct Net<'a> {
    locator: &'a Locator<'a>,
    edit: EditMesh,
    points: Vec<Vec3>,
    spots: Vec<SurfacePoint>,
    most: usize,
}

impl<'a> Net<'a> {
    /// `points` on the sphere lie at `spots`.
    pub(super) fn new(
        locator: &'a Locator<'a>,
        faces: &[[u32; 3]],
        points: Vec<Vec3>,
        spots: Vec<SurfacePoint>,
    ) -> Result<Self, MeshError> {
        let places = spots.iter().map(|it| it.position(locator.mesh())).collect();
        let edit = EditMesh::new(&TriMesh::new(places, faces)?);
        Ok(Self { locator, edit, most: GROWTH * points.len(), points, spots })
    }

    /// Its faces as a mesh.
    pub fn mesh(&self) -> Result<TriMesh, MeshError> {
        self.edit.finish()
    }

    /// Divides edges until the surface that belongs to the middles of edges and faces lies within `distance`, mm, of them; the
    /// longest edge of a face first, which keeps the shapes of the faces (Rivara 1984). Whether there was anything to do.
    pub fn refine(&mut self, distance: f64, monitor: &Monitor) -> Result<bool, SphereError> {
        // The queue hands out the least price first.
        let top = self.locator.mesh().bounds().diagonal();
        let mut queue = EdgeQueue::default();
        for h in self.edit.edges().collect::<Vec<_>>() {
            queue.set(&self.edit, h, top - self.departure(h));
        }
        let mut divided = 0;
        while let Some((price, edge)) = queue.pop() {
            if top - price <= distance || self.points.len() >= self.most {
                break;
            }
            if divided % ASK == 0 {
                monitor.check().map_err(|it: Cancelled| SphereError::from(it))?;
            }
            let Some(middle) = self.divide(self.longest(edge)) else { continue };
            divided += 1;
            let around: Vec<HalfedgeId> =
                self.edit.outgoing(middle).flat_map(|h| [h, self.edit.next(h)]).chain([edge]).collect();
            for h in around {
                queue.set(&self.edit, h, top - self.departure(h));
            }
        }
        Ok(divided > 0)
    }

    fn length(&self, h: HalfedgeId) -> f64 {
        self.edit.vector(h).norm()
    }

    /// From an edge over longer edges of its faces to one that is the longest of both.
    fn longest(&self, edge: HalfedgeId) -> HalfedgeId {
        let mut at = edge;
        loop {
            let sides = [Some(at), self.edit.twin(at)].into_iter().flatten();
            let others = sides.flat_map(|h| [self.edit.next(h), self.edit.previous(h)]);
            match others.max_by(|&g, &h| self.length(g).total_cmp(&self.length(h))) {
                Some(h) if self.length(h) > self.length(at) => at = h,
                _ => return at,
            }
        }
    }

    /// Divides an edge where the middle of its ends on the sphere lies on the surface; `None` where that would leave a sliver.
    fn divide(&mut self, h: HalfedgeId) -> Option<VertexId> {
        let ends = [self.edit.tail(h), self.edit.head(h)].map(VertexId::index);
        let (point, spot) = self.between(&ends)?;
        let place = spot.position(self.locator.mesh());
        let sides = [Some(h), self.edit.twin(h)].into_iter().flatten();
        let mut halves = sides.flat_map(|side| {
            let [a, b, c] =
                [self.edit.tail(side), self.edit.head(side), self.edit.apex(side)].map(|v| self.edit.position(v));
            [[a, place, c], [place, b, c]]
        });
        if halves.any(|it| quality(it) < SLIVER) {
            return None;
        }
        let new = self.edit.split(h, place);
        self.points.push(point);
        self.spots.push(spot);
        Some(new)
    }

    /// The direction between some vertices, and its place on the surface.
    fn between(&self, vertices: &[usize]) -> Option<(Vec3, SurfacePoint)> {
        let point = vertices.iter().map(|&v| self.points[v]).sum::<Vec3>().try_normalize(1e-300)?;
        Some((point, self.locator.locate(point, self.spots[vertices[0]].face)))
    }

    /// How far the surface at the middle of an edge lies from the edge, or that at the middle of a face whose longest edge it
    /// is from the face, mm.
    fn departure(&self, h: HalfedgeId) -> f64 {
        let off = |vertices: &[usize], corners: [Vec3; 3]| {
            self.between(vertices).map_or(0.0, |(_, spot)| {
                let place = spot.position(self.locator.mesh());
                closest_on_triangle(&place, &corners).1.sqrt()
            })
        };
        let place = |v: VertexId| self.edit.position(v);
        let [a, b] = [self.edit.tail(h), self.edit.head(h)];
        let mut most = off(&[a.index(), b.index()], [place(a), place(b), place(b)]);
        for side in [Some(h), self.edit.twin(h)].into_iter().flatten() {
            let longest = [self.edit.next(side), self.edit.previous(side)]
                .into_iter()
                .all(|it| self.length(it) <= self.length(h));
            if longest {
                let f: FaceId = self.edit.face(side);
                let corners = self.edit.face_vertices(f);
                most = most.max(off(&corners.map(VertexId::index), self.edit.face_positions(f)));
            }
        }
        most
    }
}
