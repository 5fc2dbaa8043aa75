//! Reads the written files back and compares them, line by line, with the nouns that they were made from. Writers and
//! readers share no code.
use std::collections::BTreeMap;

use crate::{
    emit::{CHECK_LAYER, CHORD, File, Nouns, Subject, booklet::PAGE},
    geom::{Vec2, arcs::ArcPath, outline::check_outline, signed_area},
    import::{
        self, Drawing, DrawnLine,
        gcode::{self, Sense, Spindle},
    },
    model::{Line, Part, Toolpath},
    profile::{Dialect, Head, Machine, Profiles},
    stage::Check,
    stages::sphere::stage::certificate,
};

/// How far a drawing may be from the layout, mm.
const LIMIT: f64 = 1e-3;
/// Half the diagonal of a plotter unit of 0.025 mm.
const PLOTTER_LIMIT: f64 = 0.018;
/// The middle of an arc feels the rounding of its ends and, turned by up to a quarter, of its centre: with half a step in
/// each coordinate at most (1 + 1 + √2) √2 / 2 = 2.4 steps of the last decimal.
const MIDDLE: f64 = 2.5;
/// Ends of strokes nearer than this are of the same stroke, mm.
const APART: f64 = 0.1;
/// GRBL refuses lines of 80 characters and more.
const LONGEST_LINE: usize = 79;

/// One check per format, `files.svg` and so on: the largest distance between a point as it was meant and as it was
/// written. Anything else that is wrong (a line too many, in another order, on another layer, a program that leaves the
/// tool on) fails the check with a note. `files` carry the bytes as they were read back.
pub fn verify(files: &[File], nouns: &Nouns<'_>, profiles: &Profiles) -> Vec<Check> {
    let mut findings: BTreeMap<&str, Finding> = BTreeMap::new();
    for file in files {
        let found = compare(file, nouns, profiles);
        let finding = findings.entry(file.format).or_default();
        finding.files += 1;
        match found {
            Ok(deviation) => finding.worst = finding.worst.max(deviation),
            Err(fault) => finding.faults.push(format!("{}: {fault}", file.path)),
        }
    }
    let check = |(format, finding): (&str, Finding)| {
        let limit = match format {
            "gcode" => LIMIT.max(10_f64.powi(-(profiles.machine.decimals as i32))),
            "hpgl" => PLOTTER_LIMIT,
            _ => LIMIT,
        };
        let mut note = format!("{} files read back", finding.files);
        if let [first, rest @ ..] = finding.faults.as_slice() {
            note = format!("{first} ({} more faults); do not use these files", rest.len());
        }
        let ok = finding.faults.is_empty() && finding.worst <= limit;
        Check { name: format!("files.{format}"), ok, value: finding.worst, limit, unit: "mm".into(), note }
    };
    findings.into_iter().map(check).collect()
}

/// Whether a booklet has as many pages as there are steps, of its size, with marks on each.
pub(super) fn booklet(bytes: &[u8], steps: usize) -> Check {
    let size = Vec2::from(PAGE);
    let (value, note) = match import::read_pdf(bytes) {
        Ok(pages) => {
            let good = |it: &Drawing| !it.lines.is_empty() && it.size.is_some_and(|it| (it - size).amax() <= LIMIT);
            (pages.iter().filter(|it| good(it)).count(), format!("{} pages read back", pages.len()))
        }
        Err(error) => (0, error.to_string()),
    };
    let check = Check::at_least("files.assembly", value as f64, steps as f64, "pages", note);
    Check { ok: value == steps, ..check }
}

/// Whether a map to the sphere, read back, still covers it once without a flipped face, exactly.
pub(super) fn certified(bytes: &[u8]) -> Check {
    match import::mesh::parse(bytes, import::mesh::Format::Obj) {
        Ok(soup) => certificate("files.sphere", &soup.faces, &soup.positions),
        Err(error) => Check::at_most("files.sphere", f64::INFINITY, 0.0, "flipped faces", error.to_string()),
    }
}

#[derive(Default)]
struct Finding {
    files: usize,
    worst: f64,
    faults: Vec<String>,
}

