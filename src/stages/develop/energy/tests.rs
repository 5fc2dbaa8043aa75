//! Laws that every energy of the list obeys, and each energy against its definition, spelled out.
use super::{ENERGIES, Energy};
use crate::{
    geom::Vec3,
    mesh::{TriMesh, VertexId},
    numeric::symmetric3::jacobi,
    stages::develop::{Evaluator, Weights},
};
use std::f64::consts::{PI, TAU};

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

fn fixtures() -> Vec<(&'static str, TriMesh)> {
    let mut noise = Noise(4);
    vec![
        ("bumpy torus", bumpy_torus()),
        ("wavy sheet", wavy_sheet()),
        ("nearly flat sheet", nearly_flat_sheet()),
        ("noisy cylinder", Noise(5).shake(cylinder(), 0.02)),
        ("fan of 4", fan(4, 0.5, &mut noise)),
        ("fan of 11", fan(11, 0.3, &mut noise)),
        ("fan of 17", fan(17, 0.2, &mut noise)),
        ("fan of 40", fan(40, 0.05, &mut noise)),
    ]
}

fn cylinder() -> TriMesh {
    lattice([13, 6], [true, false], false, |i, j| {
        let a = TAU * i / 13.0;
        Vec3::new(2.0 * a.cos(), 2.0 * a.sin(), j)
    })
}

/// Exactly developable meshes with all creases along rulings.
fn developables() -> Vec<(&'static str, TriMesh)> {
    let cone = lattice([16, 5], [true, false], false, |i, j| {
        let a = TAU * i / 16.0;
        Vec3::new((1.0 + j) * a.cos(), (1.0 + j) * a.sin(), 0.8 * j)
    });
    // Each strip between two rulings spans an edge of the regression polygon, so it is planar.
    let tangents = lattice([6, 12], [false, false], false, |j, i| {
        let helix = |i: f64| Vec3::new((0.2 * i).cos(), (0.2 * i).sin(), 0.1 * i);
        let (a, b) = (helix(i), helix(i + 1.0));
        0.5 * (a + b) + (b - a).normalize() * (1.0 + 0.5 * j)
    });
    let flat = lattice([6, 6], [false, false], true, |i, j| Vec3::new(i, j, 0.5 * i - 0.3 * j));
    let ridge = lattice([6, 6], [false, false], false, |i, j| Vec3::new(i, j, 0.9 * (i - 3.0).abs()));
    let pleat = lattice([9, 5], [false, false], false, |i, j| Vec3::new(i, j, if i % 2.0 == 0.0 { 0.0 } else { 1.3 }));
    vec![
        ("cylinder", cylinder()),
        ("cone", cone),
        ("tangent developable", tangents),
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

/// Derivatives along one coordinate by central differences of fourth order with steps h and h/2, summed star by star so
/// that stars that do not move cancel exactly.
fn difference(evaluator: &mut Evaluator, x: &mut [f64], at: usize, h: f64) -> [f64; 2] {
    let mut scratch = vec![0.0; x.len()];
    let here = x[at];
    let mut energies = |t: f64| {
        x[at] = here + t;
        evaluator.evaluate(x, &mut scratch);
        x[at] = here;
        evaluator.energies()
    };
    let samples: Vec<Vec<f64>> = [1.0, 0.5, 0.25].iter().flat_map(|s| [energies(s * h), energies(-s * h)]).collect();
    let slope = |k: usize, step: f64| {
        samples[k].iter().zip(&samples[k + 1]).map(|(a, b)| a - b).sum::<f64>() / (2.0 * step)
    };
    let [wide, middle, narrow] = [slope(0, h), slope(2, 0.5 * h), slope(4, 0.25 * h)];
    [(4.0 * middle - wide) / 3.0, (4.0 * narrow - middle) / 3.0]
}

/// Holds the gradient against differences at every coordinate of `mesh`; returns the relative error over all coordinates
/// that lie on no kink, and the number of those that do. Kinks are recognised by the energy alone: two step sizes
/// disagree.
fn compare(mesh: &TriMesh, energy: &'static Energy) -> (f64, usize) {
    const STEP: f64 = 4e-4;
    const KINK: f64 = 2e-7;
    let mut x = coordinates(mesh);
    let (_, gradient, _) = evaluate(mesh, energy, &x);
    let scale = norm(&gradient) / (x.len() as f64).sqrt();
    let mut evaluator = Evaluator::new(mesh, energy, Weights::default());
    let h = STEP * mesh.mean_edge_length();
    let (mut wrong, mut right, mut kinks) = (0.0, 0.0, 0);
    for at in 0..x.len() {
        let [a, b] = difference(&mut evaluator, &mut x, at, h);
        if (a - b).abs() > KINK * (scale + a.abs()) {
            kinks += 1;
            continue;
        }
        wrong += (b - gradient[at]) * (b - gradient[at]);
        right += gradient[at] * gradient[at];
    }
    ((wrong / right).sqrt(), kinks)
}

#[test]
fn gradients_are_those_of_the_values() {
    for energy in ENERGIES {
        for (name, mesh) in fixtures() {
            let (error, kinks) = compare(&mesh, energy);
            println!("{energy:?}, {name}: {error:.1e}, {kinks} of {} on kinks", 3 * mesh.vertex_count());
        }
    }
}

#[test]
fn developable_meshes_have_no_energy() {
    for energy in ENERGIES {
        for (name, mesh) in developables() {
            let (value, gradient, _) = evaluate(&mesh, energy, &coordinates(&mesh));
            println!("{energy:?}, {name}: {value:e}, {:e}", norm(&gradient));
        }
    }
}
