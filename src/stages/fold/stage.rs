//! The `[fold]` table and its section of the report.
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::{
    FoldError, Options, Resolution, fold,
    motion::{Motion, Pull},
    pieces, solve,
};
use crate::{
    geom::Vec2,
    mesh::{Bvh, Field, Id, TriMesh, VertexId, intersections::self_intersections},
    model::{CreasePattern, CutMesh, Flattening, FoldSample, Folded, FoldedCrease, Piece, PieceId, SourceMesh},
    profile::{Angle, Length, Profiles},
    stage::{Check, Cx, KeyError, Section, Stage},
};

/// How a crease pattern is folded. Places on the paper are mm from its lower left corner.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FoldStage {
    /// About how many vertices the nets have.
    pub vertices: usize,
    /// Edge of the nets, instead of a number of vertices.
    pub edge: Option<Length>,
    /// A motion by name; `lift-corners` where nothing else pulls.
    pub motion: Option<MotionKey>,
    /// Size of the motion, 1 for the usual one.
    pub amount: f64,
    /// Points of the paper that go somewhere.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub handle: Vec<HandleRow>,
    /// Points of the paper that meet.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub close: Vec<CloseRow>,
    /// Angles that creases are folded by.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub angle: Vec<AngleRow>,
    /// Whether mountain and valley are found, or taken from the drawing where it has them.
    pub assignment: AssignmentKey,
    /// Creases are held at least so far folded at the end of the way.
    pub least_fold: Angle,
    /// Steps on the way from flat to folded.
    pub frames: usize,
    /// Iterations of the solver at every step.
    pub iterations: usize,
    /// Most iterations at the end.
    pub settle: usize,
    /// Steps on the way that are written.
    pub kept_frames: usize,
    /// Largest stretch of an edge of the nets.
    pub stretch: f64,
}

/// Motions by name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum MotionKey {
    /// The four corners are lifted and drawn together along x.
    LiftCorners,
    /// The ends on the left and on the right are lifted, those at the top and at the bottom lowered.
    Saddle,
    /// The left edge and the right edge are drawn together.
    Pinch,
    /// The left edge is closed onto the right one.
    Close,
}

/// Where mountain and valley come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum AssignmentKey {
    /// Folding finds them.
    Found,
    /// The drawing says them where it does.
    Drawn,
}

/// A handle.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HandleRow {
    /// On the paper, mm.
    pub at: [f64; 2],
    /// In space, mm; the paper lies in z = 0.
    pub to: [f64; 3],
    /// Axes that are left free, of "xyz".
    #[serde(default)]
    pub free: Free,
}

/// Axes that are left free.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Free {
    /// None.
    #[default]
    None,
    /// Along the paper.
    X,
    /// Across the paper.
    Y,
    /// Up.
    Z,
    /// In the plane of the paper.
    Xy,
}

/// Two points of the paper that meet.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CloseRow {
    /// On the paper, mm.
    pub ends: [[f64; 2]; 2],
}

/// An angle that a crease is folded by.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AngleRow {
    /// On the paper near the crease, mm.
    pub at: [f64; 2],
    /// 0 is flat, degrees.
    pub angle: Angle,
}

impl Default for FoldStage {
    fn default() -> Self {
        Self {
            vertices: 600,
            edge: None,
            motion: None,
            amount: 1.0,
            handle: Vec::new(),
            close: Vec::new(),
            angle: Vec::new(),
            assignment: AssignmentKey::Found,
            least_fold: Angle::degrees(15.0),
            frames: 20,
            iterations: 5,
            settle: 400,
            kept_frames: 6,
            stretch: 0.004,
        }
    }
}

/// Largest miss of a handle, as a share of the diagonal of the paper.
const HANDLE_LIMIT: f64 = 0.01;
/// Most crease points that may be left out, as a share.
const EXCLUDED: f64 = 0.1;
/// Stretch that the mean edge may have.
const STRETCH_MEAN: f64 = 0.003;
/// Gaps along creases, mean and largest, in mean edges.
const CONTINUITY: [f64; 2] = solve::Options::PAPER.continuity_limits;
/// Largest difference of the cosines of angles at a vertex.
const RESIDUAL: f64 = 1e-8;

