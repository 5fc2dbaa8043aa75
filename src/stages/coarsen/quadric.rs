//! Coarsening by edge collapse in the order of quadric error.
//!
//! Garland, Heckbert: Surface simplification using quadric error metrics, SIGGRAPH 1997; the planes are weighted by area,
//! boundary and crease edges add planes of their own (their section 6). Quadrics are those of the current surface and are
//! not accumulated from the source (memoryless, as in Lindstrom, Turk: Fast and memory efficient polygonal simplification,
//! Visualization 1998): on scans at 1000 faces this takes 25 to 35 % off the mean distance. Every face also adds a small
//! isotropic quadric around its centroid, as in Trettner, Kobbelt: Fast and robust QEM decimation, Eurographics 2020,
//! section 4 (a plane with an uncertain normal): it makes every system positive definite and breaks ties in flat regions
//! towards even faces.
use super::{CoarsenError, tolerance::Tolerance};
use crate::{
    geom::Vec3,
    mesh::{Bvh, HalfedgeId, Id, TriMesh, VertexId},
    numeric::Monitor,
    surface::{
        collapse::{EdgeQueue, FanFace, Guard, dying, fan_after, sharpest_fold},
        edit::EditMesh,
    },
};

/// Weight of the isotropic part against the plane of the same face.
const ISOTROPIC: f64 = 1e-4;
/// Each of these steps takes off as many digits of its pull as that weight has.
const PROXIMAL: usize = 2;
/// Weight of a boundary plane against the face planes, per squared length of the edge.
const BOUNDARY: f64 = 10.0;
/// Weight of a crease plane, likewise.
const CREASE: f64 = 1.0;
/// Tried one after the other when nothing is left to collapse under the guard before.
const GUARDS: [Guard; 3] = [
    Guard { min_cosine: 0.5, min_quality: 0.2, min_fold: -0.3 },
    Guard { min_cosine: 0.2, min_quality: 0.05, min_fold: -0.5 },
    Guard { min_cosine: 0.0, min_quality: 1e-3, min_fold: -0.9 },
];
/// Cosine of an angle between neighbouring faces that is no fold: 60°.
const GENTLE: f64 = 0.5;
/// Collapses between two looks at the monitor.
const BEAT: usize = 1 << 10;

/// Weighted sum of squared distances to planes and points: `xᵀ A x − 2 b·x + c`.
#[derive(Debug, Clone, Copy, Default)]
struct Quadric {
    /// xx, xy, xz, yy, yz, zz.
    a: [f64; 6],
    b: Vec3,
    c: f64,
    /// The part of the points in `a` (times the identity) and in `b`.
    point_a: f64,
    point_b: Vec3,
}

impl Quadric {
    fn add(&mut self, other: &Self) {
        for (one, other) in self.a.iter_mut().zip(&other.a) {
            *one += other;
        }
        self.b += other.b;
        self.c += other.c;
        self.point_a += other.point_a;
        self.point_b += other.point_b;
    }

    /// Adds `weight` times the squared distance to the plane through `point` with normal `n`; `n` of length s counts s² times.
    fn add_plane(&mut self, n: &Vec3, point: &Vec3, weight: f64) {
        let offset = n.dot(point);
        let terms = [n.x * n.x, n.x * n.y, n.x * n.z, n.y * n.y, n.y * n.z, n.z * n.z];
        let (b, c) = (n * (weight * offset), weight * offset * offset);
        self.add(&Self { a: terms.map(|it| weight * it), b, c, ..Self::default() });
    }

    /// Adds `weight` times the squared distance to `point`.
    fn add_point(&mut self, point: &Vec3, weight: f64) {
        self.add(&Self {
            a: [weight, 0.0, 0.0, weight, 0.0, weight],
            b: point * weight,
            c: weight * point.norm_squared(),
            point_a: weight,
            point_b: point * weight,
        });
    }

    fn times(&self, x: &Vec3) -> Vec3 {
        let [xx, xy, xz, yy, yz, zz] = self.a;
        Vec3::new(xx * x.x + xy * x.y + xz * x.z, xy * x.x + yy * x.y + yz * x.z, xz * x.x + yz * x.y + zz * x.z)
    }

    fn value(&self, x: &Vec3) -> f64 {
        // Rounding may take it below zero.
        (x.dot(&(self.times(x) - self.b * 2.0)) + self.c).max(0.0)
    }

