//! The objective that the optimiser sees: energy, barriers and fidelity of one mesh at mean edge length 1.
use super::{Evaluator, Parts, fidelity::Fidelity};
use crate::numeric::optim::Objective;

/// F = Σλ + barriers + fidelity.
pub(super) struct Flow<'a, 'b> {
    pub(super) evaluator: &'a mut Evaluator,
    pub(super) fidelity: Option<&'a mut Fidelity<'b>>,
    /// Gradient of energy and barriers at the latest point, so that refreshed closest points cost no evaluation of them.
    shape_gradient: Vec<f64>,
    pub(super) parts: Parts,
    /// The latest point was accepted and only the closest points changed.
    stale_fidelity: bool,
}

impl<'a, 'b> Flow<'a, 'b> {
    pub(super) fn new(evaluator: &'a mut Evaluator, fidelity: Option<&'a mut Fidelity<'b>>) -> Self {
        Self { evaluator, fidelity, shape_gradient: Vec::new(), parts: Parts::default(), stale_fidelity: false }
    }
}

impl Objective for Flow<'_, '_> {
    fn evaluate(&mut self, x: &[f64], gradient: &mut [f64]) -> f64 {
        if std::mem::take(&mut self.stale_fidelity) {
            gradient.copy_from_slice(&self.shape_gradient);
        } else {
            self.parts = self.evaluator.evaluate(x, gradient);
            if self.fidelity.is_some() {
                self.shape_gradient.resize(x.len(), 0.0);
                self.shape_gradient.copy_from_slice(gradient);
            }
        }
        let fidelity = self.fidelity.as_mut().map_or(0.0, |it| it.evaluate(x, gradient));
        self.parts.total() + fidelity
    }

    fn accepted(&mut self, x: &[f64]) -> bool {
        self.stale_fidelity = self.fidelity.as_mut().is_some_and(|it| it.refresh(x));
        self.stale_fidelity
    }
}
