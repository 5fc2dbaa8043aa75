//! Parts and sheets as bits: a conservative picture on a grid of cells, searched 64 positions at a time.
//!
//! A cell counts as covered as soon as the closed part touches it. A sheet stores parts grown by the gap, a candidate is
//! tested as it is; where no covered cell coincides, the true distance is at least the gap.
use crate::geom::{Box2, Vec2, polygon::edges};

/// Covered cells of one row, from the first to before the second.
pub(super) type Run = (i32, i32);

/// Cells within `reach` of a region, row by row.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Cover {
    /// Row of the first entry.
    pub(super) first: i32,
    /// Sorted, disjoint runs of each row.
    pub(super) rows: Vec<Vec<Run>>,
}

/// Strips of cells overlap by this when edges are cut to them, mm: an edge on a cell boundary is in neither strip
/// otherwise when rounding goes against it.
const ROUNDING: f64 = 1e-9;

impl Cover {
    /// Cells of side `cell` that come within `reach` of the region bounded by `contours` (even-odd rule).
    pub(super) fn new(contours: &[Vec<Vec2>], cell: f64, reach: f64) -> Self {
        let bounds = Box2::of(contours.iter().flatten()).grown(reach);
        let first = index(bounds.min.y / cell);
        let last = index(bounds.max.y / cell);
        let mut rows: Vec<Vec<Run>> = vec![Vec::new(); (last - first + 1) as usize];
        let mut crossings: Vec<Vec<f64>> = vec![Vec::new(); rows.len()];
        for (a, b) in contours.iter().flat_map(|it| edges(it)) {
            for row in index((a.y.min(b.y) - reach) / cell)..=index((a.y.max(b.y) + reach) / cell) {
                let k = (row - first) as usize;
                let strip = [f64::from(row) * cell - ROUNDING, f64::from(row + 1) * cell + ROUNDING];
                if let Some([left, right]) = extent(a, b, reach, strip) {
                    rows[k].push((index(left / cell), index(right / cell) + 1));
                }
                let middle = (f64::from(row) + 0.5) * cell;
                if (a.y > middle) != (b.y > middle) {
                    crossings[k].push(a.x + (b.x - a.x) * (middle - a.y) / (b.y - a.y));
                }
            }
        }
        // What no edge touches is inside or outside as a whole, so its middle line decides.
        for (runs, mut crossings) in rows.iter_mut().zip(crossings) {
            crossings.sort_by(f64::total_cmp);
            runs.extend(crossings.chunks_exact(2).map(|it| (index(it[0] / cell), index(it[1] / cell) + 1)));
            merge(runs);
        }
        Self { first, rows }
    }
}

fn index(cells: f64) -> i32 {
    cells.floor() as i32
}

/// Sorts runs and joins those that touch.
fn merge(runs: &mut Vec<Run>) {
    runs.sort_unstable();
    let mut joined: Vec<Run> = Vec::with_capacity(runs.len());
    for &(from, to) in runs.iter() {
        match joined.last_mut() {
            Some(last) if from <= last.1 => last.1 = last.1.max(to),
            _ => joined.push((from, to)),
        }
    }
    *runs = joined;
}

