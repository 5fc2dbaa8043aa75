//! The `[nest]` table, and the `layout` table of the report.
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::{NestError, Options, Rotations, measure, nest};
use crate::{
    geom::{Box2, Vec2, polygon::area},
    model::{Part, Parts, Sheet, Sheets},
    profile::{Angle, Length, Profiles},
    stage::{Check, Cx, KeyError, Section, Stage},
};

/// Equal steps of a turn at which parts are tried when they may lie at any angle.
const FREE_STEPS: usize = 8;
/// Cells along the longer side of the stock when no `resolution` is given.
const CELLS: f64 = 600.0;
/// Measured distances may fall short of the promise by this much of rounding, mm.
const ROUNDING: f64 = 1e-6;

/// Angles at which parts may lie.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
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

/// How parts are placed on sheets.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct NestStage {
    /// Width and height of the stock, instead of the material's; never more than the machine's bed.
    pub sheet: Option<[Length; 2]>,
    /// Kept free along the edges of the stock, instead of the material's.
    pub margin: Option<Length>,
    /// Kept free between parts, instead of the material's.
    pub gap: Option<Length>,
    /// "free", "grain" (0° and 180°), "fixed", or a list of degrees.
    pub rotations: Angles,
    /// Step of the positions that are tried; by default the longer side of the stock over 600.
    pub resolution: Option<Length>,
    /// Orders of the parts that are tried; more takes longer and packs tighter.
    pub effort: usize,
}

impl Default for NestStage {
    fn default() -> Self {
        Self {
            sheet: None,
            margin: None,
            gap: None,
            rotations: Angles::Word(AngleWord::Free),
            resolution: None,
            effort: 60,
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
}

impl Stage for NestStage {
    const NAME: &'static str = "nest";
    const VERSION: u32 = 1;
    const DRAWS: bool = true;
    type Input = Parts;
    type Output = Sheets;
    type Profile = Stock;
    type Error = NestError;

    fn profile(profiles: &Profiles) -> Stock {
        let Profiles { material, machine } = profiles;
        Stock { sheet: material.sheet, bed: machine.bed, margin: material.margin, gap: material.gap }
    }

    fn check(&self) -> Result<(), KeyError> {
        for side in self.sheet.iter().flatten() {
            KeyError::range("sheet", side.mm, 1.0, 100_000.0)?;
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
        if self.rotations == Angles::List(Vec::new()) {
            return Err(KeyError { key: "rotations", message: "must name at least one angle".into() });
        }
        KeyError::range("effort", self.effort as f64, 0.0, 1e9)
    }

    fn run(&self, parts: &Parts, stock: &Stock, cx: &Cx) -> Result<Sheets, NestError> {
        let sheet = self.stock_size(stock);
        let options = Options {
            sheet,
            margin: self.margin.unwrap_or(stock.margin).mm,
            gap: self.gap.unwrap_or(stock.gap).mm,
            rotations: match &self.rotations {
                Angles::Word(AngleWord::Free) => Rotations::Free(FREE_STEPS),
                Angles::Word(AngleWord::Grain) => Rotations::Only(vec![0.0, std::f64::consts::PI]),
                Angles::Word(AngleWord::Fixed) => Rotations::Only(vec![0.0]),
                Angles::List(angles) => Rotations::Only(angles.iter().map(|it| it.radians).collect()),
            },
            cell: self.resolution.map_or(sheet.max() / CELLS, |it| it.mm),
            effort: self.effort,
            seed: cx.seed,
        };
        nest(parts, &options, &cx.monitor)
    }

    fn section(&self, _: &Parts, stock: &Stock, sheets: &Sheets) -> Section {
        let placed: Vec<Value> = sheets
            .sheets
            .iter()
            .enumerate()
            .flat_map(|(number, sheet)| sheet.parts.iter().map(move |it| describe(it, number + 1)))
            .collect();
        let size = self.stock_size(stock);
        let table = json!({
            "sheets": sheets.sheets.len(),
            "parts": placed.len(),
            "density": density(sheets),
            "sheet_mm": [size.x, size.y],
            "placed": placed,
        });
        let found = measure(sheets);
        let mut section = Section::new("layout", table)
            .check(Check::at_most("nest.overlap", found.overlaps.len() as f64, 0.0, "pairs", found.overlaps.join("; ")))
            .check(Check::at_most(
                "nest.unplaced",
                sheets.unplaced.len() as f64,
                0.0,
                "parts",
                match sheets.unplaced.len() {
                    0 => String::new(),
                    _ => {
                        format!("{}; scale the model, cut it further, or take larger stock", sheets.unplaced.join("; "))
                    }
                },
            ));
        for (name, found, limit) in [("nest.gap", found.gap, sheets.gap), ("nest.margin", found.margin, sheets.margin)]
        {
            if let Some((value, place)) = found {
                let check = Check::at_least(name, value, limit - ROUNDING, "mm", place);
                section = section.check(Check { limit, ..check });
            }
        }
        section
    }
}

impl NestStage {
    /// The stock as it lies on the bed: turned by a quarter where more of it fits that way and parts have no grain.
    fn stock_size(&self, stock: &Stock) -> Vec2 {
        let [width, height] = self.sheet.unwrap_or(stock.sheet).map(|it| it.mm);
        let on_bed = |w: f64, h: f64| Vec2::new(w.min(stock.bed[0].mm), h.min(stock.bed[1].mm));
        let (upright, turned) = (on_bed(width, height), on_bed(height, width));
        let may_turn = self.rotations == Angles::Word(AngleWord::Free);
        if may_turn && turned.x * turned.y > upright.x * upright.y { turned } else { upright }
    }
}

/// Area of the parts over the area of the sheets, the last one cut off a margin above its parts.
fn density(sheets: &Sheets) -> f64 {
    let parts: f64 = sheets.sheets.iter().flat_map(|it| &it.parts).map(|it| area(&it.contours)).sum();
    let stock = |(k, sheet): (usize, &Sheet)| {
        let top = Box2::of(sheet.parts.iter().flat_map(|it| &it.contours[0])).max.y + sheets.margin;
        sheet.size.x * if k + 1 == sheets.sheets.len() { top.min(sheet.size.y) } else { sheet.size.y }
    };
    let stock: f64 = sheets.sheets.iter().enumerate().map(stock).sum();
    if stock > 0.0 { parts / stock } else { 0.0 }
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
