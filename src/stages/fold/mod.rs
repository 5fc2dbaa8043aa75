//! Curved folding: a flat sheet with creases is folded by a few handles (Rabinovich, Hoffmann, Sorkine-Hornung 2019,
//! "Modeling curved folding with freeform deformations"). Which crease is mountain and which is valley comes out of it.
//!
//! Every patch between creases is a discrete orthogonal geodesic net of its own over one common grid ([`net`]); a sequential
//! quadratic program moves them together ([`solve`]). Inside the kernel the mean edge of the grid is 1.
pub mod figures;
pub mod kkt;
pub mod motion;
pub mod net;
mod sheet;
pub mod solve;
pub mod stage;
pub mod terms;

#[cfg(test)]
mod tests;

use crate::{
    geom::{Vec2, Vec3},
    mesh::TriMesh,
    model::{CreasePattern, FoldFrame, FoldSample, Folded, FoldedCrease, Held},
    numeric::{Cancelled, Monitor},
};
pub use sheet::pieces;

use motion::Pull;
use net::{Degenerate, Grid, Net, crowded};
use sheet::Sheet;
use solve::{Handle, Solver};
use terms::{Dihedral, FoldPoint};

/// Plain options of the kernel.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// How fine the nets are.
    pub resolution: Resolution,
    /// What the handles do.
    pub pulls: Vec<Pull>,
    /// Per crease: 1 where it must be a mountain, −1 for a valley, 0 where it finds out.
    pub sides: Vec<f64>,
    /// Steps on the way that are kept.
    pub kept_frames: usize,
    /// Of the solver, but for the limit of the handles.
    pub solver: solve::Options,
    /// Largest miss of a handle, as a share of the diagonal of the paper.
    pub handle_limit: f64,
}

/// How fine the nets are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Resolution {
    /// About so many vertices in all nets.
    Vertices(usize),
    /// About this edge, mm.
    Edge(f64),
}

/// Why a sheet could not be folded.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FoldError {
    /// A handle is not on the paper.
    #[error("{name} at ({x:.2}, {y:.2}) mm is not on the paper; the paper reaches from ({:.2}, {:.2}) to ({:.2}, {:.2}) mm", low[0], low[1], high[0], high[1])]
    OffPaper {
        /// What it is.
        name: String,
        /// Where.
        x: f64,
        /// Where.
        y: f64,
        /// Lower left corner of the paper.
        low: [f64; 2],
        /// Upper right corner.
        high: [f64; 2],
    },
    /// Nothing pulls.
    #[error("nothing folds the sheet: set fold.motion, or name handles in [[fold.handle]]")]
    NoHandles,
    /// A place of the sheet is outside of its net.
    #[error(
        "the net of patch {patch} does not reach ({x:.3}, {y:.3}) mm: a patch narrower than a cell of {edge:.2} mm; set more fold.vertices"
    )]
    Uncovered {
        /// The patch.
        patch: usize,
        /// Where.
        x: f64,
        /// Where.
        y: f64,
        /// Mean edge, mm.
        edge: f64,
    },
    /// The system of a step cannot be solved.
    #[error("the step at iteration {iteration} cannot be computed")]
    Step {
        /// Iteration.
        iteration: usize,
        /// Why.
        source: crate::numeric::sparse::SparseError,
    },
    /// The run was interrupted.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// Folds `sheet`, the flat mesh of the paper of `pattern`, along its creases.
pub fn fold(
    pattern: &CreasePattern,
    sheet: &TriMesh,
    options: &Options,
    monitor: &Monitor<'_>,
) -> Result<Folded, FoldError> {
    let net = lay(pattern, options.resolution);
    let unit = net.grid.edge;
    let sheet = Sheet::new(pattern, sheet, &net)?;
    let size = pattern.bounds().size();
    let solver_options =
        solve::Options { handle_limit: options.handle_limit * size.norm() / unit, ..options.solver.clone() };
    let (handles, held) = handles(pattern, &net, &options.pulls)?;
    let folds = FoldPoint::all(&net);
    let targets = dihedrals(&net, &folds, &options.pulls);
    if handles.is_empty() && targets.is_empty() {
        return Err(FoldError::NoHandles);
    }
    let mut solver = Solver::new(&net, &solver_options, handles, targets)?;
    for (k, it) in folds.iter().enumerate() {
        solver.sides[k] = options.sides.get(net.points[it.point].crease).copied().unwrap_or(0.0);
    }
    let frames = options.solver.frames.max(1);
    let every = frames.div_ceil(options.kept_frames.max(1));
    let mut kept = Vec::new();
    let start = monitor.seconds();
    solver.run(monitor, &mut |frame, solver, _| {
        if frame % every == 0 && frame < frames {
            kept.push(FoldFrame { share: frame as f64 / frames as f64, points: sheet.at(&solver.x, unit) });
        }
    })?;
    kept.push(FoldFrame { share: 1.0, points: sheet.at(&solver.x, unit) });
    Ok(Folded {
        edge: unit,
        vertices: net.flat.len(),
        frames: kept,
        creases: creases(pattern, &net, &solver.x),
        handles: held.into_iter().zip(solver.misses()).map(|(it, miss)| Held { miss: miss * unit, ..it }).collect(),
        figures: solver.figures(),
        iterations: solver.iterations,
        seconds: monitor.seconds() - start,
        crowded: crowded(pattern, &net.grid),
    })
}

