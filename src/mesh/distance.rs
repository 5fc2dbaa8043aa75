//! Distances between two surfaces: sampled, and bounded from above with proof.
use rayon::prelude::*;

use super::{Bvh, FaceId, Id, TriMesh};
use crate::{
    geom::{Vec3, closest_on_triangle},
    numeric::{Cancelled, Monitor},
};

/// Samples per surface in [`SurfaceDistance::between`], besides the vertices.
const SAMPLES: usize = 50_000;
/// Bounds closer than this share of the bounding box diagonal count as tight: for surfaces that coincide, where a share
/// of the distance is never reached.
const FLOOR: f64 = 1e-6;
/// [`violations`] reports places about this share of the diagonal apart, so that their number stays bounded.
const SPACING: f64 = 5e-3;
/// Pieces are cut along the closest triangle at most this often in a row, so that halving always comes to its turn; and
/// only where both parts reach this share of the radius beyond the cut.
const CUTS: u8 = 4;
const BALANCE: f64 = 0.02;
/// Pieces per task.
const BATCH: usize = 256;

/// A point on a mesh.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfacePoint {
    /// The face that holds it.
    pub face: FaceId,
    /// Its barycentric coordinates there: not negative, sum 1.
    pub barycentric: [f64; 3],
}

impl SurfacePoint {
    /// Where it lies, mm.
    pub fn position(&self, mesh: &TriMesh) -> Vec3 {
        let [a, b, c] = mesh.face_positions(self.face);
        a * self.barycentric[0] + b * self.barycentric[1] + c * self.barycentric[2]
    }
}

/// `count` points spread evenly by area, in the order of the faces. The same mesh gives the same points.
///
/// Which face: systematic sampling of the cumulated area. Where in the face: Roberts' R2 sequence (additive recurrence
/// with the plastic number), folded onto the triangle; consecutive points, which share a face, are well apart.
pub fn sample(mesh: &TriMesh, count: usize) -> Vec<SurfacePoint> {
    /// The plastic number, root of x³ = x + 1.
    const PLASTIC: f64 = 1.324_717_957_244_746;
    let step = mesh.total_area() / count as f64;
    let mut points = Vec::with_capacity(count);
    let mut reached = 0.0;
    for face in mesh.faces() {
        reached += mesh.area(face);
        while points.len() < count && (points.len() as f64 + 0.5) * step <= reached {
            let i = points.len() as f64;
            let (v, w) = ((0.5 + i / PLASTIC).fract(), (0.5 + i / (PLASTIC * PLASTIC)).fract());
            let (v, w) = if v + w > 1.0 { (1.0 - v, 1.0 - w) } else { (v, w) };
            points.push(SurfacePoint { face, barycentric: [1.0 - v - w, v, w] });
        }
    }
    points
}

/// About `count` points spread by area that keep the symmetries of the mesh: every face whose share is at least half a point
/// holds the centroids of n² equal triangles, n² near its share. Of smaller faces some hold their centroid, by systematic
/// sampling in their order.
pub fn sample_symmetrically(mesh: &TriMesh, count: usize) -> Vec<SurfacePoint> {
    let step = mesh.total_area() / count as f64;
    let mut points = Vec::with_capacity(count);
    let mut small = 0.0;
    for face in mesh.faces() {
        let share = mesh.area(face) / step;
        if share < 0.5 {
            small += share;
            if small < 0.5 {
                continue;
            }
            small -= 1.0;
        }
        let n = share.sqrt().round().max(1.0) as usize;
        let edge = 3.0 * n as f64;
        for i in 0..n {
            for j in 0..n - i {
                // The triangle (i, j) that points the way of the face, and its neighbour that points the other way.
                for offset in 1..=if i + j + 1 < n { 2 } else { 1 } {
                    let (v, w) = ((3 * i + offset) as f64 / edge, (3 * j + offset) as f64 / edge);
                    points.push(SurfacePoint { face, barycentric: [1.0 - v - w, v, w] });
                }
            }
        }
    }
    points
}

/// How far two surfaces are apart, sampled in both directions. mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfaceDistance {
    /// Largest distance of a sample or vertex of either surface from the other.
    pub hausdorff: f64,
    /// Mean distance of the samples, which are uniform by area, averaged over both directions.
    pub mean: f64,
}

