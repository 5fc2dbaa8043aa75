//! Laws that every energy of the list obeys, and each energy against its definition, spelled out.
use super::{COMPARISONS, Corner, ENERGIES, Energy, Pull, Work, covariance};
use crate::{
    geom::{Vec3, angle_between},
    mesh::{Id, TriMesh, VertexId, shapes},
    numeric::{
        lanes::{Lanes, Lanes3},
        symmetric3::jacobi,
    },
    stages::develop::{Evaluator, Weights},
};
use std::f64::consts::TAU;

/// Numbers in [−1, 1) that look random.
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }

    fn vector(&mut self) -> Vec3 {
        Vec3::new(self.next(), self.next(), self.next())
    }

    fn shake(&mut self, mut mesh: TriMesh, size: f64) -> TriMesh {
        mesh.positions_mut().as_mut_slice().iter_mut().for_each(|p| *p += size * self.vector());
        mesh
    }
}

/// A patch or, wrapped, a tube or a torus of `n` × `m` quads, split along alternating diagonals where `mixed`, so that the
/// valence varies.
fn lattice([n, m]: [usize; 2], wrap: [bool; 2], mixed: bool, point: impl Fn(f64, f64) -> Vec3) -> TriMesh {
    let (width, height) = (n + usize::from(!wrap[0]), m + usize::from(!wrap[1]));
    let points = (0..width * height).map(|i| point((i % width) as f64, (i / width) as f64)).collect();
    let id = |i: usize, j: usize| (j % height * width + i % width) as u32;
    let mut faces = Vec::new();
    for (i, j) in (0..n * m).map(|k| (k % n, k / n)) {
        let [a, b, c, d] = [id(i, j), id(i + 1, j), id(i + 1, j + 1), id(i, j + 1)];
        if mixed && (i * i + 3 * j + i * j) % 3 == 0 {
            faces.extend([[a, b, d], [b, c, d]]);
        } else {
            faces.extend([[a, b, c], [a, c, d]]);
        }
    }
    TriMesh::new(points, &faces).unwrap()
}

/// A star of `n` faces around one vertex, its rim at heights `rise` · (−1, 1).
fn fan(n: usize, rise: f64, noise: &mut Noise) -> TriMesh {
    let mut points = vec![Vec3::new(0.0, 0.0, 0.7 * rise)];
    points.extend((0..n).map(|i| {
        let angle = TAU * i as f64 / n as f64;
        Vec3::new(angle.cos(), angle.sin(), rise * noise.next())
    }));
    let faces: Vec<[u32; 3]> = (0..n as u32).map(|i| [0, i + 1, (i + 1) % n as u32 + 1]).collect();
    TriMesh::new(points, &faces).unwrap()
}

fn bumpy_torus() -> TriMesh {
    let torus = lattice([14, 9], [true, true], true, |i, j| {
        let (a, b) = (TAU * i / 14.0, TAU * j / 9.0);
        Vec3::new((3.0 + b.cos()) * a.cos(), (3.0 + b.cos()) * a.sin(), b.sin())
    });
    Noise(1).shake(torus, 0.15)
}

fn wavy_sheet() -> TriMesh {
    let sheet = lattice([10, 8], [false, false], true, |i, j| Vec3::new(i, j, (0.7 * i).sin() + 0.4 * (0.9 * j).cos()));
    Noise(2).shake(sheet, 0.05)
}

fn nearly_flat_sheet() -> TriMesh {
    Noise(3).shake(lattice([7, 7], [false, false], true, |i, j| Vec3::new(i, j, 0.0)), 1e-3)
}

/// Meshes without symmetry, and the step for differences in mean edges.
fn fixtures() -> Vec<(&'static str, TriMesh, f64)> {
    let mut noise = Noise(4);
    vec![
        ("bumpy torus", bumpy_torus(), 5e-5),
        ("wavy sheet", wavy_sheet(), 5e-5),
        ("nearly flat sheet", nearly_flat_sheet(), 2e-6),
        ("noisy cylinder", Noise(5).shake(cylinder(), 0.02), 2e-5),
        ("fan of 4", fan(4, 0.5, &mut noise), 1e-4),
        ("fan of 11", fan(11, 0.3, &mut noise), 1e-4),
        ("fan of 17", fan(17, 0.2, &mut noise), 1e-4),
        ("fan of 40", fan(40, 0.05, &mut noise), 1e-5),
    ]
}

