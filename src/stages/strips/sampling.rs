//! Regions and their samples: piece → chart → patch, oversampled along its boundary, opened to a disk.
use super::{
    chord::{Chord, Form},
    patch::{Name, Patch, previous},
};
use crate::{
    mesh::{EdgeId, Field},
    model::{CutMesh, Flattening},
    surface::chart::Chart,
};

/// Samples on the boundary of a piece are at most this share of the root of its area apart …
const STEP: f64 = 0.015;
/// … and at least this many go round a piece of any shape.
const LEAST: f64 = 240.0;
/// Points of an edge at most; a seam beside a tiny piece stays affordable.
const MOST_PER_EDGE: f64 = 24.0;
/// Bridges to a hole start at no more than about this many points of each loop.
const BRIDGE_STARTS: usize = 60;

/// Largest distance of samples on the boundary of a piece, mm.
fn spacing(area: f64, border: f64) -> f64 {
    (STEP * area.sqrt()).min(border / LEAST)
}

/// The same for a patch.
pub(super) fn step(patch: &Patch) -> f64 {
    let area: f64 = (0..patch.face_count() as u32).map(|f| patch.area(f)).sum();
    let border: f64 = patch.loops().iter().flatten().map(|&h| patch.length(h)).sum();
    spacing(area.max(0.0), border)
}

/// How many parts every boundary edge of the cut mesh is divided into: the finer of what the pieces on its two sides want.
pub(super) fn divisions(cut: &CutMesh, charts: &[Chart]) -> Field<EdgeId, u32> {
    let mesh = &cut.mesh;
    let mut count = Field::filled(mesh.edge_count(), 1);
    for chart in charts {
        let area: f64 = chart.faces.iter().map(|&f| mesh.area(f)).sum();
        let border: f64 = chart.loops.iter().flatten().map(|it| mesh.vector(it.0).norm()).sum();
        let step = spacing(area, border);
        for &(h, _) in chart.loops.iter().flatten() {
            count[mesh.edge(h)] = (mesh.vector(h).norm() / step).ceil().clamp(1.0, MOST_PER_EDGE) as u32;
        }
    }
    for seam in &cut.seams {
        for (&a, &b) in seam.sides[0].iter().zip(&seam.sides[1]) {
            let finer = count[mesh.edge(a)].max(count[mesh.edge(b)]);
            count[mesh.edge(a)] = finer;
            count[mesh.edge(b)] = finer;
        }
    }
    count
}

/// The patch of a piece with its boundary edges divided.
pub(super) fn sampled(cut: &CutMesh, flat: &Flattening, chart: &Chart, divisions: &Field<EdgeId, u32>) -> Patch {
    let uv = chart.origin.iter().map(|&v| flat.uv[v]).collect();
    let xyz = chart.origin.iter().map(|&v| cut.mesh.position(v)).collect();
    let names = chart.origin.iter().map(|&v| Name::Vertex(cut.origin[v])).collect();
    let mut patch = Patch::new(chart, uv, xyz, names);
    let border: Vec<(u32, u32)> =
        chart.loops.iter().flatten().map(|&(h, v)| (v, divisions[cut.mesh.edge(h)])).collect();
    for (v, parts) in border {
        divide(&mut patch, v, parts);
    }
    patch
}

/// Divides halfedges that have become boundary into parts of `step` at most; both sides of a slit alike.
pub(super) fn divide_sides(patch: &mut Patch, sides: &[u32], step: f64) {
    let parts = |h: u32| (patch.length(h) / step).ceil().clamp(1.0, MOST_PER_EDGE) as u32;
    // Dividing renumbers halfedges, but not the vertices that they leave.
    let sides: Vec<(u32, u32)> = sides.iter().map(|&h| (patch.tail[h as usize], parts(h))).collect();
    for (v, parts) in sides {
        divide(patch, v, parts);
    }
}

