//! The intrinsic energy: the smaller eigenvalue of Σ θ N̂ N̂ᵀ, N̂ the normals in the log map at the vertex normal (SGC
//! appendix B.5).
use super::{
    Corner, Pull, Work,
    log_map::{Image, LogMap},
};
use crate::numeric::lanes::Lanes;

/// Energy of several stars of one valence; `pulls` gets its derivatives.
#[inline(always)]
pub(super) fn star(corners: &[Corner], pulls: &mut [Pull], work: &mut Work) -> Lanes {
    let images = &mut work.images[..corners.len()];
    let map = LogMap::new(corners, images);
    let [mut xx, mut xy, mut yy] = [Lanes::default(); 3];
    for (corner, Image { point: [x, y], .. }) in corners.iter().zip(&*images) {
        let ax = corner.angle * *x;
        xx += ax * *x;
        xy += ax * *y;
        yy += corner.angle * *y * *y;
    }
    let [u, v] = smaller_eigenvector(xx, xy, yy);
    let mut energy = Lanes::default();
    for ((corner, image), pull) in corners.iter().zip(&mut *images).zip(&mut *pulls) {
        let [x, y] = image.point;
        let height = u * x + v * y;
        energy += corner.angle * height * height;
        let factor = corner.angle * height;
        let factor = factor + factor;
        image.pull = [factor * u, factor * v];
        pull.angle = height * height;
    }
    map.pull_back(corners, images, pulls);
    energy
}

/// Unit eigenvector of the smaller eigenvalue of [[xx, xy], [xy, yy]]; any direction where both are equal.
#[inline(always)]
fn smaller_eigenvector(xx: Lanes, xy: Lanes, yy: Lanes) -> [Lanes; 2] {
    let (zero, one) = (Lanes::default(), Lanes::splat(1.0));
    let half = Lanes::splat(0.5) * (xx - yy);
    let radius = (half * half + xy * xy).sqrt();
    // The row of A − λ2 without cancellation is the eigenvector.
    let sum = half.abs() + radius;
    let (u, v) = (half.lt_select(zero, sum, -xy), half.lt_select(zero, -xy, sum));
    let square = u * u + v * v;
    let inverse = one / square.sqrt();
    [zero.lt_select(square, u * inverse, one), zero.lt_select(square, v * inverse, zero)]
}
