//! A triangulation of a surface whose vertices know their places on the sphere: no face is turned over there, so the net
//! covers the surface once wherever its vertices move.
use super::{
    certify::is_positive,
    locate::{Locator, search, walk},
};
use crate::{
    geom::Vec3,
    mesh::{Bvh, FaceId, HalfedgeId, Id, MeshError, TriMesh, VertexId, distance::SurfacePoint},
    surface::{collapse::quality, edit::EditMesh},
};

/// Halvings of the step of a vertex.
const HALVINGS: usize = 4;
/// A vertex moves by at most this share of its shortest edge at a time.
const STRIDE: f64 = 0.5;
/// Curvature of the energy of an even fan of edges of length 1.
const CURVATURE: f64 = 8.0;
/// Halvings of an arc on the way to the point that is as far from both its ends on the surface.
const BISECTIONS: usize = 8;
/// Edges are turned beside faces of a lower quality, where that makes the worse face better by the factor.
const POOR: f64 = 0.6;
const BETTER: f64 = 1.15;

/// A triangulation of a surface and of the sphere.
#[derive(Debug)]
pub struct Net<'a> {
    pub(super) locator: &'a Locator<'a>,
    pub(super) edit: EditMesh,
    pub(super) points: Vec<Vec3>,
    pub(super) spots: Vec<SurfacePoint>,
}

impl<'a> Net<'a> {
    /// `points` on the sphere, whose faces are not turned over, lie at `spots`.
    pub(super) fn new(locator: &'a Locator<'a>, faces: &[[u32; 3]], points: Vec<Vec3>) -> Result<Self, MeshError> {
        let mut hint = FaceId(0);
        let spots: Vec<SurfacePoint> = points
            .iter()
            .map(|&p| {
                let spot = locator.locate(p, hint);
                hint = spot.face;
                spot
            })
            .collect();
        let places = spots.iter().map(|it| it.position(locator.mesh())).collect();
        let edit = EditMesh::new(&TriMesh::new(places, faces)?);
        Ok(Self { locator, edit, points, spots })
    }

    /// Its faces as a mesh on the surface.
    pub fn mesh(&self) -> Result<TriMesh, MeshError> {
        self.edit.finish()
    }

    /// The face that covers a direction, searched from `hint`.
    pub(super) fn face_at(&self, p: Vec3, hint: FaceId) -> FaceId {
        let corners = |f: FaceId| self.edit.face_vertices(f).map(|v| self.points[v.index()]);
        let across = |f: FaceId, k: usize| self.edit.twin(Self::halfedges(f)[k]).map(|t| self.edit.face(t));
        walk(p, hint, self.edit.face_count(), corners, across)
            .or_else(|| search(p, self.edit.faces(), corners))
            .unwrap_or(hint)
    }

    /// Puts a vertex where a direction lies on the surface.
    pub(super) fn put(&mut self, v: VertexId, point: Vec3) {
        let spot = self.locator.locate(point, self.spots[v.index()].face);
        self.points[v.index()] = point;
        self.spots[v.index()] = spot;
        self.edit.set_position(v, spot.position(self.locator.mesh()));
    }

    pub(super) fn length(&self, h: HalfedgeId) -> f64 {
        self.edit.vector(h).norm()
    }

    pub(super) fn halfedges(f: FaceId) -> [HalfedgeId; 3] {
        [0, 1, 2].map(|k| HalfedgeId(3 * f.0 + k))
    }

    /// Moves every vertex along the surface to where the faces around it are closer to equilateral and, with `area` and the
    /// weight `even` of that, closer to an area, mm².
    pub(super) fn smooth(&mut self, area: f64, even: f64) {
        for v in self.edit.vertices().collect::<Vec<_>>() {
            let fan: Vec<[VertexId; 2]> =
                self.edit.outgoing(v).map(|h| [self.edit.head(h), self.edit.apex(h)]).collect();
            let places: Vec<[Vec3; 2]> = fan.iter().map(|it| it.map(|w| self.edit.position(w))).collect();
            let energy = |x: Vec3| places.iter().map(|&[b, c]| shape([x, b, c], area, even).0).sum::<f64>();
            let x = self.edit.position(v);
            let gradient: Vec3 = places.iter().map(|&[b, c]| shape([x, b, c], area, even).1).sum();
            let squares = places.iter().map(|it| (it[0] - x).norm_squared());
            let (least, sum) = squares.fold((f64::INFINITY, 0.0_f64), |(least, sum), it| (least.min(it), sum + it));
            let mut step = -gradient * (sum / (places.len() as f64 * CURVATURE));
            let most = STRIDE * least.sqrt();
            if step.norm() > most {
                step *= most / step.norm();
            }
            let before = energy(x);
            for _ in 0..HALVINGS {
                if let Some(point) = self.shifted(self.spots[v.index()], step)
                    && fan.iter().all(|&[b, c]| is_positive([point, self.points[b.index()], self.points[c.index()]]))
                {
                    let spot = self.locator.locate(point, self.spots[v.index()].face);
                    let place = spot.position(self.locator.mesh());
                    if energy(place) < before && !self.folds(v, place, spot, &fan) {
                        self.points[v.index()] = point;
                        self.spots[v.index()] = spot;
                        self.edit.set_position(v, place);
                        break;
                    }
                }
                step *= 0.5;
            }
        }
    }

