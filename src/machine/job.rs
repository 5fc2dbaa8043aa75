//! A job on a GRBL-type board, from the greeting to rest: the board's settings against the profile, unlock, home, zero,
//! bounds, frame, check, stream, resume.
use std::path::Path;

use super::{
    board::{Options, profile_limits},
    codes,
    feed::Feed,
    grbl::Grbl,
    journal::{Journal, JournalError},
    link::Wire,
    program::{Program, Setting},
    protocol::{Aborted, Fault, Line},
    session::{SendError, Session},
};
use crate::{
    import::gcode::{LineError, Offsets, Sense, State, path::distance},
    profile::{Corner, Head, Machine, Streaming},
};

/// What to do with a program.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Wishes {
    /// Unlock first.
    pub unlock: bool,
    /// Home first.
    pub home: bool,
    /// Take the present place as the work zero.
    pub zero: bool,
    /// Only let the board read the program (`$C`).
    pub check: bool,
    /// Only go round the job with the tool off.
    pub frame: bool,
    /// Go on with an interrupted job.
    pub resume: bool,
}

/// How a GRBL-type board of this profile is spoken to.
pub fn grbl_options(machine: &Machine) -> Options {
    let (retract, clear_height) = match machine.head {
        Head::Laser { .. } => (Vec::new(), None),
        Head::Servo { up, .. } => (vec![format!("M3S{up}")], None),
        Head::Z { up, .. } => (Vec::new(), Some(up)),
    };
    Options {
        counting: machine.link.streaming == Streaming::Counting,
        buffered: machine.link.buffered,
        boot: machine.link.boot,
        retract,
        clear_height,
    }
}

/// Reads a program as this machine would, without a board: work coordinates are machine coordinates.
pub fn read(text: String, machine: &Machine) -> Result<Program, SendError> {
    let state = State::new([0.0; 3], Offsets::default());
    let setting = Setting { state, sense: Sense::of(&machine.head), limits: profile_limits(machine) };
    Program::read(text, &setting).map_err(|errors| SendError::Refused(errors.iter().map(ToString::to_string).collect()))
}

/// Whether the program stays on the bed, going by the corner of the work zero. Empty when it does.
pub fn bed_faults(program: &Program, machine: &Machine) -> Vec<String> {
    let (left, front) = match machine.origin {
        Corner::LowerLeft => (false, false),
        Corner::LowerRight => (true, false),
        Corner::UpperLeft => (false, true),
        Corner::UpperRight => (true, true),
    };
    let mut out = Vec::new();
    if program.work.is_empty() {
        return out;
    }
    for (i, (axis, negative)) in [("X", left), ("Y", front != machine.invert_y)].into_iter().enumerate() {
        let bed = machine.bed[i].mm;
        let (low, high) = if negative { (-bed, 0.0) } else { (0.0, bed) };
        let (min, max) = (program.work.min[i], program.work.max[i]);
        // Rounded coordinates may stand a hair outside.
        if min < low - 0.01 || max > high + 0.01 {
            out.push(format!(
                "the program goes from {axis}{min:.2} to {axis}{max:.2}, the bed of `{}` from {axis}{low:.2} to \
                 {axis}{high:.2} (work coordinates)",
                machine.name
            ));
        }
    }
    out
}

pub(super) fn query(text: &str) -> Line {
    Line { waits: true, opaque: false, ..Line::command(text) }
}

/// Homing a large, slow machine.
const HOMING: f64 = 180.0;

