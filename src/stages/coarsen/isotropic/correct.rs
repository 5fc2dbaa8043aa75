//! Mends what is wrong with a mesh after remeshing: measures it against the source, and remeshes again with shorter edges
//! where it is too far off, folded or thin.
use super::{CoarsenError, Remesher};
use crate::{
    geom::Vec3,
    mesh::{Bvh, FaceId, HalfedgeId, Id, TriMesh, distance::violations},
    stages::coarsen::{
        smallest_angle,
        source::{Kind, Spot},
    },
};

/// Faces with a smaller angle are mended if possible, radians (20°).
const THIN: f64 = 0.35;
/// Cosine of the angle between two faces that are folded over: 120°.
const FOLD: f64 = -0.5;
/// Attempts to mend what is not as it should be after all, with shorter edges there; how many of them for thin faces alone;
/// and rounds in each.
const CORRECTIONS: usize = 6;
const THIN_CORRECTIONS: usize = 2;
const CORRECTION_ROUNDS: usize = 2;
/// Share of the error allowed given up so that the search for what is too far off ends.
const RESOLUTION: f64 = 0.02;

/// What is wrong with a mesh.
#[derive(Debug, Clone, Copy)]
struct Faults {
    /// Largest distance of the surfaces over the one allowed; at least 1.
    excess: f64,
    /// Number of faces that look the other way than the source, or are folded over.
    turned: usize,
    /// Largest distance of boundaries and creases over the one allowed; at least 1.
    off_curve: f64,
    /// Number of thin faces.
    thin: usize,
}

impl Faults {
    fn none(&self) -> bool {
        self.only_thin() && self.thin == 0
    }

    fn only_thin(&self) -> bool {
        self.turned == 0 && self.excess.max(self.off_curve) <= 1.0
    }

    /// The distance counts most, and thin faces least.
    fn less_than(&self, other: &Self) -> bool {
        let excess = self.excess.total_cmp(&other.excess);
        let off_curve = self.off_curve.total_cmp(&other.off_curve);
        excess.then(self.turned.cmp(&other.turned)).then(off_curve).then(self.thin.cmp(&other.thin)).is_lt()
    }
}

/// A place where a curve is too far from that of the source.
struct Stray {
    /// A face of the source there.
    face: FaceId,
    /// The edge that is too far.
    edge: HalfedgeId,
    /// Where it should be.
    point: Vec3,
    distance: f64,
}

impl Remesher<'_, '_> {
    /// Shortens edges where the surfaces or their curves are farther apart than `max_error`, faces turned over or thin, until
    /// there is none or the attempts are used up. The best mesh on the way.
    pub(super) fn correct(&mut self, max_error: f64, finest: f64) -> Result<TriMesh, CoarsenError> {
        let mut best: Option<(Faults, TriMesh)> = None;
        for attempt in 0..=CORRECTIONS {
            let mesh = self.mesh.finish()?;
            let find = |from: &TriMesh, to: &Bvh| violations(from, to, max_error, RESOLUTION, self.monitor);
            let there = find(self.source.mesh, &Bvh::new(&mesh))?;
            let back = find(&mesh, self.source.bvh)?;
            let (turned, thin) = self.misshapen(&mesh);
            let strays = self.strays((1.0 - RESOLUTION) * max_error);
            // Violations are farther than `1 - RESOLUTION` times the limit, which is so little too far that it is one.
            let least = (1.0 - RESOLUTION) * max_error;
            let excess = there.iter().chain(&back).map(|it| it.distance / least).fold(1.0, f64::max);
            let off_curve = strays.iter().map(|it| it.distance / least).fold(1.0, f64::max);
            let faults = Faults { excess, turned: turned.len(), off_curve, thin: thin.len() };
            if best.as_ref().is_none_or(|it| faults.less_than(&it.0)) {
                best = Some((faults, mesh));
            }
            let most = if faults.only_thin() { THIN_CORRECTIONS } else { CORRECTIONS };
            if attempt >= most || faults.none() {
                break;
            }
            if let Some(tolerance) = &mut self.tolerance {
                let faces: Vec<FaceId> = self.mesh.faces().collect();
                for it in &there {
                    tolerance.add(it.point, faces[it.closest.index()]);
                }
            }
            let far = there.iter().map(|it| it.face).chain(back.iter().map(|it| it.closest));
            let astray = strays.iter().map(|it| it.face);
            let wishes: Vec<_> = far.chain(astray).chain(turned).chain(thin).map(|face| (face, 0.0)).collect();
            self.lower_sizes(&wishes, finest);
            self.reach(strays);
            for _ in 0..CORRECTION_ROUNDS {
                self.round()?;
            }
            self.polish()?;
        }
        Ok(best.expect("there is at least one attempt").1)
    }

