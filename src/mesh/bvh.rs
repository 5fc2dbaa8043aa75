//! Closest points on a triangle mesh by a bounding volume hierarchy.
//!
//! Four children per node with their boxes side by side, so one visit measures four boxes at once; the corners of the
//! triangles lie in the order of the leaves. A query allocates nothing.
use rayon::prelude::*;

use super::{FaceId, Id, TriMesh};
use crate::{
    geom::{Box3, Vec3, closest_on_triangle},
    numeric::lanes::vectorized,
};

/// Children of a node.
const WIDTH: usize = 4;
/// Most triangles in a leaf; measured on 70 k faces, 1 to 4 differ by a few percent.
const LEAF: usize = 2;
/// 4-way median splits of 2^30 faces are 15 levels deep, and each leaves at most three children waiting.
const STACK: usize = 64;
/// Points per task of a batch query.
const BATCH: usize = 512;

/// The closest point of a mesh to a query point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Closest {
    /// The face that holds it. Where several faces are equally close up to rounding, one of them, the same on every run
    /// (but maybe another for another hint).
    pub face: FaceId,
    /// Its barycentric coordinates in the face: not negative, sum 1.
    pub barycentric: [f64; 3],
    /// The point, mm.
    pub point: Vec3,
    /// Its distance from the query point, mm.
    pub distance: f64,
}

/// A child of a node: an inner node, or a run of leaf triangles, or nothing.
#[derive(Debug, Clone, Copy)]
struct Child {
    /// Index of the inner node, or of the first triangle.
    start: u32,
    /// Number of triangles; 0 for an inner node. An empty slot has an empty box, so it is never entered.
    count: u32,
}

/// Boxes of up to four children, coordinate by coordinate.
#[derive(Debug, Clone)]
struct Node {
    min: [[f64; WIDTH]; 3],
    max: [[f64; WIDTH]; 3],
    child: [Child; WIDTH],
}

impl Node {
    fn empty() -> Self {
        Self {
            min: [[f64::INFINITY; WIDTH]; 3],
            max: [[f64::NEG_INFINITY; WIDTH]; 3],
            child: [Child { start: 0, count: 0 }; WIDTH],
        }
    }

    /// Squared distance from `p`, which is no NaN, to every child box; infinite for an empty slot.
    #[inline(always)]
    fn distances(&self, p: &Vec3) -> [f64; WIDTH] {
        let mut sum = [0.0; WIDTH];
        for axis in 0..3 {
            for ((sum, min), max) in sum.iter_mut().zip(&self.min[axis]).zip(&self.max[axis]) {
                // `f64::max` would look for NaN at each step.
                let (below, above) = (min - p[axis], p[axis] - max);
                let outside = if below > above { below } else { above };
                let outside = if outside > 0.0 { outside } else { 0.0 };
                *sum += outside * outside;
            }
        }
        sum
    }

    /// Whether each child box shares a point with another box; an empty slot does not.
    fn touches(&self, bounds: &Box3) -> [bool; WIDTH] {
        let mut touches = [true; WIDTH];
        for axis in 0..3 {
            for ((touches, min), max) in touches.iter_mut().zip(&self.min[axis]).zip(&self.max[axis]) {
                *touches &= *min <= bounds.max[axis] && bounds.min[axis] <= *max;
            }
        }
        touches
    }

    fn is_used(&self, slot: usize) -> bool {
        self.min[0][slot] <= self.max[0][slot]
    }

    /// The box around all children, as (min, max).
    fn hull(&self) -> (Vec3, Vec3) {
        let reduce = |it: &[f64; WIDTH], f: fn(f64, f64) -> f64| it.iter().copied().fold(it[0], f);
        (
            Vec3::from_fn(|axis, _| reduce(&self.min[axis], f64::min)),
            Vec3::from_fn(|axis, _| reduce(&self.max[axis], f64::max)),
        )
    }

    fn set(&mut self, slot: usize, (min, max): (Vec3, Vec3)) {
        for axis in 0..3 {
            self.min[axis][slot] = min[axis];
            self.max[axis][slot] = max[axis];
        }
    }
}

