//! The program as a user meets it: whole jobs, the cache, interruption, determinism, and what it says about bad input.
use std::{
    collections::BTreeMap,
    fs,
    io::{BufRead, BufReader},
    path::{Path, PathBuf},
    process::{Command, Output, Stdio},
};

use serde_json::Value;

use crate::page;

pub(crate) fn fixture(name: &str) -> String {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures").join(name).display().to_string()
}

pub(crate) fn fabricate(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_fabricate")).args(args).output().unwrap()
}

/// Runs a job into `out` and returns its report; `1` (a failed check) is an end like any other.
pub(crate) fn job(out: &Path, args: &[&str]) -> Value {
    let out_arg = out.display().to_string();
    let result = fabricate(&[&["run"], args, &["--out", &out_arg, "--quiet", "--json"]].concat());
    let stderr = String::from_utf8_lossy(&result.stderr);
    assert!(matches!(result.status.code(), Some(0 | 1)), "{stderr}");
    serde_json::from_slice(&result.stdout).unwrap()
}

/// All files under a folder but the reports and the cache, by relative path.
fn files(root: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut found = BTreeMap::new();
    let mut folders = vec![root.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.ends_with(".cache") || path.ends_with("report.json") || path.ends_with("report.html") {
                continue;
            }
            if path.is_dir() {
                folders.push(path);
            } else {
                found.insert(path.strip_prefix(root).unwrap().to_owned(), fs::read(&path).unwrap());
            }
        }
    }
    found
}

/// The report without the keys that may differ between runs (CONTRACT.md).
pub(crate) fn settled(mut report: Value) -> Value {
    fn strip(value: &mut Value) {
        match value {
            Value::Object(map) => {
                map.retain(|key, _| {
                    !(key.starts_with("seconds") && key != "seconds_estimate"
                        || key.ends_with("_ms")
                        || ["peak_rss_mb", "cached", "versions"].contains(&key.as_str()))
                });
                map.values_mut().for_each(strip);
            }
            Value::Array(items) => items.iter_mut().for_each(strip),
            _ => {}
        }
    }
    strip(&mut report);
    report
}

fn cached(report: &Value) -> Vec<(String, bool)> {
    let stages = report["stages"].as_array().unwrap();
    stages.iter().map(|it| (it["name"].as_str().unwrap().to_owned(), it["cached"].as_bool().unwrap())).collect()
}

#[test]
fn the_same_job_gives_the_same_bytes_on_any_number_of_threads() {
    let (one, two) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let mesh = fixture("bumpy.obj");
    let a = job(one.path(), &[&mesh, "--threads", "1"]);
    let b = job(two.path(), &[&mesh, "--threads", "2"]);
    assert_eq!(settled(a), settled(b));
    assert_eq!(page::read(one.path()), page::read(two.path()));
    let (a, b) = (files(one.path()), files(two.path()));
    assert_eq!(a.keys().collect::<Vec<_>>(), b.keys().collect::<Vec<_>>());
    for (path, bytes) in &a {
        assert!(bytes == &b[path], "{} differs", path.display());
    }
    let names: Vec<_> = a.keys().map(|it| it.display().to_string()).collect();
    for expected in [
        "sheets/sheet-01.svg",
        "sheets/sheet-01.dxf",
        "sheets/sheet-01.nc",
        "preview/sheet-01.png",
        "model/developed.obj",
    ] {
        assert!(names.iter().any(|it| it == expected), "{expected} is missing among {names:?}");
    }
}

