//! Marlin: one numbered line with a checksum at a time, `ok` for each. No byte acts at once, so a stop waits behind the
//! line that is being read, and only M400 tells that motion has ended.
use std::collections::VecDeque;

use super::{
    protocol::{Aborted, Command, Event, Fault, Line, Outbox, Place, Protocol, Schedule, Seconds},
    reply::{LineReader, Mode},
    track::Track,
};
use crate::import::gcode::path::Point;

/// Blocks of the planner and lines before it (BLOCK_BUFFER_SIZE and BUFSIZE of the larger boards).
const BLOCKS: usize = 40;
/// An answer may take this much longer than the motion on the board, s. Boards say `busy` every 2 s while they wait.
const ANSWER: Seconds = 10.0;
/// A program that pauses for this long is asked for the end of its motion, s.
const QUIET: Seconds = 0.1;
/// Motion that is always let on the board, s.
const LEAST_AHEAD: Seconds = 0.2;
/// A line is sent again at most this often.
const RESENDS: u32 = 5;
/// The closing lines of an abort are answered within this, or not at all, s.
const CLOSING: Seconds = 8.0;

/// How a board is spoken to.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// Largest motion to have on the board, s.
    pub buffered: f64,
    /// How long a board may take to start after the port was opened, s.
    pub boot: f64,
    /// Lines that switch the tool off and lift it.
    pub off: Vec<String>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Phase {
    Greeting,
    Asking,
    Ready,
    Aborting { fault_at: Seconds, answers: usize },
    Ended,
}

struct Sent {
    /// As it goes over the wire.
    text: String,
    place: Place,
    patience: Seconds,
    at: Seconds,
    kind: Kind,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Kind {
    Program,
    Question,
    /// M400: everything before it is done when it is answered.
    Sync,
    Override,
}

/// The state machine.
pub struct Marlin {
    options: Options,
    phase: Phase,
    opened: Option<Seconds>,
    schedule: Schedule,
    reader: LineReader,
    number: u32,
    sent: Option<Sent>,
    questions: VecDeque<&'static str>,
    resends: u32,
    /// The answer that follows a request to send again belongs to the damaged line.
    skip: bool,
    /// The line was sent once more because nothing came.
    again: bool,
    copied: bool,
    track: Track,
    synced: bool,
    pushed: Seconds,
    progress: Seconds,
    feed: Option<u32>,
    /// Position that the board told, work coordinates.
    pub position: Point,
    outbox: Outbox,
}

/// XOR of the bytes before the star.
pub fn checksum(text: &str) -> u8 {
    text.bytes().fold(0, |sum, it| sum ^ it)
}

impl Marlin {
    /// Waits for the board to start.
    pub fn new(options: Options) -> Self {
        Self {
            options,
            phase: Phase::Greeting,
            opened: None,
            schedule: Schedule::default(),
            reader: LineReader::default(),
            number: 0,
            sent: None,
            questions: VecDeque::new(),
            resends: 0,
            skip: false,
            again: false,
            copied: false,
            track: Track::new(BLOCKS),
            synced: true,
            pushed: 0.0,
            progress: 0.0,
            feed: None,
            position: [0.0; 3],
            outbox: Outbox::default(),
        }
    }

    fn transmit(&mut self, now: Seconds, line: &Line, kind: Kind) {
        // Marlin knows no end of a program, and M30 deletes a file there.
        let command = if matches!(line.text.as_str(), "M2" | "M02" | "M30") { "M400" } else { &line.text };
        let text = if command.starts_with("M110") {
            // Sets the number of the next line, whatever the board had in mind.
            self.number = 0;
            command.to_owned()
        } else {
            self.number += 1;
            let text = format!("N{} {command}", self.number);
            format!("{text}*{}", checksum(&text))
        };
        self.outbox.line(&text);
        let place = Place { index: line.index, text: line.text.clone() };
        self.sent = Some(Sent { text, place, patience: line.patience, at: now, kind });
        self.progress = now;
    }

    fn ask(&mut self, now: Seconds) {
        match self.questions.pop_front() {
            Some(text) => self.transmit(now, &Line::command(text), Kind::Question),
            None => {
                self.phase = Phase::Ready;
                self.outbox.tell(Event::Ready);
            }
        }
    }

    fn greet(&mut self, now: Seconds) {
        self.phase = Phase::Asking;
        // A board that did not reset may run an old job: it is stopped before anything else.
        self.questions = ["M110 N0", "M410", "M400", "M115", "M114"].into();
        self.sent = None;
        self.ask(now);
    }

