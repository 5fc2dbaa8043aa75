//! The first hour of somebody who has never seen the program: `init`, `check`, a mesh without a config, `--watch`, help.
use std::{
    fs,
    io::{BufRead, BufReader},
    path::Path,
    process::{Command, Stdio},
};

use serde_json::Value;

use crate::job::{fabricate, fixture, job};

fn said(args: &[&str]) -> (Option<i32>, String, String) {
    let done = fabricate(args);
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (done.status.code(), text(&done.stdout), text(&done.stderr))
}

#[test]
fn init_writes_a_config_that_runs_for_every_recipe_and_material() {
    let names = |folder: &str| -> Vec<String> {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("profiles").join(folder);
        let files = fs::read_dir(path).unwrap().map(|it| it.unwrap().path());
        files.map(|it| it.file_stem().unwrap().to_str().unwrap().to_owned()).collect()
    };
    let of_paper = ["developable", "facets", "stripes"].map(|it| (it.to_owned(), "paper-200gsm".to_owned()));
    let jobs = names("materials").into_iter().map(|it| ("developable".to_owned(), it)).chain(of_paper);
    let mut seen = 0;
    for (recipe, material) in jobs {
        let folder = tempfile::tempdir().unwrap();
        fs::copy(fixture("bumpy.obj"), folder.path().join("my shape.obj")).unwrap();
        let dir = folder.path().display().to_string();
        let (code, _, err) = said(&["init", &dir, "--recipe", &recipe, "--material", &material]);
        assert_eq!(code, Some(0), "{recipe} {material}: {err}");
        let config = folder.path().join("fabricate.toml");
        assert!(fs::read_to_string(&config).unwrap().contains("mesh = \"my shape.obj\""));
        let (code, out, err) = said(&["check", &config.display().to_string()]);
        assert_eq!(code, Some(0), "{recipe} {material}: {err}");
        assert!(["mesh", "sheets  roughly", "time  roughly"].iter().all(|it| out.contains(it)), "{out}");
        seen += 1;
    }
    assert!(seen > 10);
}

#[test]
fn check_tells_every_problem_at_its_line() {
    let folder = tempfile::tempdir().unwrap();
    let config = folder.path().join("job.toml");
    let text = "version = 1\n[input]\nmesh = \"MESH\"\nhigh = 3\n[develop]\nenergi = 1\nrounds = 0\n[cut]\nstyle = \"none\"\n[nest]\neffort = 10\n";
    fs::write(&config, text.replace("MESH", &fixture("bumpy.obj"))).unwrap();
    let (code, _, err) = said(&["check", &config.display().to_string()]);
    assert_eq!(code, Some(2), "{err}");
    for line in [4, 6, 7, 9] {
        assert!(err.contains(&format!("job.toml:{line}:")), "line {line}: {err}");
    }
    assert!(err.contains("4 problems to mend"), "{err}");
}

#[test]
fn a_mesh_alone_runs_and_says_the_config_that_does_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let (mesh, out) = (fixture("bumpy.obj"), folder.path().join("out").display().to_string());
    let sets = ["--set", "coarsen.method=quadric", "--set", "coarsen.faces=500"];
    let (code, shown, err) =
        said(&[&["run", &mesh, "--out", &out, "--to", "coarsen", "--seed", "7"][..], &sets].concat());
    assert_eq!(code, Some(0), "{err}");
    // A pipe gets no colours and no bars.
    assert!(!err.contains('\u{1b}') && !shown.contains('\u{1b}') && !err.contains('\r'), "{err:?}");
    assert!(shown.contains("report.html"), "{shown}");
    let config = err.split("\n\n").find(|it| it.starts_with("version = 1")).unwrap_or_else(|| panic!("{err}"));
    let path = folder.path().join("job.toml");
    fs::write(&path, config).unwrap();
    let again = job(&folder.path().join("again"), &[&path.display().to_string(), "--to", "coarsen"]);
    let first: Value = serde_json::from_slice(&fs::read(folder.path().join("out/report.json")).unwrap()).unwrap();
    assert_eq!(first["config"], again["config"]);
    assert_eq!((&again["coarsen"]["faces"], &again["seed"]), (&500.into(), &7.into()));
}

#[test]
fn help_is_printed_for_editors_shells_and_man() {
    let (code, schema, _) = said(&["schema"]);
    let schema: Value = serde_json::from_str(&schema).unwrap();
    assert_eq!((code, &schema["properties"]["coarsen"]["additionalProperties"]), (Some(0), &false.into()));
    let (_, man, _) = said(&["man"]);
    assert!(man.contains("FABRICATE RUN") && man.contains("\\-\\-watch"), "{man}");
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        assert!(said(&["completions", shell]).1.contains("watch"), "{shell}");
    }
}

#[test]
fn watch_runs_again_what_changed() {
    let folder = tempfile::tempdir().unwrap();
    let config = folder.path().join("job.toml");
    let write = |faces: usize| {
        let text =
            format!("[input]\nmesh = {:?}\n[coarsen]\nmethod = \"quadric\"\nfaces = {faces}\n", fixture("bumpy.obj"));
        fs::write(&config, text).unwrap();
    };
    write(300);
    let out = folder.path().join("out");
    let mut run = Command::new(env!("CARGO_BIN_EXE_fabricate"));
    run.args(["run", "--watch", "--to", "coarsen", "--out"]).arg(&out).arg(&config);
    let mut child = run.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    let mut lines = BufReader::new(child.stderr.take().unwrap()).lines().map(|it| it.unwrap());
    let faces = || -> Value {
        let report: Value = serde_json::from_slice(&fs::read(out.join("report.json")).unwrap()).unwrap();
        report["coarsen"]["faces"].clone()
    };
    assert!(lines.any(|it| it.contains("watching 2 files")));
    assert_eq!(faces(), 300);
    write(400);
    assert!(lines.any(|it| it.contains("watching 2 files")));
    assert_eq!(faces(), 400);
    assert!(Command::new("kill").arg(child.id().to_string()).status().unwrap().success());
    assert_eq!(child.wait().unwrap().code(), Some(130));
}
