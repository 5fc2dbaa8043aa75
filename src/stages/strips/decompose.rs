//! The interval dynamic programme over panels: strips of planar quadrilaterals, fans, branches and caps between all
//! samples, in a band around the chords of a triangulation.
//!
//! State (i, k), i < k: a chord with everything between it and the boundary from i to k. It is closed by a cap (the whole
//! arc), or by a panel up to another chord (i + a, k − b), or it branches at a sample j into (i, j) and (j, k). Samples
//! that a panel skips stay vertices of its outline, so that the outline is the true seam.
use super::{
    border::{Border, Sum, is_convex, warp},
    chord::{Chord, Form},
    patch::{NONE, Patch},
};
use crate::numeric::{Cancelled, Monitor};

/// What panels must keep and what they cost.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Terms {
    /// Half the thickness that the outline of a panel may have, mm.
    pub(super) tolerance: f64,
    /// Largest planarity of a quadrilateral.
    pub(super) planarity: f64,
    /// Chosen samples that a panel may take on either side.
    pub(super) reach: usize,
    /// Chosen samples between a chord of the guide and one that replaces it, at each end.
    pub(super) band: usize,
}

/// Price of a panel in units of (8 × tolerance)²: a panel of width w whose sagitta is the tolerance turns the normal by
/// θ = 8 tolerance / w, and its error A θ² / 12 is of that size where it is as long as five to ten times its width. So
/// panels are as wide as the tolerance allows where the surface is smooth, and narrower where it is not.
const PANEL: f64 = 1.0;
/// What a triangle costs on top, in panels: strips of quadrilaterals are worth more than fans.
const TRIANGLE: f64 = 3.0;
/// What a chord costs, in panels, by the square of its distance from the surface, in tolerances, above one. Nearer ones
/// cost nothing for it: the largest distance is where noise shows most, and would turn chords out of the rulings.
const BOW: f64 = 5.0;
/// A chord that is this share of its length away from the surface costs a panel; it is shorter than the surface by
/// 8/3 of the square.
const SHALLOW: f64 = 0.01;
/// What a panel costs, in panels, that cannot be avoided and is as thick as the tolerance.
const THICK: f64 = 1.0;
/// Weight of the twist of a quadrilateral, squared, over its area. Facets say little about the direction of a ruling;
/// whether four points of the outline are in a plane says more.
const TWIST: f64 = 1.0;

impl Terms {
    /// Price of a panel, mm².
    fn price(&self) -> f64 {
        PANEL * (8.0 * self.tolerance).powi(2)
    }

    /// What a chord costs by itself, mm².
    pub(super) fn of_chord(&self, chord: &Chord) -> f64 {
        let bow = (chord.bow / self.tolerance).powi(2);
        let shallow = SHALLOW * chord.length.max(f64::MIN_POSITIVE);
        self.price() * (BOW * (bow - 1.0).max(0.0) + (chord.bow / shallow).powi(2))
    }
}

/// How a state is continued.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Step {
    Cap,
    Strip(u16, u16),
    Branch(u32),
}

#[derive(Debug, Clone, Copy)]
struct State {
    ends: [u32; 2],
    chord: Chord,
    sum: Sum,
    cost: f64,
    step: Step,
}

/// The panels between chords of a ring of samples.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Decomposition {
    /// Samples of each panel, ascending: that is counter-clockwise.
    pub(super) panels: Vec<Vec<usize>>,
    pub(super) chords: Vec<Link>,
}

/// A chord between two panels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Link {
    /// Samples i < k.
    pub(super) ends: [usize; 2],
    pub(super) chord: Chord,
    /// The panel on its left (towards the samples outside i … k), and the one on its right.
    pub(super) panels: [usize; 2],
}

