//! Stripes on a surface: lines that run at a spacing along a field.
use crate::{geom::Vec3, mesh::FaceId};

/// One line. An open one runs from where it begins (index > 0) to where it ends, unless it was to start elsewhere.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct StripeLine {
    /// Its points, mm; a closed line does not repeat the first.
    pub points: Vec<Vec3>,
    /// Whether the last point joins the first.
    pub closed: bool,
    /// How many of its ends lie inside the surface, at singularities.
    pub inner_ends: usize,
    /// For every piece from a point to the next the face in which it lies, and the barycentric coordinates of both there.
    pub pieces: Vec<(FaceId, [[f64; 3]; 2])>,
}

impl StripeLine {
    /// Its length, mm.
    pub fn length(&self) -> f64 {
        let n = self.points.len();
        (0..n.saturating_sub(usize::from(!self.closed)))
            .map(|i| (self.points[(i + 1) % n] - self.points[i]).norm())
            .sum()
    }
}

/// A face in which lines begin (index > 0) or end.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StripeEnd {
    /// The face.
    pub face: FaceId,
    /// Its centre, mm.
    pub place: Vec3,
    /// How many lines begin there.
    pub index: i32,
}

/// How lines hang together, where those that end in one face or at one boundary loop are joined there.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
pub struct Web {
    /// Closed ways along them; on a surface of genus 0 each parts it.
    pub cycles: usize,
    /// Connected sets of lines, less one: cuts across that open what is left to a disk.
    pub gaps: usize,
    /// Lines that meet beyond two, summed: ways along them that branch off.
    pub branches: usize,
}

impl Web {
    /// Whether the lines are one path. What they leave of a surface of genus 0 is then one disk, and the path its zipper.
    pub fn is_path(&self) -> bool {
        *self == Self::default()
    }
}

/// The stripes of a job, on the mesh that reached the stage.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Stripes {
    /// The lines, open ones first.
    pub lines: Vec<StripeLine>,
    /// Whether they are only drawn on the pieces; otherwise the surface is cut along them.
    pub drawn: bool,
    /// Faces of the mesh.
    pub faces: usize,
    /// Connected components of the mesh.
    pub components: usize,
    /// Singularities that were asked for, or found by the search for them.
    pub prescribed: Vec<StripeEnd>,
    /// Singularities of the result, counted from it.
    pub found: Vec<StripeEnd>,
    /// Windings of the boundary loops (lines that leave through each, with a sign) and around the handles.
    pub windings: [Vec<i32>; 2],
    /// How the lines hang together.
    pub web: Web,
    /// Parts into which they divide the surface; 0 where it is not cut along them.
    pub parts: usize,
    /// Singular faces of the field itself.
    pub field_singularities: usize,
    /// Largest distance of the periods around faces, loops and handles from a multiple of 2π, radians.
    pub period_error: f64,
    /// (u − ω)ᵀ W (u − ω) without the pairs that were searched for, and in the end.
    pub energy: [f64; 2],
    /// Distance of neighbouring lines where they run, weighted by area: least, largest, mean, standard deviation, mm.
    pub spacing: [f64; 4],
    /// Time to factor and to edit once, s (may differ between runs).
    pub seconds: [f64; 2],
}
