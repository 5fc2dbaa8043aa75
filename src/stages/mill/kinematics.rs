//! From the axis of the tool to the joints of a machine with two rotary axes.
//!
//! Every such machine asks for the same thing: R_u(α) a = R_v(β) e_z, where a is the tool axis in the part and e_z that of
//! the spindle. Two tables R_1(θ₁) R_2(θ₂) a = e_z (the second one carries the part): u = 2, α = θ₂, v = 1, β = −θ₁. A table
//! and a head R_t(θ_t) a = R_h(θ_h) e_z: u = t, v = h. R_v(β) e_z runs round a circle in the plane orthogonal to v, so
//! a · v cos α = a · (u × v) sin α, which has the solutions α = atan2(a·v, a·(u × v)) and α + π; then β = atan2(b·(v × e_z),
//! b·e_z) with b = R_u(α) a. Where a lies along u, α is free. For A/C tables that gives C = atan2(a_x, a_y), A = atan2(|a_xy|,
//! a_z) and (−A, C + π).
use std::f64::consts::{PI, TAU};

use crate::{geom::Vec3, mesh::sweep::Pose};

/// What a rotary axis carries.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Carrier {
    /// The part.
    Table,
    /// The spindle.
    Head,
}

/// A rotary axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Rotary {
    /// Its letter.
    pub letter: char,
    /// Coordinate axis that it turns about: 0 for x, 1 for y, 2 for z.
    pub about: usize,
    /// What it carries.
    pub carrier: Carrier,
    /// A point of its axis in work coordinates with all axes at 0, mm.
    pub point: Vec3,
    /// Whether positive words turn it clockwise, seen against the coordinate axis.
    pub reverse: bool,
    /// Least and largest angle, radians.
    pub range: [f64; 2],
    /// Largest speed, rad/s.
    pub speed: f64,
}

/// A linear axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Linear {
    /// Its letter.
    pub letter: char,
    /// Travel in work coordinates, mm.
    pub range: [f64; 2],
    /// Largest speed, mm/s.
    pub speed: f64,
}

/// X, Y, Z and two rotary axes; two tables from the base to the part, or a table and a head.
#[derive(Debug, Clone, PartialEq)]
pub struct Kinematics {
    /// X, Y and Z.
    pub linear: [Linear; 3],
    /// The rotary axes.
    pub rotary: [Rotary; 2],
    /// From the axis of the head to the tip of the tool with the head at 0, mm.
    pub pivot: f64,
}

/// Positions of X, Y, Z (mm) and of the two rotary axes (radians).
pub type Joints = [f64; 5];

/// An axis whose travel does not hold a position; mm or radians.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Beyond {
    /// The letter of the axis.
    pub letter: char,
    /// What would be needed.
    pub value: f64,
    /// Its travel.
    pub range: [f64; 2],
}

/// Below this sine the tool axis counts as parallel to the axis of a table, which may then turn as it likes.
const SINGULAR: f64 = 1e-9;

fn unit(axis: usize) -> Vec3 {
    Vec3::from_fn(|k, _| f64::from(u8::from(k == axis)))
}

fn rotate(axis: usize, angle: f64, v: &Vec3) -> Vec3 {
    let u = unit(axis);
    v * angle.cos() + u.cross(v) * angle.sin() + u * (u.dot(v) * (1.0 - angle.cos()))
}

impl Kinematics {
    fn heads(&self) -> bool {
        self.rotary[1].carrier == Carrier::Head || self.rotary[0].carrier == Carrier::Head
    }

    /// Index of the axis that turns the part alone (u), and of the other one (v).
    fn order(&self) -> (usize, usize) {
        if self.rotary[1].carrier == Carrier::Table { (1, 0) } else { (0, 1) }
    }

    /// Both pairs of angles that bring a tool axis to the spindle, within a turn of 0. Where the first axis is free, it keeps
    /// `last`.
    pub fn angles(&self, axis: &Vec3, last: f64) -> [[f64; 2]; 2] {
        let (u, v) = self.order();
        let (about_u, about_v) = (unit(self.rotary[u].about), unit(self.rotary[v].about));
        let (s, c) = (axis.dot(&about_v), axis.dot(&about_u.cross(&about_v)));
        let free = s.hypot(c) < SINGULAR;
        let sign = |k: usize| if self.rotary[k].reverse { -1.0 } else { 1.0 };
        let first = if free { last * sign(u) } else { s.atan2(c) };
        [first, first + PI].map(|alpha| {
            let b = rotate(self.rotary[u].about, alpha, axis);
            let beta = b.dot(&about_v.cross(&Vec3::z())).atan2(b.z);
            let beta = if self.rotary[v].carrier == Carrier::Table { -beta } else { beta };
            let mut out = [0.0; 2];
            out[u] = wrapped(alpha) * sign(u);
            out[v] = wrapped(beta) * sign(v);
            out
        })
    }

    /// All joints for a pose at given angles.
    pub fn joints(&self, pose: &Pose, angles: [f64; 2]) -> Joints {
        let turn = |k: usize| if self.rotary[k].reverse { -angles[k] } else { angles[k] };
        let mut tip = pose.tip;
        // From the part to the base.
        for k in [1, 0] {
            let it = &self.rotary[k];
            if it.carrier == Carrier::Table {
                tip = it.point + rotate(it.about, turn(k), &(tip - it.point));
            }
        }
        if self.heads() {
            for k in [0, 1] {
                let it = &self.rotary[k];
                if it.carrier == Carrier::Head {
                    tip += (rotate(it.about, turn(k), &Vec3::z()) - Vec3::z()) * self.pivot;
                }
            }
        }
        [tip.x, tip.y, tip.z, angles[0], angles[1]]
    }

