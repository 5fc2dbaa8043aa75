//! Pieces on their way: a forest of tiles joined at folded hinges, each tree laid flat without overlap.
use nalgebra::Isometry2;

use super::{Options, tiles::Tiles};
use crate::geom::{
    Box2, Vec2, cross2,
    polygon::{convex_hull, least_excess},
};

/// Corners of one vertex in the plane lie nearer than this, mm: motions are composed thousands of times.
const SAME: f64 = 1e-6;
/// Angles and depths of overlap up to this are rounding.
const ROUNDING: f64 = 1e-9;
const NONE: u32 = u32::MAX;

/// A triangle in the plane: corners counter-clockwise, the vertices of the mesh there, and its box.
#[derive(Debug, Clone, Copy)]
struct Triangle {
    corners: [Vec2; 3],
    vertices: [u32; 3],
    bounds: Box2,
}

/// A tree of tiles laid flat.
#[derive(Debug, Clone, Default)]
struct Piece {
    tiles: Vec<u32>,
    area: f64,
    hull: Vec<Vec2>,
}

/// A change of the forest: tiles that leave their piece, at which fold, and the hinge at which they are joined anew.
#[derive(Debug, Clone)]
pub(super) struct Move {
    /// The tiles; all of one piece when nothing is opened.
    pub(super) tiles: Vec<u32>,
    /// The fold to be opened.
    pub(super) open: Option<u32>,
    /// The hinge to be folded.
    pub(super) fold: u32,
    /// The tile of `fold` that stays.
    pub(super) stays: u32,
}

/// All pieces.
#[derive(Debug, Clone)]
pub(super) struct Forest<'a> {
    it: &'a Tiles,
    options: &'a Options,
    /// Whether a hinge is folded.
    folded: Vec<bool>,
    piece_of: Vec<u32>,
    place: Vec<Isometry2<f64>>,
    placed: Vec<Vec<Triangle>>,
    bounds: Vec<Box2>,
    pieces: Vec<Piece>,
    /// Scratch: the last search that reached a tile, and from where.
    reached: Vec<u32>,
    parent: Vec<(u32, u32)>,
    stamp: u32,
}

impl<'a> Forest<'a> {
    /// Every tile for itself.
    pub(super) fn new(it: &'a Tiles, options: &'a Options) -> Self {
        let n = it.tiles.len();
        let mut out = Self {
            it,
            options,
            folded: vec![false; it.hinges.len()],
            piece_of: (0..n as u32).collect(),
            place: vec![Isometry2::identity(); n],
            placed: vec![Vec::new(); n],
            bounds: vec![Box2::empty(); n],
            pieces: vec![Piece::default(); n],
            reached: vec![NONE; n],
            parent: vec![(NONE, NONE); n],
            stamp: 0,
        };
        for t in 0..n {
            out.put(t as u32, Isometry2::identity());
            out.pieces[t].tiles = vec![t as u32];
            out.remeasure(t);
        }
        out
    }

    /// The same trees laid flat anew from their first tiles, so that no rounding of the moves is left.
    pub(super) fn of(it: &'a Tiles, options: &'a Options, folded: &[bool]) -> Self {
        let mut out = Self::new(it, options);
        out.folded = folded.to_vec();
        out.pieces.iter_mut().for_each(|it| it.tiles.clear());
        let mut seen = vec![false; it.tiles.len()];
        for root in 0..it.tiles.len() as u32 {
            if seen[root as usize] {
                continue;
            }
            let tree = out.walk(root, None);
            for &t in &tree {
                seen[t as usize] = true;
                out.piece_of[t as usize] = root;
                let (hinge, back) = out.parent[t as usize];
                if hinge != NONE {
                    out.put(t, out.place[back as usize] * it.across(hinge, back));
                }
            }
            out.pieces[root as usize].tiles = tree;
            out.remeasure(root as usize);
        }
        out
    }

    /// Whether each hinge is folded.
    pub(super) fn folded(&self) -> &[bool] {
        &self.folded
    }

