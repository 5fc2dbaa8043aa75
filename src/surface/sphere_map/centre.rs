//! Möbius centring: the conformal map of the sphere to itself that brings the source's centre of area to the origin.
//!
//! Baden, Crane, Kazhdan 2018, "Möbius registration", algorithm 1, with a damped step.
use nalgebra::Matrix3;

use crate::geom::Vec3;

/// Steps; Gauss–Newton converges in five to ten.
const STEPS: usize = 60;
/// |Σ m y| that is as good as 0.
const CENTRED: f64 = 1e-12;
/// Longest step, in the unit ball of motions, and the shortest one tried, as a share of |Σ m y|.
const LONGEST: f64 = 0.9;
const SHORTEST: f64 = 1e-3;

/// φ_c(y) = (1 − |c|²) (y + c) / |y + c|² + c: the inversion that moves towards c, for |c| < 1.
fn inverted(y: &Vec3, c: &Vec3) -> Vec3 {
    let moved = y + c;
    ((1.0 - c.norm_squared()) / moved.norm_squared() * moved + c).normalize()
}

/// Σ m y.
pub(super) fn centroid(mass: &[f64], y: &[Vec3]) -> Vec3 {
    mass.iter().zip(y).map(|(&m, p)| m * p).sum()
}

/// The step of Gauss–Newton towards Σ m φ_c(y) = 0, shorter than 1.
fn step(mass: &[f64], y: &[Vec3], mean: Vec3) -> Option<Vec3> {
    let spread: Matrix3<f64> = mass.iter().zip(y).map(|(&m, p)| m * (Matrix3::identity() - p * p.transpose())).sum();
    // A gathered image has a singular spread; the shift keeps the step finite.
    let slope: Matrix3<f64> = 2.0 * spread + 1e-9 * Matrix3::identity();
    let c = -slope.lu().solve(&mean)?;
    let length = c.norm();
    Some(if length > LONGEST { c * (LONGEST / length) } else { c })
}

/// Brings Σ m y to 0 as far as the moved points are `valid`; Σ m is 1. A motion of the sphere may flip faces, because their
/// sides are no longer great circles after it.
pub(super) fn centre(mass: &[f64], y: &mut Vec<Vec3>, valid: &dyn Fn(&[Vec3]) -> bool) {
    for _ in 0..STEPS {
        let mean = centroid(mass, y);
        if mean.norm() < CENTRED {
            return;
        }
        let Some(mut c) = step(mass, y, mean) else { return };
        loop {
            let moved: Vec<Vec3> = y.iter().map(|p| inverted(p, &c)).collect();
            if centroid(mass, &moved).norm() < mean.norm() && valid(&moved) {
                *y = moved;
                break;
            }
            c *= 0.5;
            if c.norm() < SHORTEST * mean.norm() {
                return;
            }
        }
    }
}