    /// Where the boundary or the creases are farther from those of the source than `limit`, either way, at samples.
    fn strays(&self, limit: f64) -> Vec<Stray> {
        let mut strays = Vec::new();
        for boundary in [true, false] {
            let is_ours = |h: &HalfedgeId| self.mesh.twin(*h).is_none() == boundary && self.is_curve(*h);
            let ours: Vec<HalfedgeId> = self.mesh.edges().filter(is_ours).collect();
            if ours.is_empty() {
                continue;
            }
            let segment = |&h: &HalfedgeId| [self.mesh.tail(h), self.mesh.head(h)].map(|v| self.mesh.position(v));
            let bvh = Bvh::of_triangles(ours.iter().map(segment).map(|[a, b]| [a, b, b]).collect());
            for (face, [a, b]) in self.source.curve(boundary) {
                for point in [a, (a + b) / 2.0] {
                    let found = bvh.closest(point);
                    let edge = ours[found.face.index()];
                    strays.push(Stray { face, edge, point, distance: found.distance });
                }
            }
            for edge in ours {
                let [a, b] = segment(&edge);
                for p in [0.25, 0.5, 0.75].map(|t| a + (b - a) * t) {
                    if let Some(Spot { point, face, .. }) = self.source.closest_on_curve(p, boundary) {
                        strays.push(Stray { face, edge, point, distance: (point - p).norm() });
                    }
                }
            }
        }
        strays.retain(|it| it.distance > limit);
        strays
    }

    /// Gives edges that are too far from their curve a corner at the farthest point of it, where the faces allow it: a spike
    /// of a boundary that was cut off is not found again by moving along it.
    fn reach(&mut self, mut strays: Vec<Stray>) {
        strays.sort_by(|x, y| x.edge.cmp(&y.edge).then(y.distance.total_cmp(&x.distance)));
        strays.dedup_by_key(|it| it.edge);
        for Stray { edge, point, .. } in strays {
            let [a, b] = [self.mesh.tail(edge), self.mesh.head(edge)].map(|v| self.mesh.position(v));
            let sides = [Some((edge, a, b)), self.mesh.twin(edge).map(|twin| (twin, b, a))];
            let turned = sides.into_iter().flatten().any(|(h, a, b)| {
                let apex = self.mesh.position(self.mesh.apex(h));
                let old = self.mesh.area_vector(self.mesh.face(h));
                let halves = [[a, point, apex], [point, b, apex]];
                halves.into_iter().any(|[p, q, r]| (q - p).cross(&(r - p)).dot(&old) <= 0.0)
            });
            if !turned {
                self.split_edge(edge, point, Kind::Corner);
            }
        }
    }

    /// The faces of the source next to faces that look the other way or are folded over, and next to thin ones.
    fn misshapen(&self, mesh: &TriMesh) -> (Vec<FaceId>, Vec<FaceId>) {
        let (mut turned, mut thin) = (Vec::new(), Vec::new());
        for f in mesh.faces() {
            let near = self.source.bvh.closest(mesh.face_positions(f).iter().sum::<Vec3>() / 3.0).face;
            let folded = |h| mesh.dihedral_cosine(mesh.edge(h)).is_some_and(|it| it < FOLD);
            if mesh.normal(f).dot(&self.source.mesh.normal(near)) < 0.0
                || mesh.face_halfedges(f).into_iter().any(folded)
            {
                turned.push(near);
            } else if smallest_angle(mesh, f) < THIN {
                thin.push(near);
            }
        }
        (turned, thin)
    }
}
