//! A band with a wavy seam around its middle, beside the elastic flow of the seam as a plane curve.
use super::{Figure, GUARDED, Report, descend, energy, minimize};
use fabricate::{
    geom::{Vec2, Vec3, cross2, polyline_length},
    mesh::TriMesh,
    numeric::optim::Objective,
};
use std::f64::consts::{PI, TAU};

pub(super) const FIGURE: Figure =
    Figure { number: 17, claim: "seams smooth themselves, almost as a plane curve does in its elastic flow", run };

/// Vertices of the seam, and rows of faces on each side of it.
const AROUND: usize = 80;
const ROWS: usize = 3;
/// Steps after which the seam is compared with the curve.
const STEPS: [usize; 4] = [10, 30, 100, 300];
/// Steps of the curve.
const ELASTIC: usize = 300;

fn run(report: &mut Report) {
    let start = band();
    report.show("start", &start);
    let mut flow = Elastic::default();
    let mut x: Vec<f64> = seam(&start).iter().flat_map(|p| [p.x, p.y]).collect();
    minimize(&mut flow, &mut x, ELASTIC);
    for name in ["covariance", "combinatorial", "intrinsic"] {
        let mut bent = bending(&seam(&start));
        let mut farthest = 0.0_f64;
        for steps in STEPS {
            let (mesh, _) = descend(&start, energy(name), GUARDED, steps);
            report.show(&format!("{name}-{steps}"), &mesh);
            let curve = seam(&mesh);
            let now = bending(&curve);
            let gap = |other: &[Vec2]| (bending(other) - now).abs();
            let same = flow.past.iter().min_by(|a, b| gap(a).total_cmp(&gap(b))).expect("the flow has a start");
            report.note(format!(
                "{name}, {steps} steps: bending {now:.2}, from the curve as bent {:.4}, from the start {:.4} of the radius",
                distance(&curve, same),
                distance(&curve, &seam(&start)),
            ));
            report.at_most(&format!("{name}, {steps} steps: bending over that before"), now / bent, 1.0);
            (bent, farthest) = (now, farthest.max(distance(&curve, same)));
        }
        report.at_most(&format!("{name}: bending at last over that of a circle"), bent / (4.0 * PI * PI), 1.1);
        report.at_most(&format!("{name}: farthest from the elastic curve, of the radius"), farthest, 0.04);
    }
}

/// Largest difference between the radii of two closed curves around their centroids, at the same angle and mean radius 1.
fn distance(a: &[Vec2], b: &[Vec2]) -> f64 {
    radii(a).iter().zip(radii(b)).map(|(p, q)| (p - q).abs()).fold(0.0, f64::max)
}

/// Radius at every degree, interpolated by the angle.
fn radii(curve: &[Vec2]) -> Vec<f64> {
    let center = curve.iter().sum::<Vec2>() / curve.len() as f64;
    let mut polar: Vec<(f64, f64)> =
        curve.iter().map(|p| p - center).map(|d| (d.y.atan2(d.x).rem_euclid(TAU), d.norm())).collect();
    polar.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mean = polar.iter().map(|it| it.1).sum::<f64>() / curve.len() as f64;
    let at = |degree: u32| {
        let angle = f64::from(degree).to_radians();
        let next = polar.partition_point(|it| it.0 <= angle);
        let (a, b) = (polar[(next + polar.len() - 1) % polar.len()], polar[next % polar.len()]);
        let share = (angle - a.0).rem_euclid(TAU) / (b.0 - a.0).rem_euclid(TAU);
        (a.1 + share * (b.1 - a.1)) / mean
    };
    (0..360).map(at).collect()
}

fn seam(mesh: &TriMesh) -> Vec<Vec2> {
    mesh.positions().as_slice()[ROWS * AROUND..][..AROUND].iter().map(|p| p.xy()).collect()
}

/// L ∫ κ² ds of a closed polygon; 4π² for a circle.
fn bending(curve: &[Vec2]) -> f64 {
    let n = curve.len();
    let edge = |i: usize| curve[(i + 1) % n] - curve[i % n];
    let turns = (0..n).map(|i| {
        let (a, b) = (edge(i), edge(i + 1));
        let turn = cross2(a, b).atan2(a.dot(&b));
        2.0 * turn * turn / (a.norm() + b.norm())
    });
    turns.sum::<f64>() * polyline_length(curve, true)
}

/// The elastic energy of a closed polygon, which remembers the way.
#[derive(Default)]
struct Elastic {
    past: Vec<Vec<Vec2>>,
}

impl Objective for Elastic {
    fn evaluate(&mut self, x: &[f64], gradient: &mut [f64]) -> f64 {
        /// Step of the differences; the curve has edges of about 0.8.
        const STEP: f64 = 1e-5;
        let mut curve: Vec<Vec2> = x.as_chunks::<2>().0.iter().map(|&p| p.into()).collect();
        if self.past.is_empty() {
            self.past.push(curve.clone());
        }
        for (i, slope) in gradient.iter_mut().enumerate() {
            let here = curve[i / 2][i % 2];
            let [after, before] = [STEP, -STEP].map(|step| {
                curve[i / 2][i % 2] = here + step;
                bending(&curve)
            });
            curve[i / 2][i % 2] = here;
            *slope = (after - before) / (2.0 * STEP);
        }
        bending(&curve)
    }

    fn accepted(&mut self, x: &[f64]) -> bool {
        self.past.push(x.as_chunks::<2>().0.iter().map(|&p| p.into()).collect());
        false
    }
}

/// Two slanted strips that meet along a wavy circle.
fn band() -> TriMesh {
    let point = |i: usize, j: usize| {
        let (angle, up) = (TAU * i as f64 / AROUND as f64, j as f64 - ROWS as f64);
        let radius = 10.0 + 1.2 * (3.0 * angle).sin() + 0.35 * (11.0 * angle).sin() - 0.8 * up.abs();
        Vec3::new(radius * angle.cos(), radius * angle.sin(), 0.8 * up)
    };
    let points = (0..=2 * ROWS).flat_map(|j| (0..AROUND).map(move |i| point(i, j))).collect();
    let id = |i: usize, j: usize| (j * AROUND + i % AROUND) as u32;
    let mut faces = Vec::new();
    for (i, j) in (0..AROUND * 2 * ROWS).map(|k| (k % AROUND, k / AROUND)) {
        let [a, b, c, d] = [id(i, j), id(i + 1, j), id(i + 1, j + 1), id(i, j + 1)];
        // Mirrored, so that neither direction along the seam is preferred.
        faces.extend(if j < ROWS { [[a, b, c], [a, c, d]] } else { [[a, b, d], [b, c, d]] });
    }
    TriMesh::new(points, &faces).expect("a band is a mesh")
}
