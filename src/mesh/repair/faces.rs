//! Repairs of single faces: repeated corners, duplicates, faces without area.
use std::collections::{BTreeMap, BTreeSet};

use super::{Action, MeshRefusal, NAMED, Work, glue};
use crate::mesh::trimesh::is_degenerate;

pub(super) fn drop_repeated_corners(work: &mut Work<'_>) {
    let keep: Vec<bool> = work.faces.iter().map(|[a, b, c]| a != b && b != c && c != a).collect();
    work.retain(Action::DropRepeatedCorner, &keep);
}

/// Of faces with the same three vertices, in whatever order, keeps the first.
pub(super) fn drop_duplicates(work: &mut Work<'_>) {
    let mut order: Vec<([u32; 3], usize)> = work.faces.iter().enumerate().map(|(f, it)| (sorted(*it), f)).collect();
    order.sort_unstable();
    let mut keep = vec![true; work.faces.len()];
    for pair in order.windows(2).filter(|it| it[0].0 == it[1].0) {
        keep[pair[1].1] = false;
    }
    work.retain(Action::DropDuplicate, &keep);
}

fn sorted([a, b, c]: [u32; 3]) -> [u32; 3] {
    let mut out = [a, b, c];
    out.sort_unstable();
    out
}

/// Drops connected components all of whose faces lie exactly on faces of components before them: a copy of an object, or
/// the back of a sheet that was modelled on both sides.
pub(super) fn drop_doubled_components(work: &mut Work<'_>) {
    let mut members: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    for (f, root) in glue::components_by_ids(&work.faces).into_iter().enumerate() {
        members.entry(root).or_default().push(f);
    }
    if members.len() < 2 {
        return;
    }
    let place = glue::position_ids(work.positions);
    let key = |f: usize| sorted(work.faces[f].map(|v| place[v as usize]));
    let mut seen = BTreeSet::new();
    let mut keep = vec![true; work.faces.len()];
    for faces in members.values() {
        if faces.iter().all(|&f| seen.contains(&key(f))) {
            faces.iter().for_each(|&f| keep[f] = false);
        } else {
            seen.extend(faces.iter().map(|&f| key(f)));
        }
    }
    work.retain(Action::DropDuplicate, &keep);
}

fn edge(a: u32, b: u32) -> [u32; 2] {
    [a.min(b), a.max(b)]
}

fn edges_of([a, b, c]: [u32; 3]) -> [[u32; 2]; 3] {
    [edge(a, b), edge(b, c), edge(c, a)]
}

/// The faces along every edge and around every vertex, kept while faces change.
#[derive(Default)]
struct Links {
    edges: BTreeMap<[u32; 2], Vec<usize>>,
    around: BTreeMap<u32, Vec<usize>>,
}

impl Links {
    fn insert(&mut self, face: usize, corners: [u32; 3]) {
        edges_of(corners).into_iter().for_each(|it| self.edges.entry(it).or_default().push(face));
        corners.into_iter().for_each(|it| self.around.entry(it).or_default().push(face));
    }

    fn remove(&mut self, face: usize, corners: [u32; 3]) {
        let without = |list: &mut Vec<usize>| list.retain(|&it| it != face);
        edges_of(corners).iter().filter_map(|it| self.edges.get_mut(it).map(without)).count();
        corners.iter().filter_map(|it| self.around.get_mut(it).map(without)).count();
    }

    fn along(&self, a: u32, b: u32) -> &[usize] {
        self.edges.get(&edge(a, b)).map_or(&[], Vec::as_slice)
    }

    fn around(&self, v: u32) -> &[usize] {
        self.around.get(&v).map_or(&[], Vec::as_slice)
    }
}

/// A face and what becomes of it; `None` removes it.
type Change = (usize, Option<[u32; 3]>);

