//! Isotropic remeshing: split long edges, collapse short ones, flip towards even valences, relax along the surface.
//!
//! Botsch, Kobbelt: A remeshing approach to multiresolution modeling, SGP 2004, section 4, with a target length that
//! varies (Dunyach et al.: Adaptive remeshing for real-time mesh deformation, Eurographics 2013). Here the length is uniform
//! at first and lowered where a tolerance keeps edges from growing.
mod correct;

use super::{
    CoarsenError,
    source::{Kind, Source, Spot},
    tolerance::{Test, Tolerance},
};
use crate::{
    geom::{Vec3, angle_between},
    mesh::{Bvh, FaceId, HalfedgeId, Id, TriMesh, VertexId},
    numeric::Monitor,
    surface::{
        collapse::{EdgeQueue, FanFace, Guard, dying, fan_after, quality, star_after},
        edit::EditMesh,
    },
};

/// Edges longer than this many target lengths are split, shorter than the second collapsed: after either, the edges made
/// are closer to the target than those that were there.
const LONG: f64 = 4.0 / 3.0;
const SHORT: f64 = 4.0 / 5.0;
/// Edges shorter than this many target lengths collapse to one of their ends: the middle of the surface between them is not
/// worth looking for while most of them are still to go.
const TINY: f64 = 0.4;
/// Rounds of all four steps.
const ITERATIONS: usize = 10;
/// In which of them the target length is corrected towards the number of faces wanted.
const CALIBRATE: std::ops::Range<usize> = 1..5;
/// From which of them on the target length is lowered where the tolerance keeps short edges from collapsing, at most by
/// this factor at a time.
const ADAPT: usize = 1;
const LOWER: f64 = 0.75;
/// The target length is never lowered to less than this share of the first.
const FINEST: f64 = 1.0 / 16.0;
/// For collapses. Faces of the source may be slivers, so only what is worse than before is refused.
const COLLAPSE: Guard = Guard { min_cosine: 0.3, min_quality: 0.3, min_fold: -0.3 };
/// For moves and flips. The quality of an isosceles triangle with two angles of 28° is 0.55.
const MOVE: Guard = Guard { min_cosine: 0.5, min_quality: 0.55, min_fold: -0.3 };
/// Share of the error allowed that edits may use: they only look at samples.
const SLACK: f64 = 0.85;
/// What to aim for.
pub(super) struct Target {
    /// Edge length, mm.
    pub(super) length: f64,
    /// Number of faces for which the length is corrected, if any.
    pub(super) faces: Option<usize>,
    /// Dihedral angle of creases, radians.
    pub(super) feature_angle: f64,
}

struct Remesher<'a, 'm> {
    source: Source<'a>,
    tolerance: Option<Tolerance<'a>>,
    mesh: EditMesh,
    /// Per vertex.
    kinds: Vec<Kind>,
    /// Target length of edges per vertex.
    sizes: Vec<f64>,
    /// A face of the source near each vertex.
    near: Vec<FaceId>,
    monitor: &'a Monitor<'m>,
}

/// `bvh` is that of `source`. Edits that would break `max_error` are not made, and edges become shorter than asked where
/// that is the only way to keep it.
pub(super) fn remesh<'a>(
    source: &'a TriMesh,
    bvh: &'a Bvh,
    target: &Target,
    max_error: Option<f64>,
    monitor: &'a Monitor,
) -> Result<TriMesh, CoarsenError> {
    let surface = Source::new(source, bvh, target.length, target.feature_angle);
    let mut mesh = EditMesh::new(source);
    for e in source.edges() {
        mesh.set_mark(source.halfedge(e), surface.creases[e]);
    }
    let mut run = Remesher {
        tolerance: max_error.map(|it| Tolerance::new(source, bvh, SLACK * it, Test::Sampled)),
        mesh,
        kinds: surface.kinds(target.length / 2.0).into_vec(),
        sizes: vec![target.length; source.vertex_count()],
        near: source.vertices().map(|v| source.outgoing(v).next().map_or(FaceId(0), |h| source.face(h))).collect(),
        source: surface,
        monitor,
    };
    for iteration in 0..ITERATIONS {
        monitor.progress(iteration as f64 / ITERATIONS as f64, "remeshing");
        let stuck = run.round()?;
        if iteration >= ADAPT && iteration + 2 < ITERATIONS {
            run.lower_sizes(&stuck, FINEST * target.length);
        }
        if CALIBRATE.contains(&iteration) {
            run.calibrate(target.faces);
        }
    }
    run.polish()?;
    match max_error {
        Some(limit) => run.correct(limit, FINEST * target.length),
        None => Ok(run.mesh.finish()?),
    }
}

