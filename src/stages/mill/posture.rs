//! Postures: how a cutter stands at a ruling, and how far apart postures may be.
//!
//! | symbol | meaning |
//! | --- | --- |
//! | P, Q | ends of the ruling, P at the tip of the cutter |
//! | a | unit vector along the ruling, (Q − P) / |Q − P| |
//! | m | mean unit normal of the finished surface, on the side of the cutter, orthogonal to a |
//! | r, γ | radius at the tip and half angle of the cutter |
//! | o | how far the cutter reaches beyond P |
//! | φ | twist: angle of the normals at P and Q about a |
//!
//! The contact line of a cone lies along a, so its axis is a' = a cos γ + m sin γ, and its tip P + m r cos γ − a (o + r sin
//! γ): the circle at the tip then touches at P − o a. For a cylinder that is **tip = P + r m − o a**.
//!
//! Twist. Over a surface z = k x y, whose normals turn by φ = k L along a ruling of length L, an axis along the ruling
//! leaves −½ r k² x² at the distance x from the middle: it cuts r (1 − cos(φ/2)) ≈ r φ²/8 too deep at the ends. Turned about
//! m by β the axis leaves −(k tan β + ½ r k² / cos² β) x², which is nothing for β = −½ r k to second order: half of what
//! touching at both ends along their own normals would turn it. So the axis goes through P + r n_P and Q + r n_Q moved half
//! way back to the plane of a and m.
use crate::{
    geom::Vec3,
    mesh::sweep::{Pose, Tool},
};

/// A ruling of the finished surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Line {
    /// The end at the tip of the cutter, mm.
    pub p: Vec3,
    /// The other end.
    pub q: Vec3,
    /// Unit normals there, on the side of the cutter.
    pub normals: [Vec3; 2],
}

/// A cutter at a ruling, and the frame that it stands in.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Posture {
    /// Where it is.
    pub pose: Pose,
    /// Away from the surface, orthogonal to the axis.
    pub out: Vec3,
    /// Over the surface, orthogonal to both: out, axis and this are right-handed as axis × out.
    pub across: Vec3,
    /// Heights over the tip where the contact begins and ends.
    pub contact: [f64; 2],
}

impl Line {
    /// Unit vector from P to Q.
    pub fn direction(&self) -> Vec3 {
        (self.q - self.p).normalize()
    }

    /// The same ruling with the cutter the other way round.
    pub fn flipped(&self) -> Self {
        Self { p: self.q, q: self.p, normals: [self.normals[1], self.normals[0]] }
    }

    /// The stretch of it between two shares of its length.
    pub fn part(&self, from: f64, to: f64) -> Self {
        let at = |s: f64| self.p + (self.q - self.p) * s;
        let normal = |s: f64| (self.normals[0] * (1.0 - s) + self.normals[1] * s).normalize();
        Self { p: at(from), q: at(to), normals: [normal(from), normal(to)] }
    }

    /// Mean normal, orthogonal to the ruling.
    pub fn normal(&self) -> Vec3 {
        let a = self.direction();
        let sum = self.normals[0] + self.normals[1];
        (sum - a * a.dot(&sum)).normalize()
    }

    /// Angle of the normals at the ends about the ruling, radians.
    pub fn twist(&self) -> f64 {
        let a = self.direction();
        let [n, k] = self.normals.map(|it| it - a * a.dot(&it));
        n.cross(&k).dot(&a).atan2(n.dot(&k))
    }
}

/// The posture at a ruling for a finished surface with `stock` left on it, with the axis turned by `share` of the angle
/// that touching at both ends along their own normals would turn it: 0 for an axis along the ruling, ½ for the least error.
pub fn posture(line: &Line, tool: &Tool, overhang: f64, stock: f64, share: f64) -> Posture {
    let (a, m) = (line.direction(), line.normal());
    let t = a.cross(&m);
    let length = (line.q - line.p).norm();
    // Sideways way of the axis from P to Q; the normals at the ends lie at −φ/2 and φ/2 from m, towards t.
    let radius = tool.radius_at(overhang + length / 2.0);
    let turn = (share * 2.0 * radius * (line.twist() / 2.0).sin() / length).atan();
    let (a, t) = (turned(a, t, turn), turned(t, -a, turn));
    let (sin, cos) = tool.taper.sin_cos();
    let (axis, out) = (a * cos + m * sin, m * cos - a * sin);
    let middle = (line.p + line.q) / 2.0;
    let tip = middle - a * (length / 2.0 + overhang + tool.radius * sin) + m * (tool.radius * cos + stock);
    let contact = [overhang / cos, (overhang + length) / cos];
    Posture { pose: Pose { tip, axis }, out, across: t, contact }
}

/// a turned towards b by an angle.
fn turned(a: Vec3, b: Vec3, angle: f64) -> Vec3 {
    a * angle.cos() + b * angle.sin()
}

/// Error of an axis along a ruling whose normals turn by `twist`: r (1 − cos(φ/2)), mm.
pub fn twist_error(radius: f64, twist: f64) -> f64 {
    radius * (1.0 - (twist / 2.0).cos())
}

/// Error between two postures at an angle of `step` on a surface of radius R (negative where it is concave), when the tip
/// goes straight: (R + r)(1 − cos(dt/2)) cut too deep on a convex surface, (R − r)(1 − cos(dt/2)) left on a concave one.
pub fn chord_error(surface: f64, radius: f64, step: f64) -> f64 {
    (surface + radius).abs() * (1.0 - (step / 2.0).cos())
}

/// The largest step for an error: dt = 2 acos(1 − tol / |R + r|).
pub fn largest_step(surface: f64, radius: f64, tolerance: f64) -> f64 {
    2.0 * (1.0 - tolerance / (surface + radius).abs().max(tolerance)).acos()
}
