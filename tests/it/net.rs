//! The recipe `net` from a profile, a mesh and an earlier net to its files.
use serde_json::Value;

use crate::job::{fabricate, fixture, job};

fn failed(report: &Value) -> Vec<&Value> {
    report["checks"].as_array().unwrap().iter().filter(|it| it["ok"] == false).collect()
}

#[test]
fn a_bottle_is_bent_and_a_moved_handle_costs_only_the_bending() {
    let out = tempfile::tempdir().unwrap();
    let report = job(out.path(), &[&fixture("bottle.toml")]);
    assert!(failed(&report).is_empty(), "{:#?}", failed(&report));
    let bend = &report["bend"];
    assert!(bend["residual"].as_f64().unwrap() <= 1e-7 && bend["turned_deg"].as_f64().unwrap() >= 20.0, "{bend}");
    assert!(bend["max_strain"].as_f64().unwrap() <= 4e-5, "{bend}");
    for file in ["model/net.obj", "model/bent.obj", "preview/net.png", "preview/strain.png"] {
        assert!(out.path().join(file).exists(), "{file}");
    }
    let moved = "bend.handles=[{at=[0,15]},{at=[0,16]},{at=[1,15]},{at=[40,15],by=[-75,0,-32]}]";
    let again = job(out.path(), &[&fixture("bottle.toml"), "--set", moved]);
    let cached: Vec<bool> = again["stages"].as_array().unwrap().iter().map(|it| it["cached"] == true).collect();
    assert_eq!(cached, [true, false]);
    // The bent net goes on as the beginning of another job.
    let bent = out.path().join("model/bent.obj").display().to_string();
    let next = tempfile::tempdir().unwrap();
    let sets =
        ["recipe=net".to_owned(), format!("net.previous={bent}"), "net.isometry=1".into(), "net.proximity=0".into()];
    let mut args = vec![fixture("cone-patch.obj")];
    sets.iter().for_each(|it| args.extend(["--set".to_owned(), it.clone()]));
    let report = job(next.path(), &args.iter().map(String::as_str).collect::<Vec<_>>());
    assert_eq!((report["net"]["rows"].as_u64(), report["net"]["columns"].as_u64()), (Some(41), Some(31)));
}

#[test]
fn fighting_handles_are_named() {
    let out = tempfile::tempdir().unwrap();
    let apart = "bend.handles=[{at=[0,15]},{at=[40,15],by=[0,0,150]}]";
    let report = job(out.path(), &[&fixture("bottle.toml"), "--set", apart]);
    let failed = failed(&report);
    let named = failed.iter().find(|it| it["name"] == "bend.handles").unwrap();
    assert!(named["note"].as_str().unwrap().contains("handles 1 ("), "{named:#?}");
}

#[test]
fn a_twisted_net_obeys_clairaut_and_a_patch_is_covered() {
    let out = tempfile::tempdir().unwrap();
    let report =
        job(out.path(), &[&fixture("bottle.toml"), "--set", "net.twist=40", "--set", "net.sweep=120", "--to", "net"]);
    assert!(failed(&report).is_empty(), "{:#?}", failed(&report));
    let clairaut = &report["net"]["clairaut"];
    assert!(
        clairaut["mean_mm"].as_f64().unwrap() > 8.0 && clairaut["max_mad_mm"].as_f64().unwrap() < 0.01,
        "{clairaut}"
    );
    let report = job(out.path(), &[&fixture("twisted-patch.obj"), "--set", "recipe=net"]);
    assert!(failed(&report).is_empty(), "{:#?}", failed(&report));
    assert!(report["net"]["points_off_pct"].as_f64().unwrap() < 0.1, "{}", report["net"]);
    let shell = ["recipe=net", "net.second=90", "net.rows=15", "net.columns=7", "input.width=1200 mm"];
    let args: Vec<&str> = shell.iter().flat_map(|it| ["--set", it]).collect();
    let report = job(out.path(), &[&[fixture("twisted-patch.obj").as_str()][..], &args].concat());
    assert!(failed(&report).is_empty(), "{:#?}", failed(&report));
    let laths = &report["net"]["laths"];
    assert!(laths["count"] == 14 && laths["crossings"].as_u64().unwrap() >= 10, "{laths}");
    assert!(laths["largest_gap_mm"].as_f64().unwrap() < 1.0, "{laths}");
    assert!(out.path().join("laths/lath-A1.dxf").exists());
    let list = std::fs::read_to_string(out.path().join("laths/cut-list.csv")).unwrap();
    assert_eq!(list.lines().count(), 15, "{list}");
}

#[test]
fn a_patch_becomes_nearly_developable_without_shrinking() {
    let out = tempfile::tempdir().unwrap();
    let sets = ["recipe=net", "net.developable=1", "net.arc_length=1"];
    let args: Vec<&str> = sets.iter().flat_map(|it| ["--set", it]).collect();
    let report = job(out.path(), &[&[fixture("cone-patch.obj").as_str()][..], &args].concat());
    assert!(failed(&report).is_empty(), "{:#?}", failed(&report));
    assert!(report["net"]["points_off_pct"].as_f64().unwrap() < 0.025, "{}", report["net"]);
    assert!(report["net"]["hausdorff_pct"].as_f64().unwrap() < 50.0, "{}", report["net"]);
}

