//! Multifrontal Cholesky factorisation (Duff, Reid 1983; Liu 1992) of a sparse matrix whose supernodes are known, with
//! dense kernels that keep a block of the result in vector registers.
//!
//! Notation: a supernode has `k` pivot columns and `u` rows below them; its *panel* is the (k + u) × k trapezoid of L, its
//! *update* the u × u Schur complement that it passes to its parent. Both are stored by columns, with columns padded so
//! that whole vectors can be read; padding stays zero. Fused multiply-adds are used, so the last digits depend on the
//! processor, never on the number of threads.
use pulp::{Simd, WithSimd};

const NONE: u32 = u32::MAX;
/// Columns of a block in registers.
const WIDE: usize = 8;
/// Vectors per column of a block in registers: 3 × 8 accumulators fit into the 32 registers of AVX-512.
const TALL: usize = 3;
/// Columns whose product is summed before it is stored: so many columns of a strip fit into the first cache.
const DEEP: usize = 128;
/// Columns are padded to a multiple of this many values, the widest vector.
const PAD: usize = 8;

/// The structure of a factor.
#[derive(Debug, Clone)]
pub(super) struct Fronts {
    /// Place in the elimination of each unknown.
    place: Vec<u32>,
    supernodes: Vec<Supernode>,
    /// Numbers of the supernodes, the descendants of each one right before it.
    sequence: Vec<u32>,
    /// Rows below the pivots of all supernodes, as places in the elimination, ascending.
    rows: Vec<u32>,
    /// For the same rows, their index in the front of the parent.
    in_parent: Vec<u32>,
    /// The stored entries of the matrix by the supernode of their column: number, and place in the panel.
    assembly: Vec<(u32, u32)>,
    values: usize,
    /// Values that the updates waiting for their parents take at most.
    stack: usize,
}

#[derive(Debug, Clone)]
struct Supernode {
    /// First pivot.
    first: u32,
    /// Number of pivots.
    k: u32,
    /// First entry of its rows.
    row: u32,
    /// Number of rows below the pivots.
    u: u32,
    /// First value of the panel.
    value: usize,
    /// Where its entries of the matrix begin and end in `assembly`.
    entries: [u32; 2],
    children: u32,
}

fn padded(n: usize) -> usize {
    n.next_multiple_of(PAD)
}

impl Supernode {
    fn k(&self) -> usize {
        self.k as usize
    }

    fn u(&self) -> usize {
        self.u as usize
    }

    /// Length of a column of the panel: vectors may begin at the first row or at the first one below the pivots.
    fn height(&self) -> usize {
        padded(self.k() + self.u()).max(self.k() + padded(self.u()))
    }

    fn rows(&self) -> std::ops::Range<usize> {
        self.row as usize..(self.row + self.u) as usize
    }

    fn panel(&self) -> std::ops::Range<usize> {
        self.value..self.value + self.height() * self.k()
    }
}

impl Fronts {
    /// The structure for unknowns eliminated at `place`, in supernodes given by their first pivots and the rows below (as
    /// places, ascending). `entries` are the stored (row, column) of the matrix. None if the factor is too large.
    pub(super) fn new(
        place: Vec<u32>,
        supernodes: &[(usize, &[u32])],
        entries: impl Iterator<Item = (usize, usize)>,
    ) -> Option<Self> {
        let n = place.len();
        let (mut nodes, mut rows): (Vec<Supernode>, Vec<u32>) = (Vec::new(), Vec::new());
        for &(first, below) in supernodes {
            if let Some(last) = nodes.last_mut() {
                last.k = first as u32 - last.first;
            }
            nodes.push(Supernode {
                first: first as u32,
                k: (n - first) as u32,
                row: rows.len() as u32,
                u: below.len() as u32,
                value: 0,
                entries: [0; 2],
                children: 0,
            });
            rows.extend(below);
        }
        let mut owner = vec![0_u32; n];
        let mut values = 0;
        for (s, node) in nodes.iter_mut().enumerate() {
            node.value = values;
            values += node.height() * node.k();
            owner[node.first as usize..(node.first + node.k) as usize].fill(s as u32);
        }
        u32::try_from(values).ok()?;
        let mut fronts = Self {
            place,
            supernodes: nodes,
            sequence: Vec::new(),
            rows,
            in_parent: Vec::new(),
            assembly: Vec::new(),
            values,
            stack: 0,
        };
        fronts.relate(&owner);
        fronts.assemble(&owner, entries);
        Some(fronts)
    }

