//! Sheets → toolpaths: what is done in which order, from where, and how long it takes.
//!
//! Operations come in the machine's order of work: usually all marks and then the cuts, because a part that has come free
//! may move. Of cuts, every contour comes before the one that encloses it (holes before outlines, and parts that lie in a
//! hole before that hole).
//! Within that freedom travel is made short (`order`). Lines become as few straight stretches and arcs as a tolerance
//! allows (`geom::arcs`); cuts lie beside their outline, are entered from the waste and may leave webs (`shape`); a
//! trailing blade is led by its axis (`knife`).

mod knife;
mod order;
mod shape;
pub mod stage;
#[cfg(test)]
mod tests;
mod time;

pub use knife::Knife;
pub use shape::Bridges;
pub use time::Dynamics;

use crate::{
    geom::{
        Vec2,
        arcs::{ArcPath, fit},
        polyline_length,
    },
    model::{Operation, Part, SheetPaths, Sheets, Toolpath, Toolpaths},
    numeric::{Cancelled, Monitor},
};
use order::{Item, Visit};
use shape::Waste;

/// Ends of open lines nearer than this are the same point, and the tool stays down from one line to the next, mm.
const JOIN: f64 = 1e-3;
/// A path may leave the bed by this much of rounding, mm.
const ROUNDING: f64 = 1e-9;
/// Chords of arcs where a polygon is enough: for what encloses what, and whether the bed is left, mm.
const CHORD: f64 = 0.01;
/// Chords of arcs for the estimate of time, mm: GRBL's default (`$12`).
const TIMED: f64 = 0.002;

/// How the machine does an operation.
#[derive(Debug, Clone, PartialEq)]
pub struct Tool {
    /// The operation.
    pub operation: Operation,
    /// Speed at work, mm/s.
    pub feed: f64,
    /// The passes in turn, each with its share of the full depth, in (0, 1].
    pub passes: Vec<f64>,
    /// Whether a trailing blade does it.
    pub blade: bool,
    /// Width of the cut, mm; half of it lies on either side of the path.
    pub kerf: f64,
    /// Radius of the arcs that lead into and out of a closed cut, mm; 0 for none.
    pub lead: f64,
    /// Webs to leave.
    pub bridges: Option<Bridges>,
}

/// Plain options of the kernel.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// What the machine does, in the order of work; other operations are left out.
    pub tools: Vec<Tool>,
    /// Travel of the machine, mm.
    pub bed: Vec2,
    /// Where the tool starts and ends, as a share of the sheet's width and height.
    pub home: Vec2,
    /// Points within this of a straight line are dropped, mm.
    pub tolerance: f64,
    /// Largest distance between a line and the arc that replaces it, mm; 0 for no arcs.
    pub arcs: f64,
    /// The trailing blade, if there is one.
    pub knife: Option<Knife>,
    /// Speeds, for the estimate of time.
    pub dynamics: Dynamics,
}

/// Why there are no toolpaths.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum RouteError {
    /// A point that the machine cannot reach.
    #[error(
        "part {part} on sheet {sheet} needs the tool at ({:.3}, {:.3}), outside the bed of {} × {} mm; set a larger margin \
         or a smaller sheet",
        place.x, place.y, bed.x, bed.y
    )]
    OutsideBed {
        /// Number of the sheet, from 1.
        sheet: usize,
        /// The part.
        part: String,
        /// The point, mm.
        place: Vec2,
        /// The bed, mm.
        bed: Vec2,
    },
    /// The run was interrupted.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// Toolpaths of all sheets.
