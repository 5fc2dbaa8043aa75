//! Cut graphs: edges along which a surface must be opened so that every component becomes a disk.
//!
//! Genus: tree–cotree (Eppstein 2003; Erickson, Whittlesey 2005). Boundaries and terminals: joined by a tree of shortest
//! paths. Then every arc of the graph is exchanged for the shortest one that does the same, as long as that helps.
use super::{
    chart::{Chart, ChartBuilder},
    paths::{DisjointSets, EdgeGraph, PathTree, joining_tree},
};
use crate::{
    mesh::{EdgeId, FaceId, Field, HalfedgeId, TriMesh, VertexId},
    numeric::{Cancelled, Monitor},
};

const NONE: u32 = u32::MAX;
/// How many roots of the tree–cotree decomposition are tried; the first guess is seldom the best, and more than a few
/// hardly help once arcs are exchanged.
const ROOTS: usize = 4;
/// Rounds of arc exchange at most; it has settled after two or three.
const EXCHANGES: usize = 8;

/// Adds to `cut` what opens every component of `faces` into a disk, short in the sense of `weight` (positive): handles
/// are cut, boundary loops and the `terminals` joined. A closed component of genus 0 without two terminals is opened
/// along a path between the two vertices where `curvature` is largest. Edges cut before are kept, and the components
/// meant are those of the mesh as it is opened by them; `faces` must be whole ones.
pub fn cut_to_disks(
    mesh: &TriMesh,
    faces: &[FaceId],
    weight: &Field<EdgeId, f64>,
    curvature: &Field<VertexId, f64>,
    terminals: &[VertexId],
    cut: &mut Field<EdgeId, bool>,
    monitor: &Monitor,
) -> Result<(), Cancelled> {
    let mut builder = ChartBuilder::new(mesh);
    let kept = cut.clone();
    let mut is_terminal = Field::filled(mesh.vertex_count(), false);
    for &v in terminals {
        is_terminal[v] = true;
    }
    for faces in builder.components(faces, &|e| kept[e]) {
        let chart = builder.chart(faces, &|e| kept[e]);
        let handles = handle_cut(mesh, &chart, weight);
        if !handles.is_empty() {
            for edge in handles {
                cut[edge] = true;
            }
            exchange_arcs(&mut builder, &chart.faces, weight, &kept, cut, monitor)?;
        }
        let chart = builder.chart(chart.faces, &|e| cut[e]);
        let graph = EdgeGraph::new(mesh, &chart, weight);
        let mut group = chart.loop_of_vertices();
        let mut groups = chart.loops.len() as u32;
        for v in 0..chart.vertex_count() {
            if is_terminal[chart.origin[v]] && group[v] == NONE {
                group[v] = groups;
                groups += 1;
            }
        }
        if chart.loops.is_empty() && (groups < 2 || adjacent_pair_only(&graph, &group)) {
            opening_pair(&graph, &chart, curvature, &mut group);
        }
        for h in joining_tree(&graph, &group) {
            cut[mesh.edge(h)] = true;
        }
    }
    Ok(())
}

/// Whether the only two terminals are neighbours: a cut of a single edge does not open a surface.
fn adjacent_pair_only(graph: &EdgeGraph, group: &[u32]) -> bool {
    let members: Vec<u32> = (0..group.len() as u32).filter(|&v| group[v as usize] != NONE).collect();
    matches!(*members, [a, b] if graph.links(a).iter().any(|it| it.to == b))
}

/// Makes the vertex of largest |curvature| and the largest one that is not its neighbour the two groups (on a tetrahedron,
/// where all are neighbours, a third vertex is added instead).
fn opening_pair(graph: &EdgeGraph, chart: &Chart, curvature: &Field<VertexId, f64>, group: &mut [u32]) {
    let mut order: Vec<u32> = (0..chart.vertex_count() as u32).collect();
    let key = |v: u32| curvature[chart.origin[v as usize]].abs();
    order.sort_by(|&a, &b| key(b).total_cmp(&key(a)).then(a.cmp(&b)));
    group.fill(NONE);
    let first = order[0];
    let near = |v: u32| v == first || graph.links(first).iter().any(|it| it.to == v);
    group[first as usize] = 0;
    match order.iter().find(|&&v| !near(v)) {
        Some(&second) => group[second as usize] = 1,
        None => {
            for (k, &v) in order[1..].iter().take(2).enumerate() {
                group[v as usize] = k as u32 + 1;
            }
        }
    }
}

