//! One level of the schedule: rounds of the optimiser with a growing hold on the source, and corrections until the promised
//! distance is proven.
use super::{
    DevelopError, Evaluator, Optimizer, Options,
    curvature::Curvature,
    curves::{Curves, Features, Networks, SourceCurves},
    fidelity::Fidelity,
    flatten,
    flow::{CurvedFlow, Flow},
    folded_edges,
    measure::RESOLUTION,
    metric::Metric,
    remesh, scaled,
    schedule::Settings,
    set_positions,
};
use crate::{
    geom::{Vec3, closest_on_triangle},
    mesh::{
        Bvh, Symmetries, TriMesh,
        distance::{Violation, sample_symmetrically, violations},
    },
    model::Round,
    numeric::{
        Cancelled, Monitor,
        optim::{Lbfgs, Levenberg, Limits, Outcome, Subgradient},
        sparse::SparseError,
    },
};

/// Half width of the dead zone over the promised deviation; the rest is left for the surface between samples.
const BAND: f64 = 0.98;
/// Most corrections after the last round of the last level, and the growth of the weight of places found too far off.
const CORRECTIONS: usize = 20;
const GROWTH: f64 = 3.0;
/// Largest such weight: more makes the problem too stiff for the optimiser to move at all.
const HEAVIEST: f64 = 30.0;
/// Samples of the source per vertex of the moving mesh, besides the vertices of the source.
const SAMPLES: usize = 2;

/// Distance between a mesh and its image, over the diagonal, up to which that is a symmetry: what six digits in a file leave.
const SYMMETRIC: f64 = 1e-5;
/// Vertices of the source, spread over its list, that must lie on the source again.
const SYMMETRY_CHECKS: usize = 5000;

/// What stays the same over all levels.
pub(super) struct Job<'a> {
    pub(super) source: &'a TriMesh,
    pub(super) tree: &'a Bvh,
    /// Held curves of the source.
    pub(super) curves: &'a [Option<SourceCurves>],
    /// Curves of the mesh that the next level starts from.
    pub(super) networks: Networks,
    pub(super) options: &'a Options,
    pub(super) levels: usize,
    pub(super) monitor: &'a Monitor<'a>,
    pub(super) history: History<'a>,
}

/// The rounds of all levels.
pub(super) struct History<'a> {
    /// Those done, with their results.
    pub(super) rounds: Vec<Round>,
    /// Those of an earlier run of the same job: they are taken as they are.
    pub(super) done: &'a [Round],
    /// Hears of all rounds after each that was computed.
    pub(super) keep: &'a dyn Fn(&[Round]),
}

/// What one level works on. Its unit of length is the mean edge length at its start.
struct Level<'a> {
    /// Length of the unit, mm.
    unit: f64,
    index: usize,
    settings: Settings,
    /// Coordinates of the vertices.
    x: Vec<f64>,
    mesh: TriMesh,
    /// Those of the mesh at its start that are also the source's.
    symmetries: Symmetries,
    evaluator: Evaluator,
    solver: Solver,
    hold: Option<Fidelity<'a>>,
    curves: Option<Curves<'a>>,
}

/// An optimiser and what it needs to know of the connectivity.
enum Solver {
    Lbfgs,
    LbfgsH2(Metric),
    Subgradient,
    Levenberg(Box<Curvature>),
}

impl Solver {
    fn new(optimizer: Optimizer, mesh: &TriMesh, groups: &[[u32; 4]]) -> Result<Self, SparseError> {
        Ok(match optimizer {
            Optimizer::Lbfgs => Self::Lbfgs,
            Optimizer::LbfgsH2 => Self::LbfgsH2(Metric::new(mesh)?),
            Optimizer::Subgradient => Self::Subgradient,
            Optimizer::Levenberg | Optimizer::Auto => Self::Levenberg(Box::new(Curvature::new(mesh, groups)?)),
        })
    }
}

/// A state of the mesh, in mm, that was checked.
struct Checked {
    mesh: TriMesh,
    energy: f64,
    folds: usize,
    /// Places of the result, and of the source, that are not proven to be near enough.
    outward: Vec<Violation>,
    inward: Vec<Violation>,
}

