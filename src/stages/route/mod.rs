//! Sheets → toolpaths: what is done in which order, from where, and how long it takes.
//!
//! Marks come first, each operation in the machine's order; then the cuts, every contour before the one that encloses it
//! (holes before outlines, and parts that lie in a hole before that hole), because a part that has come free may move.
//! Within that freedom travel is made short (`order`).

mod knife;
mod order;
pub mod stage;
#[cfg(test)]
mod tests;
mod time;

pub use knife::Knife;
pub use time::Dynamics;

use crate::{
    geom::{Vec2, polyline::simplify, polyline_length},
    model::{Operation, Part, SheetPaths, Sheets, Toolpath, Toolpaths},
    numeric::{Cancelled, Monitor},
};
use order::{Item, Visit};

/// Ends of open lines nearer than this are the same point, and the tool stays down from one line to the next, mm.
const JOIN: f64 = 1e-3;
/// A path may leave the bed by this much of rounding, mm.
const ROUNDING: f64 = 1e-9;

/// How the machine does an operation.
#[derive(Debug, Clone, PartialEq)]
pub struct Tool {
    /// The operation.
    pub operation: Operation,
    /// Speed at work, mm/s.
    pub feed: f64,
    /// How often a path is run.
    pub passes: u32,
    /// Whether a trailing blade does it.
    pub blade: bool,
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
    /// Points within this of the line between their neighbours are dropped, mm.
    pub tolerance: f64,
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
    };
    for (number, sheet) in sheets.sheets.iter().enumerate() {
        monitor.progress(number as f64 / sheets.sheets.len() as f64, &format!("sheet {}", number + 1));
        let lines = lines(&sheet.parts, options);
        let home = sheet.size.component_mul(&options.home);
        let mut paths: Vec<Toolpath> = Vec::new();
        let mut at = home;
        for phase in phases(options) {
            let chosen: Vec<&Line> = lines.iter().filter(|it| phase.contains(&it.operation)).collect();
            let items: Vec<Item> = chosen.iter().map(|it| it.item.clone()).collect();
            let items = if phase[0].is_cut() { order::enclosed(items) } else { items };
            let tour = order::tour(&items, at, monitor)?;
            let walked = tour.iter().map(|visit| walk(chosen[visit.item], visit)).collect();
            for path in join(walked) {
                let tool = options.tools.iter().find(|it| it.operation == path.operation);
                paths.extend(run(
                    path,
                    tool.expect("phases hold only operations of the tools"),
                    options.knife.as_ref(),
                ));
            }
            at = paths.last().and_then(|it| it.points.last()).copied().unwrap_or(at);
        }
        let outside = |p: &Vec2| {
            let low = p.min() < -ROUNDING;
            low || p.x > options.bed.x + ROUNDING || p.y > options.bed.y + ROUNDING
        };
        for path in &paths {
            if let Some(&place) = path.points.iter().find(|p| outside(p)) {
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
    item: Item,
}

/// All lines of a sheet, without points that carry no shape.
fn lines(parts: &[Part], options: &Options) -> Vec<Line> {
    let mut lines = Vec::new();
    for part in parts {
        let mut add = |operation, points: &[Vec2], closed| {
            let kept = simplify(points, closed, options.tolerance, &|_| false);
            // A contour must stay one, however small it is.
            let points =
                if closed && kept.len() < 3 { points.to_vec() } else { kept.iter().map(|&i| points[i]).collect() };
            lines.push(Line { operation, part: part.name.clone(), item: Item { points, closed, inside: None } });
        };
        for mark in &part.marks {
            add(mark.operation, &mark.points, mark.closed);
        }
        for (k, contour) in part.contours.iter().enumerate() {
            add(if k == 0 { Operation::CutOutside } else { Operation::CutInside }, contour, true);
        }
    }
    lines
}

/// Operations done together, in turn: every mark on its own, then all cuts at once, ordered by what encloses what.
fn phases(options: &Options) -> Vec<Vec<Operation>> {
    let operations = || options.tools.iter().map(|it| it.operation);
    let mut phases: Vec<Vec<Operation>> = operations().filter(|it| !it.is_cut()).map(|it| vec![it]).collect();
    let cuts: Vec<Operation> = operations().filter(|it| it.is_cut()).collect();
    if !cuts.is_empty() {
        phases.push(cuts);
    }
    phases
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

/// The line as it is run: closed ones from their entry round to it again, open ones perhaps backwards.
fn walk(line: &Line, visit: &Visit) -> (Toolpath, bool) {
    let mut points = line.item.points.clone();
    if line.item.closed {
        points.rotate_left(visit.entry);
        points.push(points[0]);
    } else if visit.entry > 0 {
        points.reverse();
    }
    (Toolpath { operation: line.operation, points, part: line.part.clone() }, line.item.closed)
}

/// Open lines of one part that follow each other without a gap become one.
fn join(walked: Vec<(Toolpath, bool)>) -> Vec<Toolpath> {
    let mut joined: Vec<(Toolpath, bool)> = Vec::new();
    for (path, closed) in walked {
        match joined.last_mut() {
            Some((last, false))
                if !closed
                    && (last.operation, &last.part) == (path.operation, &path.part)
                    && (last.points[last.points.len() - 1] - path.points[0]).norm() < JOIN =>
            {
                last.points.extend_from_slice(&path.points[1..]);
            }
            _ => joined.push((path, closed)),
        }
    }
    joined.into_iter().map(|it| it.0).collect()
}

/// A path in all its passes, led by the blade's axis where a blade does it.
fn run(path: Toolpath, tool: &Tool, knife: Option<&Knife>) -> Vec<Toolpath> {
    let closed = path.points.first() == path.points.last();
    let mut points = path.points.clone();
    let mut repeats = tool.passes.max(1);
    if closed {
        for _ in 1..repeats {
            points.extend_from_slice(&path.points[1..]);
        }
        repeats = 1;
    }
    if let Some(knife) = knife.filter(|_| tool.blade) {
        points = knife.lead(&points, closed);
    }
    vec![Toolpath { points, ..path }; repeats as usize]
}

/// Adds a sheet to the sums of the job.
fn total(job: &mut Toolpaths, paths: &[Toolpath], home: Vec2, options: &Options) {
    let mut at = home;
    for path in paths {
        let (first, last) = (path.points[0], path.points[path.points.len() - 1]);
        let tool = options.tools.iter().find(|it| it.operation == path.operation);
        job.cut_length += polyline_length(&path.points, false);
        job.travel_length += (first - at).norm();
        job.lifts += 1;
        job.seconds += options.dynamics.travel((first - at).norm()) + options.dynamics.lift;
        job.seconds += tool.map_or(0.0, |it| options.dynamics.along(&path.points, it.feed));
        at = last;
    }
    job.travel_length += (home - at).norm();
    job.seconds += options.dynamics.travel((home - at).norm());
}