    /// The normal of the surface at a vertex.
    pub(super) fn normal(&self, v: VertexId) -> Vec3 {
        self.locator.mesh().normal(self.spots[v.index()].face)
    }

    /// Whether a face around a vertex looks away from the surface at its corners after a move, and did not before.
    fn folds(&self, v: VertexId, place: Vec3, spot: SurfacePoint, fan: &[[VertexId; 2]]) -> bool {
        let (was, is) = (self.normal(v), self.locator.mesh().normal(spot.face));
        fan.iter().any(|&[b, c]| {
            let beside = self.normal(b) + self.normal(c);
            let [q, r] = [b, c].map(|w| self.edit.position(w));
            let looks = |x: Vec3, n: Vec3| (q - x).cross(&(r - x)).dot(&(beside + n));
            looks(place, is) <= 0.0 && looks(self.edit.position(v), was) > 0.0
        })
    }

    /// The direction on the sphere of a place moved by `step`, as the face that it lies in is mapped.
    fn shifted(&self, spot: SurfacePoint, step: Vec3) -> Option<Vec3> {
        let mesh = self.locator.mesh();
        let [a, b, c] = mesh.face_positions(spot.face);
        let [p, q, r] = self.locator.corners(spot.face);
        let (u, w) = (b - a, c - a);
        let (uu, uw, ww) = (u.dot(&u), u.dot(&w), w.dot(&w));
        let (su, sw) = (step.dot(&u), step.dot(&w));
        let det = uu * ww - uw * uw;
        let (s, t) = ((su * ww - sw * uw) / det, (sw * uu - su * uw) / det);
        let [i, j, k] = spot.barycentric;
        (i * p + j * q + k * r + s * (q - p) + t * (r - p)).try_normalize(1e-300).filter(|it| it.x.is_finite())
    }

    /// Divides an edge at the point of its arc that is as far from both ends on the surface; `None` where that leaves a face of
    /// a lower quality than `least`.
    pub(super) fn divide(&mut self, h: HalfedgeId, least: f64) -> Option<VertexId> {
        let ends = [self.edit.tail(h), self.edit.head(h)];
        let [p, q] = ends.map(|v| self.points[v.index()]);
        let [a, b] = ends.map(|v| self.edit.position(v));
        let (mut low, mut high) = (0.0, 1.0);
        let mut hint = self.spots[ends[0].index()].face;
        let mut middle = None;
        for _ in 0..BISECTIONS {
            let share = 0.5 * (low + high);
            let point = ((1.0 - share) * p + share * q).try_normalize(1e-300)?;
            let spot = self.locator.locate(point, hint);
            hint = spot.face;
            let place = spot.position(self.locator.mesh());
            if (place - a).norm() < (place - b).norm() {
                low = share
            } else {
                high = share
            }
            middle = Some((point, spot));
        }
        let (point, spot) = middle?;
        (self.worst_beside(h, point, spot) >= least).then(|| self.split(h, point, spot))
    }

