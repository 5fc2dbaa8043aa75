//! Runs a plan: cache or compute, then write everything.
use std::{
    error::Error as StdError,
    path::Path,
    sync::atomic::{AtomicBool, Ordering},
    time::Instant,
};

use serde_json::Value;

use super::{
    cache::{Cache, Lookup},
    deliver::deliver,
    input::Source,
    output::{Output, OutputError},
    plan::Plan,
};
use crate::{
    model::Artifact,
    numeric::Monitor,
    report::StageRow,
    stage::{Check, Cx, Key, Ready, Section, StageDef, Store},
};

/// What happens during a run, for whoever shows it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Event<'a> {
    /// A stage begins.
    Started {
        /// Its name.
        stage: &'a str,
    },
    /// A stage is at work.
    Progress {
        /// Share done, in [0, 1].
        done: f64,
        /// What it does at the moment.
        note: &'a str,
    },
    /// A stage is done.
    Finished {
        /// Its name.
        stage: &'a str,
        /// Time taken.
        seconds: f64,
        /// Whether the result came from the cache.
        cached: bool,
    },
    /// Something the user should know.
    Warning(&'a str),
}

/// Which stages to run.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Range {
    /// Compute this stage and all later ones even where the cache has them.
    pub from: Option<String>,
    /// Stop after this stage.
    pub to: Option<String>,
}

/// Why a run did not end well enough to have a complete report.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// Ctrl-C, or whoever called asked to stop.
    #[error("interrupted; finished stages are kept, and the next run goes on from there")]
    Interrupted,
    /// Output.
    #[error(transparent)]
    Output(#[from] OutputError),
}

/// How a run ended.
#[derive(Debug, Clone, PartialEq)]
pub struct Outcome {
    /// `report.json`.
    pub report: Value,
    /// The stage that could not finish, with its reasons from the outside in.
    pub failure: Option<(String, Vec<String>)>,
}

impl Outcome {
    /// Whether all checks hold and every stage finished.
    pub fn ok(&self) -> bool {
        self.report["status"] == "ok"
    }
}

/// Runs the stages of `plan` on `source` and writes all results under `out`.
///
/// A stage that fails ends the computation, not the run: what was finished is written and the report says what failed.
pub fn run(
    plan: &Plan,
    source: Source,
    out: &Path,
    range: &Range,
    cancel: &AtomicBool,
    tell: &(dyn Fn(Event<'_>) + Sync),
) -> Result<Outcome, RunError> {
    let start = Instant::now();
    let output = Output::open(out)?;
    let cache = Cache::new(out);
    let cancelled = || cancel.load(Ordering::Relaxed);
    let progress = |done: f64, note: &str| tell(Event::Progress { done, note });
    let seconds = || start.elapsed().as_secs_f64();
    let monitor = Monitor::new(&cancelled, &progress, &seconds);

    let Source { artifact, key, beside, facts, .. } = source;
    let mut store = Store::default();
    store.put(artifact, key);
    beside.into_iter().for_each(|(artifact, key)| store.put(artifact, key));
    let mut section = Section::new("input", facts);
    let mut rows = Vec::new();
    let mut failure = None;
    let mut forced = false;
    for (def, ready) in &plan.stages {
        if cancelled() {
            return Err(RunError::Interrupted);
        }
        let lap = Instant::now();
        tell(Event::Started { stage: def.name });
        let key = stage_key(&store, def, &ready.options_key);
        forced |= range.from.as_deref() == Some(def.name);
        let found = match if forced { Lookup::Miss } else { cache.get(def, &key) } {
            Lookup::Hit(found) => Some(*found),
            Lookup::Miss => None,
            Lookup::Broken(why) => {
                tell(Event::Warning(&format!("cache: {why}; computing `{}` again", def.name)));
                None
            }
        };
        let cached = found.is_some();
        let made = match found {
            Some(it) => it,
            None => match compute((def, ready), &key, &store, (plan.seed, &monitor), (&cache, forced), tell) {
                Ok(it) => it,
                Err(_) if cancelled() => return Err(RunError::Interrupted),
                Err(err) => {
                    let mut reasons = vec![err.to_string()];
                    let mut cause = err.source();
                    while let Some(it) = cause {
                        reasons.push(it.to_string());
                        cause = it.source();
                    }
                    failure = Some((def.name.to_owned(), reasons));
                    break;
                }
            },
        };
        if !cached {
            // A full disk must not lose the result: it only costs the next run its cache.
            if let Err(err) = cache.put(def, &key, &made.0, &made.1) {
                tell(Event::Warning(&format!("cache: the result of `{}` could not be kept: {err}", def.name)));
            }
        }
        let seconds = lap.elapsed().as_secs_f64();
        tell(Event::Finished { stage: def.name, seconds, cached });
        made.0.into_iter().for_each(|it| store.put(it, key));
        section.tables.extend(made.1.tables);
        section.checks.extend(made.1.checks);
        rows.push(StageRow { name: def.name, seconds, cached });
        if range.to.as_deref() == Some(def.name) {
            break;
        }
    }
    if let Some((stage, reasons)) = &failure {
        section.checks.push(Check {
            name: stage.clone(),
            ok: false,
            value: 0.0,
            limit: 1.0,
            unit: "stage finished".into(),
            note: reasons.join(": "),
        });
    }
    let report = deliver(plan, &store, &output, section, &rows, &monitor, tell)?;
    Ok(Outcome { report, failure })
}

/// Runs a stage, from where it was interrupted unless it was `forced` to begin anew.
fn compute(
    (def, ready): (&StageDef, &Ready),
    key: &Key,
    store: &Store,
    (seed, monitor): (u64, &Monitor<'_>),
    (cache, forced): (&Cache, bool),
    tell: &(dyn Fn(Event<'_>) + Sync),
) -> Result<(Vec<Artifact>, Section), Box<dyn StdError + Send + Sync>> {
    let kept = if forced { None } else { cache.unfinished(def, key) };
    let keep = |artifact: Artifact| {
        if let Err(err) = cache.keep(def, key, &artifact) {
            tell(Event::Warning(&format!("cache: what `{}` has done so far could not be kept: {err}", def.name)));
        }
    };
    (ready.run)(store, &Cx { seed, monitor: *monitor, kept: kept.as_ref(), keep: &keep })
}

/// Hash of the options of a stage and the keys of all its inputs.
fn stage_key(store: &Store, def: &StageDef, options: &Key) -> Key {
    let mut hasher = blake3::Hasher::new();
    hasher.update(options);
    for &kind in def.needs {
        hasher.update(&store.key(kind).expect("the plan proved that every input is made"));
    }
    for key in def.wants.iter().filter_map(|&kind| store.key(kind)) {
        hasher.update(&key);
    }
    *hasher.finalize().as_bytes()
}
