//! The functions of section 6 with their exact derivatives: equal angles on a star, the supporting-plane test at a crease
//! point, and the dihedral target.
use super::net::{Degenerate, Net, Star};
use crate::geom::Vec3;

/// Values of the constraints of a star and their gradients: for constraint k, one vector for the centre and then one for each
/// neighbour. Three differences of consecutive cosines for four neighbours, one for three.
pub struct Angles {
    /// Number of constraints.
    pub count: usize,
    /// cos(α_k) − cos(α_{k+1}).
    pub values: [f64; 3],
    /// Gradients.
    pub gradients: [[Vec3; 5]; 3],
}

/// Number of constraints of a star.
pub fn constraints_of(star: &Star) -> usize {
    if star.around.len() == 4 { 3 } else { 1 }
}

/// Differences of consecutive angle cosines at a star, for the positions `x`.
pub fn angle_values(star: &Star, x: &[Vec3]) -> [f64; 3] {
    let n = star.around.len();
    let centre = x[star.centre as usize];
    let mut unit = [Vec3::zeros(); 4];
    for (u, &v) in unit.iter_mut().zip(&star.around) {
        *u = (x[v as usize] - centre).normalize();
    }
    let cosine = |k: usize| unit[k % n].dot(&unit[(k + 1) % n]);
    let mut out = [0.0; 3];
    for (k, value) in out.iter_mut().enumerate().take(constraints_of(star)) {
        *value = cosine(k) - cosine(k + 1);
    }
    out
}

/// As [`angle_values`], with the gradients of the very same functions.
pub fn angles(star: &Star, x: &[Vec3]) -> Angles {
    let n = star.around.len();
    let centre = x[star.centre as usize];
    let (mut unit, mut length) = ([Vec3::zeros(); 4], [1.0; 4]);
    for k in 0..n {
        let e = x[star.around[k] as usize] - centre;
        length[k] = e.norm();
        unit[k] = e / length[k];
    }
    let count = constraints_of(star);
    let (mut values, mut gradients) = ([0.0; 3], [[Vec3::zeros(); 5]; 3]);
    for k in 0..=count {
        let (a, b) = (k % n, (k + 1) % n);
        let cosine = unit[a].dot(&unit[b]);
        let da = (unit[b] - unit[a] * cosine) / length[a];
        let db = (unit[a] - unit[b] * cosine) / length[b];
        for (row, sign) in [(k, 1.0), (k.wrapping_sub(1), -1.0)] {
            if row < count {
                values[row] += sign * cosine;
                gradients[row][a + 1] += da * sign;
                gradients[row][b + 1] += db * sign;
                gradients[row][0] -= (da + db) * sign;
            }
        }
    }
    Angles { count, values, gradients }
}

/// Vertices that a crease point with its two neighbours depends on.
pub const SUPPORT: usize = 12;

/// The edges e₁, e₂ of the two patches through a crease point and the crease edges e_f, e_b (figure 9), as linear forms of
/// twelve vertices. The crease is the mean of its copies in the two patches.
#[derive(Debug, Clone, PartialEq)]
pub struct FoldPoint {
    /// Index among the crease points.
    pub point: usize,
    /// Vertices.
    pub vertices: [u32; SUPPORT],
    /// Coefficients of e₁, e₂, e_f, e_b.
    pub forms: [[f64; SUPPORT]; 4],
    /// Lengths of e_f and e_b in the plane.
    pub lengths: [f64; 2],
    /// What [`FoldPoint::mountain`] is at a right angle.
    pub scale: f64,
    /// Whether the crease is straight here: it has no osculating plane then, and [`FoldPoint::supports`] says nothing.
    pub straight: bool,
}

impl FoldPoint {
    /// The fold points of a net: crease points that no rule leaves out, and those on straight creases.
    pub fn all(net: &Net) -> Vec<Self> {
        let wanted = |&it: &usize| matches!(net.points[it].degenerate, None | Some(Degenerate::Straight));
        (0..net.points.len()).filter(wanted).filter_map(|it| Self::at(net, it)).collect()
    }

