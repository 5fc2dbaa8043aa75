//! Boundary-first flattening (Sawhney, Crane 2017) with the isometric boundary: log factor u = 0 on it, so that mating
//! seams keep their length in space. One factorisation of the interior Laplacian serves everything.
//!
//! Notation: A the cotangent Laplacian (positive semidefinite) split into interior I and boundary B; K the angle defect
//! of an interior vertex, k = π − Σ angles the exterior angle of a boundary vertex; l boundary edge lengths.
use super::{
    chart::{Chart, ChartBuilder, Metric},
    isometric::{Excess, Isometry},
    paths::{EdgeGraph, joining_tree},
};
use crate::{
    geom::Vec2,
    mesh::{EdgeId, FaceId, Field, HalfedgeId, VertexId},
    numeric::sparse::{Analysis, Cholesky, SparseError, SymmetricMatrix},
};

pub(super) const NONE: u32 = u32::MAX;
/// Least weight of an edge, as a share of the mean |weight|, when the true weights cannot be factored.
const CLAMPED_WEIGHT: f64 = 1e-6;

/// Why a chart cannot be flattened.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FlattenError {
    /// Not a disk: closed, or with several boundary loops.
    #[error(
        "the piece around face {face} is not a disk: it has {loops} boundary loops and Euler characteristic {euler}"
    )]
    NotADisk {
        /// Its first face.
        face: FaceId,
        /// Boundary loops.
        loops: usize,
        /// V − E + F.
        euler: i64,
    },
    /// Several boundary loops, and not flat as it is.
    #[error(
        "the piece around face {face} has holes and does not lie flat as it is: cut open, its sides lie {gap:.3} mm apart at vertex {vertex}"
    )]
    DoesNotClose {
        /// Its first face.
        face: FaceId,
        /// A vertex that would have to be in two places.
        vertex: VertexId,
        /// Their distance, mm.
        gap: f64,
    },
    /// Exterior angles that no closed curve has.
    #[error(
        "the exterior angles and cones asked for on the piece around face {face} sum to {given:.6} rad, but {needed:.6} are needed (Gauss–Bonnet): {:+.6} are missing",
        needed - given
    )]
    GaussBonnet {
        /// First face of the piece.
        face: FaceId,
        /// Their sum, radians.
        given: f64,
        /// 2π times the Euler characteristic.
        needed: f64,
    },
    /// The exterior angles asked for leave no curve of about the lengths asked for that closes.
    #[error(
        "no closed curve has the exterior angles and lengths asked for: the edge at vertex {vertex} would have to be {share:.3} times as long"
    )]
    NoCurve {
        /// The vertex that it leaves.
        vertex: VertexId,
        /// Its length over the one asked for; not positive.
        share: f64,
    },
    /// Too few corners for straight sides.
    #[error(
        "the piece around face {face} has {found} corners, and straight sides need 3: lower flatten.corner or use flatten.outline = \"isometric\""
    )]
    TooFewCorners {
        /// First face of the piece.
        face: FaceId,
        /// Corners found.
        found: usize,
    },
    /// A cone that no slit leads to.
    #[error("the cone of {curvature:.4} rad at vertex {vertex} is not opened: no slit leads to it")]
    ClosedCone {
        /// Where.
        vertex: VertexId,
        /// Its curvature, radians.
        curvature: f64,
    },
    /// The Laplacian could not be factored even with clamped weights.
    #[error("the Laplacian of the piece around face {face} cannot be factored near vertex {vertex}: {source}")]
    Laplacian {
        /// First face of the piece.
        face: FaceId,
        /// Vertex of the failing row.
        vertex: VertexId,
        /// What the solver said.
        source: SparseError,
    },
}

/// The interior Laplacian A_II of a chart before it is factored.
#[derive(Debug)]
pub struct InteriorLaplacian {
    /// Row of each interior vertex; `u32::MAX` on the boundary.
    pub row: Vec<u32>,
    /// The interior vertices, by row.
    pub interior: Vec<u32>,
    /// A_II.
    pub matrix: SymmetricMatrix,
    /// For each halfedge of the chart the values of `matrix` that its weight goes into: the diagonal entries of tail and
    /// head, and the entry of both; `u32::MAX` for none.
    slots: Vec<[u32; 3]>,
}