    /// Puts a vertex into a face, or the pair of it and a neighbour, in the way that leaves the best faces.
    pub(super) fn insert(&mut self, f: FaceId, point: Vec3) -> Option<VertexId> {
        let hint = self.spots[self.edit.face_vertices(f)[0].index()].face;
        let spot = self.locator.locate(point, hint);
        let ways = Self::halfedges(f).map(|h| (self.worst_beside(h, point, spot), h));
        let best = ways.into_iter().max_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)))?;
        (best.0 > 0.0).then(|| self.split(best.1, point, spot))
    }

    fn split(&mut self, h: HalfedgeId, point: Vec3, spot: SurfacePoint) -> VertexId {
        let new = self.edit.split(h, spot.position(self.locator.mesh()));
        self.points.push(point);
        self.spots.push(spot);
        new
    }

    /// The quality of the worst face after a vertex has divided an edge, and 0 if one is turned over on the sphere.
    fn worst_beside(&self, h: HalfedgeId, point: Vec3, spot: SurfacePoint) -> f64 {
        let place = spot.position(self.locator.mesh());
        let mut worst = f64::INFINITY;
        for side in [Some(h), self.edit.twin(h)].into_iter().flatten() {
            let [a, b, c] = [self.edit.tail(side), self.edit.head(side), self.edit.apex(side)];
            for [u, w] in [[b, c], [c, a]] {
                if !is_positive([point, self.points[u.index()], self.points[w.index()]]) {
                    return 0.0;
                }
                worst = worst.min(quality([place, self.edit.position(u), self.edit.position(w)]));
            }
        }
        worst
    }

    /// Turns the edges of poor faces where that helps; how many.
    pub(super) fn turn(&mut self) -> usize {
        let mut turned = 0;
        for h in self.edit.edges().collect::<Vec<_>>() {
            if self.may_turn(h) {
                self.edit.flip(h);
                turned += 1;
            }
        }
        turned
    }

    fn may_turn(&self, h: HalfedgeId) -> bool {
        let Some(t) = self.edit.twin(h) else { return false };
        let [a, b, c, d] = [self.edit.tail(h), self.edit.head(h), self.edit.apex(h), self.edit.apex(t)];
        let place = |corners: [VertexId; 3]| corners.map(|v| self.edit.position(v));
        let worst = |pair: [[VertexId; 3]; 2]| quality(place(pair[0])).min(quality(place(pair[1])));
        let (before, after) = ([[a, b, c], [b, a, d]], [[d, c, a], [c, d, b]]);
        let was = worst(before);
        if was >= POOR || worst(after) < BETTER * was {
            return false;
        }
        let area = |corners: [VertexId; 3]| {
            let [p, q, r] = place(corners);
            (q - p).cross(&(r - p))
        };
        let old: Vec3 = [a, b, c, d].into_iter().map(|v| self.normal(v)).sum();
        after.into_iter().all(|it| area(it).dot(&old) > 0.0) && self.is_free(h)
    }

    /// Whether an edge may be turned: no face is then turned over on the sphere.
    pub(super) fn is_free(&self, h: HalfedgeId) -> bool {
        let Some(t) = self.edit.twin(h) else { return false };
        let [a, b, c, d] = [self.edit.tail(h), self.edit.head(h), self.edit.apex(h), self.edit.apex(t)];
        let is_open = |it: [VertexId; 3]| is_positive(it.map(|v| self.points[v.index()]));
        is_open([d, c, a]) && is_open([c, d, b]) && self.edit.can_flip(h)
    }

    /// Turns an edge if the middles of its faces and sides then lie closer to the surface by the factor. Whether it did.
    pub(super) fn lower(&mut self, h: HalfedgeId, factor: f64, bvh: &Bvh) -> bool {
        let Some(t) = self.edit.twin(h) else { return false };
        let both = |net: &Self| [h, t].map(|it| net.height(net.edit.face(it), bvh)).into_iter().fold(0.0, f64::max);
        if !self.is_free(h) {
            return false;
        }
        let before = both(self);
        self.edit.flip(h);
        if both(self) < factor * before {
            return true;
        }
        // Twice more is back, with the corners in another order; once more would be the edge from the other end.
        (0..3).for_each(|_| self.edit.flip(h));
        false
    }

    /// How far the middle of a face, or of a side of it, is from the surface, mm.
    pub(super) fn height(&self, f: FaceId, bvh: &Bvh) -> f64 {
        let corners = self.edit.face_positions(f);
        let middles = [0, 1, 2].map(|k| 0.5 * (corners[k] + corners[(k + 1) % 3]));
        let centre = corners.iter().sum::<Vec3>() / 3.0;
        middles.into_iter().chain([centre]).map(|it| bvh.closest(it).distance).fold(0.0, f64::max)
    }

    /// The direction of the middle of a face.
    pub(super) fn centre(&self, f: FaceId) -> Option<Vec3> {
        self.edit.face_vertices(f).iter().map(|v| self.points[v.index()]).sum::<Vec3>().try_normalize(1e-300)
    }
}

/// How far a triangle is from equilateral and from an area, and how that changes with its first corner:
/// s (½ (r + 1/r))^even with s the inverse of [`quality`] and r its share of `area`. With `even` = 1 twice this is the symmetric
/// Dirichlet energy of the map from an equilateral triangle of that area (Smith, Schaefer 2015, eq. 2).
fn shape([x, b, c]: [Vec3; 3], area: f64, even: f64) -> (f64, Vec3) {
    let normal = (b - x).cross(&(c - x));
    let doubled = normal.norm();
    if doubled < f64::MIN_POSITIVE {
        return (f64::INFINITY, Vec3::zeros());
    }
    let squares = (b - x).norm_squared() + (c - b).norm_squared() + (x - c).norm_squared();
    let ratio = 0.5 * doubled / area;
    let size = 0.5 * (ratio + 1.0 / ratio);
    let value = squares / (12.0_f64.sqrt() * doubled) * size.powf(even);
    // Of the logarithms of the area and of the squares.
    let widens = (normal / doubled).cross(&(c - b)) / doubled;
    let lengthens = 2.0 * (2.0 * x - b - c) / squares;
    let evens = even * (ratio * ratio - 1.0) / (ratio * ratio + 1.0);
    (value, value * (lengthens + (evens - 1.0) * widens))
}
