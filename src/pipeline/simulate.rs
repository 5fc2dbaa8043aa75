//! What the machine would really cut: the program of a sheet replayed with its tool, and compared with the layout.
use std::collections::BTreeMap;

use crate::{
    emit::{File, Nouns, Subject},
    geom::{
        Box2, Vec2,
        arcs::trail,
        polygon::{contains, edges},
        segment_tree::SegmentTree,
    },
    import::{
        self,
        gcode::{self, Sense},
    },
    model::{Operation, Sheet},
    profile::{Machine, MachineKind, Profiles},
    stage::Check,
};

/// How far a cut may be from the layout, mm: the tolerances of lines and arcs, and the rounding of offsets and numbers.
const LIMIT: f64 = 0.05;
/// The same for a trailing blade.
const BLADE_LIMIT: f64 = 0.1;
/// Chords of the arcs of a program, mm.
const CHORD: f64 = 1e-3;

/// Samples of contours and cuts, mm.
const SAMPLE: f64 = 0.5;
/// Steps of a trailing blade, mm.
const STEP: f64 = 0.1;
/// Where webs are meant, a contour farther than this from the cut is one, mm.
const WEB: f64 = 0.03;

/// One check per format of programs, `cut.gcode` and `cut.hpgl`: the programs as they were read back, carried out with the
/// tool of the machine, against the contours of the layout.
pub fn simulate(files: &[File], nouns: &Nouns<'_>, profiles: &Profiles) -> Vec<Check> {
    let machine = &profiles.machine;
    let mut found: BTreeMap<&str, (Fit, Vec<String>)> = BTreeMap::new();
    for file in files {
        let (Subject::Program(i), Some(sheets), Some(paths)) = (file.subject, nouns.sheets, nouns.toolpaths) else {
            continue;
        };
        let (Some(sheet), Some(paths)) = (sheets.sheets.get(i), paths.sheets.get(i)) else { continue };
        let strokes = std::str::from_utf8(&file.bytes)
            .map_err(|it| it.to_string())
            .and_then(|it| strokes(file.format, it, machine));
        let entry = found.entry(file.format).or_default();
        let meant = paths.strokes().map(|it| &it[0]);
        let paths: Vec<_> = meant.filter(|it| machine.tools.get(it.operation).is_some()).collect();
        match strokes {
            Ok(strokes) if strokes.len() == paths.len() => {
                let place = |it: &Vec2| machine.from_work(*it, sheet.size);
                let cut = |(points, path): (Vec<Vec2>, &&crate::model::Toolpath)| Cut {
                    operation: path.operation,
                    points: points.iter().map(place).collect(),
                    aligns: path.part.is_empty(),
                };
                let cuts: Vec<Cut> = strokes.into_iter().zip(&paths).map(cut).collect();
                entry.0 = entry.0.merge(compare(&cuts, sheet, machine));
            }
            Ok(strokes) => entry.1.push(format!("{}: {} strokes, expected {}", file.path, strokes.len(), paths.len())),
            Err(fault) => entry.1.push(format!("{}: {fault}", file.path)),
        }
    }
    let limit = if machine.kind == MachineKind::DragKnife { BLADE_LIMIT } else { LIMIT };
    let check = |(format, (fit, faults)): (&str, (Fit, Vec<String>))| {
        Check {
        name: format!("cut.{format}"),
        ok: faults.is_empty() && fit.worst() <= limit && fit.uncut == 0.0,
        value: fit.worst(),
        limit,
        unit: "mm".into(),
        note: faults.first().cloned().unwrap_or_else(|| {
            let Fit { into, short, uncut } = fit;
            format!("the replayed tool reaches {into:.3} mm into a part, is {short:.3} mm off its line, leaves {uncut:.1} mm uncut")
        }),
    }
    };
    found.into_iter().map(check).collect()
}

/// The strokes of a program in work coordinates, arcs in fine chords.
fn strokes(format: &str, text: &str, machine: &Machine) -> Result<Vec<Vec<Vec2>>, String> {
    if format == "gcode" {
        let read = import::read_gcode(text, Sense::of(&machine.head)).map_err(|it| it.to_string())?;
        return Ok(read.strokes().iter().map(|it| gcode::points(it, CHORD)).collect());
    }
    let read = import::read_hpgl(text).map_err(|it| it.to_string())?;
    let whole = |mut line: import::DrawnLine| {
        line.points.extend(line.closed.then(|| line.points[0]));
        line.points
    };
    Ok(read.lines.into_iter().map(whole).collect())
}

/// A stroke of the program in sheet coordinates, arcs in fine chords.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Cut {
    /// What it does.
    pub(super) operation: Operation,
    /// Its points.
    pub(super) points: Vec<Vec2>,
    /// Whether it only turns a blade in the margin.
    pub(super) aligns: bool,
}

/// How far the cut is from the layout.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Fit {
    /// Farthest that a cut reaches into a part, mm.
    pub(super) into: f64,
    /// Farthest that a cut is from the contour that it belongs to, mm, where the tool can reach and no web is meant.
    pub(super) short: f64,
    /// Length of contours that no cut reaches beyond the webs meant, mm.
    pub(super) uncut: f64,
}

impl Fit {
    fn merge(self, other: Self) -> Self {
        Self { into: self.into.max(other.into), short: self.short.max(other.short), uncut: self.uncut + other.uncut }
    }

    /// The worse of both directions, mm.
    pub(super) fn worst(&self) -> f64 {
        self.into.max(self.short)
    }
}