/// Removes faces without area: merges corners that coincide, reconnects a face whose corner lies on its longest edge with
/// the neighbour beyond, drops it where there is none. Merging takes a vertex away and reconnecting lowers the number of
/// such faces, so this ends.
pub(super) fn mend_flat(work: &mut Work<'_>) -> Result<(), MeshRefusal> {
    let is_flat = |work: &Work<'_>, f: usize| is_degenerate(work.corners(f));
    let mut flat: BTreeSet<usize> = (0..work.faces.len()).filter(|&f| is_flat(work, f)).collect();
    if flat.is_empty() {
        return Ok(());
    }
    let mut links = Links::default();
    work.faces.iter().enumerate().for_each(|(f, &corners)| links.insert(f, corners));
    let mut keep = vec![true; work.faces.len()];
    let (mut count, mut places) = (0, Vec::new());
    while !flat.is_empty() {
        let before = count;
        for f in flat.clone() {
            if !flat.contains(&f) {
                continue;
            }
            let Some(changes) = plan(work, &links, f) else { continue };
            count += 1;
            if places.len() < NAMED {
                places.push(work.face_place(f));
            }
            for (g, corners) in changes {
                links.remove(g, work.faces[g]);
                flat.remove(&g);
                keep[g] = corners.is_some();
                if let Some(corners) = corners {
                    work.faces[g] = corners;
                    links.insert(g, corners);
                    if is_flat(work, g) {
                        flat.insert(g);
                    }
                }
            }
        }
        if count == before {
            let places = flat.iter().take(NAMED).map(|&f| work.face_place(f)).collect();
            return Err(MeshRefusal::Degenerate { count: flat.len(), places });
        }
    }
    work.drop_faces(&keep);
    work.report(Action::MendFlat, count, places);
    Ok(())
}

/// How to get rid of the flat face `f`, if there is a safe way.
fn plan(work: &Work<'_>, links: &Links, f: usize) -> Option<Vec<Change>> {
    /// Corners closer than this share of the longest side count as one.
    const COINCIDENT: f64 = 1e-12;
    let at = |v: u32| work.positions[v as usize];
    let length = |a: u32, b: u32| (at(a) - at(b)).norm();
    let [p, q, r] = work.faces[f];
    let mut sides = [(p, q, r), (q, r, p), (r, p, q)];
    sides.sort_by(|s, t| length(s.0, s.1).total_cmp(&length(t.0, t.1)));
    let (near, far, _) = sides[0];
    let (a, b, c) = sides[2];
    if length(near, far) <= COINCIDENT * length(a, b) {
        return merge(work, links, near.max(far), near.min(far));
    }
    match *links.along(a, b) {
        [_] => Some(vec![(f, None)]),
        [g, h] => {
            let other = if g == f { h } else { g };
            let d = work.faces[other].into_iter().find(|&v| v != a && v != b)?;
            // The other face is turned like this one in case they disagree; `orient` decides which is right.
            let reconnected = [[a, d, c], [d, b, c]];
            let flat = |t: [u32; 3]| usize::from(is_degenerate(t.map(at)));
            let fewer = flat(reconnected[0]) + flat(reconnected[1]) < 1 + flat(work.faces[other]);
            let free = d != c && links.along(c, d).is_empty();
            (fewer && free).then(|| vec![(f, Some(reconnected[0])), (other, Some(reconnected[1]))])
        }
        _ => None,
    }
}

/// Merges vertex `from` into `to`, neighbours at the same place, where that keeps the topology: when their only common
/// neighbours are the corners opposite their edge (link condition).
fn merge(work: &Work<'_>, links: &Links, from: u32, to: u32) -> Option<Vec<Change>> {
    let neighbours = |v: u32| links.around(v).iter().flat_map(|&g| work.faces[g]).collect::<BTreeSet<u32>>();
    let common = neighbours(from).intersection(&neighbours(to)).filter(|&&v| v != from && v != to).count();
    if common != links.along(from, to).len() {
        return None;
    }
    let moved = |g: usize| work.faces[g].map(|v| if v == from { to } else { v });
    let changes = links.around(from).iter().map(|&g| (g, Some(moved(g)).filter(|_| !work.faces[g].contains(&to))));
    Some(changes.collect())
}
