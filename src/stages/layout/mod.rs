//! Flat pieces → parts: outlines that can be cut, folds, match marks along seams, and lettering.
//!
//! Both sides of a seam carry the same number at its middle and ticks at the same places of the developed mesh, so that
//! edges of equal length meet point by point (the flattening keeps lengths along seams). Everything is printed on the
//! outer side of the surface, the side that faces up when the outline runs counter-clockwise. A number that finds no room
//! on its part stands beside it on the waste and is named in [`Parts::outside`], except along a slit whose two sides meet at
//! its end and along seams too short to be promised one.

mod folds;
mod join;
mod lettering;
mod outline;
mod rulings;
mod seams;
pub mod stage;
mod tabs;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;

use crate::{
    geom::{Vec2, polygon::area},
    mesh::{HalfedgeId, Id},
    model::{CutMesh, Flattening, Mark, Misfit, Opening, Part, Parts, PieceId},
    numeric::{Cancelled, Monitor},
};
use join::Body;

pub use join::{Holes, Join, Sides, Tabs};

/// Plain options of the kernel; millimetres and radians.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// Seams from this length on must find room for their number, mm; shorter ones have it where it fits.
    pub label_from: f64,
    /// Points of an outline nearer than this are merged.
    pub merge: f64,
    /// Slits narrower than `merge` are opened to this width; each side moves by half of it.
    pub slit: f64,
    /// Edges bent by less are drawn smooth, not as folds.
    pub fold_angle: f64,
    /// Height of seam numbers.
    pub label_height: f64,
    /// Height of piece names.
    pub name_height: f64,
    /// Lettering is made smaller where there is no room, but not smaller than this.
    pub least_height: f64,
    /// Length of match marks.
    pub tick: f64,
    /// Distance of match marks along a seam, about.
    pub tick_spacing: f64,
    /// How pieces are joined.
    pub join: Join,
}

