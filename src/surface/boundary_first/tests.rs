//! Laws of boundary-first flattening: what was asked for comes out.
use super::*;
use crate::{
    geom::{Vec3, cross2},
    mesh::{EdgeId, Field, TriMesh, shapes},
    surface::{
        chart::{ChartBuilder, Metric},
        paths::{EdgeGraph, PathTree},
    },
};
use std::f64::consts::{FRAC_PI_2, TAU};

/// A bumpy square sheet.
fn sheet() -> TriMesh {
    let flat = shapes::grid(14, 12, 5.0);
    let lifted = |p: &Vec3| Vec3::new(p.x, p.y, 4.0 * (0.11 * p.x).sin() * (0.13 * p.y + 0.4).cos());
    flat.with_positions(Field::from_vec(flat.positions().iter().map(lifted).collect()))
}

fn whole(mesh: &TriMesh) -> (Metric, Chart) {
    (Metric::new(mesh), ChartBuilder::new(mesh).chart(mesh.faces().collect(), &|_| false))
}

/// Exterior angle in the plane at each vertex of the loop.
fn measured(chart: &Chart, uv: &[Vec2]) -> Vec<(u32, f64)> {
    let path = &chart.loops[0];
    let n = path.len();
    let at = |i: usize| uv[path[i % n].1 as usize];
    (0..n)
        .map(|i| {
            let (before, after) = (at(i) - at(i + n - 1), at(i + 1) - at(i));
            (path[i].1, f64::atan2(cross2(before, after), before.dot(&after)))
        })
        .collect()
}

/// Length in the plane over the length asked for, of each edge of the loop.
fn ratios(flattener: &Flattener, map: &Conformal, uv: &[Vec2]) -> Vec<f64> {
    let flat = |i: u32, j: u32| (uv[j as usize] - uv[i as usize]).norm();
    flattener.chart.boundary_edges().zip(&map.lengths).map(|((_, i, j), l)| flat(i, j) / l).collect()
}

/// A map with u given smoothly along the boundary.
fn wavy(flattener: &Flattener) -> Conformal {
    let n = flattener.chart.vertex_count();
    let mut u = vec![0.0; n];
    for (i, &(_, v)) in flattener.chart.loops[0].iter().enumerate() {
        u[v as usize] = 0.1 * (TAU * i as f64 / flattener.chart.loops[0].len() as f64).sin();
    }
    flattener.with_log_factor(&u, &[])
}

#[test]
fn no_scale_on_the_boundary_is_the_isometric_layout() {
    let mesh = sheet();
    let (metric, chart) = whole(&mesh);
    let flattener = Flattener::new(&metric, &chart).unwrap();
    let map = flattener.with_log_factor(&vec![0.0; chart.vertex_count()], &[]);
    let uv = flattener.lay_out(&map).unwrap();
    let gap = uv.iter().zip(flattener.flatten().unwrap()).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
    assert!(gap < 1e-10, "{gap}");
    // On this coarse sheet the curve of the new angles misses closing by little.
    assert!(ratios(&flattener, &map, &uv).iter().all(|it| (it - 1.0).abs() < 2e-3));
    // On a developable one it closes.
    let mesh = shapes::cylinder(30.0, 40.0, 24, 3);
    let seam = mesh.edges().filter(|&e| {
        mesh.edge_vertices(e).iter().all(|&v| {
            let p = mesh.position(v);
            p.y.abs() < 1e-9 && p.x > 0.0
        })
    });
    let seam: Vec<EdgeId> = seam.collect();
    let metric = Metric::new(&mesh);
    let chart = ChartBuilder::new(&mesh).chart(mesh.faces().collect(), &|e| seam.contains(&e));
    let flattener = Flattener::new(&metric, &chart).unwrap();
    let map = flattener.with_log_factor(&vec![0.0; chart.vertex_count()], &[]);
    let uv = flattener.lay_out(&map).unwrap();
    assert!(ratios(&flattener, &map, &uv).iter().all(|it| (it - 1.0).abs() < 1e-9));
}

