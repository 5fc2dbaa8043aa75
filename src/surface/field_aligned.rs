//! A scalar field whose gradient follows a vector field, with singularities exactly where they are asked for: Noma and
//! Kawahara's field-aligned parameterisation (seed 001), in a well-posed form.
//!
//! Given a 1-form ω per edge, integers k per node (face, or cap of a boundary loop) and periods h per generator,
//!
//! ```text
//! minimise (u − ω)ᵀ W (u − ω)   subject to   D1 u = 2π k,   H u = 2π h
//! ```
//!
//! has a solution iff k sums to 0 in every component. Every feasible u is d0 α + 2π n with one integer 1-form n
//! ([`TreeCotree::integer_form`]), so the constraints hold exactly and what is left is
//!
//! ```text
//! L α = d0ᵀ W (ω − 2π n),   L = d0ᵀ W d0
//! ```
//!
//! with the cotangent Laplacian L, which is positive semidefinite whatever the signs of the weights W. One vertex of every
//! component is pinned. The seed's eq. 19 inverts AᵀA of a matrix whose rows are never independent, and |Wx|² weighs edges by
//! w²; both are replaced. α is no longer taken modulo 2π: with n it tells the field also where an edge spans more than
//! half a turn.
use std::f64::consts::TAU;

use super::{
    intrinsic_delaunay::IntrinsicDelaunay,
    tangent::cotangent_weights,
    tree_cotree::{IndexError, Node, TreeCotree},
};
use crate::{
    mesh::{EdgeId, Field, Id, TriMesh, VertexId},
    numeric::{
        dissection::nested_dissection,
        sparse::{Analysis, Cholesky, SparseError, SymmetricMatrix},
    },
};

const NONE: u32 = u32::MAX;
/// Up to so many unknowns minimum degree costs less than nested dissection and leaves less fill.
const DISSECT_FROM: usize = 2_000;

/// Up to so many free windings (a genus of 50) are improved beyond rounding, at one back-substitution each.
const MOST_PERIODS: usize = 100;

/// Why there is no parameterisation.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum AlignError {
    /// The integers are not possible.
    #[error(transparent)]
    Index(#[from] IndexError),
    /// Two singularities do not cancel each other.
    #[error("the singularities in {first} ({first_index}) and {second} ({second_index}) do not cancel: {} is missing", -(first_index + second_index))]
    NoPair {
        /// One of them.
        first: Node,
        /// Its index.
        first_index: i32,
        /// The other.
        second: Node,
        /// Its index.
        second_index: i32,
    },
    /// Two nodes lie on different components.
    #[error("{from} and {to} lie on different components, so no index can move from one to the other")]
    Apart {
        /// From where.
        from: Node,
        /// To where.
        to: Node,
    },
    /// The Laplacian cannot be factored.
    #[error(
        "the Laplacian cannot be factored ({source}): the mesh is nearly degenerate around vertex {vertex}; remesh it, or take intrinsic Delaunay weights"
    )]
    Factor {
        /// The vertex at whose elimination it showed.
        vertex: VertexId,
        /// Why.
        source: SparseError,
    },
}

/// Integers to prescribe; what is not named is 0 for a face and the rounded period of ω for a loop or a generator.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Indices {
    /// Index per face or loop: how many lines begin there (end, where negative). A node may come more than once.
    pub nodes: Vec<(Node, i32)>,
    /// Windings around generators.
    pub generators: Vec<(usize, i32)>,
}

/// The factored Laplacian of a mesh with its trees: everything that does not depend on the field and the indices.
#[derive(Debug, Clone)]
pub struct Parameterizer {
    /// The trees.
    pub tree: TreeCotree,
    /// The triangulation of which `ends` and `weight` are, where it is not the mesh.
    delaunay: Option<IntrinsicDelaunay>,
    ends: Vec<[u32; 2]>,
    weight: Vec<f64>,
    /// Unknown of each vertex, `NONE` for pinned ones.
    unknown: Vec<u32>,
    factor: Cholesky,
}

