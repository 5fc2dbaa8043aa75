//! One quadrilateral net per patch over a common grid of x and y lines that pass the crease vertices. Quads that a crease
//! runs through stand in both patches; where a crease crosses a line of the grid it is a fixed combination of two vertices in
//! either patch (section 3.2, figure 5).
use std::collections::BTreeMap;

use crate::{
    geom::{Vec2, Vec3, cross2},
    model::CreasePattern,
};

/// Crease points where the circle through them and their neighbours has less curvature (in 1 / mean edge) have no osculating
/// plane (section 6.1, κ_ε).
pub const LEAST_CURVATURE: f64 = 1e-5;
/// Crease points that divide their edge more unevenly than this ratio are left out (section 6.1, ε_r).
pub const LEAST_SPLIT: f64 = 0.05;
/// Crease points where the edge and the crease enclose a smaller angle are left out, degrees (section 6.1, ε_α).
pub const LEAST_ANGLE_DEG: f64 = 3.0;

/// Least distance of two lines of the grid, in edges.
const CLOSEST: f64 = 0.5;

/// Positions of the lines of a grid, ascending, in units of its mean edge.
#[derive(Debug, Clone, PartialEq)]
pub struct Grid {
    /// x of the lines of constant x, and y of the lines of constant y.
    pub lines: [Vec<f64>; 2],
    /// Length of the mean edge, in the unit of the pattern.
    pub edge: f64,
}

impl Grid {
    /// A grid over the pattern with about the given edge (mm). Lines pass its bounds and, one of the two per crease vertex, its
    /// crease vertices; between these they are spaced evenly. `shift` in [0, 1) moves even lines that nothing holds.
    pub fn over(pattern: &CreasePattern, edge: f64) -> Self {
        let bounds = pattern.bounds();
        let mut held = [vec![bounds.min.x, bounds.max.x], vec![bounds.min.y, bounds.max.y]];
        let tiny = 1e-9 * (bounds.max - bounds.min).norm();
        for vertex in pattern.vertices() {
            let far = [0, 1].map(|axis| {
                let distance = |it: &f64| (it - vertex[axis]).abs();
                held[axis].iter().map(distance).fold(f64::INFINITY, f64::min)
            });
            // Lines closer to each other than this would make needles of the cells between them; what is left over lies
            // inside of its cell.
            let axis = usize::from(far[1] > far[0]);
            if far[0] > tiny && far[1] > tiny && far[axis] >= CLOSEST * edge {
                held[axis].push(vertex[axis]);
            }
        }
        let lines = held.map(|mut held| {
            held.sort_by(f64::total_cmp);
            let mut lines = Vec::new();
            for pair in held.windows(2) {
                let parts = ((pair[1] - pair[0]) / edge).round().max(1.0) as usize;
                lines.extend((0..parts).map(|k| pair[0] + (pair[1] - pair[0]) * k as f64 / parts as f64));
            }
            lines.push(held[held.len() - 1]);
            lines
        });
        let spans: f64 = lines.iter().map(|it| it[it.len() - 1] - it[0]).sum();
        let unit = spans / (lines[0].len() + lines[1].len() - 2) as f64;
        Self { lines: lines.map(|it| it.into_iter().map(|x| x / unit).collect()), edge: unit }
    }

    fn node(&self, i: usize, j: usize) -> usize {
        j * self.lines[0].len() + i
    }

    fn place(&self, node: usize) -> Vec2 {
        let columns = self.lines[0].len();
        Vec2::new(self.lines[0][node % columns], self.lines[1][node / columns])
    }

    /// The cell that holds a point: column, row.
    fn cell(&self, p: Vec2) -> [usize; 2] {
        [0, 1].map(|axis| {
            let lines = &self.lines[axis];
            lines.partition_point(|&it| it <= p[axis]).clamp(1, lines.len() - 1) - 1
        })
    }
}

/// A fixed combination (1 − t) a + t b of two vertices.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mix {
    /// First vertex.
    pub a: u32,
    /// Second vertex; the same as `a` at a node of the grid.
    pub b: u32,
    /// Share of `b`.
    pub t: f64,
}

impl Mix {
    /// Its place.
    pub fn at(&self, x: &[Vec3]) -> Vec3 {
        x[self.a as usize] * (1.0 - self.t) + x[self.b as usize] * self.t
    }
}

