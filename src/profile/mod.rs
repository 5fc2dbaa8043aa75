//! Machine and material profiles: built into the binary, overridable by path and key by key in the config.

mod check;
mod link;
mod load;
mod machine;
mod material;
mod operations;
mod units;

pub use link::{Flow, Link, ModemLine, Streaming};
pub use load::{BuiltIn, MACHINES, MATERIALS, ProfileError, load_machine, load_material};
pub use machine::{Bridges, Color, Corner, Dialect, Head, Knife, Layer, Machine, MachineKind, RotaryAxis, Tool};
pub use material::{JoinKind, Joining, Material, TabSides, ToolPatch};
pub use operations::{Order, PerOperation};
pub use units::{Angle, Extent, Length};

/// The two profiles of a job.
#[derive(Debug, Clone, PartialEq)]
pub struct Profiles {
    /// What is cut.
    pub material: Material,
    /// What cuts it.
    pub machine: Machine,
}