/// Range of x of the points within `reach` of segment `a b` whose y lies in `strip`.
fn extent(a: Vec2, b: Vec2, reach: f64, strip: [f64; 2]) -> Option<[f64; 2]> {
    let mut range = [f64::INFINITY, f64::NEG_INFINITY];
    let mut grow = |x: f64| range = [range[0].min(x), range[1].max(x)];
    let mut clip = |p: Vec2, q: Vec2| {
        let (low, high) = if p.y <= q.y { (p, q) } else { (q, p) };
        if low.y > strip[1] || high.y < strip[0] {
            return;
        }
        let at = |y: f64| {
            if high.y == low.y {
                low.x
            } else {
                low.x + (high.x - low.x) * ((y - low.y) / (high.y - low.y)).clamp(0.0, 1.0)
            }
        };
        grow(at(low.y.max(strip[0])));
        grow(at(high.y.min(strip[1])));
        if high.y == low.y {
            grow(high.x);
        }
    };
    if reach == 0.0 {
        clip(a, b);
    } else {
        // The stadium around the segment: its two long sides, its two short ones, and a disk at each end.
        let side = (b - a).try_normalize(0.0).map_or_else(Vec2::zeros, |it| Vec2::new(-it.y, it.x) * reach);
        for (p, q) in [(a + side, b + side), (a - side, b - side), (a - side, a + side), (b - side, b + side)] {
            clip(p, q);
        }
        for center in [a, b] {
            let dy = (strip[0] - center.y).max(center.y - strip[1]).max(0.0);
            if dy <= reach {
                let dx = (reach * reach - dy * dy).sqrt();
                grow(center.x - dx);
                grow(center.x + dx);
            }
        }
    }
    (range[0] <= range[1]).then_some(range)
}

/// A part at one angle, its box at the origin.
#[derive(Debug, Clone)]
pub(super) struct Stamp {
    /// Radians, counter-clockwise.
    pub(super) angle: f64,
    /// Lower left corner of the turned part's box before it was moved to the origin, mm.
    pub(super) corner: Vec2,
    /// Extent, mm.
    pub(super) size: Vec2,
    /// The part itself.
    solid: Cover,
    /// The part grown by the gap.
    grown: Cover,
    /// Rows of `solid` in the order in which they are tested: far apart first, so that a blocked place shows early.
    order: Vec<usize>,
}

impl Stamp {
    /// Rasterises contours that have been turned already.
    pub(super) fn new(mut contours: Vec<Vec<Vec2>>, angle: f64, cell: f64, gap: f64) -> Self {
        let bounds = Box2::of(contours.iter().flatten());
        for p in contours.iter_mut().flatten() {
            *p -= bounds.min;
        }
        let solid = Cover::new(&contours, cell, 0.0);
        let mut order = Vec::with_capacity(solid.rows.len());
        let mut step = solid.rows.len().next_power_of_two();
        while step > 0 {
            order.extend((step / 2..solid.rows.len()).step_by(step));
            step /= 2;
        }
        order.retain({
            let mut seen = vec![false; solid.rows.len()];
            move |&row| !std::mem::replace(&mut seen[row], true)
        });
        Self { angle, corner: bounds.min, size: bounds.size(), grown: Cover::new(&contours, cell, gap), solid, order }
    }
}

/// A sheet less its margins as rows of bits, set where a part grown by the gap lies.
#[derive(Debug, Clone)]
pub(super) struct Grid {
    size: Vec2,
    cell: f64,
    columns: usize,
    rows: usize,
    words: usize,
    /// Level k holds, at bit x, whether any of the 2^k cells from x on is covered; level 0 is the picture itself.
    levels: Vec<Vec<u64>>,
    /// Rows from here up are empty.
    used: usize,
}

/// A place found on a grid, in cells.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Place {
    pub(super) column: usize,
    pub(super) row: usize,
}

impl Grid {
    /// An empty sheet of that usable size.
    pub(super) fn new(size: Vec2, cell: f64) -> Self {
        let count = |extent: f64| (extent / cell).ceil().max(1.0) as usize;
        let (columns, rows) = (count(size.x), count(size.y));
        // One word more than needed, so that a shifted row can be read without a bound in the loop.
        let words = columns.div_ceil(64) + 1;
        let levels = vec![vec![0; words * rows]; columns.next_power_of_two().ilog2() as usize + 2];
        Self { size, cell, columns, rows, words, levels, used: 0 }
    }

