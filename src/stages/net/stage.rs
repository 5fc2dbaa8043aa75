//! The `[net]` and `[bend]` tables and their sections of the report.
use std::path::PathBuf;

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

pub use super::start::check_profile;
use super::{FEASIBLE, Family, Goals, Handle, NetError, StartError, Weights, bend, fit, laths, start, verify};
use crate::{
    geom::Vec3,
    mesh::{
        Bvh,
        distance::{SurfaceDistance, sample},
    },
    model::{GeodesicNet, Guides, NetFit, SourceMesh},
    profile::{Angle, Length, Profiles},
    stage::{Check, Cx, Inputs, KeyError, Section, Stage},
};

/// Where a net begins and what it should become.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct NetStage {
    /// Profile of a surface of revolution around z: points [radius, height], or a file that holds them. Without it, and without
    /// `previous`, the net lies on the input.
    pub profile: Option<ProfileKey>,
    /// A net that an earlier run wrote (`model/net.obj` or `model/bent.obj`), to go on from.
    pub previous: Option<PathBuf>,
    /// Points along a geodesic.
    pub rows: usize,
    /// Number of geodesics.
    pub columns: usize,
    /// Angle around the axis that the net of a profile takes.
    pub sweep: Angle,
    /// Angle between geodesics and meridians of a profile, where it is narrowest.
    pub twist: Angle,
    /// A point of the input near which the middle geodesic begins; its centre when absent.
    pub center: Option<[f64; 3]>,
    /// Direction of the geodesics there; along the longest way over the input when absent.
    pub direction: Option<[f64; 3]>,
    /// Share of the input's width that the net takes; the shortest geodesic over that decides on its length.
    pub share: f64,
    /// Times that the net is subdivided and led to its constraints again.
    pub refine: usize,
    /// Weight of geodesic parallel coordinates.
    pub geodesic: WeightKey,
    /// Weight of edges of equal length along every geodesic.
    pub arc_length: WeightKey,
    /// Weight of edges of equal length along every line across: congruent strips.
    pub equal_width: WeightKey,
    /// Weight of widths in one ratio from row to row: isometric to a surface of revolution.
    pub ratio: WeightKey,
    /// Weight of strips whose width changes linearly: nearly developable. It needs `arc_length`, too.
    pub developable: WeightKey,
    /// Weight of all edges keeping the length that they have at first; when absent 0, but 0.01 for what is to be developable, as
    /// nothing else keeps such a net from shrinking to a point.
    pub isometry: Option<WeightKey>,
    /// Weight of staying on the surface; when absent 1, but 0 for a profile without a twist, whose net is exact.
    pub proximity: Option<WeightKey>,
    /// Weight of second differences.
    pub fairness: WeightKey,
    /// Iterations of the last phase, at most.
    pub iterations: usize,
    /// Angle of a second family of geodesics on the same patch against the first, for a gridshell of laths; none when absent.
    pub second: Option<Angle>,
    /// Width of the laths.
    pub lath: Length,
    /// Diameter of the holes at their crossings.
    pub hole: Length,
    /// Length of the bars that they are cut from.
    pub bar: Length,
}

/// A profile as it is written in the config.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(untagged, expecting = "profile must be a list of points [radius, height] or the name of a file")]
pub enum ProfileKey {
    /// Radii and heights.
    Points(Vec<[f64; 2]>),
    /// SVG, DXF, or a table of numbers.
    File(PathBuf),
}

/// A weight as it is written in the config.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(untagged, expecting = "a weight must be a number, or two between which it fades: [0.1, 0]")]
pub enum WeightKey {
    /// The same all the time.
    Constant(f64),
    /// From the first to the second.
    Fading([f64; 2]),
}

impl WeightKey {
    fn ends(self) -> [f64; 2] {
        match self {
            Self::Constant(it) => [it, it],
            Self::Fading(it) => it,
        }
    }
}