/// The Laplacian of `weight` over edges between `ends` without the pinned vertices, factored, and the unknown of every vertex.
pub(super) fn factor_laplacian(
    ends: &[[u32; 2]],
    weight: &[f64],
    pinned: &[VertexId],
    positions: &Field<VertexId, crate::geom::Vec3>,
) -> Result<(Cholesky, Vec<u32>), AlignError> {
    let mut unknown = vec![0_u32; positions.len()];
    pinned.iter().for_each(|v| unknown[v.index()] = NONE);
    let mut count = 0;
    for it in unknown.iter_mut().filter(|it| **it != NONE) {
        *it = count;
        count += 1;
    }
    let inner = |e: &[u32; 2]| {
        let [a, b] = e.map(|v| unknown[v as usize]);
        (a != NONE && b != NONE && a != b).then_some((a, b))
    };
    let pairs: Vec<(u32, u32)> = ends.iter().filter_map(inner).collect();
    let (mut matrix, slots) = SymmetricMatrix::with_pattern(count as usize, &pairs);
    let mut slots = slots.into_iter();
    for (e, &w) in ends.iter().zip(weight) {
        // An edge from a vertex to itself, as intrinsic triangulations may have, has no difference.
        for v in e.map(|v| unknown[v as usize]).into_iter().filter(|&it| it != NONE && e[0] != e[1]) {
            matrix.add_to_diagonal(v as usize, w);
        }
        if inner(e).is_some()
            && let Some(slot) = slots.next()
        {
            matrix.values_mut()[slot as usize] -= w;
        }
    }
    let factor = if (count as usize) < DISSECT_FROM {
        Cholesky::new(&matrix)
    } else {
        let places =
            positions.enumerate().filter(|it| unknown[it.0.index()] != NONE).map(|it| [it.1.x, it.1.y, it.1.z]);
        let order = nested_dissection(&matrix, 1, &places.collect::<Vec<_>>());
        Analysis::with_ordering(&matrix, &order).and_then(|it| it.factor(&matrix))
    };
    let factor = factor.map_err(|source| {
        let bad = match source {
            SparseError::NotPositiveDefinite { index } | SparseError::NotFinite { row: index, .. } => index as u32,
            SparseError::TooLarge { .. } => 0,
        };
        let vertex = unknown.iter().position(|&it| it == bad).unwrap_or(0);
        AlignError::Factor { vertex: VertexId::new(vertex), source }
    })?;
    Ok((factor, unknown))
}

impl Parameterizer {
    /// Builds the trees and factors the cotangent Laplacian.
    pub fn new(mesh: &TriMesh) -> Result<Self, AlignError> {
        Self::with_weights(mesh, cotangent_weights(mesh))
    }

    /// The same with other weights, of which the Laplacian must be positive semidefinite with the constants as its kernel.
    pub fn with_weights(mesh: &TriMesh, weight: Field<EdgeId, f64>) -> Result<Self, AlignError> {
        let tree = TreeCotree::new(mesh);
        let ends: Vec<[u32; 2]> = mesh.edges().map(|e| mesh.edge_vertices(e).map(|v| v.0)).collect();
        let weight = weight.into_vec();
        let (factor, unknown) = factor_laplacian(&ends, &weight, &tree.roots, mesh.positions())?;
        Ok(Self { tree, delaunay: None, ends, weight, unknown, factor })
    }

    /// The same with the weights of the intrinsic Delaunay triangulation, none of which is negative, for meshes with
    /// slivers. The indices stay in the faces of the mesh; ω and n are carried over to its edges.
    pub fn with_intrinsic_delaunay(mesh: &TriMesh) -> Result<Self, AlignError> {
        let tree = TreeCotree::new(mesh);
        let mut delaunay = IntrinsicDelaunay::new(mesh);
        let (ends, weight) = (std::mem::take(&mut delaunay.ends), std::mem::take(&mut delaunay.weight));
        let (factor, unknown) = factor_laplacian(&ends, &weight, &tree.roots, mesh.positions())?;
        Ok(Self { tree, delaunay: Some(delaunay), ends, weight, unknown, factor })
    }

