//! Plane paths of straight lines and circular arcs, and fitting them to polylines.
//!
//! An arc is given by its bulge, as in DXF: the tangent of a quarter of the angle that it turns through, positive
//! counter-clockwise, 0 for a straight line. A bulge of 1 is a half circle; fitted arcs never turn farther.
use super::{
    Vec2, cross2,
    polygon::{point_segment_distance, turned},
};

/// A path of lines and arcs.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ArcPath {
    /// Its points, mm; a closed path repeats its first point at the end.
    pub points: Vec<Vec2>,
    /// One bulge for each stretch between consecutive points.
    pub bulges: Vec<f64>,
}

/// Bulges below this are straight: the arc leaves its chord by less than a millionth of its length.
const STRAIGHT: f64 = 2e-6;
/// Points looked ahead at most when a line or an arc is fitted.
const REACH: usize = 4096;
/// Largest radius of a fitted arc, mm: beyond it controllers that compute in single precision lose the centre.
const LARGEST_RADIUS: f64 = 5000.0;

/// An arc in the form that controllers and evaluation want.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Circle {
    /// Centre, mm.
    pub center: Vec2,
    /// Radius, mm.
    pub radius: f64,
    /// Signed angle that the arc turns through, counter-clockwise positive, radians.
    pub sweep: f64,
}

/// The circle of an arc from `a` to `b`; `None` where it is straight.
pub fn circle(a: Vec2, b: Vec2, bulge: f64) -> Option<Circle> {
    let chord = b - a;
    if bulge.abs() < STRAIGHT || chord.norm() == 0.0 {
        return None;
    }
    // The centre lies on the bisector, at (1 - bulge²) / (4 bulge) chords to the left.
    let left = Vec2::new(-chord.y, chord.x);
    let center = (a + b) / 2.0 + left * ((1.0 - bulge * bulge) / (4.0 * bulge));
    let radius = chord.norm() * (1.0 + bulge * bulge) / (4.0 * bulge.abs());
    Some(Circle { center, radius, sweep: 4.0 * bulge.atan() })
}

impl ArcPath {
    /// Straight lines through points.
    pub fn straight(points: Vec<Vec2>) -> Self {
        let bulges = vec![0.0; points.len().saturating_sub(1)];
        Self { points, bulges }
    }

    /// Whether it ends where it began.
    pub fn is_closed(&self) -> bool {
        self.points.len() > 1 && self.points.first() == self.points.last()
    }

