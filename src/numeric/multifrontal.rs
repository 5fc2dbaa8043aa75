//! Multifrontal Cholesky factorisation (Duff, Reid 1983; Liu 1992) of a sparse matrix whose supernodes are known, with
//! dense kernels that keep a block of the result in vector registers.
//!
//! Notation: a supernode has `k` pivot columns and `u` rows below them; its *panel* is the (k + u) × k trapezoid of L, its
//! *update* the u × u Schur complement that it passes to its parent. Both are stored by columns, with columns padded so
//! that whole vectors can be read; padding stays zero. Fused multiply-adds are used, so the last digits depend on the
//! processor, never on the number of threads.
mod dense;
mod scalar;

use std::ops::Range;

use pulp::{Simd, WithSimd};

use self::dense::{Target, factor_panel, subtract_products};
pub use self::scalar::Scalar;

const NONE: u32 = u32::MAX;

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
    /// Length of a column of the panel: vectors may begin at the first row or at the first one below the pivots.
    height: u32,
    /// Length of a column of the update, and number of columns with room.
    side: u32,
}

impl Supernode {
    fn k(&self) -> usize {
        self.k as usize
    }

    fn u(&self) -> usize {
        self.u as usize
    }

    fn height(&self) -> usize {
        self.height as usize
    }

    fn side(&self) -> usize {
        self.side as usize
    }

    fn rows(&self) -> Range<usize> {
        self.row as usize..(self.row + self.u) as usize
    }

    fn panel(&self) -> Range<usize> {
        self.value..self.value + self.height() * self.k()
    }
}

impl Fronts {
    /// The structure for unknowns eliminated at `place`, in supernodes given by their first pivots and the rows below (as
    /// places, ascending). `entries` are the stored (row, column) of the matrix. None if the factor is too large.
    pub(super) fn new<T: Scalar>(
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
                height: 0,
                side: 0,
            });
            rows.extend(below);
        }
        let mut owner = vec![0_u32; n];
        let mut values = 0;
        for (s, node) in nodes.iter_mut().enumerate() {
            let padded = |n: usize| n.next_multiple_of(T::PAD);
            node.height = padded(node.k() + node.u()).max(node.k() + padded(node.u())) as u32;
            node.side = padded(node.u()) as u32;
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
            let size = node.side() * node.side();
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
    pub(super) fn factor<T: Scalar>(&self, entries: &[f64], values: &mut [T], stack: &mut Vec<T>) -> Result<(), usize> {
        stack.resize(self.stack, T::default());
        pulp::Arch::new().dispatch(Factor { fronts: self, entries, values, stack })
    }

    /// Pivots (diagonal entries of L) in the order of elimination.
    pub(super) fn pivots<'a, T: Scalar>(&'a self, values: &'a [T]) -> impl Iterator<Item = f64> + 'a {
        self.supernodes.iter().flat_map(|it| (0..it.k()).map(|c| values[it.value + c * (it.height() + 1)].to_f64()))
    }

    /// The unknown that is eliminated at `place`.
    pub(super) fn unknown(&self, place: usize) -> usize {
        self.place.iter().position(|&it| it as usize == place).unwrap_or(place)
    }

    /// Solves L Lᵀ x = b for each column of length n in `columns`, in place.
    pub(super) fn solve<T: Scalar>(&self, values: &[T], columns: &mut [f64]) {
        pulp::Arch::new().dispatch(Solve { fronts: self, values, columns });
    }
}

struct Factor<'a, T> {
    fronts: &'a Fronts,
    entries: &'a [f64],
    values: &'a mut [T],
    stack: &'a mut [T],
}

