//! After the stages: files, their verification, pictures, and the report, which comes last.
use std::collections::BTreeSet;

use rayon::prelude::*;
use serde_json::Value;

use super::{
    output::{Output, OutputError},
    plan::Plan,
    run::{Event, RunError},
};
use crate::{
    emit::{self, Nouns},
    mesh::TriMesh,
    model::{CutMesh, DevelopableMesh, Flattening, Parts, Sheets, SourceMesh, Toolpaths},
    numeric::{Cancelled, Monitor},
    report::{self, Frame, StageRow, Written},
    stage::{Section, Store},
};

impl From<Cancelled> for RunError {
    fn from(_: Cancelled) -> Self {
        Self::Interrupted
    }
}

/// Makes one file: path, format, bytes.
type Job<'a> = (String, &'static str, Box<dyn Fn() -> Vec<u8> + Sync + 'a>);

/// Writes everything that the store holds, verifies it, and writes the report.
pub(super) fn deliver(
    plan: &Plan,
    store: &Store,
    output: &Output,
    mut section: Section,
    stages: &[StageRow],
    monitor: &Monitor<'_>,
    tell: &(dyn Fn(Event<'_>) + Sync),
) -> Result<Value, RunError> {
    tell(Event::Started { stage: "write" });
    let start = monitor.seconds();
    let nouns =
        Nouns { parts: store.get::<Parts>(), sheets: store.get::<Sheets>(), toolpaths: store.get::<Toolpaths>() };
    let drawn = emit::files(&nouns, &plan.profiles, &plan.formats).expect("the plan proved that every format exists");
    section.checks.extend(verify(&drawn, &nouns, plan));
    let mut files: Vec<(String, &'static str, Vec<u8>)> =
        drawn.into_iter().map(|it| (it.path, it.format, it.bytes)).collect();
    let jobs: Vec<Job<'_>> = models(store).into_iter().chain(pictures(store, plan)).collect();
    monitor.check()?;
    files.par_extend(jobs.into_par_iter().map(|(path, format, make)| (path, format, make())));

    let mut written = Vec::new();
    for (i, (path, format, bytes)) in files.iter().enumerate() {
        monitor.check()?;
        monitor.progress(i as f64 / files.len() as f64, path);
        output.write(path, bytes)?;
        written.push(Written { path: path.clone(), format, bytes: bytes.len(), hash: blake3::hash(bytes).to_hex().to_string() });
    }
    let frame = Frame {
        recipe: &plan.recipe,
        seed: plan.seed,
        config: plan.echo.clone(),
        stages,
        seconds: monitor.seconds(),
        files: &written,
    };
    let report = report::report(&frame, section);
    output.write("report.json", format!("{report:#}\n").as_bytes())?;
    output.sweep(&files.iter().map(|it| it.0.clone()).collect::<BTreeSet<_>>())?;
    tell(Event::Finished { stage: "write", seconds: monitor.seconds() - start, cached: false });
    Ok(report)
}
