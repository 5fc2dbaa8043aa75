//! A flat region of a piece as a mesh of its own, whose boundary vertices are the samples that chords run between.
//!
//! Halfedge `3 f + k` runs from corner `k` of face `f` to corner `k + 1`, as in [`crate::mesh`], but faces may be split.
use crate::{
    geom::{Vec2, Vec3, cross2},
    mesh::VertexId,
    surface::chart::Chart,
};

pub(super) const NONE: u32 = u32::MAX;
/// Lines that pass a vertex nearer than this share of the region's size run through it.
const TOUCH: f64 = 1e-9;

/// What a point is called: the same in every region that has it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Name {
    /// A vertex of the developed mesh.
    Vertex(VertexId),
    /// The `k`-th point inside the edge between two vertices of the developed mesh, from the one with the smaller id.
    Edge(VertexId, VertexId, u32),
    /// A point inside a piece, numbered there.
    Inside(u32),
}

/// A part of a straight line inside one face, by barycentric coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Segment {
    pub(super) face: u32,
    pub(super) from: [f64; 3],
    pub(super) to: [f64; 3],
}

/// A region: a connected mesh with plane and space coordinates.
#[derive(Debug, Clone)]
pub(super) struct Patch {
    pub(super) uv: Vec<Vec2>,
    pub(super) xyz: Vec<Vec3>,
    pub(super) names: Vec<Name>,
    /// Vertex at the start of each halfedge.
    pub(super) tail: Vec<u32>,
    /// Opposite halfedge, `NONE` on the boundary.
    pub(super) twin: Vec<u32>,
    /// A halfedge that leaves each vertex; on the boundary the one that lies on it.
    first: Vec<u32>,
    /// Length below which a line touches a vertex, mm.
    touch: f64,
}

pub(super) fn next(h: u32) -> u32 {
    if h % 3 == 2 { h - 2 } else { h + 1 }
}

pub(super) fn previous(h: u32) -> u32 {
    if h.is_multiple_of(3) { h + 2 } else { h - 1 }
}

fn corner(h: u32) -> usize {
    (h % 3) as usize
}

impl Patch {
    /// The region of a chart; `uv` and `xyz` belong to its local vertices.
    pub(super) fn new(chart: &Chart, uv: Vec<Vec2>, xyz: Vec<Vec3>, names: Vec<Name>) -> Self {
        let tail: Vec<u32> = chart.corners.as_flattened().to_vec();
        let head = |h: u32| tail[next(h) as usize];
        let mut by_ends: Vec<(u32, u32, u32)> =
            (0..tail.len() as u32).map(|h| (tail[h as usize].min(head(h)), tail[h as usize].max(head(h)), h)).collect();
        by_ends.sort_unstable();
        let mut twin = vec![NONE; tail.len()];
        // A chart opens its cut edges by doubling vertices, so the ends name an edge.
        for pair in by_ends.windows(2).filter(|it| (it[0].0, it[0].1) == (it[1].0, it[1].1)) {
            twin[pair[0].2 as usize] = pair[1].2;
            twin[pair[1].2 as usize] = pair[0].2;
        }
        let mut patch = Self { uv, xyz, names, tail, twin, first: vec![], touch: 0.0 };
        patch.index();
        let bounds = crate::geom::Box2::of(&patch.uv);
        patch.touch = TOUCH * bounds.size().norm();
        patch
    }

    fn index(&mut self) {
        self.first = vec![NONE; self.uv.len()];
        for h in 0..self.tail.len() as u32 {
            let first = &mut self.first[self.tail[h as usize] as usize];
            if *first == NONE || self.twin[h as usize] == NONE {
                *first = h;
            }
        }
    }

    pub(super) fn face_count(&self) -> usize {
        self.tail.len() / 3
    }

    pub(super) fn head(&self, h: u32) -> u32 {
        self.tail[next(h) as usize]
    }

    pub(super) fn face(&self, f: u32) -> [u32; 3] {
        [0, 1, 2].map(|k| self.tail[3 * f as usize + k])
    }

    pub(super) fn is_boundary(&self, v: u32) -> bool {
        self.twin[self.first[v as usize] as usize] == NONE
    }

    /// The boundary halfedge that leaves a boundary vertex.
    pub(super) fn boundary(&self, v: u32) -> u32 {
        self.first[v as usize]
    }

