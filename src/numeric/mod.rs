//! Numerics that know no mesh: sparse factorisations, optimisers, and the monitor through which a long
//! computation reports progress and learns that it should stop.

pub mod dissection;
pub mod lanes;
mod monitor;
mod multifrontal;
pub mod optim;
pub mod quasidefinite;
pub mod random;
pub mod sparse;
pub mod symmetric3;

pub use monitor::{Cancelled, Monitor};
