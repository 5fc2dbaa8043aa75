//! The `[cut]` table and its section of the report.
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::{
    Across, CutError, NarrowNeck, Options, Region, Side, cut_at_cost, divisions, left_uncut, narrow, obstacle, painted,
    trace,
};
use crate::{
    geom::Vec3,
    mesh::{Bvh, EdgeId, Field, TriMesh, VertexId, operators::angle_defects},
    model::{CutMesh, DevelopableMesh, Guides, PieceId, SourceMesh},
    profile::{Extent, Length, Profiles},
    stage::{Check, Cx, Inputs, KeyError, Section, Stage},
    surface::offset::offset,
};
use std::path::PathBuf;

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
    /// Pieces hang together by less than this, or are strips narrower than this, only where nothing else keeps the limit; the
    /// material's when absent.
    pub min_neck: Option<Length>,
    /// More pieces than this are a failed check.
    pub max_pieces: Option<usize>,
    /// Parts of the model that seams are led to where that costs little.
    pub prefer: Vec<RegionTable>,
    /// Parts of the model that seams are kept off where that costs little.
    pub avoid: Vec<RegionTable>,
    /// OBJ file with lines (`l` elements) in the coordinates of the input, along which there must be a seam; read with the
    /// input.
    pub seams: Option<PathBuf>,
    /// Chains of vertices of the input file, counted from 0, along which there must be a seam.
    pub seam_vertices: Vec<Vec<u32>>,
    /// Points of drawn seams farther from the developed surface than this are a failed check.
    pub seam_tolerance: Extent,
    /// Whether pieces that fit on no sheet are divided.
    pub fit_sheet: bool,
    /// Which surface is cut.
    pub surface: Surface,
}

impl Default for CutStage {
    fn default() -> Self {
        Self {
            stretch: None,
            tolerance: None,
            clearance: Length::mm(0.002),
            style: Style::Few,
            min_piece: None,
            min_neck: None,
            max_pieces: None,
            prefer: Vec::new(),
            avoid: Vec::new(),
            seams: None,
            seam_vertices: Vec::new(),
            seam_tolerance: Extent::Percent(2.0),
            fit_sheet: true,
            surface: Surface::Shorter,
        }
    }
}

/// One of `[[cut.prefer]]` or `[[cut.avoid]]`, by exactly one of its first four keys.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RegionTable {
    /// What lies within `share` of the extent of where the model ends in this direction of the input.
    pub towards: Option<[f64; 3]>,
    /// What lies about the middle plane across this direction of the input, `share` of the extent thick: lines of symmetry.
    pub middle: Option<[f64; 3]>,
    /// The faces of this group, material or object of the input, an OBJ file.
    pub paint: Option<String>,
    /// These faces of the input, counted from 0 in the order of the file.
    pub faces: Option<Vec<u32>>,
    /// Share of the extent of the model in a direction: 0.5 for `towards`, 0.04 for `middle` when absent.
    pub share: Option<f64>,
}

impl RegionTable {
    /// `key` names its patch; the patches of a job hold one for every table with faces.
    fn region(&self, key: &str, mesh: &TriMesh, source: &Bvh, guides: Option<&Guides>) -> Region {
        let side =
            |towards: [f64; 3], share: f64| Side { towards: Vec3::from(towards), share: self.share.unwrap_or(share) };
        match (self.towards, self.middle) {
            (Some(towards), _) => Region::Side(side(towards, 0.5)),
            (None, Some(middle)) => Region::Middle(side(middle, 0.04)),
            (None, None) => {
                let patch = guides.and_then(|it| it.patches.iter().find(|it| it.key == key));
                Region::Faces(patch.map_or_else(Vec::new, |it| painted(mesh, source, &it.triangles)))
            }
        }
    }

    fn check(&self) -> Result<(), KeyError> {
        if let Some(share) = self.share {
            KeyError::range("share", share, 0.0, 1.0)?;
        }
        let given = [self.towards.is_some(), self.middle.is_some(), self.paint.is_some(), self.faces.is_some()];
        if given.into_iter().filter(|it| *it).count() != 1 {
            let message = "and `avoid` need exactly one of `towards`, `middle`, `paint` and `faces` in each table";
            return Err(KeyError { key: "prefer", message: message.into() });
        }
        if self.towards.into_iter().chain(self.middle).all(|it| Vec3::from(it).norm().is_normal()) {
            return Ok(());
        }
        Err(KeyError { key: "towards", message: "and `middle` must be directions such as [0, -1, 0]".into() })
    }
}

