//! Rulings and strips: every flat piece is filled with straight chords that do not cross, so that the surface between
//! them is as planar as it can be.
//!
//! | symbol | meaning |
//! | --- | --- |
//! | sample | point of the outline of a piece: its vertices and points on its longer edges, the same on both sides of a seam |
//! | chord | straight line in the plane from sample to sample, inside the piece |
//! | N | unit normal of the developed mesh, constant in each face |
//!
//! A developable surface is straight along its rulings and its normal is constant there, so rulings are the chords
//! between which ∫ |N − N_panel|² dA is least. They are found by dynamic programmes over intervals of the outline: first
//! over triangles between some of the samples ([`triangulate`], after minimum-weight triangulation, Klincsek 1980), then
//! over planar quadrilaterals between all of them in a band around what was found ([`decompose`]). The error of a panel is
//! exact and takes a constant time ([`chord`]). The result has no crossings and no gaps by construction. Where chords pass
//! over a crease that no straight line follows, the piece is opened along it and solved again ([`creases`]); its two sides
//! keep common points, and what it bends there is no ruling.
//!
//! Normals and integrals are taken in the plane, where areas are those of the surface within the stretch of the
//! flattening.

mod bend;
mod border;
mod chord;
mod creases;
mod decompose;
pub mod measure;
mod merge;
mod patch;
mod sampling;
pub mod stage;
#[cfg(test)]
mod tests;
mod triangulate;

use std::collections::{BTreeMap, BTreeSet};

use rayon::prelude::*;

use crate::{
    geom::{Vec2, polyline::simplify},
    mesh::{Field, Id, VertexId},
    model::{Corner, CutMesh, Flattening, Misfit, Panel, PanelKind, PieceId, Ruled, Ruling, Strips},
    numeric::{Cancelled, Monitor},
    surface::{chart::labelled_charts, rulings},
};
use border::Border;
use chord::{Chord, Form};
use decompose::{Decomposition, Terms, decompose};
use patch::{Name, Patch};

/// How far apart rulings are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Spacing {
    /// Chord tolerance: panels leave the outline of their piece by at most this where that can be avoided, mm.
    Tolerance(f64),
    /// The smallest tolerance found that gives at most so many rulings in all.
    Count(usize),
}

/// Plain options of the kernel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// How far apart rulings are.
    pub spacing: Spacing,
    /// Largest planarity of a quadrilateral: distance of a corner from the plane of the others over the mean diagonal.
    pub planarity: f64,
    /// Rulings that bend at least this much are folds, radians.
    pub fold_angle: f64,
}

