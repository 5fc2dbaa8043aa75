//! Times of direction fields, parameterisation, isolines and edits on one thread: `cargo bench --bench stripes` takes a bumpy
//! closed shape at 1 k, 8 k, 63 k and 350 k faces, `cargo bench --bench stripes -- mesh.obj …` meshes as they are.
//!
//! `field` is the tangent planes and the smoothest field, `solve` everything from the field to α (1-form, trees, Laplacian,
//! factor, back-substitution), `lines` the crossings and the polylines, `edit` one pair of singularities more. Of several
//! runs the best is shown. `error` is the largest |D1 u − 2π k| in radians, `gradient` the largest |d0ᵀ W (u − ω)|.
#![allow(clippy::print_stdout)]
mod meshes;

use fabricate::{
    geom::{Complex, Vec3},
    mesh::{FaceId, Field, Id, TriMesh, shapes},
    stages::stripes::isolines::{Crossings, Levels},
    surface::{
        direction_field::smoothest,
        field_aligned::{Indices, Parameterizer},
        tangent::{TangentSpaces, one_form},
        tree_cotree::Node,
    },
};
use std::{f64::consts::TAU, time::Instant};

/// A cube of 12 d² faces blown up to a sphere of 50 mm, with bumps.
fn bumpy(d: usize) -> TriMesh {
    let cube = shapes::cuboid(Vec3::repeat(2.0), d);
    let place = |p: &Vec3| {
        let q = (p - Vec3::repeat(1.0)).map(|x| (x * std::f64::consts::FRAC_PI_4).tan()).normalize();
        q * 50.0 * (1.0 + 0.12 * (5.0 * q.x).sin() * (4.0 * q.y + 1.0).cos() * (3.0 * q.z).cos())
    };
    cube.with_positions(Field::from_vec(cube.positions().iter().map(place).collect()))
}

/// Milliseconds of the best of `runs` runs, with the result of the last.
fn time<T>(runs: usize, mut run: impl FnMut() -> T) -> (f64, T) {
    let mut once = || {
        let start = Instant::now();
        let result = run();
        (1e3 * start.elapsed().as_secs_f64(), result)
    };
    (1..runs).fold(once(), |best, _| {
        let (ms, result) = once();
        (ms.min(best.0), result)
    })
}

fn main() {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread can be started");
    println!(
        "{:16}{:>9}{:>10}{:>10}{:>10}{:>10}{:>7}{:>11}{:>11}{:>11}",
        "mesh", "faces", "field", "solve", "lines", "edit", "count", "energy", "error", "gradient"
    );
    let files: Vec<String> = meshes::words().collect();
    pool.install(|| {
        if files.is_empty() {
            [9, 26, 72, 171].into_iter().for_each(|d| row("bumpy", &bumpy(d)));
        }
        for path in &files {
            let (name, mesh) = meshes::load(path);
            row(&name, &mesh);
        }
    });
}

fn row(name: &str, mesh: &TriMesh) {
    let runs = (200_000 / mesh.face_count()).clamp(2, 20);
    let (field_ms, (tangent, field)) = time(runs, || {
        let tangent = TangentSpaces::new(mesh);
        let field = smoothest(mesh, &tangent, 1).expect("the mesh is sound").vectors();
        (tangent, field)
    });
    // Fifty lines along the diagonal.
    let frequency = TAU * 50.0 / mesh.bounds().diagonal();
    let gradient = Field::from_vec(field.iter().map(|it| it * frequency).collect::<Vec<Complex>>());
    let form = || one_form(mesh, &tangent, &gradient);
    let (solve_ms, solver) = time(runs, || {
        let solver = Parameterizer::new(mesh).expect("the mesh is sound");
        solver.solve(mesh, form(), &Indices::default()).expect("no index is asked for");
        solver
    });
    let mut it = solver.solve(mesh, form(), &Indices::default()).expect("no index is asked for");
    let levels = Levels { per_turn: 1, offset: 0.0 };
    let (lines_ms, lines) = time(runs, || Crossings::new(mesh, &it.alpha, &it.n, levels).lines(mesh));
    let faces = mesh.face_count();
    let mut k = 0;
    let (edit_ms, ()) = time(2 * runs, || {
        k += 1;
        let [begin, end] = [17 * k % faces, 1117 * k % faces].map(|f| Node::Face(FaceId::new(f)));
        it.add_pair(begin, end).expect("both lie on one component");
    });
    let sums = solver.tree.sums(&it.differences(mesh));
    let off = sums.iter().zip(it.nodes()).map(|(sum, &k)| (sum - TAU * f64::from(k)).abs()).fold(0.0, f64::max);
    println!(
        "{name:16}{faces:>9}{field_ms:>10.3}{solve_ms:>10.3}{lines_ms:>10.3}{edit_ms:>10.3}{:>7}{:>11.1}{off:>11.1e}{:>11.1e}",
        lines.len(),
        it.energy(),
        it.residual()
    );
}
