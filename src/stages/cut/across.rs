//! Where strips between lines that an earlier stage drew were divided, to lie flat or to fit on a sheet.
use crate::{
    geom::Vec3,
    mesh::{Field, HalfedgeId, Id},
    model::{CutMesh, PieceId},
};

/// A seam across a strip.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Across {
    /// The two pieces that it parts.
    pub pieces: [PieceId; 2],
    /// The middle of its first edge, mm.
    pub place: Vec3,
    /// How long it is, mm.
    pub length: f64,
}

/// The strips as they are without the seams across them.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Divisions {
    /// The seams across between two pieces.
    pub across: Vec<Across>,
    /// Seams across a part of a strip, with one piece on both sides.
    pub slits: usize,
    /// How many strips the pieces are once those seams are closed.
    pub strips: usize,
}

/// Finds the seams that do not run along `lines`, pairs of vertices of the surface that was cut.
pub fn divisions(cut: &CutMesh, lines: &[[u32; 2]]) -> Divisions {
    let ordered = |[a, b]: [u32; 2]| [a.min(b), a.max(b)];
    let mut lines: Vec<[u32; 2]> = lines.iter().map(|&it| ordered(it)).collect();
    lines.sort_unstable();
    let off_lines = |h: &HalfedgeId| {
        let ends = [cut.mesh.tail(*h), cut.mesh.head(*h)].map(|v| cut.origin[v].0);
        lines.binary_search(&ordered(ends)).is_err()
    };
    let mut out = Divisions::default();
    let mut strip: Field<PieceId, usize> = Field::from_fn(cut.pieces.len(), |it: PieceId| it.index());
    for seam in &cut.seams {
        let own: Vec<HalfedgeId> = seam.sides[0].iter().copied().filter(off_lines).collect();
        let Some(&first) = own.first() else { continue };
        let pieces = [0, 1].map(|side| cut.piece_of[cut.mesh.face(seam.sides[side][0])]);
        if pieces[0] == pieces[1] {
            out.slits += 1;
            continue;
        }
        let length = own.iter().map(|&h| cut.mesh.vector(h).norm()).sum();
        let place = cut.mesh.position(cut.mesh.tail(first)) + cut.mesh.vector(first) / 2.0;
        out.across.push(Across { pieces, place, length });
        let [from, to] = pieces.map(|it| strip[it]);
        strip.as_mut_slice().iter_mut().filter(|it| **it == from).for_each(|it| *it = to);
    }
    let mut left = strip.into_vec();
    left.sort_unstable();
    left.dedup();
    out.strips = left.len();
    out
}
