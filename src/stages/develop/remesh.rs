//! Mends triangles that are not buildable between rounds: flips caps, collapses needles, relaxes what is left.
//!
//! Only where an angle is below [`POOR`] or an edge is folded, and never so that a face turns over, an edge folds, a face
//! leaves the promised distance to the source that it kept before, or the smallest angle around gets smaller. What lies
//! on a boundary or a crease stays on it.
use super::measure::FOLDED;
use crate::{
    geom::{Vec3, angle_between},
    mesh::{Bvh, HalfedgeId, TriMesh, VertexId, distance::is_within},
    surface::{
        collapse::{Guard, fan_after},
        edit::EditMesh,
    },
};

/// Corner angles below this are mended, radians (12°).
const POOR: f64 = 0.21;
/// A triangle whose largest angle exceeds this is a cap, mended by a flip; others are needles, mended by a collapse, radians.
const CAP: f64 = 1.9;
/// Rules of a collapse: no face turns by more than 60°, none is folded against its neighbours by more than 107°.
const GUARD: Guard = Guard { min_cosine: 0.5, min_quality: 0.15, min_fold: -0.3 };
/// Smallest cosine between the normals of old and new faces of a flip: it does not cut through creases.
const FLIP: f64 = 0.8;
/// Turn of a curve up to which it has no corner, radians (20°).
const STRAIGHT: f64 = 0.35;
/// Cosine between the normals of a crease: collapses keep to it.
const CREASE: f64 = 0.7;
/// Longest edge that a collapse may leave, in mean edge lengths.
const LONG: f64 = 3.0;
/// Passes over the mesh; what three do not mend, more do not either.
const PASSES: usize = 3;
/// Share of a distance that a proof may give away.
const RESOLUTION: f64 = 0.05;

struct Work<'a> {
    mesh: EditMesh,
    source: &'a Bvh,
    limit: f64,
    longest: f64,
    /// Edits so far.
    edits: usize,
}

/// Mends `mesh` (mm) within `limit` of the surface of `source`. `None` if nothing had to be, or could be, done.
pub(super) fn mend(mesh: &TriMesh, source: &Bvh, limit: f64) -> Option<TriMesh> {
    let edit = EditMesh::new(mesh);
    let longest = LONG * mesh.mean_edge_length();
    let mut work = Work { mesh: edit, source, limit, longest, edits: 0 };
    for _ in 0..PASSES {
        let before = work.edits;
        work.pass();
        if work.edits == before {
            break;
        }
    }
    // Edits make no degenerate face, but the mesh may have had one that none could mend.
    if work.edits == 0 { None } else { work.mesh.finish().ok() }
}

