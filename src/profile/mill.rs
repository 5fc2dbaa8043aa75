//! Mills with two rotary axes, and hot wires: their axes and how their controllers are told.
use serde::{Deserialize, Serialize};

use super::{
    Dialect, Length,
    check::{Fault, at_least_zero, positive},
    machine::RotaryAxis,
};

/// A linear axis; its zero is that of the work, in the middle of the table top (mills).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LinearAxis {
    /// One end of the travel.
    pub min: Length,
    /// The other end.
    pub max: Length,
    /// Largest speed, mm/min.
    pub speed: f64,
}

/// What a rotary axis turns.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Turns {
    /// The part.
    Table,
    /// The spindle.
    Head,
}

/// A rotary axis of a mill.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rotation {
    /// Its letter, and so the axis that it turns about: A about x, B about y, C about z.
    pub axis: RotaryAxis,
    /// What it turns.
    pub turns: Turns,
    /// A point that it turns about, in work coordinates with all axes at 0. Not read for heads.
    #[serde(default = "origin")]
    pub point: [Length; 3],
    /// Whether positive words turn the other way round than the right-hand rule says.
    #[serde(default)]
    pub reverse: bool,
    /// Least angle, degrees.
    pub min: f64,
    /// Largest angle, degrees.
    pub max: f64,
    /// Largest speed, degrees per minute.
    pub speed: f64,
}

fn origin() -> [Length; 3] {
    [Length::mm(0.0); 3]
}

/// Words that make a controller keep the tip of the tool on its way while the rotary axes turn.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TipControl {
    /// Starts it.
    pub on: String,
    /// Ends it.
    pub off: String,
}

/// A mill with two rotary axes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Mill {
    /// The x axis.
    pub x: LinearAxis,
    /// The y axis.
    pub y: LinearAxis,
    /// The z axis.
    pub z: LinearAxis,
    /// The rotary axes: two tables from the base to the part, or a table and a head.
    pub rotary: [Rotation; 2],
    /// From the axis of a head to the gauge line of the spindle nose; the length of the tool comes on top. Not read without
    /// a head.
    #[serde(default = "zero")]
    pub pivot: Length,
    /// Written where the controller knows the kinematics; programs in joint coordinates are written in any case.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tip_control: Option<TipControl>,
}

fn zero() -> Length {
    Length::mm(0.0)
}

/// A straight hot wire between two carriages. The block goes
/// where the program says, in the middle of what the carriages reach.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HotWire {
    /// Distance of the planes in which the carriages move.
    pub span: Length,
    /// Left carriage, along.
    pub x: LinearAxis,
    /// Left carriage, up.
    pub y: LinearAxis,
    /// Right carriage, along.
    pub u: LinearAxis,
    /// Right carriage, up.
    pub v: LinearAxis,
    /// Width that the wire melts away, less its own: set by heat and speed.
    pub kerf: Length,
}

fn linear(name: &str, it: &LinearAxis) -> Result<(), Fault> {
    positive(&format!("{name}.speed"), it.speed)?;
    if it.min.mm.is_finite() && it.max.mm.is_finite() && it.min.mm < it.max.mm {
        return Ok(());
    }
    Err(Fault::new(&format!("{name}.max"), format!("must be more than `min`, which is {} mm", it.min.mm)))
}

/// Controllers that can be told of more than three axes.
fn dialect(dialect: Dialect, what: &str) -> Result<(), Fault> {
    if dialect == Dialect::LinuxCnc {
        return Ok(());
    }
    let name = match dialect {
        Dialect::Grbl => "grbl",
        Dialect::Marlin => "marlin",
        Dialect::LinuxCnc => "linux-cnc",
    };
    Err(Fault::new("dialect", format!("`{name}` does not know {what}; \"linux-cnc\" does")))
}

impl Mill {
    pub(super) fn check(&self, controller: Dialect) -> Result<(), Fault> {
        dialect(controller, "two rotary axes and inverse-time feeds together")?;
        for (name, it) in [("mill.x", &self.x), ("mill.y", &self.y), ("mill.z", &self.z)] {
            linear(name, it)?;
        }
        at_least_zero("mill.pivot", self.pivot.mm)?;
        for it in &self.rotary {
            positive("mill.rotary.speed", it.speed)?;
            if !(it.min < it.max && it.min >= -1e5 && it.max <= 1e5) {
                let message = format!("must be more than `min`, which is {}°, and at most 100000°", it.min);
                return Err(Fault::new("mill.rotary.max", message));
            }
            if it.point.iter().any(|it| !it.mm.is_finite()) {
                return Err(Fault::new("mill.rotary.point", "must be finite"));
            }
        }
        let fault = |message: &str| Err(Fault::new("mill.rotary", message));
        let [first, second] = &self.rotary;
        if first.axis == second.axis {
            return fault("must be two different axes");
        }
        let tilts = match (first.turns, second.turns) {
            (Turns::Head, Turns::Head) => {
                return fault("two heads are not known; there are two tables, or a table and a head");
            }
            (Turns::Table, Turns::Table) | (Turns::Head, Turns::Table) => first,
            (Turns::Table, Turns::Head) => second,
        };
        if tilts.axis == RotaryAxis::C {
            return fault(
                "a head, or the first of two tables, cannot be a C axis: it would turn about the spindle and tilt nothing",
            );
        }
        Ok(())
    }
}

impl HotWire {
    pub(super) fn check(&self, controller: Dialect) -> Result<(), Fault> {
        dialect(controller, "the axes U and V")?;
        positive("wire.span", self.span.mm)?;
        at_least_zero("wire.kerf", self.kerf.mm)?;
        for (name, it) in [("wire.x", &self.x), ("wire.y", &self.y), ("wire.u", &self.u), ("wire.v", &self.v)] {
            linear(name, it)?;
        }
        Ok(())
    }
}
