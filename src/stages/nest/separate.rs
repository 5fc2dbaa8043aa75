//! Taking overlapping parts apart by guided local search (Gardeyn, Vanden Berghe and Wauters 2025, arXiv:2509.13329).
//!
//! Parts may overlap; one that does is moved to the place where its weighted collisions are least. Weights of pairs that
//! stay in collision grow, so that the search leaves local minima.
use super::{
    overlap::overlap,
    shape::{Prepared, Shape},
};
use crate::{
    geom::Vec2,
    numeric::{Cancelled, Monitor, random::Random},
};

/// Places tried for a part: anywhere, and around where it lies.
const SAMPLES: (usize, usize) = (40, 24);
/// The best of them that are refined.
const REFINED: usize = 3;
/// Steps of the refinement as shares of the part's smaller extent: first, last of the first round, last of the second.
const STEPS: [f64; 3] = [0.2, 0.01, 0.0005];
/// Factors of the step after a success and a failure.
const PACE: (f64, f64) = (1.1, 0.5);
/// Factor of the weight of a pair in collision: from the first for the slightest to the second for the worst.
const GROWTH: (f64, f64) = (1.2, 2.0);
/// Factor of the weight of a pair that is apart.
const FADE: f64 = 0.95;
/// A loss counts as better when it is below this share of the best.
const BETTER: f64 = 0.98;

/// Where a part lies.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Lie {
    /// The sheet.
    pub(super) sheet: usize,
    /// Which of the part's shapes.
    pub(super) shape: usize,
    /// Centre of the shape's box, from the lower left corner of the room, mm.
    pub(super) at: Vec2,
}

/// How long a separation goes on.
#[derive(Debug, Clone, Copy)]
pub(super) struct Patience {
    /// Rounds without a better loss before the best state is taken up again.
    pub(super) rounds: usize,
    /// How often that may happen in a row.
    pub(super) strikes: usize,
}

/// The parts, where they lie, and how they collide.
pub(super) struct Bench<'a> {
    parts: &'a [Prepared],
    /// Room on each sheet inside its margins, mm.
    pub(super) rooms: Vec<Vec2>,
    /// Where each part lies.
    pub(super) lies: Vec<Lie>,
    /// Collision of each pair, 0 when apart; n × n, symmetric.
    losses: Vec<f64>,
    weights: Vec<f64>,
    random: Random,
    /// Pairs of parts tested so far: the measure of effort.
    pub(super) tests: u64,
}

impl<'a> Bench<'a> {
    /// Parts that lie on rooms.
    pub(super) fn new(parts: &'a [Prepared], rooms: Vec<Vec2>, lies: Vec<Lie>, random: Random) -> Self {
        let n = parts.len();
        let (losses, weights) = (vec![0.0; n * n], vec![1.0; n * n]);
        let mut bench = Self { parts, rooms, lies: Vec::new(), losses, weights, random, tests: 0 };
        bench.restore(lies);
        bench
    }

    /// Lays all parts as told.
    pub(super) fn restore(&mut self, lies: Vec<Lie>) {
        self.lies = lies;
        (0..self.parts.len()).for_each(|i| self.update(i));
    }

    /// A random number below `bound`.
    pub(super) fn below(&mut self, bound: usize) -> usize {
        self.random.below(bound)
    }

    /// Uniform in [0, 1).
    pub(super) fn unit(&mut self) -> f64 {
        self.random.unit()
    }

