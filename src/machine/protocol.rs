//! What the protocols of all machines have in common: a state machine takes bytes with the time and gives bytes and
//! events. There is no clock, no thread and no port inside.
use std::collections::VecDeque;

use super::{codes, reply::Mode};
use crate::import::gcode::path::{Move, Point};

/// Seconds since the connection was opened.
pub type Seconds = f64;

/// A line on its way to a machine.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Line {
    /// Index in the program; `None` for commands of our own.
    pub index: Option<usize>,
    /// What is sent, without the line end.
    pub text: String,
    /// Its movements, machine coordinates.
    pub moves: Vec<Move>,
    /// Estimated seconds.
    pub seconds: f64,
    /// Seconds that its answer may take beyond the motion before it.
    pub patience: f64,
    /// The board waits for its motion to end before it answers.
    pub waits: bool,
    /// Nothing else may be on its way: the board writes to memory, homes, or resets.
    pub alone: bool,
    /// The position after it is not known from the program.
    pub opaque: bool,
    /// An error in answer to it is not a fault.
    pub tolerant: bool,
}

impl Line {
    /// A command of our own.
    pub fn command(text: impl Into<String>) -> Self {
        Self { text: text.into(), alone: true, patience: 2.0, opaque: true, ..Self::default() }
    }
}

/// A line to blame.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Place {
    /// Index in the program; `None` for commands of our own.
    pub index: Option<usize>,
    /// The line.
    pub text: String,
}

impl std::fmt::Display for Place {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.index {
            Some(index) => write!(f, "line {} `{}`", index + 1, self.text),
            None => write!(f, "`{}`", self.text),
        }
    }
}

fn at(place: &Option<Place>) -> String {
    place.as_ref().map(|it| format!(" at {it}")).unwrap_or_default()
}

/// What went wrong with the machine.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Fault {
    /// Nothing answers.
    #[error(
        "nothing answers after {0:.0} s: is it the right port, is the machine switched on, and is the baud rate right \
         ([machine] link.baud)? If the board is held in reset by the DTR line, set link.dtr = \"off\""
    )]
    NoReply(Seconds),
    /// The board was at work when the connection was opened.
    #[error("the board was still running an old job ({0}); it has been stopped. Look at the work, then send again")]
    WasRunning(&'static str),
    /// Locked at the start.
    #[error("the machine is locked (Alarm){}; home it with --home, or unlock it with --unlock if you know where it stands",
        .0.map(|it| format!(": {}", codes::alarm(it))).unwrap_or_default())]
    Locked(Option<u16>),
    /// `error:N`.
    #[error("the board refused {place} with error:{code}: {}", codes::error(*code))]
    Error {
        /// The number.
        code: u16,
        /// The line it answers.
        place: Place,
    },
    /// `ALARM:N`.
    #[error("ALARM:{code}{}: {}", at(place), codes::alarm(*code))]
    Alarm {
        /// The number; 0 where only the state says Alarm.
        code: u16,
        /// The oldest line that was not answered.
        place: Option<Place>,
    },
    /// A banner in mid-job.
    #[error("the board reset itself in mid-job{} (power dip, loose USB plug, or its reset button): home it, then use --resume", at(.0))]
    Reset(Option<Place>),
    /// All is quiet but answers are missing.
    #[error(
        "the machine is idle but {missing} answer(s) never came, the first one for {place}: bytes were lost on the \
         way (cable, adapter, baud rate)"
    )]
    LostOk {
        /// How many.
        missing: usize,
        /// The oldest line.
        place: Place,
    },
    /// No byte comes any more.
    #[error("the machine has not said anything for {seconds:.1} s{}", at(place))]
    Mute {
        /// Since when.
        seconds: Seconds,
        /// The oldest unanswered line.
        place: Option<Place>,
    },
    /// It answers, says it runs, but does not move.
    #[error("the machine says it runs but has not moved or answered for {seconds:.0} s{}", at(place))]
    Stalled {
        /// Since when.
        seconds: Seconds,
        /// The oldest unanswered line.
        place: Option<Place>,
    },
    /// It is somewhere else than the program says.
    #[error(
        "the machine is at X{:.3} Y{:.3} Z{:.3} (machine coordinates), {off:.1} mm from where the program leads{}: \
         a line was garbled on the way", position[0], position[1], position[2], at(place)
    )]
    OffPath {
        /// Reported position.
        position: Point,
        /// Distance from the nearest path, mm.
        off: f64,
        /// The line that should be executing.
        place: Option<Place>,
    },
    /// A complaint of the board in its own words.
    #[error("the board says `{text}`{}", at(place))]
    Said {
        /// Its words.
        text: String,
        /// The line that it was reading.
        place: Option<Place>,
    },
    /// The door was opened, or the board went to sleep or to a tool change.
    #[error("the machine stopped by itself: {0}")]
    Stopped(&'static str),
    /// The port is gone.
    #[error(
        "the connection broke off ({0}): the cable or the machine's power is out. The machine runs what it already has to its end"
    )]
    Unplugged(String),
    /// The port takes no bytes.
    #[error(
        "the port has taken no byte for {0:.0} s; is another device on this port, or is a hardware handshake holding it?"
    )]
    Unwritable(Seconds),
    /// Ctrl-C, SIGTERM, or the program ended.
    #[error("stopped on request")]
    Interrupted,
}

