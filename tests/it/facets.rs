//! The recipe `facets` from the mesh to its files.
use std::process::Command;

use serde_json::Value;

#[test]
fn a_figure_becomes_a_few_pieces_that_fold() {
    let out = tempfile::tempdir().unwrap();
    let job = concat!(env!("CARGO_MANIFEST_DIR"), "/fixtures/facets.toml");
    let mut run = Command::new(env!("CARGO_BIN_EXE_fabricate"));
    run.args(["run", job, "--set", "unfold.effort=5", "--quiet", "--json", "--out"]).arg(out.path());
    let done = run.output().unwrap();
    let report: Value = serde_json::from_slice(&done.stdout).unwrap();
    let failed: Vec<&Value> = report["checks"].as_array().unwrap().iter().filter(|it| it["ok"] == false).collect();
    assert!(done.status.success() && failed.is_empty(), "{failed:#?}");
    // What the recipe wants different from the stages' own defaults.
    assert_eq!(report["config"]["coarsen"]["method"], "quadric");
    assert_eq!(report["config"]["layout"]["fold_angle"], 1.0);
    let count = |value: &Value| value.as_u64().unwrap();
    let faces = count(&report["unfold"]["faces"]);
    assert!((290..=300).contains(&faces), "{faces}");
    let pieces = report["unfold"]["pieces"].as_array().unwrap();
    assert!(pieces.len() <= 12 && pieces.iter().map(|it| count(&it["faces"])).sum::<u64>() == faces);
    // Every edge of a tree of faces is a fold; every seam is one edge, or a few in a straight line.
    let (folds, seams) = (count(&report["unfold"]["folds"]), count(&report["seams"]["count"]));
    assert!(folds <= faces - pieces.len() as u64 && folds > faces / 2, "{folds} folds");
    assert!(seams > faces / 3 && seams <= faces, "{seams} seams");
    let outlines = &report["outlines"];
    assert!(count(&outlines["mountain_folds"]) > 0 && count(&outlines["valley_folds"]) > 0);
    assert!(count(&outlines["tabs"]) > seams / 2, "{outlines}");
}

#[test]
fn a_job_that_says_how_to_coarsen_is_left_alone() {
    let out = tempfile::tempdir().unwrap();
    let mesh = concat!(env!("CARGO_MANIFEST_DIR"), "/fixtures/ball.stl");
    let sets = ["recipe=facets", "coarsen.method=off", "unfold.max_faces=100"];
    let mut run = Command::new(env!("CARGO_BIN_EXE_fabricate"));
    run.args(["run", mesh, "--quiet", "--json", "--out"]).arg(out.path());
    run.args(sets.iter().flat_map(|it| ["--set", it]));
    let done = run.output().unwrap();
    assert_eq!(done.status.code(), Some(1));
    let text = String::from_utf8_lossy(&done.stdout).into_owned() + &String::from_utf8_lossy(&done.stderr);
    assert!(text.contains("the mesh has 1280 faces") && text.contains("coarsen.faces"), "{text}");
}