/// Why no fold is asked for at a crease point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Degenerate {
    /// An end of a crease: a crease vertex, which is no crease point.
    Vertex,
    /// The crease is straight here.
    Straight,
    /// The edge is divided too unevenly.
    Split,
    /// The crease runs along the edge.
    Angle,
}

impl Degenerate {
    /// In words.
    pub fn why(self) -> &'static str {
        match self {
            Self::Vertex => "end of a crease",
            Self::Straight => "straight",
            Self::Split => "uneven split",
            Self::Angle => "along the grid",
        }
    }
}

/// Where a crease crosses a line of the grid.
#[derive(Debug, Clone, PartialEq)]
pub struct CreasePoint {
    /// Its crease.
    pub crease: usize,
    /// Way from the beginning of the crease.
    pub along: f64,
    /// Its place in the net on the left of the crease and in that on the right.
    pub sides: [Mix; 2],
    /// Flat place.
    pub flat: Vec2,
    /// The crease points before and after it.
    pub neighbours: Option<[usize; 2]>,
    /// Why it is left out of the fold terms.
    pub degenerate: Option<Degenerate>,
    /// Whether the edge from a to b leads from the right of the crease to its left.
    pub leftward: bool,
}

/// The inner vertex of a star and its neighbours, counter-clockwise: 4, or 3 along a border with the middle one opposite to it.
#[derive(Debug, Clone, PartialEq)]
pub struct Star {
    /// Centre.
    pub centre: u32,
    /// Neighbours.
    pub around: Vec<u32>,
}

/// A row of the Laplacian: vertices with their weights, and the area around the vertex.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// Vertices and weights.
    pub weights: Vec<(u32, f64)>,
    /// Area.
    pub area: f64,
}

/// The nets of all patches.
#[derive(Debug, Clone, PartialEq)]
pub struct Net {
    /// The grid under them.
    pub grid: Grid,
    /// Flat place of every vertex, z = 0.
    pub flat: Vec<Vec3>,
    /// Patch of every vertex.
    pub patch: Vec<u32>,
    /// Corners of every quad, counter-clockwise.
    pub quads: Vec<[u32; 4]>,
    /// Edges.
    pub edges: Vec<[u32; 2]>,
    /// Stars on which angles are equal.
    pub stars: Vec<Star>,
    /// Laplacian.
    pub laplacian: Vec<Row>,
    /// Crease points, along every crease in turn.
    pub points: Vec<CreasePoint>,
    /// Vertices by patch and node of the grid.
    index: BTreeMap<(usize, usize), u32>,
}

/// A crossing before it is looked up in the nets.
struct Crossing {
    along: f64,
    place: Vec2,
    nodes: [usize; 2],
    t: f64,
}

