//! What a GRBL-type board says, line by line. Takes any bytes: what is not understood stays text.
use crate::import::gcode::path::{Point, distance};

/// Longer lines are cut: nothing a board says is longer, but a wrong baud rate can deliver bytes without a line end.
const LONGEST: usize = 512;

/// Cuts a stream of bytes into lines.
#[derive(Debug, Default)]
pub struct LineReader {
    pending: Vec<u8>,
}

impl LineReader {
    /// Takes bytes and hands each completed, non-empty line to `take`.
    pub fn feed(&mut self, bytes: &[u8], mut take: impl FnMut(String)) {
        for &byte in bytes {
            match byte {
                b'\n' | b'\r' if self.pending.is_empty() => {}
                b'\n' | b'\r' => {
                    take(String::from_utf8_lossy(&self.pending).trim().to_owned());
                    self.pending.clear();
                }
                _ if self.pending.len() < LONGEST => self.pending.push(byte),
                _ => {}
            }
        }
    }

    /// Forgets a line begun.
    pub fn clear(&mut self) {
        self.pending.clear();
    }
}

/// State of the machine in a report.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mode {
    /// Nothing moves, nothing waits.
    Idle,
    /// Executing.
    Run,
    /// Held and at rest (`Hold:0`), or still slowing down.
    Hold {
        /// At rest.
        at_rest: bool,
    },
    /// Jogging.
    Jog,
    /// Locked.
    Alarm,
    /// The door is open.
    Door,
    /// `$C`.
    Check,
    /// Homing.
    Home,
    /// Asleep.
    Sleep,
    /// Waiting for a tool change (grblHAL).
    Tool,
}

/// A `<…>` report.
#[derive(Debug, Clone, PartialEq)]
pub struct Report {
    /// State.
    pub mode: Mode,
    /// `MPos`, mm.
    pub machine: Option<Point>,
    /// How many axes it reports.
    pub axes: Option<usize>,
    /// `WPos`, mm.
    pub work: Option<Point>,
    /// `WCO`, mm; only now and then.
    pub offset: Option<Point>,
    /// Feed, mm/min.
    pub feed: Option<f64>,
    /// S word.
    pub speed: Option<f64>,
    /// Free planner blocks and receive bytes, where the board tells.
    pub free: Option<(u32, u32)>,
    /// Feed override, percent; only now and then.
    pub overrides: Option<u32>,
}

/// A line from the board.
#[derive(Debug, Clone, PartialEq)]
pub enum Reply {
    /// `ok`.
    Ok,
    /// `error:N`.
    Error(u16),
    /// `ALARM:N`.
    Alarm(u16),
    /// It has started.
    Banner(String),
    /// `<…>`.
    Report(Report),
    /// `$n=value`.
    Setting(u16, f64),
    /// `[OPT:letters,blocks,bytes]`.
    Options {
        /// Compile-time switches.
        letters: String,
        /// Planner blocks.
        blocks: Option<u32>,
        /// Bytes of the receive buffer.
        bytes: Option<u32>,
    },
    /// `[G54:…]` and its kin.
    Offset(String, Point),
    /// `[TLO:…]`.
    ToolOffset(f64),
    /// Anything else.
    Text(String),
}

fn numbers<const N: usize>(text: &str) -> Option<[f64; N]> {
    let mut out = [0.0; N];
    let mut parts = text.split(',');
    for slot in &mut out {
        *slot = parts.next()?.trim().parse().ok().filter(|it: &f64| it.is_finite())?;
    }
    Some(out)
}

/// A point of two, three or more numbers (boards with more axes send more).
fn point(text: &str) -> Option<Point> {
    numbers::<3>(text).or_else(|| numbers::<2>(text).map(|[x, y]| [x, y, 0.0]))
}

/// A report without its angle brackets.
fn report(text: &str) -> Option<Report> {
    let mut parts = text.split('|');
    let (name, sub) = {
        let state = parts.next()?;
        state.split_once(':').unwrap_or((state, "0"))
    };
    let mode = match name {
        "Idle" => Mode::Idle,
        "Run" => Mode::Run,
        "Hold" => Mode::Hold { at_rest: sub == "0" },
        "Jog" => Mode::Jog,
        "Alarm" => Mode::Alarm,
        "Door" => Mode::Door,
        "Check" => Mode::Check,
        "Home" => Mode::Home,
        "Sleep" => Mode::Sleep,
        "Tool" => Mode::Tool,
        _ => return None,
    };
    let mut out = Report {
        mode,
        machine: None,
        axes: None,
        work: None,
        offset: None,
        feed: None,
        speed: None,
        free: None,
        overrides: None,
    };
    for part in parts {
        let (key, value) = part.split_once(':')?;
        if matches!(key, "MPos" | "WPos") {
            out.axes = Some(value.split(',').count());
        }
        match key {
            "MPos" => out.machine = Some(point(value)?),
            "WPos" => out.work = Some(point(value)?),
            "WCO" => out.offset = Some(point(value)?),
            "FS" => {
                let [feed, speed] = numbers::<2>(value)?;
                (out.feed, out.speed) = (Some(feed), Some(speed));
            }
            "F" => out.feed = Some(numbers::<1>(value)?[0]),
            "Bf" => out.free = numbers::<2>(value).map(|[a, b]| (a as u32, b as u32)),
            "Ov" => out.overrides = numbers::<3>(value).map(|it| it[0] as u32),
            _ => {}
        }
    }
    Some(out)
}

