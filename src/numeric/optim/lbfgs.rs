//! Limited-memory BFGS with the Lewis–Overton line search.
use super::{
    Limits, Objective, Outcome,
    vector::{add_scaled, dot, largest, norm},
    walk::Walk,
    wolfe::{Sample, Wolfe},
};
use crate::numeric::{Cancelled, Monitor};

/// Applies the inverse of a symmetric positive definite metric in place: the initial inverse Hessian, up to scale.
pub type Metric<'a> = &'a dyn Fn(&mut [f64]);

/// The solver and its constants; one instance may be reused, it keeps its buffers but no history.
#[derive(Debug)]
pub struct Lbfgs {
    memory: usize,
    wolfe: Wolfe,
}

impl Default for Lbfgs {
    /// Memory 8, c₁ = 1e-4, c₂ = 0.99, 100 tries: the constants of Stein, Grinspun and Crane's code.
    fn default() -> Self {
        Self { memory: 8, wolfe: Wolfe { decrease: 1e-4, curvature: 0.99, tries: 100 } }
    }
}

/// Pairs (s, y) of the latest steps, newest last.
struct History {
    pairs: std::collections::VecDeque<Pair>,
    spare: Vec<Pair>,
}

struct Pair {
    s: Vec<f64>,
    y: Vec<f64>,
    inverse_sy: f64,
}

impl History {
    fn new(memory: usize, n: usize) -> Self {
        let pair = || Pair { s: vec![0.0; n], y: vec![0.0; n], inverse_sy: 0.0 };
        Self { pairs: std::collections::VecDeque::with_capacity(memory), spare: (0..memory).map(|_| pair()).collect() }
    }

    fn clear(&mut self) {
        self.spare.extend(self.pairs.drain(..));
    }

    /// Takes the pair of a step, unless its curvature is lost in rounding.
    fn push(&mut self, t: f64, direction: &[f64], old: &[f64], new: &[f64]) {
        let Some(mut pair) = self.spare.pop().or_else(|| self.pairs.pop_front()) else { return };
        for (i, (s, y)) in pair.s.iter_mut().zip(&mut pair.y).enumerate() {
            *s = t * direction[i];
            *y = new[i] - old[i];
        }
        let sy = dot(&pair.s, &pair.y);
        if sy > 1e-14 * norm(&pair.s) * norm(&pair.y) {
            pair.inverse_sy = 1.0 / sy;
            self.pairs.push_back(pair);
        } else {
            self.spare.push(pair);
        }
    }

    /// −H g by the two-loop recursion (Nocedal, Wright 2006, algorithm 7.4), into `direction`.
    fn descend(&self, gradient: &[f64], metric: Option<Metric<'_>>, direction: &mut [f64]) {
        direction.copy_from_slice(gradient);
        let mut alphas = [0.0; 32];
        for (pair, alpha) in self.pairs.iter().rev().zip(&mut alphas) {
            *alpha = pair.inverse_sy * dot(&pair.s, direction);
            add_scaled(direction, -*alpha, &pair.y);
        }
        match (metric, self.pairs.back()) {
            (Some(apply), last) => {
                if let Some(pair) = last {
                    let mut y = pair.y.clone();
                    apply(&mut y);
                    let scale = 1.0 / (pair.inverse_sy * dot(&pair.y, &y));
                    direction.iter_mut().for_each(|it| *it *= scale);
                }
                apply(direction);
            }
            (None, Some(pair)) => {
                let scale = 1.0 / (pair.inverse_sy * dot(&pair.y, &pair.y));
                direction.iter_mut().for_each(|it| *it *= scale);
            }
            (None, None) => {}
        }
        for (i, pair) in self.pairs.iter().enumerate() {
            let alpha = alphas[self.pairs.len() - 1 - i];
            let beta = pair.inverse_sy * dot(&pair.y, direction);
            add_scaled(direction, alpha - beta, &pair.s);
        }
        direction.iter_mut().for_each(|it| *it = -*it);
    }
}

