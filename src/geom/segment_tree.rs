//! A static tree of boxes over line segments: near segments, crossings and distances without looking at every pair.
use super::{
    Box2, Vec2,
    polygon::{edges, nearest_on_segment, segment_distance},
};

/// Segments per leaf; more makes the tree shallower and its leaves slower, and 2 to 8 are alike in practice.
const LEAF: usize = 4;

/// A segment and where it came from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Segment {
    /// One end.
    pub a: Vec2,
    /// The other end.
    pub b: Vec2,
    /// Index of its line.
    pub line: usize,
    /// Index in its line.
    pub index: usize,
}

#[derive(Debug, Clone)]
struct Node {
    bounds: Box2,
    start: usize,
    end: usize,
    /// Index of the second child; the first follows its parent. 0 in a leaf.
    second: usize,
}

/// Segments in a binary tree of axis-aligned boxes, split at the median.
#[derive(Debug, Clone)]
pub struct SegmentTree {
    segments: Vec<Segment>,
    nodes: Vec<Node>,
}

impl SegmentTree {
    /// All edges of closed contours.
    pub fn of_contours(contours: &[Vec<Vec2>]) -> Self {
        let segments = contours.iter().enumerate().flat_map(|(line, contour)| {
            edges(contour).enumerate().map(move |(index, (a, b))| Segment { a, b, line, index })
        });
        Self::of_segments(segments.collect())
    }

    /// All segments of open polylines.
    pub fn of_polylines(lines: &[Vec<Vec2>]) -> Self {
        let segments = lines.iter().enumerate().flat_map(|(line, points)| {
            points.windows(2).enumerate().map(move |(index, w)| Segment { a: w[0], b: w[1], line, index })
        });
        Self::of_segments(segments.collect())
    }

    /// Any segments.
    pub fn of_segments(mut segments: Vec<Segment>) -> Self {
        let mut nodes = Vec::new();
        if !segments.is_empty() {
            let end = segments.len();
            build(&mut segments, 0, end, &mut nodes);
        }
        Self { segments, nodes }
    }

    /// The segments, in the order of the tree.
    pub fn segments(&self) -> &[Segment] {
        &self.segments
    }

    /// Box around all segments.
    pub fn bounds(&self) -> Box2 {
        self.nodes.first().map_or_else(Box2::empty, |it| it.bounds)
    }

    /// Calls `visit` with every segment whose box touches `bounds` until it returns `false`; says whether it never did.
    pub fn visit<'a>(&'a self, bounds: &Box2, visit: &mut dyn FnMut(&'a Segment) -> bool) -> bool {
        // Halves at every level: the tree is no deeper than a count of segments has bits. Off the heap, because small windows
        // are asked for very often.
        let mut stack = [0; usize::BITS as usize + 1];
        let mut waiting = usize::from(!self.nodes.is_empty());
        while waiting > 0 {
            waiting -= 1;
            let at = stack[waiting];
            let node = &self.nodes[at];
            if !node.bounds.touches(bounds) {
                continue;
            }
            if node.second != 0 {
                (stack[waiting], stack[waiting + 1]) = (node.second, at + 1);
                waiting += 2;
                continue;
            }
            for segment in &self.segments[node.start..node.end] {
                if Box2::of([&segment.a, &segment.b]).touches(bounds) && !visit(segment) {
                    return false;
                }
            }
        }
        true
    }

    /// The segment nearest to `p` and the nearest point on it; `None` when there are no segments.
    pub fn nearest(&self, p: Vec2) -> Option<(Segment, Vec2)> {
        let point = Box2 { min: p, max: p };
        let mut best: Option<(f64, Segment, Vec2)> = None;
        let mut stack = if self.nodes.is_empty() { vec![] } else { vec![0] };
        while let Some(at) = stack.pop() {
            let node = &self.nodes[at];
            let limit = best.map_or(f64::INFINITY, |it| it.0);
            if node.bounds.distance(&point) >= limit {
                continue;
            }
            if node.second != 0 {
                let near_first =
                    self.nodes[node.second].bounds.distance(&point) >= self.nodes[at + 1].bounds.distance(&point);
                stack.extend(if near_first { [node.second, at + 1] } else { [at + 1, node.second] });
                continue;
            }
            for &segment in &self.segments[node.start..node.end] {
                let foot = nearest_on_segment(p, segment.a, segment.b);
                let distance = (foot - p).norm();
                if best.is_none_or(|it| distance < it.0) {
                    best = Some((distance, segment, foot));
                }
            }
        }
        best.map(|(_, segment, foot)| (segment, foot))
    }

