//! Numbers that find no room beside their seam: anywhere in the part, at the end of a line that leads to the seam.
use std::{
    cmp::Reverse,
    collections::{BTreeMap, BTreeSet, BinaryHeap},
};

use super::{
    lettering::{Placer, TextBox, clearance},
    seams::Measured,
};
use crate::{
    geom::{
        Box2, Vec2,
        polygon::{contains, segment_distance, turned},
        polyline_length,
        stroke_font::letter,
    },
    model::{Mark, Operation},
};

/// Places on a seam where a leader may begin, as shares of its length.
const STARTS: [f64; 7] = [0.5, 0.35, 0.65, 0.2, 0.8, 0.1, 0.9];
/// Leaders begin this far inside the outline, mm …
const INSETS: [f64; 2] = [0.3, 0.15];
/// … and keep this far from it and from lettering on their way.
const RIM: f64 = 0.12;
/// Side of the squares in which the way is looked for, mm.
const STEP: f64 = 0.4;
/// Squares looked at before the search is given up, for a number that must stand somewhere and for one that need not: areas of
/// 1600 and 160 mm².
const SQUARES: (usize, usize) = (10_000, 1000);
/// Larger letters may stand this many times as far away as smaller ones, and so many mm more.
const FARTHER: (f64, f64) = (1.5, 3.0);
/// Directions tried for the text at the end.
const DIRECTIONS: usize = 16;
/// The eight squares around one, and the length of the way there in sevenths of a step.
const AROUND: [((i32, i32), u32); 8] =
    [((1, 0), 7), ((0, 1), 7), ((-1, 0), 7), ((0, -1), 7), ((1, 1), 10), ((-1, 1), 10), ((-1, -1), 10), ((1, -1), 10)];

type Square = (i32, i32);

/// What the searches on a part have seen so far.
#[derive(Debug)]
pub(super) struct Search {
    /// Squares that may still be looked at.
    pub(super) left: usize,
    /// Squares at which no text of a size, in steps of 0.01 mm, begins or ends: room does not come back.
    full: BTreeSet<((u32, u32), Square)>,
}

/// Where a way comes from.
#[derive(Clone, Copy)]
enum Before {
    Seam(Vec2),
    Square(Square),
}

impl Search {
    /// On a part of which so many squares may be looked at.
    pub(super) fn new(left: usize) -> Self {
        Self { left, full: BTreeSet::new() }
    }
}

