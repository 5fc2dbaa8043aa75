//! The weak Wolfe line search by bisection of Lewis and Overton ("Nonsmooth optimization via quasi-Newton methods", 2013,
//! algorithm 2.6), which also works where the function has kinks.

/// Constants of the search.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Wolfe {
    /// Share c₁ of the predicted decrease that a step must reach.
    pub decrease: f64,
    /// Share c₂ of the initial slope below which the slope must have fallen.
    pub curvature: f64,
    /// Most trial steps.
    pub tries: usize,
}

/// Value and slope along the search line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Sample {
    pub value: f64,
    pub slope: f64,
}

impl Wolfe {
    /// Finds a step t > 0, beginning with `first`, such that f(t) ≤ f(0) + c₁ t f'(0) and f'(t) ≥ c₂ f'(0); `at` evaluates
    /// and may return a value that is not finite. The last call of `at` is the accepted step. `Ok(None)` when no step
    /// satisfies both within the tries.
    pub(super) fn search<E>(
        &self,
        start: Sample,
        first: f64,
        mut at: impl FnMut(f64) -> Result<Sample, E>,
    ) -> Result<Option<(f64, Sample)>, E> {
        let (mut low, mut high, mut t) = (0.0, f64::INFINITY, first);
        for _ in 0..self.tries {
            let here = at(t)?;
            if !(here.value <= start.value + self.decrease * t * start.slope) || !here.slope.is_finite() {
                high = t;
            } else if here.slope < self.curvature * start.slope {
                low = t;
            } else {
                return Ok(Some((t, here)));
            }
            t = if high.is_finite() { 0.5 * (low + high) } else { 2.0 * low };
            if t == low || t == high {
                break;
            }
        }
        Ok(None)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WOLFE: Wolfe = Wolfe { decrease: 1e-4, curvature: 0.99, tries: 100 };

    fn search(first: f64, f: impl Fn(f64) -> (f64, f64)) -> Option<f64> {
        let sample = |t| {
            let (value, slope) = f(t);
            Sample { value, slope }
        };
        WOLFE.search(sample(0.0), first, |t| Ok::<_, ()>(sample(t))).unwrap().map(|it| it.0)
    }

    #[test]
    fn expands_and_bisects_until_both_conditions_hold() {
        let quadratic = |t: f64| ((t - 3.0) * (t - 3.0), 2.0 * (t - 3.0));
        for first in [1e-6, 1.0, 50.0] {
            let t = search(first, quadratic).unwrap();
            let (f0, s0) = quadratic(0.0);
            let (f, s) = quadratic(t);
            assert!(f <= f0 + 1e-4 * t * s0 && s >= 0.99 * s0, "{first} {t}");
        }
    }

    #[test]
    fn steps_back_from_the_infeasible() {
        let log_barrier =
            |t: f64| if t < 1.0 { (-t - (1.0 - t).ln(), -1.0 + 1.0 / (1.0 - t) - 0.5) } else { (f64::NAN, f64::NAN) };
        let t = search(64.0, |t| {
            let (v, s) = log_barrier(t);
            (v - 0.5 * t, s)
        })
        .unwrap();
        assert!(t < 1.0);
    }

    #[test]
    fn stops_at_a_kink() {
        let kink = |t: f64| if t < 0.7 { (-t, -1.0) } else { (-0.7 + 2.0 * (t - 0.7), 2.0) };
        assert!(search(1.0, kink).is_some());
        // Unbounded below: no step can satisfy the slope condition.
        assert_eq!(search(1.0, |t| (-t, -1.0)), None);
    }
}
