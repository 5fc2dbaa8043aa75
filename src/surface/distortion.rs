//! How a flat triangle differs from the triangle in space.
use crate::geom::{Vec2, Vec3, polygon::orientation};

/// Distortion of the linear map from a triangle in space to one in the plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Distortion {
    /// ½ ln of the ratio of the areas, plane over space; 0 where the triangle is flipped.
    pub log_scale: f64,
    /// Singular values, the larger first.
    pub stretch: [f64; 2],
    /// Whether the flat triangle is clockwise or has no area; exact.
    pub flipped: bool,
}

impl Distortion {
    /// Of one triangle with an area in space.
    pub fn new(space: [Vec3; 3], plane: [Vec2; 3]) -> Self {
        let (p, q) = (space[1] - space[0], space[2] - space[0]);
        let x = p.norm();
        let (qx, qy) = (q.dot(&p) / x, p.cross(&q).norm() / x);
        // Columns of the Jacobian in the frame of the first edge.
        let a = (plane[1] - plane[0]) / x;
        let b = ((plane[2] - plane[0]) - a * qx) / qy;
        // Half sum and half difference of the singular values: lengths of the conformal and anticonformal parts.
        let conformal = 0.5 * f64::hypot(a.x + b.y, a.y - b.x);
        let anticonformal = 0.5 * f64::hypot(a.x - b.y, a.y + b.x);
        let flipped = orientation(plane[0], plane[1], plane[2]) <= 0.0;
        let determinant = (conformal - anticonformal) * (conformal + anticonformal);
        Self {
            log_scale: if flipped || determinant <= 0.0 { 0.0 } else { 0.5 * determinant.ln() },
            stretch: [conformal + anticonformal, (conformal - anticonformal).abs()],
            flipped,
        }
    }

    /// max |ln σ| of the two singular values.
    pub fn principal_stretch(&self) -> f64 {
        self.stretch.iter().fold(0.0, |max, it| it.ln().abs().max(max))
    }

    /// Quasi-conformal error σ1 / σ2.
    pub fn quasi_conformal(&self) -> f64 {
        self.stretch[0] / self.stretch[1]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_maps() {
        let space = [Vec3::new(1.0, 2.0, 3.0), Vec3::new(4.0, 2.0, 3.0), Vec3::new(2.0, 2.0, 8.0)];
        let flat = [[0.0, 0.0], [3.0, 0.0], [1.0, 5.0]].map(|[x, y]| Vec2::new(x, y));
        type Map = fn(Vec2) -> Vec2;
        let cases: [(Map, [f64; 2], bool); 4] = [
            (|p| p, [1.0, 1.0], false),
            (|p| Vec2::new(2.0 * p.x, 0.5 * p.y), [2.0, 0.5], false),
            (|p| Vec2::new(-3.0 * p.y, 3.0 * p.x), [3.0, 3.0], false),
            (|p| Vec2::new(-p.x, 2.0 * p.y), [2.0, 1.0], true),
        ];
        for (map, stretch, flipped) in cases {
            let it = Distortion::new(space, flat.map(map));
            assert!((it.stretch[0] - stretch[0]).abs() + (it.stretch[1] - stretch[1]).abs() < 1e-14, "{it:?}");
            assert_eq!(it.flipped, flipped);
            if !flipped {
                assert!((it.log_scale - 0.5 * (stretch[0] * stretch[1]).ln()).abs() < 1e-14);
                assert!(
                    (it.principal_stretch() - stretch.map(|s: f64| s.ln().abs()).into_iter().fold(0.0, f64::max)).abs()
                        < 1e-14
                );
                assert!((it.quasi_conformal() - stretch[0] / stretch[1]).abs() < 1e-13);
            }
        }
        assert!(Distortion::new(space, [flat[0], flat[1], flat[1]]).flipped);
    }
}
