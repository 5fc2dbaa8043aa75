//! Nonlinear polish of a flat layout: triangles are brought within a limit of stretch while boundary edges keep their
//! length, so that seams still fit. Never flips a triangle that was not flipped.
//!
//! Minimised is Σ A ψ(ln σ / s) over both singular values σ of every triangle of area A, s the limit, plus the same for
//! the logarithm of the relative length of boundary edges with a tighter limit. ψ grows like x² first, then like x⁴ and x⁸:
//! from the least stretch in the mean towards the least of the largest. Beyond the limit it goes on quadratically, so that
//! a sliver that cannot keep the limit does not outweigh all others. Newton's method with the analytic eigensystem of
//! isotropic energies (Smith, de Goes, Kim 2019, section 4), negative eigenvalues dropped.
use super::chart::{Chart, Metric};
use crate::{
    geom::Vec2,
    numeric::{
        dissection::nested_dissection,
        sparse::{Analysis, Cholesky, SymmetricMatrix},
    },
};

/// Exponents of ψ of the Newton steps (more steps change little: what is near isometric is nearly quadratic), each with
/// the area beyond the limit after it, in units of the allowed one, with which a layout is given up as hopeless. Of 424
/// layouts of more than 200 faces that got there without these bounds (bunny_E2 and spot_E0fix in `benches/cut.rs` at 0.5
/// and 0.2 %, every polish written out) they would have given up 7: none after the first step, 1, 3 and 4 after the next.
const SCHEDULE: [(i32, f64); 5] = [(2, 65.0), (4, 16.0), (4, 20.0), (8, 5.0), (8, 0.0)];
/// Share of the x² term beside the higher powers: keeps what is well within the limit from floating.
const FLOOR: f64 = 0.1;
/// Layouts of which more of the area exceeds the limit, in units of the allowed one, are not polished at all.
const TOO_FAR: f64 = 250.0;
/// Boundary edges may change by this share of the stretch, …
const BOUNDARY_SHARE: f64 = 0.2;
/// … but not by more than this: two sides of a seam then differ by less than 0.2 %.
const BOUNDARY_LIMIT: f64 = 5e-4;

/// Linear map of one triangle: gradients of its hat functions in space, in a frame of its own.
type Gradients = [Vec2; 3];

/// How far a layout is from the limit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Excess {
    /// Share of the area in triangles whose principal stretch max |ln σ| exceeds the limit, or that are flipped.
    pub share: f64,
    /// Flipped triangles, or without area.
    pub flipped: usize,
    /// Largest |ln| of the relative length of a boundary edge.
    pub boundary: f64,
}

impl Excess {
    /// Whether at most a share `allowed` of the area exceeds the limit, nothing is flipped and seams fit.
    pub fn is_within(&self, allowed: f64) -> bool {
        self.flipped == 0 && self.share <= allowed && self.boundary <= 2.0 * BOUNDARY_LIMIT
    }
}

/// The triangles of a chart at rest, ready to be measured and polished.
pub struct Isometry<'a> {
    metric: &'a Metric,
    chart: &'a Chart,
    gradients: Vec<Gradients>,
    total_area: f64,
    /// Boundary edges: tail, head, length that they should have.
    rim: Vec<(u32, u32, f64)>,
}

impl<'a> Isometry<'a> {
    /// For one chart; boundary edges should get the length of [`Metric::rim`].
    pub fn new(metric: &'a Metric, chart: &'a Chart) -> Self {
        let gradients = (0..chart.faces.len())
            .map(|k| {
                let [(ab, ..), _, (ca, ..)] = chart.face_halfedges(k);
                let (sin, cos) = metric.angle[ab].sin_cos();
                let b = Vec2::new(metric.length[ab], 0.0);
                let c = Vec2::new(cos, sin) * metric.length[ca];
                let double_area = b.x * c.y;
                let turned = |v: Vec2| Vec2::new(-v.y, v.x) / double_area;
                [turned(c - b), turned(-c), turned(b)]
            })
            .collect();
        let total_area = chart.faces.iter().map(|&f| metric.area[f]).sum();
        let rim = chart.boundary_edges().map(|(h, i, j)| (i, j, metric.rim[h])).collect();
        Self { metric, chart, gradients, total_area, rim }
    }

