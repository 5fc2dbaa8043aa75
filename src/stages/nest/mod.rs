//! Parts → sheets: irregular parts placed on rectangular stock without overlap.
//!
//! Bottom-left filling on a grid of bits (`raster`) with several angles per part, over many orders of the parts: first by
//! size, then by chance around the best so far. The grid is conservative, so every result keeps the gap; it is measured
//! once more in f64 before it is handed out.

mod measure;
mod raster;
pub mod stage;
#[cfg(test)]
mod tests;

use rayon::prelude::*;

pub use measure::{Clearances, measure};
use raster::{Grid, Place, Stamp};

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
/// Orders tried at a time; a constant, so that the result does not depend on the number of threads.
const BATCH: usize = 4;

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
    /// Stock.
    pub sheet: Vec2,
    /// Kept free along its edges.
    pub margin: f64,
    /// Kept free between parts.
    pub gap: f64,
    /// Angles allowed.
    pub rotations: Rotations,
    /// Side of a cell of the grid.
    pub cell: f64,
    /// Orders of the parts to try beyond the obvious ones.
    pub effort: usize,
    /// Seed.
    pub seed: u64,
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
    order: Vec<usize>,
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
    let room = options.sheet.add_scalar(-2.0 * options.margin);
    if !(room.x > 0.0 && room.y > 0.0) {
        return Err(NestError::NoRoom { sheet: options.sheet, margin: options.margin });
    }
    let finite = |part: &&Part| {
        let outline = part.contours.first().is_some_and(|it| it.len() > 2);
        !outline || !part.contours.iter().flatten().all(|p| p.x.is_finite() && p.y.is_finite())
    };
    if let Some(part) = parts.parts.iter().find(finite) {
        return Err(NestError::BadPart { name: part.name.clone() });
    }
    let stamps: Vec<Vec<Stamp>> = parts.parts.par_iter().map(|it| stamps(it, room, options)).collect();
    let placeable: Vec<usize> = (0..parts.parts.len()).filter(|&i| !stamps[i].is_empty()).collect();
    let unplaced =
        (0..parts.parts.len()).filter(|&i| stamps[i].is_empty()).map(|i| too_large(&parts.parts[i], room)).collect();
    let best = search(&parts.parts, &stamps, &placeable, room, options, monitor)?;
    let sheet = |puts: &Vec<Put>| {
        let (parts, placements) = puts
            .iter()
            .map(|put| {
                let stamp = &stamps[put.part][put.stamp];
                let at = Vec2::new(put.place.column as f64, put.place.row as f64) * options.cell;
                let offset = at.add_scalar(options.margin) - stamp.corner;
                let placement = Placement { part: put.part, angle: stamp.angle, offset };
                (placed(&parts.parts[put.part], &placement), placement)
            })
            .unzip();
        Sheet { size: options.sheet, parts, placements }
    };
    let sheets = best.sheets.iter().map(sheet).collect();
    Ok(Sheets { sheets, margin: options.margin, gap: options.gap, unplaced })
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

/// The part at every allowed angle at which it fits on an empty sheet.
fn stamps(part: &Part, room: Vec2, options: &Options) -> Vec<Stamp> {
    let hull = convex_hull(&part.contours[0]);
    let fits = |angle: &f64| {
        let size = bounds_turned(&hull, *angle).size();
        size.x <= room.x && size.y <= room.y
    };
    let mut angles: Vec<f64> = match &options.rotations {
        Rotations::Only(angles) => angles.clone(),
        Rotations::Free(steps) => fan(least_box_angle(&part.contours[0]), *steps).collect(),
    };
    angles.retain(fits);
    if angles.is_empty() && matches!(options.rotations, Rotations::Free(_)) {
        angles.extend(fan(0.0, FINE_ANGLES).find(fits));
    }
    let stamp = |angle: f64| {
        let turn = |it: &Vec<Vec2>| it.iter().map(|&p| turned(p, angle)).collect();
        Stamp::new(part.contours.iter().map(turn).collect(), angle, options.cell, options.gap + SAFETY)
    };
    angles.into_iter().map(stamp).collect()
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

/// Tries orders: by falling size in several senses, then the best one with a few parts moved by chance.
fn search(
    parts: &[Part],
    stamps: &[Vec<Stamp>],
    placeable: &[usize],
    room: Vec2,
    options: &Options,
    monitor: &Monitor,
) -> Result<Trial, NestError> {
    let size = |i: usize| bounds_turned(&parts[i].contours[0], least_box_angle(&parts[i].contours[0])).size();
    let falling = |key: &dyn Fn(usize) -> f64| {
        let mut order = placeable.to_vec();
        order.sort_by(|&i, &j| key(j).total_cmp(&key(i)).then(i.cmp(&j)));
        order
    };
    let obvious = vec![
        falling(&|i| area(&parts[i].contours)),
        falling(&|i| size(i).x * size(i).y),
        falling(&|i| size(i).x.max(size(i).y)),
        falling(&|i| size(i).x.min(size(i).y)),
    ];
    let total = obvious.len() + options.effort;
    let try_all = |orders: Vec<Vec<usize>>| -> Result<Vec<Trial>, Cancelled> {
        orders.into_par_iter().map(|order| fill(stamps, order, room, options, monitor)).collect()
    };
    let better = |best: Trial, trial: Trial| if trial.score() < best.score() { trial } else { best };
    let mut done = obvious.len();
    let mut best = try_all(obvious)?.into_iter().reduce(better).unwrap_or_default();
    let mut random = Random::new(options.seed);
    while done < total && placeable.len() > 1 {
        monitor.progress(done as f64 / total as f64, &format!("{} sheets", best.sheets.len()));
        let count = BATCH.min(total - done);
        let orders = (0..count).map(|_| shuffled(&best.order, &mut random)).collect();
        best = try_all(orders)?.into_iter().fold(best, better);
        done += count;
    }
    Ok(best)
}

/// The order with one to three parts moved elsewhere.
fn shuffled(order: &[usize], random: &mut Random) -> Vec<usize> {
    let mut order = order.to_vec();
    for _ in 0..=random.below(3) {
        let part = order.remove(random.below(order.len()));
        order.insert(random.below(order.len() + 1), part);
    }
    order
}

/// Puts every part in turn where its top comes lowest, on the first sheet that has room.
fn fill(
    stamps: &[Vec<Stamp>],
    order: Vec<usize>,
    room: Vec2,
    options: &Options,
    monitor: &Monitor,
) -> Result<Trial, Cancelled> {
    let mut grids: Vec<Grid> = Vec::new();
    let mut sheets: Vec<Vec<Put>> = Vec::new();
    let mut heights: Vec<f64> = Vec::new();
    for &part in &order {
        monitor.check()?;
        let found = (0..=grids.len()).find_map(|k| {
            let place = lowest(grids.get(k).unwrap_or(&Grid::new(room, options.cell)), &stamps[part])?;
            Some((k, place))
        });
        let Some((k, (stamp, place))) = found else { continue };
        if k == grids.len() {
            grids.push(Grid::new(room, options.cell));
            sheets.push(Vec::new());
            heights.push(0.0);
        }
        grids[k].put(&stamps[part][stamp], place);
        sheets[k].push(Put { part, stamp, place });
        heights[k] = heights[k].max(place.row as f64 * options.cell + stamps[part][stamp].size.y);
    }
    Ok(Trial { order, height: heights.last().copied().unwrap_or(0.0), sheets })
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