#[test]
fn lengths_asked_for_come_out() {
    let mesh = sheet();
    let (metric, chart) = whole(&mesh);
    let flattener = Flattener::new(&metric, &chart).unwrap();
    let before = flattener.flatten().unwrap();
    let scaled = |factor: &dyn Fn(f64) -> f64| -> Vec<f64> {
        let n = chart.loops[0].len() as f64;
        flattener.chart.boundary_edges().enumerate().map(|(k, it)| metric.length[it.0] * factor(k as f64 / n)).collect()
    };
    // All by one factor: the same layout at another size.
    let map = flattener.with_lengths(&scaled(&|_| 0.9), &[]);
    let uv = flattener.lay_out(&map).unwrap();
    assert!(uv.iter().zip(&before).all(|(a, b)| (a - b * 0.9).norm() < 1e-9));
    // By a smooth one: as far as a curve with the angles that follow closes.
    let map = flattener.with_lengths(&scaled(&|t| (0.1 * (TAU * t).sin()).exp()), &[]);
    let uv = flattener.lay_out(&map).unwrap();
    let off = ratios(&flattener, &map, &uv).iter().map(|it| (it - 1.0).abs()).fold(0.0, f64::max);
    assert!(off < 3e-3, "{off}");
    let angles = map.exterior.iter().sum::<f64>();
    assert!((angles - TAU).abs() < 1e-9, "{angles}");
}

#[test]
fn angles_asked_for_come_out() {
    let mesh = sheet();
    let (metric, chart) = whole(&mesh);
    let flattener = Flattener::new(&metric, &chart).unwrap();
    // A rectangle: right angles at the corners of the sheet, straight in between.
    let mut asked = vec![0.0; chart.vertex_count()];
    let mut corners: Vec<(f64, u32)> =
        flattener.exterior_angles().iter().zip(0..).map(|(&angle, v)| (angle, v)).collect();
    corners.sort_by(|a, b| b.0.total_cmp(&a.0));
    corners[..4].iter().for_each(|&(_, v)| asked[v as usize] = FRAC_PI_2);
    let map = flattener.with_exterior_angles(&asked, &[]).unwrap();
    let uv = flattener.lay_out(&map).unwrap();
    for (v, angle) in measured(&chart, &uv) {
        assert!((angle - asked[v as usize]).abs() < 1e-9, "{v}: {angle}");
    }
    // The log factor that it found has these angles.
    let again = flattener.with_log_factor(&map.log_factor, &[]);
    let off = again.exterior.iter().zip(&asked).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(off < 1e-10, "{off}");
    let total = |lengths: &mut dyn Iterator<Item = f64>| lengths.sum::<f64>();
    let [flat, space] = [
        total(&mut map.lengths.iter().copied()),
        total(&mut flattener.chart.boundary_edges().map(|it| metric.length[it.0])),
    ];
    assert!((flat - space).abs() < 1e-9 * space);
}

#[test]
fn log_factors_and_angles_are_inverse() {
    let mesh = sheet();
    let (metric, chart) = whole(&mesh);
    let flattener = Flattener::new(&metric, &chart).unwrap();
    let map = wavy(&flattener);
    let back = flattener.with_exterior_angles(&map.exterior, &[]).unwrap();
    let shift = back.log_factor[0] - map.log_factor[0];
    let off = back.log_factor.iter().zip(&map.log_factor).map(|(a, b)| (a - b - shift).abs()).fold(0.0, f64::max);
    assert!(off < 1e-10, "{off}");
}

#[test]
fn angles_without_the_right_sum_are_refused_with_what_is_missing() {
    let mesh = sheet();
    let (metric, chart) = whole(&mesh);
    let flattener = Flattener::new(&metric, &chart).unwrap();
    let error = flattener.with_exterior_angles(&vec![0.0; chart.vertex_count()], &[]).unwrap_err();
    assert!(matches!(error, FlattenError::GaussBonnet { given: 0.0, .. }), "{error:?}");
    assert!(error.to_string().contains("+6.283185 are missing"), "{error}");
    // A cone takes what it holds from the boundary.
    let cone = Cone { vertex: flattener.interior[40], curvature: 1.0 };
    let mut asked = flattener.exterior_angles();
    assert!(flattener.with_exterior_angles(&asked, &[cone]).is_err());
    asked.iter_mut().zip(&chart.on_boundary).for_each(|(it, rim)| {
        *it -= if *rim { 1.0 / chart.loops[0].len() as f64 } else { 0.0 };
    });
    assert!(flattener.with_exterior_angles(&asked, &[cone]).is_ok());
}

/// The chart opened along shortest paths from local vertices to the boundary.
fn opened(mesh: &TriMesh, chart: &Chart, tips: &[u32]) -> Chart {
    let weight = Field::from_fn(mesh.edge_count(), |e| mesh.edge_length(e));
    let graph = EdgeGraph::new(mesh, chart, &weight);
    let mut cut = Vec::new();
    for &tip in tips {
        let mut end = tip;
        let tree = PathTree::new(&graph, &[(tip, 0.0)], |v, _| {
            end = v;
            (!chart.on_boundary[v as usize]).then_some(true)
        });
        cut.extend(tree.path(end).into_iter().map(|h| mesh.edge(h)));
    }
    ChartBuilder::new(mesh).chart(chart.faces.clone(), &|e| cut.contains(&e))
}