    /// Indices of rows in the fronts of their parents, the sequence, and the height of the stack.
    fn relate(&mut self, owner: &[u32]) {
        let count = self.supernodes.len();
        self.in_parent = vec![0; self.rows.len()];
        // Children as linked lists; walking down from the roots, last child first, gives the sequence backwards.
        let (mut child, mut sibling, mut open) = (vec![NONE; count], vec![NONE; count], Vec::new());
        for s in 0..count {
            let node = self.supernodes[s].clone();
            let Some(&parent) = self.rows[node.rows()].first() else {
                open.push(s as u32);
                continue;
            };
            let parent = owner[parent as usize] as usize;
            sibling[s] = std::mem::replace(&mut child[parent], s as u32);
            self.supernodes[parent].children += 1;
            self.relate_rows(&node, &self.supernodes[parent].clone());
        }
        while let Some(s) = open.pop() {
            self.sequence.push(s);
            let mut next = child[s as usize];
            while next != NONE {
                open.push(next);
                next = sibling[next as usize];
            }
        }
        self.sequence.reverse();
        let (mut waiting, mut held) = (Vec::new(), 0);
        for &s in &self.sequence {
            let node = &self.supernodes[s as usize];
            let size = padded(node.u()) * padded(node.u());
            self.stack = self.stack.max(held + size);
            for _ in 0..node.children {
                held -= waiting.pop().expect("a child waits for its parent");
            }
            if node.u > 0 {
                waiting.push(size);
                held += size;
            }
        }
    }

    fn relate_rows(&mut self, node: &Supernode, parent: &Supernode) {
        let mut below = parent.rows();
        for at in node.rows() {
            let row = self.rows[at];
            self.in_parent[at] = if row < parent.first + parent.k {
                row - parent.first
            } else {
                let skipped = self.rows[below.clone()].iter().position(|&it| it == row);
                below.start += skipped.expect("a parent has the rows of its children");
                parent.k + below.start as u32 - parent.row
            };
        }
    }

    /// Sorts the entries of the matrix by supernode.
    fn assemble(&mut self, owner: &[u32], entries: impl Iterator<Item = (usize, usize)>) {
        let placed: Vec<(u32, u32)> = entries.map(|(i, j)| self.place_in_panel(owner, i, j)).collect();
        let mut starts = vec![0; self.supernodes.len() + 1];
        placed.iter().for_each(|it| starts[it.0 as usize + 1] += 1);
        for s in 0..self.supernodes.len() {
            starts[s + 1] += starts[s];
            self.supernodes[s].entries = [starts[s], starts[s + 1]];
        }
        self.assembly = vec![(0, 0); placed.len()];
        for (number, (s, at)) in placed.into_iter().enumerate() {
            let next = &mut starts[s as usize];
            self.assembly[*next as usize] = (number as u32, at);
            *next += 1;
        }
    }

    /// Supernode and place in its panel of an entry of the matrix.
    fn place_in_panel(&self, owner: &[u32], i: usize, j: usize) -> (u32, u32) {
        let (p, q) = (self.place[i], self.place[j]);
        let (row, column) = (p.max(q), p.min(q));
        let s = owner[column as usize];
        let node = &self.supernodes[s as usize];
        let index = if row < node.first + node.k {
            row - node.first
        } else {
            let below = self.rows[node.rows()].binary_search(&row).expect("the factor has every entry of the matrix");
            node.k + below as u32
        };
        (s, (column - node.first) * node.height() as u32 + index)
    }

    /// Number of unknowns.
    pub(super) fn size(&self) -> usize {
        self.place.len()
    }

    /// Number of stored entries of the matrix.
    pub(super) fn entries(&self) -> usize {
        self.assembly.len()
    }

    /// Place in the elimination of each unknown.
    pub(super) fn places(&self) -> &[u32] {
        &self.place
    }

    /// Number of values of the factor, with padding.
    pub(super) fn values(&self) -> usize {
        self.values
    }

    /// Factors the matrix whose stored entries have the values `entries`; on failure the place of the pivot that is not
    /// positive. `stack` is scratch.
    pub(super) fn factor(&self, entries: &[f64], values: &mut [f64], stack: &mut Vec<f64>) -> Result<(), usize> {
        stack.resize(self.stack, 0.0);
        pulp::Arch::new().dispatch(Factor { fronts: self, entries, values, stack })
    }

