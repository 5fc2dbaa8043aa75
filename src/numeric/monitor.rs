//! How a kernel talks to whoever started it, without a clock, a print or a thread of its own.

/// The run was interrupted; the kernel stopped at the next safe place.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("interrupted")]
pub struct Cancelled;

/// Progress, cancellation and lap times, handed down to a kernel.
#[derive(Clone, Copy)]
pub struct Monitor<'a> {
    cancelled: &'a (dyn Fn() -> bool + Sync),
    progress: &'a (dyn Fn(f64, &str) + Sync),
    seconds: &'a (dyn Fn() -> f64 + Sync),
    step: &'a (dyn Fn(&[f64]) + Sync),
}

impl<'a> Monitor<'a> {
    /// `cancelled` is polled; `progress` takes the share done in [0, 1] and a short note; `seconds` is a clock that
    /// only feeds keys of the report that may differ between runs.
    pub fn new(
        cancelled: &'a (dyn Fn() -> bool + Sync),
        progress: &'a (dyn Fn(f64, &str) + Sync),
        seconds: &'a (dyn Fn() -> f64 + Sync),
    ) -> Self {
        Self { cancelled, progress, seconds, step: &|_| () }
    }

    /// A monitor that never cancels and tells nobody: for tests and library callers.
    pub fn silent() -> Monitor<'static> {
        Monitor { cancelled: &|| false, progress: &|_, _| (), seconds: &|| 0.0, step: &|_| () }
    }

    /// Lets `step` hear of the variables after every accepted step of an optimiser, in that optimiser's own unit: for
    /// measurements of how fast it converges.
    pub fn watching(self, step: &'a (dyn Fn(&[f64]) + Sync)) -> Self {
        Self { step, ..self }
    }

    /// `Err(Cancelled)` once the run should stop. Call it at least every tenth of a second.
    pub fn check(&self) -> Result<(), Cancelled> {
        if (self.cancelled)() { Err(Cancelled) } else { Ok(()) }
    }

    /// Reports the share done, in [0, 1].
    pub fn progress(&self, done: f64, note: &str) {
        (self.progress)(done, note);
    }

    /// Reports the variables of an optimiser after an accepted step.
    pub fn step(&self, x: &[f64]) {
        (self.step)(x);
    }

    /// Seconds since some fixed moment; 0 in a silent monitor. Never steer an algorithm by it.
    pub fn seconds(&self) -> f64 {
        (self.seconds)()
    }
}
