//! Coarsening: fewer faces, the same shape. Edge collapse by quadric error, isotropic remeshing, or a pattern
//! of triangles through a conformal map to the sphere.

mod isotropic;
mod quadric;
mod source;
pub mod stage;
#[cfg(test)]
mod tests;
mod tolerance;

use crate::{
    geom::Vec3,
    mesh::{
        Bvh, FaceId, MeshError, TriMesh,
        distance::{self, SurfaceDistance},
    },
    numeric::{Cancelled, Monitor},
    surface::sphere_map::{
        Locator, Method, Pattern, SphereError, TessellateError, extremes, pull_back, resolved_map, with_poles,
    },
};

use isotropic::Target;
use tolerance::{Test, Tolerance};

/// What [`simplify`] should reach.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct QuadricOptions {
    /// Number of faces to reach, if `max_error` allows it.
    pub faces: Option<usize>,
    /// Largest distance between the surfaces, both ways, mm.
    pub max_error: Option<f64>,
    /// Edges with a larger angle between the normals of their faces are creases, radians.
    pub feature_angle: f64,
}

/// What [`remesh`] should reach.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct IsotropicOptions {
    /// Size of the faces.
    pub density: Density,
    /// Distance to keep between the surfaces, mm: edges are made shorter than asked where that is needed. Usually kept, but
    /// not promised: measure it.
    pub max_error: Option<f64>,
    /// Edges with a larger angle between the normals of their faces are creases, radians.
    pub feature_angle: f64,
}

/// How fine an isotropic mesh is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Density {
    /// Length of edges, mm.
    EdgeLength(f64),
    /// Number of faces, reached within a few percent before `max_error` adds some.
    Faces(usize),
}

/// What [`tessellate`] should make.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TessellationOptions {
    /// The pattern on the sphere.
    pub pattern: Pattern,
    /// The top of the pattern (z) goes to the vertex farthest along the first, its lowest point to the one farthest against it;
    /// its first meridian (x) passes what is farthest along the second. Any lengths but 0.
    pub axes: [Vec3; 2],
    /// Whether the pattern is evened out on the surface.
    pub compensate: bool,
    /// Edges are divided until the surface is no farther away than this, mm.
    pub max_error: f64,
}

/// Why coarsening failed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum CoarsenError {
    /// The run was interrupted.
    #[error(transparent)]
    Interrupted(#[from] Cancelled),
    /// The topology needs more faces.
    #[error(
        "the mesh cannot be coarsened to {target} faces: its holes, handles and components leave nothing to collapse \
         below {reached} faces; ask for {reached} or more"
    )]
    TooFew {
        /// Faces wanted.
        target: usize,
        /// Faces left.
        reached: usize,
    },
    /// There is no map to the sphere.
    #[error("coarsen.method = \"sphere\": {0}")]
    Sphere(SphereError),
    /// A face lost its area.
    #[error("coarsening made a face that is not usable: {0}; try another number of faces, or method = \"off\"")]
    Mesh(#[from] MeshError),
}

/// Collapses edges by quadric error until `faces` are left or `max_error` is used up. With `max_error` the two-sided
/// Hausdorff distance to `source` is proven to be no larger. With neither the result is the source.
pub fn simplify(source: &TriMesh, options: &QuadricOptions, monitor: &Monitor) -> Result<TriMesh, CoarsenError> {
    let QuadricOptions { faces, max_error, feature_angle } = *options;
    let bvh = Bvh::new(source);
    let Some(max_error) = max_error else {
        return quadric::simplify(source, &bvh, faces, None, feature_angle, monitor);
    };
    let mut limit = SHRINK * max_error;
    loop {
        let tolerance = Tolerance::new(source, &bvh, limit, Test::Proven);
        let result = quadric::simplify(source, &bvh, faces, Some(tolerance), feature_angle, monitor)?;
        let bounds = distance::two_sided_bounds(source, &result, RESOLUTION, monitor)?;
        if bounds.upper <= max_error || result.face_count() == source.face_count() {
            return Ok(result);
        }
        // Samples missed something between them. The excess shrinks with the limit, so this ends; the source itself is
        // within any limit.
        limit *= (max_error / bounds.upper).min(SHRINK);
    }
}

/// Makes a mesh of nearly equilateral faces on the surface of `source`, whose boundary and creases it follows.
pub fn remesh(source: &TriMesh, options: &IsotropicOptions, monitor: &Monitor) -> Result<TriMesh, CoarsenError> {
    let (length, faces) = match options.density {
        Density::EdgeLength(length) => (length, None),
        // Equilateral triangles of side l have the area √3/4 l².
        Density::Faces(faces) => ((source.total_area() / faces as f64 * 4.0 / 3.0_f64.sqrt()).sqrt(), Some(faces)),
    };
    let target = Target { length, faces, feature_angle: options.feature_angle };
    isotropic::remesh(source, &Bvh::new(source), &target, options.max_error, monitor)
}

/// A regular pattern of triangles on the surface, through its conformal map to the sphere: the pattern leads what the developed
/// result looks like.
pub fn tessellate(source: &TriMesh, options: &TessellationOptions, monitor: &Monitor) -> Result<TriMesh, CoarsenError> {
    let (finer, map) = resolved_map(source, Method::Auto, monitor).map_err(refused)?;
    let mapped = finer.as_ref().unwrap_or(source);
    let [top, front] = options.axes;
    let points = with_poles(mapped, &map.points, extremes(mapped, top), front);
    let locator = Locator::new(mapped, &points);
    let mut net = pull_back(&locator, options.pattern, options.compensate, monitor).map_err(|err| match err {
        TessellateError::Sphere(err) => refused(err),
        TessellateError::Mesh(err) => CoarsenError::Mesh(err),
    })?;
    let mut distance = options.max_error;
    for _ in 0..ATTEMPTS {
        if distance.is_finite() {
            net.refine(distance, monitor).map_err(refused)?;
        }
        // Vertices of the surface may be near where the net is not, so the distance is measured.
        let made = net.mesh()?;
        if distance.is_infinite() || SurfaceDistance::between(source, &made).hausdorff <= options.max_error {
            return Ok(made);
        }
        distance *= CLOSER;
    }
    Ok(net.mesh()?)
}

/// Attempts at keeping a tessellation within its distance, each with less by this factor at the vertices of the surface.
const ATTEMPTS: usize = 4;
const CLOSER: f64 = 0.8;

fn refused(err: SphereError) -> CoarsenError {
    match err {
        SphereError::Cancelled(it) => CoarsenError::Interrupted(it),
        other => CoarsenError::Sphere(other),
    }
}

/// How closely the distance of a result is bounded.
const RESOLUTION: f64 = 0.01;
/// The limit shrinks by at least this factor per attempt.
const SHRINK: f64 = 0.97;

/// Smallest angle of a face, radians.
fn smallest_angle(mesh: &TriMesh, f: FaceId) -> f64 {
    mesh.face_halfedges(f).into_iter().map(|h| mesh.corner_angle(h)).fold(f64::INFINITY, f64::min)
}
