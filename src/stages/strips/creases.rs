//! Slits along creases that end inside a piece. No straight chord follows a crease that is curved or ends inside: chords
//! pass over it and leave the surface. Opened along it, the piece is a disk still, the crease is part of its outline, and
//! chords end there.
use super::{
    border::Border,
    decompose::{Decomposition, Link},
    patch::{NONE, Patch, Segment, previous},
    sampling,
};
use crate::geom::angle_between;

/// Creases are followed where the faces turn by this at least, radians …
const LEAST: f64 = 0.1;
/// … and by this share of where they were met.
const FADED: f64 = 0.4;
/// Cosine of how far a crease turns at a vertex at most.
const STRAIGHT: f64 = 0.5;
/// Shorter creases are left alone, in steps between samples.
const SHORTEST: f64 = 3.0;

/// Opens a disk along the creases under the chords that are farther than `limit` from the surface; it stays a disk.
/// `false` when there are none.
pub(super) fn open(patch: &mut Patch, border: &Border, found: &Decomposition, limit: f64) -> bool {
    let step = sampling::step(patch);
    let mut bowed: Vec<&Link> = found.chords.iter().filter(|it| it.chord.bow > limit).collect();
    bowed.sort_by(|a, b| b.chord.bow.total_cmp(&a.chord.bow));
    let mut path = Vec::new();
    let mut opened = false;
    for link in bowed {
        let [a, b] = link.ends.map(|i| border.vertices[i]);
        // A slit opened before may have ended the chord.
        if !patch.trace(a, b, &mut path) {
            continue;
        }
        let Some(crease) = sharpest(patch, &path).and_then(|h| follow(patch, h)) else { continue };
        if crease.iter().map(|&h| patch.length(h)).sum::<f64>() >= SHORTEST * step {
            let sides: Vec<u32> = crease.iter().flat_map(|&h| [h, patch.twin[h as usize]]).collect();
            patch.open(&crease);
            sampling::divide_sides(patch, &sides, step);
            if !sampling::open_to_disk(patch) {
                return false;
            }
            opened = true;
        }
    }
    opened
}

/// Angle between the faces on the two sides of a halfedge; 0 on the boundary.
fn turn(patch: &Patch, h: u32) -> f64 {
    let g = patch.twin[h as usize];
    if g == NONE { 0.0 } else { angle_between(patch.normal(h / 3), patch.normal(g / 3)) }
}

/// The halfedge that turns most among those that a line crosses.
fn sharpest(patch: &Patch, path: &[Segment]) -> Option<u32> {
    let crossed = path.iter().filter_map(|it| {
        let sides = 3 * it.face..3 * it.face + 3;
        sides.into_iter().find(|&h| it.to[(previous(h) % 3) as usize] == 0.0 && it.to[(h % 3) as usize] > 0.0)
    });
    let all = crossed.map(|h| (turn(patch, h), h)).filter(|it| it.0 >= LEAST);
    all.max_by(|a, b| a.0.total_cmp(&b.0)).map(|it| it.1)
}

/// The crease through a halfedge as a chain of halfedges, from the boundary or where it fades to where it fades. Of one
/// that reaches the boundary at both ends the last edge stays closed, as a chord.
fn follow(patch: &Patch, seed: u32) -> Option<Vec<u32>> {
    let least = LEAST.max(FADED * turn(patch, seed));
    let mut seen = vec![patch.tail[seed as usize], patch.head(seed)];
    let ahead = extend(patch, seed, least, &mut seen);
    let mut chain = extend(patch, patch.twin[seed as usize], least, &mut seen);
    chain.reverse();
    for h in &mut chain {
        *h = patch.twin[*h as usize];
    }
    chain.pop();
    chain.extend(ahead);
    let ends = [patch.tail[*chain.first()? as usize], patch.head(*chain.last()?)];
    if ends.iter().all(|&v| patch.is_boundary(v)) {
        chain.pop();
    }
    (!chain.is_empty()).then_some(chain)
}

/// A halfedge and those after it along the crease, up to the boundary, to where it fades, or to a vertex `seen`.
fn extend(patch: &Patch, seed: u32, least: f64, seen: &mut Vec<u32>) -> Vec<u32> {
    let along = |h: u32| patch.uv[patch.head(h) as usize] - patch.uv[patch.tail[h as usize] as usize];
    let mut chain = vec![seed];
    let mut at = seed;
    while !patch.is_boundary(patch.head(at)) {
        let straight = |h: u32| along(at).normalize().dot(&along(h).normalize());
        let next = patch
            .outgoing(patch.head(at))
            .filter(|&h| patch.twin[h as usize] != NONE && !seen.contains(&patch.head(h)))
            .map(|h| (turn(patch, h), straight(h), h))
            .filter(|it| it.0 >= least && it.1 >= STRAIGHT)
            .max_by(|a, b| (a.0 * a.1).total_cmp(&(b.0 * b.1)));
        let Some((_, _, h)) = next else { break };
        seen.push(patch.head(h));
        chain.push(h);
        at = h;
    }
    chain
}
