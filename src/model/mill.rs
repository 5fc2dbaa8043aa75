//! What a mill or a hot wire does to free pieces of a body.
use super::PieceId;
use crate::{
    geom::Vec3,
    mesh::{
        TriMesh,
        sweep::{Deepest, Pose, Tool},
    },
};

/// How the body lies on the machine: work coordinates are `rows · p + shift`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Setup {
    /// The work axes in the body's coordinates: unit vectors, right-handed.
    pub rows: [Vec3; 3],
    /// Millimetres.
    pub shift: Vec3,
}

impl Setup {
    /// A point of the body in work coordinates.
    pub fn place(&self, p: Vec3) -> Vec3 {
        self.turn(p) + self.shift
    }

    /// A direction of the body in work coordinates.
    pub fn turn(&self, v: Vec3) -> Vec3 {
        Vec3::new(self.rows[0].dot(&v), self.rows[1].dot(&v), self.rows[2].dot(&v))
    }

    /// A point in work coordinates in those of the body.
    pub fn back(&self, p: Vec3) -> Vec3 {
        self.turn_back(p - self.shift)
    }

    /// A direction in work coordinates in those of the body.
    pub fn turn_back(&self, v: Vec3) -> Vec3 {
        self.rows[0] * v.x + self.rows[1] * v.y + self.rows[2] * v.z
    }
}

/// One block of a program: where it ends.
#[derive(Debug, Clone, PartialEq)]
pub struct MillMove {
    /// At rapid speed, out of the body.
    pub rapid: bool,
    /// The cutter in work coordinates.
    pub pose: Pose,
    /// Heights over the tip between which it touches the piece on the way there; the second is below the first where it does
    /// not.
    pub contact: [f64; 2],
    /// Linear axes, mm, then rotary ones, radians, in the order of [`Milling::axes`].
    pub joints: Vec<f64>,
    /// Time that it takes.
    pub seconds: f64,
    /// Number of its segment, from 0.
    pub segment: u32,
    /// The piece that the segment is of.
    pub piece: PieceId,
}

/// A part of a strip that is not cut.
#[derive(Debug, Clone, PartialEq)]
pub struct StripLeft {
    /// Name of the piece.
    pub piece: String,
    /// Number of the strip in it, from 0.
    pub strip: u32,
    /// How much, mm²: at most, as far as it was tried.
    pub area: f64,
    /// For people: what is in the way of most of it, and where.
    pub reason: String,
}

/// What a cutter does along the rulings of some pieces.
#[derive(Debug, Clone, PartialEq)]
pub struct Milling {
    /// Letters of the axes.
    pub axes: Vec<char>,
    /// How the body lies.
    pub setup: Setup,
    /// The cutter, or the wire with half its kerf as the radius.
    pub tool: Tool,
    /// Distance between the planes in which the ends of a wire move, mm; 0 for a cutter.
    pub span: f64,
    /// Spindle speed, 1/min; the heat of a wire.
    pub spindle: f64,
    /// The blocks.
    pub moves: Vec<MillMove>,
    /// Names of the pieces that are cut.
    pub pieces: Vec<String>,
    /// Pieces that are not, with the reason.
    pub refused: Vec<[String; 2]>,
    /// Pieces with places too hollow for the cutter, with the smallest radius and its place.
    pub tight: Vec<[String; 2]>,
    /// Parts of strips of the others that nothing can cut.
    pub left: Vec<StripLeft>,
    /// Continuous cuts.
    pub segments: usize,
    /// The body in its own coordinates, its cut pieces finely divided.
    pub painted: Box<TriMesh>,
    /// Per face of that mesh: what is left on it, negative where it is cut into, mm; `None` where no contact passed.
    pub deviation: Vec<Option<f64>>,
    /// Per face of that mesh: what a ball of the cutter's radius would leave on it anyway, mm; looked up only where more than
    /// the limit is left, 0 elsewhere.
    pub closing: Vec<f64>,
    /// Share of the area of the pieces that the contact passed.
    pub covered: f64,
    /// The deepest place that is cut into, in coordinates of the body.
    pub gouge: Deepest,
    /// The highest place that is left, where contact passed, over what a ball of the cutter's radius would leave there.
    pub excess: Deepest,
    /// Where more than the limit is left because the cutter does not fit: the most that a ball of its radius leaves.
    pub unfit: Deepest,
    /// Share of the area of the pieces where that is so.
    pub unfit_share: f64,
    /// The deepest place inside the shank, the holder or the fixture.
    pub collision: Deepest,
    /// How deep may be cut, how much may be left, mm.
    pub limits: [f64; 2],
}

impl Milling {
    /// Estimated time, s.
    pub fn seconds(&self) -> f64 {
        self.moves.iter().map(|it| it.seconds).sum()
    }
}
