//! pipeline

mod verify;

pub use verify::verify;
