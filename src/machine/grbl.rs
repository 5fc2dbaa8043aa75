//! GRBL 1.1, grblHAL and FluidNC: greeting, settings, streaming, watchdogs. The safe abort is in [`super::abort`].
use std::collections::VecDeque;

use super::{
    abort::{Abort, Act, Raise},
    board::{Board, Options},
    protocol::{Aborted, Command, Event, Fault, Line, Outbox, Place, Protocol, Seconds},
    reply::{LineReader, Mode, Reply, Report, parse, same_place},
    track::Track,
};

/// Seconds between status requests.
const POLL: Seconds = 0.1;
/// Between the bytes of feed overrides: two in one go count once.
const OVERRIDE_GAP: Seconds = 0.12;
/// Reports of an idle machine must span this before a missing answer counts as lost.
const IDLE_FOR: Seconds = 0.7;
/// Silence that counts as mute.
const SILENCE: Seconds = 1.0;
/// No motion and no answer while the board says it runs.
const STALL: Seconds = 10.0;
/// Time for the answer to a question.
const ANSWER: Seconds = 3.0;

#[derive(Debug, Clone, Copy, PartialEq)]
enum Phase {
    /// Waiting for a banner or a report.
    Greeting,
    /// Asking for settings.
    Asking,
    Ready,
    Aborting,
    Ended,
}

struct Sent {
    place: Place,
    bytes: usize,
    patience: Seconds,
    alone: bool,
    tolerant: bool,
    at: Seconds,
}

/// The state machine.
pub struct Grbl {
    options: Options,
    phase: Phase,
    opened: Option<Seconds>,
    reader: LineReader,
    /// Sent and not answered.
    inflight: VecDeque<Sent>,
    used: usize,
    /// Questions to come.
    questions: VecDeque<&'static str>,
    /// Whether a question has been repeated.
    asked_twice: bool,
    /// The board's own description.
    pub board: Board,
    track: Track,
    outbox: Outbox,
    abort: Option<Abort>,
    polled: Seconds,
    heard: Seconds,
    /// When the board last answered a line, moved, or was given a line while idle.
    progress: Seconds,
    idle_since: Option<(Seconds, u32)>,
    /// Reports since the last line went out or was answered: an older one may show the state before it.
    fresh: u32,
    /// Feed override asked for, and when a byte for it last went out.
    feed: u32,
    feed_sent: Seconds,
    /// A banner is expected: check mode is being left.
    leaving_check: bool,
    in_check: bool,
    /// Plan seconds and time at the last look for slowness.
    pace_mark: Option<(Seconds, f64)>,
    slow_told: bool,
    alarm: Option<u16>,
}

const QUESTIONS: [&str; 4] = ["$I", "$$", "$#", "$G"];

impl Grbl {
    /// Waits for the board to greet.
    pub fn new(options: Options) -> Self {
        Self {
            options,
            phase: Phase::Greeting,
            opened: None,
            reader: LineReader::default(),
            inflight: VecDeque::new(),
            used: 0,
            questions: VecDeque::new(),
            asked_twice: false,
            board: Board { overrides: 100, ..Board::default() },
            track: Track::new(15),
            outbox: Outbox::default(),
            abort: None,
            polled: 0.0,
            heard: 0.0,
            progress: 0.0,
            idle_since: None,
            fresh: 0,
            feed: 100,
            feed_sent: 0.0,
            leaving_check: false,
            in_check: false,
            pace_mark: None,
            slow_told: false,
            alarm: None,
        }
    }

    /// Whether the board is locked.
    pub fn locked(&self) -> bool {
        self.board.mode == Some(Mode::Alarm)
    }

    /// The last alarm number.
    pub fn alarm(&self) -> Option<u16> {
        self.alarm
    }

    /// The next lines are only checked by the board (`$C`).
    pub fn set_check(&mut self, on: bool) {
        self.in_check = on;
        self.leaving_check = !on;
    }

    /// Bytes that fit the board's buffer, as it says itself.
    fn room(&self) -> Option<usize> {
        // One byte is left free: some ring buffers cannot use their last.
        self.board.receive.map(|it| (it as usize).saturating_sub(1))
    }

