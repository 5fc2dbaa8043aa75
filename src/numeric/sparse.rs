//! Symmetric sparse matrices and their Cholesky factorisation: order and analyse once, factor for new values, solve for
//! many right-hand sides.
use std::{marker::PhantomData, sync::Arc};

use faer::{
    Side,
    perm::PermRef,
    sparse::{
        SymbolicSparseColMatRef,
        linalg::{
            SupernodalThreshold,
            cholesky::{CholeskySymbolicParams, SymbolicCholeskyRaw, SymmetricOrdering, factorize_symbolic_cholesky},
        },
    },
};

use super::multifrontal::Fronts;
pub use super::multifrontal::Scalar;

/// Why a matrix could not be factored. Rows and columns are those of the matrix as it was given.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SparseError {
    /// An entry is NaN or infinite.
    #[error("entry ({row}, {column}) of the matrix is not a finite number: {value}")]
    NotFinite {
        /// Its row.
        row: usize,
        /// Its column.
        column: usize,
        /// What it holds.
        value: f64,
    },
    /// The matrix is not positive definite, or so nearly singular that no digit of the answer would be right.
    #[error("the matrix is not positive definite: no positive pivot for unknown {index}")]
    NotPositiveDefinite {
        /// The unknown at whose elimination it showed.
        index: usize,
    },
    /// Too many entries for the index type or the memory.
    #[error("a factorisation with {unknowns} unknowns does not fit into memory")]
    TooLarge {
        /// Number of unknowns.
        unknowns: usize,
    },
}

/// A symmetric n × n matrix: its lower triangle (row ≥ column) in compressed columns, rows ascending, each entry once.
#[derive(Debug, Clone, PartialEq)]
pub struct SymmetricMatrix {
    starts: Vec<u32>,
    rows: Vec<u32>,
    values: Vec<f64>,
}

impl SymmetricMatrix {
    /// The zero matrix with room for the given entries and the whole diagonal, and for each given pair the index of its
    /// value in [`SymmetricMatrix::values_mut`]. (i, j) and (j, i) name the same entry, as do repeated pairs.
    /// Panics if an index is not below `n`.
    pub fn with_pattern(n: usize, pairs: &[(u32, u32)]) -> (Self, Vec<u32>) {
        let lower = |(i, j): (u32, u32)| (i.max(j), i.min(j));
        // Bucket by column, then sort each short column: the diagonal first, as item `pairs.len()` and above.
        let mut offsets = vec![1_u32; n + 1];
        offsets[n] = 0;
        for &pair in pairs {
            assert!((lower(pair).0 as usize) < n, "entry {pair:?} lies outside a {n} × {n} matrix");
            offsets[lower(pair).1 as usize] += 1;
        }
        let mut total = 0;
        for offset in &mut offsets {
            total += std::mem::replace(offset, total);
        }
        let mut items = vec![(0_u32, 0_u32); total as usize];
        let mut fill = offsets.clone();
        let diagonal = (0..n as u32).map(|i| (i, i));
        for (k, pair) in pairs.iter().copied().chain(diagonal).enumerate() {
            let (row, column) = lower(pair);
            items[fill[column as usize] as usize] = (row, k as u32);
            fill[column as usize] += 1;
        }
        let (mut starts, mut rows, mut slots) = (Vec::with_capacity(n + 1), Vec::new(), vec![0; pairs.len()]);
        starts.push(0);
        for column in offsets.windows(2) {
            let column = &mut items[column[0] as usize..column[1] as usize];
            column.sort_unstable();
            for run in column.chunk_by(|a, b| a.0 == b.0) {
                for &(_, k) in run {
                    if let Some(slot) = slots.get_mut(k as usize) {
                        *slot = rows.len() as u32;
                    }
                }
                rows.push(run[0].0);
            }
            starts.push(rows.len() as u32);
        }
        let values = vec![0.0; rows.len()];
        (Self { starts, rows, values }, slots)
    }

    /// Sums triplets (row, column, value) in the order given. (i, j) and (j, i) name the same entry: give an
    /// off-diagonal entry once, not twice. Panics if an index is not below `n`.
    pub fn from_triplets(n: usize, triplets: &[(u32, u32, f64)]) -> Self {
        let pairs: Vec<(u32, u32)> = triplets.iter().map(|t| (t.0, t.1)).collect();
        let (mut matrix, slots) = Self::with_pattern(n, &pairs);
        for (&slot, &(_, _, value)) in slots.iter().zip(triplets) {
            matrix.values[slot as usize] += value;
        }
        matrix
    }

    /// Number of rows.
    pub fn size(&self) -> usize {
        self.starts.len() - 1
    }