impl InteriorLaplacian {
    /// With the true weights.
    pub fn new(metric: &Metric, chart: &Chart) -> Self {
        let mut row = vec![NONE; chart.vertex_count()];
        let mut interior = Vec::new();
        for v in (0..chart.vertex_count()).filter(|&v| !chart.on_boundary[v]) {
            row[v] = interior.len() as u32;
            interior.push(v as u32);
        }
        let inner = |i: u32, j: u32| row[i as usize] != NONE && row[j as usize] != NONE;
        let pairs: Vec<(u32, u32)> = chart
            .halfedges()
            .filter(|&(_, i, j)| inner(i, j))
            .map(|(_, i, j)| (row[i as usize], row[j as usize]))
            .collect();
        let (matrix, offdiagonal) = SymmetricMatrix::with_pattern(interior.len(), &pairs);
        let mut offdiagonal = offdiagonal.into_iter();
        let diagonal = |v: u32| if row[v as usize] == NONE { NONE } else { matrix.diagonal_slot(row[v as usize]) };
        let slots = chart
            .halfedges()
            .map(|(_, i, j)| {
                let both = if inner(i, j) { offdiagonal.next() } else { None };
                [diagonal(i), diagonal(j), both.unwrap_or(NONE)]
            })
            .collect();
        let mut out = Self { row, interior, matrix, slots };
        out.set_weights(metric, chart, f64::NEG_INFINITY);
        out
    }

    /// Every halfedge weight at least `clamp`.
    fn set_weights(&mut self, metric: &Metric, chart: &Chart, clamp: f64) {
        let values = self.matrix.values_mut();
        values.fill(0.0);
        for ((h, _, _), slots) in chart.halfedges().zip(&self.slots) {
            let weight = weight(metric, h).max(clamp);
            for (&slot, sign) in slots.iter().zip([1.0, 1.0, -1.0]) {
                if slot != NONE {
                    values[slot as usize] += sign * weight;
                }
            }
        }
    }
}

/// The interior Laplacian of a chart, factored, and the log factors that follow from the isometric boundary.
#[derive(Debug)]
pub struct Flattener<'a> {
    pub(super) chart: &'a Chart,
    pub(super) metric: &'a Metric,
    /// Row of each interior vertex; `NONE` on the boundary.
    pub(super) row: Vec<u32>,
    /// The interior vertices.
    pub(super) interior: Vec<u32>,
    pub(super) factor: Cholesky,
    clamp: f64,
    /// Sum of the corner angles at each local vertex.
    pub(super) angle_sum: Vec<f64>,
    log_factor: Vec<f64>,
}

impl<'a> Flattener<'a> {
    /// Factors A_II and solves A_II u_I = −K_I. The chart may have any number of components and loops as long as each
    /// component has a boundary. This alone tells the largest |u| of all pieces at once.
    pub fn new(metric: &'a Metric, chart: &'a Chart) -> Result<Self, FlattenError> {
        let mut laplacian = InteriorLaplacian::new(metric, chart);
        let refuse = |source: SparseError, laplacian: &InteriorLaplacian| {
            let vertex = match source {
                SparseError::NotPositiveDefinite { index } | SparseError::NotFinite { row: index, .. } => {
                    laplacian.interior[index]
                }
                SparseError::TooLarge { .. } => 0,
            };
            FlattenError::Laplacian { face: chart.faces[0], vertex: chart.origin[vertex as usize], source }
        };
        let analysis = Analysis::new(&laplacian.matrix).map_err(|source| refuse(source, &laplacian))?;
        // Weights of either sign are right, but next to slivers rounding can cost definiteness: then all weights are
        // raised to a small positive one, which makes the matrix an M-matrix.
        let (clamp, factor) = match analysis.factor(&laplacian.matrix) {
            Ok(factor) => (f64::NEG_INFINITY, factor),
            Err(_) => {
                let sum: f64 = chart.halfedges().map(|it| weight(metric, it.0).abs().min(1e3)).sum();
                let clamp = CLAMPED_WEIGHT * sum / (3.0 * chart.faces.len() as f64);
                laplacian.set_weights(metric, chart, clamp);
                (clamp, analysis.factor(&laplacian.matrix).map_err(|source| refuse(source, &laplacian))?)
            }
        };
        let InteriorLaplacian { row, interior, .. } = laplacian;
        let (angle_sum, log_factor) = (angle_sums(metric, chart), vec![0.0; chart.vertex_count()]);
        let mut u: Vec<f64> = interior.iter().map(|&v| angle_sum[v as usize] - std::f64::consts::TAU).collect();
        let mut out = Self { chart, metric, row, interior, factor, clamp, angle_sum, log_factor };
        out.factor.solve_in_place(&mut u);
        for (&v, u) in out.interior.iter().zip(u) {
            out.log_factor[v as usize] = u;
        }
        // The rule is the isometric boundary; where other lengths are asked for, u is not 0 on it.
        if chart.boundary_edges().any(|(h, ..)| metric.rim[h] != metric.length[h]) {
            let lengths: Vec<f64> = chart.boundary_edges().map(|(h, ..)| metric.rim[h]).collect();
            out.log_factor = out.with_lengths(&lengths, &[]).log_factor;
        }
        Ok(out)
    }

