//! One piece on trial: its chart, its log factors, its flat outline and what is wrong with it.
use super::{Options, sheet::too_far_apart};
use crate::{
    geom::Vec2,
    mesh::{EdgeId, HalfedgeId, TriMesh},
    surface::{
        chart::{Chart, ChartBuilder, Metric},
        flatten::{FlattenError, Flattener, flatten_domain},
        overlap::close_edges,
    },
};

/// A piece and how it would lie.
#[derive(Debug, Clone)]
pub(super) struct Piece {
    /// What it is made of.
    pub(super) chart: Chart,
    /// Log factor per local vertex.
    pub(super) log_factor: Vec<f64>,
    /// Largest |log factor|.
    pub(super) max_log_factor: f64,
    /// Flat contours, in the order of the chart's loops; empty while the log factor exceeds the limit, or when the chart
    /// does not lie flat as it is.
    pub(super) contours: Vec<Vec<Vec2>>,
    /// Pairs of contour edges that cross, touch, enclose less than the least opening, or lie too far apart for the sheet.
    /// Edge i starts at point i, counted through all contours.
    pub(super) conflicts: Vec<(usize, usize)>,
}

impl Piece {
    /// Judges a connected chart with at least one loop, as far as needed: the log factor first, then the outline of a disk,
    /// and only for a chart with holes the whole domain.
    pub(super) fn new(
        builder: &mut ChartBuilder,
        metric: &Metric,
        chart: Chart,
        cut: &impl Fn(EdgeId) -> bool,
        options: &Options,
    ) -> Result<Self, FlattenError> {
        let flattener = Flattener::new(metric, &chart)?;
        let (log_factor, max_log_factor) = (flattener.log_factor().to_vec(), flattener.max_log_factor());
        let mut flat = None;
        if max_log_factor <= options.stretch {
            flat = if chart.is_disk() {
                Some((flattener.boundary_curve(), flattener.interior_angles()))
            } else {
                match flatten_domain(builder, metric, &chart, cut, options.clearance) {
                    Ok(domain) => Some((domain.uv, domain.interior_angle)),
                    Err(FlattenError::DoesNotClose { .. }) => None,
                    Err(error) => return Err(error),
                }
            };
        }
        let (mut contours, mut conflicts) = (Vec::new(), Vec::new());
        if let Some((uv, angles)) = flat {
            contours = chart.loops.iter().map(|path| path.iter().map(|&(_, v)| uv[v as usize]).collect()).collect();
            conflicts = close_edges(&contours, options.clearance);
            let mut first = 0;
            for path in &chart.loops {
                let n = path.len();
                for (i, &(_, v)) in path.iter().enumerate() {
                    if angles[v as usize] > std::f64::consts::TAU - options.least_opening {
                        conflicts.push((first + (i + n - 1) % n, first + i));
                    }
                }
                first += n;
            }
            if let Some(size) = options.sheet {
                conflicts.extend(too_far_apart(&contours[0], size));
            }
        }
        Ok(Self { chart, log_factor, max_log_factor, contours, conflicts })
    }

    /// Whether it may be cut out as it is.
    pub(super) fn is_good(&self) -> bool {
        !self.contours.is_empty() && self.conflicts.is_empty()
    }

    /// Cut edges both of whose sides lie on this piece and within `clearance` of each other in the plane.
    pub(super) fn closed_slits(&self, mesh: &TriMesh, clearance: f64) -> Vec<EdgeId> {
        let mut sides: Vec<(HalfedgeId, [Vec2; 2])> = Vec::new();
        for (path, contour) in self.chart.loops.iter().zip(&self.contours) {
            let n = path.len();
            sides.extend((0..n).map(|i| (path[i].0, [contour[i], contour[(i + 1) % n]])));
        }
        sides.sort_unstable_by_key(|it| it.0);
        let mut out = Vec::new();
        for &(h, [a, b]) in &sides {
            let Some(twin) = mesh.twin(h).filter(|&it| it > h) else { continue };
            let Ok(k) = sides.binary_search_by_key(&twin, |it| it.0) else { continue };
            let [c, d] = sides[k].1;
            if (a - d).norm() < clearance && (b - c).norm() < clearance {
                out.push(mesh.edge(h));
            }
        }
        out
    }
}
