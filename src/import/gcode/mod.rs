//! Reads G-code line by line: what a line moves, switches and changes, as an RS-274 interpreter sees it. Knows our own
//! files and the common subset of foreign ones; what it cannot follow it says.
use std::f64::consts::TAU;

pub mod axes;
pub mod path;
mod program;
mod words;

/// What the time of a program is reckoned with.
pub use crate::geom::motion;
use path::{Arc, Move, Point};
pub use program::{Program, Stroke, ends, marks, points, read_gcode};
pub use words::{LineError, bare, comment};
use words::{Word, code, known, words};

/// Millimetres per inch.
const INCH: f64 = 25.4;

/// What the spindle output does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Spindle {
    /// M5.
    #[default]
    Off,
    /// M3.
    On,
    /// M4: a laser whose power follows the speed.
    Dynamic,
}

/// How to tell from the state of the program that the tool is at work.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Sense {
    /// A beam: on in feed moves with the spindle on and S above 0.
    Beam,
    /// A servo, by its S word: at work from a fifth of the way down.
    Servo {
        /// S of the lifted tool.
        up: f64,
        /// S of the lowered tool.
        down: f64,
    },
    /// A Z axis: at work below this work coordinate, mm.
    Height {
        /// Half way from the surface to the lifted tool.
        clear: f64,
    },
}

/// Offsets that a controller holds, all in mm.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Offsets {
    /// G54 to G59.
    pub work: [Point; 6],
    /// G92.
    pub g92: Point,
    /// Tool length, along z.
    pub tool: f64,
    /// Where G28 and G30 go, where that is known.
    pub park: [Option<Point>; 2],
}

/// Everything modal.
#[derive(Debug, Clone, PartialEq)]
pub struct State {
    /// Commanded position, machine coordinates, mm.
    pub position: Point,
    /// 0 to 3 for G0 to G3; `None` after G80.
    pub motion: Option<u8>,
    /// 17, 18 or 19.
    pub plane: u8,
    /// G20.
    pub inches: bool,
    /// G91.
    pub relative: bool,
    /// G93.
    pub inverse_time: bool,
    /// Feed, mm/min; 0 before the first F.
    pub feed: f64,
    /// The spindle output.
    pub spindle: Spindle,
    /// S.
    pub speed: f64,
    /// The rotary axis that was turned last and its angle, degrees.
    pub turned: Option<(char, f64)>,
    /// 0 for G54 … 5 for G59.
    pub system: usize,
    /// Offsets in force.
    pub offsets: Offsets,
    /// Whether position and offsets can still be followed.
    pub certain: bool,
}

impl State {
    /// The state after power-up, at a position, with the offsets that the controller holds.
    pub fn new(position: Point, offsets: Offsets) -> Self {
        Self {
            position,
            motion: Some(0),
            plane: 17,
            inches: false,
            relative: false,
            inverse_time: false,
            feed: 0.0,
            spindle: Spindle::Off,
            speed: 0.0,
            turned: None,
            system: 0,
            offsets,
            certain: true,
        }
    }

    /// Machine position of the work zero.
    pub fn work_zero(&self) -> Point {
        let mut zero: Point = std::array::from_fn(|i| self.offsets.work[self.system][i] + self.offsets.g92[i]);
        zero[2] += self.offsets.tool;
        zero
    }

    /// Commanded position in work coordinates, mm.
    pub fn work_position(&self) -> Point {
        let zero = self.work_zero();
        std::array::from_fn(|i| self.position[i] - zero[i])
    }

    /// Whether the tool is at work, given the lower of two heights in work coordinates.
    fn working(&self, sense: Sense, rapid: bool, z: f64) -> bool {
        let on = self.spindle != Spindle::Off;
        match sense {
            Sense::Beam => on && !rapid && self.speed > 0.0,
            Sense::Servo { up, down } => on && (self.speed - up) / (down - up) > 0.2,
            Sense::Height { clear } => z < clear,
        }
    }
}

/// What a line does.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Step {
    /// Movements, in order: one at most, two for G28 and G30.
    pub moves: Vec<Move>,
    /// G4, s.
    pub dwell: f64,
    /// M0, M1 and M6: the operator must act.
    pub pause: bool,
    /// M2 and M30.
    pub end: bool,
    /// The board waits for its motion to end before it does this (spindle, dwell, offsets).
    pub waits: bool,
    /// It writes to the board's permanent memory or is a command of the board (`$…`): to be sent alone.
    pub alone: bool,
    /// Something whose effect is not followed (probing, canned cycles): positions are unsure from here on.
    pub opaque: bool,
    /// A G or M word, or a letter, that is not known here, as it was written.
    pub unknown: Option<String>,
    /// The rotary axis that it turns, and its word.
    pub turns: Option<(char, f64)>,
    /// Whether the tool rests at work after the line.
    pub working: bool,
}