    /// Stretches: two ends and the bulge.
    pub fn stretches(&self) -> impl ExactSizeIterator<Item = (Vec2, Vec2, f64)> + Clone + '_ {
        self.points.windows(2).zip(&self.bulges).map(|(w, &bulge)| (w[0], w[1], bulge))
    }

    /// Length of a stretch, mm.
    fn length_of(a: Vec2, b: Vec2, bulge: f64) -> f64 {
        circle(a, b, bulge).map_or((b - a).norm(), |it| it.radius * it.sweep.abs())
    }

    /// Length of stretch `i`, mm.
    pub fn part_length(&self, i: usize) -> f64 {
        Self::length_of(self.points[i], self.points[i + 1], self.bulges[i])
    }

    /// Its length, mm.
    pub fn length(&self) -> f64 {
        self.stretches().map(|(a, b, bulge)| Self::length_of(a, b, bulge)).sum()
    }

    /// Unit directions of travel at both ends of stretch `i`, which must have a length.
    pub fn directions(&self, i: usize) -> (Vec2, Vec2) {
        let chord = (self.points[i + 1] - self.points[i]).normalize();
        let half = 2.0 * self.bulges[i].atan();
        (turned(chord, -half), turned(chord, half))
    }

    /// Adds a stretch.
    pub fn push(&mut self, to: Vec2, bulge: f64) {
        if !self.points.is_empty() {
            self.bulges.push(bulge);
        }
        self.points.push(to);
    }

    /// Adds a path that begins where this one ends; its first point is left out.
    pub fn append(&mut self, other: &Self) {
        if self.points.is_empty() {
            self.clone_from(other);
            return;
        }
        self.points.extend(other.points.iter().skip(1));
        self.bulges.extend(&other.bulges);
    }

    /// The pieces between corners that turn by more than `angle` radians.
    pub fn split(&self, angle: f64) -> Vec<Self> {
        let sharp = |i: &usize| self.directions(i - 1).1.dot(&self.directions(*i).0) < angle.cos();
        let corners: Vec<usize> = (1..self.bulges.len()).filter(sharp).collect();
        let ends = corners.iter().copied().chain([self.bulges.len()]);
        let piece =
            |(a, b): (usize, usize)| Self { points: self.points[a..=b].to_vec(), bulges: self.bulges[a..b].to_vec() };
        [0].into_iter().chain(corners.iter().copied()).zip(ends).map(piece).collect()
    }

    /// The same path the other way.
    pub fn reversed(mut self) -> Self {
        self.points.reverse();
        self.bulges.reverse();
        self.bulges.iter_mut().for_each(|it| *it = -*it);
        self
    }

    /// A closed path begun at its point `k`.
    pub fn begun_at(mut self, k: usize) -> Self {
        if self.is_closed() && k > 0 && k < self.bulges.len() {
            self.points.pop();
            self.points.rotate_left(k);
            self.bulges.rotate_left(k);
            self.points.push(self.points[0]);
        }
        self
    }

    /// Without stretches of no length.
    pub fn deduplicated(&self) -> Self {
        let mut out = Self::default();
        for (i, &point) in self.points.iter().enumerate() {
            if out.points.last() != Some(&point) {
                out.push(point, if i > 0 { self.bulges[i - 1] } else { 0.0 });
            }
        }
        out
    }

    /// The part between two lengths along it, mm; outside its length it is cut off.
    pub fn part(&self, from: f64, to: f64) -> Self {
        let mut out = Self::default();
        let mut at = 0.0;
        for (a, b, bulge) in self.stretches() {
            let length = Self::length_of(a, b, bulge);
            let (low, high) = ((from - at).max(0.0), (to - at).min(length));
            at += length;
            if length == 0.0 || low >= high {
                continue;
            }
            let place = |s: f64| Self::place(a, b, bulge, s / length);
            let start = if low == 0.0 { a } else { place(low) };
            if out.points.is_empty() {
                out.points.push(start);
            }
            let end = if high == length { b } else { place(high) };
            let turn = (bulge.atan() * (high - low) / length).tan();
            out.push(end, turn);
        }
        out
    }

    /// A point at a share of a stretch.
    fn place(a: Vec2, b: Vec2, bulge: f64, share: f64) -> Vec2 {
        match circle(a, b, bulge) {
            None => a + (b - a) * share,
            Some(it) => it.center + turned(a - it.center, it.sweep * share),
        }
    }

    /// Points along it such that their chords are no farther than `tolerance` from it, mm; ends of stretches are kept.
    pub fn chords(&self, tolerance: f64) -> Vec<Vec2> {
        let mut out: Vec<Vec2> = self.points.first().copied().into_iter().collect();
        for (a, b, bulge) in self.stretches() {
            if let Some(it) = circle(a, b, bulge) {
                // A chord over the angle 2x leaves the circle by r (1 - cos x).
                let step = 2.0 * (1.0 - (tolerance / it.radius).min(1.0)).acos();
                let steps = (it.sweep.abs() / step).ceil().clamp(1.0, 1e5) as usize;
                out.extend((1..steps).map(|k| Self::place(a, b, bulge, k as f64 / steps as f64)));
            }
            out.push(b);
        }
        out
    }

    /// The ends of all stretches with the middles of the arcs: enough to tell two paths apart stretch by stretch.
    pub fn marks(&self) -> Vec<Vec2> {
        let mut out: Vec<Vec2> = self.points.first().copied().into_iter().collect();
        for (a, b, bulge) in self.stretches() {
            if bulge.abs() >= STRAIGHT {
                out.push(Self::place(a, b, bulge, 0.5));
            }
            out.push(b);
        }
        out
    }
}

