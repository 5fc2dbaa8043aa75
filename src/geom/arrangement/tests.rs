//! Faces, gaps, doubled lines and joined pieces of arrangements.
use super::*;

fn curve(kind: u32, closed: bool, points: &[[f64; 2]]) -> Curve {
    Curve { points: points.iter().map(|p| Vec2::new(p[0], p[1])).collect(), closed, kind }
}

fn square() -> Curve {
    curve(0, true, &[[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]])
}

fn circle(radius: f64) -> Curve {
    let points: Vec<[f64; 2]> = (0..64)
        .map(|k| f64::from(k) * std::f64::consts::TAU / 64.0)
        .map(|a| [2.0 + radius * a.cos(), 2.0 + radius * a.sin()])
        .collect();
    curve(1, true, &points)
}

fn areas(it: &Arrangement) -> Vec<f64> {
    let mut out: Vec<f64> = it.faces[1..].iter().map(|face| crate::geom::polygon::area(face)).collect();
    out.sort_by(f64::total_cmp);
    out
}

/// V − E + F = 1 + C for every arrangement whose closed arcs are given a node each.
fn euler(it: &Arrangement, components: usize) {
    let loops = it.arcs.iter().filter(|arc| arc.ends.is_none()).count();
    assert_eq!((it.nodes.len() + loops + it.faces.len()) as i64 - it.arcs.len() as i64, 1 + components as i64);
}

#[test]
fn crossing_creases_make_four_patches() {
    let creases = [square(), curve(1, false, &[[0.0, 1.0], [4.0, 1.0]]), curve(1, false, &[[3.0, 0.0], [3.0, 4.0]])];
    let it = Arrangement::new(&creases, 1e-3, &|_| false).unwrap();
    euler(&it, 1);
    assert_eq!(areas(&it), [1.0, 3.0, 3.0, 9.0]);
    assert_eq!(it.nodes.len(), 5);
    assert!(it.notes.is_empty());
    // With the sheet on both sides of every crease, and on one side of the border.
    assert!(it.arcs.iter().all(|arc| (arc.left == 0 || arc.right == 0) == (arc.kind == 0)));
}

#[test]
fn rings_lie_inside_each_other() {
    let it = Arrangement::new(&[square(), circle(1.5), circle(0.5)], 1e-3, &|_| false).unwrap();
    euler(&it, 3);
    let areas = areas(&it);
    assert!((areas.iter().sum::<f64>() - 16.0).abs() < 1e-12);
    let disk = |r: f64| 32.0 * r * r * (std::f64::consts::TAU / 64.0).sin();
    for (area, expected) in areas.iter().zip([disk(0.5), disk(1.5) - disk(0.5), 16.0 - disk(1.5)]) {
        assert!((area - expected).abs() < 1e-12, "{area} {expected}");
    }
}

#[test]
fn small_gaps_are_closed_and_told() {
    let creases = [square(), curve(1, false, &[[0.02, 1.0], [2.0, 1.5], [4.03, 1.0]])];
    let it = Arrangement::new(&creases, 0.05, &|_| false).unwrap();
    euler(&it, 1);
    assert_eq!(it.faces.len(), 3);
    let moved: Vec<f64> =
        it.notes.iter().map(|note| if let Note::Snapped { distance, .. } = note { *distance } else { 1.0 }).collect();
    assert_eq!(moved.len(), 2);
    assert!(moved.iter().zip([0.02, 0.03]).all(|(a, b)| (a - b).abs() < 1e-12), "{moved:?}");
    // With a smaller tolerance the crease ends in nowhere: it has the same face on both sides.
    let it = Arrangement::new(&creases, 1e-3, &|_| false).unwrap();
    assert!(it.arcs.iter().any(|arc| arc.kind == 1 && arc.left == arc.right));
}

#[test]
fn a_line_drawn_twice_counts_once() {
    let line = curve(1, false, &[[0.0, 1.0], [2.0, 1.5], [4.0, 1.0]]);
    let it = Arrangement::new(&[square(), line.clone(), line], 1e-3, &|_| false).unwrap();
    euler(&it, 1);
    assert_eq!(it.faces.len(), 3);
    let doubled: f64 =
        it.notes.iter().map(|note| if let Note::Overlap { length, .. } = note { *length } else { 0.0 }).sum();
    assert!((doubled - 2.0 * 2.0_f64.hypot(0.5)).abs() < 1e-12, "{:?}", it.notes);
}

#[test]
fn pieces_of_a_smooth_curve_are_one_crease() {
    // In pieces and in changing directions, as drawing programs write them; the corner at the end of the third stays.
    let it = Arrangement::new(
        &[
            square(),
            curve(1, false, &[[0.0, 1.0], [1.0, 1.1]]),
            curve(1, false, &[[2.0, 1.3], [1.0, 1.1]]),
            curve(1, false, &[[2.0, 1.3], [2.5, 1.5]]),
            curve(1, false, &[[2.5, 1.5], [2.5, 4.0]]),
        ],
        1e-3,
        &|_| false,
    )
    .unwrap();
    euler(&it, 1);
    let mut sizes: Vec<usize> = it.arcs.iter().filter(|arc| arc.kind == 1).map(|arc| arc.points.len()).collect();
    sizes.sort_unstable();
    assert_eq!(sizes, [2, 4]);
}

#[test]
fn many_crossings_keep_the_area() {
    // Twelve chords through a square: every pair that crosses makes one node.
    let mut curves = vec![square()];
    for k in 0..12 {
        let t = f64::from(k);
        curves.push(curve(1, false, &[[0.0, 0.3 + 0.3 * t], [4.0, 0.1 + 3.7 * (0.37 * t).sin().abs()]]));
    }
    let it = Arrangement::new(&curves, 1e-6, &|_| false).unwrap();
    euler(&it, 1);
    assert!((areas(&it).iter().sum::<f64>() - 16.0).abs() < 1e-9);
}

#[test]
fn numbers_that_are_none_are_refused() {
    let broken = curve(1, false, &[[0.0, 1.0], [f64::NAN, 1.0]]);
    let error = Arrangement::new(&[square(), broken], 1e-3, &|_| false).unwrap_err();
    assert!(error.to_string().starts_with("point 1 of curve 1"), "{error}");
}
