//! Keeps a surface that changes edge by edge within a distance of the one it came from, both ways.
//!
//! Sample points of the source belong to faces of the current surface near them, and move on to the new faces when an edit
//! replaces some (Klein, Liebich, Straßer: Mesh reduction with error control, Visualization 1996; for remeshing Hu et al.:
//! Error-bounded and feature preserving surface remeshing, TVCG 2016). So the distance is measured to the part of the
//! surface that came from there, never to the far side of a thin wall. The other way the new faces are held against the
//! source. Between its samples the source may still stick out, so the caller bounds the distance of the result and
//! tightens the limit if it must.
use crate::{
    geom::{Vec3, closest_on_triangle},
    mesh::{
        Bvh, FaceId, Id, TriMesh,
        distance::{is_within, sample},
    },
    surface::{collapse::FanFace, edit::EditMesh},
};

/// Share of the limit given up so that the proof for a face ends.
const RESOLUTION: f64 = 0.05;
/// Sources with fewer vertices are sampled at this many more points.
const SAMPLES: usize = 10_000;

/// How the new faces are held against the source.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Test {
    /// At their centroids and the middles of their sides.
    Sampled,
    /// Everywhere, with proof.
    Proven,
}

/// The limit, and what is needed to hold it.
pub(super) struct Tolerance<'a> {
    bvh: &'a Bvh,
    limit: f64,
    test: Test,
    samples: Vec<Vec3>,
    /// Per face of the current surface, the samples that belong to it.
    owned: Vec<Vec<u32>>,
    /// For the edit that was allowed last: the face that each sample goes to.
    moves: Vec<(u32, FaceId)>,
}

impl<'a> Tolerance<'a> {
    /// For a surface that still is the source, whose hierarchy is `bvh`.
    pub(super) fn new(source: &TriMesh, bvh: &'a Bvh, limit: f64, test: Test) -> Self {
        let mut samples = source.positions().as_slice().to_vec();
        let mut owned = vec![Vec::new(); source.face_count()];
        for v in source.vertices() {
            if let Some(h) = source.outgoing(v).next() {
                owned[source.face(h).index()].push(v.0);
            }
        }
        if samples.len() < SAMPLES {
            for point in sample(source, SAMPLES) {
                owned[point.face.index()].push(samples.len() as u32);
                samples.push(point.position(source));
            }
        }
        Self { bvh, limit, test, samples, owned, moves: Vec::new() }
    }

    /// Whether an edit that removes the faces `gone` and gives those of `fan` new corners keeps to the limit. Samples that
    /// are beyond it already may stay where they are but not get worse. The cheap tests come first.
    pub(super) fn allows(&mut self, mesh: &EditMesh, gone: &[FaceId], fan: &[FanFace]) -> bool {
        fan.iter().all(|(h, corners)| {
            let [a, b, c] = corners;
            let hints = || corners.iter().chain(self.samples_of(mesh.face(*h)));
            self.near((a + b + c) / 3.0, hints()) && self.near((a + b) / 2.0, hints())
        }) && self.assign(mesh, gone, fan)
            && (self.test == Test::Sampled
                || fan.iter().all(|(_, corners)| is_within(*corners, self.bvh, self.limit, RESOLUTION)))
    }

    fn samples_of(&self, face: FaceId) -> impl Iterator<Item = &Vec3> {
        self.owned[face.index()].iter().map(|&sample| &self.samples[sample as usize])
    }

    /// Whether the source is within the limit of `p`. Points of the source that probably are save the search; corners of
    /// faces count as such in a test by samples, where they lie on the source.
    fn near<'b>(&self, p: Vec3, mut hints: impl Iterator<Item = &'b Vec3>) -> bool {
        let limit = self.limit * self.limit;
        self.test == Test::Sampled && hints.any(|q| (p - q).norm_squared() <= limit)
            || self.bvh.is_within(p, self.limit)
    }

    /// Finds a near face of the fan for every sample of the faces that change.
    fn assign(&mut self, mesh: &EditMesh, gone: &[FaceId], fan: &[FanFace]) -> bool {
        self.moves.clear();
        let limit = self.limit * self.limit;
        let staying = fan.iter().map(|(h, corners)| (mesh.face(*h), Some(corners)));
        for (face, corners) in gone.iter().map(|&f| (f, None)).chain(staying) {
            for &sample in &self.owned[face.index()] {
                let p = self.samples[sample as usize];
                let own = corners.map_or(f64::INFINITY, |corners| closest_on_triangle(&p, corners).1);
                let mut best = (own, face);
                // Well within the limit there is no need to look for a closer face.
                if own > limit / 4.0 {
                    for (h, corners) in fan {
                        let (_, squared) = closest_on_triangle(&p, corners);
                        if squared < best.0 {
                            best = (squared, mesh.face(*h));
                        }
                    }
                }
                if best.0 > limit && best.0 > closest_on_triangle(&p, &mesh.face_positions(face)).1 {
                    return false;
                }
                self.moves.push((sample, best.1));
            }
        }
        true
    }

    /// Takes note of the edit that was just allowed, with the same arguments.
    pub(super) fn commit(&mut self, mesh: &EditMesh, gone: &[FaceId], fan: &[FanFace]) {
        for face in gone.iter().copied().chain(fan.iter().map(|it| mesh.face(it.0))) {
            self.owned[face.index()].clear();
        }
        for (sample, face) in self.moves.drain(..) {
            self.owned[face.index()].push(sample);
        }
    }

    /// One more sample of the source, which belongs to `face`.
    pub(super) fn add(&mut self, point: Vec3, face: FaceId) {
        self.owned[face.index()].push(self.samples.len() as u32);
        self.samples.push(point);
    }

    /// Shares the samples of a face with the one that a split took from it; call it after the split.
    pub(super) fn split(&mut self, mesh: &EditMesh, face: FaceId, new: FaceId) {
        if self.owned.len() <= new.index() {
            self.owned.resize(new.index() + 1, Vec::new());
        }
        let [old, taken] = [face, new].map(|f| mesh.face_positions(f));
        let (keep, give) = std::mem::take(&mut self.owned[face.index()]).into_iter().partition(|&sample| {
            let p = self.samples[sample as usize];
            closest_on_triangle(&p, &old).1 <= closest_on_triangle(&p, &taken).1
        });
        self.owned[face.index()] = keep;
        self.owned[new.index()] = give;
    }
}
