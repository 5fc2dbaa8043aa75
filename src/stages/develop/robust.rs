//! A robust loss over the energies of the vertices: few sharp seams instead of many soft ones.
use super::energy::Pull;
use crate::numeric::lanes::{LANES, Lanes};

/// ρ(λ) = σ ln(1 + λ/σ): λ where it is small against σ, hardly growing where it is large. So vertices that are bad anyway
/// take over what their neighbours have.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Robust {
    /// σ.
    pub sigma: f64,
}

impl Robust {
    /// ρ.
    pub(super) fn value(self, lambda: f64) -> f64 {
        self.sigma * (lambda / self.sigma).ln_1p()
    }

    /// ρ′ = 1/(1 + λ/σ), the weight of the vertex in a step of iteratively reweighted least squares. (ρ″ < 0 has no place in
    /// a positive semidefinite model.)
    pub(super) fn slope(self, lambda: f64) -> f64 {
        1.0 / (1.0 + lambda / self.sigma)
    }

    /// Scales the pulls of the stars of a batch by ρ′; returns ρ − λ. A call of its own, so that the pass without it stays as
    /// it is.
    #[inline(never)]
    pub(super) fn soften(self, lambda: Lanes, pulls: &mut [Pull]) -> Lanes {
        let slope = Lanes::from_fn(|i| self.slope(lambda.0[i]));
        for pull in pulls {
            pull.normal = pull.normal.scale(slope);
            for i in 0..LANES {
                pull.angle.0[i] *= slope.0[i];
                pull.area.0[i] *= slope.0[i];
            }
        }
        Lanes::from_fn(|i| self.value(lambda.0[i]) - lambda.0[i])
    }
}