impl Default for NetStage {
    fn default() -> Self {
        let off = WeightKey::Constant(0.0);
        Self {
            profile: None,
            previous: None,
            rows: 31,
            columns: 21,
            sweep: Angle::degrees(180.0),
            twist: Angle::degrees(0.0),
            center: None,
            direction: None,
            share: 0.9,
            refine: 0,
            geodesic: WeightKey::Constant(1.0),
            arc_length: off,
            equal_width: off,
            ratio: off,
            developable: off,
            isometry: None,
            proximity: None,
            fairness: WeightKey::Fading([0.1, 1e-3]),
            iterations: 60,
            second: None,
            lath: Length::mm(40.0),
            hole: Length::mm(8.0),
            bar: Length::mm(3000.0),
        }
    }
}

/// Steps in which weights go from their beginning to their end.
const FADE: usize = 10;
/// Weights beyond this only spoil the arithmetic.
const HEAVIEST: f64 = 1000.0;
/// Points of a net whose distance from the input is measured.
const SAMPLES: usize = 50_000;
/// Largest deviation from a right angle of a net that was fitted, degrees.
const SQUARE: f64 = 1.0;

impl NetStage {
    fn proximity(&self) -> WeightKey {
        let exact = self.profile.is_some() && self.twist.radians == 0.0 && self.previous.is_none();
        self.proximity.unwrap_or(WeightKey::Constant(if exact { 0.0 } else { 1.0 }))
    }

    fn isometry(&self) -> WeightKey {
        let weak = if self.developable.ends()[1] > 0.0 { 0.01 } else { 0.0 };
        self.isometry.unwrap_or(WeightKey::Constant(weak))
    }

    fn weights(&self) -> [(&'static str, Family, WeightKey); 8] {
        [
            ("geodesic", Family::Geodesic, self.geodesic),
            ("arc_length", Family::ArcLength, self.arc_length),
            ("equal_width", Family::EqualWidth, self.equal_width),
            ("ratio", Family::Ratio, self.ratio),
            ("developable", Family::Developable, self.developable),
            ("isometry", Family::Isometry, self.isometry()),
            ("proximity", Family::Proximity, self.proximity()),
            ("fairness", Family::Fairness, self.fairness),
        ]
    }

    fn goals(&self) -> Goals {
        let mut ends: [Weights; 2] = [[0.0; Family::ALL.len()]; 2];
        for (_, family, weight) in self.weights() {
            let [from, to] = weight.ends();
            ends[0][family as usize] = from;
            ends[1][family as usize] = to;
        }
        let [start, end] = ends;
        Goals { start, end, travel: 0, fade: FADE, most: self.iterations }
    }

    fn layout(&self) -> start::Layout {
        let place = |it: [f64; 3]| Vec3::from(it);
        start::Layout {
            rows: self.rows,
            columns: self.columns,
            center: self.center.map(place),
            direction: self.direction.map(place),
            share: self.share,
        }
    }

    fn stock(&self) -> laths::Stock {
        laths::Stock { width: self.lath.mm, hole: self.hole.mm, length: self.bar.mm }
    }

    fn first(&self, source: &SourceMesh, guides: Option<&Guides>) -> Result<GeodesicNet, StartError> {
        let (rows, columns) = (self.rows, self.columns);
        if let Some(net) = guides.and_then(|it| it.net.as_ref()) {
            return Ok(net.clone());
        }
        match guides.map_or(&[][..], |it| &it.profile) {
            [] => start::on_patch(&source.mesh, &self.layout()),
            profile if self.twist.radians == 0.0 => start::of_revolution(profile, rows, columns, self.sweep.radians),
            profile => start::twisted(profile, rows, columns, self.sweep.radians, self.twist.radians),
        }
    }
}

impl Stage for NetStage {
    const NAME: &'static str = "net";
    const VERSION: u32 = 1;
    type Input = (SourceMesh, Option<Guides>);
    type Output = NetFit;
    type Profile = ();
    type Error = NetError;

    fn profile(_: &Profiles) {}

