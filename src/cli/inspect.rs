//! `fabricate inspect`: what is in a file.
use std::{collections::BTreeMap, fs, path::Path};

use serde_json::{Value, json};

use super::{Exit, show};
use crate::{
    import::{self, Drawing, DrawingError, mesh as reader},
    pipeline,
};

/// Reads the bytes of a drawing.
type Reader = fn(&[u8]) -> Result<Drawing, DrawingError>;

/// Readers of drawings by extension.
const DRAWINGS: &[(&str, Reader)] = &[("svg", import::read_svg), ("dxf", import::read_dxf)];
/// Extensions of G-code.
const PROGRAMS: &[&str] = &["nc", "gcode", "ngc", "tap"];

/// Shows what `file` holds.
pub(super) fn inspect(file: &Path, as_json: bool) -> Exit {
    let extension = file.extension().map(|it| it.to_string_lossy().to_lowercase()).unwrap_or_default();
    let facts = if reader::FORMATS.iter().any(|it| it.1 == extension) {
        pipeline::inspect_mesh(file)
    } else {
        match fs::read(file) {
            Ok(bytes) => plane(&extension, &bytes),
            Err(err) => Err(err.to_string()),
        }
    };
    match facts {
        Ok(facts) => {
            if as_json {
                show::data(&format!("{facts:#}"));
            } else {
                show::facts(&facts);
            }
            Exit::Done
        }
        Err(reason) => {
            show::note(&format!("error: {}: {reason}", file.display()));
            Exit::Input
        }
    }
}

fn plane(extension: &str, bytes: &[u8]) -> Result<Value, String> {
    if let Some((_, read)) = DRAWINGS.iter().find(|it| it.0 == extension) {
        return read(bytes).map(|it| drawing(&it)).map_err(|it| it.to_string());
    }
    let text = || std::str::from_utf8(bytes).map_err(|it| it.to_string());
    if extension == "plt" {
        return import::read_hpgl(text()?).map(|it| drawing(&it)).map_err(|it| it.to_string());
    }
    if PROGRAMS.contains(&extension) {
        return import::read_gcode(text()?).map(|it| program(&it)).map_err(|it| it.to_string());
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
    facts
}

fn program(program: &import::Program) -> Value {
    let length = |rapid: bool| -> f64 {
        program.moves.iter().filter(|it| it.rapid == rapid).map(|it| (it.to - it.from).norm()).sum()
    };
    let mut facts = json!({
        "moves": program.moves.len(),
        "feed_mm": length(false),
        "rapid_mm": length(true),
        "pauses": program.pauses,
        "dwell_s": program.dwell,
        "ends": program.ended,
        "longest_line": program.longest_line,
    });
    if !program.moves.is_empty() {
        let box3 = program.extents();
        facts["extents_mm"] = json!([box3.min.as_slice(), box3.max.as_slice()]);
    }
    facts
}