impl Checked {
    fn violations(&self) -> usize {
        self.outward.len() + self.inward.len()
    }

    fn keeps_promises(&self) -> bool {
        self.folds == 0 && self.violations() == 0
    }

    /// Fewer folds before fewer violations before a lower energy.
    fn better_than(&self, other: &Self) -> bool {
        let shape = (self.folds, self.violations()).cmp(&(other.folds, other.violations()));
        shape.then(self.energy.total_cmp(&other.energy)).is_lt()
    }
}

/// How boldly the optimiser moves.
#[derive(Clone, Copy, PartialEq)]
enum Stride {
    /// Towards lower energy.
    Free,
    /// Only to mend what is wrong: a long step would open new places.
    Careful,
}

impl<'a> Job<'a> {
    /// Optimises one level; start and result in mm. On the last level the result is the best state that was checked.
    pub(super) fn level(&mut self, start: &TriMesh, index: usize) -> Result<TriMesh, DevelopError> {
        let mended = self.mended(start);
        let mut level = self.prepare(mended.as_ref().unwrap_or(start), index)?;
        let last = index == self.levels;
        let mut best: Option<Checked> = None;
        for round in 0..self.options.rounds_on(index, self.levels) {
            self.report(index, round);
            if let Some(mesh) = (round > 0).then(|| self.mended(&scaled(&level.mesh, level.unit))).flatten() {
                level = self.prepare(&mesh, index)?;
            }
            level.set(Settings::of(self.options, [index, self.levels], round))?;
            if last {
                // σ from 1, which hardly differs from the plain energy, to what was asked for.
                let share = if self.options.rounds > 1 { round as f64 / (self.options.rounds - 1) as f64 } else { 1.0 };
                level.evaluator.set_robust(self.options.facet.map(|sigma| sigma.powf(share)));
            }
            self.run(&mut level, Stride::Free)?;
            if last && self.options.fidelity {
                self.take_stock(&mut level, &mut best, 1.0)?;
            }
        }
        if last && self.options.fidelity {
            let mut factor = 1.0;
            for _ in 0..CORRECTIONS {
                if best.as_ref().is_none_or(Checked::keeps_promises) {
                    break;
                }
                factor = HEAVIEST.min(factor * GROWTH);
                self.run(&mut level, Stride::Careful)?;
                self.take_stock(&mut level, &mut best, factor)?;
            }
        }
        Ok(best.map_or_else(|| scaled(&level.mesh, level.unit), |it| it.mesh))
    }

    /// The mesh (mm) with its bad triangles mended, where that is wanted and needed.
    fn mended(&mut self, mesh: &TriMesh) -> Option<TriMesh> {
        let Options { boundary, features, remesh, fidelity, max_deviation, .. } = *self.options;
        if !remesh || features != Features::Free {
            return None;
        }
        let mesh = remesh::mend(mesh, self.tree, if fidelity { BAND * max_deviation } else { f64::INFINITY })?;
        self.networks = Networks::new(&mesh, boundary, features);
        Some(mesh)
    }

    fn report(&self, level: usize, round: usize) {
        // Each level has four times the faces of the one before.
        let share = |level: usize| 4.0_f64.powi(level as i32 - self.levels as i32 - 1);
        let rounds = self.options.rounds_on(level, self.levels);
        let done = share(level) + (share(level + 1) - share(level)) * round as f64 / rounds as f64;
        self.monitor.progress(done, &format!("level {level} of {}, round {}", self.levels, round + 1));
    }

