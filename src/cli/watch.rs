//! `fabricate run --watch`: the job again whenever one of its files changes.
use std::{
    fs,
    path::PathBuf,
    sync::atomic::Ordering,
    thread::sleep,
    time::{Duration, SystemTime},
};

use super::{CANCEL, Exit, args::Run, commands, show};
use crate::pipeline::{Config, ConfigText};

/// How often the files are looked at.
const PAUSE: Duration = Duration::from_millis(200);

/// Runs until Ctrl-C.
pub(super) fn watch(args: &Run) -> Exit {
    commands::use_threads(args.threads);
    loop {
        let before = state(args);
        if matches!(commands::run_once(args), Exit::Interrupted) {
            return Exit::Interrupted;
        }
        show::note(&format!("watching {}; Ctrl-C ends", show::count(before.len(), "file")));
        if !changed(args, &before) {
            return Exit::Interrupted;
        }
    }
}

/// Waits until a file is not as it was, and has then been left alone for a moment; `false` when asked to stop.
fn changed(args: &Run, before: &[Mark]) -> bool {
    let mut last = before.to_vec();
    while !CANCEL.load(Ordering::Relaxed) {
        sleep(PAUSE);
        let now = state(args);
        if now != before && now == last {
            return true;
        }
        last = now;
    }
    false
}

/// A file with the time and size of its content.
type Mark = (PathBuf, Option<(SystemTime, u64)>);

/// The files that the job reads, as they are.
fn state(args: &Run) -> Vec<Mark> {
    let mut paths = vec![args.job.clone()];
    if let Ok(text) = commands::text_of(args) {
        paths.extend(named(&text));
    }
    paths.sort();
    paths.dedup();
    let mark = |path: &PathBuf| {
        let about = fs::metadata(path).ok()?;
        Some((about.modified().ok()?, about.len()))
    };
    paths.into_iter().map(|path| (path.clone(), mark(&path))).collect()
}

/// The files that a config names.
fn named(text: &ConfigText) -> Vec<PathBuf> {
    let Ok((config, _)) = Config::parse_all(text) else { return vec![] };
    let string = |table: Option<&toml::Spanned<toml::de::DeTable<'_>>>, key: &str| -> Option<PathBuf> {
        Some(table?.get_ref().get(key)?.get_ref().as_str()?.into())
    };
    let profiles = ["material", "machine"].map(|it| string(config.profiles.get(it), "profile"));
    let own = profiles.into_iter().flatten().filter(|it| it.extension().is_some_and(|it| it == "toml"));
    let seams = string(config.tables.get("cut"), "seams");
    config.input.mesh.iter().cloned().chain(own).chain(seams).map(|it| text.folder().join(it)).collect()
}
