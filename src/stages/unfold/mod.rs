//! Unfolds a polyhedron exactly: every face keeps its shape, pieces are trees of faces joined at folds, no piece overlaps
//! itself, and there are few of them with short seams.
mod forest;
mod search;
mod slice;
pub mod stage;
#[cfg(test)]
mod tests;
mod tiles;

use std::collections::BTreeSet;

use crate::{
    geom::{Vec2, angle_between, polygon::convex_hull},
    mesh::{EdgeId, FaceId, Field, HalfedgeId, Id, MeshError, TriMesh, VertexId},
    model::{CutMesh, Flattening, Overlap, Piece, PieceId, Seam},
    numeric::{Cancelled, Monitor},
    surface::{
        opening,
        overlap::{close_edges, overlapping_triangles},
    },
};
use forest::Forest;
use tiles::Tiles;

/// Faces keep their lengths to this share of the diagonal.
pub const ISOMETRY: f64 = 1e-9;
/// Both sides of a cut that lie nearer than this share of the diagonal are no cut.
const CLOSED: f64 = 1e-10;
/// Triangles that share less than this overlap by rounding only, mm².
const ROUNDING: f64 = 1e-9;
/// Parts of an outline that are not neighbours never come nearer than this, mm.
const TOUCH: f64 = 1e-6;
/// A seam ends where either of its sides turns by more in the plane, radians: what is glued in one go is straight.
const STRAIGHT: f64 = 0.1;

/// What to keep to.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// Meshes with more faces are refused: nobody folds them.
    pub max_faces: usize,
    /// Least distance between parts of a piece that are not neighbours, mm.
    pub clearance: f64,
    /// Least angle between two faces at a vertex that they have in common, if it is not the slit between them, radians.
    pub least_opening: f64,
    /// Moves tried from each start.
    pub moves: usize,
    /// Width and height that a piece must fit into in some rotation, mm; `None`: any size.
    pub sheet: Option<[f64; 2]>,
    /// Whether flat regions that do not fit are divided along straight lines.
    pub split: bool,
    /// Whether every flat region is a piece of its own, for stock that cannot be folded.
    pub separate: bool,
    /// For the moves.
    pub seed: u64,
}

/// Why a mesh cannot be unfolded.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum UnfoldError {
    /// Interrupted.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// Too many faces to be folded.
    #[error(
        "the mesh has {faces} faces, and more than {limit} are not unfolded face by face; set coarsen.method = \"quadric\" and coarsen.faces (300 is a good figure), allow more with unfold.max_faces, or take recipe = \"developable\""
    )]
    TooMany {
        /// Faces of the mesh.
        faces: usize,
        /// The limit.
        limit: usize,
    },
    /// The opened mesh is not a mesh any more.
    #[error("the mesh cannot be opened along its cuts: {0}")]
    Open(#[from] MeshError),
}

/// Unfolds a mesh into flat pieces.
pub fn unfold(mesh: &TriMesh, options: &Options, monitor: &Monitor) -> Result<(CutMesh, Flattening), UnfoldError> {
    let (faces, limit) = (mesh.face_count(), options.max_faces);
    if faces > limit {
        return Err(UnfoldError::TooMany { faces, limit });
    }
    let (mesh, group) = match options.sheet.filter(|_| options.split) {
        Some(room) => slice::slice(mesh, room, monitor)?,
        None => (mesh.clone(), Field::filled(mesh.face_count(), 0)),
    };
    let mesh = &mesh;
    let tiles = Tiles::new(mesh, &group);
    let mut forest = match options.separate {
        true => Forest::new(&tiles, options),
        false => search::search(mesh, &tiles, options, monitor)?,
    };
    let tile_of = tile_of(mesh, &tiles);
    loop {
        monitor.check()?;
        forest = Forest::of(&tiles, options, forest.folded());
        let (cut, flat) = open(mesh, &tiles, &forest)?;
        // Judged exactly, and by the outline as it will be cut; what the search let through by rounding is opened.
        let conflicts = conflicts(&cut, &flat);
        let mut opened = BTreeSet::new();
        for faces in conflicts {
            let [a, b] = faces.map(|f| tile_of[f]);
            let path = if a == b { vec![] } else { forest.path(a, b) };
            if !path.is_empty() && path.iter().all(|it| !opened.contains(it)) {
                opened.insert(path[path.len() / 2]);
            }
        }
        if opened.is_empty() {
            return Ok((cut, flat));
        }
        opened.into_iter().for_each(|it| forest.split(it));
    }
}

