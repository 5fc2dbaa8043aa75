//! Laws of strips on shapes that are cut and flattened like those of a job.
use std::collections::BTreeMap;

use fabricate::{
    mesh::{TriMesh, shapes},
    model::{CutMesh, Flattening, PanelKind, Ruled, Strips},
    numeric::Monitor,
    stages::strips::{Options, Spacing, measure::quality, strips},
};

use crate::{
    job::{fixture, job},
    pieces::run,
};

fn pieces(mesh: TriMesh) -> (CutMesh, Flattening) {
    let (_, cut, flat) = run(mesh, 0.005);
    (cut, flat)
}

fn solved(cut: &CutMesh, flat: &Flattening, tolerance: f64) -> Strips {
    let options = Options { spacing: Spacing::Tolerance(tolerance), planarity: 0.003, fold_angle: 0.5 };
    strips(cut, flat, &options, &Monitor::silent()).unwrap()
}

fn shapes() -> Vec<(&'static str, TriMesh)> {
    vec![
        ("open cylinder", shapes::cylinder(30.0, 180.0, 24, 12)),
        ("frustum", shapes::cone_frustum(60.0, 20.0, 90.0, 30, 8)),
        ("ring", shapes::annulus(20.0, 70.0, 32, 6)),
        ("box", shapes::cuboid(nalgebra::Vector3::new(90.0, 60.0, 30.0), 3)),
        ("plate with a hole", shapes::perforated_plate(1, 30.0, 2)),
        ("sphere", shapes::icosphere(50.0, 3)),
    ]
}

/// How often each directed side of a panel occurs, by points.
fn sides(strips: &Strips) -> BTreeMap<(u32, u32), usize> {
    let mut count = BTreeMap::new();
    for panel in &strips.panels {
        let points: Vec<u32> = panel.outline.iter().map(|&c| strips.corners[c as usize].point).collect();
        for k in 0..points.len() {
            *count.entry((points[k], points[(k + 1) % points.len()])).or_default() += 1;
        }
    }
    count
}

#[test]
fn strips_of_neighbouring_pieces_meet_in_the_same_points() {
    for (name, mesh) in shapes() {
        let boundary = mesh.boundary_loops().len();
        let (cut, flat) = pieces(mesh);
        let out = solved(&cut, &flat, 0.2);
        assert!(out.ruled.iter().all(|it| *it != Ruled::Unsolved), "{name}");
        let sides = sides(&out);
        assert!(sides.values().all(|&it| it == 1), "{name}");
        let open = sides.keys().filter(|(a, b)| !sides.contains_key(&(*b, *a))).count();
        assert_eq!(open > 0, boundary > 0, "{name}: {open} sides without a neighbour");
    }
}

#[test]
fn pieces_are_filled_without_crossings() {
    for (name, mesh) in shapes() {
        let (cut, flat) = pieces(mesh);
        let out = solved(&cut, &flat, 0.2);
        let it = quality(&cut, &flat, &out);
        assert_eq!((it.interleaved, it.crossings), (0, 0), "{name}");
        assert!((it.covered_share - 1.0).abs() < 1e-3, "{name}: {}", it.covered_share);
        assert!(it.planarity_p99 <= 0.003 + 1e-12, "{name}: {}", it.planarity_p99);
        let quads = out.panels.iter().filter(|it| it.kind == PanelKind::Quad).count();
        assert_eq!(quads, it.panels[0], "{name}");
    }
}

#[test]
fn threads_change_nothing() {
    let (cut, flat) = pieces(shapes::cuboid(nalgebra::Vector3::new(90.0, 60.0, 30.0), 3));
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| solved(&cut, &flat, 0.1))
    };
    assert_eq!(on(1), on(3));
}

/// A column of a table of bends, as numbers.
fn column(table: &str, name: &str) -> Vec<f64> {
    let mut lines = table.lines();
    let at = lines.next().unwrap().split(',').position(|it| it == name).unwrap();
    lines.map(|it| it.split(',').nth(at).unwrap().parse().unwrap()).collect()
}

