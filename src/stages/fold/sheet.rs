//! A mesh of the sheet that the nets carry along.
use super::{FoldError, net::Net};
use crate::{
    geom::{
        Vec2, Vec3,
        polygon::{self, nearest_on_segment},
    },
    mesh::{Id, TriMesh},
    model::CreasePattern,
};

/// A patch, and a point of it as a combination of four vertices of the net.
type Tie = (usize, [(u32, f64); 4]);

/// Of every vertex of the mesh one for each patch that it belongs to.
pub(super) struct Sheet(Vec<Vec<Tie>>);

impl Sheet {
    /// Ties a flat mesh whose edges run along the creases to the nets.
    pub(super) fn new(pattern: &CreasePattern, mesh: &TriMesh, net: &Net) -> Result<Self, FoldError> {
        let mut out = vec![Vec::new(); mesh.vertex_count()];
        for f in mesh.faces() {
            let corners = mesh.face_positions(f).map(|p| Vec2::new(p.x, p.y));
            let middle = (corners[0] + corners[1] + corners[2]) / 3.0;
            let far = pattern.bounds().size().norm();
            let Some((patch, _)) = nearest_patch(pattern, middle, far) else { continue };
            for (v, p) in mesh.face_vertices(f).into_iter().zip(corners) {
                let ties: &mut Vec<Tie> = &mut out[v.index()];
                if ties.iter().all(|it| it.0 != patch) {
                    let form = net
                        .locate(patch, p, middle)
                        .or_else(|| net.nearest(patch, p))
                        .ok_or(FoldError::Uncovered { patch, x: p.x, y: p.y, edge: net.grid.edge })?;
                    ties.push((patch, form));
                }
            }
        }
        Ok(Self(out))
    }

    /// Places of the vertices (mm): of one on a crease the middle of its places on both sides.
    pub(super) fn at(&self, x: &[Vec3], unit: f64) -> Vec<Vec3> {
        let place = |form: &[(u32, f64); 4]| form.iter().fold(Vec3::zeros(), |sum, &(v, w)| sum + x[v as usize] * w);
        let mean = |ties: &Vec<(usize, [(u32, f64); 4])>| {
            ties.iter().map(|it| place(&it.1)).sum::<Vec3>() * (unit / ties.len().max(1) as f64)
        };
        self.0.iter().map(mean).collect()
    }
}

/// The piece of every patch, the largest first.
pub(super) fn pieces_of_patches(pattern: &CreasePattern) -> Vec<usize> {
    let bodies = pattern.bodies();
    let count = bodies.iter().max().map_or(0, |it| it + 1);
    let mut areas = vec![0.0; count];
    bodies.iter().zip(&pattern.patches).for_each(|(&body, patch)| areas[body] += polygon::area(patch));
    let mut order: Vec<usize> = (0..count).collect();
    order.sort_by(|&a, &b| areas[b].total_cmp(&areas[a]).then(a.cmp(&b)));
    let mut rank = vec![0; count];
    order.iter().enumerate().for_each(|(k, &body)| rank[body] = k);
    bodies.into_iter().map(|it| rank[it]).collect()
}

/// The piece of every face of the flat mesh of the paper, and how many there are.
pub fn pieces(pattern: &CreasePattern, mesh: &TriMesh) -> (Vec<usize>, usize) {
    let of_patch = pieces_of_patches(pattern);
    let far = pattern.bounds().size().norm();
    let piece = |f| {
        let middle: Vec3 = mesh.face_positions(f).iter().sum::<Vec3>() / 3.0;
        nearest_patch(pattern, middle.xy(), far).map_or(0, |it| of_patch[it.0])
    };
    (mesh.faces().map(piece).collect(), of_patch.iter().max().map_or(0, |it| it + 1))
}

/// The patch that a point lies in, or that it lies nearest to within `tolerance`, with the point moved onto it.
pub(super) fn nearest_patch(pattern: &CreasePattern, p: Vec2, tolerance: f64) -> Option<(usize, Vec2)> {
    if let Some(patch) = pattern.patch_at(p) {
        return Some((patch, p));
    }
    let mut best: Option<(f64, usize, Vec2)> = None;
    for (patch, contours) in pattern.patches.iter().enumerate() {
        for contour in contours {
            for (k, &a) in contour.iter().enumerate() {
                let q = nearest_on_segment(p, a, contour[(k + 1) % contour.len()]);
                let distance = (q - p).norm();
                if distance <= tolerance && best.is_none_or(|it| distance < it.0) {
                    best = Some((distance, patch, q));
                }
            }
        }
    }
    best.map(|it| (it.1, it.2))
}
