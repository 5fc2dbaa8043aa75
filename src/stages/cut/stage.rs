//! The `[cut]` table and its section of the report.
use serde::{Deserialize, Serialize};
use serde_json::json;

use super::{CutError, Options, Side, cut, obstacle};
use crate::{
    geom::Vec3,
    mesh::TriMesh,
    model::{CutMesh, DevelopableMesh},
    profile::{Length, Profiles},
    stage::{Check, Cx, KeyError, Section, Stage},
    surface::offset::offset,
};

/// Where the surface is cut.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CutStage {
    /// Limit of the principal stretch |ln σ| of the flat layout; the material's when absent.
    pub stretch: Option<f64>,
    /// Vertices with a developability energy above this lie on a seam; when absent the seams follow from the stretch.
    pub tolerance: Option<f64>,
    /// Least distance between parts of one outline.
    pub clearance: Length,
    /// Whether fewer pieces or shorter seams count for more.
    pub style: Style,
    /// Side of a square: pieces of a smaller area are made only where nothing else keeps the limit; the material's when
    /// absent.
    pub min_piece: Option<Length>,
    /// More pieces than this are a failed check.
    pub max_pieces: Option<usize>,
    /// Sides of the model that seams are led to where that costs little.
    pub prefer: Vec<SideTable>,
    /// Sides of the model that seams are kept off where that costs little.
    pub avoid: Vec<SideTable>,
    /// Whether pieces that fit on no sheet are divided.
    pub fit_sheet: bool,
}

impl Default for CutStage {
    fn default() -> Self {
        Self {
            stretch: None,
            tolerance: None,
            clearance: Length::mm(0.002),
            style: Style::Few,
            min_piece: None,
            max_pieces: None,
            prefer: Vec::new(),
            avoid: Vec::new(),
            fit_sheet: true,
        }
    }
}

/// One of `[[cut.prefer]]` or `[[cut.avoid]]`: what lies within a share of the model's extent of its end in a direction.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SideTable {
    /// The direction in the coordinates of the input.
    pub towards: [f64; 3],
    /// Share of the extent in that direction.
    #[serde(default = "half")]
    pub share: f64,
}

fn half() -> f64 {
    0.5
}

impl SideTable {
    fn side(&self) -> Side {
        Side { towards: Vec3::from(self.towards), share: self.share }
    }

    fn check(&self) -> Result<(), KeyError> {
        KeyError::range("share", self.share, 0.0, 1.0)?;
        if Vec3::from(self.towards).norm().is_normal() {
            return Ok(());
        }
        Err(KeyError { key: "towards", message: "must be a direction such as [0, -1, 0]".into() })
    }
}

/// What a solution is chosen for, as it is written in the config.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Style {
    /// One piece where that is possible, however long the seams.
    OnePiece,
    /// Few pieces with short seams.
    Few,
    /// The shortest seams, in however many pieces.
    Shortest,
}

impl Style {
    /// What one more piece is worth, as a length of seam over the diagonal.
    fn new_piece(self) -> f64 {
        match self {
            Self::OnePiece => 0.5,
            Self::Few => 0.03,
            Self::Shortest => 0.005,
        }
    }

    /// How often an arc is halved in search of a part that can be glued: one piece may hang together by a short hinge.
    fn halvings(self) -> u32 {
        match self {
            Self::OnePiece => 3,
            Self::Few | Self::Shortest => 1,
        }
    }
}

/// The least angle by which a slit opens at its end, radians: less is closed by the width of any tool.
const LEAST_OPENING: f64 = 1e-3;

/// What the stage reads of the profiles.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Stock {
    /// The stretch that the material takes, as |log scale|.
    stretch: f64,
    /// Side of the least useful square, mm.
    min_piece: f64,
    /// Sides of the area in which a piece can be placed, shorter one first, mm.
    room: [f64; 2],
    /// How far the neutral layer lies outside the developed mesh, mm.
    offset: f64,
}