    /// The closest pair of segments of two trees when they are less than `limit` apart.
    pub fn closest(&self, other: &Self, limit: f64) -> Option<(f64, Segment, Segment)> {
        if self.nodes.is_empty() || other.nodes.is_empty() {
            return None;
        }
        let mut best: Option<(f64, Segment, Segment)> = None;
        let mut stack = vec![(0, 0)];
        while let Some((i, j)) = stack.pop() {
            let (a, b) = (&self.nodes[i], &other.nodes[j]);
            let limit = best.map_or(limit, |it| it.0);
            if a.bounds.distance(&b.bounds) >= limit || limit == 0.0 {
                continue;
            }
            match (a.second, b.second) {
                (0, 0) => {
                    for &s in &self.segments[a.start..a.end] {
                        for &t in &other.segments[b.start..b.end] {
                            let distance = segment_distance(s.a, s.b, t.a, t.b);
                            if distance < best.map_or(limit, |it| it.0) {
                                best = Some((distance, s, t));
                            }
                        }
                    }
                }
                (0, second) => stack.extend([(i, second), (i, j + 1)]),
                (second, 0) => stack.extend([(second, j), (i + 1, j)]),
                (second, _) if a.end - a.start >= b.end - b.start => stack.extend([(second, j), (i + 1, j)]),
                (_, second) => stack.extend([(i, second), (i, j + 1)]),
            }
        }
        best
    }
}

fn build(segments: &mut [Segment], start: usize, end: usize, nodes: &mut Vec<Node>) {
    let own = &mut segments[start..end];
    let bounds = Box2::of(own.iter().flat_map(|it| [&it.a, &it.b]));
    let at = nodes.len();
    nodes.push(Node { bounds, start, end, second: 0 });
    if end - start <= LEAF {
        return;
    }
    let axis = usize::from(bounds.size().y > bounds.size().x);
    let half = own.len() / 2;
    own.select_nth_unstable_by(half, |s, t| {
        let key = |it: &Segment| (it.line, it.index);
        (s.a[axis] + s.b[axis]).total_cmp(&(t.a[axis] + t.b[axis])).then_with(|| key(s).cmp(&key(t)))
    });
    build(segments, start, start + half, nodes);
    nodes[at].second = nodes.len();
    build(segments, start + half, end, nodes);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scatter(count: usize, mut state: u64) -> Vec<Vec<Vec2>> {
        let mut draw = || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 40) as f64 / (1 << 24) as f64
        };
        (0..count)
            .map(|_| {
                let a = Vec2::new(draw(), draw()) * 100.0;
                vec![a, a + Vec2::new(draw() - 0.5, draw() - 0.5) * 6.0]
            })
            .collect()
    }

    #[test]
    fn queries_agree_with_brute_force() {
        let (left, right) = (scatter(300, 1), scatter(200, 2));
        let (a, b) = (SegmentTree::of_polylines(&left), SegmentTree::of_polylines(&right));
        let brute = left
            .iter()
            .flat_map(|s| right.iter().map(move |t| segment_distance(s[0], s[1], t[0], t[1])))
            .fold(f64::INFINITY, f64::min);
        assert_eq!(a.closest(&b, f64::INFINITY).unwrap().0, brute);
        assert!(a.closest(&b, brute).is_none());
        for query in scatter(50, 3) {
            let p = query[0];
            let brute =
                left.iter().map(|s| (nearest_on_segment(p, s[0], s[1]) - p).norm()).fold(f64::INFINITY, f64::min);
            assert_eq!((a.nearest(p).unwrap().1 - p).norm(), brute);
            let window = Box2::of(&[p, query[1] + Vec2::repeat(5.0)]);
            let mut found = 0;
            assert!(a.visit(&window, &mut |_| {
                found += 1;
                true
            }));
            assert_eq!(found, left.iter().filter(|it| Box2::of(it.iter()).touches(&window)).count());
        }
    }
}
