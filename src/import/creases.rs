//! What the lines of a crease pattern are: borders, cuts, folds or nothing, by their colour or layer.
use super::drawing::{Drawing, DrawnLine};
use crate::{
    geom::{
        Box2, Vec2,
        arrangement::{Arc, Arrangement, ArrangementError, Curve, Note},
        signed_area,
    },
    mesh::{PaperError, TriMesh, paper},
    model::{BORDER, CreasePattern, MOUNTAIN, UNASSIGNED, VALLEY},
};

/// What a line of a crease pattern is (FOLD 1.2, `edges_assignment`).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Assignment {
    /// Edge of the paper.
    Border,
    /// Fold away from the viewer.
    Mountain,
    /// Fold towards the viewer.
    Valley,
    /// Drawn over a face that stays flat there.
    Facet,
    /// A fold whose direction is not known.
    Unassigned,
    /// A slit.
    Cut,
    /// A seam of the drawing only.
    Join,
}

/// Letter in FOLD, name, and colour in Origami Simulator; where that has none, grey.
const ASSIGNMENTS: [(Assignment, &str, &str, [u8; 3]); 7] = [
    (Assignment::Border, "B", "border", [0, 0, 0]),
    (Assignment::Mountain, "M", "mountain", [255, 0, 0]),
    (Assignment::Valley, "V", "valley", [0, 0, 255]),
    (Assignment::Facet, "F", "facet", [255, 255, 0]),
    (Assignment::Unassigned, "U", "unassigned", [255, 0, 255]),
    (Assignment::Cut, "C", "cut", [0, 255, 0]),
    (Assignment::Join, "J", "join", [128, 128, 128]),
];

impl Assignment {
    fn row(self) -> &'static (Self, &'static str, &'static str, [u8; 3]) {
        ASSIGNMENTS.iter().find(|it| it.0 == self).expect("the table has a row for every variant")
    }

    /// The assignment of a letter of FOLD.
    pub fn from_letter(letter: &str) -> Option<Self> {
        ASSIGNMENTS.iter().find(|it| it.1 == letter).map(|it| it.0)
    }

    /// The assignment of that name; "crease" is a fold of unknown direction, "ignored" a line that means nothing.
    pub fn from_name(name: &str) -> Option<Self> {
        match name {
            "crease" => Some(Self::Unassigned),
            "ignored" => Some(Self::Join),
            _ => ASSIGNMENTS.iter().find(|it| it.2 == name).map(|it| it.0),
        }
    }

    /// Its name.
    pub fn name(self) -> &'static str {
        self.row().2
    }

    /// Its colour in Origami Simulator.
    pub fn color(self) -> [u8; 3] {
        self.row().3
    }

    /// Whether the sheet is folded here.
    pub fn is_fold(self) -> bool {
        matches!(self, Self::Mountain | Self::Valley | Self::Unassigned)
    }
}

/// Which lines are what. Layers count first, then colours, then the convention of Origami Simulator, in which a shade of a
/// colour counts as the colour.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct CreaseRoles {
    /// By name of the layer.
    pub layers: Vec<(String, Assignment)>,
    /// By red, green and blue.
    pub colors: Vec<([u8; 3], Assignment)>,
}

impl CreaseRoles {
    /// What a line is; `None` when neither its layer nor its colour says so.
    pub fn of(&self, line: &DrawnLine) -> Option<Assignment> {
        let layer = self.layers.iter().find(|it| it.0 == line.layer).map(|it| it.1);
        let color = || self.colors.iter().find(|it| Some(it.0) == line.color).map(|it| it.1);
        let pure = || {
            let pure = line.color?.map(|it| if it >= 128 { 255 } else { 0 });
            ASSIGNMENTS.iter().find(|it| it.3 == pure).map(|it| it.0)
        };
        layer.or_else(color).or_else(|| Assignment::from_name(&line.layer)).or_else(pure)
    }
}

