//! Laws of strips on shapes that are cut and flattened like those of a job.
use std::collections::BTreeMap;

use fabricate::{
    mesh::{TriMesh, shapes},
    model::{CutMesh, Flattening, PanelKind, Ruled, Strips},
    numeric::Monitor,
    stages::strips::{Options, Spacing, measure::quality, strips},
};

use crate::pieces::run;

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
