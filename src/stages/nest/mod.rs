//! Parts → sheets: irregular parts placed on rectangular stock without overlap.
//!
//! A first packing comes from bottom-left filling on a grid of bits (`raster`). Then the room is made smaller again and
//! again (`pack`), and the parts, which now overlap, are taken apart by guided local search (`separate`, `overlap`). The
//! result is measured in f64 on the contours themselves before it is handed out; the first packing stands in if it fails.

mod measure;
mod overlap;
mod pack;
mod raster;
mod separate;
mod shape;
pub mod stage;
#[cfg(test)]
mod tests;

use rayon::prelude::*;

pub use measure::{Clearances, measure};
use pack::{Budget, Packing, pack};
use raster::{Grid, Place, Stamp};
use separate::Lie;
use shape::Prepared;

use crate::{
    geom::{
        Vec2,
        polygon::{area, bounds_turned, convex_hull, least_box_angle, turned},
    },
    model::{Mark, Part, Parts, Placement, Sheet, Sheets},
    numeric::{Cancelled, Monitor, random::Random},
};

/// Added to the gap on the grid so that rounding in f64 cannot eat into it, mm.
const SAFETY: f64 = 1e-7;
/// Angles between which a part that fits at none of its usual ones is tried on an empty sheet.
const FINE_ANGLES: usize = 360;
/// A lower position of a part is worth two more angles when it is below this share of the height at the others.
const LOWER: f64 = 0.97;
/// How much more than half the gap shapes are grown so that they can be simplified: a share of the gap, and at least a share
/// of the room.
const TOLERANCE: (f64, f64) = (0.1, 1e-5);
/// A margin may be missed by this much of rounding, mm.
const ROUNDING: f64 = 1e-9;

/// Angles at which a part may lie.
#[derive(Debug, Clone, PartialEq)]
pub enum Rotations {
    /// Any: that many equal steps of a turn, counted from the angle of the part's smallest box.
    Free(usize),
    /// These, radians.
    Only(Vec<f64>),
}

/// Plain options of the kernel, mm.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// Sheets of stock in the order in which they are used; of the last one there are as many as it takes.
    pub stock: Vec<Vec2>,
    /// Kept free along the edges of a sheet.
    pub margin: f64,
    /// Kept free between parts.
    pub gap: f64,
    /// Angles allowed.
    pub rotations: Rotations,
    /// Angles allowed to single parts, by name, instead.
    pub part_rotations: Vec<(String, Rotations)>,
    /// Side of a cell of the grid of the first packing.
    pub cell: f64,
    /// How long to search, in thousands of pairs of parts that are tested; 0 for the first packing only.
    pub effort: usize,
    /// Give up the search after so many seconds, whatever the effort: the result may then differ from run to run.
    pub seconds: Option<f64>,
    /// Seed.
    pub seed: u64,
}

impl Options {
    /// Usable size of a sheet, by its number from 0.
    fn room(&self, sheet: usize) -> Vec2 {
        self.stock[sheet.min(self.stock.len() - 1)].add_scalar(-2.0 * self.margin)
    }

    /// The size that any part fits that fits at all.
    fn largest_room(&self) -> Vec2 {
        let sizes = (0..self.stock.len()).map(|k| self.room(k));
        sizes.max_by(|a, b| (a.x * a.y).total_cmp(&(b.x * b.y))).unwrap_or_else(Vec2::zeros)
    }
}

/// Why nothing was nested. A part that is too large goes to [`Sheets::unplaced`] instead.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum NestError {
    /// The margins eat the sheet.
    #[error("a sheet of {} × {} mm has no room inside margins of {margin} mm; use larger stock or a smaller margin", sheet.x, sheet.y)]
    NoRoom {
        /// The stock.
        sheet: Vec2,
        /// The margin.
        margin: f64,
    },
    /// A part has no contour, or coordinates that are not finite.
    #[error("part {name} has no outline that can be placed")]
    BadPart {
        /// The part.
        name: String,
    },
    /// A part that was asked for by name is not there.
    #[error("there is no part `{name}`; there are {known}")]
    UnknownPart {
        /// The name.
        name: String,
        /// The names that there are.
        known: String,
    },
    /// The run was interrupted.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// One part on one sheet of a trial.
