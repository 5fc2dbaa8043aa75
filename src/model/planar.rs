//! Nouns in the plane: parts, sheets, toolpaths.
use crate::geom::{Vec2, arcs::ArcPath};

/// What a line is for. Machines map operations to layers, colours and tools by their profile.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Operation {
    /// Outer contour of a part.
    CutOutside,
    /// Hole in a part.
    CutInside,
    /// Fold away from the printed side.
    ScoreMountain,
    /// Fold towards the printed side.
    ScoreValley,
    /// Surface mark.
    Engrave,
    /// Lettering in single strokes.
    Text,
    /// Registration and match marks.
    Registration,
    /// Sewing line.
    Sew,
}

impl Operation {
    /// All of them, in the usual order of work: marks first, inner cuts before outer cuts.
    pub const ALL: [Self; 8] = [
        Self::Text,
        Self::Registration,
        Self::Engrave,
        Self::Sew,
        Self::ScoreValley,
        Self::ScoreMountain,
        Self::CutInside,
        Self::CutOutside,
    ];

    /// Its name in profiles, configs and reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::CutOutside => "cut-outside",
            Self::CutInside => "cut-inside",
            Self::ScoreMountain => "score-mountain",
            Self::ScoreValley => "score-valley",
            Self::Engrave => "engrave",
            Self::Text => "text",
            Self::Registration => "registration",
            Self::Sew => "sew",
        }
    }

    /// The operation of that name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|it| it.name() == name)
    }

    /// Whether it is a fold.
    pub fn is_score(self) -> bool {
        matches!(self, Self::ScoreMountain | Self::ScoreValley)
    }

    /// Whether it goes through the material.
    pub fn is_cut(self) -> bool {
        matches!(self, Self::CutInside | Self::CutOutside)
    }
}

/// A line on a part that is not its outline.
#[derive(Debug, Clone, PartialEq)]
pub struct Mark {
    /// What it is for.
    pub operation: Operation,
    /// Its points, mm.
    pub points: Vec<Vec2>,
    /// Whether the last point joins the first.
    pub closed: bool,
}

/// A flat part. Its contours are closed and simple and do not touch one another: the first is the outline,
/// counter-clockwise, the others are holes, clockwise.
#[derive(Debug, Clone, PartialEq)]
pub struct Part {
    /// Name, unique in the job.
    pub name: String,
    /// Outline and holes, first point not repeated, mm.
    pub contours: Vec<Vec<Vec2>>,
    /// Scores, text, registration marks.
    pub marks: Vec<Mark>,
}

/// A slit whose two sides lay closer together than a machine can cut apart, opened by moving both sides inwards.
#[derive(Debug, Clone, PartialEq)]
pub struct Opening {
    /// Name of the part.
    pub part: String,
    /// Width it was opened to, mm; each side moved by half of it.
    pub width: f64,
    /// Area that the part lost, mm².
    pub area: f64,
}

impl Part {
    /// Every line of the part: its contours as cuts, then its marks.
    pub fn lines(&self) -> impl Iterator<Item = Line<'_>> {
        let contours = self.contours.iter().enumerate().map(|(i, points)| Line {
            operation: if i == 0 { Operation::CutOutside } else { Operation::CutInside },
            points,
            closed: true,
        });
        contours.chain(self.marks.iter().map(|it| Line {
            operation: it.operation,
            points: &it.points,
            closed: it.closed,
        }))
    }
}

/// One line of a part or a sheet.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Line<'a> {
    /// What it is for.
    pub operation: Operation,
    /// Its points, mm.
    pub points: &'a [Vec2],
    /// Whether the last point joins the first.
    pub closed: bool,
}

/// All parts of a job.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Parts {
    /// The parts.
    pub parts: Vec<Part>,
    /// Pieces that could not become parts with a simple outline, with the reason.
    pub refused: Vec<String>,
    /// Slits that were opened, one entry per part.
    pub openings: Vec<Opening>,
    /// What joins the parts.
    pub joints: Joints,
    /// Bends of sheet metal, in the order of the parts.
    pub bends: Vec<Bend>,
    /// Lettering that found no room in its part and stands on the one that it is joined to: "seam 12 (14.1 mm) of part B: on
    /// part K".
    pub on_partner: Vec<String>,
    /// Lettering that was promised and stands nowhere.
    pub unlabelled: Vec<String>,
    /// Seams too short to be promised a number that have it on neither side.
    pub unnumbered: Vec<String>,
}

