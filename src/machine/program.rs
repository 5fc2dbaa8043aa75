//! A program as the sender needs it before the first byte: contours, time per line, bounds, and what cannot be sent.
use super::timing::{Clock, Limits};
use crate::{
    import::gcode::{
        Interpreter, LineError, Sense, Spindle, State, bare, comment,
        path::{Point, distance},
    },
    profile::{Dialect, Head},
};

/// The longest line that boards take; from 80 characters on they answer error:11.
pub const LONGEST_LINE: usize = 79;

/// A box, mm; empty when `min > max`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    /// Smallest coordinates.
    pub min: Point,
    /// Largest coordinates.
    pub max: Point,
}

impl Bounds {
    /// Holds nothing.
    pub const EMPTY: Self = Self { min: [f64::INFINITY; 3], max: [f64::NEG_INFINITY; 3] };

    /// Grows to hold a point.
    pub fn add(&mut self, p: Point) {
        for (i, x) in p.into_iter().enumerate() {
            self.min[i] = self.min[i].min(x);
            self.max[i] = self.max[i].max(x);
        }
    }

    /// Whether it holds no point.
    pub fn is_empty(&self) -> bool {
        self.min[0] > self.max[0]
    }
}

/// One uninterrupted stretch with the tool at work.
#[derive(Debug, Clone, PartialEq)]
pub struct Contour {
    /// Index of the line after the contour before: where the way to this one begins.
    pub approach: usize,
    /// Index of the first line that works.
    pub first: usize,
    /// Index of the last line that works.
    pub last: usize,
    /// Where it begins, work coordinates.
    pub start: Point,
    /// Seconds with its approach.
    pub seconds: f64,
    /// The comment before it, if there is one: bytes of the text.
    pub(super) label: Option<(usize, usize)>,
}

/// A line of the program that cannot be sent.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ProgramError {
    /// It cannot be read.
    #[error("line {line}: {cause} in `{text}`")]
    Line {
        /// From 1.
        line: usize,
        /// The line.
        text: String,
        /// Why.
        cause: LineError,
    },
    /// It is too long even without comments.
    #[error("line {line} has {length} characters without its comments; boards take at most {LONGEST_LINE} (error:11)")]
    Long {
        /// From 1.
        line: usize,
        /// Characters.
        length: usize,
    },
    /// It stops for the operator with the tool at work.
    #[error(
        "line {line}: the program pauses here with the tool at work; lift it or switch it off before M0, M1 or M6, \
             unless the program was made for another machine than this one"
    )]
    PauseAtWork {
        /// From 1.
        line: usize,
    },
    /// A working move without a feed.
    #[error("line {line}: a feed move before any F word (boards answer error:22)")]
    NoFeed {
        /// From 1.
        line: usize,
    },
    /// Nothing in it.
    #[error("the program moves nothing")]
    Empty,
}

/// Where a program begins and how its effects are read.
#[derive(Debug, Clone, PartialEq)]
pub struct Setting {
    /// State of the controller before the first line.
    pub state: State,
    /// How the tool shows.
    pub sense: Sense,
    /// For the times.
    pub limits: Limits,
}

/// A program that can be sent.
#[derive(Debug, Clone, PartialEq)]
pub struct Program {
    pub(super) text: String,
    /// Byte offsets of the lines.
    pub(super) lines: Vec<u32>,
    /// Estimated seconds of each line.
    pub seconds: Vec<f32>,
    /// Its contours in order.
    pub contours: Vec<Contour>,
    /// Everything the head passes, machine coordinates.
    pub machine: Bounds,
    /// Everything it passes, work coordinates.
    pub work: Bounds,
    /// What the tool touches, work coordinates.
    pub touched: Bounds,
    /// Lines at which it waits for the operator, indices.
    pub pauses: Vec<usize>,
    /// First line whose effect on the position is not followed: bounds and tracking end there.
    pub opaque: Option<usize>,
    /// Whether it sets offsets of its own (G10, G92): it then cannot be resumed.
    pub shifts: bool,
    /// First line, an index, that turns a rotary axis, and its letter.
    pub turns: Option<(usize, char)>,
    /// Length with the tool at work, mm.
    pub worked: f64,
    /// Length without, mm.
    pub travelled: f64,
    /// For HPGL: the speed with the tool down, mm/min. G-code otherwise.
    pub(super) plot: Option<f64>,
}