impl Net {
    /// Lays the nets.
    pub fn new(pattern: &CreasePattern, grid: Grid) -> Self {
        let crossings: Vec<Vec<Crossing>> = pattern
            .creases
            .iter()
            .map(|it| {
                let closed = it.closed;
                let mut points: Vec<Vec2> = it.points.iter().map(|p| p / grid.edge).collect();
                points.extend(closed.then(|| points[0]));
                crossings(&grid, &points)
            })
            .collect();
        let cells = cells_of_patches(pattern, &grid);
        let mut vertex: BTreeMap<(usize, usize), u32> = BTreeMap::new();
        for (patch, cells) in cells.iter().enumerate() {
            for &[i, j] in cells {
                for (di, dj) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                    vertex.insert((patch, grid.node(i + di, j + dj)), 0);
                }
            }
        }
        let mut out = Self {
            grid,
            flat: Vec::new(),
            patch: Vec::new(),
            quads: Vec::new(),
            edges: Vec::new(),
            stars: Vec::new(),
            laplacian: Vec::new(),
            points: Vec::new(),
            index: BTreeMap::new(),
        };
        for (k, (&(patch, node), index)) in vertex.iter_mut().enumerate() {
            *index = k as u32;
            let p = out.grid.place(node);
            out.flat.push(Vec3::new(p.x, p.y, 0.0));
            out.patch.push(patch as u32);
        }
        out.join(&cells, &vertex);
        for (crease, list) in crossings.into_iter().enumerate() {
            out.add_crease(pattern, crease, &list, &vertex);
        }
        out.index = vertex;
        out
    }

    /// Quads, edges, stars and the Laplacian.
    fn join(&mut self, cells: &[Vec<[usize; 2]>], vertex: &BTreeMap<(usize, usize), u32>) {
        let mut area = vec![0.0; self.flat.len()];
        // Neighbours towards +x, +y, −x, −y.
        let mut around = vec![[None::<u32>; 4]; self.flat.len()];
        for (patch, cells) in cells.iter().enumerate() {
            for &[i, j] in cells {
                let corner = |di, dj| vertex[&(patch, self.grid.node(i + di, j + dj))];
                let quad = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
                let diagonal = self.flat[quad[2] as usize] - self.flat[quad[0] as usize];
                for k in 0..4 {
                    let (a, b) = (quad[k], quad[(k + 1) % 4]);
                    area[a as usize] += 0.25 * diagonal.x * diagonal.y;
                    around[a as usize][k] = Some(b);
                    around[b as usize][(k + 2) % 4] = Some(a);
                }
                self.quads.push(quad);
            }
        }
        for (v, around) in around.iter().enumerate() {
            let v32 = v as u32;
            self.edges.extend(around[..2].iter().flatten().map(|&b| [v32, b]));
            let present: Vec<u32> = match around.iter().position(Option::is_none) {
                // Start after the gap, so that the middle one of three is opposite to it.
                Some(gap) => (1..4).filter_map(|k| around[(gap + k) % 4]).collect(),
                None => around.iter().flatten().copied().collect(),
            };
            if present.len() >= 3 {
                self.stars.push(Star { centre: v32, around: present });
            }
            let mut weights = vec![(v32, 0.0)];
            for pair in [[around[0], around[2]], [around[1], around[3]]] {
                if let [Some(after), Some(before)] = pair {
                    let [p, q] = [after, before].map(|it| (self.flat[it as usize] - self.flat[v]).norm());
                    weights.extend([(after, 2.0 / (p * (p + q))), (before, 2.0 / (q * (p + q)))]);
                    weights[0].1 -= 2.0 / (p * q);
                }
            }
            if weights.len() > 1 {
                self.laplacian.push(Row { weights, area: area[v] });
            }
        }
    }

    fn add_crease(
        &mut self,
        pattern: &CreasePattern,
        crease: usize,
        list: &[Crossing],
        vertex: &BTreeMap<(usize, usize), u32>,
    ) {
        let arc = &pattern.creases[crease];
        let closed = arc.closed;
        let first = self.points.len();
        let on = |patch: usize, it: &Crossing| {
            let [a, b] = it.nodes.map(|node| vertex.get(&(patch, node)).copied());
            Some(Mix { a: a?, b: b?, t: it.t })
        };
        let placed: Vec<(&Crossing, [Mix; 2])> =
            list.iter().filter_map(|it| Some((it, [on(arc.left, it)?, on(arc.right, it)?]))).collect();
        for (k, (it, sides)) in placed.iter().enumerate() {
            let n = placed.len();
            let inner = closed || (k > 0 && k + 1 < n);
            let neighbours = inner.then(|| [first + (k + n - 1) % n, first + (k + 1) % n]);
            let [before, after] = [placed[(k + n - 1) % n].0.place, placed[(k + 1) % n].0.place];
            let along = self.grid.place(it.nodes[1]) - self.grid.place(it.nodes[0]);
            let degenerate = match inner {
                true => degenerate(it, along, before, after),
                false => Some(Degenerate::Vertex),
            };
            let leftward = cross2(after - before, along) > 0.0;
            self.points.push(CreasePoint {
                crease,
                along: it.along,
                sides: *sides,
                flat: it.place,
                neighbours,
                degenerate,
                leftward,
            });
        }
    }

    /// A place of a patch (mm) as a combination of the four vertices around it; `towards` says which of the cells that share it
    /// is meant. `None` where the patch does not reach.
    pub fn locate(&self, patch: usize, place: Vec2, towards: Vec2) -> Option<[(u32, f64); 4]> {
        let [p, inside] = [place, place + (towards - place) * 1e-6].map(|it| it / self.grid.edge);
        let [i, j] = self.grid.cell(inside);
        let corner = |di, dj| self.index.get(&(patch, self.grid.node(i + di, j + dj))).copied();
        let lines = &self.grid.lines;
        let share = |axis: usize, k: usize| (p[axis] - lines[axis][k]) / (lines[axis][k + 1] - lines[axis][k]);
        let (s, t) = (share(0, i), share(1, j));
        Some([
            (corner(0, 0)?, (1.0 - s) * (1.0 - t)),
            (corner(1, 0)?, s * (1.0 - t)),
            (corner(1, 1)?, s * t),
            (corner(0, 1)?, (1.0 - s) * t),
        ])
    }

    /// The vertex of a patch nearest to a place (mm), in the form of [`Net::locate`].
    pub fn nearest(&self, patch: usize, place: Vec2) -> Option<[(u32, f64); 4]> {
        let p = place / self.grid.edge;
        let distance = |v: u32| (self.flat[v as usize].xy() - p).norm();
        let own = (0..self.flat.len() as u32).filter(|&v| self.patch[v as usize] == patch as u32);
        let v = own.min_by(|&a, &b| distance(a).total_cmp(&distance(b)))?;
        Some([(v, 1.0), (v, 0.0), (v, 0.0), (v, 0.0)])
    }

    /// Number of crease points that are not crease vertices.
    pub fn crease_points(&self) -> usize {
        self.points.iter().filter(|it| it.degenerate != Some(Degenerate::Vertex)).count()
    }

    /// Number of crease points left out for a reason.
    pub fn excluded(&self, reason: Degenerate) -> usize {
        self.points.iter().filter(|it| it.degenerate == Some(reason)).count()
    }
}