/// Lines and arcs that stay within a tolerance of a polyline, both ways: every point of the polyline is that near to the
/// path, and every point of the path that near to the polyline. Lines and arcs begin and end at points of the polyline;
/// each is taken as long as it can be made.
///
/// `points` of a closed line do not repeat the first; the result does. `line` and `arc` are the tolerances, mm; with
/// `arc = 0` there are only lines.
pub fn fit(points: &[Vec2], closed: bool, line: f64, arc: f64) -> ArcPath {
    let points: Vec<Vec2> = if closed && points.len() > 2 { around(points) } else { points.to_vec() };
    let mut out = ArcPath { points: points.first().copied().into_iter().collect(), bulges: Vec::new() };
    let mut at = 0;
    while at + 1 < points.len() {
        let rest = &points[at..points.len().min(at + REACH)];
        let straight = longest(rest, |it| fits_line(it, line).then_some(0.0)).unwrap_or((1, 0.0));
        let round = if arc > 0.0 { longest(rest, |it| fits_arc(it, arc)) } else { None };
        let (steps, bulge) = round.filter(|it| it.0 > straight.0.max(2)).unwrap_or(straight);
        at += steps;
        out.push(points[at], bulge);
    }
    out
}

/// A closed line begun at its sharpest corner and ended there, so that no arc is cut where the file happened to begin.
fn around(points: &[Vec2]) -> Vec<Vec2> {
    let n = points.len();
    let turn = |i: usize| {
        let (a, b) = (points[i] - points[(i + n - 1) % n], points[(i + 1) % n] - points[i]);
        cross2(a, b).atan2(a.dot(&b)).abs()
    };
    let sharpest = (0..n).fold((0, f64::MIN), |best, i| if turn(i) > best.1 + 1e-9 { (i, turn(i)) } else { best }).0;
    (0..=n).map(|i| points[(sharpest + i) % n]).collect()
}

/// The longest beginning of a polyline that something fits, as a number of steps, with what it gives: doubled until it
/// fits no longer, then halved in.
fn longest(points: &[Vec2], fits: impl Fn(&[Vec2]) -> Option<f64>) -> Option<(usize, f64)> {
    let most = points.len() - 1;
    let mut good = None;
    let (mut low, mut high) = (1, 1);
    while low <= most {
        match fits(&points[..=high.min(most)]) {
            Some(it) => good = Some((high.min(most), it)),
            // An arc needs a few points before it is one.
            None if good.is_none() && high < 8 => {}
            None => break,
        }
        if high >= most {
            return good;
        }
        low = high;
        high *= 2;
    }
    let (mut low, value) = good?;
    let mut best = (low, value);
    let mut high = high.min(most);
    while high - low > 1 {
        let middle = (low + high) / 2;
        match fits(&points[..=middle]) {
            Some(it) => {
                best = (middle, it);
                low = middle;
            }
            None => high = middle,
        }
    }
    Some(best)
}

fn fits_line(points: &[Vec2], tolerance: f64) -> bool {
    let (a, b) = (points[0], points[points.len() - 1]);
    if a == b {
        return false;
    }
    points.iter().all(|&p| point_segment_distance(p, a, b) <= tolerance)
}

