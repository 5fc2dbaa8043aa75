//! Programs for a three-axis mill: a ball nose roughs the outer side of a mould segment by layers, then finishes it along meridians
//! so that the ridges between passes stay below a height; at last the ball is swept over samples of the surface.
//!
//! The segment lies with its middle meridian up: machine x, y, z are y, z, x of its STL.
use super::segments::Placed;
use crate::{
    geom::{Vec2, Vec3, closest_on_segment, polyline::simplify},
    mesh::{Bvh, FaceId, TriMesh, sweep::Samples},
    model::MoldProgram,
    numeric::{Cancelled, Monitor},
};

/// The cutter and what it should leave.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mill {
    /// Radius of the ball, mm.
    pub radius: f64,
    /// Height of the ridges between finishing passes, mm.
    pub scallop: f64,
    /// Left by roughing, mm.
    pub allowance: f64,
    /// Most that one layer of roughing takes, mm.
    pub layer: f64,
    /// Height of rapid moves over the segment, mm.
    pub clearance: f64,
    /// Speed of cuts, mm/min, and of the spindle, 1/min; passed on.
    pub speeds: [f64; 2],
}

/// How near the ball is let down to the surface, mm.
const TOUCH: f64 = 5e-4;
/// Distance between points of a pass as a share of the ball's radius, and what may be left out between them, mm.
const STEP: f64 = 0.1;
const CHORD: f64 = 1e-3;
/// Lettings down of one point, at most.
const TRACES: usize = 400;
/// Share of the scallop that passes are laid for: the rest is for slopes that change between them.
const CAREFUL: f64 = 0.8;
/// Least distance of passes as a share of the width wanted: the rest is a wall that no pass can follow.
const LEAST: f64 = 0.05;
/// Distance of roughing passes as a share of the radius.
const ROUGH: f64 = 0.8;
/// Distance of the samples that the sweep looks at, as a share of the distance of passes.
const FINE: f64 = 0.25;

/// The height of the ball's centre over a place, let down from above until it touches: steps as long as the way is free for sure.
struct Drop<'a> {
    surface: &'a Bvh,
    radius: f64,
    top: f64,
    floor: f64,
}

impl Drop<'_> {
    fn height(&self, at: Vec2, near: &mut (f64, FaceId)) -> f64 {
        // No slope lets the centre rise by more than this between neighbours; where it does, it starts from the top.
        let mut z = (near.0 + 2.0 * self.radius).min(self.top);
        for _ in 0..TRACES {
            let found = self.surface.closest_from(Vec3::new(at.x, at.y, z), near.1);
            near.1 = found.face;
            let gap = found.distance - self.radius;
            if gap < 0.0 && z < self.top {
                z = self.top.min(z - gap + self.radius);
                continue;
            }
            if gap <= TOUCH || z <= self.floor {
                break;
            }
            z -= gap;
        }
        near.0 = z.max(self.floor);
        near.0
    }
}

/// Points of the ball's centre along one meridian.
type Pass = Vec<Vec3>;

/// The program of a segment, verified.
pub(super) fn program(placed: &Placed, mill: &Mill, monitor: &Monitor) -> Result<MoldProgram, Cancelled> {
    let down = |p: Vec3| Vec3::new(p.y, p.z, p.x);
    let lay = |mesh: &TriMesh| {
        let points: Vec<Vec3> = mesh.positions().iter().map(|&p| down(p)).collect();
        mesh.with_positions(crate::mesh::Field::from_vec(points))
    };
    let (skin, patch) = (lay(&placed.beyond), lay(&placed.patch));
    let surface = Bvh::new(&skin);
    let bounds = patch.bounds();
    let top = bounds.max.z + mill.radius + mill.clearance;
    let drop = Drop { surface: &surface, radius: mill.radius, top, floor: bounds.min.z - mill.radius };
    let width = 2.0 * (2.0 * mill.radius * CAREFUL * mill.scallop - (CAREFUL * mill.scallop).powi(2)).max(0.0).sqrt();
    // The centre stands beside the point that it cuts where the surface slopes.
    let reach = Vec2::repeat(mill.radius);
    let (low, high) = (bounds.min.xy() - reach, bounds.max.xy() + reach);
    let count = ((high.y - low.y) / (STEP * mill.radius)).ceil() as usize;
    let pass = |x: f64| -> Pass {
        let mut near = (top, FaceId(0));
        let at = |k: usize| Vec2::new(x, low.y + (high.y - low.y) * k as f64 / count as f64);
        (0..=count).map(at).map(|p| Vec3::new(p.x, p.y, drop.height(p, &mut near))).collect()
    };
    let finish = passes(&pass, [low.x, high.x], width, monitor)?;
    let mut moves = roughing_moves(&finish, [bounds.min.z, bounds.max.z], top, mill);
    let roughing = moves.len();
    for (k, it) in finish.iter().enumerate() {
        lead(&mut moves, it.clone(), k % 2 == 1, top);
    }
    let [gouge, scallop] = swept(&patch, &moves, roughing, mill, FINE * width, monitor)?;
    // The tip is what a controller follows.
    moves.iter_mut().for_each(|it| it.1.z -= mill.radius);
    let (segment, passes) = (placed.name.clone(), finish.len());
    Ok(MoldProgram { segment, moves, radius: mill.radius, speeds: mill.speeds, passes, gouge, scallop })
}

