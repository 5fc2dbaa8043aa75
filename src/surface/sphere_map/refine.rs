//! Divides the faces of a tessellation where the surface lies far from it: limbs that a pattern on the sphere passes over.
use super::{SphereError, net::Net};
use crate::{
    geom::{Vec3, closest_on_triangle},
    mesh::{Bvh, FaceId, HalfedgeId, Id, VertexId},
    numeric::Monitor,
};

/// At most so many times the vertices that there were.
const GROWTH: usize = 8;
/// Passes at most.
const PASSES: usize = 40;
/// Passes without a new vertex after which there will be none.
const STALE: usize = 6;
/// A place of the surface that is farther from its face than this share of the longest edge becomes a vertex: the tip of a limb
/// that the face cuts off. Nearer ones have the longest edge divided, which keeps the shapes of faces.
const TIP: f64 = 0.3;
/// No edge is divided where that makes a face of a lower quality, unless nothing else is left.
const SLIVER: f64 = 0.15;
const LEAST: f64 = 0.01;
/// An edge is turned where that brings its faces closer to the surface by this factor.
const LOWER: f64 = 0.7;
/// Places on a long edge of the surface are this share of the mean edge of the net apart.
const APART: f64 = 0.25;
/// Sweeps of smoothing between passes and at the end.
const BETWEEN: usize = 2;
const AFTER: usize = 10;

/// A place of the surface, and its image on the sphere.
type Sample = (Vec3, Vec3);

impl Net<'_> {
    /// Divides faces until every vertex of the surface lies within `distance`, mm, of the face that covers it.
    pub fn refine(&mut self, distance: f64, monitor: &Monitor) -> Result<(), SphereError> {
        let samples = self.samples();
        let bvh = Bvh::new(self.locator.mesh());
        let most = GROWTH * self.points.len();
        let (mut before, mut stale) = (0, 0);
        for pass in 0..PASSES {
            monitor.check()?;
            monitor.progress(pass as f64 / PASSES as f64, "dividing the tessellation");
            let far = self.far(&samples, &bvh, distance);
            stale = if self.points.len() > before { 0 } else { stale + 1 };
            if far.is_empty() || self.points.len() >= most || stale > STALE {
                break;
            }
            before = self.points.len();
            let mut touched = vec![false; self.edit.halfedge_capacity() / 3];
            for (depth, f, sample) in far {
                if touched[f.index()] {
                    continue;
                }
                let Some(new) = self.open(f, depth, samples.get(sample), (pass % 2 == 0).then_some(&bvh)) else {
                    continue;
                };
                for h in self.edit.outgoing(new) {
                    let f = self.edit.face(h).index();
                    if f >= touched.len() {
                        touched.resize(f + 1, true);
                    }
                    touched[f] = true;
                }
            }
            self.turn();
            self.untangle();
            for _ in 0..BETWEEN {
                self.smooth(1.0, 0.0);
            }
        }
        for _ in 0..AFTER {
            self.turn();
            self.untangle();
            self.smooth(1.0, 0.0);
        }
        Ok(())
    }

    /// The vertices of the surface, and places along its long edges.
    fn samples(&self) -> Vec<Sample> {
        let mesh = self.locator.mesh();
        let mean = (mesh.total_area() / self.edit.face_count() as f64 * 4.0 / 3.0_f64.sqrt()).sqrt();
        let mut out: Vec<Sample> = mesh.vertices().map(|v| (mesh.position(v), self.locator.point(v))).collect();
        for e in mesh.edges() {
            let ends = mesh.edge_vertices(e);
            let [a, b] = ends.map(|v| mesh.position(v));
            let [p, q] = ends.map(|v| self.locator.point(v));
            let parts = (mesh.edge_length(e) / (APART * mean)).ceil().max(1.0);
            out.extend((1..parts as usize).map(|k| {
                let t = k as f64 / parts;
                (a + t * (b - a), (p + t * (q - p)).normalize())
            }));
        }
        out
    }

    /// Faces with a place farther away than `distance`, the farthest first: how far, and the place.
    fn far(&self, samples: &[Sample], bvh: &Bvh, distance: f64) -> Vec<(f64, FaceId, usize)> {
        let mut worst = vec![(0.0, 0); self.edit.halfedge_capacity() / 3];
        let mut hint = self.edit.faces().next().unwrap_or(FaceId(0));
        for (i, &(place, point)) in samples.iter().enumerate() {
            hint = self.face_at(point, hint);
            let off = |f: FaceId| closest_on_triangle(&place, &self.edit.face_positions(f)).1.sqrt();
            let beside = Self::halfedges(hint).into_iter().filter_map(|h| self.edit.twin(h)).map(|t| self.edit.face(t));
            let depth = beside.map(off).fold(off(hint), f64::min);
            let slot: &mut (f64, usize) = &mut worst[hint.index()];
            if depth > slot.0 {
                *slot = (depth, i);
            }
        }
        for f in self.edit.faces() {
            let height = self.height(f, bvh);
            if height > worst[f.index()].0 {
                worst[f.index()] = (height, usize::MAX);
            }
        }
        let faces = worst.into_iter().enumerate().filter(|it| it.1.0 > distance);
        let mut far: Vec<(f64, FaceId, usize)> = faces.map(|(f, (depth, i))| (depth, FaceId::new(f), i)).collect();
        far.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        far
    }

    /// Brings a face closer to the surface: a new vertex or, given `bvh`, another edge. A vertex in the middle of what has changed.
    fn open(&mut self, f: FaceId, depth: f64, sample: Option<&Sample>, bvh: Option<&Bvh>) -> Option<VertexId> {
        let sides = Self::halfedges(f);
        let longest = sides.into_iter().max_by(|&g, &h| self.length(g).total_cmp(&self.length(h)))?;
        let insert = |net: &mut Self| sample.and_then(|it| net.insert(f, it.1));
        if depth > TIP * self.length(longest)
            && let Some(new) = insert(self)
        {
            return Some(new);
        }
        if let Some(bvh) = bvh.filter(|_| sample.is_none())
            && let Some(h) = sides.into_iter().find(|&h| self.lower(h, LOWER, bvh))
        {
            return Some(self.edit.tail(h));
        }
        let edge = self.longest(longest);
        self.divide(edge, SLIVER).or_else(|| insert(self)).or_else(|| self.divide(longest, LEAST)).or_else(|| {
            let centre = self.centre(f)?;
            self.insert(f, centre)
        })
    }

    /// From an edge over longer edges of its faces to one that is the longest of both (Rivara 1984).
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
}
