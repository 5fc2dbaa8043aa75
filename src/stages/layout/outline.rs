//! The boundary of a piece as contours that a machine can cut: clean, simple, slits open.
use crate::geom::{
    Box2, Vec2,
    boolean::{self, Region},
    cross2,
    outline::{OutlineError, check_outline},
    polygon::{area, contains, nearest_on_segment, point_segment_distance, segment_distance},
    polyline::{merge_near, simplify},
    segment_tree::{Segment, SegmentTree},
    signed_area,
};

/// Points that lie within this of the line between their neighbours carry no shape, mm.
const STRAIGHT: f64 = 1e-3;
/// Crumbs that come off when a slit is opened, and overlaps left by rounding, are dropped below this area, mm².
pub(super) const CRUMB: f64 = 0.05;
/// In wedges of the outside that are sharper than this a tool leaves more uncut than it is wide, radians.
const SHARP: f64 = 0.5;
/// How much wider than a tool a slit is made, on either side, as a share of its width: the ways along both sides stay apart.
const SPARE: f64 = 0.02;

/// Contours as [`check_outline`] wants them.
pub(super) struct Outline {
    pub(super) contours: Vec<Vec<Vec2>>,
    /// Whether slits had to be opened.
    pub(super) opened: bool,
}

/// Why a piece has no outline.
#[derive(Debug, thiserror::Error)]
pub(super) enum Refusal {
    #[error("its outline is not one that can be cut: {0}; cut the piece further, or flatten it with less overlap")]
    Outline(#[from] OutlineError),
    #[error(
        "it overlaps itself on {area:.3} mm² near ({:.3}, {:.3}) after flattening; cut the piece further",
        place.x, place.y
    )]
    Overlap { area: f64, place: Vec2 },
    #[error(
        "opening its slits to {width} mm takes it apart: {area:.3} mm² come off near ({:.3}, {:.3}); set a smaller slit \
         width, or cut the piece there",
        place.x, place.y
    )]
    FallsApart { width: f64, area: f64, place: Vec2 },
}

/// Outline and holes of a piece from its boundary loops. Points marked in `keep` stay where they are. Slits are opened to the
/// first width; overlaps up to the second one are cut away.
pub(super) fn outline(raw: &[Vec<Vec2>], keep: &[Vec<bool>], merge: f64, widths: [f64; 2]) -> Result<Outline, Refusal> {
    let mut contours: Vec<Vec<Vec2>> =
        raw.iter().zip(keep).map(|(points, keep)| clean(points, keep, merge)).filter(|it| it.len() > 2).collect();
    // The outline is the loop that bounds the most; a stable sort keeps the holes in mesh order.
    contours.sort_by(|a, b| signed_area(b).total_cmp(&signed_area(a)));
    let checked = check_outline(&contours);
    if checked.is_ok() && near_edges(&contours, merge).is_empty() {
        return Ok(Outline { contours, opened: false });
    }
    match checked {
        // Only lines that meet can be mended by moving them apart.
        Err(fault) if !matches!(fault, OutlineError::Meets { .. }) => Err(fault.into()),
        _ => {
            let contours = open(&contours, merge, widths)?;
            check_outline(&contours)?;
            Ok(Outline { contours, opened: true })
        }
    }
}

/// Points that carry the shape of a closed line, none nearer to the next than `merge`; those marked in `keep` stay.
pub(super) fn clean(points: &[Vec2], keep: &[bool], merge: f64) -> Vec<Vec2> {
    let kept = merge_near(points, true, merge, &|i| keep[i]);
    let merged: Vec<Vec2> = kept.iter().map(|&i| points[i]).collect();
    simplify(&merged, true, STRAIGHT, &|i| keep[kept[i]]).into_iter().map(|i| merged[i]).collect()
}

