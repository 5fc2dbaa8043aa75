//! Isotropic remeshing: edges of one length, valences near six, points on the source.
//!
//! Botsch, Kobbelt: A remeshing approach to multiresolution modeling, SGP 2004, section 4: split edges longer than 4/3 L,
//! collapse those shorter than 4/5 L, flip towards even valences, relax tangentially and project. Creases and boundaries
//! are curves of their own: their vertices slide along nothing but the curve of the source, their corners stay.
use super::CoarsenError;
use crate::{
    geom::{Vec3, closest_on_segment},
    mesh::{Bvh, HalfedgeId, TriMesh, VertexId},
    numeric::Monitor,
    surface::{
        collapse::{Guard, quality},
        edit::EditMesh,
    },
};

/// What [`remesh`] should reach.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct IsotropicOptions {
    /// Edge length L, mm.
    pub edge_length: f64,
    /// Edges with a larger angle between the normals of their faces are creases, radians.
    pub feature_angle: f64,
}

/// Rounds of split, collapse, flip, relax. Edge lengths settle after five; more only costs time.
const ROUNDS: usize = 6;
const GUARD: Guard = Guard { min_cosine: 0.5, min_quality: 0.2, min_fold: -0.3 };
/// A flip may turn the normals of its two faces by no more than this angle's cosine.
const FLIP_COSINE: f64 = 0.9;
/// Operations between two looks at the monitor.
const BEAT: usize = 1 << 10;

/// Remeshes `start` (a coarser or finer version of `source`, often `source` itself) on the surface of `source`.
pub fn remesh(
    source: &TriMesh,
    start: &TriMesh,
    options: &IsotropicOptions,
    monitor: &Monitor,
) -> Result<TriMesh, CoarsenError> {
    let mut run = Run {
        mesh: EditMesh::new(start),
        curves: curves(source, options.feature_angle.cos()),
        bvh: Bvh::new(source),
        length: options.edge_length,
        monitor,
    };
    for e in start.edges() {
        let crease = start.dihedral_cosine(e).is_none_or(|cosine| cosine < options.feature_angle.cos());
        run.mesh.set_mark(start.halfedge(e), crease);
    }
    for round in 0..ROUNDS {
        monitor.progress(round as f64 / ROUNDS as f64, "remeshing");
        run.split()?;
        run.collapse()?;
        run.flip()?;
        run.relax()?;
    }
    Ok(run.mesh.finish()?)
}

/// Boundary and crease edges of the source as segments.
fn curves(source: &TriMesh, sharp: f64) -> Vec<[Vec3; 2]> {
    let on_curve = |e: &_| source.dihedral_cosine(*e).is_none_or(|cosine| cosine < sharp);
    source.edges().filter(on_curve).map(|e| source.edge_vertices(e).map(|v| source.position(v))).collect()
}

struct Run<'a> {
    /// Marks are curves: boundary and creases.
    mesh: EditMesh,
    curves: Vec<[Vec3; 2]>,
    bvh: Bvh,
    length: f64,
    monitor: &'a Monitor<'a>,
}

/// How free a vertex is, by the number of curve edges at it.
#[derive(PartialEq, Eq, PartialOrd, Ord, Clone, Copy)]
enum Freedom {
    Surface,
    Curve,
    Corner,
}

