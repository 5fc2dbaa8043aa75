//! What is cut.
use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::{
    Angle, Length, Machine, MachineKind, Tool,
    check::{Fault, Rule, at_least_zero, positive, within},
    operations::PerOperation,
};
use crate::model::Operation;

/// Values of a [`Tool`] that a material asks for; what is absent stays as the machine has it.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ToolPatch {
    /// Feed rate, mm/min.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub feed: Option<f64>,
    /// Share of the laser's range.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub power: Option<f64>,
    /// How often the path is run.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub passes: Option<u32>,
    /// Width of material that the tool takes away.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub kerf: Option<Length>,
    /// Where the head goes to work.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub down: Option<f64>,
}

impl ToolPatch {
    /// Writes what is present into `tool`, save fields that `kept` names.
    pub(super) fn apply(&self, tool: &mut Tool, kept: impl Fn(&str) -> bool) {
        fn set<T: Copy>(slot: &mut T, value: Option<T>, kept: bool) {
            if let (Some(value), false) = (value, kept) {
                *slot = value;
            }
        }
        set(&mut tool.feed, self.feed, kept("feed"));
        set(&mut tool.power, self.power, kept("power"));
        set(&mut tool.passes, self.passes, kept("passes"));
        set(&mut tool.kerf, self.kerf, kept("kerf"));
        set(&mut tool.down, self.down.map(Some), kept("down"));
    }
}

/// What joins pieces of a material along their seams.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum JoinKind {
    /// Edge to edge: tape, glue, solder.
    #[default]
    Butt,
    /// Flaps glued under the other side.
    Tabs,
    /// Flaps riveted under the other side, one rivet each.
    Rivets,
    /// Allowance outside a sew line, with notches.
    Allowance,
    /// Holes along both sides, for lacing or hand stitching.
    Holes,
    /// Fingers of either side in turn in notches of the other, for board that is not folded.
    Fingers,
}

impl JoinKind {
    /// Whether it adds material outside the seams.
    pub fn stands_out(self) -> bool {
        matches!(self, Self::Tabs | Self::Rivets | Self::Allowance | Self::Fingers)
    }

    /// What to do along a seam, for people.
    pub fn instruction(self) -> &'static str {
        match self {
            Self::Butt => "Lay edge against edge, number to number, and join them with tape or glue",
            Self::Tabs => "Fold the tabs back and glue them under the edge with the same number",
            Self::Rivets => "Put the flaps under the edge with the same number and rivet them",
            Self::Allowance => {
                "Lay the sides with the same number face to face, match the notches, and sew along the line"
            }
            Self::Fingers => {
                "Push the fingers of either edge into the notches of the other, number to number, and glue them"
            }
            Self::Holes => "Lay edge against edge, number to number, and stitch through the holes",
        }
    }
}

/// Which side of a seam carries tabs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum TabSides {
    /// One side, the other where there is no room.
    One,
    /// Both in turn.
    #[default]
    Alternating,
    /// Both.
    Both,
}

/// How pieces of a material are joined; each kind reads only the keys that are its own.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Joining {
    /// The kind.
    pub kind: JoinKind,
    /// Width of tabs or of the allowance; where fingers join sheets nearly in one plane, twice as far as they reach.
    pub width: Length,
    /// Angle between the flanks of a tab and the seam.
    pub angle: Angle,
    /// Longest stretch of a seam that one tab or finger takes.
    pub length: Length,
    /// Which sides carry tabs.
    pub sides: TabSides,
    /// Diameter of holes, for rivets too.
    pub diameter: Length,
    /// Distance of the middle of a hole from the edge.
    pub inset: Length,
    /// Distance of holes along a seam, about.
    pub pitch: Length,
}

impl Default for Joining {
    fn default() -> Self {
        Self {
            kind: JoinKind::Butt,
            width: Length::mm(6.0),
            angle: Angle::degrees(60.0),
            length: Length::mm(15.0),
            sides: TabSides::Alternating,
            diameter: Length::mm(1.0),
            inset: Length::mm(3.0),
            pitch: Length::mm(4.0),
        }
    }
}

