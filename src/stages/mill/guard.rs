//! Keeps a posture on the surface and out of the body.
//!
//! In the frame of a posture a sample has a height h along the axis, u across and w outwards. A cutter of radius R there
//! clears it when it is moved out by w + √(R² − u²). All samples together ask for a line L(h) above the points (h, w + √(R²
//! − u²)); the line that is lowest in the middle of the contact is the side of their upper hull over it. Moved out by L, the
//! cutter touches in two places and cuts nowhere: the two-point tilt of the axis in the plane of the ruling.
use super::posture::Posture;
use crate::{
    geom::{Box3, Vec3},
    mesh::{
        FaceId,
        sweep::{Pose, Samples, Tool},
    },
};

/// What is in the way of a posture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Obstacle {
    /// There is no ruling, or nothing to touch.
    Nothing,
    /// The body beside the ruling is in the way of the cutter.
    Cutter(Vec3),
    /// The body is in the way of the shank or holder.
    Holder(Vec3),
    /// The fixture is in the way.
    Fixture(Vec3),
}

/// The body and what holds it.
pub(super) struct Guard<'a> {
    pub(super) samples: &'a Samples,
    /// Distance of the samples.
    pub(super) spacing: f64,
    pub(super) tool: Tool,
    /// How far the tool is drawn back along its axis after a cut, mm.
    pub(super) withdrawn: f64,
    /// How far into the surface a settled posture may reach, mm.
    pub(super) allowed: f64,
    /// How far the body beside a piece may push the cutter off it, mm.
    pub(super) push: f64,
}

/// A shift outwards that is linear in the height.
#[derive(Debug, Clone, Copy)]
struct Shift {
    at: f64,
    value: f64,
    slope: f64,
}

impl Shift {
    fn over(&self, h: f64) -> f64 {
        self.value + self.slope * (h - self.at)
    }
}

/// A posture on the surface.
#[derive(Debug, Clone, Copy)]
pub(super) struct Settled {
    pub(super) posture: Posture,
    /// Most that it leaves along its contact, mm.
    pub(super) left: f64,
}

/// A posture that would have to tilt by more than this to stand on its ruling does not belong there.
const STEEPEST: f64 = 0.2;

/// Rounds in which a posture is moved: the second corrects for what the first one turned.
const ROUNDS: usize = 3;