    /// The same where boundary edges should have other lengths, mm, loop after loop.
    pub fn with_boundary_lengths(mut self, lengths: &[f64]) -> Self {
        self.rim.iter_mut().zip(lengths).for_each(|(edge, &length)| edge.2 = length);
        self
    }

    /// The same where boundary edges may have any length.
    pub fn with_free_boundary(mut self) -> Self {
        self.rim.clear();
        self
    }

    /// Area of the chart in space, mm².
    pub fn total_area(&self) -> f64 {
        self.total_area
    }

    /// The factor of the second derivatives (without their negative parts) of the stretch of a layout for the limit
    /// `stretch`, over the area of the chart: x and y of every local vertex. `None` where a triangle is flipped.
    pub fn stiffness(&self, uv: &[Vec2], stretch: f64) -> Option<Cholesky> {
        if self.excess(uv, stretch).flipped > 0 {
            return None;
        }
        let mut newton = Newton::new(self, uv, stretch)?;
        newton.linearise(uv);
        newton.fix_rigid_motions();
        newton.analysis.factor(&newton.matrix).ok()
    }

    fn area(&self, k: usize) -> f64 {
        self.metric.area[self.chart.faces[k]] / self.total_area
    }

    fn jacobian(&self, k: usize, uv: &[Vec2]) -> [Vec2; 2] {
        let corners = self.chart.corners[k];
        let mut columns = [Vec2::zeros(); 2];
        for (v, g) in corners.iter().zip(&self.gradients[k]) {
            columns[0] += uv[*v as usize] * g.x;
            columns[1] += uv[*v as usize] * g.y;
        }
        columns
    }

    /// Singular values of local face `k`, the larger first; the second negative where it is flipped.
    fn singular_values(&self, k: usize, uv: &[Vec2]) -> [f64; 2] {
        let [a, b] = self.jacobian(k, uv);
        let q = 0.5 * Vec2::new(a.x + b.y, a.y - b.x).norm();
        let r = 0.5 * Vec2::new(a.x - b.y, a.y + b.x).norm();
        [q + r, q - r]
    }

    /// Principal stretch max |ln σ| of local face `k`; infinite where it is flipped.
    pub fn principal_stretch(&self, k: usize, uv: &[Vec2]) -> f64 {
        let [a, b] = self.singular_values(k, uv);
        if b > 0.0 { a.ln().abs().max(b.ln().abs()) } else { f64::INFINITY }
    }

    /// How far a layout is from the limit `stretch`.
    pub fn excess(&self, uv: &[Vec2], stretch: f64) -> Excess {
        let mut out = Excess { share: 0.0, flipped: 0, boundary: 0.0 };
        for k in 0..self.chart.faces.len() {
            let principal = self.principal_stretch(k, uv);
            if principal > stretch {
                out.share += self.area(k);
                out.flipped += usize::from(principal.is_infinite());
            }
        }
        for &(i, j, length) in &self.rim {
            let ratio = (uv[j as usize] - uv[i as usize]).norm() / length;
            out.boundary = out.boundary.max(ratio.ln().abs());
        }
        out
    }

    /// Changes `uv` to where the stretch is evened out, `stretch` or less as far as that goes; nothing where a triangle is
    /// flipped.
    pub fn relax(&self, uv: &mut Vec<Vec2>, stretch: f64) {
        if self.excess(uv, stretch).flipped > 0 {
            return;
        }
        let Some(mut newton) = Newton::new(self, uv, stretch) else { return };
        for (exponent, _) in SCHEDULE {
            newton.exponent = exponent;
            newton.step(uv);
        }
    }

    /// Changes `uv` until at most a share `allowed` of the area exceeds the limit `stretch`, or as far as it goes.
    pub fn polish(&self, uv: &mut Vec<Vec2>, stretch: f64, allowed: f64) -> Excess {
        let mut excess = self.excess(uv, stretch);
        if excess.is_within(allowed) || excess.flipped > 0 || excess.share > TOO_FAR * allowed {
            return excess;
        }
        let Some(mut newton) = Newton::new(self, uv, stretch) else { return excess };
        for (exponent, hopeless) in SCHEDULE {
            newton.exponent = exponent;
            if !newton.step(uv) {
                continue;
            }
            excess = self.excess(uv, stretch);
            if excess.is_within(allowed) || excess.share > hopeless * allowed {
                break;
            }
        }
        excess
    }
}

