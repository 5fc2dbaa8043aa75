//! Piecewise developable shapes: moves the vertices of a mesh until it is developable except along few seams.

mod barrier;
pub mod energy;
mod evaluate;

pub use barrier::Weights;
pub use evaluate::{Evaluator, Parts};