    /// Pivots (diagonal entries of L) in the order of elimination.
    pub(super) fn pivots<'a>(&'a self, values: &'a [f64]) -> impl Iterator<Item = f64> + 'a {
        self.supernodes.iter().flat_map(|it| (0..it.k()).map(|c| values[it.value + c * (it.height() + 1)]))
    }

    /// The unknown that is eliminated at `place`.
    pub(super) fn unknown(&self, place: usize) -> usize {
        self.place.iter().position(|&it| it as usize == place).unwrap_or(place)
    }

    /// Solves L Lᵀ x = b for each column of length n in `columns`, in place.
    pub(super) fn solve(&self, values: &[f64], columns: &mut [f64]) {
        pulp::Arch::new().dispatch(Solve { fronts: self, values, columns });
    }
}

struct Factor<'a> {
    fronts: &'a Fronts,
    entries: &'a [f64],
    values: &'a mut [f64],
    stack: &'a mut [f64],
}

impl WithSimd for Factor<'_> {
    type Output = Result<(), usize>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
        let Self { fronts, entries, values, stack } = self;
        // Supernodes whose updates wait, with where each one begins.
        let mut waiting: Vec<(&Supernode, usize)> = Vec::new();
        let mut top = 0;
        for &s in &fronts.sequence {
            let node = &fronts.supernodes[s as usize];
            let panel = &mut values[node.panel()];
            panel.fill(0.0);
            let [from, to] = node.entries;
            for &(number, at) in &fronts.assembly[from as usize..to as usize] {
                panel[at as usize] += entries[number as usize];
            }
            let (height, side) = (node.height(), padded(node.u()));
            let (below, rest) = stack.split_at_mut(top);
            let update = &mut rest[..side * side];
            update.fill(0.0);
            let first_child = waiting.len() - node.children as usize;
            for &(child, at) in &waiting[first_child..] {
                let into = &fronts.in_parent[child.rows()];
                add_child(&below[at..], padded(child.u()), into, (&mut *panel, node.k(), height), (&mut *update, side));
            }
            if let Err(c) = factor_panel(simd, panel, node.k(), node.k() + node.u(), height) {
                return Err(node.first as usize + c);
            }
            let (k, u) = (node.k(), node.u());
            let target = Target { columns: update, side, row: 0 };
            subtract_products(simd, panel, height, k..k + u, side, target);
            let base = waiting.get(first_child).map_or(top, |it| it.1);
            waiting.truncate(first_child);
            if base < top {
                stack.copy_within(top..top + side * side, base);
            }
            if node.u > 0 {
                waiting.push((node, base));
                top = base + side * side;
            } else {
                top = base;
            }
        }
        Ok(())
    }
}

/// Adds the update of a child to panel and update of its parent (extend-add): its row r is row `into[r]` of the front.
#[inline(always)]
fn add_child(
    child: &[f64],
    side: usize,
    into: &[u32],
    (panel, k, height): (&mut [f64], usize, usize),
    (update, update_side): (&mut [f64], usize),
) {
    for (j, &column) in into.iter().enumerate() {
        let source = &child[j * side..j * side + into.len()];
        let column = column as usize;
        let (target, shift) = if column < k {
            (&mut panel[column * height..(column + 1) * height], 0)
        } else {
            (&mut update[(column - k) * update_side..(column - k + 1) * update_side], k)
        };
        for (&row, &value) in into[j..].iter().zip(&source[j..]) {
            target[row as usize - shift] += value;
        }
    }
}

