//! Isolines of a parameterisation that may wind and have singularities, with exact combinatorics.
//!
//! At every vertex τ = α / spacing is split into a whole number and a rest in [0, 1), so that an edge is crossed by
//! exactly |n'| lines, n' an integer, however much τ changes along it and whatever is rounded. Around a face the crossings
//! upwards and downwards differ by its index k, so |k| of them stay unmatched and end inside it; the others are joined without
//! crossing one another.
use std::f64::consts::TAU;

use crate::{
    geom::Vec3,
    mesh::{EdgeId, FaceId, Field, HalfedgeId, Id, TriMesh, VertexId},
};

const NONE: u32 = u32::MAX;

/// Which isolines.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Levels {
    /// Lines per turn of α: 2 for both edges of strips that are half a period wide.
    pub per_turn: i32,
    /// The first line, in turns.
    pub offset: f64,
}

/// A line that ends inside a face.
#[derive(Debug, Clone, PartialEq)]
pub struct Ends {
    /// The singular face.
    pub face: FaceId,
    /// Where the lines end, mm.
    pub place: Vec3,
    /// The crossings from which they come.
    pub crossings: Vec<u32>,
}

/// Where isolines cross the edges and how they run through the faces.
#[derive(Debug, Clone, PartialEq)]
pub struct Crossings {
    /// The crossings of edge e are `first[e]..first[e + 1]`, in the order along [`TriMesh::halfedge`].
    pub first: Vec<u32>,
    /// Edge of each crossing.
    pub edge: Vec<EdgeId>,
    /// Share of the edge before each crossing, 0 to 1.
    pub share: Vec<f64>,
    /// Signed number of lines across each edge: positive where τ rises along it.
    pub count: Field<EdgeId, i32>,
    /// Per crossing and side of its edge (left, right) the crossing to which the line goes there, times 2, plus the side on
    /// which it arrives; `u32::MAX` at a boundary, `u32::MAX - 1 - k` where it ends in `ends[k]`.
    next: Vec<[u32; 2]>,
    /// Singular faces.
    pub ends: Vec<Ends>,
}

/// Where a line ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ArcEnd {
    /// At a boundary edge.
    Rim(EdgeId),
    /// In the singular face `ends[k]` of its crossings.
    Inner(usize),
}

/// A point of an isoline.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LinePoint {
    /// Where, mm.
    pub place: Vec3,
    /// The face through which the line goes on, or for the last point of an open line came.
    pub face: FaceId,
}

/// One isoline.
#[derive(Debug, Clone, PartialEq)]
pub struct Isoline {
    /// Its points; a closed line does not repeat the first.
    pub points: Vec<LinePoint>,
    /// Whether the last point joins the first.
    pub closed: bool,
    /// How many of its two ends lie inside the surface, at singularities.
    pub inner_ends: usize,
}

impl Isoline {
    /// Its straight pieces: the face and both ends.
    pub fn pieces(&self) -> impl Iterator<Item = (FaceId, [Vec3; 2])> + '_ {
        let n = self.points.len();
        let count = if self.closed { n } else { n.saturating_sub(1) };
        (0..count).map(move |i| (self.points[i].face, [self.points[i].place, self.points[(i + 1) % n].place]))
    }

    /// Its length, mm.
    pub fn length(&self) -> f64 {
        self.pieces().map(|(_, [a, b])| (b - a).norm()).sum()
    }
}

/// One crossing of the boundary of a face: its number, with the side on which the face lies, times 2.
type Passage = u32;

