//! Glue tabs: trapezoids along seams, trimmed until they cross neither their own piece, nor another tab, nor stick out of
//! the piece that they go under.
use std::collections::BTreeMap;

use super::{
    join::{Body, Hold, Sides, Tabs, WEB, room_for_hole},
    seams::Measured,
};
use crate::{
    geom::{
        Box2, Vec2, boolean, cross2,
        polygon::{area, point_segment_distance},
        signed_area,
    },
    model::PieceId,
    numeric::{Cancelled, Monitor},
};

/// Kept free between a tab and its own piece or another tab, mm.
const CLEAR: f64 = 0.4;
/// Tabs lower than this are not made: no finger holds them, mm.
const LOWEST: f64 = 1.5;
/// The same for fingers, which go into a notch, mm.
const LOWEST_FINGER: f64 = 0.3;
/// Rounding that a tab may lose of its height, as a share.
const LEAST_LOSS: f64 = 1e-6;
/// Sheets that meet at less than this angle from one plane interlock as in one plane, radians.
const GENTLE: f64 = std::f64::consts::FRAC_PI_4;
/// Stretches shorter than this carry no tab, mm: they could not be folded.
const SHORTEST: f64 = 4.0;
/// The far side of a tab is at least this share of its base.
const TOP: f64 = 0.25;
/// A tab of which less than this share is left after trimming is not made.
const LEFT: f64 = 0.4;
/// Room around a tab within which it can meet anything, mm: more than a seam bows between the ends of a tab.
const WINDOW: f64 = 10.0;
/// Two shapes that share less than this do not collide, mm².
const TOUCH: f64 = 0.01;

/// A tab in the frame of the piece that carries it.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Tab {
    /// Its seam, in words, unless that is a slit, which may stay open.
    pub(super) seam: Option<String>,
    /// Counter-clockwise.
    pub(super) outline: Vec<Vec2>,
    /// Where it begins: points of the seam.
    pub(super) base: Vec<Vec2>,
    /// Unit vector away from the piece.
    pub(super) outward: Vec2,
    /// The piece that it goes under, and how it comes to lie there.
    pub(super) under: (PieceId, Motion),
    /// Of a finger: what is taken out of that piece, in its frame; else empty.
    pub(super) notch: Vec<Vec2>,
    /// Centre of the hole for its rivet.
    pub(super) rivet: Option<Vec2>,
}

/// Turns by the angle whose cosine and sine are the parts of `turn`, about `from`, and moves to `to`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Motion {
    from: Vec2,
    turn: Vec2,
    to: Vec2,
}

impl Motion {
    /// Takes one chord to another.
    fn between(from: [Vec2; 2], to: [Vec2; 2]) -> Option<Self> {
        let (a, b) = ((from[1] - from[0]).try_normalize(1e-9)?, (to[1] - to[0]).try_normalize(1e-9)?);
        Some(Self { from: from[0], turn: Vec2::new(a.dot(&b), cross2(a, b)), to: to[0] })
    }

    pub(super) fn go(&self, p: Vec2) -> Vec2 {
        let d = p - self.from;
        self.to + Vec2::new(self.turn.x * d.x - self.turn.y * d.y, self.turn.y * d.x + self.turn.x * d.y)
    }

    fn inverse(&self) -> Self {
        Self { from: self.to, turn: Vec2::new(self.turn.x, -self.turn.y), to: self.from }
    }

    fn all(&self, points: &[Vec2]) -> Vec<Vec2> {
        points.iter().map(|&p| self.go(p)).collect()
    }
}

/// All tabs of a job.
#[derive(Default)]
pub(super) struct Made {
    pub(super) tabs: BTreeMap<PieceId, Vec<Tab>>,
    /// Tabs lower than asked because their stretch of the seam is short.
    pub(super) narrowed: usize,
    /// Seams that are no slits and have no tab on either side.
    pub(super) missing: Vec<String>,
    /// What already lies under each piece, in its frame.
    glued: BTreeMap<PieceId, Vec<Vec<Vec2>>>,
    /// Centres of the holes for rivets.
    rivets: BTreeMap<PieceId, Vec<Vec2>>,
}

