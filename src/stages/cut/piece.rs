//! One piece on trial: its chart, its log factors, its flat outline and what is wrong with it.
use super::Options;
use crate::{
    geom::Vec2,
    surface::{
        chart::{Chart, Metric},
        flatten::{FlattenError, Flattener},
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
    /// Flat outline, in the order of the chart's loop; empty while the log factor exceeds the limit.
    pub(super) outline: Vec<Vec2>,
    /// Pairs of outline edges that cross, touch, or enclose less than the least opening. Edge i starts at point i.
    pub(super) conflicts: Vec<(usize, usize)>,
}

impl Piece {
    /// Flattens a chart as far as needed to judge it.
    pub(super) fn new(metric: &Metric, chart: Chart, options: &Options) -> Result<Self, FlattenError> {
        let flattener = Flattener::new(metric, &chart)?;
        let (log_factor, max_log_factor) = (flattener.log_factor().to_vec(), flattener.max_log_factor());
        let (mut outline, mut conflicts) = (Vec::new(), Vec::new());
        if max_log_factor <= options.stretch && chart.is_disk() {
            let exterior = flattener.exterior_angles();
            let uv = flattener.boundary_curve();
            let path = &chart.loops[0];
            outline = path.iter().map(|&(_, v)| uv[v as usize]).collect();
            conflicts = close_edges(&outline, options.clearance);
            let n = path.len();
            for (i, &(_, v)) in path.iter().enumerate() {
                if exterior[v as usize] + std::f64::consts::PI < options.least_opening {
                    conflicts.push(((i + n - 1) % n, i));
                }
            }
        }
        Ok(Self { chart, log_factor, max_log_factor, outline, conflicts })
    }

    /// Whether it may be cut out as it is.
    pub(super) fn is_good(&self) -> bool {
        !self.outline.is_empty() && self.conflicts.is_empty()
    }
}