    /// ω − 2π n on the edges that carry the weights.
    fn target(&self, omega: &Field<EdgeId, f64>, n: &Field<EdgeId, i32>) -> Vec<f64> {
        let target = |(omega, n): (&f64, &i32)| omega - TAU * f64::from(*n);
        match &self.delaunay {
            None => omega.iter().zip(n.iter()).map(target).collect(),
            Some(it) => it.real(omega).iter().zip(&it.integer(n)).map(target).collect(),
        }
    }

    /// The best parameterisation along `omega` with the given integers. A boundary loop that is not named takes the rounded
    /// period of ω; if then the sum of a component is not 0, the loops not named share the difference, those first whose
    /// period changes least.
    pub fn solve(
        &self,
        mesh: &TriMesh,
        omega: Field<EdgeId, f64>,
        indices: &Indices,
    ) -> Result<Parameterization<'_>, AlignError> {
        let (nodes, periods) = self.integers(mesh, &omega, indices)?;
        let n = self.tree.integer_form(&nodes, &periods);
        let mut out = Parameterization {
            solver: self,
            rhs: Vec::new(),
            alpha: Field::filled(self.unknown.len(), 0.0),
            omega,
            nodes,
            periods,
            n,
        };
        out.gather();
        out.back_substitute();
        let named = |g: &usize| indices.generators.iter().any(|it| it.0 == *g);
        let free: Vec<usize> = (0..out.periods.len()).filter(|g| !named(g)).collect();
        if (1..=MOST_PERIODS).contains(&free.len()) {
            out.improve_periods(&free);
        }
        Ok(out)
    }

    /// Index per node and winding per generator.
    fn integers(
        &self,
        mesh: &TriMesh,
        omega: &Field<EdgeId, f64>,
        indices: &Indices,
    ) -> Result<(Vec<i32>, Vec<i32>), AlignError> {
        let tree = &self.tree;
        let mut nodes = vec![0; tree.node_count()];
        let mut named = vec![false; tree.node_count()];
        for &(node, k) in &indices.nodes {
            let at = tree.index(node)?;
            nodes[at] += k;
            named[at] = true;
        }
        let faces = mesh.face_count();
        let turns: Vec<f64> = tree
            .loops
            .iter()
            .map(|path| {
                let along = |&h: &crate::mesh::HalfedgeId| {
                    let e = mesh.edge(h);
                    if mesh.halfedge(e) == h { omega[e] } else { -omega[e] }
                };
                -path.iter().map(along).sum::<f64>() / TAU
            })
            .collect();
        let free: Vec<usize> = (0..tree.loops.len()).filter(|&k| !named[faces + k]).collect();
        free.iter().for_each(|&k| nodes[faces + k] = turns[k].round() as i32);
        // What a component lacks goes, one by one, to the free loop that minds it least.
        let mut lack: Vec<i64> = vec![0; tree.roots.len()];
        nodes.iter().enumerate().for_each(|(at, &k)| lack[tree.component(at)] -= i64::from(k));
        for component in 0..lack.len() {
            while lack[component] != 0 {
                let step = lack[component].signum() as i32;
                let cost = |k: usize| {
                    let miss = f64::from(nodes[faces + k]) - turns[k];
                    (miss + f64::from(step)).powi(2) - miss * miss
                };
                let own = free.iter().copied().filter(|&k| tree.component(faces + k) == component);
                let Some(k) = own.min_by(|&a, &b| cost(a).total_cmp(&cost(b)).then(a.cmp(&b))) else { break };
                nodes[faces + k] += step;
                lack[component] -= i64::from(step);
            }
        }
        tree.check_sums(&nodes, |_| 0)?;
        let mut periods: Vec<i32> = tree.periods(mesh, omega).iter().map(|it| (it / TAU).round() as i32).collect();
        let count = periods.len();
        for &(generator, h) in &indices.generators {
            *periods.get_mut(generator).ok_or(IndexError::NoSuchGenerator { generator, count })? = h;
        }
        Ok((nodes, periods))
    }
}

