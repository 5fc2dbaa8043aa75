//! Ribs of sheet stock in place of a solid mould: upright ones along meridians and level ones along parallels, which slide into each
//! other by slots; and the half section for a lathe.
use super::Revolution;
use crate::{
    geom::{Vec2, polygon::nearest_on_segment},
    model::Part,
};

/// How ribs are made.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ribs {
    /// Thickness of the stock and width of the slots, mm.
    pub thickness: f64,
    /// Largest distance between ribs, mm.
    pub spacing: f64,
    /// Depth of the ribs from the profile inwards, where that is narrowest, mm.
    pub depth: f64,
}

fn part(name: String, outline: Vec<Vec2>) -> Part {
    Part { name, contours: vec![outline], marks: vec![] }
}

/// The half section between the profile and the axis, for a lathe or a hot wire.
pub(super) fn half_section(profile: &[Vec2]) -> Part {
    let (first, last) = (profile[0], profile[profile.len() - 1]);
    let mut outline = vec![Vec2::new(0.0, first.y)];
    outline.extend(profile);
    outline.push(Vec2::new(0.0, last.y));
    part("profile".into(), outline)
}

/// Ribs of mould number `mold` between two rows over an angle: upright ones with slots from behind, level ones with slots from the
/// front, both half through.
pub(super) fn ribs(revolution: &Revolution, mold: usize, rows: [usize; 2], angle: f64, options: &Ribs) -> Vec<Part> {
    let profile = &revolution.profile[rows[0]..=rows[1]];
    let [low, high] = [profile[0].y, profile[profile.len() - 1].y];
    let narrow = profile.iter().map(|p| p.x).fold(f64::INFINITY, f64::min);
    let widest = profile.iter().map(|p| p.x).fold(0.0, f64::max);
    let back = (narrow - options.depth).max(narrow / 3.0);
    let count = |length: f64| (length / options.spacing).ceil().max(1.0) as usize + 1;
    let margin = 1.5 * options.thickness;
    let level = count(high - low - 2.0 * margin);
    let heights: Vec<f64> =
        (0..level).map(|k| low + margin + (high - low - 2.0 * margin) * k as f64 / (level - 1) as f64).collect();
    let upright = count(widest * angle);
    let longitudes: Vec<f64> = (0..upright).map(|k| angle * (k as f64 / (upright - 1) as f64 - 0.5)).collect();
    let half = options.thickness / 2.0;
    let mut out = Vec::new();
    for k in 0..upright {
        let mut outline = profile.to_vec();
        outline.push(Vec2::new(back, high));
        for &z in heights.iter().rev() {
            let depth = (back + radius_at(profile, z)) / 2.0;
            outline.extend([
                Vec2::new(back, z + half),
                Vec2::new(depth, z + half),
                Vec2::new(depth, z - half),
                Vec2::new(back, z - half),
            ]);
        }
        outline.push(Vec2::new(back, low));
        // Profiles climb on the outside of what is on their left: the outline runs counter-clockwise.
        out.push(part(format!("R{}-up{}", mold + 1, k + 1), outline));
    }
    for (k, &z) in heights.iter().enumerate() {
        let radius = radius_at(profile, z);
        let depth = (back + radius) / 2.0;
        let ends = [angle / 2.0 + margin / depth, -angle / 2.0 - margin / depth];
        let at = |radius: f64, angle: f64| Vec2::new(radius * angle.cos(), radius * angle.sin());
        let facets = ((ends[0] - ends[1]) / FACET).ceil().max(1.0) as usize;
        let arc = |radius: f64, from: f64, to: f64| {
            (0..=facets).map(move |i| at(radius, from + (to - from) * i as f64 / facets as f64))
        };
        let mut outline: Vec<Vec2> = arc(back, ends[0], ends[1]).collect();
        let mut before = ends[1];
        for &longitude in &longitudes {
            let wide = (half / radius).asin();
            outline.extend(arc(radius, before, longitude - wide));
            let along = at(1.0, longitude);
            let side = Vec2::new(-along.y, along.x) * half;
            outline.extend([along * depth - side, along * depth + side]);
            before = longitude + wide;
        }
        outline.extend(arc(radius, before, ends[0]));
        out.push(part(format!("R{}-level{}", mold + 1, k + 1), outline));
    }
    out
}

/// Angle of the facets of level ribs, rad: 0.02 mm off on a radius of 60 mm.
const FACET: f64 = 0.05;

/// Radius of a profile, whose heights rise, at a height.
fn radius_at(profile: &[Vec2], z: f64) -> f64 {
    let k = profile.partition_point(|p| p.y <= z).clamp(1, profile.len() - 1);
    let (a, b) = (profile[k - 1], profile[k]);
    if b.y > a.y { a.x + (b.x - a.x) * (z - a.y) / (b.y - a.y) } else { nearest_on_segment(Vec2::new(a.x, z), a, b).x }
}