impl SurfaceDistance {
    /// Samples each surface at 50 000 points and all vertices.
    pub fn between(a: &TriMesh, b: &TriMesh) -> Self {
        let (max_ab, mean_ab) = one_sided(a, &Bvh::new(b));
        let (max_ba, mean_ba) = one_sided(b, &Bvh::new(a));
        Self { hausdorff: max_ab.max(max_ba), mean: (mean_ab + mean_ba) / 2.0 }
    }
}

/// Largest distance of samples and vertices, mean distance of samples.
fn one_sided(from: &TriMesh, to: &Bvh) -> (f64, f64) {
    let mut points: Vec<Vec3> = sample(from, SAMPLES).iter().map(|s| s.position(from)).collect();
    let samples = points.len();
    points.extend_from_slice(from.positions().as_slice());
    let found = to.closest_all(&points);
    let max = found.iter().map(|it| it.distance).fold(0.0, f64::max);
    let mean = found[..samples].iter().map(|it| it.distance).sum::<f64>() / samples.max(1) as f64;
    (max, mean)
}

/// What is proven about the largest distance from one surface to another. mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HausdorffBounds {
    /// Some point is this far away.
    pub lower: f64,
    /// No point is farther (up to rounding).
    pub upper: f64,
}

/// A place that is farther from the other surface than it should be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Violation {
    /// The face of the surface it was looked for on.
    pub face: FaceId,
    /// The place on that face.
    pub point: Vec3,
    /// Its distance from the other surface, mm.
    pub distance: f64,
    /// The closest face of the other surface.
    pub closest: FaceId,
}

/// Bounds of the one-sided Hausdorff distance: the largest distance of a point of `from` to the surface of `to`.
///
/// `upper - lower` is at most `resolution * lower` (or 1e-6 of the diagonal of `from`). Branch and bound over the faces,
/// split (see [`Piece::split`]) until their bound (see [`Piece::new`]) is tight; the number of splits has no other limit.
pub fn hausdorff_bounds(
    from: &TriMesh,
    to: &Bvh,
    resolution: f64,
    monitor: &Monitor,
) -> Result<HausdorffBounds, Cancelled> {
    let floor = FLOOR * from.bounds().diagonal();
    let vertices = to.closest_all(from.positions().as_slice());
    let mut lower = vertices.iter().map(|it| it.distance).fold(0.0, f64::max);
    let mut upper = lower;
    let mut open = Piece::of_mesh(from, to);
    while !open.is_empty() {
        monitor.check()?;
        lower = open.iter().map(|it| it.distance).fold(lower, f64::max);
        let enough = lower + floor.max(resolution * lower);
        let (settled, unsettled): (Vec<_>, Vec<_>) = open.into_iter().partition(|it| it.upper <= enough);
        upper = settled.iter().map(|it| it.upper).fold(upper, f64::max);
        open = Piece::split_all(&unsettled, to);
    }
    Ok(HausdorffBounds { lower, upper: upper.max(lower) })
}

/// The larger of [`hausdorff_bounds`] in both directions.
pub fn two_sided_bounds(
    a: &TriMesh,
    b: &TriMesh,
    resolution: f64,
    monitor: &Monitor,
) -> Result<HausdorffBounds, Cancelled> {
    let there = hausdorff_bounds(a, &Bvh::new(b), resolution, monitor)?;
    let back = hausdorff_bounds(b, &Bvh::new(a), resolution, monitor)?;
    Ok(HausdorffBounds { lower: there.lower.max(back.lower), upper: there.upper.max(back.upper) })
}

