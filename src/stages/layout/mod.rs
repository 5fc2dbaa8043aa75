//! Flat pieces → parts: outlines that can be cut, folds, match marks along seams, and lettering.
//!
//! Both sides of a seam carry the same number at its middle and ticks at the same places of the developed mesh, so that
//! edges of equal length meet point by point (the flattening keeps lengths along seams). Everything is printed on the
//! outer side of the surface, the side that faces up when the outline runs counter-clockwise. A number that finds no room
//! is named in [`Parts::unlabelled`], except along a slit whose two sides meet at its end and along seams too short to
//! be promised one.

mod folds;
mod lettering;
mod outline;
mod rulings;
mod seams;
pub mod stage;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;

use crate::{
    geom::{Vec2, polygon::area},
    mesh::{HalfedgeId, Id},
    model::{CutMesh, Flattening, Mark, Opening, Part, Parts, PieceId},
    numeric::{Cancelled, Monitor},
};

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
}

/// Why the stage could not work at all; a single bad piece goes to [`Parts::refused`] instead.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum LayoutError {
    /// The two inputs do not belong together.
    #[error("the flattening has {found} points for {expected} vertices of the cut mesh")]
    Mismatch {
        /// Points given.
        found: usize,
        /// Vertices of the cut mesh.
        expected: usize,
    },
    /// A plane coordinate is NaN or infinite.
    #[error("vertex {vertex} of the cut mesh is flattened to a point that is not finite: ({}, {})", place.x, place.y)]
    NotFinite {
        /// The vertex.
        vertex: usize,
        /// Where it was put.
        place: Vec2,
    },
    /// The run was interrupted.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// Makes a part of every piece.
pub fn layout(cut: &CutMesh, flat: &Flattening, options: &Options, monitor: &Monitor) -> Result<Parts, LayoutError> {
    let expected = cut.mesh.vertex_count();
    if flat.uv.len() != expected {
        return Err(LayoutError::Mismatch { found: flat.uv.len(), expected });
    }
    if let Some((vertex, &place)) = flat.uv.enumerate().find(|(_, p)| !(p.x.is_finite() && p.y.is_finite())) {
        let vertex: crate::mesh::VertexId = vertex;
        return Err(LayoutError::NotFinite { vertex: vertex.index(), place });
    }
    let seams = seams::measure(cut, flat);
    let ends = seams::ends(cut, &seams);
    let mut folds = folds::folds(cut, flat, options.fold_angle);
    let mut loops: BTreeMap<PieceId, Vec<Vec<HalfedgeId>>> = BTreeMap::new();
    for path in cut.mesh.boundary_loops() {
        loops.entry(cut.piece_of[cut.mesh.face(path[0])]).or_default().push(path);
    }
    let mut parts = Parts::default();
    for (piece, description) in cut.pieces.enumerate() {
        monitor.check()?;
        let piece: PieceId = piece;
        monitor.progress(piece.index() as f64 / cut.pieces.len() as f64, &description.name);
        let loops = loops.remove(&piece).unwrap_or_default();
        let raw: Vec<Vec<Vec2>> =
            loops.iter().map(|path| path.iter().map(|&h| flat.uv[cut.mesh.tail(h)]).collect()).collect();
        let keep: Vec<Vec<bool>> =
            loops.iter().map(|path| path.iter().map(|&h| ends[cut.mesh.tail(h)]).collect()).collect();
        let contours = match outline::outline(&raw, &keep, options.merge, options.slit) {
            Ok(found) => {
                if found.opened {
                    let lost = area(&raw) - area(&found.contours);
                    parts.openings.push(Opening { part: description.name.clone(), width: options.slit, area: lost });
                }
                found.contours
            }
            Err(reason) => {
                parts.refused.push(format!("piece {}: {reason}", description.name));
                continue;
            }
        };
        let folds = folds.remove(&piece).unwrap_or_default();
        let dressed = dress(cut, flat, piece, &contours, folds, &seams, options);
        parts.unlabelled.extend(dressed.unlabelled);
        parts.parts.push(Part { name: description.name.clone(), contours, marks: dressed.marks });
    }
    Ok(parts)
}

/// Marks of one part, and the lettering that found no room.
struct Dressed {
    marks: Vec<Mark>,
    unlabelled: Vec<String>,
}

/// Scales of the lettering of a part to try when something on it finds no room.
const SCALES: [f64; 3] = [0.75, 0.6, 0.45];

fn dress(
    cut: &CutMesh,
    flat: &Flattening,
    piece: PieceId,
    contours: &[Vec<Vec2>],
    folds: Vec<Mark>,
    seams: &[seams::Measured],
    options: &Options,
) -> Dressed {
    let mut marks = folds;
    let ticks = seams::ticks(cut, flat, piece, contours, &marks, seams, options);
    marks.extend(ticks);
    let name = &cut.pieces[piece].name;
    let mut sides: Vec<(&seams::Measured, usize)> =
        seams.iter().flat_map(|it| [(it, 0), (it, 1)]).filter(|(it, side)| it.sides[*side].piece == piece).collect();
    // Short seams have the least choice of places, so they choose first.
    sides.sort_by(|a, b| a.0.length().total_cmp(&b.0.length()));
    let (mut lettering, mut unlabelled) = inscribe(contours, &marks, name, &sides, options, 1.0);
    // Large letters take the room of others: where one finds none, all of the part are smaller.
    for scale in SCALES {
        if unlabelled.is_empty() {
            break;
        }
        let smaller = inscribe(contours, &marks, name, &sides, options, scale);
        if smaller.1.len() < unlabelled.len() {
            (lettering, unlabelled) = smaller;
        }
    }
    marks.extend(lettering);
    Dressed { marks, unlabelled }
}

/// The lettering of a part at `scale` of its preferred heights, and what found no room.
fn inscribe(
    contours: &[Vec<Vec2>],
    marks: &[Mark],
    name: &str,
    sides: &[(&seams::Measured, usize)],
    options: &Options,
    scale: f64,
) -> (Vec<Mark>, Vec<String>) {
    let mut placer = lettering::Placer::new(contours, marks);
    let (mut lettering, mut unlabelled) = (Vec::new(), Vec::new());
    let (least, height) = (options.least_height, |height: f64| (scale * height).max(options.least_height));
    for &(seam, side) in sides {
        match placer.seam_label(seam, side, height(options.label_height), least) {
            Some(strokes) => lettering.extend(strokes),
            None if seam.is_slit() || seam.length() < options.label_from => {}
            None => unlabelled.push(format!("seam {} ({:.1} mm) in part {name}", seam.label, seam.length())),
        }
    }
    match placer.name(name, height(options.name_height), least) {
        Some(strokes) => lettering.extend(strokes),
        None => unlabelled.push(format!("name of part {name}")),
    }
    (lettering, unlabelled)
}
