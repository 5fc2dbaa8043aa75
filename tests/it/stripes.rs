//! Jobs with stripes: a ball that is zipped up from one strip, lines engraved on a developable job, and refusals.
use crate::job::{fabricate, fixture, job};

fn failed(report: &serde_json::Value) -> Vec<String> {
    let checks = report["checks"].as_array().unwrap();
    checks.iter().filter(|it| it["ok"] != true).map(|it| format!("{}: {}", it["name"], it["note"])).collect()
}

/// The report of a job up to its parts, all of whose checks must hold.
fn holds(mesh: &str, settings: &[&str], out: &std::path::Path) -> serde_json::Value {
    let mesh = fixture(mesh);
    let mut args = vec![mesh.as_str(), "--to", "layout", "--threads", "1"];
    settings.iter().for_each(|it| args.extend(["--set", it]));
    let report = job(out, &args);
    assert!(failed(&report).is_empty(), "{:?}", failed(&report));
    report
}

#[test]
fn a_ball_is_one_strip_that_can_be_zipped_up() {
    let out = tempfile::tempdir().unwrap();
    let settings = [
        "recipe=stripes",
        "input.height=\"60 mm\"",
        "stripes.field=\"axis\"",
        "stripes.spacing=5",
        "stripes.one_strip=true",
        "cut.fit_sheet=false",
        "cut.stretch=0.01",
    ];
    let report = holds("ball.off", &settings, out.path());
    let stripes = &report["stripes"];
    assert_eq!((&stripes["lines"], &stripes["open_ends"], &stripes["closed_lines"]), (&1.into(), &2.into(), &0.into()));
    assert_eq!(stripes["found"], stripes["prescribed"]);
    // The zip is as long as the area over the spacing, and the widest ribbon as wide as the spacing.
    let length = stripes["longest_line_mm"].as_f64().unwrap();
    let area = std::f64::consts::PI * 60.0 * 60.0;
    assert!((length / (area / 5.0) - 1.0).abs() < 0.05, "{length}");
    let ribbon = &report["ribbons"][0];
    let width = |key: &str| ribbon["width_mm"][key].as_f64().unwrap();
    assert!((width("median") / 5.0 - 1.0).abs() < 0.05 && width("p5") > 4.0 && width("p95") < 6.0, "{ribbon}");
    assert!(ribbon["length_mm"].as_f64().unwrap() > 0.5 * area / 5.0, "{ribbon}");
    // Both edges carry marks, and are equally long.
    assert!(report["outlines"]["match_marks"].as_u64().unwrap() > 100);
    let path = std::fs::read_to_string(out.path().join("stripes/path.csv")).unwrap();
    let along: f64 = path.lines().last().unwrap().rsplit(',').next().unwrap().parse().unwrap();
    assert!((along / length - 1.0).abs() < 1e-6, "{along} {length}");
}

#[test]
fn a_figure_with_limbs_is_one_strip_with_one_zipper() {
    let out = tempfile::tempdir().unwrap();
    let settings = [
        "recipe=stripes",
        "stripes.field=\"axis\"",
        "stripes.spacing=12",
        "stripes.one_strip=true",
        "cut.fit_sheet=false",
        "cut.stretch=0.05",
    ];
    let report = holds("figure.obj", &settings, out.path());
    let stripes = &report["stripes"];
    for (key, count) in [("parts", 1), ("closed_ways", 0), ("gaps", 0), ("branches", 0), ("closed_lines", 0)] {
        assert_eq!(stripes[key], count, "{key}: {stripes}");
    }
    let tips = stripes["found"].as_array().unwrap();
    assert!(tips.len() > 2 && stripes["lines"] == tips.len() - 1, "{stripes}");
    // Where it is divided to lie flat is said, and what is left is one strip once those seams are closed.
    let cut = &report["cut"];
    let pieces = cut["pieces"].as_u64().unwrap();
    assert_eq!(cut["strips"], 1);
    assert!(cut["divisions"].as_array().unwrap().len() as u64 >= pieces - 1, "{cut}");
    let strip = &report["strip"];
    let area = strip["length_mm"].as_f64().unwrap() * strip["width_mm"]["median"].as_f64().unwrap();
    let zipper = stripes["line_length_mm"].as_f64().unwrap();
    assert!((area / 12.0 / zipper - 1.0).abs() < 0.1, "{area} {zipper}");
    for name in ["stripes", "stripes-behind"] {
        assert!(out.path().join(format!("preview/{name}.png")).exists());
    }
}

