//! Cuts a surface into pieces that lie flat: every piece a planar domain of which 99.9 % of the area, polished, stays
//! within the material's stretch, and whose outline in the plane is a simple polygon.
//!
//! What is far from the limit is found cheaply: with the boundary kept isometric one sparse solve tells the log factor u
//! of a piece, and a cut through a vertex removes its curvature from the right-hand side. So cuts run to where |u| is
//! largest, along creases; what is near the limit is laid flat and polished as it will be in the end. Pieces that overlap themselves or fit on no sheet are divided; then whatever can be glued again within the limit is glued, and single
//! pieces and pairs of them are cut anew as long as that makes the seams shorter.
mod across;
mod divide;
mod guide;
mod hinge;
mod improve;
mod join;
mod narrow;
mod neck;
mod obstacle;
mod piece;
mod relieve;
mod search;
mod segment;
mod sheet;
mod small;
pub mod stage;
mod straighten;

pub use across::{Across, Divisions, divisions};
pub use guide::{Traced, left_uncut, painted, trace};
pub use narrow::{NarrowNeck, narrow};
pub use obstacle::{Obstacle, obstacle};

use crate::{
    geom::Vec3,
    mesh::{EdgeId, FaceId, Field, HalfedgeId, Id, MeshError, TriMesh},
    model::{CutMesh, DevelopableMesh, Piece, PieceId, Seam},
    numeric::{Cancelled, Monitor},
    surface::{flatten::FlattenError, opening},
};

/// A side of the surface: all that lies within `share` of its extent of where it ends in a direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Side {
    /// The direction, of any length but 0.
    pub towards: Vec3,
    /// Share of the extent, 0 to 1.
    pub share: f64,
}

/// A part of the surface that seams are led to or kept off.
#[derive(Debug, Clone, PartialEq)]
pub enum Region {
    /// A side.
    Side(Side),
    /// What lies about the middle plane across a direction: within `share` of the extent.
    Middle(Side),
    /// Faces of the mesh that is cut, ascending: the edges between them.
    Faces(Vec<FaceId>),
}

/// What to keep to.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// Limit of the principal stretch max |ln σ| of a triangle.
    pub stretch: f64,
    /// Developability energy above which a vertex is made a terminal of the first cut; `None`: terminals follow from the
    /// stretch alone.
    pub tolerance: Option<f64>,
    /// Least distance between parts of one outline that do not follow one another, mm.
    pub clearance: f64,
    /// Least angle by which a slit must open at its end, radians.
    pub least_opening: f64,
    /// What one more piece is worth, as a length of seam over the bounding-box diagonal.
    pub new_piece: f64,
    /// How often an arc of a seam is halved to try whether a part of it can be glued.
    pub halvings: u32,
    /// Area under which a piece is of no use, mm².
    pub min_area: f64,
    /// Pieces are kept from hanging together by less than this and from being strips narrower than this, mm.
    pub min_neck: f64,
    /// What a neck narrower than that costs, as a length of seam over the bounding-box diagonal.
    pub neck: f64,
    /// Parts that seams are led to where that costs little.
    pub prefer: Vec<Region>,
    /// Parts that seams are kept off where that costs little.
    pub avoid: Vec<Region>,
    /// Edges that are seams whatever it costs, ascending.
    pub seams: Vec<EdgeId>,
    /// Seams that should be so many times as long in the plane as in space; the others keep their length.
    pub scales: Vec<(EdgeId, f64)>,
    /// Width and height that a flat piece must fit into in some rotation, mm; `None`: any size.
    pub sheet: Option<[f64; 2]>,
}

/// Why a mesh cannot be cut.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum CutError {
    /// Interrupted.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// A piece that cannot be flattened at all.
    #[error("{0}; remesh the surface there (coarsen with method = \"isotropic\") or repair it")]
    Flatten(#[from] FlattenError),
    /// The opened mesh is not a mesh any more.
    #[error("the mesh cannot be opened along its cuts: {0}")]
    Open(#[from] MeshError),
}

/// What a solution costs: pieces that are not good, then the length of the seams with the price of the pieces, mm.
pub type Cost = (usize, f64);

/// Cuts the surface.
pub fn cut(input: &DevelopableMesh, options: &Options, monitor: &Monitor) -> Result<CutMesh, CutError> {
    Ok(cut_at_cost(input, options, monitor)?.0)
}

/// The same with the cost, which tells which of two surfaces was cut better.
pub fn cut_at_cost(input: &DevelopableMesh, options: &Options, monitor: &Monitor) -> Result<(CutMesh, Cost), CutError> {
    let mesh = &input.mesh;
    let is_terminal = |v| options.tolerance.is_some_and(|tolerance| input.energy[v] > tolerance);
    let first = search::search(mesh, is_terminal, options, monitor);
    let mut options = options.clone();
    // A sliver beside a seam that is to be a little longer than its other sides together cannot be laid flat at all. Where such
    // pieces are left their seams keep their length, and in a second attempt all do.
    let mut found = match first {
        Err(CutError::Flatten(_)) if !options.scales.is_empty() => {
            options.scales.clear();
            search::search(mesh, is_terminal, &options, monitor)?
        }
        first => first?,
    };
    for all in [false, true] {
        if found.strained.is_empty() {
            break;
        }
        let mut other = options.clone();
        other.scales.retain(|it| !all && found.strained.binary_search(&it.0).is_err());
        let again = search::search(mesh, is_terminal, &other, monitor)?;
        if again.cost.0 < found.cost.0 {
            (found, options) = (again, other);
        }
    }
    Ok((open(mesh, &found.cut, &options, found.terminals)?, found.cost))
}

/// Both halfedges of edges, with the factor of the edge.
fn rim(mesh: &TriMesh, scales: &[(EdgeId, f64)]) -> Vec<(HalfedgeId, f64)> {
    let sides = |e: EdgeId| [Some(mesh.halfedge(e)), mesh.twin(mesh.halfedge(e))].into_iter().flatten();
    scales.iter().flat_map(|&(e, factor)| sides(e).map(move |h| (h, factor))).collect()
}

/// The cut mesh of a set of cut edges, its pieces named and its seams labelled.
fn open(
    mesh: &TriMesh,
    cut: &Field<EdgeId, bool>,
    options: &Options,
    seam_vertices: usize,
) -> Result<CutMesh, CutError> {
    let opening = opening::open(mesh, cut)?;
    let seams = opening.seams.into_iter().zip(1..).map(|(sides, label)| Seam { label, sides }).collect();
    Ok(CutMesh {
        mesh: opening.mesh,
        origin: opening.origin,
        piece_of: Field::from_vec(opening.piece_of.iter().map(|&it| PieceId(it)).collect()),
        pieces: Field::from_fn(opening.pieces, |it: PieceId| Piece::numbered(it.index())),
        seams,
        tolerance: options.tolerance.unwrap_or(f64::INFINITY),
        seam_vertices,
        stretch: options.stretch,
        rim: rim(mesh, &options.scales),
        undeveloped: false,
    })
}
