//! What makes contours an outline that can be cut: closed, simple, apart, rightly oriented, holes inside.
use super::{
    Box2, Vec2,
    polygon::{contour_contains, orientation, segments_meet},
    segment_tree::{Segment, SegmentTree},
    signed_area,
};

/// Why contours are not an outline with holes. Contour 0 is the outline.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum OutlineError {
    /// No contour, or one that bounds nothing.
    #[error("contour {contour} has only {points} points")]
    TooFewPoints {
        /// The contour.
        contour: usize,
        /// Its points.
        points: usize,
    },
    /// A coordinate is NaN or infinite.
    #[error("contour {contour} has a coordinate that is not a finite number")]
    NotFinite {
        /// The contour.
        contour: usize,
    },
    /// Two edges cross or touch.
    #[error("it crosses or touches itself at ({:.3}, {:.3})", place.x, place.y)]
    Meets {
        /// Where, mm.
        place: Vec2,
        /// The two edges, as contour and index in it.
        edges: [(usize, usize); 2],
    },
    /// An outline that is clockwise, or a hole that is counter-clockwise.
    #[error("contour {contour} runs the wrong way round (signed area {area:.3} mm²)")]
    Orientation {
        /// The contour.
        contour: usize,
        /// Its signed area, mm².
        area: f64,
    },
    /// A hole that is not inside the outline, or lies in another hole.
    #[error("hole {contour} is not inside the material")]
    HoleOutside {
        /// The contour.
        contour: usize,
    },
}

/// Checks that `contours` are one counter-clockwise outline and clockwise holes inside it, all simple, none touching
/// itself or another. Exact.
pub fn check_outline(contours: &[Vec<Vec2>]) -> Result<(), OutlineError> {
    if contours.is_empty() {
        return Err(OutlineError::TooFewPoints { contour: 0, points: 0 });
    }
    for (contour, points) in contours.iter().enumerate() {
        if points.len() < 3 {
            return Err(OutlineError::TooFewPoints { contour, points: points.len() });
        }
        if !points.iter().all(|p| p.x.is_finite() && p.y.is_finite()) {
            return Err(OutlineError::NotFinite { contour });
        }
    }
    if let Some((s, t)) = first_meeting(contours) {
        return Err(OutlineError::Meets {
            place: meeting_place(&s, &t),
            edges: [(s.line, s.index), (t.line, t.index)],
        });
    }
    for (contour, points) in contours.iter().enumerate() {
        let area = signed_area(points);
        if (area > 0.0) != (contour == 0) {
            return Err(OutlineError::Orientation { contour, area });
        }
        // Contours are apart, so one point decides for the whole contour.
        let inside = |other: &Vec<Vec2>| contour_contains(other, points[0]);
        if contour > 0 && (!inside(&contours[0]) || (1..contours.len()).any(|k| k != contour && inside(&contours[k]))) {
            return Err(OutlineError::HoleOutside { contour });
        }
    }
    Ok(())
}

/// The first pair of edges (by contour, then index) that share a point other than the end that joins them.
fn first_meeting(contours: &[Vec<Vec2>]) -> Option<(Segment, Segment)> {
    let tree = SegmentTree::of_contours(contours);
    let mut first: Option<(Segment, Segment)> = None;
    let key = |it: &(Segment, Segment)| ((it.0.line, it.0.index), (it.1.line, it.1.index));
    for &s in tree.segments() {
        tree.visit(&Box2::of([&s.a, &s.b]), &mut |&t| {
            let later = (t.line, t.index) > (s.line, s.index);
            if later && meet(&s, &t, contours[s.line].len()) && first.is_none_or(|it| key(&(s, t)) < key(&it)) {
                first = Some((s, t));
            }
            true
        });
    }
    first
}

