//! A Marlin board with a servo pen: numbered lines with checksums, a planner of sixteen blocks, `busy` while it waits.
use std::collections::VecDeque;

use super::{Device, STEP, Voice};

/// Faults to switch on.
#[derive(Clone, Debug, Default)]
pub(crate) struct Faults {
    /// These received bytes have a bit flipped.
    pub(crate) garbled: Vec<usize>,
    /// This `ok` is lost.
    pub(crate) lost_ok: Option<usize>,
    /// It starts anew.
    pub(crate) reset_at: Option<f64>,
    pub(crate) unplug_at: Option<f64>,
    /// It stops for good, with this message.
    pub(crate) killed_at: Option<(f64, &'static str)>,
}

struct Block {
    to: [f64; 2],
    seconds: f64,
}

enum Wait {
    Room(Block),
    Motion,
    Until(f64),
}

pub(crate) struct MarlinBoard {
    pub(crate) faults: Faults,
    t: f64,
    boot: f64,
    /// Seconds from the opening of the port to its first word.
    pub(crate) starts_in: f64,
    started: bool,
    dead: bool,
    line: Vec<u8>,
    lines: VecDeque<String>,
    expected: u32,
    wait: Option<Wait>,
    busy_told: f64,
    queue: VecDeque<Block>,
    running: f64,
    /// Where the board thinks the head is, and how far off that is.
    at: [f64; 2],
    slip: [f64; 2],
    planned: [f64; 2],
    feed: f64,
    rapid: f64,
    voice: Voice,
    // Books.
    pub(crate) received: usize,
    pub(crate) oks: usize,
    pub(crate) resends: usize,
    pub(crate) down: bool,
    /// The servo turned while the head still had a way to go.
    pub(crate) early: usize,
    pub(crate) strokes: Vec<Vec<[f64; 2]>>,
    pub(crate) switched: Vec<f64>,
}

impl MarlinBoard {
    pub(crate) fn new() -> Self {
        Self {
            faults: Faults::default(),
            t: 0.0,
            boot: 1.0,
            starts_in: 1.0,
            started: false,
            dead: false,
            line: Vec::new(),
            lines: VecDeque::new(),
            expected: 0,
            wait: None,
            busy_told: 0.0,
            queue: VecDeque::new(),
            running: 0.0,
            at: [0.0; 2],
            slip: [0.0; 2],
            planned: [0.0; 2],
            feed: 1000.0,
            rapid: 6000.0,
            voice: Voice::default(),
            received: 0,
            oks: 0,
            resends: 0,
            down: false,
            early: 0,
            strokes: Vec::new(),
            switched: Vec::new(),
        }
    }

    pub(crate) fn moving(&self) -> bool {
        !self.queue.is_empty()
    }

    /// Where the head really is.
    fn place(&self) -> [f64; 2] {
        [0, 1].map(|i| self.at[i] + self.slip[i])
    }

    fn say(&mut self, text: &str) {
        self.voice.say(self.t, &format!("{text}\n"), 0.0);
    }

    fn ok(&mut self) {
        self.oks += 1;
        if self.faults.lost_ok != Some(self.oks) {
            self.say("ok");
        }
    }

    fn servo(&mut self, angle: f64) {
        let down = angle > 50.0;
        if down != self.down {
            self.early += usize::from(self.moving());
            self.down = down;
            self.switched.push(self.t);
            if down {
                self.strokes.push(vec![self.place()]);
            }
        }
    }

    fn take(&mut self, line: &str) {
        let mut text = line.trim();
        if let Some(rest) = text.strip_prefix('N') {
            let digits = rest.find(|c: char| !c.is_ascii_digit()).unwrap_or(rest.len());
            let number: u32 = rest[..digits].parse().unwrap_or(0);
            let sum = |it: &str| it.bytes().fold(0_u8, |a, b| a ^ b);
            let whole = text.rsplit_once('*').filter(|(body, told)| told.parse() == Ok(sum(body)));
            let Some((body, _)) = whole.filter(|_| number == self.expected + 1) else {
                self.resends += 1;
                let kind = if whole.is_some() { "Line Number is not Last Line Number+1" } else { "checksum mismatch" };
                self.say(&format!("Error:{kind}, Last Line: {}", self.expected));
                self.say(&format!("Resend: {}", self.expected + 1));
                self.ok();
                return;
            };
            self.expected = number;
            text = body[1 + digits..].trim();
        }
        self.execute(text);
    }

