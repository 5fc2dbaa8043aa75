//! A blade that trails behind the axis it turns about: where the axis must go so that the tip cuts the outline.
//!
//! The tip lies at `axis − offset · direction` of travel. So the axis runs ahead of the tip by the offset along every edge,
//! and at a corner it swivels about the tip, which stays where it is, from the old direction to the new one.
use crate::geom::{Vec2, cross2, polygon::turned, polyline::ArcLength};

/// Corners that turn by less are not swivelled: the axis goes straight to its next edge, and the tip leaves the corner by
/// less than `offset · (1 − cos 10°)`, 0.004 mm at an offset of 0.25 mm.
const SMOOTH: f64 = 10.0 * std::f64::consts::PI / 180.0;
/// Steps of a swivel.
const STEP: f64 = 10.0 * std::f64::consts::PI / 180.0;

/// A trailing blade.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Knife {
    /// Distance of the tip behind the axis, mm; 0 where the machine corrects for it itself.
    pub offset: f64,
    /// How far a closed contour is cut past its start, mm, because the blade needs a way to come into line.
    pub overcut: f64,
}

impl Knife {
    /// The way of the axis for a way of the tip. A closed way repeats its first point and is cut past it by the overcut.
    pub(super) fn lead(&self, tip: &[Vec2], closed: bool) -> Vec<Vec2> {
        let mut tip = tip.to_vec();
        if closed {
            tip.extend(self.past(&tip));
        }
        tip.dedup();
        if self.offset == 0.0 {
            return tip;
        }
        let mut axis: Vec<Vec2> = Vec::with_capacity(3 * tip.len());
        let mut last: Option<Vec2> = None;
        for w in tip.windows(2) {
            let direction = (w[1] - w[0]).normalize();
            if let Some(old) = last {
                let turn = cross2(old, direction).atan2(old.dot(&direction));
                let steps = if turn.abs() > SMOOTH { (turn.abs() / STEP).ceil() as usize } else { 0 };
                axis.extend((1..steps).map(|k| w[0] + turned(old, turn * k as f64 / steps as f64) * self.offset));
            }
            axis.push(w[0] + direction * self.offset);
            axis.push(w[1] + direction * self.offset);
            last = Some(direction);
        }
        axis
    }

    /// The start of a closed way again, as far as the overcut.
    fn past(&self, tip: &[Vec2]) -> Vec<Vec2> {
        let Some(line) = ArcLength::new(tip.to_vec()) else { return Vec::new() };
        let end = self.overcut.min(line.length());
        if end <= 0.0 {
            return Vec::new();
        }
        let between = line.along().iter().zip(tip).filter(|(s, _)| **s > 0.0 && **s < end).map(|it| *it.1);
        between.chain([line.at(end).0]).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::polygon::point_segment_distance;

    /// Drags a tip behind the axis in small steps, as paper does with a blade.
    fn drag(axis: &[Vec2], offset: f64, direction: Vec2) -> Vec<Vec2> {
        let mut tip = axis[0] - direction * offset;
        let mut trace = vec![tip];
        for w in axis.windows(2) {
            let steps = ((w[1] - w[0]).norm() / 0.002).ceil().max(1.0) as usize;
            for k in 1..=steps {
                let at = w[0] + (w[1] - w[0]) * (k as f64 / steps as f64);
                tip = at + (tip - at).normalize() * offset;
                trace.push(tip);
            }
        }
        trace
    }

    fn farthest(from: &[Vec2], to: &[Vec2]) -> f64 {
        let distance =
            |p: &Vec2| to.windows(2).map(|w| point_segment_distance(*p, w[0], w[1])).fold(f64::MAX, f64::min);
        from.iter().map(distance).fold(0.0, f64::max)
    }

    #[test]
    fn the_tip_traces_the_outline() {
        let outline: Vec<Vec2> =
            [[0., 0.], [30., 0.], [30., 5.], [12., 6.], [29., 9.], [15., 25.], [13., 25.2], [0., 20.], [0., 0.]]
                .map(|[x, y]| Vec2::new(x, y))
                .to_vec();
        let knife = Knife { offset: 0.25, overcut: 0.5 };
        let trace = drag(&knife.lead(&outline, true), 0.25, Vec2::x());
        assert!(farthest(&trace, &outline) < 0.01, "the blade leaves the outline by {}", farthest(&trace, &outline));
        assert!(farthest(&outline, &trace) < 0.02, "a corner is missed by {}", farthest(&outline, &trace));
        let straight = drag(&outline, 0.25, Vec2::x());
        assert!(farthest(&outline, &straight) > 0.1, "the same blade rounds the corners when nothing is done about it");
    }

    #[test]
    fn blades_that_start_askew_close_the_contour_by_the_overcut() {
        let square: Vec<Vec2> =
            [[0., 0.], [20., 0.], [20., 20.], [0., 20.], [0., 0.]].map(|[x, y]| Vec2::new(x, y)).to_vec();
        let knife = Knife { offset: 0.25, overcut: 1.0 };
        let trace = drag(&knife.lead(&square, true), 0.25, Vec2::y());
        let tail = trace[trace.len() - 1];
        assert!((tail - Vec2::new(1.0, 0.0)).norm() < 0.01, "{tail}");
        assert!(farthest(&square, &trace) < 0.1);
        let none = Knife { offset: 0.0, overcut: 0.0 };
        assert_eq!(none.lead(&square, true), square);
    }
}
