//! The order of lines with short travel: nearest neighbour, then moves that shorten it until none is left.
//!
//! Closed lines may be entered at any of their points, open ones from either end. A line that is enclosed comes before the
//! one that encloses it. Moves: another entry point, 2-opt (a stretch of the tour run backwards; Croes 1958) and Or-opt
//! (up to three lines moved elsewhere; Or 1976).
use crate::{
    geom::{Box2, Vec2, polygon::contour_contains, signed_area},
    numeric::{Cancelled, Monitor},
};

/// Positions in the tour further apart than this are not exchanged; keeps a round linear for very long tours.
const WINDOW: usize = 1000;
/// Rounds of improvement at most; each one shortens the travel, and a dozen usually leave nothing to gain.
const ROUNDS: usize = 60;
/// Gains below this are rounding, mm.
const LEAST_GAIN: f64 = 1e-6;
/// Lines moved together by Or-opt.
const CARRIED: usize = 3;

/// A line to be visited once.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Item {
    /// Its points; a closed line does not repeat the first.
    pub(super) points: Vec<Vec2>,
    /// Whether it is closed.
    pub(super) closed: bool,
    /// The line that encloses it and must come later.
    pub(super) inside: Option<usize>,
}

impl Item {
    /// Where the tool is when it has run the line from that entry.
    fn exit(&self, entry: usize) -> Vec2 {
        if self.closed { self.points[entry] } else { self.points[self.points.len() - 1 - entry] }
    }

    fn entry(&self, entry: usize) -> Vec2 {
        self.points[entry]
    }

    /// The points at which it may be entered: all of a closed line, the ends of an open one.
    fn entries(&self) -> impl Iterator<Item = usize> + '_ {
        let step = if self.closed { 1 } else { (self.points.len() - 1).max(1) };
        (0..self.points.len()).step_by(step)
    }

    /// The entry with the shortest way from `before` and on to `after`, and that length.
    fn best_entry(&self, before: Vec2, after: Option<Vec2>) -> (usize, f64) {
        let way = |k: usize| (self.entry(k) - before).norm() + after.map_or(0.0, |after| (after - self.exit(k)).norm());
        let mut best = (0, f64::INFINITY);
        for k in self.entries() {
            let length = way(k);
            if length < best.1 {
                best = (k, length);
            }
        }
        best
    }
}

/// One stop of the tour: an item and the index of the point where it is entered.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Visit {
    pub(super) item: usize,
    pub(super) entry: usize,
}

/// Finds for every closed line the smallest closed one around it. Lines must not cross; `shapes` are their polygons.
pub(super) fn enclosed(mut items: Vec<Item>, shapes: &[Vec<Vec2>]) -> Vec<Item> {
    let bounds: Vec<Box2> = shapes.iter().map(Box2::of).collect();
    let size: Vec<f64> = shapes.iter().map(|it| signed_area(it).abs()).collect();
    for i in 0..items.len() {
        let around = |j: &usize| {
            *j != i
                && items[*j].closed
                && size[*j] > size[i]
                && bounds[*j].touches(&bounds[i])
                && contour_contains(&shapes[*j], items[i].points[0])
        };
        items[i].inside = (0..items.len()).filter(around).min_by(|a, b| size[*a].total_cmp(&size[*b]));
    }
    items
}

#[cfg(test)]
/// Travel of a tour that starts at `start` and may end anywhere, mm.
pub(super) fn travel(items: &[Item], start: Vec2, tour: &[Visit]) -> f64 {
    let mut at = start;
    let mut sum = 0.0;
    for visit in tour {
        sum += (items[visit.item].entry(visit.entry) - at).norm();
        at = items[visit.item].exit(visit.entry);
    }
    sum
}

/// A short tour through all items from `start`.
pub(super) fn tour(items: &[Item], start: Vec2, monitor: &Monitor) -> Result<Vec<Visit>, Cancelled> {
    let mut tour = nearest_neighbour(items, start, monitor)?;
    improve(items, start, &mut tour, monitor)?;
    Ok(tour)
}

/// Always the nearest line that nothing enclosed keeps waiting.
fn nearest_neighbour(items: &[Item], start: Vec2, monitor: &Monitor) -> Result<Vec<Visit>, Cancelled> {
    let mut waiting = vec![0; items.len()];
    for outer in items.iter().filter_map(|it| it.inside) {
        waiting[outer] += 1;
    }
    let bounds: Vec<Box2> = items.iter().map(|it| Box2::of(&it.points)).collect();
    let mut open: Vec<usize> = (0..items.len()).collect();
    let mut tour = Vec::with_capacity(items.len());
    let mut at = start;
    while !open.is_empty() {
        monitor.check()?;
        let here = Box2 { min: at, max: at };
        let mut best: Option<(usize, usize, f64)> = None;
        for (slot, &i) in open.iter().enumerate().filter(|(_, i)| waiting[**i] == 0) {
            let limit = best.map_or(f64::INFINITY, |it| it.2);
            if bounds[i].distance(&here) < limit {
                let (entry, length) = items[i].best_entry(at, None);
                if length < limit {
                    best = Some((slot, entry, length));
                }
            }
        }
        let (slot, entry, _) = best.expect("enclosing is acyclic, so some line waits for nothing");
        let item = open.remove(slot);
        if let Some(outer) = items[item].inside {
            waiting[outer] -= 1;
        }
        tour.push(Visit { item, entry });
        at = items[item].exit(entry);
    }
    Ok(tour)
}