/// Attempts at a number of vertices.
const ATTEMPTS: usize = 6;
/// Other edges that are tried, as factors, for a grid that leaves out fewer crease points.
const OTHERS: [f64; 9] = [1.0, 0.99, 1.01, 0.98, 1.02, 0.97, 1.03, 0.96, 1.04];
/// Share of the crease points left out from which other grids are tried.
const MANY: f64 = 0.05;

/// The nets.
fn lay(pattern: &CreasePattern, resolution: Resolution) -> Net {
    let (mut edge, wanted) = match resolution {
        Resolution::Edge(edge) => return Net::new(pattern, Grid::over(pattern, edge)),
        Resolution::Vertices(count) => {
            let area: f64 = pattern.patches.iter().map(|it| crate::geom::polygon::area(it)).sum();
            ((area / count as f64).sqrt(), count as f64)
        }
    };
    let lay = |edge: f64| Net::new(pattern, Grid::over(pattern, edge));
    for _ in 0..ATTEMPTS {
        let ratio = lay(edge).flat.len() as f64 / wanted;
        edge *= ratio.sqrt();
        if ratio.ln().abs() < 0.02 {
            break;
        }
    }
    let left_out = |net: &Net| {
        let points = net.crease_points() - net.excluded(Degenerate::Straight);
        (net.excluded(Degenerate::Split) + net.excluded(Degenerate::Angle)) as f64 / points.max(1) as f64
    };
    let mut best: Option<(f64, Net)> = None;
    for factor in OTHERS {
        let net = lay(edge * factor);
        let share = left_out(&net);
        if best.as_ref().is_none_or(|it| share < it.0) {
            best = Some((share, net));
        }
        if share <= MANY {
            break;
        }
    }
    best.expect("there is at least one attempt").1
}

/// The handles of the solver, and how they are called.
fn handles(pattern: &CreasePattern, net: &Net, pulls: &[Pull]) -> Result<(Vec<Handle>, Vec<Held>), FoldError> {
    let bounds = pattern.bounds();
    let on_net = |name: &str, p: Vec2| {
        let nearest = sheet::nearest_patch(pattern, p, 1e-6 * bounds.size().norm());
        let form = nearest.and_then(|(patch, p)| net.locate(patch, p, p).or_else(|| net.nearest(patch, p)));
        form.ok_or_else(|| FoldError::OffPaper {
            name: name.into(),
            x: p.x,
            y: p.y,
            low: bounds.min.into(),
            high: bounds.max.into(),
        })
    };
    let (mut handles, mut held) = (Vec::new(), Vec::new());
    for (k, pull) in pulls.iter().enumerate() {
        match pull {
            Pull::Point { at, to } => {
                let name = format!("handle {}", k + 1);
                let form = on_net(&name, *at)?.to_vec();
                let axes = Vec3::from_fn(|p, _| f64::from(to[p].is_some()));
                let target = Vec3::from_fn(|p, _| to[p].unwrap_or(0.0)) / net.grid.edge;
                handles.push(Handle { form, target, axes });
                held.push(Held { name, flat: *at, miss: 0.0 });
            }
            Pull::Close { ends: [a, b] } => {
                let name = format!("closing {}", k + 1);
                let mut form = on_net(&name, *a)?.to_vec();
                form.extend(on_net(&name, *b)?.map(|(v, w)| (v, -w)));
                handles.push(Handle { form, target: Vec3::zeros(), axes: Vec3::repeat(1.0) });
                held.push(Held { name, flat: *a, miss: 0.0 });
            }
            Pull::Angle { .. } => {}
        }
    }
    Ok((handles, held))
}

/// The fold angles that are asked for, each at the fold point nearest to its place.
fn dihedrals(net: &Net, folds: &[FoldPoint], pulls: &[Pull]) -> Vec<Dihedral> {
    let target = |pull: &Pull| {
        let Pull::Angle { at, angle } = pull else { return None };
        let distance = |k: usize| (net.points[folds[k].point].flat * net.grid.edge - at).norm();
        let nearest = (0..folds.len()).min_by(|&a, &b| distance(a).total_cmp(&distance(b)))?;
        Some(Dihedral::new(folds, nearest, &net.flat, *angle))
    };
    pulls.iter().filter_map(target).collect()
}

/// What was found along the creases.
fn creases(pattern: &CreasePattern, net: &Net, x: &[Vec3]) -> Vec<FoldedCrease> {
    let unit = net.grid.edge;
    let of_patch = sheet::pieces_of_patches(pattern);
    let mut out: Vec<FoldedCrease> = pattern
        .creases
        .iter()
        .map(|it| FoldedCrease {
            points: it.points.clone(),
            closed: it.closed,
            patches: [it.left, it.right],
            piece: of_patch[it.left],
            samples: Vec::new(),
        })
        .collect();
    for (k, point) in net.points.iter().enumerate().filter(|it| it.1.degenerate != Some(Degenerate::Vertex)) {
        let Some(fold) = FoldPoint::at(net, k) else { continue };
        let excluded = point.degenerate.map_or("", Degenerate::why).to_owned();
        let [a, b] = [0, 1].map(|side| point.sides[side].at(x));
        let (along, angle) = (point.along * unit, fold.angle(x, point.leftward));
        let sample = FoldSample { along, flat: point.flat * unit, place: (a + b) * (0.5 * unit), angle, excluded };
        out[point.crease].samples.push(sample);
    }
    out
}