    /// Values of the stored entries.
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// Values of the stored entries, to be set or summed through the slots of [`SymmetricMatrix::with_pattern`].
    pub fn values_mut(&mut self) -> &mut [f64] {
        &mut self.values
    }

    /// Index of diagonal entry `i` in [`SymmetricMatrix::values_mut`].
    pub fn diagonal_slot(&self, i: u32) -> u32 {
        self.starts[i as usize]
    }

    /// The diagonal.
    pub fn diagonal(&self) -> Vec<f64> {
        self.starts[..self.size()].iter().map(|&start| self.values[start as usize]).collect()
    }

    /// Adds `value` to diagonal entry `i`.
    pub fn add_to_diagonal(&mut self, i: usize, value: f64) {
        self.values[self.starts[i] as usize] += value;
    }

    /// The stored entries (row, column, value), row ≥ column, column by column.
    pub fn entries(&self) -> impl Iterator<Item = (usize, usize, f64)> + '_ {
        self.starts.windows(2).enumerate().flat_map(move |(column, range)| {
            (range[0] as usize..range[1] as usize).map(move |k| (self.rows[k] as usize, column, self.values[k]))
        })
    }

    /// A x. Panics unless `x` has one value per column.
    pub fn multiply(&self, x: &[f64]) -> Vec<f64> {
        assert_eq!(x.len(), self.size(), "one value per column");
        let mut out = vec![0.0; x.len()];
        for (row, column, value) in self.entries() {
            out[row] += value * x[column];
            if row != column {
                out[column] += value * x[row];
            }
        }
        out
    }

    pub(super) fn pattern(&self) -> SymbolicSparseColMatRef<'_, u32> {
        let n = self.size();
        SymbolicSparseColMatRef::new_checked(n, n, &self.starts, None, &self.rows)
    }
}

/// Fill-reducing order and structure of the factor of every matrix with one pattern. The factor is kept in double
/// precision, or in single: half the bytes and half the time, for directions that need no more than a few digits.
#[derive(Debug, Clone)]
pub struct Analysis<T = f64> {
    fronts: Arc<Fronts>,
    scalar: PhantomData<T>,
}

impl Analysis {
    /// Orders (approximate minimum degree) and analyses the pattern of `matrix`.
    pub fn new(matrix: &SymmetricMatrix) -> Result<Self, SparseError> {
        Self::of(matrix)
    }

    /// Analyses the pattern of `matrix` for a given order of elimination: `order[k]` is the unknown eliminated as number
    /// k. Panics unless it is a permutation of the unknowns.
    pub fn with_ordering(matrix: &SymmetricMatrix, order: &[u32]) -> Result<Self, SparseError> {
        let mut inverse = vec![0; order.len()];
        for (k, &unknown) in order.iter().enumerate() {
            inverse[unknown as usize] = k as u32;
        }
        Self::analyse(matrix, SymmetricOrdering::Custom(PermRef::new_checked(order, &inverse, matrix.size())))
    }
}

impl<T: Scalar> Analysis<T> {
    /// As [`Analysis::new`], for a factor in the precision `T`.
    pub fn of(matrix: &SymmetricMatrix) -> Result<Self, SparseError> {
        Self::analyse(matrix, SymmetricOrdering::Amd)
    }

    fn analyse(matrix: &SymmetricMatrix, ordering: SymmetricOrdering<'_, u32>) -> Result<Self, SparseError> {
        let params = CholeskySymbolicParams {
            supernodal_flop_ratio_threshold: SupernodalThreshold::FORCE_SUPERNODAL,
            ..Default::default()
        };
        let too_large = SparseError::TooLarge { unknowns: matrix.size() };
        let symbolic = factorize_symbolic_cholesky(matrix.pattern(), Side::Lower, ordering, params)
            .map_err(|_| too_large.clone())?;
        let place = match symbolic.perm() {
            Some(it) => it.arrays().1.to_vec(),
            None => (0..matrix.size() as u32).collect(),
        };
        let nodes: Vec<(usize, &[u32])> = match symbolic.raw() {
            SymbolicCholeskyRaw::Supernodal(it) => {
                (0..it.n_supernodes()).map(|s| (it.supernode(s).start(), it.supernode(s).pattern())).collect()
            }
            // Chosen when there is nothing to eliminate: no unknowns, or none that meet.
            SymbolicCholeskyRaw::Simplicial(it) => (0..it.ncols()).map(|column| (column, &[][..])).collect(),
        };
        let entries = matrix.entries().map(|it| (it.0, it.1));
        let fronts = Fronts::new::<T>(place, &nodes, entries).ok_or(too_large)?;
        Ok(Self { fronts: Arc::new(fronts), scalar: PhantomData })
    }