/// Takes a strip of width `slit` off both sides wherever the outside between two edges is narrower than that, and what lies
/// over itself on a width of at most `relief`.
fn open(contours: &[Vec<Vec2>], merge: f64, [slit, relief]: [f64; 2]) -> Result<Region, Refusal> {
    let near = near_edges(contours, slit);
    let mut strips: Vec<Vec<Vec2>> = boolean::thicken(&near, slit / 2.0).into_iter().flatten().collect();
    // Where the winding number is not 1, after the strips are gone, the piece truly lies over itself.
    let simple: Vec<Vec<Vec2>> = boolean::union(contours, &[]).into_iter().flatten().collect();
    let mut excess = contours.to_vec();
    excess.extend(simple.iter().map(|it| it.iter().rev().copied().collect()));
    let doubled: Vec<Vec<Vec2>> = boolean::union(&excess, &[]).into_iter().flatten().collect();
    let deep = boolean::difference(&doubled, &strips);
    if let Some(worst) = largest(&deep).filter(|it| area(it) > CRUMB) {
        // What is nowhere wider than the relief has no point farther inside than half of it.
        if relief == 0.0 || !boolean::offset(&doubled, -0.5 * relief - merge).is_empty() {
            return Err(Refusal::Overlap { area: area(worst), place: worst[0][0] });
        }
        strips.extend(boolean::offset(&doubled, slit / 2.0).into_iter().flatten());
    }
    let mut regions = boolean::difference(&simple, &strips);
    regions.sort_by(|a, b| area(b).total_cmp(&area(a)));
    if let Some(loose) = regions.get(1).filter(|it| area(it) > CRUMB) {
        return Err(Refusal::FallsApart { width: slit, area: area(loose), place: loose[0][0] });
    }
    let region = regions.into_iter().next().unwrap_or_default();
    let contours = region.into_iter().filter(|it| signed_area(it).abs() > CRUMB);
    Ok(contours.map(|it| clean(&it, &vec![false; it.len()], merge)).collect())
}

fn largest(regions: &[Region]) -> Option<&Region> {
    regions.iter().max_by(|a, b| area(a).total_cmp(&area(b)))
}

/// The stretches of edges that lie nearer than `limit` to another edge with outside (or overlap) in between. Neighbours
/// count when they turn back on each other into the material.
pub(super) fn near_edges(contours: &[Vec<Vec2>], limit: f64) -> Vec<Vec<Vec2>> {
    let mut stretches: Vec<(Segment, [f64; 2])> = Vec::new();
    for (s, _, [from, to]) in near_pairs(contours, limit) {
        match stretches.last_mut().filter(|it| it.0 == s && from <= it.1[1]) {
            // An edge in a thicket of slits is near to very many others.
            Some(last) => last.1[1] = last.1[1].max(to),
            None => stretches.push((s, [from, to])),
        }
    }
    stretches.into_iter().map(|(s, ends)| ends.map(|u| s.a + (s.b - s.a) * u).to_vec()).collect()
}

/// Pairs of such edges, each twice, and the stretch of the first as parameters in [0, 1].
fn near_pairs(contours: &[Vec<Vec2>], limit: f64) -> Vec<(Segment, Segment, [f64; 2])> {
    let tree = SegmentTree::of_contours(contours);
    let mut near = Vec::new();
    for &s in tree.segments() {
        let window = Box2::of([&s.a, &s.b]).grown(limit);
        tree.visit(&window, &mut |t| {
            if (s.line, s.index) != (t.line, t.index) && slit_between(contours, &s, t, limit) {
                near.push((s, *t, stretch(&s, t, limit)));
            }
            true
        });
    }
    near.sort_by(|x, y| (x.0.line, x.0.index).cmp(&(y.0.line, y.0.index)).then(x.2[0].total_cmp(&y.2[0])));
    near
}

/// Contours in which the outside is nowhere narrower than a tool of that width, which takes away as much in any case; `None`
/// where they are wide enough, or would fall apart.
pub(super) fn widened(contours: &[Vec<Vec2>], tool: f64, merge: f64) -> Option<Vec<Vec<Vec2>>> {
    let middles = middles(contours, tool);
    if middles.is_empty() {
        return None;
    }
    let strips: Vec<Vec<Vec2>> = boolean::thicken(&middles, (0.5 + SPARE) * tool).into_iter().flatten().collect();
    let mut regions = boolean::difference(contours, &strips);
    regions.sort_by(|a, b| area(b).total_cmp(&area(a)));
    let whole = regions.get(1).is_none_or(|it| area(it) <= CRUMB);
    let kept = regions.into_iter().next()?.into_iter().filter(|it| signed_area(it).abs() > CRUMB);
    let contours: Vec<Vec<Vec2>> = kept.map(|it| clean(&it, &vec![false; it.len()], merge)).collect();
    (whole && check_outline(&contours).is_ok() && near_edges(&contours, merge).is_empty()).then_some(contours)
}

