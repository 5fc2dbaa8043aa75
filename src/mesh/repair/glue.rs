//! Joins faces along their edges into vertices: welding, splitting and orienting in one mechanism.
//!
//! A vertex of the result is a class of face corners that are joined through shared edges. So vertices where fans of faces
//! touch in a point alone come apart by themselves, and welding is nothing but joining boundary edges that coincide.
use std::collections::{BTreeMap, BTreeSet, VecDeque};

use super::{Action, MeshRefusal, NAMED, OverusedEdge, Place, Work};
use crate::{geom::Vec3, mesh::trimesh::sorted_edges};

/// Positions and oriented faces, ready for `TriMesh::new`.
pub(super) struct Glued {
    pub(super) positions: Vec<Vec3>,
    pub(super) faces: Vec<[u32; 3]>,
}

/// Two halfedges to be joined; `turned` when they run in the same direction, so that one of the faces must be turned.
#[derive(Clone, Copy)]
struct Joint {
    halfedges: [u32; 2],
    turned: bool,
}

impl Joint {
    /// Between two halfedges with the same two ends among `tails`.
    fn new(g: u32, h: u32, tails: &[u32]) -> Self {
        Self { halfedges: [g, h], turned: tails[g as usize] == tails[h as usize] }
    }

    /// The corners that become one vertex.
    fn corners(&self) -> [[u32; 2]; 2] {
        let [g, h] = self.halfedges;
        if self.turned { [[g, h], [next(g), next(h)]] } else { [[g, next(h)], [next(g), h]] }
    }
}

/// Disjoint sets whose members are turned or not relative to the smallest member of the set.
#[derive(Clone)]
struct Sets {
    parent: Vec<u32>,
    turned: Vec<bool>,
}

impl Sets {
    fn new(len: usize) -> Self {
        Self { parent: (0..len as u32).collect(), turned: vec![false; len] }
    }

    /// The representative of `x`, and whether `x` is turned relative to it.
    fn find(&mut self, x: u32) -> (u32, bool) {
        let mut root = x;
        let mut turned = false;
        while self.parent[root as usize] != root {
            turned ^= self.turned[root as usize];
            root = self.parent[root as usize];
        }
        let (mut at, mut left) = (x, turned);
        while self.parent[at as usize] != root && at != root {
            let (next, own) = (self.parent[at as usize], self.turned[at as usize]);
            (self.parent[at as usize], self.turned[at as usize]) = (root, left);
            (at, left) = (next, left ^ own);
        }
        (root, turned)
    }

    /// Joins the sets of `a` and `b`; false when they are joined already, the other way round.
    fn join(&mut self, a: u32, b: u32, turned: bool) -> bool {
        let ((a, ta), (b, tb)) = (self.find(a), self.find(b));
        let relative = ta ^ tb ^ turned;
        let (low, high) = (a.min(b), a.max(b));
        if low == high {
            return !relative;
        }
        self.parent[high as usize] = low;
        self.turned[high as usize] = relative;
        true
    }
}

fn next(h: u32) -> u32 {
    if h % 3 == 2 { h - 2 } else { h + 1 }
}

/// The smallest vertex at the same position, for every vertex.
pub(super) fn position_ids(positions: &[Vec3]) -> Vec<u32> {
    // Adding 0 turns -0 into 0.
    let key = |v: u32| positions[v as usize].map(|it| it + 0.0);
    let compare = |a: &u32, b: &u32| {
        let (p, q) = (key(*a), key(*b));
        p.x.total_cmp(&q.x).then(p.y.total_cmp(&q.y)).then(p.z.total_cmp(&q.z))
    };
    let mut order: Vec<u32> = (0..positions.len() as u32).collect();
    order.sort_unstable_by(|a, b| compare(a, b).then(a.cmp(b)));
    let mut out = vec![0; positions.len()];
    for run in order.chunk_by(|a, b| compare(a, b).is_eq()) {
        run.iter().for_each(|&v| out[v as usize] = run[0]);
    }
    out
}

