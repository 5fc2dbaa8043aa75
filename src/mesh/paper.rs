//! A flat sheet as a mesh: the cells of a grid, divided along the curves that are drawn on it.
use std::collections::BTreeMap;

use super::{MeshError, TriMesh, trimesh::is_degenerate};
use crate::geom::{
    Box2, Vec2, Vec3,
    arrangement::{Arrangement, ArrangementError, Curve},
    ears::ears,
};

/// Why there is no mesh.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PaperError {
    /// The curves have no arrangement.
    #[error(transparent)]
    Arrangement(#[from] ArrangementError),
    /// The triangles do not make a surface.
    #[error(transparent)]
    Mesh(#[from] MeshError),
}

/// Kind of the lines of the grid.
const GRID: u32 = u32::MAX;
/// Points nearer than this share of a cell are one.
const NEAR: f64 = 1e-3;
/// Times that lines are added until no face has a hole.
const MOST_ROUNDS: usize = 8;

/// Triangles in the plane z = 0, as large as `cell` (mm) at most, facing +z, of what the curves of kind `border` enclose (an odd
/// number of times). Every curve runs along edges.
pub fn paper(curves: &[Curve], border: u32, cell: f64) -> Result<TriMesh, PaperError> {
    let bounds = Box2::of(curves.iter().flat_map(|it| &it.points));
    let mut lines = [0, 1].map(|axis| {
        let count = ((bounds.max[axis] - bounds.min[axis]) / cell).ceil().max(1.0);
        let at = |k: usize| bounds.min[axis] + (bounds.max[axis] - bounds.min[axis]) * k as f64 / count;
        (1..count as usize).map(at).collect::<Vec<f64>>()
    });
    let mut divided = Arrangement::default();
    for _ in 0..MOST_ROUNDS {
        let mut all = curves.to_vec();
        for (axis, lines) in lines.iter().enumerate() {
            all.extend(lines.iter().map(|&x| {
                let end = |y: f64| if axis == 0 { Vec2::new(x, y) } else { Vec2::new(y, x) };
                let points = vec![end(bounds.min[1 - axis]), end(bounds.max[1 - axis])];
                Curve { points, closed: false, kind: GRID }
            }));
        }
        divided = Arrangement::new(&all, NEAR * cell, &|_| false)?;
        // A line through a hole joins its boundary to that around it.
        let holes: Vec<Box2> = divided.faces[1..].iter().flat_map(|face| &face[1..]).map(Box2::of).collect();
        if holes.is_empty() {
            break;
        }
        lines[0].extend(holes.iter().map(|it| 0.5 * (it.min.x + it.max.x)));
        lines[0].sort_by(f64::total_cmp);
        lines[0].dedup();
    }
    let inside = divided.inside(border);
    let mut index: BTreeMap<[u64; 2], u32> = BTreeMap::new();
    let (mut points, mut faces): (Vec<Vec3>, Vec<[u32; 3]>) = (Vec::new(), Vec::new());
    for (face, _) in divided.faces.iter().zip(&inside).filter(|it| *it.1) {
        let contour = &face[0];
        let corner: Vec<u32> = contour
            .iter()
            .map(|p| {
                *index.entry([p.x.to_bits(), p.y.to_bits()]).or_insert_with(|| {
                    points.push(Vec3::new(p.x, p.y, 0.0));
                    points.len() as u32 - 1
                })
            })
            .collect();
        faces.extend(ears(contour).into_iter().map(|it| it.map(|k| corner[k])));
    }
    mend(&points, &mut faces);
    Ok(TriMesh::new(points, &faces)?)
}

/// Takes out triangles without area: the middle one of their three corners is put into the longest side, in the triangle on
/// its other side.
fn mend(points: &[Vec3], faces: &mut Vec<[u32; 3]>) {
    let place = |v: u32| points[v as usize];
    // Every round takes one out; those that come of it lie on the same line, of which there are few.
    for _ in 0..2 * faces.len() {
        let Some(flat) = faces.iter().position(|it| is_degenerate(it.map(place))) else { return };
        let face = faces.swap_remove(flat);
        let length = |k: usize| (place(face[(k + 1) % 3]) - place(face[k])).norm();
        let longest = (0..3).max_by(|&i, &j| length(i).total_cmp(&length(j))).unwrap_or(0);
        let [a, b, middle] = [0, 1, 2].map(|k| face[(longest + k) % 3]);
        let across = |it: &[u32; 3]| (0..3).find(|&k| it[k] == b && it[(k + 1) % 3] == a);
        if let Some((other, k)) = faces.iter().enumerate().find_map(|(f, it)| Some((f, across(it)?))) {
            let far = faces[other][(k + 2) % 3];
            faces[other] = [b, middle, far];
            faces.push([middle, a, far]);
        }
    }
}
