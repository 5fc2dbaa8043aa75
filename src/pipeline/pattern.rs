//! The input crease pattern: read, its lines told apart, brought to its physical size.
use std::{collections::BTreeMap, path::Path};

use serde_json::{Value, json};

use super::{
    config::{Config, ConfigError},
    input::{InputError, Sizing, Source, keyed},
};
use crate::{
    geom::{Box2, Vec2},
    import::{
        Assignment, Borders, CreaseFacts, CreaseRoles, Drawing, DrawingError, pattern, read_dxf, read_fold, read_svg,
    },
    model::{Noun, SourceMesh},
};

/// A reader of one kind of drawing.
type Reader = fn(&[u8]) -> Result<Drawing, DrawingError>;

/// Readers by extension.
const READERS: [(&str, Reader); 3] = [("svg", read_svg), ("dxf", read_dxf), ("fold", read_fold)];
/// Ends of lines nearer than this to another line are moved onto it where `input.snap` does not say otherwise, mm.
const SNAP: f64 = 0.05;
/// Pixels per inch that the reader of SVG takes (CSS).
const CSS: f64 = 96.0;

/// Whether a file is a drawing by its extension.
pub fn is_drawing(path: &Path) -> bool {
    reader(path).is_some()
}

fn reader(path: &Path) -> Option<Reader> {
    let extension = path.extension()?;
    READERS.iter().find(|it| extension.eq_ignore_ascii_case(it.0)).map(|it| it.1)
}

/// Reads the drawing that `input.pattern` names.
pub(super) fn load(config: &Config<'_>, given: &Path) -> Result<Source, InputError> {
    let path = config.source.folder().join(given);
    let shown = path.display().to_string();
    let refuse = |reason: String| InputError::Pattern { path: shown.clone(), reason };
    let read = reader(&path).ok_or_else(|| refuse("it is none of .svg, .dxf and .fold".into()))?;
    let bytes = std::fs::read(&path).map_err(|err| refuse(err.to_string()))?;
    let mut drawing = read(&bytes).map_err(|err| refuse(err.to_string()))?;
    let roles = roles(config)?;
    let borders = match config.input.border.unwrap_or_default() {
        BorderKey::Drawn => Borders::Drawn,
        BorderKey::Rectangle => Borders::Rectangle,
        BorderKey::Outermost => Borders::Outermost,
        BorderKey::Annulus => Borders::Annulus,
    };
    let snap = config.input.snap.map_or(SNAP, |it| it.mm);
    let is_svg = path.extension().is_some_and(|it| it.eq_ignore_ascii_case("svg"));
    // First as it is drawn, for its size.
    let lines = Box2::of(drawing.lines.iter().flat_map(|it| &it.points));
    let rough = if lines.size().norm() > 0.0 { 1e-6 * lines.size().norm() } else { SNAP };
    let drawn = pattern(&drawing, &roles, borders, rough.max(1e-9)).map_or(lines, |it| it.pattern.bounds());
    let mut warnings = Vec::new();
    let scale = scale(config, &drawing, is_svg, drawn.size(), &mut warnings)?;
    for p in drawing.lines.iter_mut().flat_map(|it| &mut it.points) {
        *p = (*p - drawn.min) * scale;
    }
    let made = pattern(&drawing, &roles, borders, snap).map_err(|err| {
        let cause = std::error::Error::source(&err).map_or(String::new(), |it| format!(": {it}"));
        refuse(format!("{err}{cause}"))
    })?;
    warn(&made.facts, &mut warnings);
    let file = given.file_name().unwrap_or(given.as_os_str()).to_string_lossy().into_owned();
    let facts = facts(&file, made.pattern.bounds().size(), &made.facts);
    let mesh = SourceMesh { mesh: made.sheet, file, repairs: Vec::new(), up: 2 };
    let (artifact, key) = keyed(mesh.wrap());
    Ok(Source { artifact, key, beside: Some(keyed(made.pattern.wrap())), facts, warnings })
}

/// Where the border comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum BorderKey {
    /// From the lines that are borders.
    #[default]
    Drawn,
    /// A rectangle around all lines.
    Rectangle,
    /// The closed curve that encloses the most.
    Outermost,
    /// That and the one that encloses the least.
    Annulus,
}

