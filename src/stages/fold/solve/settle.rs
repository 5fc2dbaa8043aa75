//! The end of the path: the sheet comes to rest, stiffer and stiffer, until its limits are kept.
use super::{
    super::{FoldError, terms::angles},
    LEAST_DAMPING, LEAST_DELTA, REFINEMENTS, Solver, Step,
};
use crate::{geom::Vec3, numeric::Monitor};

/// Factor by which the weights grow while settling.
const STIFFEN: f64 = 1.5;
/// Share of a limit from which a weight is raised.
const MARGIN: f64 = 0.9;
/// Factor by which a weight is raised at most: what is not met by then cannot be.
const MOST_HELD: f64 = 1e4;
/// Steps of the restoration.
const MOST_RESTORATIONS: usize = 16;
/// Largest |cos α_k − cos α_{k+1}| that is left.
const RESTORED: f64 = 1e-11;
/// Length of the constraints from which a net can be restored without harm.
const SETTLED: f64 = 1e-4;

impl Solver<'_> {
    /// Lets the sheet come to rest with the handles at their targets, ever stiffer, and harder where a limit is passed.
    pub(super) fn settle(&mut self, monitor: &Monitor<'_>) -> Result<Step, FoldError> {
        let targets: Vec<Vec3> = self.handles.iter().map(|it| it.target).collect();
        let mut step = Step::default();
        let mut best = (f64::INFINITY, Vec::new());
        for _ in 0..self.options.settle {
            monitor.check()?;
            match self.step(&targets) {
                Ok(next) => step = next,
                // What was reached before stands.
                Err(_) if best.0.is_finite() => break,
                Err(error) => return Err(error),
            }
            if self.stiffness == 1.0 {
                let excess = self.excess().max(step.residual / SETTLED);
                if excess < best.0 {
                    best = (excess, self.x.clone());
                }
            }
            if step.taken < 1.0 {
                continue;
            }
            if self.stiffness < 1.0 {
                self.stiffen((STIFFEN * self.stiffness).min(1.0));
                continue;
            }
            self.delta = (0.5 * self.delta).max(LEAST_DELTA);
            let more = self.hold_harder();
            if !more && step.change < 1e-6 && step.residual < 1e-9 {
                break;
            }
        }
        if best.0.is_finite() {
            self.x = best.1;
        }
        self.restore(&targets);
        Ok(step)
    }

    /// How many times as large as its limit the worst of stretch, gaps, misses of handles and unfolded points is; 1 where just
    /// all is well.
    fn excess(&self) -> f64 {
        let figures = self.figures();
        let [mean, most] = self.options.continuity_limits;
        let miss = self.misses().into_iter().fold(0.0, f64::max);
        let unfolded = figures.crease_points - figures.excluded - figures.folded;
        [
            figures.stretch_max / self.options.stretch_limit,
            figures.continuity_mean / mean,
            figures.continuity_max / most,
            miss / self.options.handle_limit,
            1e3 * unfolded as f64,
        ]
        .into_iter()
        .fold(0.0, f64::max)
    }

    /// Raises the weights of edges and handles that pass their limits; whether there were any.
    fn hold_harder(&mut self) -> bool {
        let mut more = false;
        let raise = |excess: f64| excess.clamp(1.0, STIFFEN);
        for (weight, &[a, b]) in self.edge_weights.iter_mut().zip(&self.net.edges) {
            let [l, l0] = [&self.x, &self.net.flat].map(|x| (x[a as usize] - x[b as usize]).norm());
            let excess = ((l - l0).abs() / l0 / (MARGIN * self.options.stretch_limit)).powi(2);
            *weight = (*weight * raise(excess)).min(MOST_HELD);
            more |= excess > 1.0;
        }
        let first = self.net.laplacian.len();
        let gaps: Vec<f64> =
            self.net.points.iter().map(|it| (it.sides[0].at(&self.x) - it.sides[1].at(&self.x)).norm()).collect();
        let [mean, most] = self.options.continuity_limits.map(|it| MARGIN * it);
        let wide = gaps.iter().sum::<f64>() > mean * gaps.len() as f64;
        let mut moved = false;
        for (gap, (_, weight)) in gaps.iter().zip(&mut self.forms[first..]) {
            // Where the mean is too large, the gaps that are larger than it should be are closed.
            let limit = if wide { mean } else { most };
            let excess = gap / limit;
            *weight *= raise(excess);
            let most = Vec3::repeat(2.0 * self.options.continuity * MOST_HELD);
            *weight = weight.inf(&most);
            moved |= excess > 1.0;
        }
        let first = self.forms.len() - self.handles.len();
        for (it, (_, weight)) in self.handles.iter().zip(&mut self.forms[first..]) {
            let excess = (it.miss(&self.x) / (MARGIN * self.options.handle_limit)).powi(2);
            *weight = (*weight * raise(excess)).inf(&Vec3::repeat(2.0 * self.options.position * MOST_HELD));
            moved |= excess > 1.0;
        }
        if moved {
            self.kkt.set_forms(&self.forms);
        }
        more || moved
    }

    /// Moves to a net whose angles are exact: Newton steps that cost the least by the Hessian of the objective.
    /// One that makes them less exact is taken back and ends it.
    fn restore(&mut self, targets: &[Vec3]) {
        let n = 3 * self.x.len();
        let mut best = (f64::INFINITY, self.x.clone());
        for _ in 0..MOST_RESTORATIONS {
            let mut right = vec![0.0; n + self.kkt.constraints()];
            self.kkt.begin(LEAST_DAMPING, LEAST_DELTA);
            self.add_objective(targets, &mut right[..n]);
            right.fill(0.0);
            let (mut row, mut worst) = (n, 0.0_f64);
            for (index, star) in self.net.stars.iter().enumerate() {
                let it = angles(star, &self.x);
                self.kkt.set_star(index, &it, star.around.len());
                for value in &it.values[..it.count] {
                    right[row] = -value;
                    worst = worst.max(value.abs());
                    row += 1;
                }
            }
            if !(worst < best.0) {
                self.x = best.1;
                break;
            }
            best = (worst, self.x.clone());
            if worst < RESTORED {
                break;
            }
            // Where no step can be computed the net stays as it is.
            let Ok((d, ..)) = self.kkt.solve(&right, REFINEMENTS) else { break };
            if !d.iter().all(|it| it.is_finite()) {
                break;
            }
            for (x, d) in self.x.iter_mut().zip(d.chunks_exact(3)) {
                *x += Vec3::new(d[0], d[1], d[2]);
            }
        }
    }

    /// Sets the share of the isometry and continuity weights.
    pub(super) fn stiffen(&mut self, share: f64) {
        self.stiffness = share;
        let first = self.net.laplacian.len();
        for (_, weight) in &mut self.forms[first..first + self.net.points.len()] {
            *weight = Vec3::repeat(2.0 * self.options.continuity * share);
        }
        self.kkt.set_forms(&self.forms);
    }
}
