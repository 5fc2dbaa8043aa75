//! Whole jobs in materials of several kinds: sheet metal, rolls, remnants, parts that are too large.
use std::{fs, path::Path};

use fabricate::import::{Drawing, read_dxf};
use serde_json::Value;

use crate::job::{fabricate, fixture, job};

/// Two legs of 100 and 50 mm at a right angle, 60 mm wide, their outer side printed.
fn angle(folder: &Path) -> String {
    let mut text = String::new();
    for (x, z) in [(0, 0), (50, 0), (100, 0), (100, -25), (100, -50)] {
        for y in [0, 30, 60] {
            text += &format!("v {x} {y} {z}\n");
        }
    }
    for i in 0..4 {
        for j in 1..3 {
            let (a, b) = (3 * i + j, 3 * i + j + 3);
            text += &format!("f {a} {b} {}\nf {a} {} {}\n", b + 1, b + 1, a + 1);
        }
    }
    let file = folder.join("angle.obj");
    fs::write(&file, text).unwrap();
    file.display().to_string()
}

/// Runs the angle with some keys set.
fn run(folder: &Path, out: &str, sets: &[&str]) -> Value {
    let mesh = angle(folder);
    let mut args = vec![mesh.as_str(), "--set", "input.units=mm"];
    args.extend(sets.iter().flat_map(|it| ["--set", it]));
    job(&folder.join(out), &args)
}

/// The checks of a name.
fn check<'a>(report: &'a Value, name: &str) -> &'a Value {
    report["checks"].as_array().unwrap().iter().find(|it| it["name"] == name).unwrap_or_else(|| panic!("no {name}"))
}

fn drawing(folder: &Path, file: &str) -> Drawing {
    read_dxf(&fs::read(folder.join(file)).unwrap()).unwrap()
}

/// Longer and shorter side of the smallest box around the outline.
fn sides(drawing: &Drawing) -> [f64; 2] {
    let outline = &drawing.lines.iter().find(|it| it.layer == "CUT").unwrap().points;
    let size =
        fabricate::geom::polygon::bounds_turned(outline, fabricate::geom::polygon::least_box_angle(outline)).size();
    [size.max(), size.min()]
}

/// Runs a job of which a stage cannot finish.
fn fails(config: &Path, wanted: &[&str]) {
    let out = tempfile::tempdir().unwrap();
    let out_arg = out.path().join("out").display().to_string();
    let result = fabricate(&["run", &config.display().to_string(), "--quiet", "--out", &out_arg]);
    let stderr = String::from_utf8_lossy(&result.stderr);
    assert_eq!(result.status.code(), Some(1), "{stderr}");
    assert!(wanted.iter().all(|it| stderr.contains(it)) && !stderr.contains("panicked"), "{stderr}");
    // The drawings are right as they are; there is no program.
    assert!(!out.path().join("out/sheets/sheet-01.nc").exists(), "an empty or wrong file");
}

#[test]
fn an_angle_of_aluminium_is_as_long_as_the_formula_says() {
    let folder = tempfile::tempdir().unwrap();
    let sets = ["material.profile=aluminium-1mm", "machine.profile=shop", "material.bend.k_factor=[[2, 0.33]]"];
    let report = run(folder.path(), "out", &sets);
    assert_eq!(report["status"], "ok", "{}", report["checks"]);
    let bend = &report["outlines"]["bends"][0];
    assert!((bend["angle_deg"].as_f64().unwrap() - 90.0).abs() < 0.01 && bend["direction"] == "down", "{bend}");
    assert!((bend["allowance_mm"].as_f64().unwrap() - 3.660).abs() < 1e-3 && bend["corrected"] == true, "{bend}");
    let file = "out/parts/A_aluminium-1mm_1mm_q1.dxf";
    let part = drawing(folder.path(), file);
    let [long, short] = sides(&part);
    assert!((long - (150.0 - 2.340)).abs() < 2e-3 && (short - 60.0).abs() < 2e-3, "{long} {short}");
    let bends: Vec<_> = part.lines.iter().filter(|it| it.layer == "BEND_DOWN").collect();
    assert!(bends.len() == 1 && part.lines.iter().all(|it| it.layer != "BEND_UP"));
    let text = fs::read_to_string(folder.path().join(file)).unwrap();
    let layer = text.find("  2\r\nBEND_DOWN\r\n").unwrap();
    assert!(text[layer..layer + 60].contains("  6\r\nDASHED\r\n"), "{:?}", &text[layer..layer + 60]);
    let plain = run(folder.path(), "plain", &sets[..2]);
    let k = plain["outlines"]["bends"][0]["allowance_mm"].as_f64().unwrap();
    assert!((k - std::f64::consts::FRAC_PI_2 * 2.4).abs() < 1e-3, "K = 0.4 at R/T = 2: {k}");
}

