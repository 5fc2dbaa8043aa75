//! The recipe `sphere` from the mesh to its files.
use std::process::Command;

use serde_json::Value;

fn run(job: &str, sets: &[&str]) -> (Value, tempfile::TempDir, std::process::Output) {
    let out = tempfile::tempdir().unwrap();
    let mut run = Command::new(env!("CARGO_BIN_EXE_fabricate"));
    run.args(["run", job, "--quiet", "--json", "--out"]).arg(out.path());
    sets.iter().for_each(|it| {
        run.args(["--set", it]);
    });
    let done = run.output().unwrap();
    (serde_json::from_slice(&done.stdout).unwrap_or_default(), out, done)
}

#[test]
fn a_globe_becomes_gores_with_caps_and_engraved_lines() {
    let (report, out, done) = run(concat!(env!("CARGO_MANIFEST_DIR"), "/fixtures/globe.toml"), &["nest.effort=1"]);
    let checks = report["checks"].as_array().unwrap();
    let failed: Vec<&Value> = checks.iter().filter(|it| it["ok"] == false).collect();
    assert!(done.status.success() && failed.is_empty(), "{failed:#?}");
    let sphere = &report["sphere"];
    assert_eq!((sphere["flips"].as_u64(), sphere["degree"].as_i64()), (Some(0), Some(1)));
    assert_eq!(sphere["slices"].as_array().unwrap().len(), 12);
    assert!(checks.iter().any(|it| it["name"] == "files.sphere"), "the map is read back and certified again");
    assert_eq!(report["flatten"]["pieces"].as_array().unwrap().len(), 14, "twelve gores and two caps");
    assert_eq!(report["flatten"]["mirrored_pairs"].as_array().unwrap().len(), 7, "six of gores, one of caps");
    assert!(report["outlines"]["engraved_lines"].as_u64().unwrap() > 100);
    assert!(out.path().join("sphere/map.obj").exists());
    let page = std::fs::read_to_string(out.path().join("report.html")).unwrap();
    assert!(page.contains(r#""name":"sphere""#), "the page shows the pieces on the sphere");
}

#[test]
fn what_is_not_a_sphere_is_refused_with_what_to_do() {
    for (fixture, code, what, way_out) in [
        ("torus", 1, "has 1, like a torus", "close the handles in a modelling program"),
        ("double-torus", 1, "has 2, like a torus", "close the handles in a modelling program"),
        ("broken-holes", 1, "2 holes, one of 12 edges near", "input.fill_holes = 12"),
        ("broken-two-components", 3, "2 separate components", "input.component to \"largest\""),
        ("broken-nonmanifold-edge", 3, "more than two faces", "separate the parts"),
        ("broken-moebius", 3, "only one side", "cut it open"),
    ] {
        let file = format!("{}/fixtures/{fixture}.obj", env!("CARGO_MANIFEST_DIR"));
        let (_, _, done) = run(&file, &["recipe=sphere", "input.units=mm"]);
        let said = String::from_utf8(done.stderr).unwrap();
        assert_eq!(done.status.code(), Some(code), "{fixture}: {said}");
        assert!(said.contains(what) && said.contains(way_out), "{fixture}: {said}");
    }
    let holes = concat!(env!("CARGO_MANIFEST_DIR"), "/fixtures/broken-holes.obj");
    let (report, ..) = run(holes, &["recipe=sphere", "input.units=mm", "input.fill_holes=12", "nest.effort=1"]);
    assert_eq!(report["sphere"]["flips"].as_u64(), Some(0), "the advice helps");
}
