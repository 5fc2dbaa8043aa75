//! Drives a protocol over a wire: reads, writes, logs, hands on events and wishes. Everything that can go wrong ends in
//! the safe abort, also when the program panics.
use std::io::Write;

use super::{
    feed::{Feed, Next},
    journal::{Journal, JournalError},
    link::Wire,
    program::Program,
    protocol::{Aborted, Command, Event, Fault, Line, Protocol, Seconds},
    reply::Mode,
};
use crate::import::gcode::{LineError, path::Point};

/// What the operator may want while a job runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Wish {
    /// Stop now, safely.
    Abort,
    /// Stop at the end of this contour, with the tool off.
    Pause,
    /// Go on after a pause.
    Go,
    /// Feed by this many percent more or less.
    Feed(i32),
    /// The feed of the program.
    PlannedFeed,
}

/// Why a job was not finished.
#[derive(Debug, thiserror::Error)]
pub enum SendError {
    /// The machine.
    #[error("{fault}")]
    Fault {
        /// What went wrong first.
        fault: Fault,
        /// How the safe abort went.
        aborted: Aborted,
    },
    /// It must not be sent to this machine; nothing was moved.
    #[error("{}", .0.join("\n"))]
    Refused(Vec<String>),
    /// The journal could not be written; without it nothing is sent.
    #[error(transparent)]
    Journal(#[from] JournalError),
}

/// A flow of bytes that stops for this long is a fault, s.
const UNWRITABLE: Seconds = 5.0;
/// The safe abort ends by itself within this, s; the guard against a program that hangs.
const LONGEST_ABORT: Seconds = 30.0;

/// A connection at work.
pub struct Session<'a, W: Wire, P: Protocol> {
    wire: W,
    /// The protocol.
    pub protocol: P,
    operator: &'a mut dyn Operator,
    log: Option<Box<dyn Write + 'a>>,
    /// Bytes that the wire has not taken yet, since when.
    pending: Vec<u8>,
    pending_since: Seconds,
    /// How long the wire may take no bytes: for ever where flow control stops a plotter.
    patience: Seconds,
    /// From a line to the rest after it: what must end in the safe abort.
    live: bool,
    ready: bool,
    restarted: bool,
    /// Index of the last program line that was surely executed, and machine position and state from the last report.
    executed: Option<usize>,
    place: Option<(Point, Mode)>,
    paused: bool,
    feed: u32,
    said: String,
}

impl<'a, W: Wire, P: Protocol> Session<'a, W, P> {
    /// Begins on an open wire. `log` gets every line with its time.
    pub fn new(wire: W, protocol: P, operator: &'a mut dyn Operator, log: Option<Box<dyn Write + 'a>>) -> Self {
        Self {
            wire,
            protocol,
            operator,
            log,
            pending: Vec::new(),
            pending_since: 0.0,
            patience: UNWRITABLE,
            live: false,
            ready: false,
            restarted: false,
            executed: None,
            place: None,
            paused: false,
            feed: 100,
            said: String::new(),
        }
    }

    /// How long the machine may refuse bytes by flow control, s.
    pub fn set_patience(&mut self, seconds: Seconds) {
        self.patience = seconds;
    }

    /// The wire.
    pub fn wire(&mut self) -> &mut W {
        &mut self.wire
    }

    /// Machine position of the last report.
    pub fn position(&self) -> Option<Point> {
        self.place.map(|it| it.0)
    }

    fn note(&mut self, now: Seconds, mark: char, line: &str) {
        if let Some(log) = &mut self.log {
            // A full disk must not stop the machine in mid-cut.
            let _ = writeln!(log, "{now:10.4} {mark} {line}");
        }
    }

    fn note_bytes(&mut self, now: Seconds, mark: char, bytes: &[u8]) {
        if self.log.is_none() {
            return;
        }
        let text: String = bytes
            .iter()
            .map(|&it| match it {
                b'\n' => '\n',
                b'\r' => ' ',
                0x20..=0x7e => it as char,
                _ => '\u{fffd}',
            })
            .collect();
        if mark == '>' {
            for line in text.split('\n').filter(|it| !it.is_empty() && *it != "?") {
                self.note(now, mark, line.trim_start_matches('?'));
            }
            for &byte in bytes.iter().filter(|&&it| it >= 0x80 || it == 0x18) {
                self.note(now, mark, &format!("0x{byte:02x}"));
            }
        } else {
            self.said += &text;
            while let Some((line, rest)) = self.said.split_once('\n') {
                let (line, rest) = (line.trim().to_owned(), rest.to_owned());
                if !line.is_empty() {
                    self.note(now, mark, &line);
                }
                self.said = rest;
            }
            self.said.truncate(4096);
        }
    }