/// The lines of a pattern with what they are, and those that nothing is known about.
fn creases<'a>(drawing: &'a Drawing, roles: &CreaseRoles) -> (Vec<(Assignment, &'a DrawnLine)>, Vec<&'a DrawnLine>) {
    let (mut known, mut unknown) = (Vec::new(), Vec::new());
    for line in &drawing.lines {
        match roles.of(line) {
            Some(it) => known.push((it, line)),
            None => unknown.push(line),
        }
    }
    (known, unknown)
}

/// What a crease pattern comes to when its lines are divided where they meet.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct CreaseFacts {
    /// Parts of the sheet between folds.
    pub patches: usize,
    /// Folds from one meeting point to the next.
    pub folds: usize,
    /// Places where folds end in the middle of the sheet, mm.
    pub dead_ends: Vec<[f64; 2]>,
    /// Places where folds lie off the sheet, mm.
    pub outside: Vec<[f64; 2]>,
    /// Places where borders are open, mm.
    pub open_borders: Vec<[f64; 2]>,
    /// Ends that were moved, with the distance, mm.
    pub snapped: Vec<([f64; 2], f64)>,
    /// Middles of stretches drawn more than once, with their length, mm.
    pub doubled: Vec<([f64; 2], f64)>,
    /// Lines whose layer and colour say nothing.
    pub unknown: usize,
}

impl CreaseFacts {
    /// Divides the borders and folds of a drawing, ends joined within `tolerance`, mm.
    pub fn of(drawing: &Drawing, roles: &CreaseRoles, tolerance: f64) -> Result<Self, ArrangementError> {
        let (known, unknown) = creases(drawing, roles);
        let divided = divide(&known, tolerance)?;
        Ok(Self { unknown: unknown.len(), ..Self::measure(&divided) })
    }

    fn measure(divided: &Arrangement) -> Self {
        let sheet = divided.inside(BORDER);
        let degrees = divided.degrees();
        let mut out = Self { patches: sheet.iter().filter(|it| **it).count(), ..Self::default() };
        for arc in &divided.arcs {
            let (middle, one_face): ([f64; 2], bool) = (arc.points[arc.points.len() / 2].into(), arc.left == arc.right);
            if arc.kind == BORDER {
                out.open_borders.extend(one_face.then_some(middle));
                continue;
            }
            out.folds += 1;
            if !(sheet[arc.left] && sheet[arc.right]) {
                out.outside.push(middle);
            } else if one_face {
                let ends = arc.ends.into_iter().flatten().filter(|&it| degrees[it] == 1);
                out.dead_ends.extend(ends.map(|it| -> [f64; 2] { divided.nodes[it].into() }));
            }
        }
        for note in &divided.notes {
            match *note {
                Note::Snapped { from, distance } => out.snapped.push((from.into(), distance)),
                Note::Overlap { place, length } => out.doubled.push((place.into(), length)),
            }
        }
        out
    }

    /// Whether the pattern can be folded as far as its lines tell.
    pub fn sound(&self) -> bool {
        self.patches > 0 && self.dead_ends.is_empty() && self.outside.is_empty() && self.open_borders.is_empty()
    }
}

/// The kind of a line in the arrangement: borders and slits, then mountains, valleys and folds that may be either.
fn kind(it: Assignment) -> Option<u32> {
    match it {
        Assignment::Border | Assignment::Cut => Some(BORDER),
        Assignment::Mountain => Some(MOUNTAIN),
        Assignment::Valley => Some(VALLEY),
        Assignment::Unassigned => Some(UNASSIGNED),
        Assignment::Facet | Assignment::Join => None,
    }
}

/// Folds are divided at their corners, too.
fn divide(known: &[(Assignment, &DrawnLine)], tolerance: f64) -> Result<Arrangement, ArrangementError> {
    let curve = |it: &(Assignment, &DrawnLine)| {
        Some(Curve { points: it.1.points.clone(), closed: it.1.closed, kind: kind(it.0)? })
    };
    let curves: Vec<Curve> = known.iter().filter_map(curve).collect();
    Arrangement::new(&curves, tolerance, &|it| it != BORDER)
}

/// Where the border of the paper comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Borders {
    /// From the lines that are borders.
    #[default]
    Drawn,
    /// It is the least upright rectangle around all lines.
    Rectangle,
    /// It is the closed curve that encloses the most.
    Outermost,
    /// It is that and the closed curve that encloses the least: a ring.
    Annulus,
}