fn cylinder() -> TriMesh {
    shapes::cylinder(2.0, 6.0, 13, 6)
}

/// Exactly developable meshes with all creases along rulings.
fn developables() -> Vec<(&'static str, TriMesh)> {
    let flat = lattice([6, 6], [false, false], true, |i, j| Vec3::new(i, j, 0.5 * i - 0.3 * j));
    let ridge = lattice([6, 6], [false, false], false, |i, j| Vec3::new(i, j, 0.9 * (i - 3.0).abs()));
    let pleat = lattice([9, 5], [false, false], false, |i, j| Vec3::new(i, j, if i % 2.0 == 0.0 { 0.0 } else { 1.3 }));
    vec![
        ("cylinder", cylinder()),
        ("cone", shapes::cone_frustum(1.0, 6.0, 4.0, 16, 5)),
        ("tangent developable", shapes::tangent_developable(1.0, 0.6, 0.4, [1.0, 4.0], 12, 6)),
        ("flat", flat),
        ("ridge", ridge),
        ("pleats", pleat),
    ]
}

fn coordinates(mesh: &TriMesh) -> Vec<f64> {
    mesh.positions().iter().flat_map(|p| [p.x, p.y, p.z]).collect()
}

/// Energy, its gradient, and its part of each vertex.
fn evaluate(mesh: &TriMesh, energy: &'static Energy, x: &[f64]) -> (f64, Vec<f64>, Vec<f64>) {
    let mut evaluator = Evaluator::new(mesh, energy, Weights::default());
    let mut gradient = vec![0.0; x.len()];
    let parts = evaluator.evaluate(x, &mut gradient);
    (parts.energy, gradient, evaluator.energies())
}

fn norm(v: &[f64]) -> f64 {
    v.iter().map(|c| c * c).sum::<f64>().sqrt()
}

/// Derivatives along one coordinate by central differences of fourth order, with two step sizes, summed star by star so
/// that stars that do not move cancel exactly.
fn difference(evaluator: &mut Evaluator, x: &mut [f64], at: usize, h: f64) -> [f64; 2] {
    let mut unused = vec![0.0; x.len()];
    let here = x[at];
    let mut slope = |step: f64| {
        let [after, before] = [step, -step].map(|t| {
            x[at] = here + t;
            evaluator.evaluate(x, &mut unused);
            evaluator.energies()
        });
        x[at] = here;
        after.iter().zip(&before).map(|(a, b)| a - b).sum::<f64>() / (2.0 * step)
    };
    let [wide, middle, narrow] = [h, 0.5 * h, 0.25 * h].map(&mut slope);
    [(4.0 * middle - wide) / 3.0, (4.0 * narrow - middle) / 3.0]
}

/// Holds the gradient against differences at every coordinate. Coordinates on a kink, recognised by the energy alone (two
/// step sizes disagree), are perturbed together with all others and tried again. Returns the relative error over all
/// coordinates and the number of those perturbed.
fn compare(mesh: &TriMesh, energy: &'static Energy, step: f64) -> (f64, usize) {
    const ROUNDS: usize = 6;
    let h = step * mesh.mean_edge_length();
    let mut open: Vec<usize> = (0..3 * mesh.vertex_count()).collect();
    let (mut noise, mut mesh) = (Noise(6), mesh.clone());
    let (mut wrong, mut right, mut perturbed) = (0.0, 0.0, 0);
    for _ in 0..ROUNDS {
        let mut x = coordinates(&mesh);
        let (_, gradient, _) = evaluate(&mesh, energy, &x);
        let scale = norm(&gradient) / (x.len() as f64).sqrt();
        let mut evaluator = Evaluator::new(&mesh, energy, Weights::default());
        open.retain(|&at| {
            let [a, b] = difference(&mut evaluator, &mut x, at, h);
            let kink = (a - b).abs() > 1e-6 * (scale + a.abs());
            if !kink {
                wrong += (b - gradient[at]) * (b - gradient[at]);
                right += gradient[at] * gradient[at];
            }
            kink
        });
        perturbed += open.len();
        mesh = noise.shake(mesh, 30.0 * h);
    }
    assert!(open.is_empty(), "{energy:?}: coordinates {open:?} stay on kinks");
    ((wrong / right).sqrt(), perturbed)
}