/// Edges of two faces become joints; also returns the halfedges of every edge of more than two.
fn joints_by_ids(faces: &[[u32; 3]]) -> (Vec<Joint>, Vec<Vec<u32>>) {
    let tails = faces.as_flattened();
    let (mut joints, mut overused) = (Vec::new(), Vec::new());
    for run in sorted_edges(tails).chunk_by(|x, y| x.0 == y.0) {
        match *run {
            [_] => {}
            [(_, g), (_, h)] => joints.push(Joint::new(g, h, tails)),
            _ => overused.push(run.iter().map(|it| it.1).collect()),
        }
    }
    (joints, overused)
}

/// A representative of its component (joined through edges of two faces) for every face.
pub(super) fn components_by_ids(faces: &[[u32; 3]]) -> Vec<u32> {
    let mut sets = Sets::new(faces.len());
    for joint in joints_by_ids(faces).0 {
        let [g, h] = joint.halfedges;
        // Whether the component can be oriented does not matter here.
        sets.join(g / 3, h / 3, false);
    }
    (0..faces.len() as u32).map(|f| sets.find(f).0).collect()
}

/// Joins, welds, splits and orients.
pub(super) fn glue(work: &mut Work<'_>) -> Result<Glued, MeshRefusal> {
    let (mut joints, overused) = joints_by_ids(&work.faces);
    // Surfaces that touch along an edge may come apart in pairs; an odd number of faces cannot.
    let odd: Vec<_> = overused.iter().filter(|it| it.len() % 2 == 1).collect();
    if !odd.is_empty() {
        return Err(non_manifold(work, &odd));
    }
    let mut sides = Sets::new(work.faces.len());
    for joint in &joints {
        let [g, h] = joint.halfedges;
        if !sides.join(g / 3, h / 3, joint.turned) {
            let (edge, at) = ends(work, g);
            return Err(MeshRefusal::NonOrientable { edge, at });
        }
    }
    let seams = weld(work, &joints, &mut sides);
    joints.extend(seams);
    let mut joined = vec![false; 3 * work.faces.len()];
    joints.iter().flat_map(|it| it.halfedges).for_each(|h| joined[h as usize] = true);
    let open: Vec<_> = overused.iter().filter(|run| run.iter().any(|&h| !joined[h as usize])).collect();
    if !open.is_empty() {
        return Err(non_manifold(work, &open));
    }
    let places =
        overused.iter().take(NAMED).map(|run| Place { what: "edge", id: None, at: ends(work, run[0]).1 }).collect();
    work.report(Action::SplitEdge, overused.len(), places);
    let mut corners = Sets::new(3 * work.faces.len());
    joints.iter().for_each(|it| join_corners(&mut corners, it));
    let (positions, mut faces) = number_vertices(work, &mut corners);
    orient(work, &joints, &mut sides, &mut faces);
    Ok(Glued { positions, faces })
}

/// Vertices and midpoint of the edge of a halfedge.
fn ends(work: &Work<'_>, h: u32) -> ([u32; 2], Vec3) {
    let [a, b] = [h, next(h)].map(|it| work.faces.as_flattened()[it as usize]);
    ([a.min(b), a.max(b)], (work.positions[a as usize] + work.positions[b as usize]) / 2.0)
}

fn non_manifold(work: &Work<'_>, runs: &[&Vec<u32>]) -> MeshRefusal {
    let edge = |run: &&Vec<u32>| {
        let (vertices, at) = ends(work, run[0]);
        OverusedEdge { vertices, faces: run.iter().map(|&h| work.ids[h as usize / 3]).collect(), at }
    };
    MeshRefusal::NonManifold { count: runs.len(), edges: runs.iter().take(NAMED).map(edge).collect() }
}

fn join_corners(corners: &mut Sets, joint: &Joint) {
    for [a, b] in joint.corners() {
        corners.join(a, b, false);
    }
}

