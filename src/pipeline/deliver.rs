//! After the stages: files, their verification, pictures, and the report, which comes last.
use rayon::prelude::*;
use serde_json::Value;

use super::{
    output::{Output, OutputError},
    plan::Plan,
    replay::replay,
    run::{Event, RunError},
    simulate::simulate,
    verify::{booklet, certified, verify},
};
use crate::{
    emit::{self, File, Nouns},
    mesh::{Field, TriMesh},
    model::{
        CutMesh, DevelopableMesh, Flattening, FoldFrame, Folded, GeodesicNet, Globe, Lath, Milling, Molds, NetFit,
        Operation, Part, Parts, Sheets, SourceMesh, Stripes, Strips, Toolpaths,
    },
    numeric::{Cancelled, Monitor},
    profile::Machine,
    report::{
        self, Frame, StageRow, Subjects, Written,
        assembly::{self, Step},
        page::{Content, page},
    },
    stage::{Check, Section, Store},
};

impl From<Cancelled> for RunError {
    fn from(_: Cancelled) -> Self {
        Self::Interrupted
    }
}

/// Makes the bytes of one file, or says why it cannot.
type Make<'a> = Box<dyn Fn() -> Result<Vec<u8>, String> + Sync + Send + 'a>;
/// Path, format, and how to make it.
type Job<'a> = (String, &'static str, Make<'a>);

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
    let line = |operation| plan.profiles.machine.layers[operation].color.0;
    let instruction = plan.profiles.material.join.kind.instruction();
    // A folded sheet is not put together of parts.
    let cut = store.get::<CutMesh>().filter(|_| nouns.parts.is_some() && store.get::<Folded>().is_none());
    let steps = cut.map(assembly::steps).unwrap_or_default();
    let jobs: Vec<Job<'_>> = models(store)
        .into_iter()
        .chain([strips(store), stripes(store), folded(store), nets(store, plan)].into_iter().flatten())
        .chain(globe(store))
        .chain(pictures(subjects(store, &line)))
        .chain(cut.map(|it| instructions(store, it, &steps, instruction)))
        .chain(mill_programs(store, &plan.profiles.machine))
        .collect();
    monitor.check()?;
    let made: Vec<_> = jobs.par_iter().map(|(path, format, make)| (path, *format, make())).collect();
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
    for (path, format, bytes) in made {
        match bytes {
            Ok(bytes) => put(path, format, &bytes)?,
            Err(reason) => tell(Event::Warning(&format!("{path} is missing: {reason}"))),
        }
    }
    if let Some(cut) = cut {
        section = section.table("assembly", assembly::table(cut, &steps, instruction));
    }
    section.checks.extend(reread(&written, output, steps.len())?);
    section.checks.extend(verify(&read_back, &nouns, &plan.profiles));
    section.checks.extend(simulate(&read_back, &nouns, &plan.profiles));
    section.checks.extend(replayed(&written, store, output, &plan.profiles.machine)?);
    let frame = Frame {
        recipe: &plan.recipe,
        seed: plan.seed,
        config: plan.echo.clone(),
        stages,
        seconds: monitor.seconds(),
        files: &written,
    };
    let report = report::report(&frame, section);
    reports(plan, store, subjects(store, &line), &report, output)?;
    output.sweep(&written.iter().map(|it| it.path.clone()).collect())?;
    tell(Event::Finished { stage: "write", seconds: monitor.seconds() - start, cached: false });
    Ok(report)
}

/// The report, for programs and as a page.
fn reports(
    plan: &Plan,
    store: &Store,
    subjects: Subjects<'_>,
    report: &Value,
    output: &Output,
) -> Result<(), OutputError> {
    let machine = &plan.profiles.machine;
    let nouns = Nouns { sheets: store.get(), ..Nouns::default() };
    // The same bytes as in `sheets/`, and there also where the job writes no SVG.
    let svg = emit::files(&nouns, &plan.profiles, &["svg".into()]).expect("there is a format of this name");
    let drawings: Vec<_> = svg.into_iter().map(|it| (it.path, it.bytes)).collect();
    let content = Content {
        subjects,
        flat: store.get(),
        stripes: store.get(),
        toolpaths: store.get(),
        globe: store.get(),
        drawings: &drawings,
        feed: &|operation| machine.tools.get(operation).map_or(0.0, |it| it.feed / 60.0),
        rapid: machine.rapid / 60.0,
    };
    output.write("report.json", format!("{report:#}\n").as_bytes())?;
    output.write("report.html", &page(&content, report))
}

/// The booklet and the map to the sphere, read back.
fn reread(written: &[Written], output: &Output, steps: usize) -> Result<Vec<Check>, RunError> {
    let has = |path: &str| written.iter().any(|it| it.path == path);
    let mut checks = Vec::new();
    if has(ASSEMBLY) {
        checks.push(booklet(&output.read(ASSEMBLY)?, steps));
    }
    if has(GLOBE) {
        checks.push(certified(&output.read(GLOBE)?));
    }
    Ok(checks)
}