fn tile_of(mesh: &TriMesh, tiles: &Tiles) -> Field<FaceId, u32> {
    let mut out = Field::filled(mesh.face_count(), 0);
    for (t, tile) in tiles.tiles.iter().enumerate() {
        tile.faces.iter().for_each(|&f| out[f] = t as u32);
    }
    out
}

/// The mesh opened along all hinges that are not folded, and its pieces in the plane.
fn open(mesh: &TriMesh, tiles: &Tiles, forest: &Forest) -> Result<(CutMesh, Flattening), MeshError> {
    let mut corner = Field::<HalfedgeId, Vec2>::filled(mesh.halfedge_count(), Vec2::zeros());
    for (t, tile) in tiles.tiles.iter().enumerate() {
        let place = forest.place(t as u32);
        for (corners, &f) in tile.triangles.iter().zip(&tile.faces) {
            for (h, p) in mesh.face_halfedges(f).into_iter().zip(corners) {
                corner[h] = (place * nalgebra::Point2::from(*p)).coords;
            }
        }
    }
    let mut cut = Field::filled(mesh.edge_count(), false);
    for (k, hinge) in tiles.hinges.iter().enumerate() {
        hinge.edges.iter().for_each(|&e| cut[e] = !forest.is_folded(k as u32));
    }
    close(mesh, tiles, forest, &corner, &mut cut);
    let opening = opening::open(mesh, &cut)?;
    let mut uv = Field::filled(opening.mesh.vertex_count(), Vec2::zeros());
    for h in opening.mesh.halfedges() {
        uv[opening.mesh.tail(h)] = corner[h];
    }
    let mut seams: Vec<[Vec<HalfedgeId>; 2]> = Vec::new();
    for sides in opening.seams {
        seams.extend(straight(&opening.mesh, &uv, sides));
    }
    let seams = seams.into_iter().zip(1..).map(|(sides, label)| Seam { label, sides }).collect();
    let cut = CutMesh {
        origin: opening.origin,
        piece_of: Field::from_vec(opening.piece_of.iter().map(|&it| PieceId(it)).collect()),
        pieces: Field::from_fn(opening.pieces, |it: PieceId| Piece::numbered(it.index())),
        seams,
        tolerance: f64::INFINITY,
        seam_vertices: 0,
        stretch: ISOMETRY,
        rim: Vec::new(),
        undeveloped: false,
        mesh: opening.mesh,
    };
    let mut flat =
        Flattening { log_factor: Field::filled(uv.len(), 0.0), uv, overlaps: Vec::new(), stretch_limit: ISOMETRY };
    flat.overlaps = overlaps(&cut, &flat);
    Ok((cut, flat))
}

/// Closes slits from their ends as far as both sides lie on each other: there the polyhedron is flat around the vertex.
fn close(
    mesh: &TriMesh,
    tiles: &Tiles,
    forest: &Forest,
    corner: &Field<HalfedgeId, Vec2>,
    cut: &mut Field<EdgeId, bool>,
) {
    let near = CLOSED * mesh.bounds().diagonal();
    let tile_of = tile_of(mesh, tiles);
    let shut = |h: HalfedgeId| {
        let Some(twin) = mesh.twin(h) else { return false };
        let [p, q] = [h, twin].map(|it| forest.piece(tile_of[mesh.face(it)]));
        let close = |a: HalfedgeId, b: HalfedgeId| (corner[a] - corner[b]).norm() <= near;
        p == q && close(h, mesh.next(twin)) && close(mesh.next(h), twin)
    };
    let mut ends: Vec<VertexId> = mesh.vertices().collect();
    while let Some(v) = ends.pop() {
        let mut around = mesh.outgoing(v).filter(|&h| cut[mesh.edge(h)]);
        if let (Some(h), None, false) = (around.next(), around.next(), mesh.is_boundary_vertex(v))
            && shut(h)
        {
            cut[mesh.edge(h)] = false;
            ends.push(mesh.head(h));
        }
    }
}