/// The best point so far in a search: its squared distance, and where it lies.
struct Best {
    squared: f64,
    slot: Option<usize>,
    barycentric: [f64; 3],
}

impl Best {
    /// Nothing yet, and nothing farther than `max` will do.
    fn within(max: f64) -> Self {
        // The comparison is false for NaN too, which then finds nothing.
        let squared = if max >= 0.0 { (max * max).min(f64::MAX) } else { -1.0 };
        Self { squared, slot: None, barycentric: [1.0, 0.0, 0.0] }
    }
}

/// Bounding volume hierarchy over the faces of a mesh. Holds copies of the corners, so the mesh may move on;
/// [`Bvh::refit`] follows it.
#[derive(Debug, Clone)]
pub struct Bvh {
    /// Parents before their children; the root is the first.
    nodes: Vec<Node>,
    /// Corners of the triangles in leaf order.
    corners: Vec<[Vec3; 3]>,
    /// The face at each place of `corners`.
    faces: Vec<FaceId>,
    /// The place of each face in `corners`.
    slots: Vec<u32>,
}

impl Bvh {
    /// Builds the hierarchy by median splits along the longest axis of the centroids. O(F log F).
    pub fn new(mesh: &TriMesh) -> Self {
        Self::of_triangles(mesh.faces().map(|f| mesh.face_positions(f)).collect())
    }

    /// The same over loose triangles, degenerate ones included: a segment is the triangle that repeats an end. They are
    /// known as faces in the order given.
    ///
    /// # Panics
    /// If there are none.
    pub fn of_triangles(triangles: Vec<[Vec3; 3]>) -> Self {
        assert!(!triangles.is_empty(), "the closest point on nothing");
        let centers: Vec<Vec3> = triangles.iter().map(|corners| corners.iter().sum::<Vec3>() / 3.0).collect();
        let mut faces: Vec<u32> = (0..triangles.len() as u32).collect();
        let mut nodes = vec![Node::empty()];
        let mut open = vec![(0, 0, faces.len())];
        while let Some((node, start, end)) = open.pop() {
            for (slot, (start, end)) in quarters(&mut faces, &centers, start, end).into_iter().enumerate() {
                let count = end - start;
                if count == 0 {
                    continue;
                }
                let leaf = count <= LEAF;
                let child = if leaf { (start as u32, count as u32) } else { (nodes.len() as u32, 0) };
                nodes[node].child[slot] = Child { start: child.0, count: child.1 };
                // Marks the slot as used until `refit_boxes` sets the real box.
                nodes[node].set(slot, (Vec3::zeros(), Vec3::zeros()));
                if !leaf {
                    open.push((nodes.len(), start, end));
                    nodes.push(Node::empty());
                }
            }
        }
        let mut slots = vec![0; faces.len()];
        for (slot, &face) in faces.iter().enumerate() {
            slots[face as usize] = slot as u32;
        }
        let corners = faces.iter().map(|&f| triangles[f as usize]).collect();
        let mut bvh = Self { nodes, corners, faces: faces.into_iter().map(FaceId).collect(), slots };
        bvh.refit_boxes();
        bvh
    }

    /// Follows moved positions of the mesh that it was built from (or one of the same connectivity). O(F), no allocation.
    /// Answers stay exact; queries become slower as the mesh moves far from where the tree was built.
    ///
    /// # Panics
    /// If the number of faces differs.
    pub fn refit(&mut self, mesh: &TriMesh) {
        assert_eq!(mesh.face_count(), self.faces.len(), "refit needs the connectivity that the tree was built from");
        for (corners, &face) in self.corners.iter_mut().zip(&self.faces) {
            *corners = mesh.face_positions(face);
        }
        self.refit_boxes();
    }