/// Singular value decomposition of the Jacobian of a flat triangle: J = σ₁ u₁ v₁ᵀ + σ₂ u₂ v₂ᵀ, σ₂ negative where flipped.
struct Stretch {
    sigma: [f64; 2],
    /// Cosine and sine of the angles of u₁ and v₁; u₂ and v₂ are a quarter turn on.
    u: Vec2,
    v: Vec2,
}

impl Stretch {
    /// Of the matrix with columns `a` and `b`, by the angles of u plus v and u minus v.
    fn new([a, b]: [Vec2; 2]) -> Self {
        let difference = 0.5 * Vec2::new(a.x + b.y, a.y - b.x);
        let sum = 0.5 * Vec2::new(a.x - b.y, a.y + b.x);
        let (q, r) = (difference.norm(), sum.norm());
        let unit = |it: Vec2, size: f64| if size > 0.0 { it / size } else { Vec2::new(1.0, 0.0) };
        let (difference, sum) = (unit(difference, q), unit(sum, r));
        // u halves the angle between the two; where they are nearly opposite, by their difference.
        let u = if sum.dot(&difference) > -0.5 {
            (sum + difference).normalize()
        } else {
            let chord = (difference - sum).normalize();
            Vec2::new(-chord.y, chord.x)
        };
        let v = Vec2::new(u.x * difference.x + u.y * difference.y, u.y * difference.x - u.x * difference.y);
        Self { sigma: [q + r, q - r], u, v }
    }
}

/// ψ with its first two derivatives at x ≥ 0 or below.
fn growth(x: f64, exponent: i32) -> [f64; 3] {
    let floor = if exponent == 2 { 0.0 } else { FLOOR };
    let n = f64::from(exponent);
    let size = x.abs();
    let [value, slope, bend] = if size <= 1.0 || exponent == 2 {
        let power = size.powi(exponent - 2);
        [power * size * size, n * power * size, n * (n - 1.0) * power]
    } else {
        let beyond = size - 1.0;
        let bend = n * (n - 1.0);
        [1.0 + n * beyond + 0.5 * bend * beyond * beyond, n + bend * beyond, bend]
    };
    [value + floor * x * x, x.signum() * (slope + 2.0 * floor * size), bend + 2.0 * floor]
}

struct Newton<'a> {
    isometry: &'a Isometry<'a>,
    stretch: f64,
    boundary_limit: f64,
    /// Boundary edges with their weight.
    edges: Vec<(u32, u32, f64, f64)>,
    exponent: i32,
    matrix: SymmetricMatrix,
    /// Values of the matrix that the 21 entries of the lower triangle of a face go into.
    face_slots: Vec<[u32; 21]>,
    edge_slots: Vec<[u32; 10]>,
    analysis: Analysis,
}

/// The unknowns of local vertices: x and y of each.
fn unknowns<const N: usize>(vertices: &[u32]) -> [u32; N] {
    std::array::from_fn(|i| 2 * vertices[i / 2] + i as u32 % 2)
}

impl<'a> Newton<'a> {
    fn new(isometry: &'a Isometry<'a>, uv: &[Vec2], stretch: f64) -> Option<Self> {
        let chart = isometry.chart;
        let mut pairs: Vec<(u32, u32)> = Vec::with_capacity(21 * chart.faces.len());
        let lower = |of: &[u32], pairs: &mut Vec<(u32, u32)>| {
            for (i, &a) in of.iter().enumerate() {
                pairs.extend(of[..=i].iter().map(|&b| (a, b)));
            }
        };
        for corners in &chart.corners {
            lower(&unknowns::<6>(corners), &mut pairs);
        }
        // The width of a strip along the boundary whose stretch weighs as much as that of its edge.
        let width = (isometry.total_area / chart.faces.len() as f64).sqrt();
        let edges: Vec<(u32, u32, f64, f64)> =
            isometry.rim.iter().map(|&(i, j, length)| (i, j, length, length * width / isometry.total_area)).collect();
        for &(i, j, ..) in &edges {
            lower(&unknowns::<4>(&[i, j]), &mut pairs);
        }
        let (matrix, slots) = SymmetricMatrix::with_pattern(2 * uv.len(), &pairs);
        let (faces, rest) = slots.split_at(21 * chart.faces.len());
        let points: Vec<[f64; 3]> = uv.iter().map(|p| [p.x, p.y, 0.0]).collect();
        let analysis = Analysis::with_ordering(&matrix, &nested_dissection(&matrix, 2, &points)).ok()?;
        Some(Self {
            isometry,
            stretch,
            boundary_limit: (BOUNDARY_SHARE * stretch).min(BOUNDARY_LIMIT),
            edges,
            exponent: 2,
            face_slots: faces.as_chunks().0.to_vec(),
            edge_slots: rest.as_chunks().0.to_vec(),
            matrix,
            analysis,
        })
    }

