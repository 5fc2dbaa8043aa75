//! Piecewise developable shapes: moves the vertices of a mesh until it is developable except along few seams.
//!
//! Minimises Σλ over vertex stars (Stein, Grinspun, Crane 2018) together with barriers that keep triangles buildable and a
//! dead zone around the source, coarse to fine over levels of 4–1 subdivision. Inside a level the mesh has mean edge
//! length 1, because the energy does not depend on scale but its gradient does.

mod barrier;
mod curvature;
mod curves;
pub mod energy;
mod evaluate;
mod fidelity;
mod flow;
mod level;
mod measure;
mod metric;
mod remesh;
mod robust;
mod schedule;
pub mod stage;
#[cfg(test)]
mod tests;

pub use barrier::Weights;
pub use curves::{Boundary, Features, Network};
pub use evaluate::{Evaluator, Parts};
pub use measure::{Crossings, Defects, Deviation, folded_edges, seam_length, smallest_angle};
pub use schedule::Override;

use crate::{
    geom::Vec3,
    mesh::{Bvh, FaceId, Field, MeshError, TriMesh},
    model::{DevelopableMesh, Round},
    numeric::{Cancelled, Monitor, sparse::SparseError},
    surface::subdivide,
};
use curves::Networks;
use energy::Energy;
use level::{History, Job};
use schedule::Settings;

/// How to minimise.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Optimizer {
    /// Levenberg–Marquardt for energies whose curvature is known, L-BFGS in a metric of second order for the others.
    Auto,
    /// L-BFGS with the Lewis–Overton line search: many cheap steps.
    Lbfgs,
    /// L-BFGS in a metric of second order: a good shape after very few steps, also of meshes with many vertices.
    LbfgsH2,
    /// Subgradient descent with Armijo's rule: slow, for comparison.
    Subgradient,
    /// Levenberg–Marquardt with variable projection: few expensive steps, a lower energy in the end. Only for energies
    /// whose curvature is known.
    Levenberg,
}

/// Options of [`develop`].
#[derive(Debug, Clone)]
pub struct Options {
    /// The developability energy.
    pub energy: &'static Energy,
    /// How to minimise it.
    pub optimizer: Optimizer,
    /// Largest distance between result and source, either way, mm.
    pub max_deviation: f64,
    /// Whether the flow is held to that distance; without, the distance is only measured.
    pub fidelity: bool,
    /// What is done with boundary curves.
    pub boundary: Boundary,
    /// What is done with feature edges.
    pub features: Features,
    /// σ of the robust loss σ ln(1 + λ/σ) at the end of the last level, annealed from 1; `None` for plain λ.
    pub facet: Option<f64>,
    /// Whether triangles that are not buildable may be mended between rounds by changing the connectivity. Never with held
    /// features.
    pub remesh: bool,
    /// Subdivisions; `None` until there are enough vertices.
    pub levels: Option<usize>,
    /// Rounds on the finest level, each with a stronger hold on the source; coarser levels have one.
    pub rounds: usize,
    /// Most steps per round; `None` for what the optimiser usually needs.
    pub iterations: Option<usize>,
    /// What some rounds do otherwise; of several that concern a round, later ones win.
    pub overrides: Vec<Override>,
}

/// Why there is no developable mesh.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum DevelopError {
    /// Interrupted.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// Subdivision found a face that its positions make degenerate.
    #[error("the mesh could not be subdivided at level {level}: {error}; use fewer levels (develop.levels)")]
    Subdivide {
        /// Levels done before.
        level: usize,
        /// What is wrong.
        error: MeshError,
    },
    /// No second derivatives.
    #[error(
        "round {round} of level {level}: \"levenberg\" knows no second derivatives of the energy \"{energy}\"; write optimizer = \"auto\" or \"lbfgs-h2\""
    )]
    NoCurvature {
        /// Name of the energy.
        energy: &'static str,
        /// The level, from 0.
        level: usize,
        /// Its round, from 1.
        round: usize,
    },
    /// The matrix of second derivatives could not be set up.
    #[error("{0}; use the optimiser \"lbfgs\" or a coarser mesh")]
    Sparse(#[from] SparseError),
    /// The energy of the start is not a number.
    #[error("the energy of the start is not a number; its thinnest face is {face} with an angle of {angle_deg:.2e}°, at ({:.6}, {:.6}, {:.6}) mm: coarsen or remesh the input first", place.x, place.y, place.z)]
    Degenerate {
        /// The face with the smallest angle.
        face: FaceId,
        /// That angle.
        angle_deg: f64,
        /// Where it lies.
        place: Vec3,
    },
}

/// Fewest vertices at which automatic levels stop subdividing, and the most that one more level may make.
const AUTO_VERTICES: [usize; 2] = [2500, 13_000];
/// σ of the metric of [`Optimizer::LbfgsH2`], at mean edge length 1: changes spread over about σ^−½ edges.
const SMOOTHING: f64 = 0.3;
/// Largest λ of any vertex below which a mesh counts as developable already: normals within about 1e-4 of a common plane,
/// which is what rounding to five or six digits in a file leaves of an exact one.
const DEVELOPABLE: f64 = 1e-8;

