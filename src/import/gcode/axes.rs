//! Programs of many axes read back: straight blocks of X, Y, Z, A, B, C, U and V with their times. What such a program of
//! ours does not hold is refused with its line.
use super::{
    bare,
    words::{Word, code, words},
};
use crate::import::DrawingError;

/// Letters of the axes in the order of [`Block::at`].
pub const AXES: [char; 8] = ['X', 'Y', 'Z', 'A', 'B', 'C', 'U', 'V'];

/// A straight block.
#[derive(Debug, Clone, PartialEq)]
pub struct Block {
    /// Line of the program, from 1.
    pub line: usize,
    /// Whether it is a rapid.
    pub rapid: bool,
    /// Where it ends, mm and degrees; `None` where no word has named the axis yet.
    pub at: [Option<f64>; 8],
    /// Time of a feed block under G93, s.
    pub seconds: Option<f64>,
    /// Whether the controller keeps the tip on its way.
    pub tip: bool,
}

/// A program as it was read.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct AxisProgram {
    /// Its blocks.
    pub blocks: Vec<Block>,
    /// Whether it ends with M2 or M30, the spindle off and feeds per minute in force.
    pub ends_well: bool,
}

/// What a controller remembers.
struct Modal {
    rapid: Option<bool>,
    inverse: bool,
    tip: bool,
    spindle: bool,
    at: [Option<f64>; 8],
}

/// Reads a program; `tip` are the lines that start and end the control of the tip.
pub fn read_axes(text: &str, tip: Option<[&str; 2]>) -> Result<AxisProgram, DrawingError> {
    let mut state = Modal { rapid: None, inverse: false, tip: false, spindle: false, at: [None; 8] };
    let mut out = AxisProgram::default();
    let tip = tip.map(|it| it.map(bare));
    for (i, text) in text.lines().enumerate() {
        let fault = |message: String| DrawingError::Program { line: i + 1, message, text: text.into() };
        let plain = bare(text);
        if let Some([on, off]) = &tip
            && (plain == *on || plain == *off)
        {
            state.tip = plain == *on;
            continue;
        }
        let words = words(&plain).map_err(|it| fault(it.to_string()))?;
        let (block, ended) = state.line(&words).map_err(fault)?;
        out.blocks.extend(block.map(|it| Block { line: i + 1, ..it }));
        if ended {
            out.ends_well = !state.spindle && !state.inverse && !state.tip;
            break;
        }
    }
    Ok(out)
}

impl Modal {
    /// The block of a line, and whether the program ends with it.
    fn line(&mut self, words: &[Word]) -> Result<(Option<Block>, bool), String> {
        let (mut feed, mut moves, mut ended, mut machine) = (None, false, false, false);
        for word in words {
            match (word.letter, code(word)) {
                (b'G', 0) => self.rapid = Some(true),
                (b'G', 10) => self.rapid = Some(false),
                (b'G', 930) => self.inverse = true,
                (b'G', 940) => self.inverse = false,
                (b'G', 530) => machine = true,
                // Planes, millimetres, no compensation, lengths, work offset, exact path, absolute.
                (b'G', 170 | 210 | 400 | 430 | 490 | 540 | 610 | 900) | (b'M', 60) | (b'T' | b'S', _) => {}
                (b'M', 30) => self.spindle = true,
                (b'M', 50) => self.spindle = false,
                (b'M', 20 | 300) => ended = true,
                (b'F', _) => feed = Some(word.value),
                (letter, _) => {
                    let known = AXES.iter().position(|it| *it == char::from(letter));
                    let k =
                        known.ok_or_else(|| format!("the word {}{} is not known", char::from(letter), word.value))?;
                    self.at[k] = Some(word.value);
                    moves = true;
                }
            }
        }
        if machine {
            // A park position is known only to the machine.
            self.at[2] = None;
            return Ok((None, ended));
        }
        if !moves {
            return Ok((None, ended));
        }
        let rapid = self.rapid.ok_or("an axis word before any G0 or G1")?;
        let seconds = match (rapid, self.inverse, feed) {
            (true, ..) => None,
            (false, true, Some(feed)) if feed > 0.0 => Some(60.0 / feed),
            (false, true, _) => return Err("a G1 under G93 without its F".into()),
            (false, false, _) => return Err("a G1 that is not under G93".into()),
        };
        let block = Block { line: 0, rapid, at: self.at, seconds, tip: self.tip };
        Ok((Some(block), ended))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_have_their_times_and_what_lacks_one_is_refused() {
        let text = "(x)\nG21 G90 G94\nM3 S100\nG0 X1 Y2 Z3 A0 C0\nM428\nG93\nG1 X2 A90 F30\nG94 F600\nM429\nM5\nM2\n";
        let read = read_axes(text, Some(["M428", "M429"])).unwrap();
        assert!(read.ends_well);
        let [first, second] = &read.blocks[..] else { panic!("{read:?}") };
        assert_eq!((first.rapid, first.tip, first.line), (true, false, 4));
        assert_eq!((second.seconds, second.tip, second.at[3], second.at[1]), (Some(2.0), true, Some(90.0), Some(2.0)));
        for (from, to, line, message) in [
            ("A90 F30", "A90", 7, "without its F"),
            ("A90 F30", "Q3 F30", 7, "the word Q3 is not known"),
            ("G93\n", "\n", 7, "not under G93"),
            ("M428", "M427", 5, "the word M427 is not known"),
        ] {
            let error = read_axes(&text.replace(from, to), Some(["M428", "M429"])).unwrap_err().to_string();
            assert!(error.contains(message) && error.contains(&format!("line {line}")), "{error}");
        }
        assert!(!read_axes(&text.replace("M5\n", ""), Some(["M428", "M429"])).unwrap().ends_well);
        assert!(!read_axes(&text.replace("G94 F600\n", ""), Some(["M428", "M429"])).unwrap().ends_well);
    }
}
