//! What every edge collapse algorithm needs besides the connectivity: a queue of edges whose prices change, and the
//! checks that keep faces from turning over or degenerating.
use std::{cmp::Reverse, collections::BinaryHeap};

use super::edit::EditMesh;
use crate::{
    geom::Vec3,
    mesh::{FaceId, HalfedgeId, Id, VertexId},
};

/// Edges in the order of their price, cheapest first; equal prices in the order of their ids, so that the result does not
/// depend on how the queue was filled. Old entries stay in the heap until they surface and are recognised as stale.
#[derive(Debug, Default)]
pub struct EdgeQueue {
    heap: BinaryHeap<Reverse<Entry>>,
    /// Per halfedge: raised whenever entries for it become invalid.
    versions: Vec<u32>,
}

/// Price, edge, version, from the highest bit down: compared as one number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Entry(u128);

impl Entry {
    fn new(price: f64, edge: HalfedgeId, version: u32) -> Self {
        // The bits of floats that are not negative are ordered like the floats. `+ 0.0` turns -0 into 0.
        let price = (price.max(0.0) + 0.0).to_bits();
        Self(u128::from(price) << 64 | u128::from(edge.0) << 32 | u128::from(version))
    }
    fn price(self) -> f64 {
        f64::from_bits((self.0 >> 64) as u64)
    }
    fn edge(self) -> HalfedgeId {
        HalfedgeId((self.0 >> 32) as u32)
    }
    fn version(self) -> u32 {
        self.0 as u32
    }
}

impl EdgeQueue {
    /// Sets the price of the edge of `h`, replacing any earlier one. Prices below 0 count as 0.
    pub fn set(&mut self, mesh: &EditMesh, h: HalfedgeId, price: f64) {
        let edge = mesh.edge(h);
        self.expire(edge);
        self.heap.push(Reverse(Entry::new(price, edge, self.versions[edge.index()])));
    }

    /// Takes the cheapest edge out: its price and the halfedge that stands for it.
    pub fn pop(&mut self) -> Option<(f64, HalfedgeId)> {
        let price = self.lowest()?;
        let Reverse(entry) = self.heap.pop()?;
        Some((price, entry.edge()))
    }

    /// The price of the cheapest edge.
    pub fn lowest(&mut self) -> Option<f64> {
        loop {
            let Reverse(entry) = *self.heap.peek()?;
            if self.versions[entry.edge().index()] == entry.version() {
                return Some(entry.price());
            }
            self.heap.pop();
        }
    }

    /// Takes out the edges that a collapse of `h` is about to remove or join; call it before the collapse. The joined ones
    /// have to be priced again afterwards, with all edges at the vertex that stays.
    pub fn remove_for_collapse(&mut self, mesh: &EditMesh, h: HalfedgeId) {
        for side in [Some(h), mesh.twin(h)].into_iter().flatten() {
            for edge in [side, mesh.next(side), mesh.previous(side)] {
                self.expire(edge);
                if let Some(twin) = mesh.twin(edge) {
                    self.expire(twin);
                }
            }
        }
    }

    /// Takes the edge of `h` out, if it is in.
    pub fn remove(&mut self, mesh: &EditMesh, h: HalfedgeId) {
        self.expire(mesh.edge(h));
    }

    fn expire(&mut self, h: HalfedgeId) {
        if self.versions.len() <= h.index() {
            self.versions.resize(h.index() + 1, 0);
        }
        self.versions[h.index()] += 1;
    }
}

/// How far the faces around a collapsed edge may change.
#[derive(Debug, Clone, Copy)]
pub struct Guard {
    /// Smallest cosine between the normals of a face before and after.
    pub min_cosine: f64,
    /// Smallest [`quality`] of a face after, unless a face around the edge was worse before.
    pub min_quality: f64,
    /// Smallest cosine between the normals of neighbouring faces after, unless there was a sharper fold before.
    pub min_fold: f64,
}

/// A face around the vertex that a collapse leaves: the halfedge opposite that vertex, and the corners after, that vertex
/// first.
pub type FanFace = (HalfedgeId, [Vec3; 3]);

/// The faces that a collapse of `h` removes.
pub fn dying(mesh: &EditMesh, h: HalfedgeId) -> Vec<FaceId> {
    [Some(h), mesh.twin(h)].into_iter().flatten().map(|side| mesh.face(side)).collect()
}

/// The faces around `v` after it has moved to `position`.
pub fn star_after(mesh: &EditMesh, v: VertexId, position: Vec3) -> Vec<FanFace> {
    let corners = |out| [position, mesh.position(mesh.head(out)), mesh.position(mesh.apex(out))];
    mesh.outgoing(v).map(|out| (mesh.next(out), corners(out))).collect()
}