/// `input.layers` and `input.colors`.
fn roles(config: &Config<'_>) -> Result<CreaseRoles, ConfigError> {
    let complain = |key: &str, message: String| {
        config.source.error(format!("`input.{key}`: {message}"), config.input_spans.get(key).cloned())
    };
    let role = |key: &str, name: &String| {
        let known = "border, crease, mountain, valley, cut and ignored";
        Assignment::from_name(name).ok_or_else(|| complain(key, format!("a line is one of {known}, not `{name}`")))
    };
    let list =
        |key: &'static str, table: &BTreeMap<String, String>| -> Result<Vec<(String, Assignment)>, ConfigError> {
            table.iter().map(|(line, name)| Ok((line.clone(), role(key, name)?))).collect()
        };
    let color = |(text, role): (String, Assignment)| {
        let digits = text.strip_prefix('#').filter(|it| it.len() == 6 && it.is_ascii());
        let byte = |k: usize| digits.and_then(|it| u8::from_str_radix(&it[2 * k..2 * k + 2], 16).ok());
        match [byte(0), byte(1), byte(2)] {
            [Some(r), Some(g), Some(b)] => Ok(([r, g, b], role)),
            _ => Err(complain("colors", format!("`{text}` is no colour; write \"#RRGGBB\""))),
        }
    };
    let colors = list("colors", &config.input.colors)?.into_iter().map(color).collect::<Result<_, _>>()?;
    Ok(CreaseRoles { layers: list("layers", &config.input.layers)?, colors })
}

/// Factor from the numbers of the reader, mm or CSS pixels as mm, to the size of the job.
fn scale(
    config: &Config<'_>,
    drawing: &Drawing,
    is_svg: bool,
    size: Vec2,
    warnings: &mut Vec<String>,
) -> Result<f64, InputError> {
    let span = |key: &str| config.input_spans.get(key).cloned();
    let dpi = config.input.dpi;
    if let Some(dpi) = dpi.filter(|it| !(1.0..=1e5).contains(it)) {
        return Err(config
            .source
            .error(format!("`input.dpi` must be between 1 and 100000, not {dpi}"), span("dpi"))
            .into());
    }
    let stated = |key: &str| {
        let message = format!("`input.{key}` has no use: the file states its unit; use input.scale to change the size");
        InputError::from(config.source.error(message, span(key)))
    };
    if dpi.is_some() && (drawing.measured || !is_svg) {
        return Err(stated("dpi"));
    }
    let pixel = dpi.map_or(1.0, |it| CSS / it);
    match Sizing::of(config)? {
        Sizing::Unit(_) if drawing.measured => Err(stated("units")),
        Sizing::Unit(mm) if is_svg => Ok(mm * CSS / 25.4),
        Sizing::Unit(mm) => Ok(mm),
        Sizing::Factor(factor) => Ok(factor * pixel),
        Sizing::Along(axis, mm) => match axis.of_plane(size) {
            Some(extent) if extent > 0.0 => Ok(mm / extent),
            Some(_) => Ok(1.0),
            None => Err(config
                .source
                .error("`input.depth`: a drawing has width and height only".to_owned(), span("depth"))
                .into()),
        },
        Sizing::Unknown => {
            if !drawing.measured && dpi.is_none() {
                let at = |dpi: f64| format!("{:.1} x {:.1} mm", size.x * CSS / dpi, size.y * CSS / dpi);
                warnings.push(if is_svg {
                    format!(
                        "the drawing states no unit: its pixels are read as 1/96 inch (CSS), so that it is {}; much software means 1/72 inch, {}. Set input.dpi = 72 or 96, input.units or input.width",
                        at(CSS),
                        at(72.0)
                    )
                } else {
                    format!("the drawing states no unit: its numbers are read as mm, {}. Set input.units or input.width", at(CSS))
                });
            }
            Ok(pixel)
        }
    }
}

/// Places that a warning names.
const NAMED: usize = 3;

/// Says what is not as drawn.
fn warn(facts: &CreaseFacts, warnings: &mut Vec<String>) {
    let mut say = |count: usize, what: &str, places: Vec<String>| {
        if count > 0 {
            warnings.push(format!("{what}: {count}, at {}", places.join(", ")));
        }
    };
    let place = |p: &[f64; 2]| format!("({:.2}, {:.2}) mm", p[0], p[1]);
    let measured = |list: &[([f64; 2], f64)]| {
        list.iter().take(NAMED).map(|(p, mm)| format!("{} by {mm:.3} mm", place(p))).collect::<Vec<_>>()
    };
    say(facts.snapped.len(), "ends moved onto other lines", measured(&facts.snapped));
    let doubled = facts.doubled.iter().take(NAMED).map(|(p, mm)| format!("{} for {mm:.2} mm", place(p))).collect();
    say(facts.doubled.len(), "lines drawn on each other, which count once", doubled);
    let outside = facts.outside.iter().take(NAMED).map(place).collect();
    say(facts.outside.len(), "creases off the paper, which are left out", outside);
    if facts.unknown > 0 {
        warnings.push(format!(
            "lines whose colour and layer say nothing, which are left out: {}. Name them in input.colors or input.layers",
            facts.unknown
        ));
    }
}

/// The `input` table of the report.
fn facts(file: &str, size: Vec2, facts: &CreaseFacts) -> Value {
    json!({
        "file": file,
        "size_mm": [size.x, size.y],
        "diagonal_mm": size.norm(),
        "patches": facts.patches,
        "creases": facts.folds,
        "snapped_ends": facts.snapped.len(),
        "doubled_lines": facts.doubled.len(),
        "creases_off_the_paper": facts.outside.len(),
        "unknown_lines": facts.unknown,
        "repairs": [],
    })
}
