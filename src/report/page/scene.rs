//! What the page shows in space: meshes with their colourings, lines on them, the pieces and the seams between them.
use serde_json::{Value, json};

use super::{Content, grid::Grid, pack::Pack};
use crate::{
    geom::{Vec2, Vec3, ears::ears},
    mesh::{Field, Id, TriMesh},
    model::{CutMesh, DevelopableMesh, Flattening, Globe, PieceId, Stripes, Strips},
};

/// A mesh to look at. Lists per vertex are empty where the mesh has no such thing.
struct Model {
    name: &'static str,
    title: &'static str,
    about: &'static str,
    points: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
    /// Places in the plane of the piece, mm.
    flat: Vec<Vec2>,
    pieces: Vec<u32>,
    strips: Vec<u32>,
    fields: Vec<Scale>,
}

/// A number per vertex, shown as a colour.
struct Scale {
    name: &'static str,
    title: &'static str,
    about: &'static str,
    /// How numbers become colours: `log` over [`DECADES`], or `diverging` about 0.
    kind: &'static str,
    values: Vec<f64>,
}

/// Lines on the meshes of the same names.
struct Lines {
    name: &'static str,
    title: &'static str,
    models: &'static [&'static str],
    /// Points of each line with the piece that it is on.
    runs: Vec<(Option<PieceId>, Vec<Vec3>)>,
    /// The same points in the plane, where all lines are on pieces.
    flat: Vec<Vec<Vec2>>,
}

/// Orders of magnitude below the largest value that a logarithmic scale shows.
const DECADES: f64 = 6.0;

/// Everything in space as JSON, with its numbers in `pack`.
pub(super) fn scene(content: &Content<'_>, pack: &mut Pack) -> Value {
    let subjects = &content.subjects;
    let mut models =
        vec![plain("input", "Input", "the mesh as it was read and brought to size", &subjects.source.mesh)];
    let coarse = subjects.coarse.filter(|it| **it != subjects.source.mesh);
    models.extend(coarse.map(|it| plain("coarse", "Coarse", "the mesh that the work begins with", it)));
    models.extend(subjects.developed.map(developed));
    models.extend(subjects.cut.map(|it| pieces(it, content.flat, subjects.developed)));
    models.extend(subjects.strips.map(strips));
    models.extend(subjects.cut.zip(content.globe).and_then(|(cut, globe)| sphere(cut, content, globe)));
    let lines: Vec<Lines> =
        [subjects.strips.map(rulings), content.stripes.map(stripes)].into_iter().flatten().collect();
    let grid = Grid::of(models.iter().flat_map(|it| &it.points).map(|p| [p.x, p.y, p.z]));
    let flat = Grid::of(models.iter().flat_map(|it| &it.flat).map(|p| [p.x, p.y]));
    let models: Vec<Value> = models.iter().map(|it| it.write(&grid, &flat, pack)).collect();
    let lines: Vec<Value> = lines.iter().map(|it| it.write(&grid, &flat, pack)).collect();
    json!({
        "up": subjects.source.up,
        "grid": grid.json(),
        "flat_grid": flat.json(),
        "models": models,
        "lines": lines,
        "dots": content.stripes.map_or(json!([]), dots),
        "pieces": subjects.cut.map_or(json!([]), names),
        "seams": subjects.cut.map_or(json!([]), |it| seams(it, pack)),
    })
}

fn plain(name: &'static str, title: &'static str, about: &'static str, mesh: &TriMesh) -> Model {
    let points = mesh.positions().as_slice().to_vec();
    let (flat, pieces, strips, fields) = (vec![], vec![], vec![], vec![]);
    Model { name, title, about, points, triangles: mesh.face_indices(), flat, pieces, strips, fields }
}

fn energy(values: Vec<f64>) -> Scale {
    let about =
        "how far the surface around a vertex is from one that can be rolled out flat; seams belong on the dark lines";
    Scale { name: "energy", title: "Developability energy", about, kind: "log", values }
}

fn developed(made: &DevelopableMesh) -> Model {
    let about = "the mesh bent into shapes that unroll without stretching";
    let fields = vec![energy(made.energy.as_slice().to_vec())];
    // A recipe without the flow only carries the surface on.
    let (title, about) =
        if made.rounds.is_empty() { ("Surface", "the surface with the lines in it") } else { ("Developable", about) };
    Model { fields, ..plain("developed", title, about, &made.mesh) }
}

