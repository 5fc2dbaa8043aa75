//! Lays every piece flat at its true size and measures how well: stretch, flips, overlaps, seams.
mod mirror;
mod outline;
mod ribbon;
mod sewing;
pub mod stage;

pub use mirror::mirrored;
pub use ribbon::{Ribbon, ribbons};

use std::collections::BTreeSet;

use rayon::prelude::*;

use crate::{
    geom::Vec2,
    mesh::{FaceId, Field, HalfedgeId, Id},
    model::{CutMesh, Flattening, Overlap, PieceId},
    numeric::{Cancelled, Monitor},
    surface::{
        chart::{Chart, ChartBuilder, Metric, labelled_charts},
        distortion::Distortion,
        flatten::{self, FlatDomain, Limit, flatten_domain},
        overlap::overlapping_triangles,
    },
};

/// A piece with holes lies flat as it is when the sides of a slit between its loops stay this close, mm: a tenth of what
/// any machine resolves.
const WELD: f64 = 0.005;

/// The sides of a seam may differ by this share of its length …
const MISMATCH_SHARE: f64 = 0.002;
/// … or by this much, mm, whichever is larger.
const MISMATCH: f64 = 0.05;

/// What the outlines of the pieces should be like.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outline {
    /// As long as in space edge by edge, as little stretched as possible.
    Isometric,
    /// Straight from corner to corner, conformal inside.
    Straight,
}

/// What to keep to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// What the outlines should be like.
    pub outline: Outline,
    /// Least angle by which an outline turns at a corner, radians; read for straight outlines.
    pub corner: f64,
    /// Length of the open edges of the surface in the plane over their length in space.
    pub hem: f64,
    /// Whether seams whose sides differ too much in length are made equal.
    pub equal_seams: bool,
}

/// Why a cut mesh cannot be flattened.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FlattenError {
    /// Interrupted.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// One piece.
    #[error("piece {name} cannot be flattened: {source}")]
    Piece {
        /// Its name.
        name: String,
        /// Why.
        source: flatten::FlattenError,
    },
}

/// Flattens every piece as `options` say, polished to the stretch that it was cut for ([`flatten_domain`]), each in a frame
/// of its own, makes seams fit, and finds the pairs of faces that overlap.
pub fn flatten(cut: &CutMesh, options: &Options, monitor: &Monitor) -> Result<Flattening, FlattenError> {
    let metric = Metric::new(&cut.mesh).with_rim(&cut.rim);
    let limit = Limit::new(cut.stretch);
    let charts = labelled_charts(&cut.mesh, &cut.piece_of, cut.pieces.len());
    let sides = || cut.seams.iter().flat_map(|it| it.sides.iter().flatten().copied());
    let sewn: BTreeSet<HalfedgeId> = if options.hem == 1.0 { BTreeSet::new() } else { sides().collect() };
    let done = std::sync::atomic::AtomicUsize::new(0);
    let flats: Vec<Result<FlatDomain, FlattenError>> = charts
        .par_iter()
        .enumerate()
        .map(|(k, chart)| {
            monitor.check()?;
            let name = || cut.pieces[PieceId::new(k)].name.clone();
            let flat = flatten_chart(cut, (&metric, chart), options, &sewn, limit)
                .map_err(|source| FlattenError::Piece { name: name(), source });
            let before = done.fetch_add(chart.faces.len(), std::sync::atomic::Ordering::Relaxed);
            let share = (before + chart.faces.len()) as f64 / cut.mesh.face_count() as f64;
            monitor.progress(share, "flattening");
            flat
        })
        .collect();
    let mut flats = flats.into_iter().collect::<Result<Vec<FlatDomain>, FlattenError>>()?;
    if options.equal_seams {
        sewing::equalise(cut, &metric, &charts, &mut flats, monitor)?;
    }
    let overlaps: Vec<Vec<Overlap>> =
        charts.par_iter().zip(&flats).map(|(chart, flat)| overlaps(chart, &flat.uv)).collect();
    let mut out = Flattening {
        uv: Field::filled(cut.mesh.vertex_count(), Vec2::zeros()),
        log_factor: Field::filled(cut.mesh.vertex_count(), 0.0),
        overlaps: overlaps.concat(),
        stretch_limit: cut.stretch,
    };
    for (chart, flat) in charts.iter().zip(flats) {
        for (k, &v) in chart.origin.iter().enumerate() {
            out.uv[v] = flat.uv[k];
            out.log_factor[v] = flat.log_factor[k];
        }
    }
    Ok(out)
}

fn flatten_chart(
    cut: &CutMesh,
    (metric, chart): (&Metric, &Chart),
    options: &Options,
    sewn: &BTreeSet<HalfedgeId>,
    limit: Limit,
) -> Result<FlatDomain, flatten::FlattenError> {
    // Only a piece with holes needs a builder of its own. It lies flat as it is, or not at all.
    if chart.loops.len() > 1 {
        return flatten_domain(&mut ChartBuilder::new(&cut.mesh), metric, chart, &|_| false, WELD, limit);
    }
    match options.outline {
        Outline::Straight => outline::straight(metric, chart, options.corner, limit),
        Outline::Isometric if options.hem == 1.0 => outline::isometric(metric, chart, limit),
        Outline::Isometric => {
            let scale = |h: &HalfedgeId| if sewn.contains(h) { 1.0 } else { options.hem };
            outline::with_scales(metric, chart, &scale, limit)
        }
    }
}

fn overlaps(chart: &Chart, uv: &[Vec2]) -> Vec<Overlap> {
    let triangles: Vec<[Vec2; 3]> = chart.corners.iter().map(|it| it.map(|v| uv[v as usize])).collect();
    let pairs = overlapping_triangles(&triangles).into_iter();
    pairs.map(|(i, j, area)| Overlap { faces: [chart.faces[i], chart.faces[j]], area }).collect()
}