/// What the tip of a trailing blade cuts: it turns by what it is dragged through, also from one stroke to the next, and
/// lies at first as a blade lies that was put in anyhow: across.
fn tips(cuts: &[Cut], offset: f64) -> Vec<Cut> {
    let mut behind = Vec2::new(0.0, -offset);
    cuts.iter()
        .map(|it| {
            let points = trail(&it.points, offset, it.points[0] + behind, STEP);
            behind = points[points.len() - 1] - it.points[it.points.len() - 1];
            Cut { points, ..it.clone() }
        })
        .collect()
}

/// Compares the strokes of a program with the contours of its sheet.
pub(super) fn compare(cuts: &[Cut], sheet: &Sheet, machine: &Machine) -> Fit {
    let blade = machine.knife.filter(|it| machine.kind == MachineKind::DragKnife && it.offset.mm > 0.0);
    let by_blade = |it: &&Cut| machine.tools.get(it.operation).is_some_and(|it| machine.is_blade(it));
    let cutting: Vec<Cut> = match blade {
        // What else the blade does turns it as well.
        Some(knife) => {
            let dragged: Vec<Cut> = cuts.iter().filter(by_blade).cloned().collect();
            tips(&dragged, knife.offset.mm)
        }
        None => cuts.to_vec(),
    };
    let cutting: Vec<Cut> = cutting.into_iter().filter(|it| it.operation.is_cut() && it.points.len() > 1).collect();
    let lines: Vec<Vec<Vec2>> = cutting.iter().map(|it| it.points.clone()).collect();
    let contours: Vec<Vec<Vec2>> = sheet.parts.iter().flat_map(|it| it.contours.iter().cloned()).collect();
    if lines.is_empty() || contours.is_empty() {
        return Fit::default();
    }
    let (cut, outline) = (SegmentTree::of_polylines(&lines), SegmentTree::of_contours(&contours));
    let mut fit = Fit::default();
    let parts: Vec<_> = sheet.parts.iter().map(|it| (Box2::of(it.contours.iter().flatten()), it)).collect();
    let half = |operation| machine.tools.get(operation).map_or(0.0, |it| it.kerf.mm / 2.0);
    for part in &sheet.parts {
        for (k, contour) in part.contours.iter().enumerate() {
            let operation = if k == 0 { Operation::CutOutside } else { Operation::CutInside };
            if machine.tools.get(operation).is_some() {
                // The tool leaves a little more than the web itself at either end, and samples stand for their length.
                let webs = machine.tools[operation]
                    .bridges
                    .map_or(0.0, |it| f64::from(it.count) * (it.width.mm + 2.0 * half(operation) + 2.0 * SAMPLE));
                fit = fit.merge(reached(contour, &cut, &outline, half(operation), webs));
            }
        }
    }
    // Beside the outlines a cut may lie anywhere in the waste, so only what it takes from a part counts.
    for it in &cutting {
        let leads = machine.tools[it.operation].lead.mm > 0.0;
        for p in samples(&it.points, false) {
            let Some((_, near)) = outline.nearest(p) else { continue };
            let distance = (near - p).norm();
            let inside = parts
                .iter()
                .any(|(bounds, part)| bounds.distance(&Box2 { min: p, max: p }) == 0.0 && contains(&part.contours, p));
            let wanted = half(it.operation);
            let into = if inside { wanted + distance } else { wanted - distance };
            fit.into = fit.into.max(into);
            if !inside && !leads && !it.aligns {
                fit.short = fit.short.max(distance - wanted);
            }
        }
    }
    fit
}

/// The corners of a line and points between them.
fn samples(points: &[Vec2], closed: bool) -> impl Iterator<Item = Vec2> + '_ {
    let pairs = edges(points).take(if closed { points.len() } else { points.len().saturating_sub(1) });
    pairs.flat_map(|(a, b)| {
        let n = ((b - a).norm() / SAMPLE).ceil().max(1.0) as usize;
        (0..n).map(move |k| a + (b - a) * (k as f64 / n as f64))
    })
}

/// How well a contour is cut along its length. Contours have their part on the left, so the tool is on the right; where
/// a round one does not fit without cutting elsewhere, it leaves a fillet, which is no fault.
fn reached(contour: &[Vec2], cut: &SegmentTree, outline: &SegmentTree, half: f64, webs: f64) -> Fit {
    let mut fit = Fit::default();
    for (a, b) in edges(contour) {
        let length = (b - a).norm();
        let steps = (length / SAMPLE).ceil().max(1.0) as usize;
        let right = Vec2::new(b.y - a.y, a.x - b.x) / length.max(f64::MIN_POSITIVE);
        for k in 0..steps {
            let p = a + (b - a) * ((k as f64 + 0.5) / steps as f64);
            let tool = p + right * half;
            let fits = half == 0.0 || outline.nearest(tool).is_none_or(|(_, near)| (near - tool).norm() > half - 1e-3);
            let Some((_, near)) = cut.nearest(p) else { continue };
            let short = (near - p).norm() - half;
            // The tool leaves a fillet in a corner; where it keeps farther away than in any blunt one, the part still hangs there.
            let hangs = !fits && short > 3.0 * half + LIMIT;
            if hangs || webs > 0.0 && fits && short > WEB {
                fit.uncut += length / steps as f64;
            } else if fits {
                fit.short = fit.short.max(short);
            }
        }
    }
    fit.uncut = (fit.uncut - webs).max(0.0);
    fit
}