impl Stage for FoldStage {
    const NAME: &'static str = "fold";
    const VERSION: u32 = 2;
    type Input = (SourceMesh, CreasePattern);
    type Output = (CutMesh, Flattening, Folded);
    type Profile = ();
    type Error = FoldError;

    fn profile(_: &Profiles) {}

    fn check(&self) -> Result<(), KeyError> {
        KeyError::range("vertices", self.vertices as f64, 50.0, 50_000.0)?;
        if let Some(edge) = self.edge {
            KeyError::range("edge", edge.mm, 0.01, 1e4)?;
        }
        KeyError::range("amount", self.amount, 0.01, 10.0)?;
        KeyError::range("least_fold", self.least_fold.radians.to_degrees(), 0.0, 80.0)?;
        KeyError::range("frames", self.frames as f64, 1.0, 10_000.0)?;
        KeyError::range("iterations", self.iterations as f64, 1.0, 1000.0)?;
        KeyError::range("settle", self.settle as f64, 1.0, 100_000.0)?;
        KeyError::range("kept_frames", self.kept_frames as f64, 1.0, 1000.0)?;
        KeyError::range("stretch", self.stretch, 1e-6, 0.1)?;
        let finite = |values: &[f64]| values.iter().all(|it| it.is_finite());
        let refuse = |key| Err(KeyError { key, message: "must hold finite numbers".into() });
        if !self.handle.iter().all(|it| finite(&it.at) && finite(&it.to)) {
            return refuse("handle");
        }
        if !self.close.iter().all(|it| finite(it.ends.as_flattened())) {
            return refuse("close");
        }
        if self.angle.iter().all(|it| finite(&it.at)) { Ok(()) } else { refuse("angle") }
    }

    fn run(
        &self,
        (source, pattern): (&SourceMesh, &CreasePattern),
        (): &(),
        cx: &Cx,
    ) -> Result<(CutMesh, Flattening, Folded), FoldError> {
        let sides = match self.assignment {
            AssignmentKey::Found => Vec::new(),
            AssignmentKey::Drawn => pattern.creases.iter().map(|it| it.drawn_side()).collect(),
        };
        let options = Options {
            resolution: self.edge.map_or(Resolution::Vertices(self.vertices), |it| Resolution::Edge(it.mm)),
            pulls: self.pulls(pattern),
            sides,
            kept_frames: self.kept_frames,
            solver: self.solver(),
            handle_limit: HANDLE_LIMIT,
        };
        let folded = fold(pattern, &source.mesh, &options, &cx.monitor)?;
        let (cut, flat) = cut(pattern, &source.mesh, &folded);
        Ok((cut, flat, folded))
    }