fn pieces(cut: &CutMesh, flat: Option<&Flattening>, made: Option<&DevelopableMesh>) -> Model {
    let mesh = &cut.mesh;
    let mut of_vertex = Field::filled(mesh.vertex_count(), 0);
    for f in mesh.faces() {
        mesh.face_vertices(f).into_iter().for_each(|v| of_vertex[v] = cut.piece_of[f].0);
    }
    let mut fields = Vec::new();
    // A stage between may have cut new vertices into the mesh.
    let made = made.filter(|_| !cut.undeveloped);
    if let Some(made) = made.filter(|it| cut.origin.as_slice().iter().all(|v| v.index() < it.energy.len())) {
        fields.push(energy(cut.origin.as_slice().iter().map(|&v| made.energy[v]).collect()));
    }
    if let Some(flat) = flat {
        let about = "½ ln of flat area over area in space: above 0 the material is pressed together when the piece is put in \
                     place, below 0 it must stretch";
        let values = flat.log_factor.as_slice().to_vec();
        fields.push(Scale { name: "stretch", title: "Stretch (log scale)", about, kind: "diverging", values });
    }
    Model {
        flat: flat.map(|it| it.uv.as_slice().to_vec()).unwrap_or_default(),
        pieces: of_vertex.as_slice().to_vec(),
        fields,
        ..plain("cut", "Pieces", "the pieces that are cut out of flat material", mesh)
    }
}

/// Radius of the sphere over the diagonal of the model beside which it is seen.
const RADIUS: f64 = 0.35;

/// The pieces on the sphere, with the vertices of the cut mesh; `None` where a stage between has cut new ones into it.
fn sphere(cut: &CutMesh, content: &Content<'_>, globe: &Globe) -> Option<Model> {
    let source = content.subjects.source;
    let bounds = source.mesh.bounds();
    let origin = cut.origin.as_slice().iter().map(|&v| globe.images.get(v.index()).copied());
    let images: Vec<Vec3> = origin.collect::<Option<_>>()?;
    let upright = |p: &Vec3| if source.up == 1 { Vec3::new(p.y, p.z, p.x) } else { *p };
    let middle = 0.5 * (bounds.min + bounds.max);
    let points = images.iter().map(|p| middle + RADIUS * bounds.diagonal() * upright(p)).collect();
    let about = "½ ln of the area on the surface over that on the sphere: above 0 the map has made the surface smaller, as \
                 it does with limbs";
    let scale = Scale { name: "scale", title: "Scale (log)", about, kind: "diverging", values: scales(cut, &images) };
    let about = "the pieces where the conformal map puts them on the sphere, the poles at the top and the bottom";
    let on_surface = pieces(cut, content.flat, None);
    Some(Model { name: "sphere", title: "Sphere", about, points, fields: vec![scale], ..on_surface })
}

/// Half the logarithm of how many times as large the faces around a vertex are on the surface as on the sphere, but for the
/// mean of that.
fn scales(cut: &CutMesh, images: &[Vec3]) -> Vec<f64> {
    let mesh = &cut.mesh;
    let mut areas = vec![[0.0; 2]; mesh.vertex_count()];
    for f in mesh.faces() {
        let [a, b, c] = mesh.face_vertices(f).map(|v| images[v.index()]);
        let both = [mesh.area(f), 0.5 * (b - a).cross(&(c - a)).norm()];
        for v in mesh.face_vertices(f) {
            areas[v.index()].iter_mut().zip(both).for_each(|(sum, area)| *sum += area);
        }
    }
    let [surface, sphere] = areas.iter().fold([0.0; 2], |sum, it| [sum[0] + it[0], sum[1] + it[1]]);
    let share = |it: &[f64; 2]| 0.5 * ((it[0] / surface) / (it[1] / sphere).max(f64::MIN_POSITIVE)).ln();
    areas.iter().map(share).collect()
}

/// Panels side by side, none sharing a vertex with another.
fn strips(strips: &Strips) -> Model {
    let mut out = Model {
        name: "strips",
        title: "Strips",
        about: "planar panels between straight bending lines, strip by strip",
        points: vec![],
        triangles: vec![],
        flat: vec![],
        pieces: vec![],
        strips: vec![],
        fields: vec![],
    };
    for (panel, strip) in strips.panels.iter().zip(strips.numbers()) {
        let first = out.points.len() as u32;
        let corners = strips.flat_outline(panel);
        out.triangles.extend(ears(&corners).into_iter().map(|t| t.map(|k| first + k as u32)));
        out.points.extend(panel.outline.iter().map(|&it| strips.place(it)));
        out.pieces.extend(corners.iter().map(|_| panel.piece.0));
        out.strips.extend(corners.iter().map(|_| strip as u32));
        out.flat.extend(corners);
    }
    out
}

fn rulings(strips: &Strips) -> Lines {
    let ends = strips.rulings.iter().map(|it| (Some(it.piece), it.ends.map(|end| strips.place(end)).to_vec()));
    Lines {
        name: "rulings",
        title: "Rulings",
        models: &["developed", "cut", "strips"],
        runs: ends.collect(),
        flat: strips.rulings.iter().map(|it| it.ends.map(|end| strips.flat(end)).to_vec()).collect(),
    }
}

fn stripes(stripes: &Stripes) -> Lines {
    let run = |line: &crate::model::StripeLine| {
        let close = line.points.first().filter(|_| line.closed);
        (None, line.points.iter().chain(close).copied().collect())
    };
    Lines {
        name: "stripes",
        title: "Stripes",
        models: &["input", "coarse", "developed"],
        runs: stripes.lines.iter().map(run).collect(),
        flat: vec![],
    }
}