/// A parameterisation that can be edited: every edit keeps the factor and costs one back-substitution.
#[derive(Debug, Clone)]
pub struct Parameterization<'a> {
    solver: &'a Parameterizer,
    omega: Field<EdgeId, f64>,
    nodes: Vec<i32>,
    periods: Vec<i32>,
    /// d0ᵀ W (ω − 2π n) per vertex.
    rhs: Vec<f64>,
    /// α per vertex, radians; 0 at the first vertex of each component.
    pub alpha: Field<VertexId, f64>,
    /// n per edge.
    pub n: Field<EdgeId, i32>,
}

impl<'a> Parameterization<'a> {
    /// What it was solved with.
    pub fn solver(&self) -> &'a Parameterizer {
        self.solver
    }

    /// The 1-form along which it was solved.
    pub fn omega(&self) -> &Field<EdgeId, f64> {
        &self.omega
    }

    /// Index per node, faces first.
    pub fn nodes(&self) -> &[i32] {
        &self.nodes
    }

    /// Windings around the generators.
    pub fn generators(&self) -> &[i32] {
        &self.periods
    }

    /// u = d0 α + 2π n of an edge, radians.
    pub fn difference(&self, mesh: &TriMesh, e: EdgeId) -> f64 {
        let [a, b] = mesh.edge_vertices(e);
        self.alpha[b] - self.alpha[a] + TAU * f64::from(self.n[e])
    }

    /// u on all edges.
    pub fn differences(&self, mesh: &TriMesh) -> Field<EdgeId, f64> {
        Field::from_fn(self.n.len(), |e| self.difference(mesh, e))
    }

    /// W (u − ω) and u − ω on the edges that carry the weights.
    fn flows(&self) -> Vec<[f64; 2]> {
        let alpha = self.alpha.as_slice();
        let target = self.solver.target(&self.omega, &self.n);
        let flow = |(k, target): (usize, &f64)| {
            let [a, b] = self.solver.ends[k].map(|v| alpha[v as usize]);
            let miss = b - a - target;
            [self.solver.weight[k] * miss, miss]
        };
        target.iter().enumerate().map(flow).collect()
    }

    /// (u − ω)ᵀ W (u − ω).
    pub fn energy(&self) -> f64 {
        self.flows().iter().map(|it| it[0] * it[1]).sum()
    }

    /// The share of the edges of positive weight in the energy. Where weights of obtuse angles are negative, other integers
    /// can lower the energy without end; this they raise.
    pub fn misfit(&self) -> f64 {
        self.flows().iter().map(|it| (it[0] * it[1]).max(0.0)).sum()
    }

    /// Largest |d0ᵀ W (u − ω)|: 0 at the optimum.
    pub fn residual(&self) -> f64 {
        let mut sums = vec![0.0; self.alpha.len()];
        for (&[a, b], [flow, _]) in self.solver.ends.iter().zip(self.flows()) {
            sums[a as usize] -= flow;
            sums[b as usize] += flow;
        }
        sums.into_iter().map(f64::abs).fold(0.0, f64::max)
    }

    /// W (u − ω) on the edges of the mesh: half the derivative of the energy by 2π n.
    fn slope(&self) -> Field<EdgeId, f64> {
        let flows = self.flows().into_iter().map(|it| it[0]).collect();
        match &self.solver.delaunay {
            None => Field::from_vec(flows),
            Some(it) => it.pull_back(flows),
        }
    }

    /// Half the derivative of the energy by 2π times each index, up to a constant per component: W (u − ω) summed along the
    /// cotree. The pair +1 at its least, −1 at its largest node lowers the energy most to first order.
    pub fn potential(&self) -> Vec<f64> {
        self.solver.tree.potential(&self.slope())
    }

    /// Moves `amount` of the index of `from` to `to`: with the whole index of a singularity it moves there; from a node of
    /// index 0 with amount 1 a pair is born, +1 at `to`.
    pub fn transfer(&mut self, from: Node, to: Node, amount: i32) -> Result<(), AlignError> {
        let tree = &self.solver.tree;
        let (a, b) = (tree.index(from)?, tree.index(to)?);
        if tree.component(a) != tree.component(b) {
            return Err(AlignError::Apart { from, to });
        }
        let path = tree.transfer(a, b, amount);
        self.nodes[a] -= amount;
        self.nodes[b] += amount;
        for (e, change) in path {
            self.change(e, change);
        }
        self.changed();
        Ok(())
    }

    /// Moves the whole singularity of a node to another.
    pub fn move_singularity(&mut self, from: Node, to: Node) -> Result<(), AlignError> {
        let index = self.nodes[self.solver.tree.index(from)?];
        self.transfer(from, to, index)
    }

    /// Adds a line that begins in `start` and one that ends in `end`.
    pub fn add_pair(&mut self, start: Node, end: Node) -> Result<(), AlignError> {
        self.transfer(end, start, 1)
    }

    /// Removes two singularities of opposite index.
    pub fn annihilate(&mut self, first: Node, second: Node) -> Result<(), AlignError> {
        let index = |node| self.solver.tree.index(node).map(|it| self.nodes[it]);
        let (first_index, second_index) = (index(first)?, index(second)?);
        if first_index + second_index != 0 || first_index == 0 {
            return Err(AlignError::NoPair { first, first_index, second, second_index });
        }
        self.transfer(first, second, first_index)
    }

    /// Sets the index of a node alone, which only works when it has that index already: otherwise says what is missing.
    /// Give the partner to [`Parameterization::transfer`] instead.
    pub fn set_index(&mut self, node: Node, index: i32) -> Result<(), AlignError> {
        let at = self.solver.tree.index(node)?;
        let mut nodes = self.nodes.clone();
        nodes[at] = index;
        Ok(self.solver.tree.check_sums(&nodes, |_| 0)?)
    }

    /// Sets the winding around a generator.
    pub fn set_generator(&mut self, generator: usize, winding: i32) -> Result<(), AlignError> {
        let count = self.periods.len();
        let before = self.periods.get_mut(generator).ok_or(IndexError::NoSuchGenerator { generator, count })?;
        // The change is the integer form with no index and this one period.
        let change = winding - std::mem::replace(before, winding);
        let mut periods = vec![0; count];
        periods[generator] = change;
        let form = self.solver.tree.integer_form(&vec![0; self.nodes.len()], &periods);
        for (e, &change) in form.enumerate().filter(|it| *it.1 != 0) {
            self.change(e, change);
        }
        self.changed();
        Ok(())
    }

    /// Follows another 1-form with the same integers: another field, or another frequency.
    pub fn set_field(&mut self, omega: Field<EdgeId, f64>) {
        self.omega = omega;
        self.gather();
        self.back_substitute();
    }

    /// Lowers the energy by other windings of the `free` generators. The energy is quadratic in them, E + δᵀ Q δ − 2 bᵀ δ: from
    /// the rounded periods, and from the rounded real optimum, one winding after the other takes its best integer, and the
    /// better end is taken. (The best of all is a closest-vector problem.)
    fn improve_periods(&mut self, free: &[usize]) {
        let tree = &self.solver.tree;
        let forms: Vec<Vec<(EdgeId, f64)>> = free
            .iter()
            .map(|&g| {
                let mut periods = vec![0; self.periods.len()];
                periods[g] = 1;
                let form = tree.integer_form(&vec![0; self.nodes.len()], &periods);
                form.enumerate().filter(|it| *it.1 != 0).map(|(e, &n)| (e, TAU * f64::from(n))).collect()
            })
            .collect();
        let count = free.len();
        let mut q = nalgebra::DMatrix::zeros(count, count);
        for (k, form) in forms.iter().enumerate() {
            // The harmonic form of one winding more.
            let mut unit = self.clone();
            unit.omega.as_mut_slice().fill(0.0);
            unit.n.as_mut_slice().fill(0);
            for &(e, turn) in form {
                unit.n[e] += (turn / TAU).round() as i32;
            }
            unit.gather();
            unit.back_substitute();
            let slope = unit.slope();
            for (i, form) in forms.iter().enumerate() {
                q[(i, k)] = form.iter().map(|&(e, turn)| turn * slope[e]).sum::<f64>();
            }
        }
        let slope = self.slope();
        let miss = |&(e, turn): &(EdgeId, f64)| -turn * slope[e];
        let b = nalgebra::DVector::from_iterator(count, forms.iter().map(|form| form.iter().map(miss).sum::<f64>()));
        let real = q.clone().cholesky().map_or_else(|| b.scale(0.0), |it| it.solve(&b)).map(f64::round);
        let mut best = (0.0, b.scale(0.0));
        for start in [b.scale(0.0), real] {
            let mut step = start;
            for _ in 0..10 * count {
                let slope = &b - &q * &step;
                let move_of = |i: usize| (slope[i] / q[(i, i)]).round();
                let gain = |i: usize| move_of(i) * (2.0 * slope[i] - q[(i, i)] * move_of(i));
                let Some(i) = (0..count).max_by(|&i, &j| gain(i).total_cmp(&gain(j)).then(j.cmp(&i))) else { break };
                if !(gain(i) > 0.0) {
                    break;
                }
                step[i] += move_of(i);
            }
            let energy = (&q * &step - 2.0 * &b).dot(&step);
            if energy < best.0 {
                best = (energy, step);
            }
        }
        for (k, &g) in free.iter().enumerate().filter(|it| best.1[it.0] != 0.0) {
            let steps = best.1[k] as i32;
            self.periods[g] += steps;
            for &(e, turn) in &forms[k] {
                self.change(e, steps * (turn / TAU).round() as i32);
            }
        }
        if best.0 < 0.0 {
            self.changed();
        }
    }

    fn change(&mut self, e: EdgeId, change: i32) {
        self.n[e] += change;
        if self.solver.delaunay.is_some() {
            return;
        }
        let flow = self.solver.weight[e.index()] * TAU * f64::from(change);
        let [a, b] = self.solver.ends[e.index()];
        self.rhs[a as usize] += flow;
        self.rhs[b as usize] -= flow;
    }

    /// Solves again; on another triangulation every change may have gone through all flips.
    fn changed(&mut self) {
        if self.solver.delaunay.is_some() {
            self.gather();
        }
        self.back_substitute();
    }

    /// The right-hand side from scratch.
    fn gather(&mut self) {
        self.rhs = vec![0.0; self.alpha.len()];
        let target = self.solver.target(&self.omega, &self.n);
        for (&[a, b], (target, weight)) in self.solver.ends.iter().zip(target.iter().zip(&self.solver.weight)) {
            let flow = weight * target;
            self.rhs[a as usize] -= flow;
            self.rhs[b as usize] += flow;
        }
    }

    fn back_substitute(&mut self) {
        let unknown = &self.solver.unknown;
        let free =
            |rhs: &[f64]| -> Vec<f64> { rhs.iter().zip(unknown).filter(|it| *it.1 != NONE).map(|it| *it.0).collect() };
        let mut x = free(&self.rhs);
        self.solver.factor.solve_in_place(&mut x);
        for (alpha, &k) in self.alpha.as_mut_slice().iter_mut().zip(unknown) {
            *alpha = if k == NONE { 0.0 } else { x[k as usize] };
        }
    }
}

#[cfg(test)]
mod tests;
