//! Previews: the input, coarse, developed and cut mesh, the folded sheet and the steps on its way, its strips, the stripes on it from two sides, nets, the developed mesh after each round, and every sheet, as PNG; what
//! closeness costs, as SVG.
use super::chart;
use crate::{
    geom::{Vec2, Vec3},
    mesh::{FaceId, Field, Id, TriMesh},
    model::{
        CutMesh, DevelopableMesh, FoldSample, Folded, FoldedCrease, GeodesicNet, Milling, NetFit, Operation, Sheets,
        SourceMesh, StripeLine, Stripes, Strips,
    },
    render::{self, Edges, MeshStyle, RenderError, Rgb, SheetStyle, Stroke, Up, palette},
};

/// The nouns to draw; what is absent gets no picture.
#[derive(Clone, Copy)]
pub struct Subjects<'a> {
    /// For the up axis, and the input itself.
    pub source: &'a SourceMesh,
    /// The coarse mesh.
    pub coarse: Option<&'a TriMesh>,
    /// The developed mesh.
    pub developed: Option<&'a DevelopableMesh>,
    /// The cut mesh.
    pub cut: Option<&'a CutMesh>,
    /// The strips.
    pub strips: Option<&'a Strips>,
    /// The stripes.
    pub stripes: Option<&'a Stripes>,
    /// The net of geodesics.
    pub net: Option<&'a NetFit>,
    /// The sheets.
    pub sheets: Option<&'a Sheets>,
    /// What was milled.
    pub milling: Option<&'a Milling>,
    /// The folded sheet, whose mesh is that of `cut`.
    pub folded: Option<&'a Folded>,
    /// Line colours of the machine profile.
    pub line: &'a (dyn Fn(Operation) -> Rgb + Sync),
}

/// A picture still to be drawn.
pub type Drawing<'a> = (String, Box<dyn Fn() -> Result<Vec<u8>, RenderError> + Sync + Send + 'a>);

/// Lines in the plane, mm, with their colours, in the order in which they lie over each other.
pub type Lines = Vec<(Vec<Vec2>, Rgb)>;

/// A PNG of lines, or why there is none.
pub fn lines(lines: &Lines, pixels: u32) -> Result<Vec<u8>, String> {
    render::lines(lines, pixels).map_err(|it| it.to_string())
}

/// Longer side of a sheet's picture, pixels.
const SHEET_PIXELS: u32 = 1600;

/// Sides of the picture of one round.
const ROUND_PIXELS: u32 = 500;

/// Which way is up in the pictures of a job.
pub fn up(source: &SourceMesh) -> Up {
    if source.up == 2 { Up::Z } else { Up::Y }
}

