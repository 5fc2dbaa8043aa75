//! Panels: which strips and rows they take, which mould they need, and whether all strips are the same when laid flat.
use super::Revolution;
use crate::{
    geom::{Vec2, cross2},
    model::{GeodesicNet, MoldPanel},
};

/// Rows and strips of a panel; 0 for all.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PanelSize {
    /// Rows of quads.
    pub rows: usize,
    /// Strips.
    pub strips: usize,
}

fn cuts(count: usize, each: usize) -> Vec<[usize; 2]> {
    let each = if each == 0 { count } else { each };
    (0..count.div_ceil(each)).map(|k| [k * each, ((k + 1) * each).min(count)]).collect()
}

/// Total |Gaussian curvature| between two rows over an angle, rad: the turn of dr/ds on each parallel times the angle, by the
/// theorem of Gauss and Bonnet; the same on every surface isometric to it.
pub(super) fn total_curvature(revolution: &Revolution, rows: [usize; 2], angle: f64) -> f64 {
    let slope = |k: usize| {
        let d = revolution.profile[k + 1] - revolution.profile[k];
        d.x / d.norm()
    };
    (rows[0] + 1..rows[1]).map(|k| (slope(k) - slope(k - 1)).abs()).sum::<f64>() * angle
}

/// The panels, row by row, and the total curvature of a panel of each row. Those under `flat`, rad, need no mould.
pub(super) fn panels(
    net: &GeodesicNet,
    revolution: &Revolution,
    step: f64,
    size: PanelSize,
    flat: f64,
) -> (Vec<MoldPanel>, Vec<f64>) {
    let columns = cuts(net.columns - 1, size.strips);
    let rows = cuts(net.rows - 1, size.rows);
    let widest = columns.iter().map(|it| it[1] - it[0]).max().unwrap_or(0);
    let curvature: Vec<f64> = rows.iter().map(|&it| total_curvature(revolution, it, step * widest as f64)).collect();
    let panel = |k: usize, rows: [usize; 2], columns: [usize; 2]| MoldPanel {
        rows,
        columns,
        mold: (curvature[k] > flat).then_some(k),
    };
    let all = rows.iter().enumerate().flat_map(|(k, &rows)| columns.iter().map(move |&it| (k, rows, it)));
    (all.map(|(k, rows, columns)| panel(k, rows, columns)).collect(), curvature)
}

/// Largest distance between the outline of a strip laid flat, as its quads are cut into triangles, and the mean of all strips, each
/// moved to lie best on the first; mm.
pub(super) fn congruence(net: &GeodesicNet) -> f64 {
    let strips: Vec<Vec<Vec2>> = (0..net.columns - 1).map(|j| unrolled(net, j)).collect();
    let aligned: Vec<Vec<Vec2>> = strips.iter().map(|it| laid_on(it, &strips[0])).collect();
    let mean: Vec<Vec2> =
        (0..strips[0].len()).map(|k| aligned.iter().map(|it| it[k]).sum::<Vec2>() / aligned.len() as f64).collect();
    let apart = |strip: &Vec<Vec2>| strip.iter().zip(&mean).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
    aligned.iter().map(apart).fold(0.0, f64::max)
}

/// The points of a strip in the plane, those of its two geodesics in turns.
fn unrolled(net: &GeodesicNet, j: usize) -> Vec<Vec2> {
    let distance = |a: (usize, usize), b: (usize, usize)| (net.at(a.0, a.1) - net.at(b.0, b.1)).norm();
    // The point at given distances from two others, to the left of the way from the first to the second.
    let third = |a: Vec2, b: Vec2, from_a: f64, from_b: f64| {
        let length = (b - a).norm();
        let along = (length * length + from_a * from_a - from_b * from_b) / (2.0 * length);
        let aside = (from_a * from_a - along * along).max(0.0).sqrt();
        let way = (b - a) / length;
        a + way * along + Vec2::new(-way.y, way.x) * aside
    };
    let mut out = vec![Vec2::zeros(), Vec2::new(net.across(0, j), 0.0)];
    for i in 1..net.rows {
        let (p, q) = (out[2 * i - 2], out[2 * i - 1]);
        let left = third(p, q, net.along(i - 1, j), distance((i, j), (i - 1, j + 1)));
        let right = third(left, q, net.across(i, j), net.along(i - 1, j + 1));
        out.extend([left, right]);
    }
    out
}

/// Points moved rigidly to lie best on others (Kabsch in the plane).
fn laid_on(points: &[Vec2], others: &[Vec2]) -> Vec<Vec2> {
    let mean = |it: &[Vec2]| it.iter().sum::<Vec2>() / it.len() as f64;
    let (from, to) = (mean(points), mean(others));
    let (mut cosine, mut sine) = (0.0, 0.0);
    for (p, q) in points.iter().zip(others) {
        cosine += (p - from).dot(&(q - to));
        sine += cross2(p - from, q - to);
    }
    let angle = sine.atan2(cosine);
    points.iter().map(|p| crate::geom::polygon::turned(p - from, angle) + to).collect()
}