impl Sense {
    /// How the tool of a head shows in G-code.
    pub fn of(head: &Head) -> Self {
        match *head {
            Head::Laser { .. } => Self::Beam,
            Head::Servo { up, down, .. } => Self::Servo { up, down },
            Head::Z { up, .. } => Self::Height { clear: up / 2.0 },
        }
    }
}

/// Facts gathered while a program is read.
struct Reading {
    clock: Clock,
    contours: Vec<Contour>,
    machine: Bounds,
    work: Bounds,
    touched: Bounds,
    pauses: Vec<usize>,
    opaque: Option<usize>,
    shifts: bool,
    turns: Option<(usize, char)>,
    worked: f64,
    travelled: f64,
    /// Whether the last move belonged to a contour that is not ended.
    open: bool,
    label: Option<(usize, usize)>,
}

impl Program {
    /// Reads a whole program. Every error is found here, before anything is sent.
    pub fn read(text: String, setting: &Setting) -> Result<Self, Vec<ProgramError>> {
        let mut lines = vec![0_u32];
        lines.extend(text.bytes().enumerate().filter(|it| it.1 == b'\n').map(|it| it.0 as u32 + 1));
        if lines.last().is_some_and(|&it| it as usize == text.len()) {
            lines.pop();
        }
        let mut it = Interpreter::new(setting.state.clone(), setting.sense);
        let mut reading = Reading::new(setting.limits);
        let mut errors = Vec::new();
        let mut ended = false;
        for index in 0..lines.len() {
            let line = line_of(&text, &lines, index);
            if let Some(label) = comment(line) {
                let at = label.as_ptr() as usize - text.as_ptr() as usize;
                reading.label = Some((at, at + label.len()));
            }
            // Nothing after M2 is part of the program.
            let plain = bare(line);
            if ended || plain.is_empty() {
                continue;
            }
            match reading.line(index, &plain, &mut it) {
                Ok(end) => ended = end,
                Err(error) => errors.push(error),
            }
            if errors.len() >= 20 {
                break;
            }
        }
        if errors.is_empty() && reading.machine.is_empty() && reading.opaque.is_none() {
            errors.push(ProgramError::Empty);
        }
        if !errors.is_empty() {
            return Err(errors);
        }
        let seconds = reading.clock.finish(lines.len());
        let mut contours = reading.contours;
        for contour in &mut contours {
            contour.seconds = seconds[contour.approach..=contour.last].iter().map(|&it| f64::from(it)).sum();
        }
        Ok(Self {
            text,
            lines,
            seconds,
            contours,
            machine: reading.machine,
            work: reading.work,
            touched: reading.touched,
            pauses: reading.pauses,
            opaque: reading.opaque,
            shifts: reading.shifts,
            turns: reading.turns,
            worked: reading.worked,
            travelled: reading.travelled,
            plot: None,
        })
    }

    /// Number of lines.
    pub fn len(&self) -> usize {
        self.lines.len()
    }

    /// Whether there is no line.
    pub fn is_empty(&self) -> bool {
        self.lines.is_empty()
    }

    /// A line as it is in the file, from index 0.
    pub fn line(&self, index: usize) -> &str {
        line_of(&self.text, &self.lines, index)
    }

    /// The whole text.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Estimated seconds of the whole.
    pub fn total_seconds(&self) -> f64 {
        self.seconds.iter().map(|&it| f64::from(it)).sum()
    }

    /// The contour that a line belongs to, with its approach; `None` after the last one.
    pub fn contour_of(&self, index: usize) -> Option<usize> {
        let at = self.contours.partition_point(|it| it.last < index);
        (at < self.contours.len()).then_some(at)
    }

    /// For a message: number from 1, label and place of a contour.
    pub fn describe(&self, contour: usize) -> String {
        let Some(it) = self.contours.get(contour) else { return format!("contour {}", contour + 1) };
        let label = it.label.map(|(from, to)| format!(" ({})", &self.text[from..to])).unwrap_or_default();
        format!(
            "contour {} of {}{label}, lines {} to {}, from X{:.3} Y{:.3}",
            contour + 1,
            self.contours.len(),
            it.first + 1,
            it.last + 1,
            it.start[0],
            it.start[1]
        )
    }
}

