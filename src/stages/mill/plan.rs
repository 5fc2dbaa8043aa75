//! Which way the body stands, which way round the cutter is, and which rulings it reaches.
use std::collections::BTreeSet;

use super::{
    Machine, MillError, Options,
    curve::Curve,
    fixture,
    guard::{Guard, Obstacle, in_box},
    kinematics::Beyond,
    levels::Trial,
    lines::Band,
    placed,
    posture::{Line, Posture, largest_step},
    standing, tell,
};
use crate::{
    geom::{Box3, Vec3, angle_between},
    mesh::sweep::Pose,
    model::{CutMesh, PieceId, Setup},
    numeric::{Cancelled, Monitor},
};

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
    /// What is left out of the others.
    pub(super) left: Vec<Left>,
    /// The strips of all pieces.
    trials: Vec<Trial<'a>>,
}

/// Postures are never farther apart than this before they are refined, mm.
const MOST_STEP: f64 = 4.0;

/// Why a posture cannot be.
pub(super) enum Bar {
    Obstacle(Obstacle),
    Beyond(Beyond),
}

/// What a strip has of rulings that cannot be cut.
pub(super) struct Left {
    pub(super) piece: PieceId,
    /// Number of the strip in its piece, from 0.
    pub(super) strip: u32,
    /// mm², about.
    pub(super) area: f64,
    /// For people.
    pub(super) reason: String,
}

pub(super) fn plan<'a>(
    cut: &CutMesh,
    bands: &'a [(PieceId, Vec<Band<'a>>)],
    guard: &Guard<'_>,
    options: &Options,
    monitor: &Monitor,
) -> Result<Plan<'a>, MillError> {
    let mut trials: Vec<Trial<'a>> = Vec::new();
    let count: usize = bands.iter().map(|it| it.1.len()).sum();
    for (piece, bands) in bands {
        for band in bands {
            monitor.check()?;
            monitor.progress(trials.len() as f64 / count as f64, "rulings");
            trials.push(Trial::new(*piece, band, cut, guard, options));
        }
    }
    let block = fixture(options);
    // The setup that bars least; of several, the first.
    let cost = |setup: &Setup| {
        trials.iter().map(|it| it.barred(&|found| barred(found, setup, &block, guard, options).is_some())).sum()
    };
    let costs: Vec<(Setup, f64)> = setups(cut, &trials, options).into_iter().map(|it| (it, cost(&it))).collect();
    let best =
        costs.into_iter().min_by(|a, b| a.1.total_cmp(&b.1)).expect("a setup for every direction that may be up");
    let setup = best.0;
    let mut plan = Plan { setup, fixture: block, runs: vec![], unreached: vec![], left: vec![], trials: vec![] };
    for (piece, _) in bands {
        monitor.check()?;
        let mut runs = Vec::new();
        let mut bar = None;
        for trial in trials.iter().filter(|it| it.piece == *piece) {
            let bars = |found: Result<&Posture, &Obstacle>| barred(found, &setup, &block, guard, options);
            let (curves, barred) = trial.curves(&bars, cut, guard);
            if let Some((area, panel, why)) = barred {
                let reason = reason(trial.band, panel, &why, &setup);
                plan.left.push(Left { piece: *piece, strip: trial.band.strip, area, reason });
            }
            for curve in &curves {
                match runs_of(curve, cut, guard, (&setup, &block), options, monitor)? {
                    Ok(found) => runs.extend(found),
                    Err(reason) => {
                        bar.get_or_insert(reason);
                    }
                }
            }
        }
        match bar {
            Some(reason) => plan.unreached.push((*piece, reason)),
            None if runs.is_empty() => plan.unreached.push((*piece, why(*piece, &plan.left))),
            None => plan.runs.extend(runs),
        }
    }
    plan.left.retain(|it| plan.runs.iter().any(|run| run.piece == it.piece));
    plan.runs = in_order(plan.runs, cut, guard);
    plan.trials = trials;
    Ok(plan)
}

