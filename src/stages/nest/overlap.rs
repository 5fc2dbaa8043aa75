//! Whether two parts collide, and how badly: a smooth measure that guides them apart.
use super::shape::{LANES, Lanes, Prepared, Shape};
use crate::geom::Vec2;

/// Below this share of the larger diameter, the depth by which circles overlap is replaced by a decaying function of
/// their distance, so that parts which collide without touching circles still feel each other.
const DECAY: f64 = 0.01;

/// How badly two parts collide, mm² scaled by their size; `None` when they are disjoint. `between` leads from the centre
/// of `b` to that of `a`.
///
/// Collision is exact; the measure sums the overlap of the circles inside, weighted by the size of the parts (Gardeyn,
/// Vanden Berghe and Wauters 2025, arXiv:2509.13329, section on collision quantification).
pub(super) fn overlap(a: (&Prepared, &Shape), b: (&Prepared, &Shape), between: Vec2) -> Option<f64> {
    let reach = a.1.half + b.1.half;
    if between.x.abs() >= reach.x || between.y.abs() >= reach.y || !collide(a.1, b.1, between) {
        return None;
    }
    let epsilon = DECAY * a.0.diameter.max(b.0.diameter);
    let sum = epsilon * epsilon + f64::from(depths(&a.1.lanes, &b.1.lanes, between, epsilon as f32));
    Some(sum.sqrt() * (a.0.hull * b.0.hull).sqrt().sqrt())
}

/// Sum over all pairs of circles of the depth by which they overlap, times the smaller radius.
///
/// Most of a search is spent here, so it runs in single precision, several circles at a time; it only guides.
fn depths(a: &Lanes, b: &Lanes, between: Vec2, epsilon: f32) -> f32 {
    let larger = |a: f32, b: f32| if a > b { a } else { b };
    let smaller = |a: f32, b: f32| if a < b { a } else { b };
    let square = epsilon * epsilon;
    let mut sums = [0.0_f32; LANES];
    for p in 0..a.count {
        let (lane, k) = (p / LANES, p % LANES);
        let (x, y, radius) = (a.x[lane][k] + between.x as f32, a.y[lane][k] + between.y as f32, a.radius[lane][k]);
        for ((qx, qy), qr) in b.x.iter().zip(&b.y).zip(&b.radius) {
            for k in 0..LANES {
                let (dx, dy) = (x - qx[k], y - qy[k]);
                let depth = radius + qr[k] - (dx * dx + dy * dy).sqrt();
                // Never less than the depth, and the depth itself from `epsilon` on.
                let decayed = square / larger(2.0 * epsilon - depth, epsilon);
                sums[k] += larger(depth, decayed) * smaller(radius, qr[k]);
            }
        }
    }
    sums.iter().sum()
}

/// Whether the interiors or boundaries meet, given that the boxes do.
fn collide(a: &Shape, b: &Shape, between: Vec2) -> bool {
    // The largest circles decide most collisions.
    for p in a.circles.iter().take(4) {
        let center = p.center + between;
        for q in b.circles.iter().take(4) {
            let reach = p.radius + q.radius;
            if (center - q.center).norm_squared() < reach * reach {
                return true;
            }
        }
    }
    // In the frame of `b`: the window that both boxes share.
    let low = (between - a.half).sup(&-b.half);
    let high = (between + a.half).inf(&b.half);
    let (low_a, high_a) = (low - between, high - between);
    let mut near: [usize; 64] = [0; 64];
    let mut count = 0;
    let mut many = false;
    let (near_a, near_b) = (a.between(low_a.y, high_a.y), b.between(low.y, high.y));
    for (k, edge) in near_b.iter().enumerate() {
        if touches(edge, low, high) {
            if count == near.len() {
                many = true;
                break;
            }
            near[count] = k;
            count += 1;
        }
    }
    for edge in near_a {
        if !touches(edge, low_a, high_a) {
            continue;
        }
        let [p, q] = [edge[0] + between, edge[1] + between];
        let (edge_low, edge_high) = (p.inf(&q), p.sup(&q));
        let hit = |other: &[Vec2; 2]| touches(other, edge_low, edge_high) && cross(p, q, other[0], other[1]);
        let found = if many { near_b.iter().any(hit) } else { near[..count].iter().any(|&k| hit(&near_b[k])) };
        if found {
            return true;
        }
    }
    // No edges meet: one may lie inside the other.
    let within = |inner: Vec2, outer: Vec2, d: Vec2| d.x.abs() + inner.x <= outer.x && d.y.abs() + inner.y <= outer.y;
    (within(a.half, b.half, between) && inside(b, a.edges[0][0] + between))
        || (within(b.half, a.half, between) && inside(a, b.edges[0][0] - between))
}

#[inline]
fn touches([a, b]: &[Vec2; 2], low: Vec2, high: Vec2) -> bool {
    a.x.min(b.x) <= high.x && a.x.max(b.x) >= low.x && a.y.min(b.y) <= high.y && a.y.max(b.y) >= low.y
}

/// Whether two segments cross or touch. Plain f64: shapes are grown by more than rounding.
#[inline]
fn cross(a: Vec2, b: Vec2, c: Vec2, d: Vec2) -> bool {
    let side = |p: Vec2, q: Vec2, r: Vec2| (q.x - p.x) * (r.y - p.y) - (q.y - p.y) * (r.x - p.x);
    side(a, b, c) * side(a, b, d) <= 0.0 && side(c, d, a) * side(c, d, b) <= 0.0
}

fn inside(shape: &Shape, p: Vec2) -> bool {
    let mut inside = false;
    for [a, b] in &shape.edges {
        if (a.y > p.y) != (b.y > p.y) {
            inside ^= p.x < a.x + (b.x - a.x) * (p.y - a.y) / (b.y - a.y);
        }
    }
    inside
}
