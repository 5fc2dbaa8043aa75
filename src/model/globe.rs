//! The certified map of a surface to the sphere, and the slices that were made through it.
use crate::geom::Vec3;

/// A closed surface on the unit sphere: every face keeps its orientation and together they cover the sphere once, which
/// `surface::sphere_map::certify` proves of `points` and `faces`.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Globe {
    /// Image of every vertex of the input, which was subdivided where its faces were too large.
    pub points: Vec<Vec3>,
    /// The faces of the same.
    pub faces: Vec<[u32; 3]>,
    /// Image of every vertex of the sliced surface, turned so that the poles are (0, 0, ±1).
    pub images: Vec<Vec3>,
    /// Which way led to the map: "direct" or "hierarchical".
    pub method: String,
    /// Σ w |y_i − y_j|²; 8π for a smooth conformal map.
    pub energy: f64,
    /// ½ (σ1/σ2 + σ2/σ1) of the faces: its mean and what 99 % of the area keep, weighted with the area of the input.
    pub dilatation: [f64; 2],
    /// |Σ m y| for the shares m of the area of the input.
    pub centroid: f64,
    /// Vertices that double precision kept from their conformal place.
    pub held: usize,
    /// Time of the map, s (may differ between runs).
    pub seconds: f64,
    /// Whether the slices are rings; otherwise they run from pole to pole.
    pub rings: bool,
    /// Longitudes of the seams from pole to pole, radians, or heights of the rings on the unit sphere, ascending.
    pub lines: Vec<f64>,
    /// Largest principal stretch of 99.9 % of the area of the slice after each line, then of both caps; infinite for one that is
    /// not a disk.
    pub stretch: Vec<f64>,
    /// Length of the seams between the slices, mm.
    pub seam_length: f64,
    /// Least and largest factor of the length of a seam in the plane over that in space.
    pub seam_scale: [f64; 2],
}
