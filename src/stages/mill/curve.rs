//! A strip as a path of postures: its rulings, turned in the surface so that the cutter leaves least, cut in levels.
use std::{ops::Range, sync::Arc};

use super::{
    guard::{Guard, Obstacle, Settled},
    lines::Band,
    posture::{Line, Posture, posture},
};
use crate::{
    geom::Vec3,
    mesh::{FaceId, sweep::Tool},
    model::{CutMesh, PieceId},
};

/// A strip as a path of postures, in coordinates of the body.
#[derive(Clone)]
pub(super) struct Curve<'a> {
    pub(super) piece: PieceId,
    pub(super) band: &'a Band<'a>,
    /// Whether the tip is at the end Q of the rulings.
    pub(super) flip: bool,
    /// How far the cutter reaches beyond the end P of a level.
    pub(super) overhang: f64,
    /// Panels of the strip that it runs over.
    pub(super) panels: Range<usize>,
    /// Rulings longer than the cutting edges, or bent along their length, are cut in levels: which one from P on, of how many.
    pub(super) level: [usize; 2],
    /// How far the rulings are turned in the surface, radians, at [`PER_PANEL`] stations a panel and at the end.
    pub(super) turns: Arc<[f64]>,
}

/// Levels reach into their neighbours by this share of their height.
const LAP: f64 = 0.05;
/// Stations of a panel at which rulings are turned.
const PER_PANEL: usize = 4;
/// Rulings are turned by at most this, radians: those of a coarse decomposition are a few degrees off.
const MOST_TURN: f64 = 0.24;
/// Angles tried on either side.
const TRIED: i32 = 4;
/// What the largest turn costs, mm of hollow: where nothing bends, rulings stay as they are.
const TURN_COST: f64 = 0.002;

impl Curve<'_> {
    /// The posture at a parameter, settled on the body. Below 0 and beyond the end it counts millimetres over the surface.
    pub(super) fn at(&self, t: f64, cut: &CutMesh, guard: &Guard<'_>) -> Result<Posture, Obstacle> {
        self.settled(t, cut, guard).map(|it| it.posture)
    }

    /// The same with what it leaves.
    pub(super) fn settled(&self, t: f64, cut: &CutMesh, guard: &Guard<'_>) -> Result<Settled, Obstacle> {
        let inside = t.clamp(0.0, self.band.end());
        let own = |f: FaceId| cut.piece_of[f] == self.piece;
        let line = self.line(inside, guard, &own).ok_or(Obstacle::Nothing)?;
        let [k, levels] = self.level.map(|it| it as f64);
        let line = line.part((k / levels - LAP / levels).max(0.0), ((k + 1.0 + LAP) / levels).min(1.0));
        let mut wanted = posture(&line, &guard.tool, self.overhang, 0.0, 0.5);
        wanted.contact = wanted.contact.map(|h| h.clamp(0.0, guard.tool.flute));
        wanted.pose.tip += self.travel(&wanted) * (t - inside);
        guard.settle(&wanted, &own)
    }

    /// The ruling at a parameter, turned in the surface and as long as the piece is there.
    fn line(&self, t: f64, guard: &Guard<'_>, own: &dyn Fn(FaceId) -> bool) -> Option<Line> {
        let line = self.band.line(t)?;
        let place = t * PER_PANEL as f64;
        let k = (place as usize).min(self.turns.len().saturating_sub(2));
        let turn = match self.turns.get(k..k + 2) {
            Some(&[a, b]) => a + (b - a) * (place - k as f64),
            _ => 0.0,
        };
        let line = if turn == 0.0 { line } else { turned(&line, turn, guard, own) };
        Some(if self.flip { line.flipped() } else { line })
    }

    /// Direction of travel over the surface.
    pub(super) fn travel(&self, posture: &Posture) -> Vec3 {
        if self.flip { -posture.across } else { posture.across }
    }
}

/// A ruling turned about its middle in the surface, as long as the piece is there.
fn turned(line: &Line, turn: f64, guard: &Guard<'_>, own: &dyn Fn(FaceId) -> bool) -> Line {
    let (a, m, middle) = (line.direction(), line.normal(), (line.p + line.q) / 2.0);
    let along = a * turn.cos() + a.cross(&m) * turn.sin();
    // Half as long again, so that a ruling that turns towards a corner can grow.
    let most = 0.75 * (line.q - line.p).norm() + 1.0;
    let [before, after] = guard.extent(middle, along, m, most, own);
    Line { p: middle - along * before.max(0.05), q: middle + along * after.max(0.05), normals: line.normals }
}

/// For every station of a strip the turn about its normal that leaves least under the cutter, smoothed along the strip.
pub(super) fn turns(band: &Band<'_>, cut: &CutMesh, piece: PieceId, guard: &Guard<'_>) -> Arc<[f64]> {
    let own = |f: FaceId| cut.piece_of[f] == piece;
    let count = band.end() as usize * PER_PANEL + 1;
    let best = |k: usize| {
        let Some(line) = band.line((k as f64 / PER_PANEL as f64).min(band.end())) else { return 0.0 };
        let long = Tool { flute: (line.q - line.p).norm() + 1.0, ..guard.tool };
        let probe = Guard { tool: long, ..*guard };
        let cost = |turn: f64| {
            let line = turned(&line, turn, &probe, &own);
            let posture = posture(&line, &long, 0.0, 0.0, 0.5);
            probe.hollow(&posture, &own) + TURN_COST * (turn / MOST_TURN).powi(2)
        };
        let step = MOST_TURN / f64::from(TRIED);
        let costs: Vec<f64> = (-TRIED..=TRIED).map(|i| cost(step * f64::from(i))).collect();
        let least = (0..costs.len()).min_by(|&a, &b| costs[a].total_cmp(&costs[b])).expect("several were tried");
        let at = (least as f64 - f64::from(TRIED)) * step;
        // The bottom of the parabola through it and its neighbours.
        match costs.get(least.wrapping_sub(1)..least + 2) {
            Some(&[a, b, c]) if a + c > 2.0 * b => at + 0.5 * step * (a - c) / (a + c - 2.0 * b),
            _ => at,
        }
    };
    let mut out: Vec<f64> = (0..count).map(best).collect();
    for _ in 0..2 {
        let before = out.clone();
        for k in 0..count {
            out[k] = (before[k.saturating_sub(1)] + 2.0 * before[k] + before[(k + 1).min(count - 1)]) / 4.0;
        }
    }
    out.into()
}
