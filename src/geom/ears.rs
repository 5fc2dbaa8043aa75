//! Triangulation of a simple polygon by ears.
use super::{Vec2, cross2};

/// Triangles of a simple polygon (counter-clockwise, first point not repeated) as indices: n − 2 of them that use every
/// point, by cutting off the ear with the largest smallest angle again and again (Meisters 1975). Points on a side give
/// triangles without area only where nothing else is left; a polygon that is not simple gives some triangulation. O(n²).
/// Slits without width are allowed.
pub fn ears(points: &[Vec2]) -> Vec<[usize; 3]> {
    let mut ring: Vec<usize> = (0..points.len()).collect();
    let mut out = Vec::with_capacity(points.len().saturating_sub(2));
    let mut shape: Vec<f64> = (0..ring.len()).map(|k| quality(points, &ring, k)).collect();
    while ring.len() > 3 {
        let best = (0..ring.len()).max_by(|&a, &b| shape[a].total_cmp(&shape[b])).unwrap_or(0);
        let n = ring.len();
        out.push([ring[(best + n - 1) % n], ring[best], ring[(best + 1) % n]]);
        ring.remove(best);
        shape.remove(best);
        let n = ring.len();
        for k in [(best + n - 1) % n, best % n] {
            shape[k] = quality(points, &ring, k);
        }
    }
    if let [a, b, c] = ring[..] {
        out.push([a, b, c]);
    }
    out
}

/// Sine of the smallest angle of the ear at place `k` of the ring, less what tells ears from others: reflex corners and
/// ears that hold another point come last.
fn quality(points: &[Vec2], ring: &[usize], k: usize) -> f64 {
    let n = ring.len();
    let (i, j, l) = (ring[(k + n - 1) % n], ring[k], ring[(k + 1) % n]);
    let [a, b, c] = [i, j, l].map(|it| points[it]);
    let double_area = cross2(b - a, c - a);
    let sides = [(b - a).norm(), (c - b).norm(), (a - c).norm()];
    let longest = sides.iter().copied().fold(0.0, f64::max);
    let others: f64 = sides.iter().product::<f64>() / longest.max(f64::MIN_POSITIVE);
    // The smallest angle lies between the two longest sides; its sine is at most twice the area over their product.
    let shape = double_area / (longest * longest).max(others).max(f64::MIN_POSITIVE);
    if double_area <= 0.0 {
        return shape - 4.0;
    }
    let inside = |p: Vec2| cross2(b - a, p - a) >= 0.0 && cross2(c - b, p - b) >= 0.0 && cross2(a - c, p - c) >= 0.0;
    // A corner may be there twice: a slit to a hole has two sides in the same place.
    let holds = ring.iter().map(|&v| points[v]).any(|p| p != a && p != b && p != c && inside(p));
    if holds { shape - 2.0 } else { shape }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::signed_area;

    #[test]
    fn ears_fill_a_polygon() {
        let comb: Vec<Vec2> = (0..12)
            .flat_map(|k| {
                let x = f64::from(k);
                [
                    Vec2::new(-x, if k % 2 == 0 { 1.0 } else { 6.0 }),
                    Vec2::new(-x - 0.5, if k % 2 == 0 { 1.0 } else { 6.0 }),
                ]
            })
            .chain([Vec2::new(-11.5, 0.0), Vec2::new(-6.0, 0.0), Vec2::new(0.0, 0.0)])
            .collect();
        let square: Vec<Vec2> = [(0., 0.), (1., 0.), (2., 0.), (2., 1.), (2., 2.), (1., 2.), (0., 2.), (0., 1.)]
            .map(|(x, y)| Vec2::new(x, y))
            .to_vec();
        let ring = [(0., 0.), (6., 0.), (6., 6.), (0., 6.), (0., 0.), (2., 2.), (2., 4.), (4., 4.), (4., 2.), (2., 2.)]
            .map(|(x, y)| Vec2::new(x, y))
            .to_vec();
        for polygon in [comb, square, ring] {
            let triangles = ears(&polygon);
            assert_eq!(triangles.len(), polygon.len() - 2);
            let areas: Vec<f64> = triangles.iter().map(|t| signed_area(&t.map(|i| polygon[i]))).collect();
            assert!(areas.iter().all(|&it| it > 0.0), "{areas:?}");
            assert!((areas.iter().sum::<f64>() - signed_area(&polygon)).abs() < 1e-12);
        }
    }
}
