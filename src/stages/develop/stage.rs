//! The `[develop]` table and the adapter to the kernel.
use std::fmt;

use serde::{Deserialize, Deserializer, Serialize, Serializer, de};
use serde_json::json;

use super::{
    Boundary, Crossings, Defects, DevelopError, Deviation, Features, Network, Optimizer, Options, Override, develop,
    energy::{self, Energy},
    folded_edges, resume, seam_length, smallest_angle,
};
use crate::{
    mesh::{Field, TriMesh},
    model::{DevelopableMesh, Noun, Round, SourceMesh, Tradeoff},
    numeric::Monitor,
    profile::{Angle, Extent, Profiles},
    stage::{Check, Cx, KeyError, Section, Stage},
    surface::subdivide,
};

/// Vertices whose energy exceeds this count as lying on a seam in `seam_vertex_share`.
const SEAM_ENERGY: f64 = 1e-3;

/// The `[develop]` table.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Develop {
    /// Name of the developability energy.
    pub energy: String,
    /// "auto", "levenberg" (lowest energy; covariance only), "lbfgs-h2" (quick preview), "lbfgs" or "subgradient".
    pub optimizer: Method,
    /// Largest distance between the result and the input, either way: a length, or percent of the input's diagonal.
    pub max_deviation: Extent,
    /// Whether to hold the flow to that distance; without, the distance is only measured.
    pub fidelity: bool,
    /// Boundary curves: "fair" (they slide but stay smooth, unless they are zigzags in the input), "hold" (also as near to the input's boundary as the surface to the
    /// surface) or "free".
    pub boundary: CurveRule,
    /// Creases: "free" (they move where the energy wants them) or "hold" (those sharper than `feature_angle` stay near the
    /// input's, and smooth).
    pub features: CurveRule,
    /// Edges with a larger angle between the normals of their faces are features.
    pub feature_angle: Angle,
    /// σ of the robust loss σ ln(1 + λ/σ): fewer, straighter seams between flat facets, at a higher energy; try 0.01. Not
    /// given: smooth.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub facet: Option<f64>,
    /// Whether triangles that are not buildable may be mended between rounds by changing the connectivity (never with held
    /// features).
    pub remesh: bool,
    /// Number of 4–1 subdivisions, or "auto".
    pub levels: Levels,
    /// Rounds on the finest level, each with a stronger hold on the input; coarser levels have one.
    pub rounds: usize,
    /// Most steps per round; what the optimiser usually needs if not given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub iterations: Option<usize>,
    /// Deviations to try besides `max_deviation`, so that the report can say what closeness costs; each is a run of its own.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub curve: Vec<Extent>,
    /// `[[develop.round]]`: what some rounds do otherwise; of several tables that concern a round, later ones win.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub round: Vec<RoundTable>,
}

/// One `[[develop.round]]` table. Keys that are not given stay as they are for that round.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RoundTable {
    /// Only on this level (the coarsest is 0).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub level: Option<usize>,
    /// Only this round of a level, from 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub number: Option<usize>,
    /// As in `[develop]`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub energy: Option<String>,
    /// As in `[develop]`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub optimizer: Option<Method>,
    /// Distance from which the hold on the input acts in this round; the promise in `[develop]` stays.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_deviation: Option<Extent>,
    /// Most steps.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub iterations: Option<usize>,
    /// Relative decrease of the objective over the latest steps (8 of "levenberg", 30 of "lbfgs-h2") below which the round
    /// ends; 1e-2, in the last round 5e-3.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub decrease: Option<f64>,
    /// Norm of the gradient at mean edge length 1 over the root of the number of variables, below which it ends; 1e-10.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gradient: Option<f64>,
    /// Weight of the hold on the input; from 6 in the first to 90 in the last round of the last level.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hold: Option<f64>,
    /// Share of the energy at its start that a round would pay to bring the mean distance to the input down by the one
    /// promised; 0 in the first round, then 0.4.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pull: Option<f64>,
    /// Weight of the barrier against thin angles; 3e-4, a quarter of it on each further level.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub angle: Option<f64>,
    /// Weight of the barrier against folded edges; 0.01.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fold: Option<f64>,
    /// Weight of the barrier against large angle defects; 0.1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub defect: Option<f64>,
    /// Weight of the term that keeps areas; 1e-4, a quarter of it on each further level.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub area: Option<f64>,
}

