//! The `[stripes]` table and its section of the report.
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::{Along, Laid, Options, Spot, StripesError, cut_along, stripes};
use crate::{
    geom::Vec3,
    mesh::{Field, TriMesh},
    model::{DevelopableMesh, Guides, StripeEnd, Stripes},
    profile::{Angle, Length, Profiles},
    stage::{Check, Cx, Inputs, KeyError, Section, Stage},
};

/// `even_steps` along a vector field where nothing is said.
const EVEN_STEPS: usize = 10;
/// Share of the spacing that was asked for by which the mean distance of the lines may miss it.
const SPACING_OFF: f64 = 0.25;

/// Lines at a spacing along a field.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct StripesStage {
    /// 1 for a vector field; 2 for a line field, which may have half turns: `singularities` are then faces only, and how many
    /// lines end there.
    pub symmetry: i32,
    /// The field; lines run across it.
    pub field: FieldKey,
    /// Direction of `field = "axis"`, in the coordinates of the input.
    pub axis: [f64; 3],
    /// Points, mm, away from which `field = "distance"` points; without any, one tip of the surface.
    pub from: Vec<[f64; 3]>,
    /// How much curvature counts against smoothness in `field = "curvature-…"`.
    pub curvature_strength: f64,
    /// Whether angles are those of the intrinsic Delaunay triangulation, for meshes with slivers.
    pub intrinsic_delaunay: bool,
    /// Angle by which the field is turned; 90 lets the lines run along it.
    pub angle: Angle,
    /// Points, or curves, with the direction that the field should have there.
    pub guides: Vec<GuideTable>,
    /// Singularities of the field itself, which must sum to the Euler characteristic; the field is then the one that turns
    /// least, and the first guide gives its direction.
    pub field_singularities: Vec<SingularityTable>,
    /// Distance of the lines.
    pub spacing: Length,
    /// Where lines begin (index > 0) and end (index < 0); they must sum to 0.
    pub singularities: Vec<SingularityTable>,
    /// Lines that wind around handles.
    pub generators: Vec<GeneratorTable>,
    /// At most so many pairs of a beginning and an end are added where they make the spacing more even.
    pub budget: usize,
    /// Share of the misfit that each pair of the budget must save.
    pub least_gain: f64,
    /// How often the lines are spaced out anew at the distance that was asked for, so that they follow the field less and their
    /// spacing more; 10 without it, and none along a line field, which knows no such steps.
    pub even_steps: Option<usize>,
    /// Whether singularities are added at the tips of the surface until rings have become one path from tip to tip and one strip
    /// is left, to be zipped up along it. It works best with rings about every limb: `field = "distance"`.
    pub one_strip: bool,
    /// Points, mm, near which lines start: an open one at its nearer end (otherwise it runs from where it begins to where it
    /// ends), a closed one at its nearest point.
    pub starts: Vec<[f64; 3]>,
    /// Whether the surface is cut into strips; otherwise the lines are engraved on the pieces.
    pub cut: bool,
}

impl Default for StripesStage {
    fn default() -> Self {
        Self {
            symmetry: 1,
            field: FieldKey::Smoothest,
            axis: [0.0, 1.0, 0.0],
            from: Vec::new(),
            curvature_strength: 0.1,
            intrinsic_delaunay: false,
            angle: Angle::degrees(0.0),
            guides: Vec::new(),
            field_singularities: Vec::new(),
            spacing: Length::mm(10.0),
            singularities: Vec::new(),
            generators: Vec::new(),
            budget: 0,
            least_gain: 0.005,
            even_steps: None,
            one_strip: false,
            starts: Vec::new(),
            cut: true,
        }
    }
}

/// The field, as it is written in the config.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FieldKey {
    /// The smoothest field there is.
    Smoothest,
    /// Along the largest curvature.
    CurvatureMost,
    /// Along the least curvature.
    CurvatureLeast,
    /// Along `axis`, so that the lines are rings about it.
    Axis,
    /// Away from the points `from` along the surface, so that the lines are rings at one distance about every limb.
    Distance,
    /// Along the boundary.
    Boundary,
    /// The guides alone.
    Guides,
}

/// One of `[[stripes.singularities]]`, by exactly one of its first three keys.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SingularityTable {
    /// A face of the mesh, counted from 0.
    pub face: Option<usize>,
    /// The face nearest to a point, mm.
    pub at: Option<[f64; 3]>,
    /// A boundary loop, counted from 0.
    pub boundary: Option<usize>,
    /// How many lines begin there; how often the field turns there.
    pub index: i32,
}

impl SingularityTable {
    fn spot(&self) -> Option<Spot> {
        match (self.face, self.at, self.boundary) {
            (Some(face), None, None) => Some(Spot::Face(face)),
            (None, Some(at), None) => Some(Spot::Near(Vec3::from(at))),
            (None, None, Some(path)) => Some(Spot::Loop(path)),
            _ => None,
        }
    }
}

