//! HPGL plots as programs: one command and one coordinate pair on a line, with contours, bounds and times.
use super::{
    program::{Bounds, Contour, Program, ProgramError},
    timing::{Clock, Limits},
};
use crate::import::gcode::{
    LineError,
    path::{Move, Point},
};

/// Millimetres per plotter unit.
const UNIT: f64 = 0.025;

/// Commands that neither draw nor change what coordinates mean; they are sent as they are.
const HARMLESS: &[&str] = &["IN", "DF", "VS", "FS", "LT", "PW", "WU", "PS", "FT", "TR"];

/// Pen and place while a plot is read line by line.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Plotter {
    at: Point,
    down: bool,
    /// Speeds, mm/min: with the tool down, and up.
    feed: f64,
    rapid: f64,
}

impl Plotter {
    /// At the origin with the tool up.
    pub fn new(feed: f64, rapid: f64) -> Self {
        Self { feed, rapid, ..Self::default() }
    }

    /// Takes one command with at most one pair, without its semicolon; its movement, if it has one.
    pub fn line(&mut self, command: &str) -> Result<Option<Move>, LineError> {
        let command = command.trim().trim_end_matches(';');
        let wrong = || LineError::Word(command.to_owned());
        let Some((name, rest)) = command.split_at_checked(2) else { return Err(wrong()) };
        if HARMLESS.contains(&name) || name == "SP" {
            return Ok(None);
        }
        match name {
            "PU" => self.down = false,
            "PD" => self.down = true,
            "PA" => {}
            _ => return Err(wrong()),
        }
        if rest.trim().is_empty() {
            return Ok(None);
        }
        let (x, y) = rest.split_once([',', ' ']).ok_or_else(wrong)?;
        let number = |it: &str| it.trim().parse::<f64>().ok().filter(|it| it.abs() < 1e9).ok_or_else(wrong);
        let to = [number(x)? * UNIT, number(y)? * UNIT, 0.0];
        let feed = if self.down { self.feed } else { self.rapid };
        let it = Move { from: self.at, to, arc: None, rapid: !self.down, feed, working: self.down };
        self.at = to;
        Ok(Some(it))
    }
}

/// One command on a line, each with at most one pair: long lists overrun some cutters.
pub fn one_per_line(text: &str) -> String {
    let mut out = String::with_capacity(text.len() + text.len() / 4);
    for command in text.split([';', '\n', '\r']) {
        let command = command.trim();
        let Some((name, rest)) = command.split_at_checked(2) else {
            // One letter is no command; the reader says so with its line.
            if !command.is_empty() {
                out += &format!("{command};\n");
            }
            continue;
        };
        let numbers: Vec<&str> = rest.split([',', ' ']).filter(|it| !it.is_empty()).collect();
        if matches!(name, "PU" | "PD" | "PA") && numbers.len() > 2 {
            for pair in numbers.chunks(2) {
                out += &format!("{name}{};\n", pair.join(","));
            }
        } else {
            out += &format!("{command};\n");
        }
    }
    out
}

/// What is gathered while a plot is read.
struct Reading {
    clock: Clock,
    contours: Vec<Contour>,
    bounds: Bounds,
    touched: Bounds,
    worked: f64,
    travelled: f64,
    open: bool,
    /// The pen in the holder, and the lines at which it is changed.
    pen: Option<String>,
    pauses: Vec<usize>,
}

impl Reading {
    /// Another pen: somebody has to put it in. `SP0` puts it away, and the first is there already.
    fn select(&mut self, index: usize, line: &str) {
        let Some(pen) = line.trim_end_matches(';').strip_prefix("SP").map(str::trim) else { return };
        if pen.is_empty() || pen == "0" {
            return;
        }
        if self.pen.as_deref().is_some_and(|it| it != pen) {
            self.pauses.push(index);
        }
        self.pen = Some(pen.to_owned());
    }