/// Runs a program line by line.
#[derive(Debug, Clone)]
pub struct Interpreter {
    /// The state after the last line.
    pub state: State,
    sense: Sense,
    /// Whether spindle words in a moving line ride with the motion (`$32=1`).
    laser_mode: bool,
}

/// The axis letters of a line and whether any is there.
#[derive(Default)]
struct Values {
    axes: [Option<f64>; 3],
    center: [Option<f64>; 3],
    radius: Option<f64>,
    p: Option<f64>,
    l: Option<f64>,
    s: Option<f64>,
}

impl Interpreter {
    /// Starts in a state.
    pub fn new(state: State, sense: Sense) -> Self {
        Self { state, sense, laser_mode: sense == Sense::Beam }
    }

    /// Whether the tool would be at work if the head moved now.
    pub fn at_work(&self) -> bool {
        self.state.working(self.sense, false, self.state.work_position()[2])
    }

    /// Takes a bare line (see [`bare`]).
    pub fn line(&mut self, bare: &str) -> Result<Step, LineError> {
        let mut step = Step::default();
        if bare.starts_with('$') {
            (step.alone, step.waits) = (true, true);
            step.opaque = !matches!(bare, "$X" | "$I" | "$G" | "$#" | "$$");
            self.state.certain &= !step.opaque;
            step.working = self.state.working(self.sense, false, self.state.work_position()[2]);
            return Ok(step);
        }
        let words = words(bare)?;
        if let Some(bad) = words.iter().find(|it| !it.value.is_finite() || it.value.abs() > 1e9) {
            return Err(LineError::Range(format!("{}{}", bad.letter as char, bad.value)));
        }
        let mut values = Values::default();
        // Units first: they hold for the numbers of their own line.
        for word in &words {
            match (word.letter, code(word)) {
                (b'G', 200) => self.state.inches = true,
                (b'G', 210) => self.state.inches = false,
                (b'G', 930) => self.state.inverse_time = true,
                (b'G', 940) => self.state.inverse_time = false,
                _ => {}
            }
        }
        let unit = if self.state.inches { INCH } else { 1.0 };
        let mut f = None;
        for word in &words {
            match word.letter {
                axis @ b'X'..=b'Z' => values.axes[usize::from(axis - b'X')] = Some(word.value * unit),
                axis @ b'I'..=b'K' => values.center[usize::from(axis - b'I')] = Some(word.value * unit),
                b'R' => values.radius = Some(word.value * unit),
                b'P' => values.p = Some(word.value),
                b'L' => values.l = Some(word.value),
                b'S' => values.s = Some(word.value),
                axis @ b'A'..=b'C' => step.turns = Some((axis as char, word.value)),
                b'F' => f = Some(word.value),
                _ => {}
            }
        }
        if let Some(f) = f {
            if f < 0.0 {
                return Err(LineError::Range(format!("F{f}")));
            }
            self.state.feed = if self.state.inverse_time { f } else { f * unit };
        }
        if let Some(word) = words.iter().find(|it| !known(it)) {
            // A G word that is not known may scale, turn or shift everything after it.
            step.opaque |= word.letter == b'G';
            self.state.certain &= !step.opaque;
            step.unknown = Some(format!("{}{}", word.letter as char, word.value));
        }
        self.modal(&words, &values, &mut step);
        if let Some((axis, value)) = step.turns {
            let from = self.state.turned.filter(|it| self.state.relative && it.0 == axis).map_or(0.0, |it| it.1);
            self.state.turned = Some((axis, from + value));
        }
        self.motion(&words, &values, &mut step)?;
        if step.end {
            // M2 and M30 put the modes back, as boards do.
            let (position, offsets, certain) = (self.state.position, self.state.offsets.clone(), self.state.certain);
            self.state = State { motion: Some(1), certain, ..State::new(position, offsets) };
        }
        let z = self.state.work_position()[2];
        step.working = match self.sense {
            // The beam of M4 goes out when motion ends; that of M3 stays.
            Sense::Beam => self.state.spindle == Spindle::On && self.state.speed > 0.0 && self.state.motion != Some(0),
            _ => self.state.working(self.sense, false, z),
        };
        Ok(step)
    }