/// Why a drawing is no crease pattern.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PatternError {
    /// The lines have no arrangement.
    #[error(transparent)]
    Arrangement(#[from] ArrangementError),
    /// The paper cannot be meshed.
    #[error("the paper cannot be divided into triangles")]
    Paper(#[from] PaperError),
    /// Border curves that are not there.
    #[error("the border is to be made of the outermost closed curve{}, but the drawing has {found} closed curves", if *ring { " and the innermost one" } else { "" })]
    NoCurves {
        /// Whether two are needed.
        ring: bool,
        /// Closed curves among borders and creases.
        found: usize,
    },
    /// No line encloses anything.
    #[error(
        "the borders enclose no paper: a border must be a closed curve. Say which colour or layer it has (input.colors, input.layers), or set input.border = \"rectangle\", \"outermost\" or \"annulus\""
    )]
    NoPaper,
    /// A border has an end.
    #[error("a border is open at ({x:.3}, {y:.3}) mm: close it, or raise input.snap above the gap")]
    OpenBorder {
        /// Where.
        x: f64,
        /// Where.
        y: f64,
    },
    /// There is nothing to fold along.
    #[error(
        "there is no crease inside the border. Say which colour or layer creases have: input.colors = {{ \"#000000\" = \"crease\" }}, or input.layers"
    )]
    NoCrease,
    /// A crease ends inside the paper.
    #[error(
        "a crease ends in the middle of the paper, at ({x:.3}, {y:.3}) mm: draw it on to another crease or to the border, or raise input.snap above the gap"
    )]
    DeadEnd {
        /// Where it ends.
        x: f64,
        /// Where it ends.
        y: f64,
    },
}

/// A crease pattern as it was read.
#[derive(Debug, Clone, PartialEq)]
pub struct ReadPattern {
    /// The pattern.
    pub pattern: CreasePattern,
    /// What its lines came to.
    pub facts: CreaseFacts,
    /// The paper as a flat mesh with every crease along its edges.
    pub sheet: TriMesh,
}

/// Cells of the flat mesh across its diagonal.
const CELLS: f64 = 90.0;

/// The crease pattern of a drawing: ends joined within `tolerance` (mm), creases off the paper left out.
pub fn pattern(
    drawing: &Drawing,
    roles: &CreaseRoles,
    borders: Borders,
    tolerance: f64,
) -> Result<ReadPattern, PatternError> {
    let (known, unknown) = creases(drawing, roles);
    let mut known: Vec<(Assignment, DrawnLine)> =
        known.into_iter().filter(|it| kind(it.0).is_some()).map(|(role, line)| (role, line.clone())).collect();
    enclose(&mut known, borders)?;
    let known: Vec<(Assignment, &DrawnLine)> = known.iter().map(|it| (it.0, &it.1)).collect();
    let divided = divide(&known, tolerance)?;
    let facts = CreaseFacts { unknown: unknown.len(), ..CreaseFacts::measure(&divided) };
    if let Some(&[x, y]) = facts.open_borders.first() {
        return Err(PatternError::OpenBorder { x, y });
    }
    if facts.patches == 0 {
        return Err(PatternError::NoPaper);
    }
    if let Some(&[x, y]) = facts.dead_ends.first() {
        return Err(PatternError::DeadEnd { x, y });
    }
    let pattern = CreasePattern::new(&divided);
    if pattern.creases.is_empty() {
        return Err(PatternError::NoCrease);
    }
    let curve = |it: &Arc| Curve { points: it.points.clone(), closed: it.ends.is_none(), kind: it.kind };
    let curves: Vec<Curve> = divided.arcs.iter().map(curve).collect();
    let sheet = paper(&curves, BORDER, pattern.bounds().size().norm() / CELLS)?;
    Ok(ReadPattern { pattern, facts, sheet })
}

