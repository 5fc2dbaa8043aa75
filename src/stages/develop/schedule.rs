//! What each round of each level does: one rule for all, and what was asked otherwise for some.
use super::{DevelopError, Optimizer, Options, barrier::Weights, energy::Energy};

/// Weight of the fidelity term in the first and the last round of the last level; before, it is between them.
const HOLD: [f64; 2] = [6.0, 90.0];
/// Weight of the pull towards the source over the energy at the start of a round, in the first and the last round of the
/// last level: where the energy is low already, closeness may cost less of it, and at the start of the first it is high.
const PULL: [f64; 2] = [0.04, 0.37];
/// Weights of the barriers on the coarsest level.
const BARRIERS: Weights = Weights { angle: 3e-4, fold: 0.01, defect: 0.1, area: 1e-4 };
/// Relative decrease of the objective over the window of an optimiser below which a round ends, and the last one, after which
/// nothing is mended but what breaks the promise.
const DECREASE: [f64; 2] = [1e-2, 5e-3];
/// Norm of the gradient at mean edge length 1, over √(3 V), below which it does.
const GRADIENT: f64 = 1e-10;

/// What some rounds do otherwise. A value that is `None` stays as it is.
#[derive(Debug, Clone, Copy, Default)]
pub struct Override {
    /// Only on this level; the coarsest is 0.
    pub level: Option<usize>,
    /// Only in this round of a level, from 0.
    pub round: Option<usize>,
    /// The energy.
    pub energy: Option<&'static Energy>,
    /// The optimiser.
    pub optimizer: Option<Optimizer>,
    /// Distance from the source from which the hold on it acts, mm. What is promised in the end stays as it is.
    pub max_deviation: Option<f64>,
    /// Most steps.
    pub iterations: Option<usize>,
    /// Relative decrease below which the round ends.
    pub decrease: Option<f64>,
    /// Scaled norm of the gradient below which it ends.
    pub gradient: Option<f64>,
    /// Weight of the hold on the source.
    pub hold: Option<f64>,
    /// Weight of the pull towards it, over the energy at the start of the round.
    pub pull: Option<f64>,
    /// Weight of the angle barrier.
    pub angle: Option<f64>,
    /// Weight of the fold barrier.
    pub fold: Option<f64>,
    /// Weight of the angle-defect barrier.
    pub defect: Option<f64>,
    /// Weight of the area term.
    pub area: Option<f64>,
}

/// All that a round needs to know.
#[derive(Debug, Clone, Copy)]
pub(super) struct Settings {
    pub(super) energy: &'static Energy,
    /// Never [`Optimizer::Auto`].
    pub(super) optimizer: Optimizer,
    pub(super) max_deviation: f64,
    pub(super) iterations: Option<usize>,
    /// Whether it is the last round of the last level.
    pub(super) last: bool,
    pub(super) decrease: f64,
    pub(super) gradient: f64,
    pub(super) hold: f64,
    pub(super) pull: f64,
    pub(super) weights: Weights,
}

impl Options {
    /// Rounds on one level: coarse ones only prepare the last, and have one.
    pub(super) fn rounds_on(&self, level: usize, levels: usize) -> usize {
        if level < levels { 1 } else { self.rounds }
    }
}

impl Settings {
    /// Those of one round of one level, of so many above the coarsest.
    pub(super) fn of(options: &Options, [level, levels]: [usize; 2], round: usize) -> Self {
        // Sums over faces and corners grow by 4 with each level; the energy of a seam does not.
        let shrink = 0.25_f64.powi(level as i32);
        let share = match options.rounds {
            _ if level < levels => 0.5,
            1 => 1.0,
            rounds => round as f64 / (rounds - 1) as f64,
        };
        let last = level == levels && round + 1 == options.rounds;
        let mut settings = Self {
            energy: options.energy,
            optimizer: options.optimizer,
            max_deviation: options.max_deviation,
            iterations: options.iterations,
            decrease: DECREASE[usize::from(last)],
            last,
            gradient: GRADIENT,
            hold: HOLD[0] * (HOLD[1] / HOLD[0]).powf(share),
            pull: match round {
                _ if level < levels => 0.0,
                0 => PULL[0],
                _ => PULL[0] + share * (PULL[1] - PULL[0]),
            },
            weights: Weights { angle: BARRIERS.angle * shrink, area: BARRIERS.area * shrink, ..BARRIERS },
        };
        let concerns = |it: &&Override| it.level.is_none_or(|l| l == level) && it.round.is_none_or(|r| r == round);
        for it in options.overrides.iter().filter(concerns) {
            settings.replace(it);
        }
        if settings.optimizer == Optimizer::Auto {
            settings.optimizer =
                if settings.energy.has_curvature() { Optimizer::Levenberg } else { Optimizer::LbfgsH2 };
        }
        settings
    }

    fn replace(&mut self, it: &Override) {
        self.energy = it.energy.unwrap_or(self.energy);
        self.optimizer = it.optimizer.unwrap_or(self.optimizer);
        self.max_deviation = it.max_deviation.unwrap_or(self.max_deviation);
        self.iterations = it.iterations.or(self.iterations);
        self.decrease = it.decrease.unwrap_or(self.decrease);
        self.gradient = it.gradient.unwrap_or(self.gradient);
        self.hold = it.hold.unwrap_or(self.hold);
        self.pull = it.pull.unwrap_or(self.pull);
        let weights = &mut self.weights;
        weights.angle = it.angle.unwrap_or(weights.angle);
        weights.fold = it.fold.unwrap_or(weights.fold);
        weights.defect = it.defect.unwrap_or(weights.defect);
        weights.area = it.area.unwrap_or(weights.area);
    }

    /// `Err` if the optimiser of some round does not know its energy.
    pub(super) fn check(options: &Options, levels: usize) -> Result<(), DevelopError> {
        let rounds_on = |level| (0..options.rounds_on(level, levels)).map(move |round| (level, round));
        for (level, round) in (0..=levels).flat_map(rounds_on) {
            let Self { energy, optimizer, .. } = Self::of(options, [level, levels], round);
            if optimizer == Optimizer::Levenberg && !energy.has_curvature() {
                return Err(DevelopError::NoCurvature { energy: energy.name, level, round: round + 1 });
            }
        }
        Ok(())
    }
}
