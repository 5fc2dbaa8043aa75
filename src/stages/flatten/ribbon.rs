//! Pieces as ribbons: how long and how wide strips are in the plane.
use crate::{
    geom::{Vec2, cross2},
    mesh::Field,
    model::{CutMesh, Flattening, PieceId},
};

/// A piece measured as a ribbon.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Ribbon {
    /// Area over median width, mm.
    pub length: f64,
    /// The widths that 5, 50 and 95 % of its outline keep, measured inwards at right angles to the outline, mm.
    pub width: [f64; 3],
}

/// Measures every piece, and all of them as the parts of one strip. O(n²) for n edges of an outline.
pub fn ribbons(cut: &CutMesh, flat: &Flattening) -> (Field<PieceId, Ribbon>, Ribbon) {
    let mut sides: Field<PieceId, Vec<[Vec2; 2]>> = Field::filled(cut.pieces.len(), Vec::new());
    for h in cut.mesh.halfedges().filter(|&h| cut.mesh.twin(h).is_none()) {
        sides[cut.piece_of[cut.mesh.face(h)]].push([cut.mesh.tail(h), cut.mesh.head(h)].map(|v| flat.uv[v]));
    }
    let mut area = Field::<PieceId, f64>::filled(cut.pieces.len(), 0.0);
    for f in cut.mesh.faces() {
        area[cut.piece_of[f]] += crate::geom::signed_area(&cut.mesh.face_vertices(f).map(|v| flat.uv[v]));
    }
    let mut all = Vec::new();
    let pieces = Field::from_fn(sides.len(), |piece| {
        let sides = &sides[piece];
        let widths: Vec<(f64, f64)> =
            (0..sides.len()).filter_map(|k| Some((across(sides, k)?, (sides[k][1] - sides[k][0]).norm()))).collect();
        all.extend_from_slice(&widths);
        ribbon(area[piece], widths)
    });
    (pieces, ribbon(area.iter().sum(), all))
}

/// A ribbon of an area from widths with the lengths of outline that keep them.
fn ribbon(area: f64, mut widths: Vec<(f64, f64)>) -> Ribbon {
    widths.sort_by(|a, b| a.0.total_cmp(&b.0));
    let total: f64 = widths.iter().map(|it| it.1).sum();
    let quantile = |share: f64| {
        let mut sum = 0.0;
        let reached = widths.iter().find(|it| {
            sum += it.1;
            sum >= share * total
        });
        reached.map_or(0.0, |it| it.0)
    };
    let width = [0.05, 0.5, 0.95].map(quantile);
    Ribbon { length: area / width[1].max(f64::MIN_POSITIVE), width }
}

/// How far it is from the middle of side `k` straight inwards, to its left, to the next side.
fn across(sides: &[[Vec2; 2]], k: usize) -> Option<f64> {
    let [a, b] = sides[k];
    let (middle, along) = ((a + b) / 2.0, b - a);
    let inwards = Vec2::new(-along.y, along.x).try_normalize(0.0)?;
    let hit = |&[p, q]: &[Vec2; 2]| {
        let side = q - p;
        let turn = cross2(inwards, side);
        // middle + t inwards = p + s side
        let (t, s) = (cross2(p - middle, side) / turn, cross2(p - middle, inwards) / turn);
        (t > 1e-9 && (0.0..=1.0).contains(&s)).then_some(t)
    };
    let others = sides.iter().enumerate().filter(|it| it.0 != k);
    others.filter_map(|it| hit(it.1)).min_by(f64::total_cmp)
}
