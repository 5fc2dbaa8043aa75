//! Nets to begin with: of a surface of revolution, and on a patch of a mesh.
use super::StartError;
use crate::{
    geom::{Vec2, Vec3, polygon::segments_meet, polyline::ArcLength},
    mesh::{Bvh, TriMesh},
    model::GeodesicNet,
    surface::straightest::Traveller,
};

/// The net of a surface of revolution around z: `profile` runs through (radius, height), mm, and its turned copies become the
/// geodesics, `columns` of them over the angle `opening`, rad, symmetric to the x-axis. The `rows` points of each are evenly
/// spaced along the profile.
pub fn of_revolution(profile: &[Vec2], rows: usize, columns: usize, opening: f64) -> Result<GeodesicNet, StartError> {
    check_size(rows, columns)?;
    check_profile(profile)?;
    let line = ArcLength::new(profile.to_vec()).ok_or(StartError::ShortProfile { points: profile.len() })?;
    let step = line.length() / (rows - 1) as f64;
    Ok(GeodesicNet::from_fn(rows, columns, |i, j| {
        let (at, _) = line.at(i as f64 * step);
        let angle = opening * (j as f64 / (columns - 1) as f64 - 0.5);
        Vec3::new(at.x * angle.cos(), at.x * angle.sin(), at.y)
    }))
}

/// Steps per row in which a twisted geodesic is integrated.
const PER_ROW: usize = 64;

/// The net of the same surface whose geodesics cross the meridians: at the narrowest parallel under the angle `twist`, rad, less
/// than a right one, and elsewhere by Clairaut's relation r cos α = k (equation 9). Neighbours are turned by `opening` /
/// (`columns` − 1), and lines across are those at right angles to all of them: by the lemma of Gauss the points where the
/// length along each geodesic is less than along the one before by k times the turn.
pub fn twisted(
    profile: &[Vec2],
    rows: usize,
    columns: usize,
    opening: f64,
    twist: f64,
) -> Result<GeodesicNet, StartError> {
    check_size(rows, columns)?;
    check_profile(profile)?;
    let line = ArcLength::new(profile.to_vec()).ok_or(StartError::ShortProfile { points: profile.len() })?;
    let k = profile.iter().map(|p| p.x).fold(f64::INFINITY, f64::min) * twist.sin();
    let (count, turn) = (rows * PER_ROW, opening / (columns - 1) as f64);
    let step = line.length() / count as f64;
    // Lengths and longitudes of one geodesic at even steps of the profile, by the rule of the middle.
    let mut along = vec![(0.0, 0.0)];
    for m in 0..count {
        let radius = line.at((m as f64 + 0.5) * step).0.x;
        let cosine = (1.0 - (k / radius).powi(2)).sqrt();
        let (length, longitude) = along[m];
        along.push((length + step / cosine, longitude + step * k / (radius * radius * cosine)));
    }
    let place = |length: f64| {
        let m = along.partition_point(|it| it.0 <= length).clamp(1, count) - 1;
        let (from, to) = (along[m], along[m + 1]);
        let t = (length - from.0) / (to.0 - from.0);
        (line.at((m as f64 + t) * step).0, from.1 + (to.1 - from.1) * t)
    };
    let shift = k * turn;
    let length = along[count].0 - shift * (columns - 1) as f64;
    if length < 0.5 * along[count].0 {
        return Err(StartError::Twisted { left: length.max(0.0), of: along[count].0 });
    }
    Ok(GeodesicNet::from_fn(rows, columns, |i, j| {
        let back = shift * (columns - 1 - j) as f64;
        let (at, longitude) = place(length * i as f64 / (rows - 1) as f64 + back);
        let angle = longitude + turn * j as f64;
        Vec3::new(at.x * angle.cos(), at.x * angle.sin(), at.y)
    }))
}

/// Checks that a profile keeps off the axis and off itself.
pub fn check_profile(profile: &[Vec2]) -> Result<(), StartError> {
    if profile.len() < 2 {
        return Err(StartError::ShortProfile { points: profile.len() });
    }
    if let Some((point, at)) = profile.iter().enumerate().find(|(_, p)| !(p.x > 0.0 && p.y.is_finite())) {
        return Err(StartError::OnAxis { point, radius: at.x });
    }
    let segment = |k: usize| (profile[k], profile[k + 1]);
    for second in 2..profile.len() - 1 {
        for first in 0..second - 1 {
            let ((a, b), (c, d)) = (segment(first), segment(second));
            if segments_meet(a, b, c, d) {
                return Err(StartError::CrossingProfile { first, second });
            }
        }
    }
    Ok(())
}

