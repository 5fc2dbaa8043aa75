//! Guided projection of a net onto its constraints (Tang, Sun, Gomes, Wallner, Pottmann 2014; §5 of the paper).
use super::{
    NetError,
    system::{Builder, Family, Pull, System, Weights},
};
use crate::{
    geom::Vec3,
    mesh::Bvh,
    model::GeodesicNet,
    numeric::{Monitor, sparse::SparseError},
};

/// Where a point of the net should go.
#[derive(Debug, Clone, PartialEq)]
pub struct Handle {
    /// Row and column of the point.
    pub at: [usize; 2],
    /// The places that it passes, mm, the last of which is its target; at least one. All handles are on the way for the same
    /// time, and each takes the same time between any two of its places.
    pub path: Vec<Vec3>,
}

impl Handle {
    /// A handle that goes straight to its target.
    pub fn to(at: [usize; 2], target: Vec3) -> Self {
        Self { at, path: vec![target] }
    }

    /// Where it is at the time t in [0, 1], if it began at `from`.
    fn place(&self, from: Vec3, t: f64) -> Vec3 {
        let leg = t * self.path.len() as f64;
        let k = (leg.floor() as usize).min(self.path.len() - 1);
        let begin = if k == 0 { from } else { self.path[k - 1] };
        begin + (self.path[k] - begin) * (leg - k as f64)
    }
}

/// Where one point should be at the moment.
#[derive(Debug, Clone, Copy)]
struct Aim {
    point: usize,
    target: Vec3,
}

/// What a net should become.
#[derive(Debug, Clone, PartialEq)]
pub struct Goals {
    /// Weights at the beginning.
    pub start: Weights,
    /// Weights at the end, and in the final phase.
    pub end: Weights,
    /// Steps in which handles travel to their targets, at the first weights but without fairness; they become longer where the net follows easily and
    /// shorter where it does not.
    pub travel: usize,
    /// Steps from the first weights to the last, geometric.
    pub fade: usize,
    /// Most iterations of the final phase.
    pub most: usize,
}

impl Goals {
    /// The weights at the time t of the fading, in [0, 1].
    fn between(&self, t: f64) -> Weights {
        std::array::from_fn(|k| {
            let (from, to) = (self.start[k], self.end[k]);
            match (from > 0.0, to > 0.0) {
                (true, _) => from * (to.max(from * FADED) / from).powf(t),
                (false, _) => to,
            }
        })
    }
}

/// A net that was optimised.
#[derive(Debug, Clone, PartialEq)]
pub struct Optimized {
    /// The net. Where the handles fight it is the nearest one found that meets all the rest.
    pub net: GeodesicNet,
    /// R = √Σφ² at mean edge 1 over all constraints that have a weight of at least 0.1 at the end, but for handles and fairness.
    /// The rows have no weights here.
    pub residual: f64,
    /// The same by family, handles included.
    pub residuals: Weights,
    /// Iterations made.
    pub iterations: usize,
    /// Time of the iterations, s (may differ between runs).
    pub seconds: f64,
    /// Handles that fight with the constraints or with each other, with how far they are off, mm; the worst first. Empty where
    /// all are met.
    pub missed: Vec<(usize, f64)>,
}

impl Optimized {
    /// All constraints and all handles are met.
    pub fn is_feasible(&self) -> bool {
        self.residual <= FEASIBLE && self.missed.is_empty()
    }
}

/// R at which a net counts as done; far below what any shop sees, and above what rounding does to a few thousand rows.
const DONE: f64 = 1e-9;
/// R up to which all constraints count as met: the paper's best is 2.75e-7.
pub const FEASIBLE: f64 = 1e-7;
/// Share of the mean edge by which a handle may be off and counts as met.
const MET: f64 = 1e-6;
/// Least weight of a constraint that is part of R; those below are there to choose among what meets the others.
const HARD: f64 = 0.1;
/// Damping of the first iterations, at mean edge 1.
const DAMPING: f64 = 1e-3;
/// Least damping: below it rounding in the normal equations shows.
const LEAST_DAMPING: f64 = 1e-8;
/// R to which a net is brought after each step of its handles.
const NEAR: f64 = 1e-4;
/// Most iterations of one step of the handles.
const FOLLOW: usize = 12;
/// A step that took no more iterations is followed by a longer one.
const QUICK: usize = 5;
/// How much longer.
const LONGER: f64 = 1.5;
/// Shortest step of the handles, as a share of their way.
const SHORTEST_STEP: f64 = 1e-3;
/// Iterations at each weight.
const PER_STEP: usize = 2;
/// Share of its weight at which a family is switched off.
const FADED: f64 = 1e-4;
/// A step that makes R so many times larger is taken back.
const RISE: f64 = 1000.0;
/// Weight of handles that have turned out to fight, beside 1 for what they fight with.
const SOFT: f64 = 0.1;
/// Iterations with soft handles.
const SOFT_ITERATIONS: usize = 40;
/// So many iterations without a tenth off R end the final phase.
const PATIENCE: usize = 16;

