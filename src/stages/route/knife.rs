//! A blade that trails behind the axis it turns about: where the axis must go so that the tip cuts the outline.
//!
//! The tip lies at `axis − offset · direction` of travel. So the axis runs ahead of the tip by the offset along every line,
//! on a wider circle along every arc, and at a corner it swivels about the tip, which stays where it is, from the old
//! direction to the new one.
use crate::geom::{Vec2, arcs::ArcPath, cross2};

/// Corners between lines that turn by less are not swivelled: the axis goes by way of the middle of the two directions,
/// and the tip leaves the corner by less than `offset · (1 − cos 5°)`, 0.001 mm at an offset of 0.25 mm.
const SMOOTH: f64 = 10.0 * std::f64::consts::PI / 180.0;

/// A trailing blade.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Knife {
    /// Distance of the tip behind the axis, mm; 0 where the machine corrects for it itself.
    pub offset: f64,
    /// How far a closed contour is cut past its start, mm, because the blade needs a way to come into line.
    pub overcut: f64,
    /// Corners that turn by more than this are turned with the blade lifted, rad; `None` where it never is.
    pub lift: Option<f64>,
}

/// A way of the axis, and whether the blade cuts along it or only turns, with its tip on the surface.
pub(super) type Led = (ArcPath, bool);

/// Length of each leg of the alignment over the offset: a blade that lies across is then within 0.04° of the way
/// (tan(x/2) = e^(−8), see [`crate::geom::arcs::trail`]).
const LEG: f64 = 8.0;

impl Knife {
    /// A way in the margin of a sheet that turns the blade, however it was put in, into a known direction, which is
    /// returned as well: two legs, since a blade may lie exactly against the first. `corner` is a corner of the sheet and
    /// `inward` the diagonal from it, a pair of signs. `None` where nothing trails or the margin is too narrow.
    pub(super) fn alignment(&self, corner: Vec2, inward: Vec2, margin: f64) -> Option<(ArcPath, Vec2)> {
        let leg = (LEG * self.offset).min(0.6 * margin);
        if leg <= 2.0 * self.offset || self.offset == 0.0 {
            return None;
        }
        let first = corner + inward * (0.2 * margin);
        let second = first + Vec2::new(inward.x * leg, 0.0);
        let direction = Vec2::new(0.0, inward.y);
        Some((ArcPath::straight(vec![first, second, second + direction * leg]), direction))
    }

    /// As [`Self::lead`], with the blade lifted where the way turns sharply: a trailing one swivels there on the surface.
    pub(super) fn led(&self, tip: &ArcPath, closed: bool, before: Option<Vec2>) -> (Vec<Led>, Option<Vec2>) {
        let Some(lift) = self.lift else {
            let (axis, after) = self.lead(tip, closed, before);
            return (vec![(axis, true)], after);
        };
        let mut tip = tip.deduplicated();
        if closed {
            tip.append(&tip.part(0.0, self.overcut));
        }
        let mut blade = before;
        let mut ways = Vec::new();
        for piece in tip.split(lift) {
            let (at, direction) = (piece.points[0], piece.directions(0).0);
            if let Some(old) = blade {
                let turn = cross2(old, direction).atan2(old.dot(&direction));
                if turn.abs() > SMOOTH {
                    let ends = [old, direction].map(|it| at + it * self.offset);
                    ways.push((ArcPath { points: ends.to_vec(), bulges: vec![(turn / 4.0).tan()] }, false));
                    blade = Some(direction);
                }
            }
            let (axis, after) = self.lead(&piece, false, blade);
            ways.push((axis, true));
            blade = after;
        }
        (ways, blade)
    }