impl Decomposition {
    /// Panels of `n` samples between chords that do not interleave. O(n + chords log chords).
    pub(super) fn new(n: usize, chords: impl IntoIterator<Item = ([usize; 2], Chord)>) -> Self {
        let mut chords: Vec<Link> =
            chords.into_iter().map(|(ends, chord)| Link { ends, chord, panels: [0; 2] }).collect();
        // By first end, and the widest first, so that a chord comes before those inside it.
        chords.sort_by_key(|it| (it.ends[0], std::cmp::Reverse(it.ends[1])));
        let mut first = vec![chords.len(); n + 1];
        for (c, link) in chords.iter().enumerate().rev() {
            first[link.ends[0]] = c;
        }
        let mut panels = Vec::with_capacity(chords.len() + 1);
        // The panel to the right of a chord, or of the whole ring: along the outermost chords inside it.
        for inside in std::iter::once(None).chain((0..chords.len()).map(Some)) {
            let panel = panels.len();
            let [low, high] = inside.map_or([0, n - 1], |c| chords[c].ends);
            let mut outline = vec![low];
            let mut at = low;
            while at < high {
                let mut c = if at == low { inside.map_or(first[at], |it| it + 1) } else { first[at] };
                while chords.get(c).is_some_and(|it| it.ends[0] == at && it.ends[1] > high) {
                    c += 1;
                }
                match chords.get_mut(c).filter(|it| it.ends[0] == at) {
                    Some(link) => {
                        link.panels[0] = panel;
                        at = link.ends[1];
                    }
                    None => at += 1,
                }
                outline.push(at);
            }
            if let Some(c) = inside {
                chords[c].panels[1] = panel;
            }
            panels.push(outline);
        }
        Self { panels, chords }
    }
}

impl Decomposition {
    /// How much the surface bends along the chords, in shares of how much it bends in all. A line of length L whose middle
    /// is b off turns the normal by 8 b / L, which varies by (8 b / L)² / 12 along it; the mean of that, weighted by
    /// length, over the variance of the normals in the whole disk. 0 on a developable surface, whatever the noise of its
    /// facets; about a third on a sphere.
    pub(super) fn residual(&self, whole: &Sum) -> f64 {
        let length: f64 = self.chords.iter().map(|it| it.chord.length).sum();
        let turn = |chord: &Chord| 8.0 * chord.bow / chord.length;
        let along: f64 = self.chords.iter().map(|it| it.chord.length * turn(&it.chord).powi(2) / 12.0).sum();
        (along / length.max(f64::MIN_POSITIVE)) / (whole.cost() / whole.flux.area).max(f64::MIN_POSITIVE)
    }
}

/// The best decomposition with chords between the `chosen` samples (ascending, the first and the last of all among them)
/// in a band around the chords of `guide`, and what it costs, mm²; `None` when there is none.
pub(super) fn decompose(
    patch: &Patch,
    form: &Form,
    border: &Border,
    chosen: Vec<usize>,
    guide: &[(usize, usize)],
    terms: &Terms,
    monitor: &Monitor,
) -> Result<Option<(Decomposition, f64)>, Cancelled> {
    let mut programme = Programme::new(patch, form, border, chosen, guide, terms, monitor)?;
    for at in 0..programme.states.len() {
        if at % 256 == 0 {
            monitor.check()?;
        }
        programme.settle(at);
    }
    Ok(programme.read())
}

struct Programme<'a> {
    border: &'a Border,
    /// Samples that chords may end in; states count in these.
    chosen: Vec<usize>,
    terms: &'a Terms,
    price: f64,
    /// Ascending in the length of the arc; the last one is the boundary edge from the last sample to the first.
    states: Vec<State>,
    /// State of a pair of samples.
    at: Vec<u32>,
    /// Second ends of the states of each sample, ascending.
    partners: Vec<Vec<u32>>,
}

