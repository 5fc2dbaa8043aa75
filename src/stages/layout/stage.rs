//! The `[layout]` table.
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::{Bending, Hold, Holes, Join, LayoutError, Options, Sides, Tabs, engrave, inspect, layout, rulings};
use crate::{
    geom::outline::check_outline,
    model::{CutMesh, Flattening, Folded, Joints, Operation, Parts, Stripes, Strips},
    profile::{Angle, Bend, JoinKind, Joining, Length, Perforation, Profiles, TabSides},
    stage::{Check, Cx, Inputs, KeyError, Section, Stage},
};

/// Faults of one kind that the note of a check names.
const NAMED: usize = 5;

/// What is drawn of the rulings of a piece.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Rulings {
    /// Nothing.
    None,
    /// Scores, mountain or valley.
    Score,
    /// Engraved lines.
    Engrave,
}

/// How pieces become parts.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LayoutStage {
    /// Points of an outline nearer than this are merged; shops refuse shorter segments.
    pub merge: Length,
    /// Slits narrower than `merge` are opened to this width.
    pub slit: Length,
    /// Folds under this angle are hidden. On developed meshes few edges are bent by 30° to 45°: bends of smooth rolling
    /// lie below, creases above.
    pub fold_angle: Angle,
    /// Height of the numbers along seams.
    pub label: Length,
    /// Seams from this length on are promised a number; shorter ones have one where it fits.
    pub label_from: Length,
    /// Height of the piece names.
    pub name: Length,
    /// Lettering is made smaller where it must, down to this.
    pub least_text: Length,
    /// Length of the match marks.
    pub tick: Length,
    /// Distance of the match marks along a seam, about.
    pub tick_spacing: Length,
    /// Whether rulings are drawn, to bend or roll along; they come from the stage `strips`.
    pub rulings: Rulings,
    /// Distance of rulings that are drawn, at least.
    pub ruling_spacing: Length,
}

impl Default for LayoutStage {
    fn default() -> Self {
        Self {
            merge: Length::mm(0.02),
            slit: Length::mm(0.1),
            fold_angle: Angle::degrees(30.0),
            label: Length::mm(3.0),
            label_from: Length::mm(12.0),
            name: Length::mm(7.0),
            least_text: Length::mm(1.4),
            tick: Length::mm(2.5),
            tick_spacing: Length::mm(25.0),
            rulings: Rulings::None,
            ruling_spacing: Length::mm(10.0),
        }
    }
}

/// What the stage reads of the profiles.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Craft {
    join: Joining,
    thickness: Length,
    /// What the machine takes away along outlines.
    kerf: Length,
    bend: Option<Bend>,
    perforation: Option<Perforation>,
}

impl Stage for LayoutStage {
    const NAME: &'static str = "layout";
    const VERSION: u32 = 12;
    type Input = (CutMesh, Flattening, Option<Strips>, Option<Stripes>, Option<Folded>);
    type Output = Parts;
    type Profile = Craft;
    type Error = LayoutError;

    fn profile(profiles: &Profiles) -> Craft {
        let Profiles { material, machine } = profiles;
        Craft {
            kerf: machine.tools.get(Operation::CutOutside).map_or(Length::mm(0.0), |it| it.kerf),
            join: material.join.clone(),
            thickness: material.thickness,
            bend: material.bend.clone(),
            perforation: material.perforation,
        }
    }

    fn check(&self) -> Result<(), KeyError> {
        KeyError::range("merge", self.merge.mm, 1e-4, 1.0)?;
        // Merging moves points by up to `merge`, so a slit must be wider than that on both sides.
        KeyError::range("slit", self.slit.mm, 2.0 * self.merge.mm, 5.0)?;
        KeyError::range("fold_angle", self.fold_angle.radians.to_degrees(), 0.1, 180.0)?;
        KeyError::range("least_text", self.least_text.mm, 0.2, 100.0)?;
        KeyError::range("label", self.label.mm, self.least_text.mm, 100.0)?;
        KeyError::range("label_from", self.label_from.mm, 0.0, 1e6)?;
        KeyError::range("name", self.name.mm, self.least_text.mm, 200.0)?;
        KeyError::range("tick", self.tick.mm, 0.5, 50.0)?;
        KeyError::range("tick_spacing", self.tick_spacing.mm, 2.0 * self.tick.mm, 10_000.0)?;
        KeyError::range("ruling_spacing", self.ruling_spacing.mm, 0.1, 10_000.0)
    }

    fn run(
        &self,
        (cut, flat, strips, stripes, folded): <Self::Input as Inputs>::Refs<'_>,
        craft: &Craft,
        cx: &Cx,
    ) -> Result<Parts, LayoutError> {
        let options = Options {
            label_from: self.label_from.mm,
            merge: self.merge.mm,
            slit: self.slit.mm,
            tool: craft.kerf.mm,
            fold_angle: self.fold_angle.radians,
            label_height: self.label.mm,
            name_height: self.name.mm,
            least_height: self.least_text.mm,
            tick: self.tick.mm,
            tick_spacing: self.tick_spacing.mm,
            join: join(&craft.join, craft.thickness.mm),
            bending: craft.bend.as_ref().map(|bend| Bending {
                thickness: craft.thickness.mm,
                radius: bend.radius.mm,
                k_factor: bend.k(craft.thickness.mm),
            }),
            perforation: craft.perforation.map(|it| (it.cut.mm, it.gap.mm)),
        };
        let mut parts = layout(cut, flat, folded, &options, &cx.monitor)?;
        if let Some(strips) = strips.filter(|_| self.rulings != Rulings::None) {
            let score = self.rulings == Rulings::Score;
            let (spacing, fold_angle) = (self.ruling_spacing.mm, self.fold_angle.radians);
            rulings::draw(&mut parts, cut, strips, &rulings::Style { score, spacing, fold_angle });
        }
        if let Some(stripes) = stripes.filter(|it| it.drawn) {
            engrave::draw(&mut parts, cut, flat, stripes);
        }
        Ok(parts)
    }