fn check_size(rows: usize, columns: usize) -> Result<(), StartError> {
    if rows < 3 || columns < 3 { Err(StartError::TooCoarse { rows, columns }) } else { Ok(()) }
}

/// How a net lies on a patch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Layout {
    /// Points along a geodesic.
    pub rows: usize,
    /// Number of geodesics.
    pub columns: usize,
    /// A point near the one where the middle geodesic meets the base; `None` for the centre of the patch.
    pub center: Option<Vec3>,
    /// Direction of the geodesics there; `None` for the longest way through the patch.
    pub direction: Option<Vec3>,
    /// Share of the base that is used, in (0, 1]; the net reaches as far as the shortest geodesic from there.
    pub share: f64,
}

/// Directions tried for the longest way through a patch, over half a turn.
const DIRECTIONS: usize = 36;

/// A net on a disk-like patch: geodesic parallel coordinates of a base that is itself a geodesic. From evenly spaced points of
/// the base straightest geodesics run to both sides at right angles; by the lemma of Gauss the points at one distance from
/// the base make a line that meets all of them at right angles.
pub fn on_patch(mesh: &TriMesh, layout: &Layout) -> Result<GeodesicNet, StartError> {
    let Layout { rows, columns, .. } = *layout;
    check_size(rows, columns)?;
    let (euler, loops) = (mesh.euler_characteristic(), mesh.boundary_loops().len());
    if euler != 1 || loops != 1 || mesh.components().1 != 1 {
        return Err(StartError::NoDisk { euler, loops });
    }
    let limit = 4.0 * mesh.bounds().diagonal();
    let middle = middle_geodesic(mesh, layout, limit).ok_or(StartError::NoDirection)?;
    // The base runs to the left of the middle geodesic, and the geodesics to the right of it, so that along × across is the outer
    // normal.
    let base = middle.left(mesh);
    let [back, forth] = [base.reversed(), base].map(|it| it.reach(mesh, limit) * layout.share);
    let foot = |j: usize| {
        // Just inside the boundary, from which nothing could set out.
        let at = (-back + (back + forth) * j as f64 / (columns - 1) as f64) * (1.0 - 1e-6);
        let foot =
            if at < 0.0 { base.reversed().walk(mesh, -at).ok()?.reversed() } else { base.walk(mesh, at).ok()? };
        Some(foot.left(mesh).reversed())
    };
    let feet: Vec<Traveller> = (0..columns).map(foot).collect::<Option<_>>().ok_or(StartError::NoDirection)?;
    let shortest = |side: &dyn Fn(&Traveller) -> Traveller| {
        feet.iter().map(|it| side(it).reach(mesh, limit)).fold(f64::INFINITY, f64::min) * (1.0 - 1e-6)
    };
    let [behind, ahead] = [shortest(&|it| it.reversed()), shortest(&|it| *it)];
    let step = (behind + ahead) / (rows - 1) as f64;
    if step * columns as f64 <= 1e-3 * (back + forth) {
        return Err(StartError::Narrow { reach: behind + ahead, base: back + forth });
    }
    let mut points = vec![Vec3::zeros(); rows * columns];
    for (j, foot) in feet.iter().enumerate() {
        for i in 0..rows {
            let at = i as f64 * step - behind;
            let from = if at < 0.0 { foot.reversed() } else { *foot };
            let there = from.walk(mesh, at.abs()).map_err(|_| StartError::NoDirection)?;
            points[i * columns + j] = there.point;
        }
    }
    Ok(GeodesicNet { rows, columns, points })
}

