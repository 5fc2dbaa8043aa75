//! Derivatives against central differences; what is known of single creases and of rigid faces.
use super::{
    Options, Resolution, fold,
    motion::{Motion, Pull},
    net::{Grid, Net},
    solve,
    terms::{Dihedral, FoldPoint, angle_values, angles},
};
use crate::{
    geom::{
        Vec2, Vec3,
        arrangement::{Arc, Arrangement, Curve},
    },
    mesh::{TriMesh, paper},
    model::{BORDER, Crease, CreasePattern, MOUNTAIN, UNASSIGNED, VALLEY},
    numeric::Monitor,
};

/// A 10 × 10 sheet with one circular crease of the given radius around (5, −r + 4).
fn arc_sheet(radius: f64) -> Net {
    let corner = |x, y| Vec2::new(x, y);
    let border = vec![corner(0.0, 0.0), corner(10.0, 0.0), corner(10.0, 10.0), corner(0.0, 10.0)];
    let crease = (0..=200)
        .map(|k| {
            let x = 10.0 * f64::from(k) / 200.0;
            Vec2::new(x, 5.37 - radius + (radius * radius - (x - 5.0).powi(2)).sqrt())
        })
        .collect();
    let curves = [
        Curve { points: border, closed: true, kind: BORDER },
        Curve { points: crease, closed: false, kind: UNASSIGNED },
    ];
    let pattern = CreasePattern::new(&Arrangement::new(&curves, 1e-3, &|_| true).unwrap());
    let grid = Grid::over(&pattern, 1.0);
    Net::new(&pattern, grid)
}

fn bent(net: &Net) -> Vec<Vec3> {
    let bend = |p: &Vec3| {
        let z = 0.3 * (0.4 * p.x).sin() + 0.02 * p.y * p.y + 0.1 * (p.x * p.y).cos();
        Vec3::new(p.x + 0.05 * p.y.sin(), p.y - 0.04 * (p.x * 1.3).cos(), z)
    };
    net.flat.iter().enumerate().map(|(v, p)| bent_copy(bend(p), net.patch[v])).collect()
}

/// The copies of a vertex in two patches are moved apart a little, and turned against each other.
fn bent_copy(p: Vec3, patch: u32) -> Vec3 {
    p + Vec3::new(0.03, -0.02, 0.05 + 0.2 * (p.y - 5.0)) * f64::from(patch)
}

/// Largest difference between `gradient` and central differences of `value` over some coordinates of `x`.
fn error(x: &[Vec3], vertices: &[u32], gradient: &dyn Fn(u32) -> Vec3, value: &dyn Fn(&[Vec3]) -> f64) -> f64 {
    let step = 1e-5;
    let mut worst = 0.0_f64;
    for &v in vertices {
        for p in 0..3 {
            let [up, down] = [step, -step].map(|step| {
                let mut moved = x.to_vec();
                moved[v as usize][p] += step;
                value(&moved)
            });
            worst = worst.max((gradient(v)[p] - (up - down) / (2.0 * step)).abs());
        }
    }
    worst
}

#[test]
fn derivatives_agree_with_differences() {
    let net = arc_sheet(9.0);
    let x = bent(&net);
    for star in net.stars.iter().step_by(5) {
        let it = angles(star, &x);
        let vertices: Vec<u32> = std::iter::once(star.centre).chain(star.around.iter().copied()).collect();
        for k in 0..it.count {
            let of = |v: u32| it.gradients[k][vertices.iter().position(|&u| u == v).unwrap()];
            assert!((it.values[k] - angle_values(star, &x)[k]).abs() < 1e-15);
            let worst = error(&x, &vertices, &of, &|x| angle_values(star, x)[k]);
            assert!(worst < 1e-8, "{star:?} {k}: {worst}");
        }
    }
    let folds = FoldPoint::all(&net);
    assert!(folds.len() > 8, "{}", folds.len());
    for (k, it) in folds.iter().enumerate() {
        // Two of the twelve may be the same vertex.
        let sum =
            |g: &[Vec3], v: u32| -> Vec3 { it.vertices.iter().zip(g).filter(|it| *it.0 == v).map(|it| it.1).sum() };
        let (_, g) = it.gradient(&x, 3.0);
        let worst = error(&x, &it.vertices, &|v| sum(&g, v), &|x| it.value(x, 3.0));
        assert!(worst < 1e-7, "fold {k}: {worst}");
        let (_, g) = it.wrong_side(&x, 0.7, -1.0);
        let worst = error(&x, &it.vertices, &|v| sum(&g, v), &|x| it.wrong_side(x, 0.7, -1.0).0);
        assert!(worst < 1e-7, "side {k}: {worst}");
        // A mountain is what the angle says it is.
        let angle = it.angle(&x, net.points[it.point].leftward);
        assert_eq!(it.mountain(&x).0 > 0.0, angle > 0.0, "{k}: {angle}");
        let target = Dihedral::new(&folds, k, &net.flat, 1.0);
        let (_, g) = target.gradient(&folds, &x);
        let worst = error(&x, &it.vertices, &|v| sum(&g, v), &|x| target.gradient(&folds, x).0);
        assert!(worst < 1e-7, "dihedral {k}: {worst}");
    }
}

const SOLVER: solve::Options =
    solve::Options { least_fold: 0.3, frames: 15, iterations_per_frame: 4, settle: 120, ..solve::Options::PAPER };