    fn flush(&mut self) {
        let now = self.wire.now();
        let out = self.protocol.output();
        if !out.is_empty() {
            self.note_bytes(now, '>', &out);
            if self.pending.is_empty() {
                self.pending_since = now;
            }
            self.pending.extend(out);
        }
        if self.pending.is_empty() {
            return;
        }
        match self.wire.write(&self.pending) {
            Ok(0) => {
                let waited = now - self.pending_since;
                if waited > self.patience {
                    self.protocol.broken(now, Fault::Unwritable(waited));
                }
            }
            Ok(n) => {
                self.pending.drain(..n.min(self.pending.len()));
                self.pending_since = now;
            }
            Err(cause) => self.protocol.broken(now, Fault::Unplugged(cause)),
        }
    }

    /// Throws away what has not left yet, so that an abort is not queued behind it.
    fn discard(&mut self) {
        self.pending.clear();
        self.wire.discard();
    }

    /// One breath: lets the protocol act, waits shortly for bytes, hands on what happened.
    fn pump(&mut self) -> Result<(), SendError> {
        while let Some(wish) = self.operator.wish() {
            let now = self.wire.now();
            match wish {
                Wish::Abort => {
                    self.discard();
                    self.protocol.command(now, Command::Abort);
                }
                Wish::Pause => self.paused = true,
                Wish::Go => self.paused = false,
                Wish::Feed(by) => {
                    self.feed = (self.feed as i32 + by).clamp(10, 200) as u32;
                    self.protocol.command(now, Command::Feed(self.feed));
                }
                Wish::PlannedFeed => {
                    self.feed = 100;
                    self.protocol.command(now, Command::Feed(100));
                }
            }
        }
        self.breathe()?;
        self.operator.progress(self.protocol.done());
        Ok(())
    }

    fn breathe(&mut self) -> Result<(), SendError> {
        self.flush();
        // Read before the watchdogs look: a program that was not let run for a while has answers waiting.
        let bytes = self.wire.read(self.protocol.pace());
        let now = self.wire.now();
        match bytes {
            Ok(bytes) => {
                self.note_bytes(now, '<', &bytes);
                self.protocol.receive(now, &bytes);
            }
            Err(cause) => self.protocol.broken(now, Fault::Unplugged(cause)),
        }
        if self.wire.waiting() > 0 {
            self.protocol.waiting(now);
        }
        self.protocol.tick(now);
        self.flush();
        while let Some(event) = self.protocol.event() {
            match &event {
                Event::Ready => self.ready = true,
                Event::Restarted => self.restarted = true,
                Event::Executed(line) => self.executed = self.executed.max(Some(*line)),
                Event::Position(place, mode) => self.place = Some((*place, *mode)),
                Event::Warning(text) | Event::Message(text) => {
                    let text = text.clone();
                    self.note(self.wire.now(), '!', &text);
                }
                Event::Answered(_) | Event::Ended(..) => {}
            }
            self.operator.event(&event);
            if let Event::Ended(fault, aborted) = event {
                self.live = false;
                self.note(self.wire.now(), '!', &format!("{fault}; {aborted:?}"));
                return Err(SendError::Fault { fault, aborted });
            }
        }
        Ok(())
    }

    /// Waits until the machine has greeted and answered all questions.
    pub fn connect(&mut self) -> Result<(), SendError> {
        while !self.ready {
            self.pump()?;
        }
        self.rest()
    }

    /// Sends a line as soon as it can be taken.
    pub fn push(&mut self, line: Line) -> Result<(), SendError> {
        while !self.protocol.can_take(&line) || !self.pending.is_empty() {
            self.pump()?;
        }
        let now = self.wire.now();
        self.live = true;
        self.protocol.push(now, line);
        Ok(())
    }

    /// Sends a line and waits until it is carried out.
    pub fn command(&mut self, line: Line) -> Result<(), SendError> {
        self.push(line)?;
        self.rest()
    }

    /// Announces a program.
    pub fn begin(&mut self, name: &str, seconds: Seconds) {
        self.operator.begin(name, seconds);
    }

    /// Waits for the operator.
    pub fn ask(&mut self, why: &str) -> Result<(), SendError> {
        self.paused = true;
        self.operator.paused(why);
        while self.paused {
            self.pump()?;
        }
        Ok(())
    }

    /// Waits until everything is answered and nothing moves.
    pub fn rest(&mut self) -> Result<(), SendError> {
        self.pump()?;
        while !self.protocol.at_rest() || !self.pending.is_empty() {
            self.pump()?;
        }
        self.live = false;
        Ok(())
    }