    fn transmit(&mut self, now: Seconds, line: &Line) {
        if self.inflight.is_empty() {
            self.progress = now;
        }
        self.idle_since = None;
        self.fresh = 0;
        let bytes = line.text.len() + 1;
        self.used += bytes;
        self.inflight.push_back(Sent {
            place: Place { index: line.index, text: line.text.clone() },
            bytes,
            patience: line.patience,
            alone: line.alone,
            tolerant: line.tolerant,
            at: now,
        });
        self.outbox.line(&line.text);
    }

    fn ask(&mut self, now: Seconds) {
        match self.questions.front() {
            Some(&text) => {
                let line = Line { tolerant: true, ..Line::command(text) };
                self.transmit(now, &line);
            }
            None => {
                if let Some(blocks) = self.board.blocks {
                    self.track = Track::new(blocks as usize);
                }
                if self.options.counting && self.board.receive.is_none() {
                    self.warn("the board does not tell the size of its buffer ($I): one line at a time is sent".into());
                }
                self.phase = Phase::Ready;
                self.outbox.tell(Event::Ready);
            }
        }
    }

    fn warn(&mut self, text: String) {
        self.outbox.tell(Event::Warning(text));
    }

    fn forget_lines(&mut self) {
        self.inflight.clear();
        self.used = 0;
        self.track.clear();
        self.idle_since = None;
    }

    fn oldest(&self) -> Option<Place> {
        self.inflight.front().map(|it| it.place.clone())
    }

    /// Starts the safe abort. The first fault counts; later ones are its consequences.
    fn fail(&mut self, now: Seconds, fault: Fault) {
        if matches!(self.phase, Phase::Aborting | Phase::Ended) {
            return;
        }
        self.phase = Phase::Aborting;
        let raise = self
            .options
            .clear_height
            .map(|clear| Raise { to: clear + self.board.work_zero()[2], from: self.board.position[2] });
        let mut abort = Abort::new(now, fault, &self.options.retract, raise);
        self.inflight.clear();
        self.used = 0;
        abort.tick(now, &mut self.outbox.bytes);
        self.abort = Some(abort);
    }

    fn reply(&mut self, now: Seconds, text: String) {
        let reply = parse(&text);
        if let Reply::Report(report) = &reply {
            self.board.note(report);
        }
        if let Some(abort) = &mut self.abort {
            if let Reply::Report(report) = &reply {
                self.outbox.tell(Event::Position(self.board.position, report.mode));
            }
            abort.reply(now, &reply, &mut self.outbox.bytes);
            self.settle_abort();
            return;
        }
        match reply {
            Reply::Banner(banner) => self.banner(now, banner),
            Reply::Report(report) => self.report(now, &report),
            _ if self.phase == Phase::Greeting => {}
            Reply::Ok => self.answered(now, None),
            Reply::Error(code) => self.answered(now, Some(code)),
            Reply::Alarm(code) => {
                self.alarm = Some(code);
                self.fail(now, Fault::Alarm { code, place: self.oldest() });
            }
            Reply::Setting(key, value) => {
                self.board.settings.insert(key, value);
            }
            Reply::Options { letters, blocks, bytes } => {
                self.board.letters = letters;
                self.board.blocks = blocks.filter(|it| (1..=4096).contains(it));
                self.board.receive = bytes.filter(|it| (32..=1 << 20).contains(it));
            }
            Reply::Offset(name, p) => self.board.set_offset(&name, p),
            Reply::ToolOffset(z) => self.board.offsets.tool = z,
            Reply::Text(text) => self.outbox.tell(Event::Message(text)),
        }
    }

    fn settle_abort(&mut self) {
        if let Some((fault, aborted)) = self.abort.as_mut().and_then(Abort::finished) {
            self.abort = None;
            self.phase = Phase::Ended;
            self.outbox.tell(Event::Ended(fault, aborted));
        }
    }

