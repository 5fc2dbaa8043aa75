//! The system of one SQP step: pattern and slots laid out once, filled for every step.
//!
//! Straight stars make the Jacobian of the angles singular: on a flat net it does not see z at all, and has more rows than rank.
//! The step is therefore that of the stabilised SQP (Wright 1998, "Superlinear convergence of a stabilized SQP method to a
//! degenerate solution"): [H Jᵀ; J −δ] (d, λ⁺) = (−∇f, −c − δ λ). It is regular for every J, needs no random shift, and near a solution
//! it is as exact as Newton's.
use super::{
    net::Net,
    terms::{Angles, FoldPoint, SUPPORT, constraints_of},
};
use crate::{
    geom::Vec3,
    numeric::{
        quasidefinite::QuasiDefinite,
        sparse::{SparseError, SymmetricMatrix},
    },
};

/// 3 × 3 blocks of the Hessian, one for each pair of vertices, and slots of the Jacobian.
pub struct Kkt {
    /// The matrix of the step.
    pub matrix: SymmetricMatrix,
    solver: QuasiDefinite,
    variables: usize,
    constraints: usize,
    /// (u, v) with u ≥ v, ascending.
    pairs: Vec<(u32, u32)>,
    /// Slots of entry (p, q) of each block at 3 p + q.
    slots: Vec<[u32; 9]>,
    /// Slots of the Jacobian, three for each vertex of each constraint in turn.
    jacobian: Vec<u32>,
    /// First of them for each star.
    star_starts: Vec<usize>,
    edge_blocks: Vec<[u32; 3]>,
    fold_blocks: Vec<Vec<u32>>,
    constant: Vec<f64>,
}

impl Kkt {
    /// Lays out the system. `forms` are the linear forms whose squares the objective sums, with twice their weights.
    pub fn new(net: &Net, folds: &[FoldPoint], forms: &[(Vec<(u32, f64)>, Vec3)]) -> Result<Self, SparseError> {
        let key = |a: u32, b: u32| (a.max(b), a.min(b));
        let mut pairs: Vec<(u32, u32)> = (0..net.flat.len() as u32).map(|v| (v, v)).collect();
        pairs.extend(net.edges.iter().map(|it| key(it[0], it[1])));
        for (form, _) in forms {
            for (k, a) in form.iter().enumerate() {
                pairs.extend(form[..k].iter().map(|b| key(a.0, b.0)));
            }
        }
        for it in folds {
            for k in 0..SUPPORT {
                pairs.extend((0..k).map(|l| key(it.vertices[k], it.vertices[l])));
            }
        }
        pairs.sort_unstable();
        pairs.dedup();
        let variables = 3 * net.flat.len();
        let constraints: usize = net.stars.iter().map(constraints_of).sum();
        let mut entries = Vec::new();
        for &(u, v) in &pairs {
            entries.extend((0..9).map(|k| (3 * u + k / 3, 3 * v + k % 3)));
        }
        let (mut star_starts, mut row) = (Vec::new(), variables as u32);
        let first = entries.len();
        for star in &net.stars {
            star_starts.push(entries.len() - first);
            for _ in 0..constraints_of(star) {
                for v in std::iter::once(star.centre).chain(star.around.iter().copied()) {
                    entries.extend((0..3).map(|p| (row, 3 * v + p)));
                }
                row += 1;
            }
        }
        let (matrix, all) = SymmetricMatrix::with_pattern(variables + constraints, &entries);
        let slots: Vec<[u32; 9]> = all[..first].chunks_exact(9).map(|it| std::array::from_fn(|k| it[k])).collect();
        let block = |a: u32, b: u32| pairs.partition_point(|it| *it < key(a, b)) as u32;
        let mut out = Self {
            solver: QuasiDefinite::new(&matrix, variables)?,
            constant: vec![0.0; matrix.values().len()],
            matrix,
            variables,
            constraints,
            slots,
            jacobian: all[first..].to_vec(),
            star_starts,
            edge_blocks: net.edges.iter().map(|&[a, b]| [block(a, a), block(a, b), block(b, b)]).collect(),
            fold_blocks: folds
                .iter()
                .map(|it| {
                    (0..SUPPORT * SUPPORT).map(|k| block(it.vertices[k / SUPPORT], it.vertices[k % SUPPORT])).collect()
                })
                .collect(),
            pairs,
        };
        out.set_forms(forms);
        Ok(out)
    }

