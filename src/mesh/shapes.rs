//! Parametric shapes by formula: exact geometry for tests, benches and the fixture script.
//!
//! All lengths are millimetres, closed shapes are oriented outwards, the z axis is the axis of everything round.
//! Counts below the stated minimum, and lengths that make no surface, are programming errors and panic.
pub mod ruled;

use std::{
    collections::BTreeMap,
    f64::consts::{PI, TAU},
};

use super::TriMesh;
use crate::geom::{Vec2, Vec3};

/// A flat rectangle in the plane z = 0 from the origin, facing +z: `columns` × `rows` squares of side `spacing`, each
/// split by the diagonal from its lower left corner. Vertex (i, j) has the id `j (columns + 1) + i`.
pub fn grid(columns: usize, rows: usize, spacing: f64) -> TriMesh {
    let (points, faces) =
        lattice([columns, rows], [false; 2], |i, j| Vec3::new(i as f64 * spacing, j as f64 * spacing, 0.0));
    finish(points, &faces)
}

/// A sphere from the icosahedron: 20 · 4^`level` faces, every vertex at `radius`.
pub fn icosphere(radius: f64, level: usize) -> TriMesh {
    let golden = (1.0 + 5.0_f64.sqrt()) / 2.0;
    let mut points = Vec::new();
    for s in [1.0, -1.0] {
        for t in [golden, -golden] {
            points.extend([Vec3::new(0.0, s, t), Vec3::new(s, t, 0.0), Vec3::new(t, 0.0, s)]);
        }
    }
    let mut faces = icosahedron_faces(&points);
    for _ in 0..level {
        faces = split_in_four(&mut points, &faces);
        points.iter_mut().for_each(|p| *p = p.normalize());
    }
    finish(points.into_iter().map(|p| p.normalize() * radius).collect(), &faces)
}

/// Surface of revolution around z of an open `profile` of (radius, z), with `around` ≥ 3 segments. The surface lies to the
/// right of the profile's direction of travel, so a profile that climbs on the outside faces outwards. Only the first and
/// the last point may have radius 0: they become poles.
pub fn revolve(profile: &[Vec2], around: usize) -> TriMesh {
    assert!(around >= 3 && profile.len() >= 2, "a surface of revolution needs 3 segments and 2 profile points");
    let start = usize::from(profile[0].x == 0.0);
    let end = profile.len() - usize::from(profile[profile.len() - 1].x == 0.0);
    let rings = &profile[start..end];
    assert!(rings.iter().all(|p| p.x > 0.0), "only the ends of a profile may touch the axis");
    let (mut points, mut faces) =
        lattice([around, rings.len() - 1], [true, false], |i, j| around_axis(rings[j].x, rings[j].y, turn(i, around)));
    let mut pole = |tip: Vec2, ring: usize, flip: bool| {
        let apex = points.len() as u32;
        points.push(Vec3::new(0.0, 0.0, tip.y));
        for i in 0..around {
            let (a, b) = ((ring * around + i) as u32, (ring * around + (i + 1) % around) as u32);
            faces.push(if flip { [a, b, apex] } else { [b, a, apex] });
        }
    };
    if start == 1 {
        pole(profile[0], 0, false);
    }
    if end < profile.len() {
        pole(profile[end], rings.len() - 1, true);
    }
    finish(points, &faces)
}

/// An open cylinder from z = 0 to `height`: `around` ≥ 3 segments, `along` ≥ 1 rings of quads. All vertices lie on the
/// cylinder and all creases along its rulings, so the mesh is exactly developable.
pub fn cylinder(radius: f64, height: f64, around: usize, along: usize) -> TriMesh {
    cone_frustum(radius, radius, height, around, along)
}

/// An open cone frustum from radius `bottom` at z = 0 to radius `top` at `height`, both positive. Exactly developable.
pub fn cone_frustum(bottom: f64, top: f64, height: f64, around: usize, along: usize) -> TriMesh {
    revolve(&segment(Vec2::new(bottom, 0.0), Vec2::new(top, height), along), around)
}