    /// The way of the axis for a way of the tip, and the direction of the blade at its end. A closed way repeats its first
    /// point and is cut past it by the overcut. `before` is the direction in which the blade was left: it swivels about
    /// the first point of the way, instead of landing beside it.
    pub(super) fn lead(&self, tip: &ArcPath, closed: bool, before: Option<Vec2>) -> (ArcPath, Option<Vec2>) {
        let mut tip = tip.deduplicated();
        if closed {
            tip.append(&tip.part(0.0, self.overcut));
        }
        if self.offset == 0.0 || tip.points.len() < 2 {
            return (tip, before);
        }
        let mut axis = ArcPath::default();
        let mut last: Option<(Vec2, f64)> = None;
        if let Some(before) = before {
            axis.push(tip.points[0] + before * self.offset, 0.0);
            // As after a line that ended there, but always as a swivel.
            last = Some((before, f64::NAN));
        }
        for (i, &bulge) in tip.bulges.iter().enumerate() {
            let at = tip.points[i];
            let (first, after) = tip.directions(i);
            match last {
                None => axis.push(at + first * self.offset, 0.0),
                Some((old, before)) => {
                    let turn = cross2(old, first).atan2(old.dot(&first));
                    if turn.abs() > SMOOTH {
                        axis.push(at + first * self.offset, (turn / 4.0).tan());
                    } else if before == 0.0 && bulge == 0.0 {
                        // Both neighbours are straight, so the way there may end at the middle direction instead.
                        let end = axis.points.len() - 1;
                        axis.points[end] = at + (old + first).normalize() * self.offset;
                    } else if turn != 0.0 {
                        axis.push(at + first * self.offset, 0.0);
                    }
                }
            }
            // The same angle on the circle through the axis.
            axis.push(tip.points[i + 1] + after * self.offset, bulge);
            last = Some((after, bulge));
        }
        (axis.deduplicated(), last.map(|it| it.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::{
        arcs::{fit, trail},
        polygon::{point_segment_distance, turned},
    };

    fn farthest(from: &[Vec2], to: &[Vec2]) -> f64 {
        let distance =
            |p: &Vec2| to.windows(2).map(|w| point_segment_distance(*p, w[0], w[1])).fold(f64::MAX, f64::min);
        from.iter().map(distance).fold(0.0, f64::max)
    }

    fn path(points: &[[f64; 2]]) -> ArcPath {
        ArcPath::straight(points.iter().map(|&[x, y]| Vec2::new(x, y)).collect())
    }

    /// What the tip does along a way of the axis, with the blade at first behind it in `direction`.
    fn drag(axis: &ArcPath, offset: f64, direction: Vec2) -> Vec<Vec2> {
        let lead = axis.chords(1e-4);
        trail(&lead, offset, lead[0] - direction * offset, 0.01)
    }

    #[test]
    fn the_tip_traces_the_outline() {
        let outline =
            path(&[[0., 0.], [30., 0.], [30., 5.], [12., 6.], [29., 9.], [15., 25.], [13., 25.2], [0., 20.], [0., 0.]]);
        let knife = Knife { offset: 0.25, overcut: 0.5, lift: None };
        let trace = drag(&knife.lead(&outline, true, None).0, 0.25, Vec2::x());
        let outline = outline.points;
        assert!(farthest(&trace, &outline) < 0.002, "the blade leaves the outline by {}", farthest(&trace, &outline));
        assert!(farthest(&outline, &trace) < 0.002, "a corner is missed by {}", farthest(&outline, &trace));
        let straight = trail(&outline, 0.25, Vec2::new(-0.25, 0.0), 0.01);
        assert!(farthest(&outline, &straight) > 0.1, "the same blade rounds the corners when nothing is done about it");
    }

    #[test]
    fn arcs_of_the_tip_are_arcs_of_the_axis() {
        let mut points: Vec<Vec2> = (0..=90)
            .map(|k| Vec2::new(20.0, 0.0) + turned(Vec2::new(8.0, 0.0), f64::from(k) * std::f64::consts::PI / 90.0))
            .collect();
        points.extend([[4.0, -10.0], [28.0, -10.0]].map(|[x, y]| Vec2::new(x, y)));
        let tip = fit(&points, true, 0.005, 0.01);
        let axis = Knife { offset: 0.25, overcut: 0.5, lift: None }.lead(&tip, true, None).0;
        assert!(axis.bulges.len() < 16, "{axis:?}");
        let (first, _) = tip.directions(0);
        let trace = drag(&axis, 0.25, first);
        let outline = tip.chords(1e-4);
        assert!(farthest(&trace, &outline) < 0.002, "{}", farthest(&trace, &outline));
        assert!(farthest(&outline, &trace) < 0.002, "{}", farthest(&outline, &trace));
    }

    #[test]
    fn blades_that_start_askew_close_the_contour_by_the_overcut() {
        let square = path(&[[0., 0.], [20., 0.], [20., 20.], [0., 20.], [0., 0.]]);
        let knife = Knife { offset: 0.25, overcut: 1.0, lift: None };
        let trace = drag(&knife.lead(&square, true, None).0, 0.25, Vec2::y());
        let tail = trace[trace.len() - 1];
        assert!((tail - Vec2::new(1.0, 0.0)).norm() < 0.01, "{tail}");
        assert!(farthest(&square.points, &trace) < 0.1);
        let none = Knife { offset: 0.0, overcut: 0.0, lift: None };
        assert_eq!(none.lead(&square, true, None).0, square);
    }

    #[test]
    fn a_blade_that_is_known_lands_on_the_outline() {
        let knife = Knife { offset: 0.25, overcut: 0.5, lift: None };
        let (way, direction) = knife.alignment(Vec2::zeros(), Vec2::new(1.0, 1.0), 5.0).unwrap();
        assert!(way.points.iter().all(|p| p.min() > 0.0 && p.max() < 5.0));
        let askew = Vec2::new(-0.3, -0.954).normalize();
        let trace = drag(&way, 0.25, askew);
        let tip = trace[trace.len() - 1];
        let left = way.points[2] - tip;
        assert!((left / 0.25 - direction).norm() < 1e-3, "{left}");
        let square = path(&[[20., 20.], [40., 20.], [40., 40.], [20., 40.], [20., 20.]]);
        let (axis, after) = knife.lead(&square, true, Some(direction));
        let trace = drag(&axis, 0.25, direction);
        assert!(farthest(&trace, &square.points) < 0.001, "{}", farthest(&trace, &square.points));
        assert!((after.unwrap() - Vec2::x()).norm() < 1e-12);
    }

    #[test]
    fn lifted_corners_are_swivelled_on_the_surface_and_cut_to_the_point() {
        let knife = Knife { offset: 0.25, overcut: 0.5, lift: Some(0.5) };
        let wedge = path(&[[0., 0.], [30., 0.], [2., 3.], [30., 25.], [29., 26.], [0., 0.]]);
        let (ways, after) = knife.led(&wedge, true, Some(Vec2::y()));
        // Five corners, one of them at the start, each with a swivel before its piece, and the overcut behind the last.
        assert_eq!(ways.iter().filter(|it| !it.1).count(), 6);
        assert!((after.unwrap() - Vec2::x()).norm() < 1e-12);
        let mut trace = Vec::new();
        let mut behind = -Vec2::y() * 0.25;
        for (way, cuts) in &ways {
            let lead = way.chords(1e-4);
            let tips = trail(&lead, 0.25, lead[0] + behind, 0.01);
            behind = tips[tips.len() - 1] - lead[lead.len() - 1];
            if *cuts {
                trace.extend(tips);
            } else {
                let still = farthest(&tips, &[tips[0], tips[0]]);
                assert!(still < 1e-3, "the tip stays where it is while it turns: {still}");
            }
        }
        assert!(farthest(&wedge.points, &trace) < 1e-3 && farthest(&trace, &wedge.points) < 1e-3);
    }
}