    /// A crease point with its neighbours; `None` at the ends of a crease.
    pub fn at(net: &Net, point: usize) -> Option<Self> {
        let it = &net.points[point];
        let [before, after] = it.neighbours?;
        let (mut vertices, mut forms) = ([0; SUPPORT], [[0.0; SUPPORT]; 4]);
        for (block, (index, forth, back)) in
            [(point, -1.0, 1.0), (before, 0.0, -1.0), (after, 1.0, 0.0)].into_iter().enumerate()
        {
            for (side, mix) in net.points[index].sides.iter().enumerate() {
                let k = 4 * block + 2 * side;
                (vertices[k], vertices[k + 1]) = (mix.a, mix.b);
                for (form, sign) in [(2, forth), (3, back)] {
                    forms[form][k] = 0.5 * sign * (1.0 - mix.t);
                    forms[form][k + 1] = 0.5 * sign * mix.t;
                }
                if block == 0 {
                    (forms[side][k], forms[side][k + 1]) = (-1.0, 1.0);
                }
            }
        }
        let lengths = [after, before].map(|other| (net.points[other].flat - it.flat).norm());
        let straight = it.degenerate == Some(Degenerate::Straight);
        let mut out = Self { point, vertices, forms, lengths, scale: 1.0, straight };
        let [one, two, forth, back] = out.edges(&net.flat);
        let tangent = forth * lengths[1] + back * lengths[0];
        let sine = |e: Vec3| e.cross(&tangent).norm() / tangent.norm();
        out.scale = (tangent.norm() * sine(one) * sine(two)).max(f64::MIN_POSITIVE);
        Some(out)
    }

    /// e₁, e₂, e_f, e_b.
    pub fn edges(&self, x: &[Vec3]) -> [Vec3; 4] {
        self.forms
            .map(|form| form.iter().zip(&self.vertices).fold(Vec3::zeros(), |sum, (&w, &v)| sum + x[v as usize] * w))
    }

    /// ⟨e₁, e_f × e_b⟩ and ⟨e₂, e_f × e_b⟩ (eq. 3).
    pub fn supports(&self, x: &[Vec3]) -> [f64; 2] {
        let [one, two, forth, back] = self.edges(x);
        let normal = forth.cross(&back);
        [one.dot(&normal), two.dot(&normal)]
    }

    /// Whether both sides lie on one side of the osculating plane, exactly (eq. 3).
    pub fn folds(&self, x: &[Vec3]) -> bool {
        let [one, two] = self.supports(x);
        let sign = |s: f64| i32::from(s > 0.0) - i32::from(s < 0.0);
        sign(one) + sign(two) == 0 && one.is_finite() && two.is_finite()
    }

    /// tanh(h s₁) + tanh(h s₂) (eq. 15).
    pub fn value(&self, x: &[Vec3], steepness: f64) -> f64 {
        self.supports(x).iter().map(|s| (steepness * s).tanh()).sum()
    }

    /// As [`FoldPoint::value`], with its gradient for each of the vertices.
    pub fn gradient(&self, x: &[Vec3], steepness: f64) -> (f64, [Vec3; SUPPORT]) {
        let [one, two, forth, back] = self.edges(x);
        let normal = forth.cross(&back);
        let (mut value, mut out) = (0.0, [Vec3::zeros(); SUPPORT]);
        for (side, e) in [one, two].into_iter().enumerate() {
            let t = (steepness * e.dot(&normal)).tanh();
            value += t;
            let slope = steepness * (1.0 - t * t);
            let (df, db) = (back.cross(&e), e.cross(&forth));
            for k in 0..SUPPORT {
                out[k] += (normal * self.forms[side][k] + df * self.forms[2][k] + db * self.forms[3][k]) * slope;
            }
        }
        (value, out)
    }

    /// ⟨t₁, t₂ × t*⟩ (eq. 7 with the lengths of e_f and e_b in t* as they are in the plane): more than 0 where a mountain is seen
    /// from +z of the flat sheet. With its gradient for each of the vertices.
    pub fn mountain(&self, x: &[Vec3]) -> (f64, [Vec3; SUPPORT]) {
        let [one, two, forth, back] = self.edges(x);
        let tangent = forth * self.lengths[1] + back * self.lengths[0];
        let (d_one, d_two, d_tangent) = (two.cross(&tangent), tangent.cross(&one), one.cross(&two));
        let mut out = [Vec3::zeros(); SUPPORT];
        for (k, out) in out.iter_mut().enumerate() {
            let along = self.forms[2][k] * self.lengths[1] + self.forms[3][k] * self.lengths[0];
            *out = d_one * self.forms[0][k] + d_two * self.forms[1][k] + d_tangent * along;
        }
        (one.dot(&d_one), out)
    }