impl<'a> Plan<'a> {
    /// Runs over panels, by their numbers, in twice as many levels as before.
    pub(super) fn finer(
        &mut self,
        panels: &BTreeSet<usize>,
        cut: &CutMesh,
        guard: &Guard<'_>,
        options: &Options,
        monitor: &Monitor,
    ) -> Result<Vec<Run<'a>>, Cancelled> {
        let (setup, fixture) = (self.setup, self.fixture);
        let bars = |found: Result<&Posture, &Obstacle>| barred(found, &setup, &fixture, guard, options);
        let mut runs = Vec::new();
        for trial in &mut self.trials {
            for panel in panels.iter().filter_map(|&it| trial.band.place_of(it)).collect::<Vec<_>>() {
                for curve in trial.finer(panel, &bars, cut, guard) {
                    runs.extend(runs_of(&curve, cut, guard, (&setup, &fixture), options, monitor)?.unwrap_or_default());
                }
            }
        }
        Ok(in_order(runs, cut, guard))
    }
}

/// For people: why a part of a strip cannot be cut.
fn reason(band: &Band<'_>, panel: usize, bar: &Bar, setup: &Setup) -> String {
    match bar {
        Bar::Obstacle(it) => tell::obstacle(it, setup),
        Bar::Beyond(it) => tell::beyond(band, panel as f64 + 0.5, it),
    }
}

/// Ways in which the body may lie.
fn setups(cut: &CutMesh, trials: &[Trial<'_>], options: &Options) -> Vec<Setup> {
    let every = || trials.iter().flat_map(Trial::postures);
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
fn barred(
    found: Result<&Posture, &Obstacle>,
    setup: &Setup,
    fixture: &Box3,
    guard: &Guard<'_>,
    options: &Options,
) -> Option<Bar> {
    let posture = match found {
        Err(it) => return Some(Bar::Obstacle(*it)),
        Ok(it) => it,
    };
    let pose = at_work(&posture.pose, setup);
    if let Machine::Mill(_) = options.machine
        && let Some(place) = in_box(&guard.drawn_back(), &pose, fixture)
    {
        return Some(Bar::Obstacle(Obstacle::Fixture(place)));
    }
    options.machine.along(&[pose], None).err().map(|it| Bar::Beyond(it.1))
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
    (setup, fixture): (&Setup, &Box3),
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
        match barred(found.as_ref(), setup, fixture, guard, options) {
            None => open.push(t),
            Some(Bar::Obstacle(_)) => close(&mut open, &mut out),
            // Pieces that were asked for must be possible; of all pieces what is possible is cut.
            Some(Bar::Beyond(_)) if options.pieces.is_empty() => close(&mut open, &mut out),
            Some(Bar::Beyond(it)) => return Ok(Err(tell::beyond(curve.band, t, &it))),
        }
    }
    close(&mut open, &mut out);
    Ok(Ok(out))
}

/// Parameters of postures so near to each other that the surface between them is hit, as far as its normals tell.
fn stations(curve: &Curve<'_>, guard: &Guard<'_>, options: &Options) -> Vec<f64> {
    /// How far a curve runs into the next panel of its strip, in shares of that.
    const INTO: f64 = 0.1;
    let band = curve.band;
    let (first, last) = (curve.panels.start as f64, curve.panels.end as f64);
    let mut out = vec![if first > 0.0 { first - INTO } else { -options.overlap }];
    for k in curve.panels.clone() {
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
    out.extend([last, if last < band.end() { last + INTO } else { last + options.overlap }]);
    out.dedup();
    out
}

/// Why nothing of a piece can be reached: what bars most of it.
fn why(piece: PieceId, left: &[Left]) -> String {
    let mine = left.iter().filter(|it| it.piece == piece);
    let most = mine.max_by(|a, b| a.area.total_cmp(&b.area));
    most.map_or_else(|| "its strips are too narrow to lead a cutter along".into(), |it| it.reason.clone())
}

impl Run<'_> {
    /// About its area, mm².
    pub(super) fn area(&self) -> f64 {
        let lines: Vec<_> =
            self.stations.iter().filter_map(|&t| self.curve.band.line(t.clamp(0.0, self.curve.band.end()))).collect();
        let between = |w: &[Line]| {
            let way = (w[1].p + w[1].q - w[0].p - w[0].q) / 2.0;
            way.cross(&(w[0].q - w[0].p)).norm()
        };
        lines.windows(2).map(between).sum::<f64>() / self.curve.level[1] as f64
    }
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