    /// Number of values stored for the factor.
    pub fn entries(&self) -> usize {
        self.fronts.values()
    }

    /// Factors a matrix of the analysed pattern. Panics if the pattern has another size.
    pub fn factor(&self, matrix: &SymmetricMatrix) -> Result<Cholesky<T>, SparseError> {
        let values = vec![T::default(); self.fronts.values()];
        let mut out = Cholesky { fronts: self.fronts.clone(), values, updates: Vec::new() };
        out.refactor(matrix)?;
        Ok(out)
    }
}

/// The factor L of A = L Lᵀ.
#[derive(Debug, Clone)]
pub struct Cholesky<T = f64> {
    fronts: Arc<Fronts>,
    values: Vec<T>,
    /// Room for the next factorisation.
    updates: Vec<T>,
}

impl Cholesky {
    /// Orders, analyses and factors.
    pub fn new(matrix: &SymmetricMatrix) -> Result<Self, SparseError> {
        Analysis::new(matrix)?.factor(matrix)
    }
}

impl<T: Scalar> Cholesky<T> {
    /// Factors other values of the same pattern, in place. After an error the factor must not be used.
    /// Panics if the pattern has another size.
    pub fn refactor(&mut self, matrix: &SymmetricMatrix) -> Result<(), SparseError> {
        assert_eq!(matrix.values.len(), self.fronts.entries(), "the analysis is of a matrix of another pattern");
        if let Some((row, column, value)) = matrix.entries().find(|it| !it.2.is_finite()) {
            return Err(SparseError::NotFinite { row, column, value });
        }
        let refuse = |place| SparseError::NotPositiveDefinite { index: self.fronts.unknown(place) };
        self.fronts.factor(&matrix.values, &mut self.values, &mut self.updates).map_err(refuse)?;
        let diagonal = matrix.diagonal();
        let mut by_place = vec![0.0; diagonal.len()];
        for (&place, &value) in self.fronts.places().iter().zip(&diagonal) {
            by_place[place as usize] = value;
        }
        // NaN, the trace of an overflow, fails the comparison as well.
        let bad = self
            .fronts
            .pivots(&self.values)
            .zip(by_place)
            .position(|(root, it)| !(root * root > T::SMALLEST_PIVOT * it));
        bad.map_or(Ok(()), |place| Err(refuse(place)))
    }

    /// Number of unknowns.
    pub fn size(&self) -> usize {
        self.fronts.size()
    }

    /// Solves A x = b. Panics unless `b` has one value per unknown.
    pub fn solve(&self, b: &[f64]) -> Vec<f64> {
        let mut x = b.to_vec();
        self.solve_in_place(&mut x);
        x
    }

