//! Turns a program into the lines that go out, one at a time.
use super::{
    plot::Plotter,
    program::{Program, Setting, preamble},
    protocol::Line,
};
use crate::{
    import::gcode::{Interpreter, LineError, bare},
    profile::Dialect,
};

/// What comes next.
#[derive(Debug, Clone, PartialEq)]
pub enum Next {
    /// A line to send.
    Line(Line),
    /// The operator must act before the rest; index and text of the line.
    Pause(usize, String),
}

/// Whoever follows the program.
enum Follower {
    Gcode(Box<Interpreter>),
    Plot(Plotter),
}

/// A program being sent.
pub struct Feed<'a> {
    program: &'a Program,
    follower: Follower,
    index: usize,
    ahead: std::collections::VecDeque<Line>,
    ended: bool,
    /// The line before which a plot waits for its pen: lifted first, then asked for.
    lifted: Option<usize>,
    asked: Option<usize>,
}

impl<'a> Feed<'a> {
    /// From the beginning.
    pub fn new(program: &'a Program, setting: &Setting) -> Self {
        let follower = match program.plot {
            None => Follower::Gcode(Box::new(Interpreter::new(setting.state.clone(), setting.sense))),
            Some(feed) => Follower::Plot(Plotter::new(feed, setting.limits.rate[0])),
        };
        Self {
            program,
            follower,
            index: 0,
            ahead: std::collections::VecDeque::new(),
            ended: false,
            lifted: None,
            asked: None,
        }
    }

    /// From the approach of a contour: the modes are restored and the head is brought to where the contour before it
    /// ended, with the tool off.
    pub fn from_contour(
        program: &'a Program,
        setting: &Setting,
        contour: usize,
        decimals: usize,
        dialect: Dialect,
    ) -> Result<Self, LineError> {
        let mut it = Self::new(program, setting);
        let approach = program.contours.get(contour).map_or(program.len(), |it| it.approach);
        let mut passed = Vec::new();
        while it.index < approach {
            match &mut it.follower {
                Follower::Gcode(interpreter) => {
                    let plain = bare(program.line(it.index));
                    if !plain.is_empty() {
                        interpreter.line(&plain)?;
                    }
                }
                Follower::Plot(plotter) => {
                    let command = program.line(it.index);
                    plotter.line(command)?;
                    // Everything but movements: pen, speed, force.
                    if !command.starts_with('P') {
                        passed.push(command.to_owned());
                    }
                }
            }
            it.index += 1;
        }
        let Follower::Gcode(interpreter) = &it.follower else {
            let lines = passed.into_iter().chain(["PA;".to_owned(), "PU;".to_owned()]);
            it.ahead.extend(lines.map(|text| Line { text, ..Line::default() }));
            return Ok(it);
        };
        let lines = preamble(&interpreter.state, setting.sense, decimals, dialect);
        // Followed from the machine's real position, so that the way there is known as well.
        let mut follow = Interpreter::new(setting.state.clone(), setting.sense);
        for text in lines {
            let step = follow.line(&text)?;
            let patience = step.dwell + 1.0;
            it.ahead.push_back(Line { text, moves: step.moves, waits: step.waits, patience, ..Line::default() });
        }
        Ok(it)
    }

    /// The next line or pause; `None` at the end.
    pub fn take(&mut self) -> Result<Option<Next>, LineError> {
        if let Some(line) = self.ahead.pop_front() {
            return Ok(Some(Next::Line(line)));
        }
        while self.index < self.program.len() && !self.ended {
            let index = self.index;
            self.index += 1;
            let seconds = self.program.seconds.get(index).map_or(0.0, |&it| it.into());
            let interpreter = match &mut self.follower {
                Follower::Gcode(it) => it,
                Follower::Plot(plotter) => {
                    let text = self.program.line(index).to_owned();
                    if self.asked != Some(index) && self.program.pauses.binary_search(&index).is_ok() {
                        self.index = index;
                        if self.lifted == Some(index) {
                            self.asked = Some(index);
                            return Ok(Some(Next::Pause(index, text)));
                        }
                        self.lifted = Some(index);
                        plotter.line("PU;")?;
                        return Ok(Some(Next::Line(Line { text: "PU;".into(), ..Line::default() })));
                    }
                    let moves = plotter.line(&text)?.into_iter().collect();
                    return Ok(Some(Next::Line(Line { index: Some(index), seconds, text, moves, ..Line::default() })));
                }
            };
            let plain = bare(self.program.line(index));
            if plain.is_empty() {
                continue;
            }
            let step = interpreter.line(&plain)?;
            self.ended = step.end;
            if step.pause {
                return Ok(Some(Next::Pause(index, plain)));
            }
            return Ok(Some(Next::Line(Line {
                index: Some(index),
                seconds,
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