    fn energy(&self, uv: &[Vec2]) -> f64 {
        let mut sum = 0.0;
        for k in 0..self.isometry.chart.faces.len() {
            let [a, b] = self.isometry.singular_values(k, uv);
            if b <= 0.0 {
                return f64::INFINITY;
            }
            let value = |sigma: f64| growth(sigma.ln() / self.stretch, self.exponent)[0];
            sum += self.isometry.area(k) * (value(a) + value(b));
        }
        for &(i, j, length, weight) in &self.edges {
            let ratio = (uv[j as usize] - uv[i as usize]).norm() / length;
            sum += weight * growth(ratio.ln() / self.boundary_limit, self.exponent)[0];
        }
        sum
    }

    /// One step; whether it got anywhere.
    fn step(&mut self, uv: &mut Vec<Vec2>) -> bool {
        let gradient = self.linearise(uv);
        self.fix_rigid_motions();
        let mut direction: Vec<f64> = gradient.iter().map(|it| -it).collect();
        match self.analysis.factor(&self.matrix) {
            Ok(factor) => factor.solve_in_place(&mut direction),
            Err(_) => return false,
        }
        let slope: f64 = gradient.iter().zip(&direction).map(|(g, d)| g * d).sum();
        let energy = self.energy(uv);
        if !(slope < 0.0) {
            return false;
        }
        let moves: Vec<Vec2> = direction.chunks_exact(2).map(|it| Vec2::new(it[0], it[1])).collect();
        let mut length = self.isometry.chart.longest_step(uv, &moves).min(1.0);
        for _ in 0..12 {
            let tried: Vec<Vec2> = uv.iter().zip(&moves).map(|(p, d)| p + d * length).collect();
            if self.energy(&tried) <= energy + 1e-4 * length * slope {
                *uv = tried;
                return true;
            }
            length *= 0.5;
        }
        false
    }

    /// Rigid motions are free: a little weight on every unknown fixes them without changing the step.
    fn fix_rigid_motions(&mut self) {
        let diagonal = self.matrix.diagonal();
        let mean = diagonal.iter().sum::<f64>() / diagonal.len() as f64;
        for i in 0..diagonal.len() {
            self.matrix.add_to_diagonal(i, 1e-9 * mean + 1e-9 * diagonal[i]);
        }
    }