/// Makes borders of what `borders` says.
fn enclose(lines: &mut Vec<(Assignment, DrawnLine)>, borders: Borders) -> Result<(), PatternError> {
    let ring = match borders {
        Borders::Drawn => return Ok(()),
        Borders::Rectangle => {
            let Box2 { min, max } = Box2::of(lines.iter().flat_map(|it| &it.1.points));
            let points = vec![min, Vec2::new(max.x, min.y), max, Vec2::new(min.x, max.y)];
            let border = DrawnLine { layer: String::new(), color: None, points, closed: true };
            lines.push((Assignment::Border, border));
            return Ok(());
        }
        Borders::Outermost => false,
        Borders::Annulus => true,
    };
    let area = |it: &(Assignment, DrawnLine)| signed_area(&it.1.points).abs();
    let mut closed: Vec<usize> = (0..lines.len()).filter(|&k| lines[k].1.closed).collect();
    closed.sort_by(|&a, &b| area(&lines[b]).total_cmp(&area(&lines[a])));
    let (Some(&first), Some(&last)) = (closed.first(), closed.last()) else {
        return Err(PatternError::NoCurves { ring, found: 0 });
    };
    if ring && first == last {
        return Err(PatternError::NoCurves { ring, found: 1 });
    }
    lines[first].0 = Assignment::Border;
    if ring {
        lines[last].0 = Assignment::Border;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::import::read_svg;

    const DRAWING: &str = r##"<svg xmlns="http://www.w3.org/2000/svg" width="SIZE" height="100" viewBox="0 0 100 100">
        <style>.v { stroke: blue }</style>
        <g transform="translate(10 0)"><path class="v" d="M0 0 C 20 20 20 40 0 60"/></g>
        <rect x="1" y="1" width="98" height="98" fill="none" stroke="#000"/>
        <g id="notes"><path d="M5 5 L 9 9" stroke="#abc123"/></g>
        <path d="M0 50 A 50 50 0 0 1 50 0" style="stroke:#e00000;fill:none"/></svg>"##;

    #[test]
    fn colours_styles_and_layers_tell_creases() {
        let drawing = read_svg(DRAWING.replace("SIZE", "100mm").as_bytes()).unwrap();
        let (known, unknown) = creases(&drawing, &CreaseRoles::default());
        let found: Vec<Assignment> = known.iter().map(|it| it.0).collect();
        assert_eq!(found, [Assignment::Valley, Assignment::Border, Assignment::Facet, Assignment::Mountain]);
        assert!(unknown.is_empty());
        let roles = CreaseRoles {
            layers: vec![("notes".into(), Assignment::Join)],
            colors: vec![([0, 0, 255], Assignment::Unassigned)],
        };
        let (known, _) = creases(&drawing, &roles);
        let found: Vec<Assignment> = known.iter().map(|it| it.0).collect();
        assert_eq!(found, [Assignment::Unassigned, Assignment::Border, Assignment::Join, Assignment::Mountain]);
        // The arc is a quarter of a circle of radius 50.
        let arc = known[3].1;
        let quarter = std::f64::consts::PI * 25.0 * drawing.size.unwrap().min() / 100.0;
        assert!((arc.length() / quarter - 1.0).abs() < 1e-3, "{} {quarter}", arc.length());
    }

    #[test]
    fn faults_of_a_pattern_are_said_with_the_place() {
        let line = |layer: &str, points: &[[f64; 2]], closed| DrawnLine {
            layer: layer.into(),
            color: None,
            points: points.iter().map(|p| Vec2::new(p[0], p[1])).collect(),
            closed,
        };
        let border = line("border", &[[0.0, 0.0], [9.0, 0.0], [9.0, 9.0], [0.0, 9.0]], true);
        let facts = |lines: Vec<DrawnLine>| {
            let drawing = Drawing { lines, ..Drawing::default() };
            CreaseFacts::of(&drawing, &CreaseRoles::default(), 0.05).unwrap()
        };
        let arc = line("unassigned", &[[0.0, 4.0], [4.0, 5.0], [9.03, 4.0]], false);
        let good = facts(vec![border.clone(), arc.clone(), line("facet", &[[1.0, 1.0], [2.0, 1.0]], false)]);
        assert!(good.sound() && good.patches == 2 && good.folds == 1 && good.snapped.len() == 1, "{good:?}");
        let dead = facts(vec![border.clone(), arc, line("valley", &[[0.0, 1.0], [3.0, 2.0]], false)]);
        assert!(!dead.sound());
        assert_eq!(dead.dead_ends, [[3.0, 2.0]]);
        let across = facts(vec![border.clone(), line("valley", &[[-2.0, 1.0], [9.0, 2.0]], false)]);
        assert!(!across.sound() && across.outside.len() == 1, "{across:?}");
        let open = facts(vec![line("border", &[[0.0, 0.0], [9.0, 0.0], [9.0, 9.0]], false)]);
        assert!(!open.sound() && open.patches == 0 && !open.open_borders.is_empty(), "{open:?}");
        let twice = facts(vec![border.clone(), border]);
        let doubled: f64 = twice.doubled.iter().map(|it| it.1).sum();
        assert!(twice.sound() && twice.patches == 1 && (doubled - 36.0).abs() < 1e-12, "{twice:?}");
    }

    #[test]
    fn pixels_are_no_length() {
        for (width, measured) in [("100mm", true), ("4in", true), ("100px", false), ("100", false)] {
            let drawing = read_svg(DRAWING.replace("SIZE", width).as_bytes()).unwrap();
            assert_eq!(drawing.measured, measured, "{width}");
        }
    }
}
