//! HPGL cutters: commands one way, and at most one question, how much room the buffer has (`ESC . B`). Where the cutter
//! tells nothing, what it has done is known only by the clock.
//!
//! Device control is by the escape sequences of HP's plotters: `ESC . B` tells the free bytes of the buffer as a number
//! and CR, `ESC . K` throws the buffer away.
use std::collections::VecDeque;

use super::protocol::{Aborted, Command, Event, Fault, Line, Outbox, Protocol, Schedule, Seconds};
use crate::profile::Flow;

/// Between two questions for room, s.
const ASK: Seconds = 0.1;
/// A question is answered within this, s.
const ANSWER: Seconds = 5.0;
/// Motion that is always let on the cutter, s.
const LEAST_AHEAD: Seconds = 0.2;
/// After the buffer is empty the last commands still move, s.
const SETTLE: Seconds = 1.5;
/// Share of the whole time that a cutter without answers may be slower than the plan before the port is closed.
const SLOWER: f64 = 0.25;
/// An XOFF, or a full buffer, may last this long: the cutter waits for a person to load the sheet.
const HELD: Seconds = 600.0;
/// The end of an abort is waited for at most this long, s.
const CLOSING: Seconds = 3.0;
/// Under XON and XOFF no more than this is on its way: what has left cannot be called back, s of the wire.
const ON_WIRE: Seconds = 0.002;
const XON: u8 = 0x11;
const XOFF: u8 = 0x13;

/// How a cutter is spoken to.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// Largest motion to have in the cutter, s.
    pub buffered: f64,
    /// How it stops the flow of bytes.
    pub flow: Flow,
    /// Bits per second.
    pub baud: u32,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Phase {
    Opening,
    Ready,
    Aborting(Seconds),
    Ended,
}

/// The state machine.
pub struct Hpgl {
    options: Options,
    phase: Phase,
    schedule: Schedule,
    /// XOFF was received, since when.
    held: Option<Seconds>,
    /// Digits of an answer.
    digits: String,
    /// When a question went out that is not answered.
    asked: Option<Seconds>,
    answered: Seconds,
    /// Free bytes by the last answer less what was sent since; the most ever told is the size of the buffer.
    free: usize,
    size: usize,
    /// When the buffer was first seen empty after the last command.
    emptied: Option<Seconds>,
    /// Sent commands: program line, bytes, seconds.
    sent: VecDeque<(Option<usize>, usize, Seconds)>,
    /// Bytes of `sent`.
    bytes: usize,
    /// When everything written has gone over the wire.
    wire: Seconds,
    outbox: Outbox,
}

impl Hpgl {
    /// A cutter needs no greeting.
    pub fn new(options: Options) -> Self {
        Self {
            options,
            phase: Phase::Opening,
            schedule: Schedule::default(),
            held: None,
            digits: String::new(),
            asked: None,
            answered: 0.0,
            free: 0,
            size: 0,
            emptied: None,
            sent: VecDeque::new(),
            bytes: 0,
            wire: 0.0,
            outbox: Outbox::default(),
        }
    }

    fn asks(&self) -> bool {
        self.options.flow == Flow::EscB
    }

    fn ask(&mut self, now: Seconds) {
        if self.asks() && self.asked.is_none() {
            self.outbox.bytes.extend_from_slice(b"\x1b.B");
            self.asked = Some(now);
        }
    }

    fn room(&mut self, now: Seconds, free: usize) {
        self.asked = None;
        self.answered = now;
        self.free = free;
        self.size = self.size.max(free);
        let inside = self.size - free;
        match self.phase {
            Phase::Opening => {
                self.phase = Phase::Ready;
                self.outbox.tell(Event::Ready);
            }
            Phase::Aborting(_) if inside == 0 => {
                self.end(Aborted { tool_off: true, position_kept: true });
                return;
            }
            _ => {}
        }
        // What has left the buffer is being carried out, one command at a time; the last of it may still move.
        let mut done = None;
        while self.sent.len() > 1 && self.bytes - self.sent[0].1 >= inside + self.sent[1].1 {
            let Some((line, bytes, _)) = self.sent.pop_front() else { break };
            self.bytes -= bytes;
            done = line.or(done);
        }
        self.outbox.events.extend(done.map(Event::Executed));
        if inside > 0 {
            self.emptied = None;
        } else if self.emptied.is_none() {
            self.emptied = Some(now);
        }
    }

    fn fail(&mut self, now: Seconds, fault: Fault) {
        if matches!(self.phase, Phase::Aborting(_) | Phase::Ended) {
            return;
        }
        self.outbox.fault = Some(fault);
        self.phase = Phase::Aborting(now);
        self.held = None;
        self.asked = None;
        // The buffer goes, then the tool; a command that was cut in two ends at the semicolon.
        self.outbox.bytes.clear();
        self.outbox.bytes.extend_from_slice(b"\x1b.K;PU;SP0;\n");
    }