/// Adds the rows of all families that `weights` ever want.
fn rows(net: &GeodesicNet, wanted: impl Fn(Family) -> bool) -> Builder {
    let (m, n) = (net.rows, net.columns);
    let id = |i: usize, j: usize| net.index(i, j);
    let mut out = Builder::new();
    let quads = || (0..m - 1).flat_map(|i| (0..n - 1).map(move |j| (i, j)));
    if wanted(Family::Geodesic) {
        for (i, j) in quads() {
            let [a, b, c, d] = [id(i, j), id(i + 1, j), id(i + 1, j + 1), id(i, j + 1)];
            out.row(Family::Geodesic, false, &[(a, c, 1.0), (b, d, -1.0)], 0.0);
            out.row(Family::Geodesic, false, &[(a, b, 1.0), (d, c, -1.0)], 0.0);
        }
    }
    for i in 0..m {
        for j in 0..n {
            if i + 2 < m {
                let [a, b, c] = [id(i, j), id(i + 1, j), id(i + 2, j)];
                if wanted(Family::ArcLength) {
                    out.row(Family::ArcLength, false, &[(a, b, 1.0), (b, c, -1.0)], 0.0);
                }
                out.fair(a, b, c);
                if wanted(Family::Developable) && j + 1 < n {
                    let terms = [(a, a + 1, 1.0), (b, b + 1, -2.0), (c, c + 1, 1.0)];
                    out.row(Family::Developable, false, &terms, 0.0);
                }
            }
            if j + 2 < n {
                let [a, b, c] = [id(i, j), id(i, j + 1), id(i, j + 2)];
                if wanted(Family::EqualWidth) {
                    out.row(Family::EqualWidth, false, &[(a, b, 1.0), (b, c, -1.0)], 0.0);
                }
                out.fair(a, b, c);
                if wanted(Family::Ratio) && i + 1 < m {
                    let terms = [(a, b, 1.0), (b, c, -1.0), (a + n, b + n, -1.0), (b + n, c + n, 1.0)];
                    out.row(Family::Ratio, true, &terms, 0.0);
                }
            }
        }
    }
    if wanted(Family::Diagonals) {
        for (i, j) in quads() {
            let [a, b, c, d] = [id(i, j), id(i + 1, j), id(i + 1, j + 1), id(i, j + 1)];
            out.row(Family::Diagonals, false, &[(a, c, 1.0), (b, d, -1.0)], 0.0);
        }
    }
    if wanted(Family::Isometry) {
        edges(m, n).for_each(|(a, b)| out.row(Family::Isometry, false, &[(a, b, 1.0)], 0.0));
    }
    out
}

/// The edges of a net of m rows and n columns: along, then across.
fn edges(m: usize, n: usize) -> impl Iterator<Item = (usize, usize)> {
    let along = (0..(m - 1) * n).map(move |k| (k, k + n));
    along.chain((0..m * (n - 1)).map(move |k| (k / (n - 1) * n + k % (n - 1), k / (n - 1) * n + k % (n - 1) + 1)))
}

/// A net on its way, at mean edge 1.
pub struct Projection<'a> {
    scale: f64,
    rows: usize,
    columns: usize,
    points: Vec<Vec3>,
    system: System,
    surface: Option<&'a Bvh>,
    /// Iterations made so far.
    pub iterations: usize,
    seconds: f64,
}

impl<'a> Projection<'a> {
    /// Analyses the constraints that are ever wanted by `goals`. `reference` gives the lengths of the isometry, the net itself
    /// where absent; `surface` is what proximity pulls to.
    pub fn new(
        net: &GeodesicNet,
        goals: &Goals,
        reference: Option<&GeodesicNet>,
        surface: Option<&'a Bvh>,
    ) -> Result<Self, NetError> {
        let scale = reference.unwrap_or(net).mean_edge();
        let wanted = |it: Family| goals.start[it as usize] > 0.0 || goals.end[it as usize] > 0.0;
        let places: Vec<[f64; 3]> =
            (0..net.points.len()).map(|k| [(k / net.columns) as f64, (k % net.columns) as f64, 0.0]).collect();
        let mut system = rows(net, wanted).finish(&places)?;
        let kept = &reference.unwrap_or(net).points;
        let lengths: Vec<f64> = edges(net.rows, net.columns).map(|(a, b)| (kept[a] - kept[b]).norm() / scale).collect();
        system.set_targets(Family::Isometry, &lengths);
        let n = net.columns;
        let corners = (0..net.points.len() - n).filter(|k| k % n + 1 < n);
        let differences: Vec<f64> = corners
            .map(|k| ((kept[k] - kept[k + n + 1]).norm() - (kept[k + n] - kept[k + 1]).norm()) / scale)
            .collect();
        system.set_targets(Family::Diagonals, &differences);
        Ok(Self {
            scale,
            rows: net.rows,
            columns: net.columns,
            points: net.points.iter().map(|p| p / scale).collect(),
            system,
            surface,
            iterations: 0,
            seconds: 0.0,
        })
    }