#[test]
fn gradients_are_those_of_the_values() {
    for energy in ENERGIES {
        for (name, mesh, step) in fixtures() {
            let (error, perturbed) = compare(&mesh, energy, step);
            let share = perturbed as f64 / (3 * mesh.vertex_count()) as f64;
            assert!(error <= 1e-7, "{energy:?}, {name}: {error:e}");
            assert!(share <= 0.1, "{energy:?}, {name}: {share} of the coordinates on kinks");
        }
    }
}

#[test]
fn comparisons_have_gradients_too() {
    for energy in COMPARISONS {
        let (error, _) = compare(&bumpy_torus(), energy, 5e-5);
        assert!(error <= 1e-7, "{energy:?}: {error:e}");
    }
}

#[test]
fn symmetric_stars_are_ties_with_finite_gradients() {
    for energy in ENERGIES {
        for n in [4, 6, 12, 20] {
            let mut mesh = fan(n, 0.0, &mut Noise(7));
            mesh.positions_mut().as_mut_slice()[0].z = 0.6;
            let (value, gradient, _) = evaluate(&mesh, energy, &coordinates(&mesh));
            assert!(value > 0.01 && norm(&gradient) > 0.01 && norm(&gradient).is_finite(), "{energy:?} {n}: {value}");
            // Ties do not show in the value: any slight perturbation hardly changes it.
            let near = Noise(8).shake(mesh.clone(), 1e-9);
            let (moved, _, _) = evaluate(&mesh, energy, &coordinates(&near));
            assert!((moved - value).abs() < 1e-7, "{energy:?} {n}: {value} {moved}");
        }
    }
}

#[test]
fn developable_meshes_have_no_energy() {
    for energy in ENERGIES {
        for (name, mesh) in developables() {
            // Turned, positions are rounded, and flat strips hardly say where u points.
            let turned = turned(&mesh, 1.0, Vec3::zeros());
            for (mesh, most, steepest) in [(mesh, 1e-26, 1e-12), (turned, 1e-21, 1e-10)] {
                let (value, gradient, _) = evaluate(&mesh, energy, &coordinates(&mesh));
                assert!(value <= most, "{energy:?}, {name}: {value:e}");
                assert!(norm(&gradient) <= steepest, "{energy:?}, {name}: {:e}", norm(&gradient));
            }
        }
    }
}

/// Turned, scaled and shifted.
fn turned(mesh: &TriMesh, scale: f64, shift: Vec3) -> TriMesh {
    let mut mesh = mesh.clone();
    mesh.positions_mut().as_mut_slice().iter_mut().for_each(|p| *p = turn() * *p * scale + shift);
    mesh
}

fn turn() -> nalgebra::Rotation3<f64> {
    nalgebra::Rotation3::from_euler_angles(0.3, -1.1, 2.0)
}

#[test]
fn energies_do_not_depend_on_place_or_scale() {
    const SCALE: f64 = 7.5;
    for energy in ENERGIES.iter().chain(COMPARISONS) {
        for (name, mesh, _) in fixtures() {
            let image = turned(&mesh, SCALE, Vec3::new(3.0, -20.0, 11.0));
            let [(a, g, _), (b, k, _)] = [&mesh, &image].map(|it| evaluate(it, energy, &coordinates(it)));
            // Heights of the nearly flat sheet are a thousandth of its edges, so that much less of their digits is kept.
            let rounding = if name == "nearly flat sheet" { 1e-9 } else { 1e-12 };
            assert!((a - b).abs() <= rounding * a, "{energy:?}, {name}: {a:e} {b:e}");
            let pairs = g.as_chunks::<3>().0.iter().zip(k.as_chunks::<3>().0);
            let errors: Vec<f64> =
                pairs.map(|(g, k)| (turn() * Vec3::from(*g) / SCALE - Vec3::from(*k)).norm()).collect();
            assert!(norm(&errors) <= 1e3 * rounding * norm(&k), "{energy:?}, {name}: {:e}", norm(&errors) / norm(&k));
        }
    }
}

/// Two pairs of faces that lean by `slopes` (tangents) towards ±x and ±y, with such angles that A = Σ θ N Nᵀ has the
/// eigenvalues λ1 along x and λ2 = (1 + gap) λ1 along y.
fn cross(slopes: [f64; 2], gap: f64) -> ([Vec3; 4], [f64; 4]) {
    let normal = |x: f64, y: f64| Vec3::new(x, y, 1.0).normalize();
    let [p, q] = slopes;
    let normals = [normal(p, 0.0), normal(0.0, q), normal(-p, 0.0), normal(0.0, -q)];
    let first = 0.5 * p.hypot(1.0).powi(2) / (p * p);
    let second = 0.5 * (1.0 + gap) * q.hypot(1.0).powi(2) / (q * q);
    (normals, [first, second, first, second])
}