impl<T: Scalar> WithSimd for Factor<'_, T> {
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
            panel.fill(T::default());
            let [from, to] = node.entries;
            for &(number, at) in &fronts.assembly[from as usize..to as usize] {
                panel[at as usize] += T::from_f64(entries[number as usize]);
            }
            let (height, side) = (node.height(), node.side());
            let (below, rest) = stack.split_at_mut(top);
            let update = &mut rest[..side * side];
            update.fill(T::default());
            let first_child = waiting.len() - node.children as usize;
            for &(child, at) in &waiting[first_child..] {
                let into = &fronts.in_parent[child.rows()];
                add_child(&below[at..], child.side(), into, (&mut *panel, node.k(), height), (&mut *update, side));
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
fn add_child<T: Scalar>(
    child: &[T],
    side: usize,
    into: &[u32],
    (panel, k, height): (&mut [T], usize, usize),
    (update, update_side): (&mut [T], usize),
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

struct Solve<'a, T> {
    fronts: &'a Fronts,
    values: &'a [T],
    columns: &'a mut [f64],
}

impl<T: Scalar> WithSimd for Solve<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { fronts, values, columns } = self;
        let n = fronts.size();
        let most = fronts.supernodes.iter().map(|it| it.height()).max().unwrap_or(0);
        let (mut x, mut local) = (vec![T::default(); n], vec![T::default(); most]);
        for column in columns.chunks_exact_mut(n) {
            for (&place, &b) in fronts.place.iter().zip(&*column) {
                x[place as usize] = T::from_f64(b);
            }
            for node in &fronts.supernodes {
                forward(simd, node, &fronts.rows[node.rows()], &values[node.panel()], &mut x, &mut local);
            }
            for node in fronts.supernodes.iter().rev() {
                backward(simd, node, &fronts.rows[node.rows()], &values[node.panel()], &mut x, &mut local);
            }
            for (&place, b) in fronts.place.iter().zip(column) {
                *b = x[place as usize].to_f64();
            }
        }
    }
}

/// Lx = b for the columns of one supernode.
#[inline(always)]
fn forward<T: Scalar, S: Simd>(simd: S, node: &Supernode, rows: &[u32], panel: &[T], x: &mut [T], local: &mut [T]) {
    let (k, height) = (node.k(), node.height());
    let first = node.first as usize;
    let local = &mut local[..height];
    local[..k].copy_from_slice(&x[first..first + k]);
    local[k..].fill(T::default());
    for (c, column) in panel.chunks_exact(height).enumerate() {
        let value = local[c] / column[c];
        // Whole vectors from the one that holds the diagonal on: what lies above it is zero in L.
        let start = c / T::PAD * T::PAD;
        let factor = T::splat(simd, -value);
        let (target, _) = T::vectors_mut::<S>(&mut local[start..]);
        for (t, s) in target.iter_mut().zip(T::vectors::<S>(&column[start..]).0) {
            *t = T::mul_add(simd, factor, *s, *t);
        }
        let tail = height / T::lanes::<S>() * T::lanes::<S>();
        for r in tail.max(start)..height {
            local[r] -= value * column[r];
        }
        local[c] = value;
    }
    x[first..first + k].copy_from_slice(&local[..k]);
    for (&row, &value) in rows.iter().zip(&local[k..]) {
        x[row as usize] += value;
    }
}

/// Lᵀx = b for the columns of one supernode.
#[inline(always)]
fn backward<T: Scalar, S: Simd>(simd: S, node: &Supernode, rows: &[u32], panel: &[T], x: &mut [T], local: &mut [T]) {
    let (k, height) = (node.k(), node.height());
    let first = node.first as usize;
    let local = &mut local[..height];
    local[..k].copy_from_slice(&x[first..first + k]);
    for (value, &row) in local[k..].iter_mut().zip(rows) {
        *value = x[row as usize];
    }
    local[k + rows.len()..].fill(T::default());
    for (c, column) in panel.chunks_exact(height).enumerate().rev() {
        let value = local[c];
        local[c] = T::default();
        let start = c / T::PAD * T::PAD;
        let (xs, x_rest) = T::vectors::<S>(&local[start..]);
        let (ls, l_rest) = T::vectors::<S>(&column[start..]);
        let mut sum = T::splat(simd, T::default());
        for (a, b) in xs.iter().zip(ls) {
            sum = T::mul_add(simd, *a, *b, sum);
        }
        let mut dot = T::sum(simd, sum);
        for (&a, &b) in x_rest.iter().zip(l_rest) {
            dot += a * b;
        }
        local[c] = (value - dot) / column[c];
    }
    x[first..first + k].copy_from_slice(&local[..k]);
}