impl Joining {
    fn check(&self) -> Result<(), Fault> {
        within("join.width", self.width.mm, 0.5, 200.0)?;
        within("join.angle", self.angle.radians.to_degrees(), 20.0, 89.0)?;
        within("join.length", self.length.mm, 2.0, 1000.0)?;
        within("join.diameter", self.diameter.mm, 0.2, 50.0)?;
        within("join.inset", self.inset.mm, self.diameter.mm, 200.0)?;
        within("join.pitch", self.pitch.mm, 2.0 * self.diameter.mm, 1000.0)
    }
}

/// How sheet metal is bent.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Bend {
    /// Inner radius of bends.
    pub radius: Length,
    /// K-factors: pairs of R/T (inner radius over thickness) and the distance of the neutral fibre from the inner side over
    /// the thickness, R/T rising; straight lines between, the first and last beyond.
    pub k_factor: Vec<[f64; 2]>,
}

impl Bend {
    /// K for a sheet of that thickness.
    pub fn k(&self, thickness: f64) -> f64 {
        let ratio = self.radius.mm / thickness;
        let table = &self.k_factor;
        let next = table.partition_point(|it| it[0] < ratio);
        if next == 0 || next == table.len() {
            return table[next.min(table.len() - 1)][1];
        }
        let ([x0, k0], [x1, k1]) = (table[next - 1], table[next]);
        k0 + (k1 - k0) * (ratio - x0) / (x1 - x0)
    }

    fn check(&self) -> Result<(), Fault> {
        within("bend.radius", self.radius.mm, 0.0, 1000.0)?;
        let rising = self.k_factor.windows(2).all(|w| w[0][0] < w[1][0]);
        if self.k_factor.is_empty() || !rising {
            return Err(Fault::new("bend.k_factor", "must list pairs [R/T, K] with rising R/T, at least one"));
        }
        self.k_factor.iter().try_for_each(|[ratio, k]| {
            within("bend.k_factor", *ratio, 0.0, 1e4)?;
            within("bend.k_factor", *k, 0.0, 1.0)
        })
    }
}

/// Folds that are cut through in stretches instead of scored.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Perforation {
    /// Length of a cut.
    pub cut: Length,
    /// What is left between two, at least.
    pub gap: Length,
}

/// A material profile (`profiles/materials/NAME.toml`). Every figure in the built-in ones names its source.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Material {
    /// Name of the profile: the built-in name, or the file name without its ending. Part of the names of files.
    #[serde(skip)]
    pub name: String,
    /// For people: "Paper, 200 g/m²".
    pub title: String,
    /// Thickness of the sheet.
    pub thickness: Length,
    /// Width and height of the stock.
    pub sheet: [Length; 2],
    /// Kept free along the edges of the stock.
    pub margin: Length,
    /// Kept free between parts.
    pub gap: Length,
    /// How far it may be stretched or squeezed, as |log scale| (0.005 = half a percent).
    pub stretch: f64,
    /// Side of a square: pieces of a smaller area are too small to handle, and made only where nothing else lies flat.
    pub min_piece: Length,
    /// Pieces hang together by at least this, and are no strips narrower than this, unless nothing else lies flat: less tears
    /// or bends away while it is cut and joined. Any width does where it is absent.
    #[serde(default)]
    pub min_neck: Length,
    /// Smallest radius to which the sheet can be rolled; absent where it may be folded, or nobody knows.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bend_radius: Option<Length>,
    /// How deep under the outside of the finished thing the layer lies that keeps its length when the sheet is bent, as a
    /// share of the thickness; patterns are made for that layer. 0 for sheets too thin to matter, negative where the model is
    /// the inside of the thing.
    #[serde(default)]
    pub neutral_layer: f64,
    /// Whether the stock is a roll: on a machine that takes rolls, the height in `sheet` is no limit.
    #[serde(default)]
    pub roll: bool,
    /// How its pieces are joined.
    #[serde(default)]
    pub join: Joining,
    /// How it is bent at folds; absent where it is folded.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bend: Option<Bend>,
    /// Folds are cut through in stretches, with the machine's settings for cutting inside; scored when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub perforation: Option<Perforation>,
    /// The kinds of machine that can work it, each with the settings it needs there.
    pub process: BTreeMap<MachineKind, PerOperation<ToolPatch>>,
}