    /// Everything but motion.
    fn modal(&mut self, words: &[Word], values: &Values, step: &mut Step) {
        let state = &mut self.state;
        let before = (state.spindle, state.speed);
        // Marlin takes the seconds of a dwell from S.
        let dwells = values.p.is_none() && words.iter().any(|it| it.letter == b'G' && code(it) == 40);
        if let Some(s) = values.s.filter(|_| !dwells) {
            state.speed = s;
        }
        for word in words {
            match (word.letter, code(word)) {
                (b'M', 0 | 10 | 60) => step.pause = true,
                (b'M', 20 | 300) => step.end = true,
                (b'M', 30) => state.spindle = Spindle::On,
                (b'M', 40) => state.spindle = Spindle::Dynamic,
                (b'M', 50) => state.spindle = Spindle::Off,
                // Marlin's servo: its angle takes the place of S.
                (b'M', 2800) => state.spindle = Spindle::On,
                // Marlin: until motion has ended.
                (b'M', 4000) => step.waits = true,
                (b'G', 40) => step.dwell = values.p.or(values.s).unwrap_or(0.0).max(0.0),
                (b'G', it @ (170 | 180 | 190)) => state.plane = (it / 10) as u8,
                (b'G', 900) => state.relative = false,
                (b'G', 910) => state.relative = true,
                (b'G', it @ (540 | 550 | 560 | 570 | 580 | 590)) => state.system = (it / 10 - 54) as usize,
                (b'G', 490) => state.offsets.tool = 0.0,
                (b'G', 431) => state.offsets.tool = values.axes[2].unwrap_or(0.0),
                _ => {}
            }
            step.waits |= word.letter == b'G' && code(word) == 40;
        }
        step.waits |= step.pause || step.end;
        // Boards wait only where the output changes; in laser mode a change of S alone rides with the motion.
        let moving = words.iter().any(|it| matches!(it.letter, b'X'..=b'Z'));
        let (switched, changed) = (state.spindle != before.0, state.speed != before.1);
        step.waits |= switched || changed && state.spindle != Spindle::Off && !(self.laser_mode && moving);
    }

    fn motion(&mut self, words: &[Word], values: &Values, step: &mut Step) -> Result<(), LineError> {
        let mut machine = false;
        let mut takes_axes = true;
        for word in words.iter().filter(|it| it.letter == b'G') {
            match code(word) {
                it @ (0 | 10 | 20 | 30) => self.state.motion = Some((it / 10) as u8),
                800 => self.state.motion = None,
                530 => machine = true,
                it @ (280 | 300) => {
                    self.park(usize::from(it == 300), values, step);
                    takes_axes = false;
                }
                281 | 301 => {
                    self.state.offsets.park[usize::from(code(word) == 301)] = Some(self.state.position);
                    (step.alone, step.waits) = (true, true);
                }
                100 => {
                    self.set_offsets(values, step);
                    takes_axes = false;
                }
                920 => {
                    let work = self.state.work_position();
                    // The present point gets the given coordinates; other axes keep their shift.
                    for (i, value) in values.axes.iter().enumerate().filter_map(|(i, it)| Some((i, (*it)?))) {
                        self.state.offsets.g92[i] += work[i] - value;
                    }
                    step.waits = true;
                    takes_axes = false;
                }
                921 => self.state.offsets.g92 = [0.0; 3],
                431 => takes_axes = false,
                // Probing, splines, canned cycles: where they end is not known here.
                382..=385 | 50 | 51 | 52 | 730 | 760 | 810..=890 => {
                    step.opaque = true;
                    self.state.certain = false;
                    takes_axes = false;
                }
                _ => {}
            }
        }
        if !takes_axes || values.axes.iter().all(Option::is_none) && !self.full_circle(values) {
            return Ok(());
        }
        let Some(motion) = self.state.motion else { return Ok(()) };
        let to = self.target(values, machine);
        let arc = if motion >= 2 { Some(self.arc(motion == 3, to, values)?) } else { None };
        self.go(to, arc, motion == 0, step);
        Ok(())
    }

    /// An arc with a centre and no end point is a full circle.
    fn full_circle(&self, values: &Values) -> bool {
        self.state.motion.is_some_and(|it| it >= 2) && values.center.iter().any(Option::is_some)
    }

    fn target(&self, values: &Values, machine: bool) -> Point {
        let zero = self.state.work_zero();
        std::array::from_fn(|i| match values.axes[i] {
            None => self.state.position[i],
            Some(value) if machine => value,
            Some(value) if self.state.relative => self.state.position[i] + value,
            Some(value) => zero[i] + value,
        })
    }

