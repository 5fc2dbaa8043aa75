//! The `[nest]` table, and the `layout` table of the report.
use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::{NestError, Options, Rotations, measure, nest};
use crate::{
    geom::{Box2, Vec2, polygon::area, polyline_length},
    model::{Operation, Part, Parts, Sheet, Sheets},
    numeric::Monitor,
    profile::{Angle, JoinKind, Joining, Length, Profiles},
    stage::{Check, Cx, KeyError, Section, Stage},
};

/// Equal steps of a turn at which parts are tried when they may lie at any angle.
const FREE_STEPS: usize = 8;
/// Pairs of parts tested by default, thousands: two to three seconds.
const EFFORT: usize = 2000;
/// Cells along the longer side of the stock when no `resolution` is given.
const CELLS: f64 = 600.0;
/// Thread per length of a lock-stitched seam, upper and lower: makers' tables say 2.5 to 2.8.
const THREAD: f64 = 2.8;
/// Measured distances may fall short of the promise by this much of rounding, mm.
const ROUNDING: f64 = 1e-6;

/// Angles at which parts may lie.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(untagged, expecting = "rotations must be \"free\", \"grain\", \"fixed\" or a list of degrees")]
pub enum Angles {
    /// In a word.
    Word(AngleWord),
    /// A list, degrees.
    List(Vec<Angle>),
}

/// Usual choices.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum AngleWord {
    /// Any angle.
    Free,
    /// As drawn or upside down: for stock with a grain.
    Grain,
    /// As drawn.
    Fixed,
}

impl Angles {
    fn kernel(&self) -> Rotations {
        match self {
            Self::Word(AngleWord::Free) => Rotations::Free(FREE_STEPS),
            Self::Word(AngleWord::Grain) => Rotations::Only(vec![0.0, std::f64::consts::PI]),
            Self::Word(AngleWord::Fixed) => Rotations::Only(vec![0.0]),
            Self::List(angles) => Rotations::Only(angles.iter().map(|it| it.radians).collect()),
        }
    }
}

/// How parts are placed on sheets.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct NestStage {
    /// Width and height of the stock, instead of the material's; never more than the machine's bed.
    pub sheet: Option<[Length; 2]>,
    /// Width and height of left-over pieces of stock, used up before whole sheets.
    pub remnants: Vec<[Length; 2]>,
    /// Names of the only parts to place, to cut them again; all when empty.
    pub only: Vec<String>,
    /// Number of sheets that the job should fit on; when it needs more, the report says at what scale it would.
    pub fit_sheets: Option<usize>,
    /// Kept free along the edges of the stock, instead of the material's.
    pub margin: Option<Length>,
    /// Kept free between parts, instead of the material's; never less than the machine's kerf.
    pub gap: Option<Length>,
    /// "free", "grain" (0° and 180°), "fixed", or a list of degrees.
    pub rotations: Angles,
    /// Angles of single parts, by name, where they differ.
    pub part_rotations: BTreeMap<String, Angles>,
    /// Step of the positions of the first packing; by default the longer side of the stock over 600.
    pub resolution: Option<Length>,
    /// How long to search beyond the first packing, in thousands of pairs of parts that are tested; more packs tighter.
    pub effort: usize,
    /// Give up the search after so many seconds even if the effort is not spent. The result may then differ from run to
    /// run, and the report says so.
    pub seconds: Option<f64>,
}

impl Default for NestStage {
    fn default() -> Self {
        Self {
            sheet: None,
            remnants: Vec::new(),
            only: Vec::new(),
            fit_sheets: None,
            margin: None,
            gap: None,
            rotations: Angles::Word(AngleWord::Free),
            part_rotations: BTreeMap::new(),
            resolution: None,
            effort: EFFORT,
            seconds: None,
        }
    }
}

/// What the stage reads of the profiles.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Stock {
    sheet: [Length; 2],
    bed: [Length; 2],
    margin: Length,
    gap: Length,
    /// Whether the stock comes from a roll and the machine takes it so: its length is no limit.
    roll: bool,
    /// What the tool takes away beside an outline: parts nearer than this would be cut into.
    kerf: Length,
    title: String,
    join: Joining,
}