impl RoundTable {
    fn check(&self, all: &Develop) -> Result<(), KeyError> {
        let energy = self.energy.as_deref().unwrap_or(&all.energy);
        known("round.energy", energy)?;
        curved("round.optimizer", self.optimizer.unwrap_or(all.optimizer), energy)?;
        if let Some(deviation) = self.max_deviation {
            positive("round.max_deviation", deviation)?;
        }
        KeyError::range("round.number", self.number.unwrap_or(1) as f64, 1.0, 100.0)?;
        KeyError::range("round.iterations", self.iterations.unwrap_or(1) as f64, 1.0, 1e6)?;
        for (key, value) in [
            ("round.decrease", self.decrease),
            ("round.gradient", self.gradient),
            ("round.hold", self.hold),
            ("round.pull", self.pull),
            ("round.angle", self.angle),
            ("round.fold", self.fold),
            ("round.defect", self.defect),
            ("round.area", self.area),
        ] {
            KeyError::range(key, value.unwrap_or(0.0), 0.0, 1e9)?;
        }
        Ok(())
    }

    fn resolve(&self, diagonal: f64) -> Override {
        Override {
            level: self.level,
            round: self.number.map(|it| it - 1),
            energy: self.energy.as_deref().and_then(Energy::named),
            optimizer: self.optimizer.map(Method::resolve),
            max_deviation: self.max_deviation.map(|it| it.resolve(diagonal)),
            iterations: self.iterations,
            decrease: self.decrease,
            gradient: self.gradient,
            hold: self.hold,
            pull: self.pull,
            angle: self.angle,
            fold: self.fold,
            defect: self.defect,
            area: self.area,
        }
    }
}

/// `Err` unless an energy has that name.
fn known(key: &'static str, name: &str) -> Result<(), KeyError> {
    if Energy::named(name).is_some() {
        return Ok(());
    }
    let names: Vec<_> = energy::ENERGIES.iter().map(|it| it.name).collect();
    Err(KeyError { key, message: format!("must be one of {}, not \"{name}\"", names.join(", ")) })
}

/// `Err` if the optimiser needs second derivatives that the energy, whose name is known, has not.
fn curved(key: &'static str, optimizer: Method, energy: &str) -> Result<(), KeyError> {
    if optimizer != Method::Levenberg || Energy::named(energy).is_none_or(Energy::has_curvature) {
        return Ok(());
    }
    let message = format!("\"levenberg\" cannot minimise \"{energy}\": write \"auto\", \"lbfgs-h2\" or \"lbfgs\"");
    Err(KeyError { key, message })
}

/// `Err` unless it is a deviation that can be asked for.
fn positive(key: &'static str, deviation: Extent) -> Result<(), KeyError> {
    match deviation {
        Extent::Percent(percent) => KeyError::range(key, percent, 1e-3, 100.0),
        Extent::Length(length) => KeyError::range(key, length.mm, 1e-6, 1e6),
    }
}

impl Default for Develop {
    fn default() -> Self {
        Self {
            energy: "covariance".into(),
            optimizer: Method::Auto,
            max_deviation: Extent::Percent(1.0),
            fidelity: true,
            boundary: CurveRule::Fair,
            features: CurveRule::Free,
            feature_angle: Angle::degrees(50.0),
            facet: None,
            remesh: false,
            levels: Levels::Auto,
            rounds: 3,
            iterations: None,
            curve: Vec::new(),
            round: Vec::new(),
        }
    }
}