impl Crossings {
    /// Finds all lines of α with the integer 1-form n ([`crate::surface::field_aligned::Parameterization`]). O(F + lines).
    pub fn new(mesh: &TriMesh, alpha: &Field<VertexId, f64>, n: &Field<EdgeId, i32>, levels: Levels) -> Self {
        let per_turn = f64::from(levels.per_turn);
        let split = |v: VertexId| {
            let turns = per_turn * alpha[v] / TAU - levels.offset;
            let whole = turns.floor();
            // A rest that rounds up to 1 is the next whole.
            if turns - whole < 1.0 { (whole as i32, turns - whole) } else { (whole as i32 + 1, 0.0) }
        };
        let split: Field<VertexId, (i32, f64)> = Field::from_fn(mesh.vertex_count(), split);
        let mut out = Self {
            first: Vec::with_capacity(mesh.edge_count() + 1),
            edge: Vec::new(),
            share: Vec::new(),
            count: Field::filled(mesh.edge_count(), 0),
            next: Vec::new(),
            ends: Vec::new(),
        };
        for e in mesh.edges() {
            out.first.push(out.edge.len() as u32);
            let [(wa, a), (wb, b)] = mesh.edge_vertices(e).map(|v| split[v]);
            let count = wb - wa + levels.per_turn * n[e];
            out.count[e] = count;
            let rise = b + f64::from(count) - a;
            for j in 0..count.unsigned_abs() {
                // Levels 1, 2 … upwards and 0, −1 … downwards.
                let level = if count > 0 { f64::from(j) + 1.0 } else { -f64::from(j) };
                out.edge.push(e);
                out.share.push(((level - a) / rise).clamp(0.0, 1.0));
            }
        }
        out.first.push(out.edge.len() as u32);
        out.next = vec![[NONE; 2]; out.edge.len()];
        let (mut up, mut down) = (Vec::new(), Vec::new());
        for f in mesh.faces() {
            out.join(mesh, f, &mut up, &mut down);
        }
        out
    }

    /// The lines of a double cover on the surface below, where face 2 f of the cover lies over face f with the same first
    /// corner, and both sheets show the same lines.
    pub(super) fn below(above: &Self, cover: &TriMesh, base: &TriMesh) -> Self {
        // The edge over an edge of the base, in the face over that of its halfedge; both run the same way.
        let over = |h: HalfedgeId| HalfedgeId(6 * (h.0 / 3) + h.0 % 3);
        let mut out = Self {
            first: Vec::with_capacity(base.edge_count() + 1),
            edge: Vec::new(),
            share: Vec::new(),
            count: Field::from_fn(base.edge_count(), |e| above.count[cover.edge(over(base.halfedge(e)))]),
            next: Vec::new(),
            ends: Vec::new(),
        };
        for e in base.edges() {
            out.first.push(out.edge.len() as u32);
            let range = above.range(cover.edge(over(base.halfedge(e))));
            out.edge.extend(range.clone().map(|_| e));
            out.share.extend(range.map(|c| above.share[c as usize]));
        }
        out.first.push(out.edge.len() as u32);
        out.next = vec![[NONE; 2]; out.edge.len()];
        for f in base.faces() {
            // Passages of the face of the cover and of the base in the same order.
            let pairs: Vec<(Passage, Passage)> = base
                .face_halfedges(f)
                .into_iter()
                .flat_map(|h| above.along(cover, over(h)).0.zip(out.along(base, h).0))
                .collect();
            let down = |x: Passage| pairs.iter().find(|it| it.0 == x).map(|it| it.1);
            for &(x, y) in &pairs {
                match above.partner(x).and_then(down) {
                    Some(to) => out.next[y as usize / 2][y as usize % 2] = to,
                    None => out.next[y as usize / 2][y as usize % 2] = NONE - 1 - out.ends.len() as u32,
                }
            }
            let place = above.ends.iter().find(|it| it.face.index() == 2 * f.index()).map(|it| it.place);
            if let Some(place) = place {
                let free = pairs.iter().filter(|it| above.partner(it.0).is_none());
                let crossings = free.map(|it| it.1 / 2).collect();
                out.ends.push(Ends { face: f, place, crossings });
            }
        }
        out
    }

    fn range(&self, e: EdgeId) -> std::ops::Range<u32> {
        self.first[e.index()]..self.first[e.index() + 1]
    }

