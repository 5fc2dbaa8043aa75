//! Movements of the head: straight lines and arcs in machine coordinates.
use std::f64::consts::TAU;

/// A point or offset, mm.
pub type Point = [f64; 3];

/// An arc about a centre in a coordinate plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Arc {
    /// The two axes of the plane, in the order that makes counter-clockwise positive.
    pub axes: [usize; 2],
    /// Centre in those axes.
    pub center: [f64; 2],
    /// Angle at the start, radians.
    pub start: f64,
    /// Signed angle turned through, counter-clockwise positive, radians.
    pub sweep: f64,
    /// Radius, mm.
    pub radius: f64,
}

/// One movement, in machine coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Move {
    /// Where it begins.
    pub from: Point,
    /// Where it ends.
    pub to: Point,
    /// The arc, where it is not straight.
    pub arc: Option<Arc>,
    /// Whether it is a rapid traverse.
    pub rapid: bool,
    /// Feed rate, mm/min (for inverse time, converted).
    pub feed: f64,
    /// Whether the tool is at work.
    pub working: bool,
}

impl Move {
    /// Length, mm.
    pub fn length(&self) -> f64 {
        match self.arc {
            None => distance(self.from, self.to),
            Some(arc) => {
                let along = 3 - arc.axes[0] - arc.axes[1];
                (arc.radius * arc.sweep).hypot(self.to[along] - self.from[along])
            }
        }
    }

    /// The point at a share of the way in [0, 1].
    pub fn point(&self, share: f64) -> Point {
        let mut point: Point = std::array::from_fn(|i| self.from[i] + share * (self.to[i] - self.from[i]));
        if let Some(arc) = self.arc {
            let (sin, cos) = (arc.start + share * arc.sweep).sin_cos();
            point[arc.axes[0]] = arc.center[0] + arc.radius * cos;
            point[arc.axes[1]] = arc.center[1] + arc.radius * sin;
        }
        point
    }

    /// Unit direction at the start (`share = 0`) or the end (`share = 1`); zero for a move of no length.
    pub fn direction(&self, share: f64) -> Point {
        let mut d: Point = std::array::from_fn(|i| self.to[i] - self.from[i]);
        if let Some(arc) = self.arc {
            let (sin, cos) = (arc.start + share * arc.sweep).sin_cos();
            d[arc.axes[0]] = -sin * arc.radius * arc.sweep;
            d[arc.axes[1]] = cos * arc.radius * arc.sweep;
        }
        let norm = distance(d, [0.0; 3]);
        if norm < 1e-9 { [0.0; 3] } else { d.map(|it| it / norm) }
    }

    /// Distance of a point from the path, and the share of the way where it is nearest.
    pub fn nearest(&self, p: Point) -> (f64, f64) {
        let share = match self.arc {
            None => {
                let d: Point = std::array::from_fn(|i| self.to[i] - self.from[i]);
                let square: f64 = d.iter().map(|it| it * it).sum();
                let dot: f64 = (0..3).map(|i| (p[i] - self.from[i]) * d[i]).sum();
                if square < 1e-18 { 1.0 } else { (dot / square).clamp(0.0, 1.0) }
            }
            Some(arc) => {
                let angle = (p[arc.axes[1]] - arc.center[1]).atan2(p[arc.axes[0]] - arc.center[0]);
                let turned = (angle - arc.start) * arc.sweep.signum();
                let turned = turned.rem_euclid(TAU);
                let sweep = arc.sweep.abs();
                // Past the end, the nearer of the two ends.
                if turned <= sweep {
                    turned / sweep
                } else if turned - sweep < TAU - turned {
                    1.0
                } else {
                    0.0
                }
            }
        };
        (distance(self.point(share), p), share)
    }

    /// Calls `visit` with points that hold the path in their bounding box, together with its start.
    pub fn extremes(&self, mut visit: impl FnMut(Point)) {
        visit(self.to);
        if let Some(arc) = self.arc {
            let quarter = TAU / 4.0;
            let (low, high) =
                (arc.start.min(arc.start + arc.sweep) / quarter, arc.start.max(arc.start + arc.sweep) / quarter);
            let mut k = low.ceil();
            while k <= high {
                visit(self.point(((k * quarter - arc.start) / arc.sweep).clamp(0.0, 1.0)));
                k += 1.0;
            }
        }
    }
}

/// Distance of two points, mm.
pub fn distance(a: Point, b: Point) -> f64 {
    (0..3).map(|i| (a[i] - b[i]) * (a[i] - b[i])).sum::<f64>().sqrt()
}
