//! Machine and material profiles: built into the binary, overridable by path and key by key in the config.

mod check;
mod link;
mod load;
mod machine;
mod material;
mod mill;
mod operations;
mod shape;
mod units;
mod wording;

pub use link::{Flow, Link, ModemLine, Streaming};
pub use load::{BuiltIn, MACHINES, MATERIALS, ProfileError, load_machine, load_material};
pub use machine::{Bridges, Color, Corner, Dialect, Head, Knife, Layer, Machine, MachineKind, RotaryAxis, Tool};
pub use material::{Bend, JoinKind, Joining, Material, Perforation, TabSides, ToolPatch};
pub use mill::{HotWire, LinearAxis, Mill, Rotation, TipControl, Turns};
pub use operations::{Order, PerOperation};
pub use shape::shape;
pub use units::{Angle, Extent, Length};
pub use wording::plain;

/// Share of the free area of a sheet that a piece may fill: nesting works on a grid and needs a little room.
const FITTING: f64 = 0.98;

/// The two profiles of a job.
#[derive(Debug, Clone, PartialEq)]
pub struct Profiles {
    /// What is cut.
    pub material: Material,
    /// What cuts it.
    pub machine: Machine,
}

impl Profiles {
    /// Sides of the area of a sheet on the bed in which a piece can be placed with what joins it, the shorter one first, mm.
    /// Sheets may lie on the bed either way, so the shorter sides limit each other, and so do the longer ones.
    pub fn room(&self) -> [f64; 2] {
        let sorted = |[a, b]: [Length; 2]| [a.mm.min(b.mm), a.mm.max(b.mm)];
        let (sheet, bed) = (sorted(self.material.sheet), sorted(self.machine.bed));
        let Material { margin, join, .. } = &self.material;
        let flap = if join.kind.stands_out() { join.width.mm } else { 0.0 };
        [0, 1].map(|k| (FITTING * (sheet[k].min(bed[k]) - 2.0 * margin.mm) - 2.0 * flap).max(1.0))
    }
}
