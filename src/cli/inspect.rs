//! `fabricate inspect`: what is in a file.
use std::{collections::BTreeMap, fs, path::Path};

use serde_json::{Value, json};

use super::{Exit, send, show};
use crate::{
    import::{
        self, CreaseFacts, CreaseRoles, Drawing, DrawingError, DrawnLine,
        gcode::{Interpreter, Offsets, Sense, State, bare, points},
        mesh as reader,
    },
    machine::{
        board::profile_limits,
        job,
        program::{Bounds, Program, Setting},
        timing::Limits,
    },
    pipeline,
    profile::Machine,
    report::{self, Lines},
};

/// Reads the bytes of a drawing.
type Reader = fn(&[u8]) -> Result<Drawing, DrawingError>;

/// Readers of drawings by extension.
const DRAWINGS: &[(&str, Reader)] =
    &[("svg", import::read_svg), ("dxf", import::read_dxf), ("fold", import::read_fold)];
/// Ends of creases that miss another line by less are taken to meet it, mm.
const SNAP: f64 = 0.05;
/// Extensions of G-code.
const PROGRAMS: &[&str] = &["nc", "gcode", "ngc", "tap"];

const WORK: [u8; 3] = [0xc8, 0x10, 0x2e];
const TRAVEL: [u8; 3] = [0xb4, 0xc4, 0xd8];
/// Pixels of the longer side of a picture.
const PIXELS: u32 = 2000;
/// Drives assumed where no machine is named: mm/min and mm/s².
const ASSUMED: Limits = Limits { rate: [6000.0; 3], acceleration: [500.0; 3], junction: 0.01 };

/// Shows what `file` holds.
pub(super) fn inspect(file: &Path, as_json: bool, machine: Option<&str>, picture: Option<&Path>) -> Exit {
    let machine = match machine.map(send::profile).transpose() {
        Ok(machine) => machine,
        Err(message) => {
            show::note(&format!("error: {message}"));
            return Exit::Usage;
        }
    };
    let extension = file.extension().map(|it| it.to_string_lossy().to_lowercase()).unwrap_or_default();
    let facts = if reader::FORMATS.iter().any(|it| it.1 == extension) {
        pipeline::inspect_mesh(file).map(|it| (it, Lines::new()))
    } else {
        match fs::read(file) {
            Ok(bytes) => plane(&extension, &bytes, machine.as_ref()),
            Err(err) => Err(err.to_string()),
        }
    };
    let (facts, lines) = match facts {
        Ok(it) => it,
        Err(reason) => {
            show::note(&format!("error: {}: {reason}", file.display()));
            return Exit::Input;
        }
    };
    if as_json {
        show::data(&format!("{facts:#}"));
    } else {
        show::facts(&facts);
    }
    if let Some(path) = picture {
        let drawn = report::lines(&lines, PIXELS).and_then(|it| fs::write(path, it).map_err(|it| it.to_string()));
        if let Err(reason) = drawn {
            show::note(&format!("error: no picture {}: {reason}", path.display()));
            return Exit::Output;
        }
    }
    if facts["outside_bed"].is_array() { Exit::ChecksFailed } else { Exit::Done }
}

fn plane(extension: &str, bytes: &[u8], machine: Option<&Machine>) -> Result<(Value, Lines), String> {
    let shown = |it: Drawing| {
        let close = |it: &DrawnLine| it.points.iter().chain(it.closed.then(|| &it.points[0])).copied().collect();
        (drawing(&it), it.lines.iter().map(|it| (close(it), WORK)).collect())
    };
    if let Some((_, read)) = DRAWINGS.iter().find(|it| it.0 == extension) {
        return read(bytes).map(shown).map_err(|it| it.to_string());
    }
    let text = || std::str::from_utf8(bytes).map_err(|it| it.to_string());
    if extension == "plt" {
        return import::read_hpgl(text()?).map(shown).map_err(|it| it.to_string());
    }
    if PROGRAMS.contains(&extension) {
        return program(text()?, machine);
    }
    let drawings = DRAWINGS.iter().map(|it| it.0);
    let known: Vec<_> =
        reader::FORMATS.iter().map(|it| it.1).chain(drawings).chain(["plt"]).chain(PROGRAMS.iter().copied()).collect();
    Err(format!("the ending `{extension}` is none of {}", known.join(", ")))
}