#[test]
fn tables_of_a_job_hold_the_bends_of_a_cone_and_its_sheet_the_rulings() {
    let out = tempfile::tempdir().unwrap();
    let settings = ["strips.tolerance=\"0.2 mm\"", "layout.rulings=\"score\"", "layout.ruling_spacing=\"12 mm\""];
    let mut args = vec!["--threads", "1"];
    for it in &settings {
        args.extend(["--set", it]);
    }
    let mesh = fixture("cone.obj");
    let report = job(out.path(), &[&[mesh.as_str()], &args[..]].concat());
    let text = |path: &str| std::fs::read_to_string(out.path().join(path)).unwrap();
    // Radii of 45 and 15 mm, 90 mm high: across its rulings the cone has the radius of the circle over the cosine of the
    // half angle. It turns by 360 degrees times the sine on the way round, less what lies beyond the last rulings.
    let table = text("strips/rolling.csv");
    let [radii, bends] = ["radius_middle_mm", "bend_deg"].map(|it| column(&table, it));
    let slant = 90.0_f64.hypot(30.0);
    assert!(radii.iter().all(|it| (it / (30.0 * slant / 90.0) - 1.0).abs() < 0.02), "{radii:?}");
    let ends = ["radius_start_mm", "radius_end_mm"].map(|it| column(&table, it));
    for (a, b) in ends[0].iter().zip(&ends[1]).skip(1).take(radii.len() - 2) {
        assert!((a.max(*b) / (45.0 * slant / 90.0) - 1.0).abs() < 0.02, "{a} {b}");
        assert!((a.min(*b) / (15.0 * slant / 90.0) - 1.0).abs() < 0.02, "{a} {b}");
    }
    let total: f64 = bends.iter().sum();
    assert!(total <= 360.0 * 90.0 / slant && total > 300.0, "{total}");
    assert!(column(&table, "length_mm").iter().all(|it| (it / slant - 1.0).abs() < 1e-3));
    assert_eq!(text("strips/press-brake.csv").lines().count(), 1);
    assert_eq!(report["strips"]["tolerance_mm"], 0.2);
    assert_eq!(report["strips"]["bending"][0]["rolled"], radii.len());
    // On the sheet every ruling that is drawn is a mountain score that keeps its distance from the one before.
    let sheet = text("sheets/sheet-01.svg");
    let layer = sheet.split("id=\"score_mountain\"").nth(1).unwrap().split("</g>").next().unwrap();
    let drawn = layer.matches("<path").count() + layer.matches("<line").count() + layer.matches("<polyline").count();
    assert!(drawn >= 8 && drawn < 2 * radii.len(), "{drawn} of {}: {layer}", radii.len());
    assert!(report["checks"].as_array().unwrap().iter().all(|it| it["ok"] == true), "{}", report["checks"]);
}

#[test]
fn a_job_takes_a_number_of_rulings_and_fails_where_the_material_breaks() {
    let out = tempfile::tempdir().unwrap();
    let mesh = fixture("cylinder.obj");
    // The cylinder has a radius of 30 mm.
    let limit = "material.bend_radius=\"35 mm\"";
    let report = job(out.path(), &[&mesh, "--to", "strips", "--set", "strips.count=12", "--set", limit]);
    let rulings = report["strips"]["rulings"].as_u64().unwrap();
    assert!((6..=12).contains(&rulings), "{rulings}");
    let checks = report["checks"].as_array().unwrap();
    let radius = checks.iter().find(|it| it["name"] == "strips.bend_radius").unwrap();
    assert_eq!((&radius["ok"], &radius["limit"]), (&false.into(), &35.0.into()), "{radius}");
    assert!((radius["value"].as_f64().unwrap() / 30.0 - 1.0).abs() < 0.05, "{radius}");
    assert!(radius["note"].as_str().unwrap().contains("piece A near"), "{radius}");
}