    /// Number of crossings.
    pub fn len(&self) -> usize {
        self.edge.len()
    }

    /// Whether there are no lines at all.
    pub fn is_empty(&self) -> bool {
        self.edge.is_empty()
    }

    /// Place of a crossing.
    pub fn place(&self, mesh: &TriMesh, crossing: u32) -> Vec3 {
        let [a, b] = mesh.edge_vertices(self.edge[crossing as usize]).map(|v| mesh.position(v));
        a + (b - a) * self.share[crossing as usize]
    }

    /// Crossings of a halfedge in its direction, with the side of its face, and whether τ rises through them.
    fn along(&self, mesh: &TriMesh, h: HalfedgeId) -> (impl Iterator<Item = Passage> + Clone + use<>, bool) {
        let e = mesh.edge(h);
        let forward = mesh.halfedge(e) == h;
        let range = self.first[e.index()]..self.first[e.index() + 1];
        let (start, end) = (range.start, range.end);
        let at = move |i: u32| if forward { 2 * (start + i) } else { 2 * (end - 1 - i) + 1 };
        ((0..end - start).map(at), (self.count[e] > 0) == forward)
    }

    /// Joins the crossings around a face.
    fn join(&mut self, mesh: &TriMesh, f: FaceId, up: &mut Vec<Passage>, down: &mut Vec<Passage>) {
        let around = mesh.face_halfedges(f).map(|h| self.along(mesh, h));
        let [a, b, c] = around;
        if a.0.clone().next().or(b.0.clone().next()).or(c.0.clone().next()).is_none() {
            return;
        }
        up.clear();
        down.clear();
        // Start where a run of rising edges begins, so that both runs come in one go.
        let sides = [a, b, c];
        let rises = |k: usize| sides[k % 3].1 && sides[k % 3].0.clone().next().is_some();
        let start = (0..3).find(|&k| rises(k) && !rises(k + 2)).unwrap_or(0);
        for k in start..start + 3 {
            let (passages, rising) = &sides[k % 3];
            if *rising { up.extend(passages.clone()) } else { down.extend(passages.clone()) }
        }
        if up.len() == down.len() {
            // Opposite slopes of a linear function: level with level.
            for (&x, &y) in up.iter().rev().zip(down.iter()) {
                self.link(x, y);
            }
            return;
        }
        let (many, few) = if up.len() > down.len() { (&*up, &*down) } else { (&*down, &*up) };
        self.end_inside(mesh, f, many, few);
    }

    fn link(&mut self, x: Passage, y: Passage) {
        self.next[x as usize / 2][x as usize % 2] = y;
        self.next[y as usize / 2][y as usize % 2] = x;
    }

    /// A singular face: `many` crossings in one direction, followed counter-clockwise by `few` in the other. `first` of the
    /// few are joined across where they follow the many, the rest across where they go before; the split with the shortest
    /// lines is taken.
    fn end_inside(&mut self, mesh: &TriMesh, f: FaceId, many: &[Passage], few: &[Passage]) {
        let (p, q) = (many.len(), few.len());
        let place = |x: Passage| self.place(mesh, x / 2);
        let pairs = |first: usize| {
            let behind = (0..first).map(move |i| (p - 1 - i, i));
            behind.chain((0..q - first).map(move |i| (i, q - 1 - i)))
        };
        // Lengths of the first 0, 1 … pairs of either side.
        let sums = |pair: &dyn Fn(usize) -> (usize, usize)| {
            let mut out = vec![0.0];
            for (i, k) in (0..q).map(pair) {
                out.push(out[out.len() - 1] + (place(many[i]) - place(few[k])).norm());
            }
            out
        };
        let (behind, before) = (sums(&|i| (p - 1 - i, i)), sums(&|i| (i, q - 1 - i)));
        let length = |first: usize| behind[first] + before[q - first];
        let first = (0..=q).min_by(|&a, &b| length(a).total_cmp(&length(b)).then(a.cmp(&b))).unwrap_or(0);
        let free = &many[q - first..p - first];
        let end = self.middle(mesh, f, free, &pairs(first).map(|(i, k)| [many[i], few[k]]).collect::<Vec<_>>());
        let code = NONE - 1 - self.ends.len() as u32;
        self.ends.push(Ends { face: f, place: end, crossings: free.iter().map(|x| x / 2).collect() });
        free.iter().for_each(|&x| self.next[x as usize / 2][x as usize % 2] = code);
        for (i, k) in pairs(first) {
            self.link(many[i], few[k]);
        }
    }