/// A closed box of three lengths, its faces outwards.
fn cuboid(folder: &Path, size: [f64; 3]) -> String {
    let mut text = String::new();
    for k in 0..8 {
        let [x, y, z] = [0, 1, 2].map(|axis| if k >> axis & 1 == 1 { size[axis] } else { 0.0 });
        text += &format!("v {x} {y} {z}\n");
    }
    for [a, b, c, d] in [[1, 3, 4, 2], [5, 6, 8, 7], [1, 2, 6, 5], [3, 7, 8, 4], [1, 5, 7, 3], [2, 4, 8, 6]] {
        text += &format!("f {a} {b} {c}\nf {a} {c} {d}\n");
    }
    let file = folder.join("box.obj");
    fs::write(&file, text).unwrap();
    file.display().to_string()
}

#[test]
fn a_box_of_plywood_goes_together_with_fingers() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = cuboid(folder.path(), [60.0, 50.0, 40.0]);
    let keys = [
        "recipe=facets",
        "input.units=mm",
        "coarsen.method=off",
        "unfold.separate=true",
        "material.profile=plywood-3mm",
        "material.join.kind=fingers",
        "material.neutral_layer=0",
        "machine.profile=laser-co2",
    ];
    let mut args = vec![mesh.as_str()];
    args.extend(keys.iter().flat_map(|it| ["--set", it]));
    let report = job(&folder.path().join("out"), &args);
    assert_eq!(report["status"], "ok", "{}", report["checks"]);
    let mut found: Vec<[i64; 2]> = ["A", "B", "C", "D", "E", "F"]
        .map(|name| sides(&drawing(folder.path(), &format!("out/parts/{name}_plywood-3mm_3mm_q1.dxf"))))
        .map(|it| it.map(|side| side.round() as i64))
        .into();
    found.sort();
    // Half a thickness stands out at either end of the middle layers.
    assert_eq!(found, [[53, 43], [53, 43], [63, 43], [63, 43], [63, 53], [63, 53]]);
    // What one face gains another loses, but for the corners, where no finger goes.
    let areas = report["layout"]["placed"].as_array().unwrap().iter().map(|it| it["area_mm2"].as_f64().unwrap());
    let (total, surface) = (areas.sum::<f64>(), 2.0 * (60.0 * 50.0 + 60.0 * 40.0 + 50.0 * 40.0));
    assert!(total < surface && total > 0.98 * surface, "{total} {surface}");
}

#[test]
fn a_part_larger_than_its_sheets_is_said_with_the_scale_that_would_fit() {
    let folder = tempfile::tempdir().unwrap();
    let report = run(folder.path(), "out", &["nest.sheet=[100, 80]", "nest.margin=5", "nest.fit_sheets=1"]);
    assert_eq!(check(&report, "nest.unplaced")["ok"], false);
    let note = check(&report, "nest.unplaced")["note"].as_str().unwrap();
    assert!(note.contains("part A measures 150.0 × 60.0 mm") && note.contains("90.0 × 70.0 mm inside"), "{note}");
    let fits = check(&report, "nest.fit_sheets");
    assert_eq!(fits["ok"], false, "{report}");
    assert!(fits["note"].as_str().unwrap().contains("at a scale of 0."), "{fits}");
}

