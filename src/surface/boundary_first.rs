//! Boundary-first flattening whole (Sawhney, Crane 2017): log factors, lengths or exterior angles prescribed on the
//! boundary, and cones inside, all with the one factorisation of A_II that a [`Flattener`] holds.
//!
//! Notation as in `flatten`, with Θ the curvature asked for at interior vertices (0 but at cones) and k̃ the exterior
//! angles in the plane: A u = (Θ − K, k̃ − k).
//! - u given on the boundary (section 4.1): A_II u_I = Θ − K − A_IB u_B, then k̃ = k + (A u)_B.
//! - k̃ given (section 4.2): the Schur complement S = A_BB − A_BI A_II⁻¹ A_IB on the boundary is solved by conjugate
//!   gradients; each product with it is one solve with A_II. Nothing else is factored.
//! - cones (section 5.4): the chart opened to the cones has fewer interior vertices; the rows of those on the slits are
//!   taken out of A_II⁻¹ by a Schur complement of their number.
use super::{
    chart::Chart,
    flatten::{FlattenError, Flattener, NONE},
};
use crate::{
    geom::Vec2,
    numeric::sparse::{Cholesky, SymmetricMatrix},
};

/// Exterior angles may miss the sum of Gauss and Bonnet by so much for every boundary vertex, radians.
const ANGLE_ROUNDING: f64 = 1e-9;
/// Conjugate gradients end at this share of the first residual …
const RESIDUAL: f64 = 1e-13;
/// … or after so many steps per boundary vertex: in exact arithmetic one is enough.
const STEPS: usize = 3;

/// A vertex inside a chart that stays curved.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cone {
    /// Local vertex, not on the boundary.
    pub vertex: u32,
    /// 2π minus the sum of angles around it, radians.
    pub curvature: f64,
}

/// A conformal map to the plane as far as it is decided before anything is laid out.
#[derive(Debug, Clone, PartialEq)]
pub struct Conformal {
    /// Log factor u per local vertex.
    pub log_factor: Vec<f64>,
    /// Exterior angle per local vertex, radians; 0 in the interior.
    pub exterior: Vec<f64>,
    /// Length asked for of each boundary edge, mm: loop after loop, in the order of the chart's loops.
    pub lengths: Vec<f64>,
    /// Curvature per local vertex that stays in the interior; 0 but at cones.
    pub curvature: Vec<f64>,
}

