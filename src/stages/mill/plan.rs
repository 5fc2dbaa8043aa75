//! Which way the body stands, which way round the cutter is, and which rulings it reaches.
use std::sync::Arc;

use super::{
    Machine, MillError, Options, fixture,
    guard::{Guard, Obstacle, in_box},
    kinematics::Beyond,
    lines::Band,
    placed,
    posture::{Line, Posture, largest_step, posture},
    standing, tell,
};
use crate::{
    geom::{Box3, Vec3, angle_between},
    mesh::{
        FaceId,
        sweep::{Pose, Tool},
    },
    model::{CutMesh, PieceId, Setup},
    numeric::{Cancelled, Monitor},
};

/// A strip as a path of postures, in coordinates of the body.
#[derive(Clone)]
pub(super) struct Curve<'a> {
    pub(super) piece: PieceId,
    pub(super) band: &'a Band<'a>,
    /// Whether the tip is at the end Q of the rulings.
    flip: bool,
    overhang: f64,
    /// Rulings longer than the cutting edges are cut in levels: which one from P on, of how many.
    level: [usize; 2],
    /// How far the rulings are turned in the surface, radians, at [`PER_PANEL`] stations a panel and at the end.
    turns: Arc<[f64]>,
}

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
        let inside = t.clamp(0.0, self.band.end());
        let own = |f: FaceId| cut.piece_of[f] == self.piece;
        let line = self.line(inside, guard, &own).ok_or(Obstacle::Nothing)?;
        let length = (line.q - line.p).norm() + self.overhang;
        let raised = length * self.level[0] as f64 / self.level[1] as f64;
        let mut wanted = posture(&line, &guard.tool, self.overhang - raised, 0.0, 0.5);
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
fn turns(band: &Band<'_>, cut: &CutMesh, piece: PieceId, guard: &Guard<'_>) -> Arc<[f64]> {
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

/// A stretch of a strip that is cut without a lift.
pub(super) struct Run<'a> {
    pub(super) piece: PieceId,
    pub(super) curve: Curve<'a>,
    /// Parameters of its first postures, at least two.
    pub(super) stations: Vec<f64>,
}

/// What is to be done.
pub(super) struct Plan<'a> {
    pub(super) setup: Setup,
    /// In work coordinates.
    pub(super) fixture: Box3,
    pub(super) runs: Vec<Run<'a>>,
    /// Pieces that cannot be reached, with the reason.
    pub(super) unreached: Vec<(PieceId, String)>,
}

/// Postures are never farther apart than this before they are refined, mm.
const MOST_STEP: f64 = 4.0;

/// Why a posture cannot be.
enum Bar {
    Obstacle(Obstacle),
    Beyond(Beyond),
}

/// A strip with the cutter one way round, its levels from Q on, and a few postures of them, settled or barred.
struct Trial<'a> {
    curves: Vec<Curve<'a>>,
    postures: Vec<Result<Posture, Obstacle>>,
}

impl Trial<'_> {
    fn piece(&self) -> PieceId {
        self.curves[0].piece
    }
}

pub(super) fn plan<'a>(
    cut: &CutMesh,
    bands: &'a [(PieceId, Vec<Band<'a>>)],
    guard: &Guard<'_>,
    options: &Options,
    monitor: &Monitor,
) -> Result<Plan<'a>, MillError> {
    let mut trials: Vec<Vec<Trial<'a>>> = Vec::new();
    for (piece, bands) in bands {
        for band in bands {
            monitor.check()?;
            trials.push(ways_round(*piece, band, cut, guard, options));
        }
    }
    let setups = setups(cut, &trials, options);
    let bars = |trial: &Trial<'_>, setup: &Setup| {
        trial.postures.iter().filter(|it| barred(it.as_ref(), setup, options).is_some()).count()
    };
    // The setup that bars fewest postures; of several, the first.
    let cost = |setup: &Setup| -> usize {
        trials.iter().map(|it| it.iter().map(|trial| bars(trial, setup)).min().unwrap_or(0)).sum()
    };
    let setup = setups.into_iter().min_by_key(cost).expect("there is a setup for every direction that may be up");
    let mut plan = Plan { setup, fixture: fixture(options), runs: vec![], unreached: vec![] };
    for (piece, _) in bands {
        monitor.check()?;
        let of_piece = trials.iter().filter(|it| it.first().is_some_and(|it| it.piece() == *piece));
        let chosen = of_piece.filter_map(|it| it.iter().min_by_key(|trial| bars(trial, &setup)));
        let mut runs = Vec::new();
        let mut bar = None;
        for trial in chosen {
            for curve in &trial.curves {
                match runs_of(curve, cut, guard, &setup, options, monitor)? {
                    Ok(found) => runs.extend(found),
                    Err(reason) => {
                        bar.get_or_insert(reason);
                    }
                }
            }
        }
        match bar {
            Some(reason) => plan.unreached.push((*piece, reason)),
            None if runs.is_empty() => plan.unreached.push((*piece, why(*piece, &trials, &setup, options))),
            None => plan.runs.extend(runs),
        }
    }
    plan.runs = in_order(plan.runs, cut, guard);
    Ok(plan)
}

