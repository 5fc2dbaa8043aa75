//! Panels made planar: what is not is split into triangles, and panels are joined as long as they stay planar. Strips.
use super::{
    border::{Border, planarity},
    chord::{Chord, Form},
    decompose::{Decomposition, Terms},
    patch::Patch,
    triangulate::within,
};
use crate::{
    geom::{Box2, Vec2, Vec3, signed_area},
    numeric::{Cancelled, Monitor},
    surface::paths::DisjointSets,
};

/// Unit normal of an outline in space, by its area vector.
pub(super) fn normal(border: &Border, outline: &[usize]) -> Vec3 {
    let origin = border.xyz[outline[0]];
    let area: Vec3 = outline.windows(2).map(|w| (border.xyz[w[0]] - origin).cross(&(border.xyz[w[1]] - origin))).sum();
    area.try_normalize(0.0).unwrap_or_else(Vec3::zeros)
}

/// Area of an outline in the plane, mm².
pub(super) fn area(border: &Border, outline: &[usize]) -> f64 {
    let points: Vec<Vec2> = outline.iter().map(|&i| border.uv[i]).collect();
    signed_area(&points)
}

/// Diagonal of the box around an outline in the plane, mm.
pub(super) fn size(border: &Border, outline: &[usize]) -> f64 {
    Box2::of(outline.iter().map(|&i| &border.uv[i])).size().norm()
}

/// Half the thickness of an outline, in shares of what the terms allow for its size.
fn thickness(border: &Border, outline: &[usize], terms: &Terms) -> f64 {
    let thickness = border.thickness(normal(border, outline), outline.iter().copied());
    thickness / terms.tolerance.min(terms.planarity * size(border, outline)).max(f64::MIN_POSITIVE)
}

/// The corners of a panel if it lies between two chords without a common end.
pub(super) fn quadrilateral(outline: &[usize], n: usize) -> Option<[usize; 4]> {
    let last = (outline[0], outline[outline.len() - 1]);
    let mut corners = Vec::with_capacity(4);
    for (a, b) in outline.windows(2).map(|w| (w[0], w[1])).filter(|(a, b)| b - a > 1) {
        corners.extend([a, b]);
    }
    if last.1 - last.0 < n - 1 {
        corners.extend([last.0, last.1]);
    }
    corners.sort_unstable();
    let corners: [usize; 4] = corners.try_into().ok()?;
    corners.windows(2).all(|w| w[0] < w[1]).then_some(corners)
}

/// An outline without the slits that it goes into and out of again: there both sides of the slit are in one panel.
pub(super) fn without_spurs(border: &Border, outline: &[usize]) -> Vec<usize> {
    /// Both sides of a slit are the same in space, and in the plane but for rounding; those of a seam lie apart there.
    const SAME: f64 = 1e-9;
    let near = SAME * size(border, outline);
    let same = |a: usize, b: usize| border.xyz[a] == border.xyz[b] && (border.uv[a] - border.uv[b]).norm() <= near;
    let mut out: Vec<usize> = Vec::with_capacity(outline.len());
    for &i in outline {
        // Out of a slit: this point was passed on the way in, the one between is its end or what is left of it.
        if out.len() > 1 && same(out[out.len() - 2], i) {
            out.pop();
        } else {
            out.push(i);
        }
    }
    // The slit may lie where the outline begins.
    while out.len() > 3 {
        let n = out.len();
        if same(out[n - 1], out[1]) {
            out.remove(0);
            out.pop();
        } else if same(out[n - 2], out[0]) {
            out.truncate(n - 2);
        } else {
            break;
        }
    }
    out
}