    fn execute(&mut self, text: &str) {
        let text: String = text.chars().filter(|c| !c.is_whitespace()).collect();
        let mut words: Vec<(char, f64)> = Vec::new();
        let mut rest = text.as_str();
        while let Some(letter) = rest.chars().next() {
            let end = rest[1..].find(|c: char| c.is_ascii_alphabetic()).map_or(rest.len(), |it| it + 1);
            words.push((letter, rest[1..end].parse().unwrap_or(0.0)));
            rest = &rest[end..];
        }
        let get = |letter: char| words.iter().find(|it| it.0 == letter).map(|it| it.1);
        match words.first().map(|it| (it.0, it.1 as u32)) {
            None => self.ok(),
            Some(('M', 110)) => {
                self.expected = get('N').unwrap_or(0.0) as u32;
                self.ok();
            }
            Some(('M', 410)) => {
                if self.moving() {
                    // Stopped without slowing down.
                    self.slip = [self.slip[0] + 0.7, self.slip[1] - 0.4];
                }
                self.queue.clear();
                self.planned = self.at;
                self.ok();
            }
            Some(('G', 28)) => {
                (self.at, self.planned, self.slip) = Default::default();
                self.ok();
            }
            Some(('M', 400)) => self.wait = Some(Wait::Motion),
            Some(('M', 280)) => {
                self.servo(get('S').unwrap_or(0.0));
                self.ok();
            }
            Some(('M', 114)) => {
                let [x, y] = self.planned;
                self.say(&format!("X:{x:.2} Y:{y:.2} Z:0.00 E:0.00 Count X:0 Y:0 Z:0"));
                self.ok();
            }
            Some(('M', 115)) => {
                self.say("FIRMWARE_NAME:Marlin 2.1 (test) EMERGENCY_PARSER:0");
                self.ok();
            }
            Some(('G', 4)) => {
                let seconds = get('S').or(get('P').map(|it| it / 1000.0)).unwrap_or(0.0);
                self.wait = Some(Wait::Until(self.t + seconds));
            }
            Some(('G', 21 | 90 | 92)) | Some(('M', 220)) => self.ok(),
            Some(('G', code @ (0 | 1))) => {
                self.feed = get('F').unwrap_or(self.feed);
                let to = [get('X').unwrap_or(self.planned[0]), get('Y').unwrap_or(self.planned[1])];
                let way = (to[0] - self.planned[0]).hypot(to[1] - self.planned[1]);
                self.planned = to;
                let speed = if code == 0 { self.rapid } else { self.feed };
                self.wait = Some(Wait::Room(Block { to, seconds: 60.0 * way / speed }));
            }
            Some(_) => {
                self.say(&format!("echo:Unknown command: \"{text}\""));
                self.ok();
            }
        }
    }

    fn step(&mut self) {
        let mut left = STEP;
        while left > 0.0 {
            let Some(block) = self.queue.front() else { break };
            let rest = block.seconds - self.running;
            if rest > left {
                self.running += left;
                break;
            }
            left -= rest;
            self.running = 0.0;
            self.at = block.to;
            self.queue.pop_front();
            if self.down {
                let place = self.place();
                let stroke = self.strokes.last_mut().unwrap();
                if stroke.last() != Some(&place) {
                    stroke.push(place);
                }
            }
        }
        match self.wait.take() {
            Some(Wait::Room(block)) if self.queue.len() < 16 => {
                self.queue.push_back(block);
                self.ok();
            }
            Some(Wait::Motion) if self.queue.is_empty() => self.ok(),
            Some(Wait::Until(until)) if self.queue.is_empty() && self.t >= until => self.ok(),
            Some(wait) => {
                self.wait = Some(wait);
                if self.t - self.busy_told > 2.0 {
                    self.busy_told = self.t;
                    self.say("echo:busy: processing");
                }
            }
            None => {
                if let Some(line) = self.lines.pop_front() {
                    self.take(&line);
                }
            }
        }
    }

    fn start(&mut self) {
        (self.lines, self.line, self.queue, self.wait) = Default::default();
        self.started = false;
        self.boot = self.t + self.starts_in;
        self.expected = 0;
        // A board that starts takes the place where it stands for its zero.
        self.slip = self.place();
        (self.at, self.planned) = Default::default();
        self.dead = false;
        if self.down {
            self.servo(0.0);
        }
    }
}

impl Device for MarlinBoard {
    fn open(&mut self) {
        self.start();
    }

    fn receive(&mut self, byte: u8) {
        if !self.started || self.dead {
            return;
        }
        self.received += 1;
        let byte = if self.faults.garbled.contains(&self.received) { byte ^ 4 } else { byte };
        if byte == b'\n' || byte == b'\r' {
            let line = String::from_utf8_lossy(&std::mem::take(&mut self.line)).into_owned();
            if !line.trim().is_empty() {
                self.lines.push_back(line);
            }
        } else {
            self.line.push(byte);
        }
    }

    fn advance(&mut self, to: f64) {
        while self.t < to - 1e-12 {
            self.t += STEP;
            if self.faults.reset_at.is_some_and(|it| self.t >= it) {
                self.faults.reset_at = None;
                self.start();
            }
            if let Some((_, words)) = self.faults.killed_at.filter(|it| self.t >= it.0) {
                self.faults.killed_at = None;
                self.say(words);
                self.queue.clear();
                self.servo(0.0);
                self.dead = true;
            }
            if !self.started && self.t >= self.boot {
                self.started = true;
                self.say("start");
                self.say("echo:Marlin 2.1");
            }
            if self.started && !self.dead {
                self.step();
            }
            self.voice.advance(self.t);
        }
    }

    fn now(&self) -> f64 {
        self.t
    }

    fn output(&mut self) -> Vec<u8> {
        self.voice.output()
    }

    fn plugged(&self) -> bool {
        self.faults.unplug_at.is_none_or(|it| self.t < it)
    }
}