    /// The middle of the part of a face, cut along `pairs`, at which the `free` crossings lie: the mean of its corners, of
    /// which it is the convex hull.
    fn middle(&self, mesh: &TriMesh, f: FaceId, free: &[Passage], pairs: &[[Passage; 2]]) -> Vec3 {
        let items = self.around(mesh, f);
        let mut places: Vec<(Passage, usize)> = items
            .iter()
            .enumerate()
            .filter_map(|(i, it)| if let Around::Crossing(x) = it { Some((*x, i)) } else { None })
            .collect();
        places.sort_unstable();
        let at = |x: Passage| places.binary_search_by_key(&x, |it| it.0).map_or(0, |k| places[k].1);
        let here = free.first().map_or(0, |&x| at(x));
        // How many pairs part each item from the free ones, as differences.
        let mut parted = vec![0_i32; items.len() + 1];
        for pair in pairs {
            let [a, b] = pair.map(at);
            let (a, b) = (a.min(b), a.max(b));
            let ranges = if a < here && here < b { [0..a, b + 1..items.len()] } else { [a + 1..b, 0..0] };
            for range in ranges.into_iter().filter(|it| !it.is_empty()) {
                parted[range.start] += 1;
                parted[range.end] -= 1;
            }
        }
        let mut sum = 0;
        parted.iter_mut().for_each(|it| {
            sum += *it;
            *it = sum;
        });
        let seen: Vec<Vec3> = (0..items.len())
            .filter(|&i| parted[i] == 0)
            .map(|i| match items[i] {
                Around::Corner(v) => mesh.position(v),
                Around::Crossing(x) => self.place(mesh, x / 2),
            })
            .collect();
        seen.iter().sum::<Vec3>() / seen.len() as f64
    }

    /// What lies on the boundary of a face, counter-clockwise from its first corner.
    pub(super) fn around(&self, mesh: &TriMesh, f: FaceId) -> Vec<Around> {
        let mut out = Vec::new();
        for h in mesh.face_halfedges(f) {
            out.push(Around::Corner(mesh.tail(h)));
            out.extend(self.along(mesh, h).0.map(Around::Crossing));
        }
        out
    }

    /// Where the line through a passage goes inside the face: another passage or none.
    pub(super) fn partner(&self, x: Passage) -> Option<Passage> {
        let next = self.next[x as usize / 2][x as usize % 2];
        ((next as usize) < 2 * self.edge.len()).then_some(next)
    }

    /// The isolines: first those with ends, from where they begin (τ is higher on their left), then the closed ones, each from its
    /// least crossing. Those of a line field have no direction and run from either end.
    pub fn lines(&self, mesh: &TriMesh) -> Vec<Isoline> {
        let mut seen = vec![false; self.edge.len()];
        let mut out = Vec::new();
        for (c, way) in self.order() {
            if !seen[c as usize] {
                out.push(self.trace(mesh, 2 * c + way.unwrap_or(0), &mut seen));
            }
        }
        out
    }

