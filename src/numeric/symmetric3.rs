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

    #[test]
    fn eigenpairs_are_right_whatever_the_gaps() {
        use crate::numeric::random::Random;
        let mut random = Random::new(4);
        let mut worst = [0.0_f64; 3];
        for scale in [1e-100, 1.0, 1e100] {
            for gap in [0.0, 1e-16, 1e-15, 1e-12, 1e-8, 1e-4, 0.1, 1.0, 1e8] {
                for _ in 0..50 {
                    // A rotation from a random quaternion.
                    let [a, b, c, d] = [0; 4].map(|_| 2.0 * random.unit() - 1.0);
                    let n = (a * a + b * b + c * c + d * d).sqrt();
                    let [a, b, c, d] = [a / n, b / n, c / n, d / n];
                    let axes = [
                        [a * a + b * b - c * c - d * d, 2.0 * (b * c + a * d), 2.0 * (b * d - a * c)],
                        [2.0 * (b * c - a * d), a * a - b * b + c * c - d * d, 2.0 * (c * d + a * b)],
                        [2.0 * (b * d + a * c), 2.0 * (c * d - a * b), a * a - b * b - c * c + d * d],
                    ];
                    let exact = [1.0, 1.0 + gap, 1.0 + 3.0 * gap].map(|it| it * scale / (1.0 + gap));
                    let entry = |i: usize, k: usize| (0..3).map(|m| exact[m] * axes[m][i] * axes[m][k]).sum();
                    let matrix: Symmetric3 = std::array::from_fn(|i| std::array::from_fn(|k| entry(i, k)));
                    let (mut values, vectors) = jacobi(matrix);
                    for (i, vector) in vectors.iter().enumerate() {
                        let image = product(&matrix, vector);
                        for k in 0..3 {
                            worst[0] = worst[0].max((image[k] - values[i] * vector[k]).abs() / exact[2]);
                            let dot: f64 = (0..3).map(|c| vector[c] * vectors[k][c]).sum();
                            worst[1] = worst[1].max((dot - f64::from(u8::from(i == k))).abs());
                        }
                    }
                    values.sort_by(f64::total_cmp);
                    for (value, exact_value) in values.iter().zip(&exact) {
                        worst[2] = worst[2].max((value - exact_value).abs() / exact[2]);
                    }
                }
            }
        }
        assert!(worst.iter().all(|&it| it < 4e-15), "{worst:?}");
    }
}
