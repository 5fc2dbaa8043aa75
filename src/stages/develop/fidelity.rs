//! Closeness to the source as a dead zone in both directions: w Σ c (d − t)₊² over samples of either surface, d their
//! distance to the other one.
//!
//! Within the zone a weak pull p/V Σ h(d/t) over the vertices, h(s) = s but rounded near 0, draws the moving mesh towards the
//! source: among shapes of nearly the same energy the closest is wanted, and energy + p · mean distance has the best of them
//! as its minima.
//!
//! Each sample holds its closest point of the latest query. From then on the distance to that point is an upper bound of
//! the true one, equal to it and with the same gradient where it was queried. So the term majorises the true one: it never
//! misses a violation, and a sample inside the zone needs no query at all.
use rayon::prelude::*;

use super::set_positions;
use crate::{
    geom::Vec3,
    mesh::{Bvh, FaceId, HalfedgeId, Id, TriMesh},
};

/// Distance over the half width of the zone below which the pull fades.
const FADE: f64 = 0.1;
/// Samples per task.
const BLOCK: usize = 2048;

/// A point of one face of the moving mesh, and a point of the source.
#[derive(Debug, Clone, Copy)]
struct Sample {
    /// The face of the moving mesh, and its vertices.
    face: FaceId,
    vertices: [u32; 3],
    /// Barycentric coordinates in those vertices.
    weights: [f64; 3],
    source: Vec3,
    /// The face of the source that was closest, for samples of the moving mesh.
    hint: FaceId,
    /// c.
    factor: f64,
}

impl Sample {
    /// From the point of the source to the point of the moving mesh.
    fn offset(&self, x: &[f64]) -> Vec3 {
        self.point(x) - self.source
    }

    fn point(&self, x: &[f64]) -> Vec3 {
        self.vertices.iter().zip(self.weights).map(|(&v, w)| w * position(x, v)).sum()
    }

    /// Finds the closest point of the source anew, for a sample of the moving mesh.
    fn query(&mut self, x: &[f64], source: &Bvh, unit: f64) {
        let closest = source.closest_from(self.point(x) * unit, self.hint);
        (self.source, self.hint) = (closest.point / unit, closest.face);
    }
}

/// The pull on one vertex.
#[derive(Debug, Clone, Copy)]
struct Attraction {
    /// p/V.
    scale: f64,
    /// t.
    band: f64,
}

impl Attraction {
    /// Value, first and second derivative at some distance.
    fn at(self, distance: f64) -> (f64, f64, f64) {
        let Self { scale, band } = self;
        let (s, slope) = (distance / band, scale / band);
        if s < FADE {
            (scale * 0.5 * s * s / FADE, slope * s / FADE, slope / (band * FADE))
        } else {
            (scale * (s - 0.5 * FADE), slope, 0.0)
        }
    }
}

/// The fidelity term. Lengths are in the unit of the moving mesh; the source is in mm.
#[derive(Debug)]
pub(super) struct Fidelity<'a> {
    source: &'a Bvh,
    /// Length of the unit, mm.
    unit: f64,
    /// The moving mesh at the latest query of a sample of the source.
    mesh: TriMesh,
    tree: Bvh,
    /// Half width t of the dead zone.
    pub(super) band: f64,
    /// w.
    pub(super) weight: f64,
    /// p.
    pub(super) pull: f64,
    /// How many of `outward`, from the first, are the vertices.
    vertices: usize,
    /// Points of the moving mesh, with their closest points of the source.
    outward: Vec<Sample>,
    /// Points of the source, with their closest points of the moving mesh.
    inward: Vec<Sample>,
    /// Per sample the derivative by its point, and its value.
    pulls: Vec<[f64; 4]>,
}

impl<'a> Fidelity<'a> {
    /// Samples `mesh` at its vertices and inside its faces, more densely where they are large; the source at `points` (mm).
    pub(super) fn new(source: &'a Bvh, points: &[Vec3], mesh: &TriMesh, unit: f64, band: f64, weight: f64) -> Self {
        let mut fidelity = Self {
            source,
            unit,
            mesh: mesh.clone(),
            tree: Bvh::new(mesh),
            band,
            weight,
            pull: 0.0,
            vertices: 0,
            outward: Vec::new(),
            inward: Vec::new(),
            pulls: Vec::new(),
        };
        let vertices = vertex_samples(mesh);
        fidelity.vertices = vertices.len();
        fidelity.add_outward(&vertices, 1.0);
        fidelity.add_outward(&face_samples(mesh), 1.0);
        fidelity.add_inward(points, 1.0);
        fidelity
    }