#[test]
fn what_makes_no_net_is_refused_with_the_reason() {
    for (sets, code, what) in [
        (&["net.profile=[[10,0],[0,50]]"][..], 3, "keep the profile off the axis"),
        (&["net.profile=[[10,0],[30,20],[30,0],[10,20]]"], 3, "segment 0 of the profile meets segment 2"),
        (&["net.profile=no.csv"], 3, "cannot begin a net with"),
        (&["net.rows=2"], 2, "`rows` must be between 3"),
        (&["net.geodesic=many"], 2, "a weight must be a number"),
        (&["bend.handles=[{at=[0,99]}]"], 1, "names the point (0, 99) of a net of 41 × 31 points"),
        (&["bend.handles=[{by=[0,0,1]}]"], 2, "needs either `at` or `near`"),
    ] {
        let out = tempfile::tempdir().unwrap();
        let path = out.path().display().to_string();
        let bottle = fixture("bottle.toml");
        let mut args = vec!["run", &bottle, "--quiet", "--out", &path];
        sets.iter().for_each(|it| args.extend(["--set", it]));
        let done = fabricate(&args);
        let said = String::from_utf8_lossy(&done.stderr).into_owned();
        assert_eq!(done.status.code(), Some(code), "{sets:?}: {said}");
        assert!(said.contains(what), "{sets:?}: {said}");
    }
    let out = tempfile::tempdir().unwrap();
    let path = out.path().display().to_string();
    let done = fabricate(&["run", &fixture("torus.obj"), "--set", "recipe=net", "--quiet", "--out", &path]);
    let said = String::from_utf8_lossy(&done.stderr).into_owned();
    assert!(done.status.code() == Some(1) && said.contains("the patch is no disk"), "{said}");
}

/// The job of the moulds on a coarser net.
fn molded(out: &std::path::Path, sets: &[&str]) -> Value {
    let bottle = fixture("mold.toml");
    let handles = "bend.handles=[{at=[0,6]},{at=[0,7]},{at=[1,6]},{at=[20,6],by=[-65,0,-22]}]";
    let mut args = vec![bottle.as_str()];
    for it in ["net.rows=21", "net.columns=13", "mold.panel_strips=2", handles, "nest.effort=1"].iter().chain(sets) {
        args.extend(["--set", it]);
    }
    job(out, &args)
}

#[test]
fn a_bottle_is_clad_with_panels_of_one_mould() {
    let out = tempfile::tempdir().unwrap();
    let report = molded(out.path(), &[]);
    assert!(failed(&report).is_empty(), "{:#?}", failed(&report));
    let mold = &report["mold"];
    let segments = mold["segments"].as_array().unwrap();
    assert!(segments.len() > 1, "{mold}");
    for it in segments {
        assert!(it["watertight"] == true && it["dowel_holes"].as_u64().unwrap() > 0, "{it}");
        assert!(it["size_mm"].as_array().unwrap().iter().all(|it| it.as_f64().unwrap() <= 120.0), "{it}");
        assert!(out.path().join(it["file"].as_str().unwrap()).exists(), "{it}");
    }
    assert!(
        mold["strips_congruence_mm"].as_f64().unwrap() <= 0.1 && mold["max_strain"].as_f64().unwrap() <= 4e-5,
        "{mold}"
    );
    assert!(out.path().join("mold/profile.dxf").exists());
    let schedule = std::fs::read_to_string(out.path().join("mold/panels.csv")).unwrap();
    assert!(schedule.lines().count() > 6 && schedule.contains(",M1,M1-1-1 "), "{schedule}");
    assert_eq!(report["flatten"]["pieces"].as_array().unwrap().len() + 1, schedule.lines().count(), "a line per part");
}

#[test]
fn moulds_of_ribs_and_programs_that_mill_them() {
    let out = tempfile::tempdir().unwrap();
    let report = molded(out.path(), &["mold.form=ribs", "mold.rib_depth=15 mm"]);
    assert!(failed(&report).is_empty(), "{:#?}", failed(&report));
    assert!(out.path().join("mold/R1-up1.dxf").exists() && out.path().join("mold/R1-level2.dxf").exists());
    let bottle = fixture("mold.toml");
    let sets = [
        "net.rows=21",
        "net.columns=13",
        "bend.handles=[]",
        "mold.ball=12 mm",
        "mold.scallop=0.2 mm",
        "mold.panel_rows=10",
    ];
    let args: Vec<&str> = sets.iter().flat_map(|it| ["--set", it]).collect();
    let report = job(out.path(), &[&[bottle.as_str(), "--to", "mold"][..], &args].concat());
    assert!(failed(&report).is_empty(), "{:#?}", failed(&report));
    let program = &report["mold"]["programs"][0];
    assert!(
        program["max_gouge_mm"].as_f64().unwrap() <= 0.02 && program["max_scallop_mm"].as_f64().unwrap() <= 0.2,
        "{program}"
    );
    let text = std::fs::read_to_string(out.path().join(program["file"].as_str().unwrap())).unwrap();
    assert!(text.contains("G1 X") && text.trim_end().ends_with("M2"), "{}", &text[..300]);
}

#[test]
fn moulds_that_cannot_be_say_why() {
    for (set, what) in [
        ("mold.lambda=50", "is too large, take at most"),
        ("mold.radius=5000 mm", "is too large, take at most"),
        ("mold.wall=200 mm", "make it thinner"),
        ("mold.size=[\"20 mm\",\"20 mm\",\"20 mm\"]", "the machine takes 20 × 20 × 20 mm"),
    ] {
        let out = tempfile::tempdir().unwrap();
        let report = molded(out.path(), &["bend.handles=[]", set]);
        let failed = failed(&report);
        assert!(failed.len() == 1 && failed[0]["name"] == "mold", "{set}: {failed:#?}");
        assert!(failed[0]["note"].as_str().unwrap().contains(what), "{set}: {failed:#?}");
    }
}