impl Guard<'_> {
    /// Height, shift asked for, and index of every sample that a cutter could meet, from `below` its flat end up.
    fn asked(&self, posture: &Posture, below: f64, visit: &mut dyn FnMut(usize, f64, f64)) {
        let pose = &posture.pose;
        let widening = self.tool.taper.tan();
        self.samples.near(&pose.tip, &pose.at(self.tool.flute), self.tool.widest() + 1.0, |i| {
            let d = self.samples.points[i] - pose.tip;
            let (h, u, w) = (d.dot(&pose.axis), d.dot(&posture.across), d.dot(&posture.out));
            if !(-below..=self.tool.flute).contains(&h) {
                return;
            }
            let radius = self.tool.radius + h.max(0.0) * widening;
            // What lies beyond the far side of the cutter is not in its way.
            if u.abs() < radius {
                let half = (radius * radius - u * u).sqrt();
                if w < half {
                    visit(i, h, w + half);
                }
            }
        });
    }

    /// The posture moved so that it touches the surface of the faces that are `own` and cuts into nothing.
    pub(super) fn settle(&self, posture: &Posture, own: &dyn Fn(FaceId) -> bool) -> Result<Settled, Obstacle> {
        let mut posture = *posture;
        let mut left = 0.0;
        for _ in 0..ROUNDS {
            let (mut mine, mut all, mut worst) = (Vec::new(), Vec::new(), (f64::NEG_INFINITY, Vec3::zeros()));
            let band = self.tool.radius * 0.5;
            // What the surface does between the samples at the end of the cutter is told by those beyond it.
            self.asked(&posture, self.spacing, &mut |i, h, shift| {
                let is_own = own(self.samples.faces[i]);
                if shift < -band || (h < 0.0 && !is_own) {
                    return;
                }
                if is_own {
                    mine.push((h, shift));
                } else if shift > worst.0 {
                    worst = (shift, self.samples.points[i]);
                }
                all.push((h, shift));
            });
            let own_line =
                lowest(&mine, posture.contact).filter(|it| it.slope.abs() < STEEPEST).ok_or(Obstacle::Nothing)?;
            let line = lowest(&all, posture.contact).ok_or(Obstacle::Nothing)?;
            let pushed = posture.contact.map(|h| line.over(h) - own_line.over(h));
            if pushed[0].max(pushed[1]) > self.push {
                return Err(Obstacle::Cutter(worst.1));
            }
            left = gaps(&mine, &line, posture.contact).map(|it| it.1).fold(0.0, f64::max);
            posture = shifted(&posture, &line, self.allowed);
        }
        match self.in_holder(&posture.pose) {
            Some(place) => Err(Obstacle::Holder(place)),
            None => Ok(Settled { posture, left }),
        }
    }

    /// How much a posture leaves along its contact when it is settled on the faces that are `own`, mm: the mean height of the
    /// line that it is moved out by over what the samples ask for.
    pub(super) fn hollow(&self, posture: &Posture, own: &dyn Fn(FaceId) -> bool) -> f64 {
        let mut mine = Vec::new();
        self.asked(posture, 0.0, &mut |i, h, shift| {
            if own(self.samples.faces[i]) {
                mine.push((h, shift));
            }
        });
        let [low, high] = posture.contact;
        mine.retain(|it| (low..high).contains(&it.0));
        let Some(line) = lowest(&mine, posture.contact) else { return 0.0 };
        let (mut sum, mut count) = (0.0, 0.0);
        for (_, gap) in gaps(&mine, &line, posture.contact) {
            (sum, count) = (sum + gap, count + 1.0);
        }
        sum / f64::max(count, 1.0)
    }

    /// How far the surface of the faces that are `own` goes along a line on it, from a point of it to both sides: samples
    /// within a step of the line and `depth` of it, without a gap.
    pub(super) fn extent(&self, at: Vec3, along: Vec3, out: Vec3, most: f64, own: &dyn Fn(FaceId) -> bool) -> [f64; 2] {
        const BIN: f64 = 0.5;
        let half = (most / BIN).ceil() as usize;
        let mut full = vec![false; 2 * half + 1];
        let across = along.cross(&out);
        let depth = self.tool.radius.max(1.0);
        let side = 2.0 * self.spacing;
        self.samples.near(&(at - along * most), &(at + along * most), depth, |i| {
            let d = self.samples.points[i] - at;
            let h = d.dot(&along);
            if d.dot(&across).abs() <= side
                && d.dot(&out).abs() <= depth
                && h.abs() <= most
                && own(self.samples.faces[i])
            {
                full[(h / BIN + half as f64).round() as usize] = true;
            }
        });
        // A single empty bin between samples is no gap.
        let reach = |step: isize| {
            let is = |k: isize| usize::try_from(k).ok().and_then(|k| full.get(k).copied()).unwrap_or(false);
            let mut k = half as isize;
            while is(k + step) || is(k + 2 * step) {
                k += step;
            }
            (k - half as isize).unsigned_abs() as f64 * BIN
        };
        [reach(-1), reach(1)]
    }

    /// Whether a posture is clear of the body, but for what is allowed.
    pub(super) fn is_clear(&self, posture: &Posture) -> bool {
        self.depth(posture) <= 2.0 * self.allowed && self.in_holder(&posture.pose).is_none()
    }

    /// How deep a posture reaches into the surface; negative where it does not touch.
    pub(super) fn depth(&self, posture: &Posture) -> f64 {
        let mut depth = f64::NEG_INFINITY;
        self.asked(posture, 0.0, &mut |_, _, shift| depth = depth.max(shift));
        depth
    }

    /// About what a ball as wide as the tip of the cutter leaves on a sample, mm: from where it touches the sample along the
    /// normal it is moved out of the nearest ones. A cutter holds such a ball wherever it touches, so it leaves no less.
    pub(super) fn closing(&self, p: Vec3, normal: Vec3) -> f64 {
        const PUSHES: usize = 60;
        let radius = self.tool.radius;
        let mut center = p + normal * radius;
        for _ in 0..PUSHES {
            let mut nearest = (radius - self.allowed, Vec3::zeros());
            self.samples.near(&center, &center, radius, |i| {
                let away = center - self.samples.points[i];
                if away.norm() < nearest.0 {
                    nearest = (away.norm(), away);
                }
            });
            match nearest.1.try_normalize(1e-12) {
                Some(out) => center += out * (radius - nearest.0),
                None => break,
            }
        }
        ((center - p).norm() - radius).max(0.0)
    }

    /// The cutter with all that it sweeps when it is drawn back along its axis: the cutting part follows the shank, and the
    /// holder takes up all that lies behind it.
    pub(super) fn drawn_back(&self) -> Tool {
        let tool = self.tool;
        let shank = tool.shank.max(tool.widest() - 2.0 * self.allowed);
        Tool { shank, holder_length: tool.holder_length + self.withdrawn, ..tool }
    }

    /// A place of the body inside the shank or the holder, there or drawn back.
    fn in_holder(&self, pose: &Pose) -> Option<Vec3> {
        let tool = self.drawn_back();
        let (low, high) = (pose.at(tool.flute), pose.at(tool.reach + tool.holder_length));
        let mut found = None;
        self.samples.near(&low, &high, tool.shank.max(tool.holder), |i| {
            let p = self.samples.points[i];
            if tool.depths(pose, &p).1 > 0.0 {
                found.get_or_insert(p);
            }
        });
        found
    }
}

