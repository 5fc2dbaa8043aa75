//! Moulds of a surface of revolution, the panels that are formed on them, and the ribs that can take their place.
use super::Part;
use crate::{
    geom::{Vec2, Vec3},
    mesh::TriMesh,
};

/// A solid part of a mould, to be printed or milled. It stands upright with its middle meridian over the x-axis, its box in the
/// corner of the axes.
#[derive(Debug, Clone, PartialEq)]
pub struct MoldSegment {
    /// Name, unique in the job: mould, place along the meridian, place across.
    pub name: String,
    /// The closed surface, facing outwards.
    pub mesh: TriMesh,
    /// Rows of the net between which it carries panels.
    pub rows: [usize; 2],
    /// Size of its box, mm.
    pub size: Vec3,
    /// Volume, mm³.
    pub volume: f64,
    /// Holes for dowels in its joints.
    pub dowels: usize,
}

/// A program for a three-axis mill with a ball nose, in coordinates in which the middle meridian of its segment lies up: x, y, z are
/// y, z, x of its STL.
#[derive(Debug, Clone, PartialEq)]
pub struct MoldProgram {
    /// Name of the segment.
    pub segment: String,
    /// Whether a move is rapid, and where the tip of the ball goes, mm.
    pub moves: Vec<(bool, Vec3)>,
    /// Radius of the ball, mm.
    pub radius: f64,
    /// Speed of cuts, mm/min, and of the spindle, 1/min.
    pub speeds: [f64; 2],
    /// Finishing passes.
    pub passes: usize,
    /// How deep the surface is cut into, mm.
    pub gouge: f64,
    /// How much is left on it, mm; infinite where the ball does not come.
    pub scallop: f64,
}

/// A panel: some strips side by side between two rows of the net.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MoldPanel {
    /// First and last row.
    pub rows: [usize; 2],
    /// First and last geodesic.
    pub columns: [usize; 2],
    /// Number of the mould that it is formed on; `None` where it is as good as flat.
    pub mold: Option<usize>,
}

/// All moulds of a job.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Molds {
    /// Radius and height of the surface of revolution per row, mm; heights rise.
    pub profile: Vec<Vec2>,
    /// Angle that one strip takes around the axis, rad.
    pub step: f64,
    /// Member of the Minding family: 1 where the net turns once around.
    pub lambda: f64,
    /// The largest member that is real; infinite for a cylinder.
    pub largest_lambda: f64,
    /// Largest relative deviation of an edge of the net from the mean of its row.
    pub deviation: f64,
    /// Largest distance between the outline of a strip laid flat and the mean of all, mm.
    pub congruence: f64,
    /// Solid parts.
    pub segments: Vec<MoldSegment>,
    /// Programs that mill their outer sides; none unless asked for.
    pub programs: Vec<MoldProgram>,
    /// Panels, in the order of rows, then columns.
    pub panels: Vec<MoldPanel>,
    /// Total Gaussian curvature of a panel of each mould, rad.
    pub curvature: Vec<f64>,
    /// The half section for a lathe, then ribs instead of solid moulds.
    pub drawings: Vec<Part>,
    /// Joints between segments that have no room for dowels.
    pub undoweled: usize,
}
