//! What people see: progress and warnings on stderr, summaries on stdout.
#![expect(clippy::print_stderr, reason = "this file is the one that prints")]
use std::{
    error::Error,
    io::{IsTerminal, Write},
    path::Path,
    sync::Mutex,
};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use serde_json::Value;

use crate::pipeline::{ConfigError, Event, Plan, Source, estimate};

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
        let style = ProgressStyle::with_template(
            "{prefix:>9} {bar:24} {percent:>3} %  {elapsed} so far, {eta} to go  {wide_msg}",
        );
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

/// A number of things: "1 sheet", "2 sheets".
pub(super) fn count(number: usize, thing: &str) -> String {
    format!("{number} {thing}{}", if number == 1 { "" } else { "s" })
}

/// Seconds as people say them.
fn duration(seconds: f64) -> String {
    match seconds {
        s if s < 10.0 => format!("{s:.1} s"),
        s if s < 90.0 => format!("{s:.0} s"),
        s if s < 5400.0 => format!("{:.0} min", s / 60.0),
        s => format!("{:.1} h", s / 3600.0),
    }
}

/// A line with its label.
fn line(label: &str, text: &str) -> String {
    format!("{label:>10}  {text}\n")
}

/// Sides in millimetres: "119 x 160 x 127 mm".
fn sides(list: &Value, decimals: usize) -> Option<String> {
    let sides: Vec<String> =
        list.as_array()?.iter().filter_map(Value::as_f64).map(|it| format!("{it:.decimals$}")).collect();
    Some(format!("{} mm", sides.join(" x ")))
}

/// What was made: labels and figures; those that the job has not made are empty.
fn results(report: &Value) -> Vec<(&'static str, String)> {
    let number = |path: &str| report.pointer(path).and_then(Value::as_f64);
    let whole = |path: &str| report.pointer(path).and_then(Value::as_u64).map(|it| it as usize);
    let join = |parts: Vec<Option<String>>| parts.into_iter().flatten().collect::<Vec<_>>().join(", ");
    let percent = |path: &str, of: &str| number(path).map(|it| format!("{} % {of}", short(it)));
    vec![
        (
            "model",
            join(vec![
                report.pointer("/input/file").and_then(Value::as_str).map(str::to_owned),
                report.pointer("/input/size_mm").and_then(|it| sides(it, 0)),
                whole("/input/faces").map(|it| count(it, "face")),
            ]),
        ),
        (
            "deviation",
            join(vec![
                percent("/develop/hausdorff_pct", "of the diagonal")
                    .or_else(|| percent("/coarsen/hausdorff_pct", "of the diagonal")),
                number("/develop/covariance_energy").map(|it| format!("developability energy {}", short(it))),
            ]),
        ),
        (
            "pieces",
            join(vec![
                whole("/cut/pieces").or_else(|| whole("/layout/parts")).map(|it| count(it, "piece")),
                number("/cut/seam_length_mm")
                    .or_else(|| number("/unfold/seam_length_mm"))
                    .map(|it| format!("{:.1} m of seams", it / 1000.0)),
                whole("/cut/narrow_necks").filter(|it| *it > 0).map(|it| count(it, "narrow neck")),
            ]),
        ),
        (
            "stretch",
            join(vec![
                number("/flatten/p99_principal_stretch")
                    .map(|it| format!("{} % on 99 % of the area", short(100.0 * it))),
                number("/flatten/max_principal_stretch").map(|it| format!("at most {} %", short(100.0 * it))),
            ]),
        ),
        (
            "sheets",
            join(vec![
                whole("/layout/sheets").map(|it| count(it, "sheet")),
                report.pointer("/layout/sheet_mm").and_then(|it| sides(it, 0)),
                number("/layout/density").map(|it| format!("{:.0} % used", 100.0 * it)),
            ]),
        ),
        (
            "machine",
            join(vec![
                number("/route/seconds_estimate").map(|it| format!("about {}", duration(it))),
                number("/shopping/cut_m").map(|it| format!("{} m to cut", short(it))),
            ]),
        ),
    ]
}

/// One screen: size, pieces, sheets, stretch, deviation, failed checks, where to look next.
pub(super) fn summary(report: &Value, out: &str) {
    let mut rows = results(report);
    let checks = report["checks"].as_array().map(Vec::as_slice).unwrap_or_default();
    let failed: Vec<_> = checks.iter().filter(|it| it["ok"] == false).collect();
    rows.push(("checks", format!("{} of {} hold", checks.len() - failed.len(), checks.len())));
    let mut text: String = rows.iter().filter(|it| !it.1.is_empty()).map(|it| line(it.0, &it.1)).collect();
    for check in failed {
        let number = |key: &str| check[key].as_f64().map(short).unwrap_or_default();
        let (name, unit) = (check["name"].as_str().unwrap_or_default(), check["unit"].as_str().unwrap_or_default());
        text += &format!("    FAILED  {name}: {} {unit}, limit {}\n", number("value"), number("limit"));
        text += &format!("            {}\n", check["note"].as_str().unwrap_or_default());
    }
    let files = report["files"].as_array().map_or(0, Vec::len);
    text += &line("written", &format!("{files} files in {out}"));
    text += &line("look at", &format!("{out}/report.html"));
    data(&text);
}

/// What a job will do, before it runs.
pub(super) fn forecast(plan: &Plan, source: &Source, dir: &Path) -> String {
    let facts = &source.facts;
    let of = |key: &str| facts[key].as_u64().map_or(0, |it| it as usize);
    let stages: Vec<_> = plan.stages.iter().map(|(def, _)| def.name).collect();
    let shape = match (of("components"), of("boundary_loops")) {
        (1, 0) => "closed".to_owned(),
        (1, n) => count(n, "boundary loop"),
        (parts, n) => format!("{}, {}", count(parts, "component"), count(n, "boundary loop")),
    };
    let file = facts["file"].as_str().unwrap_or_default();
    let mesh = format!("{file}, {}, {shape}, genus {}", count(of("faces"), "face"), of("genus"));
    let mut text = line("mesh", &mesh) + &line("size", &sides(&facts["size_mm"], 1).unwrap_or_default());
    for repair in facts["repairs"].as_array().into_iter().flatten().filter_map(Value::as_str) {
        text += &line("repaired", repair);
    }
    text += &line("recipe", &format!("{}: {}", plan.recipe, stages.join(" > ")));
    text += &line("material", &plan.profiles.material.title);
    text += &line("machine", &plan.profiles.machine.title);
    if let Some(about) = estimate(plan, source) {
        let sheet = plan.profiles.material.sheet.map(|it| format!("{:.0}", it.mm)).join(" x ");
        text += &line("sheets", &format!("roughly {} of {sheet} mm, {:.1} m to cut", about.sheets, about.cut_m));
        let on_machine = Some(about.machine_seconds).filter(|it| *it > 0.0);
        let on_machine = on_machine.map(|it| format!(", {} on the machine", duration(it))).unwrap_or_default();
        text += &line("time", &format!("roughly {} to compute{on_machine}", duration(about.computing_seconds)));
    }
    text += &line("formats", &plan.formats.join(", "));
    text + &line("output", &dir.display().to_string())
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

/// Three or four significant digits; what is zero but for rounding is 0.
fn short(value: f64) -> String {
    match value.abs() {
        x if !(1e-9..1000.0).contains(&x) => format!("{value:.0}"),
        x if x >= 1.0 => format!("{value:.2}"),
        x if x >= 1e-3 => format!("{value:.4}"),
        _ => format!("{value:.1e}"),
    }
}