/// A place where the tool comes into a box, which it may touch.
pub(super) fn in_box(tool: &Tool, pose: &Pose, fixture: &Box3) -> Option<Vec3> {
    /// Distance of the stations along the tool, mm.
    const STEP: f64 = 1.0;
    const TOUCH: f64 = 0.02;
    if (fixture.max - fixture.min).min() <= 2.0 * TOUCH {
        return None;
    }
    let length = tool.reach + tool.holder_length;
    let stations = (length / STEP).ceil() as usize;
    (0..=stations).find_map(|k| {
        let h = length * k as f64 / stations as f64;
        let radius = if h <= tool.flute {
            tool.radius_at(h)
        } else if h <= tool.reach {
            tool.shank
        } else {
            tool.holder
        };
        let p = pose.at(h);
        let touch = Vec3::repeat(TOUCH);
        let inside = p.sup(&(fixture.min + touch)).inf(&(fixture.max - touch));
        // The nearest point of the box is inside the disk when it is nearer than the rim in the plane of the disk.
        let d = inside - p;
        let along = d.dot(&pose.axis);
        (along.abs() <= STEP && (d - pose.axis * along).norm() < radius).then_some(inside)
    })
}

/// The line over all points that is lowest in the middle of a stretch: the side of their upper hull there. From the highest
/// points on either side of the middle, the end of the line on the side of the point farthest above it moves there, which
/// raises the line in the middle every time, until none is above it.
fn lowest(points: &[(f64, f64)], stretch: [f64; 2]) -> Option<Shift> {
    let middle = (stretch[0] + stretch[1]) / 2.0;
    let highest = |on_left: bool| {
        let side = points.iter().filter(move |it| (it.0 <= middle) == on_left);
        side.copied().max_by(|a, b| a.1.total_cmp(&b.1))
    };
    let (mut left, mut right) = match (highest(true), highest(false)) {
        (Some(left), Some(right)) => (left, right),
        // All on one side of the middle: as far out as the highest, without a tilt.
        (one, other) => return one.or(other).map(|it| Shift { at: it.0, value: it.1, slope: 0.0 }),
    };
    loop {
        let line = Shift { at: left.0, value: left.1, slope: (right.1 - left.1) / (right.0 - left.0) };
        let mut above = (1e-12, None);
        for it in points {
            let height = it.1 - line.over(it.0);
            if height > above.0 {
                above = (height, Some(*it));
            }
        }
        match above.1 {
            None => return Some(line),
            Some(it) if it.0 <= middle => left = it,
            Some(it) => right = it,
        }
    }
}

/// Height and what is left under a line over points, in bins of equal height along a stretch; empty bins have none.
fn gaps(points: &[(f64, f64)], line: &Shift, [low, high]: [f64; 2]) -> impl Iterator<Item = (f64, f64)> {
    const BINS: usize = 24;
    let mut least = [f64::INFINITY; BINS];
    for &(h, shift) in points.iter().filter(|it| (low..high).contains(&it.0)) {
        let bin = &mut least[((h - low) / (high - low) * BINS as f64) as usize];
        *bin = bin.min(line.over(h) - shift);
    }
    let middle = move |k: usize| low + (high - low) * (k as f64 + 0.5) / BINS as f64;
    (0..BINS).map(move |k| (middle(k), least[k])).filter(|it| it.1.is_finite())
}

/// Moves a posture out by a line, less what is allowed.
fn shifted(posture: &Posture, line: &Shift, allowed: f64) -> Posture {
    let [low, high] = posture.contact;
    let [a, b] = [low, high].map(|h| posture.pose.at(h) + posture.out * (line.over(h) - allowed));
    let axis = (b - a).normalize();
    let out = (posture.out - axis * axis.dot(&posture.out)).normalize();
    Posture { pose: Pose { tip: a - axis * low, axis }, out, across: axis.cross(&out), contact: posture.contact }
}
