//! A board that behaves like GRBL 1.1 or grblHAL: receive buffer, parser, planner with look-ahead, spindle, alarms.
//! It has its own reading of G-code and its own motion, so that it can disagree with the sender.
use std::collections::{BTreeMap, VecDeque};

use super::{Device, STEP, Voice};

pub(crate) type P3 = [f64; 3];

/// How its tool shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Tool {
    Laser,
    Servo { up: f64, down: f64 },
    Z { clear: f64 },
}

/// Faults to switch on; times in seconds of the board, counts from 1.
#[derive(Clone, Debug, Default)]
pub(crate) struct Faults {
    /// Added to every answer.
    pub(crate) latency: f64,
    /// This received byte is dropped / has these bits flipped.
    pub(crate) drop_byte: Option<usize>,
    pub(crate) garble_byte: Option<(usize, u8)>,
    /// This answer is lost.
    pub(crate) lost_ok: Option<usize>,
    /// From here on it says nothing (and still hears).
    pub(crate) mute_at: Option<f64>,
    /// From here on it neither says nor hears anything, but moves on.
    pub(crate) deaf_at: Option<f64>,
    /// A limit switch fires.
    pub(crate) alarm_at: Option<f64>,
    /// A line runs into a soft limit: it is answered only after the reset.
    pub(crate) soft_limit_at: Option<f64>,
    /// The power dips.
    pub(crate) reset_at: Option<f64>,
    pub(crate) unplug_at: Option<f64>,
    /// The line with this number is refused with error:20.
    pub(crate) refuse_line: Option<usize>,
}

#[derive(Clone, Debug)]
pub(crate) struct Config {
    pub(crate) hal: bool,
    pub(crate) tool: Tool,
    pub(crate) receive: usize,
    pub(crate) blocks: usize,
    pub(crate) settings: BTreeMap<u16, f64>,
    pub(crate) reset_on_open: bool,
    /// Seconds from power-up or open to the banner.
    pub(crate) boot: f64,
    /// Whether it has a fourth axis, A; its angle is kept in [`GrblBoard::angle`] and takes no time.
    pub(crate) rotary: bool,
    pub(crate) faults: Faults,
}

impl Config {
    pub(crate) fn new(tool: Tool) -> Self {
        let settings = [
            (11, 0.01),
            (13, 0.0),
            (20, 0.0),
            (22, 0.0),
            (23, 0.0),
            (30, 1000.0),
            (31, 0.0),
            (32, if tool == Tool::Laser { 1.0 } else { 0.0 }),
            (110, 6000.0),
            (111, 6000.0),
            (112, 3000.0),
            (120, 500.0),
            (121, 500.0),
            (122, 500.0),
            (130, 420.0),
            (131, 297.0),
            (132, 40.0),
        ];
        Self {
            hal: false,
            tool,
            receive: 128,
            blocks: 15,
            settings: settings.into(),
            reset_on_open: true,
            boot: 1.2,
            rotary: false,
            faults: Faults::default(),
        }
    }