#[test]
fn eigenvalues_and_eigenvectors_are_right_near_repeated_eigenvalues() {
    for slopes in [[0.4, 0.7], [0.9, 0.2], [1e-2, 3e-2], [1e-4, 1e-4], [1.0, 1.2]] {
        for exponent in 0..15 {
            let gap = 10.0_f64.powi(-exponent);
            let (normals, angles) = cross(slopes, gap);
            // λ1 = 1 by construction, up to the rounding of the normals, which is relative to the slope.
            let corners: Vec<Corner> = (0..4)
                .map(|k| {
                    let n = turn() * normals[k];
                    let normal = Lanes3::from_fn(|_| [n.x, n.y, n.z]);
                    Corner { normal, angle: Lanes::splat(angles[k]), area2: Lanes::splat(1.0) }
                })
                .collect();
            let mut pulls = vec![Pull::default(); 4];
            let lambda = covariance::star(&corners, &mut pulls, &mut Work::new(&ENERGIES[0], 4)).0[0];
            let rounding = 1e-15 / slopes[0].min(slopes[1]);
            assert!((lambda - 1.0).abs() <= 8.0 * rounding, "{slopes:?} {gap:e}: {lambda}");
            let u = Vec3::from(covariance::ruling(&corners).lane(0));
            let off = u.cross(&(turn() * Vec3::x())).norm();
            assert!((u.norm() - 1.0).abs() <= 1e-14, "{slopes:?} {gap:e}");
            assert!(off <= 20.0 * rounding / gap, "{slopes:?} {gap:e}: {off:e} {:e}", rounding / gap);
        }
    }
}

#[test]
fn numbers_that_are_none_spread_to_the_energy() {
    for energy in ENERGIES.iter().chain(COMPARISONS) {
        for (name, mesh, _) in fixtures() {
            let mut x = coordinates(&mesh);
            let inner = mesh.vertices().find(|&v| !mesh.is_boundary_vertex(v) && mesh.face_degree(v) > 3).unwrap();
            x[3 * inner.index()] = f64::NAN;
            assert!(evaluate(&mesh, energy, &x).0.is_nan(), "{energy:?}, {name}");
        }
    }
}

#[test]
fn energies_do_not_depend_on_the_number_of_threads() {
    let mesh = shapes::torus(3.0, 1.0, 70, 40);
    let mesh = Noise(9).shake(mesh, 0.01);
    for energy in ENERGIES {
        let run = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| evaluate(&mesh, energy, &coordinates(&mesh)))
        };
        assert_eq!(run(1), run(2), "{energy:?}");
    }
}

#[test]
fn energies_are_as_defined() {
    for (name, mesh, _) in fixtures() {
        let stars: Vec<VertexId> =
            mesh.vertices().filter(|&v| !mesh.is_boundary_vertex(v) && mesh.face_degree(v) > 3).collect();
        for energy in ENERGIES {
            let (_, _, values) = evaluate(&mesh, energy, &coordinates(&mesh));
            for &v in &stars {
                let (exact, value) = (Star::new(&mesh, v).energy(energy.name), values[v.index()]);
                assert!((value - exact).abs() <= 1e-9 * exact + 1e-15, "{energy:?}, {name}, {v}: {value:e} {exact:e}");
            }
        }
    }
}

/// The energies once more, as plainly as SGC define them.
struct Star {
    normals: Vec<Vec3>,
    angles: Vec<f64>,
    areas: Vec<f64>,
}

impl Star {
    fn new(mesh: &TriMesh, v: VertexId) -> Self {
        let faces: Vec<_> = mesh.outgoing(v).map(|h| mesh.face(h)).collect();
        Self {
            normals: faces.iter().map(|&f| mesh.normal(f)).collect(),
            angles: mesh.outgoing(v).map(|h| mesh.corner_angle(h)).collect(),
            areas: faces.iter().map(|&f| mesh.area(f)).collect(),
        }
    }

