//! Maps to the sphere as a table: `cargo bench --bench sphere -- mesh files`.
//!
//! Every mesh that is one closed part without handles, by both methods; `--finer` before a file divides its faces into four
//! first. F is 8π = 25.1327 for a smooth conformal map; D is ½ (σ1/σ2 + σ2/σ1), 1 where it is conformal, its mean and 99th
//! percentile weighted with the area of the source; "flips" and "degree" are exact. Seconds are the time of one core.
#![allow(clippy::print_stdout)]

use fabricate::{
    import::mesh::read,
    mesh::{
        TriMesh,
        repair::{Components, RepairOptions, repair},
    },
    numeric::Monitor,
    surface::{
        sphere_map::{Method, sphere_map},
        subdivide,
    },
};
use std::{path::Path, time::Instant};

fn load(path: &Path, finer: bool) -> Result<TriMesh, String> {
    let soup = read(path).map_err(|err| err.to_string())?;
    let options = RepairOptions { components: Components::One, fill_holes: 0 };
    let (mesh, _) = repair(&soup, &options).map_err(|err| err.to_string())?;
    if finer { subdivide(&mesh).map_err(|err| err.to_string()) } else { Ok(mesh) }
}

fn main() {
    println!(
        "{:24}{:>8}  {:13}{:>13}{:>10}{:>9}{:>9}{:>10}{:>7}{:>7}{:>7}{:>8}",
        "mesh", "V", "method", "way", "F", "D mean", "D p99", "centroid", "flips", "degree", "held", "s"
    );
    let mut finer = false;
    for arg in std::env::args().skip(1) {
        if arg.starts_with("--") {
            finer |= arg == "--finer";
            continue;
        }
        let path = Path::new(&arg);
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        match load(path, finer) {
            Ok(mesh) => {
                for method in [Method::Auto, Method::Hierarchical] {
                    row(&name, &mesh, method);
                }
            }
            Err(err) => println!("{name:24} refused: {err}"),
        }
        finer = false;
    }
}

fn row(name: &str, mesh: &TriMesh, method: Method) {
    let started = Instant::now();
    let map = sphere_map(mesh, method, &Monitor::silent());
    let seconds = started.elapsed().as_secs_f64();
    match map {
        Ok(map) => {
            let q = map.quality;
            println!(
                "{name:24}{:>8}  {:13}{:>13}{:>10.4}{:>9.4}{:>9.4}{:>10.1e}{:>7}{:>7}{:>7}{seconds:>8.3}",
                mesh.vertex_count(),
                format!("{method:?}"),
                format!("{:?}", map.route),
                q.energy,
                q.dilatation_mean,
                q.dilatation_p99,
                q.centroid,
                map.certificate.flips,
                map.certificate.degree,
                map.held,
            );
        }
        Err(err) => println!("{name:24} refused: {err}"),
    }
}
