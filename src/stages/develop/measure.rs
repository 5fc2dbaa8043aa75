//! What makes a mesh buildable or not, in numbers.
use crate::{
    geom::{Vec3, closest_on_segment},
    mesh::{
        Bvh, EdgeId, TriMesh, VertexId,
        distance::{SurfaceDistance, Violation, two_sided_bounds, violations},
        intersections::{Intersection, self_intersections},
    },
    model::DevelopableMesh,
    numeric::Monitor,
};

/// Cosine between neighbouring normals below which an edge counts as folded.
pub(super) const FOLDED: f64 = -0.5;

/// Share by which a proven distance may exceed the true one.
pub(super) const RESOLUTION: f64 = 0.005;

const NEVER_CANCELLED: &str = "a silent monitor never cancels";

/// Edges whose two faces turn by more than 120°.
pub fn folded_edges(mesh: &TriMesh) -> Vec<EdgeId> {
    mesh.edges().filter(|&e| mesh.dihedral_cosine(e).is_some_and(|cosine| cosine < FOLDED)).collect()
}

/// Length of the edges both of whose ends have an energy above `tolerance`.
pub fn seam_length(result: &DevelopableMesh, tolerance: f64) -> f64 {
    let on_seam = |v: VertexId| result.energy[v] > tolerance;
    let seams = result.mesh.edges().filter(|&e| result.mesh.edge_vertices(e).into_iter().all(on_seam));
    seams.map(|e| result.mesh.edge_length(e)).fold(0.0, |sum, length| sum + length)
}

/// Smallest corner angle, radians.
pub fn smallest_angle(mesh: &TriMesh) -> f64 {
    mesh.halfedges().map(|h| mesh.corner_angle(h)).fold(f64::INFINITY, f64::min)
}

/// Angle defects of the interior vertices.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Defects {
    /// Σ|K| over interior vertices of valence 3, which the energy leaves free.
    pub skipped: f64,
    /// Median of |K|.
    pub median: f64,
    /// Largest |K|.
    pub max: f64,
    /// Share of Σ|K| that the top 5 % of the vertices hold.
    pub top5_share: f64,
}

impl Defects {
    /// Measures them; all zero when there is no interior vertex.
    pub fn of(mesh: &TriMesh) -> Self {
        let interior = |v: &VertexId| !mesh.is_boundary_vertex(*v);
        let skipped = mesh
            .vertices()
            .filter(|v| interior(v) && mesh.face_degree(*v) <= 3)
            .map(|v| mesh.angle_defect(v).abs())
            .fold(0.0, |sum, k| sum + k);
        let mut all: Vec<f64> = mesh.vertices().filter(interior).map(|v| mesh.angle_defect(v).abs()).collect();
        all.sort_unstable_by(|a, b| b.total_cmp(a));
        let sum: f64 = all.iter().sum();
        let top: f64 = all[..all.len().div_ceil(20)].iter().sum();
        Self {
            skipped,
            median: all.get(all.len() / 2).copied().unwrap_or(0.0),
            max: all.first().copied().unwrap_or(0.0),
            top5_share: if sum > 0.0 { top / sum } else { 0.0 },
        }
    }
}

/// How far a result is from its source. mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Deviation {
    /// No point of either surface is farther from the other: proven, not sampled.
    pub bound: f64,
    /// Largest distance of 50 000 samples and all vertices of each surface.
    pub hausdorff: f64,
    /// Mean distance of those samples.
    pub mean: f64,
    /// The place farthest beyond the limit asked for, and whether it lies on the result (else on the source).
    pub worst: Option<(Violation, bool)>,
}

impl Deviation {
    /// Measures it and compares it with `limit`. The bound is at most 0.5 % above the true distance, and at most `limit` where
    /// that could be proven.
    pub fn between(source: &TriMesh, result: &TriMesh, limit: f64) -> Self {
        let (to_source, to_result, monitor) = (Bvh::new(source), Bvh::new(result), Monitor::silent());
        let find = |from, to, on_result: bool| {
            let found = violations(from, to, limit, RESOLUTION, &monitor).expect(NEVER_CANCELLED);
            found.into_iter().map(move |it| (it, on_result))
        };
        let all = find(result, &to_source, true).chain(find(source, &to_result, false));
        let worst = all.max_by(|a, b| a.0.distance.total_cmp(&b.0.distance));
        let upper = two_sided_bounds(source, result, RESOLUTION, &monitor).expect(NEVER_CANCELLED).upper;
        let sampled = SurfaceDistance::between(source, result);
        Self {
            bound: if worst.is_none() { upper.min(limit) } else { upper },
            hausdorff: sampled.hausdorff,
            mean: sampled.mean,
            worst,
        }
    }
}

/// Where a surface passes through itself.
#[derive(Debug, Clone, PartialEq)]
pub struct Crossings {
    /// Pairs of intersecting faces of the source.
    pub of_source: usize,
    /// Pairs of intersecting faces of the result.
    pub of_result: usize,
    /// Those of the result that lie nowhere near one of the source: made on the way.
    pub made: Vec<Intersection>,
}

impl Crossings {
    /// Measures them. A pair counts as inherited within twice the distance that either surface may have moved, because both
    /// of its sheets may have.
    pub fn between(source: &TriMesh, result: &TriMesh, moved: f64) -> Self {
        let inherited = self_intersections(source, &Bvh::new(source));
        let found = self_intersections(result, &Bvh::new(result));
        let near = |place: Vec3, it: &Intersection| {
            let [a, b] = it.stretch;
            closest_on_segment(&(place - a), &(b - a)).1 <= (2.0 * moved).powi(2)
        };
        let of_result = found.len();
        let made = found.into_iter().filter(|it| !inherited.iter().any(|old| near(it.place(), old))).collect();
        Self { of_source: inherited.len(), of_result, made }
    }
}
