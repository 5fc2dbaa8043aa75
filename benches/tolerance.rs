//! Tolerance of the cut against distortion, as in figure 20 of Stein, Grinspun, Crane 2018: `cargo bench --bench tolerance
//! -- developed meshes`.
//!
//! As the paper cuts: every vertex with a covariance energy above ε is joined to a tree of shortest paths, and nothing is
//! checked afterwards. Mean |log scale| is that of the conformal map with an isometric boundary, weighted by area; "paper"
//! is what figure 20 says, as a mean scale distortion on its model. Beside it the same with terminals by the angle defect,
//! which also finds what vertices of valence 3 hide.
#![allow(clippy::print_stdout)]
mod meshes;

use fabricate::{
    mesh::{EdgeId, FaceId, Field, TriMesh, VertexId, operators::angle_defects},
    numeric::Monitor,
    stages::develop::{Evaluator, Weights, energy::COVARIANCE},
    surface::{
        chart::{ChartBuilder, Metric},
        cut_graph::cut_to_disks,
        flatten::Flattener,
    },
};

/// Tolerances of figure 20 with its mean scale distortion.
const PAPER: [(f64, f64); 4] = [(0.01, 2.4), (0.005, 0.09), (0.002, 0.006), (0.001, 0.0004)];

fn main() {
    println!(
        "{:16}{:>8}{:>9} | {:>10}{:>9}{:>12}{:>9} | {:>10}{:>9}{:>12}{:>9}",
        "mesh", "ε", "paper", "λ > ε", "seam", "mean |u|", "max |u|", "|K| > ε", "seam", "mean |u|", "max |u|"
    );
    for path in meshes::words() {
        let (name, mesh) = meshes::load(&path);
        let x: Vec<f64> = mesh.positions().iter().flat_map(|p| [p.x, p.y, p.z]).collect();
        let mut evaluator = Evaluator::new(&mesh, &COVARIANCE, Weights::default());
        evaluator.evaluate(&x, &mut vec![0.0; x.len()]);
        let energies = evaluator.energies();
        let defects = angle_defects(&mesh);
        for (tolerance, paper) in PAPER {
            let by_energy = row(&mesh, |v| energies[v.0 as usize] > tolerance);
            let by_defect = row(&mesh, |v| !mesh.is_boundary_vertex(v) && defects[v].abs() > tolerance);
            println!("{name:16}{tolerance:>8}{paper:>9} | {by_energy} | {by_defect}");
        }
    }
}

/// Terminals, seam over the diagonal, mean and largest |u|.
fn row(mesh: &TriMesh, is_terminal: impl Fn(VertexId) -> bool) -> String {
    let terminals: Vec<VertexId> = mesh.vertices().filter(|&v| is_terminal(v)).collect();
    let weight = Field::from_fn(mesh.edge_count(), |e| mesh.edge_length(e));
    let mut cut = Field::<EdgeId, bool>::filled(mesh.edge_count(), false);
    let all: Vec<FaceId> = mesh.faces().collect();
    cut_to_disks(mesh, &all, &weight, &angle_defects(mesh), &terminals, &mut cut, &Monitor::silent())
        .expect("nobody interrupts");
    let metric = Metric::new(mesh);
    let chart = ChartBuilder::new(mesh).chart(all, &|e| cut[e]);
    let flattener = match Flattener::new(&metric, &chart) {
        Ok(it) => it,
        Err(error) => return error.to_string(),
    };
    let u = flattener.log_factor();
    let (mut sum, mut area) = (0.0, 0.0);
    for (&f, corners) in chart.faces.iter().zip(&chart.corners) {
        sum += metric.area[f] * corners.iter().map(|&v| u[v as usize].abs()).sum::<f64>() / 3.0;
        area += metric.area[f];
    }
    let seam: f64 = mesh.edges().filter(|&e| cut[e] && !mesh.is_boundary_edge(e)).map(|e| weight[e]).sum();
    let max = u.iter().fold(0.0, |max: f64, it| max.max(it.abs()));
    format!("{:>10}{:>9.2}{:>12.6}{max:>9.4}", terminals.len(), seam / mesh.bounds().diagonal(), sum / area)
}