/// Which surface is cut, as it is written in the config.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Surface {
    /// The one that was made developable.
    Developed,
    /// That one, or the mesh before it if that takes less seam: a part made of plates and bends, or a material that stretches.
    Shorter,
}

/// The mesh before it was made developable is tried if its |angle defects| sum to at most so many times as much: seams must reach
/// them all, so with more of them it hardly wins.
const WORTH_TRYING: f64 = 1.1;

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

    /// What a neck costs, as a length of seam over the diagonal: more than dividing the piece there, unless pieces are dear.
    fn neck(self) -> f64 {
        match self {
            Self::OnePiece => 0.02,
            Self::Few => 0.12,
            Self::Shortest => 0.05,
        }
    }

    /// How often an arc is halved in search of a part that can be glued: one piece may hang together by a short hinge.
    fn halvings(self) -> u32 {
        match self {
            Self::OnePiece => 6,
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
    /// Least width of a neck, mm.
    min_neck: f64,
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

/// The lines that the user drew, if any.
fn drawn(guides: Option<&Guides>) -> Option<&Vec<Vec<Vec3>>> {
    guides.map(|it| &it.seams).filter(|it| !it.is_empty())
}

/// The edges that an earlier stage named as seams, each with its factor of length.
fn named(mesh: &TriMesh, guides: Option<&Guides>) -> Vec<(EdgeId, f64)> {
    let Some(guides) = guides else { return Vec::new() };
    let vertex = |v: u32| (v as usize) < mesh.vertex_count();
    let scales = guides.scales.iter().copied().chain(std::iter::repeat(1.0));
    let known = guides.edges.iter().zip(scales).filter(|it| it.0.iter().all(|&v| vertex(v)));
    let inner = known.filter_map(|(&[a, b], scale)| {
        let [a, b] = [VertexId(a), VertexId(b)];
        let e = mesh.edge(mesh.find_halfedge(a, b).or_else(|| mesh.find_halfedge(b, a))?);
        (!mesh.is_boundary_edge(e)).then_some((e, scale))
    });
    inner.collect()
}

/// The edges that must be seams: those along the lines that the user drew, and those that an earlier stage named.
fn seams(mesh: &TriMesh, guides: Option<&Guides>) -> Vec<EdgeId> {
    let mut edges = drawn(guides).map_or_else(Vec::new, |lines| trace(mesh, lines).edges);
    edges.extend(named(mesh, guides).into_iter().map(|it| it.0));
    edges.sort_unstable();
    edges.dedup();
    edges
}

impl CutStage {
    /// Adds what became of the drawn seams.
    fn drawn_seams(&self, mut section: Section, mesh: &TriMesh, lines: &[Vec<Vec3>]) -> Section {
        let traced = trace(mesh, lines);
        let (handles, closed) = left_uncut(mesh, &traced.edges);
        let length: f64 = traced.edges.iter().map(|&e: &EdgeId| mesh.edge_length(e)).sum();
        let (place, distance) = traced.farthest;
        section.tables["cut"]["drawn_seams"] = json!({
            "length_mm": length,
            "max_distance_mm": distance,
            "max_offset_mm": traced.offset,
            "broken": traced.broken,
            "handles_left": handles,
            "closed_left": closed,
        });
        let mut note = format!(
            "the point ({:.1}, {:.1}, {:.1}) is farthest from the developed surface; seams follow its edges, up to {:.2} mm beside the lines",
            place.x, place.y, place.z, traced.offset
        );
        if handles + closed > 0 {
            note += &format!("; they leave {handles} handles and {closed} closed surfaces uncut, which were completed");
        }
        if traced.broken > 0 {
            note +=
                &format!("; {} times a line jumps from one component to another and is broken there", traced.broken);
        }
        let limit = self.seam_tolerance.resolve(mesh.bounds().diagonal());
        section.check(Check::at_most("cut.drawn_seams", distance, limit, "mm", note))
    }

    fn options(&self, mesh: &TriMesh, source: &Bvh, guides: Option<&Guides>, stock: &Stock) -> Options {
        let regions = |name: &str, tables: &[RegionTable]| {
            let key = |k: usize| format!("{name} {k}");
            tables.iter().enumerate().map(|(k, it)| it.region(&key(k), mesh, source, guides)).collect()
        };
        Options {
            stretch: self.stretch.unwrap_or(stock.stretch),
            tolerance: self.tolerance,
            clearance: self.clearance.mm,
            least_opening: LEAST_OPENING,
            new_piece: self.style.new_piece(),
            halvings: self.style.halvings(),
            min_area: self.min_side(stock).powi(2),
            min_neck: self.min_neck(stock),
            neck: self.style.neck(),
            prefer: regions("prefer", &self.prefer),
            avoid: regions("avoid", &self.avoid),
            seams: seams(mesh, guides),
            scales: named(mesh, guides).into_iter().filter(|it| it.1 != 1.0).collect(),
            sheet: self.fit_sheet.then_some(stock.room),
        }
    }

    /// Whether cutting the mesh before it was made developable may take less seam. The seams that an earlier stage named are
    /// those of one surface.
    fn may_be_shorter(&self, before: &TriMesh, developed: &DevelopableMesh, guides: Option<&Guides>) -> bool {
        let defects = |mesh: &TriMesh| {
            let defects = angle_defects(mesh);
            mesh.vertices().filter(|&v| !mesh.is_boundary_vertex(v)).map(|v| defects[v].abs()).sum::<f64>()
        };
        self.surface == Surface::Shorter
            && self.tolerance.is_none()
            && guides.is_none_or(|it| it.edges.is_empty())
            && !developed.rounds.is_empty()
            && *before != developed.mesh
            && defects(before) <= WORTH_TRYING * defects(&developed.mesh)
    }

    /// Side of the least useful square, mm.
    fn min_side(&self, stock: &Stock) -> f64 {
        self.min_piece.map_or(stock.min_piece, |it| it.mm)
    }

    /// Least width of a neck, mm.
    fn min_neck(&self, stock: &Stock) -> f64 {
        self.min_neck.map_or(stock.min_neck, |it| it.mm)
    }

    /// Adds where pieces are narrower than asked.
    fn narrow(&self, stock: &Stock, cut: &CutMesh, table: &mut Value) {
        let width = self.min_neck(stock);
        let (necks, strips) = narrow(cut, width, self.clearance.mm);
        let name = |id: PieceId| cut.pieces[id].name.as_str();
        let neck = |it: &NarrowNeck| {
            let [x, y, z]: [f64; 3] = it.place.into();
            json!({ "piece": name(it.piece), "width_mm": it.width, "hanging_mm2": it.hanging, "place_mm": [x, y, z] })
        };
        table["min_neck_mm"] = json!(width);
        table["narrow_necks"] = json!(necks.len());
        table["necks"] = necks.iter().map(neck).collect();
        table["narrow_strips"] = strips.iter().map(|&id| name(id)).collect();
    }
}

impl Stage for CutStage {
    const NAME: &'static str = "cut";
    const VERSION: u32 = 12;
    type Input = (DevelopableMesh, SourceMesh, Option<Guides>, Option<TriMesh>);
    type Output = CutMesh;
    type Profile = Stock;
    type Error = CutError;

    fn profile(profiles: &Profiles) -> Stock {
        let material = &profiles.material;
        Stock {
            stretch: material.stretch,
            min_piece: material.min_piece.mm,
            min_neck: material.min_neck.mm,
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
        if let Some(width) = self.min_neck {
            KeyError::range("min_neck", width.mm, 0.0, 1e3)?;
        }
        self.prefer.iter().chain(&self.avoid).try_for_each(RegionTable::check)?;
        KeyError::range("clearance", self.clearance.mm, 1e-6, 10.0)
    }

    fn run(&self, input: <Self::Input as Inputs>::Refs<'_>, stock: &Stock, cx: &Cx) -> Result<CutMesh, CutError> {
        let (developed, source, guides, before) = input;
        let source = Bvh::new(&source.mesh);
        let run = |made: &DevelopableMesh| {
            let options = self.options(&made.mesh, &source, guides, stock);
            if stock.offset == 0.0 {
                return cut_at_cost(made, &options, &cx.monitor);
            }
            // The surface parallel to a developable one is developable, so the neutral layer is that of the developed mesh.
            let mesh = offset(&made.mesh, stock.offset).mesh;
            cut_at_cost(&DevelopableMesh { mesh, ..made.clone() }, &options, &cx.monitor)
        };
        let (found, cost) = run(developed)?;
        let Some(before) = before.filter(|it| self.may_be_shorter(it, developed, guides)) else { return Ok(found) };
        let energy = Field::filled(before.vertex_count(), 0.0);
        let (other, less) = run(&DevelopableMesh { mesh: before.clone(), energy, ..developed.clone() })?;
        Ok(if less < cost { CutMesh { undeveloped: true, ..other } } else { found })
    }

    fn section(&self, input: <Self::Input as Inputs>::Refs<'_>, stock: &Stock, cut: &CutMesh) -> Section {
        let (developed, _, guides, before) = input;
        let input = before.filter(|_| cut.undeveloped).unwrap_or(&developed.mesh);
        let moved = offset(input, stock.offset);
        let length: f64 = cut.seams.iter().flat_map(|it| &it.sides[0]).map(|&h| cut.mesh.vector(h).norm()).sum();
        let mut table = json!({
            "seam_vertices": cut.seam_vertices,
            "seam_length_mm": length,
            "seam_length_rel": length / input.bounds().diagonal(),
            "pieces": cut.pieces.len(),
            "surface": if cut.undeveloped { "input" } else { "developed" },
            "min_piece_mm": self.min_side(stock),
            "small_pieces": cut.small_pieces(self.min_side(stock).powi(2)),
        });
        self.narrow(stock, cut, &mut table);
        if let Some(lines) = guides.map(|it| &it.edges).filter(|it| !it.is_empty()) {
            let found = divisions(cut, lines);
            let row = |it: &Across| {
                let [a, b] = it.pieces.map(|id| &cut.pieces[id].name);
                json!({ "pieces": [a, b], "at_mm": [it.place.x, it.place.y, it.place.z], "length_mm": it.length })
            };
            table["strips"] = json!(found.strips);
            table["slits"] = json!(found.slits);
            table["divisions"] = json!(found.across.iter().map(row).collect::<Vec<_>>());
        }
        if self.style == Style::OnePiece && cut.pieces.len() > 1 {
            table["obstacle"] = json!(too_many(&moved.mesh, cut));
        }
        if let Some(tolerance) = self.tolerance {
            table["tolerance"] = json!(tolerance);
        }
        let mut section =
            Section::new("cut", table).neutral_layer(stock.offset, [moved.usual, moved.error], moved.shortened.len());
        if let Some(lines) = drawn(guides) {
            section = self.drawn_seams(section, input, lines);
        }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        mesh::shapes,
        model::Round,
        numeric::{Monitor, random::Random},
    };

    fn developed(mesh: &TriMesh) -> DevelopableMesh {
        let energy = Field::filled(mesh.vertex_count(), 0.0);
        DevelopableMesh {
            mesh: mesh.clone(),
            energy,
            max_deviation: 0.0,
            rounds: vec![Round::default()],
            tradeoffs: vec![],
        }
    }

    #[test]
    fn of_two_surfaces_the_one_with_shorter_seams_is_cut() {
        let smooth = shapes::cuboid(Vec3::new(40.0, 30.0, 20.0), 4);
        let mut random = Random::new(3);
        let dent = |p: &Vec3| p + Vec3::from_fn(|_, _| 0.4 * (random.unit() - 0.5));
        let dented = smooth.with_positions(Field::from_vec(smooth.positions().iter().map(dent).collect()));
        let source = SourceMesh { mesh: smooth.clone(), file: String::new(), repairs: vec![], up: 2 };
        let stock = Stock { stretch: 0.002, min_piece: 1.0, min_neck: 0.5, room: [300.0, 300.0], offset: 0.0 };
        let cx = Cx { seed: 0, monitor: Monitor::silent(), kept: None, keep: &|_| () };
        let run = |surface, made: &TriMesh, before: &TriMesh| {
            let stage = CutStage { surface, ..CutStage::default() };
            let cut = stage.run((&developed(made), &source, None, Some(before)), &stock, &cx).unwrap();
            let length: f64 = cut.seams.iter().flat_map(|it| &it.sides[0]).map(|&h| cut.mesh.vector(h).norm()).sum();
            (cut.undeveloped, length)
        };
        let (undeveloped, shorter) = run(Surface::Shorter, &dented, &smooth);
        let (as_told, longer) = run(Surface::Developed, &dented, &smooth);
        assert!(undeveloped && !as_told && shorter < longer, "{shorter} {longer}");
        assert!(!run(Surface::Shorter, &smooth, &dented).0);
    }
}
