//! Gridshells of laths (§6.2.1 of the paper): two families of geodesics that cross, each lath straight when it lies flat, with a hole
//! at every crossing.
use super::start::Layout;
use crate::{
    geom::{Vec2, Vec3, stroke_font::letter},
    model::{GeodesicNet, Lath, LathCrossing, Mark, Operation, Part},
};

/// How laths are made.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stock {
    /// Width, mm.
    pub width: f64,
    /// Diameter of the holes, mm.
    pub hole: f64,
    /// Length of the bars that they are cut from, mm.
    pub length: f64,
}

/// Share of the mean edge of both nets within which two geodesics on one surface meet.
const REACH: f64 = 0.1;
/// Corners of a hole.
const ROUND: usize = 32;
/// Height of lettering as a share of the width.
const LETTERS: f64 = 0.25;

/// Where a second family begins: in the middle of the first, its middle geodesic turned by an angle, rad.
pub fn across(first: &GeodesicNet, layout: &Layout, angle: f64) -> Layout {
    let [i, j] = [first.rows / 2, first.columns / 2];
    let direction = first.frame(i, j).map(|it| it.along * angle.cos() + it.normal.cross(&it.along) * angle.sin());
    Layout { center: Some(first.at(i, j)), direction: direction.or(layout.direction), ..*layout }
}

/// The laths along the geodesics of two nets on one surface, A1, A2, … and B1, B2, …, with their crossings in order and the bars
/// that they are cut from: the longest first, each from the first bar with room for it. A lath that is longer than a bar has
/// none.
pub fn laths(first: &GeodesicNet, second: &GeodesicNet, stock: &Stock) -> Vec<Lath> {
    let line = |net: &GeodesicNet, j: usize| (0..net.rows).map(|i| net.at(i, j)).collect::<Vec<Vec3>>();
    let families = [("A", first), ("B", second)]
        .map(|(name, net)| (0..net.columns).map(|j| (format!("{name}{}", j + 1), line(net, j))).collect::<Vec<_>>());
    let reach = REACH * (first.mean_edge() + second.mean_edge()) / 2.0;
    let lath = |(name, points): &(String, Vec<Vec3>)| Lath {
        name: name.clone(),
        length: points.windows(2).map(|it| (it[1] - it[0]).norm()).sum(),
        crossings: vec![],
        bar: None,
    };
    let mut out: Vec<Vec<Lath>> = families.iter().map(|it| it.iter().map(lath).collect()).collect();
    for (a, (own, line)) in families[0].iter().enumerate() {
        for (b, (other, across)) in families[1].iter().enumerate() {
            let Some(([s, t], gap)) = crossing(line, across, reach) else { continue };
            out[0][a].crossings.push(LathCrossing { other: other.clone(), at: s, gap });
            out[1][b].crossings.push(LathCrossing { other: own.clone(), at: t, gap });
        }
    }
    let mut all: Vec<Lath> = out.concat();
    all.iter_mut().for_each(|it| it.crossings.sort_by(|a, b| a.at.total_cmp(&b.at)));
    let mut order: Vec<usize> = (0..all.len()).filter(|&k| all[k].length <= stock.length).collect();
    order.sort_by(|&a, &b| all[b].length.total_cmp(&all[a].length).then(a.cmp(&b)));
    let mut bars: Vec<f64> = Vec::new();
    for k in order {
        let bar = bars.iter().position(|used| used + all[k].length <= stock.length).unwrap_or(bars.len());
        if bar == bars.len() {
            bars.push(0.0);
        }
        all[k].bar = Some((bar, bars[bar]));
        bars[bar] += all[k].length;
    }
    all
}

/// Lengths along two lines to where they are nearest, and how near that is; `None` where that is farther than `reach`.
fn crossing(line: &[Vec3], other: &[Vec3], reach: f64) -> Option<([f64; 2], f64)> {
    let mut best: Option<([f64; 2], f64)> = None;
    let mut along = 0.0;
    for pair in line.windows(2) {
        let (length, mut across) = ((pair[1] - pair[0]).norm(), 0.0);
        for it in other.windows(2) {
            let wide = (it[1] - it[0]).norm();
            let middles = (pair[0] + pair[1] - it[0] - it[1]).norm() / 2.0;
            if middles <= reach + (length + wide) / 2.0 {
                let ([s, t], gap) = nearest(pair[0], pair[1] - pair[0], it[0], it[1] - it[0]);
                if gap <= reach && best.is_none_or(|it| gap < it.1) {
                    best = Some(([along + s * length, across + t * wide], gap));
                }
            }
            across += wide;
        }
        along += length;
    }
    best
}