/// Why there are no strips.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum StripsError {
    /// The two inputs do not belong together.
    #[error(transparent)]
    Misfit(#[from] Misfit),
    /// The run was interrupted.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// Chords are first looked for between every second sample, then between all.
const STRIDE: usize = 2;
/// Samples of the first programme that a panel may take on either side of a strip.
const REACH: usize = 14;
/// Samples of the first programme that a chord may move away from the triangulation at each end.
const BAND: usize = 7;
/// The same for the second programme and the chords of the first.
const FINE_BAND: usize = 2;
/// Creases are opened under chords that leave the surface by more than so many tolerances.
const BOWED: f64 = 2.0;
/// Outlines are simplified by this share of a panel's size to count its corners.
const CORNER: f64 = 0.01;
/// A piece has no reliable rulings when it bends along them by this share of how much it bends in all.
const UNRELIABLE: f64 = 0.15;
/// Tolerances tried for a number of rulings, as shares of the diagonal: from the coarsest down, each half the one before
/// at first, then between the last two.
const COARSEST: f64 = 0.02;
const HALVINGS: usize = 6;
const BISECTIONS: usize = 4;

/// A piece with its decomposition.
struct Solved {
    piece: PieceId,
    ruled: Ruled,
    residual: f64,
    names: Vec<Name>,
    border: Option<(Border, Decomposition)>,
}

/// Fills every piece with rulings.
pub fn strips(cut: &CutMesh, flat: &Flattening, options: &Options, monitor: &Monitor) -> Result<Strips, StripsError> {
    flat.fits(cut)?;
    let charts = labelled_charts(&cut.mesh, &cut.piece_of, cut.pieces.len());
    let divisions = sampling::divisions(cut, &charts);
    let patches: Vec<Patch> = charts.iter().map(|it| sampling::sampled(cut, flat, it, &divisions)).collect();
    let made = |tolerance: f64| -> Result<Vec<Solved>, Cancelled> {
        let terms = Terms { tolerance, planarity: options.planarity, reach: REACH, band: BAND };
        let work = patches.par_iter().enumerate();
        work.map(|(k, patch)| solve(PieceId::new(k), patch.clone(), &terms, monitor)).collect()
    };
    let (tolerance, solved) = match options.spacing {
        Spacing::Tolerance(tolerance) => (tolerance, made(tolerance)?),
        Spacing::Count(most) => by_count(most, COARSEST * cut.mesh.bounds().diagonal(), made, monitor)?,
    };
    let strips = Strips {
        points: vec![],
        corners: vec![],
        panels: vec![],
        rulings: vec![],
        ruled: Field::from_vec(solved.iter().map(|it| it.ruled).collect()),
        residual: Field::from_vec(solved.iter().map(|it| it.residual).collect()),
        directions: directions(cut, flat),
        fold_angle: options.fold_angle,
        tolerance,
    };
    let mut assembly = Assembly { strips, points: BTreeMap::new() };
    for it in &solved {
        assembly.add(it);
    }
    Ok(assembly.strips)
}

/// The smallest tolerance found with at most `most` rulings, and what it gives; the coarsest where none has so few.
fn by_count(
    most: usize,
    coarsest: f64,
    made: impl Fn(f64) -> Result<Vec<Solved>, Cancelled>,
    monitor: &Monitor,
) -> Result<(f64, Vec<Solved>), Cancelled> {
    let count =
        |it: &[Solved]| -> usize { it.iter().filter_map(|it| it.border.as_ref()).map(|it| it.1.chords.len()).sum() };
    let mut best = (coarsest, made(coarsest)?);
    let mut too_fine = 0.0;
    for k in 0..HALVINGS + BISECTIONS {
        monitor.progress(k as f64 / (HALVINGS + BISECTIONS) as f64, "spacing");
        // The last tries go on only once a tolerance was too fine.
        let next = (best.0 + too_fine) / 2.0;
        let found = made(next)?;
        if count(&found) <= most {
            best = (next, found);
        } else {
            too_fine = next;
        }
    }
    Ok(best)
}

fn directions(cut: &CutMesh, flat: &Flattening) -> Field<VertexId, Vec2> {
    let mesh = &cut.mesh;
    let mut area = Field::filled(cut.pieces.len(), 0.0);
    for f in mesh.faces() {
        area[cut.piece_of[f]] += mesh.area(f);
    }
    let mut own = Field::filled(mesh.vertex_count(), 0.0);
    for f in mesh.faces() {
        for v in mesh.face_vertices(f) {
            own[v] = area[cut.piece_of[f]];
        }
    }
    let smooth = rulings::smoothed(mesh, &rulings::directions(mesh, &flat.uv), &own);
    Field::from_vec(smooth.iter().map(|it| it.doubled).collect())
}

/// A disk with the best chords between its samples, panels not joined yet.
struct Disk {
    patch: Patch,
    form: Form,
    border: Border,
    /// The triangulation that the search began with.
    guide: Vec<(usize, usize)>,
    found: Decomposition,
    cost: f64,
}

impl Disk {
    fn solve(patch: Patch, terms: &Terms, monitor: &Monitor) -> Result<Option<Self>, Cancelled> {
        let form = Form::new(&patch);
        let border = Border::new(&patch, &form);
        let gap = terms.reach / 2 * STRIDE;
        let Some(guide) = triangulate::triangulation(&patch, &form, &border, gap, terms, monitor)? else {
            return Ok(None);
        };
        let n = border.len();
        // The ends of the triangulation take part, so that it is among the candidates.
        let ends = guide.iter().flat_map(|&(i, k)| [i, k]);
        let chosen: BTreeSet<usize> = (0..n - 1).step_by(STRIDE).chain([n - 1]).chain(ends).collect();
        let coarse = decompose(&patch, &form, &border, chosen.into_iter().collect(), &guide, terms, monitor)?;
        // The chords of the triangulation, or those of the first programme, are among the candidates, so something is
        // found.
        let (around, band) = match &coarse {
            Some((it, _)) => (it.chords.iter().map(|it| (it.ends[0], it.ends[1])).collect(), FINE_BAND),
            None => (guide.clone(), BAND),
        };
        let fine = Terms { reach: (terms.reach + FINE_BAND) * STRIDE, band, ..*terms };
        let found = decompose(&patch, &form, &border, (0..n).collect(), &around, &fine, monitor)?;
        Ok(found.map(|(found, cost)| Self { patch, form, border, guide, found, cost }))
    }

    /// The same opened along creases if that costs less, with whatever longer chords and fewer panels it gives. A surface
    /// that is bent along its rulings everywhere has no creases to follow, only rough places.
    fn slit(self, terms: &Terms, monitor: &Monitor) -> Result<Self, Cancelled> {
        if self.found.residual(&self.border.whole()) > UNRELIABLE {
            return Ok(self);
        }
        let mut patch = self.patch.clone();
        if !creases::open(&mut patch, &self.border, &self.found, BOWED * terms.tolerance) {
            return Ok(self);
        }
        Ok(Self::solve(patch, terms, monitor)?.filter(|it| it.cost < self.cost).unwrap_or(self))
    }
}

fn solve(piece: PieceId, mut patch: Patch, terms: &Terms, monitor: &Monitor) -> Result<Solved, Cancelled> {
    monitor.check()?;
    let unsolved = Solved { piece, ruled: Ruled::Unsolved, residual: 1.0, names: vec![], border: None };
    if !sampling::open_to_disk(&mut patch) {
        return Ok(unsolved);
    }
    let Some(disk) = Disk::solve(patch, terms, monitor)? else { return Ok(unsolved) };
    let Disk { patch, form, border, guide, found, .. } = disk.slit(terms, monitor)?;
    let found = merge::split(&patch, &form, &border, found, terms, monitor)?;
    let mut found = merge::merged(&border, found, terms);
    let residual = found.residual(&border.whole());
    let ruled = match found.panels.len() {
        1 => Ruled::Flat,
        _ if residual > UNRELIABLE => Ruled::Unreliable,
        _ => Ruled::Yes,
    };
    if ruled == Ruled::Unreliable {
        let mut scratch = Vec::new();
        let chords = guide.iter().filter_map(|&(i, k)| {
            let chord = Chord::trace(&patch, &form, border.vertices[i], border.vertices[k], &mut scratch)?;
            Some(([i, k], chord))
        });
        let triangles = Decomposition::new(border.len(), chords.collect::<Vec<_>>());
        found = merge::split(&patch, &form, &border, triangles, terms, monitor)?;
    }
    let names = border.vertices.iter().map(|&v| patch.names[v as usize]).collect();
    let residual = if ruled == Ruled::Flat { 0.0 } else { residual };
    Ok(Solved { piece, ruled, residual, names, border: Some((border, found)) })
}

/// The pieces put together.
struct Assembly {
    strips: Strips,
    points: BTreeMap<(Option<PieceId>, Name), u32>,
}

impl Assembly {
    fn add(&mut self, it: &Solved) {
        let Some((border, found)) = &it.border else { return };
        let out = &mut self.strips;
        let first = out.corners.len() as u32;
        for (k, &name) in it.names.iter().enumerate() {
            // Points inside a piece are numbered there.
            let owner = matches!(name, Name::Inside(_)).then_some(it.piece);
            let point = *self.points.entry((owner, name)).or_insert_with(|| {
                out.points.push(border.xyz[k]);
                out.points.len() as u32 - 1
            });
            out.corners.push(Corner { point, uv: border.uv[k] });
        }
        let mut place = vec![0; found.panels.len()];
        for (number, strip) in merge::strips(border, found).iter().enumerate() {
            for &p in strip {
                place[p] = out.panels.len() as u32;
                let kind = kind(border, &found.panels[p]);
                let outline =
                    merge::without_spurs(border, &found.panels[p]).iter().map(|&i| first + i as u32).collect();
                out.panels.push(Panel { piece: it.piece, strip: number as u32, kind, outline });
            }
        }
        for (link, bend) in found.chords.iter().zip(bend::bends(border, found)) {
            out.rulings.push(Ruling {
                piece: it.piece,
                ends: link.ends.map(|i| first + i as u32),
                panels: link.panels.map(|p| place[p]),
                bend: bend.angle,
                radius: bend.radius,
                length: link.chord.surface,
                bow: link.chord.bow,
            });
        }
    }
}

fn kind(border: &Border, outline: &[usize]) -> PanelKind {
    if merge::quadrilateral(outline, border.len()).is_some() {
        return PanelKind::Quad;
    }
    let points: Vec<Vec2> = merge::without_spurs(border, outline).iter().map(|&i| border.uv[i]).collect();
    let corners = simplify(&points, true, CORNER * merge::size(border, outline), &|_| false);
    if corners.len() > 3 { PanelKind::Polygon } else { PanelKind::Triangle }
}
