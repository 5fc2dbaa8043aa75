//! Divides a piece that overlaps itself along the path that resolves most for its length.
use super::piece::Piece;
use crate::{
    mesh::{EdgeId, Field, TriMesh},
    surface::paths::{EdgeGraph, PathTree},
};

/// Starting points tried at most; more boundary vertices than that are thinned out evenly.
const STARTS: usize = 300;

/// The edges of the path that divides a piece best so that pairs of edges of its outline (`conflicts`) part: between two
/// boundary vertices, through the inside. `new_piece` is what one more
/// piece is worth in units of weighted length, `min_area` the least useful area of one, mm².
///
/// A path from boundary vertex i to j separates the outline edges i … j−1 from the others, so how many conflicting pairs
/// it separates is counted along the outline. Every path that separates none is worthless; the others are ranked by
/// pairs over (weighted length + `new_piece`, more for a side without area).
pub(super) fn dividing_path(
    mesh: &TriMesh,
    (piece, conflicts): (&Piece, &[(usize, usize)]),
    weight: &Field<EdgeId, f64>,
    new_piece: f64,
    min_area: f64,
) -> Option<Vec<EdgeId>> {
    let chart = &piece.chart;
    let path = &chart.loops[0];
    let outline = &piece.contours[0];
    let n = path.len();
    let graph = EdgeGraph::new(mesh, chart, weight);
    let mut position = vec![usize::MAX; chart.vertex_count()];
    for (i, &(_, v)) in path.iter().enumerate() {
        position[v as usize] = i;
    }
    let mut partners: Vec<Vec<usize>> = vec![Vec::new(); n];
    for &(i, j) in conflicts {
        partners[i].push(j);
        partners[j].push(i);
    }
    // Twice the signed area swept from the origin by the first i edges of the outline.
    let mut swept = vec![0.0; n + 1];
    for i in 0..n {
        swept[i + 1] = swept[i] + crate::geom::cross2(outline[i], outline[(i + 1) % n]);
    }
    let total_area = piece.area;
    let useful_area = (new_piece * new_piece).max(min_area).min(0.25 * total_area);
    let cost = |length: f64, i: usize, j: usize| {
        let chord = crate::geom::cross2(outline[j], outline[i]);
        let area = (0.5 * (swept[j] - swept[i] + chord)).abs();
        let share = (area.min((total_area - area).abs()) / useful_area).min(1.0);
        length + new_piece * (1.0 + 4.0 * (1.0 - share))
    };
    let tips: Vec<usize> = conflicts.iter().filter(|it| it.0 + 1 == it.1 || it.1 == 0).map(|it| it.1).collect();
    let stride = n.div_ceil(STARTS);
    let mut starts: Vec<usize> = (0..n).step_by(stride).chain(tips).collect();
    starts.sort_unstable();
    starts.dedup();
    let mut best: Option<(f64, Vec<EdgeId>)> = None;
    let mut inside = vec![false; n];
    for i in starts {
        // Pairs separated by a path from i to every j, along the outline once round.
        let mut separated = vec![0_i64; n];
        inside.fill(false);
        let mut count = 0_i64;
        for step in 0..n {
            let e = (i + step) % n;
            separated[e] = count;
            for &other in &partners[e] {
                count += if inside[other] { -1 } else { 1 };
            }
            inside[e] = true;
        }
        let most = *separated.iter().max().unwrap_or(&0) as f64;
        let reach = best.as_ref().map_or(f64::INFINITY, |it| most / it.0 - new_piece);
        if most == 0.0 || reach <= 0.0 {
            continue;
        }
        let start = path[i].1;
        let mut ends = Vec::new();
        let tree = PathTree::new(&graph, &[(start, 0.0)], |v, distance| {
            if distance > reach {
                return None;
            }
            if v != start && chart.on_boundary[v as usize] {
                ends.push(v);
                return Some(false);
            }
            Some(true)
        });
        for v in ends {
            let j = position[v as usize];
            if separated[j] > 0 {
                let (low, high) = (i.min(j), i.max(j));
                let score = separated[j] as f64 / cost(tree.distance[v as usize], low, high);
                if best.as_ref().is_none_or(|it| score > it.0) {
                    best = Some((score, tree.path(v).into_iter().map(|h| mesh.edge(h)).collect()));
                }
            }
        }
    }
    best.map(|it| it.1)
}
