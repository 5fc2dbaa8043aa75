//! Unconstrained minimisation. Solvers know no mesh, objectives know no solver.

mod lbfgs;
mod levenberg;
mod subgradient;
mod vector;
mod walk;
mod wolfe;

pub use lbfgs::{Lbfgs, Metric};
pub use levenberg::{Curved, Levenberg};
pub use subgradient::Subgradient;

/// A function to be minimised, smooth almost everywhere.
pub trait Objective {
    /// f(x); `gradient` is overwritten. A value that is not finite marks `x` as infeasible: the line search backs away.
    fn evaluate(&mut self, x: &[f64], gradient: &mut [f64]) -> f64;

    /// Hears of every accepted step, and may then refresh what the function is built on (closest points, weights).
    /// Returns whether the function has changed, so that it is evaluated again before the next step.
    fn accepted(&mut self, _x: &[f64]) -> bool {
        false
    }

    /// Projects a direction of search onto those that keep the symmetry of x, where there is one: what rounding adds to it
    /// would grow from step to step.
    fn symmetrize(&self, _direction: &mut [f64]) {}
}

/// Why a solver stopped.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stop {
    /// The norm of the gradient fell below its limit.
    Gradient,
    /// The value decreased by less than its limit over the window.
    Stalled,
    /// The most iterations allowed.
    Iterations,
    /// No step along steepest descent satisfied the line search.
    LineSearch,
    /// The value was not finite at the start.
    Infeasible,
    /// The value was not finite at every step tried; the result is the last point where it was.
    NotANumber,
}

impl std::fmt::Display for Stop {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Gradient => "gradient",
            Self::Stalled => "stalled",
            Self::Iterations => "iterations",
            Self::LineSearch => "line search",
            Self::Infeasible => "infeasible",
            Self::NotANumber => "not a number",
        })
    }
}

/// What a solver did; the minimiser itself is in the `x` it was given.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outcome {
    /// Why it stopped.
    pub stop: Stop,
    /// f at the end.
    pub value: f64,
    /// Euclidean norm of the gradient at the end.
    pub gradient_norm: f64,
    /// Accepted steps.
    pub iterations: usize,
    /// Evaluations of f.
    pub evaluations: usize,
}

/// When to stop.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// Most accepted steps.
    pub iterations: usize,
    /// Euclidean norm of the gradient that counts as stationary.
    pub gradient: f64,
    /// Stop when the value decreased by less than this share over [`Limits::window`] steps; 0 never stops.
    pub decrease: f64,
    /// Steps over which the decrease is measured.
    pub window: usize,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::{
        Monitor,
        sparse::{Analysis, SymmetricMatrix},
    };

    /// Σ x², until its evaluations break at `good`: then the value, or only the gradient, is NaN.
    struct Breaking {
        good: usize,
        value: bool,
    }

    impl Objective for Breaking {
        fn evaluate(&mut self, x: &[f64], gradient: &mut [f64]) -> f64 {
            let broken = self.good == 0;
            self.good = self.good.saturating_sub(1);
            gradient.iter_mut().zip(x).for_each(|(g, x)| *g = 2.0 * x);
            if broken && !self.value {
                gradient[0] = f64::NAN;
            }
            if broken && self.value { f64::NAN } else { x.iter().map(|x| x * x).sum() }
        }
    }

    impl Curved for Breaking {
        fn curvature(&mut self, _: &[f64], hessian: &mut SymmetricMatrix) {
            hessian.values_mut().fill(40.0);
        }
    }

    #[test]
    fn every_solver_keeps_the_last_good_point_when_numbers_break() {
        let limits = Limits { iterations: 50, gradient: 1e-12, decrease: 0.0, window: 10 };
        let monitor = Monitor::silent();
        let (pattern, _) = SymmetricMatrix::with_pattern(3, &[]);
        let analysis = Analysis::of(&pattern).unwrap();
        type Solve<'a> = &'a dyn Fn(&mut Breaking, &mut [f64]) -> Outcome;
        let lbfgs: Solve<'_> = &|f, x| Lbfgs::default().minimize(f, x, None, 0.01, &limits, &monitor).unwrap();
        let subgradient: Solve<'_> = &|f, x| Subgradient::new(1e-2).minimize(f, x, &limits, &monitor).unwrap();
        let levenberg: Solve<'_> = &|f, x| {
            let solver = Levenberg { damping: 1e-2, longest_step: 0.1 };
            solver.minimize(f, x, &mut pattern.clone(), &analysis, &limits, &monitor).unwrap()
        };
        for solve in [lbfgs, subgradient, levenberg] {
            for value in [true, false] {
                let mut x = vec![3.0; 3];
                let out = solve(&mut Breaking { good: 4, value }, &mut x);
                assert_eq!(out.stop, Stop::NotANumber, "{out:?}");
                assert!(out.iterations > 0 && out.value < 27.0 && out.gradient_norm.is_finite(), "{out:?}");
                assert_eq!(out.value, x.iter().map(|x| x * x).sum::<f64>(), "{out:?}");
                let out = solve(&mut Breaking { good: 0, value }, &mut x);
                assert_eq!((out.stop, out.iterations), (Stop::Infeasible, 0));
            }
        }
    }
}