    /// Log conformal factor u per local vertex; 0 on the boundary unless [`Metric::rim`] asks for other lengths.
    pub fn log_factor(&self) -> &[f64] {
        &self.log_factor
    }

    /// Exterior angles of the flat boundary, k̃ = k + (A u)_B, per local vertex (0 in the
    /// interior). On a disk they sum to 2π.
    pub fn exterior_angles(&self) -> Vec<f64> {
        self.exterior_angles_of(&self.log_factor)
    }

    pub(super) fn exterior_angles_of(&self, log_factor: &[f64]) -> Vec<f64> {
        let mut out: Vec<f64> = (0..self.chart.vertex_count())
            .map(|v| if self.chart.on_boundary[v] { std::f64::consts::PI - self.angle_sum[v] } else { 0.0 })
            .collect();
        self.add_flux(self.chart, log_factor, &mut out);
        out
    }

    /// The same in a chart of the same faces that may be opened further.
    pub(super) fn exterior_angles_in(&self, chart: &Chart, log_factor: &[f64]) -> Vec<f64> {
        let sums = angle_sums(self.metric, chart);
        let angle = |v: usize| if chart.on_boundary[v] { std::f64::consts::PI - sums[v] } else { 0.0 };
        let mut out: Vec<f64> = (0..chart.vertex_count()).map(angle).collect();
        self.add_flux(chart, log_factor, &mut out);
        out
    }

    /// Adds (A x)_B.
    pub(super) fn add_flux(&self, chart: &Chart, x: &[f64], out: &mut [f64]) {
        for (h, i, j) in chart.halfedges() {
            let flux = self.weight(h) * (x[i as usize] - x[j as usize]);
            for (v, sign) in [(i, 1.0), (j, -1.0)] {
                if chart.on_boundary[v as usize] {
                    out[v as usize] += sign * flux;
                }
            }
        }
    }

    /// Plane coordinates per local vertex with the boundary lengths of [`Metric::rim`], mm: the best-fit closed curve with the new exterior
    /// angles (lengths changed least in the sense of Σ (l̃ − l)² / l, section 5.3), then both coordinates extended
    /// harmonically.
    pub fn flatten(&self) -> Result<Vec<Vec2>, FlattenError> {
        self.refuse_unless_disk(self.chart)?;
        let exterior = self.exterior_angles();
        let path = &self.chart.loops[0];
        let corners: Vec<(u32, f64)> = path.iter().map(|&(_, v)| (v, exterior[v as usize])).collect();
        let lengths: Vec<f64> = path.iter().map(|&(h, _)| self.metric.rim[h]).collect();
        let groups: Vec<usize> = (0..path.len()).collect();
        let mut uv = self.closed_curve(self.chart, &corners, &lengths, &groups)?;
        self.extend(&mut uv);
        Ok(uv)
    }

    pub(super) fn refuse_unless_disk(&self, chart: &Chart) -> Result<(), FlattenError> {
        if chart.is_disk() {
            return Ok(());
        }
        let (loops, euler) = (chart.loops.len(), chart.euler_characteristic());
        Err(FlattenError::NotADisk { face: chart.faces[0], loops, euler })
    }

    /// Extends the boundary values of `uv` harmonically: A_II x_I = −A_IB x_B for both coordinates.
    pub(super) fn extend(&self, uv: &mut [Vec2]) {
        let n = self.interior.len();
        let mut columns = vec![0.0; 2 * n];
        for (h, i, j) in self.chart.halfedges() {
            let weight = self.weight(h);
            for (from, to) in [(i, j), (j, i)] {
                let row = self.row[to as usize];
                if row != NONE && self.row[from as usize] == NONE {
                    columns[row as usize] += weight * uv[from as usize].x;
                    columns[n + row as usize] += weight * uv[from as usize].y;
                }
            }
        }
        self.factor.solve_in_place(&mut columns);
        for (k, &v) in self.interior.iter().enumerate() {
            uv[v as usize] = Vec2::new(columns[k], columns[n + k]);
        }
    }

    pub(super) fn weight(&self, h: HalfedgeId) -> f64 {
        weight(self.metric, h).max(self.clamp)
    }
}

/// A planar domain in the plane.
#[derive(Debug, Clone, PartialEq)]
pub struct FlatDomain {
    /// Plane coordinates per local vertex, mm.
    pub uv: Vec<Vec2>,
    /// Log scale per local vertex: the mean of ½ ln (area ratio) around it.
    pub log_factor: Vec<f64>,
    /// Flat interior angle per local vertex on the boundary, radians; 0 in the interior.
    pub interior_angle: Vec<f64>,
    /// How far it is from the limit of stretch.
    pub excess: Excess,
}