fn drawing(drawing: &Drawing) -> Value {
    let mut layers = BTreeMap::<&str, (usize, usize, f64)>::new();
    for line in &drawing.lines {
        let layer = layers.entry(&line.layer).or_default();
        layer.0 += 1;
        layer.1 += usize::from(line.closed);
        layer.2 += line.length();
    }
    let bounds = drawing.bounds();
    let layer =
        |(lines, closed, length): (usize, usize, f64)| json!({ "lines": lines, "closed": closed, "length_mm": length });
    let mut facts = json!({
        "layers": layers.into_iter().map(|(name, it)| (name.to_owned(), layer(it))).collect::<serde_json::Map<_, _>>(),
        "ignored": drawing.ignored,
    });
    if !drawing.lines.is_empty() {
        facts["extents_mm"] = json!([[bounds.min.x, bounds.min.y], [bounds.max.x, bounds.max.y]]);
    }
    if let Some(size) = drawing.size {
        facts["page_mm"] = json!([size.x, size.y]);
    }
    if !drawing.measured {
        facts["unit"] = json!(
            "not stated: pixels of an SVG count as 1/96 inch here, but 1/72 in much drawing software (a third more); others as mm"
        );
    }
    if let Some(creases) = creases(drawing) {
        facts["creases"] = creases;
    }
    facts
}

/// What a drawing is as a crease pattern, if it has folds within borders by the colours of Origami Simulator or by its layers.
fn creases(drawing: &Drawing) -> Option<Value> {
    let facts = CreaseFacts::of(drawing, &CreaseRoles::default(), SNAP).ok()?;
    let places = |it: &[[f64; 2]]| json!(it);
    let measured = |it: &[([f64; 2], f64)]| it.iter().map(|([x, y], mm)| json!([x, y, mm])).collect::<Vec<_>>();
    (facts.folds > 0 && facts.patches > 0).then(|| {
        json!({
            "sound": facts.sound(),
            "patches": facts.patches,
            "folds": facts.folds,
            "dead_ends_mm": places(&facts.dead_ends),
            "outside_mm": places(&facts.outside),
            "open_borders_mm": places(&facts.open_borders),
            "snapped_mm": measured(&facts.snapped),
            "doubled_mm": measured(&facts.doubled),
            "unknown_lines": facts.unknown,
        })
    })
}

/// A program as the sender reads it: the same errors, bounds and times.
fn program(text: &str, machine: Option<&Machine>) -> Result<(Value, Lines), String> {
    let sense = machine.map_or_else(|| Sense::guess(text), |it| Sense::of(&it.head));
    let setting = Setting {
        state: State::new([0.0; 3], Offsets::default()),
        sense,
        limits: machine.map_or(ASSUMED, profile_limits),
    };
    let program = Program::read(text.to_owned(), &setting).map_err(|errors| {
        let errors: Vec<String> = errors.iter().map(ToString::to_string).collect();
        errors.join("\n  ")
    })?;
    let bounds = |it: &Bounds| json!([it.min, it.max]);
    let mut facts = json!({
        "lines": program.len(),
        "tool": match sense {
            Sense::Beam => "beam: at work in feed moves with S above 0".to_owned(),
            Sense::Servo { up, down } => format!("servo: up at S{up}, down at S{down}"),
            Sense::Height { clear } => format!("Z axis: at work below Z{clear}"),
        },
        "contours": program.contours.len(),
        "work_mm": program.worked,
        "travel_mm": program.travelled,
        "pauses": program.pauses.len(),
        "seconds_estimate": program.total_seconds(),
    });
    if !program.work.is_empty() {
        facts["extents_mm"] = bounds(&program.work);
    }
    if !program.touched.is_empty() {
        facts["touched_mm"] = bounds(&program.touched);
    }
    if let Some(line) = program.opaque {
        facts["not_followed_from_line"] = json!(line + 1);
    }
    match machine {
        None => facts["assumed"] = json!("100 mm/s and 500 mm/s² on every axis; name a machine with --machine"),
        Some(machine) => {
            let faults = job::bed_faults(&program, machine);
            if !faults.is_empty() {
                facts["outside_bed"] = json!(faults);
            }
        }
    }
    let mut interpreter = Interpreter::new(setting.state, sense);
    let (mut travel, mut work) = (Lines::new(), Lines::new());
    for index in 0..program.len() {
        let step = interpreter.line(&bare(program.line(index))).map_err(|it| it.to_string())?;
        for it in &step.moves {
            let (to, color) = if it.working { (&mut work, WORK) } else { (&mut travel, TRAVEL) };
            to.push((points(std::slice::from_ref(it), 0.01), color));
        }
        if step.end {
            break;
        }
    }
    travel.append(&mut work);
    Ok((facts, travel))
}
