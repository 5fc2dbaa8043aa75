//! Stripes drawn on the pieces: engraved lines.
use crate::{
    geom::Vec2,
    mesh::FaceId,
    model::{CutMesh, Flattening, Mark, Operation, Parts, Stripes},
};

/// Points of a line nearer than this are one, mm: a tenth of what a machine resolves.
const MERGE: f64 = 0.005;

/// Engraves every line on the pieces that it crosses; it is broken where it goes from one to the next.
pub(super) fn draw(parts: &mut Parts, cut: &CutMesh, flat: &Flattening, stripes: &Stripes) {
    let place = |f: FaceId, weights: [f64; 3]| {
        let corners = cut.mesh.face_vertices(f).map(|v| flat.uv[v]);
        corners[0] * weights[0] + corners[1] * weights[1] + corners[2] * weights[2]
    };
    for line in &stripes.lines {
        // Runs of one piece in which each bit goes on where the one before ended.
        let mut runs: Vec<(usize, Vec<Vec2>)> = Vec::new();
        for &(f, ends) in &line.pieces {
            let piece = cut.piece_of[f].0 as usize;
            let [from, to] = ends.map(|weights| place(f, weights));
            let apart = |p: Vec2, q: Vec2| (p - q).norm() >= MERGE;
            match runs.last_mut().filter(|(last, points)| *last == piece && !apart(points[points.len() - 1], from)) {
                Some((_, points)) => points.extend(apart(points[points.len() - 1], to).then_some(to)),
                None if apart(from, to) => runs.push((piece, vec![from, to])),
                None => {}
            }
        }
        for (piece, mut points) in runs {
            let name = &cut.pieces.as_slice()[piece].name;
            // Lines lie where the flattening has them, not where flanges came to lie.
            let moved = parts.bends.iter().any(|it| it.corrected && it.part == *name);
            let Some(part) = parts.parts.iter_mut().find(|it| it.name == *name && !moved) else { continue };
            let closed = points.len() > 3 && (points[0] - points[points.len() - 1]).norm() < MERGE;
            if closed {
                points.pop();
            }
            part.marks.push(Mark { operation: Operation::Engrave, points, closed });
        }
    }
}