/// Largest distance in one file, or what is wrong with it.
fn compare(file: &File, nouns: &Nouns<'_>, profiles: &Profiles) -> Result<f64, String> {
    let machine = &profiles.machine;
    let text = || std::str::from_utf8(&file.bytes).map_err(|error| error.to_string());
    match file.format {
        "svg" => drawing(&import::read_svg(&file.bytes).map_err(|it| it.to_string())?, file.subject, nouns, machine),
        "dxf" | "dxf-r12" => {
            drawing(&import::read_dxf(&file.bytes).map_err(|it| it.to_string())?, file.subject, nouns, machine)
        }
        "pdf" | "pdf-a4" | "pdf-letter" => {
            let pages = import::read_pdf(&file.bytes).map_err(|it| it.to_string())?;
            match (file.format, pages.as_slice()) {
                ("pdf", [page]) => drawing(page, file.subject, nouns, machine),
                ("pdf", _) => Err(format!("{} pages, expected one", pages.len())),
                (format, _) => tiles(pages, format, file.subject, nouns, machine),
            }
        }
        "gcode" => program(text()?, file.subject, nouns, machine),
        "hpgl" => plot(text()?, file.subject, nouns, machine),
        other => Err(format!("there is no reader for `{other}`")),
    }
}

const NO_NOUN: &str = "shows something that the job did not make";

/// The lines of a sheet or part in the order of the file, the corner of its page in their coordinates, and its size.
fn meant<'a>(subject: Subject, nouns: &Nouns<'a>, machine: &Machine) -> Result<(Vec<Line<'a>>, Vec2, Vec2), String> {
    let (page, mut lines): (Option<Vec2>, Vec<Line<'_>>) = match subject {
        Subject::Sheet(i) => {
            let sheet = nouns.sheets.and_then(|it| it.sheets.get(i)).ok_or(NO_NOUN)?;
            (Some(sheet.size), sheet.parts.iter().flat_map(Part::lines).collect())
        }
        Subject::Part(i) => (None, nouns.parts.and_then(|it| it.parts.get(i)).ok_or(NO_NOUN)?.lines().collect()),
        Subject::Program(_) => return Err(NO_NOUN.into()),
    };
    // Layers in the order of work; operations that share one stand where the first of them does.
    let rank = |line: &Line<'_>| {
        let layer = &machine.layers[line.operation];
        machine.order.iter().position(|it| machine.layers[it] == *layer)
    };
    lines.sort_by_key(|it| (rank(it), machine.order.rank(it.operation)));
    let bounds = crate::geom::Box2::of(lines.iter().flat_map(|it| it.points));
    let (origin, size) = page.map_or((bounds.min, bounds.size()), |size| (Vec2::zeros(), size));
    Ok((lines, origin, size))
}

fn drawing(read: &Drawing, subject: Subject, nouns: &Nouns<'_>, machine: &Machine) -> Result<f64, String> {
    let (lines, origin, size) = meant(subject, nouns, machine)?;
    let room_for_check = matches!(subject, Subject::Sheet(_)) && size.x > 120.0 && size.y > 10.0;
    let worst = read.size.map_or(0.0, |read| (read - size).amax());
    Ok(worst.max(same_lines(read, &lines, origin, room_for_check, machine)?))
}

/// Layers that hold nothing to be cut.
const AIDS: [&str; 2] = [CHECK_LAYER, "TILE"];

