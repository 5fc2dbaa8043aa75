//! Where the pieces of a cut mesh are narrower than asked.
use rayon::prelude::*;

use crate::{
    geom::{Vec3, neck::necks, polygon::strip_width},
    mesh::Id,
    model::{CutMesh, PieceId},
    surface::{
        chart::{Chart, ChartBuilder, Metric, labelled_charts},
        flatten::{Limit, flatten_domain},
    },
};

/// A place where two parts of a piece hang together by too little.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NarrowNeck {
    /// The piece.
    pub piece: PieceId,
    /// Width in the plane, mm.
    pub width: f64,
    /// Area of the smaller part that hangs on it, mm².
    pub hanging: f64,
    /// Where, on the surface, mm.
    pub place: Vec3,
}

/// The necks narrower than `width`, mm, of all pieces laid flat, the narrowest of each piece first, and the pieces that are
/// strips narrower than that. `weld`: how far the sides of a slit through a piece with holes may lie apart, mm. Pieces that
/// cannot be laid flat have none.
pub fn narrow(cut: &CutMesh, width: f64, weld: f64) -> (Vec<NarrowNeck>, Vec<PieceId>) {
    let mesh = &cut.mesh;
    let metric = Metric::new(mesh).with_rim(&cut.rim);
    let charts = labelled_charts(mesh, &cut.piece_of, cut.pieces.len());
    let is_strip = |chart: &Chart| {
        let area = chart.faces.iter().map(|&f| metric.area[f]).sum();
        strip_width(area, chart.boundary_edges().map(|(h, ..)| metric.length[h]).sum()) < width
    };
    let strips = (0..charts.len()).filter(|&k| is_strip(&charts[k])).map(PieceId::new).collect();
    let found: Vec<Vec<NarrowNeck>> = charts
        .par_iter()
        .enumerate()
        .map(|(k, chart)| {
            let limit = Limit::new(cut.stretch);
            let flat = flatten_domain(&mut ChartBuilder::new(mesh), &metric, chart, &|_| false, weld, limit);
            let Ok(flat) = flat else { return Vec::new() };
            let all = necks(&chart.contours(&flat.uv), width);
            let narrow = all.iter().rev().map(|it| {
                let path = &chart.loops[it.contour];
                let ends = it.edges.map(|i| mesh.position(mesh.tail(path[i].0)));
                let place = 0.5 * (ends[0] + ends[1]);
                NarrowNeck { piece: PieceId::new(k), width: it.width, hanging: it.hanging, place }
            });
            narrow.collect()
        })
        .collect();
    (found.concat(), strips)
}