impl Work<'_> {
    fn pass(&mut self) {
        let faces: Vec<_> = self.mesh.faces().collect();
        for f in faces {
            let h = HalfedgeId(3 * f.0);
            if !self.mesh.is_alive(h) || !self.is_poor(h) {
                continue;
            }
            let sides = [h, self.mesh.next(h), self.mesh.previous(h)];
            let length = |h: &HalfedgeId| self.mesh.vector(*h).norm_squared();
            let shortest = sides.into_iter().min_by(|a, b| length(a).total_cmp(&length(b))).unwrap_or(h);
            let longest = sides.into_iter().max_by(|a, b| length(a).total_cmp(&length(b))).unwrap_or(h);
            let angles = angles(self.mesh.face_positions(f));
            let cap = angles.into_iter().fold(0.0, f64::max) > CAP;
            let mended = (cap && self.flip(longest)) || self.collapse(shortest) || (!cap && self.flip(longest));
            if !mended {
                self.mesh.face_vertices(f).into_iter().for_each(|v| self.relax(v));
            }
        }
    }

    /// Whether the face of `h` has a small angle or a folded edge.
    fn is_poor(&self, h: HalfedgeId) -> bool {
        let small = angles(self.mesh.face_positions(self.mesh.face(h))).into_iter().any(|it| it < POOR);
        small || [h, self.mesh.next(h), self.mesh.previous(h)].into_iter().any(|side| self.cosine(side) < FOLDED)
    }

    /// Cosine between the normals on both sides of an edge; 1 on the boundary.
    fn cosine(&self, h: HalfedgeId) -> f64 {
        let normal = |h: HalfedgeId| unit_normal(self.mesh.face_positions(self.mesh.face(h)));
        self.mesh.twin(h).map_or(1.0, |twin| normal(h).dot(&normal(twin)))
    }

    /// Whether an edge is on the boundary or a crease. A fold is no crease: nothing has to be kept there.
    fn is_curve(&self, h: HalfedgeId) -> bool {
        self.mesh.twin(h).is_none() || (FOLDED..CREASE).contains(&self.cosine(h))
    }

    fn flip(&mut self, h: HalfedgeId) -> bool {
        let Some(t) = self.mesh.twin(h).filter(|_| self.mesh.can_flip(h)) else { return false };
        let ends = [self.mesh.tail(h), self.mesh.head(h), self.mesh.apex(h), self.mesh.apex(t)];
        let [a, b, c, d] = ends.map(|v| self.mesh.position(v));
        let (old, new) = ([[a, b, c], [b, a, d]], [[d, c, a], [c, d, b]]);
        let turned = old.iter().any(|o| new.iter().any(|n| unit_normal(*o).dot(&unit_normal(*n)) < FLIP));
        if turned || worst(&new) <= worst(&old) || !self.stays_near(&old, &new) {
            return false;
        }
        // The outer neighbours of the new faces, side by side.
        let outer = [
            (new[0], [self.mesh.previous(h), self.mesh.next(t)]),
            (new[1], [self.mesh.next(h), self.mesh.previous(t)]),
        ];
        let folds = |normal: Vec3, side: HalfedgeId| {
            let across = self.mesh.twin(side).map(|it| unit_normal(self.mesh.face_positions(self.mesh.face(it))));
            across.is_some_and(|across| across.dot(&normal) < FOLDED)
        };
        if outer.iter().any(|(corners, sides)| sides.iter().any(|&side| folds(unit_normal(*corners), side))) {
            return false;
        }
        self.mesh.flip(h);
        self.edits += 1;
        true
    }

    fn collapse(&mut self, h: HalfedgeId) -> bool {
        let ends = [self.mesh.tail(h), self.mesh.head(h)];
        let points = ends.map(|v| self.mesh.position(v));
        let middle = (points[0] + points[1]) / 2.0;
        let target = match ends.map(|v| self.mesh.spokes(v).filter(|&h| self.is_curve(h)).count()) {
            [0, 0] => middle,
            [_, 0] => points[0],
            [0, _] => points[1],
            // Along a curve, where it has neither a corner nor a branch.
            [2, 2] if self.is_curve(h) && ends.iter().all(|&v| self.curve_is_straight(v)) => middle,
            _ => return false,
        };
        let fan = fan_after(&self.mesh, h, target);
        let new: Vec<[Vec3; 3]> = fan.iter().map(|it| it.1).collect();
        let around: Vec<_> = ends.into_iter().flat_map(|v| self.mesh.outgoing(v)).map(|h| self.mesh.face(h)).collect();
        let old: Vec<[Vec3; 3]> = around.into_iter().map(|f| self.mesh.face_positions(f)).collect();
        let long = new.iter().any(|[p, a, b]| (a - p).norm().max((b - p).norm()) > self.longest);
        if long || worst(&new) <= worst(&old) || !self.mesh.can_collapse(h) || !GUARD.allows(&self.mesh, h, target) {
            return false;
        }
        if !self.stays_near(&old, &new) {
            return false;
        }
        self.mesh.collapse(h, target);
        self.edits += 1;
        true
    }

    /// Moves a vertex that is on no curve along its tangent plane where that makes the smallest angle around it larger, or a
    /// fold less sharp.
    fn relax(&mut self, v: VertexId) {
        if self.mesh.spokes(v).any(|h| self.is_curve(h)) {
            return;
        }
        let here = self.mesh.position(v);
        let star: Vec<HalfedgeId> = self.mesh.outgoing(v).collect();
        let (mut center, mut normal) = (Vec3::zeros(), Vec3::zeros());
        for &h in &star {
            center += self.mesh.position(self.mesh.head(h)) / star.len() as f64;
            normal += self.mesh.area_vector(self.mesh.face(h));
        }
        let normal = normal.try_normalize(0.0).unwrap_or_else(Vec3::zeros);
        let step = center - here;
        let step = step - normal * normal.dot(&step);
        let at = |p: Vec3| -> Vec<[Vec3; 3]> {
            star.iter()
                .map(|&h| [p, self.mesh.position(self.mesh.head(h)), self.mesh.position(self.mesh.apex(h))])
                .collect()
        };
        let old = at(here);
        for share in [1.0, 0.5, 0.25] {
            let new = at(here + step * share);
            let sharpest = [&old, &new].map(|faces| self.sharpest(faces, &star));
            let better = if sharpest[0] < FOLDED {
                sharpest[1] > sharpest[0]
            } else {
                let turned = old.iter().zip(&new).any(|(o, n)| unit_normal(*o).dot(&unit_normal(*n)) < FLIP);
                !turned && sharpest[1] >= FOLDED && worst(&new) > worst(&old)
            };
            if better && self.stays_near(&old, &new) {
                self.mesh.set_position(v, here + step * share);
                self.edits += 1;
                return;
            }
        }
    }

    /// Smallest cosine between each face of a star and its neighbours in the star and outside.
    fn sharpest(&self, faces: &[[Vec3; 3]], star: &[HalfedgeId]) -> f64 {
        let normals: Vec<Vec3> = faces.iter().map(|it| unit_normal(*it)).collect();
        let mut sharpest = f64::INFINITY;
        for (k, &h) in star.iter().enumerate() {
            sharpest = sharpest.min(normals[k].dot(&normals[(k + 1) % normals.len()]));
            if let Some(twin) = self.mesh.twin(self.mesh.next(h)) {
                let across = unit_normal(self.mesh.face_positions(self.mesh.face(twin)));
                sharpest = sharpest.min(normals[k].dot(&across));
            }
        }
        sharpest
    }

    /// Whether all new faces keep the distance, or the old ones did not either.
    fn stays_near(&self, old: &[[Vec3; 3]], new: &[[Vec3; 3]]) -> bool {
        let near = |faces: &[[Vec3; 3]]| faces.iter().all(|it| is_within(*it, self.source, self.limit, RESOLUTION));
        near(new) || !near(old)
    }

    fn curve_is_straight(&self, v: VertexId) -> bool {
        let ends: Vec<Vec3> = self
            .mesh
            .spokes(v)
            .filter(|&h| self.is_curve(h))
            .map(|h| self.mesh.position(self.mesh.other_end(h, v)))
            .collect();
        let here = self.mesh.position(v);
        matches!(ends.as_slice(), [a, b] if angle_between(here - a, b - here) < STRAIGHT)
    }
}