/// Shares of the segments p + s u and q + t v at which they are nearest, and their distance there.
fn nearest(p: Vec3, u: Vec3, q: Vec3, v: Vec3) -> ([f64; 2], f64) {
    let (a, b, c, w) = (u.dot(&u), u.dot(&v), v.dot(&v), p - q);
    let (d, e) = (u.dot(&w), v.dot(&w));
    let share = |top: f64, bottom: f64| (top / bottom.max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
    let mut s = share(b * e - c * d, a * c - b * b);
    let t = share(b * s + e, c);
    s = share(b * t - d, a);
    ([s, t], (w + u * s - v * t).norm())
}

/// A lath as it lies flat: its outline from (0, 0) along x, a hole at every crossing with the name of the lath there beside it, its
/// own name at its beginning.
pub fn drawing(lath: &Lath, stock: &Stock) -> Part {
    let half = stock.width / 2.0;
    let corner = |x: f64, y: f64| Vec2::new(x, y);
    let outline = vec![corner(0.0, -half), corner(lath.length, -half), corner(lath.length, half), corner(0.0, half)];
    // Holes that would break through an end are marked only.
    let room = stock.hole / 2.0 + 0.1 * stock.width;
    let bored = lath.crossings.iter().filter(|it| it.at > room && it.at < lath.length - room);
    let hole = |it: &LathCrossing| {
        let place = |k: usize| {
            let (sin, cos) = (std::f64::consts::TAU * k as f64 / ROUND as f64).sin_cos();
            Vec2::new(it.at + stock.hole / 2.0 * cos, -stock.hole / 2.0 * sin)
        };
        (0..ROUND).map(place).collect::<Vec<_>>()
    };
    let mut contours = vec![outline];
    contours.extend(bored.map(hole));
    let height = LETTERS * stock.width;
    let text = |text: &str, at: Vec2| {
        letter(text, height).strokes.into_iter().map(move |stroke| Mark {
            operation: Operation::Text,
            points: stroke.into_iter().map(|p| p + at).collect(),
            closed: false,
        })
    };
    let mut marks: Vec<Mark> = text(&lath.name, Vec2::new(0.2 * stock.width, -half + 0.1 * stock.width)).collect();
    for it in &lath.crossings {
        let mark = |y: [f64; 2]| Mark {
            operation: Operation::Registration,
            points: y.map(|y| Vec2::new(it.at, y)).to_vec(),
            closed: false,
        };
        marks.push(mark([0.7 * half, 0.95 * half]));
        marks.extend(text(&it.other, Vec2::new(it.at + 0.1 * stock.width, 0.3 * half)));
    }
    Part { name: format!("lath-{}", lath.name), contours, marks }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn laths_of_a_plane_cross_where_lines_do() {
        let first = GeodesicNet::from_fn(11, 5, |i, j| Vec3::new(100.0 * i as f64, 200.0 * j as f64, 0.0));
        // At 45° through the points (200 k, 0).
        let second =
            GeodesicNet::from_fn(11, 4, |i, j| Vec3::new(200.0 * j as f64 + 80.0 * i as f64, 80.0 * i as f64, 0.0));
        let stock = Stock { width: 40.0, hole: 8.0, length: 2200.0 };
        let all = laths(&first, &second, &stock);
        let of = |name: &str| all.iter().find(|it| it.name == name).unwrap();
        let at = |lath: &Lath| lath.crossings.iter().map(|it| it.at.round()).collect::<Vec<f64>>();
        assert_eq!(at(of("A2")), [200.0, 400.0, 600.0, 800.0]);
        assert_eq!(at(of("B1")), [0.0, 283.0, 566.0, 849.0, 1131.0]);
        assert!(all.iter().flat_map(|it| &it.crossings).all(|it| it.gap < 1e-9));
        // Of 5 laths of 1000 and 4 of 1131 mm a bar of 2200 holds none of the longer ones twice.
        let bars = all.iter().filter_map(|it| it.bar).map(|it| it.0).max().unwrap() + 1;
        assert_eq!(bars, 5);
        let part = drawing(of("A2"), &stock);
        crate::geom::outline::check_outline(&part.contours).unwrap();
        assert_eq!(part.contours.len(), 1 + 4);
        // A lath that is longer than a bar is not cut from one.
        assert!(
            laths(&first, &second, &Stock { length: 1100.0, ..stock }).iter().filter(|it| it.bar.is_none()).count()
                == 4
        );
    }
}
