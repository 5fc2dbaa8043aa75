//! From runs to blocks: refined postures, ways in and out, several depths, links, times.
use std::f64::consts::FRAC_PI_2;

use super::{
    Machine, MillError, Options,
    guard::{Guard, in_box},
    kinematics::Beyond,
    plan::{Left, Plan, Run, at_work},
    posture::Posture,
    tell,
};
use crate::{
    geom::{Box3, Vec3, angle_between},
    mesh::sweep::Pose,
    model::{CutMesh, MillMove, PieceId, Setup},
    numeric::{Cancelled, Monitor},
};

/// Blocks are halved at most this often.
const HALVINGS: u32 = 8;
/// Shares of a block at which it is tried.
const TRIED: [f64; 3] = [0.25, 0.5, 0.75];
/// How steeply the ways in and out leave the surface: the tangent of the angle.
const RAMP: f64 = 0.35;
/// Largest turn of one block of a link, radians.
const LINK: f64 = 0.17;

/// A posture of a run with its joints.
#[derive(Clone)]
struct Station {
    t: f64,
    posture: Posture,
    joints: Vec<f64>,
}

/// A block to be, in work coordinates.
struct Stop {
    rapid: bool,
    pose: Pose,
    contact: [f64; 2],
}

/// Heights of a cutter that touches nothing.
const CLEAR: [f64; 2] = [0.0, -1.0];

