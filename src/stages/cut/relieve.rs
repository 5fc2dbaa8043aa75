//! Cuts to where the stretch is largest.
use super::piece::Piece;
use crate::{
    mesh::{EdgeId, Field, TriMesh},
    surface::paths::{EdgeGraph, PathTree},
};

/// Peaks below this share of the highest one are left for later rounds: they often go with it.
const LOWEST_PEAK: f64 = 0.5;
/// One more peak per round for so many vertices, where several are relieved at a time.
const VERTICES_PER_PEAK: usize = 1_000;

/// Edges of new cuts: from each of the `most` highest peaks of |u| (where the
/// piece was polished: of those with the most area left beyond the limit around them) the shortest path to the boundary or to a cut
/// made before it. Every cut so made is a slit that ends at a peak.
pub(super) fn relieving_cuts(mesh: &TriMesh, piece: &Piece, weight: &Field<EdgeId, f64>, most: usize) -> Vec<EdgeId> {
    let chart = &piece.chart;
    let graph = EdgeGraph::new(mesh, chart, weight);
    let height = |v: u32| piece.log_factor[v as usize].abs();
    let is_peak = |v: u32| {
        height(v) > 0.0
            && graph.links(v).iter().all(|it| (height(it.to), it.to) <= (height(v), v) || height(it.to) < height(v))
    };
    // Where the polish was tried, what it left over counts; a fold that is forgiven for its small area has little.
    let rank = |v: u32| {
        let around = || graph.links(v).iter().map(|it| it.to).chain([v]);
        if piece.excess.is_empty() { height(v) } else { around().map(|w| piece.excess[w as usize]).sum() }
    };
    let all = 0..chart.vertex_count() as u32;
    let mut peaks: Vec<(f64, u32)> = all.filter(|&v| is_peak(v)).map(|v| (rank(v), v)).collect();
    if peaks.iter().all(|it| it.0 == 0.0) {
        peaks.iter_mut().for_each(|it| it.0 = height(it.1));
    }
    peaks.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    peaks.truncate(if most > 1 { most + chart.vertex_count() / VERTICES_PER_PEAK } else { 1 });
    let least = peaks.first().map_or(0.0, |it| LOWEST_PEAK * it.0);
    peaks.retain(|it| it.0 >= least);
    let mut open = chart.on_boundary.clone();
    let mut out = Vec::new();
    for (_, peak) in peaks {
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