/// Flattens a connected chart with any number of boundary loops, made by `builder` with `cut`, and polishes it to a
/// limit ([`Isometry::polish`]). Several loops are
/// joined by slits, the disk that leaves is flattened, and the slits are welded: where their sides lie further apart than
/// `weld` (mm) the chart does not lie flat as it is, which is an error.
pub fn flatten_domain(
    builder: &mut ChartBuilder,
    metric: &Metric,
    chart: &Chart,
    cut: &impl Fn(EdgeId) -> bool,
    weld: f64,
    limit: Limit,
) -> Result<FlatDomain, FlattenError> {
    if chart.loops.len() <= 1 {
        return Ok(polished(metric, chart, Flattener::new(metric, chart)?.flatten()?, limit));
    }
    let mesh = builder.mesh();
    let length = Field::from_fn(mesh.edge_count(), |e| metric.length[mesh.halfedge(e)]);
    let mut slits: Vec<EdgeId> = joining_tree(&EdgeGraph::new(mesh, chart, &length), &chart.loop_of_vertices())
        .into_iter()
        .map(|h| mesh.edge(h))
        .collect();
    slits.sort_unstable();
    let disk = builder.chart(chart.faces.clone(), &|e| cut(e) || slits.binary_search(&e).is_ok());
    let flat = Flattener::new(metric, &disk)?.flatten()?;
    let mut uv = vec![Vec2::repeat(f64::NAN); chart.vertex_count()];
    for (&v, &copy) in chart.corners.iter().flatten().zip(disk.corners.iter().flatten()) {
        let (v, copy) = (v as usize, copy as usize);
        let gap = (uv[v] - flat[copy]).norm();
        if gap > weld {
            return Err(FlattenError::DoesNotClose { face: chart.faces[0], vertex: chart.origin[v], gap });
        }
        // The first copy stands for all: the others lie within the tolerance.
        if gap.is_nan() {
            uv[v] = flat[copy];
        }
    }
    Ok(polished(metric, chart, uv, limit))
}

/// What a layout is polished to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limit {
    /// Limit of the principal stretch max |ln σ| of a triangle.
    pub stretch: f64,
    /// Share of the area that may exceed it.
    pub allowed: f64,
}

impl Limit {
    /// For all but a thousandth of the area: single slivers do not decide.
    pub fn new(stretch: f64) -> Self {
        Self { stretch, allowed: 0.001 }
    }
}

/// A layout polished to `limit` and measured.
pub fn polished(metric: &Metric, chart: &Chart, uv: Vec<Vec2>, limit: Limit) -> FlatDomain {
    polished_as(metric, chart, &Isometry::new(metric, chart), uv, limit)
}

/// The same with the boundary lengths that `isometry` asks for.
pub fn polished_as(metric: &Metric, chart: &Chart, isometry: &Isometry, mut uv: Vec<Vec2>, limit: Limit) -> FlatDomain {
    let excess = isometry.polish(&mut uv, limit.stretch, limit.allowed);
    measured(metric, chart, uv, excess)
}

/// A layout as it is, measured; `excess` says how far it is from its limit.
pub fn measured(metric: &Metric, chart: &Chart, uv: Vec<Vec2>, excess: Excess) -> FlatDomain {
    let n = chart.vertex_count();
    let (mut interior_angle, mut log_factor, mut areas) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
    for (&f, corners) in chart.faces.iter().zip(&chart.corners) {
        let flat = corners.map(|v| uv[v as usize]);
        let ratio = crate::geom::signed_area(&flat) / metric.area[f];
        for k in 0..3 {
            let v = corners[k] as usize;
            let (next, last) = (flat[(k + 1) % 3] - flat[k], flat[(k + 2) % 3] - flat[k]);
            if chart.on_boundary[v] {
                interior_angle[v] += f64::atan2(crate::geom::cross2(next, last), next.dot(&last));
            }
            areas[v] += metric.area[f];
            log_factor[v] += metric.area[f] * 0.5 * ratio.max(f64::MIN_POSITIVE).ln();
        }
    }
    for (sum, area) in log_factor.iter_mut().zip(areas) {
        *sum /= area;
    }
    FlatDomain { uv, log_factor, interior_angle, excess }
}

/// Share of one face in the weight of an edge.
fn weight(metric: &Metric, h: HalfedgeId) -> f64 {
    0.5 * metric.cotangent[h]
}

/// Sum of the corner angles at each local vertex.
fn angle_sums(metric: &Metric, chart: &Chart) -> Vec<f64> {
    let mut sums = vec![0.0; chart.vertex_count()];
    for (h, i, _) in chart.halfedges() {
        sums[i as usize] += metric.angle[h];
    }
    sums
}
