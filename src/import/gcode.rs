//! A reader of G-code that carries out the program as a GRBL-type board would, up to arcs and canned cycles.
use super::drawing::DrawingError;
use crate::geom::{Box3, Vec2, Vec3};

/// Whether the spindle word is in force, and which.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Spindle {
    /// M5.
    #[default]
    Off,
    /// M3.
    On,
    /// M4: for a laser, power follows the speed.
    Dynamic,
}

/// One movement, or a change of power or spindle in place (`from == to`).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Move {
    /// Line of the file, from 1.
    pub line: usize,
    /// Start, mm.
    pub from: Vec3,
    /// End, mm.
    pub to: Vec3,
    /// G0.
    pub rapid: bool,
    /// mm/min; 0 where none was set yet.
    pub feed: f64,
    /// S word in force.
    pub power: f64,
    /// M word in force.
    pub spindle: Spindle,
}

/// A program as it was carried out.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Program {
    /// Every movement in order.
    pub moves: Vec<Move>,
    /// Stops that wait for a person (M0, M1).
    pub pauses: usize,
    /// Sum of the dwells, s.
    pub dwell: f64,
    /// Whether M2 or M30 was reached; nothing after it counts.
    pub ended: bool,
    /// Spindle at the end.
    pub spindle: Spindle,
    /// Longest line, characters.
    pub longest_line: usize,
}

impl Program {
    /// The paths of the tool while `working` holds, in work coordinates, each without repeated points.
    pub fn strokes(&self, working: impl Fn(&Move) -> bool) -> Vec<Vec<Vec2>> {
        let mut strokes: Vec<Vec<Vec2>> = Vec::new();
        let mut down = false;
        for step in &self.moves {
            if working(step) {
                if !down {
                    strokes.push(vec![step.from.xy()]);
                }
                let stroke = strokes.last_mut().expect("pushed when the tool went down");
                if stroke.last() != Some(&step.to.xy()) {
                    stroke.push(step.to.xy());
                }
            }
            down = working(step);
        }
        strokes.retain(|it| it.len() > 1);
        strokes
    }

    /// Box around every place that the tool goes to, in work coordinates.
    pub fn extents(&self) -> Box3 {
        Box3::of(self.moves.iter().map(|it| &it.to))
    }
}

/// Modal state.
struct Board {
    position: Vec3,
    rapid: bool,
    /// A motion word has been given.
    moving: bool,
    feed: f64,
    power: f64,
    spindle: Spindle,
    relative: bool,
    scale: f64,
}

/// Reads a program. Words that the reader does not carry out are refused with their line, never skipped.
pub fn read_gcode(text: &str) -> Result<Program, DrawingError> {
    let mut board = Board {
        position: Vec3::zeros(),
        rapid: true,
        moving: false,
        feed: 0.0,
        power: 0.0,
        spindle: Spindle::Off,
        relative: false,
        scale: 1.0,
    };
    let mut program = Program::default();
    for (index, text) in text.lines().enumerate() {
        program.longest_line = program.longest_line.max(text.chars().count());
        let fault = |message| DrawingError::Program { line: index + 1, message, text: text.into() };
        let words = words(text).map_err(fault)?;
        block(&words, index + 1, &mut board, &mut program).map_err(fault)?;
        if program.ended {
            break;
        }
    }
    program.spindle = board.spindle;
    Ok(program)
}

/// The words of a line without comments: letter and number.
fn words(line: &str) -> Result<Vec<(char, f64)>, &'static str> {
    let mut plain = String::new();
    let mut depth = 0_usize;
    for c in line.chars() {
        match c {
            '(' => depth += 1,
            ')' => depth = depth.checked_sub(1).ok_or("a `)` without its `(`")?,
            ';' | '%' if depth == 0 => break,
            _ if depth == 0 && !c.is_whitespace() => plain.push(c.to_ascii_uppercase()),
            _ => {}
        }
    }
    let mut words = Vec::new();
    let mut rest = plain.as_str();
    while let Some(letter) = rest.chars().next() {
        if !letter.is_ascii_uppercase() {
            return Err("expected a letter");
        }
        let number = &rest[1..];
        let end = number.find(|c: char| c.is_ascii_alphabetic()).unwrap_or(number.len());
        words.push((letter, number[..end].parse().map_err(|_| "a letter without its number")?));
        rest = &number[end..];
    }
    Ok(words)
}