/// Overhangs and directions to try, the preferred one first.
fn ways_round<'a>(
    piece: PieceId,
    band: &'a Band<'a>,
    cut: &CutMesh,
    guard: &Guard<'_>,
    options: &Options,
) -> Vec<Trial<'a>> {
    let middle = match options.machine {
        Machine::Mill(_) => vec![options.overhang, 0.0],
        // Half the wire lies on either side, however long the ruling.
        Machine::Wire(_) => vec![guard.tool.flute / 3.0],
    };
    let stations: Vec<f64> = (0..2 * band.end() as usize).map(|k| 0.25 + 0.5 * k as f64).collect();
    // Levels overlap by a tenth of the cutting edges.
    let longest = stations.iter().filter_map(|&t| band.line(t)).map(|it| (it.q - it.p).norm()).fold(0.0, f64::max);
    let levels = ((longest + options.overhang) / (0.9 * options.tool.flute)).ceil().max(1.0) as usize;
    let turns = turns(band, cut, piece, guard);
    let mut out = Vec::new();
    for overhang in middle {
        let is_free = |it: &Trial<'_>| it.postures.iter().all(Result::is_ok);
        if out.iter().any(is_free) {
            break;
        }
        for flip in [false, true] {
            let curve = |level| Curve { piece, band, flip, overhang, level, turns: turns.clone() };
            let curves: Vec<_> = (0..levels).rev().map(|k| curve([k, levels])).collect();
            let postures = curves.iter().flat_map(|it| stations.iter().map(|&t| it.at(t, cut, guard))).collect();
            out.push(Trial { curves, postures });
        }
    }
    out
}

/// Ways in which the body may lie.
fn setups(cut: &CutMesh, trials: &[Vec<Trial<'_>>], options: &Options) -> Vec<Setup> {
    let every =
        || trials.iter().filter_map(|it| it.first()).flat_map(|it| &it.postures).filter_map(|it| it.as_ref().ok());
    if let Machine::Wire(wire) = &options.machine {
        let mut along = Vec3::zeros();
        let mut out = Vec3::zeros();
        for it in every() {
            let axis = it.pose.axis;
            along += if axis.dot(&along) < 0.0 { -axis } else { axis };
            out += it.out;
        }
        let y = along.try_normalize(0.0).unwrap_or_else(Vec3::y);
        let up = options.up.unwrap_or(out);
        let z = (up - y * y.dot(&up)).try_normalize(1e-6);
        let z = z.unwrap_or_else(|| y.cross(&Vec3::new(y.y, y.z, y.x)).normalize());
        let setup = placed(&cut.mesh, [y.cross(&z), y, z], options);
        let poses: Vec<Pose> = every().map(|it| at_work(&it.pose, &setup)).collect();
        return vec![Setup { shift: setup.shift + wire.middle(&poses), ..setup }];
    }
    let ups = match options.up {
        Some(up) => vec![up.normalize()],
        None => vec![Vec3::z(), Vec3::y(), -Vec3::z(), -Vec3::y(), Vec3::x(), -Vec3::x()],
    };
    ups.into_iter().map(|up| standing(&cut.mesh, up, options)).collect()
}

/// What bars a posture in a setup.
fn barred(found: Result<&Posture, &Obstacle>, setup: &Setup, options: &Options) -> Option<Bar> {
    let posture = match found {
        Err(it) => return Some(Bar::Obstacle(*it)),
        Ok(it) => it,
    };
    let pose = at_work(&posture.pose, setup);
    if let Machine::Mill(_) = options.machine
        && let Some(place) = in_box(&options.tool, &pose, &with_ways(&fixture(options), options))
    {
        return Some(Bar::Obstacle(Obstacle::Fixture(place)));
    }
    options.machine.along(&[pose], None).err().map(|it| Bar::Beyond(it.1))
}

/// A fixture grown sideways by the ways in and out.
fn with_ways(fixture: &Box3, options: &Options) -> Box3 {
    let side = Vec3::new(options.lead, options.lead, 0.0);
    Box3 { min: fixture.min - side, max: fixture.max + side }
}

/// A pose in work coordinates.
pub(super) fn at_work(pose: &Pose, setup: &Setup) -> Pose {
    Pose { tip: setup.place(pose.tip), axis: setup.turn(pose.axis) }
}

/// The stretches of a strip that nothing is in the way of; `Err` where the machine lacks travel.
fn runs_of<'a>(
    curve: &Curve<'a>,
    cut: &CutMesh,
    guard: &Guard<'_>,
    setup: &Setup,
    options: &Options,
    monitor: &Monitor,
) -> Result<Result<Vec<Run<'a>>, String>, Cancelled> {
    let mut out = Vec::new();
    let mut open: Vec<f64> = Vec::new();
    let close = |open: &mut Vec<f64>, out: &mut Vec<Run<'a>>| {
        let stations = std::mem::take(open);
        if stations.len() > 1 {
            out.push(Run { piece: curve.piece, curve: curve.clone(), stations });
        }
    };
    for t in stations(curve, guard, options) {
        monitor.check()?;
        let found = curve.at(t, cut, guard);
        match barred(found.as_ref(), setup, options) {
            None => open.push(t),
            Some(Bar::Obstacle(_)) => close(&mut open, &mut out),
            // Pieces that were asked for must be possible; of all pieces what is possible is cut.
            Some(Bar::Beyond(_)) if options.pieces.is_empty() => close(&mut open, &mut out),
            Some(Bar::Beyond(it)) => {
                let line = curve.band.line(t.clamp(0.0, curve.band.end()));
                let ends = line.map_or([Vec3::zeros(); 2], |it| [it.p, it.q]);
                return Ok(Err(tell::beyond(curve.band.strip, ends, &it)));
            }
        }
    }
    close(&mut open, &mut out);
    Ok(Ok(out))
}