/// Adds the blocks of some runs to a program. Of pieces that were not asked for, stretches that the machine lacks travel for
/// are added to what is left of `plan`.
pub(super) fn extend(
    out: &mut Vec<MillMove>,
    runs: &[Run<'_>],
    plan: &mut Plan<'_>,
    (cut, guard): (&CutMesh, &Guard<'_>),
    options: &Options,
    monitor: &Monitor,
) -> Result<(), MillError> {
    for (i, run) in runs.iter().enumerate() {
        monitor.progress(i as f64 / runs.len() as f64, "paths");
        match cut_along(run, cut, plan, guard, options, out, monitor) {
            Ok(()) => {}
            Err(Stopped::Cancelled(it)) => return Err(it.into()),
            Err(Stopped::Beyond(t, it)) => {
                let reason = tell::beyond(run.curve.band, t, &it);
                if !options.pieces.is_empty() {
                    return Err(MillError::Piece { name: cut.pieces[run.piece].name.clone(), reason });
                }
                let (piece, strip) = (run.piece, run.curve.band.strip);
                plan.left.push(Left { piece, strip, area: run.area(), reason });
            }
        }
    }
    Ok(())
}

/// Adds the blocks of one run.
fn cut_along(
    run: &Run<'_>,
    cut: &CutMesh,
    plan: &Plan<'_>,
    guard: &Guard<'_>,
    options: &Options,
    out: &mut Vec<MillMove>,
    monitor: &Monitor,
) -> Result<(), Stopped> {
    let from = out.last().map(|it| it.joints.clone());
    let stations = refined(run, cut, plan, guard, options, from.as_deref(), monitor)?;
    // A block that the body is in the way of is left out.
    let passes = stations.chunk_by(|a, b| clear(a, b, plan, guard, options)).filter(|it| it.len() > 1);
    for (pass, offset) in passes.flat_map(|it| offsets(options).into_iter().map(move |offset| (it, offset))) {
        let stops = stops(run, pass, offset, guard, plan, options);
        let before = out.last().map(|it| it.pose);
        let linked = link(before, stops, plan, cut, options);
        let segment = out.last().map_or(0, |it| it.segment + 1);
        push(out, linked, (segment, run.piece), options).map_err(|it| Stopped::Beyond(run.stations[0], it))?;
    }
    Ok(())
}

/// What is left on the surface after each pass: from the stock down to nothing.
fn offsets(options: &Options) -> Vec<f64> {
    let passes = (options.stock / options.depth).ceil().max(1.0) as usize;
    (0..passes).map(|k| options.stock * (1.0 - (k + 1) as f64 / passes as f64)).collect()
}

/// Why a run has no joints: the parameter and the axis, or an interruption.
enum Stopped {
    Beyond(f64, Beyond),
    Cancelled(Cancelled),
}

impl From<Cancelled> for Stopped {
    fn from(it: Cancelled) -> Self {
        Self::Cancelled(it)
    }
}

/// The stations of a run, halved until every block keeps to the surface in every way to move between them.
fn refined(
    run: &Run<'_>,
    cut: &CutMesh,
    plan: &Plan<'_>,
    guard: &Guard<'_>,
    options: &Options,
    from: Option<&[f64]>,
    monitor: &Monitor,
) -> Result<Vec<Station>, Stopped> {
    let setup = &plan.setup;
    let settled: Vec<(f64, Posture)> =
        run.stations.iter().filter_map(|&t| Some((t, run.curve.at(t, cut, guard).ok()?))).collect();
    let poses: Vec<Pose> = settled.iter().map(|it| at_work(&it.1.pose, setup)).collect();
    let joints = options.machine.along(&poses, from).map_err(|(i, it)| Stopped::Beyond(settled[i].0, it))?;
    let every: Vec<Station> =
        settled.into_iter().zip(joints).map(|((t, posture), joints)| Station { t, posture, joints }).collect();
    let mut out = vec![every[0].clone()];
    for w in every.windows(2) {
        monitor.check()?;
        // The stretches still to be tried, the next one last.
        let mut open = vec![(w[1].clone(), HALVINGS)];
        while let Some((next, left)) = open.pop() {
            let last = &out[out.len() - 1];
            if left == 0 || keeps(last, &next, setup, guard, options) {
                out.push(next);
                continue;
            }
            let t = (last.t + next.t) / 2.0;
            let Ok(posture) = run.curve.at(t, cut, guard) else {
                out.push(next);
                continue;
            };
            let pose = at_work(&posture.pose, setup);
            // Between joints that can be reached others can be, if not on the surface.
            let Ok(joints) = options.machine.nearest(&pose, &last.joints) else {
                out.push(next);
                continue;
            };
            open.push((next, left - 1));
            open.push((Station { t, posture, joints }, left - 1));
        }
    }
    Ok(out)
}

/// Depths of the cutter in the body at shares of the way between two stations, however the controller moves.
fn depths<'a>(
    a: &'a Station,
    b: &'a Station,
    shares: &'a [f64],
    setup: &'a Setup,
    guard: &'a Guard<'_>,
    options: &'a Options,
) -> impl Iterator<Item = f64> + 'a {
    let ends = [a, b].map(|it| at_work(&it.posture.pose, setup));
    options.machine.ways().iter().flat_map(move |&way| {
        shares.iter().map(move |&s| {
            let pose = options.machine.between(way, (&ends[0], &a.joints), (&ends[1], &b.joints), s);
            let pose = Pose { tip: setup.back(pose.tip), axis: setup.turn_back(pose.axis) };
            let out = a.posture.out * (1.0 - s) + b.posture.out * s;
            let out = (out - pose.axis * pose.axis.dot(&out)).normalize();
            guard.depth(&Posture { pose, out, across: pose.axis.cross(&out), contact: a.posture.contact })
        })
    })
}

/// Whether the cutter neither cuts in nor hovers between two stations, by half of what is allowed.
fn keeps(a: &Station, b: &Station, setup: &Setup, guard: &Guard<'_>, options: &Options) -> bool {
    let limit = options.gouge / 2.0;
    depths(a, b, &TRIED, setup, guard, options).all(|it| -limit <= it && it <= limit)
}

/// Whether the cutter keeps out of the body and of the block between two stations.
fn clear(a: &Station, b: &Station, plan: &Plan<'_>, guard: &Guard<'_>, options: &Options) -> bool {
    const EIGHTHS: [f64; 7] = [0.125, 0.25, 0.375, 0.5, 0.625, 0.75, 0.875];
    let is_free = |it: &Station| match options.machine {
        Machine::Mill(_) => {
            in_box(&guard.drawn_back(), &at_work(&it.posture.pose, &plan.setup), &plan.fixture).is_none()
        }
        Machine::Wire(_) => true,
    };
    is_free(a) && is_free(b) && depths(a, b, &EIGHTHS, &plan.setup, guard, options).all(|it| it <= 0.75 * options.gouge)
}