    /// Ĥ(x) = (1 + tanh(h x)) / 2 of what is on the wrong side (eq. 9, 15): 0 for a mountain where `side` is 1, for a valley where it
    /// is −1, ½ on a flat sheet; with its gradient for each of the vertices.
    pub fn wrong_side(&self, x: &[Vec3], steepness: f64, side: f64) -> (f64, [Vec3; SUPPORT]) {
        let (mountain, mut gradient) = self.mountain(x);
        let t = (-steepness * side * mountain).tanh();
        let slope = -0.5 * steepness * side * (1.0 - t * t);
        gradient.iter_mut().for_each(|it| *it *= slope);
        (0.5 * (1.0 + t), gradient)
    }

    /// How far the sine of the fold angle falls short of `least` (at most 1) to the given side, 0 where it does not; with its
    /// gradient for each of the vertices. For edges as long as in the plane, ⟨t₁, t₂ × t*⟩ is the sine times a constant.
    pub fn shortfall(&self, x: &[Vec3], least: f64, side: f64) -> (f64, [Vec3; SUPPORT]) {
        let (mountain, mut gradient) = self.mountain(x);
        let short = least - side * mountain / self.scale;
        let slope = if short > 0.0 { -side / self.scale } else { 0.0 };
        gradient.iter_mut().for_each(|it| *it *= slope);
        (short.max(0.0), gradient)
    }

    /// Fold angle in radians, 0 when flat, positive for a mountain seen from +z of the flat sheet. `leftward` says that the edges
    /// lead from the right of the crease to its left.
    pub fn angle(&self, x: &[Vec3], leftward: bool) -> f64 {
        let [one, two, forth, back] = self.edges(x);
        let tangent = (forth * back.norm() + back * forth.norm()).normalize();
        let across = |e: Vec3| (e - tangent * e.dot(&tangent)).normalize();
        // The left patch is side 0: towards it is along its edge if the edge leads left.
        let sign = if leftward { 1.0 } else { -1.0 };
        let (left, right) = (across(one) * sign, across(two) * -sign);
        let (up_left, up_right) = (tangent.cross(&left), right.cross(&tangent));
        // The normals of a mountain lean apart: from left to right they turn in the positive sense about −tangent × …
        up_left.cross(&up_right).dot(&tangent).atan2(up_left.dot(&up_right))
    }
}

/// A fold angle that is asked for at a crease point (eq. 12).
#[derive(Debug, Clone, PartialEq)]
pub struct Dihedral {
    /// Index among the fold points.
    pub fold: usize,
    /// cos² α + sin² α cos θ.
    pub cosine: f64,
    /// 1 / (flat lengths of e₁ and e₂).
    pub scale: f64,
}

impl Dihedral {
    /// The target `angle` (radians) at fold point number `fold`.
    pub fn new(points: &[FoldPoint], fold: usize, flat: &[Vec3], angle: f64) -> Self {
        let [one, two, forth, back] = points[fold].edges(flat);
        let tangent = (forth * back.norm() + back * forth.norm()).normalize();
        let square = (one.dot(&tangent) / one.norm()).powi(2);
        Self { fold, cosine: square + (1.0 - square) * angle.cos(), scale: 1.0 / (one.norm() * two.norm()) }
    }

    /// ⟨t₁, t₂⟩ − cos² α − sin² α cos θ and its gradient for each of the vertices.
    pub fn gradient(&self, points: &[FoldPoint], x: &[Vec3]) -> (f64, [Vec3; SUPPORT]) {
        let it = &points[self.fold];
        let [one, two, ..] = it.edges(x);
        let mut out = [Vec3::zeros(); SUPPORT];
        for k in 0..SUPPORT {
            out[k] = (two * it.forms[0][k] + one * it.forms[1][k]) * self.scale;
        }
        (one.dot(&two) * self.scale - self.cosine, out)
    }
}
