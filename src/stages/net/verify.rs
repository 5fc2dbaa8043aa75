//! What a net has become (§6.1 of the paper): right angles, geodesics, Clairaut's relation, strain, rulings.
use nalgebra::{Matrix2, Matrix3};

use crate::{geom::Vec3, geom::angle_between, model::GeodesicNet};

/// Largest errors of the angles at inner points, rad.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Angles {
    /// Deviation of the angle between both tangents from a right angle (definition 2.4).
    pub orthogonality: f64,
    /// Angle between the osculating planes of a geodesic and the normal plane of the net that holds its tangent: half the difference of the angles on
    /// both sides (lemma 2.3).
    pub geodesic: f64,
}

/// The points with four neighbours.
fn inner(net: &GeodesicNet) -> impl Iterator<Item = (usize, usize)> + use<> {
    let (m, n) = (net.rows, net.columns);
    (1..m - 1).flat_map(move |i| (1..n - 1).map(move |j| (i, j)))
}

/// Measures the angles of the stars.
pub fn angles(net: &GeodesicNet) -> Angles {
    let mut out = Angles::default();
    for (i, j) in inner(net) {
        let here = net.at(i, j);
        let [ahead, left, behind, right] =
            [net.at(i + 1, j), net.at(i, j + 1), net.at(i - 1, j), net.at(i, j - 1)].map(|p| p - here);
        let sides = [left, right].map(|it| angle_between(ahead, it) + angle_between(it, behind));
        out.geodesic = out.geodesic.max((sides[0] - sides[1]).abs() / 2.0);
        if let Some(frame) = net.frame(i, j) {
            let angle = angle_between(frame.along, frame.across);
            out.orthogonality = out.orthogonality.max((angle - std::f64::consts::FRAC_PI_2).abs());
        }
    }
    out
}

/// How well one geodesic of a surface of revolution obeys Clairaut's relation r cos α = const (equation 9), α the angle
/// between the geodesic and the parallel circle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Clairaut {
    /// Mean of r cos α, mm.
    pub mean: f64,
    /// Mean absolute deviation from it, mm.
    pub deviation: f64,
}

/// Clairaut's relation along every geodesic of a net on a surface of revolution around the line through `origin` along
/// `axis`, over the points that have two neighbours on the geodesic.
pub fn clairaut(net: &GeodesicNet, origin: Vec3, axis: Vec3) -> Vec<Clairaut> {
    let axis = axis.normalize();
    (0..net.columns)
        .map(|j| {
            let values: Vec<f64> = (1..net.rows - 1)
                .filter_map(|i| {
                    let tangent = net.frame(i, j)?.along;
                    // r cos α: the tangent times (axis × arm), whose length is r.
                    Some(tangent.dot(&axis.cross(&(net.at(i, j) - origin))).abs())
                })
                .collect();
            let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
            let deviation = values.iter().map(|it| (it - mean).abs()).sum::<f64>() / values.len().max(1) as f64;
            Clairaut { mean, deviation }
        })
        .collect()
}

/// By how much the end of the middle geodesic has turned against its beginning from one net to another, rad: the angle of the
/// rotation between both frames of tangents.
pub fn turned(from: &GeodesicNet, to: &GeodesicNet) -> f64 {
    let column = from.columns / 2;
    let ends = |net: &GeodesicNet| {
        let frame = |i: usize| net.frame(i, column).map(|it| [it.along, it.normal, it.along.cross(&it.normal)]);
        let [a, b] = [frame(0)?, frame(net.rows - 1)?].map(|it| Matrix3::from_columns(&it));
        Some(a.transpose() * b)
    };
    let Some((before, after)) = ends(from).zip(ends(to)) else { return 0.0 };
    (((before.transpose() * after).trace() - 1.0) / 2.0).clamp(-1.0, 1.0).acos()
}

/// The strain of the surface at a point of a net.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Strain {
    /// Principal strains, the larger first.
    pub principal: [f64; 2],
    /// Their unit directions on the deformed net.
    pub directions: [Vec3; 2],
}

impl Strain {
    /// |λ1| + |λ2|, the paper's amount of strain.
    pub fn amount(&self) -> f64 {
        self.principal[0].abs() + self.principal[1].abs()
    }
}

