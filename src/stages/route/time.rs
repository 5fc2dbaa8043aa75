//! How long toolpaths take on a machine with limited acceleration.
use crate::geom::{
    Vec2,
    motion::{Block, corner_speed, plan, trapezoid},
};

/// How far a corner may be cut in the model of the junction speed, mm: GRBL's default (`$11`).
const JUNCTION_DEVIATION: f64 = 0.01;

/// Speeds of a machine.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dynamics {
    /// Speed with the tool lifted, mm/s.
    pub rapid: f64,
    /// Acceleration along the path, mm/s².
    pub acceleration: f64,
    /// Time to lower the tool and lift it again, s.
    pub lift: f64,
}

impl Dynamics {
    /// Seconds for a straight move with the tool lifted.
    pub(super) fn travel(&self, length: f64) -> f64 {
        trapezoid(length, 0.0, self.rapid, 0.0, self.acceleration)
    }

    /// Seconds along a polyline at `feed` mm/s, from rest to rest.
    pub(super) fn along(&self, points: &[Vec2], feed: f64) -> f64 {
        let mut before: Option<Vec2> = None;
        let mut block = |it: Vec2| {
            let (length, direction) = (it.norm(), it.normalize());
            let corner = |last: Vec2| corner_speed(last.dot(&direction), self.acceleration, JUNCTION_DEVIATION);
            let entry = before.replace(direction).map_or(0.0, corner);
            Block { length, nominal: feed, acceleration: self.acceleration, entry }
        };
        let moves = points.windows(2).map(|w| w[1] - w[0]).filter(|it| it.norm() > 0.0);
        let blocks: Vec<Block> = moves.map(&mut block).collect();
        plan(&blocks, 0.0, blocks.len()).0.iter().sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MACHINE: Dynamics = Dynamics { rapid: 100.0, acceleration: 500.0, lift: 0.3 };

    fn line(points: &[[f64; 2]]) -> Vec<Vec2> {
        points.iter().map(|&[x, y]| Vec2::new(x, y)).collect()
    }

    #[test]
    fn straight_moves_are_trapezoids() {
        // 20 mm up to 100 mm/s and 0.1 s... by hand: 0.2 s up, 0.2 s down over 10 mm each, 80 mm at 100 mm/s.
        assert!((MACHINE.travel(100.0) - 1.2).abs() < 1e-12);
        // Too short to reach full speed: a triangle.
        assert!((MACHINE.travel(5.0) - 2.0 * (5.0_f64 / 500.0).sqrt()).abs() < 1e-12);
        assert_eq!(MACHINE.travel(0.0), 0.0);
    }

    #[test]
    fn points_on_a_straight_line_cost_nothing_and_corners_do() {
        let plain = MACHINE.along(&line(&[[0., 0.], [90., 0.]]), 50.0);
        let dotted = MACHINE.along(&line(&[[0., 0.], [1., 0.], [1., 0.], [30., 0.], [90., 0.]]), 50.0);
        assert!((plain - dotted).abs() < 1e-9, "{plain} {dotted}");
        let bent = MACHINE.along(&line(&[[0., 0.], [45., 0.], [45., 45.]]), 50.0);
        let back = MACHINE.along(&line(&[[0., 0.], [45., 0.], [0., 0.]]), 50.0);
        assert!(plain < bent && bent < back);
        assert!((back - 2.0 * MACHINE.along(&line(&[[0., 0.], [45., 0.]]), 50.0)).abs() < 1e-9);
    }
}