/// Shortens a tour that keeps the order of enclosure; the result is never longer.
pub(super) fn improve(items: &[Item], start: Vec2, tour: &mut Vec<Visit>, monitor: &Monitor) -> Result<(), Cancelled> {
    let mut search = Search { items, start, tour: std::mem::take(tour) };
    for _ in 0..ROUNDS {
        let mut gained = search.reenter();
        for i in 0..search.tour.len() {
            if i % 64 == 0 {
                monitor.check()?;
            }
            gained |= search.reverse_from(i);
            gained |= search.carry_from(i);
        }
        if !gained {
            break;
        }
    }
    *tour = search.tour;
    Ok(())
}

struct Search<'a> {
    items: &'a [Item],
    start: Vec2,
    tour: Vec<Visit>,
}

impl Search<'_> {
    fn entry(&self, k: usize) -> Option<Vec2> {
        self.tour.get(k).map(|it| self.items[it.item].entry(it.entry))
    }

    /// Where the tool is before stop `k`.
    fn before(&self, k: usize) -> Vec2 {
        match k.checked_sub(1) {
            Some(last) => self.items[self.tour[last].item].exit(self.tour[last].entry),
            None => self.start,
        }
    }

    /// Length of the way to a point that may not exist, because the tour ends there.
    fn way(from: Vec2, to: Option<Vec2>) -> f64 {
        to.map_or(0.0, |to| (to - from).norm())
    }

    /// Gives every line the best entry between its neighbours.
    fn reenter(&mut self) -> bool {
        let mut gained = false;
        for k in 0..self.tour.len() {
            let (before, after) = (self.before(k), self.entry(k + 1));
            let item = &self.items[self.tour[k].item];
            let old = Self::way(before, self.entry(k)) + Self::way(item.exit(self.tour[k].entry), after);
            let (entry, length) = item.best_entry(before, after);
            if length < old - LEAST_GAIN {
                self.tour[k].entry = entry;
                gained = true;
            }
        }
        gained
    }

    /// Runs the best stretch that begins at stop `i` backwards, if that is shorter.
    fn reverse_from(&mut self, i: usize) -> bool {
        let (before, first) = (self.before(i), self.entry(i));
        let mut best = (LEAST_GAIN, None);
        for j in i + 1..self.tour.len().min(i + WINDOW) {
            let (last, after) = (self.before(j + 1), self.entry(j + 1));
            // Backwards, the stretch is entered where it was left and left where it was entered.
            let gain = Self::way(before, first) + Self::way(last, after)
                - Self::way(before, Some(last))
                - first.map_or(0.0, |first| Self::way(first, after));
            if gain > best.0 {
                best = (gain, Some(j));
            }
        }
        let Some(j) = best.1 else { return false };
        let mut trial = self.tour.clone();
        trial[i..=j].reverse();
        for visit in &mut trial[i..=j] {
            let item = &self.items[visit.item];
            if !item.closed {
                visit.entry = item.points.len() - 1 - visit.entry;
            }
        }
        self.accept(trial)
    }

    /// Moves one to three stops from `i` on to the best other place, if that is shorter.
    fn carry_from(&mut self, i: usize) -> bool {
        let n = self.tour.len();
        for count in 1..=CARRIED.min(n - i) {
            let (before, after) = (self.before(i), self.entry(i + count));
            let (first, last) = (self.entry(i), self.before(i + count));
            let freed = Self::way(before, first) + Self::way(last, after) - Self::way(before, after);
            let mut best = (LEAST_GAIN, None);
            for gap in i.saturating_sub(WINDOW)..=n.min(i + WINDOW) {
                if (i..=i + count).contains(&gap) {
                    continue;
                }
                let (from, to) = (self.before(gap), self.entry(gap));
                let old = Self::way(from, to);
                // A single line may be entered anew; more keep their entries and their direction.
                let (entry, new) = if count == 1 {
                    let (entry, length) = self.items[self.tour[i].item].best_entry(from, to);
                    (Some(entry), length)
                } else {
                    (None, Self::way(from, first) + Self::way(last, to))
                };
                let gain = freed + old - new;
                if gain > best.0 {
                    best = (gain, Some((gap, entry)));
                }
            }
            let Some((gap, entry)) = best.1 else { continue };
            let mut trial = self.tour.clone();
            let mut moved: Vec<Visit> = trial.drain(i..i + count).collect();
            if let Some(entry) = entry {
                moved[0].entry = entry;
            }
            let to = if gap > i { gap - count } else { gap };
            trial.splice(to..to, moved);
            if self.accept(trial) {
                return true;
            }
        }
        false
    }

    /// Takes a tour that is shorter and keeps every enclosed line before the one around it.
    fn accept(&mut self, trial: Vec<Visit>) -> bool {
        let mut place = vec![0; self.items.len()];
        for (k, visit) in trial.iter().enumerate() {
            place[visit.item] = k;
        }
        let kept = self.items.iter().enumerate().all(|(i, it)| it.inside.is_none_or(|outer| place[i] < place[outer]));
        if kept {
            self.tour = trial;
        }
        kept
    }
}