#[derive(Debug, Clone, Copy)]
struct Put {
    part: usize,
    stamp: usize,
    place: Place,
}

/// A trial: the parts on each sheet.
#[derive(Debug, Clone, Default)]
struct Trial {
    sheets: Vec<Vec<Put>>,
    /// Height of the last sheet that is used, mm.
    height: f64,
}

impl Trial {
    /// Fewer sheets are better, then less of the last one.
    fn score(&self) -> (usize, f64) {
        (self.sheets.len(), self.height)
    }
}

/// Places the parts on as few sheets as the search finds.
pub fn nest(parts: &Parts, options: &Options, monitor: &Monitor) -> Result<Sheets, NestError> {
    if options.stock.is_empty() {
        return Err(NestError::NoRoom { sheet: Vec2::zeros(), margin: options.margin });
    }
    for (number, &sheet) in options.stock.iter().enumerate() {
        if !(options.room(number).min() > 0.0) {
            return Err(NestError::NoRoom { sheet, margin: options.margin });
        }
    }
    let broken = |part: &&Part| {
        let outline = part.contours.first().is_some_and(|it| it.len() > 2);
        !outline || !part.contours.iter().flatten().all(|p| p.x.is_finite() && p.y.is_finite())
    };
    if let Some(part) = parts.parts.iter().find(broken) {
        return Err(NestError::BadPart { name: part.name.clone() });
    }
    let room = options.largest_room();
    let footprints: Vec<&[Vec<Vec2>]> = parts.parts.iter().map(|it| it.contours.as_slice()).collect();
    let allowed = |part: &Part| {
        let own = options.part_rotations.iter().find(|it| it.0 == part.name);
        own.map_or(&options.rotations, |it| &it.1)
    };
    let angles: Vec<Vec<f64>> =
        parts.parts.iter().zip(&footprints).map(|(part, it)| angles(it, room, allowed(part))).collect();
    let stamps: Vec<Vec<Stamp>> =
        footprints.par_iter().zip(&angles).map(|(footprint, angles)| stamps(footprint, angles, options)).collect();
    let placeable: Vec<usize> = (0..parts.parts.len()).filter(|&i| !stamps[i].is_empty()).collect();
    let unplaced =
        (0..parts.parts.len()).filter(|&i| stamps[i].is_empty()).map(|i| too_large(&parts.parts[i], room)).collect();
    let first = search(&parts.parts, &stamps, &placeable, options, monitor)?;
    let first: Vec<Vec<Placement>> =
        first.sheets.iter().map(|puts| puts.iter().map(|it| lay(it, &stamps, options)).collect()).collect();
    let made = |placements: Vec<Vec<Placement>>| {
        let sheet = |(number, placements): (usize, Vec<Placement>)| Sheet {
            size: options.stock[number.min(options.stock.len() - 1)],
            parts: placements.iter().map(|it| placed(&parts.parts[it.part], it)).collect(),
            placements,
        };
        let sheets = placements.into_iter().enumerate().map(sheet).collect();
        Sheets { sheets, margin: options.margin, gap: options.gap, unplaced: Vec::clone(&unplaced) }
    };
    if options.effort > 0 && placeable.len() > 1 {
        let better = improve(&footprints, &angles, &first, options, monitor)?.map(made);
        // Shapes were grown and simplified with room to spare; what counts is what is measured in the end.
        if let Some(better) = better.filter(keeps_its_promise) {
            return Ok(better);
        }
    }
    Ok(made(first))
}

/// Where a put of the first packing lies on its sheet.
fn lay(put: &Put, stamps: &[Vec<Stamp>], options: &Options) -> Placement {
    let stamp = &stamps[put.part][put.stamp];
    let at = Vec2::new(put.place.column as f64, put.place.row as f64) * options.cell;
    Placement { part: put.part, angle: stamp.angle, offset: at.add_scalar(options.margin) - stamp.corner }
}

