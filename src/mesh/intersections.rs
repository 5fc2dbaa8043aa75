//! Where a surface passes through itself, decided exactly.
//!
//! Two faces intersect when they share more than what the connectivity says: faces without a common vertex any point (also a
//! touch), faces with a common vertex a second point, faces with a common edge an area. Orientations are evaluated with
//! Shewchuk's adaptive predicates (Adaptive Precision Floating-Point Arithmetic, 1997), so the answer is that of real
//! arithmetic on the coordinates as they are; only the reported places are rounded.
use rayon::prelude::*;
use robust::{Coord, Coord3D, orient2d, orient3d};

use super::{Bvh, FaceId, Id, TriMesh};
use crate::geom::{Box3, Vec3};

/// Faces per task.
const BATCH: usize = 512;

/// Two faces of a mesh that intersect.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Intersection {
    /// The faces, smaller id first.
    pub faces: [FaceId; 2],
    /// Ends of the longest stretch between the points that were found common to both, up to rounding; mm.
    pub stretch: [Vec3; 2],
}

impl Intersection {
    /// The middle of [`Intersection::stretch`].
    pub fn place(&self) -> Vec3 {
        (self.stretch[0] + self.stretch[1]) / 2.0
    }
}

/// All pairs of faces that intersect, sorted by their ids. `tree` must have been built from `mesh` or refitted to it.
/// O(F log F) for a mesh whose faces are about as large as their distances.
pub fn self_intersections(mesh: &TriMesh, tree: &Bvh) -> Vec<Intersection> {
    let mut found: Vec<Intersection> = (0..mesh.face_count())
        .into_par_iter()
        .with_min_len(BATCH)
        .flat_map_iter(|i| {
            let first = FaceId::new(i);
            let mut own = Vec::new();
            tree.for_each_in_box(&Box3::of(&mesh.face_positions(first)), |second| {
                if first < second {
                    let stretch = common_stretch(mesh, [first, second]);
                    own.extend(stretch.map(|stretch| Intersection { faces: [first, second], stretch }));
                }
            });
            own
        })
        .collect();
    found.sort_unstable_by_key(|it| it.faces);
    found
}

/// The common points of two faces beyond those of the vertices and edges they share; `None` if there are none.
fn common_stretch(mesh: &TriMesh, faces: [FaceId; 2]) -> Option<[Vec3; 2]> {
    let vertices = faces.map(|f| mesh.face_vertices(f));
    let corners = faces.map(|f| mesh.face_positions(f));
    let own = |side: usize| (0..3).filter(move |&k| !vertices[1 - side].contains(&vertices[side][k]));
    let shared = 3 - own(0).count();
    let mut points = Vec::new();
    match shared {
        0 => {
            if misses_plane(&corners[0], &corners[1]) || misses_plane(&corners[1], &corners[0]) {
                return None;
            }
            for side in 0..2 {
                for k in 0..3 {
                    common_points(corners[side][k], corners[side][(k + 1) % 3], &corners[1 - side], &mut points);
                }
            }
        }
        // A second common point lies on a segment from the common vertex, and the nearer of its two ends on the side of a
        // face opposite that vertex.
        1 => {
            for side in 0..2 {
                let mut ends = own(side).map(|k| corners[side][k]);
                if let (Some(p), Some(q)) = (ends.next(), ends.next()) {
                    common_points(p, q, &corners[1 - side], &mut points);
                }
            }
            if !points.is_empty() {
                points.extend((0..3).filter(|k| own(0).all(|it| it != *k)).map(|k| corners[0][k]));
            }
        }
        // Only faces in one plane share more than the edge.
        2 => {
            let apex = own(1).next().map(|k| corners[1][k])?;
            let k = own(0).next()?;
            let [c, a, b] = [k, (k + 1) % 3, (k + 2) % 3].map(|k| corners[0][k]);
            if side_of_plane(&corners[0], apex) == 0.0 {
                let axis = flat_axis(&corners[0])?;
                if side_of_line(axis, a, b, c) * side_of_line(axis, a, b, apex) > 0.0 {
                    points.extend([a, b]);
                }
            }
        }
        _ => points.extend(corners[0]),
    }
    farthest_two(&points)
}

