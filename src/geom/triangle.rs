//! Triangles in the plane: whether and by how much two of them overlap.
use super::{Vec2, polygon::orientation, signed_area};

/// Whether the interiors of two triangles of any orientation intersect; exact. A triangle without area has no interior.
///
/// Two open convex sets are disjoint if and only if a line separates them, and for polygons one along an edge.
pub fn triangles_overlap(a: [Vec2; 3], b: [Vec2; 3]) -> bool {
    let (Some(a), Some(b)) = (counter_clockwise(a), counter_clockwise(b)) else { return false };
    let separated =
        |p: &[Vec2; 3], q: &[Vec2; 3]| (0..3).any(|k| q.iter().all(|&v| orientation(p[k], p[(k + 1) % 3], v) <= 0.0));
    !separated(&a, &b) && !separated(&b, &a)
}

/// Area of the intersection of two triangles of any orientation, mm².
pub fn triangle_intersection_area(a: [Vec2; 3], b: [Vec2; 3]) -> f64 {
    let (Some(a), Some(b)) = (counter_clockwise(a), counter_clockwise(b)) else { return 0.0 };
    let mut clipped = a.to_vec();
    for k in 0..3 {
        let (p, q) = (b[k], b[(k + 1) % 3]);
        let side: Vec<f64> = clipped.iter().map(|&v| super::cross2(q - p, v - p)).collect();
        let mut kept = Vec::with_capacity(clipped.len() + 1);
        for i in 0..clipped.len() {
            let j = (i + 1) % clipped.len();
            if side[i] >= 0.0 {
                kept.push(clipped[i]);
            }
            if (side[i] < 0.0) != (side[j] < 0.0) {
                kept.push(clipped[i] + (clipped[j] - clipped[i]) * (side[i] / (side[i] - side[j])));
            }
        }
        clipped = kept;
    }
    signed_area(&clipped).max(0.0)
}

fn counter_clockwise([a, b, c]: [Vec2; 3]) -> Option<[Vec2; 3]> {
    match orientation(a, b, c) {
        turn if turn > 0.0 => Some([a, b, c]),
        turn if turn < 0.0 => Some([a, c, b]),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn triangle(points: [[f64; 2]; 3]) -> [Vec2; 3] {
        points.map(|[x, y]| Vec2::new(x, y))
    }

    #[test]
    fn touching_is_not_overlapping() {
        let a = triangle([[0., 0.], [4., 0.], [0., 4.]]);
        let cases = [
            (triangle([[4., 0.], [4., 4.], [0., 4.]]), 0.0),
            (triangle([[4., 0.], [8., 0.], [8., 4.]]), 0.0),
            (triangle([[2., -1.], [3., 0.], [1., 0.]]), 0.0),
            (triangle([[0., 0.], [2., 0.], [4., 0.]]), 0.0),
            (triangle([[1., 1.], [2., 1.], [1., 2.]]), 0.5),
            (triangle([[0., 0.], [0., 4.], [4., 0.]]), 8.0),
            (triangle([[0., 0.], [4., 4.], [0., 4.]]), 4.0),
            (triangle([[0., 0.], [1e-9, 0.], [1e-9, 1e-9]]), 5e-19),
        ];
        for (b, area) in cases {
            assert_eq!(triangles_overlap(a, b), area > 0.0, "{b:?}");
            assert_eq!(triangles_overlap(b, a), area > 0.0, "{b:?}");
            assert!((triangle_intersection_area(a, b) - area).abs() <= 1e-12 * area, "{b:?}");
        }
    }

    #[test]
    fn neighbours_at_any_angle_only_touch() {
        // A fan around a point, its corners rounded as they come: neighbours share an edge exactly, so never overlap.
        let fan: Vec<Vec2> = (0..97).map(|i| Vec2::new(f64::from(i).cos(), f64::from(i).sin()) * 7.3).collect();
        let mut rim: Vec<Vec2> = fan;
        rim.sort_by(|p, q| p.y.atan2(p.x).total_cmp(&q.y.atan2(q.x)));
        let centre = Vec2::new(0.1, 0.2);
        let at = |i: usize| [centre, rim[i % 97], rim[(i + 1) % 97]];
        for i in 0..97 {
            for j in 0..97 {
                assert_eq!(triangles_overlap(at(i), at(j)), i == j);
            }
        }
    }
}
