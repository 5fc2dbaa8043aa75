//! Where in the program the machine is: lines that were sent but are not surely executed, and the place among them
//! that the last position report points to. Every answer errs on the side of "not done yet".
use std::collections::VecDeque;

use crate::import::gcode::path::{Move, Point};

/// A report this near a path lies on it, mm: a step or two and the rounding of reports.
const ON_PATH: f64 = 0.1;

/// A report this far from every path that may be executing means another program runs than the one sent, mm.
const OFF_PATH: f64 = 1.0;

/// Reports off the path in a row before it counts.
const OFF_REPORTS: u32 = 3;

/// Shorter moves may be dropped by the board as less than a step, mm.
const SURE_LENGTH: f64 = 0.05;

struct Item {
    line: usize,
    moves: Vec<Move>,
    seconds: f64,
    /// The board waits for all motion before it answers this line.
    waits: bool,
}

/// Lines between "sent" and "surely executed".
pub struct Track {
    items: VecDeque<Item>,
    /// How many of the items have been answered.
    answered: usize,
    /// Blocks that the board can hold planned.
    blocks: usize,
    /// Seconds of all items.
    seconds: f64,
    /// Share of the first item that is done.
    share: f64,
    off: u32,
    /// Whether positions of the program can be followed.
    certain: bool,
    /// Seconds of the lines passed so far.
    passed_seconds: f64,
}

impl Track {
    /// Nothing sent yet.
    pub fn new(blocks: usize) -> Self {
        Self {
            items: VecDeque::new(),
            answered: 0,
            blocks,
            seconds: 0.0,
            share: 0.0,
            off: 0,
            certain: true,
            passed_seconds: 0.0,
        }
    }

    /// A line goes out.
    pub fn sent(&mut self, line: usize, moves: Vec<Move>, seconds: f64, waits: bool, opaque: bool) {
        self.certain &= !opaque;
        self.seconds += seconds;
        self.items.push_back(Item { line, moves, seconds, waits });
    }

    /// The oldest unanswered line was answered. Returns the index of the last line that is surely executed, if that is news.
    pub fn ok(&mut self) -> Option<usize> {
        if self.answered == self.items.len() {
            return None;
        }
        self.answered += 1;
        // The board held its answer back until everything before had been executed.
        if self.items[self.answered - 1].waits {
            return self.pass(self.answered);
        }
        // The planner holds no more than its blocks: older moves are done. One block runs, one may be in the parser.
        let mut room = self.blocks + 2;
        for i in (0..self.answered).rev() {
            if self.items[i].moves.iter().any(|it| it.length() > SURE_LENGTH) {
                if room == 0 {
                    return self.pass(i + 1);
                }
                room -= 1;
            }
        }
        None
    }

    /// Everything answered has been executed: the machine is idle.
    pub fn idle(&mut self) -> Option<usize> {
        self.off = 0;
        self.pass(self.answered)
    }

    fn pass(&mut self, count: usize) -> Option<usize> {
        let mut last = None;
        for item in self.items.drain(..count) {
            self.seconds -= item.seconds;
            self.passed_seconds += item.seconds;
            last = Some(item.line);
        }
        self.answered -= count;
        if count > 0 {
            self.share = 0.0;
        }
        last
    }

    /// A position report. Returns the last line that is surely executed, if that is news; `Err` with the nearest
    /// distance when the machine is where the program does not lead.
    pub fn at(&mut self, p: Point) -> Result<Option<usize>, f64> {
        if !self.certain {
            return Ok(None);
        }
        let mut nearest = f64::INFINITY;
        let mut found = None;
        // The line in the parser can be under way already: an arc is many blocks.
        let candidates = (self.answered + 1).min(self.items.len());
        'search: for (i, item) in self.items.iter().take(candidates).enumerate() {
            for (k, it) in item.moves.iter().enumerate() {
                let (off, share) = it.nearest(p);
                nearest = nearest.min(off);
                let share = (k as f64 + share) / item.moves.len() as f64;
                if off <= ON_PATH && (i > 0 || share >= self.share - 1e-3) {
                    found = Some((i, share));
                    break 'search;
                }
            }
        }
        match found {
            Some((i, share)) => {
                self.off = 0;
                let news = self.pass(i);
                self.share = share;
                Ok(news)
            }
            None if nearest > OFF_PATH && nearest.is_finite() => {
                self.off += 1;
                if self.off >= OFF_REPORTS { Err(nearest) } else { Ok(None) }
            }
            None => Ok(None),
        }
    }

    /// Seconds of motion that the board may still have before it, without another byte.
    pub fn ahead(&self) -> f64 {
        let begun = self.items.front().map_or(0.0, |it| it.seconds * self.share);
        (self.seconds - begun).max(0.0)
    }

    /// Seconds of the plan that are done.
    pub fn done(&self) -> f64 {
        self.passed_seconds + self.items.front().map_or(0.0, |it| it.seconds * self.share)
    }

    /// Lines that move and are not surely executed.
    pub fn moving_lines(&self) -> usize {
        self.items.iter().filter(|it| !it.moves.is_empty()).count()
    }

    /// The line that is being executed, as far as is known.
    pub fn current(&self) -> Option<usize> {
        self.items.front().map(|it| it.line)
    }

    /// Forgets what was sent: the board has been reset.
    pub fn clear(&mut self) {
        self.items.clear();
        self.answered = 0;
        self.seconds = 0.0;
        self.share = 0.0;
        self.off = 0;
        self.certain = true;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn straight(x0: f64, x1: f64) -> Vec<Move> {
        vec![Move { from: [x0, 0.0, 0.0], to: [x1, 0.0, 0.0], arc: None, rapid: false, feed: 600.0, working: true }]
    }

    #[test]
    fn reports_move_it_on_and_the_plan_bounds_it() {
        let mut track = Track::new(2);
        for i in 0..6 {
            let x = i as f64 * 10.0;
            track.sent(i, straight(x, x + 10.0), 1.0, false, false);
        }
        assert_eq!(track.ok(), None);
        assert_eq!(track.ok(), None);
        assert_eq!(track.at([12.0, 0.0, 0.0]), Ok(Some(0)));
        assert!((track.ahead() - 4.8).abs() < 1e-9);
        assert_eq!(track.at([11.0, 0.0, 0.0]), Ok(None), "never backwards");
        for _ in 0..3 {
            assert_eq!(track.ok(), None);
        }
        assert_eq!(track.ok(), Some(1), "two planned, one runs, one in the parser");
        assert_eq!(track.idle(), Some(5));
        assert!(track.ahead().abs() < 1e-9);
    }

    #[test]
    fn a_machine_off_its_path_is_noticed() {
        let mut track = Track::new(15);
        track.sent(0, straight(0.0, 10.0), 1.0, false, false);
        assert_eq!(track.at([5.0, 3.0, 0.0]), Ok(None));
        assert_eq!(track.at([5.0, 3.0, 0.0]), Ok(None));
        assert_eq!(track.at([5.0, 3.0, 0.0]), Err(3.0));
    }

    #[test]
    fn a_line_that_waits_proves_the_lines_before_it() {
        let mut track = Track::new(15);
        track.sent(4, straight(0.0, 10.0), 1.0, false, false);
        track.sent(5, Vec::new(), 0.0, true, false);
        assert_eq!((track.ok(), track.ok()), (None, Some(5)));
    }
}