    /// Whether a hinge is folded.
    pub(super) fn is_folded(&self, hinge: u32) -> bool {
        self.folded[hinge as usize]
    }

    /// Number of pieces.
    pub(super) fn count(&self) -> usize {
        self.pieces.iter().filter(|it| !it.tiles.is_empty()).count()
    }

    /// Length of all hinges that are cut, mm.
    pub(super) fn seam_length(&self) -> f64 {
        self.it.hinges.iter().zip(&self.folded).filter(|it| !it.1).map(|it| it.0.length).sum()
    }

    /// Length of all hinges, mm.
    pub(super) fn hinge_length(&self) -> f64 {
        self.it.hinges.iter().map(|it| it.length).sum::<f64>().max(f64::MIN_POSITIVE)
    }

    /// Areas of the pieces, mm².
    pub(super) fn areas(&self) -> impl Iterator<Item = f64> + '_ {
        self.pieces.iter().filter(|it| !it.tiles.is_empty()).map(|it| it.area)
    }

    /// Area of the piece of a tile, mm².
    pub(super) fn area(&self, tile: u32) -> f64 {
        self.pieces[self.piece_of[tile as usize] as usize].area
    }

    /// The piece of a tile.
    pub(super) fn piece(&self, tile: u32) -> u32 {
        self.piece_of[tile as usize]
    }

    /// The tiles of a piece.
    pub(super) fn tiles(&self, piece: u32) -> &[u32] {
        &self.pieces[piece as usize].tiles
    }

    /// Where the tiles lie in their pieces.
    pub(super) fn place(&self, tile: u32) -> Isometry2<f64> {
        self.place[tile as usize]
    }

    /// Tiles of the tree of `from` in the order of their distance, with fold and tile towards `from`, not crossing `closed`.
    fn walk(&mut self, from: u32, closed: Option<u32>) -> Vec<u32> {
        self.stamp += 1;
        let mut order = vec![from];
        self.reached[from as usize] = self.stamp;
        self.parent[from as usize] = (NONE, NONE);
        let mut done = 0;
        while done < order.len() {
            let t = order[done];
            for &(hinge, other) in &self.it.around[t as usize] {
                let open = self.folded[hinge as usize] && Some(hinge) != closed;
                if open && self.reached[other as usize] != self.stamp {
                    self.reached[other as usize] = self.stamp;
                    self.parent[other as usize] = (hinge, t);
                    order.push(other);
                }
            }
            done += 1;
        }
        order
    }

    /// The folds from `from` to `to`, which are in one piece.
    pub(super) fn path(&mut self, from: u32, to: u32) -> Vec<u32> {
        self.walk(from, None);
        let mut out = Vec::new();
        let mut at = to;
        while self.parent[at as usize].0 != NONE {
            out.push(self.parent[at as usize].0);
            at = self.parent[at as usize].1;
        }
        out
    }

    /// The first fold on the way from one tile of a piece to another.
    pub(super) fn first_fold(&mut self, from: u32, to: u32) -> Option<u32> {
        self.walk(to, None);
        Some(self.parent[from as usize].0).filter(|&it| it != NONE)
    }

    /// The tiles on the side of `tile` once a fold is opened.
    pub(super) fn side(&mut self, tile: u32, open: Option<u32>) -> Vec<u32> {
        self.walk(tile, open)
    }

    /// Whether a move gives pieces without overlap that fit.
    pub(super) fn allows(&mut self, it: &Move) -> bool {
        let motion = self.motion(it);
        self.stamp += 1;
        for &t in &it.tiles {
            self.reached[t as usize] = self.stamp;
        }
        let target = &self.pieces[self.piece_of[it.stays as usize] as usize];
        let stay = || target.tiles.iter().filter(|&&t| self.reached[t as usize] != self.stamp);
        let mut moved: Vec<Triangle> = it
            .tiles
            .iter()
            .flat_map(|&t| &self.placed[t as usize])
            .map(|it| triangle(it.corners.map(|p| (motion * nalgebra::Point2::from(p)).coords), it.vertices))
            .collect();
        if !self.fits(it, &moved, stay()) {
            return false;
        }
        moved.sort_by(|a, b| a.bounds.min.x.total_cmp(&b.bounds.min.x));
        let reach = self.options.clearance;
        let widest = moved.iter().map(|it| it.bounds.size().x).fold(0.0, f64::max);
        let all = moved.iter().fold(Box2::empty(), |mut all, it| {
            all.grow(&it.bounds.min);
            all.grow(&it.bounds.max);
            all
        });
        let all = all.grown(reach);
        stay().filter(|&&t| self.bounds[t as usize].touches(&all)).flat_map(|&t| &self.placed[t as usize]).all(
            |there| {
                let near = there.bounds.grown(reach);
                let first = moved.partition_point(|it| it.bounds.min.x < near.min.x - widest);
                moved[first..]
                    .iter()
                    .take_while(|it| it.bounds.min.x <= near.max.x)
                    .all(|here| !here.bounds.touches(&near) || !self.conflict(here, there))
            },
        )
    }

    /// How the tiles of a move come to lie in their new piece.
    fn motion(&self, it: &Move) -> Isometry2<f64> {
        let [a, b] = self.it.hinges[it.fold as usize].tiles;
        let mover = if a == it.stays { b } else { a };
        let new = self.place[it.stays as usize] * self.it.across(it.fold, it.stays);
        new * self.place[mover as usize].inverse()
    }

    /// Whether the piece with the moved triangles fits on the sheet.
    fn fits<'t>(&self, it: &Move, moved: &[Triangle], stay: impl Iterator<Item = &'t u32>) -> bool {
        let Some(size) = self.options.sheet else { return true };
        let target = self.piece_of[it.stays as usize];
        let mut points: Vec<Vec2> = if self.piece_of[it.tiles[0] as usize] == target {
            stay.flat_map(|&t| &self.placed[t as usize]).flat_map(|it| it.corners).collect()
        } else {
            self.pieces[target as usize].hull.clone()
        };
        points.extend(moved.iter().flat_map(|it| it.corners));
        let size_of = Box2::of(&points).size();
        let [short, long] = [size[0].min(size[1]), size[0].max(size[1])];
        if size_of.norm() <= short || size_of.min() <= short && size_of.max() <= long {
            return true;
        }
        least_excess(&convex_hull(&points), size).0 <= 1.0
    }

    /// Makes a move.
    pub(super) fn make(&mut self, it: &Move) {
        let motion = self.motion(it);
        let from = self.piece_of[it.tiles[0] as usize] as usize;
        let to = self.piece_of[it.stays as usize] as usize;
        if let Some(open) = it.open {
            self.folded[open as usize] = false;
        }
        self.folded[it.fold as usize] = true;
        for &t in &it.tiles {
            let mut place = motion * self.place[t as usize];
            place.rotation.renormalize();
            self.put(t, place);
            self.piece_of[t as usize] = to as u32;
        }
        if from != to {
            let owner = std::mem::take(&mut self.pieces[from].tiles);
            self.pieces[from].tiles = owner.into_iter().filter(|&t| self.piece_of[t as usize] == from as u32).collect();
            self.pieces[to].tiles.extend(&it.tiles);
            self.remeasure(from);
        }
        self.remeasure(to);
    }

    /// Opens a fold: the side of its second tile becomes a piece of its own.
    pub(super) fn split(&mut self, fold: u32) {
        let [stays, goes] = self.it.hinges[fold as usize].tiles;
        let from = self.piece_of[stays as usize] as usize;
        self.folded[fold as usize] = false;
        let to = self.pieces.iter().position(|it| it.tiles.is_empty()).expect("there are as many places as tiles");
        let tiles = self.walk(goes, None);
        tiles.iter().for_each(|&t| self.piece_of[t as usize] = to as u32);
        self.pieces[to].tiles = tiles;
        self.pieces[from].tiles = self.walk(stays, None);
        self.remeasure(to);
        self.remeasure(from);
    }

    fn put(&mut self, tile: u32, place: Isometry2<f64>) {
        let t = tile as usize;
        self.place[t] = place;
        let it = &self.it.tiles[t];
        self.placed[t] = it
            .triangles
            .iter()
            .zip(&it.faces)
            .map(|(corners, &f)| {
                triangle(corners.map(|p| (place * nalgebra::Point2::from(p)).coords), self.it.corners[f])
            })
            .collect();
        self.bounds[t] = Box2::of(self.placed[t].iter().flat_map(|it| &it.corners));
    }

    fn remeasure(&mut self, piece: usize) {
        let tiles = &self.pieces[piece].tiles;
        let area = tiles.iter().map(|&t| self.it.tiles[t as usize].area).sum();
        let points: Vec<Vec2> =
            tiles.iter().flat_map(|&t| &self.placed[t as usize]).flat_map(|it| it.corners).collect();
        self.pieces[piece].area = area;
        self.pieces[piece].hull = convex_hull(&points);
    }

    /// Whether two triangles of a piece overlap or lie too close.
    ///
    /// Neighbours across a fold share two corners. With one common corner only the angle between them counts. Both sides of
    /// a slit may come as close as the slit is narrow; everything else keeps the clearance.
    fn conflict(&self, a: &Triangle, b: &Triangle) -> bool {
        let (mut touching, mut common, mut at) = (0, 0, (0, 0));
        for i in 0..3 {
            for j in 0..3 {
                if a.vertices[i] == b.vertices[j] {
                    common += 1;
                    if (a.corners[i] - b.corners[j]).norm_squared() < SAME * SAME {
                        touching += 1;
                        at = (i, j);
                    }
                }
            }
        }
        match touching {
            0 => separation(&a.corners, &b.corners) < if common > 0 { -ROUNDING } else { self.options.clearance },
            1 => cones_meet(a, b, at, if common > 1 { -ROUNDING } else { self.options.least_opening }),
            _ => false,
        }
    }
}

