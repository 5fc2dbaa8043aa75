//! Makes the two sides of seams that differ too much in the plane equally long.
use super::SeamLengths;
use crate::{
    mesh::{HalfedgeId, Id},
    model::{CutMesh, Seam},
    numeric::{Cancelled, Monitor},
    surface::{
        chart::{Chart, Metric},
        flatten::{FlatDomain, measured},
        isometric::Isometry,
        seam_fit::{SeamSide, Sheet, fit_seams},
    },
};

/// Nothing where every seam is within its allowance; else all seams are fitted at once, so that mending one does not spoil
/// another.
pub(super) fn equalise(
    cut: &CutMesh,
    metric: &Metric,
    charts: &[Chart],
    flats: &mut [FlatDomain],
    monitor: &Monitor,
) -> Result<(), Cancelled> {
    let side = |side: &[HalfedgeId]| {
        let sheet = cut.piece_of[cut.mesh.face(side[0])].index();
        let chart = &charts[sheet];
        let ends = |&h: &HalfedgeId| {
            let face = chart.faces.binary_search(&cut.mesh.face(h)).expect("a chart holds all faces of its piece");
            let corner = h.index() % 3;
            [corner, (corner + 1) % 3].map(|k| chart.corners[face][k])
        };
        SeamSide { sheet, edges: side.iter().map(ends).collect() }
    };
    let seams: Vec<[SeamSide; 2]> = cut.seams.iter().map(|it| it.sides.each_ref().map(|it| side(it))).collect();
    let mut sheets: Vec<Sheet> =
        charts.iter().zip(&*flats).map(|(chart, flat)| Sheet { chart, uv: flat.uv.clone() }).collect();
    let misfit = |(seam, sides): (&Seam, &[SeamSide; 2])| {
        let lengths = SeamLengths { label: seam.label, sides: sides.each_ref().map(|it| it.length(&sheets)) };
        lengths.mismatch() > lengths.allowance()
    };
    if !cut.seams.iter().zip(&seams).any(misfit) {
        return Ok(());
    }
    monitor.progress(1.0, "making seams fit");
    fit_seams(metric, &mut sheets, &seams, cut.stretch, monitor)?;
    for (sheet, flat) in sheets.into_iter().zip(flats) {
        if sheet.uv != flat.uv {
            let excess = Isometry::new(metric, sheet.chart).excess(&sheet.uv, cut.stretch);
            *flat = measured(metric, sheet.chart, sheet.uv, excess);
        }
    }
    Ok(())
}