/// A seam in parts that are straight on both sides.
fn straight(mesh: &TriMesh, uv: &Field<VertexId, Vec2>, sides: [Vec<HalfedgeId>; 2]) -> Vec<[Vec<HalfedgeId>; 2]> {
    let along = |h: HalfedgeId| uv[mesh.head(h)] - uv[mesh.tail(h)];
    let turn = |a: HalfedgeId, b: HalfedgeId| {
        let space = |v: Vec2| crate::geom::Vec3::new(v.x, v.y, 0.0);
        angle_between(space(along(a)), space(along(b)))
    };
    let mut out: Vec<[Vec<HalfedgeId>; 2]> = Vec::new();
    for k in 0..sides[0].len() {
        if k == 0 || sides.iter().any(|it| turn(it[k - 1], it[k]) > STRAIGHT) {
            out.push([Vec::new(), Vec::new()]);
        }
        if let Some(last) = out.last_mut() {
            (0..2).for_each(|side| last[side].push(sides[side][k]));
        }
    }
    out
}

/// Faces of each piece.
fn faces_by_piece(cut: &CutMesh) -> Vec<Vec<FaceId>> {
    let mut out = vec![Vec::new(); cut.pieces.len()];
    cut.piece_of.enumerate().for_each(|(f, it)| out[it.index()].push(f));
    out
}

/// Pairs of faces of one piece whose interiors intersect by more than rounding.
fn overlaps(cut: &CutMesh, flat: &Flattening) -> Vec<Overlap> {
    let mut out = Vec::new();
    for faces in faces_by_piece(cut) {
        let triangles: Vec<[Vec2; 3]> = faces.iter().map(|&f| cut.mesh.face_vertices(f).map(|v| flat.uv[v])).collect();
        let pairs = overlapping_triangles(&triangles).into_iter().filter(|it| it.2 > ROUNDING);
        out.extend(pairs.map(|(i, j, area)| Overlap { faces: [faces[i], faces[j]], area }));
    }
    out
}

/// Pairs of faces that must come apart: they overlap, or the outline touches itself along them.
fn conflicts(cut: &CutMesh, flat: &Flattening) -> Vec<[FaceId; 2]> {
    let mesh = &cut.mesh;
    let mut out: Vec<[FaceId; 2]> = flat.overlaps.iter().map(|it| it.faces).collect();
    let mut loops: Vec<Vec<Vec<HalfedgeId>>> = vec![Vec::new(); cut.pieces.len()];
    for path in mesh.boundary_loops() {
        loops[cut.piece_of[mesh.face(path[0])].index()].push(path);
    }
    for paths in loops {
        let contours: Vec<Vec<Vec2>> =
            paths.iter().map(|it| it.iter().map(|&h| flat.uv[mesh.tail(h)]).collect()).collect();
        let all: Vec<HalfedgeId> = paths.into_iter().flatten().collect();
        let edge = |h: HalfedgeId| [mesh.tail(h), mesh.head(h)].map(|v| cut.origin[v]);
        for (i, j) in close_edges(&contours, TOUCH) {
            let ([a, b], other) = (edge(all[i]), edge(all[j]));
            // Both sides of a slit may lie as close as the slit is narrow.
            if other != [b, a] {
                out.push([all[i], all[j]].map(|h| mesh.face(h)));
            }
        }
    }
    out
}

/// Largest difference between the length of an edge in the plane and in space, mm.
pub fn isometry(cut: &CutMesh, flat: &Flattening) -> f64 {
    let mesh = &cut.mesh;
    let off = |h: HalfedgeId| ((flat.uv[mesh.head(h)] - flat.uv[mesh.tail(h)]).norm() - mesh.vector(h).norm()).abs();
    mesh.halfedges().map(off).fold(0.0, f64::max)
}

/// Convex hull of every piece in the plane.
pub fn hulls(cut: &CutMesh, flat: &Flattening) -> Field<PieceId, Vec<Vec2>> {
    let hull = |faces: Vec<FaceId>| {
        let points: Vec<Vec2> = faces.iter().flat_map(|&f| cut.mesh.face_vertices(f)).map(|v| flat.uv[v]).collect();
        convex_hull(&points)
    };
    Field::from_vec(faces_by_piece(cut).into_iter().map(hull).collect())
}