/// A stretch at an offset with its ways in and out.
fn stops(
    run: &Run<'_>,
    stations: &[Station],
    offset: f64,
    guard: &Guard<'_>,
    plan: &Plan<'_>,
    options: &Options,
) -> Vec<Stop> {
    let stop = |pose: &Pose, contact: [f64; 2]| {
        let (own, heights) = options.machine.own(at_work(pose, &plan.setup), contact);
        Stop { rapid: false, pose: own, contact: if contact == CLEAR { CLEAR } else { heights } }
    };
    let cut = |it: &Posture| Pose { tip: it.pose.tip + it.out * offset, axis: it.pose.axis };
    let (first, last) = (&stations[0].posture, &stations[stations.len() - 1].posture);
    let mut out = vec![stop(&way_off(run, first, [offset, -1.0], guard, plan, options), CLEAR)];
    // The contact begins at the first station.
    out.push(stop(&cut(first), CLEAR));
    out.extend(stations[1..].iter().map(|it| stop(&cut(&it.posture), it.posture.contact)));
    out.push(stop(&way_off(run, last, [offset, 1.0], guard, plan, options), CLEAR));
    out
}

/// Where the way off the surface ends, on one side of a posture: along the surface where that is clear of the body, else
/// steeper, else straight back along the axis.
fn way_off(
    run: &Run<'_>,
    it: &Posture,
    [offset, side]: [f64; 2],
    guard: &Guard<'_>,
    plan: &Plan<'_>,
    options: &Options,
) -> Pose {
    /// Shares of the way that are tried.
    const TRIED: u32 = 8;
    let (along, lead) = (run.curve.travel(it) * side, options.lead);
    let base = Pose { tip: it.pose.tip + it.out * offset, axis: it.pose.axis };
    let moved = |by: Vec3| Posture { pose: Pose { tip: base.tip + by, axis: base.axis }, ..*it };
    let ways = [along * lead + it.out * (RAMP * lead), (along + it.out) * (lead / 2.0), it.out * (lead / 2.0)];
    let tool = guard.drawn_back();
    let is_clear = |it: &Posture| {
        let over_block = || in_box(&tool, &at_work(&it.pose, &plan.setup), &plan.fixture).is_none();
        guard.is_clear(it) && (matches!(options.machine, Machine::Wire(_)) || over_block())
    };
    let clear = |way: &&Vec3| (1..=TRIED).all(|k| is_clear(&moved(**way * (f64::from(k) / f64::from(TRIED)))));
    ways.iter().find(clear).map_or(base, |way| moved(*way).pose)
}

/// Adds the way from where the cutter was to a run, and out of it again.
fn link(before: Option<Pose>, mut stops: Vec<Stop>, plan: &Plan<'_>, cut: &CutMesh, options: &Options) -> Vec<Stop> {
    let bounds = cut.mesh.bounds();
    let center = plan.setup.place((bounds.min + bounds.max) / 2.0);
    let placed: Vec<Vec3> = cut.mesh.positions().iter().map(|&p| plan.setup.place(p)).collect();
    let body = Box3::of(&placed);
    let radius = bounds.diagonal() / 2.0 + options.stock + options.clearance;
    let out_of = |it: &Stop| match options.machine {
        Machine::Mill(_) => raised(&it.pose, center, radius),
        // A wire leaves over the part.
        Machine::Wire(_) => {
            let at = |y: f64| it.pose.tip.z + it.pose.axis.z * (y - it.pose.tip.y) / it.pose.axis.y;
            let lowest = at(body.min.y).min(at(body.max.y));
            let up = (body.max.z + options.stock + options.clearance - lowest).max(0.0);
            Pose { tip: it.pose.tip + Vec3::z() * up, axis: it.pose.axis }
        }
    };
    let stop = |rapid: bool, pose: Pose| Stop { rapid, pose, contact: CLEAR };
    let (start, end) = (out_of(&stops[0]), out_of(&stops[stops.len() - 1]));
    let mut out = Vec::new();
    match (before, &options.machine) {
        (Some(before), Machine::Mill(_)) => out.extend(over(&before, &start, center).map(|it| stop(true, it))),
        _ => out.push(stop(true, start)),
    }
    out.append(&mut stops);
    out.push(stop(matches!(options.machine, Machine::Mill(_)), end));
    out
}

