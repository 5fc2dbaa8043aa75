//! `report.json`: what was made, how well, and where it lies. Keys are those of CONTRACT.md. `report.html`: the same to look at.
pub mod assembly;
mod chart;
pub mod page;
mod pictures;

pub use pictures::{Drawing, Lines, Subjects, lines, pictures, up};

use serde_json::{Map, Value, json};

use crate::stage::Section;

/// How a stage went.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StageRow {
    /// Its name.
    pub name: &'static str,
    /// Time taken, s.
    pub seconds: f64,
    /// Whether the result came from the cache.
    pub cached: bool,
}

/// A file that was written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Written {
    /// Relative to the output folder.
    pub path: String,
    /// Its format.
    pub format: &'static str,
    /// Size.
    pub bytes: usize,
    /// BLAKE3, hexadecimal.
    pub hash: String,
}

/// Everything of a report that is not measured by a stage.
pub struct Frame<'a> {
    /// Name of the recipe.
    pub recipe: &'a str,
    /// The seed.
    pub seed: u64,
    /// The config with all defaults.
    pub config: Value,
    /// The stages that ran.
    pub stages: &'a [StageRow],
    /// Time of the whole run, s.
    pub seconds: f64,
    /// The files written.
    pub files: &'a [Written],
}

/// Puts the report together. Tables of stages that did not run are absent.
pub fn report(frame: &Frame<'_>, section: Section) -> Value {
    let Section { tables, checks } = section;
    let mut root = Map::new();
    let mut put = |key: &str, value: Value| drop(root.insert(key.into(), value));
    put("version", json!(1));
    put("fabricate", json!(env!("CARGO_PKG_VERSION")));
    put("recipe", json!(frame.recipe));
    put("status", json!(if checks.iter().all(|it| it.ok) { "ok" } else { "checks_failed" }));
    put("seed", json!(frame.seed));
    put("config", frame.config.clone());
    put("seconds_total", json!(frame.seconds));
    if let Some(peak) = peak_memory() {
        put("peak_rss_mb", json!(peak));
    }
    let rows: Vec<Value> =
        frame.stages.iter().map(|it| json!({ "name": it.name, "seconds": it.seconds, "cached": it.cached })).collect();
    put("stages", json!(rows));
    for (name, table) in tables {
        put(&name, table);
    }
    put("checks", json!(checks));
    let files: Vec<Value> = frame
        .files
        .iter()
        .map(|it| json!({ "path": it.path, "format": it.format, "bytes": it.bytes, "blake3": it.hash }))
        .collect();
    put("files", json!(files));
    Value::Object(root)
}

/// Peak resident memory of this process, MB, where the system tells.
fn peak_memory() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|it| it.strip_prefix("VmHWM:"))?;
    let kib: f64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some((kib / 1024.0).round())
}
