//! The order in which pieces are joined, and a page with a picture for every step.
use rayon::prelude::*;
use serde_json::{Value, json};

use crate::{
    emit::booklet::Page,
    geom::{Vec2, Vec3},
    mesh::{FaceId, Field, HalfedgeId, Id, TriMesh, VertexId},
    model::{CutMesh, PieceId, Seam},
    render::{self, Edges, MeshStyle, RenderError, Rgb, Up},
};

/// One piece that is added to what is there.
#[derive(Debug, Clone, PartialEq)]
pub struct Step {
    /// The piece.
    pub piece: PieceId,
    /// Indices of the seams of the piece with itself, which are closed first.
    pub own: Vec<usize>,
    /// Indices of the seams to what is there, with the piece on their other side.
    pub joined: Vec<(usize, PieceId)>,
}

/// The pieces in an order in which each touches what is there as soon as any can: the largest first, then always the one
/// with the longest seams to those in place. A piece that touches none of them begins another body.
pub fn steps(cut: &CutMesh) -> Vec<Step> {
    let sides: Vec<[PieceId; 2]> =
        cut.seams.iter().map(|it| [0, 1].map(|side| cut.piece_of[cut.mesh.face(it.sides[side][0])])).collect();
    let length: Vec<f64> = cut.seams.iter().map(|it| seam_length(cut, it)).collect();
    let mut placed = Field::<PieceId, bool>::filled(cut.pieces.len(), false);
    let mut out: Vec<Step> = Vec::new();
    while out.len() < cut.pieces.len() {
        let mut contact = Field::<PieceId, f64>::filled(cut.pieces.len(), 0.0);
        for (k, &[a, b]) in sides.iter().enumerate() {
            for (here, there) in [(a, b), (b, a)] {
                if !placed[here] && placed[there] {
                    contact[here] += length[k];
                }
            }
        }
        // Pieces are numbered from the largest, which wins a tie.
        let free = contact.enumerate().filter(|it| !placed[it.0]);
        let best = free.fold(None, |best: Option<(PieceId, f64)>, (id, &it)| match best {
            Some(known) if known.1 >= it => Some(known),
            _ => Some((id, it)),
        });
        let Some((piece, _)) = best else { break };
        let across = |it: &[PieceId; 2]| if it[0] == piece { it[1] } else { it[0] };
        let of_piece = || sides.iter().enumerate().filter(|it| it.1.contains(&piece));
        out.push(Step {
            piece,
            own: of_piece().filter(|it| across(it.1) == piece).map(|it| it.0).collect(),
            joined: of_piece().map(|it| (it.0, across(it.1))).filter(|it| placed[it.1]).collect(),
        });
        placed[piece] = true;
    }
    out
}

fn seam_length(cut: &CutMesh, seam: &Seam) -> f64 {
    seam.sides[0].iter().map(|&h| cut.mesh.vector(h).norm()).sum()
}

/// The table `assembly` of the report.
pub fn table(cut: &CutMesh, steps: &[Step], joining: &str) -> Value {
    let name = |id: PieceId| &cut.pieces[id].name;
    let row = |(k, it): (usize, &Step)| {
        let mut to: Vec<&String> = it.joined.iter().map(|it| name(it.1)).collect();
        to.sort();
        to.dedup();
        json!({
            "step": k + 1,
            "part": name(it.piece),
            "seams": it.joined.iter().map(|it| cut.seams[it.0].label).collect::<Vec<_>>(),
            "to": to,
            "own_seams": it.own.iter().map(|&it| cut.seams[it].label).collect::<Vec<_>>(),
        })
    };
    json!({ "joining": joining, "steps": steps.iter().enumerate().map(row).collect::<Vec<_>>() })
}

/// Pixels of a side of a picture.
const SIDE: u32 = 640;
/// Pixels of a side of the pictures that views are judged by.
const SMALL: u32 = 32;
/// Views tried: around the upright axis, from above and from below, radians.
const AROUND: usize = 8;
const ELEVATIONS: [f64; 2] = [0.4, -0.35];
/// What counts for the view: the new piece, and to this power what it is joined to.
const CONTEXT: f64 = 0.5;
/// What is in place, and what is new.
const IN_PLACE: Rgb = [0xd9, 0xd5, 0xcc];
const NEW: Rgb = [0xf2, 0x9a, 0x3e];
/// Words in the picture stand at least this far apart, pixels.
const APART: f64 = 26.0;