/// Factors a panel of `rows` rows in place; on failure the pivot that is not positive.
#[inline(always)]
fn factor_panel<S: Simd>(simd: S, panel: &mut [f64], k: usize, rows: usize, height: usize) -> Result<(), usize> {
    for first in (0..k).step_by(DEEP) {
        let end = k.min(first + DEEP);
        let mut j = first;
        while j < end {
            let (done, rest) = panel.split_at_mut(j * height);
            let done = &done[first * height..];
            j += match end - j {
                WIDE.. => block::<S, WIDE>(simd, done, rest, j, rows, height),
                4.. => block::<S, 4>(simd, done, rest, j, rows, height),
                2.. => block::<S, 2>(simd, done, rest, j, rows, height),
                _ => block::<S, 1>(simd, done, rest, j, rows, height),
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
fn block<S: Simd, const N: usize>(
    simd: S,
    done: &[f64],
    rest: &mut [f64],
    j: usize,
    rows: usize,
    height: usize,
) -> Result<usize, usize> {
    // Vectors begin at a multiple of their length; what they hold above the diagonal is wiped at the end.
    let start = j / PAD * PAD;
    if !done.is_empty() {
        let mut at = start;
        while at < rows {
            let target = (&mut *rest, height, at);
            let vectors = TALL.min((rows - at).div_ceil(S::F64_LANES));
            match vectors {
                TALL => tile::<S, N, TALL>(simd, done, height, at, j, target),
                2 => tile::<S, N, 2>(simd, done, height, at, j, target),
                _ => tile::<S, N, 1>(simd, done, height, at, j, target),
            };
            at += vectors * S::F64_LANES;
        }
    }
    // The triangle on the diagonal.
    let mut lower = [[0.0; N]; N];
    let mut inverse = [0.0; N];
    for c in 0..N {
        for r in c..N {
            let mut sum = rest[c * height + j + r];
            for p in 0..c {
                sum -= lower[r][p] * lower[c][p];
            }
            if r > c {
                lower[r][c] = sum * inverse[c];
            } else if sum > 0.0 && sum.is_finite() {
                lower[c][c] = sum.sqrt();
                inverse[c] = 1.0 / lower[c][c];
            } else {
                return Err(j + c);
            }
        }
    }
    // Rows below: X ← X L⁻ᵀ.
    let lanes = S::F64_LANES;
    let mut at = start;
    while at < rows {
        let mut x = [simd.splat_f64s(0.0); N];
        for c in 0..N {
            let column = &mut rest[c * height + at..c * height + at + lanes];
            let column = &mut S::as_mut_simd_f64s(column).0[0];
            let mut sum = *column;
            for p in 0..c {
                sum = simd.mul_add_f64s(simd.splat_f64s(-lower[c][p]), x[p], sum);
            }
            x[c] = simd.mul_f64s(sum, simd.splat_f64s(inverse[c]));
            *column = x[c];
        }
        at += lanes;
    }
    for c in 0..N {
        let column = &mut rest[c * height..(c + 1) * height];
        column[start..j + c].fill(0.0);
        for r in c..N {
            column[j + r] = lower[r][c];
        }
    }
    Ok(N)
}

/// Columns that a product is subtracted from, each `side` long; the first row of the product lies at `row`.
struct Target<'a> {
    columns: &'a mut [f64],
    side: usize,
    row: usize,
}

/// C ← C − B Bᵀ for the `rows` B of `a` (columns of length `height`), its first `columns` columns, lower triangle by
/// tiles.
#[inline(always)]
fn subtract_products<S: Simd>(
    simd: S,
    a: &[f64],
    height: usize,
    rows: std::ops::Range<usize>,
    columns: usize,
    mut target: Target<'_>,
) {
    for a in a.chunks(DEEP * height) {
        let mut done = 0;
        while done < rows.len() {
            let (first, row) = (rows.start, rows.start + done);
            done += match (rows.end - row).div_ceil(S::F64_LANES) {
                TALL.. => strip::<S, TALL>(simd, a, height, (first, row), columns, &mut target),
                2 => strip::<S, 2>(simd, a, height, (first, row), columns, &mut target),
                _ => strip::<S, 1>(simd, a, height, (first, row), columns, &mut target),
            };
        }
    }
}

/// M vectors of rows from `row` on against all columns that begin above their end: the strip stays in the first cache
/// while the columns pass by. Returns its rows.
#[inline(always)]
fn strip<S: Simd, const M: usize>(
    simd: S,
    a: &[f64],
    height: usize,
    (first, row): (usize, usize),
    columns: usize,
    target: &mut Target<'_>,
) -> usize {
    let length = M * S::F64_LANES;
    let last = columns.min(row - first + length);
    let to = target.row + row - first;
    let mut j = 0;
    while j < last {
        let c = (&mut target.columns[j * target.side..], target.side, to);
        j += match last - j {
            WIDE.. => tile::<S, WIDE, M>(simd, a, height, row, first + j, c),
            4.. => tile::<S, 4, M>(simd, a, height, row, first + j, c),
            2.. => tile::<S, 2, M>(simd, a, height, row, first + j, c),
            _ => tile::<S, 1, M>(simd, a, height, row, first + j, c),
        };
    }
    length
}

/// N columns and M vectors of rows of the product, summed in registers; returns N.
#[inline(always)]
fn tile<S: Simd, const N: usize, const M: usize>(
    simd: S,
    a: &[f64],
    height: usize,
    row: usize,
    right: usize,
    (c, side, to): (&mut [f64], usize, usize),
) -> usize {
    let length = M * S::F64_LANES;
    let mut sums = [[simd.splat_f64s(0.0); M]; N];
    for column in a.chunks_exact(height) {
        let left = S::as_simd_f64s(&column[row..row + length]).0;
        let factors = &column[right..right + N];
        for n in 0..N {
            let factor = simd.splat_f64s(factors[n]);
            for m in 0..M {
                sums[n][m] = simd.mul_add_f64s(factor, left[m], sums[n][m]);
            }
        }
    }
    for n in 0..N {
        let target = S::as_mut_simd_f64s(&mut c[n * side + to..n * side + to + length]).0;
        for m in 0..M {
            target[m] = simd.sub_f64s(target[m], sums[n][m]);
        }
    }
    N
}

struct Solve<'a> {
    fronts: &'a Fronts,
    values: &'a [f64],
    columns: &'a mut [f64],
}

impl WithSimd for Solve<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { fronts, values, columns } = self;
        let n = fronts.size();
        let most = fronts.supernodes.iter().map(|it| it.height()).max().unwrap_or(0);
        let (mut x, mut local) = (vec![0.0; n], vec![0.0; most]);
        for column in columns.chunks_exact_mut(n) {
            for (&place, &b) in fronts.place.iter().zip(&*column) {
                x[place as usize] = b;
            }
            for node in &fronts.supernodes {
                forward(simd, node, &fronts.rows[node.rows()], &values[node.panel()], &mut x, &mut local);
            }
            for node in fronts.supernodes.iter().rev() {
                backward(simd, node, &fronts.rows[node.rows()], &values[node.panel()], &mut x, &mut local);
            }
            for (&place, b) in fronts.place.iter().zip(column) {
                *b = x[place as usize];
            }
        }
    }
}