#[test]
fn an_edit_of_a_late_table_runs_no_early_stage() {
    let out = tempfile::tempdir().unwrap();
    let mesh = fixture("bumpy.obj");
    let first = job(out.path(), &[&mesh]);
    assert!(cached(&first).iter().all(|it| !it.1), "{:?}", cached(&first));
    let again = job(out.path(), &[&mesh]);
    assert!(cached(&again).iter().all(|it| it.1), "{:?}", cached(&again));
    assert_eq!(settled(first), settled(again));
    let late = job(out.path(), &[&mesh, "--set", "layout.fold_angle=40"]);
    for (stage, cached) in cached(&late) {
        let early = ["coarsen", "develop", "cut", "flatten", "strips"].contains(&stage.as_str());
        assert_eq!(cached, early, "{stage}");
    }
    let alone = job(out.path(), &[&mesh, "--only", "A"]);
    let placed = alone["layout"]["placed"].as_array().unwrap();
    assert_eq!((placed.len(), placed[0]["name"].as_str()), (1, Some("A")));
    let unknown = job(out.path(), &[&mesh, "--only", "A", "--only", "nobody"]);
    assert!(unknown["checks"].to_string().contains("there is no part `nobody`; there are A"), "{}", unknown["checks"]);
    let forced = job(out.path(), &[&mesh, "--from", "cut"]);
    assert!(cached(&forced).iter().all(|(name, cached)| *cached == ["coarsen", "develop"].contains(&name.as_str())));
}

#[test]
fn a_damaged_cache_is_a_miss_with_a_warning() {
    let out = tempfile::tempdir().unwrap();
    let mesh = fixture("bumpy.obj");
    job(out.path(), &[&mesh, "--to", "coarsen"]);
    let mut damaged = 0;
    for entry in fs::read_dir(out.path().join(".cache")).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|it| it == "bin") {
            let mut bytes = fs::read(&path).unwrap();
            let middle = bytes.len() / 2;
            bytes[middle] ^= 1;
            fs::write(&path, bytes).unwrap();
            damaged += 1;
        }
    }
    assert_eq!(damaged, 1);
    let out_arg = out.path().display().to_string();
    let result = fabricate(&["run", &mesh, "--to", "coarsen", "--out", &out_arg, "--quiet"]);
    let stderr = String::from_utf8_lossy(&result.stderr);
    assert!(stderr.contains("warning: cache:") && stderr.contains("is damaged; computing `coarsen` again"), "{stderr}");
    assert_eq!(result.status.code(), Some(0), "{stderr}");
}

#[cfg(unix)]
#[test]
fn ctrl_c_leaves_no_half_file_and_the_next_run_goes_on() {
    let out = tempfile::tempdir().unwrap();
    let mesh = fixture("figure.obj");
    let mut child = Command::new(env!("CARGO_BIN_EXE_fabricate"))
        .args(["run", &mesh, "--out", &out.path().display().to_string()])
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // Interrupt while `develop` is at work: its predecessor has just said that it is done.
    let mut lines = BufReader::new(child.stderr.take().unwrap()).lines();
    let seen = lines.by_ref().find(|it| it.as_ref().is_ok_and(|it| it.trim_start().starts_with("coarsen")));
    assert!(seen.is_some(), "coarsen was never reported");
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    let rest: Vec<String> = lines.map_while(Result::ok).collect();
    assert_eq!(child.wait().unwrap().code(), Some(130), "{rest:?}");
    assert!(files(out.path()).is_empty(), "{:?}", files(out.path()).keys());
    assert!(!out.path().join("report.json").exists());
    let next = job(out.path(), &[&mesh, "--to", "coarsen"]);
    assert_eq!(cached(&next), [("coarsen".to_owned(), true)]);
}

#[cfg(unix)]
#[test]
fn an_interrupted_develop_goes_on_after_its_last_round() {
    let (broken, whole) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let mesh = fixture("bumpy.obj");
    let args = [&mesh, "--to", "develop", "--set", "develop.rounds=6", "--set", "develop.curve=[\"2 %\"]"];
    let mut child = Command::new(env!("CARGO_BIN_EXE_fabricate"))
        .args([&["run"], &args[..], &["--out", &broken.path().display().to_string(), "--quiet"]].concat())
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    let draft = broken.path().join(".cache/unfinished-develop.bin");
    while !draft.exists() {
        assert!(child.try_wait().unwrap().is_none(), "it ended before a round was kept");
        std::thread::sleep(std::time::Duration::from_millis(2));
    }
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    assert_eq!(child.wait().unwrap().code(), Some(130));
    assert!(draft.exists());
    let (next, other) = (job(broken.path(), &args), job(whole.path(), &args));
    assert!(!draft.exists(), "a finished stage leaves nothing unfinished");
    assert_eq!(next["develop"]["curve"].as_array().unwrap().len(), 1);
    assert_eq!(settled(next), settled(other));
    assert!(files(broken.path()) == files(whole.path()));
    assert!(whole.path().join("preview/round-06.png").exists() && whole.path().join("preview/deviation.svg").exists());
}

