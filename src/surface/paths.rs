//! Shortest paths along the edges of a chart, and trees that join sets of vertices. All ties are broken by ids, so the
//! result depends on nothing but the input.
use std::{cmp::Reverse, collections::BinaryHeap};

use super::chart::Chart;
use crate::mesh::{EdgeId, Field, HalfedgeId, TriMesh};

const NONE: u32 = u32::MAX;

/// A distance that can be compared: finite and never NaN.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Distance(f64);

impl Eq for Distance {}
impl PartialOrd for Distance {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}
impl Ord for Distance {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.0.total_cmp(&other.0)
    }
}

/// One way along an edge.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Link {
    /// Where it leads.
    pub to: u32,
    /// One of the halfedges of the chart along the edge, in either direction.
    pub halfedge: HalfedgeId,
    /// Its weight.
    pub weight: f64,
}

/// The edges of a chart, from both ends.
#[derive(Debug, Clone)]
pub struct EdgeGraph {
    starts: Vec<u32>,
    links: Vec<Link>,
}

impl EdgeGraph {
    /// The inner edges of a chart, with a positive weight per edge of the mesh. Its boundary is open already.
    pub fn new(mesh: &TriMesh, chart: &Chart, weight: &Field<EdgeId, f64>) -> Self {
        Self::build(mesh, chart, weight, false)
    }

    /// The same with the boundary edges, along which every way is free.
    pub fn with_boundary(mesh: &TriMesh, chart: &Chart, weight: &Field<EdgeId, f64>) -> Self {
        Self::build(mesh, chart, weight, true)
    }

    fn build(mesh: &TriMesh, chart: &Chart, weight: &Field<EdgeId, f64>, with_boundary: bool) -> Self {
        let mut open: Vec<HalfedgeId> = chart.loops.iter().flatten().map(|it| it.0).collect();
        open.sort_unstable();
        let mut edges: Vec<(u32, u32, Link)> = Vec::with_capacity(3 * chart.faces.len() / 2 + open.len());
        for (halfedge, a, b) in chart.halfedges() {
            let e = mesh.edge(halfedge);
            let link = Link { to: b, halfedge, weight: weight[e] };
            if open.binary_search(&halfedge).is_ok() {
                if with_boundary {
                    edges.push((a, b, Link { weight: 0.0, ..link }));
                }
            } else if mesh.halfedge(e) == halfedge {
                // An inner edge has two halfedges in the chart; the one that names the edge stands for both.
                edges.push((a, b, link));
            }
        }
        let mut starts = vec![0_u32; chart.vertex_count() + 1];
        for &(a, b, _) in &edges {
            starts[a as usize + 1] += 1;
            starts[b as usize + 1] += 1;
        }
        for v in 0..chart.vertex_count() {
            starts[v + 1] += starts[v];
        }
        let mut fill = starts.clone();
        let mut links = vec![Link { to: NONE, halfedge: HalfedgeId(NONE), weight: 0.0 }; 2 * edges.len()];
        for (a, b, link) in edges {
            for (from, to) in [(a, b), (b, a)] {
                links[fill[from as usize] as usize] = Link { to, ..link };
                fill[from as usize] += 1;
            }
        }
        Self { starts, links }
    }

    /// Number of vertices.
    pub fn vertex_count(&self) -> usize {
        self.starts.len() - 1
    }

    /// Ways out of a vertex.
    pub fn links(&self, v: u32) -> &[Link] {
        &self.links[self.starts[v as usize] as usize..self.starts[v as usize + 1] as usize]
    }
}

/// Shortest paths from a set of sources.
#[derive(Debug, Clone)]
pub struct PathTree {
    /// Distance from the nearest source; infinite where there is no way or the search ended before.
    pub distance: Vec<f64>,
    /// The vertex before and a halfedge of the edge to it; `None` at sources and where nothing leads.
    pub parent: Vec<Option<(u32, HalfedgeId)>>,
    /// The nearest source (index into the sources given); `u32::MAX` where nothing leads.
    pub source: Vec<u32>,
}

