//! What cuts it.
use serde::{Deserialize, Serialize};

use super::{
    HotWire, Length, Link, Mill,
    check::{Fault, Rule, at_least_zero, positive, within},
    operations::{Order, PerOperation},
};
use crate::{geom::Vec2, model::Operation};

/// Kind of machine.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum MachineKind {
    /// CO₂ or diode laser.
    Laser,
    /// Cutting plotter with a trailing blade.
    DragKnife,
    /// Spindle with an end mill, for outlines in flat stock.
    Router,
    /// Draws only: what others cut, it draws.
    Pen,
    /// Mill with two rotary axes.
    Mill,
    /// Straight hot wire between two carriages, for foam.
    HotWire,
}

impl MachineKind {
    /// Its name in profiles.
    pub fn name(self) -> &'static str {
        match self {
            Self::Laser => "laser",
            Self::DragKnife => "drag-knife",
            Self::Router => "router",
            Self::Pen => "pen",
            Self::Mill => "mill",
            Self::HotWire => "hot-wire",
        }
    }

    /// Whether it works blocks, not sheets: the material of a job is then that of its templates.
    pub fn works_blocks(self) -> bool {
        matches!(self, Self::Mill | Self::HotWire)
    }
}

/// What its board understands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Dialect {
    /// GRBL 1.1, grblHAL, FluidNC.
    #[default]
    Grbl,
    /// Marlin: dwells in milliseconds, a servo by M280, motion awaited before the tool is switched.
    Marlin,
    /// Controllers of the LinuxCNC kind, which read whole files: G64 for smooth corners.
    LinuxCnc,
}

/// An sRGB colour, written "#rrggbb".
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Color(pub [u8; 3]);

impl TryFrom<String> for Color {
    type Error = String;
    fn try_from(text: String) -> Result<Self, String> {
        let wrong = || format!("`{text}` is not a colour; write it as \"#rrggbb\"");
        let digits = text.strip_prefix('#').filter(|it| it.len() == 6 && it.is_ascii()).ok_or_else(wrong)?;
        let byte = |i: usize| u8::from_str_radix(&digits[2 * i..2 * i + 2], 16).map_err(|_| wrong());
        Ok(Self([byte(0)?, byte(1)?, byte(2)?]))
    }
}

impl From<Color> for String {
    fn from(Color([r, g, b]): Color) -> Self {
        format!("#{r:02x}{g:02x}{b:02x}")
    }
}

/// How an operation appears in drawings.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Layer {
    /// Layer name in SVG and DXF.
    pub name: String,
    /// Stroke colour. Software that maps settings by colour tells layers apart by nothing else.
    pub color: Color,
    /// Whether DXF files show it with the line type DASHED, as shops expect of bend lines. The lines themselves stay whole.
    #[serde(default)]
    pub dashed: bool,
}

/// How a machine carries out an operation, after the material has had its say.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tool {
    /// Feed rate, mm/min.
    pub feed: f64,
    /// Laser power as a share of the machine's range, in [0, 1]. Not read by other heads.
    #[serde(default = "full")]
    pub power: f64,
    /// How often the path is run.
    #[serde(default = "once")]
    pub passes: u32,
    /// Width of material that the tool takes away.
    #[serde(default = "no_kerf")]
    pub kerf: Length,
    /// Radius of the arcs that lead a closed cut in from the waste and out again; 0 for none. Blades have none.
    #[serde(default = "no_kerf")]
    pub lead: Length,
    /// Webs that hold the part in a through cut.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bridges: Option<Bridges>,
    /// Where the head goes to work, in the unit of [`Head`]'s `down`; the head's own value when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub down: Option<f64>,
    /// Force of the tool on the material, grams, for plots (HPGL's `FS`); where absent, that of the tool before it, or as
    /// set at the cutter.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub force: Option<f64>,
    /// Which tool is in the holder; the program pauses where the number changes.
    #[serde(default = "once")]
    pub number: u32,
}

/// Webs left standing in every cut that frees a part, or what is in its hole.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Bridges {
    /// How many in each contour; short ones have fewer.
    pub count: u32,
    /// Width of a web.
    pub width: Length,
    /// Height of a web above the deepest cut, where the head has a Z axis; as high as the cut is deep when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub height: Option<Length>,
}

