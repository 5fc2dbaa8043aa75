//! The shape of a cut: beside the outline by half its width, entered and left from the waste, with webs left standing.
use crate::{
    geom::{
        Vec2, arcs::ArcPath, boolean::offset, polygon::contains, polyline_length, segment_tree::SegmentTree,
        signed_area,
    },
    model::Part,
};

/// Turns beyond this make a corner, which bridges keep away from, radians.
const CORNER: f64 = 10.0 * std::f64::consts::PI / 180.0;
/// Places tried for the first bridge.
const TRIALS: usize = 24;
/// A contour is at least this many gaps long for every bridge in it.
const SPARSE: f64 = 4.0;
/// Share of a lead at the contact that is not looked at: there it runs along the cut.
const CONTACT: f64 = 0.05;
/// A way round that is shorter is where the cut from either side of a gap just meets, mm; rounding leaves nothing of it.
const LEAST_WAY: f64 = 0.01;
/// Least step along a lead, mm, so that the search ends.
const LEAST_STEP: f64 = 1e-3;

/// Webs left standing in a through cut.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bridges {
    /// How many in each contour; short ones have fewer.
    pub count: usize,
    /// Width of a web, mm.
    pub width: f64,
    /// Passes deeper than this share of the full depth leave the webs; shallower ones run through.
    pub below: f64,
}

/// What a sheet leaves over: all that is not inside a part.
pub(super) struct Waste<'a> {
    /// The contours of all parts.
    pub(super) contours: SegmentTree,
    /// The parts.
    pub(super) parts: &'a [Part],
}

impl<'a> Waste<'a> {
    /// Of the parts of a sheet.
    pub(super) fn of(parts: &'a [Part]) -> Self {
        let contours: Vec<Vec<Vec2>> = parts.iter().flat_map(|it| it.contours.iter().cloned()).collect();
        Self { contours: SegmentTree::of_contours(&contours), parts }
    }
}

/// The ways of the tool for a contour, so that the cut of width `kerf` lies in the waste. Outlines run counter-clockwise,
/// holes clockwise, and so do the results: the waste is on the right. Empty where a hole is narrower than the cut.
pub(super) fn beside(contour: &[Vec2], kerf: f64) -> Vec<Vec<Vec2>> {
    if kerf == 0.0 {
        return vec![contour.to_vec()];
    }
    let outline = signed_area(contour) > 0.0;
    let mut region = contour.to_vec();
    if !outline {
        region.reverse();
    }
    let grown = offset(&[region], if outline { kerf / 2.0 } else { -kerf / 2.0 });
    let mut ways: Vec<Vec<Vec2>> = grown.into_iter().flatten().collect();
    ways.retain(|it| polyline_length(it, true) > LEAST_WAY);
    if !outline {
        ways.iter_mut().for_each(|it| it.reverse());
    }
    ways
}

/// Quarter circles into and out of a closed path from its right, as large as the waste allows, at most of `radius`. A
/// lead stays `kerf / 2` and half of its distance from the path away from every contour of the sheet.
pub(super) fn leads(path: &ArcPath, radius: f64, kerf: f64, waste: &Waste<'_>) -> Option<(ArcPath, ArcPath)> {
    let end = path.bulges.len() - 1;
    let at = path.points[0];
    let quarter = -(std::f64::consts::PI / 8.0).tan();
    let arc = |direction: Vec2, r: f64, inward: bool| {
        let center = at + Vec2::new(direction.y, -direction.x) * r;
        if inward {
            ArcPath { points: vec![center - direction * r, at], bulges: vec![quarter] }
        } else {
            ArcPath { points: vec![at, center + direction * r], bulges: vec![quarter] }
        }
    };
    // The free end lies in no part, and from there to the contact, never farther than the nearest contour: nothing can be stepped over.
    let clear = |it: &ArcPath, r: f64, inward: bool| {
        let length = it.length();
        let free = if inward { it.points[0] } else { it.points[1] };
        if waste.parts.iter().any(|part| contains(&part.contours, free)) {
            return false;
        }
        let mut along = 0.0;
        while along < (1.0 - CONTACT) * length {
            let p = match inward {
                true => it.part(along, length).points.first().copied(),
                false => it.part(0.0, length - along).points.last().copied(),
            };
            let Some(p) = p else { return true };
            let angle = (length - along) / r;
            let needed = kerf / 2.0 + r * (1.0 - angle.cos()) / 2.0;
            let Some((_, near)) = waste.contours.nearest(p) else { return true };
            let distance = (near - p).norm();
            if distance < needed - 1e-9 {
                return false;
            }
            along += distance.max(LEAST_STEP);
        }
        true
    };
    let (first, last) = (path.directions(0).0, path.directions(end).1);
    [1.0, 0.5, 0.25].into_iter().find_map(|share| {
        let r = radius * share;
        let (into, out) = (arc(first, r, true), arc(last, r, false));
        (clear(&into, r, true) && clear(&out, r, false)).then_some((into, out))
    })
}