/// Cells that two creases run through although they do not meet in it or beside it; a place of each (mm).
pub fn crowded(pattern: &CreasePattern, grid: &Grid) -> Vec<Vec2> {
    let mut creases_of: BTreeMap<[usize; 2], BTreeMap<usize, Vec2>> = BTreeMap::new();
    for (k, crease) in pattern.creases.iter().enumerate() {
        let again = crease.points.first().filter(|_| crease.closed);
        let points: Vec<Vec2> = crease.points.iter().chain(again).map(|p| p / grid.edge).collect();
        for pair in points.windows(2) {
            for cell in cells_along(grid, [pair[0], pair[1]]) {
                creases_of.entry(cell).or_default().entry(k).or_insert(pair[0] * grid.edge);
            }
        }
    }
    let meeting: Vec<[usize; 2]> = pattern.vertices().iter().map(|p| grid.cell(p / grid.edge)).collect();
    let beside =
        |cell: &[usize; 2]| meeting.iter().any(|it| it[0].abs_diff(cell[0]) <= 1 && it[1].abs_diff(cell[1]) <= 1);
    creases_of
        .iter()
        .filter(|it| it.1.len() > 1 && !beside(it.0))
        .filter_map(|it| it.1.values().next().copied())
        .collect()
}

/// The rules of section 6.1, figure 12.
fn degenerate(it: &Crossing, along: Vec2, before: Vec2, after: Vec2) -> Option<Degenerate> {
    let (back, forth) = (before - it.place, after - it.place);
    let curvature = 2.0 * cross2(forth, back).abs() / (forth.norm() * back.norm() * (forth - back).norm());
    let angle = |a: Vec2| cross2(a, along).abs().atan2(a.dot(&along).abs()).to_degrees();
    let (short, long) = (it.t.min(1.0 - it.t), it.t.max(1.0 - it.t));
    if it.nodes[0] == it.nodes[1] || short < LEAST_SPLIT * long {
        Some(Degenerate::Split)
    } else if !(curvature >= LEAST_CURVATURE) {
        Some(Degenerate::Straight)
    } else if angle(back) < LEAST_ANGLE_DEG || angle(forth) < LEAST_ANGLE_DEG {
        Some(Degenerate::Angle)
    } else {
        None
    }
}