    fn go(&mut self, to: Point, arc: Option<Arc>, rapid: bool, step: &mut Step) {
        let zero = self.state.work_zero()[2];
        let low = self.state.position[2].min(to[2]) - zero;
        let working = self.state.working(self.sense, rapid, low);
        let mut it = Move { from: self.state.position, to, arc, rapid, feed: self.state.feed, working };
        if self.state.inverse_time {
            it.feed = it.length() * self.state.feed;
        }
        self.state.position = to;
        step.moves.push(it);
    }

    /// G28 and G30: by way of the given point, if any, to the stored one.
    fn park(&mut self, which: usize, values: &Values, step: &mut Step) {
        let Some(park) = self.state.offsets.park[which] else {
            step.opaque = true;
            self.state.certain = false;
            return;
        };
        if values.axes.iter().any(Option::is_some) {
            let via = self.target(values, false);
            self.go(via, None, true, step);
            let to = std::array::from_fn(|i| values.axes[i].map_or(self.state.position[i], |_| park[i]));
            self.go(to, None, true, step);
        } else {
            self.go(park, None, true, step);
        }
    }

    /// G10 L2 and L20.
    fn set_offsets(&mut self, values: &Values, step: &mut Step) {
        let system = match values.p {
            Some(p @ 1.0..=6.0) => p as usize - 1,
            _ => self.state.system,
        };
        let (l2, l20) = (values.l == Some(2.0), values.l == Some(20.0));
        for i in 0..3 {
            if let Some(value) = values.axes[i] {
                let others = self.state.offsets.g92[i] + if i == 2 { self.state.offsets.tool } else { 0.0 };
                let slot = &mut self.state.offsets.work[system][i];
                if l20 {
                    *slot = self.state.position[i] - others - value;
                } else if l2 {
                    *slot = if self.state.relative { *slot + value } else { value };
                }
            }
        }
        (step.alone, step.waits) = (true, true);
        step.opaque |= !l2 && !l20;
    }

    /// The arc from the present position (NIST RS274NGC, section 3.5.3).
    fn arc(&self, counter_clockwise: bool, to: Point, values: &Values) -> Result<Arc, LineError> {
        let axes = match self.state.plane {
            18 => [2, 0],
            19 => [1, 2],
            _ => [0, 1],
        };
        let from = axes.map(|it| self.state.position[it]);
        let end = axes.map(|it| to[it]);
        let center = match values.radius {
            Some(r) => {
                let (dx, dy) = (end[0] - from[0], end[1] - from[1]);
                let half = dx.hypot(dy) / 2.0;
                if half < 1e-9 {
                    return Err(LineError::Arc("it has a radius but begins where it ends; give I and J".into()));
                }
                // Rounded numbers leave the half chord a little longer than the radius.
                if half > r.abs() * 1.001 + 0.005 {
                    return Err(LineError::Arc(format!("its ends are {:.3} mm apart, its radius is {r}", 2.0 * half)));
                }
                let h = (r * r - half * half).max(0.0).sqrt() / (2.0 * half);
                let side = if counter_clockwise == (r > 0.0) { 1.0 } else { -1.0 };
                [(from[0] + end[0]) / 2.0 - side * h * dy, (from[1] + end[1]) / 2.0 + side * h * dx]
            }
            None => {
                let offset = axes.map(|it| values.center[it]);
                if offset.iter().all(Option::is_none) {
                    return Err(LineError::Arc("it has neither R nor a centre (I, J, K)".into()));
                }
                [from[0] + offset[0].unwrap_or(0.0), from[1] + offset[1].unwrap_or(0.0)]
            }
        };
        let radius = (from[0] - center[0]).hypot(from[1] - center[1]);
        let other = (end[0] - center[0]).hypot(end[1] - center[1]);
        // The tolerance of GRBL (error:33): 0.005 mm, or half a millimetre where that is under 0.1 % of the radius.
        let off = (radius - other).abs();
        if radius < 1e-9 || off > 0.5 || off > 0.005 && off > 0.001 * radius {
            return Err(LineError::Arc(format!("its radius is {radius:.4} at the start and {other:.4} at the end")));
        }
        let start = (from[1] - center[1]).atan2(from[0] - center[0]);
        let stop = (end[1] - center[1]).atan2(end[0] - center[0]);
        let turn = if counter_clockwise { stop - start } else { start - stop }.rem_euclid(TAU);
        // Equal ends mean a full turn; rounding may leave a hair on either side.
        let hair = 5e-7;
        let turn = if turn < hair || turn > TAU - hair { TAU } else { turn };
        Ok(Arc { axes, center, start, sweep: if counter_clockwise { turn } else { -turn }, radius })
    }
}

