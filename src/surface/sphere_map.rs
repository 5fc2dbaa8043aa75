//! Conformal maps of closed surfaces of genus 0 to the unit sphere, each with an exact proof that it is one to one.
//!
//! The energy is F = Σ w_ij |y_i − y_j|² over the edges, w = ½ (cot α + cot β), y the points on the sphere (Kanai 2005,
//! eq. 2 with the dot product in eq. 3). F is twice the Dirichlet energy, so it is at least twice the area of the image,
//! 8π = 25.1327 for the smooth sphere, with equality where the map is conformal; a polyhedral image may lie a little below.
//! F alone can be lowered without limit by letting the image gather in one place, so it is only told of maps that are
//! centred: Σ m_i y_i = 0 with m the area of the source.
//!
//! [`Method::Auto`]: the harmonic map of all but one triangle, opened onto the sphere; a Möbius centring; descent in a
//! Sobolev metric; uniform relaxation around flipped faces; a polish that keeps every face; the certificate. Where that
//! leaves a flipped face, and for [`Method::Hierarchical`]: Kanai's system, a progressive mesh down to a tetrahedron whose
//! vertex splits are placed in the kernel of the star.

mod centre;
mod certify;
mod descend;
mod harmonic;
mod hierarchy;
mod locate;
mod net;
mod poles;
mod refine;
mod relax;
mod surface;
mod tessellate;
#[cfg(test)]
mod tests;
mod untangle;

pub use certify::{Certificate, certify};
pub use locate::{Locator, Stretch};
pub use net::Net;
pub use poles::{extremes, with_poles};
pub use tessellate::{Pattern, TessellateError, pull_back};

use self::surface::Surface;
use crate::{
    geom::Vec3,
    mesh::{Field, TriMesh, VertexId},
    numeric::{Cancelled, Monitor, sparse::Cholesky},
    surface::subdivide,
};

/// How the map is found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Method {
    /// The fast way; where it leaves a flipped face, [`Method::Hierarchical`].
    Auto,
    /// Through a progressive mesh: slower, and sure of every connectivity.
    Hierarchical,
}

/// Which way led to the map.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Route {
    /// Harmonic map and descent.
    Direct,
    /// Progressive mesh.
    Hierarchical,
}

/// A one-to-one map of a closed surface to the unit sphere.
#[derive(Debug, Clone, PartialEq)]
pub struct SphereMap {
    /// Image of every vertex: unit vectors up to rounding.
    pub points: Field<VertexId, Vec3>,
    /// The proof.
    pub certificate: Certificate,
    /// Which way led here.
    pub route: Route,
    /// How good it is.
    pub quality: Quality,
    /// Vertices that could not come closer to their conformal place in the last relaxation of the hierarchy, because that would
    /// flip a face, make it a sliver, or make it smaller than double precision can hold; 0 on the direct way. The energy over
    /// 8π says what that cost.
    pub held: usize,
}

/// How good a map is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quality {
    /// F.
    pub energy: f64,
    /// Mean of ½ (σ1/σ2 + σ2/σ1) over the faces, weighted by their area on the source; 1 is conformal.
    pub dilatation_mean: f64,
    /// What 99 % of the area of the source do not exceed.
    pub dilatation_p99: f64,
    /// |Σ m y| with Σ m = 1: how far the map is from being centred.
    pub centroid: f64,
}

/// Why a surface has no map.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SphereError {
    /// Interrupted.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// More than one part.
    #[error(
        "a sphere map needs one closed surface, but there are {count} separate parts; take the largest with input.component = \"largest\", or map them one by one"
    )]
    Components {
        /// How many.
        count: usize,
    },
    /// Open edges.
    #[error(
        "a sphere map needs a closed surface, but this one has {loops} hole{}, one of {edges} edges near ({:.3}, {:.3}, {:.3}); close the holes with input.fill_holes = {edges} or in a modelling program", if *loops == 1 { "" } else { "s" }, place.x, place.y, place.z
    )]
    Boundary {
        /// Boundary loops.
        loops: usize,
        /// Edges of the longest.
        edges: usize,
        /// A vertex on it, mm.
        place: Vec3,
    },
    /// Handles.
    #[error(
        "a sphere map needs a surface without handles, but this one has {genus}, like a torus has one; close the handles in a modelling program, or use recipe = \"developable\""
    )]
    Genus {
        /// How many.
        genus: usize,
    },
    /// The image of a part of the surface is too small for double precision.
    #[error(
        "the map cannot be made in double precision: no room is left to place vertex {vertex} near ({:.3}, {:.3}, {:.3}), {placed} of {total} vertices are placed; shorten long thin limbs or coarsen the mesh there", place.x, place.y, place.z
    )]
    NoRoom {
        /// The vertex.
        vertex: VertexId,
        /// Where it is on the source.
        place: Vec3,
        /// Vertices already on the sphere.
        placed: usize,
        /// All of them.
        total: usize,
    },
}