impl Remesher<'_, '_> {
    /// Returns what [`Remesher::collapse`] returns.
    fn round(&mut self) -> Result<Vec<(FaceId, f64)>, CoarsenError> {
        self.split()?;
        let stuck = self.collapse()?;
        self.remove_peaks();
        self.flip_for_valence()?;
        self.relax()?;
        Ok(stuck)
    }

    /// Last touches that only look at the shape of faces.
    fn polish(&mut self) -> Result<(), CoarsenError> {
        self.remove_peaks();
        for _ in 0..2 {
            self.flip_for_shape()?;
            self.relax()?;
        }
        self.flip_for_shape()
    }

    /// Takes out vertices of three faces, which are flat or peaks: the three become one.
    fn remove_peaks(&mut self) {
        for v in self.mesh.vertices().collect::<Vec<_>>() {
            if self.kinds[v.index()] != Kind::Free || self.mesh.valence(v) != 3 {
                continue;
            }
            let Some(h) = self.mesh.outgoing(v).next() else { continue };
            let stays = self.mesh.position(self.mesh.head(h));
            if self.mesh.can_collapse(h)
                && COLLAPSE.allows(&self.mesh, h, stays)
                && self.try_edit(&dying(&self.mesh, h), &fan_after(&self.mesh, h, stays), self.near[v.index()])
            {
                self.mesh.collapse(h, stays);
            }
        }
    }

    /// Corrects the target length by the ratio of faces there are to faces wanted.
    fn calibrate(&mut self, faces: Option<usize>) {
        if let Some(faces) = faces {
            let factor = (self.mesh.face_count() as f64 / faces as f64).sqrt().clamp(0.8, 1.25);
            self.source.scale_sizes(factor);
            self.sizes.iter_mut().for_each(|it| *it *= factor);
        }
    }

    /// Makes the target length fit edges that could not collapse: faces of the source there, and the length of the edge.
    fn lower_sizes(&mut self, stuck: &[(FaceId, f64)], finest: f64) {
        if stuck.is_empty() {
            return;
        }
        self.source.lower_sizes(stuck, |size, length| size.min((length / SHORT).max(LOWER * size).max(finest)));
        for v in self.mesh.vertices().collect::<Vec<_>>() {
            self.sizes[v.index()] = self.source.closest(self.mesh.position(v), self.near[v.index()]).size;
        }
    }

    fn target(&self, a: VertexId, b: VertexId) -> f64 {
        self.sizes[a.index()].min(self.sizes[b.index()])
    }

    /// Length of an edge over its target.
    fn stretch(&self, h: HalfedgeId) -> f64 {
        self.mesh.vector(h).norm() / self.target(self.mesh.tail(h), self.mesh.head(h))
    }

    fn is_curve(&self, h: HalfedgeId) -> bool {
        self.mesh.is_marked(h) || self.mesh.twin(h).is_none()
    }

    /// Splits edges until none is too long, longest first in every sweep.
    fn split(&mut self) -> Result<(), CoarsenError> {
        loop {
            self.monitor.check()?;
            let mut long: Vec<_> = self.mesh.edges().map(|h| (self.stretch(h), h)).filter(|it| it.0 > LONG).collect();
            if long.is_empty() {
                return Ok(());
            }
            long.sort_by(|x, y| y.0.total_cmp(&x.0).then(x.1.cmp(&y.1)));
            for (_, h) in long {
                let [a, b] = [self.mesh.tail(h), self.mesh.head(h)].map(|v| self.mesh.position(v));
                let kind = if self.is_curve(h) { Kind::Curve } else { Kind::Free };
                self.split_edge(h, (a + b) / 2.0, kind);
            }
        }
    }