/// An optimiser, as it is written in the config.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// "levenberg" for the covariance energy, "lbfgs-h2" for the others.
    Auto,
    /// Limited-memory BFGS.
    Lbfgs,
    /// The same in a metric of second order: quick.
    LbfgsH2,
    /// Subgradient descent: slow, for comparison.
    Subgradient,
    /// Levenberg–Marquardt with variable projection.
    Levenberg,
}

impl Method {
    fn resolve(self) -> Optimizer {
        match self {
            Self::Auto => Optimizer::Auto,
            Self::LbfgsH2 => Optimizer::LbfgsH2,
            Self::Lbfgs => Optimizer::Lbfgs,
            Self::Subgradient => Optimizer::Subgradient,
            Self::Levenberg => Optimizer::Levenberg,
        }
    }
}

/// What is done with a curve.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum CurveRule {
    /// It slides but stays smooth.
    Fair,
    /// It stays near that of the input, and smooth.
    Hold,
    /// Nothing.
    Free,
}

/// How often to subdivide.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Levels {
    /// Until there are enough vertices.
    Auto,
    /// So many times.
    Count(usize),
}

struct LevelsVisitor;

impl de::Visitor<'_> for LevelsVisitor {
    type Value = Levels;
    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a number of subdivisions, or \"auto\"")
    }
    fn visit_u64<E: de::Error>(self, count: u64) -> Result<Levels, E> {
        Ok(Levels::Count(usize::try_from(count).unwrap_or(usize::MAX)))
    }
    fn visit_i64<E: de::Error>(self, count: i64) -> Result<Levels, E> {
        u64::try_from(count)
            .map_err(|_| E::invalid_value(de::Unexpected::Signed(count), &self))
            .and_then(|count| self.visit_u64(count))
    }
    fn visit_str<E: de::Error>(self, text: &str) -> Result<Levels, E> {
        match text {
            "auto" => Ok(Levels::Auto),
            _ => Err(E::invalid_value(de::Unexpected::Str(text), &self)),
        }
    }
}

impl<'de> Deserialize<'de> for Levels {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(LevelsVisitor)
    }
}

impl Serialize for Levels {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Auto => serializer.serialize_str("auto"),
            Self::Count(count) => serializer.serialize_u64(*count as u64),
        }
    }
}

impl Stage for Develop {
    const NAME: &'static str = "develop";
    const VERSION: u32 = 14;
    type Input = (SourceMesh, TriMesh);
    type Output = DevelopableMesh;
    type Profile = ();
    type Error = DevelopError;

    fn profile(_: &Profiles) {}

    fn check(&self) -> Result<(), KeyError> {
        known("energy", &self.energy)?;
        curved("optimizer", self.optimizer, &self.energy)?;
        positive("max_deviation", self.max_deviation)?;
        self.curve.iter().try_for_each(|&it| positive("curve", it))?;
        if self.features == CurveRule::Fair {
            let message = "must be \"free\" or \"hold\"; only a boundary can be \"fair\"".into();
            return Err(KeyError { key: "features", message });
        }
        KeyError::range("feature_angle", self.feature_angle.radians.to_degrees(), 5.0, 175.0)?;
        KeyError::range("facet", self.facet.unwrap_or(1.0), 1e-5, 1.0)?;
        if let Levels::Count(count) = self.levels {
            KeyError::range("levels", count as f64, 0.0, 8.0)?;
        }
        KeyError::range("rounds", self.rounds as f64, 1.0, 100.0)?;
        KeyError::range("iterations", self.iterations.unwrap_or(1) as f64, 1.0, 1e6)?;
        self.round.iter().try_for_each(|it| it.check(self))
    }