fn line_of<'t>(text: &'t str, lines: &[u32], index: usize) -> &'t str {
    let Some(&from) = lines.get(index) else { return "" };
    let to = lines.get(index + 1).map_or(text.len(), |&it| it as usize);
    text[from as usize..to].trim_end_matches(['\n', '\r'])
}

impl Reading {
    fn new(limits: Limits) -> Self {
        Self {
            clock: Clock::new(limits),
            contours: Vec::new(),
            machine: Bounds::EMPTY,
            work: Bounds::EMPTY,
            touched: Bounds::EMPTY,
            pauses: Vec::new(),
            opaque: None,
            shifts: false,
            turns: None,
            worked: 0.0,
            travelled: 0.0,
            open: false,
            label: None,
        }
    }

    /// Takes a line; true when the program ends with it.
    fn line(&mut self, index: usize, plain: &str, it: &mut Interpreter) -> Result<bool, ProgramError> {
        let number = index + 1;
        if plain.len() > LONGEST_LINE {
            return Err(ProgramError::Long { line: number, length: plain.len() });
        }
        let was_working = it.state.clone();
        let before = it.state.work_zero();
        let step =
            it.line(plain).map_err(|cause| ProgramError::Line { line: number, text: plain.to_owned(), cause })?;
        if step.opaque && self.opaque.is_none() {
            self.opaque = Some(index);
        }
        if step.pause {
            if step.working {
                return Err(ProgramError::PauseAtWork { line: number });
            }
            self.pauses.push(index);
            self.open = false;
        }
        self.shifts |= it.state.offsets != was_working.offsets;
        self.turns = self.turns.or(step.turns.map(|it| (index, it.0)));
        if step.waits {
            self.clock.stop(index, step.dwell);
        }
        let zero = it.state.work_zero();
        // The tool went off between two moves: a new contour even if both work.
        self.open &= step.working || !step.moves.is_empty() || !matches!(plain.as_bytes(), [b'M', ..]);
        for way in &step.moves {
            if !way.rapid && way.feed <= 0.0 && way.length() > 0.0 {
                return Err(ProgramError::NoFeed { line: number });
            }
            self.clock.travel(index, way);
            let length = way.length();
            *(if way.working { &mut self.worked } else { &mut self.travelled }) += length;
            if self.opaque.is_none() {
                if way.working {
                    self.touched.add(std::array::from_fn(|i| way.from[i] - before[i]));
                }
                way.extremes(|p| {
                    self.machine.add(p);
                    let work = std::array::from_fn(|i| p[i] - zero[i]);
                    self.work.add(work);
                    if way.working {
                        self.touched.add(work);
                    }
                });
            }
            if !way.working {
                self.open = self.open && distance(way.from, way.to) < 1e-9;
                continue;
            }
            match self.contours.last_mut() {
                Some(contour) if self.open => contour.last = index,
                last => {
                    let approach = last.map_or(0, |it| it.last + 1).min(index);
                    let start = std::array::from_fn(|i| way.from[i] - before[i]);
                    let label = self.label;
                    self.contours.push(Contour { approach, first: index, last: index, start, seconds: 0.0, label });
                    self.open = true;
                }
            }
        }
        Ok(step.end)
    }
}

