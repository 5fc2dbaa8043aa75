//! Flat regions larger than the sheet are cut once more, along straight lines across them.
use std::collections::BTreeMap;

use super::{
    UnfoldError,
    tiles::{Tile, Tiles},
};
use crate::{
    geom::{
        Vec2,
        polygon::{bounds_turned, convex_hull, least_box_angle, least_excess, turned},
    },
    mesh::{EdgeId, FaceId, Field, HalfedgeId, MeshError, TriMesh},
    numeric::Monitor,
};

/// Lines tried across the middle half of a region.
const LINES: usize = 25;
/// A line keeps this share of the region's length away from every corner, so that no sliver is left.
const AWAY: f64 = 1e-3;
/// Most lines through one mesh: each takes a part of a sheet away, so more mean a model of hundreds of sheets.
const MOST: usize = 1000;

/// The mesh cut until every flat region fits into `room`, and the group of every face: faces of different groups are
/// never one region, even where they lie in one plane.
pub(super) fn slice(
    mesh: &TriMesh,
    room: [f64; 2],
    monitor: &Monitor,
) -> Result<(TriMesh, Field<FaceId, u32>), UnfoldError> {
    let mut mesh = mesh.clone();
    let mut group = Field::filled(mesh.face_count(), 0);
    for count in 0..MOST {
        monitor.check()?;
        let tiles = Tiles::new(&mesh, &group).tiles;
        let large = |it: &&Tile| {
            let hull = convex_hull(it.triangles.as_flattened());
            least_excess(&hull, room).0 > 1.0
        };
        let Some(tile) = tiles.iter().find(large) else { break };
        let Some(line) = line(tile) else { break };
        (mesh, group) = split(&mesh, &group, tile, line, 2 * count as u32 + 1)?;
    }
    Ok((mesh, group))
}

/// A line across a region: the turn that makes it upright, and where it then stands.
type Line = (f64, f64);

/// The shortest straight cut across the longer side of a region, near its middle.
fn line(tile: &Tile) -> Option<Line> {
    let points = tile.triangles.as_flattened();
    let angle = least_box_angle(points);
    let bounds = bounds_turned(points, angle);
    let (from, length) = (bounds.min.x, bounds.size().x);
    let best = (0..LINES)
        .map(|k| from + length * (0.25 + 0.5 * (k as f64 + 0.5) / LINES as f64))
        .filter(|x| points.iter().all(|&p| (turned(p, angle).x - x).abs() > AWAY * length))
        .map(|x| (chord(tile, (angle, x)) + 1e-3 * (x - from - length / 2.0).abs(), x))
        .min_by(|a, b| a.0.total_cmp(&b.0))?;
    Some((angle, best.1))
}

/// Signed distance of a point from a line.
fn side(p: Vec2, (angle, x): Line) -> f64 {
    turned(p, angle).x - x
}

/// Length of a line within a region, mm.
fn chord(tile: &Tile, line: Line) -> f64 {
    let across = |corners: &[Vec2; 3]| {
        let crossing = |k: usize| {
            let (a, b) = (corners[k], corners[(k + 1) % 3]);
            let (s, t) = (side(a, line), side(b, line));
            (s * t < 0.0).then(|| a + (b - a) * (s / (s - t)))
        };
        match (0..3).filter_map(crossing).collect::<Vec<_>>()[..] {
            [p, q] => (q - p).norm(),
            _ => 0.0,
        }
    };
    tile.triangles.iter().map(across).sum()
}

/// Divides the faces of a region along a line through none of its corners; the side before it becomes group `number`, the
/// other one the next. Neighbours get the new corners too.
fn split(
    mesh: &TriMesh,
    group: &Field<FaceId, u32>,
    tile: &Tile,
    line: Line,
    number: u32,
) -> Result<(TriMesh, Field<FaceId, u32>), MeshError> {
    let mut positions = mesh.positions().as_slice().to_vec();
    let mut corner: BTreeMap<HalfedgeId, f64> = BTreeMap::new();
    let mut new: BTreeMap<EdgeId, u32> = BTreeMap::new();
    for (&f, corners) in tile.faces.iter().zip(&tile.triangles) {
        let sides = corners.map(|p| side(p, line));
        for (k, h) in mesh.face_halfedges(f).into_iter().enumerate() {
            corner.insert(h, sides[k]);
            let (s, t) = (sides[k], sides[(k + 1) % 3]);
            if s * t < 0.0 && !new.contains_key(&mesh.edge(h)) {
                new.insert(mesh.edge(h), positions.len() as u32);
                positions.push(mesh.position(mesh.tail(h)) + mesh.vector(h) * (s / (s - t)));
            }
        }
    }
    let mut faces: Vec<[u32; 3]> = Vec::new();
    let mut groups: Vec<u32> = Vec::new();
    for f in mesh.faces() {
        let sides = mesh.face_halfedges(f);
        let on = sides.map(|h| new.get(&mesh.edge(h)).copied());
        for (triangle, first) in divided(mesh.face_vertices(f).map(|v| v.0), on) {
            faces.push(triangle);
            // A triangle of the region lies where its first old corner lies.
            let before = corner.get(&sides[first]).map(|it| number + u32::from(*it > 0.0));
            groups.push(before.unwrap_or(group[f]));
        }
    }
    Ok((TriMesh::new(positions, &faces)?, Field::from_vec(groups)))
}

/// A triangle with new corners on some sides (side k begins at corner k) as triangles, each with an old corner of its own.
fn divided([a, b, c]: [u32; 3], on: [Option<u32>; 3]) -> Vec<([u32; 3], usize)> {
    match on {
        [None, None, None] => vec![([a, b, c], 0)],
        [Some(p), None, None] => vec![([a, p, c], 0), ([p, b, c], 1)],
        [Some(p), None, Some(q)] => vec![([a, p, q], 0), ([p, b, c], 1), ([p, c, q], 2)],
        [Some(p), Some(q), Some(r)] => vec![([a, p, r], 0), ([p, b, q], 1), ([q, c, r], 2), ([p, q, r], 0)],
        // Turned until the first or the first and the last side are divided.
        [p, q, r] => divided([b, c, a], [q, r, p]).into_iter().map(|(it, first)| (it, (first + 1) % 3)).collect(),
    }
}