/// The faces around the vertex that a collapse of `h` leaves at `position`.
pub fn fan_after(mesh: &EditMesh, h: HalfedgeId, position: Vec3) -> Vec<FanFace> {
    let ends = [mesh.tail(h), mesh.head(h)];
    let mut fan = Vec::with_capacity(16);
    for (v, other) in [(ends[0], ends[1]), (ends[1], ends[0])] {
        for out in mesh.outgoing(v) {
            let (b, c) = (mesh.head(out), mesh.apex(out));
            if b != other && c != other {
                fan.push((mesh.next(out), [position, mesh.position(b), mesh.position(c)]));
            }
        }
    }
    fan
}

fn unit(n: Vec3) -> Vec3 {
    n.try_normalize(0.0).unwrap_or_else(Vec3::zeros)
}

/// The smallest cosine between the normals of neighbouring faces of the fan that a collapse of `h` leaves, and of these and
/// the faces around them.
pub fn sharpest_fold(mesh: &EditMesh, h: HalfedgeId, fan: &[FanFace]) -> f64 {
    let normals: Vec<Vec3> = fan.iter().map(|(_, [a, b, c])| unit((b - a).cross(&(c - a)))).collect();
    let ends = [mesh.tail(h), mesh.head(h)];
    let mut sharpest = f64::INFINITY;
    for (i, (opposite, _)) in fan.iter().enumerate() {
        for (j, (other, _)) in fan.iter().enumerate() {
            if mesh.head(*opposite) == mesh.tail(*other) {
                sharpest = sharpest.min(normals[i].dot(&normals[j]));
            }
        }
        let outside = mesh.twin(*opposite).filter(|t| !ends.contains(&mesh.apex(*t)));
        if let Some(outside) = outside {
            sharpest = sharpest.min(normals[i].dot(&unit(mesh.area_vector(mesh.face(outside)))));
        }
    }
    sharpest
}

/// Shape of a triangle: 1 if equilateral, 0 if degenerate (4 √3 area over the sum of the squared sides).
pub fn quality([a, b, c]: [Vec3; 3]) -> f64 {
    let squares = (b - a).norm_squared() + (c - b).norm_squared() + (a - c).norm_squared();
    if squares > 0.0 { 12.0_f64.sqrt() * (b - a).cross(&(c - a)).norm() / squares } else { 0.0 }
}

impl Guard {
    /// Normals of faces worse than this are noise and not compared.
    const SLIVER: f64 = 1e-4;

    /// Whether the edge of `h` may collapse to `position`: no face that stays turns by more than the guard allows, none
    /// becomes a sliver, and no two are folded onto each other.
    pub fn allows(&self, mesh: &EditMesh, h: HalfedgeId, position: Vec3) -> bool {
        let fan = fan_after(mesh, h, position);
        let mut worst = [mesh.face(h), mesh.face(mesh.twin(h).unwrap_or(h))]
            .map(|f| quality(mesh.face_positions(f)))
            .into_iter()
            .fold(f64::INFINITY, f64::min);
        let mut worst_after = f64::INFINITY;
        for (opposite, after) in &fan {
            let before = mesh.face_positions(mesh.face(*opposite));
            let quality_before = quality(before);
            worst = worst.min(quality_before);
            worst_after = worst_after.min(quality(*after));
            if quality_before > Self::SLIVER && self.turns(before, *after) {
                return false;
            }
        }
        worst_after >= self.min_quality.min(worst) && self.folds_allowed(mesh, h, &fan)
    }

    fn folds_allowed(&self, mesh: &EditMesh, h: HalfedgeId, fan: &[FanFace]) -> bool {
        let sharpest = sharpest_fold(mesh, h, fan);
        if sharpest >= self.min_fold {
            return true;
        }
        let ends = [mesh.tail(h), mesh.head(h)];
        let around = ends.into_iter().flat_map(|v| mesh.outgoing(v)).flat_map(|out| [out, mesh.next(out)]);
        let before = around.filter_map(|h| Some([h, mesh.twin(h)?].map(|h| unit(mesh.area_vector(mesh.face(h))))));
        sharpest >= before.map(|[n, m]| n.dot(&m)).fold(f64::INFINITY, f64::min)
    }

    fn turns(&self, before: [Vec3; 3], after: [Vec3; 3]) -> bool {
        let normal = |[a, b, c]: [Vec3; 3]| (b - a).cross(&(c - a));
        let (n, m) = (normal(before), normal(after));
        n.dot(&m) < self.min_cosine * (n.norm_squared() * m.norm_squared()).sqrt()
    }

    /// Whether `v` may move to `position`, by the same rules.
    pub fn allows_move(&self, mesh: &EditMesh, v: VertexId, position: Vec3) -> bool {
        let (mut worst_before, mut worst_after) = (f64::INFINITY, f64::INFINITY);
        for out in mesh.outgoing(v) {
            let before = [v, mesh.head(out), mesh.apex(out)].map(|w| mesh.position(w));
            let after = [position, before[1], before[2]];
            let before_quality = quality(before);
            worst_before = worst_before.min(before_quality);
            worst_after = worst_after.min(quality(after));
            if before_quality > Self::SLIVER && self.turns(before, after) {
                return false;
            }
        }
        worst_after >= self.min_quality.min(worst_before)
    }
}