/// Lines in the middle of the outside where it is narrower than `width`: between edges that face each other, and in the
/// points of wedges.
fn middles(contours: &[Vec<Vec2>], width: f64) -> Vec<Vec<Vec2>> {
    let middle = |(s, t, [from, to]): (Segment, Segment, [f64; 2])| {
        let at = |u: f64| {
            let p = s.a + (s.b - s.a) * u;
            (p + nearest_on_segment(p, t.a, t.b)) / 2.0
        };
        vec![at(from), at((from + to) / 2.0), at(to)]
    };
    // Shores of a slit run in opposite directions; those of a round hole do so only across it.
    let facing = |(s, t, _): &(Segment, Segment, [f64; 2])| {
        let [along, back] = [s, t].map(|it| it.b - it.a);
        along.dot(&back) < -0.5 * along.norm() * back.norm()
    };
    let mut lines: Vec<Vec<Vec2>> = near_pairs(contours, width).into_iter().filter(facing).map(middle).collect();
    for contour in contours {
        for (k, &tip) in contour.iter().enumerate() {
            let (before, after) = (contour[(k + contour.len() - 1) % contour.len()], contour[(k + 1) % contour.len()]);
            let (back, on) = (before - tip, after - tip);
            let angle = cross2(on, back).atan2(on.dot(&back));
            // The part lies on the left, so that the outside is what is turned through clockwise.
            if (-SHARP..0.0).contains(&angle) {
                let reach = (width / angle.sin().abs()).min(back.norm()).min(on.norm());
                lines.push(vec![tip, tip + (back.normalize() + on.normalize()) * (reach / 2.0)]);
            }
        }
    }
    lines
}

/// The part of `s`, as parameters in [0, 1], that lies within `limit` of `t`, given that some of it does. The distance to a
/// segment is convex along a line, so that part is one interval around the nearest point.
fn stretch(s: &Segment, t: &Segment, limit: f64) -> [f64; 2] {
    let distance = |u: f64| point_segment_distance(s.a + (s.b - s.a) * u, t.a, t.b);
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..60 {
        let (u, v) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
        if distance(u) < distance(v) { high = v } else { low = u }
    }
    let nearest = (low + high) / 2.0;
    [0.0, 1.0].map(|end| {
        if distance(end) < limit {
            return end;
        }
        let (mut inside, mut outside) = (nearest, end);
        for _ in 0..40 {
            let middle = (inside + outside) / 2.0;
            if distance(middle) < limit { inside = middle } else { outside = middle }
        }
        inside
    })
}

