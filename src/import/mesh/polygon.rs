//! Triangulates the polygons that a mesh file holds.
use std::f64::consts::FRAC_PI_2;

use crate::geom::{Vec2, Vec3, cross2};

/// Most corners of a polygon; ear clipping takes quadratic time.
const LIMIT: usize = 4096;

/// Splits a polygon into triangles of the same orientation and appends them to `faces`: quads by the shorter diagonal that
/// stays inside, larger ones by clipping the best-shaped ear of their projection along Newell's normal.
///
/// Repeated neighbouring corners are dropped; what then has fewer than three becomes one triangle with a repeated corner,
/// for the repair to remove and report. Indices must be in range.
pub(super) fn triangulate(positions: &[Vec3], corners: &[u32], faces: &mut Vec<[u32; 3]>) -> Result<(), String> {
    if let [a, b, c] = *corners {
        faces.push([a, b, c]);
        return Ok(());
    }
    let mut ring = corners.to_vec();
    ring.dedup();
    while ring.len() > 1 && ring.first() == ring.last() {
        ring.pop();
    }
    match *ring {
        [] => {}
        [a] => faces.push([a; 3]),
        [a, b] => faces.push([a, b, b]),
        [a, b, c] => faces.push([a, b, c]),
        [a, b, c, d] => faces.extend(split_quad([a, b, c, d], |v| positions[v as usize])),
        _ if ring.len() > LIMIT => return Err(format!("a face has {} corners, more than {LIMIT}", ring.len())),
        _ => clip_ears(positions, &ring, faces),
    }
    Ok(())
}

fn split_quad(corners: [u32; 4], at: impl Fn(u32) -> Vec3) -> [[u32; 3]; 2] {
    let [a, b, c, d] = corners;
    let normal = |t: [u32; 3]| (at(t[1]) - at(t[0])).cross(&(at(t[2]) - at(t[0])));
    let choices = [[[a, b, c], [a, c, d]], [[a, b, d], [b, c, d]]];
    // A diagonal outside a concave quad folds one triangle over the other.
    let inside = choices.map(|[s, t]| normal(s).dot(&normal(t)) > 0.0);
    let first = if inside[0] == inside[1] { (at(c) - at(a)).norm() <= (at(d) - at(b)).norm() } else { inside[0] };
    choices[usize::from(!first)]
}

fn clip_ears(positions: &[Vec3], ring: &[u32], faces: &mut Vec<[u32; 3]>) {
    let plane = project(positions, ring);
    let mut left: Vec<usize> = (0..ring.len()).collect();
    let mut worth: Vec<f64> = (0..ring.len()).map(|k| ear_worth(&plane, &left, k)).collect();
    while left.len() > 3 {
        let n = left.len();
        let best = (0..n).fold(0, |best, k| if worth[k] > worth[best] { k } else { best });
        faces.push([left[(best + n - 1) % n], left[best], left[(best + 1) % n]].map(|i| ring[i]));
        left.remove(best);
        worth.remove(best);
        for k in [(best + n - 2) % (n - 1), best % (n - 1)] {
            worth[k] = ear_worth(&plane, &left, k);
        }
    }
    faces.push([left[0], left[1], left[2]].map(|i| ring[i]));
}

/// The corners in a plane along Newell's normal, in which a simple polygon runs counter-clockwise.
fn project(positions: &[Vec3], ring: &[u32]) -> Vec<Vec2> {
    let at = |k: usize| positions[ring[k % ring.len()] as usize];
    let normal: Vec3 = (0..ring.len()).map(|k| (at(k) - at(0)).cross(&(at(k + 1) - at(0)))).sum();
    let least = normal.iamin();
    let u = normal.cross(&Vec3::ith(least, 1.0)).try_normalize(0.0).unwrap_or_else(Vec3::x);
    let v = normal.cross(&u).try_normalize(0.0).unwrap_or_else(Vec3::y);
    (0..ring.len()).map(|k| Vec2::new(u.dot(&(at(k) - at(0))), v.dot(&(at(k) - at(0))))).collect()
}

