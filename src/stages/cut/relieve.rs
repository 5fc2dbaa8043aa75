//! Cuts to where the stretch is largest.
use super::piece::Piece;
use crate::{
    mesh::{EdgeId, Field, TriMesh},
    surface::paths::{EdgeGraph, PathTree},
};

/// Peaks below this share of the highest one are left for later rounds: they often go with it.
const LOWEST_PEAK: f64 = 0.5;
/// Peaks per round, and one more for so many vertices.
const PEAKS: usize = 8;
const VERTICES_PER_PEAK: usize = 1_000;

/// Edges of new cuts: from each of the highest peaks of |u| above `limit` the shortest path to the boundary or to a cut
/// made before it. Every cut so made is a slit that ends at a peak.
pub(super) fn relieving_cuts(mesh: &TriMesh, piece: &Piece, weight: &Field<EdgeId, f64>, limit: f64) -> Vec<EdgeId> {
    let chart = &piece.chart;
    let graph = EdgeGraph::new(mesh, chart, weight);
    let height = |v: u32| piece.log_factor[v as usize].abs();
    let least = limit.max(LOWEST_PEAK * piece.max_log_factor);
    let is_peak = |v: u32| {
        height(v) > least
            && graph.links(v).iter().all(|it| (height(it.to), it.to) <= (height(v), v) || height(it.to) < height(v))
    };
    let mut peaks: Vec<u32> = (0..chart.vertex_count() as u32).filter(|&v| is_peak(v)).collect();
    peaks.sort_by(|&a, &b| height(b).total_cmp(&height(a)).then(a.cmp(&b)));
    peaks.truncate(PEAKS + chart.vertex_count() / VERTICES_PER_PEAK);
    let mut open = chart.on_boundary.clone();
    let mut out = Vec::new();
    for peak in peaks {
        if open[peak as usize] {
            continue;
        }
        let mut end = None;
        let tree = PathTree::new(&graph, &[(peak, 0.0)], |v, _| {
            if open[v as usize] {
                end = Some(v);
                return None;
            }
            Some(true)
        });
        let Some(mut at) = end else { continue };
        while let Some((before, h)) = tree.parent[at as usize] {
            out.push(mesh.edge(h));
            at = before;
            open[at as usize] = true;
        }
    }
    out
}
