//! Operations on long vectors, with a summation order that depends on nothing but their length.
use crate::numeric::lanes::{LANES, Lanes, vectorized};

/// ⟨a, b⟩, summed in [`LANES`] interleaved partial sums.
pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    vectorized(
        #[inline(always)]
        || {
            let (a_head, a_tail) = a.as_chunks::<LANES>();
            let (b_head, b_tail) = b.as_chunks::<LANES>();
            let mut sums = [Lanes::default(); 4];
            for (i, (&a, &b)) in a_head.iter().zip(b_head).enumerate() {
                sums[i % 4] += Lanes(a) * Lanes(b);
            }
            let tail: f64 = a_tail.iter().zip(b_tail).map(|(x, y)| x * y).sum();
            let sum = (sums[0] + sums[1]) + (sums[2] + sums[3]);
            sum.0.iter().sum::<f64>() + tail
        },
    )
}

/// y += factor · x.
pub(super) fn add_scaled(y: &mut [f64], factor: f64, x: &[f64]) {
    vectorized(
        #[inline(always)]
        || y.iter_mut().zip(x).for_each(|(y, x)| *y += factor * x),
    );
}

/// Euclidean norm.
pub(super) fn norm(a: &[f64]) -> f64 {
    dot(a, a).sqrt()
}

/// Largest absolute value; 0 of nothing.
pub(super) fn largest(a: &[f64]) -> f64 {
    a.iter().fold(0.0, |m, d| m.max(d.abs()))
}