/// Distance of neighbouring samples of held curves over the promised deviation.
const CURVE_SPACING: f64 = 0.5;

/// Makes `start` piecewise developable near `source`. Both in mm.
///
/// The result never has a folded edge if the barriers can undo those of the start. Its distance to the source is at most
/// `options.max_deviation`, proven, unless that could not be reached: then it is the state that came closest
/// ([`Deviation`] says how close).
pub fn develop(
    source: &TriMesh,
    start: &TriMesh,
    options: &Options,
    monitor: &Monitor,
) -> Result<DevelopableMesh, DevelopError> {
    resume(source, start, options, &[], &|_| (), monitor)
}

/// [`develop`] that was interrupted: of the same arguments, `done` are the rounds that it had handed to `keep`, and which
/// are not computed again. After each further round `keep` hears of all rounds so far. The result is the same, bit for
/// bit, as without the interruption.
pub fn resume(
    source: &TriMesh,
    start: &TriMesh,
    options: &Options,
    done: &[Round],
    keep: &dyn Fn(&[Round]),
    monitor: &Monitor,
) -> Result<DevelopableMesh, DevelopError> {
    let finish = |mesh: TriMesh, rounds| {
        // Whatever the flow used: cutting and reports compare this one with their tolerances.
        let energy = Field::from_vec(energies(&mesh, &energy::COVARIANCE));
        DevelopableMesh { mesh, energy, max_deviation: options.max_deviation, rounds, tradeoffs: Vec::new() }
    };
    let at_start = energies(start, options.energy);
    if let Some(error) = degenerate(start, &at_start) {
        return Err(error);
    }
    if at_start.iter().all(|&lambda| lambda <= DEVELOPABLE) && folded_edges(start).is_empty() {
        return Ok(finish(start.clone(), vec![untouched(start, &at_start, options.energy)]));
    }
    let tree = Bvh::new(source);
    let levels = options.levels.unwrap_or_else(|| automatic_levels(start.vertex_count()));
    let networks = |mesh| Networks::new(mesh, options.boundary, options.features);
    let curves = networks(source).sources(source, CURVE_SPACING * options.max_deviation);
    Settings::check(options, levels)?;
    let history = History { rounds: Vec::new(), done, keep };
    let mut job =
        Job { source, tree: &tree, curves: &curves, networks: networks(start), options, levels, history, monitor };
    let mut mesh = start.clone();
    for level in 0..=levels {
        if level > 0 {
            job.networks = job.networks.subdivided(&mesh);
            mesh = subdivide(&mesh).map_err(|error| DevelopError::Subdivide { level: level - 1, error })?;
        }
        mesh = job.level(&mesh, level)?;
    }
    Ok(finish(mesh, job.history.rounds))
}

/// λ per vertex; 0 where the energy has no term.
fn energies(mesh: &TriMesh, energy: &'static Energy) -> Vec<f64> {
    let mut evaluator = Evaluator::new(mesh, energy, Weights::default());
    evaluator.evaluate(&flatten(mesh), &mut vec![0.0; 3 * mesh.vertex_count()]);
    evaluator.energies()
}

/// The thinnest face, if any λ is not a number.
fn degenerate(mesh: &TriMesh, energies: &[f64]) -> Option<DevelopError> {
    if energies.iter().all(|it| it.is_finite()) {
        return None;
    }
    let thinnest = mesh.halfedges().min_by(|&a, &b| mesh.corner_angle(a).total_cmp(&mesh.corner_angle(b)))?;
    let (face, place) = (mesh.face(thinnest), mesh.position(mesh.tail(thinnest)));
    Some(DevelopError::Degenerate { face, angle_deg: mesh.corner_angle(thinnest).to_degrees(), place })
}

/// The history of a mesh that needs no flow.
fn untouched(mesh: &TriMesh, energies: &[f64], energy: &Energy) -> Round {
    let sum = energies.iter().sum();
    Round {
        energy: energy.name.to_owned(),
        vertices: mesh.vertex_count(),
        faces: mesh.face_count(),
        energy_start: sum,
        energy_end: sum,
        stopped: "developable already".to_owned(),
        ..Round::default()
    }
}

fn automatic_levels(vertices: usize) -> usize {
    let [enough, most] = AUTO_VERTICES;
    let mut levels = 0;
    while vertices << (2 * levels) < enough && vertices << (2 * (levels + 1)) <= most {
        levels += 1;
    }
    levels
}

/// Coordinates, three per vertex.
fn flatten(mesh: &TriMesh) -> Vec<f64> {
    mesh.positions().iter().flat_map(|p| [p.x, p.y, p.z]).collect()
}

fn set_positions(mesh: &mut TriMesh, x: &[f64]) {
    for (p, x) in mesh.positions_mut().as_mut_slice().iter_mut().zip(x.as_chunks::<3>().0) {
        *p = Vec3::from(*x);
    }
}

fn scaled(mesh: &TriMesh, factor: f64) -> TriMesh {
    mesh.with_positions(Field::from_vec(mesh.positions().iter().map(|p| p * factor).collect()))
}