    fn section(
        &self,
        (_, pattern): (&SourceMesh, &CreasePattern),
        (): &(),
        (cut, _, folded): &(CutMesh, Flattening, Folded),
    ) -> Section {
        let figures = &folded.figures;
        let found = self_intersections(&cut.mesh, &Bvh::new(&cut.mesh));
        let diagonal = pattern.bounds().size().norm();
        let miss = folded.handles.iter().map(|it| it.miss).fold(0.0, f64::max) / diagonal;
        let unfolded = figures.crease_points - figures.excluded - figures.folded;
        let excluded = figures.excluded as f64 / figures.crease_points.max(1) as f64;
        let place = found.first().map_or(String::new(), |it| {
            let p = it.place();
            format!(
                "the folded sheet passes through itself, first near ({:.1}, {:.1}, {:.1}) mm; fold less far",
                p.x, p.y, p.z
            )
        });
        let far: Vec<String> = folded
            .handles
            .iter()
            .filter(|it| it.miss > HANDLE_LIMIT * diagonal)
            .map(|it| format!("{} at ({:.1}, {:.1}) mm misses by {:.2} mm", it.name, it.flat.x, it.flat.y, it.miss))
            .collect();
        let far = if far.is_empty() {
            String::new()
        } else {
            format!("{}: paper does not stretch; pull less far", far.join("; "))
        };
        Section::new("fold", self.table(pattern, folded, found.len()))
            .check(Check::at_most("fold.unfolded", unfolded as f64, 0.0, "crease points", "points that stayed smooth"))
            .check(Check::at_most(
                "fold.excluded",
                excluded,
                EXCLUDED,
                "of the crease points",
                "more fold.vertices leave out fewer",
            ))
            .check(Check::at_most("fold.handles", miss, HANDLE_LIMIT, "of the diagonal", far))
            .check(Check::at_most("fold.stretch_mean", figures.stretch_mean, STRETCH_MEAN, "of the edge", ""))
            .check(Check::at_most(
                "fold.stretch",
                figures.stretch_max,
                self.stretch,
                "of the edge",
                "of the most stretched edge",
            ))
            .check(Check::at_most("fold.continuity_mean", figures.continuity_mean, CONTINUITY[0], "mean edges", ""))
            .check(Check::at_most(
                "fold.continuity",
                figures.continuity_max,
                CONTINUITY[1],
                "mean edges",
                "widest gap along a crease",
            ))
            .check(Check::at_most(
                "fold.developable",
                figures.net_residual,
                RESIDUAL,
                "cosine",
                "angles around a vertex are equal",
            ))
            .check(Check::at_most("fold.self_intersections", found.len() as f64, 0.0, "pairs of faces", place))
    }
}

/// Where creases do not keep a cell apart. Coarse is said, not refused: the checks measure what came of it.
fn crowded(folded: &Folded) -> Option<String> {
    folded.crowded.first().map(|p| {
        format!(
            "two creases lie closer than a cell of {:.2} mm, first near ({:.1}, {:.1}) mm: the paper between them is coarse; set more fold.vertices",
            folded.edge, p.x, p.y
        )
    })
}

impl FoldStage {
    fn pulls(&self, pattern: &CreasePattern) -> Vec<Pull> {
        let point = |p: [f64; 2]| Vec2::from(p);
        let mut out: Vec<Pull> = Vec::new();
        out.extend(self.handle.iter().map(|it| {
            let held = |axis: usize| match it.free {
                Free::None => true,
                Free::X => axis != 0,
                Free::Y => axis != 1,
                Free::Z => axis != 2,
                Free::Xy => axis == 2,
            };
            Pull::Point { at: point(it.at), to: [0, 1, 2].map(|axis| held(axis).then_some(it.to[axis])) }
        }));
        out.extend(self.close.iter().map(|it| Pull::Close { ends: it.ends.map(point) }));
        out.extend(self.angle.iter().map(|it| Pull::Angle { at: point(it.at), angle: it.angle.radians }));
        let motion = self.motion.or(out.is_empty().then_some(MotionKey::LiftCorners)).map(|it| match it {
            MotionKey::LiftCorners => Motion::LiftCorners,
            MotionKey::Saddle => Motion::Saddle,
            MotionKey::Pinch => Motion::Pinch,
            MotionKey::Close => Motion::Close,
        });
        out.extend(motion.into_iter().flat_map(|it| it.pulls(pattern, self.amount)));
        out
    }

    fn solver(&self) -> solve::Options {
        solve::Options {
            stretch_limit: self.stretch,
            least_fold: self.least_fold.radians,
            frames: self.frames,
            iterations_per_frame: self.iterations,
            settle: self.settle,
            ..solve::Options::PAPER
        }
    }