#[test]
fn one_triangle_is_developable_already() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = folder.path().join("triangle.obj");
    fs::write(&mesh, "v 0 0 0\nv 80 0 0\nv 0 60 0\nf 1 2 3\n").unwrap();
    let report = job(&folder.path().join("out"), &[&mesh.display().to_string(), "--to", "develop"]);
    assert_eq!(report["develop"]["rounds"][0]["stopped"], "developable already");
    // The input is moved and scaled on its way in, so not zero to the last digit.
    assert!(report["develop"]["hausdorff_bound_pct"].as_f64().unwrap() < 1e-12);
    assert_eq!(report["status"], "ok", "{}", report["checks"]);
}

/// Name, config, exit code, and what the complaint must hold.
const BAD_CONFIGS: &[(&str, &str, i32, &[&str])] = &[
    ("no mesh", "version = 1\n", 2, &["the config names no mesh"]),
    ("missing mesh", "[input]\nmesh = \"nowhere.obj\"\n", 3, &["cannot read the mesh", "nowhere.obj"]),
    ("unknown key", "[input]\nmash = \"a.obj\"\n", 2, &["unknown key `mash` (did you mean `mesh`?)", "job.toml:2:1"]),
    (
        "a value for a table",
        "develop = 3\n[input]\nmesh = \"MESH\"\n",
        2,
        &["`develop` is a table: write", "job.toml:1:1"],
    ),
    (
        "wrong type",
        "seed = \"three\"\n[input]\nmesh = \"MESH\"\n",
        2,
        &["job.toml:1:8", "must be a whole number, 0 or more, not \"three\""],
    ),
    (
        "unknown stage key",
        "[input]\nmesh = \"MESH\"\n[develop]\nenergi = 1\n",
        2,
        &["[develop]", "unknown key `energi` (did you mean `energy`?)", "job.toml:4:1"],
    ),
    (
        "no rounds",
        "[input]\nmesh = \"MESH\"\n[develop]\nrounds = 0\n",
        2,
        &["`rounds` must be between 1 and 100, not 0", "job.toml:"],
    ),
    (
        "unknown energy",
        "[input]\nmesh = \"MESH\"\n[develop]\nenergy = \"willmore\"\n",
        2,
        &["must be one of covariance", "job.toml:"],
    ),
    (
        "no deviation",
        "[input]\nmesh = \"MESH\"\n[develop]\nmax_deviation = 0\n",
        2,
        &["`max_deviation` must be between", "job.toml:"],
    ),
    (
        "optimiser without derivatives",
        "[input]\nmesh = \"MESH\"\n[[develop.round]]\nenergy = \"intrinsic\"\noptimizer = \"levenberg\"\n",
        2,
        &["`round.optimizer` \"levenberg\" cannot minimise \"intrinsic\"", "write \"auto\"", "job.toml:"],
    ),
    ("unknown table", "[input]\nmesh = \"MESH\"\n[devellop]\n", 2, &["unknown table [devellop]", "job.toml:3"]),
    ("unknown recipe", "recipe = \"developpable\"\n", 2, &["unknown recipe", "developable"]),
    ("unknown profile", "[input]\nmesh = \"MESH\"\n[material]\nprofile = \"papr\"\n", 2, &["papr", "paper-200gsm"]),
    (
        "unknown format",
        "[input]\nmesh = \"MESH\"\n[output]\nformats = [\"svgg\"]\n",
        2,
        &["unknown format `svgg`", "svg"],
    ),
    (
        "unknown colour",
        "[input]\nmesh = \"MESH\"\n[machine]\nlayers.score-valley.color = \"teal\"\n",
        2,
        &["`teal` is not a colour; write it as \"#rrggbb\"", "job.toml:4"],
    ),
    (
        "unknown operation",
        "[input]\nmesh = \"MESH\"\n[machine]\nlayers.fold = { name = \"FOLD\", color = \"#123456\" }\n",
        2,
        &["the name of an operation", "score-valley", "job.toml:4"],
    ),
    (
        "two operations of one colour",
        "[input]\nmesh = \"MESH\"\n[machine]\nlayers.sew.color = \"#ff0000\"\n",
        2,
        &["must share both name and colour or neither", "job.toml:4"],
    ),
    (
        "a tab without width",
        "[input]\nmesh = \"MESH\"\n[material]\njoin.width = 0\n",
        2,
        &["`join.width`: must be between 0.5 and 200", "job.toml:4"],
    ),
    (
        "K-factors in disorder",
        "[input]\nmesh = \"MESH\"\n[material]\nbend = { radius = 2, k_factor = [[3, 0.4], [1, 0.3]] }\n",
        2,
        &["must list pairs [R/T, K] with rising R/T", "job.toml:4"],
    ),
    (
        "margins that eat the sheet",
        "[input]\nmesh = \"MESH\"\n[material]\nmargin = 150\n",
        2,
        &["leaves nothing of a sheet", "job.toml:4"],
    ),
    ("version of the future", "version = 9\n", 2, &["version 1, not 9", "job.toml:1:11"]),
    ("not TOML", "[input\n", 2, &["job.toml:1"]),
    ("two sizes", "[input]\nmesh = \"MESH\"\nheight = 3\nscale = 2\n", 2, &["both give the size", "job.toml:"]),
    ("negative size", "[input]\nmesh = \"MESH\"\nheight = \"-3 mm\"\n", 2, &["must be more than 0", "job.toml:3:10"]),
    ("wrong unit", "[input]\nmesh = \"MESH\"\nheight = \"3 furlong\"\n", 2, &["furlong", "mm, cm, m", "job.toml:3:10"]),
    (
        "wrong order",
        "stages = [\"flatten\"]\n[input]\nmesh = \"MESH\"\n",
        2,
        &["needs CutMesh", "`cut`", "job.toml:1:10"],
    ),
];

