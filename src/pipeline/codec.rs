//! Nouns to bytes and back, bit for bit, for the cache. Little-endian, lengths as u64, no padding.
//!
//! Own and not serde's, because nouns stay free of serialisation (HOUSE.md) and f64 must come back bit for bit.
use crate::{
    geom::{Vec2, Vec3, arcs::ArcPath},
    mesh::{
        EdgeId, FaceId, Field, HalfedgeId, Id, TriMesh, VertexId,
        sweep::{Deepest, Pose, Tool},
    },
    model::{
        Artifact, Bend, Corner, Crease, CreasePattern, CutMesh, DevelopableMesh, Flattening, FoldFigures, FoldFrame,
        FoldSample, Folded, FoldedCrease, GeodesicNet, Globe, Guides, Held, Joints, Kind, Lath, LathCrossing, Mark,
        MillMove, Milling, MoldPanel, MoldProgram, MoldSegment, Molds, NetFit, Noun, Opening, Operation, Overlap,
        Panel, PanelKind, Part, Parts, Patch, Piece, PieceId, Placement, Round, Ruled, Ruling, Seam, Setup, Sheet,
        SheetPaths, Sheets, SourceMesh, StripLeft, StripeEnd, StripeLine, Stripes, Strips, Toolpath, Toolpaths,
        Tradeoff, Web, with_nouns,
    },
};

/// Bytes that are not what was written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("the bytes are not a noun")]
pub(super) struct Corrupt;

/// Bytes still to read.
pub(super) struct Reader<'a>(&'a [u8]);

impl<'a> Reader<'a> {
    fn take(&mut self, n: usize) -> Result<&'a [u8], Corrupt> {
        let (head, tail) = self.0.split_at_checked(n).ok_or(Corrupt)?;
        self.0 = tail;
        Ok(head)
    }
}