/// Why the stage could not work at all; a single bad piece goes to [`Parts::refused`] instead.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum LayoutError {
    /// The two inputs do not belong together.
    #[error(transparent)]
    Misfit(#[from] Misfit),
    /// The run was interrupted.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// Makes a part of every piece.
pub fn layout(cut: &CutMesh, flat: &Flattening, options: &Options, monitor: &Monitor) -> Result<Parts, LayoutError> {
    flat.fits(cut)?;
    let seams = seams::measure(cut, flat);
    let ends = seams::ends(cut, &seams);
    let mut folds = folds::folds(cut, flat, options.fold_angle);
    let mut loops: BTreeMap<PieceId, Vec<Vec<HalfedgeId>>> = BTreeMap::new();
    for path in cut.mesh.boundary_loops() {
        loops.entry(cut.piece_of[cut.mesh.face(path[0])]).or_default().push(path);
    }
    let mut parts = Parts::default();
    let mut bodies: BTreeMap<PieceId, Body> = BTreeMap::new();
    for (piece, description) in cut.pieces.enumerate() {
        monitor.check()?;
        let piece: PieceId = piece;
        let loops = loops.remove(&piece).unwrap_or_default();
        let raw: Vec<Vec<Vec2>> =
            loops.iter().map(|path| path.iter().map(|&h| flat.uv[cut.mesh.tail(h)]).collect()).collect();
        let keep: Vec<Vec<bool>> =
            loops.iter().map(|path| path.iter().map(|&h| ends[cut.mesh.tail(h)]).collect()).collect();
        let name = description.name.clone();
        match outline::outline(&raw, &keep, options.merge, options.slit) {
            Ok(found) => {
                if found.opened {
                    let lost = area(&raw) - area(&found.contours);
                    parts.openings.push(Opening { part: name.clone(), width: options.slit, area: lost });
                }
                let marks = folds.remove(&piece).unwrap_or_default();
                bodies.insert(piece, Body { name, contours: found.contours, marks });
            }
            Err(reason) => parts.refused.push(format!("piece {name}: {reason}")),
        }
    }
    parts.joints = join::join(&mut bodies, &seams, &options.join, options.merge, monitor)?;
    for (piece, body) in bodies {
        monitor.check()?;
        monitor.progress(piece.index() as f64 / cut.pieces.len() as f64, &body.name);
        let dressed = dress(cut, flat, piece, &body, &seams, options);
        parts.outside.extend(dressed.outside);
        parts.unlabelled.extend(dressed.unlabelled);
        parts.parts.push(Part { name: body.name, contours: body.contours, marks: dressed.marks });
    }
    Ok(parts)
}

/// Marks of one part, and the lettering that found no room in it or not even beside it.
#[derive(Default)]
struct Dressed {
    marks: Vec<Mark>,
    outside: Vec<String>,
    unlabelled: Vec<String>,
}

/// Scales of the lettering of a part to try in turn until everything finds room on it.
const SCALES: [f64; 4] = [1.0, 0.75, 0.6, 0.45];

fn dress(
    cut: &CutMesh,
    flat: &Flattening,
    piece: PieceId,
    body: &Body,
    seams: &[seams::Measured],
    options: &Options,
) -> Dressed {
    let (name, contours) = (&body.name, &body.contours);
    let mut marks = body.marks.clone();
    let ticks = seams::ticks(cut, flat, piece, contours, &marks, seams, options);
    marks.extend(ticks);
    let mut sides: Vec<(&seams::Measured, usize)> =
        seams.iter().flat_map(|it| [(it, 0), (it, 1)]).filter(|(it, side)| it.sides[*side].piece == piece).collect();
    // Short seams have the least choice of places, so they choose first.
    sides.sort_by(|a, b| a.0.length().total_cmp(&b.0.length()));
    // Large letters take the room of others: where one finds none, all of the part are smaller.
    let tries = SCALES.iter().map(|&scale| inscribe(contours, &marks, name, &sides, options, scale));
    let mut best: Option<Dressed> = None;
    for found in tries {
        let missing = |it: &Dressed| (it.unlabelled.len(), it.outside.len());
        if best.as_ref().is_none_or(|it| missing(&found) < missing(it)) {
            best = Some(found);
        }
        if best.as_ref().is_some_and(|it| missing(it) == (0, 0)) {
            break;
        }
    }
    let lettering = best.unwrap_or_default();
    marks.extend(lettering.marks);
    Dressed { marks, ..lettering }
}

/// The lettering of a part at `scale` of its preferred heights. What has no room on the part stands beside it.
fn inscribe(
    contours: &[Vec<Vec2>],
    marks: &[Mark],
    name: &str,
    sides: &[(&seams::Measured, usize)],
    options: &Options,
    scale: f64,
) -> Dressed {
    let mut placer = lettering::Placer::new(contours, marks);
    let mut out = Dressed::default();
    let (least, height) = (options.least_height, |height: f64| (scale * height).max(options.least_height));
    let mut late = Vec::new();
    for &(seam, side) in sides {
        match placer.seam_label(seam, side, height(options.label_height), least) {
            Some(strokes) => out.marks.extend(strokes),
            None if seam.is_slit() || seam.length() < options.label_from => {}
            None => late.push((seam, side)),
        }
    }
    let title = placer.name(name, height(options.name_height), least);
    for (seam, side) in late {
        let what = format!("seam {} ({:.1} mm) in part {name}", seam.label, seam.length());
        out.beside(placer.seam_label_outside(seam, side, least), what);
    }
    match title {
        Some(strokes) => out.marks.extend(strokes),
        None => {
            out.beside(placer.name_outside(name, least.max(options.label_height / 2.0)), format!("name of part {name}"))
        }
    }
    out
}

impl Dressed {
    /// Adds lettering that stands on the waste, or says that there is no room even there.
    fn beside(&mut self, lettering: Option<Vec<Mark>>, what: String) {
        match lettering {
            Some(strokes) => {
                self.marks.extend(strokes);
                self.outside.push(what);
            }
            None => self.unlabelled.push(what),
        }
    }
}