/// Singularities of the stripes.
fn dots(stripes: &Stripes) -> Value {
    let row = |it: &crate::model::StripeEnd| {
        let place = [it.place.x, it.place.y, it.place.z].map(rounded);
        json!({ "place": place, "text": format!("{:+}", it.index) })
    };
    json!([{
        "name": "singularities",
        "title": "Singularities",
        "models": ["input", "coarse", "developed"],
        "rows": stripes.found.iter().map(row).collect::<Vec<_>>(),
    }])
}

fn names(cut: &CutMesh) -> Value {
    let mut faces = Field::<PieceId, usize>::filled(cut.pieces.len(), 0);
    let mut areas = Field::<PieceId, f64>::filled(cut.pieces.len(), 0.0);
    for f in cut.mesh.faces() {
        faces[cut.piece_of[f]] += 1;
        areas[cut.piece_of[f]] += cut.mesh.area(f);
    }
    let row = |(id, it): (PieceId, &crate::model::Piece)| json!({ "name": it.name, "faces": faces[id], "area_mm2": rounded(areas[id]) });
    cut.pieces.enumerate().map(row).collect()
}

/// Both sides of every seam as chains of vertices of the cut mesh, in the same direction.
fn seams(cut: &CutMesh, pack: &mut Pack) -> Value {
    let mesh = &cut.mesh;
    let row = |seam: &crate::model::Seam| {
        let length: f64 = seam.sides[0].iter().map(|&h| mesh.vector(h).norm()).sum();
        let [left, right] = &seam.sides;
        let forward = left.iter().take(1).map(|&h| mesh.tail(h)).chain(left.iter().map(|&h| mesh.head(h)));
        let backward = right.iter().take(1).map(|&h| mesh.head(h)).chain(right.iter().map(|&h| mesh.tail(h)));
        let chains = [pack.integers(forward.map(|v| v.0)), pack.integers(backward.map(|v| v.0))];
        let pieces = [left, right].map(|it| cut.piece_of[mesh.face(it[0])].0);
        json!({
            "label": seam.label,
            "pieces": pieces,
            "mm": rounded(length),
            "sides": chains,
        })
    };
    cut.seams.iter().map(row).collect()
}

/// Thousandths: what people read needs no more.
pub(super) fn rounded(value: f64) -> f64 {
    (value * 1000.0).round() / 1000.0
}

impl Model {
    fn write(&self, grid: &Grid<3>, flat: &Grid<2>, pack: &mut Pack) -> Value {
        let points: Vec<[u16; 3]> = self.points.iter().map(|p| grid.cell([p.x, p.y, p.z])).collect();
        let mut out = json!({
            "name": self.name,
            "title": self.title,
            "about": self.about,
            "points": pack.shorts(&points),
            "triangles": pack.integers(self.triangles.iter().flatten().copied()),
            "fields": self.fields.iter().map(|it| it.write(pack)).collect::<Vec<_>>(),
        });
        if !self.flat.is_empty() {
            let points: Vec<[u16; 2]> = self.flat.iter().map(|p| flat.cell([p.x, p.y])).collect();
            out["flat"] = pack.shorts(&points);
        }
        for (key, values) in [("pieces", &self.pieces), ("strips", &self.strips)] {
            if !values.is_empty() {
                out[key] = pack.integers(values.iter().copied());
            }
        }
        out
    }
}

impl Scale {
    fn write(&self, pack: &mut Pack) -> Value {
        let most = self.values.iter().fold(0.0, |most: f64, it| most.max(it.abs()));
        let share = |value: f64| match self.kind {
            _ if most == 0.0 => 0.5,
            "log" => 1.0 + (value.abs() / most).max(f64::MIN_POSITIVE).log10() / DECADES,
            _ => 0.5 + 0.5 * value / most,
        };
        let bytes: Vec<u8> = self.values.iter().map(|&it| (255.0 * share(it).clamp(0.0, 1.0)).round() as u8).collect();
        json!({
            "name": self.name,
            "title": self.title,
            "about": self.about,
            "kind": self.kind,
            "most": most,
            "decades": DECADES,
            "values": pack.bytes(&bytes),
        })
    }
}

impl Lines {
    fn write(&self, grid: &Grid<3>, flat: &Grid<2>, pack: &mut Pack) -> Value {
        let points: Vec<[u16; 3]> = self.runs.iter().flat_map(|it| &it.1).map(|p| grid.cell([p.x, p.y, p.z])).collect();
        let mut out = json!({
            "name": self.name,
            "title": self.title,
            "models": self.models,
            "points": pack.shorts(&points),
            "runs": pack.integers(self.runs.iter().map(|it| it.1.len() as u32)),
            // 0 for lines that lie on no one piece.
            "pieces": pack.integers(self.runs.iter().map(|it| it.0.map_or(0, |piece| piece.0 + 1))),
        });
        if !self.flat.is_empty() {
            let points: Vec<[u16; 2]> = self.flat.iter().flatten().map(|p| flat.cell([p.x, p.y])).collect();
            out["flat"] = pack.shorts(&points);
        }
        out
    }
}