    /// Adds points of the moving mesh: a face and barycentric coordinates each.
    pub(super) fn add_outward(&mut self, points: &[(FaceId, [f64; 3])], factor: f64) {
        let (source, unit, mesh) = (self.source, self.unit, &self.mesh);
        self.outward.par_extend(points.par_iter().with_min_len(BLOCK).map(|&(face, weights)| {
            let corners = mesh.face_positions(face);
            let point: Vec3 = corners.iter().zip(weights).map(|(p, w)| w * p).sum();
            let closest = source.closest(point * unit);
            let vertices = mesh.face_vertices(face).map(|v| v.0);
            Sample { face, vertices, weights, source: closest.point / unit, hint: closest.face, factor }
        }));
        self.resize();
    }

    /// Adds points of the source, mm.
    pub(super) fn add_inward(&mut self, points: &[Vec3], factor: f64) {
        let (unit, mesh, tree) = (self.unit, &self.mesh, &self.tree);
        self.inward.par_extend(points.par_iter().with_min_len(BLOCK).map(|point| {
            let source = point / unit;
            let closest = tree.closest(source);
            let vertices = mesh.face_vertices(closest.face).map(|v| v.0);
            Sample { face: closest.face, vertices, weights: closest.barycentric, source, hint: FaceId(0), factor }
        }));
        self.resize();
    }

    /// Moves its copy of the mesh to the positions of `mesh`.
    pub(super) fn follow(&mut self, mesh: &TriMesh) {
        self.mesh.positions_mut().as_mut_slice().copy_from_slice(mesh.positions().as_slice());
        self.tree.refit(&self.mesh);
    }

    /// Queries all closest points anew at `x`, without regard to earlier ones.
    pub(super) fn settle(&mut self, x: &[f64]) {
        set_positions(&mut self.mesh, x);
        self.tree.refit(&self.mesh);
        let (source, unit, mesh, tree) = (self.source, self.unit, &self.mesh, &self.tree);
        self.outward.par_iter_mut().with_min_len(BLOCK).for_each(|it| {
            let closest = source.closest(it.point(x) * unit);
            (it.source, it.hint) = (closest.point / unit, closest.face);
        });
        self.inward.par_iter_mut().with_min_len(BLOCK).for_each(|it| {
            let closest = tree.closest(it.source);
            it.vertices = mesh.face_vertices(closest.face).map(|v| v.0);
            (it.weights, it.hint) = (closest.barycentric, closest.face);
        });
    }

    fn resize(&mut self) {
        self.pulls.resize(self.outward.len() + self.inward.len(), [0.0; 4]);
    }

    /// Value at `x`; adds to `gradient`.
    pub(super) fn evaluate(&mut self, x: &[f64], gradient: &mut [f64]) -> f64 {
        let (band, weight, outward) = (self.band, self.weight, &self.outward);
        let (pulls_out, pulls_in) = self.pulls.split_at_mut(outward.len());
        for (samples, pulls) in [(outward, pulls_out), (&self.inward, pulls_in)] {
            pulls.par_iter_mut().zip(samples).with_min_len(BLOCK).for_each(|(pull, sample)| {
                let offset = sample.offset(x);
                let squared = offset.norm_squared();
                *pull = if squared <= band * band {
                    [0.0; 4]
                } else {
                    let (distance, scale) = (squared.sqrt(), weight * sample.factor);
                    let excess = distance - band;
                    let d = offset * (2.0 * scale * excess / distance);
                    [d.x, d.y, d.z, scale * excess * excess]
                };
            });
        }
        let (attraction, count) = (self.attraction(), self.pulled().len());
        for (pull, sample) in self.pulls.iter_mut().zip(&self.outward[..count]) {
            let offset = sample.offset(x);
            let (value, slope, _) = attraction.at(offset.norm());
            if slope > 0.0 {
                let d = offset * (slope / offset.norm());
                *pull = [pull[0] + d.x, pull[1] + d.y, pull[2] + d.z, pull[3] + value];
            }
        }
        let mut sum = 0.0;
        for (pull, sample) in self.pulls.iter().zip(self.outward.iter().chain(&self.inward)) {
            if pull[3] == 0.0 {
                continue;
            }
            sum += pull[3];
            for (&v, w) in sample.vertices.iter().zip(sample.weights) {
                (0..3).for_each(|c| gradient[3 * v as usize + c] += w * pull[c]);
            }
        }
        sum
    }

