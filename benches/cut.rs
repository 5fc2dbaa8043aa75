//! Cutting and flattening with a guarantee, as a table: `cargo bench --bench cut -- mesh files [stretch limits]`.
//!
//! Each mesh is scaled to a diagonal of 200 mm. Seam = total length of the cuts over the diagonal, each cut counted once.
//! Principal stretch is max |ln σ| of a triangle of the flat layout; "over" is the share of the area above the limit.
//! The last "seam" is the largest difference of the two sides of a seam in the plane over what is allowed, the larger of
//! 0.2 % and 0.05 mm: at most 1.
//! Seconds are the time of one core, cutting and flattening together.
#![allow(clippy::print_stdout)]
mod cutting;

use fabricate::{
    import::mesh::read,
    mesh::{Field, TriMesh},
    numeric::Monitor,
    stages::{
        cut::{Options, cut},
        flatten::{flatten, quality, seam_lengths},
    },
};
use std::{fs, path::Path, sync::LazyLock, time::Instant};

/// Side of the least useful square, mm; smaller pieces count as "small".
const MIN_PIECE: f64 = 8.0;

/// Diagonal of the scaled meshes, mm.
const DIAGONAL: f64 = 200.0;

fn main() {
    let args: Vec<String> = std::env::args().skip(1).filter(|arg| !arg.starts_with("--")).collect();
    let (numbers, paths): (Vec<&String>, Vec<&String>) = args.iter().partition(|it| it.parse::<f64>().is_ok());
    let mut limits: Vec<f64> = numbers.iter().filter_map(|it| it.parse().ok()).collect();
    if limits.is_empty() {
        limits = vec![0.002, 0.005, 0.03, 0.05];
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread can be started");
    println!(
        "{:20}{:>6}{:>6}{:>8}{:>7}{:>8}{:>10}{:>9}{:>9}{:>9}{:>9}{:>9}{:>6}{:>6}{:>10}{:>8}",
        "mesh",
        "genus",
        "loops",
        "limit %",
        "pieces",
        "small",
        "seam/diag",
        "log max",
        "log p99",
        "str max",
        "str p99",
        "over %",
        "overl",
        "flips",
        "seam",
        "s"
    );
    for path in paths {
        let name = Path::new(path).file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let mesh = match read(Path::new(path))
            .map_err(|it| it.to_string())
            .and_then(|soup| TriMesh::new(soup.positions, &soup.faces).map_err(|it| it.to_string()))
        {
            Ok(mesh) => scaled(mesh),
            Err(error) => {
                println!("{name:20}{error}");
                continue;
            }
        };
        for &limit in &limits {
            pool.install(|| row(&name, &mesh, limit));
        }
    }
}

/// Time that this thread has had a core, where the system tells (Linux); else the time on the wall.
fn seconds() -> f64 {
    static START: LazyLock<Instant> = LazyLock::new(Instant::now);
    let told = fs::read_to_string("/proc/thread-self/schedstat").ok();
    let nanoseconds = told.and_then(|it| it.split(' ').next()?.parse::<f64>().ok());
    nanoseconds.map_or_else(|| START.elapsed().as_secs_f64(), |it| 1e-9 * it)
}

fn scaled(mesh: TriMesh) -> TriMesh {
    let scale = DIAGONAL / mesh.bounds().diagonal();
    let positions = mesh.positions().iter().map(|p| p * scale).collect();
    mesh.with_positions(Field::from_vec(positions))
}

fn row(name: &str, mesh: &TriMesh, limit: f64) {
    let input = cutting::developable(mesh.clone());
    let options = Options { min_area: MIN_PIECE * MIN_PIECE, ..cutting::options(limit) };
    let start = seconds();
    let monitor = Monitor::silent();
    let result = cut(&input, &options, &monitor).map_err(|it| it.to_string());
    let result =
        result.and_then(|cut| Ok((flatten(&cut, &cutting::flat(), &monitor).map_err(|it| it.to_string())?, cut)));
    let seconds = seconds() - start;
    let (flat, cut) = match result {
        Ok(it) => it,
        Err(error) => {
            println!("{name:20}{:>8}  {error}", 100.0 * limit);
            return;
        }
    };
    let quality = quality(&cut, &flat);
    let seam: f64 = cut.seams.iter().flat_map(|it| &it.sides[0]).map(|&h| cut.mesh.vector(h).norm()).sum();
    let small = quality.pieces.iter().filter(|it| it.area_3d < MIN_PIECE * MIN_PIECE).count();
    let misfit = seam_lengths(&cut, &flat).iter().map(|it| it.mismatch() / it.allowance()).fold(0.0, f64::max);
    let (genus, loops) = (mesh.genus(), mesh.boundary_loops().len());
    println!(
        "{name:20}{genus:>6}{loops:>6}{:>8}{:>7}{small:>8}{:>10.2}{:>9.5}{:>9.5}{:>9.4}{:>9.5}{:>9.3}{:>6}{:>6}{misfit:>10.4}{seconds:>8.2}",
        100.0 * limit,
        cut.pieces.len(),
        seam / DIAGONAL,
        quality.max_log_scale.0,
        quality.p99_log_scale,
        quality.max_principal_stretch.0,
        quality.p99_principal_stretch,
        100.0 * quality.share_over_limit,
        flat.overlaps.len(),
        quality.flipped.len(),
    );
}