/// A flat ring in the plane z = 0 facing +z.
pub fn annulus(inner: f64, outer: f64, around: usize, across: usize) -> TriMesh {
    revolve(&segment(Vec2::new(outer, 0.0), Vec2::new(inner, 0.0), across), around)
}

/// A torus: `major` from the axis to the middle of the tube, `minor` the radius of the tube.
pub fn torus(major: f64, minor: f64, around: usize, tube: usize) -> TriMesh {
    let (points, faces) = lattice([around, tube], [true, true], |i, j| {
        let angle = turn(j, tube);
        around_axis(major + minor * angle.cos(), minor * angle.sin(), turn(i, around))
    });
    finish(points, &faces)
}

/// The tangent developable of a helix (`radius`, rise `pitch` per turn) over `turns`, from `inner` to `outer` along its
/// tangents, meshed along the rulings: `rulings` strips, `along` quads in each.
///
/// The curve of regression is the helix's inscribed polygon and the rulings carry its edges, so neighbouring rulings meet
/// in a vertex of the polygon, every strip is planar, and the mesh is exactly developable (the discrete tangent
/// developable of Sauer). `inner` must be longer than half an edge of the polygon.
pub fn tangent_developable(
    radius: f64,
    pitch: f64,
    turns: f64,
    [inner, outer]: [f64; 2],
    rulings: usize,
    along: usize,
) -> TriMesh {
    let step = turns * TAU / rulings as f64;
    let corner = |i: usize| {
        let angle = i as f64 * step;
        around_axis(radius, pitch * angle / TAU, angle)
    };
    assert!(2.0 * inner > (corner(1) - corner(0)).norm() && outer > inner, "the strips would fold over");
    let (points, faces) = lattice([along, rulings], [false; 2], |j, i| {
        let (a, b) = (corner(i), corner(i + 1));
        (a + b) / 2.0 + (b - a).normalize() * (inner + (outer - inner) * j as f64 / along as f64)
    });
    finish(points, &faces)
}

/// A closed box from the origin to `size` with `divisions` squares along every edge.
pub fn cuboid(size: Vec3, divisions: usize) -> TriMesh {
    let (points, faces) = voxel_surface([divisions; 3], |_| true);
    finish(points.into_iter().map(|p| (p / divisions as f64).component_mul(&size)).collect(), &faces)
}

/// A closed box around the origin whose edges and corners are rounded with `radius` (less than half the smallest side):
/// every vertex lies exactly on a plane, a cylinder or a sphere. `flat` squares along every flat side, `round` along
/// every quarter circle.
pub fn rounded_cuboid(size: Vec3, radius: f64, flat: usize, round: usize) -> TriMesh {
    let inner = size / 2.0 - Vec3::repeat(radius);
    assert!(radius > 0.0 && inner.min() > 0.0, "the radius must be less than half the smallest side");
    let cells = flat + 2 * round;
    let (points, faces) = voxel_surface([cells; 3], |_| true);
    // One axis of the lattice: first the flat part in [-1, 1], then the angle beyond it.
    let flat_part = |k: f64| ((k - round as f64) / flat as f64).clamp(0.0, 1.0) * 2.0 - 1.0;
    let quarter = |k: f64| {
        let beyond = if k < round as f64 { k - round as f64 } else { (k - (cells - round) as f64).max(0.0) };
        (beyond / round as f64 * PI / 4.0).tan()
    };
    let place = |p: &Vec3| p.map(flat_part).component_mul(&inner) + p.map(quarter).normalize() * radius;
    finish(points.iter().map(place).collect(), &faces)
}

