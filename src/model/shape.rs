//! Nouns in space: the input, the developable mesh, the cut mesh and its flattening.
use super::GeodesicNet;
use crate::{
    geom::{Vec2, Vec3},
    mesh::{FaceId, Field, HalfedgeId, Id, TriMesh, VertexId},
};

/// The input after repair, at its physical size in millimetres. Lives beside the coarse `TriMesh` because later stages
/// measure against it.
#[derive(Debug, Clone, PartialEq)]
pub struct SourceMesh {
    /// The surface.
    pub mesh: TriMesh,
    /// File name without folder, as the user wrote it.
    pub file: String,
    /// What was mended on the way in, one sentence each.
    pub repairs: Vec<String>,
    /// The axis that points up: 1 for y, 2 for z.
    pub up: usize,
}

/// What the user drew on the input to lead the seams, in the coordinates of the [`SourceMesh`].
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Guides {
    /// Lines along which there must be a seam, mm.
    pub seams: Vec<Vec<Vec3>>,
    /// Parts of the surface that were named to be preferred or avoided.
    pub patches: Vec<Patch>,
    /// Edges of the developable mesh that must be seams, as pairs of vertices: lines that a stage has cut into it.
    pub edges: Vec<[u32; 2]>,
    /// How many times as long each of `edges` should be in the plane as in space; none where all keep their length.
    pub scales: Vec<f64>,
    /// Lines to be engraved through a map to the sphere, as longitudes and latitudes, radians.
    pub texture: Vec<Vec<Vec2>>,
    /// Places of the path across which rings are sliced, from its top to its bottom, mm; empty for a meridian.
    pub path: Vec<Vec3>,
    /// Profile of a surface of revolution around z, as radii and heights, mm.
    pub profile: Vec<Vec2>,
    /// The net of an earlier run, to go on from.
    pub net: Option<GeodesicNet>,
}

/// A painted part of the input.
#[derive(Debug, Clone, PartialEq)]
pub struct Patch {
    /// Key of the config that it belongs to: `prefer 0` is the first of `[[cut.prefer]]`.
    pub key: String,
    /// Its triangles, mm.
    pub triangles: Vec<[Vec3; 3]>,
}

/// One round of the developability flow.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Round {
    /// Name of the energy.
    pub energy: String,
    /// Vertices in this round.
    pub vertices: usize,
    /// Faces in this round.
    pub faces: usize,
    /// Developability energy before, without barrier and fidelity terms.
    pub energy_start: f64,
    /// Developability energy after.
    pub energy_end: f64,
    /// Norm of the gradient of the whole objective at the end, at mean edge length 1.
    pub gradient_norm: f64,
    /// Accepted steps.
    pub iterations: usize,
    /// Evaluations of the objective.
    pub evaluations: usize,
    /// Time taken (may differ between runs).
    pub seconds: f64,
    /// Why the round ended.
    pub stopped: String,
    /// The level that it belongs to; the coarsest is 0.
    pub level: usize,
    /// Whether it only mended what was found wrong after the rounds of its level.
    pub correction: bool,
    /// The mesh after it, mm; absent where it would show nothing new.
    pub mesh: Option<TriMesh>,
}

/// A mesh that is piecewise developable as far as the flow could make it; no folded edge was accepted on the way.
#[derive(Debug, Clone, PartialEq)]
pub struct DevelopableMesh {
    /// The surface.
    pub mesh: TriMesh,
    /// Developability energy λ per vertex (0 on the boundary and at valence ≤ 3).
    pub energy: Field<VertexId, f64>,
    /// The promised largest distance to the source, mm.
    pub max_deviation: f64,
    /// History.
    pub rounds: Vec<Round>,
    /// What other deviations would have given, as far as that was asked.
    pub tradeoffs: Vec<Tradeoff>,
}

/// What one allowed deviation costs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tradeoff {
    /// Largest distance allowed between the result and the source, mm.
    pub max_deviation: f64,
    /// Σ of the developability energy of the result.
    pub energy: f64,
    /// Length of the seams of the result, mm.
    pub seam_length: f64,
    /// Proven distance between the result and the source, mm.
    pub bound: f64,
}

/// A piece of the cut mesh: one connected component.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct PieceId(pub u32);

impl Id for PieceId {
    fn new(index: usize) -> Self {
        Self(u32::try_from(index).expect("there are fewer pieces than faces"))
    }
    fn index(self) -> usize {
        self.0 as usize
    }
}

/// What a piece is called.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Piece {
    /// Short name printed on the part, unique in the job.
    pub name: String,
}

impl Piece {
    /// The piece of an index from 0: A, B, … Z, AA, AB, …, which cannot be mistaken for a seam, as that has a number.
    pub fn numbered(index: usize) -> Self {
        let mut letters = Vec::new();
        let mut rest = index + 1;
        while rest > 0 {
            rest -= 1;
            letters.push(char::from(b'A' + (rest % 26) as u8));
            rest /= 26;
        }
        Self { name: letters.iter().rev().collect() }
    }
}

