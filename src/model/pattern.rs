//! A flat sheet with the creases that it is to be folded along.
use std::collections::VecDeque;

use crate::geom::{
    Box2, Vec2,
    arrangement::{Arc, Arrangement},
    polygon,
};

/// Kind of the borders of an [`Arrangement`] that becomes a pattern; every other kind is a crease.
pub const BORDER: u32 = 0;

/// A crease from one crease vertex to the next, or a closed one that meets nothing.
#[derive(Debug, Clone, PartialEq)]
pub struct Crease {
    /// Kind of its line in the drawing.
    pub kind: u32,
    /// Its points, mm; the first of a closed one is not repeated.
    pub points: Vec<Vec2>,
    /// Whether the last point joins the first.
    pub closed: bool,
    /// Patch on its left.
    pub left: usize,
    /// Patch on its right; the same one where a crease ends inside the paper.
    pub right: usize,
}

/// Paper, divided into patches by creases. Both sides of every crease are paper.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct CreasePattern {
    /// The creases, each with the patches on its two sides.
    pub creases: Vec<Crease>,
    /// Closed boundaries of every patch, paper on the left, mm.
    pub patches: Vec<Vec<Vec<Vec2>>>,
}

/// Kind of the creases that are drawn as mountains.
pub const MOUNTAIN: u32 = 1;
/// Kind of those drawn as valleys.
pub const VALLEY: u32 = 2;
/// Kind of those that may be either.
pub const UNASSIGNED: u32 = 3;

impl Crease {
    /// 1 where it is drawn as a mountain, −1 as a valley, 0 where it may be either.
    pub fn drawn_side(&self) -> f64 {
        match self.kind {
            MOUNTAIN => 1.0,
            VALLEY => -1.0,
            _ => 0.0,
        }
    }
}

impl CreasePattern {
    /// Tells paper from air: crossing a border goes from one to the other, crossing a crease does not. Creases that lie off the
    /// paper are left out.
    pub fn new(drawing: &Arrangement) -> Self {
        let paper = drawing.inside(BORDER);
        let mut patch_of = vec![usize::MAX; drawing.faces.len()];
        let mut out = Self::default();
        for face in (0..drawing.faces.len()).filter(|&it| paper[it]) {
            patch_of[face] = out.patches.len();
            out.patches.push(drawing.faces[face].clone());
        }
        let on_paper = |it: &&Arc| it.kind != BORDER && paper[it.left] && paper[it.right];
        out.creases = drawing
            .arcs
            .iter()
            .filter(on_paper)
            .map(|it| Crease {
                kind: it.kind,
                points: it.points.clone(),
                closed: it.ends.is_none(),
                left: patch_of[it.left],
                right: patch_of[it.right],
            })
            .collect();
        out
    }

    /// The box around the paper.
    pub fn bounds(&self) -> Box2 {
        Box2::of(self.patches.iter().flatten().flatten())
    }

    /// The patch that a point lies in.
    pub fn patch_at(&self, p: Vec2) -> Option<usize> {
        self.patches.iter().position(|it| polygon::contains(it, p))
    }

    /// Where creases meet creases or the border, once each.
    pub fn vertices(&self) -> Vec<Vec2> {
        let mut out: Vec<Vec2> = Vec::new();
        for crease in self.creases.iter().filter(|it| !it.closed) {
            for p in [crease.points[0], crease.points[crease.points.len() - 1]] {
                if !out.contains(&p) {
                    out.push(p);
                }
            }
        }
        out
    }

    /// The body of paper that every patch belongs to, numbered from 0 in the order of their first patches: patches hang
    /// together through creases.
    pub fn bodies(&self) -> Vec<usize> {
        let mut body = vec![usize::MAX; self.patches.len()];
        let mut count = 0;
        for start in 0..body.len() {
            if body[start] != usize::MAX {
                continue;
            }
            body[start] = count;
            let mut queue = VecDeque::from([start]);
            while let Some(patch) = queue.pop_front() {
                for it in self.creases.iter().filter(|it| it.left == patch || it.right == patch) {
                    let other = it.left + it.right - patch;
                    if body[other] == usize::MAX {
                        body[other] = count;
                        queue.push_back(other);
                    }
                }
            }
            count += 1;
        }
        body
    }
}