/// The two points farthest apart (the same one twice if there is only one).
fn farthest_two(points: &[Vec3]) -> Option<[Vec3; 2]> {
    let first = *points.first()?;
    let mut best = ([first, first], 0.0);
    for (i, p) in points.iter().enumerate() {
        for q in &points[i + 1..] {
            let squared = (p - q).norm_squared();
            if squared > best.1 {
                best = ([*p, *q], squared);
            }
        }
    }
    Some(best.0)
}

/// The sign of the side of the plane of a triangle on which a point lies, as a number of that sign; 0 in the plane.
fn side_of_plane([a, b, c]: &[Vec3; 3], p: Vec3) -> f64 {
    let coord = |v: &Vec3| Coord3D { x: v.x, y: v.y, z: v.z };
    sign(orient3d(coord(a), coord(b), coord(c), coord(&p)))
}

/// The sign of the side of the line from `a` to `b` on which a point lies, all seen along `axis`.
fn side_of_line(axis: usize, a: Vec3, b: Vec3, p: Vec3) -> f64 {
    let coord = |v: Vec3| Coord { x: v[(axis + 1) % 3], y: v[(axis + 2) % 3] };
    sign(orient2d(coord(a), coord(b), coord(p)))
}

/// −1, 0 or 1, so that products of signs neither overflow nor vanish.
fn sign(x: f64) -> f64 {
    if x == 0.0 { 0.0 } else { x.signum() }
}

/// The coordinate axis along which a triangle shows most of its area; `None` for one without area.
fn flat_axis([a, b, c]: &[Vec3; 3]) -> Option<usize> {
    let axis = (b - a).cross(&(c - a)).iamax();
    [axis, (axis + 1) % 3, (axis + 2) % 3].into_iter().find(|&axis| side_of_line(axis, *a, *b, *c) != 0.0)
}

/// Whether all corners of `triangle` lie strictly on one side of the plane of `other`.
fn misses_plane(triangle: &[Vec3; 3], other: &[Vec3; 3]) -> bool {
    let [a, b, c] = triangle.map(|p| side_of_plane(other, p));
    a * b > 0.0 && b * c > 0.0
}

/// Adds common points of a segment and a triangle, both with their borders: at least one if there are any, the ends of their
/// common stretch where they lie in one plane.
fn common_points(p: Vec3, q: Vec3, triangle: &[Vec3; 3], points: &mut Vec<Vec3>) {
    let (side_p, side_q) = (side_of_plane(triangle, p), side_of_plane(triangle, q));
    if side_p == 0.0 && side_q == 0.0 {
        return common_points_in_plane(p, q, triangle, points);
    }
    if side_p * side_q > 0.0 {
        return;
    }
    let turns = [0, 1, 2].map(|k| side_of_plane(&[p, triangle[k], triangle[(k + 1) % 3]], q));
    if turns.iter().all(|&it| it >= 0.0) || turns.iter().all(|&it| it <= 0.0) {
        let [a, b, c] = triangle;
        let normal = (b - a).cross(&(c - a));
        let (from, along) = ((a - p).dot(&normal), (q - p).dot(&normal));
        let t = if along == 0.0 { 0.5 } else { (from / along).clamp(0.0, 1.0) };
        points.push(p + (q - p) * t);
    }
}