    fn shape(&self, part: usize, shape: usize) -> &'a Shape {
        &self.parts[part].shapes[shape]
    }

    /// Least and largest place of a shape on a sheet; `None` when it does not fit there or there is no such sheet.
    pub(super) fn range(&self, part: usize, shape: usize, sheet: usize) -> Option<(Vec2, Vec2)> {
        let bounds = self.shape(part, shape).bounds;
        let (low, high) = (-bounds.min, self.rooms.get(sheet)? - bounds.max);
        (low.x <= high.x && low.y <= high.y).then_some((low, high))
    }

    /// Sum of all collisions.
    pub(super) fn loss(&self) -> f64 {
        self.losses.iter().sum::<f64>() / 2.0
    }

    fn row(&self, part: usize) -> &[f64] {
        let n = self.parts.len();
        &self.losses[part * n..(part + 1) * n]
    }

    /// Parts in collision.
    fn colliding(&self) -> Vec<usize> {
        (0..self.parts.len()).filter(|&i| self.row(i).iter().any(|&it| it > 0.0)).collect()
    }

    /// Measures the collisions of a part anew.
    fn update(&mut self, part: usize) {
        let n = self.parts.len();
        for other in 0..n {
            let loss = if other == part { 0.0 } else { self.pair(part, self.lies[part], other).unwrap_or(0.0) };
            self.losses[part * n + other] = loss;
            self.losses[other * n + part] = loss;
        }
    }

    fn pair(&self, part: usize, lie: Lie, other: usize) -> Option<f64> {
        let theirs = self.lies.get(other).filter(|it| it.sheet == lie.sheet)?;
        let mine = (&self.parts[part], self.shape(part, lie.shape));
        overlap(mine, (&self.parts[other], self.shape(other, theirs.shape)), lie.at - theirs.at)
    }

    /// Puts a part down.
    pub(super) fn put(&mut self, part: usize, lie: Lie) {
        self.lies[part] = lie;
        self.update(part);
    }

    /// Weighted collisions of a part if it lay there; at least `limit` when they are not less.
    fn weigh(&mut self, part: usize, lie: Lie, limit: f64) -> f64 {
        let n = self.parts.len();
        let half = self.shape(part, lie.shape).half;
        let mut sum = 0.0;
        for other in 0..n {
            let theirs = self.lies[other];
            if other == part || theirs.sheet != lie.sheet {
                continue;
            }
            let (apart, reach) = (lie.at - theirs.at, half + self.shape(other, theirs.shape).half);
            if apart.x.abs() >= reach.x || apart.y.abs() >= reach.y {
                continue;
            }
            self.tests += 1;
            if let Some(loss) = self.pair(part, lie, other) {
                sum += loss * self.weights[part * n + other];
                if sum >= limit {
                    return sum;
                }
            }
        }
        sum
    }

    /// A place drawn at random, anywhere.
    fn anywhere(&mut self, part: usize) -> Option<Lie> {
        for _ in 0..8 {
            let (sheet, shape) =
                (self.random.below(self.rooms.len()), self.random.below(self.parts[part].shapes.len()));
            if let Some((low, high)) = self.range(part, shape, sheet) {
                let share = Vec2::new(self.random.unit(), self.random.unit());
                return Some(Lie { sheet, shape, at: low + (high - low).component_mul(&share) });
            }
        }
        None
    }

    /// A place drawn at random around where the part lies.
    fn around(&mut self, part: usize) -> Option<Lie> {
        let lie = self.lies[part];
        let turn = self.random.below(4) == 0;
        let shape = if turn { self.random.below(self.parts[part].shapes.len()) } else { lie.shape };
        let (low, high) = self.range(part, shape, lie.sheet)?;
        let half = self.shape(part, shape).half;
        let draw =
            Vec2::new(self.random.unit() + self.random.unit() - 1.0, self.random.unit() + self.random.unit() - 1.0);
        Some(Lie { shape, at: (lie.at + 2.0 * draw.component_mul(&half)).sup(&low).inf(&high), ..lie })
    }

    /// The place with the least weighted collisions that the samples and their refinement find, if it is better than
    /// `limit`.
    pub(super) fn search(&mut self, part: usize, limit: f64) -> Option<(Lie, f64)> {
        let mut best: Vec<(Lie, f64)> = Vec::with_capacity(REFINED + 1);
        for k in 0..SAMPLES.0 + SAMPLES.1 {
            let Some(lie) = (if k < SAMPLES.0 { self.anywhere(part) } else { self.around(part) }) else { continue };
            let bound = best.get(REFINED - 1).map_or(f64::INFINITY, |it| it.1);
            let loss = self.weigh(part, lie, bound);
            if loss < bound {
                let at = best.partition_point(|it| it.1 <= loss);
                best.insert(at, (lie, loss));
                best.truncate(REFINED);
            }
            if loss == 0.0 {
                return Some((lie, 0.0));
            }
        }
        let refined: Vec<(Lie, f64)> = best.into_iter().map(|it| self.refine(part, it, STEPS[0], STEPS[1])).collect();
        let first = refined.into_iter().min_by(|a, b| a.1.total_cmp(&b.1))?;
        Some(self.refine(part, first, STEPS[1], STEPS[2])).filter(|it| it.1 < limit)
    }

    /// Walks downhill along random directions with steps that shrink.
    fn refine(&mut self, part: usize, (mut lie, mut loss): (Lie, f64), first: f64, last: f64) -> (Lie, f64) {
        let size = 2.0 * self.shape(part, lie.shape).half.min();
        let (mut step, last) = (first * size, last * size);
        let Some((low, high)) = self.range(part, lie.shape, lie.sheet) else { return (lie, loss) };
        while step > last && loss > 0.0 {
            let direction = match self.random.below(4) {
                0 => Vec2::new(step, 0.0),
                1 => Vec2::new(0.0, step),
                2 => Vec2::new(step, step) * std::f64::consts::FRAC_1_SQRT_2,
                _ => Vec2::new(step, -step) * std::f64::consts::FRAC_1_SQRT_2,
            };
            let before = loss;
            for ahead in [lie.at + direction, lie.at - direction] {
                let there = Lie { at: ahead.sup(&low).inf(&high), ..lie };
                let found = self.weigh(part, there, loss);
                if found < loss {
                    (lie, loss) = (there, found);
                }
            }
            step *= if loss < before { PACE.0 } else { PACE.1 };
        }
        (lie, loss)
    }

    /// Moves every part in collision once, in random order; then the weights learn.
    fn round(&mut self) {
        let mut moving = self.colliding();
        for k in (1..moving.len()).rev() {
            moving.swap(k, self.random.below(k + 1));
        }
        let n = self.parts.len();
        for part in moving {
            let now: f64 = (0..n).map(|j| self.losses[part * n + j] * self.weights[part * n + j]).sum();
            if now > 0.0
                && let Some((lie, _)) = self.search(part, now)
            {
                self.put(part, lie);
            }
        }
        let worst = self.losses.iter().fold(0.0, |a: f64, &b| a.max(b));
        for (weight, &loss) in self.weights.iter_mut().zip(&self.losses) {
            *weight = match loss > 0.0 {
                true => *weight * (GROWTH.0 + (GROWTH.1 - GROWTH.0) * loss / worst),
                false => (*weight * FADE).max(1.0),
            };
        }
    }

    /// Moves parts until none collide; otherwise leaves the state with the least collisions. Algorithm 1 of the paper.
    pub(super) fn separate(
        &mut self,
        patience: Patience,
        spent: &dyn Fn(u64) -> bool,
        monitor: &Monitor,
    ) -> Result<bool, Cancelled> {
        self.weights.fill(1.0);
        let mut best = (self.loss(), self.lies.clone());
        let mut strikes = 0;
        while best.0 > 0.0 && strikes < patience.strikes {
            let before = best.0;
            let mut idle = 0;
            while idle < patience.rounds {
                monitor.check()?;
                self.round();
                let loss = self.loss();
                idle = if loss < BETTER * best.0 { 0 } else { idle + 1 };
                if loss < best.0 {
                    best = (loss, self.lies.clone());
                }
                if loss == 0.0 {
                    return Ok(true);
                }
                if spent(self.tests) {
                    self.restore(best.1);
                    return Ok(false);
                }
            }
            strikes = if best.0 < BETTER * before { 0 } else { strikes + 1 };
            self.restore(best.1.clone());
        }
        Ok(best.0 == 0.0)
    }
}
