//! The objective that the optimiser sees: energy, barriers, fidelity and curves of one mesh at mean edge length 1.
use super::{
    Evaluator, Parts, barrier, curvature::Curvature, curves::Curves, fidelity::Fidelity, measure::FOLDED, set_positions,
};
use crate::{
    mesh::{EdgeId, Symmetries, TriMesh},
    numeric::{
        optim::{Curved, Objective},
        sparse::SymmetricMatrix,
    },
};

/// F = Σλ + barriers + fidelity + curves, infinite where an edge is folded that was not at the latest accepted point: a long
/// step may jump over a barrier, but is not taken then. (Within a connected surface a face cannot turn over without folding
/// an edge to a neighbour that did not.)
pub(super) struct Flow<'a, 'b> {
    evaluator: &'a mut Evaluator,
    hold: Option<&'a mut Fidelity<'b>>,
    curves: Option<&'a mut Curves<'b>>,
    /// Of the connectivity.
    mesh: &'a TriMesh,
    symmetries: &'a Symmetries,
    /// Gradient of energy and barriers at the latest point, so that refreshed closest points cost no evaluation of them.
    shape_gradient: Vec<f64>,
    parts: Parts,
    /// The latest point was accepted and only the closest points changed.
    stale_hold: bool,
    /// Folded edges at the latest accepted point; `None` before the first.
    folded: Option<Vec<EdgeId>>,
}

impl<'a, 'b> Flow<'a, 'b> {
    pub(super) fn new(
        evaluator: &'a mut Evaluator,
        hold: Option<&'a mut Fidelity<'b>>,
        curves: Option<&'a mut Curves<'b>>,
        mesh: &'a TriMesh,
        symmetries: &'a Symmetries,
    ) -> Self {
        Self {
            evaluator,
            hold,
            curves,
            mesh,
            symmetries,
            shape_gradient: Vec::new(),
            parts: Parts::default(),
            stale_hold: false,
            folded: None,
        }
    }

    /// The latest point evaluated was accepted.
    fn settle(&mut self) {
        // It has no folds but those of the point before, so only their end is news.
        let folded = self.folded();
        if let Some(before) = &mut self.folded {
            before.retain(|e| folded.binary_search(e).is_ok());
        }
    }

    /// Folded edges at the latest point evaluated, ascending.
    fn folded(&self) -> Vec<EdgeId> {
        let (root, _) = barrier::FOLD.root(FOLDED);
        // One folded edge alone would cost more than this.
        if self.parts.fold < self.evaluator.weights().fold * root * root {
            return Vec::new();
        }
        let cosine = |e: EdgeId| {
            let h = self.mesh.halfedge(e);
            let twin = self.mesh.twin(h)?;
            let [n, m] = [h, twin].map(|h| self.evaluator.normal(self.mesh.face(h)));
            Some(n.dot(&m))
        };
        self.mesh.edges().filter(|&e| cosine(e).is_some_and(|cosine| cosine < FOLDED)).collect()
    }
}

impl Objective for Flow<'_, '_> {
    fn evaluate(&mut self, x: &[f64], gradient: &mut [f64]) -> f64 {
        if std::mem::take(&mut self.stale_hold) {
            gradient.copy_from_slice(&self.shape_gradient);
        } else {
            self.parts = self.evaluator.evaluate(x, gradient);
            let folded = self.folded();
            let before = self.folded.get_or_insert_with(|| folded.clone());
            if folded.iter().any(|e| before.binary_search(e).is_err()) {
                return f64::INFINITY;
            }
            if self.hold.is_some() || self.curves.is_some() {
                self.shape_gradient.resize(x.len(), 0.0);
                self.shape_gradient.copy_from_slice(gradient);
            }
        }
        let hold = self.hold.as_mut().map_or(0.0, |it| it.evaluate(x, gradient));
        let curves = self.curves.as_mut().map_or(0.0, |it| it.evaluate(x, gradient));
        self.parts.total() + hold + curves
    }

    fn accepted(&mut self, x: &[f64]) -> bool {
        self.settle();
        let pulled = self.hold.as_mut().is_some_and(|it| it.refresh_pulled(x));
        let hold = self.hold.as_mut().is_some_and(|it| it.refresh(x)) || pulled;
        let curves = self.curves.as_mut().is_some_and(|it| it.refresh(x));
        self.stale_hold = hold || curves;
        self.stale_hold
    }

    fn symmetrize(&self, direction: &mut [f64]) {
        self.symmetries.symmetrize(direction);
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
        if let Some(curves) = self.flow.curves.as_mut() {
            curves.refresh(x);
        }
        self.flow.evaluate(x, gradient)
    }

    fn accepted(&mut self, x: &[f64]) -> bool {
        self.flow.settle();
        self.flow.stale_hold = self.flow.hold.as_mut().is_some_and(|it| it.refresh_pulled(x));
        self.flow.stale_hold
    }

    fn symmetrize(&self, direction: &mut [f64]) {
        self.flow.symmetrize(direction);
    }
}

impl Curved for CurvedFlow<'_, '_> {
    fn curvature(&mut self, x: &[f64], hessian: &mut SymmetricMatrix) {
        set_positions(&mut self.mesh, x);
        let hold = self.flow.hold.as_deref().map(|it| (it, x));
        self.curvature.assemble(&self.mesh, self.flow.evaluator, hold, hessian);
        if let Some(curves) = self.flow.curves.as_deref() {
            self.curvature.add_curves(curves, x, hessian);
        }
    }
}
