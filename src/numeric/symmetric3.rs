//! Eigenpairs of symmetric 3×3 matrices.

/// A symmetric 3×3 matrix.
pub type Symmetric3 = [[f64; 3]; 3];

/// Eigenvalues, and the matrix of eigenvectors as rows, unsorted. Cyclic Jacobi rotations: slower than a closed form but
/// right to the last digits, at repeated eigenvalues as well, and to high *relative* accuracy where the diagonal is
/// graded and dominant (Demmel, Veselić 1992).
pub fn jacobi(mut a: Symmetric3) -> ([f64; 3], [[f64; 3]; 3]) {
    /// Convergence is quadratic; 4 to 6 sweeps suffice, the limit only bounds NaN input.
    const SWEEPS: usize = 30;
    let mut v = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    for _ in 0..SWEEPS {
        let mut rotated = false;
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            let off = a[p][q];
            // Negligible against both diagonal entries, the criterion that keeps relative accuracy.
            if off * off <= 1e-34 * (a[p][p] * a[q][q]).abs() || off == 0.0 {
                continue;
            }
            rotated = true;
            let tau = (a[q][q] - a[p][p]) / (2.0 * off);
            let t = tau.signum() / (tau.abs() + (1.0 + tau * tau).sqrt());
            let c = 1.0 / (1.0 + t * t).sqrt();
            let s = t * c;
            let r = 3 - p - q;
            let (arp, arq) = (a[r][p], a[r][q]);
            a[p][p] -= t * off;
            a[q][q] += t * off;
            (a[p][q], a[q][p]) = (0.0, 0.0);
            (a[r][p], a[r][q]) = (c * arp - s * arq, s * arp + c * arq);
            (a[p][r], a[q][r]) = (a[r][p], a[r][q]);
            for k in 0..3 {
                let (x, y) = (v[p][k], v[q][k]);
                (v[p][k], v[q][k]) = (c * x - s * y, s * x + c * y);
            }
        }
        if !rotated {
            break;
        }
    }
    ([a[0][0], a[1][1], a[2][2]], v)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn product(a: &Symmetric3, x: &[f64; 3]) -> [f64; 3] {
        std::array::from_fn(|i| (0..3).map(|k| a[i][k] * x[k]).sum())
    }

    #[test]
    fn eigenvectors_are_orthonormal_and_satisfy_the_equation() {
        let matrices: [Symmetric3; 5] = [
            [[2.0, 1.0, 0.5], [1.0, 3.0, -0.25], [0.5, -0.25, 1.0]],
            [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            [[0.0; 3]; 3],
            [[1.0, 1.0, 1.0], [1.0, 1.0, 1.0], [1.0, 1.0, 1.0]],
            [[1.0, 1e-13, 0.0], [1e-13, 1.0 + 1e-13, 2e-14], [0.0, 2e-14, 1.0]],
        ];
        for a in matrices {
            let (values, vectors) = jacobi(a);
            for i in 0..3 {
                let av = product(&a, &vectors[i]);
                for k in 0..3 {
                    assert!((av[k] - values[i] * vectors[i][k]).abs() < 2e-15 * 4.0, "{a:?}");
                    let dot: f64 = (0..3).map(|c| vectors[i][c] * vectors[k][c]).sum();
                    assert!((dot - f64::from(u8::from(i == k))).abs() < 1e-15 * 4.0, "{a:?}");
                }
            }
        }
    }

    #[test]
    fn small_eigenvalues_of_graded_matrices_keep_their_digits() {
        // [[1, x], [x, y]] beside an uncoupled third: the small eigenvalue is y − x² + O(x⁴).
        let (x, y) = (1e-9, 3e-18);
        let (values, _) = jacobi([[1.0, x, 0.0], [x, y, 0.0], [0.0, 0.0, 7e-18]]);
        let smallest = values.iter().copied().fold(f64::INFINITY, f64::min);
        assert!((smallest - 2e-18).abs() < 1e-32, "{smallest:e}");
    }
}
