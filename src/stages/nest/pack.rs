//! Making room smaller and taking the parts apart in it again: first sheet by sheet, then the last sheet as a strip.
//!
//! Exploration takes off whole steps and, where that fails, goes on from a failed state with two large parts swapped;
//! compression takes off ever finer steps from the best state (Gardeyn, Vanden Berghe and Wauters 2025).
use super::{
    separate::{Bench, Lie, Patience},
    shape::Prepared,
};
use crate::{
    geom::Vec2,
    numeric::{Cancelled, Monitor, random::Random},
};

/// Shares of the effort after which a sheet less is no longer tried, and after which exploration ends.
const SHARES: (f64, f64) = (0.5, 0.8);
/// Steps of the height in exploration, as shares: the first, halved at every failure, and the one from which on it takes so
/// many failures to halve it. Long steps come down fast from the first packing, but where little room is left short ones get
/// further in the same time.
const EXPLORE: (f64, f64, usize) = (0.01, 0.002, 12);
/// Steps of the height in compression: first and last.
const COMPRESS: (f64, f64) = (0.002, 0.00005);
/// Patience of exploration and of compression.
const PATIENCE: [Patience; 2] = [Patience { rounds: 100, strikes: 3 }, Patience { rounds: 60, strikes: 3 }];
/// Height that the first separation may use, as a multiple of the start's.
const START: f64 = 1.03;
/// Parts that together make this share of all hulls are large, the largest first.
const LARGE: f64 = 0.75;
/// Parts are never packed denser than this, so that a sheet less is not tried in vain.
const DENSEST: f64 = 0.92;

/// Where all parts lie.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Packing {
    /// Per part.
    pub(super) lies: Vec<Lie>,
    /// Sheets used.
    pub(super) sheets: usize,
    /// How much of the last one, mm.
    pub(super) height: f64,
}

/// What a search may cost.
pub(super) struct Budget<'a> {
    /// Pairs of parts to test.
    pub(super) tests: u64,
    /// Share of the time that is gone; 0 where time does not count.
    pub(super) time: &'a dyn Fn() -> f64,
}

impl Budget<'_> {
    /// Share that is spent after so many tests.
    fn spent(&self, tests: u64) -> f64 {
        (tests as f64 / self.tests as f64).max((self.time)())
    }
}

struct Packer<'a> {
    parts: &'a [Prepared],
    bench: Bench<'a>,
    best: Packing,
    budget: &'a Budget<'a>,
    monitor: &'a Monitor<'a>,
}

/// Improves on `start` as far as the budget goes. `room` is the usable size of each sheet, `areas` those of the parts. `None`
/// when not even the start could be taken apart.
pub(super) fn pack(
    parts: &[Prepared],
    areas: &[f64],
    room: &dyn Fn(usize) -> Vec2,
    start: Packing,
    random: Random,
    budget: &Budget<'_>,
    monitor: &Monitor,
) -> Result<Option<Packing>, Cancelled> {
    let mut rooms: Vec<Vec2> = (0..start.sheets).map(room).collect();
    if let Some(last) = rooms.last_mut() {
        last.y = last.y.min(START * start.height);
    }
    let bench = Bench::new(parts, rooms, start.lies.clone(), random);
    let mut packer = Packer { parts, bench, best: start, budget, monitor };
    // Shapes are grown by a little more than the parts of the start keep apart.
    if !packer.separate(PATIENCE[1], 1.0)? {
        return Ok(None);
    }
    packer.keep();
    let total: f64 = areas.iter().sum();
    while packer.best.sheets > 1 {
        let fewer: f64 = (0..packer.best.sheets - 1).map(|k| room(k).x * room(k).y).sum();
        if total > DENSEST * fewer || !packer.without_last_sheet()? {
            break;
        }
    }
    packer.explore()?;
    packer.compress()?;
    Ok(Some(packer.best))
}