    /// Sets the matrix to the Hessian without its negative parts; the gradient.
    fn linearise(&mut self, uv: &[Vec2]) -> Vec<f64> {
        let isometry = self.isometry;
        let mut gradient = vec![0.0; 2 * uv.len()];
        let values = self.matrix.values_mut();
        values.fill(0.0);
        for (k, corners) in isometry.chart.corners.iter().enumerate() {
            let Stretch { sigma, u, v } = Stretch::new(isometry.jacobian(k, uv));
            let area = isometry.area(k);
            let s = self.stretch;
            let [first, second] = sigma.map(|it| {
                let [_, slope, bend] = growth(it.ln() / s, self.exponent);
                [slope / (s * it), (bend / s - slope) / (s * it * it)]
            });
            let sum = sigma[0] + sigma[1];
            let gap = sigma[0] - sigma[1];
            let shear = if gap > 1e-9 * sum { (first[0] - second[0]) / gap } else { 0.5 * (first[1] + second[1]) };
            let eigenvalues = [first[1], second[1], (first[0] + second[0]) / sum, shear];
            let turned = |it: Vec2| Vec2::new(-it.y, it.x);
            let (u2, v2) = (turned(u), turned(v));
            let half = std::f64::consts::FRAC_1_SQRT_2;
            let mut modes = [[0.0; 6]; 4];
            for (c, g) in isometry.gradients[k].iter().enumerate() {
                let (along, across) = (v.dot(g), v2.dot(g));
                let parts =
                    [u * along, u2 * across, (u2 * along - u * across) * half, (u2 * along + u * across) * half];
                for (mode, part) in modes.iter_mut().zip(parts) {
                    (mode[2 * c], mode[2 * c + 1]) = (part.x, part.y);
                }
            }
            for (i, &unknown) in unknowns::<6>(corners).iter().enumerate() {
                gradient[unknown as usize] += area * (first[0] * modes[0][i] + second[0] * modes[1][i]);
            }
            let mut block = [0.0; 21];
            for (mode, eigenvalue) in modes.iter().zip(eigenvalues) {
                add_square(&mut block, mode, area * eigenvalue.max(0.0));
            }
            for (slot, value) in self.face_slots[k].iter().zip(block) {
                values[*slot as usize] += value;
            }
        }
        for (&(i, j, length, weight), slots) in self.edges.iter().zip(&self.edge_slots) {
            let side = uv[j as usize] - uv[i as usize];
            let flat = side.norm();
            let limit = self.boundary_limit;
            let [_, slope, bend] = growth((flat / length).ln() / limit, self.exponent);
            let (slope, bend) = (slope / (limit * flat), (bend / limit - slope) / (limit * flat * flat));
            let t = side / flat;
            let along = [-t.x, -t.y, t.x, t.y];
            let across = [t.y, -t.x, -t.y, t.x];
            for (unknown, a) in unknowns::<4>(&[i, j]).into_iter().zip(along) {
                gradient[unknown as usize] += weight * slope * a;
            }
            let mut block = [0.0; 10];
            add_square(&mut block, &along, weight * bend.max(0.0));
            add_square(&mut block, &across, weight * (slope / flat).max(0.0));
            for (slot, value) in slots.iter().zip(block) {
                values[*slot as usize] += value;
            }
        }
        gradient
    }
}

/// Adds `weight` q qᵀ to the rows of a lower triangle.
fn add_square(block: &mut [f64], q: &[f64], weight: f64) {
    let mut at = 0;
    for (i, &a) in q.iter().enumerate() {
        for &b in &q[..=i] {
            block[at] += weight * a * b;
            at += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decomposition_gives_the_matrix_back() {
        for i in 0..200 {
            let x = |k: usize| ((i * 4 + k) as f64 * 12.9898).sin() * if i % 3 == 0 && k > 1 { 1e-9 } else { 1.0 };
            let [a, b] = [Vec2::new(x(0), x(1)), Vec2::new(x(2), x(3))];
            let Stretch { sigma, u, v } = Stretch::new([a, b]);
            let turned = |it: Vec2| Vec2::new(-it.y, it.x);
            let (u2, v2) = (turned(u), turned(v));
            let error = (u * (sigma[0] * v.x) + u2 * (sigma[1] * v2.x) - a).norm()
                + (u * (sigma[0] * v.y) + u2 * (sigma[1] * v2.y) - b).norm();
            assert!(error < 1e-14 && (u.norm() - 1.0).abs() < 1e-14 && (v.norm() - 1.0).abs() < 1e-14, "{error}");
        }
    }

    #[test]
    fn growth_has_the_derivatives_it_says() {
        for exponent in [2, 4, 8] {
            for x in [-3.0, -1.0001, -0.7, 0.0, 0.3, 0.999, 1.2, 5.0] {
                let h = 1e-6;
                let [value, slope, bend] = growth(x, exponent);
                let [[low, slope_low, _], [high, slope_high, _]] = [x - h, x + h].map(|x| growth(x, exponent));
                assert!((slope - (high - low) / (2.0 * h)).abs() < 1e-6 * (1.0 + value), "{exponent} {x}");
                assert!((bend - (slope_high - slope_low) / (2.0 * h)).abs() < 1e-4 * (1.0 + bend), "{exponent} {x}");
            }
        }
    }
}