impl Stage for NestStage {
    const NAME: &'static str = "nest";
    const VERSION: u32 = 6;
    const DRAWS: bool = true;
    type Input = Parts;
    type Output = Sheets;
    type Profile = Stock;
    type Error = NestError;

    fn profile(profiles: &Profiles) -> Stock {
        let Profiles { material, machine } = profiles;
        Stock {
            sheet: material.sheet,
            bed: machine.bed,
            margin: material.margin,
            gap: material.gap,
            roll: material.roll && machine.roll,
            kerf: machine.tools.get(Operation::CutOutside).map_or(Length::mm(0.0), |it| it.kerf),
            title: material.title.clone(),
            join: material.join.clone(),
        }
    }

    fn check(&self) -> Result<(), KeyError> {
        for side in self.sheet.iter().flatten() {
            KeyError::range("sheet", side.mm, 1.0, 100_000.0)?;
        }
        for side in self.remnants.iter().flatten() {
            KeyError::range("remnants", side.mm, 1.0, 100_000.0)?;
        }
        if let Some(margin) = self.margin {
            KeyError::range("margin", margin.mm, 0.0, 10_000.0)?;
        }
        if let Some(gap) = self.gap {
            KeyError::range("gap", gap.mm, 0.0, 10_000.0)?;
        }
        if let Some(resolution) = self.resolution {
            KeyError::range("resolution", resolution.mm, 0.01, 100.0)?;
        }
        for (key, angles) in std::iter::once(("rotations", &self.rotations))
            .chain(self.part_rotations.values().map(|it| ("part_rotations", it)))
        {
            if *angles == Angles::List(Vec::new()) {
                return Err(KeyError { key, message: "must name at least one angle".into() });
            }
        }
        if let Some(wanted) = self.fit_sheets {
            KeyError::range("fit_sheets", wanted as f64, 1.0, 1e6)?;
        }
        if let Some(seconds) = self.seconds {
            KeyError::range("seconds", seconds, 0.0, 1e6)?;
        }
        KeyError::range("effort", self.effort as f64, 0.0, 1e9)
    }

    fn run(&self, parts: &Parts, stock: &Stock, cx: &Cx) -> Result<Sheets, NestError> {
        let chosen = self.chosen(parts)?;
        let wanted = Parts { parts: chosen.iter().map(|&i| parts.parts[i].clone()).collect(), ..Parts::default() };
        let options = self.options(&wanted, stock, cx.seed);
        let mut sheets = nest(&wanted, &options, &cx.monitor)?;
        if let Some(last) =
            sheets.sheets.last_mut().filter(|it| stock.roll && it.size == options.stock[options.stock.len() - 1])
        {
            last.size.y = used_height(last, sheets.margin);
        }
        for placement in sheets.sheets.iter_mut().flat_map(|it| &mut it.placements) {
            placement.part = chosen[placement.part];
        }
        Ok(sheets)
    }

    fn section(&self, parts: &Parts, stock: &Stock, sheets: &Sheets) -> Section {
        let placed: Vec<Value> = sheets
            .sheets
            .iter()
            .enumerate()
            .flat_map(|(number, sheet)| sheet.parts.iter().map(move |it| describe(it, number + 1)))
            .collect();
        let last = sheets.sheets.last();
        let size = last.filter(|_| stock.roll).map_or_else(|| self.stock_size(parts, stock), |it| it.size);
        let table = json!({
            "sheets": sheets.sheets.len(),
            "parts": placed.len(),
            "density": density(sheets),
            "sheet_mm": [size.x, size.y],
            "sheets_mm": sheets.sheets.iter().map(|it| [it.size.x, it.size.y]).collect::<Vec<_>>(),
            // A limit in seconds gives up the promise that every run gives the same sheets.
            "reproducible": self.seconds.is_none(),
            "placed": placed,
        });
        let section = Section::new("layout", table).table("shopping", shopping(parts, stock, sheets));
        checks(sheets).into_iter().chain(self.fits(parts, stock, sheets)).fold(section, Section::check)
    }
}

