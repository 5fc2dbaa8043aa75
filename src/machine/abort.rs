//! The safe abort of a GRBL-type board: `!`, wait for rest, 0x18, wait for the banner, `$X`, M5, retract. It keeps the
//! position and leaves the tool off; a feed hold alone would leave spindle and laser on, a reset alone would lose the
//! position.
use std::collections::VecDeque;

use super::{
    protocol::{Aborted, Fault, Seconds},
    reply::{Mode, Reply},
};

/// What the abort waits for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Act {
    /// Motion to end.
    Hold,
    /// The banner.
    Reset,
    /// Answers to the closing lines.
    Close,
    Done,
}

impl Act {
    /// Seconds between status requests while motion ends: each costs that much of a laser burning in one place.
    pub(super) const POLL: Seconds = 0.02;
}

/// A board that says nothing for this long after `!` is reset without waiting, s.
const SILENT: Seconds = 0.3;
/// Longest deceleration, s.
const SLOWEST: Seconds = 5.0;
/// Longest wait for a banner after 0x18, s.
const BANNER: Seconds = 3.0;
/// Longest wait for the answer to a closing line, s.
const ANSWER: Seconds = 2.0;

/// An abort under way.
pub(super) struct Abort {
    fault: Fault,
    act: Act,
    since: Seconds,
    polled: Seconds,
    heard: Seconds,
    lines: VecDeque<String>,
    /// Closing lines of which the answer is awaited.
    waiting: bool,
    resets: u32,
    /// Where a Z axis has to go, and where it was last seen, machine coordinates.
    raise: Option<Raise>,
    outcome: Aborted,
}

/// The way up of a Z axis.
#[derive(Debug, Clone, Copy)]
pub(super) struct Raise {
    /// Height of the lifted tool, machine coordinates.
    pub(super) to: f64,
    /// Last reported height, machine coordinates.
    pub(super) from: f64,
}

impl Raise {
    fn needed(self) -> bool {
        self.to - self.from > 0.001
    }
}

impl Abort {
    /// Begins: `retract` are the lines after `$X` and M5; a Z axis is raised last.
    pub(super) fn new(now: Seconds, fault: Fault, retract: &[String], raise: Option<Raise>) -> Self {
        // A board in alarm answers nothing until it is reset; one that has reset itself needs no second time.
        let act = match fault {
            Fault::Alarm { .. } => Act::Reset,
            Fault::Reset(_) => Act::Close,
            _ => Act::Hold,
        };
        let lines = ["$X".to_owned(), "M5".to_owned()].into_iter().chain(retract.iter().cloned()).collect();
        Self {
            fault,
            act,
            since: now,
            polled: f64::NEG_INFINITY,
            heard: now,
            lines,
            waiting: false,
            resets: 0,
            raise,
            outcome: Aborted::default(),
        }
    }

    /// The fault and the outcome once it is over.
    pub(super) fn finished(&mut self) -> Option<(Fault, Aborted)> {
        (self.act == Act::Done).then(|| (self.fault.clone(), self.outcome))
    }

    pub(super) fn into_fault(self) -> Fault {
        self.fault
    }

    fn reset(&mut self, now: Seconds, out: &mut Vec<u8>) {
        out.push(0x18);
        self.resets += 1;
        self.act = Act::Reset;
        self.since = now;
    }

    pub(super) fn tick(&mut self, now: Seconds, out: &mut Vec<u8>) {
        match self.act {
            Act::Hold => {
                if self.polled == f64::NEG_INFINITY {
                    out.push(b'!');
                }
                if now - self.since > SLOWEST || now - self.heard > SILENT {
                    self.reset(now, out);
                } else if now - self.polled >= Act::POLL {
                    self.polled = now;
                    out.push(b'?');
                }
            }
            Act::Reset => {
                if self.resets == 0 {
                    self.reset(now, out);
                } else if now - self.since > BANNER {
                    // Once more, then the closing lines all the same: the board may hear without speaking.
                    if self.resets < 2 { self.reset(now, out) } else { self.close(now, out) }
                }
            }
            Act::Close => {
                if !self.waiting {
                    self.close(now, out);
                } else if now - self.since > ANSWER {
                    self.waiting = false;
                    self.close(now, out);
                }
            }
            Act::Done => {}
        }
    }

    /// Sends the next closing line.
    fn close(&mut self, now: Seconds, out: &mut Vec<u8>) {
        self.act = Act::Close;
        self.since = now;
        if self.lines.is_empty()
            && let Some(raise) = self.raise.take()
            && raise.needed()
        {
            // Relative, because after a reset of the board's power only the way up is known, not the height.
            self.lines.extend(["G21G91".to_owned(), format!("G0Z{:.3}", raise.to - raise.from), "G90".to_owned()]);
        }
        match self.lines.pop_front() {
            Some(line) => {
                out.extend_from_slice(line.as_bytes());
                out.push(b'\n');
                self.waiting = true;
            }
            None => self.act = Act::Done,
        }
    }

    pub(super) fn reply(&mut self, now: Seconds, reply: &Reply, out: &mut Vec<u8>) {
        self.heard = now;
        if let (Act::Hold, Reply::Report(report), Some(raise)) = (self.act, reply, &mut self.raise)
            && let Some(machine) = report.machine
        {
            raise.from = machine[2];
        }
        match (self.act, reply) {
            (Act::Hold, Reply::Report(report)) => {
                // A report that was under way when `!` went out may still say Idle or Run.
                let rest = match report.mode {
                    Mode::Hold { at_rest } => at_rest,
                    Mode::Idle | Mode::Check | Mode::Tool => now - self.since > 0.05,
                    Mode::Door => report.feed.is_none_or(|it| it == 0.0),
                    Mode::Alarm | Mode::Sleep => true,
                    Mode::Run | Mode::Jog | Mode::Home => false,
                };
                // A hold that met the machine in a dwell was ignored, and the motion after the dwell has begun.
                if matches!(report.mode, Mode::Run | Mode::Jog) {
                    out.push(b'!');
                }
                if rest {
                    self.outcome.position_kept = !matches!(report.mode, Mode::Alarm);
                    self.reset(now, out);
                }
            }
            (Act::Hold, Reply::Alarm(_)) => self.reset(now, out),
            (Act::Hold | Act::Close, Reply::Banner(_)) => {
                // It reset by itself: the position is lost, the lines begin again. Silence before it was its start.
                if let Fault::Mute { place, .. } = &mut self.fault {
                    self.fault = Fault::Reset(place.take());
                }
                self.outcome.position_kept = false;
                self.waiting = false;
                self.act = Act::Close;
                self.lines.push_front("$X".to_owned());
                self.close(now, out);
            }
            (Act::Reset, Reply::Alarm(3)) => self.outcome.position_kept = false,
            (Act::Reset, Reply::Banner(_)) => {
                // A soft limit stops the machine before it resets: its position holds.
                if matches!(self.fault, Fault::Alarm { code: 2, .. }) {
                    self.outcome.position_kept = true;
                }
                // The reset puts out spindle and laser; a Z axis still has to come up.
                self.outcome.tool_off = self.raise.is_none();
                self.close(now, out);
            }
            (Act::Close, Reply::Ok | Reply::Error(_)) if self.waiting => {
                self.waiting = false;
                let last = self.lines.is_empty() && self.raise.is_none_or(|it| !it.needed());
                self.outcome.tool_off |= *reply == Reply::Ok && last;
                self.close(now, out);
            }
            _ => {}
        }
    }
}
