//! Algorithms that several stages share.

mod subdivide;

pub use subdivide::subdivide;