fn slit_between(contours: &[Vec<Vec2>], s: &Segment, t: &Segment, limit: f64) -> bool {
    let n = contours[s.line].len();
    let follows = |s: &Segment, t: &Segment| s.line == t.line && (s.index + 1) % n == t.index;
    let foot = |p: Vec2, a: Vec2, b: Vec2| (p, nearest_on_segment(p, a, b));
    let (distance, gap) = if follows(s, t) || follows(t, s) {
        let (a, tip, b) = if follows(s, t) { (s.a, s.b, t.b) } else { (t.a, t.b, s.b) };
        if (tip - a).dot(&(b - tip)) >= 0.0 {
            return false;
        }
        // Neighbours that turn back on each other are a slit or a needle as far as the shorter one reaches.
        let gap = if (tip - a).norm() < (b - tip).norm() { foot(a, tip, b) } else { foot(b, a, tip) };
        ((gap.0 - gap.1).norm(), gap)
    } else {
        let ends = [foot(s.a, t.a, t.b), foot(s.b, t.a, t.b), foot(t.a, s.a, s.b), foot(t.b, s.a, s.b)];
        let narrowest = ends.into_iter().min_by(|x, y| (x.0 - x.1).norm().total_cmp(&(y.0 - y.1).norm()));
        (segment_distance(s.a, s.b, t.a, t.b), narrowest.expect("there are four ends"))
    };
    // In the middle of a gap the winding number is 0, of an overlap 2, of a neck or needle of material 1.
    distance < limit && (distance < 0.1 * STRAIGHT || !contains(contours, (gap.0 + gap.1) / 2.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(contours: &[Vec<[f64; 2]>]) -> Result<Outline, Refusal> {
        let raw: Vec<Vec<Vec2>> =
            contours.iter().map(|it| it.iter().map(|&[x, y]| Vec2::new(x, y)).collect()).collect();
        let keep: Vec<Vec<bool>> = raw.iter().map(|it| vec![false; it.len()]).collect();
        outline(&raw, &keep, 0.02, [0.1, 0.0])
    }

    /// A square of side 60 with a slit from the middle of its top to its centre whose sides are `gap` apart at the mouth.
    fn slit_square(gap: f64, steps: usize) -> Vec<[f64; 2]> {
        let mut points = vec![[0.0, 0.0], [60.0, 0.0], [60.0, 60.0]];
        let side = |k: usize, sign: f64| {
            let t = k as f64 / steps as f64;
            [30.0 + sign * gap / 2.0 * t, 30.0 + 30.0 * t]
        };
        points.extend((0..=steps).rev().map(|k| side(k, 1.0)));
        points.extend((1..=steps).map(|k| side(k, -1.0)));
        points.push([0.0, 60.0]);
        points
    }

    #[test]
    fn clean_outlines_pass_untouched() {
        let square = vec![[0., 0.], [30., 0.], [60., 0.], [60., 60.], [60., 60.001], [0., 60.]];
        let hole = vec![[10., 10.], [10., 20.], [20., 20.], [20., 10.]];
        let found = run(&[hole, square]).unwrap();
        assert!(!found.opened);
        assert_eq!(found.contours.len(), 2);
        assert_eq!(found.contours[0].len(), 4);
        assert!((area(&found.contours) - 3500.0).abs() < 0.05);
    }

    #[test]
    fn closed_slits_are_opened_by_what_the_options_say() {
        for (gap, steps) in [(0.0, 1), (0.0, 9), (0.01, 9), (-0.04, 9), (-0.08, 30)] {
            let raw = slit_square(gap, steps);
            let found = run(std::slice::from_ref(&raw)).unwrap_or_else(|it| panic!("gap {gap}: {it}"));
            assert!(found.opened, "gap {gap}");
            assert_eq!(check_outline(&found.contours), Ok(()));
            assert!(near_edges(&found.contours, 0.02).is_empty(), "gap {gap}");
            // Strips 0.05 mm wide and 30 mm long on the far side of both edges, and the wedge between the edges.
            let expected = 2.0 * 0.05 * 30.0 + 0.5 * f64::abs(gap) * 30.0;
            let lost = 3600.0 - area(&found.contours);
            assert!((lost - expected).abs() < 0.05, "gap {gap}: {lost} mm² lost, {expected} expected");
        }
    }

    #[test]
    fn a_tool_gets_to_the_end_of_every_slit() {
        let tool = 0.3;
        // Slits narrower than the tool, of one edge and of many; a dart whose point alone is; and a wedge with straight sides.
        for (gap, steps) in [(0.1, 1), (0.1, 9), (0.25, 30), (2.0, 9), (2.0, 1)] {
            let square: Vec<Vec2> = slit_square(gap, steps).into_iter().map(Vec2::from).collect();
            let opened = run(&[slit_square(gap, steps)]).unwrap().contours;
            let wide = widened(&opened, tool, 0.02).unwrap_or_else(|| panic!("gap {gap}, {steps} steps"));
            assert_eq!(check_outline(&wide), Ok(()));
            // The middle of the tool runs where it cuts into nothing.
            let ways: Vec<Vec<Vec2>> = boolean::offset(&wide, tool / 2.0).into_iter().flatten().collect();
            let deepest = ways.iter().flatten().filter(|p| (p.x - 30.0).abs() < 2.0).map(|p| p.y);
            let tip = deepest.filter(|y| *y > 20.0).fold(f64::INFINITY, f64::min);
            assert!(tip < 30.6, "gap {gap}, {steps} steps: the tool ends at {tip}");
            let lost = area(&[square]) - area(&wide);
            assert!(lost < 30.0 * tool * 1.1, "gap {gap}, {steps} steps: {lost} mm² lost");
        }
        assert!(widened(&[slit_square(20.0, 1).into_iter().map(Vec2::from).collect()], tool, 0.02).is_none());
    }

    #[test]
    fn wide_darts_stay_as_they_are() {
        let found = run(&[slit_square(2.0, 9)]).unwrap();
        assert!(!found.opened);
        assert!((area(&found.contours) - (3600.0 - 30.0)).abs() < 1e-9);
    }

    #[test]
    fn true_overlaps_are_refused_with_their_place() {
        let reason = run(&[slit_square(-4.0, 9)]).err().unwrap().to_string();
        assert!(reason.contains("overlaps itself") && reason.contains("mm²"), "{reason}");
        let eight = vec![[0., 0.], [40., 40.], [40., 0.], [0., 40.]];
        assert!(run(&[eight]).is_err());
        let backwards = vec![[0., 0.], [0., 40.], [40., 0.]];
        assert!(matches!(run(&[backwards]), Err(Refusal::Outline(OutlineError::Orientation { .. }))));
    }

    #[test]
    fn a_slit_that_reaches_across_takes_the_piece_apart() {
        // Two squares joined by a neck 0.06 mm wide between two closed slits.
        let points = vec![
            [0., 0.],
            [30., 0.],
            [30., 19.97],
            [30.005, 0.],
            [60., 0.],
            [60., 40.],
            [30.005, 40.],
            [30., 20.03],
            [30., 40.],
            [0., 40.],
        ];
        let reason = run(&[points]).err().unwrap().to_string();
        assert!(reason.contains("takes it apart"), "{reason}");
    }
}