    /// The point of least value, by Cramer's rule on the step from `near`; `None` if the system is singular. More steps, with
    /// the points at the place of the one before (proximal point iteration), take their pull off the planes: creases and
    /// corners stay where they are to rounding, and only directions that no plane determines are left to the points.
    fn minimum(&self, near: &Vec3) -> Option<Vec3> {
        let [xx, xy, xz, yy, yz, zz] = self.a;
        let (p, q, s) = (yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy);
        let determinant = xx * p + xy * q + xz * s;
        let largest = xx.max(yy).max(zz);
        if determinant <= 1e-12 * largest.powi(3) {
            return None;
        }
        let (t, u, v) = (xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy);
        let step = |r: Vec3| {
            Vec3::new(p * r.x + q * r.y + s * r.z, q * r.x + t * r.y + u * r.z, s * r.x + u * r.y + v * r.z)
                / determinant
        };
        let planes = |x: Vec3| (self.b - self.point_b) - (self.times(&x) - x * self.point_a);
        let first = near + step(self.b - self.times(near));
        Some((0..PROXIMAL).fold(first, |x, _| x + step(planes(x))))
    }
}

/// Where an edge may go and what it costs there, cheapest first.
type Offers = [(f64, Vec3); 4];

/// The state of a run.
struct Simplifier<'a> {
    mesh: EditMesh,
    /// Per vertex: the planes of the faces and special edges around it, relative to `origin`.
    quadrics: Vec<Quadric>,
    origin: Vec3,
    /// Cosine of the angle from which a marked edge counts as a crease.
    sharp: f64,
    queue: EdgeQueue,
    tolerance: Option<Tolerance<'a>>,
    source: &'a TriMesh,
    bvh: &'a Bvh,
}

/// Collapses edges until `faces` are left, or until every further collapse would break the tolerance. With neither the
/// mesh stays as it is.
pub(super) fn simplify<'a>(
    source: &'a TriMesh,
    bvh: &'a Bvh,
    faces: Option<usize>,
    tolerance: Option<Tolerance<'a>>,
    feature_angle: f64,
    monitor: &Monitor,
) -> Result<TriMesh, CoarsenError> {
    let target = faces.unwrap_or(if tolerance.is_some() { 0 } else { source.face_count() });
    let mut run = Simplifier {
        mesh: EditMesh::new(source),
        quadrics: vec![Quadric::default(); source.vertex_count()],
        origin: (source.bounds().min + source.bounds().max) / 2.0,
        sharp: feature_angle.cos(),
        queue: EdgeQueue::default(),
        tolerance,
        source,
        bvh,
    };
    for e in source.edges() {
        let crease = source.dihedral_cosine(e).is_some_and(|cosine| cosine < run.sharp);
        run.mesh.set_mark(source.halfedge(e), crease);
    }
    for v in source.vertices() {
        run.quadrics[v.index()] = run.quadric_at(v);
    }
    for guard in GUARDS {
        // Collapses make room for others, but trying all edges again is too dear under a tolerance.
        while run.mesh.face_count() > target && run.pass(target, guard, monitor)? > 0 && run.tolerance.is_none() {}
    }
    let reached = run.mesh.face_count();
    if reached > target && run.tolerance.is_none() {
        return Err(CoarsenError::TooFew { target, reached });
    }
    Ok(run.mesh.finish()?)
}