    fn energy(&self, name: &str) -> f64 {
        match name {
            "covariance" => self.covariance(),
            "covariance-max" => self.covariance_max(),
            "combinatorial" => self.best_partition(
                |side| {
                    let pairs = pairs(side).map(|(a, b)| (a - b).norm_squared()).sum::<f64>();
                    pairs / (side.len() * side.len()) as f64
                },
                |a, b| a + b,
            ),
            "combinatorial-max" => self
                .best_partition(|side| pairs(side).map(|(a, b)| (a - b).norm_squared()).fold(0.0, f64::max), f64::max),
            "intrinsic" => {
                let mut m = [0.0; 3];
                for ([x, y], angle) in self.log_map().iter().zip(&self.angles) {
                    m = [m[0] + angle * x * x, m[1] + angle * x * y, m[2] + angle * y * y];
                }
                // The product of the eigenvalues over the larger one, which does not cancel.
                let larger = 0.5 * (m[0] + m[2]) + (0.5 * (m[0] - m[2])).hypot(m[1]);
                (m[0] * m[2] - m[1] * m[1]) / larger
            }
            "intrinsic-max" => self.intrinsic_max(),
            other => panic!("{other} has no definition here"),
        }
    }

    fn covariance(&self) -> f64 {
        let mut a = [[0.0; 3]; 3];
        for (n, angle) in self.normals.iter().zip(&self.angles) {
            for (i, k) in (0..9).map(|it| (it / 3, it % 3)) {
                a[i][k] += angle * n[i] * n[k];
            }
        }
        // From the vector, because the eigenvalue of the matrix has lost the digits that squares of heights keep.
        let (values, vectors) = jacobi(a);
        let u = Vec3::from(vectors[(0..3).min_by(|&i, &k| values[i].total_cmp(&values[k])).unwrap()]);
        self.normals.iter().zip(&self.angles).map(|(n, angle)| angle * u.dot(n).powi(2)).sum()
    }

    fn covariance_max(&self) -> f64 {
        let n = self.normals.len();
        let mut best = f64::INFINITY;
        for (a, b, c) in (0..n).flat_map(|a| (a + 1..n).flat_map(move |b| (b + 1..n).map(move |c| (a, b, c)))) {
            for [s, t] in [[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]] {
                let first = self.normals[a];
                let w = (s * self.normals[b] - first).cross(&(t * self.normals[c] - first));
                let u = w.normalize();
                best = best.min(self.normals.iter().map(|n| u.dot(n).powi(2)).fold(0.0, f64::max));
            }
        }
        best
    }

    fn best_partition(&self, side: impl Fn(&[Vec3]) -> f64, join: impl Fn(f64, f64) -> f64) -> f64 {
        let n = self.normals.len();
        let twice: Vec<Vec3> = self.normals.iter().chain(&self.normals).copied().collect();
        let values = (0..n).flat_map(|from| (2..=n - 2).map(move |size| (from, size)));
        values
            .map(|(from, size)| join(side(&twice[from..from + size]), side(&twice[from + size..from + n])))
            .fold(f64::INFINITY, f64::min)
    }

    fn log_map(&self) -> Vec<[f64; 2]> {
        let pole = self.normals.iter().zip(&self.areas).map(|(n, a)| *a * n).sum::<Vec3>().normalize();
        let first = pole.cross(&Vec3::new(0.3, -0.5, 0.2)).normalize();
        let second = pole.cross(&first);
        self.normals
            .iter()
            .map(|n| {
                let angle = angle_between(*n, pole);
                let v = (n - n.dot(&pole) * pole).normalize();
                [angle * v.dot(&first), angle * v.dot(&second)]
            })
            .collect()
    }

    fn intrinsic_max(&self) -> f64 {
        let points = self.log_map();
        let mut best = f64::INFINITY;
        for (i, [ax, ay]) in points.iter().enumerate() {
            for ([bx, by], sign) in points[i + 1..].iter().flat_map(|b| [(b, 1.0), (b, -1.0)]) {
                let (x, y) = (sign * bx - ax, sign * by - ay);
                let highest = points.iter().map(|[px, py]| (px * y - py * x).powi(2)).fold(0.0, f64::max);
                best = best.min(highest / (x * x + y * y));
            }
        }
        best
    }
}

fn pairs(side: &[Vec3]) -> impl Iterator<Item = (Vec3, Vec3)> + '_ {
    side.iter().enumerate().flat_map(|(i, a)| side[i + 1..].iter().map(move |b| (*a, *b)))
}
