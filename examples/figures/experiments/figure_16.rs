//! A noisy cube, all of whose corners have valence 3.
use super::{
    FREE, Figure, Flow, Report, at, coordinates, descend, energy,
    measures::{rms, tilts, total},
    minimize, noisy,
};
use fabricate::{
    geom::Vec3,
    mesh::{Id, TriMesh, VertexId},
    numeric::{optim::Objective, symmetric3::jacobi},
    stages::develop::{
        Evaluator,
        energy::{COVARIANCE, ENERGIES},
    },
};
use std::collections::BTreeMap;

pub(super) const FIGURE: Figure = Figure {
    number: 16,
    claim: "vertices of valence 3 must be flat to be hinges, which rounds corners; left free, a noisy cube becomes a cube",
    run,
};

/// Squares along an edge of the cube.
const CELLS: i32 = 6;
/// Noise in edges.
const NOISE: f64 = 0.12;
const STEPS: usize = 300;

fn run(report: &mut Report) {
    let clean = cube();
    let corners: Vec<VertexId> = clean.vertices().filter(|&v| clean.face_degree(v) == 3).collect();
    let start = noisy(&clean, NOISE, 16);
    report.show("noisy", &start);
    report.note(format!(
        "noisy: normals off by {:.2}°, covariance {:.2}",
        rms(&tilts(&start, &clean)),
        total(&start, &COVARIANCE)
    ));
    let sharpness = |mesh: &TriMesh| corners.iter().map(|&v| mesh.angle_defect(v)).fold(f64::INFINITY, f64::min);
    for energy in ENERGIES {
        let (mesh, outcome) = descend(&start, energy, FREE, STEPS);
        report.show(energy.name, &mesh);
        report.at_most(&format!("{}: energy left", energy.name), outcome.value, 1e-4);
        report.at_most(&format!("{}: normals off, degrees", energy.name), rms(&tilts(&mesh, &clean)), 1.0);
        report.at_least(&format!("{}: bluntest corner, over π/2", energy.name), sharpness(&mesh) / QUARTER, 0.95);
    }

    let unit = 1.0 / start.mean_edge_length();
    let mut x: Vec<f64> = coordinates(&start).iter().map(|it| it * unit).collect();
    let flow = Flow(Evaluator::new(&start, energy("covariance"), FREE));
    let mut all = WithCorners { flow, stars: corners.iter().map(|&v| star(&start, v)).collect() };
    minimize(&mut all, &mut x, STEPS);
    x.iter_mut().for_each(|it| *it /= unit);
    let rounded = at(&start, &x);
    report.show("corners-not-free", &rounded);
    // Normals of a cube's corner are as far from a plane as from a line, so a corner may also end as a needle, which the figure
    // does not say: its normals are coplanar as well.
    let sharpness: Vec<f64> = corners.iter().map(|&v| rounded.angle_defect(v) / QUARTER).collect();
    report.note(format!("corners not free: angle defects over π/2: {sharpness:.2?}"));
    let count = |from: f64, to: f64| sharpness.iter().filter(|&&it| from <= it && it < to).count() as f64;
    report.at_most("corners not free: corners left", count(0.2, 2.0), 0.0);
    report.at_least("corners not free: flattened", count(-0.1, 0.2), 4.0);
}

const QUARTER: f64 = std::f64::consts::FRAC_PI_2;

/// A vertex and its three neighbours, counter-clockwise.
fn star(mesh: &TriMesh, v: VertexId) -> [usize; 4] {
    let mut out = [v.index(); 4];
    for (it, neighbor) in out[1..].iter_mut().zip(mesh.neighbors(v)) {
        *it = neighbor.index();
    }
    out
}

/// The covariance energy with the vertices of valence 3 that [`Evaluator`] leaves out.
struct WithCorners {
    flow: Flow,
    stars: Vec<[usize; 4]>,
}

impl Objective for WithCorners {
    fn evaluate(&mut self, x: &[f64], gradient: &mut [f64]) -> f64 {
        /// Step of the differences, in edges.
        const STEP: f64 = 1e-6;
        let mut sum = self.flow.evaluate(x, gradient);
        for star in &self.stars {
            let mut points = star.map(|v| Vec3::new(x[3 * v], x[3 * v + 1], x[3 * v + 2]));
            sum += covariance(&points);
            for (k, &v) in star.iter().enumerate() {
                for c in 0..3 {
                    let here = points[k][c];
                    let [after, before] = [STEP, -STEP].map(|step| {
                        points[k][c] = here + step;
                        covariance(&points)
                    });
                    points[k][c] = here;
                    gradient[3 * v + c] += (after - before) / (2.0 * STEP);
                }
            }
        }
        sum
    }
}

/// λ of a star of three faces.
fn covariance([center, rim @ ..]: &[Vec3; 4]) -> f64 {
    let mut matrix = [[0.0; 3]; 3];
    for k in 0..3 {
        let (a, b) = (rim[k] - center, rim[(k + 1) % 3] - center);
        let cross = a.cross(&b);
        let (angle, normal) = (cross.norm().atan2(a.dot(&b)), cross.normalize());
        for (i, j) in (0..9).map(|it| (it / 3, it % 3)) {
            matrix[i][j] += angle * normal[i] * normal[j];
        }
    }
    jacobi(matrix).0.into_iter().fold(f64::INFINITY, f64::min)
}

/// A cube whose squares at the corners are split away from them.
fn cube() -> TriMesh {
    let mut ids = BTreeMap::new();
    let mut points = Vec::new();
    let mut faces = Vec::new();
    for (axis, side) in [(0, 0), (0, CELLS), (1, 0), (1, CELLS), (2, 0), (2, CELLS)] {
        for (i, j) in (0..CELLS * CELLS).map(|k| (k % CELLS, k / CELLS)) {
            let quad = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)].map(|(u, v)| {
                let mut at = [0; 3];
                (at[axis], at[(axis + 1) % 3], at[(axis + 2) % 3]) = (side, u, v);
                *ids.entry(at).or_insert_with(|| {
                    points.push(Vec3::from(at.map(f64::from)));
                    points.len() as u32 - 1
                })
            });
            let [a, b, c, d] = quad;
            let corner = (i == 0 || i == CELLS - 1) && (j == 0 || j == CELLS - 1);
            // The diagonal from a to c would end at this corner.
            let away = corner && (i == 0) == (j == 0);
            let two = if away { [[a, b, d], [b, c, d]] } else { [[a, b, c], [a, c, d]] };
            faces.extend(two.map(|[p, q, r]| if side == 0 { [p, r, q] } else { [p, q, r] }));
        }
    }
    TriMesh::new(points, &faces).expect("a cube is a mesh")
}