    fn banner(&mut self, now: Seconds, banner: String) {
        self.board.banner = banner;
        if self.phase == Phase::Ready && !self.leaving_check {
            let place = self.oldest();
            self.fail(now, Fault::Reset(place));
            return;
        }
        self.forget_lines();
        self.board.mode = None;
        if self.leaving_check {
            self.leaving_check = false;
            self.outbox.tell(Event::Restarted);
        }
        // From here on the answers count; a banner while asking starts the questions anew.
        self.phase = Phase::Asking;
        self.questions = QUESTIONS.into();
        self.asked_twice = false;
        self.progress = now;
        self.ask(now);
    }

    fn report(&mut self, now: Seconds, report: &Report) {
        if self.phase == Phase::Greeting {
            self.greeted_by_report(now, report.mode);
            return;
        }
        self.fresh += 1;
        let position = self.board.position;
        self.outbox.tell(Event::Position(position, report.mode));
        if self.phase != Phase::Ready || self.in_check {
            return;
        }
        match report.mode {
            Mode::Alarm if self.inflight.iter().any(|it| it.place.index.is_some()) => {
                self.fail(now, Fault::Alarm { code: self.alarm.unwrap_or(0), place: self.oldest() });
            }
            Mode::Door => self.fail(now, Fault::Stopped("its door is open")),
            Mode::Sleep => self.fail(now, Fault::Stopped("it went to sleep")),
            Mode::Tool => self.fail(now, Fault::Stopped("it waits for a tool change")),
            Mode::Idle => self.idle(now),
            Mode::Run | Mode::Jog | Mode::Hold { .. } => {
                self.idle_since = None;
                match self.track.at(position) {
                    Ok(news) => self.executed(now, news),
                    Err(off) => {
                        let index = self.track.current();
                        let place = self.inflight.front().map(|it| it.place.clone());
                        let place = place.or(index.map(|it| Place { index: Some(it), text: String::new() }));
                        self.fail(now, Fault::OffPath { position, off, place });
                    }
                }
                self.look_for_slowness(now, report.mode);
            }
            _ => self.idle_since = None,
        }
    }

    fn executed(&mut self, now: Seconds, line: Option<usize>) {
        if let Some(line) = line.filter(|&it| it != usize::MAX) {
            self.progress = now;
            self.outbox.tell(Event::Executed(line));
        }
    }

    /// An idle machine with answers missing has lost them, unless one of the lines takes its time (a dwell).
    fn idle(&mut self, now: Seconds) {
        let (since, count) = self.idle_since.map_or((now, 0), |(since, count)| (since, count + 1));
        self.idle_since = Some((since, count));
        if self.inflight.is_empty() {
            let news = self.track.idle();
            self.executed(now, news);
            return;
        }
        let patience: Seconds = self.inflight.iter().map(|it| it.patience).sum();
        let asked = self.inflight.back().map_or(now, |it| it.at).max(self.progress);
        if count >= 3 && now - since > IDLE_FOR + patience && now - asked > IDLE_FOR + patience {
            let missing = self.inflight.len();
            if let Some(place) = self.oldest() {
                self.fail(now, Fault::LostOk { missing, place });
            }
        }
    }

    /// A garbled feed word makes the job crawl: the plan falls behind the clock.
    fn look_for_slowness(&mut self, now: Seconds, mode: Mode) {
        let done = self.track.done();
        if !matches!(mode, Mode::Run) || self.board.overrides != 100 {
            self.pace_mark = None;
            return;
        }
        let (since, mark) = *self.pace_mark.get_or_insert((now, done));
        let (elapsed, planned) = (now - since, done - mark);
        if elapsed > 5.0 {
            if planned < 0.3 * elapsed && !self.slow_told && self.track.ahead() > 1.0 {
                self.slow_told = true;
                self.warn(format!(
                    "the machine is much slower than planned ({planned:.1} s of the plan in {elapsed:.1} s): a feed \
                     word may have been garbled, or the board's limits ($110 to $122) are below the profile's"
                ));
            }
            self.pace_mark = Some((now, done));
        }
    }

