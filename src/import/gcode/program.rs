//! A whole program carried out from the work zero: for files that are read back.
use super::{
    Interpreter, Offsets, Sense, Spindle, State, bare,
    path::{Move, Point},
};
use crate::{
    geom::{Box3, Vec2, Vec3},
    import::DrawingError,
};

/// Movements with the tool at work, without a rest between them; each has a length in x and y.
pub type Stroke = Vec<Move>;

/// A program as it was carried out.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Program {
    /// Every movement in order, with its line from 1.
    pub moves: Vec<(usize, Move)>,
    /// Moves before which the tool came to rest in place, by index.
    breaks: Vec<usize>,
    /// Stops that wait for a person (M0, M1, M6).
    pub pauses: usize,
    /// Sum of the dwells, s.
    pub dwell: f64,
    /// Whether M2 or M30 was reached; nothing after it counts.
    pub ended: bool,
    /// Spindle before the end word: a board switches it off then, but a program must not need that.
    pub spindle: Spindle,
    /// The first line on which the head travels at rapid speed with the tool at work, or with a beam that only laser mode
    /// keeps dark.
    pub rapid_at_work: Option<usize>,
    /// Longest line, characters.
    pub longest_line: usize,
}

/// Reads a program. Words that are not carried out are refused with their line, never skipped.
pub fn read_gcode(text: &str, sense: Sense) -> Result<Program, DrawingError> {
    let mut interpreter = Interpreter::new(State::new([0.0; 3], Offsets::default()), sense);
    let mut program = Program::default();
    for (index, text) in text.lines().enumerate() {
        let line = index + 1;
        program.longest_line = program.longest_line.max(text.chars().count());
        let fault = |message: String| DrawingError::Program { line, message, text: text.into() };
        let spindle = interpreter.state.spindle;
        let step = interpreter.line(&bare(text)).map_err(|it| fault(it.to_string()))?;
        if let Some(word) = step.unknown {
            return Err(fault(format!("the word {word} is not known")));
        }
        if let Some(it) = step.moves.iter().find(|it| !it.rapid && it.feed <= 0.0 && it.length() > 0.0) {
            return Err(fault(format!("a feed move of {:.3} mm before any F", it.length())));
        }
        if step.moves.is_empty() && !interpreter.at_work() {
            program.breaks.push(program.moves.len());
        }
        let state = &interpreter.state;
        let lit = sense == Sense::Beam && state.spindle != Spindle::Off && state.speed > 0.0;
        if step.moves.iter().any(|it| it.rapid && (it.working || lit) && xy(it.from) != xy(it.to)) {
            program.rapid_at_work.get_or_insert(line);
        }
        program.moves.extend(step.moves.into_iter().map(|it| (line, it)));
        program.pauses += usize::from(step.pause);
        program.dwell += step.dwell;
        program.spindle = if step.end { spindle } else { interpreter.state.spindle };
        if step.end {
            program.ended = true;
            break;
        }
    }
    Ok(program)
}

impl Sense {
    /// A guess for a program of unknown origin, by what it does to the tool: feed moves that go down are a Z axis, S words
    /// that change between the moves of a running spindle are a servo, anything else is a beam.
    pub fn guess(text: &str) -> Self {
        let mut interpreter = Interpreter::new(State::new([0.0; 3], Offsets::default()), Self::Beam);
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        let mut speeds: Vec<f64> = Vec::new();
        for line in text.lines() {
            // What cannot be read is said by whoever reads the program for good.
            let Ok(step) = interpreter.line(&bare(line)) else { continue };
            for it in &step.moves {
                low = low.min(it.to[2]);
                high = high.max(it.to[2]);
            }
            let state = &interpreter.state;
            if step.moves.is_empty() && state.spindle == Spindle::On && state.speed > 0.0 && speeds.len() < 1000 {
                speeds.push(state.speed);
            }
        }
        if high - low > 1e-6 {
            return Self::Height { clear: (low + high) / 2.0 };
        }
        match speeds.as_slice() {
            [up, rest @ ..] => {
                let down = rest.iter().copied().fold(*up, |a, b| if (b - up).abs() > (a - up).abs() { b } else { a });
                if down == *up { Self::Beam } else { Self::Servo { up: *up, down } }
            }
            [] => Self::Beam,
        }
    }
}

fn xy(p: Point) -> Vec2 {
    Vec2::new(p[0], p[1])
}