    /// Boxes from the leaves up.
    fn refit_boxes(&mut self) {
        for index in (0..self.nodes.len()).rev() {
            for slot in 0..WIDTH {
                if !self.nodes[index].is_used(slot) {
                    continue;
                }
                let Child { start, count } = self.nodes[index].child[slot];
                let hull = if count == 0 {
                    self.nodes[start as usize].hull()
                } else {
                    let run = &self.corners[start as usize..(start + count) as usize];
                    let first = run[0][0];
                    run.iter().flatten().fold((first, first), |(min, max), p| (min.inf(p), max.sup(p)))
                };
                self.nodes[index].set(slot, hull);
            }
        }
    }

    /// The closest point to `p`. If `p` is not finite, or its squared distance overflows, the answer is on face 0.
    pub fn closest(&self, p: Vec3) -> Closest {
        let mut best = Best { squared: f64::MAX, slot: None, barycentric: [1.0, 0.0, 0.0] };
        self.search(&p, &mut best, false);
        self.answer(p, best.slot.unwrap_or(self.slots[0] as usize), best.barycentric)
    }

    /// The closest point to `p`, beginning with a guess: much faster when `hint` is near the answer, exact in any case.
    /// Made for points that move a little between queries.
    pub fn closest_from(&self, p: Vec3, hint: FaceId) -> Closest {
        let slot = self.slots[hint.index()] as usize;
        let mut best = Best { squared: f64::MAX, slot: Some(slot), barycentric: [1.0, 0.0, 0.0] };
        self.try_triangle(&p, slot, &mut best);
        self.search(&p, &mut best, false);
        self.answer(p, best.slot.unwrap_or(slot), best.barycentric)
    }

    /// The closest point to `p` if its distance is at most `max`. Faster than [`Bvh::closest`] for a tight bound.
    pub fn closest_within(&self, p: Vec3, max: f64) -> Option<Closest> {
        let mut best = Best::within(max);
        self.search(&p, &mut best, false);
        best.slot.map(|slot| self.answer(p, slot, best.barycentric))
    }

    /// Whether some point of the mesh is at most `max` from `p`. Stops at the first such triangle, so it is much faster than
    /// finding the closest point when there are many.
    pub fn is_within(&self, p: Vec3, max: f64) -> bool {
        let mut best = Best::within(max);
        self.search(&p, &mut best, true);
        best.slot.is_some()
    }

    /// [`Bvh::closest`] for many points, in parallel; the answers are in the order of the points.
    pub fn closest_all(&self, points: &[Vec3]) -> Vec<Closest> {
        points.par_iter().with_min_len(BATCH).map(|&p| self.closest(p)).collect()
    }

    /// Hands every face whose bounding box shares a point with `bounds` to `visit`, in an order that depends on the tree only.
    pub fn for_each_in_box(&self, bounds: &Box3, mut visit: impl FnMut(FaceId)) {
        let mut stack = [0; STACK];
        let mut top = 1;
        while top > 0 {
            top -= 1;
            let node = &self.nodes[stack[top] as usize];
            for (child, touches) in node.child.iter().zip(node.touches(bounds)) {
                if !touches {
                    continue;
                }
                if child.count == 0 {
                    stack[top] = child.start;
                    top += 1;
                }
                for slot in child.start..child.start + child.count {
                    if Box3::of(&self.corners[slot as usize]).touches(bounds) {
                        visit(self.faces[slot as usize]);
                    }
                }
            }
        }
    }

    /// Corners of a face, as of the last refit.
    pub fn face_positions(&self, face: FaceId) -> [Vec3; 3] {
        self.corners[self.slots[face.index()] as usize]
    }

    fn answer(&self, p: Vec3, slot: usize, barycentric: [f64; 3]) -> Closest {
        let [a, b, c] = self.corners[slot];
        let point = a * barycentric[0] + b * barycentric[1] + c * barycentric[2];
        Closest { face: self.faces[slot], barycentric, point, distance: (p - point).norm() }
    }

    #[inline(always)]
    fn try_triangle(&self, p: &Vec3, slot: usize, best: &mut Best) {
        let (barycentric, squared) = closest_on_triangle(p, &self.corners[slot]);
        let wins = match best.slot {
            Some(other) => squared < best.squared || (squared == best.squared && self.faces[slot] < self.faces[other]),
            None => squared <= best.squared,
        };
        if wins {
            *best = Best { squared, slot: Some(slot), barycentric };
        }
    }