#[test]
fn bad_configs_are_told_their_line() {
    let folder = tempfile::tempdir().unwrap();
    let config = folder.path().join("job.toml");
    for (name, text, code, wanted) in BAD_CONFIGS {
        fs::write(&config, text.replace("MESH", &fixture("bumpy.obj"))).unwrap();
        complain(name, &config, &[], *code, wanted);
    }
    fs::write(&config, b"# gr\xfc\xdfe\n").unwrap();
    complain("Latin-1", &config, &[], 2, &["not UTF-8", "line 1", "0xFC"]);
    complain("no config", &folder.path().join("none.toml"), &[], 2, &["cannot read the config", "none.toml"]);
}

/// Fixture, exit code, and what the complaint must hold.
const BAD_MESHES: &[(&str, &[&str])] = &[
    ("broken-nan.obj", &["nan"]),
    ("broken-empty.obj", &["is empty"]),
    ("broken-points-only.obj", &["no faces"]),
    ("broken-out-of-range.obj", &["vert"]),
    ("broken-nonmanifold-edge.obj", &["more than two faces", "edge 84-85"]),
    ("broken-moebius.obj", &["orient"]),
    ("broken-two-components.obj", &["component"]),
];

#[test]
fn bad_meshes_are_refused_with_a_reason() {
    for (name, wanted) in BAD_MESHES {
        complain(name, Path::new(&fixture(name)), &[], 3, wanted);
    }
}

#[cfg(unix)]
#[test]
fn an_output_folder_that_cannot_be_written_is_said_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("file");
    fs::write(&file, "kept").unwrap();
    let inside = file.join("out").display().to_string();
    complain("a file in the way", Path::new(&fixture("bumpy.obj")), &["--out", &inside], 4, &["cannot write", "file"]);
    assert_eq!(fs::read_to_string(file).unwrap(), "kept");
}

