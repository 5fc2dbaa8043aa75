//! Subgradient descent with Armijo's rule: the plainest method, for comparison.
use super::{Limits, Objective, Outcome, vector::dot, vector::largest, walk::Walk};
use crate::numeric::{Cancelled, Monitor};

/// The solver and its constants.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Subgradient {
    first_step: f64,
}

impl Subgradient {
    /// Share of the predicted decrease that a step must reach.
    const ARMIJO: f64 = 1e-4;
    /// Growth of the step after one that was accepted at once, and shortening of one that was not.
    const LENGTHEN: f64 = 2.0;
    const SHORTEN: f64 = 0.5;
    /// Trials per step; then it has become too short to change anything.
    const TRIES: usize = 60;

    /// Whose first step changes no component by more than `first_step`.
    pub fn new(first_step: f64) -> Self {
        Self { first_step }
    }

    /// Minimises `objective` from `x`, in place.
    pub fn minimize(
        &self,
        objective: &mut dyn Objective,
        x: &mut [f64],
        limits: &Limits,
        monitor: &Monitor,
    ) -> Result<Outcome, Cancelled> {
        let mut walk = Walk::new(objective, x, limits, monitor);
        let mut t = self.first_step / largest(&walk.gradient);
        let mut direction = vec![0.0; walk.x.len()];
        while walk.goes_on()? {
            direction.iter_mut().zip(&walk.gradient).for_each(|(d, g)| *d = -g);
            walk.objective.symmetrize(&mut direction);
            let slope = -dot(&walk.gradient, &walk.gradient);
            let mut tried = 0;
            while !(walk.sample(t, &direction)?.value <= walk.value + Self::ARMIJO * t * slope) {
                t *= Self::SHORTEN;
                tried += 1;
                if tried == Self::TRIES {
                    walk.give_up();
                    return Ok(walk.outcome());
                }
            }
            walk.accept();
            if tried == 0 {
                t *= Self::LENGTHEN;
            }
        }
        Ok(walk.outcome())
    }
}

#[cfg(test)]
mod tests {
    use super::{super::Stop, *};

    /// Σ k xₖ² + |xₙ|, of which every value is kept.
    struct Kinked {
        kink: f64,
        values: Vec<f64>,
    }
    impl Objective for Kinked {
        fn evaluate(&mut self, x: &[f64], gradient: &mut [f64]) -> f64 {
            let weighted = x.iter().zip(1_u8..);
            gradient.iter_mut().zip(weighted.clone()).for_each(|(g, (x, k))| *g = 2.0 * f64::from(k) * x);
            gradient[x.len() - 1] += self.kink * x[x.len() - 1].signum();
            weighted.map(|(x, k)| f64::from(k) * x * x).sum::<f64>() + self.kink * x[x.len() - 1].abs()
        }
        fn accepted(&mut self, x: &[f64]) -> bool {
            let value = self.evaluate(x, &mut vec![0.0; x.len()]);
            self.values.push(value);
            false
        }
    }

    #[test]
    fn descends_at_every_step_and_finds_a_smooth_minimum() {
        let limits = Limits { iterations: 2000, gradient: 1e-9, decrease: 0.0, window: 10 };
        for kink in [0.0, 1.0] {
            let mut objective = Kinked { kink, values: Vec::new() };
            let mut x = vec![0.7; 6];
            let out = Subgradient::new(0.1).minimize(&mut objective, &mut x, &limits, &Monitor::silent()).unwrap();
            assert!(objective.values.is_sorted_by(|a, b| a > b) && out.value < 0.2, "{out:?}");
            // Beside a kink steps along one subgradient become ever shorter.
            assert!(kink > 0.0 || out.stop == Stop::Gradient && out.value < 1e-15, "{out:?}");
        }
    }
}