/// Where `from` is farther from the surface of `to` than `(1 - resolution) * limit`, in the order of the faces.
///
/// An empty answer is a proof that no point of `from` is farther than `limit`. `resolution` in (0, 1) is the share of the
/// limit given up so that the search ends. Violated regions are reported at places about 0.5 % of the diagonal apart,
/// or half the limit if that is more, and at least once per region of a face.
///
/// # Panics
/// If `limit` is not positive or `resolution` not in (0, 1).
pub fn violations(
    from: &TriMesh,
    to: &Bvh,
    limit: f64,
    resolution: f64,
    monitor: &Monitor,
) -> Result<Vec<Violation>, Cancelled> {
    assert!(limit > 0.0 && resolution > 0.0 && resolution < 1.0, "limit {limit}, resolution {resolution}");
    let spacing = (SPACING * from.bounds().diagonal()).max(limit / 2.0);
    let mut found = Vec::new();
    let mut open = Piece::of_mesh(from, to);
    while !open.is_empty() {
        monitor.check()?;
        open.retain(|piece| {
            let done = piece.distance > (1.0 - resolution) * limit && piece.radius <= spacing;
            if done && piece.upper > limit {
                found.push(Violation {
                    face: piece.face,
                    point: piece.center(),
                    distance: piece.distance,
                    closest: piece.closest,
                });
            }
            piece.upper > limit && !done
        });
        open = Piece::split_all(&open, to);
    }
    found.sort_by_key(|it| it.face);
    Ok(found)
}

/// Whether no point of a triangle is farther than `limit` from the surface of `to`: proven if true; if false, some point is
/// farther than `(1 - resolution) * limit`.
pub fn is_within(corners: [Vec3; 3], to: &Bvh, limit: f64, resolution: f64) -> bool {
    let center = corners.iter().sum::<Vec3>() / 3.0;
    let radius = corners.iter().map(|c| (c - center).norm_squared()).fold(0.0, f64::max).sqrt();
    // The common case, without finding the closest point.
    to.is_within(center, limit - radius)
        || is_piece_within(&Piece::new(corners, FaceId(0), to, None), to, limit, resolution)
}

fn is_piece_within(piece: &Piece, to: &Bvh, limit: f64, resolution: f64) -> bool {
    if piece.upper <= limit || piece.distance > (1.0 - resolution) * limit {
        return piece.upper <= limit;
    }
    // A piece that small has `upper <= distance + radius <= limit` but for rounding, so the depth is bounded.
    piece.radius > resolution / 2.0 * limit
        && piece.split(to).iter().all(|part| is_piece_within(part, to, limit, resolution))
}

/// A triangle inside a face, with what is known about its distance to the other surface.
#[derive(Debug, Clone, Copy)]
struct Piece {
    corners: [Vec3; 3],
    /// The face it lies in.
    face: FaceId,
    /// The closest face of the other surface, seen from the centroid.
    closest: FaceId,
    /// Distance of the centroid.
    distance: f64,
    /// Largest distance of a corner from the centroid.
    radius: f64,
    /// No point of the piece is farther from the other surface.
    upper: f64,
    /// Cuts since it was last halved.
    cuts: u8,
}

impl Piece {
    /// Two bounds hold: the distance function is 1-Lipschitz, so no point is farther than the centroid by more than
    /// `radius`; and the distance to one triangle, a convex set, is a convex function, so it is largest at a corner,
    /// and the distance to the whole surface is no larger. The second is exact where the piece faces a single triangle.
    fn new(corners: [Vec3; 3], face: FaceId, to: &Bvh, hint: Option<FaceId>) -> Self {
        let center = corners.iter().sum::<Vec3>() / 3.0;
        let found = hint.map_or_else(|| to.closest(center), |hint| to.closest_from(center, hint));
        if !found.distance.is_finite() {
            // A position is not finite. Infinitely far, so that no caller takes it for proven.
            let far = f64::INFINITY;
            return Self { corners, face, closest: found.face, distance: far, radius: 0.0, upper: far, cuts: 0 };
        }
        let radius = corners.iter().map(|c| (c - center).norm_squared()).fold(0.0, f64::max).sqrt();
        let target = to.face_positions(found.face);
        let farthest = corners.iter().map(|c| closest_on_triangle(c, &target).1).fold(0.0, f64::max).sqrt();
        let upper = farthest.min(found.distance + radius);
        Self { corners, face, closest: found.face, distance: found.distance, radius, upper, cuts: 0 }
    }

    fn center(&self) -> Vec3 {
        self.corners.iter().sum::<Vec3>() / 3.0
    }

    /// One piece per face.
    fn of_mesh(mesh: &TriMesh, to: &Bvh) -> Vec<Self> {
        (0..mesh.face_count())
            .into_par_iter()
            .with_min_len(BATCH)
            .map(|i| Self::new(mesh.face_positions(FaceId::new(i)), FaceId::new(i), to, None))
            .collect()
    }