    fn pulls(&self, handles: &[Aim], weights: &Weights) -> Vec<Pull> {
        let near = self.surface.filter(|_| weights[Family::Proximity as usize] > 0.0);
        let mut out = Vec::new();
        for (point, p) in self.points.iter().enumerate().filter(|_| near.is_some()) {
            let Some(surface) = near else { break };
            let found = surface.closest(p * self.scale);
            let [a, b, c] = surface.face_positions(found.face);
            let normal = (b - a).cross(&(c - a)).try_normalize(0.0);
            out.push(Pull { point, target: found.point / self.scale, normal, family: Family::Proximity });
        }
        out.extend(handles.iter().map(|it| Pull {
            point: it.point,
            target: it.target / self.scale,
            normal: None,
            family: Family::Handle,
        }));
        out
    }

    /// One full step.
    fn iterate(&mut self, handles: &[Aim], weights: &Weights, damping: f64, monitor: &Monitor) -> Result<(), NetError> {
        monitor.check()?;
        let begin = monitor.seconds();
        let pulls = self.pulls(handles, weights);
        let step = self.system.step(&self.points, &pulls, weights, damping)?;
        if !step.iter().all(|it| it.norm_squared().is_finite()) {
            return Err(NetError::Diverged { iterations: self.iterations });
        }
        self.points.iter_mut().zip(&step).for_each(|(p, d)| *p += d);
        self.iterations += 1;
        self.seconds += monitor.seconds() - begin;
        Ok(())
    }

    /// R at the points as they are.
    fn residuals(&self, handles: &[Aim], weights: &Weights) -> Weights {
        self.system.residuals(&self.points, &self.pulls(handles, weights), weights)
    }

    /// Leads the net to `goals`: the handles travel at the first weights without fairness, then the weights go to their ends, then R is brought
    /// down. A net that is there already stays as it is.
    pub fn run(&mut self, goals: &Goals, handles: &[Handle], monitor: &Monitor) -> Result<Optimized, NetError> {
        if let Some((handle, it)) =
            handles.iter().enumerate().find(|(_, it)| it.at[0] >= self.rows || it.at[1] >= self.columns)
        {
            let ([row, column], rows, columns) = (it.at, self.rows, self.columns);
            return Err(NetError::NoSuchPoint { handle, row, column, rows, columns });
        }
        let point = |it: &Handle| it.at[0] * self.columns + it.at[1];
        let aims: Vec<Aim> = handles
            .iter()
            .map(|it| Aim { point: point(it), target: it.place(self.points[point(it)] * self.scale, 1.0) })
            .collect();
        if total(&self.residuals(&aims, &goals.end)) > DONE {
            self.travel(goals, handles, monitor)?;
            for step in 1..=goals.fade {
                let t = step as f64 / goals.fade as f64;
                for _ in 0..PER_STEP {
                    self.iterate(&aims, &goals.between(t), DAMPING, monitor)?;
                }
                monitor.progress(0.5 + 0.2 * t, "fading the weights");
            }
            let begin = self.points.clone();
            if self.settle(&goals.end, goals.most, &aims, monitor)? > FEASIBLE && !aims.is_empty() {
                self.points = begin;
                self.give_way(goals, &aims, monitor)?;
            }
        }
        Ok(self.finish(goals, &aims))
    }

    /// Leads the handles to their targets, in steps as long as the net can follow: after each it is brought near to its
    /// constraints, and a step from which it does not come back is halved. Ends where steps get too short.
    fn travel(&mut self, goals: &Goals, handles: &[Handle], monitor: &Monitor) -> Result<(), NetError> {
        let point = |it: &Handle| it.at[0] * self.columns + it.at[1];
        let from: Vec<(usize, Vec3)> =
            handles.iter().map(|it| (point(it), self.points[point(it)] * self.scale)).collect();
        let mut weights = goals.start;
        weights[Family::Fairness as usize] = 0.0;
        let mut step = 1.0 / goals.travel.max(1) as f64;
        let mut t = 0.0_f64;
        while t < 1.0 && step >= SHORTEST_STEP && !handles.is_empty() {
            let next = (t + step).min(1.0);
            let on_the_way: Vec<Aim> = handles
                .iter()
                .zip(&from)
                .map(|(it, &(point, from))| Aim { point, target: it.place(from, next) })
                .collect();
            let before = self.points.clone();
            match self.follow(&weights, &on_the_way, monitor)? {
                Some(iterations) => {
                    t = next;
                    if iterations <= QUICK {
                        step *= LONGER;
                    }
                }
                None => {
                    self.points = before;
                    step *= 0.5;
                }
            }
            monitor.progress(0.5 * t, "bending the net");
        }
        Ok(())
    }

