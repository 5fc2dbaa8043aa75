//! The experiments, one file per figure, and what they share: noise, a descent, measures, and a report of claims.
//!
//! SGC = Stein, Grinspun, Crane, "Developability of Triangle Meshes" (2018). The figures' own meshes are not published; each
//! file says which shape stands in.
mod figure_07;
mod figure_10;
mod figure_11;
mod figure_12;
mod figure_14;
mod figure_16;
mod figure_17;
mod figure_22;
mod figure_26;
mod figure_27;
mod measures;

use fabricate::{
    emit,
    geom::Vec3,
    mesh::{Field, TriMesh},
    numeric::{
        Monitor,
        optim::{Lbfgs, Limits, Objective, Outcome},
        random::Random,
    },
    render,
    stages::develop::{
        Evaluator, Weights,
        energy::{COMPARISONS, ENERGIES, Energy},
    },
};
use std::{
    fs,
    path::{Path, PathBuf},
};

/// An experiment.
pub(crate) struct Figure {
    /// Its number in SGC.
    pub(crate) number: u32,
    /// What it shows.
    pub(crate) claim: &'static str,
    /// Does it, and holds the claim against what came out.
    pub(crate) run: fn(&mut Report),
}

/// All experiments.
pub(crate) const FIGURES: &[Figure] = &[
    figure_07::FIGURE,
    figure_10::FIGURE,
    figure_11::FIGURE,
    figure_12::FIGURE,
    figure_14::FIGURE,
    figure_16::FIGURE,
    figure_17::FIGURE,
    figure_22::FIGURE,
    figure_26::FIGURE,
    figure_27::FIGURE,
];

/// What was measured, and which claims do not hold.
pub(crate) struct Report {
    number: u32,
    folder: Option<PathBuf>,
    /// For people.
    pub(crate) lines: Vec<String>,
    /// Those lines that state a claim that does not hold.
    pub(crate) failures: Vec<String>,
}

impl Report {
    /// Meshes and pictures go to `folder`, if any.
    pub(crate) fn new(number: u32, folder: Option<&Path>) -> Self {
        Self { number, folder: folder.map(Path::to_owned), lines: Vec::new(), failures: Vec::new() }
    }

    fn note(&mut self, line: String) {
        self.lines.push(line);
    }

    fn claim(&mut self, holds: bool, line: String) {
        if holds {
            self.lines.push(format!("ok      {line}"));
        } else {
            self.lines.push(format!("FAILED  {line}"));
            self.failures.push(line);
        }
    }

    fn at_most(&mut self, what: &str, value: f64, limit: f64) {
        self.claim(value <= limit, format!("{what}: {} ≤ {limit}", short(value)));
    }

    fn at_least(&mut self, what: &str, value: f64, limit: f64) {
        self.claim(value >= limit, format!("{what}: {} ≥ {limit}", short(value)));
    }

    /// Writes a mesh and its picture, edges as dark as they are bent.
    fn show(&mut self, name: &str, mesh: &TriMesh) {
        let Some(folder) = &self.folder else { return };
        let path = folder.join(format!("figure-{:02}-{name}", self.number));
        let mut text = Vec::new();
        let written = emit::obj::write(mesh, None, &mut text)
            .and_then(|()| fs::write(path.with_extension("obj"), text))
            .map_err(|error| error.to_string())
            .and_then(|()| render::mesh(mesh, &render::MeshStyle::default()).map_err(|error| error.to_string()))
            .and_then(|png| fs::write(path.with_extension("png"), png).map_err(|error| error.to_string()));
        if let Err(error) = written {
            self.claim(false, format!("{}: {error}", path.display()));
        }
    }
}

fn short(value: f64) -> String {
    if value == 0.0 || value.abs() >= 0.01 { format!("{value:.3}") } else { format!("{value:.1e}") }
}

/// No barriers: the energy alone.
const FREE: Weights = Weights { angle: 0.0, fold: 0.0, defect: 0.0, area: 0.0 };
/// Barriers of the size that the stage uses; they stand in for the flips and collapses of SGC.
const GUARDED: Weights = Weights { angle: 3e-4, fold: 0.01, defect: 0.1, area: 1e-4 };

/// The energy of that name, those for comparison included.
fn energy(name: &str) -> &'static Energy {
    ENERGIES.iter().chain(COMPARISONS).find(|it| it.name == name).expect("figures name energies that exist")
}

struct Flow(Evaluator);

impl Objective for Flow {
    fn evaluate(&mut self, x: &[f64], gradient: &mut [f64]) -> f64 {
        self.0.evaluate(x, gradient).total()
    }
}

/// Follows `energy` for some steps of L-BFGS, at mean edge length 1.
fn descend(start: &TriMesh, energy: &'static Energy, weights: Weights, steps: usize) -> (TriMesh, Outcome) {
    let unit = 1.0 / start.mean_edge_length();
    let scaled = start.with_positions(Field::from_vec(start.positions().iter().map(|p| p * unit).collect()));
    let mut x = coordinates(&scaled);
    let outcome = minimize(&mut Flow(Evaluator::new(&scaled, energy, weights)), &mut x, steps);
    x.iter_mut().for_each(|it| *it /= unit);
    (at(start, &x), outcome)
}

/// Minimises by L-BFGS, in steps of at most a tenth at first.
fn minimize(objective: &mut dyn Objective, x: &mut [f64], steps: usize) -> Outcome {
    let limits = Limits { iterations: steps, gradient: 1e-10, decrease: 0.0, window: 1 };
    Lbfgs::default().minimize(objective, x, None, 0.1, &limits, &Monitor::silent()).expect("nobody cancels")
}

fn coordinates(mesh: &TriMesh) -> Vec<f64> {
    mesh.positions().iter().flat_map(|p| [p.x, p.y, p.z]).collect()
}

/// The same mesh at other coordinates.
fn at(mesh: &TriMesh, x: &[f64]) -> TriMesh {
    mesh.with_positions(Field::from_vec(x.as_chunks::<3>().0.iter().map(|&p| p.into()).collect()))
}

/// Displaces every vertex evenly within a cube of half side `size` mean edges.
fn noisy(mesh: &TriMesh, size: f64, seed: u64) -> TriMesh {
    let (size, mut random) = (size * mesh.mean_edge_length(), Random::new(seed));
    let mut signed = || 2.0 * random.unit() - 1.0;
    moved(mesh, |p| p + size * Vec3::new(signed(), signed(), signed()))
}

fn moved(mesh: &TriMesh, mut map: impl FnMut(&Vec3) -> Vec3) -> TriMesh {
    mesh.with_positions(Field::from_vec(mesh.positions().iter().map(&mut map).collect()))
}
