//! The person at the machine, and a program sent under that person's eyes in simulated time.
use std::{cell::RefCell, collections::VecDeque, rc::Rc};

use fabricate::machine::{
    protocol::{Event, Protocol},
    session::{Operator, SendError, Session, Wish},
};

use super::{Device, SimWire};

/// An operator that acts when the board has come to a time.
pub(crate) struct Hand<D: Device> {
    board: Rc<RefCell<D>>,
    pub(crate) wishes: VecDeque<(f64, Wish)>,
    pub(crate) events: Vec<Event>,
    pub(crate) pauses: Vec<String>,
    pub(crate) panic_at: Option<f64>,
    /// Answers pauses by itself.
    pub(crate) goes_on: bool,
    go: bool,
}

impl<D: Device> Hand<D> {
    pub(crate) fn new(board: &Rc<RefCell<D>>) -> Self {
        let (wishes, events, pauses) = (VecDeque::new(), Vec::new(), Vec::new());
        Self { board: board.clone(), wishes, events, pauses, panic_at: None, goes_on: true, go: false }
    }
}

impl<D: Device> Operator for Hand<D> {
    fn wish(&mut self) -> Option<Wish> {
        let now = self.board.borrow().now();
        if self.panic_at.is_some_and(|it| now >= it) {
            self.panic_at = None;
            panic!("a bug in the program");
        }
        if std::mem::take(&mut self.go) {
            return Some(Wish::Go);
        }
        let due = self.wishes.front().is_some_and(|it| now >= it.0);
        due.then(|| self.wishes.pop_front().unwrap().1)
    }

    fn event(&mut self, event: &Event) {
        self.events.push(event.clone());
    }

    fn progress(&mut self, _: f64) {}

    fn paused(&mut self, why: &str) {
        self.pauses.push(why.to_owned());
        self.go = self.goes_on;
    }
}

/// What came of a job.
pub(crate) struct Outcome {
    pub(crate) result: Result<(), SendError>,
    pub(crate) events: Vec<Event>,
    pub(crate) pauses: Vec<String>,
    pub(crate) told: Vec<String>,
    pub(crate) log: String,
}

/// Opens the port of a board and does a job over it.
pub(crate) fn drive<D: Device, P: Protocol>(
    board: &Rc<RefCell<D>>,
    mut hand: Hand<D>,
    protocol: P,
    job: impl FnOnce(&mut Session<'_, SimWire<D>, P>, &mut dyn FnMut(&str)) -> Result<(), SendError>,
) -> Outcome {
    let mut log = Vec::new();
    let mut told = Vec::new();
    let result = {
        let mut session = Session::new(SimWire::new(board), protocol, &mut hand, Some(Box::new(&mut log)));
        job(&mut session, &mut |text| told.push(text.to_owned()))
    };
    let log = String::from_utf8(log).unwrap();
    Outcome { result, events: hand.events, pauses: hand.pauses, told, log }
}