/// A closed plate with `holes` square holes in a row: genus = `holes`. Its cells are cubes of side `cell`, 2 `holes` + 1
/// in x, 3 in y, 1 in z, each divided into `divisions`³.
pub fn perforated_plate(holes: usize, cell: f64, divisions: usize) -> TriMesh {
    let solid = |at: [usize; 3]| at[1] / divisions != 1 || (at[0] / divisions).is_multiple_of(2);
    let (points, faces) = voxel_surface([(2 * holes + 1) * divisions, 3 * divisions, divisions], solid);
    finish(points.into_iter().map(|p| p * cell / divisions as f64).collect(), &faces)
}

fn finish(points: Vec<Vec3>, faces: &[[u32; 3]]) -> TriMesh {
    TriMesh::new(points, faces).expect("sensible parameters give a manifold without degenerate faces")
}

/// Angle of step `i` of `n`; multiples of a quarter are exact in `around_axis`.
fn turn(i: usize, n: usize) -> f64 {
    TAU * (i % n) as f64 / n as f64
}

fn around_axis(radius: f64, z: f64, angle: f64) -> Vec3 {
    Vec3::new(radius * angle.cos(), radius * angle.sin(), z)
}

/// `n` + 1 equidistant points.
fn segment(from: Vec2, to: Vec2, n: usize) -> Vec<Vec2> {
    (0..=n).map(|i| from + (to - from) * (i as f64 / n as f64)).collect()
}

/// `n` × `m` quads, each split from (i, j) to (i + 1, j + 1); a direction that wraps joins its last row to its first.
fn lattice([n, m]: [usize; 2], wrap: [bool; 2], point: impl Fn(usize, usize) -> Vec3) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let (width, height) = (n + usize::from(!wrap[0]), m + usize::from(!wrap[1]));
    let points = (0..height).flat_map(|j| (0..width).map(move |i| (i, j))).map(|(i, j)| point(i, j)).collect();
    let id = |i: usize, j: usize| (j % height * width + i % width) as u32;
    let mut faces = Vec::with_capacity(2 * n * m);
    for (i, j) in (0..m).flat_map(|j| (0..n).map(move |i| (i, j))) {
        faces.push([id(i, j), id(i + 1, j), id(i + 1, j + 1)]);
        faces.push([id(i, j), id(i + 1, j + 1), id(i, j + 1)]);
    }
    (points, faces)
}

/// The faces of the icosahedron: the triples of vertices at mutual distance 2, turned outwards.
fn icosahedron_faces(points: &[Vec3]) -> Vec<[u32; 3]> {
    let near = |a: usize, b: usize| (points[a] - points[b]).norm() < 2.1;
    let mut faces = Vec::with_capacity(20);
    for a in 0..12 {
        for b in (a + 1..12).filter(|&b| near(a, b)) {
            for c in (b + 1..12).filter(|&c| near(a, c) && near(b, c)) {
                let outwards = points[a].dot(&points[b].cross(&points[c])) > 0.0;
                let [b, c] = if outwards { [b, c] } else { [c, b] };
                faces.push([a as u32, b as u32, c as u32]);
            }
        }
    }
    faces
}

