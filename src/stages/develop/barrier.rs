//! Barriers that keep triangles buildable: zero where the shape is good, steep before it is not.
use crate::numeric::lanes::Lanes;

/// The squared shouldered barrier b(z)² with b = (start − z)₊ / (z − hard) down to `knee`, continued linearly below it, so
/// that a start beyond the hard value is repaired instead of refused.
#[derive(Debug, Clone, Copy)]
pub(super) struct Barrier {
    start: f64,
    hard: f64,
    knee: f64,
    value: f64,
    slope: f64,
}

impl Barrier {
    /// Zero above `start`, growing towards `hard` < `start`, linear from `hard + shoulder` down.
    pub(super) const fn new(start: f64, hard: f64, shoulder: f64) -> Self {
        let knee = hard + shoulder;
        Self { start, hard, knee, value: (start - knee) / shoulder, slope: -(start - hard) / (shoulder * shoulder) }
    }

    /// Where it begins to act.
    pub(super) fn start(&self) -> f64 {
        self.start
    }

    /// b and its derivative.
    pub(super) fn root(&self, z: f64) -> (f64, f64) {
        if z >= self.start {
            (0.0, 0.0)
        } else if z < self.knee {
            (self.value + self.slope * (z - self.knee), self.slope)
        } else {
            let over = 1.0 / (z - self.hard);
            ((self.start - z) * over, (self.hard - self.start) * over * over)
        }
    }

    /// b² and its derivative.
    #[inline(always)]
    pub(super) fn at_lanes(&self, z: Lanes) -> (Lanes, Lanes) {
        let splat = Lanes::splat;
        let knee = splat(self.knee);
        // Clamped so that lanes on the linear part divide by the shoulder, not by zero.
        let over = splat(1.0) / (z.lt_select(knee, knee, z) - splat(self.hard));
        let b = z.lt_select(knee, splat(self.value) + splat(self.slope) * (z - knee), (splat(self.start) - z) * over);
        let slope = splat(self.hard - self.start) * over * over;
        let b = z.lt_select(splat(self.start), b, Lanes::default());
        (b * b, (b + b) * slope)
    }
}

/// Corner angles, radians: from 25° down to 8°.
pub(super) const ANGLE: Barrier = Barrier::new(25.0_f64.to_radians(), 8.0_f64.to_radians(), 0.015);
/// Cosine between neighbouring normals: from −0.1 (96°) down to −0.5 (120°), beyond which an edge counts as folded.
pub(super) const FOLD: Barrier = Barrier::new(-0.1, -0.5, 0.08);
/// |Angle defect| up to which a vertex is left alone, radians: needles with flat stars have up to 2π.
pub(super) const DEFECT: f64 = 1.2;

/// How strongly each barrier acts; 0 switches it off.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Weights {
    /// Σ over corners of b(θ)².
    pub angle: f64,
    /// Σ over edges of b(N1·N2)².
    pub fold: f64,
    /// Σ over interior vertices of (|K| − 1.2)₊².
    pub defect: f64,
    /// Σ over faces of r + 1/r − 2 with r = A/A0, which is ln² r to second order.
    pub area: f64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_derivative_is_that_of_the_value() {
        for barrier in [ANGLE, FOLD] {
            let at = |z: f64| {
                let (value, slope) = barrier.at_lanes(Lanes::splat(z));
                (value.0[0], slope.0[0])
            };
            for step in 0..2000 {
                let z = -1.2 + 2.0 * f64::from(step) / 1999.0;
                let (h, slope) = (1e-7, at(z).1);
                let difference = (at(z + h).0 - at(z - h).0) / (2.0 * h);
                assert!((difference - slope).abs() <= 1e-4 * (1.0 + slope.abs()), "{z}: {slope} {difference}");
            }
            for z in [-0.6, barrier.hard, barrier.knee, 0.5 * (barrier.start + barrier.knee), 1.0] {
                let (root, slope) = barrier.root(z);
                let (value, twice) = at(z);
                assert!(
                    (root * root - value).abs() <= 1e-13 * value
                        && (2.0 * root * slope - twice).abs() <= 1e-12 * twice.abs()
                );
            }
            assert_eq!(at(barrier.start).0, 0.0);
            assert!(at(barrier.hard).0 > 50.0 && at(barrier.hard).1 < 0.0);
        }
    }
}
