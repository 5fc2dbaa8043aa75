//! The report page as a file: what it holds, and that it asks nobody for anything. What it does in a browser is tested by
//! `tests/page/check_page.py`.
use std::{fs, path::Path};

use serde_json::Value;

use crate::job::{fixture, job, settled};

/// Text between the tags of the script of this id, and all before and after it.
fn script<'a>(page: &'a str, id: &str) -> (&'a str, &'a str, &'a str) {
    let (before, rest) = page.split_once(&format!("<script id=\"{id}\"")).unwrap();
    let (_, rest) = rest.split_once('>').unwrap();
    let (text, after) = rest.split_once("</script>").unwrap();
    (before, text, after)
}

/// The page of a job, apart from its report; and that, without what may differ between runs.
pub(crate) fn read(out: &Path) -> (String, Value) {
    let page = fs::read_to_string(out.join("report.html")).unwrap();
    let (before, report, after) = script(&page, "report");
    (format!("{before}{after}"), settled(serde_json::from_str(report).unwrap()))
}

#[test]
fn the_page_holds_the_report_the_meshes_and_the_sheets_and_loads_nothing() {
    let out = tempfile::tempdir().unwrap();
    let report = job(out.path(), &[&fixture("bumpy.obj"), "--threads", "1"]);
    let (page, held) = read(out.path());
    assert_eq!(held, settled(report.clone()));
    let scene: Value = serde_json::from_str(script(&page, "scene").1).unwrap();
    let names: Vec<_> = scene["models"].as_array().unwrap().iter().map(|it| it["name"].as_str().unwrap()).collect();
    // The coarse mesh of this job is the input.
    assert_eq!(names, ["input", "developed", "cut", "strips"]);
    let faces = |name: &str| {
        let model = scene["models"].as_array().unwrap().iter().find(|it| it["name"] == name).unwrap();
        model["triangles"]["n"].as_u64().unwrap() / 3
    };
    assert_eq!(Some(faces("input")), report["input"]["faces"].as_u64());
    assert_eq!(faces("developed"), faces("cut"));
    assert_eq!(scene["pieces"].as_array().map(Vec::len), report["cut"]["pieces"].as_u64().map(|it| it as usize));
    assert_eq!(scene["seams"].as_array().map(Vec::len), report["seams"]["count"].as_u64().map(|it| it as usize));
    assert_eq!(scene["sheets"].as_array().map(Vec::len), report["layout"]["sheets"].as_u64().map(|it| it as usize));
    let svg = fs::metadata(out.path().join("sheets/sheet-01.svg")).unwrap().len();
    assert_eq!(scene["sheets"][0]["svg"]["n"].as_u64(), Some(svg));
    // Names of namespaces are no addresses to load from.
    for (at, _) in page.match_indices("://") {
        assert!(page[at - 4..].starts_with("http://www.w3.org/"), "{}", &page[at - 20..at + 40]);
    }
    for tag in ["<link", "src=\"", "@import", "url("] {
        assert!(!page.contains(tag), "{tag}");
    }
}

#[test]
fn a_job_that_stops_early_has_a_page_too() {
    let out = tempfile::tempdir().unwrap();
    let name = out.path().join("a<script>.stl");
    fs::copy(fixture("ball.stl"), &name).unwrap();
    job(out.path(), &[&name.display().to_string(), "--to", "coarsen"]);
    let (page, report) = read(out.path());
    assert_eq!(report["input"]["file"], "a<script>.stl");
    assert!(page.contains("<title>a&lt;script&gt;.stl"));
    let scene: Value = serde_json::from_str(script(&page, "scene").1).unwrap();
    assert_eq!(scene["sheets"], serde_json::json!([]));
    assert_eq!(scene["up"], 2);
}