/// To bytes and back.
pub(super) trait Codec: Sized {
    /// Appends.
    fn put(&self, out: &mut Vec<u8>);
    /// Reads.
    fn get(reader: &mut Reader<'_>) -> Result<Self, Corrupt>;
}

macro_rules! numbers {
    ($($type:ty),*) => {$(
        impl Codec for $type {
            fn put(&self, out: &mut Vec<u8>) {
                out.extend_from_slice(&self.to_le_bytes());
            }
            fn get(reader: &mut Reader<'_>) -> Result<Self, Corrupt> {
                let bytes = reader.take(size_of::<Self>())?;
                Ok(Self::from_le_bytes(bytes.try_into().map_err(|_| Corrupt)?))
            }
        }
    )*};
}

numbers!(u8, u32, i32, u64, f64);

impl Codec for usize {
    fn put(&self, out: &mut Vec<u8>) {
        (*self as u64).put(out);
    }
    fn get(reader: &mut Reader<'_>) -> Result<Self, Corrupt> {
        u64::get(reader)?.try_into().map_err(|_| Corrupt)
    }
}

impl Codec for char {
    fn put(&self, out: &mut Vec<u8>) {
        u32::from(*self).put(out);
    }
    fn get(reader: &mut Reader<'_>) -> Result<Self, Corrupt> {
        char::from_u32(u32::get(reader)?).ok_or(Corrupt)
    }
}

impl Codec for bool {
    fn put(&self, out: &mut Vec<u8>) {
        u8::from(*self).put(out);
    }
    fn get(reader: &mut Reader<'_>) -> Result<Self, Corrupt> {
        Ok(u8::get(reader)? != 0)
    }
}

impl Codec for String {
    fn put(&self, out: &mut Vec<u8>) {
        self.len().put(out);
        out.extend_from_slice(self.as_bytes());
    }
    fn get(reader: &mut Reader<'_>) -> Result<Self, Corrupt> {
        let n = usize::get(reader)?;
        Self::from_utf8(reader.take(n)?.to_vec()).map_err(|_| Corrupt)
    }
}

impl<T: Codec> Codec for Vec<T> {
    fn put(&self, out: &mut Vec<u8>) {
        self.len().put(out);
        self.iter().for_each(|it| it.put(out));
    }
    fn get(reader: &mut Reader<'_>) -> Result<Self, Corrupt> {
        let n = usize::get(reader)?;
        // A length larger than what is left is corrupt; it must not become an allocation.
        if n > reader.0.len() {
            return Err(Corrupt);
        }
        (0..n).map(|_| T::get(reader)).collect()
    }
}

impl<T: Codec> Codec for Option<T> {
    fn put(&self, out: &mut Vec<u8>) {
        self.is_some().put(out);
        self.iter().for_each(|it| it.put(out));
    }
    fn get(reader: &mut Reader<'_>) -> Result<Self, Corrupt> {
        bool::get(reader)?.then(|| T::get(reader)).transpose()
    }
}

impl<T: Codec> Codec for Box<T> {
    fn put(&self, out: &mut Vec<u8>) {
        (**self).put(out);
    }
    fn get(reader: &mut Reader<'_>) -> Result<Self, Corrupt> {
        T::get(reader).map(Self::new)
    }
}

impl<T: Codec, const N: usize> Codec for [T; N] {
    fn put(&self, out: &mut Vec<u8>) {
        self.iter().for_each(|it| it.put(out));
    }
    fn get(reader: &mut Reader<'_>) -> Result<Self, Corrupt> {
        let values: Vec<T> = (0..N).map(|_| T::get(reader)).collect::<Result<_, _>>()?;
        values.try_into().map_err(|_| Corrupt)
    }
}

impl<A: Codec, B: Codec> Codec for (A, B) {
    fn put(&self, out: &mut Vec<u8>) {
        self.0.put(out);
        self.1.put(out);
    }
    fn get(reader: &mut Reader<'_>) -> Result<Self, Corrupt> {
        Ok((A::get(reader)?, B::get(reader)?))
    }
}

impl<I: Id, T: Codec> Codec for Field<I, T> {
    fn put(&self, out: &mut Vec<u8>) {
        self.len().put(out);
        self.iter().for_each(|it| it.put(out));
    }
    fn get(reader: &mut Reader<'_>) -> Result<Self, Corrupt> {
        Vec::get(reader).map(Self::from_vec)
    }
}

macro_rules! records {
    ($($name:ident { $($field:ident),* $(,)? })*) => {$(
        impl Codec for $name {
            fn put(&self, out: &mut Vec<u8>) {
                $(self.$field.put(out);)*
            }
            fn get(reader: &mut Reader<'_>) -> Result<Self, Corrupt> {
                Ok(Self { $($field: Codec::get(reader)?),* })
            }
        }
    )*};
}

macro_rules! newtypes {
    ($($name:ident),*) => {$(
        impl Codec for $name {
            fn put(&self, out: &mut Vec<u8>) {
                self.0.put(out);
            }
            fn get(reader: &mut Reader<'_>) -> Result<Self, Corrupt> {
                Codec::get(reader).map(Self)
            }
        }
    )*};
}

newtypes!(VertexId, FaceId, HalfedgeId, EdgeId, PieceId);

impl Codec for Vec2 {
    fn put(&self, out: &mut Vec<u8>) {
        [self.x, self.y].put(out);
    }
    fn get(reader: &mut Reader<'_>) -> Result<Self, Corrupt> {
        <[f64; 2]>::get(reader).map(Self::from)
    }
}

impl Codec for Vec3 {
    fn put(&self, out: &mut Vec<u8>) {
        [self.x, self.y, self.z].put(out);
    }
    fn get(reader: &mut Reader<'_>) -> Result<Self, Corrupt> {
        <[f64; 3]>::get(reader).map(Self::from)
    }
}

impl Codec for TriMesh {
    fn put(&self, out: &mut Vec<u8>) {
        self.positions().put(out);
        self.face_indices().put(out);
    }
    fn get(reader: &mut Reader<'_>) -> Result<Self, Corrupt> {
        let positions = Vec::get(reader)?;
        let faces: Vec<[u32; 3]> = Vec::get(reader)?;
        Self::new(positions, &faces).map_err(|_| Corrupt)
    }
}

impl Codec for Operation {
    fn put(&self, out: &mut Vec<u8>) {
        let at = Self::ALL.iter().position(|it| it == self).expect("ALL lists every operation");
        at.put(out);
    }
    fn get(reader: &mut Reader<'_>) -> Result<Self, Corrupt> {
        Self::ALL.get(usize::get(reader)?).copied().ok_or(Corrupt)
    }
}

macro_rules! plain_enums {
    ($($name:ident { $($variant:ident),* $(,)? })*) => {$(
        impl Codec for $name {
            fn put(&self, out: &mut Vec<u8>) {
                (*self as u8).put(out);
            }
            fn get(reader: &mut Reader<'_>) -> Result<Self, Corrupt> {
                let code = u8::get(reader)?;
                [$(Self::$variant),*].into_iter().find(|it| *it as u8 == code).ok_or(Corrupt)
            }
        }
    )*};
}

plain_enums! {
    PanelKind { Quad, Polygon, Triangle }
    Ruled { Yes, Flat, Unreliable, Unsolved }
}

records! {
    SourceMesh { mesh, file, repairs, up }
    Guides { seams, patches, edges, scales, texture, path, profile, net }
    GeodesicNet { rows, columns, points }
    MoldSegment { name, mesh, rows, size, volume, dowels }
    MoldPanel { rows, columns, mold }
    MoldProgram { segment, moves, radius, speeds, passes, gouge, scallop }
    Molds {
        profile, step, lambda, largest_lambda, deviation, congruence, segments, programs, panels, curvature, drawings, undoweled,
    }
    LathCrossing { other, at, gap }
    Lath { name, length, crossings, bar }
    NetFit { net, residual, iterations, seconds, missed, reference, strain, second, laths, drawings }
    Globe {
        points, faces, images, method, energy, dilatation, centroid, held, seconds, rings, lines, stretch, seam_length, seam_scale,
    }
    Patch { key, triangles }
    Round {
        energy, vertices, faces, energy_start, energy_end, gradient_norm, iterations, evaluations, seconds, stopped,
        level, correction, mesh,
    }
    DevelopableMesh { mesh, energy, max_deviation, rounds, tradeoffs }
    Tradeoff { max_deviation, energy, seam_length, bound }
    Piece { name }
    Seam { label, sides }
    CutMesh { mesh, origin, piece_of, pieces, seams, tolerance, seam_vertices, stretch, rim, undeveloped }
    Overlap { faces, area }
    Flattening { uv, log_factor, overlaps, stretch_limit }
    Corner { point, uv }
    Panel { piece, strip, kind, outline }
    Ruling { piece, ends, panels, bend, radius, length, bow }
    Strips { points, corners, panels, rulings, ruled, residual, directions, fold_angle, tolerance }
    StripeLine { points, closed, inner_ends, pieces }
    StripeEnd { face, place, index }
    Web { cycles, gaps, branches }
    Stripes {
        lines, drawn, faces, components, prescribed, found, windings, web, parts, field_singularities, period_error, energy, spacing,
        seconds,
    }
    Crease { kind, points, closed, left, right }
    CreasePattern { creases, patches }
    FoldFrame { share, points }
    FoldSample { along, flat, place, angle, excluded }
    FoldedCrease { points, closed, patches, piece, samples }
    Held { name, flat, miss }
    FoldFigures {
        crease_points, straight, excluded, folded, mean_fold, least_fold, straight_fold, stretch_mean, stretch_max,
        continuity_mean, continuity_max, net_residual, angle_defect,
    }
    Folded { edge, vertices, frames, creases, handles, figures, iterations, seconds, crowded }
    Mark { operation, points, closed }
    Part { name, contours, marks }
    Opening { part, width, area }
    Joints { tabs, narrowed, holes, missing, collisions, narrow, bridged }
    Bend { part, angle, up, length, allowance, deduction, corrected }
    Parts { parts, refused, openings, joints, bends, on_partner, unlabelled, unnumbered }
    Placement { part, angle, offset }
    Sheet { size, parts, placements }
    Sheets { sheets, margin, gap, unplaced }
    ArcPath { points, bulges }
    Toolpath { operation, path, depth, joined, part }
    SheetPaths { size, paths }
    Tool { radius, taper, flute, shank, reach, holder, holder_length }
    Pose { tip, axis }
    Deepest { depth, place }
    Setup { rows, shift }
    MillMove { rapid, pose, contact, joints, seconds, segment, piece }
    StripLeft { piece, strip, area, reason }
    Milling {
        axes, setup, tool, span, spindle, moves, pieces, refused, tight, left, segments, painted, deviation, closing, covered,
        gouge, excess, unfit, unfit_share, collision, limits,
    }
    Toolpaths { sheets, cut_length, travel_length, lifts, seconds, left_out, uncompensated }
}

macro_rules! artifacts {
    ($($name:ident),*) => {
        /// Bytes of any nouns.
        pub(super) fn encode(artifacts: &[Artifact]) -> Vec<u8> {
            let mut out = Vec::new();
            for artifact in artifacts {
                match artifact { $(Artifact::$name(it) => it.put(&mut out)),* }
            }
            out
        }

        /// Nouns of the kinds that the stage makes, from bytes that must be used up.
        pub(super) fn decode(kinds: &[Kind], bytes: &[u8]) -> Result<Vec<Artifact>, Corrupt> {
            let mut reader = Reader(bytes);
            let mut one = |kind: &Kind| Ok(match kind { $(Kind::$name => $name::get(&mut reader)?.wrap()),* });
            let artifacts = kinds.iter().map(&mut one).collect::<Result<_, _>>()?;
            if reader.0.is_empty() { Ok(artifacts) } else { Err(Corrupt) }
        }
    };
}

with_nouns!(artifacts);