impl Program {
    /// The strokes of the tool in order.
    pub fn strokes(&self) -> Vec<Stroke> {
        let mut strokes: Vec<Stroke> = Vec::new();
        let mut down = false;
        for (i, (_, it)) in self.moves.iter().enumerate() {
            down &= self.breaks.binary_search(&i).is_err();
            let flat = it.arc.is_none() && xy(it.from) == xy(it.to);
            if it.working && !flat {
                if !down {
                    strokes.push(Vec::new());
                }
                strokes.last_mut().expect("pushed when the tool went down").push(*it);
            }
            // Up and down in one place ends a stroke only when the tool left the work in between.
            down = it.working && (down || !flat) && !(flat && it.rapid);
        }
        strokes
    }

    /// Box around every place that the tool goes to.
    pub fn extents(&self) -> Box3 {
        let mut bounds = Box3::empty();
        for (_, it) in &self.moves {
            it.extremes(|[x, y, z]| bounds.grow(&Vec3::new(x, y, z)));
        }
        bounds
    }
}

/// The ends of all movements of a stroke.
pub fn ends(stroke: &[Move]) -> Vec<Vec2> {
    stroke.first().map(|it| xy(it.from)).into_iter().chain(stroke.iter().map(|it| xy(it.to))).collect()
}

/// The ends of all movements of a stroke with the middles of its arcs.
pub fn marks(stroke: &[Move]) -> Vec<Vec2> {
    let mut out: Vec<Vec2> = stroke.first().map(|it| xy(it.from)).into_iter().collect();
    for it in stroke {
        out.extend(it.arc.map(|_| xy(it.point(0.5))));
        out.push(xy(it.to));
    }
    out
}

/// Points along a stroke, arcs in chords no farther than `tolerance` from them, mm.
pub fn points(stroke: &[Move], tolerance: f64) -> Vec<Vec2> {
    let mut out: Vec<Vec2> = stroke.first().map(|it| xy(it.from)).into_iter().collect();
    for it in stroke {
        let steps = it.arc.map_or(1, |arc| {
            let step = 2.0 * (1.0 - (tolerance / arc.radius).min(1.0)).acos();
            (arc.sweep.abs() / step).ceil().clamp(1.0, 1e5) as usize
        });
        out.extend((1..=steps).map(|k| xy(it.point(k as f64 / steps as f64))));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn modal_state_is_kept() {
        let text =
            "G21 G90\n(a) G0 X1 Y2 ; go\nM4 S0\nG1 X3 S500 F1000\nY4\nG91 G0 X-1 S0\nG4 P0.25\nM0\nM5\nM2\nnot read";
        let program = read_gcode(text, Sense::Beam).unwrap();
        assert_eq!(program.moves.len(), 4);
        let (line, last) = program.moves[2];
        assert_eq!((line, last.from, last.to, last.feed), (5, [3.0, 2.0, 0.0], [3.0, 4.0, 0.0], 1000.0));
        let strokes = program.strokes();
        assert_eq!(strokes.len(), 1);
        assert_eq!(points(&strokes[0], 0.01), [[1.0, 2.0], [3.0, 2.0], [3.0, 4.0]].map(|[x, y]| Vec2::new(x, y)));
        assert_eq!((program.dwell, program.pauses, program.spindle, program.ended), (0.25, 1, Spindle::Off, true));
    }

    #[test]
    fn arcs_are_chords_within_the_tolerance() {
        let program = read_gcode("G90 M3 S9\nG1 X10 F600\nG3 X-10 Y0 I-10\nM5\nM2", Sense::Beam).unwrap();
        let points = points(&program.strokes()[0][1..], 0.01);
        assert!(points.len() > 20);
        for w in points.windows(2) {
            let sagitta = 10.0 - ((w[0] + w[1]) / 2.0).norm();
            assert!((0.0..=0.01).contains(&sagitta), "{sagitta}");
        }
        assert_eq!(program.extents().max.y, 10.0);
    }

    #[test]
    fn what_is_not_understood_is_refused_with_its_line() {
        for (text, line, message) in [
            ("G0 X1\nG2 X1 Y1", 2, "neither R nor a centre"),
            ("G1 X1", 1, "before any F"),
            ("G0 X", 1, "not a word"),
            ("\n\nG68 R30", 3, "the word G68 is not known"),
            ("G0 U4", 1, "the word U4 is not known"),
            ("hello", 1, "not a word"),
        ] {
            match read_gcode(text, Sense::Beam) {
                Err(DrawingError::Program { line: at, message: said, .. }) => {
                    assert!(at == line && said.contains(message), "{text}: {at} {said}");
                }
                other => panic!("{text}: {other:?}"),
            }
        }
    }
}