    fn split_edge(&mut self, h: HalfedgeId, position: Vec3, kind: Kind) {
        let (a, b) = (self.mesh.tail(h), self.mesh.head(h));
        let faces = [Some(h), self.mesh.twin(h)].map(|side| side.map(|side| self.mesh.face(side)));
        let middle = self.mesh.split(h, position);
        if let Some(tolerance) = &mut self.tolerance {
            // The halves that were cut off are the other faces around the new vertex.
            let around: Vec<FaceId> = self.mesh.outgoing(middle).map(|out| self.mesh.face(out)).collect();
            for (face, new) in faces.into_iter().flatten().zip(halves(&faces, &around)) {
                tolerance.split(&self.mesh, face, new);
            }
        }
        self.kinds.push(kind);
        self.sizes.push((self.sizes[a.index()] + self.sizes[b.index()]) / 2.0);
        self.near.push(self.near[a.index()]);
    }

    /// Collapses edges that are too short, shortest first, unless that makes others too long. Returns the edges that the
    /// tolerance alone has kept: a face of the source there, and their length.
    fn collapse(&mut self) -> Result<Vec<(FaceId, f64)>, CoarsenError> {
        let mut queue = EdgeQueue::default();
        for h in self.mesh.edges().filter(|&h| self.stretch(h) < SHORT) {
            queue.set(&self.mesh, h, self.stretch(h));
        }
        let mut stuck = Vec::new();
        let mut seen = 0_usize;
        while let Some((_, h)) = queue.pop() {
            seen += 1;
            if seen.is_multiple_of(1024) {
                self.monitor.check()?;
            }
            let Some((h, spot)) = self.meeting(h) else { continue };
            let fan = fan_after(&self.mesh, h, spot.point);
            let reach = LONG * spot.size;
            if fan.iter().any(|(_, [a, b, c])| (b - a).norm() > reach || (c - a).norm() > reach)
                || !self.mesh.can_collapse(h)
                || !COLLAPSE.allows(&self.mesh, h, spot.point)
            {
                continue;
            }
            if !self.try_edit(&dying(&self.mesh, h), &fan, spot.face) {
                stuck.push((spot.face, self.mesh.vector(h).norm()));
                continue;
            }
            let kept = self.mesh.head(h);
            queue.remove_for_collapse(&self.mesh, h);
            self.mesh.collapse(h, spot.point);
            self.settle(kept, spot);
            for spoke in self.mesh.spokes(kept).collect::<Vec<_>>() {
                let stretch = self.stretch(spoke);
                if stretch < SHORT {
                    queue.set(&self.mesh, spoke, stretch);
                } else {
                    queue.remove(&self.mesh, spoke);
                }
            }
        }
        Ok(stuck)
    }

    /// Whether an edit turns no face away from the source, of which `near` is a face there, and keeps to the tolerance. If
    /// so it has to be made.
    fn try_edit(&mut self, gone: &[FaceId], fan: &[FanFace], near: FaceId) -> bool {
        if fan.iter().any(|(h, after)| {
            self.source.looks_away(*after, near)
                && !self.source.looks_away(self.mesh.face_positions(self.mesh.face(*h)), near)
        }) {
            return false;
        }
        let Some(tolerance) = &mut self.tolerance else { return true };
        let allowed = tolerance.allows(&self.mesh, gone, fan);
        if allowed {
            tolerance.commit(&self.mesh, gone, fan);
        }
        allowed
    }