fn complain(name: &str, job: &Path, args: &[&str], code: i32, wanted: &[&str]) {
    let job = job.display().to_string();
    let out = tempfile::tempdir().unwrap();
    let out_arg = out.path().join("out").display().to_string();
    let out_args: &[&str] = if args.contains(&"--out") { &[] } else { &["--out", &out_arg] };
    let result = fabricate(&[&["run", &job, "--quiet"], out_args, args].concat());
    let stderr = String::from_utf8_lossy(&result.stderr);
    assert_eq!(result.status.code(), Some(code), "{name}: {stderr}");
    for text in wanted {
        assert!(stderr.to_lowercase().contains(&text.to_lowercase()), "{name}: no `{text}` in: {stderr}");
    }
    assert!(!stderr.contains("panicked"), "{name}: {stderr}");
    assert_eq!(stderr.matches("error: ").count(), 1, "{name}: one message, not {stderr}");
    assert!(result.stdout.is_empty(), "{name}");
}

#[test]
fn seams_drawn_on_the_input_are_followed_and_bad_ones_named() {
    let dir = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| {
        let path = dir.path().join(name);
        fs::write(&path, text).unwrap();
        path.display().to_string()
    };
    // An open tube, its first three sides of another material.
    let mut tube = String::new();
    for k in 0..12 * 7 {
        let (t, y) = (std::f64::consts::TAU * f64::from(k % 12) / 12.0, 20.0 * f64::from(k / 12));
        tube += &format!("v {} {y} {}\n", 30.0 * t.cos(), 30.0 * t.sin());
    }
    for k in 0..12 * 6 {
        let (a, b) = (k + 1, k / 12 * 12 + (k + 1) % 12 + 1);
        let paint = if k % 12 < 3 { "front" } else { "back" };
        tube += &format!("usemtl {paint}\nf {a} {} {}\nf {a} {} {b}\n", a + 12, b + 12, b + 12);
    }
    write("tube.obj", &tube);
    write("lines.obj", "v -30 0 0\nv -30 120 0\nl 1 2\n");
    let config = |name: &str, cut: &str| {
        let head = "version = 1\n[input]\nmesh = \"tube.obj\"\nunits = \"mm\"\n[develop]\nlevels = 0\nrounds = 1\n";
        write(name, &format!("{head}iterations = 3\n[coarsen]\nmethod = \"off\"\n[cut]\nfit_sheet = false\n{cut}"))
    };
    let good = config("good.toml", "seams = \"lines.obj\"\n[[cut.avoid]]\npaint = \"front\"\n");
    let report = job(&dir.path().join("out"), &[&good, "--to", "cut"]);
    let drawn = &report["cut"]["drawn_seams"];
    let length = drawn["length_mm"].as_f64().unwrap();
    assert!((length - 120.0).abs() < 3.0, "{length}");
    assert!(drawn["max_distance_mm"].as_f64().unwrap() < 2.0);
    assert!((report["cut"]["seam_length_mm"].as_f64().unwrap() - length).abs() < 1e-6, "one seam, the drawn one");
    let checks = report["checks"].as_array().unwrap();
    assert!(checks.iter().any(|it| it["name"] == "cut.drawn_seams" && it["ok"] == true));
    for (keys, expected) in [
        ("seams = \"tube.obj\"\n", "holds no lines"),
        ("seam_vertices = [[0, 84]]\n", "vertex 84 of cut.seam_vertices"),
        ("[[cut.prefer]]\npaint = \"side\"\n", "there are back, front"),
        ("[[cut.avoid]]\nfaces = [144]\n", "no face 144"),
        ("[[cut.prefer]]\nshare = 0.1\n", "need exactly one of"),
    ] {
        let result = fabricate(&["run", &config("bad.toml", keys), "--quiet"]);
        let stderr = String::from_utf8_lossy(&result.stderr);
        assert!(result.status.code() == Some(2) && stderr.contains(expected), "{stderr}");
    }
}