impl Placer<'_> {
    /// Where leaders to a seam may begin, mm inside the part.
    pub(super) fn starts(&self, seam: &Measured, side: usize) -> Vec<Vec2> {
        let place = |share: f64| seam.at(side, share * seam.length(), seam.length() / 4.0);
        let places = STARTS.iter().filter_map(|&share| place(share));
        places
            .flat_map(|(at, inward)| INSETS.map(|it| at + inward * it))
            .filter(|&p| contains(self.contours, p))
            .collect()
    }

    /// Puts a text at the place with room that is nearest to one of `starts` on a way inside the part, and draws the way.
    /// Larger heights come first.
    pub(super) fn leader(&mut self, starts: &[Vec2], text: &str, heights: &[f64], must: bool) -> Option<Vec<Mark>> {
        let found =
            heights.iter().filter_map(|&height| Some((height, self.way(starts, letter(text, height).size, must)?)));
        let length = |way: &[Vec2]| polyline_length(way, false);
        // Large letters are worth some way, but not any.
        let (height, (place, way)) = found.reduce(|large, small| {
            if length(&large.1.1) > FARTHER.0 * length(&small.1.1) + FARTHER.1 { small } else { large }
        })?;
        let mut marks = self.write(text, height, place);
        for leg in way.windows(2) {
            // The line is taken too, as a box without height.
            let half = Vec2::new((leg[1] - leg[0]).norm() / 2.0, 0.0);
            let axis = (leg[1] - leg[0]).try_normalize(1e-9)?;
            self.taken.push(TextBox { center: (leg[0] + leg[1]) / 2.0, axis, half });
        }
        marks.push(Mark { operation: Operation::Registration, points: way, closed: false });
        Some(marks)
    }

    /// The nearest room for a text of a size, and the way there (Dijkstra 1959 on squares, then pulled tight).
    fn way(&self, starts: &[Vec2], size: Vec2, must: bool) -> Option<(TextBox, Vec<Vec2>)> {
        let origin = self.outline.bounds().min;
        let middle = |(i, j): Square| origin + STEP * Vec2::new(f64::from(i), f64::from(j));
        let hundredths = |it: f64| (100.0 * it).round() as u32;
        let key = (hundredths(size.x), hundredths(size.y));
        let mut search = self.search.borrow_mut();
        let mut reached: BTreeMap<Square, (u32, Before)> = BTreeMap::new();
        let mut queue = BinaryHeap::new();
        for &start in starts {
            let near = ((start - origin) / STEP).map(|it| it.round() as i32);
            for (di, dj) in AROUND.iter().map(|it| it.0).chain([(0, 0)]) {
                let square = (near.x + di, near.y + dj);
                let cost = ((middle(square) - start).norm() / STEP * 7.0).round() as u32;
                if self.passes(start, middle(square)) && reached.get(&square).is_none_or(|it| cost < it.0) {
                    reached.insert(square, (cost, Before::Seam(start)));
                    queue.push(Reverse((cost, square)));
                }
            }
        }
        let mut looked_at = 0;
        while let Some(Reverse((cost, square))) = queue.pop() {
            if reached[&square].0 < cost {
                continue;
            }
            looked_at += 1;
            if looked_at > if must { SQUARES.0 } else { SQUARES.1 } || search.left == 0 {
                return None;
            }
            search.left -= 1;
            let here = middle(square);
            let is_new = !search.full.contains(&(key, square));
            if is_new && self.rooms_beyond(here, size).next().is_none() {
                search.full.insert((key, square));
            } else if is_new {
                let mut way = vec![here];
                let mut at = square;
                while let Before::Square(before) = reached[&at].1 {
                    way.push(middle(before));
                    at = before;
                }
                if let Before::Seam(start) = reached[&at].1 {
                    way.push(start);
                }
                way.reverse();
                let way = self.tight(&way);
                let clear = |text: &TextBox| !way.windows(2).any(|leg| text.hits(leg[0], leg[1]));
                if let Some(text) = self.rooms_beyond(here, size).find(clear) {
                    return Some((text, way));
                }
            }
            for ((di, dj), length) in AROUND {
                let next = (square.0 + di, square.1 + dj);
                let cost = cost + length;
                if reached.get(&next).is_none_or(|it| cost < it.0) && self.passes(here, middle(next)) {
                    reached.insert(next, (cost, Before::Square(square)));
                    queue.push(Reverse((cost, next)));
                }
            }
        }
        None
    }

    /// Rooms for a text that begins or ends at a point, the right way up.
    fn rooms_beyond(&self, from: Vec2, size: Vec2) -> impl Iterator<Item = TextBox> {
        let place = move |k: usize| {
            let direction = turned(Vec2::x(), std::f64::consts::TAU * k as f64 / DIRECTIONS as f64);
            let center = from + direction * (size.x / 2.0 + clearance(size.y));
            let axis = if direction.x < -1e-9 { -direction } else { direction };
            TextBox { center, axis, half: size / 2.0 }
        };
        (0..DIRECTIONS).map(place).filter(|it| self.free(it))
    }

    /// Whether a straight line keeps off the outline, the lettering and other leaders; folds and ticks it may cross.
    fn passes(&self, a: Vec2, b: Vec2) -> bool {
        let bounds = Box2::of([&a, &b]).grown(RIM);
        self.outline.visit(&bounds, &mut |s| segment_distance(a, b, s.a, s.b) >= RIM)
            && !self.taken.any(&bounds, |it| it.grown(RIM).hits(a, b))
    }

    /// A way with as few corners as shortcuts leave.
    fn tight(&self, way: &[Vec2]) -> Vec<Vec2> {
        let mut out = vec![way[0]];
        let mut at = 0;
        while at + 1 < way.len() {
            let far = (at + 2..way.len()).rev().find(|&k| self.passes(way[at], way[k]));
            at = far.unwrap_or(at + 1);
            out.push(way[at]);
        }
        out
    }
}
