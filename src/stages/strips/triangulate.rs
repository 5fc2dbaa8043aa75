//! The interval dynamic programme over triangles: the decomposition of a disk by straight chords with the least error.
//!
//! A maximal set of chords that do not cross is a triangulation of the ring of samples; C(i, k), the least error of what
//! lies between the chord i k and the boundary from i to k, is min over j of C(i, j) + C(j, k) + cost(i, j, k).
use super::{
    border::{Border, Sum},
    chord::{Chord, Form},
    decompose::Terms,
    patch::Patch,
};
use crate::{
    geom::polyline::simplify,
    numeric::{Cancelled, Monitor},
};

/// Samples that the programme aims at: it is cubic, and what it leaves open is decided between all samples afterwards.
const TARGET: usize = 150;
/// Samples that it can take: its table is quadratic.
const MOST: usize = 2500;
/// Share of the outline's length below which its bends matter no more.
const FINEST: f64 = 1e-4;

/// Chords of the best triangulation, as pairs i < k of samples, without boundary edges; `None` when the region has no
/// triangulation by straight chords. Between neighbours of those that take part are at most `gap` samples.
pub(super) fn triangulation(
    patch: &Patch,
    form: &Form,
    border: &Border,
    gap: usize,
    terms: &Terms,
    monitor: &Monitor,
) -> Result<Option<Vec<(usize, usize)>>, Cancelled> {
    let n = border.len();
    let length: f64 = (0..n).map(|i| (border.uv[(i + 1) % n] - border.uv[i]).norm()).sum();
    let mut sagitta = length / TARGET as f64 / 4.0;
    let mut gap = if n <= TARGET { 1 } else { gap.min(n.div_ceil(TARGET)).max(1) };
    loop {
        let chosen = thinned(border, sagitta, gap);
        if chosen.len() > MOST {
            return Ok(None);
        }
        if let Some(chords) = Programme::new(patch, form, border, &chosen, true, terms, monitor)?.solve(monitor)? {
            return Ok(Some(chords));
        }
        if chosen.len() == border.len() {
            return Ok(None);
        }
        // Narrow places need the bends of the outline first, then samples on straight sides, too.
        sagitta /= 3.0;
        if sagitta < FINEST * length {
            gap = gap.div_ceil(3).min(gap - 1).max(1);
        }
    }
}

/// Chords of the best triangulation of a panel, by its samples: those inside it. `None` when there is none.
pub(super) fn within(
    patch: &Patch,
    form: &Form,
    border: &Border,
    outline: &[usize],
    terms: &Terms,
    monitor: &Monitor,
) -> Result<Option<Vec<(usize, usize)>>, Cancelled> {
    Programme::new(patch, form, border, outline, false, terms, monitor)?.solve(monitor)
}

/// Samples that keep the shape of the outline within `sagitta`, and others evenly between, at most `gap` apart.
fn thinned(border: &Border, sagitta: f64, gap: usize) -> Vec<usize> {
    let n = border.len();
    if gap == 1 {
        return (0..n).collect();
    }
    let corners = simplify(&border.uv, true, sagitta, &|i| i == 0);
    let mut chosen = Vec::new();
    for (k, &i) in corners.iter().enumerate() {
        let end = corners.get(k + 1).copied().unwrap_or(n);
        let parts = (end - i).div_ceil(gap);
        chosen.extend((0..parts).map(|p| i + (end - i) * p / parts));
    }
    // The edge from the last sample to the first is where the programme begins; it must be one of the boundary.
    if chosen[chosen.len() - 1] != n - 1 {
        chosen.push(n - 1);
    }
    chosen
}

struct Programme {
    /// The samples that take part.
    chosen: Vec<usize>,
    /// Sums from i to k, and what the chord costs; `None` where there is no chord.
    sums: Vec<Option<(Sum, f64)>>,
}

impl Programme {
    /// With `arcs`, what lies between samples that follow one another is bounded by the boundary, otherwise by a chord.
    fn new(
        patch: &Patch,
        form: &Form,
        border: &Border,
        chosen: &[usize],
        arcs: bool,
        terms: &Terms,
        monitor: &Monitor,
    ) -> Result<Self, Cancelled> {
        let n = chosen.len();
        let mut sums = vec![None; n * n];
        let mut scratch = Vec::new();
        for i in 0..n {
            monitor.check()?;
            for k in i + 1..n {
                let (a, b) = (chosen[i], chosen[k]);
                sums[i * n + k] = if b == a + 1 || (arcs && k == i + 1) {
                    Some((border.arc(a, b), 0.0))
                } else if a == 0 && b == border.len() - 1 {
                    Some((border.back(b), 0.0))
                } else {
                    let chord = Chord::trace(patch, form, border.vertices[a], border.vertices[b], &mut scratch);
                    chord.map(|it| (border.straight(&it, a, b), terms.of_chord(&it)))
                };
            }
        }
        Ok(Self { chosen: chosen.to_vec(), sums })
    }

    fn solve(&self, monitor: &Monitor) -> Result<Option<Vec<(usize, usize)>>, Cancelled> {
        let n = self.chosen.len();
        // Least errors by row and by column, so that both terms of the inner loop are read in order.
        let mut rows = vec![f64::INFINITY; n * n];
        let mut columns = vec![f64::INFINITY; n * n];
        let mut apex = vec![0_u32; n * n];
        for i in 0..n - 1 {
            rows[i * n + i + 1] = 0.0;
            columns[(i + 1) * n + i] = 0.0;
        }
        for span in 2..n {
            monitor.check()?;
            for i in 0..n - span {
                let k = i + span;
                let Some((outer, own)) = self.sums[i * n + k] else { continue };
                let mut best = f64::INFINITY;
                for j in i + 1..k {
                    let inner = rows[i * n + j] + columns[k * n + j];
                    if inner >= best {
                        continue;
                    }
                    let (Some(left), Some(right)) = (self.sums[i * n + j], self.sums[j * n + k]) else { continue };
                    let total = inner + (left.0 + right.0 - outer).cost();
                    if total < best {
                        best = total;
                        apex[i * n + k] = j as u32;
                    }
                }
                rows[i * n + k] = best + own;
                columns[k * n + i] = best + own;
            }
        }
        if !rows[n - 1].is_finite() {
            return Ok(None);
        }
        let mut chords = Vec::new();
        let mut stack = vec![(0, n - 1)];
        while let Some((i, k)) = stack.pop() {
            let j = apex[i * n + k] as usize;
            for (a, b) in [(i, j), (j, k)] {
                if b > a + 1 {
                    chords.push((self.chosen[a], self.chosen[b]));
                    stack.push((a, b));
                }
            }
        }
        Ok(Some(chords))
    }
}
