//! The surface as flat arrays: weights, stars, areas, and the measures of a map.
use super::{Quality, centre::centroid, certify::is_positive};
use crate::{
    geom::Vec3,
    mesh::{TriMesh, VertexId, operators::lumped_mass},
};

/// Cotangents beyond this belong to faces without area to the accuracy of the coordinates; they count as this much.
const LARGEST_COTANGENT: f64 = 1e6;

/// A step may not make a face thinner than this share of its thickness on the source.
const THINNEST: f64 = 0.05;

/// A closed mesh as the sphere map reads it.
pub(super) struct Surface {
    pub(super) faces: Vec<[u32; 3]>,
    /// Cotangent of the angle opposite halfedge k (from corner k to corner k + 1) of every face.
    pub(super) cotangents: Vec<[f64; 3]>,
    /// Area of every face over the whole area.
    pub(super) area: Vec<f64>,
    /// Share of the area that belongs to every vertex; sums to 1.
    pub(super) mass: Vec<f64>,
    /// [`thickness`] of every face.
    thickness: Vec<f64>,
    starts: Vec<u32>,
    ring: Vec<(u32, f64)>,
    star: Vec<u32>,
}

impl Surface {
    pub(super) fn new(mesh: &TriMesh) -> Self {
        let total = mesh.total_area();
        let mass = lumped_mass(mesh).iter().map(|it| it / total).collect();
        Self::build(mesh.face_indices(), &|v| mesh.position(VertexId(v)), mass)
    }

    /// From the faces of a closed mesh, the position of every vertex, and its share of the area.
    pub(super) fn build(faces: Vec<[u32; 3]>, position: &dyn Fn(u32) -> Vec3, mass: Vec<f64>) -> Self {
        let corners = |f: &[u32; 3]| f.map(position);
        let cotangents: Vec<[f64; 3]> = faces.iter().map(|f| corner_cotangents(corners(f))).collect();
        let doubled = |[a, b, c]: [Vec3; 3]| (b - a).cross(&(c - a)).norm();
        let total: f64 = faces.iter().map(|f| doubled(corners(f))).sum();
        let mut starts = vec![0_u32; mass.len() + 1];
        faces.as_flattened().iter().for_each(|&v| starts[v as usize + 1] += 1);
        for v in 0..mass.len() {
            starts[v + 1] += starts[v];
        }
        // Two halves of every edge come together: that of the face after it and that of the face before it.
        let mut fill = starts.clone();
        let mut star = vec![0; 3 * faces.len()];
        let mut halves = vec![(0_u32, 0.0); 6 * faces.len()];
        for (f, (face, cotangents)) in faces.iter().zip(&cotangents).enumerate() {
            for k in 0..3 {
                let slot = &mut fill[face[k] as usize];
                star[*slot as usize] = f as u32;
                let last = (k + 2) % 3;
                halves[2 * *slot as usize] = (face[(k + 1) % 3], 0.5 * cotangents[k]);
                halves[2 * *slot as usize + 1] = (face[last], 0.5 * cotangents[last]);
                *slot += 1;
            }
        }
        let mut ring = Vec::with_capacity(3 * faces.len());
        for v in 0..mass.len() {
            let halves = &mut halves[2 * starts[v] as usize..2 * starts[v + 1] as usize];
            halves.sort_unstable_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
            ring.extend(halves.chunks_exact(2).map(|it| (it[0].0, it[0].1 + it[1].1)));
        }
        Self {
            area: faces.iter().map(|f| doubled(corners(f)) / total).collect(),
            thickness: faces.iter().map(|f| thickness(corners(f), |n| n.norm())).collect(),
            mass,
            faces,
            cotangents,
            starts,
            ring,
            star,
        }
    }

    pub(super) fn vertex_count(&self) -> usize {
        self.mass.len()
    }

    /// Neighbours of a vertex, ascending, with the weights of their edges.
    pub(super) fn ring(&self, v: usize) -> &[(u32, f64)] {
        &self.ring[self.starts[v] as usize..self.starts[v + 1] as usize]
    }