/// Edges that cut the handles of a connected chart: 2 g loops through a common root without their common tails, for the
/// best of a few roots. Empty for genus 0.
fn handle_cut(mesh: &TriMesh, chart: &Chart, weight: &Field<EdgeId, f64>) -> Vec<EdgeId> {
    if 2 - chart.loops.len() as i64 - chart.euler_characteristic() == 0 {
        return Vec::new();
    }
    let graph = EdgeGraph::with_boundary(mesh, chart, weight);
    let mut roots = vec![(0, 0.0)];
    let mut best: Option<(f64, Vec<EdgeId>)> = None;
    for k in 0..ROOTS {
        let edges = loops_through(mesh, chart, &graph, roots[k].0);
        let length: f64 = edges.iter().map(|&e| weight[e]).sum();
        if best.as_ref().is_none_or(|it| length < it.0) {
            best = Some((length, edges));
        }
        // The next root is the vertex farthest from all before.
        let far = PathTree::new(&graph, &roots, |_, _| Some(true)).distance;
        let next = (0..far.len() as u32).filter(|&v| far[v as usize].is_finite());
        let next = next.max_by(|&a, &b| far[a as usize].total_cmp(&far[b as usize]).then(b.cmp(&a)));
        roots.push((next.unwrap_or(0), 0.0));
    }
    best.map(|it| it.1).unwrap_or_default()
}

/// Tree–cotree from one root on the surface whose boundary loops are closed by a cap each: shortest path tree T; spanning
/// tree of the dual that keeps the edges with the longest loops through the root; what is in neither closes the 2 g loops.
fn loops_through(mesh: &TriMesh, chart: &Chart, graph: &EdgeGraph, root: u32) -> Vec<EdgeId> {
    let tree = PathTree::new(graph, &[(root, 0.0)], |_, _| Some(true));
    let mut in_tree: Vec<HalfedgeId> = tree.parent.iter().flatten().map(|it| it.1).collect();
    in_tree.sort_unstable();
    let mut rest: Vec<(f64, HalfedgeId, u32, u32)> = Vec::new();
    for v in 0..graph.vertex_count() as u32 {
        for link in graph.links(v).iter().filter(|it| it.to > v && in_tree.binary_search(&it.halfedge).is_err()) {
            let length = tree.distance[v as usize] + link.weight + tree.distance[link.to as usize];
            rest.push((length, link.halfedge, v, link.to));
        }
    }
    rest.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    let mut caps: Vec<(HalfedgeId, u32)> = Vec::new();
    for (k, path) in chart.loops.iter().enumerate() {
        caps.extend(path.iter().map(|it| (it.0, (chart.faces.len() + k) as u32)));
    }
    caps.sort_unstable();
    let local = |f: FaceId| chart.faces.binary_search(&f).expect("a chart is closed under crossing inner edges") as u32;
    let sides = |h: HalfedgeId| {
        let other = match (caps.binary_search_by_key(&h, |it| it.0), mesh.twin(h)) {
            (Ok(k), _) => caps[k].1,
            (Err(_), Some(twin)) => local(mesh.face(twin)),
            (Err(_), None) => unreachable!("a halfedge without a twin lies on a loop"),
        };
        [local(mesh.face(h)), other]
    };
    let mut faces = DisjointSets::new(chart.faces.len() + chart.loops.len());
    let mut loops = Vec::new();
    for (_, h, a, b) in rest {
        let [f, g] = sides(h);
        if !faces.join(f, g) {
            loops.push(h);
            loops.extend(tree.path(a));
            loops.extend(tree.path(b));
        }
    }
    let inner = loops.into_iter().filter(|h| caps.binary_search_by_key(h, |it| it.0).is_err());
    let mut edges: Vec<EdgeId> = inner.map(|h| mesh.edge(h)).collect();
    edges.sort_unstable();
    edges.dedup();
    prune(mesh, chart, edges)
}

/// Drops edges that end nowhere: at a vertex off the boundary with no other edge.
fn prune(mesh: &TriMesh, chart: &Chart, edges: Vec<EdgeId>) -> Vec<EdgeId> {
    let mut anchored = Field::<VertexId, bool>::filled(mesh.vertex_count(), false);
    for v in 0..chart.vertex_count() {
        anchored[chart.origin[v]] |= chart.on_boundary[v];
    }
    let mut at: Field<VertexId, Vec<EdgeId>> = Field::filled(mesh.vertex_count(), Vec::new());
    for &e in &edges {
        for v in mesh.edge_vertices(e) {
            at[v].push(e);
        }
    }
    let mut dropped = Vec::new();
    let mut stack: Vec<VertexId> = edges.iter().flat_map(|&e| mesh.edge_vertices(e)).collect();
    while let Some(v) = stack.pop() {
        if anchored[v] || at[v].len() != 1 {
            continue;
        }
        let e = at[v][0];
        dropped.push(e);
        for w in mesh.edge_vertices(e) {
            at[w].retain(|&it| it != e);
            stack.push(w);
        }
    }
    dropped.sort_unstable();
    edges.into_iter().filter(|e| dropped.binary_search(e).is_err()).collect()
}

