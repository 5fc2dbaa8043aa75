//! In how many levels each panel of a strip is cut, and which way round the cutter is in each.
//!
//! The side of a cutter is straight, and a ruling of a developed mesh is not quite: over a ruling of length L that bows by b
//! the middle of a chord or the ends of a tangent are b away, over one of n levels b / n². Levels are doubled until a posture
//! leaves little enough. The tip is at the lower end of its level, so that over a hollow ruling the cutter leans out.
use super::{
    Machine, Options,
    curve::{Curve, turns},
    guard::{Guard, Obstacle},
    lines::Band,
    plan::Bar,
    posture::Posture,
};
use crate::model::{CutMesh, PieceId};

/// Levels of a strip at most, times those that the length of the cutting edges asks for.
const MOST_LEVELS: usize = 32;
/// Levels are not lower than this, mm.
const LOWEST: f64 = 1.0;
/// Of the excess that is allowed, what a posture may leave: the rest is for the way between postures.
const SHARE: f64 = 0.6;
/// Shares of a panel at which postures are tried.
const TRIED: [f64; 2] = [0.25, 0.75];

type Found = Result<Posture, Obstacle>;

/// A panel with the cutter one way round.
struct Way {
    levels: usize,
    /// Those tried in each level, from P on; P and Q are those of the panel, whichever way round the cutter is.
    postures: Vec<[Found; 2]>,
}

struct Panel {
    /// About its area, mm².
    weight: f64,
    /// Length of its longest ruling, mm.
    longest: f64,
    /// The most levels that it has been cut in.
    finest: usize,
    /// One for each of the first curves of the trial.
    ways: Vec<Way>,
}

/// A strip with the cutter both ways round.
pub(super) struct Trial<'a> {
    pub(super) piece: PieceId,
    pub(super) band: &'a Band<'a>,
    /// Overhangs and directions, the preferred one first; over no panels.
    wholes: Vec<Curve<'a>>,
    panels: Vec<Panel>,
}

/// A part of a panel: how many levels the panel has, which of the wholes cuts each of them.
type Choice = (usize, Vec<usize>);

impl<'a> Trial<'a> {
    pub(super) fn new(piece: PieceId, band: &'a Band<'a>, cut: &CutMesh, guard: &Guard<'_>, options: &Options) -> Self {
        let overhangs = match options.machine {
            Machine::Mill(_) => vec![options.overhang, 0.0],
            // Half the wire lies on either side, however long the ruling.
            Machine::Wire(_) => vec![guard.tool.flute / 3.0],
        };
        let turns = turns(band, cut, piece, guard);
        let whole =
            |overhang, flip| Curve { piece, band, flip, overhang, panels: 0..0, level: [0, 1], turns: turns.clone() };
        let wholes: Vec<Curve<'a>> =
            overhangs.into_iter().flat_map(|it| [false, true].map(|flip| whole(it, flip))).collect();
        let panel = |k: usize| {
            let lines = TRIED.map(|s| band.line(k as f64 + s));
            let weight = match &lines {
                [Some(a), Some(b)] => {
                    let way = (b.p + b.q - a.p - a.q) / 2.0;
                    way.cross(&a.direction()).norm() * ((a.q - a.p).norm() + (b.q - b.p).norm())
                }
                _ => 0.0,
            };
            let longest = lines.iter().flatten().map(|it| (it.q - it.p).norm()).fold(0.0, f64::max);
            let mut ways: Vec<Way> = Vec::new();
            for pair in wholes.chunks(2) {
                let way = in_levels(&pair[0], k, longest, cut, guard, options);
                // The other way round what is left is about the same.
                let turned = Way::new(&pair[1], k, way.levels, 0.0, cut, guard).0;
                ways.extend([way, turned]);
                if ways.iter().any(|it| it.postures.as_flattened().iter().all(Result::is_ok)) {
                    break;
                }
            }
            let finest = ways.iter().map(|it| it.levels).max().unwrap_or(1);
            Panel { weight, longest, finest, ways }
        };
        let panels = (0..band.end() as usize).map(panel).collect();
        Self { piece, band, wholes, panels }
    }

