//! Algorithms on surfaces that several stages share: charts, flattening, cut graphs, opening, subdivision.

pub mod chart;
pub mod flatten;
mod subdivide;

pub use subdivide::subdivide;
