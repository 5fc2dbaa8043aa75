//! Uniform relaxation of growing rings around flipped faces.
use super::{SphereError, certify::is_positive, surface::Surface};
use crate::{geom::Vec3, numeric::Monitor};

/// Rings around the flipped faces, round after round.
const RINGS: [usize; 10] = [1, 2, 3, 4, 6, 9, 13, 19, 28, 40];
/// Most sweeps over a region, per ring.
const SWEEPS: usize = 60;
/// Sweeps between two tests.
const TEST_EVERY: usize = 6;
/// Regions with a larger share of the vertices are left to the hierarchy.
const LARGEST_SHARE: f64 = 0.4;

/// Unfolds flipped faces: vertices in rings around them move to the mean of their neighbours (Tutte's map with the rest of the
/// sphere as its border). Where that leaves a flipped face, the region stays as it was until the next round, with more rings.
/// Whether no flipped face is left.
pub(super) fn repair(surface: &Surface, y: &mut [Vec3], monitor: &Monitor) -> Result<bool, SphereError> {
    for rings in RINGS {
        let flipped: Vec<usize> = (0..surface.faces.len()).filter(|&f| !is_positive(surface.corners(f, y))).collect();
        if flipped.is_empty() {
            return Ok(true);
        }
        let near = within(surface, &flipped, rings);
        if near.len() as f64 > LARGEST_SHARE * surface.vertex_count() as f64 + 50.0 {
            break;
        }
        for region in connected(surface, &near) {
            unfold(surface, y, &region, SWEEPS * rings, monitor)?;
        }
    }
    Ok(surface.is_whole(y))
}

/// Relaxes one region; leaves it as it was unless that opens all its faces.
fn unfold(
    surface: &Surface,
    y: &mut [Vec3],
    region: &[u32],
    sweeps: usize,
    monitor: &Monitor,
) -> Result<(), SphereError> {
    let before: Vec<Vec3> = region.iter().map(|&v| y[v as usize]).collect();
    for sweep in 1..=sweeps {
        monitor.check()?;
        let order: &mut dyn Iterator<Item = &u32> =
            if sweep % 2 == 0 { &mut region.iter() } else { &mut region.iter().rev() };
        for &v in order {
            let sum: Vec3 = surface.ring(v as usize).iter().map(|it| y[it.0 as usize]).sum();
            if let Some(mean) = sum.try_normalize(1e-9) {
                y[v as usize] = mean;
            }
        }
        let open = |&f: &u32| is_positive(surface.corners(f as usize, y));
        if sweep % TEST_EVERY == 0 && region.iter().all(|&v| surface.star(v as usize).iter().all(open)) {
            return Ok(());
        }
    }
    for (&v, before) in region.iter().zip(before) {
        y[v as usize] = before;
    }
    Ok(())
}

/// The connected parts of a set of vertices; each keeps the order in which it is given.
fn connected(surface: &Surface, vertices: &[u32]) -> Vec<Vec<u32>> {
    const FREE: u32 = u32::MAX;
    const OUTSIDE: u32 = u32::MAX - 1;
    let mut part = vec![OUTSIDE; surface.vertex_count()];
    vertices.iter().for_each(|&v| part[v as usize] = FREE);
    let mut parts = 0;
    for &seed in vertices {
        if part[seed as usize] != FREE {
            continue;
        }
        part[seed as usize] = parts;
        let mut open = vec![seed];
        while let Some(v) = open.pop() {
            for &(u, _) in surface.ring(v as usize) {
                if part[u as usize] == FREE {
                    part[u as usize] = parts;
                    open.push(u);
                }
            }
        }
        parts += 1;
    }
    let mut out = vec![Vec::new(); parts as usize];
    vertices.iter().for_each(|&v| out[part[v as usize] as usize].push(v));
    out
}

/// The vertices within `count` rings of the corners of some faces, ring after ring.
fn within(surface: &Surface, faces: &[usize], count: usize) -> Vec<u32> {
    let mut seen = vec![false; surface.vertex_count()];
    let mut region: Vec<u32> = Vec::new();
    for v in faces.iter().flat_map(|&f| surface.faces[f]) {
        if !std::mem::replace(&mut seen[v as usize], true) {
            region.push(v);
        }
    }
    let mut from = 0;
    for _ in 1..count {
        let to = region.len();
        for k in from..to {
            for &(u, _) in surface.ring(region[k] as usize) {
                if !std::mem::replace(&mut seen[u as usize], true) {
                    region.push(u);
                }
            }
        }
        from = to;
    }
    region
}
