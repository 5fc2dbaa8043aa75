//! What a board did, held against the layout of the sheet: the strokes of its head, or of the blade that they drag.
use fabricate::{geom::Vec2, import::Drawing, profile::Machine};

use crate::strokes::{expected, segment_distance};

/// Samples of lines, mm.
const SAMPLE: f64 = 0.2;
/// Steps of the axis that drags a blade, mm.
const DRAG: f64 = 0.01;

/// How far what was done is from the layout, mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Fit {
    /// Farthest that the tool touched beside the layout.
    pub(crate) beside: f64,
    /// Farthest that a place of the layout, each corner among them, was missed.
    pub(crate) missed: f64,
    pub(crate) strokes: usize,
    pub(crate) length: f64,
}

/// The tip of a blade that trails behind its axis: it moves along the line towards the axis, in small steps. `behind` is
/// where it lies from the axis, and stays so from one stroke to the next.
fn drag(axis: &[Vec2], offset: f64, behind: &mut Vec2) -> Vec<Vec2> {
    let mut tips = vec![axis[0] + *behind];
    for leg in axis.windows(2) {
        let steps = ((leg[1] - leg[0]).norm() / DRAG).ceil().max(1.0);
        for k in 1..=steps as usize {
            let at = leg[0] + (leg[1] - leg[0]) * (k as f64 / steps);
            let towards = at - tips[tips.len() - 1];
            *behind = -towards.normalize() * offset;
            tips.push(at + *behind);
        }
    }
    tips
}

fn sampled(lines: &[Vec<Vec2>]) -> impl Iterator<Item = Vec2> + '_ {
    lines.iter().flat_map(|it| it.windows(2)).flat_map(|leg| {
        let steps = ((leg[1] - leg[0]).norm() / SAMPLE).ceil().max(1.0) as usize;
        (0..=steps).map(move |k| leg[0] + (leg[1] - leg[0]) * (k as f64 / steps as f64))
    })
}

/// Largest distance of points of some lines from other lines.
fn apart(from: &[Vec<Vec2>], to: &[Vec<Vec2>]) -> f64 {
    // Sorted by x, so that only what lies near is looked at.
    let mut legs: Vec<[Vec2; 2]> = to.iter().flat_map(|it| it.windows(2)).map(|it| [it[0], it[1]]).collect();
    let left = |it: &[Vec2; 2]| it[0].x.min(it[1].x);
    legs.sort_by(|a, b| left(a).total_cmp(&left(b)));
    let widest = legs.iter().map(|it| (it[1].x - it[0].x).abs()).fold(0.0, f64::max);
    sampled(from)
        .map(|p| {
            let mut nearest = f64::INFINITY;
            let mut reach = 1.0;
            while nearest > reach && reach < 1e4 {
                reach *= 4.0;
                let first = legs.partition_point(|it| left(it) < p.x - reach - widest);
                let near = legs[first..].iter().take_while(|it| left(it) <= p.x + reach);
                let distance = |it: &[Vec2; 2]| segment_distance(p.into(), it[0].into(), it[1].into());
                nearest = near.map(distance).fold(nearest, f64::min);
            }
            nearest
        })
        .fold(0.0, f64::max)
}

/// Holds what a board touched (work coordinates) against all lines of its sheet but the one to check its scale by, which no
/// machine draws. With a blade, what is cut by it (after the pause for it) is what its tip does; its first stroke only
/// turns it in the margin.
pub(crate) fn compare(program: &str, touched: &[Vec<[f64; 2]>], sheet: &Drawing, machine: &Machine) -> Fit {
    let size = sheet.size.unwrap();
    let place = |p: &[f64; 2]| machine.from_work(Vec2::from(*p), size);
    let mut done: Vec<Vec<Vec2>> = touched.iter().map(|it| it.iter().map(place).collect()).collect();
    let meant: Vec<Vec<Vec2>> = sheet
        .lines
        .iter()
        .filter(|it| !it.layer.eq_ignore_ascii_case("check"))
        .map(|it| it.points.iter().chain(it.closed.then(|| &it.points[0])).copied().collect())
        .collect();
    if let Some(knife) = machine.knife.filter(|it| it.offset.mm > 0.0) {
        let by_pen = program.split_once("\nM0\n").map_or(0, |it| expected(it.0, machine).len());
        // However it was put in.
        let mut behind = Vec2::new(0.6, -0.8) * knife.offset.mm;
        for axis in &mut done[by_pen..] {
            *axis = drag(axis, knife.offset.mm, &mut behind);
        }
        done.remove(by_pen);
    }
    let length = done.iter().flat_map(|it| it.windows(2)).map(|it| (it[1] - it[0]).norm()).sum();
    Fit { beside: apart(&done, &meant), missed: apart(&meant, &done), strokes: done.len(), length }
}
