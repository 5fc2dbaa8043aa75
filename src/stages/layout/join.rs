//! What joins pieces along their seams: glue tabs, rivets, allowance for sewing, holes for lacing.
//!
//! Everything is worked out on the outlines as they were flattened and added to them afterwards, so that the order of the
//! pieces does not matter to a seam: whatever one side carries fits the other side.
use std::collections::BTreeMap;

use super::{
    allowance,
    outline::{CRUMB, clean, near_edges},
    seams::Measured,
    tabs::{self, Tab},
};
use crate::{
    geom::{
        Vec2, boolean,
        outline::check_outline,
        polygon::{area, contains},
        polyline::ArcLength,
        segment_tree::SegmentTree,
        signed_area,
    },
    model::{Joints, Mark, Operation, PieceId},
    numeric::{Cancelled, Monitor},
};

/// How pieces are joined; lengths in mm, angles in radians.
#[derive(Debug, Clone, PartialEq)]
pub enum Join {
    /// Edge to edge, with tape or glue.
    Butt,
    /// Flaps that go under the other side.
    Tabs(Tabs),
    /// Material of this width outside the seam on both sides, to be sewn along the seam.
    Allowance(f64),
    /// Holes along both sides that come to lie side by side.
    Holes(Holes),
}

/// Flaps along seams.
#[derive(Debug, Clone, PartialEq)]
pub struct Tabs {
    /// How far they stand out.
    pub width: f64,
    /// Angle between their flanks and the seam.
    pub angle: f64,
    /// Longest stretch of a seam that one tab takes.
    pub length: f64,
    /// Which sides carry them.
    pub sides: Sides,
    /// What holds them.
    pub hold: Hold,
}

/// What holds flaps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Hold {
    /// They are folded and glued under the other side.
    Glue,
    /// A rivet through the middle of each and through the other side, with holes of this diameter.
    Rivet(f64),
    /// They are fingers that stand in notches of the other side, of a sheet of this thickness.
    Finger(f64),
}

/// Which sides of a seam carry tabs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sides {
    /// The first side where it has room, else the second.
    One,
    /// In turn.
    Alternating,
    /// Both.
    Both,
}

/// Holes along seams.
#[derive(Debug, Clone, PartialEq)]
pub struct Holes {
    /// Diameter.
    pub diameter: f64,
    /// Distance of their middle from the edge.
    pub inset: f64,
    /// Distance from one to the next along the seam, about.
    pub pitch: f64,
}

/// A piece on its way to become a part.
pub(super) struct Body {
    pub(super) name: String,
    pub(super) contours: Vec<Vec<Vec2>>,
    pub(super) marks: Vec<Mark>,
}

/// Corners of the polygon that stands for a round hole.
const CORNERS: usize = 24;
/// Material that stays around a hole, as a share of its diameter.
pub(super) const WEB: f64 = 0.5;
/// Steps along the base of a tab in which its hinge is looked for, the least length of a hinge that is worth a fold, and its
/// distance from the outline, mm.
const HINGE_STEP: f64 = 0.1;
const SHORTEST_HINGE: f64 = 1.0;
const SETBACK: f64 = 0.3;
/// Tabs grow by this much, mm: the outline was cleaned and may lie a little inside the seam, and both must become one.
const ROOT: f64 = 0.05;

