//! The rulings of a strip, interpolated inside its panels.
use crate::{
    geom::{Box2, Vec2, Vec3, cross2},
    mesh::{Bvh, FaceId, Id, TriMesh, VertexId},
    model::{Panel, PieceId, Strips},
};

use super::posture::Line;

/// A piece with the surface that its postures follow.
pub(super) struct Skin<'a> {
    mesh: &'a TriMesh,
    tree: Bvh,
    faces: Vec<FaceId>,
    normals: Vec<Vec3>,
}

/// Where along a ruling normals are taken, in shares of its length.
const STATIONS: [f64; 5] = [0.1, 0.3, 0.5, 0.7, 0.9];
/// Normals that would turn by more than this along a ruling are noise, radians.
const MOST_TWIST: f64 = 0.6;

impl<'a> Skin<'a> {
    /// The faces of a piece, with normals at their vertices weighted by area.
    pub(super) fn new(mesh: &'a TriMesh, faces: Vec<FaceId>) -> Self {
        let mut normals = vec![Vec3::zeros(); mesh.vertex_count()];
        for &f in &faces {
            for v in mesh.face_vertices(f) {
                normals[v.0 as usize] += mesh.area_vector(f);
            }
        }
        let tree = Bvh::of_triangles(faces.iter().map(|&f| mesh.face_positions(f)).collect());
        Self { mesh, tree, faces, normals }
    }

    fn normal(&self, p: Vec3) -> Vec3 {
        let near = self.tree.closest(p);
        let corners = self.mesh.face_vertices(self.faces[near.face.index()]);
        let at = |v: VertexId| self.normals[v.0 as usize].try_normalize(0.0).unwrap_or_else(Vec3::zeros);
        (0..3).map(|k| at(corners[k]) * near.barycentric[k]).sum()
    }

    /// Twist of the normals along a line whose mean normal is `m`: least squares of their angles about it, radians.
    fn twist(&self, p: Vec3, q: Vec3, m: Vec3) -> f64 {
        let a = (q - p).normalize();
        let t = a.cross(&m);
        let (mut top, mut bottom) = (0.0, 0.0);
        for s in STATIONS {
            let n = self.normal(p + (q - p) * s);
            top += (s - 0.5) * n.dot(&t).atan2(n.dot(&m));
            bottom += (s - 0.5) * (s - 0.5);
        }
        (top / bottom).clamp(-MOST_TWIST, MOST_TWIST)
    }
}

/// A line of the plane of a panel: a point and a direction.
#[derive(Debug, Clone, Copy)]
struct Guide {
    ends: [Vec2; 2],
}

/// A panel between two guides; the rulings in it run from the first to the second.
struct Span<'a> {
    panel: &'a Panel,
    /// Number of the panel among all.
    index: usize,
    guides: [Guide; 2],
    /// Normals at the first guide, in the middle, at the second one.
    normals: [Vec3; 3],
}

/// A strip as a one-parameter family of rulings: `t` in [k, k + 1] lies in its panel k.
pub(super) struct Band<'a> {
    strips: &'a Strips,
    skin: &'a Skin<'a>,
    spans: Vec<Span<'a>>,
    /// Number of the strip in its piece, from 0.
    pub(super) strip: u32,
}

/// Rulings are kept this share of a panel away from its ends, where it may come to a point.
const INSET: f64 = 0.02;

/// Rulings keep this share of the width of a panel away from its sides.
const GRAZING: f64 = 0.002;

/// Chords are walked from end to end of their panel; shorter ones than this are none, mm.
const SHORTEST: f64 = 0.05;

impl<'a> Band<'a> {
    /// All strips of a piece that have a ruling.
    pub(super) fn of_piece(strips: &'a Strips, piece: PieceId, skin: &'a Skin<'a>) -> Vec<Self> {
        let first = strips.panels.partition_point(|it| it.piece < piece);
        let panels: Vec<&Panel> = strips.panels[first..].iter().take_while(|it| it.piece == piece).collect();
        let mut out = Vec::new();
        let mut at = 0;
        for group in panels.chunk_by(|a, b| a.strip == b.strip) {
            let spans = spans(strips, first + at, group);
            at += group.len();
            if !spans.is_empty() {
                out.push(Self { strips, skin, spans, strip: group[0].strip });
            }
        }
        out
    }

    /// Largest parameter.
    pub(super) fn end(&self) -> f64 {
        self.spans.len() as f64
    }

    /// The place of a panel in the strip, by its number among all.
    pub(super) fn place_of(&self, panel: usize) -> Option<usize> {
        self.spans.iter().position(|it| it.index == panel)
    }

    /// The ruling at a parameter; `None` where the panel has no width.
    pub(super) fn line(&self, t: f64) -> Option<Line> {
        let k = (t.floor().max(0.0) as usize).min(self.spans.len() - 1);
        let (span, s) = (&self.spans[k], t - k as f64);
        let [a, b] = span.guides;
        // On a guide itself the line would run along a side of the panel, where its ends cannot be told.
        let inside = s.clamp(GRAZING, 1.0 - GRAZING);
        let ends = [0, 1].map(|i| a.ends[i] + (b.ends[i] - a.ends[i]) * inside);
        let [p, q] = self.chord(span.panel, ends)?;
        let [first, middle, last] = span.normals;
        let m = if s < 0.5 { first + (middle - first) * (2.0 * s) } else { middle + (last - middle) * (2.0 * s - 1.0) };
        let along = (q - p).normalize();
        let m = (m - along * along.dot(&m)).try_normalize(1e-9)?;
        let (half, t) = (self.skin.twist(p, q, m) / 2.0, along.cross(&m));
        let (sin, cos) = half.sin_cos();
        Some(Line { p, q, normals: [m * cos - t * sin, m * cos + t * sin] })
    }