    /// The samples that are pulled.
    fn pulled(&self) -> &[Sample] {
        &self.outward[..if self.pull > 0.0 { self.vertices } else { 0 }]
    }

    fn attraction(&self) -> Attraction {
        Attraction { scale: self.pull / self.vertices as f64, band: self.band }
    }

    /// Hands out, per sample outside the zone at `x`, its face with its vertices, its barycentric coordinates there, and the
    /// Hessian by its point with the closest point held: 2 w c [n nᵀ + s (I − n nᵀ)], s = (d − t)/d.
    pub(super) fn curvature(
        &self,
        x: &[f64],
        mut add: impl FnMut(FaceId, [u32; 3], [f64; 3], &nalgebra::Matrix3<f64>),
    ) {
        let attraction = self.attraction();
        for sample in self.pulled() {
            let offset = sample.offset(x);
            let (_, _, bend) = attraction.at(offset.norm());
            if bend > 0.0 && offset.norm() > 0.0 {
                let normal = offset.normalize();
                add(sample.face, sample.vertices, sample.weights, &(normal * normal.transpose() * bend));
            }
        }
        for sample in self.outward.iter().chain(&self.inward) {
            let offset = sample.offset(x);
            let distance = offset.norm();
            if distance > self.band {
                let along = 1.0 - self.band / distance;
                let normal = offset / distance;
                let block = normal * normal.transpose() * (1.0 - along) + nalgebra::Matrix3::identity() * along;
                add(sample.face, sample.vertices, sample.weights, &(block * (2.0 * self.weight * sample.factor)));
            }
        }
    }

    /// Queries the closest points of all pulled vertices anew; [`Self::refresh`] leaves alone those in the zone. Returns
    /// whether there are any.
    pub(super) fn refresh_pulled(&mut self, x: &[f64]) -> bool {
        let (source, unit, count) = (self.source, self.unit, self.pulled().len());
        self.outward[..count].par_iter_mut().with_min_len(BLOCK).for_each(|it| it.query(x, source, unit));
        count > 0
    }

    /// Queries the closest points anew where the latest ones have left the zone; afterwards value and gradient at `x` are
    /// those of the true distances. Returns whether anything changed.
    pub(super) fn refresh(&mut self, x: &[f64]) -> bool {
        let (source, unit, limit) = (self.source, self.unit, self.band * self.band);
        let outside = |it: &Sample| it.offset(x).norm_squared() > limit;
        let moved_out = self
            .outward
            .par_iter_mut()
            .with_min_len(BLOCK)
            .filter(|it| outside(it))
            .map(|it| it.query(x, source, unit));
        let mut changed = moved_out.count() > 0;
        if self.inward.par_iter().with_min_len(BLOCK).any(outside) {
            set_positions(&mut self.mesh, x);
            self.tree.refit(&self.mesh);
            let (mesh, tree) = (&self.mesh, &self.tree);
            self.inward.par_iter_mut().with_min_len(BLOCK).filter(|it| outside(it)).for_each(|it| {
                let closest = tree.closest_from(it.source, it.face);
                it.vertices = mesh.face_vertices(closest.face).map(|v| v.0);
                it.weights = closest.barycentric;
                it.face = closest.face;
            });
            changed = true;
        }
        changed
    }
}

fn position(x: &[f64], v: u32) -> Vec3 {
    let at = 3 * v as usize;
    Vec3::new(x[at], x[at + 1], x[at + 2])
}

/// Every vertex, as a corner of one of its faces.
fn vertex_samples(mesh: &TriMesh) -> Vec<(FaceId, [f64; 3])> {
    let corner = |h: HalfedgeId| {
        let mut weights = [0.0; 3];
        weights[h.index() % 3] = 1.0;
        (mesh.face(h), weights)
    };
    mesh.vertices().filter_map(|v| mesh.outgoing(v).next()).map(corner).collect()
}

