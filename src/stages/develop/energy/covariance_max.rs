//! The covariance energy with a maximum: min over |u| = 1 of max ⟨u, N⟩² (SGC eq. 6).
//!
//! At the minimum (SGC appendix B.4) three normals a, b, c, or their opposites, are equally high: the plane through a, ±b, ±c
//! has the normal u, and the energy is its squared distance from the origin. Its foot p = α a ± β b ± γ c in barycentric
//! coordinates gives the derivative 2 ⟨p, α da ± β db ± γ dc⟩ by the envelope theorem, since no other u is lower to first
//! order. With few faces all triples are tried, several stars at once. With many, the directions in which one normal is the
//! highest form a polygon, whose vertices are the triples of that normal.
use super::{Corner, Pull, Work, covariance};
use crate::{
    geom::Vec3,
    numeric::lanes::{LANES, Lanes, Lanes3},
};

/// Up to this valence trying all O(n³) triples of eight stars in lockstep is faster than clipping O(n²) times star by star.
const TRIPLES: usize = 14;
/// Half side of the square that stands for the plane, in units of the distance of the plane from the origin.
const FAR: f64 = 1e10;

/// δ and 2 a × δ for the triples; two polygons for the clipping.
pub(super) fn work(valence: usize) -> usize {
    if valence <= TRIPLES { 6 * valence } else { 2 * (2 * valence + 8) }
}

/// A plane through a normal and two others or their opposites.
#[derive(Debug, Clone, Copy)]
struct Triple {
    corners: [usize; 3],
    signs: [f64; 2],
}

/// Energy of several stars of one valence; `pulls` gets its derivatives.
#[inline(always)]
pub(super) fn star(corners: &[Corner], pulls: &mut [Pull], work: &mut Work) -> Lanes {
    let n = corners.len();
    for pull in pulls.iter_mut() {
        *pull = Pull::default();
    }
    let u = covariance::ruling(corners);
    // An upper bound that prunes; itself the answer for flat stars, which have no triples.
    let mut energy = highest(corners, u);
    if n > TRIPLES {
        for lane in 0..LANES {
            if let Some((square, triple)) = clipped(corners, lane, &mut work.lanes)
                && square <= energy.0[lane] * (1.0 + 1e-9)
            {
                energy.0[lane] = square;
                pull_triple(corners, pulls, lane, &triple);
            }
        }
        return energy;
    }
    let mut best = energy * Lanes::splat(1.0 + 1e-9);
    let mut found = Lanes::splat(-1.0);
    try_triples(corners, &mut work.lanes, &mut best, &mut found);
    for lane in 0..LANES {
        let code = found.0[lane];
        if code >= 0.0 {
            energy.0[lane] = best.0[lane];
            pull_triple(corners, pulls, lane, &decode(code as usize, n));
        }
    }
    energy
}

/// max ⟨u, N⟩².
#[inline(always)]
fn highest(corners: &[Corner], u: Lanes3) -> Lanes {
    let mut highest = Lanes::default();
    for corner in corners {
        let height = u.dot(corner.normal);
        let square = height * height;
        // Takes over what is not a number.
        highest = square.lt_select(highest, highest, square);
    }
    highest
}

/// The triple with that number in [`try_triples`].
fn decode(code: usize, n: usize) -> Triple {
    let (signs, code) = (code % 4, code / 4);
    let sign = |bit: usize| if signs & bit == 0 { 1.0 } else { -1.0 };
    Triple { corners: [code / (n * n), code / n % n, code % n], signs: [sign(1), sign(2)] }
}

