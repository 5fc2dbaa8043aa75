//! Rulings drawn on parts, at a spacing of their own: lines to bend or roll along.
use crate::{
    geom::{
        Box2, Vec2,
        polygon::segment_distance,
        segment_tree::{Segment, SegmentTree},
    },
    mesh::Id,
    model::{CutMesh, Mark, Operation, Parts, PieceId, Ruling, Strips},
};

/// Lines end this far from the outline, mm, so that a score does not tear the edge.
const SETBACK: f64 = 0.3;
/// Lines keep this far from lettering and other marks, mm …
const APART: f64 = 1.0;
/// … and are looked at in steps of this, mm.
const STEP: f64 = 0.5;
/// Shorter lines are left out, mm.
const SHORTEST: f64 = 3.0;

/// How rulings are drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Style {
    /// Scores, mountain or valley by how they bend, instead of engraved lines.
    pub(super) score: bool,
    /// The middle of each is at least this far from those already drawn, mm; the longest choose first.
    pub(super) spacing: f64,
    /// Those bent by this or more are drawn as folds already, radians.
    pub(super) fold_angle: f64,
}

/// Adds rulings to the parts, interrupted where lettering and other marks are.
pub(super) fn draw(parts: &mut Parts, cut: &CutMesh, strips: &Strips, style: &Style) {
    for (index, piece) in cut.pieces.iter().enumerate() {
        let id = PieceId::new(index);
        // Rulings lie where the flattening has them, not where flanges came to lie.
        let moved = parts.bends.iter().any(|it| it.corrected && it.part == piece.name);
        let Some(part) = parts.parts.iter_mut().find(|it| it.name == piece.name && !moved) else { continue };
        let marks: Vec<Vec<Vec2>> = part.marks.iter().map(|it| it.points.clone()).collect();
        let taken = SegmentTree::of_polylines(&marks);
        let rulings = strips.rulings.iter().filter(|it| it.piece == id && it.bend.abs() < style.fold_angle);
        for (ruling, [a, b]) in spaced(strips, rulings, style.spacing) {
            let operation = match (style.score, ruling.bend > 0.0) {
                (false, _) => Operation::Engrave,
                (true, true) => Operation::ScoreMountain,
                (true, false) => Operation::ScoreValley,
            };
            for [from, to] in free(a, b, &taken) {
                part.marks.push(Mark { operation, points: vec![from, to], closed: false });
            }
        }
    }
}

/// The rulings that are drawn, with their ends.
fn spaced<'a>(
    strips: &Strips,
    rulings: impl Iterator<Item = &'a Ruling>,
    spacing: f64,
) -> Vec<(&'a Ruling, [Vec2; 2])> {
    let mut lines: Vec<(&Ruling, [Vec2; 2])> = rulings.map(|it| (it, it.ends.map(|c| strips.flat(c)))).collect();
    lines.sort_by(|(_, [a, b]), (_, [c, d])| (d - c).norm().total_cmp(&(b - a).norm()));
    let mut kept: Vec<(&Ruling, [Vec2; 2])> = Vec::new();
    for (ruling, [a, b]) in lines {
        let middle = (a + b) / 2.0;
        if kept.iter().all(|(_, [c, d])| segment_distance(middle, middle, *c, *d) >= spacing) {
            kept.push((ruling, [a, b]));
        }
    }
    kept
}

/// The parts of a line that are clear of other marks, and of the outline at its ends.
fn free(a: Vec2, b: Vec2, taken: &SegmentTree) -> Vec<[Vec2; 2]> {
    let length = (b - a).norm();
    let steps = ((length - 2.0 * SETBACK) / STEP).floor();
    if steps < 1.0 {
        return vec![];
    }
    let at = |k: usize| a + (b - a) * ((SETBACK + (length - 2.0 * SETBACK) * k as f64 / steps) / length);
    let clear = |p: Vec2| {
        let apart = |s: &Segment| segment_distance(s.a, s.b, p, p) >= APART;
        taken.visit(&Box2::of([&p]).grown(APART), &mut |s| apart(s))
    };
    let flags: Vec<bool> = (0..=steps as usize).map(|k| clear(at(k))).collect();
    let mut out = Vec::new();
    let mut start = 0;
    for run in flags.chunk_by(|x, y| x == y) {
        let [from, to] = [at(start), at(start + run.len() - 1)];
        if run[0] && (to - from).norm() >= SHORTEST {
            out.push([from, to]);
        }
        start += run.len();
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_stop_before_other_marks() {
        let letter = vec![Vec2::new(20.0, -5.0), Vec2::new(20.0, 5.0)];
        let taken = SegmentTree::of_polylines(&[letter]);
        let found = free(Vec2::zeros(), Vec2::new(40.0, 0.0), &taken);
        assert_eq!(found.len(), 2, "{found:?}");
        for ([from, to], [x, y]) in found.iter().zip([[0.3, 19.0], [21.0, 39.7]]) {
            assert!((from.x - x).abs() < STEP && (to.x - y).abs() < STEP, "{found:?}");
            assert!(to.x <= 19.0 || from.x >= 21.0, "{found:?}");
        }
        assert!(free(Vec2::zeros(), Vec2::new(2.0, 0.0), &taken).is_empty());
    }
}
