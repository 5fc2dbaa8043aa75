//! Unconstrained minimisation. Solvers know no mesh, objectives know no solver.

mod lbfgs;
mod levenberg;
mod vector;
mod wolfe;

pub use lbfgs::{Lbfgs, Metric};
pub use levenberg::{Curved, Levenberg};

use std::collections::VecDeque;

/// A function to be minimised, smooth almost everywhere.
pub trait Objective {
    /// f(x); `gradient` is overwritten. A value that is not finite marks `x` as infeasible: the line search backs away.
    fn evaluate(&mut self, x: &[f64], gradient: &mut [f64]) -> f64;

    /// Hears of every accepted step, and may then refresh what the function is built on (closest points, weights).
    /// Returns whether the function has changed, so that it is evaluated again before the next step.
    fn accepted(&mut self, _x: &[f64]) -> bool {
        false
    }
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
}

impl std::fmt::Display for Stop {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Gradient => "gradient",
            Self::Stalled => "stalled",
            Self::Iterations => "iterations",
            Self::LineSearch => "line search",
            Self::Infeasible => "infeasible",
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

/// Watches the decrease over the latest steps.
struct Watch {
    decrease: f64,
    window: usize,
    past: VecDeque<f64>,
}

impl Watch {
    fn new(limits: &Limits, value: f64) -> Self {
        Self { decrease: limits.decrease, window: limits.window, past: VecDeque::from([value]) }
    }

    /// Takes the value after a step; whether the decrease has become too small to go on.
    fn stalled(&mut self, value: f64) -> bool {
        self.past.push_back(value);
        if self.past.len() <= self.window {
            return false;
        }
        let before = self.past.pop_front().unwrap_or(value);
        before - value < self.decrease * before.abs()
    }
}