fn full() -> f64 {
    1.0
}

fn yes() -> bool {
    true
}

fn once() -> u32 {
    1
}

fn no_kerf() -> Length {
    Length::mm(0.0)
}

/// How the tool is brought to work and back.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Head {
    /// A beam, switched by the S word. The board needs laser mode (`$32=1`), or it stops at every change of S.
    Laser {
        /// S word of full power (`$30`).
        power_max: f64,
        /// M4, where the board lowers the power with the speed in corners; otherwise M3.
        dynamic: bool,
    },
    /// A servo on the spindle's PWM, moved by `M3 S…`. The board needs `$32=0`.
    Servo {
        /// S word with the tool lifted.
        up: f64,
        /// S word with the tool at work.
        down: f64,
        /// Seconds until the lifted tool is clear.
        dwell_up: f64,
        /// Seconds until the lowered tool rests on the material.
        dwell_down: f64,
    },
    /// A Z axis; Z = 0 is the surface of the material.
    Z {
        /// Height with the tool lifted, mm.
        up: f64,
        /// Height with the tool at work, mm.
        down: f64,
        /// Feed rate of the way down, mm/min.
        plunge: f64,
        /// Seconds to wait at the bottom.
        dwell: f64,
    },
}

impl Head {
    /// What `$32` must be on a GRBL-type board; `None` where it does not matter.
    pub fn laser_mode(&self) -> Option<bool> {
        match self {
            Self::Laser { .. } => Some(true),
            Self::Servo { .. } => Some(false),
            Self::Z { .. } => None,
        }
    }
}

/// The corner of the sheet where the machine has its work zero.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Corner {
    /// x to the right, y away from the operator.
    #[default]
    LowerLeft,
    /// Front right.
    LowerRight,
    /// Back left.
    UpperLeft,
    /// Back right.
    UpperRight,
}

/// A blade that trails, or that an axis turns.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Knife {
    /// Distance of the cutting tip behind the axis it turns about.
    pub offset: Length,
    /// How far a closed contour is cut past its start.
    pub overcut: Length,
    /// Corners that turn by more degrees than this are turned with the blade lifted: to the surface where it trails, clear
    /// of it where an axis turns it. Never lifted when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lift: Option<f64>,
    /// The rotary axis that turns the blade (a tangential knife), its zero along x; absent where the blade trails.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub axis: Option<RotaryAxis>,
}

impl Knife {
    fn check(&self, machine: &Machine) -> Result<(), Fault> {
        at_least_zero("knife.offset", self.offset.mm)?;
        at_least_zero("knife.overcut", self.overcut.mm)?;
        self.lift.map_or(Ok(()), |it| within("knife.lift", it, 1.0, 179.0))?;
        let fault = |key: &str, message: &str| Err(Fault::new(key, message));
        match self.axis {
            None if self.lift.is_some() && !matches!(machine.head, Head::Z { .. }) => fault(
                "knife.lift",
                "needs [head.z]: only a Z axis can hold a trailing blade with its tip on the surface",
            ),
            Some(_) if self.offset.mm > 0.0 => fault("knife.offset", "must be 0 where an axis turns the blade"),
            Some(_) if self.lift.is_none() => {
                fault("knife.lift", "must be set where an axis turns the blade, say to 20")
            }
            Some(_) if machine.arcs => {
                fault("arcs", "must be false where an axis turns the blade: it turns between lines")
            }
            _ => Ok(()),
        }
    }
}

/// A rotary axis of G-code; its words are degrees.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum RotaryAxis {
    /// About x.
    A,
    /// About y.
    B,
    /// About z.
    C,
}

impl RotaryAxis {
    /// Its letter.
    pub fn letter(self) -> char {
        match self {
            Self::A => 'A',
            Self::B => 'B',
            Self::C => 'C',
        }
    }
}