impl Run<'_> {
    fn freedom(&self, v: VertexId) -> Freedom {
        let curve = |h: &HalfedgeId| self.mesh.is_marked(*h) || self.mesh.twin(*h).is_none();
        let spokes: Vec<HalfedgeId> = self.mesh.spokes(v).filter(curve).collect();
        match spokes.as_slice() {
            [] => Freedom::Surface,
            [a, b] => {
                let along = |h: HalfedgeId| self.mesh.position(self.mesh.other_end(h, v)) - self.mesh.position(v);
                // A curve that turns by more than 60° has a corner there.
                let straight = crate::geom::angle_between(along(*a), -along(*b)) < std::f64::consts::FRAC_PI_3;
                if straight { Freedom::Curve } else { Freedom::Corner }
            }
            _ => Freedom::Corner,
        }
    }

    /// The nearest point on the curves of the source.
    fn on_curve(&self, p: Vec3) -> Vec3 {
        let place = |[a, b]: &[Vec3; 2]| {
            let (t, squared) = closest_on_segment(&(p - a), &(b - a));
            (squared, a + (b - a) * t)
        };
        let nearest = self.curves.iter().map(place).min_by(|x, y| x.0.total_cmp(&y.0));
        nearest.map_or(p, |it| it.1)
    }

    fn on_surface(&self, p: Vec3) -> Vec3 {
        self.bvh.closest(p).point
    }

    fn live_edges(&self) -> Vec<HalfedgeId> {
        self.mesh.edges().collect()
    }

    fn is_curve(&self, h: HalfedgeId) -> bool {
        self.mesh.is_marked(h) || self.mesh.twin(h).is_none()
    }

    fn split(&mut self) -> Result<(), CoarsenError> {
        let longest = 4.0 / 3.0 * self.length;
        let mut queue = self.live_edges();
        let mut at = 0;
        // Halves are queued again, so a long edge is split until its parts are short; the edges to the apexes wait for the
        // next round, because projection may have made them longer and splitting would not end.
        while let Some(&h) = queue.get(at) {
            at += 1;
            if at.is_multiple_of(BEAT) {
                self.monitor.check()?;
            }
            if self.mesh.vector(h).norm() <= longest {
                continue;
            }
            let middle = self.mesh.position(self.mesh.tail(h)) + self.mesh.vector(h) * 0.5;
            let curve = self.is_curve(h);
            let projected = if curve { self.on_curve(middle) } else { self.on_surface(middle) };
            // Both halves must be shorter than the whole, or splitting would never end.
            let near = (projected - middle).norm() < 0.25 * self.mesh.vector(h).norm();
            let ends = [self.mesh.tail(h), self.mesh.head(h)];
            let v = self.mesh.split(h, if near { projected } else { middle });
            queue.extend(self.mesh.spokes(v).filter(|&spoke| ends.contains(&self.mesh.other_end(spoke, v))));
        }
        Ok(())
    }

    fn collapse(&mut self) -> Result<(), CoarsenError> {
        let (shortest, longest) = (0.8 * self.length, 4.0 / 3.0 * self.length);
        for (count, h) in self.live_edges().into_iter().enumerate() {
            if count.is_multiple_of(BEAT) {
                self.monitor.check()?;
            }
            if !self.mesh.is_alive(h) || self.mesh.vector(h).norm() >= shortest {
                continue;
            }
            let ends = [self.mesh.tail(h), self.mesh.head(h)];
            let freedom = ends.map(|v| self.freedom(v));
            // A curve vertex may only move along its curve, a corner not at all.
            if freedom[0] > Freedom::Surface && freedom[1] > Freedom::Surface && !self.is_curve(h) {
                continue;
            }
            let points = ends.map(|v| self.mesh.position(v));
            let middle = (points[0] + points[1]) * 0.5;
            let position = match freedom {
                [Freedom::Corner, Freedom::Corner] => continue,
                [a, b] if a > b => points[0],
                [a, b] if a < b => points[1],
                [Freedom::Curve, _] => self.on_curve(middle),
                _ => self.on_surface(middle),
            };
            let long =
                |v: VertexId| self.mesh.neighbors(v).any(|w| (self.mesh.position(w) - position).norm() > longest);
            if ends.into_iter().any(long) || !self.mesh.can_collapse(h) || !GUARD.allows(&self.mesh, h, position) {
                continue;
            }
            self.mesh.collapse(h, position);
        }
        Ok(())
    }

    /// Flips every edge that brings the four valences around it closer to 6 (4 on the boundary), or, where they stay
    /// equal, the worse of its two triangles closer to the equilateral one.
    fn flip(&mut self) -> Result<(), CoarsenError> {
        for (count, h) in self.live_edges().into_iter().enumerate() {
            if count.is_multiple_of(BEAT) {
                self.monitor.check()?;
            }
            let Some(t) = self.mesh.twin(h).filter(|_| self.mesh.can_flip(h)) else { continue };
            let ends = [self.mesh.tail(h), self.mesh.head(h)];
            let apexes = [self.mesh.apex(h), self.mesh.apex(t)];
            let off = |v: VertexId, change: i64| {
                let wanted = if self.mesh.is_boundary_vertex(v) { 4 } else { 6 };
                (self.mesh.valence(v) as i64 + change - wanted).abs()
            };
            let before: i64 = ends.iter().chain(&apexes).map(|&v| off(v, 0)).sum();
            let after: i64 = ends.iter().map(|&v| off(v, -1)).chain(apexes.iter().map(|&v| off(v, 1))).sum();
            let [a, b, c, d] = [ends[0], ends[1], apexes[0], apexes[1]].map(|v| self.mesh.position(v));
            let (old, new) = ([[a, b, c], [b, a, d]], [[d, c, a], [c, d, b]]);
            let worst = |faces: [[Vec3; 3]; 2]| quality(faces[0]).min(quality(faces[1]));
            let better = after < before || (after == before && worst(new) > worst(old) + 0.05);
            let normal = |[a, b, c]: [Vec3; 3]| (b - a).cross(&(c - a)).try_normalize(0.0).unwrap_or_else(Vec3::zeros);
            let turned = old.iter().any(|o| new.iter().any(|n| normal(*o).dot(&normal(*n)) < FLIP_COSINE));
            if better && !turned && worst(new) > GUARD.min_quality.min(worst(old)) {
                self.mesh.flip(h);
            }
        }
        Ok(())
    }

    /// Moves every free vertex to the area-weighted centroid of its star, along the surface and back onto the source.
    fn relax(&mut self) -> Result<(), CoarsenError> {
        let vertices: Vec<VertexId> = self.mesh.vertices().collect();
        for (count, v) in vertices.into_iter().enumerate() {
            if count.is_multiple_of(BEAT) {
                self.monitor.check()?;
            }
            let here = self.mesh.position(v);
            let target = match self.freedom(v) {
                Freedom::Corner => continue,
                Freedom::Curve => {
                    let ends: Vec<Vec3> = self
                        .mesh
                        .spokes(v)
                        .filter(|&h| self.is_curve(h))
                        .map(|h| self.mesh.position(self.mesh.other_end(h, v)))
                        .collect();
                    self.on_curve((ends[0] + ends[1]) * 0.5)
                }
                Freedom::Surface => {
                    let (mut sum, mut weight, mut normal) = (Vec3::zeros(), 0.0, Vec3::zeros());
                    for h in self.mesh.outgoing(v) {
                        let vector = self.mesh.area_vector(self.mesh.face(h));
                        let [a, b, c] = self.mesh.face_positions(self.mesh.face(h));
                        let area = vector.norm();
                        sum += (a + b + c) * (area / 3.0);
                        weight += area;
                        normal += vector;
                    }
                    let step = sum / weight - here;
                    let normal = normal.try_normalize(0.0).unwrap_or_else(Vec3::zeros);
                    self.on_surface(here + step - normal * normal.dot(&step))
                }
            };
            if GUARD.allows_move(&self.mesh, v, target) {
                self.mesh.set_position(v, target);
            }
        }
        Ok(())
    }
}
