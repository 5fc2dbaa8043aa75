//! How long a program takes: trapezoids of speed with look-ahead, as GRBL's planner runs them.
use crate::import::gcode::{
    motion::{Block, corner_speed, plan},
    path::{Move, Point},
};

/// What the drives can do.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// Largest speed per axis, mm/min (`$110`–`$112`).
    pub rate: Point,
    /// Acceleration per axis, mm/s² (`$120`–`$122`).
    pub acceleration: Point,
    /// Junction deviation, mm (`$11`): how far a corner is thought to be rounded when its speed is chosen.
    pub junction: f64,
}

/// Chord tolerance of arcs (`$12`, GRBL's default), mm; together with the junction deviation it bounds speed on arcs.
const ARC_TOLERANCE: f64 = 0.002;

/// Blocks looked at together. Beyond some metres nothing further ahead changes the speed here.
const WINDOW: usize = 512;

/// Sums up the time of a program line by line.
pub struct Clock {
    limits: Limits,
    blocks: Vec<Block>,
    /// Their lines.
    lines: Vec<usize>,
    /// Speed at the start of the first block.
    entry: f64,
    /// Direction at the end of the last move, where it did not stop.
    direction: Option<Point>,
    /// Seconds per line.
    seconds: Vec<f32>,
}

/// Largest value `v` such that `v * |d_i| <= limit_i` on every axis.
fn along(direction: Point, limits: Point) -> f64 {
    (0..3).filter(|&i| direction[i].abs() > 1e-9).map(|i| limits[i] / direction[i].abs()).fold(f64::INFINITY, f64::min)
}

impl Clock {
    /// Starts at rest.
    pub fn new(limits: Limits) -> Self {
        Self { limits, blocks: Vec::new(), lines: Vec::new(), entry: 0.0, direction: None, seconds: Vec::new() }
    }

    fn book(&mut self, line: usize, seconds: f64) {
        if self.seconds.len() <= line {
            self.seconds.resize(line + 1, 0.0);
        }
        self.seconds[line] += seconds as f32;
    }

    /// Adds a movement of a line.
    pub fn travel(&mut self, line: usize, it: &Move) {
        let length = it.length();
        if length < 1e-6 {
            return;
        }
        let start = it.direction(0.0);
        let chord = it.direction(0.5);
        let rate = along(chord, self.limits.rate) / 60.0;
        let acceleration = along(chord, self.limits.acceleration);
        let mut nominal = if it.rapid { rate } else { (it.feed / 60.0).min(rate) };
        if let Some(arc) = it.arc {
            nominal = nominal.min((acceleration * arc.radius * self.limits.junction / ARC_TOLERANCE).sqrt());
        }
        // A feed of 0 is refused by the board; it must not make the estimate infinite.
        let nominal = nominal.max(1e-3);
        let cos_turn = |last: Point| (0..3).map(|i| last[i] * start[i]).sum::<f64>();
        let entry = self.direction.map_or(0.0, |it| corner_speed(cos_turn(it), acceleration, self.limits.junction));
        self.blocks.push(Block { length, nominal, acceleration, entry });
        self.lines.push(line);
        self.direction = Some(it.direction(1.0));
        if self.blocks.len() >= WINDOW {
            self.settle(WINDOW / 2);
        }
    }

    /// The machine stops and waits.
    pub fn stop(&mut self, line: usize, seconds: f64) {
        self.settle(self.blocks.len());
        self.entry = 0.0;
        self.direction = None;
        self.book(line, seconds);
    }

    /// Books the first `count` blocks, with a stop assumed after the last.
    fn settle(&mut self, count: usize) {
        let (seconds, after) = plan(&self.blocks, self.entry, count);
        self.entry = after;
        self.blocks.drain(..count);
        let lines: Vec<usize> = self.lines.drain(..count).collect();
        lines.into_iter().zip(seconds).for_each(|(line, it)| self.book(line, it));
    }

    /// Seconds per line.
    pub fn finish(mut self, lines: usize) -> Vec<f32> {
        self.settle(self.blocks.len());
        self.seconds.resize(lines, 0.0);
        self.seconds
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn limits() -> Limits {
        Limits { rate: [6000.0; 3], acceleration: [500.0; 3], junction: 0.01 }
    }

    fn straight(from: Point, to: Point, feed: f64) -> Move {
        Move { from, to, arc: None, rapid: false, feed, working: true }
    }

    #[test]
    fn one_move_is_a_trapezoid() {
        let mut clock = Clock::new(limits());
        clock.travel(0, &straight([0.0; 3], [100.0, 0.0, 0.0], 3000.0));
        // 50 mm/s at 500 mm/s²: 0.1 s and 2.5 mm each way, 95 mm between.
        assert!((clock.finish(1)[0] - (0.2 + 95.0 / 50.0) as f32).abs() < 1e-5);
    }

    #[test]
    fn cutting_a_line_in_pieces_changes_nothing() {
        let mut whole = Clock::new(limits());
        whole.travel(0, &straight([0.0; 3], [200.0, 0.0, 0.0], 6000.0));
        let mut pieces = Clock::new(limits());
        for i in 0..2000 {
            let at = |i: i32| [f64::from(i) * 0.1, 0.0, 0.0];
            pieces.travel(0, &straight(at(i), at(i + 1), 6000.0));
        }
        let (whole, pieces) = (whole.finish(1)[0], pieces.finish(1)[0]);
        assert!((whole - pieces).abs() < 1e-3, "{whole} {pieces}");
    }

    #[test]
    fn corners_and_stops_cost_time() {
        let corner = |stop: bool| {
            let mut clock = Clock::new(limits());
            clock.travel(0, &straight([0.0; 3], [10.0, 0.0, 0.0], 3000.0));
            if stop {
                clock.stop(0, 0.5);
            }
            clock.travel(1, &straight([10.0, 0.0, 0.0], [10.0, 10.0, 0.0], 3000.0));
            clock.finish(2).iter().sum::<f32>()
        };
        let full = 2.0 * (0.2 + 5.0 / 50.0);
        assert!((corner(true) - full - 0.5).abs() < 1e-4);
        // Through the corner at sqrt(500 · 0.01 · sin45/(1 - sin45)) = 3.47 mm/s instead of 0: saves a little.
        assert!(corner(false) < full && corner(false) > full - 0.02);
    }
}