/// Cosine of the angle between the two mid-lines u, v of the quad at (i, j), by its diagonals: |u + v|² − |u − v|² = 4 u · v.
fn cosine(net: &GeodesicNet, i: usize, j: usize) -> f64 {
    let [a, b, c, d] = [net.at(i, j), net.at(i + 1, j), net.at(i + 1, j + 1), net.at(i, j + 1)];
    let (u, v) = ((b + c - a - d) / 2.0, (c + d - a - b) / 2.0);
    u.dot(&v) / (u.norm() * v.norm()).max(f64::MIN_POSITIVE)
}

/// Two-dimensional strain tensor at every point, between two nets of one size: relative lengthening of the edges along and
/// across, and half the change of the cosine in which the mid-lines of a quad meet, each the mean over the edges and quads around
/// the point. Row by row. A tensor of the discrete metric: it does not see how the net bends; see [`angles`] for that.
/// `None` where a tangent does not exist.
pub fn strains(from: &GeodesicNet, to: &GeodesicNet) -> Vec<Option<Strain>> {
    let (m, n) = (from.rows, from.columns);
    let lengthening = |pairs: &[Option<(f64, f64)>]| {
        let found: Vec<f64> = pairs.iter().flatten().map(|(old, new)| new / old - 1.0).collect();
        found.iter().sum::<f64>() / found.len().max(1) as f64
    };
    (0..m * n)
        .map(|k| {
            let (i, j) = (k / n, k % n);
            let along = |i: usize| (from.along(i, j), to.along(i, j));
            let across = |j: usize| (from.across(i, j), to.across(i, j));
            let xx = lengthening(&[i.checked_sub(1).map(along), (i + 1 < m).then(|| along(i))]);
            let yy = lengthening(&[j.checked_sub(1).map(across), (j + 1 < n).then(|| across(j))]);
            let new = to.frame(i, j)?;
            let quads =
                [(i, j), (i.wrapping_sub(1), j), (i, j.wrapping_sub(1)), (i.wrapping_sub(1), j.wrapping_sub(1))];
            let around: Vec<f64> = quads
                .into_iter()
                .filter(|it| it.0 < m - 1 && it.1 < n - 1)
                .map(|(i, j)| cosine(to, i, j) - cosine(from, i, j))
                .collect();
            let xy = around.iter().sum::<f64>() / around.len() as f64 / 2.0;
            let (mean, half) = ((xx + yy) / 2.0, (xx - yy) / 2.0);
            let radius = half.hypot(xy);
            let angle = xy.atan2(half) / 2.0;
            let second = new.normal.cross(&new.along);
            let direction = |a: f64| new.along * a.cos() + second * a.sin();
            Some(Strain {
                principal: [mean + radius, mean - radius],
                directions: [direction(angle), direction(angle + std::f64::consts::FRAC_PI_2)],
            })
        })
        .collect()
}

/// Largest amount of strain |λ1| + |λ2| of the triangles that a quad is cut into by either diagonal, per quad, row by row: Green's
/// tensor ½ (FᵀF − 1) of each triangle by itself. [`strains`] keeps to the lengths of the edges and the difference of the
/// diagonals, which are what the isometry of nets keeps; this one also sees quads that are folded along a diagonal, by
/// the square of that fold.
pub fn triangle_strains(from: &GeodesicNet, to: &GeodesicNet) -> Vec<f64> {
    let quads = (0..from.rows - 1).flat_map(|i| (0..from.columns - 1).map(move |j| (i, j)));
    quads
        .map(|(i, j)| {
            let corners = |net: &GeodesicNet| [net.at(i, j), net.at(i + 1, j), net.at(i + 1, j + 1), net.at(i, j + 1)];
            let (old, new) = (corners(from), corners(to));
            let at = |quad: &[Vec3; 4], k: usize| [quad[(k + 1) % 4] - quad[k], quad[(k + 3) % 4] - quad[k]];
            (0..4).map(|k| green(at(&old, k), at(&new, k))).fold(0.0, f64::max)
        })
        .collect()
}