pub fn route(sheets: &Sheets, options: &Options, monitor: &Monitor) -> Result<Toolpaths, RouteError> {
    let mut job = Toolpaths {
        sheets: Vec::new(),
        cut_length: 0.0,
        travel_length: 0.0,
        lifts: 0,
        seconds: 0.0,
        left_out: left_out(sheets, options),
        uncompensated: Vec::new(),
    };
    for (number, sheet) in sheets.sheets.iter().enumerate() {
        monitor.progress(number as f64 / sheets.sheets.len() as f64, &format!("sheet {}", number + 1));
        let lines = lines(&sheet.parts, options, &mut job.uncompensated);
        let waste = Waste::of(&sheet.parts);
        let home = sheet.size.component_mul(&options.home);
        let mut paths: Vec<Toolpath> = Vec::new();
        let mut at = home;
        // Where the blade points; unknown after another tool was in the holder.
        let mut blade: Option<Vec2> = None;
        for phase in phases(options) {
            let chosen: Vec<&Line> = lines.iter().filter(|it| phase.contains(&it.operation)).collect();
            let items: Vec<Item> = chosen.iter().map(|it| it.item.clone()).collect();
            let shapes: Vec<Vec<Vec2>> = chosen.iter().map(|it| it.path.chords(CHORD)).collect();
            let items = if phase[0].is_cut() { order::enclosed(items, &shapes) } else { items };
            let tour = order::tour(&items, at, monitor)?;
            let walked = tour.iter().map(|visit| walk(chosen[visit.item], visit)).collect();
            for path in join(walked) {
                let tool = options.tools.iter().find(|it| it.operation == path.operation);
                let tool = tool.expect("phases hold only operations of the tools");
                let knife = options.knife.filter(|_| tool.blade);
                blade = blade.filter(|_| tool.blade);
                if let Some((way, direction)) = knife.filter(|_| blade.is_none()).and_then(|it| {
                    let inward = options.home.map(|it| 1.0 - 2.0 * it);
                    it.alignment(home, inward, sheets.margin)
                }) {
                    let (operation, part) = (path.operation, String::new());
                    paths.push(Toolpath { operation, path: way, depth: 1.0, joined: false, part });
                    blade = Some(direction);
                }
                paths.extend(run(&path, tool, knife.map(|it| (it, &mut blade)), &waste));
            }
            at = paths.last().and_then(|it| it.path.points.last()).copied().unwrap_or(at);
        }
        let outside = |p: &Vec2| {
            let low = p.min() < -ROUNDING;
            low || p.x > options.bed.x + ROUNDING || p.y > options.bed.y + ROUNDING
        };
        for path in &paths {
            if let Some(place) = path.path.chords(CHORD).into_iter().find(|p| outside(p)) {
                return Err(RouteError::OutsideBed {
                    sheet: number + 1,
                    part: path.part.clone(),
                    place,
                    bed: options.bed,
                });
            }
        }
        total(&mut job, &paths, home, options);
        job.sheets.push(SheetPaths { size: sheet.size, paths });
    }
    Ok(job)
}

/// A line of a part with what to do along it.
struct Line {
    operation: Operation,
    part: String,
    path: ArcPath,
    /// Whether the part, or what is in its hole, comes free by it.
    frees: bool,
    item: Item,
}

/// All lines of a sheet as the tool is to follow them.
fn lines(parts: &[Part], options: &Options, uncompensated: &mut Vec<String>) -> Vec<Line> {
    let mut lines = Vec::new();
    for part in parts {
        let mut add = |operation, points: &[Vec2], closed, frees| {
            let path = fit(points, closed, options.tolerance, options.arcs);
            // A contour must stay one, however small it is.
            let path =
                if closed && path.chords(options.tolerance).len() < 4 { fit(points, closed, 0.0, 0.0) } else { path };
            let mut corners = path.points.clone();
            if closed {
                corners.pop();
            }
            let item = Item { points: corners, closed, inside: None };
            lines.push(Line { operation, part: part.name.clone(), path, frees, item });
        };
        for mark in &part.marks {
            add(mark.operation, &mark.points, mark.closed, false);
        }
        for (k, contour) in part.contours.iter().enumerate() {
            let operation = if k == 0 { Operation::CutOutside } else { Operation::CutInside };
            let kerf = options.tools.iter().find(|it| it.operation == operation).map_or(0.0, |it| it.kerf);
            let ways = shape::beside(contour, kerf);
            if ways.is_empty() {
                let at = contour[0];
                uncompensated.push(format!("hole {k} of part {} near ({:.1}, {:.1})", part.name, at.x, at.y));
                add(operation, contour, true, true);
            }
            // Bays that the cut closes off are cut as well, but only waste comes free there.
            let lengths = ways.iter().map(|it| polyline_length(it, true));
            let longest = lengths.enumerate().max_by(|a, b| a.1.total_cmp(&b.1)).map(|it| it.0);
            ways.iter().enumerate().for_each(|(k, it)| add(operation, it, true, longest == Some(k)));
        }
    }
    lines
}

/// Operations done together, in turn: every mark on its own; cuts that follow each other in the order of work at once,
/// ordered by what encloses what.
fn phases(options: &Options) -> Vec<Vec<Operation>> {
    let operations: Vec<Operation> = options.tools.iter().map(|it| it.operation).collect();
    operations.chunk_by(|a, b| a.is_cut() && b.is_cut()).map(<[Operation]>::to_vec).collect()
}

fn left_out(sheets: &Sheets, options: &Options) -> Vec<(Operation, usize)> {
    let missing = Operation::ALL.into_iter().filter(|it| options.tools.iter().all(|tool| tool.operation != *it));
    let parts = || sheets.sheets.iter().flat_map(|it| &it.parts);
    let count = |operation: Operation| match operation {
        Operation::CutOutside => parts().count(),
        Operation::CutInside => parts().map(|it| it.contours.len() - 1).sum(),
        _ => parts().flat_map(|it| &it.marks).filter(|it| it.operation == operation).count(),
    };
    missing.map(|it| (it, count(it))).filter(|it| it.1 > 0).collect()
}