fn triangle(corners: [Vec2; 3], vertices: [u32; 3]) -> Triangle {
    Triangle { corners, vertices, bounds: Box2::of(&corners) }
}

/// The largest distance by which a line along an edge separates two triangles; negative when none does. For triangles
/// apart it is at most their distance.
fn separation(a: &[Vec2; 3], b: &[Vec2; 3]) -> f64 {
    let along = |p: &[Vec2; 3], q: &[Vec2; 3]| {
        (0..3)
            .map(|k| {
                let edge = p[(k + 1) % 3] - p[k];
                let outward = Vec2::new(edge.y, -edge.x) / edge.norm();
                q.iter().map(|&v| outward.dot(&(v - p[k]))).fold(f64::INFINITY, f64::min)
            })
            .fold(f64::NEG_INFINITY, f64::max)
    };
    along(a, b).max(along(b, a))
}

/// Whether the corners `at` of two triangles, which lie in one point, overlap or leave less than `gap` radians between
/// them.
fn cones_meet(a: &Triangle, b: &Triangle, at: (usize, usize), gap: f64) -> bool {
    let sides = |it: &Triangle, k: usize| [1, 2].map(|i| (it.corners[(k + i) % 3] - it.corners[k]).normalize());
    let (a, b) = (sides(a, at.0), sides(b, at.1));
    let inside = |cone: &[Vec2; 2], d: &Vec2| {
        let [left, right] = [cross2(cone[0], *d), cross2(*d, cone[1])];
        left > -gap && right > -gap && d.dot(&(cone[0] + cone[1])) > 0.0
    };
    let middle = |cone: &[Vec2; 2]| (cone[0] + cone[1]).normalize();
    b.iter().chain([&middle(&b)]).any(|d| inside(&a, d)) || a.iter().chain([&middle(&a)]).any(|d| inside(&b, d))
}