/// Path and drawing of every picture.
pub fn pictures<'a>(subjects: Subjects<'a>) -> Vec<Drawing<'a>> {
    let base = MeshStyle { up: up(subjects.source), ..MeshStyle::default() };
    let mut out: Vec<Drawing<'a>> = Vec::new();
    let mut add = |name: &str, mesh: &'a TriMesh, edges: Edges| {
        let draw = move || render::mesh(mesh, &MeshStyle { edges, ..base });
        out.push((format!("preview/{name}.png"), Box::new(draw)));
    };
    add("input", &subjects.source.mesh, Edges::Boundary);
    if let Some(mesh) = subjects.coarse {
        add("coarse", mesh, Edges::All);
    }
    if let Some(developed) = subjects.developed {
        add("developed", &developed.mesh, base.edges);
        for (i, mesh) in developed.rounds.iter().filter_map(|it| it.mesh.as_ref()).enumerate() {
            let draw = move || render::mesh(mesh, &MeshStyle { width: ROUND_PIXELS, height: ROUND_PIXELS, ..base });
            out.push((format!("preview/round-{:02}.png", i + 1), Box::new(draw)));
        }
        if !developed.tradeoffs.is_empty() {
            let diagonal = subjects.source.mesh.bounds().diagonal();
            let draw = move || Ok(chart::tradeoffs(&developed.tradeoffs, diagonal));
            out.push(("preview/deviation.svg".into(), Box::new(draw)));
        }
    }
    if let Some(cut) = subjects.cut {
        let draw = move || {
            let face = |f: FaceId| palette(cut.piece_of[f].index());
            render::mesh(&cut.mesh, &MeshStyle { face: &face, edges: Edges::Boundary, ..base })
        };
        out.push(("preview/cut.png".into(), Box::new(draw)));
    }
    if let Some((folded, cut)) = subjects.folded.zip(subjects.cut) {
        for (name, turn) in [("folded", 0.0), ("folded-behind", std::f64::consts::PI)] {
            let style = MeshStyle { azimuth: base.azimuth + turn, elevation: ABOVE, ..base };
            out.push((format!("preview/{name}.png"), Box::new(move || draw_folded(folded, &cut.mesh, style))));
        }
        out.push(("preview/folding.png".into(), Box::new(move || folding(folded, &cut.mesh, base))));
    }
    if let Some(strips) = subjects.strips {
        out.push(("preview/strips.png".into(), Box::new(move || draw_strips(strips, base))));
    }
    let under = subjects.developed.map(|it| &it.mesh).or(subjects.coarse);
    if let (Some(stripes), Some(mesh)) = (subjects.stripes, under) {
        for (name, turn) in [("stripes", 0.0), ("stripes-behind", std::f64::consts::PI)] {
            let style = MeshStyle { edges: Edges::Boundary, azimuth: base.azimuth + turn, ..base };
            out.push((format!("preview/{name}.png"), Box::new(move || draw_stripes(stripes, mesh, style))));
        }
    }
    if let Some(fit) = subjects.net {
        out.push(("preview/net.png".into(), Box::new(move || draw_curvature(&fit.net, base))));
        if !fit.strain.is_empty() {
            out.push(("preview/strain.png".into(), Box::new(move || draw_strain(fit, base))));
        }
    }
    if let Some(milling) = subjects.milling {
        out.push(("preview/mill.png".into(), Box::new(move || draw_milling(milling, base))));
    }
    for (i, sheet) in subjects.sheets.iter().flat_map(|it| it.sheets.iter().enumerate()) {
        let margin = subjects.sheets.map_or(0.0, |it| it.margin);
        let line = subjects.line;
        let draw = move || {
            // A part has the colour of its piece in the picture of the cut mesh.
            let fill = |k: usize| palette(sheet.placements[k].part);
            render::sheet(sheet, &SheetStyle { pixels: SHEET_PIXELS, line: &line, fill: &fill, margin })
        };
        out.push((format!("preview/sheet-{:02}.png", i + 1), Box::new(draw)));
    }
    out
}

/// Lines in the colour of their kind (open, closed), dots where a tool starts, where lines begin and where they end.
fn draw_stripes(stripes: &Stripes, mesh: &TriMesh, base: MeshStyle<'_>) -> Result<Vec<u8>, RenderError> {
    const OPEN: Rgb = [0x1f, 0x5f, 0xa8];
    const CLOSED: Rgb = [0x4a, 0x4f, 0x58];
    const START: Rgb = [0x2e, 0x9e, 0x4f];
    const BEGIN: Rgb = [0xd1, 0x2b, 0x2b];
    const END: Rgb = [0x11, 0x14, 0x18];
    let line = |it: &StripeLine| Stroke {
        points: it.points.clone(),
        closed: it.closed,
        color: if it.closed { CLOSED } else { OPEN },
        width: 1.6,
    };
    let dot = |place: Vec3, color, width| Stroke { points: vec![place], closed: false, color, width };
    let starts = stripes.lines.iter().filter_map(|it| Some(dot(*it.points.first()?, START, 6.0)));
    let ends = stripes.found.iter().map(|it| {
        // As wide as the number of lines.
        let width = 8.0 + 3.0 * f64::from(it.index.unsigned_abs().saturating_sub(1));
        dot(it.place, if it.index > 0 { BEGIN } else { END }, width)
    });
    let strokes: Vec<Stroke> = stripes.lines.iter().map(line).chain(starts).chain(ends).collect();
    render::mesh(mesh, &MeshStyle { strokes: &strokes, ..base })
}

