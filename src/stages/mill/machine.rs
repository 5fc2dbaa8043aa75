//! What moves the cutter: a mill with two rotary axes, or a wire between two carriages.
use super::kinematics::{Beyond, Joints, Kinematics, Linear};
use crate::{geom::Vec3, mesh::sweep::Pose};

/// A straight wire between two carriages that move in parallel planes. In work coordinates the left carriage is at y = 0,
/// the right one at y = span; X and Z of the work are X and Y of the left carriage, U and V of the right one.
#[derive(Debug, Clone, PartialEq)]
pub struct Wire {
    /// Distance of the planes, mm.
    pub span: f64,
    /// X, Y, U, V.
    pub axes: [Linear; 4],
}

/// The machine.
#[derive(Debug, Clone, PartialEq)]
pub enum Machine {
    /// Five axes.
    Mill(Kinematics),
    /// Four axes.
    Wire(Wire),
}

/// How a controller moves between two blocks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Between {
    /// All joints linear.
    Joints,
    /// The tip straight, the rotary axes linear.
    Tip,
}

fn five(joints: &[f64]) -> Joints {
    joints.try_into().expect("a mill has five joints")
}

impl Wire {
    /// Where a wire crosses both planes.
    fn ends(&self, pose: &Pose) -> [f64; 4] {
        // A wire along the planes would need carriages infinitely far away.
        let lean = pose.axis.y.abs().max(1e-6).copysign(pose.axis.y);
        let at = |y: f64| pose.tip + pose.axis * ((y - pose.tip.y) / lean);
        let (left, right) = (at(0.0), at(self.span));
        [left.x, left.z, right.x, right.z]
    }

    /// The way that puts poses in the middle of the travel of both carriages.
    pub(super) fn middle(&self, poses: &[Pose]) -> Vec3 {
        let ends: Vec<[f64; 4]> = poses.iter().map(|it| self.ends(it)).collect();
        let way = |pair: [usize; 2]| {
            // Room below and above what both carriages need.
            let low = pair.map(|k| ends.iter().map(|it| it[k]).fold(f64::INFINITY, f64::min) - self.axes[k].range[0]);
            let high =
                pair.map(|k| self.axes[k].range[1] - ends.iter().map(|it| it[k]).fold(f64::NEG_INFINITY, f64::max));
            let way = (high[0].min(high[1]) - low[0].min(low[1])) / 2.0;
            if way.is_finite() { way } else { 0.0 }
        };
        Vec3::new(way([0, 2]), 0.0, way([1, 3]))
    }

    /// Both ends of the wire for a pose.
    fn joints(&self, pose: &Pose) -> Result<Vec<f64>, Beyond> {
        let joints = self.ends(pose);
        match self.axes.iter().zip(joints).find(|(it, value)| !(it.range[0]..=it.range[1]).contains(value)) {
            Some((it, value)) => Err(Beyond { letter: it.letter, value, range: it.range }),
            None => Ok(joints.to_vec()),
        }
    }

    fn pose(&self, joints: &[f64]) -> Pose {
        let (left, right) = (Vec3::new(joints[0], 0.0, joints[1]), Vec3::new(joints[2], self.span, joints[3]));
        Pose { tip: left, axis: (right - left).normalize() }
    }
}

impl Machine {
    /// A pose and its contact as the controller moves it: the tip of a wire is its end at the left carriage.
    pub(super) fn own(&self, pose: Pose, contact: [f64; 2]) -> (Pose, [f64; 2]) {
        match self {
            Self::Mill(_) => (pose, contact),
            Self::Wire(it) => {
                let own = it.pose(&it.ends(&pose));
                let heights = contact.map(|h| (pose.at(h) - own.tip).dot(&own.axis));
                (own, [heights[0].min(heights[1]), heights[0].max(heights[1])])
            }
        }
    }

    /// Letters of the axes in the order of the joints.
    pub(super) fn letters(&self) -> Vec<char> {
        match self {
            Self::Mill(it) => {
                it.linear.iter().map(|it| it.letter).chain(it.rotary.iter().map(|it| it.letter)).collect()
            }
            Self::Wire(it) => it.axes.iter().map(|it| it.letter).collect(),
        }
    }

    /// Largest speeds in the order of the joints, mm/s and rad/s.
    pub(super) fn speeds(&self) -> Vec<f64> {
        match self {
            Self::Mill(it) => it.linear.iter().map(|it| it.speed).chain(it.rotary.iter().map(|it| it.speed)).collect(),
            Self::Wire(it) => it.axes.iter().map(|it| it.speed).collect(),
        }
    }

    /// Distance of the planes of a wire; 0 for a cutter.
    pub(super) fn span(&self) -> f64 {
        match self {
            Self::Mill(_) => 0.0,
            Self::Wire(it) => it.span,
        }
    }

    /// Joints along a path; `Err` names the pose that cannot be reached.
    pub(super) fn along(&self, path: &[Pose], from: Option<&[f64]>) -> Result<Vec<Vec<f64>>, (usize, Beyond)> {
        match self {
            Self::Mill(it) => Ok(it.along(path, from.map(five))?.into_iter().map(|it| it.to_vec()).collect()),
            Self::Wire(it) => {
                path.iter().enumerate().map(|(i, pose)| it.joints(pose).map_err(|beyond| (i, beyond))).collect()
            }
        }
    }

    /// Joints for a pose next to others.
    pub(super) fn nearest(&self, pose: &Pose, to: &[f64]) -> Result<Vec<f64>, Beyond> {
        match self {
            Self::Mill(it) => it.nearest(pose, &five(to)).map(|it| it.to_vec()),
            Self::Wire(it) => it.joints(pose),
        }
    }

    /// Ways to move between blocks that a program may be written for.
    pub(super) fn ways(&self) -> &'static [Between] {
        match self {
            Self::Mill(_) => &[Between::Joints, Between::Tip],
            Self::Wire(_) => &[Between::Joints],
        }
    }

    /// The pose at a share of the way between two blocks.
    pub(super) fn between(&self, way: Between, a: (&Pose, &[f64]), b: (&Pose, &[f64]), s: f64) -> Pose {
        let joints: Vec<f64> = a.1.iter().zip(b.1).map(|(a, b)| a + (b - a) * s).collect();
        match (self, way) {
            (Self::Mill(it), Between::Joints) => it.pose(&five(&joints)),
            (Self::Mill(it), Between::Tip) => it.tcp_pose(a.0.tip + (b.0.tip - a.0.tip) * s, [joints[3], joints[4]]),
            (Self::Wire(it), _) => it.pose(&joints),
        }
    }
}
