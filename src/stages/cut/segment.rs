//! Patches between creases: the first cut of one attempt parts the surface into them before anything is laid flat.
use std::{cmp::Reverse, collections::BinaryHeap};

use crate::{
    geom::Vec3,
    mesh::{EdgeId, FaceId, Field, HalfedgeId, TriMesh},
    numeric::{Cancelled, Monitor},
};

/// What a way as long as the diagonal costs, as an angle, radians: few, so that creases part patches, but enough for round ones.
const DIAGONAL: f64 = 1.0;
/// How often the seeds move to the middle of their patches.
const ROUNDS: usize = 2;

/// Distance and nearest seed of every face; a step to the next face costs the angle that it turns by, and a little for its length.
struct Spread<'a> {
    mesh: &'a TriMesh,
    step: Field<HalfedgeId, f64>,
    distance: Field<FaceId, f64>,
    seed: Field<FaceId, u32>,
}

impl Spread<'_> {
    fn clear(&mut self) {
        self.distance.as_mut_slice().fill(f64::INFINITY);
    }

    /// Lets seeds take the faces that are nearer to them than to any before.
    fn add(&mut self, seeds: impl Iterator<Item = (FaceId, u32)>) {
        // Bits of numbers that are not negative are in the order of the numbers.
        let mut heap: BinaryHeap<Reverse<(u64, FaceId, u32)>> = seeds.map(|(f, k)| Reverse((0, f, k))).collect();
        while let Some(Reverse((bits, f, k))) = heap.pop() {
            let distance = f64::from_bits(bits);
            if distance >= self.distance[f] {
                continue;
            }
            (self.distance[f], self.seed[f]) = (distance, k);
            for h in self.mesh.face_halfedges(f) {
                let Some(twin) = self.mesh.twin(h) else { continue };
                let (next, far) = (self.mesh.face(twin), distance + self.step[h]);
                if far < self.distance[next] {
                    heap.push(Reverse((far.to_bits(), next, k)));
                }
            }
        }
    }

    /// The farthest face of each patch, or of all as the only one.
    fn farthest(&self, patches: usize) -> Vec<FaceId> {
        let mut out: Vec<Option<FaceId>> = vec![None; patches];
        for f in self.mesh.faces() {
            let best = &mut out[self.seed[f] as usize % patches];
            if best.is_none_or(|it| self.distance[f] > self.distance[it]) {
                *best = Some(f);
            }
        }
        out.into_iter().flatten().collect()
    }
}

/// The edges between `count` patches, none of which crosses an edge that is `kept` cut. O(count F log F) at worst.
pub(super) fn patches(
    mesh: &TriMesh,
    count: usize,
    kept: &Field<EdgeId, bool>,
    monitor: &Monitor,
) -> Result<Field<EdgeId, bool>, Cancelled> {
    let centre = |f: FaceId| mesh.face_positions(f).iter().sum::<Vec3>() / 3.0;
    let scale = DIAGONAL / mesh.bounds().diagonal();
    let step = |h: HalfedgeId| match mesh.twin(h) {
        Some(twin) if !kept[mesh.edge(h)] => {
            let bend = mesh.dihedral_cosine(mesh.edge(h)).map_or(0.0, |it| it.clamp(-1.0, 1.0).acos());
            bend + scale * (centre(mesh.face(h)) - centre(mesh.face(twin))).norm()
        }
        _ => f64::INFINITY,
    };
    let mut spread = Spread {
        mesh,
        step: Field::from_fn(3 * mesh.face_count(), step),
        distance: Field::filled(mesh.face_count(), f64::INFINITY),
        seed: Field::filled(mesh.face_count(), 0),
    };
    let count = count.min(mesh.face_count());
    for k in 0..count {
        monitor.check()?;
        let farthest = spread.farthest(1)[0];
        spread.add(std::iter::once((farthest, k as u32)));
    }
    for _ in 0..ROUNDS {
        monitor.check()?;
        let between = |f: FaceId| {
            let other = |h: HalfedgeId| mesh.twin(h).is_none_or(|it| spread.seed[mesh.face(it)] != spread.seed[f]);
            mesh.face_halfedges(f).into_iter().any(other)
        };
        let rim: Vec<(FaceId, u32)> = mesh.faces().filter(|&f| between(f)).map(|f| (f, spread.seed[f])).collect();
        let patch = spread.seed.clone();
        spread.clear();
        spread.add(rim.into_iter());
        spread.seed = patch;
        let middles = spread.farthest(count);
        spread.clear();
        spread.add(middles.into_iter().zip(0..));
    }
    Ok(Field::from_fn(mesh.edge_count(), |e: EdgeId| {
        let h = mesh.halfedge(e);
        kept[e] || mesh.twin(h).is_some_and(|it| spread.seed[mesh.face(it)] != spread.seed[mesh.face(h)])
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;

    #[test]
    fn patches_are_connected_and_end_at_creases() {
        let cube = shapes::cuboid(Vec3::new(30.0, 30.0, 30.0), 6);
        let kept = Field::filled(cube.edge_count(), false);
        let cut = patches(&cube, 6, &kept, &Monitor::silent()).unwrap();
        for e in cube.edges() {
            let crease = cube.dihedral_cosine(e).unwrap() < 0.5;
            assert_eq!(cut[e], crease, "{e:?}");
        }
    }
}