    /// Faces around a vertex.
    pub(super) fn star(&self, v: usize) -> &[u32] {
        &self.star[self.starts[v] as usize..self.starts[v + 1] as usize]
    }

    pub(super) fn corners(&self, f: usize, y: &[Vec3]) -> [Vec3; 3] {
        self.faces[f].map(|v| y[v as usize])
    }

    /// F.
    pub(super) fn energy(&self, y: &[Vec3]) -> f64 {
        (0..self.faces.len()).map(|f| self.face_energy(f, self.corners(f, y))).sum()
    }

    /// Share of a face in F.
    fn face_energy(&self, f: usize, [a, b, c]: [Vec3; 3]) -> f64 {
        let [ab, bc, ca] = self.cotangents[f];
        0.5 * (ab * (b - a).norm_squared() + bc * (c - b).norm_squared() + ca * (a - c).norm_squared())
    }

    /// L y: Σ w (y_v − y_u) per vertex, half the gradient of F in space.
    pub(super) fn laplacian(&self, y: &[Vec3]) -> Vec<Vec3> {
        let at = |v: usize| self.ring(v).iter().map(|&(u, w)| w * (y[v] - y[u as usize])).sum();
        (0..y.len()).map(at).collect()
    }

    /// Whether no face is flipped, exactly.
    pub(super) fn is_whole(&self, y: &[Vec3]) -> bool {
        (0..self.faces.len()).all(|f| is_positive(self.corners(f, y)))
    }

    /// Whether a face may go from `y` to `moved`: not flipped, and no thinner than a share of its shape on the source unless it
    /// was before.
    pub(super) fn may_move(&self, f: usize, y: &[Vec3], moved: &[Vec3]) -> bool {
        let corners = self.corners(f, moved);
        is_positive(corners) && {
            let thin = |p: [Vec3; 3]| thickness(p, |n| n.dot(&p[0]));
            let after = thin(corners);
            after >= THINNEST * self.thickness[f] || after >= thin(self.corners(f, y))
        }
    }

    pub(super) fn quality(&self, y: &[Vec3]) -> Quality {
        let mut dilatations: Vec<(f64, f64)> = (0..self.faces.len())
            .map(|f| {
                let [a, b, c] = self.corners(f, y);
                // The face energy is ½ (σ1² + σ2²) times twice the area of the source, the image area is σ1 σ2 times it.
                (self.face_energy(f, [a, b, c]) / (b - a).cross(&(c - a)).norm(), self.area[f])
            })
            .collect();
        let mean = dilatations.iter().map(|&(d, area)| d * area).sum();
        dilatations.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut left = 0.99;
        let p99 = dilatations.iter().find(|it| {
            left -= it.1;
            left <= 0.0
        });
        Quality {
            energy: self.energy(y),
            dilatation_mean: mean,
            dilatation_p99: p99.map_or(f64::INFINITY, |it| it.0),
            centroid: centroid(&self.mass, y).norm(),
        }
    }
}

/// Twice the area of a triangle over its longest side squared; `area` tells it from the area vector.
pub(super) fn thickness([a, b, c]: [Vec3; 3], area: impl Fn(Vec3) -> f64) -> f64 {
    let (ab, ac) = (b - a, c - a);
    area(ab.cross(&ac)) / ab.norm_squared().max(ac.norm_squared()).max((c - b).norm_squared())
}

/// Cotangents of the angles opposite the three sides (from corner k to corner k + 1).
pub(super) fn corner_cotangents(p: [Vec3; 3]) -> [f64; 3] {
    let area = (p[1] - p[0]).cross(&(p[2] - p[0])).norm();
    [0, 1, 2].map(|k| {
        let apex = p[(k + 2) % 3];
        let cotangent = (p[k] - apex).dot(&(p[(k + 1) % 3] - apex)) / area;
        if cotangent.is_nan() { 0.0 } else { cotangent.clamp(-LARGEST_COTANGENT, LARGEST_COTANGENT) }
    })
}
