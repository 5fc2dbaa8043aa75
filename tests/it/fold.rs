//! The recipe `fold` from the drawing to its files.
use std::{fs, path::Path, process::Command};

use fabricate::import::read_fold;
use serde_json::Value;

const JOB: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/fixtures/fold.toml");

fn run(job: &Path, out: &Path, sets: &[&str], threads: &str) -> (Value, std::process::Output) {
    let mut run = Command::new(env!("CARGO_BIN_EXE_fabricate"));
    run.arg("run").arg(job).args(["--quiet", "--json", "--threads", threads, "--out"]).arg(out);
    sets.iter().for_each(|it| {
        run.args(["--set", it]);
    });
    let done = run.output().unwrap();
    (serde_json::from_slice(&done.stdout).unwrap_or_default(), done)
}

#[test]
fn a_drawing_becomes_a_folded_shape_and_a_scored_sheet() {
    let out = tempfile::tempdir().unwrap();
    let (report, done) = run(JOB.as_ref(), &out.path().join("one"), &["fold.vertices=300"], "1");
    let checks = report["checks"].as_array().unwrap();
    let failed: Vec<&Value> = checks.iter().filter(|it| it["ok"] == false).collect();
    assert!(done.status.success() && failed.is_empty(), "{failed:#?}");
    let fold = &report["fold"];
    assert!(fold["mean_fold_deg"].as_f64().unwrap() >= 30.0, "{fold:#}");
    assert_eq!(fold["patches"], 2);
    // The drawing says nothing about it, the sheet does: one crease, folded one way all along.
    let outlines = &report["outlines"];
    let scores = [&outlines["mountain_folds"], &outlines["valley_folds"]].map(|it| it.as_u64().unwrap());
    assert_eq!(scores.iter().sum::<u64>(), 1, "{outlines}");
    let folded = out.path().join("one/folded");
    let pattern = read_fold(&fs::read(folded.join("pattern.fold")).unwrap()).unwrap();
    let found = if scores[0] == 1 { "mountain" } else { "valley" };
    let length = |layer: &str| pattern.lines.iter().filter(|it| it.layer == layer).map(|it| it.length()).sum::<f64>();
    assert!(pattern.measured && (length("border") - 800.0).abs() < 1e-3, "{}", length("border"));
    let drawn = fold["creases"][0]["length_mm"].as_f64().unwrap();
    assert!((length(found) - drawn).abs() < 1e-3, "{} {drawn}", length(found));
    let angles = fs::read_to_string(folded.join("angles.csv")).unwrap();
    assert!(angles.lines().skip(1).filter(|it| it.ends_with(&format!("{found},"))).count() > 10, "{angles}");
    // The same bytes on two threads.
    run(JOB.as_ref(), &out.path().join("two"), &["fold.vertices=300"], "2");
    for name in ["folded/folded.obj", "folded/angles.csv", "folded/pattern.fold", "sheets/sheet-01.dxf"] {
        let [one, two] = ["one", "two"].map(|it| fs::read(out.path().join(it).join(name)).unwrap());
        assert!(one == two, "{name} differs");
    }
}

/// Lines on a sheet of 100 mm, keys of the job, exit code, and what must be said.
const BAD: &[(&str, &[&str], i32, &[&str])] = &[
    ("M0 50 Q 50 70 60 40", &[], 3, &["ends in the middle of the paper", "(60.000, 60.000) mm"]),
    ("", &[], 3, &["no crease inside the border"]),
    ("M0 50 Q 50 70 100 NaN", &[], 3, &["pattern.svg"]),
    ("M0 50 Q 50 70 100 40", &["input.border=annulus"], 3, &["outermost closed curve and the innermost", "1 closed"]),
    ("M0 50 Q 50 70 100 40", &["input.colors.\"black\"=crease"], 2, &["`black` is no colour"]),
    ("M0 50 Q 50 70 100 40", &["input.layers.a=thing"], 2, &["not `thing`"]),
    ("M0 50 Q 50 70 100 40", &["input.dpi=72"], 2, &["the file states its unit"]),
    ("M0 50 Q 50 70 100 40", &["input.depth=3"], 2, &["width and height only"]),
    ("M0 50 Q 50 70 100 40", &["recipe=developable"], 2, &["recipe = \"fold\""]),
    (
        "M0 50 Q 50 70 100 40",
        &["fold.handle=[{ at = [300, 5], to = [0, 0, 9] }]"],
        1,
        &["(300.00, 5.00) mm is not on the paper"],
    ),
    ("M-9 50 Q 50 70 109 40", &["fold.vertices=100", "fold.settle=5"], 1, &["off the paper", "left out"]),
    ("M0 50 Q 50 70 100 40", &["fold.vertices=100", "fold.amount=6"], 1, &["fold.handles", "pull less far"]),
];

#[test]
fn what_is_wrong_with_a_drawing_is_said_with_the_place() {
    let folder = tempfile::tempdir().unwrap();
    let (drawing, job) = (folder.path().join("pattern.svg"), folder.path().join("job.toml"));
    fs::write(&job, "version = 1\nrecipe = \"fold\"\n[input]\npattern = \"pattern.svg\"\n").unwrap();
    for (path, sets, code, wanted) in BAD {
        let text = format!(
            "<svg xmlns='http://www.w3.org/2000/svg' width='100mm' height='100mm' viewBox='0 0 100 100'>\
             <rect width='100' height='100' fill='none' stroke='#000000'/><path d='{path}' fill='none' stroke='#ff00ff'/></svg>"
        );
        fs::write(&drawing, text).unwrap();
        let (report, done) = run(&job, &folder.path().join("out"), sets, "1");
        let failed = report["checks"].as_array().into_iter().flatten().filter(|it| it["ok"] == false);
        let said = failed.fold(String::from_utf8(done.stderr).unwrap(), |said, it| said + &it.to_string());
        assert_eq!(done.status.code(), Some(*code), "{path} {sets:?}: {said}");
        assert!(wanted.iter().all(|it| said.contains(it)), "{path} {sets:?}: {said}");
    }
    // A drawing without a unit is read, and both sizes that it may have are told.
    let unitless = fs::read_to_string(&drawing).unwrap().replace("100mm", "100");
    fs::write(&drawing, unitless).unwrap();
    let (report, done) = run(&job, &folder.path().join("out"), &["fold.vertices=100", "fold.settle=5"], "1");
    let said = String::from_utf8(done.stderr).unwrap();
    assert!(said.contains("26.5 x 26.5 mm") && said.contains("35.3 x 35.3 mm"), "{said}");
    assert!((report["input"]["size_mm"][0].as_f64().unwrap() - 2540.0 / 96.0).abs() < 1e-3, "{}", report["input"]);
}