/// What a flattening is worth. Shares and quantiles weigh faces by their area in space; flipped faces are left out of the
/// stretch figures and counted on their own.
#[derive(Debug, Clone, PartialEq)]
pub struct Quality {
    /// Largest |log scale| and the face that has it.
    pub max_log_scale: (f64, FaceId),
    /// |log scale| that 99.9 % of the area keep.
    pub p999_log_scale: f64,
    /// |log scale| that 99 % of the area keep.
    pub p99_log_scale: f64,
    /// Mean |log scale|.
    pub mean_log_scale: f64,
    /// Share of the area in faces whose principal stretch exceeds the limit, or that are flipped.
    pub share_over_limit: f64,
    /// Largest principal stretch and the face that has it.
    pub max_principal_stretch: (f64, FaceId),
    /// Principal stretch that 99.9 % of the area keep.
    pub p999_principal_stretch: f64,
    /// Principal stretch that 99 % of the area keep.
    pub p99_principal_stretch: f64,
    /// Largest σ1 / σ2.
    pub max_quasi_conformal: f64,
    /// Faces that lie upside down or have no area in the plane.
    pub flipped: Vec<FaceId>,
    /// Per piece.
    pub pieces: Field<PieceId, PieceQuality>,
}

/// What the flattening of one piece is worth.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PieceQuality {
    /// Number of faces.
    pub faces: usize,
    /// Area in space, mm².
    pub area_3d: f64,
    /// Area in the plane, flipped faces negative, mm².
    pub area_2d: f64,
    /// Largest |log scale|.
    pub max_log_scale: f64,
}

/// Measures a flattening.
pub fn quality(cut: &CutMesh, flat: &Flattening) -> Quality {
    let mesh = &cut.mesh;
    let mut pieces = Field::filled(cut.pieces.len(), PieceQuality::default());
    let mut flipped = Vec::new();
    let mut scales: Vec<(f64, FaceId, f64)> = Vec::with_capacity(mesh.face_count());
    let mut stretches = Vec::with_capacity(mesh.face_count());
    let mut max_quasi_conformal = 1.0_f64;
    for f in mesh.faces() {
        let (space, plane) = (mesh.face_positions(f), mesh.face_vertices(f).map(|v| flat.uv[v]));
        let distortion = Distortion::new(space, plane);
        let area = mesh.area(f);
        let piece = &mut pieces[cut.piece_of[f]];
        piece.faces += 1;
        piece.area_3d += area;
        piece.area_2d += crate::geom::signed_area(&plane);
        if distortion.flipped {
            flipped.push(f);
            continue;
        }
        let scale = distortion.log_scale.abs();
        piece.max_log_scale = piece.max_log_scale.max(scale);
        scales.push((scale, f, area));
        stretches.push((distortion.principal_stretch(), f, area));
        max_quasi_conformal = max_quasi_conformal.max(distortion.quasi_conformal());
    }
    let total: f64 = scales.iter().map(|it| it.2).sum();
    let mean =
        |values: &[(f64, FaceId, f64)]| values.iter().map(|it| it.0 * it.2).sum::<f64>() / total.max(f64::MIN_POSITIVE);
    let over: f64 = stretches.iter().filter(|it| it.0 > flat.stretch_limit).map(|it| it.2).sum();
    let turned: f64 = flipped.iter().map(|&f| mesh.area(f)).sum();
    scales.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    stretches.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    Quality {
        max_log_scale: scales.last().map_or((0.0, FaceId(0)), |it| (it.0, it.1)),
        p999_log_scale: quantile(&scales, 0.999 * total),
        p99_log_scale: quantile(&scales, 0.99 * total),
        mean_log_scale: mean(&scales),
        share_over_limit: (over + turned) / (total + turned).max(f64::MIN_POSITIVE),
        max_principal_stretch: stretches.last().map_or((0.0, FaceId(0)), |it| (it.0, it.1)),
        p999_principal_stretch: quantile(&stretches, 0.999 * total),
        p99_principal_stretch: quantile(&stretches, 0.99 * total),
        max_quasi_conformal,
        flipped,
        pieces,
    }
}

/// The least value that faces with at least `area` keep; `values` ascending.
fn quantile(values: &[(f64, FaceId, f64)], area: f64) -> f64 {
    let mut sum = 0.0;
    let reached = values.iter().find(|it| {
        sum += it.2;
        sum >= area
    });
    reached.or(values.last()).map_or(0.0, |it| it.0)
}

/// Flat lengths of the two sides of a seam.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SeamLengths {
    /// Its label.
    pub label: u32,
    /// Length of each side in the plane, mm.
    pub sides: [f64; 2],
}

impl SeamLengths {
    /// Difference of the sides, mm.
    pub fn mismatch(&self) -> f64 {
        (self.sides[0] - self.sides[1]).abs()
    }

    /// Difference that a seam of this length may have, mm.
    pub fn allowance(&self) -> f64 {
        MISMATCH.max(MISMATCH_SHARE * self.sides[0].max(self.sides[1]))
    }

    /// Difference of the sides over the longer one.
    pub fn relative(&self) -> f64 {
        self.mismatch() / self.sides[0].max(self.sides[1]).max(f64::MIN_POSITIVE)
    }
}

/// Measures every seam.
pub fn seam_lengths(cut: &CutMesh, flat: &Flattening) -> Vec<SeamLengths> {
    cut.seams.iter().map(|it| SeamLengths { label: it.label, sides: flat.seam_sides(cut, it) }).collect()
}
