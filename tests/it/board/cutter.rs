//! An HPGL cutter: a small buffer, commands carried out one after another, three kinds of flow control.
use std::collections::VecDeque;

use fabricate::profile::Flow;

use super::{Device, STEP};

pub(crate) struct Cutter {
    flow: Flow,
    size: usize,
    /// How much slower than its nominal 25 mm/s (down) and 100 mm/s (up) it is.
    slower: f64,
    t: f64,
    buffer: VecDeque<u8>,
    escape: Option<Vec<u8>>,
    xoff: bool,
    /// Where the present movement ends, and when.
    going: Option<([f64; 2], f64)>,
    at: [f64; 2],
    ready: Vec<u8>,
    deaf_at: Option<f64>,
    pub(crate) unplug_at: Option<f64>,
    // Books.
    pub(crate) overrun: usize,
    pub(crate) down: bool,
    pub(crate) strokes: Vec<Vec<[f64; 2]>>,
    pub(crate) switched: Vec<f64>,
    pub(crate) fullest: usize,
}

impl Cutter {
    pub(crate) fn new(flow: Flow, size: usize) -> Self {
        Self {
            flow,
            size,
            slower: 1.0,
            t: 0.0,
            buffer: VecDeque::new(),
            escape: None,
            xoff: false,
            going: None,
            at: [0.0; 2],
            ready: Vec::new(),
            deaf_at: None,
            unplug_at: None,
            overrun: 0,
            down: false,
            strokes: Vec::new(),
            switched: Vec::new(),
            fullest: 0,
        }
    }

    pub(crate) fn slower(mut self, times: f64) -> Self {
        self.slower = times;
        self
    }

    /// Neither answers nor hears from then on.
    pub(crate) fn deaf_from(mut self, at: f64) -> Self {
        self.deaf_at = Some(at);
        self
    }

    pub(crate) fn busy(&self) -> bool {
        self.going.is_some() || self.buffer.contains(&b';')
    }

    fn deaf(&self) -> bool {
        self.deaf_at.is_some_and(|it| self.t >= it)
    }

    fn command(&mut self, text: &str) {
        let Some((name, rest)) = text.split_at_checked(2) else { return };
        let to = rest.split_once(',').map(|(x, y)| [x, y].map(|it| it.trim().parse::<f64>().unwrap() / 40.0));
        let down = match name {
            "PD" => true,
            "PU" | "SP" | "IN" => false,
            _ => self.down,
        };
        if down != self.down {
            self.down = down;
            self.switched.push(self.t);
            if down {
                self.strokes.push(vec![self.at]);
            }
        }
        if let Some(to) = to.filter(|_| matches!(name, "PU" | "PD" | "PA")) {
            let way = (to[0] - self.at[0]).hypot(to[1] - self.at[1]);
            let speed = if self.down { 25.0 } else { 100.0 };
            self.going = Some((to, self.t + self.slower * way / speed));
        }
    }

    fn step(&mut self) {
        if let Some((to, until)) = self.going {
            if self.t < until {
                return;
            }
            self.going = None;
            self.at = to;
            if self.down {
                self.strokes.last_mut().unwrap().push(to);
            }
        }
        while self.buffer.front().is_some_and(u8::is_ascii_whitespace) {
            self.buffer.pop_front();
        }
        if let Some(end) = self.buffer.iter().position(|it| *it == b';') {
            let bytes: Vec<u8> = self.buffer.drain(..=end).filter(|it| !it.is_ascii_whitespace()).collect();
            let text = String::from_utf8_lossy(&bytes[..bytes.len() - 1]).into_owned();
            self.command(&text);
        }
        if self.flow == Flow::XonXoff && self.xoff && self.buffer.len() < self.size / 4 {
            self.xoff = false;
            self.ready.push(0x11);
        }
    }
}

impl Device for Cutter {
    fn open(&mut self) {}

    fn receive(&mut self, byte: u8) {
        if self.deaf() {
            return;
        }
        if let Some(escape) = &mut self.escape {
            escape.push(byte);
            match escape.as_slice() {
                b"." => {}
                b".B" => {
                    self.escape = None;
                    let text = format!("{}\r", self.size - self.buffer.len());
                    self.ready.extend(text.bytes());
                }
                b".K" => {
                    self.escape = None;
                    self.buffer.clear();
                }
                _ => self.escape = None,
            }
            return;
        }
        if byte == 0x1b {
            self.escape = Some(Vec::new());
            return;
        }
        if self.buffer.len() >= self.size {
            self.overrun += 1;
            return;
        }
        self.buffer.push_back(byte);
        self.fullest = self.fullest.max(self.buffer.len());
        if self.flow == Flow::XonXoff && !self.xoff && self.buffer.len() > self.size * 3 / 4 {
            self.xoff = true;
            self.ready.push(0x13);
        }
    }

    fn advance(&mut self, to: f64) {
        while self.t < to - 1e-12 {
            self.t += STEP;
            self.step();
        }
    }

    fn now(&self) -> f64 {
        self.t
    }

    fn output(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.ready)
    }

    fn plugged(&self) -> bool {
        self.unplug_at.is_none_or(|it| self.t < it)
    }

    fn holds(&self) -> bool {
        self.flow == Flow::RtsCts && self.buffer.len() > self.size * 3 / 4
    }
}