    fn run(&self, (source, start): (&SourceMesh, &TriMesh), _: &(), cx: &Cx) -> Result<DevelopableMesh, DevelopError> {
        let diagonal = source.mesh.bounds().diagonal();
        let options = Options {
            energy: Energy::named(&self.energy).expect("`check` refused unknown names"),
            optimizer: self.optimizer.resolve(),
            max_deviation: self.max_deviation.resolve(diagonal),
            fidelity: self.fidelity,
            boundary: match self.boundary {
                CurveRule::Fair => Boundary::Fair,
                CurveRule::Hold => Boundary::Hold,
                CurveRule::Free => Boundary::Free,
            },
            features: match self.features {
                CurveRule::Hold => Features::Hold(self.feature_angle.radians),
                _ => Features::Free,
            },
            facet: self.facet,
            remesh: self.remesh,
            levels: match self.levels {
                Levels::Auto => None,
                Levels::Count(count) => Some(count),
            },
            rounds: self.rounds,
            iterations: self.iterations,
            overrides: self.round.iter().map(|it| it.resolve(diagonal)).collect(),
        };
        let kept = cx.kept.and_then(DevelopableMesh::peek);
        let keep = |rounds: &[Round]| {
            let Some(mesh) = rounds.last().and_then(|it| it.mesh.clone()) else { return };
            let energy = Field::filled(mesh.vertex_count(), 0.0);
            let (max_deviation, rounds, tradeoffs) = (options.max_deviation, rounds.to_vec(), Vec::new());
            (cx.keep)(DevelopableMesh { mesh, energy, max_deviation, rounds, tradeoffs }.wrap());
        };
        let done = kept.map_or(&[][..], |it| &it.rounds);
        let mut result = resume(&source.mesh, start, &options, done, &keep, &cx.monitor)?;
        let tried = kept.map_or(&[][..], |it| &it.tradeoffs);
        for (i, deviation) in self.curve.iter().enumerate() {
            let row = match tried.get(i) {
                Some(&row) => row,
                None => {
                    let options = Options { max_deviation: deviation.resolve(diagonal), ..options.clone() };
                    tradeoff(&source.mesh, &develop(&source.mesh, start, &options, &cx.monitor)?)
                }
            };
            result.tradeoffs.push(row);
            (cx.keep)(result.clone().wrap());
        }
        // Corrections change too little to be looked at.
        result.rounds.iter_mut().filter(|it| it.correction).for_each(|it| it.mesh = None);
        Ok(result)
    }

    fn section(&self, (source, start): (&SourceMesh, &TriMesh), _: &(), output: &DevelopableMesh) -> Section {
        let (mesh, limit) = (&output.mesh, output.max_deviation);
        let percent = 100.0 / source.mesh.bounds().diagonal();
        let deviation = Deviation::between(&source.mesh, mesh, limit);
        let (defects, folds) = (Defects::of(mesh), folded_edges(mesh));
        let crossings = Crossings::between(&source.mesh, mesh, limit.max(deviation.hausdorff));
        let seam = output.energy.iter().filter(|&&energy| energy > SEAM_ENERGY).count();
        let mut table = json!({
            "max_deviation_pct": limit * percent,
            "hausdorff_bound_pct": deviation.bound * percent,
            "rounds": output.rounds.iter().map(round).collect::<Vec<_>>(),
            "covariance_energy": output.energy.iter().sum::<f64>(),
            "folds": folds.len(),
            "self_intersections": crossings.of_result,
            "input_self_intersections": crossings.of_source,
            "min_angle_deg": smallest_angle(mesh).to_degrees(),
            "hausdorff_pct": deviation.hausdorff * percent,
            "mean_pct": deviation.mean * percent,
            "seam_vertex_share": seam as f64 / mesh.vertex_count() as f64,
            "skipped_abs_defect": defects.skipped,
            "median_abs_defect": defects.median,
            "max_abs_defect": defects.max,
            "top5_defect_share": defects.top5_share,
        });
        if !output.tradeoffs.is_empty() {
            table["curve"] = output.tradeoffs.iter().map(|it| curve_row(it, percent)).collect();
        }
        let fold_note = match folds.first() {
            None => "no edge turns by more than 120°".to_owned(),
            Some(&edge) => {
                let [a, b] = mesh.edge_vertices(edge).map(|v| mesh.position(v));
                let place = (a + b) / 2.0;
                format!(
                    "edges folded over, the first (edge {edge}) at ({:.3}, {:.3}, {:.3}) mm; coarsen more, or remesh the input there",
                    place.x, place.y, place.z
                )
            }
        };
        let curves = self.curves(&source.mesh, start, mesh);
        if let Some(jags) = Network::boundary(mesh).jaggedness(mesh) {
            table["boundary_jaggedness_deg"] = json!(jags.to_degrees());
        }
        for (key, bound, _) in &curves {
            table[format!("{key}_bound_pct")] = json!(bound * percent);
        }
        let held = curves.into_iter().filter(|it| it.2).fold(Section::default(), |section, (key, bound, _)| {
            let note = format!("largest distance between the {key} curves of result and input, proven; allow more, or let them go (develop.{key} = \"free\")");
            section.check(Check::at_most(&format!("develop.{key}"), bound, limit, "mm", note))
        });
        held.table("develop", table)
            .check(Check::at_most("develop.deviation", deviation.bound, limit, "mm", deviation_note(&deviation)))
            .check(Check::at_most("develop.folds", folds.len() as f64, 0.0, "edges", fold_note))
            .check(Check::at_most(
                "develop.self_intersections",
                crossings.made.len() as f64,
                0.0,
                "pairs",
                crossings_note(&crossings, mesh),
            ))
    }
}