    /// Halfedges that leave a vertex, counter-clockwise, on the boundary from the one that lies on it.
    pub(super) fn outgoing(&self, v: u32) -> impl Iterator<Item = u32> + '_ {
        let first = self.first[v as usize];
        let mut at = first;
        std::iter::from_fn(move || {
            let here = (at != NONE).then_some(at)?;
            at = self.twin[previous(here) as usize];
            if at == first {
                at = NONE;
            }
            Some(here)
        })
    }

    /// Area of a face in the plane, mm²; negative where it is flipped.
    pub(super) fn area(&self, f: u32) -> f64 {
        let [a, b, c] = self.face(f).map(|v| self.uv[v as usize]);
        0.5 * cross2(b - a, c - a)
    }

    /// Unit normal of a face in space.
    pub(super) fn normal(&self, f: u32) -> Vec3 {
        let [a, b, c] = self.face(f).map(|v| self.xyz[v as usize]);
        (b - a).cross(&(c - a)).try_normalize(0.0).unwrap_or_else(Vec3::zeros)
    }

    /// Boundary halfedges of every loop, the region on the left; the longest loop first.
    pub(super) fn loops(&self) -> Vec<Vec<u32>> {
        let mut seen = vec![false; self.tail.len()];
        let mut loops = Vec::new();
        for start in 0..self.tail.len() as u32 {
            if self.twin[start as usize] != NONE || seen[start as usize] {
                continue;
            }
            let mut path = Vec::new();
            let mut at = start;
            while !seen[at as usize] {
                seen[at as usize] = true;
                path.push(at);
                at = self.first[self.head(at) as usize];
            }
            loops.push(path);
        }
        let length = |path: &Vec<u32>| -> f64 { path.iter().map(|&h| self.length(h)).sum() };
        loops.sort_by(|a, b| length(b).total_cmp(&length(a)));
        loops
    }

    /// Length of a halfedge in the plane, mm.
    pub(super) fn length(&self, h: u32) -> f64 {
        (self.uv[self.head(h) as usize] - self.uv[self.tail[h as usize] as usize]).norm()
    }

    /// Puts a vertex on a halfedge and splits the faces on its sides. The halfedge then ends at the new vertex.
    pub(super) fn split(&mut self, h: u32, uv: Vec2, xyz: Vec3, name: Name) -> u32 {
        let m = self.uv.len() as u32;
        self.uv.push(uv);
        self.xyz.push(xyz);
        self.names.push(name);
        self.first.push(NONE);
        let g = self.twin[h as usize];
        let ahead = self.split_face(h, m);
        self.first[m as usize] = ahead;
        if g != NONE {
            let behind = self.split_face(g, m);
            self.link(h, behind);
            self.link(ahead, g);
        }
        m
    }

    /// Splits the face of `h` from `m` on it to its apex; returns the halfedge from `m` on along `h`.
    fn split_face(&mut self, h: u32, m: u32) -> u32 {
        let n = self.tail.len() as u32;
        let (side, b, apex) = (next(h), self.head(h), self.tail[previous(h) as usize]);
        self.tail.extend([m, b, apex]);
        self.twin.extend([NONE; 3]);
        let beyond = self.twin[side as usize];
        if beyond != NONE {
            self.link(n + 1, beyond);
        }
        self.tail[side as usize] = m;
        self.link(side, n + 2);
        if self.first[b as usize] == side {
            self.first[b as usize] = n + 1;
        }
        n
    }

    fn link(&mut self, g: u32, h: u32) {
        self.twin[g as usize] = h;
        self.twin[h as usize] = g;
    }

    /// Opens the given halfedges and their twins: vertices between which no faces remain joined become several.
    pub(super) fn open(&mut self, halfedges: &[u32]) {
        for &h in halfedges {
            let g = std::mem::replace(&mut self.twin[h as usize], NONE);
            if g != NONE {
                self.twin[g as usize] = NONE;
            }
        }
        let mut known = vec![NONE; self.tail.len()];
        let mut taken = vec![false; self.uv.len()];
        for start in 0..self.tail.len() as u32 {
            if known[start as usize] != NONE {
                continue;
            }
            let v = self.tail[start as usize] as usize;
            let id = if taken[v] { self.uv.len() as u32 } else { v as u32 };
            if std::mem::replace(&mut taken[v], true) {
                self.uv.push(self.uv[v]);
                self.xyz.push(self.xyz[v]);
                self.names.push(self.names[v]);
            }
            let mut at = start;
            while at != NONE && known[at as usize] == NONE {
                known[at as usize] = id;
                at = self.twin[previous(at) as usize];
            }
            at = self.twin[start as usize];
            while at != NONE && known[next(at) as usize] == NONE {
                known[next(at) as usize] = id;
                at = self.twin[next(at) as usize];
            }
        }
        self.tail = known;
        self.index();
    }

    /// The straight line between two vertices in the plane, walked face by face from the fan of `from`. `false` when it
    /// leaves the region or touches its boundary on the way: then it is no chord.
    pub(super) fn trace(&self, from: u32, to: u32, path: &mut Vec<Segment>) -> bool {
        path.clear();
        let mut at = from;
        loop {
            match self.advance(at, to, path) {
                Some(v) if v == to => return true,
                Some(v) if !self.is_boundary(v) && path.len() <= self.tail.len() => at = v,
                _ => return false,
            }
        }
    }

    /// From vertex `at` straight towards `to`, as far as the next vertex on the line.
    fn advance(&self, at: u32, to: u32, path: &mut Vec<Segment>) -> Option<u32> {
        let origin = self.uv[at as usize];
        let line = self.uv[to as usize] - origin;
        let reach = line.norm_squared();
        let touch = self.touch * reach.sqrt();
        let side = |v: u32| cross2(line, self.uv[v as usize] - origin);
        let ahead = |v: u32| line.dot(&(self.uv[v as usize] - origin));
        let unit = |k: usize| std::array::from_fn(|i| if i == k { 1.0 } else { 0.0 });
        let mut exit = None;
        for h in self.outgoing(at) {
            let (a, b) = (self.head(h), self.tail[previous(h) as usize]);
            let (right, left) = (side(a), side(b));
            for (v, distance, k) in [(a, right, next(h)), (b, left, previous(h))] {
                if distance.abs() <= touch && ahead(v) > 0.0 {
                    path.push(Segment { face: h / 3, from: unit(corner(h)), to: unit(corner(k)) });
                    return (ahead(v) <= reach * (1.0 + 1e-9)).then_some(v);
                }
            }
            if right < 0.0 && left > 0.0 {
                exit = Some((h, next(h), right, left));
                break;
            }
        }
        let (start, mut exit, mut right, mut left) = exit?;
        let mut entry: [f64; 3] = unit(corner(start));
        loop {
            // The line leaves the face through `exit`, whose tail lies on its right and whose head on its left.
            let t = right / (right - left);
            let (a, b) = (self.tail[exit as usize], self.head(exit));
            let mut leave = [0.0; 3];
            leave[corner(exit)] = 1.0 - t;
            leave[corner(next(exit))] = t;
            path.push(Segment { face: exit / 3, from: entry, to: leave });
            let beyond = ahead(a) * (1.0 - t) + ahead(b) * t > reach * (1.0 + 1e-9);
            let g = self.twin[exit as usize];
            if g == NONE || beyond || path.len() > self.tail.len() {
                return None;
            }
            entry = [0.0; 3];
            entry[corner(g)] = t;
            entry[corner(next(g))] = 1.0 - t;
            let apex = self.tail[previous(g) as usize];
            let distance = side(apex);
            if distance.abs() <= touch {
                path.push(Segment { face: g / 3, from: entry, to: unit(corner(previous(g))) });
                return Some(apex);
            }
            if distance > 0.0 {
                (exit, left) = (next(g), distance);
            } else {
                (exit, right) = (previous(g), distance);
            }
        }
    }

    /// The point of a face with given barycentric coordinates, in space.
    pub(super) fn place(&self, face: u32, weights: [f64; 3]) -> Vec3 {
        let corners = self.face(face);
        (0..3).map(|k| self.xyz[corners[k] as usize] * weights[k]).sum()
    }

    /// The same in the plane.
    pub(super) fn flat_place(&self, face: u32, weights: [f64; 3]) -> Vec2 {
        let corners = self.face(face);
        (0..3).map(|k| self.uv[corners[k] as usize] * weights[k]).sum()
    }
}