    /// Where the ends of an edge may meet, and the halfedge to collapse so that the end with less freedom stays. `None` if
    /// a crease or the boundary would leave its place.
    fn meeting(&self, h: HalfedgeId) -> Option<(HalfedgeId, Spot)> {
        let (u, v) = (self.mesh.tail(h), self.mesh.head(h));
        let (ku, kv) = (self.kinds[u.index()], self.kinds[v.index()]);
        let middle = (self.mesh.position(u) + self.mesh.position(v)) / 2.0;
        let stay = |w: VertexId| Spot {
            point: self.mesh.position(w),
            face: self.near[w.index()],
            size: self.sizes[w.index()],
        };
        // The collapse removes the tail, so the end that has to stay must be the head; the boundary has no twin to turn to.
        if ku == kv {
            return match ku {
                Kind::Free if self.stretch(h) < TINY => Some((h, stay(v))),
                Kind::Free => Some((h, self.source.closest(middle, self.near[u.index()]))),
                Kind::Curve if self.is_curve(h) && !self.pinches(h) => {
                    Some((h, self.source.closest_on_curve(middle, self.mesh.twin(h).is_none())?))
                }
                _ => None,
            };
        }
        if ku.min(kv) == Kind::Curve && (!self.is_curve(h) || self.pinches(h)) {
            return None;
        }
        let keep = if ku > kv { u } else { v };
        let h = if keep == v { h } else { self.mesh.twin(h).unwrap_or(h) };
        Some((h, stay(keep)))
    }

    /// Whether two creases along a face of the edge would fall into one.
    fn pinches(&self, h: HalfedgeId) -> bool {
        [Some(h), self.mesh.twin(h)]
            .into_iter()
            .flatten()
            .any(|side| self.is_curve(self.mesh.next(side)) && self.is_curve(self.mesh.previous(side)))
    }

    fn settle(&mut self, v: VertexId, spot: Spot) {
        self.near[v.index()] = spot.face;
        self.sizes[v.index()] = spot.size;
    }

    /// Flips edges where that brings valences closer to 6 (4 on the boundary) and keeps faces in shape.
    fn flip_for_valence(&mut self) -> Result<(), CoarsenError> {
        self.monitor.check()?;
        for h in self.mesh.edges().collect::<Vec<_>>() {
            let Some(t) = self.mesh.twin(h) else { continue };
            let excess = |v: VertexId, change: i64| {
                let ideal = if self.mesh.is_boundary_vertex(v) { 4 } else { 6 };
                (self.mesh.valence(v) as i64 + change - ideal).pow(2)
            };
            let ends = [self.mesh.tail(h), self.mesh.head(h)];
            let apexes = [self.mesh.apex(h), self.mesh.apex(t)];
            let sum = |change: i64| {
                ends.iter().map(|&v| excess(v, -change)).sum::<i64>()
                    + apexes.iter().map(|&v| excess(v, change)).sum::<i64>()
            };
            if sum(1) < sum(0) {
                self.try_flip(h, 0.5);
            }
        }
        Ok(())
    }

    /// Flips edges where that improves the worse of the two faces.
    fn flip_for_shape(&mut self) -> Result<(), CoarsenError> {
        self.monitor.check()?;
        for h in self.mesh.edges().collect::<Vec<_>>() {
            self.try_flip(h, 1.0 + 1e-6);
        }
        Ok(())
    }

    /// Flips the edge if the worse face is then at least `factor` times as good as the worse face before, and the surface
    /// hardly bends.
    fn try_flip(&mut self, h: HalfedgeId, factor: f64) {
        let Some(t) = self.mesh.twin(h) else { return };
        let spare = |v| self.mesh.is_boundary_vertex(v) || self.mesh.valence(v) > 4;
        if !self.mesh.can_flip(h) || !spare(self.mesh.tail(h)) || !spare(self.mesh.head(h)) {
            return;
        }
        let [a, b, c, d] =
            [self.mesh.tail(h), self.mesh.head(h), self.mesh.apex(h), self.mesh.apex(t)].map(|v| self.mesh.position(v));
        let (before, after) = ([[a, b, c], [b, a, d]], [[d, c, a], [c, d, b]]);
        let worse = |pair: [[Vec3; 3]; 2]| quality(pair[0]).min(quality(pair[1]));
        let normal = |[a, b, c]: [Vec3; 3]| (b - a).cross(&(c - a));
        let (old, new) = (before.map(normal), after.map(normal));
        let bend = |pair: [Vec3; 2]| angle_between(pair[0], pair[1]);
        let sum = old[0] + old[1];
        let better = worse(after) >= factor * worse(before)
            && new.iter().all(|n| n.dot(&sum) > MOVE.min_cosine * n.norm() * sum.norm())
            && bend(new) <= bend(old).max(FLATTER);
        if better && self.try_edit(&[], &[(h, after[0]), (t, after[1])], self.near[self.mesh.tail(h).index()]) {
            self.mesh.flip(h);
        }
    }