    /// The parts of each.
    fn split_all(pieces: &[Self], to: &Bvh) -> Vec<Self> {
        pieces.par_iter().with_min_len(BATCH).flat_map_iter(|piece| piece.split(to)).collect()
    }

    /// Three pieces, along a side of the closest triangle that runs through this one: inside that side the bound is then
    /// exact, which ends the search where surfaces coincide. Else four, by halving the sides.
    fn split(&self, to: &Bvh) -> Vec<Self> {
        let part = |corners, cuts| Self { cuts, ..Self::new(corners, self.face, to, Some(self.closest)) };
        let cut = if self.cuts < CUTS { self.cut(&to.face_positions(self.closest)) } else { None };
        if let Some(parts) = cut {
            return parts.into_iter().map(|corners| part(corners, self.cuts + 1)).collect();
        }
        let [a, b, c] = self.corners;
        let (ab, bc, ca) = ((a + b) / 2.0, (b + c) / 2.0, (c + a) / 2.0);
        [[a, ab, ca], [ab, b, bc], [ca, bc, c], [bc, ca, ab]].into_iter().map(|corners| part(corners, 0)).collect()
    }

    /// The parts on the two sides of the plane through a side of `target` and its normal, if that plane divides the piece
    /// well and the target is not small against the piece. What is symmetric is cut symmetrically: the quadrangle beside
    /// the lone corner along its shorter diagonal, or about its middle where both are as long.
    fn cut(&self, target: &[Vec3; 3]) -> Option<Vec<[Vec3; 3]>> {
        /// Diagonals that differ by less than this share are equal but for rounding.
        const EQUAL: f64 = 1e-9;
        let normal = (target[1] - target[0]).cross(&(target[2] - target[0]));
        let (mut best, mut heights) = (BALANCE * self.radius, None);
        let mut size = 0.0_f64;
        for k in 0..3 {
            let side = target[(k + 1) % 3] - target[k];
            size = size.max(side.norm());
            let Some(outward) = side.cross(&normal).try_normalize(0.0) else { continue };
            let height = self.corners.map(|p| outward.dot(&(p - target[k])));
            let (low, high) = height.iter().fold((0.0_f64, 0.0_f64), |(low, high), &h| (low.min(h), high.max(h)));
            if high.min(-low) > best {
                (best, heights) = (high.min(-low), Some(height));
            }
        }
        let heights = heights.filter(|_| size >= self.radius)?;
        let above = heights.map(|h| h > 0.0);
        let lone = (0..3).find(|&k| above[k] != above[(k + 1) % 3] && above[k] != above[(k + 2) % 3])?;
        let [i, j, k] = [lone, (lone + 1) % 3, (lone + 2) % 3];
        let [p, q, r] = [i, j, k].map(|at| self.corners[at]);
        let crossing = |to: Vec3, height: f64| p + (to - p) * (heights[i] / (heights[i] - height));
        let (x, y) = (crossing(q, heights[j]), crossing(r, heights[k]));
        let (xr, qy) = ((r - x).norm(), (y - q).norm());
        Some(if (xr - qy).abs() <= EQUAL * (xr + qy) {
            let middle = (x + q + r + y) / 4.0;
            vec![[p, x, y], [x, q, middle], [q, r, middle], [r, y, middle], [y, x, middle]]
        } else if xr < qy {
            vec![[p, x, y], [x, q, r], [x, r, y]]
        } else {
            vec![[p, x, y], [x, q, y], [q, r, y]]
        })
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering};

    use super::*;

