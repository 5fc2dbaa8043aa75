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
    // Every piece comes once, touches what is there, and every seam is closed in one step.
    let steps = report["assembly"]["steps"].as_array().unwrap();
    assert_eq!(steps.len(), pieces.len());
    let labels = |key: &str| steps.iter().flat_map(|it| it[key].as_array().unwrap()).map(count).collect::<Vec<_>>();
    let mut closed = [labels("seams"), labels("own_seams")].concat();
    closed.sort_unstable();
    assert_eq!(closed, (1..=seams).collect::<Vec<_>>());
    assert!(steps[1..].iter().all(|it| !it["seams"].as_array().unwrap().is_empty()));
    let mut names: Vec<&str> = steps.iter().map(|it| it["part"].as_str().unwrap()).collect();
    names.sort_unstable();
    names.dedup();
    assert_eq!(names.len(), pieces.len());
}

#[test]
fn facets_of_sheet_metal_have_outlines_after_their_bends_are_taken_in() {
    let out = tempfile::tempdir().unwrap();
    let mesh = concat!(env!("CARGO_MANIFEST_DIR"), "/fixtures/rounded-cube.obj");
    let mut run = Command::new(env!("CARGO_BIN_EXE_fabricate"));
    run.args(["run", mesh, "--to", "layout", "--quiet", "--json", "--out"]).arg(out.path());
    let sets = [
        "recipe=facets",
        "input.units=mm",
        "coarsen.faces=60",
        "unfold.effort=5",
        "material.profile=aluminium-1mm",
        "machine.profile=shop",
    ];
    run.args(sets.iter().flat_map(|it| ["--set", it]));
    let report: Value = serde_json::from_slice(&run.output().unwrap().stdout).unwrap();
    // Flanges move towards one another by their bends' deductions, and overlap at corners where they touched.
    let bends = report["outlines"]["bends"].as_array().unwrap();
    assert!(bends.len() > 20 && bends.iter().any(|it| it["corrected"] == true), "{bends:?}");
    assert!(!report["outlines"]["opened_slits"].as_array().unwrap().is_empty());
    let failed: Vec<&Value> = report["checks"].as_array().unwrap().iter().filter(|it| it["ok"] == false).collect();
    assert!(failed.is_empty(), "{failed:#?}");
}

/// The report of a cylinder in felt 3 mm thick, and the radius of the surface that was cut.
fn felt(recipe: &str, last: &str, neutral_layer: f64) -> (Value, f64) {
    let out = tempfile::tempdir().unwrap();
    let mesh = concat!(env!("CARGO_MANIFEST_DIR"), "/fixtures/cylinder.obj");
    let mut run = Command::new(env!("CARGO_BIN_EXE_fabricate"));
    run.args(["run", mesh, "--to", last, "--quiet", "--json", "--out"]).arg(out.path());
    let layer = format!("material.neutral_layer={neutral_layer}");
    let sets = [
        &format!("recipe={recipe}"),
        "input.units=mm",
        "coarsen.method=off",
        "material.profile=felt-3mm",
        &layer,
        "machine.profile=laser-co2",
        "unfold.effort=0",
    ];
    run.args(sets.iter().flat_map(|it| ["--set", it]));
    let done = run.output().unwrap();
    let report: Value = serde_json::from_slice(&done.stdout).unwrap();
    let text = std::fs::read_to_string(out.path().join("model/cut.obj")).unwrap();
    let numbers = |line: &str| line.split_whitespace().skip(1).map(|it| it.parse().unwrap()).collect::<Vec<f64>>();
    let radius = text.lines().filter(|it| it.starts_with("v ")).map(|it| numbers(it)[0]).fold(0.0, f64::max);
    (report, radius)
}

#[test]
fn thick_material_is_patterned_for_its_neutral_layer() {
    for (recipe, last) in [("facets", "unfold"), ("developable", "cut")] {
        let ((plain, outside), (report, middle)) = (felt(recipe, last, 0.0), felt(recipe, last, 0.5));
        assert!(plain.get("neutral_layer").is_none(), "{recipe}");
        let table = &report["neutral_layer"];
        assert_eq!(table["offset_mm"], -1.5, "{recipe}");
        assert_eq!(table["shortened_vertices"], 0, "{recipe}");
        assert!((outside - middle - 1.5).abs() < 0.02, "{recipe}: radius {outside} and {middle}");
    }
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