    /// The longest stretch of a line inside a panel that holds the middle of `ends` or lies next to it, in space.
    fn chord(&self, panel: &Panel, ends: [Vec2; 2]) -> Option<[Vec3; 2]> {
        let direction = (ends[1] - ends[0]).try_normalize(1e-12)?;
        let middle = (ends[0] + ends[1]) / 2.0;
        let n = panel.outline.len();
        // Where the line crosses the outline: along it, and in space.
        let mut crossings: Vec<(f64, Vec3)> = Vec::new();
        for k in 0..n {
            let (a, b) = (panel.outline[k], panel.outline[(k + 1) % n]);
            let (pa, pb) = (self.strips.flat(a) - middle, self.strips.flat(b) - middle);
            let (da, db) = (cross2(direction, pa), cross2(direction, pb));
            if (da < 0.0) != (db < 0.0) {
                let s = da / (da - db);
                let flat = pa + (pb - pa) * s;
                let (x, y) = (self.strips.place(a), self.strips.place(b));
                crossings.push((flat.dot(&direction), x + (y - x) * s));
            }
        }
        crossings.sort_by(|a, b| a.0.total_cmp(&b.0));
        let away = |w: &[(f64, Vec3)]| w[0].0.max(-w[1].0).max(0.0);
        let inside = crossings.chunks_exact(2).filter(|w| w[1].0 - w[0].0 >= SHORTEST);
        let best = inside.min_by(|v, w| away(v).total_cmp(&away(w)))?;
        Some([best[0].1, best[1].1])
    }
}

/// The panels of a strip with their guides; `first` is the index of the first one.
fn spans<'a>(strips: &'a Strips, first: usize, group: &[&'a Panel]) -> Vec<Span<'a>> {
    let index = |k: usize| (first + k) as u32;
    // A ruling towards the next panel lies with the earlier one on its left.
    let between = |k: usize| {
        let wanted = [index(k), index(k + 1)];
        let found = strips.rulings.iter().find(|it| it.panels == wanted || it.panels == [wanted[1], wanted[0]])?;
        let ends = found.ends.map(|c| strips.flat(c));
        Some(Guide { ends: if found.panels == wanted { ends } else { [ends[1], ends[0]] } })
    };
    let other = |k: usize, before: bool| {
        let own = index(k);
        let inner = |p: u32| (index(0)..index(group.len())).contains(&p);
        let mut found =
            strips.rulings.iter().filter(|it| it.panels.contains(&own) && !it.panels.iter().all(|&p| inner(p)));
        let it = found.next()?;
        // Panels with several rulings to other strips are planar regions, which need no second guide.
        if found.next().is_some() {
            return None;
        }
        let ends = it.ends.map(|c| strips.flat(c));
        let on_right = it.panels[1] == own;
        Some(Guide { ends: if on_right == before { ends } else { [ends[1], ends[0]] } })
    };
    let links: Vec<Option<Guide>> = (0..group.len().saturating_sub(1)).map(between).collect();
    let normals: Vec<Vec3> = group.iter().map(|it| strips.normal(it)).collect();
    let mean = |a: usize, b: usize| (normals[a] + normals[b]).try_normalize(1e-9).unwrap_or(normals[a]);
    let mut out = Vec::new();
    for (k, panel) in group.iter().enumerate() {
        let before = if k > 0 { links[k - 1] } else { other(k, true) };
        let after = if k + 1 < group.len() { links[k] } else { other(k, false) };
        let guides = match (before, after) {
            (Some(a), Some(b)) => [a, b],
            (Some(a), None) => [a, cap(strips, panel, a, -1.0)],
            (None, Some(b)) => [cap(strips, panel, b, 1.0), b],
            (None, None) => match longest(strips, index(k)) {
                Some(b) => [cap(strips, panel, b, 1.0), b],
                None => continue,
            },
        };
        let ends = [
            if k > 0 { mean(k - 1, k) } else { normals[k] },
            if k + 1 < group.len() { mean(k, k + 1) } else { normals[k] },
        ];
        out.push(Span { panel, index: first + k, guides, normals: [ends[0], normals[k], ends[1]] });
    }
    out
}

/// A guide parallel to `guide` at the far end of a panel, on its left for a side of 1.
fn cap(strips: &Strips, panel: &Panel, guide: Guide, side: f64) -> Guide {
    let direction = (guide.ends[1] - guide.ends[0]).try_normalize(0.0).unwrap_or_else(Vec2::x);
    let left = Vec2::new(-direction.y, direction.x) * side;
    let points = strips.flat_outline(panel);
    let depth = points.iter().map(|p| (p - guide.ends[0]).dot(&left)).fold(0.0, f64::max) * (1.0 - INSET);
    let bounds = Box2::of(&points);
    // Long enough to cross the panel at its far end, with its middle over the panel.
    let over = direction * ((bounds.min + bounds.max) / 2.0 - (guide.ends[0] + guide.ends[1]) / 2.0).dot(&direction);
    Guide { ends: guide.ends.map(|it| it + left * depth + over) }
}

/// The longest ruling of a panel, with the panel on its left.
fn longest(strips: &Strips, own: u32) -> Option<Guide> {
    let mine = strips.rulings.iter().filter(|it| it.panels.contains(&own));
    let it = mine.max_by(|a, b| a.length.total_cmp(&b.length))?;
    let ends = it.ends.map(|c| strips.flat(c));
    Some(Guide { ends: if it.panels[0] == own { ends } else { [ends[1], ends[0]] } })
}