/// Which piece is too many, where, and by how much the limit would be missed without it.
fn too_many(mesh: &TriMesh, cut: &CutMesh) -> String {
    let way_out = "allow more stretch or more pieces, or a larger deviation in [develop]";
    let Ok(Some(it)) = obstacle(mesh, cut) else { return way_out.into() };
    let [piece, other] = [it.piece, it.neighbour].map(|id| &cut.pieces[id].name);
    let [x, y, z] = it.place.into();
    let limit = cut.stretch;
    let reason = if it.stretch > limit {
        format!(
            "stretch by {:.4}, {:.1} times the limit {limit}, most near ({x:.1}, {y:.1}, {z:.1})",
            it.stretch,
            it.stretch / limit
        )
    } else {
        format!("overlap or not fit on the sheet, around ({x:.1}, {y:.1}, {z:.1})")
    };
    format!("piece {piece} glued to {other} along seam {} would {reason}; {way_out}", it.seam)
}

impl CutStage {
    /// Side of the least useful square, mm.
    fn min_side(&self, stock: &Stock) -> f64 {
        self.min_piece.map_or(stock.min_piece, |it| it.mm)
    }
}

impl Stage for CutStage {
    const NAME: &'static str = "cut";
    const VERSION: u32 = 6;
    type Input = DevelopableMesh;
    type Output = CutMesh;
    type Profile = Stock;
    type Error = CutError;

    fn profile(profiles: &Profiles) -> Stock {
        let material = &profiles.material;
        Stock {
            stretch: material.stretch,
            min_piece: material.min_piece.mm,
            room: profiles.room(),
            offset: material.offset(),
        }
    }

    fn check(&self) -> Result<(), KeyError> {
        if let Some(stretch) = self.stretch {
            KeyError::range("stretch", stretch, 1e-6, 1.0)?;
        }
        if let Some(tolerance) = self.tolerance {
            KeyError::range("tolerance", tolerance, 0.0, 1e6)?;
        }
        if let Some(pieces) = self.max_pieces {
            KeyError::range("max_pieces", pieces as f64, 1.0, 1e9)?;
        }
        if let Some(side) = self.min_piece {
            KeyError::range("min_piece", side.mm, 0.0, 1e4)?;
        }
        self.prefer.iter().chain(&self.avoid).try_for_each(SideTable::check)?;
        KeyError::range("clearance", self.clearance.mm, 1e-6, 10.0)
    }

    fn run(&self, input: &DevelopableMesh, stock: &Stock, cx: &Cx) -> Result<CutMesh, CutError> {
        let options = Options {
            stretch: self.stretch.unwrap_or(stock.stretch),
            tolerance: self.tolerance,
            clearance: self.clearance.mm,
            least_opening: LEAST_OPENING,
            new_piece: self.style.new_piece(),
            halvings: self.style.halvings(),
            min_area: self.min_side(stock).powi(2),
            prefer: self.prefer.iter().map(SideTable::side).collect(),
            avoid: self.avoid.iter().map(SideTable::side).collect(),
            sheet: self.fit_sheet.then_some(stock.room),
        };
        if stock.offset == 0.0 {
            return cut(input, &options, &cx.monitor);
        }
        // The surface parallel to a developable one is developable, so the neutral layer is that of the developed mesh.
        let mesh = offset(&input.mesh, stock.offset).mesh;
        cut(&DevelopableMesh { mesh, ..input.clone() }, &options, &cx.monitor)
    }

    fn section(&self, input: &DevelopableMesh, stock: &Stock, cut: &CutMesh) -> Section {
        let moved = offset(&input.mesh, stock.offset);
        let length: f64 = cut.seams.iter().flat_map(|it| &it.sides[0]).map(|&h| cut.mesh.vector(h).norm()).sum();
        let mut table = json!({
            "seam_vertices": cut.seam_vertices,
            "seam_length_mm": length,
            "seam_length_rel": length / input.mesh.bounds().diagonal(),
            "pieces": cut.pieces.len(),
            "min_piece_mm": self.min_side(stock),
            "small_pieces": cut.small_pieces(self.min_side(stock).powi(2)),
        });
        if let Some(tolerance) = self.tolerance {
            table["tolerance"] = json!(tolerance);
        }
        let section = Section::new("cut", table).neutral_layer(stock.offset, moved.error, moved.shortened.len());
        match self.max_pieces {
            Some(limit) => section.check(Check::at_most(
                "cut.pieces",
                cut.pieces.len() as f64,
                limit as f64,
                "pieces",
                if cut.pieces.len() > limit { too_many(&moved.mesh, cut) } else { String::new() },
            )),
            None => section,
        }
    }
}