impl Packer<'_> {
    fn separate(&mut self, patience: Patience, share: f64) -> Result<bool, Cancelled> {
        self.monitor.check()?;
        let budget = self.budget;
        let note = format!("{} sheets, {:.1} mm of the last", self.best.sheets, self.best.height);
        self.monitor.progress(budget.spent(self.bench.tests).min(1.0), &note);
        self.bench.separate(patience, &|tests| budget.spent(tests) >= share, self.monitor)
    }

    fn spent(&self, share: f64) -> bool {
        self.budget.spent(self.bench.tests) >= share
    }

    /// Takes the state, which is without collisions, as the best. A last sheet that has become empty is no longer needed:
    /// it could be made lower for ever.
    fn keep(&mut self) {
        let used = self.bench.lies.iter().map(|it| it.sheet + 1).max().unwrap_or(0);
        self.bench.rooms.truncate(used.max(1));
        let last = self.bench.rooms.len() - 1;
        let tops = self.bench.lies.iter().enumerate().filter(|it| it.1.sheet == last);
        let top = tops.map(|(i, lie)| lie.at.y + self.parts[i].shapes[lie.shape].bounds.max.y).fold(0.0, f64::max);
        self.best = Packing { lies: self.bench.lies.clone(), sheets: last + 1, height: top };
    }

    /// Goes back to the best state.
    fn back(&mut self) {
        self.bench.rooms[self.best.sheets - 1].y = self.best.height;
        self.bench.restore(self.best.lies.clone());
    }

    /// Tries to do without the last sheet.
    fn without_last_sheet(&mut self) -> Result<bool, Cancelled> {
        let Some(last) = self.bench.rooms.pop() else { return Ok(false) };
        let homeless: Vec<usize> =
            (0..self.parts.len()).filter(|&i| self.bench.lies[i].sheet == self.bench.rooms.len()).collect();
        for part in homeless {
            match self.bench.search(part, f64::INFINITY) {
                Some((lie, _)) => self.bench.put(part, lie),
                None => {
                    self.bench.rooms.push(last);
                    self.back();
                    return Ok(false);
                }
            }
        }
        let found = self.separate(PATIENCE[0], SHARES.0)?;
        if found {
            self.keep();
        } else {
            self.bench.rooms.push(last);
            self.back();
        }
        Ok(found)
    }

    /// Makes the last sheet lower: parts above a random line move down, those that do not fit any more go elsewhere.
    /// `false` when a part fits nowhere.
    fn lower(&mut self, step: f64) -> bool {
        let last = self.best.sheets - 1;
        let height = self.best.height * (1.0 - step);
        let down = self.best.height - height;
        self.bench.rooms[last].y = height;
        let line = self.bench.unit() * height;
        for part in 0..self.parts.len() {
            let lie = self.bench.lies[part];
            if lie.sheet != last {
                continue;
            }
            let there = match self.bench.range(part, lie.shape, last) {
                Some((low, high)) => {
                    let at = if lie.at.y > line { lie.at - Vec2::new(0.0, down) } else { lie.at };
                    Some(Lie { at: at.sup(&low).inf(&high), ..lie })
                }
                None => self.bench.search(part, f64::INFINITY).map(|it| it.0),
            };
            match there {
                Some(there) if there != lie => self.bench.put(part, there),
                Some(_) => {}
                None => return false,
            }
        }
        true
    }

    fn explore(&mut self) -> Result<(), Cancelled> {
        let mut step = EXPLORE.0;
        while !self.spent(SHARES.1) && self.lower(step) {
            let mut pool: Vec<(f64, Vec<Lie>)> = Vec::new();
            let mut failures = 0;
            let enough = if step > EXPLORE.1 { 0 } else { EXPLORE.2 };
            while !self.separate(PATIENCE[0], SHARES.1)? && !self.spent(SHARES.1) && failures < enough {
                failures += 1;
                let loss = self.bench.loss();
                let at = pool.partition_point(|it| it.0 <= loss);
                pool.insert(at, (loss, self.bench.lies.clone()));
                // The better a state, the likelier it is taken up.
                let share = self.bench.unit() * self.bench.unit();
                let chosen = ((share * pool.len() as f64) as usize).min(pool.len() - 1);
                self.bench.restore(pool[chosen].1.clone());
                self.swap();
            }
            if self.bench.loss() == 0.0 {
                self.keep();
            } else {
                step /= 2.0;
                self.back();
            }
        }
        self.back();
        Ok(())
    }

    /// Lets two large parts change places.
    fn swap(&mut self) {
        let mut order: Vec<usize> = (0..self.parts.len()).collect();
        order.sort_by(|&i, &j| self.parts[j].hull.total_cmp(&self.parts[i].hull).then(i.cmp(&j)));
        let total: f64 = self.parts.iter().map(|it| it.hull).sum();
        let mut sum = 0.0;
        order.retain(|&i| {
            sum += self.parts[i].hull;
            sum - self.parts[i].hull < LARGE * total
        });
        let a = order[self.bench.below(order.len())];
        let unlike = |&&b: &&usize| (self.parts[b].hull / self.parts[a].hull).ln().abs() > 0.01;
        let others: Vec<usize> = order.iter().filter(unlike).copied().collect();
        if others.is_empty() {
            return;
        }
        let b = others[self.bench.below(others.len())];
        let (here, there) = (self.bench.lies[a], self.bench.lies[b]);
        for (part, own, place) in [(a, here, there), (b, there, here)] {
            if let Some((low, high)) = self.bench.range(part, own.shape, place.sheet) {
                self.bench.put(part, Lie { at: place.at.sup(&low).inf(&high), shape: own.shape, ..place });
            }
        }
    }

    fn compress(&mut self) -> Result<(), Cancelled> {
        let mut step = COMPRESS.0;
        while !self.spent(1.0) && step >= COMPRESS.1 {
            if self.lower(step) && self.separate(PATIENCE[1], 1.0)? {
                self.keep();
            } else {
                step /= 2.0;
                self.back();
            }
        }
        Ok(())
    }
}