#[cfg(test)]
mod tests {
    use super::path::distance;
    use super::*;

    fn run(program: &str) -> (Interpreter, Vec<Step>) {
        let mut it = Interpreter::new(State::new([0.0; 3], Offsets::default()), Sense::Beam);
        let steps = program.lines().map(|line| it.line(&bare(line)).unwrap()).collect();
        (it, steps)
    }

    #[test]
    fn comments_blanks_and_tape_marks_go() {
        assert_eq!(bare("g1 x 1.5 (to (the) end) y-2 ; fast"), "G1X1.5Y-2");
        assert_eq!(bare(" % "), "");
        assert_eq!(comment("G1 (part 3) X1"), Some("part 3"));
        assert_eq!(comment("; contour 4 "), Some("contour 4"));
    }

    #[test]
    fn units_modes_and_offsets() {
        let (it, _) = run("G20 G1 X1 F10\nG21 G91 X-5.4\nG90 G92 X0\nG1 X7\nG10 L2 P2 X100\nG55 G53 G0 Y3");
        assert!((it.state.feed - 254.0).abs() < 1e-9);
        assert!(distance(it.state.position, [27.0, 3.0, 0.0]) < 1e-9, "{:?}", it.state.position);
        assert!(distance(it.state.work_zero(), [120.0, 0.0, 0.0]) < 1e-9, "G92 rides on top of G55");
    }

    #[test]
    fn arcs_by_centre_and_by_radius_agree() {
        let (_, steps) = run("G1 X10 F100\nG3 X0 Y10 I-10\nG2 X10 Y0 R10\nG2 I-10\nG3 X0 Y10 R-10");
        let arc = |i: usize| steps[i].moves[0];
        let quarter = 10.0 * TAU / 4.0;
        for (i, length) in [(1, quarter), (2, quarter), (3, 4.0 * quarter), (4, 3.0 * quarter)] {
            assert!((arc(i).length() - length).abs() < 1e-6, "{i}: {}", arc(i).length());
            assert!(distance(arc(i).point(1.0), arc(i).to) < 1e-9);
        }
        let mut low = [f64::MAX; 2];
        arc(3).extremes(|p| (0..2).for_each(|i| low[i] = low[i].min(p[i])));
        assert!((low[0] + 10.0).abs() < 1e-9 && (low[1] + 10.0).abs() < 1e-9, "a full circle reaches all round");
        let (off, share) = arc(1).nearest([8.0, 8.0, 0.0]);
        assert!((share - 0.5).abs() < 1e-9 && (off - (128_f64.sqrt() - 10.0)).abs() < 1e-9);
    }

    #[test]
    fn the_tool_is_at_work_where_the_head_says() {
        let work = |program: &str, sense| {
            let mut it = Interpreter::new(State::new([0.0; 3], Offsets::default()), sense);
            let steps: Vec<Step> = program.lines().map(|line| it.line(&bare(line)).unwrap()).collect();
            steps.iter().flat_map(|it| &it.moves).map(|it| it.working).collect::<Vec<_>>()
        };
        assert_eq!(work("M4 S0\nG0 X1\nG1 X2 S100 F9\nG0 X3\nM5\nG1 X4", Sense::Beam), [false, true, false, false]);
        let servo = Sense::Servo { up: 40.0, down: 90.0 };
        assert_eq!(work("M3 S40\nG0 X1\nM3 S65\nG1 X2 F9\nM3 S40\nG0 X3", servo), [false, true, false]);
        let z = Sense::Height { clear: 1.0 };
        assert_eq!(work("G0 Z2\nG0 X1\nG1 Z0 F9\nG1 X2\nG0 Z2", z), [true, false, true, true, true]);
    }

    #[test]
    fn what_cannot_be_read_is_said() {
        let mut it = Interpreter::new(State::new([0.0; 3], Offsets::default()), Sense::Beam);
        for (line, expected) in [
            ("G1 X", "`X` is not a word"),
            ("G1 X1..2", "`X1..2` is not a word"),
            ("#1=4", "variables"),
            ("G2 X1", "neither R nor a centre"),
            ("G2 X10 R1", "its ends are 10.000 mm apart"),
            ("G2 X10 I4", "its radius is 4.0000 at the start"),
            ("G1 X1 F-1", "`F-1` is out of range"),
            ("é", "is not a word"),
        ] {
            let text = it.line(&bare(line)).unwrap_err().to_string();
            assert!(text.contains(expected), "{line}: {text}");
        }
    }
}
