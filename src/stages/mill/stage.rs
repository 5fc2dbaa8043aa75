//! The `[mill]` table and its section of the report.
use std::f64::consts::PI;

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::{Carrier, Kinematics, Linear, Machine, MillError, Options, Rotary, Wire, mill};
use crate::{
    geom::Vec3,
    mesh::sweep::{Deepest, Tool},
    model::{CutMesh, Milling, StripLeft, Strips},
    profile::{self, Angle, Length, LinearAxis, Profiles, RotaryAxis, Turns},
    stage::{Check, Cx, KeyError, Section, Stage},
};

/// Directions of the model that may lie up.
const UPS: &[(&str, Vec3)] = &[
    ("+x", Vec3::new(1.0, 0.0, 0.0)),
    ("-x", Vec3::new(-1.0, 0.0, 0.0)),
    ("+y", Vec3::new(0.0, 1.0, 0.0)),
    ("-y", Vec3::new(0.0, -1.0, 0.0)),
    ("+z", Vec3::new(0.0, 0.0, 1.0)),
    ("-z", Vec3::new(0.0, 0.0, -1.0)),
];

/// How pieces are cut with the side of a cutter, or with a hot wire. All figures are starting values.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MillStage {
    /// Names of the pieces to cut; every one that can be cut when empty.
    pub pieces: Vec<String>,
    /// Side of the model that lies up: "+x", "-x", "+y", "-y", "+z", "-z", or "auto" for the one that reaches most.
    pub up: String,
    /// Diameter of the cutter, at the tip of a cone.
    pub diameter: Length,
    /// Half angle of a conical cutter, degrees.
    pub taper: Angle,
    /// Length of its cutting edges.
    pub flute: Length,
    /// Diameter of the shank above them.
    pub shank: Length,
    /// From the tip to the holder.
    pub reach: Length,
    /// Diameter of the holder.
    pub holder: Length,
    /// Length of the holder with the spindle nose.
    pub holder_length: Length,
    /// How far the cutter reaches beyond the end of a ruling, where there is room.
    pub overhang: Length,
    /// How far a strip is cut beyond its first and last ruling, where there is room.
    pub overlap: Length,
    /// Length of the ways in and out over the surface.
    pub lead: Length,
    /// Distance of rapid moves from the body.
    pub clearance: Length,
    /// Material on the surface before the first cut.
    pub stock: Length,
    /// Most that one cut takes off.
    pub depth: Length,
    /// How deep the surface may be cut into.
    pub gouge: Length,
    /// How much may be left on it where the cutter passed.
    pub excess: Length,
    /// Speed of the cut, mm/min.
    pub feed: f64,
    /// Spindle speed, 1/min; not read for a wire.
    pub spindle: f64,
    /// Width, depth and height of the block that the part stands on.
    pub fixture: [Length; 3],
}

impl Default for MillStage {
    fn default() -> Self {
        let mm = Length::mm;
        Self {
            pieces: vec![],
            up: "auto".into(),
            diameter: mm(6.0),
            taper: Angle::degrees(0.0),
            flute: mm(60.0),
            shank: mm(5.8),
            reach: mm(75.0),
            holder: mm(25.0),
            holder_length: mm(40.0),
            overhang: mm(1.0),
            overlap: mm(0.5),
            lead: mm(4.0),
            clearance: mm(10.0),
            stock: mm(0.0),
            depth: mm(1.0),
            gouge: mm(0.02),
            excess: mm(0.1),
            feed: 600.0,
            spindle: 12_000.0,
            fixture: [mm(40.0), mm(40.0), mm(30.0)],
        }
    }
}

/// The axes of the machine, if it works blocks.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Axes {
    name: String,
    mill: Option<profile::Mill>,
    wire: Option<profile::HotWire>,
}

impl Stage for MillStage {
    const NAME: &'static str = "mill";
    const VERSION: u32 = 3;
    type Input = (CutMesh, Strips);
    type Output = Milling;
    type Profile = Axes;
    type Error = MillError;

    fn profile(profiles: &Profiles) -> Axes {
        let it = &profiles.machine;
        Axes { name: it.name.clone(), mill: it.mill.clone(), wire: it.wire.clone() }
    }