    fn end(&mut self, aborted: Aborted) {
        self.phase = Phase::Ended;
        self.outbox.end(aborted);
    }

    /// Everything sent must have been cut by now.
    fn drained(&self) -> bool {
        if self.asks() {
            return self.emptied.is_some_and(|it| self.schedule.now - it > SETTLE)
                && self.schedule.now >= self.schedule.due;
        }
        self.held.is_none() && self.schedule.now >= self.schedule.due + SETTLE + SLOWER * self.schedule.planned
    }
}

impl Protocol for Hpgl {
    fn receive(&mut self, now: Seconds, bytes: &[u8]) {
        self.schedule.now = now;
        for &byte in bytes {
            match byte {
                XOFF if self.options.flow == Flow::XonXoff => {
                    self.held.get_or_insert(now);
                }
                XON if self.options.flow == Flow::XonXoff => {
                    // The cutter worked on while it held us back, but not on what it had not got.
                    self.held = None;
                }
                b'0'..=b'9' if self.digits.len() < 9 => self.digits.push(byte as char),
                b'\r' | b'\n' => {
                    let free = std::mem::take(&mut self.digits).parse::<usize>();
                    if let (Ok(free), true) = (free, self.asked.is_some() && self.phase != Phase::Ended) {
                        self.room(now, free);
                    }
                }
                _ => {}
            }
        }
    }

    fn tick(&mut self, now: Seconds) {
        self.schedule.now = now;
        match self.phase {
            Phase::Opening if !self.asks() => {
                self.phase = Phase::Ready;
                self.outbox.tell(Event::Ready);
            }
            Phase::Opening => {
                self.ask(now);
                if self.asked.is_some_and(|it| now - it > ANSWER) {
                    self.phase = Phase::Ended;
                    self.outbox.tell(Event::Ended(Fault::NoReply(ANSWER), Aborted::default()));
                }
            }
            Phase::Ready => {
                if now - self.answered > ASK {
                    self.ask(now);
                }
                if let Some(asked) = self.asked.filter(|it| now - it > ANSWER) {
                    self.fail(now, Fault::Mute { seconds: now - asked, place: None });
                } else if let Some(held) = self.held.filter(|it| now - it > HELD) {
                    self.fail(now, Fault::Stalled { seconds: now - held, place: None });
                }
            }
            Phase::Aborting(since) => {
                if now - since > CLOSING {
                    self.end(Aborted::default());
                } else if now - since > SETTLE {
                    // With the buffer thrown away only the lifting is left to be done.
                    self.ask(now);
                }
            }
            Phase::Ended => {}
        }
    }

    fn pace(&self) -> Seconds {
        0.02
    }

    fn can_take(&self, line: &Line) -> bool {
        let short = self.ahead() + line.seconds <= self.options.buffered || self.ahead() < LEAST_AHEAD;
        let flows = self.options.flow != Flow::XonXoff || self.wire - self.schedule.now <= ON_WIRE;
        let fits = !self.asks() || self.asked.is_none() && line.text.len() + 1 < self.free;
        self.phase == Phase::Ready && self.held.is_none() && short && fits && flows
    }

    fn push(&mut self, now: Seconds, line: Line) {
        self.outbox.line(&line.text);
        let bytes = line.text.len() + 1;
        // Ten bits a byte.
        self.wire = self.wire.max(now) + 10.0 * bytes as f64 / f64::from(self.options.baud);
        self.free = self.free.saturating_sub(bytes);
        self.bytes += bytes;
        self.schedule.add(now, line.seconds);
        self.emptied = None;
        if self.asks() {
            self.sent.push_back((line.index, bytes, line.seconds));
        }
    }

    fn at_rest(&self) -> bool {
        self.phase == Phase::Ready && (self.schedule.planned == 0.0 && self.bytes == 0 || self.drained())
    }

    fn command(&mut self, now: Seconds, command: Command) {
        match command {
            Command::Abort => self.fail(now, Fault::Interrupted),
            Command::Feed(_) => {
                self.outbox.tell(Event::Warning("an HPGL cutter takes no feed override; use its own keys".into()));
            }
        }
    }

    fn broken(&mut self, _now: Seconds, fault: Fault) {
        if self.phase != Phase::Ended {
            self.outbox.fault.get_or_insert(fault);
            self.end(Aborted::default());
        }
    }

    fn waiting(&mut self, now: Seconds) {
        // A cutter that holds RTS down says nothing else: its time runs from when the last byte has left.
        if self.options.flow == Flow::RtsCts {
            self.schedule.due = self.schedule.due.max(now);
        }
    }

    fn outbox(&mut self) -> &mut Outbox {
        &mut self.outbox
    }

    fn ahead(&self) -> Seconds {
        self.schedule.ahead()
    }

    fn done(&self) -> Seconds {
        self.schedule.done()
    }
}