impl Rule for Material {
    fn check(&self) -> Result<(), Fault> {
        positive("thickness", self.thickness.mm)?;
        positive("sheet", self.sheet[0].mm)?;
        positive("sheet", self.sheet[1].mm)?;
        at_least_zero("margin", self.margin.mm)?;
        at_least_zero("gap", self.gap.mm)?;
        within("stretch", self.stretch, 0.0, 1.0)?;
        at_least_zero("min_piece", self.min_piece.mm)?;
        at_least_zero("min_neck", self.min_neck.mm)?;
        within("neutral_layer", self.neutral_layer, -1.0, 1.0)?;
        at_least_zero("bend_radius", self.bend_radius.map_or(0.0, |it| it.mm))?;
        let short = self.sheet[0].mm.min(self.sheet[1].mm);
        if 2.0 * self.margin.mm >= short {
            let message = format!("of {} mm on both sides leaves nothing of a sheet {short} mm wide", self.margin.mm);
            return Err(Fault::new("margin", message));
        }
        self.join.check()?;
        self.bend.as_ref().map_or(Ok(()), Bend::check)?;
        if self.bend.is_some() && self.neutral_layer != 0.0 {
            let message = "must be 0 beside [bend]: bends are reckoned from the outside of the thing";
            return Err(Fault::new("neutral_layer", message));
        }
        if let Some(Perforation { cut, gap }) = self.perforation {
            within("perforation.cut", cut.mm, 0.1, 100.0)?;
            within("perforation.gap", gap.mm, 0.1, 100.0)?;
        }
        if self.process.is_empty() {
            return Err(Fault::new(
                "process",
                "must name at least one kind of machine: laser, drag-knife, router, pen",
            ));
        }
        Ok(())
    }

    fn rename(&mut self, name: String) {
        self.name = name;
    }
}

impl Material {
    /// How far the neutral layer lies outside the surface of the model, mm.
    pub fn offset(&self) -> f64 {
        -self.neutral_layer * self.thickness.mm
    }

    /// Writes the settings that this material needs into the tools of `machine`, save those that `kept` names by
    /// operation and field.
    pub(super) fn prepare(&self, machine: &mut Machine, kept: impl Fn(Operation, &str) -> bool) -> Result<(), Fault> {
        let Some(patches) = self.process.get(&machine.kind) else {
            if machine.kind.works_blocks() {
                return Ok(());
            }
            let kinds: Vec<&str> = self.process.keys().map(|it| it.name()).collect();
            let message = format!(
                "has no [process.{kind}], and `{machine}` is a machine of that kind: {material} is worked with {kinds}; \
                 choose another machine, or add an empty table [process.{kind}] to try it",
                kind = machine.kind.name(),
                machine = machine.name,
                material = self.name,
                kinds = kinds.join(", "),
            );
            return Err(Fault::new("process", message));
        };
        for (operation, patch) in patches.iter() {
            if let Some(tool) = machine.tools.get_mut(operation) {
                patch.apply(tool, |field| kept(operation, field));
            }
        }
        let through = machine.tools.get(Operation::CutInside).cloned().filter(|_| self.perforation.is_some());
        for operation in [Operation::ScoreValley, Operation::ScoreMountain] {
            if let (Some(through), Some(tool)) = (&through, machine.tools.get_mut(operation)) {
                let kept = |field: &str| kept(operation, field);
                let all = ToolPatch {
                    feed: Some(through.feed),
                    power: Some(through.power),
                    passes: Some(through.passes),
                    ..ToolPatch::default()
                };
                all.apply(tool, kept);
                tool.down = if kept("down") { tool.down } else { through.down };
                tool.number = if kept("number") { tool.number } else { through.number };
            }
        }
        Ok(())
    }
}
