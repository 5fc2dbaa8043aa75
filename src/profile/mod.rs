//! Machine and material profiles: built into the binary, overridable by path and key by key in the config.

mod machine;
mod material;
mod units;

pub use machine::{Color, Layer, Machine, MachineKind, Tool};
pub use material::Material;
pub use units::{Angle, Extent, Length};

/// The two profiles of a job.
#[derive(Debug, Clone, PartialEq)]
pub struct Profiles {
    /// What is cut.
    pub material: Material,
    /// What cuts it.
    pub machine: Machine,
}
