//! The `[unfold]` table and its section of the report.
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::{ISOMETRY, Options, UnfoldError, hulls, isometry, unfold};
use crate::{
    geom::{
        Vec2, angle_between,
        polygon::{bounds_turned, least_box_angle, least_excess},
    },
    mesh::TriMesh,
    model::{CutMesh, Flattening, PieceId},
    profile::{Angle, Length, Profiles},
    stage::{Check, Cx, KeyError, Section, Stage},
    surface::offset::offset,
};

/// How a polyhedron is unfolded.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct UnfoldStage {
    /// Meshes with more faces are refused: nobody folds them.
    pub max_faces: usize,
    /// More pieces than this are a failed check.
    pub max_pieces: Option<usize>,
    /// Least distance between parts of a piece that are not neighbours; more of it leaves room for tabs and makes more pieces.
    pub clearance: Length,
    /// Least angle between two faces at a vertex that they have in common, if it is not the slit between them.
    pub least_opening: Angle,
    /// How long to search, in thousands of moves of a branch from one edge to another; more makes fewer pieces and shorter
    /// seams.
    pub effort: usize,
    /// Whether pieces are kept small enough for a sheet with what joins them.
    pub fit_sheet: bool,
    /// Whether flat faces too large for a sheet are divided along straight lines.
    pub split: bool,
    /// Whether every flat face is a piece of its own, for board that cannot be folded.
    pub separate: bool,
}

impl Default for UnfoldStage {
    fn default() -> Self {
        Self {
            max_faces: 5_000,
            max_pieces: None,
            clearance: Length::mm(0.2),
            least_opening: Angle::degrees(0.1),
            effort: 30,
            fit_sheet: true,
            split: false,
            separate: false,
        }
    }
}

/// What the stage reads of the profiles.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Stock {
    /// Sides of the area in which a piece can be placed, shorter one first, mm.
    room: [f64; 2],
    /// How far the neutral layer lies outside the mesh, mm.
    offset: f64,
}

impl Stage for UnfoldStage {
    const NAME: &'static str = "unfold";
    const VERSION: u32 = 5;
    const DRAWS: bool = true;
    type Input = TriMesh;
    type Output = (CutMesh, Flattening);
    type Profile = Stock;
    type Error = UnfoldError;

    fn profile(profiles: &Profiles) -> Stock {
        Stock { room: profiles.room(), offset: profiles.material.offset() }
    }

    fn check(&self) -> Result<(), KeyError> {
        KeyError::range("max_faces", self.max_faces as f64, 1.0, 1e6)?;
        if let Some(pieces) = self.max_pieces {
            KeyError::range("max_pieces", pieces as f64, 1.0, 1e9)?;
        }
        KeyError::range("clearance", self.clearance.mm, 1e-6, 100.0)?;
        KeyError::range("least_opening", self.least_opening.radians.to_degrees(), 1e-6, 45.0)?;
        KeyError::range("effort", self.effort as f64, 0.0, 1e6)
    }

    fn run(&self, mesh: &TriMesh, stock: &Stock, cx: &Cx) -> Result<(CutMesh, Flattening), UnfoldError> {
        let options = Options {
            max_faces: self.max_faces,
            clearance: self.clearance.mm,
            least_opening: self.least_opening.radians,
            moves: 1000 * self.effort,
            sheet: self.fit_sheet.then_some(stock.room),
            split: self.split,
            separate: self.separate,
            seed: cx.seed,
        };
        unfold(&offset(mesh, stock.offset).mesh, &options, &cx.monitor)
    }

    fn section(&self, mesh: &TriMesh, stock: &Stock, (cut, flat): &(CutMesh, Flattening)) -> Section {
        let moved = offset(mesh, stock.offset);
        let length: f64 = cut.seams.iter().flat_map(|it| &it.sides[0]).map(|&h| cut.mesh.vector(h).norm()).sum();
        let diagonal = mesh.bounds().diagonal();
        let hulls = hulls(cut, flat);
        let mismatch = |it| {
            let [a, b] = flat.seam_sides(cut, it);
            (a - b).abs()
        };
        let faces = |id: PieceId| cut.piece_of.iter().filter(|&&it| it == id).count();
        let pieces: Vec<Value> = hulls
            .enumerate()
            .map(|(id, hull): (PieceId, _)| {
                let size = size(hull);
                json!({ "name": cut.pieces[id].name, "faces": faces(id), "size_mm": [size.x, size.y] })
            })
            .collect();
        let table = json!({
            "faces": cut.mesh.face_count(),
            "folds": folds(&cut.mesh),
            "seam_length_mm": length,
            "seam_length_rel": length / diagonal,
            "isometry_mm": isometry(cut, flat),
            "pieces": pieces,
        });
        let seams = json!({
            "count": cut.seams.len(),
            "max_mismatch_mm": cut.seams.iter().map(mismatch).fold(0.0, f64::max),
        });
        let isometry = Check::at_most("unfold.isometry", isometry(cut, flat), ISOMETRY * diagonal, "mm", "");
        let area: f64 = flat.overlaps.iter().map(|it| it.area).sum();
        let note = if area > 0.0 { format!("{area:.3} mm² in all, within one flat face") } else { String::new() };
        let section = Section::new("unfold", table)
            .table("seams", seams)
            .neutral_layer(stock.offset, [moved.usual, moved.error], moved.shortened.len())
            .check(Check::at_most("unfold.overlaps", flat.overlaps.len() as f64, 0.0, "pairs of faces", note))
            .check(isometry)
            .check(self.fits(cut, &hulls, stock));
        match self.max_pieces {
            Some(limit) => section.check(Check::at_most(
                "unfold.pieces",
                cut.pieces.len() as f64,
                limit as f64,
                "pieces",
                "take fewer faces, a larger sheet, or more unfold.effort",
            )),
            None => section,
        }
    }
}

impl UnfoldStage {
    /// Whether every piece has room on a sheet; a piece that has none is a single flat face.
    fn fits(&self, cut: &CutMesh, hulls: &crate::mesh::Field<PieceId, Vec<Vec2>>, stock: &Stock) -> Check {
        let free = stock.room;
        let large = |it: &(PieceId, &Vec<Vec2>)| least_excess(it.1, free).0 > 1.0;
        let found: Vec<String> = hulls
            .enumerate()
            .filter(large)
            .map(|(id, hull)| {
                let size = size(hull);
                format!("piece {} is {:.1} × {:.1} mm", cut.pieces[id].name, size.x, size.y)
            })
            .collect();
        let note = match found.len() {
            0 => String::new(),
            _ => format!(
                "{}; a sheet has room for {:.1} × {:.1} mm with what joins the pieces: set unfold.split = true to divide them, scale the model, or take larger stock",
                found.join(", "),
                free[1],
                free[0]
            ),
        };
        Check::at_most("unfold.fits", found.len() as f64, 0.0, "pieces larger than the sheet", note)
    }
}

/// Sides of the least box around a hull, the longer one first, mm.
fn size(hull: &[Vec2]) -> Vec2 {
    bounds_turned(hull, least_box_angle(hull)).size()
}

/// Edges inside the pieces at which the surface bends.
fn folds(mesh: &TriMesh) -> usize {
    /// Less is flat, radians.
    const FLAT: f64 = 1e-5;
    let bends = |e: &crate::mesh::EdgeId| {
        let h = mesh.halfedge(*e);
        let faces = mesh.twin(h).map(|twin| [h, twin].map(|it| mesh.normal(mesh.face(it))));
        faces.is_some_and(|[a, b]| angle_between(a, b) > FLAT)
    };
    mesh.edges().filter(bends).count()
}
