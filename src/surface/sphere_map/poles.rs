//! Turns and stretches a map so that two chosen places become its poles.
use super::centre::centroid;
use crate::{
    geom::Vec3,
    mesh::{Field, Id, TriMesh, VertexId, operators::lumped_mass},
};

/// Halvings of the interval of the scale, which starts with `RANGE` powers of e either way.
const HALVINGS: usize = 60;
const RANGE: f64 = 60.0;

/// The vertices that are farthest along `axis` and against it.
pub fn extremes(mesh: &TriMesh, axis: Vec3) -> [VertexId; 2] {
    let along = |v: &VertexId| axis.dot(&mesh.position(*v));
    let top = mesh.vertices().max_by(|a, b| along(a).total_cmp(&along(b)).then(b.cmp(a)));
    let bottom = mesh.vertices().min_by(|a, b| along(a).total_cmp(&along(b)).then(a.cmp(b)));
    [top, bottom].map(|it| it.unwrap_or(VertexId(0)))
}

/// The Möbius motion that brings `top` to (0, 0, 1) and `bottom` to (0, 0, −1), the source's centre of area into the equator's
/// plane, and the image of the longest way from the axis across it to longitude 0. The places of a conformal map stay conformal;
/// faces may flip where they are thin.
pub fn with_poles(
    mesh: &TriMesh,
    points: &Field<VertexId, Vec3>,
    [top, bottom]: [VertexId; 2],
    meridian: Vec3,
) -> Vec<Vec3> {
    let total = mesh.total_area();
    let mass: Vec<f64> = lumped_mass(mesh).iter().map(|it| it / total).collect();
    // From the top by stereographic projection, with differences to the bottom, which keeps the digits around it.
    let pole = points[top];
    let side = if pole.x.abs() < 0.6 { Vec3::x() } else { Vec3::y() };
    let u = (side - side.dot(&pole) * pole).normalize();
    let w = pole.cross(&u);
    let project = |p: Vec3| {
        let below = 1.0 - p.dot(&pole);
        [p.dot(&u) / below, p.dot(&w) / below]
    };
    let origin = project(points[bottom]);
    let plane: Vec<[f64; 2]> = mesh
        .vertices()
        .map(|v| {
            let z = project(points[v]);
            [z[0] - origin[0], z[1] - origin[1]]
        })
        .collect();
    // Longitude 0 through the centre of area of what lies farthest along `meridian`.
    let centre = mesh.vertices().map(|v| mass[v.index()] * mesh.position(v)).sum::<Vec3>();
    let front = mesh.vertices().filter(|v| ![top, bottom].contains(v)).max_by(|a, b| {
        let along = |v: &VertexId| meridian.dot(&(mesh.position(*v) - centre));
        along(a).total_cmp(&along(b)).then(b.cmp(a))
    });
    let angle = front.map_or(0.0, |v| f64::atan2(plane[v.index()][1], plane[v.index()][0]));
    let (sin, cos) = (-angle).sin_cos();
    let lift = |scale: f64| -> Vec<Vec3> {
        let at = |(v, &[p, q]): (usize, &[f64; 2])| {
            if v == top.index() {
                return Vec3::z();
            }
            let (p, q) = (scale * (cos * p - sin * q), scale * (sin * p + cos * q));
            let square = p * p + q * q;
            if square.is_finite() { Vec3::new(2.0 * p, 2.0 * q, square - 1.0) / (square + 1.0) } else { Vec3::z() }
        };
        plane.iter().enumerate().map(at).collect()
    };
    let (mut low, mut high) = (-RANGE, RANGE);
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if centroid(&mass, &lift(middle.exp())).z < 0.0 { low = middle } else { high = middle }
    }
    let mut out = lift((0.5 * (low + high)).exp());
    out[bottom.index()] = -Vec3::z();
    out
}
