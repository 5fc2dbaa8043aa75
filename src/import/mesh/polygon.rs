//! Triangulates the polygons that a mesh file holds.
use std::collections::BTreeSet;

use crate::geom::{Vec2, Vec3, cross2};

/// Most corners of a polygon; ear clipping takes quadratic time.
pub(super) const LIMIT: usize = 4096;

/// Splits polygons into triangles of the same orientation, in order: quads by the shorter diagonal that stays inside,
/// larger ones by clipping the best-shaped ear of their projection along Newell's normal.
///
/// No diagonal is taken twice or along an edge of another polygon while there is a choice: two quads around a vertex of
/// valence 2 share both ends of a diagonal, and if both took it the mesh would lose its manifoldness.
/// Repeated neighbouring corners are dropped; what then has fewer than three becomes one triangle with a repeated corner,
/// for the repair to remove and report. Indices must be in range and no polygon larger than [`LIMIT`].
pub(super) fn triangulate<'a>(positions: &[Vec3], polygons: impl Iterator<Item = &'a [u32]> + Clone) -> Vec<[u32; 3]> {
    let mut faces = Vec::new();
    let mut taken = BTreeSet::new();
    if polygons.clone().any(|it| it.len() > 3) {
        taken.extend(
            polygons.clone().flat_map(|ring| (0..ring.len()).map(|k| edge(ring[k], ring[(k + 1) % ring.len()]))),
        );
    }
    for corners in polygons {
        if let [a, b, c] = *corners {
            faces.push([a, b, c]);
            continue;
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
            [a, b, c, d] => faces.extend(split_quad([a, b, c, d], |v| positions[v as usize], &mut taken)),
            _ => clip_ears(positions, &ring, &mut taken, &mut faces),
        }
    }
    faces
}

fn edge(a: u32, b: u32) -> [u32; 2] {
    [a.min(b), a.max(b)]
}

fn split_quad(corners: [u32; 4], at: impl Fn(u32) -> Vec3, taken: &mut BTreeSet<[u32; 2]>) -> [[u32; 3]; 2] {
    let [a, b, c, d] = corners;
    let normal = |t: [u32; 3]| (at(t[1]) - at(t[0])).cross(&(at(t[2]) - at(t[0])));
    let choices = [(edge(a, c), [[a, b, c], [a, c, d]]), (edge(b, d), [[a, b, d], [b, c, d]])];
    // A diagonal outside a concave quad folds one triangle over the other.
    let [first, second] = choices.map(|(diagonal, [s, t])| {
        let length = (at(diagonal[0]) - at(diagonal[1])).norm();
        (taken.contains(&diagonal), normal(s).dot(&normal(t)) <= 0.0, length)
    });
    let (diagonal, triangles) = choices[usize::from(second < first)];
    taken.insert(diagonal);
    triangles
}

fn clip_ears(positions: &[Vec3], ring: &[u32], taken: &mut BTreeSet<[u32; 2]>, faces: &mut Vec<[u32; 3]>) {
    let plane = project(positions, ring);
    let around = |left: &[usize], k: usize| {
        let n = left.len();
        [left[(k + n - 1) % n], left[k], left[(k + 1) % n]]
    };
    let worth = |left: &[usize], k: usize, taken: &BTreeSet<[u32; 2]>| {
        let ids = around(left, k);
        ear_worth(&plane, left, ids, taken.contains(&edge(ring[ids[0]], ring[ids[2]])))
    };
    let mut left: Vec<usize> = (0..ring.len()).collect();
    let mut worths: Vec<Worth> = (0..ring.len()).map(|k| worth(&left, k, taken)).collect();
    while left.len() > 3 {
        let n = left.len();
        let best = (0..n).fold(0, |best, k| if worths[k] > worths[best] { k } else { best });
        let ear = around(&left, best).map(|i| ring[i]);
        faces.push(ear);
        taken.insert(edge(ear[0], ear[2]));
        left.remove(best);
        worths.remove(best);
        for k in [(best + n - 2) % (n - 1), best % (n - 1)] {
            worths[k] = worth(&left, k, taken);
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

/// How good it is to clip a corner: its kind, then its shape in [−1, 1].
type Worth = (Corner, f64);

/// Kinds of corner from bad to good, so that a polygon without an ear (self-intersecting, far from planar) is still split.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd)]
enum Corner {
    NotFinite,
    Reflex,
    HoldsOthers,
    DiagonalTaken,
    Ear,
}

/// `ids` are a corner, preceded and followed by its neighbours.
fn ear_worth(plane: &[Vec2], left: &[usize], ids: [usize; 3], taken: bool) -> Worth {
    let [a, b, c] = ids.map(|i| plane[i]);
    let area = cross2(b - a, c - a);
    let longest = (b - a).norm_squared().max((c - b).norm_squared()).max((a - c).norm_squared());
    let shape = area / longest;
    if !shape.is_finite() {
        return (Corner::NotFinite, 0.0);
    }
    if shape <= 0.0 {
        return (Corner::Reflex, shape);
    }
    let inside = |p: Vec2| {
        let corner = p == a || p == b || p == c;
        !corner && cross2(b - a, p - a) >= 0.0 && cross2(c - b, p - b) >= 0.0 && cross2(a - c, p - c) >= 0.0
    };
    if left.iter().any(|i| !ids.contains(i) && inside(plane[*i])) {
        (Corner::HoldsOthers, shape)
    } else if taken {
        (Corner::DiagonalTaken, shape)
    } else {
        (Corner::Ear, shape)
    }
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
        let ring: Vec<u32> = (0..points.len() as u32).collect();
        triangulate(points, std::iter::once(&ring[..]))
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
        let few: [&[u32]; 5] = [&[], &[0], &[0, 1], &[0, 0, 1, 1], &[2, 2, 2, 2, 2]];
        assert_eq!(triangulate(&point, few.into_iter()), [[0, 0, 0], [0, 1, 1], [0, 1, 1], [2, 2, 2]]);
    }

    #[test]
    fn quads_around_a_vertex_of_valence_two_do_not_share_a_diagonal() {
        // A ridge over the line from 0 to 2, which is the shorter diagonal of both quads.
        let mut points = flat(&[[0.0, 0.0], [0.5, -3.0], [1.0, 0.0], [0.5, 3.0], [0.5, 0.0]]);
        (points[1].z, points[3].z, points[4].z) = (-1.0, -1.0, 1.0);
        let rings: [&[u32]; 2] = [&[0, 1, 2, 4], &[0, 4, 2, 3]];
        assert_eq!(triangulate(&points, rings[..1].iter().copied()), [[0, 1, 2], [0, 2, 4]]);
        assert_eq!(triangulate(&points, rings[1..].iter().copied()), [[0, 4, 2], [0, 2, 3]]);
        assert_eq!(triangulate(&points, rings.into_iter()), [[0, 1, 2], [0, 2, 4], [0, 4, 3], [4, 2, 3]]);
    }
}
