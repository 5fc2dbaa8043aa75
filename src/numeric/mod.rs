//! Numerics that know no mesh: sparse factorisations, optimisers, and the monitor through which a long
//! computation reports progress and learns that it should stop.

mod monitor;
pub mod sparse;

pub use monitor::{Cancelled, Monitor};