/// A way of the tool before passes, leads and blade are thought of.
struct Way {
    operation: Operation,
    part: String,
    path: ArcPath,
    frees: bool,
    closed: bool,
}

/// The line as it is run: closed ones from their entry round to it again, open ones perhaps backwards.
fn walk(line: &Line, visit: &Visit) -> Way {
    let path = line.path.clone();
    let path = match (line.item.closed, visit.entry) {
        (true, entry) => path.begun_at(entry),
        (false, 0) => path,
        (false, _) => path.reversed(),
    };
    Way { operation: line.operation, part: line.part.clone(), path, frees: line.frees, closed: line.item.closed }
}

/// Open lines of one part that follow each other without a gap become one.
fn join(walked: Vec<Way>) -> Vec<Way> {
    let mut joined: Vec<Way> = Vec::new();
    for way in walked {
        match joined.last_mut() {
            Some(last)
                if !last.closed
                    && !way.closed
                    && (last.operation, &last.part) == (way.operation, &way.part)
                    && (last.path.points[last.path.points.len() - 1] - way.path.points[0]).norm() < JOIN =>
            {
                last.path.append(&way.path);
            }
            _ => joined.push(way),
        }
    }
    joined
}

/// A way in all its passes, with leads and webs, led by the blade's axis where a blade does it. Passes follow each other
/// without a lift where one begins at the end of the other; open ways are run to and fro, except by a blade. A blade that
/// an axis turns (one without an offset) turns in the air.
fn run(way: &Way, tool: &Tool, mut knife: Option<(Knife, &mut Option<Vec2>)>, waste: &Waste<'_>) -> Vec<Toolpath> {
    let drags = knife.is_some();
    let leads = (way.closed && tool.lead > 0.0 && !drags)
        .then(|| shape::leads(&way.path, tool.lead, tool.kerf, waste))
        .flatten();
    let mut out: Vec<Toolpath> = Vec::new();
    let in_air = knife.as_ref().is_some_and(|(it, _)| it.offset == 0.0);
    let mut add = |path: ArcPath, depth: f64| {
        let end = out.last().and_then(|it: &Toolpath| it.path.points.last());
        let joined = !in_air && end.is_some_and(|it| (it - path.points[0]).norm() < JOIN);
        out.push(Toolpath { operation: way.operation, path, depth, joined, part: way.part.clone() });
    };
    for (group, passes) in tool.passes.chunk_by(|a, b| a == b).enumerate() {
        let depth = passes[0];
        let webs = tool.bridges.filter(|it| way.closed && way.frees && depth > it.below);
        let mut rounds = match webs {
            Some(it) => vec![shape::bridged(&way.path, it.count, it.width + tool.kerf); passes.len()],
            None if way.closed => {
                let mut path = way.path.clone();
                (1..passes.len()).for_each(|_| path.append(&way.path));
                vec![vec![path]]
            }
            None => vec![vec![way.path.clone()]; passes.len()],
        };
        for (k, pieces) in rounds.iter_mut().enumerate() {
            if let (Some((into, out)), [first, ..]) = (&leads, pieces.as_mut_slice()) {
                let mut begun = into.clone();
                begun.append(first);
                *first = begun;
                let last = pieces.len() - 1;
                pieces[last].append(out);
            }
            let whole = pieces.len() == 1 && way.closed && leads.is_none();
            for path in pieces {
                let back = !way.closed && !drags && (group + k) % 2 == 1;
                let path = std::mem::take(path);
                let path = if back { path.reversed() } else { path };
                let Some((knife, blade)) = &mut knife else {
                    add(path, depth);
                    continue;
                };
                let (ways, after) = knife.led(&path, whole, **blade);
                **blade = after;
                ways.into_iter().for_each(|(axis, cuts)| add(axis, if cuts { depth } else { 0.0 }));
            }
        }
    }
    out
}

/// Adds a sheet to the sums of the job.
fn total(job: &mut Toolpaths, paths: &[Toolpath], home: Vec2, options: &Options) {
    let mut at = home;
    for Toolpath { operation, path, joined, .. } in paths {
        let (first, last) = (path.points[0], path.points[path.points.len() - 1]);
        let tool = options.tools.iter().find(|it| it.operation == *operation);
        job.cut_length += path.length();
        if !joined {
            job.travel_length += (first - at).norm();
            job.lifts += 1;
            job.seconds += options.dynamics.travel((first - at).norm()) + options.dynamics.lift;
        }
        job.seconds += tool.map_or(0.0, |it| options.dynamics.along(&path.chords(TIMED), it.feed));
        at = last;
    }
    job.travel_length += (home - at).norm();
    job.seconds += options.dynamics.travel((home - at).norm());
}