fn unit_normal([a, b, c]: [Vec3; 3]) -> Vec3 {
    (b - a).cross(&(c - a)).try_normalize(0.0).unwrap_or_else(Vec3::zeros)
}

fn angles([a, b, c]: [Vec3; 3]) -> [f64; 3] {
    [(b - a, c - a), (c - b, a - b), (a - c, b - c)].map(|(x, y)| angle_between(x, y))
}

/// Smallest angle of several triangles.
fn worst(faces: &[[Vec3; 3]]) -> f64 {
    faces.iter().flat_map(|it| angles(*it)).fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        mesh::{distance::violations, shapes},
        numeric::Monitor,
        stages::develop::{folded_edges, smallest_angle},
    };

    /// Some vertices pushed most of the way to a neighbour, which makes needles and caps.
    fn squeezed(mesh: &TriMesh, every: usize, share: f64) -> TriMesh {
        let mut out = mesh.clone();
        for v in mesh.vertices().skip(1).step_by(every) {
            let on_curve = mesh.outgoing(v).any(|h| mesh.dihedral_cosine(mesh.edge(h)).is_none_or(|it| it < CREASE));
            if let Some(w) = mesh.neighbors(v).nth(1).filter(|_| !on_curve && !mesh.is_boundary_vertex(v)) {
                out.positions_mut()[v] += (mesh.position(w) - mesh.position(v)) * share;
            }
        }
        out
    }

    #[test]
    fn slivers_are_mended_near_the_source_without_folds() {
        for source in [
            shapes::torus(1.0, 0.4, 32, 16),
            shapes::grid(12, 9, 0.1),
            shapes::cuboid(Vec3::new(1.0, 1.5, 2.0), 6),
            shapes::annulus(0.5, 1.0, 24, 5),
        ] {
            let bad = squeezed(&source, 7, 0.93);
            assert!(smallest_angle(&bad) < 0.12, "{}", smallest_angle(&bad));
            let limit = 0.02 * source.bounds().diagonal();
            let mended = mend(&bad, &Bvh::new(&source), limit).unwrap();
            assert!(smallest_angle(&mended) > POOR, "{}", smallest_angle(&mended));
            assert!(folded_edges(&mended).is_empty());
            assert_eq!(mended.euler_characteristic(), source.euler_characteristic());
            assert_eq!(mended.boundary_loops().len(), source.boundary_loops().len());
            let tree = Bvh::new(&source);
            let far = violations(&mended, &tree, 1.05 * limit, RESOLUTION, &Monitor::silent()).unwrap();
            assert_eq!(far, []);
            // What is flat stays so to rounding, boundaries and creases included.
            let flat = source.euler_characteristic() == 1 || source.face_count() == 12 * 36;
            let off = |p: &Vec3| tree.closest(*p).distance;
            assert!(!flat || mended.positions().iter().all(|p| off(p) < 1e-12));
            assert!(!flat || (mended.total_area() - source.total_area()).abs() < 1e-9);
        }
    }

    #[test]
    fn good_meshes_are_left_alone_and_bad_ones_out_of_reach_too() {
        for mesh in [shapes::icosphere(1.0, 3), shapes::cylinder(1.0, 2.0, 24, 8)] {
            assert_eq!(mend(&mesh, &Bvh::new(&mesh), 0.1), None);
        }
        // Mending this one would cut a corner of the surface by more than allowed.
        let source = shapes::icosphere(1.0, 1);
        let bad = squeezed(&source, 3, 0.9);
        let tree = Bvh::new(&bad);
        let mended = mend(&bad, &tree, 1e-3).unwrap_or_else(|| bad.clone());
        assert_eq!(violations(&mended, &tree, 1.05e-3, RESOLUTION, &Monitor::silent()).unwrap(), []);
    }

    #[test]
    fn a_folded_vertex_is_unfolded() {
        let source = shapes::torus(1.0, 0.4, 24, 12);
        let mut folded = source.clone();
        let (v, w) = (VertexId(30), source.neighbors(VertexId(30)).next().unwrap());
        folded.positions_mut()[v] += 1.4 * (source.position(w) - source.position(v));
        assert!(!folded_edges(&folded).is_empty());
        let mended = mend(&folded, &Bvh::new(&source), 0.1).unwrap();
        assert!(folded_edges(&mended).len() < folded_edges(&folded).len());
    }
}
