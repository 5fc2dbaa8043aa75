//! Finding room for lettering inside a part: never over the outline, a fold, a tick or other lettering.
use crate::{
    geom::{
        Box2, Vec2,
        polygon::{contains, least_box_angle, point_segment_distance, turned},
        polyline::ArcLength,
        segment_tree::{Segment, SegmentTree},
        stroke_font::letter,
    },
    model::{Mark, Operation},
};

use super::{leader::Search, seams::Measured};
use std::{cell::RefCell, collections::BTreeMap};

/// Kept free around lettering, as a share of its height and at least this many mm.
const CLEARANCE: (f64, f64) = (0.2, 0.3);
/// Kept free before and after a text against other text, as a share of its height, so that two numbers do not read as one.
const SPACING: f64 = 0.6;
/// Each try is this much smaller than the last.
const SHRINK: f64 = 0.8;
/// Side of the squares that lettering is looked up by, mm.
const CELL: f64 = 5.0;
/// Places tried for a name at each size.
const NAME_PLACES: usize = 60;

/// A rectangle in any direction.
#[derive(Debug, Clone, Copy)]
pub(super) struct TextBox {
    pub(super) center: Vec2,
    /// Unit vector along the line of text.
    pub(super) axis: Vec2,
    /// Half extents along and across.
    pub(super) half: Vec2,
}

impl TextBox {
    fn across(&self) -> Vec2 {
        Vec2::new(-self.axis.y, self.axis.x)
    }

    pub(super) fn grown(&self, by: f64) -> Self {
        Self { half: self.half.add_scalar(by), ..*self }
    }

    pub(super) fn corners(&self) -> [Vec2; 4] {
        let (x, y) = (self.axis * self.half.x, self.across() * self.half.y);
        [-x - y, x - y, x + y, -x + y].map(|it| self.center + it)
    }

    /// Whether a segment has a point in the closed rectangle: it is clipped in the rectangle's frame (Liang and Barsky
    /// 1984).
    pub(super) fn hits(&self, a: Vec2, b: Vec2) -> bool {
        // Most lines are far away.
        if point_segment_distance(self.center, a, b) > self.half.norm() {
            return false;
        }
        let frame = |p: Vec2| Vec2::new((p - self.center).dot(&self.axis), (p - self.center).dot(&self.across()));
        let (p, d) = (frame(a), frame(b) - frame(a));
        let (mut from, mut to) = (0.0_f64, 1.0_f64);
        for axis in 0..2 {
            for (step, room) in [(d[axis], self.half[axis] - p[axis]), (-d[axis], self.half[axis] + p[axis])] {
                if step == 0.0 && room < 0.0 {
                    return false;
                } else if step > 0.0 {
                    to = to.min(room / step);
                } else if step < 0.0 {
                    from = from.max(room / step);
                }
            }
        }
        from <= to
    }

    /// Whether two rectangles share a point: no side of either parts them.
    fn overlaps(&self, other: &Self) -> bool {
        if (other.center - self.center).norm() > self.half.norm() + other.half.norm() {
            return false;
        }
        let apart = |axis: Vec2| {
            let reach = |it: &Self| it.half.x * it.axis.dot(&axis).abs() + it.half.y * it.across().dot(&axis).abs();
            (other.center - self.center).dot(&axis).abs() > reach(self) + reach(other)
        };
        ![self.axis, self.across(), other.axis, other.across()].into_iter().any(apart)
    }
}

/// Lettering of one part.
pub(super) struct Placer<'a> {
    pub(super) contours: &'a [Vec<Vec2>],
    pub(super) outline: SegmentTree,
    /// Outline, folds and ticks.
    lines: SegmentTree,
    /// Lettering and leaders.
    pub(super) taken: Taken,
    /// What leaders have looked at.
    pub(super) search: RefCell<Search>,
}

/// Rectangles that are taken, found by where they are.
#[derive(Debug, Default)]
pub(super) struct Taken {
    boxes: Vec<TextBox>,
    /// Those that touch a square of [`CELL`].
    cells: BTreeMap<(i32, i32), Vec<usize>>,
}