/// Crossings of a polyline with the lines of the grid, in order.
fn crossings(grid: &Grid, points: &[Vec2]) -> Vec<Crossing> {
    let tiny = 1e-7;
    let mut out: Vec<Crossing> = Vec::new();
    let mut start = 0.0;
    for pair in points.windows(2) {
        let (a, d) = (pair[0], pair[1] - pair[0]);
        let length = d.norm();
        for axis in [0, 1] {
            let (low, high) = (a[axis].min(a[axis] + d[axis]), a[axis].max(a[axis] + d[axis]));
            let lines = &grid.lines[axis];
            for k in lines.partition_point(|&x| x < low - tiny)..lines.partition_point(|&x| x <= high + tiny) {
                if d[axis] == 0.0 {
                    continue;
                }
                let s = ((lines[k] - a[axis]) / d[axis]).clamp(0.0, 1.0);
                let mut place = a + d * s;
                place[axis] = lines[k];
                let other = 1 - axis;
                let cell = grid.cell(place)[other];
                let (from, to) = (grid.lines[other][cell], grid.lines[other][cell + 1]);
                let mut t = (place[other] - from) / (to - from);
                if !(-1e-6..=1.0 + 1e-6).contains(&t) {
                    continue;
                }
                let node = |along: usize| if axis == 0 { grid.node(k, along) } else { grid.node(along, k) };
                let mut nodes = [node(cell), node(cell + 1)];
                if t < tiny {
                    (nodes, t) = ([nodes[0]; 2], 0.0);
                } else if t > 1.0 - tiny {
                    (nodes, t) = ([nodes[1]; 2], 0.0);
                }
                out.push(Crossing { along: start + s * length, place, nodes, t });
            }
        }
        start += length;
    }
    out.sort_by(|a, b| a.along.total_cmp(&b.along));
    // A sample on a line is met by both of its segments, a node of the grid by both lines.
    out.dedup_by(|b, a| (b.place - a.place).norm() < 10.0 * tiny);
    let closed = points[0] == points[points.len() - 1];
    if closed && out.len() > 1 && (out[out.len() - 1].place - out[0].place).norm() < 10.0 * tiny {
        out.pop();
    }
    out
}

/// The cells that every patch reaches into, in order of row and column.
fn cells_of_patches(pattern: &CreasePattern, grid: &Grid) -> Vec<Vec<[usize; 2]>> {
    let (columns, rows) = (grid.lines[0].len() - 1, grid.lines[1].len() - 1);
    let mut patches_of = vec![Vec::new(); columns * rows];
    for (patch, contours) in pattern.patches.iter().enumerate() {
        for contour in contours {
            for (k, p) in contour.iter().enumerate() {
                let ends = [p / grid.edge, contour[(k + 1) % contour.len()] / grid.edge];
                for [i, j] in cells_along(grid, ends) {
                    patches_of[j * columns + i].push(patch);
                }
            }
        }
    }
    let mut out = vec![Vec::new(); pattern.patches.len()];
    for j in 0..rows {
        for i in 0..columns {
            let mut list = std::mem::take(&mut patches_of[j * columns + i]);
            if list.is_empty() {
                let [x, y] = [(0, i), (1, j)].map(|(axis, k)| 0.5 * (grid.lines[axis][k] + grid.lines[axis][k + 1]));
                list.extend(pattern.patch_at(Vec2::new(x, y) * grid.edge));
            }
            list.sort_unstable();
            list.dedup();
            list.into_iter().for_each(|patch| out[patch].push([i, j]));
        }
    }
    out
}

/// Cells whose inside a segment passes.
fn cells_along(grid: &Grid, [a, b]: [Vec2; 2]) -> Vec<[usize; 2]> {
    let d = b - a;
    let mut cuts = vec![0.0, 1.0];
    for axis in [0, 1] {
        let lines = &grid.lines[axis];
        let (low, high) = (a[axis].min(b[axis]), a[axis].max(b[axis]));
        let between = lines.iter().skip(lines.partition_point(|&x| x <= low)).take_while(|&&x| x < high);
        cuts.extend(between.map(|line| (line - a[axis]) / d[axis]));
    }
    cuts.sort_by(f64::total_cmp);
    let inside = |p: Vec2| {
        [0, 1].iter().all(|&axis| {
            let lines = &grid.lines[axis];
            let cell = grid.cell(p)[axis];
            p[axis] > lines[cell] + 1e-7 && p[axis] < lines[cell + 1] - 1e-7
        })
    };
    let middles =
        cuts.windows(2).filter(|it| (it[1] - it[0]) * d.norm() > 1e-7).map(|it| a + d * (0.5 * (it[0] + it[1])));
    middles.filter(|&p| inside(p)).map(|p| grid.cell(p)).collect()
}