/// Reads a line.
pub fn parse(line: &str) -> Reply {
    let text = || Reply::Text(line.to_owned());
    let code = |it: &str| it.trim().parse::<u16>().ok();
    if line == "ok" {
        return Reply::Ok;
    }
    if let Some(rest) = line.strip_prefix("error:") {
        return code(rest).map_or_else(text, Reply::Error);
    }
    if let Some(rest) = line.strip_prefix("ALARM:") {
        return code(rest).map_or_else(text, Reply::Alarm);
    }
    if let Some(rest) = line.strip_prefix('<') {
        return rest.strip_suffix('>').and_then(report).map_or_else(text, Reply::Report);
    }
    // GRBL and FluidNC say "Grbl 1.1h ['$' for help]", grblHAL "GrblHAL 1.1f […]".
    let lower = line.to_ascii_lowercase();
    if lower.starts_with("grbl") && lower.contains("help]") {
        return Reply::Banner(line.to_owned());
    }
    if let Some(rest) = line.strip_prefix('$') {
        let pair = rest.split_once('=').and_then(|(key, value)| {
            // Some boards explain the value: "$0=10 (step pulse, usec)".
            let value = value.split_whitespace().next()?;
            Some((code(key)?, value.parse::<f64>().ok().filter(|it| it.is_finite())?))
        });
        return pair.map_or_else(text, |(key, value)| Reply::Setting(key, value));
    }
    if let Some((key, value)) =
        line.strip_prefix('[').and_then(|it| it.strip_suffix(']')).and_then(|it| it.split_once(':'))
    {
        return match key {
            "OPT" => {
                let mut parts = value.split(',');
                let letters = parts.next().unwrap_or_default().to_owned();
                let mut number = || parts.next().and_then(|it| it.trim().parse().ok());
                Reply::Options { letters, blocks: number(), bytes: number() }
            }
            "G54" | "G55" | "G56" | "G57" | "G58" | "G59" | "G28" | "G30" | "G92" => {
                point(value).map_or_else(text, |it| Reply::Offset(key.to_owned(), it))
            }
            "TLO" => {
                // One number on GRBL, one per axis on grblHAL, where z is the third.
                let z = numbers::<3>(value).map(|it| it[2]).or_else(|| numbers::<1>(value).map(|it| it[0]));
                z.map_or_else(text, Reply::ToolOffset)
            }
            _ => text(),
        };
    }
    text()
}

/// Whether two points are the same as far as reports can tell.
pub(super) fn same_place(a: Point, b: Point) -> bool {
    distance(a, b) < 0.002
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reads_what_boards_say() {
        assert_eq!(parse("ok"), Reply::Ok);
        assert_eq!(parse("error:20"), Reply::Error(20));
        assert_eq!(parse("ALARM:2"), Reply::Alarm(2));
        assert!(matches!(parse("Grbl 1.1h ['$' for help]"), Reply::Banner(_)));
        assert!(matches!(parse("GrblHAL 1.1f ['$' or '$HELP' for help]"), Reply::Banner(_)));
        assert_eq!(parse("$32=1"), Reply::Setting(32, 1.0));
        assert_eq!(parse("$130=200.000 (x max travel, mm)"), Reply::Setting(130, 200.0));
        assert_eq!(parse("[OPT:V,15,128]"), Reply::Options { letters: "V".into(), blocks: Some(15), bytes: Some(128) });
        assert_eq!(parse("[G54:1.000,2.000,-3.000]"), Reply::Offset("G54".into(), [1.0, 2.0, -3.0]));
        assert_eq!(parse("[TLO:0.000,0.000,1.500]"), Reply::ToolOffset(1.5));
        let Reply::Report(it) = parse("<Hold:1|MPos:1.000,2.000,3.000|Bf:14,120|FS:500,90|Ov:90,100,100|WCO:1,1,0>")
        else {
            panic!("a report")
        };
        assert_eq!((it.mode, it.machine), (Mode::Hold { at_rest: false }, Some([1.0, 2.0, 3.0])));
        assert_eq!((it.free, it.overrides, it.offset), (Some((14, 120)), Some(90), Some([1.0, 1.0, 0.0])));
    }

    #[test]
    fn what_is_garbled_stays_text() {
        for line in [
            "o",
            "okok",
            "error:",
            "error:x",
            "<Idle|MPos:1,2",
            "<Idle|MPos:1,a,3>",
            "<Idl|FS:1,2>",
            "$=",
            "[OPT]",
            "$1=nan",
        ] {
            assert_eq!(parse(line), Reply::Text(line.into()), "{line}");
        }
    }
}