/// Splits panels that are thicker than the terms allow, save quadrilaterals, by the best triangulation of their outline.
pub(super) fn split(
    patch: &Patch,
    form: &Form,
    border: &Border,
    it: Decomposition,
    terms: &Terms,
    monitor: &Monitor,
) -> Result<Decomposition, Cancelled> {
    let mut chords: Vec<([usize; 2], Chord)> = it.chords.iter().map(|link| (link.ends, link.chord)).collect();
    let mut scratch = Vec::new();
    for outline in &it.panels {
        if quadrilateral(outline, border.len()).is_some() || thickness(border, outline, terms) <= 1.0 {
            continue;
        }
        for (i, k) in within(patch, form, border, outline, terms, monitor)?.unwrap_or_default() {
            if outline.windows(2).any(|w| (w[0], w[1]) == (i, k)) {
                continue;
            }
            let chord = Chord::trace(patch, form, border.vertices[i], border.vertices[k], &mut scratch);
            chords.extend(chord.map(|chord| ([i, k], chord)));
        }
    }
    Ok(Decomposition::new(border.len(), chords))
}

/// Joins panels across chords, the flattest union first, as long as it is planar within the terms.
pub(super) fn merged(border: &Border, it: Decomposition, terms: &Terms) -> Decomposition {
    let Decomposition { mut panels, chords: mut open } = it;
    let mut sets = DisjointSets::new(panels.len());
    let union = |panels: &[Vec<usize>], a: usize, b: usize| -> (f64, Vec<usize>) {
        // Outlines ascend, and so does their union.
        let mut outline = [&panels[a][..], &panels[b][..]].concat();
        outline.sort_unstable();
        outline.dedup();
        let warped = quadrilateral(&outline, border.len())
            .is_some_and(|corners| planarity(corners.map(|i| border.xyz[i])) > terms.planarity);
        // Panels folded flat onto each other are in one plane, too.
        let folded = normal(border, &panels[a]).dot(&normal(border, &panels[b])) <= 0.0;
        (if warped || folded { f64::INFINITY } else { thickness(border, &outline, terms) }, outline)
    };
    let mut prices: Vec<f64> = open.iter().map(|it| union(&panels, it.panels[0], it.panels[1]).0).collect();
    loop {
        let cheapest = (0..open.len()).min_by(|&a, &b| prices[a].total_cmp(&prices[b])).filter(|&k| prices[k] <= 1.0);
        let Some(k) = cheapest else { break };
        let link = open.remove(k);
        prices.remove(k);
        let [a, b] = link.panels.map(|it| sets.find(it as u32));
        let outline = union(&panels, a as usize, b as usize).1;
        sets.join(a, b);
        let joined = sets.find(a) as usize;
        panels[joined] = outline;
        for (other, price) in open.iter().zip(&mut prices) {
            let [c, d] = other.panels.map(|it| sets.find(it as u32) as usize);
            if c == joined || d == joined {
                *price = union(&panels, c, d).0;
            }
        }
    }
    Decomposition::new(border.len(), open.iter().map(|it| (it.ends, it.chord)))
}

/// Panels in the order of strips: chains of panels with at most two chords, the largest area first; panels with more
/// chords are alone.
pub(super) fn strips(border: &Border, it: &Decomposition) -> Vec<Vec<usize>> {
    let mut around: Vec<Vec<usize>> = vec![Vec::new(); it.panels.len()];
    for link in &it.chords {
        let [a, b] = link.panels;
        around[a].push(b);
        around[b].push(a);
    }
    let chained = |p: usize| around[p].len() <= 2;
    let links: Vec<Vec<usize>> = (0..it.panels.len())
        .map(|p| around[p].iter().copied().filter(|&q| chained(p) && chained(q)).collect())
        .collect();
    let mut used = vec![false; it.panels.len()];
    let mut strips: Vec<Vec<usize>> = Vec::new();
    for start in 0..it.panels.len() {
        // A chain begins at a panel with at most one neighbour in it; the panels form a tree, so there is one.
        if used[start] || links[start].len() > 1 {
            continue;
        }
        let mut strip = vec![start];
        used[start] = true;
        let mut at = start;
        while let Some(q) = links[at].iter().copied().find(|&q| !used[q]) {
            used[q] = true;
            strip.push(q);
            at = q;
        }
        strips.push(strip);
    }
    let total = |strip: &[usize]| -> f64 { strip.iter().map(|&p| area(border, &it.panels[p])).sum() };
    strips.sort_by(|a, b| total(b).total_cmp(&total(a)));
    strips
}
