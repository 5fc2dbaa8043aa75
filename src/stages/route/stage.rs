//! The `[route]` table.
use serde::{Deserialize, Serialize};
use serde_json::{Map, json};

use super::{Bridges, Dynamics, Knife, Options, RouteError, Tool, route};
use crate::{
    geom::Vec2,
    model::{Sheets, Toolpaths},
    profile::{Head, Length, Machine, Profiles},
    stage::{Check, Cx, KeyError, Section, Stage},
};

/// Seconds that a change of a beam takes.
const BEAM: f64 = 0.0;

/// How lines are ordered and run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RouteStage {
    /// Points within this of the line between their neighbours are dropped.
    pub tolerance: Length,
    /// Largest distance between a line and the arc that replaces it; 0 for straight lines only.
    pub arcs: Length,
}

impl Default for RouteStage {
    fn default() -> Self {
        Self { tolerance: Length::mm(0.005), arcs: Length::mm(0.02) }
    }
}

impl Stage for RouteStage {
    const NAME: &'static str = "route";
    const VERSION: u32 = 4;
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
        KeyError::range("tolerance", self.tolerance.mm, 0.0, 0.01)?;
        // Beyond a twentieth of a millimetre an arc can be seen to miss its line.
        KeyError::range("arcs", self.arcs.mm, 0.0, 0.05)
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
        let narrow = &job.uncompensated;
        Section::new("route", table).check(Check {
            name: "route.kerf".into(),
            ok: narrow.is_empty(),
            value: narrow.len() as f64,
            limit: 0.0,
            unit: "holes".into(),
            note: match narrow.first() {
                None => "every hole is wider than the cut".into(),
                Some(first) => format!("{first} is narrower than the cut, which goes along its edge instead"),
            },
        })
    }
}

impl RouteStage {
    fn options(&self, machine: &Machine) -> Options {
        let tool = |operation| {
            let tool = machine.tools.get(operation)?;
            let full = match machine.head {
                Head::Z { down, .. } => tool.down.unwrap_or(down).abs(),
                _ => 0.0,
            };
            let n = tool.passes;
            let depth = |k: u32| if full > 0.0 { f64::from(k) / f64::from(n) } else { 1.0 };
            let bridges = tool.bridges.map(|it| Bridges {
                count: it.count as usize,
                width: it.width.mm,
                below: it.height.filter(|_| full > 0.0).map_or(0.0, |height| (1.0 - height.mm / full).max(0.0)),
            });
            Some(Tool {
                operation,
                feed: tool.feed / 60.0,
                passes: (1..=n).map(depth).collect(),
                blade: machine.is_blade(tool),
                kerf: tool.kerf.mm,
                lead: tool.lead.mm,
                bridges,
            })
        };
        let lift = match machine.head {
            Head::Laser { .. } => BEAM,
            Head::Servo { dwell_up, dwell_down, .. } => dwell_up + dwell_down,
            Head::Z { up, down, plunge, dwell } => (up - down) * (60.0 / plunge + 60.0 / machine.rapid) + dwell,
        };
        let [width, height] = machine.bed.map(|it| it.mm);
        let height = if machine.roll { f64::INFINITY } else { height };
        Options {
            tools: machine.order.iter().filter_map(tool).collect(),
            bed: Vec2::new(width, height),
            home: machine.from_work(Vec2::zeros(), Vec2::new(1.0, 1.0)),
            tolerance: self.tolerance.mm,
            arcs: if machine.arcs { self.arcs.mm } else { 0.0 },
            knife: machine.knife.map(|it| Knife {
                offset: it.offset.mm,
                overcut: it.overcut.mm,
                lift: it.lift.map(f64::to_radians),
            }),
            dynamics: Dynamics { rapid: machine.rapid / 60.0, acceleration: machine.acceleration, lift },
        }
    }
}