/// Plans the tabs of all seams, the longest seam first.
pub(super) fn make(
    bodies: &BTreeMap<PieceId, Body>,
    seams: &[Measured],
    options: &Tabs,
    monitor: &Monitor,
) -> Result<Made, Cancelled> {
    let mut made = Made::default();
    let solid: BTreeMap<PieceId, Vec<Vec<Vec2>>> =
        bodies.iter().map(|(&piece, body)| (piece, flat(boolean::offset(&body.contours, CLEAR)))).collect();
    let mut order: Vec<&Measured> = seams.iter().collect();
    order.sort_by(|a, b| b.length().total_cmp(&a.length()).then(a.label.cmp(&b.label)));
    for seam in order {
        let fingers = matches!(options.hold, Hold::Finger(_));
        let count = (seam.length() / options.length).ceil().max(if fingers { 2.0 } else { 1.0 }) as usize;
        let mut any = false;
        for k in 0..count {
            monitor.check()?;
            let stretch = [k, k + 1].map(|it| seam.length() * it as f64 / count as f64);
            let first = if fingers || options.sides == Sides::Alternating { k % 2 } else { 0 };
            for side in [first, 1 - first].into_iter().take(if fingers { 1 } else { 2 }) {
                let Some((tab, narrowed)) = made.tab(bodies, &solid, seam, side, stretch, options) else { continue };
                made.narrowed += usize::from(narrowed);
                made.take(bodies, seam.sides[side].piece, tab, options);
                any = true;
                if options.sides != Sides::Both {
                    break;
                }
            }
        }
        if !any && !seam.is_slit() {
            made.missing.push(named(seam));
        }
    }
    Ok(made)
}

fn named(seam: &Measured) -> String {
    format!("seam {} ({:.1} mm)", seam.label, seam.length())
}

/// The contours of all regions.
pub(super) fn flat(regions: Vec<boolean::Region>) -> Vec<Vec<Vec2>> {
    regions.into_iter().flatten().collect()
}

/// A rectangle with some room around points.
fn window(points: &[Vec2]) -> Vec<Vec2> {
    let Box2 { min, max } = Box2::of(points).grown(WINDOW);
    vec![min, Vec2::new(max.x, min.y), max, Vec2::new(min.x, max.y)]
}

/// What of a region lies in a window: small regions make quick work.
fn clip(contours: &[Vec<Vec2>], window: &[Vec2]) -> Vec<Vec<Vec2>> {
    flat(boolean::intersection(contours, &[window.to_vec()]))
}

/// How far a finger stands out and how deep its notch is, mm, where two sheets of a thickness are turned by an angle against
/// each other and meet in their middle layers.
///
/// Both layers are cut square to the sheet. On the outside, sheets meet half the thickness times tan(turn / 2) beyond the line
/// where their middles meet: there fingers end. On the inside, the other sheet needs room as far as half the thickness times
/// cot(turn / 2). At a right angle both are half the thickness. Sheets nearly in one plane interlock by half of `width`.
fn interlocking(turn: f64, thickness: f64, width: f64) -> [f64; 2] {
    if turn < GENTLE {
        return [width / 2.0; 2];
    }
    let half = (turn / 2.0).tan();
    [(thickness / 2.0 * half).min(thickness), thickness / 2.0 / half]
}

