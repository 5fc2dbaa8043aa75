//! Cuts a mesh along half circles from pole to pole and along circles about the axis of its image on the sphere.
use crate::{
    geom::Vec3,
    mesh::{EdgeId, FaceId, HalfedgeId, Id, MeshError, TriMesh, VertexId},
    surface::edit::EditMesh,
};

use super::mend::mend;

/// A line that crosses an edge within this share of its length from a vertex passes through the vertex, which bends it by less.
const NEAR: f64 = 0.04;
/// Where it cannot, crossings keep this share from the vertex, so that no face is without area.
const MARGIN: f64 = 0.01;

/// A mesh with lines as edges, and the image of its vertices on the sphere.
#[derive(Debug, Clone)]
pub struct Sliced {
    edit: EditMesh,
    points: Vec<Vec3>,
    /// Mean length of the edges around a vertex before the slices; between the ends of its edge for a new one.
    sizes: Vec<f64>,
    /// Vertices strictly inside a cap, where meridians end.
    capped: Vec<bool>,
}

impl Sliced {
    /// `points` is the image of every vertex; the poles are vertices at (0, 0, ±1).
    pub fn new(mesh: &TriMesh, points: &[Vec3]) -> Self {
        let size = |v: VertexId| {
            let lengths = mesh.neighbors(v).map(|w| (mesh.position(w) - mesh.position(v)).norm());
            let (sum, count) = lengths.fold((0.0, 0.0), |(sum, count), it| (sum + it, count + 1.0));
            sum / count
        };
        let sizes = mesh.vertices().map(size).collect();
        Self { edit: EditMesh::new(mesh), points: points.to_vec(), sizes, capped: vec![false; points.len()] }
    }

    /// Cuts along the circle at the height `z` on the sphere; what lies on the side of the pole (0, 0, `cap`), if given, is a
    /// cap.
    pub fn circle(&mut self, z: f64, cap: Option<f64>) {
        let side = self.points.iter().map(|p| p.z - z).collect();
        self.cut(side, cap, |_| true);
    }

    /// Cuts along the meridian at a longitude, radians, outside of caps.
    pub fn meridian(&mut self, longitude: f64) {
        let (sin, cos) = longitude.sin_cos();
        let side =
            self.points.iter().map(|p| if p.x == 0.0 && p.y == 0.0 { 0.0 } else { cos * p.y - sin * p.x }).collect();
        self.cut(side, None, |p| cos * p.x + sin * p.y > 0.0);
    }

    /// Splits the edges whose ends lie on different sides, where `front` holds, and marks the edges along the line; vertices on
    /// the side of the sign of `cap`, if given, are within a cap.
    fn cut(&mut self, mut side: Vec<f64>, cap: Option<f64>, front: impl Fn(Vec3) -> bool) {
        self.pass_through_vertices(&mut side, &front);
        if let Some(pole) = cap {
            self.capped.iter_mut().zip(&side).for_each(|(it, side)| *it |= side * pole > 0.0);
        }
        // A split moves edges of the faces beside it to new halfedges, which are appended and so come up later.
        let mut next = 0;
        while next < self.edit.halfedge_capacity() {
            let h = HalfedgeId::new(next);
            next += 1;
            let Some((share, image)) = self.crossing(h, &side).filter(|it| front(it.1)) else { continue };
            let (a, b) = (self.edit.tail(h), self.edit.head(h));
            let (p, q) = (self.edit.position(a), self.edit.position(b));
            let new = self.edit.split(h, p + share * (q - p));
            debug_assert_eq!(new.index(), self.points.len(), "vertices are appended");
            self.points.push(image.normalize());
            self.sizes.push(0.5 * (self.sizes[a.index()] + self.sizes[b.index()]));
            // What a rim splits lies on it, not inside.
            self.capped.push(cap.is_none() && (self.capped[a.index()] || self.capped[b.index()]));
            side.push(0.0);
        }
        for h in self.edit.edges().collect::<Vec<_>>() {
            let ends = [self.edit.tail(h), self.edit.head(h)].map(VertexId::index);
            let on_line =
                ends.iter().all(|&v| side[v] == 0.0 && (front(self.points[v]) || self.points[v].z.abs() == 1.0));
            let between = self.edit.twin(h).is_some_and(|t| {
                let [left, right] = [h, t].map(|it| side[self.edit.apex(it).index()]);
                left * right < 0.0
            });
            if on_line && between && !ends.iter().any(|&v| self.capped[v]) {
                self.edit.set_mark(h, true);
            }
        }
    }

    /// Where the line crosses the edge of `h` between its ends: the share from its tail, within the margin, and the image.
    fn crossing(&self, h: HalfedgeId, side: &[f64]) -> Option<(f64, Vec3)> {
        let ends = [self.edit.tail(h), self.edit.head(h)].map(VertexId::index);
        let [da, db] = ends.map(|v| side[v]);
        let share = (da / (da - db)).clamp(MARGIN, 1.0 - MARGIN);
        (da * db < 0.0).then(|| (share, self.points[ends[0]] + share * (self.points[ends[1]] - self.points[ends[0]])))
    }

    /// Lets the line pass through vertices that it nearly meets, nearest first, as long as no face comes to lie on it whole.
    fn pass_through_vertices(&self, side: &mut [f64], front: &impl Fn(Vec3) -> bool) {
        let mut near: Vec<(f64, VertexId)> = Vec::new();
        for h in self.edit.edges() {
            let Some((share, _)) = self.crossing(h, side).filter(|it| front(it.1)) else { continue };
            near.extend((share < NEAR).then_some((share, self.edit.tail(h))));
            near.extend((1.0 - share < NEAR).then_some((1.0 - share, self.edit.head(h))));
        }
        near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        for (_, v) in near {
            let zero = |v: VertexId| side[v.index()] == 0.0;
            if !self.edit.outgoing(v).any(|h| zero(self.edit.head(h)) && zero(self.edit.apex(h))) {
                side[v.index()] = 0.0;
            }
        }
    }

    /// The mesh without slivers beside the lines, the image of its vertices, and the edges along the lines, ascending.
    pub fn finish(mut self) -> Result<(TriMesh, Vec<Vec3>, Vec<EdgeId>), MeshError> {
        mend(&mut self.edit, &self.points, &self.sizes);
        let mesh = self.edit.finish()?;
        let points = self.edit.vertices().map(|v| self.points[v.index()]).collect();
        let marked = |f: FaceId| (0..3).map(move |k| HalfedgeId(3 * f.0 + k)).map(|h| self.edit.is_marked(h));
        // Faces keep their order and their corners.
        let marks = self.edit.faces().flat_map(marked);
        let mut lines: Vec<EdgeId> = mesh.halfedges().zip(marks).filter(|it| it.1).map(|it| mesh.edge(it.0)).collect();
        lines.sort_unstable();
        lines.dedup();
        Ok((mesh, points, lines))
    }
}

/// Longitude and latitude of the middle of a face on the sphere, radians.
pub fn middle(mesh: &TriMesh, points: &[Vec3], f: FaceId) -> (f64, f64) {
    let sum: Vec3 = mesh.face_vertices(f).iter().map(|v| points[v.index()]).sum();
    (f64::atan2(sum.y, sum.x), f64::atan2(sum.z, sum.xy().norm()))
}