#[test]
fn cones_have_the_angles_asked_for_and_slits_fit() {
    let mesh = sheet();
    let (metric, chart) = whole(&mesh);
    let flattener = Flattener::new(&metric, &chart).unwrap();
    let cones = [(30, 0.7), (100, -0.4)].map(|(k, curvature)| Cone { vertex: flattener.interior[k], curvature });
    let map = flattener.with_log_factor(&vec![0.0; chart.vertex_count()], &cones);
    let open = opened(&mesh, &chart, &cones.map(|it| it.vertex));
    let uv = flattener.lay_out_opened(&map, &open).unwrap();
    let angles = measured(&open, &uv);
    let around = |v: u32| -> f64 {
        let inner = chart.origin[v as usize];
        angles.iter().filter(|it| open.origin[it.0 as usize] == inner).map(|it| std::f64::consts::PI - it.1).sum()
    };
    // Exterior angles are measured up to full turns: a cone sharper than the plane turns by more than half a turn.
    for cone in cones {
        let found = around(cone.vertex);
        let turns = (found - (TAU - cone.curvature)) / TAU;
        assert!((turns - turns.round()).abs() < 1e-9, "{cone:?}: {found}");
    }
    // Both sides of every slit edge are equally long.
    let path = &open.loops[0];
    let n = path.len();
    let length = |i: usize| (uv[path[(i + 1) % n].1 as usize] - uv[path[i].1 as usize]).norm();
    let mut slits = 0;
    for i in 0..n {
        let Some(twin) = mesh.twin(path[i].0) else { continue };
        let j = path.iter().position(|it| it.0 == twin).unwrap();
        assert!((length(i) - length(j)).abs() < 1e-9 * length(i));
        slits += 1;
    }
    assert!(slits >= 4, "{slits}");
    // The boundary of the sheet is hardly longer or shorter than in space.
    let rim = (0..n).filter(|&i| mesh.twin(path[i].0).is_none());
    assert!(rim.map(|i| length(i) / metric.length[path[i].0]).all(|it| (it - 1.0).abs() < 0.02));
}

#[test]
fn rows_taken_out_of_the_factor_are_as_good_as_another_factorisation() {
    let mesh = sheet();
    let (metric, chart) = whole(&mesh);
    let flattener = Flattener::new(&metric, &chart).unwrap();
    let cone = Cone { vertex: flattener.interior[50], curvature: 0.3 };
    let map = flattener.with_log_factor(&vec![0.0; chart.vertex_count()], &[cone]);
    let open = opened(&mesh, &chart, &[cone.vertex]);
    let uv = flattener.lay_out_opened(&map, &open).unwrap();
    let mut again = uv.clone();
    Flattener::new(&metric, &open).unwrap().extend(&mut again);
    let off = uv.iter().zip(&again).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
    assert!(off < 1e-9, "{off}");
}

#[test]
fn the_tip_of_a_cone_keeps_all_lengths_with_its_own_curvature() {
    // The side of a pyramid: exactly a cone, nothing stretches.
    let rim = (0..12).map(|k| TAU * f64::from(k) / 12.0).map(|t| Vec3::new(20.0 * t.cos(), 20.0 * t.sin(), 0.0));
    let points: Vec<Vec3> = rim.chain([Vec3::new(0.0, 0.0, 15.0)]).collect();
    let faces: Vec<[u32; 3]> = (0..12).map(|k| [k, (k + 1) % 12, 12]).collect();
    let mesh = TriMesh::new(points, &faces).unwrap();
    let (metric, chart) = whole(&mesh);
    let flattener = Flattener::new(&metric, &chart).unwrap();
    let tip = flattener.interior[0];
    let curvature = TAU - flattener.angle_sum[tip as usize];
    let map = flattener.with_log_factor(&[0.0; 13], &[Cone { vertex: tip, curvature }]);
    assert!(map.log_factor.iter().all(|u| u.abs() < 1e-12));
    assert!(matches!(flattener.lay_out_opened(&map, &chart), Err(FlattenError::ClosedCone { .. })));
    let open = opened(&mesh, &chart, &[tip]);
    let uv = flattener.lay_out_opened(&map, &open).unwrap();
    for (h, i, j) in open.halfedges() {
        assert!(((uv[j as usize] - uv[i as usize]).norm() - metric.length[h]).abs() < 1e-9);
    }
}