/// How far above the horizon a folded sheet is looked at from, radians.
const ABOVE: f64 = 0.6;
/// Sides of a picture of a step of folding, pixels, and most of them in a row.
const STEP: (u32, usize) = (400, 4);

/// The sheet with its mountains in red and its valleys in blue.
fn draw_folded(folded: &Folded, mesh: &TriMesh, base: MeshStyle<'_>) -> Result<Vec<u8>, RenderError> {
    const MOUNTAIN: Rgb = [0xc8, 0x1e, 0x1e];
    const VALLEY: Rgb = [0x1f, 0x4f, 0xb8];
    let strokes = |it: &FoldedCrease| {
        let again = it.samples.first().filter(|_| it.closed);
        let samples: Vec<_> = it.samples.iter().chain(again).collect();
        let stroke = |w: &[&FoldSample]| {
            let color = if w[0].angle + w[1].angle > 0.0 { MOUNTAIN } else { VALLEY };
            Stroke { points: vec![w[0].place, w[1].place], closed: false, color, width: 2.0 }
        };
        samples.windows(2).map(stroke).collect::<Vec<_>>()
    };
    let strokes: Vec<Stroke> = folded.creases.iter().flat_map(strokes).collect();
    render::mesh(mesh, &MeshStyle { strokes: &strokes, edges: Edges::Boundary, ..base })
}

/// The picture of the steps for the page; `None` where nothing was folded or no picture could be drawn.
pub(super) fn folding_strip(subjects: &Subjects<'_>) -> Option<Vec<u8>> {
    let (folded, cut) = subjects.folded.zip(subjects.cut)?;
    folding(folded, &cut.mesh, MeshStyle { up: up(subjects.source), ..MeshStyle::default() }).ok()
}

/// Pixels of a side of the pictures of a net on the page.
const NET_PIXELS: u32 = 640;

/// Pictures of a net for the page, each with what its colours say.
pub(super) fn net_pictures(subjects: &Subjects<'_>) -> Vec<(&'static str, Vec<u8>)> {
    let Some(fit) = subjects.net else { return Vec::new() };
    let style = MeshStyle { width: NET_PIXELS, height: NET_PIXELS, up: up(subjects.source), ..MeshStyle::default() };
    let mut out =
        vec![("Gaussian curvature: red where positive, blue where negative", draw_curvature(&fit.net, style))];
    if !fit.strain.is_empty() {
        out.push(("strain: darkest where it is largest", draw_strain(fit, style)));
    }
    out.into_iter().filter_map(|(about, picture)| Some((about, picture.ok()?))).collect()
}

/// The steps from flat to folded, side by side.
fn folding(folded: &Folded, mesh: &TriMesh, base: MeshStyle<'_>) -> Result<Vec<u8>, RenderError> {
    let (side, row) = STEP;
    let style = MeshStyle { width: side, height: side, elevation: ABOVE, ..base };
    let step = |points: &Vec<Vec3>| {
        Ok(render::scene(&mesh.with_positions(Field::from_vec(points.clone())), &style, &[])?.pixels)
    };
    let pictures = folded.frames.iter().map(|it| step(&it.points)).collect::<Result<Vec<_>, RenderError>>()?;
    render::tiles(&pictures, [side, side], row)
}

/// Panels with their outlines, a colour per strip, shade by their normals.
fn draw_strips(strips: &Strips, base: MeshStyle<'_>) -> Result<Vec<u8>, RenderError> {
    let (mesh, panels) = strips.mesh().ok_or_else(|| RenderError::Png("there are no panels".into()))?;
    let number = strips.numbers();
    let face = |f: FaceId| palette(number[panels[f.index()]]);
    render::mesh(&mesh, &MeshStyle { face: &face, edges: Edges::Boundary, ..base })
}