    /// Solves A X = B in place for any number of right-hand sides, one after the other in `columns`.
    /// Panics unless its length is a multiple of the number of unknowns.
    pub fn solve_in_place(&self, columns: &mut [f64]) {
        let n = self.size();
        if n == 0 || columns.is_empty() {
            return;
        }
        assert!(columns.len().is_multiple_of(n), "right-hand sides of {n} values each");
        self.fronts.solve(&self.values, columns);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The Laplacian of an m × m grid plus `shift` on the diagonal.
    fn grid(m: usize, shift: f64) -> SymmetricMatrix {
        let mut triplets = Vec::new();
        for i in 0..m * m {
            triplets.push((i as u32, i as u32, shift));
            for j in [(i % m + 1 < m).then_some(i + 1), (i + m < m * m).then_some(i + m)].into_iter().flatten() {
                triplets.push((i as u32, i as u32, 1.0));
                triplets.push((j as u32, j as u32, 1.0));
                // Either triangle may be given.
                triplets.push(if i % 2 == 0 { (i as u32, j as u32, -1.0) } else { (j as u32, i as u32, -1.0) });
            }
        }
        SymmetricMatrix::from_triplets(m * m, &triplets)
    }

    fn wave(n: usize, step: f64) -> Vec<f64> {
        (0..n).map(|i| (i as f64 * step).sin()).collect()
    }

    #[test]
    fn solves_for_several_right_hand_sides() {
        for m in [1, 7, 40, 80] {
            let a = grid(m, 0.01);
            let factor = Cholesky::new(&a).unwrap();
            let mut columns: Vec<f64> = [wave(m * m, 0.3), wave(m * m, 1.7), wave(m * m, 2.9)].concat();
            let b = columns.clone();
            factor.solve_in_place(&mut columns);
            for (x, b) in columns.chunks(m * m).zip(b.chunks(m * m)) {
                let residual = a.multiply(x).iter().zip(b).map(|(p, q)| (p - q).abs()).fold(0.0, f64::max);
                assert!(residual < 1e-11, "{m}: {residual}");
                assert_eq!(factor.solve(b).len(), m * m);
            }
        }
    }

    #[test]
    fn single_precision_gives_half_the_digits() {
        for m in [3, 40] {
            let a = grid(m, 0.5);
            let b = wave(m * m, 0.3);
            let exact = Cholesky::new(&a).unwrap().solve(&b);
            let rough = Analysis::<f32>::of(&a).unwrap().factor(&a).unwrap().solve(&b);
            let error = exact.iter().zip(&rough).map(|(p, q)| (p - q).abs()).fold(0.0, f64::max);
            assert!(error > 0.0 && error < 1e-5, "{m}: {error}");
        }
    }

    #[test]
    fn supernodes_of_any_width_are_factored() {
        for n in (1..=40).chain([130, 300]) {
            // A dense block of n unknowns, twice, joined by three more.
            let mut triplets = Vec::new();
            for i in 0..2 * n + 3 {
                triplets.push((i as u32, i as u32, 2.0 * n as f64 + 3.0));
                for j in (0..i).filter(|j| i >= 2 * n || i / n == j / n) {
                    triplets.push((i as u32, j as u32, (i as f64 * 1.3 + j as f64 * 0.7).sin()));
                }
            }
            let a = SymmetricMatrix::from_triplets(2 * n + 3, &triplets);
            let b = wave(2 * n + 3, 0.9);
            let x = Cholesky::new(&a).unwrap().solve(&b);
            let residual = a.multiply(&x).iter().zip(&b).map(|(p, q)| (p - q).abs()).fold(0.0, f64::max);
            assert!(residual < 1e-13, "{n}: {residual}");
        }
    }

    #[test]
    fn repeated_entries_are_summed_through_slots() {
        let pairs = [(0, 0), (1, 0), (0, 1), (1, 1), (2, 1)];
        let (mut a, slots) = SymmetricMatrix::with_pattern(4, &pairs);
        for (k, &slot) in slots.iter().enumerate() {
            a.values_mut()[slot as usize] += (k + 1) as f64;
        }
        let entries: Vec<_> = a.entries().collect();
        let expected = [(0, 0, 1.0), (1, 0, 5.0), (1, 1, 4.0), (2, 1, 5.0), (2, 2, 0.0), (3, 3, 0.0)];
        assert_eq!(entries, expected);
        assert_eq!(a.multiply(&[1.0, 2.0, 3.0, 4.0]), [11.0, 28.0, 10.0, 0.0]);
        assert_eq!(a.diagonal(), [1.0, 4.0, 0.0, 0.0]);
    }

    #[test]
    fn an_analysis_serves_other_values() {
        let (a, b) = (grid(70, 0.1), grid(70, 3.0));
        let analysis = Analysis::new(&a).unwrap();
        let mut factor = analysis.factor(&a).unwrap();
        factor.refactor(&b).unwrap();
        assert_eq!(factor.solve(&wave(4900, 0.7)), Cholesky::new(&b).unwrap().solve(&wave(4900, 0.7)));
    }

    #[test]
    fn a_bad_pivot_is_named() {
        for m in [20, 80] {
            for bad in [0, m + 3, m * m - 1] {
                let mut a = grid(m, 1.0);
                a.add_to_diagonal(bad, -1e3);
                assert_eq!(Cholesky::new(&a).unwrap_err(), SparseError::NotPositiveDefinite { index: bad }, "{m}");
            }
            assert!(matches!(Cholesky::new(&grid(m, 0.0)), Err(SparseError::NotPositiveDefinite { .. })));
            let mut a = grid(m, 1.0);
            a.add_to_diagonal(5, f64::NAN);
            assert!(matches!(Cholesky::new(&a), Err(SparseError::NotFinite { row: 5, column: 5, .. })));
        }
    }

    #[test]
    fn nothing_to_eliminate_is_no_problem() {
        let diagonal = SymmetricMatrix::from_triplets(3, &[(0, 0, 2.0), (1, 1, 4.0), (2, 2, 8.0)]);
        let x = Cholesky::new(&diagonal).unwrap().solve(&[1.0, 1.0, 1.0]);
        assert!(x.iter().zip([0.5, 0.25, 0.125]).all(|(a, b)| (a - b).abs() < 1e-15), "{x:?}");
        let factor = Cholesky::new(&SymmetricMatrix::from_triplets(0, &[])).unwrap();
        assert_eq!(factor.solve(&[]), Vec::<f64>::new());
    }
}