/// Maps a closed connected surface of genus 0 to the unit sphere; every face of the result is proven to keep its orientation,
/// and together they cover the sphere once.
pub fn sphere_map(mesh: &TriMesh, method: Method, monitor: &Monitor) -> Result<SphereMap, SphereError> {
    check(mesh)?;
    let surface = Surface::new(mesh);
    if method == Method::Auto
        && let Some(points) = direct(&surface, monitor)?
        && let Some(map) = certified(&surface, points, Route::Direct, 0)
    {
        return Ok(map);
    }
    let (mut points, held) = hierarchy::map(mesh, &surface, monitor)?;
    if let Some(factor) = harmonic::System::new(&surface).and_then(|mut it| it.sobolev(&surface, &points)) {
        let mut free = points.clone();
        if finish(&surface, &factor, &mut free, monitor)? {
            points = free;
        } else {
            descend::polish(&surface, &factor, &mut points, monitor)?;
        }
    }
    centre::centre(&surface.mass, &mut points, &|it| surface.is_whole(it));
    Ok(certified(&surface, points, Route::Hierarchical, held)
        .expect("every step of the hierarchy keeps all faces, exactly tested"))
}

/// Meshes whose maps have a larger mean dilatation are subdivided, at most so often, and if they have no more faces than this.
const COARSE: f64 = 1.3;
const SUBDIVISIONS: usize = 2;
const MANY: usize = 50_000;

/// The map, and the subdivided mesh that it is of where the faces are too large for a map that keeps angles: along a limb the
/// map shrinks by a factor per length, and a face that is long beside the girth of its limb cannot follow that.
pub fn resolved_map(
    mesh: &TriMesh,
    method: Method,
    monitor: &Monitor,
) -> Result<(Option<TriMesh>, SphereMap), SphereError> {
    let mut map = sphere_map(mesh, method, monitor)?;
    let mut finer: Option<TriMesh> = None;
    for _ in 0..SUBDIVISIONS {
        let before = finer.as_ref().unwrap_or(mesh);
        if map.quality.dilatation_mean < COARSE || before.face_count() > MANY {
            break;
        }
        let Ok(next) = subdivide(before) else { break };
        map = sphere_map(&next, method, monitor)?;
        finer = Some(next);
    }
    Ok((finer, map))
}

/// Refuses what is not a sphere.
fn check(mesh: &TriMesh) -> Result<(), SphereError> {
    let (_, count) = mesh.components();
    if count != 1 {
        return Err(SphereError::Components { count });
    }
    let loops = mesh.boundary_loops();
    if let Some(longest) = loops.iter().max_by_key(|it| it.len()) {
        let place = mesh.position(mesh.tail(longest[0]));
        return Err(SphereError::Boundary { loops: loops.len(), edges: longest.len(), place });
    }
    match mesh.genus() {
        0 => Ok(()),
        genus => Err(SphereError::Genus { genus }),
    }
}

/// The fast way; `None` where it leaves flipped faces.
fn direct(surface: &Surface, monitor: &Monitor) -> Result<Option<Vec<Vec3>>, SphereError> {
    let Some(mut system) = harmonic::System::new(surface) else { return Ok(None) };
    let mut hole = harmonic::most_regular(surface);
    for _ in 0..2 {
        let Some(mut y) = system.harmonic(surface, hole) else { return Ok(None) };
        monitor.check()?;
        centre::centre(&surface.mass, &mut y, &|_| true);
        let Some(factor) = system.sobolev(surface, &y) else { return Ok(None) };
        monitor.check()?;
        if finish(surface, &factor, &mut y, monitor)? {
            return Ok(Some(y));
        }
        hole = harmonic::most_open(surface, &y);
    }
    Ok(None)
}

/// Descent, repair, polish. Whether no face is flipped.
fn finish(surface: &Surface, factor: &Cholesky, y: &mut Vec<Vec3>, monitor: &Monitor) -> Result<bool, SphereError> {
    descend::descend(surface, factor, y, monitor)?;
    if !relax::repair(surface, y, monitor)? {
        return Ok(false);
    }
    descend::polish(surface, factor, y, monitor)?;
    centre::centre(&surface.mass, y, &|it| surface.is_whole(it));
    Ok(true)
}

fn certified(surface: &Surface, points: Vec<Vec3>, route: Route, held: usize) -> Option<SphereMap> {
    let certificate = certify(&surface.faces, &points);
    let quality = surface.quality(&points);
    (certificate.holds() && quality.energy.is_finite()).then(|| SphereMap {
        points: Field::from_vec(points),
        certificate,
        route,
        quality,
        held,
    })
}