/// A closed path cut where webs are to stand: gaps of `gap` at even distances, as far from corners as such a row can be.
pub(super) fn bridged(path: &ArcPath, count: usize, gap: f64) -> Vec<ArcPath> {
    let length = path.length();
    let count = count.min((length / (SPARSE * gap)) as usize);
    if count == 0 {
        return vec![path.clone()];
    }
    let mut corners = vec![0.0];
    let mut along = 0.0;
    for i in 0..path.bulges.len() {
        along += path.part_length(i);
        if i + 1 < path.bulges.len() {
            let (a, b) = (path.directions(i).1, path.directions(i + 1).0);
            if a.dot(&b) < CORNER.cos() {
                corners.push(along);
            }
        }
    }
    corners.push(length);
    let pitch = length / count as f64;
    let free = |shift: f64| {
        let places = (0..count).map(|k| shift + pitch * k as f64);
        places.map(|s| corners.iter().map(|c| (s - c).abs()).fold(f64::MAX, f64::min)).fold(f64::MAX, f64::min)
    };
    let shifts = (0..TRIALS).map(|k| gap / 2.0 + (pitch - gap) * (k as f64 + 0.5) / TRIALS as f64);
    let best =
        shifts.fold((pitch / 2.0, f64::MIN), |best, it| if free(it) > best.1 + 1e-9 { (it, free(it)) } else { best });
    let mut pieces = Vec::with_capacity(count + 1);
    let mut from = 0.0;
    for k in 0..count {
        let middle = best.0 + pitch * k as f64;
        pieces.push(path.part(from, middle - gap / 2.0));
        from = middle + gap / 2.0;
    }
    pieces.push(path.part(from, length));
    pieces.retain(|it| it.points.len() > 1);
    pieces
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(side: f64) -> Vec<Vec2> {
        [[0., 0.], [1., 0.], [1., 1.], [0., 1.]].map(|[x, y]| Vec2::new(x, y) * side).to_vec()
    }

    #[test]
    fn the_cut_lies_in_the_waste() {
        let out = beside(&square(10.0), 0.4);
        assert_eq!(out.len(), 1);
        let grown = 100.0 + 40.0 * 0.2 + std::f64::consts::PI * 0.04;
        assert!((signed_area(&out[0]) - grown).abs() < 1e-3, "{}", signed_area(&out[0]));
        let mut hole = square(10.0);
        hole.reverse();
        let inside = beside(&hole, 0.4);
        assert!((signed_area(&inside[0]) + 9.6 * 9.6).abs() < 1e-9);
        hole.iter_mut().for_each(|it| *it *= 0.03);
        assert!(beside(&hole, 0.4).is_empty(), "narrower than the cut");
    }

    #[test]
    fn leads_come_from_the_waste_and_shrink_where_there_is_little() {
        let contour = square(20.0);
        let part = |contour: &Vec<Vec2>| Part { name: "A".into(), contours: vec![contour.clone()], marks: vec![] };
        let parts = [part(&contour)];
        let waste = Waste::of(&parts);
        let path = crate::geom::arcs::fit(&beside(&contour, 0.2)[0], true, 0.005, 0.01);
        let (into, out) = leads(&path, 2.0, 0.2, &waste).unwrap();
        assert_eq!(into.points[1], path.points[0]);
        assert_eq!(out.points[0], path.points[0]);
        for lead in [&into, &out] {
            for p in lead.chords(0.01) {
                let inside = p.x > 0.0 && p.x < 20.0 && p.y > 0.0 && p.y < 20.0;
                assert!(!inside, "{p}");
            }
        }
        let (direction, _) = path.directions(0);
        assert!((into.directions(0).1 - direction).norm() < 1e-9, "tangent to the cut");
        // A frame around it leaves six tenths of a millimetre.
        let mut hole: Vec<Vec2> =
            contour.iter().map(|p| (p - Vec2::repeat(10.0)) * 1.06 + Vec2::repeat(10.0)).collect();
        hole.reverse();
        let frame: Vec<Vec2> = contour.iter().map(|p| (p - Vec2::repeat(10.0)) * 1.5 + Vec2::repeat(10.0)).collect();
        let parts = [part(&contour), Part { contours: vec![frame, hole], ..part(&contour) }];
        let shorter = leads(&path, 2.0, 0.2, &Waste::of(&parts));
        assert!(shorter.is_none_or(|it| it.0.length() < 0.6 * into.length()));
    }

    #[test]
    fn bridges_leave_their_gaps_away_from_corners() {
        let mut points = square(30.0);
        points.push(points[0]);
        let path = ArcPath::straight(points);
        let pieces = bridged(&path, 4, 1.2);
        assert_eq!(pieces.len(), 5, "the first and the last meet at the start");
        let cut: f64 = pieces.iter().map(ArcPath::length).sum();
        assert!((path.length() - cut - 4.0 * 1.2).abs() < 1e-9);
        for w in pieces.windows(2) {
            let (a, b) = (w[0].points[w[0].points.len() - 1], w[1].points[0]);
            assert!(((b - a).norm() - 1.2).abs() < 1e-9);
            let middle = (a + b) / 2.0;
            let corner = square(30.0).into_iter().map(|c| (c - middle).norm()).fold(f64::MAX, f64::min);
            assert!(corner > 10.0, "{corner}");
        }
        let few: f64 = bridged(&path, 100, 10.0).iter().map(ArcPath::length).sum();
        assert!((few - 90.0).abs() < 1e-9, "three of 100, since not more fit: {few}");
    }
}
