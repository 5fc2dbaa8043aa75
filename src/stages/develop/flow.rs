//! The objective that the optimiser sees: energy, barriers and fidelity of one mesh at mean edge length 1.
use super::{Evaluator, Parts, curvature::Curvature, fidelity::Fidelity, set_positions};
use crate::{
    mesh::TriMesh,
    numeric::{
        optim::{Curved, Objective},
        sparse::SymmetricMatrix,
    },
};

/// F = Σλ + barriers + fidelity.
pub(super) struct Flow<'a, 'b> {
    evaluator: &'a mut Evaluator,
    hold: Option<&'a mut Fidelity<'b>>,
    /// Gradient of energy and barriers at the latest point, so that refreshed closest points cost no evaluation of them.
    shape_gradient: Vec<f64>,
    parts: Parts,
    /// The latest point was accepted and only the closest points changed.
    stale_hold: bool,
}

impl<'a, 'b> Flow<'a, 'b> {
    pub(super) fn new(evaluator: &'a mut Evaluator, hold: Option<&'a mut Fidelity<'b>>) -> Self {
        Self { evaluator, hold, shape_gradient: Vec::new(), parts: Parts::default(), stale_hold: false }
    }
}

impl Objective for Flow<'_, '_> {
    fn evaluate(&mut self, x: &[f64], gradient: &mut [f64]) -> f64 {
        if std::mem::take(&mut self.stale_hold) {
            gradient.copy_from_slice(&self.shape_gradient);
        } else {
            self.parts = self.evaluator.evaluate(x, gradient);
            if self.hold.is_some() {
                self.shape_gradient.resize(x.len(), 0.0);
                self.shape_gradient.copy_from_slice(gradient);
            }
        }
        self.parts.total() + self.hold.as_mut().map_or(0.0, |it| it.evaluate(x, gradient))
    }

    fn accepted(&mut self, x: &[f64]) -> bool {
        self.stale_hold = self.hold.as_mut().is_some_and(|it| it.refresh(x));
        self.stale_hold
    }
}

/// A [`Flow`] with its curvature.
pub(super) struct CurvedFlow<'a, 'b> {
    pub(super) flow: Flow<'a, 'b>,
    pub(super) curvature: &'a Curvature,
    /// Of the connectivity; its positions follow.
    pub(super) mesh: TriMesh,
}

impl Objective for CurvedFlow<'_, '_> {
    /// With true distances at every point: its steps are long, and old closest points would hold back vertices that slide
    /// along the source.
    fn evaluate(&mut self, x: &[f64], gradient: &mut [f64]) -> f64 {
        if let Some(hold) = self.flow.hold.as_mut() {
            hold.refresh(x);
        }
        self.flow.evaluate(x, gradient)
    }
}

impl Curved for CurvedFlow<'_, '_> {
    fn curvature(&mut self, x: &[f64], hessian: &mut SymmetricMatrix) {
        set_positions(&mut self.mesh, x);
        let hold = self.flow.hold.as_deref().map(|it| (it, x));
        self.curvature.assemble(&self.mesh, self.flow.evaluator, hold, hessian);
    }
}