/// Geodesics of a net, dark, over its faces in the colour of its Gaussian curvature: red where it is positive, blue where it is
/// negative, full at the curvature that 95 % of the points stay below.
fn draw_curvature(net: &GeodesicNet, base: MeshStyle<'_>) -> Result<Vec<u8>, RenderError> {
    const FLAT: [f64; 3] = [240.0, 238.0, 234.0];
    const POSITIVE: [f64; 3] = [205.0, 60.0, 45.0];
    const NEGATIVE: [f64; 3] = [45.0, 95.0, 195.0];
    let (m, n) = (net.rows, net.columns);
    let values: Vec<f64> = (0..m * n)
        .map(|k| net.gaussian_curvature((k / n).clamp(1, m - 2), (k % n).clamp(1, n - 2)).unwrap_or(0.0))
        .collect();
    let mut sizes: Vec<f64> = values.iter().map(|it| it.abs()).collect();
    sizes.sort_by(f64::total_cmp);
    let full = sizes[sizes.len() * 95 / 100].max(f64::MIN_POSITIVE);
    draw_net(net, base, &|k| mix(FLAT, if values[k] < 0.0 { NEGATIVE } else { POSITIVE }, values[k].abs() / full))
}

/// The same coloured by the amount of strain, full at the largest.
fn draw_strain(fit: &NetFit, base: MeshStyle<'_>) -> Result<Vec<u8>, RenderError> {
    const NONE: [f64; 3] = [236.0, 240.0, 226.0];
    const MOST: [f64; 3] = [150.0, 30.0, 110.0];
    let full = fit.strain.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
    draw_net(&fit.net, base, &|k| mix(NONE, MOST, fit.strain[k] / full))
}

fn mix(from: [f64; 3], to: [f64; 3], share: f64) -> Rgb {
    [0, 1, 2].map(|k| (from[k] + (to[k] - from[k]) * share.clamp(0.0, 1.0)).round() as u8)
}

/// Quads in the colour of their first corner, with all geodesics.
fn draw_net(
    net: &GeodesicNet,
    base: MeshStyle<'_>,
    color: &(dyn Fn(usize) -> Rgb + Sync),
) -> Result<Vec<u8>, RenderError> {
    const INK: Rgb = [0x5a, 0x1f, 0x1f];
    let mesh = net.mesh().map_err(|err| RenderError::Png(err.to_string()))?;
    let quads = net.columns - 1;
    // Two triangles of each quad follow each other.
    let face = |f: FaceId| color(net.index(f.index() / 2 / quads, f.index() / 2 % quads));
    let line = |j: usize| (0..net.rows).map(|i| net.at(i, j)).collect();
    let strokes: Vec<Stroke> =
        (0..net.columns).map(|j| Stroke { points: line(j), closed: false, color: INK, width: 1.2 }).collect();
    render::mesh(&mesh, &MeshStyle { face: &face, strokes: &strokes, edges: Edges::Boundary, ..base })
}

/// What is left of the surface in blue, what is cut into in red, both full at their limits; pale where all is well, grey where
/// nothing passed. Seen from the side that was milled.
fn draw_milling(milling: &Milling, base: MeshStyle<'_>) -> Result<Vec<u8>, RenderError> {
    const PALE: [f64; 3] = [236.0, 240.0, 226.0];
    const LEFT: [f64; 3] = [40.0, 90.0, 190.0];
    const DEEP: [f64; 3] = [200.0, 30.0, 30.0];
    let [gouge, excess] = milling.limits;
    let face = |f: FaceId| -> Rgb {
        let Some(it) = milling.deviation[f.index()] else { return [150, 152, 158] };
        let (full, share) = if it < 0.0 { (DEEP, -it / gouge) } else { (LEFT, it / excess) };
        mix(PALE, full, share)
    };
    let mesh = &milling.painted;
    let passed = mesh.faces().filter(|f| milling.deviation[f.index()].is_some());
    let out: Vec3 = passed.map(|f| mesh.area_vector(f)).sum();
    let out = if base.up == Up::Z { Vec3::new(out.x, out.z, -out.y) } else { out };
    let azimuth = if out.norm() > 0.0 { out.x.atan2(out.z) + 0.3 } else { base.azimuth };
    let elevation = (out.y.atan2(out.x.hypot(out.z))).clamp(-0.9, 0.9) + 0.15;
    render::mesh(mesh, &MeshStyle { face: &face, edges: Edges::Boundary, azimuth, elevation, ..base })
}