/// What to send to go on at a contour: the modes as they are before its approach, the tool off, the head where the
/// contour before ended. Feed and spindle words come last, when the head is in place.
pub fn preamble(state: &State, sense: Sense, decimals: usize, dialect: Dialect) -> Vec<String> {
    let work = state.work_position();
    let system = 54 + state.system;
    // Marlin takes one word a line and knows no planes, systems and kinds of feed.
    let marlin = dialect == Dialect::Marlin;
    let mut out = if marlin {
        vec!["G21".to_owned(), "G90".to_owned()]
    } else {
        vec![format!("G21G90G94G{}G{system}", state.plane), "M5".to_owned()]
    };
    if let Sense::Height { clear } = sense {
        // Up first; the program's own height only once it is above the work.
        out.push(format!("G0Z{:.decimals$}", (2.0 * clear).max(work[2])));
    }
    if let Sense::Servo { up, .. } = sense {
        out.push(if marlin { format!("M280P0S{up}") } else { format!("M3S{up}") });
        out.push(if marlin { "G4S0.3" } else { "G4P0.3" }.to_owned());
    } else if marlin {
        out.push("M5".to_owned());
    }
    out.push(format!("G0X{:.decimals$}Y{:.decimals$}", work[0], work[1]));
    if let Some((axis, angle)) = state.turned {
        out.push(format!("G0{axis}{angle:.3}"));
    }
    let spindle = match state.spindle {
        Spindle::Off => "M5",
        Spindle::On => "M3",
        Spindle::Dynamic => "M4",
    };
    // The beam never comes on at a standstill: the motion word stays G0 until the program moves.
    match sense {
        Sense::Servo { .. } if marlin => out.push(format!("M280P0S{}", state.speed)),
        _ => out.push(format!("{spindle}S{}", state.speed)),
    }
    let mut modes = String::new();
    if state.feed > 0.0 && !state.inverse_time {
        // Marlin knows no line of a feed alone; G1 without axes sets it.
        modes += &format!("{}F{:.3}", if marlin { "G1" } else { "" }, state.feed);
    }
    if state.inches {
        modes += "G20";
        if state.feed > 0.0 && !state.inverse_time {
            modes = format!("G20F{:.4}", state.feed / 25.4);
        }
    }
    if state.inverse_time {
        modes += "G93";
    }
    if state.relative {
        modes += "G91";
    }
    if !modes.is_empty() {
        out.push(modes);
    }
    // In a program that leaves the motion mode to the line before, the next line has only coordinates. G0 is in force;
    // another mode needs its axis words in the same block, so a move of no length sets it.
    let lit = sense == Sense::Beam && state.spindle == Spindle::On && state.speed > 0.0;
    let plain = !state.relative && !state.inverse_time && !state.inches;
    if state.motion == Some(1) && plain && state.feed > 0.0 && !lit {
        out.push(format!("G1X{:.decimals$}", work[0]));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::import::gcode::Offsets;

    pub(crate) fn setting(sense: Sense) -> Setting {
        Setting {
            state: State::new([0.0; 3], Offsets::default()),
            sense,
            limits: Limits { rate: [6000.0; 3], acceleration: [500.0; 3], junction: 0.01 },
        }
    }

    const SQUARES: &str = "G21 G90\nM3 S40\n; part 1\nG0 X10 Y10\nM3 S90\nG4 P0.2\nG1 X20 F1000\nG1 Y20\nM3 S40\nG0 X30 Y10\nM3 S90\nG1 X40\nG1 Y20\nM3 S40\nG0 X0 Y0\nM2\nG1 X999\n";

    #[test]
    fn contours_bounds_and_times() {
        let sense = Sense::Servo { up: 40.0, down: 90.0 };
        let program = Program::read(SQUARES.into(), &setting(sense)).unwrap();
        let spans: Vec<_> = program.contours.iter().map(|it| (it.approach, it.first, it.last)).collect();
        assert_eq!(spans, [(0, 6, 7), (8, 11, 12)]);
        assert_eq!(program.contours[0].start[..2], [10.0, 10.0]);
        assert_eq!((program.touched.min[0], program.touched.max[0]), (10.0, 40.0));
        assert_eq!((program.work.min[0], program.work.max[0]), (0.0, 40.0), "nothing after M2 counts");
        assert!((program.worked - 40.0).abs() < 1e-9);
        assert!(program.describe(0).contains("contour 1 of 2 (part 1), lines 7 to 8, from X10.000 Y10.000"));
        assert_eq!([8, 12, 13].map(|it| program.contour_of(it)), [Some(1), Some(1), None]);
        assert!(program.total_seconds() > 40.0 / (1000.0 / 60.0) + 0.2);
    }

    #[test]
    fn what_a_board_would_refuse_is_found_first() {
        let read = |text: &str| {
            let errors = Program::read(text.into(), &setting(Sense::Beam)).unwrap_err();
            errors.iter().map(ToString::to_string).collect::<Vec<_>>().join("; ")
        };
        assert!(read(&format!("G1 X{} F1", "0".repeat(78))).contains("line 1 has 83 characters"));
        assert!(read("G1 X1").contains("line 1: a feed move before any F"));
        assert!(read("M3 S1\nG1 X1 F9\nM0").contains("line 3: the program pauses here with the tool at work"));
        assert!(read("; nothing").contains("moves nothing"));
        assert!(read("G1 X1 F1\nG1 Xa").contains("line 2: `X`"));
    }
}