impl Develop {
    /// Per kind of curve (boundary, features): its key, the proven distance between those of result and source, mm, and
    /// whether it was to be held.
    fn curves(&self, source: &TriMesh, start: &TriMesh, result: &TriMesh) -> Vec<(&'static str, f64, bool)> {
        let mut found = Vec::new();
        let mut compare = |key, of_source: &Network, of_result: &Network, held| {
            let bounds = of_source.distance(source, (of_result, result), 0.01, &Monitor::silent());
            found.extend(bounds.ok().flatten().map(|it| (key, it.upper, held)));
        };
        let hold = self.boundary == CurveRule::Hold;
        compare("boundary", &Network::boundary(source), &Network::boundary(result), hold);
        if self.features == CurveRule::Hold {
            let angle = self.feature_angle.radians;
            // Creases of the result are those of the start, however flat they have become.
            let mut at = (Network::features(start, angle), start.clone());
            while at.1.face_count() < result.face_count() {
                let Ok(fine) = subdivide(&at.1) else { break };
                at = (at.0.subdivided(&at.1), fine);
            }
            if at.1.face_count() == result.face_count() {
                compare("features", &Network::features(source, angle), &at.0, true);
            }
        }
        found
    }
}

/// What a result costs.
fn tradeoff(source: &TriMesh, result: &DevelopableMesh) -> Tradeoff {
    Tradeoff {
        max_deviation: result.max_deviation,
        energy: result.energy.iter().sum(),
        seam_length: seam_length(result, SEAM_ENERGY),
        bound: Deviation::between(source, &result.mesh, result.max_deviation).bound,
    }
}

/// The same for the report; `percent` turns mm into percent of the source's diagonal.
fn curve_row(it: &Tradeoff, percent: f64) -> serde_json::Value {
    json!({
        "max_deviation_pct": it.max_deviation * percent,
        "hausdorff_bound_pct": it.bound * percent,
        "covariance_energy": it.energy,
        "seam_length_rel": it.seam_length * percent / 100.0,
    })
}

fn round(it: &Round) -> serde_json::Value {
    json!({
        "energy": it.energy,
        "vertices": it.vertices,
        "faces": it.faces,
        "energy_start": it.energy_start,
        "energy_end": it.energy_end,
        "gradient_norm": it.gradient_norm,
        "iterations": it.iterations,
        "evaluations": it.evaluations,
        "seconds": it.seconds,
        "stopped": it.stopped,
        "level": it.level,
        "correction": it.correction,
    })
}

