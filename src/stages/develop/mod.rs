//! Piecewise developable shapes: moves the vertices of a mesh until it is developable except along few seams.
//!
//! Minimises Σλ over vertex stars (Stein, Grinspun, Crane 2018) together with barriers that keep triangles buildable and a
//! dead zone around the source, coarse to fine over levels of 4–1 subdivision. Inside a level the mesh has mean edge
//! length 1, because the energy does not depend on scale but its gradient does.

mod barrier;
pub mod energy;
mod evaluate;
mod fidelity;
mod flow;
mod measure;
pub mod stage;

pub use barrier::Weights;
pub use evaluate::{Evaluator, Parts};
pub use measure::{Defects, folded_edges, smallest_angle};

use crate::{
    geom::{Vec3, closest_on_triangle},
    mesh::{
        Bvh, FaceId, Field, MeshError, TriMesh,
        distance::{Violation, sample, violations},
    },
    model::{DevelopableMesh, Round},
    numeric::{
        Cancelled, Monitor,
        optim::{Lbfgs, Limits, Outcome},
    },
    surface::subdivide,
};
use energy::Energy;
use fidelity::Fidelity;
use flow::Flow;

/// Options of [`develop`].
#[derive(Debug, Clone)]
pub struct Options {
    /// The developability energy.
    pub energy: &'static Energy,
    /// Largest distance between result and source, either way, mm.
    pub max_deviation: f64,
    /// Whether the flow is held to that distance; without, the distance is only measured.
    pub fidelity: bool,
    /// Subdivisions; `None` until there are enough vertices.
    pub levels: Option<usize>,
    /// Rounds per level, each with a stronger hold on the source.
    pub rounds: usize,
    /// Most iterations per round.
    pub iterations: usize,
}

/// Why there is no developable mesh.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum DevelopError {
    /// Interrupted.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// Subdivision found a face that its positions make degenerate.
    #[error("the mesh could not be subdivided at level {level}: {error}")]
    Subdivide {
        /// Levels done before.
        level: usize,
        /// What is wrong.
        error: MeshError,
    },
    /// The energy of the start is not a number.
    #[error(
        "face {face} of the start is too thin to begin with (smallest angle {angle_deg:.2e}°); coarsen or remesh the input first"
    )]
    Degenerate {
        /// The face with the smallest angle.
        face: FaceId,
        /// That angle.
        angle_deg: f64,
    },
}

/// Fewest vertices at which automatic levels stop subdividing, and the most that one more level may make.
const AUTO_VERTICES: [usize; 2] = [2500, 13_000];
/// Half width of the dead zone over the promised deviation; the rest is left for the surface between samples.
const BAND: f64 = 0.92;
/// Weight of the fidelity term in the first and the last round of a level.
const HOLD: [f64; 2] = [3.0, 90.0];

/// Makes `start` piecewise developable near `source`. Both in mm.
pub fn develop(
    source: &TriMesh,
    start: &TriMesh,
    options: &Options,
    monitor: &Monitor,
) -> Result<DevelopableMesh, DevelopError> {
    let tree = Bvh::new(source);
    let levels = options.levels.unwrap_or_else(|| automatic_levels(start.vertex_count()));
    let mut job = Job { source, tree: &tree, options, monitor, rounds: Vec::new() };
    let mut mesh = start.clone();
    for level in 0..=levels {
        if level > 0 {
            mesh = subdivide(&mesh).map_err(|error| DevelopError::Subdivide { level: level - 1, error })?;
        }
        mesh = job.level(mesh, level, level == levels)?;
    }
    let mut evaluator = Evaluator::new(&mesh, options.energy, Weights::default());
    let x = flatten(&mesh, 1.0);
    evaluator.evaluate(&x, &mut vec![0.0; x.len()]);
    let energy = Field::from_vec(evaluator.energies());
    Ok(DevelopableMesh { mesh, energy, max_deviation: options.max_deviation, rounds: job.rounds })
}

fn automatic_levels(vertices: usize) -> usize {
    let [enough, most] = AUTO_VERTICES;
    let mut levels = 0;
    while vertices << (2 * levels) < enough && vertices << (2 * (levels + 1)) <= most {
        levels += 1;
    }
    levels
}

/// What stays the same over all levels.
struct Job<'a> {
    source: &'a TriMesh,
    tree: &'a Bvh,
    options: &'a Options,
    monitor: &'a Monitor<'a>,
    rounds: Vec<Round>,
}

/// A state of the mesh that was checked.
struct Checked {
    mesh: TriMesh,
    energy: f64,
    folds: usize,
    violations: usize,
}