    fn take(&mut self, index: usize, it: &Move) {
        self.clock.travel(index, it);
        self.bounds.add(it.to);
        *(if it.working { &mut self.worked } else { &mut self.travelled }) += it.length();
        if !it.working {
            self.open = false;
            return;
        }
        self.touched.add(it.from);
        self.touched.add(it.to);
        match self.contours.last_mut() {
            Some(contour) if self.open => contour.last = index,
            last => {
                let approach = last.map_or(0, |it| it.last + 1).min(index);
                let (first, last, start) = (index, index, it.from);
                self.contours.push(Contour { approach, first, last, start, seconds: 0.0, label: None });
                self.open = true;
            }
        }
    }
}

/// Reads a plot, brought into lines by [`one_per_line`], with the speed of the lowered tool, mm/min.
pub fn read(text: &str, feed: f64, limits: Limits) -> Result<Program, Vec<ProgramError>> {
    let text = one_per_line(text);
    let mut plotter = Plotter::new(feed, limits.rate[0]);
    let mut reading = Reading {
        clock: Clock::new(limits),
        contours: Vec::new(),
        bounds: Bounds::EMPTY,
        touched: Bounds::EMPTY,
        worked: 0.0,
        travelled: 0.0,
        open: false,
        pen: None,
        pauses: Vec::new(),
    };
    let mut errors = Vec::new();
    let mut lines = vec![0_u32];
    for (index, line) in text.split_inclusive('\n').enumerate() {
        lines.push(lines[index] + line.len() as u32);
        match plotter.line(line.trim_end()) {
            Ok(Some(it)) => reading.take(index, &it),
            Ok(None) => {
                reading.open &= plotter.down;
                reading.select(index, line.trim_end());
            }
            Err(cause) if errors.len() < 20 => {
                errors.push(ProgramError::Line { line: index + 1, text: line.trim_end().to_owned(), cause });
            }
            Err(_) => break,
        }
    }
    lines.pop();
    if errors.is_empty() && reading.bounds.is_empty() {
        errors.push(ProgramError::Empty);
    }
    if !errors.is_empty() {
        return Err(errors);
    }
    let Reading { clock, mut contours, bounds, touched, worked, travelled, pauses, .. } = reading;
    let seconds = clock.finish(lines.len());
    for contour in &mut contours {
        contour.seconds = seconds[contour.approach..=contour.last].iter().map(|&it| f64::from(it)).sum();
    }
    Ok(Program {
        text,
        lines,
        seconds,
        contours,
        machine: bounds,
        work: bounds,
        touched,
        pauses,
        opaque: None,
        shifts: false,
        turns: None,
        worked,
        travelled,
        plot: Some(feed),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: Limits = Limits { rate: [6000.0; 3], acceleration: [500.0; 3], junction: 0.01 };

    #[test]
    fn lists_become_one_pair_a_line_and_contours_are_found() {
        let text = "IN;PA;SP1;PU400,400;PD800,400,800,800,400,400;PU2000,400;PD2400,400;PU;SP0;";
        assert!(one_per_line(text).lines().all(|it| it.matches(',').count() <= 1));
        let program = read(text, 1200.0, LIMITS).unwrap();
        assert_eq!(program.contours.len(), 2);
        assert_eq!(program.contours[0].start, [10.0, 10.0, 0.0]);
        assert!((program.worked - 30.0 - 200.0_f64.sqrt()).abs() < 1e-9);
        assert_eq!((program.touched.min[0], program.touched.max[0]), (10.0, 60.0));
        assert!(program.pauses.is_empty());
        let two = read("IN;SP2;PU0,0;PD40,0;SP1;PU80,0;PD80,40;SP0;", 1200.0, LIMITS).unwrap();
        assert_eq!(two.pauses.iter().map(|&it| two.line(it)).collect::<Vec<_>>(), ["SP1;"]);
        assert!(program.total_seconds() > program.worked / 20.0);
    }

    #[test]
    fn what_may_draw_without_being_understood_is_refused() {
        let said = |text: &str| read(text, 1200.0, LIMITS).unwrap_err()[0].to_string();
        assert!(said("IN;PA;CI400;").contains("line 3") && said("PU1;").contains("line 1"));
        assert!(said("IN;").contains("moves nothing"));
    }
}
