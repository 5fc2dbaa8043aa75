//! What is wrong with flat pieces: triangles that overlap, outlines that come too close to themselves.
use crate::geom::{
    Box2, Vec2,
    polygon::segment_distance,
    segment_tree::{Segment, SegmentTree},
    triangle::{triangle_intersection_area, triangles_overlap},
};

/// Most grid cells per triangle: keeps the grid small however thinly the triangles are scattered.
const CELLS_PER_TRIANGLE: f64 = 4.0;

/// All pairs of triangles (of any orientation) whose interiors intersect, decided exactly, with the area of the
/// intersection, mm². Pairs (i, j) with i < j, ascending.
pub fn overlapping_triangles(triangles: &[[Vec2; 3]]) -> Vec<(usize, usize, f64)> {
    let boxes: Vec<Box2> = triangles.iter().map(Box2::of).collect();
    let mut out = Vec::new();
    touching_boxes(&boxes, &mut |i, j| {
        if triangles_overlap(triangles[i], triangles[j]) {
            out.push((i, j, triangle_intersection_area(triangles[i], triangles[j])));
        }
    });
    out.sort_unstable_by_key(|it| (it.0, it.1));
    out
}

/// Calls `visit(i, j)`, i < j, once for every pair of boxes that touch, by a uniform grid.
fn touching_boxes(boxes: &[Box2], visit: &mut dyn FnMut(usize, usize)) {
    if boxes.is_empty() {
        return;
    }
    let all = Box2::of(boxes.iter().flat_map(|it| [&it.min, &it.max]));
    let (size, count) = (all.size(), boxes.len() as f64);
    let mean = boxes.iter().map(|it| it.size().sum() / 2.0).sum::<f64>() / count;
    let least = (size.x * size.y / (CELLS_PER_TRIANGLE * count)).sqrt().max(size.max() / (CELLS_PER_TRIANGLE * count));
    let cell = mean.max(least).max(f64::MIN_POSITIVE);
    let columns = (size.x / cell) as usize + 1;
    let at = |p: Vec2| ((p - all.min) / cell).map(|it| it as usize);
    let mut entries: Vec<(usize, u32)> = Vec::with_capacity(4 * boxes.len());
    for (i, it) in boxes.iter().enumerate() {
        let (low, high) = (at(it.min), at(it.max));
        for y in low.y..=high.y {
            entries.extend((low.x..=high.x).map(|x| (y * columns + x, i as u32)));
        }
    }
    entries.sort_unstable();
    for items in entries.chunk_by(|a, b| a.0 == b.0) {
        for (k, &(here, i)) in items.iter().enumerate() {
            for &(_, j) in &items[k + 1..] {
                let (a, b) = (&boxes[i as usize], &boxes[j as usize]);
                // Boxes that share several cells count in the cell of the lower left corner of their intersection.
                let home = at(a.min.sup(&b.min));
                if a.touches(b) && home.y * columns + home.x == here {
                    visit(i as usize, j as usize);
                }
            }
        }
    }
}

/// Pairs (i, j), i < j, of edges of closed contours that do not follow one another and come closer than `clearance`, mm;
/// crossing and touching edges are at distance 0. Edges are numbered through all contours; each runs from the point of
/// its number to the next of its contour. Ascending.
pub fn close_edges(contours: &[Vec<Vec2>], clearance: f64) -> Vec<(usize, usize)> {
    let tree = SegmentTree::of_contours(contours);
    let mut starts = vec![0];
    for contour in contours {
        starts.push(starts[starts.len() - 1] + contour.len());
    }
    let number = |it: &Segment| starts[it.line] + it.index;
    let follows = |s: &Segment, t: &Segment| {
        let n = contours[s.line].len();
        s.line == t.line && ((s.index + 1) % n == t.index || (t.index + 1) % n == s.index)
    };
    let mut out = Vec::new();
    for s in tree.segments() {
        tree.visit(&Box2::of([&s.a, &s.b]).grown(clearance), &mut |t| {
            if number(t) > number(s) && !follows(s, t) && segment_distance(s.a, s.b, t.a, t.b) < clearance {
                out.push((number(s), number(t)));
            }
            true
        });
    }
    out.sort_unstable();
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grid_finds_what_brute_force_finds() {
        let mut state = 7_u64;
        let mut draw = || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 40) as f64 / (1 << 24) as f64
        };
        for (scale, spread) in [(10.0, 1.0), (10.0, 1e4), (1e3, 0.0)] {
            let triangles: Vec<[Vec2; 3]> = (0..200)
                .map(|_| {
                    let at = Vec2::new(draw() * scale, draw() * (scale + spread));
                    [at, at + Vec2::new(draw(), draw()), at + Vec2::new(draw() - 1.0, draw())]
                })
                .collect();
            let brute: Vec<(usize, usize)> = (0..200)
                .flat_map(|i| (i + 1..200).map(move |j| (i, j)))
                .filter(|&(i, j)| triangles_overlap(triangles[i], triangles[j]))
                .collect();
            let found: Vec<(usize, usize)> = overlapping_triangles(&triangles).iter().map(|it| (it.0, it.1)).collect();
            assert_eq!(found, brute);
            assert!(spread > 1.0 || scale > 100.0 || !found.is_empty());
        }
        assert!(overlapping_triangles(&[]).is_empty());
    }

    #[test]
    fn close_edges_of_a_slit() {
        let points = |w: f64| -> Vec<Vec2> {
            [[0., 0.], [9., 0.], [9., 9.], [5. + w, 9.], [5., 2.], [5. - w, 9.], [0., 9.]]
                .map(|[x, y]| Vec2::new(x, y))
                .to_vec()
        };
        assert!(close_edges(&[points(0.1)], 0.01).is_empty());
        assert_eq!(close_edges(&[points(0.004)], 0.01), [(2, 4), (2, 5), (3, 5)]);
        assert_eq!(close_edges(&[points(-0.1)], 0.01), [(2, 4), (2, 5), (3, 5)]);
        let beside = points(0.1).into_iter().map(|p| p + Vec2::new(9.005, 0.0)).collect();
        assert_eq!(
            close_edges(&[points(0.1), beside], 0.01),
            [(0, 7), (0, 13), (1, 7), (1, 12), (1, 13), (2, 12), (2, 13)]
        );
    }
}
