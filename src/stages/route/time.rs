//! How long toolpaths take on a machine with limited acceleration, planned as boards of the GRBL family plan.
use crate::geom::Vec2;

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
        self.segment(length, self.rapid, 0.0, 0.0)
    }

    /// Seconds along a polyline at `feed` mm/s, from rest to rest: speeds at corners are limited by the angle (Jeon, "Improving
    /// Grbl: Cornering Algorithm", 2011) and by what acceleration allows over the neighbouring segments, forwards and back.
    pub(super) fn along(&self, points: &[Vec2], feed: f64) -> f64 {
        let moves: Vec<Vec2> = points.windows(2).map(|w| w[1] - w[0]).filter(|it| it.norm() > 0.0).collect();
        let mut speed = vec![0.0; moves.len() + 1];
        for k in 1..moves.len() {
            speed[k] = self.junction(moves[k - 1], moves[k]).min(feed);
        }
        let reach = |from: f64, length: f64| (from * from + 2.0 * self.acceleration * length).sqrt();
        for k in 1..=moves.len() {
            speed[k] = speed[k].min(reach(speed[k - 1], moves[k - 1].norm()));
        }
        for k in (0..moves.len()).rev() {
            speed[k] = speed[k].min(reach(speed[k + 1], moves[k].norm()));
        }
        moves.iter().enumerate().map(|(k, it)| self.segment(it.norm(), feed, speed[k], speed[k + 1])).sum()
    }

    /// Greatest speed through a corner: that of a circle which leaves the corner by the junction deviation.
    fn junction(&self, a: Vec2, b: Vec2) -> f64 {
        // Half the angle between the legs of the corner: a quarter turn for a straight line, 0 for a way back.
        let half = ((1.0 - a.dot(&b) / (a.norm() * b.norm())) / 2.0).max(0.0).sqrt();
        let sine = (1.0 - half * half).max(0.0).sqrt();
        if sine >= 1.0 { f64::INFINITY } else { (self.acceleration * JUNCTION_DEVIATION * sine / (1.0 - sine)).sqrt() }
    }

    /// Seconds of a move that enters and leaves at given speeds: accelerate, cruise, brake.
    fn segment(&self, length: f64, cruise: f64, enter: f64, leave: f64) -> f64 {
        let a = self.acceleration;
        let peak = ((2.0 * a * length + enter * enter + leave * leave) / 2.0).sqrt().min(cruise.max(enter).max(leave));
        let ramps = ((peak * peak - enter * enter) + (peak * peak - leave * leave)) / (2.0 * a);
        (2.0 * peak - enter - leave) / a + if peak > 0.0 { (length - ramps).max(0.0) / peak } else { 0.0 }
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