/// The same in the plane of the triangle.
fn common_points_in_plane(p: Vec3, q: Vec3, triangle: &[Vec3; 3], points: &mut Vec<Vec3>) {
    let Some(axis) = flat_axis(triangle) else { return };
    let [a, b, c] = *triangle;
    let turn = side_of_line(axis, a, b, c);
    let sides = [(a, b), (b, c), (c, a)];
    for point in [p, q] {
        if sides.iter().all(|&(a, b)| turn * side_of_line(axis, a, b, point) >= 0.0) {
            points.push(point);
        }
    }
    for (a, b) in sides {
        let (from, to) = (side_of_line(axis, a, b, p), side_of_line(axis, a, b, q));
        let (left, right) = (side_of_line(axis, p, q, a), side_of_line(axis, p, q, b));
        // Where all four vanish the ends that lie inside the triangle, or its own corners on the segment, tell.
        if from * to <= 0.0 && left * right <= 0.0 && (from != to || left != right) {
            let lengths = [p, q].map(|it| (b - a).cross(&(it - a)).norm());
            let t = if lengths[0] + lengths[1] > 0.0 { lengths[0] / (lengths[0] + lengths[1]) } else { 0.5 };
            points.push(p + (q - p) * t);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        geom::Vec2,
        mesh::{EdgeId, VertexId, shapes},
    };

    fn found(mesh: &TriMesh) -> Vec<Intersection> {
        self_intersections(mesh, &Bvh::new(mesh))
    }

    /// Two meshes as one.
    fn both(a: &TriMesh, b: &TriMesh) -> TriMesh {
        let offset = a.vertex_count() as u32;
        let positions = a.positions().iter().chain(b.positions().iter()).copied().collect();
        let mut faces = a.face_indices();
        faces.extend(b.face_indices().iter().map(|f| f.map(|v| v + offset)));
        TriMesh::new(positions, &faces).unwrap()
    }

    fn moved(mesh: &TriMesh, to: impl Fn(Vec3) -> Vec3) -> TriMesh {
        let mut mesh = mesh.clone();
        mesh.positions_mut().as_mut_slice().iter_mut().for_each(|p| *p = to(*p));
        mesh
    }

    /// Whether two triangles without a common vertex intersect.
    fn pair(first: [[f64; 3]; 3], second: [[f64; 3]; 3]) -> bool {
        let corners = first.into_iter().chain(second).map(Vec3::from).collect();
        !found(&TriMesh::new(corners, &[[0, 1, 2], [3, 4, 5]]).unwrap()).is_empty()
    }

    #[test]
    fn surfaces_without_crossings_have_none() {
        for mesh in [
            shapes::icosphere(1.0, 4),
            shapes::torus(1.0, 0.4, 48, 24),
            shapes::cuboid(Vec3::new(1.0, 2.0, 3.0), 4),
            shapes::cylinder(1.0, 2.0, 24, 6),
            shapes::grid(9, 7, 0.1),
            both(&shapes::icosphere(1.0, 2), &shapes::icosphere(0.7, 2)),
        ] {
            assert_eq!(found(&mesh), []);
            // Rotated, so that coplanar faces are so only up to rounding.
            let turn = nalgebra::Rotation3::from_euler_angles(0.3, -1.1, 2.0);
            assert_eq!(found(&moved(&mesh, |p| turn * p)), []);
        }
    }

    #[test]
    fn crossing_spheres_meet_along_their_circle() {
        let ball = shapes::icosphere(1.0, 3);
        let mesh = both(&ball, &moved(&ball, |p| p + Vec3::new(1.0, 0.01, 0.02)));
        let pairs = found(&mesh);
        assert!(pairs.len() > 100);
        assert!(pairs.is_sorted_by(|a, b| a.faces < b.faces));
        let half = ball.face_count();
        for it in &pairs {
            assert!(it.faces[0].index() < half && it.faces[1].index() >= half);
            // On both spheres up to the height of the faces.
            for (center, p) in [Vec3::zeros(), Vec3::new(1.0, 0.01, 0.02)].into_iter().zip([it.place(); 2]) {
                assert!(((p - center).norm() - 1.0).abs() < 0.02, "{p}");
            }
        }
        // The closed curve is covered without gaps: stretches add up to the circle of radius √3/2.
        let length: f64 = pairs.iter().map(|it| (it.stretch[1] - it.stretch[0]).norm()).sum();
        assert!((length / (std::f64::consts::PI * 3.0_f64.sqrt()) - 1.0).abs() < 0.02, "{length}");
    }

    #[test]
    fn agrees_with_every_pair_tried() {
        let wave = |p: Vec3| p + 0.35 * Vec3::new((7.0 * p.y).sin(), (5.0 * p.z).sin(), (6.0 * p.x).sin());
        for mesh in [
            moved(&shapes::torus(1.0, 0.5, 20, 12), wave),
            // A spindle torus crosses itself along its axis.
            shapes::torus(1.0, 0.3, 16, 8),
            moved(&shapes::torus(1.0, 0.9, 24, 16), |p| p * (1.0 - 0.3 / (p.x.hypot(p.y) + 1e-3))),
        ] {
            let mut all = Vec::new();
            for first in mesh.faces() {
                for second in mesh.faces().skip(first.index() + 1) {
                    all.extend(common_stretch(&mesh, [first, second]).map(|_| [first, second]));
                }
            }
            assert_eq!(found(&mesh).iter().map(|it| it.faces).collect::<Vec<_>>(), all);
        }
        assert!(!found(&moved(&shapes::torus(1.0, 0.5, 20, 12), wave)).is_empty());
    }

    #[test]
    fn a_pinched_torus_and_a_folded_star_are_found() {
        let torus = shapes::torus(1.0, 0.4, 32, 16);
        // The tube on the side of +x is pushed through its own opposite wall.
        let pinched = moved(&torus, |p| if p.x > 0.9 { Vec3::new(p.x, p.y, -p.z * (p.x - 0.9) * 5.0) } else { p });
        assert!(!found(&pinched).is_empty());
        // The centre of a flat fan dragged beyond its rim: faces that share the centre overlap, beyond it.
        let mut fan = shapes::grid(2, 2, 1.0);
        fan.positions_mut()[VertexId(4)] = Vec3::new(2.6, 1.1, 0.0);
        let pairs = found(&fan);
        assert!(!pairs.is_empty());
        let center = |it: &Intersection| it.faces.iter().all(|&f| fan.face_vertices(f).contains(&VertexId(4)));
        assert!(pairs.iter().any(center));
        // Lifted to a spike it no longer does.
        fan.positions_mut()[VertexId(4)] = Vec3::new(1.0, 1.1, 3.0);
        assert_eq!(found(&fan), []);
        // Two faces folded flat onto each other share the edge and an area.
        let mut flap = shapes::grid(1, 1, 1.0);
        assert_eq!(flap.edge_vertices(EdgeId(2)), [VertexId(3), VertexId(0)]);
        flap.positions_mut()[VertexId(2)] = Vec3::new(1.0, 0.25, 0.0);
        assert_eq!(found(&flap).len(), 1);
        flap.positions_mut()[VertexId(2)] = Vec3::new(1.0, 0.25, 1e-300);
        assert_eq!(found(&flap).len(), 0, "not in one plane any more, by the smallest angle");
    }

    #[test]
    fn touches_and_coplanar_overlaps_are_decided_exactly() {
        let base = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let up = |x: f64, y: f64, z: f64| [[x, y, z], [x + 0.1, y, z + 1.0], [x, y + 0.1, z + 1.0]];
        // A tip that touches the inside, an edge, or stays the smallest number above.
        assert!(pair(base, up(0.25, 0.25, 0.0)));
        assert!(pair(base, up(0.5, 0.5, 0.0)));
        assert!(!pair(base, up(0.25, 0.25, f64::MIN_POSITIVE)));
        assert!(pair(base, up(0.25, 0.25, -f64::MIN_POSITIVE)));
        // In one plane: apart, inside, around, crossing like a star, and side by side along a part of an edge.
        let flat = |points: [[f64; 2]; 3]| points.map(|[x, y]| [x, y, 0.0]);
        assert!(!pair(base, flat([[0.7, 0.7], [2.0, 0.7], [0.7, 2.0]])));
        assert!(pair(base, flat([[0.2, 0.2], [0.3, 0.2], [0.2, 0.3]])));
        assert!(pair(base, flat([[-1.0, -1.0], [4.0, -1.0], [-1.0, 4.0]])));
        assert!(pair(base, flat([[0.7, 0.7], [-0.4, 0.4], [0.4, -0.4]])));
        assert!(pair(base, flat([[0.25, 0.0], [0.5, -1.0], [0.75, 0.0]])));
        // 0.1 + 0.2 is above 0.3 by one rounding error, and so is this corner beyond the slanted side x + y = 1.
        let beyond = 0.7 + f64::EPSILON;
        assert!(!pair(base, flat([[0.3, beyond], [2.0, beyond], [0.3, 2.0]])));
    }

    #[test]
    fn a_profile_that_crosses_itself_does_so_all_around() {
        // Revolved figure eight: each of the 20 sides crosses in one ring.
        let eight = [[2.0, 0.0], [3.0, 1.0], [3.0, 0.0], [2.0, 1.0]].map(Vec2::from);
        let pairs = found(&shapes::revolve(&eight, 20));
        assert!(pairs.len() >= 20);
        assert!(pairs.iter().all(|it| (it.place().z - 0.5).abs() < 1e-12));
    }
}