impl PathTree {
    /// Dijkstra from `sources` with their starting distances. `expand(v, distance)` says whether to go on from a settled
    /// vertex; returning `None` ends the search there, with `v` settled.
    pub fn new(graph: &EdgeGraph, sources: &[(u32, f64)], mut expand: impl FnMut(u32, f64) -> Option<bool>) -> Self {
        let n = graph.vertex_count();
        let mut out = Self { distance: vec![f64::INFINITY; n], parent: vec![None; n], source: vec![NONE; n] };
        let mut heap = BinaryHeap::new();
        for (k, &(v, start)) in sources.iter().enumerate() {
            if start < out.distance[v as usize] {
                out.distance[v as usize] = start;
                out.source[v as usize] = k as u32;
                heap.push(Reverse((Distance(start), v)));
            }
        }
        while let Some(Reverse((Distance(distance), v))) = heap.pop() {
            if distance > out.distance[v as usize] {
                continue;
            }
            match expand(v, distance) {
                None => break,
                Some(false) => continue,
                Some(true) => {}
            }
            for link in graph.links(v) {
                let there = distance + link.weight;
                let to = link.to as usize;
                if there < out.distance[to] {
                    out.distance[to] = there;
                    out.parent[to] = Some((v, link.halfedge));
                    out.source[to] = out.source[v as usize];
                    heap.push(Reverse((Distance(there), link.to)));
                }
            }
        }
        out
    }

    /// A halfedge of each edge from `v` back to its source; empty at a source.
    pub fn path(&self, v: u32) -> Vec<HalfedgeId> {
        let mut out = Vec::new();
        let mut at = v;
        while let Some((before, halfedge)) = self.parent[at as usize] {
            out.push(halfedge);
            at = before;
        }
        out
    }
}

/// A halfedge of each edge of a tree that joins all groups of vertices that can be joined, at most twice the shortest (Mehlhorn 1988): the
/// minimum spanning tree of the shortest paths between neighbouring Voronoi regions. `group[v]` numbers the group of a
/// vertex, `u32::MAX` for none; members of one group count as joined already.
pub fn joining_tree(graph: &EdgeGraph, group: &[u32]) -> Vec<HalfedgeId> {
    let sources: Vec<(u32, f64)> =
        (0..group.len() as u32).filter(|&v| group[v as usize] != NONE).map(|v| (v, 0.0)).collect();
    let tree = PathTree::new(graph, &sources, |_, _| Some(true));
    let region = |v: u32| match tree.source[v as usize] {
        NONE => NONE,
        k => group[sources[k as usize].0 as usize],
    };
    let mut bridges: Vec<(Distance, HalfedgeId, u32, u32)> = Vec::new();
    for v in 0..graph.vertex_count() as u32 {
        for link in graph.links(v).iter().filter(|it| it.to > v) {
            if region(v) != region(link.to) && region(v) != NONE && region(link.to) != NONE {
                let length = tree.distance[v as usize] + link.weight + tree.distance[link.to as usize];
                bridges.push((Distance(length), link.halfedge, v, link.to));
            }
        }
    }
    bridges.sort_unstable();
    let mut sets = DisjointSets::new(group.iter().filter(|&&g| g != NONE).max().map_or(0, |&g| g as usize + 1));
    let mut out = Vec::new();
    for (_, edge, a, b) in bridges {
        if sets.join(region(a), region(b)) {
            out.push(edge);
            out.extend(tree.path(a));
            out.extend(tree.path(b));
        }
    }
    out.sort_unstable();
    out.dedup();
    out
}

/// Union–find with path halving; the smaller root wins, so the representative is the least member.
#[derive(Debug, Clone)]
pub struct DisjointSets(Vec<u32>);

impl DisjointSets {
    /// `n` sets of one.
    pub fn new(n: usize) -> Self {
        Self((0..n as u32).collect())
    }

    /// The least member of the set of `i`.
    pub fn find(&mut self, mut i: u32) -> u32 {
        while self.0[i as usize] != i {
            self.0[i as usize] = self.0[self.0[i as usize] as usize];
            i = self.0[i as usize];
        }
        i
    }

    /// Joins two sets; `false` if they were one.
    pub fn join(&mut self, a: u32, b: u32) -> bool {
        let (a, b) = (self.find(a), self.find(b));
        self.0[a.max(b) as usize] = a.min(b);
        a != b
    }
}