    fn table(&self, pattern: &CreasePattern, folded: &Folded, intersections: usize) -> Value {
        let it = &folded.figures;
        let of = |mountain: bool| {
            let own = |it: &&FoldSample| it.excluded.is_empty() && (it.angle > 0.0) == mountain;
            folded.creases.iter().flat_map(|it| &it.samples).filter(own).count()
        };
        let diagonal = pattern.bounds().size().norm();
        let creases: Vec<Value> = folded.creases.iter().enumerate().map(crease).collect();
        let handles: Vec<Value> = folded
            .handles
            .iter()
            .map(|it| json!({ "name": it.name, "at_mm": [it.flat.x, it.flat.y], "miss_mm": it.miss }))
            .collect();
        json!({
            "vertices": folded.vertices,
            "edge_mm": folded.edge,
            "patches": pattern.patches.len(),
            "crease_points": it.crease_points,
            "folded": it.folded,
            "excluded": it.excluded,
            "straight": it.straight,
            "mean_fold_deg": it.mean_fold.to_degrees(),
            "least_fold_deg": it.least_fold.to_degrees(),
            "straight_fold_deg": it.straight_fold.to_degrees(),
            "handle_error_rel": folded.handles.iter().map(|it| it.miss).fold(0.0, f64::max) / diagonal,
            "handles": handles,
            "stretch_mean": it.stretch_mean,
            "stretch_max": it.stretch_max,
            "continuity_mean": it.continuity_mean,
            "continuity_max": it.continuity_max,
            "net_residual": it.net_residual,
            "angle_defect_max_deg": it.angle_defect.to_degrees(),
            "iterations": folded.iterations,
            "ms_per_iteration": 1000.0 * folded.seconds / folded.iterations.max(1) as f64,
            "mountains": of(true),
            "valleys": of(false),
            "self_intersections": intersections,
            "crowded_cells": folded.crowded.len(),
            "crowded": crowded(folded),
            "creases": creases,
        })
    }
}

/// A row of the list of creases.
fn crease((k, it): (usize, &FoldedCrease)) -> Value {
    let angles = it.samples.iter().filter(|it| it.excluded.is_empty()).map(|it| it.angle.to_degrees());
    let angles: Vec<f64> = angles.collect();
    let mean = angles.iter().sum::<f64>() / angles.len().max(1) as f64;
    json!({
        "crease": k + 1,
        "length_mm": crate::geom::polyline_length(&it.points, it.closed),
        "measured": angles.len(),
        "mean_angle_deg": mean,
        "folds": it.runs().iter().map(|it| it.fold.name()).collect::<Vec<_>>(),
    })
}

/// The folded sheet as pieces in space with the flat one as their places in the plane.
fn cut(pattern: &CreasePattern, flat: &TriMesh, folded: &Folded) -> (CutMesh, Flattening) {
    let uv: Field<VertexId, Vec2> = Field::from_vec(flat.positions().iter().map(|p| p.xy()).collect());
    let points = folded.frames.last().map_or_else(|| flat.positions().as_slice().to_vec(), |it| it.points.clone());
    let (piece_of, count) = pieces(pattern, flat);
    let cut = CutMesh {
        mesh: flat.with_positions(Field::from_vec(points)),
        origin: Field::from_vec(flat.vertices().collect()),
        piece_of: Field::from_vec(piece_of.into_iter().map(PieceId::new).collect()),
        pieces: Field::from_vec((0..count).map(Piece::numbered).collect()),
        seams: Vec::new(),
        tolerance: f64::INFINITY,
        seam_vertices: 0,
        stretch: 0.0,
        rim: Vec::new(),
        undeveloped: false,
    };
    let log_factor = scales(&cut, &uv);
    (cut, Flattening { uv, log_factor, overlaps: Vec::new(), stretch_limit: 0.0 })
}

/// Half the logarithm of the area around every vertex in the plane over that in space.
fn scales(cut: &CutMesh, uv: &Field<VertexId, Vec2>) -> Field<VertexId, f64> {
    let mesh = &cut.mesh;
    let mut areas = vec![[0.0; 2]; mesh.vertex_count()];
    for f in mesh.faces() {
        let corners = mesh.face_vertices(f);
        let [a, b, c] = corners.map(|v| uv[v]);
        let flat = 0.5 * crate::geom::cross2(b - a, c - a).abs();
        for v in corners {
            let sum = &mut areas[v.index()];
            *sum = [sum[0] + flat, sum[1] + mesh.area(f)];
        }
    }
    Field::from_vec(areas.into_iter().map(|[flat, space]| 0.5 * (flat / space).ln()).collect())
}