/// One line: modal words first, then the dwell or the motion, then the stops.
fn block(words: &[(char, f64)], line: usize, board: &mut Board, program: &mut Program) -> Result<(), &'static str> {
    let (mut axes, mut dwell, mut p) = ([None; 3], false, None);
    let before = (board.power, board.spindle);
    let mut stop = false;
    for &(letter, value) in words {
        match (letter, value) {
            ('G', 0.0) => (board.rapid, board.moving) = (true, true),
            ('G', 1.0) => (board.rapid, board.moving) = (false, true),
            ('G', 4.0) => dwell = true,
            ('G', 20.0) => board.scale = 25.4,
            ('G', 21.0) => board.scale = 1.0,
            ('G', 90.0) => board.relative = false,
            ('G', 91.0) => board.relative = true,
            ('G', 17.0 | 40.0 | 49.0 | 54.0 | 80.0 | 94.0) | ('N' | 'T', _) => {}
            ('M', 3.0) => board.spindle = Spindle::On,
            ('M', 4.0) => board.spindle = Spindle::Dynamic,
            ('M', 5.0) => board.spindle = Spindle::Off,
            ('M', 0.0 | 1.0) => program.pauses += 1,
            ('M', 2.0 | 30.0) => stop = true,
            ('M', 7.0..=9.0) => {}
            ('F', _) => board.feed = value * board.scale,
            ('S', _) => board.power = value,
            ('X', _) => axes[0] = Some(value),
            ('Y', _) => axes[1] = Some(value),
            ('Z', _) => axes[2] = Some(value),
            ('P', _) => p = Some(value),
            ('G', 2.0 | 3.0) => return Err("arcs are not read yet"),
            _ => return Err("a word that is not known"),
        }
    }
    if dwell {
        program.dwell += p.ok_or("G4 needs P, in seconds")?;
    }
    let from = board.position;
    let moved = axes.iter().any(Option::is_some);
    if moved && !board.moving {
        return Err("coordinates before any G0 or G1");
    }
    for (axis, value) in axes.into_iter().enumerate().filter_map(|(axis, value)| Some((axis, value?))) {
        let base = if board.relative { from[axis] } else { 0.0 };
        board.position[axis] = base + value * board.scale;
    }
    let Board { position: to, rapid, feed, power, spindle, .. } = *board;
    if moved && !rapid && feed <= 0.0 {
        return Err("G1 without a feed rate");
    }
    if moved || before != (power, spindle) {
        program.moves.push(Move { line, from, to, rapid, feed, power, spindle });
    }
    if stop {
        program.ended = true;
        board.spindle = Spindle::Off;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn modal_state_is_kept() {
        let text = "G21 G90\n(a) G0 X1 Y2 ; go\nM4 S0\nG1 X3 S500 F1000\nY4\nG91 G0 X-1\nG4 P0.25\nM0\nM2\nnot read";
        let program = read_gcode(text).unwrap();
        // The rapid, M4 in place, two cuts, the rapid back.
        assert_eq!(program.moves.len(), 5);
        let last_cut = program.moves[3];
        assert_eq!((last_cut.from, last_cut.to), (Vec3::new(3.0, 2.0, 0.0), Vec3::new(3.0, 4.0, 0.0)));
        assert_eq!((last_cut.power, last_cut.feed, last_cut.spindle), (500.0, 1000.0, Spindle::Dynamic));
        assert_eq!(program.moves[4].to, Vec3::new(2.0, 4.0, 0.0));
        assert!(program.moves[4].rapid && program.ended);
        let strokes = program.strokes(|it| !it.rapid && it.power > 0.0);
        assert_eq!(strokes, vec![vec![Vec2::new(1.0, 2.0), Vec2::new(3.0, 2.0), Vec2::new(3.0, 4.0)]]);
        assert_eq!((program.dwell, program.pauses, program.spindle), (0.25, 1, Spindle::Off));
    }

    #[test]
    fn what_is_not_understood_is_refused_with_its_line() {
        for (text, line, message) in [
            ("G0 X1\nG2 X1 Y1 I1", 2, "arcs are not read yet"),
            ("X1", 1, "coordinates before any G0 or G1"),
            ("G1 X1", 1, "G1 without a feed rate"),
            ("G0 X", 1, "a letter without its number"),
            ("G0 X1.2.3", 1, "a letter without its number"),
            ("\n\nG38.2 Z-1", 3, "a word that is not known"),
            ("hello", 1, "a letter without its number"),
            ("G4", 1, "G4 needs P, in seconds"),
        ] {
            match read_gcode(text) {
                Err(DrawingError::Program { line: at, message: said, .. }) => {
                    assert_eq!((at, said), (line, message), "{text}");
                }
                other => panic!("{text}: {other:?}"),
            }
        }
    }
}