    fn check(&self) -> Result<(), KeyError> {
        let lengths: [(&'static str, Length, f64, f64); 14] = [
            ("diameter", self.diameter, 0.05, 200.0),
            ("flute", self.flute, 0.5, 1000.0),
            ("shank", self.shank, 0.05, 200.0),
            ("reach", self.reach, self.flute.mm, 2000.0),
            ("holder", self.holder, 0.05, 500.0),
            ("holder_length", self.holder_length, 0.0, 1000.0),
            ("overhang", self.overhang, 0.0, 100.0),
            ("overlap", self.overlap, 0.0, 100.0),
            ("lead", self.lead, 0.0, 200.0),
            ("clearance", self.clearance, 0.5, 500.0),
            ("stock", self.stock, 0.0, 500.0),
            ("depth", self.depth, 0.01, 500.0),
            ("gouge", self.gouge, 1e-3, 5.0),
            ("excess", self.excess, 1e-3, 50.0),
        ];
        for (key, value, min, max) in lengths {
            KeyError::range(key, value.mm, min, max)?;
        }
        KeyError::range("taper", self.taper.radians.to_degrees(), 0.0, 45.0)?;
        KeyError::range("feed", self.feed, 1.0, 1e5)?;
        KeyError::range("spindle", self.spindle, 1.0, 1e6)?;
        for it in self.fixture {
            KeyError::range("fixture", it.mm, 0.0, 5000.0)?;
        }
        if self.up == "auto" || UPS.iter().any(|it| it.0 == self.up) {
            return Ok(());
        }
        let message =
            format!("must be \"auto\", \"+x\", \"-x\", \"+y\", \"-y\", \"+z\" or \"-z\", not \"{}\"", self.up);
        Err(KeyError { key: "up", message })
    }

    fn run(&self, (cut, strips): (&CutMesh, &Strips), axes: &Axes, cx: &Cx) -> Result<Milling, MillError> {
        let machine = machine(axes, self.reach.mm + self.holder_length.mm)
            .ok_or_else(|| MillError::Machine { name: axes.name.clone() })?;
        mill(cut, strips, &self.options(machine, axes), &cx.monitor)
    }

    fn section(&self, (cut, _): (&CutMesh, &Strips), _: &Axes, it: &Milling) -> Section {
        let table = json!({
            "pieces": it.pieces,
            "refused": named(&it.refused),
            "tight": named(&it.tight),
            "left": it.left.iter().map(left_out).collect::<Vec<_>>(),
            "max_unfit_mm": it.unfit.depth,
            "unfit_share": it.unfit_share,
            "segments": it.segments,
            "blocks": it.moves.len(),
            "max_gouge_mm": it.gouge.depth,
            "max_excess_mm": it.excess.depth,
            "max_collision_mm": it.collision.depth,
            "covered_share": it.covered,
            "seconds_estimate": it.seconds(),
            "setup": { "x": row(it.setup.rows[0]), "y": row(it.setup.rows[1]), "z": row(it.setup.rows[2]), "shift_mm": row(it.setup.shift) },
        });
        let section = Section::new("mill", table);
        checks(it).into_iter().fold(section, Section::check).check(pieces_check(cut, it))
    }
}

fn at(it: &Deepest) -> String {
    format!("({:.1}, {:.1}, {:.1})", it.place.x, it.place.y, it.place.z)
}

/// What the sweep found against what is allowed.
fn checks(it: &Milling) -> [Check; 3] {
    let [gouge, excess] = it.limits;
    let place = |found: &Deepest, limit: f64, hint: &str| {
        if found.depth > limit { format!("at {}; {hint}", at(found)) } else { format!("deepest at {}", at(found)) }
    };
    let hollow = "the surface is hollow along its rulings there; develop further or cut smaller pieces";
    let free = if it.collision.depth > 0.0 {
        let place = at(&it.collision);
        format!("shank, holder or fixture at {place}; let the cutter stick out farther, or choose another `up`")
    } else {
        "shank, holder and fixture are clear of the body".into()
    };
    let gouge_note = place(&it.gouge, gouge, "a thinner cutter may fit");
    [
        Check::at_most("mill.gouge", it.gouge.depth, gouge, "mm", gouge_note),
        Check::at_most("mill.excess", it.excess.depth, excess, "mm", place(&it.excess, excess, hollow)),
        Check::at_most("mill.collision", it.collision.depth, 0.0, "mm", free),
    ]
}

/// How much is cut, what is not, and where the cutter does not fit.
fn pieces_check(cut: &CutMesh, it: &Milling) -> Check {
    let (made, total) = (it.pieces.len(), cut.pieces.len());
    let mut note = format!("{made} of {total} pieces are cut, {:.1} % of their area", 100.0 * it.covered);
    if let Some([name, reason]) = it.refused.first() {
        note = format!("{note}; {} are not: {name} {reason}", it.refused.len());
    }
    if let Some(StripLeft { piece, strip, area, reason }) = it.left.first() {
        note = format!("{note}; at most {area:.0} mm² of strip {} of {piece} are left: {reason}", strip + 1);
    }
    if it.unfit.depth > 0.0 {
        let left = it.unfit.depth;
        note =
            format!("{note}; the cutter does not fit at {}: a ball of its radius leaves {left:.2} mm", at(&it.unfit));
    }
    Check { note, ..Check::at_least("mill.pieces", made as f64, 1.0, "pieces", "") }
}

/// Pieces with what is said of them.
fn named(pieces: &[[String; 2]]) -> Vec<Value> {
    pieces.iter().map(|[name, reason]| json!({ "name": name, "reason": reason })).collect()
}

fn left_out(it: &StripLeft) -> Value {
    json!({ "piece": it.piece, "strip": it.strip + 1, "area_mm2": it.area, "reason": it.reason })
}

fn row(v: Vec3) -> [f64; 3] {
    [v.x, v.y, v.z]
}

fn axis(letter: char, it: &LinearAxis) -> Linear {
    Linear { letter, range: [it.min.mm, it.max.mm], speed: it.speed / 60.0 }
}

/// The machine of the kernel; `length` is that of the tool from the spindle nose.
fn machine(axes: &Axes, length: f64) -> Option<Machine> {
    if let Some(it) = &axes.wire {
        let axes = [axis('X', &it.x), axis('Y', &it.y), axis('U', &it.u), axis('V', &it.v)];
        return Some(Machine::Wire(Wire { span: it.span.mm, axes }));
    }
    let it = axes.mill.as_ref()?;
    let rotary = |it: &profile::Rotation| Rotary {
        letter: it.axis.letter(),
        about: match it.axis {
            RotaryAxis::A => 0,
            RotaryAxis::B => 1,
            RotaryAxis::C => 2,
        },
        carrier: match it.turns {
            Turns::Table => Carrier::Table,
            Turns::Head => Carrier::Head,
        },
        point: Vec3::from(it.point.map(|it| it.mm)),
        reverse: it.reverse,
        range: [it.min.to_radians(), it.max.to_radians()],
        speed: it.speed / 60.0 * PI / 180.0,
    };
    Some(Machine::Mill(Kinematics {
        linear: [axis('X', &it.x), axis('Y', &it.y), axis('Z', &it.z)],
        rotary: [rotary(&it.rotary[0]), rotary(&it.rotary[1])],
        pivot: it.pivot.mm + length,
    }))
}

impl MillStage {
    fn options(&self, machine: Machine, axes: &Axes) -> Options {
        let (tool, table, fixture) = match &axes.wire {
            Some(it) => {
                // A wire is longer than its span where it lies at an angle.
                (Tool::wire(it.kerf.mm / 2.0, 2.0 * it.span.mm), Vec3::new(0.0, it.span.mm / 2.0, 0.0), Vec3::zeros())
            }
            None => {
                let tool = Tool {
                    radius: self.diameter.mm / 2.0,
                    taper: self.taper.radians,
                    flute: self.flute.mm,
                    shank: self.shank.mm / 2.0,
                    reach: self.reach.mm,
                    holder: self.holder.mm / 2.0,
                    holder_length: self.holder_length.mm,
                };
                (tool, Vec3::zeros(), Vec3::from(self.fixture.map(|it| it.mm)))
            }
        };
        Options {
            pieces: self.pieces.clone(),
            machine,
            tool,
            overhang: self.overhang.mm,
            overlap: self.overlap.mm,
            lead: self.lead.mm,
            clearance: self.clearance.mm,
            stock: self.stock.mm,
            depth: self.depth.mm,
            gouge: self.gouge.mm,
            excess: self.excess.mm,
            feed: self.feed / 60.0,
            spindle: self.spindle,
            up: UPS.iter().find(|it| it.0 == self.up).map(|it| it.1),
            fixture,
            table,
        }
    }
}
