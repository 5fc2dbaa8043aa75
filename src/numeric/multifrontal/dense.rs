//! Dense kernels of the factorisation: panels, and products of panels that blocks in registers sum up.
use std::ops::Range;

use pulp::Simd;

use super::Scalar;

/// Columns of a block in registers.
const WIDE: usize = 8;
/// Vectors per column of a block in registers: 3 × 8 accumulators fit into the 32 registers of AVX-512.
const TALL: usize = 3;
/// Columns whose product is summed before it is stored: so many columns of a strip fit into the first cache.
const DEEP: usize = 128;

/// Factors a panel of `rows` rows in place; on failure the pivot that is not positive.
#[inline(always)]
pub(super) fn factor_panel<T: Scalar, S: Simd>(
    simd: S,
    panel: &mut [T],
    k: usize,
    rows: usize,
    height: usize,
) -> Result<(), usize> {
    for first in (0..k).step_by(DEEP) {
        let end = k.min(first + DEEP);
        let mut j = first;
        while j < end {
            let (done, rest) = panel.split_at_mut(j * height);
            let done = &done[first * height..];
            j += match end - j {
                WIDE.. => block::<T, S, WIDE>(simd, done, rest, j, rows, height),
                4.. => block::<T, S, 4>(simd, done, rest, j, rows, height),
                2.. => block::<T, S, 2>(simd, done, rest, j, rows, height),
                _ => block::<T, S, 1>(simd, done, rest, j, rows, height),
            }?;
        }
        let (done, rest) = panel.split_at_mut(end * height);
        let target = Target { columns: rest, side: height, row: end };
        subtract_products(simd, &done[first * height..], height, end..rows, k - end, target);
    }
    Ok(())
}

/// Columns j … j + N − 1 of a panel (`rest` begins with them), from those before that are done and in the same block; returns N.
#[inline(always)]
fn block<T: Scalar, S: Simd, const N: usize>(
    simd: S,
    done: &[T],
    rest: &mut [T],
    j: usize,
    rows: usize,
    height: usize,
) -> Result<usize, usize> {
    // Vectors begin at a multiple of their length; what they hold above the diagonal is wiped at the end.
    let start = j / T::PAD * T::PAD;
    if !done.is_empty() {
        let mut at = start;
        while at < rows {
            let target = (&mut *rest, height, at);
            let vectors = TALL.min((rows - at).div_ceil(T::lanes::<S>()));
            match vectors {
                TALL => tile::<T, S, N, TALL>(simd, done, height, at, j, target),
                2 => tile::<T, S, N, 2>(simd, done, height, at, j, target),
                _ => tile::<T, S, N, 1>(simd, done, height, at, j, target),
            };
            at += vectors * T::lanes::<S>();
        }
    }
    // The triangle on the diagonal.
    let mut lower = [[T::default(); N]; N];
    let mut inverse = [T::default(); N];
    for c in 0..N {
        for r in c..N {
            let mut sum = rest[c * height + j + r];
            for p in 0..c {
                sum -= lower[r][p] * lower[c][p];
            }
            if r > c {
                lower[r][c] = sum * inverse[c];
            } else if sum > T::default() && sum.to_f64().is_finite() {
                lower[c][c] = sum.root();
                inverse[c] = T::ONE / lower[c][c];
            } else {
                return Err(j + c);
            }
        }
    }
    // Rows below: X ← X L⁻ᵀ.
    let lanes = T::lanes::<S>();
    let mut at = start;
    while at < rows {
        let mut x = [T::splat(simd, T::default()); N];
        for c in 0..N {
            let column = &mut rest[c * height + at..c * height + at + lanes];
            let column = &mut T::vectors_mut::<S>(column).0[0];
            let mut sum = *column;
            for p in 0..c {
                sum = T::mul_add(simd, T::splat(simd, -lower[c][p]), x[p], sum);
            }
            x[c] = T::times(simd, sum, T::splat(simd, inverse[c]));
            *column = x[c];
        }
        at += lanes;
    }
    for c in 0..N {
        let column = &mut rest[c * height..(c + 1) * height];
        column[start..j + c].fill(T::default());
        for r in c..N {
            column[j + r] = lower[r][c];
        }
    }
    Ok(N)
}

/// Columns that a product is subtracted from, each `side` long; the first row of the product lies at `row`.
pub(super) struct Target<'a, T> {
    pub(super) columns: &'a mut [T],
    pub(super) side: usize,
    pub(super) row: usize,
}

/// C ← C − B Bᵀ for the `rows` B of `a` (columns of length `height`), its first `columns` columns, lower triangle by
/// tiles.
#[inline(always)]
pub(super) fn subtract_products<T: Scalar, S: Simd>(
    simd: S,
    a: &[T],
    height: usize,
    rows: Range<usize>,
    columns: usize,
    mut target: Target<'_, T>,
) {
    for a in a.chunks(DEEP * height) {
        let mut done = 0;
        while done < rows.len() {
            let (first, row) = (rows.start, rows.start + done);
            done += match (rows.end - row).div_ceil(T::lanes::<S>()) {
                TALL.. => strip::<T, S, TALL>(simd, a, height, (first, row), columns, &mut target),
                2 => strip::<T, S, 2>(simd, a, height, (first, row), columns, &mut target),
                _ => strip::<T, S, 1>(simd, a, height, (first, row), columns, &mut target),
            };
        }
    }
}

/// M vectors of rows from `row` on against all columns that begin above their end: the strip stays in the first cache
/// while the columns pass by. Returns its rows.
#[inline(always)]
fn strip<T: Scalar, S: Simd, const M: usize>(
    simd: S,
    a: &[T],
    height: usize,
    (first, row): (usize, usize),
    columns: usize,
    target: &mut Target<'_, T>,
) -> usize {
    let length = M * T::lanes::<S>();
    let last = columns.min(row - first + length);
    let to = target.row + row - first;
    let mut j = 0;
    while j < last {
        let c = (&mut target.columns[j * target.side..], target.side, to);
        j += match last - j {
            WIDE.. => tile::<T, S, WIDE, M>(simd, a, height, row, first + j, c),
            4.. => tile::<T, S, 4, M>(simd, a, height, row, first + j, c),
            2.. => tile::<T, S, 2, M>(simd, a, height, row, first + j, c),
            _ => tile::<T, S, 1, M>(simd, a, height, row, first + j, c),
        };
    }
    length
}

/// N columns and M vectors of rows of the product, summed in registers; returns N.
#[inline(always)]
fn tile<T: Scalar, S: Simd, const N: usize, const M: usize>(
    simd: S,
    a: &[T],
    height: usize,
    row: usize,
    right: usize,
    (c, side, to): (&mut [T], usize, usize),
) -> usize {
    let length = M * T::lanes::<S>();
    let mut sums = [[T::splat(simd, T::default()); M]; N];
    for column in a.chunks_exact(height) {
        let left = T::vectors::<S>(&column[row..row + length]).0;
        let factors = &column[right..right + N];
        for n in 0..N {
            let factor = T::splat(simd, factors[n]);
            for m in 0..M {
                sums[n][m] = T::mul_add(simd, factor, left[m], sums[n][m]);
            }
        }
    }
    for n in 0..N {
        let target = T::vectors_mut::<S>(&mut c[n * side + to..n * side + to + length]).0;
        for m in 0..M {
            target[m] = T::minus(simd, target[m], sums[n][m]);
        }
    }
    N
}