/// Adds to the bodies what joins them.
pub(super) fn join(
    bodies: &mut BTreeMap<PieceId, Body>,
    seams: &[Measured],
    join: &Join,
    merge: f64,
    monitor: &Monitor,
) -> Result<Joints, Cancelled> {
    let mut joints = Joints::default();
    match join {
        Join::Butt => {}
        Join::Tabs(options) => {
            let made = tabs::make(bodies, seams, options, monitor)?;
            joints.collisions = made.collisions(bodies);
            joints.narrowed = made.narrowed;
            joints.missing = made.missing;
            let mut rivets: Vec<(PieceId, Vec2)> = Vec::new();
            let mut held: BTreeMap<String, bool> = BTreeMap::new();
            for (piece, tabs) in made.tabs {
                for tab in tabs {
                    monitor.check()?;
                    let added = add_tab(bodies, piece, &tab, options, merge);
                    if let Some(seam) = &tab.seam {
                        *held.entry(seam.clone()).or_default() |= added;
                    }
                    if added {
                        joints.tabs += 1;
                        let (under, motion) = tab.under;
                        rivets.extend(tab.rivet.into_iter().flat_map(|it| [(piece, it), (under, motion.go(it))]));
                    }
                }
            }
            if matches!(options.hold, Hold::Finger(_)) {
                for body in bodies.values_mut() {
                    body.marks = body.marks.drain(..).filter_map(|it| inside(it, &body.contours)).collect();
                }
            }
            joints.missing.extend(held.into_iter().filter(|it| !it.1).map(|it| it.0));
            joints.holes += rivets.len();
            for (piece, center) in rivets {
                if let (Hold::Rivet(diameter), Some(body)) = (options.hold, bodies.get_mut(&piece)) {
                    body.contours.push(circle(center, diameter));
                }
            }
        }
        Join::Allowance(width) => {
            for (piece, body) in bodies.iter_mut() {
                monitor.check()?;
                allowance::add(body, *piece, seams, *width, merge, &mut joints);
            }
        }
        Join::Holes(options) => {
            let mut holes: BTreeMap<PieceId, Vec<Vec2>> = BTreeMap::new();
            for seam in seams {
                monitor.check()?;
                add_holes(bodies, seam, options, &mut holes, &mut joints.missing);
            }
            for (piece, centers) in holes {
                joints.holes += centers.len();
                let round = centers.into_iter().map(|it| circle(it, options.diameter));
                bodies.entry(piece).and_modify(|body| body.contours.extend(round));
            }
        }
    }
    Ok(joints)
}

/// A round hole, clockwise.
pub(super) fn circle(center: Vec2, diameter: f64) -> Vec<Vec2> {
    let turn = |k: usize| -std::f64::consts::TAU * k as f64 / CORNERS as f64;
    (0..CORNERS).map(|k| center + diameter / 2.0 * Vec2::new(turn(k).cos(), turn(k).sin())).collect()
}

/// Whether a round hole has its web of material all around.
pub(super) fn room_for_hole(contours: &[Vec<Vec2>], center: Vec2, diameter: f64) -> bool {
    let needed = diameter * (0.5 + WEB);
    let near = SegmentTree::of_contours(contours).nearest(center);
    contains(contours, center) && near.is_some_and(|it| (it.1 - center).norm() >= needed)
}

/// Joins a tab to its piece, with a fold where it begins, or a finger, with its notch in the other piece. `false` when an
/// outline would not be one any more.
fn add_tab(bodies: &mut BTreeMap<PieceId, Body>, piece: PieceId, tab: &Tab, options: &Tabs, merge: f64) -> bool {
    let rooted = |it: &Vec<Vec2>| -> Vec<Vec<Vec2>> {
        boolean::offset(std::slice::from_ref(it), ROOT).into_iter().flatten().collect()
    };
    let under = tab.under.0;
    let before = bodies.get(&under).map(|it| it.contours.clone());
    if let Some(other) = bodies.get_mut(&under).filter(|_| !tab.notch.is_empty()) {
        let left = boolean::difference(&other.contours, &rooted(&tab.notch));
        let whole = left.iter().filter(|it| area(it) > CRUMB).count() == 1;
        match trimmed(left, merge) {
            Some(contours) if whole && contours.len() == other.contours.len() => other.contours = contours,
            _ => return false,
        }
    }
    let Some(body) = bodies.get_mut(&piece) else { return false };
    let bare = area(&body.contours);
    match trimmed(boolean::union(&body.contours, &rooted(&tab.outline)), merge) {
        // A tab must not close the mouth of a slit or a bay, and must hang on the piece: where its seam ends in a corner that was
        // cut away between bends it does not.
        Some(contours)
            if contours.len() == body.contours.len() && area(&contours) > bare + 0.5 * signed_area(&tab.outline) =>
        {
            body.contours = contours;
        }
        _ => {
            bodies.entry(under).and_modify(|it| it.contours = before.unwrap_or_default());
            return false;
        }
    }
    if matches!(options.hold, Hold::Finger(_)) {
        return true;
    }
    if let Some(points) = hinge(&tab.base, &body.contours) {
        // A lap of metal is riveted as flat as the surface; only its edge is marked, not bent.
        let operation = if options.hold == Hold::Glue { Operation::ScoreMountain } else { Operation::Engrave };
        body.marks.push(Mark { operation, points, closed: false });
    }
    true
}

