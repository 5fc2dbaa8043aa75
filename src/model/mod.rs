//! The nouns that cross stages: plain data, and what each of them guarantees.

mod folded;
mod globe;
mod mill;
mod mold;
mod net;
mod nouns;
mod pattern;
mod planar;
mod shape;
mod stripes;
mod strips;

pub use folded::{Fold, FoldFigures, FoldFrame, FoldSample, Folded, FoldedCrease, Held, Run};
pub use globe::Globe;
pub use mill::{MillMove, Milling, Setup, StripLeft};
pub use mold::{MoldPanel, MoldProgram, MoldSegment, Molds};
pub use net::{Frame, GeodesicNet, Lath, LathCrossing, NetFit};
pub(crate) use nouns::with_nouns;
pub use nouns::{Artifact, Kind, Noun};
pub use pattern::{BORDER, Crease, CreasePattern, MOUNTAIN, UNASSIGNED, VALLEY};
pub use planar::{
    Bend, Joints, Line, Mark, Opening, Operation, Part, Parts, Placement, Sheet, SheetPaths, Sheets, Toolpath,
    Toolpaths,
};
pub use shape::{
    CutMesh, DevelopableMesh, Flattening, Guides, Misfit, Overlap, Patch, Piece, PieceId, Round, Seam, SourceMesh,
    Tradeoff,
};
pub use stripes::{StripeEnd, StripeLine, Stripes, Web};
pub use strips::{Corner, Panel, PanelKind, Ruled, Ruling, Strips};