/// Largest distance between the lines of a page and those meant, whose corner lies at `origin`. With `checked`, there must
/// be a line of 100 mm on its own layer.
fn same_lines(
    read: &Drawing,
    lines: &[Line<'_>],
    origin: Vec2,
    checked: bool,
    machine: &Machine,
) -> Result<f64, String> {
    if !read.ignored.is_empty() {
        return Err(format!("holds what no machine cuts: {}", read.ignored.join(", ")));
    }
    let (aids, read): (Vec<&DrawnLine>, Vec<&DrawnLine>) =
        read.lines.iter().partition(|it| AIDS.iter().any(|aid| it.layer.eq_ignore_ascii_case(aid)));
    let hundred = |it: &&DrawnLine| it.points.len() == 2 && (it.length() - 100.0).abs() <= LIMIT;
    if checked && !aids.iter().any(hundred) {
        return Err("there is no check line of 100 mm".into());
    }
    if lines.len() != read.len() {
        return Err(format!("{} lines, expected {}", read.len(), lines.len()));
    }
    let mut worst = 0.0_f64;
    for (i, (line, read)) in lines.iter().zip(&read).enumerate() {
        let layer = &machine.layers[line.operation].name;
        if !read.layer.eq_ignore_ascii_case(layer) {
            return Err(format!("line {} is on layer `{}`, expected `{layer}`", i + 1, read.layer));
        }
        if line.closed != read.closed {
            return Err(format!("line {} on layer `{layer}` is closed in one place and open in the other", i + 1));
        }
        let meant: Vec<Vec2> = line.points.iter().map(|it| it - origin).collect();
        worst = worst.max(deviation(&meant, &read.points, line.closed).ok_or_else(|| foreign(i))?);
        if line.operation.is_cut() {
            let mut contour = read.points.clone();
            if signed_area(&contour) < 0.0 {
                contour.reverse();
            }
            check_outline(&[contour]).map_err(|fault| format!("line {} on layer `{layer}`: {fault}", i + 1))?;
        }
    }
    Ok(worst)
}

/// Pages of printer paper: each shows all lines, moved, and together they leave no point out.
fn tiles(
    pages: Vec<Drawing>,
    format: &str,
    subject: Subject,
    nouns: &Nouns<'_>,
    machine: &Machine,
) -> Result<f64, String> {
    /// Printers leave at least this much of the paper free, mm.
    const UNPRINTED: f64 = 5.0;
    let paper = if format == "pdf-a4" { Vec2::new(210.0, 297.0) } else { Vec2::new(215.9, 279.4) };
    let (lines, _, _) = meant(subject, nouns, machine)?;
    let mut worst = 0.0_f64;
    let mut windows = Vec::new();
    for page in &pages {
        let size = page.size.unwrap_or_else(Vec2::zeros);
        worst = worst.max((size - paper).amax().min((size - paper.yx()).amax()));
        let first = page.lines.iter().find(|it| !AIDS.contains(&it.layer.as_str()));
        let (Some(first), Some(line)) = (first, lines.first()) else { return Err("a page without lines".into()) };
        let shift = first.points[0] - line.points[0];
        // Tiles move by whole steps; what is compared is all that is left.
        let shift = shift.map(|it| (it * 1e4).round() / 1e4);
        worst = worst.max(same_lines(page, &lines, -shift, true, machine)?);
        windows.push((Vec2::repeat(UNPRINTED) - shift, size.add_scalar(-UNPRINTED) - shift));
    }
    let shown = |p: &Vec2| windows.iter().any(|(low, high)| p >= low && p <= high);
    match lines.iter().flat_map(|it| it.points).find(|it| !shown(it)) {
        Some(p) => Err(format!("the point ({:.1}, {:.1}) is on no page", p.x, p.y)),
        None => Ok(worst),
    }
}

fn program(text: &str, subject: Subject, nouns: &Nouns<'_>, machine: &Machine) -> Result<f64, String> {
    let read = import::read_gcode(text, Sense::of(&machine.head)).map_err(|it| it.to_string())?;
    if read.longest_line > LONGEST_LINE {
        return Err(format!("a line of {} characters; boards take {LONGEST_LINE}", read.longest_line));
    }
    // Marlin has no end word, and its servo does not need the spindle's.
    let marlin = machine.dialect == Dialect::Marlin;
    let off = read.spindle == Spindle::Off || marlin && !matches!(machine.head, Head::Laser { .. });
    if !(read.ended || marlin) || !off {
        return Err("ends without M5 and M2".into());
    }
    if let Some(line) = read.rapid_at_work {
        return Err(format!("line {line}: a rapid with the tool at work"));
    }
    let strokes = read.strokes();
    let straight: Vec<Vec<Vec2>> = strokes.iter().map(|it| gcode::ends(it)).collect();
    if !machine.arcs {
        return paths(&straight, subject, nouns, machine, |path| path.chords(CHORD), |_| true);
    }
    let round: Vec<Vec<Vec2>> = strokes.iter().map(|it| gcode::marks(it)).collect();
    let ends = paths(&straight, subject, nouns, machine, |path| path.points.clone(), |_| true)?;
    let middles = paths(&round, subject, nouns, machine, ArcPath::marks, |_| true)?;
    Ok(ends.max(middles / MIDDLE))
}

fn plot(text: &str, subject: Subject, nouns: &Nouns<'_>, machine: &Machine) -> Result<f64, String> {
    let read = import::read_hpgl(text).map_err(|it| it.to_string())?;
    let strokes: Vec<Vec<Vec2>> = read
        .lines
        .into_iter()
        .map(|mut line| {
            line.points.extend(line.closed.then(|| line.points[0]));
            line.points
        })
        .collect();
    // What is shorter than a plotter unit is a dot.
    let marks = |path: &ArcPath| path.chords(CHORD);
    paths(&strokes, subject, nouns, machine, marks, |points| points.iter().any(|it| (it - points[0]).amax() > 0.025))
}

/// Strokes in the machine's frame against the toolpaths that `kept` selects.
fn paths(
    strokes: &[Vec<Vec2>],
    subject: Subject,
    nouns: &Nouns<'_>,
    machine: &Machine,
    marks: impl Fn(&ArcPath) -> Vec<Vec2>,
    kept: impl Fn(&[Vec2]) -> bool,
) -> Result<f64, String> {
    let Subject::Program(i) = subject else { return Err(NO_NOUN.into()) };
    let sheet = nouns.toolpaths.and_then(|it| it.sheets.get(i)).ok_or(NO_NOUN)?;
    let done = sheet.strokes().filter(|it| machine.tools.get(it[0].operation).is_some());
    let whole = |paths: &[Toolpath]| {
        let mut whole = ArcPath::default();
        paths.iter().for_each(|it| whole.append(&it.path));
        whole
    };
    let expected: Vec<Vec<Vec2>> = done.map(|it| marks(&whole(it))).filter(|it| kept(it)).collect();
    if expected.len() != strokes.len() {
        let place = |it: &Vec2| machine.from_work(*it, sheet.size);
        return Err(miscounted(
            &expected,
            &strokes.iter().map(|it| it.iter().map(place).collect()).collect::<Vec<_>>(),
        ));
    }
    let mut worst = 0.0_f64;
    for (i, (points, stroke)) in expected.iter().zip(strokes).enumerate() {
        let stroke: Vec<Vec2> = stroke.iter().map(|it| machine.from_work(*it, sheet.size)).collect();
        worst = worst.max(deviation(points, &stroke, false).ok_or_else(|| foreign(i))?);
    }
    Ok(worst)
}

/// Says where the first of too many or too few strokes stands.
fn miscounted(expected: &[Vec<Vec2>], read: &[Vec<Vec2>]) -> String {
    let near = |a: Option<&Vec2>, b: Option<&Vec2>| a.zip(b).is_some_and(|(a, b)| (a - b).norm() < APART);
    let same = |(a, b): (&Vec<Vec2>, &Vec<Vec2>)| near(a.first(), b.first()) && near(a.last(), b.last());
    let first = expected.iter().zip(read).position(|it| !same(it)).unwrap_or(expected.len().min(read.len()));
    let place = expected.get(first).or(read.get(first)).and_then(|it| it.first());
    let place = place.map_or(String::new(), |it| format!(" ({:.2}, {:.2})", it.x, it.y));
    let (found, meant) = (read.len(), expected.len());
    format!("{found} strokes, expected {meant}; the first that differs is number {} at{place}", first + 1)
}

fn foreign(index: usize) -> String {
    format!("line {} has points that were not meant", index + 1)
}

/// Largest distance between points as meant and as read, in order; a read point may stand for several that fell together
/// when they were rounded. `None` when read points are left over.
fn deviation(meant: &[Vec2], read: &[Vec2], closed: bool) -> Option<f64> {
    let mut at = 0;
    let mut worst = 0.0_f64;
    for (i, point) in meant.iter().enumerate() {
        let distance = |at: usize| match read.get(at) {
            Some(it) => (point - it).norm(),
            None if closed && !read.is_empty() => (point - read[0]).norm(),
            None => f64::INFINITY,
        };
        if i > 0 && distance(at + 1) < distance(at) {
            at += 1;
        }
        worst = worst.max(distance(at));
    }
    (at + 1 >= read.len()).then_some(worst)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(list: &[(f64, f64)]) -> Vec<Vec2> {
        list.iter().map(|&(x, y)| Vec2::new(x, y)).collect()
    }

    #[test]
    fn deviation_follows_the_order_of_points() {
        let square = points(&[(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]);
        assert_eq!(deviation(&square, &square, true), Some(0.0));
        let mut off = square.clone();
        off[2].x += 0.01;
        assert!((deviation(&square, &off, true).unwrap() - 0.01).abs() < 1e-12);
        // Points that fell together when rounded, at the end of a closed line too.
        let fine = points(&[(0.0, 0.0), (1e-6, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0), (0.0, 1e-6)]);
        assert!(deviation(&fine, &square, true).unwrap() < 2e-6);
        let early: Vec<Vec2> = std::iter::once(Vec2::new(-1.0, 0.0)).chain(square.iter().copied()).collect();
        assert!(deviation(&square, &early, true).is_none_or(|it| it > 0.5));
        // A corner cut off, a corner too many, the other way round.
        assert!(deviation(&square, &square[..3], true).unwrap() > 0.5);
        let more = points(&[(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0), (0.0, 0.5)]);
        assert_eq!(deviation(&square, &more, true), None);
        let back: Vec<Vec2> = square.iter().rev().copied().collect();
        assert!(deviation(&square, &back, true).is_none_or(|it| it > 0.5));
        // A doubled point in the middle of what was meant.
        let spike = points(&[(0.0, 0.0), (1.0, 0.0), (5.0, 0.0), (1.0, 1.0), (0.0, 1.0)]);
        assert!(deviation(&square, &spike, true).is_none_or(|it| it > 0.5));
    }
}