/// A maximal chain of cut edges between the same two pieces (or one piece and itself).
#[derive(Debug, Clone, PartialEq)]
pub struct Seam {
    /// Label printed on both sides, unique in the job, from 1.
    pub label: u32,
    /// The two sides as boundary halfedges of the cut mesh. `sides[0][k]` and `sides[1][k]` come from the same edge of the
    /// developed mesh; `sides[0]` is in the order of travel with its piece on the left, `sides[1]` therefore against it.
    pub sides: [Vec<HalfedgeId>; 2],
}

/// A mesh opened along its seams: every component is a planar domain with a boundary, none is a closed surface.
/// Face `f` is face `f` of the developed mesh; only vertices were duplicated.
#[derive(Debug, Clone, PartialEq)]
pub struct CutMesh {
    /// The opened mesh.
    pub mesh: TriMesh,
    /// The vertex of the mesh that was cut that each vertex came from.
    pub origin: Field<VertexId, VertexId>,
    /// Which piece a face belongs to.
    pub piece_of: Field<FaceId, PieceId>,
    /// The pieces, largest area first.
    pub pieces: Field<PieceId, Piece>,
    /// The seams; boundary edges of the developed mesh are in none.
    pub seams: Vec<Seam>,
    /// Energy above which a vertex was made a terminal of the cut; infinite when the energy was not asked.
    pub tolerance: f64,
    /// Number of terminals: vertices that the seams were led through on purpose.
    pub seam_vertices: usize,
    /// Limit of the principal stretch max |ln σ| that 99.9 % of the area of every piece keep when it is laid flat.
    pub stretch: f64,
    /// Halfedges on seams that should be so many times as long in the plane as in space, both sides by the same factor; all
    /// others keep their length.
    pub rim: Vec<(HalfedgeId, f64)>,
    /// Whether it is the mesh before it was made developable that was cut, because that took less seam.
    pub undeveloped: bool,
}

impl CutMesh {
    /// Names of the pieces with less than `area`, mm², in space.
    pub fn small_pieces(&self, area: f64) -> Vec<&str> {
        let mut areas = Field::<PieceId, f64>::filled(self.pieces.len(), 0.0);
        for f in self.mesh.faces() {
            areas[self.piece_of[f]] += self.mesh.area(f);
        }
        areas.enumerate().filter(|it| *it.1 < area).map(|it| self.pieces[it.0].name.as_str()).collect()
    }
}

/// Two faces of one piece whose interiors intersect in the plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Overlap {
    /// The faces.
    pub faces: [FaceId; 2],
    /// Area of the intersection, mm².
    pub area: f64,
}

/// The pieces in the plane at physical size, each in a frame of its own.
#[derive(Debug, Clone, PartialEq)]
pub struct Flattening {
    /// Plane coordinates of the vertices of the cut mesh, mm.
    pub uv: Field<VertexId, Vec2>,
    /// Log scale around each vertex: the mean of ½ ln (area ratio) of its faces.
    pub log_factor: Field<VertexId, f64>,
    /// Overlaps that remain.
    pub overlaps: Vec<Overlap>,
    /// Limit of the principal stretch that the pieces were cut and laid flat for.
    pub stretch_limit: f64,
}

/// Why a flattening is not one of a cut mesh.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Misfit {
    /// It has more or fewer points than the mesh has vertices.
    #[error("the flattening has {found} points for {expected} vertices of the cut mesh")]
    Count {
        /// Points given.
        found: usize,
        /// Vertices of the cut mesh.
        expected: usize,
    },
    /// A plane coordinate is NaN or infinite.
    #[error("vertex {vertex} of the cut mesh is flattened to a point that is not finite: ({}, {})", place.x, place.y)]
    NotFinite {
        /// The vertex.
        vertex: usize,
        /// Where it was put.
        place: Vec2,
    },
}

impl Flattening {
    /// Length of both sides of a seam in the plane, mm.
    pub fn seam_sides(&self, cut: &CutMesh, seam: &Seam) -> [f64; 2] {
        let length = |h: HalfedgeId| (self.uv[cut.mesh.head(h)] - self.uv[cut.mesh.tail(h)]).norm();
        [0, 1].map(|side| seam.sides[side].iter().map(|&h| length(h)).sum())
    }

    /// `Err` unless it has a finite point for every vertex of `cut`.
    pub fn fits(&self, cut: &CutMesh) -> Result<(), Misfit> {
        let (found, expected) = (self.uv.len(), cut.mesh.vertex_count());
        if found != expected {
            return Err(Misfit::Count { found, expected });
        }
        let points = self.uv.as_slice();
        match points.iter().position(|p| !(p.x.is_finite() && p.y.is_finite())) {
            Some(vertex) => Err(Misfit::NotFinite { vertex, place: points[vertex] }),
            None => Ok(()),
        }
    }
}
