//! Symmetric quasi-definite systems [A Bᵀ; B −C] with A and C positive definite: L D Lᵀ for every order of elimination,
//! analysed once, solved with iterative refinement. The factor is of faer (supernodal).
use faer::{
    Conj, MatMut, Par, Side,
    dyn_stack::{MemBuffer, MemStack},
    linalg::cholesky::ldlt::factor::LdltRegularization,
    sparse::{
        SparseColMatRef,
        linalg::{
            SupernodalThreshold,
            cholesky::{
                CholeskySymbolicParams, LdltRef, SymbolicCholesky, SymmetricOrdering, factorize_symbolic_cholesky,
            },
        },
    },
};

use super::sparse::{SparseError, SymmetricMatrix};

/// Order of elimination and structure of the factor, with room for its values.
pub struct QuasiDefinite {
    symbolic: SymbolicCholesky<u32>,
    /// +1 for unknowns of A, −1 for those of C.
    signs: Vec<i8>,
    values: Vec<f64>,
    memory: MemBuffer,
}

impl QuasiDefinite {
    /// Orders (approximate minimum degree) and analyses the pattern of `matrix`, whose first `positive` unknowns are
    /// those of A.
    pub fn new(matrix: &SymmetricMatrix, positive: usize) -> Result<Self, SparseError> {
        let n = matrix.size();
        let params = CholeskySymbolicParams {
            supernodal_flop_ratio_threshold: SupernodalThreshold::FORCE_SUPERNODAL,
            ..Default::default()
        };
        let symbolic = factorize_symbolic_cholesky(matrix.pattern(), Side::Lower, SymmetricOrdering::Amd, params)
            .map_err(|_| SparseError::TooLarge { unknowns: n })?;
        let factor = symbolic.factorize_numeric_ldlt_scratch::<f64>(Par::Seq, Default::default());
        let memory = MemBuffer::new(factor.or(symbolic.solve_in_place_scratch::<f64>(1, Par::Seq)));
        let values = vec![0.0; symbolic.len_val()];
        let signs = (0..n).map(|i| if i < positive { 1 } else { -1 }).collect();
        Ok(Self { symbolic, signs, values, memory })
    }

    /// Number of values stored for the factor.
    pub fn entries(&self) -> usize {
        self.values.len()
    }

    /// Factors other values of the analysed pattern. A pivot of the wrong sign or below 1e-12 is replaced by one of
    /// the right sign, 1e-12: [`QuasiDefinite::solve`] mends what that costs, as far as it can be mended.
    pub fn factor(&mut self, matrix: &SymmetricMatrix) -> Result<(), SparseError> {
        if let Some((row, column, value)) = matrix.entries().find(|it| !it.2.is_finite()) {
            return Err(SparseError::NotFinite { row, column, value });
        }
        let regularization = LdltRegularization {
            dynamic_regularization_signs: Some(&self.signs),
            dynamic_regularization_delta: 1e-12,
            dynamic_regularization_epsilon: 1e-12,
        };
        self.symbolic
            .factorize_numeric_ldlt(
                &mut self.values,
                SparseColMatRef::new(matrix.pattern(), matrix.values()),
                Side::Lower,
                regularization,
                Par::Seq,
                MemStack::new(&mut self.memory),
                Default::default(),
            )
            .map(|_| ())
            .map_err(|_| SparseError::NotPositiveDefinite { index: 0 })
    }

    /// Solves K x = b for the matrix last factored, with at most `rounds` rounds of iterative refinement; returns x and
    /// the largest residual |K x − b|. A round that does not halve the residual is the last.
    pub fn solve(&mut self, matrix: &SymmetricMatrix, b: &[f64], rounds: usize) -> (Vec<f64>, f64) {
        let mut x = b.to_vec();
        self.substitute(&mut x);
        let mut residual = remainder(matrix, &x, b);
        let mut size = largest(&residual);
        for _ in 0..rounds {
            self.substitute(&mut residual);
            let better: Vec<f64> = x.iter().zip(&residual).map(|(x, d)| x + d).collect();
            let next = remainder(matrix, &better, b);
            let next_size = largest(&next);
            if !(next_size < size) {
                break;
            }
            let last = next_size > 0.5 * size;
            (x, residual, size) = (better, next, next_size);
            if last {
                break;
            }
        }
        (x, size)
    }

    fn substitute(&mut self, x: &mut [f64]) {
        let n = x.len();
        LdltRef::new(&self.symbolic, &self.values).solve_in_place_with_conj(
            Conj::No,
            MatMut::from_column_major_slice_mut(x, n, 1),
            Par::Seq,
            MemStack::new(&mut self.memory),
        );
    }
}

fn remainder(matrix: &SymmetricMatrix, x: &[f64], b: &[f64]) -> Vec<f64> {
    matrix.multiply(x).iter().zip(b).map(|(ax, b)| b - ax).collect()
}

fn largest(x: &[f64]) -> f64 {
    x.iter().fold(0.0, |m, it| if it.is_nan() { f64::INFINITY } else { it.abs().max(m) })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_saddle_point_is_solved() {
        // A = tridiagonal (2.5, −1), B couples pairs, C = 1e-8.
        let (n, m) = (60, 25);
        let mut triplets: Vec<(u32, u32, f64)> = (0..n).map(|i| (i, i, 2.5)).collect();
        triplets.extend((1..n).map(|i| (i, i - 1, -1.0)));
        for r in 0..m {
            triplets.push((n + r, 2 * r, 1.0));
            triplets.push((n + r, 2 * r + 3, -0.7 - 0.01 * f64::from(r)));
            triplets.push((n + r, n + r, -1e-8));
        }
        let matrix = SymmetricMatrix::from_triplets((n + m) as usize, &triplets);
        let b: Vec<f64> = (0..n + m).map(|i| (f64::from(i) * 0.37).sin()).collect();
        let mut solver = QuasiDefinite::new(&matrix, n as usize).unwrap();
        solver.factor(&matrix).unwrap();
        let (x, residual) = solver.solve(&matrix, &b, 5);
        assert!(residual < 1e-12, "{residual}");
        assert!(largest(&remainder(&matrix, &x, &b)) < 1e-12);
    }
}