impl<'a> Programme<'a> {
    fn new(
        patch: &Patch,
        form: &Form,
        border: &'a Border,
        chosen: Vec<usize>,
        guide: &[(usize, usize)],
        terms: &'a Terms,
        monitor: &Monitor,
    ) -> Result<Self, Cancelled> {
        let n = chosen.len();
        let mut wanted = vec![false; n * n];
        let around = |at: usize| at.saturating_sub(terms.band)..(at + terms.band + 1).min(n);
        let nearest = |sample: usize| chosen.partition_point(|&it| it < sample);
        for &(i, k) in guide {
            for a in around(nearest(i)) {
                for b in around(nearest(k)).filter(|&b| b > a + 1) {
                    wanted[a * n + b] = true;
                }
            }
        }
        wanted[n - 1] = false;
        let mut at = vec![NONE; n * n];
        let mut states = Vec::new();
        let mut partners = vec![Vec::new(); n];
        let mut scratch = Vec::new();
        let mut push = |i: usize, k: usize, chord: Chord, sum: Sum| {
            at[i * n + k] = states.len() as u32;
            partners[i].push(k as u32);
            let ends = [i as u32, k as u32];
            states.push(State { ends, chord, sum, cost: f64::INFINITY, step: Step::Cap });
        };
        for span in 2..n {
            monitor.check()?;
            for i in (0..n - span).filter(|&i| wanted[i * n + i + span]) {
                let (a, b) = (chosen[i], chosen[i + span]);
                let chord = Chord::trace(patch, form, border.vertices[a], border.vertices[b], &mut scratch);
                if let Some(chord) = chord {
                    push(i, i + span, chord, border.straight(&chord, a, b));
                }
            }
        }
        let closing = border.back(border.len() - 1);
        let edge = Chord { flux: closing.flux, length: 0.0, surface: 0.0, bow: 0.0, spread: 0.0 };
        push(0, n - 1, edge, closing);
        Ok(Self { border, chosen, terms, price: terms.price(), states, at, partners })
    }

    fn state(&self, i: usize, k: usize) -> Option<&State> {
        let at = self.at[i * self.chosen.len() + k];
        (at != NONE).then(|| &self.states[at as usize])
    }

    /// Price of thickness where a panel cannot be avoided: none within the tolerance.
    fn excess(&self, sum: &Sum, samples: impl Iterator<Item = usize>) -> f64 {
        let size = sum.flux.area.max(0.0).sqrt();
        let thickness = self.thickness(sum, samples);
        let share = thickness / self.terms.tolerance.min(self.terms.planarity * size).max(f64::MIN_POSITIVE);
        if share <= 1.0 { 0.0 } else { THICK * self.price * share * share }
    }

    fn thickness(&self, sum: &Sum, samples: impl Iterator<Item = usize>) -> f64 {
        match sum.newell.try_normalize(0.0) {
            Some(normal) => self.border.thickness(normal, samples),
            None => 0.0,
        }
    }

    fn settle(&mut self, at: usize) {
        let State { ends, sum, chord, .. } = self.states[at];
        let (i, k) = (ends[0] as usize, ends[1] as usize);
        let own = self.terms.of_chord(&chord);
        let mut best = (f64::INFINITY, Step::Cap);
        self.cap(i, k, &sum, &mut best);
        self.strips(i, k, &sum, &mut best);
        self.branches(i, k, &sum, &mut best);
        self.states[at].cost = best.0 + own;
        self.states[at].step = best.1;
    }

    fn cap(&self, i: usize, k: usize, outer: &Sum, best: &mut (f64, Step)) {
        let (first, last) = (self.chosen[i], self.chosen[k]);
        let region = self.border.arc(first, last) - *outer;
        let cost = region.cost() + self.price;
        let small = k - i <= self.terms.reach;
        if cost >= best.0 || (!small && k - i > 4 * self.terms.reach) {
            return;
        }
        let excess = self.excess(&region, first..=last);
        if small || excess == 0.0 {
            let total = cost + excess;
            if total < best.0 {
                *best = (total, Step::Cap);
            }
        }
    }

