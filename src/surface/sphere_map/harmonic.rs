//! The two linear systems of the fast way, on one pattern: the harmonic map of all but one triangle, and the Sobolev metric.
use super::surface::Surface;
use crate::{
    geom::Vec3,
    numeric::sparse::{Analysis, Cholesky, SymmetricMatrix},
};

/// Share of the mass of the image in the Sobolev metric. The Hessian of F over the sphere has the eigenvalues l (l + 1) − 2
/// where L has l (l + 1) (2 for the motions of the sphere, which keep F), so little mass is best; it only has to keep the
/// metric definite.
const MASS: f64 = 0.1;

/// The Laplacian's pattern, analysed once.
pub(super) struct System {
    matrix: SymmetricMatrix,
    /// Edge entries: slot, tail, head, weight.
    edges: Vec<(u32, u32, u32, f64)>,
    analysis: Analysis,
}

impl System {
    /// `None` where the matrix does not fit into memory.
    pub(super) fn new(surface: &Surface) -> Option<Self> {
        let n = surface.vertex_count();
        let edges: Vec<(u32, u32, f64)> = (0..n as u32)
            .flat_map(|v| surface.ring(v as usize).iter().filter(move |it| it.0 > v).map(move |&(u, w)| (v, u, w)))
            .collect();
        let pairs: Vec<(u32, u32)> = edges.iter().map(|it| (it.0, it.1)).collect();
        let (matrix, slots) = SymmetricMatrix::with_pattern(n, &pairs);
        let analysis = Analysis::new(&matrix).ok()?;
        let edges = edges.into_iter().zip(slots).map(|((u, v, w), slot)| (slot, u, v, w)).collect();
        Some(Self { matrix, edges, analysis })
    }

    /// Sets the Laplacian, with the rows of `pinned` replaced by those of the identity.
    fn set(&mut self, pinned: &[u32]) {
        let edges = &self.edges;
        let diagonal: Vec<u32> = (0..self.matrix.size() as u32).map(|i| self.matrix.diagonal_slot(i)).collect();
        let values = self.matrix.values_mut();
        values.fill(0.0);
        for &(slot, u, v, w) in edges {
            let free = [u, v].map(|it| !pinned.contains(&it));
            for (it, free) in [u, v].into_iter().zip(free) {
                if free {
                    values[diagonal[it as usize] as usize] += w;
                }
            }
            if free == [true; 2] {
                values[slot as usize] = -w;
            }
        }
        for &v in pinned {
            values[diagonal[v as usize] as usize] = 1.0;
        }
    }

    /// The harmonic map to the plane of all faces but `hole`, whose corners are held at an equilateral
    /// triangle, brought to the sphere by the inverse stereographic projection (Haker et al. 2000 hold a dipole instead).
    /// `None` where the Laplacian cannot be factored.
    pub(super) fn harmonic(&mut self, surface: &Surface, hole: [u32; 3]) -> Option<Vec<Vec3>> {
        let n = surface.vertex_count();
        // Counter-clockwise: all other faces lie inside and turn over, and so does the projection as seen from outside.
        let root = 0.75_f64.sqrt();
        let corners = [[1.0, 0.0], [-0.5, root], [-0.5, -root]];
        self.set(&hole);
        let factor = self.analysis.factor(&self.matrix).ok()?;
        let mut z = vec![0.0; 2 * n];
        for (&v, at) in hole.iter().zip(corners) {
            for &(u, w) in surface.ring(v as usize).iter().filter(|it| !hole.contains(&it.0)) {
                z[u as usize] += w * at[0];
                z[n + u as usize] += w * at[1];
            }
        }
        for (&v, at) in hole.iter().zip(corners) {
            z[v as usize] = at[0];
            z[n + v as usize] = at[1];
        }
        factor.solve_in_place(&mut z);
        let (x, y) = z.split_at(n);
        onto_sphere(surface, x, y)
    }

    /// The factor of L + M with M a small share of the lumped area of the image.
    pub(super) fn sobolev(&mut self, surface: &Surface, y: &[Vec3]) -> Option<Cholesky> {
        self.set(&[]);
        for f in 0..surface.faces.len() {
            let [a, b, c] = surface.corners(f, y);
            let third = MASS * (b - a).cross(&(c - a)).norm() / 6.0;
            for v in surface.faces[f] {
                self.matrix.add_to_diagonal(v as usize, third.max(1e-15));
            }
        }
        self.analysis.factor(&self.matrix).ok()
    }
}

/// Sum of the squared cotangents of a face: 1 for the equilateral triangle, more for any other.
fn irregularity(surface: &Surface, f: usize) -> f64 {
    surface.cotangents[f].iter().map(|it| it * it).sum()
}

/// The corners of the face that is closest to equilateral.
pub(super) fn most_regular(surface: &Surface) -> [u32; 3] {
    let faces = 0..surface.faces.len();
    let key = |&f: &usize| irregularity(surface, f);
    let best = faces.min_by(|a, b| key(a).total_cmp(&key(b)).then(a.cmp(b)));
    surface.faces[best.unwrap_or(0)]
}

/// The corners of the face, among the more regular ones, that a first map enlarges most: it lies on the trunk of the shape. From
/// the tip of a limb everything else would be too small.
pub(super) fn most_open(surface: &Surface, y: &[Vec3]) -> [u32; 3] {
    let key = |&f: &usize| {
        let [a, b, c] = surface.corners(f, y);
        (b - a).cross(&(c - a)).norm() / surface.area[f]
    };
    let regular = (0..surface.faces.len()).filter(|&f| irregularity(surface, f) < 2.0);
    let best = regular.max_by(|a, b| key(a).total_cmp(&key(b)).then(b.cmp(a)));
    best.map_or_else(|| most_regular(surface), |f| surface.faces[f])
}

/// Inverse stereographic projection after a shift to the centre of area and a scaling by the mean distance from it.
fn onto_sphere(surface: &Surface, x: &[f64], y: &[f64]) -> Option<Vec<Vec3>> {
    let mean = |value: &dyn Fn(usize) -> f64| (0..x.len()).map(|v| surface.mass[v] * value(v)).sum::<f64>();
    let centre = [mean(&|v| x[v]), mean(&|v| y[v])];
    let scale = mean(&|v| f64::hypot(x[v] - centre[0], y[v] - centre[1]));
    if !(scale > 0.0 && scale.is_finite()) {
        return None;
    }
    let project = |v: usize| {
        let (p, q) = ((x[v] - centre[0]) / scale, (y[v] - centre[1]) / scale);
        let square = p * p + q * q;
        Vec3::new(2.0 * p, 2.0 * q, square - 1.0) / (square + 1.0)
    };
    Some((0..x.len()).map(project).collect())
}
