//! Energies of SGC figures 7, 11 and 12 that show what a developability energy must not be. They are not in the list of
//! energies, so that no config can name them.
use super::{Corner, Energy, Pull, Work, energy};
use crate::numeric::lanes::Lanes;

/// What the figures compare with.
pub const COMPARISONS: &[Energy] = &[
    energy!(
        "angle-defect",
        "squared angle defect: zero for crumpled sheets as well (SGC figures 7, 12)",
        angle_defect,
        work: |_| 0,
        areas: false
    ),
    energy!(
        "l1",
        "total variation of the normals around a vertex: its minimisers are flat pieces (SGC figure 11)",
        total_variation,
        work: |_| 0,
        areas: false
    ),
];

/// (2π − Σ θ)².
#[inline(always)]
fn angle_defect(corners: &[Corner], pulls: &mut [Pull], _: &mut Work) -> Lanes {
    let mut defect = Lanes::splat(std::f64::consts::TAU);
    for corner in corners {
        defect = defect - corner.angle;
    }
    for pull in pulls {
        *pull = Pull { angle: -(defect + defect), ..Pull::default() };
    }
    defect * defect
}

/// Σ |N_k − N_{k+1}|, the length of the Gauss image.
#[inline(always)]
fn total_variation(corners: &[Corner], pulls: &mut [Pull], _: &mut Work) -> Lanes {
    let (zero, one) = (Lanes::default(), Lanes::splat(1.0));
    for pull in pulls.iter_mut() {
        *pull = Pull::default();
    }
    let mut energy = zero;
    for k in 0..corners.len() {
        let next = (k + 1) % corners.len();
        let difference = corners[k].normal - corners[next].normal;
        let length = difference.dot(difference).sqrt();
        energy += length;
        let inverse = zero.lt_select(length, one / length, zero);
        let unit = difference.scale(inverse);
        pulls[k].normal += unit;
        pulls[next].normal = pulls[next].normal - unit;
    }
    energy
}
