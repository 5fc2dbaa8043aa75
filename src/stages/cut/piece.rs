//! One piece on trial: its chart, its log factors, its flat outline and what is wrong with it.
use super::{Options, sheet::too_far_apart};
use crate::{
    geom::{
        Vec2,
        neck::{Neck, necks},
        polygon::strip_width,
    },
    mesh::{EdgeId, HalfedgeId, TriMesh},
    surface::{
        chart::{Chart, ChartBuilder, Metric},
        flatten::{FlattenError, Flattener, Limit, flatten_domain, polished},
        isometric::Isometry,
        overlap::close_edges,
    },
};

/// A piece is laid flat and polished when all but the allowed share of its area has |u| within so many times the limit:
/// the polish spreads what the conformal map piles up.
const POLISHABLE: f64 = 3.0;

/// A piece and how it would lie.
#[derive(Debug, Clone)]
pub(super) struct Piece {
    /// What it is made of.
    pub(super) chart: Chart,
    /// Its area in space, mm².
    pub(super) area: f64,
    /// How wide it is as a strip, mm.
    pub(super) width: f64,
    /// Log factor u of the conformal map per local vertex.
    pub(super) log_factor: Vec<f64>,
    /// Area of the faces around each local vertex that exceed the limit although polished; empty where it was not tried or
    /// succeeded.
    pub(super) excess: Vec<f64>,
    /// Flat contours, in the order of the chart's loops; empty where the stretch exceeds the limit, or when the chart
    /// does not lie flat as it is.
    pub(super) contours: Vec<Vec<Vec2>>,
    /// Pairs of contour edges that cross, touch, enclose less than the least opening, or lie too far apart for the sheet.
    /// Edge i starts at point i, counted through all contours.
    pub(super) conflicts: Vec<(usize, usize)>,
    /// Where it hangs together by less than the least neck; only of one that is good.
    pub(super) necks: Vec<Neck>,
}

impl Piece {
    /// Judges a connected chart with at least one loop by `limit`, as far as needed: the log factor first, then the
    /// polished layout.
    pub(super) fn new(
        builder: &mut ChartBuilder,
        metric: &Metric,
        chart: Chart,
        cut: &impl Fn(EdgeId) -> bool,
        options: &Options,
        limit: Limit,
    ) -> Result<Self, FlattenError> {
        let flattener = Flattener::new(metric, &chart)?;
        let log_factor = flattener.log_factor().to_vec();
        let near = share_above(metric, &chart, &log_factor, POLISHABLE * options.stretch) <= limit.allowed;
        let disk = if near && chart.is_disk() { Some(flattener.flatten()?) } else { None };
        let area = chart.faces.iter().map(|&f| metric.area[f]).sum();
        let mut out = Self {
            width: strip_width(area, chart.boundary_edges().map(|(h, ..)| metric.length[h]).sum()),
            chart,
            area,
            log_factor,
            excess: Vec::new(),
            contours: Vec::new(),
            conflicts: Vec::new(),
            necks: Vec::new(),
        };
        let chart = &out.chart;
        if !near {
            return Ok(out);
        }
        let flat = if let Some(uv) = disk {
            // The polish moves the outline by little: what crosses itself before will cross itself after.
            let contours = chart.contours(&uv);
            let crossing = close_edges(&contours, f64::MIN_POSITIVE);
            if !crossing.is_empty() {
                (out.contours, out.conflicts) = (contours, crossing);
                return Ok(out);
            }
            polished(metric, chart, uv, limit)
        } else {
            match flatten_domain(builder, metric, chart, cut, options.clearance, limit) {
                Ok(domain) => domain,
                Err(FlattenError::DoesNotClose { .. }) => return Ok(out),
                Err(error) => return Err(error),
            }
        };
        if flat.excess.is_within(limit.allowed) {
            let contours = chart.contours(&flat.uv);
            out.conflicts = conflicts(chart, &contours, &flat.interior_angle, options);
            if out.conflicts.is_empty() {
                out.necks = necks(&contours, options.min_neck);
            }
            out.contours = contours;
        } else {
            out.excess = excess(metric, chart, &flat.uv, options.stretch);
        }
        Ok(out)
    }

    /// Whether it may be cut out as it is.
    pub(super) fn is_good(&self) -> bool {
        !self.contours.is_empty() && self.conflicts.is_empty()
    }

    /// Where an edge of its outline lies; `None` for any other, or where the piece does not lie flat.
    pub(super) fn flat_edge(&self, h: HalfedgeId) -> Option<[Vec2; 2]> {
        self.chart.loops.iter().zip(&self.contours).find_map(|(path, contour)| {
            let i = path.iter().position(|it| it.0 == h)?;
            Some([contour[i], contour[(i + 1) % contour.len()]])
        })
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

fn conflicts(chart: &Chart, contours: &[Vec<Vec2>], angle: &[f64], options: &Options) -> Vec<(usize, usize)> {
    let mut out = close_edges(contours, options.clearance);
    let mut first = 0;
    for path in &chart.loops {
        let n = path.len();
        for (i, &(_, v)) in path.iter().enumerate() {
            if angle[v as usize] > std::f64::consts::TAU - options.least_opening {
                out.push((first + (i + n - 1) % n, first + i));
            }
        }
        first += n;
    }
    if let Some(size) = options.sheet {
        out.extend(too_far_apart(&contours[0], size));
    }
    out
}

/// Area of the faces around each local vertex that exceed the limit.
fn excess(metric: &Metric, chart: &Chart, uv: &[Vec2], stretch: f64) -> Vec<f64> {
    let isometry = Isometry::new(metric, chart);
    let mut out = vec![0.0; chart.vertex_count()];
    for (k, corners) in chart.corners.iter().enumerate() {
        if isometry.principal_stretch(k, uv) > stretch {
            for &v in corners {
                out[v as usize] += metric.area[chart.faces[k]];
            }
        }
    }
    out
}

/// Share of the area in faces whose mean |u| exceeds `limit`.
fn share_above(metric: &Metric, chart: &Chart, log_factor: &[f64], limit: f64) -> f64 {
    let (mut above, mut total) = (0.0, 0.0);
    for (&f, corners) in chart.faces.iter().zip(&chart.corners) {
        total += metric.area[f];
        if corners.iter().map(|&v| log_factor[v as usize]).sum::<f64>().abs() > 3.0 * limit {
            above += metric.area[f];
        }
    }
    above / total
}
