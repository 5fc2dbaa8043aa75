//! Levenberg–Marquardt: Newton steps on a positive semidefinite model of the Hessian, damped by μ I.
use super::{
    Limits, Objective, Outcome,
    vector::{dot, largest},
    walk::Walk,
};
use crate::numeric::{
    Cancelled, Monitor,
    sparse::{Analysis, Cholesky, SymmetricMatrix},
};

/// An objective that can say how it curves.
pub trait Curved: Objective {
    /// Sets the values of `hessian`, a positive semidefinite model at the latest accepted point; the pattern is the same at
    /// every call.
    fn curvature(&mut self, x: &[f64], hessian: &mut SymmetricMatrix);
}

/// The solver and its constants. Lengths are in the unit of x.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Levenberg {
    /// Damping μ at the start.
    pub damping: f64,
    /// Largest change of any coordinate in one step.
    pub longest_step: f64,
}

impl Levenberg {
    /// Share of the predicted decrease along the step that must be reached.
    const ARMIJO: f64 = 1e-4;
    /// Shortening of a step that did not, and how often.
    const SHORTEN: f64 = 0.6;
    const TRIES: usize = 10;
    /// Dampings tried in a row without any step before giving up.
    const FAILURES: usize = 8;

    /// Minimises `objective` from `x`, in place; `hessian` has the pattern of its curvature.
    pub fn minimize(
        &self,
        objective: &mut dyn Curved,
        x: &mut [f64],
        hessian: &mut SymmetricMatrix,
        analysis: &Analysis<f32>,
        limits: &Limits,
        monitor: &Monitor,
    ) -> Result<Outcome, Cancelled> {
        let n = x.len();
        let mut walk = Walk::new(objective, x, limits, monitor);
        let (mut damping, mut failures) = (self.damping, 0);
        let mut factor: Option<Cholesky<f32>> = None;
        walk.objective.curvature(walk.x, hessian);
        let mut damped = hessian.clone();
        while walk.goes_on()? {
            if failures >= Self::FAILURES {
                walk.give_up();
                break;
            }
            damped.values_mut().copy_from_slice(hessian.values());
            (0..n).for_each(|i| damped.add_to_diagonal(i, damping));
            let factored = match &mut factor {
                Some(it) => it.refactor(&damped),
                None => analysis.factor(&damped).map(|it| factor = Some(it)),
            };
            let llt = factor.as_ref().filter(|_| factored.is_ok());
            let Some(mut step) = llt.and_then(|it| refined(it, &damped, &walk.gradient)) else {
                damping *= 4.0;
                failures += 1;
                continue;
            };
            walk.objective.symmetrize(&mut step);
            let scale = -(self.longest_step / largest(&step)).min(1.0);
            step.iter_mut().for_each(|d| *d *= scale);
            let (slope, bend) = (dot(&walk.gradient, &step), dot(&step, &hessian.multiply(&step)));
            let mut t = 1.0;
            let mut reached = None;
            for _ in 0..Self::TRIES {
                let here = walk.sample(t, &step)?.value;
                if here <= walk.value + Self::ARMIJO * t * slope {
                    reached = Some(here);
                    break;
                }
                t *= Self::SHORTEN;
            }
            let Some(here) = reached else {
                damping *= 6.0;
                failures += 1;
                continue;
            };
            let ratio = (here - walk.value) / (t * slope + 0.5 * t * t * bend);
            damping *= match () {
                () if t < 0.3 || ratio < 0.1 => 2.5,
                () if t == 1.0 && ratio > 0.75 => 0.33,
                () if t == 1.0 && ratio > 0.4 => 0.7,
                () => 1.0,
            };
            failures = 0;
            walk.accept();
            walk.objective.curvature(walk.x, hessian);
        }
        Ok(walk.outcome())
    }
}

/// Solves A x = b with a factor in single precision, by iterative refinement. `None` if the factor is too rough for this
/// matrix.
fn refined(factor: &Cholesky<f32>, matrix: &SymmetricMatrix, b: &[f64]) -> Option<Vec<f64>> {
    /// Change of x by one round, relative, after which another would change about its square, and above which the rounds
    /// do not converge.
    const SETTLED: f64 = 1e-3;
    const MUCH: f64 = 0.1;
    const ROUNDS: usize = 6;
    let mut x = factor.solve(b);
    for _ in 0..ROUNDS {
        let mut change: Vec<f64> = matrix.multiply(&x).iter().zip(b).map(|(ax, b)| b - ax).collect();
        factor.solve_in_place(&mut change);
        let share = (dot(&change, &change) / dot(&x, &x)).sqrt();
        // Also for a share that is no number.
        if !(share <= MUCH) {
            return None;
        }
        x.iter_mut().zip(change).for_each(|(x, d)| *x += d);
        if share <= SETTLED {
            break;
        }
    }
    Some(x)
}

#[cfg(test)]
mod tests {
    use super::{super::Stop, *};

    /// Σ over i of (10 (x_{i+1} − x_i²))² + (1 − x_i)², with its Gauss–Newton matrix.
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
    impl Curved for Rosenbrock {
        fn curvature(&mut self, x: &[f64], hessian: &mut SymmetricMatrix) {
            let mut triplets = Vec::new();
            for i in 0..x.len() - 1 {
                let (row, d) = (i as u32, -20.0 * x[i]);
                triplets.push((row, row, 2.0 + 2.0 * d * d));
                triplets.push((row + 1, row, 20.0 * d));
                triplets.push((row + 1, row + 1, 200.0));
            }
            *hessian = SymmetricMatrix::from_triplets(x.len(), &triplets);
        }
    }

    #[test]
    fn finds_the_minimum_of_rosenbrock_in_few_steps() {
        let mut x = vec![-1.2; 20];
        let pairs: Vec<_> = (0..19).map(|i| (i + 1, i)).collect();
        let (mut hessian, _) = SymmetricMatrix::with_pattern(20, &pairs);
        let analysis = Analysis::of(&hessian).unwrap();
        let limits = Limits { iterations: 200, gradient: 1e-9, decrease: 0.0, window: 10 };
        let solver = Levenberg { damping: 1e-2, longest_step: 10.0 };
        let out =
            solver.minimize(&mut Rosenbrock, &mut x, &mut hessian, &analysis, &limits, &Monitor::silent()).unwrap();
        assert_eq!(out.stop, Stop::Gradient, "{out:?}");
        assert!(x.iter().all(|x| (x - 1.0).abs() < 1e-8), "{x:?}");
        assert!(out.iterations < 100, "{out:?}");
    }
}
