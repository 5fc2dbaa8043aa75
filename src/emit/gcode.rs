//! G-code for GRBL-type boards: one program per sheet, from its toolpaths.
//!
//! Rules kept (see `MACHINE.md`): modal words only where they change, lines under 80 characters ending in LF, absolute
//! coordinates with fixed decimals (so rounding never adds up), tool off before the first move, during every rapid and at
//! the end. The beam is off on rapids twice over: by S0, and by laser mode itself.
use std::io;

use super::drawing::decimal;
use crate::{
    geom::{
        Vec2,
        arcs::{self, ArcPath},
    },
    model::{Operation, SheetPaths},
    profile::{Dialect, Head, Machine, Profiles, RotaryAxis, Tool},
};

/// GRBL refuses lines of 80 characters and more.
const LINE: usize = 79;

/// Arcs with a chord or radius of fewer steps of the last decimal are written as their chord: rounding could turn their
/// ends so far that a board runs round the rest of the circle instead.
const LEAST_STEPS: f64 = 5.0;

/// A blade that an axis turns by no more than this many degrees turns while it moves on.
const RIDES: f64 = 2.0;

/// Which sheet of how many.
#[derive(Debug, Clone, Copy)]
pub struct Number {
    /// From 1.
    pub index: usize,
    /// Of so many.
    pub count: usize,
}

/// Writes the program of one sheet.
pub(super) fn write(
    sheet: &SheetPaths,
    number: Number,
    profiles: &Profiles,
    out: &mut dyn io::Write,
) -> io::Result<()> {
    let machine = &profiles.machine;
    let mut program = Program { machine, sheet: sheet.size, text: String::new(), state: State::default() };
    program.comment(&format!("fabricate: sheet {} of {}", number.index, number.count));
    program.comment(&format!("stock {} x {} mm, {}", sheet.size.x, sheet.size.y, profiles.material.title));
    program.comment(&format!("machine: {}", machine.title));
    match machine.head.laser_mode() {
        Some(true) => program.comment("the board needs laser mode: $32=1"),
        Some(false) => program.comment("the board needs laser mode off: $32=0"),
        None => {}
    }
    match machine.dialect {
        // One word a line; it knows neither planes nor systems.
        Dialect::Marlin => {
            program.line("G21");
            program.line("G90");
        }
        Dialect::Grbl => program.line("G21 G90 G94 G17 G54"),
        // Corners may be rounded by a hundredth of a millimetre instead of stopping in each.
        Dialect::LinuxCnc => program.line("G21 G90 G94 G17 G54 G64 P0.01"),
    }
    program.start();
    for (k, path) in sheet.paths.iter().enumerate() {
        // What the machine has no tool for is not done; `route` leaves such paths out.
        let (Some(tool), Some(&first)) = (machine.tools.get(path.operation), path.path.points.first()) else {
            continue;
        };
        program.change(path.operation, tool);
        let straight;
        let way = if machine.arcs {
            &path.path
        } else {
            straight = ArcPath::straight(path.path.chords(super::CHORD));
            &straight
        };
        if !path.joined {
            program.rapid(first);
        }
        let axis = machine.knife.filter(|_| machine.is_blade(tool)).and_then(|it| it.axis);
        if let (Some(axis), [a, b, ..]) = (axis, &way.points[..]) {
            program.turn(axis, [*a, *b], 0.0);
        }
        if !path.joined || path.depth != sheet.paths[k - 1].depth {
            program.lower(tool, path.depth);
        }
        for (from, to, bulge) in way.stretches() {
            if let Some(axis) = axis {
                program.turn(axis, [from, to], RIDES);
            }
            program.feed(from, to, bulge, tool);
        }
        if sheet.paths.get(k + 1).is_none_or(|it| !it.joined) {
            program.lift();
        }
    }
    program.end();
    out.write_all(program.text.as_bytes())
}

/// The modal state of the board as far as the program has set it, as the text that set it.
#[derive(Debug, Default)]
struct State {
    motion: &'static str,
    position: [String; 2],
    feed: String,
    power: String,
    operation: Option<Operation>,
    tool: Option<u32>,
    /// Degrees of the axis that turns a blade, and its word for the next move.
    angle: f64,
    turning: Option<String>,
}

