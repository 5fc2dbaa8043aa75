//! What all solvers share: the point reached, the point tried, the account of both, and when to stop.
use super::{
    Limits, Objective, Outcome, Stop,
    vector::{add_scaled, dot, norm},
    wolfe::Sample,
};
use crate::numeric::{Cancelled, Monitor};
use std::collections::VecDeque;

/// A solver on its way. `x` is always a point whose value and gradient are finite, unless the start was not.
pub(super) struct Walk<'a, O: Objective + ?Sized> {
    pub(super) objective: &'a mut O,
    pub(super) x: &'a mut [f64],
    /// At `x`.
    pub(super) value: f64,
    /// At `x`.
    pub(super) gradient: Vec<f64>,
    trial: Vec<f64>,
    trial_value: f64,
    /// At the latest trial; after a step was accepted, at the point before it.
    pub(super) other_gradient: Vec<f64>,
    limits: &'a Limits,
    monitor: &'a Monitor<'a>,
    /// Values after the latest steps.
    past: VecDeque<f64>,
    outcome: Outcome,
    ended: bool,
}

impl<'a, O: Objective + ?Sized> Walk<'a, O> {
    /// Evaluates the start.
    pub(super) fn new(objective: &'a mut O, x: &'a mut [f64], limits: &'a Limits, monitor: &'a Monitor<'a>) -> Self {
        let n = x.len();
        let mut gradient = vec![0.0; n];
        let value = objective.evaluate(x, &mut gradient);
        let gradient_norm = norm(&gradient);
        let outcome = Outcome { stop: Stop::Iterations, value, gradient_norm, iterations: 0, evaluations: 1 };
        let mut walk = Self {
            objective,
            x,
            value,
            gradient,
            trial: vec![0.0; n],
            trial_value: value,
            other_gradient: vec![0.0; n],
            limits,
            monitor,
            past: VecDeque::from([value]),
            outcome,
            ended: false,
        };
        if !value.is_finite() || !gradient_norm.is_finite() {
            walk.end(Stop::Infeasible);
        }
        walk
    }

    /// Whether another step is due.
    pub(super) fn goes_on(&mut self) -> Result<bool, Cancelled> {
        self.monitor.check()?;
        if !self.ended && self.outcome.gradient_norm <= self.limits.gradient {
            self.end(Stop::Gradient);
        }
        Ok(!self.ended && self.outcome.iterations < self.limits.iterations)
    }

    /// Evaluates x + t · direction. Its value is NaN also where only the gradient is not finite.
    pub(super) fn sample(&mut self, t: f64, direction: &[f64]) -> Result<Sample, Cancelled> {
        self.monitor.check()?;
        self.trial.copy_from_slice(self.x);
        add_scaled(&mut self.trial, t, direction);
        self.outcome.evaluations += 1;
        let value = self.objective.evaluate(&self.trial, &mut self.other_gradient);
        let slope = dot(&self.other_gradient, direction);
        self.trial_value = if slope.is_finite() { value } else { f64::NAN };
        Ok(Sample { value: self.trial_value, slope })
    }

    /// Steps to the latest trial, whose value must be finite.
    pub(super) fn accept(&mut self) {
        self.x.copy_from_slice(&self.trial);
        self.value = self.trial_value;
        std::mem::swap(&mut self.gradient, &mut self.other_gradient);
        if self.objective.accepted(self.x) {
            self.value = self.objective.evaluate(self.x, &mut self.gradient);
            self.outcome.evaluations += 1;
        }
        self.outcome.iterations += 1;
        self.monitor.step(self.x);
        self.outcome.value = self.value;
        self.outcome.gradient_norm = norm(&self.gradient);
        if self.stalled() {
            self.end(Stop::Stalled);
        }
    }

    /// No step was found from here: ends with the reason.
    pub(super) fn give_up(&mut self) {
        self.end(if self.trial_value.is_finite() { Stop::LineSearch } else { Stop::NotANumber });
    }

    pub(super) fn outcome(&self) -> Outcome {
        self.outcome
    }

    fn end(&mut self, stop: Stop) {
        self.outcome.stop = stop;
        self.ended = true;
    }

    /// Whether the decrease over the latest steps has become too small to go on.
    fn stalled(&mut self) -> bool {
        self.past.push_back(self.value);
        if self.past.len() <= self.limits.window {
            return false;
        }
        let before = self.past.pop_front().unwrap_or(self.value);
        before - self.value < self.limits.decrease * before.abs()
    }
}
