//! Time of each phase of flattening a disk, on one thread: `cargo bench --bench flatten -- mesh.obj mesh.obj:2 …`, where
//! the number is how often the mesh is subdivided (four triangles for one).
//!
//! Closed meshes are cut along the shortest graph that opens them to one disk. Milliseconds, least of several
//! runs. The bar is a third of the time of the C++ references;
//! after the bar the same matrix ordered by nested dissection instead of minimum degree.
#![allow(clippy::print_stdout)]
use fabricate::{
    import::mesh::read,
    mesh::{FaceId, Field, TriMesh, operators::angle_defects},
    numeric::{
        Monitor,
        dissection::nested_dissection,
        sparse::{Analysis, Cholesky},
    },
    surface::{
        chart::{Chart, ChartBuilder, Metric},
        cut_graph::cut_to_disks,
        flatten::{Flattener, InteriorLaplacian},
        opening::open,
        subdivide,
    },
};
use std::{hint::black_box, path::Path, time::Instant};

const SAMPLES: usize = 7;
/// A third of the time of the C++ references, ms, by number of vertices.
const BAR: [(f64, f64); 4] = [(17e3, 10.0), (47e3, 45.0), (130e3, 227.0), (273e3, 665.0)];

fn main() {
    let paths: Vec<String> = std::env::args().skip(1).filter(|arg| !arg.starts_with("--")).collect();
    println!(
        "{:18}{:>9}{:>8}{:>8}{:>9}{:>9}{:>9}{:>8}{:>8}{:>9}{:>9}{:>7} | {:>8}{:>9}{:>9}{:>11}{:>11}",
        "mesh",
        "vertices",
        "metric",
        "chart",
        "assemble",
        "analyse",
        "factor",
        "solve",
        "extend",
        "total",
        "bar",
        "share",
        "dissect",
        "analyse",
        "factor",
        "values",
        "minimum d."
    );
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread can be started");
    for argument in &paths {
        let (path, times) = argument.rsplit_once(':').unwrap_or((argument, "0"));
        let soup = read(Path::new(path)).unwrap_or_else(|error| panic!("{path}: {error}"));
        let mut mesh = TriMesh::new(soup.positions, &soup.faces).unwrap_or_else(|error| panic!("{path}: {error}"));
        for _ in 0..times.parse().expect("the number behind the colon says how often to subdivide") {
            mesh = subdivide(&mesh).unwrap_or_else(|error| panic!("{path}: {error}"));
        }
        let name = format!("{}:{times}", Path::new(path).file_stem().unwrap_or_default().to_string_lossy());
        pool.install(|| row(&name, &disk(mesh)));
    }
}

/// The largest piece of the mesh cut open.
fn disk(mesh: TriMesh) -> TriMesh {
    let weight = Field::from_fn(mesh.edge_count(), |e| mesh.edge_length(e));
    let mut cut = Field::filled(mesh.edge_count(), false);
    let all: Vec<FaceId> = mesh.faces().collect();
    cut_to_disks(&mesh, &all, &weight, &angle_defects(&mesh), &[], &mut cut, &Monitor::silent())
        .expect("nobody interrupts");
    open(&mesh, &cut).unwrap_or_else(|error| panic!("{error}")).mesh
}

/// Least time of several runs, ms, and the result of the last.
fn time<T>(mut run: impl FnMut() -> T) -> (f64, T) {
    let mut least = f64::INFINITY;
    let mut sample = || {
        let start = Instant::now();
        let out = black_box(run());
        least = least.min(1e3 * start.elapsed().as_secs_f64());
        out
    };
    for _ in 1..SAMPLES {
        sample();
    }
    let out = sample();
    (least, out)
}

fn row(name: &str, mesh: &TriMesh) {
    let (metric_ms, metric) = time(|| Metric::new(mesh));
    let whole_chart = || -> Chart { ChartBuilder::new(mesh).chart(mesh.faces().collect(), &|_| false) };
    let (chart_ms, chart) = time(whole_chart);
    let (assemble, laplacian) = time(|| InteriorLaplacian::new(&metric, &chart));
    let factor_of =
        |it: &Analysis| -> Cholesky { it.factor(&laplacian.matrix).unwrap_or_else(|error| panic!("{error}")) };
    let (analyse, analysis) = time(|| Analysis::new(&laplacian.matrix).unwrap_or_else(|error| panic!("{error}")));
    let (factor_ms, factor) = time(|| factor_of(&analysis));
    let mut b = vec![1.0; factor.size()];
    let (solve, ()) = time(|| factor.solve_in_place(&mut b));
    let flattener = Flattener::new(&metric, &chart).unwrap_or_else(|error| panic!("{error}"));
    let (extend, _) = time(|| flattener.flatten());
    let (total, _) = time(|| {
        let (metric, chart) = (Metric::new(mesh), whole_chart());
        Flattener::new(&metric, &chart).and_then(|it| it.flatten()).unwrap_or_else(|error| panic!("{error}"))
    });
    let place = |&v: &u32| -> [f64; 3] { mesh.position(chart.origin[v as usize]).into() };
    let points: Vec<[f64; 3]> = laplacian.interior.iter().map(place).collect();
    let (dissect, order) = time(|| nested_dissection(&laplacian.matrix, 1, &points));
    let with = || Analysis::with_ordering(&laplacian.matrix, &order).unwrap_or_else(|error| panic!("{error}"));
    let (analyse_dissected, dissected) = time(with);
    let (factor_dissected, _) = time(|| factor_of(&dissected));
    let bar = bar(mesh.vertex_count() as f64);
    print!("{name:18}{:>9}{metric_ms:>8.1}{chart_ms:>8.1}{assemble:>9.1}", mesh.vertex_count());
    print!("{analyse:>9.1}{factor_ms:>9.1}{solve:>8.1}{extend:>8.1}{total:>9.1}{bar:>9.1}{:>7.2} |", total / bar);
    print!("{dissect:>9.1}{analyse_dissected:>9.1}{factor_dissected:>9.1}");
    println!("{:>11}{:>11}", dissected.entries(), analysis.entries());
}

/// The bar for a number of vertices: powers between the given points and beyond them.
fn bar(vertices: f64) -> f64 {
    let k = BAR.iter().take(BAR.len() - 1).rposition(|it| it.0 <= vertices).unwrap_or(0);
    let [(n, s), (m, t)] = [BAR[k], BAR[k + 1]];
    s * (t / s).powf((vertices / n).ln() / (m / n).ln())
}
