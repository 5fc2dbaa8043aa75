//! Pieces laid flat with the outline that was asked for.
use crate::{
    mesh::HalfedgeId,
    surface::{
        chart::{Chart, Metric},
        flatten::{FlatDomain, FlattenError, Flattener, Limit, measured, polished, polished_as},
        isometric::Isometry,
    },
};

/// Every boundary edge as long as it should be, polished.
pub(super) fn isometric(metric: &Metric, chart: &Chart, limit: Limit) -> Result<FlatDomain, FlattenError> {
    Ok(polished(metric, chart, Flattener::new(metric, chart)?.flatten()?, limit))
}

/// Every boundary edge `scale` times as long as it should be, polished.
pub(super) fn with_scales(
    metric: &Metric,
    chart: &Chart,
    scale: &impl Fn(&HalfedgeId) -> f64,
    limit: Limit,
) -> Result<FlatDomain, FlattenError> {
    let lengths: Vec<f64> = chart.boundary_edges().map(|(h, ..)| metric.rim[h] * scale(&h)).collect();
    let flattener = Flattener::new(metric, chart)?;
    let uv = flattener.lay_out(&flattener.with_lengths(&lengths, &[]))?;
    let isometry = Isometry::new(metric, chart).with_boundary_lengths(&lengths);
    Ok(polished_as(metric, chart, &isometry, uv, limit))
}

/// Straight between the vertices at which the isometric outline turns by at least `corner`, radians; what their angles lack
/// to a full turn is shared among them. Conformal, not polished: that would bend the sides again.
pub(super) fn straight(metric: &Metric, chart: &Chart, corner: f64, limit: Limit) -> Result<FlatDomain, FlattenError> {
    let flattener = Flattener::new(metric, chart)?;
    let mut exterior = flattener.exterior_angles();
    let corners: Vec<usize> = (0..exterior.len()).filter(|&v| exterior[v].abs() >= corner).collect();
    // Fewer than three turns to one side close no polygon.
    let found = corners.iter().filter(|&&v| exterior[v] > 0.0).count();
    if found < 3 {
        return Err(FlattenError::TooFewCorners { face: chart.faces[0], found });
    }
    let missing = std::f64::consts::TAU - corners.iter().map(|&v| exterior[v]).sum::<f64>();
    for (v, angle) in exterior.iter_mut().enumerate() {
        let is_corner = corners.binary_search(&v).is_ok();
        *angle = if is_corner { *angle + missing / corners.len() as f64 } else { 0.0 };
    }
    let uv = flattener.lay_out(&flattener.with_exterior_angles(&exterior, &[])?)?;
    let excess = Isometry::new(metric, chart).excess(&uv, limit.stretch);
    Ok(measured(metric, chart, uv, excess))
}
