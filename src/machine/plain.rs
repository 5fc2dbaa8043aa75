//! A job on a machine that tells little of itself: Marlin boards and HPGL cutters. Bounds are those of the profile.
use std::path::Path;

use super::{
    board::profile_limits,
    feed::Feed,
    hpgl::{self, Hpgl},
    job::{Wishes, bed_faults, query},
    journal::{Journal, JournalError},
    link::Wire,
    marlin::{self, Marlin},
    program::{Program, Setting},
    protocol::{Line, Protocol},
    session::{SendError, Session},
};
use crate::{
    import::gcode::{Offsets, Sense, State},
    profile::{Head, Machine},
};

/// Homing a large, slow machine, s.
const HOMING: f64 = 180.0;
/// Units of HPGL in a millimetre.
const UNITS: f64 = 40.0;

/// How a Marlin board of this profile is spoken to.
pub fn marlin_options(machine: &Machine) -> marlin::Options {
    let off = match machine.head {
        Head::Laser { .. } => vec!["M5".to_owned()],
        Head::Servo { up, .. } => vec![format!("M280 P0 S{up}")],
        // Up by the whole way: where the tool stands after a sudden stop is not known.
        Head::Z { up, down, .. } => {
            vec!["G91".to_owned(), format!("G0 Z{:.3}", up - down), "G90".to_owned()]
        }
    };
    marlin::Options { buffered: machine.link.buffered, boot: machine.link.boot, off }
}

/// How an HPGL cutter of this profile is spoken to.
pub fn hpgl_options(machine: &Machine) -> hpgl::Options {
    hpgl::Options { buffered: machine.link.buffered, flow: machine.link.flow, baud: machine.link.baud }
}

/// Reads a plot with the speeds of the profile.
pub fn read_plot(text: &str, machine: &Machine) -> Result<Program, SendError> {
    let feed = machine.tools.iter().map(|it| it.1.feed).fold(f64::INFINITY, f64::min);
    super::plot::read(text, feed, profile_limits(machine))
        .map_err(|errors| SendError::Refused(errors.iter().map(ToString::to_string).collect()))
}

/// Where a program begins on a machine whose position is not asked for.
pub fn setting(machine: &Machine) -> Setting {
    let state = State::new([0.0; 3], Offsets::default());
    Setting { state, sense: Sense::of(&machine.head), limits: profile_limits(machine) }
}

fn refuse(what: &str) -> Result<(), SendError> {
    Err(SendError::Refused(vec![what.to_owned()]))
}

impl<W: Wire> Session<'_, W, Marlin> {
    /// Connects, homes and zeroes as wished. The first act stops whatever the board was doing.
    pub fn prepare(&mut self, wishes: Wishes) -> Result<(), SendError> {
        if wishes.check || wishes.unlock {
            return refuse("a Marlin board has neither --check nor --unlock");
        }
        self.connect()?;
        if wishes.home {
            self.command(Line { patience: HOMING, ..query("G28") })?;
        }
        if wishes.zero {
            self.command(query("G92 X0 Y0 Z0"))?;
        }
        Ok(())
    }

    /// Goes once round what the tool will touch, with the tool off.
    pub fn frame(&mut self, program: &Program, machine: &Machine) -> Result<(), SendError> {
        let mut lines = vec!["G21".to_owned(), "G90".to_owned()];
        lines.extend(match machine.head {
            Head::Z { up, .. } => vec![format!("G0 Z{up}")],
            _ => marlin_options(machine).off,
        });
        lines.extend(corners(program).map(|[x, y]| format!("G0 X{x:.3} Y{y:.3}")));
        self.lines(lines)
    }
}

impl<W: Wire> Session<'_, W, Hpgl> {
    /// Opens the way to the cutter.
    pub fn prepare(&mut self, wishes: Wishes) -> Result<(), SendError> {
        if wishes.check || wishes.unlock || wishes.home || wishes.zero {
            return refuse(
                "an HPGL cutter has its own keys for the origin; --check, --unlock, --home and --zero are for boards",
            );
        }
        self.connect()
    }

    /// Goes once round what the tool will touch, with the tool up.
    pub fn frame(&mut self, program: &Program) -> Result<(), SendError> {
        let way = corners(program).map(|[x, y]| format!("PU{:.0},{:.0};", x * UNITS, y * UNITS));
        self.lines(["IN;".to_owned(), "PA;".to_owned(), "PU;".to_owned()].into_iter().chain(way).collect())
    }
}

/// Once round the box that the tool touches.
fn corners(program: &Program) -> impl Iterator<Item = [f64; 2]> {
    let bounds = if program.touched.is_empty() { program.work } else { program.touched };
    let (low, high) = (bounds.min, bounds.max);
    [[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]], [low[0], low[1]]].into_iter()
}

impl<W: Wire, P: Protocol> Session<'_, W, P> {
    fn lines(&mut self, lines: Vec<String>) -> Result<(), SendError> {
        for text in lines {
            // A minute for the longest way across the slowest bed.
            self.push(Line { seconds: 1.0, patience: 60.0, text, ..Line::default() })?;
        }
        self.rest()
    }

    /// Refuses what leaves the bed, then streams, or goes on where the journal says.
    pub fn perform_plain(
        &mut self,
        program: &Program,
        machine: &Machine,
        wishes: Wishes,
        journal: Option<&Path>,
        tell: &mut dyn FnMut(&str),
    ) -> Result<(), SendError> {
        let setting = setting(machine);
        let faults = bed_faults(program, machine);
        if !faults.is_empty() {
            return Err(SendError::Refused(faults));
        }
        if let Some(line) = program.opaque {
            return refuse(&format!(
                "line {} does something whose end is not known here (`{}`), and this machine has no limits of its own to ask",
                line + 1,
                program.line(line)
            ));
        }
        let Some(path) = journal else {
            return self.stream(program, Feed::new(program, &setting), None);
        };
        if !wishes.resume {
            let mut journal = Journal::create(path, program.text())?;
            return self.stream(program, Feed::new(program, &setting), Some(&mut journal));
        }
        if program.shifts {
            return refuse("this program sets offsets of its own (G10, G92), so its middle cannot be entered");
        }
        let (mut journal, past) = Journal::resume(path, program.text())?;
        if past.begun > program.contours.len() || past.done > program.contours.len() {
            return Err(SendError::Journal(JournalError::Foreign(path.display().to_string())));
        }
        if program.plot.is_none() && !wishes.home && !wishes.zero {
            return refuse(
                "a Marlin board that was stopped may have lost steps, and tells nothing of it: use --resume with --home, or \
                 bring the tool to the work zero by hand and use --resume with --zero",
            );
        }
        tell(&format!("{} of {} contours are surely done", past.done, program.contours.len()));
        for contour in past.in_doubt() {
            tell(&format!("in doubt, done again: {}", program.describe(contour)));
        }
        let feed = Feed::from_contour(program, &setting, past.done, machine.decimals, machine.dialect)
            .map_err(|err| SendError::Refused(vec![err.to_string()]))?;
        self.stream(program, feed, Some(&mut journal))
    }
}
