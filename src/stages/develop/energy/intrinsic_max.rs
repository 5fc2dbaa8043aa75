//! The intrinsic energy with a maximum: min over unit u in the tangent plane of max ⟨u, N̂⟩², N̂ the normals in the log map at
//! the vertex normal: the squared half width of the hull of all ±N̂ (SGC appendix B.5.1).
//!
//! At the minimum a side of that hull, between a = N̂_i and b = ±N̂_k, is perpendicular to u. For each a, the directions in
//! which no ±N̂ lies beyond a are, as u = a + τ a⊥, an interval of τ: each N̂ bounds it on both sides, where ⟨u, N̂⟩ = ±|a|².
//! The height |a|²/(1 + τ²) of a is least at one of the ends. So all sides take O(n²), without ever forming the hull.
use super::{
    Corner, Pull, Work,
    log_map::{Image, LogMap},
};
use crate::numeric::lanes::{LANES, Lanes};

/// End of an interval that nothing bounds.
const FAR: f64 = 1e100;

/// Energy of several stars of one valence; `pulls` gets its derivatives.
#[inline(always)]
pub(super) fn star(corners: &[Corner], pulls: &mut [Pull], work: &mut Work) -> Lanes {
    let n = corners.len();
    let images = &mut work.images[..n];
    let map = LogMap::new(corners, images);
    let zero = Lanes::default();
    let mut best = Side { square: Lanes::splat(f64::INFINITY), ..Side::default() };
    for i in 0..n {
        best.improve(images, i);
    }
    for (image, pull) in images.iter_mut().zip(&mut *pulls) {
        image.pull = [zero; 2];
        pull.angle = zero;
    }
    // The foot p of the altitude onto the side is (1 − t) a + t b, so the energy |p|² moves by 2 ⟨p, (1 − t) da + t db⟩.
    for lane in 0..LANES {
        let [a, b] = [best.a.0[lane] as usize, best.b.0[lane] as usize];
        let at = |k: usize| [images[k].point[0].0[lane], images[k].point[1].0[lane]];
        let ([ax, ay], [bx, by]) = (at(a), at(b));
        let (sign, tau) = (best.sign.0[lane], best.tau.0[lane]);
        let (ux, uy) = (ax - tau * ay, ay + tau * ax);
        let square = best.square.0[lane];
        let scale = 2.0 / (1.0 + tau * tau);
        let (px, py) = (scale * ux, scale * uy);
        // Heights along the side, measured from the foot.
        let (along_a, along_b) = (ay * ux - ax * uy, sign * (by * ux - bx * uy));
        // Within the side at the minimum; rounding may disagree where the hull has no width.
        let t = (along_a / (along_a - along_b)).clamp(0.0, 1.0);
        if square > 0.0 && square.is_finite() && t.is_finite() {
            for (k, weight) in [(a, 1.0 - t), (b, sign * t)] {
                images[k].pull[0].0[lane] += weight * px;
                images[k].pull[1].0[lane] += weight * py;
            }
        }
    }
    map.pull_back(corners, images, pulls);
    // Without any side all normals agree with the vertex normal. The last term is not a number if any normal is.
    best.square.lt_select(Lanes::splat(f64::INFINITY), best.square, zero) + zero * images[0].point[0]
}

/// The side of the hull that is nearest to the origin so far.
#[derive(Clone, Copy, Default)]
struct Side {
    /// Its squared distance.
    square: Lanes,
    /// Its ends, images `a` and ±`b`.
    a: Lanes,
    b: Lanes,
    sign: Lanes,
    /// Its normal is a + τ a⊥.
    tau: Lanes,
}

impl Side {
    /// Takes one of the sides at image `i` if it is nearer.
    #[inline(always)]
    fn improve(&mut self, images: &[Image], i: usize) {
        let (zero, one) = (Lanes::default(), Lanes::splat(1.0));
        let [ax, ay] = images[i].point;
        let square = ax * ax + ay * ay;
        let (mut low, mut high) = (Lanes::splat(-FAR), Lanes::splat(FAR));
        let (mut low_at, mut high_at) = ([zero; 2], [zero; 2]);
        for (k, image) in images.iter().enumerate().filter(|it| it.0 != i) {
            let [x, y] = image.point;
            let (along, across) = (ax * x + ay * y, ax * y - ay * x);
            let sign = across.lt_select(zero, -one, one);
            let (along, inverse) = (along * sign, one / across.abs());
            let (from, to) = ((-square - along) * inverse, (square - along) * inverse);
            let k = Lanes::splat(k as f64);
            // A bound that is not a number (0/0) belongs to an image equal to ±a and bounds nothing.
            low_at = [low.lt_select(from, k, low_at[0]), low.lt_select(from, -sign, low_at[1])];
            low = low.lt_select(from, from, low);
            high_at = [to.lt_select(high, k, high_at[0]), to.lt_select(high, sign, high_at[1])];
            high = to.lt_select(high, to, high);
        }
        let steeper = high.abs().lt_select(low.abs(), low, high);
        let pick = |l: Lanes, h: Lanes| high.abs().lt_select(low.abs(), l, h);
        let distance = square / (one + steeper * steeper);
        // No direction, or no image to be the outermost: never nearer.
        let never = Lanes::splat(f64::INFINITY);
        let distance = high.lt_select(low, never, zero.lt_select(square, distance, never));
        let better = |yes: Lanes, no: Lanes| distance.lt_select(self.square, yes, no);
        *self = Self {
            square: better(distance, self.square),
            a: better(Lanes::splat(i as f64), self.a),
            b: better(pick(low_at[0], high_at[0]), self.b),
            sign: better(pick(low_at[1], high_at[1]), self.sign),
            tau: better(steeper, self.tau),
        };
    }
}
