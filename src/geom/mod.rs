//! 2-D and 3-D primitives, polygons, predicates. Imports nothing of ours.

pub mod arcs;
pub mod arrangement;
pub mod boolean;
pub mod ears;
pub mod motion;
pub mod neck;
pub mod outline;
pub mod polygon;
pub mod polyline;
pub mod segment_tree;
pub mod stroke_font;
pub mod triangle;

/// A point or vector in space, millimetres.
pub type Vec3 = nalgebra::Vector3<f64>;
/// A point or vector in the plane, millimetres.
pub type Vec2 = nalgebra::Vector2<f64>;
/// A complex number: a vector or a rotation in a tangent plane.
pub type Complex = nalgebra::Complex<f64>;

/// Axis-aligned box in space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Box3 {
    /// Smallest coordinates.
    pub min: Vec3,
    /// Largest coordinates.
    pub max: Vec3,
}

impl Box3 {
    /// The box that holds nothing; growing it by a point gives that point.
    pub fn empty() -> Self {
        Self { min: Vec3::repeat(f64::INFINITY), max: Vec3::repeat(f64::NEG_INFINITY) }
    }

    /// The smallest box around `points`.
    pub fn of<'a>(points: impl IntoIterator<Item = &'a Vec3>) -> Self {
        let mut out = Self::empty();
        for point in points {
            out.grow(point);
        }
        out
    }

    /// Grows the box so that it holds `point`.
    pub fn grow(&mut self, point: &Vec3) {
        self.min = self.min.inf(point);
        self.max = self.max.sup(point);
    }

    /// Extent along each axis.
    pub fn size(&self) -> Vec3 {
        self.max - self.min
    }

    /// Length of the diagonal.
    pub fn diagonal(&self) -> f64 {
        self.size().norm()
    }

    /// Whether two closed boxes share a point.
    pub fn touches(&self, other: &Self) -> bool {
        (0..3).all(|axis| self.min[axis] <= other.max[axis] && other.min[axis] <= self.max[axis])
    }
}

/// Axis-aligned box in the plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Box2 {
    /// Smallest coordinates.
    pub min: Vec2,
    /// Largest coordinates.
    pub max: Vec2,
}

impl Box2 {
    /// The box that holds nothing.
    pub fn empty() -> Self {
        Self { min: Vec2::repeat(f64::INFINITY), max: Vec2::repeat(f64::NEG_INFINITY) }
    }

    /// The smallest box around `points`.
    pub fn of<'a>(points: impl IntoIterator<Item = &'a Vec2>) -> Self {
        let mut out = Self::empty();
        for point in points {
            out.grow(point);
        }
        out
    }

    /// Grows the box so that it holds `point`.
    pub fn grow(&mut self, point: &Vec2) {
        self.min = self.min.inf(point);
        self.max = self.max.sup(point);
    }

    /// Extent along each axis.
    pub fn size(&self) -> Vec2 {
        self.max - self.min
    }
}

impl Box2 {
    /// Whether two closed boxes share a point.
    pub fn touches(&self, other: &Self) -> bool {
        self.min.x <= other.max.x && other.min.x <= self.max.x && self.min.y <= other.max.y && other.min.y <= self.max.y
    }

    /// Distance of two boxes, mm; 0 when they touch.
    pub fn distance(&self, other: &Self) -> f64 {
        let apart = |axis: usize| (other.min[axis] - self.max[axis]).max(self.min[axis] - other.max[axis]).max(0.0);
        apart(0).hypot(apart(1))
    }

    /// The box moved by `shift`.
    pub fn moved(&self, shift: Vec2) -> Self {
        Self { min: self.min + shift, max: self.max + shift }
    }

    /// The box with `margin` added on every side.
    pub fn grown(&self, margin: f64) -> Self {
        Self { min: self.min.add_scalar(-margin), max: self.max.add_scalar(margin) }
    }
}

/// z-component of the cross product of two plane vectors.
pub fn cross2(a: Vec2, b: Vec2) -> f64 {
    a.x * b.y - a.y * b.x
}

/// Signed area of a closed polygon (first point not repeated); counter-clockwise is positive.
pub fn signed_area(polygon: &[Vec2]) -> f64 {
    let n = polygon.len();
    0.5 * (0..n).map(|i| cross2(polygon[i], polygon[(i + 1) % n])).sum::<f64>()
}

/// Length of a polyline, with the closing segment when `closed`.
pub fn polyline_length(points: &[Vec2], closed: bool) -> f64 {
    let open: f64 = points.windows(2).map(|w| (w[1] - w[0]).norm()).sum();
    match (closed, points) {
        (true, [first, .., last]) => open + (first - last).norm(),
        _ => open,
    }
}

/// Angle between two vectors in space, radians in [0, π]; accurate near 0 and π.
pub fn angle_between(a: Vec3, b: Vec3) -> f64 {
    a.cross(&b).norm().atan2(a.dot(&b))
}

/// The point of a triangle closest to `p`: its barycentric coordinates (not negative, sum 1) and its squared distance.
/// Works for degenerate triangles too.
///
/// Each side's half space is tested by the area that `p`'s projection spans with it; outside, the answer lies on a side.
#[inline(always)]
pub fn closest_on_triangle(p: &Vec3, corners: &[Vec3; 3]) -> ([f64; 3], f64) {
    /// Below this ratio of doubled area to squared length, the areas that tell sides apart drown in rounding, and the
    /// triangle is nowhere farther than this from its sides.
    const SLIVER: f64 = 1e-8;
    let [a, b, c] = corners;
    let (ab, ac, ap) = (b - a, c - a, p - a);
    // Gram determinants would be shorter but lose twice the digits on thin triangles.
    let normal = ab.cross(&ac);
    let area = normal.norm_squared();
    let v = ap.cross(&ac).dot(&normal);
    let w = ab.cross(&ap).dot(&normal);
    let u = area - v - w;
    let flat = area > (SLIVER * ab.norm_squared().max(ac.norm_squared())).powi(2);
    if flat && u >= 0.0 && v >= 0.0 && w >= 0.0 {
        let (v, w) = (v / area, w / area);
        let u = (1.0 - v - w).max(0.0);
        return ([u, v, w], (ap - ab * v - ac * w).norm_squared());
    }
    // The closest point lies on a side that `p` sees from outside.
    let (mut best, mut squared) = ([1.0, 0.0, 0.0], f64::INFINITY);
    if !flat || w < 0.0 {
        let (s, on_ab) = closest_on_segment(&ap, &ab);
        (best, squared) = ([1.0 - s, s, 0.0], on_ab);
    }
    if !flat || v < 0.0 {
        let (t, on_ac) = closest_on_segment(&ap, &ac);
        if on_ac < squared {
            (best, squared) = ([1.0 - t, 0.0, t], on_ac);
        }
    }
    if !flat || u < 0.0 {
        let (r, on_bc) = closest_on_segment(&(p - b), &(c - b));
        if on_bc < squared {
            (best, squared) = ([0.0, 1.0 - r, r], on_bc);
        }
    }
    (best, squared)
}

/// The parameter in [0, 1] of the point of the segment from 0 to `edge` closest to `p`, and its squared distance.
#[inline(always)]
pub fn closest_on_segment(p: &Vec3, edge: &Vec3) -> (f64, f64) {
    let length = edge.norm_squared();
    let t = if length > 0.0 { (p.dot(edge) / length).clamp(0.0, 1.0) } else { 0.0 };
    (t, (p - edge * t).norm_squared())
}