/// How good it is to clip corner `k`: true ears by their shape in [0, 1], then corners that hold others, then reflex ones,
/// so that a polygon without an ear (self-intersecting, far from planar) is still split somehow.
fn ear_worth(plane: &[Vec2], left: &[usize], k: usize) -> f64 {
    let n = left.len();
    let ids = [left[(k + n - 1) % n], left[k], left[(k + 1) % n]];
    let [a, b, c] = ids.map(|i| plane[i]);
    let area = cross2(b - a, c - a);
    let longest = (b - a).norm_squared().max((c - b).norm_squared()).max((a - c).norm_squared());
    let shape = area / longest;
    if !shape.is_finite() {
        return -4.0;
    }
    if shape <= 0.0 {
        return -FRAC_PI_2 + shape;
    }
    let holds = |p: Vec2| {
        p != a
            && p != b
            && p != c
            && cross2(b - a, p - a) >= 0.0
            && cross2(c - b, p - b) >= 0.0
            && cross2(a - c, p - c) >= 0.0
    };
    let empty = !left.iter().any(|i| !ids.contains(i) && holds(plane[*i]));
    if empty { shape } else { shape - 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(points: &[Vec3], faces: &[[u32; 3]]) -> (f64, f64) {
        let signed = faces.iter().map(|t| {
            let [a, b, c] = t.map(|i| points[i as usize]);
            0.5 * (b - a).cross(&(c - a)).z
        });
        (signed.clone().sum(), signed.map(f64::abs).sum())
    }

    fn flat(points: &[[f64; 2]]) -> Vec<Vec3> {
        points.iter().map(|p| Vec3::new(p[0], p[1], 0.0)).collect()
    }

    fn split(points: &[Vec3]) -> Vec<[u32; 3]> {
        let mut faces = Vec::new();
        triangulate(points, &(0..points.len() as u32).collect::<Vec<_>>(), &mut faces).unwrap();
        faces
    }

    #[test]
    fn concave_polygons_are_covered_once() {
        let arrow = flat(&[[0.0, 0.0], [4.0, -3.0], [1.0, 0.0], [4.0, 3.0]]);
        let comb = flat(&[
            [0.0, 0.0],
            [7.0, 0.0],
            [7.0, 5.0],
            [6.0, 5.0],
            [6.0, 1.0],
            [4.0, 1.0],
            [4.0, 5.0],
            [3.0, 5.0],
            [3.0, 1.0],
            [1.0, 1.0],
            [1.0, 5.0],
            [0.0, 5.0],
        ]);
        let star: Vec<[f64; 2]> = (0..40)
            .map(|k| (f64::from(k) * std::f64::consts::TAU / 40.0, if k % 2 == 0 { 10.0 } else { 3.0 }))
            .map(|(angle, r)| [r * angle.cos(), r * angle.sin()])
            .collect();
        for shape in [arrow, comb, flat(&star)] {
            let outline: Vec<Vec2> = shape.iter().map(|p| p.xy()).collect();
            let exact = crate::geom::signed_area(&outline);
            let faces = split(&shape);
            let (signed, absolute) = area(&shape, &faces);
            assert_eq!(faces.len(), shape.len() - 2);
            assert!((signed - exact).abs() < 1e-9 && (absolute - exact).abs() < 1e-9, "{signed} {absolute} {exact}");
        }
    }

    #[test]
    fn a_convex_quad_takes_its_shorter_diagonal() {
        let kite = flat(&[[0.0, 0.0], [2.0, -1.0], [6.0, 0.0], [2.0, 1.0]]);
        assert_eq!(split(&kite), [[0, 1, 3], [1, 2, 3]]);
    }

    #[test]
    fn senseless_polygons_end_and_are_counted() {
        let nan = vec![Vec3::repeat(f64::NAN); 9];
        assert_eq!(split(&nan).len(), 7);
        let point = vec![Vec3::zeros(); 9];
        assert_eq!(split(&point).len(), 7);
        let mut faces = Vec::new();
        for corners in [&[0][..], &[0, 1], &[0, 0, 1, 1], &[2, 2, 2, 2, 2]] {
            triangulate(&point, corners, &mut faces).unwrap();
        }
        assert_eq!(faces, [[0, 0, 0], [0, 1, 1], [0, 1, 1], [2, 2, 2]]);
        assert!(triangulate(&point, &(0..5000).map(|k| k % 9).collect::<Vec<_>>(), &mut faces).is_err());
    }
}
