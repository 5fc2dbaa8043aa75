//! Flat pieces → parts: outlines that can be cut, folds, match marks along seams, and lettering.
//!
//! Both sides of a seam carry the same number at its middle and ticks at the same places of the developed mesh, so that
//! edges of equal length meet point by point (the flattening keeps lengths along seams). Everything is printed on the
//! outer side of the surface, the side that faces up when the outline runs counter-clockwise. Lettering never leaves its
//! part: a side without room for its number leaves it to the other side, which then also says what part comes there ("17 K"),
//! and is named in [`Parts::on_partner`]. A slit whose two sides meet at its end shows by itself what belongs together.

mod allowance;
mod bends;
mod dress;
mod engrave;
mod folds;
mod inspect;
mod join;
mod leader;
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
    mesh::HalfedgeId,
    model::{CutMesh, Flattening, Folded, Mark, Misfit, Opening, Parts, PieceId},
    numeric::{Cancelled, Monitor},
};
use bends::Bent;
use join::Body;

pub use bends::Bending;
pub use join::{Hold, Holes, Join, Sides, Tabs};

/// Plain options of the kernel; millimetres and radians.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// Seams from this length on must find room for their number, mm; shorter ones have it where it fits.
    pub label_from: f64,
    /// Points of an outline nearer than this are merged.
    pub merge: f64,
    /// Slits narrower than `merge` are opened to this width; each side moves by half of it.
    pub slit: f64,
    /// Width of what the machine takes away along a cut: narrower slits are opened to it after all, 0 for blades.
    pub tool: f64,
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
    /// How the sheet is bent at folds, where it is metal.
    pub bending: Option<Bending>,
    /// Folds are cut through in stretches of the first length, at least the second one apart.
    pub perforation: Option<(f64, f64)>,
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
///
/// Where the sheet was `folded` along drawn creases, these are the folds, and not the edges that are bent.
pub fn layout(
    cut: &CutMesh,
    flat: &Flattening,
    folded: Option<&Folded>,
    options: &Options,
    monitor: &Monitor,
) -> Result<Parts, LayoutError> {
    flat.fits(cut)?;
    let folds = if folded.is_some() { Vec::new() } else { folds::folds(cut, options.fold_angle) };
    let bent = match &options.bending {
        Some(sheet) => bends::correct(cut, flat, &folds, sheet),
        None => Bent::untouched(flat, &folds),
    };
    let flat = &bent.flat;
    let seams = seams::measure(cut, flat);
    let ends = seams::ends(cut, &seams);
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
        let inserted = |h: HalfedgeId| bent.inserted.get(&h).into_iter().flatten();
        let points = |h: HalfedgeId| std::iter::once(flat.uv[cut.mesh.tail(h)]).chain(inserted(h).copied());
        let kept = |h: HalfedgeId| std::iter::once(ends[cut.mesh.tail(h)]).chain(inserted(h).map(|_| false));
        let raw: Vec<Vec<Vec2>> = loops.iter().map(|path| path.iter().flat_map(|&h| points(h)).collect()).collect();
        let keep: Vec<Vec<bool>> = loops.iter().map(|path| path.iter().flat_map(|&h| kept(h)).collect()).collect();
        let name = description.name.clone();
        let relief = bent.closer.get(&piece).copied().unwrap_or(0.0);
        match outline::outline(&raw, &keep, options.merge, [options.slit, relief]) {
            Ok(found) => {
                if found.opened {
                    let lost = area(&raw) - area(&found.contours);
                    parts.openings.push(Opening { part: name.clone(), width: options.slit, area: lost });
                }
                let own = folds.iter().filter(|it| it.piece == piece);
                let drawn = folds::creases(folded, piece, &found.contours);
                let marks = own.filter_map(|it| folds::mark(cut, flat, it)).chain(drawn);
                let marks = match relief > 0.0 {
                    true => marks.filter_map(|it| join::inside(it, &found.contours)).collect(),
                    false => marks.collect(),
                };
                bodies.insert(piece, Body { name, contours: found.contours, marks });
            }
            Err(reason) => parts.refused.push(format!("piece {name}: {reason}")),
        }
    }
    parts.joints = join::join(&mut bodies, &seams, &options.join, options.merge, monitor)?;
    for body in bodies.values_mut().filter(|_| options.tool > 0.0) {
        monitor.check()?;
        let Some(contours) = outline::widened(&body.contours, options.tool, options.merge) else { continue };
        let lost = area(&body.contours) - area(&contours);
        parts.openings.push(Opening { part: body.name.clone(), width: options.tool, area: lost });
        body.contours = contours;
        body.marks = body.marks.drain(..).filter_map(|it| join::inside(it, &body.contours)).collect();
    }
    let bends = options.bending.as_ref().map_or_else(Vec::new, |sheet| bends::lines(cut, &bent, &folds, sheet));
    parts.bends = bends.iter().map(|it| it.bend.clone()).collect();
    dress::dress(
        &dress::Job { cut, flat, bodies: &bodies, seams: &seams, bends: &bends, options },
        monitor,
        &mut parts,
    )?;
    perforate(&mut parts, options.perforation);
    Ok(parts)
}

/// Cuts folds through in stretches of the first length, at least the second one apart.
fn perforate(parts: &mut Parts, perforation: Option<(f64, f64)>) {
    let Some((length, gap)) = perforation else { return };
    for part in &mut parts.parts {
        let (folds, others): (Vec<Mark>, Vec<Mark>) = part.marks.drain(..).partition(|it| it.operation.is_score());
        part.marks = others;
        part.marks.extend(folds.iter().flat_map(|it| folds::perforated(it, length, gap)));
    }
}