    /// Moves every vertex towards the middle of its star, along the surface or its curve.
    fn relax(&mut self) -> Result<(), CoarsenError> {
        self.monitor.check()?;
        for v in self.mesh.vertices().collect::<Vec<_>>() {
            match self.kinds[v.index()] {
                Kind::Free => self.relax_free(v),
                Kind::Curve => self.relax_on_curve(v),
                Kind::Corner => {}
            }
        }
        Ok(())
    }

    fn relax_free(&mut self, v: VertexId) {
        let at = self.mesh.position(v);
        let (mut center, mut weights, mut normal) = (Vec3::zeros(), 0.0, Vec3::zeros());
        for out in self.mesh.outgoing(v) {
            let f = self.mesh.face(out);
            let doubled = self.mesh.area_vector(f);
            let corners = self.mesh.face_vertices(f);
            let size = corners.iter().map(|w| self.sizes[w.index()]).sum::<f64>() / 3.0;
            // Where edges should be shorter a face of the same area weighs more.
            let weight = doubled.norm() / (size * size);
            center += corners.iter().map(|&w| self.mesh.position(w)).sum::<Vec3>() / 3.0 * weight;
            weights += weight;
            normal += doubled;
        }
        let (Some(normal), true) = (normal.try_normalize(0.0), weights > 0.0) else { return };
        let step = center / weights - at;
        let step = step - normal * normal.dot(&step);
        for share in [1.0, 0.5, 0.0] {
            let spot = self.source.closest(at + step * share, self.near[v.index()]);
            // The other side of a thin wall faces away.
            if self.source.mesh.area_vector(spot.face).dot(&normal) >= 0.0 && self.try_move(v, spot) {
                return;
            }
        }
    }

    fn relax_on_curve(&mut self, v: VertexId) {
        let ends: Vec<VertexId> =
            self.mesh.spokes(v).filter(|&h| self.is_curve(h)).map(|h| self.mesh.other_end(h, v)).collect();
        let &[a, b] = ends.as_slice() else { return };
        let at = self.mesh.position(v);
        let (p, q) = (self.mesh.position(a), self.mesh.position(b));
        let step = (p + q) / 2.0 - at;
        let Some(tangent) = (q - p).try_normalize(0.0) else { return };
        let step = tangent * tangent.dot(&step);
        for share in [1.0, 0.5, 0.0] {
            let Some(spot) = self.source.closest_on_curve(at + step * share, self.mesh.is_boundary_vertex(v)) else {
                return;
            };
            if self.try_move(v, spot) {
                return;
            }
        }
    }

    fn try_move(&mut self, v: VertexId, spot: Spot) -> bool {
        let moved = MOVE.allows_move(&self.mesh, v, spot.point)
            && self.try_edit(&[], &star_after(&self.mesh, v, spot.point), spot.face);
        if moved {
            self.mesh.set_position(v, spot.point);
            self.settle(v, spot);
        }
        moved
    }
}

/// Of the faces around a vertex that split an edge, those that are new, in the order of the faces that they were cut from.
fn halves(old: &[Option<FaceId>; 2], around: &[FaceId]) -> Vec<FaceId> {
    // Split appends one face per side, in that order.
    let mut new: Vec<FaceId> = around.iter().copied().filter(|f| !old.contains(&Some(*f))).collect();
    new.sort_unstable();
    new
}

/// A flip may bend the surface up to this angle even where it was flatter before, radians.
const FLATTER: f64 = 0.35;