#[test]
fn a_roll_is_as_long_as_the_parts_need() {
    let folder = tempfile::tempdir().unwrap();
    let sets = ["material.profile=ripstop-40gsm", "machine.profile=vinyl-cutter", "material.process.drag-knife={}"];
    let report = run(folder.path(), "out", &sets);
    assert_eq!(report["status"], "ok", "{}", report["checks"]);
    let [width, length] = [0, 1].map(|k| report["layout"]["sheet_mm"][k].as_f64().unwrap());
    // Two allowances and two margins around it; the roll is 1500 mm wide, the cutter 630.
    assert!(width == 630.0 && (80.0..190.0).contains(&length), "{width} {length}");
    assert!((report["shopping"]["roll_m"].as_f64().unwrap() - length / 1000.0).abs() < 1e-9);
    let svg = fs::read_to_string(folder.path().join("out/sheets/sheet-01.svg")).unwrap();
    assert!(svg.contains("width=\"630mm\""));
}

#[test]
fn remnants_single_parts_and_a_limit_in_seconds() {
    let folder = tempfile::tempdir().unwrap();
    let report = run(folder.path(), "out", &["nest.remnants=[[180, 90]]", "nest.seconds=0.05", "nest.only=[\"A\"]"]);
    assert_eq!(report["layout"]["sheets_mm"][0], serde_json::json!([180.0, 90.0]));
    assert_eq!(report["layout"]["reproducible"], false);
    assert_eq!(report["layout"]["parts"], 1);
    let config = folder.path().join("job.toml");
    let text = format!("[input]\nmesh = \"{}\"\nunits = \"mm\"\n[nest]\nonly = [\"Q\"]\n", angle(folder.path()));
    fs::write(&config, text).unwrap();
    fails(&config, &["there is no part `Q`; there are A"]);
}

#[test]
fn margins_of_nothing_are_cut_or_refused_with_the_place() {
    let folder = tempfile::tempdir().unwrap();
    let sets = ["material.margin=0", "nest.sheet=[200, 100]", "machine.profile=pen-plotter"];
    let report = run(folder.path(), "pen", &sets);
    assert_eq!(report["status"], "ok", "{}", report["checks"]);
    assert!(check(&report, "nest.margin")["value"].as_f64().unwrap() >= -1e-9);
    // A beam goes half its width outside the part.
    let config = folder.path().join("job.toml");
    let text = format!(
        "[input]\nmesh = \"{}\"\nunits = \"mm\"\n[material]\nmargin = 0\n[machine]\nprofile = \"laser-co2\"\n",
        angle(folder.path())
    );
    fs::write(&config, text).unwrap();
    fails(&config, &["outside the bed", "set a larger margin"]);
}

/// Names of pieces, numbers of seams and lengths come from the cut alone.
#[test]
fn names_stay_when_a_key_changes_that_does_not_concern_them() {
    let folder = tempfile::tempdir().unwrap();
    let run = |sets: &[&str]| {
        let mesh = fixture("bumpy.obj");
        let mut args = vec![mesh.as_str(), "--set", "input.height=120 mm"];
        args.extend(sets.iter().flat_map(|it| ["--set", it]));
        let report = job(folder.path(), &args);
        let mut parts: Vec<(String, f64)> = report["flatten"]["pieces"]
            .as_array()
            .unwrap()
            .iter()
            .map(|it| (it["name"].as_str().unwrap().to_owned(), it["area_2d_mm2"].as_f64().unwrap()))
            .collect();
        parts.sort_by(|a, b| a.0.cmp(&b.0));
        let mut placed: Vec<String> = report["layout"]["placed"]
            .as_array()
            .unwrap()
            .iter()
            .map(|it| it["name"].as_str().unwrap().into())
            .collect();
        placed.sort();
        (parts, placed)
    };
    let plain = run(&[]);
    let other =
        run(&["layout.label=2", "nest.gap=5", "nest.effort=0", "machine.profile=pen-plotter", "material.join.width=8"]);
    assert!(plain.0.len() > 1 && plain == other, "{plain:?}\n{other:?}");
}