    fn section(&self, _: <Self::Input as Inputs>::Refs<'_>, _: &Craft, parts: &Parts) -> Section {
        let faults: Vec<String> = parts
            .parts
            .iter()
            .filter_map(|it| check_outline(&it.contours).err().map(|fault| format!("part {}: {fault}", it.name)))
            .chain(parts.refused.iter().cloned())
            .collect();
        let count = |wanted: &dyn Fn(Operation) -> bool| {
            parts.parts.iter().flat_map(|it| &it.marks).filter(|it| wanted(it.operation)).count()
        };
        let opened: Vec<_> = parts
            .openings
            .iter()
            .map(|it| json!({ "part": it.part, "width_mm": it.width, "area_mm2": it.area }))
            .collect();
        let [astray, doubled] =
            [inspect::astray, inspect::doubled].map(|find| parts.parts.iter().flat_map(find).collect::<Vec<String>>());
        let named = |name, found: &[String], unit| {
            // A few say where to look.
            let note = found.iter().take(NAMED).cloned().collect::<Vec<_>>().join("; ");
            Check::at_most(name, found.len() as f64, 0.0, unit, note)
        };
        let joints = &parts.joints;
        let table = json!({
            "refused": parts.refused.len(),
            "mountain_folds": count(&|it| it == Operation::ScoreMountain),
            "valley_folds": count(&|it| it == Operation::ScoreValley),
            "match_marks": count(&|it| it == Operation::Registration),
            "engraved_lines": count(&|it| it == Operation::Engrave),
            "bends": parts.bends.iter().map(bend).collect::<Vec<_>>(),
            "labels_on_partner": parts.on_partner,
            "unlabelled": parts.unlabelled,
            "unnumbered_short_seams": parts.unnumbered,
            "opened_slits": opened,
            "tabs": joints.tabs,
            "narrowed_tabs": joints.narrowed,
            "joining_holes": joints.holes,
            "narrow_allowance_mm": joints.narrow,
            "hanging_allowances": joints.bridged,
            "unjoined_seams": joints.missing,
        });
        Section::new("outlines", table)
            .check(Check::at_most("layout.outlines", faults.len() as f64, 0.0, "pieces", faults.join("; ")))
            .check(Check::at_most(
                "layout.joints",
                joints.collisions.len() as f64,
                0.0,
                "collisions",
                joints_note(joints),
            ))
            .check(named("layout.lettering", &astray, "marks astray"))
            .check(named("layout.doubled", &doubled, "lines on each other"))
            .check(Check::at_most(
                "layout.labels",
                parts.unlabelled.len() as f64,
                0.0,
                "labels",
                match (parts.unlabelled.len(), parts.on_partner.len()) {
                    (0, 0) => String::new(),
                    (0, _) => format!("no room for {}", parts.on_partner.join(", ")),
                    _ => format!(
                        "no room for: {}; set a smaller layout.least_text, or make the model larger",
                        parts.unlabelled.join(", ")
                    ),
                },
            ))
    }
}

/// A row of the list of bends.
fn bend(it: &crate::model::Bend) -> Value {
    json!({
        "part": it.part,
        "direction": if it.up { "up" } else { "down" },
        "angle_deg": it.angle.to_degrees(),
        "length_mm": it.length,
        "allowance_mm": it.allowance,
        "deduction_mm": it.deduction,
        "corrected": it.corrected,
    })
}

/// The joint that a material asks for.
fn join(joining: &Joining, thickness: f64) -> Join {
    let tabs = |hold: Hold| Tabs {
        width: joining.width.mm,
        angle: joining.angle.radians,
        length: joining.length.mm,
        sides: match joining.sides {
            TabSides::One => Sides::One,
            TabSides::Alternating => Sides::Alternating,
            TabSides::Both => Sides::Both,
        },
        hold,
    };
    match joining.kind {
        JoinKind::Butt => Join::Butt,
        JoinKind::Tabs => Join::Tabs(tabs(Hold::Glue)),
        JoinKind::Rivets => Join::Tabs(tabs(Hold::Rivet(joining.diameter.mm))),
        JoinKind::Fingers => Join::Tabs(Tabs { angle: std::f64::consts::FRAC_PI_2, ..tabs(Hold::Finger(thickness)) }),
        JoinKind::Allowance => Join::Allowance(joining.width.mm),
        JoinKind::Holes => {
            Join::Holes(Holes { diameter: joining.diameter.mm, inset: joining.inset.mm, pitch: joining.pitch.mm })
        }
    }
}

/// What collides, or what had to be left out or made smaller.
fn joints_note(joints: &Joints) -> String {
    if !joints.collisions.is_empty() {
        return joints.collisions.join("; ");
    }
    let mut notes = Vec::new();
    if joints.narrowed > 0 {
        notes.push(format!(
            "{} of {} tabs are lower than asked, because their edge is short",
            joints.narrowed, joints.tabs
        ));
    }
    if !joints.missing.is_empty() {
        notes.push(format!("no room to join {}: use tape there", joints.missing.join(", ")));
    }
    notes.join("; ")
}