/// One of `[[stripes.generators]]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GeneratorTable {
    /// Which, counted from 0; there are two per handle.
    pub number: usize,
    /// How many lines cross its loop, with a sign.
    pub index: i32,
}

/// One of `[[stripes.guides]]`: a point with a direction, or a curve that the field follows.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct GuideTable {
    /// A point, mm.
    pub at: Option<[f64; 3]>,
    /// The direction there.
    pub direction: Option<[f64; 3]>,
    /// Points of a curve, mm.
    pub along: Vec<[f64; 3]>,
}

impl GuideTable {
    /// Points with directions.
    fn points(&self) -> Vec<(Vec3, Vec3)> {
        let given = self.at.zip(self.direction).map(|(at, direction)| (Vec3::from(at), Vec3::from(direction)));
        let step = |pair: &[[f64; 3]]| {
            let [a, b] = [Vec3::from(pair[0]), Vec3::from(pair[1])];
            [(a, b - a), (b, b - a)]
        };
        given.into_iter().chain(self.along.windows(2).flat_map(step)).collect()
    }
}

impl StripesStage {
    fn options(&self) -> Options {
        let curvature = |least| Along::Curvature { least, strength: self.curvature_strength };
        let points = |list: &[[f64; 3]]| list.iter().map(|&it| Vec3::from(it)).collect();
        let spots = |tables: &[SingularityTable]| tables.iter().filter_map(|it| Some((it.spot()?, it.index))).collect();
        Options {
            symmetry: self.symmetry,
            along: match self.field {
                FieldKey::Smoothest => Along::Smoothest,
                FieldKey::CurvatureMost => curvature(false),
                FieldKey::CurvatureLeast => curvature(true),
                FieldKey::Axis => Along::Axis(Vec3::from(self.axis)),
                FieldKey::Distance => Along::Distance(points(&self.from)),
                FieldKey::Boundary => Along::Boundary,
                FieldKey::Guides => Along::Guides,
            },
            delaunay: self.intrinsic_delaunay,
            turn: self.angle.radians,
            guides: self.guides.iter().flat_map(GuideTable::points).collect(),
            field_singularities: spots(&self.field_singularities),
            spacing: self.spacing.mm,
            singularities: spots(&self.singularities),
            generators: self.generators.iter().map(|it| (it.number, it.index)).collect(),
            budget: self.budget,
            least_gain: self.least_gain,
            join: self.one_strip,
            even: self.even_steps.unwrap_or(if self.symmetry == 1 { EVEN_STEPS } else { 0 }),
            starts: points(&self.starts),
        }
    }
}

impl Stage for StripesStage {
    const NAME: &'static str = "stripes";
    const VERSION: u32 = 4;
    type Input = (TriMesh, crate::model::SourceMesh, Option<DevelopableMesh>, Option<Guides>);
    type Output = (DevelopableMesh, Guides, Stripes);
    type Profile = ();
    type Error = StripesError;

    fn profile(_: &Profiles) {}

    fn check(&self) -> Result<(), KeyError> {
        KeyError::range("symmetry", f64::from(self.symmetry), 1.0, 2.0)?;
        KeyError::range("spacing", self.spacing.mm, 1e-3, 1e5)?;
        KeyError::range("curvature_strength", self.curvature_strength, 1e-6, 1e6)?;
        KeyError::range("least_gain", self.least_gain, 0.0, 1.0)?;
        KeyError::range("budget", self.budget as f64, 0.0, 1e4)?;
        KeyError::range("even_steps", self.even_steps.unwrap_or(0) as f64, 0.0, 1e3)?;
        let vague = |key, message: &str| Err(KeyError { key, message: message.into() });
        if !Vec3::from(self.axis).norm().is_normal() {
            return vague("axis", "must be a direction such as [0, 1, 0]");
        }
        for (key, tables) in
            [("singularities", &self.singularities), ("field_singularities", &self.field_singularities)]
        {
            if tables.iter().any(|it| it.spot().is_none()) {
                return vague(key, "need exactly one of `face`, `at` and `boundary` in each table");
            }
        }
        if self.guides.iter().any(|it| it.points().is_empty()) {
            return vague("guides", "need `at` and `direction`, or two points or more in `along`");
        }
        if self.field == FieldKey::Guides && self.guides.is_empty() {
            return vague("guides", "must be given for field = \"guides\"");
        }
        Ok(())
    }