/// What of a mark is left when the outline has come nearer: the longest stretch inside it. Closed lines and those to sew along
/// stay as they are.
pub(super) fn inside(mark: Mark, contours: &[Vec<Vec2>]) -> Option<Mark> {
    if mark.closed || mark.operation == Operation::Sew {
        return Some(mark);
    }
    hinge(&mark.points, contours).map(|points| Mark { points, ..mark })
}

/// The longest stretch of a line that lies inside the outline: of a tab's base it is where the tab hangs on its piece; after
/// trimming that may be less than the whole.
fn hinge(base: &[Vec2], contours: &[Vec<Vec2>]) -> Option<Vec<Vec2>> {
    let line = ArcLength::new(base.to_vec())?;
    let outline = SegmentTree::of_contours(contours);
    let inside = |s: f64| {
        let p = line.at(s).0;
        contains(contours, p) && outline.nearest(p).is_some_and(|it| (it.1 - p).norm() >= SETBACK)
    };
    let count = (line.length() / HINGE_STEP).ceil() as usize;
    let at = |k: usize| line.length() * k as f64 / count as f64;
    let (mut best, mut first) = ((0, 0), None);
    for k in 0..=count {
        if inside(at(k)) {
            let from = *first.get_or_insert(k);
            best = if k - from > best.1 - best.0 { (from, k) } else { best };
        } else {
            first = None;
        }
    }
    let (from, to) = (at(best.0), at(best.1));
    if to - from < SHORTEST_HINGE {
        return None;
    }
    Some(line.stretch(from, to))
}

/// The largest of some regions as an outline that can be cut; `None` where it cannot be one.
pub(super) fn trimmed(regions: Vec<boolean::Region>, merge: f64) -> Option<Vec<Vec<Vec2>>> {
    let region = regions.into_iter().max_by(|a, b| area(a).total_cmp(&area(b)))?;
    let kept = region.into_iter().filter(|it| signed_area(it).abs() > CRUMB);
    let contours: Vec<Vec<Vec2>> = kept.map(|it| clean(&it, &vec![false; it.len()], merge)).collect();
    // What touches itself in the coordinates of a file cannot be cut either.
    (check_outline(&contours).is_ok() && near_edges(&contours, merge).is_empty()).then_some(contours)
}

/// Adds the holes of a seam where both sides have room for them.
fn add_holes(
    bodies: &BTreeMap<PieceId, Body>,
    seam: &Measured,
    options: &Holes,
    holes: &mut BTreeMap<PieceId, Vec<Vec2>>,
    missing: &mut Vec<String>,
) {
    let count = (seam.length() / options.pitch).round().max(1.0) as usize;
    let mut made = 0;
    for k in 0..count {
        let s = seam.length() * (k as f64 + 0.5) / count as f64;
        let place = |side: usize| {
            let (at, inward) = seam.at(side, s, options.pitch / 2.0)?;
            let (piece, center) = (seam.sides[side].piece, at + inward * options.inset);
            let apart = |it: &Vec2| (it - center).norm() >= options.diameter * (1.0 + WEB);
            let free = holes.get(&piece).is_none_or(|it| it.iter().all(apart));
            let body = bodies.get(&piece)?;
            (free && room_for_hole(&body.contours, center, options.diameter)).then_some((piece, center))
        };
        if let (Some(a), Some(b)) = (place(0), place(1))
            && (a.0 != b.0 || (a.1 - b.1).norm() >= options.diameter * (1.0 + WEB))
        {
            for (piece, center) in [a, b] {
                holes.entry(piece).or_default().push(center);
            }
            made += 1;
        }
    }
    if made == 0 && !seam.is_slit() {
        missing.push(format!("seam {} ({:.1} mm)", seam.label, seam.length()));
    }
}