impl Taken {
    fn cells(bounds: &Box2) -> impl Iterator<Item = (i32, i32)> + use<> {
        let [low, high] = [bounds.min, bounds.max].map(|p| (p / CELL).map(|it| it.floor() as i32));
        (low.x..=high.x).flat_map(move |i| (low.y..=high.y).map(move |j| (i, j)))
    }

    pub(super) fn push(&mut self, it: TextBox) {
        for cell in Self::cells(&Box2::of(&it.corners())) {
            self.cells.entry(cell).or_default().push(self.boxes.len());
        }
        self.boxes.push(it);
    }

    /// Whether any that may touch `bounds` has a property.
    pub(super) fn any(&self, bounds: &Box2, is: impl Fn(&TextBox) -> bool) -> bool {
        let near = Self::cells(bounds).filter_map(|it| self.cells.get(&it));
        near.flatten().any(|&k| is(&self.boxes[k]))
    }
}

impl<'a> Placer<'a> {
    /// A part without lettering so far, and how many squares leaders may look at.
    pub(super) fn new(contours: &'a [Vec<Vec2>], marks: &[Mark], squares: usize) -> Self {
        let outline = SegmentTree::of_contours(contours);
        let mut segments = outline.segments().to_vec();
        for (line, mark) in marks.iter().enumerate() {
            let n = mark.points.len();
            let count = if mark.closed { n } else { n - 1 };
            segments.extend((0..count).map(|i| Segment {
                a: mark.points[i],
                b: mark.points[(i + 1) % n],
                line: contours.len() + line,
                index: i,
            }));
        }
        Self {
            contours,
            outline,
            lines: SegmentTree::of_segments(segments),
            taken: Taken::default(),
            search: RefCell::new(Search::new(squares)),
        }
    }

    /// Whether the rectangle lies in the part and nothing lies in it or nearer to it than the clearance.
    pub(super) fn free(&self, text: &TextBox) -> bool {
        let room = text.grown(clearance(2.0 * text.half.y));
        let corners = room.corners();
        self.lines.visit(&Box2::of(&corners), &mut |s| !room.hits(s.a, s.b))
            && contains(self.contours, text.center)
            && !self.taken.any(&Box2::of(&corners), |it| it.overlaps(&room))
    }

    pub(super) fn write(&mut self, text: &str, height: f64, place: TextBox) -> Vec<Mark> {
        let spacing = Vec2::new(SPACING * height, 0.0);
        self.taken.push(TextBox { half: place.half + spacing, ..place });
        let lettering = letter(text, height);
        let corner = place.center - place.axis * place.half.x - place.across() * place.half.y;
        let move_to = |p: &Vec2| corner + place.axis * p.x + place.across() * p.y;
        let mark = |stroke: &Vec<Vec2>| Mark {
            operation: Operation::Text,
            points: stroke.iter().map(move_to).collect(),
            closed: false,
        };
        lettering.strokes.iter().map(mark).collect()
    }

    /// Puts the number of a seam beside its middle, the outline below the text; else further along or further in, else
    /// across, else smaller, else at the end of a leader, which a number that `must` stand somewhere is looked for longer. `None` when there is no room.
    pub(super) fn seam_label(
        &mut self,
        seam: &Measured,
        side: usize,
        text: &str,
        [height, least]: [f64; 2],
        must: bool,
    ) -> Option<Vec<Mark>> {
        let at = |s: f64, reach: f64| seam.at(side, s, reach);
        let beside = self.beside(&at, seam.length(), text, sizes(height, least));
        if beside.is_some() {
            return beside;
        }
        let starts = self.starts(seam, side);
        self.leader(&starts, text, &[height, least], must)
    }

    /// Puts a text beside a bend line, on either side; else at the end of a leader to its middle.
    pub(super) fn bend_label(&mut self, line: &ArcLength, text: &str, height: f64, least: f64) -> Option<Vec<Mark>> {
        let at = |sign: f64| {
            move |s: f64, _: f64| {
                let (p, along) = line.at(s);
                Some((p, sign * Vec2::new(-along.y, along.x)))
            }
        };
        let size = |height: f64| [1.0, -1.0].map(|sign| (height, sign));
        let mut tries = sizes(height, least).into_iter().flat_map(size);
        let beside = tries.find_map(|(height, sign)| self.beside(&at(sign), line.length(), text, vec![height]));
        beside.or_else(|| self.leader(&[line.at(line.length() / 2.0).0], text, &[height, least], true))
    }