/// Passes from side to side, nowhere farther apart than `width`.
fn passes(
    pass: &dyn Fn(f64) -> Pass,
    [low, high]: [f64; 2],
    width: f64,
    monitor: &Monitor,
) -> Result<Vec<Pass>, Cancelled> {
    let mut out: Vec<Pass> = vec![pass(low)];
    let mut step = width;
    while let Some(last) = out.last().filter(|it| it[0].x < high) {
        monitor.check()?;
        let from = last[0].x;
        let next = pass((from + step).min(high));
        // On a slope passes are farther apart than their tracks seen from above.
        let apart = widest(last, &next);
        if apart > width && step > LEAST * width {
            step *= (0.98 * width / apart).max(0.25);
            continue;
        }
        out.push(next);
        step = (1.5 * step).min(width);
    }
    Ok(out)
}

/// Cuts of layers from the top down, each only where it takes something.
fn roughing_moves(finish: &[Pass], [bottom, highest]: [f64; 2], top: f64, mill: &Mill) -> Vec<(bool, Vec3)> {
    let mut moves = Vec::new();
    let rough = thinned(finish, ROUGH * mill.radius);
    let mut ceiling = highest + mill.radius;
    while ceiling > bottom {
        let floor = ceiling - mill.layer;
        for (k, it) in rough.iter().enumerate() {
            let raised = |p: &Vec3| Vec3::new(p.x, p.y, (p.z + mill.allowance).max(floor));
            let under = |p: &Vec3| p.z + mill.allowance < ceiling;
            for run in it.chunk_by(|a, b| under(a) == under(b)).filter(|run| under(&run[0]) && run.len() > 1) {
                lead(&mut moves, run.iter().map(raised).collect(), k % 2 == 1, top);
            }
        }
        ceiling = floor;
    }
    moves
}

/// Largest distance between points of two passes at the same place along them.
fn widest(a: &Pass, b: &Pass) -> f64 {
    a.iter().zip(b).map(|(p, q)| (p - q).norm()).fold(0.0, f64::max)
}

/// Passes that are at most so far apart, the first and the last among them.
fn thinned(passes: &[Pass], apart: f64) -> Vec<Pass> {
    let mut out: Vec<Pass> = Vec::new();
    for (k, it) in passes.iter().enumerate() {
        let last = k + 1 == passes.len();
        if last || out.last().is_none_or(|kept| passes.get(k + 1).is_some_and(|next| widest(kept, next) > apart)) {
            out.push(it.clone());
        }
    }
    out
}

/// Appends a cut from rapid height and back, without points that lie on a line with others.
fn lead(moves: &mut Vec<(bool, Vec3)>, mut cut: Pass, backwards: bool, top: f64) {
    let flat: Vec<Vec2> = cut.iter().map(|p| Vec2::new(p.y, p.z)).collect();
    cut = simplify(&flat, false, CHORD, &|_| false).into_iter().map(|k| cut[k]).collect();
    if backwards {
        cut.reverse();
    }
    let over = |p: Vec3| Vec3::new(p.x, p.y, top);
    moves.push((true, over(cut[0])));
    let end = over(cut[cut.len() - 1]);
    moves.extend(cut.into_iter().map(|p| (false, p)));
    moves.push((true, end));
}

/// How deep all moves cut into the patch, and how much is left on it after the finishing ones, mm.
fn swept(
    patch: &TriMesh,
    moves: &[(bool, Vec3)],
    roughing: usize,
    mill: &Mill,
    spacing: f64,
    monitor: &Monitor,
) -> Result<[f64; 2], Cancelled> {
    let samples = Samples::new(patch, |_| Some(spacing));
    let mut left = vec![f64::INFINITY; samples.points.len()];
    let mut gouge = 0.0_f64;
    for (k, pair) in moves.windows(2).enumerate() {
        if k % 256 == 0 {
            monitor.check()?;
        }
        let (a, edge) = (pair[0].1, pair[1].1 - pair[0].1);
        samples.near(&a, &pair[1].1, mill.radius + 4.0 * mill.scallop, |i| {
            let clearance = closest_on_segment(&(samples.points[i] - a), &edge).1.sqrt() - mill.radius;
            gouge = gouge.max(-clearance);
            if k + 1 > roughing {
                left[i] = left[i].min(clearance.max(0.0));
            }
        });
    }
    Ok([gouge, left.into_iter().fold(0.0, f64::max)])
}