/// How the safe abort went.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Aborted {
    /// The board confirmed that the tool is off.
    pub tool_off: bool,
    /// The machine was at rest before it was reset, so its position holds.
    pub position_kept: bool,
}

/// What a protocol tells.
#[derive(Debug, Clone, PartialEq)]
pub enum Event {
    /// Connected, and everything asked has been answered.
    Ready,
    /// A line was answered.
    Answered(Option<usize>),
    /// All program lines up to this index have surely been executed.
    Executed(usize),
    /// Position (work coordinates, mm) and state.
    Position(Point, Mode),
    /// Something worth showing.
    Warning(String),
    /// A message of the board.
    Message(String),
    /// The board left check mode and started anew.
    Restarted,
    /// It is over: the fault, and how the safe abort went.
    Ended(Fault, Aborted),
}

/// Wishes of the operator.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Command {
    /// Run the safe abort.
    Abort,
    /// Feed override, percent.
    Feed(u32),
}

/// What a protocol has to say: bytes to the machine, events to the session.
#[derive(Debug, Default)]
pub struct Outbox {
    /// Bytes to be written.
    pub bytes: Vec<u8>,
    /// Events, the oldest first.
    pub events: VecDeque<Event>,
    /// The fault that is being handled; the first one counts, later ones are its consequences.
    pub fault: Option<Fault>,
}

impl Outbox {
    /// A line with its end.
    pub fn line(&mut self, text: &str) {
        self.bytes.extend_from_slice(text.as_bytes());
        self.bytes.push(b'\n');
    }

    /// Something happened.
    pub fn tell(&mut self, event: Event) {
        self.events.push_back(event);
    }

    /// The handling of the fault has ended.
    pub fn end(&mut self, aborted: Aborted) {
        if let Some(fault) = self.fault.take() {
            self.tell(Event::Ended(fault, aborted));
        }
    }
}

/// The motion on a machine that does not report it, by the plan.
#[derive(Debug, Default)]
pub struct Schedule {
    /// The clock.
    pub now: Seconds,
    /// When everything sent will have been executed.
    pub due: Seconds,
    /// Seconds of everything sent.
    pub planned: Seconds,
}

impl Schedule {
    /// A line goes out that takes so long.
    pub fn add(&mut self, now: Seconds, seconds: Seconds) {
        self.due = self.due.max(now) + seconds;
        self.planned += seconds;
    }

    /// Seconds of motion still before it.
    pub fn ahead(&self) -> Seconds {
        (self.due - self.now).max(0.0)
    }

    /// Seconds of the plan that have been executed.
    pub fn done(&self) -> Seconds {
        (self.planned - self.ahead()).max(0.0)
    }
}

/// A protocol: bytes and times in, bytes and events out.
pub trait Protocol {
    /// Takes bytes from the machine.
    fn receive(&mut self, now: Seconds, bytes: &[u8]);
    /// Lets time pass; to be called at least every [`Self::pace`] seconds.
    fn tick(&mut self, now: Seconds);
    /// Longest useful time between two ticks, s.
    fn pace(&self) -> Seconds;
    /// Whether a line can be taken now.
    fn can_take(&self, line: &Line) -> bool;
    /// Takes a line. Only after [`Self::can_take`].
    fn push(&mut self, now: Seconds, line: Line);
    /// Whether everything taken has been answered and the machine rests.
    fn at_rest(&self) -> bool;
    /// A wish of the operator.
    fn command(&mut self, now: Seconds, command: Command);
    /// The connection is gone or does not take bytes.
    fn broken(&mut self, now: Seconds, fault: Fault);
    /// Bytes are still waiting in the port, held back by the machine or on their way.
    fn waiting(&mut self, _now: Seconds) {}
    /// Where bytes and events wait to be handed out.
    fn outbox(&mut self) -> &mut Outbox;
    /// Bytes to be written now.
    fn output(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.outbox().bytes)
    }
    /// The next event.
    fn event(&mut self) -> Option<Event> {
        self.outbox().events.pop_front()
    }
    /// Seconds of motion that the machine may still have before it without another byte.
    fn ahead(&self) -> Seconds;
    /// Seconds of the plan that have been executed.
    fn done(&self) -> Seconds;
}