    /// Puts a text beside the middle of a line, else further along or further away, else across, else smaller. `at` gives
    /// the place at a length, and the direction to the side of the text, taken over a reach.
    fn beside(
        &mut self,
        at: &dyn Fn(f64, f64) -> Option<(Vec2, Vec2)>,
        length: f64,
        text: &str,
        heights: Vec<f64>,
    ) -> Option<Vec<Mark>> {
        for height in heights {
            let size = letter(text, height).size;
            let reach = (size.x / 2.0).min(length / 4.0);
            for depth in [1.01, 1.6, 2.4] {
                for s in outwards(length, height / 2.0) {
                    let Some((at, inward)) = at(s, reach) else { continue };
                    let along = Vec2::new(inward.y, -inward.x);
                    for (axis, deep) in [(along, size.y), (inward, size.x)] {
                        let center = at + inward * (clearance(size.y) * depth + deep / 2.0);
                        let place = TextBox { center, axis, half: size / 2.0 };
                        if self.free(&place) {
                            return Some(self.write(text, height, place));
                        }
                    }
                }
            }
        }
        None
    }

    /// Puts the name where the part has most room, along its longer side where that fits.
    pub(super) fn name(&mut self, name: &str, height: f64, least: f64) -> Option<Vec<Mark>> {
        let long = -least_box_angle(&self.contours[0]);
        let axes = [0.0, 0.5, 0.25, -0.25].map(|turn| turned(Vec2::x(), long + turn * std::f64::consts::PI));
        let places = self.roomy_places();
        for height in sizes(height, least) {
            let size = letter(name, height).size;
            for &center in &places {
                for axis in axes {
                    // The right way up for someone who looks along +y of the part's frame.
                    let axis = if axis.x < -1e-9 { -axis } else { axis };
                    let place = TextBox { center, axis, half: size / 2.0 };
                    if self.free(&place) {
                        return Some(self.write(name, height, place));
                    }
                }
            }
        }
        None
    }

    /// Points of a grid over the part, those with most room around them first.
    fn roomy_places(&self) -> Vec<Vec2> {
        let bounds = self.outline.bounds();
        let step = (bounds.size().x.max(bounds.size().y) / 48.0).max(0.25);
        let count = |extent: f64| (extent / step).ceil() as usize;
        let mut places: Vec<(f64, Vec2)> = Vec::new();
        for j in 0..count(bounds.size().y) {
            for i in 0..count(bounds.size().x) {
                let p = bounds.min + Vec2::new(i as f64 + 0.5, j as f64 + 0.5) * step;
                if contains(self.contours, p)
                    && let Some((_, near)) = self.lines.nearest(p)
                {
                    let text = self.taken.boxes.iter().map(|it| (it.center - p).norm() - it.half.norm());
                    places.push((text.fold((near - p).norm(), f64::min), p));
                }
            }
        }
        places.sort_by(|a, b| b.0.total_cmp(&a.0));
        places.truncate(NAME_PLACES);
        places.into_iter().map(|it| it.1).collect()
    }
}

pub(super) fn clearance(height: f64) -> f64 {
    (CLEARANCE.0 * height).max(CLEARANCE.1)
}

/// Heights to try, from `height` down to `least`.
fn sizes(height: f64, least: f64) -> Vec<f64> {
    let mut sizes = vec![height];
    while sizes[sizes.len() - 1] > least {
        sizes.push((sizes[sizes.len() - 1] * SHRINK).max(least));
    }
    sizes
}

/// Places along a line from its middle outwards.
fn outwards(length: f64, step: f64) -> impl Iterator<Item = f64> {
    let count = (length / 2.0 / step) as usize;
    (0..=count).flat_map(move |k| {
        let shift = k as f64 * step;
        [Some(length / 2.0 + shift), (k > 0).then_some(length / 2.0 - shift)].into_iter().flatten()
    })
}
