//! Finished parts looked at once more, by their lines alone: does any lettering leave its part or cross a fold, and would a
//! machine run along any line twice?
use crate::{
    geom::{
        Box2, Vec2,
        polygon::{contains, segments_meet},
        segment_tree::{Segment, SegmentTree},
    },
    model::{Mark, Operation, Part},
};

/// Lines nearer than this lie on each other, mm …
const SAME: f64 = 1e-3;
/// … where they do so for longer than this, mm: crossings and common ends are no harm.
const LONG: f64 = 0.1;

/// Letters and match marks that leave their part, and letters that cross a fold, one sentence each.
pub(super) fn astray(part: &Part) -> Vec<String> {
    let outline = SegmentTree::of_contours(&part.contours);
    let folds: Vec<Vec<Vec2>> = part.marks.iter().filter(|it| it.operation.is_score()).map(open).collect();
    let folds = SegmentTree::of_polylines(&folds);
    let mut found = Vec::new();
    for mark in part.marks.iter().filter(|it| matches!(it.operation, Operation::Text | Operation::Registration)) {
        let is_text = mark.operation == Operation::Text;
        let what = if is_text { "a letter" } else { "a match mark" };
        let line = open(mark);
        let apart = |tree: &SegmentTree| {
            let off = |leg: &[Vec2]| tree.visit(&Box2::of(leg), &mut |s| !segments_meet(leg[0], leg[1], s.a, s.b));
            line.windows(2).all(off)
        };
        let mut say = |fault: &str| {
            found.push(format!("{what} of part {} at ({:.1}, {:.1}) {fault}", part.name, line[0].x, line[0].y));
        };
        if !contains(&part.contours, line[0]) || !apart(&outline) {
            say("leaves it");
        }
        if is_text && !apart(&folds) {
            say("crosses a fold");
        }
    }
    found
}

/// Places where two lines of a part lie on each other, one sentence each.
pub(super) fn doubled(part: &Part) -> Vec<String> {
    let lines: Vec<(Operation, Vec<Vec2>)> = part
        .lines()
        .map(|it| (it.operation, it.points.iter().chain(it.points.first().filter(|_| it.closed)).copied().collect()))
        .collect();
    let points: Vec<Vec<Vec2>> = lines.iter().map(|it| it.1.clone()).collect();
    let tree = SegmentTree::of_polylines(&points);
    let mut found = Vec::new();
    for &s in tree.segments() {
        tree.visit(&Box2::of([&s.a, &s.b]).grown(SAME), &mut |&t| {
            if (s.line, s.index) < (t.line, t.index) && common(&s, &t) > LONG {
                let [a, b] = [s, t].map(|it| lines[it.line].0.name());
                found.push(format!("{a} and {b} on part {} at ({:.1}, {:.1})", part.name, s.a.x, s.a.y));
            }
            true
        });
    }
    found.sort();
    found
}

/// Points of a mark, the first once more at the end where it is closed.
fn open(mark: &Mark) -> Vec<Vec2> {
    mark.points.iter().chain(mark.points.first().filter(|_| mark.closed)).copied().collect()
}

/// For how long two segments lie on each other, mm.
fn common(s: &Segment, t: &Segment) -> f64 {
    let along = s.b - s.a;
    let Some(direction) = along.try_normalize(1e-12) else { return 0.0 };
    let place = |p: Vec2| (p - s.a).dot(&direction);
    let off = |p: Vec2| (p - s.a - direction * place(p)).norm();
    let [mut from, mut to] = [t.a, t.b];
    if place(from) > place(to) {
        (from, to) = (to, from);
    }
    let span = place(to) - place(from);
    if !(span > 0.0) {
        return 0.0;
    }
    let (low, high) = (place(from).max(0.0), place(to).min(along.norm()));
    let at = |x: f64| from + (to - from) * ((x - place(from)) / span);
    if high > low && off(at(low)) < SAME && off(at(high)) < SAME { high - low } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mark(operation: Operation, points: &[[f64; 2]]) -> Mark {
        Mark { operation, points: points.iter().map(|&it| it.into()).collect(), closed: false }
    }

    fn square(marks: Vec<Mark>) -> Part {
        let contour = [[0., 0.], [30., 0.], [30., 30.], [0., 30.]].map(Vec2::from).to_vec();
        Part { name: "A".into(), contours: vec![contour], marks }
    }

    #[test]
    fn lettering_that_leaves_its_part_or_crosses_a_fold_is_named() {
        use Operation::{ScoreValley, Text};
        let fold = mark(ScoreValley, &[[10., 1.], [10., 29.]]);
        let good = square(vec![fold.clone(), mark(Text, &[[12., 5.], [15., 9.]])]);
        assert!(astray(&good).is_empty());
        for (points, word) in [
            ([[28., 5.], [31., 5.]], "leaves"),
            ([[40., 5.], [41., 5.]], "leaves"),
            ([[29., 29.], [30., 30.]], "leaves"),
            ([[8., 5.], [12., 5.]], "fold"),
        ] {
            let found = astray(&square(vec![fold.clone(), mark(Text, &points)]));
            assert!(found.len() == 1 && found[0].contains(word), "{found:?}");
        }
        assert!(astray(&square(vec![fold, mark(Operation::Registration, &[[8., 5.], [12., 5.]])])).is_empty());
    }

    #[test]
    fn lines_on_each_other_are_named_and_crossing_ones_are_not() {
        use Operation::{Engrave, ScoreMountain, Sew};
        let line = mark(ScoreMountain, &[[5., 5.], [25., 5.]]);
        let other = |points: &[[f64; 2]]| doubled(&square(vec![line.clone(), mark(Engrave, points)])).len();
        assert_eq!(other(&[[25., 5.], [5., 5.]]), 1);
        assert_eq!(other(&[[8., 5.0005], [9., 5.], [20., 9.]]), 1);
        assert_eq!(other(&[[25., 5.], [29., 5.]]), 0);
        assert_eq!(other(&[[8., 2.], [8., 9.]]), 0);
        assert_eq!(other(&[[5., 5.1], [25., 5.1]]), 0);
        assert_eq!(other(&[[5., 5.], [25., 6.]]), 0);
        assert_eq!(doubled(&square(vec![mark(Sew, &[[0., 10.], [0., 2.]])])).len(), 1);
    }
}