/// The bulge of an arc through the two ends, by least squares over the points between, if it stays within the tolerance.
fn fits_arc(points: &[Vec2], tolerance: f64) -> Option<f64> {
    let (a, b) = (points[0], points[points.len() - 1]);
    let chord = b - a;
    let length = chord.norm();
    if points.len() < 4 || length == 0.0 {
        return None;
    }
    // In coordinates with the origin half way and x along the chord, the circle about (0, h) through both ends is
    // x² + y² - length²/4 = 2 h y.
    let (along, across) = (chord / length, Vec2::new(-chord.y, chord.x) / length);
    let middle = (a + b) / 2.0;
    let (mut qy, mut yy) = (0.0, 0.0);
    for &p in &points[1..points.len() - 1] {
        let (x, y) = ((p - middle).dot(&along), (p - middle).dot(&across));
        // Not more than a half circle, and never backwards.
        if x.abs() > length / 2.0 {
            return None;
        }
        qy += (x * x + y * y - length * length / 4.0) * y;
        yy += y * y;
    }
    if yy == 0.0 {
        return None;
    }
    let h = qy / (2.0 * yy);
    let radius = h.hypot(length / 2.0);
    if radius > LARGEST_RADIUS {
        return None;
    }
    let center = middle + across * h;
    // The arc lies opposite the centre: to the right of the chord, and so counter-clockwise, where the centre is left.
    let bulge = (radius - h.abs()) / (length / 2.0) * if h >= 0.0 { 1.0 } else { -1.0 };
    let turns = |p: Vec2, q: Vec2| cross2(p - center, q - center) * bulge > 0.0;
    points
        .windows(2)
        .all(|w| {
            let outer = (w[1] - center).norm();
            // A chord is nearest the centre at its foot; its ends are the farthest.
            let inner = point_segment_distance(center, w[0], w[1]);
            outer <= radius + tolerance && inner >= radius - tolerance && turns(w[0], w[1])
        })
        .then_some(bulge)
}