    /// The lowest place for a stamp, the leftmost of them, and the height of its top there, if that is below `limit` mm.
    pub(super) fn lowest(&self, stamp: &Stamp, limit: f64) -> Option<(Place, f64)> {
        let free = self.size - stamp.size;
        if free.x < 0.0 || free.y < 0.0 {
            return None;
        }
        let last_column = (free.x / self.cell) as usize;
        let last_row = (free.y / self.cell) as usize;
        let width = last_column / 64 + 1;
        let beyond = !0_u64 << (last_column % 64) << 1;
        let mut blocked = vec![0_u64; width];
        for row in 0..=last_row {
            let top = row as f64 * self.cell + stamp.size.y;
            if top >= limit {
                return None;
            }
            blocked.fill(0);
            // Columns where the stamp would leave the sheet count as blocked.
            blocked[width - 1] = beyond;
            if let Some(column) = self.first_free(stamp, row, &mut blocked) {
                return Some((Place { column, row }, top));
            }
        }
        None
    }

    /// First column at which the stamp's lower row may stand at `row`; `blocked` comes with the columns that may not be.
    fn first_free(&self, stamp: &Stamp, row: usize, blocked: &mut [u64]) -> Option<usize> {
        for (tested, &k) in stamp.order.iter().enumerate() {
            let at = row + k;
            if at < self.used {
                for &(from, to) in &stamp.solid.rows[k] {
                    self.block(at, from.max(0) as usize, to as usize, blocked);
                }
            }
            if tested % 4 == 3 && blocked.iter().all(|&word| word == !0) {
                return None;
            }
        }
        let word = blocked.iter().position(|&word| word != !0)?;
        Some(64 * word + blocked[word].trailing_ones() as usize)
    }

    /// Adds to `blocked` the offsets at which a run of cells meets a covered cell of a row: the run is the union of two
    /// windows whose width is a power of two.
    fn block(&self, row: usize, from: usize, to: usize, blocked: &mut [u64]) {
        let level = (to - from).ilog2() as usize;
        let line = &self.levels[level][row * self.words..(row + 1) * self.words];
        for shift in [from, to - (1 << level)] {
            let (skip, bits) = (shift / 64, shift % 64);
            let source = &line[skip.min(line.len())..];
            if bits == 0 {
                blocked.iter_mut().zip(source).for_each(|(b, s)| *b |= s);
            } else {
                let high = source.iter().skip(1).chain(std::iter::once(&0));
                blocked
                    .iter_mut()
                    .zip(source.iter().zip(high))
                    .for_each(|(b, (l, h))| *b |= l >> bits | h << (64 - bits));
            }
        }
    }

    /// Marks a stamp as lying at a place.
    pub(super) fn put(&mut self, stamp: &Stamp, place: Place) {
        let (dx, dy) = (place.column as i32, place.row as i32 + stamp.grown.first);
        for (k, runs) in stamp.grown.rows.iter().enumerate() {
            let row = dy + k as i32;
            if row < 0 || row >= self.rows as i32 {
                continue;
            }
            let row = row as usize;
            self.used = self.used.max(row + 1);
            for &(from, to) in runs {
                let from = (from + dx).max(0) as usize;
                let to = ((to + dx).max(0) as usize).min(self.columns);
                for x in from..to {
                    self.levels[0][row * self.words + x / 64] |= 1 << (x % 64);
                }
            }
            self.smear(row);
        }
    }