/// 4–1 subdivision; appends the edge midpoints to `points`.
fn split_in_four(points: &mut Vec<Vec3>, faces: &[[u32; 3]]) -> Vec<[u32; 3]> {
    let mut middles = BTreeMap::new();
    let mut middle = |a: u32, b: u32| {
        *middles.entry([a.min(b), a.max(b)]).or_insert_with(|| {
            points.push((points[a as usize] + points[b as usize]) / 2.0);
            (points.len() - 1) as u32
        })
    };
    let mut out = Vec::with_capacity(4 * faces.len());
    for &[a, b, c] in faces {
        let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
        out.extend([[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]);
    }
    out
}

/// The surface of the solid cells of a lattice of unit cubes. Cells must not touch along an edge or a corner alone.
fn voxel_surface(size: [usize; 3], solid: impl Fn([usize; 3]) -> bool) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let filled = |at: [i64; 3]| (0..3).all(|k| (0..size[k] as i64).contains(&at[k])) && solid(at.map(|it| it as usize));
    let mut ids = BTreeMap::new();
    let mut points = Vec::new();
    let mut faces = Vec::new();
    let cells = size.map(|n| n as i64);
    for z in 0..cells[2] {
        for (x, y) in (0..cells[1]).flat_map(|y| (0..cells[0]).map(move |x| (x, y))).filter(|&(x, y)| filled([x, y, z]))
        {
            for (axis, side) in (0..3).flat_map(|axis| [(axis, 0), (axis, 1)]) {
                let mut beyond = [x, y, z];
                beyond[axis] += 2 * side - 1;
                if filled(beyond) {
                    continue;
                }
                let mut corner = |u: i64, v: i64| {
                    let mut at = [x, y, z];
                    at[axis] += side;
                    at[(axis + 1) % 3] += u;
                    at[(axis + 2) % 3] += v;
                    *ids.entry(at).or_insert_with(|| {
                        points.push(Vec3::new(at[0] as f64, at[1] as f64, at[2] as f64));
                        (points.len() - 1) as u32
                    })
                };
                let [a, b, c, d] = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
                faces.extend(if side == 1 { [[a, b, c], [a, c, d]] } else { [[a, c, b], [a, d, c]] });
            }
        }
    }
    (points, faces)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::VertexId;

    struct Expected {
        name: &'static str,
        mesh: TriMesh,
        euler: i64,
        loops: usize,
        genus: usize,
        /// Exact area of the mesh, or of the smooth shape with the relative error that the resolution allows.
        area: (f64, f64),
        /// Exact enclosed volume and relative error; `None` for open shapes.
        volume: Option<(f64, f64)>,
    }

    /// Volume by the divergence theorem: positive when oriented outwards.
    fn volume(mesh: &TriMesh) -> f64 {
        mesh.faces().map(|f| mesh.face_positions(f)).map(|[a, b, c]| a.dot(&b.cross(&c)) / 6.0).sum()
    }

    /// Perimeter of a regular `n`-gon in a circle of radius 1.
    fn perimeter(n: f64) -> f64 {
        2.0 * n * (PI / n).sin()
    }

    fn all() -> Vec<Expected> {
        let open = |name, mesh, loops, area| Expected {
            name,
            mesh,
            euler: 2 - loops as i64,
            loops,
            genus: 0,
            area: (area, 1e-12),
            volume: None,
        };
        let closed = |name, mesh, genus: usize, area, volume, error| Expected {
            name,
            mesh,
            euler: 2 - 2 * genus as i64,
            loops: 0,
            genus,
            area: (area, error),
            volume: Some((volume, error)),
        };
        // A conical band made of trapezoids: half the sum of the perimeters times the apothem's slant.
        let band = |r: f64, s: f64, height: f64, n: f64| {
            let apothem = (r - s) * (PI / n).cos();
            0.5 * perimeter(n) * (r + s) * height.hypot(apothem)
        };
        vec![
            open("grid", grid(7, 4, 2.5), 1, 7.0 * 4.0 * 6.25),
            open("cylinder", cylinder(20.0, 60.0, 48, 9), 2, perimeter(48.0) * 20.0 * 60.0),
            open("cone", cone_frustum(30.0, 12.0, 50.0, 40, 6), 2, band(30.0, 12.0, 50.0, 40.0)),
            open("annulus", annulus(10.0, 25.0, 36, 4), 2, band(25.0, 10.0, 0.0, 36.0)),
            open("cap", revolve(&[Vec2::new(9.0, 0.0), Vec2::new(0.0, 5.0)], 12), 1, band(9.0, 0.0, 5.0, 12.0)),
            closed("icosphere", icosphere(30.0, 5), 0, 4.0 * PI * 900.0, 4.0 / 3.0 * PI * 27000.0, 2e-3),
            closed("torus", torus(40.0, 15.0, 160, 80), 1, 4.0 * PI * PI * 600.0, 2.0 * PI * PI * 40.0 * 225.0, 2e-3),
            closed("cuboid", cuboid(Vec3::new(10.0, 20.0, 30.0), 3), 0, 2200.0, 6000.0, 1e-12),
            closed("plate 0", perforated_plate(0, 5.0, 1), 0, 14.0 * 25.0, 375.0, 1e-12),
            closed("plate 2", perforated_plate(2, 5.0, 2), 2, (26.0 + 16.0 + 8.0) * 25.0, 13.0 * 125.0, 1e-12),
            closed(
                "rounded cuboid",
                rounded_cuboid(Vec3::new(40.0, 50.0, 60.0), 8.0, 4, 24),
                0,
                2.0 * (24.0 * 34.0 + 34.0 * 44.0 + 44.0 * 24.0) + TAU * 8.0 * (24.0 + 34.0 + 44.0) + 4.0 * PI * 64.0,
                24.0 * 34.0 * 44.0
                    + 2.0 * 8.0 * (24.0 * 34.0 + 34.0 * 44.0 + 44.0 * 24.0)
                    + PI * 64.0 * (24.0 + 34.0 + 44.0)
                    + 4.0 / 3.0 * PI * 512.0,
                1e-3,
            ),
            closed(
                "spindle",
                revolve(&[Vec2::zeros(), Vec2::new(6.0, 4.0), Vec2::new(0.0, 8.0)], 6),
                0,
                2.0 * band(6.0, 0.0, 4.0, 6.0),
                6.0 * 0.5 * 36.0 * (PI / 3.0).sin() * 8.0 / 3.0,
                1e-12,
            ),
        ]
    }

    #[test]
    fn shapes_have_their_topology_area_and_orientation() {
        for it in all() {
            let near = |value: f64, (exact, error): (f64, f64)| (value - exact).abs() <= error * exact;
            assert_eq!(it.mesh.euler_characteristic(), it.euler, "{}", it.name);
            assert_eq!(it.mesh.boundary_loops().len(), it.loops, "{}", it.name);
            assert_eq!(it.mesh.genus(), it.genus, "{}", it.name);
            assert_eq!(it.mesh.components().1, 1, "{}", it.name);
            assert!(near(it.mesh.total_area(), it.area), "{}: area {} {:?}", it.name, it.mesh.total_area(), it.area);
            if let Some(exact) = it.volume {
                assert!(near(volume(&it.mesh), exact), "{}: volume {} {exact:?}", it.name, volume(&it.mesh));
            }
        }
    }

    #[test]
    fn developable_shapes_have_no_angle_defect() {
        let tangent = tangent_developable(20.0, 40.0, 1.0, [8.0, 60.0], 60, 8);
        assert_eq!((tangent.boundary_loops().len(), tangent.genus()), (1, 0));
        for mesh in [tangent, cylinder(20.0, 60.0, 48, 9), cone_frustum(30.0, 12.0, 50.0, 40, 6), grid(5, 5, 1.0)] {
            for v in mesh.vertices().filter(|&v| !mesh.is_boundary_vertex(v)) {
                assert!(mesh.angle_defect(v).abs() < 1e-12, "vertex {v}: {}", mesh.angle_defect(v));
            }
        }
    }

    #[test]
    fn round_vertices_lie_on_the_sphere_and_the_cylinder() {
        let sphere = icosphere(30.0, 3);
        assert!(sphere.vertices().all(|v| (sphere.position(v).norm() - 30.0).abs() < 1e-12));
        let cylinder = cylinder(20.0, 60.0, 48, 9);
        assert!(cylinder.vertices().all(|v| (cylinder.position(v).xy().norm() - 20.0).abs() < 1e-12));
    }

    #[test]
    fn flat_shapes_face_up_and_the_grid_is_row_major() {
        for mesh in [grid(3, 2, 1.0), annulus(1.0, 2.0, 12, 2)] {
            assert!(mesh.faces().all(|f| mesh.normal(f).z > 0.999_999));
        }
        assert_eq!(grid(3, 2, 1.0).position(VertexId(4)), Vec3::new(0.0, 1.0, 0.0));
    }
}
