//! What the user drew on the input, found again on the developed mesh.
use crate::{
    geom::Vec3,
    mesh::{Bvh, EdgeId, FaceId, Field, TriMesh, VertexId},
    surface::{
        chart::{Chart, ChartBuilder},
        paths::{EdgeGraph, PathTree},
    },
};

/// A point of the surface lies on a patch when it is no farther from it than from the rest, up to this share of the
/// diagonal.
const ON_PATCH: f64 = 1e-9;

/// Drawn lines as edges of a mesh.
#[derive(Debug, Clone, PartialEq)]
pub struct Traced {
    /// The edges, ascending, none of them on the boundary.
    pub edges: Vec<EdgeId>,
    /// The given point that is farthest from the surface, and its distance, mm.
    pub farthest: (Vec3, f64),
    /// Largest distance of a given point from the edges, mm; 0 without edges.
    pub offset: f64,
    /// Pairs of following points that lie on different components, so that no path joins them.
    pub broken: usize,
}

/// Follows `lines` along the edges of a mesh: points no farther apart than its mean edge are taken along them, moved to the
/// nearest corner of the face closest to them, and joined by shortest paths.
pub fn trace(mesh: &TriMesh, lines: &[Vec<Vec3>]) -> Traced {
    let bvh = Bvh::new(mesh);
    let lengths = Field::from_fn(mesh.edge_count(), |e| mesh.edge_length(e));
    let step = lengths.iter().sum::<f64>() / mesh.edge_count() as f64;
    let chart = ChartBuilder::new(mesh).chart(mesh.faces().collect(), &|_| false);
    let graph = EdgeGraph::new(mesh, &chart, &lengths);
    let mut local = Field::<VertexId, u32>::filled(mesh.vertex_count(), 0);
    chart.origin.iter().zip(0..).for_each(|(&v, k)| local[v] = k);
    let mut out = Traced { edges: Vec::new(), farthest: (Vec3::zeros(), 0.0), offset: 0.0, broken: 0 };
    for p in lines.iter().flatten() {
        let distance = bvh.closest(*p).distance;
        if distance > out.farthest.1 {
            out.farthest = (*p, distance);
        }
    }
    for line in lines {
        let mut last: Option<VertexId> = None;
        for p in spaced(line, step) {
            let closest = bvh.closest(p);
            let near = |v: &VertexId| (mesh.position(*v) - closest.point).norm();
            let v = mesh.face_vertices(closest.face).into_iter().min_by(|a, b| near(a).total_cmp(&near(b)));
            if let (Some(from), Some(to)) = (last, v)
                && from != to
            {
                match path(mesh, (&graph, &chart), local[from], local[to]) {
                    Some(edges) => out.edges.extend(edges),
                    None => out.broken += 1,
                }
            }
            last = v;
        }
    }
    out.edges.sort_unstable();
    out.edges.dedup();
    if !out.edges.is_empty() {
        // A segment is a triangle that repeats an end.
        let segment = |&e: &EdgeId| {
            let [a, b] = mesh.edge_vertices(e).map(|v| mesh.position(v));
            [a, b, b]
        };
        let seam = Bvh::of_triangles(out.edges.iter().map(segment).collect());
        out.offset = lines.iter().flatten().map(|p| seam.closest(*p).distance).fold(0.0, f64::max);
    }
    out
}

/// The edges of the shortest path; none along an edge of the boundary, which is open as it is. `None` without a path.
fn path(mesh: &TriMesh, (graph, chart): (&EdgeGraph, &Chart), from: u32, to: u32) -> Option<Vec<EdgeId>> {
    let [a, b] = [from, to].map(|v| chart.origin[v as usize]);
    let along = mesh.find_halfedge(a, b).or_else(|| mesh.find_halfedge(b, a));
    if along.is_some_and(|h| mesh.is_boundary_edge(mesh.edge(h))) {
        return Some(Vec::new());
    }
    let tree = PathTree::new(graph, &[(from, 0.0)], |v, _| (v != to).then_some(true));
    tree.distance[to as usize].is_finite().then(|| tree.path(to).into_iter().map(|h| mesh.edge(h)).collect())
}

/// The points of a line with more in between, at most `step` apart.
fn spaced(line: &[Vec3], step: f64) -> Vec<Vec3> {
    let mut out: Vec<Vec3> = line.first().copied().into_iter().collect();
    for pair in line.windows(2) {
        let parts = ((pair[1] - pair[0]).norm() / step).ceil().max(1.0);
        out.extend((1..=parts as usize).map(|k| pair[0] + (pair[1] - pair[0]) * (k as f64 / parts)));
    }
    out
}

/// The faces of `mesh` whose centre is closest to a part of `source` that `patch` (triangles of the source) covers.
pub fn painted(mesh: &TriMesh, source: &Bvh, patch: &[[Vec3; 3]]) -> Vec<FaceId> {
    let near = Bvh::of_triangles(patch.to_vec());
    let slack = ON_PATCH * mesh.bounds().diagonal();
    let centre = |f: FaceId| mesh.face_positions(f).iter().sum::<Vec3>() / 3.0;
    let is_painted = |f: &FaceId| near.is_within(centre(*f), source.closest(centre(*f)).distance + slack);
    mesh.faces().filter(is_painted).collect()
}

/// How many handles and closed components the cuts `edges` leave: what must be cut beyond them so that all lies flat.
pub fn left_uncut(mesh: &TriMesh, edges: &[EdgeId]) -> (usize, usize) {
    let cut = |e: EdgeId| edges.binary_search(&e).is_ok();
    let mut builder = ChartBuilder::new(mesh);
    let all: Vec<FaceId> = mesh.faces().collect();
    let charts = builder.components(&all, &cut).into_iter();
    let charts: Vec<Chart> = charts.map(|faces| builder.chart(faces, &cut)).collect();
    let handles = charts.iter().map(|it| (2 - it.loops.len() as i64 - it.euler_characteristic()) / 2).sum::<i64>();
    (handles.max(0) as usize, charts.iter().filter(|it| it.loops.is_empty()).count())
}