    fn greeted_by_report(&mut self, now: Seconds, mode: Mode) {
        // The board did not reset when the port was opened: it may be at work with nobody watching.
        let busy = match mode {
            Mode::Run => Some("Run"),
            Mode::Hold { .. } => Some("Hold"),
            Mode::Jog => Some("Jog"),
            Mode::Home => Some("Home"),
            Mode::Door => Some("Door"),
            Mode::Tool => Some("Tool"),
            Mode::Check => Some("Check"),
            Mode::Idle | Mode::Alarm | Mode::Sleep => None,
        };
        if let Some(state) = busy {
            self.fail(now, Fault::WasRunning(state));
            return;
        }
        self.phase = Phase::Asking;
        // Half a line of an old sender may lie in the buffer: the first question ends it (with error:1, since no line
        // that holds a `$` is G-code), the second is answered.
        self.questions = ["$I"].into_iter().chain(QUESTIONS).collect();
        self.progress = now;
        self.ask(now);
    }

    fn answered(&mut self, now: Seconds, error: Option<u16>) {
        self.progress = now;
        self.idle_since = None;
        self.fresh = 0;
        let Some(sent) = self.inflight.pop_front() else {
            if let Some(code) = error {
                let place = Place { index: None, text: "(nothing was sent)".into() };
                self.fail(now, Fault::Error { code, place });
            } else {
                self.warn("the board answered once more than it was asked".into());
            }
            return;
        };
        self.used -= sent.bytes;
        if let Some(code) = error.filter(|_| !sent.tolerant) {
            self.fail(now, Fault::Error { code, place: sent.place });
            return;
        }
        if self.phase == Phase::Asking {
            self.questions.pop_front();
            self.asked_twice = false;
            self.ask(now);
            return;
        }
        if !self.in_check {
            let news = self.track.ok();
            self.executed(now, news);
        }
        self.outbox.tell(Event::Answered(sent.place.index));
    }

    fn watch(&mut self, now: Seconds) {
        let opened = *self.opened.get_or_insert(now);
        match self.phase {
            Phase::Greeting => {
                if now - opened > self.options.boot {
                    self.phase = Phase::Ended;
                    self.outbox.tell(Event::Ended(Fault::NoReply(now - opened), Aborted::default()));
                }
            }
            Phase::Asking => {
                if now - self.progress > ANSWER {
                    if self.asked_twice {
                        self.fail(now, Fault::NoReply(now - self.progress));
                    } else {
                        self.asked_twice = true;
                        self.forget_lines();
                        self.progress = now;
                        self.ask(now);
                    }
                }
            }
            Phase::Ready => self.watch_job(now),
            Phase::Aborting | Phase::Ended => {}
        }
    }

    fn watch_job(&mut self, now: Seconds) {
        let front = self.inflight.front();
        // While homing, and while it writes its memory, a board may answer nothing at all.
        let patience = front.filter(|it| it.alone).map_or(0.0, |it| it.patience);
        let asked = front.filter(|it| it.alone).map_or(0.0, |it| it.at);
        let silent = now - self.heard.max(asked);
        if silent > SILENCE + patience {
            self.fail(now, Fault::Mute { seconds: now - self.heard, place: self.oldest() });
            return;
        }
        let patience: Seconds = self.inflight.iter().map(|it| it.patience).sum();
        if self.in_check && now - self.progress > ANSWER + patience {
            let missing = self.inflight.len();
            if let Some(place) = self.oldest() {
                self.fail(now, Fault::LostOk { missing, place });
            }
            return;
        }
        let running = matches!(self.board.mode, Some(Mode::Run | Mode::Jog));
        if running && !self.in_check && now - self.progress > STALL + patience {
            self.fail(now, Fault::Stalled { seconds: now - self.progress, place: self.oldest() });
        }
    }