    /// The pose that joints bring about: the inverse of [`Kinematics::joints`].
    pub fn pose(&self, joints: &Joints) -> Pose {
        let turn = |k: usize| if self.rotary[k].reverse { -joints[3 + k] } else { joints[3 + k] };
        let mut axis = Vec3::z();
        let mut tip = Vec3::new(joints[0], joints[1], joints[2]);
        for k in [0, 1] {
            let it = &self.rotary[k];
            if it.carrier == Carrier::Head {
                axis = rotate(it.about, turn(k), &axis);
                tip -= (axis - Vec3::z()) * self.pivot;
            }
        }
        for k in [0, 1] {
            let it = &self.rotary[k];
            if it.carrier == Carrier::Table {
                tip = it.point + rotate(it.about, -turn(k), &(tip - it.point));
                axis = rotate(it.about, -turn(k), &axis);
            }
        }
        Pose { tip, axis }
    }

    /// The pose of a controller that knows the kinematics, between two blocks: the tip straight, the angles linear.
    pub fn tcp_pose(&self, tip: Vec3, angles: [f64; 2]) -> Pose {
        Pose { tip, axis: self.pose(&[0.0, 0.0, 0.0, angles[0], angles[1]]).axis }
    }

    /// The first joint beyond its travel.
    pub fn beyond(&self, joints: &Joints) -> Option<Beyond> {
        let rotary = self.rotary.iter().map(|it| (it.letter, it.range));
        let axes = rotary.zip(&joints[3..]).chain(self.linear.iter().map(|it| (it.letter, it.range)).zip(&joints[..3]));
        // Angles are exact where the travel ends at a round figure.
        let slack = 1e-9;
        axes.map(|((letter, range), &value)| Beyond { letter, value, range })
            .find(|it| !(it.range[0] - slack <= it.value && it.value <= it.range[1] + slack))
    }

    /// Both solutions for a pose with all whole turns that the travel allows; or the axis that lacks travel in the solution
    /// nearest to being possible.
    pub fn candidates(&self, pose: &Pose, last: f64) -> Result<Vec<Joints>, Beyond> {
        let mut out = Vec::new();
        let mut lacking: Option<(f64, Beyond)> = None;
        for base in self.angles(&pose.axis, last) {
            for turns in (0..25).map(|k| [TAU * f64::from(k / 5 - 2), TAU * f64::from(k % 5 - 2)]) {
                let joints = self.joints(pose, [base[0] + turns[0], base[1] + turns[1]]);
                match self.beyond(&joints) {
                    None => out.push(joints),
                    Some(it) => {
                        let lack = (it.range[0] - it.value).max(it.value - it.range[1]);
                        if turns == [0.0; 2] && lacking.is_none_or(|known| lack < known.0) {
                            lacking = Some((lack, it));
                        }
                    }
                }
            }
        }
        match (out.is_empty(), lacking) {
            (true, Some((_, it))) => Err(it),
            _ => Ok(out),
        }
    }

    /// Joints for every pose of a path with the least turning in all (dynamic programme over both solutions and whole turns).
    /// `Err` names the first pose without any, or without one that can be reached from those before.
    pub fn along(&self, path: &[Pose], from: Option<Joints>) -> Result<Vec<Joints>, (usize, Beyond)> {
        let mut last = from.map_or(0.0, |it| it[3 + self.order().0]);
        let mut layers: Vec<Vec<(Joints, f64, usize)>> = Vec::with_capacity(path.len());
        for (i, pose) in path.iter().enumerate() {
            let found = self.candidates(pose, last).map_err(|it| (i, it))?;
            let layer: Vec<_> = found
                .into_iter()
                .map(|joints| match layers.last() {
                    None => (joints, from.map_or_else(|| rest(&joints), |it| turning(&it, &joints)), 0),
                    Some(before) => {
                        let costs = before.iter().map(|it| it.1 + turning(&it.0, &joints));
                        let (k, cost) = costs.enumerate().min_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((0, 0.0));
                        (joints, cost, k)
                    }
                })
                .collect();
            let best = layer.iter().min_by(|a, b| a.1.total_cmp(&b.1)).expect("candidates are never empty");
            last = best.0[3 + self.order().0];
            layers.push(layer);
        }
        let ends = layers.last().into_iter().flatten().enumerate();
        let mut at = ends.min_by(|a, b| a.1.1.total_cmp(&b.1.1)).map_or(0, |it| it.0);
        let mut out = Vec::with_capacity(layers.len());
        for layer in layers.iter().rev() {
            out.push(layer[at].0);
            at = layer[at].2;
        }
        out.reverse();
        Ok(out)
    }

    /// The solution for a pose that turns least from given joints.
    pub fn nearest(&self, pose: &Pose, to: &Joints) -> Result<Joints, Beyond> {
        let found = self.candidates(pose, to[3 + self.order().0])?;
        let best = found.into_iter().min_by(|a, b| turning(to, a).total_cmp(&turning(to, b)));
        Ok(best.expect("candidates are never empty"))
    }
}

/// Squares, so that a path with one large turn is worse than one with many small ones.
fn turning(a: &Joints, b: &Joints) -> f64 {
    (a[3] - b[3]).powi(2) + (a[4] - b[4]).powi(2)
}

/// A first posture is best near 0.
fn rest(joints: &Joints) -> f64 {
    1e-3 * (joints[3].powi(2) + joints[4].powi(2))
}

/// The same angle in (−π, π].
fn wrapped(angle: f64) -> f64 {
    let turns = (angle / TAU - 0.5).ceil();
    angle - turns * TAU
}