    fn check(&self) -> Result<(), KeyError> {
        KeyError::range("rows", self.rows as f64, 3.0, 2000.0)?;
        KeyError::range("columns", self.columns as f64, 3.0, 2000.0)?;
        KeyError::range("sweep", self.sweep.radians.to_degrees(), 1.0, 360.0)?;
        KeyError::range("twist", self.twist.radians.to_degrees(), 0.0, 85.0)?;
        KeyError::range("share", self.share, 0.01, 1.0)?;
        KeyError::range("refine", self.refine as f64, 0.0, 5.0)?;
        KeyError::range("iterations", self.iterations as f64, 1.0, 10_000.0)?;
        KeyError::range("lath", self.lath.mm, 1.0, 1000.0)?;
        KeyError::range("hole", self.hole.mm, 0.1, self.lath.mm)?;
        KeyError::range("bar", self.bar.mm, 1.0, 1e6)?;
        if let Some(angle) = self.second {
            KeyError::range("second", angle.radians.to_degrees(), 10.0, 170.0)?;
        }
        for (key, _, weight) in self.weights() {
            weight.ends().into_iter().try_for_each(|it| KeyError::range(key, it, 0.0, HEAVIEST))?;
        }
        Ok(())
    }

    fn run(&self, (source, guides): (&SourceMesh, Option<&Guides>), (): &(), cx: &Cx) -> Result<NetFit, NetError> {
        let (goals, surface) = (self.goals(), Bvh::new(&source.mesh));
        let made = fit(&self.first(source, guides)?, &goals, &surface, self.refine, &cx.monitor)?;
        let Some(angle) = self.second else { return Ok(made) };
        let layout = laths::across(&made.net, &self.layout(), angle.radians);
        let second = fit(&start::on_patch(&source.mesh, &layout)?, &goals, &surface, self.refine, &cx.monitor)?.net;
        let laths = laths::laths(&made.net, &second, &self.stock());
        let drawings = laths.iter().map(|it| laths::drawing(it, &self.stock())).collect();
        Ok(NetFit { second: Some(second), laths, drawings, ..made })
    }