impl Lbfgs {
    /// Minimises `objective` from `x`, in place. With a `metric` its inverse takes the place of the identity as the initial
    /// inverse Hessian. `first_step` bounds the largest component of the first step.
    pub fn minimize(
        &self,
        objective: &mut dyn Objective,
        x: &mut [f64],
        metric: Option<Metric<'_>>,
        first_step: f64,
        limits: &Limits,
        monitor: &Monitor,
    ) -> Result<Outcome, Cancelled> {
        let n = x.len();
        let (mut history, mut direction) = (History::new(self.memory, n), vec![0.0; n]);
        let mut walk = Walk::new(objective, x, limits, monitor);
        while walk.goes_on()? {
            history.descend(&walk.gradient, metric, &mut direction);
            walk.objective.symmetrize(&mut direction);
            let start = Sample { value: walk.value, slope: dot(&walk.gradient, &direction) };
            if !(start.slope < 0.0) && !history.pairs.is_empty() {
                history.clear();
                continue;
            }
            let first = if history.pairs.is_empty() { (first_step / largest(&direction)).min(1.0) } else { 1.0 };
            let found = self.wolfe.search(start, first, |t| walk.sample(t, &direction))?;
            match found {
                Some((t, _)) => {
                    history.push(t, &direction, &walk.gradient, &walk.other_gradient);
                    walk.accept();
                }
                None if history.pairs.is_empty() => walk.give_up(),
                None => history.clear(),
            }
        }
        Ok(walk.outcome())
    }
}

#[cfg(test)]
mod tests {
    use super::{super::Stop, *};

    struct Rosenbrock;
    impl Objective for Rosenbrock {
        fn evaluate(&mut self, x: &[f64], gradient: &mut [f64]) -> f64 {
            gradient.fill(0.0);
            let mut f = 0.0;
            for i in 0..x.len() - 1 {
                let (a, b) = (1.0 - x[i], x[i + 1] - x[i] * x[i]);
                f += a * a + 100.0 * b * b;
                gradient[i] += -2.0 * a - 400.0 * x[i] * b;
                gradient[i + 1] += 200.0 * b;
            }
            f
        }
    }

    /// −Σ ln(1 − xᵢ²) + Σ c xᵢ: infeasible outside the unit box.
    struct Boxed;
    impl Objective for Boxed {
        fn evaluate(&mut self, x: &[f64], gradient: &mut [f64]) -> f64 {
            if x.iter().any(|x| x.abs() >= 1.0) {
                return f64::NAN;
            }
            let mut f = 0.0;
            for (x, g) in x.iter().zip(gradient) {
                f += -(1.0 - x * x).ln() - 50.0 * x;
                *g = 2.0 * x / (1.0 - x * x) - 50.0;
            }
            f
        }
    }

    const LIMITS: Limits = Limits { iterations: 2000, gradient: 1e-9, decrease: 0.0, window: 10 };

    #[test]
    fn finds_the_minimum_of_rosenbrock_with_and_without_a_metric() {
        let halve = |v: &mut [f64]| v.iter_mut().enumerate().for_each(|(i, x)| *x *= 1.0 / (1.0 + i as f64));
        for metric in [None, Some(&halve as Metric<'_>)] {
            let mut x = vec![-1.2; 20];
            let monitor = Monitor::silent();
            let out = Lbfgs::default().minimize(&mut Rosenbrock, &mut x, metric, 1.0, &LIMITS, &monitor).unwrap();
            assert_eq!(out.stop, Stop::Gradient, "{out:?}");
            assert!(x.iter().all(|x| (x - 1.0).abs() < 1e-7), "{x:?}");
        }
    }

    #[test]
    fn backs_away_from_infeasible_points() {
        let mut x = vec![0.0; 5];
        let out = Lbfgs::default().minimize(&mut Boxed, &mut x, None, 100.0, &LIMITS, &Monitor::silent()).unwrap();
        assert_eq!(out.stop, Stop::Gradient, "{out:?}");
        let exact = (-2.0 + (4.0_f64 + 4.0 * 2500.0).sqrt()) / 100.0;
        assert!(x.iter().all(|x| (x - exact).abs() < 1e-9), "{x:?} {exact}");
        let mut outside = vec![2.0];
        let out = Lbfgs::default().minimize(&mut Boxed, &mut outside, None, 1.0, &LIMITS, &Monitor::silent()).unwrap();
        assert_eq!(out.stop, Stop::Infeasible);
    }

    #[test]
    fn cancellation_reaches_the_caller() {
        let monitor = Monitor::new(&|| true, &|_, _| (), &|| 0.0);
        let mut x = vec![0.0; 4];
        assert_eq!(Lbfgs::default().minimize(&mut Rosenbrock, &mut x, None, 1.0, &LIMITS, &monitor), Err(Cancelled));
    }
}