    /// Sets the constant part, Σ w fᵀ f over the linear forms f, w apart for each axis. The forms must be those of the layout or
    /// fewer.
    pub fn set_forms(&mut self, forms: &[(Vec<(u32, f64)>, Vec3)]) {
        self.constant.fill(0.0);
        for (form, weight) in forms {
            for (k, a) in form.iter().enumerate() {
                for (l, b) in form[..=k].iter().enumerate() {
                    let key = (a.0.max(b.0), a.0.min(b.0));
                    let block = self.pairs.partition_point(|it| *it < key);
                    // A vertex that stands twice in a form meets itself in both orders.
                    let both = if a.0 == b.0 && l < k { 2.0 } else { 1.0 };
                    for axis in 0..3 {
                        self.constant[self.slots[block][4 * axis] as usize] += both * weight[axis] * a.1 * b.1;
                    }
                }
            }
        }
    }

    /// Number of constraints.
    pub fn constraints(&self) -> usize {
        self.constraints
    }

    /// Number of values of the factor.
    pub fn entries(&self) -> usize {
        self.solver.entries()
    }

    /// Starts the matrix of a step from its constant part, `damping` on the Hessian and −δ on the constraints.
    pub fn begin(&mut self, damping: f64, delta: f64) {
        self.matrix.values_mut().copy_from_slice(&self.constant);
        for i in 0..self.variables {
            self.matrix.add_to_diagonal(i, damping);
        }
        for i in self.variables..self.variables + self.constraints {
            self.matrix.add_to_diagonal(i, -delta);
        }
    }

    /// Adds weight · r rᵀ for edge number `edge`, r = (e, −e).
    pub fn add_edge(&mut self, edge: usize, e: Vec3, weight: f64) {
        let outer = e * e.transpose() * weight;
        let [aa, ab, bb] = self.edge_blocks[edge].map(|it| self.slots[it as usize]);
        let values = self.matrix.values_mut();
        for p in 0..3 {
            for q in 0..3 {
                if p >= q {
                    values[aa[3 * p + q] as usize] += outer[(p, q)];
                    values[bb[3 * p + q] as usize] += outer[(p, q)];
                }
                values[ab[3 * p + q] as usize] -= outer[(p, q)];
            }
        }
    }

    /// Adds weight · r rᵀ for fold point number `fold`, r given for each of its vertices.
    pub fn add_fold(&mut self, vertices: &[u32; SUPPORT], fold: usize, r: &[Vec3; SUPPORT], weight: f64) {
        let values = self.matrix.values_mut();
        for k in 0..SUPPORT {
            for l in 0..SUPPORT {
                // Every ordered pair once, in the lower triangle.
                let (u, v) = (vertices[k], vertices[l]);
                if u < v {
                    continue;
                }
                let slots = &self.slots[self.fold_blocks[fold][k * SUPPORT + l] as usize];
                for p in 0..3 {
                    let a = weight * r[k][p];
                    for q in 0..if u == v { p + 1 } else { 3 } {
                        values[slots[3 * p + q] as usize] += a * r[l][q];
                    }
                }
            }
        }
    }

    /// Writes the Jacobian of star number `star`.
    pub fn set_star(&mut self, star: usize, angles: &Angles, neighbours: usize) {
        let mut at = self.star_starts[star];
        let values = self.matrix.values_mut();
        for gradient in &angles.gradients[..angles.count] {
            for g in &gradient[..=neighbours] {
                for p in 0..3 {
                    values[self.jacobian[at] as usize] += g[p];
                    at += 1;
                }
            }
        }
    }

    /// Factors and solves for the step and the new multipliers; the residual of the system comes third.
    pub fn solve(&mut self, right: &[f64], rounds: usize) -> Result<(Vec<f64>, Vec<f64>, f64), SparseError> {
        self.solver.factor(&self.matrix)?;
        let (mut d, residual) = self.solver.solve(&self.matrix, right, rounds);
        let multipliers = d.split_off(self.variables);
        Ok((d, multipliers, residual))
    }
}