    fn fail(&mut self, now: Seconds, fault: Fault) {
        if matches!(self.phase, Phase::Aborting { .. } | Phase::Ended) {
            return;
        }
        let mut lines = vec!["M410".to_owned()];
        lines.extend(self.options.off.iter().cloned());
        lines.push("M400".to_owned());
        let answers = lines.len() + usize::from(self.sent.take().is_some());
        // A line that was being sent ends here.
        self.outbox.bytes.push(b'\n');
        for line in lines {
            self.outbox.line(&line);
        }
        self.outbox.fault = Some(fault);
        self.phase = Phase::Aborting { fault_at: now, answers };
    }

    fn end(&mut self, aborted: Aborted) {
        self.phase = Phase::Ended;
        self.outbox.end(aborted);
    }

    fn place(&self) -> Option<Place> {
        self.sent.as_ref().map(|it| it.place.clone())
    }

    fn answered(&mut self, now: Seconds) {
        if let Phase::Aborting { answers, .. } = &mut self.phase {
            *answers = answers.saturating_sub(1);
            if *answers == 0 {
                // M410 stops without slowing down, so steps may be lost.
                self.end(Aborted { tool_off: true, position_kept: false });
            }
            return;
        }
        if std::mem::take(&mut self.skip) {
            return;
        }
        let Some(sent) = self.sent.take() else {
            if self.phase == Phase::Ready {
                self.outbox.tell(Event::Warning("the board answered once more than it was asked".into()));
            }
            return;
        };
        self.progress = now;
        self.resends = 0;
        (self.again, self.copied) = (false, false);
        match sent.kind {
            Kind::Question => self.ask(now),
            Kind::Program => {
                let news = self.track.ok();
                self.executed(news);
                self.outbox.tell(Event::Answered(sent.place.index));
            }
            Kind::Sync => {
                self.synced = true;
                self.schedule.due = now;
                let news = self.track.idle();
                self.executed(news);
            }
            Kind::Override => {}
        }
    }

    fn executed(&mut self, line: Option<usize>) {
        if let Some(line) = line.filter(|&it| it != usize::MAX) {
            self.outbox.tell(Event::Executed(line));
        }
    }

    fn reply(&mut self, now: Seconds, text: &str) {
        let lower = text.to_ascii_lowercase();
        if lower == "start" {
            match self.phase {
                Phase::Greeting | Phase::Asking => self.greet(now),
                Phase::Ready => {
                    let place = self.place();
                    self.sent = None;
                    self.fail(now, Fault::Reset(place));
                }
                Phase::Aborting { .. } | Phase::Ended => {}
            }
        } else if lower == "ok" || lower.starts_with("ok ") {
            self.answered(now);
        } else if lower.starts_with("resend:") || lower.starts_with("rs ") {
            let number = lower.trim_start_matches(|c: char| !c.is_ascii_digit()).parse::<u32>().ok();
            // Asked for the line after this one, the board has it already: only its answer was lost.
            if number.is_none_or(|it| it <= self.number) {
                self.resend(now);
            }
        } else if lower.starts_with("error:") {
            // The request to send again follows these.
            if !lower.contains("checksum") && !lower.contains("line number") {
                let fault = Fault::Said { text: text.to_owned(), place: self.place() };
                self.fail(now, fault);
            }
        } else if lower.starts_with("echo:busy") {
            self.progress = now;
        } else if lower.starts_with("echo:unknown command") {
            let fault = Fault::Said { text: text.to_owned(), place: self.place() };
            self.fail(now, fault);
        } else if let Some(position) = position(text) {
            self.position = position;
            self.outbox.tell(Event::Position(position, Mode::Idle));
        } else {
            self.outbox.tell(Event::Message(text.to_owned()));
        }
    }

    fn resend(&mut self, now: Seconds) {
        self.resends += 1;
        self.skip = true;
        // The copy that was sent unasked answers this.
        if std::mem::take(&mut self.copied) {
            return;
        }
        let Some(sent) = &mut self.sent else { return };
        if self.resends > RESENDS {
            let text = format!("it asked for the same line {RESENDS} times over (a bad cable, or the wrong baud rate)");
            let fault = Fault::Said { text, place: self.place() };
            self.fail(now, fault);
            return;
        }
        self.outbox.line(&sent.text);
        sent.at = now;
    }

