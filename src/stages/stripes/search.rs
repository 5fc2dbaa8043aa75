//! Singularities that nobody listed: the pairs that lower the misfit most, and those that turn rings into
//! spirals.
use super::isolines::{Crossings, Levels};
use crate::{
    mesh::{EdgeId, FaceId, Field, Id, TriMesh, VertexId},
    numeric::{Cancelled, Monitor},
    surface::{
        field_aligned::{AlignError, Parameterization},
        tree_cotree::Node,
    },
};

/// Tips and saddles that are tried against each other.
const PLACES: usize = 24;
/// So many faces in all are solved for each pair that is added, so that large meshes try fewer places.
const EFFORT: usize = 1_500_000;
/// Pairs that are added at most to join lines.
const JOINS: usize = 16;
/// Lines that cross edges so many times as often as the field asks for are not looked at: where cotangents are negative the
/// energy is not bounded below in the integers, and singularities far apart may wind without end.
const DENSEST: f64 = 10.0;

/// How many times as often as its field asks for lines cross edges, and whether that is more often than anything is worth.
pub fn density(mesh: &TriMesh, it: &Parameterization) -> (f64, bool) {
    let total = |of: &Field<EdgeId, f64>| of.iter().map(|x| x.abs()).sum::<f64>();
    let times = total(&it.differences(mesh)) / total(it.omega());
    (times, times > DENSEST)
}

/// Why a search ended early.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SearchError {
    /// Interrupted.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// An edit failed.
    #[error(transparent)]
    Align(#[from] AlignError),
}

/// Adds up to `budget` pairs, each the best one to first order, until one lowers the misfit by less than the share
/// `least_gain` of what it was at the start. The pairs added, beginning and end.
pub fn spend(
    it: &mut Parameterization,
    budget: usize,
    least_gain: f64,
    monitor: &Monitor,
) -> Result<Vec<[FaceId; 2]>, SearchError> {
    let start = it.misfit();
    let mut misfit = start;
    let mut out = Vec::new();
    while out.len() < budget {
        monitor.check()?;
        let potential = it.potential();
        let Some([low, high]) = extremes(it, &potential) else { break };
        it.add_pair(Node::Face(low), Node::Face(high))?;
        let now = it.misfit();
        // Also where a pair would fit worse: the slope says nothing of the curvature.
        if !(misfit - now > least_gain * start) {
            it.add_pair(Node::Face(high), Node::Face(low))?;
            break;
        }
        misfit = now;
        out.push([low, high]);
        monitor.progress(out.len() as f64 / budget as f64, "singularities");
    }
    Ok(out)
}

/// The faces of least and largest potential of the component where they are farthest apart.
fn extremes(it: &Parameterization, potential: &[f64]) -> Option<[FaceId; 2]> {
    let tree = &it.solver().tree;
    let mut best: Vec<Option<[usize; 2]>> = vec![None; tree.roots.len()];
    for at in 0..potential.len() {
        if !matches!(tree.node(at), Node::Face(_)) {
            continue;
        }
        let [low, high] = best[tree.component(at)].get_or_insert([at, at]);
        if potential[at] < potential[*low] {
            *low = at;
        }
        if potential[at] > potential[*high] {
            *high = at;
        }
    }
    let span = |pair: &[usize; 2]| potential[pair[1]] - potential[pair[0]];
    let widest = best.into_iter().flatten().max_by(|a, b| span(a).total_cmp(&span(b)).then(b.cmp(a)))?;
    (widest[0] != widest[1]).then(|| widest.map(FaceId::new))
}

/// Adds pairs at tips and saddles of α, each the one that leaves the fewest lines without an end inside the surface (then the
/// fewest lines, then the least misfit), as long as that makes them fewer: rings become spirals from tip to tip, and the
/// strip between them hangs together. The pairs added.
pub fn join(
    mesh: &TriMesh,
    it: &mut Parameterization,
    levels: Levels,
    monitor: &Monitor,
) -> Result<Vec<[FaceId; 2]>, SearchError> {
    let count = |it: &Parameterization| Crossings::new(mesh, &it.alpha, &it.n, levels).count_lines();
    let mut out = Vec::new();
    let mut now = count(it);
    let places = critical(mesh, it);
    while now[0] > 0 && out.len() < JOINS {
        let mut best: Option<([usize; 2], f64, [FaceId; 2])> = None;
        for (i, &a) in places.iter().enumerate() {
            for &b in places.iter().take(i) {
                for pair in [[a, b], [b, a]] {
                    monitor.check()?;
                    let [begin, end] = pair.map(Node::Face);
                    if it.add_pair(begin, end).is_err() {
                        continue;
                    }
                    let misfit = it.misfit();
                    let lines = (!density(mesh, it).1).then(|| count(it));
                    it.add_pair(end, begin)?;
                    let Some(lines) = lines else { continue };
                    if best.is_none_or(|(fewest, least, _)| lines < fewest || (lines == fewest && misfit < least)) {
                        best = Some((lines, misfit, pair));
                    }
                }
            }
        }
        let Some((lines, _, pair)) = best.filter(|it| it.0[0] < now[0]) else { break };
        it.add_pair(Node::Face(pair[0]), Node::Face(pair[1]))?;
        now = lines;
        out.push(pair);
    }
    Ok(out)
}

/// A face at every tip of α, from which it only rises or only falls, those in front around which it changes most; then one at
/// every saddle.
fn critical(mesh: &TriMesh, it: &Parameterization) -> Vec<FaceId> {
    let rank = |v: VertexId| -> Option<(bool, f64)> {
        let rises: Vec<f64> = mesh
            .outgoing(v)
            .map(|h| {
                let e = mesh.edge(h);
                if mesh.halfedge(e) == h { it.difference(mesh, e) } else { -it.difference(mesh, e) }
            })
            .collect();
        let n = rises.len();
        let changes = (0..n).filter(|&k| (rises[k] > 0.0) != (rises[(k + 1) % n] > 0.0)).count();
        let least = rises.iter().map(|x| x.abs()).fold(f64::INFINITY, f64::min);
        (changes != 2).then_some((changes > 2, -least))
    };
    let inner = mesh.vertices().filter(|&v| !mesh.is_boundary_vertex(v));
    let mut found: Vec<((bool, f64), VertexId)> = inner.filter_map(|v| Some((rank(v)?, v))).collect();
    found.sort_by(|a, b| a.0.0.cmp(&b.0.0).then(a.0.1.total_cmp(&b.0.1)).then(a.1.cmp(&b.1)));
    let places = (EFFORT / mesh.face_count().max(1)).isqrt();
    found.truncate(places.clamp(6, PLACES));
    found.into_iter().filter_map(|(_, v)| mesh.outgoing(v).next()).map(|h| mesh.face(h)).collect()
}