    /// Depth first, nearest child first; `any` is content with the first triangle that is near enough.
    fn search(&self, p: &Vec3, best: &mut Best, any: bool) {
        vectorized(
            #[inline(always)]
            || self.descend(p, best, any),
        );
    }

    #[inline(always)]
    fn descend(&self, p: &Vec3, best: &mut Best, any: bool) {
        // NaN would pass for near everything, the boxes of unused children too.
        if p.iter().any(|it| it.is_nan()) {
            return;
        }
        let mut stack = [(0.0, Child { start: 0, count: 0 }); STACK];
        let mut top = 1;
        while top > 0 {
            top -= 1;
            let (lower, Child { start, count }) = stack[top];
            if lower > best.squared {
                continue;
            }
            if count > 0 {
                for slot in start..start + count {
                    self.try_triangle(p, slot as usize, best);
                }
                if any && best.slot.is_some() {
                    return;
                }
                continue;
            }
            let node = &self.nodes[start as usize];
            let distances = node.distances(p);
            let base = top;
            for (slot, &distance) in distances.iter().enumerate() {
                if distance > best.squared {
                    continue;
                }
                // Insertion keeps the nearest on top.
                let mut at = top;
                while at > base && stack[at - 1].0 < distance {
                    stack[at] = stack[at - 1];
                    at -= 1;
                }
                stack[at] = (distance, node.child[slot]);
                top += 1;
            }
        }
    }
}

/// Splits a run of faces in two at the median along the longest axis, and both halves again; short runs stay whole.
fn quarters(faces: &mut [u32], centers: &[Vec3], start: usize, end: usize) -> [(usize, usize); WIDTH] {
    let middle = halve(faces, centers, start, end);
    let (left, right) = (halve(faces, centers, start, middle), halve(faces, centers, middle, end));
    [(start, left), (left, middle), (middle, right), (right, end)]
}