impl<W: Wire> Session<'_, W, Grbl> {
    /// Connects, compares the board with the profile, unlocks, homes and zeroes as wished.
    pub fn prepare(&mut self, machine: &Machine, wishes: Wishes) -> Result<(), SendError> {
        self.connect()?;
        let mismatches = self.protocol.board.mismatches(machine);
        if !mismatches.is_empty() {
            return Err(SendError::Refused(mismatches));
        }
        if wishes.unlock {
            self.command(query("$X"))?;
        }
        // Going on with a job needs a position that is sure.
        let sure = wishes.resume && !wishes.zero && self.protocol.board.homes();
        if wishes.home || sure {
            if !self.protocol.board.homes() {
                let text = codes::error(5);
                return Err(SendError::Refused(vec![format!(
                    "--home: {text}; bring it to its zero by hand and use --zero"
                )]));
            }
            self.command(Line { patience: HOMING, ..query("$H") })?;
        }
        if self.protocol.locked() {
            let fault = Fault::Locked(self.protocol.alarm());
            return Err(SendError::Fault { fault, aborted: Aborted::default() });
        }
        if wishes.zero {
            // Z is set with the tool touching the material.
            let z = if matches!(machine.head, Head::Z { .. }) { "Z0" } else { "" };
            self.command(query("G54"))?;
            self.command(query(&format!("G10L20P1X0Y0{z}")))?;
        }
        self.command(query("$#"))
    }

    /// State before the first line, and all else that reading a program takes.
    pub fn setting(&self, machine: &Machine) -> Setting {
        let board = &self.protocol.board;
        Setting {
            state: State::new(board.position, board.offsets.clone()),
            sense: Sense::of(&machine.head),
            limits: board.limits(machine),
        }
    }

    /// Refuses a program that would leave the machine's travel or its bed.
    fn check_bounds(&self, program: &Program, machine: &Machine) -> Result<(), SendError> {
        let board = &self.protocol.board;
        let mut faults = if board.homes() {
            board.travel_faults(&program.machine, matches!(machine.head, Head::Z { .. }))
        } else {
            // Machine coordinates mean nothing here: the bed from the work zero is all there is.
            bed_faults(program, machine)
        };
        faults.extend(board.lacks(program.turns));
        if faults.is_empty() { Ok(()) } else { Err(SendError::Refused(faults)) }
    }

    /// Does what is wished with a program. `journal` is where the journal lies.
    pub fn perform(
        &mut self,
        text: &str,
        machine: &Machine,
        wishes: Wishes,
        journal: Option<&Path>,
        tell: &mut dyn FnMut(&str),
    ) -> Result<(), SendError> {
        let mut setting = self.setting(machine);
        let read = |setting: &Setting| {
            Program::read(text.to_owned(), setting)
                .map_err(|errors| SendError::Refused(errors.iter().map(ToString::to_string).collect()))
        };
        let mut program = read(&setting)?;
        self.check_bounds(&program, machine)?;
        if let Some(line) = program.opaque {
            tell(&format!(
                "line {} does something whose end is not known here (`{}`): bounds and position are not checked after it",
                line + 1,
                program.line(line)
            ));
        }
        if wishes.frame {
            self.frame(&program, machine)?;
        }
        if wishes.check {
            self.check(&program, &setting)?;
            tell("the board has read the whole program and found no error");
        }
        if wishes.frame || wishes.check {
            return Ok(());
        }
        let unreadable = |err: LineError| SendError::Refused(vec![err.to_string()]);
        let Some(path) = journal else {
            return self.stream(&program, Feed::new(&program, &setting), None);
        };
        if !wishes.resume {
            let mut journal = Journal::create(path, text)?;
            return self.stream(&program, Feed::new(&program, &setting), Some(&mut journal));
        }
        let (mut journal, start) = self.resume(&program, path, text, wishes, tell)?;
        // Homing may have moved the head.
        setting = self.setting(machine);
        program = read(&setting)?;
        self.check_bounds(&program, machine)?;
        let feed =
            Feed::from_contour(&program, &setting, start, machine.decimals, machine.dialect).map_err(unreadable)?;
        self.stream(&program, feed, Some(&mut journal))
    }

    /// Opens the journal, makes sure that the position can be trusted, and names the contours in doubt. The first of
    /// them is where the job goes on.
    fn resume(
        &mut self,
        program: &Program,
        path: &Path,
        text: &str,
        wishes: Wishes,
        tell: &mut dyn FnMut(&str),
    ) -> Result<(Journal, usize), SendError> {
        if program.shifts {
            let name = path.display().to_string();
            return Err(SendError::Refused(vec![format!(
                "this program sets offsets of its own (G10, G92), so its middle cannot be entered: {name} cannot be resumed"
            )]));
        }
        let (journal, past) = Journal::resume(path, text)?;
        let board = &self.protocol.board;
        let kept = past.kept.is_some_and(|it| distance(it, board.position) < 0.02);
        if !board.homes() && !wishes.zero && !kept {
            return Err(SendError::Refused(vec![
                "the position of this machine was lost and it has no homing: bring the tool to the work zero by hand, \
                 then use --resume with --zero"
                    .to_owned(),
            ]));
        }
        if past.begun > program.contours.len() || past.done > program.contours.len() {
            return Err(SendError::Journal(JournalError::Foreign(path.display().to_string())));
        }
        tell(&format!("{} of {} contours are surely done", past.done, program.contours.len()));
        for contour in past.in_doubt() {
            tell(&format!("in doubt, done again: {}", program.describe(contour)));
        }
        Ok((journal, past.done))
    }

    /// Goes once round what the tool will touch, with the tool off.
    fn frame(&mut self, program: &Program, machine: &Machine) -> Result<(), SendError> {
        let bounds = if program.touched.is_empty() { program.work } else { program.touched };
        if bounds.is_empty() {
            return Ok(());
        }
        let mut lines = vec!["G21G90G94G17G54".to_owned(), "M5".to_owned()];
        match machine.head {
            Head::Laser { .. } => {}
            Head::Servo { up, .. } => lines.push(format!("M3S{up}")),
            Head::Z { up, .. } => lines.push(format!("G0Z{up}")),
        }
        let (low, high) = (bounds.min, bounds.max);
        let decimals = machine.decimals;
        for [x, y] in [[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]], [low[0], low[1]]] {
            lines.push(format!("G0X{x:.decimals$}Y{y:.decimals$}"));
        }
        for text in lines {
            let line = Line { opaque: false, alone: false, patience: 1.0, ..Line::command(text) };
            self.push(line)?;
        }
        self.rest()
    }

    /// Lets the board read the program without moving.
    fn check(&mut self, program: &Program, setting: &Setting) -> Result<(), SendError> {
        self.protocol.set_check(true);
        self.command(query("$C"))?;
        self.stream(program, Feed::new(program, setting), None)?;
        // Leaving check mode resets the board.
        self.push(query("$C"))?;
        self.protocol.set_check(false);
        self.await_restart()
    }
}