/// Face centroids, and where a face is large for the mesh three or six points more in it.
fn face_samples(mesh: &TriMesh) -> Vec<(FaceId, [f64; 3])> {
    /// Area over the mean area from which edge midpoints, and points between them and the corners, are sampled too.
    const LARGE: [f64; 2] = [1.5, 4.0];
    const MIDPOINTS: [[f64; 3]; 3] = [[0.5, 0.5, 0.0], [0.0, 0.5, 0.5], [0.5, 0.0, 0.5]];
    const SIXTHS: [[f64; 3]; 3] =
        [[2.0 / 3.0, 1.0 / 6.0, 1.0 / 6.0], [1.0 / 6.0, 2.0 / 3.0, 1.0 / 6.0], [1.0 / 6.0, 1.0 / 6.0, 2.0 / 3.0]];
    let mut samples = Vec::new();
    let mean = mesh.total_area() / mesh.face_count() as f64;
    for face in mesh.faces() {
        let ratio = mesh.area(face) / mean;
        samples.push((face, [1.0 / 3.0; 3]));
        for (limit, points) in LARGE.into_iter().zip([MIDPOINTS, SIXTHS]) {
            if ratio > limit {
                samples.extend(points.map(|weights| (face, weights)));
            }
        }
    }
    samples
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A unit square of 8 × 8 cells, lifted by `height`.
    fn sheet(height: impl Fn(f64, f64) -> f64) -> TriMesh {
        let n = 8_u32;
        let at = |i: u32| f64::from(i) / f64::from(n);
        let positions = (0..=n)
            .flat_map(|j| (0..=n).map(move |i| (at(i), at(j))))
            .map(|(x, y)| Vec3::new(x, y, height(x, y)))
            .collect();
        let faces: Vec<_> = (0..n * n)
            .flat_map(|c| {
                let a = c / n * (n + 1) + c % n;
                [[a, a + 1, a + n + 2], [a, a + n + 2, a + n + 1]]
            })
            .collect();
        TriMesh::new(positions, &faces).unwrap()
    }

    fn flat(mesh: &TriMesh) -> Vec<f64> {
        mesh.positions().iter().flat_map(|p| [p.x, p.y, p.z]).collect()
    }

    #[test]
    fn gradient_agrees_with_differences_of_the_true_distance_term() {
        // Uneven, so that no sample lies where two closest points tie.
        let (source, mesh) =
            (sheet(|x, y| 0.2 * (3.0 * x + 0.1 * y).sin()), sheet(|x, y| 0.1 * x * y + 0.17 * x + 0.1));
        let tree = Bvh::new(&source);
        let points: Vec<Vec3> = source.positions().iter().copied().collect();
        let mut hold = Fidelity::new(&tree, &points, &mesh, 1.0, 0.02, 3.0);
        hold.pull = 0.7;
        let mut x = flat(&mesh);
        let mut gradient = vec![0.0; x.len()];
        let fixed = hold.evaluate(&x, &mut gradient);
        assert!(fixed > 0.0);
        let largest = gradient.iter().fold(0.0_f64, |m, g| m.max(g.abs()));
        let mut unused = vec![0.0; x.len()];
        for i in 0..x.len() {
            let (here, h) = (x[i], 1e-6);
            let mut at = |x_i: f64, queried: bool| {
                x[i] = x_i;
                if queried {
                    hold.refresh(&x);
                    hold.refresh_pulled(&x);
                }
                hold.evaluate(&x, &mut unused)
            };
            let held = (at(here + h, false) - at(here - h, false)) / (2.0 * h);
            assert!((held - gradient[i]).abs() < 1e-7 * largest, "{i}: {held} {}", gradient[i]);
            // With the closest points queried anew at every step: the gradient is that of the true distance.
            let queried = (at(here + h, true) - at(here - h, true)) / (2.0 * h);
            assert!((queried - gradient[i]).abs() < 1e-4 * largest, "{i}: {queried} {}", gradient[i]);
            at(here, true);
        }
    }

    #[test]
    fn old_closest_points_never_hide_a_violation() {
        let (source, mesh) = (sheet(|_, _| 0.0), sheet(|x, y| 0.1 * (x - y)));
        let tree = Bvh::new(&source);
        let mut hold = Fidelity::new(&tree, &[Vec3::new(0.1, 0.8, 0.0)], &mesh, 1.0, 0.01, 1.0);
        let moved = flat(&sheet(|x, y| 0.2 * (x + y).sin()));
        let mut unused = vec![0.0; moved.len()];
        let old = hold.evaluate(&moved, &mut unused);
        assert!(hold.refresh(&moved));
        assert!(hold.evaluate(&moved, &mut unused) <= old);
    }
}
