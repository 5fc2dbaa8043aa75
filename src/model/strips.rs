//! Rulings and planar strips of the pieces.
use super::PieceId;
use crate::{
    geom::{Vec2, Vec3, ears::ears},
    mesh::{Field, TriMesh, VertexId},
};

/// A point of the outline of a panel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Corner {
    /// Index into [`Strips::points`].
    pub point: u32,
    /// Its place in the plane of its piece, mm.
    pub uv: Vec2,
}

/// What a panel is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum PanelKind {
    /// Between two rulings without a common end; its other sides follow the outline of the piece.
    Quad,
    /// Four or more corners, and not between two rulings alone: a planar region, or the end of a strip.
    Polygon,
    /// Three corners, as far as its outline can be told from one at a hundredth of its size.
    Triangle,
}

/// A planar panel. Its outline keeps every sample of the piece's outline, so panels of neighbouring pieces meet in the
/// same points.
#[derive(Debug, Clone, PartialEq)]
pub struct Panel {
    /// Its piece.
    pub piece: PieceId,
    /// Its strip, numbered through the piece from the largest area; panels between three or more rulings, and any that
    /// stand alone, are a strip of their own.
    pub strip: u32,
    /// What it is.
    pub kind: PanelKind,
    /// Its corners, counter-clockwise, as indices into [`Strips::corners`].
    pub outline: Vec<u32>,
}

/// A straight line between two panels along which the surface bends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ruling {
    /// Its piece.
    pub piece: PieceId,
    /// Its ends, as indices into [`Strips::corners`].
    pub ends: [u32; 2],
    /// The panels on its left and on its right.
    pub panels: [u32; 2],
    /// Angle between the normals of its panels, radians; positive where the surface is convex (a mountain fold).
    pub bend: f64,
    /// Radius of the curvature across it at its start, its middle and its end, mm; infinite where nothing bends.
    pub radius: [f64; 3],
    /// Length along the developed surface, mm.
    pub length: f64,
    /// Largest distance of the surface along it from the straight line, mm.
    pub bow: f64,
}

/// What is known of the rulings of a piece.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ruled {
    /// It has rulings.
    Yes,
    /// It is planar: one panel.
    Flat,
    /// It bends along any set of straight lines: it is given as triangles.
    Unreliable,
    /// No set of straight chords fills it (the flat piece folds over itself).
    Unsolved,
}

/// Every piece as strips of planar panels between straight rulings that do not cross and fill it.
#[derive(Debug, Clone, PartialEq)]
pub struct Strips {
    /// Points in space, mm; panels on both sides of a seam share them.
    pub points: Vec<Vec3>,
    /// Points of the outlines of all pieces, in the plane.
    pub corners: Vec<Corner>,
    /// Panels by piece, strip, and place in the strip.
    pub panels: Vec<Panel>,
    /// Rulings by piece.
    pub rulings: Vec<Ruling>,
    /// Per piece.
    pub ruled: Field<PieceId, Ruled>,
    /// How much each piece bends along its rulings, in shares of how much it bends in all; 0 for a planar piece.
    pub residual: Field<PieceId, f64>,
    /// Per vertex of the cut mesh, the direction of the ruling through it in the plane with its angle doubled, times a
    /// confidence in [0, 1]: (cos 2φ, sin 2φ) c.
    pub directions: Field<VertexId, Vec2>,
    /// Rulings that bend at least this much are folds, the others are rolled, radians.
    pub fold_angle: f64,
    /// Panels leave the outline of their piece by at most this where that can be avoided, mm.
    pub tolerance: f64,
}

impl Strips {
    /// Place of a corner in space.
    pub fn place(&self, corner: u32) -> Vec3 {
        self.points[self.corners[corner as usize].point as usize]
    }

    /// Place of a corner in the plane.
    pub fn flat(&self, corner: u32) -> Vec2 {
        self.corners[corner as usize].uv
    }

    /// Outline of a panel in the plane.
    pub fn flat_outline(&self, panel: &Panel) -> Vec<Vec2> {
        panel.outline.iter().map(|&c| self.flat(c)).collect()
    }

    /// Per panel the number of its strip, counted through the job, so that neighbours differ.
    pub fn numbers(&self) -> Vec<usize> {
        let mut out = vec![0; self.panels.len()];
        for p in 1..out.len() {
            let [a, b] = [&self.panels[p - 1], &self.panels[p]];
            out[p] = out[p - 1] + usize::from((a.piece, a.strip) != (b.piece, b.strip));
        }
        out
    }

    /// Unit normal of a panel in space, by the area vector of its outline.
    pub fn normal(&self, panel: &Panel) -> Vec3 {
        let origin = self.place(panel.outline[0]);
        let sides = panel.outline.windows(2).map(|w| (self.place(w[0]) - origin).cross(&(self.place(w[1]) - origin)));
        sides.sum::<Vec3>().try_normalize(0.0).unwrap_or_else(Vec3::zeros)
    }

    /// The panels in space as a triangle mesh in which every panel is a component, with the panel of each face. Triangles
    /// without area are left out. `None` when nothing is left.
    pub fn mesh(&self) -> Option<(TriMesh, Vec<usize>)> {
        let (mut positions, mut faces, mut panels) = (Vec::new(), Vec::new(), Vec::new());
        for (p, panel) in self.panels.iter().enumerate() {
            let first = positions.len();
            let mut local = vec![u32::MAX; panel.outline.len()];
            for t in ears(&self.flat_outline(panel)) {
                let corners = t.map(|k| self.place(panel.outline[k]));
                if is_degenerate(corners) {
                    continue;
                }
                for k in t {
                    if local[k] == u32::MAX {
                        local[k] = positions.len() as u32;
                        positions.push(self.place(panel.outline[k]));
                    }
                }
                faces.push(t.map(|k| local[k]));
                panels.push(p);
            }
            // A face left out can leave two fans at a corner; then each triangle of the panel stands alone.
            let own: Vec<[u32; 3]> = faces[panels.partition_point(|&it| it < p)..].to_vec();
            let shift = |t: &[u32; 3]| t.map(|i| i - first as u32);
            if !own.is_empty()
                && TriMesh::new(positions[first..].to_vec(), &own.iter().map(shift).collect::<Vec<_>>()).is_err()
            {
                let places: Vec<Vec3> = own.iter().flatten().map(|&i| positions[i as usize]).collect();
                positions.truncate(first);
                positions.extend(places);
                let at = faces.len() - own.len();
                for (k, face) in faces[at..].iter_mut().enumerate() {
                    *face = [0, 1, 2].map(|i| (first + 3 * k + i) as u32);
                }
            }
        }
        Some((TriMesh::new(positions, &faces).ok()?, panels))
    }
}

/// Area below a billionth of the square of the longest side.
fn is_degenerate([a, b, c]: [Vec3; 3]) -> bool {
    let longest = (b - a).norm_squared().max((c - b).norm_squared()).max((a - c).norm_squared());
    (b - a).cross(&(c - a)).norm() <= 1e-9 * longest
}