impl Made {
    /// A tab on a stretch of a side, trimmed, and whether it is lower than asked; `None` where nothing useful is left.
    fn tab(
        &self,
        bodies: &BTreeMap<PieceId, Body>,
        solid: &BTreeMap<PieceId, Vec<Vec<Vec2>>>,
        seam: &Measured,
        side: usize,
        stretch: [f64; 2],
        options: &Tabs,
    ) -> Option<(Tab, bool)> {
        let (own, other) = (&seam.sides[side], &seam.sides[1 - side]);
        let turn = seam.turn((stretch[0] + stretch[1]) / 2.0);
        // Two fingers that reach into one corner of a third sheet would meet there.
        let corner = match options.hold {
            Hold::Finger(thickness) if turn >= GENTLE => thickness / 2.0,
            _ => 0.0,
        };
        let own_stretch = [stretch[0].max(corner), stretch[1].min(seam.length() - corner)];
        let base = seam.stretch(side, own_stretch);
        let facing = seam.stretch(1 - side, own_stretch);
        let (a, b) = (base[0], base[base.len() - 1]);
        let (c, d) = (facing[0], facing[facing.len() - 1]);
        let along = (b - a).try_normalize(1e-9)?;
        let outward = Vec2::new(along.y, -along.x) * own.left;
        let highest = (1.0 - TOP) / 2.0 * (b - a).norm() * options.angle.tan();
        let ([width, depth], lowest) = match options.hold {
            Hold::Finger(thickness) => (interlocking(turn, thickness, options.width), LOWEST_FINGER),
            Hold::Glue | Hold::Rivet(_) => ([options.width.min(highest), 0.0], LOWEST),
        };
        if width < lowest || (b - a).norm() < SHORTEST {
            return None;
        }
        let flank = along * (width / options.angle.tan());
        let mut outline = base.clone();
        outline.extend([b - flank + outward * width, a + flank + outward * width]);
        if signed_area(&outline) < 0.0 {
            outline.reverse();
        }
        let whole = ((b - a).norm() - flank.norm()) * width;
        let under = (other.piece, Motion::between([a, b], [c, d])?);
        // A notch begins a little outside of the other piece.
        let inward = under.1.go(a + outward) - under.1.go(a);
        let shore = if depth > 0.0 { seam.stretch(1 - side, stretch) } else { vec![] };
        let mut notch: Vec<Vec2> = shore.iter().map(|&p| p - inward * CLEAR).collect();
        notch.extend(shore.last().into_iter().chain(shore.first()).map(|&p| p + inward * depth));
        if signed_area(&notch) < 0.0 {
            notch.reverse();
        }
        let tab =
            Tab { seam: (!seam.is_slit()).then(|| named(seam)), outline, base, outward, under, notch, rivet: None };
        // Both sides of a seam may bow differently in the plane, which is no harm.
        let bow = |points: &[Vec2], a: Vec2, b: Vec2| {
            points.iter().map(|&p| point_segment_distance(p, a, b)).fold(0.0, f64::max)
        };
        let slack = bow(&tab.base, a, b) + bow(&facing, c, d) + CLEAR / 4.0;
        let left = self.trim(&tab, own.piece, bodies, solid, slack)?;
        // What is left may be in pieces; the one that hangs on the seam counts.
        let middle = (a + b) / 2.0;
        let near = |it: &[Vec2]| it.iter().map(|p| (p - middle).dot(&outward)).fold(f64::INFINITY, f64::min);
        let outlines = boolean::union(&left, &[]).into_iter().filter_map(|it| it.into_iter().next());
        let hanging = outlines.filter(|it| near(it) < slack);
        let outline = hanging.max_by(|x, y| signed_area(x).total_cmp(&signed_area(y)))?;
        let height = outline.iter().map(|p| (p - a).dot(&outward)).fold(0.0, f64::max);
        let useful = signed_area(&outline) >= LEFT * whole && height >= lowest * (1.0 - LEAST_LOSS);
        let narrowed = depth == 0.0 && width < options.width;
        useful.then_some((Tab { outline, ..tab }, narrowed))
    }

    /// What of a tab is left when it is to cross neither its own piece nor other tabs, on either side.
    fn trim(
        &self,
        tab: &Tab,
        piece: PieceId,
        bodies: &BTreeMap<PieceId, Body>,
        solid: &BTreeMap<PieceId, Vec<Vec<Vec2>>>,
        slack: f64,
    ) -> Option<Vec<Vec<Vec2>>> {
        // Its own piece and what lies close to it, but for the seam itself; and the tabs that the piece carries already.
        let around = window(&tab.outline);
        let seam = flat(boolean::thicken(std::slice::from_ref(&tab.base), 2.0 * CLEAR));
        let body = clip(&bodies.get(&piece)?.contours, &around);
        let close = flat(boolean::difference(&clip(solid.get(&piece)?, &around), &seam));
        let mut left = flat(boolean::difference(std::slice::from_ref(&tab.outline), &body));
        left = flat(boolean::difference(&left, &close));
        for it in self.tabs.get(&piece).into_iter().flatten() {
            if Box2::of(&it.outline).grown(CLEAR).touches(&Box2::of(left.iter().flatten())) {
                let other = flat(boolean::offset(std::slice::from_ref(&it.outline), CLEAR));
                left = flat(boolean::difference(&left, &other));
            }
        }
        if left.is_empty() {
            return None;
        }
        // The piece that it goes under, and the tabs that are there already.
        let (under, motion) = tab.under;
        let there: Vec<Vec<Vec2>> = left.iter().map(|it| motion.all(it)).collect();
        let room = clip(&bodies.get(&under)?.contours, &window(&there.concat()));
        let mut there = flat(boolean::intersection(&there, &flat(boolean::offset(&room, slack))));
        if let Some(glued) = self.glued.get(&under) {
            there = flat(boolean::difference(&there, glued));
        }
        let back = motion.inverse();
        Some(there.iter().map(|it| back.all(it)).collect())
    }