/// Lx = b for the columns of one supernode.
#[inline(always)]
fn forward<S: Simd>(simd: S, node: &Supernode, rows: &[u32], panel: &[f64], x: &mut [f64], local: &mut [f64]) {
    let (k, height) = (node.k(), node.height());
    let first = node.first as usize;
    let local = &mut local[..height];
    local[..k].copy_from_slice(&x[first..first + k]);
    local[k..].fill(0.0);
    for (c, column) in panel.chunks_exact(height).enumerate() {
        let value = local[c] / column[c];
        // Whole vectors from the one that holds the diagonal on: what lies above it is zero in L.
        let start = c / PAD * PAD;
        let factor = simd.splat_f64s(-value);
        let (target, _) = S::as_mut_simd_f64s(&mut local[start..]);
        for (t, s) in target.iter_mut().zip(S::as_simd_f64s(&column[start..]).0) {
            *t = simd.mul_add_f64s(factor, *s, *t);
        }
        let tail = height / S::F64_LANES * S::F64_LANES;
        for r in tail.max(start)..height {
            local[r] -= value * column[r];
        }
        local[c] = value;
    }
    x[first..first + k].copy_from_slice(&local[..k]);
    for (&row, value) in rows.iter().zip(&local[k..]) {
        x[row as usize] += value;
    }
}

/// Lᵀx = b for the columns of one supernode.
#[inline(always)]
fn backward<S: Simd>(simd: S, node: &Supernode, rows: &[u32], panel: &[f64], x: &mut [f64], local: &mut [f64]) {
    let (k, height) = (node.k(), node.height());
    let first = node.first as usize;
    let local = &mut local[..height];
    local[..k].copy_from_slice(&x[first..first + k]);
    for (value, &row) in local[k..].iter_mut().zip(rows) {
        *value = x[row as usize];
    }
    local[k + rows.len()..].fill(0.0);
    for (c, column) in panel.chunks_exact(height).enumerate().rev() {
        let value = local[c];
        local[c] = 0.0;
        let start = c / PAD * PAD;
        let (xs, x_rest) = S::as_simd_f64s(&local[start..]);
        let (ls, l_rest) = S::as_simd_f64s(&column[start..]);
        let mut sum = simd.splat_f64s(0.0);
        for (a, b) in xs.iter().zip(ls) {
            sum = simd.mul_add_f64s(*a, *b, sum);
        }
        let mut dot = simd.reduce_sum_f64s(sum);
        for (a, b) in x_rest.iter().zip(l_rest) {
            dot += a * b;
        }
        local[c] = (value - dot) / column[c];
    }
    x[first..first + k].copy_from_slice(&local[..k]);
}