    fn section(&self, (source, guides): <Self::Input as Inputs>::Refs<'_>, (): &(), made: &NetFit) -> Section {
        let net = &made.net;
        let angles = verify::angles(net);
        let surface = Bvh::new(&source.mesh);
        let diagonal = source.mesh.bounds().diagonal();
        let off = surface.closest_all(&net.points).iter().map(|it| it.distance).fold(0.0, f64::max);
        let meshed = net.mesh().ok();
        let apart = meshed.as_ref().map(|it| SurfaceDistance::between(it, &source.mesh).hausdorff);
        let samples = meshed.map(|it| sample(&it, SAMPLES).iter().map(|p| p.position(&it)).collect::<Vec<_>>());
        let covered = samples.map(|it| surface.closest_all(&it).iter().map(|it| it.distance).fold(off, f64::max));
        let mut table = numbers(made);
        table["rows"] = json!(net.rows);
        table["columns"] = json!(net.columns);
        table["orthogonality_max_deg"] = json!(angles.orthogonality.to_degrees());
        table["geodesic_max_deg"] = json!(angles.geodesic.to_degrees());
        table["points_off_pct"] = json!(100.0 * off / diagonal);
        for (key, it) in [("hausdorff_pct", apart), ("hausdorff_covered_pct", covered)] {
            if let Some(it) = it {
                table[key] = json!(100.0 * it / diagonal);
            }
        }
        if self.twist.radians > 0.0 && guides.is_some_and(|it| !it.profile.is_empty()) {
            table["clairaut"] = clairaut(net);
        }
        if !made.laths.is_empty() {
            table["laths"] = laths_table(made);
        }
        let note = "largest deviation of the lines from a right angle; more rows and columns, or less of the other constraints, bring it down";
        let mut out = Section::new(Self::NAME, table).check(Check::at_most(
            "net.orthogonality",
            angles.orthogonality.to_degrees(),
            SQUARE,
            "°",
            note,
        ));
        if !made.laths.is_empty() {
            let long: Vec<&str> = made.laths.iter().filter(|it| it.bar.is_none()).map(|it| it.name.as_str()).collect();
            let note = format!("longer than a bar: {}", long.join(", "));
            out = out.check(Check::at_most(
                "net.laths",
                long.len() as f64,
                0.0,
                "laths",
                if long.is_empty() { String::new() } else { note },
            ));
        }
        // On a surface that it must stay on a net is as good as that allows; off it, its constraints can be met.
        if self.proximity().ends()[1] == 0.0 && self.fairness.ends()[1] == 0.0 {
            let note =
                "all constraints of the net; fewer of them, more rows and columns, or more iterations bring it down";
            out = out.check(Check::at_most("net.residual", made.residual, FEASIBLE, "R", note));
        }
        out
    }
}

fn numbers(made: &NetFit) -> Value {
    json!({
        "residual": made.residual,
        "iterations": made.iterations,
        "seconds_per_iteration": made.seconds / made.iterations.max(1) as f64,
    })
}

fn laths_table(made: &NetFit) -> Value {
    let crossings = || made.laths.iter().flat_map(|it| &it.crossings);
    json!({
        "count": made.laths.len(),
        "length_mm": made.laths.iter().map(|it| it.length).sum::<f64>(),
        "longest_mm": made.laths.iter().map(|it| it.length).fold(0.0, f64::max),
        "bars": made.laths.iter().filter_map(|it| Some(it.bar?.0 + 1)).max().unwrap_or(0),
        "crossings": crossings().count() / 2,
        "largest_gap_mm": crossings().map(|it| it.gap).fold(0.0, f64::max),
    })
}

/// Clairaut's relation along the geodesics of a net around z.
fn clairaut(net: &GeodesicNet) -> Value {
    let lines = verify::clairaut(net, Vec3::zeros(), Vec3::z());
    let worst = lines.iter().map(|it| it.deviation).fold(0.0, f64::max);
    let mean = lines.iter().map(|it| it.mean).sum::<f64>() / lines.len().max(1) as f64;
    json!({ "mean_mm": mean, "max_mad_mm": worst })
}

/// How a net is bent by handles, its edges and angles kept.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BendStage {
    /// Points that are held or moved; none leave the net as it is.
    pub handles: Vec<HandleKey>,
    /// Steps in which handles travel to their targets, to begin with.
    pub steps: usize,
    /// Weight of second differences that fades to nothing once handles have arrived; it smooths what the way left.
    pub fairness: f64,
    /// Iterations of the last phase, at most.
    pub iterations: usize,
}

impl Default for BendStage {
    fn default() -> Self {
        Self { handles: vec![], steps: 20, fairness: 0.03, iterations: 300 }
    }
}

/// A handle, as it is written in the config.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HandleKey {
    /// Row and column of the point, from 0; or `near`.
    pub at: Option<[usize; 2]>,
    /// The point of the net nearest to this place.
    pub near: Option<[f64; 3]>,
    /// How far it is moved, mm; it is held where neither this nor `to` nor `path` is given.
    pub by: Option<[f64; 3]>,
    /// Where it is moved, mm.
    pub to: Option<[f64; 3]>,
    /// Places that it passes, mm, the last of which is its target.
    pub path: Option<Vec<[f64; 3]>>,
}

impl HandleKey {
    fn on(&self, net: &GeodesicNet) -> Handle {
        let distance = |k: usize, p: [f64; 3]| (net.points[k] - Vec3::from(p)).norm_squared();
        let nearest = |p: [f64; 3]| {
            (0..net.points.len()).min_by(|&a, &b| distance(a, p).total_cmp(&distance(b, p))).unwrap_or_default()
        };
        let k = self.near.map_or(0, nearest);
        let at = self.at.unwrap_or([k / net.columns, k % net.columns]);
        let here = net.points.get(net.index(at[0], at[1])).copied().unwrap_or_default();
        let path = match (&self.path, self.to, self.by) {
            (Some(path), ..) => path.iter().copied().map(Vec3::from).collect(),
            (None, Some(to), _) => vec![Vec3::from(to)],
            (None, None, by) => vec![here + by.map_or(Vec3::zeros(), Vec3::from)],
        };
        Handle { at, path }
    }