/// Partitions the run around its median; returns where the second half begins (`end` for a run that fits in a leaf).
fn halve(faces: &mut [u32], centers: &[Vec3], start: usize, end: usize) -> usize {
    let run = &mut faces[start..end];
    if run.len() <= LEAF {
        return end;
    }
    let first = centers[run[0] as usize];
    let (min, max) = run.iter().fold((first, first), |(min, max), &f| {
        let c = &centers[f as usize];
        (min.inf(c), max.sup(c))
    });
    let axis = (max - min).imax();
    let middle = run.len() / 2;
    run.select_nth_unstable_by(middle, |&f, &g| {
        centers[f as usize][axis].total_cmp(&centers[g as usize][axis]).then(f.cmp(&g))
    });
    start + middle
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A bumpy height field over a grid, `n` by `n` squares.
    fn terrain(n: u32) -> TriMesh {
        let side = n + 1;
        let point = |i: u32, j: u32| {
            let (x, y) = (f64::from(i) / f64::from(n), f64::from(j) / f64::from(n));
            Vec3::new(x, y, 0.1 * (7.0 * x).sin() * (5.0 * y).cos())
        };
        let positions = (0..side).flat_map(|j| (0..side).map(move |i| point(i, j))).collect();
        let faces: Vec<_> = (0..n)
            .flat_map(|j| (0..n).map(move |i| j * side + i))
            .flat_map(|a| [[a, a + 1, a + side + 1], [a, a + side + 1, a + side]])
            .collect();
        TriMesh::new(positions, &faces).unwrap()
    }

    /// Deterministic points in [-0.5, 1.5]³.
    fn cloud(n: usize) -> Vec<Vec3> {
        let mut state = 1_u64;
        let mut next = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64 * 2.0 - 0.5
        };
        (0..n).map(|_| Vec3::from_fn(|_, _| next())).collect()
    }

    fn brute(mesh: &TriMesh, p: &Vec3) -> f64 {
        mesh.faces().map(|f| closest_on_triangle(p, &mesh.face_positions(f)).1).fold(f64::INFINITY, f64::min).sqrt()
    }

    fn check(mesh: &TriMesh, bvh: &Bvh, points: &[Vec3]) {
        for (p, found) in points.iter().zip(bvh.closest_all(points)) {
            let expected = brute(mesh, p);
            assert!((found.distance - expected).abs() <= 1e-13, "{p:?}: {} against {expected}", found.distance);
            let corners = mesh.face_positions(found.face);
            let again: Vec3 = corners.iter().zip(found.barycentric).map(|(c, b)| c * b).sum();
            assert!((again - found.point).norm() < 1e-14);
            assert!(found.barycentric.iter().all(|&b| (0.0..=1.0).contains(&b)), "{:?}", found.barycentric);
            assert!((found.barycentric.iter().sum::<f64>() - 1.0).abs() < 1e-14);
            assert!(((p - found.point).norm() - found.distance).abs() < 1e-14);
            for hint in [FaceId(0), found.face] {
                assert!((bvh.closest_from(*p, hint).distance - found.distance).abs() < 1e-15);
            }
            let above = expected * (1.0 + 1e-9) + 1e-12;
            assert!(bvh.closest_within(*p, above).is_some_and(|it| (it.distance - found.distance).abs() < 1e-15));
            let below = expected * (1.0 - 1e-9) - 1e-12;
            assert_eq!(bvh.closest_within(*p, below), None);
            assert!(bvh.is_within(*p, above) && !bvh.is_within(*p, below));
        }
    }

    #[test]
    fn closest_points_equal_brute_force() {
        for n in [1, 2, 3, 20] {
            let mesh = terrain(n);
            check(&mesh, &Bvh::new(&mesh), &cloud(1000));
        }
    }

    #[test]
    fn points_on_vertices_edges_and_far_away() {
        let mesh = terrain(8);
        let bvh = Bvh::new(&mesh);
        for v in mesh.vertices() {
            let found = bvh.closest(mesh.position(v));
            assert_eq!(found.distance, 0.0);
            assert!(mesh.face_vertices(found.face).contains(&v));
            let smallest = mesh.outgoing(v).map(|h| mesh.face(h)).min();
            assert_eq!(Some(found.face), smallest, "ties go to the smallest face");
        }
        let midpoints: Vec<_> = mesh
            .edges()
            .map(|e| mesh.edge_vertices(e))
            .map(|[a, b]| (mesh.position(a) + mesh.position(b)) / 2.0)
            .collect();
        check(&mesh, &bvh, &midpoints);
        for scale in [1e3, 1e9, 1e100] {
            let p = Vec3::new(-scale, -scale, scale);
            assert!((bvh.closest(p).distance / p.norm() - 1.0).abs() < 1e-2);
        }
        for p in [Vec3::repeat(f64::NAN), Vec3::repeat(f64::INFINITY), Vec3::repeat(1e300)] {
            assert_eq!(bvh.closest(p).face, FaceId(0));
            assert_eq!(bvh.closest_within(p, 1.0), None);
        }
    }

    #[test]
    fn refit_follows_the_mesh_even_into_degenerate_faces() {
        let mut mesh = terrain(12);
        let mut bvh = Bvh::new(&mesh);
        for (p, offset) in mesh.positions_mut().as_mut_slice().iter_mut().zip(cloud(1000)) {
            *p += 0.2 * offset;
        }
        bvh.refit(&mesh);
        check(&mesh, &bvh, &cloud(500));
        for p in mesh.positions_mut().as_mut_slice() {
            p.z = 0.0;
            p.y = (p.y * 3.0).round() / 3.0;
        }
        bvh.refit(&mesh);
        check(&mesh, &bvh, &cloud(500));
        mesh.positions_mut().as_mut_slice().fill(Vec3::repeat(0.25));
        bvh.refit(&mesh);
        check(&mesh, &bvh, &cloud(50));
    }
}
