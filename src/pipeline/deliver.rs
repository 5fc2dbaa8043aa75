//! After the stages: files, their verification, pictures, and the report, which comes last.
use rayon::prelude::*;
use serde_json::Value;

use super::{
    output::{Output, OutputError},
    plan::Plan,
    run::{Event, RunError},
    verify::verify,
};
use crate::{
    emit::{self, File, Nouns},
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
    let jobs: Vec<Job<'_>> = models(store).into_iter().chain(pictures(store, plan)).collect();
    monitor.check()?;
    let made: Vec<(String, &'static str, Vec<u8>)> =
        jobs.into_par_iter().map(|(path, format, make)| (path, format, make())).collect();

    let mut written = Vec::new();
    let mut put = |path: &str, format: &'static str, bytes: &[u8]| -> Result<(), RunError> {
        monitor.check()?;
        output.write(path, bytes)?;
        let hash = blake3::hash(bytes).to_hex().to_string();
        written.push(Written { path: path.to_owned(), format, bytes: bytes.len(), hash });
        Ok(())
    };
    let mut read_back = Vec::new();
    for file in drawn {
        put(&file.path, file.format, &file.bytes)?;
        let bytes = output.read(&file.path)?;
        read_back.push(File { bytes, ..file });
    }
    made.iter().try_for_each(|(path, format, bytes)| put(path, format, bytes))?;
    section.checks.extend(verify(&read_back, &nouns, &plan.profiles));
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
    output.sweep(&written.iter().map(|it| it.path.clone()).collect())?;
    tell(Event::Finished { stage: "write", seconds: monitor.seconds() - start, cached: false });
    Ok(report)
}