impl NestStage {
    /// Indices of the parts to place.
    fn chosen(&self, parts: &Parts) -> Result<Vec<usize>, NestError> {
        if self.only.is_empty() {
            return Ok((0..parts.parts.len()).collect());
        }
        let index = |name: &String| {
            let known = || parts.parts.iter().map(|it| it.name.clone()).collect::<Vec<_>>().join(", ");
            let found = parts.parts.iter().position(|it| it.name == *name);
            found.ok_or_else(|| NestError::UnknownPart { name: name.clone(), known: known() })
        };
        self.only.iter().map(index).collect()
    }

    fn options(&self, parts: &Parts, stock: &Stock, seed: u64) -> Options {
        let sheet = self.stock_size(parts, stock);
        let remnants = self.remnants.iter().map(|it| self.on_bed(*it, stock));
        Options {
            stock: remnants.chain([sheet]).collect(),
            margin: self.margin.unwrap_or(stock.margin).mm,
            gap: self.gap(stock),
            rotations: self.rotations.kernel(),
            part_rotations: self.part_rotations.iter().map(|(name, it)| (name.clone(), it.kernel())).collect(),
            cell: self.resolution.map_or(if stock.roll { sheet.x } else { sheet.max() } / CELLS, |it| it.mm),
            effort: self.effort,
            seconds: self.seconds,
            seed,
        }
    }

    /// Whether the job fits on the sheets asked for, and at what scale it would.
    fn fits(&self, parts: &Parts, stock: &Stock, sheets: &Sheets) -> Option<Check> {
        let wanted = self.fit_sheets?;
        let used = sheets.sheets.len() as f64;
        let quick = Options { effort: 0, ..self.options(parts, stock, 0) };
        let fits = |scale: f64| {
            let mut smaller = parts.clone();
            smaller.parts.iter_mut().flat_map(|it| it.contours.iter_mut().flatten()).for_each(|p| *p *= scale);
            smaller.parts.iter_mut().for_each(|it| it.marks.clear());
            let nested = nest(&smaller, &quick, &Monitor::silent());
            nested.is_ok_and(|it| it.sheets.len() <= wanted && it.unplaced.is_empty())
        };
        let whole = used <= wanted as f64 && sheets.unplaced.is_empty();
        // Halving finds the scale to a hundredth.
        let mut range = (0.0, 1.0);
        while !whole && range.1 - range.0 > 0.01 {
            let middle = (range.0 + range.1) / 2.0;
            if fits(middle) { range.0 = middle } else { range.1 = middle }
        }
        let note = if whole {
            String::new()
        } else {
            format!(
                "these parts would fit at a scale of {:.2}; a smaller model is cut anew, so it may need a little less",
                range.0
            )
        };
        let check = Check::at_most("nest.fit_sheets", used, wanted as f64, "sheets", note);
        Some(Check { ok: whole, ..check })
    }

    /// What is kept free between parts: at least what the cuts around them take.
    fn gap(&self, stock: &Stock) -> f64 {
        self.gap.unwrap_or(stock.gap).mm.max(stock.kerf.mm)
    }

    fn stock_size(&self, parts: &Parts, stock: &Stock) -> Vec2 {
        let size = self.sheet.unwrap_or(stock.sheet);
        if !stock.roll {
            return self.on_bed(size, stock);
        }
        // Long enough for all parts one above the other, however they are turned.
        let extent = |part: &Part| Box2::of(&part.contours[0]).size().norm();
        let gap = self.gap(stock);
        let length: f64 = parts.parts.iter().map(|it| extent(it) + gap).sum();
        Vec2::new(size[0].mm.min(stock.bed[0].mm), length + 2.0 * self.margin.unwrap_or(stock.margin).mm + 1.0)
    }

    /// Stock as it lies on the bed: turned by a quarter where more of it fits that way and parts have no grain.
    fn on_bed(&self, size: [Length; 2], stock: &Stock) -> Vec2 {
        let [width, height] = size.map(|it| it.mm);
        let on_bed = |w: f64, h: f64| Vec2::new(w.min(stock.bed[0].mm), h.min(stock.bed[1].mm));
        let (upright, turned) = (on_bed(width, height), on_bed(height, width));
        let may_turn = self.rotations == Angles::Word(AngleWord::Free);
        if may_turn && turned.x * turned.y > upright.x * upright.y { turned } else { upright }
    }
}