    /// Recomputes the upper levels of a row: a window of 2^(k+1) is two windows of 2^k.
    fn smear(&mut self, row: usize) {
        for k in 1..self.levels.len() {
            let (below, above) = self.levels.split_at_mut(k);
            let source = &below[k - 1][row * self.words..(row + 1) * self.words];
            let target = &mut above[0][row * self.words..(row + 1) * self.words];
            let (skip, bits) = ((1_usize << (k - 1)) / 64, (1_usize << (k - 1)) % 64);
            for (i, slot) in target.iter_mut().enumerate() {
                let word = |at: usize| source.get(at).copied().unwrap_or(0);
                let low = word(i + skip) >> bits;
                let high = if bits == 0 { 0 } else { word(i + skip + 1) << (64 - bits) };
                *slot = source[i] | low | high;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::{
        polygon::{contains, turned},
        segment_tree::SegmentTree,
    };

    fn star(points: usize, radius: f64, turn: f64) -> Vec<Vec2> {
        let ring = |k: usize| {
            let r = if k.is_multiple_of(2) { radius } else { 0.45 * radius };
            turned(Vec2::new(r, 0.0), turn + std::f64::consts::PI * k as f64 / points as f64)
        };
        (0..2 * points).map(ring).collect()
    }

    /// A star with a hole, its box at the origin.
    fn ring() -> Vec<Vec<Vec2>> {
        let mut contours = vec![star(5, 20.0, 0.3), star(3, 6.0, 0.1).into_iter().rev().collect()];
        let corner = Box2::of(contours.iter().flatten()).min;
        contours.iter_mut().flatten().for_each(|p| *p -= corner);
        contours
    }

    #[test]
    fn covers_are_exactly_the_cells_within_reach() {
        let contours = ring();
        let tree = SegmentTree::of_contours(&contours);
        for (cell, reach) in [(1.3, 0.0), (0.7, 0.0), (0.9, 2.0)] {
            let cover = Cover::new(&contours, cell, reach);
            for row in -5..60 {
                for column in -5..60 {
                    let low = Vec2::new(f64::from(column), f64::from(row)) * cell;
                    let square =
                        [[0., 0.], [1., 0.], [1., 1.], [0., 1.]].map(|[x, y]| low + Vec2::new(x, y) * cell).to_vec();
                    let center = low.add_scalar(cell / 2.0);
                    let square_tree = SegmentTree::of_contours(&[square]);
                    let distance = square_tree.closest(&tree, f64::INFINITY).unwrap().0;
                    let near = contains(&contours, center) || distance <= reach;
                    let runs = (row - cover.first).try_into().ok().and_then(|k: usize| cover.rows.get(k));
                    let covered = runs.is_some_and(|it| it.iter().any(|&(a, b)| (a..b).contains(&column)));
                    assert!(covered == near || (distance - reach).abs() < 1e-6, "cell {column} {row} at {cell}");
                }
            }
        }
    }

    #[test]
    fn the_lowest_place_is_the_one_brute_force_finds() {
        let stamps: Vec<Stamp> =
            (0..6).map(|k| Stamp::new(vec![star(3 + k, 9.0 + k as f64, 0.2 * k as f64)], 0.0, 1.0, 1.5)).collect();
        let mut grid = Grid::new(Vec2::new(93.5, 61.2), 1.0);
        let mut picture = vec![vec![false; grid.columns]; grid.rows];
        for stamp in stamps.iter().cycle().take(14) {
            let fits = |column: usize, row: usize| {
                column as f64 + stamp.size.x <= 93.5
                    && row as f64 + stamp.size.y <= 61.2
                    && stamp.solid.rows.iter().enumerate().all(|(k, runs)| {
                        runs.iter().all(|&(a, b)| (a..b).all(|x| !picture[row + k][column + x as usize]))
                    })
            };
            let brute = (0..grid.rows)
                .flat_map(|row| (0..grid.columns).map(move |column| Place { column, row }))
                .find(|it| fits(it.column, it.row));
            let found = grid.lowest(stamp, f64::INFINITY).map(|it| it.0);
            assert_eq!(found, brute);
            let Some(place) = found else { continue };
            assert_eq!(grid.lowest(stamp, place.row as f64 + stamp.size.y), None);
            grid.put(stamp, place);
            for (k, runs) in stamp.grown.rows.iter().enumerate() {
                for x in runs.iter().flat_map(|&(a, b)| a..b) {
                    let (x, y) = (x + place.column as i32, k as i32 + stamp.grown.first + place.row as i32);
                    if let Some(slot) = usize::try_from(y).ok().and_then(|y| picture.get_mut(y))
                        && let Some(slot) = usize::try_from(x).ok().and_then(|x| slot.get_mut(x))
                    {
                        *slot = true;
                    }
                }
            }
        }
    }
}