/// A bend line of sheet metal.
#[derive(Debug, Clone, PartialEq)]
pub struct Bend {
    /// Name of the part.
    pub part: String,
    /// How far the sheet is bent from flat, radians.
    pub angle: f64,
    /// Whether it is bent towards the printed side.
    pub up: bool,
    /// Length of the line, mm.
    pub length: f64,
    /// Length of the bent zone on its neutral fibre, mm.
    pub allowance: f64,
    /// By how much the flat pattern is shorter than the two legs up to the corner of the printed side, mm.
    pub deduction: f64,
    /// Whether the outline is shorter by it; otherwise it is printed beside the line.
    pub corrected: bool,
}

/// What joins parts along their seams.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Joints {
    /// Tabs made.
    pub tabs: usize,
    /// Tabs lower than asked, because their stretch of a seam is short.
    pub narrowed: usize,
    /// Holes made for rivets or laces.
    pub holes: usize,
    /// Seams that should have tabs or holes and have none, for lack of room: "seam 12 (4.1 mm)".
    pub missing: Vec<String>,
    /// Tabs that cross something, one sentence each.
    pub collisions: Vec<String>,
    /// Length of seam with an allowance less than half as wide as asked, because another one is near, mm.
    pub narrow: f64,
    /// Where the allowances of two shores of a bay hang together: "12 mm of seam on part A".
    pub bridged: Vec<String>,
}

/// Where a part lies: rotate by `angle` (counter-clockwise, radians), then move by `offset`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placement {
    /// Index into the parts.
    pub part: usize,
    /// Radians.
    pub angle: f64,
    /// Millimetres.
    pub offset: Vec2,
}

/// One sheet of stock with the parts on it.
#[derive(Debug, Clone, PartialEq)]
pub struct Sheet {
    /// Width (x) and height (y) of the stock, mm; the origin is its lower left corner, y up.
    pub size: Vec2,
    /// The parts in sheet coordinates.
    pub parts: Vec<Part>,
    /// How each part came to lie there.
    pub placements: Vec<Placement>,
}

/// The nested job: parts inside the stock less its margin, disjoint, at least `gap` apart.
#[derive(Debug, Clone, PartialEq)]
pub struct Sheets {
    /// The sheets.
    pub sheets: Vec<Sheet>,
    /// Kept free along the edge of the stock, mm.
    pub margin: f64,
    /// Kept free between parts, mm.
    pub gap: f64,
    /// Parts that fit on no sheet, with their size.
    pub unplaced: Vec<String>,
}

/// One movement of the tool in its working position at one depth. Passes of one depth are already in it where the path is
/// closed: it goes round that often; others come as toolpaths of their own.
#[derive(Debug, Clone, PartialEq)]
pub struct Toolpath {
    /// What it does.
    pub operation: Operation,
    /// Lines and arcs in sheet coordinates, mm; a closed path repeats its first point at the end.
    pub path: ArcPath,
    /// Share of the tool's full depth, in [0, 1]; heads without a Z axis know only 1. At 0 a blade only turns, on the surface.
    pub depth: f64,
    /// Whether it begins where the path before ends, and the tool goes there from one depth to the other without a lift.
    pub joined: bool,
    /// Name of the part; empty where a blade is only turned, in the margin.
    pub part: String,
}

/// The toolpaths of one sheet in the order of work.
#[derive(Debug, Clone, PartialEq)]
pub struct SheetPaths {
    /// Size of the sheet, mm.
    pub size: Vec2,
    /// The paths.
    pub paths: Vec<Toolpath>,
}

impl SheetPaths {
    /// The paths from one lift of the tool to the next.
    pub fn strokes(&self) -> impl Iterator<Item = &[Toolpath]> {
        self.paths.chunk_by(|_, next| next.joined)
    }
}

/// The whole job for a machine: every point inside its travel.
#[derive(Debug, Clone, PartialEq)]
pub struct Toolpaths {
    /// Per sheet.
    pub sheets: Vec<SheetPaths>,
    /// Length with the tool working, mm.
    pub cut_length: f64,
    /// Length with the tool up or off, mm.
    pub travel_length: f64,
    /// Times the tool is lifted or switched off.
    pub lifts: usize,
    /// Estimated time, s.
    pub seconds: f64,
    /// Operations that the machine does not do, with the number of paths that were therefore left out.
    pub left_out: Vec<(Operation, usize)>,
    /// Holes narrower than the cut, which is therefore made along their edge, a line each.
    pub uncompensated: Vec<String>,
}