#[test]
fn lines_are_engraved_on_a_developable_job() {
    let out = tempfile::tempdir().unwrap();
    let settings = [
        "stages=[\"coarsen\",\"stripes\",\"cut\",\"flatten\",\"layout\"]",
        "coarsen.method=\"off\"",
        "stripes.field=\"axis\"",
        "stripes.axis=[0,1,0]",
        "stripes.spacing=10",
        "stripes.angle=90",
        "stripes.cut=false",
    ];
    let report = holds("cylinder.obj", &settings, out.path());
    // Along the axis of a cylinder of radius 30 mm: 18.8 lines around, from rim to rim.
    let lines = report["stripes"]["lines"].as_u64().unwrap();
    assert_eq!(lines, 19);
    assert!(report["outlines"]["engraved_lines"].as_u64().unwrap() >= lines);
    assert!(report.get("ribbons").is_none());
}

#[test]
fn impossible_stripes_are_refused_with_the_reason() {
    let out = tempfile::tempdir().unwrap();
    let dir = out.path().display().to_string();
    let mesh = fixture("ball.off");
    let run = |set: &str| {
        let base = ["run", &mesh, "--set", "recipe=stripes", "--to", "stripes", "--out", &dir, "--set", set];
        let result = fabricate(&base);
        (
            result.status.code(),
            String::from_utf8_lossy(&result.stderr).into_owned() + &String::from_utf8_lossy(&result.stdout),
        )
    };
    for (set, code, said) in [
        ("stripes.spacing=0", 2, "between 0.001"),
        ("stripes.singularities=[{index=1}]", 2, "exactly one of"),
        ("stripes.spacing=0.01", 1, "finer mesh"),
        ("stripes.singularities=[{face=99999,index=1}]", 1, "face 99999"),
        ("stripes.singularities=[{face=1,index=1}]", 1, "-1 is missing"),
        ("stripes.field=\"boundary\"", 1, "no boundary"),
        ("stripes.field=\"guides\"", 2, "must be given"),
        ("stripes.spacing=-3", 2, "between 0.001"),
        ("stripes.even_steps=9999", 2, "between 0"),
        ("stripes.axis=[0,0,0]", 2, "must be a direction"),
        ("stripes.generators=[{number=0,index=1}]", 1, "generator 0"),
        ("stripes.singularities=[{boundary=0,index=1}]", 1, "boundary loop 0"),
        ("stripes.field_singularities=[{face=1,index=1}]", 1, "1 is missing"),
    ] {
        let (found, text) = run(set);
        assert_eq!(found, Some(code), "{set}: {text}");
        assert!(text.contains(said), "{set}: {text}");
    }
    // Surfaces on which no field is defined, before anything runs; of two parts each needs a sum of its own.
    let refused = |mesh: &str, more: &[&str]| {
        let mesh = fixture(mesh);
        let base = ["run", mesh.as_str(), "--set", "recipe=stripes", "--to", "stripes", "--out", dir.as_str()];
        let more: Vec<&str> = more.iter().flat_map(|it| ["--set", it]).collect();
        let result = fabricate(&[&base[..], &more].concat());
        (result.status.code(), String::from_utf8_lossy(&result.stderr).into_owned())
    };
    let all = "input.component=\"all\"";
    for (mesh, more, code, said) in [
        ("broken-two-components.obj", &[][..], 3, "2 separate components"),
        ("broken-nonmanifold-edge.obj", &[], 3, "more than two faces"),
        ("broken-moebius.obj", &[], 3, "only one side"),
        (
            "broken-two-components.obj",
            &[all, "stripes.singularities=[{face=1,index=1},{face=350,index=-1}]"],
            1,
            "component",
        ),
    ] {
        let (found, text) = refused(mesh, more);
        assert_eq!(found, Some(code), "{mesh}: {text}");
        assert!(text.contains(said), "{mesh}: {text}");
    }
}

#[test]
fn two_components_are_striped_each_for_itself() {
    let out = tempfile::tempdir().unwrap();
    let mesh = fixture("broken-two-components.obj");
    let mut args = vec![mesh.as_str(), "--to", "stripes", "--threads", "1"];
    let settings = ["recipe=stripes", "input.component=\"all\"", "stripes.field=\"distance\"", "stripes.spacing=9"];
    settings.iter().for_each(|it| args.extend(["--set", it]));
    let report = job(out.path(), &args);
    assert!(failed(&report).is_empty(), "{:?}", failed(&report));
    let stripes = &report["stripes"];
    assert_eq!((&stripes["components"], &stripes["open_ends"]), (&2.into(), &0.into()));
    // The lines are closed rings, each of which parts its component.
    assert_eq!(stripes["parts"], stripes["closed_lines"].as_u64().unwrap() + 2);
}
