//! Boards to test the sender against: they follow the rules measured on real firmware, in a time of their own, with
//! faults that can be switched on. [`SimWire`] joins a board and a sender in one simulated time; [`pty::PtyBoard`] puts
//! it behind a pseudo-terminal.
#![allow(clippy::unwrap_used, reason = "a test that panics is a test that fails")]
pub(crate) mod cutter;
pub(crate) mod grbl;
pub(crate) mod hand;
pub(crate) mod marlin;
pub(crate) mod pty;

use std::{cell::RefCell, rc::Rc};

use fabricate::machine::link::Wire;

/// A machine at the other end of a wire.
pub(crate) trait Device {
    /// The port was opened.
    fn open(&mut self);
    /// A byte comes in, now.
    fn receive(&mut self, byte: u8);
    /// Time passes.
    fn advance(&mut self, to: f64);
    /// The time.
    fn now(&self) -> f64;
    /// Bytes that have gone out by now.
    fn output(&mut self) -> Vec<u8>;
    /// Whether the plug is in.
    fn plugged(&self) -> bool;
    /// Whether it holds its CTS line down: no byte leaves for it.
    fn holds(&self) -> bool {
        false
    }
}

/// Bytes per second at 115200 baud.
pub(crate) const BYTE_RATE: f64 = 11520.0;

/// One step of simulated time, s.
pub(crate) const STEP: f64 = 0.0005;

/// What a board says: byte by byte, at the pace of the wire.
#[derive(Default)]
pub(crate) struct Voice {
    /// Bytes with the time they arrive at the other end.
    way: std::collections::VecDeque<(f64, u8)>,
    free: f64,
    ready: Vec<u8>,
}

impl Voice {
    /// Begins to say something at a time; every byte arrives `latency` seconds after it was sent.
    pub(crate) fn say(&mut self, now: f64, text: &str, latency: f64) {
        for byte in text.bytes() {
            self.free = self.free.max(now) + 1.0 / BYTE_RATE;
            self.way.push_back((self.free + latency, byte));
        }
    }

    /// What was on its way is lost.
    pub(crate) fn silence(&mut self) {
        self.way.clear();
    }

    pub(crate) fn advance(&mut self, now: f64) {
        let due = self.way.partition_point(|it| it.0 <= now);
        self.ready.extend(self.way.drain(..due).map(|it| it.1));
    }

    pub(crate) fn output(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.ready)
    }
}

/// A wire in simulated time. The sender's clock is the board's.
pub(crate) struct SimWire<D: Device> {
    pub(crate) board: Rc<RefCell<D>>,
    /// Bytes on their way to the board, with the time they arrive.
    way: std::collections::VecDeque<(f64, u8)>,
    free: f64,
}

impl<D: Device> SimWire<D> {
    pub(crate) fn new(board: &Rc<RefCell<D>>) -> Self {
        board.borrow_mut().open();
        Self { board: board.clone(), way: Default::default(), free: 0.0 }
    }

    fn step(&mut self) {
        let mut board = self.board.borrow_mut();
        let to = board.now() + STEP;
        if board.holds() {
            self.way.iter_mut().for_each(|it| it.0 += STEP);
            self.free = self.free.max(to) + STEP;
        }
        while self.way.front().is_some_and(|it| it.0 <= to) {
            let (_, byte) = self.way.pop_front().unwrap();
            board.receive(byte);
        }
        board.advance(to);
    }
}

impl<D: Device> Wire for SimWire<D> {
    fn now(&self) -> f64 {
        self.board.borrow().now()
    }

    fn read(&mut self, seconds: f64) -> Result<Vec<u8>, String> {
        let until = self.now() + seconds;
        loop {
            self.step();
            let mut board = self.board.borrow_mut();
            if !board.plugged() {
                return Err("Broken pipe".into());
            }
            let out = board.output();
            if !out.is_empty() {
                return Ok(out);
            }
            if board.now() >= until {
                return Ok(Vec::new());
            }
        }
    }

    fn write(&mut self, bytes: &[u8]) -> Result<usize, String> {
        if !self.board.borrow().plugged() {
            return Err("Broken pipe".into());
        }
        // The system's own buffer.
        if self.board.borrow().holds() && self.way.len() > 4096 {
            return Ok(0);
        }
        for &byte in bytes {
            self.free = self.free.max(self.now()) + 1.0 / BYTE_RATE;
            self.way.push_back((self.free, byte));
        }
        Ok(bytes.len())
    }

    fn discard(&mut self) {
        self.way.clear();
        self.free = self.now();
    }

    fn waiting(&mut self) -> usize {
        self.way.len()
    }
}

/// Numbers by chance, from a seed (xorshift64*, Vigna 2016).
pub(crate) struct Dice(u64);

impl Dice {
    pub(crate) fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1)
    }

    pub(crate) fn next(&mut self) -> u64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        self.0.wrapping_mul(0x2545_F491_4F6C_DD1D)
    }

    /// In [0, 1).
    pub(crate) fn share(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub(crate) fn below(&mut self, n: usize) -> usize {
        (self.next() % n as u64) as usize
    }
}
