//! What people see: progress and warnings on stderr, summaries on stdout.
#![expect(clippy::print_stderr, reason = "this file is the one that prints")]
use std::{
    error::Error,
    io::{IsTerminal, Write},
    sync::Mutex,
};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use serde_json::Value;

use crate::pipeline::{ConfigError, Event};

/// A warning.
pub(super) fn warning(text: &str) {
    eprintln!("warning: {text}");
}

/// A note.
pub(super) fn note(text: &str) {
    eprintln!("{text}");
}

/// Data on stdout; a reader that went away (`| head`) is no error.
pub(super) fn data(text: &str) {
    let mut out = std::io::stdout().lock();
    let _ =
        out.write_all(text.as_bytes()).and_then(|()| if text.ends_with('\n') { Ok(()) } else { out.write_all(b"\n") });
}

/// An error with its causes.
pub(super) fn error(err: &dyn Error) {
    let mut shown = err.to_string();
    eprintln!("error: {shown}");
    let mut cause = err.source();
    while let Some(it) = cause {
        let text = it.to_string();
        // Some errors hold the text of their cause already.
        if !shown.contains(&text) {
            eprintln!("  because: {text}");
        }
        shown = text;
        cause = it.source();
    }
}

/// A config error with its place.
pub(super) fn config_error(err: &ConfigError) {
    eprintln!("error: {err}");
    if let ConfigError::At { place: Some(place), .. } = err {
        eprintln!("{place}");
    }
}

/// One progress line per stage on a terminal, one plain line per finished stage elsewhere.
pub(super) struct Progress {
    bar: ProgressBar,
    quiet: bool,
    stage: Mutex<String>,
}

impl Progress {
    pub(super) fn new(quiet: bool) -> Self {
        let fancy = !quiet && std::io::stderr().is_terminal();
        let target = if fancy { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
        let bar = ProgressBar::with_draw_target(Some(1000), target);
        let style = ProgressStyle::with_template("{prefix:>9} {bar:24} {elapsed:>4} {wide_msg}");
        bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
        Self { bar, quiet, stage: Mutex::default() }
    }

    pub(super) fn tell(&self, event: Event<'_>) {
        match event {
            Event::Started { stage } => {
                if let Ok(mut current) = self.stage.lock() {
                    stage.clone_into(&mut current);
                }
                self.bar.reset();
                self.bar.set_prefix(stage.to_owned());
                self.bar.set_message("");
            }
            Event::Progress { done, note } => {
                self.bar.set_position((done.clamp(0.0, 1.0) * 1000.0) as u64);
                self.bar.set_message(note.to_owned());
            }
            Event::Finished { stage, seconds, cached } => {
                let how = if cached { "cached".into() } else { format!("{seconds:.2} s") };
                self.line(&format!("{stage:>9} {how}"));
            }
            Event::Warning(text) => self.bar.suspend(|| warning(text)),
        }
    }

    fn line(&self, text: &str) {
        if !self.quiet {
            self.bar.suspend(|| eprintln!("{text}"));
        }
    }

    pub(super) fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

/// Rows of the summary: label, path into the report, how to show the value.
const SUMMARY: &[(&str, &[(&str, &str)])] = &[
    (
        "input",
        &[
            ("/input/file", ""),
            ("/input/faces", "faces"),
            ("/input/genus", "genus"),
            ("/input/diagonal_mm", "mm diagonal"),
        ],
    ),
    (
        "developed",
        &[("/develop/covariance_energy", "energy"), ("/develop/hausdorff_pct", "% off"), ("/develop/folds", "folds")],
    ),
    ("cut", &[("/cut/pieces", "pieces"), ("/cut/seam_length_mm", "mm of seam"), ("/cut/narrow_necks", "narrow necks")]),
    (
        "flat",
        &[("/flatten/p99_abs_log_scale", "log scale (99 %)"), ("/flatten/max_abs_log_scale", "log scale (worst)")],
    ),
    ("sheets", &[("/layout/sheets", "sheets"), ("/layout/parts", "parts"), ("/layout/density", "density")]),
    (
        "machine",
        &[("/route/cut_mm", "mm cut"), ("/route/travel_mm", "mm travel"), ("/route/seconds_estimate", "s estimated")],
    ),
];

/// One screen: sizes, counts, failed checks, where to look next.
pub(super) fn summary(report: &Value, out: &str) {
    let mut text = String::new();
    for (label, cells) in SUMMARY {
        let cells: Vec<String> = cells
            .iter()
            .filter_map(|(path, unit)| {
                let value = report.pointer(path)?;
                let shown = match value {
                    Value::String(it) => it.clone(),
                    Value::Number(it) if it.is_f64() => short(it.as_f64()?),
                    other => other.to_string(),
                };
                Some(if unit.is_empty() { shown } else { format!("{shown} {unit}") })
            })
            .collect();
        if !cells.is_empty() {
            text += &format!("{label:>10}  {}\n", cells.join(", "));
        }
    }
    if let Some(size) = report.pointer("/input/size_mm").and_then(Value::as_array) {
        let size: Vec<_> = size.iter().filter_map(Value::as_f64).map(short).collect();
        text += &format!("{:>10}  {} mm\n", "size", size.join(" x "));
    }
    let checks = report["checks"].as_array().map(Vec::as_slice).unwrap_or_default();
    let failed: Vec<_> = checks.iter().filter(|it| it["ok"] == false).collect();
    text += &format!("{:>10}  {} of {} hold\n", "checks", checks.len() - failed.len(), checks.len());
    for check in failed {
        let number = |key: &str| check[key].as_f64().map(short).unwrap_or_default();
        let (name, unit) = (check["name"].as_str().unwrap_or_default(), check["unit"].as_str().unwrap_or_default());
        text += &format!("    FAILED  {name}: {} {unit}, limit {}\n", number("value"), number("limit"));
        text += &format!("            {}\n", check["note"].as_str().unwrap_or_default());
    }
    let files = report["files"].as_array().map_or(0, Vec::len);
    text += &format!("{:>10}  {files} files in {out} (report.json, sheets/, parts/, preview/, model/)\n", "written");
    data(&text);
}

/// Key and value, a line each, tables indented.
pub(super) fn facts(facts: &Value) {
    fn lines(value: &Value, indent: usize, out: &mut String) {
        for (key, value) in value.as_object().into_iter().flatten() {
            *out += &format!("{:indent$}{key}", "");
            match value {
                Value::Object(_) => {
                    out.push('\n');
                    lines(value, indent + 2, out);
                }
                Value::String(text) => *out += &format!("  {text}\n"),
                other => *out += &format!("  {other}\n"),
            }
        }
    }
    let mut text = String::new();
    lines(facts, 0, &mut text);
    data(&text);
}

/// Three or four significant digits.
fn short(value: f64) -> String {
    match value.abs() {
        x if x == 0.0 || x >= 1000.0 => format!("{value:.0}"),
        x if x >= 1.0 => format!("{value:.2}"),
        x if x >= 1e-3 => format!("{value:.4}"),
        _ => format!("{value:.1e}"),
    }
}
