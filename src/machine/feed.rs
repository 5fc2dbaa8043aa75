//! Turns a program into the lines that go out, one at a time.
use super::{
    program::{Program, Setting, preamble},
    protocol::Line,
};
use crate::import::gcode::{Interpreter, LineError, State, bare};

/// What comes next.
#[derive(Debug, Clone, PartialEq)]
pub enum Next {
    /// A line to send.
    Line(Line),
    /// The operator must act before the rest; index and text of the line.
    Pause(usize, String),
}

/// A program being sent.
pub struct Feed<'a> {
    program: &'a Program,
    interpreter: Interpreter,
    index: usize,
    ahead: std::collections::VecDeque<Line>,
    ended: bool,
}

impl<'a> Feed<'a> {
    /// From the beginning.
    pub fn new(program: &'a Program, setting: &Setting) -> Self {
        let interpreter = Interpreter::new(setting.state.clone(), setting.sense);
        Self { program, interpreter, index: 0, ahead: std::collections::VecDeque::new(), ended: false }
    }

    /// From the approach of a contour: the modes are restored and the head is brought to where the contour before it
    /// ended, with the tool off.
    pub fn from_contour(
        program: &'a Program,
        setting: &Setting,
        contour: usize,
        decimals: usize,
    ) -> Result<Self, LineError> {
        let mut it = Self::new(program, setting);
        let approach = program.contours.get(contour).map_or(program.len(), |it| it.approach);
        while it.index < approach {
            let plain = bare(program.line(it.index));
            if !plain.is_empty() {
                it.interpreter.line(&plain)?;
            }
            it.index += 1;
        }
        let lines = preamble(&it.interpreter.state, setting.sense, decimals);
        // Followed from the machine's real position, so that the way there is known as well.
        let mut follow = Interpreter::new(setting.state.clone(), setting.sense);
        for text in lines {
            let step = follow.line(&text)?;
            let patience = step.dwell + 1.0;
            it.ahead.push_back(Line { text, moves: step.moves, waits: step.waits, patience, ..Line::default() });
        }
        Ok(it)
    }

    /// State of the program after the last line taken.
    pub fn state(&self) -> &State {
        &self.interpreter.state
    }

    /// The next line or pause; `None` at the end.
    pub fn take(&mut self) -> Result<Option<Next>, LineError> {
        if let Some(line) = self.ahead.pop_front() {
            return Ok(Some(Next::Line(line)));
        }
        while self.index < self.program.len() && !self.ended {
            let index = self.index;
            self.index += 1;
            let plain = bare(self.program.line(index));
            if plain.is_empty() {
                continue;
            }
            let step = self.interpreter.line(&plain)?;
            self.ended = step.end;
            if step.pause {
                return Ok(Some(Next::Pause(index, plain)));
            }
            return Ok(Some(Next::Line(Line {
                index: Some(index),
                seconds: self.program.seconds.get(index).map_or(0.0, |&it| it.into()),
                patience: step.dwell,
                waits: step.waits,
                alone: step.alone,
                opaque: step.opaque,
                tolerant: false,
                moves: step.moves,
                text: plain,
            })));
        }
        Ok(None)
    }
}