/// Joins open halfedges that coincide, as far as that leaves every edge with two faces and the surface two-sided: those
/// that coincide in pairs, then of larger groups those that have come to share an end. `sides` takes up the new joints.
fn weld(work: &Work<'_>, joints: &[Joint], sides: &mut Sets) -> Vec<Joint> {
    /// After so many rounds of taking back what does harm, nothing is welded.
    const ROUNDS: usize = 20;
    let mut seams = Seams::new(work, joints);
    let mut fixed = Sets::new(3 * work.faces.len());
    joints.iter().for_each(|it| join_corners(&mut fixed, it));
    for _ in 0..ROUNDS {
        let (mut corners, mut trial) = (fixed.clone(), sides.clone());
        let welds = seams.join(&mut corners, &mut trial);
        let harmful = overused_classes(work, joints, &welds, &mut corners);
        if harmful.is_empty() {
            *sides = trial;
            return welds;
        }
        let touches = |h: u32, corners: &mut Sets| [h, next(h)].iter().any(|&it| harmful.contains(&corners.find(it).0));
        let banned = welds.iter().flat_map(|it| it.halfedges).filter(|&h| touches(h, &mut corners));
        seams.ban(&banned.collect());
    }
    Vec::new()
}

/// Groups of open halfedges that coincide.
struct Seams {
    /// The smallest vertex at the same position, for every corner.
    tails: Vec<u32>,
    /// The ends of every group and its halfedges.
    groups: Vec<([u32; 2], Vec<u32>)>,
    /// The groups at every position.
    at: BTreeMap<u32, Vec<usize>>,
}

impl Seams {
    fn new(work: &Work<'_>, joints: &[Joint]) -> Self {
        let place = position_ids(work.positions);
        let tails: Vec<u32> = work.faces.iter().flatten().map(|&v| place[v as usize]).collect();
        let mut open = vec![true; tails.len()];
        joints.iter().flat_map(|it| it.halfedges).for_each(|h| open[h as usize] = false);
        let mut boundary = sorted_edges(&tails);
        boundary.retain(|it| open[it.1 as usize]);
        let runs = boundary.chunk_by(|x, y| x.0 == y.0).filter(|run| run.len() > 1);
        let groups: Vec<_> = runs.map(|run| (run[0].0, run.iter().map(|it| it.1).collect())).collect();
        let mut at = BTreeMap::<u32, Vec<usize>>::new();
        for (k, (ends, _)) in groups.iter().enumerate() {
            ends.iter().for_each(|&it| at.entry(it).or_default().push(k));
        }
        Self { tails, groups, at }
    }

    /// Keeps halfedges out of all further joints.
    fn ban(&mut self, halfedges: &BTreeSet<u32>) {
        self.groups.iter_mut().for_each(|(_, group)| group.retain(|it| !halfedges.contains(it)));
    }

    fn join(&self, corners: &mut Sets, sides: &mut Sets) -> Vec<Joint> {
        let mut open: Vec<Vec<u32>> = self.groups.iter().map(|it| it.1.clone()).collect();
        let mut welds = Vec::new();
        let mut connect = |g: u32, h: u32, corners: &mut Sets| {
            let joint = Joint::new(g, h, &self.tails);
            let fits = sides.join(g / 3, h / 3, joint.turned);
            if fits {
                join_corners(corners, &joint);
                welds.push(joint);
            }
            fits
        };
        let (pairs, larger): (Vec<usize>, Vec<usize>) = (0..open.len()).partition(|&k| open[k].len() <= 2);
        for k in pairs {
            if let [g, h] = open[k][..] {
                connect(g, h, corners);
            }
            open[k].clear();
        }
        let mut queue: VecDeque<usize> = larger.into();
        while let Some(k) = queue.pop_front() {
            let ends = self.groups[k].0;
            for end in ends {
                // Where just two of a group have an end in common they are neighbours.
                let corner = |&h: &u32| if self.tails[h as usize] == end { h } else { next(h) };
                let mut classes: Vec<(u32, u32)> = open[k].iter().map(|h| (corners.find(corner(h)).0, *h)).collect();
                classes.sort_unstable();
                for run in classes.chunk_by(|x, y| x.0 == y.0).filter(|run| run.len() == 2) {
                    if connect(run[0].1, run[1].1, corners) {
                        open[k].retain(|&it| it != run[0].1 && it != run[1].1);
                        queue.extend(ends.iter().flat_map(|it| &self.at[it]).filter(|&&it| !open[it].is_empty()));
                    }
                }
            }
        }
        welds
    }
}