/// The way of a point that is dragged at `length` behind another one along `lead`, as a trailing blade or wheel goes:
/// from `start`, at every end of a segment and at most `step` apart, mm.
///
/// Along a straight lead the angle x between the drag and the lead falls as tan(x/2) = tan(x₀/2) e^(−s/length) (the
/// tractrix), so the answer is exact for polylines.
pub fn trail(lead: &[Vec2], length: f64, start: Vec2, step: f64) -> Vec<Vec2> {
    let mut tip = start;
    let mut out = vec![tip];
    for w in lead.windows(2) {
        let way = w[1] - w[0];
        let distance = way.norm();
        if distance == 0.0 {
            continue;
        }
        let direction = way / distance;
        let drag = w[0] - tip;
        let angle = cross2(direction, drag).atan2(direction.dot(&drag));
        let steps = (distance / step).ceil().max(1.0) as usize;
        for k in 1..=steps {
            let s = distance * k as f64 / steps as f64;
            let left = 2.0 * ((angle / 2.0).tan() * (-s / length).exp()).atan();
            tip = w[0] + direction * s - turned(direction, left) * length;
            out.push(tip);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{PI, TAU};

    use super::*;

    fn v(x: f64, y: f64) -> Vec2 {
        Vec2::new(x, y)
    }

    fn ring(radius: f64, n: usize) -> Vec<Vec2> {
        (0..n).map(|k| turned(v(radius, 0.0), TAU * k as f64 / n as f64)).collect()
    }

    /// Largest distance of points of one path from another, by chords.
    fn away(from: &ArcPath, to: &ArcPath) -> f64 {
        let (from, to) = (from.chords(1e-4), to.chords(1e-4));
        let nearest = |p: Vec2| to.windows(2).map(|w| point_segment_distance(p, w[0], w[1])).fold(f64::MAX, f64::min);
        let fine = from.windows(2).flat_map(|w| (0..8).map(move |k| w[0] + (w[1] - w[0]) * (f64::from(k) / 8.0)));
        fine.map(nearest).fold(0.0, f64::max)
    }

    #[test]
    fn circles_need_few_arcs_and_stay_within_the_tolerance() {
        for (radius, n, tolerance) in [(10.0, 720, 0.01), (40.0, 360, 0.02), (3.0, 100, 0.01)] {
            let mut line = ring(radius, n);
            let path = fit(&line, true, 0.005, tolerance);
            assert!(path.is_closed() && path.bulges.len() <= 4, "{} stretches", path.bulges.len());
            line.push(line[0]);
            let line = ArcPath::straight(line);
            assert!(away(&path, &line) <= tolerance + 2e-4 && away(&line, &path) <= tolerance + 2e-4);
            assert!((path.length() - TAU * radius).abs() < 0.01 * radius);
        }
    }

    #[test]
    fn corners_stay_and_straight_runs_merge() {
        // A rounded slot: two straight sides with ten points each, two half circles.
        let mut slot: Vec<Vec2> = (0..10).map(|k| v(2.0 * f64::from(k), -5.0)).collect();
        slot.extend((0..60).map(|k| v(18.0, 0.0) + turned(v(0.0, -5.0), PI * f64::from(k) / 60.0)));
        slot.extend((0..10).map(|k| v(18.0 - 2.0 * f64::from(k), 5.0)));
        slot.extend((0..60).map(|k| v(0.0, 0.0) + turned(v(0.0, 5.0), PI * f64::from(k) / 60.0)));
        let path = fit(&slot, true, 0.005, 0.01);
        assert!(path.bulges.len() <= 9, "{path:?}");
        assert!((path.length() - 36.0 - 10.0 * PI).abs() < 0.02);
        let corner = fit(&[v(0., 0.), v(5., 0.), v(10., 0.), v(10., 4.), v(10., 9.)], false, 0.005, 0.01);
        assert_eq!(corner, ArcPath::straight(vec![v(0., 0.), v(10., 0.), v(10., 9.)]));
        let fine = fit(&ring(10.0, 720), true, 0.005, 0.0);
        assert!(fine.bulges.iter().all(|it| *it == 0.0), "no arcs where none are wanted");
    }

    #[test]
    fn a_wavy_line_is_followed_both_ways() {
        let wave: Vec<Vec2> = (0..2000).map(|k| f64::from(k) * 0.05).map(|x| v(x, 6.0 * (x / 9.0).sin())).collect();
        let path = fit(&wave, false, 0.005, 0.02);
        let line = ArcPath::straight(wave);
        assert!(path.bulges.len() < 60, "{}", path.bulges.len());
        assert!(away(&path, &line) <= 0.0202 && away(&line, &path) <= 0.0202);
    }

    #[test]
    fn parts_add_up_and_reversal_keeps_the_shape() {
        let path = fit(&ring(10.0, 360), true, 0.005, 0.01);
        let length = path.length();
        let (a, b) = (path.part(0.0, 0.3 * length), path.part(0.3 * length, length));
        assert!((a.length() + b.length() - length).abs() < 1e-9);
        assert!((a.points[a.points.len() - 1] - b.points[0]).norm() < 1e-9);
        let back = path.clone().reversed();
        assert!(away(&back, &path) < 2e-4 && back.bulges.iter().all(|it| *it <= 0.0));
        let begun = path.clone().begun_at(1);
        assert_eq!(begun.points[0], path.points[1]);
        assert!(begun.is_closed() && (begun.length() - length).abs() < 1e-9);
        let (first, last) = ArcPath { points: vec![v(0., 0.), v(2., 0.)], bulges: vec![1.0] }.directions(0);
        assert!((first - v(0., -1.)).norm() < 1e-12 && (last - v(0., 1.)).norm() < 1e-12, "a half turn to the left");
    }

    #[test]
    fn a_trailing_point_follows_the_tractrix() {
        let path = trail(&[v(0., 0.), v(3., 0.)], 0.5, v(0., 0.5), 0.1);
        // Pulled along in tiny steps, always at its length behind.
        let mut tip = v(0.0, 0.5);
        for k in 1..=30_000 {
            let lead = v(f64::from(k) * 1e-4, 0.0);
            tip = lead + (tip - lead).normalize() * 0.5;
            if k % 1000 == 0 {
                let there = path[k as usize / 1000];
                assert!((there - tip).norm() < 1e-4, "{there} {tip}");
            }
        }
        assert!((path[path.len() - 1] - v(2.5, 0.0)).norm() < 0.01);
    }
}