/// The packing after the search; `None` when it is no better than the first one.
fn improve(
    footprints: &[&[Vec<Vec2>]],
    angles: &[Vec<f64>],
    first: &[Vec<Placement>],
    options: &Options,
    monitor: &Monitor,
) -> Result<Option<Vec<Vec<Placement>>>, NestError> {
    let tolerance = (TOLERANCE.0 * options.gap).max(TOLERANCE.1 * options.largest_room().max());
    let laid: Vec<(usize, &Placement)> =
        first.iter().enumerate().flat_map(|(sheet, it)| it.iter().map(move |it| (sheet, it))).collect();
    let parts: Vec<Prepared> = laid
        .par_iter()
        .map(|(_, it)| Prepared::new(footprints[it.part], &angles[it.part], options.gap / 2.0, tolerance))
        .collect();
    let areas: Vec<f64> = laid.iter().map(|(_, it)| area(footprints[it.part])).collect();
    let lie = |(&(sheet, it), part): (&(usize, &Placement), &Prepared)| {
        let shape = part.shapes.iter().position(|shape| shape.angle == it.angle).unwrap_or(0);
        Lie { sheet, shape, at: it.offset.add_scalar(-options.margin) - part.shapes[shape].shift }
    };
    let lies: Vec<Lie> = laid.iter().zip(&parts).map(lie).collect();
    let top = |i: usize| lies[i].at.y + parts[i].shapes[lies[i].shape].bounds.max.y;
    let height = (0..lies.len()).filter(|&i| lies[i].sheet + 1 == first.len()).map(top).fold(0.0, f64::max);
    let begun = monitor.seconds();
    let time = || options.seconds.map_or(0.0, |it| (monitor.seconds() - begun) / it.max(1e-3));
    let budget = Budget { tests: options.effort as u64 * 1000, time: &time };
    let start = Packing { lies, sheets: first.len(), height };
    let random = Random::new(options.seed);
    let found = pack(&parts, &areas, &|k| options.room(k), start, random, &budget, monitor)?;
    let Some(found) = found.filter(|it| (it.sheets, it.height) < (first.len(), height)) else { return Ok(None) };
    let mut sheets = vec![Vec::new(); found.sheets];
    for ((lie, part), (_, it)) in found.lies.iter().zip(&parts).zip(&laid) {
        let shape = &part.shapes[lie.shape];
        let offset = (lie.at + shape.shift).add_scalar(options.margin);
        sheets[lie.sheet].push(Placement { part: it.part, angle: shape.angle, offset });
    }
    Ok(Some(sheets))
}

/// Whether nothing overlaps and gap and margin are kept.
fn keeps_its_promise(sheets: &Sheets) -> bool {
    let found = measure(sheets);
    found.overlaps.is_empty()
        && found.gap.is_none_or(|it| it.0 >= sheets.gap)
        && found.margin.is_none_or(|it| it.0 >= sheets.margin - ROUNDING)
}

/// A part where its placement puts it.
fn placed(part: &Part, placement: &Placement) -> Part {
    let go = |points: &[Vec2]| points.iter().map(|&p| turned(p, placement.angle) + placement.offset).collect();
    Part {
        name: part.name.clone(),
        contours: part.contours.iter().map(|it| go(it)).collect(),
        marks: part.marks.iter().map(|it| Mark { points: go(&it.points), ..*it }).collect(),
    }
}

/// The allowed angles at which a footprint fits on an empty sheet.
fn angles(footprint: &[Vec<Vec2>], room: Vec2, rotations: &Rotations) -> Vec<f64> {
    let hull = convex_hull(&footprint.concat());
    let fits = |angle: &f64| {
        let size = bounds_turned(&hull, *angle).size();
        size.x <= room.x && size.y <= room.y
    };
    let mut angles: Vec<f64> = match rotations {
        Rotations::Only(angles) => angles.clone(),
        Rotations::Free(steps) => fan(least_box_angle(&footprint[0]), *steps).collect(),
    };
    angles.retain(fits);
    if matches!(rotations, Rotations::Free(_)) {
        // No strip is lower than a part on it, so that a part nearly as large as the room must be able to lie low.
        let height = |angle: &f64| bounds_turned(&hull, *angle).size().y;
        let lowest = fan(0.0, FINE_ANGLES).filter(fits).min_by(|a, b| height(a).total_cmp(&height(b)));
        let lower = lowest.filter(|it| angles.iter().all(|other| height(it) < LOWER * height(other)));
        angles.extend(lower.iter().flat_map(|&it| [it, it + std::f64::consts::PI]));
    }
    angles
}