    /// Area for which every way round is barred, mm².
    pub(super) fn barred(&self, is_barred: &dyn Fn(Result<&Posture, &Obstacle>) -> bool) -> f64 {
        let of_panel = |it: &Panel| it.weight * it.ways.iter().map(|it| it.barred(is_barred)).fold(1.0, f64::min);
        self.panels.iter().map(of_panel).sum()
    }

    /// All postures of the first way round that can be.
    pub(super) fn postures(&self) -> impl Iterator<Item = &Posture> {
        self.panels.iter().flat_map(|it| it.ways[0].postures.as_flattened()).filter_map(|it| it.as_ref().ok())
    }

    /// The levels of all panels, each the way round that bars least of it, neighbours that agree as one curve; the area
    /// that is barred nevertheless, mm², with the panel and the reason of most of it.
    pub(super) fn curves(
        &self,
        bars: &dyn Fn(Result<&Posture, &Obstacle>) -> Option<Bar>,
        cut: &CutMesh,
        guard: &Guard<'_>,
    ) -> (Vec<Curve<'a>>, Option<(f64, usize, Bar)>) {
        let mut most: Option<(f64, usize, Bar)> = None;
        let mut barred = 0.0;
        let mut choices: Vec<Choice> = Vec::new();
        for (k, panel) in self.panels.iter().enumerate() {
            let (choice, share, bar) = self.choice(k, panel, bars, cut, guard);
            choices.push(choice);
            let area = panel.weight * share;
            barred += area;
            if let Some(bar) = bar.filter(|_| area > most.as_ref().map_or(0.0, |it| it.0)) {
                most = Some((area, k, bar));
            }
        }
        let mut curves = Vec::new();
        let mut from = 0;
        for group in choices.chunk_by(|a, b| a == b) {
            let panels = from..from + group.len();
            from = panels.end;
            let (levels, ways) = &group[0];
            // Those of a strip that are higher on the cutter first.
            for (k, &way) in ways.iter().enumerate().rev() {
                let whole = &self.wholes[way];
                let k = if whole.flip { levels - 1 - k } else { k };
                curves.push(Curve { level: [k, *levels], panels: panels.clone(), ..whole.clone() });
            }
        }
        (curves, most.map(|(_, panel, bar)| (barred, panel, bar)))
    }

    /// The levels of one panel: the best way round, but others in levels where they bar less. Also the share that is barred,
    /// and why.
    fn choice(
        &self,
        panel: usize,
        it: &Panel,
        bars: &dyn Fn(Result<&Posture, &Obstacle>) -> Option<Bar>,
        cut: &CutMesh,
        guard: &Guard<'_>,
    ) -> (Choice, f64, Option<Bar>) {
        let costs: Vec<f64> = it.ways.iter().map(|it| it.barred(&|found| bars(found).is_some())).collect();
        let cheaper =
            |a: &usize, b: &usize| costs[*a].total_cmp(&costs[*b]).then(it.ways[*a].levels.cmp(&it.ways[*b].levels));
        let best = (0..costs.len()).min_by(cheaper).expect("there are two ways round at least");
        let levels = it.ways[best].levels;
        let mut chosen = Vec::with_capacity(levels);
        let (mut left, mut reason) = (0.0, None);
        for k in 0..levels {
            let (way, barred, bar) = self.way_round(best, panel, [k, levels], bars, cut, guard);
            chosen.push(way);
            left += barred as f64 / (TRIED.len() * levels) as f64;
            reason = reason.or(bar);
        }
        ((levels, chosen), left, reason)
    }

    /// The way round that bars least of a level of a panel, `first` if none is better; how many postures it bars, and why.
    fn way_round(
        &self,
        first: usize,
        panel: usize,
        level: [usize; 2],
        bars: &dyn Fn(Result<&Posture, &Obstacle>) -> Option<Bar>,
        cut: &CutMesh,
        guard: &Guard<'_>,
    ) -> (usize, usize, Option<Bar>) {
        let mut best = (first, usize::MAX, None);
        let others = (0..self.wholes.len()).filter(|&it| it != first);
        for way in std::iter::once(first).chain(others) {
            let found = tried(&self.wholes[way], panel, level, cut, guard);
            let barred: Vec<Bar> = found.iter().filter_map(|it| bars(it.0.as_ref())).collect();
            if barred.len() < best.1 {
                best = (way, barred.len(), barred.into_iter().next());
            }
            if best.1 == 0 {
                break;
            }
        }
        best
    }

