//! The `[route]` table.
use serde::{Deserialize, Serialize};
use serde_json::{Map, json};

use super::{Dynamics, Knife, Options, RouteError, Tool, route};
use crate::{
    geom::Vec2,
    model::{Sheets, Toolpaths},
    profile::{Head, Length, Machine, MachineKind, Profiles},
    stage::{Cx, KeyError, Section, Stage},
};

/// Seconds that a change of a beam takes.
const BEAM: f64 = 0.0;

/// How lines are ordered and run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RouteStage {
    /// Points within this of the line between their neighbours are dropped.
    pub tolerance: Length,
}

impl Default for RouteStage {
    fn default() -> Self {
        Self { tolerance: Length::mm(0.005) }
    }
}

impl Stage for RouteStage {
    const NAME: &'static str = "route";
    const VERSION: u32 = 1;
    type Input = Sheets;
    type Output = Toolpaths;
    /// Feeds, speeds and the blade; all of it is read.
    type Profile = Machine;
    type Error = RouteError;

    fn profile(profiles: &Profiles) -> Machine {
        profiles.machine.clone()
    }

    fn check(&self) -> Result<(), KeyError> {
        // Contours are at least twice `layout.merge` apart only where a slit was opened; half of 0.02 mm keeps them apart.
        KeyError::range("tolerance", self.tolerance.mm, 0.0, 0.01)
    }

    fn run(&self, sheets: &Sheets, machine: &Machine, cx: &Cx) -> Result<Toolpaths, RouteError> {
        route(sheets, &self.options(machine), &cx.monitor)
    }

    fn section(&self, _: &Sheets, _: &Machine, job: &Toolpaths) -> Section {
        let left_out: Map<_, _> = job.left_out.iter().map(|(it, count)| (it.name().into(), (*count).into())).collect();
        let table = json!({
            "cut_mm": job.cut_length,
            "travel_mm": job.travel_length,
            "lifts": job.lifts,
            "seconds_estimate": job.seconds,
            "left_out": left_out,
        });
        Section::new("route", table)
    }
}

impl RouteStage {
    fn options(&self, machine: &Machine) -> Options {
        // The blade is the tool that cuts; other tools of the same machine (pens, creasers) do not trail.
        let blade = machine.tools.get(crate::model::Operation::CutOutside).map(|it| it.number);
        let tool = |operation| {
            let tool = machine.tools.get(operation)?;
            let blade = machine.kind == MachineKind::DragKnife && Some(tool.number) == blade;
            Some(Tool { operation, feed: tool.feed / 60.0, passes: tool.passes, blade })
        };
        let lift = match machine.head {
            Head::Laser { .. } => BEAM,
            Head::Servo { dwell_up, dwell_down, .. } => dwell_up + dwell_down,
            Head::Z { up, down, plunge, dwell } => (up - down) * (60.0 / plunge + 60.0 / machine.rapid) + dwell,
        };
        let [width, height] = machine.bed.map(|it| it.mm);
        Options {
            tools: machine.order.iter().filter_map(tool).collect(),
            bed: Vec2::new(width, height),
            home: machine.from_work(Vec2::zeros(), Vec2::new(1.0, 1.0)),
            tolerance: self.tolerance.mm,
            knife: machine.knife.map(|it| Knife { offset: it.offset.mm, overcut: it.overcut.mm }),
            dynamics: Dynamics { rapid: machine.rapid / 60.0, acceleration: machine.acceleration, lift },
        }
    }
}
