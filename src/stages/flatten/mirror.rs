//! Pieces that are each other's mirror image: cut from one template turned over, or from folded fabric.
use crate::{
    geom::Vec2,
    mesh::Field,
    model::{CutMesh, Flattening, PieceId},
    surface::chart::labelled_charts,
};

/// Points of an outline that are compared.
const POINTS: usize = 256;
/// Outlines are alike when they differ by less than this share of their length, in the mean square.
const ALIKE: f64 = 0.004;

/// An outline by points at equal distances along it, about their centre.
struct Outline {
    piece: PieceId,
    length: f64,
    points: Vec<Vec2>,
}

/// Pairs of pieces with one outline each that are mirror images, the most alike first chosen, each piece in one pair at most.
pub fn mirrored(cut: &CutMesh, flat: &Flattening) -> Vec<[PieceId; 2]> {
    let mut outlines: Vec<Outline> = Vec::new();
    for (piece, chart) in
        Field::<PieceId, _>::from_vec(labelled_charts(&cut.mesh, &cut.piece_of, cut.pieces.len())).enumerate()
    {
        let uv: Vec<Vec2> = chart.origin.iter().map(|&v| flat.uv[v]).collect();
        if let [contour] = chart.contours(&uv).as_slice() {
            outlines.push(sampled(piece, contour));
        }
    }
    let mut pairs: Vec<(f64, [PieceId; 2])> = Vec::new();
    for (i, a) in outlines.iter().enumerate() {
        for b in &outlines[i + 1..] {
            let length = a.length.max(b.length);
            if (a.length - b.length).abs() < ALIKE * length {
                let off = difference(&a.points, &b.points) / length;
                pairs.extend((off < ALIKE).then_some((off, [a.piece, b.piece])));
            }
        }
    }
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let mut taken = Field::<PieceId, bool>::filled(cut.pieces.len(), false);
    let mut out = Vec::new();
    for (_, pair) in pairs {
        if pair.iter().all(|&it| !taken[it]) {
            pair.iter().for_each(|&it| taken[it] = true);
            out.push(pair);
        }
    }
    out.sort_unstable();
    out
}

fn sampled(piece: PieceId, contour: &[Vec2]) -> Outline {
    let n = contour.len();
    let mut ends = Vec::with_capacity(n);
    let mut length = 0.0;
    for i in 0..n {
        length += (contour[(i + 1) % n] - contour[i]).norm();
        ends.push(length);
    }
    let mut points: Vec<Vec2> = (0..POINTS)
        .map(|k| {
            let at = length * k as f64 / POINTS as f64;
            let i = ends.partition_point(|&end| end <= at).min(n - 1);
            let (from, to) = (contour[i], contour[(i + 1) % n]);
            let side = (to - from).norm();
            if side > 0.0 { to - (to - from) * ((ends[i] - at) / side) } else { from }
        })
        .collect();
    let centre = points.iter().sum::<Vec2>() / POINTS as f64;
    points.iter_mut().for_each(|p| *p -= centre);
    Outline { piece, length, points }
}

/// Root of the mean squared distance between an outline and the mirror image of another, turned and begun as fits best, mm.
fn difference(a: &[Vec2], b: &[Vec2]) -> f64 {
    let n = a.len();
    let size: f64 = a.iter().chain(b).map(Vec2::norm_squared).sum();
    // As complex numbers the best turn of q onto p leaves Σ |p|² + Σ |q|² − 2 |Σ p̄ q|.
    let overlap = |start: usize| {
        let mut sum = Vec2::zeros();
        for (k, p) in a.iter().enumerate() {
            // The mirror image runs the other way round.
            let q = b[(start + n - k) % n];
            sum += Vec2::new(p.x * q.x - p.y * q.y, -p.x * q.y - p.y * q.x);
        }
        sum.norm()
    };
    let best = (0..n).map(overlap).fold(0.0, f64::max);
    ((size - 2.0 * best).max(0.0) / n as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mirror_images_are_told_from_turned_copies() {
        let hook = [[0., 0.], [40., 0.], [40., 10.], [10., 10.], [10., 25.], [0., 25.]].map(Vec2::from);
        let (sin, cos) = 0.7_f64.sin_cos();
        let turned = |p: &Vec2| Vec2::new(cos * p.x - sin * p.y, sin * p.x + cos * p.y) + Vec2::new(3.0, 90.0);
        let copy: Vec<Vec2> = hook.iter().map(turned).collect();
        let mirror: Vec<Vec2> = copy.iter().rev().map(|p| Vec2::new(-p.x, p.y)).collect();
        let [a, b, c] = [&hook[..], &copy, &mirror].map(|it| sampled(PieceId(0), it));
        assert!(difference(&a.points, &c.points) < ALIKE * a.length);
        assert!(difference(&a.points, &b.points) > 5.0 * ALIKE * a.length);
    }
}