/// A machine profile (`profiles/machines/NAME.toml`). Layers and tools are keyed by operation in kebab case
/// ("cut-outside", "score-valley", …).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Machine {
    /// Name of the profile: the built-in name, or the file name without its ending.
    #[serde(skip)]
    pub name: String,
    /// For people.
    pub title: String,
    /// Kind of machine.
    pub kind: MachineKind,
    /// Travel in x and y.
    pub bed: [Length; 2],
    /// Whether it draws a roll through: the second side of the bed is then no limit.
    #[serde(default)]
    pub roll: bool,
    /// Where the work zero is.
    #[serde(default)]
    pub origin: Corner,
    /// Whether the machine's y axis points towards the operator.
    #[serde(default)]
    pub invert_y: bool,
    /// Rapid traverse, mm/min.
    pub rapid: f64,
    /// Acceleration, mm/s².
    pub acceleration: f64,
    /// Decimals of a millimetre in G-code.
    pub decimals: usize,
    /// The G-code of its board.
    #[serde(default)]
    pub dialect: Dialect,
    /// Whether programs may hold arcs (G2, G3).
    #[serde(default = "yes")]
    pub arcs: bool,
    /// Whether plots set the speed of each tool (HPGL's `VS`); as set at the cutter otherwise.
    #[serde(default)]
    pub velocity: bool,
    /// Formats written when the config names none.
    pub formats: Vec<String>,
    /// Line width in drawings.
    pub hairline: Length,
    /// How the tool is switched.
    pub head: Head,
    /// How it is reached over a serial port.
    #[serde(default)]
    pub link: Link,
    /// The blade of a drag knife.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub knife: Option<Knife>,
    /// The axes of a mill.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mill: Option<Mill>,
    /// The carriages of a hot wire.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub wire: Option<HotWire>,
    /// Order of work; the usual one ([`Operation::ALL`]) when absent.
    #[serde(default)]
    pub order: Order,
    /// How drawings show each operation; complete.
    pub layers: PerOperation<Layer>,
    /// How the machine does each operation; one that is missing is not done by this machine.
    pub tools: PerOperation<Tool>,
}

impl Rule for Machine {
    fn check(&self) -> Result<(), Fault> {
        positive("bed", self.bed[0].mm)?;
        positive("bed", self.bed[1].mm)?;
        positive("rapid", self.rapid)?;
        positive("acceleration", self.acceleration)?;
        positive("hairline", self.hairline.mm)?;
        within("decimals", self.decimals as f64, 1.0, 6.0)?;
        if let Some(operation) = self.order.fault() {
            return Err(Fault::new("order", format!("must name `{}` exactly once", operation.name())));
        }
        self.link.check()?;
        self.check_head()?;
        self.check_axes()?;
        self.check_layers()?;
        for (operation, tool) in self.tools.iter() {
            let key = |field: &str| format!("tools.{}.{field}", operation.name());
            positive(&key("feed"), tool.feed)?;
            within(&key("power"), tool.power, 0.0, 1.0)?;
            within(&key("passes"), tool.passes.into(), 1.0, 100.0)?;
            at_least_zero(&key("kerf"), tool.kerf.mm)?;
            within(&key("lead"), tool.lead.mm, 0.0, 50.0)?;
            if let Some(bridges) = tool.bridges {
                within(&key("bridges.count"), bridges.count.into(), 1.0, 1000.0)?;
                positive(&key("bridges.width"), bridges.width.mm)?;
                bridges.height.map_or(Ok(()), |it| positive(&key("bridges.height"), it.mm))?;
            }
            tool.force.map_or(Ok(()), |it| within(&key("force"), it, 1.0, 10_000.0))?;
            within(&key("number"), tool.number.into(), 1.0, 99.0)?;
            if let Some(down) = tool.down.filter(|it| !it.is_finite()) {
                return Err(Fault::new(&key("down"), format!("must be a finite number, not {down}")));
            }
        }
        Ok(())
    }

    fn rename(&mut self, name: String) {
        self.name = name;
    }
}

impl Machine {
    /// From sheet coordinates (lower left corner, y up) to the machine's, for a sheet of that size.
    pub fn to_work(&self, point: Vec2, sheet: Vec2) -> Vec2 {
        self.flip(point - self.zero(sheet))
    }

    /// From the machine's coordinates to those of a sheet of that size.
    pub fn from_work(&self, point: Vec2, sheet: Vec2) -> Vec2 {
        self.flip(point) + self.zero(sheet)
    }

    /// Whether a tool is the blade of a cutting plotter: the one that cuts outlines. Pens and creasers of the same machine
    /// neither trail nor turn.
    pub fn is_blade(&self, tool: &Tool) -> bool {
        self.kind == MachineKind::DragKnife
            && self.tools.get(Operation::CutOutside).is_some_and(|it| it.number == tool.number)
    }