    fn run(
        &self,
        (mesh, _, developed, guides): <Self::Input as Inputs>::Refs<'_>,
        (): &(),
        cx: &Cx,
    ) -> Result<Self::Output, StripesError> {
        let mesh = developed.map_or(mesh, |it| &it.mesh);
        let Laid { stripes: mut found, crossings, mesh: lined } = stripes(mesh, &self.options(), &cx.monitor)?;
        let energy = |count: usize| Field::filled(count, 0.0);
        let whole = || DevelopableMesh {
            mesh: mesh.clone(),
            energy: energy(mesh.vertex_count()),
            max_deviation: 0.0,
            rounds: Vec::new(),
            tradeoffs: Vec::new(),
        };
        let mut guides = guides.cloned().unwrap_or_default();
        let mut developed = developed.map_or_else(whole, Clone::clone);
        if self.cut {
            let (split, edges, parts) = cut_along(lined.as_ref().unwrap_or(mesh), &crossings)?;
            // The surface is the same; only vertices were added.
            let mut values = developed.energy.into_vec();
            values.resize(split.vertex_count(), 0.0);
            developed = DevelopableMesh { mesh: split, energy: Field::from_vec(values), ..developed };
            guides.edges.extend(edges);
            found.drawn = false;
            found.parts = parts;
        }
        Ok((developed, guides, found))
    }

    fn section(&self, _: <Self::Input as Inputs>::Refs<'_>, (): &(), output: &Self::Output) -> Section {
        let (_, _, it) = output;
        let list = |ends: &[StripeEnd]| -> Vec<Value> {
            let place = |p: Vec3| [p.x, p.y, p.z];
            ends.iter().map(|it| json!({ "face": it.face.0, "at_mm": place(it.place), "index": it.index })).collect()
        };
        let [min, max, mean, std] = it.spacing;
        let [loops, generators] = &it.windings;
        let lengths: Vec<f64> = it.lines.iter().map(crate::model::StripeLine::length).collect();
        let inner: usize = it.lines.iter().map(|it| it.inner_ends).sum();
        let table = json!({
            "faces": it.faces,
            "prescribed": list(&it.prescribed),
            "found": list(&it.found),
            "field_singularities": it.field_singularities,
            "boundary_indices": loops,
            "generator_indices": generators,
            "period_error": it.period_error,
            "energy": it.energy[1],
            "energy_without_pairs": it.energy[0],
            "factor_ms": 1e3 * it.seconds[0],
            "edit_ms": 1e3 * it.seconds[1],
            "lines": it.lines.len(),
            "closed_lines": it.lines.iter().filter(|it| it.closed).count(),
            "components": it.components,
            "open_ends": inner,
            "parts": it.parts,
            "closed_ways": it.web.cycles,
            "gaps": it.web.gaps,
            "branches": it.web.branches,
            "line_length_mm": lengths.iter().sum::<f64>(),
            "longest_line_mm": lengths.iter().copied().fold(0.0, f64::max),
            "spacing_mm": { "min": min, "max": max, "mean": mean, "std": std },
        });
        // Along a line field the sign of an index depends on the sheet.
        let index = |it: &StripeEnd| if self.symmetry == 1 { it.index } else { it.index.abs() };
        let differs = |(a, b): &(&StripeEnd, &StripeEnd)| (a.face, index(a)) != (b.face, index(b));
        let wrong =
            it.found.len().abs_diff(it.prescribed.len()) + it.found.iter().zip(&it.prescribed).filter(differs).count();
        let section = Section::new("stripes", table)
            .check(Check::at_most("stripes.singularities", wrong as f64, 0.0, "singularities not as prescribed", ""))
            .check(Check::at_most("stripes.periods", it.period_error, 1e-9, "rad", ""));
        let off = if it.lines.is_empty() { 0.0 } else { (mean / self.spacing.mm - 1.0).abs() };
        let note = format!(
            "{mean:.2} mm apart on average; take more even_steps, a budget of singularities, or field = \"distance\""
        );
        let section = section.check(Check::at_most(
            "stripes.spacing",
            off,
            SPACING_OFF,
            "of the spacing that was asked for",
            note,
        ));
        if !self.one_strip {
            return section;
        }
        section.check(one_strip(it))
    }
}

/// Whether no line parts the surface, and how the strip closes.
fn one_strip(it: &Stripes) -> Check {
    // What is cut tells for certain; lines only drawn are counted.
    let parting = if it.drawn { it.web.cycles } else { it.parts.saturating_sub(1) };
    let web = if it.web.is_path() {
        "the lines are one path: one zipper closes the strip".into()
    } else {
        let (gaps, branches) = (it.web.gaps, it.web.branches);
        format!(
            "{gaps} gaps between the lines and {branches} branches: the strip needs as many cuts across and more zippers"
        )
    };
    let note = match parting {
        0 => web,
        _ => "take field = \"distance\" or a wider spacing, set intrinsic_delaunay = true where the mesh has slivers, or list the ends of the lines in stripes.singularities"
            .into(),
    };
    Check::at_most("stripes.one_strip", parting as f64, 0.0, "parts too many", note)
}