/// |λ1| + |λ2| of ½ (G⁻¹ G' − 1), G and G' the metrics of two edges before and after; 0 where G is singular.
fn green(before: [Vec3; 2], after: [Vec3; 2]) -> f64 {
    let metric = |[a, b]: [Vec3; 2]| Matrix2::new(a.dot(&a), a.dot(&b), a.dot(&b), b.dot(&b));
    let Some(inverse) = metric(before).try_inverse() else { return 0.0 };
    let product = inverse * metric(after);
    let half = product.trace() / 2.0;
    let root = (half * half - product.determinant()).max(0.0).sqrt();
    [half - root, half + root].map(|it| (it - 1.0).abs() / 2.0).iter().sum()
}

/// Least angle between neighbouring normals at which a ruling has a direction, rad.
const FLAT: f64 = 1e-3;

/// Direction of the ruling at every point, as the line in which its tangent plane meets that of the neighbour ahead or that
/// beside, whichever turns away further (figure 12). `None` where the net is flat.
pub fn rulings(net: &GeodesicNet) -> Vec<Option<Vec3>> {
    let (m, n) = (net.rows, net.columns);
    (0..m * n)
        .map(|k| {
            let (i, j) = (k / n, k % n);
            let normal = net.frame(i, j)?.normal;
            let towards = |i: usize, j: usize| net.frame(i, j).map(|it| normal.cross(&it.normal));
            let ahead = towards(if i + 1 < m { i + 1 } else { i - 1 }, j)?;
            let beside = towards(i, if j + 1 < n { j + 1 } else { j - 1 })?;
            let line = if ahead.norm() >= beside.norm() { ahead } else { beside };
            (line.norm() >= FLAT).then(|| line.normalize())
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cylinder(opening: f64) -> GeodesicNet {
        GeodesicNet::from_fn(9, 13, |i, j| {
            let angle = opening * j as f64 / 12.0;
            Vec3::new(angle.cos(), angle.sin(), i as f64 / 8.0)
        })
    }

    #[test]
    fn rulings_of_a_cylinder_run_along_it() {
        let found = rulings(&cylinder(2.0));
        assert!(found.iter().all(|it| it.is_some_and(|r| r.z.abs() > 1.0 - 1e-12)));
        let flat = GeodesicNet::from_fn(4, 4, |i, j| Vec3::new(i as f64, j as f64, 0.0));
        assert!(rulings(&flat).iter().all(Option::is_none));
    }

    #[test]
    fn strain_tells_stretch_and_shear() {
        let from = GeodesicNet::from_fn(5, 6, |i, j| Vec3::new(i as f64, j as f64, 0.0));
        let stretched = GeodesicNet::from_fn(5, 6, |i, j| Vec3::new(1.02 * i as f64, 0.99 * j as f64, 0.0));
        for it in strains(&from, &stretched) {
            let it = it.unwrap();
            assert!((it.principal[0] - 0.02).abs() < 1e-12 && (it.principal[1] + 0.01).abs() < 1e-12);
            assert!((it.directions[0].x.abs() - 1.0).abs() < 1e-12);
        }
        let shear = 1e-3;
        let sheared = GeodesicNet::from_fn(5, 6, |i, j| Vec3::new(i as f64 + shear * j as f64, j as f64, 0.0));
        for it in strains(&from, &sheared) {
            let it = it.unwrap();
            assert!((it.principal[0] - shear / 2.0).abs() < shear * shear);
            assert!((it.directions[0].x - it.directions[0].y).abs() < 1e-2, "{:?}", it.directions[0]);
        }
    }

    #[test]
    fn meridians_and_helices_obey_clairaut() {
        let net = cylinder(2.0);
        assert!(clairaut(&net, Vec3::zeros(), Vec3::z()).iter().all(|it| it.mean < 1e-12));
        let pitch = 0.3;
        let helices = GeodesicNet::from_fn(201, 3, |i, j| {
            let angle = i as f64 / 200.0 + 0.1 * j as f64;
            Vec3::new(2.0 * angle.cos(), 2.0 * angle.sin(), pitch * i as f64 / 200.0)
        });
        let expected = 2.0 * 2.0 / 2.0_f64.hypot(pitch);
        for it in clairaut(&helices, Vec3::zeros(), Vec3::z()) {
            assert!((it.mean - expected).abs() < 1e-4 && it.deviation < 1e-9, "{it:?}");
        }
    }
}