    /// Waits for the restart that ends check mode.
    pub fn await_restart(&mut self) -> Result<(), SendError> {
        self.ready = false;
        while !self.restarted || !self.ready {
            self.pump()?;
        }
        self.restarted = false;
        self.rest()
    }

    /// Streams a program to its end and waits until the machine rests: "sent" is not "done". With a journal, every
    /// contour is promised on the disk before its first byte goes out.
    pub fn stream(
        &mut self,
        program: &Program,
        mut feed: Feed<'_>,
        mut journal: Option<&mut Journal>,
    ) -> Result<(), SendError> {
        self.executed = None;
        let result = self.run(program, &mut feed, &mut journal);
        let done = |executed: Option<usize>| match executed {
            None => 0,
            Some(line) => program.contours.partition_point(|it| it.last <= line),
        };
        if let Some(journal) = journal {
            match &result {
                Ok(()) => journal.finished()?,
                Err(SendError::Fault { fault, aborted }) => {
                    journal.done(done(self.executed))?;
                    let kept = aborted.position_kept.then_some(self.place).flatten().map(|it| it.0);
                    journal.stopped(kept, &fault.to_string())?;
                }
                Err(_) => {}
            }
        }
        result
    }

    fn run(
        &mut self,
        program: &Program,
        feed: &mut Feed<'_>,
        journal: &mut Option<&mut Journal>,
    ) -> Result<(), SendError> {
        let unreadable = |err: LineError| SendError::Refused(vec![err.to_string()]);
        let mut next = feed.take().map_err(unreadable)?;
        let mut told = None;
        let mut previous = None;
        while let Some(item) = next {
            match item {
                Next::Pause(_, text) => {
                    self.rest()?;
                    self.pause(program, journal, &mut told, &format!("the program stops here ({text})"))?;
                }
                Next::Line(line) => {
                    let contour = line.index.and_then(|it| program.contour_of(it));
                    if self.paused && contour != previous && line.index.is_some() {
                        self.rest()?;
                        self.pause(program, journal, &mut told, "stopped between two contours")?;
                    }
                    previous = contour;
                    let begins = contour.filter(|&it| line.index.is_some_and(|i| i >= program.contours[it].first));
                    if let (Some(journal), Some(contour)) = (journal.as_deref_mut(), begins) {
                        journal.begin(contour, |it| program.contours.get(it).map(|it| it.seconds))?;
                    }
                    while !self.protocol.can_take(&line) || !self.pending.is_empty() {
                        self.pump()?;
                        self.mark(program, journal, &mut told)?;
                    }
                    let now = self.wire.now();
                    self.live = true;
                    self.protocol.push(now, line);
                }
            }
            next = feed.take().map_err(unreadable)?;
        }
        loop {
            self.pump()?;
            self.mark(program, journal, &mut told)?;
            if self.protocol.at_rest() && self.pending.is_empty() {
                self.live = false;
                return Ok(());
            }
        }
    }

    /// Writes newly finished contours into the journal.
    fn mark(
        &mut self,
        program: &Program,
        journal: &mut Option<&mut Journal>,
        told: &mut Option<usize>,
    ) -> Result<(), SendError> {
        if let (Some(journal), true) = (journal, self.executed != *told) {
            *told = self.executed;
            let done = self.executed.map_or(0, |line| program.contours.partition_point(|it| it.last <= line));
            journal.done(done)?;
        }
        Ok(())
    }

    fn pause(
        &mut self,
        program: &Program,
        journal: &mut Option<&mut Journal>,
        told: &mut Option<usize>,
        why: &str,
    ) -> Result<(), SendError> {
        self.mark(program, journal, told)?;
        self.ask(why)
    }

    /// Runs the safe abort to its end without asking the operator.
    fn abort(&mut self) {
        self.discard();
        let began = self.wire.now();
        self.protocol.command(began, Command::Abort);
        while self.wire.now() - began < LONGEST_ABORT {
            if self.breathe().is_err() {
                return;
            }
        }
    }
}

impl<W: Wire, P: Protocol> Drop for Session<'_, W, P> {
    /// A panic, or an error that is not the machine's, must not leave the tool on.
    fn drop(&mut self) {
        if self.live {
            self.abort();
        }
    }
}

/// Who watches and steers.
pub trait Operator {
    /// The next wish, without waiting.
    fn wish(&mut self) -> Option<Wish>;
    /// A program of so many seconds begins.
    fn begin(&mut self, _name: &str, _seconds: Seconds) {}
    /// Something happened.
    fn event(&mut self, event: &Event);
    /// Seconds of the plan done; for a progress bar.
    fn progress(&mut self, done: Seconds);
    /// The job waits for [`Wish::Go`]: the machine rests with the tool off.
    fn paused(&mut self, why: &str);
}