/// Who sets out from the centre along the middle geodesic; without a direction along the longest way through the patch.
fn middle_geodesic(mesh: &TriMesh, layout: &Layout, limit: f64) -> Option<Traveller> {
    let mut weighted = Vec3::zeros();
    for f in mesh.faces() {
        let [a, b, c] = mesh.face_positions(f);
        weighted += (a + b + c) * (mesh.area(f) / 3.0);
    }
    let center = Bvh::new(mesh).closest(layout.center.unwrap_or(weighted / mesh.total_area()));
    let towards = |direction| Traveller::new(mesh, center.face, center.point, direction);
    if let Some(direction) = layout.direction {
        return towards(direction);
    }
    let [a, b, _] = mesh.face_positions(center.face);
    let first = towards(b - a)?;
    let turned = |k: usize| {
        let angle = std::f64::consts::PI * k as f64 / DIRECTIONS as f64;
        let direction = first.direction * angle.cos() + first.left(mesh).direction * angle.sin();
        Traveller { direction, ..first }
    };
    let width = |it: &Traveller| it.reach(mesh, limit) + it.reversed().reach(mesh, limit);
    (0..DIRECTIONS).map(turned).max_by(|a, b| width(a).total_cmp(&width(b)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;

    #[test]
    fn profiles_that_make_no_surface_are_named() {
        let at = |points: &[[f64; 2]]| {
            let profile: Vec<Vec2> = points.iter().map(|p| Vec2::new(p[0], p[1])).collect();
            of_revolution(&profile, 5, 5, 1.0).unwrap_err()
        };
        assert_eq!(at(&[[1.0, 0.0], [0.0, 1.0]]), StartError::OnAxis { point: 1, radius: 0.0 });
        assert_eq!(
            at(&[[1.0, 0.0], [3.0, 2.0], [3.0, 0.0], [1.0, 2.0]]),
            StartError::CrossingProfile { first: 0, second: 2 }
        );
        assert_eq!(at(&[[1.0, 0.0]]), StartError::ShortProfile { points: 1 });
    }

    #[test]
    fn twisted_geodesics_meet_the_lines_across_at_right_angles() {
        let profile: Vec<Vec2> =
            (0..400).map(|k| f64::from(k) / 399.0).map(|t| Vec2::new(4.0 + (5.0 * t).sin(), 12.0 * t)).collect();
        let error = |n: usize| {
            let net = twisted(&profile, 2 * n + 1, n + 1, 1.0, 0.6).unwrap();
            let cosine = |(i, j)| {
                let it = net.frame(i, j).unwrap();
                it.along.dot(&it.across).abs()
            };
            let inner = (1..2 * n).flat_map(|i| (1..n).map(move |j| (i, j)));
            inner.map(cosine).fold(0.0, f64::max)
        };
        let (coarse, fine) = (error(10), error(20));
        assert!(coarse < 0.01 && fine < 0.4 * coarse, "{coarse:e} {fine:e}");
        assert!(matches!(twisted(&profile, 9, 9, 6.0, 1.5), Err(StartError::Twisted { .. })));
    }

    #[test]
    fn a_patch_must_be_a_disk_and_the_net_fine_enough() {
        let layout = Layout { rows: 5, columns: 5, center: None, direction: None, share: 0.8 };
        assert!(matches!(on_patch(&shapes::icosphere(1.0, 1), &layout), Err(StartError::NoDisk { .. })));
        let coarse = Layout { rows: 2, ..layout };
        assert!(matches!(on_patch(&shapes::grid(4, 4, 1.0), &coarse), Err(StartError::TooCoarse { .. })));
    }

    #[test]
    fn on_a_plane_the_net_is_a_grid_of_rectangles() {
        let layout =
            Layout { rows: 7, columns: 9, center: None, direction: Some(Vec3::new(1.0, 0.3, 0.0)), share: 0.5 };
        let net = on_patch(&shapes::grid(8, 8, 1.0), &layout).unwrap();
        for i in 0..6 {
            for j in 0..8 {
                let (u, v) = (net.at(i + 1, j) - net.at(i, j), net.at(i, j + 1) - net.at(i, j));
                // A geodesic that meets a vertex is moved aside by a billionth of an edge.
                assert!(u.dot(&v).abs() < 1e-7, "{i} {j}: {:e}", u.dot(&v));
                assert!((net.along(i, j) - net.along(0, 0)).abs() < 1e-7);
                assert!((net.across(i, j) - net.across(0, 0)).abs() < 1e-7);
            }
        }
    }
}