impl Simplifier<'_> {
    /// Collapses what `guard` allows, cheapest first. Returns how many edges went.
    fn pass(&mut self, target: usize, guard: Guard, monitor: &Monitor) -> Result<usize, CoarsenError> {
        self.queue = EdgeQueue::default();
        for h in self.mesh.edges().collect::<Vec<_>>() {
            self.price(h);
        }
        let start = self.mesh.face_count();
        let (mut seen, mut done) = (0_usize, 0);
        while self.mesh.face_count() > target
            && let Some((price, h)) = self.queue.pop()
        {
            seen += 1;
            if seen.is_multiple_of(BEAT) {
                monitor.check()?;
                let share = (start - self.mesh.face_count()) as f64 / (start - target).max(1) as f64;
                monitor.progress(share, "collapsing edges");
            }
            if !self.mesh.can_collapse(h) {
                continue;
            }
            let allowed = self
                .offers(h)
                .into_iter()
                .find(|&(_, position)| guard.allows(&self.mesh, h, position) && self.stays_near(h, position));
            match allowed {
                // Dearer than it was taken for: it has to wait its turn.
                Some((cost, _)) if cost > price && self.queue.lowest().is_some_and(|next| next < cost) => {
                    self.queue.set(&self.mesh, h, cost);
                }
                Some((_, position)) => {
                    self.collapse(h, position);
                    done += 1;
                }
                None => {}
            }
        }
        Ok(done)
    }

    fn quadric_at(&self, v: VertexId) -> Quadric {
        let mut sum = Quadric::default();
        for out in self.mesh.outgoing(v) {
            self.add_face(&mut sum, out);
        }
        for spoke in self.mesh.spokes(v) {
            self.add_edge(&mut sum, spoke);
        }
        sum
    }

    fn add_face(&self, sum: &mut Quadric, h: HalfedgeId) {
        let f = self.mesh.face(h);
        let doubled = self.mesh.area_vector(f);
        let length = doubled.norm();
        let weight = length / 6.0;
        let center = self.mesh.face_positions(f).iter().sum::<Vec3>() / 3.0 - self.origin;
        if length > 0.0 {
            sum.add_plane(&doubled, &center, weight / (length * length));
        }
        sum.add_point(&center, ISOTROPIC * weight);
    }

    /// The planes through a boundary edge or a crease, one per face along it and perpendicular to that face.
    fn add_edge(&self, sum: &mut Quadric, h: HalfedgeId) {
        let normal = |h| self.mesh.area_vector(self.mesh.face(h));
        let twin = self.mesh.twin(h);
        let weight = match twin {
            None => BOUNDARY,
            Some(twin) if self.mesh.is_marked(h) => {
                let (n, m) = (normal(h), normal(twin));
                if n.dot(&m) >= self.sharp * n.norm() * m.norm() {
                    return;
                }
                CREASE
            }
            Some(_) => return,
        };
        let edge = self.mesh.vector(h);
        let point = self.mesh.position(self.mesh.tail(h)) - self.origin;
        for side in [Some(h), twin].into_iter().flatten() {
            if let Some(across) = normal(side).cross(&edge).try_normalize(0.0) {
                sum.add_plane(&across, &point, weight * edge.norm_squared());
            }
        }
    }

    fn merged(&self, h: HalfedgeId) -> Quadric {
        let mut sum = self.quadrics[self.mesh.tail(h).index()];
        sum.add(&self.quadrics[self.mesh.head(h).index()]);
        sum
    }

    /// The best position, the middle and the ends.
    fn offers(&self, h: HalfedgeId) -> Offers {
        let quadric = self.merged(h);
        let ends = [self.mesh.tail(h), self.mesh.head(h)].map(|v| self.mesh.position(v));
        let middle = (ends[0] + ends[1]) / 2.0;
        let best = self.best(&quadric, &ends);
        let mut offers = [best, middle, ends[0], ends[1]].map(|x| (quadric.value(&(x - self.origin)), x));
        offers.sort_by(|x, y| x.0.total_cmp(&y.0));
        offers
    }

    /// The minimum of the quadric unless it lies far from the edge, which only ill-conditioned ones do; then the middle.
    fn best(&self, quadric: &Quadric, ends: &[Vec3; 2]) -> Vec3 {
        /// Farthest that the new vertex may lie from the middle, in lengths of the edge.
        const REACH: f64 = 2.0;
        let middle = (ends[0] + ends[1]) / 2.0;
        quadric
            .minimum(&(middle - self.origin))
            .map(|x| x + self.origin)
            .filter(|x| (x - middle).norm_squared() <= REACH * REACH * (ends[1] - ends[0]).norm_squared())
            .unwrap_or(middle)
    }

    fn price(&mut self, h: HalfedgeId) {
        let quadric = self.merged(h);
        let ends = [self.mesh.tail(h), self.mesh.head(h)].map(|v| self.mesh.position(v));
        let price = quadric.value(&(self.best(&quadric, &ends) - self.origin));
        self.queue.set(&self.mesh, h, price);
    }

    /// Whether the collapse turns no face away from the source next to it, and keeps to the tolerance.
    fn stays_near(&mut self, h: HalfedgeId, position: Vec3) -> bool {
        let fan = fan_after(&self.mesh, h, position);
        // Where the surface is nearly flat no face can look away from it, unless all do.
        (sharpest_fold(&self.mesh, h, &fan) > GENTLE || !fan.iter().any(|it| self.turns_away(it)))
            && self.tolerance.as_mut().is_none_or(|it| it.allows(&self.mesh, &dying(&self.mesh, h), &fan))
    }

    /// Whether a face looks the other way than the source closest to its centroid, and did not before. Normals of faces are
    /// compared with those before at every collapse, but may turn over step by step.
    fn turns_away(&self, (h, after): &FanFace) -> bool {
        let f = self.mesh.face(*h);
        let away = |[a, b, c]: [Vec3; 3]| {
            // Faces keep the ids that they had in the source, and their place as long as they are small.
            let near = self.bvh.closest_from((a + b + c) / 3.0, f).face;
            (b - a).cross(&(c - a)).dot(&self.source.area_vector(near)) < 0.0
        };
        away(*after) && !away(self.mesh.face_positions(f))
    }

    fn collapse(&mut self, h: HalfedgeId, position: Vec3) {
        let kept = self.mesh.head(h);
        if let Some(tolerance) = &mut self.tolerance {
            tolerance.commit(&self.mesh, &dying(&self.mesh, h), &fan_after(&self.mesh, h, position));
        }
        self.queue.remove_for_collapse(&self.mesh, h);
        self.mesh.collapse(h, position);
        let spokes: Vec<_> = self.mesh.spokes(kept).collect();
        for v in spokes.iter().map(|&spoke| self.mesh.other_end(spoke, kept)).chain([kept]) {
            self.quadrics[v.index()] = self.quadric_at(v);
        }
        // Edges of the ring beyond keep their old price; one that has become dearer is noticed when its turn comes.
        for spoke in spokes {
            self.price(spoke);
        }
    }
}
