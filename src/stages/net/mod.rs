//! Nets of geodesic parallel coordinates (Wang, Pellis, Rist, Pottmann, Müller 2019): where they begin, how they are led to their
//! constraints, what they have become.
pub mod laths;
pub mod project;
pub mod stage;
pub mod start;
mod system;
#[cfg(test)]
mod tests;
pub mod verify;

pub use project::{FEASIBLE, Goals, Handle, Optimized, Projection};
pub use system::{Family, Weights};

use crate::{
    mesh::Bvh,
    model::{GeodesicNet, NetFit},
    numeric::{Cancelled, Monitor, sparse::SparseError},
};

/// Why there is no net.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum NetError {
    /// The run was interrupted.
    #[error(transparent)]
    Interrupted(#[from] Cancelled),
    /// The normal equations could not be solved.
    #[error("the equations of the net cannot be solved")]
    Sparse(#[from] SparseError),
    /// There is nothing to begin with.
    #[error(transparent)]
    Start(#[from] StartError),
    /// The iteration left the finite numbers.
    #[error("the net diverged after {iterations} iterations; move handles in more steps, or by less")]
    Diverged {
        /// Iterations made.
        iterations: usize,
    },
    /// A handle names a point that is not there.
    #[error(
        "handle {handle} names the point ({row}, {column}) of a net of {rows} × {columns} points; both count from 0"
    )]
    NoSuchPoint {
        /// Number of the handle.
        handle: usize,
        /// Row that it names.
        row: usize,
        /// Column that it names.
        column: usize,
        /// Rows of the net.
        rows: usize,
        /// Columns of the net.
        columns: usize,
    },
}

/// Why there is no net to begin with.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum StartError {
    /// Too few rows or columns.
    #[error("a net of {rows} × {columns} points is too coarse; take at least 3 × 3")]
    TooCoarse {
        /// Points along a geodesic.
        rows: usize,
        /// Geodesics.
        columns: usize,
    },
    /// The profile is no line.
    #[error("the profile has {points} points and no length; give at least two different ones")]
    ShortProfile {
        /// How many.
        points: usize,
    },
    /// The profile reaches the axis, or is not finite.
    #[error("point {point} of the profile has the radius {radius}: keep the profile off the axis")]
    OnAxis {
        /// Number of the point.
        point: usize,
        /// Its radius, mm.
        radius: f64,
    },
    /// Geodesics that go around so far that nothing is left of the lines across.
    #[error(
        "only {left:.2} of {of:.2} mm of each geodesic would lie between the ends of the profile; take a smaller twist or sweep"
    )]
    Twisted {
        /// Length that is left, mm.
        left: f64,
        /// Length of a geodesic from end to end, mm.
        of: f64,
    },
    /// The profile meets itself.
    #[error("segment {first} of the profile meets segment {second}: the surface would pass through itself")]
    CrossingProfile {
        /// Number of the one segment.
        first: usize,
        /// Number of the other.
        second: usize,
    },
    /// The patch is not a disk.
    #[error(
        "the patch is no disk (Euler characteristic {euler}, {loops} boundary loops): cut it open, or take one piece of it"
    )]
    NoDisk {
        /// V − E + F.
        euler: i64,
        /// Number of boundary loops.
        loops: usize,
    },
    /// No geodesic sets out.
    #[error("no geodesic sets out from the centre in the direction wanted; choose another centre or direction")]
    NoDirection,
    /// Next to nothing of the patch can be covered.
    #[error(
        "the shortest geodesic over the patch is {reach:.3} mm long, its base {base:.3} mm; take a smaller share of the base"
    )]
    Narrow {
        /// Length of the shortest geodesic, mm.
        reach: f64,
        /// Length of the base used, mm.
        base: f64,
    },
}

/// Leads `first` to its `goals`, refines it by subdivision and does so again, `refine` times (figure 11).
pub fn fit(
    first: &GeodesicNet,
    goals: &Goals,
    surface: &Bvh,
    refine: usize,
    monitor: &Monitor,
) -> Result<NetFit, NetError> {
    let mut made = Projection::new(first, goals, None, Some(surface))?.run(goals, &[], monitor)?;
    for _ in 0..refine {
        let finer = made.net.subdivided();
        let before = (made.iterations, made.seconds);
        made = Projection::new(&finer, goals, None, Some(surface))?.run(goals, &[], monitor)?;
        made.iterations += before.0;
        made.seconds += before.1;
    }
    let Optimized { net, residual, iterations, seconds, .. } = made;
    Ok(NetFit { net, residual, iterations, seconds, ..NetFit::default() })
}

/// Steps in which the fairness of a bent net fades.
const FADE: usize = 8;

/// Bends `net` by handles, all edges and angles kept: they travel in about so many `steps`, then second differences with the
/// weight `fairness` fade away.
pub fn bend(
    net: &GeodesicNet,
    handles: &[Handle],
    steps: usize,
    fairness: f64,
    iterations: usize,
    monitor: &Monitor,
) -> Result<NetFit, NetError> {
    let mut weights: Weights = [0.0; Family::ALL.len()];
    for family in [Family::Isometry, Family::Diagonals, Family::Handle] {
        weights[family as usize] = 1.0;
    }
    let mut start = weights;
    start[Family::Fairness as usize] = fairness;
    let goals = Goals { start, end: weights, travel: steps, fade: FADE, most: iterations };
    let made = Projection::new(net, &goals, None, None)?.run(&goals, handles, monitor)?;
    let strain = verify::strains(net, &made.net).iter().map(|it| it.map_or(0.0, |it| it.amount())).collect();
    let Optimized { net: bent, residual, iterations, seconds, missed, .. } = made;
    let reference = Some(net.clone());
    Ok(NetFit { net: bent, residual, iterations, seconds, missed, reference, strain, ..NetFit::default() })
}