    fn prepare(&self, start: &TriMesh, index: usize) -> Result<Level<'a>, DevelopError> {
        let unit = start.mean_edge_length();
        let mesh = scaled(start, 1.0 / unit);
        let settings = Settings::of(self.options, [index, self.levels], 0);
        let evaluator = Evaluator::new(&mesh, settings.energy, settings.weights);
        let band = BAND * settings.max_deviation / unit;
        let curves =
            Curves::new(if self.options.fidelity { self.curves } else { &[] }, &self.networks, &mesh, unit, band);
        let groups = curves.as_ref().map_or(&[][..], Curves::groups);
        let solver = Solver::new(settings.optimizer, &mesh, groups)?;
        let hold = self.options.fidelity.then(|| {
            let samples = sample_symmetrically(self.source, SAMPLES * mesh.vertex_count());
            let points = samples.iter().map(|it| it.position(self.source));
            let points: Vec<Vec3> = points.chain(self.source.positions().iter().copied()).collect();
            Fidelity::new(self.tree, &points, &mesh, unit, band, settings.hold)
        });
        let symmetries = self.symmetries(start);
        Ok(Level { unit, index, settings, x: flatten(&mesh), mesh, symmetries, evaluator, solver, hold, curves })
    }

    /// The symmetries that `start` (mm) and the source have in common. What the flow does to symmetric places is alike but
    /// for rounding, which it would blow up.
    fn symmetries(&self, start: &TriMesh) -> Symmetries {
        let tolerance = SYMMETRIC * self.source.bounds().diagonal();
        let positions = self.source.positions().as_slice();
        let step = (positions.len() / SYMMETRY_CHECKS).max(1);
        Symmetries::of(start, tolerance, |motion| {
            let near = |p: &Vec3| self.tree.is_within(motion.of(p), tolerance);
            positions.iter().step_by(step).all(near)
        })
    }

    /// One run of the optimiser, recorded, or taken from the record. Either way the state afterwards depends on nothing but
    /// the mesh in the record and what was sampled, so that a run that goes on from a record gives the same bytes.
    fn run(&mut self, level: &mut Level, stride: Stride) -> Result<(), DevelopError> {
        let History { rounds, done, keep } = &mut self.history;
        let recorded = done.get(rounds.len()).filter(|it| it.mesh.is_some() && it.faces == level.mesh.face_count());
        let round = match recorded {
            Some(round) => round.clone(),
            None => level.round(stride, self.monitor)?,
        };
        if let Some(mesh) = &round.mesh {
            level.mesh = scaled(mesh, 1.0 / level.unit);
            level.x = flatten(&level.mesh);
        }
        if let Some(hold) = &mut level.hold {
            hold.settle(&level.x);
        }
        if let Some(curves) = &mut level.curves {
            curves.settle(&level.x);
        }
        rounds.push(round);
        if recorded.is_none() {
            keep(rounds);
        }
        Ok(())
    }

    /// Checks the state, keeps it if it is the best, and adds the places that are too far off to the samples.
    fn take_stock(&self, level: &mut Level, best: &mut Option<Checked>, factor: f64) -> Result<(), DevelopError> {
        let checked = self.check(level)?;
        if let Some(hold) = &mut level.hold {
            let on_faces: Vec<_> = checked
                .outward
                .iter()
                .map(|it| {
                    let corners = level.mesh.face_positions(it.face);
                    (it.face, closest_on_triangle(&(it.point / level.unit), &corners).0)
                })
                .collect();
            let points: Vec<Vec3> = checked.inward.iter().map(|it| it.point).collect();
            hold.follow(&level.mesh);
            hold.add_outward(&on_faces, factor);
            hold.add_inward(&points, factor);
        }
        if best.as_ref().is_none_or(|best| checked.better_than(best)) {
            *best = Some(checked);
        }
        Ok(())
    }

    fn check(&self, level: &mut Level) -> Result<Checked, DevelopError> {
        let mesh = scaled(&level.mesh, level.unit);
        let limit = self.options.max_deviation;
        let outward = violations(&mesh, self.tree, limit, RESOLUTION, self.monitor)?;
        let inward = violations(self.source, &Bvh::new(&mesh), limit, RESOLUTION, self.monitor)?;
        let parts = level.evaluator.evaluate(&level.x, &mut vec![0.0; level.x.len()]);
        let energy = parts.energy + parts.relief;
        Ok(Checked { energy, folds: folded_edges(&mesh).len(), outward, inward, mesh })
    }
}