impl Job<'_> {
    /// Optimises one level; `mesh` and the result are in mm.
    fn level(&mut self, mesh: TriMesh, level: usize, last: bool) -> Result<TriMesh, DevelopError> {
        let unit = mesh.mean_edge_length();
        let mut mesh = scaled(&mesh, 1.0 / unit);
        let shrink = 0.25_f64.powi(level as i32);
        let weights = Weights { angle: 3e-4 * shrink, fold: 0.01, defect: 0.1, area: 1e-4 * shrink };
        let mut evaluator = Evaluator::new(&mesh, self.options.energy, weights);
        let mut x = flatten(&mesh, 1.0);
        let deviation = self.options.max_deviation / unit;
        let points: Vec<Vec3> = sample(self.source, 2 * mesh.vertex_count())
            .iter()
            .map(|it| it.position(self.source))
            .chain(self.source.positions().iter().copied())
            .collect();
        let mut hold = None;
        for round in 0..self.options.rounds {
            let share = if self.options.rounds > 1 { round as f64 / (self.options.rounds - 1) as f64 } else { 1.0 };
            let weight = HOLD[0] * (HOLD[1] / HOLD[0]).powf(share);
            set_positions(&mut mesh, &x);
            hold =
                self.options.fidelity.then(|| Fidelity::new(self.tree, &points, &mesh, unit, BAND * deviation, weight));
            self.round(&mut evaluator, hold.as_mut(), &mut x, self.options.iterations)?;
        }
        set_positions(&mut mesh, &x);
        match hold {
            Some(hold) if last => self.enforce(mesh, unit, evaluator, hold, x),
            _ => Ok(scaled(&mesh, unit)),
        }
    }

    /// One run of the optimiser.
    fn round(
        &mut self,
        evaluator: &mut Evaluator,
        hold: Option<&mut Fidelity>,
        x: &mut [f64],
        iterations: usize,
    ) -> Result<(), DevelopError> {
        let limits = Limits { iterations, gradient: 1e-8, decrease: 3e-3, window: 20 };
        let mut gradient = vec![0.0; x.len()];
        let (seconds, before) = (self.monitor.seconds(), evaluator.evaluate(x, &mut gradient));
        let mut flow = Flow::new(evaluator, hold);
        let outcome: Outcome = Lbfgs::default().minimize(&mut flow, x, None, 0.1, &limits, self.monitor)?;
        let after = evaluator.evaluate(x, &mut gradient);
        self.rounds.push(Round {
            energy: self.options.energy.name.to_owned(),
            vertices: x.len() / 3,
            faces: evaluator.face_count(),
            energy_start: before.energy,
            energy_end: after.energy,
            gradient_norm: outcome.gradient_norm,
            iterations: outcome.iterations,
            evaluations: outcome.evaluations,
            seconds: self.monitor.seconds() - seconds,
            stopped: outcome.stop.to_string(),
        });
        Ok(())
    }

    /// Collects places that are proven or suspected to be too far off as samples of growing weight, until none is left.
    /// Keeps the best state seen: without violation before with, then the lower energy.
    fn enforce(
        &mut self,
        mut mesh: TriMesh,
        unit: f64,
        mut evaluator: Evaluator,
        mut hold: Fidelity,
        mut x: Vec<f64>,
    ) -> Result<TriMesh, DevelopError> {
        /// Rounds of collecting.
        const TRIES: usize = 10;
        let mut best: Option<Checked> = None;
        for attempt in 0..=TRIES {
            set_positions(&mut mesh, &x);
            let (checked, outward, inward) = self.check(&mesh, unit, &mut evaluator, &x)?;
            let fine = checked.violations == 0 && checked.folds == 0;
            let better = best.as_ref().is_none_or(|best| {
                (checked.folds, checked.violations)
                    .cmp(&(best.folds, best.violations))
                    .then(checked.energy.total_cmp(&best.energy))
                    .is_lt()
            });
            if better {
                best = Some(checked);
            }
            if fine || attempt == TRIES {
                break;
            }
            let factor = 1.0 + attempt as f64;
            hold.refresh(&x);
            let on_faces: Vec<_> = outward
                .iter()
                .map(|it| (it.face, closest_on_triangle(&(it.point / unit), &mesh.face_positions(it.face)).0))
                .collect();
            hold.follow(&mesh);
            hold.add_outward(&on_faces, factor);
            hold.add_inward(&inward.iter().map(|it| it.point).collect::<Vec<_>>(), factor);
            self.round(&mut evaluator, Some(&mut hold), &mut x, 30)?;
        }
        Ok(best.expect("the first attempt always sets it").mesh)
    }

    /// Measures a state; also the violations on either side.
    fn check(
        &self,
        mesh: &TriMesh,
        unit: f64,
        evaluator: &mut Evaluator,
        x: &[f64],
    ) -> Result<(Checked, Vec<Violation>, Vec<Violation>), DevelopError> {
        const RESOLUTION: f64 = 0.02;
        let full = scaled(mesh, unit);
        let limit = self.options.max_deviation;
        let outward = violations(&full, self.tree, limit, RESOLUTION, self.monitor)?;
        let inward = violations(self.source, &Bvh::new(&full), limit, RESOLUTION, self.monitor)?;
        let energy = evaluator.evaluate(x, &mut vec![0.0; x.len()]).energy;
        let checked =
            Checked { energy, folds: folded_edges(&full).len(), violations: outward.len() + inward.len(), mesh: full };
        Ok((checked, outward, inward))
    }
}

fn flatten(mesh: &TriMesh, factor: f64) -> Vec<f64> {
    mesh.positions().iter().flat_map(|p| [p.x * factor, p.y * factor, p.z * factor]).collect()
}

fn set_positions(mesh: &mut TriMesh, x: &[f64]) {
    for (p, x) in mesh.positions_mut().as_mut_slice().iter_mut().zip(x.as_chunks::<3>().0) {
        *p = Vec3::from(*x);
    }
}

fn scaled(mesh: &TriMesh, factor: f64) -> TriMesh {
    mesh.with_positions(Field::from_vec(mesh.positions().iter().map(|p| p * factor).collect()))
}