/// Divides the boundary edge that begins at vertex `a` into equal parts.
fn divide(patch: &mut Patch, a: u32, parts: u32) {
    let h = patch.boundary(a);
    let b = patch.head(h);
    let (Name::Vertex(p), Name::Vertex(q)) = (patch.names[a as usize], patch.names[b as usize]) else { return };
    // Points are computed from the end with the smaller id, so that both sides of a seam have the same bits.
    let (low, high) = if p < q { (a, b) } else { (b, a) };
    let between = |at: f64, of: [nalgebra::Vector3<f64>; 2]| of[0] + (of[1] - of[0]) * at;
    let space = [low, high].map(|v| patch.xyz[v as usize]);
    let plane = [a, b].map(|v| patch.uv[v as usize]);
    let mut rest = h;
    for k in 1..parts {
        let t = f64::from(k) / f64::from(parts);
        let from_low = if p < q { k } else { parts - k };
        let xyz = between(f64::from(from_low) / f64::from(parts), space);
        let m = patch.split(rest, plane[0] + (plane[1] - plane[0]) * t, xyz, Name::Edge(p.min(q), p.max(q), from_low));
        rest = patch.boundary(m);
    }
}

/// Opens a patch with holes along straight chords between its loops until it is a disk; `false` when there is no chord.
pub(super) fn open_to_disk(patch: &mut Patch) -> bool {
    loop {
        let loops = patch.loops();
        if loops.len() <= 1 {
            return true;
        }
        let Some((from, to)) = bridge(patch, &loops) else { return false };
        let path = insert(patch, from, to);
        patch.open(&path);
    }
}

/// The straightest short line between the longest loop and another: normals change little along a ruling.
fn bridge(patch: &Patch, loops: &[Vec<u32>]) -> Option<(u32, u32)> {
    let form = Form::new(patch);
    let mut scratch = Vec::new();
    let mut best: Option<(f64, u32, u32)> = None;
    let starts = |path: &[u32]| -> Vec<u32> {
        let step = path.len().div_ceil(BRIDGE_STARTS);
        path.iter().step_by(step).map(|&h| patch.tail[h as usize]).collect()
    };
    for &to in loops[1..].iter().flat_map(|path| starts(path)).collect::<Vec<_>>().iter() {
        for &from in &starts(&loops[0]) {
            let Some(chord) = Chord::trace(patch, &form, from, to, &mut scratch) else { continue };
            let price = chord.length * (0.05 + chord.spread);
            if best.is_none_or(|it| price < it.0) {
                best = Some((price, from, to));
            }
        }
    }
    best.map(|it| (it.1, it.2))
}

/// Makes a chord a chain of edges; returns its halfedges.
fn insert(patch: &mut Patch, from: u32, to: u32) -> Vec<u32> {
    let mut chain = Vec::new();
    let mut path = Vec::new();
    let mut at = from;
    while at != to && patch.trace(at, to, &mut path) {
        let step = path[0];
        let weight = |k: usize| step.to[k] > 1.0 - 1e-6;
        let h = (0..3).map(|k| 3 * step.face + k).find(|&h| weight((h % 3) as usize));
        let v = match h {
            Some(h) => patch.tail[h as usize],
            None => {
                let exit = (3 * step.face..3 * step.face + 3)
                    .find(|&h| step.to[(previous(h) % 3) as usize] == 0.0)
                    .expect("a line leaves a face through a side or a corner");
                let (uv, xyz) = (patch.flat_place(step.face, step.to), patch.place(step.face, step.to));
                let name = Name::Inside(patch.uv.len() as u32);
                patch.split(exit, uv, xyz, name)
            }
        };
        let Some(edge) = patch.outgoing(at).find_map(|h| {
            let back = previous(h);
            if patch.head(h) == v { Some(h) } else { (patch.tail[back as usize] == v).then_some(back) }
        }) else {
            break;
        };
        chain.push(edge);
        at = v;
    }
    chain
}