/// A page for every step. `joining` says how seams are joined.
pub fn pages(cut: &CutMesh, steps: &[Step], joining: &str, up: Up) -> Result<Vec<Page>, RenderError> {
    let page = |k: usize| {
        let step = &steps[k];
        let shown: Vec<PieceId> = steps[..=k].iter().map(|it| it.piece).collect();
        let (mesh, origin) = of_pieces(cut, &shown);
        let is_new = |f: FaceId| cut.piece_of[origin[f.index()]] == step.piece;
        let color = |f: FaceId| if is_new(f) { NEW } else { IN_PLACE };
        let style = MeshStyle { face: &color, edges: Edges::ByAngle(0.9), up, ..MeshStyle::default() };
        let (azimuth, elevation) = view(&mesh, &style, &is_new)?;
        let style = MeshStyle { width: SIDE, height: SIDE, azimuth, elevation, ..style };
        let (places, words) = middles(cut, step);
        let scene = render::scene(&mesh, &style, &places)?;
        let mut labels: Vec<(Vec2, String)> = Vec::new();
        for (at, word) in scene.places.into_iter().zip(words).filter_map(|(at, word)| Some((at?, word))) {
            if labels.iter().all(|it| (it.0 - at).norm() >= APART) {
                labels.push((at, word));
            }
        }
        let name = &cut.pieces[step.piece].name;
        let title = format!("{} of {}: part {name}", k + 1, steps.len());
        Ok(Page { title, text: text(cut, step, joining), side: SIDE, pixels: scene.pixels, labels })
    };
    (0..steps.len()).into_par_iter().map(page).collect()
}

/// The faces of some pieces as a mesh, and the face of the cut mesh that each is.
fn of_pieces(cut: &CutMesh, pieces: &[PieceId]) -> (TriMesh, Vec<FaceId>) {
    const NONE: u32 = u32::MAX;
    let origin: Vec<FaceId> = cut.mesh.faces().filter(|&f| pieces.contains(&cut.piece_of[f])).collect();
    let mut number = vec![NONE; cut.mesh.vertex_count()];
    let mut positions = Vec::new();
    let mut local = |v: VertexId| {
        if number[v.index()] == NONE {
            number[v.index()] = positions.len() as u32;
            positions.push(cut.mesh.position(v));
        }
        number[v.index()]
    };
    let faces: Vec<[u32; 3]> = origin.iter().map(|&f| cut.mesh.face_vertices(f).map(&mut local)).collect();
    (TriMesh::new(positions, &faces).expect("whole pieces of a mesh are a mesh"), origin)
}

/// The view that shows most of what is new, with something of what it is joined to.
fn view(mesh: &TriMesh, style: &MeshStyle<'_>, is_new: &dyn Fn(FaceId) -> bool) -> Result<(f64, f64), RenderError> {
    let mut best = (-1.0, (style.azimuth, style.elevation));
    for elevation in ELEVATIONS {
        for k in 0..AROUND {
            let azimuth = style.azimuth + std::f64::consts::TAU * k as f64 / AROUND as f64;
            let small = MeshStyle { width: SMALL, height: SMALL, azimuth, elevation, ..*style };
            let seen = render::seen(mesh, &small)?;
            let count = |new: bool| seen.enumerate().filter(|it| is_new(it.0) == new).map(|it| *it.1).sum::<u32>();
            let score = f64::from(count(true)) * f64::from(1 + count(false)).powf(CONTEXT);
            if score > best.0 {
                best = (score, (azimuth, elevation));
            }
        }
    }
    Ok(best.1)
}

/// Where the middles of the seams lie that are joined, the longest seam first, and their numbers.
fn middles(cut: &CutMesh, step: &Step) -> (Vec<Vec3>, Vec<String>) {
    let mut seams: Vec<&Seam> = step.joined.iter().map(|it| &cut.seams[it.0]).collect();
    seams.sort_by(|a, b| seam_length(cut, b).total_cmp(&seam_length(cut, a)).then(a.label.cmp(&b.label)));
    let middle = |it: &Seam| {
        let half = seam_length(cut, it) / 2.0;
        let mut before = 0.0;
        let on = |h: &&HalfedgeId| {
            before += cut.mesh.vector(**h).norm();
            before >= half
        };
        let h = *it.sides[0].iter().find(on).unwrap_or(&it.sides[0][0]);
        cut.mesh.position(cut.mesh.tail(h)) + cut.mesh.vector(h) / 2.0
    };
    seams.into_iter().map(|it| (middle(it), it.label.to_string())).unzip()
}

/// What to do, in words.
fn text(cut: &CutMesh, step: &Step, joining: &str) -> Vec<String> {
    let list = |seams: &mut dyn Iterator<Item = usize>| {
        let labels: Vec<String> = seams.map(|it| cut.seams[it].label.to_string()).collect();
        let word = if labels.len() == 1 { "seam" } else { "seams" };
        format!("{word} {}", labels.join(", "))
    };
    let name = &cut.pieces[step.piece].name;
    let mut out = Vec::new();
    if !step.own.is_empty() {
        out.push(format!("Within part {name}: {}.", list(&mut step.own.iter().copied())));
    }
    let mut others: Vec<PieceId> = step.joined.iter().map(|it| it.1).collect();
    others.sort();
    others.dedup();
    for other in others {
        let mut seams = step.joined.iter().filter(|it| it.1 == other).map(|it| it.0);
        out.push(format!("To part {}: {}.", cut.pieces[other].name, list(&mut seams)));
    }
    out.push(if out.is_empty() { "Begin with this part.".into() } else { format!("{joining}.") });
    out
}
