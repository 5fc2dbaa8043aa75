//! The covariance energy: λ = min over |u| = 1 of Σ θ ⟨u, N⟩², the smallest eigenvalue of A = Σ θ N Nᵀ (SGC eq. 3, 4).
use super::{Corner, Pull, Work};
use crate::numeric::{
    lanes::{LANES, Lanes, Lanes3},
    symmetric3::jacobi,
};

/// λ of several stars of one valence; `pulls` gets its derivatives ∂λ/∂N = 2 θ ⟨u, N⟩ u and ∂λ/∂θ = ⟨u, N⟩².
#[inline(always)]
pub(in super::super) fn star(corners: &[Corner], pulls: &mut [Pull], _: &mut Work) -> Lanes {
    let u = ruling(corners);
    let mut lambda = Lanes::default();
    for (corner, pull) in corners.iter().zip(pulls) {
        let height = u.dot(corner.normal);
        let square = height * height;
        // Summed from the squares themselves: a small λ keeps its digits, which det/trace formulas lose.
        lambda += corner.angle * square;
        let factor = corner.angle * height;
        (pull.normal, pull.angle) = (u.scale(factor + factor), square);
    }
    lambda
}

/// The unit eigenvector u of the smallest eigenvalue: the direction of the ruling through the vertex.
#[inline(always)]
pub(in super::super) fn ruling(corners: &[Corner]) -> Lanes3 {
    /// Below this share of trace⁴ the squared cross product of rows, about ((λ2 − λ1) λ3)², has lost too many digits.
    const UNSURE: f64 = 1e-12;
    let [mut xx, mut xy, mut xz, mut yy, mut yz, mut zz] = [Lanes::default(); 6];
    for Corner { normal: Lanes3([x, y, z]), angle, .. } in corners {
        let (ax, ay) = (*angle * *x, *angle * *y);
        xx += ax * *x;
        xy += ax * *y;
        xz += ax * *z;
        yy += ay * *y;
        yz += ay * *z;
        zz += *angle * *z * *z;
    }
    let (trace, matrix) = (xx + yy + zz, [xx, xy, xz, yy, yz, zz]);
    let (root, minors) = smallest_root(matrix, trace);
    let (rough, rough_norm2) = null_vector(matrix, root);
    let rough = rough.scale(Lanes::splat(1.0) / rough_norm2.sqrt());
    // One Rayleigh step: the quotient from the normals is exact where the root of the cubic has cancelled.
    let mut quotient = Lanes::default();
    for corner in corners {
        let height = rough.dot(corner.normal);
        quotient += corner.angle * height * height;
    }
    let (u, norm2) = null_vector(matrix, quotient);
    let mut u = u.scale(Lanes::splat(1.0) / norm2.sqrt());
    // The second vector looks sure as well where the root or the first vector was made of rounding (flat stars), because
    // then the quotient is no eigenvalue.
    let norm2 = rough_norm2.lt_select(norm2, rough_norm2, norm2);
    let minors2 = minors * minors;
    let norm2 = minors2.lt_select(norm2, minors2, norm2);
    let limit = trace * trace * trace * trace * Lanes::splat(UNSURE);
    // Also true for NaN, which the fallback passes on.
    if (0..LANES).any(|i| !(norm2.0[i] > limit.0[i])) {
        for i in 0..LANES {
            if !(norm2.0[i] > limit.0[i]) {
                let exact = ruling_exact(corners, i);
                (0..3).for_each(|c| u.0[c].0[i] = exact[c]);
            }
        }
    }
    u
}

/// The longest cross product of two rows of A − shift, along its null vector if it has one, and its squared length.
#[inline(always)]
fn null_vector([xx, xy, xz, yy, yz, zz]: [Lanes; 6], shift: Lanes) -> (Lanes3, Lanes) {
    let (a, b, c) = (xx - shift, yy - shift, zz - shift);
    let (r0, r1, r2) = (Lanes3([a, xy, xz]), Lanes3([xy, b, yz]), Lanes3([xz, yz, c]));
    let (u01, u12, u20) = (r0.cross(r1), r1.cross(r2), r2.cross(r0));
    let (n01, n12, n20) = (u01.dot(u01), u12.dot(u12), u20.dot(u20));
    let u = Lanes3::lt_select(n01, n12, u12, u01);
    let n = n01.lt_select(n12, n12, n01);
    (Lanes3::lt_select(n, n20, u20, u), n.lt_select(n20, n20, n))
}

/// Smallest root of the characteristic cubic λ³ − tλ² + mλ − d, and m ≈ λ2 λ3, by Newton's method from 0, which rises monotonically to
/// it because all three roots are real and not negative.
#[inline(always)]
fn smallest_root([xx, xy, xz, yy, yz, zz]: [Lanes; 6], trace: Lanes) -> (Lanes, Lanes) {
    /// Six as a rule. Beside a nearly double root steps merely halve the error until it is as small as the gap: one step more
    /// for every bit of it, and gaps of less than about 1e-6 go to the fallback.
    const STEPS: usize = 40;
    let (c00, c01, c02) = (yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy);
    let minors = c00 + (xx * zz - xz * xz) + (xx * yy - xy * xy);
    let det = xx * c00 + xy * c01 + xz * c02;
    let mut root = Lanes::default();
    for _ in 0..STEPS {
        let value = ((root - trace) * root + minors) * root - det;
        let slope = (Lanes::splat(3.0) * root - trace - trace) * root + minors;
        let step = -value / slope;
        // Rounding may push the step below zero or make it 0/0 for flat stars; both mean that the root is reached.
        let step = Lanes::default().lt_select(step, step, Lanes::default());
        root += step;
        if !(trace * Lanes::splat(1e-9)).any_lt(step) {
            break;
        }
    }
    (root, minors)
}

/// The same eigenvector for one lane whose two smaller eigenvalues nearly agree (nearly flat or nearly round stars), by
/// Jacobi rotations in a frame along the mean normal, where the matrix of a flat star is graded.
#[cold]
#[inline(never)]
fn ruling_exact(corners: &[Corner], lane: usize) -> [f64; 3] {
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let unit = |a: [f64; 3]| a.map(|c| c / dot(a, a).sqrt());
    let cross =
        |a: [f64; 3], b: [f64; 3]| [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    let mut mean = [0.0; 3];
    for corner in corners {
        let n = corner.normal.lane(lane);
        (0..3).for_each(|c| mean[c] += corner.angle.0[lane] * n[c]);
    }
    // Normals that cancel out (no star of a surface does) leave any frame as good as another.
    let mean = if dot(mean, mean) > 1e-20 { unit(mean) } else { [0.0, 0.0, 1.0] };
    let least = if mean[0].abs() < 0.6 { [1.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0] };
    let first = unit(cross(least, mean));
    let frame = [first, cross(mean, first), mean];
    let mut a = [[0.0; 3]; 3];
    for corner in corners {
        let n = corner.normal.lane(lane);
        let n = frame.map(|axis| dot(axis, n));
        for i in 0..3 {
            (0..3).for_each(|k| a[i][k] += corner.angle.0[lane] * n[i] * n[k]);
        }
    }
    let (values, vectors) = jacobi(a);
    let smallest = (0..3).min_by(|&i, &k| values[i].total_cmp(&values[k])).unwrap_or(0);
    let v = vectors[smallest];
    std::array::from_fn(|c| v[0] * frame[0][c] + v[1] * frame[1][c] + v[2] * frame[2][c])
}