    /// A panel in twice as many levels as before; nothing where they would be too low.
    pub(super) fn finer(
        &mut self,
        panel: usize,
        bars: &dyn Fn(Result<&Posture, &Obstacle>) -> Option<Bar>,
        cut: &CutMesh,
        guard: &Guard<'_>,
    ) -> Vec<Curve<'a>> {
        let levels = 2 * self.panels[panel].finest;
        if self.panels[panel].longest < LOWEST * levels as f64 {
            return vec![];
        }
        self.panels[panel].finest = levels;
        let curve = |k| {
            let way = self.way_round(0, panel, [k, levels], bars, cut, guard).0;
            let whole = &self.wholes[way];
            let level = [if whole.flip { levels - 1 - k } else { k }, levels];
            Curve { level, panels: panel..panel + 1, ..whole.clone() }
        };
        (0..levels).rev().map(curve).collect()
    }
}

impl Way {
    /// A number of levels, the most that one of them leaves, mm, and the mean of what is too much.
    fn new(
        whole: &Curve<'_>,
        panel: usize,
        levels: usize,
        enough: f64,
        cut: &CutMesh,
        guard: &Guard<'_>,
    ) -> (Self, f64, f64) {
        let found: Vec<_> = (0..levels).map(|k| tried(whole, panel, [k, levels], cut, guard)).collect();
        let left = || found.as_flattened().iter().map(|it| it.1);
        let (most, sum) = (left().fold(0.0, f64::max), left().map(|it| (it - enough).max(0.0)).sum::<f64>());
        let mean = sum / (TRIED.len() * levels) as f64;
        (Self { levels, postures: found.into_iter().map(|it| it.map(|it| it.0)).collect() }, most, mean)
    }

    /// Share of its postures that are barred.
    fn barred(&self, is_barred: &dyn Fn(Result<&Posture, &Obstacle>) -> bool) -> f64 {
        let all = self.postures.as_flattened();
        all.iter().filter(|it| is_barred(it.as_ref())).count() as f64 / all.len() as f64
    }
}

/// Postures of a level of a panel, counted from P, with what each leaves, mm.
fn tried(
    whole: &Curve<'_>,
    panel: usize,
    [k, levels]: [usize; 2],
    cut: &CutMesh,
    guard: &Guard<'_>,
) -> [(Found, f64); 2] {
    let k = if whole.flip { levels - 1 - k } else { k };
    let curve = Curve { level: [k, levels], ..whole.clone() };
    TRIED.map(|s| match curve.settled(panel as f64 + s, cut, guard) {
        Ok(it) => (Ok(it.posture), it.left),
        Err(it) => (Err(it), 0.0),
    })
}

/// A panel in as few levels as leave little enough, or as those that leave least too much.
fn in_levels(
    whole: &Curve<'_>,
    panel: usize,
    longest: f64,
    cut: &CutMesh,
    guard: &Guard<'_>,
    options: &Options,
) -> Way {
    let first = ((longest + whole.overhang) / (0.9 * guard.tool.flute)).ceil().max(1.0) as usize;
    let most = match options.machine {
        Machine::Mill(_) => MOST_LEVELS * first,
        // The whole of a wire cuts.
        Machine::Wire(_) => first,
    };
    let enough = SHARE * options.excess;
    let mut best: Option<(f64, Way)> = None;
    let mut levels = first;
    loop {
        let (way, left, too_much) = Way::new(whole, panel, levels, enough, cut, guard);
        if best.as_ref().is_none_or(|it| too_much < 0.9 * it.0) {
            best = Some((too_much, way));
        }
        levels *= 2;
        let is_done = left <= enough || levels > most || longest < LOWEST * levels as f64;
        if let Some((_, way)) = best.take_if(|_| is_done) {
            return way;
        }
    }
}