    fn flip(&self, vector: Vec2) -> Vec2 {
        Vec2::new(vector.x, if self.invert_y { -vector.y } else { vector.y })
    }

    /// The work zero in sheet coordinates.
    fn zero(&self, sheet: Vec2) -> Vec2 {
        let (x, y) = match self.origin {
            Corner::LowerLeft => (0.0, 0.0),
            Corner::LowerRight => (1.0, 0.0),
            Corner::UpperLeft => (0.0, 1.0),
            Corner::UpperRight => (1.0, 1.0),
        };
        Vec2::new(x * sheet.x, y * sheet.y)
    }

    fn check_head(&self) -> Result<(), Fault> {
        let laser = matches!(self.head, Head::Laser { .. });
        if laser != (self.kind == MachineKind::Laser) {
            let message =
                format!("does not fit `kind = \"{}\"`: a laser has [head.laser], others do not", self.kind.name());
            return Err(Fault::new("head", message));
        }
        if self.kind == MachineKind::Router && !matches!(self.head, Head::Z { .. }) {
            return Err(Fault::new("head", "does not fit `kind = \"router\"`: a router has [head.z]"));
        }
        match self.head {
            Head::Laser { power_max, .. } => positive("head.laser.power_max", power_max)?,
            Head::Servo { up, down, dwell_up, dwell_down } => {
                at_least_zero("head.servo.up", up)?;
                at_least_zero("head.servo.down", down)?;
                within("head.servo.dwell_up", dwell_up, 0.0, 10.0)?;
                within("head.servo.dwell_down", dwell_down, 0.0, 10.0)?;
                if up == down {
                    return Err(Fault::new("head.servo.down", format!("must differ from `up`, which is {up} too")));
                }
            }
            Head::Z { up, down, plunge, dwell } => {
                positive("head.z.up", up)?;
                within("head.z.down", down, -1000.0, 0.0)?;
                positive("head.z.plunge", plunge)?;
                within("head.z.dwell", dwell, 0.0, 10.0)?;
            }
        }
        match (self.knife, self.kind) {
            (Some(knife), MachineKind::DragKnife) => knife.check(self),
            (None, MachineKind::DragKnife) => {
                Err(Fault::new("kind", "drag-knife needs a table [knife] with `offset` and `overcut`"))
            }
            (Some(_), _) => Err(Fault::new("knife", format!("does not fit `kind = \"{}\"`", self.kind.name()))),
            (None, _) => Ok(()),
        }
    }

    /// Blocks are worked by a table of their own.
    fn check_axes(&self) -> Result<(), Fault> {
        for (table, kind, has) in
            [("mill", MachineKind::Mill, self.mill.is_some()), ("wire", MachineKind::HotWire, self.wire.is_some())]
        {
            if has != (self.kind == kind) {
                let message = format!(
                    "does not fit `kind = \"{}\"`: [{table}] and \"{}\" go together",
                    self.kind.name(),
                    kind.name()
                );
                return Err(Fault::new(table, message));
            }
        }
        self.mill.as_ref().map_or(Ok(()), |it| it.check(self.dialect))?;
        self.wire.as_ref().map_or(Ok(()), |it| it.check(self.dialect))
    }

    fn check_layers(&self) -> Result<(), Fault> {
        for operation in Operation::ALL {
            let key = format!("layers.{}", operation.name());
            let Some(layer) = self.layers.get(operation) else {
                return Err(Fault::new("layers", format!("must name a layer for `{}`", operation.name())));
            };
            let plain = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
            if layer.name.is_empty() || layer.name.len() > 31 || !layer.name.chars().all(plain) {
                let message = format!("must be 1 to 31 letters, digits, `_` or `-`, not `{}`", layer.name);
                return Err(Fault::new(&format!("{key}.name"), message));
            }
            for (other, twin) in self.layers.iter() {
                // DXF readers take layer names without regard to case.
                if twin.name.eq_ignore_ascii_case(&layer.name) != (twin.color == layer.color) {
                    let message = format!(
                        "and `{}` must share both name and colour or neither: software that maps by colour could not \
                         tell them apart",
                        other.name()
                    );
                    return Err(Fault::new(&key, message));
                }
            }
        }
        Ok(())
    }
}