/// A pattern of a rectangle from (0, 0) and creases, with its paper.
fn sheet(size: [f64; 2], creases: Vec<Curve>) -> (CreasePattern, TriMesh) {
    let corner = |x, y| Vec2::new(x, y);
    let border = vec![corner(0.0, 0.0), corner(size[0], 0.0), corner(size[0], size[1]), corner(0.0, size[1])];
    let mut curves = vec![Curve { points: border, closed: true, kind: BORDER }];
    curves.extend(creases);
    let divided = Arrangement::new(&curves, 1e-6, &|it| it != BORDER).unwrap();
    let arc = |it: &Arc| Curve { points: it.points.clone(), closed: it.ends.is_none(), kind: it.kind };
    let arcs: Vec<Curve> = divided.arcs.iter().map(arc).collect();
    (CreasePattern::new(&divided), paper(&arcs, BORDER, size[0] / 20.0).unwrap())
}

fn options(resolution: Resolution, pulls: Vec<Pull>) -> Options {
    Options { resolution, pulls, sides: Vec::new(), kept_frames: 1, solver: SOLVER, handle_limit: 0.01 }
}

#[test]
fn a_circular_crease_bends_as_it_folds() {
    // κ_g = κ cos(θ / 2): the crease keeps its geodesic curvature, 1 / R, so it must bend more in space the more it is folded.
    let radius = 150.0_f64;
    let points = (0..=400).map(|k| {
        let x = f64::from(k) * 0.5;
        Vec2::new(x, 118.0 - radius + (radius * radius - (x - 100.0).powi(2)).sqrt())
    });
    let crease = Curve { points: points.collect(), closed: false, kind: UNASSIGNED };
    let (pattern, paper) = sheet([200.0, 200.0], vec![crease]);
    let pulls = Motion::LiftCorners.pulls(&pattern, 1.0);
    let folded = fold(&pattern, &paper, &options(Resolution::Vertices(500), pulls), &Monitor::silent()).unwrap();
    let figures = &folded.figures;
    assert!(
        figures.mean_fold.to_degrees() > 30.0 && figures.folded == figures.crease_points - figures.excluded,
        "{figures:?}"
    );
    let samples = &folded.creases[0].samples;
    let mut found: Vec<f64> = Vec::new();
    // Over wide steps, as samples lie unevenly.
    for k in 3..samples.len() - 3 {
        let [a, b, c] = [samples[k - 3].place, samples[k].place, samples[k + 3].place];
        let curvature = 2.0 * (b - a).cross(&(c - b)).norm() / ((b - a).norm() * (c - b).norm() * (c - a).norm());
        found.push(curvature * (0.5 * samples[k].angle).cos() * radius);
    }
    found.sort_by(f64::total_cmp);
    let median = found[found.len() / 2];
    assert!((median - 1.0).abs() < 0.03, "{median} of {found:?}");
    // Without the angle it would be wrong by far more: θ / 2 is some 20 degrees.
    assert!((0.5 * figures.mean_fold).cos() < 0.95, "{figures:?}");
}

#[test]
fn a_miura_vertex_folds_as_rigid_faces_do() {
    // Two straight creases with two others at ±α to the first of them. For rigid faces opposite creases fold by equal angles,
    // and tan(ρ_straight / 2) = cos α tan(ρ_leaning / 2) (Tachi 2009, "Generalization of rigid-foldable quadrilateral-mesh
    // origami"). Stiff paper whose leaning creases are all folded by 60° bends nowhere else.
    let alpha = 60.0_f64.to_radians();
    let (size, middle) = (120.0, Vec2::new(60.0, 60.0));
    let lean = 60.0 / alpha.tan();
    let ends = [0.0, size].map(|y| Vec2::new(60.0 + lean, y));
    let line = |a: Vec2, kind| Curve { points: vec![a, middle], closed: false, kind };
    let creases = vec![
        line(Vec2::new(0.0, 60.0), VALLEY),
        line(Vec2::new(size, 60.0), MOUNTAIN),
        line(ends[0], VALLEY),
        line(ends[1], VALLEY),
    ];
    let (pattern, paper) = sheet([size, size], creases);
    let angle = 60.0_f64.to_radians();
    let places = (1..12).flat_map(|k| ends.map(|end| end.lerp(&middle, f64::from(k) / 12.0)));
    let pulls = places.map(|at| Pull::Angle { at, angle }).collect();
    let solver = solve::Options { bending: 100.0, least_fold: 0.09, settle: 250, ..SOLVER };
    let sides = pattern.creases.iter().map(Crease::drawn_side).collect();
    let options = Options { sides, solver, ..options(Resolution::Edge(7.0), pulls) };
    let folded = fold(&pattern, &paper, &options, &Monitor::silent()).unwrap();
    let straight = 2.0 * (alpha.cos() * (0.5 * angle).tan()).atan();
    for (crease, expected) in folded.creases.iter().zip([-straight, straight, -angle, -angle]) {
        assert!(crease.samples.len() > 5);
        assert!(crease.samples.iter().all(|it| (it.angle - expected).abs() < 1e-6), "{expected}: {:?}", crease.samples);
    }
    assert!(folded.figures.stretch_max < 1e-6 && folded.figures.continuity_max < 1e-6, "{:?}", folded.figures);
}