/// Corner classes at the ends of edges that would be more than one edge, or at faces that would lose a corner.
fn overused_classes(work: &Work<'_>, joints: &[Joint], welds: &[Joint], corners: &mut Sets) -> BTreeSet<u32> {
    let mut first_of_pair = vec![true; 3 * work.faces.len()];
    joints.iter().chain(welds).for_each(|it| first_of_pair[it.halfedges[1] as usize] = false);
    let classes: Vec<u32> = (0..first_of_pair.len() as u32).map(|it| corners.find(it).0).collect();
    let mut edges = sorted_edges(&classes);
    edges.retain(|it| first_of_pair[it.1 as usize]);
    let doubled = edges.chunk_by(|x, y| x.0 == y.0).filter(|run| run.len() > 1 || run[0].0[0] == run[0].0[1]);
    doubled.flat_map(|run| run[0].0).collect()
}

/// One vertex per class of corners, in the order of the file; reports welds and splits.
fn number_vertices(work: &mut Work<'_>, corners: &mut Sets) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let tails = work.faces.as_flattened();
    let classes: Vec<u32> = (0..tails.len() as u32).map(|it| corners.find(it).0).collect();
    let mut uses: Vec<(u32, u32)> = classes.iter().zip(tails).map(|(&class, &vertex)| (vertex, class)).collect();
    uses.sort_unstable();
    uses.dedup();
    let mut number = vec![u32::MAX; tails.len()];
    let mut positions = Vec::new();
    let mut welded = Vec::new();
    for &(vertex, class) in &uses {
        if number[class as usize] == u32::MAX {
            number[class as usize] = positions.len() as u32;
            positions.push(work.positions[vertex as usize].map(|it| it + 0.0));
        } else {
            welded.push(vertex as usize);
        }
    }
    let split: Vec<usize> = uses.windows(2).filter(|it| it[0].0 == it[1].0).map(|it| it[1].0 as usize).collect();
    let faces = classes.chunks_exact(3).map(|c| [c[0], c[1], c[2]].map(|it| number[it as usize])).collect();
    for (action, mut vertices) in [(Action::Weld, welded), (Action::Split, split)] {
        vertices.dedup();
        let places = vertices.iter().take(NAMED).map(|&v| work.vertex_place(v)).collect();
        work.report(action, vertices.len(), places);
    }
    (positions, faces)
}

/// Turns faces so that neighbours agree: closed components outwards, others like most of their faces. Reports both.
fn orient(work: &mut Work<'_>, joints: &[Joint], sides: &mut Sets, faces: &mut [[u32; 3]]) {
    let count = faces.len();
    let members: Vec<(u32, bool)> = (0..count as u32).map(|f| sides.find(f)).collect();
    let mut joined = vec![0_u8; count];
    joints.iter().flat_map(|it| it.halfedges).for_each(|h| joined[h as usize / 3] += 1);
    // By component, at the index of its first face.
    let mut closed = vec![true; count];
    let mut balance = vec![0_i64; count];
    let mut volume = vec![0.0; count];
    let mut area = vec![0.0; count];
    for (f, &(root, turned)) in members.iter().enumerate() {
        let root = root as usize;
        closed[root] &= joined[f] == 3;
        balance[root] += if turned { -1 } else { 1 };
        let origin = work.corners(root)[0];
        let [a, b, c] = work.corners(f).map(|p| p - origin);
        volume[root] += a.dot(&b.cross(&c)) / 6.0 * if turned { -1.0 } else { 1.0 };
        area[root] += (b - a).cross(&(c - a)).norm() / 2.0;
    }
    let mut oriented = Vec::new();
    let mut outwards = Vec::new();
    for (f, &(root, turned)) in members.iter().enumerate() {
        let root = root as usize;
        let minority = balance[root] < 0;
        // A closed component without volume has no outside.
        let inside_out =
            closed[root] && volume[root].abs() > 1e-9 * area[root].powf(1.5) && (volume[root] < 0.0) != minority;
        if turned != minority {
            oriented.push(f);
        }
        if inside_out && f == root {
            outwards.push(Place { what: "component", ..work.face_place(f) });
        }
        if turned ^ minority ^ inside_out {
            faces[f].swap(1, 2);
        }
    }
    let places = oriented.iter().take(NAMED).map(|&f| work.face_place(f)).collect();
    work.report(Action::Orient, oriented.len(), places);
    work.report(Action::TurnOutwards, outwards.len(), outwards.into_iter().take(NAMED).collect());
}