/// Whether two edges of a contour of `n` edges share more than the end that joins them.
fn meet(s: &Segment, t: &Segment, n: usize) -> bool {
    let turns_back = |before: &Segment, after: &Segment| {
        orientation(before.a, before.b, after.b) == 0.0 && (before.b - before.a).dot(&(after.b - after.a)) <= 0.0
    };
    if s.line == t.line && s.index + 1 == t.index {
        return turns_back(s, t) || (n == 2);
    }
    if s.line == t.line && s.index == 0 && t.index + 1 == n {
        return turns_back(t, s);
    }
    segments_meet(s.a, s.b, t.a, t.b)
}

/// A point near which two meeting segments meet, for messages.
fn meeting_place(s: &Segment, t: &Segment) -> Vec2 {
    let (d, e) = (s.b - s.a, t.b - t.a);
    let denominator = super::cross2(d, e);
    if denominator == 0.0 {
        return t.a;
    }
    s.a + d * (super::cross2(t.a - s.a, e) / denominator).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn contour(points: &[[f64; 2]]) -> Vec<Vec2> {
        points.iter().map(|&[x, y]| Vec2::new(x, y)).collect()
    }

    fn square(x: f64, y: f64, side: f64) -> Vec<Vec2> {
        contour(&[[x, y], [x + side, y], [x + side, y + side], [x, y + side]])
    }

    fn hole(x: f64, y: f64, side: f64) -> Vec<Vec2> {
        square(x, y, side).into_iter().rev().collect()
    }

    #[test]
    fn each_fault_has_its_name() {
        assert_eq!(check_outline(&[square(0., 0., 9.), hole(1., 1., 2.), hole(4., 4., 2.)]), Ok(()));
        assert!(matches!(check_outline(&[]), Err(OutlineError::TooFewPoints { .. })));
        assert!(matches!(check_outline(&[hole(0., 0., 1.)]), Err(OutlineError::Orientation { contour: 0, .. })));
        assert!(matches!(
            check_outline(&[square(0., 0., 9.), square(1., 1., 2.)]),
            Err(OutlineError::Orientation { contour: 1, .. })
        ));
        for outside in [hole(10., 0., 1.), hole(-5., -5., 30.)] {
            let fault = check_outline(&[square(0., 0., 9.), outside]);
            assert_eq!(fault, Err(OutlineError::HoleOutside { contour: 1 }));
        }
        let nested = check_outline(&[square(0., 0., 9.), hole(1., 1., 5.), hole(2., 2., 2.)]);
        assert_eq!(nested, Err(OutlineError::HoleOutside { contour: 2 }));
        let nan = contour(&[[0., 0.], [1., f64::NAN], [1., 1.]]);
        assert_eq!(check_outline(&[nan]), Err(OutlineError::NotFinite { contour: 0 }));
    }

    #[test]
    fn crossings_touches_and_spikes_are_found_where_they_are() {
        let bow = contour(&[[0., 0.], [4., 4.], [4., 0.], [0., 4.]]);
        let pinch = contour(&[[0., 0.], [4., 0.], [4., 4.], [2., 0.], [0., 4.]]);
        let slit = contour(&[[0., 0.], [9., 0.], [9., 9.], [5., 9.], [5., 5.], [5., 9.], [0., 9.]]);
        let spike = contour(&[[0., 0.], [9., 0.], [5., 0.], [5., 5.]]);
        let doubled = contour(&[[0., 0.], [9., 0.], [9., 0.], [5., 5.]]);
        for (points, place) in
            [(bow, [2., 2.]), (pinch, [2., 0.]), (slit, [5., 7.]), (spike, [9., 0.]), (doubled, [9., 0.])]
        {
            let Err(OutlineError::Meets { place: found, .. }) = check_outline(std::slice::from_ref(&points)) else {
                panic!("{points:?}");
            };
            assert!((found - Vec2::new(place[0], place[1])).norm() <= 2.0, "{points:?}: {found}");
        }
        let touching = check_outline(&[square(0., 0., 9.), hole(0., 2., 2.)]);
        assert!(matches!(touching, Err(OutlineError::Meets { .. })));
    }
}