/// The pose drawn back along its axis to a sphere around the body.
fn raised(pose: &Pose, center: Vec3, radius: f64) -> Pose {
    let d = pose.tip - center;
    let along = d.dot(&pose.axis);
    let way = -along + (along * along - d.norm_squared() + radius * radius).max(0.0).sqrt();
    Pose { tip: pose.at(way.max(0.0)), axis: pose.axis }
}

/// Poses over the sphere from one to another. The tool turns halfway between away from the sphere and up (its shank stays
/// beyond the plane that touches the sphere at the tip, and no machine has to turn farther), goes along the sphere, by way
/// of its top when the two are far apart, and turns to where it is needed.
fn over(from: &Pose, to: &Pose, center: Vec3) -> impl Iterator<Item = Pose> {
    let radius = (from.tip - center).norm().max((to.tip - center).norm());
    let top = Pose { tip: center + Vec3::z() * radius, axis: Vec3::z() };
    let upright = |it: &Pose| {
        let up = (it.tip - center).try_normalize(0.0).unwrap_or_else(Vec3::z) + Vec3::z();
        Pose { tip: it.tip, axis: up.try_normalize(1e-6).unwrap_or(it.axis) }
    };
    let mut way = vec![*from, upright(from), upright(to), *to];
    if angle_between(from.tip - center, to.tip - center) > FRAC_PI_2 / 2.0 {
        way.insert(2, top);
    }
    let steps = move |a: Pose, b: Pose| {
        let (u, v) = (a.tip - center, b.tip - center);
        let turn = angle_between(u, v).max(angle_between(a.axis, b.axis));
        let n = (turn / LINK).ceil().max(1.0) as usize;
        (1..=n).map(move |k| {
            let s = k as f64 / n as f64;
            let direction = (u.normalize() * (1.0 - s) + v.normalize() * s).try_normalize(1e-9).unwrap_or_else(Vec3::z);
            let axis = (a.axis * (1.0 - s) + b.axis * s).try_normalize(1e-9).unwrap_or(b.axis);
            let out = u.norm() * (1.0 - s) + v.norm() * s;
            if k == n { b } else { Pose { tip: center + direction * out, axis } }
        })
    };
    let pairs: Vec<(Pose, Pose)> = way.windows(2).map(|w| (w[0], w[1])).collect();
    pairs.into_iter().flat_map(move |(a, b)| steps(a, b))
}

/// Turns stops into blocks with joints and times.
fn push(
    out: &mut Vec<MillMove>,
    stops: Vec<Stop>,
    (segment, piece): (u32, PieceId),
    options: &Options,
) -> Result<(), Beyond> {
    let machine = &options.machine;
    let poses: Vec<Pose> = stops.iter().map(|it| it.pose).collect();
    let from = out.last().map(|it| it.joints.clone());
    let joints = machine.along(&poses, from.as_deref()).map_err(|it| it.1)?;
    let speeds = machine.speeds();
    for (stop, joints) in stops.iter().zip(joints) {
        let seconds = out.last().map_or(0.0, |last| {
            let of_joints = last.joints.iter().zip(&joints).zip(&speeds).map(|((a, b), speed)| (b - a).abs() / speed);
            let slowest = of_joints.fold(0.0, f64::max);
            let way = [0.0, options.tool.flute].map(|h| (stop.pose.at(h) - last.pose.at(h)).norm());
            if stop.rapid { slowest } else { slowest.max(way[0].max(way[1]) / options.feed) }
        });
        out.push(MillMove {
            rapid: stop.rapid,
            pose: stop.pose,
            contact: stop.contact,
            joints,
            seconds,
            segment,
            piece,
        });
    }
    Ok(())
}