    fn watch(&mut self, now: Seconds) {
        let opened = *self.opened.get_or_insert(now);
        match self.phase {
            // Some boards do not reset when the port is opened, and say nothing until they are asked.
            Phase::Greeting if now - opened > 0.5 * self.options.boot => self.greet(now),
            Phase::Asking if now - opened > self.options.boot + ANSWER => {
                self.phase = Phase::Ended;
                self.outbox.tell(Event::Ended(Fault::NoReply(now - opened), Aborted::default()));
            }
            Phase::Ready => {
                let Some(sent) = &self.sent else { return };
                let allowed = ANSWER + sent.patience + (self.schedule.due - now).max(0.0);
                let waited = now - self.progress.max(sent.at);
                if waited > allowed {
                    let place = sent.place.clone();
                    self.fail(now, Fault::LostOk { missing: 1, place });
                } else if waited > 0.5 * allowed && !self.again {
                    // The end of the line or its answer may be lost. Its number keeps it from being done twice.
                    (self.again, self.copied) = (true, true);
                    self.outbox.bytes.push(b'\n');
                    self.outbox.line(&sent.text);
                }
            }
            Phase::Aborting { fault_at, .. } if now - fault_at > CLOSING + self.options.buffered => {
                self.end(Aborted::default());
            }
            _ => {}
        }
    }
}

/// The place in an answer to M114: `X:1.00 Y:2.00 Z:0.00 E:0.00 Count …`.
fn position(text: &str) -> Option<Point> {
    let mut out = [0.0; 3];
    for (slot, axis) in out.iter_mut().zip(["X:", "Y:", "Z:"]) {
        let rest = &text[text.find(axis)? + 2..];
        *slot = rest.split_whitespace().next()?.parse().ok().filter(|it: &f64| it.is_finite())?;
    }
    text.starts_with("X:").then_some(out)
}

impl Protocol for Marlin {
    fn receive(&mut self, now: Seconds, bytes: &[u8]) {
        self.schedule.now = now;
        let mut reader = std::mem::take(&mut self.reader);
        reader.feed(bytes, |line| {
            if self.phase != Phase::Ended {
                self.reply(now, &line);
            }
        });
        self.reader = reader;
    }

    fn tick(&mut self, now: Seconds) {
        self.schedule.now = now;
        self.watch(now);
        if self.phase == Phase::Ready && self.sent.is_none() {
            if let Some(percent) = self.feed.take() {
                self.transmit(now, &Line::command(format!("M220 S{percent}")), Kind::Override);
            } else if !self.synced && now - self.pushed > QUIET {
                let patience = (self.schedule.due - now).max(0.0) + 1.0;
                self.transmit(now, &Line { patience, ..Line::command("M400") }, Kind::Sync);
            }
        }
    }

    fn pace(&self) -> Seconds {
        0.02
    }

    fn can_take(&self, line: &Line) -> bool {
        // A little is always let through: with less the machine would stop after each line.
        let short = self.ahead() + line.seconds <= self.options.buffered || self.ahead() < LEAST_AHEAD;
        self.phase == Phase::Ready && self.sent.is_none() && short
    }

    fn push(&mut self, now: Seconds, line: Line) {
        self.transmit(now, &line, Kind::Program);
        self.schedule.add(now, line.seconds);
        self.pushed = now;
        self.synced = false;
        self.track.sent(line.index.unwrap_or(usize::MAX), line.moves, line.seconds, line.waits, line.opaque);
    }

    fn at_rest(&self) -> bool {
        self.phase == Phase::Ready && self.sent.is_none() && self.synced
    }

    fn command(&mut self, now: Seconds, command: Command) {
        match command {
            Command::Abort => self.fail(now, Fault::Interrupted),
            Command::Feed(percent) => self.feed = Some(percent.clamp(10, 200)),
        }
    }

    fn broken(&mut self, _now: Seconds, fault: Fault) {
        if self.phase != Phase::Ended {
            self.outbox.fault.get_or_insert(fault);
            self.end(Aborted::default());
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn checksums_and_positions_are_as_the_firmware_says() {
        // The example of the RepRap wiki: N3 T0*57.
        assert_eq!(checksum("N3 T0"), 57);
        assert_eq!(position("X:1.50 Y:-2.00 Z:0.30 E:0.00 Count X:120 Y:-160 Z:120"), Some([1.5, -2.0, 0.3]));
        assert_eq!(position("echo:X:1"), None);
    }
}