/// Overlaps, parts left over, gap and margin.
fn checks(sheets: &Sheets) -> Vec<Check> {
    let found = measure(sheets);
    let unplaced = match sheets.unplaced.len() {
        0 => String::new(),
        _ => format!("{}; scale the model, cut it further, or take larger stock", sheets.unplaced.join("; ")),
    };
    let mut checks = vec![
        Check::at_most("nest.overlap", found.overlaps.len() as f64, 0.0, "pairs", found.overlaps.join("; ")),
        Check::at_most("nest.unplaced", sheets.unplaced.len() as f64, 0.0, "parts", unplaced),
    ];
    for (name, found, limit) in [("nest.gap", found.gap, sheets.gap), ("nest.margin", found.margin, sheets.margin)] {
        if let Some((value, place)) = found {
            let check = Check::at_least(name, value, limit - ROUNDING, "mm", place);
            checks.push(Check { limit, ..check });
        }
    }
    checks
}

/// What has to be bought and what has to be done, in the units of a shop.
fn shopping(parts: &Parts, stock: &Stock, sheets: &Sheets) -> Value {
    let metres = |wanted: &dyn Fn(Operation) -> bool| -> f64 {
        let lines = sheets.sheets.iter().flat_map(|it| &it.parts).flat_map(Part::lines);
        lines.filter(|it| wanted(it.operation)).map(|it| polyline_length(it.points, it.closed)).sum::<f64>() / 1000.0
    };
    let mut list = serde_json::Map::new();
    let mut put = |key: &str, value: Value| drop(list.insert(key.into(), value));
    put("material", json!(stock.title));
    put("sheets", json!(sheets.sheets.len()));
    if let Some(last) = sheets.sheets.last().filter(|_| stock.roll) {
        put("roll_m", json!(last.size.y / 1000.0));
    }
    put("cut_m", json!(metres(&Operation::is_cut)));
    put("fold_m", json!(metres(&|it| matches!(it, Operation::ScoreMountain | Operation::ScoreValley))));
    match stock.join.kind {
        // Both sides carry the line, and the thread goes along it once.
        JoinKind::Allowance => {
            let seam = metres(&|it| it == Operation::Sew) / 2.0;
            put("seam_to_sew_m", json!(seam));
            put("thread_m", json!(THREAD * seam));
        }
        // One through the flap and one through the other side are one rivet.
        JoinKind::Rivets => put("rivets", json!(parts.joints.holes / 2)),
        JoinKind::Holes => put("stitches", json!(parts.joints.holes / 2)),
        JoinKind::Tabs => put("tabs_to_glue", json!(parts.joints.tabs)),
        JoinKind::Butt | JoinKind::Fingers => {}
    }
    list.into()
}

/// Area of the parts over the area of the sheets, the last one cut off a margin above its parts.
fn density(sheets: &Sheets) -> f64 {
    let parts: f64 = sheets.sheets.iter().flat_map(|it| &it.parts).map(|it| area(&it.contours)).sum();
    let stock = |(k, sheet): (usize, &Sheet)| {
        let used = k + 1 == sheets.sheets.len();
        sheet.size.x * if used { used_height(sheet, sheets.margin).min(sheet.size.y) } else { sheet.size.y }
    };
    let stock: f64 = sheets.sheets.iter().enumerate().map(stock).sum();
    if stock > 0.0 { parts / stock } else { 0.0 }
}

/// Height of a sheet up to a margin above its parts, mm.
fn used_height(sheet: &Sheet, margin: f64) -> f64 {
    Box2::of(sheet.parts.iter().flat_map(|it| &it.contours[0])).max.y + margin
}

/// A row of the list of parts, for people and for programs that check the files.
fn describe(part: &Part, sheet: usize) -> Value {
    let bounds = Box2::of(part.contours.iter().flatten());
    let mut marks = serde_json::Map::new();
    for mark in &part.marks {
        let count = marks.get(mark.operation.name()).and_then(Value::as_u64).unwrap_or(0);
        marks.insert(mark.operation.name().into(), (count + 1).into());
    }
    json!({
        "name": part.name,
        "sheet": sheet,
        "area_mm2": area(&part.contours),
        "box_mm": [bounds.min.x, bounds.min.y, bounds.max.x, bounds.max.y],
        "holes": part.contours.len() - 1,
        "marks": marks,
    })
}