    fn poll(&mut self, now: Seconds) {
        let pace = if self.phase == Phase::Greeting { 0.5 } else { POLL };
        let homing = self.inflight.front().is_some_and(|it| it.place.text.starts_with("$H"));
        if now - self.polled >= pace && !homing {
            self.polled = now;
            self.outbox.bytes.push(b'?');
        }
        let current = self.board.overrides;
        if self.phase == Phase::Ready && current != self.feed && now - self.feed_sent >= OVERRIDE_GAP {
            self.feed_sent = now;
            let (byte, step) = match i64::from(self.feed) - i64::from(current) {
                _ if self.feed == 100 => (0x90, 0),
                10.. => (0x91, 10),
                1..10 => (0x93, 1),
                -9..=-1 => (0x94, -1),
                _ => (0x92, -10),
            };
            self.outbox.bytes.push(byte);
            // Taken as done; the next report with `Ov` corrects it.
            self.board.overrides = if step == 0 { 100 } else { (i64::from(current) + step).max(10) as u32 };
        }
    }
}

impl Protocol for Grbl {
    fn receive(&mut self, now: Seconds, bytes: &[u8]) {
        if bytes.is_empty() {
            return;
        }
        self.heard = now;
        let before = self.board.position;
        let mut reader = std::mem::take(&mut self.reader);
        reader.feed(bytes, |line| {
            if self.phase != Phase::Ended {
                self.reply(now, line);
            }
        });
        self.reader = reader;
        if !same_place(before, self.board.position) {
            self.progress = now;
        }
    }

    fn tick(&mut self, now: Seconds) {
        if self.opened.is_none() {
            self.opened = Some(now);
            self.heard = now;
            self.polled = now - 0.3;
        }
        if let Some(abort) = &mut self.abort {
            abort.tick(now, &mut self.outbox.bytes);
            self.settle_abort();
            return;
        }
        if self.phase == Phase::Ended {
            return;
        }
        self.watch(now);
        if !matches!(self.phase, Phase::Aborting | Phase::Ended) {
            self.poll(now);
        }
    }

    fn pace(&self) -> Seconds {
        if self.phase == Phase::Aborting { Act::POLL } else { POLL / 4.0 }
    }

    fn can_take(&self, line: &Line) -> bool {
        if self.phase != Phase::Ready || self.leaving_check {
            return false;
        }
        if line.alone || self.inflight.back().is_some_and(|it| it.alone) {
            return self.inflight.is_empty();
        }
        let fits = match self.room() {
            Some(room) if self.options.counting => self.used + line.text.len() < room,
            _ => self.inflight.is_empty(),
        };
        // Two moves are always let through: with less the machine would stop after each.
        let short = self.in_check
            || line.moves.is_empty()
            || self.track.ahead() + line.seconds <= self.options.buffered
            || self.track.moving_lines() < 2;
        fits && short
    }

    fn push(&mut self, now: Seconds, line: Line) {
        self.transmit(now, &line);
        if !self.in_check {
            let index = line.index.unwrap_or(usize::MAX);
            self.track.sent(index, line.moves, line.seconds, line.waits, line.opaque && line.index.is_some());
        }
    }

    fn at_rest(&self) -> bool {
        let rest = self.inflight.is_empty() && !self.leaving_check && self.phase == Phase::Ready;
        let stands = self.in_check || self.locked() && self.fresh >= 2 || self.idle_since.is_some_and(|it| it.1 >= 1);
        rest && stands
    }

    fn command(&mut self, now: Seconds, command: Command) {
        match command {
            Command::Abort => self.fail(now, Fault::Interrupted),
            Command::Feed(percent) => self.feed = percent.clamp(10, 200),
        }
    }

    fn broken(&mut self, _now: Seconds, fault: Fault) {
        // Nothing can be sent any more; a fault that was being handled stays the first cause.
        if self.phase != Phase::Ended {
            let first = self.abort.take().map_or(fault, Abort::into_fault);
            self.phase = Phase::Ended;
            self.outbox.tell(Event::Ended(first, Aborted::default()));
        }
    }

    fn outbox(&mut self) -> &mut Outbox {
        &mut self.outbox
    }

    fn ahead(&self) -> Seconds {
        self.track.ahead()
    }

    fn done(&self) -> Seconds {
        self.track.done()
    }
}
