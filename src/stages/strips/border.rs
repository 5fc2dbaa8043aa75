//! The boundary of a region as a ring of samples, and what a panel between chords costs.
use super::{
    chord::{Chord, Flux, Form},
    patch::Patch,
};
use crate::geom::{Vec2, Vec3, cross2};

/// What can be summed along the border of a panel: ω, and the area vector ½ Σ p × q of the outline in space (Newell).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Sum {
    pub(super) flux: Flux,
    pub(super) newell: Vec3,
}

impl std::ops::Add for Sum {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self { flux: self.flux + other.flux, newell: self.newell + other.newell }
    }
}

impl std::ops::Sub for Sum {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self { flux: self.flux - other.flux, newell: self.newell - other.newell }
    }
}

impl Sum {
    /// ∫ |N − M|² dA over the region with M its mean normal (the L²,¹ error of Cohen-Steiner, Alliez, Desbrun 2004), mm²:
    /// 2 (A − |∫ N dA|). Not the normal of the outline: where vertices are noisy, a few corners say less about the
    /// direction of a panel than all of its normals.
    pub(super) fn cost(&self) -> f64 {
        2.0 * (self.flux.area - self.flux.normal.norm()).max(0.0)
    }
}

/// The samples of a disk, counter-clockwise, with sums along the boundary from the first one.
#[derive(Debug, Clone)]
pub(super) struct Border {
    /// Vertices of the patch.
    pub(super) vertices: Vec<u32>,
    pub(super) uv: Vec<Vec2>,
    pub(super) xyz: Vec<Vec3>,
    /// Sums from sample 0 to sample k along the boundary; one more than there are samples.
    along: Vec<Sum>,
    middle: Vec3,
}

impl Border {
    pub(super) fn new(patch: &Patch, form: &Form) -> Self {
        let path = patch.loops().into_iter().next().unwrap_or_default();
        let vertices: Vec<u32> = path.iter().map(|&h| patch.tail[h as usize]).collect();
        let uv = vertices.iter().map(|&v| patch.uv[v as usize]).collect();
        let xyz: Vec<Vec3> = vertices.iter().map(|&v| patch.xyz[v as usize]).collect();
        // Area vectors about a point nearby lose fewer digits.
        let middle = xyz.iter().sum::<Vec3>() / xyz.len() as f64;
        let mut along = vec![Sum::default()];
        for (i, &h) in path.iter().enumerate() {
            let newell = (xyz[i] - middle).cross(&(xyz[(i + 1) % xyz.len()] - middle)) * 0.5;
            along.push(along[i] + Sum { flux: form.along(h), newell });
        }
        Self { vertices, uv, xyz, along, middle }
    }

    pub(super) fn len(&self) -> usize {
        self.vertices.len()
    }

    /// Along the boundary from sample `i` to sample `k ≥ i`.
    pub(super) fn arc(&self, i: usize, k: usize) -> Sum {
        self.along[k] - self.along[i]
    }

    /// Straight from sample `i` to sample `k`.
    pub(super) fn straight(&self, chord: &Chord, i: usize, k: usize) -> Sum {
        let newell = (self.xyz[i] - self.middle).cross(&(self.xyz[k] - self.middle)) * 0.5;
        Sum { flux: chord.flux, newell }
    }

    /// From the first sample against the boundary to sample `k`.
    pub(super) fn back(&self, k: usize) -> Sum {
        Sum::default() - self.arc(k, self.len())
    }

    /// Around the whole disk.
    pub(super) fn whole(&self) -> Sum {
        self.along[self.len()]
    }

    /// Half the thickness of the samples across the plane with normal `normal`, mm.
    pub(super) fn thickness(&self, normal: Vec3, samples: impl Iterator<Item = usize>) -> f64 {
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for i in samples {
            let height = normal.dot(&(self.xyz[i] - self.middle));
            low = low.min(height);
            high = high.max(height);
        }
        0.5 * (high - low).max(0.0)
    }
}

/// Largest distance of a corner of a quadrilateral from the plane of the other three, mm, and the mean diagonal.
pub(super) fn warp(p: [Vec3; 4]) -> [f64; 2] {
    let sides = [p[1] - p[0], p[2] - p[0], p[3] - p[0]];
    let other = p[2] - p[1];
    let volume = sides[0].cross(&sides[1]).dot(&sides[2]).abs();
    let bases =
        [sides[0].cross(&sides[1]), sides[1].cross(&sides[2]), sides[0].cross(&sides[2]), other.cross(&(p[3] - p[1]))];
    let diagonal = 0.5 * (sides[1].norm() + (p[3] - p[1]).norm());
    // Three points on a line span no plane to be away from.
    let spans = |it: &f64| *it > 1e-9 * diagonal * diagonal;
    let least = bases.iter().map(Vec3::norm).filter(spans).fold(f64::INFINITY, f64::min);
    [volume / least, diagonal]
}

/// Planarity of a quadrilateral: largest distance of a corner from the plane of the other three, over the mean diagonal.
pub(super) fn planarity(p: [Vec3; 4]) -> f64 {
    let [height, diagonal] = warp(p);
    height / diagonal.max(f64::MIN_POSITIVE)
}

/// Whether four points in the plane are a convex quadrilateral, counter-clockwise.
pub(super) fn is_convex(p: [Vec2; 4]) -> bool {
    (0..4).all(|k| cross2(p[(k + 1) % 4] - p[k], p[(k + 2) % 4] - p[(k + 1) % 4]) > 0.0)
}
