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

const NONE: u32 = u32::MAX;
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
    chart: &'a Chart,
    metric: &'a Metric,
    /// Row of each interior vertex; `NONE` on the boundary.
    row: Vec<u32>,
    /// The interior vertices.
    interior: Vec<u32>,
    factor: Cholesky,
    clamp: f64,
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
        let mut out = Self { chart, metric, row, interior, factor, clamp, log_factor: vec![0.0; chart.vertex_count()] };
        let sums = angle_sums(metric, chart);
        let mut u: Vec<f64> = out.interior.iter().map(|&v| sums[v as usize] - std::f64::consts::TAU).collect();
        out.factor.solve_in_place(&mut u);
        for (&v, u) in out.interior.iter().zip(u) {
            out.log_factor[v as usize] = u;
        }
        Ok(out)
    }

    /// Log conformal factor u per local vertex; 0 on the boundary.
    pub fn log_factor(&self) -> &[f64] {
        &self.log_factor
    }

    /// Exterior angles of the flat boundary, k̃ = k + (A u)_B, per local vertex (0 in the interior). On a disk they sum
    /// to 2π.
    pub fn exterior_angles(&self) -> Vec<f64> {
        let sums = angle_sums(self.metric, self.chart);
        let mut out: Vec<f64> = (0..self.chart.vertex_count())
            .map(|v| if self.chart.on_boundary[v] { std::f64::consts::PI - sums[v] } else { 0.0 })
            .collect();
        for (h, i, j) in self.chart.halfedges() {
            let flux = self.weight(h) * (self.log_factor[i as usize] - self.log_factor[j as usize]);
            for (v, sign) in [(i, 1.0), (j, -1.0)] {
                if self.chart.on_boundary[v as usize] {
                    out[v as usize] += sign * flux;
                }
            }
        }
        out
    }

    /// Plane coordinates per local vertex, mm: the best-fit closed curve with the new exterior angles (lengths changed
    /// least in the sense of Σ (l̃ − l)² / l, section 5.3), then both coordinates extended harmonically.
    pub fn flatten(&self) -> Result<Vec<Vec2>, FlattenError> {
        if !self.chart.is_disk() {
            return Err(FlattenError::NotADisk {
                face: self.chart.faces[0],
                loops: self.chart.loops.len(),
                euler: self.chart.euler_characteristic(),
            });
        }
        let mut uv = self.boundary_curve();
        self.extend(&mut uv);
        Ok(uv)
    }

    /// The flat boundary; the interior is left at 0.
    pub fn boundary_curve(&self) -> Vec<Vec2> {
        let exterior = self.exterior_angles();
        let path = &self.chart.loops[0];
        let mut angle = 0.0;
        let tangents: Vec<Vec2> = path
            .iter()
            .map(|&(_, v)| {
                angle += exterior[v as usize];
                Vec2::new(f64::cos(angle), f64::sin(angle))
            })
            .collect();
        let lengths: Vec<f64> = path.iter().map(|&(h, _)| self.metric.length[h]).collect();
        // l̃ = l − diag(l) Tᵀ (T diag(l) Tᵀ)⁻¹ T l, T the 2 × B matrix of tangents.
        let mut gap = Vec2::zeros();
        let mut gram = nalgebra::Matrix2::zeros();
        for (t, &l) in tangents.iter().zip(&lengths) {
            gap += t * l;
            gram += t * t.transpose() * l;
        }
        let correction = gram.try_inverse().map_or(Vec2::zeros(), |inverse| inverse * gap);
        let mut uv = vec![Vec2::zeros(); self.chart.vertex_count()];
        let mut at = Vec2::zeros();
        for ((&(_, v), t), l) in path.iter().zip(&tangents).zip(&lengths) {
            uv[v as usize] = at;
            at += t * (l * (1.0 - t.dot(&correction)));
        }
        uv
    }

    /// Extends the boundary values of `uv` harmonically: A_II x_I = −A_IB x_B for both coordinates.
    fn extend(&self, uv: &mut [Vec2]) {
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

    fn weight(&self, h: HalfedgeId) -> f64 {
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
pub fn polished(metric: &Metric, chart: &Chart, mut uv: Vec<Vec2>, limit: Limit) -> FlatDomain {
    let excess = Isometry::new(metric, chart).polish(&mut uv, limit.stretch, limit.allowed);
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