impl Flattener<'_> {
    /// The map with u given on the boundary (per local vertex; what stands in the interior is not read).
    pub fn with_log_factor(&self, boundary: &[f64], cones: &[Cone]) -> Conformal {
        let lengths = self.chart.boundary_edges().map(|(h, i, j)| {
            let mean = 0.5 * (boundary[i as usize] + boundary[j as usize]);
            self.metric.length[h] * mean.exp()
        });
        let lengths = lengths.collect();
        self.conformal(boundary, self.curvature(cones), lengths)
    }

    /// The map whose boundary edges get the `lengths` given, mm, loop after loop: u at a vertex is the mean of the
    /// logarithms of both ratios, weighted by the lengths in space.
    pub fn with_lengths(&self, lengths: &[f64], cones: &[Cone]) -> Conformal {
        let n = self.chart.vertex_count();
        let (mut sum, mut weight) = (vec![0.0; n], vec![0.0; n]);
        for ((h, i, j), target) in self.chart.boundary_edges().zip(lengths) {
            let length = self.metric.length[h];
            for v in [i, j] {
                sum[v as usize] += length * (target / length).ln();
                weight[v as usize] += length;
            }
        }
        let boundary: Vec<f64> = sum.iter().zip(&weight).map(|(s, w)| if *w > 0.0 { s / w } else { 0.0 }).collect();
        self.conformal(&boundary, self.curvature(cones), lengths.to_vec())
    }

    /// The map with the exterior angles given on the boundary (per local vertex, radians), of the size at which the
    /// boundary keeps its length. They and the curvatures of the cones must sum to 2π (2 − loops); refused with the sum
    /// that is missing.
    pub fn with_exterior_angles(&self, exterior: &[f64], cones: &[Cone]) -> Result<Conformal, FlattenError> {
        let chart = self.chart;
        let rim = || (0..chart.vertex_count()).filter(|&v| chart.on_boundary[v]);
        let curvature = self.curvature(cones);
        let needed = std::f64::consts::TAU * chart.euler_characteristic() as f64;
        let given = rim().map(|v| exterior[v]).sum::<f64>() + curvature.iter().sum::<f64>();
        let count = rim().count();
        if !((given - needed).abs() <= ANGLE_ROUNDING * count as f64) {
            return Err(FlattenError::GaussBonnet { face: chart.faces[0], given, needed });
        }
        // What u_B = 0 gives; the difference to the angles asked for is S u_B.
        let still = self.fill(&vec![0.0; chart.vertex_count()], &curvature);
        let before = self.exterior_angles_of(&still);
        let right: Vec<f64> = (0..chart.vertex_count())
            .map(|v| if chart.on_boundary[v] { exterior[v] - before[v] } else { 0.0 })
            .collect();
        let mut boundary = self.conjugate_gradients(&right);
        let (length, size) = self.chart.boundary_edges().fold((0.0, 0.0), |(length, size), (h, i, j)| {
            let l = self.metric.length[h];
            (length + l, size + l * (0.5 * (boundary[i as usize] + boundary[j as usize])).exp())
        });
        boundary.iter_mut().for_each(|u| *u += (length / size).ln());
        let mut out = self.with_log_factor(&boundary, cones);
        for v in rim() {
            out.exterior[v] = exterior[v];
        }
        Ok(out)
    }

    /// Plane coordinates per local vertex of a disk without cones, mm: the best-fit closed curve with the exterior angles
    /// of the map, then both coordinates extended harmonically.
    pub fn lay_out(&self, map: &Conformal) -> Result<Vec<Vec2>, FlattenError> {
        let chart = self.chart;
        self.refuse_unless_disk(chart)?;
        let corners: Vec<(u32, f64)> = chart.loops[0].iter().map(|&(_, v)| (v, map.exterior[v as usize])).collect();
        let groups: Vec<usize> = (0..corners.len()).collect();
        let mut uv = self.closed_curve(chart, &corners, &map.lengths, &groups)?;
        self.extend(&mut uv);
        Ok(uv)
    }

    /// Plane coordinates per local vertex of `open`, mm: the same faces, opened to a disk along edges through all cones of
    /// the map. Both sides of such an edge get the same length.
    pub fn lay_out_opened(&self, map: &Conformal, open: &Chart) -> Result<Vec<Vec2>, FlattenError> {
        self.refuse_unless_disk(open)?;
        let mut inner = vec![0_u32; open.vertex_count()];
        for (opened, whole) in open.corners.iter().zip(&self.chart.corners) {
            for (&v, &w) in opened.iter().zip(whole) {
                inner[v as usize] = w;
            }
        }
        let shut = (0..open.vertex_count()).find(|&v| !open.on_boundary[v] && map.curvature[inner[v] as usize] != 0.0);
        if let Some(v) = shut {
            let curvature = map.curvature[inner[v] as usize];
            return Err(FlattenError::ClosedCone { vertex: open.origin[v], curvature });
        }
        let log_factor: Vec<f64> = inner.iter().map(|&v| map.log_factor[v as usize]).collect();
        let exterior = self.exterior_angles_in(open, &log_factor);
        let corners: Vec<(u32, f64)> = open.loops[0].iter().map(|&(_, v)| (v, exterior[v as usize])).collect();
        let mut of_edge: Vec<(crate::mesh::HalfedgeId, f64)> =
            self.chart.boundary_edges().map(|it| it.0).zip(map.lengths.iter().copied()).collect();
        of_edge.sort_unstable_by_key(|it| it.0);
        let n = corners.len();
        let path = &open.loops[0];
        let lengths: Vec<f64> = (0..n)
            .map(|i| match of_edge.binary_search_by_key(&path[i].0, |it| it.0) {
                Ok(k) => of_edge[k].1,
                Err(_) => {
                    let [a, b] = [path[i].1, path[(i + 1) % n].1].map(|v| log_factor[v as usize]);
                    self.metric.length[path[i].0] * (0.5 * (a + b)).exp()
                }
            })
            .collect();
        let mut uv = self.closed_curve(open, &corners, &lengths, &Self::mates(open, &inner))?;
        self.extend_opened(open, &inner, &mut uv);
        Ok(uv)
    }

    /// A number per edge of the only loop of `open`, the same for the two sides of a slit.
    fn mates(open: &Chart, inner: &[u32]) -> Vec<usize> {
        let path = &open.loops[0];
        let n = path.len();
        let ends = |i: usize| {
            let [a, b] = [path[i].1, path[(i + 1) % n].1].map(|v| inner[v as usize]);
            (a.min(b), a.max(b))
        };
        let mut order: Vec<usize> = (0..n).collect();
        order.sort_by_key(|&i| (ends(i), i));
        let mut out: Vec<usize> = (0..n).collect();
        for pair in order.windows(2) {
            if ends(pair[0]) == ends(pair[1]) {
                out[pair[1]] = out[pair[0]];
            }
        }
        out
    }

    /// Θ per local vertex.
    fn curvature(&self, cones: &[Cone]) -> Vec<f64> {
        let mut out = vec![0.0; self.chart.vertex_count()];
        for cone in cones.iter().filter(|it| !self.chart.on_boundary[it.vertex as usize]) {
            out[cone.vertex as usize] += cone.curvature;
        }
        out
    }

    fn conformal(&self, boundary: &[f64], curvature: Vec<f64>, lengths: Vec<f64>) -> Conformal {
        let log_factor = self.fill(boundary, &curvature);
        let exterior = self.exterior_angles_of(&log_factor);
        Conformal { log_factor, exterior, lengths, curvature }
    }

    /// u everywhere: A_II u_I = Θ − K − A_IB u_B.
    fn fill(&self, boundary: &[f64], curvature: &[f64]) -> Vec<f64> {
        let mut right: Vec<f64> = self
            .interior
            .iter()
            .map(|&v| curvature[v as usize] - (std::f64::consts::TAU - self.angle_sum[v as usize]))
            .collect();
        self.pull(boundary, &mut right);
        self.factor.solve_in_place(&mut right);
        let mut out: Vec<f64> =
            (0..self.chart.vertex_count()).map(|v| if self.chart.on_boundary[v] { boundary[v] } else { 0.0 }).collect();
        for (&v, u) in self.interior.iter().zip(right) {
            out[v as usize] = u;
        }
        out
    }

    /// Subtracts A_IB x_B from `right`.
    fn pull(&self, boundary: &[f64], right: &mut [f64]) {
        for (h, i, j) in self.chart.halfedges() {
            for (from, to) in [(i, j), (j, i)] {
                let row = self.row[to as usize];
                if row != NONE && self.row[from as usize] == NONE {
                    right[row as usize] += self.weight(h) * boundary[from as usize];
                }
            }
        }
    }

    /// S x on the boundary: the flux of the harmonic extension of x.
    fn boundary_flux(&self, x: &[f64]) -> Vec<f64> {
        let mut inner = vec![0.0; self.interior.len()];
        self.pull(x, &mut inner);
        self.factor.solve_in_place(&mut inner);
        let mut all = x.to_vec();
        for (&v, value) in self.interior.iter().zip(inner) {
            all[v as usize] = value;
        }
        let mut out = vec![0.0; x.len()];
        self.add_flux(self.chart, &all, &mut out);
        out
    }

    /// S x = right on the boundary with Σ x = 0, by conjugate gradients.
    fn conjugate_gradients(&self, right: &[f64]) -> Vec<f64> {
        let on_boundary = &self.chart.on_boundary;
        let count = on_boundary.iter().filter(|it| **it).count();
        // S maps constants to 0, so all that moves is kept free of them.
        let centred = |mut x: Vec<f64>| {
            let mean = x.iter().sum::<f64>() / count as f64;
            x.iter_mut().zip(on_boundary).for_each(|(x, rim)| *x = if *rim { *x - mean } else { 0.0 });
            x
        };
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let mut x = vec![0.0; right.len()];
        let mut residual = centred(right.to_vec());
        let mut direction = residual.clone();
        let mut square = dot(&residual, &residual);
        let enough = RESIDUAL * RESIDUAL * square;
        for _ in 0..STEPS * count {
            if square <= enough {
                break;
            }
            let image = self.boundary_flux(&direction);
            let step = square / dot(&direction, &image);
            for v in 0..x.len() {
                x[v] += step * direction[v];
                residual[v] -= step * image[v];
            }
            residual = centred(residual);
            let next = dot(&residual, &residual);
            for v in 0..x.len() {
                direction[v] = residual[v] + next / square * direction[v];
            }
            square = next;
        }
        centred(x)
    }

    /// The closed curve with the given corners (local vertex, exterior angle) that changes the lengths least in the sense
    /// of Σ (l̃ − l)² / l (section 5.3); edges of one group have one length. 0 at vertices off the curve.
    pub(super) fn closed_curve(
        &self,
        chart: &Chart,
        corners: &[(u32, f64)],
        lengths: &[f64],
        groups: &[usize],
    ) -> Result<Vec<Vec2>, FlattenError> {
        let mut angle = 0.0;
        let tangents: Vec<Vec2> = corners
            .iter()
            .map(|&(_, exterior)| {
                angle += exterior;
                Vec2::new(f64::cos(angle), f64::sin(angle))
            })
            .collect();
        // l̃ = l (1 − t·λ), t the mean tangent of a group, λ = (Σ l t tᵀ m)⁻¹ Σ l t m, m the members.
        let mut mean = vec![(Vec2::zeros(), 0.0); tangents.len()];
        for (t, &group) in tangents.iter().zip(groups) {
            mean[group].0 += t;
            mean[group].1 += 1.0;
        }
        let mean: Vec<Vec2> = groups.iter().map(|&group| mean[group].0 / mean[group].1).collect();
        let mut gap = Vec2::zeros();
        let mut gram = nalgebra::Matrix2::zeros();
        for (t, &l) in mean.iter().zip(lengths) {
            gap += t * l;
            gram += t * t.transpose() * l;
        }
        let correction = gram.try_inverse().map_or(Vec2::zeros(), |inverse| inverse * gap);
        let mut uv = vec![Vec2::zeros(); chart.vertex_count()];
        let mut at = Vec2::zeros();
        for (k, &(v, _)) in corners.iter().enumerate() {
            uv[v as usize] = at;
            let share = 1.0 - mean[k].dot(&correction);
            if !(share > 0.0) {
                return Err(FlattenError::NoCurve { vertex: chart.origin[v as usize], share });
            }
            at += tangents[k] * (lengths[k] * share);
        }
        Ok(uv)
    }

    /// Extends the boundary values of `open` harmonically with the factor of the whole chart: the vertices on slits, which
    /// are interior to it, are held at 0 by a Schur complement, and their copies pull on their neighbours instead.
    fn extend_opened(&self, open: &Chart, inner: &[u32], uv: &mut [Vec2]) {
        let n = self.interior.len();
        let mut held: Vec<u32> = (0..open.vertex_count())
            .filter(|&v| open.on_boundary[v])
            .map(|v| self.row[inner[v] as usize])
            .filter(|&row| row != NONE)
            .collect();
        held.sort_unstable();
        held.dedup();
        // Both coordinates, then a unit force on every held vertex.
        let mut columns = vec![0.0; (2 + held.len()) * n];
        for (h, i, j) in open.halfedges() {
            for (from, to) in [(i, j), (j, i)] {
                if !open.on_boundary[to as usize] && open.on_boundary[from as usize] {
                    let row = self.row[inner[to as usize] as usize] as usize;
                    columns[row] += self.weight(h) * uv[from as usize].x;
                    columns[n + row] += self.weight(h) * uv[from as usize].y;
                }
            }
        }
        for (k, &row) in held.iter().enumerate() {
            columns[(2 + k) * n + row as usize] = 1.0;
        }
        self.factor.solve_in_place(&mut columns);
        let (values, responses) = columns.split_at_mut(2 * n);
        let entries: Vec<(u32, u32, f64)> = (0..held.len())
            .flat_map(|k| (0..=k).map(move |l| (k, l)))
            .map(|(k, l)| (k as u32, l as u32, responses[k * n + held[l] as usize]))
            .collect();
        // A principal block of the inverse of a positive definite matrix is positive definite.
        let block = Cholesky::new(&SymmetricMatrix::from_triplets(held.len(), &entries));
        if let Ok(block) = block {
            for column in values.chunks_exact_mut(n.max(1)) {
                let mut forces: Vec<f64> = held.iter().map(|&row| column[row as usize]).collect();
                block.solve_in_place(&mut forces);
                for (response, force) in responses.chunks_exact(n.max(1)).zip(forces) {
                    column.iter_mut().zip(response).for_each(|(x, r)| *x -= force * r);
                }
            }
        }
        for v in (0..open.vertex_count()).filter(|&v| !open.on_boundary[v]) {
            let row = self.row[inner[v] as usize] as usize;
            uv[v] = Vec2::new(values[row], values[n + row]);
        }
    }
}

#[cfg(test)]
mod tests;