    /// The square [-1, 1]² in `2 n²` faces, lifted by `height(x, y)`.
    fn graph(n: u32, height: impl Fn(f64, f64) -> f64) -> TriMesh {
        let at = |i: u32| f64::from(i) / f64::from(n) * 2.0 - 1.0;
        let positions = (0..=n)
            .flat_map(|j| (0..=n).map(move |i| (at(i), at(j))))
            .map(|(x, y)| Vec3::new(x, y, height(x, y)))
            .collect();
        let corner = |i: u32, j: u32| j * (n + 1) + i;
        let faces: Vec<_> = (0..n)
            .flat_map(|j| (0..n).map(move |i| (i, j)))
            .flat_map(|(i, j)| {
                let [a, b, c, d] = [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
                [[a, b, c], [a, c, d]]
            })
            .collect();
        TriMesh::new(positions, &faces).unwrap()
    }

    /// The square is its own mirror image about its diagonal, which the edges follow.
    #[test]
    fn symmetric_samples_of_a_symmetric_mesh_are_symmetric() {
        let mesh = graph(3, |x, y| 0.3 * x * y);
        for count in [18, 160, 1000] {
            let points: Vec<Vec3> = sample_symmetrically(&mesh, count).iter().map(|it| it.position(&mesh)).collect();
            assert!((0.6..1.5).contains(&(points.len() as f64 / count as f64)), "{} of {count}", points.len());
            for p in &points {
                let image = Vec3::new(p.y, p.x, p.z);
                assert!(points.iter().any(|q| (q - image).norm() < 1e-12), "{p} has no image");
            }
        }
        // Where there are fewer points than faces, they are still spread by area.
        let few = sample_symmetrically(&mesh, 6);
        assert_eq!(few.len(), 6);
        assert!(few.windows(2).all(|it| it[0].face != it[1].face));
    }

    fn bounds(from: &TriMesh, to: &TriMesh, resolution: f64) -> HausdorffBounds {
        hausdorff_bounds(from, &Bvh::new(to), resolution, &Monitor::silent()).unwrap()
    }

    fn wave(x: f64, y: f64) -> f64 {
        0.2 * (3.0 * x + y).sin() * (2.0 * y).cos()
    }

    #[test]
    fn samples_are_uniform_by_area() {
        let mesh = graph(9, |x, y| wave(x, y) + 2.0 * x * x);
        let count = 10_000;
        let points = sample(&mesh, count);
        assert_eq!(points.len(), count);
        let mut per_face = vec![0.0; mesh.face_count()];
        for point in &points {
            per_face[point.face.index()] += 1.0;
            assert!(point.barycentric.iter().all(|&b| b >= 0.0));
            assert!((point.barycentric.iter().sum::<f64>() - 1.0).abs() < 1e-15);
        }
        for f in mesh.faces() {
            let expected = mesh.area(f) / mesh.total_area() * count as f64;
            assert!((per_face[f.index()] - expected).abs() <= 1.0 + 1e-9, "{} {expected}", per_face[f.index()]);
        }
        // An integral over the surface, against the exact one: the mean of x over each face is that of its corners.
        let exact: f64 = mesh
            .faces()
            .map(|f| mesh.area(f) * mesh.face_positions(f).iter().map(|p| p.z).sum::<f64>() / 3.0)
            .sum::<f64>()
            / mesh.total_area();
        let sampled = points.iter().map(|it| it.position(&mesh).z).sum::<f64>() / count as f64;
        assert!((sampled - exact).abs() < 2e-3 * exact.abs(), "{sampled} {exact}");
    }

    #[test]
    fn parallel_squares() {
        let (low, high) = (graph(3, |_, _| 0.0), graph(5, |_, _| 0.25));
        let sampled = SurfaceDistance::between(&low, &high);
        assert!((sampled.hausdorff - 0.25).abs() < 1e-14);
        assert!((sampled.mean - 0.25).abs() < 1e-14);
        let proven = two_sided_bounds(&low, &high, 1e-3, &Monitor::silent()).unwrap();
        assert!((proven.lower - 0.25).abs() < 1e-15 && proven.upper <= 0.25 * 1.001, "{proven:?}");
    }

    #[test]
    fn a_surface_is_at_distance_zero_from_itself() {
        let mesh = graph(20, wave);
        assert!(SurfaceDistance::between(&mesh, &mesh).hausdorff < 1e-15);
        assert!(bounds(&mesh, &mesh, 0.01).upper < 1e-15);
    }

    /// The triangulations cross each other everywhere: halving alone would need 10⁶ pieces along every edge.
    #[test]
    fn flat_surfaces_that_coincide_are_found_out_soon() {
        let (one, other) = (graph(13, |_, _| 0.0), graph(8, |_, _| 0.0));
        let looks = AtomicUsize::new(0);
        // Halving needs 18 rounds to come below 1e-6 of the diagonal.
        let count = || looks.fetch_add(1, Ordering::Relaxed) > 16;
        let monitor = Monitor::new(&count, &|_, _| (), &|| 0.0);
        let found = two_sided_bounds(&one, &other, 0.01, &monitor).unwrap();
        assert!(found.upper < 1e-5, "{found:?}");
    }

    /// From a flat square to a hexagonal pyramid of height h over it the farthest point is the centre, which is no vertex
    /// of the square: its distance to the steepest faces, z = h (1 - x + y) and z = h (1 + x - y), is h / √(1 + 2 h²).
    #[test]
    fn the_farthest_point_may_lie_inside_a_face() {
        let h = 0.5;
        let pyramid = graph(2, |x, y| h * (1.0 - x.abs().max(y.abs())));
        let exact = h / (1.0 + 2.0 * h * h).sqrt();
        for resolution in [1e-1, 1e-2, 1e-3] {
            let flat = graph(1, |_, _| 0.0);
            let found = bounds(&flat, &pyramid, resolution);
            assert!(found.lower <= exact + 1e-15 && exact <= found.upper + 1e-15, "{found:?} {exact}");
            assert!(found.upper - found.lower <= resolution * found.lower);
            let back = bounds(&pyramid, &flat, resolution);
            assert!(back.lower == h && back.upper <= h * (1.0 + resolution), "{back:?}");
        }
    }

    #[test]
    fn bounds_hold_every_sampled_distance_and_violations_prove_their_absence() {
        let (from, to) = (graph(6, wave), graph(17, |x, y| wave(x, y) + 0.05 * (9.0 * x).cos()));
        let bvh = Bvh::new(&to);
        let (sampled, _) = one_sided(&from, &bvh);
        let proven = bounds(&from, &to, 0.01);
        assert!(sampled <= proven.upper && sampled >= 0.98 * proven.lower, "{sampled} {proven:?}");
        let find = |limit| violations(&from, &bvh, limit, 0.01, &Monitor::silent()).unwrap();
        assert_eq!(find(1.011 * proven.upper), []);
        for share in [0.99, 0.7, 0.3] {
            let limit = share * proven.lower;
            let places = find(limit);
            assert!(!places.is_empty());
            for place in &places {
                let again = bvh.closest(place.point);
                assert!((again.distance - place.distance).abs() < 1e-14);
                assert!(place.distance > 0.99 * limit);
                let (_, off) = closest_on_triangle(&place.point, &from.face_positions(place.face));
                assert!(off < 1e-28, "the place lies on its face");
            }
            // Every sample that is too far has a reported place nearby.
            for point in sample(&from, 2000).iter().map(|it| it.position(&from)) {
                if bvh.closest(point).distance > limit {
                    let near = places.iter().map(|it| (it.point - point).norm()).fold(f64::INFINITY, f64::min);
                    assert!(near < limit.max(4.0 * SPACING * from.bounds().diagonal()), "{near}");
                }
            }
        }
    }

    #[test]
    fn single_triangles_are_judged_like_whole_meshes() {
        let (from, to) = (graph(6, wave), graph(17, |x, y| wave(x, y) + 0.05 * (9.0 * x).cos()));
        let bvh = Bvh::new(&to);
        for limit in [0.02, 0.05, 0.1] {
            let bad: Vec<_> = violations(&from, &bvh, limit, 0.01, &Monitor::silent()).unwrap();
            for f in from.faces() {
                let within = is_within(from.face_positions(f), &bvh, limit, 0.01);
                assert_eq!(within, bad.iter().all(|it| it.face != f), "{f}");
            }
        }
        assert!(!is_within([Vec3::repeat(f64::NAN); 3], &bvh, 1.0, 0.01));
    }

    #[test]
    fn broken_positions_are_never_called_proven() {
        let good = graph(3, wave);
        let mut bad = good.clone();
        bad.positions_mut().as_mut_slice()[5].x = f64::NAN;
        let found = bounds(&bad, &good, 0.01);
        assert!(found.upper == f64::INFINITY, "{found:?}");
        let places = violations(&bad, &Bvh::new(&good), 1.0, 0.01, &Monitor::silent()).unwrap();
        assert!(!places.is_empty());
    }
}