/// The footprint at every angle.
fn stamps(footprint: &[Vec<Vec2>], angles: &[f64], options: &Options) -> Vec<Stamp> {
    let stamp = |&angle: &f64| {
        let turn = |it: &Vec<Vec2>| it.iter().map(|&p| turned(p, angle)).collect();
        Stamp::new(footprint.iter().map(turn).collect(), angle, options.cell, options.gap + SAFETY)
    };
    angles.iter().map(stamp).collect()
}

fn fan(first: f64, steps: usize) -> impl Iterator<Item = f64> {
    (0..steps).map(move |k| first + std::f64::consts::TAU * k as f64 / steps as f64)
}

fn too_large(part: &Part, room: Vec2) -> String {
    let size = bounds_turned(&part.contours[0], least_box_angle(&part.contours[0])).size();
    format!(
        "part {} measures {:.1} × {:.1} mm; a sheet has {:.1} × {:.1} mm inside its margins",
        part.name, size.x, size.y, room.x, room.y
    )
}

/// The first packing: the best of several orders by falling size.
fn search(
    parts: &[Part],
    stamps: &[Vec<Stamp>],
    placeable: &[usize],
    options: &Options,
    monitor: &Monitor,
) -> Result<Trial, NestError> {
    let size = |i: usize| bounds_turned(&parts[i].contours[0], least_box_angle(&parts[i].contours[0])).size();
    let falling = |key: &dyn Fn(usize) -> f64| {
        let mut order = placeable.to_vec();
        order.sort_by(|&i, &j| key(j).total_cmp(&key(i)).then(i.cmp(&j)));
        order
    };
    let orders = vec![
        falling(&|i| area(&parts[i].contours)),
        falling(&|i| size(i).x * size(i).y),
        falling(&|i| size(i).x.max(size(i).y)),
        falling(&|i| size(i).x.min(size(i).y)),
    ];
    let trials: Vec<Trial> =
        orders.into_par_iter().map(|order| fill(stamps, &order, options, monitor)).collect::<Result<_, Cancelled>>()?;
    let better = |best: Trial, trial: Trial| if trial.score() < best.score() { trial } else { best };
    Ok(trials.into_iter().reduce(better).unwrap_or_default())
}

/// Puts every part in turn where its top comes lowest, on the first sheet that has room.
fn fill(stamps: &[Vec<Stamp>], order: &[usize], options: &Options, monitor: &Monitor) -> Result<Trial, Cancelled> {
    let mut grids: Vec<Grid> = Vec::new();
    let mut sheets: Vec<Vec<Put>> = Vec::new();
    let mut heights: Vec<f64> = Vec::new();
    for &part in order {
        monitor.check()?;
        // Sheets of several sizes may have to be opened before one is large enough.
        let found = (0..grids.len().max(options.stock.len()) + 1).find_map(|k| {
            let fresh = || Grid::new(options.room(k), options.cell);
            let place = grids.get(k).map_or_else(|| lowest(&fresh(), &stamps[part]), |it| lowest(it, &stamps[part]))?;
            Some((k, place))
        });
        let Some((k, (stamp, place))) = found else { continue };
        while k >= grids.len() {
            grids.push(Grid::new(options.room(grids.len()), options.cell));
            sheets.push(Vec::new());
            heights.push(0.0);
        }
        grids[k].put(&stamps[part][stamp], place);
        sheets[k].push(Put { part, stamp, place });
        heights[k] = heights[k].max(place.row as f64 * options.cell + stamps[part][stamp].size.y);
    }
    Ok(Trial { height: heights.last().copied().unwrap_or(0.0), sheets })
}

/// The angle and place at which a part's top comes lowest.
fn lowest(grid: &Grid, stamps: &[Stamp]) -> Option<(usize, Place)> {
    let mut best = None;
    let mut limit = f64::INFINITY;
    for (k, stamp) in stamps.iter().enumerate() {
        if let Some((place, top)) = grid.lowest(stamp, limit) {
            best = Some((k, place));
            limit = top;
        }
    }
    best
}
