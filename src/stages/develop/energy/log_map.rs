//! The normals of a star in the log map of the unit sphere at the vertex normal (SGC appendix B.5).
//!
//! M = Σ A N / |Σ A N|, c = ⟨N, M⟩ = cos φ. The log map N̂ = φ (N − c M)/|N − c M| is g(c) (N − c M) with g = φ/sin φ, a
//! function that is smooth at c = 1; so in a basis t of the tangent plane at M, x = g ⟨t, N⟩. With q = ∂E/∂x, Q = Σ q t,
//! h = ⟨Q, N⟩ and t carried along by parallel transport (a turn of the basis has no effect on E):
//!   ∂E/∂N = g Q + g' h M (and by M, below);   ∂E/∂M = Σ g' h N − g c Q
use super::{Corner, Pull};
use crate::numeric::lanes::{Lanes, Lanes3};

/// What the log map keeps of each normal.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Image {
    /// N̂.
    pub point: [Lanes; 2],
    /// ∂E/∂N̂, to be filled in by the energy.
    pub pull: [Lanes; 2],
    cosine: Lanes,
    /// g and dg/dc.
    stretch: [Lanes; 2],
}

/// The log map of several stars.
pub(super) struct LogMap {
    /// M.
    pole: Lanes3,
    axes: [Lanes3; 2],
    /// 1/|Σ 2A N|.
    inverse_length: Lanes,
}

/// Number of terms of the series of g and g' about φ = 0.
const TERMS: usize = 9;
/// Below this sin² φ the series is exact to rounding, above it the closed form loses at most 4 bits more than g itself.
const NEAR: f64 = 0.03;
/// Keeps 1/sin φ finite at the antipode of M, where the log map has a jump.
const TINY: f64 = 1e-30;

/// (2k)! / (4^k (k!)² (2k + 1)): asin(s)/s in powers of s².
const SERIES: [f64; TERMS + 1] = {
    let mut out = [1.0; TERMS + 1];
    let (mut k, mut product) = (1, 1.0);
    while k <= TERMS {
        product *= (2 * k - 1) as f64 / (2 * k) as f64;
        out[k] = product / (2 * k + 1) as f64;
        k += 1;
    }
    out
};

/// g(c) = φ/sin φ and its derivative (g c − 1)/sin² φ, for c = cos φ.
#[inline(always)]
fn stretch(c: Lanes) -> [Lanes; 2] {
    let splat = Lanes::splat;
    let one = splat(1.0);
    let square = (one - c) * (one + c);
    let square = square.lt_select(splat(TINY), splat(TINY), square);
    let sine = square.sqrt();
    let far = Lanes::atan2_upper(sine, c) / sine;
    let far_slope = (far * c - one) / square;
    let mut near = splat(SERIES[TERMS]);
    let mut near_slope = splat(TERMS as f64 * SERIES[TERMS]);
    for k in (1..TERMS).rev() {
        near = near * square + splat(SERIES[k]);
        near_slope = near_slope * square + splat(k as f64 * SERIES[k]);
    }
    let near = near * square + one;
    let near_slope = -(c + c) * near_slope;
    // The series holds near M only, not near its antipode.
    let distance = Lanes::default().lt_select(c, square, one);
    let limit = splat(NEAR);
    [distance.lt_select(limit, near, far), distance.lt_select(limit, near_slope, far_slope)]
}

impl LogMap {
    /// The map at the area-weighted normal, and the images of the normals. They need [`Corner::area2`].
    #[inline(always)]
    pub(super) fn new(corners: &[Corner], images: &mut [Image]) -> Self {
        let one = Lanes::splat(1.0);
        let mut sum = Lanes3::default();
        for corner in corners {
            sum += corner.normal.scale(corner.area2);
        }
        let inverse_length = one / sum.dot(sum).sqrt();
        let pole = sum.scale(inverse_length);
        let axes = tangents(pole);
        for (corner, image) in corners.iter().zip(images) {
            let cosine = pole.dot(corner.normal);
            let stretch = stretch(cosine);
            let [x, y] = [axes[0].dot(corner.normal), axes[1].dot(corner.normal)];
            (image.point, image.cosine, image.stretch) = ([stretch[0] * x, stretch[0] * y], cosine, stretch);
        }
        Self { pole, axes, inverse_length }
    }

    /// Turns the pulls on the images into pulls on normals and areas; leaves those on angles alone.
    #[inline(always)]
    pub(super) fn pull_back(&self, corners: &[Corner], images: &[Image], pulls: &mut [Pull]) {
        let mut on_pole = Lanes3::default();
        for ((corner, image), pull) in corners.iter().zip(images).zip(&mut *pulls) {
            let [g, slope] = image.stretch;
            let tangent = self.axes[0].scale(image.pull[0]) + self.axes[1].scale(image.pull[1]);
            let turn = tangent.dot(corner.normal) * slope;
            on_pole += corner.normal.scale(turn) - tangent.scale(g * image.cosine);
            pull.normal = tangent.scale(g) + self.pole.scale(turn);
        }
        let across = on_pole - self.pole.scale(self.pole.dot(on_pole));
        let on_sum = across.scale(self.inverse_length);
        for (corner, pull) in corners.iter().zip(pulls) {
            pull.normal += on_sum.scale(corner.area2);
            pull.area = on_sum.dot(corner.normal) * corner.area2;
        }
    }
}

/// Two unit vectors that complete `n` to a right-handed frame (Duff et al., "Building an orthonormal basis, revisited",
/// 2017).
#[inline(always)]
fn tangents(n: Lanes3) -> [Lanes3; 2] {
    let [x, y, z] = n.0;
    let one = Lanes::splat(1.0);
    let sign = z.lt_select(Lanes::default(), -one, one);
    let a = -one / (sign + z);
    let b = x * y * a;
    [Lanes3([one + sign * x * x * a, sign * b, -sign * x]), Lanes3([b, sign + y * y * a, -y])]
}
