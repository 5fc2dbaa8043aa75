//! What pulls at a sheet: points, edges that are closed onto each other, fold angles, and motions with a name.
use crate::{
    geom::{Box2, Vec2},
    model::CreasePattern,
};

/// One thing that is asked of the sheet; places in the plane and in space, mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Pull {
    /// A point of the sheet goes somewhere; axes that are `None` stay free.
    Point {
        /// In the plane.
        at: Vec2,
        /// In space.
        to: [Option<f64>; 3],
    },
    /// Two points of the sheet meet.
    Close {
        /// In the plane.
        ends: [Vec2; 2],
    },
    /// The crease near a point is folded by an angle (eq. 12).
    Angle {
        /// In the plane.
        at: Vec2,
        /// Radians; mountain and valley are the same.
        angle: f64,
    },
}

/// A motion that is made for the paper as it lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Motion {
    /// The four corners are lifted and drawn together along x.
    LiftCorners,
    /// The ends on the left and on the right are lifted, those at the top and at the bottom lowered.
    Saddle,
    /// The left edge and the right edge are drawn together along x.
    Pinch,
    /// The left edge is closed onto the right one.
    Close,
}

/// Shares of the length of the paper by which corners are drawn in and lifted at amount 1.
const LIFT: [f64; 2] = [0.072, 0.09];
/// By how much the four ends of a saddle are lifted and lowered.
const SADDLE: f64 = 0.11;
/// Share of the length of the paper by which its ends are drawn in.
const PINCH: f64 = 0.15;
/// Where an edge is held, as shares of its length.
const HELD: [f64; 2] = [0.02, 0.98];

impl Motion {
    /// What pulls at the paper of `pattern`; `amount` is 1 for the usual size of the motion.
    pub fn pulls(self, pattern: &CreasePattern, amount: f64) -> Vec<Pull> {
        let bounds = pattern.bounds();
        let Box2 { min, max } = bounds;
        let (size, middle) = (bounds.size(), (min + max) / 2.0);
        let point = |at: Vec2, to: [f64; 3]| Pull::Point { at, to: to.map(Some) };
        let high = |at: Vec2, z: f64| Pull::Point { at, to: [None, None, Some(z)] };
        let inward = |p: f64, centre: f64, share: f64| p + (centre - p).signum() * share;
        let left = |y: f64| nearest(pattern, Vec2::new(min.x, y));
        let right = |y: f64| nearest(pattern, Vec2::new(max.x, y));
        match self {
            Self::LiftCorners => {
                let [pull, lift] = LIFT.map(|it| it * amount * size.x);
                let corner = |p: Vec2| {
                    let p = nearest(pattern, p);
                    point(p, [inward(p.x, middle.x, pull), p.y, lift])
                };
                [min, Vec2::new(min.x, max.y), Vec2::new(max.x, min.y), max].map(corner).to_vec()
            }
            Self::Saddle => {
                let lift = SADDLE * amount * size.norm() / std::f64::consts::SQRT_2;
                let ends = [left(middle.y), right(middle.y)].map(|p| high(p, lift));
                let others = [min.y, max.y].map(|y| high(nearest(pattern, Vec2::new(middle.x, y)), -lift));
                [ends, others].concat()
            }
            Self::Pinch => {
                let pull = PINCH * amount * size.x;
                let ends = HELD.map(|it| min.y + it * size.y).map(|y| [left(y), right(y)]);
                let drawn = |p: Vec2| Pull::Point { at: p, to: [Some(inward(p.x, middle.x, pull)), None, Some(0.0)] };
                ends.into_iter().flatten().map(drawn).collect()
            }
            Self::Close => {
                let pair = |y: f64| Pull::Close { ends: [left(y), right(y)] };
                HELD.map(|it| pair(min.y + it * size.y)).to_vec()
            }
        }
    }
}

/// The point of the edge of the paper nearest to `p`.
fn nearest(pattern: &CreasePattern, p: Vec2) -> Vec2 {
    let points = pattern.patches.iter().flatten().flatten();
    points.copied().min_by(|a, b| (a - p).norm().total_cmp(&(b - p).norm())).unwrap_or(p)
}