    /// Keeps a tab, with a rivet where both pieces have room for its hole.
    fn take(&mut self, bodies: &BTreeMap<PieceId, Body>, piece: PieceId, mut tab: Tab, options: &Tabs) {
        let (under, motion) = tab.under;
        if let (Hold::Rivet(diameter), Some(body)) = (options.hold, bodies.get(&under)) {
            let height = tab.outline.iter().map(|p| (p - tab.base[0]).dot(&tab.outward)).fold(0.0, f64::max);
            let middle = (tab.base[0] + tab.base[tab.base.len() - 1]) / 2.0 + tab.outward * (height / 2.0);
            let there = motion.go(middle);
            let apart = |piece: PieceId, p: Vec2| {
                let others = self.rivets.get(&piece).into_iter().flatten();
                others.into_iter().all(|q| (p - q).norm() >= (1.0 + WEB) * diameter)
            };
            if room_for_hole(std::slice::from_ref(&tab.outline), middle, diameter)
                && room_for_hole(&body.contours, there, diameter)
                && apart(piece, middle)
                && apart(under, there)
            {
                self.rivets.entry(piece).or_default().push(middle);
                self.rivets.entry(under).or_default().push(there);
                tab.rivet = Some(middle);
            }
        }
        self.glued.entry(under).or_default().push(motion.all(&tab.outline));
        self.tabs.entry(piece).or_default().push(tab);
    }

    /// Tabs that cross another tab of their piece or the piece itself, or lie over another tab under the piece that they are
    /// glued to: measured by the areas that they share, not by how they were trimmed.
    pub(super) fn collisions(&self, bodies: &BTreeMap<PieceId, Body>) -> Vec<String> {
        let shared = |a: &[Vec<Vec2>], b: &[Vec<Vec2>]| -> f64 {
            let apart = !Box2::of(a.iter().flatten()).touches(&Box2::of(b.iter().flatten()));
            if apart { 0.0 } else { boolean::intersection(a, b).iter().map(|it| area(it)).sum() }
        };
        let mut found = Vec::new();
        for (piece, tabs) in &self.tabs {
            let Some(body) = bodies.get(piece) else { continue };
            for (i, tab) in tabs.iter().enumerate() {
                let own = [tab.outline.clone()];
                let at = tab.base[0];
                let mut say = |what: &str| {
                    found.push(format!("a tab of part {} at ({:.1}, {:.1}) crosses {what}", body.name, at.x, at.y));
                };
                // Along its base a tab may overlap the piece by what the cleaning of the outline moved.
                if shared(&own, &body.contours) > TOUCH * (1.0 + tab.base.len() as f64) {
                    say("the part itself");
                }
                if tabs[..i].iter().any(|it| shared(&own, std::slice::from_ref(&it.outline)) > TOUCH) {
                    say("another tab");
                }
            }
        }
        for (piece, glued) in &self.glued {
            let Some(body) = bodies.get(piece) else { continue };
            for (i, tab) in glued.iter().enumerate() {
                if glued[..i].iter().any(|it| shared(std::slice::from_ref(tab), std::slice::from_ref(it)) > TOUCH) {
                    found.push(format!("two tabs lie over each other under part {}", body.name));
                }
            }
        }
        found
    }
}