    /// Crossings from which to look for lines, with the side on which one ends: the beginnings, other ends, then all.
    fn order(&self) -> impl Iterator<Item = (u32, Option<u32>)> + '_ {
        let all = 0..self.edge.len() as u32;
        let end = |c: u32, side: u32| self.partner(2 * c + side).is_none().then_some(side);
        // Whoever leaves an end on the left of a rising edge has what is higher on the left.
        let begins = move |c: u32| end(c, u32::from(self.count[self.edge[c as usize]] < 0));
        let ends = move |c: u32| end(c, 0).or(end(c, 1));
        let beginnings = all.clone().filter_map(move |c| Some((c, Some(begins(c)?))));
        let others = all.clone().filter_map(move |c| Some((c, Some(ends(c)?))));
        beginnings.chain(others).chain(all.map(|c| (c, None)))
    }

    /// The lines without their ways: both ends of every open one, and how many are closed.
    pub fn arcs(&self) -> (Vec<[ArcEnd; 2]>, usize) {
        let mut seen = vec![false; self.edge.len()];
        let (mut open, mut closed) = (Vec::new(), 0);
        for (c, way) in self.order() {
            if seen[c as usize] {
                continue;
            }
            let first = 2 * c + way.unwrap_or(0);
            let mut last = first;
            seen[c as usize] = true;
            while let Some(next) = self.partner(last ^ 1).filter(|it| !seen[*it as usize / 2]) {
                seen[next as usize / 2] = true;
                last = next;
            }
            if way.is_some() { open.push([first, last ^ 1].map(|x| self.arc_end(x))) } else { closed += 1 }
        }
        (open, closed)
    }

    /// Where a line ends that goes nowhere from a passage.
    fn arc_end(&self, x: Passage) -> ArcEnd {
        match self.next[x as usize / 2][x as usize % 2] {
            NONE => ArcEnd::Rim(self.edge[x as usize / 2]),
            code => ArcEnd::Inner((NONE - 1 - code) as usize),
        }
    }

    /// How many lines have no end inside the surface, which may part it, and how many there are.
    pub fn count_lines(&self) -> [usize; 2] {
        let (open, closed) = self.arcs();
        let through = open.iter().filter(|it| it.iter().all(|end| matches!(end, ArcEnd::Rim(_)))).count();
        [through + closed, open.len() + closed]
    }

    fn trace(&self, mesh: &TriMesh, start: Passage, seen: &mut [bool]) -> Isoline {
        let mut line = Isoline { points: Vec::new(), closed: false, inner_ends: 0 };
        let end = |x: Passage| {
            let code = self.next[x as usize / 2][x as usize % 2];
            (code != NONE).then(|| &self.ends[(NONE - 1 - code) as usize])
        };
        let face = |x: Passage| {
            let h = mesh.halfedge(self.edge[x as usize / 2]);
            if x.is_multiple_of(2) { Some(mesh.face(h)) } else { mesh.twin(h).map(|it| mesh.face(it)) }
        };
        if self.partner(start).is_none()
            && let Some(it) = end(start)
        {
            line.points.push(LinePoint { place: it.place, face: it.face });
            line.inner_ends += 1;
        }
        let mut last = start;
        loop {
            let (c, onward) = (last / 2, last ^ 1);
            seen[c as usize] = true;
            let Some(f) = face(onward).or(face(last)) else { break };
            line.points.push(LinePoint { place: self.place(mesh, c), face: f });
            match self.partner(onward) {
                Some(next) if seen[next as usize / 2] => {
                    line.closed = true;
                    break;
                }
                Some(next) => last = next,
                None => {
                    if let Some(it) = self.open_end(onward, &end) {
                        line.points.push(LinePoint { place: it.place, face: it.face });
                        line.inner_ends += 1;
                    }
                    break;
                }
            }
        }
        line
    }

    fn open_end<'a>(&self, x: Passage, end: &impl Fn(Passage) -> Option<&'a Ends>) -> Option<&'a Ends> {
        if self.next[x as usize / 2][x as usize % 2] == NONE { None } else { end(x) }
    }
}

/// What lies on the boundary of a face.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Around {
    /// A corner.
    Corner(VertexId),
    /// A crossing, seen from the face.
    Crossing(Passage),
}