/// A maximal chain of cut edges between branching points, ends, and the boundary.
pub fn arcs(mesh: &TriMesh, cut: &Field<EdgeId, bool>) -> Vec<Vec<EdgeId>> {
    let is_cut = |e: EdgeId| cut[e] && !mesh.is_boundary_edge(e);
    let degree = |v: VertexId| mesh.outgoing(v).filter(|&h| is_cut(mesh.edge(h))).count();
    let passes = |v: VertexId| !mesh.is_boundary_vertex(v) && degree(v) == 2;
    let mut seen = Field::filled(mesh.edge_count(), false);
    let mut out = Vec::new();
    let mut walk = |start: HalfedgeId, seen: &mut Field<EdgeId, bool>| {
        let mut chain = vec![mesh.edge(start)];
        seen[mesh.edge(start)] = true;
        let mut at = mesh.head(start);
        while passes(at) {
            let next = mesh.outgoing(at).find(|&h| is_cut(mesh.edge(h)) && !seen[mesh.edge(h)]);
            let Some(h) = next else { break };
            seen[mesh.edge(h)] = true;
            chain.push(mesh.edge(h));
            at = mesh.head(h);
        }
        out.push(chain);
    };
    for v in mesh.vertices().filter(|&v| !passes(v)) {
        for h in mesh.outgoing(v) {
            if is_cut(mesh.edge(h)) && !seen[mesh.edge(h)] {
                walk(h, &mut seen);
            }
        }
    }
    // What is left are rings without any branching point.
    for e in mesh.edges() {
        if is_cut(e) && !seen[e] {
            walk(mesh.halfedge(e), &mut seen);
        }
    }
    out
}

/// Replaces arcs by shorter ones: gluing one arc splits the boundary loop on which both its sides lie in two, and any
/// path between these two does what the arc did.
fn exchange_arcs(
    builder: &mut ChartBuilder,
    faces: &[FaceId],
    weight: &Field<EdgeId, f64>,
    kept: &Field<EdgeId, bool>,
    cut: &mut Field<EdgeId, bool>,
    monitor: &Monitor,
) -> Result<(), Cancelled> {
    let mesh = builder.mesh();
    let mut inside = Field::filled(mesh.face_count(), false);
    for &f in faces {
        inside[f] = true;
    }
    let length = |arc: &[EdgeId]| arc.iter().map(|&e| weight[e]).sum::<f64>();
    for _ in 0..EXCHANGES {
        let own = Field::from_fn(mesh.edge_count(), |e| cut[e] && inside[mesh.face(mesh.halfedge(e))]);
        let mut arcs = arcs(mesh, &own);
        arcs.sort_by(|a, b| length(b).total_cmp(&length(a)).then_with(|| a.cmp(b)));
        let mut improved = false;
        for arc in arcs {
            monitor.check()?;
            // A path that replaced another arc may branch off in the middle of this one: it waits for the next round.
            let through = |pair: &[EdgeId]| {
                let [a, b] = mesh.edge_vertices(pair[0]);
                let v = if mesh.edge_vertices(pair[1]).contains(&a) { a } else { b };
                mesh.outgoing(v).filter(|&h| cut[mesh.edge(h)]).count() == 2
            };
            if arc.iter().any(|&e| kept[e] || !cut[e]) || !arc.windows(2).all(through) {
                continue;
            }
            let path = shortest_substitute(builder, faces, weight, cut, &arc);
            let shorter = path.filter(|it| length(it) < (1.0 - 1e-9) * length(&arc));
            if let Some(path) = shorter {
                improved = true;
                for &e in &arc {
                    cut[e] = false;
                }
                for e in path {
                    cut[e] = true;
                }
            }
        }
        if !improved {
            break;
        }
    }
    Ok(())
}

/// The shortest path that does what `arc` does; `None` where its two sides lie on different loops.
fn shortest_substitute(
    builder: &mut ChartBuilder,
    faces: &[FaceId],
    weight: &Field<EdgeId, f64>,
    cut: &Field<EdgeId, bool>,
    arc: &[EdgeId],
) -> Option<Vec<EdgeId>> {
    let mesh = builder.mesh();
    let before = builder.chart(faces.to_vec(), &|e| cut[e]);
    let h = mesh.halfedge(arc[0]);
    let split = before.loops.iter().find(|path| path.iter().any(|it| it.0 == h))?;
    let mut rim: Vec<HalfedgeId> = split.iter().map(|it| it.0).collect();
    rim.sort_unstable();
    let glued = |e: EdgeId| cut[e] && !arc.contains(&e);
    let chart = builder.chart(before.faces, &glued);
    let mut group = chart.loop_of_vertices();
    let halves: Vec<u32> = (0..chart.loops.len() as u32)
        .filter(|&k| chart.loops[k as usize].iter().any(|it| rim.binary_search(&it.0).is_ok()))
        .collect();
    if halves.len() != 2 || chart.loops.len() != before.loops.len() + 1 {
        return None;
    }
    for it in &mut group {
        *it = halves.iter().position(|k| k == it).map_or(NONE, |k| k as u32);
    }
    let path = joining_tree(&EdgeGraph::new(mesh, &chart, weight), &group);
    (!path.is_empty()).then(|| path.into_iter().map(|h| mesh.edge(h)).collect())
}