impl Level<'_> {
    /// Prepares for a round that may differ from the one before.
    fn set(&mut self, settings: Settings) -> Result<(), DevelopError> {
        let Settings { energy, weights, optimizer, max_deviation, hold: weight, pull, .. } = settings;
        if energy.name != self.settings.energy.name || weights != self.settings.weights {
            self.evaluator = Evaluator::new(&self.mesh, energy, weights);
        }
        if optimizer != self.settings.optimizer {
            let groups = self.curves.as_ref().map_or(&[][..], Curves::groups);
            self.solver = Solver::new(optimizer, &self.mesh, groups)?;
        }
        if let Some(hold) = &mut self.hold {
            (hold.band, hold.weight) = (BAND * max_deviation / self.unit, weight);
            hold.pull = pull * self.evaluator.evaluate(&self.x, &mut vec![0.0; self.x.len()]).energy;
        }
        self.curves.iter_mut().for_each(|it| it.set_weight(weight));
        self.settings = settings;
        Ok(())
    }

    /// Runs the optimiser.
    fn round(&mut self, stride: Stride, monitor: &Monitor) -> Result<Round, Cancelled> {
        let mut gradient = vec![0.0; self.x.len()];
        let seconds = monitor.seconds();
        let before = self.evaluator.evaluate(&self.x, &mut gradient);
        let outcome = self.minimize(stride, monitor)?;
        let after = self.evaluator.evaluate(&self.x, &mut gradient);
        set_positions(&mut self.mesh, &self.x);
        Ok(Round {
            level: self.index,
            correction: stride == Stride::Careful,
            mesh: Some(scaled(&self.mesh, self.unit)),
            energy: self.settings.energy.name.to_owned(),
            vertices: self.mesh.vertex_count(),
            faces: self.mesh.face_count(),
            energy_start: before.energy,
            energy_end: after.energy,
            gradient_norm: outcome.gradient_norm,
            iterations: outcome.iterations,
            evaluations: outcome.evaluations,
            seconds: monitor.seconds() - seconds,
            stopped: outcome.stop.to_string(),
        })
    }

    fn minimize(&mut self, stride: Stride, monitor: &Monitor) -> Result<Outcome, Cancelled> {
        /// Largest component of the first step of solvers that know no length, in edges.
        const FIRST_STEP: f64 = 0.1;
        let settings = self.settings;
        let careful = stride == Stride::Careful;
        let gradient = settings.gradient * (self.x.len() as f64).sqrt();
        let limits = |usual: usize, few: usize, window: usize| {
            let iterations = settings.iterations.unwrap_or(usual);
            let iterations = if careful { iterations.min(few) } else { iterations };
            Limits { iterations, gradient, decrease: settings.decrease, window }
        };
        let mut flow =
            Flow::new(&mut self.evaluator, self.hold.as_mut(), self.curves.as_mut(), &self.mesh, &self.symmetries);
        let x = &mut self.x;
        match &self.solver {
            Solver::Lbfgs => Lbfgs::default().minimize(&mut flow, x, None, FIRST_STEP, &limits(300, 40, 60), monitor),
            Solver::LbfgsH2(metric) => {
                let apply = |v: &mut [f64]| metric.apply_inverse(v);
                Lbfgs::default().minimize(&mut flow, x, Some(&apply), FIRST_STEP, &limits(100, 20, 30), monitor)
            }
            Solver::Subgradient => {
                Subgradient::new(FIRST_STEP).minimize(&mut flow, x, &limits(1000, 100, 150), monitor)
            }
            Solver::Levenberg(curvature) => {
                let mut flow = CurvedFlow { flow, curvature, mesh: self.mesh.clone() };
                let (damping, longest_step) = if careful { (1.0, 0.1) } else { (1e-2, 0.7) };
                Levenberg { damping, longest_step }.minimize(
                    &mut flow,
                    x,
                    &mut curvature.matrix(),
                    &curvature.analysis,
                    &limits(if settings.last { 22 } else { 20 }, 3, 8),
                    monitor,
                )
            }
        }
    }
}