/// The instructions for putting the parts together.
const ASSEMBLY: &str = "assembly.pdf";

fn instructions<'a>(store: &Store, cut: &'a CutMesh, steps: &'a [Step], instruction: &'a str) -> Job<'a> {
    let up = report::up(store.get::<SourceMesh>().expect("the run put the source first"));
    let make = move || {
        let pages = assembly::pages(cut, steps, instruction, up).map_err(|it| it.to_string())?;
        Ok(emit::booklet::booklet(&pages))
    };
    (ASSEMBLY.into(), "pdf", Box::new(make))
}

/// Where the programs that mill pieces go.
const TOOLPATHS: &str = "toolpaths/";

fn mill_programs<'a>(store: &Store, machine: &Machine) -> Vec<Job<'a>> {
    let programs = store.get().map(|it: &Milling| emit::mill::programs(it, machine)).unwrap_or_default();
    let job = |(name, text): (&str, String)| -> Job<'a> {
        (format!("{TOOLPATHS}{name}"), "gcode", Box::new(move || Ok(text.clone().into_bytes())))
    };
    programs.into_iter().map(job).collect()
}

/// The same programs read back and replayed.
fn replayed(written: &[Written], store: &Store, output: &Output, machine: &Machine) -> Result<Vec<Check>, RunError> {
    let (Some(milling), Some(cut)) = (store.get::<Milling>(), store.get::<CutMesh>()) else { return Ok(vec![]) };
    let mut files = Vec::new();
    for it in written.iter().filter(|it| it.path.starts_with(TOOLPATHS)) {
        files.push((it.path.clone(), output.read(&it.path)?));
    }
    Ok(replay(&files, milling, cut, machine))
}

/// The meshes of the job as OBJ.
fn models(store: &Store) -> Vec<Job<'_>> {
    let source = store.get::<SourceMesh>().map(|it| &it.mesh);
    let developed = store.get::<DevelopableMesh>().map(|it| &it.mesh);
    let cut = store.get::<CutMesh>().map(|it| &it.mesh);
    let uv = store.get::<Flattening>().map(|it| &it.uv);
    [("input", source, None), ("coarse", store.get(), None), ("developed", developed, None), ("cut", cut, uv)]
        .into_iter()
        .filter_map(|(name, mesh, uv)| {
            let mesh: &TriMesh = mesh?;
            let write = move || {
                let mut bytes = Vec::new();
                emit::obj::write(mesh, uv, &mut bytes).expect("writing to memory cannot fail");
                Ok(bytes)
            };
            Some((format!("model/{name}.obj"), "obj", Box::new(write) as Make<'_>))
        })
        .collect()
}

/// The strips as OBJ and as tables of bends.
fn strips(store: &Store) -> Vec<Job<'_>> {
    let (Some(strips), Some(cut)) = (store.get::<Strips>(), store.get::<CutMesh>()) else { return vec![] };
    let obj = move || {
        let mut bytes = Vec::new();
        emit::strips::obj(strips, &cut.pieces, &mut bytes).expect("writing to memory cannot fail");
        Ok(bytes)
    };
    vec![
        ("model/strips.obj".into(), "obj", Box::new(obj)),
        ("strips/rolling.csv".into(), "csv", Box::new(move || Ok(emit::strips::rolling(strips, &cut.pieces)))),
        ("strips/press-brake.csv".into(), "csv", Box::new(move || Ok(emit::strips::press_brake(strips, &cut.pieces)))),
    ]
}

/// The lines of the stripes, to look at and as a path for a tool.
fn stripes(store: &Store) -> Vec<Job<'_>> {
    let Some(stripes) = store.get::<Stripes>().filter(|it| !it.lines.is_empty()) else { return vec![] };
    let obj = move || {
        let mut bytes = Vec::new();
        emit::stripes::obj(stripes, &mut bytes).expect("writing to memory cannot fail");
        Ok(bytes)
    };
    vec![
        ("stripes/lines.obj".into(), "obj", Box::new(obj)),
        ("stripes/path.csv".into(), "csv", Box::new(move || Ok(emit::stripes::path(stripes)))),
    ]
}

/// The folded sheet, the steps on its way, the fold angles and the flat pattern.
fn folded(store: &Store) -> Vec<Job<'_>> {
    let (Some(folded), Some(cut), Some(flat)) =
        (store.get::<Folded>(), store.get::<CutMesh>(), store.get::<Flattening>())
    else {
        return vec![];
    };
    let last = folded.frames.len().saturating_sub(1);
    let step = |(k, frame): (usize, &FoldFrame)| -> Job<'_> {
        let name = if k == last { "folded".into() } else { format!("step-{:02}", k + 1) };
        let mesh = cut.mesh.with_positions(Field::from_vec(frame.points.clone()));
        let make = move || {
            let mut bytes = Vec::new();
            emit::obj::write(&mesh, Some(&flat.uv), &mut bytes).expect("writing to memory cannot fail");
            Ok(bytes)
        };
        (format!("folded/{name}.obj"), "obj", Box::new(make))
    };
    let mut jobs: Vec<Job<'_>> = folded.frames.iter().enumerate().map(step).collect();
    jobs.push(("folded/angles.csv".into(), "csv", Box::new(move || Ok(emit::creases::angles(folded)))));
    jobs.push(("folded/pattern.fold".into(), "fold", Box::new(move || Ok(emit::creases::pattern(folded, cut, flat)))));
    jobs
}

