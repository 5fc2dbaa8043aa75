//! What a folded net is measured by.
use std::f64::consts::TAU;

use super::{
    net::{Degenerate, Net},
    terms::{FoldPoint, angle_values},
};
use crate::{
    geom::{Vec3, angle_between},
    model::FoldFigures,
};

/// Measures a net whose vertices are at `x`.
pub fn figures(net: &Net, folds: &[FoldPoint], x: &[Vec3]) -> FoldFigures {
    let stretch: Vec<f64> = net
        .edges
        .iter()
        .map(|&[a, b]| {
            let [l, l0] = [x, &net.flat].map(|x| (x[a as usize] - x[b as usize]).norm());
            (l - l0).abs() / l0
        })
        .collect();
    let gaps: Vec<f64> = net.points.iter().map(|it| (it.sides[0].at(x) - it.sides[1].at(x)).norm()).collect();
    let angle = |it: &FoldPoint| it.angle(x, net.points[it.point].leftward).abs();
    let angles_of =
        |straight: bool| -> Vec<f64> { folds.iter().filter(|it| it.straight == straight).map(angle).collect() };
    let (angles, straight) = (angles_of(false), angles_of(true));
    let residuals: Vec<f64> = net.stars.iter().flat_map(|it| angle_values(it, x)).map(f64::abs).collect();
    let defect = |centre: u32, around: &[u32]| {
        let e = |k: usize| x[around[k % around.len()] as usize] - x[centre as usize];
        (0..around.len()).map(|k| angle_between(e(k), e(k + 1))).sum::<f64>() - TAU
    };
    let defects: Vec<f64> =
        net.stars.iter().filter(|it| it.around.len() == 4).map(|it| defect(it.centre, &it.around).abs()).collect();
    let mean = |list: &[f64]| list.iter().fold(0.0, |sum, it| sum + it) / list.len().max(1) as f64;
    let most = |list: &[f64]| list.iter().copied().fold(0.0, f64::max);
    let crease_points = net.crease_points() - net.excluded(Degenerate::Straight);
    FoldFigures {
        crease_points,
        straight: straight.len(),
        excluded: crease_points - angles.len(),
        folded: folds.iter().filter(|it| !it.straight && it.folds(x)).count(),
        mean_fold: mean(&angles),
        least_fold: angles.iter().copied().reduce(f64::min).unwrap_or(0.0),
        straight_fold: mean(&straight),
        stretch_mean: mean(&stretch),
        stretch_max: most(&stretch),
        continuity_mean: mean(&gaps),
        continuity_max: most(&gaps),
        net_residual: most(&residuals),
        angle_defect: most(&defects),
    }
}