    /// What is wrong with it.
    fn fault(&self) -> Option<&'static str> {
        let numbers = [self.near, self.by, self.to].into_iter().flatten().chain(self.path.iter().flatten().copied());
        let ways = [self.by.is_some(), self.to.is_some(), self.path.is_some()];
        match () {
            () if self.at.is_some() == self.near.is_some() => Some("needs either `at` or `near`"),
            () if ways.into_iter().filter(|it| *it).count() > 1 => Some("may have one of `by`, `to` and `path`"),
            () if self.path.as_ref().is_some_and(Vec::is_empty) => Some("has an empty path"),
            () if numbers.flatten().any(|it| !it.is_finite()) => Some("has a coordinate that is no number"),
            () => None,
        }
    }
}

/// How far a handle may be off, mm.
const REACHED: f64 = 1e-3;

impl Stage for BendStage {
    const NAME: &'static str = "bend";
    const VERSION: u32 = 1;
    type Input = NetFit;
    type Output = NetFit;
    type Profile = ();
    type Error = NetError;

    fn profile(_: &Profiles) {}

    fn check(&self) -> Result<(), KeyError> {
        KeyError::range("steps", self.steps as f64, 1.0, 10_000.0)?;
        KeyError::range("fairness", self.fairness, 0.0, HEAVIEST)?;
        KeyError::range("iterations", self.iterations as f64, 1.0, 10_000.0)?;
        match self.handles.iter().enumerate().find_map(|(k, it)| Some((k, it.fault()?))) {
            Some((k, fault)) => Err(KeyError { key: "handles", message: format!(": handle {k} {fault}") }),
            None => Ok(()),
        }
    }

    fn run(&self, before: &NetFit, (): &(), cx: &Cx) -> Result<NetFit, NetError> {
        if self.handles.is_empty() {
            return Ok(before.clone());
        }
        let handles: Vec<Handle> = self.handles.iter().map(|it| it.on(&before.net)).collect();
        bend(&before.net, &handles, self.steps, self.fairness, self.iterations, &cx.monitor)
    }

    fn section(&self, _: &NetFit, (): &(), made: &NetFit) -> Section {
        let Some(reference) = &made.reference else { return Section::default() };
        let strain = made.strain.iter().copied().fold(0.0, f64::max);
        let mut triangles = verify::triangle_strains(reference, &made.net);
        triangles.sort_by(f64::total_cmp);
        let missed: Vec<_> = made.missed.iter().map(|it| json!({ "handle": it.0, "off_mm": it.1 })).collect();
        let mut table = numbers(made);
        table["max_strain"] = json!(strain);
        table["max_triangle_strain"] = json!(triangles.last());
        table["p99_triangle_strain"] = json!(triangles.get(triangles.len() * 99 / 100));
        table["turned_deg"] = json!(verify::turned(reference, &made.net).to_degrees());
        table["missed"] = json!(missed);
        let worst = made.missed.first().map_or(0.0, |it| it.1);
        let names: Vec<String> = made.missed.iter().map(|it| format!("{} ({:.3} mm)", it.0, it.1)).collect();
        let note = match names.is_empty() {
            true => "every handle is where it should be".to_owned(),
            false => format!(
                "handles {} fight with each other or with the lengths of the net; the result is near to what they want. Move them by less, or hold fewer points",
                names.join(", ")
            ),
        };
        Section::new(Self::NAME, table)
            .check(Check::at_most(
                "bend.residual",
                made.residual,
                FEASIBLE,
                "R",
                "lengths of edges and angles of quads",
            ))
            .check(Check::at_most("bend.handles", worst, REACHED, "mm", note))
    }
}