    /// Brings R under [`NEAR`] and returns the number of iterations; `None` where that takes too many.
    fn follow(&mut self, weights: &Weights, aims: &[Aim], monitor: &Monitor) -> Result<Option<usize>, NetError> {
        let mut damping = DAMPING;
        for k in 1..=FOLLOW {
            match self.iterate(aims, weights, damping, monitor) {
                Err(NetError::Sparse(SparseError::NotPositiveDefinite { .. }) | NetError::Diverged { .. }) => {
                    return Ok(None);
                }
                other => other?,
            }
            damping = (damping * 0.5).max(LEAST_DAMPING);
            if total(&self.residuals(aims, weights)) <= NEAR {
                return Ok(Some(k));
            }
        }
        Ok(None)
    }

    /// Where handles were not met: they pull softly until the net comes to rest, once more fully, and where that fails not at
    /// all.
    fn give_way(&mut self, goals: &Goals, handles: &[Aim], monitor: &Monitor) -> Result<(), NetError> {
        let mut weights = goals.end;
        weights[Family::Handle as usize] *= SOFT;
        let mut damping = DAMPING;
        for _ in 0..SOFT_ITERATIONS {
            let before = self.points.clone();
            let energy = self.weighted(handles, &weights);
            self.iterate(handles, &weights, damping, monitor)?;
            if self.weighted(handles, &weights) < energy {
                damping = (damping * 0.5).max(LEAST_DAMPING);
            } else {
                self.points = before;
                damping *= 4.0;
            }
        }
        let rest = self.points.clone();
        if self.settle(&goals.end, goals.most, handles, monitor)? > FEASIBLE {
            self.points = rest;
            weights[Family::Handle as usize] = 0.0;
            self.settle(&weights, goals.most, &[], monitor)?;
        }
        Ok(())
    }

    /// Σ (w φ)², fairness left out.
    fn weighted(&self, handles: &[Aim], weights: &Weights) -> f64 {
        self.residuals(handles, weights).iter().zip(weights).map(|(r, w)| (r * w).powi(2)).sum()
    }

    /// The final phase: full steps with less and less damping. R may rise for a while (the way to the solution set leads over
    /// ridges along which the Jacobian nearly loses rank); what rises too far is taken back.
    ///
    /// Returns R.
    fn settle(&mut self, weights: &Weights, most: usize, handles: &[Aim], monitor: &Monitor) -> Result<f64, NetError> {
        let mut damping = DAMPING;
        let mut best = (f64::INFINITY, self.points.clone());
        let mut stale = 0;
        for k in 0..=most {
            let residual = total(&self.residuals(handles, weights));
            stale = if residual < 0.9 * best.0 { 0 } else { stale + 1 };
            if residual < best.0 {
                best = (residual, self.points.clone());
            }
            if residual <= DONE || stale > PATIENCE || k == most {
                break;
            }
            if residual > RISE * best.0 {
                self.points.clone_from(&best.1);
                damping *= 30.0;
            } else {
                damping = (damping * 0.5).max(LEAST_DAMPING);
            }
            match self.iterate(handles, weights, damping, monitor) {
                Err(NetError::Sparse(SparseError::NotPositiveDefinite { .. })) => damping *= 4.0,
                other => other?,
            }
            monitor.progress(0.7 + 0.3 * k as f64 / most as f64, "settling the net");
        }
        self.points = best.1;
        Ok(best.0)
    }

    fn finish(&self, goals: &Goals, aims: &[Aim]) -> Optimized {
        let residuals = self.residuals(aims, &goals.end);
        let mut rest = residuals;
        rest[Family::Handle as usize] = 0.0;
        rest.iter_mut().zip(&goals.end).filter(|it| *it.1 < HARD).for_each(|it| *it.0 = 0.0);
        let points: Vec<Vec3> = self.points.iter().map(|p| p * self.scale).collect();
        let mut missed: Vec<(usize, f64)> = aims
            .iter()
            .map(|it| (points[it.point] - it.target).norm())
            .enumerate()
            .filter(|it| it.1 > MET * self.scale)
            .collect();
        missed.sort_by(|a, b| b.1.total_cmp(&a.1));
        Optimized {
            net: GeodesicNet { rows: self.rows, columns: self.columns, points },
            residual: total(&rest),
            residuals,
            iterations: self.iterations,
            seconds: self.seconds,
            missed,
        }
    }
}

fn total(residuals: &Weights) -> f64 {
    residuals.iter().map(|it| it * it).sum::<f64>().sqrt()
}