/// Lowers `best` to the least max ⟨w, N⟩²/|w|² over the normals w of all planes through three of the ±N.
#[inline(always)]
fn try_triples(corners: &[Corner], work: &mut [Lanes], best: &mut Lanes, found: &mut Lanes) {
    let n = corners.len();
    let (rows, _) = work.as_chunks_mut::<6>();
    for a in 0..n - 2 {
        let normal = corners[a].normal;
        for (k, row) in rows.iter_mut().enumerate().take(n).skip(a + 1) {
            let d = corners[k].normal - normal;
            let double = normal.cross(d);
            let double = double + double;
            *row = [d.0[0], d.0[1], d.0[2], double.0[0], double.0[1], double.0[2]];
        }
        for b in a + 1..n - 1 {
            let [x, y, z, p, q, r] = rows[b];
            let (db, pb) = (Lanes3([x, y, z]), Lanes3([p, q, r]));
            for (c, row) in rows.iter().enumerate().take(n).skip(b + 1) {
                let [x, y, z, p, q, r] = *row;
                let (dc, pc) = (Lanes3([x, y, z]), Lanes3([p, q, r]));
                // (b ∓ a) × (c ∓ a), from differences, which do not cancel where the normals agree.
                let base = db.cross(dc);
                let planes = [base, base + pc, base - pb, base + pc - pb];
                for (signs, w) in planes.into_iter().enumerate() {
                    let (length2, height) = (w.dot(w), w.dot(normal));
                    let limit = *best * length2;
                    if !(height * height).any_lt(limit) {
                        continue;
                    }
                    let square = highest(corners, w);
                    let value = square / length2;
                    let code = Lanes::splat((((a * n + b) * n + c) * 4 + signs) as f64);
                    *found = value.lt_select(*best, code, *found);
                    *best = value.lt_select(*best, value, *best);
                }
            }
        }
    }
}

/// Adds the derivatives of the squared distance of the plane of `triple` from the origin.
fn pull_triple(corners: &[Corner], pulls: &mut [Pull], lane: usize, triple: &Triple) {
    let normals @ [a, b, c] = triple.corners.map(|k| normal(corners, k, lane));
    let w = triple.plane(normals);
    let inverse = 1.0 / w.norm_squared();
    let factor = 2.0 * inverse * w.dot(&a);
    // Barycentric coordinates of the foot. At the minimum it lies within the triangle; only where rounding decides which
    // triangle it is (developable stars) they must be told so.
    let sign = inverse * triple.signs[0] * triple.signs[1];
    let shares = [b.cross(&(c - b)), c.cross(&(a - c)), a.cross(&(b - a))];
    let signs = [1.0, triple.signs[0], triple.signs[1]];
    let shares: [f64; 3] = std::array::from_fn(|k| (sign * signs[k] * shares[k].dot(&w)).clamp(0.0, 1.0));
    let total: f64 = shares.iter().sum();
    for k in (0..3).filter(|_| total > 0.0) {
        let share = factor * signs[k] * shares[k] / total;
        for i in 0..3 {
            pulls[triple.corners[k]].normal.0[i].0[lane] += share * w[i];
        }
    }
}

impl Triple {
    /// (±b − a) × (±c − a), from differences.
    fn plane(&self, [a, b, c]: [Vec3; 3]) -> Vec3 {
        let (db, dc) = (b - a, c - a);
        let mut w = db.cross(&dc);
        if self.signs[0] < 0.0 {
            w += 2.0 * a.cross(&dc);
        }
        if self.signs[1] < 0.0 {
            w -= 2.0 * a.cross(&db);
        }
        self.signs[0] * self.signs[1] * w
    }
}

fn normal(corners: &[Corner], k: usize, lane: usize) -> Vec3 {
    Vec3::from(corners[k].normal.lane(lane))
}