/// Where the surfaces are farther apart than promised.
fn deviation_note(deviation: &Deviation) -> String {
    match deviation.worst {
        None => "proven for every point of both surfaces, not sampled".into(),
        Some((worst, on_result)) => format!(
            "worst at ({:.3}, {:.3}, {:.3}) mm, face {} of the {}; allow more, or start from a finer mesh (coarsen.faces, develop.levels)",
            worst.point.x,
            worst.point.y,
            worst.point.z,
            worst.face,
            if on_result { "result" } else { "input" }
        ),
    }
}

/// Where the result passes through itself and the input does not.
fn crossings_note(crossings: &Crossings, mesh: &TriMesh) -> String {
    let Some(first) = crossings.made.first() else {
        return match crossings.of_result {
            0 => "no two faces intersect".into(),
            count => format!("{count} pairs of faces intersect, all where the input passes through itself"),
        };
    };
    let ([f, g], place) = (first.faces, first.place());
    let size = mesh.face_vertices(f).iter().filter(|v| mesh.face_vertices(g).contains(v)).count();
    format!(
        "pairs of faces that intersect where the input does not, the first (faces {f} and {g}, {}) at ({:.3}, {:.3}, {:.3}) mm; allow less deviation (develop.max_deviation), or coarsen less there",
        ["apart in the mesh", "with a common vertex", "with a common edge", "with the same corners"][size],
        place.x,
        place.y,
        place.z
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(text: &str) -> Result<Develop, String> {
        let stage: Develop = toml::from_str(text).map_err(|it| it.to_string())?;
        stage.check().map_err(|it| it.to_string())?;
        Ok(stage)
    }

    #[test]
    fn defaults_survive_a_round_trip() {
        assert_eq!(table("").unwrap(), Develop::default());
        let text = toml::to_string(&Develop::default()).unwrap();
        assert_eq!(table(&text).unwrap(), Develop::default());
        assert_eq!(table("levels = 2").unwrap().levels, Levels::Count(2));
        let text =
            "[[round]]\nlevel = 0\nnumber = 2\nenergy = \"combinatorial\"\nmax_deviation = \"50 %\"\nhold = 0.5\n";
        let stage = table(text).unwrap();
        let it = stage.round[0].resolve(30.0);
        assert_eq!((it.level, it.round, it.max_deviation, it.hold), (Some(0), Some(1), Some(15.0), Some(0.5)));
        assert_eq!(it.energy.map(|it| it.name), Some("combinatorial"));
        assert_eq!(table(&toml::to_string(&stage).unwrap()).unwrap(), stage);
    }

    #[test]
    fn bad_values_are_refused_with_the_key() {
        for (text, part) in [
            ("energy = \"willmore\"", "`energy` must be one of covariance"),
            ("max_deviation = 0", "`max_deviation`"),
            ("max_deviation = \"0 %\"", "`max_deviation`"),
            ("levels = \"many\"", "\"auto\""),
            ("levels = -1", "\"auto\""),
            ("levels = 20", "`levels`"),
            ("rounds = 0", "`rounds`"),
            ("iterations = 0", "`iterations`"),
            ("optimizer = \"newton\"", "`levenberg`"),
            ("curve = [\"1 %\", 0]", "`curve`"),
            ("[[round]]\nenergy = \"willmore\"", "`round.energy` must be one of"),
            ("[[round]]\nnumber = 0", "`round.number`"),
            ("[[round]]\nhold = -1", "`round.hold`"),
            ("[[round]]\nrounds = 1", "rounds"),
            ("energy = \"intrinsic\"\noptimizer = \"levenberg\"", "write \"auto\""),
            ("features = \"fair\"", "`features`"),
            ("boundary = \"loose\"", "`hold`"),
            ("feature_angle = 0", "`feature_angle`"),
            ("facet = 0", "`facet`"),
            ("depth = 1", "depth"),
        ] {
            let error = table(text).unwrap_err();
            assert!(error.contains(part), "{text}: {error}");
        }
    }
}