struct Program<'a> {
    machine: &'a Machine,
    sheet: Vec2,
    text: String,
    state: State,
}

impl Program<'_> {
    fn line(&mut self, line: &str) {
        self.text.push_str(line);
        self.text.push('\n');
    }

    /// A comment: ASCII without parentheses, cut to the length of a line.
    fn comment(&mut self, text: &str) {
        let plain = text.replace('₂', "2").replace('×', "x").replace('²', "2");
        let plain: String =
            plain.chars().filter(|c| matches!(c, ' '..='~') && !"()".contains(*c)).take(LINE - 2).collect();
        let marlin = self.machine.dialect == Dialect::Marlin;
        self.line(&if marlin { format!("; {plain}") } else { format!("({plain})") });
    }

    fn number(&self, value: f64) -> String {
        decimal(value, self.machine.decimals)
    }

    /// S words, feeds and times: short, at most three decimals.
    fn word(value: f64) -> String {
        decimal(value, 3).trim_end_matches('0').trim_end_matches('.').into()
    }

    fn dwell(&mut self, seconds: f64) {
        if seconds > 0.0 {
            // Marlin takes milliseconds from P and seconds from S.
            let letter = if self.machine.dialect == Dialect::Marlin { 'S' } else { 'P' };
            self.line(&format!("G4 {letter}{}", Self::word(seconds)));
        }
    }

    /// Tool on, but idle.
    fn start(&mut self) {
        match self.machine.head {
            Head::Laser { dynamic, .. } => {
                // I: the power of the moves rides with them (Marlin's inline mode).
                let inline = if self.machine.dialect == Dialect::Marlin { " I" } else { "" };
                self.line(&format!("{}{inline} S0", if dynamic { "M4" } else { "M3" }));
                self.state.power = "0".into();
            }
            Head::Servo { .. } => self.lift(),
            Head::Z { .. } => {
                self.spindle_off();
                self.lift();
            }
        }
    }

    /// A Marlin board without a spindle would complain.
    fn spindle_off(&mut self) {
        if self.machine.dialect != Dialect::Marlin {
            self.line("M5");
        }
    }

    /// Names the operation where it changes, and pauses where another tool is needed. The first tool is expected in the
    /// holder.
    fn change(&mut self, operation: Operation, tool: &Tool) {
        if self.state.operation == Some(operation) {
            return;
        }
        self.state.operation = Some(operation);
        self.comment(&format!("{}: tool {}", operation.name(), tool.number));
        if self.state.tool.is_some_and(|it| it != tool.number) {
            self.line("M0");
        }
        self.state.tool = Some(tool.number);
    }

    /// The board must have stopped before the servo turns; GRBL sees to that itself.
    fn servo(&mut self, to: f64) {
        let to = Self::word(to);
        if self.machine.dialect == Dialect::Marlin {
            self.line("M400");
            self.line(&format!("M280 P0 S{to}"));
        } else {
            self.line(&format!("M3 S{to}"));
        }
    }

    fn lower(&mut self, tool: &Tool, depth: f64) {
        match self.machine.head {
            Head::Laser { .. } => {}
            Head::Servo { down, dwell_down, .. } => {
                self.servo(tool.down.unwrap_or(down));
                self.dwell(dwell_down);
            }
            Head::Z { down, plunge, dwell, .. } => {
                // Nothing of nothing is not minus nothing.
                let (height, feed) = (self.number(depth * tool.down.unwrap_or(down) + 0.0), Self::word(plunge));
                self.line(&format!("G1 Z{height} F{feed}"));
                self.state.motion = "G1";
                self.state.feed = feed;
                self.dwell(dwell);
            }
        }
    }

    fn lift(&mut self) {
        match self.machine.head {
            // The next rapid carries S0; a line of its own would stop the board for nothing.
            Head::Laser { .. } => {}
            Head::Servo { up, dwell_up, .. } => {
                self.servo(up);
                self.dwell(dwell_up);
            }
            Head::Z { up, .. } => {
                self.line(&format!("G0 Z{}", self.number(up)));
                self.state.motion = "G0";
            }
        }
    }

    fn rapid(&mut self, point: Vec2) {
        let power = matches!(self.machine.head, Head::Laser { .. }).then(|| "0".to_string());
        self.motion("G0", point, None, None, power);
    }

    /// Turns a tangential blade into the direction of a line, the shorter way round: with the line itself where that takes
    /// no more than `rides` degrees, before it otherwise. The axis may go round any number of times.
    fn turn(&mut self, axis: RotaryAxis, line: [Vec2; 2], rides: f64) {
        let [a, b] = line.map(|it| self.machine.to_work(it, self.sheet));
        let turn = (b - a).y.atan2((b - a).x).to_degrees() - self.state.angle;
        let turn = turn - 360.0 * (turn / 360.0).round();
        if a == b || turn.abs() < 1e-3 {
            return;
        }
        self.state.angle += turn;
        let word = format!("{}{}", axis.letter(), Self::word(self.state.angle));
        if turn.abs() <= rides {
            self.state.turning = Some(word);
        } else {
            self.line(&format!("G0 {word}"));
            self.state.motion = "G0";
        }
    }

    /// A straight line, or an arc whose centre is given from its start as it was written.
    fn feed(&mut self, from: Vec2, to: Vec2, bulge: f64, tool: &Tool) {
        let power = match self.machine.head {
            Head::Laser { power_max, .. } => Some(Self::word((tool.power * power_max).round())),
            _ => None,
        };
        let feed = Some(Self::word(tool.feed));
        let [start, end] = [from, to].map(|it| self.machine.to_work(it, self.sheet));
        // Rounding may leave nothing of a short arc, or move its ends so far that its radius is another one.
        // A mirrored plane turns the other way.
        let bulge = if self.machine.invert_y { -bulge } else { bulge };
        let least = LEAST_STEPS * 0.1_f64.powi(self.machine.decimals as i32);
        let long = |it: &arcs::Circle| (end - start).norm() > least && it.radius > least;
        let Some(circle) = arcs::circle(start, end, bulge).filter(long) else {
            self.motion("G1", to, None, feed, power);
            return;
        };
        let center = circle.center - start;
        let center = [self.number(center.x), self.number(center.y)];
        self.motion(if bulge > 0.0 { "G3" } else { "G2" }, to, Some(center), feed, power);
    }

    /// One move, with only the words that change. A move to where the tool is already is left out.
    fn motion(
        &mut self,
        motion: &'static str,
        point: Vec2,
        center: Option<[String; 2]>,
        feed: Option<String>,
        power: Option<String>,
    ) {
        let point = self.machine.to_work(point, self.sheet);
        let target = [self.number(point.x), self.number(point.y)];
        let mut words = Vec::with_capacity(5);
        for (axis, (new, old)) in ["X", "Y"].into_iter().zip(target.iter().zip(&self.state.position)) {
            if new != old {
                words.push(format!("{axis}{new}"));
            }
        }
        let still = words.is_empty();
        if let Some([i, j]) = center.filter(|_| !still) {
            words.extend([format!("I{i}"), format!("J{j}")]);
        }
        words.extend(self.state.turning.take().filter(|_| !still));
        if let Some(power) = power.filter(|it| *it != self.state.power && (!still || it == "0")) {
            words.push(format!("S{power}"));
            self.state.power = power;
        }
        if let Some(feed) = feed.filter(|it| *it != self.state.feed && !still) {
            words.push(format!("F{feed}"));
            self.state.feed = feed;
        }
        if words.is_empty() {
            return;
        }
        if motion != self.state.motion && !still {
            words.insert(0, motion.into());
            self.state.motion = motion;
        }
        self.state.position = target;
        self.line(&words.join(" "));
    }

    /// Tool off, back to the work zero, spindle off, end of program.
    fn end(&mut self) {
        if matches!(self.machine.head, Head::Laser { .. }) {
            self.line("M5");
            self.state.power = "0".into();
        }
        // Zero of the machine, whatever corner that is.
        self.rapid(self.machine.from_work(Vec2::zeros(), self.sheet));
        if !matches!(self.machine.head, Head::Laser { .. }) {
            self.spindle_off();
        }
        // Marlin has no end of a program (its M30 deletes files); motion is awaited instead.
        self.line(if self.machine.dialect == Dialect::Marlin { "M400" } else { "M2" });
    }
}