/// Parameters of postures so near to each other that the surface between them is hit, as far as its normals tell.
fn stations(curve: &Curve<'_>, guard: &Guard<'_>, options: &Options) -> Vec<f64> {
    let band = curve.band;
    let mut out = vec![-options.overlap];
    for k in 0..band.end() as usize {
        let start = k as f64;
        let lines: Vec<_> = [0.0, 0.5, 1.0].iter().filter_map(|s| band.line((start + s).min(band.end()))).collect();
        let mut steps = 1.0_f64;
        for w in lines.windows(2) {
            let [n, k] = [w[0].normal(), w[1].normal()];
            let turned = angle_between(n, k).max(angle_between(w[0].direction(), w[1].direction()));
            let way = (w[1].p + w[1].q - w[0].p - w[0].q) / 2.0;
            let convex = (k - n).dot(&way) >= 0.0;
            let radius = way.norm() / turned.max(1e-9) * if convex { 1.0 } else { -1.0 };
            let step = largest_step(radius, guard.tool.widest(), options.gouge / 2.0);
            steps = steps.max(2.0 * turned / step).max(2.0 * way.norm() / MOST_STEP);
        }
        let steps = steps.ceil() as usize;
        out.extend((0..steps).map(|i| start + i as f64 / steps as f64));
    }
    out.extend([band.end(), band.end() + options.overlap]);
    if options.overlap == 0.0 {
        out.dedup();
    }
    out
}

/// Why nothing of a piece can be reached.
fn why(piece: PieceId, trials: &[Vec<Trial<'_>>], setup: &Setup, options: &Options) -> String {
    let mine = trials.iter().flatten().filter(|it| it.piece() == piece);
    let found = mine.flat_map(|it| &it.postures).find_map(|it| match barred(it.as_ref(), setup, options) {
        Some(Bar::Obstacle(Obstacle::Nothing)) | None => None,
        Some(Bar::Obstacle(it)) => Some(tell::obstacle(&it, setup)),
        Some(Bar::Beyond(beyond)) => {
            let at = it.as_ref().map_or_else(|_| Vec3::zeros(), |it| it.pose.tip);
            let far = it.as_ref().map_or(at, |it| it.pose.at(options.tool.flute));
            Some(tell::beyond(0, [at, far], &beyond))
        }
    });
    found.unwrap_or_else(|| "its strips are too narrow to lead a cutter along".into())
}

/// The nearest start next, from the first run.
fn in_order<'a>(mut runs: Vec<Run<'a>>, cut: &CutMesh, guard: &Guard<'_>) -> Vec<Run<'a>> {
    let place = |run: &Run<'_>, t: f64| run.curve.at(t, cut, guard).map_or_else(|_| Vec3::zeros(), |it| it.pose.tip);
    let mut ends: Vec<[Vec3; 2]> = runs
        .iter()
        .map(|run| [place(run, run.stations[0]), place(run, run.stations[run.stations.len() - 1])])
        .collect();
    for i in 1..runs.len() {
        let from = ends[i - 1][1];
        let near = |k: &usize| (ends[*k][0] - from).norm();
        let next = (i..runs.len()).min_by(|a, b| near(a).total_cmp(&near(b))).expect("some are left");
        runs.swap(i, next);
        ends.swap(i, next);
    }
    runs
}