    fn strips(&self, i: usize, k: usize, outer: &Sum, best: &mut (f64, Step)) {
        let (border, chosen) = (self.border, &self.chosen);
        for a in 0..=self.terms.reach.min(k - i - 2) {
            for b in usize::from(a == 0)..=self.terms.reach.min(k - i - 2 - a) {
                let (p, q) = (i + a, k - b);
                let Some(inner) = self.state(p, q) else { continue };
                let triangle = a == 0 || b == 0;
                let least = inner.cost + self.price * if triangle { 1.0 + TRIANGLE } else { 1.0 };
                if least >= best.0 {
                    continue;
                }
                let corners = [i, p, q, k].map(|it| chosen[it]);
                let region =
                    border.arc(corners[0], corners[1]) + inner.sum + border.arc(corners[2], corners[3]) - *outer;
                let cost = least + region.cost();
                if cost >= best.0 {
                    continue;
                }
                let samples = (corners[0]..=corners[1]).chain(corners[2]..=corners[3]);
                let total = if triangle {
                    cost + self.excess(&region, samples)
                } else {
                    let [height, diagonal] = warp(corners.map(|it| border.xyz[it]));
                    if height > self.terms.planarity * diagonal {
                        continue;
                    }
                    // Twist: how far the two rulings turn against each other, over the width of the panel.
                    let total = cost + TWIST * (height * inner.chord.length).powi(2) / region.flux.area;
                    let fits = total < best.0
                        && is_convex(corners.map(|it| border.uv[it]))
                        && self.thickness(&region, samples) <= self.terms.tolerance;
                    if fits { total } else { f64::INFINITY }
                };
                if total < best.0 {
                    *best = (total, Step::Strip(a as u16, b as u16));
                }
            }
        }
    }

    fn branches(&self, i: usize, k: usize, outer: &Sum, best: &mut (f64, Step)) {
        let extra = self.price * (1.0 + TRIANGLE);
        for &j in self.partners[i].iter().filter(|&&j| (j as usize) < k) {
            let (Some(left), Some(right)) = (self.state(i, j as usize), self.state(j as usize, k)) else { continue };
            let least = left.cost + right.cost + extra;
            if least >= best.0 {
                continue;
            }
            let total = least + (left.sum + right.sum - *outer).cost();
            if total < best.0 {
                *best = (total, Step::Branch(j));
            }
        }
    }

    fn read(&self) -> Option<(Decomposition, f64)> {
        let root = self.states.last().filter(|it| it.cost.is_finite())?;
        let mut chords = Vec::new();
        let mut stack = vec![root];
        while let Some(state) = stack.pop() {
            let (i, k) = (state.ends[0] as usize, state.ends[1] as usize);
            let inner: &[(usize, usize)] = match state.step {
                Step::Cap => &[],
                Step::Strip(a, b) => &[(i + a as usize, k - b as usize)],
                Step::Branch(j) => &[(i, j as usize), (j as usize, k)],
            };
            for &(a, b) in inner {
                let next = self.state(a, b)?;
                chords.push(([a, b].map(|it| self.chosen[it]), next.chord));
                stack.push(next);
            }
        }
        Some((Decomposition::new(self.border.len(), chords), root.cost))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stages::strips::chord::Flux;

    #[test]
    fn panels_between_chords() {
        let chord = Chord { flux: Flux::default(), length: 1.0, surface: 1.0, bow: 0.0, spread: 0.0 };
        let made = Decomposition::new(9, [[3, 7], [3, 5], [0, 3], [5, 7]].map(|ends| (ends, chord)));
        assert_eq!(made.panels, [vec![0, 3, 7, 8], vec![0, 1, 2, 3], vec![3, 5, 7], vec![3, 4, 5], vec![5, 6, 7]],);
        let links: Vec<_> = made.chords.iter().map(|it| (it.ends, it.panels)).collect();
        assert_eq!(links, [([0, 3], [0, 1]), ([3, 7], [0, 2]), ([3, 5], [2, 3]), ([5, 7], [2, 4])]);
    }
}