/// What is drawn.
fn subjects<'a>(store: &'a Store, line: &'a (dyn Fn(Operation) -> [u8; 3] + Sync)) -> Subjects<'a> {
    Subjects {
        source: store.get().expect("the run put the source first"),
        coarse: store.get(),
        developed: store.get(),
        cut: store.get(),
        strips: store.get(),
        stripes: store.get(),
        net: store.get(),
        sheets: store.get(),
        milling: store.get(),
        folded: store.get(),
        line,
    }
}

/// The image of the surface on the sphere.
const GLOBE: &str = "sphere/map.obj";

fn globe(store: &Store) -> Option<Job<'_>> {
    let globe = store.get::<Globe>()?;
    let obj = move || {
        let mut bytes = Vec::new();
        emit::globe::obj(globe, &mut bytes).expect("writing to memory cannot fail");
        Ok(bytes)
    };
    Some((GLOBE.into(), "obj", Box::new(obj)))
}

/// The net of geodesics, before and after it was bent, and what is made of it.
fn nets<'a>(store: &'a Store, plan: &'a Plan) -> Vec<Job<'a>> {
    let machine = &plan.profiles.machine;
    let Some(fit) = store.get::<NetFit>() else { return vec![] };
    let bent = fit.reference.as_ref().map(|_| ("model/bent.obj", &fit.net));
    let job = |(path, net): (&str, &GeodesicNet)| -> Job<'a> {
        let net = net.clone();
        let obj = move || {
            let mut bytes = Vec::new();
            emit::net::obj(&net, &mut bytes).expect("writing to memory cannot fail");
            Ok(bytes)
        };
        (path.into(), "obj", Box::new(obj))
    };
    let whole = [("model/net.obj", fit.reference.as_ref().unwrap_or(&fit.net))];
    let second = fit.second.as_ref().map(|it| ("model/second.obj", it));
    whole
        .into_iter()
        .chain(bent)
        .chain(second)
        .map(job)
        .chain(laths(store, machine))
        .chain(molds(store, machine))
        .collect()
}

/// One part as a DXF of its own in a folder.
fn drawing<'a>(folder: &str, part: &'a Part, machine: &'a Machine) -> Job<'a> {
    (format!("{folder}/{}.dxf", part.name), "dxf", Box::new(move || Ok(emit::part_dxf(part, machine))))
}

/// Laths of a gridshell: lists and drawings.
fn laths<'a>(store: &'a Store, machine: &'a Machine) -> Vec<Job<'a>> {
    let Some(fit) = store.get::<NetFit>().filter(|it| !it.laths.is_empty()) else { return vec![] };
    let list = |path: &str, text: fn(&[Lath]) -> Vec<u8>| -> Job<'a> {
        (path.into(), "csv", Box::new(move || Ok(text(&fit.laths))))
    };
    let lists = [list("laths/cut-list.csv", emit::net::cut_list), list("laths/crossings.csv", emit::net::crossings)];
    lists.into_iter().chain(fit.drawings.iter().map(|it| drawing("laths", it, machine))).collect()
}

/// Moulds, their drawings and the schedule of panels.
fn molds<'a>(store: &'a Store, machine: &'a Machine) -> Vec<Job<'a>> {
    let Some(molds) = store.get::<Molds>() else { return vec![] };
    let ready = |format: &'static str| {
        move |(path, bytes): (String, Vec<u8>)| -> Job<'a> { (path, format, Box::new(move || Ok(bytes.clone()))) }
    };
    let drawings = molds.drawings.iter().map(|it| drawing("mold", it, machine));
    let panels = store.get::<CutMesh>().zip(store.get::<NetFit>()).map(|(cut, fit)| -> Job<'a> {
        ("mold/panels.csv".into(), "csv", Box::new(move || Ok(emit::mold::schedule(molds, cut, fit.net.columns))))
    });
    let programs = emit::mold::programs(molds).into_iter().map(ready("gcode"));
    emit::mold::solids(molds).into_iter().map(ready("stl")).chain(programs).chain(drawings).chain(panels).collect()
}

/// The previews.
fn pictures(subjects: Subjects<'_>) -> Vec<Job<'_>> {
    report::pictures(subjects)
        .into_iter()
        .map(|(path, draw)| -> Job<'_> {
            let format = if path.ends_with(".svg") { "svg" } else { "png" };
            (path, format, Box::new(move || draw().map_err(|err| err.to_string())))
        })
        .collect()
}