/// The best triple of one star: for each normal a, the directions u = a + x e1 + y e2 with |⟨u, N⟩| ≤ ⟨u, a⟩ = 1 for all N
/// are a convex polygon, clipped from a large square; the best of them is a vertex.
#[cold]
#[inline(never)]
fn clipped(corners: &[Corner], lane: usize, work: &mut [Lanes]) -> Option<(f64, Triple)> {
    let n = corners.len();
    let (now, next) = work.split_at_mut(work.len() / 2);
    let mut polygons = (now, next);
    let mut best: Option<(f64, Triple)> = None;
    for a in 0..n {
        let chart = PolarChart::new(corners, a, lane);
        let mut size = 4;
        for (i, sides) in [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].into_iter().enumerate() {
            polygons.0[i].0[..3].copy_from_slice(&[FAR * sides[0], FAR * sides[1], -1.0]);
        }
        for label in (0..2 * n).filter(|label| label / 2 != a) {
            let Some(clipped) = chart.clip(&polygons.0[..size], label, polygons.1) else { continue };
            size = clipped;
            polygons = (polygons.1, polygons.0);
        }
        for i in 0..size {
            let label = |i: usize| polygons.0[i % size].0[2];
            let (before, after) = (label(i + size - 1), label(i));
            // A corner that the square still bounds is so far out that the height there is nothing.
            if before < 0.0 || after < 0.0 {
                continue;
            }
            let labels = [before as usize, after as usize];
            let sign = |label: usize| if label.is_multiple_of(2) { 1.0 } else { -1.0 };
            let triple = Triple { corners: [a, labels[0] / 2, labels[1] / 2], signs: labels.map(sign) };
            let w = triple.plane(triple.corners.map(|k| normal(corners, k, lane)));
            let height = (0..n).map(|k| w.dot(&normal(corners, k, lane)).abs()).fold(0.0, f64::max);
            let square = height * height / w.norm_squared();
            if best.as_ref().is_none_or(|it| square < it.0) && square.is_finite() {
                best = Some((square, triple));
            }
        }
    }
    best
}

/// The plane of all u with ⟨u, a⟩ = 1, for one normal a of one star.
struct PolarChart<'a> {
    corners: &'a [Corner],
    lane: usize,
    pole: Vec3,
    axes: [Vec3; 2],
}

impl<'a> PolarChart<'a> {
    fn new(corners: &'a [Corner], a: usize, lane: usize) -> Self {
        let pole = normal(corners, a, lane);
        let least = if pole.x.abs() < 0.6 { Vec3::x() } else { Vec3::y() };
        let first = pole.cross(&least).normalize();
        Self { corners, lane, pole, axes: [first, pole.cross(&first)] }
    }

    /// 1 ∓ ⟨u, N⟩ ≥ 0 as coefficients of 1, x, y, for N with the index `label` / 2.
    fn bound(&self, label: usize) -> [f64; 3] {
        let other = normal(self.corners, label / 2, self.lane) * if label.is_multiple_of(2) { 1.0 } else { -1.0 };
        [0.5 * (self.pole - other).norm_squared(), -self.axes[0].dot(&other), -self.axes[1].dot(&other)]
    }

    /// Clips the polygon `from` into `to`; its new number of vertices, or `None` if the bound cuts nothing off. A vertex is
    /// [x, y, label of the edge to the next vertex, −1 for an edge of the square].
    fn clip(&self, from: &[Lanes], label: usize, to: &mut [Lanes]) -> Option<usize> {
        let bound = self.bound(label);
        let height = |v: &Lanes| bound[0] + bound[1] * v.0[0] + bound[2] * v.0[1];
        if from.iter().all(|v| height(v) >= 0.0) {
            return None;
        }
        let mut size = 0;
        let mut push = |vertex: [f64; 3]| {
            to[size].0[..3].copy_from_slice(&vertex);
            size += 1;
        };
        for (i, here) in from.iter().enumerate() {
            let next = &from[(i + 1) % from.len()];
            let (h, g) = (height(here), height(next));
            let edge = here.0[2];
            if h >= 0.0 {
                push([here.0[0], here.0[1], edge]);
            }
            if (h >= 0.0) != (g >= 0.0) {
                let t = h / (h - g);
                let between = [0, 1].map(|c| here.0[c] + t * (next.0[c] - here.0[c]));
                // Where two bounds meet is known better from the bounds than from vertices that may be far away.
                let [x, y] =
                    if edge < 0.0 { between } else { meet(bound, self.bound(edge as usize)).unwrap_or(between) };
                push([x, y, if h >= 0.0 { label as f64 } else { edge }]);
            }
        }
        Some(size)
    }
}

/// Where two lines c + a x + b y = 0 meet.
fn meet([c, a, b]: [f64; 3], [f, d, e]: [f64; 3]) -> Option<[f64; 2]> {
    let determinant = a * e - b * d;
    let point = [(b * f - c * e) / determinant, (c * d - a * f) / determinant];
    (point[0].abs() <= FAR && point[1].abs() <= FAR).then_some(point)
}