    /// With homing and soft limits.
    pub(crate) fn homing(mut self) -> Self {
        self.settings.extend([(20, 1.0), (22, 1.0)]);
        self
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum St {
    Booting(f64),
    Idle,
    Run,
    Hold,
    Alarm,
    Check,
    Home(f64),
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Block {
    to: P3,
    unit: P3,
    len: f64,
    nominal: f64,
    acc: f64,
    entry_max: f64,
    rapid: bool,
    power: f64,
}

/// What the parser waits for before it answers.
#[derive(Clone, Debug)]
enum Wait {
    Room(VecDeque<Block>),
    Sync(Then),
    Dwell(f64),
    Home,
    /// M0: until `~`.
    Pause,
}

#[derive(Clone, Debug)]
enum Then {
    Spindle(u8, f64),
    Dwell(f64),
    Ok,
    Pause,
    End,
}

#[derive(Clone, Debug)]
struct Modal {
    motion: u8,
    inches: bool,
    relative: bool,
    feed: f64,
    spindle: u8,
    speed: f64,
    system: usize,
}

impl Modal {
    fn new() -> Self {
        Self { motion: 0, inches: false, relative: false, feed: 0.0, spindle: 5, speed: 0.0, system: 0 }
    }
}

/// A place passed, with the tool on or off on the way to it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Sample {
    pub(crate) t: f64,
    pub(crate) at: P3,
    pub(crate) on: bool,
}

pub(crate) struct GrblBoard {
    pub(crate) config: Config,
    t: f64,
    pub(crate) state: St,
    rx: VecDeque<u8>,
    line: Vec<u8>,
    overlong: bool,
    wait: Option<Wait>,
    plan: VecDeque<Block>,
    exits: Vec<f64>,
    dirty: bool,
    v: f64,
    s: f64,
    /// Where the head really is, machine coordinates of a homed machine.
    pub(crate) pos: P3,
    /// Reported position = pos - base.
    base: P3,
    /// End of the last planned block, reported coordinates.
    planned: P3,
    planned_dir: Option<P3>,
    modal: Modal,
    work: [P3; 6],
    g92: P3,
    /// Spindle output: 3, 4 or 5, and S.
    output: (u8, f64),
    critical: bool,
    hold: bool,
    feed_override: u32,
    reports: u32,
    voice: Voice,
    hal_error: bool,
    // Books.
    pub(crate) received: usize,
    pub(crate) oks: usize,
    pub(crate) lines: usize,
    pub(crate) overrun: usize,
    /// Degrees of the fourth axis.
    pub(crate) angle: f64,
    pub(crate) trace: Vec<Sample>,
    /// Times at which the tool changed.
    pub(crate) switched: Vec<(f64, bool)>,
    on: bool,
    /// Last time the head moved in x or y.
    pub(crate) moved_at: f64,
    pub(crate) motion_time: f64,
    /// Times the planner ran dry with the tool on a path.
    pub(crate) starved: usize,
    /// Settings that `$$` does not tell.
    pub(crate) hidden: Vec<u16>,
}

impl GrblBoard {
    pub(crate) fn new(config: Config) -> Self {
        let locked = config.settings[&22] != 0.0;
        Self {
            config,
            t: 0.0,
            state: if locked { St::Alarm } else { St::Idle },
            rx: VecDeque::new(),
            line: Vec::new(),
            overlong: false,
            wait: None,
            plan: VecDeque::new(),
            exits: Vec::new(),
            dirty: false,
            v: 0.0,
            s: 0.0,
            pos: [-210.0, -150.0, -5.0],
            base: [-210.0, -150.0, -5.0],
            planned: [0.0; 3],
            planned_dir: None,
            modal: Modal::new(),
            work: [[0.0; 3]; 6],
            g92: [0.0; 3],
            output: (5, 0.0),
            critical: false,
            hold: false,
            feed_override: 100,
            reports: 0,
            voice: Voice::default(),
            hal_error: false,
            received: 0,
            oks: 0,
            lines: 0,
            overrun: 0,
            angle: 0.0,
            trace: Vec::new(),
            switched: Vec::new(),
            on: false,
            moved_at: 0.0,
            motion_time: 0.0,
            starved: 0,
            hidden: Vec::new(),
        }
    }

    /// Work zero (G54) at this place of the homed machine.
    pub(crate) fn zero_at(mut self, p: P3) -> Self {
        self.work[0] = p;
        self
    }

    pub(crate) fn tool_on(&self) -> bool {
        self.on
    }

    pub(crate) fn reported(&self) -> P3 {
        std::array::from_fn(|i| self.pos[i] - self.base[i])
    }

    pub(crate) fn moving(&self) -> bool {
        self.v > 0.0
    }

    pub(crate) fn locked(&self) -> bool {
        self.critical || self.state == St::Alarm
    }

    /// Where the head really is when the work coordinates are zero.
    pub(crate) fn work_zero(&self) -> P3 {
        std::array::from_fn(|i| self.base[i] + self.work[0][i])
    }

    /// Plugs the cable in again after a power loss.
    pub(crate) fn replug(&mut self) {
        self.config.faults.unplug_at = None;
        self.power_up();
    }

    fn muted(&self) -> bool {
        let f = &self.config.faults;
        [f.mute_at, f.deaf_at].into_iter().flatten().any(|it| self.t >= it)
    }

    fn say(&mut self, text: &str) {
        if self.muted() {
            return;
        }
        self.voice.say(self.t, text, self.config.faults.latency);
    }

    fn ok(&mut self) {
        self.oks += 1;
        if self.config.faults.lost_ok != Some(self.oks) {
            self.say("ok\r\n");
        }
    }

    fn error(&mut self, code: u32) {
        if self.config.hal {
            self.hal_error = true;
        }
        self.say(&format!("error:{code}\r\n"));
    }

    fn alarm(&mut self, code: u32, critical: bool) {
        self.stop_all();
        self.state = St::Alarm;
        self.critical = critical;
        self.say(&format!("ALARM:{code}\r\n"));
        if critical {
            self.say("[MSG:Reset to continue]\r\n");
        }
    }

    fn stop_all(&mut self) {
        self.plan.clear();
        self.v = 0.0;
        self.s = 0.0;
        self.hold = false;
        self.planned = self.reported();
        self.planned_dir = None;
        self.output = (5, 0.0);
    }

    fn soft_reset(&mut self) {
        let was_moving = self.v > 0.0 || matches!(self.state, St::Home(_));
        let was_alarm = self.state == St::Alarm;
        let check = self.state == St::Check;
        // The answer to a line that ran into a soft limit comes only now.
        if self.critical {
            self.ok();
        }
        self.critical = false;
        self.stop_all();
        self.rx.clear();
        self.line.clear();
        self.overlong = false;
        self.wait = None;
        self.modal = Modal::new();
        self.g92 = [0.0; 3];
        self.feed_override = 100;
        self.hal_error = false;
        if was_moving {
            self.say("ALARM:3\r\n");
            self.state = St::Alarm;
        } else if was_alarm && !check {
            self.state = St::Alarm;
        } else {
            self.state = St::Idle;
        }
        let banner = if self.config.hal {
            "\r\nGrblHAL 1.1f ['$' or '$HELP' for help]\r\n"
        } else {
            "\r\nGrbl 1.1h ['$' for help]\r\n"
        };
        self.say(banner);
        if self.state == St::Alarm {
            self.say("[MSG:'$H'|'$X' to unlock]\r\n");
        }
    }

    fn power_up(&mut self) {
        self.critical = false;
        self.stop_all();
        self.rx.clear();
        self.line.clear();
        self.wait = None;
        self.modal = Modal::new();
        self.g92 = [0.0; 3];
        self.voice.silence();
        self.base = self.pos;
        self.planned = [0.0; 3];
        self.state = St::Booting(self.t + self.config.boot);
    }

    fn realtime(&mut self, byte: u8) -> bool {
        if self.critical && byte != 0x18 {
            return byte >= 0x80 || matches!(byte, b'?' | b'!' | b'~');
        }
        match byte {
            b'?' => {
                if self.config.hal || !matches!(self.state, St::Home(_)) {
                    self.report();
                }
            }
            b'!' => {
                if self.state == St::Run {
                    self.state = St::Hold;
                    self.hold = true;
                }
            }
            b'~' => {
                if self.state == St::Hold {
                    self.hold = false;
                    self.state = if self.plan.is_empty() { St::Idle } else { St::Run };
                    if matches!(self.wait, Some(Wait::Pause)) {
                        self.wait = None;
                        self.ok();
                    }
                }
            }
            0x18 => self.soft_reset(),
            0x90 => self.feed_override = 100,
            0x91 => self.feed_override = (self.feed_override + 10).min(200),
            0x92 => self.feed_override = (self.feed_override - 10).max(10),
            0x93 => self.feed_override = (self.feed_override + 1).min(200),
            0x94 => self.feed_override = (self.feed_override - 1).max(10),
            0x80.. => {}
            _ => return false,
        }
        true
    }

    fn report(&mut self) {
        let name = match self.state {
            St::Booting(_) => return,
            St::Idle => "Idle".into(),
            St::Run => "Run".to_owned(),
            St::Hold => format!("Hold:{}", u8::from(self.v > 0.0)),
            St::Alarm => "Alarm".into(),
            St::Check => "Check".into(),
            St::Home(_) => "Home".into(),
        };
        let [x, y, z] = self.reported();
        let fourth = if self.config.rotary { format!(",{:.3}", self.angle) } else { String::new() };
        let mut text =
            format!("<{name}|MPos:{x:.3},{y:.3},{z:.3}{fourth}|FS:{:.0},{:.0}", self.v * 60.0, self.output.1);
        self.reports += 1;
        if self.reports % 10 == 1 {
            let w = self.offset();
            text += &format!("|WCO:{:.3},{:.3},{:.3}", w[0], w[1], w[2]);
        } else if self.reports % 10 == 2 {
            text += &format!("|Ov:{},100,100", self.feed_override);
        }
        self.say(&(text + ">\r\n"));
    }

    fn offset(&self) -> P3 {
        std::array::from_fn(|i| self.work[self.modal.system][i] + self.g92[i])
    }

    // ---- motion

    fn plan_exits(&mut self) {
        let n = self.plan.len();
        self.exits = vec![0.0; n];
        let scale = f64::from(self.feed_override) / 100.0;
        let nominal = |b: &Block| if b.rapid { b.nominal } else { b.nominal * scale };
        let mut next = 0.0_f64;
        for i in (0..n).rev() {
            self.exits[i] = next;
            let b = &self.plan[i];
            let before = if i == 0 { f64::INFINITY } else { nominal(&self.plan[i - 1]) };
            next = b.entry_max.min(before).min(nominal(b)).min((next * next + 2.0 * b.acc * b.len).sqrt());
        }
        self.dirty = false;
    }

    fn step_motion(&mut self) {
        if self.plan.is_empty() || self.state == St::Alarm {
            if self.state == St::Run {
                self.state = St::Idle;
            }
            self.v = 0.0;
            return;
        }
        if self.state == St::Idle {
            self.state = St::Run;
        }
        if self.dirty {
            self.plan_exits();
        }
        let mut dt = STEP;
        self.motion_time += STEP;
        while dt > 1e-12 {
            let Some(block) = self.plan.front().copied() else { break };
            if self.s == 0.0 {
                // The beam changes at the very start of the block.
                self.sense();
            }
            let scale = if block.rapid { 1.0 } else { f64::from(self.feed_override) / 100.0 };
            let left = block.len - self.s;
            let exit = self.exits[0];
            let limit = (block.nominal * scale).min((exit * exit + 2.0 * block.acc * left).sqrt());
            let was = self.v;
            if self.hold {
                self.v = (self.v - block.acc * dt).max(0.0);
                if self.v == 0.0 {
                    break;
                }
            } else {
                self.v = (self.v + block.acc * dt).min(limit).max(block.acc * STEP);
            }
            let mean = (was + self.v) / 2.0;
            let d = mean * dt;
            if d >= left {
                dt -= if mean > 0.0 { left / mean } else { dt };
                self.s = 0.0;
                self.go(std::array::from_fn(|i| block.to[i] + self.base[i]));
                self.mark();
                self.plan.pop_front();
                self.exits.remove(0);
                if self.plan.is_empty() {
                    self.v = 0.0;
                    if self.output.0 == 4 || self.on {
                        self.starved += 1;
                    }
                }
            } else {
                self.s += d;
                let rest = block.len - self.s;
                self.go(std::array::from_fn(|i| block.to[i] + self.base[i] - block.unit[i] * rest));
                dt = 0.0;
            }
        }
    }

    fn go(&mut self, to: P3) {
        if (to[0] - self.pos[0]).hypot(to[1] - self.pos[1]) > 1e-9 {
            self.moved_at = self.t;
        }
        self.pos = to;
    }

    fn mark(&mut self) {
        let on = self.on;
        self.trace.push(Sample { t: self.t, at: self.pos, on });
    }

    fn sense(&mut self) {
        let (mode, s) = self.output;
        let block = self.plan.front();
        let on = match self.config.tool {
            Tool::Laser => match block {
                Some(b) => mode != 5 && !b.rapid && b.power > 0.0 && (mode == 3 || !self.hold || self.v > 0.0),
                None => mode == 3 && s > 0.0 && self.modal.motion != 0,
            },
            Tool::Servo { up, down } => mode != 5 && (s - up) / (down - up) > 0.2,
            Tool::Z { clear } => self.pos[2] - self.work[0][2] < clear,
        };
        if on != self.on {
            // The stretch before the change had the old state.
            self.mark();
            self.on = on;
            self.mark();
            self.switched.push((self.t, on));
        }
    }

    fn queue(&mut self, to: P3, rapid: bool, feed: f64) -> Option<Block> {
        let from = self.planned;
        let d: P3 = std::array::from_fn(|i| to[i] - from[i]);
        let len = d.iter().map(|it| it * it).sum::<f64>().sqrt();
        if len < 1e-6 {
            return None;
        }
        let unit = d.map(|it| it / len);
        let most = |first: u16| {
            (0..3)
                .filter(|&i| unit[i].abs() > 1e-9)
                .map(|i| self.config.settings[&(first + i as u16)] / unit[i].abs())
                .fold(f64::INFINITY, f64::min)
        };
        let acc = most(120);
        let rate = most(110) / 60.0;
        let nominal = if rapid { rate } else { rate.min(feed / 60.0) };
        let jd = self.config.settings[&11];
        let entry_max = match self.planned_dir {
            None => 0.0,
            Some(last) => {
                let cos = -(0..3).map(|i| last[i] * unit[i]).sum::<f64>();
                if cos > 0.999_999 {
                    0.0
                } else {
                    let half = ((1.0 - cos) / 2.0).sqrt();
                    if half > 0.999_999 { f64::INFINITY } else { (acc * jd * half / (1.0 - half)).sqrt() }
                }
            }
        };
        self.planned = to;
        self.planned_dir = Some(unit);
        let power = if self.modal.spindle == 5 { 0.0 } else { self.modal.speed };
        Some(Block { to, unit, len, nominal, acc, entry_max, rapid, power })
    }

    // ---- parser

    fn step_parser(&mut self) {
        match self.wait.take() {
            Some(Wait::Room(mut blocks)) => {
                while self.plan.len() < self.config.blocks && !blocks.is_empty() {
                    if self.plan.is_empty() {
                        // Motion had ended: the first block starts from rest.
                        blocks[0].entry_max = 0.0;
                    }
                    self.plan.extend(blocks.pop_front());
                    self.dirty = true;
                }
                if blocks.is_empty() { self.ok() } else { self.wait = Some(Wait::Room(blocks)) }
            }
            Some(Wait::Sync(then)) => {
                if !self.plan.is_empty() {
                    self.wait = Some(Wait::Sync(then));
                    return;
                }
                match then {
                    Then::Spindle(mode, s) => {
                        self.output = (mode, s);
                        self.ok();
                    }
                    Then::Dwell(seconds) => self.wait = Some(Wait::Dwell(self.t + seconds)),
                    Then::Ok => self.ok(),
                    Then::Pause => {
                        self.state = St::Hold;
                        self.wait = Some(Wait::Pause);
                    }
                    Then::End => {
                        self.output = (5, 0.0);
                        self.ok();
                    }
                }
                self.planned_dir = None;
            }
            Some(Wait::Dwell(until)) => {
                if self.t >= until {
                    self.ok()
                } else {
                    self.wait = Some(Wait::Dwell(until))
                }
            }
            Some(Wait::Home) => {
                if matches!(self.state, St::Home(_)) {
                    self.wait = Some(Wait::Home);
                } else {
                    self.ok();
                }
            }
            Some(Wait::Pause) => self.wait = Some(Wait::Pause),
            None => {
                if self.critical {
                    return;
                }
                while let Some(byte) = self.rx.pop_front() {
                    if byte == b'\n' || byte == b'\r' {
                        let line = String::from_utf8_lossy(&std::mem::take(&mut self.line)).into_owned();
                        let overlong = std::mem::take(&mut self.overlong);
                        self.execute(&line, overlong);
                        return;
                    }
                    if self.line.len() >= 79 {
                        self.overlong = true;
                    } else {
                        self.line.push(byte);
                    }
                }
            }
        }
    }

    fn execute(&mut self, line: &str, overlong: bool) {
        if overlong {
            self.error(11);
            return;
        }
        let mut plain = String::new();
        let mut comment = false;
        for c in line.chars() {
            match c {
                '(' => comment = true,
                ')' => comment = false,
                ';' if !comment => break,
                '/' => {}
                _ if comment || c.is_whitespace() => {}
                _ => plain.push(c.to_ascii_uppercase()),
            }
        }
        if plain.is_empty() {
            self.hal_error = false;
            self.ok();
            return;
        }
        if plain.starts_with('$') {
            self.hal_error = false;
            self.system(&plain);
            return;
        }
        self.lines += 1;
        if self.state == St::Alarm {
            self.error(9);
        } else if self.hal_error || self.config.faults.refuse_line == Some(self.lines) {
            self.error(20);
        } else if let Err(code) = self.block(&plain) {
            self.error(code);
        }
    }

    fn system(&mut self, line: &str) {
        let busy = !matches!(self.state, St::Idle | St::Alarm);
        match line {
            "$I" if !busy => {
                self.say(&format!(
                    "[VER:1.1h.20190830:]\r\n[OPT:V,{},{}]\r\n",
                    self.config.blocks, self.config.receive
                ));
                self.ok();
            }
            "$$" if !busy => {
                let told = self.config.settings.iter().filter(|it| !self.hidden.contains(it.0));
                let settings: Vec<_> = told.map(|(k, v)| format!("${k}={v:.3}\r\n")).collect();
                self.say(&settings.concat());
                self.ok();
            }
            "$#" if !busy => {
                for i in 0..6 {
                    let [x, y, z] = self.work[i];
                    self.say(&format!("[G{}:{x:.3},{y:.3},{z:.3}]\r\n", 54 + i));
                }
                let [x, y, z] = self.g92;
                self.say(&format!("[G28:0.000,0.000,0.000]\r\n[G92:{x:.3},{y:.3},{z:.3}]\r\n[TLO:0.000]\r\n"));
                self.ok();
            }
            "$G" => {
                self.say("[GC:G0 G54 G17 G21 G90 G94 M5 M9 T0 F0 S0]\r\n");
                self.ok();
            }
            "$X" => {
                if self.state == St::Alarm {
                    self.state = St::Idle;
                    self.say("[MSG:Caution: Unlocked]\r\n");
                }
                self.ok();
            }
            "$H" if !busy => {
                if self.config.settings[&22] == 0.0 {
                    self.error(5);
                } else {
                    self.state = St::Home(self.t + 2.0);
                    self.wait = Some(Wait::Home);
                }
            }
            "$C" if self.state == St::Check => {
                self.say("[MSG:Disabled]\r\n");
                self.ok();
                self.soft_reset();
            }
            "$C" if self.state == St::Idle => {
                self.state = St::Check;
                self.say("[MSG:Enabled]\r\n");
                self.ok();
            }
            "$I" | "$$" | "$#" | "$H" | "$C" => self.error(8),
            _ => self.error(3),
        }
    }

    fn block(&mut self, line: &str) -> Result<(), u32> {
        let mut words = Vec::new();
        let bytes = line.as_bytes();
        let mut at = 0;
        while at < bytes.len() {
            let letter = bytes[at] as char;
            if !letter.is_ascii_uppercase() {
                return Err(1);
            }
            let end = bytes[at + 1..]
                .iter()
                .position(|it| !b"0123456789.-+".contains(it))
                .map_or(bytes.len(), |it| at + 1 + it);
            let value: f64 = line[at + 1..end].parse().map_err(|_| 2_u32)?;
            words.push((letter, value));
            at = end;
        }
        let get = |letter: char| words.iter().find(|it| it.0 == letter).map(|it| it.1);
        let mut seen = Vec::new();
        for &(letter, _) in &words {
            if letter != 'G' && letter != 'M' && seen.contains(&letter) {
                return Err(25);
            }
            seen.push(letter);
        }
        let before = (self.modal.spindle, self.modal.speed);
        let mut modal = self.modal.clone();
        let (mut machine, mut then, mut nonmotion) = (false, None, 0);
        for &(letter, value) in &words {
            let code = (value * 10.0).round() as i32;
            match (letter, code) {
                ('G', 0 | 10 | 20 | 30) => modal.motion = (code / 10) as u8,
                ('G', 40) => then = Some(Then::Dwell(get('P').ok_or(28_u32)?)),
                ('G', 100) => nonmotion = 10,
                ('G', 920) => nonmotion = 92,
                ('G', 170 | 400 | 490 | 940 | 800 | 911) => {}
                ('G', 200) => modal.inches = true,
                ('G', 210) => modal.inches = false,
                ('G', 530) => machine = true,
                ('G', 540..=590) => modal.system = (code / 10 - 54) as usize,
                ('G', 900) => modal.relative = false,
                ('G', 910) => modal.relative = true,
                ('M', 0 | 10) => then = Some(Then::Pause),
                ('M', 20 | 300) => then = Some(Then::End),
                ('M', 30) => modal.spindle = 3,
                ('M', 40) => modal.spindle = 4,
                ('M', 50) => modal.spindle = 5,
                ('M', 70 | 80 | 90) => {}
                ('F', _) if value >= 0.0 => {}
                ('F' | 'S', _) if value < 0.0 => return Err(4),
                ('S' | 'X' | 'Y' | 'Z' | 'I' | 'J' | 'K' | 'R' | 'P' | 'L' | 'T' | 'N', _) => {}
                ('A', _) if self.config.rotary => self.angle = value,
                _ => return Err(20),
            }
        }
        let unit = if modal.inches { 25.4 } else { 1.0 };
        modal.feed = get('F').map_or(modal.feed, |it| it * unit);
        modal.speed = get('S').unwrap_or(modal.speed);
        let axes = ['X', 'Y', 'Z'].map(|it| get(it).map(|it| it * unit));
        let offset = self.offset();
        let moves = axes.iter().any(Option::is_some) && nonmotion == 0
            || modal.motion >= 2 && (get('I').is_some() || get('J').is_some());
        let to: P3 = std::array::from_fn(|i| match axes[i] {
            None => self.planned[i],
            Some(value) if machine => value,
            Some(value) if modal.relative => self.planned[i] + value,
            Some(value) => value + offset[i],
        });
        if moves && modal.motion > 0 && modal.feed <= 0.0 {
            return Err(22);
        }
        if nonmotion == 10 && get('L') != Some(2.0) && get('L') != Some(20.0) {
            return Err(20);
        }
        if self.state == St::Check {
            self.limits(to, moves)?;
            self.modal = modal;
            if moves {
                self.planned = to;
            }
            self.ok();
            return Ok(());
        }
        match nonmotion {
            10 => {
                let p = get('P').unwrap_or(0.0) as usize;
                let system = if p == 0 { modal.system } else { p - 1 };
                let l20 = get('L') == Some(20.0);
                for (i, value) in axes.iter().enumerate().filter_map(|(i, it)| Some((i, (*it)?))) {
                    self.work[system][i] = if l20 { self.planned[i] - self.g92[i] - value } else { value };
                }
                self.modal = modal;
                self.wait = Some(Wait::Sync(Then::Ok));
                return Ok(());
            }
            92 => {
                for (i, value) in axes.iter().enumerate().filter_map(|(i, it)| Some((i, (*it)?))) {
                    self.g92[i] = self.planned[i] - self.work[modal.system][i] - value;
                }
            }
            _ => {}
        }
        self.modal = modal;
        if moves {
            if self.limits(to, true).is_err() {
                return Ok(());
            }
            let laser = self.config.settings[&32] != 0.0;
            let changed = before.0 != self.modal.spindle || before.1 != self.modal.speed;
            if before.0 != self.modal.spindle || changed && !laser && self.modal.spindle != 5 {
                // Not needed by our programs: spindle words with motion outside laser mode act at once here.
                self.output = (self.modal.spindle, self.modal.speed);
            }
            self.output.1 = if laser { self.modal.speed } else { self.output.1 };
            let blocks = self.segments(to, &get)?;
            self.wait = Some(Wait::Room(blocks));
            self.step_parser();
            return Ok(());
        }
        let output = (self.modal.spindle, self.modal.speed);
        if let Some(then) = then {
            if matches!(then, Then::End) {
                self.modal = Modal { system: 0, motion: 1, ..Modal::new() };
            }
            self.wait = Some(Wait::Sync(then));
        } else if output.0 != self.output.0 || output.1 != self.output.1 && output.0 != 5 {
            self.wait = Some(Wait::Sync(Then::Spindle(output.0, output.1)));
        } else {
            self.ok();
        }
        Ok(())
    }

    /// Soft limits: the machine slows down, stops and locks; the line is not answered until the reset.
    fn limits(&mut self, to: P3, moves: bool) -> Result<(), u32> {
        if self.config.settings[&20] == 0.0 || !moves {
            return Ok(());
        }
        let outside = (0..3).any(|i| to[i] > 1e-6 || to[i] < -self.config.settings[&(130 + i as u16)] - 1e-6);
        if outside {
            self.alarm(2, true);
            return Err(0);
        }
        Ok(())
    }

    fn segments(&mut self, to: P3, get: &dyn Fn(char) -> Option<f64>) -> Result<VecDeque<Block>, u32> {
        let motion = self.modal.motion;
        let feed = self.modal.feed;
        let mut out = VecDeque::new();
        if motion >= 2 {
            let from = self.planned;
            let unit = if self.modal.inches { 25.4 } else { 1.0 };
            let (i, j) = (get('I').unwrap_or(0.0) * unit, get('J').unwrap_or(0.0) * unit);
            let c = [from[0] + i, from[1] + j];
            let r = i.hypot(j);
            if r < 1e-9 {
                return Err(35);
            }
            if ((to[0] - c[0]).hypot(to[1] - c[1]) - r).abs() > 0.005_f64.max(0.001 * r) {
                return Err(33);
            }
            let a0 = (from[1] - c[1]).atan2(from[0] - c[0]);
            let a1 = (to[1] - c[1]).atan2(to[0] - c[0]);
            let mut sweep = if motion == 3 { a1 - a0 } else { a0 - a1 };
            if sweep <= 5e-7 {
                sweep += std::f64::consts::TAU;
            }
            let n = ((0.5 * sweep * r) / (0.002 * (2.0 * r - 0.002)).sqrt()).floor().max(1.0) as usize;
            for k in 1..=n {
                let share = k as f64 / n as f64;
                let a = a0 + share * sweep * if motion == 3 { 1.0 } else { -1.0 };
                let z = from[2] + share * (to[2] - from[2]);
                let p = if k == n { to } else { [c[0] + r * a.cos(), c[1] + r * a.sin(), z] };
                out.extend(self.queue(p, false, feed));
            }
        } else {
            out.extend(self.queue(to, motion == 0, feed));
        }
        Ok(out)
    }

    fn faults(&mut self) {
        let t = self.t;
        let due = |at: Option<f64>| at.is_some_and(|at| t >= at);
        if due(self.config.faults.alarm_at) {
            self.config.faults.alarm_at = None;
            self.alarm(1, true);
        }
        if due(self.config.faults.soft_limit_at) {
            self.config.faults.soft_limit_at = None;
            self.alarm(2, true);
        }
        if due(self.config.faults.reset_at) {
            self.config.faults.reset_at = None;
            self.power_up();
        }
    }
}

impl Device for GrblBoard {
    fn open(&mut self) {
        if self.config.reset_on_open {
            self.power_up();
        }
    }

    fn receive(&mut self, byte: u8) {
        if matches!(self.state, St::Booting(_)) || self.config.faults.deaf_at.is_some_and(|it| self.t >= it) {
            return;
        }
        if self.realtime(byte) {
            return;
        }
        self.received += 1;
        let faults = &self.config.faults;
        if faults.drop_byte == Some(self.received) {
            return;
        }
        let byte = match faults.garble_byte {
            Some((at, mask)) if at == self.received => byte ^ mask,
            _ => byte,
        };
        if self.rx.len() < self.config.receive { self.rx.push_back(byte) } else { self.overrun += 1 }
    }

    fn advance(&mut self, to: f64) {
        while self.t < to - 1e-12 {
            self.t += STEP;
            self.faults();
            match self.state {
                St::Booting(until) => {
                    if self.t >= until {
                        self.state = if self.config.settings[&22] != 0.0 { St::Alarm } else { St::Idle };
                        self.say("\r\nGrbl 1.1h ['$' for help]\r\n");
                        if self.state == St::Alarm {
                            self.say("[MSG:'$H'|'$X' to unlock]\r\n");
                        }
                    }
                }
                St::Home(until) => {
                    if self.t >= until {
                        self.pos = [-1.0; 3];
                        self.base = [0.0; 3];
                        self.planned = [-1.0; 3];
                        self.state = St::Idle;
                        self.mark();
                    }
                }
                _ => {
                    self.step_motion();
                    self.step_parser();
                }
            }
            self.sense();
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
        self.config.faults.unplug_at.is_none_or(|it| self.t < it)
    }
}
